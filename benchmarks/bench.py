# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Run ``make bench``: the library's calls and the starts, then all figures with their targets.

see README.md beside this file.
"""

from __future__ import annotations

import argparse

import forward
import inverse_dynamics
from inverse_dynamics import Figure, summary, write
import moving_base
import starts

BEGIN, END = '<!-- summary: begin -->', '<!-- summary: end -->'


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--rounds', type=int, default=inverse_dynamics.ROUNDS,
                        help='turns of each call (%(default)s)')
    parser.add_argument('--samples', type=int, default=inverse_dynamics.SAMPLES,
                        help='in a batch (%(default)s)')
    parser.add_argument('--starts', type=int, default=12, help='of each program (%(default)s)')
    parser.add_argument('--write', action='store_true', help='put the tables into results/')
    options = parser.parse_args()
    if min(options.rounds, options.samples, options.starts) < 1:
        parser.error('--rounds, --samples and --starts must be at least 1')

    figures: list[Figure] = []
    for begin, end, (lines, found) in (
            (inverse_dynamics.BEGIN, inverse_dynamics.END,
             inverse_dynamics.run(options.rounds, options.samples)),
            (forward.BEGIN, forward.END, forward.run(options.rounds)),
            (moving_base.BEGIN, moving_base.END, moving_base.run(options.rounds)),
            (starts.BEGIN, starts.END, starts.run(options.starts))):
        print('\n'.join(lines))
        figures += found
        if options.write:
            write(lines, begin, end)
    lines = ['', *summary(figures), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
