# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The step from a setpoint to results: no state, limits, singularities, overflow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
import math

from checked_results import checked, state_of
from hypothesis import strategies as st
import numpy as np
import pytest
from referees import (
    QUARTER_TURN, random_base_motion, random_direction, random_motion, random_parameters,
    random_wrench, relative, rng, ROOT, rotation_about, symmetric_parameters)
from stewart_dynamics import BaseMotion, Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import Array, Stamps
from stewart_dynamics.core.binding import CONSTANTS
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.mechanics.limits import (
    BASE_ANGLE_MAX, CLEARANCE_MIN, Exceedance, FORCE_MAX, JOINT_FORCE_MAX, JUMP, LENGTH_MAX,
    LENGTH_MIN, LIMITS, Limits, OF_LEGS, OF_LOADS, OF_RESULTS, PLATFORM_ANGLE_MAX, result_values,
    TOLERANCE, VELOCITY_MAX)
from stewart_dynamics.mechanics.rows import (
    FORCES, JOINT_FORCES, LENGTHS, MOTION, NO_BASE, RATES, RESULT)
from stewart_dynamics.mechanics.singularity_warning import Cause, Singularity, UNSOLVABLE_CONDITION
from stewart_dynamics.parameters.table import LEG_SHAPE
from stewart_dynamics.setpoints.base_wrench_step import BaseWrench
from stewart_dynamics.setpoints.step import Batch, FIRST, Outputs, Step

PARAMETERS = symmetric_parameters()
STEP = Step(PARAMETERS)
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
REST = (0.0,) * 12
STAMP = 12_000_000_034

# The hexapod turned as far as it is singular, and its legs and platform in one plane.
QUARTER = Batch.from_parts(STAMP, (0.0, 0.0, 1.0, *QUARTER_TURN.ravel(), *REST))
FLAT = Batch.from_parts(STAMP, (0.0, 0.0, 0.0, *UPRIGHT, *REST))
HOME = Batch.from_parts(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *REST))


def random_setpoints(parameters: Parameters, many: int) -> Batch:
    """Return random setpoints that suit a hexapod."""
    random = rng()
    return Batch.from_parts(STAMP + np.arange(many), random_motion(parameters, random, many).rows,
                            random_wrench(parameters, random, many))


def singles(setpoints: Batch) -> list[Batch]:
    """Return the setpoints of a batch, each a batch of one."""
    return [setpoints.chosen(slice(n, n + 1)) for n in range(len(setpoints.stamps))]


def each_alone(
        step: Step, setpoints: Batch) -> Iterator[tuple[Outputs, tuple[Exceedance, ...]]]:
    """Yield outputs of each setpoint alone, and the limits it exceeds: those of the batch."""
    many = step(setpoints)
    for n, setpoint in enumerate(singles(setpoints)):
        outputs = step(setpoint)
        found = step.exceedances(outputs)
        assert found == step.exceedances(many, n)
        yield outputs, found


def answered(step: Step, setpoints: Batch, before: Array = FIRST) -> Outputs:
    outputs = step(setpoints, before)
    assert outputs.answered.all()
    assert outputs.stamps.tolist() == setpoints.stamps.tolist()
    return outputs


def bits(outputs: Outputs, n: int = 0) -> list[bytes]:
    """Return the bits of all that is answered to a setpoint."""
    return [part[n].tobytes() for part in arrays(outputs)]


def arrays(outputs: Outputs) -> tuple[Stamps, Array]:
    """Return the arrays with a row for each setpoint that is answered."""
    return outputs.stamps, outputs.rows


# Results

def test_the_step_gives_the_librarys_bits() -> None:
    random = rng()
    for _ in range(5):
        parameters = random_parameters(random)
        step, platform = Step(parameters), StewartPlatform(parameters)
        for setpoint in singles(random_setpoints(parameters, 20)):
            result = platform.inverse_dynamics(
                Motion.of_rows(setpoint.motions[0]), setpoint.wrenches[0])
            output = answered(step, setpoint)
            assert np.array_equal(output.drive_positions[0], result.lengths)
            assert np.array_equal(output.rates[0], result.rates)
            assert np.array_equal(output.demanded_efforts[0], result.forces)
            assert np.array_equal(output.efforts[0], result.forces)
            assert np.array_equal(output.unit_load_forces[0], result.unit_load_forces)
            assert output.determinants[0] == result.determinant
            assert output.determinant_rates[0] == result.determinant_rate
            assert output.conditions[0] == result.condition_number


