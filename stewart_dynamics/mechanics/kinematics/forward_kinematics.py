# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Forward kinematics: the pose of six leg lengths, and the twist of six leg rates.

Up to forty poses have the same six lengths (Dietmaier, The Stewart-Gough platform of general
geometry can have 40 real postures, Advances in Robot Kinematics, 1998), so a guess selects
one: the last pose, or the one commanded. Newton's method on ``L(X) = L`` with the exact J_inv
starts there and never steps to where det(J) has the other sign: another assembly is on the other
side of a singularity. Where it does not converge, near singularities, the lengths are led from
those of the guess to those given in parts, along a straight line of their squares (homotopy).
Squares are linear in the position; along a line of the lengths themselves the pose more often
meets a singularity.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.dynamics.hexapod_constants import characteristic_length_of
from stewart_dynamics.mechanics.matrix6 import inverse_and_determinant, Rows
from stewart_dynamics.mechanics.rows import ANGULAR_VELOCITY, LINEAR_VELOCITY, POSITION, ROTATION
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot6, Matrix3, read3, read9, scale, Vector3, Vector6)

# The lengths of a pose that is found differ by at most this from those given [m].
RESIDUAL = 1e-12

# The outcome of a search.
FOUND, NO_POSE, SINGULAR = range(3)

# Newton's method takes at most 6 steps from nearly everywhere (benchmarks/README.md). A step is
# halved if it ends on the other side of a singularity, or increases the sum of squares by this
# factor (a long first step may overshoot and still be the fastest). The method did not converge
# if a step would have to be shorter than this part of it, or after this number of steps.
_FARTHER = 16.0
_LEAST_PART = 1e-3
MOST_STEPS = 50
# The homotopy begins with this part of the way, halves a part that fails down to the least one,
# and ends after this number of steps of Newton's method in all.
_FIRST_PART, _LEAST_WAY, _MOST_STEPS_IN_ALL = 0.25, 1.0 / 256.0, 200


@inlined
def _row(constants: Array, leg: int, position: Vector3, rotation: Matrix3,
         ) -> tuple[float, Vector6]:
    """Return a leg's length and row of J_inv, its right half by the characteristic length."""
    a, length, _, s = leg_line(constants, leg, position, rotation)
    m = scale(1.0 / characteristic_length_of(constants), cross(a, s))
    return length, (s[0], s[1], s[2], m[0], m[1], m[2])


@compiled
def determinant(constants: Array, motion: Array) -> float:
    """Return det(J) at the pose of a row of motion, moments by the characteristic length."""
    position, rotation = read3(motion, POSITION.start), read9(motion, ROTATION.start)
    _, found = inverse_and_determinant(
        _row(constants, 0, position, rotation)[1], _row(constants, 1, position, rotation)[1],
        _row(constants, 2, position, rotation)[1], _row(constants, 3, position, rotation)[1],
        _row(constants, 4, position, rotation)[1], _row(constants, 5, position, rotation)[1])
    return found


@inlined
def _squares(rows: Rows) -> float:
    a, b, c, d, e, f = rows
    return dot6(a, a) + dot6(b, b) + dot6(c, c) + dot6(d, d) + dot6(e, e) + dot6(f, f)


@inlined
def _orthonormal(r: Matrix3) -> Matrix3:
    """Return the rotation nearest to a matrix close to one: R (3 - R^T R) / 2, Newton's step."""
    x, y, z = (r[0], r[3], r[6]), (r[1], r[4], r[7]), (r[2], r[5], r[8])
    xx = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    yy = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    zz = z[0] * z[0] + z[1] * z[1] + z[2] * z[2]
    xy = 0.5 * (x[0] * y[0] + x[1] * y[1] + x[2] * y[2])
    xz = 0.5 * (x[0] * z[0] + x[1] * z[1] + x[2] * z[2])
    yz = 0.5 * (y[0] * z[0] + y[1] * z[1] + y[2] * z[2])
    u, v, w = 1.5 - 0.5 * xx, 1.5 - 0.5 * yy, 1.5 - 0.5 * zz
    return (u * x[0] - xy * y[0] - xz * z[0], v * y[0] - xy * x[0] - yz * z[0],
            w * z[0] - xz * x[0] - yz * y[0],
            u * x[1] - xy * y[1] - xz * z[1], v * y[1] - xy * x[1] - yz * z[1],
            w * z[1] - xz * x[1] - yz * y[1],
            u * x[2] - xy * y[2] - xz * z[2], v * y[2] - xy * x[2] - yz * z[2],
            w * z[2] - xz * x[2] - yz * y[2])


