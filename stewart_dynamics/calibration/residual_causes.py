# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Residuals of a calibration that are more than noise, and their likeliest cause.

Each cause that is tried adds terms to the residuals: ``r = X dv + C a + e``, with the derivatives
X by the unknowns v, the noise e of the fit up to a common factor, and amplitudes a that are normal
with mean 0 and standard deviation tau. Its evidence is the logarithm of the Bayes factor against
noise alone: that of the restricted likelihoods, in which X and the factor of the noise are
integrated out, averaged over tau, and over the rules of a cause that has several. With whitened X,
C and r, free of X (A and z, m rows less the n directions of X), lambda and U those of A^T A:

    log B(tau) = -1/2 (sum log(1 + tau^2 lambda) + (m - n) log(1 - sum tau^2 (U^T A^T z)^2
                 / (1 + tau^2 lambda) / z^T z))

(D. A. Harville, "Bayesian inference for variance components using only error contrasts",
Biometrika 61(2), 1974, doi:10.1093/biomet/61.2.383; R. E. Kass, A. E. Raftery, "Bayes factors",
J. American Statistical Association 90(430), 1995, doi:10.1080/01621459.1995.10476572).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.calibration_errors import DEVICE_SCALE, LEG_SCALE
from stewart_dynamics.calibration.equations import Equations, GEOMETRY, PLATFORM
from stewart_dynamics.calibration.geometry_fit import Fit, Unknowns
from stewart_dynamics.calibration.noise import covariances, whitening
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.possible_errors.hypothesis import likeliest, PossibleError

# Something is named if its Bayes factor against noise is larger; its cause, if the Bayes factor
# against every other cause is larger than the second.
_NAMED, _CLEARLY = math.log(1e3), math.log(20.0)
# Standard deviations tau by those of the residuals, as the effect of a term in the residuals.
_SQUARES = np.geomspace(0.3, 10.0, 12) ** 2
# Given noise is too small if noise has such residuals with a smaller probability.
_PROBABILITY = 1e-6
# Smaller residuals, by the characteristic length, are rounding; relative squares that are zero.
_ROUNDING, _DEPENDENT = 1e-12, 1e-13
# Terms of which a smaller part is not explained by the unknowns are explained. Smaller moves of a
# leg, by the residuals, can be noise.
_SEEN, _MOVE = 1e-6, 10.0
# Numbers of poses on either side of a split at least, and of splits of one quantity at most.
_FEWEST, _SPLITS = 2, 19
_LEAST_POSES = 8  # fewer have too few residuals to say why
_ALL = 'all legs'
_ALIKE = f'{_ALL} alike'
# The joints decide between the scales of legs and of the device if they move by half as much.
_NEARER = 0.5
_SCALE, _DEVICE = LEG_SCALE, DEVICE_SCALE
_FIXED, _EITHER, _TURNS, _DEFLECTION, _POSE, _DRIFT, _PLAY, _NOISE = (
    'fixed', 'scale_or_device', 'turns', 'deflection', 'pose', 'drift', 'play', 'noise')
_UNEXPLAINED = 'unexplained'
_LACKS = {
    _FIXED: 'the fixed values are not those of the hexapod',
    _SCALE: 'positions off by scale, from {scale}',
    _DEVICE: 'positions of the device off by scale, from its calibration or its target',
    _EITHER: 'the scale of all legs, from {short}, or that of the device: the joints of '
             'the file do not decide which',
    _TURNS: 'positions follow the turns of the legs about their axes, as those of drives whose '
            'screws turn with the legs (--drive-positions, drive.*)',
    _DEFLECTION: 'residuals follow the {force}, from deflection',
    _POSE: 'residuals depend on the pose, from joints without a common center or deflection',
    _DRIFT: 'residuals drift from the first pose to the last',
    _PLAY: 'play, a loose joint or encoder',
    _UNEXPLAINED: 'not explained'}
_SIDES = ('its static force', *(f'the pose ({each})' for each in (
    'x', 'y', 'z', 'alpha', 'beta', 'gamma')), 'its position', 'its move to the pose')


