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
Travel of the platform along a line or about an axis until the first limit; compiled.

The platform moves from a pose by ``t`` times a direction ``[v; w]``: its pivot by ``t v``, and it
turns by the rotation vector ``t w``, base axes. The end ``l_i(t)`` of each leg then moves as

    l = A + t v + B cos(|w| t) + C sin(|w| t)

with constant vectors A, B, C of the leg, so that its speed and acceleration are bounded by
``V = |v| + |w| |B|`` and ``|w|^2 |B|``. Every limit is a function ``g(t) >= 0`` whose second
derivative is bounded from below by such numbers: ``g(t + h) >= g + g' h - k h^2 / 2``. The largest
``h`` that keeps this bound positive is a safe step: steps never pass a root, and converge to the
first one quadratically, like Newton's method. So a limit that is left and entered again is not
jumped over. Only along a limit, where safe steps would be too small to get ahead, a part in which
it is exceeded by no more than 1e-10 may be passed. Lengths of a travel that only moves or only
turns have a closed form.

The condition number of J_inv ends the travel as well. Singular values of a matrix change by no
more than the norm of its change (Golub and Van Loan, Matrix Computations, 4th ed., 8.6.2), which
is bounded as above: each evaluation clears an interval around it. Where such an interval is
shorter than 1e-7 of the hexapod's size over its speed, the root is bracketed by the margin and the
sign of det(J) instead.

The clearance of two legs, or of a leg and a plate, is at least ``n . (p - q)`` of all corners p
and q of the two (``clearance_bounds``), whose second derivatives are bounded: safe steps again,
and where they are as short the root is bracketed in the same way.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.clearance_bounds import (
    ARM, BASE_JOINT, BODIES, bodies, Body, corner_pair, CYLINDER, follow, FOLLOWING, MORE, OF_LEG,
    PLATES, PLATFORM_JOINT, RATES, ROTATING, shortest, STAYING, STILL, TURNING)
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, joints_of)
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE, PLATFORM
from stewart_dynamics.mechanics.matrix6 import (
    gram, inverse_and_determinant, laguerre_step, Symmetric, tridiagonal)
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, read9, rotate, scale, subtract, Vector3, Vector6)

(LENGTH_MIN, LENGTH_MAX, BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX, CLEARANCE_MIN, SINGULARITY,
 NOTHING) = range(7)
"""Codes of the limit that ends a travel."""
SCRATCH = 6 + PLATES + MORE
"""Rows of scratch memory: six legs, and their corners for the clearance; more for plates."""

# The constants of a leg: A, B, C, speed V and reach |B| of its platform joint; the axis of the
# base joint; three parts each (kept, by cos, by sin) of the platform joint's axis and of its arm
# R p; as scratch, a row of dJ/dt and a row of J^-1, J the scaled J_inv; and the center of rotation
# from the base joint.
_A, _B, _C, _SPEED, _REACH, _BASE_AXIS, _PLATFORM_AXIS, _ARM = 0, 3, 6, 9, 10, 11, 14, 23
_ROW_RATE, _INVERSE, _CENTER, LEG = 32, 38, 44, 47
# A value within this of its limit, relative to the limit's own size, is on it.
_ROUNDING = 1e-12
# Steps end below this part of the way so far, or of the hexapod's size.
_EXACT = 1e-16
# Steps along a limit may pass a part where it is exceeded by no more than this, relative.
_SHALLOW = 1e-10
_MOST_STEPS, _MOST_STEPS_OF_LEG = 20_000, 1_000_000
# Bounds of the second derivative of J_inv hold while a leg is longer than this part of its length.
_SHORTER = 0.8
# Condition number and clearance are certified by intervals down to this part of the size.
_NARROW = 1e-7
# Some clearances stay the same along a travel: rounding errors are below this part of the size.
_EXACT_CLEARANCE = 1e-14
# Other directions are tried where a step is below this part of it.
_NEAR = 0.01
# Bound of |s''| / (|l'| / |l|)^2 of a unit vector s = l / |l| with l'' = 0: 2 / sqrt(3), and more.
BEND = 1.2


