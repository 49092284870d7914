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
Proofs about all poses of a box of ranges, by branch and bound; compiled.

A pose of the box is a translation ``d`` of the pivot and a rotation vector ``r``, base axes. The
leg of a platform joint at ``a`` from the pivot is ``l = c + d + exp(r) a`` with a constant ``c``.
Since

    D^2 exp(X)[E, F] = int int exp(..) E exp(..) F exp(..) + the same with E and F exchanged

over a triangle of area 1/2, and exponentials of skew matrices are orthogonal, the second
derivative of ``exp(r) a`` in directions e and f is at most ``|a| |e| |f|``, for all r. Second
derivatives of directions of legs follow. So over a cell of half widths h around its middle a
quantity differs from its value there by at most ``sum |gradient_k| h_k + second |h|^2 / 2``. A
cell whose bound is not below the tolerance is divided; where the bound of the second derivative
proves that the gradient has one sign, the cell shrinks to the side where the quantity is larger.

At a fixed rotation the longest leg and the largest joint angle (up to 90 degrees) of a box of
translations are at its corners, and the shortest leg at the point nearest to the base joint: these
limits are searched over three dimensions. The condition number is over six: with the scaled J_inv
``J = J_c (1 + sum_k h_k M_k) + R`` over a cell, its smallest singular value is at least
``smallest_c (1 - |sum_k h_k |M_k||) - |R|`` (Golub and Van Loan, Matrix Computations, 4th ed.,
8.6.2).

The clearance of two legs, or of a leg and a plate, over a cell is bounded along one vector for all
of their corners (``clearance_bounds``), up to terms of second order in h.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.clearance_bounds import (
    ARM, BASE_JOINT, BODIES, bodies, Body, corner_pair, CYLINDER, follow, FOLLOWING, MORE, OF_LEG,
    PLATES, PLATFORM_JOINT, RATES, ROTATING, shortest, STAYING, STILL, TURNING)
from stewart_dynamics.capability.travel import (
    BASE_ANGLE_MAX, BEND, largest_eigenvalue, LENGTH_MAX, LENGTH_MIN, PLATFORM_ANGLE_MAX, put6)
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, joints_of)
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE, PLATFORM
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.matrix6 import gram, inverse_and_determinant
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, read9, rotate, scale, subtract, Vector3, Vector6)

# A cell: middle and half widths of d and r, and a bound that holds in it.
_HALF, _BOUND, CELL = 6, 12, 13
# Place of a gradient after a translation in the row of scratch memory behind the cells.
_GRADIENT = 3
DEPTH = 1024
"""Largest number of cells that wait at a time."""

EXCESS, UPPER, POINT = 0, 1, slice(2, 8)
FOUND = 8
"""Numbers of an answer: largest excess found, bound of the excess, and its point [d; r]."""

# The constants of a leg: c, a, and the axes of its joints; and the platform joint from the origin.
_C, _A, _BASE_AXIS, _PLATFORM_AXIS, _ARM, LEG = 0, 3, 6, 9, 12, 15
# Numbers of a leg in a cell: l', s', and so on by the six coordinates, see ``_condition``.
ROWS = 36 + 6 + 6 + 36
"""Columns of the scratch memory of the condition number."""

# The largest excess is found to this part of a limit (of a radian); whether it is above zero to
# the tolerance of limits.
_EXACT = 1e-7
PAIRS = tuple((i, j) for i in range(6) for j in range(i + 1, 8))
"""Legs and the other legs and plates, in the order of ``clearance_in_box``."""

Bounded = tuple[float, float, Vector6, Vector6]
"""A value, its bound in a cell, the gradient, and the bound of the gradient's change."""


@inlined
def _read6(array: Array, at: int) -> Vector6:
    return (array[at], array[at + 1], array[at + 2], array[at + 3], array[at + 4], array[at + 5])


@compiled
def _coefficients(r: Vector3) -> tuple[float, float, float]:
    """Return sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3 of t = |r|."""
    square = dot(r, r)
    if square < 0.25:
        a = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (
            1.0 / 40320.0 - square / 3628800.0)))
        b = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square * (
            1.0 / 362880.0 - square / 39916800.0)))
        return 1.0 - square * b, a, b
    t = math.sqrt(square)
    sine = math.sin(t) / t
    return sine, (1.0 - math.cos(t)) / square, (1.0 - sine) / square


