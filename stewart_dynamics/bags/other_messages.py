# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Messages of other types that contain a pose, and of other axes, as those that are read.

geometry_msgs/PoseWithCovarianceStamped, TransformStamped and Pose, nav_msgs/Odometry and
tf2_msgs/TFMessage become geometry_msgs/PoseStamped, with the stamp and frame of their headers; a
Pose, which has no header, has the time of recording. Covariances and twists are left out. A
leading slash of a frame_id, as ROS 1 has written it, is removed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import (
    aligned8, check_encapsulation, COUNT, MalformedError, nanoseconds, ORDERS, READ_ERRORS,
    sequence, SEVEN, short_sequence, text, TIME_AND_LENGTH)
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import (
    MESSAGE_TYPES, read_message, StampedNumbers, StampedWriter)
from stewart_dynamics.program import AXES
from stewart_dynamics.tables.reading import Reading
from stewart_dynamics.tables.source_axes import axes_matrix, turned

POSE = 'geometry_msgs/msg/Pose'
POSE_WITH_COVARIANCE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
TRANSFORM = 'geometry_msgs/msg/TransformStamped'
ODOMETRY = 'nav_msgs/msg/Odometry'
# Types that are read as geometry_msgs/PoseStamped where they are named or the only ones.
POSE_TYPES = (POSE_WITH_COVARIANCE, TRANSFORM, ODOMETRY, POSE, type_names.TF_MESSAGE)

# Kinds of numbers (see ``turned``) of the types that other axes change.
_TURNED = {
    type_names.POSE_STAMPED: ('vq',), type_names.TWIST_STAMPED: ('va',),
    type_names.ACCEL_STAMPED: ('va',), type_names.WRENCH_STAMPED: ('va',),
    type_names.MULTI_DOF_JOINT_TRAJECTORY: ('vq', 'va', 'va')}

# Types that are a header and numbers.
_HEADED = {*MESSAGE_TYPES} - {type_names.MULTI_DOF_JOINT_TRAJECTORY}
# The first byte of a frame_id behind encapsulation, stamp and length.
_FRAME = 16


class Converter:
    """
    Converts messages of some topics.

    kinds: the type of each topic, by the name under which its messages are given.
    frame: child_frame_id of the platform.
    """

    def __init__(self, kinds: Mapping[str, str], reading: Reading, frame: str) -> None:
        self.child = (reading.child or frame).lstrip('/')
        self._matrix = axes_matrix(reading.axes_of_bag)
        turns = reading.axes_of_bag != AXES
        self.children: set[str] = set()  # child frames of transforms that were seen
        self.found = False  # whether the platform's was among them
        self._headed = [name for name, kind in kinds.items() if kind in _HEADED]
        self._of: dict[str, Callable[[bytes, int], list[bytes]]] = {}
        for name, kind in kinds.items():
            if kind in POSE_TYPES:
                self._of[name] = self._pose_of(kind)
            elif turns and kind in _TURNED:
                self._of[name] = _turning(kind, self._matrix)

    def __call__(self, block: Messages) -> Messages:
        """Return a block with the converted messages; malformed ones are as they were."""
        slashes = self._slashes(block)
        if not (slashes.any() or any(name in self._of for name in block.topics)):
            return block
        numbers, times, messages = [], [], []
        for number, slash, (name, time, data) in zip(
                block.of_topic.tolist(), slashes.tolist(), block.iterate_messages(), strict=True):
            convert = self._of.get(name)
            try:
                data = _without_slash(data) if slash else data
                made = [data] if convert is None else convert(data, time)
            except (MalformedError, *READ_ERRORS):
                made = [b'']  # rejected as malformed
            numbers += [number] * len(made)
            times += [time] * len(made)
            messages += made
        return Messages.from_bytes(block.topics, numbers, times, messages)

    def _slashes(self, block: Messages) -> Flags:
        """Return which messages (M,) have a frame_id that begins with a slash."""
        headed = [n for n, name in enumerate(block.topics) if name in self._headed]
        long: Flags = np.isin(block.of_topic, headed) & (block.sizes > _FRAME)
        long[long] = block.data[block.starts[long] + _FRAME] == ord('/')
        return long

    def _pose_of(self, kind: str) -> Callable[[bytes, int], list[bytes]]:
        def convert(data: bytes, time: int) -> list[bytes]:
            return [self._written(one) for one in self._poses(kind, data, time)]

        return convert

    def _poses(self, kind: str, data: bytes, time: int) -> Iterator[StampedNumbers]:
        if kind == type_names.TF_MESSAGE:
            for child, one in _transforms(data):
                self.children.add(child)
                if child == self.child:
                    self.found = True
                    yield one
        elif kind == POSE:
            check_encapsulation(data)
            yield StampedNumbers(time, b'', SEVEN[data[1]].unpack_from(data, 4), ())
        elif kind == POSE_WITH_COVARIANCE:
            yield read_message(type_names.POSE_STAMPED, data)
        else:
            yield _with_child(data, 4)[1]

    def _written(self, one: StampedNumbers) -> bytes:
        values: Array = turned(np.array(one.values), self._matrix, 'vq')
        frame = one.frame.removeprefix(b'/').decode(errors='replace')
        return _writer(frame).write(one.stamp, values.tolist())


