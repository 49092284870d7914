# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The inverse dynamics of many samples: leg lengths, rates and forces, det(J), condition number.

Compiled by numba where it is installed; one implementation for one sample and for millions, and
each sample's bits are the same in either case. Numbers in brackets are the paper's equations:

1. ``bodies.leg_dynamics``: the leg's length, rate and row of J_inv (1)-(3), and the force
   ``F_i = M_i x_i'' + C_i x_i' + G_i`` that moves the leg at its platform joint (section 5).
2. ``bodies.platform_dynamics``: the wrench that moves the platform (5), (6).
3. ``base_load.base_load``: the load of a moving base, subtracted from the wrench beforehand.
4. ``_dynamics``: six forces along the legs balance the sum, ``J_inv^T f = wrench``; the inverse of
   J_inv gives det(J), its rate, and the forces under a unit load as well.
5. ``_put_forces_of_turning_screws``: where screws turn with their legs, these forces and those
   under a unit load are replaced by those of ``J_q^T f = wrench`` (``drives.screws``).
6. ``_tile_eigenvalues``: the condition number, from the largest eigenvalues of J J^T and of its
   inverse.

``solve`` computes a tile of ``LANES`` samples side by side in each of these steps, so that one
vector instruction computes several; hence tuples instead of arrays, no branches, and inlined
functions. In a tile entry n of lane k is at n * LANES + k.
``solve_one`` computes a single sample in the first lane.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.base_load import base_load, moves
from stewart_dynamics.mechanics.dynamics.bodies import (
    actuator_force, drive_motion, leg_dynamics, LegDynamics, platform_dynamics, scaled_drive_row)
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, gravity_of, leg_of, screws_turn)
from stewart_dynamics.mechanics.matrix6 import (
    gram, inverse_and_determinant, laguerre_step, Rows, Tridiagonal, tridiagonal)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, GRAVITY, LENGTHS,
    LINEAR_ACCELERATION, LINEAR_VELOCITY, MOTION, POSITION, RATES, RESULT, ROTATION,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.vectors import (
    add, dot6, Matrix3, scale, subtract, Vector3, Vector6)

LANES = 32


@inlined
def put6(
        tile: Array, at: int, a: float, b: float, c: float, d: float, e: float, f: float,
) -> None:
    """Write six numbers of a lane from a place on."""
    tile[at] = a
    tile[at + LANES] = b
    tile[at + 2 * LANES] = c
    tile[at + 3 * LANES] = d
    tile[at + 4 * LANES] = e
    tile[at + 5 * LANES] = f


@inlined
def vector3(tile: Array, at: int) -> Vector3:
    """Return three numbers of a lane from a place on."""
    return tile[at], tile[at + LANES], tile[at + 2 * LANES]


@inlined
def matrix3(tile: Array, at: int) -> Matrix3:
    """Return nine numbers of a lane from a place on."""
    return (tile[at], tile[at + LANES], tile[at + 2 * LANES], tile[at + 3 * LANES],
            tile[at + 4 * LANES], tile[at + 5 * LANES], tile[at + 6 * LANES],
            tile[at + 7 * LANES], tile[at + 8 * LANES])


# The tile: motion, wrench, base motion, result, and scratch memory of the condition number.
_WRENCH = MOTION * LANES
_BASE = _WRENCH + WRENCH * LANES
_RESULT = _BASE + BASE * LANES
_EIGENVALUE = _RESULT + RESULT * LANES  # of two matrices: J J^T and its inverse
_TRIDIAGONAL = _EIGENVALUE + 2 * LANES
TILE = _TRIDIAGONAL + 22 * LANES
# Laguerre's iteration takes 4 to 7 steps, with a fourfold eigenvalue up to 42.
_MOST_STEPS = 64


