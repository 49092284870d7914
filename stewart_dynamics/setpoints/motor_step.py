# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motors of each setpoint: angles, speeds, torques and temperatures, and the checks of limits.

Torques are clipped to those that are available at their speed, as forces are clipped to
limits.force_max: a drive can deliver that much. Speed and temperature cannot be clipped; they
follow limits.action, as lengths and rates of the legs do. Limits and the
temperatures of the windings are computed from the torques that setpoints demand: a clipped or
suppressed force does not hide a limit.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, Stamps
from stewart_dynamics.core.binding import function, places, Sample
from stewart_dynamics.mechanics.drives.motor_limits import MotorLimits
from stewart_dynamics.mechanics.drives.motors import Drives
from stewart_dynamics.mechanics.limits import Exceedance
from stewart_dynamics.parameters.table import Parameters

# A row of the motors of a setpoint: temperature rises of the windings [K]; whether all numbers to
# publish are finite, a limit is exceeded, and one of speed or temperature; the row of
# ``mechanics.drives``: angles, speeds, torques as published and as demanded, then the rest.
_PLACES = places('checked_motors')
RISES, SOUND, EXCEEDING, RUNNING, OF_DRIVES = (
    _PLACES[name] for name in ('rises', 'sound', 'exceeding', 'running', 'drives'))
MOTOR_ROW = OF_DRIVES.stop
ANGLES, SPEEDS, TORQUES, DEMANDED_TORQUES = (
    _PLACES[f'drives.{name}'] for name in ('angles', 'speeds', 'commands', 'breakaway_torques'))
# State of the windings: temperature rises [K], and copper heat since the last setpoint [W].
_WINDINGS = 12
_COLD = (0.0,) * _WINDINGS


class MotorStep:
    """The motors of setpoints; see ``Step``."""

    def __init__(self, parameters: Parameters, motion: Array, result: Array, forces: Array,
                 ) -> None:
        self._arguments = Drives(parameters).arguments
        self._limits = MotorLimits(parameters)
        self._warms = parameters.drive.thermal_resistance is not None
        self._sample = sample = Sample('one_motors', 'windings', 'windings', 'motors')
        self._motors = sample['motors']
        self._solve = function('check_motors_many').bound(
            *self._arguments, 1, motion, result, forces, sample['elapsed'],
            np.zeros(1, dtype=bool), sample['windings'], self._motors)

    def __call__(self, elapsed: float, before: tuple[float, ...] | None,
                 ) -> tuple[tuple[float, ...], tuple[Exceedance, ...], tuple[float, ...] | None]:
        """
        Return the row of motors (MOTOR_ROW,), exceedances, and the state of the windings.

        The row is empty if numbers overflow; rises are nan, and there is no state of the windings,
        without ``drive.thermal_resistance``. ``elapsed`` [s] is the time since the
        setpoint of the state before.
        """
        self._sample.write(elapsed, *(before or _COLD))
        self._solve()
        windings, row = self._sample.read()
        if not row[SOUND]:
            return (), (), before
        exceedances = self._limits.exceeded(
            self._motors[OF_DRIVES], self._motors[RISES]) if row[EXCEEDING] else ()
        return row, exceedances, windings if self._warms else None

    def many(self, elapsed: Array, jumped: Flags, motions: Array, results: Array, forces: Array,
             before: tuple[float, ...] | None) -> tuple[Array, tuple[float, ...] | None]:
        """Return rows (N, MOTOR_ROW) of a sequence of setpoints, and the windings' state."""
        rows = np.empty((len(motions), MOTOR_ROW))
        windings = np.array(before or _COLD)
        function('check_motors_many')(
            *self._arguments, len(motions), np.ascontiguousarray(motions), results, forces,
            elapsed, jumped, windings, rows)
        return rows, tuple(windings.tolist()) if self._warms and len(rows) else before


def times_followed(stamps: Stamps, restarts: Flags, jumped: Flags, before: int) -> Array:
    """
    Return the time [s] of each setpoint since the last one that was not a jump; 0 for restarts.

    ``before`` is the stamp of that setpoint for the first one [ns].
    """
    last = np.maximum.accumulate(np.where(jumped, -1, np.arange(len(stamps))))
    last = np.concatenate([[-1], last[:-1]])[:len(stamps)]
    elapsed = (stamps - np.where(last < 0, before, stamps[last])) * NANOSECOND
    return np.where(restarts | (elapsed < 0.0), 0.0, elapsed)
