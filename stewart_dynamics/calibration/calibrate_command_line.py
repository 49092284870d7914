# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_calibrate."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stewart_dynamics.calibration import design_command
from stewart_dynamics.program import (
    add_accepted, add_node, add_parameters, add_reading, add_report, between, DONE, names_of,
    Program, share)
from stewart_dynamics.reporting.estimates import HOLD_OUT
from stewart_dynamics.reporting.results_folder import CALIBRATED, DESIGNED
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.tables.reading import Reading

_PROGRAM = Program(
    'stewart_calibrate', 'parameters or poses, or a possible error: nothing is written',
    'a number is not identifiable or there is a lack of fit', partly=True)


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
        description="Calibrate a hexapod's geometry, joints, zeros of the drives and lengths, "
                    'from positions of the drives and poses that a tracker, camera or probe '
                    'measured.',
        files='DIR/ gets calibrated.yaml (the whole parameter file, for the node), '
              'calibration.json and report.html.')
    parser.add_argument('poses', nargs='?', type=Path, metavar='POSES',
                        help='CSV file with a column for each leg (the position of its '
                             'drive, as ~/leg_states has it), x, y, z [m] and qx, qy, qz, qw, '
                             'or alpha, beta, gamma [rad]; or a bag with measured legs and poses')
    add_parameters(parser, ', as it is drawn')
    _PROGRAM.add_results(parser, CALIBRATED)
    parser.set_defaults(output=None)  # --design has another one
    add_report(parser)
    add_node(parser, ', and name before its topics')
    data = parser.add_argument_group('measurements')
    data.add_argument('--measured', metavar='TOPIC,...',
                      help='of a bag: JointState of the legs; several topics where each has some '
                           'of them')
    data.add_argument('--pose', metavar='TOPIC',
                      help='of a bag: PoseStamped of the device; with a CSV file of the legs: the '
                           'file that the device wrote, one row for each pose or the whole time, '
                           'with rests in the order of the poses')
    data.add_argument('--mm', action='store_true',
                      help='x, y, z and the leg positions are in mm, not in m')
    data.add_argument('--mm-positions', action='store_true', help='only x, y, z are in mm')
    data.add_argument('--mm-legs', action='store_true', help='only the leg positions are in mm')
    data.add_argument('--degrees', action='store_true',
                      help='angles, of the poses and of drives that turn, are in degrees, not in '
                           'rad')
    data.add_argument('--drive-positions', action='store_true',
                      help='leg positions are those of drives whose screws turn with their legs '
                           '(drive.screw_rotation: universal): motor angles times lead / (2 pi '
                           'gear_ratio)')
    data.add_argument('--frames', choices=('known', 'unknown'), default='known',
                      help='unknown: the device measures a target on the platform in a frame of '
                           'its own; both are calibrated as well (default: known)')
    data.add_argument('--noise', nargs=3, type=between(0.0, 1e3),
                      metavar=('DRIVE', 'POSITION', 'ROTATION'),
                      help='standard deviations of leg positions [m] or angles of drives [rad], '
                           'of each coordinate of the poses [m] and of their rotation about each '
                           'axis [rad] (default: estimated)')
    add_reading(parser)
    calibrated = parser.add_argument_group('what is calibrated, and how')
    calibrated.add_argument('--unknowns', type=names_of, default=('all',), metavar='GROUP,...',
                            help='numbers that are calibrated, others keep the values of the '
                                 'file: zero (of the drives; one pose is enough), joints, and of '
                                 'drives that turn lengths and axes; several, as zero,lengths; '
                                 'all (default)')
    calibrated.add_argument('--fixed', type=names_of, default=(), metavar='NAME,...',
                            help="parts that keep the file's values, as zero_length, "
                                 'base_joints.leg_1, platform_joints.leg_3.z')
    calibrated.add_argument('--hold-out', type=share(0.5), default=HOLD_OUT,
                            metavar='PART',
                            help='share of the poses that validates a fit to the others; 0: none '
                                 f'(default: {HOLD_OUT:g})')
    add_accepted(calibrated)
    design_command.add_options(parser)
    return parser


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.bags.find import is_bag_file
    from stewart_dynamics.calibration.calibration_results import result_text
    from stewart_dynamics.calibration.measured_poses import Millimeters, read_poses
    from stewart_dynamics.calibration.noise import Noise
    from stewart_dynamics.calibration.one_run import CalibrationOptions, run
    from stewart_dynamics.calibration.recorded_poses import read_bag
    from stewart_dynamics.calibration.tracked_poses import read_tracked
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.tables.reading import is_table

    interrupt_on_signals()
    millimeters = Millimeters(given.mm or given.mm_positions, given.mm or given.mm_legs)
    options = CalibrationOptions(
        given.fixed, given.unknowns, given.frames, given.noise and Noise(*given.noise),
        given.hold_out, millimeters, given.degrees, given.drive_positions, given.accept_mistakes,
        given.report, given.force)
    parameters = Parameters.from_yaml(given.params, given.node)
    if given.design is not None:
        _PROGRAM.say(design_command.run(given, parameters, given.output or Path(DESIGNED)))
        return DONE
    output = given.output or Path(CALIBRATED)
    missing: list[str] = []
    if given.poses.is_dir() or is_bag_file(given.poses):
        measured, missing = read_bag(
            given.poses, parameters, given.node, given.measured, given.pose,
            Reading.given(given), millimeters)
    elif given.pose and is_table(Path(given.pose)):
        measured = read_tracked(
            given.poses, Path(given.pose), parameters, millimeters, Reading.given(given),
            given.degrees)
    else:
        measured = read_poses(given.poses, parameters, millimeters, given.degrees,
                              Reading.given(given))
    _PROGRAM.prepare(find_parameter_errors(parameters))
    result = run(measured, str(given.poses), parameters, output, options)
    _PROGRAM.warn(each.text for each in result.likely_mistakes)
    _PROGRAM.say(result_text(result))
    return _PROGRAM.end(
        output, {given.poses: missing}, given.strict and not result.is_complete)
