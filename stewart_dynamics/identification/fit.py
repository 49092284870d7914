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
Weighted least squares of the unknowns on the sums of the extracts, and standard errors.

Gauss-Newton steps: forces are linear in theta, whose elements for the platform are products of
its mass, center of mass and inertia. The delay of the efforts of each bag is estimated jointly
and eliminated. The noise of each leg in each bag is estimated from its residuals. Unidentifiable
parameters keep their values (``mechanics.least_squares``).

Fitted values are projected onto physically consistent ones, in the metric of the information: mass
and friction are not negative, and the platform's pseudo-inertia is positive definite
(``mechanics.dynamics.pseudo_inertia``). If least squares violate this, the platform's ten
parameters are fitted again in log-Cholesky parameters, which always describe a physical body.

Residuals are coloured: filtered noise of efforts, noise of lengths in the regressor, and modeling
errors are correlated in time and between legs. Standard errors are those of a sandwich estimator.
With N the normal matrix and e_t the weighted directions of the fit,
``cov = N^-1 (sum_t sum_s e_t E[r_t r_s^T] e_s^T) N^-1``. The inner sum is estimated in two ways:

- by frequency, from the smoothed cross spectra of the residuals of the six legs: little scatter,
  for stationary noise;
- by blocks of time (White 1980, doi:10.2307/1912934, clustered): more scatter, also for residuals
  that depend on the motion.

For each parameter the larger estimate is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.identification.extraction import Extracts
from stewart_dynamics.identification.sums import delayed_by, residual_of, Sums
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import (
    from_log_cholesky, log_cholesky, log_cholesky_derivative, smallest_eigenvalue)
from stewart_dynamics.mechanics.least_squares import (
    Identifiability, Information, LEAST_SHARE, no_information, solve)


_STEPS = 30
_DONE = 1e-10
# Longest delay for which the Taylor series of the efforts is valid, in cut-off periods.
_LONGEST_DELAY = 0.2
# A delay is identifiable if the squared derivative of the efforts exceeds that of noise by this
# factor.
_TIMES_NOISE = 10.0
_HELD = 1e-6
# Lower bound of the residuals' deviation, reached with exact efforts, relative to the efforts.
_SMALLEST_DEVIATION = 1e-8
# Relative distance to the bound below which a body is a point or a rod within rounding.
_SMALLEST_BODY = 1e-6
_BODY_STEPS = 200


class Fit(NamedTuple):
    """Unknowns (k,) that fit the samples of B bags."""

    values: Array
    covariance: Array  # (k, k) for white noise
    delays: Array  # (B,) of the efforts [s], + later than the positions
    delay_errors: Array
    """(B,) standard errors for white noise [s]; 0: the delay is not identifiable"""
    variances: Array  # (B, 6) of the residuals [N^2]
    identifiability: Identifiability
    matrix: Array  # (k, k) information of the unknowns, delays eliminated
    at_bound: tuple[str, ...]
    """Names of parameters that would be inconsistent or negative without the bounds."""


def fit(sums: Sums, unknowns: Unknowns, noise: Array | None = None,
        cutoffs: Array | None = None) -> Fit:
    """
    Return the unknowns that fit the samples of B bags best.

    ``noise`` (6, n, n) are the sums of the noise in the regressor alone. Delays are estimated if
    the cut-off frequencies of the bags (B,) [Hz] are given, else zero.
    """
    found = _fit(sums, unknowns, unknowns.scales, noise, cutoffs)
    unknown = found.identifiability.known_shares < LEAST_SHARE
    if not unknown.any():
        return found
    # Weakly identifiable parameters keep the value from the file.
    found = _fit(sums, unknowns, np.where(unknown, _HELD, 1.0) * unknowns.scales, noise, cutoffs)
    return found._replace(values=np.where(unknown, unknowns.start, found.values))


