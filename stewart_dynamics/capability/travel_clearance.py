# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Clearance of two legs, or of a leg and a plate, along a travel; compiled.

It is at least ``n . (p - q)`` of all corners p and q of the two (``clearance_bounds``), whose
second derivatives are bounded: safe steps as in ``travel_legs``. Where they are shorter than 1e-7
of the hexapod's size over its speed, the root is bracketed by the margin.
"""

from __future__ import annotations

import math

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.clearance_bounds import (
    ARM, BASE_JOINT, between_corners, Bodies, Body, corners_of, CYLINDER, follow, FOLLOWING,
    OF_LEG, pair_of, pairs_with, PLACE, PLATES, PLATFORM_JOINT, RATES, relative_rate, ROTATING,
    shortest, slope_along, STAYING, STILL, TURNING)
from stewart_dynamics.capability.singular_values import BEND
from stewart_dynamics.capability.travel_legs import (
    CENTER, line_of, NARROW, REACH, ROUNDING, safe_step, SPEED, Way)
from stewart_dynamics.compilation.functions import compiled
from stewart_dynamics.mechanics.dynamics.hexapod_constants import (
    characteristic_length_of, joints_of)
from stewart_dynamics.mechanics.kinematics.leg_clearance import BASE, PLATFORM
from stewart_dynamics.mechanics.vectors import (
    add, cross, dot, norm, put3, read3, scale, subtract, Vector3)

_MOST_STEPS = 1_000_000
# Some clearances stay the same along a travel: rounding errors are below this part of the size.
_EXACT = 1e-14
# Other directions are tried where a step is below this part of it.
_NEAR = 0.01


@compiled
def _put_leg(constants: Array, bodies: Bodies, legs: Array, way: Way, n: int, t: float) -> float:
    """Write the corners of a leg; return the step for which their bounds hold."""
    leg, rate = legs[n], way.rate
    base_joint, _ = joints_of(constants, n)
    line, change = line_of(leg, way, t)
    length = norm(line)
    inverse = 1.0 / length if length > 0.0 else math.inf
    s = scale(inverse, line) if length > 0.0 else line
    s_change = scale(inverse, subtract(change, scale(dot(s, change), s)))
    turning = _turning(constants, way, add(read3(leg, CENTER), scale(t, way.velocity)))
    # over a step of half the leg's length it stays longer than half of it
    swing = 2.0 * leg[SPEED] * inverse
    bend = 2.0 * rate * rate * leg[REACH] * inverse + BEND * swing * swing
    cylinder = bodies.shapes[n, 1]
    for place in range(OF_LEG):
        corner = bodies.corners[OF_LEG * n + place]
        if place == BASE_JOINT:
            put3(corner, PLACE, base_joint)
            put3(corner, RATES, (0.0, 0.0, 0.0))
            corner[STILL], corner[TURNING] = 0.0, turning
        elif place == PLATFORM_JOINT or (place == CYLINDER and length <= cylinder):
            put3(corner, PLACE, add(base_joint, line))
            put3(corner, RATES, change)
            corner[STILL], corner[TURNING] = rate * rate * leg[REACH], 0.0
        else:
            put3(corner, PLACE, add(base_joint, scale(cylinder, s)))
            put3(corner, RATES, scale(cylinder, s_change))
            corner[STILL] = cylinder * bend
            corner[TURNING] = turning + cylinder * (bend + rate * (2.0 * swing + rate))
    longest: float = 0.5 * length / max(leg[SPEED], ROUNDING * rate * length)
    return longest


@compiled
def _put_plate(constants: Array, bodies: Bodies, legs: Array, way: Way, plate: int, t: float,
               ) -> None:
    """Write the corners of a plate."""
    joint, _ = joints_of(constants, 0)
    center = add(joint, add(read3(legs[0], CENTER), scale(t, way.velocity)))
    of_platform = PLATES + bodies.base_corners
    if plate == BASE:
        for n in range(PLATES, of_platform):
            corner = bodies.corners[n]
            corner[TURNING] = _turning(constants, way, subtract(center, read3(corner, PLACE)))
        return
    cosine, sine = math.cos(way.rate * t), math.sin(way.rate * t)
    for n in range(of_platform, len(bodies.corners)):
        corner = bodies.corners[n]
        arm = read3(corner, ARM)
        along = scale(dot(way.axis, arm), way.axis)
        turned = add(along, add(scale(cosine, subtract(arm, along)),
                                scale(sine, cross(way.axis, arm))))
        put3(corner, PLACE, add(center, turned))
        put3(corner, RATES, add(way.velocity, cross(way.turn, turned)))
        corner[STILL] = way.rate * way.rate * norm(arm)


@compiled
def _turning(constants: Array, way: Way, away: Vector3) -> float:
    """Return the bound TURNING of a point of the base that is ``away`` from the center."""
    return way.rate * (way.rate * (norm(away) + characteristic_length_of(constants))
                       + 2.0 * norm(way.velocity))


@compiled
def _step_of_bodies(constants: Array, bodies: Bodies, way: Way, a: Body, b: Body, n: Vector3,
                    limit: float, how: int) -> float:
    """Return the step for which two bodies are at least ``limit`` apart along n."""
    follow(bodies, a, b, n, how)
    follows = read3(bodies.n_rates[0], 0)
    turned, speed = norm(follows), norm(way.velocity)
    if how == ROTATING:  # while the center moves by no more than the size
        step = (math.inf if speed == 0.0 or way.rate == 0.0 else
                characteristic_length_of(constants) / speed)
    else:
        step = 1.0 / turned if turned > 0.0 else math.inf
    corners, rest = bodies.corners, TURNING if how == ROTATING else STILL
    for p in corners_of(a):
        for q in corners_of(b):
            gap = dot(n, between_corners(corners, p, q)) - limit
            bend = corners[p, rest] + corners[q, rest]
            if how == FOLLOWING:
                # n is no longer than sqrt(2) over the step
                bend = 2.0 * (bend - dot(follows, relative_rate(corners, p, q, 0))) + max(
                    limit, 0.0) * turned * turned
            step = min(step, safe_step(max(gap, 0.0), slope_along(bodies, p, q, n, 0), bend))
    return step


@compiled
def _room(constants: Array, bodies: Bodies, legs: Array, way: Way, approach: float, bound: float,
          i: int, j: int, t: float) -> tuple[float, float]:
    """Return the margin of the clearance of a leg and a leg or plate, and the step it clears."""
    longest = _put_leg(constants, bodies, legs, way, i, t)
    if j < 6:
        longest = min(longest, _put_leg(constants, bodies, legs, way, j, t))
    else:
        _put_plate(constants, bodies, legs, way, j, t)
    margin, step = math.inf, longest
    for pair in range(pairs_with(j)):
        a, b, radii = pair_of(bodies, i, j, pair)
        vector = shortest(bodies.corners, a, b)
        distance = norm(vector)
        margin = min(margin, distance - radii - bound)
        if distance == 0.0:
            step = 0.0
            continue
        n, limit = scale(1.0 / distance, vector), radii + bound
        clear = _step_of_bodies(constants, bodies, way, a, b, n, limit, FOLLOWING)
        if clear * approach < _NEAR * characteristic_length_of(constants):
            clear = max(clear, _step_of_bodies(constants, bodies, way, a, b, n, limit, STAYING),
                        _step_of_bodies(constants, bodies, way, a, b, n, limit, ROTATING))
        step = min(step, clear)
    return margin, step


@compiled
def _approach(bodies: Bodies, legs: Array, way: Way, i: int, j: int) -> float:
    """Return the largest speed at which a leg and a leg or plate approach each other."""
    speed = 0.0
    if j < 6:
        speed = legs[j, SPEED]
    elif j == PLATFORM:
        farthest = 0.0
        for n in range(PLATES + bodies.base_corners, len(bodies.corners)):
            farthest = max(farthest, norm(read3(bodies.corners[n], ARM)))
        speed = norm(way.velocity) + way.rate * farthest
    of_leg: float = legs[i, SPEED]
    return of_leg + speed


@compiled
def end_of_clearance(constants: Array, bodies: Bodies, legs: Array, way: Way, bound: float,
                     i: int, j: int, end: float) -> tuple[float, bool]:
    """
    Return the first t in [0, end] at which a leg and a leg or plate are too near, or end.

    And whether that is decided, or t is only the part that is proven.
    """
    size = characteristic_length_of(constants)
    bound -= _EXACT * size
    approach = _approach(bodies, legs, way, i, j)
    margin, step = _room(constants, bodies, legs, way, approach, bound, i, j, 0.0)
    if margin < -ROUNDING * size:
        return 0.0, True
    narrow = NARROW * size / max(approach, ROUNDING * way.rate * size)
    t = 0.0
    for _ in range(_MOST_STEPS):
        if step > narrow:
            t += step
            if t >= end:
                return end, True
            margin, step = _room(constants, bodies, legs, way, approach, bound, i, j, t)
            continue
        if t >= end:
            return end, True
        margin, step = _room(constants, bodies, legs, way, approach, bound, i, j, t + narrow)
        if margin < 0.0:
            break  # the root is between the two
        t += narrow
    else:
        return t, False
    low, high = t, t + narrow
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        margin, _ = _room(constants, bodies, legs, way, approach, bound, i, j, middle)
        if margin >= 0.0:
            low = middle
        else:
            high = middle
    return min(low, end), True
