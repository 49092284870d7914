# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_cueing_report."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TYPE_CHECKING

from stewart_dynamics.program import (
    add_node, add_parameters, add_reading, add_report, DONE, PARTLY_READ, Program)
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.tables.reading import Reading

if TYPE_CHECKING:
    from stewart_dynamics.cueing.cueing_result import CueingResult, Gain

CUEING_FOLDER = 'cueing'
_PROGRAM = Program('stewart_cueing_report', 'parameters or recording: nothing is written',
                   'a limit holds the demand back, or the recording has a possible error',
                   partly=True)


class _Writing(NamedTuple):
    force: bool
    run: str = ''


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    given = _arguments().parse_args(arguments)
    return _PROGRAM.exit_code(lambda: _run(given))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='What motion cueing does with the recorded motion of a vehicle: '
                    'demanded and achieved motion, the use of the limits, and the '
                    'frequency response.',
        files='DIR/ gets cueing.json, report.html, and motion/ (a bag of setpoints, for '
              'stewart_capability --motion and stewart_replay); with --tune cueing.yaml, the '
              'parameters with the proposed gains.')
    parser.add_argument('vehicle', type=Path, metavar='RECORDING',
                        help='bag with sensor_msgs/Imu, or CSV file with columns t [s], ax, ay, '
                             'az [m/s^2], wx, wy, wz [rad/s]; other units in brackets')
    add_parameters(parser, ', with cueing.*')
    _PROGRAM.add_results(parser, CUEING_FOLDER)
    add_report(parser)
    add_node(parser)
    parser.add_argument('--vehicle', dest='topic', metavar='TOPIC', help='of a bag: its Imu')
    add_reading(parser)
    parser.add_argument('--tune', action='store_true',
                        help='propose gains that use 90 %% of the limits, with the reason of each')
    return parser


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.bags.setpoint_bag import write_setpoint_bag
    from stewart_dynamics.cueing import report
    from stewart_dynamics.cueing.motion_cueing import MotionCueing
    from stewart_dynamics.cueing.recorded_vehicle import read_vehicle
    from stewart_dynamics.cueing.report_page import write_page
    from stewart_dynamics.cueing.vehicle import find_vehicle_error
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.reporting.results_folder import (
        check_free, CUEING, CUEING_PARAMETERS, MOTION_BAG, remove_abandoned, REPORT_PAGE,
        whole_folder)
    from stewart_dynamics.whole_file import write_json

    interrupt_on_signals()
    options = _Writing(given.force)
    before = check_free(given.output, options, CUEING)
    remove_abandoned([given.output])
    parameters = Parameters.from_yaml(given.params, given.node)
    vehicle = read_vehicle(given.vehicle, given.topic, Reading.given(given))
    _PROGRAM.prepare(find_parameter_errors(parameters))
    error = find_vehicle_error(
        vehicle.times, vehicle.forces, vehicle.rates, parameters.cueing.input)
    _PROGRAM.warn([*vehicle.notices, *([f'vehicle: {error}'] if error else ())])
    gains: list[Gain] = []
    chosen = parameters
    if given.tune and error:
        _PROGRAM.complain('warning: no gains are proposed from such a recording')
    elif given.tune:
        chosen, gains = report.tuned(parameters, vehicle)
    cueing = MotionCueing(chosen)
    found = report.cued(cueing, vehicle)
    used = report.used_limits(chosen, vehicle.times, found.motion)
    result = report.cueing_result(given.vehicle, error, cueing, vehicle, found, used, gains)
    with whole_folder(given.output, options, CUEING, before) as partial:
        write_json(partial / CUEING, result)
        write_setpoint_bag(partial / MOTION_BAG, vehicle.times, found.motion,
                           chosen['base_frame'])
        if gains:
            chosen.to_yaml(partial / CUEING_PARAMETERS)
        if given.report:
            write_page(partial / REPORT_PAGE, result, vehicle.times, found, used)
    _PROGRAM.say(_text(result))
    held = bool(result.held_back_s)
    code = _PROGRAM.end(given.output, {given.vehicle: vehicle.missing}, given.strict and (
        held or bool(error)))
    assert code in (DONE, 1, PARTLY_READ)
    return code


def _text(result: CueingResult) -> str:
    lines = [f'{result.duration_s:.1f} s, largest use: ' + ', '.join(
        f'{name} {100.0 * value:.0f} %' for name, value in result.largest_use.items())]
    lines += [f'held back by {name} for {value:.3f} s'
              for name, value in result.held_back_s.items()]
    lines += [f'{gain.name}, {gain.axis.rpartition(" ")[2]}: {gain.before:g} -> {gain.value:g}: '
              f'{gain.reason}' for gain in result.tuned]
    return '\n'.join(lines)
