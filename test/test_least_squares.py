# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Least squares: unidentifiable parameters are named, and keep their values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng

from stewart_dynamics.mechanics.least_squares import (
    combinations, identifiability, Information, information, no_information, normal, solve)

Array = NDArray[np.float64]

TRUTH = np.array([3.0, -2.0, 50.0, 1e-3])
SCALES = np.array([1.0, 1.0, 100.0, 1e-3])
SIGMAS = np.array([0.1, 0.1, 0.2, 0.2, 0.5, 0.5])


def samples(seed: int, many: int = 400, mixing: Array | None = None, noise: float = 1.0,
            ) -> tuple[Array, Array]:
    """Return a regressor (many, 6, 4) whose columns a matrix mixes, and its efforts."""
    random = rng(seed)
    regressor = random.normal(size=(many, 6, 4)) / SCALES
    regressor = regressor if mixing is None else regressor @ mixing
    return regressor, regressor @ TRUTH + noise * SIGMAS * random.normal(size=(many, 6))


def told(regressor: Array, efforts: Array) -> Information:
    """Return the information of samples with their own weights."""
    return information(regressor, efforts, 1.0 / SIGMAS ** 2)


def test_all_parameters_are_identified_with_the_reported_errors() -> None:
    errors = []
    for seed in range(300):
        solution = solve(told(*samples(seed)), np.zeros(4), SCALES)
        assert solution.identifiability.rank == 4
        assert solution.identifiability.identifiable.all()
        errors.append((solution.values - TRUTH) / np.sqrt(np.diag(solution.covariance)))
    spread = np.array(errors)
    np.testing.assert_allclose(spread.std(axis=0), 1.0, atol=0.15)
    np.testing.assert_allclose(spread.mean(axis=0), 0.0, atol=0.2)


def test_blocks_sum_to_the_whole() -> None:
    regressor, efforts = samples(1)
    whole = told(regressor, efforts)
    parts = no_information(4)
    for first in range(0, 400, 7):
        parts = parts.plus(told(regressor[first:first + 7], efforts[first:first + 7]))
    assert parts.rows == whole.rows == 2400
    np.testing.assert_allclose(parts.matrix, whole.matrix, rtol=1e-12)
    x = solve(whole, np.zeros(4), SCALES).values
    residuals = (efforts - regressor @ x) / SIGMAS
    for each in (whole, parts):
        assert each.residual_squares(x) == pytest.approx(float(np.sum(residuals ** 2)), rel=1e-9)


def test_weight_zero_leaves_out() -> None:
    regressor, efforts = samples(2)
    weights = np.tile(1.0 / SIGMAS ** 2, (400, 1))
    weights[100:200, 3] = 0.0
    spoiled = efforts.copy()
    spoiled[100:200, 3] = 1e9
    without, with_outliers = (
        information(regressor, each, weights) for each in (efforts, spoiled))
    assert without.rows == 2300
    np.testing.assert_array_equal(without.vector, with_outliers.vector)


def test_unidentifiable_parameters_keep_their_values_and_the_sum_is_named() -> None:
    # 2 x_0 + x_1 alone, in units of the scales; x_3 not at all.
    mixing = np.array([[2.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0],
                       [0.0, 0.0, 0.0, 0.0]])
    regressor, efforts = samples(3, mixing=mixing, noise=0.1)
    start = np.array([1.0, 1.0, 1.0, 7.0])
    solution = solve(told(regressor, efforts), start, SCALES)
    what = solution.identifiability
    assert what.rank == 2
    np.testing.assert_array_equal(what.identifiable, [False, False, True, False])
    assert solution.values[3] == 7.0
    assert solution.values[2] == pytest.approx(TRUTH[2], rel=0.01)
    # the sum is right, and the difference across it is the start's
    x, y = solution.values[:2]
    assert 2.0 * x + y == pytest.approx(2.0 * TRUTH[0] + TRUTH[1], abs=0.05)
    assert x - 2.0 * y == pytest.approx(1.0 - 2.0, abs=1e-9)
    (one,) = combinations(what)
    assert one.parameters == (0, 1)
    np.testing.assert_allclose(one.coefficients, [1.0, 0.5], rtol=1e-6)


def test_coefficients_of_a_sum_are_in_the_parameters_units() -> None:
    mixing = np.zeros((4, 4))
    mixing[0, 0], mixing[0, 2] = 1.0, 0.03  # one of x_0 as 0.03 of x_2, whose scale is 100
    regressor, efforts = samples(4, mixing=mixing)
    (one,) = combinations(solve(told(regressor, efforts), np.zeros(4), SCALES).identifiability)
    assert one.parameters == (2, 0)
    np.testing.assert_allclose(one.coefficients, [1.0, 1.0 / 0.03], rtol=1e-6)


def test_noise_in_the_regressor_identifies_nothing() -> None:
    # The last column is noise: by itself it seems to be excited.
    regressor, efforts = samples(5)
    regressor[..., 3] = 100.0 * rng(6).normal(size=(400, 6))
    matrix = told(regressor, efforts).matrix
    assert identifiability(matrix, SCALES).rank == 4
    noise = np.zeros((4, 4))
    noise[3, 3] = matrix[3, 3]
    what = identifiability(matrix, SCALES, noise)
    assert what.rank == 3
    np.testing.assert_array_equal(what.identifiable, [True, True, True, False])


def test_a_weak_direction_is_not_known() -> None:
    regressor, efforts = samples(7)
    regressor[..., 1] *= 1e-4  # one unit of x_1 is far below the noise
    what = solve(told(regressor, efforts), np.zeros(4), SCALES).identifiability
    assert what.rank == 3
    assert what.singular_values[3] < 0.1 < what.singular_values[2]


def test_without_samples_nothing_is_identifiable() -> None:
    start = np.array([1.0, 2.0, 3.0, 4.0])
    solution = solve(no_information(4), start, SCALES)
    assert solution.identifiability.rank == 0
    np.testing.assert_array_equal(solution.values, start)
    assert combinations(solution.identifiability) == ()


@pytest.mark.parametrize('shape', [(1,), (83, 6), (84,), (200, 6), (0,)])
def test_products_in_blocks_are_those_at_once(shape: tuple[int, ...]) -> None:
    random = rng(7)
    a, b = random.normal(size=(*shape, 5)), random.normal(size=(*shape, 3))
    np.testing.assert_allclose(normal(a, b), a.reshape(-1, 5).T @ b.reshape(-1, 3), atol=1e-12)
    assert normal(a[..., :0], b).shape == (0, 3)
