# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Lack of fit: whether the residuals are more than noise, and the cause if one is clearly likeliest.

The columns C of each possible cause (``causes``) are compared with the residuals r by frequency,
weighted by the inverse of the noise spectrum S, the spectrum of the residuals when all causes
are fitted at once. With everything that is uncertain in the model projected out as far as the
prior allows, the scores s = C^H S^-1 r have zero mean and the covariance N if the model is right;
so s^T N^-1 s is chi-squared distributed with as many degrees of freedom as columns (a score test:
Rao 1948, doi:10.1017/S0305004100023987). Half of it is the logarithm of a likelihood ratio: a
cause is named only if it is a thousand times likelier than each other, and if it explains most.

Noise of lengths and rates is in the columns and, through those of the fit, in the residuals: both
agree in it. What it adds to scores and covariance is estimated by adding as much noise again, and
subtracted from the scores (corrected scores: Nakamura 1990, doi:10.1093/biomet/77.1.127).
Directions that are mostly this noise, or of which the projection leaves little, are not tested.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.estimation.contradiction import (
    Contradiction, deviations, UNCERTAIN, WIDENING)
from stewart_dynamics.estimation.posterior import Posterior, posterior
from stewart_dynamics.estimation.whitening import gram_of, spectra_of, Weights, weights_of
from stewart_dynamics.identification.extraction import BAND, Extract, Extracts, SAMPLES
from stewart_dynamics.identification.lack_of_fit_causes import Cause, Causes, SAME
from stewart_dynamics.identification.parameter_fit import (
    directions, Fit, least_deviation, Noisy, residual_of)
from stewart_dynamics.identification.unknowns import ORIGINS, Unknowns
from stewart_dynamics.legs import KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.possible_errors.hypothesis import likeliest

# Maximum number of extracts that are tested.
_MOST = 16
# Cut-off periods of filtered time from which the statistics are valid, in all and of each piece
# without a gap. Right models gave no notice in 200 recordings of 80 periods, but in 1 of 100 of 55
# and in 8 of 100 of 44; in 13 of 40 of three pieces of 13, and in 1 of 30 of three pieces of 22.
WHOLE, PIECE = 80, 28
# Smaller residuals, relative to the efforts, are no lack of fit: without any noise the filters
# leave 2e-5 to 5e-4 in motions below an eighth of the cut-off frequency.
LEFT_BY_FILTERS = 5e-4
# Deviation of any amount of a cause, in terms of one that noise would hide.
_ANY = 1e4
# Significance for a notice of a force that the model lacks, in standard deviations of a normal
# distribution.
_NOTICE = 7.0
# Twice the logarithm of the likelihood ratio from which a cause is named before another.
_CLEARLY = 2.0 * math.log(1000.0)
# Largest statistic that a named cause leaves, relative to its own.
_LEAVES = 0.3
# Directions with a smaller fraction of their squares left after projection are not tested.
_IN_THE_FIT = 1e-3
# Nor are those with a larger fraction of their squares due to noise of lengths and rates.
_NOISE = 0.5
# Standard deviations above which the slower causes are tested as well.
_SUSPICIOUS = 4.0
# Penalty on the statistic for each column of a cause.
_PENALTY = 4.0
# Parts of an error of the model that is not explained.
_MOST_PARTS = 6
# Rates, relative to their RMS, below which a leg reverses, and above which it is fast; ratio of
# residuals there to all that is worth a word.
_REVERSES, _FAST, _WORTH = 0.2, 1.3, 1.3
UNKNOWN = 'unknown'
_NONE: Integers = np.zeros(0, dtype=np.int64)


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
    """A lack of fit, with its cause or where it is largest."""

    cause: str  # keyword of the cause; UNKNOWN if no cause is clearly likeliest
    text: str  # the cause in words, or where the residuals are largest
    ranked: tuple[Found, ...]  # significant causes, the likeliest first
    shifts: Array
    """(k,) WIDENING times the change of each unknown: its interval is widened on both sides."""
    left: float  # fraction of the residual RMS that remains with the cause

    @property
    def unexplained(self) -> bool:
        """Return whether no cause is named."""
        return self.cause == UNKNOWN


