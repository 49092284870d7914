# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Setpoints, wrenches and IMUs: messages with a header and some numbers.

PoseStamped, TwistStamped, AccelStamped and WrenchStamped of geometry_msgs, sensor_msgs/Imu, and a
trajectory_msgs/MultiDOFJointTrajectory of one point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct

from stewart_dynamics.messages.cdr import (
    aligned8, COUNT, header, LITTLE_ENDIAN, MalformedError, nanoseconds, READ_ERRORS, sequence,
    SEVEN, SIX, Stamped, stamped, text, TIME_AND_LENGTH, unreadable)
from stewart_dynamics.messages.layout import Layout
from stewart_dynamics.messages.trajectory_layouts import points_of

_IMU = {0: Struct('>37d'), 1: Struct('<37d')}
_DURATION = {0: Struct('>iI'), 1: Struct('<iI')}


def pose(data: bytes) -> Stamped:
    """Read a geometry_msgs/PoseStamped: x y z and the quaternion's x y z w."""
    return stamped(data, SEVEN)


def twist(data: bytes) -> Stamped:
    """Read a TwistStamped, AccelStamped or WrenchStamped: two vectors x y z."""
    return stamped(data, SIX)


def imu(data: bytes) -> Stamped:
    """
    Read a sensor_msgs/Imu: 37 numbers.

    They are the orientation x y z w, the angular velocity and the linear acceleration x y z, each
    with the nine numbers of its covariance behind it.
    """
    return stamped(data, _IMU)


def combined(data: bytes) -> Stamped:
    """
    Read a trajectory_msgs/MultiDOFJointTrajectory of one point and one joint.

    The 19 values are position, quaternion x y z w, twist and acceleration.
    """
    try:
        order = data[1]
        sec, nanosec, size = TIME_AND_LENGTH[order].unpack_from(data, 4)
        values: tuple[float, ...] = ()
        for at, layout in zip(_combined_numbers(data), (SEVEN, SIX, SIX), strict=True):
            values += layout[order].unpack_from(data, at)
        # time_from_start: not used, but it must be there
        _DURATION[order].unpack_from(data, at + layout[order].size)
    except READ_ERRORS as exc:
        raise unreadable(data) from exc
    return Stamped(nanoseconds(data, sec, nanosec), text(data, 16, size), values)


def _combined_numbers(data: bytes, gaps: list[slice] | None = None) -> list[int]:
    """Return where transform, velocity and acceleration begin; note what only aligns."""
    gaps = [] if gaps is None else gaps
    count = COUNT[data[1]]
    _, points, at = points_of(data, gaps)
    if points != 1:
        raise MalformedError(f'{points} points: a setpoint has one')
    found = []
    for name, layout in (('transforms', SEVEN), ('velocities', SIX), ('accelerations', SIX)):
        number, at = sequence(data, at, count, gaps)
        if number != 1:
            raise MalformedError(f'{number} {name}: a setpoint has one')
        found.append(aligned8(at))
        gaps.append(slice(at, found[-1]))
        at = found[-1] + layout[data[1]].size
    return found


def layout_of(reader: Callable[[bytes], Stamped], message: bytes) -> Layout:
    """Return the layout of a message that one of these readers has read."""
    if reader is combined:
        gaps: list[slice] = []
        numbers = zip(_combined_numbers(message, gaps), (7, 6, 6), strict=True)
        return Layout(message, list(numbers), gaps=gaps)
    end = 16 + COUNT[message[1]].unpack_from(message, 12)[0]
    at = aligned8(end)
    length = 7 if reader is pose else 37 if reader is imu else 6
    return Layout(message, [(at, length)], gaps=[slice(end, at)])


class StampedWriter:
    """Writes PoseStamped (7 numbers), TwistStamped or AccelStamped (6) of geometry_msgs."""

    def __init__(self, frame: str, number: int) -> None:
        body = bytearray(LITTLE_ENDIAN) + header(0, frame)
        body += bytes((4 - len(body)) % 8)
        self.layout = Layout(bytes(body) + bytes(8 * number), [(len(body), number)])

    def write(self, stamp: int, values: Sequence[float]) -> bytes:
        """Return the message."""
        return self.layout.write_one(stamp, values)


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
