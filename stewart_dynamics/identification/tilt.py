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
Tilt of the base: gravity rotated about two base axes, with constant magnitude.

Forces are linear in gravity, ``f = Y theta + sum_i d_i G_i theta`` with d the change of gravity
and G_i the part of Y due to one unit of gravity along axis i. So products of the change with the
gravity-dependent parameters are further linear parameters, exact for a tilt of any size.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.kinematics.home_pose import turns_about


class Tilt:
    """
    Gravity of the parameter file (3,) [m/s^2], rotated about two base axes.

    These are the two of x, y and z most perpendicular to gravity, which is rotated about the first
    of them, then about the second.
    """

    def __init__(self, gravity: Array) -> None:
        self._gravity = gravity
        along = int(np.argmax(np.abs(gravity)))
        self._axes = [axis for axis in range(3) if axis != along]
        self.names = tuple(f'gravity.tilt_{"xyz"[axis]}' for axis in self._axes)

    def gravity(self, angles: Array) -> Array:
        """Return gravity, shape (3,), rotated by angles (2,) [rad]."""
        first, second = self._turns(angles)
        turned: Array = second @ first @ self._gravity
        return turned

    def change(self, angles: Array) -> Array:
        """Return the difference (3,) of rotated gravity and the file's value."""
        return self.gravity(angles) - self._gravity

    def derivative(self, angles: Array) -> Array:
        """Return the derivative of gravity with respect to the angles, (3, 2)."""
        first, second = self._turns(angles)
        about = np.eye(3)[self._axes]
        turned = first @ self._gravity
        return np.stack([second @ np.cross(about[0], turned),
                         np.cross(about[1], second @ turned)], axis=-1)

    def _turns(self, angles: Array) -> tuple[Array, Array]:
        first, second = (turns_about(axis, np.array([angle]))[0]
                         for axis, angle in zip(self._axes, angles, strict=True))
        return first, second
