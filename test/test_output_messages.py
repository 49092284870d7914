# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages published for results: the same for one and for many, and finite numbers only."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
from messages import STORE
import numpy as np
import pytest
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.output_messages import output_types, OutputMessages
from stewart_dynamics.setpoints.step import Batch, FIRST, Outputs, Step
from test_step import (
    answered, FLAT, PARAMETERS, QUARTER, random_setpoints, REST, rotations, singles, sizes, STAMP,
    STEP, UPRIGHT)

OUTPUT_TYPES = output_types(TELESCOPIC)
MESSAGES = OutputMessages(PARAMETERS)


def written(by: OutputMessages, outputs: Outputs, n: int = 0) -> dict[str, bytes]:
    """Return the messages of an output by topic; each topic once."""
    found: dict[str, bytes] = {}
    for topic, having, messages in by.write_outputs(outputs):
        assert len(having) == len(messages) == len(outputs.stamps)
        if having[n]:
            assert topic not in found
            found[topic] = messages[n].tobytes()
    return found


def decoded(messages: dict[str, bytes]) -> dict[str, Any]:
    """Return the messages as rosbags reads them, by topic."""
    return {topic: STORE.deserialize_cdr(data, OUTPUT_TYPES[topic])
            for topic, data in messages.items()}


def numbers_of(messages: dict[str, Any]) -> list[float]:
    """Return all the numbers in them."""
    found: list[float] = []
    for topic, message in messages.items():
        if topic == 'leg_states':
            found += [*message.position, *message.velocity, *message.effort]
        elif topic in ('leg_lengths', 'leg_forces'):
            found += list(message.data)
        else:
            found.append(float(message.data))
    return found


def test_messages_carry_the_output() -> None:
    zero = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    parameters = PARAMETERS.replaced({
        'geometry.zero_length': zero, 'joints': ['a', 'bc', 'def', 'ghij', 'élan', '六']})
    step, by = Step(parameters), OutputMessages(parameters)
    for setpoint in singles(random_setpoints(parameters, 10)):
        output = answered(step, setpoint)
        messages = written(by, output)
        assert list(messages) == [
            topic for topic in OUTPUT_TYPES if topic != BASE_WRENCH]
        of = decoded(messages)
        state = of['leg_states']
        assert state.header.stamp.sec * 10 ** 9 + state.header.stamp.nanosec == setpoint.stamps[0]
        assert state.header.frame_id == ''
        assert tuple(state.name) == parameters['joints']
        assert np.array_equal(state.position, output.drive_positions[0] - zero)
        assert np.array_equal(state.velocity, output.rates[0])
        assert np.array_equal(state.effort, output.efforts[0])
        assert np.array_equal(of['leg_lengths'].data, output.drive_positions[0])
        assert np.array_equal(of['leg_forces'].data, output.efforts[0])
        assert of['jacobian_determinant'].data == output.determinants[0]
        assert of['singularity_warning'].data == output.warnings[0]


def test_the_warning_is_sent_first_and_then_at_every_change() -> None:
    state, warned, sent = FIRST, None, []
    # to the singularity and back again, slowly: nothing is predicted
    for angle in [*range(0, 89, 4), *range(88, -1, -4)]:
        half = math.radians(angle) / 2
        rotation = from_quaternion(0.0, 0.0, math.sin(half), math.cos(half))
        output = answered(STEP, Batch.from_parts(STAMP, (0.0, 0.0, 1.0, *rotation, *REST)), state)
        message = decoded(written(MESSAGES, output)).get('singularity_warning')
        if message is not None:
            sent.append(message.data)
        changed = warned != output.warnings[0]
        assert (message is not None) == changed == output.changed[0]
        state, warned = output.state, output.warnings[0]
    assert sent == [False, True, False]


