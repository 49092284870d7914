# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Windows of uniform samples from recorded legs, without gaps and outliers.

Positions and efforts may have different stamps and sampling rates. Values are interpolated by
cubics through four samples if the samples are at most ``GAP`` periods apart; a longer gap, or a
jump of the stamps, ends a segment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, SECOND, Stamps
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN

# Minimum number of samples of a window.
FEWEST = 8
# A longer time between two samples, in periods, is a gap.
GAP = 4.0
# A sample is an outlier if it deviates from the cubic through its neighbours by more than this
# number of standard deviations, and by half as many from the median of five samples.
_OUTLIER = 12.0
# Efforts jump when a leg reverses; smaller relative deviations are not outliers.
_OF_EFFORTS = 2e-3
# Longest run of samples that is replaced; a longer one is a step, not an outlier.
_LONGEST = 3


class Signal(NamedTuple):
    """Recorded samples with their stamps [ns], strictly increasing."""

    stamps: Stamps
    values: Array

    def between(self, begin: int, end: int) -> Signal:
        """Return the samples between two stamps, both included."""
        first, last = np.searchsorted(self.stamps, (begin, end + 1))
        return self.part(slice(first, last))

    def part(self, which: slice) -> Signal:
        """Return some of the samples."""
        return Signal(self.stamps[which], self.values[which])


class Window(NamedTuple):
    """Uniform samples of all legs."""

    begin: int  # stamp of the first sample [ns]
    period: float  # sampling period [s]
    positions: Array  # (N, 6) [m]
    rates: Array | None  # (N, 6) [m/s]
    efforts: Array  # (N, 6) as recorded
    outliers: Flags  # (N, 6): an effort or a position of the leg was replaced

    def with_lag(self, lag: int) -> Window:
        """Return the window with efforts taken ``lag`` samples later."""
        count, before, after = len(self.positions), max(-lag, 0), max(lag, 0)
        return self.part(slice(before, count - after), slice(after, count - before))

    def part(self, of_legs: slice, of_efforts: slice) -> Window:
        """Return positions and rates of some samples, and as many efforts."""
        return self._replace(
            begin=self.begin + round(of_legs.start * self.period * SECOND),
            positions=self.positions[of_legs], efforts=self.efforts[of_efforts],
            rates=None if self.rates is None else self.rates[of_legs],
            outliers=self.outliers[of_legs] | self.outliers[of_efforts])


def period_of(stamps: Stamps) -> float:
    """Return the median time between samples [s]."""
    return float(np.median(np.diff(stamps))) * NANOSECOND


def segments(stamps: Stamps, period: float) -> list[slice]:
    """Return the parts between gaps."""
    steps = np.diff(stamps) * NANOSECOND
    breaks = np.flatnonzero((steps > GAP * period) | (steps <= 0.0)) + 1
    edges = [0, *breaks.tolist(), len(stamps)]
    return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def uniform(legs: Signal, efforts: Signal, period: float) -> Window | None:
    """
    Return a window of samples with a period [s], without gaps; None if there are too few.

    ``legs`` are positions (N, 6), or (N, 12) with rates; ``efforts`` (M, 6) have stamps of their
    own.
    """
    if len(legs.stamps) < FEWEST or len(efforts.stamps) < FEWEST:
        return None
    begin = max(int(legs.stamps[0]), int(efforts.stamps[0]))
    end = min(int(legs.stamps[-1]), int(efforts.stamps[-1]))
    count = int((end - begin) * NANOSECOND / period + 1e-6) + 1
    if count < FEWEST:
        return None
    at = period * np.arange(count, dtype=float)
    positions, replaced = _without_outliers(legs.values[:, :6], 0.0)
    pushes, replaced_too = _without_outliers(efforts.values, _OF_EFFORTS)
    of_legs, of_efforts = (NANOSECOND * (each.stamps - begin).astype(float)
                           for each in (legs, efforts))
    outliers = _near(of_legs, replaced, at, period) | _near(of_efforts, replaced_too, at, period)
    # Samples within a gap of the efforts are not fitted.
    after = np.clip(np.searchsorted(of_efforts, at), 1, len(of_efforts) - 1)
    outliers |= (of_efforts[after] - of_efforts[after - 1] > GAP * max(
        period, period_of(efforts.stamps)))[:, None]
    return Window(
        begin, period, interpolated(of_legs, positions, at),
        interpolated(of_legs, legs.values[:, 6:], at) if legs.values.shape[1] > 6 else None,
        interpolated(of_efforts, pushes, at), outliers)


def interpolated(times: Array, values: Array, at: Array) -> Array:
    """Return values (N, k) at times ``at``, interpolated by cubics through four samples."""
    nearest = np.clip(np.searchsorted(times, at), 0, len(times) - 1)
    if len(at) == len(times) and np.abs(times - at).max() < 1e-7:
        return values
    first = np.clip(nearest - 2, 0, len(times) - 4)
    result = np.zeros((len(at), values.shape[1]))
    knots = [times[first + n] for n in range(4)]
    for n in range(4):
        weight = np.ones(len(at))
        for m in range(4):
            if m != n:
                weight *= (at - knots[m]) / (knots[n] - knots[m])
        result += weight[:, None] * values[first + n]
    return result


def _without_outliers(values: Array, floor: float) -> tuple[Array, Flags]:
    """
    Return values (N, k) with single outliers replaced by their neighbours, and their flags.

    ``floor`` is the smallest deviation of an outlier relative to the standard deviation of the
    values, for signals with jumps.
    """
    five = np.stack([np.roll(values, shift, axis=0) for shift in range(-2, 3)])
    off = np.abs(values - (4.0 * (five[1] + five[3]) - five[0] - five[4]) / 6.0)
    usual = (BY_MEDIAN * np.median(off, axis=0) + floor * np.std(values, axis=0)
             + 1e-9 * np.abs(values).max(axis=0))
    wild = (off > _OUTLIER * usual) & (
        np.abs(values - np.median(five, axis=0)) > 0.5 * _OUTLIER * usual) & (
        np.abs(five[1] - five[3]) < off)  # not a step, such as friction at a reversal
    # and its four neighbours deviate less
    wild &= off >= np.stack([np.roll(off, shift, axis=0) for shift in (-2, -1, 1, 2)]).max(axis=0)
    wild[:2] = wild[-2:] = False
    if not wild.any():
        return values, wild
    clean = values.copy()
    for column in np.flatnonzero(wild.any(axis=0)):
        bad = wild[:, column]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], bad, [0]])))
        for begin, end in edges.reshape(-1, 2):
            if end - begin > _LONGEST:
                bad[begin:end] = False
        clean[bad, column] = np.interp(
            np.flatnonzero(bad), np.flatnonzero(~bad), values[~bad, column])
    return clean, wild


def _near(times: Array, marked: Flags, at: Array, period: float) -> Flags:
    """Return flags (N, 6) of the uniform samples next to a marked one."""
    near = np.zeros((len(at), marked.shape[1]), dtype=bool)
    rows, columns = np.nonzero(marked)
    index = np.clip(np.round(times[rows] / period).astype(int), 0, len(at) - 1)
    near[index, columns] = True
    return near
