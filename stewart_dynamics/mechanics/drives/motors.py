# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motors of the legs: angle, speed, torque, current, power and copper heat.

A motor turns k = 2 pi gear_ratio / lead radians for each metre of its drive's coordinate q, which
is the length L of its leg, + extends. The force f of the leg is that of ``inverse_dynamics``, with
friction and reflected mass m_r; the part through the screw is the load f - m_r q'', and
J = m_r / k^2 is the inertia at the motor's shaft:

    torque = (f - m_r q'') c / k + J angle''
    c = 1 + (1 / efficiency - 1) sat(|q'| / coulomb_velocity)              the motor drives
    c = 1 + (back_driving_efficiency - 1) sat(|q'| / coulomb_velocity)     the leg drives

The losses are friction proportional to the load, and like Coulomb friction they are linear near
standstill (``friction``): the torque does not jump where a leg reverses. At rest it is the one
without losses. There friction can help to hold or be in the way, whichever way the leg moves off:
the larger of the two torques, the breakaway torque, is what limits are checked with.

    current = torque / torque_constant        copper heat = resistance current^2
    power = torque speed + copper heat        from the bus; where it is negative, back to the bus

Where the screw turns with the leg, by its twist, a right-handed thread extends the leg by
lead / (2 pi) for each radian. The motor takes that back: q is L less that extension
(``turning_screws``), gear_ratio times the twist is subtracted from the angle, added where the
thread is left-handed. The moments of the screws about the legs' axes, force times lead / (2 pi),
are part of the leg forces: the torque of an ideal screw is f / k, and its power f q'.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function, places
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.leg_columns import columns, LEGS
from stewart_dynamics.parameters.table import Parameters

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


# A row of the six motors' quantities. Commands are the torques of the forces that are published,
# clipped to the available torques.
(ANGLES, SPEEDS, COMMANDS, BREAKAWAY_TORQUES, TORQUES, ACCELERATIONS, CURRENTS, POWER, COPPER_HEAT,
 AVAILABLE_TORQUES) = places('stewart_motors').values()
MOTORS = AVAILABLE_TORQUES.stop
# Columns in the order of the C source.
MECHANICAL = np.r_[ANGLES, SPEEDS, ACCELERATIONS, TORQUES]

# Columns of a table of motors, in the order of Motors.
_COLUMNS = ('angle', 'speed', 'acceleration', 'torque', 'current', 'power', 'copper_heat',
            'breakaway_torque', 'available_torque')


class Motors(NamedTuple):
    """
    The six motors in a motion, (..., 6) each; nan where ``drive.*`` does not give them.

    Attributes
    ----------
    angles, speeds, accelerations : (..., 6)
        [rad], [rad/s], [rad/s^2]; + extends the leg. The angle is zero where the published leg
        position is zero.
    torques : (..., 6)
        [N m]; at rest the one without losses.
    currents : (..., 6)
        [A]
    power : (..., 6)
        Electrical power [W]; where it is negative, power flows back to the bus.
    copper_heat : (..., 6)
        Part of it that heats the winding [W].
    breakaway_torques : (..., 6)
        [N m]; torques that limits are checked with: at rest, where the leg can move off either
        way, the larger one.
    available_torques : (..., 6)
        Largest torque at this speed, by ``drive.torque_max`` and ``drive.torque_speed`` [N m].

    """

    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array
    currents: Array
    power: Array
    copper_heat: Array
    breakaway_torques: Array
    available_torques: Array

    @classmethod
    def of_rows(cls, rows: Array) -> Motors:
        """Return the motors of rows (..., MOTORS)."""
        return cls(*(rows[..., part] for part in (
            ANGLES, SPEEDS, ACCELERATIONS, TORQUES, CURRENTS, POWER, COPPER_HEAT,
            BREAKAWAY_TORQUES, AVAILABLE_TORQUES)))

    @property
    def margins(self) -> Array:
        """Return available less breakaway torques (..., 6) [N m]; negative where exceeded."""
        margins: Array = self.available_torques - np.abs(self.breakaway_torques)
        return margins

    def to_dict(self) -> dict[str, Array]:
        """
        Return the numbers as columns, each (N,), as ``pandas.DataFrame`` takes them.

        Leading shapes are flattened; SI units. The columns of the motors end in _1 to _6.
        """
        return columns(dict(zip(_COLUMNS, self, strict=True)))

    def plot(self, times: ArrayLike | None = None, joints: Sequence[str] = LEGS) -> Figure:
        """
        Return a plotly figure of speeds and torques, and of currents and power if known.

        Arguments and errors are those of ``InverseDynamics.plot``.
        """
        from stewart_dynamics.reporting.result_figures import figure_of_legs
        curves = {'speed [rad/s]': self.speeds, 'torque [N m]': self.torques,
                  'current [A]': self.currents, 'power [W]': self.power}
        known = {name: each for name, each in curves.items() if np.isfinite(each).any()}
        return figure_of_legs(known or curves, times, joints)

    def __repr__(self) -> str:
        """Return the shape, not the arrays."""
        return f'<Motors of shape {self.angles.shape[:-1]}: {", ".join(self._fields)}>'


class Drives:
    """The motors of a hexapod: rows of motions and of their results to rows of motors."""

    def __init__(self, parameters: Parameters) -> None:
        self._hexapod = hexapod_structure(parameters)
        self._efforts = parameters.leg_kind.effort.columns

    def __call__(self, motions: Array, results: Array) -> Array:
        """Return rows (N, MOTORS) for rows of motion and results, unchecked."""
        rows = np.empty((len(motions), MOTORS))
        efforts = batch.compact(results[:, self._efforts])
        batch.in_parts(self._write, (), batch.compact(motions), efforts, rows)
        return rows

    def _write(self, motions: Array, efforts: Array, rows: Array) -> None:
        function('motors_many')(self._hexapod, len(motions), motions, efforts, efforts, rows)


def motor_ratio(parameters: Parameters) -> Array:
    """Return the turn of the motors for a metre of their legs (6,) [rad/m]; nan if not given."""
    ratio: Array = parameters.structure['legs']['motor_ratio']
    return ratio
