# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motors of setpoints: published torques, limits, temperatures, one by one and together."""

from __future__ import annotations

from typing import Any, NamedTuple

from checked_results import state_record
import numpy as np
import pytest
from referees import random_motion, rng
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.drives.motors import ANGLES, BREAKAWAY_TORQUES, COMMANDS
from stewart_dynamics.mechanics.limits import (
    Exceedance, SPEED_MAX, TEMPERATURE_RISE_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.step import Batch, FINITE_MOTORS, FIRST, Outputs, Step
from test_drives import driven, HEXAPOD, PUBLISHED
from test_output_messages import written
from test_step import answered, bits, singles

STORE = get_typestore(Stores.ROS2_JAZZY)
STAMP = 1_700_000_000 * 10 ** 9
THERMAL = {'drive.thermal_resistance': 1.5, 'drive.thermal_time_constant': 2.0}


class Answers(NamedTuple):
    """Outputs of setpoints a tenth of a second apart; of each the state after it and excesses."""

    outputs: Outputs
    states: list[Array]
    exceedances: list[tuple[Exceedance, ...]]


def answers(p: Parameters, motion: Motion, restarts: Any = ()) -> Answers:
    """Return the outputs of setpoints, after a check that they are the same one by one."""
    numbers = np.arange(len(motion.rows))
    setpoints = Batch.from_parts(STAMP + numbers * 10 ** 8, motion.rows,
                                 restarts=np.isin(numbers, restarts))
    step, by, state = Step(p), OutputMessages(p), FIRST
    found = Answers(outputs := answered(step, setpoints), [], [])
    for n, setpoint in enumerate(singles(setpoints)):
        output = answered(step, setpoint, state)
        state = output.state
        assert bits(output) == bits(outputs, n)
        assert written(by, output) == written(by, outputs, n)
        exceedances = step.exceedances(output)
        assert exceedances == step.exceedances(outputs, n)
        assert bool(exceedances) == outputs.exceeding[n]
        found.states.append(state)
        found.exceedances.append(exceedances)
    assert state.tobytes() == outputs.state.tobytes()
    middle = len(numbers) // 2
    parts, state = [], FIRST
    for which in (slice(0, middle), slice(middle, None)):
        part = answered(step, setpoints.chosen(which), state)
        state = part.state
        parts += [(bits(part, n), written(by, part, n)) for n in range(len(part.stamps))]
    assert parts == [(bits(outputs, n), written(by, outputs, n)) for n in numbers.tolist()]
    assert state.tobytes() == outputs.state.tobytes()
    return found


def test_motors_are_those_of_the_library() -> None:
    random = rng()
    p = driven(HEXAPOD, random, **THERMAL)
    motion = random_motion(p, random, 20)
    motors = StewartPlatform(p).motors(motion)
    rises = temperature_rises(p, 0.1 * np.arange(20), motors.copper_heat)
    outputs = answers(p, motion).outputs
    assert np.array_equal(outputs.motors[:, COMMANDS], motors.torques)
    assert np.array_equal(outputs.motors[:, ANGLES], motors.angles)
    assert outputs.rises == pytest.approx(rises, rel=1e-9)


def test_torques_are_clipped_to_the_curve_and_limits_name_each_motor() -> None:
    random = rng(1)
    p = driven(HEXAPOD, random, **{
        'drive.torque_max': 2.0, 'drive.torque_speed': [0.0, 2.5, 200.0, 1.5, 4000.0, 0.5],
        'drive.speed_max': 500.0})
    motion = random_motion(p, random, 30)
    motors = StewartPlatform(p).motors(motion)
    seen = set()
    outputs, _, exceedances = answers(p, motion)
    for n, found in enumerate(exceedances):
        most = motors.available_torques[n]
        assert np.array_equal(outputs.motors[n, COMMANDS], np.clip(motors.torques[n], -most, most))
        wanted = {(TORQUE_MAX, leg) for leg in range(6)
                  if abs(motors.breakaway_torques[n, leg]) > 2.0}
        wanted |= {(TORQUE_SPEED, leg) for leg in range(6)
                   if abs(motors.breakaway_torques[n, leg]) > most[leg] and most[leg] < 2.0}
        wanted |= {(SPEED_MAX, leg) for leg in range(6) if abs(motors.speeds[n, leg]) > 500.0}
        assert {(each.limit, each.leg) for each in found} == wanted
        seen |= {each.limit for each in found}
    assert seen == {TORQUE_MAX, TORQUE_SPEED, SPEED_MAX}


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_speed_and_temperature_follow_the_action_of_limits(action: str) -> None:
    random = rng(2)
    p = driven(HEXAPOD, random, **{
        **THERMAL, 'drive.speed_max': 900.0, 'limits.action': action,
        'drive.temperature_rise_max': 2.0})
    seen = set()
    outputs, _, exceedances = answers(p, random_motion(p, random, 40))
    for n, found in enumerate(exceedances):
        limits = {each.limit for each in found}
        seen |= limits
        suppressed = action == 'suppress_forces' and bool(limits)
        assert np.isnan(outputs.efforts[n]).tolist() == [suppressed] * 6
        assert ('motor_torques' in written(OutputMessages(p), outputs, n)) != suppressed
    assert seen == {SPEED_MAX, TEMPERATURE_RISE_MAX}


def test_the_torque_follows_a_clipped_force_but_limits_see_the_demanded_one() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None, 'limits.force_max': 100.0,
                          'drive.torque_max': 0.06})
    output, _, (exceedances,) = answers(p, Motion(np.array([[0.0, 0.0, 1.0]]), np.eye(3)[None]))
    assert output.efforts.tolist() == [[100.0] * 6]
    assert output.motors[0, COMMANDS] == pytest.approx([100.0 / 3769.911184] * 6)
    assert {each.limit for each in exceedances} == {'limits.force_max', TORQUE_MAX}
    assert exceedances[6].words(p['joints']).startswith('leg_1: motor torque 0.06')


