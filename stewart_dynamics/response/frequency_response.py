# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Frequency responses of several outputs to several inputs, with coherence and confidence bands.

The estimator is H = S_yx S_xx^-1 of averaged spectra (J. S. Bendat, A. G. Piersol, Random Data,
4th ed., 2010, doi:10.1002/9781118032428, chapters 7 and 9): noise on the outputs does not bias it.
Spectra are those of ``scipy.signal``. Where the inputs repeat, a segment is one period without a
window, so that nothing leaks between the lines and the response is that of the steady state;
elsewhere segments are Hann windows that overlap by half.

At each frequency only the inputs with power there are taken. Inputs that move together cannot be
separated: their responses are nan.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.errors import StewartError
from stewart_dynamics.estimation.confidence_level import CONFIDENCE_LEVEL

Complex = NDArray[np.complex128]

# Power of an input at a frequency, relative to its largest, below which it is not excited there.
_EXCITED = 1e-5
# Part of an input's power that the other inputs do not explain; less cannot be separated.
_SEPARATE = 0.01
# Largest change of an input from one period to the next, relative to its RMS.
_REPEATED = 1e-3
# Longest segment of an input that does not repeat [s], and fewest samples in one.
_LONGEST, _FEWEST = 20.0, 64
# Longest delay by which inputs that do not repeat are aligned with outputs [s].
_LATEST = 1.0
# Frequencies whose noise is averaged where periods are few.
_NEIGHBORS = 9
# A smaller gain is one of rounding errors.
_ROUNDING = 1e-9
# Candidates for the period of an input that are tried.
_CANDIDATES = 30


class Part(NamedTuple):
    """Samples that are analyzed together."""

    begin: int
    end: int
    period: int | None  # samples after which the inputs repeat; None: they do not


class Spectra(NamedTuple):
    """Averaged cross-spectral densities of C channels at F frequencies."""

    frequencies: Array  # (F,) [Hz]
    densities: Complex  # (F, C, C), one-sided: mean of y x* at [y, x]
    averages: float  # number of independent averages
    neighbors: int
    """Number of frequencies whose noise is averaged, independent of each other."""


class FrequencyResponses(NamedTuple):
    """Responses of O outputs to I inputs at F frequencies; nan where an input has no power."""

    frequencies: Array  # (F,) [Hz]
    responses: Complex  # (F, O, I)
    radii: Array  # (F, O, I): radius of its confidence circle around each
    coherences: Array  # (F, O, I): part of the power due to the input, of this and noise
    noise: Array  # (F, O): one-sided density of what is not coherent with any input


def signal_module() -> Any:
    """Return ``scipy.signal``; StewartError where SciPy is not installed."""
    try:
        import scipy.signal
    except ImportError as exc:
        raise StewartError('frequency responses need SciPy: pip install '
                           "'stewart_dynamics[response]'") from exc
    return scipy.signal


def periodic_parts(inputs: Array, rate: float, still: float = 1.0) -> list[Part]:
    """
    Return the parts of inputs (N, I) in which they repeat at least twice.

    The inputs are split where one of them begins or ends to move. The first period of at least
    three is left out: in it the output settles.

    rate: samples per second.
    still: an input that does not move for this time is at rest [s].
    """
    found = []
    for begin, end in _same_inputs_move(inputs, round(still * rate)):
        if part := _repeated(inputs[begin:end]):
            first, stop, period = part
            if stop - first >= 3 * period:
                first += period
            periods = (stop - first) // period
            found.append(Part(begin + first, begin + first + periods * period, period))
    return found


def _same_inputs_move(inputs: Array, still: int) -> list[tuple[int, int]]:
    """Return begin and end of each part in which the same inputs move."""
    steps = np.abs(np.diff(inputs, axis=0, prepend=inputs[:1]))
    moves: Flags = steps > 1e-6 * np.ptp(inputs, axis=0)
    moves &= np.ptp(inputs, axis=0) > 0.0
    counts = np.cumsum(np.vstack([np.zeros((1, inputs.shape[1])), moves]), axis=0)
    at = np.arange(len(inputs))
    low, high = np.maximum(at - still, 0), np.minimum(at + still + 1, len(inputs))
    near: Flags = counts[high] > counts[low]
    codes = near @ (1 << np.arange(inputs.shape[1]))
    edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    return [(begin, end) for begin, end in zip(edges[:-1], edges[1:], strict=True) if codes[begin]]


