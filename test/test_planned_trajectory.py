# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Planned trajectories: what the legs do, to the last bit, and all that is rejected."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
import math

import numpy as np
import pytest
from referees import (
    derivative, random_direction, random_parameters, rng, rotation_about, scaled, size_of)
from scipy.interpolate import CubicHermiteSpline
from simulated import simulated, UNLIMITED
from snapshot import Snapshot
from stewart_dynamics import BaseMotion, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.mechanics.frames.rotation import from_quaternion, to_quaternion
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, JOINT_FORCES, LENGTHS, POSITION, RATES)
from stewart_dynamics.planned.checks import LIMIT, SINGULAR
from stewart_dynamics.planned.interpolation import Interpolation
from stewart_dynamics.planned.planned_trajectory import check_planned_trajectory, PlannedTrajectory
from stewart_dynamics.setpoints.step import Batch, Step
from stewart_dynamics.simulator.plant import Plant
from trajectories import (
    Array, counted, FREE, HOME, motion_of, PARAMETERS, REST, sampled, SECOND, some, UNBOUND)

Trajectory = tuple[Sequence[int], Array]  # times [ns], and rows as in trajectories


def check(trajectory: Trajectory, parameters: Parameters = PARAMETERS) -> PlannedTrajectory:
    """Return the result of the check of a trajectory."""
    times, rows = trajectory
    result = check_planned_trajectory(
        StewartPlatform(parameters), np.array(times) * 1e-9, motion_of(np.array(rows)))
    points = len(times) if result.accepted else 0
    assert result.lengths.shape == result.rates.shape == result.forces.shape == (points, 6)
    assert result.accepted != bool(result.reason)
    assert result.message.startswith('accepted: ' if result.accepted else 'rejected: ')
    return result


# Accepted

def test_at_the_points_the_legs_are_those_of_inverse_dynamics() -> None:
    times, rows = some(700)
    motion, platform = motion_of(rows), StewartPlatform(PARAMETERS)
    wrench = (100.0, -50.0, -300.0, 20.0, 10.0, -5.0)
    result = check_planned_trajectory(platform, np.array(times) * 1e-9, motion, wrench)
    expected = platform.inverse_dynamics(motion, wrench)
    assert result.accepted
    assert result.points == 700
    assert result.duration == pytest.approx((times[-1] - times[0]) * 1e-9)
    assert np.array_equal(result.lengths, expected.lengths)
    assert np.array_equal(result.rates, expected.rates)
    assert np.array_equal(result.forces, expected.forces)
    # Between the points there is no more than a little to come.
    assert 1.0 <= result.force / np.abs(expected.forces).max() < 1.01
    assert result.load == pytest.approx(result.force / 6000.0)
    assert 1.0 <= result.condition_number / expected.condition_number.max() < 1.01
    assert np.isnan(result.time)
    assert result.leg is None


@pytest.mark.parametrize('change', [
    {'times': [0.0, 1.0, 1.0, 2.0]},
    {'times': [0.0, 1.0, 1.0 + 1e-10, 2.0]},
    {'times': [-1.0, 1.0, 2.0, 3.0]},
    {'times': [0.0, 1.0, 2.0, 1e10]},
    {'times': [0.0, 1.0, np.nan, 2.0]},
    {'times': [0.0, 1.0, 2.0]},
    {'times': [[0.0, 1.0, 2.0, 3.0]]},
    {'motion': Motion([0.0, 0.0, 1.1], np.eye(3))},
    {'motion': np.zeros((4, 24))},
    {'wrench': np.zeros((4, 6))},
    {'wrench': np.zeros(5)},
    {'base': np.zeros(12)},
    {'base': BaseMotion(np.zeros((3, 3)))}], ids=str)
def test_arguments_that_do_not_fit_are_errors(
        change: dict[str, object], snapshot: Snapshot) -> None:
    arguments = {'times': [0.0, 1.0, 2.0, 3.0], 'wrench': None,
                 'motion': Motion(np.tile([0.0, 0.0, 1.1], (4, 1)), np.eye(3)), **change}
    with snapshot.raises(MotionError):
        check_planned_trajectory(StewartPlatform(PARAMETERS), **arguments)


# Rejected

