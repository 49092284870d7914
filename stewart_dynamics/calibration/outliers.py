# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Outliers among measured poses, which a calibration leaves out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.equations import Equations
from stewart_dynamics.calibration.geometry_fit import minimum, Unknowns
from stewart_dynamics.calibration.noise import ROUNDING
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN, LARGEST_ERROR

# Residuals above this multiple of the leg's deviation are outliers; robust fits are repeated while
# the deviations fall below this part, and others until the outliers stay.
_OUTLIER, _FALLS, _ROUNDS = 8.0, 0.8, 20
MOST_OUTLIERS = 0.2
"""A larger part of the poses that are outliers is no accident."""
# A leg that alone is off in a larger part of the poses has play: these are not outliers.
_OFTEN_ALONE = 0.1


class Outliers(NamedTuple):
    """Poses with outliers, and a fit to the others with equal weights, leg by leg."""

    residuals: Array  # (N, 6) [m], of all poses
    deviations: Array  # (6,) robust standard deviations [m]
    outlying: Flags  # (N, 6): which measured positions are outliers
    values: Array

    @property
    def left_out(self) -> Flags:
        """Return the poses (N,) to leave out; a leg that is often off alone has play."""
        alone = self.outlying & (np.sum(self.outlying, axis=1, keepdims=True) == 1)
        out: Flags = np.any(self.outlying & ~(np.mean(alone, axis=0) > _OFTEN_ALONE), axis=1)
        return out


def outliers(equations: Equations, unknowns: Unknowns) -> Outliers:
    """Return the outliers, by a robust fit and then by fits to the other poses."""
    lin = equations.at(unknowns.start)
    everything = np.ones(len(equations.positions), dtype=bool)

    def fitted(deviation: float, largest_error: float, sound: Flags, robust: bool = False,
               ) -> Outliers:
        whiten = np.eye(6) / deviation
        what = unknowns.identifiability(lin, whiten, largest_error)
        values = minimum(equations.part(sound), unknowns.start, what.known, whiten, robust)
        r = equations.at(values).residuals
        count = 6 * np.count_nonzero(sound)
        wider = np.sqrt(count / max(count - what.rank, 1))
        deviations = BY_MEDIAN * wider * np.median(np.abs(r[sound]), axis=0) + (
            10.0 * ROUNDING * unknowns.size)
        return Outliers(r, deviations, np.abs(r) > _OUTLIER * deviations, values)

    # All directions are free at first, so that the deviations are those of noise.
    found = fitted(unknowns.size, np.inf, everything)
    first = found = fitted(float(np.median(found.deviations)), LARGEST_ERROR, everything)
    for _ in range(_ROUNDS):  # outliers lose weight as the deviations approach those of the others
        before, found = found, fitted(
            float(np.median(found.deviations)), LARGEST_ERROR, everything, True)
        if np.median(found.deviations) > _FALLS * np.median(before.deviations):
            break
    for _ in range(_ROUNDS):
        sound: Flags = ~np.any(found.outlying, axis=1)
        if 6 * np.count_nonzero(sound) <= unknowns.basis.shape[1]:
            return first._replace(outlying=np.zeros_like(first.outlying))
        before, found = found, fitted(float(np.median(found.deviations)), LARGEST_ERROR, sound)
        if (found.outlying == before.outlying).all() and np.allclose(
                found.deviations, before.deviations):
            break
    return found
