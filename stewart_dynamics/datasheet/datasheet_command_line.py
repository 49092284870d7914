# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of stewart_capability."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stewart_dynamics.program import (
    add_node, add_parameters, add_reading, between, frequency, NODE, Program, whole)
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.reporting.results_folder import DATASHEETS
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.tables.reading import Reading

_PROGRAM = Program('stewart_capability', 'parameters or bags',
                   'the motion or the box is not possible', partly=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    given = _arguments().parse_args(arguments)
    return _PROGRAM.exit_code(lambda: _run(given))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Write the datasheet of a hexapod: what it can reach, carry and follow, and '
                    'what limits it.',
        files='DIR/ gets datasheet.html, datasheet.json and workspace.csv.')
    add_parameters(parser, '; with the limits that rate it')
    # Wide enough for mm, whose possible error is named.
    size = between(-1e6, 1e6)
    parser.add_argument('--pose', nargs=6, type=size, metavar=(
        'X', 'Y', 'Z', 'ALPHA', 'BETA', 'GAMMA'),
        help='pose that is rated [m, rad] (default: home)')
    parser.add_argument('--pivot', nargs=3, type=size, metavar=('X', 'Y', 'Z'),
                        help='point that the platform turns about and forces act on, platform '
                             'frame [m] (default: its origin)')
    parser.add_argument('--payload', nargs=4, type=size, metavar=('KG', 'X', 'Y', 'Z'),
                        help='mass on the platform, and its center of mass in the platform frame '
                             '[m]')
    parser.add_argument('--leg-stiffness', type=between(-1e15, 1e15), metavar='K',
                        help='stiffness of a leg along its axis [N/m], or of its drive where '
                             'that turns [N m/rad]: adds stiffness and natural frequencies')
    parser.add_argument('--torque-unit', choices=('Nm', 'kgcm'), default='Nm',
                        help='unit of the torques of drives on the page: N m, or kg cm as hobby '
                             'servos are sold (default: %(default)s)')
    parser.add_argument('--stuck', metavar='LEG',
                        help='name of a leg that keeps its length: the motions that remain, and '
                             'the loads they can hold')
    parser.add_argument('--uncertainty', type=whole(2, 100_000), default=0, metavar='N',
                        help='rate N hexapods as well that uncertainty.* of the file admits: the '
                             'band of the payload')
    parser.add_argument('--box', type=Path, metavar='FILE',
                        help='YAML file of a claimed set of ranges, x y z [m] rx ry rz [rad] from '
                             'the pose: is all of it reachable?')
    _PROGRAM.add_results(parser, DATASHEETS)
    add_node(parser, ', and name before the usual topics')
    motion = parser.add_argument_group('a recorded motion')
    motion.add_argument('--motion', type=Path, metavar='BAG',
                        help='bag with setpoints: is it possible, and how much faster?')
    motion.add_argument('--combined', metavar='TOPIC',
                        help='topic of setpoints in one message')
    motion.add_argument('--differentiate', type=frequency, metavar='HZ',
                        help='compute twist and acceleration from the poses by smoothing splines '
                             'of this cut-off frequency')
    add_reading(parser)
    return parser


def _run(given: argparse.Namespace) -> int:
    # Imported here, so that --help is fast.
    import numpy as np
    from tqdm import tqdm

    from stewart_dynamics.bags.find import bytes_of
    from stewart_dynamics.datasheet.claimed_box import doubtful_ranges, read_box
    from stewart_dynamics.datasheet.datasheet import (
        check_order, leg_of, Order, Progress, soft_legs, STAGES, write_datasheet)
    from stewart_dynamics.datasheet.datasheet_text import sheet_text
    from stewart_dynamics.datasheet.rated_hexapod import Payload
    from stewart_dynamics.mechanics.frames.motion import Pose
    from stewart_dynamics.mechanics.parameter_errors import (
        find_option_errors, find_parameter_errors)
    from stewart_dynamics.parameters.table import Parameters
    from stewart_dynamics.reporting.results_folder import (
        check_free, DATASHEET, remove_abandoned)

    interrupt_on_signals()
    options = Options(
        node=given.node, reading=Reading.given(given), cutoff=given.differentiate,
        force=given.force,
        topics={'combined': given.combined} if given.combined else {})
    parameters = Parameters.from_yaml(given.params, given.node)
    order = Order(
        given.params.stem if given.node == NODE else given.node.rpartition('/')[2],
        None if given.pose is None else Pose.from_euler(given.pose[:3], given.pose[3:]),
        None if given.pivot is None else np.array(given.pivot),
        None if given.payload is None else Payload(
            given.payload[0], np.array(given.payload[1:])),
        None if given.box is None else read_box(given.box, parameters), given.motion, options,
        given.leg_stiffness, None if given.stuck is None else leg_of(given.stuck, parameters),
        given.uncertainty, given.torque_unit)
    check_order(order, parameters)
    check_free(given.output, options, DATASHEET)
    remove_abandoned([given.output])
    _PROGRAM.prepare((
        *find_parameter_errors(parameters), *soft_legs(parameters, order.leg_stiffness),
        *(() if order.box is None else doubtful_ranges(order.box, parameters)),
        *find_option_errors(parameters, {'--pose': given.pose}, {
            '--pivot': given.pivot, '--payload': given.payload and given.payload[1:]})))
    size = 0 if given.motion is None else bytes_of(given.motion)
    # Each stage counts as a part of the bag, whose reading is the longest where it is large.
    part = max(size // len(STAGES), 1)
    with tqdm(total=len(STAGES) * part + size, disable=None, leave=False, dynamic_ncols=True,
              bar_format='{percentage:3.0f}%|{bar}| {desc}') as bar:
        def stage(name: str) -> None:
            bar.set_description_str(name, refresh=False)
            bar.update(part if name != STAGES[0] else 0)
            if bar.disable and name in ('ranges at once', 'workspace'):
                _PROGRAM.complain(name)

        sheet = write_datasheet(
            parameters, order, given.output, options, Progress(stage, bar.update))
    _PROGRAM.say(sheet_text(sheet))
    missing = sheet.motion.missing if sheet.motion else []
    return _PROGRAM.end(
        given.output, {given.motion: missing}, given.strict and not sheet.holds)
