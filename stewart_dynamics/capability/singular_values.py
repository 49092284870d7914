# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Singular values of J_inv while its rows change; compiled."""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, inlined
from stewart_dynamics.mechanics.matrix6 import (
    gram, inverse_and_determinant, laguerre_step, Symmetric, tridiagonal)
from stewart_dynamics.mechanics.vectors import put3, Vector3, Vector6

# Columns of the scratch memory of a leg: its row [s, arm x s] of the scaled J_inv, and a row of
# the inverse.
ROW, INVERSE, COLUMNS = 0, 6, 12
BEND = 1.2  # bound of |s''| / (|l'| / |l|)^2 of the unit vector s of l, l'' = 0: above 2 / sqrt(3)


@inlined
def _read6(array: Array, at: int) -> Vector6:
    return (array[at], array[at + 1], array[at + 2], array[at + 3], array[at + 4], array[at + 5])


@inlined
def put6(array: Array, at: int, a: Vector3, b: Vector3) -> None:
    """Write six numbers."""
    put3(array, at, a)
    put3(array, at + 3, b)


@inlined
def _put_row(array: Array, a: Vector6) -> None:
    put6(array, INVERSE, (a[0], a[1], a[2]), (a[3], a[4], a[5]))


@compiled
def _largest_eigenvalue(g: Symmetric) -> float:
    """Return the largest eigenvalue of a Gram matrix."""
    trace = g[0][0] + g[1][0] + g[2][0] + g[3][0] + g[4][0] + g[5][0]
    k = 1.0 / trace
    t = tridiagonal(g)
    kk = k * k
    scaled = (k * t[0], k * t[1], k * t[2], k * t[3], k * t[4], k * t[5], kk * t[6], kk * t[7],
              kk * t[8], kk * t[9], kk * t[10])
    x = 1.0 + 1e-14
    for _ in range(64):
        nearer = laguerre_step(x, scaled)
        if nearer == x:
            break
        x = nearer
    return x * trace


@compiled
def smallest_and_largest(rows: Array) -> tuple[float, float, float]:
    """
    Return smallest and largest singular value and the determinant; writes the rows of the inverse.

    rows (6, COLUMNS): rows of the scaled J_inv, of about length one; written: those of its
        inverse.
    """
    a, b, c = _read6(rows[0], ROW), _read6(rows[1], ROW), _read6(rows[2], ROW)
    d, e, f = _read6(rows[3], ROW), _read6(rows[4], ROW), _read6(rows[5], ROW)
    inverse, determinant = inverse_and_determinant(a, b, c, d, e, f)
    largest = math.sqrt(_largest_eigenvalue(gram(a, b, c, d, e, f)))
    a, b, c, d, e, f = inverse
    _put_row(rows[0], a)
    _put_row(rows[1], b)
    _put_row(rows[2], c)
    _put_row(rows[3], d)
    _put_row(rows[4], e)
    _put_row(rows[5], f)
    return 1.0 / math.sqrt(_largest_eigenvalue(gram(a, b, c, d, e, f))), largest, determinant
