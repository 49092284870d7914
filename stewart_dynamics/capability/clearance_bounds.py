# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Bounds of the clearance of two bodies whose corners move; compiled.

A body is the convex hull of corners: two of a cylinder or piston, any number of a plate. Whatever
vector n is chosen, two bodies are at least ``min n . (p - q) / |n|`` apart, over the corners p of
one and q of the other. At a pose the shortest vector between them is the best n, and the bound is
their distance. When the coordinates of the pose change by x, corners are at

    p(x) = p + sum_k x_k p_k + rest,  |rest| bounded,

and n may follow: ``n + sum_k x_k n_k``. Where several corners are equally near, as those of two
legs that cross, the n_k are chosen by least squares so that they stay so: then the bound differs
from the distance by terms of second order. Besides this n, one that stays, and one that turns with
the platform are tried: corners of one part, base or platform, keep their distances exactly.

The axis of a cylinder longer than its leg ends at the platform joint. Over a change of the pose
the hull of the base joint and of either end contains it.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, inlined
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE, between, from_plate, PLATFORM
from stewart_dynamics.mechanics.rows import ROTATION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, read9, rotate, scale, subtract, Vector3)

# Columns of a corner: where it is, its derivatives by the coordinates, and bounds of the rest, in
# the base frame and in a frame that turns with the platform; its arm where it is of the platform.
PLACE, RATES, STILL, TURNING, ARM, CORNER = 0, 3, 21, 22, 23, 26
# Corners of a leg: base joint, end of the cylinder (twice: no longer than the leg, as it is), and
# platform joint. The plates of base and platform follow those of six legs.
BASE_JOINT, CYLINDER, CYLINDER_END, PLATFORM_JOINT, OF_LEG = 0, 1, 2, 3, 4
PLATES = 6 * OF_LEG

FOLLOWING, STAYING, ROTATING = 0, 1, 2  # how n changes

# Corners whose direction from the nearest one is this near to a right angle with n count as near.
_NEAR = 0.05
# Part of the least squares that keeps n_k small where legs are almost parallel.
_RIDGE = 1e-3

Body = tuple[int, int, int]  # first corner, step to the next one, and end


class Bodies(NamedTuple):
    """Cylinders, pistons and plates, by their corners."""

    shapes: Array  # (6, 3), as in ``leg_clearance``
    corners: Array  # (M, CORNER)
    base_corners: int  # number of corners of the base's plate
    spins: Array  # (C, 3...): angular velocity of the platform by each coordinate
    n_rates: Array  # (C, 3...): derivative of n by each coordinate


def rows_of(plates: Sequence[Array], coordinates: int) -> int:
    """Return the rows of the memory of ``bodies_in``."""
    return PLATES + sum(map(len, plates)) + 2 * coordinates


@inlined
def bodies_in(memory: Array, coordinates: int, shapes: Array, base_corners: int) -> Bodies:
    """Return bodies whose corners, and rates by the coordinates, are in a memory."""
    spins = len(memory) - 2 * coordinates
    return Bodies(shapes, memory[:spins], base_corners, memory[spins:spins + coordinates],
                  memory[spins + coordinates:])


@compiled
def put_plates(bodies: Bodies, base: Array, platform: Array, row: Array, pivot: Array) -> None:
    """Write the corners of the base's plate, and the arms of those of the platform's."""
    rotation = read9(row, ROTATION.start)
    for n in range(PLATES, len(bodies.corners)):
        bodies.corners[n, :] = 0.0
    for n in range(len(base)):
        put3(bodies.corners[PLATES + n], PLACE, read3(base[n], 0))
    for n in range(len(platform)):
        put3(bodies.corners[PLATES + len(base) + n], ARM,
             rotate(rotation, subtract(read3(platform[n], 0), read3(pivot, 0))))


@inlined
def is_given(bodies: Bodies, other: int) -> bool:
    """Return whether there is a leg or plate."""
    if other == PLATFORM:
        return len(bodies.corners) > PLATES + bodies.base_corners
    return other != BASE or bodies.base_corners > 0


@inlined
def pairs_with(other: int) -> int:
    """Return the number of pairs of bodies of a leg and another leg or plate."""
    return 4 if other < 6 else 1


