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

"""The command line of stewart_calibrate."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stewart_dynamics.calibration import design_command
from stewart_dynamics.program import (
    add_results, between, DONE, interrupt_on_signals, node_name, PARTLY_READ, partly_read,
    Program)
from stewart_dynamics.replay.replay_options import NODE
from stewart_dynamics.reporting.estimates import HOLD_OUT, is_complete

NOT_ALL_IDENTIFIED = 1
_PROGRAM = Program('stewart_calibrate')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    parser = _arguments()
    given = parser.parse_args(arguments)
    if (given.poses is None) == (given.design is None):
        parser.error('the following arguments are required: POSES' if given.poses is None else
                     '--design takes no POSES')
    return _PROGRAM.exit_code(lambda: _run(given))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description="Calibrate a hexapod's geometry, base joints, platform joints and zero "
                    'lengths, from leg positions and poses that a tracker, camera or probe '
                    'measured.',
        epilog='DIR/ gets calibrated.yaml (the whole parameter file, for the node), '
               'calibration.json and report.html.\n\nexit codes: 0 done; 1 with --strict, '
               'when a number is not identifiable or there is a lack of fit;\n2 bad arguments, '
               'parameters or poses, or a likely mistake: nothing is written; 3 part of a bag '
               'could not be read, the rest is done; 130 interrupted')
    parser.add_argument('poses', nargs='?', type=Path, metavar='POSES',
                        help='CSV file with a column for each leg (its position, as '
                             '~/leg_states has it), x, y, z [m] and qx, qy, qz, qw, or alpha, '
                             'beta, gamma [rad]; or a bag with measured legs and poses')
    parser.add_argument('--params', required=True, type=Path, metavar='FILE',
                        help='parameters of the hexapod as it is drawn, the file that the node '
                             'takes')
    add_results(parser, 'calibrated', 'a number is not identifiable or there is a lack of fit')
    parser.add_argument('--no-report', action='store_true', help='write no report.html')
    parser.add_argument('--node', default=NODE, metavar='NAME', type=node_name,
                        help='node whose parameters are read, and name before its topics '
                             f'(default: {NODE})')
    data = parser.add_argument_group('measurements')
    data.add_argument('--measured', metavar='TOPIC', help='of a bag: JointState of the legs')
    data.add_argument('--pose', metavar='TOPIC', help='of a bag: PoseStamped of the device')
    data.add_argument('--mm', action='store_true',
                      help='x, y, z and the leg positions are in mm, not in m')
    data.add_argument('--degrees', action='store_true', help='angles are in degrees, not in rad')
    data.add_argument('--frames', choices=('known', 'unknown'), default='known',
                      help='unknown: the device measures a target on the platform in a frame of '
                           'its own; both are calibrated as well (default: known)')
    data.add_argument('--noise', nargs=3, type=between(0.0, 1e3),
                      metavar=('LENGTH', 'POSITION', 'ROTATION'),
                      help='standard deviations of leg positions [m], of each coordinate of the '
                           'poses [m] and of their rotation about each axis [rad] (default: '
                           'estimated)')
    calibrated = parser.add_argument_group('what is calibrated, and how')
    calibrated.add_argument('--fixed', type=_names, default=(), metavar='NAME,...',
                            help="parts that keep the file's values, as zero_length, "
                                 'base_joints.leg_1, platform_joints.leg_3.z')
    calibrated.add_argument('--hold-out', type=between(0.0, 0.5), default=HOLD_OUT,
                            metavar='PART',
                            help='share of the poses that validates a fit to the others; 0: none '
                                 f'(default: {HOLD_OUT:g})')
    calibrated.add_argument('--accept-mistakes', action='store_true',
                            help='write results although a mistake is likely')
    design_command.add_options(parser)
    return parser


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.calibration.measured_poses import read_poses
    from stewart_dynamics.calibration.noise import Noise
    from stewart_dynamics.calibration.one_run import CalibrationOptions, FUNCTIONS, run
    from stewart_dynamics.calibration.recorded_poses import read_bag
    from stewart_dynamics.calibration.results import result_text
    from stewart_dynamics.mechanics.likely_mistakes import likely_mistakes
    from stewart_dynamics.parameters.table import Parameters

    interrupt_on_signals()
    options = CalibrationOptions(
        given.fixed, given.frames, given.noise and Noise(*given.noise), given.hold_out, given.mm,
        given.degrees, given.accept_mistakes, not given.no_report, given.force)
    parameters = Parameters.from_yaml(given.params, given.node)
    if given.design is not None:
        _PROGRAM.say(design_command.run(given, parameters))
        return DONE
    missing: list[str] = []
    if given.poses.is_dir() or given.poses.suffix in ('.mcap', '.db3', '.bag', '.zstd'):
        measured, missing = read_bag(
            given.poses, parameters, given.node, given.measured, given.pose)
    else:
        measured = read_poses(given.poses, parameters['joints'], given.mm, given.degrees)
    _PROGRAM.prepare(FUNCTIONS, likely_mistakes(parameters))
    result = run(measured, str(given.poses), parameters, given.output, options)
    for each in result['likely_mistakes']:
        _PROGRAM.complain(f'warning: {each["text"]}')
    _PROGRAM.say(result_text(result))
    _PROGRAM.say(f'results: {given.output}')
    if missing:
        _PROGRAM.complain(partly_read(given.poses, missing))
        return PARTLY_READ
    return NOT_ALL_IDENTIFIED if given.strict and not is_complete(result) else DONE


def _names(text: str) -> tuple[str, ...]:
    names = tuple(each.strip() for each in text.split(',') if each.strip())
    if not names:
        raise argparse.ArgumentTypeError('names nothing')
    return names