@inlined
def _turned(turn: Vector3, r: Matrix3) -> Matrix3:
    """
    Return R turned about ``turn`` by 2 atan(|turn| / 2): Cayley's map, a rotation exactly.

    The angle is |turn| up to terms of third order, which do not slow Newton's method.
    """
    x, y, z = scale(0.5, turn)
    k = 2.0 / (1.0 + x * x + y * y + z * z)
    c = 1.0 - k * (x * x + y * y + z * z)
    a, b, d = (c + k * x * x, k * (x * y - z), k * (x * z + y))
    e, f, g = (k * (x * y + z), c + k * y * y, k * (y * z - x))
    h, i, j = (k * (x * z - y), k * (y * z + x), c + k * z * z)
    return (a * r[0] + b * r[3] + d * r[6], a * r[1] + b * r[4] + d * r[7],
            a * r[2] + b * r[5] + d * r[8],
            e * r[0] + f * r[3] + g * r[6], e * r[1] + f * r[4] + g * r[7],
            e * r[2] + f * r[5] + g * r[8],
            h * r[0] + i * r[3] + j * r[6], h * r[1] + i * r[4] + j * r[7],
            h * r[2] + i * r[5] + j * r[8])


@compiled
def _newton(constants: Array, lengths: Vector6, guess: Vector3, orientation: Matrix3,
            ) -> tuple[int, int, float, Vector3, Matrix3]:
    """Return code, steps and residual of Newton's method from a guess, and the pose at its end."""
    position, rotation = guess, orientation
    per_size = 1.0 / characteristic_length_of(constants)
    side = 0.0
    # The last pose accepted, its sum of squares and residual, and the step from there.
    from_position, from_rotation, before, residual = position, rotation, math.inf, math.inf
    step, turn, part = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0
    for steps in range(MOST_STEPS):
        l0, r0 = _row(constants, 0, position, rotation)
        l1, r1 = _row(constants, 1, position, rotation)
        l2, r2 = _row(constants, 2, position, rotation)
        l3, r3 = _row(constants, 3, position, rotation)
        l4, r4 = _row(constants, 4, position, rotation)
        l5, r5 = _row(constants, 5, position, rotation)
        error = (lengths[0] - l0, lengths[1] - l1, lengths[2] - l2, lengths[3] - l3,
                 lengths[4] - l4, lengths[5] - l5)
        squares = dot6(error, error)
        (i0, i1, i2, i3, i4, i5), determinant = inverse_and_determinant(r0, r1, r2, r3, r4, r5)
        if squares < _FARTHER * before and side * determinant >= 0.0:
            condition = math.sqrt(_squares((r0, r1, r2, r3, r4, r5))
                                  * _squares((i0, i1, i2, i3, i4, i5)))
            residual = max(abs(error[0]), abs(error[1]), abs(error[2]), abs(error[3]),
                           abs(error[4]), abs(error[5]))
            # By Frobenius norms, at most six times the condition number.
            if not condition < UNSOLVABLE_CONDITION:
                return SINGULAR, steps, residual, position, rotation
            from_position, from_rotation, before, side = position, rotation, squares, determinant
            step = dot6(i0, error), dot6(i1, error), dot6(i2, error)
            turn = scale(per_size, (dot6(i3, error), dot6(i4, error), dot6(i5, error)))
            part = 1.0
        elif residual > RESIDUAL:
            part *= 0.5
            if part < _LEAST_PART:
                return NO_POSE, steps, residual, position, rotation
        # If the residual is small enough this is the last step, to within rounding.
        position = add(from_position, scale(part, step))
        rotation = _turned(scale(part, turn), from_rotation)
        if residual <= RESIDUAL:
            return FOUND, steps, residual, position, rotation
    return NO_POSE, MOST_STEPS, residual, position, rotation


@inlined
def _squares_of_lengths(constants: Array, position: Vector3, rotation: Matrix3) -> Vector6:
    l0 = leg_line(constants, 0, position, rotation)[1]
    l1 = leg_line(constants, 1, position, rotation)[1]
    l2 = leg_line(constants, 2, position, rotation)[1]
    l3 = leg_line(constants, 3, position, rotation)[1]
    l4 = leg_line(constants, 4, position, rotation)[1]
    l5 = leg_line(constants, 5, position, rotation)[1]
    return l0 * l0, l1 * l1, l2 * l2, l3 * l3, l4 * l4, l5 * l5


