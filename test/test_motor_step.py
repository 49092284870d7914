# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motors of setpoints: published torques, limits, temperatures, one by one and together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import random_motion, rng
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.limits import (
    SPEED_MAX, TEMPERATURE_RISE_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.setpoints.motor_row import ANGLES, DEMANDED_TORQUES, RISES, TORQUES
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.step import Batch, Output, Setpoint, State, Step
from test_drives import driven, HEXAPOD, PUBLISHED

STORE = get_typestore(Stores.ROS2_JAZZY)
STAMP = 1_700_000_000 * 10 ** 9
THERMAL = {'drive.thermal_resistance': 1.5, 'drive.thermal_time_constant': 2.0}


def answers(p: Parameters, motion: Motion, step: float = 0.1, restarts: Any = ()) -> list[Output]:
    """Return the outputs of setpoints one by one, after a check that many are the same."""
    one, state, found = Step(p), None, []
    n_setpoints = len(motion.rows)
    stamps = STAMP + np.rint(np.arange(n_setpoints) * step * 1e9).astype(np.int64)
    again = np.isin(np.arange(n_setpoints), restarts)
    for n, row in enumerate(motion.rows.tolist()):
        output = one(Setpoint(int(stamps[n]), tuple(row), restart=bool(again[n])), state)
        assert output is not None
        state = output.state
        found.append(output)
    middle = n_setpoints // 2
    state, written, messages = None, OutputMessages(p), {}
    for part in (slice(0, middle), slice(middle, None)):
        outputs = Step(p).many(Batch(
            stamps[part], motion.rows[part], np.zeros((1, 6)), again[part], stamps[part]), state)
        state = outputs.state
        for topic, which, many in written.of_outputs(outputs):
            for n, each in zip(which.tolist(), many, strict=True):
                messages[topic, n + (part.start or 0)] = each.tobytes()
        for n, row in enumerate(outputs.motors, part.start or 0):
            motors = np.array(found[n].motors)
            if found[n].forces is None:
                motors[TORQUES] = np.nan
            np.testing.assert_array_equal(row[:len(motors)], motors)
            assert bool(found[n].exceedances) == outputs.exceeding[n - (part.start or 0)]
    assert state == found[-1].state
    assert messages == {(topic, n): data for n, output in enumerate(found)
                        for topic, data in written.of_output(output)}
    return found


def test_motors_are_those_of_the_library() -> None:
    random = rng()
    p = driven(HEXAPOD, random, **THERMAL)
    motion = random_motion(p, random, 20)
    motors = StewartPlatform(p).motors(motion)
    rises = temperature_rises(p, 0.1 * np.arange(20), motors.copper_heat)
    for n, output in enumerate(answers(p, motion)):
        assert output.motors[TORQUES] == tuple(motors.torques[n])
        assert output.motors[ANGLES] == tuple(motors.angles[n])
        assert output.motors[RISES] == pytest.approx(rises[n], rel=1e-9)


def test_torques_are_clipped_to_the_curve_and_limits_name_each_motor() -> None:
    random = rng(1)
    p = driven(HEXAPOD, random, **{
        'drive.torque_max': 2.0, 'drive.torque_speed': [0.0, 2.5, 200.0, 1.5, 4000.0, 0.5],
        'drive.speed_max': 500.0})
    motion = random_motion(p, random, 30)
    motors = StewartPlatform(p).motors(motion)
    seen = set()
    for n, output in enumerate(answers(p, motion)):
        most = motors.available_torques[n]
        assert output.motors[TORQUES] == tuple(np.clip(motors.torques[n], -most, most))
        wanted = {(TORQUE_MAX, leg) for leg in range(6)
                  if abs(motors.breakaway_torques[n, leg]) > 2.0}
        wanted |= {(TORQUE_SPEED, leg) for leg in range(6)
                   if abs(motors.breakaway_torques[n, leg]) > most[leg] and most[leg] < 2.0}
        wanted |= {(SPEED_MAX, leg) for leg in range(6) if abs(motors.speeds[n, leg]) > 500.0}
        assert {(each.limit, each.leg) for each in output.exceedances} == wanted
        seen |= {each.limit for each in output.exceedances}
    assert seen == {TORQUE_MAX, TORQUE_SPEED, SPEED_MAX}


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_speed_and_temperature_follow_the_action_of_limits(action: str) -> None:
    random = rng(2)
    p = driven(HEXAPOD, random, **{
        **THERMAL, 'drive.speed_max': 900.0, 'limits.action': action,
        'drive.temperature_rise_max': 2.0})
    seen = set()
    for output in answers(p, random_motion(p, random, 40)):
        limits = {each.limit for each in output.exceedances}
        seen |= limits
        suppressed = action == 'suppress_forces' and bool(limits)
        assert (output.forces is None) == suppressed
        assert ('motor_torques' in dict(OutputMessages(p).of_output(output))) != suppressed
    assert seen == {SPEED_MAX, TEMPERATURE_RISE_MAX}


def test_the_torque_follows_a_clipped_force_but_limits_see_the_demanded_one() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None, 'limits.force_max': 100.0,
                          'drive.torque_max': 0.06})
    output, = answers(p, Motion(np.array([[0.0, 0.0, 1.0]]), np.eye(3)[None]))
    assert output.forces == (100.0,) * 6
    assert output.motors[TORQUES] == pytest.approx([100.0 / 3769.911184] * 6)
    assert {each.limit for each in output.exceedances} == {'limits.force_max', TORQUE_MAX}
    assert output.exceedances[6].words(p['joints']).startswith('leg_1: motor torque 0.06')


