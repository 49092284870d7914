# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The posterior of all uncertain numbers, from the extracts of recordings.

The residuals of efforts, ``r = f(t + d) - (1 + gain) Y theta``, are noise that is correlated in
time and between legs. Their spectrum is estimated from the residuals themselves, smoothed over
frequencies, and the columns of regressor and efforts are divided by it, frequency by frequency:
the quotients are white, and sums of their products, one Gram matrix for each bag, hold all that
the recordings say (``estimation.whitening``). Prior and data then are two terms of one sum
(``estimation.posterior``), found by Gauss-Newton steps: theta is nonlinear in mass and center of
mass, and the delay d of each bag shifts its efforts by their Taylor series.

Noise of lengths and rates in Y adds to the Gram matrix, but is no information. It is estimated by
as much noise again, and subtracted (corrected scores: T. Nakamura 1990,
doi:10.1093/biomet/77.1.127).

Fitted values are projected onto physically consistent ones, in the metric of the information: mass
and friction are not negative, and the platform's pseudo-inertia is positive definite
(``mechanics.dynamics.pseudo_inertia``). If the posterior violates this, the platform's ten
parameters are fitted again in log-Cholesky parameters, which always describe a physical body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.errors import BagError
from stewart_dynamics.estimation.posterior import Posterior, posterior
from stewart_dynamics.estimation.whitening import gram_of, spectra_of, Weights, weights_of
from stewart_dynamics.identification.extraction import BAND, Extract, Extracts, ORDERS
from stewart_dynamics.identification.unknowns import CENTER, ORIGINS, PLATFORM, Unknowns
from stewart_dynamics.mechanics.dynamics.linear_parameters import inertial_derivative
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import (
    from_log_cholesky, log_cholesky, log_cholesky_derivative, smallest_eigenvalue, thickened)
from stewart_dynamics.parameters.table import Parameters

_STEPS = 30
_DONE = 1e-10
# Passes over the extracts, each with the spectra of the residuals of the one before.
_PASSES = 4
# Prior deviation of a delay, in cut-off periods: the Taylor series is valid for as much.
_DELAY = 0.2
# Lower bound of the residuals' deviation, reached with exact efforts, relative to the efforts.
_SMALLEST_DEVIATION = 1e-8
# Relative distance to the bound below which a body is a point or a rod within rounding.
_SMALLEST_BODY = 1e-6
_BODY_STEPS = 200
# Part of the deviation before the data above which a value keeps that of the file.
_HARDLY = 0.9


class Fit(NamedTuple):
    """The posterior of k unknowns, and of the delays of B bags."""

    values: Array  # (k,)
    covariance: Array  # (k, k)
    delays: Array  # (B,) of the efforts [s], + later than the positions
    delay_errors: Array  # (B,) [s]; nan: the delay is not identifiable
    at_bound: tuple[str, ...]
    """Names of parameters that would be inconsistent or negative without the bounds."""
    posterior: Posterior  # of z and the delays, all by the deviations of the prior
    delay_deviations: Array  # (B,) of the prior [s]
    weights: Sequence[Weights]  # of each extract

    @property
    def deviations(self) -> Array:
        """Return the (k,) standard deviations of the values."""
        deviations: Array = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return deviations

    def ratios(self, unknowns: Unknowns) -> Array:
        """Return the (k,) deviations of the unknowns after the data, by those before."""
        before = unknowns.deviations
        ratios: Array = np.divide(
            self.deviations, before, out=np.ones(len(before)), where=before > 0.0)
        return ratios

    def parts(self, unknowns: Unknowns) -> dict[str, Array]:
        """Return the standard deviation (k,) of each unknown by origin, 'noise' among them."""
        count = len(unknowns.start)
        across = unknowns.root @ self.posterior.covariance[:count, :count]
        parts = {name: np.sqrt(np.sum(across[:, unknowns.origins == n] ** 2, axis=1))
                 for n, name in enumerate(ORIGINS)}
        rest = np.diag(self.covariance) - sum(each ** 2 for each in parts.values())
        return {'noise': np.sqrt(np.maximum(rest, 0.0)), **parts}

    def of_prediction(self, extracts: Extracts, unknowns: Unknowns,
                      chosen: Callable[[Extract], Flags]) -> float:
        """Return the RMS deviation of the efforts that the fit predicts [N]."""
        squares, count = 0.0, 0
        for extract in extracts:
            e = extract.columns[chosen(extract)] @ directions(
                unknowns, self.values, self.delays, extract.bag, self.delay_deviations)
            squares += float(np.sum((e @ self.posterior.covariance) * e))
            count += len(e)
        return math.sqrt(squares / max(count, 1))


