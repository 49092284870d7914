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
The angles of the joints at both ends of the legs; compiled.

A joint's angle is the one between the leg's direction s, from base joint to platform joint, and
the joint's axis u: how far the joint is deflected, whichever way. The axis of a base joint is
fixed to the base, that of a platform joint to the platform, where the leg's direction is R^T s.
Without given axes they are the leg's direction at the home pose: all angles are zero there.

    angle = atan2(|u x s|, u . s)          0 to pi

Between samples, h = sin^2(angle / 2) = |u - s|^2 / 4 is used: it grows with the angle, has a
derivative at angle zero, too, and loses no digits there.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.rows import (
    ANGULAR_VELOCITY, BASE_JOINT_ANGLES, LINEAR_VELOCITY, PLATFORM_JOINT_ANGLES, POSITION,
    ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, read3, read9, rotate_back, scale, subtract, Vector3)


@inlined
def _angle(axis: Vector3, direction: Vector3) -> float:
    sine = cross(axis, direction)
    return math.atan2(math.sqrt(dot(sine, sine)), dot(axis, direction))


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def joint_angles(constants: Array, axes: Array, motions: Array, angles: Array) -> None:
    """
    Write the angles of the joints in each motion.

    Parameters
    ----------
    constants : (CONSTANTS,)
        Constants of the hexapod, see ``hexapod_constants``.
    axes : (12, 3)
        Unit vectors: of the base joints in base axes, of the platform joints in platform axes.
    motions : (N, MOTION)
        Rows of motion.
    angles : (N, JOINT_ANGLES)
        Written [rad]; nan where an axis is.

    """
    for row in range(len(motions)):
        position = read3(motions[row], POSITION.start)
        rotation = read9(motions[row], ROTATION.start)
        for leg in range(6):
            _, _, _, s = leg_line(constants, leg, position, rotation)
            angles[row, BASE_JOINT_ANGLES.start + leg] = _angle(read3(axes[leg], 0), s)
            angles[row, PLATFORM_JOINT_ANGLES.start + leg] = _angle(
                read3(axes[6 + leg], 0), rotate_back(rotation, s))


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def joint_haversines(constants: Array, axes: Array, motions: Array, values: Array,
                     rates: Array) -> None:
    """
    Write sin^2(angle / 2) of the joints, and its time derivative, both (N, JOINT_ANGLES).

    The other arguments are those of ``joint_angles``. Where numbers overflow, nan is written.
    """
    for row in range(len(motions)):
        motion = motions[row]
        rotation = read9(motion, ROTATION.start)
        omega = read3(motion, ANGULAR_VELOCITY.start)
        for leg in range(6):
            a, length, inverse_length, s = leg_line(
                constants, leg, read3(motion, POSITION.start), rotation)
            known = 1.0 if 0.0 < length < math.inf else math.nan
            x_rate = add(read3(motion, LINEAR_VELOCITY.start), cross(omega, a))
            s_rate = scale(inverse_length, subtract(x_rate, scale(dot(s, x_rate), s)))
            axis = read3(axes[leg], 0)
            half = subtract(axis, s)
            values[row, leg] = known * 0.25 * dot(half, half)
            rates[row, leg] = -0.5 * dot(axis, s_rate)
            axis = read3(axes[6 + leg], 0)
            half = subtract(axis, rotate_back(rotation, s))
            values[row, 6 + leg] = known * 0.25 * dot(half, half)
            rates[row, 6 + leg] = -0.5 * dot(
                axis, rotate_back(rotation, subtract(s_rate, cross(omega, s))))
