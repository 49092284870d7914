# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Proof about the condition number of J_inv over all poses of a box of ranges; compiled.

Branch and bound over the cells of ``box_cells``: with the scaled J_inv
``J = J_c (1 + sum_k h_k M_k) + R`` over a cell, its smallest singular value is at least
``smallest_c (1 - |sum_k h_k |M_k||) - |R|`` (Golub and Van Loan, Matrix Computations, 4th ed.,
8.6.2).
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.box_cells import (
    ARM, CELL, CENTER, DEPTH, EXCESS, HALF, halve, LEVER, place_of, prepare_legs,
    put_box, put_point, spin_of, TURN, turned, unit_of, UPPER)
from stewart_dynamics.capability.singular_values import (
    BEND, COLUMNS, INVERSE, put6, ROW, smallest_and_largest)
from stewart_dynamics.compilation.functions import compiled, entry_point
from stewart_dynamics.mechanics.dynamics.hexapod_constants import characteristic_length_of
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, read3, scale, subtract)

# Columns of the scratch memory behind those of ``singular_values``: the derivatives of a row by
# the six coordinates, and a row of sum_k h_k |M_k|.
_ROW_RATES, _CHANGE = COLUMNS, COLUMNS + 36
WORK = COLUMNS + 42  # columns of the scratch memory


@compiled
def _condition(constants: Array, legs: Array, cell: Array, stop: float, work: Array,
               weights: Array) -> tuple[float, float, float, float]:
    """
    Return margin and condition number in the middle of a cell, det(J), and a bound of the margin.

    The margin is ``smallest - largest / stop`` of the singular values of the scaled J_inv. Writes
    by how much each coordinate changes the matrix over the cell.
    """
    inverse_size = 1.0 / characteristic_length_of(constants)
    place = place_of(cell)
    half_d, half_r = place.half_shift, place.half_turn
    bending = moving = 0.0
    near = True
    for n in range(6):
        leg, row = legs[n], work[n]
        joint = turned(place, read3(leg, ARM))
        line = add(add(read3(leg, CENTER), place.shift), joint)
        length = norm(line)
        inverse = 1.0 / length
        s = scale(inverse, line)
        arm = scale(inverse_size, turned(place, read3(leg, LEVER)))
        put6(row, ROW, s, cross(arm, s))
        for axis in range(3):
            unit, spin = unit_of(axis), spin_of(place, axis)
            change = scale(inverse, subtract(unit, scale(dot(s, unit), s)))
            put6(row, _ROW_RATES + 6 * axis, change, cross(arm, change))
            swept = cross(spin, joint)
            change = scale(inverse, subtract(swept, scale(dot(s, swept), s)))
            put6(row, _ROW_RATES + 6 * (TURN + axis), change,
                 add(cross(cross(spin, arm), s), cross(arm, change)))
        reach = norm(read3(leg, ARM))
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
    smallest, largest, determinant = smallest_and_largest(work)
    margin = smallest - largest / stop
    for n in range(6):
        for j in range(6):
            work[n, _CHANGE + j] = 0.0
    for coordinate in range(6):
        half = cell[HALF + coordinate]
        weights[coordinate] = 0.0
        if half == 0.0:
            continue
        for n in range(6):
            for j in range(6):
                product = 0.0
                for m in range(6):
                    product += work[n, INVERSE + m] * work[m, _ROW_RATES + 6 * coordinate + j]
                work[n, _CHANGE + j] += half * abs(product)
                weights[coordinate] += half * half * product * product
    tallest = widest = 0.0
    for n in range(6):
        along = across = 0.0
        for j in range(6):
            along += work[n, _CHANGE + j]
            across += work[j, _CHANGE + n]
        widest, tallest = max(widest, along), max(tallest, across)
    moving = math.sqrt(moving)
    lowest = max(smallest * (1.0 - math.sqrt(widest * tallest)) - 0.5 * math.sqrt(bending),
                 smallest - moving)
    bound = lowest - (largest + moving) / stop if near else -math.inf
    return margin, largest / smallest, determinant, bound


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[::1]', 'f8', 'i8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'i8[::1]')
def condition_in_box(constants: Array, axes: Array, row: Array, pivot: Array, box: Array,
                     stop: float, most: int, legs: Array, cells: Array, work: Array,
                     found: Array, count: Integers) -> None:
    """
    Prove that the condition number stays below ``stop`` over a box, and det(J) its sign.

    constants, axes, row, pivot, box, most, legs, cells: as in ``box_legs.legs_in_box``; det(J)
        must have the sign that it has at the pose.
    stop: condition number that must not be reached.
    work (7, WORK): scratch memory.
    found (FOUND,): written: largest condition number that was met less ``stop``, 0 where it is
        proven that it stays below, else infinity, and the point [d; r]; the excess is infinite
        where det(J) has changed its sign.
    count (1,): written: the number of cells.
    """
    prepare_legs(constants, axes, row, pivot, legs)
    weights = work[6]
    for k in range(CELL):
        cells[0, k] = 0.0
    _, _, side, _ = _condition(constants, legs, cells[0], stop, work, weights)
    put_box(cells[0], box)
    found[EXCESS], found[UPPER], top = -math.inf, 0.0, 1
    put_point(found, box)
    count[0] = 0
    while top > 0:
        if count[0] >= most or top + 2 >= DEPTH:
            found[UPPER] = math.inf
            break
        top -= 1
        cell = cells[top]
        count[0] += 1
        margin, condition, sign, bound = _condition(constants, legs, cell, stop, work, weights)
        changed = not sign * side > 0.0
        excess = math.inf if changed else condition - stop
        if excess > found[EXCESS]:
            found[EXCESS] = excess
            put_point(found, cell)
        if changed or margin <= 0.0:
            found[UPPER] = math.inf
            break
        if bound > 0.0:
            continue
        at = 0
        for n in range(1, 6):
            if weights[n] > weights[at]:
                at = n
        halve(cells, top, at, 1.0)
        top += 2
