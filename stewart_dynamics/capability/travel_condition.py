# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The condition number of J_inv along a travel, until it reaches its limit; compiled.

The inverse K = J^-1 of the scaled J_inv has the second derivative ``2 K J' K J' K - K J'' K``. On
an interval of length h it differs from its chord, and J from its own, by at most h^2 / 8 times
the bound of the second derivative. A norm is convex, so on the chord it is largest at an end:

    |K| <= max(|K(a)|, |K(b)|) + h^2 / 8 max|K''|,    |J| likewise,

and the condition number is at most their product, everywhere between a and b. |J''| is bounded by
the speeds of the legs (``travel_legs``). With it, the norms of K and of K J' at an end bound those
on the half of the interval next to it: ``|K| <= |K(a)| / (1 - d)`` where J changes by E and
``d = |K(a) E| < 1`` (Golub and Van Loan, Matrix Computations, 4th ed., 2.3.4), so that det(J)
keeps its sign. Intervals shorter than 1e-7 of the hexapod's size over its speed are
not proven: there the condition number at their end decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.singular_values import (
    BEND, COLUMNS, INVERSE, put6, ROW, smallest_and_largest)
from stewart_dynamics.capability.travel_legs import (
    ARM, line_of, NARROW, REACH, safe_step, SPEED, turned, turning, Way)
from stewart_dynamics.compilation.functions import compiled
from stewart_dynamics.mechanics.dynamics.hexapod_constants import characteristic_length_of
from stewart_dynamics.mechanics.vectors import add, cross, dot, norm, scale, subtract

# Column of the scratch memory behind those of ``singular_values``: a row of dJ/dt.
_ROW_RATE, WORK = COLUMNS, COLUMNS + 6
_MOST_STEPS, _TRIALS = 1_000_000, 100
# Part of the way to the root that is tried first, part of an interval that is tried where the
# whole is not proven, and rounding errors of t.
_PART, _SHORTER, _ULPS = 0.98, 0.8, 4e-16
# Rounding errors keep condition numbers below; squares of larger limits overflow.
_LARGEST_STOP = 1e20


class _At(NamedTuple):
    """The scaled J_inv at a point of a travel."""

    largest: float  # norm of J
    rate: float  # bound of the norm of J'
    inverse: float  # norm of K
    relative: float  # bound of the norm of K J'
    bend: float  # bound of the norm of J'' while the legs keep their lengths
    quickest: float  # largest speed of a leg over its length
    room: float  # limit over condition number, negative where det(J) has changed its sign, less 1
    determinant: float


@compiled
def _at(constants: Array, legs: Array, way: Way, stop: float, side: float, t: float, work: Array,
        ) -> _At:
    """Return the scaled J_inv; ``side`` is det(J) at the start, or 0."""
    inverse_size = 1.0 / characteristic_length_of(constants)
    cosine, sine = math.cos(way.rate * t), math.sin(way.rate * t)
    squares = bending = quickest = 0.0
    for n in range(6):
        leg = legs[n]
        line, change = line_of(leg, way, t)
        inverse_length = 1.0 / norm(line)
        s = scale(inverse_length, line)
        s_rate = scale(inverse_length, subtract(change, scale(dot(s, change), s)))
        arm = scale(inverse_size, turned(leg, ARM, cosine, sine))
        arm_rate = scale(inverse_size * way.rate, turning(leg, ARM, cosine, sine))
        put6(work[n], ROW, s, cross(arm, s))
        moment_rate = add(cross(arm_rate, s), cross(arm, s_rate))
        put6(work[n], _ROW_RATE, s_rate, moment_rate)
        squares += dot(s_rate, s_rate) + dot(moment_rate, moment_rate)
        swing = leg[SPEED] * inverse_length
        quickest = max(quickest, swing)
        curve = way.rate * way.rate * leg[REACH] * inverse_length + BEND * swing * swing
        moment_curve = norm(arm) * (way.rate * (way.rate + 2.0 * swing) + curve)
        bending += curve * curve + moment_curve * moment_curve
    smallest, largest, determinant = smallest_and_largest(work)
    relative = 0.0
    for row in range(6):
        for column in range(6):
            product = 0.0
            for n in range(6):
                product += work[row, INVERSE + n] * work[n, _ROW_RATE + column]
            relative += product * product
    signed = smallest if determinant * side >= 0.0 else -smallest
    room = signed / largest * stop - 1.0
    return _At(largest, math.sqrt(squares), 1.0 / smallest, math.sqrt(relative),
               math.sqrt(bending), quickest, room, determinant)


