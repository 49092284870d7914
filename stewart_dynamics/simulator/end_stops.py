# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The end stops of the legs: springs and dampers at either end of the travel, and of the levers.

Where the lever of a leg, the effort of its drive by its push, is zero, the leg is at a dead
centre: the platform joint is at the end of its reach. A drive that went on would move it back on
the other branch of the leg, where nothing that computes on one branch could follow. Toward a dead
centre the rate of the drive grows as 1 / k and its inertia, as the platform feels it, as 1 / k^2,
with the lever k. The distance to the end of reach falls as k^2: with a lever of 0.18 m at most it
is 0.7 mm at a tenth of that, and the drive arrives there with all of its energy. A stop in that
distance would have to be stiffer by any factor. The stop is one of the lever itself, as where two
links of a joint meet: a spring with the potential

    U = 1/2 K (r_min - r)^2  where r < r_min,  r = |k| / k_max,  r_min = limits.lever_min

and a damper. r changes as an angle does. Its slope (``lever_slope`` in ``core/legs.c``) is a part
of the drive's rate and a part of the joint's velocity, neither of them divided by k: at the drive
it is an effort of ordinary size, with the frequency of the stops of positions, and no energy comes
from it. It takes up 1/2 K r_min^2 and the work of the damper; K is that of the stops of positions,
sized for the platform at the largest lever. A motion that it cannot hold ends: a step in which a
lever changes by more than half of itself is not taken (``Plant.fault``), so that no motion passes
a dead centre.
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
