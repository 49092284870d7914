# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Planned motions: what is answered, to the last bit, and all that is refused, in words."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import messages
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng, ROOT
from scipy.interpolate import CubicHermiteSpline

from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.mechanics.interpolation import Interpolation
from stewart_dynamics.mechanics.reference_motion import motion_at
from stewart_dynamics.mechanics.reference_motion_parameters import ReferenceMotionParameters
from stewart_dynamics.mechanics.rotation import from_quaternion, to_quaternion
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT, FORCES, LENGTHS, RATES
from stewart_dynamics.runtime import planned_trajectory as planned
from stewart_dynamics.runtime.planned_trajectory import Outcome

Array = NDArray[np.float64]

PARAMETERS = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
FREE = PARAMETERS.replaced({name: [] for name in (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')})
# No condition number stops it: only a change of the sign of det(J) is left.
UNBOUND = FREE.replaced({'singularity.stop_condition': 1e11, 'singularity.warn_condition': 1e11})
STAMP = 1_700_000_000_123_456_789
SECOND = 1_000_000_000
REST = (0.0,) * 6
HOME = (0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0)


def outcome_of(data: bytes, parameters: Parameters = PARAMETERS, wrench: Six = NO_WRENCH,
               ) -> Outcome:
    """Return what becomes of a trajectory."""
    *pieces, outcome = planned.answer(parameters, wrench, data)
    assert outcome is not None
    assert not any(pieces)
    assert bool(outcome.answer) != bool(outcome.reason)
    assert outcome.message.startswith('refused: ' if outcome.reason else 'answered: ')
    return outcome


def decoded(outcome: Outcome) -> Any:
    """Return the answer as another library reads it."""
    assert outcome.answer, outcome.message
    return messages.STORE.deserialize_cdr(outcome.answer, planned.OUTPUT_TYPE)


def rows_of(motion: Motion) -> Array:
    """Return rows of position, quaternion, twist and acceleration."""
    return np.column_stack([motion.position, to_quaternion(motion.rotation),
                            motion.rows[:, 12:24]])


def motion_of(rows: Array) -> Motion:
    """Return the motion that the library is given for the same points."""
    x, y, z, w = rows[:, 3:7].T
    length = np.sqrt(x * x + y * y + z * z + w * w)
    rotation = np.stack(from_quaternion(x / length, y / length, z / length, w / length), axis=1)
    return Motion(rows[:, 0:3], rotation.reshape(-1, 3, 3), rows[:, 7:10], rows[:, 10:13],
                  rows[:, 13:16], rows[:, 16:19])


def sampled(name: str, step: int) -> tuple[list[int], Array]:
    """Return times [ns] and rows of a motion in config/."""
    motion = ReferenceMotionParameters.from_yaml(ROOT / 'config' / f'trajectory_{name}.yaml')
    times = np.arange(0, 10 * SECOND + 1, step)
    return times.tolist(), rows_of(motion_at(motion, times * 1e-9))


def some(points: int) -> tuple[list[int], Array]:
    """Return a smooth motion whose points are at uneven times."""
    random = rng()
    times = np.cumsum(random.integers(1_000_000, 20_000_000, points))
    motion = ReferenceMotionParameters({
        'motion.type': 'sine', 'motion.initial': (0.0, 0.0, 1.1, 0.0, 0.0, 0.0),
        'motion.amplitude': (0.03, 0.03, 0.04, 0.04, 0.04, 0.06),
        'motion.frequency': (0.25, 0.5, 0.25, 0.5, 0.25, 0.25)})
    rows = rows_of(motion_at(motion, times * 1e-9))
    rows[:, 3:7] *= random.uniform(0.9995, 1.0005, (points, 1))
    return times.tolist(), rows


# What is answered

@pytest.mark.parametrize('points', [1, 2, planned.PIECE, planned.PIECE + 1, 1000])
@pytest.mark.parametrize(('frame', 'names'), [
    ('', ()), ('base', ('platform',)), ('', ('p',)), ('base', ('moving',)), ('', ('',))])
def test_points_are_answered_with_the_librarys_bits(
        points: int, frame: str, names: tuple[str, ...]) -> None:
    times, rows = some(points)
    wrench = (100.0, -50.0, -300.0, 20.0, 10.0, -5.0)
    # Names of any length, so that doubles stand at another place in the message.
    joints = [f'{"x" * points}{name}' for name in PARAMETERS['joints']]
    if points > 2:
        joints = [name[-3 - points % 4:] for name in joints]
    parameters = PARAMETERS.replaced({'joints': joints})
    outcome = outcome_of(messages.trajectory(STAMP, times, rows, frame, names), parameters, wrench)
    assert outcome.message == (f'answered: {points} point{"s" * (points > 1)} over '
                               f'{(times[-1] - times[0]) * 1e-9:.6g} s')
    got = decoded(outcome)
    assert got.header.stamp.sec * SECOND + got.header.stamp.nanosec == STAMP
    assert got.header.frame_id == ''
    assert got.joint_names == joints
    assert [point.time_from_start.sec * SECOND + point.time_from_start.nanosec
            for point in got.points] == times
    result = StewartPlatform(parameters).inverse_dynamics(motion_of(rows), wrench)
    for field, expected in (('positions', result.lengths - parameters['geometry.zero_length']),
                            ('velocities', result.rates), ('effort', result.forces)):
        assert np.array([getattr(point, field) for point in got.points]).tobytes() \
            == np.ascontiguousarray(expected).tobytes()
    assert all(len(point.accelerations) == 0 for point in got.points)


@pytest.mark.parametrize('names', [(), ('platform',), ('p',)])
def test_big_endian_messages_are_read(names: tuple[str, ...]) -> None:
    times, rows = some(10)
    both = [messages.trajectory(STAMP, times, rows, names=names, little_endian=little)
            for little in (True, False)]
    assert both[0] != both[1]
    assert outcome_of(both[0]).answer == outcome_of(both[1]).answer


@pytest.mark.parametrize('joint', ['a', 'ab', 'abc', 'abcd', 'abcde'])
def test_without_effort_points_have_none(joint: str) -> None:
    times, rows = some(5)
    parameters = PARAMETERS.replaced({
        'trajectory.effort': False, 'joints': [joint + str(n) for n in range(6)]})
    data = messages.trajectory(STAMP, times, rows)
    got, with_it = decoded(outcome_of(data, parameters)), decoded(outcome_of(data))
    for point, other in zip(got.points, with_it.points, strict=True):
        assert len(point.effort) == 0
        assert len(other.effort) == 6
        assert np.array_equal(point.positions, other.positions)
        assert np.array_equal(point.velocities, other.velocities)
        assert point.time_from_start == other.time_from_start


def test_its_keys_say_what_it_asks_of_the_machine() -> None:
    times, rows = sampled('clear', SECOND // 100)
    outcome = outcome_of(messages.trajectory(STAMP, times, rows))
    values = dict(outcome.values)
    result = StewartPlatform(PARAMETERS).inverse_dynamics(motion_of(rows))
    largest = np.abs(result.forces).max()
    leg = int(np.argmax(np.abs(result.forces).max(axis=0)))
    assert values['points'] == '1001'
    assert values['duration (s)'] == '10'
    assert float(values['largest force (N)']) == pytest.approx(largest, rel=1e-3)
    assert values['its leg'] == f'leg_{leg + 1}'
    assert float(values['largest force, of limits.force_max']) == pytest.approx(
        largest / 6000.0, rel=1e-3)
    assert float(values['worst condition number']) == pytest.approx(
        result.condition_number.max(), rel=1e-3)
    assert 'largest force, of limits.force_max' not in dict(
        outcome_of(messages.trajectory(STAMP, times, rows), FREE).values)


def test_inside_warn_condition_it_is_answered_and_said() -> None:
    times, rows = sampled('clear', SECOND)
    parameters = PARAMETERS.replaced({'singularity.warn_condition': 4.0})
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), parameters)
    assert outcome.answer
    assert outcome.warning
    assert 'condition number 4.352 at 10.000 s is not below singularity.warn_condition, 4' in (
        outcome.message)
    assert not outcome_of(messages.trajectory(STAMP, times, rows)).warning


# The work in pieces

def test_no_piece_is_larger_than_its_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[int] = []
    solve = StewartPlatform.solve

    def counted(platform: StewartPlatform, rows: Array, wrenches: Array | None = None) -> Array:
        solved.append(len(rows))
        return solve(platform, rows, wrenches)

    monkeypatch.setattr(StewartPlatform, 'solve', counted)
    for step in (SECOND, SECOND // 1000):
        times, rows = sampled('clear', step)
        total = 0
        for _ in planned.answer(PARAMETERS, NO_WRENCH, messages.trajectory(STAMP, times, rows)):
            # of what the platform does between points, and of where the legs lead it
            assert sum(solved) <= 2 * (planned.PIECE + 1)
            total += sum(solved)
            solved.clear()
        assert total > len(times)


@pytest.mark.parametrize('piece', [1, 2, 7, 100, 10**6])
@pytest.mark.parametrize(('name', 'step'), [
    ('clear', SECOND), ('clear', SECOND // 10), ('singular', SECOND // 2)])
def test_what_is_said_does_not_depend_on_the_pieces(
        monkeypatch: pytest.MonkeyPatch, piece: int, name: str, step: int) -> None:
    times, rows = sampled(name, step)
    for parameters in (PARAMETERS, UNBOUND):
        data = messages.trajectory(STAMP, times, rows)
        expected = outcome_of(data, parameters)
        with monkeypatch.context() as patch:
            patch.setattr(planned, 'PIECE', piece)
            assert outcome_of(data, parameters) == expected


def test_parameters_and_load_are_those_it_began_with() -> None:
    times, rows = sampled('clear', SECOND // 100)
    data = messages.trajectory(STAMP, times, rows)
    light = PARAMETERS.replaced({'platform.mass': 100.0})
    works = [planned.answer(parameters, NO_WRENCH, data) for parameters in (PARAMETERS, light)]
    outcomes: list[Outcome | None] = [None, None]
    while not all(outcomes):
        outcomes = [next(work, None) or outcome
                    for work, outcome in zip(works, outcomes, strict=True)]
    assert outcomes == [outcome_of(data), outcome_of(data, light)]


# What is refused: the motion

def legs_of(parameters: Parameters, rows: Array) -> Array:
    """Return results of rows of motion."""
    return StewartPlatform(parameters).solve(rows)


def between_points(times: Sequence[int], rows: Array) -> tuple[Array, Array]:
    """Return times and rows of motion of what the platform does between points, densely."""
    seconds = np.array(times) * 1e-9
    motion = motion_of(rows)
    between = Interpolation(np.diff(seconds), motion.rows, to_quaternion(motion.rotation))
    part = np.linspace(0.0, 1.0, 4001)
    both = [(begin + part * (end - begin), between.at(np.full(len(part), n), part))
            for n, (begin, end) in enumerate(pairwise(seconds))]
    return np.concatenate([each[0] for each in both]), np.concatenate([each[1] for each in both])


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


@pytest.mark.parametrize('whose', ['platform', 'legs'])
@pytest.mark.parametrize(('limit', 'sign'), [('limits.length_max', 1.0),
                                             ('limits.length_min', -1.0)])
def test_a_length_broken_between_points_alone_is_found(
        whose: str, limit: str, sign: float) -> None:
    rows = LEAPS[whose].copy()
    rows[:, 7:] *= sign
    dense, motions = between_points(TIMES, rows)
    of_platform = legs_of(FREE, motions)[:, LENGTHS]
    cubic_dense, of_legs, _ = cubic_between(TIMES, rows)
    extremes = {'platform': (sign * of_platform).max(), 'legs': (sign * of_legs).max()}
    other = {'platform': 'legs', 'legs': 'platform'}[whose]
    assert extremes[whose] > extremes[other] + 1e-3
    bound = sign * 0.5 * (extremes[whose] + extremes[other])
    outcome = outcome_of(messages.trajectory(STAMP, TIMES, rows), FREE.replaced({limit: [bound]}))
    assert outcome.reason == planned.LIMIT
    values = dict(outcome.values)
    time, leg = float(values['refused at (s)']), int(values['leg'][-1]) - 1
    times, lengths = (dense, of_platform) if whose == 'platform' else (cubic_dense, of_legs)
    broken = times[(sign * lengths[:, leg] > sign * bound)]
    assert broken[0] - 1e-3 <= time <= broken[-1]
    assert f'at {time:.3f} s leg_{leg + 1}: length ' in outcome.message
    assert f'beyond {limit}' in outcome.message
    # A limit that neither breaks.
    wide = bound + 2.0 * sign * abs(extremes[whose] - extremes[other])
    assert outcome_of(messages.trajectory(STAMP, TIMES, rows), FREE.replaced({limit: [wide]})
                      ).answer


@pytest.mark.parametrize(('whose', 'acceleration'), [('platform', 0.0), ('legs', 1.2)])
def test_a_rate_broken_between_points_alone_is_found(whose: str, acceleration: float) -> None:
    rows = heave(0.15, 0.0, acceleration, 0.0, -acceleration)
    dense, motions = between_points(TIMES, rows)
    of_platform = legs_of(FREE, motions)[:, RATES]
    cubic_dense, _, of_legs = cubic_between(TIMES, rows)
    extremes = {'platform': of_platform.max(), 'legs': of_legs.max()}
    other = {'platform': 'legs', 'legs': 'platform'}[whose]
    assert extremes[whose] > extremes[other] + 1e-3
    bound = 0.5 * (extremes[whose] + extremes[other])
    outcome = outcome_of(messages.trajectory(STAMP, TIMES, rows),
                         FREE.replaced({'limits.velocity_max': [bound]}))
    assert outcome.reason == planned.LIMIT
    values = dict(outcome.values)
    time, leg = float(values['refused at (s)']), int(values['leg'][-1]) - 1
    times, rates = (dense, of_platform) if whose == 'platform' else (cubic_dense, of_legs)
    broken = times[rates[:, leg] > bound]
    assert broken[0] <= time <= broken[-1]
    assert f'leg_{leg + 1}: rate ' in outcome.message
    assert 'beyond limits.velocity_max' in outcome.message
    assert outcome_of(messages.trajectory(STAMP, TIMES, rows), FREE.replaced(
        {'limits.velocity_max': [1.01 * extremes[whose]]})).answer


@pytest.mark.parametrize('duration', [SECOND, SECOND // 100])
def test_a_force_broken_between_points_alone_is_found(duration: int) -> None:
    """At rest at both ends, 10 cm or 0.2 mm apart: what moves it lies between."""
    times = [0, duration]
    rows = heave(0.1 if duration == SECOND else 2e-4)
    dense, motions = between_points(times, rows)
    forces = np.abs(legs_of(FREE, motions)[:, FORCES])
    points = forces[[0, -1]].max()
    assert forces.max() > 1.2 * points
    bound = 0.5 * (forces.max() + points)
    outcome = outcome_of(messages.trajectory(STAMP, times, rows),
                         FREE.replaced({'limits.force_max': [bound]}))
    assert outcome.reason == planned.LIMIT
    values = dict(outcome.values)
    time, leg = float(values['refused at (s)']), int(values['leg'][-1]) - 1
    broken = dense[forces[:, leg] > bound]
    assert broken[0] <= time <= broken[-1]
    assert 'beyond limits.force_max' in outcome.message
    assert 'clipped' not in outcome.message
    wide = FREE.replaced({'limits.force_max': [1.001 * forces.max()]})
    assert outcome_of(messages.trajectory(STAMP, times, rows), wide).answer


def test_a_limit_at_a_point_is_found_with_its_leg() -> None:
    times, rows = some(500)
    lengths = StewartPlatform(FREE).inverse_dynamics(motion_of(rows)).lengths
    bounds = np.full(6, 2.0)
    bounds[3] = np.sort(lengths[:, 3])[-20]
    outcome = outcome_of(messages.trajectory(STAMP, times, rows),
                         FREE.replaced({'limits.length_max': bounds}))
    first = int(np.argmax(lengths[:, 3] > bounds[3]))
    values = dict(outcome.values)
    assert values['leg'] == 'leg_4'
    assert times[first - 1] * 1e-9 < float(values['refused at (s)']) <= times[first] * 1e-9 + 1e-5


def test_of_two_troubles_the_first_is_said() -> None:
    times, rows = some(100)
    rows[60, 7] = 1.0  # a rate
    rows[20, 15] = 1000.0  # a force
    outcome = outcome_of(messages.trajectory(STAMP, times, rows))
    assert times[19] * 1e-9 < float(dict(outcome.values)['refused at (s)']) < times[21] * 1e-9


@pytest.mark.parametrize('step', [SECOND // 1000, SECOND // 100, SECOND // 10, SECOND])
def test_the_clear_motion_is_answered(step: int) -> None:
    times, rows = sampled('clear', step)
    assert len(decoded(outcome_of(messages.trajectory(STAMP, times, rows))).points) == len(times)


@pytest.mark.parametrize('step', [SECOND // 1000, SECOND // 100, SECOND // 10, SECOND])
def test_the_singular_motion_is_refused(step: int) -> None:
    times, rows = sampled('singular', step)
    data = messages.trajectory(STAMP, times, rows)
    fine, motions = between_points(times[::max(1, SECOND // 10 // step)],
                                   rows[::max(1, SECOND // 10 // step)])
    results = legs_of(FREE, motions)
    crossing = fine[np.argmax(results[:, DETERMINANT] * results[0, DETERMINANT] < 0.0)]
    forces = fine[np.argmax(np.abs(results[:, FORCES]).max(axis=1) > 6000.0)]
    stop = fine[np.argmax(results[:, CONDITION] >= 100.0)]
    for parameters, reason, time, words in (
            (PARAMETERS, planned.LIMIT, forces, 'beyond limits.force_max'),
            (FREE, planned.SINGULAR, stop, 'reaches singularity.stop_condition, 100'),
            (UNBOUND, planned.SINGULAR, crossing, 'det(J) passes zero')):
        outcome = outcome_of(data, parameters)
        assert outcome.reason == reason
        assert words in outcome.message
        values = dict(outcome.values)
        assert values['leg'] in outcome.message
        # No later than the next sample, and no sooner than it happens.
        assert -1e-3 <= float(values['refused at (s)']) - time <= 0.06
    assert float(values['refused at (s)']) == pytest.approx(crossing, abs=1e-3)


def yaw(angle: float, rate: float = 0.0, acceleration: float = 0.0) -> list[float]:
    """Return a point turned about the vertical [deg, deg/s, deg/s^2]; singular at 90."""
    half = math.radians(angle) / 2.0
    return [0.0, 0.0, 0.8, 0.0, 0.0, math.sin(half), math.cos(half), *(0.0,) * 5,
            math.radians(rate), *(0.0,) * 5, math.radians(acceleration)]


def parabola(start: float, top: float, duration: int, ways: int) -> tuple[list[int], Array]:
    """Return times and points of a turn up to an angle [deg] and back, in so many ways."""
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
        start: float, highest: float, duration: int) -> None:
    """There and back: det(J) has the same sign, and the same value, at both points."""
    seconds = duration * 1e-9

    def leap(top: float, ways: int = 1) -> tuple[bytes, Array, Array]:
        times, rows = parabola(start, top, duration, ways)
        dense, motions = between_points(times, rows)
        return (messages.trajectory(STAMP, times, rows), dense,
                legs_of(UNBOUND, motions)[:, DETERMINANT])

    # The singularity is not at 90 degrees to the last digit: the joints are rounded.
    data, dense, det = leap(highest)
    assert det[0] * det[-1] > 0.0
    crossed = det * det[0] < 0.0
    assert crossed.any()
    outcome = outcome_of(data, UNBOUND)
    assert outcome.reason == planned.SINGULAR
    assert 'det(J) passes zero' in outcome.message
    time = float(dict(outcome.values)['refused at (s)'])
    assert time == pytest.approx(dense[np.argmax(crossed)], abs=1e-3 * seconds)
    short_of = 90.0 - 2.0 * (highest - 90.0)
    data, _, det = leap(short_of)
    assert np.all(det * det[0] > 0.0)
    assert 'det(J) passes zero' not in outcome_of(data, UNBOUND).message
    # With points so near to each other the legs lead the platform where it is meant to be.
    assert outcome_of(leap(short_of, 200)[0], UNBOUND).answer


def test_where_the_legs_fold_up_on_a_wide_way_is_found() -> None:
    """Two points at rest, 20 s apart: the platform's own way between them is clear."""
    motion = Motion.from_euler([[0.3157, -0.3343, 1.0948], [-0.3375, -0.0826, 0.9219]],
                               [[-0.5036, 0.3398, 0.2156], [-0.5072, 0.5726, -1.1678]])
    rows = np.column_stack([motion.position, to_quaternion(motion.rotation), np.zeros((2, 12))])
    times = [0, 20 * SECOND]
    conditions = legs_of(FREE, between_points(times, rows)[1])[:, CONDITION]
    assert conditions.max() < 16.0
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), FREE)
    assert outcome.reason == planned.SINGULAR
    assert float(dict(outcome.values)['refused at (s)']) == pytest.approx(10.1, abs=0.1)


def test_a_machine_on_its_stops_may_go_away_from_them() -> None:
    platform = StewartPlatform(PARAMETERS)
    parked = platform.forward_kinematics(
        PARAMETERS['limits.length_min'], Pose([0.0, 0.0, 0.8], np.eye(3)))
    for digits, answered in ((12, True), (3, False)):  # 1e-3: beyond by more than rounding
        position = [*parked.position.round(15).tolist()[:2],
                    math.floor(parked.position[2] * 10.0 ** digits) / 10.0 ** digits]
        rows = np.array([[*position, *to_quaternion(parked.rotation), *REST, *REST],
                         [*HOME, *REST, *REST]])
        outcome = outcome_of(messages.trajectory(STAMP, [0, 5 * SECOND], rows))
        assert bool(outcome.answer) == answered, outcome.message


def test_where_a_singular_point_breaks_limits_the_singularity_is_said() -> None:
    rows = np.array([[0.0, 0.0, 0.0, *HOME[3:], *REST, *REST]])
    outcome = outcome_of(messages.trajectory(STAMP, [0], rows))
    assert outcome.reason == planned.SINGULAR


def test_where_the_legs_lead_the_platform_to_a_singularity_is_found() -> None:
    """
    A second from point to point, the platform turns up to 89 degrees and back, short of 90.

    The cubics of the legs, through the lengths and rates of both points, ask for lengths in
    between that there are only beyond the singularity: for no pose at all on this side.
    """
    times, rows = parabola(80.0, 89.0, SECOND, 1)
    motions = between_points(times, rows)[1]
    determinants = legs_of(UNBOUND, motions)[:, DETERMINANT]
    assert np.all(determinants * determinants[0] > 0.0)
    squares = cubic_between(times, rows)[1] ** 2
    apart = np.abs(squares[:, ::2].sum(axis=1) - squares[:, 1::2].sum(axis=1))
    limit = StewartPlatform(UNBOUND).inverse_kinematics(
        Pose.from_euler([0.0, 0.0, 0.8], [0.0, 0.0, np.pi / 2.0])) ** 2
    assert apart.max() > abs(limit[::2].sum() - limit[1::2].sum())
    outcome = outcome_of(messages.trajectory(STAMP, times, rows), UNBOUND)
    assert outcome.reason == planned.SINGULAR
    assert "the legs' way leads to" in outcome.message
    dense = messages.trajectory(STAMP, *parabola(80.0, 89.0, SECOND, 20))
    assert outcome_of(dense, UNBOUND).answer


def test_stop_condition_met_between_two_points_alone_is_found() -> None:
    times, rows = parabola(80.0, 89.0, SECOND, 20)
    dense, motions = between_points(times, rows)
    condition = legs_of(FREE, motions)[:, CONDITION]
    highest = condition.max()
    assert condition[0] < 0.5 * highest
    for stop, refused in ((0.99 * highest, True), (1.01 * highest, False)):
        parameters = FREE.replaced({'singularity.stop_condition': stop,
                                    'singularity.warn_condition': 20.0})
        outcome = outcome_of(messages.trajectory(STAMP, times, rows), parameters)
        assert bool(outcome.reason) == refused
        if refused:
            time = float(dict(outcome.values)['refused at (s)'])
            inside = dense[condition >= stop]
            assert inside[0] <= time <= inside[-1]
            assert 'reaches singularity.stop_condition' in outcome.message
        else:
            assert outcome.warning


# What is refused: the message

def spoilt(**changes: Any) -> bytes:
    """Return a message of four points, spoilt."""
    times, rows = some(4)
    times = list(changes.pop('times', times))
    for (point, column), value in changes.pop('numbers', {}).items():
        rows[point, column] = value
    return messages.trajectory(STAMP, times, rows, **changes)


WHOLE = spoilt()
BAD: dict[str, tuple[bytes, str, str]] = {
    'nothing': (b'', 'malformed', '0 bytes'),
    'no CDR': (b'\x01' + WHOLE[1:], 'malformed', 'is not plain CDR'),
    'another byte order': (b'\x00\x07' + WHOLE[2:], 'malformed', 'bytes'),
    'cut short in the header': (WHOLE[:20], 'malformed', '20 bytes'),
    'cut short in the last point': (WHOLE[:-40], 'malformed', 'points[3] is cut short'),
    'cut short by a time': (WHOLE[:-8], 'malformed', 'points[3] is cut short'),
    'no points': (messages.trajectory(STAMP, [], []), 'malformed',
                  '0 points: must be 1 to 100000'),
    'two joints': (spoilt(names=('a', 'b')), 'malformed', '2 joint_names'),
    'no transform': (spoilt(parts=[(1, 1, 1), (0, 1, 1), (1, 1, 1), (1, 1, 1)]), 'malformed',
                     'points[1]: 0 transforms: each point has one'),
    'no velocity': (spoilt(parts=[(1, 1, 1), (1, 1, 1), (1, 0, 1), (1, 1, 1)]), 'malformed',
                    'points[2]: 0 velocities: each point has one'),
    'no acceleration at the end': (spoilt(parts=[(1, 1, 1)] * 3 + [(1, 1, 0)]), 'malformed',
                                   'points[3]: 0 accelerations: each point has one'),
    'no transform at the beginning': (spoilt(parts=[(0, 1, 1)] + [(1, 1, 1)] * 3), 'malformed',
                                      'points[0]: 0 transforms: each point has one'),
    'two transforms': (spoilt(parts=[(1, 1, 1)] * 2 + [(2, 1, 1), (1, 1, 1)]), 'malformed',
                       'points[2]: 2 transforms: each point has one'),
    'poses alone': (spoilt(parts=[(1, 0, 0)] * 4), 'malformed',
                    'points[0]: 0 velocities: each point has one'),
    'another frame': (spoilt(frame='world'), 'wrong frame_id',
                      "'world', must be 'base' or empty"),
    'not finite': (spoilt(numbers={(2, 8): math.nan}), 'not finite', 'points[2]'),
    'infinite': (spoilt(numbers={(3, 18): -math.inf}), 'not finite', 'points[3]'),
    'no unit quaternion': (spoilt(numbers={(1, 6): 1.01}), 'quaternion not of unit length',
                           'points[1]: length 1.0'),
    'times that stand': (spoilt(times=[0, 5, 5, 6]), planned.TIMES,
                         'points[2]: 5e-09 s, after 5e-09 s'),
    'times that go back': (spoilt(times=[0, 2 * SECOND, SECOND, 3 * SECOND]), planned.TIMES,
                           'points[2]: 1 s, after 2 s'),
    'a time before zero': (spoilt(times=[-SECOND, 0, 1, 2]), planned.TIMES,
                           'points[0]: -1 s, must be at least 0'),
    'out of range': (spoilt(numbers={(1, 0): 1e200}), planned.TOO_FAR, 'points[0] and the next'),
    'out of range at once': (messages.trajectory(STAMP, [0], [(1e200, *HOME[1:], *REST, *REST)]),
                             'out of range', 'at 0.000 s: out of range: the numbers overflow'),
    'too far': (spoilt(times=[0, SECOND, 2 * SECOND, 10**18]), planned.TOO_FAR,
                'points[2] and the next'),
}


@pytest.mark.parametrize('case', BAD)
@pytest.mark.parametrize('names', [('platform',), ('p',)])
def test_bad_input_is_refused_in_words(case: str, names: tuple[str, ...]) -> None:
    data, reason, words = BAD[case]
    outcome = outcome_of(data)
    assert outcome.reason.startswith(reason)
    assert words in outcome.message
    assert '\n' not in outcome.message


def test_of_too_many_points_none_is_read() -> None:
    _, rows = some(1)
    one = messages.trajectory(STAMP, [1], rows)
    at = one.index(b'platform\0') + 12
    assert one[at:at + 4] == b'\x01\0\0\0'
    outcome = outcome_of(
        one[:at] + (100_001).to_bytes(4, 'little') + one[at + 4:] + bytes(100_001))
    assert outcome.message == 'refused: malformed: 100001 points: must be 1 to 100000'


def test_too_many_samples_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    times, rows = sampled('clear', SECOND)
    monkeypatch.setattr(planned, 'MOST_SAMPLES', 100)
    outcome = outcome_of(messages.trajectory(STAMP, times, rows))
    assert outcome.reason == planned.TOO_FAR
    assert 'more than 100 samples' in outcome.message


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_whatever_comes_is_answered_or_refused(data: st.DataObject) -> None:
    times, rows = some(data.draw(st.integers(1, 6)))
    message = bytearray(messages.trajectory(
        STAMP, times, rows, frame=data.draw(st.sampled_from(['', 'base'])),
        names=data.draw(st.sampled_from([(), ('platform',), ('p',)]))))
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(message) - 1))
        change = data.draw(st.binary(min_size=1, max_size=8))
        message[at:at + len(change)] = change
    cut = data.draw(st.one_of(st.none(), st.integers(0, len(message))))
    outcome = outcome_of(bytes(message[:cut]))
    if outcome.answer:
        for point in decoded(outcome).points:
            assert np.isfinite([*point.positions, *point.velocities, *point.effort]).all()


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=600))
def test_any_bytes_are_refused(data: bytes) -> None:
    assert outcome_of(data).reason


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 10**12), st.lists(st.floats(
    allow_nan=False, allow_infinity=False), min_size=15, max_size=15)), min_size=1, max_size=5))
def test_any_numbers_are_answered_or_refused(points: list[tuple[int, list[float]]]) -> None:
    times = np.cumsum([time for time, _ in points]).tolist()
    rows = [(*numbers[:3], *HOME[3:], *numbers[3:]) for _, numbers in points]
    outcome_of(messages.trajectory(STAMP, times, rows))
