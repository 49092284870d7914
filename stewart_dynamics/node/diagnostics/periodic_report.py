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
The periodic report: when it is due, and the base class of its parts.

A report is due once per second and whenever the level of a part has changed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
import math
from typing import NamedTuple

from stewart_dynamics.setpoints.rejections import Rejection

# Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR, STALE = range(4)

# Time of the last message before the first one.
NEVER = -math.inf

# Maximum time between two reports [s].
PERIOD = 1.0

# Period at which a node calls ``Report.due`` if nothing else happens [s].
TICK = 0.05

# A level is kept for this long after its cause was last seen [s], so that a hexapod that moves
# back and forth across a limit is not reported a thousand times in a second.
_HOLD_SECONDS = 1.0


class Level(NamedTuple):
    """A level, and its cause in words."""

    level: int
    message: str


OK_LEVEL = Level(OK, '')


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus; keys of values carry their unit."""

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class LogLine(NamedTuple):
    """A line for the log."""

    level: int
    text: str
    kind: Hashable = None
    """Repeated lines of one kind are limited in number; without it each is logged."""


class _Seen(NamedTuple):
    """A state, and when it was last active."""

    at: float
    state: Level
    lasts: bool


class Held:
    """A state that lasts, and those of a higher level for as long as they are held."""

    def __init__(self) -> None:
        self._state = OK_LEVEL
        self._seen: dict[int, _Seen] = {}

    def see(self, state: Level, now: float) -> None:
        """Note a state that lasts until the next one is noted."""
        self._state = state
        if state.level > OK:
            self._seen[state.level] = _Seen(now, state, lasts=True)

    def happened(self, state: Level, now: float) -> None:
        """Note an instantaneous event."""
        self._seen[state.level] = _Seen(now, state, lasts=False)

    def level(self, now: float) -> int:
        """Return the highest level that is held."""
        if not self._seen:
            return self._state.level
        self._forget(now)
        return max(self._state.level, *self._seen) if self._seen else self._state.level

    def at(self, now: float) -> Level:
        """Return the state of the highest level; the message of a past state contains its age."""
        self._forget(now)
        worst = max(self._seen, default=OK)
        if worst <= self._state.level:
            return self._state
        at, state, lasts = self._seen[worst]
        if not lasts:
            return state
        return Level(state.level, f'{state.message} ({now - at:.1f} s ago)')

    def _forget(self, now: float) -> None:
        for level in [level for level, seen in self._seen.items()
                      if now - seen.at >= _HOLD_SECONDS]:
            del self._seen[level]


class LevelLog:
    """
    Log lines for the changes of a level.

    Parameters
    ----------
    name : str
        Prefix of the lines.

    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._level = OK

    def lines(self, state: Level) -> list[LogLine]:
        """Return the line for a state; empty if the level has not changed."""
        if state.level == self._level:
            return []
        self._level = state.level
        return [LogLine(state.level, f'{self._name}: {state.message}')]


class Part:
    """
    A part of the report: one status, and the log lines of its changes.

    Subclasses have a ``name`` and define ``values``, and ``state`` and ``level`` where these are
    not those of ``held``.
    """

    name = ''

    def __init__(self) -> None:
        self.held = Held()
        self._log = LevelLog(self.name)
        self._rejections: Counter[Rejection] = Counter()

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection: it is counted, and a warning while it is held."""
        self._count(self.held, rejection, details, now)

    def level(self, now: float) -> int:
        """Return the present level; must be fast, because it is called after every answer."""
        return self.held.level(now)

    def state(self, now: float) -> Level:
        """Return the present level and its cause."""
        return self.held.at(now)

    def values(self, now: float) -> list[tuple[str, str]] | None:
        """Return keys and values of the status; None if it is omitted."""
        raise NotImplementedError

    def status(self, now: float) -> Status | None:
        """Return the status for a report; None if it is omitted."""
        values = self.values(now)
        return None if values is None else Status(self.name, *self.state(now), tuple(values))

    def log_lines(self, now: float) -> list[LogLine]:
        """Return log lines for changes of level since the last report."""
        return self._log.lines(self.state(now))

    def _count(self, held: Held, rejection: Rejection, details: str, now: float) -> None:
        self._rejections[rejection] += 1
        held.happened(Level(WARN, f'{rejection.topic}: {rejection.reason} ({details})'), now)

    def rejections(self) -> list[tuple[str, str]]:
        """Return the number of rejections by topic and reason, as keys and values."""
        return [(f'rejected, {topic}: {reason}', str(n))
                for (topic, reason), n in sorted(self._rejections.items())]


def silent_topics(heard: Mapping[str, float], timeout: float, now: float) -> str:
    """Return the topics silent for longer than a timeout; empty if no topic is silent."""
    return ', '.join(
        f'{topic} never came' if at == NEVER else f'{topic} silent for {now - at:.1f} s'
        for topic, at in heard.items() if now - at > timeout)


def last_heard(heard: Mapping[str, float], now: float) -> list[tuple[str, str]]:
    """Return the time since the last message on each topic, as keys and values."""
    return [(f'{topic}: last heard (s ago)', 'never' if at == NEVER else f'{now - at:.3f}')
            for topic, at in heard.items()]


class Report:
    """
    The statuses of all parts, and when they are due.

    Parameters
    ----------
    parts : sequence of Part
        In the order of their statuses.
    now : float
        Start time of the reports.

    """

    def __init__(self, parts: Sequence[Part], now: float) -> None:
        self._parts = parts
        self._levels_of = [part.level for part in parts]
        self._made = now
        self._levels: list[int] = []

    def level_changed(self, now: float) -> bool:
        """Return whether a level has changed since the last report."""
        return [level(now) for level in self._levels_of] != self._levels

    def due(self, now: float, early: float = 0.0) -> bool:
        """Return whether a report is due, at most ``early`` seconds before its time."""
        return now - self._made >= PERIOD - early or self.level_changed(now)

    def make(self, now: float) -> tuple[list[Status], list[LogLine]]:
        """Return the statuses and the log lines."""
        self._made = now
        self._levels = [level(now) for level in self._levels_of]
        statuses = [part.status(now) for part in self._parts]
        return ([status for status in statuses if status is not None],
                [line for part in self._parts for line in part.log_lines(now)])
