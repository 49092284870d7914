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

# In terms of the mean distance from the center: how well symmetric joints fit, as tables of two or
# three digits do, and from which deviation on the odd one is reported.
_FITS, _OFF = 0.004, 0.03

_THIRDS, _MIRRORED = 'repeat after a third of a turn', 'are mirror images in pairs'


class OddJoint(NamedTuple):
    """A joint that breaks a symmetry of the other five."""

    joint: int
    expected: Array
    """Where it would be symmetric (3,) [m]."""
    symmetry: str


def odd_joint(points: Array) -> OddJoint | None:
    """Return which of six points (6, 3) breaks a symmetry of the others; None if none does."""
    size = float(np.mean(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    if not np.isfinite(points).all() or size == 0.0:
        return None
    found = []
    for odd in range(6):
        others = [n for n in range(6) if n != odd]
        for expected, symmetry in (*_thirds(points, others, size),
                                   *_mirrored(points, others, size)):
            off = float(np.linalg.norm(points[odd] - expected)) / size
            if off <= _FITS:
                return None
            sign = bool(np.abs(np.abs(points[odd]) - np.abs(expected)).max() <= _FITS * size)
            # Two pairs of mirror images are on any circle: they tell no more than a sign.
            if off >= _OFF and (sign or symmetry == _THIRDS):
                found.append((symmetry != _THIRDS, not sign, off, odd, expected, symmetry))
    if not found:
        return None
    *_, odd, expected, symmetry = min(found, key=lambda each: each[:3])
    return OddJoint(odd, expected, symmetry)


def _thirds(points: Array, others: list[int], size: float) -> list[tuple[Array, str]]:
    """Return where the sixth joint is if joints repeat after a third of a turn."""
    found = []
    for three in combinations(others, 3):
        triple = points[list(three)]
        center = triple.mean(axis=0)
        arms = triple - center
        radii = np.linalg.norm(arms, axis=1)
        sides = np.linalg.norm(triple - np.roll(triple, 1, axis=0), axis=1)
        if np.ptp(sides) > _FITS * size or radii.min() < 0.1 * size:
            continue
        axis = np.cross(arms[0], arms[1])
        axis /= np.linalg.norm(axis)
        first, second = points[[n for n in others if n not in three]] - center
        for angle in (2.0, -2.0):
            turned = _turned(first, axis, angle * np.pi / 3.0)
            if np.linalg.norm(turned - second) <= 2.0 * _FITS * size:
                last = _turned(second, axis, angle * np.pi / 3.0)
                found.append((center + last, _THIRDS))
    return found


def _mirrored(points: Array, others: list[int], size: float) -> list[tuple[Array, str]]:
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
                found.append((_image(points[alone], middle, normal), _MIRRORED))
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
