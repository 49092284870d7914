# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Samples of two sources, commanded and achieved, brought to the same even times.

By cubic splines through the samples of each; where a source has a long gap, a run of samples ends.
Achieved samples in a short gap, as of a tracker that loses its target, are marked as lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, SECOND, Stamps
from stewart_dynamics.errors import StewartError
from stewart_dynamics.reporting.block_statistics import longest_step

# Highest frequency, relative to the rate of samples between which a spline interpolates, and to
# that of samples at the times of the setpoints.
_INTERPOLATED, _SAMPLED = 0.2, 0.45
# Difference of two times that are the same, relative to a step.
_SAME_TIME = 0.01
# Achieved samples were lost in a step longer than this number of usual ones; longest
# gap within a run [s].
_LOST, _LONGEST_GAP = 2.5, 2.0
# Samples without any change from which on a source is frozen, if the setpoints move by more than
# this part of their range; where most samples are, the platform is at rest.
_FROZEN, _MOVED, _MOST = 3, 1e-3, 0.5
# Shortest run [samples].
SHORTEST = 64
# Difference between the clocks of two sources from which on it is noticed [s].
_CLOCKS = 0.01
_EARLY = 1e-6  # shorter negative delays are rounding errors [s]


class Track(NamedTuple):
    """Samples of one source."""

    stamps: Stamps  # (N,) [ns], strictly increasing
    values: Array  # (N, K)
    late: float  # median time from the stamps to the recording [s]


class Tracks:
    """Collects the samples of one source, block by block."""

    def __init__(self, columns: int) -> None:
        self._stamps: list[Stamps] = [np.empty(0, dtype=np.int64)]
        self._values: list[Array] = [np.empty((0, columns))]
        self._times: list[Stamps] = [np.empty(0, dtype=np.int64)]
        self.left_out = 0  # samples that were not after those before them

    def add(self, stamps: Stamps, values: Array, times: Stamps) -> None:
        """Add samples (N, K) with their stamps and times of recording (N,) [ns]."""
        self._stamps.append(stamps)
        self._values.append(values.copy())
        self._times.append(times)

    def track(self) -> Track:
        """Return the samples; of those whose stamps do not increase, the first ones."""
        stamps, times = np.concatenate(self._stamps), np.concatenate(self._times)
        values = np.concatenate(self._values)
        newest = np.maximum.accumulate(stamps)
        rises = np.diff(newest, prepend=newest[:1] - 1) > 0
        self.left_out = int(np.count_nonzero(~rises))
        late = float(np.median(times - stamps)) * NANOSECOND if len(stamps) else 0.0
        return Track(stamps[rises], values[rises], late)


class Run(NamedTuple):
    """Commanded and achieved samples at even times, without a gap."""

    seconds: Array  # since the first setpoint (N,)
    commanded: Array  # (N, K)
    achieved: Array  # (N, K)
    lost: Flags  # (N,): no achieved sample is near


class Runs(NamedTuple):
    """All runs of a recording."""

    runs: list[Run]
    rate: float  # samples per second
    highest: float  # highest frequency that the samples show [Hz]


def at_even_times(commanded: Track, achieved: Track, timeout: float) -> Runs:
    """
    Return commanded and achieved samples at even times, where both are there.

    timeout: a step of the commanded samples up to this long is never a gap [s].
    """
    from scipy.interpolate import CubicSpline

    step = float(np.median(np.diff(commanded.stamps)))
    origin = int(commanded.stamps[0])
    times = [(each.stamps - origin) / step for each in (commanded, achieved)]
    segments = [_segments(each, longest * SECOND / step) for each, longest in
                zip(times, (timeout, max(timeout, _LONGEST_GAP)), strict=True)]
    steps = np.diff(times[1])
    usual = float(np.median(steps))
    runs = []
    for first in segments[0]:
        for second in segments[1]:
            begin = np.ceil(max(times[0][first.start], times[1][second.start]) - _SAME_TIME)
            end = np.floor(min(times[0][first.stop - 1], times[1][second.stop - 1]) + _SAME_TIME)
            if end - begin + 1 < SHORTEST:
                continue
            at = np.arange(begin, end + 1)
            n = np.searchsorted(times[1], at - _SAME_TIME, side='right').clip(1, len(steps)) - 1
            off = np.minimum(np.abs(at - times[1][n]), np.abs(at - times[1][n + 1]))
            lost = (steps[n] > _LOST * usual) & (off > _SAME_TIME)
            x, y = (CubicSpline(time[part], track.values[part])(at) for time, part, track in
                    zip(times, (first, second), (commanded, achieved), strict=True))
            runs.append(Run(at * step * NANOSECOND, x, y, lost))
    rate = SECOND / step
    other = SECOND / float(np.median(np.diff(achieved.stamps)))
    offsets = np.abs(times[1] - np.round(times[1]))
    same = float(np.median(offsets)) <= _SAME_TIME and other >= rate * (1.0 - _SAME_TIME)
    return Runs(runs, rate, _SAMPLED * rate if same else _INTERPOLATED * min(rate, other))


