# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The Lagrange matrices: the identities that hold for the matrices of any mechanism."""

from __future__ import annotations

import importlib.util
from typing import Any, NamedTuple

from hypothesis import given, strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    derivative, each_relative, energies, friction, moved,
    PinocchioReferee, random_motion, random_parameters, random_wrench,
    relative, rng, ROOT, size_of)
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.dynamics.force_breakdown import ForceBreakdownRows, SOURCES
from stewart_dynamics.mechanics.rows import ACCELERATION, NO_BASE, TWIST
from stewart_dynamics.parameters.table import inertia_matrix

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
            return self.platform.mass_matrix(moved(self.motion, time))

        return derivative(mass_after, 1e-3)


@pytest.fixture(params=range(6))
def case(request: pytest.FixtureRequest) -> Case:
    """Return a random hexapod and its motions."""
    random = rng(request.param)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion = random_motion(p, random, STATES)
    return Case(p, platform, motion, motion.rows[:, TWIST], platform.mass_matrix(motion))


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


def test_jacobian_rate_is_the_derivative_of_j_inv(case: Case) -> None:
    def jacobian_after(time: float) -> Array:
        return case.platform.inverse_jacobian(moved(case.motion, time))

    assert each_relative(case.platform.inverse_jacobian_rate(case.motion),
                         derivative(jacobian_after, 1e-3)) < 1e-9


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


# docs/errata.md

@pytest.fixture(scope='module')
def errata() -> Any:
    """Return the script that writes the table."""
    path = ROOT / 'docs' / 'figures' / 'errata.py'
    spec = importlib.util.spec_from_file_location('errata', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_paper_with_every_line_corrected_gives_the_forces_of_the_package(
        errata: Any) -> None:
    p = errata.hexapod()
    states = errata.random_states(p)
    package = StewartPlatform(p).inverse_dynamics(Motion.from_euler(*states)).forces
    assert each_relative(errata.leg_forces(p, states), package) < 1e-12


def test_the_table_of_errata_is_what_its_script_writes_now(errata: Any) -> None:
    assert (ROOT / 'docs' / 'errata.md').read_text(encoding='utf-8') == errata.table(), (
        'run: python docs/figures/errata.py')


def test_every_erratum_with_a_reading_of_its_own_changes_the_forces(errata: Any) -> None:
    p = errata.hexapod()
    states = errata.random_states(p)
    assert len(errata.KEYS) == 6
    for key in errata.KEYS:
        median, worst = errata.effect(p, states, {key})
        assert 0.0 < median < worst


# Force breakdown by source: the parts sum to the forces, and each equals its own formula

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


@pytest.mark.parametrize('hexapod', range(10))
def test_each_source_equals_that_of_the_reference_matrices(hexapod: int) -> None:
    random = rng(hexapod)
    p = random_parameters(random)
    motion = random_motion(p, random, MANY)
    wrench = random_wrench(p, random, MANY)
    forces = split(p, motion, wrench)
    x, r, v, w = (motion.position, motion.rotation, motion.linear_velocity,
                  motion.angular_velocity)
    twist, acceleration = motion.rows[:, TWIST], motion.rows[:, ACCELERATION]
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


# Forward dynamics: identities with the inverse dynamics, and independent physics

SAMPLES = 20
STILL = np.array([NO_BASE])


def accelerations(motion: Motion) -> Any:
    """Return linear and angular accelerations, six numbers a sample."""
    return motion.rows[..., ACCELERATION]


@pytest.mark.parametrize('seed', range(20))
def test_the_forces_of_a_motion_give_its_accelerations_back(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion, wrench = random_motion(p, random, SAMPLES), random_wrench(p, random, SAMPLES)
    forces = platform.inverse_dynamics(motion, wrench).forces
    back = platform.forward_dynamics(motion, forces, wrench)
    assert each_relative(accelerations(back), accelerations(motion)) < 1e-12
    assert np.array_equal(back.rows[:, :18], motion.rows[:, :18])


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


def test_a_singular_pose_has_accelerations() -> None:
    p = random_parameters(rng())
    platform = StewartPlatform(p.replaced({'geometry.platform_joints': (
        0.5 * p['geometry.base_joints']).ravel()}))  # parallel legs: no forces hold a turn
    motion = Motion([0.0, 0.0, 1.0], np.eye(3), [0.1, 0.2, 0.3], [0.1, 0.2, 0.3])
    assert np.all(np.isfinite(accelerations(platform.forward_dynamics(motion, np.ones(6)))))
