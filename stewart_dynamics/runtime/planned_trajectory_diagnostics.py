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

"""What the node says of planned motions, a status of its own from the first one on."""

from __future__ import annotations

from collections import Counter

from stewart_dynamics.runtime.diagnostics import ERROR, OK, Status, WARN
from stewart_dynamics.runtime.planned_trajectory_messages import Outcome

_NAME = 'trajectory'


class PlannedDiagnostics:
    """Keeps what has become of the last trajectory, and counts them all."""

    def __init__(self) -> None:
        self._status: Status | None = None
        self._counts: Counter[str] = Counter()

    def done(self, outcome: Outcome, seconds: float) -> Status:
        """Note what has become of a trajectory, and how long that took; return its status."""
        level = ERROR if outcome.reason else WARN if outcome.warning else OK
        counts = self._counts
        counts[f'refused: {outcome.reason}' if outcome.reason else 'answered'] += 1
        self._status = Status(_NAME, level, outcome.message, (
            ('answered', str(counts['answered'])),
            ('refused', str(counts.total() - counts['answered'])),
            *((reason, str(n)) for reason, n in sorted(counts.items()) if reason != 'answered'),
            *outcome.values, ('time it took (s)', f'{seconds:.3f}')))
        return self._status

    def level(self, now: float) -> int:
        """Return the present level."""
        return self._status.level if self._status else OK

    def report(self, now: float) -> tuple[Status, ...]:
        """Return the status, none before the first trajectory."""
        return (self._status,) if self._status else ()
