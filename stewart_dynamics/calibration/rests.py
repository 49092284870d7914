# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Times at rest in a recording, and the mean pose of one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stewart_dynamics.arrays import Array, Stamps

SHORTEST = 0.5
"""Shortest time at rest [s]."""
SETTLING = 0.2
"""Part of a time at rest at each of its ends that is left out: the platform settles."""


def find_rests(times: Array | Stamps, values: Array, tolerance: float,
               second: int = 1) -> Iterator[tuple[int, int]]:
    """
    Yield first and last index of each time at rest.

    Parameters
    ----------
    times : array (N,)
        In order, in any unit.
    values : array (N, K)
        Coordinates at these times.
    tolerance : float
        At rest, none of the K changes by more.
    second : int
        Number of units of ``times`` in a second.

    """
    first, low, high = 0, values[0], values[0]
    for n in range(1, len(values) + 1):
        if n < len(values):
            lower, upper = np.minimum(low, values[n]), np.maximum(high, values[n])
            if np.all(upper - lower <= tolerance):
                low, high = lower, upper
                continue
        if times[n - 1] - times[first] >= SHORTEST * second:
            yield first, n - 1
        if n < len(values):
            first, low, high = n, values[n], values[n]


def mean_pose(rows: Array) -> Array:
    """Return the mean (7,) of positions and quaternions (N, 7) that differ by little."""
    turns = rows[:, 3:] * np.sign(rows[:, 3:] @ rows[0, 3:])[:, None]
    mean = turns.mean(axis=0)
    return np.concatenate([rows[:, :3].mean(axis=0), mean / np.linalg.norm(mean)])
