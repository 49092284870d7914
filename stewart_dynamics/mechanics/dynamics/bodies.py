# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The forces that move each leg and the platform, with the lengths and rates of the legs.

The equations are those of ``lagrange``, evaluated as vectors of three. Numbers in brackets are the
paper's equations.
"""

from __future__ import annotations

from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.drives.screws import leg_twist, turned, turning_row
from stewart_dynamics.mechanics.dynamics.friction import with_friction
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, gravity_of, joints_of, Leg, leg_of, platform_of, screw_pitch_of,
    universal_axes_of)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, Matrix3, norm, rotate, rotate_back, scale, subtract, symmetric, Vector3,
    Vector6)


class LegDynamics(NamedTuple):
    """A leg in a motion: its length and rate, and the forces that move it."""

    length: float  # [m]
    rate: float  # [m/s]
    force: Vector3  # on the leg at its platform joint, to move the leg [N], base axes
    moment: Vector3  # of that force about the platform's origin [N m]
    actuator: float
    """Force [N] that moves the actuator itself: its reflected mass and its friction; guided."""
    row: Vector6  # the leg's row of J_inv, its right half divided by the characteristic length
    row_rate: Vector6  # time derivative of that row
    arm: Vector3  # a = R p: the platform joint from the platform's origin, base axes [m]
    inertia: float  # effective mass across the leg, I_e / L^2 + m_ce [kg]


@inlined
def leg_line(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3,
) -> tuple[Vector3, float, float, Vector3]:
    """Return a leg's a = R p, length L, 1 / L (0 where L is 0) and direction s: (1), (2)."""
    base_joint, platform_joint = joints_of(constants, leg)
    a = rotate(rotation, platform_joint)
    leg_vector = subtract(add(position, a), base_joint)
    length = norm(leg_vector)
    inverse_length = 1.0 / length if length > 0.0 else 0.0
    return a, length, inverse_length, scale(inverse_length, leg_vector)


@inlined
def leg_inertia(leg: Leg, length: float, inverse_length: float) -> tuple[float, float]:
    """Return m2 c2 with c2 = L - S2 [kg m], and the effective mass across a leg [kg]."""
    piston_distance = length - leg.piston_center
    piston_moment = leg.piston_mass * piston_distance
    return piston_moment, ((leg.joint_inertia + piston_moment * piston_distance)
                           * inverse_length * inverse_length)


@inlined
def actuator_force(leg: Leg, rate: float, acceleration: float) -> float:
    """Return the force that moves an actuator at a rate and an acceleration of its drive [N]."""
    force: float = with_friction(leg.reflected_mass * acceleration, rate, leg.viscous_friction,
                                 leg.coulomb_friction, leg.coulomb_velocity)
    return force


@inlined
def drive_motion(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3, velocity: Vector3,
        omega: Vector3, acceleration: Vector3, alpha: Vector3) -> Vector3:
    """Return the coordinate q of a leg's drive, its rate and its acceleration: ``screws``."""
    a, length, inverse_length, s = leg_line(constants, leg, position, rotation)
    a_rate, a_acc = turned(a, omega, alpha)
    x_rate, x_acc = add(velocity, a_rate), add(acceleration, a_acc)
    rate = dot(s, x_rate)
    s_rate = scale(inverse_length, subtract(x_rate, scale(rate, s)))
    acc = dot(s, x_acc) + length * dot(s_rate, s_rate)
    pitch = screw_pitch_of(constants, leg)
    if pitch == 0.0:
        return length, rate, acc
    s_acc = scale(inverse_length, subtract(
        subtract(x_acc, scale(acc, s)), scale(2.0 * rate, s_rate)))
    u, fixed = universal_axes_of(constants, leg)
    w = rotate(rotation, fixed)
    w_rate, w_acc = turned(w, omega, alpha)
    twist, twist_rate, twist_acc = leg_twist(u, w, w_rate, w_acc, s, s_rate, s_acc)
    return length + pitch * twist, rate + pitch * twist_rate, acc + pitch * twist_acc


@inlined
def drive_row(constants: Array, leg: int, position: Vector3, rotation: Matrix3) -> Vector6:
    """Return a leg's row of J_q, which is its row of J_inv where its screw is guided."""
    a, _, inverse_length, s = leg_line(constants, leg, position, rotation)
    pitch = screw_pitch_of(constants, leg)
    if pitch == 0.0:
        m = cross(a, s)
        return s[0], s[1], s[2], m[0], m[1], m[2]
    u, fixed = universal_axes_of(constants, leg)
    return turning_row(pitch, u, rotate(rotation, fixed), a, inverse_length, s)


@inlined
def scaled_drive_row(constants: Array, leg: int, position: Vector3, rotation: Matrix3) -> Vector6:
    """Return the same, its right half divided by the characteristic length."""
    k, row = 1.0 / characteristic_length_of(constants), drive_row(
        constants, leg, position, rotation)
    return row[0], row[1], row[2], k * row[3], k * row[4], k * row[5]


@inlined
def leg_dynamics(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3, velocity: Vector3,
        omega: Vector3, acceleration: Vector3, alpha: Vector3,
) -> LegDynamics:
    """Return a leg in a motion of the platform."""
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
    piston_moment, inertia = leg_inertia(own, length, inverse_length)
    gravity_mass = (own.cylinder_moment + piston_moment) * inverse_length
    coriolis_mass = piston_moment * inverse_length - inertia
    force = add(
        add(subtract(scale(inertia, across_acc), scale(gravity_mass, across_gravity)),
            scale(2.0 * coriolis_mass * rate * inverse_length, across)),
        scale(own.piston_mass * (along_acc - along_gravity + own.piston_center * inverse_length
                                 * inverse_length * across_squared), s))

    length_acc = along_acc + across_squared * inverse_length
    actuator = actuator_force(own, rate, length_acc)

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
