# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Forward kinematics: it returns the pose of the lengths, and never another assembly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    QUARTER_TURN, random_direction, random_motion,
    random_parameters, rng, ROOT, rotation_about, size_of, symmetric_parameters)
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import (
    Motion, ParameterError, Parameters, Pose, PoseError, SingularityError, StewartPlatform)
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.kinematics.forward_kinematics import FOUND, RESIDUAL

Array = NDArray[np.float64]

HOME = (0.0, 0.0, 1.1)
AT_HOME = Pose(HOME, np.eye(3))


@pytest.fixture(scope='module')
def hexapod() -> StewartPlatform:
    """Return the hexapod in config/."""
    return StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')


def independent_lengths(p: Parameters, position: Array, rotation: Array) -> Array:
    """Return the leg lengths at poses, by numpy alone."""
    arms = np.einsum('...jk,ik->...ij', rotation, p['geometry.platform_joints'])
    lengths: Array = np.linalg.norm(
        position[..., None, :] + arms - p['geometry.base_joints'], axis=-1)
    return lengths


def away(pose: Any, random: np.random.Generator, distance: float, angle: float) -> Pose:
    """Return guesses so far from poses, in any direction and about any axis."""
    way, axis = random.normal(size=(2, len(pose.position), 3))
    way *= distance / np.linalg.norm(way, axis=-1, keepdims=True)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    k = np.cross(axis[:, None], np.eye(3)).swapaxes(-1, -2)  # Rodrigues
    turn = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)
    return Pose(pose.position + way, turn @ pose.rotation)


def legal_poses(p: Parameters, random: np.random.Generator, many: int) -> Pose:
    """Return poses of the whole workspace: lengths within limits, angles up to 20, 20, 30 deg."""
    position = np.array(HOME) + random.uniform(-0.6, 0.6, (20 * many, 3))
    rotation = from_euler(random.uniform(-1.0, 1.0, (20 * many, 3)) * np.radians([20, 20, 30]))
    lengths = independent_lengths(p, position, rotation)
    legal = np.flatnonzero(np.all(
        (lengths >= p['limits.length_min']) & (lengths <= p['limits.length_max']), axis=-1))
    assert len(legal) >= many
    return Pose(position[legal[:many]], rotation[legal[:many]])