def test_the_step_keeps_no_state() -> None:
    given = singles(random_setpoints(PARAMETERS, 30))
    calls = list(product(given, (
        FIRST, state_of(Singularity(Cause.CONDITION, True, -1.0)),
        state_of(Singularity(), followed=1, stamp=STAMP - 1, lengths=1.0))))

    def found(step: Step, calls: Sequence[tuple[Batch, Array]]) -> list[list[bytes]]:
        return [[part.tobytes() for part in arrays(step(*each))] for each in calls]

    first = found(STEP, calls)
    assert first == found(STEP, calls) == found(Step(PARAMETERS), calls[::-1])[::-1]


# Limits

def test_forces_are_clipped_and_reported() -> None:
    for setpoint in singles(random_setpoints(PARAMETERS, 20)):
        free = answered(STEP, setpoint)
        forces = free.demanded_efforts[0].tolist()
        assert not STEP.exceedances(free)
        bounds = [abs(force) * (0.5 if leg % 2 else 1.0) for leg, force in enumerate(forces)]
        step = Step(PARAMETERS.replaced({'limits.force_max': bounds}))
        output = answered(step, setpoint)
        assert output.demanded_efforts[0].tolist() == forces
        assert output.efforts[0].tolist() == [
            force / 2 if leg % 2 else force for leg, force in enumerate(forces)]
        assert step.exceedances(output) == tuple(
            Exceedance('limits.force_max', leg, forces[leg], bounds[leg]) for leg in (1, 3, 5))


# Actions on limits, and jumps

RATE = 0.5  # a leg's limit [m/s]


def at(height: float, milliseconds: float, **changes: bool) -> Batch:
    """Return a setpoint at rest at a height and a time."""
    return Batch.from_parts(STAMP + round(milliseconds * 1e6), (0.0, 0.0, height, *UPRIGHT, *REST),
                            **changes)


def both_ways(step: Step, setpoints: Sequence[Batch]) -> Outputs:
    """Return the outputs of setpoints; one by one and in two parts they are the same bits."""
    whole, state = Batch.joined(setpoints), FIRST
    outputs = answered(step, whole)
    for n, setpoint in enumerate(setpoints):
        output = answered(step, setpoint, state)
        state = output.state
        assert bits(output) == bits(outputs, n)
        exceedances = step.exceedances(output)
        assert exceedances == step.exceedances(outputs, n)
        assert outputs.exceeding[n] == bool(exceedances)
        assert outputs.jumped[n] == any(each.limit == JUMP for each in exceedances)
    assert state.tobytes() == outputs.state.tobytes()
    for cut in range(len(setpoints) + 1):
        first = answered(step, whole.chosen(slice(0, cut)))
        second = answered(step, whole.chosen(slice(cut, None)), first.state)
        for parts in zip(*map(arrays, (first, second, outputs)), strict=True):
            assert np.concatenate(parts[:2]).tobytes() == parts[2].tobytes()
        assert second.state.tobytes() == outputs.state.tobytes()
    return outputs


@pytest.mark.parametrize(('limit', 'values'), [
    ('limits.length_min', (1.2, 0.8)), ('limits.length_max', (0.9, 1.2)),
    ('limits.velocity_max', (1e-3, 1.0)), ('limits.base_joint_angle_max', (1e-3, 1.0)),
    ('limits.platform_joint_angle_max', (1e-3, 1.0)), ('limits.leg_clearance_min', (0.9, 0.1))])
def test_forces_are_suppressed_while_a_limit_of_motion_is_exceeded(
        limit: str, values: tuple[float, float]) -> None:
    moving = HOME.replaced(motions=(*HOME.motions[0, :14], 0.1, *REST[3:]))
    leg = answered(STEP, moving).drive_positions.max()
    exceeded, held = (value * leg if 'length' in limit else value for value in values)
    tilted = moving.replaced(motions=(0.05, *moving.motions[0, 1:]))
    for bound, suppressed in ((exceeded, True), (held, False)):
        for action in ('warn', 'suppress_forces'):
            step = Step(PARAMETERS.replaced({
                'geometry.zero_length': leg, limit: bound, 'limits.action': action,
                **dict.fromkeys(LEG_SHAPE, 0.01)}))
            output = both_ways(step, [tilted])
            assert output.exceeding[0] == suppressed
            assert np.isnan(output.efforts[0]).tolist() == [
                suppressed and action == 'suppress_forces'] * 6
            assert np.isfinite(output.demanded_efforts).all()


