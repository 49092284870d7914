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
Standard errors of a fit whose residuals are coloured, by a sandwich estimator.

Filtered noise of efforts, noise of lengths in the regressor, and modeling errors are correlated in
time and between legs. With N the normal matrix and e_t the weighted directions of the fit,
``cov = N^-1 (sum_t sum_s e_t E[r_t r_s^T] e_s^T) N^-1``. The inner sum is estimated in two ways:

- by frequency, from the smoothed cross spectra of the residuals of the six legs: little scatter,
  for stationary noise;
- by blocks of time (White 1980, doi:10.2307/1912934, clustered): more scatter, also for residuals
  that depend on the motion.

For each parameter the larger estimate is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.identification.extraction import Extracts
from stewart_dynamics.identification.fit import directions, Fit, without_delay
from stewart_dynamics.identification.sums import residual_of, Sums
from stewart_dynamics.identification.unknowns import Unknowns

# Half width of the smoothing of spectra, relative to the sampling rate; number of samples in the
# blocks of time, and their minimum number.
_SMOOTHING = 0.01
_BLOCK = 100
_FEWEST_BLOCKS = 15


class Errors(NamedTuple):
    """Covariance (k, k) of the unknowns, and standard errors of the delays (B,) [s]."""

    covariance: Array
    delays: Array


def errors_of(extracts: Extracts, sums: Sums, unknowns: Unknowns, fit: Fit) -> Errors:
    """Return the standard errors of a fit to the sums of extracts."""
    theta, many = unknowns.theta(fit.values), len(fit.values)
    e_of_bags, alongs, alone = [], [], []
    for bag, delay in enumerate(fit.delays):
        e = directions(unknowns, fit.values, delay, bool(fit.delay_errors[bag]))
        gram = np.tensordot(1.0 / fit.variances[bag], sums.grams[bag], axes=1)
        normal = e.T @ gram @ e
        alongs.append(without_delay(normal))
        alone.append(normal[-1, -1])
        e_of_bags.append(e)
    by_frequency = np.zeros((many, many))
    scores, own = [], np.zeros((len(fit.delays), many + 1))
    for extract in extracts:
        bag = extract.bag
        columns = extract.columns * extract.used[..., None]
        residuals = columns @ residual_of(theta, fit.delays[bag])
        weighted = columns @ e_of_bags[bag] / fit.variances[bag][:, None]
        # The delay depends on the unknowns; its own error comes from its own column.
        follow = weighted[..., :-1] + weighted[..., -1:] * alongs[bag]
        both = np.concatenate([follow, weighted[..., -1:]], axis=-1)
        middle = _by_frequency(both, residuals)
        by_frequency += middle[:-1, :-1]
        own[bag] += middle[-1]
        size = max(1, min(_BLOCK, len(residuals) // _FEWEST_BLOCKS))
        products = np.einsum('nlk,nl->nk', follow, residuals)
        scores.append(np.add.reduceat(products, np.arange(0, len(products), size), axis=0))
    score = np.concatenate(scores) if scores else np.zeros((1, many))
    by_blocks = score.T @ score * len(score) / max(len(score) - 1, 1)
    known = fit.identifiability.known
    inner = known.T @ (fit.matrix + unknowns.strength) @ known
    bread = known @ np.linalg.pinv(inner, hermitian=True) @ known.T
    candidates = [bread @ middle @ bread for middle in (by_frequency, by_blocks)]
    larger = np.sqrt(np.maximum(*(np.maximum(np.diag(each), 0.0) for each in candidates)))
    first = np.sqrt(np.maximum(np.diag(candidates[0]), 1e-300))
    scale = np.maximum(larger / first, 1.0)
    delays = np.zeros(len(fit.delays))
    for bag, (along, each) in enumerate(zip(alongs, alone, strict=True)):
        if each > 0.0:
            through = along @ bread
            delays[bag] = np.sqrt(max(0.0, through @ by_frequency @ through + (
                2.0 * through @ own[bag, :-1] + own[bag, -1] / each) / each))
    return Errors(scale[:, None] * candidates[0] * scale, delays)


def _by_frequency(weighted: Array, residuals: Array) -> Array:
    """Return the inner sum of a block from columns (N, 6, k) and residuals (N, 6)."""
    many = len(residuals)
    size = 1 << (2 * many - 1).bit_length()
    r = np.fft.rfft(residuals, size, axis=0)
    spectra = np.einsum('fi,fj->fij', r, r.conj()) / many
    smooth = smoothed(spectra, max(1, round(_SMOOTHING * size)))
    e = np.fft.rfft(weighted, size, axis=0)
    # one-sided: all frequencies except the first and the last count twice
    twice = np.full(len(e), 2.0)
    twice[0] = twice[-1] = 1.0
    first = np.einsum('fij,fjk->fik', smooth.conj(), e)
    middle = np.einsum('f,fik,fil->kl', twice, e.conj(), first, optimize=True)
    return np.asarray(middle.real / size)


def smoothed(spectra: Array, width: int) -> Array:
    """Return the running mean over 2 width + 1 frequencies, mirrored at both ends."""
    width = min(width, len(spectra) - 1)
    whole = np.concatenate([spectra[width:0:-1].conj(), spectra, spectra[-2:-width - 2:-1].conj()])
    sums = np.cumsum(np.concatenate([np.zeros((1, *spectra.shape[1:])), whole]), axis=0)
    mean: Array = (sums[2 * width + 1:] - sums[:-2 * width - 1]) / (2 * width + 1)
    return mean
