# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Finds readings that are stamped when they arrive, in bursts, not when they are taken.

Polynomials through readings that were taken at even times, but have uneven stamps, fit them better
over even times than over the stamps. Where readings were lost, or taken at uneven times, it is the
other way round; noise fits both alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps
from stewart_dynamics.setpoints.consistency import MessageError

# A block is judged when it has this many readings and is this long [ns].
_FEWEST, _SHORTEST = 48, SECOND // 2
# Blocks in a row that must agree.
_PERSISTENT = 2
# Deviation of the stamps from even times, RMS, from which it counts [s]: changes of a quantity
# with a cut-off frequency of 10 Hz are then off by 15 %. Jitter without real time is less.
LARGEST = 2.4e-3
# Degree of the polynomials, and the ratio of the sums of their squared residuals that is clear:
# noise in 50 readings has up to 1.5.
_DEGREE, _CLEAR = 8, 2.0
# Squared residuals below this part of the values are rounding errors.
_ROUNDING = 1e-24


class ArrivalStamps:
    """The check of a stream of readings of any length."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._readings: list[Sequence[float]] = []
        self._row = 0  # blocks in a row with stamps of arrival
        self.present: tuple[str, int] | None = None
        """The possible error in the last blocks, and the first stamp of these [ns]."""
        self.found: tuple[str, int] | None = None
        """The first one."""

    def possible_errors(self, ever: bool, topics: Sequence[str]) -> list[MessageError]:
        """Return the first error if ``ever``, else the present one, for each of the topics."""
        found = self.found if ever else self.present
        return [] if found is None else [
            MessageError(topic, f'possible error: {found[0]}', found[1]) for topic in topics]

    def add_readings(self, stamps: ArrayLike, readings: ArrayLike) -> None:
        """Add readings (N, n) of any units at their stamps (N,) [ns]."""
        stamps, readings = np.asarray(stamps, dtype=np.int64), np.asarray(readings)
        steps = np.diff(stamps)
        apart = np.flatnonzero((steps <= 0) | (steps >= _SHORTEST)) + 1
        at, count = 0, len(stamps)
        for end in (*apart.tolist(), count):
            while at < end:
                if not self._stamps:  # a block that is whole
                    last = max(at + _FEWEST - 1, int(np.searchsorted(
                        stamps[at:end], stamps[at] + _SHORTEST)) + at)
                    if last < end:
                        self._judge(stamps[at:last + 1], readings[at:last + 1])
                        at = last + 1
                        continue
                self._add_reading(int(stamps[at]), readings[at].tolist())
                at += 1

    def _add_reading(self, stamp: int, reading: Sequence[float]) -> None:
        stamps = self._stamps
        if stamps and not 0 < stamp - stamps[-1] < _SHORTEST:
            stamps = self._begin()
        stamps.append(stamp)
        self._readings.append(reading)
        if len(stamps) >= _FEWEST and stamp - stamps[0] >= _SHORTEST:
            self._judge(np.array(stamps), np.array(self._readings))
            self._begin()

    def _begin(self) -> list[int]:
        self._stamps, self._readings = [], []
        return self._stamps

    def _judge(self, stamps: Stamps, readings: Array) -> None:
        first = int(stamps[0])
        times: Array = (stamps - first).astype(float) * NANOSECOND
        with np.errstate(all='ignore'):  # numbers that overflow are not judged
            off = _off(times)
            even, uneven = _evidence(times, readings)
        if off > LARGEST and even:
            self._row += 1
        elif off <= LARGEST or uneven:  # at rest readings show neither
            self._row, self.present = 0, None
        if self._row >= _PERSISTENT and self.present is None:
            step = 1e3 * times[-1] / (len(times) - 1)
            self.present = (
                f'stamps of arrival, in bursts? The readings are taken evenly, every {step:.3g} '
                f'ms, but their stamps are off by {1e3 * off:.3g} ms (RMS): stamp them where they '
                'are taken', first)
            self.found = self.found or self.present


def _off(times: Array) -> float:
    """Return the deviation of times (N,) from even ones, RMS, without a drift of the rate [s]."""
    return float(np.sqrt(_residuals(_even(times), times[:, None], 2)[0] / len(times)))


def _evidence(times: Array, readings: Array) -> tuple[bool, bool]:
    """Return whether a component of readings (N, n) was taken at even times, or at the stamps."""
    by_stamp, by_count = (_residuals(each, readings, _DEGREE) for each in (times, _even(times)))
    return bool(np.any(by_stamp > _CLEAR * by_count)), bool(np.any(by_count > _CLEAR * by_stamp))


def _even(times: Array) -> Array:
    return np.linspace(0.0, times[-1], len(times))


def _residuals(times: Array, values: Array, degree: int) -> Array:
    """Return the squared residuals (n,) of polynomials through values (N, n)."""
    basis, _ = np.linalg.qr(np.polynomial.legendre.legvander(
        2.0 * times / times[-1] - 1.0, degree))
    values = values - values.mean(axis=0)
    residuals: Array = np.sum((values - basis @ (basis.T @ values)) ** 2, axis=0)
    # A constant, or a number below its rounding error, is no evidence.
    residuals[residuals <= _ROUNDING * np.sum(values ** 2, axis=0)] = 0.0
    return residuals
