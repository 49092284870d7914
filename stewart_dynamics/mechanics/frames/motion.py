# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Poses and motions of the platform, one sample or any leading shape of samples as rows."""

from __future__ import annotations

import math
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import CONSTANTS
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import (
    as_array, common_shape, first_of, optional_array, wrong_type)
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, MOTION, POSE,
    POSITION, ROTATION)
from stewart_dynamics.parameters.tolerances import is_unit, unit_rule

Self = TypeVar('Self', bound='RowSamples')


class Field:
    """
    A quantity in each sample's row, as an attribute: a read-only view (..., 3) or (..., 3, 3).

    where: its three numbers in a row, or the nine of a rotation.
    text: docstring of the attribute.
    required: whether it must be given; others are zero by default.
    """

    def __init__(self, where: slice, text: str, *, required: bool = False) -> None:
        self.where, self.__doc__, self.required = where, text, required
        self._is_rotation = where.stop - where.start == 9

    def __set_name__(self, kind: type, name: str) -> None:
        """Keep the name, which errors begin with."""
        self.name = name

    def __get__(self, samples: RowSamples | None, kind: type[RowSamples]) -> Array:
        """Return the view; of a class the field itself."""
        if samples is None:
            return self  # type: ignore[return-value]
        view = samples.rows[..., self.where]
        view.setflags(write=False)
        return view.reshape(*samples.shape, 3, 3) if self._is_rotation else view

    def __set__(self, samples: RowSamples, value: object) -> NoReturn:
        """Raise AttributeError: samples are immutable."""
        raise AttributeError(f'a {type(samples).__name__} cannot be changed')

    def checked(self, value: Any) -> Array:
        """Return a given value as parts of rows (..., n); MotionError if it is wrong."""
        return (row_by_row(as_rotation(value)) if self._is_rotation
                else as_array(self.name, value, (3,)))


