# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A timer that is started again at each call, in an executor that falls behind."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
import time

import pytest

pytest.importorskip('rclpy')

from rclpy.clock import Clock, ClockType  # noqa: E402
from rclpy.experimental.events_executor import EventsExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.task import Future  # noqa: E402
from running import DEADLINE, Peer  # noqa: E402

from stewart_dynamics.ros.rclpy_workarounds import OneShotTimer  # noqa: E402

PAUSE = 0.001


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    with closing(Peer(domain)) as peer:
        yield peer.node


def spin(node: Node, done: Future) -> None:
    """Let an executor spin until a future is done."""
    executor = EventsExecutor(context=node.context)
    executor.add_node(node)
    executor.spin_until_future_complete(done, DEADLINE)
    executor.shutdown()
    assert done.done()


def test_a_timer_that_starts_itself_again_is_late_and_never_early(node: Node) -> None:
    done = Future()
    pauses: list[float] = []
    started = time.monotonic()

    def call() -> None:
        nonlocal started
        pauses.append(time.monotonic() - started)
        if len(pauses) == 100:
            done.set_result(None)
            return
        started = time.monotonic()
        for _ in range(20):
            timer.start()
        while len(pauses) % 2 and time.monotonic() < started + 3 * PAUSE:
            pass  # the executor falls behind

    timer = OneShotTimer(node, PAUSE, call)
    begun = time.monotonic()
    ticks: list[float] = []
    beside = node.create_timer(10 * PAUSE, lambda: ticks.append(time.monotonic() - begun),
                               clock=Clock(clock_type=ClockType.STEADY_TIME))
    timer.start()
    spin(node, done)
    assert len(pauses) == 100
    assert min(pauses) >= PAUSE
    # The timer beside it has its own times.
    assert beside.time_until_next_call() <= 10 * PAUSE * 1e9
    assert 0 < len(ticks) <= max(ticks) / (10 * PAUSE) + 1


def test_a_stopped_timer_does_not_call(node: Node) -> None:
    done = Future()
    calls: list[str] = []
    stopped = OneShotTimer(node, PAUSE, lambda: calls.append('stopped'))
    later = OneShotTimer(node, 20 * PAUSE, lambda: done.set_result(calls.append('later')))
    stopped.start()
    later.start()
    stopped.stop()
    spin(node, done)
    assert calls == ['later']