@inlined
def put6(array: Array, at: int, a: Vector6) -> None:
    """Write six numbers; at an index that varies an exception would remain possible."""
    array[at], array[at + 1], array[at + 2] = a[0], a[1], a[2]
    array[at + 3], array[at + 4], array[at + 5] = a[3], a[4], a[5]


@inlined
def _turned(array: Array, at: int, cosine: float, sine: float) -> Vector3:
    """Return the vector of three parts (kept, by cos, by sin) that begin at a place."""
    return (array[at] + cosine * array[at + 3] + sine * array[at + 6],
            array[at + 1] + cosine * array[at + 4] + sine * array[at + 7],
            array[at + 2] + cosine * array[at + 5] + sine * array[at + 8])


@inlined
def _change(array: Array, at: int, cosine: float, sine: float) -> Vector3:
    """Return the derivative of that vector by the angle."""
    return (cosine * array[at + 6] - sine * array[at + 3],
            cosine * array[at + 7] - sine * array[at + 4],
            cosine * array[at + 8] - sine * array[at + 5])


@inlined
def _put_turning(leg: Array, at: int, turns: bool, axis: Vector3, a: Vector3) -> None:
    """Write the parts of a vector that a rotation about an axis keeps, and turns by cos, sin."""
    along = scale(dot(axis, a), axis) if turns else a
    put3(leg, at, along)
    put3(leg, at + 3, subtract(a, along))
    put3(leg, at + 6, cross(axis, a))


@compiled
def _prepare(constants: Array, axes: Array, pose: Array, direction: Array, pivot: Array,
             legs: Array) -> None:
    """Write the constants of the six legs (6, LEG)."""
    position, rotation = read3(pose, POSITION.start), read9(pose, ROTATION.start)
    velocity, turn = read3(direction, 0), read3(direction, 3)
    rate = norm(turn)
    turns = rate > 0.0
    axis = scale(1.0 / rate if turns else 0.0, turn)
    center = add(position, rotate(rotation, read3(pivot, 0)))
    for n in range(6):
        leg = legs[n]
        base_joint, platform_joint = joints_of(constants, n)
        arm = rotate(rotation, subtract(platform_joint, read3(pivot, 0)))
        _put_turning(leg, _A, turns, axis, arm)
        leg[_REACH] = norm(read3(leg, _B))
        leg[_SPEED] = norm(velocity) + rate * leg[_REACH]
        put3(leg, _CENTER, subtract(center, base_joint))
        put3(leg, _A, add(read3(leg, _CENTER), read3(leg, _A)))
        put3(leg, _BASE_AXIS, read3(axes[n], 0))
        _put_turning(leg, _PLATFORM_AXIS, turns, axis, rotate(rotation, read3(axes[6 + n], 0)))
        _put_turning(leg, _ARM, turns, axis, rotate(rotation, platform_joint))


@compiled
def _safe_step(value: float, slope: float, curvature: float) -> float:
    """Return the largest h with value + slope h - curvature h^2 / 2 >= 0 on all of [0, h]."""
    if curvature <= 0.0:
        return -value / slope if slope < 0.0 else math.inf
    if value <= 0.0 and slope <= 0.0:
        return 0.0
    root = math.sqrt(slope * slope + 2.0 * curvature * value)
    return (slope + root) / curvature if slope > 0.0 else 2.0 * value / (root - slope)


@compiled
def _line(leg: Array, velocity: Vector3, rate: float, t: float) -> tuple[Vector3, Vector3]:
    """Return the leg's vector l and its derivative by t."""
    cosine, sine = math.cos(rate * t), math.sin(rate * t)
    return (add(_turned(leg, _A, cosine, sine), scale(t, velocity)),
            add(scale(rate, _change(leg, _A, cosine, sine)), velocity))


@compiled
def _quadratic_exit(c0: float, b: float, c2: float) -> tuple[float, float]:
    """Return u as a fraction where c0 - 2 b u + c2 u^2, c0 >= 0, falls below zero; both >= 0."""
    root = math.sqrt(max(b * b - c0 * c2, 0.0))
    return (c0, b + root) if b >= 0.0 else (root - b, -c2)