@compiled
def _turned(k: tuple[float, float, float], r: Vector3, a: Vector3) -> Vector3:
    """Return exp(r) a."""
    once = cross(r, a)
    return add(a, add(scale(k[0], once), scale(k[1], cross(r, once))))


@compiled
def _gradient(k: tuple[float, float, float], r: Vector3, turned: Vector3, n: Vector3) -> Vector3:
    """Return the gradient by r of ``n . exp(r) a``, given exp(r) a: J^T (exp(r) a x n)."""
    torque = cross(turned, n)
    once = cross(r, torque)
    return add(torque, add(scale(-k[1], once), scale(k[2], cross(r, once))))


@inlined
def _reach(g: Vector6, cell: Array) -> float:
    """Return the largest change of a linear function of this gradient over a cell."""
    reach: float = (
        abs(g[0]) * cell[_HALF] + abs(g[1]) * cell[_HALF + 1] + abs(g[2]) * cell[_HALF + 2]
        + abs(g[3]) * cell[_HALF + 3] + abs(g[4]) * cell[_HALF + 4] + abs(g[5]) * cell[_HALF + 5])
    return reach


@compiled
def _prepare(constants: Array, axes: Array, row: Array, pivot: Array, legs: Array) -> None:
    """Write the constants of the six legs (6, LEG)."""
    position, rotation = read3(row, POSITION.start), read9(row, ROTATION.start)
    center = add(position, rotate(rotation, read3(pivot, 0)))
    for n in range(6):
        base_joint, platform_joint = joints_of(constants, n)
        put3(legs[n], _C, subtract(center, base_joint))
        put3(legs[n], _A, rotate(rotation, subtract(platform_joint, read3(pivot, 0))))
        put3(legs[n], _BASE_AXIS, read3(axes[n], 0))
        put3(legs[n], _PLATFORM_AXIS, rotate(rotation, read3(axes[6 + n], 0)))
        put3(legs[n], _ARM, rotate(rotation, platform_joint))


@compiled
def _longest(leg: Array, limit: float, cell: Array) -> Bounded:
    """Return how much longer than a limit a leg is; the cell has one translation."""
    p, a, r = add(read3(leg, _C), read3(cell, 0)), read3(leg, _A), read3(cell, 3)
    k = _coefficients(r)
    turned = _turned(k, r, a)
    length = norm(add(p, turned))
    g = _gradient(k, r, turned, p)
    half = norm(read3(cell, _HALF + 3))
    change = norm(p) * norm(a) * half
    gradient = (0.0, 0.0, 0.0, g[0], g[1], g[2])
    square = length * length + 2.0 * _reach(gradient, cell) + change * half
    return (length - limit, math.sqrt(square) - limit, gradient,
            (0.0, 0.0, 0.0, change, change, change))


@inlined
def _beyond(value: float, half: float) -> float:
    """Return how far a value is outside [-half, half]."""
    return max(value - half, 0.0) + min(value + half, 0.0)


@compiled
def _shortest(leg: Array, limit: float, cell: Array, point: Array) -> Bounded:
    """Return how much shorter than a limit a leg is; writes the nearest translation."""
    a, r = read3(leg, _A), read3(cell, 3)
    k = _coefficients(r)
    turned = _turned(k, r, a)
    v = add(add(read3(leg, _C), read3(cell, 0)), turned)
    out = (_beyond(v[0], cell[_HALF]), _beyond(v[1], cell[_HALF + 1]),
           _beyond(v[2], cell[_HALF + 2]))
    put3(point, 0, add(read3(cell, 0), subtract(out, v)))
    distance = norm(out)
    half, arm = norm(read3(cell, _HALF + 3)), norm(a)
    nearest = distance - arm * half
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if nearest <= 0.0:
        # the gradient's change is not bounded where the distance may be zero
        return limit - distance, limit, none, (0.0, 0.0, 0.0, arm, arm, arm)
    g = _gradient(k, r, turned, scale(-1.0 / distance, out))
    gradient = (0.0, 0.0, 0.0, g[0], g[1], g[2])
    lowest = distance - _reach(gradient, cell) - 0.5 * arm * half * half
    change = arm * half * (1.0 + arm / nearest)
    return (limit - distance, limit - lowest, gradient,
            (0.0, 0.0, 0.0, change, change, change))


