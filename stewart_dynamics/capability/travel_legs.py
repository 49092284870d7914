# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Lengths and joint angles of the legs along a travel, until the first limit; compiled.

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
"""

from __future__ import annotations

import math
from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, inlined
from stewart_dynamics.mechanics.dynamics.hexapod_constants import joints_of
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, read9, rotate, scale, subtract, Vector3)

LENGTH_MIN, LENGTH_MAX, BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX = range(4)
"""Codes of the limits of a leg."""

# Columns of a leg. Vectors that turn with the platform have three parts: kept, by cos, by sin.
# The leg's own are A, B, C; then the platform joint's axis, and the arm R p of the joint.
_LINE, _PLATFORM_AXIS, ARM = 0, 9, 18
# Center of rotation from the base joint, and the base joint's axis.
CENTER, _BASE_AXIS = 27, 30
# Bounds of speed V and reach |B| of the platform joint.
SPEED, REACH, LEG = 33, 34, 35
ROUNDING = 1e-12  # a value within this of its limit, relative to the limit's own size, is on it
NARROW = 1e-7
"""Condition number and clearance are proven in intervals down to this part of the size."""
# Steps end below this part of the way so far, or of the hexapod's size.
_EXACT = 1e-16
# Steps along a limit may pass a part where it is exceeded by no more than this, relative.
_SHALLOW = 1e-10
_MOST_STEPS = 1_000_000


class Way(NamedTuple):
    """The direction of a travel."""

    velocity: Vector3  # v
    turn: Vector3  # w
    rate: float  # |w|
    axis: Vector3  # w / |w|, zeros where it does not turn


class _Margin(NamedTuple):
    """How far a leg is from a limit."""

    value: float
    slope: float
    curvature: float  # bound of the second derivative, from below, with the other sign
    holds: float  # step for which the curvature holds


@inlined
def way_of(direction: Array) -> Way:
    """Return the way of a direction (6,)."""
    turn = read3(direction, 3)
    rate = norm(turn)
    return Way(read3(direction, 0), turn, rate, scale(1.0 / rate if rate > 0.0 else 0.0, turn))


@inlined
def turned(array: Array, at: int, cosine: float, sine: float) -> Vector3:
    """Return the vector of three parts (kept, by cos, by sin) that begin at a place."""
    return (array[at] + cosine * array[at + 3] + sine * array[at + 6],
            array[at + 1] + cosine * array[at + 4] + sine * array[at + 7],
            array[at + 2] + cosine * array[at + 5] + sine * array[at + 8])


@inlined
def turning(array: Array, at: int, cosine: float, sine: float) -> Vector3:
    """Return the derivative of that vector by the angle."""
    return (cosine * array[at + 6] - sine * array[at + 3],
            cosine * array[at + 7] - sine * array[at + 4],
            cosine * array[at + 8] - sine * array[at + 5])


@inlined
def _put_turning(leg: Array, at: int, way: Way, a: Vector3) -> None:
    """Write the parts of a vector that a rotation about an axis keeps, and turns by cos, sin."""
    along = scale(dot(way.axis, a), way.axis) if way.rate > 0.0 else a
    put3(leg, at, along)
    put3(leg, at + 3, subtract(a, along))
    put3(leg, at + 6, cross(way.axis, a))


@compiled
def prepare_legs(constants: Array, axes: Array, pose: Array, way: Way, pivot: Array, legs: Array,
                 ) -> None:
    """Write the constants of the six legs (6, LEG)."""
    position, rotation = read3(pose, POSITION.start), read9(pose, ROTATION.start)
    center = add(position, rotate(rotation, read3(pivot, 0)))
    for n in range(6):
        leg = legs[n]
        base_joint, platform_joint = joints_of(constants, n)
        arm = rotate(rotation, subtract(platform_joint, read3(pivot, 0)))
        _put_turning(leg, _LINE, way, arm)
        leg[REACH] = norm(read3(leg, _LINE + 3))
        leg[SPEED] = norm(way.velocity) + way.rate * leg[REACH]
        put3(leg, CENTER, subtract(center, base_joint))
        put3(leg, _LINE, add(read3(leg, CENTER), read3(leg, _LINE)))
        put3(leg, _BASE_AXIS, read3(axes[n], 0))
        _put_turning(leg, _PLATFORM_AXIS, way, rotate(rotation, read3(axes[6 + n], 0)))
        _put_turning(leg, ARM, way, rotate(rotation, platform_joint))


@compiled
def safe_step(value: float, slope: float, curvature: float) -> float:
    """Return the largest h with value + slope h - curvature h^2 / 2 >= 0 on all of [0, h]."""
    if curvature <= 0.0:
        return -value / slope if slope < 0.0 else math.inf
    if value <= 0.0 and slope <= 0.0:
        return 0.0
    root = math.sqrt(slope * slope + 2.0 * curvature * value)
    return (slope + root) / curvature if slope > 0.0 else 2.0 * value / (root - slope)


@compiled
def line_of(leg: Array, way: Way, t: float) -> tuple[Vector3, Vector3]:
    """Return the leg's vector l and its derivative by t."""
    cosine, sine = math.cos(way.rate * t), math.sin(way.rate * t)
    return (add(turned(leg, _LINE, cosine, sine), scale(t, way.velocity)),
            add(scale(way.rate, turning(leg, _LINE, cosine, sine)), way.velocity))


