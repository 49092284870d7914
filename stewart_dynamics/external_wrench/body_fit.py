# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Mass, center of mass and inertia of the platform from efforts, where all else is uncertain, too.

The efforts differ from those of the model by ``y = E z + noise``: z are independent and of unit
deviation, and E are the columns of the regressor for one deviation of each number in
``uncertainty.*``: of the platform (all about the given center of mass, so that numbers that are
not identifiable keep the given values), of legs and rotors, of the tilt of gravity and the gain
of the efforts. Friction is uncertain by its own size. The posterior of z is that of
``estimation``, with noise that is correlated in time and between the legs.

Accelerations from measured rates have noise, and with it the columns: sums of their products are
corrected by its known expectation (W. A. Fuller, "Measurement Error Models", 1987,
doi:10.1002/9780470316665, section 3.1).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.estimation.contradiction import Contradiction, UNCERTAIN, WIDENING
from stewart_dynamics.estimation.posterior import IDENTIFIABLE, Posterior, posterior
from stewart_dynamics.estimation.whitening import (
    covariance_of_scores, gram_of, spectra_of, Weights, weights_of)
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    about_origin, FIRST_MOMENT, INERTIA, MASS, point_inertia_derivative)
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import is_consistent
from stewart_dynamics.parameters.body import Body

TEN = 10
# Passes over the samples, each with the spectrum of the residuals of the one before.
ROUNDS = 3
# The noise is at least this part of the largest effort: no sensor is better.
_LEAST_NOISE = 1e-5


class FittedBody(NamedTuple):
    """The body that fits best."""

    body: Body  # numbers that are not known have the given values
    half_widths: Array  # (10,) halves of the 95 % intervals of mass, center and inertia
    known: Flags  # (10,) whether each of them is identifiable
    consistent: bool  # false: no real body has the inertia that fits best; it has the given one
    residual: float  # RMS of the efforts that remain [N]
    gain: float
    """Relative change of the gain of all efforts that legs and rotors show, if it is farther from
    the file than possible, by which the intervals are widened; else 0"""


class LegSamples(NamedTuple):
    """Means over W windows at equal distances, and how a wrong acceleration changes them."""

    columns: Array
    """(W, 6, n + 1): efforts for one deviation of each of n numbers, the platform's ten first,
    the gain of the efforts last, then efforts less those of the model [N]; zeros where a window is
    not used"""
    change: Array  # (10, 10) of mass, first moment, inertia about the center by the first ten z
    acceleration_noise: Array  # (6, 6) covariance of the noise in the accelerations of one window
    by_acceleration: Array  # (6, 6, n + 1) derivative of the columns by each of the six
    measured: float  # RMS of the efforts [N]
    gain: float  # deviation of the gain


