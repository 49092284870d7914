# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The command line of stewart_describe."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from stewart_dynamics.errors import StewartError
from stewart_dynamics.program import add_node, add_parameters, DONE, Program, STRICT
from stewart_dynamics.signals import interrupt_on_signals
from stewart_dynamics.whole_file import FilesOfFolder

if TYPE_CHECKING:
    from stewart_dynamics.parameters.table import Parameters

_PROGRAM = Program('stewart_describe', 'parameters or files, or no hexapod found',
                   'a possible error was found')
_STANDS_FOR_NONE = dict.fromkeys(
    ('platform.mass', 'platform.inertia'), 'stands for none: write that of the platform')
_INTERFACES = ('position', 'velocity', 'effort')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; the exit code is explained in its help."""
    given = _arguments().parse_args(arguments)
    work = _read if given.source else _write
    return _PROGRAM.exit_code(lambda: work(given, FilesOfFolder(given.output, given.force)))


def _arguments() -> argparse.ArgumentParser:
    parser = _PROGRAM.parser(
        description='Write a hexapod as URDF, SDFormat and MJCF, or read one from these formats '
                    'into a parameter file.',
        files='DIR gets NAME.urdf with its loops in NAME_loops.yaml, NAME.sdf, NAME.xml (MJCF), '
              'NAME_scene.xml around it, or with --from NAME.yaml, and\na picture with numbered '
              'joints, NAME.svg; NAME_points.yaml, the parameters with the '
              'joints as points, where they are on circles.')
    source = parser.add_mutually_exclusive_group(required=True)
    add_parameters(source, required=False)
    source.add_argument('--from', dest='source', type=Path, metavar='FILE',
                        help='URDF, SDFormat, MJCF (needs mujoco) or USD (needs usd-core) of a '
                             'hexapod')
    parser.add_argument('--usd', action='store_true',
                        help='write NAME.usda, too (needs usd-core)')
    parser.add_argument('--solid', action='store_true',
                        help='URDF: mass and inertia about all axes in all links that move, for '
                             'engines that reject zeros')
    parser.add_argument('--constraints', action='store_true',
                        help='URDF: elements <constraint> that close its loops')
    parser.add_argument('--geometry-only', action='store_true',
                        help='with --from: geometry and limits of a file without masses')
    _PROGRAM.add_results(parser, '.')
    parser.add_argument('--name', type=_name, metavar='NAME',
                        help='name of the model and of the files (default: that of FILE)')
    add_node(parser)
    control = parser.add_argument_group('ros2_control', 'a block in the URDF')
    control.add_argument('--ros2-control', type=_interfaces, metavar='INTERFACES',
                         help='command interfaces of the legs: effort, velocity or position, or '
                              'several with commas')
    control.add_argument('--hardware', default='mock', metavar='PLUGIN',
                         help='mock (mock_components), topic (joint_state_topic_hardware_'
                              'interface), joint_command (joint_command_topic_hardware_interface) '
                              'or the name of a plugin (default: mock)')
    return parser


def _name(text: str) -> str:
    if not text or not text.isprintable() or '/' in text or text in ('.', '..'):
        raise argparse.ArgumentTypeError(f'{text!r}: not a name for files')
    return text


def _interfaces(text: str) -> list[str]:
    found = text.split(',')
    for each in found:
        if each not in _INTERFACES:
            raise argparse.ArgumentTypeError(
                f'{each!r}: must be one of {", ".join(_INTERFACES)}')
    return found


def _write(given: argparse.Namespace, files: FilesOfFolder) -> int:
    # Imported here, so that --help is fast.
    from stewart_dynamics.description.formats import WRITERS
    from stewart_dynamics.description.hexapod import Hexapod
    from stewart_dynamics.description.loops import loops_name, loops_yaml
    from stewart_dynamics.description.mjcf import scene
    from stewart_dynamics.description.picture import picture
    from stewart_dynamics.description.urdf import Ros2Control, urdf
    from stewart_dynamics.parameters.circles import CIRCLE_NAMES
    from stewart_dynamics.parameters.table import Parameters

    interrupt_on_signals()
    parameters = Parameters.from_yaml(given.params, given.node)
    if given.geometry_only:
        raise StewartError('--geometry-only: only with --from')
    hexapod, name = Hexapod(parameters), given.name or given.params.stem
    control = given.ros2_control and Ros2Control(given.ros2_control, given.hardware)
    writers = WRITERS | {'urdf': partial(
        urdf, control=control, constraints=given.constraints, solid=given.solid)}
    if not given.usd:
        del writers['usda']
    texts = {f'{name}.{suffix}': write(hexapod, name) for suffix, write in writers.items()} | {
        f'{name}.svg': picture(hexapod, name), loops_name(name): loops_yaml(hexapod, name),
        f'{name}_scene.xml': scene(hexapod, name)}
    if CIRCLE_NAMES & set(parameters.given):
        texts[f'{name}_points.yaml'] = parameters.with_points().yaml_text()
    for path in files.write(texts):
        _PROGRAM.say(str(path))
    return _judge(parameters, given)


def _read(given: argparse.Namespace, files: FilesOfFolder) -> int:
    from stewart_dynamics.description.hexapod import Hexapod
    from stewart_dynamics.description.picture import picture
    from stewart_dynamics.description.formats import read_hexapod

    interrupt_on_signals()
    for option in ('ros2_control', 'usd', 'solid', 'constraints'):
        if getattr(given, option):
            raise StewartError(f'--{option.replace("_", "-")}: not with --from')
    found = read_hexapod(given.source, given.geometry_only)
    text = found.parameters.yaml_text(_STANDS_FOR_NONE if given.geometry_only else None)
    name = given.name or given.source.stem
    # The folder of the description has the same picture already.
    for path in files.write({f'{name}.yaml': text},
                            {f'{name}.svg': picture(Hexapod(found.parameters), name)}):
        _PROGRAM.say(str(path))
    for remark in found.remarks:
        _PROGRAM.complain(remark)
    return _judge(found.parameters, given, found.warnings)


def _judge(parameters: Parameters, given: argparse.Namespace, warnings: tuple[str, ...] = (),
           ) -> int:
    """Print warnings and possible errors and return the exit code."""
    from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors

    errors = warnings + find_parameter_errors(parameters)
    _PROGRAM.warn(errors)
    return STRICT if errors and given.strict else DONE