def test_a_force_that_is_clipped_suppresses_nothing() -> None:
    step = Step(PARAMETERS.replaced({'limits.force_max': 1.0, 'limits.action': 'suppress_forces'}))
    output = both_ways(step, [HOME])
    assert output.exceeding[0]
    assert output.efforts[0] == pytest.approx([1.0] * 6)


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_a_setpoint_that_the_legs_cannot_reach_in_time_is_a_jump(action: str) -> None:
    step = Step(PARAMETERS.replaced({'limits.velocity_max': RATE, 'limits.action': action}))
    # Legs are steep: 1 mm of height is 0.7 to 1 mm of a leg. One outlier, then on as before.
    setpoints = [at(1.0, 0), at(1.0005, 1), at(1.1, 2), at(1.001, 3), at(1.0, 4)]
    outputs = both_ways(step, setpoints)
    assert outputs.jumped.tolist() == [False, False, True, False, False]
    assert outputs.with_efforts.tolist() == [True, True, action == 'warn', True, True]
    assert (np.isnan(outputs.efforts).T == ~outputs.with_efforts).all()
    worst = step.exceedances(outputs, 2)[0]
    lengths = outputs.drive_positions[:, worst.leg]
    assert worst.value == pytest.approx((lengths[2] - lengths[1]) / (1e-3 + CONSTANTS['JITTER']))
    assert worst.bound == RATE
    assert 'limits.velocity_max' in worst.words(PARAMETERS['joints'])


def test_after_a_jump_setpoints_are_followed_once_the_legs_can_be_there() -> None:
    step = Step(PARAMETERS.replaced({'limits.velocity_max': RATE}))
    start, end = (answered(STEP, at(height, 0)).drive_positions.max() for height in (1.0, 1.1))
    needed = 1e3 * (end - start) / RATE
    times = np.arange(1, 300, 10)
    outputs = both_ways(step, [at(1.0, 0), *(at(1.1, time) for time in times.tolist())])
    followed = times[~outputs.jumped[1:]].tolist()
    assert needed - 2.0 < followed[0] < needed + 10.0
    assert followed == list(range(followed[0], 300, 10))


def test_a_restart_and_a_stamp_of_arrival_are_no_jumps() -> None:
    step = Step(PARAMETERS.replaced({'limits.velocity_max': RATE, 'setpoint.timeout': 0.1}))
    outputs = both_ways(step, [
        at(1.0, 0), at(1.1, -500, restarts=True), at(1.12, -499.9, stamped=False),
        at(2.0, -499.8, stamped=False), at(1.1201, -499.8)])
    assert outputs.jumped.tolist() == [False, False, False, True, False]
    assert not answered(STEP, at(1e3, 1), answered(STEP, at(1.0, 0)).state).jumped[0]


def test_a_motion_at_the_rate_limit_is_no_jump() -> None:
    times = np.arange(0.0, 1000.0, 7.0)
    heights = 1.0 + 0.1 * np.sin(2e-3 * math.pi * times)
    setpoints = [at(*each) for each in zip(heights.tolist(), times.tolist(), strict=True)]
    free = answered(STEP, Batch.joined(setpoints))
    fastest = np.abs(np.diff(free.drive_positions, axis=0)).max() / 7e-3
    step = Step(PARAMETERS.replaced({'limits.velocity_max': fastest}))
    assert not both_ways(step, setpoints[:20]).jumped.any()


# Near a singularity

def _turned(degrees: float) -> Batch:
    half = math.radians(degrees) / 2
    return Batch.from_parts(STAMP, (
        0.0, 0.0, 1.0, *from_quaternion(0.0, 0.0, math.sin(half), math.cos(half)), *REST))


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_forces_are_suppressed_inside_the_stop_condition(action: str) -> None:
    parameters = PARAMETERS.replaced({
        'singularity.action': action, 'singularity.stop_condition': 100.0})
    step = Step(parameters)
    clear = answered(step, _turned(45.0))
    assert np.array_equal(clear.efforts, clear.demanded_efforts)
    near = answered(step, _turned(89.9))
    assert 100.0 < near.conditions[0] < UNSOLVABLE_CONDITION
    assert np.isfinite(near.demanded_efforts).all()
    assert near.singularity().stopped
    if action == 'warn':
        assert np.array_equal(near.efforts, near.demanded_efforts)
    else:
        assert np.isnan(near.efforts).all() and not near.with_efforts[0]
    assert near.warnings[0]


