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
Lack of fit: whether the residuals are more than noise, and the likeliest cause.

The columns C of each possible cause (``causes``) are compared with the residuals r by frequency,
weighted by the inverse of the noise spectrum S, the spectrum of the residuals when all causes
are fitted at once. With the columns of the fit projected out, the scores s = C^H S^-1 r have zero
mean and the covariance N = C^H S^-1 C if the model is right; so s^T N^-1 s is chi-squared
distributed with as many degrees of freedom as columns (a score test: Rao 1948,
doi:10.1017/S0305004100023987). The cause that explains most is selected first; further causes are
added to it until nothing significant is left.

Noise of lengths and rates is in the columns and, through those of the fit, in the residuals: both
agree in it. What it adds to scores and covariance is estimated by adding as much noise again, and
subtracted from the scores (corrected scores: Nakamura 1990, doi:10.1093/biomet/77.1.127).
Directions that are mostly this noise, or of which the projection leaves little, are not tested.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
import math
import tempfile
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.causes import Cause, Causes, Factors, UNKNOWN
from stewart_dynamics.identification.extraction import Extract, Extracts, SAMPLES
from stewart_dynamics.identification.fit import directions, Fit, smoothed
from stewart_dynamics.identification.sums import residual_of
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Maximum number of extracts that are tested.
_MOST = 16
# Cut-off periods of filtered time from which the statistics are valid, in all and of each piece
# without a gap. Right models gave no notice in 200 recordings of 80 periods, but in 1 of 100 of 55
# and in 8 of 100 of 44; in 13 of 40 of three pieces of 13, and in 1 of 30 of three pieces of 22.
WHOLE, PIECE = 80, 28
# Smaller residuals, relative to the efforts, are no lack of fit: without any noise the filters
# leave 2e-5 to 5e-4 in motions below an eighth of the cut-off frequency.
LEFT_BY_FILTERS = 5e-4
# Significance for a notice, in standard deviations of a normal distribution.
_NOTICE = 7.0
# Maximum number of causes that are named.
_CAUSES = 3
# Directions with a smaller fraction of their squares left after projection are not tested.
_IN_THE_FIT = 1e-3
# Nor are those with a larger fraction of their squares due to noise of lengths and rates.
_NOISE = 0.5
# Standard deviations above which the slower causes are tested as well.
_SUSPICIOUS = 4.0
# Highest frequency used, relative to the cut-off; half width of the smoothing of spectra, relative
# to the sampling rate, and its minimum in frequencies.
_BAND, _SMOOTHING, _FEWEST = 0.9, 0.0125, 8
# Least variance of a residual that the fit of all causes leaves, of 2 in each frequency.
_LEAST_FREE = 2e-3
# The form of a cause, as that of Stribeck's curve, is known less well than its amount: intervals
# are widened by this multiple of the change of each unknown.
_WIDENING = 1.5
# Penalty on the statistic for each column of a cause; a cause with this part of the likeliest
# one's gain is named beside it.
_PENALTY, _AS_LIKELY = 4.0, 0.9


class Found(NamedTuple):
    """A cause with the test statistic that it explains."""

    what: str
    text: str
    statistic: float  # chi-squared statistic of the scores of its columns
    columns: int
    deviations: float  # standard deviations of a normal distribution with the same probability
    places: Integers

    @property
    def gain(self) -> float:
        """Return the statistic less the penalty."""
        return self.statistic - _PENALTY * self.columns


class LackOfFit(NamedTuple):
    """A lack of fit and its likeliest causes."""

    causes: tuple[Found, ...]  # causes in the order in which they were found, the likeliest first
    others: tuple[Found, ...]  # causes that explain the residuals nearly as well as the first
    shifts: Array  # (k,) amount by which the interval of each unknown is widened on both sides
    left: float  # fraction of the residual RMS that remains with the first cause
    unexplained: bool  # whether something significant remains, or the cause is unknown

    @property
    def text(self) -> str:
        """Return the notice in one line."""
        first, *others = self.causes
        also = '; or '.join(dict.fromkeys(each.text for each in self.others))
        kinds = IDENTIFY.get(first.what)
        return (
            'the residuals are more than noise'
            + (': the cause is not found' if first.what == UNKNOWN else
               f': likely {first.text}')
            + (f'; or {also}' if also else '')
            + (f'; and {"; and ".join(each.text for each in others)}' if others else '')
            + (f'; {kinds} in --identify takes it into account' if kinds else '')
            + ('; no intervals are given' if self.unexplained else
               '; the intervals are widened by what it changes'))


