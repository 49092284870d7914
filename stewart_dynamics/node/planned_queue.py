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

"""Queue of planned trajectories: the one being checked and those that wait."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from stewart_dynamics.compilation.functions import Preparation
from stewart_dynamics.planned.messages import PlannedOutcome

# Maximum number of trajectories in work or waiting.
LENGTH = 5

# Pause between two pieces of the work [s]. While other programs need the processor as well, the
# operating system would suspend a node that computes all the time, and delay its setpoints.
PAUSE = 0.001


class PlannedTrajectoryQueue:
    """
    Checks planned trajectories in pieces, one at each tick of a timer.

    Parameters
    ----------
    start : callable
        Starts the timer; it ticks once after each start.
    code : Preparation
        Compilation of the functions that the check calls; the check waits until it is ready.
    done : callable
        Called with an outcome and the time of arrival of the trajectory [s].

    """

    def __init__(self, start: Callable[[], None], code: Preparation,
                 done: Callable[[PlannedOutcome, float], None]) -> None:
        self._start = start
        self._code = code
        self._done = done
        self._waiting: deque[tuple[Iterator[PlannedOutcome | None], float]] = deque()

    @property
    def full(self) -> bool:
        """Whether the queue is full."""
        return len(self._waiting) >= LENGTH

    def add(self, work: Iterator[PlannedOutcome | None], came: float) -> None:
        """Add the check of a trajectory that arrived at a time [s]."""
        self._code.begin()
        self._waiting.append((work, came))
        self._start()

    def tick(self) -> None:
        """Do one piece of the work on the first trajectory."""
        if not self._waiting:  # dropped
            return
        if not self._code.ready:
            self._start()
            return
        work, came = self._waiting[0]
        outcome = next(work)
        if outcome is not None:
            self._waiting.popleft()
            self._done(outcome, came)
        if self._waiting:
            self._start()

    def drop(self) -> int:
        """Drop all trajectories and return their number."""
        number = len(self._waiting)
        self._waiting.clear()
        return number
