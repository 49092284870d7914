# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Zero-phase filters of uniformly sampled signals, as symmetric FIR filters.

Three filters convert positions, and measured rates if available, into positions, rates and
accelerations of the same low-pass band. If both are available, they are weighted by their noise at
each frequency: positions with white noise s_q give rates with noise w s_q, which is less than the
noise s_v of the rates below w = s_v / s_q (Wiener weights). A fourth filter decimates any signal.

An output depends only on the input within half a filter length before and after it: an invalid
sample affects no other outputs, and windows can be filtered one by one.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array

# Width of the Blackman window's main lobe between its first zeros, times the window length.
_TRANSITION = 5.5

# Frequencies at which derivatives are exact, relative to the cut-off.
_EXACT = np.array([0.0, 0.05, 0.15, 0.3, 0.45, 0.6])
# Factors of lengths that a Fourier transform divides into fast parts.
_FACTORS = (2, 3, 5, 7, 11)
# Outputs of the decimating filter in one product of matrices.
_ROWS = 16
# Lowest frequency from which measured rates replace differentiated positions, by the cut-off.
_LEAST = 0.2


class LowPass(NamedTuple):
    """A low-pass filter for a sampling period."""

    period: float  # [s]
    cutoff: float  # frequency at which the amplitude is one half [Hz]
    half: int  # number of samples before and after an output on which it depends
    later: float = 0.0  # time by which outputs are those of earlier inputs [s]

    @classmethod
    def of(cls, period: float, cutoff: float, transition: float) -> LowPass:
        """Return a filter whose amplitude falls from 1 to 0 over a transition width [Hz]."""
        return cls(period, cutoff, math.ceil(0.5 * _TRANSITION / (transition * period)))

    def taps(self, order: int = 0) -> Array:
        """Return the coefficients (2 half + 1,) of a derivative, the newest sample last."""
        return self._sampled(lambda w: (1j * w) ** order)

    def fused(self, order: int, deviation: float, rate_deviation: float) -> tuple[Array, Array]:
        """Return the taps for positions and for rates, given their standard deviations."""
        # The impulse must not be longer than the filter.
        rate_deviation = max(rate_deviation, 2.0 * np.pi * _LEAST * self.cutoff * deviation)

        def of_positions(w: Array) -> Any:
            return rate_deviation ** 2 / (rate_deviation ** 2 + (w * deviation) ** 2)

        def of_rates(w: Array) -> Any:
            return -1j * w * deviation ** 2 / (rate_deviation ** 2 + (w * deviation) ** 2)

        return (self._sampled(lambda w: (1j * w) ** order * of_positions(w)),
                self._sampled(lambda w: (1j * w) ** order * of_rates(w)))

    def _sampled(self, response: Callable[[Array], Any]) -> Array:
        """Return the taps of the low-pass filter times a frequency response."""
        # A pulse of finite length has derivatives of the same length.
        lags = np.arange(-self.half, self.half + 1)
        pulse = 2.0 * self.cutoff * self.period * np.sinc(2.0 * self.cutoff * self.period * lags)
        pulse *= np.blackman(2 * self.half + 3)[1:-1]
        pulse /= pulse.sum()
        count = 8 * self.half + 8
        circle = np.zeros(count)
        circle[lags] = pulse
        w = np.asarray(2.0 * np.pi * np.fft.rfftfreq(count, self.period), dtype=np.float64)

        def whole(w: Array) -> Any:
            return response(w) * np.exp(-1j * w * self.later)

        impulse = np.fft.irfft(np.fft.rfft(circle) * whole(w), count)
        # y(t) = sum h(k) x(t - k): the newest sample, k = -half, last
        taps: Array = impulse[lags[::-1]]
        # Truncation must not affect slow signals: make the response exact at some low frequencies
        # by adding multiples of the pulse and of its differences.
        low = 2.0 * np.pi * self.cutoff * _EXACT
        columns = [pulse]
        while len(columns) < 2 * len(low) - 1:
            following = np.gradient(columns[-1])
            columns.append(following / np.abs(following).max() * pulse.max())
        parts = np.column_stack(columns)
        waves = np.exp(1j * self.period * np.outer(low, lags))  # the newest last, as the taps
        off = whole(low) * (waves @ pulse) - waves @ taps
        of_parts = waves @ parts
        right: Array = np.linalg.lstsq(
            np.concatenate([of_parts.real, of_parts[1:].imag]),
            np.concatenate([off.real, off[1:].imag]), rcond=None)[0]
        return taps + parts @ right


def convolved(signal: Array, taps: Array) -> Array:
    """Return the filtered signal (N, k), shorter by half a filter at each end."""
    count = len(signal) - len(taps) + 1
    size = 1 << (len(signal) - 1).bit_length()
    spectrum = np.fft.rfft(signal, size, axis=0) * np.fft.rfft(taps[::-1], size)[:, None]
    whole: Array = np.fft.irfft(spectrum, size, axis=0)[len(taps) - 1:len(taps) - 1 + count]
    return whole


def decimated(signal: Array, taps: Array, step: int) -> Array:
    """Return every ``step``-th sample of the filtered signal (M, ...)."""
    count = (len(signal) - len(taps)) // step + 1
    flat: Array = signal.reshape(len(signal), -1)
    # Several outputs at once, as a product of matrices: many times faster than one by one.
    rows = min(count, _ROWS)
    matrix = np.zeros((rows, (rows - 1) * step + len(taps)))
    for n in range(rows):
        matrix[n, n * step:n * step + len(taps)] = taps
    result = np.empty((count, flat.shape[1]))
    for first in range(0, count, rows):
        begin = min(first, count - rows)
        result[begin:begin + rows] = matrix @ flat[
            begin * step:begin * step + matrix.shape[1]]
    return result.reshape(count, *signal.shape[1:])


def fast_length(most: int) -> int:
    """Return the largest number of samples up to ``most`` whose Fourier transforms are fast."""
    for count in range(most, 0, -1):
        rest = count
        for factor in _FACTORS:
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return count
    return most


def white_deviation(signal: Array) -> Array:
    """Return the standard deviation of white noise in each column of a smooth signal (N, k)."""
    # Fourth differences remove the signal; the squares of 1 4 6 4 1 add up to 70.
    deviations: Array = np.sqrt(np.mean(np.diff(signal, 4, axis=0) ** 2, axis=0) / 70.0)
    return deviations