@compiled
def _end_of_length(leg: Array, velocity: Vector3, rate: float, bound: float, longest: bool,
                   end: float) -> float:
    """
    Return the first t in [0, end] at which a leg leaves a bound of its length, or end.

    Closed: the square of the length is a parabola along a line, and a harmonic about an axis,
    which is a parabola of tan(rate t / 2).
    """
    sign = 1.0 if longest else -1.0
    line, _ = _line(leg, velocity, rate, 0.0)
    length = norm(line)
    value = sign * (bound - length) * (bound + length)
    exact = _ROUNDING * bound * bound
    if value < -exact:
        return 0.0
    value = max(value, 0.0)
    if rate == 0.0:
        b, c2 = sign * dot(line, velocity), -sign * dot(velocity, velocity)
        if not longest and (b <= 0.0 or value - b * b / c2 >= -exact):
            return end
        above, below = _quadratic_exit(value, b, c2)
        return min(above / below, end) if above > 0.0 else 0.0
    a = 2.0 * sign * dot(read3(leg, _A), read3(leg, _B))
    b = 2.0 * sign * dot(line, read3(leg, _C))
    amplitude = math.hypot(a, b)
    deepest = amplitude - a if a <= 0.0 else b * b / (amplitude + a)
    if value - deepest >= -exact:
        return end
    above, below = _quadratic_exit(value, b, value + 2.0 * a)
    return min(2.0 * math.atan2(above, below) / rate, end)


@compiled
def _of_length(leg: Array, velocity: Vector3, rate: float, bound: float, longest: bool, t: float,
               ) -> tuple[float, float, float, float]:
    """Return the margin of a length, its slope, its curvature, and the step for which it holds."""
    curving = rate * rate * leg[_REACH]
    speed = leg[_SPEED]
    line, change = _line(leg, velocity, rate, t)
    length = norm(line)
    sign = 1.0 if longest else -1.0
    scaling = 1.0 / (bound * bound)
    value = sign * scaling * (bound - length) * (bound + length)
    slope = -2.0 * sign * scaling * dot(line, change)
    if longest:
        return value, slope, 2.0 * scaling * (speed * speed + curving * bound), math.inf
    # while it moves by no more than its length, it is shorter than twice of it
    return value, slope, 4.0 * scaling * curving * length, length / speed


@compiled
def _of_angle(leg: Array, velocity: Vector3, rate: float, bound: float, at_platform: bool,
              t: float) -> tuple[float, float, float, float]:
    """Return the margin of an angle, its slope, its curvature, and the step for which it holds."""
    speed = leg[_SPEED]
    line, change = _line(leg, velocity, rate, t)
    length = norm(line)
    inverse = 1.0 / length
    s = scale(inverse, line)
    s_change = scale(inverse, subtract(change, scale(dot(s, change), s)))
    # over a step of half the leg's length it stays longer than half of it
    swing = 2.0 * speed * inverse
    curvature = 2.0 * rate * rate * leg[_REACH] * inverse + 3.0 * swing * swing
    if at_platform:
        cosine, sine = math.cos(rate * t), math.sin(rate * t)
        axis = _turned(leg, _PLATFORM_AXIS, cosine, sine)
        slope = dot(axis, s_change) + rate * dot(_change(leg, _PLATFORM_AXIS, cosine, sine), s)
        curvature += 2.0 * rate * swing + rate * rate
    else:
        axis = read3(leg, _BASE_AXIS)
        slope = dot(axis, s_change)
    return (dot(axis, s) - math.cos(bound), slope, curvature,
            0.5 * length / max(speed, _ROUNDING * rate * length))


@compiled
def _of_leg(leg: Array, velocity: Vector3, rate: float, bound: float, code: int, t: float,
            ) -> tuple[float, float, float, float]:
    if code <= LENGTH_MAX:
        return _of_length(leg, velocity, rate, bound, code == LENGTH_MAX, t)
    return _of_angle(leg, velocity, rate, bound, code == PLATFORM_ANGLE_MAX, t)


