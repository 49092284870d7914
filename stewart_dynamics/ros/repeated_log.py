# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Log lines of repeated events: the first, one in five seconds, and the last.

Lines that are no kind of repeated event are logged each.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
import math
import time
from typing import Any

INFO, WARNING, ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus

# Time without an event after which a series ends, and interval of the lines while it lasts [s].
SECONDS = 5.0


@dataclass
class _Series:
    """Events of one kind, the last of them less than SECONDS ago."""

    text: str
    logged: float
    seen: float
    unlogged: int = 0
    number: int = 1


class RepeatedLog:
    """Writes lines to the logger of a node; of repeated events only some."""

    def __init__(self, logger: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self._logger = logger
        self._clock = clock
        self._series: dict[tuple[int, Hashable], _Series] = {}

    def write(self, lines: Iterable[tuple[int, str, Hashable]]) -> None:
        """Write lines: a level of diagnostics, a text, and the kind of repeated event or None."""
        for level, text, kind in lines:
            if kind is None:
                self._write(level, text)
                continue
            now, series = self._clock(), self._series.get((level, kind))
            if series is None:
                self._series[level, kind] = _Series(text, now, now)
                self._write(level, text)
                continue
            series.text, series.seen = text, now
            series.number += 1
            if now - series.logged < SECONDS:
                series.unlogged += 1
                continue
            before = f' (and {series.unlogged} before it)' if series.unlogged else ''
            series.logged, series.unlogged = now, 0
            self._write(level, text + before)

    def write_last(self, now: float = math.inf) -> None:
        """Write the last line of each series that has ended by ``now``, by default of all."""
        for (level, kind), series in list(self._series.items()):
            if now - series.seen >= SECONDS:
                del self._series[level, kind]
                if series.unlogged:
                    self._write(level, f'{series.text} (the last of {series.number})')

    def _write(self, level: int, text: str) -> None:
        # One call for each level: rclpy requires the level of a call to be constant.
        if level == INFO:
            self._logger.info(text)
        elif level == WARNING:
            self._logger.warning(text)
        else:
            self._logger.error(text)
