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

"""The plant on a moving base: balances and closed forms in the world, which does not move."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    assert_order, energy_in_world, in_world, printed_compiled_and_not, random_base_motion,
    relative, rng, rotation_about, size_of, smooth_motion)
from simulated import FRICTIONLESS, MASSLESS, random_simulated, simulated, UNLIMITED
from stewart_dynamics import BaseMotion, Motion, Parameters, StewartPlatform
from stewart_dynamics.simulator.plant import Plant, PlantState
from test_plant import motion_of, set_moving, ZERO

Array = NDArray[np.float64]
MotionOf = Callable[[Any], Motion]

GRAVITY = np.array([0.0, 0.0, -9.80665])  # world axes


def base_motion(parameters: Parameters, seed: int, scale: float = 1.0) -> MotionOf:
    """Return a motion of the base in the world as a function of time."""
    moved = smooth_motion(parameters, rng(seed))

    def at(times: Any) -> Motion:
        motion = moved(scale * np.asarray(times, dtype=float))
        return Motion(motion.position, motion.rotation, scale * motion.linear_velocity,
                      scale * motion.angular_velocity, scale ** 2 * motion.linear_acceleration,
                      scale ** 2 * motion.angular_acceleration)

    return at


def rows_at(base: MotionOf, begin: Any, period: float, gravity: Any = GRAVITY) -> Array:
    """Return the input of the plant for a period, or (..., 3, BASE) for several periods."""
    times = np.asarray(begin)[..., None] + period * np.array([0.0, 0.5, 1.0])
    rows = BaseMotion.from_motion(base(times.ravel()), gravity).rows
    return rows.reshape(*times.shape, -1)


def simpson(values: Array, step: float) -> float:
    """Return the integral of samples at equal distances, an odd number of them."""
    weights = np.ones(len(values))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    return float(weights @ values * step / 3.0)


# Energy

_HELD = 10  # periods for which a command is held: between its changes all is smooth


def balance(parameters: Any, base: MotionOf, blocks: int) -> tuple[float, float, float]:
    """
    Let a smooth motion be followed on a moving base.

    Return the change of energy in the world, the work done, and the sum of its amounts [J]. The
    work of a leg is its force times the change of its length. The work of the base is the
    negative integral of the power of the base wrench, force by velocity and moment by angular
    velocity, by Simpson's rule, with accelerations from the forward dynamics at both ends of each
    command.
    """
    plant, platform = Plant(parameters), StewartPlatform(parameters)
    period = 1.0 / parameters['rate']
    times = np.arange(blocks) * _HELD * period
    wanted = platform.inverse_dynamics(
        smooth_motion(parameters, rng(3))(times),
        base=BaseMotion.from_motion(base(times), GRAVITY))
    carried = parameters['platform.mass'] / 6.0 + parameters['actuator.reflected_mass']
    stiff, damped = 400.0 * carried, 30.0 * carried
    first = base(np.zeros(1)), motion_of(plant.state)[None]
    works = []
    for block in range(blocks):
        state = plant.state
        lengths = np.array(state.lengths)
        force = (wanted.forces[block] + stiff * (wanted.lengths[block] - lengths)
                 + damped * (wanted.rates[block] - state.rates))
        states = [state]
        begins = (block * _HELD + np.arange(_HELD)) * period
        for rows_of_base in rows_at(base, begins, period):
            states.append(plant.advance(tuple(force.tolist()), ZERO, rows_of_base))
        works.append(force @ (np.array(states[-1].lengths) - lengths))
        moving = base((block * _HELD + np.arange(_HELD + 1)) * period)
        rows = BaseMotion.from_motion(moving, GRAVITY)
        accelerated = platform.forward_dynamics(batch(states), force, base=rows)
        on_base = platform.base_wrench(accelerated, base=rows)
        velocity, spin = (np.einsum('nji,nj->ni', moving.rotation, each) for each in (
            moving.linear_velocity, moving.angular_velocity))
        power = -np.sum(on_base[:, :3] * velocity, axis=1) - np.sum(on_base[:, 3:] * spin, axis=1)
        works.append(simpson(power, period))
    assert not plant.fault
    last = base(np.array([blocks * _HELD * period])), motion_of(plant.state)[None]
    change = float((energy_in_world(parameters, *last, GRAVITY)
                    - energy_in_world(parameters, *first, GRAVITY))[0])
    return change, float(np.sum(works)), float(np.sum(np.abs(works)))


def batch(states: list[PlantState]) -> Motion:
    """Return states as one motion."""
    motions = [motion_of(state) for state in states]
    return Motion(*(np.array([getattr(each, name) for each in motions]) for name in (
        'position', 'rotation', 'linear_velocity', 'angular_velocity')))


@pytest.mark.parametrize('hexapod', ['config', 'random'])
def test_work_of_legs_and_base_is_the_change_of_energy_in_the_world(hexapod: str) -> None:
    parameters = (
        simulated(rate=1000.0, **{**FRICTIONLESS, **UNLIMITED}) if hexapod == 'config'
        else random_simulated(4, rate=1000.0, gravity=GRAVITY.tolist(), **FRICTIONLESS))
    change, work, exchanged = balance(parameters, base_motion(parameters, 8), 1000)
    assert exchanged > 10.0 * abs(change)
    assert abs(change - work) < 1e-10 * exchanged


def test_the_error_falls_with_the_fourth_power_of_the_period() -> None:
    # A violent motion of hexapod and base; a step is a period, so the base is at each stage right.
    ends = []
    for rate in (1000.0, 2000.0, 4000.0, 8000.0):
        plant = Plant(random_simulated(6, rate=rate, step=1.0 / rate, gravity=GRAVITY.tolist(),
                                       **FRICTIONLESS))
        assert plant.steps == 1
        base = base_motion(plant.parameters, 9, scale=3.0)
        set_moving(plant, [2.0, -1.0, 3.0, 8.0, -5.0, 12.0])
        for rows in rows_at(base, np.arange(round(0.2 * rate)) / rate, 1.0 / rate):
            plant.advance(ZERO, ZERO, rows)
        assert not plant.fault
        ends.append(np.array(plant.state.pose + plant.state.twist))
    assert_order(4.0, ends)


def test_steps_within_a_period_follow_the_base_as_well() -> None:
    """Ten steps of a period of 10 ms come close to ten periods, the parabola being no sine."""
    ends = []
    for rate in (100.0, 1000.0):
        plant = Plant(random_simulated(6, rate=rate, step=1e-3, gravity=GRAVITY.tolist(),
                                       **FRICTIONLESS))
        base = base_motion(plant.parameters, 9)
        for rows in rows_at(base, np.arange(round(0.5 * rate)) / rate, 1.0 / rate):
            plant.advance(ZERO, ZERO, rows)
        ends.append(np.array(plant.state.pose + plant.state.twist))
    assert 0.0 < relative(ends[0], ends[1]) < 1e-6


# Against solutions without dynamics of a moving base

def test_a_free_body_does_not_feel_the_base() -> None:
    """On legs without mass and force its path in the world is a parabola, h is constant."""
    plant = Plant(simulated(
        rate=1000.0, initial_pose=[0.0, 0.0, 30.0, 0.3, -0.2, 0.5],
        **{**FRICTIONLESS, **UNLIMITED, **MASSLESS}))
    p = plant.parameters
    base = base_motion(p, 10)
    set_moving(plant, [0.3, -0.2, 1.0, 2.0, -1.0, 3.0])
    plant.state = plant._run(0)
    xx, xy, xz, yy, yz, zz = p['platform.inertia']
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def of_body(time: float) -> tuple[Array, Array, Array]:
        world = in_world(base(time), motion_of(plant.state))
        arm = world.rotation @ p['platform.center_of_mass']
        momentum = world.rotation @ inertia @ world.rotation.T @ world.angular_velocity
        return (world.position + arm, world.linear_velocity
                + np.cross(world.angular_velocity, arm), momentum)

    center, velocity, momentum = of_body(0.0)
    for n in range(1000):
        plant.advance(ZERO, ZERO, rows_at(base, n * 1e-3, 1e-3))
    assert not plant.fault
    end, end_velocity, end_momentum = of_body(1.0)
    np.testing.assert_allclose(end, center + velocity + 0.5 * GRAVITY, atol=1e-8)
    np.testing.assert_allclose(end_velocity, velocity + GRAVITY, atol=1e-8)
    assert relative(end_momentum, momentum) < 1e-8


def followed(parameters: Any, rows: Array | None) -> PlantState:
    """Return where it is after half a second under forces."""
    plant = Plant(parameters)
    for n in range(250):
        force = 300.0 + 200.0 * np.sin(0.05 * n + np.arange(6.0))
        plant.advance(tuple(force.tolist()), (20.0, 0.0, -30.0, 5.0, 0.0, 1.0), rows)
    assert not plant.fault
    return plant.state


@pytest.mark.parametrize('seed', range(3))
def test_a_constant_velocity_of_the_base_changes_nothing(seed: int) -> None:
    parameters = random_simulated(seed, gravity=GRAVITY.tolist())
    straight = Motion([0.0, 0.0, 0.0], np.eye(3), rng(seed).uniform(-10.0, 10.0, 3))
    rows = BaseMotion.from_motion(straight, GRAVITY).rows
    for one, other in zip(followed(parameters, np.array([rows] * 3)),
                          followed(parameters, None), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-10)


def test_a_base_in_free_fall_is_one_without_gravity() -> None:
    parameters = random_simulated(2, gravity=GRAVITY.tolist())
    rows = BaseMotion(GRAVITY, GRAVITY).rows
    weightless = random_simulated(2, gravity=[0.0, 0.0, 0.0])
    for one, other in zip(followed(parameters, np.array([rows] * 3)),
                          followed(weightless, None), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-10)


def test_a_tilted_base_is_gravity_tilted() -> None:
    turn = rotation_about(np.array([0.6, 0.8, 0.0]), 0.4)
    rows = BaseMotion.from_pose(Motion([0.0, 0.0, 0.0], turn), GRAVITY).rows
    tilted = random_simulated(2, gravity=(turn.T @ GRAVITY).tolist())
    level = random_simulated(2, gravity=GRAVITY.tolist())
    for one, other in zip(followed(level, np.array([rows] * 3)), followed(tilted, None),
                          strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize('seed', range(3))
def test_the_accelerations_require_the_forces_that_acted(seed: int) -> None:
    plant = Plant(random_simulated(seed))
    random = rng(seed)
    set_moving(plant, random.uniform(-0.3, 0.3, 6))
    commands, wrench = random.uniform(-500.0, 500.0, 6), random.uniform(-300.0, 300.0, 6)
    base = random_base_motion(plant.parameters, random, 3)
    state = plant.advance(tuple(commands.tolist()), tuple(wrench.tolist()), base.rows)
    result = StewartPlatform(plant.parameters).inverse_dynamics(
        motion_of(state), wrench, base=base[2])
    assert relative(result.forces, commands) < 1e-9


def test_size_of_the_motions() -> None:
    """The base moves by tenths of the hexapod and by tens of degrees, by tenths of g."""
    parameters = random_simulated(4)
    moved = base_motion(parameters, 8)(np.arange(0.0, 10.0, 0.01))
    assert np.ptp(moved.position, axis=0).min() > 0.1 * size_of(parameters)
    assert np.abs(moved.linear_acceleration).max() > 3.0
    assert np.abs(moved.angular_acceleration).max() > 2.0


CODE = """
from test_plant_base import *
plant = Plant(simulated(rate=200.0))
base = base_motion(plant.parameters, 9)
for n in range(30):
    state = plant.advance((900.0, 800.0, 700.0, 600.0, 500.0, 9e3), ZERO,
                          rows_at(base, n * 5e-3, 5e-3))
print([number.hex() for part in state for number in part])
"""


def test_compiled_and_not_gives_the_same_bits() -> None:
    printed = printed_compiled_and_not(CODE)
    assert len(printed) == 1
    assert len(printed.pop()) > 500
