# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The base wrench: the load of the hexapod on its base, at the base's origin; compiled.

By Newton's and Euler's laws for all its parts together: the external wrench less the rate of
their momentum, weight included. Forces between the parts are in neither; so no leg force, no
friction and no inverse of J_inv is needed, and it is right in singular poses too.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.mechanics.dynamics.base_load import carried
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.dynamics.hexapod_constants import joints_of, leg_of, platform_of
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, GRAVITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, POSITION, ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, Matrix3, read3, read9, rotate, rotate_back, scale, subtract, symmetric,
    Vector3)


@inlined
def _platform_momentum_rate(
        constants: Array, rotation: Matrix3, position: Vector3, acceleration: Vector3,
        omega: Vector3, alpha: Vector3) -> tuple[Vector3, Vector3]:
    """Return the rates of the platform's momentum and moment of momentum about the base."""
    mass, center, inertia = platform_of(constants)
    com = rotate(rotation, center)
    force = scale(mass, add(acceleration, carried(omega, alpha, com)))
    omega_p = rotate_back(rotation, omega)
    moment_p = add(symmetric(inertia, rotate_back(rotation, alpha)),
                   cross(omega_p, symmetric(inertia, omega_p)))
    return force, add(rotate(rotation, moment_p), cross(add(position, com), force))


@inlined
def _leg_momentum_rate(
        constants: Array, leg: int, position: Vector3, rotation: Matrix3, velocity: Vector3,
        acceleration: Vector3, omega: Vector3, alpha: Vector3, felt: Vector3, spin: Vector3,
        spin_rate: Vector3) -> tuple[Vector3, Vector3]:
    """Return the same of a leg; velocity, acceleration, omega and alpha are absolute ones."""
    own = leg_of(constants, leg)
    base_joint, _ = joints_of(constants, leg)
    a, length, inverse_length, s = leg_line(constants, leg, position, rotation)
    # the leg's vector l = L s: its time derivatives, seen from axes that do not turn
    base_acceleration = carried(spin, spin_rate, base_joint)
    l_rate = subtract(add(velocity, cross(omega, a)), cross(spin, base_joint))
    l_acceleration = subtract(add(acceleration, carried(omega, alpha, a)), base_acceleration)
    rate = dot(s, l_rate)
    s_rate = scale(inverse_length, subtract(l_rate, scale(rate, s)))
    length_acceleration = dot(s, l_acceleration) + length * dot(s_rate, s_rate)
    s_acceleration = scale(inverse_length, subtract(
        subtract(l_acceleration, scale(length_acceleration, s)), scale(2.0 * rate, s_rate)))
    # the piston's center of mass is at (L - S2) s, the cylinder's at S1 s, from the base joint
    distance = length - own.piston_center
    moment = own.cylinder_moment + own.piston_mass * distance
    joint = add(felt, base_acceleration)
    sliding = scale(2.0 * own.piston_mass * rate, s_rate)
    force = add(add(scale(own.cylinder_mass + own.piston_mass, joint),
                    scale(moment, s_acceleration)),
                add(sliding, scale(own.piston_mass * length_acceleration, s)))
    turning = add(add(scale(moment, joint), scale(
        own.joint_inertia + own.piston_mass * distance * distance, s_acceleration)),
        scale(distance, sliding))
    return force, add(cross(base_joint, force), cross(s, turning))


@inlined
def _base_wrench(constants: Array, motion: Array, wrench: Array, base: Array,
                 ) -> tuple[Vector3, Vector3]:
    position, rotation = read3(motion, POSITION.start), read9(motion, ROTATION.start)
    relative_velocity = read3(motion, LINEAR_VELOCITY.start)
    relative_omega = read3(motion, ANGULAR_VELOCITY.start)
    spin = read3(base, BASE_ANGULAR_VELOCITY.start)
    spin_rate = read3(base, BASE_ANGULAR_ACCELERATION.start)
    felt = subtract(read3(base, BASE_ACCELERATION.start), read3(base, GRAVITY.start))
    # of the platform, seen from axes that do not turn; gravity and the acceleration of the
    # base's origin are the same for all parts: ``felt``
    velocity = add(relative_velocity, cross(spin, position))
    acceleration = add(add(read3(motion, LINEAR_ACCELERATION.start),
                           carried(spin, spin_rate, position)),
                       scale(2.0, cross(spin, relative_velocity)))
    omega = add(relative_omega, spin)
    alpha = add(add(read3(motion, ANGULAR_ACCELERATION.start), spin_rate),
                cross(spin, relative_omega))
    load = read3(wrench, 0)
    force, moment = _platform_momentum_rate(
        constants, rotation, position, add(acceleration, felt), omega, alpha)
    force = subtract(load, force)
    moment = subtract(add(read3(wrench, 3), cross(position, load)), moment)
    for leg in range(6):
        leg_force, leg_moment = _leg_momentum_rate(
            constants, leg, position, rotation, velocity, acceleration, omega, alpha, felt, spin,
            spin_rate)
        force, moment = subtract(force, leg_force), subtract(moment, leg_moment)
    return force, moment


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def base_wrenches(constants: Array, motions: Array, wrenches: Array, bases: Array,
                  results: Array) -> None:
    """
    Write the base wrench of each motion.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``; its gravity is not
        used.
    motions (N, MOTION): rows of motion, SI units, base axes.
    wrenches (N, WRENCH) or (1, WRENCH): external wrenches on the platform at its origin, base
        axes; one row for all.
    bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all. A row of nan gives
        nan.
    results (N, WRENCH): written: force [N] and moment [N m] on the base at its origin, base axes.
    """
    one_wrench, one_base = len(wrenches) == 1, len(bases) == 1
    for row in range(len(motions)):
        force, moment = _base_wrench(
            constants, motions[row], wrenches[0 if one_wrench else row],
            bases[0 if one_base else row])
        for n in range(3):
            results[row, n] = force[n]
            results[row, 3 + n] = moment[n]