@lru_cache(maxsize=64)
def _writer(frame: str) -> StampedWriter:
    return StampedWriter(frame, 7)


def _without_slash(data: bytes) -> bytes:
    """Return a message of a header and numbers without the first character of its frame_id."""
    size = TIME_AND_LENGTH[data[1]].unpack_from(data, 4)[2]
    text(data, _FRAME, size)
    end = _FRAME + size
    head = data[:12] + COUNT[data[1]].pack(size - 1) + data[_FRAME + 1:end]
    return head + bytes(aligned8(end - 1) - len(head)) + data[aligned8(end):]


def _turning(kind: str, matrix: Array) -> Callable[[bytes, int], list[bytes]]:
    def convert(data: bytes, time: int) -> list[bytes]:
        message, made, first = read_message(kind, data), bytearray(data), 0
        for numbers, (at, count) in zip(_TURNED[kind], message.parts, strict=True):
            part = turned(np.array(message.values[first:first + count]), matrix, numbers)
            made[at:at + 8 * count] = part.astype(f'{ORDERS[data[1]]}f8').tobytes()
            first += count
        return [bytes(made)]

    return convert


def _transforms(data: bytes) -> Iterator[tuple[str, StampedNumbers]]:
    """Yield child frames and transforms of a tf2_msgs/TFMessage."""
    check_encapsulation(data)
    count, at = short_sequence(data, 4, COUNT[data[1]])
    for _ in range(count):
        at = at + 3 & ~3
        child, one, at = *_with_child(data, at), _end_of_transform(data, at)
        yield child, one


def _with_child(data: bytes, at: int) -> tuple[str, StampedNumbers]:
    """Return child frame and pose at a header, which child_frame_id and seven numbers follow."""
    sec, nanosec, size = TIME_AND_LENGTH[data[1]].unpack_from(data, at)
    frame = text(data, at + 12, size)
    length, begin = sequence(data, at + 12 + size, COUNT[data[1]])
    child = text(data, begin, length).decode(errors='replace').lstrip('/')
    values = SEVEN[data[1]].unpack_from(data, aligned8(begin + length))
    return child, StampedNumbers(nanoseconds(data, sec, nanosec), frame, values, ())


def _end_of_transform(data: bytes, at: int) -> int:
    size = TIME_AND_LENGTH[data[1]].unpack_from(data, at)[2]
    length, begin = sequence(data, at + 12 + size, COUNT[data[1]])
    return aligned8(begin + length) + SEVEN[1].size
