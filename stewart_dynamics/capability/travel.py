# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Travel of the platform along a line or about an axis until the first limit; compiled.

Lengths and joint angles (``travel_legs``), the condition number of J_inv (``travel_condition``)
and the clearance of legs and plates (``travel_clearance``) end a travel; each of them is followed
by steps that no root is in, up to the first limit found before it.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.clearance_bounds import (
    Bodies, bodies_in, is_given, put_plates, rows_of)
from stewart_dynamics.capability.travel_clearance import end_of_clearance
from stewart_dynamics.capability.travel_condition import end_of_condition
from stewart_dynamics.capability.travel_legs import (
    end_of_leg, LEG, LENGTH_MAX, LENGTH_MIN, prepare_legs, Way, way_of)
from stewart_dynamics.compilation.functions import compiled, entry_point
from stewart_dynamics.mechanics import limits
from stewart_dynamics.mechanics.vectors import norm, put3

CLEARANCE_MIN, SINGULARITY, NOTHING = 4, 5, 6
"""Codes of the limit that ends a travel, behind those of ``travel_legs``."""
LIMITS = (limits.LENGTH_MIN, limits.LENGTH_MAX, *limits.OF_JOINTS, limits.CLEARANCE_MIN)
ENDS = (*map(limits.short_name, LIMITS), limits.SINGULARITY, '')
"""Limits that end a travel, and names of all ends, by their codes."""


def memory_of(plates: Sequence[Array]) -> tuple[int, int]:
    """Return the shape of the scratch memory: legs, work on J_inv, and corners."""
    return 6 + 6 + rows_of(plates, 1), LEG


@compiled
def _travel(constants: Array, bounds: Array, bodies: Bodies, stop: float, legs: Array, work: Array,
            way: Way) -> tuple[float, int, int]:
    """Return t at the first limit, nan if not decided, its code, and the leg (-1: none)."""
    # a platform that only turns is back at its pose after one turn
    end = 2.0 * math.pi / way.rate if norm(way.velocity) == 0.0 else math.inf
    limit, leg, decided = NOTHING, -1, True
    for place in range(CLEARANCE_MIN):
        # not of a tuple: to LLVM 15 its index could be too large, which would be an exception
        code = LENGTH_MAX - place if place <= LENGTH_MAX else place  # LENGTH_MAX is the first
        for n in range(6):
            bound = bounds[code, n]
            limited = (bound > 0.0 if code == LENGTH_MIN else
                       bound < (math.inf if code == LENGTH_MAX else math.pi))
            if limited:
                t, known = end_of_leg(legs[n], way, bound, code, end)
                if t < end:
                    end, limit, leg, decided = t, code, n, known
    t, known = end_of_condition(constants, legs, way, stop, end, work)
    if t < end:
        end, limit, leg, decided = t, SINGULARITY, -1, known
    nearest = bounds[CLEARANCE_MIN, 0]
    if nearest > -math.inf:
        for i in range(6):
            for j in range(i + 1, 8):
                if is_given(bodies, j):
                    t, known = end_of_clearance(constants, bodies, legs, way, nearest, i, j, end)
                    if t < end:
                        end, limit, leg, decided = t, CLEARANCE_MIN, i, known
    if not decided:
        return math.nan, limit, leg
    return (end if limit != NOTHING else math.inf), limit, leg


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8',
             'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[::1]', 'i8[::1]', 'i8[::1]', 'f8[:,::1]')
def travels(constants: Array, axes: Array, bounds: Array, shapes: Array, base: Array,
            platform: Array, stop: float, poses: Array, directions: Array, pivots: Array,
            values: Array, limits: Integers, legs: Integers, memory: Array) -> None:
    """
    Write the largest travel from each pose in its direction.

    constants (CONSTANTS,): constants of the hexapod, see ``hexapod_constants``.
    axes (12, 3): axes of the joints, see ``joint_angles``; not read where an angle has no bound.
    bounds (5, 6): bounds of each leg by code: shortest and longest length [m], largest angles of
        base and platform joint [rad], smallest clearance [m], the same for all; 0, infinity and
        minus infinity where there is no bound.
    shapes (6, 3): as in ``leg_clearance``; not read where the clearance has no bound.
    base, platform (M, 3): corners of the plates, likewise.
    stop: condition number that ends a travel.
    poses (N, MOTION): rows of motion, of which the pose is read.
    directions (N, 6): directions [v; w], base axes, not zero.
    pivots (N, 3): centers of rotation, platform frame [m].
    values, limits, legs (N,): written: multiple of the direction until the first limit, its code,
        and the leg, of two legs that are too near the first; infinity, NOTHING and -1 if nothing
        limits, leg -1 at a singularity. nan where the bounded number of steps does not decide
        whether a limit is exceeded, with that limit.
    memory: scratch memory, of shape ``memory_of``.
    """
    of_legs, work = memory[:6], memory[6:12]
    bodies = bodies_in(memory[12:], 1, shapes, len(base))
    for n in range(len(poses)):
        way = way_of(directions[n])
        prepare_legs(constants, axes, poses[n], way, pivots[n], of_legs)
        put_plates(bodies, base, platform, poses[n], pivots[n])
        put3(bodies.spins[0], 0, way.turn)
        values[n], limits[n], legs[n] = _travel(
            constants, bounds, bodies, stop, of_legs, work, way)