# Values of --identify that take a likely cause into account.
IDENTIFY = {'offset': 'offset', 'tilt': 'tilt', 'reflected_mass': 'reflected_mass',
            'leg_mass': 'cylinder,piston', 'platform': 'platform',
            'viscous_friction': 'viscous_friction', 'coulomb_friction': 'coulomb_friction'}


class _Explained(NamedTuple):
    """The part of the residuals that k columns explain."""

    amounts: Array  # (k,) least-squares amounts
    statistic: float
    freedom: int  # number of their directions that are not in the fit


class _Scores(NamedTuple):
    """Sums of m columns, divided by their sizes, with the fit's columns projected out."""

    normal: Array
    """(m, m), the covariance of the scores; the projection leaves this of 1 on the diagonal"""
    of_noise: Array  # (m, m), the part of it that is noise of lengths and rates
    scores: Array  # (m,), without what this noise adds to them
    sizes: Array  # (m,)
    squares: float  # sum of squared residuals

    @classmethod
    def of(cls, sums: Array, of_noise: Array, inner: int) -> _Scores:
        """Return them from sums of the fit's inner columns, m columns and the residuals."""
        projection = np.hstack([
            -(_inverse(sums[:inner, :inner]) @ sums[:inner, inner:]).T,
            np.eye(len(sums) - inner)])
        left, noise = (projection @ each @ projection.T for each in (sums, of_noise))
        sizes = np.sqrt(np.diag(sums)[inner:-1])
        scale = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
        normal, of_noise = (scale[:, None] * each[:-1, :-1] * scale for each in (left, noise))
        return cls(normal, of_noise, scale * (left - noise)[:-1, -1], scale, float(sums[-1, -1]))

    def explained(self, places: Integers) -> _Explained:
        """Return the part of the residuals that some columns explain."""
        inverse, freedom = self._inverse(places)
        amounts = inverse @ self.scores[places]
        return _Explained(self.sizes[places] * amounts, float(self.scores[places] @ amounts),
                          freedom)

    def without(self, places: Integers) -> _Scores:
        """Return the sums with some columns added to the fit."""
        projection = np.eye(len(self.scores))
        projection[:, places] -= self.normal[:, places] @ self._inverse(places)[0]
        return self._replace(normal=projection @ self.normal @ projection.T,
                             of_noise=projection @ self.of_noise @ projection.T,
                             scores=projection @ self.scores)

    def _inverse(self, places: Integers) -> tuple[Array, int]:
        """Return the inverse of the covariance of some scores, and its rank."""
        block = np.ix_(places, places)
        values, vectors = np.linalg.eigh(self.normal[block])
        white = (vectors / np.sqrt(np.maximum(values, _IN_THE_FIT)))[:, values > _IN_THE_FIT]
        shares, turned = np.linalg.eigh(white.T @ self.of_noise[block] @ white)
        white = white @ turned[:, shares < _NOISE]
        inverse: Array = white @ white.T
        return inverse, white.shape[1]


def lack_of_fit(platform: StewartPlatform, extracts: Extracts, moving: Sequence[int],
                noisy: Extracts, unknowns: Unknowns, fit: Fit) -> LackOfFit | None:
    """
    Return the lack of fit with its likeliest causes; None if nothing significant is left.

    ``noisy`` has one extract of each bag again, of the number in ``moving``, with more noise of
    lengths and rates. The statistics are valid only if there are ``long_pieces``.
    """
    numbers = long_pieces(extracts) or range(len(extracts))
    chosen = list(_selected(numbers, len(numbers)))

    def tested(geometry: bool) -> tuple[Sequence[Cause], _Scores, Array, _Scores]:
        causes = Causes(platform, unknowns, fit, _of(extracts, chosen), geometry)
        return _scores(causes, extracts, chosen, moving, noisy, unknowns, fit)

    try:
        causes, scores, _, _ = tested(geometry=False)
        if not _ranked(causes, scores, _SUSPICIOUS):
            return None
        causes, scores, follow, plain = tested(geometry=True)
    except (PoseError, SingularityError):
        return None
    likely = ranked = _ranked(causes, scores, _NOTICE)
    if not likely:
        return None
    found: list[Found] = []
    while ranked and len(found) < _CAUSES:
        found.append(ranked[0])
        taken: Integers = np.unique(np.concatenate([each.places for each in found]))
        ranked = _ranked(causes, scores.without(taken), _NOTICE)
    best = found[0]
    others = tuple(each for each in likely if each.what != best.what
                   and each.gain > _AS_LIKELY * best.gain)
    of_best = plain.explained(best.places).statistic / plain.squares
    shifts = np.abs(follow[:, taken] @ scores.explained(taken).amounts)
    return LackOfFit(tuple(found), others, _WIDENING * shifts,
                     math.sqrt(max(0.0, 1.0 - of_best)), bool(ranked) or best.what == UNKNOWN)