def test_windings_keep_their_temperature_where_time_jumps_back() -> None:
    random = rng(3)
    p = driven(HEXAPOD, random, **THERMAL)
    motion = random_motion(p, random, 10)
    straight, jumped = (answers(p, motion, restarts).outputs for restarts in ([], [6]))
    assert np.array_equal(jumped.motors[5], straight.motors[5])
    assert np.array_equal(jumped.rises[6], jumped.rises[5])
    assert not np.array_equal(jumped.rises[6], straight.rises[6])


def test_a_setpoint_that_the_legs_cannot_reach_warms_no_winding() -> None:
    random = rng(4)
    p = driven(HEXAPOD, random, **THERMAL, **{'limits.velocity_max': 0.5})
    motion = random_motion(p, random, 12)
    poses = motion.position.copy()
    poses[:] = [0.0, 0.0, 1.0]
    poses[4:6, 2] = 1.2  # in a tenth of a second
    motion = Motion(poses, motion.rotation * 0.0 + np.eye(3), linear_acceleration=poses)
    outputs, states, exceedances = answers(p, motion)
    assert [any(each.limit == 'jump' for each in found) for found in exceedances] == [
        False] * 4 + [True] * 2 + [False] * 6
    kept, after = state_record(states[3]), state_record(states[5])
    assert kept['rises'].all() and kept['copper_heat'].all()
    assert np.array_equal(kept['rises'], after['rises'])
    assert np.array_equal(kept['copper_heat'], after['copper_heat'])
    heat = np.tile(kept['copper_heat'], (2, 1))
    assert outputs.rises[6] == pytest.approx(temperature_rises(
        p, np.array([0.0, 0.3]), heat, outputs.rises[3])[1], rel=1e-9)


def test_without_forces_there_are_angles_and_speeds_alone() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None})
    quarter = Motion.from_euler([[0.0, 0.0, 1.0]], [[0.0, 0.0, np.pi / 2]])
    output = answered(Step(p), Batch.from_parts(STAMP, quarter.rows))
    assert np.isnan(output.efforts).all()
    assert np.isnan(output.motors[:, BREAKAWAY_TORQUES]).all()
    messages = written(OutputMessages(p), output)
    assert 'motor_torques' not in messages
    state: Any = STORE.deserialize_cdr(messages['motor_states'], 'sensor_msgs/msg/JointState')
    assert state.name == [f'leg_{n}_motor' for n in range(1, 7)]
    assert np.array_equal(state.position, output.motors[0, ANGLES]) and not len(state.effort)


def test_a_motor_whose_numbers_overflow_is_not_published() -> None:
    p = HEXAPOD.replaced({'actuator.screw_lead': 1e-306, 'drive.gear_ratio': 1.0})
    fast = Motion([0.0, 0.0, 1.0], np.eye(3), [0.0, 0.0, 1e3])
    step, setpoint = Step(p), Batch.from_parts(STAMP, fast.rows)
    output = answered(step, setpoint)
    assert not output.rows[0, FINITE_MOTORS] and not step.exceedances(output)
    assert 'motor_states' not in written(OutputMessages(p), output)


def test_nothing_is_computed_without_drives() -> None:
    output = answered(Step(HEXAPOD.replaced({'actuator.screw_lead': 0.01})), Batch.from_parts(
        STAMP, Motion([0.0, 0.0, 1.0], np.eye(3)).rows))
    assert output.motors.shape == output.rises.shape == (1, 0)
    assert not state_record(output.state)['copper_heat'].any()
    assert 'motor_states' not in OutputMessages(HEXAPOD).types