def _repeated(inputs: Array) -> tuple[int, int, int] | None:
    """Return begin, end and period of the longest part that repeats; None if none does."""
    spread = inputs - inputs.mean(axis=0)
    rms = np.sqrt(np.mean(spread ** 2, axis=0))
    moving = rms > 0.0
    spread = spread[:, moving] / rms[moving]
    count = len(spread)
    power = np.sum(np.abs(np.fft.rfft(spread, 2 * count, axis=0)) ** 2, axis=1)
    similar = np.fft.irfft(power)[:count // 2] / np.arange(count, count - count // 2, -1)
    peaks = np.flatnonzero((similar[1:-1] > similar[:-2]) & (similar[1:-1] >= similar[2:])) + 1
    likely = np.sort(peaks[np.argsort(-similar[peaks])][:_CANDIDATES])
    for period in likely.tolist():
        change = np.abs(spread[period:] - spread[:-period]).max(axis=1)
        begin, end = _longest(change < _REPEATED)
        if end - begin >= period:
            return begin, end + period, period
    return None


def _longest(flags: Flags) -> tuple[int, int]:
    """Return begin and end of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False)).reshape(-1, 2)
    if not len(edges):
        return 0, 0
    begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])].tolist()
    return begin, end


def spectra(runs: Iterable[Array], rate: float, length: int, hann: bool) -> Spectra | None:
    """
    Return the mean spectra of runs (N, C) without a gap; None if all are shorter than a segment.

    length: samples in a segment.
    hann: Hann windows that overlap by half; else segments one after the other, as they are.
    """
    signal = signal_module()
    window = signal.get_window('hann' if hann else 'boxcar', length)
    step = length - length // 2 if hann else length
    total: Any = 0.0
    count = 0
    frequencies = np.arange(length // 2 + 1, dtype=np.float64) * (rate / length)
    for run in runs:
        if len(run) < length:
            continue
        _, _, parts = signal.stft(
            run, rate, window, length, length - step, detrend='constant', boundary=None,
            padded=False, axis=0, scaling='psd')
        parts = np.moveaxis(parts, 1, -1)  # (F, K, C)
        total = total + np.swapaxes(parts, 1, 2) @ parts.conj()
        count += parts.shape[1]
    if not count:
        return None
    # Segments that overlap are not independent (Welch, 1967).
    shared = np.sum(window[step:] * window[:length - step]) ** 2 / np.sum(window ** 2) ** 2
    averages = count / (1.0 + 2.0 * shared * (count - 1) / count)
    # The mean leaks into the first frequency of Hann windows.
    first = 2 if hann else 1
    neighbors = 1 if hann else min(_NEIGHBORS, (length // 2 - 2) // 2 * 2 + 1)
    return Spectra(frequencies[first:], 2.0 * total[first:] / count, averages, max(neighbors, 1))


def aligned(runs: Sequence[Array], rate: float) -> tuple[list[Array], int]:
    """
    Return runs whose outputs are earlier by the samples by which they are late, and their number.

    Windows at the same time see different parts of inputs and outputs that are late, which biases
    the response; at the largest correlation of their speeds they see the same.

    runs: (N, 2 C), C inputs and as many outputs.
    """
    longest = max(runs, key=len, default=np.empty((0, 0)))
    speeds = np.diff(longest, axis=0)
    most = min(round(_LATEST * rate), len(speeds) // 8)
    sizes = speeds.std(axis=0) if len(speeds) else np.empty(0)
    half = len(sizes) // 2
    moving = (sizes[:half] > 0.0) & (sizes[half:] > 0.0)
    if not most or not moving.any():
        return list(runs), 0
    x, y = (np.fft.rfft((speeds / np.where(sizes > 0.0, sizes, 1.0))[:, part][:, moving],
                        2 * len(speeds), axis=0) for part in (slice(half), slice(half, None)))
    similar = np.fft.irfft(np.sum(y * x.conj(), axis=1))[:most + 1]
    late = int(similar.argmax())
    return [np.hstack([run[:len(run) - late, :half], run[late:, half:]]) for run in runs], late


def segment_length(runs: Sequence[Array], rate: float, inputs: int) -> int:
    """Return the samples of a segment, so that enough of them separate the inputs."""
    longest = max((len(run) for run in runs), default=0)
    return min(round(_LONGEST * rate), int(2 * longest / (4 * inputs + 6)))


def responses(found: Spectra, inputs: Sequence[int], outputs: Sequence[int],
              ) -> FrequencyResponses:
    """
    Return the responses of some channels to others.

    Raises StewartError if there are not more averages than inputs.
    """
    if found.averages <= len(inputs):
        raise StewartError(f'{found.averages:.3g} averages: must be more than the inputs')
    densities = found.densities
    own = np.diagonal(densities, axis1=1, axis2=2).real[:, inputs]
    excited: Flags = own > _EXCITED * own.max(axis=0)
    shape = len(densities), len(outputs), len(inputs)
    h = np.full(shape, np.nan, dtype=complex)
    powers = np.full((len(densities), len(inputs)), np.nan)  # that other inputs do not explain
    noise: Array = np.diagonal(densities, axis1=1, axis2=2).real[:, outputs].astype(np.float64)
    free = found.averages - len(inputs)
    for mask in np.unique(excited[excited.any(axis=1)], axis=0):
        at = np.flatnonzero((excited == mask).all(axis=1))
        used = np.flatnonzero(mask)
        one_h, one_powers, rest = _one_set(
            densities[at], np.asarray(inputs)[used], np.asarray(outputs))
        h[np.ix_(at, np.arange(len(outputs)), used)] = one_h
        powers[np.ix_(at, used)] = one_powers
        noise[at] = rest * found.averages / free
    # |H - H^|^2 is noise over power: F distribution with 2 and 2 free degrees of freedom.
    smooth, free = _smooth(noise, found.neighbors), free * found.neighbors
    quantile = free * ((1.0 - CONFIDENCE_LEVEL) ** (-1.0 / free) - 1.0)
    radii = np.sqrt(quantile / found.averages * smooth[:, :, None] / powers[:, None, :])
    due = np.where(np.abs(h) > _ROUNDING, np.abs(h) ** 2 * powers[:, None, :], 0.0)
    total = due + smooth[:, :, None]
    coherences = np.divide(due, total, out=np.zeros_like(total), where=total > 0.0)
    return FrequencyResponses(found.frequencies, h, radii, coherences, noise)


def _one_set(densities: Complex, inputs: Integers, outputs: Integers,
             ) -> tuple[Complex, Array, Array]:
    """Return responses, powers of inputs alone, and incoherent power, of the same inputs."""
    xx = densities[:, inputs][:, :, inputs]
    yx = densities[:, outputs][:, :, inputs]
    yy = np.diagonal(densities, axis1=1, axis2=2).real[:, outputs]
    scale = np.sqrt(np.diagonal(xx, axis1=1, axis2=2).real)
    normal = xx / (scale[:, :, None] * scale[:, None, :])
    # Slightly regular, so that inputs that move together disturb no others.
    inverse = np.linalg.inv(normal + 1e-13 * np.eye(len(inputs)))
    h = (yx / scale[:, None, :]) @ inverse
    explained = np.einsum('foi,fij,foj->fo', h, normal, h.conj()).real
    alone = 1.0 / np.maximum(np.diagonal(inverse, axis1=1, axis2=2).real, 1.0)
    lost = alone < _SEPARATE
    return (np.where(lost[:, None, :], np.nan, h / scale[:, None, :]),
            np.where(lost, np.nan, alone * scale ** 2), np.maximum(yy - explained, 0.0))


def _smooth(noise: Array, neighbors: int) -> Array:
    """Return the means of a density (F, O) over a number of neighboring frequencies."""
    if neighbors == 1:
        return noise
    padded = np.pad(noise, ((neighbors // 2, neighbors // 2), (0, 0)), mode='reflect')
    sums = np.cumsum(np.vstack([np.zeros((1, noise.shape[1])), padded]), axis=0)
    means: Array = (sums[neighbors:] - sums[:-neighbors]) / neighbors
    return np.maximum(means, 0.0)
