# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Work in pieces between setpoints: checks of planned trajectories, identification of the payload.

The service identifies mass, center of mass and inertia of platform and payload.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
import time
from typing import Any, Generic, TypeVar

from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from stewart_dynamics.external_wrench.payload import Payload, PayloadOutcome
from stewart_dynamics.ros.rclpy_workarounds import create_later_service, OneShotTimer

Outcome = TypeVar('Outcome')

# Maximum number of trajectories in work or waiting.
LENGTH = 5

# Pause between two pieces of the work [s]. While other programs need the processor as well, the
# operating system would suspend a node that computes all the time, and delay its setpoints.
PAUSE = 0.001


class TaskQueue(Generic[Outcome]):
    """
    Works on tasks in order and in pieces, one at each tick of a timer.

    timer: makes the timer, which calls back once after each start.
    done: called with an outcome and the time of arrival of its task [s].
    """

    def __init__(self, timer: Callable[[Callable[[], None]], OneShotTimer],
                 done: Callable[[Outcome, float], None]) -> None:
        self._timer = timer(self._on_timer)
        self._done = done
        self._waiting: deque[tuple[Iterator[Outcome | None], float]] = deque()

    @property
    def full(self) -> bool:
        """Whether the queue is full."""
        return len(self._waiting) >= LENGTH

    @property
    def empty(self) -> bool:
        """Whether there is no task."""
        return not self._waiting

    def add(self, work: Iterator[Outcome | None], came: float) -> None:
        """Add a task that arrived at a time [s]."""
        self._waiting.append((work, came))
        self._timer.start()

    def _on_timer(self) -> None:
        """Do one piece of the first task."""
        work, came = self._waiting[0]
        outcome = next(work)
        if outcome is not None:
            self._waiting.popleft()
            self._done(outcome, came)
        if self._waiting:
            self._timer.start()

    def drop(self) -> int:
        """Drop all tasks and return their number."""
        self._timer.stop()
        number = len(self._waiting)
        self._waiting.clear()
        return number


IDENTIFY_PAYLOAD, APPLY_PAYLOAD = 'identify_payload', 'apply_payload'

# Pause between two pieces of the work [s]: they take less than a tenth of the time, 1 s in all.
_PAUSE = 0.004


class PayloadService:
    """
    Processes requests in pieces, one at each tick of a timer; one task at a time.

    The service exists in all states of the node's lifecycle.

    work: called at a request while no task is in progress: returns the task, or its outcome.
    done: called with an outcome and the duration of the task [s].
    """

    def __init__(
            self, node: Node,
            work: Callable[[], Iterator[PayloadOutcome | None] | PayloadOutcome],
            done: Callable[[PayloadOutcome, float], None]) -> None:
        self._begin, self._done = work, done
        self._tasks: TaskQueue[PayloadOutcome] = TaskQueue(
            partial(OneShotTimer, node, _PAUSE), self._end)
        self._waiting: list[Callable[[Any], None]] = []
        # Never destroyed before the node: a waiting request would get no answer.
        create_later_service(node, Trigger, f'~/{IDENTIFY_PAYLOAD}', self._on_request)

    def drop(self, reason: str) -> None:
        """End the task in progress, if any, without result."""
        self._tasks.drop()
        self._answer(PayloadOutcome(reason))

    def _on_request(self, answer: Callable[[Any], None]) -> None:
        self._waiting.append(answer)
        if not self._tasks.empty:
            return
        now = time.monotonic()
        work = self._begin()
        if isinstance(work, PayloadOutcome):
            self._end(work, now)
        else:
            self._tasks.add(work, now)

    def _end(self, outcome: PayloadOutcome, came: float) -> None:
        self._done(outcome, time.monotonic() - came)
        self._answer(outcome)

    def _answer(self, outcome: PayloadOutcome) -> None:
        waiting, self._waiting = self._waiting, []
        for answer in waiting:
            answer(Trigger.Response(
                success=outcome.payload is not None, message=outcome.message))


def inertia_message(payload: Payload, frame: str) -> InertiaStamped:
    """Return a payload as a message; the inertia is about the center of mass, as in a URDF."""
    mass, center, inertia = payload.fitted.body
    x, y, z = center.tolist()
    ixx, ixy, ixz, iyy, iyz, izz = inertia.tolist()
    return InertiaStamped(
        header=Header(stamp=Time(nanoseconds=payload.stamp).to_msg(), frame_id=frame),
        inertia=Inertia(m=mass, com=Vector3(x=x, y=y, z=z),
                        ixx=ixx, ixy=ixy, ixz=ixz, iyy=iyy, iyz=iyz, izz=izz))
