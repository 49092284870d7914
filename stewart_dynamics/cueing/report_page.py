# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The report of motion cueing as one HTML page, and its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.cueing_result import AxisResponse, CueingResult
from stewart_dynamics.cueing.motion_cueing import AXES, OMCT_FREQUENCIES
from stewart_dynamics.cueing.report import Cued
from stewart_dynamics.reporting.pages import page
from stewart_dynamics.reporting.vector_picture import Chart, Picture, tick_text, ticks
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
# Points of a curve: the largest and the smallest of each piece.
_PIECES = 600
_UNITS = ('m/s²',) * 3 + ('rad/s',) * 3


def write_page(path: Path, result: CueingResult, times: Array, found: Cued,
               used: Mapping[str, Array]) -> None:
    """Write the page with the content of cueing.json."""
    text = page(_FOLDER, 'cueing', document=True, r=result, axes=AXES,
                name=Path(result.vehicle).name, felt=[
                    over_time(times, found.wanted[:, n], found.felt[:, n],
                              f'{axis} [{_UNITS[n]}]') for n, axis in enumerate(AXES)],
                used=_uses(float(times[-1]), used), response=[
                    _bode(axis, each) for axis, each in result.response.axes.items()],
                cross=[(axis, other, max(values), max(each.analytic_cross.get(other, [0.0])))
                       for axis, each in result.response.axes.items()
                       for other, values in each.cross.items() if max(values) > 1e-3])
    write_files({path: text})


def _thinned(times: Array, values: Array) -> Array:
    """Return points (M, 2) of a curve that look the same."""
    if len(times) <= 2 * _PIECES:
        return np.column_stack([times, values])
    found = []
    for some in np.array_split(np.arange(len(times)), _PIECES):
        ends = sorted({int(some[values[some].argmin()]), int(some[values[some].argmax()])})
        found += [(times[n], values[n]) for n in ends]
    return np.array(found)


def _range(*values: Array) -> tuple[float, float]:
    low, high = min(float(each.min()) for each in values), max(
        float(each.max()) for each in values)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def over_time(times: Array, wanted: Array, felt: Array, title: str) -> str:
    """Return a picture of a demanded and an achieved quantity over time."""
    picture = Picture(1160, 190, f'demanded and achieved: {title}')
    chart = Chart(picture, (60.0, 26.0, 1080.0, 126.0), (0.0, float(times[-1])),
                  _range(wanted, felt))
    chart.draw_axes('time [s]', title, 8)
    picture.path(chart.at(_thinned(times, wanted)), css='wanted')
    picture.path(chart.at(_thinned(times, felt)), css='felt')
    return picture.svg()


def _uses(duration: float, used: Mapping[str, Array]) -> str:
    """Return a picture of the use of each kind of limit over time."""
    picture = Picture(1160, 230, 'use of the limits over time')
    top = max(1.05, *(min(float(each.max()), 2.0) for each in used.values()))
    chart = Chart(picture, (60.0, 26.0, 960.0, 166.0), (0.0, duration), (0.0, top))
    chart.draw_axes('time [s]', 'use of a limit', 8)
    for n, (name, each) in enumerate(used.items()):
        times: Array = np.linspace(0.0, duration, len(each), dtype=float)
        points = _thinned(times, np.minimum(each, top))
        picture.path(chart.at(points), css=f'edge leg{n % 6}')
        picture.text([1030.0, 40.0 + 17.0 * n], name, css=f'key leg{n % 6}')
    picture.line(*(chart.at([x, 1.0]) for x in chart.x), css='limit')
    return picture.svg()


def _bode(axis: str, response: AxisResponse) -> str:
    """Return a picture of gain and phase over the frequency, measured and analytic."""
    picture = Picture(380, 330, f'response of {axis}')
    decades = np.log10(OMCT_FREQUENCIES)
    picture.text([14.0, 16.0], axis, css='view')
    for top, title, *curves in (
            (46.0, 'gain', response.gain, response.analytic_gain),
            (196.0, 'phase [deg]', response.phase_deg, response.analytic_phase_deg)):
        values, exact = map(np.array, curves)
        if title != 'gain':
            exact = np.degrees(np.unwrap(np.radians(exact)))
            values = exact + (values - exact + 180.0) % 360.0 - 180.0
        low, high = (0.0, max(1.0, 1.08 * float(values.max()))) if title == 'gain' else _range(
            values, exact)
        chart = Chart(picture, (54.0, top, 306.0, 96.0), (-1.05, 1.25), (low, high))
        for value in ticks(low, high, 4):
            (left, at), (right, _) = chart.at([[-1.05, value], [1.25, value]])
            picture.line([left, at], [right, at], css='grid')
            picture.text([left - 5.0, at + 3.5], tick_text(value), 'end', css='tick')
        for decade in (-1.0, 0.0, 1.0):
            x, bottom = chart.at([decade, low])
            picture.line([x, top], [x, bottom], css='grid')
            picture.text([x, bottom + 13.0], f'{10.0 ** decade:g}', 'middle', css='tick')
        picture.text([54.0, top - 6.0], title, css='tick')
        picture.path(chart.at(np.column_stack([decades, exact])), css='wanted')
        for point in chart.at(np.column_stack([decades, values])):
            picture.circle(point, 2.6, css='measured')
    picture.text([360.0, 322.0], '[rad/s]', 'end', css='tick')
    return picture.svg()
