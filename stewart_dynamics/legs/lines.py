# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The lines along which legs push their platform joints, for the readable equations."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array


class AnchorPath(NamedTuple):
    """The path of each anchor, by the position q of its drive: A(q)."""

    tangents: Array  # dA/dq (..., 6, 3)
    curvatures: Array  # d2A/dq2 (..., 6, 3)


class Lines(NamedTuple):
    """The six legs at a pose; the axis of the legs precedes the axes of vectors."""

    lengths: Array  # of legs or rods (..., 6) [m]
    directions: Array  # toward the platform joint (..., 6, 3)
    arms: Array  # a_i = R p_i (..., 6, 3) [m]
    path: AnchorPath | None = None  # where the lines begin, if that moves with the drives

    def levers(self) -> Array:
        """Return the efforts of the drives by the pushes along the lines (..., 6)."""
        if self.path is None:
            return np.ones_like(self.lengths)
        return dot(self.directions, self.path.tangents)[..., 0]

    def anchor_rates(self, joint_rates: Array) -> tuple[Array, Array]:
        """Return rates of the drives (..., 6, 1) and of anchors, by velocities of joints."""
        assert self.path is not None
        speeds = dot(self.directions, joint_rates) / self.levers()[..., None]
        return speeds, speeds * self.path.tangents


class AnchorCircles(NamedTuple):
    """
    The circles on which drives carry the beginnings of lines of fixed lengths.

    A(q) = center + radius (along cos q + across sin q), base frame. Of the two positions q that
    have a platform joint at the end of the line, the sign of the lever gives one.
    """

    along: Array  # unit vectors (6, 3)
    across: Array
    radii: Array  # (6,) [m]
    lengths: Array  # of the lines (6,) [m]
    signs: Array  # of the levers (6,)
    least: Array  # smallest ratios of levers to radii that are allowed (6,)
    middles: Array  # middle of the allowed positions (6,)
    halves: Array  # half of their range (6,); infinite: all are allowed
    limits: tuple[str, str]  # limits past which positions are above and below


def lines_from(anchors: Array, joints: Array, position: Array, rotation: Array) -> Lines:
    """Return the lines from anchors to platform joints, both (6, 3), in poses (...)."""
    arms = joint_arms(rotation, joints)
    vectors = position[..., None, :] + arms - anchors
    lengths = np.linalg.norm(vectors, axis=-1)
    return Lines(lengths, vectors / lengths[..., None], arms)


def joint_arms(rotation: Array, joints: Array) -> Array:
    """Return the arms a_i = R p_i (..., 6, 3) of platform joints (6, 3) [m]."""
    arms: Array = np.einsum('...jk,ik->...ij', rotation, joints)
    return arms


def skew(vector: NDArray[np.floating[Any]]) -> Array:
    """Return S (..., 3, 3) with S b = vector x b."""
    x, y, z = np.moveaxis(vector, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1),
                     np.stack([-y, x, zero], -1)], -2)


def per_leg(scalars: Array) -> Array:
    """Return a number for each leg, shaped to multiply a (..., 6, 3, 3)."""
    return scalars[..., None, None]


def transposed(matrix: Array) -> Array:
    """Return the transposes of matrices (..., m, n)."""
    return np.swapaxes(matrix, -1, -2)


def dot(a: NDArray[np.floating[Any]], b: NDArray[np.floating[Any]]) -> Array:
    """Return the products (..., 1) of vectors (..., 3)."""
    product: Array = np.sum(a * b, axis=-1, keepdims=True)
    return product
