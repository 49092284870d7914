# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Proofs about lengths and joint angles over all poses of a box of ranges; compiled.

Branch and bound over the cells of ``box_cells``; where the bound of the second derivative proves
that the gradient has one sign, the cell shrinks to the side where the quantity is larger. At a
fixed rotation the longest leg and the largest joint angle (up to 90 degrees) of a box of
translations are at its corners, and the shortest leg at the point nearest to the base joint: these
limits are searched over three dimensions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.box_cells import (
    ARM, BASE_AXIS, BOUND, CENTER, DEPTH, EXCESS, gradient_of, HALF, halve, place_of,
    PLATFORM_AXIS, prepare_legs, put_box, put_point, SHIFT, TURN, turned, UPPER)
from stewart_dynamics.capability.singular_values import BEND, put6
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.vectors import (
    add, dot, norm, put3, read3, scale, subtract, Vector3)

LENGTH_MIN, LENGTH_MAX, BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX = range(4)
# The largest excess is found to this part of a limit (of a radian); whether it is above zero to
# the tolerance of limits.
_EXACT = 1e-7


class _Bounded(NamedTuple):
    """By how much a limit is exceeded in a cell."""

    excess: float  # in its middle
    bound: float  # everywhere in it
    by_shift: Vector3
    by_turn: Vector3  # the gradient
    shift_change: float
    turn_change: float  # bounds of the change of each number of the gradient over the cell


_NOWHERE = (0.0, 0.0, 0.0)


@inlined
def _reach(by_shift: Vector3, by_turn: Vector3, cell: Array) -> float:
    """Return the largest change of a linear function of this gradient over a cell."""
    reach: float = (
        abs(by_shift[0]) * cell[HALF] + abs(by_shift[1]) * cell[HALF + 1]
        + abs(by_shift[2]) * cell[HALF + 2] + abs(by_turn[0]) * cell[HALF + 3]
        + abs(by_turn[1]) * cell[HALF + 4] + abs(by_turn[2]) * cell[HALF + 5])
    return reach


@compiled
def _longest(leg: Array, limit: float, cell: Array) -> _Bounded:
    """Return how much longer than a limit a leg is; the cell has one translation."""
    place, a = place_of(cell), read3(leg, ARM)
    p, arm = add(read3(leg, CENTER), place.shift), turned(place, a)
    length = norm(add(p, arm))
    by_turn = gradient_of(place, arm, p)
    change = norm(p) * norm(a) * place.half_turn
    square = length * length + 2.0 * _reach(_NOWHERE, by_turn, cell) + change * place.half_turn
    return _Bounded(length - limit, math.sqrt(square) - limit, _NOWHERE, by_turn, 0.0, change)


@inlined
def _beyond(value: float, half: float) -> float:
    """Return how far a value is outside [-half, half]."""
    return max(value - half, 0.0) + min(value + half, 0.0)


@compiled
def _shortest(leg: Array, limit: float, cell: Array, nearest_shift: Array) -> _Bounded:
    """Return how much shorter than a limit a leg is; writes the nearest translation."""
    place, a = place_of(cell), read3(leg, ARM)
    half, reach = place.half_turn, norm(a)
    arm = turned(place, a)
    v = add(add(read3(leg, CENTER), place.shift), arm)
    out = (_beyond(v[0], cell[HALF]), _beyond(v[1], cell[HALF + 1]), _beyond(v[2], cell[HALF + 2]))
    put3(nearest_shift, 0, add(place.shift, subtract(out, v)))
    distance = norm(out)
    nearest = distance - reach * half
    if nearest <= 0.0:
        # the gradient's change is not bounded where the distance may be zero
        return _Bounded(limit - distance, limit, _NOWHERE, _NOWHERE, 0.0, reach)
    by_turn = gradient_of(place, arm, scale(-1.0 / distance, out))
    lowest = distance - _reach(_NOWHERE, by_turn, cell) - 0.5 * reach * half * half
    return _Bounded(limit - distance, limit - lowest, _NOWHERE, by_turn, 0.0,
                    reach * half * (1.0 + reach / nearest))


