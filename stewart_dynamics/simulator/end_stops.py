# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The end stops of the legs: a spring and a damper at either end of the stroke."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import record
from stewart_dynamics.parameters.table import six_of
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters


def stiffness_and_damping(parameters: SimulatorParameters) -> tuple[Array, Array]:
    """
    Return stiffness [N/m] and damping [N s/m] of the end stops, each (6,).

    A leg carries a sixth of platform and pistons and its own reflected mass; on a stop it has the
    natural frequency and the damping ratio of the parameters.
    """
    carried = ((parameters.carried.mass + np.sum(parameters.legs.piston.mass)) / 6.0
               + parameters.actuator.reflected_mass)
    if parameters.limits.length_min is None and parameters.limits.length_max is None:
        carried = np.zeros(6)  # no stops
    omega = 2.0 * np.pi * parameters.end_stops.frequency
    return (carried * omega ** 2,
            carried * 2.0 * parameters.end_stops.damping_ratio * omega)


def stops_of(parameters: SimulatorParameters) -> Records:
    """
    Return the stops as the plant takes them.

    Kelvin-Voigt elements, without the pull of their dampers as a leg leaves a stop.
    """
    stops = np.zeros((), record('end_stops'))
    stops['shortest'] = six_of(parameters.limits.length_min, -math.inf)
    stops['longest'] = six_of(parameters.limits.length_max, math.inf)
    stops['stiffness'], stops['damping'] = stiffness_and_damping(parameters)
    return stops
