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

"""Forward dynamics: identities with the inverse dynamics, and independent physics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import (
    each_relative, friction, PinocchioReferee, random_base_motion, random_motion,
    random_parameters, random_wrench, rng, uncompiled)

from stewart_dynamics import Motion, MotionError, Parameters, StewartPlatform
from stewart_dynamics.mechanics.dynamics import forward_dynamics
from stewart_dynamics.mechanics.rows import NO_BASE

STATES = 20
STILL = np.array([NO_BASE])


def accelerations(motion: Motion) -> Any:
    """Return linear and angular accelerations, six numbers a sample."""
    return np.concatenate([motion.linear_acceleration, motion.angular_acceleration], axis=-1)


@pytest.mark.parametrize('seed', range(50))
def test_the_forces_of_a_motion_give_its_accelerations_back(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion, wrench = random_motion(p, random, STATES), random_wrench(p, random, STATES)
    forces = platform.inverse_dynamics(motion, wrench).forces
    back = platform.forward_dynamics(motion, forces, wrench)
    assert each_relative(accelerations(back), accelerations(motion)) < 1e-12
    assert np.array_equal(back.rows[:, :18], motion.rows[:, :18])


@pytest.mark.parametrize('seed', range(50))
def test_the_accelerations_of_forces_demand_these_forces(seed: int) -> None:
    random = rng(1000 + seed)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion, wrench = random_motion(p, random, STATES), random_wrench(p, random, STATES)
    forces = random.uniform(-2000.0, 2000.0, (STATES, 6))
    back = platform.inverse_dynamics(platform.forward_dynamics(motion, forces, wrench), wrench)
    assert each_relative(back.forces, forces) < 1e-11


@pytest.mark.parametrize('seed', range(5))
def test_pinocchios_forces_give_the_accelerations(seed: int) -> None:
    pytest.importorskip('pinocchio')
    random = rng(seed)
    p = random_parameters(random)
    referee = PinocchioReferee(p, random)
    motion, wrench = random_motion(p, random, 5), random_wrench(p, random, 5)
    forces = [referee.forces(Motion(*parts), load) for *parts, load in zip(
        motion.position, motion.rotation, motion.linear_velocity, motion.angular_velocity,
        motion.linear_acceleration, motion.angular_acceleration, wrench, strict=True)]
    back = StewartPlatform(p).forward_dynamics(motion, forces, wrench)
    assert each_relative(accelerations(back), accelerations(motion)) < 1e-11


@pytest.mark.parametrize('seed', range(5))
def test_it_solves_the_lagrange_equations(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion, wrench = random_motion(p, random, STATES), random_wrench(p, random, STATES)
    forces = random.uniform(-2000.0, 2000.0, (STATES, 6))
    j_inv = platform.inverse_jacobian(motion)
    twist = np.concatenate([motion.linear_velocity, motion.angular_velocity], axis=-1)
    c = platform.coriolis_matrix(motion)
    rates = np.einsum('nij,nj->ni', j_inv, twist)
    right = (np.einsum('nji,nj->ni', j_inv, forces - friction(p, rates)) + wrench
             - np.einsum('nij,nj->ni', c, twist)
             - platform.gravity_vector(motion))
    mass = platform.mass_matrix(motion)
    truth = np.linalg.solve(mass, right[..., None])[..., 0]
    found = accelerations(platform.forward_dynamics(motion, forces, wrench))
    assert each_relative(found, truth) < 1e-11


def test_a_platform_on_massless_legs_without_forces_falls_and_tumbles_freely() -> None:
    p = Parameters({
        'geometry.base_joints': random_parameters(rng())['geometry.base_joints'].ravel(),
        'geometry.platform_joints': random_parameters(rng())['geometry.platform_joints'].ravel(),
        'platform.mass': 80.0, 'platform.center_of_mass': [0.1, -0.05, 0.2],
        'platform.inertia': [5.0, 0.2, -0.3, 6.0, 0.1, 8.0]})
    motion = random_motion(p, rng(), STATES)
    free = StewartPlatform(p).forward_dynamics(motion, np.zeros(6))
    r, w = motion.rotation, motion.angular_velocity
    inertia = r @ np.array([[5.0, 0.2, -0.3], [0.2, 6.0, 0.1], [-0.3, 0.1, 8.0]]) @ np.swapaxes(
        r, -1, -2)
    # Euler's equation, and Newton's of the center of mass
    spin = np.cross(w, np.einsum('nij,nj->ni', inertia, w))
    alpha = -np.linalg.solve(inertia, spin[..., None])[..., 0]
    com = r @ p['platform.center_of_mass']
    fall = p['gravity'] - np.cross(alpha, com) - np.cross(w, np.cross(w, com))
    assert each_relative(free.angular_acceleration, alpha) < 1e-13
    assert each_relative(free.linear_acceleration, fall) < 1e-13


def test_a_singular_pose_has_accelerations() -> None:
    p = random_parameters(rng())
    platform = StewartPlatform(p.replaced({'geometry.platform_joints': (
        0.5 * p['geometry.base_joints']).ravel()}))  # parallel legs: no forces hold a turn
    motion = Motion([0.0, 0.0, 1.0], np.eye(3), [0.1, 0.2, 0.3], [0.1, 0.2, 0.3])
    assert np.all(np.isfinite(accelerations(platform.forward_dynamics(motion, np.ones(6)))))


def test_any_leading_shape_gives_the_same_samples() -> None:
    p = random_parameters(rng())
    platform = StewartPlatform(p)
    motion = random_motion(p, rng(), 12)
    forces, wrench = np.arange(12.0 * 6).reshape(12, 6), random_wrench(p, rng(), 12)
    truth = platform.forward_dynamics(motion, forces, wrench).rows
    shaped = Motion(*(part.reshape(3, 4, *part.shape[1:]) for part in (
        motion.position, motion.rotation, motion.linear_velocity, motion.angular_velocity)))
    found = platform.forward_dynamics(shaped, forces.reshape(3, 4, 6), wrench.reshape(3, 4, 6))
    assert np.array_equal(found.rows.reshape(12, -1), truth)
    one = Motion(motion.position[5], motion.rotation[5], motion.linear_velocity[5],
                 motion.angular_velocity[5])
    assert np.array_equal(platform.forward_dynamics(one, forces[5], wrench[5]).rows, truth[5])
    assert platform.forward_dynamics(one, forces).shape == (12,)
    assert platform.forward_dynamics(motion, forces[0], wrench[0]).shape == (12,)


def test_a_large_batch_on_many_threads_is_its_samples_bit_for_bit() -> None:
    p = random_parameters(rng())
    platform = StewartPlatform(p)
    motion = random_motion(p, rng(), 20_000)
    forces = rng().uniform(-1000.0, 1000.0, (20_000, 6))
    rows = motion.rows.copy()
    forward_dynamics.solve(
        platform.constants, rows, forces, np.zeros((1, 6)), STILL,
        np.empty(forward_dynamics.WORK))
    assert np.array_equal(platform.forward_dynamics(motion, forces).rows, rows)


@pytest.mark.parametrize(('forces', 'wrench', 'text'), [
    (np.zeros(5), None, 'forces: shape (5,): must end in (6,)'),
    ([np.nan] * 6, None, 'forces[0]: nan: must be finite'),
    (np.zeros((4, 6)), None, 'motion (3,), forces (4,)'),
    (np.zeros(6), np.zeros(5), 'wrench: shape (5,)'),
    ([1e308] * 6, None, 'overflow')])
def test_arguments_of_wrong_shape_are_rejected(forces: Any, wrench: Any, text: str) -> None:
    p = random_parameters(rng())
    with pytest.raises(MotionError) as error:
        StewartPlatform(p).forward_dynamics(random_motion(p, rng(), 3), forces, wrench)
    assert text in str(error.value)


def test_uncompiled_results_are_the_compiled_ones_bit_for_bit() -> None:
    p = random_parameters(rng())
    rows, forces = random_motion(p, rng(), 10).rows, np.arange(60.0).reshape(10, 6)
    hexapod, wrench = StewartPlatform(p).constants, random_wrench(p, rng(), 10)
    base = random_base_motion(p, rng(), 10).rows
    base[::3] = np.nan
    given = {'hexapod': hexapod, 'rows': rows.copy(), 'forces': forces, 'wrench': wrench,
             'base': base, 'work': np.empty(forward_dynamics.WORK)}
    plain = uncompiled(
        'from stewart_dynamics.mechanics.dynamics.forward_dynamics import solve\n'
        "solve(given['hexapod'], given['rows'], given['forces'], given['wrench'],\n"
        "      given['base'], given['work'])\n", given)
    forward_dynamics.solve(hexapod, rows, forces, wrench, base, np.empty(forward_dynamics.WORK))
    assert np.array_equal(plain['rows'], rows)
