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
SIGINT and SIGTERM: a flag that a program looks at, and an exception nowhere but in compilation.

An exception that a handler raises appears in whatever code runs at that time. Where this is a
finalizer, a callback from C or another library's ``except``, the exception is lost, and the signal
with it. The handlers of rclpy are not used either: they shut ROS down in the middle of a callback,
whose calls of ROS then raise RCLError (https://github.com/ros2/rclpy/issues/1287).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import signal
from typing import Any

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class Signals:
    """What has been received since ``watch``."""

    def __init__(self) -> None:
        self.received = False
        self._interrupts = False

    def watch(self) -> None:
        """Handle both signals from now on; only the main thread may do so."""
        for number in _NUMBERS:
            signal.signal(number, self._handle)

    def ignore(self) -> None:
        """Ignore both from now on: the program ends anyway."""
        for number in _NUMBERS:
            signal.signal(number, signal.SIG_IGN)

    @contextmanager
    def interrupting(self) -> Iterator[None]:
        """Raise KeyboardInterrupt in what runs inside: it takes long, and calls no ROS."""
        self._interrupts = True
        try:
            if self.received:
                raise KeyboardInterrupt
            yield
        finally:
            self._interrupts = False

    def _handle(self, number: int, frame: Any) -> None:
        self.received = True
        if self._interrupts:
            raise KeyboardInterrupt


SIGNALS = Signals()
"""Those of this process."""
