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


"""Force breakdown by source: the parts sum to the forces, and each equals its own formula."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    friction, QUARTER_TURN, random_motion, random_parameters, random_wrench, rng, size_of,
    symmetric_parameters)

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.dynamics.force_breakdown import ForceBreakdownRows, SOURCES
from stewart_dynamics.parameters.table import inertia_matrix

Array = NDArray[np.float64]

MANY = 20
GRAVITY, PLATFORM, LEGS, VELOCITY, FRICTION, WRENCH = range(6)


def split(p: Parameters, motion: Motion, wrench: Array) -> Array:
    """Return the forces by source of a batch."""
    return ForceBreakdownRows(p)(motion.rows, wrench)


def off(value: Array, truth: Array, forces: Array) -> float:
    """Return the largest error in any sample, by the largest force of any source there."""
    return float(np.max(np.abs(value - truth).max(axis=1) / np.abs(forces).max(axis=(1, 2))))


def solved(p: Parameters, motion: Motion, load: Array) -> Array:
    """Return the leg forces that hold a load (N, 6): J_inv^-T load."""
    j_inv = lagrange.inverse_jacobian(lagrange.legs(p, motion.position, motion.rotation))
    f: Array = np.linalg.solve(np.swapaxes(j_inv, -1, -2), load[..., None])[..., 0]
    return f


def platform_load(p: Parameters, motion: Motion) -> Array:
    """Return what accelerates the platform alone, no velocities (N, 6): Newton and Euler."""
    c = motion.rotation @ p['platform.center_of_mass']
    turn = motion.rotation @ inertia_matrix(p['platform.inertia']) @ np.swapaxes(
        motion.rotation, -1, -2)
    alpha = motion.angular_acceleration
    force = p['platform.mass'] * (motion.linear_acceleration + np.cross(alpha, c))
    moment = np.einsum('nij,nj->ni', turn, alpha) + np.cross(c, force)
    return np.concatenate([force, moment], axis=1)


@pytest.mark.parametrize('hexapod', range(25))
def test_each_source_equals_that_of_the_reference_matrices(hexapod: int) -> None:
    random = rng(hexapod)
    p = random_parameters(random)
    motion = random_motion(p, random, MANY)
    wrench = random_wrench(p, random, MANY)
    forces = split(p, motion, wrench)
    x, r, v, w = (motion.position, motion.rotation, motion.linear_velocity,
                  motion.angular_velocity)
    twist = np.concatenate([v, w], axis=1)
    acceleration = motion.rows[:, 18:24]
    inertia = np.einsum('nij,nj->ni', lagrange.mass_matrix(p, x, r), acceleration)
    of_platform = platform_load(p, motion)
    velocity = np.einsum('nij,nj->ni', lagrange.coriolis_matrix(p, x, r, v, w), twist)
    rates = np.einsum('nij,nj->ni', lagrange.inverse_jacobian(lagrange.legs(p, x, r)), twist)
    truths = {
        GRAVITY: solved(p, motion, lagrange.gravity_vector(p, x, r)),
        PLATFORM: solved(p, motion, of_platform),
        LEGS: solved(p, motion, inertia - of_platform),
        VELOCITY: solved(p, motion, velocity), FRICTION: friction(p, rates),
        WRENCH: -solved(p, motion, wrench)}
    for source, truth in truths.items():
        assert np.abs(truth).max() > 1.0, SOURCES[source]
        assert off(forces[:, source], truth, forces) < 1e-11, SOURCES[source]


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10 ** 6), st.integers(1, 100), st.booleans())
def test_the_breakdown_sum_to_the_force(seed: int, many: int, loaded: bool) -> None:
    random = rng(seed)
    p = random_parameters(random)
    motion = random_motion(p, random, many)
    wrench = random_wrench(p, random, many) if loaded else np.zeros((many, 6))
    forces = split(p, motion, wrench)
    assert forces.shape == (many, len(SOURCES), 6)
    whole = StewartPlatform(p).inverse_dynamics(motion, wrench).forces
    assert off(forces.sum(axis=1), whole, forces) < 1e-12


def test_many_are_split_as_each_alone() -> None:
    random = rng()
    p = random_parameters(random)
    motion = random_motion(p, random, 2500)
    wrench = random_wrench(p, random, 2500)
    forces = split(p, motion, wrench)
    breakdown = ForceBreakdownRows(p)
    for n in (0, 1023, 1024, 1025, 2499):
        alone = breakdown(motion.rows[n:n + 1], wrench[n:n + 1])
        np.testing.assert_array_equal(forces[n], alone[0])
    same = np.repeat(wrench[:1], 2500, axis=0)
    np.testing.assert_array_equal(split(p, motion, wrench[:1]), split(p, motion, same))


def near_a_singularity(turn: float, p: Parameters) -> Motion:
    """Return the symmetric hexapod turned towards a quarter, where J_inv cannot be solved."""
    c, s = np.cos(turn), np.sin(turn)
    return Motion([[0.0, 0.0, size_of(p)]], [[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]],
                  [[0.1, 0.2, 0.3]], [[0.1, 0.2, 0.3]], [[1.0, 2.0, 3.0]], [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize('short_of_it', [1e-2, 1e-5, 1e-8, 1e-10])
def test_they_sum_to_it_next_to_a_singularity(short_of_it: float) -> None:
    p = symmetric_parameters()
    motion = near_a_singularity(np.pi / 2 - short_of_it, p)
    wrench = np.array([[1.0, -2.0, 3.0, -4.0, 5.0, -6.0]])
    forces = split(p, motion, wrench)
    whole = StewartPlatform(p).inverse_dynamics(motion, wrench).forces
    assert np.abs(whole).max() > 10.0 / short_of_it
    assert off(forces.sum(axis=1), whole, forces) < 1e-12


def test_no_force_is_split_where_there_is_none() -> None:
    p = symmetric_parameters()
    rows = np.concatenate([near_a_singularity(0.1, p).rows, near_a_singularity(0.2, p).rows])
    rows[1, 3:12] = QUARTER_TURN.ravel()
    forces = ForceBreakdownRows(p)(rows, np.ones((2, 6)))
    assert np.isfinite(forces[0]).all()
    assert np.isnan(forces[1]).all()


def test_absent_sources_have_no_force() -> None:
    random = rng()
    p = random_parameters(random)
    still = Motion([[0.0, 0.0, size_of(p)]], np.eye(3))
    forces = split(p, still, np.zeros((1, 6)))
    assert np.abs(forces[0, GRAVITY]).min() > 0.0
    assert not forces[0, 1:].any()
    motion = random_motion(p, random, MANY)
    hexapod = p.replaced({'gravity': [0.0, 0.0, 0.0], 'actuator.viscous_friction': 0.0,
                          'actuator.coulomb_friction': 0.0, 'actuator.reflected_mass': 0.0,
                          **{f'legs.{part}.{what}': 0.0 for part in ('cylinder', 'piston')
                             for what in ('mass', 'inertia')}})
    forces = split(hexapod, motion, np.zeros((MANY, 6)))
    assert not forces[:, [GRAVITY, FRICTION, WRENCH]].any()
    assert np.abs(forces[:, LEGS]).max() < 1e-12 * np.abs(forces[:, PLATFORM]).max()


def test_the_motions_are_left_as_they_are() -> None:
    random = rng()
    p = random_parameters(random)
    motions = random_motion(p, random, MANY).rows
    wrenches = random_wrench(p, random, MANY)
    before = motions.copy(), wrenches.copy()
    ForceBreakdownRows(p)(motions, wrenches)
    np.testing.assert_array_equal(motions, before[0])
    np.testing.assert_array_equal(wrenches, before[1])
