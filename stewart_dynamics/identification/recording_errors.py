# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Possible errors in a recording or a parameter file, as other hypotheses about the same data.

Efforts of another sign or unit, and swapped legs, are compared with the recording by the
squared misfit of data and prior together, twice the logarithm of the likelihood.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from copy import copy
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.extraction import Extract, Extraction, ORDERS
from stewart_dynamics.identification.lack_of_fit import LackOfFit, LEFT_BY_FILTERS
from stewart_dynamics.identification.parameter_fit import Fit, residual_of, shifted_by
from stewart_dynamics.identification.unknowns import regressor_of, Unknowns
from stewart_dynamics.identification.window_poses import first_pose, motions, pose_near, poses
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import (
    FAR, find_scale_error, known_scales)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.possible_errors.hypothesis import likeliest, PossibleError
from stewart_dynamics.possible_errors.transforms import swapped_pairs

# A residual above this fraction of the efforts starts the search for swapped legs.
_SUSPICIOUS = 0.03
# A residual above this fraction means that the model does not describe the recording.
_UNEXPLAINED = 0.3
# Swapped legs must reduce the misfit to this fraction, and more than another cause does.
_BETTER = 0.7
# Deviation of the efforts, relative to them, where hypotheses are compared; largest misfit of one
# that is taken.
_ROUGHLY, _WELL = 0.01, 0.1
# Twice the logarithm of the likelihood ratio from which another hypothesis is taken.
_CLEARLY = 2.0 * math.log(1000.0)
# Ratio of residuals on held-out time from which the file is better than the fit.
_WORSE = 1.05
_LEGS = range(6)
# Minimum fraction of valid samples for a comparison.
_FEWEST = 0.5
# Length of the part that is searched, in cut-off periods, longer if the filters need it.
_PIECE = 50.0
# Largest delay of the efforts that is estimated [s]: delays come from buses and computers, and do
# not scale with the hexapod.
LONGEST_LAG = 0.1
# Tolerance of limits of positions, relative to them.
_TOLERANCE = 1e-3


class Comparison:
    """
    Compares hypotheses about efforts by their sums of products (q, q) with the regressor.

    ``whole``: with all efforts, not only those that are used.
    """

    def __init__(self, extracts: Iterable[Extract], unknowns: Unknowns, whole: bool = False,
                 ) -> None:
        self._unknowns, self._rows = unknowns, 0
        self._gram: Array = np.zeros(())
        for extract in extracts:
            used = extract.columns[extract.used | whole]
            self._gram, self._rows = self._gram + used.T @ used, self._rows + len(used)
        columns = unknowns.derivative(unknowns.start) @ unknowns.root
        self._columns = np.concatenate([columns, np.zeros((ORDERS, columns.shape[1]))])
        self._of_file = residual_of(unknowns, unknowns.start, 0.0)
        self._of_file[-ORDERS:] = 0.0
        self._efforts = self._gram[-ORDERS]

    def best_scales(self) -> list[float]:
        """Return scales of the efforts: the best by the file, and with its uncertainty."""
        along, total = -float(self._efforts @ self._of_file), float(self._efforts[-ORDERS])
        modelled = float(self._of_file @ self._gram @ self._of_file)
        scale = along / modelled if modelled > 0.0 else 0.0
        if scale == 0.0:
            return [0.0]
        weight, inverse = self._solved(scale)
        across = self._columns.T @ self._efforts
        # the inverse of the scale is one more unknown
        follow = weight * inverse @ across
        along += float(follow @ (self._columns.T @ self._gram @ self._of_file))
        total -= float(follow @ across)
        # the file's legs may be wrong, but not by such a ratio
        joint = [total / along] if along else []
        return [scale, *(each for each in joint if 0.1 < each / scale < 10.0)]

    def misfit(self, scale: float = 1.0, delay: float = 0.0) -> float:
        """Return the squared misfit of data and prior with efforts divided by a scale."""
        c = self._of_file.copy()
        c[-ORDERS:] = shifted_by(delay) / scale
        weight, inverse = self._solved(scale)
        z = inverse @ (weight * self._columns.T @ self._gram @ c)
        left = c - self._columns @ z
        return (weight * float(left @ self._gram @ left) + float(z @ z)
                + self._unknowns.misfit_of_mass(float(z[0])))

    def likeliest_scales(self, scales: Iterable[float], largest: float = math.inf) -> list[float]:
        """Return the scale with the smallest misfit, if it fits well, see ``likeliest``."""
        well = (_WELL / _ROUGHLY) ** 2 * max(self._rows, 1)
        return [each for _, each in likeliest(
            ((self.misfit(each), each) for each in scales), min(largest, well))]

    def _solved(self, scale: float) -> tuple[float, Array]:
        """Return the weight of the efforts, and the covariance of the unknowns."""
        efforts = float(self._efforts[-ORDERS]) / max(self._rows, 1)
        weight = scale ** 2 / (_ROUGHLY ** 2 * efforts) if efforts > 0.0 else 0.0
        return weight, np.linalg.inv(
            weight * self._columns.T @ self._gram @ self._columns
            + np.eye(self._columns.shape[1]))