class Noisy(NamedTuple):
    """For each bag the number of an extract, and this extract again with more noise of legs."""

    numbers: Sequence[int]
    extracts: Extracts

    def both(self, clean: Extracts) -> Iterator[tuple[int, Extract, Extract]]:
        """Yield the number of each, the extract without more noise, and that with it."""
        without = (each for n, each in enumerate(clean) if n in self.numbers)
        for number, one, other in zip(self.numbers, without, self.extracts, strict=True):
            yield number, one, other._replace(used=one.used)


def least_deviation(extract: Extract) -> float:
    """Return the least deviation of residuals, reached with exact efforts [N]."""
    efforts = math.sqrt(float(np.mean(extract.efforts[..., 0] ** 2)))
    return _SMALLEST_DEVIATION * efforts + np.finfo(float).tiny


def shifted_by(delay: float) -> Array:
    """Return the coefficients (ORDERS,) of an effort that is not delayed, by its derivatives."""
    return np.array([delay ** order / math.factorial(order) for order in range(ORDERS)])


def residual_of(unknowns: Unknowns, values: Array, delay: float) -> Array:
    """Return the coefficients (q,) of a residual by columns."""
    return np.concatenate([
        -(1.0 + values[-1]) * unknowns.theta(values), shifted_by(delay)])


def directions(unknowns: Unknowns, values: Array, delays: Array, bag: int, deviations: Array,
               ) -> Array:
    """
    Return the negative derivative of a residual of a bag by z and the delays, (q, k + B).

    ``deviations`` (B,) are those of the delays in the prior [s].
    """
    theta, count = unknowns.theta(values), len(values)
    columns = np.zeros((len(theta) + ORDERS, count + len(delays)))
    by_values = (1.0 + values[-1]) * unknowns.derivative(values)
    by_values[:, -1] = theta
    columns[:len(theta), :count] = by_values @ unknowns.root
    columns[len(theta) + 1:, count + bag] = -deviations[bag] * shifted_by(delays[bag])[:-1]
    return columns


def delay_deviations(cutoffs: Array) -> Array:
    """Return the deviations of delays in the prior (B,) [s], for cut-off frequencies [Hz]."""
    deviations: Array = np.divide(
        _DELAY, cutoffs, out=np.zeros(len(cutoffs)), where=cutoffs > 0.0)
    return deviations


def covariance_of(unknowns: Unknowns, found: Posterior) -> Array:
    """Return the covariance (k, k) of the unknowns by the posterior of z and the delays."""
    count = len(unknowns.start)
    covariance: Array = unknowns.root @ found.covariance[:count, :count] @ unknowns.root.T
    return covariance


class _Sums(NamedTuple):
    """Gram matrices (B, q, q) of whitened columns, less that of the noise in them, and this."""

    grams: Array
    of_noise: Array

    @classmethod
    def corrected(cls, grams: Array, of_noise: Array) -> _Sums:
        """Return the sums without the noise; that of efforts and their derivative is another."""
        linear = np.ones(grams.shape[-1])
        linear[-ORDERS + 1] = 0.0
        return cls(grams - of_noise * np.outer(linear, linear), of_noise)


def best_for_file(extracts: Extracts, parameters: Parameters, kinds: Sequence[str], cutoffs: Array,
                  ratios: Array, chosen: Callable[[Extract], Flags] = lambda extract: extract.used,
                  ) -> Array:
    """
    Return the values (k,) that fit best if all that is not asked for is as the file says.

    Values that the data hardly change, by the ``Fit.ratios`` (k,), keep the file's value.
    """
    kept = ratios > _HARDLY
    kept |= ~np.isin(np.arange(len(kept)), Unknowns(parameters, kinds).asked)
    unknowns = Unknowns(parameters, kinds, kept)
    return _Fitting(extracts, unknowns, None, cutoffs, chosen, white=True).result(_PASSES).values


