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

"""What the executables that are ROS nodes share: parameters, spinning, exit codes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
import signal
import sys
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange, ParameterDescriptor, ParameterType, SetParametersResult)
import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import NameValidationException, ROSInterruptException
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.nodes.rclpy_workarounds import (
    describe_by, make_executor, reject_impossible_times, set_parameters_together, shut_down, spin)
from stewart_dynamics.nodes.security import check_environment, without_security_libraries
from stewart_dynamics.parameters import is_of_ros, Parameter, ParameterSet

# What is the user's to mend, said in one line: all else is a fault of ours.
_OF_THE_USER = (StewartError, RCLError, UnknownROSArgsError, NameValidationException)

_TYPES = {
    'string': (ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_STRING_ARRAY),
    'double': (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY),
    'bool': (ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_BOOL_ARRAY)}

Kind = TypeVar('Kind', bound=ParameterSet)


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the parameter files that a command line names."""
    return [value for option, value in zip(arguments, arguments[1:], strict=False)
            if option == '--params-file']


def _overrides(arguments: Sequence[str], node: str) -> list[tuple[str, str]]:
    """Return names and texts of the values that a command line sets, for all nodes or this."""
    rules = [rule.partition(':=') for option, rule in zip(arguments, arguments[1:], strict=False)
             if option in ('-p', '--param')]
    return [(name.rpartition(':')[2], text) for name, _, text in rules
            if name.rpartition(':')[0] in ('', node)]


def declare_parameters(node: Node, kind: type[Kind]) -> Kind:
    """
    Return the node's parameters, checked, and declare all of the table.

    The node must have been made with ``automatically_declare_parameters_from_overrides``.
    Types and ranges are left to the table's own check, whose texts say more than ROS's. A node
    without a lifecycle takes no changes. Raises ParameterError, for an unknown name as well.
    """
    sources = parameter_files(sys.argv)
    if not sources or {'-p', '--param'} & set(sys.argv):
        sources.append('command line')
    source = ', '.join(sources)
    # ROS drops a value silently that is of another type than that in a file.
    for name, text in _overrides(sys.argv, kind.node):
        kind.check_value(name, text, 'command line')
    declared: dict[str, Any] = node.get_parameters_by_prefix('')
    given = {name: parameter.value for name, parameter in declared.items() if not is_of_ros(name)}
    parameters = kind(given, source)
    for name, parameter in kind.table.items():
        unchecked = ParameterDescriptor(dynamic_typing=True)
        if node.has_parameter(name):
            node.set_descriptor(name, unchecked)
        else:
            default = parameter.default
            if isinstance(default, tuple):
                default = list(default) or None
            node.declare_parameter(name, default, unchecked)
    if not isinstance(node, LifecycleNode):
        node.add_on_set_parameters_callback(partial(_refuse_changes, kind))
    set_parameters_together(node)
    describe_by(node, lambda name: _descriptor(
        kind.table[name], node) if name in kind.table else None)
    return parameters


def _refuse_changes(
        kind: type[ParameterSet], changes: Sequence[RosParameter]) -> SetParametersResult:
    for change in changes:
        if not is_of_ros(change.name):
            try:
                kind.declared(change.name)
            except ParameterError as exc:
                return SetParametersResult(successful=False, reason=str(exc))
            return SetParametersResult(successful=False, reason=(
                f'{change.name}: only read when the node starts: start it anew'))
    return SetParametersResult(successful=True)


def _descriptor(parameter: Parameter, node: Node) -> ParameterDescriptor:
    """Return all that is known of a parameter, as ROS describes it."""
    has_lifecycle = isinstance(node, LifecycleNode)
    when = 'only while unconfigured' if has_lifecycle else 'only when the node starts'
    if parameter.while_active:
        when = 'also while active'
    sizes = ' or '.join(map(str, parameter.sizes))
    constraints = [f'{sizes} entries' if sizes else '', parameter.rule, f'set {when}']
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    in_range = math.isfinite(parameter.minimum) or math.isfinite(parameter.maximum)
    # What may be one number or six is of the type that it has now.
    type_ = node.get_parameter(parameter.name).type_.value
    if type_ == ParameterType.PARAMETER_NOT_SET:
        type_ = _TYPES[parameter.kind][bool(parameter.sizes)]
    return ParameterDescriptor(
        name=parameter.name, type=type_, description=parameter.text + unit,
        additional_constraints='; '.join(filter(None, constraints)),
        read_only=not has_lifecycle, dynamic_typing=len(parameter.sizes) > 1,
        floating_point_range=[FloatingPointRange(
            from_value=parameter.minimum, to_value=parameter.maximum)] if in_range else [])


def _usage(kind: type[ParameterSet]) -> str:
    parameters = [f'  {name} ({parameter.ros_type}{parameter.unit and ", "}{parameter.unit}): '
                  f'{parameter.text}' for name, parameter in kind.table.items()]
    return '\n'.join([
        f'usage: {kind.node} --ros-args --params-file FILE [-p NAME:=VALUE] [-r FROM:=TO]', '',
        'parameters:', *parameters])


def run(make_node: Callable[[], Node], kind: type[ParameterSet],
        done: Future | None = None) -> int:
    """
    Make a node, spin it until it is told to stop, and return the exit code.

    Parameters
    ----------
    make_node : callable
        Called once ROS is up; a StewartError that it raises is said in one line, exit code 1.
    kind : type of ParameterSet
        What the parameter files on the command line are checked by before ROS sees them.
    done : Future, optional
        When it is done, its result is the exit code.

    """
    if {'-h', '--help'} & set(sys.argv[1:]):
        print(_usage(kind))
        return 0
    stop = done or Future()
    executor = node = None
    starting = True
    signals: list[int] = []

    def on_signal(number: int, frame: Any) -> None:
        # rclpy's handlers, which init sets, shut ROS down before they call this one, and that
        # ends the spinning. An exception would strike in the middle of whatever callback runs,
        # and be logged as an error of it.
        signals.append(number)
        if starting:
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    try:
        if parameter_files(sys.argv) and '--ros-args' not in sys.argv:
            raise ParameterError('--params-file is read only behind --ros-args')
        for path in parameter_files(sys.argv):
            kind.check_file(path)
        for stray in remove_ros_args(sys.argv)[1:]:
            raise ParameterError(f'{stray}: unknown argument; see --help')
        warning = check_environment(sys.argv)
        reject_impossible_times()
        rclpy.init()
        with without_security_libraries():
            node = make_node()
        if warning:
            node.get_logger().warning(warning)
        executor = make_executor()
        executor.add_node(node)
        starting = False
        spin(executor, stop, lambda: bool(signals))
        return int(stop.result() or 0) if stop.done() else 0
    except (KeyboardInterrupt, ExternalShutdownException, ROSInterruptException):
        return 0
    except Exception as exc:
        starting = False
        if signals and not rclpy.ok():
            return 0  # a signal has shut ROS down in the middle of anything
        if not isinstance(exc, _OF_THE_USER):
            raise
        print(f'{kind.node}: {" ".join(str(exc).split())}', file=sys.stderr)
        return 1
    finally:
        starting = False
        shut_down(executor, node)
