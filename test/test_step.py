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

"""The step from a setpoint to messages: pure, within limits, never a number that is none."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st
from messages import STORE
import numpy as np
import pytest
from referees import (
    QUARTER_TURN, random_motion, random_parameters, random_wrench, rng, symmetric_parameters)

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH, Six
from stewart_dynamics.mechanics.rotation import from_quaternion
from stewart_dynamics.mechanics.singularity import Cause, Singularity, UNSOLVABLE_CONDITION
from stewart_dynamics.runtime.step import Excess, Output, OUTPUT_TYPES, Setpoint, Step

PARAMETERS = symmetric_parameters()
STEP = Step(PARAMETERS)
UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
REST = (0.0,) * 12
STAMP = 12_000_000_034

# The machine turned as far as it is singular, and its legs and platform in one plane.
QUARTER = Setpoint(STAMP, (0.0, 0.0, 1.0, *QUARTER_TURN.ravel().tolist(), *REST))
FLAT = Setpoint(STAMP, (0.0, 0.0, 0.0, *UPRIGHT, *REST))
HOME = Setpoint(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *REST))


def rows(parameters: Parameters, many: int) -> list[tuple[Setpoint, Six]]:
    """Return random setpoints and wrenches that suit a machine."""
    random = rng()
    motion = random_motion(parameters, random, many)
    wrenches = random_wrench(parameters, random, many).tolist()
    return [(Setpoint(STAMP + n, tuple(row)), tuple(load))
            for n, (row, load) in enumerate(zip(motion.rows.tolist(), wrenches, strict=True))]


def decoded(messages: list[tuple[str, bytes]]) -> dict[str, Any]:
    """Return the messages as rosbags reads them, by topic; each topic once."""
    assert len({topic for topic, _ in messages}) == len(messages)
    return {topic: STORE.deserialize_cdr(data, OUTPUT_TYPES[topic]) for topic, data in messages}


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


def answered(step: Step, setpoint: Setpoint, wrench: Six = NO_WRENCH,
             before: Singularity | None = None) -> Output:
    output = step(setpoint._replace(wrench=wrench), before)
    assert output is not None
    return output


# What it gives

def test_it_gives_what_the_library_gives_bit_for_bit() -> None:
    random = rng()
    for _ in range(5):
        parameters = random_parameters(random)
        step, platform = Step(parameters), StewartPlatform(parameters)
        for setpoint, wrench in rows(parameters, 20):
            m = setpoint.motion
            result = platform.inverse_dynamics(Motion(
                m[0:3], np.reshape(m[3:12], (3, 3)), m[12:15], m[15:18], m[18:21], m[21:24]),
                wrench)
            output = answered(step, setpoint, wrench)
            assert output.stamp == setpoint.stamp
            assert output.lengths == tuple(result.lengths.tolist())
            assert output.rates == tuple(result.rates.tolist())
            assert output.demanded_forces == output.forces == tuple(result.forces.tolist())
            assert output.unit_load_forces == tuple(result.unit_load_forces.tolist())
            assert output.determinant == result.determinant
            assert output.determinant_rate == result.determinant_rate
            assert output.condition == result.condition_number


def test_messages_carry_the_output() -> None:
    zero = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    parameters = PARAMETERS.replaced({
        'geometry.zero_length': zero, 'joints': ['a', 'bc', 'def', 'ghij', 'élan', '六']})
    step = Step(parameters)
    for setpoint, wrench in rows(parameters, 10):
        output = answered(step, setpoint, wrench)
        messages = list(step.messages(output))
        assert [topic for topic, _ in messages] == list(OUTPUT_TYPES)
        of = decoded(messages)
        state = of['leg_states']
        assert state.header.stamp.sec * 10 ** 9 + state.header.stamp.nanosec == setpoint.stamp
        assert state.header.frame_id == ''
        assert tuple(state.name) == parameters['joints']
        assert tuple(state.position) == tuple(
            a - b for a, b in zip(output.lengths, zero, strict=True))
        assert tuple(state.velocity) == output.rates
        assert tuple(state.effort) == output.forces
        assert tuple(of['leg_lengths'].data) == output.lengths
        assert tuple(of['leg_forces'].data) == output.forces
        assert of['jacobian_determinant'].data == output.determinant
        assert of['singularity_warning'].data == output.singularity.warning


def test_the_warning_is_sent_first_and_then_at_every_change() -> None:
    state, sent = None, []
    # to the singularity and back again, slowly: nothing is foretold
    for angle in [*range(0, 89, 4), *range(88, -1, -4)]:
        half = math.radians(angle) / 2
        rotation = from_quaternion(0.0, 0.0, math.sin(half), math.cos(half))
        output = answered(STEP, Setpoint(STAMP, (0.0, 0.0, 1.0, *rotation, *REST)), NO_WRENCH,
                          state)
        message = decoded(list(STEP.messages(output))).get('singularity_warning')
        if message is not None:
            sent.append(message.data)
        changed = state is None or state.warning != output.singularity.warning
        assert (message is not None) == changed == output.warning_changed
        state = output.singularity
    assert sent == [False, True, False]


def test_it_holds_no_state() -> None:
    given = [setpoint._replace(wrench=wrench) for setpoint, wrench in rows(PARAMETERS, 30)]
    states = [None, Singularity(), Singularity(Cause.CONDITION, stopped=True, determinant=-1.0)]
    first = [STEP(setpoint, state) for setpoint in given for state in states]
    again = [STEP(setpoint, state) for setpoint in given for state in states]
    other = Step(PARAMETERS)
    backward = [other(setpoint, state)
                for setpoint in reversed(given) for state in reversed(states)]
    assert first == again == backward[::-1]
    for output in first:
        assert output is not None
        assert (list(STEP.messages(output)) == list(other.messages(output))
                == list(STEP.messages(output)))


# Limits

def test_forces_are_clipped_and_said_to_exceed() -> None:
    for setpoint, wrench in rows(PARAMETERS, 20):
        free = answered(STEP, setpoint, wrench)
        assert free.demanded_forces is not None
        assert not free.excesses
        bounds = [abs(force) * (0.5 if leg % 2 else 1.0)
                  for leg, force in enumerate(free.demanded_forces)]
        output = answered(Step(PARAMETERS.replaced({'limits.force_max': bounds})), setpoint,
                          wrench)
        assert output.demanded_forces == free.demanded_forces
        assert output.forces == tuple(
            force / 2 if leg % 2 else force for leg, force in enumerate(free.demanded_forces))
        assert output.excesses == tuple(
            Excess('limits.force_max', leg, free.demanded_forces[leg], bounds[leg])
            for leg in (1, 3, 5))
        state = decoded(list(STEP.messages(output)))
        assert tuple(state['leg_states'].effort) == output.forces
        assert tuple(state['leg_forces'].data) == output.forces


@pytest.mark.parametrize(('limit', 'factor'), [
    ('limits.length_min', 1.0), ('limits.length_max', 1.0), ('limits.velocity_max', 1.0),
    ('limits.length_min', 1.01), ('limits.length_max', 0.99), ('limits.velocity_max', 0.99)])
def test_every_limit_that_is_broken_is_listed_and_no_other(limit: str, factor: float) -> None:
    for setpoint, wrench in rows(PARAMETERS, 20):
        free = answered(STEP, setpoint, wrench)
        values = free.rates if limit == 'limits.velocity_max' else free.lengths
        bounds = [abs(value) * (factor if leg in (0, 4) else 1.0)
                  for leg, value in enumerate(values)]
        output = answered(Step(PARAMETERS.replaced({limit: bounds})), setpoint, wrench)
        assert output._replace(excesses=()) == free
        assert output.excesses == (() if factor == 1.0 else tuple(
            Excess(limit, leg, values[leg], bounds[leg]) for leg in (0, 4)))


def test_several_limits_are_listed_together() -> None:
    step = Step(PARAMETERS.replaced({
        'limits.length_min': 0.001, 'limits.length_max': 0.002, 'limits.velocity_max': 1e-9,
        'limits.force_max': 1e-9}))
    setpoint, wrench = rows(PARAMETERS, 1)[0]
    limits = [excess.limit for excess in answered(step, setpoint, wrench).excesses]
    assert limits == (['limits.length_max'] * 6 + ['limits.velocity_max'] * 6
                      + ['limits.force_max'] * 6)


# Near a singularity

def _turned(degrees: float) -> Setpoint:
    half = math.radians(degrees) / 2
    return Setpoint(STAMP, (
        0.0, 0.0, 1.0, *from_quaternion(0.0, 0.0, math.sin(half), math.cos(half)), *REST))


@pytest.mark.parametrize('action', ['warn', 'suppress_forces'])
def test_forces_are_suppressed_inside_the_stop_condition(action: str) -> None:
    parameters = PARAMETERS.replaced({
        'singularity.action': action, 'singularity.stop_condition': 100.0})
    step = Step(parameters)
    clear = answered(step, _turned(45.0))
    assert clear.forces == clear.demanded_forces is not None
    near = answered(step, _turned(89.9))
    assert 100.0 < near.condition < UNSOLVABLE_CONDITION
    assert near.demanded_forces is not None
    assert near.singularity.stopped
    of = decoded(list(step.messages(near)))
    if action == 'warn':
        assert near.forces == near.demanded_forces
        assert tuple(of['leg_forces'].data) == near.forces
    else:
        assert near.forces is None
        assert 'leg_forces' not in of
        assert len(of['leg_states'].effort) == 0
    assert tuple(of['leg_lengths'].data) == near.lengths
    assert of['singularity_warning'].data


def test_a_suppressed_force_above_its_limit_is_still_said() -> None:
    step = Step(PARAMETERS.replaced({
        'singularity.action': 'suppress_forces', 'limits.force_max': 1.0}))
    output = answered(step, _turned(89.99))
    assert output.forces is None
    assert {excess.limit for excess in output.excesses} == {'limits.force_max'}


@pytest.mark.parametrize('setpoint', [
    QUARTER, FLAT, Setpoint(STAMP, (*(
        PARAMETERS['geometry.base_joints'][2] - PARAMETERS['geometry.platform_joints'][2]
    ).tolist(), *UPRIGHT, *REST))], ids=['a quarter turn', 'flat', 'a leg without length'])
def test_a_pose_that_cannot_be_solved_gives_lengths_and_a_warning(setpoint: Setpoint) -> None:
    step = Step(PARAMETERS.replaced({'limits.force_max': 1.0}))
    output = answered(step, setpoint)
    assert output.condition >= UNSOLVABLE_CONDITION
    assert output.demanded_forces is None
    assert output.forces is None
    assert not output.excesses
    assert output.singularity.warning
    rotation = np.reshape(setpoint.motion[3:12], (3, 3))
    legs = (setpoint.motion[:3] + PARAMETERS['geometry.platform_joints'] @ rotation.T
            - PARAMETERS['geometry.base_joints'])
    assert np.allclose(output.lengths, np.linalg.norm(legs, axis=1), rtol=1e-14)
    of = decoded(list(step.messages(output)))
    assert list(of) == ['leg_states', 'leg_lengths', 'jacobian_determinant',
                        'singularity_warning']
    assert len(of['leg_states'].effort) == 0
    assert np.all(np.isfinite(numbers_of(of)))


# Numbers that overflow

@pytest.mark.parametrize('setpoint', [
    Setpoint(STAMP, (1e200, 0.0, 1.0, *UPRIGHT, *REST)),
    Setpoint(STAMP, (0.0, 0.0, 1e308, *UPRIGHT, *REST)),
    Setpoint(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *(0.0,) * 3, *(1e200,) * 3, *(0.0,) * 6)),
    Setpoint(STAMP, (0.0, 0.0, 1.0, *UPRIGHT, *(0.0,) * 6, *(1e308,) * 6)),
    HOME._replace(stamp=2 ** 31 * 10 ** 9), HOME._replace(stamp=-2 ** 63)],
    ids=['far', 'farther', 'turning', 'accelerated', 'after 2038', 'before 1901'])
def test_what_overflows_gives_nothing(setpoint: Setpoint) -> None:
    assert STEP(setpoint, None) is None
    assert STEP(HOME, None) is not None


def test_a_wrench_that_overflows_gives_nothing() -> None:
    assert STEP(HOME._replace(wrench=(1e308,) * 6), None) is None


huge = st.floats(allow_nan=False, allow_infinity=False)
sizes = huge | st.floats(-3.0, 3.0) | st.sampled_from([0.0, 1e100, -1e150, 1e154, 1e-320, 1e300])
rotations = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(
    lambda q: math.hypot(*q) > 1e-3).map(
        lambda q: from_quaternion(*(number / math.hypot(*q) for number in q))) | st.sampled_from(
            [UPRIGHT, tuple(QUARTER_TURN.ravel().tolist())])


def _check_finite(step: Step, setpoint: Setpoint, wrench: Six) -> None:
    output = step(setpoint._replace(wrench=wrench), None)
    if output is None:
        return
    after = step(setpoint._replace(wrench=wrench), output.singularity)
    assert after is not None
    for of in (output, after):
        read = decoded(list(step.messages(of)))
        assert np.all(np.isfinite(numbers_of(read)))
        assert read['leg_states'].position.shape == (6,)
        assert ('leg_forces' in read) == bool(len(read['leg_states'].effort))
        assert of.condition >= 1.0


@settings(derandomize=True, deadline=None, max_examples=400)
@given(st.tuples(sizes, sizes, sizes), rotations, st.tuples(*[sizes] * 12),
       st.tuples(*[sizes] * 6))
@example((0.0, 0.0, 0.0), UPRIGHT, REST, NO_WRENCH)
@example((0.0, 0.0, 1e150), UPRIGHT, REST, NO_WRENCH)
@example((0.0, 0.0, 1.0), UPRIGHT, (1e150,) * 12, NO_WRENCH)
def test_only_finite_numbers_are_published(
        position: tuple[float, ...], rotation: tuple[float, ...], rates: tuple[float, ...],
        wrench: Six) -> None:
    setpoint = Setpoint(STAMP, (*position, *rotation, *rates))
    _check_finite(STEP, setpoint, wrench)
    _check_finite(_LIMITED, setpoint, wrench)


_LIMITED = Step(PARAMETERS.replaced({
    'limits.force_max': 1000.0, 'limits.length_max': 2.0, 'limits.velocity_max': 1.0,
    'singularity.action': 'suppress_forces', 'geometry.zero_length': 1.79e308}))


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.floats(5e-324, 1.79e308), st.floats(0.0, 1.79e308), st.floats(0.0, 1.79e308),
       st.tuples(*[st.floats(-2.0, 2.0)] * 3), rotations, st.tuples(*[sizes] * 12))
def test_only_finite_numbers_are_published_whatever_the_machine(
        mass: float, leg_mass: float, zero_length: float, position: tuple[float, ...],
        rotation: tuple[float, ...], rates: tuple[float, ...]) -> None:
    step = Step(PARAMETERS.replaced({
        'platform.mass': mass, 'legs.piston.mass': leg_mass,
        'geometry.zero_length': zero_length}))
    _check_finite(step, Setpoint(STAMP, (*position, *rotation, *rates)), NO_WRENCH)


def test_a_restart_is_no_crossing() -> None:
    before = Singularity(Cause.CONDITION, True, -0.2, crossings=1)
    output = STEP(HOME._replace(restart=True), before)
    assert output is not None
    assert output.singularity.crossings == 1
    assert not output.singularity.warning
    assert output.warning_changed
