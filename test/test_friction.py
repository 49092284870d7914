# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The friction of the actuators, what follows from its law, and the losses of the screws."""

from __future__ import annotations

import numpy as np
import pytest
from referees import friction, random_motion, random_parameters, rng
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.drives.measured_efforts import without_losses
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.dynamics.friction import Friction, slip_in_noise
from stewart_dynamics.mechanics.dynamics.linear_parameters import Places


def with_friction(seed: int) -> tuple[Parameters, Friction, Array]:
    """Return a random hexapod, its friction, and rates within the linear band and beyond."""
    p = random_parameters(rng(seed))
    found = Friction.of(p)
    return p, found, found.coulomb_velocity * rng(seed).uniform(-3.0, 3.0, (500, 6))


@pytest.mark.parametrize('seed', range(3))
def test_the_law_is_that_of_the_formula(seed: int) -> None:
    p, found, rates = with_friction(seed)
    np.testing.assert_allclose(found.forces(rates), friction(p, rates), rtol=1e-13)
    alone = friction(p.replaced({'actuator.viscous_friction': 0.0}), rates)
    np.testing.assert_allclose(found.without_viscous.forces(rates), alone, rtol=1e-13)
    assert np.abs(alone).max() <= found.coulomb.max()
    assert np.array_equal(found.is_linear(rates), np.abs(alone) < found.coulomb)
    # the slope near standstill, and the change at a reversal
    slow = np.where(found.is_linear(rates), rates, 0.0)
    np.testing.assert_allclose(found.without_viscous.forces(slow),
                               found.slope(found.coulomb) * slow, rtol=1e-13)
    fast = 2.0 * found.coulomb_velocity * np.array([[1.0], [-1.0]])
    np.testing.assert_allclose(
        -np.diff(found.without_viscous.forces(fast), axis=0)[0], found.largest_change)


@pytest.mark.parametrize('seed', range(3))
def test_dynamics_and_regressor_have_the_same_law(seed: int) -> None:
    p, found, _ = with_friction(seed)
    platform, motion = StewartPlatform(p), random_motion(p, rng(seed), 50)
    slow = motion.rows.copy()
    slow[:, 12:18] *= 1e-3  # within the linear band
    for rows in (motion.rows, slow):
        same = type(motion).of_rows(rows)
        rates = platform.drive_rates(rows, platform.inverse_dynamics(same).rates)
        free = StewartPlatform(p.replaced({
            'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}))
        forces = platform.inverse_dynamics(same).forces - free.inverse_dynamics(same).forces
        np.testing.assert_allclose(
            forces, found.forces(rates), atol=1e-9 * np.abs(forces).max() + 1e-9)
        columns = platform.regressors(rows)[..., Places.of(p.leg_kind).coulomb_friction]
        np.testing.assert_array_equal(
            np.diagonal(columns, axis1=1, axis2=2) * found.coulomb + 0.0,
            found.without_viscous.forces(rates))


@pytest.mark.parametrize('seed', range(3))
def test_pieces_of_a_faster_motion_are_its_friction(seed: int) -> None:
    _, found, rates = with_friction(seed)
    for k in (0.0, 0.2, 0.9, 1.0, 3.0, 100.0):
        of_pieces = np.full(rates.shape, np.nan)
        for piece in found.coulomb_by_speed(rates):
            here = (piece.begin <= k) & (k <= piece.end)
            forces = piece.constant + k * piece.linear
            of_pieces = np.where(here, forces, of_pieces)
        np.testing.assert_allclose(
            of_pieces, found.without_viscous.forces(k * rates), rtol=1e-12, atol=1e-12)


def test_slip_in_noise_is_the_mean_of_the_law() -> None:
    _, found, rates = with_friction(4)
    one = found._replace(viscous=np.zeros(6), coulomb=np.ones(6))
    np.testing.assert_allclose(slip_in_noise(rates, found.coulomb_velocity, 0.0),
                               one.forces(rates), atol=1e-8)
    # Gauss-Hermite would see the kinks: a fine sum does not
    at = np.linspace(-8.0, 8.0, 20001)
    weights = np.exp(-0.5 * at ** 2) / np.sqrt(2.0 * np.pi) * (at[1] - at[0])
    deviation = 0.7 * float(found.coulomb_velocity[0])
    noisy = np.tile(rates[3, :1] + deviation * at[:, None], 6)
    mean = weights @ one.forces(noisy)[:, 0]
    assert slip_in_noise(rates[3], found.coulomb_velocity, deviation)[0] == pytest.approx(
        mean, abs=1e-5)


@pytest.mark.parametrize('seed', range(5))
def test_forces_without_losses_are_those_of_the_motors_torques(seed: int) -> None:
    random = rng(seed)
    p = random_parameters(random).replaced({
        'actuator.reflected_mass': None, 'actuator.coulomb_velocity': 0.02,
        'actuator.screw_lead': random.uniform(0.005, 0.02, 6),
        'drive.motor_inertia': random.uniform(1e-5, 1e-4, 6),
        'drive.efficiency': random.uniform(0.7, 0.95, 6)})
    platform, motion = StewartPlatform(p), random_motion(p, random, 40)
    motors, k = platform.motors(motion), motor_ratio(p)
    found = without_losses(k * motors.torques, motors.speeds / k, motors.accelerations / k, p)
    forces = platform.inverse_dynamics(motion).forces
    np.testing.assert_allclose(found, forces, atol=1e-10 * np.abs(forces).max())
