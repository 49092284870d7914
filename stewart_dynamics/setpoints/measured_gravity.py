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
Checks the measured gravity in base axes by the rules for the parameter, and the gyro against it.

The mean over each second is checked, and a mistake is likely only while it is that of every
second so far: a base may move, but it does not fall forever. A gyro whose integral turns gravity
many times as far as the accelerometer sees it turn is in deg/s.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND
from stewart_dynamics.mechanics.frames.motion import listed
from stewart_dynamics.mechanics.gravity_mistakes import AWAY, IN_G, likely_mistake, NONE
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.rows import BASE_ANGULAR_VELOCITY, GRAVITY
from stewart_dynamics.parameters.table import BY_IMU, Parameters, STANDARD_GRAVITY

# Samples of a second that are enough for a mean.
_FEWEST = 5
# No base turns as fast as this for seconds [rad/s].
_FASTEST = 2.0 * math.pi
# The turn of gravity by the gyro divided by that seen: 57 for deg/s.
_TIMES_AS_FAR = 10.0
# Change of gravity in a second by the gyro from which it is compared [m/s^2].
_CHANGE = 0.3 * -STANDARD_GRAVITY[2]

_OF_IMU = {
    NONE: 'removed by the driver? linear_acceleration is the specific force, upward at rest',
    IN_G: f'in g? linear_acceleration is in m/s^2, {-STANDARD_GRAVITY[2]:g} upward at rest',
    AWAY: 'pulls the platform away from the base: a sign? base.imu.orientation? For a hexapod '
          'that hangs, or whose axes point down, set geometry.platform_side'}
_OF_POSE = {
    AWAY: 'pulls the platform away from the base: is the pose turned over, or its quaternion w '
          'first? For a hexapod that hangs, or whose axes point down, set '
          'geometry.platform_side'}
_IN_DEGREES = 'likely mistake: angular_velocity in deg/s?'


class MeasuredGravity:
    """
    Follows gravity and angular velocity of the base.

    parameters: the side of the platform, and the source of the base's motion.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._home = home_of(parameters)
        self._is_imu = parameters['base.source'] == BY_IMU
        self._texts = _OF_IMU if self._is_imu else _OF_POSE
        self._stamps: list[int] = []
        self._rows: list[Sequence[float]] = []
        self._seconds = 0
        self._kinds: set[str] = set()  # of mistakes; one alone is likely
        self._sum = np.zeros(3)
        self._speed = 0.0  # sum over seconds of the mean [rad/s]
        self._turns = np.zeros(2)  # squares of changes of gravity, by gyro and seen

    def add(self, stamp: int, row: Sequence[float]) -> None:
        """Add a sample: stamp [ns], row (BASE,)."""
        if self._stamps and not 0 <= stamp - self._stamps[0] < SECOND:
            if SECOND <= stamp - self._stamps[0] < 2 * SECOND and len(self._stamps) >= _FEWEST:
                self._add_second(np.array(self._stamps), np.array(self._rows))
            self._stamps, self._rows = [], []
        self._stamps.append(stamp)
        self._rows.append(row)

    def _add_second(self, stamps: Array, rows: Array) -> None:
        with np.errstate(all='ignore'):
            gravity, spin = rows[:, GRAVITY], rows[:, BASE_ANGULAR_VELOCITY]
            mean = gravity.mean(axis=0)
            self._seconds += 1
            self._sum += mean
            self._kinds.add(likely_mistake(mean, self._home))
            if not self._is_imu:
                return
            self._speed += float(np.linalg.norm(spin, axis=1).mean())
            rates = np.cross(gravity, spin)  # of a constant vector in turning axes
            steps = np.diff(stamps)[:, None] * NANOSECOND
            change = np.sum(0.5 * steps * (rates[1:] + rates[:-1]), axis=0)
            seen = gravity[-1] - gravity[0]
            self._turns += float(change @ change), float(seen @ seen)

    @property
    def mistake(self) -> str:
        """Return the likely mistake; empty without one."""
        if not self._seconds:
            return ''
        mean = self._sum / self._seconds
        kind = next(iter(self._kinds)) if len(self._kinds) == 1 else ''
        if kind in self._texts:
            size = f'{float(np.linalg.norm(mean)):.3g}'
            value = f'{listed((mean + 0.0).round(3), 3)}' if kind == AWAY else size
            return (f'measured gravity, base axes: {value} m/s^2'
                    f'{" " if kind == AWAY else ": "}{self._texts[kind]}')
        speed = self._speed / self._seconds
        if speed > _FASTEST:
            return f'angular velocity of the base, {speed:.3g} rad/s on average: {_IN_DEGREES}'
        by_gyro, seen = np.sqrt(self._turns / self._seconds).tolist()
        if by_gyro > _CHANGE and by_gyro > _TIMES_AS_FAR * seen:
            return (f'angular velocity of the base turns gravity by {by_gyro:.3g} m/s^2 in a '
                    f'second, the accelerometer sees {seen:.3g} m/s^2: {_IN_DEGREES}')
        return ''
