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
The statuses ``setpoints`` and ``timing``.

Silent topics, rejections and other publishers of setpoints; processing times, and setpoints
dropped for lack of time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
import math
from statistics import median

from stewart_dynamics.node.diagnostics.periodic_report import (
    Answers, ERROR, last_heard, Level, LogLine, NEVER, silent_topics, STALE, StatusPart, WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.repeated_log import SECONDS
from stewart_dynamics.setpoints.rejections import DROPPED, NOT_JOINED, Rejection

_REJECTED, _INCOMPLETE = 'rejected', 'incomplete'
# Reasons of rejection that the status timing counts.
_COUNTED = {DROPPED: 'dropped', NOT_JOINED: _INCOMPLETE}

# Time after which arriving messages that complete no setpoint are logged [s].
_PATIENCE = 0.9


class SetpointDiagnostics(StatusPart):
    """Notes received and rejected setpoint messages, publishers and subscribers."""

    name = 'setpoints'

    def __init__(self, parameters: Parameters, topics: Sequence[str], answers: Answers,
                 now: float) -> None:
        super().__init__(_REJECTED, _INCOMPLETE)
        self._timeout: float = parameters['setpoint.timeout']
        self._tolerance: float = parameters['setpoint.sync_tolerance']
        self._answers = answers
        self.heard = dict.fromkeys(topics, NEVER)  # when the last message came on each topic
        self._writers: dict[str, int] = {}
        self._readers: dict[str, int] = {}
        self._namesakes = '', 1
        self._lines: list[LogLine] = []
        self._trouble: list[str] = []  # unexpected publishers and namesakes
        # Start of the time in which messages complete no setpoint, as seen by reports.
        self._incomplete_since = math.inf
        self._warned_at = NEVER
        # Start times of the last two one-second windows, and the answer counts at their start.
        self._windows = [(now, 0), (now, 0)]

    def found(self, writers: Mapping[str, int], readers: Mapping[str, int], name: str,
              namesakes: int) -> None:
        """
        Note publishers, subscribers and nodes of the same name.

        writers: number of publishers on setpoint topics; other topics keep their number.
        readers: number of subscribers to the topics for controllers.
        """
        self._writers.update(writers)
        self._readers.update(readers)
        alone = self._namesakes[1] <= 1
        self._namesakes = name, namesakes
        self._trouble = [f'{topic} has {n} writers' for topic, n in self._writers.items() if n > 1]
        if namesakes > 1:
            self._trouble.append(f'{namesakes} nodes are named {name}')
            if alone:
                self._lines = [LogLine(WARN, f'setpoints: {self._trouble[-1]}')]

    def found_writers(self, topic: str, writers: int) -> None:
        """Note the number of publishers on one setpoint topic."""
        if writers != self._writers.get(topic):
            self.found({topic: writers}, {}, *self._namesakes)

    def rejected(self, rejection: Rejection, details: str, now: float, cause: str = '') -> None:
        """Note a rejection."""
        super().rejected(rejection, details, now,
                         _INCOMPLETE if rejection.reason == NOT_JOINED else _REJECTED)

    def level(self, now: float) -> int:
        """Return the present level."""
        if self._trouble:
            return ERROR
        return STALE if self._answers.stale(now) else self.held.level(now)

    def state(self, now: float) -> Level:
        """Return the present level and its causes."""
        found = list(self._trouble)
        if self._answers.stale(now):
            found.append(self._no_setpoint(now))
        if not found:
            found = [self.held.of(_REJECTED, now).message
                     or self.held.of(_INCOMPLETE, now).message or 'answered']
        return Level(self.level(now), ', '.join(found))

    def values(self, now: float) -> list[tuple[str, str]]:
        """Return keys and values; the rate is that of the last one or two seconds."""
        answers = self._answers
        (begin, before), (last, _) = self._windows
        seconds = now - begin
        rate = (answers.number - before) / seconds if seconds > 0.0 else 0.0
        # Reports come at changes of level as well, and may be much less than a second apart.
        if now - last >= 1.0:
            self._windows = [self._windows[1], (now, answers.number)]
        values = [('setpoints answered', str(answers.number)), ('rate (Hz)', f'{rate:.1f}')]
        if answers.number:
            values.append(('age of the last (s)', f'{now - answers.at:.3f}'))
        values += last_heard(self.heard, now)
        values += [(f'{topic}: writers', str(n)) for topic, n in self._writers.items()]
        values += [(f'{topic}: readers', str(n)) for topic, n in self._readers.items()]
        return values + self.rejections()

    def log_lines(self, now: float) -> list[LogLine]:
        """
        Return warnings of another node of this name and of messages that complete no setpoint.

        Nothing else: rejections are logged one by one, and without setpoints there is no
        fault.
        """
        lines, self._lines = self._lines, []
        last = max(self.heard.values())
        if last <= self._answers.at:
            self._incomplete_since = math.inf
            return lines
        self._incomplete_since = min(self._incomplete_since, now)
        if (last - self._incomplete_since < _PATIENCE or last <= self._warned_at
                or now - self._warned_at < SECONDS
                or self.held.of(_REJECTED, now).level):
            return lines
        self._warned_at = now
        return [*lines, LogLine(WARN, f'setpoints: {self._no_setpoint(now)}')]

    def _no_setpoint(self, now: float) -> str:
        """Return why there is no setpoint: silence, rejections or stamps."""
        silent = silent_topics(self.heard, self._timeout, now)
        return 'no setpoint: ' + (silent or self.held.of(_REJECTED, now).message or (
            'all topics arrive, but none is joined: their stamps differ by more than '
            f'setpoint.sync_tolerance, {self._tolerance:g} s'))


class TimingDiagnostics(StatusPart):
    """Notes processing times and dropped setpoints."""

    name = 'timing'

    def __init__(self, answers: Answers, now: float) -> None:
        super().__init__()
        self._answers = answers
        self._counts = Counter(dict.fromkeys(_COUNTED, 0))
        # Processing times [s] of the present and of the previous second.
        self._begin = now
        self._times: list[float] = []
        self._times_before: list[float] = []

    def answered(self, seconds: float) -> None:
        """Note the processing time of a setpoint, from its last message on."""
        self._times.append(seconds)

    def rejected(self, rejection: Rejection, details: str, now: float, cause: str = '') -> None:
        """Note a rejection; only dropped setpoints are a warning here."""
        if rejection.reason in _COUNTED:
            self._counts[rejection.reason] += 1
        if rejection.reason == DROPPED:
            super().rejected(rejection, details, now)

    def values(self, now: float) -> list[tuple[str, str]]:
        """Return keys and values; processing times are those of the last one or two seconds."""
        times = self._times_before + self._times
        if now - self._begin >= 1.0:
            self._begin, self._times_before, self._times = now, self._times, []
        values = []
        if times:
            values = [('processing time, median (us)', f'{median(times) * 1e6:.0f}'),
                      ('processing time, largest (us)', f'{max(times) * 1e6:.0f}')]
        values += [(key, str(self._counts[reason])) for reason, key in _COUNTED.items()]
        return values

    def state(self, now: float) -> Level:
        """Return the present level and its cause."""
        return self._answers.state(self.held.at(now), 'on time', now)
