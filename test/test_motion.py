# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Motions, rotations and angular velocities."""

from __future__ import annotations

import copy
import pickle
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    derivative, random_direction, random_motion, random_parameters, relative, rng, rotation_about,
    smooth_motion)
from snapshot import Snapshot
from stewart_dynamics import Motion, MotionError, Pose
from stewart_dynamics.mechanics.dynamics.lagrange import skew
from stewart_dynamics.mechanics.frames.rotation import (
    euler_rate_matrix, from_euler, quaternion_of, to_quaternion)

Array = NDArray[np.float64]

X, Y, Z = np.eye(3)
UPRIGHT = np.eye(3)


def of_quaternion(quaternion: Array) -> Array:
    """Return the rotation matrix of a unit quaternion x y z w."""
    u, w = quaternion[:3], quaternion[3]
    k = skew(u)
    r: Array = np.eye(3) + 2.0 * w * k + 2.0 * k @ k
    return r


# Rotations

def test_euler_angles_turn_about_x_then_y_then_z() -> None:
    for alpha, beta, gamma in rng().uniform(-np.pi, np.pi, (50, 3)):
        turned = rotation_about(Z, gamma) @ rotation_about(Y, beta) @ rotation_about(X, alpha)
        assert np.allclose(from_euler([alpha, beta, gamma]), turned, rtol=0.0, atol=1e-15)


def test_angular_velocity_of_euler_rates_is_the_derivative_of_the_rotation() -> None:
    random = rng()
    for _ in range(50):
        angles, rates = random.uniform(-3.0, 3.0, (2, 3))
        omega = euler_rate_matrix(angles) @ rates
        change = derivative(lambda h: from_euler(angles + h * rates), 1e-3)  # noqa: B023
        assert relative(skew(omega) @ from_euler(angles), change) < 1e-9


def test_velocities_and_accelerations_of_euler_angles_are_derivatives_along_a_motion() -> None:
    random = rng()
    course = smooth_motion(random_parameters(random), random)
    times = np.linspace(0.0, 3.0, 40)
    motion = course(times)

    def after(name: str) -> Array:
        return derivative(lambda h: getattr(course(times + h), name), 1e-3)

    spin = after('rotation') @ np.swapaxes(motion.rotation, -1, -2)
    assert relative(skew(motion.angular_velocity), spin) < 1e-8
    assert relative(motion.angular_acceleration, after('angular_velocity')) < 1e-8
    assert relative(motion.linear_velocity, after('position')) < 1e-8
    assert relative(motion.linear_acceleration, after('linear_velocity')) < 1e-8


def test_quaternions_and_rotations_convert_both_ways() -> None:
    random = rng()
    turns = np.array([rotation_about(random_direction(random), angle)
                      for angle in random.uniform(-np.pi, np.pi, 200)])
    quaternions = to_quaternion(turns)
    assert np.allclose(np.linalg.norm(quaternions, axis=-1), 1.0, rtol=0.0, atol=1e-15)
    assert np.all(quaternions[:, 3] >= 0.0)
    for quaternion, turn in zip(quaternions, turns, strict=True):
        assert np.allclose(of_quaternion(quaternion), turn, rtol=0.0, atol=2e-15)


@pytest.mark.parametrize('short_of', [0.0, 1e-12, 1e-8, 1e-4, -1e-8])
@pytest.mark.parametrize('axis', [
    X, Y, Z, -X, -Y, -Z, (X + Y) / np.sqrt(2), (Y - Z) / np.sqrt(2),
    (X + Y + Z) / np.sqrt(3), (1e-9 * X + Y)])
def test_quaternions_of_half_turns_lose_no_digits(axis: Array, short_of: float) -> None:
    turn = rotation_about(axis, np.pi - short_of)
    quaternion = to_quaternion(turn)
    assert quaternion[3] >= 0.0
    assert np.allclose(of_quaternion(quaternion), turn, rtol=0.0, atol=2e-15)
    assert abs(np.dot(quaternion[:3], axis)) == pytest.approx(np.cos(short_of / 2), abs=1e-15)