class _Residuals(NamedTuple):
    """Whitened residuals of some legs, free of the directions of the unknowns."""

    whiten: Array  # (N, m, m)
    known: Array  # (N m, n): directions of the unknowns, orthonormal
    left: Array  # (N m,) of RMS 1 by degrees of freedom
    deviation: float  # of which the whitened residuals are multiples
    freedom: int

    @classmethod
    def of(cls, found: Fit, unknowns: Unknowns, legs: Sequence[int]) -> _Residuals:
        """Return the residuals of a fit."""
        lin = found.lin
        whiten = whitening(covariances(found.noise, unknowns.size, lin)[:, legs][:, :, legs])
        rows = (whiten @ (lin.derivatives[:, legs] @ (
            unknowns.scales[:, None] * unknowns.basis))).reshape(len(whiten) * len(legs), -1)
        known, sizes, _ = np.linalg.svd(
            rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300), full_matrices=False)
        known = known[:, sizes ** 2 > _DEPENDENT * sizes.max(initial=0.0) ** 2]
        r = (whiten @ lin.residuals[:, legs, None]).ravel()
        r = r - known @ (known.T @ r)
        freedom = len(r) - known.shape[1]
        deviation = max(math.sqrt(float(r @ r) / max(freedom, 1)), 1e-300)
        return cls(whiten, known, r / deviation, deviation, freedom)

    def free(self, terms: Array) -> Array:
        """Return terms (N, m, k) whitened, and free of the unknowns' directions (N m, k)."""
        rows = (self.whiten @ terms).reshape(len(self.left), -1)
        free = rows - self.known @ (self.known.T @ rows)
        seen = np.linalg.norm(free, axis=0) > _SEEN * np.linalg.norm(rows, axis=0)
        return np.asarray(free[:, seen])

    def of_terms(self, terms: Array) -> float:
        """Return the evidence of terms (N, m, k) with amplitudes of one deviation."""
        free = self.free(terms)
        if not free.size:
            return 0.0
        free = free * (math.sqrt(len(self.whiten)) / np.linalg.norm(free, axis=0))
        squares, directions = np.linalg.eigh(free.T @ free)
        return float(self._evidence(np.maximum(squares, 0.0), directions.T @ (free.T @ self.left)))

    def of_each(self, terms: Array) -> tuple[Array, Array]:
        """Return the evidence of each of k terms, and its amplitude [m by the term's unit]."""
        free = self.free(terms)
        if not free.size:
            return np.zeros(1), np.zeros(1)
        sizes, count = np.linalg.norm(free, axis=0), len(self.whiten)
        along = self.left @ free / sizes
        return self._evidence(np.full((len(sizes), 1), float(count)),
                              math.sqrt(count) * along[:, None]), self.deviation * along / sizes

    def of_noise(self, leg: int) -> float:
        """Return the evidence of one leg's own noise, less where noise has heavy tails."""
        own = self.whiten[:, :, leg]
        known = np.einsum('na,nak->nk', own, self.known.reshape(*own.shape, -1))
        along = np.sum(own * self.left.reshape(own.shape), axis=1)
        squares = np.sum(own ** 2, axis=1)
        found = []
        for square in _SQUARES / float(squares.mean()):
            weights = square / (1.0 + square * squares)
            matrix = np.eye(known.shape[1]) - known.T @ (weights[:, None] * known)
            vector = known.T @ (weights * along)
            left = self.freedom - weights @ along ** 2 - vector @ np.linalg.solve(matrix, vector)
            found.append(self._log(
                np.sum(np.log1p(square * squares)) + np.linalg.slogdet(matrix)[1], left))
        each = self.left.reshape(own.shape)
        each = each / np.sqrt(np.mean(each ** 2, axis=0))
        # The variance of a sample variance, by that of normal noise.
        return float(_mean(np.array(found)) / max(0.5 * (np.mean(each ** 4) - 1.0), 1.0))

    def _evidence(self, squares: Array, along: Array) -> Array:
        """Return the evidence of terms (..., k) with A^T A and A^T z along its directions."""
        tau = _SQUARES.reshape(-1, *[1] * squares.ndim)
        ratios = 1.0 + tau * squares
        return np.asarray(_mean(self._log(np.sum(np.log(ratios), axis=-1), self.freedom - np.sum(
            tau * along ** 2 / ratios, axis=-1))))

    def _log(self, determinant: Array, left: Array) -> Array:
        return np.asarray(-0.5 * (determinant + self.freedom * np.log(
            np.maximum(left / self.freedom, 1e-12))))


def _mean(logarithms: Array) -> Any:
    """Return the logarithm of the mean of numbers with these logarithms (n, ...)."""
    largest = logarithms.max(axis=0)
    return largest + np.log(np.mean(np.exp(logarithms - largest), axis=0))


class _Cause(NamedTuple):
    what: str
    legs: tuple[int, ...]
    text: str


