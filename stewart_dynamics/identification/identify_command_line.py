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

"""The command line of stewart_identify."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stewart_dynamics.identification import design_command
from stewart_dynamics.identification.identification_options import (
    CUTOFF, IdentificationOptions)
from stewart_dynamics.identification.unknowns import DEFAULT, KINDS
from stewart_dynamics.program import (
    add_results, arguments_of, between, DONE, interrupt_on_signals, node_name, PARTLY_READ,
    Program)
from stewart_dynamics.replay.replay_options import NODE
from stewart_dynamics.reporting.estimates import HOLD_OUT, is_complete

NOT_ALL_IDENTIFIED = 1
_PROGRAM = Program('stewart_identify')


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
        epilog='DIR/ gets identified.yaml (the whole parameter file, for the node), '
               'identification.json and report.html.\n\nexit codes: 0 done; 1 with --strict, '
               'when a requested parameter is not identifiable;\n2 bad arguments, '
               'parameters or bags, or a likely mistake; 3 part of a bag could not be read, the '
               'rest is done; 130 interrupted')
    parser.add_argument('bags', nargs='*', type=Path, metavar='BAG',
                        help='rosbag2 folder, .mcap or .db3 file, .bag file of ROS 1, or a folder '
                             'with bags in it; several are of one and the same hexapod')
    parser.add_argument('--params', required=True, type=Path, metavar='FILE',
                        help='parameters of the hexapod as far as they are known, the file that '
                             'the node takes')
    add_results(parser, 'identified', 'a requested parameter is not identifiable')
    parser.set_defaults(output=None)  # --design has another one
    parser.add_argument('--no-report', dest='report', action='store_false',
                        help='write no report.html')
    topics = parser.add_argument_group('topics')
    topics.add_argument('--node', default=NODE, metavar='NAME', type=node_name,
                        help=f'name before the usual topic, NAME/measured_legs (default: {NODE})')
    topics.add_argument('--measured', metavar='TOPIC',
                        help='JointState with positions and efforts, and rates where they are')
    topics.add_argument('--efforts', metavar='TOPIC',
                        help='another JointState with the efforts, at stamps of its own')
    what = parser.add_argument_group('what is identified, and how')
    what.add_argument('--identify', dest='kinds', type=_kinds, default=DEFAULT, metavar='LIST',
                      help=f'of {", ".join(KINDS)}, with commas (default: {",".join(DEFAULT)}); '
                           'tilt is the direction of gravity, for a base that is not level')
    motors = what.add_mutually_exclusive_group()
    motors.add_argument('--motor-torque', action='store_true',
                        help='efforts are torques of the motors [N m]; needs actuator.screw_lead, '
                             'and drive.gear_ratio where there is a gear')
    motors.add_argument('--motor-current', action='store_true',
                        help='efforts are currents of the motors [A]; needs drive.torque_constant '
                             'as well')
    what.add_argument('--cutoff', type=between(0.1, 1000.0), default=CUTOFF, metavar='HZ',
                      help='cut-off frequency of the filter on both sides of the regression '
                           f'(default: {CUTOFF:g}): above the frequencies of the motion')
    what.add_argument('--prior', type=between(1e-6, 1e3), metavar='PART',
                      help="the file's values count, as if known to this part of their size")
    what.add_argument('--hold-out', type=between(0.0, 0.9), default=HOLD_OUT, metavar='PART',
                      help='end of each bag that validates a fit to the rest; 0: none '
                           f'(default: {HOLD_OUT:g})')
    what.add_argument('--no-delay', dest='delay', action='store_false',
                      help='efforts are not delayed; by default the delay is estimated')
    what.add_argument('--accept-mistakes', action='store_true',
                      help='write results although a mistake is likely')
    design_command.add_options(parser)
    return parser


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.bags.find import find_bags
    from stewart_dynamics.identification.results import FUNCTIONS, result_text, run
    from stewart_dynamics.mechanics.likely_mistakes import likely_mistakes
    from stewart_dynamics.parameters.table import Parameters

    interrupt_on_signals()
    options = IdentificationOptions(**arguments_of(given, IdentificationOptions._fields))
    parameters = Parameters.from_yaml(given.params, given.node)
    if given.design:
        design_command.run(given, parameters)
        return DONE
    output = given.output or Path('identified')
    bags = [bag for path in given.bags for bag in find_bags(path, output)]
    _PROGRAM.prepare(FUNCTIONS, likely_mistakes(parameters))
    result = run(bags, parameters, output, options, _PROGRAM.complain)
    _PROGRAM.say(result_text(result))
    _PROGRAM.say(f'results: {output}')
    missing = [f'{bag["bag"]}: part of it could not be read: {"; ".join(bag["missing"])}'
               for bag in result['bags'] if bag['missing']]
    for text in missing:
        _PROGRAM.complain(text)
    if missing:
        return PARTLY_READ
    return NOT_ALL_IDENTIFIED if given.strict and not is_complete(result) else DONE


def _kinds(text: str) -> tuple[str, ...]:
    kinds = tuple(dict.fromkeys(each.strip() for each in text.split(',') if each.strip()))
    for kind in kinds:
        if kind not in KINDS:
            raise argparse.ArgumentTypeError(
                f'{kind!r}: cannot be identified; known are {", ".join(KINDS)}')
    if not kinds:
        raise argparse.ArgumentTypeError('names nothing')
    return kinds
