# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Six joints of which five are symmetric and one is not: a sign or a digit in a table.

Joints of hexapods repeat after a third of a turn, or are mirror images in pairs. Five joints that
do so determine where the sixth belongs.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.parameters.table import mean_radius

# By the mean distance from the center: the largest misfit of symmetric joints, as in tables of two
# or three digits; the largest deviation that is always accepted; and the smallest displacement of
# a joint by a wrong sign.
_FITS, _LEAST, _SIGN = 0.004, 0.0005, 0.03
# Where joints repeat, a joint breaks the symmetry if its deviation exceeds the misfit of the other
# five by the first factor, and the table's last digit by the second. Errors of measurement in all
# six joints reach a factor of 9, rounding reaches 2 units.
_TIMES, _UNITS = 15.0, 3.0
_MOST_DIGITS = 9

_THIRDS, _MIRRORED = 'repeat after a third of a turn', 'are mirror images in pairs'


class OddJoint(NamedTuple):
    """A joint that breaks a symmetry of the other five."""

    joint: int
    expected: Array  # where it would be symmetric (3,) [m]
    symmetry: str


def odd_joint(points: Array) -> OddJoint | None:
    """Return which of six points (6, 3) breaks a symmetry of the others; None if none does."""
    size = mean_radius(points)
    if not np.isfinite(points).all() or size == 0.0:
        return None
    least = max(_LEAST, _UNITS * _unit(points) / size)
    odd_ones: list[tuple[float, OddJoint]] = []
    wrong_signs: list[tuple[float, OddJoint]] = []
    symmetric = False
    for odd in range(6):
        others = [n for n in range(6) if n != odd]
        for expected, misfit in _thirds(points, others, size):
            off = float(np.linalg.norm(points[odd] - expected)) / size
            symmetric |= off <= _FITS
            if off > max(_TIMES * misfit, least):
                odd_ones.append((off, OddJoint(odd, expected, _THIRDS)))
        for expected in _mirrored(points, others, size):
            off = float(np.linalg.norm(points[odd] - expected)) / size
            symmetric |= off <= _FITS
            # Two pairs of mirror images are on any circle: only a wrong sign is identifiable.
            sign = np.abs(np.abs(points[odd]) - np.abs(expected)).max() <= _FITS * size
            if sign and off >= _SIGN:
                wrong_signs.append((off, OddJoint(odd, expected, _MIRRORED)))
    found = odd_ones or ([] if symmetric else wrong_signs)
    return min(found, key=lambda each: each[0])[1] if found else None


def _unit(points: Array) -> float:
    """Return the unit of the last digit in a table [m]."""
    for digits in range(_MOST_DIGITS):
        if np.array_equal(np.round(points, digits), points):
            break
    return float(10.0 ** -digits)


def _thirds(points: Array, others: list[int], size: float) -> list[tuple[Array, float]]:
    """Return where the sixth joint is if joints repeat after a third of a turn, and the misfit."""
    found = []
    for three in combinations(others, 3):
        triple = points[list(three)]
        center = triple.mean(axis=0)
        arms = triple - center
        radii = np.linalg.norm(arms, axis=1)
        sides = np.linalg.norm(triple - np.roll(triple, 1, axis=0), axis=1)
        uneven = float(np.ptp(sides)) / size
        if uneven > _FITS or radii.min() < 0.1 * size:
            continue
        axis = np.cross(arms[0], arms[1])
        axis /= np.linalg.norm(axis)
        first, second = points[[n for n in others if n not in three]] - center
        for angle in (2.0, -2.0):
            turned = _turned(first, axis, angle * np.pi / 3.0)
            missed = float(np.linalg.norm(turned - second)) / size
            if missed <= 2.0 * _FITS:
                last = _turned(second, axis, angle * np.pi / 3.0)
                found.append((center + last, max(uneven, missed)))
    return found


def _mirrored(points: Array, others: list[int], size: float) -> list[Array]:
    """Return where the sixth joint is if joints are mirror images in pairs."""
    found = []
    for alone in others:
        a, *rest = [n for n in others if n != alone]
        for b in rest:
            c, d = (n for n in rest if n != b)
            normal = points[a] - points[b]
            length = float(np.linalg.norm(normal))
            if length < 0.1 * size:
                continue
            normal = normal / length
            middle = 0.5 * (points[a] + points[b])
            if np.linalg.norm(_image(points[c], middle, normal) - points[d]) <= 2.0 * _FITS * size:
                found.append(_image(points[alone], middle, normal))
    return found


def _turned(arm: Array, axis: Array, angle: float) -> Array:
    """Return a vector turned about a unit axis (Rodrigues)."""
    turned: Array = (np.cos(angle) * arm + np.sin(angle) * np.cross(axis, arm)
                     + (1.0 - np.cos(angle)) * (axis @ arm) * axis)
    return turned


def _image(point: Array, middle: Array, normal: Array) -> Array:
    """Return the mirror image of a point in the plane through another."""
    image: Array = point - 2.0 * ((point - middle) @ normal) * normal
    return image
