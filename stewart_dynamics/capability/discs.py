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
Circular arithmetic: complex numbers and vectors that are known to lie in a disc.

Sums and products of discs contain the sums and products of all their numbers. Of vectors, numbers
are multiplied as ``sum a_k b_k``, without conjugation, so that the results are analytic;
``|a . b|`` and ``|a x b|`` are at most ``|a| |b|`` all the same.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array


def size(values: Array) -> Array:
    """Return magnitudes (N, M) of numbers (N, M) or vectors (3, N, M)."""
    if values.ndim < 3:
        return np.abs(values)
    x, y, z = values
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length


def cross(a: Array, b: Array) -> Array:
    """Return a x b of vectors (3, N, M)."""
    return np.stack(np.broadcast_arrays(
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


class Disc:
    """
    Complex numbers or vectors within a distance from a real center.

    Parameters
    ----------
    center : (N, M) or (3, N, M)
        Numbers, or vectors.
    radius : (N, M)
        Distance; 0 by default.

    """

    def __init__(self, center: Array, radius: Array | float = 0.0) -> None:
        self.center, self.radius, self._size = center, np.asarray(radius), size(center)

    @property
    def largest(self) -> Array:
        """Return the largest magnitude."""
        largest: Array = self._size + self.radius
        return largest

    def __add__(self, other: Disc | Array) -> Disc:
        """Return the sum."""
        other = _disc(other)
        return Disc(self.center + other.center, self.radius + other.radius)

    def __sub__(self, other: Disc | Array) -> Disc:
        """Return the difference."""
        other = _disc(other)
        return Disc(self.center - other.center, self.radius + other.radius)

    def __mul__(self, other: Disc | Array | float) -> Disc:
        """Return the product of two numbers, or of a number and a vector."""
        other = _disc(other)
        return self._product(self.center * other.center, other)

    def dot(self, other: Disc) -> Disc:
        """Return the scalar product of two vectors."""
        return self._product((self.center * other.center).sum(axis=0), other)

    def cross(self, other: Disc | Array) -> Disc:
        """Return the vector product."""
        other = _disc(other)
        return self._product(cross(self.center, other.center), other)

    def _product(self, center: Array, other: Disc) -> Disc:
        return Disc(center, self._size * other.radius + self.radius * (other._size + other.radius))

    def inverse(self) -> Disc:
        """Return 1 / number; of infinite or undefined radius where the disc contains zero."""
        left = self._size - self.radius
        return Disc(1.0 / self.center, np.where(
            left > 0.0, self.radius / (self._size * left), np.inf))

    def length(self) -> tuple[Disc, Disc]:
        """Return the root L of ``v . v`` of vectors, and 1 / L; not finite where it may be 0."""
        # v . v is within 2 L r + r^2 of L^2; the roots differ most on the side of zero
        shortest = np.sqrt(self._size ** 2 - self.radius * (2.0 * self._size + self.radius))
        return (Disc(self._size, self._size - shortest),
                Disc(1.0 / self._size, 1.0 / shortest - 1.0 / self._size))

    def total(self) -> Disc:
        """Return the sum over the last axis, kept."""
        return Disc(self.center.sum(axis=-1, keepdims=True),
                    self.radius.sum(axis=-1, keepdims=True))


def _disc(value: Disc | Array | float) -> Disc:
    return value if isinstance(value, Disc) else Disc(np.asarray(value))
