# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Converts messages of an input topic to checked samples, one message at a time or in batches.

A sample is a stamp and the message's numbers, with the quaternion of a pose replaced by the
rotation matrix. Node and replay apply the same checks and get bit-identical samples.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from struct import Struct
import sys
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Bytes, Integers, NO_WRENCH, Six, Stamps
from stewart_dynamics.core.binding import CODES, function, record, Sample
from stewart_dynamics.mechanics.frames.rotation import quaternion_length
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError, Stamped
from stewart_dynamics.messages.layout import Layout
from stewart_dynamics.messages.setpoint import combined, imu, layout_of, pose, twist
from stewart_dynamics.parameters import table
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.tolerances import unit_rule
from stewart_dynamics.setpoints.rejections import (
    frame_details, MALFORMED, NOT_FINITE, NOT_MEASURED, NOT_UNIT, OUT_OF_RANGE,
    Rejections, WRONG_FRAME)

# Topics, relative to the node's name.
POSE = 'setpoint/pose'
TWIST = 'setpoint/twist'
ACCEL = 'setpoint/accel'
COMBINED = 'setpoint/combined'
BASE_POSE = 'base/pose'
BASE_TWIST = 'base/twist'
BASE_ACCEL = 'base/accel'
BASE_IMU = 'base/imu'
WRENCH = 'wrench'
VEHICLE = 'vehicle'

INPUT_TYPES = {
    POSE: type_names.POSE_STAMPED,
    TWIST: type_names.TWIST_STAMPED,
    ACCEL: type_names.ACCEL_STAMPED,
    COMBINED: type_names.MULTI_DOF_JOINT_TRAJECTORY,
    BASE_POSE: type_names.POSE_STAMPED,
    BASE_TWIST: type_names.TWIST_STAMPED,
    BASE_ACCEL: type_names.ACCEL_STAMPED,
    BASE_IMU: type_names.IMU,
    WRENCH: type_names.WRENCH_STAMPED,
    VEHICLE: type_names.IMU,
}

# Topics that are joined, for each value of setpoint.source.
SOURCES = {
    table.SEPARATE: (POSE, TWIST, ACCEL), table.COMBINED: (COMBINED,), table.POSES_ALONE: (POSE,)}
# Topics that are joined, for each value of base.source.
BASE_SOURCES = {
    table.FIXED: (), table.AT_REST: (BASE_POSE,),
    table.MOVING: (BASE_POSE, BASE_TWIST, BASE_ACCEL), table.BY_IMU: (BASE_IMU,)}

_READERS: dict[str, Callable[[bytes], Stamped]] = {
    POSE: pose, TWIST: twist, ACCEL: twist, COMBINED: combined, WRENCH: twist,
    BASE_POSE: pose, BASE_TWIST: twist, BASE_ACCEL: twist, BASE_IMU: imu,
    VEHICLE: imu}
_IMUS = BASE_IMU, VEHICLE
_WITH_POSE = POSE, COMBINED, BASE_POSE
_BOUNDED = BASE_POSE, BASE_TWIST, BASE_ACCEL, *_IMUS

# Indices of an IMU's angular velocity, specific force, and the first entries of their
# covariances, which are -1 if a quantity is not measured. Its orientation is not used.
_OF_IMU = (13, 14, 15, 25, 26, 27)
_COVARIANCES = {16: 'angular_velocity_covariance', 28: 'linear_acceleration_covariance'}
# Bound on numbers of the base's motion [SI units]: larger ones would disturb filters for long.
LARGEST = 1e9


class TopicSamples(NamedTuple):
    """New samples of a topic, N of them."""

    stamps: Stamps  # (N,) [ns]
    values: Array  # (N, ...)
    places: Integers  # (N,): index of each message in the order of all messages


