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

"""The status ``timing``: processing times, and setpoints dropped for lack of time."""

from __future__ import annotations

from collections import Counter
from statistics import median

from stewart_dynamics.node.diagnostics.periodic_report import (
    Level, Part, Status)
from stewart_dynamics.node.diagnostics.setpoints import Answers
from stewart_dynamics.setpoints.rejections import DROPPED, NOT_JOINED, Rejection

_COUNTED = {DROPPED: 'dropped', NOT_JOINED: 'incomplete'}


class TimingDiagnostics(Part):
    """
    Notes processing times and dropped setpoints.

    Parameters
    ----------
    answers : Answers
        The setpoints that were answered.
    now : float
        The time.

    """

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

    def rejected(self, rejection: Rejection, details: str, now: float) -> None:
        """Note a rejection; only dropped setpoints count here."""
        if rejection.reason in _COUNTED:
            self._counts[rejection.reason] += 1
        if rejection.reason == DROPPED:
            super().rejected(rejection, details, now)

    def status(self, now: float) -> Status | None:
        """Return the status; while setpoints are missing, with the age of the last one."""
        status = super().status(now)
        return status and status._replace(message=status.message + self._answers.age(now))

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
        state = self.held.at(now)
        return Level(state.level, state.message or (
            'on time' if self._answers.number else 'no setpoint yet'))
