# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Study of how often the bands of ``stewart_replay --response`` contain the truth.

Kinds of excitation, 1 to 6 axes and levels of noise, see ``test/response_cases.py``. Run by hand,
``make bench-response``; see README.md in this folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import os
import sys
from typing import NamedTuple

from inverse_dynamics import HERE, markdown, measured_on, write
import numpy as np

sys.path.append(str(HERE.parent / 'test'))
from response_cases import EXCITATIONS, Judged, judged, NOISES  # noqa: E402, I100, I202

BEGIN, END = '<!-- response: begin -->', '<!-- response: end -->'
AXES = 1, 2, 3, 6


class Case(NamedTuple):
    """A recording."""

    kind: str
    axes: int
    noise: float
    seed: int


def outcome_of(case: Case) -> Judged:
    """Return the answers to a recording."""
    return judged(*case)


def row(name: str, several: Sequence[Judged], axes: int) -> tuple[str, ...]:
    """Return the figures of several recordings."""
    own = [each for one in several for each in one.own]
    if not own:
        return name, '-', '-', '-', '-', f'0 of {axes}', '-'
    radii, bandwidths, delays = (
        [each for one in several for each in getattr(one, key)]
        for key in ('radii', 'bandwidths', 'delays'))
    stated = sum(one.stated for one in several)
    false = sum(one.false for one in several)
    return (name, f'{100.0 * np.mean(own):.1f} %', f'{np.median(radii):.2g}',
            f'{100.0 * np.max(np.abs(np.array(bandwidths) - 1.0), initial=0.0):.2g} %',
            f'{1e3 * np.max(np.abs(delays), initial=0.0):.2g} ms', f'{stated} of {axes}',
            f'{false} of {5 * stated}')


HEAD = ('', 'truth in bands', 'half of a band by the gain', '-3 dB off by at most',
        'delay off by at most', 'axes stated', 'false cross terms')


def study(seeds: int, only: str) -> list[str]:
    """Return the tables."""
    cases = [Case(kind, axes, noise, seed) for kind in EXCITATIONS if only in kind
             for axes in AXES for noise in NOISES for seed in range(seeds)]
    for name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
        os.environ[name] = '1'
    with ProcessPoolExecutor(2, get_context('spawn')) as pool:
        found = dict(zip(cases, pool.map(outcome_of, cases, chunksize=2), strict=True))
    lines = []
    for key, values in (('kind', [each for each in EXCITATIONS if only in each]), ('axes', AXES),
                        ('noise', NOISES)):
        rows = []
        for value in values:
            chosen = [case for case in cases if getattr(case, key) == value]
            rows.append(row(f'{value}' if key == 'kind' else f'{key} {value:g}',
                            [found[case] for case in chosen], sum(case.axes for case in chosen)))
        lines += ['', *markdown([HEAD, *rows])]
    return [*lines, '', f'{seeds} seeds of each kind, number of axes and level of noise.', '']


def main() -> None:
    """Run the study and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=3, help='of each case (%(default)s)')
    parser.add_argument('--only', default='', help='kinds that contain this text')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    lines = [*study(options.seeds, options.only), measured_on(), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
