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

The length of a bag is not known before its end. So segments of all lengths, powers of two, are
begun with; a length is given up when there are enough segments of twice that length. The result is
of the longest segments of which there are enough, and fine enough for long bags and short ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.replay.block_statistics import FIRST, longest_step

# Samples in a segment.
SHORTEST, LONGEST = 2 ** 6, 2 ** 15
# So many segments make a spectrum; of the shortest ones, one will do.
ENOUGH = 4
# A step in time that differs by less than this part from a multiple of the usual one is even.
_EVEN = 0.01
# At most so many values are transformed at once: they fit into the processor's cache.
_TOGETHER = 2 ** 17
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


@dataclass
class _Length:
    """Segments of one length."""

    samples: int
    sums: Array
    """Of the power spectra (C, samples / 2 + 1)."""
    segments: int = 0
    begin: int = 0
    """Where the next segment begins in the samples that are kept."""
    window: Array = field(init=False)

    def __post_init__(self) -> None:
        n = np.arange(self.samples)
        self.window = 0.5 - 0.5 * np.cos(2.0 * np.pi * n / self.samples)

    def add(self, samples: Array) -> None:
        """Add all segments that are in samples (C, N)."""
        many = (samples.shape[1] - self.begin - self.samples) // (self.samples // 2) + 1
        if many < 1:
            return
        step = self.samples // 2
        at_once = max(_TOGETHER // (self.samples * len(samples)), 1)
        parts = np.lib.stride_tricks.sliding_window_view(
            samples[:, self.begin:], self.samples, axis=1)[:, ::step]
        for first in range(0, many, at_once):
            part = parts[:, first:min(first + at_once, many)]
            spectra = np.fft.rfft(
                (part - part.mean(axis=2, keepdims=True)) * self.window, axis=2)
            self.sums += np.sum(spectra.real ** 2 + spectra.imag ** 2, axis=1)
        self.segments += many
        self.begin += many * step


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
        self._samples: Array = np.empty((channels, 0))
        self._lengths = [
            _Length(2 ** n, np.zeros((channels, 2 ** (n - 1) + 1)))
            for n in range(SHORTEST.bit_length() - 1, LONGEST.bit_length())]
        self._steps = self._uneven = 0

    def add(self, seconds: Array, values: Array) -> None:
        """
        Add samples.

        Parameters
        ----------
        seconds : (N,)
            Times, never decreasing; the same time again where time has jumped back [s].
        values : (C, N)
            Of every channel.

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
        found = [each for each in self._lengths if each.segments >= ENOUGH]
        found = found[-1:] or [each for each in self._lengths[:1] if each.segments]
        if not found:
            return None
        length = found[0]
        rate = 1.0 / self._usual
        powers = length.sums / (length.segments * rate * np.sum(length.window ** 2))
        powers[:, 1:-1] *= 2.0  # of the frequencies below zero
        return Density(
            np.fft.rfftfreq(length.samples, self._usual)[1:], np.sqrt(powers[:, 1:]),
            length.segments, length.samples * self._usual, self._uneven / max(self._steps, 1))

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
        finite = np.isfinite(values).all(axis=0)
        steps = np.diff(seconds, prepend=seconds[0] if self._time is None else self._time)
        gaps = (steps <= 0.0) | (steps > self._gap)
        places = steps / self._usual
        multiples = np.maximum(np.round(places), 1.0)
        even = np.abs(places - multiples) <= _EVEN
        places = np.where(even, multiples, places)
        self._steps += int(np.count_nonzero(~gaps))
        self._uneven += int(np.count_nonzero(~even & ~gaps))
        begins = gaps | ~finite
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
        self._last = None
        self._samples = np.empty((self._channels, 0))
        for length in self._lengths:
            length.begin = 0

    def _add_run(self, steps: Array, values: Array) -> None:
        """Add samples that go on from the last one, or begin a run if there is none."""
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
        self._samples = np.concatenate((self._samples, even), axis=1)
        for length in self._lengths:
            length.add(self._samples)
        enough = [n for n, length in enumerate(self._lengths) if length.segments >= ENOUGH]
        if enough:
            del self._lengths[:enough[-1]]
        used = min(min(length.begin for length in self._lengths), self._samples.shape[1])
        self._samples = self._samples[:, used:]
        for length in self._lengths:
            length.begin -= used


def drawn(frequencies: Array, amplitudes: Array) -> tuple[Array, Array]:
    """
    Return points of a line: of each interval of a logarithmic axis the lowest and the highest.

    Parameters
    ----------
    frequencies, amplitudes : (F,)
        Of one channel, frequencies increasing, above zero.

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
