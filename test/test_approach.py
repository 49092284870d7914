# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motions from rest to rest, and the approach to the first point of a planned trajectory."""

from __future__ import annotations

from typing import Any

import messages
import numpy as np
import pytest
from snapshot import Snapshot
from stewart_dynamics import (
    approach, check_planned_trajectory, Motion, MotionError, Pose, rest_to_rest, StewartPlatform)
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.planned import trajectory_messages as planned
from stewart_dynamics.planned.trajectory_messages import PlannedOutcome
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from trajectories import Array, decoded, PARAMETERS, rows_of, STAMP

PLATFORM = StewartPlatform(PARAMETERS)
HOME = PLATFORM.home_pose()
START = [0.1, -0.05, 1.2, 0.0, 0.1, 0.3]


def test_a_motion_from_rest_to_rest_is_the_quintic_reference_motion() -> None:
    there = Pose.from_euler(START[:3], START[3:])
    times, motion = rest_to_rest(HOME, there, 2.0, rate=50.0)
    assert times.tolist() == pytest.approx(np.linspace(0.0, 2.0, 101).tolist())
    reference = motion_at(ReferenceMotionParameters({
        'motion.type': 'quintic', 'motion.duration': 2.0, 'motion.final': START,
        'motion.initial': [*HOME.position.tolist(), 0.0, 0.0, 0.0]}), times)
    assert np.abs(motion.rows - reference.rows).max() < 1e-13
    assert np.all(motion.rows[[0, -1], 12:] == 0.0)


@pytest.mark.parametrize('arguments', [
    (HOME, HOME, 0.0),
    (HOME, HOME, 1.0, -1.0),
    (HOME, HOME, 1e6),
    (HOME, 'home', 1.0),
    (Pose(np.zeros((2, 3)), np.eye(3)), HOME, 1.0)])
def test_arguments_that_do_not_fit_are_errors(
        arguments: tuple[Any, ...], snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        rest_to_rest(*arguments)


@pytest.mark.parametrize('velocity', [0.5, 0.01, None])
def test_an_approach_is_within_all_limits_and_ends_in_the_first_point(
        velocity: float | None) -> None:
    platform = StewartPlatform(PARAMETERS.replaced({'limits.velocity_max': velocity}))
    end = Motion.from_euler(START[:3], START[3:], [0.002, 0.0, -0.001], [0.0, 0.003, 0.0])
    times, motion = approach(platform, HOME, end)
    assert check_planned_trajectory(platform, times, motion).accepted
    assert np.allclose(np.diff(times), 0.01, rtol=0.0, atol=1e-12)  # as a stream needs them
    assert np.array_equal(motion.rows[-1], end.rows)
    assert np.array_equal(motion.rows[0, :12], HOME.rows)
    assert not motion.rows[0, 12:].any()
    if velocity is not None:
        rates = np.abs(platform.inverse_dynamics(motion).rates)
        assert 0.3 * velocity < rates.max() <= velocity


def test_an_approach_slows_down_until_forces_are_within_their_limit() -> None:
    end = Pose.from_euler([0.0, 0.0, 1.3], [0.0, 0.0, 0.0])
    at_rest = np.abs(PLATFORM.inverse_dynamics(Motion.from_pose(end)).forces).max()
    limited = StewartPlatform(PARAMETERS.replaced({'limits.force_max': [1.15 * at_rest]}))
    assert approach(limited, HOME, end).times[-1] > 1.4 * approach(PLATFORM, HOME, end).times[-1]


@pytest.mark.parametrize(('limit', 'value'), [
    ('drive.speed_max', 100.0), ('drive.torque_max', 1.0),
    ('drive.torque_speed', [0.0, 5.0, 100.0, 5.0])])
def test_an_approach_slows_down_until_motors_are_within_their_limits(
        limit: str, value: Any) -> None:
    fast = PARAMETERS.replaced({'limits.velocity_max': 2.0, 'limits.force_max': None,
                                'actuator.screw_lead': 0.01})
    end = Pose.from_euler([0.0, 0.0, 1.3], [0.0, 0.0, 0.0])
    platform = StewartPlatform(fast.replaced({limit: value}))
    times, motion = approach(platform, HOME, end)
    assert check_planned_trajectory(platform, times, motion).accepted
    assert times[-1] > 1.4 * approach(StewartPlatform(fast), HOME, end).times[-1]


@pytest.mark.parametrize('end', [
    Pose([0.0, 0.0, 2.5], np.eye(3)),
    Pose.from_euler([0.0, 0.0, 1.1], [0.0, 0.0, np.pi / 2.0])])
def test_an_approach_that_no_speed_allows_is_rejected(end: Pose, snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        approach(PLATFORM, HOME, end)


def outcome(mode: str, measured: Array | None) -> PlannedOutcome:
    """Return the outcome of a motion that begins in START."""
    there = Pose.from_euler(START[:3], START[3:])
    times, motion = rest_to_rest(there, HOME, 2.0)
    data = messages.trajectory(STAMP, np.rint(times * 1e9).astype(int).tolist(), rows_of(motion))
    *_, found = planned.answer(
        PARAMETERS.replaced({'trajectory.approach': mode}), NO_WRENCH, data,
        measured=None if measured is None else measured.tolist())
    assert found is not None
    return found


def at(pose: Pose) -> Array:
    return np.array(Motion.from_pose(pose).rows)


def test_by_default_a_trajectory_may_start_anywhere() -> None:
    assert not outcome('ignore', None).reason
    assert outcome('ignore', None).answer == outcome('ignore', at(HOME)).answer


@pytest.mark.parametrize('mode', ['check', 'prepend'])
def test_without_measured_legs_a_start_that_is_to_be_checked_is_rejected(mode: str) -> None:
    assert outcome(mode, None).reason == planned.NOT_MEASURED


@pytest.mark.parametrize('mode', ['check', 'prepend'])
def test_a_trajectory_that_starts_at_the_legs_is_answered_as_it_is(mode: str) -> None:
    near = Pose.from_euler([0.101, -0.05, 1.2], START[3:])
    assert outcome(mode, at(near)).answer == outcome('ignore', None).answer


def test_a_trajectory_that_starts_elsewhere_is_rejected() -> None:
    found = outcome('check', at(HOME))
    assert found.reason == planned.STARTS_ELSEWHERE
    assert found.message.endswith('more than 0.006 m')


def test_an_approach_is_put_before_a_trajectory_that_starts_elsewhere() -> None:
    found = outcome('prepend', at(HOME))
    assert not found.reason
    points = decoded(found).points
    times = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
                      for point in points])
    positions, velocities = (
        np.array([getattr(point, field) for point in points])
        for field in ('positions', 'velocities'))
    there = Pose.from_euler(START[:3], START[3:])
    before = approach(PLATFORM, HOME, there)
    count = len(before.times)
    assert len(times) == count + 200
    assert np.all(np.diff(times) > 0)
    assert times[count - 1] == pytest.approx(before.times[-1], abs=1e-9)
    zero = PARAMETERS['geometry.zero_length']
    for index, pose in ((0, HOME), (count - 1, there), (-1, HOME)):
        assert np.allclose(positions[index] + zero, PLATFORM.inverse_kinematics(pose))
        assert np.allclose(velocities[index], 0.0, atol=1e-12)


def test_a_trajectory_without_an_approach_is_rejected() -> None:
    found = outcome('prepend', at(Pose([0.0, 0.0, 2.5], np.eye(3))))
    assert found.reason == planned.NO_APPROACH
    assert 'limits.length_max' in found.message