@compiled
def _quadratic_exit(c0: float, b: float, c2: float) -> tuple[float, float]:
    """Return u as a fraction where c0 - 2 b u + c2 u^2, c0 >= 0, falls below zero; both >= 0."""
    root = math.sqrt(max(b * b - c0 * c2, 0.0))
    return (c0, b + root) if b >= 0.0 else (root - b, -c2)


@compiled
def _end_of_length(leg: Array, way: Way, bound: float, longest: bool, end: float) -> float:
    """
    Return the first t in [0, end] at which a leg leaves a bound of its length, or end.

    Closed: the square of the length is a parabola along a line, and a harmonic about an axis,
    which is a parabola of tan(rate t / 2).
    """
    sign = 1.0 if longest else -1.0
    line, _ = line_of(leg, way, 0.0)
    length = norm(line)
    value = sign * (bound - length) * (bound + length)
    exact = ROUNDING * bound * bound
    if value < -exact:
        return 0.0
    value = max(value, 0.0)
    if way.rate == 0.0:
        b, c2 = sign * dot(line, way.velocity), -sign * dot(way.velocity, way.velocity)
        if not longest and (b <= 0.0 or value - b * b / c2 >= -exact):
            return end
        above, below = _quadratic_exit(value, b, c2)
        return min(above / below, end) if above > 0.0 else 0.0
    a = 2.0 * sign * dot(read3(leg, _LINE), read3(leg, _LINE + 3))
    b = 2.0 * sign * dot(line, read3(leg, _LINE + 6))
    amplitude = math.hypot(a, b)
    deepest = amplitude - a if a <= 0.0 else b * b / (amplitude + a)
    if value - deepest >= -exact:
        return end
    above, below = _quadratic_exit(value, b, value + 2.0 * a)
    return min(2.0 * math.atan2(above, below) / way.rate, end)


@compiled
def _of_length(leg: Array, way: Way, bound: float, longest: bool, t: float) -> _Margin:
    """Return the margin of a length."""
    curving = way.rate * way.rate * leg[REACH]
    speed = leg[SPEED]
    line, change = line_of(leg, way, t)
    length = norm(line)
    sign = 1.0 if longest else -1.0
    scaling = 1.0 / (bound * bound)
    value = sign * scaling * (bound - length) * (bound + length)
    slope = -2.0 * sign * scaling * dot(line, change)
    if longest:
        return _Margin(
            value, slope, 2.0 * scaling * (speed * speed + curving * bound), math.inf)
    # while it moves by no more than its length, it is shorter than twice of it
    return _Margin(value, slope, 4.0 * scaling * curving * length, length / speed)


@compiled
def _of_angle(leg: Array, way: Way, bound: float, at_platform: bool, t: float) -> _Margin:
    """Return the margin of an angle."""
    speed = leg[SPEED]
    line, change = line_of(leg, way, t)
    length = norm(line)
    inverse = 1.0 / length
    s = scale(inverse, line)
    s_change = scale(inverse, subtract(change, scale(dot(s, change), s)))
    # over a step of half the leg's length it stays longer than half of it
    swing = 2.0 * speed * inverse
    curvature = 2.0 * way.rate * way.rate * leg[REACH] * inverse + 3.0 * swing * swing
    if at_platform:
        cosine, sine = math.cos(way.rate * t), math.sin(way.rate * t)
        axis = turned(leg, _PLATFORM_AXIS, cosine, sine)
        slope = dot(axis, s_change) + way.rate * dot(turning(leg, _PLATFORM_AXIS, cosine, sine), s)
        curvature += 2.0 * way.rate * swing + way.rate * way.rate
    else:
        axis = read3(leg, _BASE_AXIS)
        slope = dot(axis, s_change)
    return _Margin(dot(axis, s) - math.cos(bound), slope, curvature,
                   0.5 * length / max(speed, ROUNDING * way.rate * length))


@compiled
def _of_leg(leg: Array, way: Way, bound: float, code: int, t: float) -> _Margin:
    if code <= LENGTH_MAX:
        return _of_length(leg, way, bound, code == LENGTH_MAX, t)
    return _of_angle(leg, way, bound, code == PLATFORM_ANGLE_MAX, t)


@compiled
def end_of_leg(leg: Array, way: Way, bound: float, code: int, end: float) -> tuple[float, bool]:
    """Return the first t in [0, end] at which a leg exceeds a limit, or end; and if decided."""
    if code <= LENGTH_MAX and (way.rate == 0.0 or dot(way.velocity, way.velocity) == 0.0):
        return _end_of_length(leg, way, bound, code == LENGTH_MAX, end), True
    t = before = 0.0
    for _ in range(_MOST_STEPS):
        margin = _of_leg(leg, way, bound, code, t)
        if not margin.value >= -ROUNDING:
            break
        step = safe_step(max(margin.value, 0.0), margin.slope, margin.curvature)
        if margin.curvature > 0.0:
            # along a limit, or close to it, the safe steps are too small to get ahead
            shallow = math.sqrt(8.0 * _SHALLOW / margin.curvature)
            if margin.slope > -margin.curvature * shallow:
                step = max(step, shallow)
            # the time in which the margin can change by its whole size
            if not step > _EXACT * (t + 1.0 / math.sqrt(margin.curvature)):
                return t, True
        elif not step > 0.0:
            return t, True
        before, t = t, t + min(step, margin.holds)
        if t >= end:
            if end < math.inf:
                margin = _of_leg(leg, way, bound, code, end)
            if margin.value >= -ROUNDING:
                return end, True
            t = end
            break
    else:
        return t, False
    low, high = before, t
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if _of_leg(leg, way, bound, code, middle).value >= 0.0:
            low = middle
        else:
            high = middle
    return low, True
