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
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
import tempfile
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.causes import Cause, Causes, UNKNOWN
from stewart_dynamics.identification.extraction import Extract, Extracts, SAMPLES
from stewart_dynamics.identification.fit import directions, Fit
from stewart_dynamics.identification.sums import residual_of
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Maximum number of extracts that are tested.
_MOST = 16
# Significance for a notice, in standard deviations of a normal distribution.
_NOTICE = 7.0
# Maximum number of causes that are named.
_CAUSES = 3
# Columns with a smaller fraction left after projection are explained by the fit.
_IN_THE_FIT = 1e-8
# Standard deviations above which the slower causes are tested as well.
_SUSPICIOUS = 4.0
# Highest frequency used, relative to the cut-off; half width of the smoothing of spectra, relative
# to the sampling rate, and its minimum in frequencies.
_BAND, _SMOOTHING, _FEWEST = 0.9, 0.0125, 8
_COLLINEAR = 1e-7
# The form of a cause, as that of Stribeck's curve, is known less well than its amount: intervals
# are widened by this multiple of the change of each unknown.
_WIDENING = 1.5
# Penalty on the statistic for each column of a cause.
_PENALTY = 4.0


class Found(NamedTuple):
    """A cause with the test statistic that it explains."""

    what: str
    text: str
    statistic: float
    """Chi-squared statistic of the scores of its columns."""
    columns: int
    deviations: float
    """Standard deviations of a normal distribution with the same probability."""
    places: Integers


class LackOfFit(NamedTuple):
    """A lack of fit and its likeliest causes."""

    causes: tuple[Found, ...]
    """Causes in the order in which they were found, the likeliest first."""
    others: tuple[Found, ...]
    """Causes that explain the residuals nearly as well as the first."""
    shifts: Array
    """(k,) amount by which the interval of each unknown is widened on both sides"""
    left: float
    """Fraction of the residual RMS that remains with the first cause."""
    unexplained: bool
    """Whether something significant remains, or the cause is unknown."""

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


class _Scores(NamedTuple):
    """Sums of m columns with the fit's columns projected out."""

    normal: Array
    """(m, m), the covariance of the scores"""
    scores: Array
    """(m,)"""
    squares: float
    """Sum of squared residuals."""

    def without(self, places: Integers) -> _Scores:
        """Return the sums with some columns added to the fit."""
        along = _inverse(self.normal[np.ix_(places, places)]) @ self.normal[places]
        normal = self.normal - self.normal[places].T @ along
        scores = self.scores - along.T @ self.scores[places]
        free = np.diag(normal) > _IN_THE_FIT * np.diag(self.normal)
        free[places] = False
        return _Scores(normal * np.outer(free, free), scores * free, self.squares)

    def amounts(self, places: Integers) -> Array:
        """Return the least-squares amounts of some columns."""
        amounts: Array = _inverse(self.normal[np.ix_(places, places)]) @ self.scores[places]
        return amounts

    def statistic(self, places: Integers) -> tuple[float, int]:
        """Return the statistic of some columns and its degrees of freedom."""
        sizes = np.sqrt(np.diag(self.normal)[places])
        usable = sizes > 0.0
        if not usable.any():
            return 0.0, 0
        places, sizes = places[usable], sizes[usable]
        values, vectors = np.linalg.eigh(
            self.normal[np.ix_(places, places)] / np.outer(sizes, sizes))
        sound = values > _COLLINEAR
        parts = (vectors.T @ (self.scores[places] / sizes))[sound]
        return float(np.sum(parts ** 2 / values[sound])), int(np.count_nonzero(sound))


def lack_of_fit(platform: StewartPlatform, extracts: Extracts, unknowns: Unknowns, fit: Fit,
                ) -> LackOfFit | None:
    """Return the lack of fit with its likeliest causes; None if nothing significant is left."""
    try:
        for geometry in (False, True):
            causes = Causes(platform, unknowns, fit, _selected(extracts), geometry)
            scores, follow, squares = _scores(causes, extracts, unknowns, fit)
            if not geometry and max(each.deviations for each in _tested(causes.all, scores)) < (
                    _SUSPICIOUS):
                return None
    except (PoseError, SingularityError):
        return None
    found: list[Found] = []
    others: tuple[Found, ...] = ()
    taken: Integers = np.zeros(0, dtype=np.int64)
    now = scores
    for turn in range(_CAUSES + 1):
        ranked = sorted((each for each in _tested(causes.all, now) if each.deviations > _NOTICE),
                        key=lambda each: each.columns * _PENALTY - each.statistic)
        if not ranked or turn == _CAUSES:
            break
        if not turn:
            gain = 0.9 * (ranked[0].statistic - _PENALTY * ranked[0].columns)
            others = tuple(each for each in ranked[1:] if each.what != ranked[0].what
                           and each.statistic - _PENALTY * each.columns > gain)
        found.append(ranked[0])
        taken = np.union1d(taken, ranked[0].places)
        now = scores.without(taken)
    if not found:
        return None
    amounts = scores.amounts(taken)
    first = squares.statistic(found[0].places)[0] / squares.squares
    return LackOfFit(tuple(found), others, _WIDENING * np.abs(follow[:, taken] @ amounts),
                     math.sqrt(max(0.0, 1.0 - first)), bool(ranked) or found[0].what == UNKNOWN)


def _tested(causes: Sequence[Cause], scores: _Scores) -> Iterator[Found]:
    for cause in causes:
        statistic, freedom = scores.statistic(cause.places)
        if freedom:
            text = cause.described(scores.amounts(cause.places))
            yield Found(cause.what, text, statistic, freedom, deviations(statistic, freedom),
                        cause.places)


