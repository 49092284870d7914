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

"""The planned trajectories that wait to be checked, and the one that is being checked."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from stewart_dynamics.compilation.functions import Preparation
from stewart_dynamics.planned.messages import Outcome

# So many are in work or wait.
LENGTH = 5

# Between two pieces of the work [s]. While other programs need the processor as well, the
# operating system would suspend a node that computes all the time, and its setpoints would wait.
PAUSE = 0.001


class PlannedTrajectoryQueue:
    """
    Does the work on planned trajectories in pieces, one at each tick of a timer.

    Parameters
    ----------
    start : callable
        Starts the timer; it ticks once after each start.
    code : Preparation
        Of what the work calls; it waits until that is ready.
    done : callable
        Gets an outcome, and when the trajectory came [s].

    """

    def __init__(self, start: Callable[[], None], code: Preparation,
                 done: Callable[[Outcome, float], None]) -> None:
        self._start = start
        self._code = code
        self._done = done
        self._waiting: deque[tuple[Iterator[Outcome | None], float]] = deque()

    @property
    def full(self) -> bool:
        """Whether no more can wait."""
        return len(self._waiting) >= LENGTH

    def add(self, work: Iterator[Outcome | None], came: float) -> None:
        """Add the work on a trajectory that came at a time [s]."""
        self._code.begin()
        self._waiting.append((work, came))
        self._start()

    def tick(self) -> None:
        """Do one piece of the work on the first one."""
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
        """Drop all of them and return how many there were."""
        number = len(self._waiting)
        self._waiting.clear()
        return number
