# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


from pathlib import Path
from typing import Any

from legs_of_all_kinds import KINDS, random_hexapod
import numpy as np
import pytest
from referees import Array, random_motion, random_parameters, rng, rotation_about, smooth_motion
from snapshot import Snapshot

from stewart_dynamics import ParameterError, Parameters, Pose, StewartPlatform
from stewart_dynamics.mechanics.kinematics.home_pose import level_axes
from stewart_dynamics.mechanics.kinematics.leg_joints import home_directions, JOINTS, TreeJoints

PROGRAM = 'stewart_describe'

PLATFORM = Path(__file__).parents[1] / 'config' / 'platform.yaml'
X, Y, Z = np.eye(3)
CLOSED = 1e-12  # [m], of machines of 0.3 to 3 m


def ends(p: Parameters, joints: TreeJoints, positions: Any) -> tuple[Array, Array, Array]:
    """Return platform position and rotation, and the legs' ends, joint by joint."""
    at, (yaw, pitch, roll) = np.array(positions[:3]), positions[3:6]
    turn = rotation_about(Z, yaw) @ rotation_about(Y, pitch) @ rotation_about(X, roll)
    found = []
    for i in range(6):
        first, second, along = positions[6 + 3 * i:9 + 3 * i]
        leg = joints.mounts[i] @ rotation_about(X, first) @ rotation_about(Y, second) @ Z
        found.append(p['geometry.base_joints'][i] + (p['geometry.zero_length'][i] + along) * leg)
    return at, turn, np.array(found)


def gaps(p: Parameters, pose: Any, positions: Any, joints: TreeJoints) -> float:
    """Return the largest error of the platform's joints, by the chain and by the legs [m]."""
    truth = pose.position + p['geometry.platform_joints'] @ pose.rotation.T
    at, turn, legs = ends(p, joints, positions)
    chain = at + p['geometry.platform_joints'] @ turn.T
    return float(max(np.abs(chain - truth).max(), np.abs(legs - truth).max()))


@pytest.mark.parametrize('seed', range(3))
def test_all_loops_are_closed_over_random_motions(seed):
    p = random_parameters(rng(seed))
    joints = TreeJoints(p)
    poses = smooth_motion(p, rng(seed))(np.linspace(0.0, 5.0, 50))
    of_batch = joints.positions(poses.position, poses.rotation)
    assert of_batch.shape == (50, JOINTS)
    for pose, row in zip(poses, of_batch, strict=True):
        assert gaps(p, pose, row, joints) < CLOSED
        assert joints.positions(pose.position, pose.rotation) == pytest.approx(row, abs=1e-14)


@pytest.mark.parametrize('off', [0.0, 1e-300, 1e-17, 1e-12, 1e-8, 1e-4, -1e-9])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_loops_are_closed_where_a_leg_has_the_direction_of_its_first_axis(off, sign):
    p = Parameters.from_yaml(PLATFORM)
    joints = TreeJoints(p)
    for leg in range(6):
        x, y, z = joints.mounts[leg].T
        tip = p['geometry.base_joints'][leg] + 1.2 * sign * x + off * (0.6 * y - 0.8 * z)
        turn = rotation_about(Z, 0.3)
        pose = Pose(tip - turn @ p['geometry.platform_joints'][leg], turn)
        row = joints.positions(pose.position, pose.rotation)
        assert abs(row[7 + 3 * leg]) == pytest.approx(np.pi / 2, abs=1e-3)
        assert gaps(p, pose, row, joints) < CLOSED


@pytest.mark.parametrize('off', [0.0, 1e-17, 1e-12, 1e-8, 1e-4, -1e-9])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_chain_is_exact_at_a_pitch_of_90_degrees(off, sign):
    p = Parameters.from_yaml(PLATFORM)
    joints = TreeJoints(p)
    pose = Pose.from_euler([0.1, 0.2, 1.1], [0.4, sign * np.pi / 2 + off, -1.3])
    assert gaps(p, pose, joints.positions(pose.position, pose.rotation), joints) < CLOSED


def test_both_angles_of_a_leg_are_zero_at_home_and_the_singular_direction_is_90_degrees_away():
    p = Parameters.from_yaml(PLATFORM)
    joints, home = TreeJoints(p), StewartPlatform(p).home_pose()
    row = joints.positions(home.position, home.rotation)
    angles = row[6:].reshape(6, 3)[:, :2]
    assert np.abs(angles).max() < 1e-12
    assert joints.mounts[:, 2, 0] == pytest.approx(0.0, abs=1e-15)  # in the plane of the base
    directions = home_directions(p)
    assert directions.base == pytest.approx(joints.mounts[:, :, 2])
    assert directions.platform == pytest.approx(directions.base @ home.rotation)
    for mount in joints.mounts:
        assert mount.T @ mount == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(mount) == pytest.approx(1.0)


def test_within_the_limits_of_a_hexapod_all_legs_stay_away_from_the_singular_direction():
    p = Parameters.from_yaml(PLATFORM)
    platform, random = StewartPlatform(p), rng()
    poses = Pose.from_euler([0.0, 0.0, 1.1] + random.uniform(-0.5, 0.5, (20000, 3)),
                            random.uniform(-0.6, 0.6, (20000, 3)))
    lengths = platform.inverse_kinematics(poses)
    reached = poses[np.all((lengths > 0.95) & (lengths < 1.65), axis=1)]
    angles = TreeJoints(p).positions(reached.position, reached.rotation)
    assert len(reached) > 500
    assert np.rad2deg(np.abs(angles[:, 7::3])).max() < 65.0  # measured: 62


