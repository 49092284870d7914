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
Log lines of repeated events: the first, one in five seconds, and the last.

Lines that are no kind of repeated event are logged each.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass
import math
import time
from typing import Any

INFO, WARNING = 0, 1  # levels of diagnostic_msgs/DiagnosticStatus

# Time without an event after which a series ends, and interval of the lines while it lasts [s].
SECONDS = 5.0


@dataclass
class _One:
    """A series that is not over."""

    text: str
    logged: float
    seen: float
    unlogged: int = 0
    number: int = 1


class Series:
    """The series of events, by their kind; times are seconds of a steady clock."""

    def __init__(self) -> None:
        self._of_kind: dict[Hashable, _One] = {}

    def add(self, kind: Hashable, text: str, now: float) -> str | None:
        """Return the line to log for one more event, None if it is too early for one."""
        one = self._of_kind.get(kind)
        if one is None:
            self._of_kind[kind] = _One(text, now, now)
            return text
        one.text, one.seen = text, now
        one.number += 1
        if now - one.logged < SECONDS:
            one.unlogged += 1
            return None
        before = f' (and {one.unlogged} before it)' if one.unlogged else ''
        one.logged, one.unlogged = now, 0
        return text + before

    def over(self, now: float) -> list[str]:
        """Return the lines of the series that are over: the last event of each, if not logged."""
        lines = []
        for kind, one in list(self._of_kind.items()):
            if now - one.seen >= SECONDS:
                del self._of_kind[kind]
                if one.unlogged:
                    lines.append(f'{one.text} (the last of {one.number})')
        return lines


class RepeatedLog:
    """Writes lines to the logger of a node; of repeated events only some."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._series: dict[int, Series] = {}

    def write(self, lines: Iterable[tuple[int, str, Hashable]]) -> None:
        """
        Write lines, each a level of diagnostics, a text, and the kind of repeated event or None.

        Lines of one kind are written at most every few seconds.
        """
        for level, text, kind in lines:
            if kind is None:
                self._write(level, text)
                continue
            series = self._series.setdefault(level, Series())
            if (line := series.add(kind, text, time.monotonic())) is not None:
                self._write(level, line)

    def write_last(self, now: float = math.inf) -> None:
        """Write the last line of each series that has ended by ``now``, by default of all."""
        for level, series in self._series.items():
            for line in series.over(now):
                self._write(level, line)

    def _write(self, level: int, text: str) -> None:
        # One call for each level: rclpy requires the level of a call to be constant.
        if level == INFO:
            self._logger.info(text)
        elif level == WARNING:
            self._logger.warning(text)
        else:
            self._logger.error(text)
