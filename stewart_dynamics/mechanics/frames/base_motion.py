# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The motion of the base: gravity, acceleration and turning in base axes, one sample or many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.arguments import (
    as_array, check_finite, common_shape, optional_array, wrong_type)
from stewart_dynamics.mechanics.frames.motion import (
    as_rotation, check_kind, Field, listed, Motion, Pose, row_by_row, RowSamples)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, GRAVITY, LINEAR_ACCELERATION, NO_BASE,
    ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, cross, Matrix3, rotate, rotate_back, subtract, Vector3)
from stewart_dynamics.parameters.table import STANDARD_GRAVITY


class BaseMotion(RowSamples):
    """
    How the base moves, in one sample or any leading shape of samples; all in base axes.

    Linear velocity is left out: a constant velocity changes no force. Leading shapes broadcast
    against each other. The arrays are copied; ``base[3]``, ``base[::10]`` and ``len(base)`` work
    as for an array of samples.

    Parameters
    ----------
    gravity : (..., 3)
        Acceleration of free fall [m/s^2]; it turns in base axes as the base turns.
    linear_acceleration : (..., 3), optional
        Acceleration of the base's origin [m/s^2]; zero by default.
    angular_velocity, angular_acceleration : (..., 3), optional
        Angular motion of the base [rad/s, rad/s^2]; zero by default.

    Attributes
    ----------
    gravity, linear_acceleration, angular_velocity, angular_acceleration : (..., 3)
        Read-only.
    rows : (..., 12)
        All numbers as the compiled functions take them, see ``mechanics.rows``.
    shape : tuple of int
        The leading shape; () for one sample.

    Raises
    ------
    MotionError
        The shapes do not fit, or a number is not finite.

    """

    gravity = Field(
        GRAVITY, 'Acceleration of free fall, base axes, (..., 3) [m/s^2].', required=True)
    linear_acceleration = Field(
        BASE_ACCELERATION, "Acceleration of the base's origin, base axes, (..., 3) [m/s^2].")
    angular_velocity = Field(
        BASE_ANGULAR_VELOCITY, 'Angular velocity, base axes, (..., 3) [rad/s].')
    angular_acceleration = Field(
        BASE_ANGULAR_ACCELERATION, 'Angular acceleration, base axes, (..., 3) [rad/s^2].')

    def __init__(
            self, gravity: ArrayLike, linear_acceleration: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None) -> None:
        self._fill(gravity, linear_acceleration, angular_velocity, angular_acceleration)

    @classmethod
    def from_pose(cls, pose: Pose | Motion, gravity: ArrayLike = STANDARD_GRAVITY) -> BaseMotion:
        """
        Return a base at rest that is tilted: gravity from its orientation.

        Parameters
        ----------
        pose : Pose or Motion
            Pose of the base frame in the world; only its rotation is used.
        gravity : (..., 3)
            World axes [m/s^2].

        """
        check_kind(pose, Pose, Motion)
        return cls._of_columns(row_of_pose, pose=pose.rows[..., ROTATION],
                               gravity=as_array('gravity', gravity, (3,)))

    @classmethod
    def from_motion(cls, motion: Motion, gravity: ArrayLike = STANDARD_GRAVITY) -> BaseMotion:
        """
        Return the base motion of a motion of the base frame in the world.

        Parameters
        ----------
        motion : Motion
            Motion of the base frame, given like the motion of a platform: all in world axes.
        gravity : (..., 3)
            World axes [m/s^2].

        """
        check_kind(motion, Motion)
        given = as_array('gravity', gravity, (3,))
        common_shape(motion=motion.shape, gravity=given.shape[:-1])
        rotation, acceleration, spin, spin_rate = (motion.rows[..., part] for part in (
            ROTATION, LINEAR_ACCELERATION, ANGULAR_VELOCITY, ANGULAR_ACCELERATION))
        return cls._of_columns(row_of_motion, motion=rotation, acceleration=acceleration,
                               spin=spin, spin_rate=spin_rate, gravity=given)

    @classmethod
    def from_imu(
            cls, specific_force: ArrayLike, angular_velocity: ArrayLike,
            angular_acceleration: ArrayLike | None = None, position: ArrayLike = (0.0, 0.0, 0.0),
            rotation: ArrayLike | None = None) -> BaseMotion:
        """
        Return the base motion that an IMU fixed to the base measures.

        No orientation is needed: the specific force includes gravity. An accelerometer does not
        distinguish gravity from acceleration, so ``gravity`` of the result is gravity less the
        acceleration of the base's origin, and ``linear_acceleration`` is zero: the forces are the
        same.

        Parameters
        ----------
        specific_force : (..., 3)
            Reading of the accelerometer, IMU axes [m/s^2]: at rest 9.8 upward.
        angular_velocity : (..., 3)
            Reading of the gyroscope, IMU axes [rad/s].
        angular_acceleration : (..., 3), optional
            Its time derivative, IMU axes [rad/s^2]; zero by default.
        position : (..., 3)
            Position of the IMU in the base frame [m].
        rotation : (..., 3, 3), optional
            IMU axes to base axes; the same axes by default.

        """
        return cls._of_columns(
            row_of_imu, specific_force=as_array('specific_force', specific_force, (3,)),
            angular_velocity=as_array('angular_velocity', angular_velocity, (3,)),
            angular_acceleration=optional_array(
                'angular_acceleration', angular_acceleration, (3,)),
            position=as_array('position', position, (3,)),
            rotation=row_by_row(np.eye(3) if rotation is None else as_rotation(rotation)))

    @classmethod
    def _of_columns(cls, row: Callable[..., tuple[Any, ...]], **given: Array) -> BaseMotion:
        """Return samples (...) of a function of vectors and matrices, each given as (..., n)."""
        common_shape(**{name: array.shape[:-1] for name, array in given.items()})
        with np.errstate(all='ignore'):
            columns = row(*(tuple(np.moveaxis(array, -1, 0)) for array in given.values()))
        rows = np.stack(np.broadcast_arrays(*columns), axis=-1)
        return cls.of_rows(check_finite('base motion', rows, rows.ndim - 1))

    def _in_words(self) -> str:
        return (f'gravity {listed(self.gravity)} m/s^2, acceleration '
                f'{listed(self.linear_acceleration)} m/s^2, turning '
                f'{listed(self.angular_velocity)} rad/s, {listed(self.angular_acceleration)} '
                'rad/s^2')