# Kinds of numbers that may be farther from the file than their uncertainty allows.
CONTRADICTED = 'tilt', 'reflected_mass', 'leg_mass', 'effort_gain'
# Advice for each cause; file: the parameter file.
_GEOMETRY = ('calibrate the geometry, from poses that are chosen by: '
             'stewart_calibrate --design 20 --params {file}')
NEXT = {
    **{what: f'correct the file, or give a larger uncertainty.{what}' for what in CONTRADICTED},
    'effort_gain': 'check the scale of the efforts (load cells, torque constant, losses), or give '
                   'a larger uncertainty.effort_gain',
    'offset': 'zero the load cells, or add offset to --identify',
    'gain': 'check the load cell or the torque constant of this leg',
    'delay': 'check stamps and filters of the efforts of this leg',
    'saturation': 'record a slower or smaller motion',
    'payload': 'identify the part with one payload, each bag by itself',
    'stribeck_friction': 'record a motion that is slow for a smaller part of its time',
    'load_friction': 'if efforts follow from motors, give drive.efficiency and --motor-torque',
    **{kind.zero_cause.what: _GEOMETRY for kind in KINDS}, 'joint': _GEOMETRY,
    UNKNOWN: 'look at this part in the report, and compare with a recording of another motion: '
             'stewart_identify --design --seed 1 --params {file}'}


class _Explained(NamedTuple):
    """The part of the residuals that k columns explain."""

    amounts: Array  # (k,) least-squares amounts
    statistic: float
    freedom: int  # number of their directions that are not in the fit


class _Scores(NamedTuple):
    """Sums of m columns, divided by their sizes, with the model's uncertainty projected out."""

    normal: Array
    """(m, m), the covariance of the scores; the projection leaves this of 1 on the diagonal"""
    of_noise: Array  # (m, m), the part of it that is noise of lengths and rates
    scores: Array  # (m,), without what this noise adds to them
    sizes: Array  # (m,)
    follow: Array  # (n, m) change of the model's numbers by the columns
    squares: float  # sum of squared residuals
    sums: Array  # of model, columns and residuals
    noise: Array  # the part of them that is noise of lengths and rates
    at: Array  # (n,) the model's numbers at the residuals

    @classmethod
    def of(cls, sums: Array, of_noise: Array, at: Array) -> _Scores:
        """Return them from sums of the model's n directions, m columns and the residuals."""
        n, sums_of_noise = len(at), of_noise
        model = posterior((sums - of_noise)[:n, :n], (sums - of_noise)[:n, -1], at,
                          of_noise[:n, :n])
        follow = -model.covariance @ (sums - of_noise)[:n, n:-1]
        projection = np.hstack([follow.T, np.eye(follow.shape[1])])
        noise = projection @ of_noise[:-1, :-1] @ projection.T
        left = sums[n:-1, n:-1] + sums[n:-1, :n] @ follow
        scores = (sums - of_noise)[n:-1, -1] - (sums - of_noise)[n:-1, :n] @ (model.values - at)
        sizes = np.sqrt(np.diag(sums)[n:-1])
        scale = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
        normal, of_noise = (scale[:, None] * each * scale for each in (left, noise))
        return cls(normal, of_noise, scale * scores, scale, follow * scale,
                   float(sums[-1, -1]), sums, sums_of_noise, at)

    def explained(self, places: Integers) -> _Explained:
        """Return the part of the residuals that some columns explain."""
        inverse, freedom = self._inverse(places)
        amounts = inverse @ self.scores[places]
        return _Explained(self.sizes[places] * amounts, float(self.scores[places] @ amounts),
                          freedom)

    def change(self, places: Integers) -> Array:
        """Return the (n,) change of the model's numbers if some columns are added to the fit."""
        return self.follow[:, places] @ (self._inverse(places)[0] @ self.scores[places])

    def model_with(self, places: Integers) -> Posterior:
        """Return the model's numbers after the data, with any amount of some columns."""
        n = len(self.at)
        which = np.concatenate([np.arange(n), n + places])
        scale = np.concatenate([np.ones(n), _ANY * self.sizes[places]])
        scaled, noise = (scale[:, None] * each[np.ix_(which, which)] * scale
                         for each in (self.sums - self.noise, self.noise))
        vector = scale * (self.sums - self.noise)[which, -1]
        return posterior(scaled, vector, np.concatenate([self.at, np.zeros(len(places))]), noise)

    def without(self, places: Integers) -> _Scores:
        """Return the sums with some columns added to the fit."""
        projection = np.eye(len(self.scores))
        projection[:, places] -= self.normal[:, places] @ self._inverse(places)[0]
        return self._replace(normal=projection @ self.normal @ projection.T,
                             of_noise=projection @ self.of_noise @ projection.T,
                             scores=projection @ self.scores,
                             follow=self.follow @ projection.T)

    def _inverse(self, places: Integers) -> tuple[Array, int]:
        """Return the inverse of the covariance of some scores, and its rank."""
        block = np.ix_(places, places)
        values, vectors = np.linalg.eigh(self.normal[block])
        white = (vectors / np.sqrt(np.maximum(values, _IN_THE_FIT)))[:, values > _IN_THE_FIT]
        shares, turned = np.linalg.eigh(white.T @ self.of_noise[block] @ white)
        white = white @ turned[:, shares < _NOISE]
        inverse: Array = white @ white.T
        return inverse, white.shape[1]


