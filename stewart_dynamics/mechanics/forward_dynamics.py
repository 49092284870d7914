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
Forward dynamics: how the platform accelerates under given leg forces.

``X'' = M^-1 (J_inv^T (f - friction) + wrench - C X' - G)``, on the vectors of the inverse path:
what the legs would have to carry without acceleration comes from it, and M is made of sums
over the legs, ``M = M_p + sum (e_i J_i^T J_i + (m2 + m_r - e_i) j_i j_i^T)`` with J_i = [1,
-skew(a_i)], j_i the leg's row of J_inv and e_i what resists motion across the leg. M is positive
definite for every machine, so Cholesky solves it without a pivot (Golub and Van Loan, Matrix
Computations, 4th ed., 4.2).
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.jit import compiled, entry_point, inlined
from stewart_dynamics.mechanics.kernel import (
    BODY, LEG, leg_dynamics, leg_inertia, leg_line, platform_dynamics)
from stewart_dynamics.mechanics.vectors import (
    add, Matrix3, rotate, scale, subtract, symmetric, Symmetric3, Vector3)

# Scratch memory: the lower triangle of M, and what becomes the acceleration.
_RIGHT = 36
WORK = _RIGHT + 6

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
def _put_body(work: Array, mass: float, moment: Vector3, inertia: Symmetric3, size: float,
              ) -> None:
    """Store the M of a rigid body with this moment of mass [kg m] and inertia about the origin."""
    i = 1.0 / size
    x, y, z = scale(i, moment)
    for n in range(3):
        for k in range(n):
            work[6 * n + k] = 0.0
        work[7 * n] = mass
    work[18], work[19], work[20] = 0.0, -z, y
    work[24], work[25], work[26] = z, 0.0, -x
    work[30], work[31], work[32] = -y, x, 0.0
    i *= i
    work[21] = i * inertia[0]
    work[27], work[28] = i * inertia[1], i * inertia[3]
    work[33], work[34], work[35] = i * inertia[2], i * inertia[4], i * inertia[5]


@inlined
def _solve(work: Array) -> None:
    """Solve the positive definite system in place: L L^T x = right."""
    for n in range(6):
        for k in range(n + 1):
            rest = work[6 * n + k]
            for m in range(k):
                rest -= work[6 * n + m] * work[6 * k + m]
            if n > k:
                work[6 * n + k] = rest / work[7 * k]
            else:  # zero where masses underflow: what comes of it is not finite
                work[7 * n] = math.sqrt(rest) if rest > 0.0 else 0.0
        rest = work[_RIGHT + n]
        for m in range(n):
            rest -= work[6 * n + m] * work[_RIGHT + m]
        work[_RIGHT + n] = rest / work[7 * n]
    for n in range(5, -1, -1):
        rest = work[_RIGHT + n]
        for m in range(n + 1, 6):
            rest -= work[6 * m + n] * work[_RIGHT + m]
        work[_RIGHT + n] = rest / work[7 * n]


@compiled
def acceleration(machine: Array, motion: Array, forces: Array, wrench: Array, work: Array,
                 ) -> None:
    """
    Write the acceleration of a motion under leg forces.

    Parameters
    ----------
    machine : (MACHINE,)
        The machine's numbers as ``inverse_dynamics`` has them.
    motion : (MOTION,)
        A row of motion, SI units, base axes; its last six numbers are written.
    forces : (6,)
        Of the actuators [N], + pushes; their friction is taken off here.
    wrench : (6,)
        Force [N] and moment [N m] on the platform at its origin, base axes.
    work : (WORK,)
        Scratch memory.

    """
    gravity = machine[0], machine[1], machine[2]
    size = machine[3]
    inverse_size = 1.0 / size
    position = motion[0], motion[1], motion[2]
    rotation = (motion[3], motion[4], motion[5], motion[6], motion[7], motion[8], motion[9],
                motion[10], motion[11])
    velocity = motion[12], motion[13], motion[14]
    omega = motion[15], motion[16], motion[17]

    # In coordinates [v; size w] all entries of M are masses.
    mass = machine[4]
    com = rotate(rotation, (machine[5], machine[6], machine[7]))
    moment = scale(mass, com)
    inertia = _turned(rotation, (machine[8], machine[9], machine[10], machine[11], machine[12],
                                 machine[13]))
    p = _point_inertia(mass, com)
    xx, xy, xz, yy, yz, zz = (inertia[0] + p[0], inertia[1] + p[1], inertia[2] + p[2],
                              inertia[3] + p[3], inertia[4] + p[4], inertia[5] + p[5])
    across_mass = mass
    for leg in range(6):
        a, length, inverse_length, _ = leg_line(machine, leg, position, rotation)
        across = leg_inertia(machine, leg, length, inverse_length)[1]
        across_mass += across
        moment = add(moment, scale(across, a))
        p = _point_inertia(across, a)
        xx, xy, xz, yy, yz, zz = xx + p[0], xy + p[1], xz + p[2], yy + p[3], yz + p[4], zz + p[5]
    _put_body(work, across_mass, moment, (xx, xy, xz, yy, yz, zz), size)

    body_force, body_moment = platform_dynamics(
        machine, rotation, omega, _REST, _REST, gravity)
    force = subtract((wrench[0], wrench[1], wrench[2]), body_force)
    torque = subtract((wrench[3], wrench[4], wrench[5]), body_moment)
    for n in range(6):
        work[_RIGHT + n] = 0.0
    for leg in range(6):
        length, _, leg_force, leg_moment, actuator, row, _ = leg_dynamics(
            machine, leg, position, rotation, velocity, omega, _REST, _REST, gravity,
            inverse_size)
        force = subtract(force, leg_force)
        torque = subtract(torque, leg_moment)
        push = forces[leg] - actuator
        o = BODY + leg * LEG
        along = machine[o + 6] + machine[o + 10] - leg_inertia(
            machine, leg, length, 1.0 / length if length > 0.0 else 0.0)[1]
        for n in range(6):
            work[_RIGHT + n] += push * row[n]
            for k in range(n + 1):
                work[6 * n + k] += along * row[n] * row[k]
    for n in range(3):
        work[_RIGHT + n] += force[n]
        work[_RIGHT + 3 + n] += inverse_size * torque[n]

    _solve(work)
    for n in range(3):
        motion[18 + n] = work[_RIGHT + n]
        motion[21 + n] = inverse_size * work[_RIGHT + 3 + n]


@entry_point
def solve(machine: Array, motions: Array, forces: Array, wrenches: Array) -> None:
    """
    Write the accelerations of motions (N, MOTION) under forces (N, 6), see ``acceleration``.

    The wrenches are (N, WRENCH), or (1, WRENCH): one row for all.
    """
    work = np.empty(WORK)
    one_wrench = len(wrenches) == 1
    for n in range(len(motions)):
        acceleration(machine, motions[n], forces[n], wrenches[0 if one_wrench else n], work)
