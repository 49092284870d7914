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
from contextlib import suppress
import signal
import sys
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import NameValidationException, ROSInterruptException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.parameters import is_of_ros, Parameter, ParameterSet

# The executor's wait is bounded: rclpy 7.1's unbounded one burns half a core and may hang.
_SPIN_SECONDS = 10.0

# What is the user's to mend, said in one line: all else is a fault of ours.
_OF_THE_USER = (StewartError, RCLError, UnknownROSArgsError, NameValidationException)

Kind = TypeVar('Kind', bound=ParameterSet)


def parameter_files(arguments: Sequence[str]) -> list[str]:
    """Return the parameter files that a command line names."""
    return [value for option, value in zip(arguments, arguments[1:], strict=False)
            if option == '--params-file']


def declare_parameters(node: Node, kind: type[Kind]) -> Kind:
    """
    Return the node's parameters, checked, and declare all of the table.

    The node must have been made with ``automatically_declare_parameters_from_overrides``.
    Types are left to the table's own check, whose texts say more than ROS's. Raises
    ParameterError, for an unknown name as well.
    """
    sources = parameter_files(sys.argv)
    if not sources or {'-p', '--param'} & set(sys.argv):
        sources.append('command line')
    source = ', '.join(sources)
    declared: dict[str, Any] = node.get_parameters_by_prefix('')
    given = {name: parameter.value for name, parameter in declared.items() if not is_of_ros(name)}
    parameters = kind(given, source)
    for name, parameter in kind.table.items():
        if node.has_parameter(name):
            node.set_descriptor(name, _descriptor(parameter))
        else:
            default = parameter.default
            if isinstance(default, tuple):
                default = list(default) or None
            node.declare_parameter(name, default, _descriptor(parameter))
    return parameters


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    return ParameterDescriptor(
        description=parameter.text + unit, additional_constraints=parameter.rule,
        dynamic_typing=True)


def until_shutdown(node: Node, callback: Callable[..., None]) -> Callable[..., None]:
    """
    Return a callback that ends in silence where ROS is shut down while it runs.

    A signal does so in the middle of whatever runs; what then asks ROS for anything raises.
    """
    def guarded(*arguments: Any) -> None:
        try:
            callback(*arguments)
        except RCLError:
            if node.context.ok():
                raise

    return guarded


def _executor() -> Executor:
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        get_logger('stewart_dynamics').warning(
            'this rclpy has no events executor: the single-threaded one takes 2.5 times the '
            'processor time')
        return SingleThreadedExecutor()
    return EventsExecutor()


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
        rclpy.init()
        node = make_node()
        executor = _executor()
        executor.add_node(node)
        starting = False
        while rclpy.ok() and not stop.done():
            executor.spin_until_future_complete(stop, _SPIN_SECONDS)
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
        # On this thread and before the end, else rclpy 7.1 crashes at exit.
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
        with suppress(RCLError):  # a signal's own shutdown may come between check and call
            rclpy.try_shutdown()
