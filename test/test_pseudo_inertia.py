# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Pseudo-inertia and log-Cholesky parameters: every body is accepted, and only bodies."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import derivative, random_parameters, rng
from snapshot import Snapshot

from stewart_dynamics import ParameterError
from stewart_dynamics.mechanics.dynamics.linear_parameters import linear_parameters, PLATFORM
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import (
    from_log_cholesky, inertial_parameters, is_consistent, log_cholesky, log_cholesky_derivative,
    pseudo_inertia, smallest_eigenvalue, thickened)

Array = NDArray[np.float64]


def body_of_points(seed: int) -> Array:
    """Return the inertial parameters of points of mass: sums over them, no tensor algebra."""
    random = rng(seed)
    ten = np.zeros(10)
    for mass, (x, y, z) in zip(random.uniform(0.1, 5.0, 8), random.normal(size=(8, 3)),
                               strict=True):
        ten += mass * np.array([1.0, x, y, z, y * y + z * z, -x * y, -x * z, x * x + z * z,
                                -y * z, x * x + y * y])
    return ten


@given(st.integers(0, 10 ** 6))
def test_points_of_mass_are_a_body(seed: int) -> None:
    ten = body_of_points(seed)
    assert is_consistent(ten)
    np.testing.assert_allclose(inertial_parameters(pseudo_inertia(ten)), ten, rtol=1e-12)
    eta = log_cholesky(ten)
    np.testing.assert_allclose(np.exp(2.0 * eta[0]), ten[0], rtol=1e-12)
    np.testing.assert_allclose(from_log_cholesky(eta), ten, rtol=1e-9, atol=1e-9)


@given(st.lists(st.floats(-1.5, 1.5), min_size=10, max_size=10))
def test_any_log_cholesky_parameters_are_a_body(eta: list[float]) -> None:
    ten = from_log_cholesky(np.array(eta))
    assert is_consistent(ten)
    np.testing.assert_allclose(log_cholesky(ten), eta, rtol=1e-6, atol=1e-6)


def test_the_derivative_is_that_of_finite_differences() -> None:
    eta = rng(1).uniform(-1.0, 1.0, 10)
    exact = log_cholesky_derivative(eta)
    for n in range(10):
        along = derivative(lambda h, n=n: from_log_cholesky(eta + h * np.eye(10)[n]), 1e-3)
        np.testing.assert_allclose(exact[:, n], along, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize('hexapod', range(5))
def test_platforms_are_bodies(hexapod: int) -> None:
    assert is_consistent(linear_parameters(random_parameters(rng(hexapod)))[PLATFORM])


@pytest.mark.parametrize(('mass', 'inertia'), [
    (-1.0, (1.0, 1.0, 1.0)),
    (0.0, (1.0, 1.0, 1.0)),
    (1.0, (1.0, 1.0, 2.5)),  # positive definite, and yet more than the sum of the others
    (1.0, (-1.0, 1.0, 1.0)),
])
def test_invalid_bodies_are_rejected(
        mass: float, inertia: tuple[float, float, float], snapshot: Snapshot) -> None:
    ten = np.array([mass, 0.0, 0.0, 0.0, inertia[0], 0.0, 0.0, inertia[1], 0.0, inertia[2]])
    assert not is_consistent(ten)
    with snapshot.raises(ParameterError):
        log_cholesky(ten)


@pytest.mark.parametrize('inertia', [(1.0, 1.0, 2.0), (1.0, 1.0, 0.0)], ids=['plate', 'rod'])
def test_a_plate_and_a_rod_become_a_little_thick(inertia: tuple[float, float, float]) -> None:
    ten = np.array([2.0, 0.2, 0.0, 0.1, inertia[0], 0.0, 0.0, inertia[1], 0.0, inertia[2]])
    ten[4:] += 2.0 * np.array([0.05 ** 2, 0.0, -0.1 * 0.05, 0.1 ** 2 + 0.05 ** 2, 0.0, 0.1 ** 2])
    assert abs(smallest_eigenvalue(ten)) < 1e-12
    thick = thickened(ten)
    assert is_consistent(thick)
    np.testing.assert_allclose(from_log_cholesky(log_cholesky(thick)), thick, atol=1e-12)
    np.testing.assert_allclose(thick, ten, atol=3e-3)
