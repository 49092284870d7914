# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Levels of diagnostics, held for a second each, and the base class of a status."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
import math
from typing import NamedTuple

from stewart_dynamics.setpoints.consistency import MessageError
from stewart_dynamics.setpoints.rejections import Rejection

# Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR, STALE = range(4)

# Maximum time between two reports [s].
PERIOD = 1.0

# Time of the last message before the first one.
NEVER = -math.inf

# A level is kept for this long after its cause was last seen [s], so that a hexapod that moves
# back and forth across a limit is not reported a thousand times in a second.
_HOLD_SECONDS = 1.0

REJECTED = ''  # the cause of a level that every status has
POSSIBLE_ERRORS = 'possible errors'  # in messages


class Level(NamedTuple):
    """A level, and its cause in words."""

    level: int
    message: str


OK_LEVEL = Level(OK, '')

Values = list[tuple[str, str]]  # keys, with their unit, and values


class Status(NamedTuple):
    """One diagnostic_msgs/DiagnosticStatus."""

    name: str
    level: int
    message: str
    values: Values


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
    """Levels by their causes, each held for a second; messages are in the order of the causes."""

    def __init__(self, *causes: str) -> None:
        self._present = dict.fromkeys(causes, OK)
        self._seen: dict[tuple[str, int], _Seen] = {}

    def see(self, state: Level, now: float, cause: str) -> None:
        """Note a state that lasts until the next one of its cause is noted."""
        self._present[cause] = state.level
        if state.level > OK:
            self._seen[cause, state.level] = _Seen(now, state.message, lasts=True)

    def happened(self, state: Level, now: float, cause: str) -> None:
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
    One status of the report, with the causes of its level.

    Subclasses note events. ``level`` is called after every answer and must be fast; ``status`` and
    ``log_lines`` are called once for each report.
    """

    name = ''

    def __init__(self, *causes: str) -> None:
        self.held = Held(*causes)
        self.rejections = Counter[Rejection]()
        self._logged: dict[str, int] = {}
        self._errors: Sequence[MessageError] = ()

    def rejected(self, rejection: Rejection, details: str, now: float,
                 cause: str = REJECTED) -> None:
        """Note a rejection: it is counted, and a warning while it is held."""
        self.rejections[rejection] += 1
        self.held.happened(
            Level(WARN, f'{rejection.topic}: {rejection.reason} ({details})'), now, cause)

    def note_errors(self, errors: Sequence[MessageError], now: float) -> None:
        """Note the possible errors in the messages; they last until the next call."""
        self._errors = errors
        self.held.see(Level(WARN if errors else OK, '; '.join(
            each.words for each in errors)), now, POSSIBLE_ERRORS)

    def level(self, now: float) -> int:
        """Return the present level."""
        return self.held.level(now)

    def status(self, now: float) -> Status | None:
        """Return the status; None if it is omitted."""
        raise NotImplementedError

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return log lines for changes since the last report."""
        return self._changed(status.level, status.message)

    def _changed(self, level: int, message: str, cause: str = '') -> list[LogLine]:
        """Return the log line for a state of a cause; empty if its level has not changed."""
        if level == self._logged.get(cause, OK):
            return []
        self._logged[cause] = level
        return [LogLine(level, f'{self.name}: {message}')]

    def _error_lines(self, now: float) -> list[LogLine]:
        """Return the log line where possible errors begin or end."""
        level, message = self.held.of(POSSIBLE_ERRORS, now)
        return self._changed(
            level, message or 'no possible errors in the messages', POSSIBLE_ERRORS)

    def _error_values(self) -> Values:
        return [value for each in self._errors for value in each.values]

    def _rejection_values(self) -> Values:
        return [(f'rejected, {topic}: {reason}', str(n))
                for (topic, reason), n in sorted(self.rejections.items())]