def without_frozen(achieved: Track, commanded: Track) -> tuple[Track, int]:
    """
    Return achieved samples without those that repeat while the setpoints move, and their number.

    A tracker that loses its target may repeat the last pose.
    """
    same = (achieved.values[1:] == achieved.values[:-1]).all(axis=1)
    edges = np.flatnonzero(np.diff(same, prepend=False, append=False)).reshape(-1, 2)
    frozen: Flags = np.zeros(len(achieved.stamps), dtype=bool)
    least = _MOVED * np.ptp(commanded.values, axis=0)
    for begin, end in edges[edges[:, 1] - edges[:, 0] >= _FROZEN].tolist():
        low, high = np.searchsorted(commanded.stamps, achieved.stamps[[begin, end]])
        part = commanded.values[low:high]
        frozen[begin + 1:end + 1] = len(part) > 1 and bool(
            (np.ptp(part, axis=0) > least).any())
    count = int(np.count_nonzero(frozen))
    if count > _MOST * len(frozen):
        return achieved, 0
    return (achieved._replace(stamps=achieved.stamps[~frozen], values=achieved.values[~frozen]),
            count)


def _segments(times: Array, timeout: float) -> list[slice]:
    """Return the parts of times without a gap, of more than three samples."""
    steps = np.diff(times)
    edges = [0, *(np.flatnonzero(steps > longest_step(steps, timeout)) + 1).tolist(), len(times)]
    return [slice(begin, end) for begin, end in zip(edges[:-1], edges[1:], strict=True)
            if end - begin > 3]


def clock_notices(commanded: Track, achieved: Track, name: str, delays: Sequence[float],
                  drift: float | None) -> list[str]:
    """Return notices about clocks that may differ."""
    notices = []
    off = achieved.late - commanded.late
    if abs(off) > _CLOCKS:
        notices.append(
            f'{name}: recorded {achieved.late * 1e3:.3g} ms after their stamps, setpoints '
            f'{commanded.late * 1e3:.3g} ms: if clocks differ by these {off * 1e3:.3g} ms, '
            'delays are wrong by them')
    if delays and min(delays) < -_EARLY:
        notices.append(f'{name}: {-1e3 * min(delays):.3g} ms earlier than the setpoints: the '
                       'clocks of their stamps differ, or setpoints are stamped late')
    if drift is not None:
        notices.append(f'{name}: the delay changes by {1e6 * drift:.3g} us in a second: the '
                       'clocks drift, delays are those of the middle of each part')
    return notices


def check_overlap(commanded: Track, achieved: Track, name: str) -> None:
    """Raise StewartError if commanded and achieved samples are not of the same time."""
    for track, what in ((commanded, 'setpoints'), (achieved, name)):
        if len(track.stamps) < SHORTEST:
            raise StewartError(f'response: {len(track.stamps)} samples of {what}: must be at '
                               f'least {SHORTEST}')
    begin, end = (np.array([track.stamps[at] for track in (commanded, achieved)]) * NANOSECOND
                  for at in (0, -1))
    if begin.max() >= end.min():
        late = achieved.late - commanded.late
        raise StewartError(
            f'response: stamps of {name} are from {begin[1]:.3f} to {end[1]:.3f} s, those of the '
            f'setpoints from {begin[0]:.3f} to {end[0]:.3f} s: they do not overlap; by the times '
            f'of recording, their clocks differ by {-late:.6g} s')