@pytest.mark.parametrize('setpoint', [QUARTER, FLAT], ids=['a quarter turn', 'flat'])
def test_without_forces_there_are_none_in_the_messages(setpoint: Batch) -> None:
    of = decoded(written(MESSAGES, answered(STEP, setpoint)))
    assert list(of) == ['leg_states', 'leg_lengths', 'jacobian_determinant',
                        'singularity_warning']
    assert len(of['leg_states'].effort) == 0
    assert np.all(np.isfinite(numbers_of(of)))


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_many_messages_are_those_of_one_after_the_other(action: str) -> None:
    """Toward a singularity and away, with forces and without, clipped and not."""
    parameters = PARAMETERS.replaced({
        'singularity.action': action, 'limits.force_max': 1000.0,
        'geometry.zero_length': [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        'joints': ['a', 'bc', 'def', 'ghij', 'élan', '六']})
    step, by = Step(parameters), OutputMessages(parameters)
    angles = np.radians([*range(60, 90, 3), 90, *range(89, 60, -3)])
    setpoints = Batch.from_parts(STAMP + np.arange(len(angles)), [
        (0.0, 0.0, 1.0, *from_quaternion(0.0, 0.0, math.sin(half), math.cos(half)), *REST)
        for half in angles / 2])
    outputs, state = answered(step, setpoints), FIRST
    for n, setpoint in enumerate(singles(setpoints)):
        output = answered(step, setpoint, state)
        state = output.state
        assert written(by, outputs, n) == written(by, output)
    assert 0 < np.count_nonzero(outputs.with_efforts) < len(angles)


def test_an_external_wrench_is_written_in_the_base_frame() -> None:
    parameters = PARAMETERS.replaced({'base_frame': 'sol'})
    wrench = (1.0, -2.0, 3.0, -4.0, 5.0, -6.0)
    read = STORE.deserialize_cdr(OutputMessages(parameters).write_wrench(
        STAMP, wrench), 'geometry_msgs/msg/WrenchStamped')
    assert read.header.frame_id == 'sol'
    assert read.header.stamp.sec * 10 ** 9 + read.header.stamp.nanosec == STAMP
    force, torque = read.wrench.force, read.wrench.torque
    assert (force.x, force.y, force.z, torque.x, torque.y, torque.z) == wrench


@pytest.mark.parametrize('frame', ['base', 'sol', 'é', ''])
def test_base_wrenches_are_written_alike_one_by_one_and_together(frame: str) -> None:
    by = OutputMessages(PARAMETERS.replaced({'base_frame': frame} if frame else {}))
    stamps = STAMP + 10 ** 9 * np.arange(4)
    wrenches = np.arange(24.0).reshape(4, 6) - 11.5
    wrenches[2] = np.nan
    topic, having, many = by.write_base_wrenches(stamps, wrenches)
    assert OUTPUT_TYPES[topic] == 'geometry_msgs/msg/WrenchStamped'
    assert having.tolist() == [True, True, False, True]
    one = [by.write_wrench(int(stamps[n]), wrenches[n].tolist()) for n in (0, 1, 3)]
    assert [each.tobytes() for each in many[having]] == one
    read = STORE.deserialize_cdr(one[1], OUTPUT_TYPES[topic])
    assert read.header.frame_id == frame or not frame
    assert read.header.stamp.sec * 10 ** 9 + read.header.stamp.nanosec == stamps[1]
    force, torque = read.wrench.force, read.wrench.torque
    assert [force.x, force.y, force.z, torque.x, torque.y, torque.z] == wrenches[1].tolist()


def _check_finite(step: Step, setpoint: Batch) -> None:
    output = step(setpoint)
    if not output.answered[0]:
        return
    by = OutputMessages(step.parameters)
    for of in (output, answered(step, setpoint, output.state)):
        read = decoded(written(by, of))
        assert np.all(np.isfinite(numbers_of(read)))
        assert read['leg_states'].position.shape == (6,)
        assert ('leg_forces' in read) == bool(len(read['leg_states'].effort))
        assert of.conditions[0] >= 1.0


@given(st.tuples(sizes, sizes, sizes), rotations, st.tuples(*[sizes] * 12),
       st.tuples(*[sizes] * 6))
@example((0.0, 0.0, 0.0), UPRIGHT, REST, NO_WRENCH)
@example((0.0, 0.0, 1e150), UPRIGHT, REST, NO_WRENCH)
@example((0.0, 0.0, 1.0), UPRIGHT, (1e150,) * 12, NO_WRENCH)
def test_only_finite_numbers_are_published(
        position: tuple[float, ...], rotation: tuple[float, ...], rates: tuple[float, ...],
        wrench: Six) -> None:
    setpoint = Batch.from_parts(STAMP, (*position, *rotation, *rates), wrench)
    _check_finite(STEP, setpoint)
    _check_finite(_LIMITED, setpoint)


_LIMITED = Step(PARAMETERS.replaced({
    'limits.force_max': 1000.0, 'limits.length_max': 2.0, 'limits.velocity_max': 1.0,
    'singularity.action': 'suppress_forces', 'geometry.zero_length': 1.79e308}))


@given(st.floats(5e-324, 1.79e308), st.floats(0.0, 1.79e308), st.floats(0.0, 1.79e308),
       st.tuples(*[st.floats(-2.0, 2.0)] * 3), rotations, st.tuples(*[sizes] * 12))
def test_only_finite_numbers_are_published_for_any_hexapod(
        mass: float, leg_mass: float, zero_length: float, position: tuple[float, ...],
        rotation: tuple[float, ...], rates: tuple[float, ...]) -> None:
    step = Step(PARAMETERS.replaced({
        'platform.mass': mass, 'legs.piston.mass': leg_mass,
        'geometry.zero_length': zero_length}))
    _check_finite(step, Batch.from_parts(STAMP, (*position, *rotation, *rates)))