def test_upright_legs_have_a_mount_of_their_own_place():
    ring = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(6) * np.pi / 3])
    for off in (0.0, 8e-4):  # nearly upright legs, too
        turned = ring @ rotation_about(Z, off).T
        p = Parameters({'geometry.base_joints': ring, 'geometry.platform_joints': turned,
                        'geometry.zero_length': 1.0, 'platform.mass': 1.0,
                        'platform.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]})
        joints = TreeJoints(p)
        assert joints.mounts[:, :, 2] == pytest.approx(np.tile(Z, (6, 1)), abs=off + 1e-15)
        tangents = np.cross(Z, ring)
        assert joints.mounts[:, :, 0] == pytest.approx(tangents, abs=off + 1e-15)
        assert joints.mounts @ joints.mounts.swapaxes(1, 2) == pytest.approx(
            np.tile(np.eye(3), (6, 1, 1)), abs=1e-15)
        motion = random_motion(p, rng(), 1)[0]
        row = joints.positions(motion.position, motion.rotation)
        assert gaps(p, motion, row, joints) < CLOSED


def test_the_prismatic_joint_has_the_name_and_position_of_the_leg():
    p = Parameters.from_yaml(PLATFORM)
    joints = TreeJoints(p)
    assert joints.names[:6] == ('platform_x', 'platform_y', 'platform_z', 'platform_yaw',
                                'platform_pitch', 'platform_roll')
    assert joints.names[6:9] == ('leg_1_universal_x', 'leg_1_universal_y', 'leg_1')
    assert joints.names[8::3] == p['joints']
    assert len(joints.names) == JOINTS
    pose = Pose.from_euler([0.05, -0.1, 1.2], [0.1, -0.2, 0.3])
    lengths = StewartPlatform(p).inverse_kinematics(pose)
    row = joints.positions(pose.position, pose.rotation)
    assert row[8::3] == pytest.approx(lengths - p['geometry.zero_length'], abs=1e-15)
    assert row[:6] == pytest.approx([0.05, -0.1, 1.2, 0.3, -0.2, 0.1])


def test_two_joints_of_the_same_name_are_rejected(snapshot: Snapshot) -> None:
    p = Parameters.from_yaml(PLATFORM)
    with snapshot.raises(ParameterError):
        TreeJoints(p.replaced({'joints': ['platform_x', 'b', 'c', 'd', 'e', 'f']}))
    with snapshot.raises(ParameterError):
        TreeJoints(p.replaced({'joints': ['a', 'a_universal_x', 'c', 'd', 'e', 'f']}))


@pytest.mark.parametrize('flat', [0.0, 1e-9, 0.3])
def test_level_axes_are_the_principal_axes(flat: float) -> None:
    """The normal is the eigenvector of the smallest moment, here by LAPACK; exact in a plane."""
    random = rng(11)
    for n in range(200):
        turn = np.eye(3)[random.permutation(3)] if n % 2 else rotation_about(
            random.normal(size=3), random.uniform(0.0, 3.0))
        points = (random.normal(size=(6, 3)) * [1.0, 1.2, flat]) @ turn.T * 10.0 ** (n % 7 - 3)
        axes = level_axes(points - points.mean(axis=0))
        around = points - points.mean(axis=0)
        normal = np.linalg.eigh(around.T @ around)[1][:, 0]
        assert abs(abs(axes[2] @ normal) - 1.0) < 1e-12
        assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-14
        assert np.linalg.det(axes) > 0.0 and np.argmax(np.abs(axes[2])) == np.argmax(axes[2])
        if n % 2 and not flat:
            assert np.array_equal(axes[2], np.abs(turn[:, 2]))


@pytest.mark.parametrize('kind', KINDS)
def test_one_sample_has_the_joints_of_many_and_drives_are_those_of_the_library(kind):
    p, motions = random_hexapod(kind, 4, 20)
    joints = TreeJoints(p)
    rows = joints.positions(motions.position, motions.rotation)
    assert rows.shape == (20, len(joints.names))
    for motion, row in zip(motions, rows, strict=True):
        assert joints.positions(motion.position, motion.rotation) == pytest.approx(row, abs=1e-13)
    drives = [joints.names.index(leg) for leg in p['joints']]
    zero = p[p.leg_kind.zero] if p.leg_kind.zero else 0.0
    assert rows[:, drives] + zero == pytest.approx(
        StewartPlatform(p).inverse_kinematics(motions.pose), abs=1e-13)


def test_a_crank_whose_rod_does_not_reach_points_to_its_platform_joint():
    p = Parameters.from_yaml(PLATFORM.with_name('crank_platform.yaml'))
    joints, far = TreeJoints(p), Pose([0.0, 0.0, 5.0], np.eye(3))
    one = joints.positions(far.position, far.rotation)
    assert np.isfinite(one).all()
    line = far.position + p['geometry.platform_joints'] - p['geometry.base_joints']
    u, z = p['geometry.crank_axes'], p['geometry.crank_directions']
    expected = np.arctan2(np.sum(line * np.cross(u, z), axis=1), np.sum(line * z, axis=1))
    assert one[6::3] == pytest.approx(expected, abs=1e-12)
