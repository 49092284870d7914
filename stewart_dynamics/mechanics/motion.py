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
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics import rotation as rotations
from stewart_dynamics.mechanics.rows import MOTION

# A rotation matrix further from orthogonal than this is refused.
ORTHOGONALITY = 1e-6


# Where they stand in a row.
_PLACES = {'position': slice(0, 3), 'rotation': slice(3, 12), 'linear_velocity': slice(12, 15),
           'angular_velocity': slice(15, 18), 'linear_acceleration': slice(18, 21),
           'angular_acceleration': slice(21, 24)}


class Motion:
    """
    Pose, twist and acceleration of the platform in one sample or any leading shape of samples.

    The arrays are copied, and read-only as properties; ``rows`` (..., MOTION) holds them as the
    runtime path takes them.

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

    Raises
    ------
    MotionError
        The leading shapes cannot be broadcast against each other, a number is not finite, or a
        matrix is not a rotation.

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
            **{name: as_array(name, part, (3,)) for name, part in (
                ('linear_velocity', linear_velocity), ('angular_velocity', angular_velocity),
                ('linear_acceleration', linear_acceleration),
                ('angular_acceleration', angular_acceleration)) if part is not None}}
        self.shape = common_shape(**{
            name: part.shape[:-2] if name == 'rotation' else part.shape[:-1]
            for name, part in parts.items()})
        r = parts['rotation']
        with np.errstate(over='ignore', invalid='ignore'):
            error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1))
            good = (error <= ORTHOGONALITY) & (np.linalg.det(r) > 0.0)
        if not good.all():
            at = tuple(map(int, np.argwhere(~good)[0]))
            raise MotionError(
                f'rotation{list(at) if at else ""}: {r[at].tolist()}: not a rotation: '
                f'R^T R is {error[at]:.3g} off the identity, at most {ORTHOGONALITY:g}, with a '
                'determinant of +1')
        parts['rotation'] = r.reshape(*r.shape[:-2], 9)
        self.rows = np.zeros((*self.shape, MOTION))
        for name, part in parts.items():
            self.rows[..., _PLACES[name]] = part

    @classmethod
    def of_rows(cls, rows: Array) -> Motion:
        """Return the motion that rows (..., MOTION) of checked numbers are; they are its own."""
        motion = cls.__new__(cls)
        motion.rows, motion.shape = rows, rows.shape[:-1]
        return motion

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
        return self._view('position')

    @property
    def rotation(self) -> Array:
        """Platform axes to base axes, (..., 3, 3)."""
        return self._view('rotation').reshape(*self.shape, 3, 3)

    @property
    def linear_velocity(self) -> Array:
        """Velocity of the platform's origin, base axes, (..., 3) [m/s]."""
        return self._view('linear_velocity')

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity, base axes, (..., 3) [rad/s]."""
        return self._view('angular_velocity')

    @property
    def linear_acceleration(self) -> Array:
        """Acceleration of the platform's origin, base axes, (..., 3) [m/s^2]."""
        return self._view('linear_acceleration')

    @property
    def angular_acceleration(self) -> Array:
        """Angular acceleration, base axes, (..., 3) [rad/s^2]."""
        return self._view('angular_acceleration')

    def __repr__(self) -> str:
        """Return the shape, and the numbers of a single sample."""
        if self.shape:
            return f'Motion of shape {self.shape}'
        return f'Motion(position={self.position.tolist()}, rotation={self.rotation.tolist()}, ...)'

    def _view(self, name: str) -> Array:
        view = self.rows[..., _PLACES[name]]
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
    if not np.isfinite(array).all():
        at = tuple(map(int, np.argwhere(~np.isfinite(array))[0]))
        raise MotionError(f'{name}{list(at)}: {array[at]}: must be finite')
    return array


def common_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the leading shape that all of these broadcast to; else MotionError names them."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError as exc:
        raise MotionError(f'the leading shapes do not fit each other: {shapes}') from exc


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product
