# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The end stops of the legs: springs and dampers at either end of the travel, and of the levers.

Where the lever of a leg, the effort of its drive by its push, is zero, the leg is at a dead centre:
the platform joint is at the end of its reach, and a drive that went on would move it back, on the
other branch of the leg, which no program that computes on one branch can follow. The rate of the
drive grows as 1 / k toward a dead centre, the inertia of the drive that the platform feels as
1 / k^2, with the lever k. A stop in the distance to the end of reach would therefore be too soft
for the inertia by any factor: that distance falls as k^2, 0.7 mm for a crank of 0.18 m at a tenth
of its largest lever, and the drive arrives with all of its energy. The stop is one of the lever
itself, as where rod and crank meet: a potential

    U = 1/2 K (r_min - r)^2  where r < r_min,  r = |k| / k_max, r_min = limits.lever_min

with a damper. r changes as an angle does and its slope is that of drive and joint (``slope`` in
``core/legs.c``), neither of which is divided by k: at the drive it is an effort of ordinary size,
with the frequency of the stops of positions, and no energy comes from it. 1/2 K r_min^2 is what it
takes up; K is that of the position's stops, sized for the platform at the largest lever. What it
cannot hold is refused: a step in which a lever changes by more than half of itself is not taken
(``Plant.fault``), so that no motion passes a dead centre.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import record
from stewart_dynamics.mechanics.limits import LEVER_MIN
from stewart_dynamics.parameters.table import six_of
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters


def stiffness_and_damping(parameters: SimulatorParameters) -> tuple[Array, Array]:
    """
    Return stiffness [N/m, N m/rad] and damping of the end stops, each (6,).

    A drive carries a sixth of the platform and of the parts that move with it, at its largest
    lever, and its own inertia; on a stop it has the natural frequency and the damping ratio of the
    parameters.
    """
    loads = parameters.leg_kind.stop_loads(parameters)
    carried = ((parameters.carried.mass + loads.carried) / 6.0 * loads.levers[1] ** 2
               + loads.inertia)
    if all(parameters[name] is None for name in stop_limits(parameters)):
        carried = np.zeros(6)  # no stops
    omega = 2.0 * np.pi * parameters.end_stops.frequency
    return (carried * omega ** 2,
            carried * 2.0 * parameters.end_stops.damping_ratio * omega)


def stop_limits(parameters: SimulatorParameters) -> tuple[str, str, str]:
    """Return the names of the limits that have end stops: of position, and of levers."""
    return (*parameters.leg_kind.position_limits, LEVER_MIN)


def stops_of(parameters: SimulatorParameters) -> Records:
    """
    Return the stops as the plant takes them.

    Kelvin-Voigt elements, without the pull of their dampers as a leg leaves a stop.
    """
    stops = np.zeros((), record('end_stops'))
    for field, name, unlimited in zip(
            ('lowest', 'highest', 'least_lever'), stop_limits(parameters),
            (-math.inf, math.inf, 0.0), strict=True):
        stops[field] = six_of(parameters[name], unlimited)
    stops['stiffness'], stops['damping'] = stiffness_and_damping(parameters)
    return stops