def _ranked(causes: Sequence[Cause], scores: _Scores, significance: float) -> list[Found]:
    """Return the significant causes, the likeliest first."""
    found = []
    for cause in causes:
        amounts, statistic, freedom = scores.explained(cause.places)
        if freedom and deviations(statistic, freedom) > significance:
            found.append(Found(cause.what, cause.described(amounts), statistic, freedom,
                               deviations(statistic, freedom), cause.places))
    return sorted(found, key=lambda each: -each.gain)


def deviations(statistic: float, freedom: int) -> float:
    """
    Return a chi-squared value as standard deviations of a normal distribution.

    Uses the cube-root approximation (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684).
    """
    part = 2.0 / (9.0 * freedom)
    return float((np.cbrt(statistic / freedom) - 1.0 + part) / math.sqrt(part))


def long_pieces(extracts: Extracts) -> list[int]:
    """
    Return the numbers of the extracts that can be tested; none if too little of all is used.

    Pieces at rest are tested only if nothing else is there: friction has any value in them.
    """
    lengths = [used.sum(axis=0).min() / SAMPLES if moves or not any(extracts.moves) else 0.0
               for moves, used in zip(extracts.moves, extracts.used, strict=True)]
    numbers = [n for n, periods in enumerate(lengths) if periods >= PIECE]
    return numbers if sum(lengths[n] for n in numbers) >= WHOLE else []


def _selected(each: Iterable[Any], count: int) -> Iterator[Any]:
    """Yield at most _MOST of some things, evenly spread."""
    tested = np.linspace(0, count - 1, min(_MOST, count)).astype(int)
    return (one for n, one in enumerate(each) if n in tested)


def _of(extracts: Extracts, numbers: Container[int]) -> Iterator[Extract]:
    return (each for n, each in enumerate(extracts) if n in numbers)


