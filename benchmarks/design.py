# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Predicted intervals of a designed motion and of a sine sweep of the same length and limits.

Run by hand; see README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import platform
import sys
import time

from inverse_dynamics import Array, HERE, markdown, processor_name, write
import numpy as np
from stewart_dynamics import Parameters
from stewart_dynamics.identification.identification_options import DesignOptions
from stewart_dynamics.identification.motion_design import (
    Design, design, noise_of, predicted_half_widths)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

sys.path.insert(0, str(HERE.parent / 'test'))
from sweeps import sweep  # noqa: E402, I100, I202

BEGIN, END = '<!-- design: begin -->', '<!-- design: end -->'
ROWS = ('platform.mass', 'platform.center_of_mass', 'platform.inertia',
        'actuator.viscous_friction', 'actuator.coulomb_friction')


def compared(designed: Design, half_widths: dict[str, Array]) -> list[str]:
    """Return the table: the mean interval of each kind, and the least ratio of one parameter."""
    unknowns = designed.unknowns
    names, units = ([each[n] for n in unknowns.asked] for each in (
        unknowns.names, unknowns.units))
    rows: list[tuple[str, ...]] = [('half of the 95 % interval', 'unit', 'designed', *(
        part for label in half_widths for part in (label, 'times wider', 'at least')))]
    for kind in ROWS:
        of_kind = [n for n, name in enumerate(names) if name.startswith(kind)]
        mine = designed.half_widths[of_kind]
        row = [f'`{kind}`', units[of_kind[0]], f'{mine.mean():.2g}']
        for values in half_widths.values():
            ratios = values[of_kind] / mine
            row += [f'{values[of_kind].mean():.2g}', f'{ratios.mean():.1f}',
                    f'{ratios.min():.1f}']
        rows.append(tuple(row))
    return markdown(rows)


def main() -> None:
    """Design, compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--params', type=Path, default=HERE.parent / 'config' / 'platform.yaml')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--generations', type=int, default=DesignOptions().generations)
    parser.add_argument('--write', action='store_true', help='put the table into results/')
    options = parser.parse_args()
    parameters = Parameters.from_yaml(options.params)
    asked = DesignOptions(seed=options.seed, generations=options.generations)
    lines = ['']
    for title, file in (
            ('The file with its uncertainty:', parameters),
            ('All but platform and friction known exactly, so that noise alone counts:',
             parameters.replaced({f'uncertainty.{name}': 0.0 for name in (
                 'leg_mass', 'reflected_mass', 'effort_gain', 'tilt')}))):
        platform_ = StewartPlatform(file)
        begin = time.process_time()
        designed = design(file, asked)
        took = time.process_time() - begin
        half_widths = {label: predicted_half_widths(
            platform_, designed.unknowns, sweep(platform_, asked, together), asked.duration, asked)
            for label, together in (('sweeps in turn', False), ('sweeps at once', True))}
        scales = designed.unknowns.deviations[designed.unknowns.asked]
        in_turn, at_once = (float(np.sqrt(np.sum((each / scales) ** 2) / np.sum(
            (designed.half_widths / scales) ** 2))) for each in half_widths.values())
        lines += [title, '', *compared(designed, half_widths), '', (
            'By the root of the mean square of all intervals, each divided by that of the file, '
            f'{in_turn:.1f} times narrower than from sweeps in turn, {at_once:.1f} times than '
            'from sweeps at once.'), '']
    lines += [(
        f'{asked.duration:.0f} s up to {asked.frequency:g} Hz, efforts at {asked.rate:g} Hz with '
        f'white noise of {noise_of(asked, file):g} N. A design takes {took:.0f} s of processor '
        f'time, seed {asked.seed}.'), '', (
        f'{processor_name()}, {len(os.sched_getaffinity(0))} cores. Python '
        f'{platform.python_version()}.'), '']
    print('\n'.join(lines))
    if options.write:
        write(lines, BEGIN, END)


if __name__ == '__main__':
    main()