def fit(extracts: Extracts, unknowns: Unknowns, noisy: Noisy | None, cutoffs: Array,
        chosen: Callable[[Extract], Flags] = lambda extract: extract.used,
        passes: int = _PASSES) -> Fit:
    """
    Return the posterior from the chosen efforts (N, 6) of each extract.

    ``cutoffs`` are the cut-off frequencies of the bags (B,) [Hz]; 0 where the delay is known to be
    zero.
    """
    return _Fitting(extracts, unknowns, noisy, cutoffs, chosen).result(passes)


class _Fitting:
    def __init__(self, extracts: Extracts, unknowns: Unknowns, noisy: Noisy | None,
                 cutoffs: Array, chosen: Callable[[Extract], Flags], white: bool = False) -> None:
        self._white = white  # whether the residuals of each leg count as white noise
        self._extracts, self._unknowns, self._noisy = extracts, unknowns, noisy
        self._chosen, self._cutoffs = chosen, cutoffs
        self._values: Array = unknowns.start.copy()
        self._delays: Array = np.zeros(len(cutoffs))
        self._deviations = delay_deviations(cutoffs)
        self._weights: list[Weights] = []
        self._z: Array = np.zeros(len(unknowns.start) + len(cutoffs))
        self._posterior: Posterior | None = None

    def result(self, passes: int) -> Fit:
        for _ in range(passes):
            sums = self._sums()
            self._improve(sums)
        found, unknowns = self._posterior, self._unknowns
        assert found is not None
        count = len(unknowns.start)
        covariance = covariance_of(unknowns, found)
        errors = self._deviations * np.sqrt(np.maximum(np.diag(found.covariance)[count:], 0.0))
        bounded, at_bound = consistent(unknowns, self._values, covariance)
        return Fit(bounded, covariance, self._delays,
                   np.where(errors < 0.5 * self._deviations, errors, np.nan), at_bound, found,
                   self._deviations, self._weights)

    def _directions(self, bag: int) -> Array:
        return directions(
            self._unknowns, self._values, self._delays, bag, self._deviations)

    def _sums(self) -> _Sums:
        """Return the sums with the spectra of the present residuals."""
        bags, before, weights = len(self._cutoffs), self._weights, []
        grams: Array = np.zeros(())
        of_noise: Array = np.zeros(())
        samples: Array = np.zeros(bags)
        for number, extract in enumerate(self._extracts):
            spectra = spectra_of(extract.columns * self._chosen(extract)[..., None], BAND)
            bag, count = extract.bag, len(extract.times)
            left = spectra @ residual_of(self._unknowns, self._values, self._delays[bag])
            least = least_deviation(extract)
            if self._white or not before:
                each = Weights.of_white(left, least)
            else:
                assert self._posterior is not None
                e = before[number].whitened(spectra) @ self._directions(bag)
                free = 1.0 - np.sum((e @ self._posterior.covariance) * e, axis=-1)
                each = weights_of(left, free, count, least)
            weights.append(each)
            if not grams.ndim:
                grams = np.zeros((bags, spectra.shape[-1], spectra.shape[-1]))
                of_noise = np.zeros(grams.shape)
            grams[bag] += gram_of(each.whitened(spectra))
            samples[bag] += count
            # Noise of the efforts is in their derivative: that at rest shows no delay.
            w = 2.0 * np.pi / (count * extract.step) * np.arange(len(spectra) * bool(before))
            of_noise[bag, -ORDERS + 1, -ORDERS + 1] += 12.0 * float(w @ w)
        self._weights = weights
        if self._noisy is not None:
            for number, extract, more in self._noisy.both(self._extracts):
                change = (more.columns - extract.columns) * extract.used[..., None]
                white = weights[number].whitened(spectra_of(change, BAND))
                of_noise[extract.bag] += samples[extract.bag] / len(change) * gram_of(white)
        return _Sums.corrected(grams, of_noise)

    def _improve(self, sums: _Sums) -> None:
        """Find the values that fit the sums best."""
        unknowns, count = self._unknowns, len(self._unknowns.start)
        for _ in range(_STEPS):
            matrix = np.zeros((len(self._z), len(self._z)))
            noise, vector = np.zeros_like(matrix), np.zeros(len(self._z))
            for bag, (gram, of_noise) in enumerate(zip(sums.grams, sums.of_noise, strict=True)):
                e = self._directions(bag)
                c = residual_of(unknowns, self._values, self._delays[bag])
                matrix += e.T @ gram @ e
                noise += e.T @ of_noise @ e
                vector += e.T @ gram @ c
            if not np.isfinite(matrix).all():
                raise BagError('numbers overflow: are all units SI units?')
            self._posterior = posterior(matrix, vector, self._z, noise)
            change = self._posterior.values - self._z
            largest = float(np.abs(change).max(initial=0.0))
            # Limit the step where the mass is far from the file's: its products are nonlinear.
            z = self._z + change * min(1.0, 2.0 / largest if largest > 0.0 else 1.0)
            values = unknowns.start + unknowns.root @ z[:count]
            if values[0] <= 0.0:
                z = 0.5 * (self._z + z)
                values = unknowns.start + unknowns.root @ z[:count]
            self._z, self._values, self._delays = z, values, self._deviations * z[count:]
            if largest < _DONE:
                break


