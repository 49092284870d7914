# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The 6x6 linear algebra against numpy's, uncompiled: the same code, bit for bit."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import rng

from stewart_dynamics.mechanics import matrix6
from stewart_dynamics.mechanics.matrix6 import SMALLEST_PIVOT

Array = NDArray[np.float64]

MOST_STEPS = 64  # as the inverse dynamics have it


def rows(matrix: Any) -> list[tuple[float, ...]]:
    """Return a matrix's rows as tuples of plain numbers."""
    return [tuple(map(float, row)) for row in matrix]


def inverse(matrix: Array) -> tuple[Array, float]:
    """Return the inverse and the determinant."""
    found, det = matrix6.inverse_and_determinant(*rows(matrix))
    return np.array(found), det


def lower(matrix: Array) -> tuple[tuple[float, ...], ...]:
    """Return the columns of a symmetric matrix from the diagonal down."""
    return tuple(tuple(map(float, matrix[n:, n])) for n in range(6))


def whole(t: tuple[float, ...]) -> Array:
    """Return the tridiagonal matrix of six diagonal entries and five squares beside them."""
    beside = np.sqrt(t[6:])
    full: Array = np.diag(t[:6]) + np.diag(beside, 1) + np.diag(beside, -1)
    return full


def largest(t: tuple[float, ...]) -> float:
    """Return the eigenvalue to which Laguerre's iteration converges from 1."""
    x, steps = 1.0 + 1e-14, 0
    while (nearer := matrix6.laguerre_step(x, t)) != x:
        assert nearer < x
        x, steps = nearer, steps + 1
        assert steps < MOST_STEPS
    return x


def symmetric(values: Any, random: np.random.Generator) -> Array:
    """Return a symmetric matrix with these eigenvalues in random directions."""
    q, _ = np.linalg.qr(random.normal(size=(6, 6)))
    return (q * np.asarray(values)) @ q.T


def test_inverse_and_determinant_are_those_of_numpy() -> None:
    random = rng()
    for _ in range(300):
        a = random.normal(size=(6, 6))
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        found, det = inverse(a)
        allowed = 1e-14 * np.linalg.cond(a)
        assert np.max(np.abs(found @ a - np.eye(6))) < allowed
        assert np.allclose(found, np.linalg.inv(a), rtol=0.0, atol=allowed * np.abs(found).max())
        assert det == pytest.approx(np.linalg.det(a), rel=allowed)


def test_every_permutation_is_inverted_exactly_with_its_sign() -> None:
    for order in itertools.permutations(range(6)):
        p = np.eye(6)[list(order)]
        found, det = inverse(p)
        assert np.array_equal(found, p.T)
        assert det == round(np.linalg.det(p))


def test_a_matrix_with_zeros_on_the_diagonal_is_inverted() -> None:
    random = rng()
    for _ in range(100):
        a = random.normal(size=(6, 6))
        a[np.arange(6), np.arange(6)] = 0.0
        found, det = inverse(a)
        assert np.max(np.abs(found @ a - np.eye(6))) < 1e-13 * np.linalg.cond(a)
        assert det == pytest.approx(np.linalg.det(a), rel=1e-13 * np.linalg.cond(a))


def test_a_tiny_first_pivot_loses_no_digits() -> None:
    a = np.eye(6)[::-1] + 1e-20 * np.eye(6)
    found, det = inverse(a)
    assert np.allclose(found, np.eye(6)[::-1], rtol=0.0, atol=1e-15)
    assert det == pytest.approx(-1.0, rel=1e-15)


@pytest.mark.parametrize('rank', [5, 4, 3])
def test_inverse_of_a_singular_matrix_is_finite_and_large(rank: int) -> None:
    random = rng()
    exact = np.diag([1.0] * rank + [0.0] * (6 - rank))
    found, det = inverse(exact)
    assert np.all(np.isfinite(found))
    assert abs(det) == pytest.approx(SMALLEST_PIVOT ** (6 - rank), rel=1e-12)
    assert np.abs(found).max() > 1e15
    for _ in range(20):
        a = random.normal(size=(6, rank)) @ random.normal(size=(rank, 6))
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        found, det = inverse(a)
        assert np.all(np.isfinite(found))
        assert abs(det) < 1e-14
        assert np.abs(found).max() > 1e12


def test_gram_holds_the_products_of_the_rows() -> None:
    a = rng().normal(size=(6, 6))
    for n, column in enumerate(matrix6.gram(*rows(a))):
        assert np.allclose(column, (a @ a.T)[n:, n], rtol=1e-14, atol=1e-14)


def test_tridiagonal_keeps_the_eigenvalues() -> None:
    random = rng()
    samples = [symmetric(random.uniform(0.0, 1.0, 6), random) for _ in range(100)]
    samples += [np.eye(6), np.zeros((6, 6)), np.diag([3.0, 1.0, 2.0, 0.0, 5.0, 4.0]),
                np.ones((6, 6)), symmetric([1, 1, 1, 0.5, 0.5, 0], random),
                symmetric(10.0 ** -np.arange(6.0), random)]
    block = np.eye(6)
    block[2, 4] = block[4, 2] = 0.5  # columns with nothing left to mirror, then with
    samples.append(block)
    for g in samples:
        t = matrix6.tridiagonal(lower(g))
        assert np.all(np.isfinite(t))
        assert min(t[6:]) >= 0.0
        assert np.allclose(np.linalg.eigvalsh(whole(t)), np.linalg.eigvalsh(g), rtol=0.0,
                           atol=4e-15 * max(np.abs(g).max(), 1.0))


@pytest.mark.parametrize('kind', [
    'any', 'double', 'triple', 'fourfold', 'fivefold', 'near double', 'one alone'])
def test_laguerre_converges_to_the_largest_eigenvalue(kind: str) -> None:
    random = rng()
    for _ in range(60):
        values = np.sort(random.uniform(0.0, 1.0, 6))[::-1]
        equal = {'double': 2, 'triple': 3, 'fourfold': 4, 'fivefold': 5}.get(kind, 1)
        values[:equal] = values[0]
        if kind == 'near double':
            values[1] = values[0] * (1.0 - 10.0 ** random.uniform(-15, -3))
        if kind == 'one alone':
            values[1:] *= 1e-12
        g = symmetric(values / values.sum(), random)
        t = matrix6.tridiagonal(lower(g))
        found = largest(t)
        assert found == pytest.approx(np.linalg.eigvalsh(g)[-1], rel=1e-13)


def test_laguerre_stays_finite_on_matrices_without_directions() -> None:
    found = largest(matrix6.tridiagonal(lower(np.eye(6) / 6)))
    assert found == pytest.approx(1.0 / 6.0, rel=1e-14)
    found = largest(matrix6.tridiagonal(lower(np.zeros((6, 6)))))
    assert 0.0 < found <= 1.0 + 1e-14


def test_a_converged_laguerre_iteration_is_not_changed_by_a_further_step() -> None:
    random = rng()
    for _ in range(50):
        values = random.uniform(0.0, 1.0, 6)
        t = matrix6.tridiagonal(lower(symmetric(values / values.sum(), random)))
        rest = largest(t)
        assert all(matrix6.laguerre_step(rest, t) == rest for _ in range(5))
