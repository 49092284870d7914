# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
SIGINT, SIGTERM and SIGHUP set a flag that a program looks at; they raise no exception.

An exception that a handler raises appears in whatever code runs at that time. Where this is a
finalizer, a callback from C or another library's ``except``, the exception is lost, and the signal
with it. The handlers of rclpy are not used either: they shut ROS down in the middle of a callback,
whose calls of ROS then raise RCLError (https://github.com/ros2/rclpy/issues/1287).
"""

from __future__ import annotations

from collections.abc import Callable
import os
import signal
from typing import Any, TypeVar

from stewart_dynamics.signals import ending_signals

Result = TypeVar('Result')

_LOOK = 0.1  # [s]


class Signals:
    """The signals received since ``watch``."""

    def __init__(self) -> None:
        self.received = False
        self._ends = False

    def watch(self, end_at_once: bool = False) -> None:
        """
        Handle these signals from now on; only the main thread may call it.

        With ``end_at_once`` they end the process, exit code 0: while libraries are imported, there
        is nothing to clean up.
        """
        self._ends = end_at_once
        for number in ending_signals():
            signal.signal(number, self._handle)

    def ignore(self) -> None:
        """Ignore these signals from now on: the program ends anyway."""
        for number in ending_signals():
            signal.signal(number, signal.SIG_IGN)

    def interruptible(self, compute: Callable[[], Result]) -> Result:
        """
        Return what a long computation gives, or raise KeyboardInterrupt soon after a signal.

        It runs in a thread of its own, which goes on after a signal until the process ends.
        """
        from concurrent.futures import Future, wait  # late, so that signals are handled early
        from threading import Thread

        future: Future[Result] = Future()

        def run() -> None:
            try:
                future.set_result(compute())
            except BaseException as exc:
                future.set_exception(exc)

        Thread(target=run, daemon=True).start()
        while not wait([future], _LOOK).done:
            if self.received:
                raise KeyboardInterrupt
        return future.result()

    def _handle(self, number: int, frame: Any) -> None:
        self.received = True
        if self._ends:
            os._exit(0)


SIGNALS = Signals()  # those of this process
