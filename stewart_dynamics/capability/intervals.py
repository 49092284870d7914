# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Arithmetic that proves bounds: Taylor models of first order (Makino and Berz, 1996), in numpy.

A quantity over a cell of poses is ``center + sum_k x_k slopes_k`` within ``rest``, for all
``|x_k| <= 1``. Sums and products of such enclosures contain the sums and products of all their
numbers, rounding errors included. ``rest`` is of second order in the size of the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array

# Above the rounding errors of a few operations, relative to their largest operand.
_ROUNDING = 1e-15
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


class Enclosure:
    """
    Numbers of any shape (...), each over a cell of D coordinates.

    center, slopes, rest: (...), (D, ...), (...). Not finite where a bound is not known.
    """

    __slots__ = ('_spread', 'center', 'rest', 'slopes')
    __array_ufunc__ = None  # numpy leaves operators to this class

    def __init__(self, center: Array, slopes: Array, rest: Array | float) -> None:
        self.center, self.slopes = center, slopes
        self.rest: Array = np.asarray(rest)
        self._spread: Array | None = None

    @property
    def spread(self) -> Array:
        """Return the largest magnitude of the linear part."""
        if self._spread is None:
            self._spread = np.abs(self.slopes).sum(axis=0)
        return self._spread

    @property
    def low(self) -> Array:
        """Return the lower bound over the cell."""
        low: Array = self.center - self.spread - self.rest
        return low

    def __getitem__(self, index: Any) -> Enclosure:
        """Return some of the numbers; the index begins with the first axis of ``center``."""
        whole = index if isinstance(index, tuple) else (index,)
        return Enclosure(self.center[whole], self.slopes[(slice(None), *whole)],
                         np.broadcast_to(self.rest, self.center.shape)[whole])

    def reshape(self, *shape: int) -> Enclosure:
        """Return the same numbers in another shape."""
        center = self.center.reshape(shape)
        return Enclosure(center, self.slopes.reshape(len(self.slopes), *center.shape),
                         self.rest.reshape(shape))

    def replaced(self, index: Any, other: Enclosure) -> Enclosure:
        """Return the numbers with others along the first axis."""
        found = Enclosure(self.center.copy(), self.slopes.copy(), self.rest.copy())
        found.center[index], found.slopes[:, index], found.rest[index] = (
            other.center, other.slopes, other.rest)
        return Enclosure(found.center, found.slopes, found.rest)

    def __add__(self, other: Enclosure | Array | float) -> Enclosure:
        """Return the sum."""
        if isinstance(other, Enclosure):
            center, slopes = self.center + other.center, self.slopes + other.slopes
            rest = self.rest + other.rest
        else:
            center, slopes, rest = self.center + other, self.slopes, self.rest
        return Enclosure(center, slopes, rest + _ROUNDING * np.abs(center))

    __radd__ = __add__

    def __neg__(self) -> Enclosure:
        """Return the negative."""
        return Enclosure(-self.center, -self.slopes, self.rest)

    def __sub__(self, other: Enclosure | Array | float) -> Enclosure:
        """Return the difference."""
        return self + -other

    def __rsub__(self, other: Array | float) -> Enclosure:
        """Return the difference."""
        return -self + other

    def __mul__(self, other: Enclosure | Array | float) -> Enclosure:
        """Return the product."""
        if not isinstance(other, Enclosure):
            size = np.abs(other)
            return Enclosure(self.center * other, self.slopes * other, size * (
                self.rest + _ROUNDING * (np.abs(self.center) + self.spread)))
        size, its = np.abs(self.center) + self.spread, np.abs(other.center) + other.spread
        return Enclosure(
            self.center * other.center,
            self.center * other.slopes + other.center * self.slopes,
            self.spread * other.spread + (size + self.rest) * other.rest + self.rest * its
            + _ROUNDING * size * its)

    __rmul__ = __mul__

    def sum(self) -> Enclosure:
        """Return the sum over the last axis."""
        return Enclosure(self.center.sum(axis=-1), self.slopes.sum(axis=-1),
                         np.broadcast_to(self.rest, self.center.shape).sum(axis=-1))

    def square(self) -> Enclosure:
        """Return the square."""
        double = self * self
        half = 0.5 * self.spread * self.spread  # x^2 is between 0 and 1
        return Enclosure(double.center + half, double.slopes, double.rest - half)

    def sqrt(self) -> Enclosure:
        """Return the square root of positive numbers; unknown where one may be negative."""
        root, change = np.sqrt(self.center), self.spread + self.rest
        total = root + np.sqrt(np.maximum(self.center - change, 0.0))
        # the square root is below its tangent, by no more than this
        return self._bent(root, 0.5 / root, -np.where(
            change <= self.center, 0.5 * change * change / (root * total * total), np.inf))

    def inverse(self) -> Enclosure:
        """Return 1 / number of positive numbers; unknown where one may be zero."""
        inverse = 1.0 / self.center
        change = (self.spread + self.rest) * inverse
        return self._bent(inverse, -inverse * inverse, np.where(
            change < 1.0, inverse * change * change / (1.0 - change), np.inf))

    def _bent(self, value: Array, slope: Array, bend: Array) -> Enclosure:
        """Return a function of value and slope that is off its tangent by 0 to ``bend``."""
        half = 0.5 * np.where(np.isfinite(bend), bend, 0.0)
        return Enclosure(value + half, slope * self.slopes, np.abs(slope) * self.rest + np.abs(
            bend - half) + _ROUNDING * np.abs(value))


def dot(a: Enclosure, b: Enclosure | Array) -> Enclosure:
    """Return the scalar products of vectors (..., 3)."""
    return (a * b).sum()


def cross(a: Enclosure, b: Enclosure) -> Enclosure:
    """Return the vector products of vectors (..., 3)."""
    return (a[..., _NEXT] * b[..., _AFTER]) - (a[..., _AFTER] * b[..., _NEXT])


def length(vectors: Array) -> Array:
    """Return the lengths (..., 1) of vectors (..., 3)."""
    lengths: Array = np.sqrt(np.einsum('...i,...i->...', vectors, vectors))[..., None]
    return lengths


def unit(vectors: Enclosure) -> Enclosure:
    """Return unit vectors along vectors (..., 3); unknown where one may turn by 90 degrees."""
    middle = vectors.center / length(vectors.center)
    along = dot(vectors, middle)
    # tangents of the angles from the middle: how far a vector grows does not count
    across = (vectors - along[..., None] * middle) * along.inverse()[..., None]
    half = np.fmin(0.25 * ((across.spread + across.rest) ** 2).sum(axis=-1, keepdims=True), 0.5)
    return (across + middle) * Enclosure(
        1.0 - half, np.zeros((len(across.slopes), *half.shape)), half + _ROUNDING)


def joined(parts: Sequence[Enclosure], axis: int = -1) -> Enclosure:
    """Return enclosures one after the other along an axis, counted from the last one."""
    return Enclosure(*(np.concatenate(each, axis=axis) for each in zip(*(
        (part.center, part.slopes, part.rest) for part in parts), strict=True)))


def where(chosen: Any, a: Enclosure, b: Enclosure) -> Enclosure:
    """Return the numbers of a where chosen (...), else those of b."""
    return Enclosure(np.where(chosen, a.center, b.center), np.where(chosen, a.slopes, b.slopes),
                     np.where(chosen, a.rest, b.rest))