def test_a_suppressed_force_above_its_limit_is_still_reported() -> None:
    step = Step(PARAMETERS.replaced({
        'singularity.action': 'suppress_forces', 'limits.force_max': 1.0}))
    setpoint = _turned(89.99)
    output = answered(step, setpoint)
    assert np.isnan(output.efforts).all()
    assert {each.limit for each in step.exceedances(output)} == {
        'limits.force_max'}


@pytest.mark.parametrize('setpoint', [
    QUARTER, FLAT, Batch.from_parts(STAMP, (*(
        PARAMETERS['geometry.base_joints'][2] - PARAMETERS['geometry.platform_joints'][2]
    ), *UPRIGHT, *REST))], ids=['a quarter turn', 'flat', 'a leg without length'])
def test_a_pose_that_cannot_be_solved_gives_lengths_and_a_warning(setpoint: Batch) -> None:
    step = Step(PARAMETERS.replaced({'limits.force_max': 1.0}))
    output = answered(step, setpoint)
    assert output.conditions[0] >= UNSOLVABLE_CONDITION
    assert np.isnan(output.demanded_efforts).all()
    assert np.isnan(output.efforts).all()
    assert not step.exceedances(output)
    assert output.warnings[0]
    rotation = np.reshape(setpoint.motions[0, 3:12], (3, 3))
    legs = (setpoint.motions[0, :3] + PARAMETERS['geometry.platform_joints'] @ rotation.T
            - PARAMETERS['geometry.base_joints'])
    assert np.allclose(output.drive_positions[0], np.linalg.norm(legs, axis=1), rtol=1e-14)


# Numbers that overflow

@pytest.mark.parametrize('setpoint', [
    Batch.from_parts(STAMP, (1e200, 0.0, 1.0, *UPRIGHT, *REST)),
    Batch.from_parts(STAMP, (0.0, 0.0, 1e308, *UPRIGHT, *REST)),
    Batch.from_parts(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *(0.0,) * 3, *(1e200,) * 3, *(0.0,) * 6)),
    Batch.from_parts(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *(0.0,) * 6, *(1e308,) * 6)),
    Batch.from_parts(STAMP, HOME.motions, (1e308,) * 6),
    Batch.from_parts(2 ** 31 * 10 ** 9, HOME.motions), Batch.from_parts(-2 ** 63, HOME.motions)],
    ids=['far', 'farther', 'turning', 'accelerated', 'loaded', 'after 2038', 'before 1901'])
def test_a_setpoint_that_overflows_gives_nothing(setpoint: Batch) -> None:
    output = STEP(setpoint)
    assert not output.answered[0]
    assert [len(part) for part in arrays(output)] == [0] * 2
    assert STEP(HOME, output.state).answered[0]


sizes = st.floats(allow_nan=False, allow_infinity=False) | st.floats(-3.0, 3.0) | st.sampled_from(
    [0.0, 1e100, -1e150, 1e154, 1e-320, 1e300])
rotations = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(
    lambda q: math.hypot(*q) > 1e-3).map(
        lambda q: from_quaternion(*(number / math.hypot(*q) for number in q))) | st.sampled_from(
            [UPRIGHT, tuple(QUARTER_TURN.ravel().tolist())])


def test_a_restart_is_no_crossing() -> None:
    before = Singularity(Cause.CONDITION, True, -0.2, crossings=1)
    state = state_of(before, followed=1, lengths=1.0)
    output = answered(STEP, HOME.replaced(restarts=True), state)
    assert output.singularity().crossings == 1
    assert not output.warnings[0]
    assert output.changed[0]


# The base wrench of setpoints: the library's, for one and for many, and finite numbers only

MANY = 50
STAMPS = np.full(MANY, STAMP)


def base_wrenches(parameters: Parameters, setpoints: Batch) -> Array:
    """Return base wrenches (N, 6), after a check that those of one are the same bits."""
    of = BaseWrench(parameters)
    found = of(setpoints)
    assert found.tobytes() == b''.join(of(each).tobytes() for each in singles(setpoints))
    return found


@pytest.mark.parametrize('moving', [False, True], ids=['still', 'moving'])
def test_the_base_wrench_is_the_librarys_bit_for_bit(moving: bool) -> None:
    random = rng()
    for _ in range(5):
        parameters = random_parameters(random)
        motion = random_motion(parameters, random, MANY)
        wrenches = random_wrench(parameters, random, MANY)
        base = random_base_motion(parameters, random, MANY) if moving else None
        found = base_wrenches(parameters, Batch.from_parts(
            STAMPS, motion.rows, wrenches, bases=None if base is None else base.rows))
        assert np.array_equal(
            found, StewartPlatform(parameters).base_wrench(motion, wrenches, base))


