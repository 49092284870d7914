# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Angles of the joints: their definition, their axes, and where a limit of them is checked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from referees import (
    Array, random_motion, random_parameters, rng, rotation_about, smooth_motion,
    symmetric_parameters)
from snapshot import Snapshot

from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.joint_angles import JointAngles
from stewart_dynamics.mechanics.kinematics.joint_axes import AXES, BASE_AXES, PLATFORM_AXES
from stewart_dynamics.mechanics.limits import BASE_ANGLE_MAX, OF_JOINTS, PLATFORM_ANGLE_MAX
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.planned.checks import LIMIT
from stewart_dynamics.planned.planned_trajectory import check_planned_trajectory
from stewart_dynamics.setpoints.step import Batch, Step
from test_step import each_alone

SYMMETRIC = symmetric_parameters().replaced({'geometry.zero_length': 1.1})


def between(a: Array, b: Array) -> Array:
    """Return the angles between vectors (..., 3), of any length, by atan2 of sine and cosine."""
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(sine, (a * b).sum(axis=-1))


def expected(p: Parameters, motion: Motion, base_axes: Array, platform_axes: Array) -> Array:
    """Return the angles (N, 2, 6): of base joints, of platform joints."""
    turned = np.einsum('nij,kj->nki', motion.rotation, p['geometry.platform_joints'])
    legs = motion.position[:, None] + turned - p['geometry.base_joints']
    in_platform = np.einsum('nji,nkj->nki', motion.rotation, legs)
    return np.stack([between(legs, base_axes), between(in_platform, platform_axes)], axis=1)


def with_axes(p: Parameters, random: np.random.Generator, **changes: Any) -> Parameters:
    return p.replaced({BASE_AXES: random.normal(size=18), PLATFORM_AXES: random.normal(size=18),
                       **changes})


# The angles

