# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Proof about the clearance of legs and plates over all poses of a box of ranges; compiled.

Branch and bound over the cells of ``box_cells``: the clearance of two legs, or of a leg and a
plate, over a cell is bounded along one vector for all of their corners (``clearance_bounds``), up
to terms of second order in the half widths.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.box_cells import (
    ARM as LEG_ARM, BOUND, CENTER, DEPTH, EXCESS, HALF, halve, Place, place_of, prepare_legs,
    put_box, put_point, spin_of, TURN, turned, unit_of, UPPER)
from stewart_dynamics.capability.clearance_bounds import (
    ARM, BASE_JOINT, between_corners, Bodies, bodies_in, Body, corners_of, CYLINDER, follow,
    FOLLOWING, is_given, OF_LEG, pair_of, pairs_with, PLACE, PLATES, PLATFORM_JOINT,
    put_plates, RATES, relative_rate, ROTATING, shortest, slope_along, STAYING, STILL, TURNING)
from stewart_dynamics.capability.singular_values import BEND
from stewart_dynamics.compilation.functions import compiled, entry_point
from stewart_dynamics.mechanics.dynamics.hexapod_constants import joints_of
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE
from stewart_dynamics.mechanics.limits import TOLERANCE
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, scale, subtract, Vector3)

PAIRS = tuple((i, j) for i in range(6) for j in range(i + 1, 8))
"""Legs and the other legs and plates, in the order of ``clearance_in_box``."""


@compiled
def _put_rates(bodies: Bodies, at: int, arm: Vector3) -> None:
    """Write the derivatives of a point of the platform that is ``arm`` from the pivot."""
    corner = bodies.corners[at]
    for axis in range(3):
        put3(corner, RATES + 3 * axis, unit_of(axis))
        put3(corner, RATES + 9 + 3 * axis, cross(read3(bodies.spins[TURN + axis], 0), arm))


@compiled
def _turning(place: Place, away: Vector3) -> float:
    """Return the bound TURNING of a point of the base that is ``away`` from the center."""
    return place.half_turn * (0.5 * place.half_turn * norm(away) + place.half_shift)


@compiled
def _put_leg(constants: Array, bodies: Bodies, legs: Array, place: Place, n: int) -> None:
    """Write the corners of a leg."""
    base_joint, _ = joints_of(constants, n)
    center = add(read3(legs[n], CENTER), place.shift)
    arm = turned(place, read3(legs[n], LEG_ARM))
    line = add(center, arm)
    length, cylinder, half = norm(line), bodies.shapes[n, 1], place.half_turn
    s = scale(1.0 / length if length > 0.0 else 0.0, line)
    reach = norm(arm)
    moved = place.half_shift + reach * half
    shortest_length = length - moved
    turning = _turning(place, center)
    swing = moved / shortest_length if shortest_length > 0.0 else math.inf
    bend = reach * half * half / shortest_length + BEND * swing * swing
    if not shortest_length > 0.0:
        bend = math.inf
    for part in range(OF_LEG):
        at = OF_LEG * n + part
        corner = bodies.corners[at]
        if part == BASE_JOINT:
            corner[:] = 0.0
            put3(corner, PLACE, base_joint)
            corner[TURNING] = turning
            continue
        _put_rates(bodies, at, arm)
        if part == PLATFORM_JOINT or (part == CYLINDER and length <= cylinder):
            put3(corner, PLACE, add(base_joint, line))
            corner[STILL], corner[TURNING] = 0.5 * reach * half * half, 0.0
            continue
        put3(corner, PLACE, add(base_joint, scale(cylinder, s)))
        for coordinate in range(6):
            change = read3(corner, RATES + 3 * coordinate)
            put3(corner, RATES + 3 * coordinate, scale(
                cylinder / length if length > 0.0 else 0.0,
                subtract(change, scale(dot(s, change), s))))
        corner[STILL] = 0.5 * cylinder * bend
        corner[TURNING] = turning + 0.5 * cylinder * (bend + half * (2.0 * swing + half))


