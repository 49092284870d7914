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

"""
Amplitude spectral densities of channels up to the Nyquist rate, in bounded memory.

By Welch's method (The use of fast Fourier transform for the estimation of power spectra, IEEE
Trans. Audio Electroacoust. 15, 1967, doi:10.1109/TAU.1967.1161901): segments that overlap by half,
the mean of each removed, Hann windows, the mean of their power spectra.

The length of a bag is not known before its end, and a short one needs short segments. So the first
samples are kept: as many as make ENOUGH of the longest segments. At their end, or at the end of
the bag, the segments get the greatest length, a power of two, of which there are enough.

``scipy.signal.welch`` gives the same numbers (see the tests) for samples that are all in memory.
Its import takes longer than the spectra of a million samples, and only
--differentiate requires SciPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.reporting.block_statistics import FIRST, longest_step

# Samples in a segment.
SHORTEST, LONGEST = 2 ** 6, 2 ** 15
# Number of segments that make a spectrum; one of the shortest is enough.
ENOUGH = 4
_KEPT = (ENOUGH + 1) * LONGEST // 2
# A step in time that differs by less than this part from a multiple of the usual one is even.
_EVEN = 0.01
# Intervals on the logarithmic axis of which the lowest and the highest line are drawn.
INTERVALS = 600


class Density(NamedTuple):
    """Amplitude spectral densities of C channels."""

    frequencies: Array
    """Above zero, up to the Nyquist rate (F,) [Hz]."""
    amplitudes: Array
    """(C, F), in the unit of the channel per sqrt(Hz)."""
    segments: int
    """How many there are the mean of."""
    seconds: float
    """Length of a segment [s]."""
    uneven: float
    """Part of the steps in time that were not even: values were interpolated linearly."""


class Spectrum:
    """
    The spectra of several channels that share their samples.

    The result does not depend on how the samples are split into blocks, apart from rounding.
    Samples at even times are taken as they are; between others, and where single ones are
    missing, values are interpolated linearly. A gap, a jump back in time or a value that is not
    finite ends a segment early, and it is left out.

    Parameters
    ----------
    channels : int
        Number of channels.
    timeout : float
        A step in time up to this long is never a gap [s].

    """

    def __init__(self, channels: int, timeout: float) -> None:
        self._channels = channels
        self._timeout = timeout
        self._held: list[tuple[Array, Array]] = []
        self._usual = self._gap = 0.0
        self._time: float | None = None
        # of the last sample: its place among the even samples, and its values; None: it does not
        # go on from there
        self._last: tuple[float, Array] | None = None
        # even samples without a gap between them: those before, while they are kept, and the last
        self._runs: list[Array] = []
        self._run: Array = np.empty((channels, 0))
        self._length = 0  # not yet known
        self._segments = 0
        self._powers: Array = np.empty((channels, 0))
        self._steps = self._uneven = 0

    def add(self, seconds: Array, values: Array) -> None:
        """
        Add samples.

        Parameters
        ----------
        seconds : (N,)
            Times, never decreasing; the same time again where time has jumped back [s].
        values : (C, N)
            Values of every channel.

        """
        if not len(seconds):
            return
        if self._usual:
            self._add(seconds, values)
            return
        # until the usual step is known
        self._held.append((seconds, np.array(values)))
        if sum(len(each) for each, _ in self._held) >= FIRST:
            self._release()

    def density(self) -> Density | None:
        """Return the spectra so far; None if there are too few samples."""
        self._release()
        runs = [*self._runs, self._run]
        length = self._length or _length_for([each.shape[1] for each in runs])
        if not length:
            return None
        powers, segments = self._powers, self._segments
        if not self._length:
            powers = np.sum([_powers(each, length) for each in runs], axis=0)
            segments = sum(_segments(each.shape[1], length) for each in runs)
        # of both signs of the frequency, except at the Nyquist rate
        scale = 2.0 * self._usual / (segments * float(np.sum(_window(length) ** 2)))
        density: Array = scale * powers[:, 1:]
        density[:, -1] *= 0.5
        frequencies = np.arange(1, length // 2 + 1) / (length * self._usual)
        return Density(frequencies, np.sqrt(density), segments, length * self._usual,
                       self._uneven / max(self._steps, 1))

    def _release(self) -> None:
        held, self._held = self._held, []
        if not held:
            return
        steps = np.diff(np.concatenate([seconds for seconds, _ in held])[:FIRST])
        forward = steps[steps > 0.0]
        if not len(forward):
            return
        self._usual = float(np.median(forward))
        self._gap = longest_step(steps, self._timeout)
        for seconds, values in held:
            self._add(seconds, values)

    def _add(self, seconds: Array, values: Array) -> None:
        finite: Flags = np.all(np.isfinite(values), axis=0)
        steps = np.diff(seconds, prepend=seconds[0] if self._time is None else self._time)
        gaps: Flags = (steps <= 0.0) | (steps > self._gap)
        places = steps / self._usual
        multiples = np.maximum(np.round(places), 1.0)
        even = np.abs(places - multiples) <= _EVEN
        places = np.where(even, multiples, places)
        self._steps += int(np.count_nonzero(~gaps))
        self._uneven += int(np.count_nonzero(~even & ~gaps))
        begins: Flags = gaps | ~finite
        begins[1:] |= ~finite[:-1]
        at = [0, *np.flatnonzero(begins).tolist(), len(seconds)]
        for begin, end in zip(at[:-1], at[1:], strict=True):
            if begin == end:
                continue
            if begins[begin]:
                self._end_run()
            if finite[begin]:
                self._add_run(places[begin:end], values[:, begin:end])
        self._time = float(seconds[-1])

    def _end_run(self) -> None:
        if not self._length and self._run.shape[1] >= SHORTEST:
            self._runs.append(self._run)
        self._run = np.empty((self._channels, 0))
        self._last = None

    def _add_run(self, steps: Array, values: Array) -> None:
        """Add samples that continue the present run, or begin one."""
        places = np.cumsum(steps)
        if self._last is None:
            places -= places[0]
            whole = np.arange(np.floor(places[-1]) + 1.0)
        else:
            places += self._last[0]
            whole = np.arange(1.0, np.floor(places[-1]) + 1.0)
        even = values
        if not np.array_equal(whole, places):
            if self._last is not None:
                places = np.append(self._last[0], places)
                values = np.concatenate((self._last[1][:, None], values), axis=1)
            even = np.array([np.interp(whole, places, each) for each in values])
        # counted from the last whole place, so that whole places stay exact
        self._last = float(places[-1] % 1.0), values[:, -1].copy()
        self._take(even)

    def _take(self, even: Array) -> None:
        self._run = np.concatenate((self._run, even), axis=1)
        runs = [*self._runs, self._run]
        if not self._length:
            ends = np.cumsum([each.shape[1] for each in runs])
            if ends[-1] < _KEPT:
                return
            # by no more samples than these: it must not depend on the blocks
            self._length = _length_for(np.diff(np.minimum(ends, _KEPT), prepend=0).tolist())
            self._powers = np.zeros((self._channels, self._length // 2 + 1))
            self._runs = []
        for run in runs:
            self._powers += _powers(run, self._length)
            self._segments += _segments(run.shape[1], self._length)
        used = _segments(self._run.shape[1], self._length) * (self._length // 2)
        self._run = self._run[:, used:].copy()


def _segments(samples: int, length: int) -> int:
    """Return the number of segments of a length in samples."""
    return max((samples - length) // (length // 2) + 1, 0)


def _length_for(runs: Sequence[int]) -> int:
    """Return the length of segments for runs of these numbers of samples; 0: too few."""
    length = LONGEST
    while length > SHORTEST and sum(_segments(run, length) for run in runs) < ENOUGH:
        length //= 2
    return length if sum(_segments(run, length) for run in runs) else 0


def _window(length: int) -> Array:
    window: Array = 0.5 - 0.5 * np.cos(2.0 * np.pi / length * np.arange(length))
    return window


def _powers(samples: Array, length: int) -> Array:
    """Return the sums of the squares of the spectra of all segments (C, length / 2 + 1)."""
    powers = np.zeros((len(samples), length // 2 + 1))
    many = _segments(samples.shape[1], length)
    window = _window(length) if many else np.empty(0)
    # One after the other: they fit into the processor's cache.
    for n in range(many):
        begin = n * (length // 2)
        for channel, power in zip(samples[:, begin:begin + length], powers, strict=True):
            spectrum = np.fft.rfft((channel - channel.mean()) * window)
            power += spectrum.real ** 2 + spectrum.imag ** 2
    return powers


def drawn(frequencies: Array, amplitudes: Array) -> tuple[Array, Array]:
    """
    Return points of a line: of each interval of a logarithmic axis the lowest and the highest.

    Parameters
    ----------
    frequencies, amplitudes : (F,)
        Spectrum of one channel; the frequencies increase and are above zero.

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
