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
    """A level that was noted: when, why, and whether it lasts until the next note."""

    at: float
    message: str
    lasts: bool


class Held:
    """
    Levels by their causes, each held for a second after it was last noted.

    causes: in the order of their messages; a single one by default.
    """

    def __init__(self, *causes: str) -> None:
        self._present = dict.fromkeys(causes or ('',), OK)
        self._seen: dict[tuple[str, int], _Seen] = {}

    def see(self, state: Level, now: float, cause: str = '') -> None:
        """Note a state that lasts until the next one of its cause is noted."""
        self._present[cause] = state.level
        if state.level > OK:
            self._seen[cause, state.level] = _Seen(now, state.message, lasts=True)

    def happened(self, state: Level, now: float, cause: str = '') -> None:
        """Note an instantaneous event."""
        self._seen[cause, state.level] = _Seen(now, state.message, lasts=False)

    def level(self, now: float) -> int:
        """Return the highest level that is held."""
        if not self._seen:
            return OK
        self._forget(now)
        return max((level for _, level in self._seen), default=OK)

    def of(self, cause: str, now: float) -> Level:
        """Return the highest level of a cause; the message of a past state contains its age."""
        self._forget(now)
        level = max((level for each, level in self._seen if each == cause), default=OK)
        if level == OK:
            return OK_LEVEL
        at, message, lasts = self._seen[cause, level]
        past = lasts and level != self._present[cause]
        return Level(level, f'{message} ({now - at:.1f} s ago)' if past else message)

    def at(self, now: float) -> Level:
        """Return the highest level, and the messages of all causes."""
        found = [self.of(cause, now) for cause in self._present]
        return Level(max(each.level for each in found),
                     '; '.join(each.message for each in found if each.message))

    def _forget(self, now: float) -> None:
        for cause, level in [
                key for key, seen in self._seen.items() if now - seen.at >= _HOLD_SECONDS
                and not (seen.lasts and self._present[key[0]] == key[1])]:
            del self._seen[cause, level]


class StatusPart:
    """
    A part of the report: one status, and the log lines of its changes.

    Subclasses have a ``name`` and define ``values``, and ``state`` and ``level`` where these are
    not those of ``held``.
    """

    name = ''

    def __init__(self, *causes: str) -> None:
        self.held = Held(*causes)
        self._logged: dict[str, int] = {}
        self._rejections: Counter[Rejection] = Counter()

    def rejected(self, rejection: Rejection, details: str, now: float, cause: str = '') -> None:
        """Note a rejection: it is counted, and a warning while it is held."""
        self._rejections[rejection] += 1
        self.held.happened(
            Level(WARN, f'{rejection.topic}: {rejection.reason} ({details})'), now, cause)

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
        return self._changed(self.state(now))

    def _changed(self, state: Level, cause: str = '') -> list[LogLine]:
        """Return the log line for a state of a cause; empty if its level has not changed."""
        if state.level == self._logged.get(cause, OK):
            return []
        self._logged[cause] = state.level
        return [LogLine(state.level, f'{self.name}: {state.message}')]

    def rejections(self) -> list[tuple[str, str]]:
        """Return the number of rejections by topic and reason, as keys and values."""
        return [(f'rejected, {topic}: {reason}', str(n))
                for (topic, reason), n in sorted(self._rejections.items())]


class Answers:
    """
    Number of answered setpoints, and time of the last one.

    timeout: age from which the last answer counts as old [s].
    now: start time of the count.
    """

    def __init__(self, timeout: float, now: float) -> None:
        self.number = 0
        self.at = now
        self._timeout = timeout

    def add(self, now: float) -> None:
        """Note an answer."""
        self.number += 1
        self.at = now

    def stale(self, now: float) -> bool:
        """Return whether there is no recent answer."""
        return not self.number or now - self.at > self._timeout

    def state(self, state: Level, otherwise: str, now: float) -> Level:
        """Return a state of the answers: with another message if empty, with the age if stale."""
        if not self.number:
            return Level(state.level, state.message or 'no setpoint yet')
        age = f' (of the last setpoint, {now - self.at:.1f} s ago)' if self.stale(now) else ''
        return Level(state.level, (state.message or otherwise) + age)


def silent_topics(heard: Mapping[str, float], timeout: float, now: float) -> str:
    """Return the topics silent for longer than a timeout; empty if no topic is silent."""
    return ', '.join(
        f'{topic} never came' if at == NEVER else f'{topic} silent for {now - at:.1f} s'
        for topic, at in heard.items() if now - at > timeout)


def last_heard(heard: Mapping[str, float], now: float) -> list[tuple[str, str]]:
    """Return the time since the last message on each topic, as keys and values."""
    return [(f'{topic}: last heard (s ago)', 'never' if at == NEVER else f'{now - at:.3f}')
            for topic, at in heard.items()]


class PeriodicReport:
    """The statuses of all parts, and when they are due."""

    def __init__(self, parts: Sequence[StatusPart], now: float) -> None:
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