def of_no_pose(p: Parameters, positions: Array) -> str:
    """Return the likely reason why no pose has the measured positions."""
    kind = p.leg_kind
    there = positions + p.geometry.zero_length
    low, high = there.min(), there.max()
    added = f'with {kind.zero} ' if kind.zero else ''
    text = (f'the measured {kind.position.field} belong to no pose of this hexapod: {added}'
            f'they are {low:.4g} to {high:.4g} {kind.position.unit}')
    least, most = (p[name] for name in kind.position_limits)
    if least is not None and most is not None and (
            low < least.min() - _TOLERANCE * abs(least.min())
            or high > most.max() + _TOLERANCE * abs(most.max())):
        names = kind.position_limits[0], kind.position_limits[1].rpartition('.')[2]
        return (f'{text}, and {" and ".join(names)} are {least.min():g} and '
                f'{most.max():g} {kind.position.unit}: likely {kind.zero_cause.subject} is '
                'wrong, or positions are in another unit')
    return f'{text}: likely {kind.zero_cause.no_pose}'


def of_delay(delays: Iterable[float]) -> Iterator[PossibleError]:
    """Yield a possible error for bags with these delays of the efforts [s]."""
    longest = max(delays, key=abs)
    if abs(longest) >= LONGEST_LAG:
        yield PossibleError(
            'delay', f'the efforts are {"later" if longest > 0.0 else "earlier"} than the '
            f'positions by {LONGEST_LAG:g} s or more: '
            'stamps of both must be of one clock')


def of_efforts(comparison: Comparison, p: Parameters, of_motors: bool) -> Iterator[PossibleError]:
    """Yield a possible error in sign or unit of the efforts."""
    best = comparison.best_scales()
    if best[0] != 0.0:
        best = comparison.likeliest_scales(best, comparison.misfit() - _CLEARLY)
    for scale in best[:1]:
        # a known one, though the mass of the file is far off
        known = comparison.likeliest_scales(each for each in known_scales(p, of_motors)
                                            if scale and 1.0 / FAR < each / scale < FAR)
        if error := find_scale_error([*known, scale][0], p, of_motors):
            yield error


def of_fit(p: Parameters, unknowns: Unknowns, extraction: Extraction, window: Window, fit: Fit,
           lack: LackOfFit | None, residual: float, delays: Sequence[float],
           ) -> Iterator[PossibleError]:
    """
    Yield a possible error if the residuals are more than noise, or a delay is long.

    Legs are swapped in the first window. ``residual`` is the RMS of the residuals divided by that
    of the efforts; ``delays`` are those of the bags [s].
    """
    left = 1.0 if lack is None else lack.left
    late = list(of_delay(delays))
    if residual < _SUSPICIOUS and lack is None and not late:
        return
    platform, piece = extraction.platform, most_motion(window, extraction)
    undelayed = copy(extraction)  # the delay that fits wrong legs best may be any
    undelayed.later = 0.0
    swaps: list[tuple[float, tuple[str, int, int]]] = []
    with suppress(PoseError, SingularityError):
        tried = [(each(piece, first_pose(platform, piece)).extract, delay)
                 for each, delay in ((extraction, fit.delays[0]), (undelayed, 0.0))]
        own = [_of_legs(platform, extract, _LEGS, unknowns) for extract, _ in tried]
        now = _misfit(own[0], _LEGS, unknowns, fit.delays[0])
        swaps = likeliest(_swaps(platform, tried, own, unknowns),
                          min(min(_BETTER, left) ** 2 * now, now - _CLEARLY))
    if swaps:
        misfit, (which, a, b) = swaps[0]
        yield PossibleError(
            'swapped', f'the {which} of {p.joints[a]} and {p.joints[b]} look swapped: the '
            f'residual becomes {math.sqrt(misfit / now):.2f} times as large')
    elif late:
        yield from late
    elif (lack is not None and lack.cause == p.leg_kind.zero_cause.what
          and lack.ranked[0].columns == 6):
        yield PossibleError(
            lack.cause, f'{p.leg_kind.zero_cause.subject} looks wrong: {lack.text}')
    elif residual > _UNEXPLAINED:
        yield PossibleError(
            'misfit', f'the residual is {100.0 * residual:.0f} % of the efforts whatever the '
            'parameters: positions and efforts may not belong together, or the geometry is wrong')


