# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Pulse widths of hobby servos by two measured points of each: ``stewart_servo_pulses`` in C."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import CODES, function
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.mechanics.arguments import as_array, place
from stewart_dynamics.parameters.table import Parameters

_POINTS = 'servo.angle_at_min', 'servo.angle_at_max'


def servo_pulses(parameters: Parameters, positions: ArrayLike) -> Array:
    """
    Return the pulse widths (..., 6) [s] that turn servos to positions (..., 6) [rad].

    They are never outside ``servo.pulse_min`` and ``servo.pulse_max``.

    Raises
    ------
    ParameterError
        ``servo.angle_at_min`` and ``servo.angle_at_max`` are not set.
    MotionError
        A position is not between them: names sample and leg.

    """
    wanted = as_array(parameters.leg_kind.position.field, positions, (6,))
    pulses: Array = np.empty(wanted.shape)
    rows, found = np.ascontiguousarray(wanted.reshape(-1, 6)), pulses.reshape(-1, 6)
    call = function('stewart_servo_pulses')
    for n in range(len(rows)):
        code = call(parameters.structure, rows[n], found[n])
        if code == CODES['STEWART_NO_SERVOS']:
            raise ParameterError(f'{parameters.source}: {", ".join(_POINTS)}: not set: needed by '
                                 'pulse widths of servos')
        if code != CODES['STEWART_OK']:
            raise MotionError(f'sample {place(n, wanted.shape[:-1])}: '
                              f'{_outside(parameters, rows[n])}')
    return pulses


def _outside(parameters: Parameters, positions: Array) -> str:
    """Return which position is farthest outside the points of its servo, and by what bounds."""
    ends = np.stack([np.broadcast_to(parameters[name], 6) for name in _POINTS])
    low, high = ends.min(axis=0), ends.max(axis=0)
    leg = int(np.argmax(np.maximum(low - positions, positions - high)))
    of = parameters.leg_kind.position
    return (f'{parameters.joints[leg]}: {of.name} {positions[leg]:.6g} {of.unit}: must be between '
            f'{" and ".join(_POINTS)}, {low[leg]:.6g} and {high[leg]:.6g}')
