# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Planned trajectories of hexapods with cranks, against dense scans."""

from __future__ import annotations

from dataclasses import replace
import re
from typing import Any, NamedTuple

from cases import few
from crank_machines import at_rest as still, random_machine, within
from crank_newton_euler import CrankHexapod
from crank_platforms import parameters_of
import messages
import numpy as np
import pytest
from referees import random_direction, rng, ROOT, rotation_about
from scipy.interpolate import CubicHermiteSpline
from stewart_dynamics import (
    approach, BaseMotion, check_planned_trajectory, Motion, MotionError, Parameters,
    PlannedTrajectory, Pose, PoseError, rest_to_rest, StewartPlatform, TimedMotion)
from stewart_dynamics.arrays import Array, NO_WRENCH
from stewart_dynamics.mechanics.batch import lever_squares, missing_distances
from stewart_dynamics.mechanics.kinematics.joint_angles import JointAngles
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, JOINT_FORCES, LEVERS, MOTION, POSE, POSITION, SPEEDS, TORQUES)
from stewart_dynamics.planned import trajectory_messages
from stewart_dynamics.planned.checks import JUMPS, UNREACHABLE
from stewart_dynamics.planned.interpolation import Interpolation
from stewart_dynamics.planned.trajectory_messages import PlannedOutcome
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.reference_motion.response_motion import duration
from trajectories import decoded, motion_of, rows_of, STAMP

POINTS = 3001  # of a scan, in each interval
LEGS_POINTS = 101  # of the platform as the legs move it
TRAJECTORIES = 8  # of a hexapod
# By which limits may be missed, or angles and levers be found too early, between points.
LOADS, ANGLES, LEVER = 0.01, 1e-4, 1e-3
FREE = {'limits.lever_min': 0.02,
        'singularity.stop_condition': 1e11, 'singularity.warn_condition': 1e11}


class Planned(NamedTuple):
    """A trajectory with its loads."""

    times: Array
    motion: Motion
    wrench: Array
    base: BaseMotion | None


def random_planned(machine: CrankHexapod, random: np.random.Generator) -> Planned:
    """Return 2 to 4 points about home, 1e-3 to 1 crank apart, at rest or not."""
    size, points = float(machine.crank.mean()), int(random.integers(2, 5))
    step = size * 10.0 ** random.uniform(-3.0, -0.2)
    duration = np.sqrt(step / 10.0 ** random.uniform(-1.5, 1.0)) * random.uniform(1.0, 4.0)
    times = duration * np.cumsum([0.0, *random.uniform(0.5, 1.5, points - 1)])
    while True:
        center = machine.home + size * random.uniform(-0.8, 0.8, 3)
        turn = rotation_about(random_direction(random), random.uniform(0.0, 0.3))
        if random.integers(8) == 0 or within(
                machine, replace(still(machine), t=center, R=turn)):
            break
    arm = float(np.linalg.norm(machine.P, axis=1).mean())
    rotations = [rotation_about(random_direction(random), random.uniform(0.0, step / arm)) @ turn
                 for _ in range(points)]
    at_rest, steady = random.integers(2, size=2)
    scales = (1 - at_rest) * np.array([1.0, 1.0 / arm, 1 - steady, (1 - steady) / arm])
    derivatives = scales[:, None, None] * random.uniform(0.0, 1.0, (4, points, 1)) * random.normal(
        size=(4, points, 3)) * step / duration
    derivatives[2:] /= duration
    weight = machine.m * 9.81
    wrench = weight * random.uniform(-0.5, 0.5, 6) * np.repeat([1.0, size], 3)
    base = None
    if random.integers(2):
        base = BaseMotion(9.81 * random_direction(random), random.normal(size=3),
                          random.normal(size=3), random.normal(size=3))
    return Planned(np.rint(1e9 * times) * 1e-9, Motion(
        center + step * random.uniform(-1.0, 1.0, (points, 3)), rotations, *derivatives),
        wrench, base)


class Scanned(NamedTuple):
    """The extremes of a trajectory, each (6,) or a number; nan out of reach."""

    low: Array  # of angles, also of the cubics of the legs
    high: Array
    speeds: Array
    torques: Array
    rod_forces: Array
    levers: Array  # the smallest, also where the legs move the platform
    condition: float
    sides: bool  # whether det(J) keeps its sign
    legs: bool  # whether the cubics of the legs have poses


