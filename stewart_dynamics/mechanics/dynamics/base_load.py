# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The load of a moving base: its inertial forces on legs and platform, as a wrench; compiled.

In base axes a point at r that moves with r' and r'' relative to the base is accelerated by
``a_B + W' x r + W x (W x r) + 2 W x r' + r''``, W the base's angular velocity, a_B the
acceleration of its origin. The inverse and the forward dynamics include ``r'' - g`` of this, g
the parameter. The remaining terms do not depend on the platform's acceleration, and act on the
legs as a wrench on the platform does: their load is subtracted from the external wrench.

With q = W x s, y the velocity of a leg's platform joint across the leg, and the terms of
``bodies``, the force of the leg at the platform joint is

    m_ge A_b + (m2 - m_ge) (s . A_b) s + (I_e + m1 S1^2 + m2 c2^2) / L (W' x s + W x q + |q|^2 s)
    - m2 c2 |q|^2 s + 2 m2 c2 / L (L' q - (y . q) s) + 2 (I_e / L^2 + m_ce) (W . s) s x y

where A_b is the acceleration of the leg's base joint, less the gravity that is not in g.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.dynamics.bodies import leg_inertia, leg_line
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    gravity_of, joints_of, leg_of, platform_of)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, Matrix3, rotate, rotate_back, scale, subtract, symmetric, Vector3)


@inlined
def carried(spin: Vector3, spin_rate: Vector3, arm: Vector3) -> Vector3:
    """Return W' x r + W x (W x r): the acceleration of a point fixed to a turning base."""
    return add(cross(spin_rate, arm), cross(spin, cross(spin, arm)))


@inlined
def carrying_matrix(spin: Vector3, spin_rate: Vector3) -> Matrix3:
    """Return the matrix that maps any arm to ``carried``: skew(W') + W W^T - W.W."""
    x, y, z = spin
    dx, dy, dz = spin_rate
    return (-(y * y + z * z), x * y - dz, x * z + dy,
            x * y + dz, -(x * x + z * z), y * z - dx,
            x * z - dy, y * z + dx, -(x * x + y * y))


@inlined
def leg_load(constants: Array, leg: int, position: Vector3, rotation: Matrix3,
             velocity: Vector3, omega: Vector3, felt: Vector3, spin: Vector3,
             carrying: Matrix3) -> tuple[Vector3, Vector3]:
    """Return force and moment at the platform's origin that move a leg with the base."""
    own = leg_of(constants, leg)
    base_joint, _ = joints_of(constants, leg)
    a, length, inverse_length, s = leg_line(constants, leg, position, rotation)
    x_rate = add(velocity, cross(omega, a))
    piston_moment, inertia = leg_inertia(own, length, inverse_length)
    hanging_mass = (own.cylinder_moment + piston_moment) * inverse_length
    joint = add(felt, rotate(carrying, base_joint))
    q = cross(spin, s)
    q_squared = dot(q, q)
    turning = scale(inertia * length, add(rotate(carrying, s), scale(q_squared, s)))
    coriolis = add(
        scale(2.0 * piston_moment * inverse_length * dot(s, x_rate), q),
        scale(2.0 * inertia * dot(spin, s), cross(s, x_rate)))
    along = ((own.piston_mass - hanging_mass) * dot(s, joint) - piston_moment * (
        q_squared + 2.0 * inverse_length * dot(x_rate, q)))
    force = add(add(add(scale(hanging_mass, joint), scale(along, s)), turning), coriolis)
    return force, cross(a, force)


@inlined
def platform_load(constants: Array, position: Vector3, rotation: Matrix3, velocity: Vector3,
                  omega: Vector3, felt: Vector3, spin: Vector3, spin_rate: Vector3,
                  carrying: Matrix3) -> tuple[Vector3, Vector3]:
    """Return force and moment at the platform's origin that move the platform with the base."""
    mass, center, inertia = platform_of(constants)
    com = rotate(rotation, center)
    force = scale(mass, add(
        add(felt, rotate(carrying, add(position, com))),
        scale(2.0, cross(spin, add(velocity, cross(omega, com))))))
    # its angular velocity is W + w, its angular acceleration W' + w' + W x w
    w, base_w = rotate_back(rotation, omega), rotate_back(rotation, spin)
    alpha = rotate_back(rotation, add(spin_rate, cross(spin, omega)))
    momentum = symmetric(inertia, base_w)
    moment = add(add(symmetric(inertia, alpha), cross(add(w, base_w), momentum)),
                 cross(base_w, symmetric(inertia, w)))
    return force, add(rotate(rotation, moment), cross(com, force))


@inlined
def base_load(constants: Array, position: Vector3, rotation: Matrix3, velocity: Vector3,
              omega: Vector3, gravity: Vector3, acceleration: Vector3, spin: Vector3,
              spin_rate: Vector3) -> tuple[Vector3, Vector3]:
    """
    Return the load of the base: force and moment at the platform's origin that move it along.

    It is subtracted from the wrench on the platform. The motion of the platform comes first, then
    the motion of the base.
    """
    felt = felt_at_origin(constants, gravity, acceleration)
    carrying = carrying_matrix(spin, spin_rate)
    p, v, w = position, velocity, omega
    force, moment = platform_load(
        constants, p, rotation, v, w, felt, spin, spin_rate, carrying)
    # Not a loop: the loop over samples becomes vector code then.
    f0, m0 = leg_load(constants, 0, p, rotation, v, w, felt, spin, carrying)
    f1, m1 = leg_load(constants, 1, p, rotation, v, w, felt, spin, carrying)
    f2, m2 = leg_load(constants, 2, p, rotation, v, w, felt, spin, carrying)
    f3, m3 = leg_load(constants, 3, p, rotation, v, w, felt, spin, carrying)
    f4, m4 = leg_load(constants, 4, p, rotation, v, w, felt, spin, carrying)
    f5, m5 = leg_load(constants, 5, p, rotation, v, w, felt, spin, carrying)
    return (add(add(add(add(add(add(force, f0), f1), f2), f3), f4), f5),
            add(add(add(add(add(add(moment, m0), m1), m2), m3), m4), m5))


@inlined
def felt_at_origin(constants: Array, gravity: Vector3, acceleration: Vector3) -> Vector3:
    """Return the acceleration of the base's origin, less the gravity that is not in g."""
    return subtract(acceleration, subtract(gravity, gravity_of(constants)))


@inlined
def moves(base: Array) -> bool:
    """Return whether a row of the base's motion adds a load: a row of nan adds none."""
    return not math.isnan(base[0])
