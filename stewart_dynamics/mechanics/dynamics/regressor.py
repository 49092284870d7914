# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The regressor Y of the leg forces, f = Y theta, of many samples; compiled.

theta are the parameters in which leg forces are linear, see ``linear_parameters``. As in
``base_wrench``, velocities and accelerations are those in axes that do not turn, accelerations
less gravity: ``A = a_B - g + W' x r + W x (W x r) + 2 W x r' + r''`` at a point r. So a moving
base needs nothing more. Row n of (J_inv^T)^-1, or of (J_q^T)^-1 where screws turn with their legs
(``drives.screws``), in halves u (for forces) and h (for moments),
gives the force of leg n:

- platform, in platform axes, with its origin's A and its absolute w and w': the mass gives u . A,
  the first moment c ``K^T u + A x h`` with K = skew(w') + skew(w)^2, the inertia about its origin
  ``h . I w' + (h x w) . I w``.
- leg i, with s its direction, A of its base joint, and P = 1 - s s^T: the force at its platform
  joint is ``P (m S A + J s'' + 2 m c L' s') / L + m (s . A + L'' - c |s'|^2) s``; m S and J sum
  over both parts, m c and the term along the leg are the piston's, c = L - S. A force F there
  takes ``(u + h x a) . F``.
"""

from __future__ import annotations

from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.base_load import carried, carrying_matrix, moves
from stewart_dynamics.mechanics.dynamics.bodies import drive_motion, leg_line, scaled_drive_row
from stewart_dynamics.mechanics.dynamics.friction import with_friction
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, coulomb_velocity_of, gravity_of, joints_of, screws_turn)
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    COULOMB_FRICTION, CYLINDER_FIRST, CYLINDER_MASS, CYLINDER_SECOND, FIRST_MOMENT, INERTIA,
    LINEAR, MASS, OFFSET, PISTON_FIRST, PISTON_MASS, PISTON_SECOND, REFLECTED_MASS,
    VISCOUS_FRICTION)
from stewart_dynamics.mechanics.matrix6 import inverse_and_determinant
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, consecutive, GRAVITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, POSITION,
    ROTATION)
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, Matrix3, put3, read3, read9, rotate_back, scale, subtract, Vector3)


class Regressor(NamedTuple):
    """
    How leg forces depend on the parameters in which they are linear.

    Attributes
    ----------
    matrix : (..., 6, n)
        Force of each leg [N] for one unit of each parameter.
    names : tuple of str
        Names of the n parameters; ``mechanics.dynamics.linear_parameters`` gives their values.

    """

    matrix: Array
    names: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the shape, not the array."""
        return f'<Regressor of shape {self.matrix.shape}: {", ".join(self.names)}>'


# Scratch memory: for each leg its row of J_inv, later of (J_inv^T)^-1; then a, the vectors of its
# four parameters, and rate and acceleration of its length. Where screws turn with their legs: its
# row of J_q, and rate and acceleration of its drive.
_ROW, _ARM, _OF_FIRST, _OF_SECOND, _OF_PISTON, _OF_PISTON_FIRST, _RATE, _ACCELERATION = (
    part.start for part in consecutive(6, 3, 3, 3, 3, 3, 1, 1))
_LEG = 23
WORK = (6 * _LEG,)


class _Moving(NamedTuple):
    """A platform and a base in motion, in axes that do not turn."""

    position: Vector3
    rotation: Matrix3
    velocity: Vector3  # less that of the base's origin
    omega: Vector3
    acceleration: Vector3  # of the platform's origin, as felt
    alpha: Vector3
    felt: Vector3  # at the base's origin
    spin: Vector3  # of the base
    spin_rate: Vector3


@inlined
def _moving(constants: Array, motion: Array, base: Array) -> _Moving:
    felt, spin, spin_rate = scale(-1.0, gravity_of(constants)), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if moves(base):
        felt = subtract(read3(base, BASE_ACCELERATION.start), read3(base, GRAVITY.start))
        spin = read3(base, BASE_ANGULAR_VELOCITY.start)
        spin_rate = read3(base, BASE_ANGULAR_ACCELERATION.start)
    position, velocity = read3(motion, POSITION.start), read3(motion, LINEAR_VELOCITY.start)
    omega = read3(motion, ANGULAR_VELOCITY.start)
    acceleration = add(
        add(read3(motion, LINEAR_ACCELERATION.start), scale(2.0, cross(spin, velocity))),
        add(felt, carried(spin, spin_rate, position)))
    alpha = add(add(read3(motion, ANGULAR_ACCELERATION.start), spin_rate), cross(spin, omega))
    return _Moving(
        position, read9(motion, ROTATION.start), add(velocity, cross(spin, position)),
        add(omega, spin), acceleration, alpha, felt, spin, spin_rate)


@compiled
def _put_leg(constants: Array, leg: int, of: _Moving, work: Array) -> None:
    """Store a leg's row of J_inv, right half by the characteristic length, and its vectors."""
    base_joint, _ = joints_of(constants, leg)
    a, length, inverse_length, s = leg_line(constants, leg, of.position, of.rotation)
    # the leg's vector L s and its time derivatives
    joint = add(of.felt, carried(of.spin, of.spin_rate, base_joint))
    l_rate = subtract(add(of.velocity, cross(of.omega, a)), cross(of.spin, base_joint))
    l_acceleration = subtract(add(of.acceleration, carried(of.omega, of.alpha, a)), joint)
    rate = dot(s, l_rate)
    s_rate = scale(inverse_length, subtract(l_rate, scale(rate, s)))
    along = dot(s, l_acceleration)
    turning = dot(s_rate, s_rate)
    length_acceleration = along + length * turning
    sliding = scale(2.0 * rate, s_rate)
    s_acceleration = scale(inverse_length, subtract(
        subtract(l_acceleration, scale(along, s)), sliding))  # across the leg
    hanging = subtract(joint, scale(dot(s, joint), s))
    of_first, of_second = scale(inverse_length, hanging), scale(inverse_length, s_acceleration)

    at = leg * _LEG
    put3(work, at + _ROW, s)
    put3(work, at + _ROW + 3, scale(1.0 / characteristic_length_of(constants), cross(a, s)))
    put3(work, at + _ARM, a)
    put3(work, at + _OF_FIRST, of_first)
    put3(work, at + _OF_SECOND, of_second)
    # with c = L - S: m c^2 + I = m L^2 - 2 L m S + J
    put3(work, at + _OF_PISTON, add(
        add(hanging, add(scale(length, s_acceleration), sliding)),
        scale(dot(s, joint) + length_acceleration - length * turning, s)))
    put3(work, at + _OF_PISTON_FIRST, subtract(scale(turning, s), add(
        of_first, add(scale(2.0, s_acceleration), scale(inverse_length, sliding)))))
    work[at + _RATE], work[at + _ACCELERATION] = rate, length_acceleration


@compiled
def _put_drive(constants: Array, leg: int, motion: Array, work: Array) -> None:
    """Replace the row of J_inv by that of J_q, and the length by the drive's coordinate."""
    position, rotation = read3(motion, POSITION.start), read9(motion, ROTATION.start)
    at = leg * _LEG
    row = scaled_drive_row(constants, leg, position, rotation)
    for n in range(6):
        work[at + _ROW + n] = row[n]
    _, work[at + _RATE], work[at + _ACCELERATION] = drive_motion(
        constants, leg, position, rotation, read3(motion, LINEAR_VELOCITY.start),
        read3(motion, ANGULAR_VELOCITY.start), read3(motion, LINEAR_ACCELERATION.start),
        read3(motion, ANGULAR_ACCELERATION.start))


@compiled
def _invert(work: Array) -> None:
    """Replace the rows of J_inv by those of (J_inv^T)^-1."""
    c, k = _ROW, _LEG
    rows, _ = inverse_and_determinant(
        (work[c], work[k + c], work[2 * k + c], work[3 * k + c], work[4 * k + c],
         work[5 * k + c]),
        (work[c + 1], work[k + c + 1], work[2 * k + c + 1], work[3 * k + c + 1],
         work[4 * k + c + 1], work[5 * k + c + 1]),
        (work[c + 2], work[k + c + 2], work[2 * k + c + 2], work[3 * k + c + 2],
         work[4 * k + c + 2], work[5 * k + c + 2]),
        (work[c + 3], work[k + c + 3], work[2 * k + c + 3], work[3 * k + c + 3],
         work[4 * k + c + 3], work[5 * k + c + 3]),
        (work[c + 4], work[k + c + 4], work[2 * k + c + 4], work[3 * k + c + 4],
         work[4 * k + c + 4], work[5 * k + c + 4]),
        (work[c + 5], work[k + c + 5], work[2 * k + c + 5], work[3 * k + c + 5],
         work[4 * k + c + 5], work[5 * k + c + 5]))
    for leg in range(6):
        for n in range(6):
            work[leg * k + c + n] = rows[leg][n]


@inlined
def _put_platform(of: _Moving, u: Vector3, h: Vector3, row: Array) -> None:
    """Write the ten numbers of the platform; u and h are in base axes."""
    r = of.rotation
    carrying = carrying_matrix(of.omega, of.alpha)
    row[MASS] = dot(u, of.acceleration)
    first = rotate_back(r, add(rotate_back(carrying, u), cross(of.acceleration, h)))
    put3(row, FIRST_MOMENT.start, first)
    w, dw, p = rotate_back(r, of.omega), rotate_back(r, of.alpha), rotate_back(r, h)
    q = cross(p, w)
    at = INERTIA.start
    row[at] = p[0] * dw[0] + q[0] * w[0]
    row[at + 1] = p[0] * dw[1] + p[1] * dw[0] + q[0] * w[1] + q[1] * w[0]
    row[at + 2] = p[0] * dw[2] + p[2] * dw[0] + q[0] * w[2] + q[2] * w[0]
    row[at + 3] = p[1] * dw[1] + q[1] * w[1]
    row[at + 4] = p[1] * dw[2] + p[2] * dw[1] + q[1] * w[2] + q[2] * w[1]
    row[at + 5] = p[2] * dw[2] + q[2] * w[2]


@compiled
def _put_row(of: _Moving, size: float, leg: int, coulomb_velocity: float, work: Array,
             row: Array) -> None:
    """Write the derivatives of the force of one leg by all parameters."""
    u = read3(work, leg * _LEG + _ROW)
    h = scale(1.0 / size, read3(work, leg * _LEG + _ROW + 3))
    _put_platform(of, u, h, row)
    for i in range(6):
        at = i * _LEG
        by = add(u, cross(h, read3(work, at + _ARM)))
        second = dot(by, read3(work, at + _OF_SECOND))
        row[CYLINDER_MASS.start + i] = 0.0
        row[CYLINDER_FIRST.start + i] = dot(by, read3(work, at + _OF_FIRST))
        row[CYLINDER_SECOND.start + i] = second
        row[PISTON_MASS.start + i] = dot(by, read3(work, at + _OF_PISTON))
        row[PISTON_FIRST.start + i] = dot(by, read3(work, at + _OF_PISTON_FIRST))
        row[PISTON_SECOND.start + i] = second
    for n in range(REFLECTED_MASS.start, LINEAR):
        row[n] = 0.0
    rate = work[leg * _LEG + _RATE]
    row[REFLECTED_MASS.start + leg] = work[leg * _LEG + _ACCELERATION]
    row[VISCOUS_FRICTION.start + leg] = rate
    row[COULOMB_FRICTION.start + leg] = with_friction(0.0, rate, 0.0, 1.0, coulomb_velocity)
    row[OFFSET.start + leg] = 1.0


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,:,::1]', 'f8[::1]')
def regressors(constants: Array, motions: Array, bases: Array, results: Array, work: Array,
               ) -> None:
    """
    Write the regressor of each motion.

    constants (CONSTANTS,): constants of the hexapod; its masses and friction forces are not used.
    motions (N, MOTION): rows of motion, SI units, base axes.
    bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all. A row of nan: base at
        rest, with the parameter's gravity.
    results (N, 6, LINEAR): written [N per unit of each parameter].
    work (WORK): scratch memory.
    """
    one_base = len(bases) == 1
    size = characteristic_length_of(constants)
    for row in range(len(motions)):
        of = _moving(constants, motions[row], bases[0 if one_base else row])
        for leg in range(6):
            _put_leg(constants, leg, of, work)
            if screws_turn(constants):
                _put_drive(constants, leg, motions[row], work)
        _invert(work)
        for leg in range(6):
            _put_row(of, size, leg, coulomb_velocity_of(constants, leg), work,
                     results[row, leg])
