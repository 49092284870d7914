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
Noise of measured leg positions and poses.

An error of a measured pose changes all six lengths at that pose, so the errors of its residuals
are correlated: ``sigma_L^2 1 + sigma_x^2 S S^T + sigma_R^2 T T^T``, with the rows s and
(arm x s) of the legs in S and T. Its diagonal alone would weight the legs one by one; with all of
it the standard errors of calibrated geometry are up to half as large (docs/calibration.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.equations import Linearization

# Lower bounds of estimated standard deviations of the lengths: by the residuals, as the rest would
# be a model without any error, and by the size of the hexapod, reached with exact data.
_LEAST, ROUNDING = 0.05, 1e-13


class Noise(NamedTuple):
    """Standard deviations."""

    length: float
    """Of a measured leg position [m]."""
    position: float
    """Of a measured position, each coordinate [m]."""
    rotation: float
    """Of a measured rotation, about each axis [rad]."""


def covariances(noise: Noise, size: float, lin: Linearization) -> Array:
    """Return the covariance (N, 6, 6) of the residuals of each pose [m^2]."""
    found: Array = max(noise.length, ROUNDING * size) ** 2 * np.eye(6) + sum(
        deviation ** 2 * each @ np.swapaxes(each, 1, 2) for deviation, each in (
            (noise.position, lin.position), (noise.rotation, lin.rotation)))
    return found


def whitening(covariance: Array) -> Array:
    """Return W (N, 6, 6) for covariances: W r has the covariance 1."""
    return np.linalg.inv(np.linalg.cholesky(covariance))


def estimated_noise(lin: Linearization, whiten: Array, size: float, unknowns: int) -> Noise:
    """
    Return the noise of residuals of a fit, from their products in each pose.

    The three variances, not negative, fit the products of whitened residuals best
    (Rao, "Estimation of variance and covariance components - MINQUE theory", J. Multivariate
    Analysis 1(3), 1971, doi:10.1016/0047-259X(71)90001-7).
    """
    from scipy.optimize import nnls

    r = lin.residuals * np.sqrt(lin.residuals.size / max(lin.residuals.size - unknowns, 1))
    square = float(np.mean(r ** 2))
    sides = [whiten, whiten @ lin.position, whiten @ lin.rotation]
    parts = [each @ np.swapaxes(each, 1, 2) for each in sides]
    unit = whiten @ r[..., None]
    matrix = np.array([[np.sum(a * b) for b in parts] for a in parts])
    vector = np.array([np.sum((np.swapaxes(unit, 1, 2) @ each) ** 2) for each in sides])
    scale = 1.0 / np.sqrt(np.diag(matrix))
    factor = np.linalg.cholesky(scale[:, None] * matrix * scale + 1e-12 * np.eye(3))
    variances, _ = nnls(factor.T, np.linalg.solve(factor, scale * vector))
    length, position, rotation = np.sqrt(scale * variances).tolist()
    return Noise(max(length, _LEAST * math.sqrt(square), ROUNDING * size), position, rotation)
