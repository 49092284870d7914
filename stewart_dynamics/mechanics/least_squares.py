# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Weighted linear least squares with the identifiability of the parameters.

The model is f = Y x + noise, f the efforts. ``Information`` holds the sums Y^T W Y and Y^T W f of
the samples, which add over blocks of any length, so that memory does not grow with the data. The
weights are 1 / variance, so the sums are in units of the noise.

Parameters have different units, so identifiability needs a scale for each: the change that would
matter, such as its usual size. With parameters divided by their scales, the singular values of
W^1/2 Y are the ratios of the effect of such a change to the noise, one for each direction, and
their inverses are the standard errors. Directions whose standard error is above a limit are not
identifiable: they keep the start's value. Noise in Y adds information that is not real; where the
information of the noise alone is given, only information well above it counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers

# Standard deviation of a normal distribution, by the median of its deviations' magnitudes.
BY_MEDIAN = 1.482602218505602

# A direction is known if its standard error is at most this, by the parameters' scales.
LARGEST_ERROR = 0.25
# It must also have information that exceeds this many times that of the noise in the regressor.
TIMES_NOISE = 10.0
# Smaller singular values than this, by the largest, are rounding.
ROUNDING = 1e-6
# A parameter is identifiable if unknown directions have at most this share in it.
LARGEST_SHARE = 0.05
# Parameters of which a smaller share is known are not identifiable, not even in a combination.
LEAST_SHARE = 0.1
# A smaller coefficient of a combination, by its largest one and the scales, is left out.
SMALLEST_COEFFICIENT = 0.02
# Rows that are multiplied at once.
_BLOCK = 84


class Information(NamedTuple):
    """
    Normal-equation sums of samples for n parameters.

    matrix (n, n): Y^T W Y.
    vector (n,): Y^T W f.
    squares: f^T W f.
    rows: number of efforts, six for each sample.
    """

    matrix: Array
    vector: Array
    squares: float
    rows: int

    def plus(self, other: Information) -> Information:
        """Return the information of both sets of samples together."""
        return Information(self.matrix + other.matrix, self.vector + other.vector,
                           self.squares + other.squares, self.rows + other.rows)

    def residual_squares(self, x: Array) -> float:
        """Return the weighted sum of squared residuals of parameters (n,)."""
        return max(float(self.squares + x @ (self.matrix @ x) - 2.0 * x @ self.vector), 0.0)


class Identifiability(NamedTuple):
    """
    Identifiability of n parameters from data.

    scales (n,): scales of the parameters, as given.
    singular_values (n,): singular values of the scaled regressor, largest first: 1 / standard
        error of each direction.
    directions (n, n): one direction in each column, by the scales, in the order of the singular
        values.
    rank: number of directions that are known; they come first.
    shares (n,): share of the unknown directions in each parameter, 0 to 1.
    """

    scales: Array
    singular_values: Array
    directions: Array
    rank: int
    shares: Array

    @property
    def identifiable(self) -> Flags:
        """Return which parameters (n,) are identifiable individually, not only in combinations."""
        return self.shares <= LARGEST_SHARE

    @property
    def known_shares(self) -> Array:
        """Return the share (n,) of the known directions in each parameter, 0 to 1."""
        shares: Array = np.sqrt(np.sum(self.directions[:, :self.rank] ** 2, axis=1))
        return shares

    @property
    def known(self) -> Array:
        """Return the known directions (n, rank) in the parameters' units."""
        return self.scales[:, None] * self.directions[:, :self.rank]


class Solution(NamedTuple):
    """
    Parameters that fit the samples, unknown directions left as they were.

    covariance (n, n): for white noise of the weights' variance; of the known directions.
    """

    values: Array
    covariance: Array
    identifiability: Identifiability


class Combination(NamedTuple):
    """
    An identifiable sum of parameters that are not identifiable individually.

    parameters: indices of the parameters.
    coefficients (k,): factors of the parameters, relative to the first, which is 1.
    """

    parameters: tuple[int, ...]
    coefficients: Array


def no_information(n: int) -> Information:
    """Return the information of no samples about some parameters."""
    return Information(np.zeros((n, n)), np.zeros(n), 0.0, 0)


def normal(first: Array, second: Array) -> Array:
    """
    Return A^T B (m, n) of rows (..., m) and (..., n), in blocks.

    BLAS multiplies larger ones in threads, which wait for each other on a busy computer.
    """
    a, b = (each.reshape(math.prod(each.shape[:-1]), each.shape[-1])
            for each in (first, second))
    total = np.zeros((a.shape[1], b.shape[1]))
    for n in range(0, len(a), _BLOCK):
        total += a[n:n + _BLOCK].T @ b[n:n + _BLOCK]
    return total


