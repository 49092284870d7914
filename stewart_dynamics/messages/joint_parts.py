# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Joins joint states that arrive in parts, as from drives that publish one joint each.

The stamps of one joint, the first that arrives, are those of the samples. Each of the others is
interpolated linearly between its neighbors in time; where stamps are equal it is as it was sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from stewart_dynamics.arrays import NANOSECOND, SECOND
from stewart_dynamics.messages.stamp_order import NO_STAMP, Order, order_of

GAP = SECOND // 10
"""Default of the longest time between two samples of a joint [ns]."""

_KEPT = 10_000  # samples of a joint, where those of another one never come

Sample = tuple[int, tuple[Any, ...]]
"""Stamp [ns], and the values of all joints in one field, then in the next."""


class Joined(NamedTuple):
    """Samples that a part completes, and those that were given up."""

    samples: list[Sample]
    lacking: list[str]
    """For each sample that was given up, the joints that it lacks, and since when."""


class JointParts:
    """
    The parts of some joints.

    joints: names, in the order wanted.
    fields: number of values of each.
    gap: longest time between two samples of a joint, and to wait for one [ns].
    """

    def __init__(self, joints: Sequence[str], fields: int, gap: int = GAP) -> None:
        self._joints, self._fields, self._gap = joints, fields, gap
        self._clear()

    def _clear(self) -> None:
        # The samples of each joint from the last one on that is not newer than all joined ones.
        self._series: list[deque[Sample]] = [deque(maxlen=_KEPT) for _ in self._joints]
        self._leader = -1  # the joint whose stamps are those of the samples
        self._due: deque[int] = deque(maxlen=_KEPT)  # its stamps that are not joined yet

    def join_part(self, stamp: int, joints: Sequence[int], values: Sequence[float]) -> Joined:
        """
        Return what a message completes.

        joints (n,): places of its joints.
        values (n fields): of all of its joints in one field, then in the next.
        """
        last = max((self._series[joint][-1][0] for joint in joints if self._series[joint]),
                   default=None)
        order = order_of(stamp, last, self._gap)
        if order is Order.RESTART or (order is not Order.FRESH and stamp == NO_STAMP):
            self._clear()  # without stamps, the first one was repeated
        elif not order.used:
            return Joined([], [])
        count = len(joints)
        for n, joint in enumerate(joints):
            self._series[joint].append((stamp, tuple(values[n::count])))
        leader = self._series[self._leader] if self._leader >= 0 else None
        if not leader or stamp - leader[-1][0] > self._gap:
            self._leader = joints[0]
            self._due.clear()
        if self._leader in joints:
            self._due.append(stamp)
        return self._complete_samples(stamp)

    def _complete_samples(self, newest: int) -> Joined:
        found = Joined([], [])
        while self._due:
            at = self._due[0]
            waiting = [name for name, series in zip(self._joints, self._series, strict=True)
                       if not series or series[-1][0] < at]
            if waiting and newest - at <= self._gap:
                break
            self._due.popleft()
            for series in self._series:
                while len(series) > 1 and series[1][0] <= at:
                    series.popleft()
            values = None if waiting else self._values_at(at)
            if values is not None:
                found.samples.append((at, values))
            elif waiting:
                found.lacking.append(f'{", ".join(waiting)} for {self._gap * NANOSECOND:g} s')
        return found

    def _values_at(self, stamp: int) -> tuple[float, ...] | None:
        """Return the values at a stamp; None before the first sample of a joint, or in a gap."""
        of_joints = []
        for series in self._series:
            before, values = series[0]
            if before > stamp:
                return None
            if before < stamp:
                after, later = series[1]
                if after - before > self._gap:
                    return None
                part = (stamp - before) / (after - before)
                values = tuple(a + part * (b - a) for a, b in zip(values, later, strict=True))
            of_joints.append(values)
        return tuple(values[n] for n in range(self._fields) for values in of_joints)
