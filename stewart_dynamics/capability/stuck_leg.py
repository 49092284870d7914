# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod with a stuck leg: the five motions that remain, and the loads it can hold in them.

A leg whose brake is on, or whose screw has jammed, keeps its length: a twist X' is possible where
its row of J_inv gives zero. Its own force is no limit, since no motor makes it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array


class Remaining(NamedTuple):
    """
    The twists of a platform with a stuck leg at its poses.

    Attributes
    ----------
    motions : (..., 5, 6)
        Independent twists [m/s, rad/s] without a rate of the stuck leg, base axes; the first needs
        the least rates of the other legs.
    wrenches : (..., 5, 6)
        For each motion the wrench [N, N m] along it, at the platform's origin.
    lost : (..., 6)
        The twist that the stuck leg blocks.

    Each is of length 1 where rotations count by the characteristic length.

    """

    motions: Array
    wrenches: Array
    lost: Array


def remaining(inverse_jacobian: Array, leg: int, length: float) -> Remaining:
    """
    Return the motions that remain.

    inverse_jacobian (..., 6, 6): of the poses.
    length: by which rotations are made comparable with translations [m].
    """
    by_length = np.repeat([1.0, length], 3)
    scaled = inverse_jacobian / by_length
    blocked = scaled[..., leg, :] / np.linalg.norm(scaled[..., leg, :], axis=-1, keepdims=True)
    # The last five right singular vectors of one row are at right angles to it.
    free = np.linalg.svd(blocked[..., None, :])[2][..., 1:, :]
    others = np.delete(scaled, leg, axis=-2)
    turned = np.linalg.svd(others @ np.swapaxes(free, -1, -2))[2]
    motions = (turned @ free)[..., ::-1, :]
    largest = np.take_along_axis(
        motions, np.abs(motions).argmax(axis=-1)[..., None], axis=-1)
    motions = motions * np.sign(largest)
    return Remaining(motions / by_length, motions * by_length, blocked / by_length)