def test_joint_angles_are_those_between_legs_and_given_axes() -> None:
    random = rng()
    for _ in range(5):
        p = with_axes(random_parameters(random), random)
        motion = random_motion(p, random, 200)
        base, platform = StewartPlatform(p).joint_angles(motion)
        truth = expected(p, motion, p[BASE_AXES], p[PLATFORM_AXES])
        np.testing.assert_allclose(base, truth[:, 0], rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(platform, truth[:, 1], rtol=0.0, atol=1e-14)
        assert base.max() > 2.0  # some of them away from their axes


def test_by_default_they_are_measured_from_the_legs_at_home() -> None:
    random = rng()
    for p in (SYMMETRIC, SYMMETRIC.replaced({  # a home that is turned about the normal
            'limits.length_min': 1.28, 'limits.length_max': 1.32})):
        platform = StewartPlatform(p)
        home = platform.home_pose()
        legs = home.position + p['geometry.platform_joints'] @ home.rotation.T \
            - p['geometry.base_joints']
        for angles in platform.joint_angles(home):
            assert np.abs(angles).max() < 1e-15
        motion = random_motion(p, random, 50)
        truth = expected(p, motion, legs, legs @ home.rotation)
        for angles, each in zip(platform.joint_angles(motion), truth.swapaxes(0, 1), strict=True):
            np.testing.assert_allclose(angles, each, rtol=0.0, atol=1e-14)


def test_small_angles_keep_their_digits() -> None:
    home = StewartPlatform(SYMMETRIC).home_pose()
    for turn in (1e-3, 1e-6, 1e-9):
        # About the platform joint of a leg: its direction stays, the platform turns.
        axis = np.array([0.0, 0.0, 1.0])
        joint = SYMMETRIC['geometry.platform_joints'][0]
        rotation = rotation_about(axis, turn)
        pose = Pose(home.position + joint - rotation @ joint, rotation)
        base, platform = StewartPlatform(SYMMETRIC).joint_angles(pose)
        leg = home.position + joint - SYMMETRIC['geometry.base_joints'][0]
        leg /= np.linalg.norm(leg)
        wanted = 2.0 * math.asin(math.sin(0.5 * turn) * math.hypot(leg[0], leg[1]))
        assert platform[0] == pytest.approx(wanted, rel=1e-6)
        assert base[0] < 1e-15


def test_their_haversines_have_the_derivatives_in_time() -> None:
    random = rng()
    p = with_axes(random_parameters(random), random)
    angles, at = JointAngles(p), smooth_motion(p, random)
    times, step = np.linspace(0.0, 1.0, 30), 1e-5
    values, rates = angles.haversines(at(times).rows)
    np.testing.assert_allclose(
        values, np.sin(0.5 * angles(at(times).rows)) ** 2, rtol=0.0, atol=1e-15)
    before, after = (angles.haversines(at(times + d).rows)[0] for d in (-step, step))
    np.testing.assert_allclose(rates, (after - before) / (2.0 * step), rtol=0.0, atol=1e-7)
    assert np.abs(rates).max() > 0.1


@pytest.mark.parametrize('scale', [1e-200, 1e200])
def test_axes_may_have_any_length(scale: float) -> None:
    random = rng()
    p = with_axes(SYMMETRIC, random)
    scaled = p.replaced({name: scale * p[name] for name in AXES})
    np.testing.assert_allclose(
        JointAngles(scaled).axes, JointAngles(p).axes, rtol=0.0, atol=1e-15)


# Parameters

@pytest.mark.parametrize('changes', [
    {BASE_ANGLE_MAX: 25.0},
    {PLATFORM_ANGLE_MAX: 0.0},
    {BASE_AXES: [0.0, 0.0, 1.0] * 5 + [0.0] * 3},
    {PLATFORM_AXES: [0.0, 0.0, 1.0]},
])
def test_bad_axes_and_limits_are_rejected(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        SYMMETRIC.replaced(changes)


def test_a_limit_needs_axes_or_a_home_pose(snapshot: Snapshot) -> None:
    homeless = symmetric_parameters()
    for limit, axes in zip(OF_JOINTS, AXES, strict=True):
        limited = homeless.replaced({limit: 0.5}, 'a.yaml')
        with snapshot.raises(ParameterError):
            Step(limited)
        # The other axes are not needed.
        Step(limited.replaced({axes: [0.0, 0.0, 1.0] * 6}))
    Step(homeless)
    with snapshot.raises(ParameterError):
        StewartPlatform(homeless).joint_angles(Pose([0.0, 0.0, 1.0], np.eye(3)))


@pytest.mark.parametrize('changes', [
    {BASE_ANGLE_MAX: 2.5},
    {PLATFORM_AXES: [0.0, 0.0, -1.0] * 6},
    {BASE_AXES: [0.0, 0.0, 1.0] * 6, BASE_ANGLE_MAX: 0.3},
])
def test_possible_errors_are_found(changes: dict[str, Any], snapshot: Snapshot) -> None:
    assert find_parameter_errors(SYMMETRIC) == ()
    error, = find_parameter_errors(SYMMETRIC.replaced(changes))
    snapshot(error)


# Where they are checked

def moved() -> tuple[Motion, Array]:
    """Return a motion whose angles grow from zero, and its angles."""
    position = StewartPlatform(SYMMETRIC).home_pose().position
    turns = np.linspace(0.0, 0.5, 101)
    motion = Motion(
        np.broadcast_to(position, (101, 3)),
        [rotation_about([1.0, 0.0, 0.0], turn) for turn in turns])
    return motion, np.concatenate(StewartPlatform(SYMMETRIC).joint_angles(motion), axis=1)


def test_the_step_reports_angles_above_their_limit_for_one_and_for_many() -> None:
    motion, angles = moved()
    base, platform = 0.9 * angles[:, :6].max(), 0.8 * angles[:, 6:].max()
    step = Step(SYMMETRIC.replaced({BASE_ANGLE_MAX: base, PLATFORM_ANGLE_MAX: platform}))
    setpoints = Batch.from_parts(np.arange(101), motion.rows)
    many = step(setpoints)
    assert np.array_equal(many.joint_angles, angles)
    for n, (output, found) in enumerate(each_alone(step, setpoints)):
        assert output.joint_angles.tobytes() == angles[n].tobytes()
        assert [(each.limit, each.leg, each.value, each.bound) for each in found] == [
            *((BASE_ANGLE_MAX, leg, angles[n, leg], base) for leg in range(6)
              if angles[n, leg] > base),
            *((PLATFORM_ANGLE_MAX, leg, angles[n, 6 + leg], platform) for leg in range(6)
              if angles[n, 6 + leg] > platform)]
        assert many.exceeding[n] == bool(found)
    assert 5 < many.exceeding.sum() < 60


def swing(points: int, turn: float = 0.4) -> tuple[Array, Motion, Any]:
    """Return times and points of a swing about x and back, and the swing as a function."""
    position = StewartPlatform(SYMMETRIC).home_pose().position

    def at(times: Any) -> Motion:
        times = np.asarray(times, dtype=float)
        phase = np.pi * times
        angle, rate = 0.5 * turn * (1.0 - np.cos(2.0 * phase)), np.pi * turn * np.sin(2.0 * phase)
        acceleration = 2.0 * np.pi ** 2 * turn * np.cos(2.0 * phase)
        x = np.array([1.0, 0.0, 0.0])
        return Motion(np.broadcast_to(position, (*times.shape, 3)),
                      [rotation_about(x, each) for each in angle],
                      np.zeros(3), rate[:, None] * x, np.zeros(3), acceleration[:, None] * x)

    times = np.linspace(0.0, 1.0, points)
    return times, at(times), at


@pytest.mark.parametrize('limit', OF_JOINTS)
def test_a_planned_trajectory_is_rejected_for_an_angle_between_its_points(limit: str) -> None:
    times, motion, at = swing(4)  # the peak at 0.5 s is between the points
    first = 0 if limit == BASE_ANGLE_MAX else 6
    angles = JointAngles(SYMMETRIC)
    points = angles(motion.rows)[:, first:first + 6].max()
    dense = np.linspace(0.0, 1.0, 20001)
    peak = angles(at(dense).rows)[:, first:first + 6]
    assert points < 0.9 * peak.max()
    # The motion between the points is not quite the swing; it is nearly as far at the peak.
    bound = 0.9 * peak.max()
    result = check_planned_trajectory(
        StewartPlatform(SYMMETRIC.replaced({limit: bound})), times, motion)
    assert (result.accepted, result.reason, result.limit) == (False, LIMIT, limit)
    assert 'joint angle' in result.message
    assert result.time == pytest.approx(dense[(peak > bound).any(axis=1).argmax()], abs=0.02)
    accepted = check_planned_trajectory(
        StewartPlatform(SYMMETRIC.replaced({limit: 1.2 * peak.max()})), times, motion)
    assert accepted.accepted


@pytest.mark.parametrize('limit', OF_JOINTS)
def test_the_peak_of_an_angle_between_close_points_is_found(limit: str) -> None:
    # 0.1 ms from the peak at 0.5 s, so near that nothing is sampled between them.
    _, _, at = swing(2)
    times = np.array([0.0, 1e-3, 2e-3])
    motion = at(times - 0.0006 + 0.5)
    first = 0 if limit == BASE_ANGLE_MAX else 6
    angles = JointAngles(SYMMETRIC)
    points = angles(motion.rows)[:, first:first + 6].max()
    peak = angles(at(np.array([0.5])).rows)[0, first:first + 6].max()
    assert points < peak * (1.0 - 1e-7)
    for bound, accepted in ((0.5 * (points + peak), False), (peak * (1.0 + 1e-8), True)):
        result = check_planned_trajectory(
            StewartPlatform(SYMMETRIC.replaced({limit: bound})), times, motion)
        assert result.accepted is accepted, result.message
        if not accepted:
            assert result.time == pytest.approx(0.0006, abs=1e-5)
            assert result.leg == int(angles(at(np.array([0.5])).rows)[
                0, first:first + 6].argmax())
