# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Numbers that data put farther from a parameter file than its uncertainty allows.

If the model is right, the means of numbers after the data have the covariance 1 - C, with C their
covariance after the data. The square of the means by this covariance is chi-squared distributed;
it is also twice the logarithm of the likelihood ratio that these numbers may have any value. The
gain of the efforts is one of them: mass and friction change with it, but legs and rotors, which
the file knows, do not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.estimation.posterior import Posterior

UNCERTAIN = 4.0
"""Standard deviations of a normal distribution from which numbers contradict the file."""
WIDENING = 1.5
"""Multiple of a shift by which intervals are widened: causes are known roughly."""
# Part of the variance before the data that must be gone after it, in a direction that is judged;
# of a single number less.
_KNOWN, _KNOWN_ALONE = 0.05, 0.01


class Contradiction(NamedTuple):
    """How far p numbers are from the file's."""

    places: Integers  # (p,) of the numbers
    true: Array  # (p,) what they are, in terms of their deviations before the data
    statistic: float
    freedom: int

    @classmethod
    def of(cls, after: Posterior, places: Integers) -> Contradiction:
        """Return it for some numbers after the data."""
        values, vectors = np.linalg.eigh(
            np.eye(len(places)) - after.covariance[np.ix_(places, places)])
        known = values > (_KNOWN if len(places) > 1 else _KNOWN_ALONE)
        along = (vectors.T @ after.values[places])[known]
        return cls(places, vectors[:, known] @ (along / values[known]),
                   float(np.sum(along ** 2 / values[known])), int(known.sum()))

    @property
    def significance(self) -> float:
        """Return it as standard deviations of a normal distribution."""
        return deviations(self.statistic, self.freedom) if self.freedom else 0.0

    def shift(self, after: Posterior) -> Array:
        """Return by how much (n,) the file's values shift all numbers after the data."""
        shift: Array = after.covariance[:, self.places] @ self.true
        return shift


def deviations(statistic: float, freedom: int) -> float:
    """
    Return a chi-squared value as standard deviations of a normal distribution.

    Uses the cube-root approximation (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684).
    """
    part = 2.0 / (9.0 * freedom)
    return float((np.cbrt(statistic / freedom) - 1.0 + part) / math.sqrt(part))
