# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Setpoints, wrenches and IMUs: messages with a header and some numbers.

PoseStamped, TwistStamped, AccelStamped and WrenchStamped of geometry_msgs, sensor_msgs/Imu, and a
trajectory_msgs/MultiDOFJointTrajectory of one point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import fault_of, header, LITTLE_ENDIAN
from stewart_dynamics.messages.layout import Layout

# Types in C, and how many numbers each part of a message has.
_TYPES = {
    type_names.POSE_STAMPED: ('POSE', (7,)), type_names.TWIST_STAMPED: ('TWIST', (6,)),
    type_names.ACCEL_STAMPED: ('TWIST', (6,)), type_names.WRENCH_STAMPED: ('TWIST', (6,)),
    type_names.IMU: ('IMU', (37,)),
    type_names.MULTI_DOF_JOINT_TRAJECTORY: ('COMBINED', (7, 6, 6))}
MESSAGE_TYPES = {kind: CODES[f'MESSAGE_{name}'] for kind, (name, _) in _TYPES.items()}
"""The types that are a header and numbers, as C knows them."""


class StampedNumbers(NamedTuple):
    """
    A message with a header: its stamp, its frame and its numbers.

    Numbers of a PoseStamped: x y z and the quaternion's x y z w; of a TwistStamped, AccelStamped
    or WrenchStamped: two vectors x y z; of an Imu: the orientation x y z w, the angular velocity
    and the linear acceleration x y z, each with the nine numbers of its covariance behind it; of
    a MultiDOFJointTrajectory of one point and one joint: position, quaternion, twist,
    acceleration.
    """

    stamp: int  # [ns]
    frame: bytes
    values: tuple[float, ...]
    parts: tuple[tuple[int, int], ...]
    """Where the parts of the numbers stand in the bytes, and how many they are."""


def read_message(kind: str, data: bytes) -> StampedNumbers:
    """Return the contents of a message of one of MESSAGE_TYPES; MalformedError if it is not."""
    counts = _TYPES[kind][1]
    content: Any = np.zeros(1, record('message_content'))
    numbers = np.empty(sum(counts))
    function('read_message')(
        MESSAGE_TYPES[kind], len(data), np.frombuffer(data, np.uint8), content, numbers)
    stamp, fault, number, size, places = content[0].tolist()
    if fault:
        raise fault_of(data, fault, number)
    return StampedNumbers(stamp, data[16:16 + size], tuple(numbers.tolist()),
                          tuple(zip(places, counts, strict=False)))


def layout_of(kind: str, message: bytes) -> Layout:
    """Return the layout of messages like one of MESSAGE_TYPES."""
    return Layout(message, read_message(kind, message).parts)


class StampedWriter:
    """Writes PoseStamped (7 numbers), TwistStamped or AccelStamped (6) of geometry_msgs."""

    def __init__(self, frame: str, number: int) -> None:
        body = bytearray(LITTLE_ENDIAN) + header(0, frame)
        body += bytes((4 - len(body)) % 8)
        self.layout = Layout(bytes(body) + bytes(8 * number), [(len(body), number)])

    def write(self, stamp: int, values: Sequence[float]) -> bytes:
        """Return the message."""
        return self.layout.write([stamp], [values]).tobytes()


_NUMBERS = 37
# By convention of the message: the orientation is not measured.
_NOT_MEASURED = (0.0, 0.0, 0.0, 1.0, -1.0, *(0.0,) * 8)


class ImuWriter:
    """
    Writes sensor_msgs/Imu of an IMU that does not measure its orientation.

    The covariances are made of the standard deviations of the readings [rad/s, m/s^2].
    """

    def __init__(self, frame: str, angular_velocity: float, specific_force: float) -> None:
        self._writer = StampedWriter(frame, _NUMBERS)
        self._covariances = [
            [deviation ** 2 * (n % 4 == 0) for n in range(9)]
            for deviation in (angular_velocity, specific_force)]

    def write(self, stamp: int, angular_velocity: Sequence[float],
              specific_force: Sequence[float]) -> bytes:
        """Return the message of readings in IMU axes at a time [ns]."""
        of_gyro, of_accelerometer = self._covariances
        return self._writer.write(stamp, (
            *_NOT_MEASURED, *angular_velocity, *of_gyro, *specific_force, *of_accelerometer))
