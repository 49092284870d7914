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

"""The order in which setpoints that wait are answered, dropped, and begin anew."""

from __future__ import annotations

from referees import symmetric_parameters
from stewart_dynamics.node.setpoint_queue import SetpointQueue
from stewart_dynamics.setpoints.rejections import DROPPED, OUT_OF_RANGE
from stewart_dynamics.setpoints.step import Output, Setpoint, Step
from test_step import HOME

STEP = Step(symmetric_parameters())
# Its results overflow.
TOO_LARGE = HOME._replace(motion=(1e200, *HOME.motion[1:]))
BACKLOG = 100


class Fed:
    """A queue, what it published and rejected, and what the middleware holds for it."""

    def __init__(self) -> None:
        self.published: list[tuple[int, float]] = []  # stamp, and when it came
        self.restarts: list[int] = []
        self.rejected: list[tuple[str, str]] = []
        self.held: list[Setpoint] = []
        self.rounds = 0
        self.gathers = True
        self.queue = SetpointQueue(
            STEP, self._publish, self._on_base, lambda *why: self.rejected.append(why),
            self._take, self._answered)

    def _publish(self, setpoint: Setpoint, output: Output, came: float) -> None:
        assert output == STEP(setpoint, None)._replace(  # type: ignore[union-attr]
            warning_changed=output.warning_changed)
        self.published.append((setpoint.stamp, came))
        if setpoint.restart:
            self.restarts.append(setpoint.stamp)

    def _on_base(self, setpoint: Setpoint) -> Setpoint:
        return setpoint

    def _take(self) -> None:
        held, self.held = self.held, []
        for setpoint in held:
            self.queue.add(setpoint, 0.5)

    def _answered(self) -> bool:
        self.rounds += 1
        return self.gathers

    def add(self, *stamps: int, setpoint: Setpoint = HOME) -> None:
        """Let setpoints come."""
        for stamp in stamps:
            self.queue.add(setpoint._replace(stamp=stamp), float(stamp))


def test_a_setpoint_is_answered_at_once() -> None:
    fed = Fed()
    assert fed.queue.target is None
    fed.add(1)
    assert fed.published == [(1, 1.0)]
    assert fed.queue.target == HOME.motion
    assert fed.rounds == 1


def test_until_nothing_has_waited_setpoints_are_gathered() -> None:
    fed = Fed()
    fed.add(1, 2, 3)
    assert fed.published == [(1, 1.0)]
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published] == [1, 2, 3]
    assert fed.rounds == 2
    fed.queue.answer()
    assert fed.rounds == 2, 'nothing waited'
    fed.add(4)
    assert [stamp for stamp, _ in fed.published] == [1, 2, 3, 4]


def test_where_nothing_waits_each_setpoint_is_answered_at_once() -> None:
    fed = Fed()
    fed.gathers = False
    fed.add(1, 2)
    assert fed.published == [(1, 1.0), (2, 2.0)]
    fed.gathers = True
    fed.add(3, 4)
    assert [stamp for stamp, _ in fed.published] == [1, 2, 3]
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published] == [1, 2, 3, 4]


def test_what_the_middleware_holds_is_answered_behind_what_waits() -> None:
    fed = Fed()
    fed.held = [HOME._replace(stamp=stamp) for stamp in (2, 3)]
    fed.add(1)
    assert fed.published == [(1, 1.0), (2, 0.5), (3, 0.5)]
    assert fed.rounds == 1


def test_of_more_than_the_backlog_the_newest_is_answered_and_the_others_are_dropped() -> None:
    fed = Fed()
    fed.add(0, *range(1, BACKLOG + 1))
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published] == list(range(BACKLOG + 1))
    assert not fed.rejected
    fed.add(*range(200, 201 + BACKLOG))
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published][BACKLOG + 1:] == [200 + BACKLOG]
    assert fed.rejected == [(DROPPED, f'stamp {stamp} ns') for stamp in range(200, 200 + BACKLOG)]


def test_a_restart_that_is_dropped_or_cannot_be_answered_holds_for_the_next() -> None:
    fed = Fed()
    fed.add(0, setpoint=HOME)
    fed.add(1, setpoint=HOME._replace(restart=True))
    fed.add(*range(2, 2 + BACKLOG))
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published] == [0, 1 + BACKLOG]
    assert fed.restarts == [1 + BACKLOG]
    fed = Fed()
    fed.add(1, setpoint=TOO_LARGE._replace(restart=True))
    assert fed.rejected == [(OUT_OF_RANGE, 'stamp 1 ns')]
    assert not fed.published
    fed.add(2, 3)
    fed.queue.answer()
    assert [stamp for stamp, _ in fed.published] == [2, 3]
    assert fed.restarts == [2]
    assert fed.queue.target == HOME.motion


def test_another_step_answers_from_the_next_setpoint_on() -> None:
    fed = Fed()
    fed.add(1)
    fed.queue.step = lambda setpoint, before: None  # type: ignore[assignment]
    fed.queue.answer()
    fed.add(2)
    assert fed.rejected == [(OUT_OF_RANGE, 'stamp 2 ns')]
