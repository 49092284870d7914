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
The runtime path: leg lengths, rates and forces, det(J) and its neighbourhood, of many samples.

Written once for one sample and for millions, compiled by numba where it is installed. The
equations are those of ``lagrange``, evaluated as vectors of three and never as 6x6 matrices:
leg i puts ``F_i = M_i x_i'' + C_i x_i' + G_i`` on its platform joint (the paper, section 5),
and six forces along the legs carry the sum: ``J_inv^T f = wrench``.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.jit import compiled, entry_point, inlined
from stewart_dynamics.mechanics.matrix6 import (
    gram, inverse_and_determinant, laguerre_step, Tridiagonal, tridiagonal)
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, MOTION, RATES, RESULT,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, dot6, Matrix3, rotate, rotate_back, scale, subtract, symmetric, Vector3,
    Vector6)

# The numbers of a machine, as ``solve`` takes them: the body's, then LEG for each leg.
#   gravity 3, characteristic length, platform mass, CoM 3, inertia 6 (xx xy xz yy yz zz)
#   base joint 3, platform joint 3, piston mass, piston CoM, cylinder mass * CoM,
#   inertia about the base joint (cylinder mass * CoM^2 + both inertias),
#   reflected mass, viscous friction, Coulomb friction
BODY = 14
LEG = 13
MACHINE = BODY + 6 * LEG

# Coulomb friction grows linearly up to this rate [m/s] and is constant beyond it.
COULOMB_RATE = 1e-3

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


@inlined
def leg_line(
        machine: Array, leg: int, position: Vector3, rotation: Matrix3,
) -> tuple[Vector3, float, float, Vector3]:
    """Return a leg's a = R p, its length, one by its length (0 where it has none), s: (1), (2)."""
    o = BODY + leg * LEG
    base_joint = machine[o], machine[o + 1], machine[o + 2]
    a = rotate(rotation, (machine[o + 3], machine[o + 4], machine[o + 5]))
    leg_vector = subtract(add(position, a), base_joint)
    length = math.sqrt(dot(leg_vector, leg_vector))
    inverse_length = 1.0 / length if length > 0.0 else 0.0
    return a, length, inverse_length, scale(inverse_length, leg_vector)


@inlined
def leg_inertia(
        machine: Array, leg: int, length: float, inverse_length: float) -> tuple[float, float]:
    """Return m2 c2, c2 = L - S2 [kg m], and what resists motion across a leg, I_e/L^2 + m_ce."""
    o = BODY + leg * LEG
    piston_mass, piston_com, joint_inertia = machine[o + 6], machine[o + 7], machine[o + 9]
    piston_distance = length - piston_com
    piston_moment = piston_mass * piston_distance
    return piston_moment, ((joint_inertia + piston_moment * piston_distance)
                           * inverse_length * inverse_length)


@inlined
def leg_dynamics(
        machine: Array, leg: int, position: Vector3, rotation: Matrix3, velocity: Vector3,
        omega: Vector3, acceleration: Vector3, alpha: Vector3, gravity: Vector3,
        inverse_size: float,
) -> tuple[float, float, Vector3, Vector3, float, Vector6, Vector6]:
    """
    Return one leg's length, rate, force and moment on the platform, actuator force, rows.

    The rows are the leg's row of J_inv with the right half divided by the characteristic
    length, and that row's time derivative. Equation numbers are the paper's.
    """
    o = BODY + leg * LEG
    piston_mass, piston_com, cylinder_moment = machine[o + 6], machine[o + 7], machine[o + 8]
    reflected_mass, viscous, coulomb = machine[o + 10], machine[o + 11], machine[o + 12]

    a, length, inverse_length, s = leg_line(machine, leg, position, rotation)

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

    # M_i, C_i, G_i as model.md has them, with c2 = L - S2; skew(s)^2 y is -(y across the leg)
    piston_moment, inertia = leg_inertia(machine, leg, length, inverse_length)
    gravity_mass = (cylinder_moment + piston_moment) * inverse_length
    coriolis_mass = piston_moment * inverse_length - inertia
    force = add(
        add(subtract(scale(inertia, across_acc), scale(gravity_mass, across_gravity)),
            scale(2.0 * coriolis_mass * rate * inverse_length, across)),
        scale(piston_mass * (along_acc - along_gravity + piston_com * inverse_length
                             * inverse_length * across_squared), s))

    length_acc = along_acc + across_squared * inverse_length
    slip = rate / COULOMB_RATE
    actuator = (reflected_mass * length_acc + viscous * rate
                + coulomb * (-1.0 if slip < -1.0 else 1.0 if slip > 1.0 else slip))

    # (3): the row of J_inv and its rate
    s_rate = scale(inverse_length, across)
    moment = scale(inverse_size, cross(a, s))
    moment_rate = scale(inverse_size, add(cross(a_rate, s), cross(a, s_rate)))
    return (length, rate, force, cross(a, force), actuator,
            (s[0], s[1], s[2], moment[0], moment[1], moment[2]),
            (s_rate[0], s_rate[1], s_rate[2], moment_rate[0], moment_rate[1], moment_rate[2]))


