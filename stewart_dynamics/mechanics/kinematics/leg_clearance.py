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
The clearance between the legs: smallest distance between the surfaces of two legs; compiled.

Each leg is two capsules on one axis, from the base joint along the leg: the cylinder, as long as
``legs.cylinder.length`` but no longer than the leg, and the thinner piston, as long as the leg:
inside the cylinder it changes nothing. A capsule ends in a half sphere of its radius.

The distance of two axes ``b_i + u s_i`` and ``b_j + v s_j`` is the minimum of a convex quadratic
over a rectangle of u and v. With u at the minimum for both lines, clamped, the best v for it,
clamped, and the best u for that, it is found in closed form (Ericson, Real-Time Collision
Detection, 2005, 5.1.9); where legs are parallel, any u does to begin with. The four pairs of
capsules of two legs differ only in the ends of their rectangles.

The axis of a cylinder ends at the point of a ball around the base joint that is nearest to the
platform joint, so it moves no farther than the platform joint does: the clearance of two legs
changes by no more than the sum of the distances that their platform joints move. With the unit
vector n from one axis to the other at their nearest points the distance is, whatever they do, at
least that of their ends along n. In the frame of the base the base joints do not move, in that of
the platform the platform joints do not: ``pair_room`` is for both.
"""

from __future__ import annotations

from collections.abc import Callable
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import compiled, entry_point, inlined
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.dynamics.bodies import leg_line
from stewart_dynamics.mechanics.dynamics.hexapod_constants import hexapod_constants, joints_of
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.mechanics.vectors import (
    cross, dot, norm, read3, read9, scale, subtract, Vector3)
from stewart_dynamics.parameters.table import LEG_SHAPE, Parameters

# The axis of a leg in scratch memory: base joint, direction, length, length of the cylinder.
_BASE, _DIRECTION, _LENGTH, _CYLINDER, AXIS = 0, 3, 6, 7, 8


@inlined
def _shortest(gap: Vector3, s: Vector3, t: Vector3, cosine: float, along_s: float,
              along_t: float, u: float, u_end: float, v_end: float) -> Vector3:
    """Return the shortest ``gap + u s - v t`` for 0 <= u <= u_end and 0 <= v <= v_end."""
    u = min(max(u, 0.0), u_end)
    v = min(max(cosine * u + along_t, 0.0), v_end)
    u = min(max(cosine * v - along_s, 0.0), u_end)
    x = gap[0] + u * s[0] - v * t[0]
    y = gap[1] + u * s[1] - v * t[1]
    z = gap[2] + u * s[2] - v * t[2]
    return x, y, z


@inlined
def _distance(gap: Vector3, s: Vector3, t: Vector3, cosine: float, along_s: float,
              along_t: float, u: float, u_end: float, v_end: float) -> float:
    """Return the least ``|gap + u s - v t|`` for 0 <= u <= u_end and 0 <= v <= v_end."""
    return norm(_shortest(gap, s, t, cosine, along_s, along_t, u, u_end, v_end))


@inlined
def pair_clearance(shapes: Array, axes: Array, i: int, j: int) -> float:
    """Return the clearance of two legs of shapes (6, 3) on axes (6, AXIS); negative: overlap."""
    s, t = read3(axes[i], _DIRECTION), read3(axes[j], _DIRECTION)
    gap = subtract(read3(axes[i], _BASE), read3(axes[j], _BASE))
    cosine, along_s, along_t = dot(s, t), dot(gap, s), dot(gap, t)
    normal = cross(s, t)
    square = dot(normal, normal)
    u = dot(gap, subtract(scale(cosine, t), s)) / square if square > 0.0 else 0.0
    length, cylinder = axes[i, _LENGTH], axes[i, _CYLINDER]
    other_length, other_cylinder = axes[j, _LENGTH], axes[j, _CYLINDER]
    thick, thin = shapes[i, 0], shapes[i, 2]
    other_thick, other_thin = shapes[j, 0], shapes[j, 2]
    clearance: float = min(
        min(_distance(gap, s, t, cosine, along_s, along_t, u, length, other_length)
            - thin - other_thin,
            _distance(gap, s, t, cosine, along_s, along_t, u, cylinder, other_length)
            - thick - other_thin),
        min(_distance(gap, s, t, cosine, along_s, along_t, u, length, other_cylinder)
            - thin - other_thick,
            _distance(gap, s, t, cosine, along_s, along_t, u, cylinder, other_cylinder)
            - thick - other_thick))
    return clearance


@compiled
def pair_room(shapes: Array, axes: Array, i: int, j: int, moved: float, other_moved: float,
              turned: float, at_base: bool, bound: float) -> tuple[float, float, float]:
    """
    Return the clearance of two legs, and its least value when the joints at one end move.

    Parameters
    ----------
    shapes, axes : (6, 3), (6, AXIS)
        As in ``pair_clearance``.
    i, j : int
        The two legs.
    moved, other_moved : float
        Largest distances that their joints at one end move, in the frame of the others [m].
    turned : float
        Largest change of the vector between these two joints, likewise [m].
    at_base : bool
        The base joints move; else the platform joints.
    bound : float
        Smallest clearance [m].

    Returns
    -------
    clearance, lowest, room : float
        Clearance, a lower bound of it after these moves [m], and the multiple of the moves up to
        which it cannot be below ``bound``; 0 where it is.

    """
    s, t = read3(axes[i], _DIRECTION), read3(axes[j], _DIRECTION)
    gap = subtract(read3(axes[i], _BASE), read3(axes[j], _BASE))
    cosine, along_s, along_t = dot(s, t), dot(gap, s), dot(gap, t)
    normal = cross(s, t)
    square = dot(normal, normal)
    u = dot(gap, subtract(scale(cosine, t), s)) / square if square > 0.0 else 0.0
    clearance = lowest = room = math.inf
    for capsules in range(4):
        cylinder, other_cylinder = capsules & 1 == 1, capsules & 2 == 2
        u_end = axes[i, _CYLINDER] if cylinder else axes[i, _LENGTH]
        v_end = axes[j, _CYLINDER] if other_cylinder else axes[j, _LENGTH]
        inside = cylinder and u_end < axes[i, _LENGTH]
        other_inside = other_cylinder and v_end < axes[j, _LENGTH]
        radii = (shapes[i, 0] if cylinder else shapes[i, 2]) + (
            shapes[j, 0] if other_cylinder else shapes[j, 2])
        x = _shortest(gap, s, t, cosine, along_s, along_t, u, u_end, v_end)
        distance = norm(x)
        n = scale(1.0 / distance if distance > 0.0 else 0.0, x)
        at_bases = dot(n, gap) - radii
        clearance = min(clearance, distance - radii)
        for ends in range(4):
            far, other_far = ends & 1 == 1, ends & 2 == 2
            apart = at_bases + (u_end * dot(n, s) if far else 0.0) - (
                v_end * dot(n, t) if other_far else 0.0)
            # the end of a cylinder moves with the joints at either end, and no farther
            by = 0.0
            if far != at_base or (far and inside):
                by += moved
            if other_far != at_base or (other_far and other_inside):
                by += other_moved
            if far == other_far != at_base and not (far and (inside or other_inside)):
                by = min(by, turned)
            lowest = min(lowest, max(apart - by, -radii))
            if by > 0.0:
                room = min(room, (apart - bound) / by)
    return clearance, lowest, max(room, 0.0) if clearance >= bound else 0.0


@inlined
def put_axis(shapes: Array, axes: Array, leg: int, base: Vector3, direction: Vector3,
             length: float) -> None:
    """Write the axis of a leg (AXIS,)."""
    axis = axes[leg]
    axis[_BASE], axis[_BASE + 1], axis[_BASE + 2] = base
    axis[_DIRECTION], axis[_DIRECTION + 1], axis[_DIRECTION + 2] = direction
    axis[_LENGTH], axis[_CYLINDER] = length, min(shapes[leg, 1], length)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def leg_clearances(constants: Array, shapes: Array, motions: Array, clearances: Array,
                   axes: Array) -> None:
    """
    Write the clearance of each leg from the nearest other leg.

    Parameters
    ----------
    constants : (CONSTANTS,)
        Constants of the hexapod, see ``hexapod_constants``.
    shapes : (6, 3)
        Radius and length of the cylinder and radius of the piston of each leg [m].
    motions : (N, MOTION)
        Rows of motion.
    clearances : (N, 6)
        Written [m]; negative where legs overlap.
    axes : (6, AXIS)
        Scratch memory.

    """
    for row in range(len(motions)):
        position = read3(motions[row], POSITION.start)
        rotation = read9(motions[row], ROTATION.start)
        nearest = clearances[row]
        for leg in range(6):
            _, length, _, direction = leg_line(constants, leg, position, rotation)
            base, _ = joints_of(constants, leg)
            put_axis(shapes, axes, leg, base, direction, length)
            nearest[leg] = math.inf
        for i in range(6):
            for j in range(i + 1, 6):
                clearance = pair_clearance(shapes, axes, i, j)
                nearest[i] = min(nearest[i], clearance)
                nearest[j] = min(nearest[j], clearance)


class LegClearance:
    """
    The clearance between a hexapod's legs.

    Parameters
    ----------
    parameters : Parameters
        Parameters of the hexapod.

    Attributes
    ----------
    shapes : (6, 3)
        Radius and length of the cylinder and radius of the piston of each leg [m].

    Raises
    ------
    ParameterError
        Radii or length are not given.

    """

    def __init__(self, parameters: Parameters) -> None:
        missing = [name for name in LEG_SHAPE if parameters[name] is None]
        if missing:
            raise ParameterError(f'parameters: {", ".join(missing)}: not set: needed by the '
                                 'clearance between the legs')
        self._constants = hexapod_constants(parameters)
        self.shapes = np.column_stack([parameters[name] for name in LEG_SHAPE])

    def __call__(self, motions: Array) -> Array:
        """Return the clearance of each leg (N, 6) [m] in motions (N, MOTION)."""
        clearances = np.empty((len(motions), 6))
        batch.in_parts(self._clearances, self._constants, batch.compact(motions), clearances,
                       scratch=(6, AXIS))
        return clearances

    def of_one(self, motion: Array) -> Callable[[], tuple[float, ...]]:
        """Return a function that gives the clearances (6,) of a row's current values."""
        clearances = np.empty((1, 6))
        compute = leg_clearances.bound(
            self._constants, self.shapes, motion.reshape(1, len(motion)), clearances,
            np.empty((6, AXIS)))

        def of_row() -> tuple[float, ...]:
            compute()
            return tuple(clearances[0].tolist())

        return of_row

    def _clearances(self, constants: Array, *arrays: Array) -> None:
        leg_clearances(constants, self.shapes, *arrays)


def clearance_to_check(parameters: Parameters) -> LegClearance | None:
    """Return the clearance that the limit needs; None without limit."""
    return None if parameters[CLEARANCE_MIN] is None else LegClearance(parameters)
