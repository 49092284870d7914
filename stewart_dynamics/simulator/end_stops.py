# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The end stops of the legs: a spring and a damper at either end of the stroke."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.limits import LENGTH_MAX, LENGTH_MIN
from stewart_dynamics.mechanics.rows import consecutive
from stewart_dynamics.parameters.table import Parameters

# The stops as an array, six numbers of each kind.
_SHORTEST, _LONGEST, _STIFFNESS, _DAMPING = consecutive(6, 6, 6, 6)
STOPS = 24


def stiffness_and_damping(parameters: Parameters) -> tuple[Array, Array]:
    """
    Return stiffness [N/m] and damping [N s/m] of the end stops, each (6,).

    A leg carries a sixth of platform and pistons and its own reflected mass; on a stop it has the
    natural frequency and the damping ratio of the parameters.
    """
    carried = ((parameters['platform.mass'] + np.sum(parameters['legs.piston.mass'])) / 6.0
               + parameters['actuator.reflected_mass'])
    if parameters[LENGTH_MIN] is None and parameters[LENGTH_MAX] is None:
        carried = np.zeros(6)  # no stops
    omega = 2.0 * np.pi * parameters['end_stops.frequency']
    return (carried * omega ** 2,
            carried * 2.0 * parameters['end_stops.damping_ratio'] * omega)


def stops_of(parameters: Parameters) -> Array:
    """Return the stops as an array (STOPS,) for ``stop_force``."""
    stops = np.empty(STOPS)
    for where, limit, never in ((_SHORTEST, LENGTH_MIN, -math.inf),
                                (_LONGEST, LENGTH_MAX, math.inf)):
        stops[where] = never if parameters[limit] is None else parameters[limit]
    stops[_STIFFNESS], stops[_DAMPING] = stiffness_and_damping(parameters)
    return stops


@inlined
def stop_force(stops: Array, leg: int, length: float, rate: float) -> float:
    """
    Return the force of a leg's end stops [N], + pushes; a stop never pulls.

    A Kelvin-Voigt element, without the pull of its damper as the leg leaves the stop.
    """
    stiffness, damping = stops[_STIFFNESS.start + leg], stops[_DAMPING.start + leg]
    too_short = stops[_SHORTEST.start + leg] - length
    too_long = length - stops[_LONGEST.start + leg]
    if too_short > 0.0:
        return float(max(0.0, stiffness * too_short - damping * rate))
    if too_long > 0.0:
        return float(-max(0.0, stiffness * too_long + damping * rate))
    return 0.0