@inlined
def _put_scaled(tile: Array, at: int, t: Tridiagonal, trace: float) -> None:
    """Store the tridiagonal matrix with its eigenvalues brought between zero and one."""
    k = 1.0 / trace if trace > 0.0 else 0.0
    put6(tile, at, k * t[0], k * t[1], k * t[2], k * t[3], k * t[4], k * t[5])
    kk = k * k
    tile[at + 6 * LANES] = kk * t[6]
    tile[at + 7 * LANES] = kk * t[7]
    tile[at + 8 * LANES] = kk * t[8]
    tile[at + 9 * LANES] = kk * t[9]
    tile[at + 10 * LANES] = kk * t[10]


@inlined
def _tridiagonal(tile: Array, at: int) -> Tridiagonal:
    return (tile[at], tile[at + LANES], tile[at + 2 * LANES], tile[at + 3 * LANES],
            tile[at + 4 * LANES], tile[at + 5 * LANES], tile[at + 6 * LANES],
            tile[at + 7 * LANES], tile[at + 8 * LANES], tile[at + 9 * LANES],
            tile[at + 10 * LANES])


@inlined
def _put_unit_load_forces(tile: Array, k: int, rows: Rows, inverse: Rows) -> None:
    """Store the forces under a unit load, and the matrices that give the condition number."""
    at = k + _RESULT
    g, h = gram(*rows), gram(*inverse)
    g_trace = g[0][0] + g[1][0] + g[2][0] + g[3][0] + g[4][0] + g[5][0]
    h_trace = h[0][0] + h[1][0] + h[2][0] + h[3][0] + h[4][0] + h[5][0]
    put6(tile, at + UNIT_LOAD_FORCES.start * LANES, math.sqrt(h[0][0]), math.sqrt(h[1][0]),
         math.sqrt(h[2][0]), math.sqrt(h[3][0]), math.sqrt(h[4][0]), math.sqrt(h[5][0]))
    tile[at + CONDITION * LANES] = math.sqrt(g_trace) * math.sqrt(h_trace)
    _put_scaled(tile, k + _TRIDIAGONAL, tridiagonal(g), g_trace)
    _put_scaled(tile, k + _TRIDIAGONAL + 11 * LANES, tridiagonal(h), h_trace)
    # Scaled by its trace, no eigenvalue is larger than 1 but for rounding.
    tile[k + _EIGENVALUE] = 1.0 + 1e-14
    tile[k + _EIGENVALUE + LANES] = 1.0 + 1e-14


@inlined
def _subtract_base_load(constants: Array, tile: Array, k: int) -> None:
    """Subtract the load of the base in lane k from the wrench."""
    force, moment = base_load(
        constants, vector3(tile, k + POSITION.start * LANES),
        matrix3(tile, k + ROTATION.start * LANES),
        vector3(tile, k + LINEAR_VELOCITY.start * LANES),
        vector3(tile, k + ANGULAR_VELOCITY.start * LANES),
        vector3(tile, k + _BASE + GRAVITY.start * LANES),
        vector3(tile, k + _BASE + BASE_ACCELERATION.start * LANES),
        vector3(tile, k + _BASE + BASE_ANGULAR_VELOCITY.start * LANES),
        vector3(tile, k + _BASE + BASE_ANGULAR_ACCELERATION.start * LANES))
    for n in range(3):
        tile[k + _WRENCH + n * LANES] -= force[n]
        tile[k + _WRENCH + (3 + n) * LANES] -= moment[n]


@inlined
def _put_base(constants: Array, tile: Array, k: int, base: Array) -> None:
    """Store the base's motion; one of nan as one that adds zero."""
    if moves(base):
        for n in range(BASE):
            tile[k + _BASE + n * LANES] = base[n]
        return
    gravity = gravity_of(constants)
    for n in range(BASE):
        tile[k + _BASE + n * LANES] = gravity[n] if n < GRAVITY.stop else 0.0


@compiled
def _tile_base_loads(constants: Array, tile: Array, lanes: int) -> None:
    for k in range(min(lanes, LANES)):
        _subtract_base_load(constants, tile, k)


_SixLegs = tuple[LegDynamics, LegDynamics, LegDynamics, LegDynamics, LegDynamics, LegDynamics]


