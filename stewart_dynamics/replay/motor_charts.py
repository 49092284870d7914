# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Speed and torque of the motors in a bag, drawn against what the motors can deliver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.mechanics.drives.motor_limits import largest_speeds, largest_torques
from stewart_dynamics.mechanics.drives.motors import Motors
from stewart_dynamics.parameters.table import Parameters, six_of
from stewart_dynamics.replay.bag_summary import MotorLoads
from stewart_dynamics.reporting.vector_picture import Chart, Picture

# Cells of each motor: magnitude of the speed, torque.
_CELLS = 128
_FINEST = -40  # exponent of two of the smallest cell
_WIDTH, _HEIGHT = 400.0, 280.0
_FRAME = (46.0, 26.0, 344.0, 212.0)
# Bounds that are farther than this factor above all setpoints do not set the scale.
_FAR = 4.0
# Opacities of cells with few and many samples.
_SHADES = (0.35, 0.6, 0.85)


class OperatingPoints:
    """
    How often each motor is at each speed and torque, counted in a grid that grows with them.

    Torque is positive where the motor drives its leg, negative where it brakes. The sizes of the
    cells are powers of two: the result does not depend on how samples are split into blocks.
    """

    def __init__(self) -> None:
        self._counts: Integers = np.zeros((6, _CELLS, _CELLS), dtype=np.int64)
        self._exponents = [_FINEST, _FINEST]

    def add(self, motors: Motors) -> None:
        """Add motors (N,)."""
        torques, speeds = motors.breakaway_torques, np.abs(motors.speeds)
        torques = np.where(motors.speeds == 0.0, np.abs(torques),
                           torques * np.sign(motors.speeds))
        known = np.isfinite(torques) & np.isfinite(speeds)
        if not known.any():
            return
        self._grow(0, float(speeds[known].max()) / _CELLS)
        self._grow(1, float(np.abs(torques[known]).max()) / (_CELLS // 2))
        cells = [np.floor(np.ldexp(each, -exponent)[known]).astype(np.int64)
                 for each, exponent in zip((speeds, torques), self._exponents, strict=True)]
        legs = np.nonzero(known)[1]
        flat = (legs * _CELLS + cells[0]) * _CELLS + cells[1] + _CELLS // 2
        self._counts += np.bincount(flat, minlength=self._counts.size).reshape(self._counts.shape)

    def _grow(self, axis: int, size: float) -> None:
        """Merge cells in pairs until they are larger than a size."""
        wanted = max(math.frexp(size)[1], _FINEST)
        while self._exponents[axis] < wanted:
            counts = np.moveaxis(self._counts, axis + 1, 2)
            pairs = counts[..., ::2] + counts[..., 1::2]
            first = 0 if axis == 0 else _CELLS // 4
            counts[...] = 0
            counts[..., first:first + _CELLS // 2] = pairs
            self._exponents[axis] += 1

    def cells(self, leg: int) -> tuple[Array, Integers]:
        """Return lower corners and sizes (K, 4) [rad/s, N m] of a motor's cells, and counts."""
        at = np.argwhere(self._counts[leg])
        sizes = np.ldexp(1.0, self._exponents)
        corners = (at - [0, _CELLS // 2]) * sizes
        return (np.concatenate([corners, np.broadcast_to(sizes, corners.shape)], axis=1),
                self._counts[leg][tuple(at.T)])

    @property
    def extent(self) -> tuple[float, float]:
        """Return the largest speed and torque of all cells [rad/s, N m]."""
        corners = np.concatenate([self.cells(leg)[0] for leg in range(6)])
        if not len(corners):
            return 0.0, 0.0
        far = np.maximum(np.abs(corners[:, :2]), np.abs(corners[:, :2] + corners[:, 2:]))
        speed, torque = far.max(axis=0).tolist()
        return speed, torque


class Deliverable:
    """Largest torque of a motor over its speed, by ``drive.*``."""

    def __init__(self, parameters: Parameters, leg: int) -> None:
        self._parameters, self._leg = parameters, leg
        self._curve = parameters.drive.torque_speed
        self.torque = float(six_of(parameters.drive.torque_max, math.inf)[leg])
        if self._curve is not None:
            self.torque = min(self.torque, float(self._curve[:, 1].max()))
        self.speed = float(largest_speeds(parameters)[leg])

    def at(self, speeds: Array) -> Array:
        """Return the largest torques at speeds (N,); zero beyond the largest speed."""
        torques = largest_torques(self._parameters, speeds[:, None])[:, self._leg]
        return np.where(speeds > self.speed, 0.0, torques)

    def outline(self, end: float) -> Array:
        """Return the points (N, 2) of its curve up to a speed, and down to zero at its end."""
        last = min(self.speed, end)
        speeds: Array = np.linspace(0.0, last, 257, dtype=np.float64)
        if self._curve is not None:
            speeds = np.union1d(speeds, self._curve[self._curve[:, 0] < last, 0])
        points: Array = np.column_stack([speeds, self.at(speeds)])
        return points if last < self.speed else np.vstack([points, [last, 0.0]])


def motor_charts(points: OperatingPoints, parameters: Parameters,
                 loads: Mapping[str, MotorLoads]) -> dict[str, str]:
    """
    Return a picture (SVG) of each motor, all with the same axes.

    The loads are those of the motor of each leg.
    """
    limits = [Deliverable(parameters, leg) for leg in range(6)]
    continuous = parameters.drive.torque_continuous
    speed, torque = points.extent
    speed = 1.06 * _scale(speed, [limit.speed for limit in limits])
    torque = 1.08 * _scale(torque, [*(limit.torque for limit in limits),
                                    *(() if continuous is None else continuous)])
    return {name: _chart(points, leg, name, limits[leg], parameters, load, (speed, torque)).svg()
            for leg, (name, load) in enumerate(loads.items())}


def _scale(used: float, bounds: Sequence[float]) -> float:
    """Return the end of an axis: the largest value in use, or a bound that is not far above."""
    near = _FAR * used if used > 0.0 else math.inf
    return max([used, *(each for each in bounds if each <= near and math.isfinite(each))]) or 1.0


def _chart(points: OperatingPoints, leg: int, name: str, limit: Deliverable,
           parameters: Parameters, load: MotorLoads, largest: tuple[float, float],
           ) -> Picture:
    picture = Picture(_WIDTH, _HEIGHT, f'Torque over speed of {name}')
    speed, torque = largest
    chart = Chart(picture, _FRAME, (0.0, speed), (-torque, torque))
    outline = limit.outline(speed)
    within = np.minimum(outline, [speed, torque])
    picture.path(chart.at(np.vstack([within, within[::-1] * [1.0, -1.0]])), closed=True,
                 css='deliverable')
    chart.draw_axes('speed [rad/s]', 'torque [N m]')
    cells, counts = points.cells(leg)
    # A cell is beyond if all of it is.
    lower = np.where(cells[:, 1] < 0.0, -cells[:, 1] - cells[:, 3], cells[:, 1])
    beyond = lower > limit.at(cells[:, 0]) * (1.0 + 1e-9)
    shade = np.minimum(len(_SHADES) * np.log1p(counts) / np.log1p(counts.max(initial=1)),
                       len(_SHADES) - 1).astype(int)
    for n, opacity in enumerate(_SHADES):
        for which, css in ((~beyond, f'points leg{leg}'), (beyond, 'points beyond')):
            _draw_cells(picture, chart, cells[which & (shade == n)], css, opacity)
    # The curve is drawn where it, or the next point of it, is in the frame.
    over = outline[:, 1] > torque
    over &= np.r_[True, over[:-1]] & np.r_[over[1:], True]
    curve = np.where(over[:, None], math.nan, within)
    picture.path(chart.at(curve), chart.at(curve * [1.0, -1.0]), css='curve')
    outside = [f'{bound:.4g} {unit}' for bound, end, unit in (
        (limit.torque, torque, 'N m'), (limit.speed, speed, 'rad/s'))
        if end < bound < math.inf]
    if outside:
        left, top, width, _ = _FRAME
        picture.text([left + width, top - 8.0], f'deliverable to {" and ".join(outside)}', 'end',
                     css='tick')
    continuous = parameters.drive.torque_continuous
    if continuous is not None and continuous[leg] <= torque:
        for level in (continuous[leg], -continuous[leg]):
            picture.line(*chart.at([[0.0, level], [speed, level]]), css='continuous')
    if load.speed_mean_rad_s is not None and load.torque_rms_n_m is not None:
        at = chart.at([load.speed_mean_rad_s, load.torque_rms_n_m])
        picture.path(at + [[0.0, -6.0], [6.0, 0.0], [0.0, 6.0], [-6.0, 0.0]], closed=True,
                     css='rms')
    return picture


def _draw_cells(picture: Picture, chart: Chart, cells: Array, css: str, opacity: float) -> None:
    corners = cells[:, None, :2] + cells[:, None, 2:] * [[0, 0], [1, 0], [1, 1], [0, 1]]
    picture.path(*chart.at(corners), closed=True, css=css, fill_opacity=opacity)