@pytest.mark.parametrize('seed', range(15))
def test_the_pose_is_found_from_lengths_and_the_twist_from_rates(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion = random_motion(p, random, 20)
    truth = platform.inverse_dynamics(motion)
    found = platform.forward_kinematics(
        truth.lengths, away(motion, random, 0.1 * size_of(p), 0.1))
    assert np.max(np.abs(found.position - motion.position)) < 1e-12 * size_of(p)
    assert np.max(np.abs(found.rotation - motion.rotation)) < 1e-12
    lengths = independent_lengths(p, found.position, found.rotation)
    assert np.max(np.abs(lengths - truth.lengths)) < RESIDUAL
    twist = platform.twist(found, truth.rates)
    assert twist == pytest.approx(motion.rows[:, 12:18], rel=1e-11, abs=1e-11 * size_of(p))
    rates = np.einsum('nij,nj->ni', platform.inverse_jacobian(found), twist)
    assert rates == pytest.approx(truth.rates, rel=1e-12, abs=1e-12 * size_of(p))


@pytest.mark.slow
def test_from_far_it_takes_six_steps_at_most_and_never_ends_at_another_pose(
        hexapod: StewartPlatform) -> None:
    p, random, many = hexapod.parameters, rng(), 30_000
    poses = legal_poses(p, random, many)
    guess = away(poses, random, 0.2 * HOME[2], 0.2)
    lengths = independent_lengths(p, poses.position, poses.rotation)
    rows = Motion.from_pose(guess).rows.copy()
    codes, steps, residuals = (np.empty(many, dtype=np.int64), np.empty(many, dtype=np.int64),
                               np.empty(many))
    forward_kinematics.poses(hexapod.structure, lengths, rows, codes, steps, residuals)
    found = codes == FOUND
    assert np.mean(found & (steps <= 6)) > 0.999
    assert np.max(residuals[found]) <= RESIDUAL
    assert np.max(np.abs(independent_lengths(
        p, rows[found, :3], rows[found, 3:12].reshape(-1, 3, 3)) - lengths[found])) <= RESIDUAL
    # A guess on the other side of a singularity gives an assembly of that side, if any.
    same_side = (np.sign(np.linalg.det(hexapod.inverse_jacobian(poses)))
                 == np.sign(np.linalg.det(hexapod.inverse_jacobian(guess))))
    assert 0.999 < np.mean(same_side) < 1.0
    assert np.all(found[same_side])
    assert np.max(np.abs(rows[same_side, :12] - poses.rows[same_side])) < 1e-10
    # Where no pose is found the guess is unchanged.
    assert np.array_equal(rows[~found], Motion.from_pose(guess).rows[~found])


def test_the_assembly_of_the_guess_is_kept(hexapod: StewartPlatform) -> None:
    # Base and platform joints of this hexapod lie in planes: mirrored in the base's, the pose
    # has the same lengths, and its det(J) the other sign.
    position, rotation = np.array([0.1, -0.05, 1.15]), from_euler([0.1, -0.2, 0.3])
    mirror = np.diag([1.0, 1.0, -1.0])
    below = Pose(mirror @ position, mirror @ rotation @ mirror)
    lengths = hexapod.inverse_kinematics(Pose(position, rotation))
    assert np.allclose(hexapod.inverse_kinematics(below), lengths, atol=1e-15)
    for pose in (Pose(position, rotation), below):
        guess = Pose(pose.position + [0.05, 0.05, -0.08],
                     pose.rotation @ from_euler([0.1, 0.0, 0.1]))
        found = hexapod.forward_kinematics(lengths, guess)
        assert np.max(np.abs(found.position - pose.position)) < 1e-13
        assert np.max(np.abs(found.rotation - pose.rotation)) < 1e-13


def test_from_a_rotation_that_has_drifted_the_pose_found_has_a_rotation(
        hexapod: StewartPlatform) -> None:
    random = rng()
    for _ in range(20):
        pose = Pose(HOME, rotation_about(random_direction(random), random.uniform(0.0, 0.3)))
        drifted = Motion.from_pose(pose).rows[None].copy()
        drifted[0, 3:12] += 1e-5 * random.normal(size=9)
        code, steps, residual = np.empty(1, int), np.empty(1, int), np.empty(1)
        forward_kinematics.poses(hexapod.structure, hexapod.inverse_kinematics(pose)[None],
                                 drifted, code, steps, residual)
        assert code[0] == FOUND
        found = drifted[0, 3:12].reshape(3, 3)
        assert np.abs(found.T @ found - np.eye(3)).max() < 1e-15
        assert np.abs(found - pose.rotation).max() < 1e-12


def test_the_search_does_not_cross_a_singularity() -> None:
    # Turned by 90 degrees about its axis this hexapod is singular, and there the squares of the
    # lengths of even and odd legs differ most.
    platform = StewartPlatform(symmetric_parameters())

    def turned(degrees: float) -> Pose:
        return Pose(np.array([0.0, 0.0, 1.0]), from_euler([0.0, 0.0, np.radians(degrees)]))

    lengths = platform.inverse_kinematics(turned(100.0))
    for guess in (91.0, 105.0, 120.0):
        found = platform.forward_kinematics(lengths, turned(guess))
        assert np.max(np.abs(found.rotation - turned(100.0).rotation)) < 1e-10
    for guess in (89.0, 80.0, 60.0):  # another assembly has these lengths on this side
        found = platform.forward_kinematics(lengths, turned(guess))
        assert np.max(np.abs(found.rotation - turned(80.0).rotation)) < 1e-10
        assert np.max(np.abs(platform.inverse_kinematics(found) - lengths)) < RESIDUAL
    squares = platform.inverse_kinematics(turned(90.0)) ** 2
    beyond = np.sqrt(squares + 0.01 * np.sign(squares - squares.mean()))
    for guess in (85.0, 95.0):
        with pytest.raises(PoseError):
            platform.forward_kinematics(beyond, turned(guess))


def test_a_pose_near_singularities_is_found_from_every_guess_on_its_side() -> None:
    """Turned by 60 to 90 degrees; Newton's method alone missed 14 of these 9,500."""
    platform = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')
    home, random, count = platform.home_pose(), np.random.default_rng(5), 10_000
    yaw = np.radians(random.uniform(60.0, 90.0, count)) * random.choice([-1.0, 1.0], count)
    turned = Rotation.from_euler('z', yaw[:, None]) * Rotation.from_rotvec(
        random.uniform(-0.1, 0.1, (count, 3)))
    poses = Pose(home.position + random.uniform(-0.1, 0.1, (count, 3)), turned.as_matrix())
    away, about = (axes / np.linalg.norm(axes, axis=1)[:, None]
                   for axes in random.normal(size=(2, count, 3)))
    guesses = Pose(poses.position + 0.1 * home.position[2] * away,
                   (Rotation.from_rotvec(0.1 * about) * turned).as_matrix())
    sides = [np.sign(np.linalg.det(platform.inverse_jacobian(each))) for each in (poses, guesses)]
    same = sides[0] == sides[1]
    assert same.sum() > 9000
    lengths = platform.inverse_kinematics(poses)[same]
    rows = Motion(guesses.position[same], guesses.rotation[same]).rows.copy()
    codes, steps = np.empty((2, len(rows)), dtype=np.int64)
    residuals = np.empty(len(rows))
    forward_kinematics.poses(platform.structure, lengths, rows, codes, steps, residuals)
    assert np.all(codes == FOUND)
    assert residuals.max() <= RESIDUAL
    assert np.abs(rows[:, :12] - Motion.from_pose(poses).rows[same, :12]).max() < 1e-9


def test_a_singular_guess_is_rejected(snapshot: Snapshot) -> None:
    platform = StewartPlatform(symmetric_parameters())
    lengths = platform.inverse_kinematics(Pose([0.0, 0.0, 1.0], np.eye(3)))
    singular = Pose([0.0, 0.0, 1.0], QUARTER_TURN)
    with snapshot.raises(SingularityError):
        platform.forward_kinematics(lengths, singular)
    with snapshot.raises(SingularityError):
        platform.twist(singular, np.ones(6))


@pytest.mark.parametrize('lengths', [
    [9.0, 1.0, 1.0, 1.0, 1.0, 1.0],  # two neighbouring legs cannot differ by more than a triangle
    [0.0] * 6, [-1.2] * 6, [1e-300] * 6, [1e200] * 6, [5.0, 0.1, 5.0, 0.1, 5.0, 0.1]])
def test_lengths_without_a_pose_are_an_error(
        hexapod: StewartPlatform, lengths: Any, snapshot: Snapshot) -> None:
    with snapshot.raises(PoseError):
        hexapod.forward_kinematics(lengths, AT_HOME)


def test_lengths_without_a_pose_are_named_in_a_batch(hexapod: StewartPlatform) -> None:
    lengths = hexapod.inverse_kinematics(AT_HOME)
    with pytest.raises(PoseError) as error:
        hexapod.forward_kinematics(
            [lengths, lengths + [0.9, -0.3, 0.0, 0.0, 0.0, 0.0]], AT_HOME)
    assert str(error.value).startswith('sample 1: lengths [')
    assert str(error.value).endswith('iterations, must be at most 1e-12')
    assert 'did not converge: residual ' in str(error.value)


def test_lengths_outside_the_limits_are_named_before_the_residual() -> None:
    platform = StewartPlatform(symmetric_parameters().replaced({
        'limits.length_min': 0.9, 'limits.length_max': 1.5}))
    guess = Pose([1.0 / 3.0, -3e-18, 1.0], np.eye(3))
    with pytest.raises(PoseError) as error:
        platform.forward_kinematics([0.1] * 6, guess)
    assert str(error.value).startswith(
        'sample 0: lengths [0.1, 0.1, 0.1, 0.1, 0.1, 0.1] m from the guess [0.333333, 0, 1] m: '
        'leg_1: length 0.1 m is 0.8 m below limits.length_min; did not converge: residual ')


def test_a_guess_is_a_motion_or_a_pose(hexapod: StewartPlatform) -> None:
    truth = Pose(np.array([0.1, 0.0, 1.2]), from_euler([0.1, 0.0, -0.1]))
    lengths = hexapod.inverse_kinematics(truth)
    found = [hexapod.forward_kinematics(lengths, each) for each in (
        AT_HOME, Motion.from_pose(AT_HOME, [1.0, 2.0, 3.0]))]
    for pose in found:
        assert np.array_equal(pose.position, found[0].position)
        assert np.max(np.abs(pose.rotation - truth.rotation)) < 1e-14
    assert np.max(np.abs(hexapod.forward_kinematics(lengths, found[0]).position
                         - truth.position)) < 1e-15


def test_without_a_home_pose_the_error_names_the_guess(snapshot: Snapshot) -> None:
    platform = StewartPlatform(symmetric_parameters().replaced({
        'limits.length_min': None, 'limits.length_max': None, 'geometry.zero_length': 0.0}))
    with snapshot.raises(ParameterError):
        platform.forward_kinematics(np.ones(6))