@compiled
def _angle(leg: Array, at_platform: bool, limit: float, cell: Array) -> Bounded:
    """Return by how much a joint's angle exceeds its limit."""
    a, r = read3(leg, _A), read3(cell, 3)
    k = _coefficients(r)
    turned = _turned(k, r, a)
    line = add(add(read3(leg, _C), read3(cell, 0)), turned)
    axis = _turned(k, r, read3(leg, _PLATFORM_AXIS)) if at_platform else read3(leg, _BASE_AXIS)
    length = norm(line)
    s = scale(1.0 / length, line)
    cosine = dot(s, axis)
    normal = scale(1.0 / length, subtract(scale(cosine, s), axis))
    g = _gradient(k, r, turned, normal)
    if at_platform:
        g = subtract(g, _gradient(k, r, axis, s))
    gradient = (normal[0], normal[1], normal[2], g[0], g[1], g[2])
    excess = math.acos(min(max(cosine, -1.0), 1.0)) - limit
    half, arm = norm(read3(cell, _HALF + 3)), norm(a)
    moved = norm(read3(cell, _HALF)) + arm * half
    shortest = length - moved
    if shortest <= 0.0:
        return excess, math.pi - limit, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (
            1.0, 1.0, 1.0, arm, arm, arm)
    inverse = 1.0 / shortest
    swing = moved * inverse
    by_d = BEND * swing * inverse
    by_r = arm * (half * inverse + BEND * swing * inverse)
    if at_platform:
        by_d += half * inverse
        by_r += swing + arm * half * inverse + half
    bend = by_d * norm(read3(cell, _HALF)) + by_r * half
    lowest = cosine - _reach(gradient, cell) - 0.5 * bend
    return (excess, math.acos(min(max(lowest, -1.0), 1.0)) - limit, gradient,
            (by_d, by_d, by_d, by_r, by_r, by_r))


@compiled
def _enough(best: float, size: float) -> float:
    """Return the excess that cells need not exceed: nothing depends on more digits."""
    if -_EXACT * size <= best <= 0.5 * TOLERANCE * size:
        return 0.5 * TOLERANCE * size
    return best + _EXACT * size