def deviations(statistic: float, freedom: int) -> float:
    """
    Return a chi-squared value as standard deviations of a normal distribution.

    Uses the cube-root approximation (Wilson and Hilferty 1931, doi:10.1073/pnas.17.12.684).
    """
    part = 2.0 / (9.0 * freedom)
    return float((np.cbrt(statistic / freedom) - 1.0 + part) / math.sqrt(part))


def _selected(extracts: Extracts) -> Iterator[Extract]:
    """Yield the extracts that are tested, at most _MOST, evenly spread."""
    tested = np.linspace(0, len(extracts) - 1, min(_MOST, len(extracts))).astype(int)
    return (extract for n, extract in enumerate(extracts) if n in tested)


def _scores(causes: Causes, extracts: Extracts, unknowns: Unknowns, fit: Fit,
            ) -> tuple[_Scores, Array, _Scores]:
    """Return weighted sums, derivatives of unknowns by columns (k, m), and plain sums."""
    theta, bags = unknowns.theta(fit.values), len(fit.delays)
    known = fit.identifiability.known
    inner = known.shape[1] + bags  # known directions, then the delays
    with tempfile.TemporaryFile() as file:
        gram: Array = np.zeros(())
        plain: Array = np.zeros(())
        lengths: list[int] = []
        for extract in _selected(extracts):
            bag, used = extract.bag, extract.used[..., None]
            columns = extract.columns * used
            e = columns @ directions(unknowns, fit.values, fit.delays[bag],
                                     bool(fit.delay_errors[bag]))
            delays = np.zeros((*e.shape[:2], bags))
            delays[..., bag] = e[..., -1]
            residuals = columns @ residual_of(theta, fit.delays[bag])
            of_causes = causes.columns(extract, sum(lengths)) * used
            whole = np.concatenate(
                [e[..., :-1] @ known, delays, of_causes, residuals[..., None]], axis=-1)
            sizes = np.sqrt(fit.variances[bag])[:, None]
            spectra = _spectra(whole / sizes)
            flat = spectra.reshape(-1, spectra.shape[-1])
            gram = gram + flat.T @ flat
            flat = (sizes * spectra).reshape(flat.shape)
            plain = plain + flat.T @ flat
            np.save(file, spectra)
            lengths.append(len(whole))
        # First weight by leg alone, as in the fit, then by the spectra of the residuals.
        inverse = _inverse(gram[:-1, :-1])
        rest = inverse @ gram[:-1, -1]
        file.seek(0)
        weighted = np.zeros_like(gram)
        for samples in lengths:
            flat = _whitened(np.load(file), rest, inverse, samples).reshape(-1, len(gram))
            weighted += flat.T @ flat
    follow = -_inverse(gram[:inner, :inner]) @ gram[:inner, inner:-1]

    def beside_the_fit(sums: Array) -> _Scores:
        found = _Scores(sums[:-1, :-1], sums[:-1, -1], float(sums[-1, -1])).without(
            np.arange(inner))
        return found._replace(normal=found.normal[inner:, inner:], scores=found.scores[inner:])

    return (beside_the_fit(weighted), known @ follow[:known.shape[1]], beside_the_fit(plain))


def _spectra(columns: Array) -> Array:
    """Return real and imaginary parts (F, 2, 6, m) at frequencies below the cut-off."""
    many = len(columns)
    spectra = np.fft.rfft(columns, axis=0)[:int(many * _BAND / SAMPLES) + 1]
    # one-sided: all frequencies except the first count twice
    spectra *= np.sqrt(2.0 / many)
    spectra[0] *= np.sqrt(0.5)
    parts: Array = np.stack([spectra.real, spectra.imag], axis=1)
    return parts


def _whitened(spectra: Array, rest: Array, inverse: Array, samples: int) -> Array:
    """Return the columns (F, 2, 6, m), whitened by the residuals of a fit with all causes."""
    left = spectra[..., -1] - spectra[..., :-1] @ rest
    # The fit of the columns reduces the variance of a residual below the noise variance.
    flat = spectra[..., :-1].reshape(-1, len(rest))
    free = 1.0 - np.sum((flat @ inverse) * flat, axis=1).reshape(left.shape)
    width = max(_FEWEST, round(_SMOOTHING * samples))
    power, share = (_smoothed(each.sum(axis=1), width) for each in (left ** 2, free))
    deviations = np.sqrt(power / np.maximum(share, 1e-3 * 4 * width) + 1e-30)
    white = left / deviations[:, None]
    along = white.reshape(-1, 6)
    correlation = along.T @ along
    sizes = np.sqrt(np.diag(correlation))
    correlation /= np.outer(sizes, sizes)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors / np.sqrt(np.maximum(values, 0.05)) @ vectors.T
    result: Array = root @ (spectra / deviations[:, None, :, None])
    return result


def _smoothed(values: Array, width: int) -> Array:
    """Return running sums (F, 6) over 2 width + 1 frequencies, mirrored at both ends."""
    width = min(width, len(values) - 1)
    whole = np.concatenate([values[width:0:-1], values, values[-2:-width - 2:-1]])
    sums = np.cumsum(np.concatenate([np.zeros((1, values.shape[1])), whole]), axis=0)
    smooth: Array = sums[2 * width + 1:] - sums[:-2 * width - 1]
    return smooth


def _inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of a normal matrix after scaling its columns."""
    sizes = np.sqrt(np.diag(matrix))
    scale = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    inverse: Array = scale[:, None] * np.linalg.pinv(
        scale[:, None] * matrix * scale, rcond=1e-9, hermitian=True) * scale
    return inverse
