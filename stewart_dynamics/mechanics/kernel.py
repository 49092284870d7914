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
The inverse dynamics: leg lengths, rates and forces, and how near a singularity, of many samples.

Compiled by numba where it is installed; written once, for one sample and for millions, and each
sample's bits are the same in either case. The equations are those of ``lagrange``, evaluated as
vectors of three and never as 6x6 matrices. Numbers in brackets are the paper's equations:

1. ``leg_line`` and ``leg_dynamics``: the leg's length, rate and rows of J_inv (1)-(3), and the
   force ``F_i = M_i x_i'' + C_i x_i' + G_i`` that it takes to move the leg at its platform joint
   (section 5).
2. ``platform_dynamics``: the wrench that moves the platform (5), (6).
3. ``_dynamics``: six forces along the legs carry the sum, ``J_inv^T f = wrench``; with the
   inverse of J_inv come det(J), its rate, and the forces under a unit load.
4. ``_tile_eigenvalues``: the condition number, from the largest eigenvalues of J J^T and of its
   inverse.

``solve`` takes ``LANES`` samples through these steps side by side, so that one vector instruction
computes several; hence tuples instead of arrays, no branches, and every function inlined.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.friction import with_friction
from stewart_dynamics.mechanics.hexapod_constants import (
    characteristic_length_of, gravity_of, joints_of, Leg, leg_of, platform_of)
from stewart_dynamics.mechanics.jit import compiled, entry_point, inlined
from stewart_dynamics.mechanics.matrix6 import (
    gram, inverse_and_determinant, laguerre_step, Rows, Tridiagonal, tridiagonal)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES,
    LENGTHS, LINEAR_ACCELERATION, LINEAR_VELOCITY, MOTION, POSITION, RATES, RESULT, ROTATION,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, dot6, Matrix3, rotate, rotate_back, scale, subtract, symmetric, Vector3,
    Vector6)

# Samples go through the arithmetic in tiles, number by number: entry n of lane k stands at
# n * LANES + k. That is what lets the compiler put neighbouring samples into one register.
LANES = 32
_WRENCH = MOTION * LANES
_RESULT = _WRENCH + WRENCH * LANES
_EIGENVALUE = _RESULT + RESULT * LANES  # of two matrices: J J^T and its inverse
_TRIDIAGONAL = _EIGENVALUE + 2 * LANES
_TILE = _TRIDIAGONAL + 22 * LANES
# Laguerre's iteration takes 4 to 7 steps, with a fourfold eigenvalue up to 42.
_MOST_STEPS = 64


class LegDynamics(NamedTuple):
    """What one leg does in a motion."""

    length: float
    """[m]"""
    rate: float
    """[m/s]"""
    force: Vector3
    """That moves the leg, on its platform joint [N], base axes."""
    moment: Vector3
    """Of that force about the platform's origin [N m]."""
    actuator: float
    """Force [N] that moves the actuator itself: its reflected mass and its friction."""
    row: Vector6
    """The leg's row of J_inv, its right half divided by the characteristic length."""
    row_rate: Vector6
    """Time derivative of that row."""
    arm: Vector3
    """a = R p: the platform joint from the platform's origin, base axes [m]."""
    inertia: float
    """What resists motion across the leg, I_e / L^2 + m_ce [kg]."""


@inlined
def leg_line(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3,
) -> tuple[Vector3, float, float, Vector3]:
    """Return a leg's a = R p, length L, 1 / L (0 where L is 0) and direction s: (1), (2)."""
    base_joint, platform_joint = joints_of(constants, leg)
    a = rotate(rotation, platform_joint)
    leg_vector = subtract(add(position, a), base_joint)
    length = math.sqrt(dot(leg_vector, leg_vector))
    inverse_length = 1.0 / length if length > 0.0 else 0.0
    return a, length, inverse_length, scale(inverse_length, leg_vector)


@inlined
def _leg_inertia(leg: Leg, length: float, inverse_length: float) -> tuple[float, float]:
    """Return m2 c2 with c2 = L - S2 [kg m], and what resists motion across a leg [kg]."""
    piston_distance = length - leg.piston_center
    piston_moment = leg.piston_mass * piston_distance
    return piston_moment, ((leg.joint_inertia + piston_moment * piston_distance)
                           * inverse_length * inverse_length)


