# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The clearance of the legs: smallest distance of a leg from another one, or from a plate.

Each leg is two capsules on one axis, from the base joint along the leg: the cylinder, as long as
``legs.cylinder.length`` but no longer than the leg, and the thinner piston, as long as the leg:
inside the cylinder it changes nothing. A capsule ends in a half sphere of its radius.

The distance of two axes ``b_i + u s_i`` and ``b_j + v s_j`` is the minimum of a convex quadratic
over a rectangle of u and v. With u at the minimum for both lines, clamped, the best v for it,
clamped, and the best u for that, it is found in closed form (Ericson, Real-Time Collision
Detection, 2005, 5.1.9); where legs are parallel, any u does to begin with. The four pairs of
capsules of two legs differ only in the ends of their rectangles.

A plate is a flat convex polygon, fixed to the base or to the platform. A leg is joined to both: so
cylinders count for the platform's plate, and pistons, from the end of the cylinder on, for that of
the base. Their distance is zero where the axis crosses the polygon; else an end of the axis above
the polygon is nearest, or an edge is.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.parameters.table import BASE_OUTLINE, LEG_SHAPE, Parameters, PLATFORM_OUTLINE

BASE, PLATFORM = 6, 7  # numbers of the plates, where 0 to 5 are legs


class LegClearance:
    """
    The clearance of a hexapod's legs.

    shapes (6, 3): radius and length of the cylinder and radius of the piston of each leg [m].
    base, platform (M, 3): corners of the plates, base frame and platform frame [m]; none without a
        plate.
    reach: distance of the farthest platform joint or corner from the platform's origin [m].
    Raises ParameterError: radii or length are not given.
    """

    def __init__(self, parameters: Parameters) -> None:
        missing = [name for name in LEG_SHAPE if parameters[name] is None]
        if missing:
            raise ParameterError(f'{parameters.source}: {", ".join(missing)}: not set: needed by '
                                 'the clearance of the legs')
        self.shapes = np.column_stack([parameters[name] for name in LEG_SHAPE])
        self.base, self.platform = (
            np.empty((0, 3)) if parameters[name] is None else parameters[name].copy()
            for name in (BASE_OUTLINE, PLATFORM_OUTLINE))
        self.reach = float(np.linalg.norm(np.concatenate([
            parameters.geometry.platform_joints, self.platform]), axis=1).max())
        self._hexapod = hexapod_structure(parameters)

    def __call__(self, motions: Array) -> Array:
        """Return the clearance of each leg (N, 6) [m] in motions (N, MOTION)."""
        return self.nearest(motions)[0]

    def nearest(self, motions: Array) -> tuple[Array, Integers]:
        """Return the clearance of each leg (N, 6) [m], and number of the leg or plate."""
        clearances, nearest = np.empty((len(motions), 6)), np.empty((len(motions), 6), np.int64)
        batch.in_parts(self._write, (), batch.compact(motions), clearances, nearest)
        return clearances, nearest

    def _write(self, motions: Array, clearances: Array, nearest: Integers) -> None:
        function('clearances_many')(self._hexapod, len(motions), motions, clearances, nearest)


def clearance_to_check(parameters: Parameters) -> LegClearance | None:
    """Return the clearance that the limit needs; None without limit."""
    return None if parameters.limits.leg_clearance_min is None else LegClearance(parameters)
