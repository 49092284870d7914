# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Vectors of three numbers as tuples, of floats or of arrays.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array

Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]  # row by row
Symmetric3 = Vector6  # xx xy xz yy yz zz


def read3(array: Array, at: int) -> Vector3:
    """Return three numbers of an array from a place on."""
    return array[at], array[at + 1], array[at + 2]


def put3(array: Array, at: int, a: Vector3) -> None:
    """Write a vector into an array, beginning at an index."""
    array[at], array[at + 1], array[at + 2] = a


def read9(array: Array, at: int) -> Matrix3:
    """Return nine numbers of an array from a place on."""
    return (array[at], array[at + 1], array[at + 2], array[at + 3], array[at + 4],
            array[at + 5], array[at + 6], array[at + 7], array[at + 8])


def add(a: Vector3, b: Vector3) -> Vector3:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector3, b: Vector3) -> Vector3:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(k: float, a: Vector3) -> Vector3:
    """Return k a."""
    return k * a[0], k * a[1], k * a[2]


def dot(a: Vector3, b: Vector3) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Vector3) -> float:
    """Return the length of a vector."""
    return math.sqrt(dot(a, a))


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def rotate(r: Matrix3, a: Vector3) -> Vector3:
    """Return R a."""
    return (r[0] * a[0] + r[1] * a[1] + r[2] * a[2],
            r[3] * a[0] + r[4] * a[1] + r[5] * a[2],
            r[6] * a[0] + r[7] * a[1] + r[8] * a[2])


def rotate_back(r: Matrix3, a: Vector3) -> Vector3:
    """Return R^T a."""
    return (r[0] * a[0] + r[3] * a[1] + r[6] * a[2],
            r[1] * a[0] + r[4] * a[1] + r[7] * a[2],
            r[2] * a[0] + r[5] * a[1] + r[8] * a[2])


def symmetric(i: Symmetric3, a: Vector3) -> Vector3:
    """Return I a of a symmetric I (xx xy xz yy yz zz)."""
    return (i[0] * a[0] + i[1] * a[1] + i[2] * a[2],
            i[1] * a[0] + i[3] * a[1] + i[4] * a[2],
            i[2] * a[0] + i[4] * a[1] + i[5] * a[2])


def dot6(a: Vector6, b: Vector6) -> float:
    """Return a . b."""
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
            + a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


def choose6(first: bool, a: Vector6, b: Vector6) -> Vector6:
    """Return a if first, else b."""
    return (a[0] if first else b[0], a[1] if first else b[1], a[2] if first else b[2],
            a[3] if first else b[3], a[4] if first else b[4], a[5] if first else b[5])