def lack_of_fit(platform: StewartPlatform, extracts: Extracts, noisy: Noisy, unknowns: Unknowns,
                fit: Fit) -> LackOfFit | None:
    """
    Return the lack of fit; None if nothing significant is left.

    ``noisy`` has one extract of each bag again, with more noise of lengths and rates. The
    statistics are valid only if there are ``long_pieces``.
    """
    numbers = long_pieces(extracts) or range(len(extracts))
    chosen = list(_selected(numbers, len(numbers)))
    contradicted = list(_contradicted(platform.parameters.leg_kind, unknowns, fit))
    ranked: list[Found] = []
    try:
        for geometry in False, True:
            causes = Causes(platform, unknowns, fit, _of(extracts, chosen), geometry)
            of_all, scores = _scores(causes, extracts, chosen, noisy, unknowns, fit)
            ranked = _ranked(of_all, scores, _NOTICE if geometry else _SUSPICIOUS)
            if not ranked:
                break
    except (PoseError, SingularityError):
        return None
    ranked = sorted([*ranked, *(each for each, _ in contradicted)], key=lambda each: -each.gain)
    if not ranked:
        return None
    best = ranked[0]
    rivals = len({SAME.get(each.what, each.what) for _, each in likeliest(
        ((-each.gain, each) for each in ranked), math.inf, _CLEARLY, logarithms=True)}) > 1
    if len(best.places):
        rest = _ranked(of_all, scores.without(best.places), _NOTICE)
    else:  # numbers that are far from the file's
        rest, rivals = [], rivals or any(_rivals(best, of_all, scores, unknowns))
    cause, text = best.what, best.text
    if rivals or any(each.statistic > _LEAVES * best.statistic for each in rest):
        cause, text = UNKNOWN, _largest_part(platform, _of(extracts, chosen), unknowns, fit)
    if cause == UNKNOWN or not len(best.places):
        shifts = np.max([_model_error(of_all, scores, unknowns), *(
            shift for _, shift in contradicted)], axis=0)
        return LackOfFit(cause, text, tuple(ranked), WIDENING * shifts, 1.0)
    shifts = _model_error(of_all, scores, unknowns, best.what)
    return LackOfFit(cause, text, tuple(ranked), WIDENING * shifts,
                     math.sqrt(max(0.0, 1.0 - best.statistic / scores.squares)))