@compiled
def _put_plate(constants: Array, bodies: Bodies, legs: Array, place: Place, plate: int) -> None:
    """Write the corners of a plate."""
    joint, _ = joints_of(constants, 0)
    center = add(joint, add(read3(legs[0], CENTER), place.shift))
    of_platform = PLATES + bodies.base_corners
    if plate == BASE:
        for n in range(PLATES, of_platform):
            corner = bodies.corners[n]
            corner[TURNING] = _turning(place, subtract(center, read3(corner, PLACE)))
        return
    for n in range(of_platform, len(bodies.corners)):
        corner = bodies.corners[n]
        arm = turned(place, read3(corner, ARM))
        put3(corner, PLACE, add(center, arm))
        _put_rates(bodies, n, arm)
        corner[STILL] = 0.5 * norm(read3(corner, ARM)) * place.half_turn * place.half_turn
        corner[TURNING] = 0.0


@compiled
def _lowest(bodies: Bodies, a: Body, b: Body, n: Vector3, cell: Array, how: int,
            ) -> tuple[float, int, int]:
    """Return the least distance of two bodies over a cell along n, and the corners of it."""
    follow(bodies, a, b, n, how)
    follows = bodies.n_rates
    x = y = z = 0.0
    for k in range(6):
        half = cell[HALF + k]
        x += half * abs(follows[k, 0])
        y += half * abs(follows[k, 1])
        z += half * abs(follows[k, 2])
    swept = math.sqrt(x * x + y * y + z * z) if how == FOLLOWING else 0.0
    longer = math.sqrt(1.0 + swept * swept)
    corners, rest = bodies.corners, TURNING if how == ROTATING else STILL
    lowest, worst, other_worst = math.inf, a[0], b[0]
    for p in corners_of(a):
        for q in corners_of(b):
            distance = dot(n, between_corners(corners, p, q))
            distance -= longer * (corners[p, rest] + corners[q, rest])
            x = y = z = 0.0
            for k in range(6):
                half = cell[HALF + k]
                moved = relative_rate(corners, p, q, k)
                distance -= half * abs(slope_along(bodies, p, q, n, k))
                x += half * abs(moved[0])
                y += half * abs(moved[1])
                z += half * abs(moved[2])
            distance -= swept * math.sqrt(x * x + y * y + z * z)
            if distance < lowest:
                lowest, worst, other_worst = distance, p, q
    return lowest / longer if lowest > 0.0 else lowest, worst, other_worst


@compiled
def _clearance(constants: Array, bodies: Bodies, legs: Array, i: int, j: int, cell: Array,
               limit: float, slopes: Array) -> tuple[float, float]:
    """
    Return the clearance of a leg and a leg or plate in the middle of a cell, and a bound of it.

    Writes the slopes (6,) of the distance of those corners that bound it, where the bound is below
    the limit.
    """
    place = place_of(cell)
    for axis in range(3):
        put3(bodies.spins[axis], 0, (0.0, 0.0, 0.0))
        put3(bodies.spins[TURN + axis], 0, spin_of(place, axis))
    _put_leg(constants, bodies, legs, place, i)
    if j < 6:
        _put_leg(constants, bodies, legs, place, j)
    else:
        _put_plate(constants, bodies, legs, place, j)
    clearance = bound = math.inf
    for pair in range(pairs_with(j)):
        a, b, radii = pair_of(bodies, i, j, pair)
        vector = shortest(bodies.corners, a, b)
        distance = norm(vector)
        clearance = min(clearance, distance - radii)
        if distance == 0.0:
            bound = -radii
            continue
        n = scale(1.0 / distance, vector)
        lowest, p, q = _lowest(bodies, a, b, n, cell, FOLLOWING)
        if lowest - radii < limit and lowest - radii < bound:
            for coordinate in range(6):
                slopes[coordinate] = slope_along(bodies, p, q, n, coordinate)
            for how in (STAYING, ROTATING):
                other_lowest, _, _ = _lowest(bodies, a, b, n, cell, how)
                lowest = max(lowest, other_lowest)
        bound = min(bound, max(lowest, 0.0) - radii)
    return clearance, bound