class SampleReader:
    """
    Reads the messages of one topic.

    Messages with the layout of the first valid one are read by that layout, which is faster.

    topic: one of ``input_topics``.
    frame: required frame_id; an empty one is accepted. None: the first non-empty one is required.
    """

    def __init__(self, topic: str, frame: str | None, rejections: Rejections) -> None:
        self._topic = topic
        self._reader = _READERS[topic]
        self._has_pose, self._bounded = topic in _WITH_POSE, topic in _BOUNDED
        self._frame = None if frame is None else frame.encode()
        self._rejections = rejections
        self._turned = Sample('one_rotation', 'quaternion', 'rotation')
        self._turn = function('stewart_rotation').bound(
            self._turned['quaternion'], self._turned['rotation'])
        self._regular: _RegularMessages | None = None
        self._frame_of_layout = b''

    def read(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return a message's stamp [ns] and values, or reject it."""
        if self._regular is not None and (sample := self._regular.read(data)) is not None:
            return sample
        try:
            stamp, frame, values = self._reader(data)
        except MalformedError as exc:
            self._rejections.reject(self._topic, MALFORMED, str(exc))
            return None
        if self._is_other(frame):
            self._rejections.reject(
                self._topic, WRONG_FRAME, frame_details(frame, self._frame or b''))
            return None
        if self._topic in _IMUS:
            for at, name in _COVARIANCES.items():
                if values[at] == -1.0:
                    self._rejections.reject(self._topic, NOT_MEASURED, f'{name}[0] is -1')
                    return None
            values = tuple([values[at] for at in _OF_IMU])
        if not all(map(math.isfinite, values)):
            self._rejections.reject(self._topic, NOT_FINITE, str(values))
            return None
        if self._bounded and max(map(abs, values)) > LARGEST:
            self._rejections.reject(
                self._topic, OUT_OF_RANGE, f'{values}: must be at most {LARGEST:g}')
            return None
        if self._has_pose:
            self._turned.write(*values[3:7])
            if self._turn() != CODES['STEWART_OK']:
                self._rejections.reject(
                    self._topic, NOT_UNIT, unit_rule(quaternion_length(*values[3:7])))
                return None
            values = values[:3] + self._turned.read() + values[7:]
        if self._regular is None:
            self._learn(data, frame)
        self._keep_frame(frame)
        return stamp, values

    def read_many(self, data: Bytes, starts: Integers, sizes: Integers,
                  ) -> tuple[Stamps, Array] | None:
        """
        Return stamps (N,) [ns] and values (N, ...) of messages that are all valid.

        None if one is invalid or has another layout: then read them one by one.

        data (M,): bytes that contain all messages.
        starts, sizes (N,): offset and length of each message in bytes; N >= 1.
        """
        if self._regular is None:
            first = data[starts[0]:starts[0] + sizes[0]].tobytes()
            try:
                frame = self._reader(first).frame
            except MalformedError:
                return None
            if self._is_other(frame):
                return None
            self._learn(first, frame)
        assert self._regular is not None
        samples = self._regular.read_many(data, starts, sizes)
        if samples is not None:
            self._keep_frame(self._frame_of_layout)
        return samples

    def forget_layout(self) -> None:
        """Learn the layout again, from the next valid message."""
        self._regular = None

    def _learn(self, data: bytes, frame: bytes) -> None:
        self._regular, self._frame_of_layout = _RegularMessages(
            layout_of(self._reader, data), self._topic), frame

    def _keep_frame(self, frame: bytes) -> None:
        """Require the frame of this valid message from now on, if no frame was specified."""
        if self._frame is None:
            self._frame = frame or None

    def _is_other(self, frame: bytes) -> bool:
        """Return whether a message has a wrong frame."""
        return bool(frame) and self._frame is not None and frame != self._frame


class _RegularMessages:
    """
    Reads valid messages of one layout, a tenth of the time of reading them field by field.

    A single message is copied to memory that stays, and so is its sample.
    """

    def __init__(self, layout: Layout, topic: str) -> None:
        (at, count), *others = layout.numbers
        quaternion, measured = -1, []
        if topic in _IMUS:
            width, parts = 6, [(at + 8 * _OF_IMU[0], 0, 3), (at + 8 * _OF_IMU[3], 3, 3)]
            measured = [at + 8 * place for place in _COVARIANCES]
        elif topic in _WITH_POSE:
            width, quaternion = 12 + 6 * len(others), at + 24
            parts = [(at, 0, 3), *((start, 12 + 6 * n, size)
                                   for n, (start, size) in enumerate(others))]
        else:
            width, parts = count, [(at, 0, count)]
        self._size, self._width = layout.size, width
        constants = (
            layout.size, np.frombuffer(layout.message, np.uint8), layout.fixed, len(parts),
            np.array(parts, record('message_part')), quaternion, len(measured),
            np.array(measured, np.int64), LARGEST if topic in _BOUNDED else sys.float_info.max,
            width)
        self._read = function('read_messages').bound(*constants)
        data, sample = np.zeros(layout.size, np.uint8), np.zeros(1 + width, np.int64)
        self._read_one = function('read_messages').bound(
            *constants, 1, data, np.zeros(1, np.int64), np.array([layout.size]), sample[:1],
            sample[1:].view(float))
        self._data, self._sample = data.data, sample.data
        self._numbers = Struct(f'q{width}d')

    def read(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return stamp [ns] and numbers of a message; None if it is another or not valid."""
        if len(data) != self._size:
            return None
        self._data[:] = data
        if not self._read_one():
            return None
        sample = self._numbers.unpack(self._sample)
        return sample[0], sample[1:]

    def read_many(self, data: Bytes, starts: Integers, sizes: Integers,
                  ) -> tuple[Stamps, Array] | None:
        """Return stamps (N,) and numbers (N, ...); None if one is another or not valid."""
        stamps, values = np.empty(len(starts), np.int64), np.empty((len(starts), self._width))
        number = self._read(len(starts), data, np.ascontiguousarray(starts),
                            np.ascontiguousarray(sizes), stamps, values)
        return (stamps, values) if number == len(starts) else None


class WrenchInput:
    """Follows ``~/wrench``."""

    def __init__(self, parameters: Parameters, rejections: Rejections) -> None:
        self.wrench: Six = NO_WRENCH
        """Force and moment at the platform's origin, base axes [N, N m]."""
        self.reader = SampleReader(WRENCH, parameters.base_frame, rejections)

    def take(self, data: bytes) -> None:
        """Use the wrench of this geometry_msgs/WrenchStamped from now on, if it is valid."""
        sample = self.reader.read(data)
        if sample is not None:
            fx, fy, fz, tx, ty, tz = sample[1]
            self.wrench = fx, fy, fz, tx, ty, tz

    def at(self, samples: TopicSamples, places: Integers) -> Array:
        """
        Use new wrenches in order, and return the one that is valid at each of the given indices.

        samples: read by ``reader``.
        places (K,): indices in the order of all messages.
        Returns (K, 6) [N, N m].
        """
        wrenches = np.empty((len(places), 6))
        wrenches[:] = self.wrench
        if len(samples.values):
            latest = np.searchsorted(samples.places, places) - 1
            wrenches[latest >= 0] = samples.values[latest[latest >= 0]]
            fx, fy, fz, tx, ty, tz = samples.values[-1].tolist()
            self.wrench = fx, fy, fz, tx, ty, tz
        return wrenches
