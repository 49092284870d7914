# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Amplitude spectral densities of channels up to the Nyquist rate, in bounded memory.

By Welch's method (The use of fast Fourier transform for the estimation of power spectra, IEEE
Trans. Audio Electroacoust. 15, 1967, doi:10.1109/TAU.1967.1161901): segments that overlap by half,
the mean of each removed, Hann windows, the mean of their power spectra. A short bag needs short
segments: their length is the greatest power of two of which there are enough. Samples wait for
this in a file.

``scipy.signal.welch`` gives the same numbers (see the tests) for samples that are all in memory.
Its import takes longer than the spectra of a million samples, and only
--differentiate requires SciPy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
import math
import os
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.reporting.block_statistics import FIRST, longest_step

# Samples in a segment.
SHORTEST, LONGEST = 2 ** 6, 2 ** 15
# Number of segments that make a spectrum; one of the shortest is enough.
ENOUGH = 4
# A step in time that differs by less than this part from a multiple of the usual one is even.
_EVEN = 0.01
# Rows of the file that are read at once.
_ROWS = 2 ** 15
# Intervals on the logarithmic axis of which the lowest and the highest line are drawn.
INTERVALS = 600


class Density(NamedTuple):
    """Amplitude spectral densities of C channels."""

    frequencies: Array  # above zero, up to the Nyquist rate (F,) [Hz]
    amplitudes: Array  # (C, F), in the unit of the channel per sqrt(Hz)
    segments: int  # how many there are the mean of
    seconds: float  # length of a segment [s]
    uneven: float
    """Part of the steps in time that were not even: values were interpolated linearly."""


