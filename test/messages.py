# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes, serialized by rosbags: what the tests feed the package, without ROS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics import Motion, Parameters
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.setpoints.input_messages import INPUT_TYPES
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.rejections import Rejection
from stewart_dynamics.setpoints.step import Batch

STORE = get_typestore(Stores.ROS2_JAZZY)

POSE = 'geometry_msgs/msg/PoseStamped'
TWIST = 'geometry_msgs/msg/TwistStamped'
ACCEL = 'geometry_msgs/msg/AccelStamped'
WRENCH = 'geometry_msgs/msg/WrenchStamped'
IMU = 'sensor_msgs/msg/Imu'
COMBINED = 'trajectory_msgs/msg/MultiDOFJointTrajectory'

HOME = (0.0, 0.0, 1.1)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
REST = (0.0,) * 6
MS, SECOND = 1_000_000, 1_000_000_000  # [ns]
NOW = RECORDED = 1_700_000_000 * SECOND

Recorded = tuple[str, int, bytes]  # topic, time, message

JOINT_STATE = 'sensor_msgs/msg/JointState'
# Types by the last part of a topic's name.
KINDS = {topic.rpartition('/')[2]: kind for topic, kind in INPUT_TYPES.items()} | dict.fromkeys(
    ('measured_legs', 'joint_states', 'legs'), JOINT_STATE)


class Feed:
    """Setpoints that take messages; their rejections and notices are kept."""

    def __init__(self, parameters: Parameters) -> None:
        self.said: list[tuple[Rejection, str]] = []
        self.notices: list[str] = []
        self.setpoints = Setpoints(
            parameters, lambda rejection, details: self.said.append((rejection, details)),
            self.notices.append)

    def __call__(self, topic: str, data: bytes, now: int = NOW) -> Batch | None:
        """Take one message as the node does, at a time [ns]; return the setpoint it completes."""
        setpoint = self.setpoints.join_message(topic, data, lambda: now)
        return setpoint if len(setpoint.stamps) else None

    @property
    def counts(self) -> dict[tuple[str, str], int]:
        """Return the rejections; the callback must have got each."""
        assert Counter(rejection for rejection, _ in self.said) == self.setpoints.counts
        return {(topic, reason): n for (topic, reason), n in self.setpoints.counts.items()}


def together(given: Sequence[tuple[str, bytes]], topics: Sequence[str]) -> Messages:
    """Return messages as a bag has them, recorded a microsecond apart from NOW on."""
    sizes = np.array([len(data) for _, data in given], dtype=np.int64)
    return Messages(
        tuple(topics), np.array([topics.index(topic) for topic, _ in given], dtype=np.int64),
        NOW + 1000 * np.arange(len(given)),
        np.frombuffer(b'?' + b''.join(data for _, data in given), dtype=np.uint8),
        1 + np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64), sizes)


def check_many(one: Feed, many: Feed, given: Sequence[tuple[str, bytes]], topics: Sequence[str],
               cuts: Sequence[int]) -> int:
    """Check that messages give the same bits together and one by one; count the setpoints."""
    times = range(NOW, NOW + 1000 * len(given), 1000)
    expected = [(setpoint, time) for (topic, data), time in zip(given, times, strict=True)
                if (setpoint := one(topic, data, time)) is not None]
    whole, number = together(given, topics), 0
    for first, end in pairwise([0, *sorted(cut for cut in cuts if cut < len(given)), len(given)]):
        found = many.setpoints.join_messages(whole.chosen(slice(first, end)))
        assert found.moving == bool(many.setpoints.base.topics)
        for n, (setpoint, time) in enumerate(expected[number:number + len(found.stamps)]):
            assert (found.stamps[n], found.times[n]) == (setpoint.stamps[0], time)
            assert found.rows[n].tobytes() == setpoint.rows[0].tobytes()
        number += len(found.stamps)
    assert number == len(expected)
    assert many.notices == one.notices
    for feed in (one, many):
        feed.setpoints.drop_waiting('the bag ends')
    assert many.counts == one.counts
    return number


def _new(kind: str, *fields: Any) -> Any:
    return STORE.types[kind](*fields)


