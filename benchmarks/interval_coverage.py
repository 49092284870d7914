# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Study of how often the intervals of stewart_identify contain the truth, from motions of 0.1 mm.

The noise is the same for all motions. Run by hand, ``make bench-coverage``; see README.md in this
folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
import sys
from typing import NamedTuple

from inverse_dynamics import HERE, markdown, measured_on, write
import numpy as np

from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.results import document, IDENTIFIED
from stewart_dynamics.identification.unknowns import Unknowns

sys.path.append(str(HERE.parent / 'test'))
from recorded import AMPLITUDES, fourier  # noqa: E402, I100, I202
from wrong_models import Case, identify, simulated, true_hexapod  # noqa: E402, I202

BEGIN, END = '<!-- coverage: begin -->', '<!-- coverage: end -->'
# RMS of the displacement along x [mm]; the other coordinates are in proportion.
DISPLACEMENTS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


class Answer(NamedTuple):
    """Result of one identification."""

    noticed: bool
    """Whether a notice says that intervals may not hold, or the run is rejected."""
    held: tuple[bool, ...]
    """Whether each interval contains the true value."""
    coulomb: tuple[bool, ...]
    """The same for Coulomb friction."""


def answer(given: tuple[float, int]) -> Answer:
    """Return the answer for one displacement [mm] and seed."""
    displacement, seed = given
    case = Case(true_hexapod(seed))
    motion = fourier(seed, size=1e-3 * displacement / AMPLITUDES[0])
    found = identify(simulated(case, seed, motion))
    result = document(found, IdentificationOptions())
    held = {each['name']: each['interval'][0] < true < each['interval'][1]
            for each, true in zip(result['parameters'], Unknowns(case.true).start, strict=True)
            if each['state'] == IDENTIFIED and each['interval']}
    noticed = bool(found.likely or found.lack_of_fit or found.bags[0].notices)
    return Answer(noticed, tuple(held.values()), tuple(
        each for name, each in held.items() if 'coulomb' in name))


def row(displacement: float, answers: Sequence[Answer]) -> tuple[str, ...]:
    """Return a row of the table."""
    return (f'{displacement:g} mm', f'{sum(each.noticed for each in answers)} of {len(answers)}',
            *(share for noticed in (False, True) for share in (
                _share([each.held for each in answers if each.noticed == noticed]),
                _share([each.coulomb for each in answers if each.noticed == noticed]))))


def _share(held: Sequence[tuple[bool, ...]]) -> str:
    each = [one for of_run in held for one in of_run]
    return f'{100.0 * np.mean(each):.1f} % of {len(each)}' if each else '-'


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=40, help='of each motion (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the table into README.md')
    options = parser.parse_args()
    runs = [(each, seed) for each in DISPLACEMENTS for seed in range(options.seeds)]
    with ProcessPoolExecutor(2) as pool:
        answers = list(pool.map(answer, runs, chunksize=4))
    rows: list[tuple[str, ...]] = [(
        'RMS displacement', 'notice', 'truth in intervals, no notice', 'Coulomb friction',
        'truth in intervals, notice', 'Coulomb friction')]
    rows += [row(each, [found for found, (of, _) in zip(answers, runs, strict=True) if of == each])
             for each in DISPLACEMENTS]
    lines = ['', *markdown(rows), '', measured_on(), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
