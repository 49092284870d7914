# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Charts of a datasheet: sections of the workspace, tilt, payload, and use of limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.workspace import Section
from stewart_dynamics.datasheet.rated_workspace import Boundary, Frequencies
from stewart_dynamics.reporting.curves import Curves
from stewart_dynamics.reporting.vector_picture import Chart, Picture, tick_text, ticks

_WIDTH = 340.0
# Dashes of a boundary by the limit that it is, before its color by the leg.
DASHES = {'length_max': None, 'length_min': '6 3', 'base_joint_angle_max': '2 2.5',
          'platform_joint_angle_max': '9 2 2 2', 'leg_clearance_min': '4 2 1 2 1 2',
          'singularity': '1 3', 'angle_max': None, 'angle_min': '6 3',
          'lever_min': '4 2 1 2 1 2'}
# Largest number of names of curves in a line.
_IN_ROW = 3
# Dashes of curves in one chart, in the order in which they are drawn.
_CURVE_DASHES = None, '7 5', '2 4', '11 4 2 4'
_MILLI = 1e3
# Shades of a quantity over a section.
_BANDS = 8


def section_chart(section: Section, origin: Array, axes: tuple[int, int], ranges: Array | None,
                  ) -> Picture:
    """Draw a section around a position [mm], and the rectangle in it of ranges (6, 2) [m]."""
    first, second = axes
    picture, chart, loops = _section(section, origin, axes, 'Workspace')
    picture.path(*map(chart.at, loops), closed=True, css='area', fill_rule='evenodd')
    chart.draw_axes(f'{"XYZ"[first]} [mm]', f'{"XYZ"[second]} [mm]')
    for part in section.boundary:
        _draw_edge(picture, chart.at(_flat(part.points, origin, axes)), part.limit, part.leg)
    if ranges is not None:
        (a, b), (c, d) = _MILLI * ranges[first], _MILLI * ranges[second]
        picture.path(chart.at([[a, c], [b, c], [b, d], [a, d]]), closed=True, css='set')
    _cross(picture, chart.at([0.0, 0.0]))
    return picture


def frequency_chart(section: Section, modes: Frequencies, origin: Array, axes: tuple[int, int],
                    ) -> Picture:
    """Draw the lowest natural frequency over a section, darker where it is higher."""
    picture, chart, loops = _section(section, origin, axes, 'Lowest natural frequency')
    low, high = float(np.nanmin(modes.values)), float(np.nanmax(modes.values))
    values = _spread(modes.values)
    with np.errstate(invalid='ignore'):
        bands = np.minimum((values - low) / max(high - low, 1e-9 * high) * _BANDS, _BANDS - 1)
    half = [0.5 * _MILLI * (each[1] - each[0]) for each in modes[:2]]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    for band in range(_BANDS):
        cells = np.argwhere(np.floor(np.nan_to_num(bands, nan=-1.0)) == band)
        middles = _MILLI * np.stack([modes.first[cells[:, 0]], modes.second[cells[:, 1]]], axis=1)
        shade = {'css': 'band', 'fill_opacity': f'{(band + 1) / _BANDS:.3g}',
                 'shape_rendering': 'crispEdges'}
        picture.path(*(chart.at(each + corners) for each in middles), closed=True, **shade)
        x = 66.0 + 18.0 * band
        picture.path(np.array([[x, 311.0], [x + 18.0, 311.0], [x + 18.0, 320.0], [x, 320.0]]),
                     closed=True, **shade)
    picture.text([60.0, 320.0], f'{tick_text(_rounded(low))} Hz', 'end', css='tick')
    picture.text([72.0 + 18.0 * _BANDS, 320.0], f'{tick_text(_rounded(high))} Hz', css='tick')
    curves = [chart.at(loop) for loop in loops]
    (left, right), (bottom, top) = chart.x, chart.y
    frame = chart.at([[left, bottom], [right, bottom], [right, top], [left, top]])
    picture.path(frame, *curves, closed=True, css='outside', fill_rule='evenodd')
    chart.draw_axes(f'{"XYZ"[axes[0]]} [mm]', f'{"XYZ"[axes[1]]} [mm]')
    for curve in curves:
        picture.path(curve, closed=True, css='edge')
    _cross(picture, chart.at([0.0, 0.0]))
    return picture


