# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The limits of the motors: which motor exceeds which, and by how much."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import places
from stewart_dynamics.mechanics.drives.motors import (
    AVAILABLE_TORQUES, motor_ratio)
from stewart_dynamics.mechanics.limits import (
    LIMITS, OF_MOTORS, TOLERANCE, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.parameters.table import Parameters, six_of, UNIVERSAL

_WITHOUT_TWIST = 0.9
# In a row of outputs: where the row of motors begins, and the temperature rises.
_FIRST, _RISES = places('stewart_output')['motors'].start, places('stewart_output')['rises']


class MotorLimits:
    """
    The limits of the motors of a hexapod; those that are not given are never exceeded.

    bounds: values (6,) of each of OF_MOTORS that is given [N m, rad/s, K]; torques at any speed
        are at most drive.torque_max.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._curve = parameters.drive.torque_speed is not None
        self.bounds: dict[str, Array] = {
            limit: six_of(parameters[limit], math.inf)
            for limit in OF_MOTORS if limit != TORQUE_SPEED}

    def excesses(self, rows: Array, rises: Array) -> dict[str, tuple[Array, Array]]:
        """Return values and bounds (..., 6) of each limit for rows of motors, and rises [K]."""
        available, found = rows[..., AVAILABLE_TORQUES], {}
        for name in OF_MOTORS:
            at = LIMITS[name].columns
            values = rises if at == _RISES else rows[..., at.start - _FIRST:at.stop - _FIRST]
            if name == TORQUE_SPEED:
                most = self.bounds[TORQUE_MAX]
                bounds = np.where(available < most, available, math.inf)
            else:
                bounds = np.broadcast_to(self.bounds[name], values.shape)
            found[name] = values, bounds
        return found


def largest_torques(p: Parameters, speeds: Array) -> Array:
    """Return the largest torques [N m] at magnitudes of the motors' speeds (..., 6) [rad/s]."""
    torques, curve = np.full(speeds.shape, math.inf), p.drive.torque_speed
    if curve is not None:
        torques = np.where(speeds > curve[-1, 0] * (1.0 + TOLERANCE), 0.0,
                           np.interp(speeds, *curve.T))
    largest: Array = np.minimum(six_of(p.drive.torque_max, math.inf), torques)
    return largest


def largest_speeds(p: Parameters) -> Array:
    """Return the largest speeds (6,) [rad/s]: there is no torque beyond the torque-speed curve."""
    curve = p.drive.torque_speed
    speeds: Array = np.minimum(
        six_of(p.drive.speed_max, math.inf), math.inf if curve is None else curve[-1, 0])
    return speeds


def force_limits(p: Parameters, rates: Array) -> Array:
    """
    Return leg forces (..., 6) [N] that motors can drive at rates of the legs (..., 6) [m/s].

    For reflected masses that move uniformly; infinite without limits of torque.
    """
    ratio = motor_ratio(p)
    forces: Array = largest_torques(p, ratio * np.abs(rates)) * ratio * p.drive.efficiency
    return forces


def rate_limits(p: Parameters) -> Array:
    """Return rates of the legs (6,) [m/s] below which no motor exceeds a limit of speed."""
    # The twist of a leg adds little to the speed of its motor.
    rates: Array = largest_speeds(p) / motor_ratio(p) * (
        _WITHOUT_TWIST if p.drive.screw_rotation == UNIVERSAL else 1.0)
    return rates


def exceeds(values: Array, bounds: Array) -> Flags:
    """Return where values exceed bounds; nan never does."""
    exceeding: Flags = np.abs(values) > bounds * (1.0 + TOLERANCE)
    return exceeding
