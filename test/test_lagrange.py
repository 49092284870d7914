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


"""The Lagrange matrices: the identities that hold for the matrices of any mechanism."""

from __future__ import annotations

import importlib.util
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    derivative, each_relative, energies, friction, moved, random_motion, random_parameters,
    random_wrench, relative, rng, ROOT)

from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.dynamics import lagrange

Array = NDArray[np.float64]

STATES = 10


class Case(NamedTuple):
    """A hexapod and a batch of motions."""

    parameters: Parameters
    platform: StewartPlatform
    motion: Motion
    twist: Array
    mass: Array

    def coriolis(self, christoffel: bool) -> Array:
        """Return C of the batch."""
        return self.platform.coriolis_matrix(self.motion, christoffel)

    def mass_rate(self) -> Array:
        """Return M' along the twists, by differences."""
        def mass_after(time: float) -> Array:
            later = moved(self.motion, time)
            return self.platform.mass_matrix(later)

        return derivative(mass_after, 1e-3)


@pytest.fixture(params=range(6))
def case(request: pytest.FixtureRequest) -> Case:
    """Return a random hexapod and its motions."""
    random = rng(request.param)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion = random_motion(p, random, STATES)
    return Case(p, platform, motion,
                np.concatenate([motion.linear_velocity, motion.angular_velocity], axis=-1),
                platform.mass_matrix(motion))


def times_vector(matrix: Array, vector: Array) -> Array:
    """Return the products of a batch."""
    return np.einsum('nij,nj->ni', matrix, vector)


def test_mass_matrix_is_symmetric_positive_definite(case: Case) -> None:
    assert each_relative(np.swapaxes(case.mass, -1, -2), case.mass) < 1e-14
    assert np.linalg.eigvalsh(case.mass).min() > 0.0


def test_mass_matrix_gives_the_kinetic_energy_of_the_parts(case: Case) -> None:
    kinetic, _ = energies(case.parameters, case.motion)
    by_matrix = 0.5 * np.einsum('ni,nij,nj->n', case.twist, case.mass, case.twist)
    assert np.allclose(by_matrix, kinetic, rtol=1e-13, atol=0.0)


def test_gravity_vector_is_the_gradient_of_the_potential_energy(case: Case) -> None:
    gravity = case.platform.gravity_vector(case.motion)
    for axis in range(6):
        way = np.tile(np.eye(6)[axis], (STATES, 1))
        # moved() needs an axis of rotation; this angle is below rounding
        along = Motion(case.motion.position, case.motion.rotation, way[:, :3],
                       way[:, 3:] + 1e-30)

        def potential(h: float, along: Motion = along) -> Array:
            return energies(case.parameters, moved(along, h))[1]

        slope = derivative(potential, 1e-3)
        assert np.max(np.abs(gravity[:, axis] - slope)) < 1e-8 * np.abs(gravity).max()


def test_passivity_holds_for_both_coriolis_matrices(case: Case) -> None:
    rate = case.mass_rate()
    for christoffel in (False, True):
        product = np.einsum('ni,nij,nj->n', case.twist,
                            rate - 2.0 * case.coriolis(christoffel), case.twist)
        scale = np.einsum('ni,nij,nj->n', np.abs(case.twist), np.abs(rate), np.abs(case.twist))
        assert np.max(np.abs(product) / scale) < 1e-8


def test_mass_rate_less_twice_the_christoffel_coriolis_matrix_is_skew(case: Case) -> None:
    rate = case.mass_rate()
    n = rate - 2.0 * case.coriolis(True)
    assert np.max(np.abs(n + np.swapaxes(n, -1, -2))) < 1e-8 * np.abs(rate).max()


def test_the_papers_coriolis_matrix_is_not_skew_but_gives_the_same_force(case: Case) -> None:
    rate = case.mass_rate()
    n = rate - 2.0 * case.coriolis(False)
    assert np.max(np.abs(n + np.swapaxes(n, -1, -2))) > 1e-4 * np.abs(rate).max()
    force = times_vector(case.coriolis(False), case.twist)
    assert each_relative(times_vector(case.coriolis(True), case.twist), force) < 1e-12