class Spectrum:
    """
    The spectra of several channels that share their samples.

    The result does not depend on how the samples are split into blocks, apart from rounding.
    Samples at even times are taken as they are; between others, and where single ones are
    missing, values are interpolated linearly. A gap, a jump back in time or a value that is not
    finite ends a segment early, and it is left out.

    timeout: a step in time up to this long is never a gap [s].
    folder: contains the file of the samples, which has no name there.
    """

    def __init__(self, channels: int, timeout: float, folder: Path | None = None) -> None:
        self._timeout = timeout
        self._columns = 1 + channels
        self._file = TemporaryFile(dir=folder)

    def add(self, seconds: Array, values: Array) -> None:
        """
        Add samples.

        seconds (N,): times, never decreasing; the same time again where time has jumped back [s].
        """
        self._file.seek(0, os.SEEK_END)
        self._file.write(np.column_stack((seconds, values.T)).tobytes())

    def density(self) -> Density | None:
        """Return the spectra so far; None if there are too few samples."""
        steps = np.diff(next(self._blocks(), np.zeros((1, 1)))[1:FIRST + 1, 0])
        if not np.any(steps > 0.0):
            return None
        usual = float(np.median(steps[steps > 0.0]))
        longest = longest_step(steps, self._timeout)
        runs: list[int] = []  # their numbers of samples
        for begins, samples in (counted := _Runs(self._blocks(), usual, longest)):
            runs += [0] * begins
            runs[-1] += len(samples)
        length = _length_for(runs)
        if not length:
            return None
        window: Array = 0.5 - 0.5 * np.cos(2.0 * np.pi / length * np.arange(length))
        powers = np.zeros((self._columns - 1, length // 2 + 1))
        for segment in _segments(_Runs(self._blocks(), usual, longest), length):
            for channel, power in zip(np.array(segment.T), powers, strict=True):
                spectrum = np.fft.rfft((channel - channel.mean()) * window)
                power += spectrum.real ** 2 + spectrum.imag ** 2
        segments = _count(runs, length)
        # of both signs of the frequency, except at the Nyquist rate
        density: Array = 2.0 * usual / (segments * np.sum(window ** 2)) * powers[:, 1:]
        density[:, -1] *= 0.5
        return Density(
            np.arange(1, length // 2 + 1) / (length * usual), np.sqrt(density), segments,
            length * usual, counted.uneven / max(counted.steps, 1))

    def _blocks(self) -> Iterator[Array]:
        """Yield rows of time and values, each block behind the last row of the one before."""
        self._file.seek(0)
        last = np.full((1, self._columns), np.nan)
        while block := self._file.read(_ROWS * last.nbytes):
            rows = np.concatenate((last, np.frombuffer(block).reshape(-1, self._columns)))
            last = rows[-1:]
            yield rows


class _Runs:
    """
    Yields the runs of samples without a gap, in pieces: whether a run begins, samples (K, C).

    The samples are at even times, ``usual`` apart; a step longer than ``longest`` is a gap.
    """

    def __init__(self, blocks: Iterator[Array], usual: float, longest: float) -> None:
        self._blocks, self._usual, self._longest = blocks, usual, longest
        self.steps = self.uneven = 0
        """Numbers of steps in time that are no gaps, and of those that were not even."""

    def __iter__(self) -> Iterator[tuple[bool, Array]]:
        """Yield them."""
        place, following = 0.0, 0  # of the last sample, in units of the usual step; the next whole
        for rows in self._blocks:
            steps = np.diff(rows[:, 0])
            finite: Flags = np.all(np.isfinite(rows), axis=1)
            is_step = (steps > 0.0) & (steps <= self._longest)
            steps /= self._usual
            multiples = np.maximum(np.round(steps), 1.0)
            even = np.abs(steps - multiples) <= _EVEN
            steps[even] = multiples[even]
            self.steps += np.count_nonzero(is_step)
            self.uneven += np.count_nonzero(is_step & ~even)
            breaks = np.flatnonzero(~(is_step & finite[:-1] & finite[1:])).tolist()
            # First the run that the row in front belongs to.
            for begin, end in pairwise([-1, *breaks, len(steps)]):
                if not finite[begin + 1] or (begin < 0 and not end):
                    continue
                places = np.cumsum(np.append(place if begin < 0 else 0.0, steps[begin + 1:end]))
                whole = np.arange(following if begin < 0 else 0, math.floor(places[-1]) + 1)
                place, following = places[-1], whole[-1] + 1 if len(whole) else following
                values = rows[begin + 1:end + 1, 1:]
                if len(whole) and np.array_equal(places[-len(whole):], whole):
                    yield begin >= 0, values[-len(whole):]
                else:
                    yield begin >= 0, np.column_stack(
                        [np.interp(whole, places, column) for column in values.T])


def _segments(runs: Iterable[tuple[bool, Array]], length: int) -> Iterator[Array]:
    """Yield the segments (length, C) of runs in pieces; they overlap by half."""
    waiting: Array = np.empty((0, 0))
    for begins, samples in runs:
        waiting = samples if begins else np.concatenate((waiting, samples))
        while len(waiting) >= length:
            yield waiting[:length]
            waiting = waiting[length // 2:]


def _count(runs: Iterable[int], length: int) -> int:
    """Return the number of segments of a length in runs of these numbers of samples."""
    return sum(max((samples - length) // (length // 2) + 1, 0) for samples in runs)


def _length_for(runs: Sequence[int]) -> int:
    """Return the length of segments for runs of these numbers of samples; 0: too few."""
    length = LONGEST
    while length > SHORTEST and _count(runs, length) < ENOUGH:
        length //= 2
    return length if _count(runs, length) else 0


def drawn(frequencies: Array, amplitudes: Array) -> tuple[Array, Array]:
    """
    Return points of a line: of each interval of a logarithmic axis the lowest and the highest.

    frequencies, amplitudes (F,): spectrum of one channel; the frequencies increase and are above
        zero.
    """
    if not len(frequencies):
        return frequencies, amplitudes
    reach = np.log(frequencies / frequencies[0])
    interval = np.floor(reach / max(reach[-1], 1e-300) * (INTERVALS - 1))
    begins = np.flatnonzero(np.diff(interval, prepend=-1.0))
    order = np.lexsort((amplitudes, interval))
    ends = np.append(begins[1:], len(interval))
    kept: Flags = np.zeros(len(frequencies), dtype=bool)
    kept[order[begins]] = kept[order[ends - 1]] = True
    return frequencies[kept], amplitudes[kept]
