# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Frequency responses from motion that does not repeat: local regression of whole spectra.

The spectra of a record obey Y = G X + T + V without error of leakage: T is the spectrum of the
transients at both ends, as smooth over frequency as G (R. Pintelon, J. Schoukens, System
Identification, 2nd ed., 2012, doi:10.1002/9781118287422, chapter 7), V is noise. An impulse
response that decays with the rate a [1/s] correlates G at two frequencies [rad/s] by
4 a^2 / (4 a^2 + (w - w')^2) (J. Lataire, T. Chen, Transfer function and transient estimation by
Gaussian process regression in the frequency domain, Automatica 72, 2016,
doi:10.1016/j.automatica.2016.06.009). The likelihood of the lines around a frequency weights all
candidates of decay and noise; the bands contain how little the data determine these, and G
between the lines with power.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.estimation.confidence_level import CONFIDENCE_LEVEL
from stewart_dynamics.response.frequency_response import (
    coherences_of, Complex, EXCITED, FrequencyResponses, SEPARATE, separate_shares)

# Lines of a spectrum that are taken around a frequency: the nearest ones, for each function to be
# found and besides, and those with power that are farther away, for each input.
_NEAREST, _BESIDES, _WITH_POWER = 6, 9, 8
# How far they may be, as a ratio of frequencies; their least power, relative to the largest there.
_FARTHEST, _POWER = 2.0, 1e-2
# Distance of the frequencies that are stated, relative to them, and in lines.
_DISTANCE, _LINES = 0.03, 2
# Ratio of the decays that are tried, by which G may be rougher than around a frequency, and ratios
# of a frequency to lower and higher ones that show its decay: G of a drive is flat far below its
# bandwidth, which would promise the same above it.
_ROUGHER, _SAME_DECAY = 1.75, (1.3, 10.0)
# Variance of a level, before anything is known, by the mean ratio of the powers.
_LEVEL = 30.0
# Signal-to-noise ratios of power that are tried; larger ones are lost in rounding errors.
_RATIOS = 10.0 ** np.arange(-1.0, 11.6, 0.15)
# Power of an input, by the largest, that does not keep others from being separated.
_WEAK = 1e-4
# Candidates with a smaller probability are left out.
_UNLIKELY = 1e-4
# Longest record that is analyzed as one [s].
_LONGEST = 200.0
# Longest delay that is looked for [s].
_LATEST = 1.0
# Power of noise that a Hann window lets through.
_HANN = 0.375


class _Spectrum(NamedTuple):
    """F lines of a record, scaled so that white noise has its variance at each."""

    omega: Array  # (F,) [rad/s]
    inputs: Complex  # (F, I)
    outputs: Complex  # (F, O)
    hann: Complex  # (F, I + O): the same with Hann windows, which do not leak far


class _Candidates(NamedTuple):
    """Windows of R lines around C frequencies, with A decays."""

    gain: Array  # (C,): squared, the ratio of the powers of outputs and inputs
    power: Array  # (C,): of all inputs
    eigenvalues: Array  # (A, C, R), of the covariance of the outputs, by gain and power
    outputs: Complex  # (A, C, R, O): in the axes of the eigenvectors
    covariances: Complex  # (A, C, R, I): of G at the frequency with the outputs
    likelihoods: Array  # (A, L, C, O): logarithms, by decay and signal-to-noise ratio
    shares: Array  # (C,): part of the lines of a window that are in no other one


def local_responses(runs: Sequence[Array], rate: float, own: Sequence[int], highest: float,
                    ) -> FrequencyResponses | None:
    """
    Return the responses of O outputs to I inputs; None if all runs are too short.

    runs: (N, I + O), inputs and outputs at even times.
    rate: samples per second.
    own: the output of each input that moves as the input does.
    highest: highest frequency at which the inputs are analyzed [Hz].
    """
    count = len(own)
    pieces = [piece for run in runs for piece in np.array_split(
        run, max(1, int(len(run) / rate / _LONGEST)))]
    least = 2 * _nearest(count)
    pieces = [piece for piece in pieces if len(piece) > 2 * least + 2]
    if not pieces:
        return None
    late = _delays(max(pieces, key=len), rate, own)
    spectra = [_spectrum(piece, rate, count, late) for piece in pieces]
    longest = max(spectra, key=lambda each: len(each.omega))
    powers = _powers(spectra, longest.omega, count)
    frequencies, widths, at = _frequencies(longest.omega / (2.0 * np.pi), powers)
    slowest = 10.0 * longest.omega[0] / (2.0 * np.pi)
    decays = slowest * _ROUGHER ** np.arange(
        2.0 + np.log(4.0 * np.pi * highest / slowest) / np.log(_ROUGHER))
    omega = 2.0 * np.pi * frequencies
    lines = [_lines(each, omega, count) for each in spectra]
    found = [_candidates(*each, omega, decays) for each in zip(spectra, lines, strict=True)]
    near = _hann_inputs(spectra, lines, count)
    excited: Flags = (powers[at] > EXCITED * powers.max(axis=0)) & (
        powers[at] > _POWER * (np.abs(near) ** 2).max(axis=2)) & (frequencies <= highest)[:, None]
    of_decays = _decay_weights(found, omega, own, excited)
    value, radius, noise = _joined([_posterior(each, of_decays) for each in found])
    density = near @ near.conj().swapaxes(1, 2) / near.shape[2]
    alone, alike = separate_shares(density, _WEAK)
    total = np.diagonal(density, axis1=1, axis2=2).real
    stated = (excited & (alone > SEPARATE))[:, None, :]
    value = value * np.exp(-1j * omega[:, None] * late)[:, :, None]
    value, radius = (np.where(stated, each, np.nan) for each in (value, radius))
    return FrequencyResponses(
        frequencies, value, radius,
        coherences_of(value, (alone * total)[:, None, :], noise[:, :, None]),
        2.0 / rate * noise, widths, np.where(excited[:, :, None], alike, np.nan))


def interpolated(found: FrequencyResponses, output: int, number: int, frequencies: Array,
                 ) -> Complex:
    """Return G of an output and an input at all frequencies (F,); outside, as at the ends."""
    from scipy.interpolate import PchipInterpolator

    value = found.responses[:, output, number]
    known = np.flatnonzero(np.isfinite(value))
    if len(known) < 2:
        return np.full(len(frequencies), value[known[0]] if len(known) else 0.0, dtype=complex)
    f = np.append(0.0, found.frequencies[known])
    # At zero, real.
    h = np.append(np.abs(value[known[0]]) * np.sign(value[known[0]].real), value[known])
    inside = frequencies.clip(0.0, f[-1])
    return np.asarray(PchipInterpolator(f, h.real)(inside)
                      + 1j * PchipInterpolator(f, h.imag)(inside))


def _nearest(inputs: int) -> int:
    """Return the number of nearest lines in a window."""
    return _NEAREST * (inputs + 1) + _BESIDES


def _delays(samples: Array, rate: float, own: Sequence[int]) -> Array:
    """
    Return by how much the outputs are late (O,) [s], in whole samples.

    Where the speeds of an output and of its input are correlated most; G without its delay is
    smoother. Outputs without an input are as late as those with one are in the middle.
    """
    count = len(own)
    speeds = np.diff(samples, axis=0)
    lines = np.fft.rfft(speeds, 2 * len(speeds), axis=0)
    most = min(round(_LATEST * rate), len(speeds) // 8)
    similar = np.fft.irfft(
        lines[:, [count + each for each in own]] * lines[:, :count].conj(), axis=0)
    near = np.abs(np.concatenate([similar[-most:], similar[:most + 1]]))
    lags = (near.argmax(axis=0) - most) / rate
    late = np.full(samples.shape[1] - count, float(np.median(lags)))
    late[list(own)] = lags
    return late


def _spectrum(samples: Array, rate: float, inputs: int, late: Array) -> _Spectrum:
    """Return the lines between zero and half the rate, of outputs without their delays (O,)."""
    whole = np.fft.rfft(samples - samples.mean(axis=0), axis=0) / np.sqrt(len(samples))
    omega = 2.0 * np.pi * rate / len(samples) * np.arange(len(whole), dtype=np.float64)
    whole[:, inputs:] *= np.exp(1j * omega[:, None] * late)
    hann = (0.5 * whole[1:-1] - 0.25 * (whole[:-2] + whole[2:])) / np.sqrt(_HANN)
    return _Spectrum(omega[1:-1], whole[1:-1, :inputs], whole[1:-1, inputs:], hann)


def _powers(spectra: Sequence[_Spectrum], omega: Array, inputs: int) -> Array:
    """Return the largest powers (F, I) of the inputs in any record, at frequencies (F,)."""
    several = [np.stack([np.interp(omega, each.omega, np.abs(hann) ** 2)
                         for hann in each.hann.T[:inputs]], axis=1) for each in spectra]
    powers: Array = np.max(several, axis=0)
    return powers


def _frequencies(lines: Array, powers: Array) -> tuple[Array, Array, Integers]:
    """
    Return the frequencies that are stated, the distances between them, and their lines (C,).

    Each is the line with most power (F, I) among neighboring lines (F,); where the power has its
    peak between two lines, as for a sine, the frequency of the peak.
    """
    step = lines[0]
    edges = [0]
    while edges[-1] < len(lines):
        edges.append(min(edges[-1] + max(_LINES, round(_DISTANCE * edges[-1])), len(lines)))
    most = powers.max(axis=0)
    together = (powers / np.where(most > 0.0, most, 1.0)).sum(axis=1)
    at = np.array([begin + int(together[begin:end].argmax())
                   for begin, end in zip(edges[:-1], edges[1:], strict=True)])
    size = np.sqrt(np.pad(together, 1))
    left, middle, right = size[at], size[at + 1], size[at + 2]
    side = np.maximum(left, right)
    # Ratio of the two largest lines of a Hann window: exact for a sine.
    off = np.where(middle > side, (2.0 * side - middle) / np.maximum(side + middle, 1e-300), 0.0)
    off = np.where(right > left, off, -off).clip(-0.5, 0.5)
    return lines[at] + step * off, step * np.diff(edges), at


def _lines(spectrum: _Spectrum, omega: Array, inputs: int) -> Integers:
    """Return the lines (C, R) around frequencies (C,): the nearest, and others with power."""
    powers = np.abs(spectrum.hann[:, :inputs]) ** 2
    most = powers.max(axis=0)
    together = (powers / np.where(most > 0.0, most, 1.0)).sum(axis=1)
    total = len(together)
    nearest = _nearest(inputs)
    count = min(nearest + _WITH_POWER * inputs, total)
    found = np.empty((len(omega), count), dtype=np.int64)
    for n, center in enumerate(omega / spectrum.omega[0] - 1.0):
        begin = int(np.clip(round(center) - nearest // 2, 0, total - nearest))
        low = max(0, min(begin, int(center / _FARTHEST)))
        high = min(total, max(begin + nearest, int(center * _FARTHEST) + 2))
        there = together[low:high]
        strong = low + np.flatnonzero(there > _POWER * there.max())
        near = np.arange(max(0, begin - count), min(total, begin + nearest + count))
        # Nearest lines first, then those with power, then the others; each by its distance.
        rest = np.setdiff1d(strong, np.arange(begin, begin + nearest))
        order = np.concatenate([np.arange(begin, begin + nearest), *(
            each[np.argsort(np.abs(each - center), kind='stable')] for each in (
                rest, np.setdiff1d(near, np.union1d(rest, np.arange(begin, begin + nearest)))))])
        found[n] = np.sort(order[:count])
    return found


def _candidates(spectrum: _Spectrum, lines: Integers, centers: Array, decays: Array,
                ) -> _Candidates:
    """Return the windows of lines (C, R) around frequencies (C,) [rad/s]."""
    omega, x, y = spectrum.omega[lines], spectrum.inputs[lines], spectrum.outputs[lines]
    hann = np.abs(spectrum.hann[lines]) ** 2
    count = x.shape[2]
    tiny = 1e-300
    gain = np.sqrt((hann[:, :, count:].sum(axis=(1, 2)) + tiny)
                   / (hann[:, :, :count].sum(axis=(1, 2)) + tiny))
    power = np.mean(np.abs(x) ** 2, axis=1).sum(axis=1) + tiny
    # Transients are as large as the leakage, at most as the input.
    products = (x @ x.conj().swapaxes(1, 2)) / power[:, None, None] + 1.0
    between, to_center = omega[:, :, None] - omega[:, None, :], omega - centers[:, None]
    parts = []
    for decay in decays:
        similar, to = (_LEVEL + 4.0 * decay ** 2 / (4.0 * decay ** 2 + each ** 2)
                       for each in (between, to_center))
        values, vectors = np.linalg.eigh(products * similar)
        inverse = vectors.conj().swapaxes(1, 2)
        parts.append((np.maximum(values, 0.0), inverse @ y, inverse @ (x * to[:, :, None])))
    eigenvalues, outputs, covariances = (np.stack(each) for each in zip(*parts, strict=True))
    size = (gain ** 2 * power)[:, None]
    squares = np.abs(outputs) ** 2
    likelihoods = np.empty((len(decays), len(_RATIOS), len(centers), y.shape[2]))
    for n, ratio in enumerate(_RATIOS):
        variances = eigenvalues + 1.0 / ratio
        likelihoods[:, n] = -np.log(variances).sum(axis=2)[:, :, None] - (
            squares / variances[..., None]).sum(axis=2) / size
    often = np.bincount(lines.ravel(), minlength=len(spectrum.omega))
    return _Candidates(gain, power, eigenvalues, outputs, covariances, likelihoods,
                       (1.0 / often[lines]).mean(axis=1))


def _decay_weights(found: Sequence[_Candidates], omega: Array, own: Sequence[int],
                   excited: Flags) -> Array:
    """
    Return the probabilities (A, C, O) of the decays.

    An output that follows an input has its own, from frequencies with power (C, I); other outputs,
    which show less, have those of all that follow an input.
    """
    ratio = omega / omega[:, None]
    near = ((ratio > 1.0 / _SAME_DECAY[0]) & (ratio < _SAME_DECAY[1])).astype(np.float64)
    several = [np.logaddexp.reduce(each.likelihoods, axis=1) * each.shares[:, None]
               for each in found]
    total: Array = np.zeros_like(several[0])
    for number, output in enumerate(own):
        total[..., output] = sum(
            (each[..., output] * excited[:, number]) @ near.T for each in several)
    others = np.setdiff1d(np.arange(total.shape[2]), own)
    total[..., others] = total[..., list(own)].sum(axis=2, keepdims=True)
    weights: Array = np.exp(total - np.max(total, axis=0))
    # Near a resonance G is rougher than around it.
    weights[:-1] = weights[1:]
    weights[-1] = 0.0
    weights /= weights.sum(axis=0)
    return weights


def _posterior(found: _Candidates, of_decays: Array) -> tuple[Complex, Array, Array, Array]:
    """
    Return G (C, O, I), its variances due to noise and due to G itself, and the noise (C, O).

    of_decays: probabilities (A, C, O) of the decays.
    """
    within = found.likelihoods - found.likelihoods.max(axis=1, keepdims=True)
    weights = np.exp(within)
    weights *= of_decays[:, None] / weights.sum(axis=1, keepdims=True)
    weights = np.where(weights > _UNLIKELY, weights, 0.0)
    weights /= weights.sum(axis=(0, 1))
    centers, outputs, inputs = (
        found.outputs.shape[1], found.outputs.shape[3], found.covariances.shape[3])
    value: Complex = np.zeros((centers, outputs, inputs), dtype=np.complex128)
    squares, random, rest = (np.zeros(value.shape) for _ in range(3))
    noise = np.zeros((centers, outputs))
    size = found.gain ** 2
    for a in range(len(weights)):
        values, rows, columns = (
            each[a] for each in (found.eigenvalues, found.outputs, found.covariances))
        powers = np.abs(columns) ** 2
        for n, ratio in enumerate(_RATIOS):
            weight = weights[a, n]
            used = np.flatnonzero((weight > 0.0).any(axis=1))
            if not len(used):
                continue
            inverse = 1.0 / (values[used] + 1.0 / ratio)[:, :, None]
            power = found.power[used, None]
            one = (rows[used].swapaxes(1, 2) @ (columns[used].conj() * inverse)) / power[..., None]
            known = (powers[used] * inverse).sum(axis=1) / power
            # The part of the variance that is due to noise.
            due = (powers[used] * inverse ** 2).sum(axis=1) / power / ratio
            of_noise, of_all = (size[used, None] * each for each in (
                due, np.maximum(_LEVEL + 1.0 - known, due)))
            w = weight[used][:, :, None]
            value[used] += w * one
            squares[used] += w * np.abs(one) ** 2
            random[used] += w * of_noise[:, None, :]
            rest[used] += w * (of_all - of_noise)[:, None, :]
            noise[used] += weight[used] * (size[used] * found.power[used])[:, None] / ratio
    rest += np.maximum(squares - np.abs(value) ** 2, 0.0)
    return value, random, rest, noise


def _joined(several: Sequence[tuple[Complex, Array, Array, Array]],
            ) -> tuple[Complex, Array, Array]:
    """
    Return G, the radii of its confidence circles, and the noise, of several records.

    The noise of two records is independent; errors due to G itself are the same in all.
    """
    weights = [1.0 / np.maximum(random + rest, 1e-300) for _, random, rest, _ in several]
    total = np.sum(weights, axis=0)
    parts = [weight / total for weight in weights]
    value: Complex = sum(part * one[0] for part, one in zip(parts, several, strict=True))
    random = sum(part ** 2 * one[1] for part, one in zip(parts, several, strict=True))
    rest = sum(part * np.sqrt(one[2]) for part, one in zip(parts, several, strict=True))
    noise: Array = np.mean([one[3] for one in several], axis=0)
    radius = np.asarray(np.sqrt(-np.log(1.0 - CONFIDENCE_LEVEL) * (random + rest ** 2)))
    return value, radius, noise


def _hann_inputs(spectra: Sequence[_Spectrum], lines: Sequence[Integers], inputs: int) -> Complex:
    """Return the inputs (C, I, lines of all records) around C frequencies, with Hann windows."""
    return np.concatenate([each.hann[at][:, :, :inputs].swapaxes(1, 2) for each, at in
                           zip(spectra, lines, strict=True)], axis=2)
