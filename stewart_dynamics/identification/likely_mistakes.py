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
Likely mistakes in a recording or a parameter file, detected by their effect on the fit.

Efforts of the wrong sign or unit scale all forces, including the weight and inertia that the file
gives for legs and actuators. Swapped legs, a wrong zero length and a tilted base correspond to
another hexapod, which fits worse than the right one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.extraction import Extraction
from stewart_dynamics.identification.fit import Fit
from stewart_dynamics.identification.kinematics import first_pose
from stewart_dynamics.identification.lack_of_fit import LackOfFit
from stewart_dynamics.identification.sums import shifted_by, Sums
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.drives.measured_efforts import FAR, mistake_of_scale
from stewart_dynamics.mechanics.least_squares import (
    Information, information, solve)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reporting.estimates import LikelyMistake

# A residual above this fraction of the efforts starts the search for swapped legs.
_SUSPICIOUS = 0.03
# A residual above this fraction means that the model does not describe the recording.
_UNEXPLAINED = 0.3
# A cause must reduce the residual to this fraction.
_BETTER = 0.5
# Largest standard error of a known direction, with columns of the regressor scaled to length 1.
_LARGEST_ERROR = 1e4
# Minimum fraction of valid samples for a comparison.
_FEWEST = 0.5
# Length of the part that is searched, in cut-off periods, longer if the filters need it.
_PIECE = 50.0
# Largest delay of the efforts that is estimated [s]: delays come from buses and computers, and do
# not scale with the hexapod.
LONGEST_LAG = 0.1
# Tolerance of limits of length, relative to them.
_TOLERANCE = 1e-3


def of_no_pose(p: Parameters, positions: Array) -> str:
    """Return the likely reason why no pose has the measured lengths."""
    lengths = positions + p['geometry.zero_length']
    low, high = lengths.min(), lengths.max()
    text = (f'the measured lengths belong to no pose of this hexapod: with geometry.zero_length '
            f'they are {low:.4g} to {high:.4g} m')
    least, most = p['limits.length_min'], p['limits.length_max']
    if least is not None and most is not None and (
            low < (1.0 - _TOLERANCE) * least.min() or high > (1.0 + _TOLERANCE) * most.max()):
        return (f'{text}, and limits.length_min and length_max are {least.min():g} and '
                f'{most.max():g} m: likely geometry.zero_length is wrong, or positions are in '
                'another unit')
    return f'{text}: likely geometry.zero_length or the geometry is wrong, or legs are swapped'


def of_delay(delays: Iterable[float]) -> Iterator[LikelyMistake]:
    """Yield a likely mistake for bags with these delays of the efforts [s]."""
    longest = max(delays, key=abs)
    if abs(longest) >= LONGEST_LAG:
        yield LikelyMistake(
            'delay', f'the efforts are {"later" if longest > 0.0 else "earlier"} than the '
            f'positions by {LONGEST_LAG:g} s or more: '
            'stamps of both must be of one clock')


def of_efforts(sums: Sums, unknowns: Unknowns, p: Parameters, of_motors: bool,
               ) -> Iterator[LikelyMistake]:
    """
    Yield likely mistakes in sign and unit of the efforts.

    The scale of the efforts is estimated jointly with the platform from the file's leg parameters;
    without leg masses, from the forces of the file's platform.
    """
    scale, error = scale_of_efforts(sums, unknowns, platform_too=False)
    by_file, _ = scale_of_efforts(sums, unknowns, platform_too=True)
    if not np.isfinite(by_file) or by_file == 0.0:
        scale = 0.0
    elif not (np.isfinite(scale) and error < 0.1 * abs(scale)) or (
            # the file's legs may be wrong, but not by this ratio
            not 0.1 < scale / by_file < 10.0):
        scale = by_file
    elif (scale > 0.0) == (by_file > 0.0) and 1.0 / FAR < abs(by_file) < FAR:
        scale = by_file  # the platform's weight shows that the unit is right
    if mistake := mistake_of_scale(scale, p, of_motors):
        yield LikelyMistake(*mistake)