@inlined
def _between(squares: Vector6, lengths: Vector6, part: float) -> Vector6:
    """Return the lengths whose squares are a part of the way from some squares to those given."""
    return (math.sqrt(squares[0] + part * (lengths[0] * lengths[0] - squares[0])),
            math.sqrt(squares[1] + part * (lengths[1] * lengths[1] - squares[1])),
            math.sqrt(squares[2] + part * (lengths[2] * lengths[2] - squares[2])),
            math.sqrt(squares[3] + part * (lengths[3] * lengths[3] - squares[3])),
            math.sqrt(squares[4] + part * (lengths[4] * lengths[4] - squares[4])),
            math.sqrt(squares[5] + part * (lengths[5] * lengths[5] - squares[5])))


@compiled
def _homotopy(constants: Array, lengths: Vector6, guess: Vector3, orientation: Matrix3,
              ) -> tuple[int, int, float, Vector3, Matrix3]:
    """Return the same as ``_newton`` along a straight line of squared lengths."""
    position, rotation = guess, orientation
    begin = _squares_of_lengths(constants, position, rotation)
    done, way, steps, residual = 0.0, _FIRST_PART, 0, math.inf
    while way >= _LEAST_WAY and steps < _MOST_STEPS_IN_ALL:
        reached = min(done + way, 1.0)
        wanted = lengths if reached == 1.0 else _between(begin, lengths, reached)
        code, taken, residual, to_position, to_rotation = _newton(
            constants, wanted, position, rotation)
        steps += taken
        if code != FOUND:
            way *= 0.5
            continue
        position, rotation = to_position, to_rotation
        if reached == 1.0:
            return FOUND, steps, residual, position, rotation
        done, way = reached, 2.0 * way
    return NO_POSE, steps, residual, position, rotation


@compiled
def pose(constants: Array, lengths: Array, motion: Array) -> tuple[int, int, float]:
    """
    Find the pose of six lengths.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``.
    lengths (6,): [m]
    motion (MOTION,): a row of motion; its first twelve numbers are the guess, and the pose when it
        is found.
    Returns FOUND, NO_POSE or SINGULAR; the steps taken; the largest difference in length [m].
    """
    guess = read3(motion, POSITION.start)
    # Twice, as a guess may be 1e-6 off; rounding errors do not add up from pose to pose.
    orientation = _orthonormal(_orthonormal(read9(motion, ROTATION.start)))
    wanted = lengths[0], lengths[1], lengths[2], lengths[3], lengths[4], lengths[5]
    code, steps, residual, position, rotation = _newton(constants, wanted, guess, orientation)
    if code == NO_POSE:
        code, more, last, position, rotation = _homotopy(constants, wanted, guess, orientation)
        steps += more
        residual = last if code == FOUND else residual
    if code == FOUND:
        for n in range(3):
            motion[POSITION.start + n] = position[n]
        for n in range(9):
            motion[ROTATION.start + n] = rotation[n]
    return code, steps, residual


@compiled
def twist(constants: Array, rates: Array, motion: Array) -> None:
    """Write into a row of motion (MOTION,) the twist of leg rates (6,) [m/s]."""
    position = read3(motion, POSITION.start)
    rotation = read9(motion, ROTATION.start)
    inverse, _ = inverse_and_determinant(
        _row(constants, 0, position, rotation)[1], _row(constants, 1, position, rotation)[1],
        _row(constants, 2, position, rotation)[1], _row(constants, 3, position, rotation)[1],
        _row(constants, 4, position, rotation)[1], _row(constants, 5, position, rotation)[1])
    rate = rates[0], rates[1], rates[2], rates[3], rates[4], rates[5]
    per_size = 1.0 / characteristic_length_of(constants)
    for n in range(3):
        motion[LINEAR_VELOCITY.start + n] = dot6(inverse[n], rate)
        motion[ANGULAR_VELOCITY.start + n] = per_size * dot6(inverse[3 + n], rate)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'i8[::1]', 'i8[::1]', 'f8[::1]')
def poses(constants: Array, lengths: Array, motions: Array, codes: Integers, steps: Integers,
          residuals: Array) -> None:
    """Find the poses of lengths (N, 6), see ``pose``; the rest is (N, MOTION) and (N,)."""
    for n in range(len(motions)):
        codes[n], steps[n], residuals[n] = pose(constants, lengths[n], motions[n])


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]')
def twists(constants: Array, rates: Array, motions: Array) -> None:
    """Write into motions (N, MOTION) the twists of leg rates (N, 6)."""
    for n in range(len(motions)):
        twist(constants, rates[n], motions[n])
