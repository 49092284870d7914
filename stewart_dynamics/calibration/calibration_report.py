# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The report of a calibration as one HTML page: what moved, how far, and how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
import math
from pathlib import Path

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.calibrate import Calibration
from stewart_dynamics.calibration.calibration_record import CalibrationResult
from stewart_dynamics.calibration.calibration_results import (
    frames_text, noise_text, outlier_text, validation_text)
from stewart_dynamics.calibration.equations import BASE, PLATFORM
from stewart_dynamics.estimation.confidence_level import INTERVAL, TWO_SIDED
from stewart_dynamics.legs.calibrated import Calibrated, listed
from stewart_dynamics.reporting.estimates import FIXED
from stewart_dynamics.reporting.pages import digits, page
from stewart_dynamics.reporting.vector_picture import Chart, Picture
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
_MM = _MILLI = 1e3
# Size of a picture of changes, left margin, widths of charts by the numbers of a leg, gap [px].
_PICTURE, _LEFT, _WIDTHS, _GAP = (1160, 350), 60.0, {1: 200.0, 2: 300.0, 3: 410.0}, 28.0
# Length of the longest arrow in a view, by the radius of the joints.
_ARROW = 0.35
# Width of a character and height of a line of a label [px].
_CHARACTER, _LINE = 5.9, 13.0
# Standard errors that the largest of the 36 changes of exact joints exceeds with 5 %.
_NOISE = 3.2


def write_report(path: Path, result: CalibrationResult, found: Calibration) -> None:
    """Write the page with the content of calibration.json."""
    times = _arrow_scale(found)
    text = page(
        _FOLDER, 'calibration', document=True, r=result, name=Path(result.poses.source).name,
        validation=validation_text(result.validation), frames=frames_text(result.frames),
        noise=noise_text(result.noise), line=found.legs.line,
        outliers=[outlier_text(each) for each in result.outliers],
        changes=_changes(found), views=[
            _view(found, part, f'{name} joints, from above', times)
            for part, name in ((BASE, 'Base'), (PLATFORM, 'Platform'))
            if any(state != FIXED for state in found.states[:PLATFORM.stop])])
    write_files({path: text})


def _changes(found: Calibration) -> str:
    """Return pictures of all changes with their intervals, of numbers of one unit each."""
    rows: list[list[Calibrated]] = []
    for each in found.legs.calibrated:
        if rows and rows[-1][0].unit == each.unit and _LEFT + sum(
                map(_width, (*rows[-1], each))) <= _PICTURE[0] + _GAP:
            rows[-1].append(each)
        else:
            rows.append([each])
    parts = found.legs.parts
    return ''.join(_row(found, row) for row in rows if not all(
        state == FIXED for each in row for state in found.states[parts[each.name]]))


def _width(of: Calibrated) -> float:
    """Return the width of the chart of a parameter with the gap beside it."""
    return _WIDTHS[len(of.axes)] + _GAP


def _row(found: Calibration, row: Sequence[Calibrated]) -> str:
    """Return the picture of some parameters of one unit."""
    places = [found.legs.parts[each.name] for each in row]
    which = np.concatenate([np.arange(part.start, part.stop) for part in places])
    moved = _MILLI * (found.values - found.start)
    errors = np.where(np.isfinite(found.errors), found.errors, 0.0)
    halves = _MILLI * TWO_SIDED * np.where(
        [each == FIXED for each in found.states], 0.0, errors)
    shown = np.abs(moved[which]) + np.minimum(
        halves[which], np.abs(moved[which]).max() + 1e-9)
    end, unit = max(float(shown.max()) * 1.08, 1e-9), f'm{row[0].unit}'
    words = listed([each.words for each in row])
    picture = Picture(*_PICTURE, f'Change of {words} [{unit}], with its {INTERVAL}')
    left = _LEFT
    for of, part in zip(row, places, strict=True):
        count, axes = part.stop - part.start, _letters(of)
        chart = Chart(picture, (left, 34.0, _WIDTHS[len(of.axes)], 220.0), (-0.6, count - 0.4),
                      (-end, end))
        picture.text([left, 22.0], f'{of.words} [{unit}]', css='view')
        chart.draw_levels(6, numbers=left == _LEFT)
        for n in range(count):
            leg, axis = divmod(n, len(axes))
            value, half = moved[part][n], min(halves[part][n], 2.0 * end)
            x, y = chart.at([n, value])
            _, zero = chart.at([n, 0.0])
            low, high = (float(np.clip(chart.at([n, value + sign * half])[1], 34.0, 254.0))
                         for sign in (-1.0, 1.0))
            picture.line([x, zero], [x, y], css=f'bar leg{leg}')
            picture.line([x, low], [x, high], css='whisker')
            picture.text([x, 270.0], axes[axis], 'middle', css='tick')
            if axis == len(axes) // 2:
                picture.text([x, 288.0], found.parameters.joints[leg], 'end', 45.0, css='tick')
        left += _width(of)
    return picture.svg()