@compiled
def _end_of_leg(leg: Array, velocity: Vector3, rate: float, bound: float, code: int, end: float,
                ) -> float:
    """
    Return the first t in [0, end] at which a leg exceeds a limit, or end.

    Minus the t up to which it does not, where the steps do not decide it.
    """
    if code <= LENGTH_MAX and (rate == 0.0 or dot(velocity, velocity) == 0.0):
        return _end_of_length(leg, velocity, rate, bound, code == LENGTH_MAX, end)
    t = before = 0.0
    for _ in range(_MOST_STEPS_OF_LEG):
        value, slope, curvature, most = _of_leg(leg, velocity, rate, bound, code, t)
        if not value >= -_ROUNDING:
            break
        step = _safe_step(max(value, 0.0), slope, curvature)
        if curvature > 0.0:
            # along a limit, or close to it, the safe steps are too small to get ahead
            shallow = math.sqrt(8.0 * _SHALLOW / curvature)
            if slope > -curvature * shallow:
                step = max(step, shallow)
            # the time in which the margin can change by its whole size
            if not step > _EXACT * (t + 1.0 / math.sqrt(curvature)):
                return t
        elif not step > 0.0:
            return t
        before, t = t, t + min(step, most)
        if t >= end:
            if end < math.inf:
                value, _, _, _ = _of_leg(leg, velocity, rate, bound, code, end)
            if value >= -_ROUNDING:
                return end
            t = end
            break
    else:
        return -t
    low, high = before, t
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        value, _, _, _ = _of_leg(leg, velocity, rate, bound, code, middle)
        if value >= 0.0:
            low = middle
        else:
            high = middle
    return low


@compiled
def _prepare_plates(constants: Array, base: Array, platform: Array, pose: Array,
                    direction: Array, pivot: Array, corners: Array) -> None:
    """Write the constant numbers of the corners of the plates."""
    turn = corners[len(corners) - 2]
    put3(turn, RATES, read3(direction, 3))
    rotation = read9(pose, ROTATION.start)
    farthest = 0.0
    for n in range(len(base)):
        corner = corners[PLATES + n]
        put3(corner, 0, read3(base[n], 0))
        put3(corner, RATES, (0.0, 0.0, 0.0))
        corner[STILL] = 0.0
    for n in range(len(platform)):
        arm = rotate(rotation, subtract(read3(platform[n], 0), read3(pivot, 0)))
        corner = corners[PLATES + len(base) + n]
        put3(corner, ARM, arm)
        corner[TURNING] = 0.0
        farthest = max(farthest, norm(arm))
    # the speed of the platform's plate, and the step for which bounds of TURNING hold
    speed = norm(read3(direction, 0))
    turn[STILL] = speed + norm(read3(direction, 3)) * farthest
    turn[TURNING] = (math.inf if speed == 0.0 or norm(read3(direction, 3)) == 0.0 else
                     characteristic_length_of(constants) / speed)


@compiled
def _put_leg(constants: Array, shapes: Array, legs: Array, corners: Array, velocity: Vector3,
             rate: float, n: int, t: float) -> float:
    """Write the corners of a leg; return the step for which their bounds hold."""
    leg = legs[n]
    base_joint, _ = joints_of(constants, n)
    size, speed = characteristic_length_of(constants), norm(velocity)
    line, change = _line(leg, velocity, rate, t)
    length = norm(line)
    inverse = 1.0 / length if length > 0.0 else math.inf
    s = scale(inverse, line) if length > 0.0 else line
    s_change = scale(inverse, subtract(change, scale(dot(s, change), s)))
    away = norm(add(read3(leg, _CENTER), scale(t, velocity)))
    turning = rate * (rate * (away + size) + 2.0 * speed)
    # over a step of half the leg's length it stays longer than half of it
    swing = 2.0 * leg[_SPEED] * inverse
    bend = 2.0 * rate * rate * leg[_REACH] * inverse + BEND * swing * swing
    cylinder = shapes[n, 1]
    for place in range(OF_LEG):
        corner = corners[OF_LEG * n + place]
        if place == BASE_JOINT:
            put3(corner, 0, base_joint)
            put3(corner, RATES, (0.0, 0.0, 0.0))
            corner[STILL], corner[TURNING] = 0.0, turning
        elif place == PLATFORM_JOINT or (place == CYLINDER and length <= cylinder):
            put3(corner, 0, add(base_joint, line))
            put3(corner, RATES, change)
            corner[STILL], corner[TURNING] = rate * rate * leg[_REACH], 0.0
        else:
            put3(corner, 0, add(base_joint, scale(cylinder, s)))
            put3(corner, RATES, scale(cylinder, s_change))
            corner[STILL] = cylinder * bend
            corner[TURNING] = turning + cylinder * (bend + rate * (2.0 * swing + rate))
    longest: float = 0.5 * length / max(leg[_SPEED], _ROUNDING * rate * length)
    return longest