def of_fit(p: Parameters, extraction: Extraction, window: Window, fit: Fit,
           lack: LackOfFit | None, residual: float) -> Iterator[LikelyMistake]:
    """
    Yield a likely mistake if the residual is a large fraction of the efforts.

    Legs are swapped in the first window. ``residual`` is the RMS of the residuals divided by that
    of the efforts.
    """
    left, cause, text = (1.0, '', '') if lack is None else (
        lack.left, lack.causes[0].what, lack.causes[0].text)
    if cause == 'zero_length' and left < _BETTER:
        yield LikelyMistake(cause, f'geometry.zero_length looks wrong: {text}: the residual '
                            f'becomes {left:.2f} times as large')
        return
    if residual < _SUSPICIOUS:
        return
    piece, joints = most_motion(window, extraction), p['joints']
    now = _tried(extraction, piece, fit)
    found = [(now, 'misfit', (
        f'the residual is {100.0 * residual:.0f} % of the efforts whatever the parameters: '
        'positions and efforts may not belong together, or the geometry is wrong'))]
    if cause == 'tilt':
        found.append((left * now, cause, (
            f'gravity of the parameters looks wrong: {text}: tilt in --identify takes that into '
            'account')))
    best = min(_BETTER, left)
    for a, b in combinations(range(6), 2):
        order = [{a: b, b: a}.get(leg, leg) for leg in range(6)]
        efforts, legs = piece.efforts[:, order], piece._replace(
            positions=piece.positions[:, order],
            rates=None if piece.rates is None else piece.rates[:, order])
        for which, swapped in (('positions and efforts', legs._replace(efforts=efforts)),
                               ('efforts', piece._replace(efforts=efforts)),
                               ('positions', legs)):
            misfit = _tried(extraction, swapped, fit)
            if misfit < best * now:
                found.append((misfit, 'swapped', f'the {which} of {joints[a]} and {joints[b]} '
                                                 'look swapped'))
    misfit, what, text = min(found)
    if misfit < _BETTER * now:
        yield LikelyMistake(
            what, f'{text}: the residual becomes {misfit / now:.2f} times as large')
    elif residual > _UNEXPLAINED:
        yield LikelyMistake(*found[0][1:])


def scale_of_efforts(sums: Sums, unknowns: Unknowns, platform_too: bool,
                     ) -> tuple[float, float]:
    """Return the scale of the efforts by least squares, and its standard error."""
    many = len(unknowns.linear)  # a tilt does not change the scale
    theta = unknowns.theta(unknowns.start)
    known = len(theta)
    gram = sums.grams.sum(axis=(0, 1))
    # efforts = scale known + Y theta'
    columns = np.zeros((len(gram), many + 1))
    columns[:many, :many] = np.diag(unknowns.linear_scales)
    columns[known, many] = 1.0
    if platform_too:
        columns[:known, many] = theta
    total = Information(
        columns.T @ gram @ columns, columns.T @ gram[known + 1],
        float(gram[known + 1, known + 1]), int(sums.counts.sum()))
    if not total.rows or total.squares <= 0.0:
        return float('nan'), float('inf')
    if platform_too:
        weight = total.matrix[-1, -1]
        return (float(total.vector[-1] / weight) if weight > 0.0 else float('nan')), float('inf')
    sizes = np.sqrt(np.diag(total.matrix))
    scales = np.where(sizes > 1e-6 * sizes.max(), 1.0 / np.maximum(sizes, 1e-300), 0.0)
    found = solve(total, np.zeros(many + 1), scales, largest_error=_LARGEST_ERROR)
    if not scales[-1] or not found.identifiability.identifiable[-1]:
        return float('nan'), float('inf')
    variance = total.residual_squares(found.values) / total.rows
    return float(found.values[-1]), float(np.sqrt(variance * found.covariance[-1, -1]))


def most_motion(window: Window, extraction: Extraction) -> Window:
    """Return the part of a window with the most motion, long enough for the filters."""
    seconds = _PIECE / extraction.cutoff + LONGEST_LAG
    many = min(len(window.positions), max(round(seconds / window.period), 4 * extraction.margin))
    moved = np.cumsum(np.abs(np.diff(window.positions, axis=0, prepend=window.positions[:1])
                             ).sum(axis=1))
    first = int(np.argmax(moved[many - 1:] - moved[:len(moved) - many + 1]))
    part = slice(first, first + many)
    return window._replace(
        positions=window.positions[part], efforts=window.efforts[part],
        rates=None if window.rates is None else window.rates[part],
        outliers=window.outliers[part])


def _tried(extraction: Extraction, window: Window, fit: Fit) -> float:
    """Return the RMS residual of a fit to a window [N]; infinite if no pose is found."""
    try:
        extract = extraction(window, first_pose(extraction.platform, window)).extract
    except (PoseError, SingularityError):
        return float('inf')
    efforts = extract.efforts @ shifted_by(fit.delays[0]) - extract.known
    samples = information(extract.regressor, efforts, extract.used.astype(float))
    if samples.rows < _FEWEST * extract.used.size:
        return float('inf')
    scales = 1.0 / np.sqrt(np.maximum(np.diag(samples.matrix), 1e-300))
    found = solve(samples, np.zeros(len(scales)), scales, largest_error=_LARGEST_ERROR)
    return float(np.sqrt(samples.residual_squares(found.values) / samples.rows))