def test_windings_keep_their_temperature_where_time_jumps_back() -> None:
    random = rng(3)
    p = driven(HEXAPOD, random, **THERMAL)
    motion = random_motion(p, random, 10)
    straight, jumped = answers(p, motion), answers(p, motion, restarts=[6])
    assert jumped[5].motors == straight[5].motors
    assert jumped[6].motors[RISES] == jumped[5].motors[RISES] != straight[6].motors[RISES]


def test_a_setpoint_that_the_legs_cannot_reach_warms_no_winding() -> None:
    random = rng(4)
    p = driven(HEXAPOD, random, **THERMAL, **{'limits.velocity_max': 0.5})
    motion = random_motion(p, random, 12)
    poses = motion.position.copy()
    poses[:] = [0.0, 0.0, 1.0]
    poses[4:6, 2] = 1.2  # in a tenth of a second
    motion = Motion(poses, motion.rotation * 0.0 + np.eye(3), linear_acceleration=poses)
    outputs = answers(p, motion)
    assert [any(each.limit == 'jump' for each in output.exceedances)
            for output in outputs] == [False] * 4 + [True] * 2 + [False] * 6
    assert outputs[3].state.windings is not None
    assert outputs[3].state.windings == outputs[5].state.windings
    heat = np.tile(outputs[3].state.windings[6:], (2, 1))
    assert outputs[6].motors[RISES] == pytest.approx(temperature_rises(
        p, np.array([0.0, 0.3]), heat, np.array(outputs[3].motors[RISES]))[1], rel=1e-9)


def test_without_forces_there_are_angles_and_speeds_alone() -> None:
    p = HEXAPOD.replaced({**PUBLISHED, 'actuator.reflected_mass': None})
    quarter = Motion.from_euler([[0.0, 0.0, 1.0]], [[0.0, 0.0, np.pi / 2]])
    output = Step(p)(Setpoint(STAMP, tuple(quarter.rows[0].tolist())), State())
    assert output is not None and output.forces is None
    assert np.isnan(output.motors[DEMANDED_TORQUES]).all()
    messages = dict(OutputMessages(p).of_output(output))
    assert 'motor_torques' not in messages
    state: Any = STORE.deserialize_cdr(messages['motor_states'], 'sensor_msgs/msg/JointState')
    assert state.name == [f'leg_{n}_motor' for n in range(1, 7)]
    assert tuple(state.position) == output.motors[ANGLES] and not len(state.effort)


def test_a_motor_whose_numbers_overflow_is_not_published() -> None:
    p = HEXAPOD.replaced({'actuator.screw_lead': 1e-306, 'drive.gear_ratio': 1.0})
    fast = Motion([0.0, 0.0, 1.0], np.eye(3), [0.0, 0.0, 1e3])
    output = Step(p)(Setpoint(STAMP, tuple(fast.rows.tolist())), None)
    assert output is not None and output.motors == ()
    assert 'motor_states' not in dict(OutputMessages(p).of_output(output))


def test_nothing_is_computed_without_drives() -> None:
    output = Step(HEXAPOD.replaced({'actuator.screw_lead': 0.01}))(
        Setpoint(STAMP, tuple(Motion([0.0, 0.0, 1.0], np.eye(3)).rows.tolist())), None)
    assert output is not None and output.motors == () and output.state.windings is None
    assert 'motor_states' not in OutputMessages(HEXAPOD).types
