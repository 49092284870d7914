# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Forward dynamics: how the platform accelerates under given leg forces.

``X'' = M^-1 (J_inv^T (f - friction) + wrench - C X' - G)``, the wrench less the load of a moving
base, with the functions of the inverse dynamics for the load without acceleration, and with M as
a sum over the legs, ``M = M_p + sum (e_i J_i^T J_i + (m2 + m_r - e_i) j_i j_i^T)`` with
J_i = [1, -skew(a_i)], j_i the leg's row of J_inv and e_i its effective mass across the leg. Where
screws turn with their legs, f, friction and m_r have the rows of J_q (``drives.screws``). M is
positive definite for every hexapod, so Cholesky solves it without a pivot (Golub and Van Loan,
Matrix Computations, 4th ed., 4.2).
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.base_load import (
    carrying_matrix, felt_at_origin, leg_load, moves, platform_load)
from stewart_dynamics.mechanics.dynamics.bodies import (
    actuator_force, drive_motion, leg_dynamics, platform_dynamics, scaled_drive_row)
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, leg_of, platform_of, screws_turn)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, GRAVITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, POSITION, ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, Matrix3, read3, read9, rotate, scale, subtract, symmetric, Symmetric3, Vector3)

# Shape of the scratch memory: the lower triangle of M, and below it the right-hand side, which
# becomes the acceleration.
_RIGHT = 6
WORK = 7, 6

_REST = (0.0, 0.0, 0.0)


@inlined
def _point_inertia(mass: float, arm: Vector3) -> Symmetric3:
    """Return the inertia of a point mass about the origin of its arm."""
    x, y, z = arm
    return (mass * (y * y + z * z), -mass * x * y, -mass * x * z,
            mass * (x * x + z * z), -mass * y * z, mass * (x * x + y * y))


@inlined
def _turned(rotation: Matrix3, inertia: Symmetric3) -> Symmetric3:
    """Return R I R^T."""
    x = rotate(rotation, symmetric(inertia, (rotation[0], rotation[1], rotation[2])))
    y = rotate(rotation, symmetric(inertia, (rotation[3], rotation[4], rotation[5])))
    z = rotate(rotation, symmetric(inertia, (rotation[6], rotation[7], rotation[8])))
    return x[0], x[1], x[2], y[1], y[2], z[2]


@inlined
def _sum6(a: Symmetric3, b: Symmetric3) -> Symmetric3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@inlined
def _add_body(work: Array, mass: float, moment: Vector3, inertia: Symmetric3,
              inverse_size: float) -> None:
    """Add the M of a rigid body with this moment of mass [kg m] and inertia about the origin."""
    x, y, z = scale(inverse_size, moment)
    for n in range(3):
        work[n, n] += mass
    work[3, 1] -= z
    work[3, 2] += y
    work[4, 0] += z
    work[4, 2] -= x
    work[5, 0] -= y
    work[5, 1] += x
    i = inverse_size * inverse_size
    work[3, 3] += i * inertia[0]
    work[4, 3] += i * inertia[1]
    work[4, 4] += i * inertia[3]
    work[5, 3] += i * inertia[2]
    work[5, 4] += i * inertia[4]
    work[5, 5] += i * inertia[5]


@compiled
def _add_turning_drives(constants: Array, motion: Array, forces: Array, work: Array) -> None:
    """Add forces and reflected masses of drives whose screws turn with their legs."""
    position, rotation = read3(motion, POSITION.start), read9(motion, ROTATION.start)
    for n in range(6):
        own = leg_of(constants, n)
        _, rate, drift = drive_motion(
            constants, n, position, rotation, read3(motion, LINEAR_VELOCITY.start),
            read3(motion, ANGULAR_VELOCITY.start), _REST, _REST)
        row = scaled_drive_row(constants, n, position, rotation)
        push = forces[n] - actuator_force(own, rate, drift)
        for i in range(6):
            work[_RIGHT, i] += push * row[i]
            for k in range(i + 1):
                work[i, k] += own.reflected_mass * row[i] * row[k]


@inlined
def _solve(work: Array) -> None:
    """Solve the positive definite system in place: L L^T x = right."""
    for n in range(6):
        for k in range(n + 1):
            rest = work[n, k]
            for m in range(k):
                rest -= work[n, m] * work[k, m]
            if n > k:
                work[n, k] = rest / work[k, k]
            else:  # zero where masses underflow: the result is not finite then
                work[n, n] = math.sqrt(rest) if rest > 0.0 else 0.0
        rest = work[_RIGHT, n]
        for m in range(n):
            rest -= work[n, m] * work[_RIGHT, m]
        work[_RIGHT, n] = rest / work[n, n]
    for n in range(5, -1, -1):
        rest = work[_RIGHT, n]
        for m in range(n + 1, 6):
            rest -= work[m, n] * work[_RIGHT, m]
        work[_RIGHT, n] = rest / work[n, n]


