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
Weighted least squares of the unknowns on the sums of the extracts.

Gauss's and Newton's steps: forces are linear in theta, of which the platform's mass, center of
mass and inertia are products; the delay of the efforts of each bag is found along with them and
eliminated. The noise of each leg in each bag is that of its residuals. What the samples cannot
tell keeps its value (``mechanics.least_squares``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.identification.physical import consistent
from stewart_dynamics.identification.sums import delayed_by, residual_of, Sums
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.least_squares import (
    Identifiability, Information, LARGEST_ERROR, nothing, solve)

_STEPS = 30
_DONE = 1e-10
# Taylor's series of the delay hold up to this change in one step [s].
LONGEST_DELAY = 0.02
# The derivative of the efforts tells a delay if it is so many times that of noise, squared.
_TIMES_NOISE = 10.0
# Unknowns of which less than this part is told are not told at all.
LEAST_TOLD = 0.1
_HELD = 1e-6
# Below this variance [N^2] efforts are exact.
_SMALLEST_VARIANCE = 1e-12


class Fit(NamedTuple):
    """
    Unknowns that fit the samples.

    Attributes
    ----------
    values : (k,)
        Of the unknowns.
    covariance : (k, k)
        For white noise.
    delays : (B,)
        Of the efforts of each bag [s], + later than the positions.
    delay_errors : (B,)
        Their standard errors, for white noise; 0 where the motion does not tell the delay.
    variances : (B, 6)
        Of the residuals [N^2].
    identifiability : Identifiability
        Of the unknowns.
    matrix : (k, k)
        Their information, delays eliminated.
    at_bound : tuple of str
        What would be no body, or negative, without the bounds.

    """

    values: Array
    covariance: Array
    delays: Array
    delay_errors: Array
    variances: Array
    identifiability: Identifiability
    matrix: Array
    at_bound: tuple[str, ...]


def fit(sums: Sums, unknowns: Unknowns, noise: Array | None = None, prior: float | None = None,
        cutoffs: Array | None = None, largest_error: float = LARGEST_ERROR) -> Fit:
    """
    Return the unknowns that fit the samples best.

    Parameters
    ----------
    sums : Sums
        Of B bags.
    unknowns : Unknowns
        What is asked for, and its values in the file.
    noise : (6, n, n), optional
        The sums of the noise in the regressor alone.
    prior : float, optional
        The file's values are as good as this part of the unknowns' scales: they count as well.
    cutoffs : (B,), optional
        Of the filter of each bag [Hz]; find delays. By default they are zero.
    largest_error : float
        Of a direction that is known, see ``least_squares``.

    """
    found = _fit(sums, unknowns, unknowns.scales, noise, prior, cutoffs, largest_error)
    not_told = found.identifiability.told < LEAST_TOLD
    if not not_told.any():
        return found
    # What is hardly told is held at the file's value, not moved by what is told of it.
    found = _fit(sums, unknowns, np.where(not_told, _HELD, 1.0) * unknowns.scales, noise, prior,
                 cutoffs, largest_error)
    return found._replace(values=np.where(not_told, unknowns.start, found.values))


def _fit(sums: Sums, unknowns: Unknowns, scales: Array, noise: Array | None, prior: float | None,
         cutoffs: Array | None, largest_error: float) -> Fit:
    values = unknowns.start.copy()
    bags = len(sums.counts)
    delays: Array = np.zeros(bags)
    errors: Array = np.zeros(bags)
    variances = _variances(sums, unknowns, values, delays)
    solution = None
    for _ in range(_STEPS):
        information, steps, of_noise = _information(
            sums, unknowns, values, delays, variances, noise, cutoffs)
        if prior is not None:
            strength = np.diag((prior * unknowns.scales) ** -2.0)
            information = information._replace(
                matrix=information.matrix + strength,
                vector=information.vector + strength @ unknowns.start)
        solution = solve(information, unknowns.start, scales, of_noise, largest_error)
        change = solution.values - values
        largest = float(np.max(np.abs(change) / unknowns.scales, initial=0.0))
        # A mass far from the file's: its products are linear in a part of the way only.
        change *= min(1.0, 2.0 / largest) if largest > 0.0 else 1.0
        if unknowns.many_of_platform and values[0] + change[0] <= 0.0 and unknowns.names[0] == (
                'platform.mass'):
            change *= 0.5 * values[0] / -change[0]
        values = values + change
        for bag, (step, along, error) in enumerate(steps):
            delays[bag] += float(np.clip(step + along @ change, -LONGEST_DELAY, LONGEST_DELAY))
            delays[bag] *= error > 0.0
            errors[bag] = error
        delays = np.clip(delays, -LONGEST_DELAY, LONGEST_DELAY)
        variances = _variances(sums, unknowns, values, delays)
        if largest < _DONE:
            break
    assert solution is not None
    information, steps, of_noise = _information(
        sums, unknowns, values, delays, variances, noise, cutoffs)
    final = solve(information, unknowns.start, scales, of_noise, largest_error)
    bounded, at_bound = consistent(unknowns, values, information, final.identifiability)
    return Fit(bounded, final.covariance, delays, errors, variances, final.identifiability,
               information.matrix, at_bound)


def directions(unknowns: Unknowns, values: Array, delay: float, with_delay: bool = True) -> Array:
    """Return the derivative of minus a residual by unknowns, then by the delay, (q, k + 1)."""
    theta = unknowns.theta(values)
    by_delay = -delayed_by(theta, delay)
    columns = np.zeros((len(by_delay), len(values) + 1))
    columns[:len(theta), :-1] = unknowns.derivative(values)
    columns[:, -1] = by_delay if with_delay else 0.0
    return columns


def without_delay(normal: Array) -> Array:
    """Return how the delay follows the unknowns, (k,), from the normal matrix (k + 1, k + 1)."""
    along: Array = -normal[-1, :-1] / normal[-1, -1] if normal[-1, -1] > 0.0 else (
        np.zeros(len(normal) - 1))
    return along


def _information(sums: Sums, unknowns: Unknowns, values: Array, delays: Array, variances: Array,
                 noise: Array | None, cutoffs: Array | None,
                 ) -> tuple[Information, list[tuple[float, Array, float]], Array | None]:
    """Return what the sums tell, how each delay follows, and what noise alone seems to tell."""
    theta, derivative = unknowns.theta(values), unknowns.derivative(values)
    total, steps = nothing(len(values)), []
    for bag, delay in enumerate(delays):
        c = residual_of(theta, delay)
        gram = np.tensordot(1.0 / variances[bag], sums.grams[bag], axes=1)
        by_delay = delayed_by(theta, delay)
        # By its weighted residuals' own: what white noise up to the cut-off makes of it.
        told = cutoffs is not None and by_delay @ gram @ by_delay > (
            _TIMES_NOISE * sums.counts[bag].sum() * (2.0 * np.pi * cutoffs[bag]) ** 2 / 3.0)
        e = directions(unknowns, values, delay, told)
        normal, vector = e.T @ gram @ e, e.T @ gram @ c
        along = without_delay(normal)
        alone = float(vector[-1] / normal[-1, -1]) if normal[-1, -1] > 0.0 else 0.0
        matrix = normal[:-1, :-1] + np.outer(normal[:-1, -1], along)
        of_values = vector[:-1] - normal[:-1, -1] * alone
        total = total.plus(Information(
            matrix, of_values + matrix @ values, float(c @ gram @ c),
            int(sums.counts[bag].sum())))
        steps.append((alone, along, float(normal[-1, -1] ** -0.5) if told else 0.0))
    if noise is None:
        return total, steps, None
    mean = np.average(1.0 / variances, axis=0, weights=np.maximum(sums.counts.sum(axis=1), 1))
    of_noise = derivative.T @ np.tensordot(mean, noise, axes=1) @ derivative
    return total, steps, of_noise


def _variances(sums: Sums, unknowns: Unknowns, values: Array, delays: Array) -> Array:
    squares = sums.squares(unknowns.theta(values), delays)
    used = np.maximum(sums.counts - len(values) / 6.0, 1.0)
    variances: Array = np.maximum(squares / used, _SMALLEST_VARIANCE)
    return variances
