# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Heat in the windings of the motors: temperature, and the RMS torque of a motion."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.batch import compact
from stewart_dynamics.parameters.table import Parameters


def temperature_rises(p: Parameters, times: Array, heat: Array, first: Array | None = None,
                      ) -> Array:
    """
    Return the temperature rises (N, 6) [K] of the windings above ambient.

    ``T' = (heat resistance - T) / time_constant``; the copper heat (N, 6) [W] of each time is held
    until the next one: for that the rises are exact. ``first`` (6,) is the rise at the first time
    [K], zero by default. nan without ``drive.thermal_resistance``.
    """
    rises = np.full(heat.shape, np.nan)
    resistance, time_constant = p.drive.thermal_resistance, p.drive.thermal_time_constant
    if resistance is not None and time_constant is not None:
        rises[:1] = 0.0 if first is None else first
        function('warm_many')(
            len(times), compact(times), compact(heat), resistance, time_constant, rises)
    return rises
