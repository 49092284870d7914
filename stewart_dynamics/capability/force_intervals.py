# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Intervals in which leg forces stay within their bounds while something grows from zero."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.drives.motor_limits import exceeds
from stewart_dynamics.mechanics.limits import TOLERANCE


def largest_multiple(values: Array, changes: Array, bounds: Array) -> Array:
    """
    Return the largest t >= 0 with ``|values + t changes| <= bounds``.

    values, changes (..., 6): leg forces or rates, and their change for t = 1.
    bounds (6,): largest magnitudes.
    Returns (..., 6): 0 where the bound is exceeded at t = 0, infinity where it is never reached.
    """
    room = np.where(changes > 0.0, bounds - values, bounds + values)
    with np.errstate(divide='ignore', invalid='ignore'):
        multiples = np.where(changes == 0.0, np.inf, room / np.abs(changes))
    return np.where(exceeds(values, bounds), 0.0, np.maximum(multiples, 0.0))


def quadratic_exit(values: Sequence[Array], bounds: Array, begin: Array, end: Array,
                   slopes: Array | float = 0.0) -> Array:
    """
    Return the first k in [begin, end] with ``|c + k b + k^2 a| > bound + k slope``.

    values (three of (..., 6)): coefficients c, b and a of leg forces, or torques.
    bounds (..., 6): largest magnitudes at k = 0.
    begin, end (..., 6) or (): ends of the interval of each leg.
    slopes (..., 6): changes of the bounds for k = 1.
    Returns (..., 6): ``begin`` where the bound is exceeded there, infinity where it is not
        exceeded up to ``end``.
    """
    constant, linear, square = values
    first = np.full(np.broadcast_shapes(constant.shape, begin.shape, end.shape), np.inf)
    for sign in (1.0, -1.0):
        # room = c + b k + a k^2 is positive within the bound
        a, b, c = -sign * square, slopes - sign * linear, bounds - sign * constant
        with np.errstate(all='ignore'):
            root = np.sqrt(b * b - 4.0 * a * c)
            far = -0.5 * (b + np.copysign(root, b))
            candidates = np.stack([far / a, c / far])
            falls = b + 2.0 * a * candidates
            # room ends where it falls, or touches zero with a falling square
            ends = (candidates >= begin) & (candidates <= end) & (
                (falls < 0.0) | ((falls == 0.0) & (a < 0.0)))
            outside = c + begin * (b + begin * a) < -TOLERANCE * (bounds + begin * slopes)
        found = np.where(ends, candidates, np.inf).min(axis=0)
        first = np.minimum(first, np.where(outside, begin, found))
    return first
