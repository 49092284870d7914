# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Workarounds for rclpy 7.1 (ROS 2 Jazzy): each for one defect, with its upstream issue.

rclpy 9.1 (Kilted) works with all of them.

Where there is no upstream issue, the docstring describes what rclpy does, and names a test: when
it passes without the workaround, the workaround can be removed.
"""

from __future__ import annotations

from collections.abc import Callable
import faulthandler
import gc
import os
import sys
from typing import Any, NoReturn

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.lifecycle import LifecycleNode
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time_source import TimeSource

from stewart_dynamics.arrays import SECOND

_PIECE, _LOOK = 10.0, 0.1  # [s]
# Longest end of a node [s]: seconds on a loaded computer.
_LONGEST_END = 60.0


def answer_impossible_transitions(node: LifecycleNode, log: Callable[[str], None]) -> None:
    """
    Answer a request for a transition that the present state does not have: no success.

    rclpy raises the error out of spin, which ends the program, and the client waits forever
    (https://github.com/ros2/rclpy/issues/1209; its pull request 1319 is not in 7.1). rclpy 9.1
    answers so itself, and logs the error.
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

    rclpy sends what the callback returns, by a method that is replaced here. A coroutine could
    wait, but the events executor does not await it (https://github.com/ros2/rclpy/issues/1473,
    fixed in later releases), and the single-threaded one may not resume it
    (https://github.com/ros2/rclpy/issues/1462).

    begin: called at each request with a function that sends the answer, once.
    """
    service: Any = node.create_service(kind, name, lambda request, response: response)
    send = service.send_response
    service.send_response = lambda response, header: begin(lambda answer: send(answer, header))
    return service


class OneShotTimer:
    """
    Calls back once after each start, no matter how late the executor is.

    After each ``reset`` of a timer the events executor looks at all timers of its clock, and at
    each look it calls those that are due. When it falls behind, several looks come before the
    first call: then a timer that is reset at each call is called again at once, and a timer beside
    it is called often enough that its next call is minutes away (``UpdateTimers`` in
    https://github.com/ros2/rclpy/blob/7.1.5/rclpy/src/rclpy/events_executor/timers_manager.cpp;
    no upstream issue). So each one has a clock of its own, and a call before its time is ignored.
    Until test_a_timer_that_starts_itself_again_is_late_and_never_early passes without this.

    seconds: from the start to the call.
    callback: it may start the timer again.
    """

    def __init__(self, node: Node, seconds: float, callback: Callable[[], None]) -> None:
        self._nanoseconds = round(seconds * SECOND)
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
            if msg.clock.nanosec >= SECOND:
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

    The process leaves DDS, and its shared memory is freed, when nothing refers to the
    node any more. ``destroy_node`` of a lifecycle node leaves its state machine, and a node whose
    constructor raised waits for the collector (no upstream issue; until
    test_a_signal_ends_it_with_exit_code_0 passes without the state machine's end).

    Fast DDS 2.14 may never return: ``DomainParticipant::set_listener`` waits, with a lock held,
    for a callback of the discovery that waits for this lock (seen once in hundreds of ends, as a
    reader left at the same time; no upstream issue). rclpy holds the interpreter meanwhile, so
    that only faulthandler's thread can end the process: with exit code 1, after a traceback.
    """
    faulthandler.dump_traceback_later(_LONGEST_END, exit=True)
    if executor is not None:
        executor.shutdown()
    if node is not None:
        node.destroy_node()
    if isinstance(node, LifecycleNode):
        node._state_machine.destroy_when_not_in_use()
    gc.collect()
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()


def end_process(code: int) -> NoReturn:
    """
    End the process after ``shut_down``, without the destructors of libraries.

    The destructors of Fast DDS and OpenSSL crash over TLS now and then, after the interpreter has
    ended: exit code -11 in one of a few runs of test_tls while other programs load the computer
    (no upstream issue).
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