def _header(stamp: int, frame: str) -> Any:
    sec, nanosec = divmod(stamp, 1_000_000_000)
    return _new('std_msgs/msg/Header', _new('builtin_interfaces/msg/Time', sec, nanosec), frame)


def _vectors(kind: str, values: Sequence[float]) -> Any:
    return _new(kind, _new('geometry_msgs/msg/Vector3', *values[:3]),
                _new('geometry_msgs/msg/Vector3', *values[3:]))


def _bytes(message: Any, little_endian: bool = True) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=little_endian))


def pose(stamp: int, position: Sequence[float] = HOME, quaternion: Sequence[float] = UPRIGHT,
         frame: str = 'base', little_endian: bool = True) -> bytes:
    """Return a PoseStamped; the stamp is in nanoseconds."""
    return _bytes(_new(POSE, _header(stamp, frame), _new(
        'geometry_msgs/msg/Pose', _new('geometry_msgs/msg/Point', *position),
        _new('geometry_msgs/msg/Quaternion', *quaternion))), little_endian)


def twist(stamp: int, values: Sequence[float] = REST, frame: str = 'base') -> bytes:
    """Return a TwistStamped."""
    return _bytes(_new(TWIST, _header(stamp, frame), _vectors('geometry_msgs/msg/Twist', values)))


def accel(stamp: int, values: Sequence[float] = REST, frame: str = 'base') -> bytes:
    """Return an AccelStamped."""
    return _bytes(_new(ACCEL, _header(stamp, frame), _vectors('geometry_msgs/msg/Accel', values)))


def wrench(stamp: int, values: Sequence[float] = REST, frame: str = 'base') -> bytes:
    """Return a WrenchStamped."""
    return _bytes(_new(
        WRENCH, _header(stamp, frame), _vectors('geometry_msgs/msg/Wrench', values)))


def imu(stamp: int, spin: Sequence[float] = REST[:3],
        force: Sequence[float] = (0.0, 0.0, 9.80665), frame: str = 'imu',
        orientation: Sequence[float] = (0.0,) * 4, little_endian: bool = True,
        covariances: Sequence[float] = (-1.0, 0.0, 0.0)) -> bytes:
    """Return an Imu without orientation; covariances: their first entries."""
    unknown, of_spin, of_force = (np.array([first] + [0.0] * 8) for first in covariances)
    return _bytes(_new(
        IMU, _header(stamp, frame), _new('geometry_msgs/msg/Quaternion', *orientation), unknown,
        _new('geometry_msgs/msg/Vector3', *spin), of_spin,
        _new('geometry_msgs/msg/Vector3', *force), of_force), little_endian)


def joint_state(stamp: int, names: Sequence[str], position: Any, velocity: Any, effort: Any,
                frame: str = '', little_endian: bool = True) -> bytes:
    """Return a JointState."""
    return _bytes(_new('sensor_msgs/msg/JointState', _header(stamp, frame), list(names), *(
        np.array(numbers, dtype=float) for numbers in (position, velocity, effort))),
        little_endian)


def combined(
        stamp: int, position: Sequence[float] = HOME, quaternion: Sequence[float] = UPRIGHT,
        velocity: Sequence[float] = REST, acceleration: Sequence[float] = REST,
        frame: str = 'base', names: Sequence[str] = ('platform',), points: int = 1,
        parts: tuple[int, int, int] = (1, 1, 1)) -> bytes:
    """Return a MultiDOFJointTrajectory; ``parts``: how many transforms, velocities, ...."""
    transform = _new('geometry_msgs/msg/Transform', _new('geometry_msgs/msg/Vector3', *position),
                     _new('geometry_msgs/msg/Quaternion', *quaternion))
    point = _new('trajectory_msgs/msg/MultiDOFJointTrajectoryPoint', [transform] * parts[0],
                 [_vectors('geometry_msgs/msg/Twist', velocity)] * parts[1],
                 [_vectors('geometry_msgs/msg/Twist', acceleration)] * parts[2],
                 _new('builtin_interfaces/msg/Duration', 0, 0))
    return _bytes(_new(COMBINED, _header(stamp, frame), list(names), [point] * points))


