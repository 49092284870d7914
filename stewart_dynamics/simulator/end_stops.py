# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The end stops of the legs: a spring and a damper at either end of the stroke."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import record
from stewart_dynamics.mechanics.limits import LENGTH_MAX, LENGTH_MIN
from stewart_dynamics.parameters.table import Parameters


def stiffness_and_damping(parameters: Parameters) -> tuple[Array, Array]:
    """
    Return stiffness [N/m] and damping [N s/m] of the end stops, each (6,).

    A leg carries a sixth of platform and pistons and its own reflected mass; on a stop it has the
    natural frequency and the damping ratio of the parameters.
    """
    carried = ((parameters.carried.mass + np.sum(parameters['legs.piston.mass'])) / 6.0
               + parameters['actuator.reflected_mass'])
    if parameters[LENGTH_MIN] is None and parameters[LENGTH_MAX] is None:
        carried = np.zeros(6)  # no stops
    omega = 2.0 * np.pi * parameters['end_stops.frequency']
    return (carried * omega ** 2,
            carried * 2.0 * parameters['end_stops.damping_ratio'] * omega)


def stops_of(parameters: Parameters) -> Records:
    """
    Return the stops as the plant takes them.

    Kelvin-Voigt elements, without the pull of their dampers as a leg leaves a stop.
    """
    stops = np.zeros((), record('end_stops'))
    for field, limit, never in (('shortest', LENGTH_MIN, -math.inf),
                                ('longest', LENGTH_MAX, math.inf)):
        stops[field] = never if parameters[limit] is None else parameters[limit]
    stops['stiffness'], stops['damping'] = stiffness_and_damping(parameters)
    return stops