@inlined
def _moved(constants: Array, tile: Array, k: int) -> tuple[_SixLegs, Vector6]:
    """Return the legs in lane k, and the wrench that moves platform and legs, scaled."""
    inverse_size = 1.0 / characteristic_length_of(constants)
    position = vector3(tile, k + POSITION.start * LANES)
    rotation = matrix3(tile, k + ROTATION.start * LANES)
    velocity = vector3(tile, k + LINEAR_VELOCITY.start * LANES)
    omega = vector3(tile, k + ANGULAR_VELOCITY.start * LANES)
    acceleration = vector3(tile, k + LINEAR_ACCELERATION.start * LANES)
    alpha = vector3(tile, k + ANGULAR_ACCELERATION.start * LANES)

    force, moment = platform_dynamics(constants, rotation, omega, acceleration, alpha)
    force = subtract(force, vector3(tile, k + _WRENCH))
    moment = subtract(moment, vector3(tile, k + _WRENCH + 3 * LANES))
    l0 = leg_dynamics(constants, 0, position, rotation, velocity, omega, acceleration, alpha)
    l1 = leg_dynamics(constants, 1, position, rotation, velocity, omega, acceleration, alpha)
    l2 = leg_dynamics(constants, 2, position, rotation, velocity, omega, acceleration, alpha)
    l3 = leg_dynamics(constants, 3, position, rotation, velocity, omega, acceleration, alpha)
    l4 = leg_dynamics(constants, 4, position, rotation, velocity, omega, acceleration, alpha)
    l5 = leg_dynamics(constants, 5, position, rotation, velocity, omega, acceleration, alpha)
    force = add(add(add(add(add(add(force, l0.force), l1.force), l2.force), l3.force), l4.force),
                l5.force)
    moment = scale(inverse_size, add(add(add(add(add(add(
        moment, l0.moment), l1.moment), l2.moment), l3.moment), l4.moment), l5.moment))
    return (l0, l1, l2, l3, l4, l5), (
        force[0], force[1], force[2], moment[0], moment[1], moment[2])


@inlined
def _dynamics(constants: Array, tile: Array, k: int) -> None:
    """Compute the sample in lane k, except for the eigenvalues of its condition number."""
    size = characteristic_length_of(constants)
    (l0, l1, l2, l3, l4, l5), wrench = _moved(constants, tile, k)

    # With J the scaled J_inv, row n of (J^T)^-1 maps the wrench to the force of leg n, its
    # length is the largest force of that leg under a unit load, and
    # d(det)/dt = det tr(J^-1 J') is the sum of its products with the rows of J'.
    r0, r1, r2, r3, r4, r5 = l0.row, l1.row, l2.row, l3.row, l4.row, l5.row
    (b0, b1, b2, b3, b4, b5), det = inverse_and_determinant(
        (r0[0], r1[0], r2[0], r3[0], r4[0], r5[0]), (r0[1], r1[1], r2[1], r3[1], r4[1], r5[1]),
        (r0[2], r1[2], r2[2], r3[2], r4[2], r5[2]), (r0[3], r1[3], r2[3], r3[3], r4[3], r5[3]),
        (r0[4], r1[4], r2[4], r3[4], r4[4], r5[4]), (r0[5], r1[5], r2[5], r3[5], r4[5], r5[5]))
    det *= size * size * size
    at = k + _RESULT
    put6(tile, at + LENGTHS.start * LANES, l0.length, l1.length, l2.length, l3.length,
         l4.length, l5.length)
    put6(tile, at + RATES.start * LANES, l0.rate, l1.rate, l2.rate, l3.rate, l4.rate, l5.rate)
    put6(tile, at + FORCES.start * LANES, dot6(b0, wrench) + l0.actuator,
         dot6(b1, wrench) + l1.actuator, dot6(b2, wrench) + l2.actuator,
         dot6(b3, wrench) + l3.actuator, dot6(b4, wrench) + l4.actuator,
         dot6(b5, wrench) + l5.actuator)
    tile[at + DETERMINANT * LANES] = det
    tile[at + DETERMINANT_RATE * LANES] = det * (
        dot6(b0, l0.row_rate) + dot6(b1, l1.row_rate) + dot6(b2, l2.row_rate)
        + dot6(b3, l3.row_rate) + dot6(b4, l4.row_rate) + dot6(b5, l5.row_rate))
    _put_unit_load_forces(tile, k, (r0, r1, r2, r3, r4, r5), (b0, b1, b2, b3, b4, b5))