def consistent(unknowns: Unknowns, values: Array, covariance: Array,
               ) -> tuple[Array, tuple[str, ...]]:
    """Return values (k,) within all bounds, and the names of those that violated one."""
    found, beyond = values, np.zeros(len(values), dtype=bool)
    while np.any(more := [found[n] < 0.0 and not beyond[n] for n in unknowns.not_negative()]):
        beyond[unknowns.not_negative()[more]] = True
        found = _moved(values, covariance, beyond, np.zeros(np.count_nonzero(beyond)))
    if smallest_eigenvalue(unknowns.inertial(found)) < _SMALLEST_BODY:
        body = _body(unknowns, found, covariance[:PLATFORM, :PLATFORM])
        platform = np.arange(len(values)) < PLATFORM
        found = np.where(beyond, 0.0, _moved(found, covariance, platform, body))
        # Numbers that follow the platform must not become negative by that.
        beyond[unknowns.not_negative()] |= found[unknowns.not_negative()] < 0.0
        found = np.where(beyond & ~platform, 0.0, found)
        beyond |= platform
    return found, tuple(name for name, is_beyond in zip(unknowns.names, beyond, strict=True)
                        if is_beyond)


def _moved(values: Array, covariance: Array, which: Flags, given: Array) -> Array:
    """Return the conditional mean of values of which some have given values."""
    free = which & (np.diag(covariance) > 0.0)
    inner, across = covariance[np.ix_(free, free)], covariance[:, free]
    sizes = np.sqrt(np.diag(inner))
    change = np.linalg.pinv(inner / np.outer(sizes, sizes), hermitian=True) @ (
        (given[free[which]] - values[free]) / sizes)
    moved: Array = values + across @ (change / sizes)
    moved[which] = given
    return moved


def _body(unknowns: Unknowns, values: Array, covariance: Array) -> Array:
    """Return the nearest physical platform (10,), in the metric of the covariance."""
    rounding = 1e-12 * float(np.abs(values[:PLATFORM]).max())
    scales = np.sqrt(np.maximum(np.diag(covariance), 0.0)) + rounding
    metric = np.linalg.pinv(covariance / np.outer(scales, scales), hermitian=True)
    units = unknowns.inertial_units

    def candidate(eta: Array) -> Array:
        return unknowns.with_inertial(values, units * from_log_cholesky(eta))

    start = unknowns.inertial(unknowns.start) / units
    if smallest_eigenvalue(start) < _SMALLEST_BODY:  # the platform of the file is a plate
        start = thickened(start)
    eta = log_cholesky(start)
    found = candidate(eta)
    damping = 1e-3
    for _ in range(_BODY_STEPS):
        off = ((found - values)[:PLATFORM]) / scales
        scaled = inertial_derivative(found[0], found[CENTER]) * scales / units[:, None]
        derivative = np.linalg.pinv(scaled) @ log_cholesky_derivative(eta)
        normal = derivative.T @ metric @ derivative
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12),
                               -derivative.T @ metric @ off)
        eta_next = eta + np.clip(step, -1.0, 1.0)
        following = candidate(eta_next)
        nearer = ((following - values)[:PLATFORM]) / scales
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
    return found[:PLATFORM]
