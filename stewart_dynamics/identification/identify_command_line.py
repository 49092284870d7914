# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_identify, and of its design of a motion."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
import shlex
import time
from typing import TYPE_CHECKING

from stewart_dynamics.errors import StewartError
from stewart_dynamics.estimation.confidence_level import INTERVAL
from stewart_dynamics.identification.identification_options import (
    CUTOFF, DesignOptions, IdentificationOptions)
from stewart_dynamics.identification.unknowns import DEFAULT, KINDS, PLATFORM
from stewart_dynamics.program import (
    add_accepted, add_motor_efforts, add_node, add_parameters, add_report, arguments_of, between,
    DONE, names_of, Program, share, whole)
from stewart_dynamics.reporting.estimates import HOLD_OUT
from stewart_dynamics.reporting.results_folder import DESIGNED, DESIGNED_MOTION, IDENTIFIED
from stewart_dynamics.signals import interrupt_on_signals

if TYPE_CHECKING:
    from stewart_dynamics.identification.motion_design import Design
    from stewart_dynamics.parameters.table import Parameters

_PROGRAM = Program(
    'stewart_identify', 'parameters or bags, or a possible error',
    'a requested parameter is not identifiable', partly=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    parser = _arguments()
    given = parser.parse_args(arguments)
    if bool(given.bags) == given.design:
        parser.error('--design takes no BAG' if given.design else
                     'the following arguments are required: BAG')
    return _PROGRAM.exit_code(lambda: _run(given))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Identify mass, center of mass, inertia and friction of a hexapod from the '
                    'measured legs of recorded motions.',
        files='DIR/ gets identified.yaml (the whole parameter file, for the node), '
              'identification.json and report.html.')
    parser.add_argument('bags', nargs='*', type=Path, metavar='BAG',
                        help='rosbag2 folder, .mcap or .db3 file, .bag file of ROS 1, or a folder '
                             'with bags in it; several are of one and the same hexapod')
    add_parameters(parser, ', as far as they are known')
    _PROGRAM.add_results(parser, IDENTIFIED)
    parser.set_defaults(output=None)  # --design has another one
    add_report(parser)
    topics = parser.add_argument_group('topics')
    add_node(topics, ', and name before the usual topic, NAME/measured_legs')
    topics.add_argument('--measured', metavar='TOPIC,...',
                        help='JointState with positions and efforts, and rates where they are; '
                             'several topics where each has some of the legs')
    topics.add_argument('--efforts', metavar='TOPIC',
                        help='another JointState with the efforts, at stamps of its own')
    what = parser.add_argument_group('what is identified, and how')
    what.add_argument('--identify', dest='kinds', type=_kinds, default=DEFAULT, metavar='LIST',
                      help=f'of {", ".join(KINDS)}, with commas (default: {",".join(DEFAULT)}); '
                           'parts of the legs that the hexapod has; tilt is the direction of '
                           'gravity, for a base that is not level')
    add_motor_efforts(what)
    what.add_argument('--cutoff', type=between(0.1, 1000.0), default=CUTOFF, metavar='HZ',
                      help='cut-off frequency of the filter on both sides of the regression '
                           f'(default: {CUTOFF:g}): above the frequencies of the motion')
    what.add_argument('--hold-out', type=share(0.9), default=HOLD_OUT, metavar='PART',
                      help='end of each bag that validates a fit to the rest; 0: none '
                           f'(default: {HOLD_OUT:g})')
    what.add_argument('--no-delay', dest='delay', action='store_false',
                      help='efforts are not delayed; by default the delay is estimated')
    add_accepted(what)
    _add_design(parser)
    return parser


def _add_design(parser: argparse.ArgumentParser) -> None:
    """Add the options that only a design has."""
    group = parser.add_argument_group('design of a motion (--design)')
    group.add_argument('--design', action='store_true',
                       help='identify nothing, but design a motion from which the parameters of '
                            f'--identify are identifiable: DIR/{DESIGNED_MOTION} (default DIR: '
                            f'{DESIGNED}), for stewart_trajectory, within the limits of the '
                            'parameter file')
    group.add_argument('--duration', type=between(2.0, 3600.0), metavar='S',
                       help='of the motion (default: %(default)g)')
    group.add_argument('--highest-frequency', dest='frequency', type=between(0.01, 100.0),
                       metavar='HZ', help='of the motion, below --cutoff (default: %(default)g)')
    group.add_argument('--harmonics', type=whole(1, 50), metavar='N',
                       help='of the Fourier series (default: %(default)s)')
    group.add_argument('--amplitude', type=between(1e-6, 1e3), metavar='M',
                       help='displacement of the platform at most, and of its joints by turns; '
                            'instead of limits that the parameter file lacks')
    group.add_argument('--center', type=between(-1e3, 1e3), nargs=6,
                       metavar=('X', 'Y', 'Z', 'ALPHA', 'BETA', 'GAMMA'),
                       help='pose about which it moves, where it begins and ends [m, rad] '
                            '(default: home)')
    group.add_argument('--noise', type=between(1e-9, 1e9), metavar='N',
                       help='standard deviation of the measured efforts [N, N m], for the '
                            'predicted intervals (default: 5 N, of torques a hundredth of those '
                            'that hold the platform)')
    group.add_argument('--rate', type=between(1.0, 1e4), metavar='HZ',
                       help='of setpoints and measured efforts (default: %(default)g)')
    group.add_argument('--generations', type=whole(1, 100000), metavar='N',
                       help='of the search; more take longer (default: %(default)s)')
    group.add_argument('--seed', type=whole(0, 2 ** 32 - 1), metavar='N',
                       help='equal seeds give equal motions (default: %(default)s)')
    parser.set_defaults(**DesignOptions()._asdict())


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.bags.find import find_bags
    from stewart_dynamics.identification.identification_results import result_text, run
    from stewart_dynamics.mechanics.parameter_errors import (
        find_option_errors, find_parameter_errors)
    from stewart_dynamics.parameters.table import Parameters

    interrupt_on_signals()
    options = IdentificationOptions(**arguments_of(given, IdentificationOptions._fields))
    parameters = Parameters.from_yaml(given.params, given.node)
    if given.design:
        _PROGRAM.warn(find_option_errors(parameters, {'--center': given.center}, {}))
        _design(given, parameters)
        return DONE
    output = given.output or Path(IDENTIFIED)
    bags = [bag for path in given.bags for bag in find_bags(path, output)]
    _PROGRAM.prepare(find_parameter_errors(parameters))
    result = run(bags, parameters, output, options, _PROGRAM.complain)
    _PROGRAM.say(result_text(result))
    return _PROGRAM.end(output, {bag.bag: bag.missing for bag in result.bags},
                        given.strict and not result.is_complete)