def scanned(p: Parameters, planned: Planned) -> Scanned:
    """Return the extremes by plain inverse dynamics, and forward kinematics of the cubics."""
    platform, times = StewartPlatform(p), planned.times
    between = Interpolation(np.diff(times), planned.motion.rows)
    part = np.linspace(0.0, 1.0, POINTS)
    rows = np.concatenate([between.at(np.full(POINTS, n), part) for n in range(len(times) - 1)])
    result = platform.inverse_dynamics(
        Motion.of_rows(rows), planned.wrench, planned.base, singular='nan').rows
    size = p['legs.crank.length']
    found = platform.inverse_dynamics(Motion.of_rows(rows), singular='nan')
    levers = np.abs(result[:, LEVERS]) / size
    low, high, speeds = (each.copy() for each in (
        found.angles.min(axis=0), found.angles.max(axis=0), np.abs(result[:, SPEEDS]).max(axis=0)))
    smallest, condition = levers.min(axis=0), float(result[:, CONDITION].max())
    sides = bool((result[:, DETERMINANT] * result[0, DETERMINANT] > 0.0).all())
    at = platform.inverse_dynamics(planned.motion, singular='nan')
    legs = True
    if np.isfinite(at.angles).all():
        cubic = CubicHermiteSpline(times, at.angles, at.speeds)
        dense = np.concatenate([np.linspace(*each, POINTS) for each in zip(
            times, times[1:], strict=False)])
        low, high = (pick((each, edge)) for pick, each, edge in (
            (lambda two: np.minimum(*two), low, cubic(dense).min(axis=0)),
            (lambda two: np.maximum(*two), high, cubic(dense).max(axis=0))))
        speeds = np.maximum(speeds, np.abs(cubic(dense, 1)).max(axis=0))
        guess: Any = planned.motion[0]
        poses: list[Array] = []
        for time in np.concatenate([np.linspace(*each, LEGS_POINTS) for each in zip(
                times, times[1:], strict=False)]):
            try:
                guess = platform.forward_kinematics(cubic(time), guess)
            except PoseError:
                legs = False
                break
            poses.append(guess.rows)
        moved = platform.inverse_dynamics(Motion.of_rows(np.pad(
            poses, ((0, 0), (0, MOTION - POSE.stop))))).rows
        smallest = np.minimum(smallest, np.abs(moved[:, LEVERS]).min(axis=0) / size)
        condition = max(condition, float(moved[:, CONDITION].max()))
        sides &= bool((moved[:, DETERMINANT] * result[0, DETERMINANT] > 0.0).all())
    return Scanned(low, high, speeds, np.abs(result[:, TORQUES]).max(axis=0),
                   np.abs(result[:, JOINT_FORCES]).max(axis=0), smallest, condition, sides, legs)


def limits_about(scan: Scanned, random: np.random.Generator) -> dict[str, Any]:
    """Return limits that some of the extremes exceed, and some do not."""
    def near() -> Array:
        return random.choice([0.9, 0.995, 1.005, 1.02, 1.1], 6, p=[.02, .02, .2, .2, .56])

    found: dict[str, Any] = {'singularity.stop_condition': 1e11}
    if np.isfinite(scan.levers).all() and (scan.high - scan.low).max() < 3.0:
        width = scan.high - scan.low + 0.01
        found |= {
            'limits.angle_min': scan.low + width * random.choice(
                [-0.5, -0.01, 0.01], 6, p=[.6, .35, .05]),
            'limits.angle_max': scan.high + width * random.choice(
                [0.5, 0.01, -0.01], 6, p=[.6, .35, .05]),
            'limits.lever_min': np.minimum(scan.levers / near(), 0.95)}
        found['limits.angle_max'] = np.maximum(
            found['limits.angle_max'], found['limits.angle_min'] + 1e-3)
        for name, values in (
                ('limits.speed_max', scan.speeds), ('limits.torque_max', scan.torques),
                ('limits.rod_force_max', scan.rod_forces)):
            if random.integers(2) and (values > 0.0).all():
                found[name] = values * near()
        if random.integers(4) == 0:
            found['singularity.stop_condition'] = scan.condition * float(near()[0])
    found['singularity.warn_condition'] = found['singularity.stop_condition']
    return found


