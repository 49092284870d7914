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

"""The status ``planned trajectory``: there is one from the first planned trajectory on."""

from __future__ import annotations

from collections import Counter

from stewart_dynamics.node.diagnostics.periodic_report import (
    ERROR, LastOutcome, Level, LogLine, OK, Status, WARN)
from stewart_dynamics.planned.messages import Outcome

_LONG = 2.0  # [s]


class PlannedTrajectoryDiagnostics(LastOutcome):
    """Keeps the outcome of the last planned trajectory, and counts them all."""

    def __init__(self) -> None:
        super().__init__('planned trajectory')
        self._counts: Counter[str] = Counter()

    def done(self, outcome: Outcome, seconds: float) -> None:
        """Note an outcome, and how long it took from the message on [s]."""
        level = ERROR if outcome.reason else WARN if outcome.warning else OK
        counts = self._counts
        counts[f'rejected: {outcome.reason}' if outcome.reason else 'accepted'] += 1
        self._status = Status(self._name, level, outcome.message, (
            ('accepted', str(counts['accepted'])),
            ('rejected', str(counts.total() - counts['accepted'])),
            *((reason, str(n)) for reason, n in sorted(counts.items()) if reason != 'accepted'),
            *outcome.values, ('time it took (s)', f'{seconds:.3f}')))
        message = outcome.message + (f' (took {seconds:.1f} s)' if seconds > _LONG else '')
        lines = self._log.lines(Level(level, message))
        if outcome.reason:  # each, whatever came before
            lines = [LogLine(ERROR, f'{self._name} {message}', outcome.reason)]
        elif seconds > _LONG:
            lines = [LogLine(level, f'{self._name}: {message}')]
        self._lines += lines