@compiled
def _search_pair(constants: Array, bodies: Bodies, legs: Array, i: int, j: int, limit: float,
                 cells: Array, most: int, coarse: float, found: Array) -> None:
    """Write the largest excess of the clearance of a pair over the cell that waits."""
    kept = 0.5 * TOLERANCE * limit
    best, upper, count, top = -math.inf, -math.inf, 0, 1
    slopes = cells[DEPTH]
    slopes[:] = 0.0
    arm = max(norm(read3(legs[i], LEG_ARM)), norm(read3(legs[j if j < 6 else i], LEG_ARM)))
    while top > 0:
        top -= 1
        cell = cells[top]
        enough = kept if best <= kept else best + coarse * abs(best)
        if cell[BOUND] <= enough or count >= most or top + 2 >= DEPTH:
            upper = max(upper, cell[BOUND])
            continue
        count += 1
        clearance, lowest = _clearance(
            constants, bodies, legs, i, j, cell, limit - enough, slopes)
        if limit - clearance > best:
            best = limit - clearance
            put_point(found, cell)
        cell[BOUND] = min(cell[BOUND], limit - lowest)
        widest, at = 0.0, 0
        for n in range(6):
            wide = cell[HALF + n] * (1.0 if n < TURN else arm)
            wide *= abs(slopes[n]) / (1.0 if n < TURN else arm) + 0.1
            if wide > widest:
                widest, at = wide, n
        if cell[BOUND] <= enough or widest <= 0.0:
            upper = max(upper, cell[BOUND])
            continue
        halve(cells, top, at, -slopes[at])  # the half where they are nearer comes first
        top += 2
    found[EXCESS], found[UPPER] = best, max(best, upper)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8', 'f8[::1]',
             'f8[::1]', 'f8[::1]', 'i8', 'f8', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def clearance_in_box(constants: Array, axes: Array, shapes: Array, base: Array, platform: Array,
                     limit: float, row: Array, pivot: Array, box: Array, most: int, coarse: float,
                     legs: Array, cells: Array, memory: Array, found: Array) -> None:
    """
    Prove that no leg is nearer than a limit to another one, or to a plate, over a box.

    constants, axes, row, pivot, box, legs, cells: as in ``box_legs.legs_in_box``.
    shapes, base, platform (6, 3), (M, 3), (M, 3): as in ``leg_clearance``.
    limit: smallest clearance [m].
    most: largest number of cells for each pair.
    coarse: the largest excess of a pair that does not keep the limit is found to this part;
        infinite: the search ends with the first pair that does not.
    memory (clearance_bounds.rows_of(plates, 6), CORNER): scratch memory.
    found (PAIRS, FOUND): written: for each pair the largest excess found, a bound of the excess
        [m], and the point [d; r]; minus infinity where there is no plate. A pair that keeps the
        limit everywhere is not searched further.
    """
    bodies = bodies_in(memory, 6, shapes, len(base))
    prepare_legs(constants, axes, row, pivot, legs)
    put_plates(bodies, base, platform, row, pivot)
    for pair in range(len(found)):
        found[pair, EXCESS] = found[pair, UPPER] = -math.inf
    pair = 0
    for i in range(6):
        for j in range(i + 1, 8):
            if is_given(bodies, j):
                put_box(cells[0], box)
                _search_pair(constants, bodies, legs, i, j, limit, cells, most, coarse,
                             found[pair])
                if coarse == math.inf and found[pair, EXCESS] > TOLERANCE * limit:
                    return
            pair += 1