@compiled
def _bounds_near(at: _At, distance: float) -> tuple[float, float, float]:
    """Return bounds of condition number, |J''| and |K''| up to a distance from a point."""
    shorter = 1.0 - at.quickest * distance
    bend = at.bend / (shorter * shorter)
    change = distance * (at.rate + 0.5 * distance * bend)
    left = 1.0 - distance * (at.relative + 0.5 * distance * at.inverse * bend)
    if not (shorter > 0.0 and left > 0.0):
        return math.inf, math.inf, math.inf
    inverse = at.inverse / left
    relative = (at.relative + distance * at.inverse * bend) / left
    return (inverse * (at.largest + change), bend,
            inverse * (2.0 * relative * relative + inverse * bend))


@compiled
def _highest(a: _At, b: _At, step: float) -> float:
    """Return a bound of the condition number between two points."""
    near_a, bend_a, bend_of_inverse_a = _bounds_near(a, 0.5 * step)
    near_b, bend_b, bend_of_inverse_b = _bounds_near(b, 0.5 * step)
    eighth = 0.125 * step * step
    return min(max(near_a, near_b),
               (max(a.inverse, b.inverse) + eighth * max(bend_of_inverse_a, bend_of_inverse_b))
               * (max(a.largest, b.largest) + eighth * max(bend_a, bend_b)))


@compiled
def _promising(at: _At, slope: float, most: float, stop: float) -> float:
    """Return a step that is likely to be proven, if ``room`` goes on as it did."""
    bend = 0.25 * (2.0 * at.relative * at.relative + at.inverse * at.bend + at.bend / at.largest)
    step = min(_PART * safe_step(at.room, slope, bend), most, 2.0 / at.relative)
    for _ in range(_TRIALS):
        nearer = (1.0 + at.room) / (1.0 + at.room + step * slope)
        then = _At(at.largest, at.rate, nearer * at.inverse, nearer * at.relative, at.bend,
                   at.quickest, 0.0, 0.0)
        if _highest(at, then, step) < stop:
            break
        step *= _SHORTER
    return step


@compiled
def end_of_condition(constants: Array, legs: Array, way: Way, stop: float, end: float,
                     work: Array) -> tuple[float, bool]:
    """
    Return the first t in [0, end] at which the condition number is ``stop``, or end.

    And whether that is decided, or t is only the part that is proven.
    """
    stop = min(stop, _LARGEST_STOP)
    at = _at(constants, legs, way, stop, 0.0, 0.0, work)
    if at.room <= 0.0:
        return 0.0, True
    side = at.determinant
    fastest = 0.0
    for n in range(6):
        fastest = max(fastest, legs[n, SPEED])
    narrowest = NARROW * characteristic_length_of(constants) / fastest
    t = slope = 0.0
    most = math.inf
    for _ in range(_MOST_STEPS):
        if t >= end:
            return end, True
        narrow = max(narrowest, _ULPS * t)
        step = min(max(_promising(at, slope, min(most, end - t), stop), narrow), end - t)
        then = _at(constants, legs, way, stop, side, t + step, work)
        if then.room > 0.0 and (step <= narrow or _highest(at, then, step) < stop):
            slope = (then.room - at.room) / step
            t, at, most = t + step, then, math.inf
        elif step <= narrow:
            break
        else:
            most = _SHORTER * step
            slope = (then.room - at.room) / step
    else:
        return t, False
    # the root is between t and the end of this step: Illinois' rule of false position
    low, high, above, below = t, t + step, at.room, then.room
    kept = 0
    while high - low > 2.0 * _ULPS * high:
        middle = high - (high - low) * below / (below - above)
        middle = min(max(middle, low + _ULPS * high), high - _ULPS * high)
        room = _at(constants, legs, way, stop, side, middle, work).room
        if room >= 0.0:
            low, above = middle, room
            below *= 0.5 if kept > 0 else 1.0
            kept = 1
        else:
            high, below = middle, room
            above *= 0.5 if kept < 0 else 1.0
            kept = -1
    return low, True