def excesses(scan: Scanned, p: Parameters) -> tuple[bool, bool]:
    """Return whether limits are exceeded by more than the margins, and whether by none at all."""
    over: list[float] = []
    for values, name, margin in ((scan.speeds, 'limits.speed_max', LOADS),
                                 (scan.torques, 'limits.torque_max', LOADS),
                                 (scan.rod_forces, 'limits.rod_force_max', LOADS)):
        if p[name] is not None:
            over.append(float(((values / p[name] - 1.0) / margin).max()))
    if p.limits.angle_min is not None:
        over += [float(((p.limits.angle_min - scan.low) / ANGLES).max()),
                 float(((scan.high - p.limits.angle_max) / ANGLES).max())]
    over.append(float(((p.limits.lever_min - scan.levers) / LEVER).max()))
    stop = p.singularity.stop_condition
    over.append((scan.condition / stop - 1.0) / LOADS)
    lost = not np.isfinite(over).all() or not scan.legs or not scan.sides
    return lost or max(over) > 1.0, not lost and max(over) < 0.0


def wrong_verdicts(seed: int) -> tuple[list[str], list[PlannedTrajectory]]:
    """Return verdicts that differ from those of dense scans, and all results."""
    random = rng(seed)
    machine = random_machine(random)
    free = parameters_of(machine, **FREE)
    wrong, results = [], []
    for n in range(TRAJECTORIES):
        scan = scanned(free, planned := random_planned(machine, random))
        while not np.isfinite(scan.levers).all() and random.integers(8):
            scan = scanned(free, planned := random_planned(machine, random))
        p = free.replaced(limits_about(scan, random))
        result = check_planned_trajectory(StewartPlatform(p), *planned)
        bad, good = excesses(scan, p)
        results.append(result)
        if result.accepted and bad or not result.accepted and good:
            wrong.append(f'{seed} {n}: {result.message}: {scan}')
    return wrong, results


@pytest.mark.parametrize('first', few(range(0, 20, 5), 1))
def test_verdicts_agree_with_dense_scans(first: int) -> None:
    accepted, reasons = 0, set()
    for seed in range(first, first + 5):
        wrong, results = wrong_verdicts(seed)
        assert not wrong
        accepted += sum(each.accepted for each in results)
        reasons |= {each.limit or each.reason for each in results}
    assert 2 < accepted < 38
    assert len(reasons) > 4


# One hexapod: messages, times and legs.

FILE = ROOT / 'config' / 'crank_platform.yaml'
RIG = Parameters.from_yaml(FILE)
UNLIMITED = RIG.replaced(dict.fromkeys((
    'limits.angle_min', 'limits.angle_max', 'limits.speed_max', 'limits.torque_max',
    'limits.rod_force_max')))
HOME = StewartPlatform(RIG).home_pose()


def lifted(height: float, duration: float = 3.0, rate: float = 50.0) -> TimedMotion:
    """Return a motion straight up from home."""
    return rest_to_rest(
        HOME, Pose(HOME.position + [0.0, 0.0, height], HOME.rotation), duration, rate)


def test_at_the_points_cranks_are_those_of_inverse_dynamics() -> None:
    platform, wrench = StewartPlatform(RIG), (100.0, -50.0, -300.0, 20.0, 10.0, -5.0)
    times, motion = lifted(0.1)
    result = check_planned_trajectory(platform, times, motion, wrench)
    expected = platform.inverse_dynamics(motion, wrench)
    assert result.accepted
    for name in ('angles', 'speeds', 'torques'):
        assert np.array_equal(getattr(result, name), getattr(expected, name))
    assert result.lengths.shape == result.rates.shape == result.forces.shape == (0, 6)
    assert np.isnan(result.force)
    assert 1.0 <= result.torque / np.abs(expected.torques).max() < 1.01
    assert result.load == pytest.approx(result.torque / 250.0)
    ratios = np.abs(expected.levers) / RIG['legs.crank.length']
    n, leg = np.unravel_index(ratios.argmin(), ratios.shape)
    assert result.lever == pytest.approx(ratios[n, leg], rel=1e-6)
    assert result.lever_time == pytest.approx(times[n], abs=0.02)
    assert result.message.endswith(
        f', smallest lever {result.lever:.4g} of its largest: leg_{result.lever_leg + 1} at '
        f'{result.lever_time:.3f} s')