@inlined
def _drive_force(constants: Array, tile: Array, k: int, leg: int) -> float:
    """Return the force that moves the actuator of a leg in lane k [N]."""
    _, rate, acceleration = drive_motion(
        constants, leg, vector3(tile, k + POSITION.start * LANES),
        matrix3(tile, k + ROTATION.start * LANES),
        vector3(tile, k + LINEAR_VELOCITY.start * LANES),
        vector3(tile, k + ANGULAR_VELOCITY.start * LANES),
        vector3(tile, k + LINEAR_ACCELERATION.start * LANES),
        vector3(tile, k + ANGULAR_ACCELERATION.start * LANES))
    force: float = actuator_force(leg_of(constants, leg), rate, acceleration)
    return force


@compiled
def _put_forces_of_turning_screws(constants: Array, tile: Array, k: int) -> None:
    """Store the forces of drives whose screws turn with their legs, also under a unit load."""
    position = vector3(tile, k + POSITION.start * LANES)
    rotation = matrix3(tile, k + ROTATION.start * LANES)
    r0 = scaled_drive_row(constants, 0, position, rotation)
    r1 = scaled_drive_row(constants, 1, position, rotation)
    r2 = scaled_drive_row(constants, 2, position, rotation)
    r3 = scaled_drive_row(constants, 3, position, rotation)
    r4 = scaled_drive_row(constants, 4, position, rotation)
    r5 = scaled_drive_row(constants, 5, position, rotation)
    (b0, b1, b2, b3, b4, b5), _ = inverse_and_determinant(
        (r0[0], r1[0], r2[0], r3[0], r4[0], r5[0]), (r0[1], r1[1], r2[1], r3[1], r4[1], r5[1]),
        (r0[2], r1[2], r2[2], r3[2], r4[2], r5[2]), (r0[3], r1[3], r2[3], r3[3], r4[3], r5[3]),
        (r0[4], r1[4], r2[4], r3[4], r4[4], r5[4]), (r0[5], r1[5], r2[5], r3[5], r4[5], r5[5]))
    _, wrench = _moved(constants, tile, k)
    at = k + _RESULT
    put6(tile, at + FORCES.start * LANES, dot6(b0, wrench) + _drive_force(constants, tile, k, 0),
         dot6(b1, wrench) + _drive_force(constants, tile, k, 1),
         dot6(b2, wrench) + _drive_force(constants, tile, k, 2),
         dot6(b3, wrench) + _drive_force(constants, tile, k, 3),
         dot6(b4, wrench) + _drive_force(constants, tile, k, 4),
         dot6(b5, wrench) + _drive_force(constants, tile, k, 5))
    put6(tile, at + UNIT_LOAD_FORCES.start * LANES, math.sqrt(dot6(b0, b0)),
         math.sqrt(dot6(b1, b1)), math.sqrt(dot6(b2, b2)), math.sqrt(dot6(b3, b3)),
         math.sqrt(dot6(b4, b4)), math.sqrt(dot6(b5, b5)))


@compiled
def _tile_dynamics(constants: Array, tile: Array, lanes: int) -> None:
    for k in range(min(lanes, LANES)):
        _dynamics(constants, tile, k)
    if screws_turn(constants):
        for k in range(min(lanes, LANES)):
            _put_forces_of_turning_screws(constants, tile, k)