@compiled
def _put_plate(constants: Array, legs: Array, corners: Array, base_corners: int,
               velocity: Vector3, rate: float, plate: int, t: float) -> None:
    """Write the corners of a plate."""
    joint, _ = joints_of(constants, 0)
    center = add(joint, add(read3(legs[0], _CENTER), scale(t, velocity)))
    if plate == BASE:
        size = characteristic_length_of(constants)
        for n in range(base_corners):
            corner = corners[PLATES + n]
            away = norm(subtract(center, read3(corner, 0)))
            corner[TURNING] = rate * (rate * (away + size) + 2.0 * norm(velocity))
        return
    turn = read3(corners[len(corners) - 2], RATES)
    axis = scale(1.0 / rate if rate > 0.0 else 0.0, turn)
    cosine, sine = math.cos(rate * t), math.sin(rate * t)
    for n in range(PLATES + base_corners, len(corners) - MORE):
        corner = corners[n]
        arm = read3(corner, ARM)
        along = scale(dot(axis, arm), axis)
        turned = add(along, add(scale(cosine, subtract(arm, along)),
                                scale(sine, cross(axis, arm))))
        put3(corner, 0, add(center, turned))
        put3(corner, RATES, add(velocity, cross(turn, turned)))
        corner[STILL] = rate * rate * norm(arm)


@compiled
def _step_of_bodies(corners: Array, a: Body, b: Body, n: Vector3, limit: float, how: int,
                    ) -> float:
    """Return the step for which two bodies are at least ``limit`` apart along n."""
    follow(corners, a, b, n, 1, how)
    follows = read3(corners[len(corners) - 1], RATES)
    turned = norm(follows)
    step: float = (corners[len(corners) - 2, TURNING] if how == ROTATING else
                   1.0 / turned if turned > 0.0 else math.inf)
    rest = TURNING if how == ROTATING else STILL
    for p in range(a[0], a[2], a[1]):
        for q in range(b[0], b[2], b[1]):
            gap = dot(n, subtract(read3(corners[p], 0), read3(corners[q], 0))) - limit
            moved, slope = corner_pair(corners, p, q, n, 0)
            bend = corners[p, rest] + corners[q, rest]
            if how == FOLLOWING:
                # n is no longer than sqrt(2) over the step
                bend = 2.0 * (bend - dot(follows, moved)) + max(limit, 0.0) * turned * turned
            step = min(step, _safe_step(max(gap, 0.0), slope, bend))
    return step


@compiled
def _room(constants: Array, shapes: Array, legs: Array, corners: Array, base_corners: int,
          velocity: Vector3, rate: float, bound: float, i: int, j: int, t: float,
          ) -> tuple[float, float]:
    """Return the margin of the clearance of a leg and a leg or plate, and the step it clears."""
    longest = _put_leg(constants, shapes, legs, corners, velocity, rate, i, t)
    if j < 6:
        longest = min(longest, _put_leg(constants, shapes, legs, corners, velocity, rate, j, t))
    else:
        _put_plate(constants, legs, corners, base_corners, velocity, rate, j, t)
    margin, step = math.inf, longest
    for pair in range(BODIES):
        given, a, b, radii = bodies(shapes, corners, base_corners, i, j, pair)
        if not given:
            continue
        vector = shortest(corners, a, b)
        distance = norm(vector)
        margin = min(margin, distance - radii - bound)
        n = scale(1.0 / distance if distance > 0.0 else 0.0, vector)
        if distance == 0.0:
            step = 0.0
            continue
        clear = _step_of_bodies(corners, a, b, n, radii + bound, FOLLOWING)
        if clear * _approach(legs, corners, i, j) < _NEAR * characteristic_length_of(constants):
            clear = max(clear, _step_of_bodies(corners, a, b, n, radii + bound, STAYING),
                        _step_of_bodies(corners, a, b, n, radii + bound, ROTATING))
        step = min(step, clear)
    return margin, step