def trajectory(stamp: int, times: Sequence[int], rows: Sequence[Sequence[float]],
               frame: str = 'base', names: Sequence[str] = ('platform',),
               little_endian: bool = True, parts: Sequence[tuple[int, int, int]] = (),
               others: Sequence[Sequence[float]] = ()) -> bytes:
    """
    Return a MultiDOFJointTrajectory of points at times [ns].

    Rows have position, quaternion, velocity and acceleration, 19 numbers, ``others`` those of a
    second joint; ``parts``: how many transforms, velocities, accelerations each point has of the
    last joint.
    """
    points = []
    for n, time in enumerate(times):
        joints = [each[n] for each in (rows, others) if len(each)]
        many = parts[n] if parts else (1, 1, 1)
        transforms = [_new(
            'geometry_msgs/msg/Transform', _new('geometry_msgs/msg/Vector3', *row[0:3]),
            _new('geometry_msgs/msg/Quaternion', *row[3:7])) for row in joints]
        twists, accelerations = (
            [_vectors('geometry_msgs/msg/Twist', row[part]) for row in joints]
            for part in (slice(7, 13), slice(13, 19)))
        points.append(_new(
            'trajectory_msgs/msg/MultiDOFJointTrajectoryPoint', *(
                each[:-1] + each[-1:] * number for each, number in zip(
                    (transforms, twists, accelerations), many, strict=True)),
            _new('builtin_interfaces/msg/Duration', *divmod(time, 1_000_000_000))))
    return _bytes(_new(COMBINED, _header(stamp, frame), list(names), points), little_endian)


def write_bag(folder: Path, of: Iterable[Recorded], node: str = '/stewart_dynamics',
              plugin: StoragePlugin = StoragePlugin.MCAP,
              mode: CompressionMode = CompressionMode.NONE, **types: str) -> Path:
    """Write a rosbag2; topics are made as they come, of types by the ends of their names."""
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, when, data in of:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic if topic.startswith('/') else f'{node}/{topic}',
                    (KINDS | types)[topic.rpartition('/')[2]], typestore=STORE)
            writer.write(connections[topic], when, data)
    return folder


def setpoints(stamps: NDArray[np.int64], motion: Motion) -> Iterable[Recorded]:
    """Return a motion as setpoints that are recorded at their stamps [ns]."""
    writers = [(f'setpoint/{name}', StampedWriter('base', size)) for name, size in (
        ('pose', 7), ('twist', 6), ('accel', 6))]
    rows = np.hstack([motion.position, motion.quaternion, motion.rows[:, 12:]])
    for stamp, row in zip(stamps.tolist(), rows.tolist(), strict=True):
        for (topic, writer), part in zip(writers, (row[:7], row[7:13], row[13:]), strict=True):
            yield topic, stamp, writer.write(stamp, part)


def leg_states(stamps: NDArray[np.int64], joints: Sequence[str], positions: Any, rates: Any,
               efforts: Any, topic: str = 'measured_legs') -> Iterable[Recorded]:
    """Return measured legs, recorded at their stamps [ns]; without rates they are zero."""
    writer = JointStateWriter(joints)
    still = np.zeros(np.shape(positions)) if rates is None else rates
    for n, stamp in enumerate(stamps.tolist()):
        yield topic, stamp, writer.write(
            stamp, positions[n], still[n], None if efforts is None else efforts[n])


def motion(number: int) -> list[Recorded]:
    """Return setpoints as they are recorded, 10 ms apart: a slow heave."""
    found: list[Recorded] = []
    for n in range(1, number + 1):
        t, stamp, when = 0.01 * n, n * 10 * MS, RECORDED + n * 10 * MS
        found += [
            ('setpoint/pose', when, pose(stamp, (0.0, 0.0, 1.1 + 0.05 * math.sin(t)))),
            ('setpoint/twist', when + 1, twist(stamp, (0.0, 0.0, 0.05 * math.cos(t), 0, 0, 0))),
            ('setpoint/accel', when + 2, accel(stamp, (0.0, 0.0, -0.05 * math.sin(t), 0, 0, 0)))]
    return found