@compiled
def _angle(leg: Array, at_platform: bool, limit: float, cell: Array) -> _Bounded:
    """Return by how much a joint's angle exceeds its limit."""
    place, a = place_of(cell), read3(leg, ARM)
    half, reach = place.half_turn, norm(a)
    arm = turned(place, a)
    line = add(add(read3(leg, CENTER), place.shift), arm)
    axis = turned(place, read3(leg, PLATFORM_AXIS)) if at_platform else read3(leg, BASE_AXIS)
    length = norm(line)
    s = scale(1.0 / length, line)
    cosine = dot(s, axis)
    by_shift = scale(1.0 / length, subtract(scale(cosine, s), axis))
    by_turn = gradient_of(place, arm, by_shift)
    if at_platform:
        by_turn = subtract(by_turn, gradient_of(place, axis, s))
    excess = math.acos(min(max(cosine, -1.0), 1.0)) - limit
    moved = place.half_shift + reach * half
    shortest = length - moved
    if shortest <= 0.0:
        return _Bounded(excess, math.pi - limit, _NOWHERE, _NOWHERE, 1.0, reach)
    inverse = 1.0 / shortest
    swing = moved * inverse
    shift_change = BEND * swing * inverse
    turn_change = reach * (half * inverse + BEND * swing * inverse)
    if at_platform:
        shift_change += half * inverse
        turn_change += swing + reach * half * inverse + half
    bend = shift_change * place.half_shift + turn_change * half
    lowest = cosine - _reach(by_shift, by_turn, cell) - 0.5 * bend
    return _Bounded(excess, math.acos(min(max(lowest, -1.0), 1.0)) - limit, by_shift, by_turn,
                    shift_change, turn_change)


@compiled
def _enough(best: float, size: float) -> float:
    """Return the excess that cells need not exceed: nothing depends on more digits."""
    if -_EXACT * size <= best <= 0.5 * TOLERANCE * size:
        return 0.5 * TOLERANCE * size
    return best + _EXACT * size


@compiled
def _search(leg: Array, code: int, limit: float, cells: Array, waiting: int, most: int,
            found: Array) -> None:
    """Write the largest excess of a limit over the cells that wait."""
    size = limit if code <= LENGTH_MAX else 1.0
    gradient, point = cells[DEPTH], cells[DEPTH + 1]
    best, upper, count, top = -math.inf, -math.inf, 0, waiting
    while top > 0:
        top -= 1
        cell = cells[top]
        if cell[BOUND] <= _enough(best, size) or count >= most or top + 2 >= DEPTH:
            upper = max(upper, cell[BOUND])
            continue
        count += 1
        put6(point, SHIFT, read3(cell, SHIFT), read3(cell, TURN))
        if code == LENGTH_MAX:
            here = _longest(leg, limit, cell)
        elif code == LENGTH_MIN:
            here = _shortest(leg, limit, cell, point)
        else:
            here = _angle(leg, code == PLATFORM_ANGLE_MAX, limit, cell)
        if here.excess > best:
            best = here.excess
            put_point(found, point)
        bound = min(here.bound, cell[BOUND])
        if bound <= _enough(best, size):
            upper = max(upper, bound)
            continue
        cell[BOUND] = bound
        put6(gradient, 0, here.by_shift, here.by_turn)
        shrunk, widest, at = False, -1.0, 0
        # The shortest leg has its translation in closed form.
        for n in range(TURN if code == LENGTH_MIN else SHIFT, 6):
            half, slope = cell[HALF + n], gradient[n]
            change = here.shift_change if n < TURN else here.turn_change
            if half > 0.0 and abs(slope) > change:
                cell[n] += math.copysign(half, slope)
                cell[HALF + n] = 0.0
                shrunk = True
            elif half * (abs(slope) + change) > widest:
                widest, at = half * (abs(slope) + change), n
        if shrunk:
            top += 1
        else:
            halve(cells, top, at, gradient[at])  # the half where the quantity rises comes first
            top += 2
    found[EXCESS], found[UPPER] = best, max(best, upper)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[::1]', 'i8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def legs_in_box(constants: Array, axes: Array, bounds: Array, row: Array, pivot: Array,
                box: Array, most: int, legs: Array, cells: Array, found: Array) -> None:
    """
    Write the largest excess of each limit of lengths and joint angles over a box.

    constants, axes, bounds (CONSTANTS,), (12, 3), (5, 6): as in ``travel.travels``; the clearance
        is that of ``clearance_in_box``.
    row (MOTION,): pose from which the box is measured.
    pivot (3,): center of rotation, platform frame [m].
    box (12,): middle and half widths of translation [m] and rotation vector [rad].
    most: largest number of cells for each limit of each leg.
    legs, cells (6, LEG), (DEPTH + 2, CELL): scratch memory.
    found (24, FOUND): written: for each code and leg the largest excess found [m, rad], a bound of
        the excess, and the point [d; r]; minus infinity where there is no limit.
    """
    prepare_legs(constants, axes, row, pivot, legs)
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
                put_box(cell, box)
                new = True
                if corners:
                    for k in range(TURN):
                        upward = corner >> k & 1 == 1
                        new = new and (upward or box[HALF + k] > 0.0)
                        cell[k] += box[HALF + k] if upward else -box[HALF + k]
                        cell[HALF + k] = 0.0
                if new:
                    waiting += 1
            _search(legs[n], code, limit, cells, waiting, most, answer)