@inlined
def leg_dynamics(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3, velocity: Vector3,
        omega: Vector3, acceleration: Vector3, alpha: Vector3,
) -> LegDynamics:
    """Return what a leg does in a motion of the platform; equation numbers are the paper's."""
    gravity = gravity_of(constants)
    inverse_size = 1.0 / characteristic_length_of(constants)
    own = leg_of(constants, leg)
    a, length, inverse_length, s = leg_line(constants, leg, position, rotation)

    # the platform joint's velocity and acceleration (x_i', x_i''), along and across the leg
    a_rate = cross(omega, a)
    x_rate = add(velocity, a_rate)
    rate = dot(s, x_rate)
    across = subtract(x_rate, scale(rate, s))
    across_squared = dot(across, across)
    x_acc = add(add(acceleration, cross(alpha, a)), cross(omega, a_rate))
    along_acc = dot(s, x_acc)
    across_acc = subtract(x_acc, scale(along_acc, s))
    along_gravity = dot(s, gravity)
    across_gravity = subtract(gravity, scale(along_gravity, s))

    # M_i, C_i, G_i as in ``lagrange``; skew(s)^2 y is -(y across the leg)
    piston_moment, inertia = _leg_inertia(own, length, inverse_length)
    gravity_mass = (own.cylinder_moment + piston_moment) * inverse_length
    coriolis_mass = piston_moment * inverse_length - inertia
    force = add(
        add(subtract(scale(inertia, across_acc), scale(gravity_mass, across_gravity)),
            scale(2.0 * coriolis_mass * rate * inverse_length, across)),
        scale(own.piston_mass * (along_acc - along_gravity + own.piston_center * inverse_length
                                 * inverse_length * across_squared), s))

    length_acc = along_acc + across_squared * inverse_length
    actuator = with_friction(own.reflected_mass * length_acc, rate, own.viscous_friction,
                             own.coulomb_friction)

    # (3): the row of J_inv and its rate
    s_rate = scale(inverse_length, across)
    moment = scale(inverse_size, cross(a, s))
    moment_rate = scale(inverse_size, add(cross(a_rate, s), cross(a, s_rate)))
    return LegDynamics(
        length, rate, force, cross(a, force), actuator,
        (s[0], s[1], s[2], moment[0], moment[1], moment[2]),
        (s_rate[0], s_rate[1], s_rate[2], moment_rate[0], moment_rate[1], moment_rate[2]),
        a, inertia)


@inlined
def platform_dynamics(
        constants: Array, rotation: Matrix3, omega: Vector3, acceleration: Vector3,
        alpha: Vector3,
) -> tuple[Vector3, Vector3]:
    """Return force and moment at the platform's origin that move the platform: (5), (6)."""
    mass, center, inertia = platform_of(constants)
    com = rotate(rotation, center)
    force = scale(mass, subtract(
        add(add(acceleration, cross(alpha, com)), cross(omega, cross(omega, com))),
        gravity_of(constants)))
    omega_p = rotate_back(rotation, omega)
    alpha_p = rotate_back(rotation, alpha)
    moment_p = add(symmetric(inertia, alpha_p), cross(omega_p, symmetric(inertia, omega_p)))
    return force, add(rotate(rotation, moment_p), cross(com, force))


@inlined
def _put6(
        tile: Array, at: int, a: float, b: float, c: float, d: float, e: float, f: float,
) -> None:
    tile[at] = a
    tile[at + LANES] = b
    tile[at + 2 * LANES] = c
    tile[at + 3 * LANES] = d
    tile[at + 4 * LANES] = e
    tile[at + 5 * LANES] = f


@inlined
def _vector3(tile: Array, at: int) -> Vector3:
    return tile[at], tile[at + LANES], tile[at + 2 * LANES]


@inlined
def _matrix3(tile: Array, at: int) -> Matrix3:
    return (tile[at], tile[at + LANES], tile[at + 2 * LANES], tile[at + 3 * LANES],
            tile[at + 4 * LANES], tile[at + 5 * LANES], tile[at + 6 * LANES],
            tile[at + 7 * LANES], tile[at + 8 * LANES])


@inlined
def _put_scaled(tile: Array, at: int, t: Tridiagonal, trace: float) -> None:
    """Store the tridiagonal matrix with its eigenvalues brought between zero and one."""
    k = 1.0 / trace if trace > 0.0 else 0.0
    _put6(tile, at, k * t[0], k * t[1], k * t[2], k * t[3], k * t[4], k * t[5])
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
    """Store the forces under a unit load, and what the condition number is made of."""
    at = k + _RESULT
    g, h = gram(*rows), gram(*inverse)
    g_trace = g[0][0] + g[1][0] + g[2][0] + g[3][0] + g[4][0] + g[5][0]
    h_trace = h[0][0] + h[1][0] + h[2][0] + h[3][0] + h[4][0] + h[5][0]
    _put6(tile, at + UNIT_LOAD_FORCES.start * LANES, math.sqrt(h[0][0]), math.sqrt(h[1][0]),
          math.sqrt(h[2][0]), math.sqrt(h[3][0]), math.sqrt(h[4][0]), math.sqrt(h[5][0]))
    tile[at + CONDITION * LANES] = math.sqrt(g_trace) * math.sqrt(h_trace)
    _put_scaled(tile, k + _TRIDIAGONAL, tridiagonal(g), g_trace)
    _put_scaled(tile, k + _TRIDIAGONAL + 11 * LANES, tridiagonal(h), h_trace)
    # The trace is no less than the largest eigenvalue, but for rounding.
    tile[k + _EIGENVALUE] = 1.0 + 1e-14
    tile[k + _EIGENVALUE + LANES] = 1.0 + 1e-14


