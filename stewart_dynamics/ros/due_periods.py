# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Periods of a fixed rate that are due by a steady clock, and their stamps."""

from __future__ import annotations

from collections.abc import Callable
import time

from stewart_dynamics.arrays import SECOND

_BACKLOG = 100_000_000  # longest time that is caught up at once [ns]


class DuePeriods:
    """
    The periods that are due: several where the program is late.

    Periods that are later than 0.1 s are skipped: stamps go on with the clock, the motion where
    it was.

    rate: periods per second.
    stamp: the first one, until ``begin`` [ns].
    notice: called with the text where time is skipped.
    """

    def __init__(self, rate: float, notice: Callable[[str], None], stamp: int = 0) -> None:
        self._rate, self._notice, self._stamp = rate, notice, stamp
        self._begin: int | None = None  # by the steady clock [ns]

    @property
    def begun(self) -> bool:
        """Whether the periods have begun."""
        return self._begin is not None

    def begin(self, stamp: int) -> None:
        """Begin now, at a stamp [ns]."""
        self._begin, self._stamp = time.monotonic_ns(), stamp

    def time_of(self, index: int) -> int:
        """Return the time of a period since the begin [ns]; rounding does not add up."""
        return round(index * SECOND / self._rate)

    def stamp_of(self, index: int) -> int:
        """Return the stamp of a period [ns]."""
        return self._stamp + self.time_of(index)

    def until(self, index: int) -> int:
        """Return the time until a period is due [ns]; negative where it is late."""
        assert self._begin is not None
        return self.time_of(index) - (time.monotonic_ns() - self._begin)

    def due(self, first: int) -> range:
        """Return the indices of the periods from the first on that are due; none before begin."""
        if self._begin is None:
            return range(first, first)
        late = -self.until(first)
        if late > _BACKLOG:
            self._begin += late
            self._stamp += late
            self._notice(f'fell behind by {late / SECOND:.3f} s: that time is skipped')
            late = 0
        now, end = self.time_of(first) + late, first
        while self.time_of(end) <= now:
            end += 1
        return range(first, end)
