# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The console scripts of the nodes; whatever needs no ROS is answered before rclpy is imported.

``--help``, ``--version``, ``--example``, a parameter file that breaks a rule, and that ROS is
missing.
Signals are handled before anything else is imported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
import os
import sys
from typing import Any, NoReturn, TYPE_CHECKING

from stewart_dynamics.ros.signal_flag import SIGNALS

if TYPE_CHECKING:
    from stewart_dynamics.parameters.parameter_set import Parameter, ParameterSet


_EXAMPLE, _WITH_EXAMPLES = '--example', 'stewart_dynamics'  # option, and the node that has it


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the parameter files that a command line names."""
    return [value for option, value in zip(arguments, arguments[1:], strict=False)
            if option == '--params-file']


def check_arguments(arguments: Sequence[str], kind: type[ParameterSet]) -> None:
    """Raise ParameterError for arguments that the parser of ROS rejects in its own words."""
    from stewart_dynamics.errors import ParameterError

    for option, argument in zip(arguments, [*arguments[1:], ''], strict=True):
        if option in ('-p', '--param') and ':=' not in argument:
            raise ParameterError(f'command line: {option} {argument}: must be NAME:=VALUE')
    for path in parameter_files(arguments):
        kind.check_file(path)


def given_parameters(arguments: Sequence[str], node: str, kind: type[ParameterSet],
                     ) -> dict[str, Any]:
    """
    Return the values that a command line gives a node, in files and by ``-p``: the last of each.

    ROS may use another one. rcl keeps both a number and a list that ``-p`` sets in its place, and
    rclpy takes the number; values for ``/**`` and those for the node's name are applied in the
    order in which these two first appear; a ``-p`` of another type than in a file is dropped.
    """
    from stewart_dynamics.parameters.yaml_file import is_of_ros, parameters_of, read_document

    values: dict[str, Any] = {}
    for option, argument in zip(arguments, arguments[1:], strict=False):
        if option == '--params-file':
            values.update(parameters_of(read_document(argument), node, argument))
        elif option in ('-p', '--param'):
            target, _, text = argument.partition(':=')
            section, _, name = target.rpartition(':')
            if section in ('', node.lstrip('/')):
                values[name] = kind.read_value(name, text, 'command line')
    return {name: value for name, value in values.items()
            if value is not None and not is_of_ros(name)}


def cueing() -> int:
    """Run the node stewart_cueing; return its exit code."""
    return _run('cueing.cueing_parameters', 'CueingParameters', 'cueing.cueing_node')


def dynamics() -> int:
    """Run the node stewart_dynamics; return its exit code."""
    return _run('parameters.table', 'Parameters', 'node.dynamics_node')


def simulator() -> int:
    """Run the node stewart_simulator; return its exit code."""
    return _run('simulator.simulator_parameters', 'SimulatorParameters',
                'simulator.simulator_node')


def trajectory() -> int:
    """Run the node stewart_trajectory; return its exit code."""
    return _run('reference_motion.motion_parameters', 'ReferenceMotionParameters',
                'reference_motion.trajectory_node')


def printed_request(arguments: Sequence[str], kind: type[ParameterSet]) -> str | None:
    """
    Return what a command line asks to print, and nothing else; None: it starts the node.

    Raises ParameterError: the example is not known.
    """
    from stewart_dynamics.program import SOFTWARE

    if {'-h', '--help'} & set(arguments):
        return usage(kind)
    if '--version' in arguments:
        return SOFTWARE
    if _EXAMPLE in arguments and kind.node == _WITH_EXAMPLES:
        from stewart_dynamics.legs import example

        name = ''.join(arguments[arguments.index(_EXAMPLE) + 1:][:1])
        return example(name).rstrip('\n')
    return None


def usage(kind: type[ParameterSet]) -> str:
    """Return what ``--help`` prints."""
    return '\n'.join([
        f'usage: {kind.node} --ros-args --params-file FILE [-p NAME:=VALUE] [-r FROM:=TO]',
        *([f'       {kind.node} {_EXAMPLE} {"|".join(_example_names())}    print a parameter file '
           'to begin with'] if kind.node == _WITH_EXAMPLES else []),
        '', 'parameters:',
        *(_described(each) for each in kind.table.values() if each.name not in kind.unused),
        *(['', 'accepted, so that programs can share a file, and not used:',
           f'  {", ".join(name for name in kind.table if name in kind.unused)}']
          if kind.unused else [])])


def _complete(kind: type[ParameterSet]) -> None:
    """Answer a shell that completes the arguments of a node, which ROS parses, and exit."""
    import argparse

    from stewart_dynamics.program import complete

    parser = argparse.ArgumentParser(prog=kind.node)
    for flag in ('--version', '--ros-args'):
        parser.add_argument(flag, action='store_true')
    if kind.node == _WITH_EXAMPLES:
        parser.add_argument(_EXAMPLE, choices=_example_names())
    for option in ('--params-file', '-r'):
        parser.add_argument(option, action='append')
    values: Any = parser.add_argument('-p', action='append')
    values.completer = lambda **_: [f'{name}:=' for name in kind.table if name not in kind.unused]
    complete(parser)


def _example_names() -> tuple[str, ...]:
    from stewart_dynamics.legs import example_names

    return example_names()


def _described(parameter: Parameter) -> str:
    default = parameter.default
    if isinstance(default, tuple):
        default = ', '.join(map(str, default))
    elif isinstance(default, bool):
        default = 'true' if default else 'false'
    notes = [parameter.ros_type, parameter.unit, 'required' if parameter.required else '',
             '' if default in (None, '') else f'default {default}']
    return f'  {parameter.name} ({", ".join(filter(None, notes))}): {parameter.text}'


def _run(module: str, name: str, node: str) -> int:
    """Run the node of a module, with the parameters of another one; return its exit code."""
    SIGNALS.watch(end_at_once=True)  # until it is imported: run has its own way
    from stewart_dynamics.errors import ParameterError
    from stewart_dynamics.program import unwritten, written

    kind: type[ParameterSet] = getattr(_imported(module), name)
    if '_ARGCOMPLETE' in os.environ:
        _complete(kind)
    try:
        text = printed_request(sys.argv[1:], kind)
        if text is not None:
            fault = written(text, sys.stdout)
            if fault:
                print(f'{kind.node}: {unwritten(fault)}', file=sys.stderr)
            return 1 if fault else 0
        check_arguments(sys.argv, kind)
        program = _imported(node)
    except ParameterError as exc:
        print(f'{kind.node}: {exc}', file=sys.stderr)
        return 1
    except ImportError as exc:
        if (exc.name or '').startswith('stewart_dynamics'):
            raise
        reason = ' '.join(str(exc).split())
        print(f'{kind.node}: needs ROS 2: {reason}: source its setup file, or pip install '
              '"stewart_dynamics[ros]"', file=sys.stderr)
        return 1
    end_process: Callable[[int], NoReturn] = _imported('ros.rclpy_workarounds').end_process
    end_process(program.main())


def _imported(module: str) -> Any:
    return import_module(f'stewart_dynamics.{module}')