def test_the_quaternion_of_one_matrix_is_that_of_many() -> None:
    random = rng()
    turns = [rotation_about(random_direction(random), angle)
             for angle in (0.0, *random.uniform(-np.pi, np.pi, 200))]
    turns += [rotation_about(axis, np.pi - short_of) for axis in (X, Y, Z, (X + Y) / np.sqrt(2))
              for short_of in (1e-12, 1e-8, 1e-4)]
    for turn in turns:
        assert np.allclose(quaternion_of(turn.ravel().tolist()), to_quaternion(turn),
                           rtol=0.0, atol=4e-16)
    for axis in np.eye(3):  # exact half turns
        turn = 2.0 * np.outer(axis, axis) - np.eye(3)
        assert np.array_equal(to_quaternion(turn), [*axis, 0.0])
        assert np.array_equal(np.abs(quaternion_of(turn.ravel().tolist())), [*axis, 0.0])
    assert np.array_equal(to_quaternion(np.eye(3)), [0.0, 0.0, 0.0, 1.0])


def test_rotations_take_any_leading_shape() -> None:
    angles = rng().uniform(-1.0, 1.0, (2, 3, 3))
    for function, tail in ((from_euler, (3, 3)), (euler_rate_matrix, (3, 3)),
                           (lambda a: to_quaternion(from_euler(a)), (4,))):
        many = function(angles)
        assert many.shape == (2, 3, *tail)
        assert np.allclose(many[1, 2], function(angles[1, 2]), rtol=0.0, atol=1e-15)
        assert function(angles[:0]).shape == (0, 3, *tail)


# Motions

def test_parts_are_as_given_and_zero_by_default() -> None:
    motion = Motion([1.0, 2.0, 3.0], UPRIGHT, angular_velocity=[4.0, 5.0, 6.0])
    assert motion.shape == ()
    assert np.array_equal(motion.position, [1.0, 2.0, 3.0])
    assert np.array_equal(motion.rotation, UPRIGHT)
    assert np.array_equal(motion.linear_velocity, np.zeros(3))
    assert np.array_equal(motion.angular_velocity, [4.0, 5.0, 6.0])
    assert np.array_equal(motion.linear_acceleration, np.zeros(3))
    assert np.array_equal(motion.angular_acceleration, np.zeros(3))
    assert repr(motion) == '<Motion: position [1, 2, 3] m, quaternion [0, 0, 0, 1]>'
    assert repr(motion.pose) == '<Pose: position [1, 2, 3] m, quaternion [0, 0, 0, 1]>'


def test_leading_shapes_broadcast() -> None:
    motion = Motion(np.zeros((4, 1, 3)), UPRIGHT, np.ones((5, 3)))
    assert motion.shape == (4, 5)
    assert motion.rotation.shape == (4, 5, 3, 3)
    assert np.array_equal(motion.linear_velocity, np.ones((4, 5, 3)))
    assert repr(motion) == '<Motion of shape (4, 5)>'
    euler = Motion.from_euler([0.0, 0.0, 1.0], np.zeros((7, 3)), angle_rates=[0.1, 0.0, 0.0])
    assert euler.shape == (7,)


def test_arrays_are_copied_and_their_views_read_only() -> None:
    position = np.zeros(3)
    motion = Motion(position, UPRIGHT)
    position[0] = 1.0
    assert motion.position[0] == 0.0
    for name in ('position', 'rotation', 'linear_velocity', 'angular_velocity',
                 'linear_acceleration', 'angular_acceleration'):
        with pytest.raises(ValueError, match='read-only'):
            getattr(motion, name)[...] = 1.0


def test_a_rotation_rounded_as_in_messages_is_accepted() -> None:
    rounded = rotation_about(X, 0.3).astype(np.float32)
    assert Motion(np.zeros(3), rounded).shape == ()


# Poses: their constructors, and poses and motions as sequences of samples

