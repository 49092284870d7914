# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The report of motion cueing as one HTML page, and its pictures."""

from __future__ import annotations

from collections.abc import Mapping
import math
from pathlib import Path

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.cueing.cueing_result import AxisResponse, CueingResult
from stewart_dynamics.cueing.motion_cueing import AXES, OMCT_FREQUENCIES
from stewart_dynamics.cueing.report import Cued
from stewart_dynamics.datasheet.charts import use_chart
from stewart_dynamics.reporting.curves import Curves
from stewart_dynamics.reporting.pages import page
from stewart_dynamics.reporting.vector_picture import Chart, Picture
from stewart_dynamics.whole_file import write_files

_FOLDER = Path(__file__).with_name('templates')
_BUCKETS = 512  # of a curve over time
_FREQUENCIES = 0.09, 18.0  # of the frequency responses [rad/s]
_UNITS = ('m/s²',) * 3 + ('rad/s',) * 3


def write_page(path: Path, result: CueingResult, times: Array, found: Cued,
               used: Mapping[str, Array]) -> None:
    """Write the page with the content of cueing.json; ``used`` (M,) at even times."""
    curves = Curves(math.inf, _BUCKETS)
    curves.add(times, np.concatenate([found.wanted.T, found.felt.T]))
    sampled: Array = np.linspace(0.0, times[-1], len(next(iter(used.values()))), dtype=float)
    text = page(_FOLDER, 'cueing', document=True, r=result, axes=AXES,
                name=Path(result.vehicle).name, felt=[
                    _over_time(curves.drawn(n), curves.drawn(n + 6), f'{axis} [{_UNITS[n]}]')
                    for n, axis in enumerate(AXES)],
                used=use_chart(sampled, used, math.inf).svg(), response=[
                    _bode(axis, each) for axis, each in result.response.axes.items()],
                cross=[(axis, other, max(values), max(each.analytic_cross.get(other, [0.0])))
                       for axis, each in result.response.axes.items()
                       for other, values in each.cross.items() if max(values) > 1e-3])
    write_files({path: text})


def _range(*values: Array) -> tuple[float, float]:
    low, high = min(float(np.nanmin(each)) for each in values), max(
        float(np.nanmax(each)) for each in values)
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def _over_time(wanted: tuple[Array, Array], felt: tuple[Array, Array], title: str) -> str:
    """Return a picture of the curves of a demanded and an achieved quantity."""
    picture = Picture(1160, 190, f'demanded and achieved: {title}')
    chart = Chart(picture, (60.0, 26.0, 1080.0, 126.0), (0.0, float(wanted[0][-1])),
                  _range(wanted[1], felt[1]))
    chart.draw_axes('time [s]', title, 8)
    for css, curve in (('wanted', wanted), ('felt', felt)):
        picture.path(chart.at(np.column_stack(curve)), css=css)
    return picture.svg()


def _bode(axis: str, response: AxisResponse) -> str:
    """Return a picture of gain and phase over the frequency, measured and analytic."""
    picture = Picture(380, 330, f'response of {axis}')
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
        chart = Chart(picture, (54.0, top, 306.0, 96.0), _FREQUENCIES, (low, high),
                      logarithmic=True)
        chart.draw_axes('' if title == 'gain' else 'frequency [rad/s]', title, 4)
        picture.path(chart.at(np.column_stack([OMCT_FREQUENCIES, exact])), css='wanted')
        for point in chart.at(np.column_stack([OMCT_FREQUENCIES, values])):
            picture.circle(point, 2.6, css='measured')
    return picture.svg()