def between_points(times: Sequence[int], rows: Array, count: int = 4001) -> tuple[Array, Array]:
    """Return times [s], dense between points, and the results of the platform's motion there."""
    seconds = np.array(times) * 1e-9
    motion = motion_of(rows)
    between = Interpolation(np.diff(seconds), motion.rows)
    part = np.linspace(0.0, 1.0, count)
    both = [(begin + part * (end - begin), between.at(np.full(len(part), n), part))
            for n, (begin, end) in enumerate(pairwise(seconds))]
    return np.concatenate([each[0] for each in both]), StewartPlatform(FREE).solve(
        np.concatenate([each[1] for each in both]))


def cubic_between(times: Sequence[int], rows: Array) -> tuple[Array, Array, Array]:
    """Return times, lengths and rates of the controller's cubics, densely, by scipy."""
    result = StewartPlatform(FREE).inverse_dynamics(motion_of(rows))
    cubic = CubicHermiteSpline(np.array(times) * 1e-9, result.lengths, result.rates)
    dense = np.linspace(times[0] * 1e-9, times[-1] * 1e-9, 8001)
    return dense, cubic(dense), cubic(dense, 1)


def heave(way: float, rate: float = 0.0, acceleration: float = 0.0, end_rate: float = 0.0,
          end_acceleration: float = 0.0) -> Array:
    """Return two points one above the other."""
    rows = np.zeros((2, 19))
    rows[:, :7] = HOME
    rows[1, 2] += way
    rows[:, 9] = rate, end_rate
    rows[:, 15] = acceleration, end_acceleration
    return rows


TIMES = [0, SECOND]
# up and back down: a controller's cubic goes rate / 4 high; the platform 5 / 16 rate higher at
# no acceleration, and half of that less at one that brakes harder than it must
LEAPS = {'platform': heave(0.0, 0.3, 0.0, -0.3, 0.0), 'legs': heave(0.0, 0.3, -1.2, -0.3, -1.2)}
STEPS = {'platform': heave(0.15), 'legs': heave(0.15, 0.0, 1.2, 0.0, -1.2)}


@pytest.mark.parametrize('whose', ['platform', 'legs'])
@pytest.mark.parametrize(('limit', 'sign', 'of', 'words'), [
    ('limits.length_max', 1.0, LEAPS, 'length'), ('limits.length_min', -1.0, LEAPS, 'length'),
    ('limits.velocity_max', 1.0, STEPS, 'rate')])
def test_a_limit_exceeded_between_points_alone_is_found(
        whose: str, limit: str, sign: float, of: dict[str, Array], words: str) -> None:
    rows = of[whose].copy()
    rows[:, 7:] *= sign
    dense, results = between_points(TIMES, rows)
    cubic_dense, lengths, rates = cubic_between(TIMES, rows)
    values = {'platform': sign * results[:, RATES if words == 'rate' else LENGTHS],
              'legs': sign * (rates if words == 'rate' else lengths)}
    highest, other = sorted((each.max() for each in values.values()), reverse=True)
    assert values[whose].max() == highest > other + 1e-3
    bound = 0.5 * (highest + other)
    result = check((TIMES, rows), FREE.replaced({limit: [sign * bound]}))
    assert result.reason == LIMIT
    time, leg = result.time, result.leg
    broken = {'platform': dense, 'legs': cubic_dense}[whose][values[whose][:, leg] > bound]
    assert broken[0] - (1e-3 if words == 'length' else 0.0) <= time <= broken[-1]
    assert f'at {time:.3f} s leg_{leg + 1}: {words} ' in result.message
    assert f' {limit}' in result.message
    # A limit that neither exceeds.
    wide = sign * (highest + min(0.01 * abs(highest), highest - other))
    assert check((TIMES, rows), FREE.replaced({limit: [wide]})).accepted