def test_a_pose_out_of_reach_between_two_points_is_named() -> None:
    """Up and back down between two points within reach, by initial and final velocities."""
    heights, ups = (HOME.position[2] + each for each in (0.1, 0.25))
    p = UNLIMITED.replaced({'limits.lever_min': 0.0})
    rate = 16.0 / 5.0 * (ups - heights)  # at no acceleration it rises by 5 / 16 of it
    motion = Motion(np.tile([0.0, 0.0, heights], (2, 1)), HOME.rotation,
                    [[0.0, 0.0, rate], [0.0, 0.0, -rate]])
    platform, part = StewartPlatform(p), np.linspace(0.0, 1.0, 4001)
    rows = Interpolation(np.ones(1), motion.rows).at(np.zeros(4001, dtype=np.int64), part)
    missing = missing_distances(platform.structure, rows)
    first = part[(missing > 0.0).any(axis=1).argmax()]
    assert first > 0.0 and not missing[[0, -1]].any() and missing.max() > 1e-3
    result = check_planned_trajectory(platform, [0.0, 1.0], motion)
    assert result.reason == UNREACHABLE
    assert first - 1e-3 < result.time < first + 0.01
    assert ' cannot reach: ' in result.message and result.message.count('mm missing') == 2
    told = max(float(each) for each in re.findall(r'([\d.]+) mm missing', result.message))
    assert told == pytest.approx(1e3 * missing.max(), rel=0.01)
    # With the limit of the lever that is met first, and both are named.
    result = check_planned_trajectory(StewartPlatform(UNLIMITED), [0.0, 1.0], motion)
    assert result.limit == 'limits.lever_min'
    assert result.time < first
    assert re.search(r'lever 0\.\d+ is 0\.\d+ below limits\.lever_min; at 0\.\d+ s leg_\d cannot '
                     r'reach: [\d.]+ mm missing$', result.message)


def test_a_point_out_of_reach_is_named_with_its_possible_error() -> None:
    times, motion = lifted(0.1)
    rows = motion.rows.copy()
    rows[:, POSITION] *= 1e3
    result = check_planned_trajectory(StewartPlatform(RIG), times, Motion.of_rows(rows))
    assert result.reason == UNREACHABLE
    assert result.time == 0.0
    assert result.message.endswith('; possible error: position in mm')


def test_an_angle_that_jumps_to_the_other_end_of_its_turn_is_rejected() -> None:
    """The zero of a crank is opposite to where it is at home; its angle has no limits."""
    legs: Any = RIG.structure['legs']
    directions = legs['crank_direction'].copy()
    directions[2] = -directions[2]
    p = UNLIMITED.replaced({
        'geometry.crank_angles': None, 'geometry.crank_axes': legs['crank_axis'],
        'geometry.crank_directions': directions, 'geometry.crank_branch': [
            'positive' if sign > 0.0 else 'negative' for sign in legs['branch']]})
    platform = StewartPlatform(p)
    down = Pose(HOME.position - [0.0, 0.0, 0.02], HOME.rotation)
    up = Pose(HOME.position + [0.0, 0.0, 0.03], HOME.rotation)
    for rate in (1.0, 1000.0):
        times, motion = rest_to_rest(down, up, 1.0, rate)
        angles = platform.inverse_dynamics(motion).angles[:, 2]
        assert abs(angles[0] - angles[-1]) > 5.0
        result = check_planned_trajectory(platform, times, motion)
        assert not result.accepted
        if rate > 1.0:
            n = int(np.argmax(np.abs(np.diff(angles)) > 5.0))
            assert result.reason == JUMPS
            assert times[n] <= result.time <= times[n + 1]
            assert re.search(r'leg_3: angle jumps from -?3\.1\d+ to -?3\.1\d+ rad, half a turn',
                             result.message)


@pytest.mark.parametrize('speed', [None, 4.0, 0.2])
def test_an_approach_is_within_all_limits_of_cranks(speed: float | None) -> None:
    platform = StewartPlatform(RIG.replaced({'limits.speed_max': speed}))
    end = Pose.from_euler(HOME.position + [0.03, -0.02, 0.08], [0.05, 0.0, 0.1])
    times, motion = approach(platform, HOME, end)
    assert check_planned_trajectory(platform, times, motion).accepted
    speeds = np.abs(platform.inverse_dynamics(motion).speeds)
    fastest = 0.1 * RIG.singularity.characteristic_length / RIG['legs.crank.length'][0]
    assert 0.6 < speeds.max() / (fastest if speed is None else 0.5 * speed) <= 1.01