@compiled
def _search(leg: Array, code: int, limit: float, cells: Array, waiting: int, most: int,
            point: Array, found: Array) -> None:
    """Write the largest excess of a limit over the cells that wait."""
    size = limit if code <= LENGTH_MAX else 1.0
    best, upper, count, top = -math.inf, -math.inf, 0, waiting
    while top > 0:
        top -= 1
        cell = cells[top]
        if cell[_BOUND] <= _enough(best, size) or count >= most or top + 2 >= DEPTH:
            upper = max(upper, cell[_BOUND])
            continue
        count += 1
        put3(point, 0, read3(cell, 0))
        if code == LENGTH_MAX:
            excess, bound, g, change = _longest(leg, limit, cell)
        elif code == LENGTH_MIN:
            excess, bound, g, change = _shortest(leg, limit, cell, point)
        else:
            excess, bound, g, change = _angle(leg, code == PLATFORM_ANGLE_MAX, limit, cell)
        if excess > best:
            best = excess
            for n in range(3):
                found[POINT.start + n] = point[n]
                found[POINT.start + 3 + n] = cell[3 + n]
        bound = min(bound, cell[_BOUND])
        if bound <= _enough(best, size):
            upper = max(upper, bound)
            continue
        cell[_BOUND] = bound
        put6(point, _GRADIENT, g)
        shrunk, widest, at = False, -1.0, 0
        # The shortest leg has its translation in closed form.
        for n in range(3 if code == LENGTH_MIN else 0, 6):
            half, slope = cell[_HALF + n], point[_GRADIENT + n]
            bend = change[0] if n < 3 else change[3]
            if half > 0.0 and abs(slope) > bend:
                cell[n] += math.copysign(half, slope)
                cell[_HALF + n] = 0.0
                shrunk = True
            elif half * (abs(slope) + bend) > widest:
                widest, at = half * (abs(slope) + bend), n
        if shrunk:
            top += 1
            continue
        # both halves; the one where the quantity rises is taken first
        half = 0.5 * cell[_HALF + at]
        step = math.copysign(half, point[_GRADIENT + at])
        cell[_HALF + at] = half
        for n in range(CELL):
            cells[top + 1, n] = cell[n]
        cell[at] -= step
        cells[top + 1, at] += step
        top += 2
    found[EXCESS], found[UPPER] = best, max(best, upper)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[::1]', 'i8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def legs_in_box(constants: Array, axes: Array, bounds: Array, row: Array, pivot: Array,
                box: Array, most: int, legs: Array, cells: Array, found: Array) -> None:
    """
    Write the largest excess of each limit of lengths and joint angles over a box.

    Parameters
    ----------
    constants, axes, bounds : (CONSTANTS,), (12, 3), (5, 6)
        As in ``travel.travels``; the clearance is that of ``clearance_in_box``.
    row : (MOTION,)
        Pose from which the box is measured.
    pivot : (3,)
        Center of rotation, platform frame [m].
    box : (12,)
        Middle and half widths of translation [m] and rotation vector [rad].
    most : int
        Largest number of cells for each limit of each leg.
    legs, cells : (6, LEG), (DEPTH + 1, CELL)
        Scratch memory.
    found : (24, FOUND)
        Written: for each code and leg the largest excess found [m, rad], a bound of the excess,
        and the point [d; r]; minus infinity where there is no limit.

    """
    _prepare(constants, axes, row, pivot, legs)
    for code in range(4):
        for n in range(6):
            limit = bounds[code, n]
            answer = found[6 * code + n]
            answer[EXCESS] = answer[UPPER] = -math.inf
            if (code == LENGTH_MIN and limit <= 0.0) or (
                    code == LENGTH_MAX and limit == math.inf) or (
                    code >= BASE_ANGLE_MAX and limit >= math.pi):
                continue
            corners = code == LENGTH_MAX or (code >= BASE_ANGLE_MAX and limit <= 0.5 * math.pi)
            waiting = 0
            for corner in range(8 if corners else 1):
                cell = cells[waiting]
                for k in range(12):
                    cell[k] = box[k]
                cell[_BOUND] = math.inf
                new = True
                if corners:
                    for k in range(3):
                        upward = corner >> k & 1 == 1
                        new = new and (upward or box[_HALF + k] > 0.0)
                        cell[k] += box[_HALF + k] if upward else -box[_HALF + k]
                        cell[_HALF + k] = 0.0
                if new:
                    waiting += 1
            # the last row of the cells is the point
            _search(legs[n], code, limit, cells, waiting, most, cells[DEPTH], answer)


@compiled
def _prepare_plates(base: Array, platform: Array, row: Array, pivot: Array, corners: Array,
                    ) -> None:
    """Write the corners of the base's plate, and the arms of those of the platform's."""
    rotation = read9(row, ROTATION.start)
    for n in range(len(base)):
        corner = corners[PLATES + n]
        corner[:] = 0.0
        put3(corner, 0, read3(base[n], 0))
    for n in range(len(platform)):
        put3(corners[PLATES + len(base) + n], ARM,
             rotate(rotation, subtract(read3(platform[n], 0), read3(pivot, 0))))


@compiled
def _put_spins(k: tuple[float, float, float], cell: Array, corners: Array) -> None:
    """Write the angular velocities of the platform for each coordinate of a cell."""
    r = read3(cell, 3)
    turn = corners[len(corners) - 2]
    for axis in range(3):
        unit = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
        once = cross(r, unit)
        put3(turn, RATES + 3 * axis, (0.0, 0.0, 0.0))
        put3(turn, RATES + 9 + 3 * axis,
             add(unit, add(scale(k[1], once), scale(k[2], cross(r, once)))))


@inlined
def _put_rates(corners: Array, at: int, turned: Vector3) -> None:
    """Write the derivatives of a point of the platform, ``turned`` from the pivot."""
    turn = corners[len(corners) - 2]
    for axis in range(3):
        put3(corners[at], RATES + 3 * axis, (
            1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0))
        put3(corners[at], RATES + 9 + 3 * axis, cross(read3(turn, RATES + 9 + 3 * axis), turned))