def random_trajectory(parameters: Parameters, random: np.random.Generator) -> tuple[Array, Motion]:
    """Return 2 to 5 points, 1e-4 to 0.2 of the size apart, at rest or not; 3 mm/s^2 and more."""
    size, points = size_of(parameters), int(random.integers(2, 6))
    step = size * 10.0 ** random.uniform(-4.0, -0.7)
    duration = np.sqrt(step / 10.0 ** random.uniform(-2.5, 1.0)) * random.uniform(1.0, 4.0)
    times = duration * np.cumsum([0.0, *random.uniform(0.5, 1.5, points - 1)])
    times = np.rint(1e9 * times) * 1e-9
    center = size * (np.array([0.0, 0.0, 1.0]) + 0.1 * random.normal(size=3))
    turn = rotation_about(random_direction(random), random.uniform(0.0, 0.4))
    rotations = [rotation_about(random_direction(random), random.uniform(0.0, step / size)) @ turn
                 for _ in range(points)]
    at_rest, steady = random.integers(2, size=2)
    scales = (1 - at_rest) * np.array([1.0, 1.0 / size, 1 - steady, (1 - steady) / size])
    derivatives = scales[:, None, None] * random.uniform(0.0, 1.0, (4, points, 1)) * random.normal(
        size=(4, points, 3)) * step / duration
    derivatives[2:] /= duration
    return times, Motion(center + step * random.uniform(-1.0, 1.0, (points, 3)), rotations,
                         *derivatives)


@pytest.mark.parametrize(('size', 'reflected', 'weightless'), [
    (1.0, 0.0, False), (1e-3, 1.0, False), (1e3, 70.0, False), (1.0, 1.0, True)])