def test_an_unknown_base_and_overflowing_numbers_have_no_base_wrench() -> None:
    random = rng()
    motions = random_motion(PARAMETERS, random, MANY).rows.copy()
    bases = random_base_motion(PARAMETERS, random, MANY).rows.copy()
    bases[10:20] = NO_BASE
    motions[20:25, 18:21] = 1e308
    found = base_wrenches(PARAMETERS, Batch.from_parts(
        STAMPS, motions, random_wrench(PARAMETERS, random, MANY), bases=bases))
    assert np.flatnonzero(np.isnan(found).all(axis=1)).tolist() == list(range(10, 25))
    assert np.isnan(found).sum() == 15 * 6


def weight_of(parameters: Parameters) -> float:
    return float(parameters['platform.mass'] + parameters['legs.cylinder.mass'].sum()
                 + parameters['legs.piston.mass'].sum())


@pytest.mark.parametrize('setpoint', [HOME, QUARTER, FLAT], ids=['home', 'a quarter turn', 'flat'])
def test_at_rest_it_is_the_weight_also_where_the_forces_cannot_be_solved(
        setpoint: Batch) -> None:
    found = BaseWrench(PARAMETERS)(setpoint)[0]
    assert relative(found[:3], weight_of(PARAMETERS) * PARAMETERS['gravity']) < 1e-12
    tilted = BaseMotion([0.0, 6.0, -8.0])
    found = BaseWrench(PARAMETERS)(Batch.from_parts(STAMP, setpoint.motions, bases=tilted.rows))[0]
    assert relative(found[:3], weight_of(PARAMETERS) * tilted.gravity) < 1e-12


# The limits of the legs: one rule for a row, a sample and an array, and its tolerance

GIVEN = {LENGTH_MIN: [0.9, 0.91, 0.92, 0.93, 0.94, 0.95], LENGTH_MAX: 1.5, VELOCITY_MAX: 0.5,
         FORCE_MAX: 6000.0, JOINT_FORCE_MAX: [5000.0, 5100.0, 5200.0, 5300.0, 5400.0, 5500.0],
         BASE_ANGLE_MAX: 0.5,
         PLATFORM_ANGLE_MAX: [0.3, 0.4, 0.5, 0.6, 0.7, 0.8], CLEARANCE_MIN: 0.05,
         **dict.fromkeys(LEG_SHAPE, 0.01)}
WITHIN = {LENGTH_MIN: 1.2, LENGTH_MAX: 1.2, CLEARANCE_MIN: 0.1}  # others 0.0


@pytest.mark.parametrize('limit', OF_LEGS)
@pytest.mark.parametrize('leg', range(6))
def test_row_sample_and_array_agree_on_each_limit_of_each_leg(limit: str, leg: int) -> None:
    parameters = symmetric_parameters().replaced(GIVEN)
    limits = Limits(parameters)
    bound = float(limits.bounds[limit][leg])
    outward = -1.0 if LIMITS[limit].minimum else 1.0
    signs = (1.0, -1.0) if limit in (VELOCITY_MAX, *OF_LOADS) else (1.0,)
    for (excess, exceeded), sign in product((
            (0.0, False), (0.5 * TOLERANCE, False), (-0.01, False), (2.0 * TOLERANCE, True),
            (0.1, True)), signs):
        values = {name: np.full(6, WITHIN.get(name, 0.0)) for name in OF_LEGS}
        values[limit][leg] = value = sign * bound * (1.0 + excess * outward)
        if limit in (LENGTH_MIN, LENGTH_MAX):
            values[LENGTH_MIN] = values[LENGTH_MAX] = values[limit]
        for name in OF_LEGS:
            expected = [exceeded and name == limit and n == leg for n in range(6)]
            assert limits.exceeds(name, values[name]).tolist() == expected
        other = (1, 2, 3, 4, 5, 0)[leg] if limit == CLEARANCE_MIN else -1
        assert limits.exceeded({name: tuple(each.tolist()) for name, each in values.items()},
                               (1, 2, 3, 4, 5, 0)) == (
            (Exceedance(limit, leg, value, bound, other),) if exceeded else ())
        result = np.zeros(RESULT)
        for name in OF_RESULTS:
            result[LIMITS[name].columns] = values[name]
        assert checked(parameters, result)[1] == (exceeded and limit in OF_RESULTS)


