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

"""Planned trajectories are worked on one after the other, a piece at each tick of the timer."""

from __future__ import annotations

from collections.abc import Iterator

from stewart_dynamics.compilation.functions import Preparation
from stewart_dynamics.node.tasks import LENGTH, TaskQueue
from stewart_dynamics.planned.messages import PlannedOutcome


class Timed:
    """A queue, its timer, and the outcomes of the trajectories."""

    def __init__(self) -> None:
        self.running = False
        self.pieces: list[str] = []
        self.done: list[tuple[str, float]] = []
        self.queue = TaskQueue(
            self._start, Preparation(),
            lambda outcome, came: self.done.append((outcome.message, came)))

    def _start(self) -> None:
        self.running = True

    def tick(self) -> None:
        """Tick, as the timer does once after each start."""
        self.running = False
        self.queue.tick()

    def work(self, name: str, pieces: int = 2) -> Iterator[PlannedOutcome | None]:
        """Yield None after each piece, and the outcome at the end."""
        for _ in range(pieces):
            self.pieces.append(name)
            yield None
        yield PlannedOutcome(name)


def test_each_tick_is_one_piece_and_the_timer_runs_while_there_is_work() -> None:
    timed = Timed()
    assert not timed.running
    timed.queue.add(timed.work('first'), 1.0)
    timed.queue.add(timed.work('second', pieces=1), 2.0)
    for pieces, done in ((['first'], []), (['first'] * 2, []),
                         (['first'] * 2, [('first', 1.0)]),
                         (['first', 'first', 'second'], [('first', 1.0)])):
        assert timed.running
        timed.tick()
        assert timed.pieces == pieces
        assert timed.done == done
    timed.tick()
    assert timed.done == [('first', 1.0), ('second', 2.0)]
    assert not timed.running


def test_it_is_full_with_those_in_work_and_waiting() -> None:
    timed = Timed()
    for n in range(LENGTH):
        assert not timed.queue.full
        timed.queue.add(timed.work(str(n), pieces=0), 0.0)
    assert timed.queue.full
    timed.tick()
    assert not timed.queue.full


def test_dropped_trajectories_are_counted_and_not_continued() -> None:
    timed = Timed()
    assert timed.queue.drop() == 0
    for name in ('first', 'second'):
        timed.queue.add(timed.work(name), 0.0)
    timed.tick()
    assert timed.queue.drop() == 2
    timed.tick()  # the timer may be due already
    assert timed.pieces == ['first']
    assert not timed.done
    assert not timed.running