@compiled
def _put_leg(constants: Array, shapes: Array, legs: Array, corners: Array,
             k: tuple[float, float, float], cell: Array, n: int) -> None:
    """Write the corners of a leg."""
    base_joint, _ = joints_of(constants, n)
    center = add(read3(legs[n], _C), read3(cell, 0))
    turned = _turned(k, read3(cell, 3), read3(legs[n], _A))
    line = add(center, turned)
    length, cylinder = norm(line), shapes[n, 1]
    s = scale(1.0 / length if length > 0.0 else 0.0, line)
    half_d, half_r = norm(read3(cell, _HALF)), norm(read3(cell, _HALF + 3))
    arm = norm(turned)
    moved = half_d + arm * half_r
    shortest_length = length - moved
    # a vector that turns with the platform, times the way from the center to a point of the base
    turning = half_r * (0.5 * half_r * norm(center) + half_d)
    swing = moved / shortest_length if shortest_length > 0.0 else math.inf
    bend = arm * half_r * half_r / shortest_length + BEND * swing * swing
    if not shortest_length > 0.0:
        bend = math.inf
    for place in range(OF_LEG):
        at = OF_LEG * n + place
        corner = corners[at]
        if place == BASE_JOINT:
            corner[:] = 0.0
            put3(corner, 0, base_joint)
            corner[TURNING] = turning
        elif place == PLATFORM_JOINT or (place == CYLINDER and length <= cylinder):
            put3(corner, 0, add(base_joint, line))
            _put_rates(corners, at, turned)
            corner[STILL], corner[TURNING] = 0.5 * arm * half_r * half_r, 0.0
        else:
            put3(corner, 0, add(base_joint, scale(cylinder, s)))
            _put_rates(corners, at, turned)
            for coordinate in range(6):
                change = read3(corner, RATES + 3 * coordinate)
                put3(corner, RATES + 3 * coordinate, scale(
                    cylinder / length if length > 0.0 else 0.0,
                    subtract(change, scale(dot(s, change), s))))
            corner[STILL] = 0.5 * cylinder * bend
            corner[TURNING] = turning + 0.5 * cylinder * (bend + half_r * (2.0 * swing + half_r))


@compiled
def _put_plate(constants: Array, legs: Array, corners: Array, base_corners: int,
               k: tuple[float, float, float], cell: Array, plate: int) -> None:
    """Write the corners of a plate."""
    joint, _ = joints_of(constants, 0)
    center = add(joint, add(read3(legs[0], _C), read3(cell, 0)))
    half_d, half_r = norm(read3(cell, _HALF)), norm(read3(cell, _HALF + 3))
    if plate == BASE:
        for n in range(PLATES, PLATES + base_corners):
            corners[n, TURNING] = half_r * (
                0.5 * half_r * norm(subtract(center, read3(corners[n], 0))) + half_d)
        return
    for n in range(PLATES + base_corners, len(corners) - MORE):
        arm = read3(corners[n], ARM)
        turned = _turned(k, read3(cell, 3), arm)
        put3(corners[n], 0, add(center, turned))
        _put_rates(corners, n, turned)
        corners[n, STILL], corners[n, TURNING] = 0.5 * norm(arm) * half_r * half_r, 0.0


@compiled
def _lowest(corners: Array, a: Body, b: Body, n: Vector3, cell: Array, how: int,
            ) -> tuple[float, int, int]:
    """Return the least distance of two bodies over a cell along n, and the corners of it."""
    follow(corners, a, b, n, 6, how)
    follows = corners[len(corners) - 1]
    x = y = z = 0.0
    for k in range(6):
        half = cell[_HALF + k]
        x += half * abs(follows[RATES + 3 * k])
        y += half * abs(follows[RATES + 3 * k + 1])
        z += half * abs(follows[RATES + 3 * k + 2])
    turned = math.sqrt(x * x + y * y + z * z) if how == FOLLOWING else 0.0
    longer = math.sqrt(1.0 + turned * turned)
    rest = TURNING if how == ROTATING else STILL
    lowest, worst, other_worst = math.inf, a[0], b[0]
    for p in range(a[0], a[2], a[1]):
        for q in range(b[0], b[2], b[1]):
            distance = dot(n, subtract(read3(corners[p], 0), read3(corners[q], 0)))
            distance -= longer * (corners[p, rest] + corners[q, rest])
            x = y = z = 0.0
            for k in range(6):
                half = cell[_HALF + k]
                moved, slope = corner_pair(corners, p, q, n, k)
                distance -= half * abs(slope)
                x += half * abs(moved[0])
                y += half * abs(moved[1])
                z += half * abs(moved[2])
            distance -= turned * math.sqrt(x * x + y * y + z * z)
            if distance < lowest:
                lowest, worst, other_worst = distance, p, q
    return lowest / longer if lowest > 0.0 else lowest, worst, other_worst