class RowSamples:
    """
    Samples of any leading shape (...), () for one.

    rows (..., n): all numbers of each sample, SI units, base axes.
    """

    rows: Array
    shape: tuple[int, ...]
    _fields: tuple[Field, ...]  # in the order of a row, and of the arguments
    _size: int

    def __init_subclass__(cls) -> None:
        cls._fields = tuple(field for kind in reversed(cls.__mro__)
                            for field in vars(kind).values() if isinstance(field, Field))
        cls._size = max(field.where.stop for field in cls._fields)

    @classmethod
    def of_rows(cls: type[Self], rows: Array) -> Self:
        """Return the samples of rows (..., n), which are neither checked nor copied."""
        samples = cls.__new__(cls)
        samples.rows, samples.shape = rows, rows.shape[:-1]
        return samples

    def _fill(self, *values: Any) -> None:
        """Make the rows of the fields' values; MotionError names wrong values and shapes."""
        parts = {field: field.checked(value)
                 for field, value in zip(self._fields, values, strict=True)
                 if value is not None or field.required}
        self.shape = common_shape(**{field.name: part.shape[:-1] for field, part in parts.items()})
        self.rows = np.zeros((*self.shape, self._size))
        for field, part in parts.items():
            self.rows[..., field.where] = part

    def __len__(self) -> int:
        """Return the number of samples along the first axis; TypeError for a single sample."""
        if not self.shape:
            raise TypeError(f'one {type(self).__name__} has no length')
        return self.shape[0]

    def __getitem__(self: Self, index: Any) -> Self:
        """Return some of the samples: an index, a slice or a mask, as of an array."""
        where = index if isinstance(index, tuple) else (index,)
        try:
            return self.of_rows(self.rows[(*where, slice(None))] if any(
                each is Ellipsis for each in where) else self.rows[(*where, ..., slice(None))])
        except IndexError as exc:
            raise IndexError(f'{type(self).__name__} of shape {self.shape}: {exc}') from exc

    def __eq__(self, other: object) -> bool:
        """Return whether shape and all numbers are equal."""
        return type(other) is type(self) and np.array_equal(self.rows, other.rows)

    # The arrays are mutable.
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Return the shape, or the numbers of a single sample."""
        name = type(self).__name__
        return (f'<{name} of shape {self.shape}>' if self.shape
                else f'<{name}: {self._in_words()}>')

    def _in_words(self) -> str:
        """Return the numbers of a single sample, as text."""
        raise NotImplementedError


def listed(numbers: Array, digits: int = 6) -> str:
    """Return a vector as text."""
    return '[' + ', '.join(f'{number + 0.0:.{digits}g}' for number in numbers) + ']'


# A rotation matrix further from orthogonal than this is rejected.
ORTHOGONALITY = CONSTANTS['ORTHOGONALITY']
# Rounding cannot make one that is nearer than this exceed it.
_WELL = 0.9 * ORTHOGONALITY


class Posed(RowSamples):
    """The pose that is part of each sample of a Pose or a Motion."""

    position = Field(
        POSITION, 'Origin of the platform frame in the base frame, (..., 3) [m].', required=True)
    rotation = Field(ROTATION, 'Platform axes to base axes, (..., 3, 3).', required=True)

    @property
    def quaternion(self) -> Array:
        """Return the rotation as unit quaternions x y z w, (..., 4), w >= 0."""
        return rotations.to_quaternion(self.rotation)

    def _fill_posed(self, position: Any, rotation: Any, *others: tuple[slice, Any]) -> None:
        """
        Make the rows, of one sample in a tenth of the time that samples of any shape take.

        Its arguments must be arrays of floats and well within the rules; others take the long way.
        """
        row = np.zeros(self._size)
        numbers = row.data
        try:
            numbers[POSITION] = position
            numbers[ROTATION] = rotation.reshape(9)
            for where, value in others:
                if value is not None:
                    numbers[where] = value
        except Exception:  # an arbitrary object may raise any
            pass
        else:
            sample = row.tolist()
            a, b, c, d, e, f, g, h, i = sample[ROTATION]
            if (abs(a * a + d * d + g * g - 1.0) < _WELL
                    and abs(b * b + e * e + h * h - 1.0) < _WELL
                    and abs(c * c + f * f + i * i - 1.0) < _WELL
                    and abs(a * b + d * e + g * h) < _WELL
                    and abs(a * c + d * f + g * i) < _WELL
                    and abs(b * c + e * f + h * i) < _WELL
                    and a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) > 0.0
                    and math.isfinite(sum(sample)) and rotation.shape == (3, 3)):
                self.rows, self.shape = row, ()
                return
        # Behind the handler, so that an error of a check is shown alone.
        self._fill(position, rotation, *(value for _, value in others))

    def _in_words(self) -> str:
        return f'position {listed(self.position)} m, quaternion {listed(self.quaternion)}'


class Pose(Posed):
    """
    Pose of the platform in the base frame, one sample or any leading shape of samples.

    Leading shapes broadcast against each other. The arrays are copied; ``pose[3]``,
    ``pose[::10]`` and ``len(pose)`` work as for an array of samples.

    Parameters
    ----------
    position : (..., 3)
        Origin of the platform frame in the base frame [m].
    rotation : (..., 3, 3)
        Platform axes to base axes.

    Attributes
    ----------
    position, rotation, quaternion : (..., 3), (..., 3, 3), (..., 4)
        Read-only; the quaternion is x y z w.
    rows : (..., 12)
        Position and rotation, row by row.
    shape : tuple of int
        The leading shape; () for one sample.

    Raises
    ------
    MotionError
        The shapes do not fit, a number is not finite, or a matrix is not a rotation.

    """

    def __init__(self, position: ArrayLike, rotation: ArrayLike) -> None:
        self._fill_posed(position, rotation)

    @classmethod
    def from_euler(cls, position: ArrayLike, angles: ArrayLike, *, degrees: bool = False) -> Pose:
        """
        Return the pose of the paper's angles.

        Parameters
        ----------
        position : (..., 3)
            [m]
        angles : (..., 3)
            alpha, beta, gamma of R = Rz(gamma) Ry(beta) Rx(alpha) [rad].
        degrees : bool
            Angles are in degrees.

        """
        given = as_array('angles', angles, (3,))
        return cls(position, rotations.from_euler(np.radians(given) if degrees else given))

    @classmethod
    def from_quaternion(cls, position: ArrayLike, quaternion: ArrayLike) -> Pose:
        """
        Return the pose of a quaternion.

        Parameters
        ----------
        position : (..., 3)
            [m]
        quaternion : (..., 4)
            x y z w, its length 1 within 1e-3; it is normalized.

        """
        return cls(position, matrix_of_quaternion(quaternion))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """Return the pose of homogeneous transforms (..., 4, 4), platform frame to base frame."""
        given = as_array('matrix', matrix, (4, 4))
        last = given[..., 3, :]
        off = np.abs(last - [0.0, 0.0, 0.0, 1.0]).max(axis=-1) > ORTHOGONALITY
        if off.any():
            at, name = first_of('matrix', off)
            raise MotionError(f'{name}: its last row is {last[at].tolist()}: must be [0, 0, 0, 1]')
        return cls(given[..., :3, 3], given[..., :3, :3])


def as_rotation(rotation: ArrayLike) -> Array:
    """Return rotation matrices (..., 3, 3); MotionError for other ones."""
    r = as_array('rotation', rotation, (3, 3))
    with np.errstate(over='ignore', invalid='ignore'):
        error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1))
        orthogonal, determinant = error <= ORTHOGONALITY, np.linalg.det(r)
        good = orthogonal & (determinant > 0.0)
    if not good.all():
        at, name = first_of('rotation', ~good)
        what = ('is a reflection: its determinant is -1, must be +1 (is an axis mirrored, or are '
                'two columns exchanged?)' if orthogonal[at] else
                f'is not a rotation: R^T R is {error[at]:.3g} off the identity, must be at most '
                f'{ORTHOGONALITY:g}')
        raise MotionError(f'{name}: {r[at].tolist()} {what}')
    return r


def row_by_row(matrix: Array) -> Array:
    """Return matrices (..., 3, 3) as rows (..., 9)."""
    return matrix.reshape(*matrix.shape[:-2], 9)


def matrix_of_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions x y z w (..., 4)."""
    q = as_array('quaternion', quaternion, (4,))
    with np.errstate(over='ignore'):
        length = np.asarray(rotations.quaternion_length(*np.moveaxis(q, -1, 0)))
    off = ~np.asarray(is_unit(length))
    if off.any():
        at, name = first_of('quaternion', off)
        raise MotionError(f'{name}: {q[at].tolist()}: {unit_rule(length[at])}')
    x, y, z, w = np.moveaxis(q / length[..., None], -1, 0)
    return np.stack(rotations.from_quaternion(x, y, z, w), axis=-1).reshape(*q.shape[:-1], 3, 3)


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

    linear_velocity = Field(
        LINEAR_VELOCITY, "Velocity of the platform's origin, base axes, (..., 3) [m/s].")
    angular_velocity = Field(ANGULAR_VELOCITY, 'Angular velocity, base axes, (..., 3) [rad/s].')
    linear_acceleration = Field(
        LINEAR_ACCELERATION, "Acceleration of the platform's origin, base axes, (..., 3) [m/s^2].")
    angular_acceleration = Field(
        ANGULAR_ACCELERATION, 'Angular acceleration, base axes, (..., 3) [rad/s^2].')

    def __init__(
            self, position: ArrayLike, rotation: ArrayLike,
            linear_velocity: ArrayLike | None = None, angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None) -> None:
        self._fill_posed(
            position, rotation, (LINEAR_VELOCITY, linear_velocity),
            (ANGULAR_VELOCITY, angular_velocity), (LINEAR_ACCELERATION, linear_acceleration),
            (ANGULAR_ACCELERATION, angular_acceleration))

    @classmethod
    def from_pose(
            cls, pose: Pose | Motion, linear_velocity: ArrayLike | None = None,
            angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None) -> Motion:
        """Return the motion at a pose, by default at rest; other arguments are as in Motion."""
        check_kind(pose, Pose, Motion)
        return cls(pose.position, pose.rotation, linear_velocity, angular_velocity,
                   linear_acceleration, angular_acceleration)

    @classmethod
    def from_quaternion(
            cls, position: ArrayLike, quaternion: ArrayLike,
            linear_velocity: ArrayLike | None = None, angular_velocity: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angular_acceleration: ArrayLike | None = None) -> Motion:
        """Return the motion with a quaternion x y z w (..., 4), see Pose.from_quaternion."""
        return cls(position, matrix_of_quaternion(quaternion), linear_velocity,
                   angular_velocity, linear_acceleration, angular_acceleration)

    @classmethod
    def from_euler(
            cls, position: ArrayLike, angles: ArrayLike,
            linear_velocity: ArrayLike | None = None, angle_rates: ArrayLike | None = None,
            linear_acceleration: ArrayLike | None = None,
            angle_accelerations: ArrayLike | None = None, *, degrees: bool = False) -> Motion:
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


def check_kind(value: object, *kinds: type[Pose] | type[Motion], name: str = '') -> None:
    """Raise MotionError if an argument is not of one of these types."""
    if isinstance(value, kinds):
        return
    name = name or ('pose' if Pose in kinds else 'motion')
    hint = '; Motion.from_pose makes one at rest' if isinstance(value, Pose) else ''
    raise wrong_type(name, value, ' or '.join(f'a {kind.__name__}' for kind in kinds) + hint)


def motion_rows(pose: Pose | Motion, shape: tuple[int, ...] | None = None) -> Array:
    """Return rows of motion (N, MOTION) at rest in a pose that is broadcast to a leading shape."""
    check_kind(pose, Pose, Motion)
    rows = np.zeros((*(pose.shape if shape is None else shape), MOTION))
    rows[..., POSE] = pose.rows[..., POSE]
    return rows.reshape(-1, MOTION)


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = (matrix @ vector[..., None])[..., 0]
    return product