def lack_of_fit(platform: StewartPlatform, equations: Equations, found: Fit, unknowns: Unknowns,
                fixed: Flags, whitened: Array | None) -> tuple[PossibleError, ...]:
    """
    Return the causes of residuals that are more than noise, the likeliest first.

    ``equations`` are N poses without outliers, ``found`` a fit to them, ``fixed`` (n,) the
    numbers that keep the file's values, and ``whitened`` (N, 6) residuals by the noise that was
    given. A leg with a cause is left out before others are looked for.
    """
    from scipy.stats import chi2

    deviation = math.sqrt(np.mean(found.lin.residuals ** 2))
    if len(equations.positions) < _LEAST_POSES or deviation < _ROUNDING * unknowns.size or (
            found.lin.lever * equations.positions.std(axis=0).max() < _MOVE * deviation):
        return ()  # a few poses, rounding errors, or one and the same pose
    terms, sides = _terms(platform, equations, found, fixed)
    scales = _scales(equations, found, unknowns)
    names = platform.parameters.joints
    rms = 1e6 * np.sqrt(np.mean(found.lin.residuals ** 2, axis=0))  # [um]
    scatter = [f'{name} (residuals of {each:.3g} um, {np.median(rms):.3g} um in the median leg)'
               for name, each in zip(names, rms, strict=True)]
    legs, causes = [*range(6)], []
    while legs:
        residuals = _Residuals.of(found, unknowns, legs)
        if residuals.freedom < 1:
            break
        alike = sorted(likeliest(((-evidence, cause) for evidence, cause in chain(_causes(
            residuals, legs, equations.legs.of_a_leg, terms, sides, names, scatter), (
            (residuals.of_terms(each[:, legs]), _Cause(what, tuple(legs), (
                f'{_ALIKE} ({-residuals.of_each(each[:, legs])[1][0]:+.2%})')))
            for what, each in scales.items()))), -_NAMED, _CLEARLY, logarithms=True))
        if not alike:
            break
        best = alike[0][1]
        likely = dict.fromkeys(each.what for _, each in alike)
        if likely.keys() == {_SCALE, _DEVICE}:
            causes.append((_EITHER, best.text))
        else:
            causes.append((best.what, best.text) if len(likely) == 1 else (
                _UNEXPLAINED, f'{best.text}, {" or ".join(likely)}'))
        legs = [leg for leg in legs if leg not in best.legs]
    legs_of_file = equations.legs
    words = {'scale': legs_of_file.scale_cause, 'short': legs_of_file.scale_short,
             'force': legs_of_file.force_words}
    lacks = [PossibleError(what, f'{_LACKS[what].format_map(words)}: ' + ', '.join(
        text for each, text in causes if each == what))
        for what in dict.fromkeys(what for what, _ in causes)]
    if whitened is not None and not lacks:
        rest = max(whitened.size - found.identifiability.rank, 1)
        square = float(np.sum(whitened ** 2))
        if chi2.sf(square, rest) < _PROBABILITY:
            lacks.append(PossibleError(_NOISE, 'the residuals are '
                                       f'{math.sqrt(square / rest):.2g} times the noise that was '
                                       'given'))
    return tuple(lacks)


def _scales(equations: Equations, found: Fit, unknowns: Unknowns) -> dict[str, Array]:
    """
    Return the terms (N, 6, 1) of the scale of all legs alike, and of that of the device.

    With all joints free both are the same: a device of another scale measures a hexapod of another
    size. The one that leaves the joints much nearer to the file is kept, or both.
    """
    pose = equations.pose.position @ equations.frames_at(found.values).device.rotation.T
    terms = {_SCALE: (-found.lin.drives * equations.positions)[..., None],
             _DEVICE: -np.sum(found.lin.position * pose[:, None], axis=-1)[..., None]}
    rows = found.lin.derivatives.reshape(-1, len(unknowns.scales)) @ (
        unknowns.scales[:, None] * unknowns.basis)
    moved = {}
    for what, term in terms.items():
        size = max(float(np.abs(term).max()), 1e-300)
        change, *_ = np.linalg.lstsq(np.column_stack([rows, term.ravel() / size]),
                                     -found.lin.residuals.ravel(), rcond=None)
        values = found.values + unknowns.scales * (unknowns.basis @ change[:-1])
        moved[what] = float(np.linalg.norm((values - unknowns.start)[:PLATFORM.stop]))
    return {what: term for what, term in terms.items()
            if _NEARER * moved[what] <= min(moved.values())}