@compiled
def _clearance(constants: Array, shapes: Array, legs: Array, corners: Array, base_corners: int,
               i: int, j: int, cell: Array, limit: float, slopes: Array) -> tuple[float, float]:
    """
    Return the clearance of a leg and a leg or plate in the middle of a cell, and a bound of it.

    Writes the slopes (6,) of the distance of those corners that bound it, where the bound is below
    the limit.
    """
    k = _coefficients(read3(cell, 3))
    _put_spins(k, cell, corners)
    _put_leg(constants, shapes, legs, corners, k, cell, i)
    if j < 6:
        _put_leg(constants, shapes, legs, corners, k, cell, j)
    else:
        _put_plate(constants, legs, corners, base_corners, k, cell, j)
    clearance = bound = math.inf
    for pair in range(BODIES):
        given, a, b, radii = bodies(shapes, corners, base_corners, i, j, pair)
        if not given:
            continue
        vector = shortest(corners, a, b)
        distance = norm(vector)
        clearance = min(clearance, distance - radii)
        if distance == 0.0:
            bound = -radii
            continue
        n = scale(1.0 / distance, vector)
        lowest, p, q = _lowest(corners, a, b, n, cell, FOLLOWING)
        if lowest - radii < limit and lowest - radii < bound:
            for coordinate in range(6):
                _, slopes[coordinate] = corner_pair(corners, p, q, n, coordinate)
            for how in (STAYING, ROTATING):
                other_lowest, _, _ = _lowest(corners, a, b, n, cell, how)
                lowest = max(lowest, other_lowest)
        bound = min(bound, max(lowest, 0.0) - radii)
    return clearance, bound


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8', 'f8[::1]',
             'f8[::1]', 'f8[::1]', 'i8', 'f8', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def clearance_in_box(constants: Array, axes: Array, shapes: Array, base: Array, platform: Array,
                     limit: float, row: Array, pivot: Array, box: Array, most: int, coarse: float,
                     legs: Array, cells: Array, corners: Array, found: Array) -> None:
    """
    Prove that no leg is nearer than a limit to another one, or to a plate, over a box.

    Parameters
    ----------
    constants, axes, row, pivot, box, legs, cells
        As in ``legs_in_box``.
    shapes, base, platform : (6, 3), (M, 3), (M, 3)
        As in ``leg_clearance``.
    limit : float
        Smallest clearance [m].
    most : int
        Largest number of cells for each pair.
    coarse : float
        The largest excess of a pair that does not keep the limit is found to this part; infinite:
        the search ends with the first pair that does not.
    corners : (PLATES + corners of the plates + MORE, CORNER)
        Scratch memory, see ``clearance_bounds``.
    found : (PAIRS, FOUND)
        Written: for each pair the largest excess found, a bound of the excess [m], and the point
        [d; r]; minus infinity where there is no plate. A pair that keeps the limit everywhere is
        not searched further.

    """
    _prepare(constants, axes, row, pivot, legs)
    _prepare_plates(base, platform, row, pivot, corners)
    for pair in range(len(found)):
        found[pair, EXCESS] = found[pair, UPPER] = -math.inf
    pair = 0
    for i in range(6):
        for j in range(i + 1, 8):
            if (j != BASE or len(base)) and (j != PLATFORM or len(platform)):
                for k in range(12):
                    cells[0, k] = box[k]
                cells[0, _BOUND] = math.inf
                _search_pair(constants, shapes, legs, corners, len(base), i, j, limit, cells,
                             most, coarse, found[pair])
                if coarse == math.inf and found[pair, EXCESS] > TOLERANCE * limit:
                    return
            pair += 1