def _kinds(text: str) -> tuple[str, ...]:
    kinds = names_of(text)
    for kind in kinds:
        if kind not in KINDS:
            raise argparse.ArgumentTypeError(
                f'{kind!r}: cannot be identified; known are {", ".join(KINDS)}')
    return kinds


# -- the design of a motion -----------------------------------------------------------------------

def _design(given: argparse.Namespace, parameters: Parameters) -> None:
    """Design a motion, write it and print its predicted intervals."""
    # Imported here, so that --help is fast.
    from stewart_dynamics.identification.motion_design import design
    from stewart_dynamics.parameters.yaml_file import write_yaml
    from stewart_dynamics.reporting.results_folder import (
        check_free, remove_abandoned, whole_folder)
    from tqdm import tqdm

    if given.frequency > given.cutoff:
        raise StewartError(f'--highest-frequency {given.frequency:g} Hz: must be at most '
                           f'--cutoff, {given.cutoff:g} Hz: nothing above passes the filter')
    folder = given.output or Path(DESIGNED)
    options = IdentificationOptions(force=given.force)
    before = check_free(folder, options, DESIGNED_MOTION)
    remove_abandoned([folder])
    asked = DesignOptions(**arguments_of(given, DesignOptions._fields))
    _PROGRAM.complain(
        f'designing a motion of {asked.duration:g} s in {asked.generations} generations: takes '
        'about half a minute on an idle computer, minutes on a loaded one')
    tenth = max(1, asked.generations // 10)
    begun = time.monotonic()

    def progress(done: int) -> None:
        bar.update(done - bar.n)
        if bar.disable and done % tenth == 0:  # no terminal
            elapsed = time.monotonic() - begun
            _PROGRAM.complain(f'designed {100 * done // asked.generations} %, about '
                              f'{elapsed * (asked.generations / done - 1.0):.0f} s left')

    with tqdm(total=asked.generations, disable=None, leave=False, dynamic_ncols=True,
              bar_format='{percentage:3.0f}%|{bar}| designing, {remaining} left') as bar:
        designed = design(parameters, asked, progress)
    lines = list(_design_lines(designed, asked, parameters))
    with whole_folder(folder, options, DESIGNED_MOTION, before) as partial:
        path = partial / DESIGNED_MOTION
        given_values = designed.trajectory.given
        head = ''.join(f'# {line}'.rstrip() + '\n' for line in (
            f'Designed to identify {", ".join(asked.kinds)}, seed {asked.seed}.', *lines))
        write_yaml(path, given_values, {
            name: designed.trajectory.table[name].unit for name in given_values}, head)
    _PROGRAM.say('\n'.join([*lines, '', 'motion: ' + shlex.join([
        'stewart_trajectory', '--ros-args', '--params-file', str(folder / DESIGNED_MOTION)])]))


def _design_lines(designed: Design, asked: DesignOptions, parameters: Parameters,
                  ) -> Iterator[str]:
    """Yield predicted intervals, of the six legs the widest, and the use of the limits."""
    from stewart_dynamics.identification.motion_design import noise_of

    noise = float(f'{noise_of(asked, parameters):.3g}')
    yield (f'predicted {INTERVAL}s: {asked.duration:g} s, white noise of {noise:g} '
           f'{parameters.leg_kind.effort.unit} in efforts at {asked.rate:g} Hz')
    unknowns = designed.unknowns
    of_legs: dict[str, tuple[float, str]] = {}
    for n, half in zip(unknowns.asked, designed.half_widths, strict=True):
        name, unit = unknowns.names[n], unknowns.units[n]
        if PLATFORM <= n < unknowns.count:  # the name of a leg's ends with the name of the leg
            name = name.rpartition('.')[0]
        of_legs[name] = max(of_legs.get(name, (0.0, unit)), (float(half), unit))
    for name, (half, unit) in of_legs.items():
        yield f'  {name:32} +- {half:<10.2g} {unit}'
    used = ', '.join(f'{part:.0%} of {name}' for name, part in designed.use.items())
    yield f'use of the range between home and the limits with their margins: {used}'
