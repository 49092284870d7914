# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Poses of other message types and other axes, as rosbags writes them, against PoseStamped."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from messages import write_bag
import numpy as np
from programs import call
import pytest
from referees import rng, ROOT
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import BagError, read_setpoints
from stewart_dynamics.replay import main as replay

PROGRAM = 'stewart_replay'

PARAMS = ROOT / 'config' / 'platform.yaml'
STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
COUNT = 50
STAMPS = 1_700_000_000_000_000_000 + np.arange(COUNT) * 10_000_000
POSITIONS = rng(1).uniform(-0.05, 0.05, (COUNT, 3)) + [0.0, 0.0, 1.1]
QUATERNIONS = Rotation.from_rotvec(rng(2).uniform(-0.1, 0.1, (COUNT, 3))).as_quat()

Message = Callable[[int], Any]


def header(n: int, frame: str = 'base', store: Any = STORE) -> Any:
    stamp = store.types['builtin_interfaces/msg/Time'](*map(int, divmod(STAMPS[n], 10 ** 9)))
    if store is STORE:
        return T['std_msgs/msg/Header'](stamp, frame)
    return store.types['std_msgs/msg/Header'](n, stamp, frame)


def pose(n: int) -> Any:
    return T['geometry_msgs/msg/Pose'](
        T['geometry_msgs/msg/Point'](*POSITIONS[n]),
        T['geometry_msgs/msg/Quaternion'](*QUATERNIONS[n]))


def transform(n: int, child: str, frame: str = 'base') -> Any:
    return T['geometry_msgs/msg/TransformStamped'](
        header(n, frame), child, T['geometry_msgs/msg/Transform'](
            T['geometry_msgs/msg/Vector3'](*POSITIONS[n]),
            T['geometry_msgs/msg/Quaternion'](*QUATERNIONS[n])))


def odometry(n: int) -> Any:
    vector, covariance = T['geometry_msgs/msg/Vector3'], np.zeros(36)
    return T['nav_msgs/msg/Odometry'](
        header(n), 'platform', T['geometry_msgs/msg/PoseWithCovariance'](pose(n), covariance),
        T['geometry_msgs/msg/TwistWithCovariance'](
            T['geometry_msgs/msg/Twist'](vector(1.0, 2.0, 3.0), vector(4.0, 5.0, 6.0)),
            covariance))


def transforms(n: int, child: str = 'platform') -> Any:
    return T['tf2_msgs/msg/TFMessage']([
        transform(n, 'camera_1'), transform(n, child), transform(n, 'a')])


TYPES: dict[str, tuple[str, Message]] = {
    'stamped': ('geometry_msgs/msg/PoseStamped', lambda n: T['geometry_msgs/msg/PoseStamped'](
        header(n), pose(n))),
    'slash': ('geometry_msgs/msg/PoseStamped', lambda n: T['geometry_msgs/msg/PoseStamped'](
        header(n, '/base'), pose(n))),
    'covariance': ('geometry_msgs/msg/PoseWithCovarianceStamped', lambda n: T[
        'geometry_msgs/msg/PoseWithCovarianceStamped'](
            header(n), T['geometry_msgs/msg/PoseWithCovariance'](pose(n), np.zeros(36)))),
    'transform': ('geometry_msgs/msg/TransformStamped', lambda n: transform(n, 'platform')),
    'odometry': ('nav_msgs/msg/Odometry', odometry),
    'pose': ('geometry_msgs/msg/Pose', pose),
    'tf': ('tf2_msgs/msg/TFMessage', transforms)}


def write(folder: Path, topics: dict[str, tuple[str, Message]]) -> Path:
    return write_bag(folder, (
        (topic, stamp, STORE.serialize_cdr(message(n), kind))
        for topic, (kind, message) in topics.items() for n, stamp in enumerate(STAMPS.tolist())),
        **{topic[1:]: kind for topic, (kind, _) in topics.items()})


def check(found: Any) -> None:
    assert found.stamps.tolist() == STAMPS.tolist()
    np.testing.assert_allclose(found.motion.position, POSITIONS, atol=1e-15)
    np.testing.assert_allclose(
        found.motion.rotation, Rotation.from_quat(QUATERNIONS).as_matrix(), atol=1e-14)


@pytest.mark.parametrize('name', TYPES)
def test_poses_of_every_type_are_read(name: str, tmp_path: Path, snapshot: Snapshot) -> None:
    bag = write(tmp_path / 'bag', {'/poses': TYPES[name]})
    check(read_setpoints(bag, topics={'pose': '/poses'}))
    # The only topic with poses is found; transforms only if a child is named.
    if name == 'tf':
        with snapshot.raises(BagError):
            read_setpoints(bag)
        check(read_setpoints(bag, child='/platform'))
    else:
        check(read_setpoints(bag))