@inlined
def _approach(legs: Array, corners: Array, i: int, j: int) -> float:
    """Return the largest speed at which a leg and a leg or plate approach each other."""
    speed: float = legs[i, _SPEED] + (
        legs[j, _SPEED] if j < 6 else corners[len(corners) - 2, STILL] if j == PLATFORM else 0.0)
    return speed


@compiled
def _end_of_clearance(constants: Array, shapes: Array, legs: Array, corners: Array,
                      base_corners: int, velocity: Vector3, rate: float, bound: float, i: int,
                      j: int, end: float) -> float:
    """
    Return the first t in [0, end] at which a leg and a leg or plate are too near, or end.

    Minus the t up to which it is proven not to be so, where the steps do not decide it.
    """
    size = characteristic_length_of(constants)
    bound -= _EXACT_CLEARANCE * size
    margin, step = _room(
        constants, shapes, legs, corners, base_corners, velocity, rate, bound, i, j, 0.0)
    if margin < -_ROUNDING * size:
        return 0.0
    narrow = _NARROW * size / max(_approach(legs, corners, i, j), _ROUNDING * rate * size)
    t = 0.0
    for _ in range(2000 * _MOST_STEPS):
        if step > narrow:
            t += step
            if t >= end:
                return end
            margin, step = _room(
                constants, shapes, legs, corners, base_corners, velocity, rate, bound, i, j, t)
            continue
        if t >= end:
            return end
        margin, step = _room(
            constants, shapes, legs, corners, base_corners, velocity, rate, bound, i, j,
            t + narrow)
        if margin < 0.0:
            break  # the root is between the two
        t += narrow
    else:
        return -t
    low, high = t, t + narrow
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        margin, _ = _room(
            constants, shapes, legs, corners, base_corners, velocity, rate, bound, i, j, middle)
        if margin >= 0.0:
            low = middle
        else:
            high = middle
    return min(low, end)


@compiled
def largest_eigenvalue(g: Symmetric) -> float:
    """Return the largest eigenvalue of a Gram matrix."""
    trace = g[0][0] + g[1][0] + g[2][0] + g[3][0] + g[4][0] + g[5][0]
    k = 1.0 / trace
    t = tridiagonal(g)
    kk = k * k
    scaled = (k * t[0], k * t[1], k * t[2], k * t[3], k * t[4], k * t[5], kk * t[6], kk * t[7],
              kk * t[8], kk * t[9], kk * t[10])
    x = 1.0 + 1e-14
    for _ in range(64):
        nearer = laguerre_step(x, scaled)
        if nearer == x:
            break
        x = nearer
    return x * trace