@compiled
def _search_pair(constants: Array, shapes: Array, legs: Array, corners: Array, base_corners: int,
                 i: int, j: int, limit: float, cells: Array, most: int, coarse: float,
                 found: Array) -> None:
    """Write the largest excess of the clearance of a pair over the cell that waits."""
    kept = 0.5 * TOLERANCE * limit
    best, upper, count, top = -math.inf, -math.inf, 0, 1
    slopes = cells[DEPTH]
    slopes[:] = 0.0
    while top > 0:
        top -= 1
        cell = cells[top]
        enough = kept if best <= kept else best + coarse * abs(best)
        if cell[_BOUND] <= enough or count >= most or top + 2 >= DEPTH:
            upper = max(upper, cell[_BOUND])
            continue
        count += 1
        clearance, lowest = _clearance(
            constants, shapes, legs, corners, base_corners, i, j, cell, limit - enough, slopes)
        if limit - clearance > best:
            best = limit - clearance
            for n in range(6):
                found[POINT.start + n] = cell[n]
        cell[_BOUND] = min(cell[_BOUND], limit - lowest)
        widest, at = 0.0, 0
        arm = max(norm(read3(legs[i], _A)), norm(read3(legs[j if j < 6 else i], _A)))
        for n in range(6):
            wide = cell[_HALF + n] * (1.0 if n < 3 else arm)
            wide *= abs(slopes[n]) / (1.0 if n < 3 else arm) + 0.1
            if wide > widest:
                widest, at = wide, n
        if cell[_BOUND] <= enough or widest <= 0.0:
            upper = max(upper, cell[_BOUND])
            continue
        half = 0.5 * cell[_HALF + at]
        step = math.copysign(half, slopes[at])
        cell[_HALF + at] = half
        for n in range(CELL):
            cells[top + 1, n] = cell[n]
        cell[at] += step
        cells[top + 1, at] -= step  # nearer, and taken first
        top += 2
    found[EXCESS], found[UPPER] = best, max(best, upper)


