# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The check of a single result, as the node's step has it; parts of states and outputs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Parameters
from stewart_dynamics.core.binding import function, places, record
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.limits import CLEARANCE_MIN, OF_JOINTS
from stewart_dynamics.mechanics.rows import MOTION, NO_BASE, RESULT
from stewart_dynamics.mechanics.singularity_warning import Singularity
from stewart_dynamics.setpoints.step import Batch, FIRST, OUTPUT, Outputs, WARNING_STATE

EXCEEDING = places('stewart_output')['exceeding']


def state_of(singularity: Singularity, **fields: Any) -> NDArray[np.float64]:
    """Return a state of the step: a singularity warning, and other fields."""
    state = FIRST.copy()
    found = state_record(state)
    for field, value in fields.items():
        found[field] = value
    for field, value in zip(
            ('warning', 'stopped', 'determinant', 'time_to_crossing', 'crossings'), singularity,
            strict=True):
        found[field] = value
    return state


def part_of(outputs: Outputs, which: Any) -> Outputs:
    """Return the outputs of some setpoints, as new arrays; all were answered."""
    return outputs._replace(**{name: getattr(outputs, name)[which].copy()
                               for name in ('answered', 'stamps', 'rows')})


def state_record(state: NDArray[np.float64]) -> Any:
    """Return a state of the step as the structure () that it is."""
    return state.view(record('stewart_state')).reshape(())


def checked(parameters: Parameters, result: NDArray[np.float64],
            state: Singularity | None = None, base_known: bool = True,
            ) -> tuple[Singularity, bool]:
    """Return the state of the warning after a result, and whether it exceeds a limit."""
    setpoint = Batch.from_parts(1, np.zeros(MOTION), bases=None if base_known else NO_BASE)
    before, output = state_of(state or Singularity()), np.zeros((1, OUTPUT))
    # Limits of joints, clearance and motors are not in a result.
    hexapod = hexapod_structure(parameters.replaced(dict.fromkeys((*OF_JOINTS, CLEARANCE_MIN))))
    output[0, :RESULT] = result
    function('complete_outputs')(hexapod, 1, setpoint.rows, output)
    function('step_setpoints')(hexapod, 1, 1, setpoint.stamps, setpoint.rows, before, output)
    return Singularity.of(output[0, WARNING_STATE].tolist()), bool(output[0, EXCEEDING])