@inlined
def _dynamics(constants: Array, tile: Array, k: int) -> None:
    """Compute the sample in lane k, except for the last steps to its condition number."""
    size = characteristic_length_of(constants)
    inverse_size = 1.0 / size
    position = _vector3(tile, k + POSITION.start * LANES)
    rotation = _matrix3(tile, k + ROTATION.start * LANES)
    velocity = _vector3(tile, k + LINEAR_VELOCITY.start * LANES)
    omega = _vector3(tile, k + ANGULAR_VELOCITY.start * LANES)
    acceleration = _vector3(tile, k + LINEAR_ACCELERATION.start * LANES)
    alpha = _vector3(tile, k + ANGULAR_ACCELERATION.start * LANES)

    force, moment = platform_dynamics(constants, rotation, omega, acceleration, alpha)
    force = subtract(force, _vector3(tile, k + _WRENCH))
    moment = subtract(moment, _vector3(tile, k + _WRENCH + 3 * LANES))
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
    wrench = force[0], force[1], force[2], moment[0], moment[1], moment[2]

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
    _put6(tile, at + LENGTHS.start * LANES, l0.length, l1.length, l2.length, l3.length,
          l4.length, l5.length)
    _put6(tile, at + RATES.start * LANES, l0.rate, l1.rate, l2.rate, l3.rate, l4.rate, l5.rate)
    _put6(tile, at + FORCES.start * LANES, dot6(b0, wrench) + l0.actuator,
          dot6(b1, wrench) + l1.actuator, dot6(b2, wrench) + l2.actuator,
          dot6(b3, wrench) + l3.actuator, dot6(b4, wrench) + l4.actuator,
          dot6(b5, wrench) + l5.actuator)
    tile[at + DETERMINANT * LANES] = det
    tile[at + DETERMINANT_RATE * LANES] = det * (
        dot6(b0, l0.row_rate) + dot6(b1, l1.row_rate) + dot6(b2, l2.row_rate)
        + dot6(b3, l3.row_rate) + dot6(b4, l4.row_rate) + dot6(b5, l5.row_rate))
    _put_unit_load_forces(tile, k, (r0, r1, r2, r3, r4, r5), (b0, b1, b2, b3, b4, b5))


@compiled
def _tile_dynamics(constants: Array, tile: Array, lanes: int) -> None:
    for k in range(min(lanes, LANES)):
        _dynamics(constants, tile, k)


@compiled
def _tile_eigenvalues(tile: Array, lanes: int) -> None:
    """Take the two largest eigenvalues of every lane to where no step changes any of them."""
    for _ in range(_MOST_STEPS):
        changed = 0
        for k in range(min(lanes, LANES)):
            at = k + _EIGENVALUE
            x, y = tile[at], tile[at + LANES]
            nearer_x = laguerre_step(x, _tridiagonal(tile, k + _TRIDIAGONAL))
            nearer_y = laguerre_step(y, _tridiagonal(tile, k + _TRIDIAGONAL + 11 * LANES))
            changed += 1 if nearer_x < x or nearer_y < y else 0
            tile[at] = nearer_x
            tile[at + LANES] = nearer_y
        if changed == 0:
            break
    for k in range(min(lanes, LANES)):
        at = k + _EIGENVALUE
        tile[k + _RESULT + CONDITION * LANES] *= math.sqrt(tile[at]) * math.sqrt(tile[at + LANES])


@entry_point
def solve(constants: Array, motions: Array, wrenches: Array, results: Array) -> None:
    """
    Compute the result of every motion.

    Parameters
    ----------
    constants : (CONSTANTS,)
        Of the hexapod, see ``hexapod_constants``.
    motions : (N, MOTION)
        Rows of position, rotation, twist and acceleration, SI units, base axes.
    wrenches : (N, WRENCH) or (1, WRENCH)
        Force [N] and moment [N m] on the platform at its origin, base axes; one row for all.
    results : (N, RESULT)
        Written: lengths [m], rates [m/s], forces [N], forces under a unit load, det(J) [m^3],
        d(det)/dt [m^3/s] and the condition number.

    """
    tile = np.empty(_TILE)
    many = len(motions)
    one_wrench = len(wrenches) == 1
    for first in range(0, many, LANES):
        lanes = min(LANES, many - first)
        for k in range(lanes):
            for n in range(MOTION):
                tile[n * LANES + k] = motions[first + k, n]
            row = 0 if one_wrench else first + k
            for n in range(WRENCH):
                tile[_WRENCH + n * LANES + k] = wrenches[row, n]
        _tile_dynamics(constants, tile, lanes)
        _tile_eigenvalues(tile, lanes)
        for k in range(lanes):
            for n in range(RESULT):
                results[first + k, n] = tile[_RESULT + n * LANES + k]