def _spread(values: Array) -> Array:
    """Return values of cells, also of those outside that the boundary may cross: a neighbor's."""
    for _ in range(2):
        around = np.pad(values, 1, constant_values=np.nan)
        n, m = values.shape
        values = np.where(np.isnan(values), np.fmax.reduce(
            [around[i:i + n, j:j + m] for i in range(3) for j in range(3)]), values)
    return values


def _section(section: Section, origin: Array, axes: tuple[int, int], title: str,
             ) -> tuple[Picture, Chart, list[Array]]:
    """Return an empty picture of a section, and its closed curves [mm]."""
    first, second = ('XYZ'[axis] for axis in axes)
    picture = Picture(_WIDTH, 330.0, f'{title}, {first}-{second} section')
    loops = [_flat(each, origin, axes) for each in section.loops]
    x, y = _equal_ranges(np.concatenate(loops) if loops else np.zeros((1, 2)), (272.0, 252.0))
    return picture, Chart(picture, (52.0, 30.0, 272.0, 252.0), x, y), loops


def _flat(points: Array, origin: Array, axes: tuple[int, int]) -> Array:
    moved: Array = _MILLI * (points - origin)[:, axes]
    return moved


def _rounded(value: float) -> float:
    return float(f'{value:.3g}')


def tilt_chart(boundaries: Sequence[Boundary], names: Sequence[str]) -> Picture:
    """Draw tilts over their azimuths [degrees]; the first boundary is that of the pose."""
    picture = Picture(_WIDTH, 330.0, 'Largest tilt over its azimuth')
    largest = max(float(np.max(each.values[np.isfinite(each.values)], initial=0.0))
                  for each in boundaries)
    rings = ticks(0.0, np.degrees(largest), 4)
    outer = max(np.degrees(largest) * 1.02, rings[-1])
    center, radius = np.array([170.0, 156.0]), 116.0
    scale = radius / outer
    for ring in rings[1:]:
        picture.circle(center, ring * scale, css='grid', fill='none')
    for angle in range(0, 360, 30):
        way = _toward(np.radians(angle))
        picture.line(center, center + radius * way, css='grid')
        # beside the circle, so that no boundary is below it
        anchor = 'middle' if abs(way[0]) < 0.1 else 'start' if way[0] > 0.0 else 'end'
        picture.text(center + (radius + 7.0) * way + [0.0, 3.5 + 3.0 * way[1]], f'{angle}°',
                     anchor, css='tick')
    ways = _toward(np.linspace(0.0, 2.0 * np.pi, len(boundaries[0].values), endpoint=False))
    for n, each in reversed(list(enumerate(boundaries))):
        values = np.degrees(np.where(np.isfinite(each.values), each.values, np.nan)) * scale
        points = center + values[:, None] * ways
        if n == 0:
            picture.path(points, closed=True, css='area')
            for limit, leg, which in _pieces(each):
                _draw_edge(picture, points[which], limit, leg)
        else:
            picture.path(points, closed=True, css=f'other other{n}')
    for ring in rings[1:]:
        picture.text(center + ring * scale * _toward(np.radians(75.0)) + [2.0, 3.0],
                     f'{tick_text(ring)}°', css='tick halo')
    for n, name in enumerate(names):
        at = [10.0 + 112.0 * n, 318.0]
        picture.line([at[0], at[1] - 3.5], [at[0] + 18.0, at[1] - 3.5],
                     css='key' if n == 0 else f'other other{n}')
        picture.text([at[0] + 23.0, at[1]], name, css='tick')
    return picture