def test_an_approach_out_of_reach_names_the_leg() -> None:
    with pytest.raises(MotionError, match=r'leg_\d cannot reach: [\d.]+ mm missing'):
        approach(StewartPlatform(RIG), HOME, Pose(HOME.position + [0.0, 0.0, 0.5], HOME.rotation))


def test_motors_of_cranks_are_checked_between_points() -> None:
    """One interval of a second: the largest torque and speed of a motor lie inside."""
    geared = UNLIMITED.replaced({'drive.gear_ratio': 95.0, 'drive.efficiency': 0.8})
    motion = lifted(0.1, 1.0, 1.0).motion
    between, part = Interpolation(np.ones(1), motion.rows), np.linspace(0.0, 1.0, 4001)
    dense = Motion.of_rows(between.at(np.zeros(4001, dtype=np.int64), part))
    motors = StewartPlatform(geared).motors(dense)
    for name, values in (('drive.torque_max', motors.breakaway_torques),
                         ('drive.speed_max', motors.speeds)):
        largest = float(np.abs(values).max())
        assert largest > 1.02 * np.abs(values[[0, -1]]).max()
        for factor, accepted in ((0.985, False), (1.005, True)):
            p = geared.replaced({name: factor * largest})
            result = check_planned_trajectory(StewartPlatform(p), [0.0, 1.0], motion)
            assert result.accepted == accepted
            assert accepted or result.limit == name


def test_angles_of_joints_have_rates_that_include_the_cranks() -> None:
    machine = random_machine(rng(5))
    p = parameters_of(machine, **{'limits.platform_joint_angle_max': 1.5})
    angles, h = JointAngles(p, ('geometry.platform_joint_axes',)), 1e-6
    motion = random_planned(machine, rng(6)).motion[:2]
    between = Interpolation(np.ones(1), motion.rows)
    at = np.array([0.3, 0.3 - h, 0.3 + h])
    values, rates = angles.haversines(between.at(np.zeros(3, dtype=np.int64), at))
    np.testing.assert_allclose(
        rates[0, 6:], (values[2, 6:] - values[1, 6:]) / (2.0 * h), rtol=1e-6, atol=1e-8)


def test_squares_of_levers_have_their_rates_and_are_negative_out_of_reach() -> None:
    random, h = rng(7), 1e-6
    for seed in range(20):
        machine = random_machine(rng(seed))
        platform = StewartPlatform(parameters_of(machine))
        motion = random_planned(machine, random).motion[:2]
        rows = Interpolation(np.ones(1), motion.rows).at(
            np.zeros(3, dtype=np.int64), np.array([0.3, 0.3 - h, 0.3 + h]))
        values, rates = lever_squares(platform.structure, rows)
        ratios = np.abs(platform.inverse_dynamics(
            Motion.of_rows(rows), singular='nan').levers) / machine.crank
        reached = np.isfinite(ratios)
        np.testing.assert_allclose(values[reached], ratios[reached] ** 2, rtol=1e-9, atol=1e-12)
        assert ((values < 0.0) == (missing_distances(platform.structure, rows) > 0.0)).all()
        np.testing.assert_allclose(
            rates[0], (values[2] - values[1]) / (2.0 * h), rtol=1e-5, atol=1e-6)


def test_bounds_of_levers_hold_on_any_way() -> None:
    """Lower bounds of squares of levers, against samples of the same ways."""
    kind, random, part = RIG.leg_kind, rng(8), np.linspace(0.0, 1.0, 2001)
    tight = 0
    for seed in range(40):
        machine = random_machine(rng(seed))
        p = parameters_of(machine)
        motion = random_planned(machine, random).motion[:2]
        between = Interpolation(np.ones(1), motion.rows)
        rows = between.at(np.zeros(2001, dtype=np.int64), part)
        arm = float(p.singularity.characteristic_length)
        reach = np.maximum(1.0, np.linalg.norm(machine.P, axis=1) / arm)
        ways = between.bounds(arm).path[:, None] * reach
        least = kind.least_levers(p, rows[:1], rows[-1:], ways)
        true = lever_squares(p.structure, rows)[0].min(axis=0)
        assert (least <= true + 1e-12).all()
        tight += int((least > 0.5 * true).all())
    assert tight > 3


