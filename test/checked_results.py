# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The check of a single result, as the node's step has it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Parameters
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, OF_JOINTS
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.mechanics.singularity_warning import Singularity, STATE


def checked(parameters: Parameters, result: NDArray[np.float64],
            state: Singularity | None = None, base_known: bool = True,
            ) -> tuple[Singularity, bool]:
    """Return the state of the warning after a result, and whether it exceeds a limit."""
    stamp, last = np.array([1]), np.array([0])
    before = np.array(state or Singularity(), dtype=float)
    states, flags = np.empty((1, STATE)), np.empty((3, 1), dtype=bool)
    none: NDArray[np.float64] = np.empty((1, 0))
    # Limits of joints, clearance and motors are not in a result.
    unchecked = parameters.replaced(dict.fromkeys((*OF_JOINTS, CLEARANCE_MIN)))
    function('check_many')(
        hexapod_structure(parameters), *PoseLimits(unchecked).arguments, 1, stamp,
        np.array([base_known]), np.array([False]), np.zeros(1), np.zeros((1, MOTION)), none, none,
        before, last, np.full(6, np.nan), np.zeros(12), result[None].copy(), np.empty((1, 6)),
        states, none, *flags)
    return Singularity.of(states[0].tolist()), bool(flags[1, 0])
