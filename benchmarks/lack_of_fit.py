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
Study of how often stewart_identify detects a wrong model and names the right cause.

Recordings are simulated with one error each relative to the parameter file, and others without
an error, and are identified without bag files. Run by hand, ``make
bench-lack-of-fit``; see README.md in this folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
import sys
from typing import NamedTuple

from inverse_dynamics import HERE, markdown, measured_on, write
import numpy as np

from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.least_squares import TWO_SIDED

sys.path.append(str(HERE.parent / 'test'))
from referees import rng  # noqa: E402, I100, I202
from wrong_models import Case, CAUSES, identify, RIGHT, simulated, true_hexapod  # noqa: E402, I202

BEGIN, END = '<!-- lack of fit: begin -->', '<!-- lack of fit: end -->'


class Answer(NamedTuple):
    """Result of one identification."""

    cause: str | None
    """Likeliest cause; None: no notice."""
    rejected: bool
    """Whether the run is rejected as a likely mistake."""
    held: float
    """Share of the 95 % intervals that contain the true value; nan: no intervals."""
    narrow: float
    """Share without the widening."""


def answer(given: tuple[str, int]) -> Answer:
    """Return the answer for one cause and seed."""
    name, seed = given
    true = true_hexapod(seed)
    case = Case(true) if name == RIGHT else CAUSES[name][0](true, rng(1000 + seed))
    found = identify(simulated(case, seed))
    lack = found.lack_of_fit
    off = np.abs(found.fit.values - Unknowns(case.true).start)
    half = TWO_SIDED * np.sqrt(np.diag(found.errors.covariance))
    wide = half if lack is None else half + lack.shifts
    return Answer(
        lack.causes[0].what if lack else None, bool(found.likely),
        float('nan') if lack and lack.unexplained else float(np.mean(off < wide)),
        float(np.mean(off < half)))


def row(name: str, answers: Sequence[Answer], right: Sequence[str]) -> tuple[str, ...]:
    """Return a row of the table."""
    count = len(answers)
    noticed = sum(each.cause is not None for each in answers)
    named = sum(each.cause in right for each in answers) if right else 0
    held = [each.held for each in answers if not np.isnan(each.held)]
    return (
        name, f'{noticed} of {count}', f'{named} of {count}' if right else '',
        f'{100.0 * np.mean([each.narrow for each in answers]):.0f} %',
        f'{100.0 * np.mean(held):.0f} %' if held else '-', f'{count - len(held)}',
        f'{sum(each.rejected for each in answers)}')


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=16, help='of each cause (%(default)s)')
    parser.add_argument('--right', type=int, default=200, help='right models (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the table into README.md')
    options = parser.parse_args()
    runs = [(name, seed) for name in CAUSES for seed in range(options.seeds)]
    runs += [(RIGHT, 1000 + seed) for seed in range(options.right)]
    with ProcessPoolExecutor(2) as pool:
        answers = list(pool.map(answer, runs, chunksize=4))
    rows: list[tuple[str, ...]] = [(
        'error of the parameter file', 'notice', 'right cause', 'truth in intervals of noise',
        'in the intervals given', 'no intervals', 'rejected')]
    for name, (_, right) in CAUSES.items():
        rows.append(row(name, [each for each, (of, _) in zip(answers, runs, strict=True)
                               if of == name], right))
    wrong = answers[:len(CAUSES) * options.seeds]
    found = [each.cause in CAUSES[name][1] for each, (name, _) in zip(
        wrong, runs[:len(wrong)], strict=True)]
    total = row('all', wrong, ())
    rows.append((total[0], total[1], f'{sum(found)} of {len(found)}', *total[3:]))
    rows.append(row('nothing: the model is right', answers[len(wrong):], ()))
    lines = ['', *markdown(rows), '', measured_on(), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