def test_a_response_motion_is_as_large_as_the_limits_of_cranks_permit() -> None:
    height = float(HOME.position[2])
    parameters = ReferenceMotionParameters({
        'motion.type': 'response', 'motion.initial': (0.0, 0.0, height, 0.0, 0.0, 0.0),
        'motion.response.part': 0.9, 'motion.response.params_file': str(FILE)})
    times = np.arange(0.0, duration(parameters), 0.01)
    motion = motion_at(parameters, times)
    result = StewartPlatform(RIG).inverse_dynamics(motion)
    used = max(float(np.abs(values).max()) / most for values, most in (
        (result.speeds, 4.0), (result.torques, 250.0), (result.angles, np.pi / 3.0)))
    assert 0.5 < used < 1.0


def outcome_of(parameters: Parameters, planned_motion: TimedMotion, start: Pose | None = None,
               ) -> PlannedOutcome:
    """Return the answer to a message with a motion; start: where the cranks are measured."""
    times, motion = planned_motion
    data = messages.trajectory(STAMP, np.rint(times * 1e9).astype(int).tolist(), rows_of(motion))
    *_, found = trajectory_messages.answer(
        parameters, NO_WRENCH, data,
        measured=None if start is None else Motion.from_pose(start).rows.tolist())
    assert found is not None
    return found


def test_messages_have_angles_speeds_and_torques() -> None:
    planned_motion = lifted(0.1)
    outcome = outcome_of(RIG, planned_motion)
    points = decoded(outcome).points
    expected = StewartPlatform(RIG).inverse_dynamics(motion_of(rows_of(planned_motion.motion)))
    for field, values in (('positions', expected.angles), ('velocities', expected.speeds),
                          ('effort', expected.torques)):
        assert np.array_equal([getattr(point, field) for point in points], values)
    values = dict(outcome.values)
    assert float(values['largest torque (N m)']) == pytest.approx(
        np.abs(expected.torques).max(), rel=0.01)
    assert 'largest torque, of limits.torque_max' in values
    smallest = float((np.abs(expected.levers) / RIG['legs.crank.length']).min())
    assert float(values['smallest lever, of its largest']) == pytest.approx(smallest, rel=1e-3)
    assert values['leg of the smallest lever'].startswith('leg_')
    assert 'largest force (N)' not in values


def test_a_message_out_of_reach_is_rejected_with_the_leg() -> None:
    outcome = outcome_of(UNLIMITED, lifted(0.5))
    assert not outcome.answer
    assert re.search(r'leg_\d cannot reach: [\d.]+ mm missing', outcome.message)


def test_a_trajectory_of_cranks_starts_where_they_are_measured() -> None:
    """The tolerance of an angle is that of the way of the crank's end."""
    checked, prepended = (RIG.replaced({'trajectory.approach': mode})
                          for mode in ('check', 'prepend'))
    planned_motion = lifted(0.1)
    off = 0.011 * RIG.singularity.characteristic_length
    for height, starts in ((0.5 * off, True), (3.0 * off, False)):
        start = Pose(HOME.position + [0.0, 0.0, height], HOME.rotation)
        outcome = outcome_of(checked, planned_motion, start)
        assert bool(outcome.answer) == starts
        if not starts:
            assert outcome.reason == trajectory_messages.STARTS_ELSEWHERE
            assert re.search(r'leg_\d is 0\.\d+ rad from its first angle, more than 0\.\d+ rad',
                             outcome.message)
            points = decoded(outcome_of(prepended, planned_motion, start)).points
            assert len(points) > len(planned_motion.times)
            np.testing.assert_allclose(points[0].positions, StewartPlatform(
                RIG).inverse_kinematics(start), rtol=0.0, atol=1e-12)
    # A first point that no crank reaches is named as such.
    for p in (checked, prepended):
        away = TimedMotion(planned_motion.times, Motion.of_rows(
            planned_motion.motion.rows + np.eye(24)[2]))
        assert 'mm missing' in outcome_of(p, away, HOME).message
