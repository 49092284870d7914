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

"""
Workarounds for rclpy 7.1 (ROS 2 Jazzy): each for one defect, with its upstream issue.

rclpy 9.1 (Kilted) works with all of them.

Where there is no upstream issue, the docstring describes what rclpy does, and names a test: when
it passes without the workaround, the workaround can be removed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
import gc
import os
import sys
from typing import Any, NoReturn

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.task import Future
from rclpy.time_source import TimeSource

from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.parameters.yaml_file import read_value

_PIECE, _LOOK = 10.0, 0.1  # [s]
_NANOSECONDS = 1_000_000_000

_NUMBERS = (
    RosParameter.Type.NOT_SET, RosParameter.Type.DOUBLE, RosParameter.Type.DOUBLE_ARRAY)


def answer_impossible_transitions(node: LifecycleNode, log: Callable[[str], None]) -> None:
    """
    Answer a request for a transition that the present state does not have: no success.

    rclpy raises the error out of spin, which ends the program, and the client waits forever
    (https://github.com/ros2/rclpy/issues/1209; its pull request 1319 is not in 7.1). rclpy 9.1
    answers so itself, and logs the error.

    Parameters
    ----------
    node : LifecycleNode
        The node whose service ``change_state`` answers so.
    log : callable
        Called with the text.

    """
    service = node._service_change_state
    change_state = service.callback

    def answer(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except RCLError as exc:
            log(f'transition rejected: {exc}')
            response.success = False
            return response

    service.callback = answer


def create_later_service(node: Node, kind: Any, name: str,
                         begin: Callable[[Callable[[Any], None]], None]) -> Any:
    """
    Return a new service that may answer requests after its callback has returned.

    rclpy sends what the callback returns. A coroutine could wait, but the events executor does
    not await it (https://github.com/ros2/rclpy/issues/1473, mended in later releases), and the
    single-threaded one may not resume it (https://github.com/ros2/rclpy/issues/1462).

    Parameters
    ----------
    node : Node
        Whose service it is.
    kind, name
        Its type and name.
    begin : callable
        Called at each request with a function that sends the answer, once.

    """
    def callback(request: Any, response: Any) -> _Later:
        later = _Later(send)
        begin(later.answer)
        return later

    def send_response(response: Any, header: Any) -> None:
        if isinstance(response, _Later):
            response.go_to(header)
        else:
            send(response, header)

    service: Any = node.create_service(kind, name, callback)
    send, service.send_response = service.send_response, send_response
    return service


class _Later:
    """An answer, which is sent when it and its request's header are there."""

    def __init__(self, send: Callable[[Any, Any], None]) -> None:
        self._send = send
        self._response: Any = None
        self._header: Any = None

    def answer(self, response: Any) -> None:
        self._response = response
        self._try()

    def go_to(self, header: Any) -> None:
        self._header = header
        self._try()

    def _try(self) -> None:
        if self._response is not None and self._header is not None:
            self._send(self._response, self._header)


def set_parameters_together(node: Node) -> None:
    """
    Set all parameters of one request or none, by either service; equal values are no change.

    - ``set_parameters`` sets one parameter after the other, as rcl_interfaces defines it: where
      the second is rejected, the first stays set.
    - A ``ParameterValue.type`` that does not exist raises ValueError out of spin, which ends the
      program (in rclcpp: https://github.com/ros2/rclcpp/issues/3257; in rclpy until
      test_a_parameter_type_that_does_not_exist_is_rejected passes without this).
    - ``ros2 param load`` sends 1e-05 as a text (https://github.com/ros2/rclpy/issues/1672), and
      the text None where ``ros2 param dump`` has written null for a parameter without a value
      (https://github.com/ros2/ros2cli/issues/965).
    - A read-only parameter in the request, as a dump has them, makes rclpy reject the whole
      request even if its value is the present one.
    """
    def set_together(messages: Sequence[Any]) -> SetParametersResult:
        try:
            received = [_received(node, message) for message in messages]
            changes = [each for each in received if not is_present(node, each)]
            return node.set_parameters_atomically(changes)
        except (ParameterException, RuntimeError, TypeError, ValueError) as exc:
            return SetParametersResult(successful=False, reason=str(exc))

    def set_parameters(request: Any, response: Any) -> Any:
        response.results = [set_together(request.parameters)] * len(request.parameters)
        return response

    def set_parameters_atomically(request: Any, response: Any) -> Any:
        response.result = set_together(request.parameters)
        return response

    for service in node.services:
        if service.srv_name.endswith('/set_parameters'):
            service.callback = set_parameters
        elif service.srv_name.endswith('/set_parameters_atomically'):
            service.callback = set_parameters_atomically


def _received(node: Node, message: Any) -> RosParameter:
    """Return the parameter of a request, a number as one where rclpy has sent its text."""
    try:
        parameter: RosParameter = RosParameter.from_parameter_msg(message)
    except ValueError as exc:
        raise ValueError(
            f'{message.name}: parameter type {message.value.type} does not exist') from exc
    if (parameter.type_ != RosParameter.Type.STRING or not node.has_parameter(parameter.name)
            or node.get_parameter(parameter.name).type_ not in _NUMBERS):
        return parameter
    if parameter.value == 'None':
        return RosParameter(parameter.name)
    with suppress(ParameterError):
        value = read_value(parameter.value, parameter.name)
        entries = value if isinstance(value, list) else [value]
        if entries and all(isinstance(entry, float) for entry in entries):
            return RosParameter(parameter.name, value=value)
    return parameter


def is_present(node: Node, parameter: RosParameter) -> bool:
    """Return whether a parameter has this type and value already."""
    if not node.has_parameter(parameter.name):
        return False
    present = node.get_parameter(parameter.name)
    if parameter.type_ != present.type_:
        return False
    if isinstance(parameter.value, str) or not hasattr(parameter.value, '__len__'):
        return bool(parameter.value == present.value)
    return list(parameter.value) == list(present.value)


def describe_by(
        node: Node, describe: Callable[[str], ParameterDescriptor | None]) -> None:
    """
    Answer requests for a parameter's description by a function, None for rclpy's own answer.

    rclpy checks a value by the descriptor that it holds before the node's own check is asked, in
    its own words, and takes the bounds of a range as inclusive, so that ``more than 0`` cannot be
    described; it also writes the type of a value into the descriptor before it rejects the value
    (https://github.com/ros2/rclpy/blob/7.1.5/rclpy/rclpy/node.py, ``_apply_descriptor``). It can
    be removed when test_a_value_out_of_range_is_left_to_the_node_s_own_check passes with
    descriptors that are given to ``declare_parameter``.
    """
    def answer(request: Any, response: Any) -> Any:
        response = describe_by_node(request, response)
        if response.descriptors:  # none where a name is unknown
            response.descriptors = [
                describe(name) or known
                for name, known in zip(request.names, response.descriptors, strict=True)]
        return response

    for service in node.services:
        if service.srv_name.endswith('/describe_parameters'):
            describe_by_node = service.callback
            service.callback = answer


class OneShotTimer:
    """
    Calls back once after each start, no matter how late the executor is.

    After each ``reset`` of a timer the events executor looks at all timers of its clock, and at
    each look it calls those that are due. When it falls behind, several looks come before the
    first call: then a timer that is reset at each call is called again at once, and a timer beside
    it is called so many times that its next call is minutes away (``UpdateTimers`` in
    https://github.com/ros2/rclpy/blob/7.1.5/rclpy/src/rclpy/events_executor/timers_manager.cpp;
    no upstream issue). So each one has a clock of its own, and a call before its time is none.
    Until test_a_timer_that_starts_itself_again_is_late_and_never_early passes without this.

    Parameters
    ----------
    node : Node
        Whose timer it is.
    seconds : float
        From the start to the call.
    callback : callable
        It may start the timer again.

    """

    def __init__(self, node: Node, seconds: float, callback: Callable[[], None]) -> None:
        self._nanoseconds = round(seconds * _NANOSECONDS)
        self._callback = callback
        self._due: int | None = None
        self._clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(seconds, self._on_timer, clock=self._clock)
        self._timer.cancel()

    def start(self) -> None:
        """Call back after the time from now."""
        self._due = self._clock.now().nanoseconds + self._nanoseconds
        self._timer.reset()

    def stop(self) -> None:
        """Do not call back before the next start."""
        self._due = None
        self._timer.cancel()

    def _on_timer(self) -> None:
        if self._due is not None and self._clock.now().nanoseconds >= self._due:
            self.stop()
            self._callback()


class _TimeSource(TimeSource):
    """Follows /clock for a node, and rejects a time that ROS cannot hold."""

    def clock_callback(self, msg: Any) -> None:
        """Follow a message, or log why not."""
        try:
            if msg.clock.nanosec >= _NANOSECONDS:
                raise ValueError(f'nanosec is {msg.clock.nanosec}, must be less than 1e9')
            super().clock_callback(msg)
        except ValueError as exc:
            get_logger('stewart_dynamics').error(
                f'/clock: {msg.clock.sec} s: not followed: {exc}', throttle_duration_sec=5.0)


def reject_impossible_times() -> None:
    """
    Reject impossible times on /clock; call it before a node is made.

    A time before zero raises ValueError out of spin, which ends the program; ``nanosec`` of 1e9
    and more gives a time that does not fit into the stamp of a message. Until
    test_a_time_before_zero_on_clock_is_not_followed passes without this.
    """
    rclpy.node.TimeSource = _TimeSource  # type: ignore[misc]


def make_executor() -> Executor:
    """
    Return the events executor.

    The single-threaded executor takes 2.5 times the processor time, most of it for building its
    wait set anew for every message (https://github.com/ros2/rclpy/issues/1389), and answers a
    backlog one message after the other. Raises StewartError where rclpy has no events executor.
    """
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError as exc:
        raise StewartError(
            'this rclpy has no events executor: rclpy 7.1.4 or later is needed (ROS 2 Jazzy of '
            '2025 or later)') from exc
    return EventsExecutor()


def spin(executor: Executor, node: Node, stop: Future, stopped: Callable[[], bool]) -> None:
    """
    Spin until a future is done; a timer of the node sets it to 0 once ``stopped`` is true.

    In pieces of 10 s: without a timeout, rclpy's wait takes half a core and may not return (no
    upstream issue; similar: https://github.com/ros2/rclpy/issues/1223). A timeout alone would not
    do: while another timer is always due, as in a simulator that is too slow for real time, the
    events executor does not return, but still serves all timers.
    """
    def look() -> None:
        if stopped() and not stop.done():
            stop.set_result(0)

    node.create_timer(_LOOK, look, clock=Clock(clock_type=ClockType.STEADY_TIME))
    while not stop.done():
        executor.spin_until_future_complete(stop, _PIECE)


def shut_down(executor: Executor | None, node: Node | None) -> None:
    """
    End executor, node and ROS, in this order.

    All on the thread that has made them and before the interpreter ends, else rclpy crashes there
    (similar: https://github.com/ros2/rclpy/issues/1644).

    DDS is told that the process leaves, and its shared memory is freed, when nothing refers to the
    node any more. ``destroy_node`` of a lifecycle node leaves its state machine, and a node whose
    constructor raised waits for the collector (no upstream issue; until
    test_a_signal_ends_it_with_exit_code_0 passes without the state machine's end).
    """
    if executor is not None:
        executor.shutdown()
    if node is not None:
        node.destroy_node()
    if isinstance(node, LifecycleNode):
        node._state_machine.destroy_when_not_in_use()
    gc.collect()
    rclpy.try_shutdown()


def end_process(code: int) -> NoReturn:
    """
    End the process after ``shut_down``, without the destructors of libraries.

    Those of Fast DDS and OpenSSL crash over TLS now and then, after the interpreter has ended:
    exit code -11 in one of a few runs of test_tls while other programs load the computer (no
    upstream issue).
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