def _model_error(causes: Sequence[Cause], scores: _Scores, unknowns: Unknowns, named: str = '',
                 ) -> Array:
    """
    Return the change (k,) of each unknown by an error of the model.

    It is made of the causes. The first part is any of those that are significant, of the named
    kind if there is one, and the largest change counts; so may be any of those that are left
    beside the likeliest.
    """
    shifts = np.zeros(len(unknowns.start))
    for _ in range(_MOST_PARTS):
        ranked = _ranked(causes, scores, _SUSPICIOUS)
        if not ranked:
            break
        shifts += np.max([
            np.abs(unknowns.root @ scores.change(each.places)[:len(unknowns.start)])
            for each in ranked if named in ('', each.what)], axis=0)
        scores, named = scores.without(ranked[0].places), ''
    return shifts


def _contradicted(kind: LegKind, unknowns: Unknowns, fit: Fit) -> Iterator[tuple[Found, Array]]:
    """
    Yield kinds of numbers that are farther from the file than their uncertainty allows.

    The second is what their prior shifts each unknown by (k,).
    """
    for what in CONTRADICTED:
        found = Contradiction.of(fit.posterior, _places_of(unknowns, what))
        if found.significance > UNCERTAIN:
            change = unknowns.root[:, found.places] @ found.true
            shift = found.shift(fit.posterior)[:len(unknowns.start)]
            words = _in_words(kind, unknowns, what, change)
            yield Found(what, words, found.statistic, found.freedom, found.significance, _NONE,
                        ), np.abs(unknowns.root @ shift)


def _rivals(best: Found, causes: Iterable[Cause], scores: _Scores, unknowns: Unknowns,
            ) -> Iterator[Cause]:
    """Yield causes that, too, explain why a kind of numbers is far from the file's."""
    places = _places_of(unknowns, best.what)
    statistic = Contradiction.of(scores.model_with(_NONE), places).statistic
    for cause in causes:
        left = Contradiction.of(scores.model_with(cause.places), places)
        gain = statistic - left.statistic - _PENALTY * len(cause.places)
        if left.significance < UNCERTAIN and best.gain - gain < _CLEARLY:
            yield cause


def _places_of(unknowns: Unknowns, what: str) -> Integers:
    """Return the indices of the numbers z of an origin."""
    places: Integers = np.flatnonzero(unknowns.origins == ORIGINS.index(what))
    return places


def _in_words(kind: LegKind, unknowns: Unknowns, what: str, change: Array) -> str:
    """Return a change (k,) of the file's values in words."""
    if what == 'tilt':
        return f'a base tilted by {math.degrees(math.hypot(*change[-3:-1])):.3g} degrees'
    if what == 'reflected_mass':
        reflected = kind.fields['reflected_mass']
        of_rotors = [f'{each:+.3g}' for each, name in zip(change, unknowns.names, strict=True)
                     if reflected in name]
        return f'another {reflected}, {" ".join(of_rotors)} {kind.inertia_unit}'
    if what == 'effort_gain':
        return f'another gain of all efforts, by about {100.0 * change[-1]:+.2g} %'
    parts = [100.0 * each / start for each, start, name in zip(
        change, unknowns.start, unknowns.names, strict=True)
        if name.startswith(kind.weights) and start]
    return f'other masses of the legs, by about {np.mean(parts):+.3g} %'


def _ranked(causes: Sequence[Cause], scores: _Scores, significance: float) -> list[Found]:
    """Return the significant causes, the likeliest first."""
    found = []
    for cause in causes:
        amounts, statistic, freedom = scores.explained(cause.places)
        if freedom and deviations(statistic, freedom) > significance:
            found.append(Found(cause.what, cause.described(amounts), statistic, freedom,
                               deviations(statistic, freedom), cause.places))
    return sorted(found, key=lambda each: -each.gain)


