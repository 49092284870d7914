# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The check of a single result, as the node's step has it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Parameters
from stewart_dynamics.core.binding import function, places
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, OF_JOINTS
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import MOTION, NO_BASE, RESULT
from stewart_dynamics.mechanics.singularity_warning import Singularity
from stewart_dynamics.setpoints.step import Batch, FIRST, OUTPUT, WARNING_STATE

EXCEEDING = places('setpoint_output')['exceeding']


def checked(parameters: Parameters, result: NDArray[np.float64],
            state: Singularity | None = None, base_known: bool = True,
            ) -> tuple[Singularity, bool]:
    """Return the state of the warning after a result, and whether it exceeds a limit."""
    setpoint = Batch.of(1, np.zeros(MOTION), bases=None if base_known else NO_BASE)
    before, output = FIRST.copy(), np.zeros((1, OUTPUT))
    before[places('step_state')['warning']] = state or Singularity()
    output[0, :RESULT] = result
    none: NDArray[np.float64] = np.empty((1, 0))
    # Limits of joints, clearance and motors are not in a result.
    unchecked = parameters.replaced(dict.fromkeys((*OF_JOINTS, CLEARANCE_MIN)))
    function('check_setpoints')(
        hexapod_structure(parameters), *PoseLimits(unchecked).arguments, np.zeros(6), 0.0, 0.0, 1,
        1, setpoint.stamps, setpoint.rows, none, none, before, output, none)
    return Singularity.of(output[0, WARNING_STATE].tolist()), bool(output[0, EXCEEDING])