@inlined
def pair_of(bodies: Bodies, leg: int, other: int, pair: int) -> tuple[Body, Body, float]:
    """Return a body of a leg, one of a leg or plate, and the sum of their radii."""
    first, shapes = OF_LEG * leg, bodies.shapes
    cylinder = (first, CYLINDER, first + CYLINDER + 1)
    piston = (first, PLATFORM_JOINT, first + OF_LEG)
    plate = PLATES + bodies.base_corners
    if other == PLATFORM:
        return cylinder, (plate, 1, len(bodies.corners)), shapes[leg, 0]
    if other == BASE:
        out = (first + CYLINDER_END, 1, first + OF_LEG)
        return out, (PLATES, 1, plate), shapes[leg, 2]
    second = OF_LEG * other
    return (cylinder if pair & 1 else piston,
            (second, CYLINDER, second + CYLINDER + 1) if pair & 2 else (
                second, PLATFORM_JOINT, second + OF_LEG),
            (shapes[leg, 0] if pair & 1 else shapes[leg, 2])
            + (shapes[other, 0] if pair & 2 else shapes[other, 2]))


@inlined
def corners_of(body: Body) -> range:
    """Return the corners of a body."""
    return range(body[0], body[2], max(body[1], 1))  # a step of 0 would be an exception


@inlined
def between_corners(corners: Array, p: int, q: int) -> Vector3:
    """Return the vector from corner q to corner p."""
    return subtract(read3(corners[p], PLACE), read3(corners[q], PLACE))


@inlined
def shortest(corners: Array, a: Body, b: Body) -> Vector3:
    """Return the shortest vector from body b to body a, which is a segment."""
    p, p_end = read3(corners[a[0]], PLACE), read3(corners[a[2] - 1], PLACE)
    if b[2] - b[0] > b[1] + 1:
        return from_plate(corners, b[0], b[2], p, p_end, math.inf)
    return between(p, p_end, read3(corners[b[0]], PLACE), read3(corners[b[2] - 1], PLACE))


@inlined
def _support(corners: Array, body: Body, n: Vector3) -> int:
    """Return the corner of a body that is farthest against n."""
    best, lowest = body[0], math.inf
    for k in corners_of(body):
        along = dot(n, read3(corners[k], PLACE))
        if along < lowest:
            best, lowest = k, along
    return best


@compiled
def follow(bodies: Bodies, a: Body, b: Body, n: Vector3, how: int) -> None:
    """Write the derivatives of n, from body b to body a, by the coordinates."""
    corners, rates = bodies.corners, bodies.n_rates
    coordinates = len(rates)
    if how != FOLLOWING:
        for k in range(coordinates):
            put3(rates[k], 0, scale(
                1.0 if how == ROTATING else 0.0, cross(read3(bodies.spins[k], 0), n)))
        return
    x, y, z = abs(n[0]), abs(n[1]), abs(n[2])
    e = cross(n, (1.0 if x <= min(y, z) else 0.0, 1.0 if y < x and y <= z else 0.0,
                  1.0 if z < min(x, y) else 0.0))
    e = scale(1.0 / norm(e), e)
    f = cross(n, e)
    ee, ef, ff = _RIDGE, 0.0, _RIDGE
    for k in range(coordinates):
        put3(rates[k], 0, (0.0, 0.0, 0.0))
    for body, sign in ((a, 1.0), (b, -1.0)):
        nearest = _support(corners, body, scale(sign, n))
        for other in corners_of(body):
            q = between_corners(corners, other, nearest)
            length = norm(q)
            if other == nearest or not abs(dot(n, q)) < _NEAR * length:
                continue
            q_e, q_f = dot(q, e) / length, dot(q, f) / length
            ee, ef, ff = ee + q_e * q_e, ef + q_e * q_f, ff + q_f * q_f
            for k in range(coordinates):
                falling = dot(n, relative_rate(corners, other, nearest, k)) / length
                rates[k, 0] -= falling * q_e
                rates[k, 1] -= falling * q_f
    scaling = 1.0 / (ee * ff - ef * ef)
    for k in range(coordinates):
        r_e, r_f = rates[k, 0], rates[k, 1]
        put3(rates[k], 0, add(scale(scaling * (ff * r_e - ef * r_f), e),
                              scale(scaling * (ee * r_f - ef * r_e), f)))


@inlined
def relative_rate(corners: Array, p: int, q: int, k: int) -> Vector3:
    """Return the derivative of p - q by a coordinate."""
    return subtract(read3(corners[p], RATES + 3 * k), read3(corners[q], RATES + 3 * k))


@inlined
def slope_along(bodies: Bodies, p: int, q: int, n: Vector3, k: int) -> float:
    """Return the derivative of n . (p - q) by a coordinate."""
    return dot(n, relative_rate(bodies.corners, p, q, k)) + dot(
        read3(bodies.n_rates[k], 0), between_corners(bodies.corners, p, q))
