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
The tilt of the base: gravity turned about two base axes, its length as it is.

Forces are linear in gravity, ``f = Y theta + sum_i d_i G_i theta`` with d its change and G_i the
part of Y that one unit of gravity along axis i makes. So products of the change with what weighs
are further linear parameters, exactly, however large the tilt is.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.kinematics.home_pose import turns_about


class Tilt:
    """
    Gravity turned about two base axes.

    Parameters
    ----------
    gravity : (3,)
        Of the parameter file, base axes [m/s^2].

    Attributes
    ----------
    axes : str
        Two of x, y and z, those that are most across gravity: it turns about the first of them,
        then about the second.

    """

    def __init__(self, gravity: Array) -> None:
        self._gravity = np.array(gravity, dtype=np.float64)
        along = int(np.argmax(np.abs(self._gravity)))
        self._axes = [axis for axis in range(3) if axis != along]
        self.axes = ''.join('xyz'[axis] for axis in self._axes)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of both angles."""
        return tuple(f'gravity.tilt_{axis}' for axis in self.axes)

    def gravity(self, angles: Array) -> Array:
        """Return the turned vector (3,) of angles (2,) [rad]."""
        first, second = self._turns(angles)
        turned: Array = second @ first @ self._gravity
        return turned

    def change(self, angles: Array) -> Array:
        """Return by how much that differs from the file's, (3,)."""
        return self.gravity(angles) - self._gravity

    def derivative(self, angles: Array) -> Array:
        """Return the derivative of gravity by the angles, (3, 2)."""
        first, second = self._turns(angles)
        about = np.eye(3)[self._axes]
        turned = first @ self._gravity
        return np.stack([second @ np.cross(about[0], turned),
                         np.cross(about[1], second @ turned)], axis=-1)

    def _turns(self, angles: Array) -> tuple[Array, Array]:
        first, second = (turns_about(axis, np.array([angle]))[0]
                         for axis, angle in zip(self._axes, angles, strict=True))
        return first, second
