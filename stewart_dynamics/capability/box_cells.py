# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Cells of a box of ranges, and the motion of a hexapod in them; compiled.

A pose of the box is a translation ``d`` of the pivot and a rotation vector ``r``, base axes. The
leg of a platform joint at ``a`` from the pivot is ``l = c + d + exp(r) a`` with a constant ``c``.
Since

    D^2 exp(X)[E, F] = int int exp(..) E exp(..) F exp(..) + the same with E and F exchanged

over a triangle of area 1/2, and exponentials of skew matrices are orthogonal, the second
derivative of ``exp(r) a`` in directions e and f is at most ``|a| |e| |f|``, for all r. Second
derivatives of directions of legs follow. So over a cell of half widths h around its middle a
quantity differs from its value there by at most ``sum |gradient_k| h_k + second |h|^2 / 2``. A
cell whose bound is not below the tolerance is divided.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, inlined
from stewart_dynamics.mechanics.dynamics.hexapod_constants import joints_of
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, read9, rotate, scale, subtract, Vector3)

SHIFT, TURN, HALF, BOUND, CELL = 0, 3, 6, 12, 13
"""Columns of a cell: d and r of its middle, six half widths, and a bound that holds in it."""
DEPTH = 1024  # largest number of cells that wait at a time
CENTER, ARM, BASE_AXIS, PLATFORM_AXIS, LEVER, LEG = 0, 3, 6, 9, 12, 15
"""Columns of a leg: c, a, the axes of its joints, and the platform joint from the origin."""
EXCESS, UPPER, POINT, FOUND = 0, 1, slice(2, 8), 8
"""Numbers of an answer: largest excess found, bound of the excess, and its point [d; r]."""


class Place(NamedTuple):
    """The pose in the middle of a cell, and how far the cell reaches."""

    shift: Vector3  # d
    turn: Vector3  # r
    exponential: Vector3  # sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3 of t = |r|
    half_shift: float  # norm of the half widths of d
    half_turn: float  # norm of the half widths of r


@compiled
def place_of(cell: Array) -> Place:
    """Return the place of a cell."""
    r = read3(cell, TURN)
    square = dot(r, r)
    if square < 0.25:
        a = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (
            1.0 / 40320.0 - square / 3628800.0)))
        b = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square * (
            1.0 / 362880.0 - square / 39916800.0)))
        exponential = 1.0 - square * b, a, b
    else:
        t = math.sqrt(square)
        sine = math.sin(t) / t
        exponential = sine, (1.0 - math.cos(t)) / square, (1.0 - sine) / square
    return Place(read3(cell, SHIFT), r, exponential, norm(read3(cell, HALF)),
                 norm(read3(cell, HALF + TURN)))


@compiled
def turned(place: Place, a: Vector3) -> Vector3:
    """Return exp(r) a."""
    once = cross(place.turn, a)
    return add(a, add(scale(place.exponential[0], once),
                      scale(place.exponential[1], cross(place.turn, once))))


@compiled
def gradient_of(place: Place, turned_arm: Vector3, n: Vector3) -> Vector3:
    """Return the gradient by r of ``n . exp(r) a``, given exp(r) a: J^T (exp(r) a x n)."""
    torque = cross(turned_arm, n)
    once = cross(place.turn, torque)
    return add(torque, add(scale(-place.exponential[1], once),
                           scale(place.exponential[2], cross(place.turn, once))))


@compiled
def spin_of(place: Place, axis: int) -> Vector3:
    """Return the angular velocity of exp(r) where a coordinate of r changes."""
    unit = unit_of(axis)
    once = cross(place.turn, unit)
    return add(unit, add(scale(place.exponential[1], once),
                         scale(place.exponential[2], cross(place.turn, once))))


@inlined
def unit_of(axis: int) -> Vector3:
    """Return the unit vector of an axis."""
    return (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)


@compiled
def prepare_legs(constants: Array, axes: Array, row: Array, pivot: Array, legs: Array) -> None:
    """Write the constants of the six legs (6, LEG)."""
    position, rotation = read3(row, POSITION.start), read9(row, ROTATION.start)
    center = add(position, rotate(rotation, read3(pivot, 0)))
    for n in range(6):
        base_joint, platform_joint = joints_of(constants, n)
        put3(legs[n], CENTER, subtract(center, base_joint))
        put3(legs[n], ARM, rotate(rotation, subtract(platform_joint, read3(pivot, 0))))
        put3(legs[n], BASE_AXIS, read3(axes[n], 0))
        put3(legs[n], PLATFORM_AXIS, rotate(rotation, read3(axes[6 + n], 0)))
        put3(legs[n], LEVER, rotate(rotation, platform_joint))


@compiled
def put_box(cell: Array, box: Array) -> None:
    """Make a cell of a box (12,)."""
    for k in range(BOUND):
        cell[k] = box[k]
    cell[BOUND] = math.inf


@compiled
def halve(cells: Array, at: int, coordinate: int, toward: float) -> None:
    """Replace a cell by its halves; the next one is that on the side of ``toward``."""
    half = 0.5 * cells[at, HALF + coordinate]
    step = math.copysign(half, toward)
    cells[at, HALF + coordinate] = half
    for n in range(CELL):
        cells[at + 1, n] = cells[at, n]
    cells[at, coordinate] -= step
    cells[at + 1, coordinate] += step


@inlined
def put_point(found: Array, cell: Array) -> None:
    """Make the middle of a cell the point of an answer."""
    for n in range(6):
        found[POINT.start + n] = cell[n]
