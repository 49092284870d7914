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

"""The status ``setpoints``: silent topics, rejections, other publishers of setpoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, Held, last_heard, Level, LogLine, NEVER, Part, silent_topics, STALE, WARN)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.repeated_events import SECONDS
from stewart_dynamics.setpoints.rejections import NOT_JOINED, Rejection

# Time after which arriving messages that complete no setpoint are logged [s].
_PATIENCE = 0.9


class Answers:
    """
    Number of answered setpoints, and time of the last one.

    Parameters
    ----------
    timeout : float
        Age from which the last answer counts as old [s].
    now : float
        Start time of the count.

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

    def age(self, now: float) -> str:
        """Return the age of the last answer as a text to append; empty if it is recent."""
        if not self.number or not self.stale(now):
            return ''
        return f' (of the last setpoint, {now - self.at:.1f} s ago)'


class SetpointDiagnostics(Part):
    """
    Notes received and rejected setpoint messages, publishers and subscribers.

    Parameters
    ----------
    parameters : Parameters
        Timeout and tolerance.
    topics : sequence of str
        The setpoint topics that are joined.
    answers : Answers
        The setpoints that were answered.
    now : float
        The time.

    """

    name = 'setpoints'

    def __init__(self, parameters: Parameters, topics: Sequence[str], answers: Answers,
                 now: float) -> None:
        super().__init__()
        self._timeout: float = parameters['setpoint.timeout']
        self._tolerance: float = parameters['setpoint.sync_tolerance']
        self._answers = answers
        self.heard = dict.fromkeys(topics, NEVER)
        """When the last message came on each topic."""
        self._writers: dict[str, int] = {}
        self._readers: dict[str, int] = {}
        self._namesakes = '', 1
        self._lines: list[LogLine] = []
        self._trouble: list[str] = []  # unexpected publishers and namesakes
        self._incomplete = Held()
        # Start of the time in which messages complete no setpoint, as seen by reports.
        self._incomplete_since = math.inf
        self._warned_at = NEVER
        # Start times of the last two one-second windows, and the answer counts at their start.
        self._windows = [(now, 0), (now, 0)]

    def found(self, writers: Mapping[str, int], readers: Mapping[str, int], name: str,
              namesakes: int) -> None:
        """
        Note publishers, subscribers and nodes of the same name.

        Parameters
        ----------
        writers : mapping of topic to int
            Number of publishers on setpoint topics; other topics keep their number.
        readers : mapping of topic to int
            Number of subscribers to the topics for controllers.
        name : str
            The node's name.
        namesakes : int
            Number of nodes with this name.

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

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection."""
        incomplete = rejection.reason == NOT_JOINED
        self._count(self._incomplete if incomplete else self.held, rejection, details, now)

    def level(self, now: float) -> int:
        """Return the present level."""
        if self._trouble:
            return ERROR
        if self._answers.stale(now):
            return STALE
        return max(self.held.level(now), self._incomplete.level(now))

    def state(self, now: float) -> Level:
        """Return the present level and its causes."""
        return Level(self.level(now), self._message(now))

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
                or now - self._warned_at < SECONDS or self.held.level(now)):
            return lines
        self._warned_at = now
        return [*lines, LogLine(WARN, f'setpoints: {self._no_setpoint(now)}')]

    def _message(self, now: float) -> str:
        found = list(self._trouble)
        if self._answers.stale(now):
            found.append(self._no_setpoint(now))
        if found:
            return ', '.join(found)
        rejected, incomplete = self.held.at(now), self._incomplete.at(now)
        return rejected.message or incomplete.message or 'answered'

    def _no_setpoint(self, now: float) -> str:
        """Return why there is no setpoint: silence, rejections or stamps."""
        silent = silent_topics(self.heard, self._timeout, now)
        return 'no setpoint: ' + (silent or self.held.at(now).message or (
            'all topics arrive, but none is joined: their stamps differ by more than '
            f'setpoint.sync_tolerance, {self._tolerance:g} s'))
