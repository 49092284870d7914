# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Intervals in which an external load acted on the platform, in a recording of any length."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array


class Contact(NamedTuple):
    """An interval in which an external load acted on the platform."""

    begin: float
    end: float
    axis: int
    excess: float
    """Largest distance from the median, as a multiple of the threshold."""
    load: tuple[float, ...]


class WrenchBins:
    """
    Extremes and one value of the six components of a wrench in a fixed number of time bins.

    When the time exceeds the last bin, pairs of bins are merged.
    """

    _NUMBER = 16384

    def __init__(self) -> None:
        self.width = 2.0 ** -10
        self._low = np.full((self._NUMBER, 6), np.inf)
        self._high = np.full((self._NUMBER, 6), -np.inf)
        self._one = np.zeros((self._NUMBER, 6))
        self._first = np.full(self._NUMBER, np.inf)
        self._last = np.full(self._NUMBER, -np.inf)

    def add(self, seconds: Array, values: Array) -> None:
        """Add wrenches (N, 6) at times (N,), never decreasing [s]."""
        while seconds[-1] >= self.width * self._NUMBER:
            self._widen()
        bins = (seconds / self.width).astype(np.int64)
        begins = np.flatnonzero(np.diff(bins, prepend=-1))
        at = bins[begins]
        self._low[at] = np.minimum(self._low[at], np.minimum.reduceat(values, begins))
        self._high[at] = np.maximum(self._high[at], np.maximum.reduceat(values, begins))
        new = ~np.isfinite(self._first[at])
        self._one[at[new]] = values[begins[new]]
        self._first[at[new]] = seconds[begins[new]]
        self._last[at] = seconds[np.append(begins[1:], len(seconds)) - 1]

    def _widen(self) -> None:
        half = self._NUMBER // 2
        filled = np.isfinite(self._first[0::2])
        self._one[:half] = np.where(filled[:, None], self._one[0::2], self._one[1::2])
        self._low[:half] = np.minimum(self._low[0::2], self._low[1::2])
        self._high[:half] = np.maximum(self._high[0::2], self._high[1::2])
        self._first[:half] = np.minimum(self._first[0::2], self._first[1::2])
        self._last[:half] = np.maximum(self._last[0::2], self._last[1::2])
        self._low[half:], self._first[half:] = np.inf, np.inf
        self._high[half:], self._last[half:] = -np.inf, -np.inf
        self.width *= 2.0

    def middle(self) -> tuple[Array, Array]:
        """Return the median, and the robust standard deviation about it."""
        one = self._one[np.isfinite(self._first)]
        if not len(one):
            return np.zeros(6), np.zeros(6)
        median = np.median(one, axis=0)
        return median, 1.4826 * np.median(np.abs(one - median), axis=0)

    def contacts(self, median: Array, threshold: Array, gap: float) -> list[Contact]:
        """Return the intervals with values above the threshold; shorter gaps are bridged."""
        filled = np.flatnonzero(np.isfinite(self._first))
        low, high = self._low[filled] - median, self._high[filled] - median
        far = np.where(-low > high, low, high)
        with np.errstate(divide='ignore', invalid='ignore'):
            excess = np.abs(far) / threshold
        hit = np.flatnonzero((excess > 1.0).any(axis=1))
        if not len(hit):
            return []
        begins, ends = self._first[filled[hit]], self._last[filled[hit]]
        apart = np.flatnonzero(begins[1:] - ends[:-1] > max(gap, 2.0 * self.width)) + 1
        found = []
        for part in np.split(np.arange(len(hit)), apart):
            inside = hit[part]
            most = np.argmax(np.abs(far[inside]), axis=0)
            peaks = far[inside][most, np.arange(6)]
            times = excess[inside].max(axis=0)
            axis = int(np.argmax(times))
            found.append(Contact(
                float(begins[part[0]]), float(ends[part[-1]]), axis, float(times[axis]),
                tuple(peaks.tolist())))
        return found
