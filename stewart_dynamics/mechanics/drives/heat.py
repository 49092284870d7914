# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Heat in the windings of the motors: temperature, and the RMS torque of a motion."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.mechanics.batch import compact
from stewart_dynamics.parameters.table import Parameters


@inlined
def warmed(rise: float, heat: float, time: float, resistance: float, time_constant: float,
           ) -> float:
    """Return a temperature rise [K] after a time [s] of constant copper heat [W]."""
    return rise + (rise - heat * resistance) * math.expm1(-time / time_constant)


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[:,::1]')
def warm(times: Array, heat: Array, resistance: Array, time_constant: Array, rises: Array,
         ) -> None:
    """
    Write temperature rises (N, 6) [K] of windings: ``T' = (heat resistance - T) / time_constant``.

    The heat of each time is held until the next one: for that the rises are exact. The first of
    them is given.

    times (N,): [s]
    heat (N, 6): copper heat [W].
    resistance, time_constant (6,): from winding to ambient [K/W], and of the winding [s].
    rises (N, 6): above ambient; the first row is read, the others are written.
    """
    for n in range(1, len(times)):
        for leg in range(6):
            rises[n, leg] = warmed(rises[n - 1, leg], heat[n - 1, leg], times[n] - times[n - 1],
                                   resistance[leg], time_constant[leg])


def temperature_rises(p: Parameters, times: Array, heat: Array, first: Array | None = None,
                      ) -> Array:
    """
    Return the temperature rises (N, 6) [K] of the windings above ambient, see ``warm``.

    ``first`` (6,) is the rise at the first time [K], zero by default. nan without
    ``drive.thermal_resistance``.
    """
    rises = np.full(heat.shape, np.nan)
    if p['drive.thermal_resistance'] is not None:
        rises[:1] = 0.0 if first is None else first
        warm(compact(times), compact(heat), p['drive.thermal_resistance'],
             p['drive.thermal_time_constant'], rises)
    return rises
