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
knows: legs and actuators. Swapped legs and a wrong zero length make another machine, which fits
worse than the right one.
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
from stewart_dynamics.mechanics.least_squares import information, Information, nothing, solve
from stewart_dynamics.mechanics.pose import Pose
from stewart_dynamics.parameters import Parameters

# A scale of the efforts that is as near to a known factor as this is that factor.
_NEAR = 1.35
# A scale farther from 1 than this is a mistake.
_FAR = 2.0
_FACTORS = ((1e-3, 'kN in place of N'), (1.0 / 9.80665, 'kgf in place of N'),
            (1.0 / 4.448222, 'pounds in place of N'), (1e3, 'mN in place of N'))
# A residual above this part of the efforts calls for a search.
_SUSPICIOUS = 0.05
# What is found must make it smaller by this.
_BETTER = 0.5
# Recorded samples of the search at most.
_PIECE = 12_000
_ZERO_LENGTHS = (-0.3, -0.2, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.2, 0.3)  # [m]


class Likely(NamedTuple):
    """A likely mistake."""

    what: str
    """One word for programs: sign, unit, torque, scale, swapped or zero_length."""
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
    if not np.isfinite(scale) or scale == 0.0:
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
    Yield likely mistakes of legs and lengths, if the residual is a large part of the efforts.

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
    if residual < _SUSPICIOUS:
        return
    piece = _piece(window, extraction)
    now = _misfit(unknowns, extraction(piece, pose_near(
        extraction.platform, piece.positions[0] + p['geometry.zero_length'])), fit)
    found = [(now, '', '')]
    joints = p['joints']
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
    for offset in _ZERO_LENGTHS:
        shifted = piece._replace(positions=piece.positions + offset)
        misfit = _tried(p, unknowns, extraction, shifted, fit)
        found.append((misfit, 'zero_length', 'geometry.zero_length looks wrong by about '
                                             f'{offset:+g} m (add it)'))
    best = min(found)
    if best[1] and best[0] < _BETTER * now:
        yield Likely(best[1], f'{best[2]}: the residual becomes {best[0] / now:.2f} times as '
                              'large')


def _scale(sums: Sums, unknowns: Unknowns, platform_too: bool) -> tuple[float, float]:
    """Return the scale of the efforts by least squares, and its standard error."""
    many = len(unknowns.linear)
    theta = unknowns.theta(unknowns.start)
    total = nothing(many + 1)
    for bag in range(len(sums.counts)):
        for leg in range(6):
            gram, count = sums.grams[bag, leg], sums.counts[bag, leg]
            if not count:
                continue
            # efforts = scale known + Y theta'
            columns = np.zeros((len(gram), many + 1))
            columns[:many, :many] = np.eye(many)
            columns[many, many] = 1.0
            if platform_too:
                columns[:many, many] = theta
            effort = np.zeros(len(gram))
            effort[many + 1] = 1.0
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
    many = min(len(window.positions), max(_PIECE, 4 * extraction.margin))
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
        return _misfit(unknowns, extraction(window, guess), fit)
    except (PoseError, SingularityError):
        return float('inf')


def _misfit(unknowns: Unknowns, extract: Extract, fit: Fit) -> float:
    """Return the RMS residual of a fit of all linear parameters to an extract [N]."""
    shifts = residual_of(np.zeros(0), float(fit.delays[0]))[1:]
    efforts = extract.efforts @ shifts - extract.known
    samples = information(extract.regressor, efforts, extract.sound.astype(float))
    sizes = np.sqrt(np.maximum(np.diag(samples.matrix), 1e-300))
    scaled = samples._replace(matrix=samples.matrix / np.outer(sizes, sizes),
                              vector=samples.vector / sizes)
    found = solve(scaled, np.zeros(len(sizes)), np.ones(len(sizes)), largest_error=1e4)
    return float(np.sqrt(scaled.residual_squares(found.values) / max(samples.rows, 1)))