def of_validation(before: Array, after: Array, measured: Array, deviation: float, unit: str,
                  ) -> Iterator[PossibleError]:
    """
    Yield a possible error if the file predicts held-out efforts better than the fit.

    ``deviation``: of the fit's prediction, RMS; twice as much is no reason. ``unit``: of efforts.
    """
    file, fitted, size = (math.sqrt(float(np.mean(each ** 2))) for each in (
        before, after, measured))
    if fitted > math.hypot(_WORSE * file + LEFT_BY_FILTERS * size, 2.0 * deviation):
        yield PossibleError(
            'validation', f'on held-out time the residual is {file:.3g} {unit} by the file and '
            f'{fitted:.3g} {unit} by a fit to the rest: the file is better; the model does not '
            'hold in a part of the recording')


def most_motion(window: Window, extraction: Extraction, longer: float = 0.0) -> Window:
    """Return the part of a window with the most motion, by a time [s] longer than usual."""
    seconds = _PIECE / extraction.cutoff + longer
    many = min(len(window.positions), max(round(seconds / window.period), 4 * extraction.margin))
    moved = np.cumsum(np.abs(np.diff(window.positions, axis=0, prepend=window.positions[:1])
                             ).sum(axis=1))
    first = int(np.argmax(moved[many - 1:] - moved[:len(moved) - many + 1]))
    part = slice(first, first + many)
    return window.part(part, part)


def _swaps(platform: StewartPlatform, tried: Sequence[tuple[Extract, float]],
           own: Sequence[Extract | None], unknowns: Unknowns,
           ) -> Iterator[tuple[float, tuple[str, int, int]]]:
    """
    Yield the least squared misfit of extracts with delays [s], if two legs are swapped.

    own: the extracts without a swap, as ``_of_legs`` returns them.
    """
    for a, b, order in swapped_pairs():
        others = [_of_legs(platform, extract, order, unknowns) for extract, _ in tried]
        for which, extracts, of_efforts in (('positions and efforts', others, order),
                                            ('efforts', own, order), ('positions', others, _LEGS)):
            yield min(_misfit(extract, of_efforts, unknowns, delay) for extract, (_, delay) in zip(
                extracts, tried, strict=True)), (which, a, b)


def _of_legs(platform: StewartPlatform, extract: Extract, order: Sequence[int],
             unknowns: Unknowns) -> Extract | None:
    """
    Return an extract with positions of other legs; None if they have no poses.

    The regressor is that of the filtered motion, not filtered itself.
    """
    zero_length = platform.parameters.geometry.zero_length
    legs = extract.legs.copy()
    legs[..., 0] -= zero_length
    legs = legs[:, order]
    legs[..., 0] += zero_length
    try:
        found = poses(platform, legs[..., 0], pose_near(platform, legs[0, :, 0]), stride=1)
    except (PoseError, SingularityError):
        return None
    regressor = regressor_of(platform, motions(platform, found, legs[..., 1], legs[..., 2]))
    regressor[:, _LEGS, unknowns.columns.coulomb] = extract.slip[:, order, 0]
    return extract._replace(columns=np.concatenate([regressor, extract.efforts], axis=-1))


def _misfit(extract: Extract | None, order: Sequence[int], unknowns: Unknowns, delay: float,
            ) -> float:
    """Return the squared misfit with the efforts of other legs; infinite without a pose."""
    if extract is None or np.count_nonzero(extract.used) < _FEWEST * extract.used.size:
        return math.inf
    columns = np.concatenate([extract.regressor, extract.efforts[:, order]], axis=-1)
    return Comparison([extract._replace(columns=columns)], unknowns).misfit(delay=delay)
