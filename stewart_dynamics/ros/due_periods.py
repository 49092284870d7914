# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Periods of a fixed rate that are due by a clock, and their stamps."""

from __future__ import annotations

from collections.abc import Callable
import math
import time

from stewart_dynamics.arrays import SECOND

BACKLOG = 100_000_000  # longest time that is caught up at once [ns]


class DuePeriods:
    """
    The periods that are due: several where the program is late.

    Where more time has passed than is caught up, and where the clock jumps back, the periods go on
    from there: stamps with the clock, the motion where it was.

    rate: periods per second.
    notice: called with the text where time is skipped.
    stamp: the first one, until ``begin`` [ns].
    now: the clock [ns]; by default a steady one.
    """

    def __init__(self, rate: float, notice: Callable[[str], None], stamp: int = 0,
                 now: Callable[[], int] = time.monotonic_ns) -> None:
        self._rate, self._notice, self._stamp, self._now = rate, notice, stamp, now
        self._begin: int | None = None  # by the clock [ns]

    @property
    def begun(self) -> bool:
        """Whether the periods have begun."""
        return self._begin is not None

    def begin(self, stamp: int) -> None:
        """Begin now, at a stamp [ns]."""
        self._begin, self._stamp = self._now(), stamp

    def time_of(self, index: int) -> int:
        """Return the time of a period since the begin [ns]; rounding does not add up."""
        return round(index * SECOND / self._rate)

    def stamp_of(self, index: int) -> int:
        """Return the stamp of a period [ns]."""
        return self._stamp + self.time_of(index)

    def until(self, index: int) -> int:
        """Return the time until a period is due [ns]; negative where it is late."""
        assert self._begin is not None
        return self.time_of(index) - (self._now() - self._begin)

    def due(self, first: int, backlog: int = BACKLOG, back: float = math.inf,
            words: str = 'fell behind by {:.3f} s: that time is skipped') -> range:
        """
        Return the indices of the periods from the first on that are due; none before begin.

        backlog, back: longest time that is caught up, and that is waited for [ns].
        words: of the notice, with a place for the time [s].
        """
        if self._begin is None:
            return range(first, first)
        late = -self.until(first)
        if late > backlog or late < -back:
            self._begin += late
            self._stamp += late
            self._notice(words.format(late / SECOND))
            late = 0
        now, end = self.time_of(first) + late, first
        while self.time_of(end) <= now:
            end += 1
        return range(first, end)
