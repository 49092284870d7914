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

"""
Mass, center of mass and inertia of the platform from efforts, where friction is uncertain.

The efforts differ from those of the model by ``y = P x + Z e + noise``: P are the ten columns of
the regressor for a change x of mass, first moment and inertia, all about the given center of
mass, so that parameters that are not identifiable keep the given values. Z are for each leg
Coulomb friction, viscous friction and the limit of static friction, each for one standard
deviation: the given friction is uncertain by its own size. e has unit variance and is eliminated
leg by leg (a ridge regression, Hoerl, Kennard, "Ridge regression: biased estimation for
nonorthogonal problems", Technometrics 12(1), 1970, doi:10.1080/00401706.1970.10488634).

Accelerations from measured rates have noise, and with it the regressor: P^T W P is too large by
``noise`` and the estimate too small. Both sums are corrected by their known expectation
(W. A. Fuller, "Measurement Error Models", 1987, doi:10.1002/9780470316665, section 3.1).

All legs weigh alike: an external load would make the weight of some legs smaller, and with it
shift the estimate. The intervals hold for residuals that are correlated in time and between the
legs: with their correlations over LAGS samples, weighted by Bartlett's window so that the
covariance is positive semidefinite (Newey, West, "A simple, positive semi-definite,
heteroskedasticity and autocorrelation consistent covariance matrix", Econometrica 55(3), 1987,
doi:10.2307/1913610).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.mechanics.dynamics.linear_parameters import FIRST_MOMENT, INERTIA, MASS
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import is_consistent
from stewart_dynamics.mechanics.least_squares import Information, Solution, solve, TWO_SIDED

TEN = 10
FRICTION = 3  # columns of each leg: Coulomb, viscous, static

# A change that matters, of the mass, of the center by the size of the platform, of the inertia by
# the mean of the given one. A direction is known if its standard error is at most a quarter of it.
_MASS, _CENTER, _INERTIA = 0.2, 0.1, 0.4

# ``solve`` rejects directions below TIMES_NOISE times the noise. Here the noise is
# subtracted: a fifth of that is enough.
_NOISE = 0.2

# Iterations of the noise.
ROUNDS = 4
LAGS = 8
# Student's t of n degrees of freedom, by n, above the normal distribution's: the first term.
_STUDENT_95 = 2.372
# The noise is at least this part of the largest effort: no sensor is better.
_LEAST_NOISE = 1e-5


class Body(NamedTuple):
    """Mass, center of mass and inertia, as a parameter file has them."""

    mass: float  # [kg]
    center: Array  # platform axes (3,) [m]
    inertia: Array  # ixx ixy ixz iyy iyz izz about the center of mass, platform axes (6,) [kg m^2]


class FittedBody(NamedTuple):
    """The body that fits best."""

    body: Body  # numbers that are not known have the given values
    half_widths: Array  # (10,) halves of the 95 % intervals of mass, center and inertia
    known: Flags  # (10,) whether each of them is identifiable
    consistent: bool  # false: no real body has the inertia that fits best; it has the given one
    residual: float  # RMS of the efforts that remain [N]


class LegSamples(NamedTuple):
    """N consecutive measurements, and how a wrong acceleration changes them."""

    columns: Array  # (N, 6, 10) of the regressor, of ``about(center)``
    friction: Array
    """(N, 6, FRICTION) effort for one standard deviation of each kind of friction [N]"""
    differences: Array  # (N, 6) efforts less those of the model [N]
    acceleration_noise: Array  # (6, 6) covariance of the noise in the accelerations of one sample
    columns_by_acceleration: Array
    """(6, 6, 10) derivative of the columns by each of the six accelerations"""
    model_by_acceleration: Array  # (6, 6) derivative of the model's efforts, likewise


def about(center: Array) -> Array:
    """Return the matrix (10, 10) from ten parameters about a point to those about the origin."""
    matrix = np.eye(TEN)
    coupling = _coupling(center)
    matrix[FIRST_MOMENT, MASS], matrix[INERTIA, MASS] = center, 0.5 * coupling @ center
    matrix[INERTIA, FIRST_MOMENT] = coupling
    return matrix


def _coupling(a: Array) -> Array:
    """Return the derivative (6, 3) of the inertia of a mass of 1 at a point, by the point."""
    x, y, z = a
    return np.array([[0.0, 2.0 * y, 2.0 * z], [-y, -x, 0.0], [-z, 0.0, -x],
                     [2.0 * x, 0.0, 2.0 * z], [0.0, -z, -y], [2.0 * x, 2.0 * y, 0.0]])


class BodyFit:
    """
    The fit, step by step: ``improve`` ROUNDS times, ``correlate`` all lags, then ``result``.

    ``samples`` are at least as many as LAGS; ``given`` is the body of the model, ``size`` the
    distance of the platform joints from their center [m].
    """

    def __init__(self, samples: LegSamples, given: Body, size: float) -> None:
        self._given = given
        moment = float(given.inertia[[0, 3, 5]].mean())
        self._scales = np.array([_MASS * given.mass, *3 * [_CENTER * size * given.mass],
                                 *6 * [_INERTIA * moment]])
        # leg by leg: (6, N, ...)
        self._p, self._z = samples.columns.swapaxes(0, 1), samples.friction.swapaxes(0, 1)
        self._y = samples.differences.T[..., None]
        self._samples = samples
        strongest = np.abs(self._y).max() + np.abs(self._p[..., 0]).max() * given.mass
        self._least = (_LEAST_NOISE * strongest) ** 2
        self._variance = max(float(np.mean(self._y ** 2)), self._least)
        # Share of the degrees of freedom of the correlations that Bartlett's window leaves.
        self._freedom = 1.5 * len(samples.differences) / LAGS
        self._solution: Solution | None = None

    def improve(self) -> None:
        """Fit with the present noise, and estimate the noise anew."""
        p, z, y, variance = self._p, self._z, self._y, self._variance
        z_back = z.swapaxes(1, 2)
        self._eliminate = np.linalg.solve(z_back @ z + variance * np.eye(FRICTION), z_back)
        self._left = (p - z @ (self._eliminate @ p)) / variance
        weighted = self._left.swapaxes(1, 2)
        noise, shift = self._noise()
        matrix = np.sum(weighted @ p, axis=0) - noise
        vector = np.sum(weighted @ y, axis=0)[:, 0] + shift
        self._solution = solve(Information(matrix, vector, 0.0, y.size), np.zeros(TEN),
                               self._scales, _NOISE * noise)
        rest = y - p @ self._solution.values[:, None]
        self._residuals = rest - z @ (self._eliminate @ rest)
        self._variance = max(float(np.mean(self._residuals ** 2)), self._least)

    def _noise(self) -> tuple[Array, Array]:
        """Return what noise in the accelerations adds to P^T W P, and takes from P^T W y."""
        of = self._samples
        weight = len(of.differences) / self._variance
        columns = weight * np.einsum(
            'kl,lip->kip', of.acceleration_noise, of.columns_by_acceleration)
        return (np.einsum('kip,kiq->pq', columns, of.columns_by_acceleration),
                np.einsum('kip,ki->p', columns, of.model_by_acceleration))

    def correlate(self, lag: int) -> None:
        """Take the correlation of the residuals over a lag, 0 to LAGS, into account."""
        many = len(self._samples.differences)
        if lag == 0:
            self._columns = np.ascontiguousarray(self._left.swapaxes(0, 1)).reshape(many, -1)
            self._meat = np.zeros((TEN, TEN))
        residuals = self._residuals[..., 0].T
        later, earlier = slice(lag, None), slice(None, many - lag)
        correlation = residuals[later].T @ residuals[earlier] / many
        products = (self._columns[later].T @ self._columns[earlier]).reshape(6, TEN, 6, TEN)
        product = np.einsum('ipjq,ij->pq', products, correlation)
        weight = 1.0 - lag / (LAGS + 1)
        self._meat += weight * (product + product.T) if lag else product

    def result(self) -> FittedBody:
        """Return the body."""
        solution = self._solution
        assert solution is not None
        change = solution.values
        known = solution.identifiability.identifiable.copy()
        body = self._body(change)
        keep = ~known[INERTIA]
        inertia = np.where(keep, self._given.inertia, body.inertia)
        consistent = body.mass > 0.0 and is_consistent(
            np.array([body.mass, 0.0, 0.0, 0.0, *inertia]))
        if not consistent:
            known[INERTIA] = False
            inertia = self._given.inertia
        center = np.where(known[FIRST_MOMENT], body.center, self._given.center)
        derivative = self._derivative(change)
        covariance = derivative @ self._covariance(solution) @ derivative.T
        quantile = TWO_SIDED + _STUDENT_95 / self._freedom
        half_widths = quantile * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        residual = float(np.sqrt(np.mean(self._residuals ** 2)))
        return FittedBody(Body(body.mass, center, inertia),
                          half_widths, known, consistent, residual)

    def _body(self, change: Array) -> Body:
        """Return the body for a change of the ten parameters about the given center."""
        mass = self._given.mass + float(change[MASS])
        offset = change[FIRST_MOMENT] / mass
        inertia = (self._given.inertia + change[INERTIA]
                   - 0.5 * mass * _coupling(offset) @ offset)
        return Body(mass, self._given.center + offset, inertia)

    def _derivative(self, change: Array) -> Array:
        """Return the derivative (10, 10) of mass, center and inertia by the change."""
        mass = self._given.mass + float(change[MASS])
        offset = change[FIRST_MOMENT] / mass
        coupling = _coupling(offset)
        matrix = np.eye(TEN)
        matrix[FIRST_MOMENT, MASS] = -offset / mass
        matrix[FIRST_MOMENT, FIRST_MOMENT] /= mass
        matrix[INERTIA, MASS] = 0.5 * coupling @ offset
        matrix[INERTIA, FIRST_MOMENT] = -coupling
        return matrix

    def _covariance(self, solution: Solution) -> Array:
        """Return the covariance of the change, for residuals that are correlated in time."""
        # The fit takes these degrees of freedom.
        meat = self._meat * (self._freedom / (self._freedom - FRICTION - TEN / 6))
        # Shift that the uncertain friction may cause.
        by_friction = self._eliminate @ self._p
        meat += np.einsum('ikp,ikq->pq', by_friction, by_friction)
        covariance: Array = solution.covariance @ meat @ solution.covariance
        return covariance
