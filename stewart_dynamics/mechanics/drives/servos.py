# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Pulse widths of hobby servos by two measured points of each: ``stewart_servo_pulses`` in C."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.core.binding import CODES, function
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.mechanics.arguments import as_array, place
from stewart_dynamics.parameters.table import Parameters

_POINTS = 'servo.angle_at_min', 'servo.angle_at_max'


def with_servos(parameters: Parameters) -> bool:
    """Return whether pulse widths can be computed: the points of the servos are measured."""
    return parameters.servo.angle_at_min is not None


def pulse_rows(parameters: Parameters, positions: Array) -> tuple[Array, Integers]:
    """
    Return pulse widths (N, 6) [s], nan where the code is not STEWART_OK, and the codes (N,).

    positions (N, 6): of the drives [rad].
    """
    pulses, codes = np.empty(positions.shape), np.empty(len(positions), dtype=np.int64)
    function('servo_pulses_many')(
        parameters.structure, len(positions), np.ascontiguousarray(positions), pulses, codes)
    return pulses, codes


def servo_pulses(parameters: Parameters, positions: ArrayLike) -> Array:
    """Return the pulse widths of servos: ``StewartPlatform.servo_pulses``."""
    if not with_servos(parameters):
        raise ParameterError(f'{parameters.source}: {", ".join(_POINTS)}: not set: needed by '
                             'pulse widths of servos')
    wanted = as_array(parameters.leg_kind.position.field, positions, (6,))
    rows = wanted.reshape(-1, 6)
    pulses, codes = pulse_rows(parameters, rows)
    if (wrong := np.flatnonzero(codes != CODES['STEWART_OK'])).size:
        n = int(wrong[0])
        raise MotionError(f'sample {place(n, wanted.shape[:-1])}: '
                          f'{outside_servos(parameters, rows[n])}')
    return pulses.reshape(wanted.shape)


def outside_servos(parameters: Parameters, positions: Array) -> str:
    """
    Return the position, of six, that is farthest outside the points of its servo, and the bounds.

    Empty where all are between them.
    """
    if pulse_rows(parameters, positions[None])[1][0] == CODES['STEWART_OK']:
        return ''
    ends = np.stack([np.broadcast_to(parameters[name], 6) for name in _POINTS])
    low, high = ends.min(axis=0), ends.max(axis=0)
    leg = int(np.argmax(np.maximum(low - positions, positions - high)))
    of = parameters.leg_kind.position
    return (f'{parameters.joints[leg]}: {of.name} {positions[leg]:.6g} {of.unit}: must be between '
            f'{" and ".join(_POINTS)}, {low[leg]:.6g} and {high[leg]:.6g}')
