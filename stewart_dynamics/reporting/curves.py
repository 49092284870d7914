# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Curves for plots: the lowest and the highest sample of each bucket, of a limited number of buckets.

Buckets contain equally many samples. When all are full, neighbors are merged and the next buckets
contain twice as many, so a bag of any length is drawn with about the same number of points, and
each peak is one of them, at its true time. With up to two samples in a bucket, every sample is
drawn. Figures in tables are not computed from curves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.reporting.block_statistics import FIRST, longest_step

# About the width of a plot in pixels. Even, since neighbors are merged.
BUCKETS = 1024

# A gap breaks the line; only the longest gaps, up to this number, do.
_MOST_BREAKS = 1000

# Shortest interval between frames [s]; a power of two, so that doubled intervals are exact.
_FINEST = 2.0 ** -20


class Curves:
    """
    The curves of several channels that share their samples.

    The result does not depend on how the samples are split into blocks.

    timeout: a step in time up to this long never breaks a line [s].
    buckets: the largest number of buckets, even.
    """

    def __init__(self, timeout: float, buckets: int = BUCKETS) -> None:
        self.channels = 0  # until there are samples
        self.samples = 0
        self.samples_in_bucket = 1
        self._timeout, self._buckets = timeout, buckets
        self._first_steps: Array = np.empty(0)
        self._breaks: Array = np.empty((0, 2))
        # the very first and the last sample
        self._end_times = [0.0, 0.0]
        self._ends: list[Array] = [np.empty(0), np.empty(0)]

    def add(self, seconds: Array, values: Array) -> None:
        """
        Add samples.

        seconds (N,): times, never decreasing [s].
        values (C, N): values of every channel; values that are not finite break the line.
        """
        if not len(seconds):
            return
        self._add_steps(seconds)
        if not self.samples:
            self._begin(len(values))
            self._end_times[0], self._ends[0] = float(seconds[0]), values[:, 0].copy()
        self._end_times[1], self._ends[1] = float(seconds[-1]), values[:, -1].copy()
        missing = ~np.isfinite(values)
        spoiled = bool(missing.any())
        at, buckets = 0, self._buckets
        while at < len(seconds):
            if self.samples == buckets * self.samples_in_bucket:
                self._merge()
            size = self.samples_in_bucket
            bucket, filled = divmod(self.samples, size)
            # the rest of a started bucket, or whole buckets, or the remaining samples
            count, each = 1, min(size - filled, len(seconds) - at)
            if not filled and each == size:
                count = min(buckets - bucket, (len(seconds) - at) // size)
            end = at + count * each
            self._fold(slice(bucket, bucket + count), seconds[at:end], values[:, at:end],
                       missing[:, at:end] if spoiled else None)
            self.samples += end - at
            at = end

    def drawn(self, channel: int) -> tuple[Array, Array]:
        """Return times [s], never decreasing, and values of the line; nan breaks it."""
        if not self.samples:
            return np.empty(0), np.empty(0)
        used = slice(0, -(-self.samples // self.samples_in_bucket))
        lowest, highest = self._lowest[channel, used], self._highest[channel, used]
        times = np.stack([self._lowest_at[channel, used], self._highest_at[channel, used],
                          self._missing_at[channel, used]], axis=1)
        values = np.stack([lowest, highest, np.full(len(lowest), np.nan)], axis=1)
        is_there = np.isfinite(times)
        is_there[:, 1] &= lowest != highest
        order = np.argsort(np.where(is_there, times, np.inf), axis=1, kind='stable')
        is_there = np.take_along_axis(is_there, order, axis=1)
        times = np.take_along_axis(times, order, axis=1)[is_there]
        values = np.take_along_axis(values, order, axis=1)[is_there]
        times, values = self._with_ends(channel, times, values)
        breaks = self.breaks()[:, 0]
        at = np.searchsorted(times, breaks, side='right')
        return np.insert(times, at, breaks), np.insert(values, at, np.nan)

    def breaks(self) -> Array:
        """Return (B, 2) [s]: begin and end of the gaps that break the line."""
        longest = longest_step(self._first_steps, self._timeout)
        return self._breaks[self._breaks[:, 1] - self._breaks[:, 0] > longest]

    def _with_ends(self, channel: int, times: Array, values: Array) -> tuple[Array, Array]:
        """Return the points with the very first and last sample among them."""
        first, last = (float(end[channel]) for end in self._ends)
        if np.isfinite(first) and times[0] > self._end_times[0]:
            times, values = (np.insert(times, 0, self._end_times[0]), np.insert(values, 0, first))
        if np.isfinite(last) and times[-1] < self._end_times[1]:
            times, values = np.append(times, self._end_times[1]), np.append(values, last)
        return times, values

    def _begin(self, channels: int) -> None:
        self.channels = channels
        shape = channels, self._buckets
        self._lowest, self._highest = np.full(shape, np.inf), np.full(shape, -np.inf)
        # times [s]; the last: of the first missing value in a bucket, inf if no value is missing
        self._lowest_at, self._highest_at, self._missing_at = (
            np.full(shape, np.inf) for _ in range(3))

    def _fold(self, buckets: slice, seconds: Array, values: Array,
              missing: Flags | None) -> None:
        """Add samples to these buckets, equally many to each."""
        shape = (len(values), buckets.stop - buckets.start, -1)
        times = seconds.reshape(shape[1:])
        each = np.arange(shape[1])
        for extreme, when, find, none, less in (
                (self._lowest, self._lowest_at, np.argmin, np.inf, np.less),
                (self._highest, self._highest_at, np.argmax, -np.inf, np.greater)):
            known = values if missing is None else np.where(missing, none, values)
            known = known.reshape(shape)
            found = find(known, axis=2)
            value = np.take_along_axis(known, found[:, :, None], axis=2)[:, :, 0]
            better = less(value, extreme[:, buckets])
            extreme[:, buckets][better] = value[better]
            when[:, buckets][better] = times[each, found][better]
        if missing is not None:
            lost = missing.reshape(shape)
            begun = np.where(lost.any(axis=2), times[each, lost.argmax(axis=2)], np.inf)
            np.minimum(self._missing_at[:, buckets], begun, out=self._missing_at[:, buckets])

    def _merge(self) -> None:
        """Merge neighbors; of two equal extremes the first is kept."""
        half = self._buckets // 2
        for extreme, when, none, less in (
                (self._lowest, self._lowest_at, np.inf, np.less),
                (self._highest, self._highest_at, -np.inf, np.greater)):
            second = less(extreme[:, 1::2], extreme[:, ::2])
            extreme[:, :half] = np.where(second, extreme[:, 1::2], extreme[:, ::2])
            when[:, :half] = np.where(second, when[:, 1::2], when[:, ::2])
            extreme[:, half:] = none
            when[:, half:] = np.inf
        self._missing_at[:, :half] = np.minimum(
            self._missing_at[:, ::2], self._missing_at[:, 1::2])
        self._missing_at[:, half:] = np.inf
        self.samples_in_bucket *= 2

    def _add_steps(self, seconds: Array) -> None:
        """Keep the first steps in time, and the longest."""
        if self.samples:
            seconds = np.concatenate([[self._end_times[1]], seconds])
        steps = np.diff(seconds)
        wanted = FIRST - 1 - len(self._first_steps)
        if wanted:
            self._first_steps = np.concatenate([self._first_steps, steps[:wanted]])
        at = np.flatnonzero(steps > self._timeout)
        if not len(at):
            return
        breaks = np.concatenate([
            self._breaks, np.stack([seconds[at], seconds[at + 1]], axis=1)])
        longest = np.argsort(breaks[:, 0] - breaks[:, 1], kind='stable')[:_MOST_BREAKS]
        self._breaks = breaks[np.sort(longest)]


class Frames:
    """
    Unchanged samples, one of each of equally long intervals, limited in number.

    When there are too many, the intervals are doubled. The result does not depend on how the
    samples are split into blocks, and contains every sample while there are few.

    numbers: number of values of a sample.
    most: the largest number of frames, in addition to the last sample.
    """

    def __init__(self, numbers: int, most: int = 1024) -> None:
        self._most = most
        self._piece = _FINEST
        self._times: Array = np.empty(0)
        self._values: Array = np.empty((0, numbers))
        self._last_time: Array = np.empty(0)
        self._last_values: Array = np.empty((0, numbers))

    def add(self, seconds: Array, values: Array) -> None:
        """Add samples (N, numbers) at seconds (N,), never decreasing [s]."""
        if not len(seconds):
            return
        kept = self._first_of_pieces(seconds)
        if len(self._times) and (np.floor(seconds[0] / self._piece)
                                 == np.floor(self._times[-1] / self._piece)):
            kept = kept[1:]
        self._times = np.concatenate([self._times, seconds[kept]])
        self._values = np.concatenate([self._values, values[kept]])
        self._last_time, self._last_values = seconds[-1:].copy(), values[-1:].copy()
        while len(self._times) > self._most:
            self._piece *= 2.0
            kept = self._first_of_pieces(self._times)
            self._times, self._values = self._times[kept], self._values[kept]

    def chosen(self) -> tuple[Array, Array]:
        """Return times (F,) [s] and samples (F, numbers), with the first and the last."""
        if not len(self._times) or self._times[-1] == self._last_time[0]:
            return self._times, self._values
        return (np.concatenate([self._times, self._last_time]),
                np.concatenate([self._values, self._last_values]))

    def _first_of_pieces(self, seconds: Array) -> NDArray[np.intp]:
        pieces = np.floor(seconds / self._piece)
        return np.flatnonzero(np.concatenate([[True], pieces[1:] != pieces[:-1]]))