POSITION = [1.0, 2.0, 3.0]
ORIGIN = np.zeros(3)  # arrays of one sample are checked faster than others


def random_poses(many: int) -> Pose:
    """Return poses of any orientation."""
    random = rng()
    return Pose(random.normal(size=(many, 3)), [
        rotation_about(random_direction(random), random.uniform(-3.0, 3.0))
        for _ in range(many)])


def test_all_constructors_give_the_same_pose() -> None:
    turn = rotation_about([0.0, 0.0, 1.0], 0.4) @ rotation_about([0.0, 1.0, 0.0], -0.3) @ (
        rotation_about([1.0, 0.0, 0.0], 0.2))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, POSITION
    pose = Pose(POSITION, turn)
    for other in (Pose.from_euler(POSITION, [0.2, -0.3, 0.4]), Pose.from_matrix(matrix),
                  Pose.from_quaternion(POSITION, pose.quaternion),
                  Pose.from_quaternion(POSITION, -pose.quaternion)):
        assert np.array_equal(other.position, POSITION)
        assert np.allclose(other.rotation, turn, rtol=0.0, atol=1e-15)
    twist = [0.1, 0.2, 0.3], [0.4, 0.5, 0.6]
    truth = Motion(POSITION, turn, *twist)
    assert Motion.from_pose(pose, *twist) == truth
    assert np.allclose(Motion.from_quaternion(POSITION, pose.quaternion, *twist).rows,
                       truth.rows, rtol=0.0, atol=1e-15)
    assert truth.pose == pose
    assert Motion.from_pose(truth) == Motion(POSITION, turn)