class BodyFit:
    """``prepare``, ``improve`` ROUNDS times, then ``result``; ``given`` is the file's body."""

    def __init__(self, samples: LegSamples, given: Body) -> None:
        self._given, self._samples = given, samples
        self._posterior: Posterior | None = None

    def prepare(self) -> Iterator[None]:
        """Make the spectra; yield after each leg."""
        columns, legs = self._samples.columns, []
        for leg in range(6):
            legs.append(spectra_of(columns[:, leg:leg + 1], 0.5))
            yield
        self._spectra = np.concatenate(legs, axis=2)
        self._least = _LEAST_NOISE * float(np.abs(columns).max())
        self._weights = Weights.of_white(self._spectra[..., -1], self._least)
        yield

    def improve(self) -> Iterator[None]:
        """Fit with the present noise, and estimate the noise anew; yield after each piece."""
        many = len(self._samples.columns)
        white = self._weights.whitened(self._spectra)
        yield
        noise = self._noise()
        yield
        gram = gram_of(white)
        sums = gram - noise
        found = posterior(sums[:-1, :-1], sums[:-1, -1], np.zeros(len(sums) - 1), noise[:-1, :-1])
        yield
        e = white[..., :-1]
        free = 1.0 - np.sum((e @ found.covariance) * e, axis=-1)
        yield
        scores = covariance_of_scores(e, white[..., -1] - e @ found.values, free, many)
        self._posterior = found.with_scores(gram[:-1, :-1], scores)
        yield
        residuals = self._spectra[..., -1] - self._spectra[..., :-1] @ found.values
        self._weights = weights_of(residuals, free, many, self._least)
        rest = self._samples.columns[np.any(self._samples.columns[..., -1], axis=1)]
        self._residual = float(np.sqrt(np.mean(
            (rest[..., -1] - rest[..., :-1] @ found.values) ** 2)))
        yield

    def _noise(self) -> Array:
        """Return what noise in the accelerations adds to the sums of products."""
        of = self._samples
        values, vectors = np.linalg.eigh(of.acceleration_noise)
        independent = np.einsum('kl,kip->lip', vectors * np.sqrt(np.maximum(values, 0.0)),
                                of.by_acceleration)
        # Differences of one another's windows: at neighbours half of it, of the opposite sign.
        many = len(of.columns)
        power = 1.0 - np.cos(2.0 * np.pi / many * np.arange(len(self._spectra)))
        power *= 2.0 * np.count_nonzero(np.any(of.columns[..., -1], axis=1)) / many
        white = self._weights.mixing / self._weights.deviations[:, None]
        of_legs = np.einsum('f,fai,faj->ij', power, white, white)
        noise: Array = np.einsum('lip,ij,ljq->pq', independent, of_legs, independent,
                                 optimize=True)
        return noise

    def result(self) -> FittedBody:
        """Return the body."""
        found, by = self._posterior, self._samples.change
        assert found is not None
        change = by @ found.values[:TEN]
        before = by @ by.T
        after = by @ found.covariance[:TEN, :TEN] @ by.T
        derivative, at_start = self._derivative(change), self._derivative(np.zeros(TEN))
        half_widths, of_file = (TWO_SIDED * np.sqrt(np.maximum(np.diag(d @ c @ d.T), 0.0))
                                for d, c in ((derivative, after), (at_start, before)))
        contradicted, gain = Contradiction.of(found, np.array([len(found.values) - 1])), 0.0
        if contradicted.significance > UNCERTAIN:
            gain = self._samples.gain * float(contradicted.true[0])
            # efforts are linear in z: the gain of the change itself is not in the shift
            half_widths += WIDENING * np.abs(
                derivative @ (by @ contradicted.shift(found)[:TEN] - gain * change))
        known = half_widths < IDENTIFIABLE * of_file
        body = self._body(change)
        inertia = np.where(known[INERTIA], body.inertia, self._given.inertia)
        consistent = body.mass > 0.0 and (not known[INERTIA].any() or is_consistent(
            np.array([body.mass, 0.0, 0.0, 0.0, *inertia])))
        if not consistent:
            known[INERTIA] = False
            inertia = self._given.inertia
        center = np.where(known[FIRST_MOMENT], body.center, self._given.center)
        return FittedBody(
            Body(body.mass, center, inertia), half_widths, known, consistent, self._residual, gain)

    def _body(self, change: Array) -> Body:
        """Return the body for a change of the ten parameters about the given center."""
        mass = self._given.mass + float(change[MASS])
        offset = change[FIRST_MOMENT] / mass
        inertia = self._given.inertia + about_origin(-mass, offset, change[INERTIA])
        return Body(mass, self._given.center + offset, inertia)

    def _derivative(self, change: Array) -> Array:
        """Return the derivative (10, 10) of mass, center and inertia by the change."""
        mass = self._given.mass + float(change[MASS])
        offset = change[FIRST_MOMENT] / mass
        coupling = point_inertia_derivative(offset)
        matrix = np.eye(TEN)
        matrix[FIRST_MOMENT, MASS] = -offset / mass
        matrix[FIRST_MOMENT, FIRST_MOMENT] /= mass
        matrix[INERTIA, MASS] = 0.5 * coupling @ offset
        matrix[INERTIA, FIRST_MOMENT] = -coupling
        return matrix
