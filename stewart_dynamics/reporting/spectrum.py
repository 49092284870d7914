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
the mean of each removed, Hann windows, the mean of their power spectra. A short bag needs short
segments: their length is the greatest power of two of which there are enough. Samples wait for
this in a file.

``scipy.signal.welch`` gives the same numbers (see the tests) for samples that are all in memory.
Its import takes longer than the spectra of a million samples, and only
--differentiate requires SciPy.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    folder : Path, optional
        Contains the file of the samples, which has no name there.

    """

    def __init__(self, channels: int, timeout: float, folder: Path | None = None) -> None:
        self._timeout = timeout
        self._columns = 1 + channels
        self._file = TemporaryFile(dir=folder)

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
        self._file.write(np.column_stack((seconds, values.T)).tobytes())

    def density(self) -> Density | None:
        """Return the spectra so far; None if there are too few samples."""
        if not self._file.tell():
            return None
        self._file.flush()
        rows = np.memmap(self._file, np.float64, 'r').reshape(-1, self._columns)
        steps = np.diff(rows[:, 0], prepend=rows[0, 0])
        first = steps[1:FIRST]
        if not np.any(first > 0.0):
            return None
        usual = float(np.median(first[first > 0.0]))
        # Places of the samples, in units of the usual step.
        places = steps / usual
        multiples = np.maximum(np.round(places), 1.0)
        even = np.abs(places - multiples) <= _EVEN
        places[even] = multiples[even]
        gaps: Flags = (steps <= 0.0) | (steps > longest_step(first, self._timeout))
        finite: Flags = np.all(np.isfinite(rows[:, 1:]), axis=1)
        begins = gaps | ~finite
        begins[1:] |= ~finite[:-1]
        at = np.append(np.flatnonzero(begins), len(rows))
        runs = []
        for begin, end in zip(at[:-1], at[1:], strict=True):
            if finite[begin]:
                places[begin] = 0.0
                np.cumsum(places[begin:end], out=places[begin:end])
                runs.append((places[begin:end], rows[begin:end, 1:]))
        length = _length_for([_even_samples(run) for run, _ in runs])
        if not length:
            return None
        powers = np.sum([_powers(run, values, length) for run, values in runs], axis=0)
        segments = sum(_segments(_even_samples(run), length) for run, _ in runs)
        # of both signs of the frequency, except at the Nyquist rate
        density: Array = 2.0 * usual / (segments * np.sum(_window(length) ** 2)) * powers[:, 1:]
        density[:, -1] *= 0.5
        return Density(
            np.arange(1, length // 2 + 1) / (length * usual), np.sqrt(density), segments,
            length * usual, np.count_nonzero(~even & ~gaps) / max(np.count_nonzero(~gaps), 1))


def _even_samples(places: Array) -> int:
    """Return the number of samples at whole places in a run."""
    return int(places[-1]) + 1


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


def _powers(places: Array, values: Array, length: int) -> Array:
    """
    Return the sums of the squares of the spectra of all segments of a run (C, length / 2 + 1).

    The places (N,) of the samples (N, C) are in units of the usual step, the first is 0.
    """
    powers = np.zeros((values.shape[1], length // 2 + 1))
    window = _window(length)
    # One after the other: they fit into the processor's cache.
    for n in range(_segments(_even_samples(places), length)):
        whole = np.arange(n * (length // 2), n * (length // 2) + length, dtype=float)
        first, last = np.searchsorted(places, whole[[0, -1]])
        is_even = np.array_equal(places[first:last + 1], whole)
        part = slice(first if is_even else max(first - 1, 0), last + 1)
        for channel, power in zip(np.array(values[part].T), powers, strict=True):
            if not is_even:
                channel = np.interp(whole, places[part], channel)
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