def _largest_part(platform: StewartPlatform, extracts: Iterable[Extract], unknowns: Unknowns,
                  fit: Fit) -> str:
    """Return in which leg the residuals are largest, and in which part of its motion."""
    residuals, rates = (np.concatenate(each) for each in zip(*(
        ((each.columns @ residual_of(unknowns, fit.values, fit.delays[each.bag])) * each.used,
         each.legs[..., 1]) for each in extracts), strict=True))
    leg = int(np.argmax(np.sum(residuals ** 2, axis=0)))
    squares = residuals[:, leg] ** 2
    speeds = np.abs(rates[:, leg]) / (np.sqrt(np.mean(rates[:, leg] ** 2)) + 1e-300)
    parts = {word: float(np.mean(squares[which])) / float(np.mean(squares))
             for word, which in (('at reversals', speeds < _REVERSES),
                                 ('at high rates', speeds > _FAST)) if which.any()}
    word = max(parts, key=lambda each: parts[each], default='')
    return f'in {platform.parameters.joints[leg]}' + (
        f' {word}' if parts.get(word, 0.0) > _WORTH else '')


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


def _scores(causes: Causes, extracts: Extracts, chosen: Sequence[int], noisy: Noisy,
            unknowns: Unknowns, fit: Fit) -> tuple[Sequence[Cause], _Scores]:
    """
    Return the causes and the scores of their columns.

    The residuals that are left when all causes are fitted to them give the weights.
    """
    at = fit.posterior.values
    of_causes: Sequence[Cause] = ()

    def spectra(extract: Extract, times: Array) -> Array:
        """Return spectra of model, causes and residuals at times, as fractions of all."""
        nonlocal of_causes
        bag, used = extract.bag, extract.used[..., None]
        added, of_causes = causes.columns(extract, times)
        columns = extract.columns * used
        return spectra_of(np.concatenate([
            columns @ directions(
                unknowns, fit.values, fit.delays, bag, fit.delay_deviations),
            added * used,
            (columns @ residual_of(unknowns, fit.values, fit.delays[bag]))[..., None],
            ], axis=-1), BAND)

    spans: dict[int, tuple[float, float]] = {}  # of each bag, as fractions of all times
    of_extracts: list[tuple[int, Array, int, float]] = []
    gram: Array = np.zeros(())
    samples = 0
    for number, extract in zip(chosen, _of(extracts, chosen), strict=True):
        count = len(extract.times)
        ends = samples / causes.samples, (samples + count) / causes.samples
        spans[extract.bag] = spans.get(extract.bag, ends)[0], ends[1]
        each = spectra(extract, _between(*ends, count))
        gram = gram + gram_of(fit.weights[number].whitened(each))
        of_extracts.append((number, each, count, least_deviation(extract)))
        samples += count
    # a fit with all causes, which the prior of the model and pseudo-inverses keep finite
    gram[range(len(at)), range(len(at))] += 1.0
    inverse = _inverse(gram[:-1, :-1])
    rest = inverse @ gram[:-1, -1]
    weights: dict[int, Weights] = {}
    sums: Array = np.zeros_like(gram)
    for number, each, count, least in of_extracts:
        white = fit.weights[number].whitened(each)[..., :-1]
        free = 1.0 - np.sum((white @ inverse) * white, axis=-1)
        left = each[..., -1] - each[..., :-1] @ rest
        weights[number] = weights_of(left, free, count, least)
        sums = sums + gram_of(weights[number].whitened(each))
    of_noise, share = np.zeros_like(sums), 0.0
    for number, clean, more in noisy.both(extracts):
        begin, end = spans.get(clean.bag, (0.0, 1.0))
        times = _between(begin, end, len(clean.times))
        change = spectra(more, times) - spectra(clean, times)
        part = end - begin
        of_noise = of_noise + part * causes.samples / len(times) * gram_of(
            weights.get(number, fit.weights[number]).whitened(change))
        share += part
    return of_causes, _Scores.of(sums, of_noise / share, at)


def _between(begin: float, end: float, count: int) -> Array:
    """Return evenly spaced numbers, without the end."""
    numbers: Array = np.linspace(begin, end, count, endpoint=False, dtype=float)
    return numbers


def _inverse(matrix: Array) -> Array:
    """Return the pseudo-inverse of a normal matrix after scaling its columns."""
    sizes = np.sqrt(np.diag(matrix))
    scale = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    inverse: Array = scale[:, None] * np.linalg.pinv(
        scale[:, None] * matrix * scale, rcond=1e-9, hermitian=True) * scale
    return inverse
