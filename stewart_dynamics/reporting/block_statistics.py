# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Extremes, integrals, crossings and warnings of samples that are given block by block.

Apart from rounding, the results do not depend on how the samples are split into blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Annotated

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.records import means, Number, Record

# Maximum number of crossings and of warnings that are listed; all are counted.
LISTED = 100
# A step longer than this number of usual steps (and than setpoint.timeout) is a gap; the usual is
# the median of the steps between the first setpoints, FIRST of them.
_GAP = 10.0
FIRST = 1000


def longest_step(first: Array, timeout: float) -> float:
    """Return the longest step that is not a gap [s], from those of the first FIRST setpoints."""
    forward = first[first > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    return float(max(timeout, _GAP * usual))


class Extreme:
    """
    Greatest value of each column by a measure, and the time when it first occurs.

    Values that are nan, or whose measure is -inf, are left out.
    """

    def __init__(self, width: int, measure: Callable[[Array], Array]) -> None:
        self._measure = measure
        self._columns = np.arange(width)
        self._measured: Array = np.full(width, -np.inf)
        self.values: Array = np.full(width, np.nan)
        self.at: Array = np.full(width, np.nan)

    def add(self, seconds: Array, values: Array) -> None:
        """Add values (N, width) at times (N,) [s]."""
        measured = self._measure(values)
        unknown = np.isnan(measured)
        if unknown.any():
            measured = np.where(unknown, -np.inf, measured)
        row = measured.argmax(axis=0)
        greatest = measured[row, self._columns]
        new = greatest > self._measured
        self._measured = np.where(new, greatest, self._measured)
        self.values = np.where(new, values[row, self._columns], self.values)
        self.at = np.where(new, seconds[row], self.at)

    def of_column(self, column: int = 0) -> tuple[float | None, float | None]:
        """Return value and time of a column; None: not known."""
        return finite(self.values[column]), finite(self.at[column])


class ExceededLimit(Record):
    """A limit that a leg exceeds by more than 1e-9 of it."""

    limit: Annotated[str, means(
        'name of the parameter: one of `limits.*`, `drive.torque_max`, `drive.torque_speed`, '
        '`drive.speed_max` or `drive.temperature_rise_max`')]
    leg: Annotated[str, means('name of the leg')]
    setpoints: Annotated[int, means('number of setpoints at which it is exceeded')]
    worst: Annotated[Number, means(
        "value with the largest excess, with its sign, in the limit's unit")]
    bound: Annotated[float, means(
        'the limit; of `drive.torque_speed` at the speed of the worst value')]
    first_at_s: Annotated[float, means('when it is first exceeded')]


class Exceeded:
    """
    Number of samples that exceed a limit, the first and the worst of them, of each leg.

    measure: of values, see ``Limit.measure``; by default their magnitudes.
    """

    def __init__(self, measure: Callable[[Array], Array] = np.abs) -> None:
        self._measure = measure
        self._samples = np.zeros(6, dtype=np.int64)
        self._excess: Array = np.full(6, -np.inf)
        self._first_at, self._worst, self._bounds = (np.full(6, np.nan) for _ in range(3))

    def add(self, seconds: Array, exceeding: Flags, values: Array, bounds: Array) -> None:
        """Add values (N, 6) at times (N,) [s], where they exceed, and bounds (N, 6) or (6,)."""
        if not exceeding.any():
            return
        new = exceeding.any(axis=0) & (self._samples == 0)
        self._first_at[new] = seconds[exceeding.argmax(axis=0)][new]
        self._samples += exceeding.sum(axis=0)
        excess = np.where(exceeding, self._measure(values) - self._measure(bounds), -np.inf)
        worst = excess.argmax(axis=0), np.arange(6)
        more = excess[worst] > self._excess
        for kept, found in ((self._excess, excess), (self._worst, values),
                            (self._bounds, np.broadcast_to(bounds, values.shape))):
            kept[more] = found[worst][more]

    def of_legs(self, limit: str, legs: Sequence[str]) -> list[ExceededLimit]:
        """Return the legs that exceed the limit."""
        return [ExceededLimit(limit, legs[leg], int(self._samples[leg]),
                              finite(self._worst[leg]), float(self._bounds[leg]),
                              float(self._first_at[leg]))
                for leg in np.flatnonzero(self._samples)]


class Integral:
    """
    Integral of each column over time by trapezoids, and its mean.

    Rows with a nan are left out, with the steps to and from them.
    """

    def __init__(self, width: int) -> None:
        self.values = np.zeros(width)
        self._time = 0.0
        self._sum = np.zeros(width)
        self._samples = 0
        self._last = np.zeros(width)
        self._last_known = False

    def add(self, steps: Array, values: Array) -> None:
        """Add values (N, width), and the times from each sample's predecessor to it (N,) [s]."""
        known = ~with_nan(values)
        if not known.all():
            values = np.where(known[:, None], values, 0.0)
        weight = 0.5 * steps * known * np.concatenate(([self._last_known], known[:-1]))
        self.values += (weight @ values + weight[1:] @ values[:-1] + weight[0] * self._last)
        self._time += 2.0 * float(weight.sum())
        self._sum += known.astype(float) @ values
        self._samples += int(known.sum())
        self._last, self._last_known = values[-1].copy(), bool(known[-1])

    @property
    def mean(self) -> Array:
        """Mean over time, or over the samples if no time has passed; nan without samples."""
        if self._time > 0.0:
            return self.values / self._time
        return self._sum / self._samples if self._samples else np.full_like(self._sum, np.nan)


class Crossings:
    """
    When det(J) changes its sign, also through a zero.

    Times are interpolated between two samples. A change of sign across a restart is not a
    crossing.
    """

    def __init__(self) -> None:
        self.count = 0
        self.first: list[float] = []
        # the last sample that is not zero, and the one after it
        self._seconds: Array = np.empty(0)
        self._determinants: Array = np.empty(0)

    def add(self, seconds: Array, determinants: Array, restarts: Flags) -> None:
        """Add samples (N,); ``restarts``: time has jumped back before the sample."""
        carried = len(self._seconds)
        time = np.concatenate((self._seconds, seconds))
        det = np.concatenate((self._determinants, determinants))
        run = np.concatenate((np.zeros(carried, dtype=int), np.cumsum(restarts)))
        apart = np.flatnonzero(det)
        before, after = apart[:-1], apart[1:]
        crossed = (det[before] > 0.0) != (det[after] > 0.0)
        before = before[crossed & (run[before] == run[after])]
        self.count += len(before)
        before = before[:LISTED - len(self.first)]
        share = det[before] / (det[before] - det[before + 1])
        self.first += (time[before] + share * (time[before + 1] - time[before])).tolist()
        keep = slice(0, 0)
        if len(apart) and run[apart[-1]] == run[-1]:
            keep = slice(int(apart[-1]), int(apart[-1]) + 2)
        self._seconds, self._determinants = time[keep], det[keep]


class Warnings:
    """Intervals in which a warning was on."""

    def __init__(self) -> None:
        self.count = 0
        self.first: list[tuple[float, float | None]] = []
        self.seconds = 0.0
        self._on = False

    def add(self, seconds: Array, steps: Array, warnings: Flags) -> None:
        """Add samples (N,), and the times from each one's predecessor to it [s]."""
        before = np.concatenate(([self._on], warnings[:-1]))
        self.seconds += float(steps @ before)
        changes = np.flatnonzero(warnings != before)
        self.count += int(warnings[changes].sum())
        for at in changes[:2 * LISTED].tolist():
            if warnings[at] and len(self.first) < LISTED:
                self.first.append((float(seconds[at]), None))
            elif not warnings[at] and self.first[-1][1] is None:
                self.first[-1] = self.first[-1][0], float(seconds[at])
        self._on = bool(warnings[-1])


def finite(value: float | None) -> float | None:
    """Return a number, None if it is not known or not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def with_nan(values: Array) -> Flags:
    """Return which rows have a nan in them."""
    unknown = np.isnan(values)
    rows: Flags = np.zeros(len(values), dtype=bool)
    if unknown.any():  # rare; a check row by row takes ten times as long
        np.any(unknown, axis=1, out=rows)
    return rows
