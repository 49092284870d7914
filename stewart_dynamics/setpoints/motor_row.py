# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The row of the motors of a setpoint: angles, speeds, torques and temperatures.

Torques are clipped to those that are available at their speed, as forces are clipped to
limits.force_max: a drive can deliver that much. Speed and temperature cannot be clipped; they
follow limits.action, as lengths and rates of the legs do. Limits and the
temperatures of the windings are computed from the torques that setpoints demand: a clipped or
suppressed force does not hide a limit.
"""

from __future__ import annotations

from stewart_dynamics.core.binding import places

# A row of the motors of a setpoint: temperature rises of the windings [K]; whether all numbers to
# publish are finite, a limit is exceeded, and one of speed or temperature; the row of
# ``mechanics.drives``: angles, speeds, torques as published and as demanded, then the rest.
_PLACES = places('checked_motors')
RISES, SOUND, EXCEEDING, RUNNING, OF_DRIVES = (
    _PLACES[name] for name in ('rises', 'sound', 'exceeding', 'running', 'drives'))
MOTOR_ROW = OF_DRIVES.stop
ANGLES, SPEEDS, TORQUES, DEMANDED_TORQUES = (
    _PLACES[f'drives.{name}'] for name in ('angles', 'speeds', 'commands', 'breakaway_torques'))
WINDINGS = 12
"""State of the windings: temperature rises [K], and copper heat since the last setpoint [W]."""
