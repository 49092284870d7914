# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Multisines: periodic signals that excite chosen frequencies, with low peaks.

Harmonics are nearly even on a logarithmic scale, and each has the same velocity: slow ones move
far, fast ones accelerate. The phases are the best of those of Schroeder (Synthesis of
low-peak-factor signals and binary sequences with low autocorrelation, IEEE Trans. Information
Theory 16, 1970, doi:10.1109/TIT.1970.1054411) and some random ones, each improved by clipping and
projecting (E. Van der Ouderaa et al., Peak factor minimization using a time-frequency domain
swapping algorithm, IEEE Trans. Instrumentation and Measurement 37, 1988, doi:10.1109/19.2684),
here of position, velocity and acceleration at once: all three are bounded by limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers

# Number of harmonics that are chosen at most; low ones coincide.
_HARMONICS = 40
# Sets of phases that are improved, rounds of each, and the parts of the peaks that are clipped to,
# in the first and the last round.
_STARTS, _ROUNDS, _CLIPPED = 20, 100, (0.75, 0.95)


class Multisine(NamedTuple):
    """A sum of cosines of one period: amplitude cos(2 pi harmonic t / period + phase)."""

    harmonics: Integers  # (K,)
    amplitudes: Array  # (K,); the peak of the sum is 1
    phases: Array  # (K,) [rad]

    def at(self, periods: Array) -> tuple[Array, Array, Array]:
        """Return the signal at times (...) in periods, and its derivatives by that time."""
        x, dx, ddx = np.zeros((3, *np.shape(periods)))
        part = np.mod(periods, 1.0)
        for k, amplitude, phase in zip(self.harmonics.tolist(), self.amplitudes.tolist(),
                                       self.phases.tolist(), strict=True):
            omega = 2.0 * np.pi * k
            c, s = np.cos(omega * part + phase), np.sin(omega * part + phase)
            x += amplitude * c
            dx -= amplitude * omega * s
            ddx -= amplitude * omega ** 2 * c
        return x, dx, ddx


@lru_cache(maxsize=8)
def multisine(highest: int) -> Multisine:
    """Return a multisine of harmonics from 1 to the highest; it is always the same."""
    harmonics = np.unique(np.rint(np.geomspace(1, highest, _HARMONICS)).astype(np.int64))
    lines = _Lines(harmonics)
    random = np.random.default_rng(0)
    starts = [_schroeder(harmonics)] + [
        random.uniform(0.0, 2.0 * np.pi, len(harmonics)) for _ in range(_STARTS - 1)]
    best = min((each for start in starts for each in lines.improved(start)),
               key=lambda each: each[0])[1]
    peak = float(np.abs(lines.signals(best)[0]).max() * lines.deviations[0])
    return Multisine(harmonics, 1.0 / harmonics / peak, best)


class _Lines:
    """Position, velocity and acceleration of the harmonics, all of the same velocity."""

    def __init__(self, harmonics: Integers) -> None:
        self._harmonics = harmonics
        self._size = 1 << (16 * int(harmonics[-1])).bit_length()
        orders = np.arange(3)[:, None]
        amplitudes = harmonics ** (orders - 1.0)
        self.deviations: Array = np.sqrt(np.sum(amplitudes ** 2, axis=1) / 2.0)
        self._weights = amplitudes / self.deviations[:, None]
        self._turns = 1j ** orders

    def signals(self, phases: Array) -> Array:
        """Return the (3, N) signals over one period, each of an RMS of 1."""
        lines = np.zeros((3, self._size // 2 + 1), dtype=complex)
        lines[:, self._harmonics] = self._weights * np.exp(1j * phases) * self._turns
        found: Array = np.fft.irfft(lines, self._size) * (self._size / 2.0)
        return found

    def improved(self, phases: Array) -> Iterator[tuple[float, Array]]:
        """Yield the product of the three crest factors, and the phases, of each round."""
        for level in np.linspace(*_CLIPPED, _ROUNDS):
            signals = self.signals(phases)
            peaks = np.abs(signals).max(axis=1, keepdims=True)
            yield float(np.prod(peaks)), phases
            clipped = np.fft.rfft(signals.clip(-level * peaks, level * peaks))
            phases = np.angle(np.sum(
                clipped[:, self._harmonics] * self._weights / self._turns, axis=0))


def _schroeder(harmonics: Integers) -> Array:
    """Return phases of equal velocities: their sum sweeps through the frequencies once."""
    share = np.arange(len(harmonics)) / len(harmonics)
    steps = np.diff(harmonics, prepend=harmonics[0])
    phases: Array = -2.0 * np.pi * np.cumsum(steps * share)
    return phases
