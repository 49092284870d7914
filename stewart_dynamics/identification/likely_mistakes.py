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
Likely mistakes in a recording or a parameter file, by what they do to the fit.

Efforts of the wrong sign or unit scale everything, also the weight and inertia of what the file
knows: legs and actuators. Swapped legs, a wrong zero length and a tilted base make another
machine, which fits worse than the right one.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.extraction import Extract, Extraction
from stewart_dynamics.identification.fit import Fit
from stewart_dynamics.identification.guess import pose_near
from stewart_dynamics.identification.sums import residual_of, Sums
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.frames.pose import Pose
from stewart_dynamics.mechanics.least_squares import Information, information, nothing, solve
from stewart_dynamics.parameters.table import Parameters

# A scale of the efforts that is as near to a known factor as this is that factor.
_NEAR = 1.35
# A scale farther from 1 than this is a mistake.
_FAR = 2.0
_FACTORS = ((1e-3, 'kN in place of N'), (1.0 / 9.80665, 'kgf in place of N'),
            (1.0 / 4.448222, 'pounds in place of N'), (1e3, 'mN in place of N'))
# A residual above this part of the efforts calls for a search.
_SUSPICIOUS = 0.03
# With one above this part the model says nothing.
_UNEXPLAINED = 0.3
# What is found must make it smaller by this.
_BETTER = 0.5
# Part of the samples that must be sound for a comparison.
_FEWEST = 0.5
# For a zero length it need not become so much smaller: it is told well.
_SMALL_GAIN = 0.85
# The time of the search at most [s].
_PIECE = 5.0
# Of geometry.zero_length: a change that is tried [m], the smallest that is named, steps.
_CHANGE, _NAMED, _STEPS = 1e-3, 2e-3, 6


class Likely(NamedTuple):
    """A likely mistake."""

    what: str
    """One word for programs: sign, unit, torque, scale, swapped, zero_length, tilt or misfit."""
    text: str
    """In one line."""


def of_no_pose(p: Parameters, positions: Array) -> str:
    """Return why lengths may belong to no pose."""
    lengths = positions + p['geometry.zero_length']
    low, high = lengths.min(), lengths.max()
    text = (f'the measured lengths belong to no pose of this hexapod: with geometry.zero_length '
            f'they are {low:.4g} to {high:.4g} m')
    least, most = p['limits.length_min'], p['limits.length_max']
    if least is not None and most is not None and (
            low < least.min() - 1e-3 or high > most.max() + 1e-3):
        return (f'{text}, and limits.length_min and length_max are {least.min():g} and '
                f'{most.max():g} m: likely geometry.zero_length is wrong, or positions are in '
                'another unit')
    return f'{text}: likely geometry.zero_length or the geometry is wrong, or legs are swapped'


def of_efforts(sums: Sums, unknowns: Unknowns, p: Parameters, motor_torque: bool,
               ) -> Iterator[Likely]:
    """
    Yield likely mistakes of sign and unit of the efforts.

    The scale of the efforts is found along with the platform from what the file knows of the
    legs; without masses of legs, by the forces of the file's platform.
    """
    scale, error = _scale(sums, unknowns, platform_too=False)
    by_file, _ = _scale(sums, unknowns, platform_too=True)
    if not (np.isfinite(scale) and error < 0.1 * abs(scale)) or by_file == 0.0:
        scale = by_file
    elif not 0.1 < scale / by_file < 10.0:  # the file's legs may be wrong, not by so much
        scale = by_file
    if not np.isfinite(by_file) or by_file == 0.0:
        yield Likely('scale', 'all efforts are zero')
        return
    if not np.isfinite(scale):
        return
    if scale < 0.0:
        yield Likely('sign', 'the efforts have the opposite sign: + must push, as the forces of '
                             f'the node do (they are {scale:.3g} times what the model computes)')
        return
    if 1.0 / _FAR < scale < _FAR:
        return
    lead = p['actuator.screw_lead']
    if motor_torque:
        yield Likely('scale', f'the efforts are {scale:.3g} times what the model computes: likely '
                     f'actuator.screw_lead, {lead[0]:g} m, is wrong: about '
                     f'{lead[0] * scale:.3g} m would fit')
        return
    torque = 1.0 if lead is None else lead.mean() / (2.0 * np.pi)
    if lead is not None and 1.0 / _NEAR < scale / torque < _NEAR:
        yield Likely('torque', f'the efforts are {scale:.3g} times what the model computes: '
                     'likely torques of the motors in place of forces: --motor-torque takes them')
        return
    for factor, unit in _FACTORS:
        if 1.0 / _NEAR < scale / factor < _NEAR:
            yield Likely('unit', f'the efforts are {scale:.3g} times what the model computes: '
                                 f'likely {unit}')
            return
    yield Likely('torque' if scale < 0.05 else 'scale', (
        f'the efforts are {scale:.3g} times what the model computes: ' + (
            'likely torques of the motors in place of forces: --motor-torque takes them, with '
            f'actuator.screw_lead (a lead of {2.0 * np.pi * scale:.2g} m would fit)'
            if scale < 0.05 else 'another unit, or a wrong platform.mass')))