def test_no_force_or_rate_is_missed_by_a_hundredth(
        size: float, reflected: float, weightless: bool) -> None:
    """The referee are 10,000 samples; reflected masses are up to 70 times the platform's."""
    random = rng(int(10.0 * reflected) + weightless)
    parameters = random_parameters(random)
    change: dict[str, Array] = {
        'actuator.reflected_mass': reflected * parameters['platform.mass'] * random.uniform(
            0.5, 1.5, 6)}
    if weightless:
        change['gravity'] = np.zeros(3)
    parameters = scaled(parameters.replaced(change), size).replaced({
        'singularity.stop_condition': 1e11, 'singularity.warn_condition': 1e11})
    platform = StewartPlatform(parameters)
    for _ in range(10):
        times, motion = random_trajectory(parameters, random)
        between = Interpolation(np.diff(times), motion.rows)
        part = np.linspace(0.0, 1.0, 10_000 // (len(times) - 1) + 1)
        results = platform.solve(np.concatenate([
            between.at(np.full(len(part), n), part) for n in range(len(times) - 1)]))
        largest = np.abs(results[:, FORCES]).max()
        assert check_planned_trajectory(platform, times, motion).force >= 0.99 * largest
        for limit, exceeded, kept in (
                ('limits.force_max', 0.99 * largest, 1.005 * largest),
                ('limits.velocity_max', 0.99 * np.abs(results[:, RATES]).max(), math.inf)):
            limited = StewartPlatform(parameters.replaced({limit: [exceeded]}))
            assert check_planned_trajectory(limited, times, motion).limit == limit
            if math.isfinite(kept):
                limited = StewartPlatform(parameters.replaced({limit: [kept]}))
                assert check_planned_trajectory(limited, times, motion).accepted


@pytest.mark.parametrize(('limit', 'columns'), [
    ('limits.force_max', FORCES), ('limits.joint_force_max', JOINT_FORCES)])
@pytest.mark.parametrize('duration', [SECOND, SECOND // 100])
def test_a_force_exceeded_between_points_alone_is_found(
        duration: int, limit: str, columns: slice) -> None:
    """At rest at both ends, 10 cm or 0.2 mm apart: what moves it lies between."""
    times = [0, duration]
    rows = heave(0.1 if duration == SECOND else 2e-4)
    dense, results = between_points(times, rows)
    forces = np.abs(results[:, columns])
    points = forces[[0, -1]].max()
    assert forces.max() > 1.05 * points
    bound = 0.5 * (forces.max() + points)
    result = check((times, rows), FREE.replaced({limit: [bound]}))
    assert result.reason == LIMIT
    time, leg = result.time, result.leg
    broken = dense[forces[:, leg] > bound]
    assert broken[0] <= time <= broken[-1]
    assert f' {limit}' in result.message
    assert 'clipped' not in result.message
    assert check((times, rows), FREE.replaced(
        {limit: [1.001 * forces.max()]})).accepted


def test_a_limit_at_a_point_is_found_with_its_leg(snapshot: Snapshot) -> None:
    times, rows = some(500)
    lengths = StewartPlatform(FREE).inverse_dynamics(motion_of(rows)).lengths
    bounds = np.full(6, 2.0)
    bounds[3] = np.sort(lengths[:, 3])[-20]
    result = check((times, rows), FREE.replaced({'limits.length_max': bounds}))
    first = int(np.argmax(lengths[:, 3] > bounds[3]))
    assert result.leg == 3
    assert result.limit == 'limits.length_max'
    snapshot(result.message)
    assert times[first - 1] * 1e-9 < result.time <= times[first] * 1e-9 + 1e-5


def test_a_trajectory_in_millimetres_is_named(snapshot: Snapshot) -> None:
    times, rows = np.array([0, 2 * SECOND]), heave(0.02)
    assert check((times, rows)).accepted
    rows[:, POSITION] *= 1e3
    result = check((times, rows))
    assert not result.accepted
    snapshot(result.message)


def test_the_first_of_two_violations_is_reported() -> None:
    times, rows = some(100)
    rows[60, 7] = 1.0  # a rate
    rows[20, 15] = 1000.0  # a force
    result = check((times, rows))
    assert times[19] * 1e-9 < result.time < times[21] * 1e-9


@pytest.mark.parametrize('step', [SECOND // 1000, SECOND // 100, SECOND // 10, SECOND])
def test_the_clear_trajectory_is_accepted(step: int) -> None:
    times, rows = sampled('clear', step)
    assert check((times, rows)).lengths.shape == (len(times), 6)


@pytest.mark.parametrize('step', [SECOND // 1000, SECOND // 10, SECOND])
def test_the_singular_trajectory_is_rejected(step: int) -> None:
    data = times, rows = sampled('singular', step)
    every = max(1, SECOND // 10 // step)
    fine, results = between_points(times[::every], rows[::every], 401 if step < SECOND else 4001)
    crossing = fine[np.argmax(results[:, DETERMINANT] * results[0, DETERMINANT] < 0.0)]
    forces = fine[np.argmax(np.abs(results[:, FORCES]).max(axis=1) > 6000.0)]
    stop = fine[np.argmax(results[:, CONDITION] >= 100.0)]
    for parameters, reason, time, words in (
            (PARAMETERS, LIMIT, forces, ' limits.force_max'),
            (FREE, SINGULAR, stop, 'reaches singularity.stop_condition, 100'),
            (UNBOUND, SINGULAR, crossing, 'det(J) crosses zero')):
        result = check(data, parameters)
        assert result.reason == reason
        assert words in result.message
        assert f'leg_{result.leg + 1}' in result.message
        # No later than the next sample, and no sooner than it happens.
        assert -1e-3 <= result.time - time <= 0.06
    assert result.time == pytest.approx(crossing, abs=1e-3)


def yaw(angle: float, rate: float = 0.0, acceleration: float = 0.0) -> list[float]:
    """Return a point turned about the vertical [deg, deg/s, deg/s^2]; singular at 90."""
    half = math.radians(angle) / 2.0
    return [0.0, 0.0, 0.8, 0.0, 0.0, math.sin(half), math.cos(half), *(0.0,) * 5,
            math.radians(rate), *(0.0,) * 5, math.radians(acceleration)]


def parabola(start: float, top: float, duration: int, ways: int) -> tuple[list[int], Array]:
    """Return times and points of a turn up to an angle [deg] and back, in equal intervals."""
    rate = 4.0 * (top - start) / (duration * 1e-9)
    bend = -2.0 * rate / (duration * 1e-9)
    times = [duration * n // ways for n in range(ways + 1)]
    return times, np.array([
        yaw(start + rate * t + 0.5 * bend * t * t, rate + bend * t, bend)
        for t in (at * 1e-9 for at in times)])


@pytest.mark.parametrize(('start', 'highest', 'duration'), [
    (80.0, 90.5, SECOND), (80.0, 90.05, SECOND), (85.0, 90.01, SECOND), (30.0, 90.1, SECOND),
    (89.9, 90.02, SECOND // 100), (89.5, 90.001, SECOND // 10)])
def test_a_double_crossing_between_two_points_is_found(
        start: float, highest: float, duration: int, snapshot: Snapshot) -> None:
    """There and back: det(J) has the same sign, and the same value, at both points."""
    seconds = duration * 1e-9

    def leap(top: float) -> tuple[Trajectory, Array, Array]:
        times, rows = parabola(start, top, duration, 1)
        dense, results = between_points(times, rows)
        return (times, rows), dense, results[:, DETERMINANT]

    # The singularity is not at 90 degrees to the last digit: the joints are rounded.
    data, dense, det = leap(highest)
    assert det[0] * det[-1] > 0.0
    crossed = det * det[0] < 0.0
    assert crossed.any()
    result = check(data, UNBOUND)
    assert result.reason == SINGULAR
    snapshot(result.message)
    assert result.time == pytest.approx(dense[np.argmax(crossed)], abs=1e-3 * seconds)
    short_of = 90.0 - 2.0 * (highest - 90.0)
    data, _, det = leap(short_of)
    assert np.all(det * det[0] > 0.0)
    assert 'det(J) crosses zero' not in check(data, UNBOUND).message
    # With points so near to each other the legs lead the platform where it is meant to be.
    assert check(parabola(start, short_of, duration, 200), UNBOUND).accepted


def test_a_singularity_of_the_legs_on_a_wide_way_is_found() -> None:
    """Two points at rest, 20 s apart: the platform's own way between them is clear."""
    motion = Motion.from_euler([[0.3157, -0.3343, 1.0948], [-0.3375, -0.0826, 0.9219]],
                               [[-0.5036, 0.3398, 0.2156], [-0.5072, 0.5726, -1.1678]])
    rows = np.column_stack([motion.position, to_quaternion(motion.rotation), np.zeros((2, 12))])
    times = [0, 20 * SECOND]
    assert between_points(times, rows)[1][:, CONDITION].max() < 16.0
    result = check((times, rows), FREE)
    assert result.reason == SINGULAR
    assert result.time == pytest.approx(10.1, abs=0.1)


def test_a_hexapod_on_its_end_stops_may_leave_them() -> None:
    platform = StewartPlatform(PARAMETERS)
    parked = platform.forward_kinematics(
        PARAMETERS['limits.length_min'], Pose([0.0, 0.0, 0.8], np.eye(3)))
    for digits, accepted in ((12, True), (3, False)):  # 1e-3 m below is no rounding
        position = [*parked.position.round(15).tolist()[:2],
                    math.floor(parked.position[2] * 10.0 ** digits) / 10.0 ** digits]
        rows = np.array([[*position, *to_quaternion(parked.rotation), *REST, *REST],
                         [*HOME, *REST, *REST]])
        result = check(([0, 5 * SECOND], rows))
        assert result.accepted == accepted, result.message


def test_a_limit_of_length_one_rounding_inside_the_pose_is_not_exceeded(
        snapshot: Snapshot) -> None:
    """By any of those who check it: the planned trajectory, the step and the plant."""
    rows = np.array([[*HOME, *REST, *REST]])
    lengths = StewartPlatform(FREE).inverse_dynamics(motion_of(rows)).lengths[0]
    for limit, outward, relative in (('limits.length_min', np.inf, 1e-8),
                                     ('limits.length_max', -np.inf, -1e-8)):
        for bounds, exceeded in ((np.nextafter(lengths, outward), False),
                                 (lengths * (1.0 + relative), True)):
            changes = {limit: bounds.tolist()}
            parameters = FREE.replaced(changes)
            assert check(([0], rows), parameters).accepted != exceeded
            step, setpoint = Step(parameters), Batch.from_parts(0, motion_of(rows).rows)
            assert bool(step.exceedances(step(setpoint))) == exceeded
            simulated_parameters = simulated(**{**UNLIMITED, **changes})
            if exceeded:
                with snapshot.raises(ParameterError):
                    Plant(simulated_parameters)
            else:
                assert Plant(simulated_parameters).state.positions == tuple(lengths.tolist())


def test_a_singularity_is_reported_before_exceeded_limits() -> None:
    assert check(([0], np.array([[0.0, 0.0, 0.0, *HOME[3:], *REST, *REST]]))).reason == SINGULAR


def test_a_singularity_on_the_way_of_the_legs_is_found(snapshot: Snapshot) -> None:
    """
    A second from point to point, the platform turns up to 89 degrees and back, short of 90.

    The cubics of the legs, through the lengths and rates of both points, ask for lengths in
    between that there are only beyond the singularity: for no pose at all on this side.
    """
    times, rows = parabola(80.0, 89.0, SECOND, 1)
    determinants = between_points(times, rows)[1][:, DETERMINANT]
    assert np.all(determinants * determinants[0] > 0.0)
    squares = cubic_between(times, rows)[1] ** 2
    apart = np.abs(squares[:, ::2].sum(axis=1) - squares[:, 1::2].sum(axis=1))
    limit = StewartPlatform(UNBOUND).inverse_kinematics(
        Pose.from_euler([0.0, 0.0, 0.8], [0.0, 0.0, np.pi / 2.0])) ** 2
    assert apart.max() > abs(limit[::2].sum() - limit[1::2].sum())
    result = check((times, rows), UNBOUND)
    assert result.reason == SINGULAR
    snapshot(result.message)
    assert check(parabola(80.0, 89.0, SECOND, 20), UNBOUND).accepted


def test_stop_condition_met_between_two_points_alone_is_found(snapshot: Snapshot) -> None:
    times, rows = parabola(80.0, 89.0, SECOND, 20)
    dense, results = between_points(times, rows)
    condition = results[:, CONDITION]
    highest = condition.max()
    assert condition[0] < 0.5 * highest
    for stop, rejected in ((0.99 * highest, True), (1.01 * highest, False)):
        parameters = FREE.replaced({'singularity.stop_condition': stop,
                                    'singularity.warn_condition': 20.0})
        result = check((times, rows), parameters)
        assert result.accepted != rejected
        if rejected:
            inside = dense[condition >= stop]
            assert inside[0] <= result.time <= inside[-1]
            snapshot(result.message)
        else:
            assert result.warning


def dipping(gap: float, depth: float, extra: float) -> Trajectory:
    """
    Return two points a second apart, so near to a singularity as a gap [deg] of yaw, and back.

    By values and rates at both, the gap falls by a depth of itself halfway; by the accelerations
    it falls farther, by an extra part, which no cubic through the points has.
    """
    rate = 4.0 * depth * gap
    acceleration = -2.0 * rate + 32.0 * extra * gap
    return [0, SECOND], np.array([
        yaw(90.0 - gap, rate, acceleration), yaw(90.0 - gap, -rate, acceleration)])


def test_a_crossing_within_a_dip_of_the_determinant_is_found(snapshot: Snapshot) -> None:
    """No sample is needed between the two points, and their cubic of det(J) stays clear."""
    trajectory = dipping(0.1, 0.5, 0.6)
    dense, results = between_points(*trajectory)
    determinants = results[:, DETERMINANT]
    crossed = determinants * determinants[0] < 0.0
    assert crossed.any()
    ends = determinants[[0, -1]], results[[0, -1], DETERMINANT_RATE]
    by_cubic = CubicHermiteSpline([0.0, 1.0], *ends)(np.linspace(0.0, 1.0, 101))
    assert np.all(by_cubic / determinants[0] > 0.4)
    result = check(trajectory, UNBOUND)
    assert result.reason == SINGULAR
    snapshot(result.message)
    assert result.time == pytest.approx(dense[np.argmax(crossed)], abs=1e-3)


@pytest.mark.parametrize(('depth', 'closer'), [(0.002, False), (0.05, True), (0.15, True)])
def test_samples_are_made_closer_where_the_determinant_dips(
        monkeypatch: pytest.MonkeyPatch, depth: float, closer: bool) -> None:
    solved = counted(monkeypatch)
    assert check(dipping(0.1, depth, 0.0), UNBOUND).accepted
    assert (sum(solved) > 16) if closer else (solved == [2])


# The motion between points: its ends, its derivatives, and the bounds of its path

MANY = 30


def rows_of(quaternions: Array, random: np.random.Generator) -> Array:
    """Return rows of motion with these rotations and all else at random."""
    rows = random.normal(size=(len(quaternions), 24))
    rows[:, 3:12] = np.stack(from_quaternion(*quaternions.T), axis=1)
    return rows


def random_motion_between(turn: float) -> tuple[Interpolation, Array, Array]:
    """Return the motion between points turned by about this angle, durations and points."""
    random = rng()
    quaternions = np.array([0.0, 0.0, 0.0, 1.0]) + turn * random.normal(size=(MANY + 1, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions *= random.choice([-1.0, 1.0], size=(MANY + 1, 1))
    rows = rows_of(quaternions, random)
    durations = random.uniform(0.1, 1.0, MANY)
    return Interpolation(durations, rows), durations, rows


@pytest.mark.parametrize('turn', [0.0, 1e-9, 1e-3, 0.1, 1.0, 100.0])
@pytest.mark.parametrize('end', [0, 1])
def test_the_motion_has_pose_twist_and_acceleration_of_its_ends(turn: float, end: int) -> None:
    between, durations, rows = random_motion_between(turn)
    which = np.arange(MANY)
    assert np.array_equal(between.at(which, np.full(MANY, float(end))), rows[which + end])
    # The polynomials themselves, so near the ends that they change by less than the tolerance.
    near = between.at(which, np.full(MANY, abs(end - 1e-10)))
    bounds = np.abs(rows).max() * np.ones(24)
    bounds[18:24] = 1e4  # third derivatives, over the shortest duration
    assert np.all(np.abs(near - rows[which + end]) <= 1e-8 * bounds)


@pytest.mark.parametrize('turn', [0.0, 1e-9, 1e-3, 0.1, 1.0, 100.0])
def test_twist_and_acceleration_are_derivatives(turn: float) -> None:
    between, durations, _ = random_motion_between(turn)
    which = np.arange(MANY)
    fraction = rng(1).uniform(0.1, 0.9, MANY)

    def at(shift: float) -> Array:
        return between.at(which, fraction + shift / durations)

    rows, rate = at(0.0), derivative(at, 1e-4)
    scale = 1.0 + np.abs(rows).max()
    assert np.abs(rate[:, 0:3] - rows[:, 12:15]).max() < 1e-7 * scale
    assert np.abs(rate[:, 12:18] - rows[:, 18:24]).max() < 1e-6 * scale
    rotation, its_rate = (each[:, 3:12].reshape(-1, 3, 3) for each in (rows, rate))
    spin = its_rate @ rotation.transpose(0, 2, 1)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    assert np.abs(omega - rows[:, 15:18]).max() < 1e-6 * scale
    assert np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14


@pytest.mark.parametrize('angle', [0.0, 1e-6, 0.7, 3.0, np.pi - 1e-9])
def test_a_rotation_at_constant_rate_is_interpolated_exactly(angle: float) -> None:
    axis = np.array([0.36, -0.48, 0.8])
    rotations = np.stack([np.eye(3), rotation_about(axis, angle)])
    rows = np.zeros((2, 24))
    rows[:, 3:12] = rotations.reshape(2, 9)
    rows[:, 15:18] = axis * angle / 2.0
    between = Interpolation(np.array([2.0]), rows)
    part = np.linspace(0.0, 1.0, 11)
    got = between.at(np.zeros(11, dtype=np.int64), part)
    expected = np.stack([rotation_about(axis, angle * each) for each in part])
    assert np.abs(got[:, 3:12] - expected.reshape(-1, 9)).max() < 1e-8
    assert np.abs(got[:, 15:18] - rows[0, 15:18]).max() < 1e-7
    assert np.abs(got[:, 21:24]).max() < 1e-6


def test_position_and_its_derivatives_are_within_their_bounds() -> None:
    between, durations, _ = random_motion_between(1.0)
    bounds = between.bounds(0.5)
    part = np.linspace(0.0, 1.0, 401)
    for n in range(MANY):
        rows = between.at(np.full(len(part), n), part)
        assert np.linalg.norm(np.diff(rows[:, 0:3], axis=0), axis=1).sum() <= bounds.path[n]
        for columns, bound, deviation in (
                (slice(0, 3), None, bounds.position_deviation),
                (slice(12, 15), bounds.speed, bounds.velocity_deviation),
                (slice(18, 21), bounds.acceleration, bounds.acceleration_deviation)):
            values = rows[:, columns]
            if bound is not None:
                assert np.linalg.norm(values, axis=1).max() <= bound[n]
            line = values[0] + part[:, None] * (values[-1] - values[0])
            assert np.linalg.norm(values - line, axis=1).max() <= deviation[n]
        jerk = np.diff(rows[:, 18:21], axis=0) / (durations[n] / 400.0)
        assert np.linalg.norm(jerk, axis=1).max() <= bounds.jerk[n]
