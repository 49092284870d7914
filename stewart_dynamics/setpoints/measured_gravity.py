# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Checks the measured gravity in base axes by the rules for the parameter, and the gyro against it.

Means over half a second are checked, and a mistake is likely if two in a row have it: a base may
move, but it does not fall for a second. A gyro whose integral turns gravity many times as far as
the accelerometer sees it turn is in deg/s.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps
from stewart_dynamics.mechanics.frames.motion import listed
from stewart_dynamics.mechanics.gravity_mistakes import AWAY, IN_G, likely_mistake, NONE
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.rows import BASE_ANGULAR_VELOCITY, GRAVITY
from stewart_dynamics.parameters.table import BY_IMU, Parameters, STANDARD_GRAVITY

_WINDOW = SECOND // 2  # [ns]
# Samples of a window that are enough for a mean.
_FEWEST = 2
# Windows that must agree; windows in which gyro and accelerometer are compared.
_LAST, _COMPARED = 2, 6
# No base turns as fast as this for a second [rad/s].
_FASTEST = 2.0 * math.pi
# The turn of gravity by the gyro divided by that seen: 57 for deg/s.
_TIMES_AS_FAR = 10.0
# Change of gravity by the gyro from which it is compared [m/s^2].
_CHANGE = 0.5 * -STANDARD_GRAVITY[2]

_OF_IMU = {
    NONE: 'removed by the driver? linear_acceleration is the specific force, upward at rest',
    IN_G: f'in g? linear_acceleration is in m/s^2, {-STANDARD_GRAVITY[2]:g} upward at rest',
    AWAY: 'pulls the platform away from the base: a sign? base.imu.orientation? For a hexapod '
          'that hangs, or whose axes point down, set geometry.platform_side'}
_OF_POSE = {
    AWAY: 'pulls the platform away from the base: is the pose turned over, or its quaternion w '
          'first? For a hexapod that hangs, or whose axes point down, set '
          'geometry.platform_side'}
_IN_DEGREES = 'possible error: angular_velocity in deg/s?'


class _Window(NamedTuple):
    """Means of half a second."""

    stamp: int  # its beginning [ns]
    gravity: Array  # (3,) [m/s^2]
    mistake: str  # kind of the possible error
    speed: float  # of the base's turning [rad/s]
    by_gyro: float  # change of gravity by the angular velocity [m/s^2]
    seen: float  # change of gravity as measured [m/s^2]


class MeasuredGravity:
    """
    Follows gravity and angular velocity of the base.

    parameters: the side of the platform, and the source of the base's motion.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._home = home_of(parameters)
        self._is_imu = parameters.base.source == BY_IMU
        self._texts = _OF_IMU if self._is_imu else _OF_POSE
        self._stamps: list[int] = []
        self._rows: list[Sequence[float]] = []
        self._windows: deque[_Window] = deque(maxlen=_COMPARED)
        self.present: tuple[str, int] | None = None
        """The possible error in the last second, and the stamp of its beginning [ns]."""
        self.found: dict[str, tuple[str, int]] = {}
        """The first of each kind."""

    def add_samples(self, stamps: Sequence[int], rows: Sequence[Sequence[float]]) -> None:
        """Add samples: stamps (N,) [ns], rows (N, BASE)."""
        for stamp, row in zip(stamps, rows, strict=True):
            if self._stamps and not 0 <= (passed := stamp - self._stamps[0]) < _WINDOW:
                if _WINDOW <= passed < 2 * _WINDOW and len(self._stamps) >= _FEWEST:
                    self._add_window(np.array(self._stamps), np.array(self._rows))
                else:
                    self._windows.clear()
                self._stamps, self._rows = [], []
            self._stamps.append(stamp)
            self._rows.append(row)

    def _add_window(self, stamps: Stamps, rows: Array) -> None:
        with np.errstate(all='ignore'):
            gravity, spin = rows[:, GRAVITY], rows[:, BASE_ANGULAR_VELOCITY]
            mean = gravity.mean(axis=0)
            rates = np.cross(gravity, spin)  # of a constant vector, in turning axes
            steps = np.diff(stamps)[:, None] * NANOSECOND
            self._windows.append(_Window(
                int(stamps[0]), mean, likely_mistake(mean, self._home),
                float(np.linalg.norm(spin, axis=1).mean()),
                float(np.linalg.norm(np.sum(0.5 * steps * (rates[1:] + rates[:-1]), axis=0))),
                float(np.linalg.norm(gravity[-1] - gravity[0]))))
        kind, text = self._mistake()
        self.present = (text, self._windows[-1].stamp) if kind else None
        if self.present:
            self.found.setdefault(kind, self.present)

    def _mistake(self) -> tuple[str, str]:
        """Return kind and words of the possible error, empty without one."""
        windows = list(self._windows)
        last = windows[-_LAST:]
        kind = last[-1].mistake
        if len(last) < _LAST:
            return '', ''
        if kind in self._texts and all(each.mistake == kind for each in last):
            mean = last[-1].gravity
            value = (listed((mean + 0.0).round(3) + 0.0, 3) if kind == AWAY
                     else f'{float(np.linalg.norm(mean)):.3g}')
            return kind, (f'measured gravity, base axes: {value} m/s^2'
                          f'{" " if kind == AWAY else ": "}{self._texts[kind]}')
        if not self._is_imu:
            return '', ''
        speed = min(each.speed for each in last)
        if speed > _FASTEST:
            return _IN_DEGREES, (
                f'angular velocity of {speed:.3g} rad/s for a second: {_IN_DEGREES}')
        by_gyro = math.hypot(*(each.by_gyro for each in windows)) / math.sqrt(len(windows))
        seen = math.hypot(*(each.seen for each in windows)) / math.sqrt(len(windows))
        if len(windows) == _COMPARED and by_gyro > max(_CHANGE, _TIMES_AS_FAR * seen):
            return _IN_DEGREES, (
                f'angular velocity turns gravity by {by_gyro:.3g} m/s^2 in half a second, the '
                f'accelerometer sees {seen:.3g} m/s^2: {_IN_DEGREES}')
        return '', ''