def of_kinematics(p: Parameters, unknowns: Unknowns, extraction: Extraction, window: Window,
                  guess: Pose, fit: Fit, residual: float) -> Iterator[Likely]:
    """
    Yield likely mistakes of zero length, and of legs where the residual is a large part.

    Parameters
    ----------
    p : Parameters
        The file's.
    unknowns : Unknowns
        What was asked for.
    extraction : Extraction
        Of the first window.
    window, guess
        That window, and a pose near its first.
    fit : Fit
        The result.
    residual : float
        RMS of the residuals, as a part of that of the efforts.

    """
    piece = _piece(window, extraction)
    now = _tried(p, unknowns, extraction, piece, fit)
    joints = p['joints']
    found = [(now, '', '')]
    suspicious = residual > _SUSPICIOUS
    for legs, what in ((range(6), ''), *(([n], f' of {joints[n]}') for n in range(6)
                                         if suspicious)):
        offset, misfit = _zero_length(p, unknowns, extraction, piece, fit, list(legs))
        if abs(offset) > _NAMED:
            found.append((misfit / _SMALL_GAIN * _BETTER, 'zero_length', (
                f'geometry.zero_length{what} looks wrong: {1e3 * offset:+.1f} mm fit')))
    if not suspicious:
        yield from _best(found, now)
        return
    if unknowns.tilt is None:
        misfit, angle = _tilt(p, unknowns, extraction, piece, fit)
        found.append((misfit, 'tilt', (
            f'the base looks tilted by {np.degrees(angle):.1f} degrees against gravity as the '
            'parameters have it: tilt in --identify takes that into account')))
    for a, b in combinations(range(6), 2):
        order = list(range(6))
        order[a], order[b] = b, a
        for which in ('positions and efforts', 'efforts', 'positions'):
            swapped = piece
            if 'positions' in which:
                swapped = swapped._replace(
                    positions=piece.positions[:, order],
                    rates=None if piece.rates is None else piece.rates[:, order])
            if 'efforts' in which:
                swapped = swapped._replace(efforts=piece.efforts[:, order])
            misfit = _tried(p, unknowns, extraction, swapped, fit)
            found.append((misfit, 'swapped', f'the {which} of {joints[a]} and {joints[b]} look '
                                             'swapped'))
    mistakes = list(_best(found, now))
    if not mistakes and residual > _UNEXPLAINED:
        mistakes.append(Likely('misfit', (
            f'the residual is {100.0 * residual:.0f} % of the efforts whatever the parameters: '
            'positions and efforts may not belong together, or the geometry is wrong')))
    yield from mistakes


def _best(found: list[tuple[float, str, str]], now: float) -> Iterator[Likely]:
    misfit, what, text = min(found)
    if what and misfit < _BETTER * now:
        part = misfit / now * (_SMALL_GAIN / _BETTER if what == 'zero_length' else 1.0)
        yield Likely(what, f'{text}: the residual becomes {part:.2f} times as large')


def _zero_length(p: Parameters, unknowns: Unknowns, extraction: Extraction, window: Window,
                 fit: Fit, legs: list[int]) -> tuple[float, float]:
    """Return the change of the zero length of some legs that fits [m], and the residual [N]."""
    shift = np.zeros(6)
    shift[legs] = 1.0
    offset, last = 0.0, float('inf')
    for _ in range(_STEPS):
        try:
            extracts = [extraction(moved, pose_near(
                extraction.platform, moved.positions[0] + p['geometry.zero_length']))
                for moved in (window._replace(positions=window.positions + change * shift)
                              for change in (offset, offset + _CHANGE))]
        except (PoseError, SingularityError):
            break
        misfit, theta, _ = _fitted(unknowns, extracts[0], fit)
        if not misfit < last:
            break
        last = misfit
        first, second = extracts
        by_offset = ((second.regressor - first.regressor) @ theta
                     + second.known - first.known) / _CHANGE
        both = first._replace(regressor=np.concatenate(
            [first.regressor, by_offset[..., None]], axis=-1))
        _, values, error = _fitted(unknowns, both, fit)
        step = float(np.clip(values[-1], -0.1, 0.1))
        if not error < _CHANGE:  # the motion does not tell it
            return 0.0, float('inf')
        if abs(step) < 0.1 * _NAMED:
            break
        offset += step
    return offset, last


