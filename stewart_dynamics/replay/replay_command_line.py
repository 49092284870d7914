# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The command line of stewart_replay."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stewart_dynamics.program import (
    add_motor_efforts, add_node, add_parameters, add_reading, add_report, frequency, Program,
    whole)
from stewart_dynamics.replay.replay_options import LIMIT_MET, Options
from stewart_dynamics.reporting.results_folder import REPLAYS
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.tables.reading import Reading

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

_PROGRAM = Program('stewart_replay', 'parameters or bags',
                   'a limit or singularity warning was met, or a possible error in measured '
                   'efforts is likely', partly=True)
_CUTOFF = 10.0
_TOPICS = {
    'pose': 'poses', 'twist': 'twists', 'accel': 'accelerations',
    'combined': 'setpoints in one message; sets setpoint.source',
    'wrench': 'external wrench on the platform; never found by its type',
    'base_pose': 'poses of the base in the world', 'base_twist': 'twists of the base',
    'base_accel': 'accelerations of the base', 'base_imu': 'IMU on the base'}
# Up to this number of bags the summary of each is printed; of more only the totals.
_FEW = 10


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    parser = _arguments()
    given = parser.parse_args(arguments)
    if given.cutoff and not given.differentiate:
        parser.error('--cutoff: needs --differentiate')
    if given.measured_pose and not given.response:
        parser.error('--measured-pose: needs --response')
    if given.measured_pose and given.measured:
        parser.error('--measured-pose: not with --measured')
    if (given.motor_torque or given.motor_current) and not given.measured:
        parser.error('--motor-torque, --motor-current: need --measured')
    return _PROGRAM.exit_code(lambda: _run(given, _options(given)))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Compute leg lengths, forces and singularity warnings of recorded setpoints, '
                    'as the node does, bit for bit.',
        files='For every bag, DIR/<name of the bag>/ gets bag/ (MCAP, the topics of the node), '
              'legs.csv,\nsummary.json and report.html; of several bags DIR/ gets fleet.csv and '
              'index.html.',
        more='\nof several bags the most severe: 2, then 3, then 1')
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG',
                        help='rosbag2 folder, .mcap or .db3 file, .bag file of ROS 1, CSV file '
                             'with named columns, or a folder with bags in it')
    add_parameters(parser)
    _PROGRAM.add_results(parser, REPLAYS)
    topics = parser.add_argument_group(
        'topics', 'Inputs are looked for under the usual names, then by their type.')
    add_node(topics, ', and name before the usual topics')
    for name, what in _TOPICS.items():
        topics.add_argument(f'--{name.replace("_", "-")}', metavar='TOPIC',
                            help=f'topic of the {what}')
    topics.add_argument('--measured', metavar='TOPIC,...',
                        help='JointState whose efforts are compared with the computed forces, '
                             'and whose positions are the achieved ones of --response; several '
                             'topics where each has some of the legs')
    add_motor_efforts(topics)
    response = parser.add_argument_group('how the platform follows')
    response.add_argument('--response', action='store_true',
                          help='frequency responses, delays and bandwidths from commanded and '
                               'achieved poses; those of the measured legs by default')
    response.add_argument('--measured-pose', metavar='TOPIC',
                          help='topic of the achieved poses in the base frame, or a table of '
                               'them, as a tracker writes; the options for recordings of other '
                               'sources are then those of the table')
    add_reading(parser)
    poses = parser.add_argument_group('bags that have only poses')
    poses.add_argument('--differentiate', action='store_true',
                       help='compute twist and acceleration from the poses by smoothing splines')
    poses.add_argument('--cutoff', type=frequency, metavar='HZ',
                       help=f'cut-off frequency of the splines (default: {_CUTOFF:g}); as low as '
                            'the motion allows: noise grows with its power of 2.5')
    parser.add_argument_group('how certain it is').add_argument(
        '--uncertainty', type=whole(2, 1_000_000), default=0, metavar='N',
        help='compute the loads on N hexapods as well that uncertainty.* of the file admits: '
             'bands of the peaks, and how many exceed a limit; on a GPU if there is one')
    output = parser.add_argument_group('what is written')
    add_report(output)
    output.add_argument('--plotly', choices=('inline', 'shared'), default='inline',
                        help='shared: one file of plotly.js in DIR for all reports, which are '
                             '5 MB smaller and need it (default: inline)')
    output.add_argument('--parquet', action='store_true',
                        help='write legs.parquet in place of legs.csv')
    many = parser.add_argument_group('many bags')
    many.add_argument('--jobs', type=whole(1, 10_000), default=1, metavar='N',
                      help='bags that are replayed at the same time (default: 1)')
    many.add_argument('--scheduler', metavar='ADDRESS',
                      help='replay on the workers of this Dask scheduler; they must see '
                           'the same folders')
    return parser


def _options(given: argparse.Namespace) -> Options:
    return Options(
        node=given.node, reading=Reading.given(given),
        topics={name: getattr(given, name) for name in _TOPICS if getattr(given, name)},
        cutoff=(given.cutoff or _CUTOFF) if given.differentiate else None,
        measured=given.measured or None, response=given.response,
        measured_pose=given.measured_pose or None,
        motor_torque=given.motor_torque, motor_current=given.motor_current,
        uncertainty=given.uncertainty, parquet=given.parquet, report=given.report,
        force=given.force, params=str(given.params))


def _run(given: argparse.Namespace, options: Options) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.bags.find import FLEET_PAGE, folders_of_results
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.replay.bag_report import share_plotly
    from stewart_dynamics.replay.many_bags import replay_fleet

    interrupt_on_signals()
    parameters = Parameters.from_yaml(given.params, given.node)
    bags = folders_of_results(given.bags, given.output)
    if options.report and given.plotly == 'shared':
        options = options._replace(plotly=share_plotly(given.output))
    _PROGRAM.prepare(find_parameter_errors(parameters))
    if len(bags) == 1 and given.scheduler is None and bags[0][0] == given.bags[0]:
        return _one(*bags[0], parameters, options, given.strict)
    fleet = replay_fleet(
        bags, parameters, given.output, options, given.jobs, given.scheduler)
    for ended in fleet.ended:
        if ended.text and len(bags) <= _FEW:
            _PROGRAM.say(f'{ended.text}\n')
        if ended.error:
            _PROGRAM.complain(ended.error)
    _PROGRAM.say(fleet.text().partition('\n')[0])
    _PROGRAM.say(f'results: {given.output / FLEET_PAGE}')
    return fleet.code(given.strict)


def _one(bag: Path, folder: Path, parameters: Parameters, options: Options, strict: bool) -> int:
    from tqdm import tqdm

    from stewart_dynamics.bags.find import bytes_of
    from stewart_dynamics.replay.one_bag import replay
    from stewart_dynamics.reporting.results_folder import remove_abandoned

    remove_abandoned([folder])
    with tqdm(total=bytes_of(bag), unit='B', unit_scale=True, disable=None, leave=False,
              dynamic_ncols=True) as bar:
        done = 0

        def progress(read: int, setpoints: int) -> None:
            nonlocal done
            done += setpoints
            bar.set_postfix_str(f'{tqdm.format_sizeof(done)} setpoints', refresh=False)
            bar.update(read)

        replayed = replay(bag, parameters, folder, options, progress)
    _PROGRAM.say(replayed.text)
    return _PROGRAM.end(folder, {bag: replayed.summary.missing},
                        strict and replayed.code == LIMIT_MET)
