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

"""The joined setpoints that wait for their answers, and the order in which they get them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from stewart_dynamics.setpoints.rejections import DROPPED, OUT_OF_RANGE
from stewart_dynamics.setpoints.step import Output, Setpoint, Step

# When more setpoints wait, the node has fallen behind: only the newest is answered.
_BACKLOG = 100


class SetpointQueue:
    """
    Answers setpoints in their order, or the newest where the node has fallen behind.

    Parameters
    ----------
    step : Step
        Computes the answers. It may be replaced at any time: ``step``.
    publish : callable
        Publishes an answer: setpoint, output, when the setpoint came [s].
    on_base : callable
        Returns a setpoint with the base's motion, as far as it is known.
    reject : callable
        Called with reason and details of a setpoint that is not answered.
    take_waiting : callable
        Adds the setpoints that wait in the middleware, with all that belongs to them.
    answered : callable
        Called once all that waited is answered. Returns whether it will call ``answer`` again,
        behind the messages that have come meanwhile; until then setpoints are gathered.

    """

    def __init__(self, step: Step, publish: Callable[[Setpoint, Output, float], None],
                 on_base: Callable[[Setpoint], Setpoint],
                 reject: Callable[[str, str], None], take_waiting: Callable[[], None],
                 answered: Callable[[], bool]) -> None:
        self.step = step
        self.target: tuple[float, ...] | None = None
        """The motion of the last setpoint that was answered."""
        self._publish = publish
        self._on_base = on_base
        self._reject = reject
        self._take_waiting = take_waiting
        self._answered = answered
        self._waiting: deque[tuple[Setpoint, float]] = deque()
        self._last: Output | None = None
        self._restarting = False  # the last one was a restart and could not be answered
        self._busy = False

    def add(self, setpoint: Setpoint, came: float) -> None:
        """Answer a setpoint that came at a time [s], at once or behind those that wait."""
        self._waiting.append((setpoint, came))
        if not self._busy:
            self.answer()

    def answer(self) -> None:
        """
        Answer what waits.

        Until nothing has waited, setpoints are gathered and not answered one by one, however
        late they are.
        """
        self._busy = True
        self._take_waiting()
        if not self._waiting:
            self._busy = False
            return
        if len(self._waiting) > _BACKLOG:
            self._drop_all_but_the_newest()
        while self._waiting:
            self._answer_one(*self._waiting.popleft())
        self._busy = self._answered()

    def _answer_one(self, setpoint: Setpoint, came: float) -> None:
        setpoint = self._on_base(setpoint)
        if self._restarting:
            setpoint = setpoint._replace(restart=True)
        output = self.step(setpoint, None if self._last is None else self._last.singularity)
        if output is None:
            self._restarting = setpoint.restart
            self._reject(OUT_OF_RANGE, f'stamp {setpoint.stamp} ns')
            return
        self._restarting = False
        self._last, self.target = output, setpoint.motion
        self._publish(setpoint, output, came)

    def _drop_all_but_the_newest(self) -> None:
        newest, came = self._waiting.pop()
        for dropped, _ in self._waiting:
            self._reject(DROPPED, f'stamp {dropped.stamp} ns')
        restart = newest.restart or any(dropped.restart for dropped, _ in self._waiting)
        self._waiting.clear()
        self._waiting.append((newest._replace(restart=restart), came))
