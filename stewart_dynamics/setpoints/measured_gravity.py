# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Checks the measured gravity in base axes by the rules for the parameter, and the gyro against it.

Means over half a second are checked, and an error is likely if two in a row have it: a base may
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
from stewart_dynamics.mechanics.gravity_errors import AWAY, find_gravity_error, IN_G, NONE
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.rows import BASE_ANGULAR_VELOCITY, GRAVITY
from stewart_dynamics.parameters.table import BY_IMU, Parameters, STANDARD_GRAVITY
from stewart_dynamics.possible_errors.hypothesis import find_errors, First, Hypothesis, Table, When

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
    NONE: ': removed by the driver? linear_acceleration is the specific force, upward at rest',
    IN_G: f': in g? linear_acceleration is in m/s^2, {-STANDARD_GRAVITY[2]:g} upward at rest',
    AWAY: ' pulls the platform away from the base: a sign? base.imu.orientation? For a hexapod '
          'that hangs, or whose axes point down, set geometry.platform_side'}
_OF_POSE = {
    AWAY: ' pulls the platform away from the base: is the pose turned over, or its quaternion w '
          'first? For a hexapod that hangs, or whose axes point down, set '
          'geometry.platform_side'}
_IN_DEGREES = 'possible error: angular_velocity in deg/s?'


class _Window(NamedTuple):
    """Means of half a second."""

    stamp: int  # its beginning [ns]
    gravity: Array  # (3,) [m/s^2]
    error: str  # kind of the possible error
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
        self.is_imu = parameters.base.source == BY_IMU
        self._texts = _OF_IMU if self.is_imu else _OF_POSE
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
                int(stamps[0]), mean, find_gravity_error(mean, self._home),
                float(np.linalg.norm(spin, axis=1).mean()),
                float(np.linalg.norm(np.sum(0.5 * steps * (rates[1:] + rates[:-1]), axis=0))),
                float(np.linalg.norm(gravity[-1] - gravity[0]))))
        windows = list(self._windows)
        *_, before, last = [None, *windows]
        self.kind = '' if before is None or before.error != last.error else last.error
        self.text = self._texts.get(self.kind, '')
        self.value = (listed((last.gravity + 0.0).round(3) + 0.0, 3) if self.kind == AWAY
                      else f'{float(np.linalg.norm(last.gravity)):.3g}')
        self.speed = 0.0 if before is None else min(before.speed, last.speed)
        self.by_gyro, self.seen = (
            math.hypot(*each) / math.sqrt(len(windows))
            for each in zip(*((each.by_gyro, each.seen) for each in windows), strict=True))
        self.is_long = len(windows) == _COMPARED
        error = next(find_errors(_TABLE, self), None)
        self.present = None if error is None else (error.text, last.stamp)
        if error is not None and self.present is not None:
            self.found.setdefault(error.what, self.present)


_TABLE: Table[MeasuredGravity] = First(
    Hypothesis('{kind}', lambda m: len(m.text),
               'measured gravity, base axes: {value} m/s^2{text}'),
    When(lambda m: m.is_imu, First(
        Hypothesis(_IN_DEGREES, lambda m: m.speed - _FASTEST,
                   f'angular velocity of {{speed:.3g}} rad/s for a second: {_IN_DEGREES}'),
        Hypothesis(_IN_DEGREES, lambda m: m.is_long and (
            m.by_gyro > max(_CHANGE, _TIMES_AS_FAR * m.seen)), (
            'angular velocity turns gravity by {by_gyro:.3g} m/s^2 in half a second, the '
            f'accelerometer sees {{seen:.3g}} m/s^2: {_IN_DEGREES}')))))