def _fit(sums: Sums, unknowns: Unknowns, scales: Array, noise: Array | None,
         cutoffs: Array | None) -> Fit:
    values = unknowns.start.copy()
    bags = len(sums.counts)
    delays: Array = np.zeros(bags)
    longest: Array = np.zeros(bags) if cutoffs is None else _LONGEST_DELAY / cutoffs
    errors: Array = np.zeros(bags)
    variances = _variances(sums, unknowns, values, delays)
    for _ in range(_STEPS):
        information, steps, of_noise = _information(
            sums, unknowns, values, delays, variances, noise, cutoffs)
        information = information._replace(
            matrix=information.matrix + unknowns.strength,
            vector=information.vector + unknowns.strength @ unknowns.start)
        solution = solve(information, unknowns.start, scales, of_noise)
        change = solution.values - values
        largest = float(np.max(np.abs(change) / unknowns.scales, initial=0.0))
        # Limit the step if the mass is far from the file's: its products are nonlinear.
        change *= min(1.0, 2.0 / largest) if largest > 0.0 else 1.0
        if unknowns.many_of_platform and values[0] + change[0] <= 0.0 and unknowns.names[0] == (
                'platform.mass'):
            change *= 0.5 * values[0] / -change[0]
        values = values + change
        for bag, (step, along, error) in enumerate(steps):
            delays[bag] += float(np.clip(step + along @ change, -longest[bag], longest[bag]))
            delays[bag] *= error > 0.0
            errors[bag] = error
        delays = np.clip(delays, -longest, longest)
        variances = _variances(sums, unknowns, values, delays)
        if largest < _DONE:
            break
    information, _, of_noise = _information(
        sums, unknowns, values, delays, variances, noise, cutoffs)
    final = solve(information, unknowns.start, scales, of_noise)
    bounded, at_bound = consistent(unknowns, values, information.matrix)
    return Fit(bounded, final.covariance, delays, errors, variances, final.identifiability,
               information.matrix, at_bound)


def shift_of_noise(clean: Sums, noisy: Sums, unknowns: Unknowns, found: Fit,
                   cutoffs: Array | None) -> Array:
    """
    Return the bias (k,) of the unknowns by noise of lengths and rates, to first order.

    Noise in the regressor rounds the friction law where the rate changes its sign, and more noise
    does so again: the bias is estimated by the change of the unknowns with as much noise added
    (simulation extrapolation: Cook and Stefanski 1994, doi:10.1080/01621459.1994.10476871).
    ``noisy`` are the sums of the same samples with noise added.
    """
    known, steps = found.identifiability.known, []
    for sums in (clean, noisy):
        information, _, _ = _information(
            sums, unknowns, found.values, found.delays, found.variances, None, cutoffs)
        inner = known.T @ (information.matrix + unknowns.strength) @ known
        steps.append(known @ np.linalg.pinv(inner, hermitian=True) @ (
            known.T @ (information.vector - information.matrix @ found.values)))
    shift: Array = steps[1] - steps[0]
    return shift


def directions(unknowns: Unknowns, values: Array, delay: float, with_delay: bool = True) -> Array:
    """Return the negative derivative of a residual by unknowns and delay, (q, k + 1)."""
    theta = unknowns.theta(values)
    by_delay = -delayed_by(theta, delay)
    columns = np.zeros((len(by_delay), len(values) + 1))
    columns[:len(theta), :-1] = unknowns.derivative(values)
    columns[:, -1] = by_delay if with_delay else 0.0
    return columns


def without_delay(normal: Array) -> Array:
    """Return the derivative of the delay by the unknowns, (k,), from a normal matrix."""
    along: Array = -normal[-1, :-1] / normal[-1, -1] if normal[-1, -1] > 0.0 else (
        np.zeros(len(normal) - 1))
    return along


def _information(sums: Sums, unknowns: Unknowns, values: Array, delays: Array, variances: Array,
                 noise: Array | None, cutoffs: Array | None,
                 ) -> tuple[Information, list[tuple[float, Array, float]], Array | None]:
    """Return the information of the sums, each bag's delay step, and information due to noise."""
    theta, derivative = unknowns.theta(values), unknowns.derivative(values)
    total, steps = no_information(len(values)), []
    for bag, delay in enumerate(delays):
        c = residual_of(theta, delay)
        gram = np.tensordot(1.0 / variances[bag], sums.grams[bag], axes=1)
        by_delay = delayed_by(theta, delay)
        # Compare with the derivative of white noise below the cut-off.
        observable = cutoffs is not None and by_delay @ gram @ by_delay > (
            _TIMES_NOISE * sums.counts[bag].sum() * (2.0 * np.pi * cutoffs[bag]) ** 2 / 3.0)
        e = directions(unknowns, values, delay, observable)
        normal, vector = e.T @ gram @ e, e.T @ gram @ c
        along = without_delay(normal)
        alone = float(vector[-1] / normal[-1, -1]) if normal[-1, -1] > 0.0 else 0.0
        matrix = normal[:-1, :-1] + np.outer(normal[:-1, -1], along)
        of_values = vector[:-1] - normal[:-1, -1] * alone
        total = total.plus(Information(
            matrix, of_values + matrix @ values, float(c @ gram @ c),
            int(sums.counts[bag].sum())))
        steps.append((alone, along, float(normal[-1, -1] ** -0.5) if observable else 0.0))
    if noise is None:
        return total, steps, None
    mean = np.average(1.0 / variances, axis=0, weights=sums.counts)
    of_noise = derivative.T @ np.tensordot(mean, noise, axes=1) @ derivative
    return total, steps, of_noise