@compiled
def _margin(constants: Array, legs: Array, velocity: Vector3, rate: float, stop: float, t: float,
            ) -> tuple[float, float, float]:
    """
    Return the margin to a condition number, the step that it clears on both sides, and det(J).

    With J the scaled J_inv, the margin is ``smallest - largest / stop`` of its singular values.
    At t + h the matrix is ``J (1 + h J^-1 J') + R``, ``|R| <= k h^2 / 2``: so the smallest value
    is at least ``smallest (1 - h |J^-1 J'|) - |R|``, the largest at most
    ``largest + h |J'| + |R|``.
    The bound k of J'' holds while no leg is shorter than _SHORTER of its length at t.
    """
    inverse_size = 1.0 / characteristic_length_of(constants)
    cosine, sine = math.cos(rate * t), math.sin(rate * t)
    bending = squares = quickest = 0.0
    r0 = r1 = r2 = r3 = r4 = r5 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for n in range(6):
        leg = legs[n]
        line, change = _line(leg, velocity, rate, t)
        inverse_length = 1.0 / norm(line)
        s = scale(inverse_length, line)
        s_rate = scale(inverse_length, subtract(change, scale(dot(s, change), s)))
        arm = scale(inverse_size, _turned(leg, _ARM, cosine, sine))
        arm_rate = scale(inverse_size * rate, _change(leg, _ARM, cosine, sine))
        moment = cross(arm, s)
        moment_rate = add(cross(arm_rate, s), cross(arm, s_rate))
        squares += dot(s_rate, s_rate) + dot(moment_rate, moment_rate)
        put3(leg, _ROW_RATE, s_rate)
        put3(leg, _ROW_RATE + 3, moment_rate)
        swing = leg[_SPEED] * inverse_length
        quickest = max(quickest, swing)
        swing /= _SHORTER
        curve = rate * rate * leg[_REACH] * inverse_length / _SHORTER + 3.0 * swing * swing
        reach = norm(arm)
        moment_curve = reach * (rate * rate + 2.0 * rate * swing + curve)
        bending += curve * curve + moment_curve * moment_curve
        row = s[0], s[1], s[2], moment[0], moment[1], moment[2]
        if n == 0:
            r0 = row
        elif n == 1:
            r1 = row
        elif n == 2:
            r2 = row
        elif n == 3:
            r3 = row
        elif n == 4:
            r4 = row
        else:
            r5 = row
    inverse, determinant = inverse_and_determinant(r0, r1, r2, r3, r4, r5)
    largest = math.sqrt(largest_eigenvalue(gram(r0, r1, r2, r3, r4, r5)))
    smallest = 1.0 / math.sqrt(largest_eigenvalue(gram(
        inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5])))
    put6(legs[0], _INVERSE, inverse[0])
    put6(legs[1], _INVERSE, inverse[1])
    put6(legs[2], _INVERSE, inverse[2])
    put6(legs[3], _INVERSE, inverse[3])
    put6(legs[4], _INVERSE, inverse[4])
    put6(legs[5], _INVERSE, inverse[5])
    relative = 0.0
    for row_of_inverse in range(6):
        for column in range(6):
            product = 0.0
            for n in range(6):
                product += legs[row_of_inverse, _INVERSE + n] * legs[n, _ROW_RATE + column]
            relative += product * product
    margin = smallest - largest / stop
    step = _safe_step(
        max(margin, 0.0), -smallest * math.sqrt(relative) - math.sqrt(squares) / stop,
        math.sqrt(bending) * (1.0 + 1.0 / stop))
    return margin, min(step, (1.0 - _SHORTER) / quickest), determinant


@compiled
def _end_of_condition(constants: Array, legs: Array, velocity: Vector3, rate: float, stop: float,
                      end: float) -> float:
    """
    Return the first t in [0, end] at which the condition number is ``stop``, or end.

    Far away, where the steps do not decide it, the t up to which it is proven not to be so.
    """
    margin, width, side = _margin(constants, legs, velocity, rate, stop, 0.0)
    if margin <= 0.0:
        return 0.0
    fastest = 0.0
    for n in range(6):
        fastest = max(fastest, legs[n, _SPEED])
    narrow = _NARROW * characteristic_length_of(constants) / fastest
    t = width  # the margin is positive before it
    for _ in range(_MOST_STEPS):
        if t >= end:
            return end
        # The next interval is cleared from its middle, where it reaches back to the last one.
        middle = t + max(min(0.9 * width, 0.5 * (end - t)), narrow)
        margin, cleared, sign = _margin(constants, legs, velocity, rate, stop, middle)
        inside = margin > 0.0 and sign * side > 0.0
        if inside and (middle - cleared <= t or width <= narrow):
            width, t = cleared, middle + cleared
        elif width > narrow:
            width = 0.5 * max(min(width, cleared), narrow) if inside else 0.25 * width
        else:
            break  # the root is between t and the middle
    low, high = t, t + narrow
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        margin, _, sign = _margin(constants, legs, velocity, rate, stop, middle)
        if margin > 0.0 and sign * side > 0.0:
            low = middle
        else:
            high = middle
    return min(low, end)