def information(regressor: Array, efforts: Array, weights: Array) -> Information:
    """
    Return the information of samples.

    regressor (N, 6, n): Y of each sample.
    efforts (N, 6): efforts less the efforts of parameters that are not to be identified [N].
    weights (6,) or (N, 6): 1 / variance of each effort [1/N^2]; 0 leaves it out.
    """
    weights = np.broadcast_to(weights, efforts.shape)
    rows = regressor.reshape(-1, regressor.shape[-1])
    weighted = rows * weights.reshape(-1, 1)
    flat = efforts.reshape(-1)
    return Information(weighted.T @ rows, weighted.T @ flat,
                       float(weights.reshape(-1) @ flat ** 2), int(np.count_nonzero(weights)))


def identifiability(matrix: Array, scales: Array, noise: Array | None = None,
                    largest_error: float = LARGEST_ERROR) -> Identifiability:
    """
    Return the identifiability of parameters from an information matrix.

    matrix (n, n): Y^T W Y.
    scales (n,): change of each parameter that would matter.
    noise (n, n): the same sum for the noise in Y alone.
    largest_error: largest standard error of a known direction, by the scales.
    """
    signal = matrix if noise is None else matrix - TIMES_NOISE * noise
    values, directions = np.linalg.eigh(scales[:, None] * signal * scales)
    values, directions = values[::-1], directions[:, ::-1]
    singular = np.sqrt(np.maximum(values, 0.0))
    known = singular > max(1.0 / largest_error, ROUNDING * float(singular[0]))
    rank = int(np.count_nonzero(known))
    shares = np.sqrt(np.minimum(np.sum(directions[:, rank:] ** 2, axis=1), 1.0))
    return Identifiability(scales, singular, directions, rank, shares)


def solve(samples: Information, start: Array, scales: Array, noise: Array | None = None,
          largest_error: float = LARGEST_ERROR) -> Solution:
    """
    Return the parameters that fit the samples best.

    start (n,): unknown directions keep these values.
    scales, noise, largest_error: as ``identifiability`` takes them.
    """
    what = identifiability(samples.matrix, scales, noise, largest_error)
    known = what.known
    # scaled by the diagonal, so that small entries keep as many digits as large ones
    inner = known.T @ samples.matrix @ known
    sizes = 1.0 / np.sqrt(np.diag(inner))
    inverse = sizes[:, None] * np.linalg.inv(sizes[:, None] * inner * sizes) * sizes
    step = inverse @ (known.T @ (samples.vector - samples.matrix @ start))
    return Solution(start + known @ step, known @ inverse @ known.T, what)


def combinations(what: Identifiability, unclear: Integers | None = None,
                 ) -> tuple[Combination, ...]:
    """
    Return the identifiable combinations of parameters that are not identifiable individually.

    unclear: indices of these parameters, as far as they are not ``what.identifiable``.

    They are the rows of the known subspace, reduced: each begins with a parameter that is in no
    other combination (base parameters: Gautier, Khalil, "Direct calculation of minimum set of
    inertial parameters of serial robots", IEEE T-RA 6(3), 1990, doi:10.1109/70.56655).
    """
    unclear = np.flatnonzero(~what.identifiable) if unclear is None else unclear
    if not len(unclear) or not what.rank:
        return ()
    # Known directions that lie within these parameters have a singular value of 1, others 0.
    rows = what.directions[unclear, :what.rank]
    left, sizes, _ = np.linalg.svd(rows, full_matrices=False)
    reduced, pivots = _reduced(left[:, sizes > 0.5].T)
    found = []
    for row, pivot in zip(reduced, pivots, strict=True):
        kept = np.flatnonzero(np.abs(row) > SMALLEST_COEFFICIENT * np.abs(row).max())
        order = [pivot, *(int(n) for n in kept if n != pivot)]
        physical = row[order] / what.scales[unclear[order]]
        found.append(Combination(tuple(int(unclear[n]) for n in order), physical / physical[0]))
    return tuple(found)


def _reduced(rows: Array) -> tuple[Array, list[int]]:
    """Return independent rows in reduced form, by Gauss-Jordan with full pivoting, and pivots."""
    rows = rows.copy()
    pivots = np.full(len(rows), -1)
    for _ in rows:
        sizes = np.abs(rows) * (pivots < 0)[:, None]
        row, column = np.unravel_index(int(np.argmax(sizes)), sizes.shape)
        pivots[row] = column
        rows[row] /= rows[row, column]
        others = np.arange(len(rows)) != row
        rows[others] -= rows[others, column, None] * rows[row]
    order = np.argsort(pivots)
    return rows[order], pivots[order].tolist()