def base_rows(base: BaseMotion | None) -> Array:
    """Return the rows (..., BASE) of the base's motion; a row of nan for None."""
    if base is None:
        return np.array(NO_BASE)
    if not isinstance(base, BaseMotion):
        raise wrong_type('base', base, 'a BaseMotion')
    # A row of nan would stand for a still base.
    return check_finite('base', base.rows, len(base.shape))


# The same for one sample and for many: each number is a float, or an array of samples.

_STILL = (0.0, 0.0, 0.0)


def row_of_pose(rotation: Matrix3, gravity: Vector3) -> tuple[Any, ...]:
    """Return the row (BASE,) of a base at rest with this orientation in the world."""
    return (*rotate_back(rotation, gravity), *_STILL, *_STILL, *_STILL)


def row_of_motion(rotation: Matrix3, acceleration: Vector3, spin: Vector3, spin_rate: Vector3,
                  gravity: Vector3) -> tuple[Any, ...]:
    """Return the row (BASE,) of a base whose motion is given in world axes."""
    return (*rotate_back(rotation, gravity), *rotate_back(rotation, acceleration),
            *rotate_back(rotation, spin), *rotate_back(rotation, spin_rate))


def row_of_imu(specific_force: Vector3, spin: Vector3, spin_rate: Vector3, position: Vector3,
               rotation: Matrix3) -> tuple[Any, ...]:
    """Return the row (BASE,) of an IMU's readings, IMU axes; its mounting in the base frame."""
    spin, spin_rate = rotate(rotation, spin), rotate(rotation, spin_rate)
    gravity = subtract(carried(spin, spin_rate, position), rotate(rotation, specific_force))
    return (*gravity, *_STILL, *spin, *spin_rate)


def carried(spin: Vector3, spin_rate: Vector3, arm: Vector3) -> Vector3:
    """Return W' x r + W x (W x r): the acceleration of a point fixed to a turning body."""
    return add(cross(spin_rate, arm), cross(spin, cross(spin, arm)))
