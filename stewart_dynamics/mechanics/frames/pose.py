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

"""Poses of the platform, one sample or many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.frames.fields import listed, rows_of, Samples
from stewart_dynamics.mechanics.rows import POSE, POSITION, ROTATION

# A rotation matrix further from orthogonal than this is rejected.
ORTHOGONALITY = 1e-6
# Rounding cannot make one that is nearer than this exceed it.
_WELL = 0.9 * ORTHOGONALITY


class Posed(Samples):
    """The pose that is part of each sample of a Pose or a Motion."""

    @property
    def position(self) -> Array:
        """Origin of the platform frame in the base frame, (..., 3) [m]."""
        return self._part(POSITION)

    @property
    def rotation(self) -> Array:
        """Platform axes to base axes, (..., 3, 3)."""
        return self._part(ROTATION).reshape(*self.shape, 3, 3)

    @property
    def quaternion(self) -> Array:
        """Return the rotation as unit quaternions x y z w, (..., 4), w >= 0."""
        return rotations.to_quaternion(self.rotation)

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
        row = row_of_one(POSE.stop, position, rotation)
        if row is not None:
            self.rows, self.shape = row, ()
            return
        self.rows = rows_of(POSE.stop, {
            'position': (POSITION, as_array('position', position, (3,))),
            'rotation': (ROTATION, row_by_row(as_rotation(rotation)))})
        self.shape = self.rows.shape[:-1]

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
            at = tuple(map(int, np.argwhere(off)[0]))
            raise MotionError(f'matrix{list(at) if at else ""}: its last row is '
                              f'{last[at].tolist()}: must be [0, 0, 0, 1]')
        return cls(given[..., :3, 3], given[..., :3, :3])


def row_of_one(size: int, position: Any, rotation: Any, *parts: tuple[slice, Any],
               ) -> Array | None:
    """
    Return the row of one sample whose arguments are arrays of floats and well within the rules.

    This takes a tenth of the time that arguments of any kind and shape take; for these, and for
    wrong ones, it returns None. Parts of the row that are None are zero.
    """
    row = np.zeros(size)
    numbers = row.data
    try:
        numbers[POSITION] = position
        numbers[ROTATION] = rotation.reshape(9)
        for where, part in parts:
            if part is not None:
                numbers[where] = part
    except Exception:  # an arbitrary object may raise any; the check of all kinds names it
        return None
    values = row.tolist()
    a, b, c, d, e, f, g, h, i = values[ROTATION]
    if (abs(a * a + d * d + g * g - 1.0) < _WELL and abs(b * b + e * e + h * h - 1.0) < _WELL
            and abs(c * c + f * f + i * i - 1.0) < _WELL and abs(a * b + d * e + g * h) < _WELL
            and abs(a * c + d * f + g * i) < _WELL and abs(b * c + e * f + h * i) < _WELL
            and a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) > 0.0
            and math.isfinite(sum(values)) and rotation.shape == (3, 3)):
        return row
    return None


def as_rotation(rotation: ArrayLike) -> Array:
    """Return rotation matrices (..., 3, 3); MotionError for other ones."""
    r = as_array('rotation', rotation, (3, 3))
    with np.errstate(over='ignore', invalid='ignore'):
        error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(axis=(-2, -1))
        orthogonal, determinant = error <= ORTHOGONALITY, np.linalg.det(r)
        good = orthogonal & (determinant > 0.0)
    if not good.all():
        at = tuple(map(int, np.argwhere(~good)[0]))
        what = ('is a reflection: its determinant is -1, must be +1 (is an axis mirrored, or are '
                'two columns exchanged?)' if orthogonal[at] else
                f'is not a rotation: R^T R is {error[at]:.3g} off the identity, must be at most '
                f'{ORTHOGONALITY:g}')
        raise MotionError(f'rotation{list(at) if at else ""}: {r[at].tolist()} {what}')
    return r


def row_by_row(matrix: Array) -> Array:
    """Return matrices (..., 3, 3) as rows (..., 9)."""
    return matrix.reshape(*matrix.shape[:-2], 9)


def matrix_of_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions x y z w (..., 4)."""
    q = as_array('quaternion', quaternion, (4,))
    with np.errstate(over='ignore'):
        length = np.asarray(rotations.quaternion_length(*np.moveaxis(q, -1, 0)))
    off = ~np.asarray(rotations.is_unit(length))
    if off.any():
        at = tuple(map(int, np.argwhere(off)[0]))
        raise MotionError(
            f'quaternion{list(at) if at else ""}: {q[at].tolist()}: length {length[at]:.6g}, must '
            f'be within {rotations.QUATERNION_TOLERANCE:g} of 1')
    x, y, z, w = np.moveaxis(q / length[..., None], -1, 0)
    return np.stack(rotations.from_quaternion(x, y, z, w), axis=-1).reshape(*q.shape[:-1], 3, 3)
