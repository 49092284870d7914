# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Converts messages of an input topic to checked samples.

A sample is a stamp and the message's numbers, with the quaternion of a pose replaced by the
rotation matrix. Node and replay apply the same checks and get bit-identical samples.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import sys
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Bytes, Integers, NO_WRENCH, Six, Stamps
from stewart_dynamics.core.binding import CODES, function, record, Sample
from stewart_dynamics.mechanics.frames.rotation import quaternion_length
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError, Stamped
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


class MessageLayout(NamedTuple):
    """Arguments of ``put_layout`` in core/library.h: they describe the messages of one layout."""

    size: int  # [bytes]
    message: Bytes  # one of them
    fixed: Bytes  # 255 for bytes that are the same in all of them
    n_parts: int
    parts: Any
    quaternion: int  # its offset, or -1
    n_measured: int
    measured: Integers  # offsets of covariances that are not -1
    largest: float


class TopicSamples(NamedTuple):
    """Valid messages of a topic, N of them."""

    stamps: Stamps  # (N,) [ns]
    values: Array  # (N, width)
    places: Integers  # (N,): index of each message


class SampleReader:
    """
    Reads the messages of one topic, and rejects those that are not valid.

    Messages with a layout that was learned from a valid one are read by it, in C.

    topic: one of ``INPUT_TYPES``.
    frame: required frame_id; an empty one is accepted. None: the first non-empty one is required.
    width: numbers of a sample.
    """

    def __init__(self, topic: str, frame: str | None, rejections: Rejections) -> None:
        self.topic = topic
        self._reader = _READERS[topic]
        self._has_pose, self._bounded = topic in _WITH_POSE, topic in _BOUNDED
        self.width = 24 if topic == COMBINED else 12 if self._has_pose else 6
        self._frame = None if frame is None else frame.encode()
        self._rejections = rejections
        self._turned = Sample('one_rotation', 'quaternion', 'rotation')
        self._turn = function('stewart_rotation').bound(
            self._turned['quaternion'], self._turned['rotation'])
        self._count = 0  # valid messages that were read field by field
        self._new: bytes | None = None  # the last one, if its layout is to be learned
        self._layout: MessageLayout | None = None

    def read_fields(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return a message's stamp [ns] and values, read field by field, or reject it."""
        try:
            stamp, frame, values = self._reader(data)
        except MalformedError as exc:
            self._rejections.reject(self.topic, MALFORMED, str(exc))
            return None
        if frame and self._frame is not None and frame != self._frame:
            self._rejections.reject(self.topic, WRONG_FRAME, frame_details(frame, self._frame))
            return None
        if self.topic in _IMUS:
            for at, name in _COVARIANCES.items():
                if values[at] == -1.0:
                    self._rejections.reject(self.topic, NOT_MEASURED, f'{name}[0] is -1')
                    return None
            values = tuple([values[at] for at in _OF_IMU])
        if not all(map(math.isfinite, values)):
            self._rejections.reject(self.topic, NOT_FINITE, str(values))
            return None
        if self._bounded and max(map(abs, values)) > LARGEST:
            self._rejections.reject(
                self.topic, OUT_OF_RANGE, f'{values}: must be at most {LARGEST:g}')
            return None
        if self._has_pose:
            self._turned.write(*values[3:7])
            if self._turn() != CODES['STEWART_OK']:
                self._rejections.reject(
                    self.topic, NOT_UNIT, unit_rule(quaternion_length(*values[3:7])))
                return None
            values = values[:3] + self._turned.read() + values[7:]
        if self._frame is None:
            self._frame = frame or None
        self._count += 1
        # The first one, and ever more rarely later ones: layouts may take turns.
        self._new = data if self._count & (self._count - 1) == 0 else None
        return stamp, values

    def new_layout(self) -> MessageLayout | None:
        """Return the layout of the last message, if it is to be learned."""
        if self._new is None:
            return None
        layout = layout_of(self._reader, self._new)
        self._new = None
        (at, count), *others = layout.numbers
        quaternion, measured = -1, []
        if self.topic in _IMUS:
            parts = [(at + 8 * _OF_IMU[0], 0, 3), (at + 8 * _OF_IMU[3], 3, 3)]
            measured = [at + 8 * place for place in _COVARIANCES]
        elif self._has_pose:
            quaternion = at + 24
            parts = [(at, 0, 3), *((start, 12 + 6 * n, size)
                                   for n, (start, size) in enumerate(others))]
        else:
            parts = [(at, 0, count)]
        return MessageLayout(
            layout.size, np.frombuffer(layout.message, np.uint8), layout.fixed, len(parts),
            np.array(parts, record('message_part')), quaternion, len(measured),
            np.array(measured, np.int64), LARGEST if self._bounded else sys.float_info.max)

    def read_samples(self, data: Bytes, starts: Integers, sizes: Integers) -> TopicSamples:
        """
        Return the samples of messages that are valid; reject the others.

        data (M,): bytes that contain all messages.
        starts, sizes (N,): offset and length of each message in bytes.
        """
        count = len(starts)
        stamps, values = np.empty(count, np.int64), np.empty((count, self.width))
        valid = np.ones(count, dtype=bool)
        n = 0
        while n < count:
            if self._layout is not None:
                n += function('read_messages')(
                    *self._layout, self.width, count - n, data,
                    np.ascontiguousarray(starts[n:]), np.ascontiguousarray(sizes[n:]),
                    stamps[n:], values[n:])
            if n < count:
                sample = self.read_fields(data[starts[n]:starts[n] + sizes[n]].tobytes())
                if sample is None:
                    valid[n] = False
                else:
                    stamps[n], values[n] = sample
                self._layout = self.new_layout() or self._layout
                n += 1
        places = np.flatnonzero(valid)
        return TopicSamples(stamps[places], values[places], places)

    def read_sample(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return a message's stamp [ns] and values, or reject it."""
        samples = self.read_samples(
            np.frombuffer(data, np.uint8), np.zeros(1, np.int64), np.array([len(data)]))
        if not len(samples.stamps):
            return None
        return int(samples.stamps[0]), tuple(samples.values[0].tolist())


class WrenchInput:
    """Follows the ``~/wrench`` of the simulator."""

    def __init__(self, parameters: Parameters, rejections: Rejections) -> None:
        self.wrench: Six = NO_WRENCH
        """Force and moment at the platform's origin, base axes [N, N m]."""
        self._reader = SampleReader(WRENCH, parameters.base_frame, rejections)

    def use_message(self, data: bytes) -> None:
        """Use the wrench of this geometry_msgs/WrenchStamped from now on, if it is valid."""
        sample = self._reader.read_sample(data)
        if sample is not None:
            fx, fy, fz, tx, ty, tz = sample[1]
            self.wrench = fx, fy, fz, tx, ty, tz
