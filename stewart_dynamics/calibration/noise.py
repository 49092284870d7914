# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Noise of measured positions of drives and of poses.

An error of a measured pose changes all six residuals at that pose, so their errors are
correlated: ``sigma_q^2 D^2 + sigma_x^2 S S^T + sigma_R^2 T T^T``, with the derivatives by the
positions of the drives in the diagonal D (of telescopic legs -1), and the rows s and (arm x s) of
the legs in S and T. Its diagonal alone would weight the legs one by one; with all of
it the standard errors of calibrated geometry are up to half as large (docs/calibration.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.equations import Linearization
from stewart_dynamics.estimation.confidence_level import CONFIDENCE_LEVEL, TWO_SIDED
from stewart_dynamics.mechanics.least_squares import normal

# Lower bounds of standard deviations of positions: by the estimated noise of the poses, without
# which some combinations of positions could be exact; by the size of the hexapod, for exact data.
_LEAST, ROUNDING = 0.05, 1e-13
# Relative information, squared, of directions that are combinations of others.
_DEPENDENT = 1e-13


class Noise(NamedTuple):
    """Standard deviations."""

    drive: float  # of a measured position of a drive [m] or [rad]
    position: float  # of a measured position, each coordinate [m]
    rotation: float  # of a measured rotation, about each axis [rad]


def covariances(noise: Noise, size: float, lin: Linearization) -> Array:
    """Return the covariance (N, 6, 6) of the residuals of each pose [m^2]."""
    least = ROUNDING * size + 1e-6 * math.hypot(noise.position, size * noise.rotation)
    return np.asarray((np.maximum(
        noise.drive * np.abs(lin.drives), least) ** 2)[..., None] * np.eye(6) + sum(
        deviation ** 2 * each @ np.swapaxes(each, 1, 2) for deviation, each in (
            (noise.position, lin.position), (noise.rotation, lin.rotation))))


def whitening(covariance: Array) -> Array:
    """Return W (N, 6, 6) for covariances: W r has the covariance 1."""
    return np.linalg.inv(np.linalg.cholesky(covariance))


class VarianceComponents(NamedTuple):
    """
    A weighted fit to N poses, from which the three variances of the noise are estimated.

    The weights W have W V W^T = 1, V being the covariance of the residuals.
    """

    units: Array  # A (3, N, 6, 6): W V_i W^T for a unit of variance i
    rows: Array  # Z (N, 6, n): orthonormal combinations of the weighted derivatives
    known: Array  # the same combinations of the unknowns; their covariance is known known^T
    lever: float  # of the drives

    @classmethod
    def of(cls, lin: Linearization, whiten: Array, known: Array) -> VarianceComponents:
        """Return the components of a fit along the columns of ``known``."""
        sides = (whiten * lin.drives[:, None], whiten @ lin.position, whiten @ lin.rotation)
        rows = whiten @ (lin.derivatives @ known)
        scale = 1.0 / np.sqrt(np.sum(rows ** 2, axis=(0, 1)))
        squares, directions = np.linalg.eigh(normal(rows * scale, rows * scale))
        sound = squares > _DEPENDENT
        factor = scale[:, None] * directions[:, sound] / np.sqrt(squares[sound])
        return cls(np.stack([each @ np.swapaxes(each, 1, 2) for each in sides]), rows @ factor,
                   known @ factor, lin.lever)

    def _projected(self) -> tuple[Array, Array, Array]:
        """Return A_i Z (3, N, 6, n), Z^T A_i Z (3, n, n), and the traces of P V_i P V_j (3, 3)."""
        turned = self.units @ self.rows
        inner = np.stack([normal(self.rows, each) for each in turned])
        traces = (np.einsum('inab,jnab->ij', self.units, self.units)
                  - 2.0 * np.einsum('inak,jnak->ij', turned, turned)
                  + np.einsum('iab,jab->ij', inner, inner))
        return turned, inner, traces

    def noise(self, residuals: Array, size: float) -> Noise:
        """
        Return the noise of weighted residuals (N, 6) of the fit.

        Repeated with the weights of its result it is the restricted maximum likelihood, with
        variances that are not negative (D. A. Harville, "Maximum likelihood approaches to
        variance component estimation and to related problems", J. American Statistical
        Association 72(358), 1977, doi:10.1080/01621459.1977.10480998).
        """
        from scipy.optimize import nnls

        traces = self._projected()[2]
        vector = np.einsum('na,inab,nb->i', residuals, self.units, residuals)
        scale = 1.0 / np.sqrt(np.diag(traces))
        factor = np.linalg.cholesky(scale[:, None] * traces * scale + 1e-12 * np.eye(3))
        variances, _ = nnls(factor.T, np.linalg.solve(factor, scale * vector))
        drive, position, rotation = np.sqrt(scale * variances).tolist()
        least = _LEAST * math.hypot(position, size * rotation) / self.lever
        return Noise(max(drive, least), position, rotation)

    def covariance(self, estimated: bool) -> Array:
        """
        Return how uncertain the unknowns are (n, n), more so if the noise is estimated.

        Errors of the estimated variances make weights that are not the best, and standard errors
        that are uncertain, each with its own degrees of freedom. Student's quantile for these, by
        the normal one, is included: 1.96 standard errors have the probability of 95 %
        (M. G. Kenward, J. H. Roger, "Small sample inference for fixed effects from restricted
        maximum likelihood", Biometrics 53(3), 1997, doi:10.2307/2533558).
        """
        from scipy.stats import t

        if not estimated:
            return self.known @ self.known.T
        turned, inner, traces = self._projected()
        of_variances = 2.0 * np.linalg.pinv(traces, rcond=1e-12, hermitian=True)
        more = sum(of_variances[i, j] * (normal(turned[i], turned[j]) - inner[i] @ inner[j])
                   for i in range(3) for j in range(3))
        slopes = np.einsum('pa,iab,pb->pi', self.known, inner, self.known)
        spread = np.einsum('pi,ij,pj->p', slopes, of_variances, slopes)
        freedom = 2.0 * np.sum(self.known ** 2, axis=1) ** 2 / np.maximum(spread, 1e-300)
        wider = t.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL, np.maximum(freedom, 1.0)) / TWO_SIDED
        return np.asarray(wider[:, None] * (
            self.known @ (np.eye(len(more)) + 2.0 * more) @ self.known.T) * wider)
