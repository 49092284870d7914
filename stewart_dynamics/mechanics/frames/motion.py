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

"""A motion: pose, twist and acceleration of the platform, one sample or many."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.arguments import as_array, common_shape, optional_array, wrong_type
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.frames.fields import rows_of
from stewart_dynamics.mechanics.frames.pose import (
    as_rotation, matrix_of_quaternion, Pose, Posed, row_by_row, row_of_one)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, MOTION, POSE,
    POSITION, ROTATION)


class Motion(Posed):
    """
    Pose, twist and acceleration of the platform in one sample or any leading shape of samples.

    Leading shapes broadcast against each other. The arrays are copied; ``motion[3]``,
    ``motion[::10]`` and ``len(motion)`` work as for an array of samples.

    Parameters
    ----------
    position : (..., 3)
        Origin of the platform frame in the base frame [m].
    rotation : (..., 3, 3)
        Platform axes to base axes.
    linear_velocity, angular_velocity : (..., 3), optional
        Twist in base axes [m/s, rad/s]; zero by default.
    linear_acceleration, angular_acceleration : (..., 3), optional
        Their time derivatives, base axes [m/s^2, rad/s^2]; zero by default.

    Attributes
    ----------
    position, rotation, quaternion : (..., 3), (..., 3, 3), (..., 4)
        Read-only; the quaternion is x y z w.
    linear_velocity, angular_velocity : (..., 3)
        Read-only.
    linear_acceleration, angular_acceleration : (..., 3)
        Read-only.
    pose : Pose
        The pose alone.
    rows : (..., 24)
        All numbers as the compiled functions take them, see ``mechanics.rows``.
    shape : tuple of int
        The leading shape; () for one sample.

    Raises
    ------
    MotionError
        The shapes do not fit, a number is not finite, or a matrix is not a rotation.

    """

    def __init__(
            self, position: ArrayLike, rotation: ArrayLike,
            linear_velocity: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None,
    ) -> None:
        row = row_of_one(
            MOTION, position, rotation, (LINEAR_VELOCITY, linear_velocity),
            (ANGULAR_VELOCITY, angular_velocity), (LINEAR_ACCELERATION, linear_acceleration),
            (ANGULAR_ACCELERATION, angular_acceleration))
        if row is not None:
            self.rows, self.shape = row, ()
            return
        parts = {'rotation': (ROTATION, row_by_row(as_rotation(rotation))),
                 'position': (POSITION, as_array('position', position, (3,)))}
        for name, where, part in (
                ('linear_velocity', LINEAR_VELOCITY, linear_velocity),
                ('angular_velocity', ANGULAR_VELOCITY, angular_velocity),
                ('linear_acceleration', LINEAR_ACCELERATION, linear_acceleration),
                ('angular_acceleration', ANGULAR_ACCELERATION, angular_acceleration)):
            if part is not None:
                parts[name] = where, as_array(name, part, (3,))
        self.rows = rows_of(MOTION, parts)
        self.shape = self.rows.shape[:-1]

    @classmethod
    def from_pose(
            cls, pose: Pose | Motion, linear_velocity: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None,
    ) -> Motion:
        """Return the motion at a pose, by default at rest; other arguments are as in Motion."""
        if not isinstance(pose, Pose | Motion):
            raise wrong_type('pose', pose, 'a Pose or a Motion')
        return cls(pose.position, pose.rotation, linear_velocity, angular_velocity,
                   linear_acceleration, angular_acceleration)

    @classmethod
    def from_quaternion(
            cls, position: ArrayLike, quaternion: ArrayLike,
            linear_velocity: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None,
    ) -> Motion:
        """Return the motion with a quaternion x y z w (..., 4), see Pose.from_quaternion."""
        return cls(position, matrix_of_quaternion(quaternion), linear_velocity,
                   angular_velocity, linear_acceleration, angular_acceleration)

    @classmethod
    def from_euler(
            cls, position: ArrayLike, angles: ArrayLike,
            linear_velocity: ArrayLike | None = None, angle_rates: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angle_accelerations: ArrayLike | None = None, *, degrees: bool = False,
    ) -> Motion:
        """
        Return the motion given by the paper's angles and their derivatives, converted exactly.

        Parameters
        ----------
        position, linear_velocity, linear_acceleration : (..., 3)
            As in Motion.
        angles, angle_rates, angle_accelerations : (..., 3)
            alpha, beta, gamma of R = Rz(gamma) Ry(beta) Rx(alpha) [rad], and their first and
            second time derivatives.
        degrees : bool
            Angles and their derivatives are in degrees.

        """
        angle = as_array('angles', angles, (3,))
        rate = optional_array('angle_rates', angle_rates, (3,))
        acceleration = optional_array('angle_accelerations', angle_accelerations, (3,))
        common_shape(angles=angle.shape[:-1], angle_rates=rate.shape[:-1],
                     angle_accelerations=acceleration.shape[:-1])
        if degrees:
            angle, rate, acceleration = map(np.radians, (angle, rate, acceleration))
        with np.errstate(over='ignore', invalid='ignore'):
            e = rotations.euler_rate_matrix(angle)
            omega = _apply(e, rate)
            alpha = _apply(e, acceleration) + _apply(
                rotations.euler_rate_matrix_rate(angle, rate), rate)
        return cls(position, rotations.from_euler(angle), linear_velocity, omega,
                   linear_acceleration, alpha)

    @property
    def pose(self) -> Pose:
        """Return the pose alone; it shares the motion's memory."""
        return Pose.of_rows(self.rows[..., POSE])

    @property
    def linear_velocity(self) -> Array:
        """Velocity of the platform's origin, base axes, (..., 3) [m/s]."""
        return self._part(LINEAR_VELOCITY)

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity, base axes, (..., 3) [rad/s]."""
        return self._part(ANGULAR_VELOCITY)

    @property
    def linear_acceleration(self) -> Array:
        """Acceleration of the platform's origin, base axes, (..., 3) [m/s^2]."""
        return self._part(LINEAR_ACCELERATION)

    @property
    def angular_acceleration(self) -> Array:
        """Angular acceleration, base axes, (..., 3) [rad/s^2]."""
        return self._part(ANGULAR_ACCELERATION)


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product
