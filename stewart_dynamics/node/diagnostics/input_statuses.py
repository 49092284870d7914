# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The statuses of inputs: ``setpoints`` and ``base``.

Silent topics, rejections and other publishers of setpoints; whether the base's motion is known,
omitted if the base is fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

from stewart_dynamics.mechanics.rows import (
    BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, GRAVITY)
from stewart_dynamics.node.diagnostics.answers import Answers
from stewart_dynamics.node.diagnostics.levels import (
    ERROR, Level, LogLine, NEVER, OK, POSSIBLE_ERRORS, REJECTED, STALE, Status, StatusPart, Values,
    WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.repeated_log import SECONDS
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.rejections import NOT_JOINED, Rejection, STAMP_ZERO

INCOMPLETE, _UNKNOWN = 'incomplete', 'unknown'  # causes of a level besides rejections
# Time after which arriving messages that complete no setpoint are logged [s].
_PATIENCE = 0.9
_OF_BASE = (('gravity', 'm/s^2', GRAVITY), ('acceleration', 'm/s^2', BASE_ACCELERATION),
            ('angular velocity', 'rad/s', BASE_ANGULAR_VELOCITY),
            ('angular acceleration', 'rad/s^2', BASE_ANGULAR_ACCELERATION))


class SetpointDiagnostics(StatusPart):
    """Notes received and rejected setpoint messages, publishers and subscribers."""

    name = 'setpoints'

    def __init__(self, answers: Answers, topics: Sequence[str]) -> None:
        super().__init__(REJECTED, INCOMPLETE, POSSIBLE_ERRORS)
        self._answers = answers
        self.heard = dict.fromkeys(topics, NEVER)  # when the last message came on each topic
        self._writers: dict[str, int] = {}
        self._readers: dict[str, int] = {}
        self._namesakes = ''
        self._lines: list[LogLine] = []
        self._trouble: list[str] = []  # unexpected publishers and namesakes
        # Start of the time in which messages complete no setpoint, as seen by reports.
        self._incomplete_since = math.inf
        self._warned_at = NEVER
        self._unstamped = ''  # topic whose last message that was not joined had a stamp of zero

    def rejected(self, rejection: Rejection, details: str, now: float,
                 cause: str = REJECTED) -> None:
        """Note a rejection; one for lack of the other messages is a cause of silence."""
        super().rejected(rejection, details, now, cause)
        if rejection.reason == NOT_JOINED:
            self._unstamped = rejection.topic if details == STAMP_ZERO else ''

    def found(self, writers: Mapping[str, int], readers: Mapping[str, int],
              namesakes: str) -> None:
        """
        Note publishers, subscribers and nodes of the same name.

        writers: number of publishers on setpoint topics; other topics keep their number.
        readers: number of subscribers to the topics for controllers.
        namesakes: "2 nodes are named ..."; empty if there is only this one.
        """
        self._writers.update(writers)
        self._readers.update(readers)
        self._trouble = [f'{topic} has {n} writers' for topic, n in self._writers.items() if n > 1]
        if namesakes:
            self._trouble.append(namesakes)
            if not self._namesakes:
                self._lines = [LogLine(WARN, f'setpoints: {namesakes}')]
        self._namesakes = namesakes

    def found_writers(self, topic: str, writers: int) -> None:
        """Note the number of publishers on one setpoint topic."""
        if writers != self._writers.get(topic):
            self.found({topic: writers}, {}, self._namesakes)

    def level(self, now: float) -> int:
        """Return the present level."""
        if self._trouble:
            return ERROR
        return STALE if self._answers.stale(now) else self.held.level(now)

    def status(self, now: float) -> Status:
        """Return the status; the rate is that of the last one or two seconds."""
        answers = self._answers
        found = list(self._trouble)
        if answers.stale(now):
            found.append(self._no_setpoint(now))
        if not found:
            found = [self.held.of(REJECTED, now).message
                     or self.held.of(INCOMPLETE, now).message
                     or self.held.of(POSSIBLE_ERRORS, now).message or 'answered']
        number = len(answers.second_before.times) + len(answers.second.times)
        seconds = now - answers.second_before.begin
        rate = number / seconds if seconds > 0.0 else 0.0
        values = [('setpoints answered', str(answers.number)), ('rate (Hz)', f'{rate:.1f}')]
        if answers.number:
            values.append(('age of the last (s)', f'{now - answers.at:.3f}'))
        values += _last_heard(self.heard, now)
        values += [(f'{topic}: writers', str(n)) for topic, n in self._writers.items()]
        values += [(f'{topic}: readers', str(n)) for topic, n in self._readers.items()]
        values += self._error_values() + self._rejection_values()
        return Status(self.name, self.level(now), ', '.join(found), values)

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """
        Return warnings of namesakes, possible errors, and messages without a setpoint.

        Nothing else: rejections are logged one by one, and without setpoints there is no
        fault.
        """
        lines, self._lines = self._lines + self._error_lines(now), []
        last = max(self.heard.values())
        if last <= self._answers.at:
            self._incomplete_since = math.inf
            return lines
        if self._answers.at >= self._incomplete_since:  # answered since the last report
            self._incomplete_since = math.inf
        self._incomplete_since = min(self._incomplete_since, now)
        if (last - self._incomplete_since < _PATIENCE or last <= self._warned_at
                or now - self._warned_at < SECONDS
                or self.held.of(REJECTED, now).level):
            return lines
        self._warned_at = now
        return [*lines, LogLine(WARN, f'setpoints: {self._no_setpoint(now)}')]

    def _no_setpoint(self, now: float) -> str:
        """Return why there is no setpoint: silence, rejections or stamps."""
        parameters = self._answers.parameters
        # Only messages since the last setpoint could have been joined.
        missing = {topic: at for topic, at in self.heard.items() if at <= self._answers.at}
        return 'no setpoint: ' + (
            _silent_topics(self.heard, parameters.setpoint.timeout, now)
            or self.held.of(REJECTED, now).message
            or _silent_topics(missing, 0.0, now)
            or 'all topics arrive, but none is joined: ' + (
                f'header stamps of {self._unstamped} are zero: such messages are joined in order '
                'of arrival, one of each topic' if self._unstamped else
                'their stamps differ by more than setpoint.sync_tolerance, '
                f'{parameters.setpoint.sync_tolerance:g} s'))


class BaseDiagnostics(StatusPart):
    """Counts the base's messages, and notes for which setpoints its motion is known."""

    name = 'base'

    def __init__(self, parameters: Parameters, topics: Sequence[str]) -> None:
        super().__init__(REJECTED, _UNKNOWN, POSSIBLE_ERRORS)
        self._timeout = parameters.base.timeout
        self.heard = dict.fromkeys(topics, NEVER)  # when the last message came on each topic
        self._samples = 0
        self._sampled_at = NEVER
        self._row: Sequence[float] = ()
        self._unknown = 0

    def sampled(self, base: BaseInput, now: float) -> None:
        """Note that a message has completed a sample."""
        self._samples += 1
        self._sampled_at = now
        if base.last:
            self._row = base.last[1]

    def unknown(self, now: float) -> None:
        """Note a setpoint for which the motion was not known."""
        self._unknown += 1
        self.held.happened(Level(ERROR, self._why(now)), now, _UNKNOWN)

    def stale(self, now: float) -> bool:
        """Return whether no recent sample is available."""
        return now - self._sampled_at > self._timeout

    def level(self, now: float) -> int:
        """Return the present level."""
        if not self.heard:
            return OK
        return ERROR if self.stale(now) else self.held.level(now)

    def status(self, now: float) -> Status | None:
        """Return the status; None if the base is fixed."""
        if not self.heard:
            return None
        values = [('samples', str(self._samples)),
                  ('setpoints without forces, as the base was not known', str(self._unknown))]
        if self._samples:
            values.append(('age of the last sample (s)', f'{now - self._sampled_at:.3f}'))
        values += _last_heard(self.heard, now)
        values += [(f'{name} {axis} ({unit})', f'{number:.6g}') for name, unit, part in _OF_BASE
                   for axis, number in zip('xyz', self._row[part], strict=False)]
        # The first of the highest level; a known motion is the last.
        found = [self.held.of(REJECTED, now), self.held.of(POSSIBLE_ERRORS, now), self._lack(now)]
        worst = max(found, key=lambda each: each.level) if any(
            each.level for each in found) else found[-1]
        return Status(self.name, *worst,
                      values + self._error_values() + self._rejection_values())

    def log_lines(self, status: Status, now: float) -> list[LogLine]:
        """Return that there are no forces, and that there are again; rejections are logged."""
        # Where nothing has begun, nothing is wrong.
        if not self._samples and not self._unknown:
            return []
        return self._changed(*self._lack(now)) + self._error_lines(now)

    def _lack(self, now: float) -> Level:
        """Return whether the base's motion is missing."""
        if self.stale(now):
            return Level(ERROR, f'no forces: {self._why(now)}')
        unknown = self.held.of(_UNKNOWN, now)
        return (Level(unknown.level, f'no forces: {unknown.message}') if unknown.level
                else Level(OK, 'its motion is known'))

    def _why(self, now: float) -> str:
        """Return why the base's motion is unknown."""
        silent = _silent_topics(self.heard, self._timeout, now)
        if silent or self.stale(now):
            return silent or self.held.of(REJECTED, now).message or (
                'its topics arrive, but are not joined: their stamps differ')
        return ('the stamps of the base and of setpoints differ by more than base.timeout, '
                f'{self._timeout:g} s')


def _silent_topics(heard: Mapping[str, float], timeout: float, now: float) -> str:
    """Return the topics silent for longer than a timeout; empty if no topic is silent."""
    return ', '.join(
        f'{topic} never came' if at == NEVER else f'{topic} silent for {now - at:.1f} s'
        for topic, at in heard.items() if now - at > timeout)


def _last_heard(heard: Mapping[str, float], now: float) -> Values:
    """Return the time since the last message on each topic, as keys and values."""
    return [(f'{topic}: last heard (s ago)', 'never' if at == NEVER else f'{now - at:.3f}')
            for topic, at in heard.items()]