@inlined
def _nearer_eigenvalues(tile: Array, k: int) -> int:
    """Take one step to both largest eigenvalues of lane k; return whether it changed them."""
    at = k + _EIGENVALUE
    x, y = tile[at], tile[at + LANES]
    nearer_x = laguerre_step(x, _tridiagonal(tile, k + _TRIDIAGONAL))
    nearer_y = laguerre_step(y, _tridiagonal(tile, k + _TRIDIAGONAL + 11 * LANES))
    tile[at] = nearer_x
    tile[at + LANES] = nearer_y
    return 1 if nearer_x < x or nearer_y < y else 0


@inlined
def _put_condition(tile: Array, k: int) -> None:
    at = k + _EIGENVALUE
    tile[k + _RESULT + CONDITION * LANES] *= math.sqrt(tile[at]) * math.sqrt(tile[at + LANES])


@compiled
def _tile_eigenvalues(tile: Array, lanes: int) -> None:
    """Iterate on both largest eigenvalues of all lanes until no step changes any of them."""
    for _ in range(_MOST_STEPS):
        changed = 0
        for k in range(min(lanes, LANES)):
            changed += _nearer_eigenvalues(tile, k)
        if changed == 0:
            break
    for k in range(min(lanes, LANES)):
        _put_condition(tile, k)


@compiled
def solve_one(constants: Array, motion: Array, wrench: Array, base: Array, result: Array,
              tile: Array) -> None:
    """Compute the result of one motion; the arrays are a row each of those of ``solve``."""
    for n in range(MOTION):
        tile[n * LANES] = motion[n]
    for n in range(WRENCH):
        tile[_WRENCH + n * LANES] = wrench[n]
    if moves(base):
        for n in range(BASE):
            tile[_BASE + n * LANES] = base[n]
        _subtract_base_load(constants, tile, 0)
    _dynamics(constants, tile, 0)
    if screws_turn(constants):
        _put_forces_of_turning_screws(constants, tile, 0)
    for _ in range(_MOST_STEPS):
        if _nearer_eigenvalues(tile, 0) == 0:
            break
    _put_condition(tile, 0)
    for n in range(RESULT):
        result[n] = tile[_RESULT + n * LANES]


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'b1[::1]', 'f8[::1]')
def solve(constants: Array, motions: Array, wrenches: Array, bases: Array, results: Array,
          sound: Flags, tile: Array) -> None:
    """
    Compute the result of every motion.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``.
    motions (N, MOTION): rows of position, rotation, twist and acceleration, SI units, base axes.
    wrenches (N, WRENCH) or (1, WRENCH): force [N] and moment [N m] on the platform at its origin,
        base axes; one row for all.
    bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all. A row of nan adds no
        load.
    results (N, RESULT): written: lengths [m], rates [m/s], forces [N], forces under a unit load,
        det(J) [m^3], d(det)/dt [m^3/s] and the condition number.
    sound (N,) or (0,): written: whether all numbers are finite and J_inv can be solved. If it has
        no entries, the condition number, which takes half of the time, is not computed: its column
        is arbitrary.
    tile (TILE,): scratch memory.
    """
    many = len(motions)
    one_wrench, one_base, checked = len(wrenches) == 1, len(bases) == 1, len(sound) > 0
    for first in range(0, many, LANES):
        lanes = min(LANES, many - first)
        moving = False
        for k in range(lanes):
            for n in range(MOTION):
                tile[n * LANES + k] = motions[first + k, n]
            row = 0 if one_wrench else first + k
            for n in range(WRENCH):
                tile[_WRENCH + n * LANES + k] = wrenches[row, n]
            moving = moving or moves(bases[0 if one_base else first + k])
        if moving:
            for k in range(lanes):
                _put_base(constants, tile, k, bases[0 if one_base else first + k])
            _tile_base_loads(constants, tile, lanes)
        _tile_dynamics(constants, tile, lanes)
        if checked:
            _tile_eigenvalues(tile, lanes)
        for k in range(lanes):
            finite = True
            for n in range(RESULT):
                result = tile[_RESULT + n * LANES + k]
                results[first + k, n] = result
                finite = finite and math.isfinite(result)
            if checked:
                sound[first + k] = finite and results[first + k, CONDITION] < UNSOLVABLE_CONDITION