def _tilt(p: Parameters, unknowns: Unknowns, extraction: Extraction, window: Window, fit: Fit,
          ) -> tuple[float, float]:
    """Return the residual with a tilt of gravity [N], and the tilt that fits [rad]."""
    tilted = unknowns.with_tilt()
    with_tilt = Extraction(extraction.platform, tilted, window.period, extraction.cutoff)
    try:
        extract = with_tilt(window, pose_near(
            extraction.platform, window.positions[0] + p['geometry.zero_length']))
    except (PoseError, SingularityError):
        return float('inf'), 0.0
    derivative = tilted.derivative(np.append(fit.values, np.zeros(2)))
    misfit, theta, _ = _fitted(unknowns, extract._replace(regressor=np.concatenate([
        extract.regressor[..., :len(unknowns.linear)], extract.regressor @ derivative[:, -2:],
    ], axis=-1)), fit)
    return misfit, float(np.hypot(*theta[-2:]))


def _scale(sums: Sums, unknowns: Unknowns, platform_too: bool) -> tuple[float, float]:
    """Return the scale of the efforts by least squares, and its standard error."""
    many = len(unknowns.linear)  # a tilt changes no scale
    theta = unknowns.theta(unknowns.start)
    known = len(theta)
    total = nothing(many + 1)
    for bag in range(len(sums.counts)):
        for leg in range(6):
            gram, count = sums.grams[bag, leg], sums.counts[bag, leg]
            if not count:
                continue
            # efforts = scale known + Y theta'
            columns = np.zeros((len(gram), many + 1))
            columns[:many, :many] = np.eye(many)
            columns[known, many] = 1.0
            if platform_too:
                columns[:known, many] = theta
            effort = np.zeros(len(gram))
            effort[known + 1] = 1.0
            total = total.plus(Information(
                columns.T @ gram @ columns, columns.T @ gram @ effort,
                float(effort @ gram @ effort), int(count)))
    if not total.rows or total.squares <= 0.0:
        return float('nan'), float('inf')
    if platform_too:
        weight = total.matrix[-1, -1]
        return (float(total.vector[-1] / weight) if weight > 0.0 else float('nan')), float('inf')
    sizes = np.sqrt(np.diag(total.matrix))
    sizes = np.where(sizes > 1e-6 * sizes.max(), sizes, np.inf)
    scaled = total._replace(matrix=total.matrix / np.outer(sizes, sizes),
                            vector=total.vector / sizes)
    found = solve(scaled, np.zeros(many + 1), np.ones(many + 1), largest_error=1e4)
    values = found.values / sizes
    if not np.isfinite(sizes[-1]) or not found.identifiability.identifiable[-1]:
        return float('nan'), float('inf')
    variance = scaled.residual_squares(found.values) / total.rows
    return float(values[-1]), float(np.sqrt(variance * found.covariance[-1, -1]) / sizes[-1])


def _piece(window: Window, extraction: Extraction) -> Window:
    """Return the part of a window with the most motion, long enough for the filters."""
    many = min(len(window.positions), max(round(_PIECE / window.period), 4 * extraction.margin))
    moved = np.cumsum(np.abs(np.diff(window.positions, axis=0, prepend=window.positions[:1])
                             ).sum(axis=1))
    first = int(np.argmax(moved[many - 1:] - moved[:len(moved) - many + 1]))
    part = slice(first, first + many)
    return window._replace(
        positions=window.positions[part], efforts=window.efforts[part],
        rates=None if window.rates is None else window.rates[part],
        outliers=window.outliers[part])


def _tried(p: Parameters, unknowns: Unknowns, extraction: Extraction, window: Window, fit: Fit,
           ) -> float:
    try:
        guess = pose_near(extraction.platform, window.positions[0] + p['geometry.zero_length'])
        return _fitted(unknowns, extraction(window, guess), fit)[0]
    except (PoseError, SingularityError):
        return float('inf')


def _fitted(unknowns: Unknowns, extract: Extract, fit: Fit) -> tuple[float, Array, float]:
    """Return the RMS residual [N], the linear parameters that fit, and the last one's error."""
    shifts = residual_of(np.zeros(0), float(fit.delays[0]))[1:]
    efforts = extract.efforts @ shifts - extract.known
    samples = information(extract.regressor, efforts, extract.sound.astype(float))
    sizes = np.sqrt(np.maximum(np.diag(samples.matrix), 1e-300))
    scaled = samples._replace(matrix=samples.matrix / np.outer(sizes, sizes),
                              vector=samples.vector / sizes)
    found = solve(scaled, np.zeros(len(sizes)), np.ones(len(sizes)), largest_error=1e4)
    if samples.rows < _FEWEST * extract.sound.size:
        return float('inf'), found.values, float('inf')
    misfit = float(np.sqrt(scaled.residual_squares(found.values) / samples.rows))
    error = float(misfit * np.sqrt(found.covariance[-1, -1]) / sizes[-1]) if (
        found.identifiability.identifiable[-1]) else float('inf')
    return misfit, found.values / sizes, error