def _scores(causes: Causes, extracts: Extracts, chosen: Container[int], moving: Sequence[int],
            noisy: Extracts, unknowns: Unknowns, fit: Fit,
            ) -> tuple[Sequence[Cause], _Scores, Array, _Scores]:
    """
    Return the causes, weighted sums, derivatives of unknowns by columns (k, m), and plain sums.

    The spectra of the chosen extracts are weighted by leg, as in the fit, and kept in a file. The
    residuals that are left when all causes are fitted to them give the weights of each frequency.
    """
    known = fit.identifiability.known
    of_causes: Sequence[Cause] = ()
    factors: Factors = np.ones_like
    inner = known.shape[1] + len(fit.delays)  # known directions, then the delays

    def spectra_of(extract: Extract, at: Array) -> Array:
        """Return the spectra of an extract at times, as fractions of all."""
        nonlocal of_causes, factors
        bag, used = extract.bag, extract.used[..., None]
        columns = extract.columns * used
        e = columns @ directions(
            unknowns, fit.values, fit.delays[bag], bool(fit.delay_errors[bag]))
        delays = np.zeros((*e.shape[:2], len(fit.delays)))
        delays[..., bag] = e[..., -1]
        added, of_causes, factors = causes.columns(extract)
        added *= factors(at)[:, None]
        residuals = columns @ residual_of(unknowns.theta(fit.values), fit.delays[bag])
        return _spectra(np.concatenate([
            e[..., :-1] @ known, delays, added * used, residuals[..., None]],
            axis=-1) / np.sqrt(fit.variances[bag])[:, None])

    lengths: list[int] = []
    spans: dict[int, tuple[float, float]] = {}  # of each bag, as fractions of all times
    gram: Array = np.zeros(())
    plain: Array = np.zeros(())
    weighted: Array = np.zeros(())
    of_noise: Array = np.zeros(())
    with tempfile.TemporaryFile() as file:
        for extract in _of(extracts, chosen):
            first, count = sum(lengths), len(extract.times)
            ends = first / causes.samples, (first + count) / causes.samples
            spans[extract.bag] = spans.get(extract.bag, ends)[0], ends[1]
            spectra = spectra_of(extract, _between(*ends, count))
            gram = gram + _gram(spectra)
            plain = plain + _gram(np.sqrt(fit.variances[extract.bag])[:, None] * spectra)
            np.save(file, spectra)
            lengths.append(count)
        file.seek(0)
        inverse = _inverse(gram[:-1, :-1])
        rest = inverse @ gram[:-1, -1]
        for samples in lengths:
            spectra = np.load(file)
            weighted = weighted + _gram(_whitened(spectra, spectra, rest, inverse, samples))
    share = 0.0
    clean_ones = zip(_of(extracts, moving), noisy, strict=True)
    for clean, more in _selected(clean_ones, len(noisy)):
        # Over the time of the whole bag: at rest friction is noise, in motion it is not.
        begin, end = spans.get(clean.bag, (0.0, 1.0))
        at = _between(begin, end, len(clean.times))
        spectra = spectra_of(clean, at)
        of_noise = of_noise + (end - begin) * causes.samples / len(clean.times) * _gram(_whitened(
            spectra_of(more._replace(used=clean.used), at) - spectra, spectra, rest, inverse,
            len(clean.times)))
        share += end - begin
    of_noise /= share
    follow = -_inverse(gram[:inner, :inner]) @ gram[:inner, inner:-1]
    return (of_causes, _Scores.of(weighted, of_noise, inner), known @ follow[:known.shape[1]],
            _Scores.of(plain, np.zeros_like(plain), inner))


def _between(begin: float, end: float, count: int) -> Array:
    """Return evenly spaced numbers, without the end."""
    numbers: Array = np.linspace(begin, end, count, endpoint=False, dtype=float)
    return numbers


def _spectra(columns: Array) -> Array:
    """Return real and imaginary parts (F, 2, 6, m) at frequencies below the cut-off."""
    count = len(columns)
    spectra = np.fft.rfft(columns, axis=0)[:int(count * _BAND / SAMPLES) + 1]
    # one-sided: all frequencies except the first count twice
    spectra *= np.sqrt(2.0 / count)
    spectra[0] *= np.sqrt(0.5)
    parts: Array = np.stack([spectra.real, spectra.imag], axis=1)
    return parts


def _gram(spectra: Array) -> Array:
    flat = spectra.reshape(-1, spectra.shape[-1])
    gram: Array = flat.T @ flat
    return gram


def _whitened(columns: Array, spectra: Array, rest: Array, inverse: Array, samples: int) -> Array:
    """Return columns (F, 2, 6, m), whitened by the residuals of a fit with all causes."""
    left = spectra[..., -1] - spectra[..., :-1] @ rest
    # The fit of the columns reduces the variance of a residual below the noise variance.
    flat = spectra[..., :-1].reshape(-1, len(rest))
    free = 1.0 - np.sum((flat @ inverse) * flat, axis=1).reshape(left.shape)
    width = max(_FEWEST, round(_SMOOTHING * samples))
    power, share = (smoothed(each.sum(axis=1), width) for each in (left ** 2, free))
    deviations = np.sqrt(power / np.maximum(share, _LEAST_FREE) + 1e-30)
    white = left / deviations[:, None]
    along = white.reshape(-1, 6)
    correlation = along.T @ along
    sizes = np.sqrt(np.outer(np.diag(correlation), np.diag(correlation)))
    # A leg of which nothing is used has no residuals.
    correlation = np.divide(correlation, sizes, out=np.eye(6), where=sizes > 0.0)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors / np.sqrt(np.maximum(values, 0.05)) @ vectors.T
    result: Array = root @ (columns / deviations[:, None, :, None])
    return result


def _inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of a normal matrix after scaling its columns."""
    sizes = np.sqrt(np.diag(matrix))
    scale = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    inverse: Array = scale[:, None] * np.linalg.pinv(
        scale[:, None] * matrix * scale, rcond=1e-9, hermitian=True) * scale
    return inverse
