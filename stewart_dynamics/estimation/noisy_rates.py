# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The law of Coulomb friction at rates that are measured with noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array

_LEAST = 1e-9  # deviation of the noise, by the rate at which the law ends
# Means of max(x + n, 0) over a normal n of deviation 1, by x.
_AT = np.linspace(-8.0, 8.0, 3201)
_MEANS = np.array([0.5 * x * math.erfc(-x / math.sqrt(2.0)) for x in _AT.tolist()]) + np.exp(
    -0.5 * _AT ** 2) / math.sqrt(2.0 * math.pi)


def smoothed_law(rates: Array, coulomb_velocity: Array, deviation: ArrayLike) -> Array:
    """
    Return the shape of Coulomb friction (N, 6), -1 to 1, at measured rates [m/s].

    It is the mean over the true rates, with a standard deviation of the noise [m/s]: noise then
    does not make the friction that fits too small (regression calibration: Carroll et al.,
    "Measurement Error in Nonlinear Models", 2006, doi:10.1201/9781420010138, chapter 4).
    """
    noise = np.maximum(deviation, _LEAST * np.asarray(coulomb_velocity))

    def integral(at: Array) -> Array:
        """Return the mean of max(at + noise, 0)."""
        part = at / noise
        mean: Array = noise * np.where(part < _AT[-1], np.interp(part, _AT, _MEANS), part)
        return mean

    law: Array = (integral(rates + coulomb_velocity) - integral(rates - coulomb_velocity)
                  ) / coulomb_velocity - 1.0
    return law


def rates_in_noise(measured: Array, noise: Array) -> tuple[Array, Array]:
    """
    Return the means and deviations (N, 6) of the true rates at uniform times [m/s].

    Before the measurement, the rates (N, 6) are a parabola in time and a white deviation from it,
    as large as the measured rates show beside the deviation of their noise (6,) (empirical Bayes:
    B. Efron, "Large-Scale Inference", 2010, doi:10.1017/CBO9780511761362, section 1.2).
    """
    count = len(measured)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, count), 3))
    curve = basis @ (basis.T @ measured)
    variance = np.sum((measured - curve) ** 2, axis=0) / max(count - 3, 1)
    noise = noise ** 2
    share = np.divide(variance - noise, variance, out=np.zeros(6), where=variance > noise)
    of_curve = np.sum(basis ** 2, axis=1)[:, None] * noise
    return (curve + share * (measured - curve),
            np.sqrt(share * noise + (1.0 - share) ** 2 * of_curve))
