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

"""The node's log, which limits the number of lines for repeated events."""

from __future__ import annotations

from collections.abc import Iterable
import math
import time
from typing import Any

from stewart_dynamics.node.diagnostics.periodic_report import ERROR, LogLine, OK, WARN
from stewart_dynamics.ros.repeated_events import Series


class RepeatedLog:
    """
    Writes lines to a logger.

    Parameters
    ----------
    logger : rclpy logger
        Logger of the node.

    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._series = {level: Series() for level in (OK, WARN, ERROR)}

    def write(self, lines: Iterable[LogLine]) -> None:
        """Write lines; lines of one kind at most every few seconds."""
        for level, text, kind in lines:
            if kind is None:
                self._write(level, text)
            elif (line := self._series[level].add(kind, text, time.monotonic())) is not None:
                self._write(level, line)

    def write_last(self, now: float = math.inf) -> None:
        """Write the last line of each series that has ended by ``now``, by default of all."""
        for level, series in self._series.items():
            for line in series.over(now):
                self._write(level, line)

    def _write(self, level: int, text: str) -> None:
        # One call for each level: rclpy requires the level of a call to be constant.
        if level == OK:
            self._logger.info(text)
        elif level == WARN:
            self._logger.warning(text)
        else:
            self._logger.error(text)