def test_a_quaternion_is_x_y_z_w_and_normalized() -> None:
    half = np.sqrt(0.5)
    quarter = Pose.from_quaternion(POSITION, [0.0, 0.0, half, half])
    assert np.allclose(quarter.rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    longer = Pose.from_quaternion(POSITION, [0.0, 0.0, 1.0009 * half, 1.0009 * half])
    assert np.allclose(longer.rotation, quarter.rotation, rtol=0.0, atol=1e-15)


def test_constructors_take_any_leading_shape() -> None:
    poses = random_poses(12)
    q = poses.quaternion.reshape(3, 4, 4)
    assert Pose.from_quaternion(POSITION, q).shape == (3, 4)
    assert np.allclose(Pose.from_quaternion(POSITION, q).rotation,
                       poses.rotation.reshape(3, 4, 3, 3), rtol=0.0, atol=4e-15)
    matrices = np.zeros((12, 4, 4))
    matrices[:, :3, :3], matrices[:, :3, 3] = poses.rotation, poses.position
    matrices[:, 3, 3] = 1.0
    assert Pose.from_matrix(matrices) == poses
    assert Pose(np.zeros((0, 3)), UPRIGHT).shape == (0,)


@pytest.mark.parametrize('make', [
    lambda: Motion([0.0, 0.0], UPRIGHT),
    lambda: Motion(ORIGIN, UPRIGHT.ravel()),
    lambda: Motion([0.0, np.nan, 0.0], UPRIGHT),
    lambda: Motion(ORIGIN, UPRIGHT, [[0.0, 0.0, 0.0], [0.0, 0.0, np.inf]]),
    lambda: Motion(ORIGIN, -UPRIGHT),
    lambda: Motion(ORIGIN, 1.001 * UPRIGHT),
    lambda: Motion(ORIGIN, 1e200 * UPRIGHT),
    lambda: Motion(ORIGIN, [UPRIGHT, UPRIGHT, np.zeros((3, 3))]),
    lambda: Motion(np.zeros((2, 3)), UPRIGHT, np.zeros((3, 3))),
    lambda: Motion(['a', 'b', 'c'], UPRIGHT),
    lambda: Motion(None, UPRIGHT),
    lambda: Motion([0.0, 0.0, 1.0 + 2.0j], UPRIGHT),
    lambda: Motion(ORIGIN, UPRIGHT, {'x': 1.0}),
    lambda: Pose.from_quaternion(POSITION, [0.0, 0.0, 0.0, 1.01]),
    lambda: Pose.from_quaternion(POSITION, [0.0] * 4),
    lambda: Pose.from_quaternion(POSITION, [1e308] * 4),
    lambda: Pose.from_quaternion(POSITION, [0.0, 0.0, 1.0]),
    lambda: Pose.from_matrix(np.eye(3)),
    lambda: Pose.from_matrix([np.eye(4), np.ones((4, 4))]),
    lambda: Motion.from_euler(POSITION, [0.0, 0.0], None, None),
    lambda: Motion.from_euler(POSITION, [0.0] * 3, None, [0.0, np.inf, 0.0]),
    lambda: Motion.from_pose(POSITION),
])
def test_bad_arguments_are_rejected_in_one_line(make: Any, snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError) as caught:
        make()
    assert '\n' not in str(caught.value)
    # no traceback of the fast path before that of the error
    assert caught.value.__context__ is caught.value.__cause__


def batches() -> list[Any]:
    """Return a batch of poses and one of motions, both of shape (4, 5)."""
    motion = random_motion(random_parameters(rng()), rng(), 20)
    motion = Motion.of_rows(motion.rows.reshape(4, 5, -1))
    return [motion, motion.pose]


@pytest.mark.parametrize('batch', batches(), ids=['Motion', 'Pose'])
def test_samples_are_indexed_like_an_array(batch: Any) -> None:
    kind = type(batch)
    assert len(batch) == 4
    mask = np.arange(4) % 2 == 0
    both = np.arange(20).reshape(4, 5) % 3 == 0
    for index, shape in ((3, (5,)), (slice(None, None, 2), (2, 5)), ((1, 2), ()),
                         ((slice(None), -1), (4,)), ((..., 0), (4,)), ([0, 2, 1], (3, 5)),
                         (mask, (2, 5)), (both, (7,)), (slice(0, 0), (0, 5))):
        part = batch[index]
        assert type(part) is kind
        assert part.shape == shape
        assert np.array_equal(part.position, batch.position[
            (*index, slice(None)) if isinstance(index, tuple) else index])
        assert np.array_equal(part.rotation.shape, (*shape, 3, 3))
    assert [each.shape for each in batch] == [(5,)] * 4
    assert list(batch)[2] == batch[2]
    one = batch[1, 2]
    for wrong in (9, (0, 0, 0), 'x', 1.5):
        with pytest.raises(IndexError, match=re.escape(f'{kind.__name__} of shape (4, 5): ')):
            batch[wrong]
    with pytest.raises(IndexError, match=re.escape('of shape (): ')):
        one[0]
    with pytest.raises(TypeError, match='has no length'):
        len(one)


@pytest.mark.parametrize('batch', batches(), ids=['Motion', 'Pose'])
def test_equality_is_that_of_all_numbers(batch: Any) -> None:
    assert batch == copy.deepcopy(batch) == pickle.loads(pickle.dumps(batch))
    assert batch != batch[:3]
    changed = copy.deepcopy(batch)
    changed.rows[2, 3, -1] += 1e-9
    assert batch != changed
    assert batch != batch.rows
    assert batches()[0] != batches()[1]
    with pytest.raises(TypeError, match='unhashable'):
        hash(batch)


def test_angles_may_be_in_degrees() -> None:
    degrees = np.array([[10.0, -20.0, 30.0], [0.0, 5.0, -170.0]])
    derivatives = [None, 2.0 * degrees, None, 3.0 * degrees]
    position = [0.1, 0.2, 1.0]
    assert Pose.from_euler(position, degrees, degrees=True) == Pose.from_euler(
        position, np.radians(degrees))
    given = Motion.from_euler(position, degrees, *derivatives, degrees=True)
    assert given == Motion.from_euler(position, np.radians(degrees), *(
        None if each is None else np.radians(each) for each in derivatives))
