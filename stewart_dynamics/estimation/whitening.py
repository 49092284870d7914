# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
White noise from noise that is correlated in time and between legs, by the spectra of residuals.

The spectrum of the noise is estimated from residuals, smoothed over frequencies, and columns are
divided by it, frequency by frequency. Sums of products of the quotients hold all that uniform
samples say (generalized least squares with an estimated spectrum; P. Whittle, "Estimation and
information in stationary time series", Arkiv foer Matematik 2, 1953, doi:10.1007/BF02590998).
Samples that are not used are zeros in all columns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.estimation.empirical_bayes import real_share

# Half width of the smoothing of spectra, relative to the rate of the samples, and its minimum in
# frequencies.
_SMOOTHING, _FEWEST = 0.0125, 8
# Least part of the variance of residuals that the fit leaves.
_LEAST_FREE = 2e-3
# Least variance of a combination of legs, relative to uncorrelated legs.
_LEAST_OF_LEGS = 0.05


class Weights(NamedTuple):
    """Factors that make the residuals of uniform samples white."""

    deviations: Array  # (F, 6) of residuals at each frequency [N]
    mixing: Array  # (6, 6) of the legs

    @classmethod
    def of_white(cls, residuals: Array, least: float) -> Weights:
        """Return the weights of white noise of each leg, as large as residuals (F, 2, 6)."""
        sizes = np.sqrt(np.mean(residuals ** 2, axis=(0, 1))) + least
        return cls(np.broadcast_to(sizes, (len(residuals), 6)), np.eye(6))

    def whitened(self, spectra: Array) -> Array:
        """Return the spectra (F, 2, 6, q) of columns, whitened."""
        white: Array = self.mixing @ (spectra / self.deviations[:, None, :, None])
        return white


def spectra_of(columns: Array, band: float) -> Array:
    """Return real and imaginary parts (F, 2, 6, q) of columns up to ``band`` periods a sample."""
    count = len(columns)
    spectra = np.fft.rfft(columns, axis=0)[:int(count * band) + 1]
    # one-sided: all frequencies except the first count twice
    spectra *= math.sqrt(2.0 / count)
    spectra[0] *= math.sqrt(0.5)
    parts: Array = np.stack([spectra.real, spectra.imag], axis=1)
    return parts


def gram_of(white: Array) -> Array:
    """Return the sums of products (q, q) of whitened spectra."""
    flat = white.reshape(-1, white.shape[-1])
    gram: Array = flat.T @ flat
    return gram


def weights_of(residuals: Array, free: Array, samples: int, least: float) -> Weights:
    """
    Return the weights by spectra of residuals (F, 2, 6).

    The logarithms of the legs' spectra have one shape, and deviations from it as large as they
    show beyond chance (``empirical_bayes``): the fewer numbers are estimated from the residuals,
    the less do weights follow the residuals that they weigh.

    ``free`` (F, 2, 6) are the parts of their variance that the fit leaves, ``least`` the smallest
    deviation [N].
    """
    width = min(max(_FEWEST, round(_SMOOTHING * samples)), len(residuals) - 1)
    power, left = (smoothed(each.sum(axis=1), width) for each in (residuals ** 2, free))
    own = np.log(np.maximum(power / np.maximum(left, _LEAST_FREE), least ** 2))
    of_legs, used = own.mean(axis=0), power.any(axis=0)
    of_all = of_legs + (own - of_legs) @ (used / max(used.sum(), 1))[:, None]
    share = real_share(np.mean((own - of_all) ** 2, axis=0), 1.0 / (2 * width + 1))
    deviations = np.exp(0.5 * (of_all + share * (own - of_all)))
    along = (residuals / deviations[:, None]).reshape(-1, 6)
    correlation = along.T @ along
    sizes = np.sqrt(np.outer(np.diag(correlation), np.diag(correlation)))
    # A leg of which nothing is used has no residuals.
    correlation = np.divide(correlation, sizes, out=np.eye(6), where=sizes > 0.0)
    values, vectors = np.linalg.eigh(correlation)
    return Weights(
        deviations, vectors / np.sqrt(np.maximum(values, _LEAST_OF_LEGS)) @ vectors.T)


def covariance_of_scores(columns: Array, residuals: Array, free: Array, samples: int) -> Array:
    """
    Return the covariance (n, n) of the products of whitened columns (F, 2, 6, n) and residuals.

    It is that of residuals (F, 2, 6) whose correlation between the legs changes over the
    frequencies; ``free`` are the parts of their variance that the fit leaves.
    """
    width = max(_FEWEST, round(_SMOOTHING * samples))
    scaled = residuals / np.sqrt(np.maximum(free, _LEAST_FREE))
    of_legs = 0.5 * smoothed(np.swapaxes(scaled, 1, 2) @ scaled, width)
    many = columns.shape[-1]
    scores: Array = columns.reshape(-1, many).T @ (of_legs[:, None] @ columns).reshape(-1, many)
    return scores


def smoothed(spectra: Array, width: int) -> Array:
    """Return the running mean over 2 width + 1 frequencies, mirrored at both ends."""
    width = min(width, len(spectra) - 1)
    whole = np.concatenate([spectra[width:0:-1], spectra, spectra[-2:-width - 2:-1]])
    sums = np.cumsum(np.concatenate([np.zeros((1, *spectra.shape[1:])), whole]), axis=0)
    mean: Array = (sums[2 * width + 1:] - sums[:-2 * width - 1]) / (2 * width + 1)
    return mean