@compiled
def acceleration(constants: Array, motion: Array, forces: Array, wrench: Array, base: Array,
                 work: Array) -> None:
    """
    Write the acceleration of a motion under leg forces.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``.
    motion (MOTION,): a row of motion, SI units, base axes; its acceleration is written.
    forces (6,): forces of the actuators [N], + pushes; their friction is subtracted here.
    wrench (6,): force [N] and moment [N m] on the platform at its origin, base axes.
    base (BASE,): a row of the base's motion; one of nan adds no load.
    work: scratch memory.
    """
    inverse_size = 1.0 / characteristic_length_of(constants)
    position = read3(motion, POSITION.start)
    rotation = read9(motion, ROTATION.start)
    velocity = read3(motion, LINEAR_VELOCITY.start)
    omega = read3(motion, ANGULAR_VELOCITY.start)

    # In coordinates [v; size w] all entries of M are masses.
    mass, center, platform_inertia = platform_of(constants)
    com = rotate(rotation, center)
    moment = scale(mass, com)
    inertia = _sum6(_turned(rotation, platform_inertia), _point_inertia(mass, com))
    body_force, body_moment = platform_dynamics(constants, rotation, omega, _REST, _REST)
    force = subtract(read3(wrench, 0), body_force)
    torque = subtract(read3(wrench, 3), body_moment)
    moving = moves(base)
    spin = read3(base, BASE_ANGULAR_VELOCITY.start)
    spin_rate = read3(base, BASE_ANGULAR_ACCELERATION.start)
    carrying = carrying_matrix(spin, spin_rate)
    felt = felt_at_origin(
        constants, read3(base, GRAVITY.start), read3(base, BASE_ACCELERATION.start))
    if moving:
        load, moment_of_load = platform_load(
            constants, position, rotation, velocity, omega, felt, spin, spin_rate, carrying)
        force, torque = subtract(force, load), subtract(torque, moment_of_load)
    work[:] = 0.0
    turning = screws_turn(constants)
    if turning:
        _add_turning_drives(constants, motion, forces, work)
    for n in range(6):
        leg = leg_dynamics(constants, n, position, rotation, velocity, omega, _REST, _REST)
        mass += leg.inertia
        moment = add(moment, scale(leg.inertia, leg.arm))
        inertia = _sum6(inertia, _point_inertia(leg.inertia, leg.arm))
        force = subtract(force, leg.force)
        torque = subtract(torque, leg.moment)
        if moving:
            load, moment_of_load = leg_load(
                constants, n, position, rotation, velocity, omega, felt, spin, carrying)
            force, torque = subtract(force, load), subtract(torque, moment_of_load)
        push = forces[n] - leg.actuator
        own = leg_of(constants, n)
        along = own.piston_mass + own.reflected_mass - leg.inertia
        if turning:
            push, along = 0.0, own.piston_mass - leg.inertia
        for i in range(6):
            work[_RIGHT, i] += push * leg.row[i]
            for k in range(i + 1):
                work[i, k] += along * leg.row[i] * leg.row[k]
    _add_body(work, mass, moment, inertia, inverse_size)
    for n in range(3):
        work[_RIGHT, n] += force[n]
        work[_RIGHT, 3 + n] += inverse_size * torque[n]

    _solve(work)
    for n in range(3):
        motion[LINEAR_ACCELERATION.start + n] = work[_RIGHT, n]
        motion[ANGULAR_ACCELERATION.start + n] = inverse_size * work[_RIGHT, 3 + n]


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def solve(constants: Array, motions: Array, forces: Array, wrenches: Array, bases: Array,
          work: Array) -> None:
    """
    Write the accelerations of motions (N, MOTION) under forces (N, 6), see ``acceleration``.

    The wrenches are (N, WRENCH), or (1, WRENCH): one row for all; so are the bases, (N, BASE).
    """
    one_wrench, one_base = len(wrenches) == 1, len(bases) == 1
    for n in range(len(motions)):
        acceleration(constants, motions[n], forces[n], wrenches[0 if one_wrench else n],
                     bases[0 if one_base else n], work)