def test_a_pose_stamped_comes_before_other_types(tmp_path: Path, snapshot: Snapshot) -> None:
    bag = write(tmp_path / 'bag', {'/odometry': TYPES['odometry'], '/poses': TYPES['stamped']})
    check(read_setpoints(bag))
    bag = write(tmp_path / 'two', {'/odometry': TYPES['odometry'], '/poses': TYPES['covariance']})
    with snapshot.raises(BagError):
        read_setpoints(bag)


def test_the_child_of_transforms_is_selected(tmp_path: Path) -> None:
    bag = write(tmp_path / 'bag', {'/tf': (
        'tf2_msgs/msg/TFMessage', lambda n: transforms(n, 'hexapod'))})
    plain = [str(bag), '--params', str(PARAMS), '--output', str(tmp_path / 'r'), '--no-report',
             '--differentiate', '--pose', '/tf']
    error = call(replay, *plain, code=2).err
    assert ('no transform has the child frame platform; there are a, camera_1, hexapod: select '
            'one by --child') in error
    call(replay, *plain, '--child', 'hexapod')
    summary = json.loads((tmp_path / 'r' / 'bag' / 'summary.json').read_text())
    assert summary['setpoints']['answered'] == COUNT and not summary['rejected']


def test_transforms_in_another_frame_are_rejected_and_counted(
        tmp_path: Path, snapshot: Snapshot) -> None:
    bag = write(tmp_path / 'bag', {'/tf': ('tf2_msgs/msg/TFMessage', lambda n: T[
        'tf2_msgs/msg/TFMessage']([transform(n, 'platform', 'world')]))})
    with snapshot.raises(BagError):
        read_setpoints(bag, child='platform')


@pytest.mark.parametrize('name', ['covariance', 'transform', 'odometry', 'tf', 'pose'])
def test_damaged_messages_are_malformed(name: str, tmp_path: Path, snapshot: Snapshot) -> None:
    kind, message = TYPES[name]
    whole = bytes(STORE.serialize_cdr(message(0), kind))
    cut = [whole[:n] for n in range(len(whole))]  # anywhere
    write_bag(tmp_path / 'bag', (
        ('/poses', int(STAMPS[0]) + n, data)
        for n, data in enumerate([*cut, bytes([7]) + whole[1:]])), poses=kind)
    with snapshot.raises(BagError):
        found = read_setpoints(tmp_path / 'bag', topics={'pose': '/poses'})
        # A message that was cut behind its pose is complete.
        assert len(found.times) == 1
        np.testing.assert_allclose(found.motion.position[0], POSITIONS[0])
        raise BagError('has no valid setpoint')


def test_bags_of_ros_1_with_leading_slashes(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg('geometry_msgs/TransformStamped[] transforms',
                                      'tf2_msgs/msg/TFMessage'))
    t = store.types
    with Writer1(tmp_path / 'a.bag') as bag:
        to = bag.add_connection('/tf', 'tf2_msgs/msg/TFMessage', typestore=store)
        for n, stamp in enumerate(STAMPS.tolist()):
            one = t['geometry_msgs/msg/TransformStamped'](
                header(n, '/base', store), '/platform', t['geometry_msgs/msg/Transform'](
                    t['geometry_msgs/msg/Vector3'](*POSITIONS[n]),
                    t['geometry_msgs/msg/Quaternion'](*QUATERNIONS[n])))
            bag.write(to, stamp, store.serialize_ros1(
                t['tf2_msgs/msg/TFMessage']([one]), 'tf2_msgs/msg/TFMessage'))
    check(read_setpoints(tmp_path / 'a.bag', topics={'pose': '/tf'}))


@pytest.mark.parametrize('name', ['stamped', 'odometry', 'tf'])
def test_poses_in_other_axes_are_turned(name: str, tmp_path: Path) -> None:
    bag = write(tmp_path / 'bag', {'/poses': TYPES[name]})
    found = read_setpoints(bag, topics={'pose': '/poses'}, axes='x,-y,z')
    mirror = np.diag([1.0, -1.0, 1.0])
    np.testing.assert_allclose(found.motion.position, POSITIONS @ mirror, atol=1e-15)
    np.testing.assert_allclose(
        found.motion.rotation, mirror @ Rotation.from_quat(QUATERNIONS).as_matrix() @ mirror,
        atol=1e-14)


@pytest.mark.parametrize('axes', ['x,y', 'x,y,x', 'x,y,w', '', 'xyz', 'x;y;z'])
def test_axes_that_are_none_are_rejected(axes: str, tmp_path: Path) -> None:
    call(replay, tmp_path, '--params', PARAMS, '--axes', axes, code=2)
