# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Planned trajectories: trajectory_msgs/MultiDOFJointTrajectory in, JointTrajectory out.

Points are read and written as records, thousands at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, SECOND, Stamps
from stewart_dynamics.messages.cdr import (
    COUNT, header, LITTLE_ENDIAN, MalformedError, nanoseconds, ORDERS, put_count, put_text,
    READ_ERRORS, sequence, text, TIME_AND_LENGTH, unreadable)

# A point of a MultiDOFJointTrajectory of one joint or two, and one of a JointTrajectory of six
# without accelerations. All begin at a multiple of eight bytes but the first, which may begin
# four bytes behind one: then only its first count stands there, all else where it would in the
# others.
_PARTS = ('transforms', 'velocities', 'accelerations')


def _counts(joints: int) -> tuple[int, int, int]:
    """Return where in a point of some joints the counts of its parts stand."""
    return 0, 8 + 56 * joints, 16 + 104 * joints


_PLATFORM_POINT = {(order, joints): np.dtype({
    'names': [*_PARTS, 'pose', 'twist', 'accel', 'sec', 'nanosec'],
    'formats': [*[f'{sign}u4'] * 3, *((f'{sign}f8', (joints, many)) for many in (7, 6, 6)),
                f'{sign}i4', f'{sign}u4'],
    'offsets': [*_counts(joints), *(at + 8 for at in _counts(joints)), 24 + 152 * joints,
                28 + 152 * joints], 'itemsize': 32 + 152 * joints})
    for order, sign in ORDERS.items() for joints in (1, 2)}
_LEG_POINT = {effort: np.dtype({
    'names': ['positions', 'velocities', 'accelerations', 'efforts', 'position', 'velocity',
              'effort', 'sec', 'nanosec'],
    'formats': ['<u4', '<u4', '<u4', '<u4', '<6f8', '<6f8', f'<{6 * effort}f8', '<i4', '<u4'],
    'offsets': [0, 56, 112, 116, 8, 64, 120, end, end + 4], 'itemsize': end + 8})
    for effort, end in ((True, 168), (False, 120))}


class PlatformTrajectory:
    """
    Reads a trajectory_msgs/MultiDOFJointTrajectory of one or two joints and any number of points.

    Raises MalformedError where it has no header, or more than two joints.
    """

    def __init__(self, data: bytes) -> None:
        try:
            order = data[1]
            sec, nanosec, size = TIME_AND_LENGTH[order].unpack_from(data, 4)
            count = COUNT[order]
            joints, at = sequence(data, 16 + size, count)
            if joints > 2:
                raise MalformedError(f'{joints} joint_names: must be at most 2')
            self.names = []
            for _ in range(joints):
                length, at = sequence(data, at, count)
                self.names.append(text(data, at, length))
                at += length
            self.size, self._first = sequence(data, at, count)
        except READ_ERRORS as exc:
            raise unreadable(data) from exc
        self.stamp = nanoseconds(data, sec, nanosec)
        self.frame = text(data, 16, size)
        self._data = data
        self._begin = (self._first - 4 & ~7) + 4
        self.joints = max(len(self.names), 1)
        self._kind = kind = _PLATFORM_POINT[order, self.joints]
        whole = max(0, (len(data) - self._begin) // kind.itemsize)
        self._records: NDArray[np.void] = np.frombuffer(
            data, kind, min(whole, self.size), self._begin) if whole else np.empty(0, kind)

    def points(self, first: int, end: int) -> NDArray[np.void]:
        """
        Return points by their index.

        Their fields are pose (joints, 7), twist and accel (joints, 6), sec and nanosec. Those
        before them must have been read. Raises MalformedError where one has not one transform,
        velocity and acceleration for each joint: what follows it cannot be found.
        """
        records = self._records[first:end]
        other = np.logical_or.reduce([records[part] != self.joints for part in _PARTS])
        other[:first == 0] = True  # its first count may stand elsewhere
        for n in np.flatnonzero(other).tolist():
            self._check_counts(first + n)
        if end > len(self._records):
            self._check_counts(len(self._records))
            raise MalformedError(
                f'{len(self._data)} bytes: points[{len(self._records)}] is cut short')
        return records

    def _check_counts(self, n: int) -> None:
        begin = self._begin + n * self._kind.itemsize
        for part, offset in zip(_PARTS, _counts(self.joints), strict=True):
            at = begin + offset if n or offset else self._first
            if at + 4 <= len(self._data):
                number, = COUNT[self._data[1]].unpack_from(self._data, at)
                if number != self.joints:
                    has = 'one' if self.joints == 1 else 'one for each joint'
                    raise MalformedError(f'points[{n}]: {number} {part}: each point has {has}')


class LegTrajectory:
    """
    Writes a trajectory_msgs/JointTrajectory of six joints without accelerations.

    stamp: [ns]
    names: names of the joints; frame_id is empty.
    size: number of points.
    effort: points have effort.
    """

    def __init__(self, stamp: int, names: Sequence[str], size: int, effort: bool) -> None:
        head = header(stamp)
        put_count(head, len(names))
        for name in names:
            put_text(head, name)
        put_count(head, size)
        self._effort = effort
        self._records = np.zeros(size, _LEG_POINT[effort])
        self._head = LITTLE_ENDIAN + head
        self._shared = len(head) % 8  # bytes of the head where the first record begins
        for name in ('positions', 'velocities', 'efforts')[:2 + effort]:
            self._records[name] = 6
        if self._shared:
            self._records[:1].view('<u4')[:2] = size, 6

    def put(self, first: int, times: Stamps, positions: Array, velocities: Array,
            efforts: Array) -> None:
        """Write points from an index on, with their time_from_start [ns]."""
        records = self._records[first:first + len(times)]
        records['position'], records['velocity'] = positions, velocities
        if self._effort:
            records['effort'] = efforts
        records['sec'], records['nanosec'] = np.divmod(times, SECOND)

    def message(self) -> bytes:
        """Return the message."""
        head = self._head[:len(self._head) - self._shared]
        return b''.join([head, self._records.view(np.uint8).data])
