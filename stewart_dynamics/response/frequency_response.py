# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Frequency responses of several outputs to several inputs that repeat, with confidence bands.

The estimator is H = S_yx S_xx^-1 of averaged spectra (J. S. Bendat, A. G. Piersol, Random Data,
4th ed., 2010, doi:10.1002/9781118032428, chapters 7 and 9): noise on the outputs does not bias it.
A segment is one period without a window, so that nothing leaks between the lines and the response
is that of the steady state.

At each frequency only the inputs with power there are taken. Inputs that move alike cannot be
separated: their responses are nan. Motion that does not repeat: ``local_responses``.
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
EXCITED = 1e-5
# Part of an input's power that the other inputs do not explain; less cannot be separated.
SEPARATE = 0.01
# Largest change of an input from one period to the next, relative to its RMS.
_REPEATED = 1e-3
# Shortest part in which the same inputs move, relative to the whole.
_SHORTEST_PART = 1.0 / 12.0
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
    period: int  # samples after which the inputs repeat


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
    noise: Array  # (F, O): one-sided density of the power that is not coherent with any input
    widths: Array  # (F,): distances of the frequencies [Hz], to integrate over the noise
    alike: Array  # (F, I, I): how alike two inputs move, 0 to 1; nan where one has no power


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
    for begin, end, _ in _same_inputs_move(inputs, round(still * rate)):
        if part := _repeated(inputs[begin:end]):
            first, stop, period = part
            if stop - first >= 3 * period:
                first += period
            periods = (stop - first) // period
            found.append(Part(begin + first, begin + first + periods * period, period))
    return found


def parts_by_inputs(inputs: Array, rate: float, still: float = 1.0,
                    ) -> list[tuple[int, int, list[int]]]:
    """
    Return begin, end and inputs of the parts of inputs (N, I) in which the same ones move.

    A part lasts until the next one begins. Short ones belong to the part before them, or to the
    first one.
    """
    parts: list[list[int]] = []
    for begin, _, code in _same_inputs_move(inputs, round(still * rate)):
        if parts and parts[-1][1] == code:
            continue
        parts.append([begin, code])
    shortest = len(inputs) * _SHORTEST_PART
    merged: list[list[int]] = []
    for (begin, code), end in zip(parts, [*(each[0] for each in parts[1:]), len(inputs)],
                                  strict=True):
        short = end - begin < shortest or (merged and begin - merged[-1][0] < shortest)
        if merged and (short or merged[-1][1] == code):
            merged[-1][1] |= code
        else:
            merged.append([begin, code])
    ends = [*(each[0] for each in merged[1:]), len(inputs)]
    return [(begin, end, [n for n in range(inputs.shape[1]) if code >> n & 1])
            for (begin, code), end in zip(merged, ends, strict=True)]


def _same_inputs_move(inputs: Array, still: int) -> list[tuple[int, int, int]]:
    """Return begin and end of each part in which the same inputs move, and their bits."""
    steps = np.abs(np.diff(inputs, axis=0, prepend=inputs[:1]))
    moves: Flags = steps > 1e-6 * np.ptp(inputs, axis=0)
    moves &= np.ptp(inputs, axis=0) > 0.0
    counts = np.cumsum(np.vstack([np.zeros((1, inputs.shape[1])), moves]), axis=0)
    at = np.arange(len(inputs))
    low, high = np.maximum(at - still, 0), np.minimum(at + still + 1, len(inputs))
    near: Flags = counts[high] > counts[low]
    codes = near @ (1 << np.arange(inputs.shape[1]))
    edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    return [(begin, end, int(codes[begin]))
            for begin, end in zip(edges[:-1], edges[1:], strict=True) if codes[begin]]


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


def spectra(samples: Iterable[Array], rate: float, period: int) -> Spectra | None:
    """Return the mean spectra of samples (N, C) in whole periods; None without a period."""
    total: Any = 0.0
    count = 0
    for each in samples:
        periods = len(each) // period
        whole = each[:periods * period].reshape(periods, period, -1)
        lines = np.fft.rfft(whole - whole.mean(axis=1, keepdims=True), axis=1).swapaxes(0, 1)
        total = total + lines.swapaxes(1, 2) @ lines.conj()
        count += periods
    if not count:
        return None
    frequencies = np.arange(period // 2 + 1, dtype=np.float64) * (rate / period)
    neighbors = min(_NEIGHBORS, (period // 2 - 2) // 2 * 2 + 1)
    return Spectra(frequencies[1:], total[1:] * (2.0 / (rate * period * count)), float(count),
                   max(neighbors, 1))


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
    excited: Flags = own > EXCITED * own.max(axis=0)
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
    _, alike = separate_shares(densities[:, inputs][:, :, inputs])
    step = np.full(len(own), found.frequencies[0])
    return FrequencyResponses(
        found.frequencies, h, radii, coherences_of(h, powers[:, None, :], smooth[:, :, None]),
        noise, step, np.where(excited[:, :, None], alike, np.nan))


def coherences_of(h: Complex, powers: Array, noise: Array) -> Array:
    """Return the part of the power that is due to inputs, of this part and noise."""
    due = np.where(np.abs(h) > _ROUNDING, np.abs(h) ** 2 * powers, 0.0)
    total: Array = due + noise
    found: Array = np.divide(due, total, out=np.zeros_like(total), where=total > 0.0)
    return found


def separate_shares(densities: Complex, least: float = 1e-13) -> tuple[Array, Array]:
    """
    Return the parts (F, I) of the powers that other inputs do not explain, and |coherence|.

    densities: of the inputs (F, I, I). least: power, relative to the largest, of inputs that
    explain nothing.
    """
    powers = np.diagonal(densities, axis1=1, axis2=2).real
    scale = np.sqrt(np.maximum(powers, 1e-300))
    normal = densities / (scale[:, :, None] * scale[:, None, :])
    weak = least * np.maximum(powers.max(axis=1, keepdims=True), 1e-300) / scale ** 2
    inverse = np.linalg.inv(normal + weak[:, :, None] * np.eye(powers.shape[1]))
    alone = 1.0 / np.maximum(np.diagonal(inverse, axis1=1, axis2=2).real, 1e-300) - weak
    return alone.clip(0.0, 1.0), np.abs(normal)


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
    lost = alone < SEPARATE
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