def _variances(sums: Sums, unknowns: Unknowns, values: Array, delays: Array) -> Array:
    squares = sums.squares(unknowns.theta(values), delays)
    used = np.maximum(sums.counts - len(values) / 6.0, 1.0)
    least = _SMALLEST_DEVIATION ** 2 * float(np.mean(sums.effort_squares() / used))
    variances: Array = np.maximum(squares / used, max(least, np.finfo(float).tiny))
    return variances


def consistent(unknowns: Unknowns, values: Array, information: Array,
               ) -> tuple[Array, tuple[str, ...]]:
    """Return values (k,) within all bounds, and the names of those that violated one."""
    # Unidentifiable parameters are held with a standard error of their scale.
    matrix = information + np.diag(unknowns.scales ** -2.0)
    beyond: list[str] = []
    free: Flags = np.ones(len(values), dtype=bool)
    found = values
    for _ in range(len(values)):
        negative = [n for n in unknowns.not_negative() if found[n] < 0.0 and free[n]]
        if not negative:
            break
        beyond += [unknowns.names[n] for n in negative]
        free[negative] = False
        found = _held(matrix, values, free)
    count = unknowns.many_of_platform
    if count and smallest_eigenvalue(unknowns.inertial(found)) < _SMALLEST_BODY:
        beyond += unknowns.names[:count]
        found = _as_body(unknowns, found, matrix)
    return found, tuple(beyond)


def _held(matrix: Array, values: Array, free: Flags) -> Array:
    """Return the values with some at zero and the others at their conditional optimum."""
    at_zero = np.where(free, values, 0.0)
    change = at_zero - values
    shift = np.linalg.solve(matrix[np.ix_(free, free)], matrix[np.ix_(free, ~free)]
                            @ change[~free])
    at_zero[free] = values[free] - shift
    return at_zero


def _as_body(unknowns: Unknowns, values: Array, matrix: Array) -> Array:
    """Return the nearest values with a physical platform, in the metric of information."""
    units = unknowns.inertial_scales

    def candidate(eta: Array) -> Array:
        return unknowns.with_inertial(values, units * from_log_cholesky(eta))

    count = unknowns.many_of_platform
    scales = unknowns.scales[:count]
    metric = matrix[:count, :count]
    eta = log_cholesky(unknowns.inertial(unknowns.start) / units)
    found = candidate(eta)
    damping = 1e-3
    for _ in range(_BODY_STEPS):
        off = (found - values)[:count]
        scaled = unknowns.derivative(found)[:10, :count] * scales / units[:, None]
        derivative = scales[:, None] * np.linalg.pinv(scaled) @ log_cholesky_derivative(eta)
        normal = derivative.T @ metric @ derivative
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12),
                               -derivative.T @ metric @ off)
        eta_next = eta + np.clip(step, -1.0, 1.0)
        following = candidate(eta_next)
        nearer = (following - values)[:count]
        cost, next_cost = off @ metric @ off, nearer @ metric @ nearer
        if next_cost > cost:
            damping *= 10.0
            if damping > 1e12:
                break
            continue
        eta, found, damping = eta_next, following, damping / 3.0
        if cost - next_cost < 1e-12 * cost or smallest_eigenvalue(
                unknowns.inertial(found)) < _SMALLEST_BODY:
            break
    return found


# Half width of the smoothing of spectra, relative to the sampling rate; number of samples in the
# blocks of time, and their minimum number.
_SMOOTHING = 0.01
_BLOCK = 100
_FEWEST_BLOCKS = 15