def test_values_of_a_sample_are_those_of_their_limits() -> None:
    row = np.arange(float(RESULT))
    found = {name: values.tolist() for name, values in result_values(PARAMETERS, row).items()}
    assert found == {
        LENGTH_MIN: row[LENGTHS].tolist(), LENGTH_MAX: row[LENGTHS].tolist(),
        VELOCITY_MAX: row[RATES].tolist(), FORCE_MAX: row[FORCES].tolist(),
        JOINT_FORCE_MAX: row[JOINT_FORCES].tolist()}


def test_a_limit_that_is_not_given_is_never_exceeded() -> None:
    limits = Limits(symmetric_parameters())
    huge = rng().choice([-1e300, 1e300], (5, 6))
    assert not any(limits.exceeds(limit, huge).any() for limit in OF_LEGS)
    for value in (1e300, -1e300):
        assert limits.exceeded(dict.fromkeys(OF_LEGS, (value,) * 6)) == ()
    assert np.isinf(limits.force_max).all() and not limits.bounds


def test_unknown_forces_exceed_no_limit() -> None:
    for limit in OF_LOADS:
        limited = symmetric_parameters().replaced({limit: 1.0})
        limits, result = Limits(limited), np.zeros(RESULT)
        result[LENGTHS], result[LIMITS[limit].columns] = 1.2, 5.0
        assert checked(limited, result)[1]
        assert not checked(limited, result, base_known=False)[1]
        result[LIMITS[limit].columns] = np.nan
        assert limits.exceeded(result_values(PARAMETERS, result)) == ()


@pytest.mark.parametrize(('exceedance', 'words'), [
    (Exceedance(LENGTH_MIN, 0, 0.9, 0.95), 'a: length 0.9 m is 0.05 m below limits.length_min'),
    (Exceedance(PLATFORM_ANGLE_MAX, 2, 0.75, 0.5),
     'c: platform joint angle 0.75 rad is 0.25 rad above limits.platform_joint_angle_max'),
    (Exceedance(CLEARANCE_MIN, 3, -0.25, 0.5),
     'd: clearance -0.25 m is 0.75 m below limits.leg_clearance_min'),
    (Exceedance(LENGTH_MAX, 1, 1.75, 1.5), 'b: length 1.75 m is 0.25 m above limits.length_max'),
    (Exceedance(VELOCITY_MAX, 2, -0.75, 0.5),
     'c: rate -0.75 m/s is 0.25 m/s above limits.velocity_max'),
    (Exceedance(FORCE_MAX, 5, -7000.0, 6000.0),
     'f: force -7000 N is 1000 N above limits.force_max')])
def test_the_text_says_which_leg_and_by_how_much(exceedance: Exceedance, words: str) -> None:
    assert exceedance.words('abcdef') == words


def test_the_time_to_a_dead_centre_is_that_of_the_square_of_the_lever() -> None:
    p = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
    platform, step, random, h = StewartPlatform(p), Step(p), rng(5), 1e-6
    home, size = platform.home_pose().position, p['legs.crank.length']
    rows = np.zeros((40, MOTION))
    for row in rows:
        row[3:12] = rotation_about(random_direction(random), random.uniform(0.0, 0.1)).ravel()
        row[:3] = home + random.uniform(-0.03, 0.03, 3)
        row[12:18] = random.uniform(-1.0, 1.0, 6)
    later = rows.copy()
    later[:, :3] += h * rows[:, 12:15]
    for row, omega in zip(later, rows[:, 15:18], strict=True):
        turn = rotation_about(omega / np.linalg.norm(omega), h * float(np.linalg.norm(omega)))
        row[3:12] = (turn @ row[3:12].reshape(3, 3)).ravel()
    squares, after = (platform.inverse_dynamics(Motion.of_rows(each)).levers ** 2
                      for each in (rows, later))
    rate = (after - squares) / h
    with np.errstate(divide='ignore'):
        expected = np.where(rate < 0.0, ((0.1 * size) ** 2 - squares) / rate, np.inf)
    found = step(Batch.from_parts(np.arange(40), rows)).lever_times
    near = np.isfinite(expected) & (expected < 10.0)
    assert near.sum() > 60
    np.testing.assert_allclose(found[near], expected[near], rtol=1e-4)
    assert (found[~np.isfinite(expected)] == np.inf).mean() > 0.95
    # Telescopic legs have none.
    assert (answered(STEP, HOME).lever_times == np.inf).all()