@inlined
def platform_dynamics(
        machine: Array, rotation: Matrix3, omega: Vector3, acceleration: Vector3,
        alpha: Vector3, gravity: Vector3,
) -> tuple[Vector3, Vector3]:
    """Return force and moment at the platform's origin that move the platform: (5), (6)."""
    mass = machine[4]
    inertia = (machine[8], machine[9], machine[10], machine[11], machine[12], machine[13])
    com = rotate(rotation, (machine[5], machine[6], machine[7]))
    force = scale(mass, subtract(
        add(add(acceleration, cross(alpha, com)), cross(omega, cross(omega, com))), gravity))
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
def _dynamics(machine: Array, tile: Array, k: int) -> None:
    """Compute the sample in lane k, but for the last steps to its condition number."""
    gravity = machine[0], machine[1], machine[2]
    size = machine[3]
    inverse_size = 1.0 / size
    position = _vector3(tile, k)
    rotation = (tile[k + 3 * LANES], tile[k + 4 * LANES], tile[k + 5 * LANES],
                tile[k + 6 * LANES], tile[k + 7 * LANES], tile[k + 8 * LANES],
                tile[k + 9 * LANES], tile[k + 10 * LANES], tile[k + 11 * LANES])
    velocity = _vector3(tile, k + 12 * LANES)
    omega = _vector3(tile, k + 15 * LANES)
    acceleration = _vector3(tile, k + 18 * LANES)
    alpha = _vector3(tile, k + 21 * LANES)

    force, moment = platform_dynamics(machine, rotation, omega, acceleration, alpha, gravity)
    force = subtract(force, _vector3(tile, k + _WRENCH))
    moment = subtract(moment, _vector3(tile, k + _WRENCH + 3 * LANES))
    l0, v0, f0, m0, a0, r0, d0 = leg_dynamics(
        machine, 0, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    l1, v1, f1, m1, a1, r1, d1 = leg_dynamics(
        machine, 1, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    l2, v2, f2, m2, a2, r2, d2 = leg_dynamics(
        machine, 2, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    l3, v3, f3, m3, a3, r3, d3 = leg_dynamics(
        machine, 3, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    l4, v4, f4, m4, a4, r4, d4 = leg_dynamics(
        machine, 4, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    l5, v5, f5, m5, a5, r5, d5 = leg_dynamics(
        machine, 5, position, rotation, velocity, omega, acceleration, alpha, gravity,
        inverse_size)
    force = add(add(add(add(add(add(force, f0), f1), f2), f3), f4), f5)
    moment = scale(inverse_size, add(add(add(add(add(add(moment, m0), m1), m2), m3), m4), m5))
    wrench = force[0], force[1], force[2], moment[0], moment[1], moment[2]

    # With J the scaled J_inv, row n of (J^T)^-1 maps the wrench to the force of leg n, its
    # length is the largest force of that leg under a unit load, and
    # d(det)/dt = det tr(J^-1 J') is the sum of its products with the rows of J'.
    (b0, b1, b2, b3, b4, b5), det = inverse_and_determinant(
        (r0[0], r1[0], r2[0], r3[0], r4[0], r5[0]), (r0[1], r1[1], r2[1], r3[1], r4[1], r5[1]),
        (r0[2], r1[2], r2[2], r3[2], r4[2], r5[2]), (r0[3], r1[3], r2[3], r3[3], r4[3], r5[3]),
        (r0[4], r1[4], r2[4], r3[4], r4[4], r5[4]), (r0[5], r1[5], r2[5], r3[5], r4[5], r5[5]))
    det *= size * size * size
    at = k + _RESULT
    _put6(tile, at + LENGTHS.start * LANES, l0, l1, l2, l3, l4, l5)
    _put6(tile, at + RATES.start * LANES, v0, v1, v2, v3, v4, v5)
    _put6(tile, at + FORCES.start * LANES, dot6(b0, wrench) + a0, dot6(b1, wrench) + a1,
          dot6(b2, wrench) + a2, dot6(b3, wrench) + a3, dot6(b4, wrench) + a4,
          dot6(b5, wrench) + a5)
    tile[at + DETERMINANT * LANES] = det
    tile[at + DETERMINANT_RATE * LANES] = det * (
        dot6(b0, d0) + dot6(b1, d1) + dot6(b2, d2) + dot6(b3, d3) + dot6(b4, d4) + dot6(b5, d5))

    g = gram(r0, r1, r2, r3, r4, r5)
    h = gram(b0, b1, b2, b3, b4, b5)
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


@compiled
def _tile_dynamics(machine: Array, tile: Array, lanes: int) -> None:
    for k in range(min(lanes, LANES)):
        _dynamics(machine, tile, k)


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
def solve(machine: Array, motions: Array, wrenches: Array, results: Array) -> None:
    """
    Compute the result of every motion.

    Parameters
    ----------
    machine : (MACHINE,)
        The machine's numbers in the order above.
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
        _tile_dynamics(machine, tile, lanes)
        _tile_eigenvalues(tile, lanes)
        for k in range(lanes):
            for n in range(RESULT):
                results[first + k, n] = tile[_RESULT + n * LANES + k]