class Errors(NamedTuple):
    """Covariance (k, k) of the unknowns, and standard errors of the delays (B,) [s]."""

    covariance: Array
    delays: Array


def errors_of(extracts: Extracts, sums: Sums, unknowns: Unknowns, fit: Fit) -> Errors:
    """Return the standard errors of a fit to the sums of extracts."""
    theta, count = unknowns.theta(fit.values), len(fit.values)
    e_of_bags, alongs, alone = [], [], []
    for bag, delay in enumerate(fit.delays):
        e = directions(unknowns, fit.values, delay, bool(fit.delay_errors[bag]))
        gram = np.tensordot(1.0 / fit.variances[bag], sums.grams[bag], axes=1)
        normal = e.T @ gram @ e
        alongs.append(without_delay(normal))
        alone.append(normal[-1, -1])
        e_of_bags.append(e)
    by_frequency = np.zeros((count, count))
    scores, own = [], np.zeros((len(fit.delays), count + 1))
    for extract in extracts:
        bag = extract.bag
        columns = extract.columns * extract.used[..., None]
        residuals = columns @ residual_of(theta, fit.delays[bag])
        weighted = columns @ e_of_bags[bag] / fit.variances[bag][:, None]
        # The delay depends on the unknowns; its own error comes from its own column.
        follow = weighted[..., :-1] + weighted[..., -1:] * alongs[bag]
        both = np.concatenate([follow, weighted[..., -1:]], axis=-1)
        middle = _by_frequency(both, residuals)
        by_frequency += middle[:-1, :-1]
        own[bag] += middle[-1]
        size = max(1, min(_BLOCK, len(residuals) // _FEWEST_BLOCKS))
        products = np.einsum('nlk,nl->nk', follow, residuals)
        scores.append(np.add.reduceat(products, np.arange(0, len(products), size), axis=0))
    score = np.concatenate(scores) if scores else np.zeros((1, count))
    by_blocks = score.T @ score * len(score) / max(len(score) - 1, 1)
    known = fit.identifiability.known
    inner = known.T @ (fit.matrix + unknowns.strength) @ known
    bread = known @ np.linalg.pinv(inner, hermitian=True) @ known.T
    candidates = [bread @ middle @ bread for middle in (by_frequency, by_blocks)]
    larger = np.sqrt(np.maximum(*(np.maximum(np.diag(each), 0.0) for each in candidates)))
    first = np.sqrt(np.maximum(np.diag(candidates[0]), 1e-300))
    scale = np.maximum(larger / first, 1.0)
    delays = np.zeros(len(fit.delays))
    for bag, (along, each) in enumerate(zip(alongs, alone, strict=True)):
        if each > 0.0:
            through = along @ bread
            delays[bag] = np.sqrt(max(0.0, through @ by_frequency @ through + (
                2.0 * through @ own[bag, :-1] + own[bag, -1] / each) / each))
    return Errors(scale[:, None] * candidates[0] * scale, delays)


def _by_frequency(weighted: Array, residuals: Array) -> Array:
    """Return the inner sum of a block from columns (N, 6, k) and residuals (N, 6)."""
    count = len(residuals)
    size = 1 << (2 * count - 1).bit_length()
    r = np.fft.rfft(residuals, size, axis=0)
    spectra = np.einsum('fi,fj->fij', r, r.conj()) / count
    smooth = smoothed(spectra, max(1, round(_SMOOTHING * size)))
    e = np.fft.rfft(weighted, size, axis=0)
    # one-sided: all frequencies except the first and the last count twice
    twice = np.full(len(e), 2.0)
    twice[0] = twice[-1] = 1.0
    first = np.einsum('fij,fjk->fik', smooth.conj(), e)
    middle = np.einsum('f,fik,fil->kl', twice, e.conj(), first, optimize=True)
    return np.asarray(middle.real / size)


def smoothed(spectra: Array, width: int) -> Array:
    """Return the running mean over 2 width + 1 frequencies, mirrored at both ends."""
    width = min(width, len(spectra) - 1)
    whole = np.concatenate([spectra[width:0:-1].conj(), spectra, spectra[-2:-width - 2:-1].conj()])
    sums = np.cumsum(np.concatenate([np.zeros((1, *spectra.shape[1:])), whole]), axis=0)
    mean: Array = (sums[2 * width + 1:] - sums[:-2 * width - 1]) / (2 * width + 1)
    return mean