def _terms(platform: StewartPlatform, equations: Equations, found: Fit, fixed: Flags,
           ) -> tuple[dict[str, Array], list[Array]]:
    """Return the terms (N, 6, k) of each cause, and quantities (N, 6) that give sides of play."""
    count = len(equations.positions)
    pose = equations.in_base(equations.frames_at(found.values))
    seen = np.concatenate([pose.position, to_euler(pose.rotation)], axis=1)
    u = (seen - seen.mean(axis=0)) / np.maximum(seen.std(axis=0), 1e-12)
    time = np.linspace(-1.0, 1.0, count)[:, None]
    # Lengths are nearly quadratic in the pose themselves: cubic terms, too.
    of_pose = np.concatenate([*(u[:, a:a + 1] * u[:, a:] for a in range(6)), u ** 3], axis=1)
    of_all = {_POSE: of_pose, _DRIFT: np.concatenate([time, time ** 2], axis=1)}
    efforts = np.nan_to_num(getattr(platform.inverse_dynamics(
        Motion.from_pose(pose), singular='nan'), platform.parameters.leg_kind.effort.field))
    moves = np.diff(equations.positions, axis=0, prepend=equations.positions[:1])
    moved = found.lin.lever * np.abs(moves) > _MOVE * np.sqrt(np.mean(found.lin.residuals ** 2))
    last = np.maximum.accumulate(np.where(moved, np.arange(count)[:, None], 0), axis=0)
    return {
        _FIXED: found.lin.derivatives[..., GEOMETRY][..., fixed],
        _SCALE: (-found.lin.drives * equations.positions)[..., None],
        _TURNS: equations.turns(found.values)[..., None],
        _DEFLECTION: (-found.lin.drives * efforts)[..., None],
        **{what: np.repeat(each[:, None], 6, axis=1) for what, each in of_all.items()}}, [
            efforts, *(np.repeat(each[:, None], 6, axis=1) for each in u.T),
            equations.positions, np.take_along_axis(moves, last, axis=0)]


def _causes(residuals: _Residuals, legs: Sequence[int], of_a_leg: int, terms: dict[str, Array],
            sides: Sequence[Array], names: Sequence[str], scatter: Sequence[str],
            ) -> Iterator[tuple[float, _Cause]]:
    """Yield the causes of larger residuals of single legs, and of all, with their evidence."""
    count, place = len(residuals.whiten), {leg: n for n, leg in enumerate(legs)}

    def of_legs(values: Array, which: Sequence[int]) -> Array:
        """Return values (N, 6, k) as terms of their own for some legs (N, m, k legs)."""
        found = np.zeros((count, len(legs), len(which), values.shape[2]))
        for n, leg in enumerate(which):
            found[:, place[leg], n] = values[:, leg]
        return found.reshape(count, len(legs), -1)

    for what, each in terms.items():
        # As many terms as poses explain any scatter.
        few = each.shape[2] + of_a_leg > count
        for leg in legs:
            yield residuals.of_noise(place[leg]) if what == _POSE and few else (
                residuals.of_terms(of_legs(each, [leg]))), _Cause(what, (leg,), names[leg] + (
                    f' ({-residuals.of_each(of_legs(each, [leg]))[1][0]:+.2%})'
                    if what == _SCALE else ''))
        if not (what == _POSE and few):
            yield residuals.of_terms(of_legs(each, legs)), _Cause(what, tuple(legs), _ALL)
    for leg in legs:
        rules = [residuals.of_each(of_legs(_splits(values[:, leg])[:, None].repeat(6, axis=1), [
            leg])) for values in sides]
        side, noise = _mean(np.array([_mean(each) for each, _ in rules])), residuals.of_noise(
            place[leg])
        best = max(range(len(rules)), key=lambda n: float(rules[n][0].max()))
        evidence, amplitudes = rules[best]
        yield _mean(np.array([side, noise])), _Cause(_PLAY, (leg,), (
            f'{names[leg]} (+-{1e6 * abs(amplitudes[int(np.argmax(evidence))]):.3g} um, the side '
            f'changes with {_SIDES[best]})' if side > noise else scatter[leg]))


def _splits(values: Array) -> Array:
    """Return the sides, +-1 (N, k), of values (N,) about levels between them."""
    ordered, count = np.sort(values), len(values)
    ranks = np.linspace(_FEWEST, count - _FEWEST, min(count - 2 * _FEWEST + 1, _SPLITS)).round()
    levels = np.unique(0.5 * sum(ordered[ranks.astype(int) - n] for n in range(2)))
    levels = levels[(levels > ordered[0]) & (levels < ordered[-1])]
    return np.where(values[:, None] > levels, 1.0, -1.0)