def curves_chart(title: str, x: Array, curves: Mapping[str, Array], x_title: str, y_title: str,
                 ) -> Picture:
    """Draw curves over a common axis, from zero."""
    picture = Picture(_WIDTH, 330.0, title)
    top = max(float(np.max(each[np.isfinite(each)], initial=0.0)) for each in curves.values())
    chart = Chart(picture, (52.0, 30.0, 272.0, 228.0), (float(x[0]), float(x[-1])),
                  (0.0, 1.05 * top if top else 1.0))
    chart.draw_axes(x_title, y_title)
    for n, (name, values) in enumerate(curves.items()):
        look = _look(n)
        picture.path(chart.at(np.stack([x, values], axis=1)), **look)
        in_row = len(curves) if len(curves) <= _IN_ROW else 2
        row, column = divmod(n, in_row)
        left, low = 14.0 + 326.0 / in_row * column, 318.0 - 15.0 * (
            (len(curves) - 1) // in_row - row)
        picture.line([left, low - 3.5], [left + 16.0, low - 3.5], **look)
        picture.text([left + 20.0, low], name, css='tick')
    return picture


def use_chart(seconds: Array, used: Mapping[str, Array], timeout: float) -> Picture:
    """Draw how much of each limit a motion uses over time [%]."""
    picture = Picture(700.0, 300.0, 'Use of the limits over time')
    finite = [each[np.isfinite(each)] for each in used.values()]
    top = 100.0 * min(max(1.1, *(float(np.max(each, initial=0.0)) * 1.05 for each in finite)), 3.0)
    end = float(seconds[-1]) if seconds[-1] > 0.0 else 1.0
    chart = Chart(picture, (46.0, 26.0, 640.0, 208.0), (0.0, end), (0.0, top))
    y = float(chart.at([0.0, 100.0])[1])
    picture.add('rect', x=46.0, y=26.0, width=640.0, height=y - 26.0, css='beyond')
    chart.draw_axes('time [s]', 'use of the limit [%]', 8)
    picture.line([46.0, y], [686.0, y], css='limit')
    curves = Curves(timeout, 512)
    curves.add(seconds, np.array(list(used.values())) * 100.0)
    for n, name in enumerate(used):
        times, values = curves.drawn(n)
        points = chart.at(np.stack([times, np.minimum(values, top)], axis=1))
        look = _look(n)
        picture.path(points, **look)
        left = 46.0 + min(112.0, 654.0 / len(used)) * n
        picture.line([left, 284.5], [left + 14.0, 284.5], **look)
        picture.text([left + 18.0, 288.0], name, css='tick')
    return picture


def _look(n: int) -> dict[str, Any]:
    """Return color and dashes of a curve: an equal one below it is seen in their gaps."""
    return {'css': f'curve leg{n}', 'stroke_dasharray': _CURVE_DASHES[n % len(_CURVE_DASHES)]}


def _toward(azimuth: ArrayLike) -> Array:
    """Return unit vectors in the picture toward azimuths from x (right) to y (up)."""
    way: Array = np.stack([np.cos(azimuth), -np.sin(azimuth)], axis=-1)
    return way


def _equal_ranges(points: Array, size: tuple[float, float],
                  ) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return ranges of equal scale around points."""
    known = np.concatenate([points[np.isfinite(points).all(axis=1)], np.zeros((1, 2))])
    low, high = known.min(axis=0), known.max(axis=0)
    per_pixel = 1.08 * float(np.max((high - low) / np.array(size)))
    half = per_pixel * np.array(size) / 2.0
    middle = (low + high) / 2.0
    (x0, y0), (x1, y1) = middle - half, middle + half
    return (float(x0), float(x1)), (float(y0), float(y1))


def _draw_edge(picture: Picture, points: Array, limit: str, leg: int) -> None:
    """Draw a part of a boundary in the color of its leg, dashed by its limit."""
    picture.path(points, css=f'edge leg{leg}' if leg >= 0 else 'edge',
                 stroke_dasharray=DASHES.get(limit))


def _pieces(boundary: Boundary) -> Iterator[tuple[str, int, Integers]]:
    """Yield the pieces of a closed boundary with one limit and leg, and their points."""
    count = len(boundary.values)
    ends = list(zip(boundary.limits, boundary.legs, strict=True))
    starts = [n for n in range(count) if ends[n] != ends[n - 1]] or [0]
    for n, begin in enumerate(starts):
        stop = starts[n + 1] if n + 1 < len(starts) else starts[0] + count
        yield *ends[begin], np.arange(begin, stop + 1) % count


def _cross(picture: Picture, at: Array) -> None:
    for way in ([5.0, 0.0], [0.0, 5.0]):
        picture.line(at - way, at + np.array(way), css='cross')
