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
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics import rotation as rotations
from stewart_dynamics.errors import MotionError
from stewart_dynamics.inverse_dynamics import MOTION

Array = NDArray[np.float64]

# A rotation matrix further from orthogonal than this is refused.
ORTHOGONALITY = 1e-6


class Motion:
    """
    Pose, twist and acceleration of the platform in one sample or any leading shape of samples.

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

    Leading shapes broadcast against each other. Raises MotionError where they cannot, and
    for what is not finite or no rotation. The arrays are copied, and read-only as properties;
    ``rows`` (..., MOTION) holds them as the runtime path takes them.

    """

    def __init__(
            self, position: ArrayLike, rotation: ArrayLike,
            linear_velocity: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None,
    ) -> None:
        parts = {
            'position': as_array('position', position, (3,)),
            'rotation': as_array('rotation', rotation, (3, 3)),
            'linear_velocity': as_array('linear_velocity', linear_velocity, (3,)),
            'angular_velocity': as_array('angular_velocity', angular_velocity, (3,)),
            'linear_acceleration': as_array('linear_acceleration', linear_acceleration, (3,)),
            'angular_acceleration': as_array('angular_acceleration', angular_acceleration, (3,)),
        }
        leading = {name: part.shape[:-2] if name == 'rotation' else part.shape[:-1]
                   for name, part in parts.items()}
        try:
            self.shape = np.broadcast_shapes(*leading.values())
        except ValueError as exc:
            raise MotionError(f'the leading shapes do not fit each other: {leading}') from exc
        r = parts['rotation']
        with np.errstate(over='ignore', invalid='ignore'):
            error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1))
            bad = ~((error <= ORTHOGONALITY) & (np.linalg.det(r) > 0.0))
        if np.any(bad):
            at = tuple(map(int, np.argwhere(bad)[0]))
            raise MotionError(
                f'rotation{list(at) if at else ""}: {r[at].tolist()}: not a rotation: '
                f'R^T R is {error[at]:.3g} off the identity, at most {ORTHOGONALITY:g}, with a '
                'determinant of +1')
        self.rows = np.empty((*self.shape, MOTION))
        self.rows[..., 0:3] = parts['position']
        self.rows[..., 3:12] = r.reshape(*r.shape[:-2], 9)
        self.rows[..., 12:15] = parts['linear_velocity']
        self.rows[..., 15:18] = parts['angular_velocity']
        self.rows[..., 18:21] = parts['linear_acceleration']
        self.rows[..., 21:24] = parts['angular_acceleration']

    @classmethod
    def from_euler(
            cls, position: ArrayLike, angles: ArrayLike,
            linear_velocity: ArrayLike | None = None, angle_rates: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angle_accelerations: ArrayLike | None = None,
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

        """
        angle = as_array('angles', angles, (3,))
        rate = as_array('angle_rates', angle_rates, (3,))
        acceleration = as_array('angle_accelerations', angle_accelerations, (3,))
        try:
            e = rotations.euler_rate_matrix(angle)
            omega = _apply(e, rate)
            alpha = _apply(e, acceleration) + _apply(
                rotations.euler_rate_matrix_rate(angle, rate), rate)
        except ValueError as exc:
            raise MotionError(
                f'angles {angle.shape}, angle_rates {rate.shape} and angle_accelerations '
                f'{acceleration.shape} do not fit each other') from exc
        return cls(position, rotations.from_euler(angle), linear_velocity, omega,
                   linear_acceleration, alpha)

    @property
    def position(self) -> Array:
        """Origin of the platform frame in the base frame, (..., 3) [m]."""
        return self._view(0, 3)

    @property
    def rotation(self) -> Array:
        """Platform axes to base axes, (..., 3, 3)."""
        return self._view(3, 12).reshape(*self.shape, 3, 3)

    @property
    def linear_velocity(self) -> Array:
        """Velocity of the platform's origin, base axes, (..., 3) [m/s]."""
        return self._view(12, 15)

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity, base axes, (..., 3) [rad/s]."""
        return self._view(15, 18)

    @property
    def linear_acceleration(self) -> Array:
        """Acceleration of the platform's origin, base axes, (..., 3) [m/s^2]."""
        return self._view(18, 21)

    @property
    def angular_acceleration(self) -> Array:
        """Angular acceleration, base axes, (..., 3) [rad/s^2]."""
        return self._view(21, 24)

    def __repr__(self) -> str:
        """Return the shape, and the numbers of a single sample."""
        if self.shape:
            return f'Motion of shape {self.shape}'
        return f'Motion(position={self.position.tolist()}, rotation={self.rotation.tolist()}, ...)'

    def _view(self, first: int, end: int) -> Array:
        view = self.rows[..., first:end]
        view.setflags(write=False)
        return view


def as_array(name: str, value: ArrayLike | None, tail: tuple[int, ...]) -> Array:
    """Return a finite array whose shape ends so, zeros for none; else MotionError names it."""
    if value is None:
        return np.zeros(tail)
    try:
        array = np.asarray(value, dtype=float)
    except (OverflowError, TypeError, ValueError) as exc:
        raise MotionError(f'{name}: not an array of numbers: {exc}') from exc
    if array.shape[-len(tail):] != tail:
        raise MotionError(f'{name}: shape {array.shape}: must end in {tail}')
    if not np.all(np.isfinite(array)):
        at = tuple(map(int, np.argwhere(~np.isfinite(array))[0]))
        raise MotionError(f'{name}{list(at)}: {array[at]}: must be finite')
    return array


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product