@compiled
def _condition(constants: Array, legs: Array, cell: Array, stop: float, rows: Array,
               weights: Array) -> tuple[float, float, float, float]:
    """
    Return margin and condition number in the middle of a cell, det(J), and a bound of the margin.

    The margin is ``smallest - largest / stop`` of the singular values of the scaled J_inv. Writes
    by how much each coordinate changes the matrix over the cell.
    """
    inverse_size = 1.0 / characteristic_length_of(constants)
    r = read3(cell, 3)
    k = _coefficients(r)
    half_d, half_r = norm(read3(cell, _HALF)), norm(read3(cell, _HALF + 3))
    bending = moving = 0.0
    near = True
    for n in range(6):
        leg, work = legs[n], rows[n]
        a = read3(leg, _A)
        turned = _turned(k, r, a)
        line = add(add(read3(leg, _C), read3(cell, 0)), turned)
        length = norm(line)
        inverse = 1.0 / length
        s = scale(inverse, line)
        arm = scale(inverse_size, _turned(k, r, read3(leg, _ARM)))
        put3(work, 36, s)
        put3(work, 39, cross(arm, s))
        for axis in range(3):
            unit = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0,
                    1.0 if axis == 2 else 0.0)
            change = scale(inverse, subtract(unit, scale(dot(s, unit), s)))
            put3(work, 6 * axis, change)
            put3(work, 6 * axis + 3, cross(arm, change))
            once = cross(r, unit)
            spin = add(unit, add(scale(k[1], once), scale(k[2], cross(r, once))))
            swept = cross(spin, turned)
            change = scale(inverse, subtract(swept, scale(dot(s, swept), s)))
            put3(work, 18 + 6 * axis, change)
            put3(work, 21 + 6 * axis,
                 add(cross(cross(spin, arm), s), cross(arm, change)))
        reach = norm(a)
        moved = half_d + reach * half_r
        shortest = length - moved
        near = near and shortest > 0.0
        swing = moved / shortest
        curve = reach * half_r * half_r / shortest + BEND * swing * swing
        lever = norm(arm)
        moment = lever * (half_r * half_r + 2.0 * half_r * swing + curve)
        bending += curve * curve + moment * moment
        moment = lever * (half_r + swing)
        moving += swing * swing + moment * moment
    matrix = (_read6(rows[0], 36), _read6(rows[1], 36), _read6(rows[2], 36),
              _read6(rows[3], 36), _read6(rows[4], 36), _read6(rows[5], 36))
    inverted, determinant = inverse_and_determinant(
        matrix[0], matrix[1], matrix[2], matrix[3], matrix[4], matrix[5])
    largest = math.sqrt(largest_eigenvalue(gram(
        matrix[0], matrix[1], matrix[2], matrix[3], matrix[4], matrix[5])))
    smallest = 1.0 / math.sqrt(largest_eigenvalue(gram(
        inverted[0], inverted[1], inverted[2], inverted[3], inverted[4], inverted[5])))
    margin = smallest - largest / stop
    put6(rows[0], 42, inverted[0])
    put6(rows[1], 42, inverted[1])
    put6(rows[2], 42, inverted[2])
    put6(rows[3], 42, inverted[3])
    put6(rows[4], 42, inverted[4])
    put6(rows[5], 42, inverted[5])
    for n in range(6):
        for j in range(6):
            rows[n, 48 + j] = 0.0
    for coordinate in range(6):
        half = cell[_HALF + coordinate]
        weights[coordinate] = 0.0
        if half == 0.0:
            continue
        for n in range(6):
            for j in range(6):
                product = 0.0
                for m in range(6):
                    product += rows[n, 42 + m] * rows[m, 6 * coordinate + j]
                rows[n, 48 + j] += half * abs(product)
                weights[coordinate] += half * half * product * product
    tallest = widest = 0.0
    for n in range(6):
        along = across = 0.0
        for j in range(6):
            along += rows[n, 48 + j]
            across += rows[j, 48 + n]
        widest, tallest = max(widest, along), max(tallest, across)
    moving = math.sqrt(moving)
    lowest = max(smallest * (1.0 - math.sqrt(widest * tallest)) - 0.5 * math.sqrt(bending),
                 smallest - moving)
    bound = lowest - (largest + moving) / stop if near else -math.inf
    return margin, largest / smallest, determinant, bound


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[::1]', 'f8', 'i8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'i8[::1]')
def condition_in_box(constants: Array, axes: Array, row: Array, pivot: Array, box: Array,
                     stop: float, most: int, legs: Array, cells: Array, rows: Array,
                     found: Array, count: Integers) -> None:
    """
    Prove that the condition number stays below ``stop`` over a box, and det(J) its sign.

    Parameters
    ----------
    constants, axes, row, pivot, box, most, legs, cells
        As in ``legs_in_box``; det(J) must have the sign that it has at the pose of the row.
    stop : float
        Condition number that must not be reached.
    rows : (7, ROWS)
        Scratch memory.
    found : (FOUND,)
        Written: largest condition number that was met less ``stop``, 0 where it is proven that it
        stays below, else infinity, and the point [d; r]; the excess is infinite where det(J) has
        changed its sign.
    count : (1,)
        Written: the number of cells.

    """
    _prepare(constants, axes, row, pivot, legs)
    weights = rows[6]
    for k in range(CELL):
        cells[0, k] = 0.0
        cells[1, k] = box[k] if k < 12 else 0.0
    _, _, side, _ = _condition(constants, legs, cells[0], stop, rows, weights)
    for k in range(CELL):
        cells[0, k] = cells[1, k]
    found[EXCESS], found[UPPER], top = -math.inf, 0.0, 1
    for n in range(6):
        found[POINT.start + n] = box[n]
    count[0] = 0
    while top > 0:
        if count[0] >= most or top + 2 >= DEPTH:
            found[UPPER] = math.inf
            break
        top -= 1
        cell = cells[top]
        count[0] += 1
        margin, condition, sign, bound = _condition(constants, legs, cell, stop, rows, weights)
        changed = not sign * side > 0.0
        excess = math.inf if changed else condition - stop
        if excess > found[EXCESS]:
            found[EXCESS] = excess
            for n in range(6):
                found[POINT.start + n] = cell[n]
        if changed or margin <= 0.0:
            found[UPPER] = math.inf
            break
        if bound > 0.0:
            continue
        at = 0
        for n in range(1, 6):
            if weights[n] > weights[at]:
                at = n
        half = 0.5 * cell[_HALF + at]
        cell[_HALF + at] = half
        for n in range(CELL):
            cells[top + 1, n] = cell[n]
        cell[at] -= half
        cells[top + 1, at] += half
        top += 2