def _letters(of: Calibrated) -> Sequence[str]:
    """Return the letters of the numbers of a leg: of joints their axes."""
    return of.axes if len(of.axes) == 3 else '12' if len(of.axes) == 2 else ' '


def _seen_from_above(found: Calibration, part: slice) -> tuple[Array, Array, Array, float]:
    """Return joints (6, 2) by the file, their changes, and the joints' middle and radius."""
    start, end = (each[part].reshape(6, 3)[:, :2] for each in (found.start, found.values))
    middle = start.mean(axis=0)
    return start, end - start, middle, float(np.linalg.norm(start - middle, axis=1).max())


def _arrow_scale(found: Calibration) -> float:
    """Return how many times too long the arrows of both plates are; 0: all changes are noise."""
    changed = np.abs(found.values - found.start) > _NOISE * found.errors
    if not any(changed[part].any() for part in (BASE, PLATFORM)):
        return 0.0
    scales = []
    for part in (BASE, PLATFORM):
        _, moved, _, radius = _seen_from_above(found, part)
        longest = float(np.linalg.norm(moved, axis=1).max())
        scales.append(_ARROW * radius / longest if longest > 0.0 else math.inf)
    return min(scales)


def _view(found: Calibration, part: slice, title: str, times: float) -> str:
    """Return joints from above, with arrows of their changes, ``times`` too long."""
    start, moved, middle, radius = _seen_from_above(found, part)
    width = 1.6 * radius
    picture = Picture(460, 400, f'{title}: change of each joint')
    chart = Chart(picture, (55.0, 30.0, 350.0, 350.0), *(
        (float(middle[n] - width), float(middle[n] + width)) for n in range(2)))
    picture.path(chart.at(start), closed=True, css='grid')
    picture.text([20.0, 16.0], f'{title}, ' + (
        f'arrows {digits(float(f"{times:.2g}"))} times as long' if times else
        'no change above the noise'), css='view')
    points = chart.at(start), chart.at(start + times * moved)
    way: Array = np.linspace(0.0, 1.0, 33, dtype=float)[:, None, None]
    taken = [(points[0] + way * (points[1] - points[0])).reshape(-1, 2)]
    for leg, (at, to) in enumerate(zip(*points, strict=True)):
        picture.circle(at, 5.0, css='joint')
        if times:
            picture.line(at, to, css=f'edge leg{leg}')
            picture.circle(to, 2.6, fill=f'var(--leg{leg})')
    for leg, at in enumerate(points[0]):
        text = (f'{found.parameters.joints[leg]}: '
                f'{_MM * np.linalg.norm(moved[leg]):.3g} mm')
        corner = _free(at, np.array([_CHARACTER * len(text), _LINE]), at - chart.at(middle),
                       np.concatenate(taken), picture)
        picture.text(corner + [0.0, _LINE - 3.0], text, css='tick')
        taken.append(corner + np.stack(np.meshgrid(
            np.linspace(0.0, 1.0, 9), [0.0, 0.5, 1.0]), axis=-1).reshape(-1, 2)
            * [_CHARACTER * len(text), _LINE])
    return picture.svg()


def _free(at: Array, size: Array, outward: Array, taken: Array, picture: Picture) -> Array:
    """Return the corner of a label next to a point with the fewest taken points (N, 2) in it."""
    first = math.atan2(outward[1], outward[0])
    best: Array = at
    fewest = math.inf
    for radius in (14.0, 26.0, 40.0):
        for turn in (0.0, 0.6, -0.6, 1.2, -1.2, 1.8, -1.8, 2.4, -2.4, 3.1):
            way = np.array([math.cos(first + turn), math.sin(first + turn)])
            # the side of the label that is toward the point
            free = at + radius * way + size * (0.5 * way - 0.5)
            corner: Array = np.asarray(np.clip(
                free, [2.0, 20.0], [picture.width, picture.height] - size - 2.0), dtype=float)
            inside = ((taken > corner - 2.0) & (taken < corner + size + 2.0)).all(axis=1).sum()
            if inside < fewest:
                best, fewest = corner, inside
    return best
