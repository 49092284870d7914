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

"""``stewart_identify --design``: options, parameter file and terminal output."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
import sys
import time
from typing import TYPE_CHECKING

from stewart_dynamics.errors import StewartError
from stewart_dynamics.identification.identification_options import (
    DesignOptions, IdentificationOptions)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import arguments_of, between, whole

if TYPE_CHECKING:
    from stewart_dynamics.identification.design import Design

TRAJECTORY = 'trajectory.yaml'


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that only a design has."""
    default = DesignOptions()
    group = parser.add_argument_group('design of a motion (--design)')
    group.add_argument('--design', action='store_true',
                       help='identify nothing, but design a motion from which the parameters of '
                            f'--identify are identifiable: DIR/{TRAJECTORY} (default DIR: '
                            'designed), for stewart_trajectory, within the limits of the '
                            'parameter file')
    group.add_argument('--duration', type=between(2.0, 3600.0), default=default.duration,
                       metavar='S', help='of the motion (default: %(default)g)')
    group.add_argument('--highest-frequency', dest='frequency', type=between(0.01, 100.0),
                       default=default.frequency, metavar='HZ',
                       help='of the motion, below --cutoff (default: %(default)g)')
    group.add_argument('--harmonics', type=whole(1, 50), default=default.harmonics, metavar='N',
                       help='of the Fourier series (default: %(default)s)')
    group.add_argument('--amplitude', type=between(1e-6, 1e3), metavar='M',
                       help='displacement of the platform at most, and of its joints by turns; '
                            'instead of limits that the parameter file lacks')
    group.add_argument('--center', type=between(-1e3, 1e3), nargs=6,
                       metavar=('X', 'Y', 'Z', 'ALPHA', 'BETA', 'GAMMA'),
                       help='pose about which it moves, where it begins and ends [m, rad] '
                            '(default: home)')
    group.add_argument('--noise', type=between(1e-9, 1e9), default=default.noise, metavar='N',
                       help='standard deviation of the measured efforts, for the predicted '
                            'intervals (default: %(default)g)')
    group.add_argument('--rate', type=between(1.0, 1e4), default=default.rate, metavar='HZ',
                       help='of setpoints and measured efforts (default: %(default)g)')
    group.add_argument('--generations', type=whole(1, 100000), default=default.generations,
                       metavar='N', help='of the search; more take longer (default: %(default)s)')
    group.add_argument('--seed', type=whole(0, 2 ** 32 - 1), default=default.seed, metavar='N',
                       help='equal seeds give equal motions (default: %(default)s)')


def run(given: argparse.Namespace, parameters: Parameters) -> None:
    """Design a motion, write it and print its predicted intervals."""
    # Imported here, so that --help is fast.
    from stewart_dynamics.identification.design import design
    from stewart_dynamics.parameters.yaml_file import write_yaml
    from stewart_dynamics.reporting.results_folder import (
        check_free, remove_abandoned, whole_folder)
    from tqdm import tqdm

    if given.frequency > given.cutoff:
        raise StewartError(f'--highest-frequency {given.frequency:g} Hz: must be at most '
                           f'--cutoff, {given.cutoff:g} Hz: nothing above passes the filter')
    folder = given.output or Path('designed')
    options = IdentificationOptions(force=given.force)
    check_free(folder, options, TRAJECTORY)
    remove_abandoned([folder])
    asked = DesignOptions(**arguments_of(given, DesignOptions._fields))
    print(f'designing a motion of {asked.duration:g} s in {asked.generations} generations: takes '
          'about half a minute on an idle computer, minutes on a loaded one',
          file=sys.stderr, flush=True)
    tenth = max(1, asked.generations // 10)
    begun = time.monotonic()

    def progress(done: int) -> None:
        bar.update(done - bar.n)
        if bar.disable and done % tenth == 0:  # no terminal
            elapsed = time.monotonic() - begun
            print(f'designed {100 * done // asked.generations} %, about '
                  f'{elapsed * (asked.generations / done - 1.0):.0f} s left',
                  file=sys.stderr, flush=True)

    with tqdm(total=asked.generations, disable=None, leave=False, dynamic_ncols=True,
              bar_format='{percentage:3.0f}%|{bar}| designing, {remaining} left') as bar:
        designed = design(parameters, asked, progress)
    with whole_folder(folder, options, TRAJECTORY) as partial:
        path = partial / TRAJECTORY
        given_values = designed.trajectory.given
        head = ''.join(f'# {line}'.rstrip() + '\n' for line in _head(designed, asked))
        write_yaml(path, given_values, {
            name: designed.trajectory.table[name].unit for name in given_values}, head)
    print('\n'.join(_lines(designed, asked)))
    print(f'\nmotion: {folder / TRAJECTORY}, for stewart_trajectory --ros-args --params-file')


def _head(designed: Design, asked: DesignOptions) -> Iterator[str]:
    yield f'Designed to identify {", ".join(asked.kinds)}, seed {asked.seed}. Predicted 95 %'
    yield f'intervals for white noise of {asked.noise:g} N in efforts at {asked.rate:g} Hz:'
    for name, unit, half in zip(designed.unknowns.names, designed.unknowns.units,
                                designed.half_widths, strict=True):
        yield f'  {name}: +- {half:.2g} {unit}'
    yield 'Of what is free between home and the limits, less their margins, it uses:'
    yield from (f'  {part:.0%} of {name}' for name, part in designed.use.items())


def _lines(designed: Design, asked: DesignOptions) -> Iterator[str]:
    """Yield the lines for the terminal; of the six legs the widest interval is shown."""
    yield (f'predicted 95 % intervals: {asked.duration:g} s, white noise of {asked.noise:g} N in '
           f'efforts at {asked.rate:g} Hz')
    unknowns = designed.unknowns
    of_legs: dict[str, tuple[float, str]] = {}
    for n, (name, unit, half) in enumerate(zip(
            unknowns.names, unknowns.units, designed.half_widths, strict=True)):
        if n in unknowns.legs:  # the name of a leg parameter ends with the name of the leg
            name = name.rpartition('.')[0]
        of_legs[name] = max(of_legs.get(name, (0.0, unit)), (float(half), unit))
    for name, (half, unit) in of_legs.items():
        yield f'  {name:32} +- {half:<10.2g} {unit}'
    used = ', '.join(f'{part:.0%} of {name}' for name, part in designed.use.items())
    yield f'uses, of what is free between home and the limits less their margins: {used}'