def test_coriolis_force_is_that_of_lagrange_s_equations(case: Case) -> None:
    # With the twist for velocities these are Boltzmann and Hamel's equations, in base axes:
    # C X' = M' X' - dT/dX - [0; w x h], h the angular half of the momentum M X'.
    momentum = times_vector(case.mass, case.twist)
    expected = times_vector(case.mass_rate(), case.twist)
    for axis in range(6):
        way = np.tile(np.eye(6)[axis], (STATES, 1)) + 1e-30

        def kinetic(h: float, way: Array = way) -> Array:
            at = moved(Motion(case.motion.position, case.motion.rotation, way[:, :3],
                              way[:, 3:]), h)
            return energies(case.parameters, Motion(
                at.position, at.rotation, case.motion.linear_velocity,
                case.motion.angular_velocity))[0]

        expected[:, axis] -= derivative(kinetic, 1e-3)
    expected[:, 3:] -= np.cross(case.motion.angular_velocity, momentum[:, 3:])
    for christoffel in (False, True):
        force = times_vector(case.coriolis(christoffel), case.twist)
        assert each_relative(force, expected) < 1e-7


def test_forward_dynamics_of_inverse_dynamics_gives_the_acceleration_back(case: Case) -> None:
    p, motion = case.parameters, case.motion
    wrench = random_wrench(p, rng(), STATES)
    result = case.platform.inverse_dynamics(motion, wrench)
    j_inv = case.platform.inverse_jacobian(motion)
    load = (np.einsum('nji,nj->ni', j_inv, result.forces - friction(p, result.rates)) + wrench
            - times_vector(case.coriolis(False), case.twist)
            - case.platform.gravity_vector(motion))
    acceleration = np.linalg.solve(case.mass, load[..., None])[..., 0]
    given = np.concatenate([motion.linear_acceleration, motion.angular_acceleration], axis=-1)
    assert each_relative(acceleration, given) < 1e-11


def test_jacobian_rate_is_the_derivative_of_j_inv(case: Case) -> None:
    def jacobian_after(time: float) -> Array:
        later = moved(case.motion, time)
        return case.platform.inverse_jacobian(later)

    assert each_relative(case.platform.inverse_jacobian_rate(case.motion),
                         derivative(jacobian_after, 1e-3)) < 1e-9


def test_both_coriolis_matrices_of_a_leg_give_the_same_force(case: Case) -> None:
    at = lagrange.legs(case.parameters, case.motion.position, case.motion.rotation)
    joint_rates = case.motion.linear_velocity[:, None] + np.cross(
        case.motion.angular_velocity[:, None], at.arms)
    papers, christoffel = (np.einsum('nlij,nlj->nli', lagrange.leg_coriolis(
        case.parameters, at, joint_rates, which), joint_rates) for which in (False, True))
    assert each_relative(christoffel, papers) < 1e-12


def test_a_leg_s_mass_is_its_piston_s_along_it_and_its_turning_inertia_across(
        case: Case) -> None:
    p = case.parameters
    at = lagrange.legs(p, case.motion.position, case.motion.rotation)
    mass = lagrange.leg_mass(p, at)
    values = np.linalg.eigvalsh(mass)
    about_base = (p['legs.cylinder.inertia'] + p['legs.piston.inertia']
                  + p['legs.cylinder.mass'] * p['legs.cylinder.center_of_mass'] ** 2
                  + p['legs.piston.mass']
                  * (at.lengths - p['legs.piston.center_of_mass']) ** 2)
    across = about_base / at.lengths ** 2
    along = np.broadcast_to(p['legs.piston.mass'], across.shape)
    assert relative(values, np.sort(np.stack([across, across, along], axis=-1), axis=-1)) < 1e-13


def test_skew_is_the_cross_product() -> None:
    random = rng()
    a, b = random.normal(size=(2, 4, 3))
    assert np.allclose(times_vector(lagrange.skew(a), b), np.cross(a, b), rtol=0, atol=1e-15)


# docs/misprints.md

@pytest.fixture(scope='module')
def misprints() -> Any:
    """Return the script that writes the table."""
    path = ROOT / 'docs' / 'figures' / 'misprints.py'
    spec = importlib.util.spec_from_file_location('misprints', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_paper_with_every_line_corrected_gives_the_forces_of_the_package(
        misprints: Any) -> None:
    p = misprints.hexapod()
    states = misprints.random_states(p)
    package = StewartPlatform(p).inverse_dynamics(Motion.from_euler(*states)).forces
    assert each_relative(misprints.leg_forces(p, states), package) < 1e-12


def test_the_table_of_misprints_is_what_its_script_writes_now(misprints: Any) -> None:
    assert (ROOT / 'docs' / 'misprints.md').read_text(encoding='utf-8') == misprints.table(), (
        'run: python docs/figures/misprints.py')


def test_every_misprint_with_a_reading_of_its_own_changes_the_forces(misprints: Any) -> None:
    p = misprints.hexapod()
    states = misprints.random_states(p)
    assert len(misprints.KEYS) == 6
    for key in misprints.KEYS:
        median, worst = misprints.effect(p, states, {key})
        assert 0.0 < median < worst
