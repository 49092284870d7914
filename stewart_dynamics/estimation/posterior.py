# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The posterior of uncertain numbers: what a parameter file and data say together.

Data are linear in the numbers z, ``r = Y z + noise``, and z are independent, of mean 0 and
deviation 1, before the data: the posterior has the precision ``Y^T W Y + 1`` (Gaussian
conditioning; C. M. Bishop, "Pattern Recognition and Machine Learning", 2006, section 3.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.least_squares import ROUNDING, TIMES_NOISE

# A number is identifiable if its deviation after the data is less than this part of that before.
IDENTIFIABLE = 0.5


class Posterior(NamedTuple):
    """
    The distribution of n numbers after the data; before, they were independent, of deviation 1.

    values (n,): its mean.
    covariance (n, n).
    gain (n, n): derivative of the mean by Y^T W r.
    """

    values: Array
    covariance: Array
    gain: Array

    def with_scores(self, expected: Array, found: Array) -> Posterior:
        """Return it with another covariance (n, n) of Y^T W r than expected, as residuals show."""
        return self._replace(covariance=self.covariance + self.gain @ (
            found - expected) @ self.gain)


def posterior(matrix: Array, vector: Array, at: Array, noise: Array) -> Posterior:
    """
    Return the distribution of numbers z, independent and of deviation 1 before the data.

    matrix (n, n): Y^T W Y, without what noise in Y adds to it; W is the inverse of the covariance
        of the noise.
    vector (n,): likewise Y^T W r, with the residuals r at the point ``at`` (n,).
    noise (n, n): Y^T W Y of the noise in Y alone. Directions that do not have many times as much
        information keep their distribution.
    """
    values, directions = np.linalg.eigh(matrix - (TIMES_NOISE - 1.0) * noise)
    known = directions[:, values > ROUNDING ** 2 * max(float(values[-1]), 1.0)]
    inner = known.T @ matrix @ known
    inverse = np.linalg.inv(inner + np.eye(len(inner)))
    mean = known @ (inverse @ (known.T @ vector + inner @ (known.T @ at)))
    gain = known @ inverse @ known.T
    return Posterior(mean, gain + np.eye(len(at)) - known @ known.T, gain)