@compiled
def _travel(constants: Array, bounds: Array, shapes: Array, base_corners: int, stop: float,
            legs: Array, direction: Array) -> tuple[float, int, int]:
    """Return t at the first limit, nan if not decided, its code, and the leg (-1: none)."""
    velocity = read3(direction, 0)
    rate = norm(read3(direction, 3))
    # a platform that only turns is back at its pose after one turn
    whole = 2.0 * math.pi / rate if norm(velocity) == 0.0 else math.inf
    end, limit, leg = whole, NOTHING, -1
    proven, undecided, its = math.inf, NOTHING, -1
    for code in (LENGTH_MAX, LENGTH_MIN, BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX):
        for n in range(6):
            bound = bounds[code, n]
            limited = (bound > 0.0 if code == LENGTH_MIN else
                       bound < (math.inf if code == LENGTH_MAX else math.pi))
            if limited:
                t = _end_of_leg(legs[n], velocity, rate, bound, code, min(end, proven))
                if t < 0.0:
                    proven, undecided, its = -t, code, n
                elif t < min(end, proven):
                    end, limit, leg = t, code, n
    t = _end_of_condition(constants, legs, velocity, rate, stop, min(end, proven))
    if t < 0.0:
        proven, undecided, its = -t, SINGULARITY, -1
    elif t < min(end, proven):
        end, limit, leg = t, SINGULARITY, -1
    if bounds[CLEARANCE_MIN, 0] > -math.inf:
        for i in range(6):
            for j in range(i + 1, 8):
                if (j == BASE and base_corners == 0) or (
                        j == PLATFORM and len(legs) == SCRATCH + base_corners):
                    continue
                t = _end_of_clearance(constants, shapes, legs, legs[6:], base_corners, velocity,
                                      rate, bounds[CLEARANCE_MIN, 0], i, j, min(end, proven))
                if t < 0.0:
                    proven, undecided, its = -t, CLEARANCE_MIN, i
                elif t < min(end, proven):
                    end, limit, leg = t, CLEARANCE_MIN, i
    if proven < end:
        return math.nan, undecided, its
    if limit == NOTHING:
        end = math.inf
    return end, limit, leg


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'i8[::1]', 'i8[::1]', 'f8[:,::1]')
def travels(constants: Array, axes: Array, bounds: Array, shapes: Array, base: Array,
            platform: Array, stop: float, poses: Array, directions: Array, pivots: Array,
            values: Array, limits: Integers, legs: Integers, work: Array) -> None:
    """
    Write the largest travel from each pose in its direction.

    Parameters
    ----------
    constants : (CONSTANTS,)
        Constants of the hexapod, see ``hexapod_constants``.
    axes : (12, 3)
        Axes of the joints, see ``joint_angles``; not read where an angle has no bound.
    bounds : (5, 6)
        Bounds of each leg by code: shortest and longest length [m], largest angles of base and
        platform joint [rad], smallest clearance [m], the same for all; 0, infinity and minus
        infinity where there is no bound.
    shapes : (6, 3)
        As in ``leg_clearance``; not read where the clearance has no bound.
    base, platform : (M, 3)
        Corners of the plates, likewise.
    stop : float
        Condition number that ends a travel.
    poses : (N, MOTION)
        Rows of motion, of which the pose is read.
    directions : (N, 6)
        Directions [v; w], base axes, not zero.
    pivots : (N, 3)
        Centers of rotation, platform frame [m].
    values, limits, legs : (N,)
        Written: multiple of the direction until the first limit, its code, and the leg, of two
        legs that are too near the first; infinity, NOTHING and -1 if nothing limits, leg -1 at a
        singularity. nan where the bounded number of steps does not decide whether a limit is
        exceeded, with that limit.
    work : (SCRATCH + corners of the plates, LEG)
        Scratch memory.

    """
    for n in range(len(poses)):
        _prepare(constants, axes, poses[n], directions[n], pivots[n], work)
        _prepare_plates(
            constants, base, platform, poses[n], directions[n], pivots[n], work[6:])
        values[n], limits[n], legs[n] = _travel(
            constants, bounds, shapes, len(base), stop, work, directions[n])
