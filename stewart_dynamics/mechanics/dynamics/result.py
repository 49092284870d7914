# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The result of the inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.motion import listed
from stewart_dynamics.mechanics.leg_columns import columns, data_frame, LEGS
from stewart_dynamics.mechanics.rows import (
    ANGLES, CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, JOINT_FORCES, LENGTHS, LEVERS, RATES,
    SPEEDS, TORQUES,
    UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import time_to_crossing

if TYPE_CHECKING:
    from pandas import DataFrame
    from plotly.graph_objects import Figure


def _column(where: slice | int, text: str) -> Any:
    """Return a property: six numbers of each row as a view, or one number of each row."""
    if isinstance(where, slice):
        return property(lambda result: result.rows[..., where], doc=text)
    # [()] makes a number of an array without a shape.
    return property(lambda result: result.rows[..., where][()], doc=text)


class InverseDynamics:
    """
    Lengths, rates and forces of the legs in a motion; (...) is the motion's leading shape.

    Attributes
    ----------
    lengths : (..., 6)
        [m]
    rates : (..., 6)
        Time derivatives of the lengths [m/s], + extends.
    forces : (..., 6)
        Forces of the actuators [N], + pushes.
    joint_forces : (..., 6)
        Forces that rods and joints carry along the legs [N], + pushes: ``forces`` without
        reflected mass and friction of the actuators. A thrust rating of a cylinder bounds these;
        the drive gives ``forces``.
    angles, speeds : (..., 6)
        Angles and speeds of cranks [rad], [rad/s]; without cranks (..., 0), as the next two.
        With cranks ``lengths`` and ``forces`` are those of the rods, forces at the platform, and
        ``rates`` are zero.
    torques : (..., 6)
        Torques of the drives at the shafts of the cranks [N m].
    levers : (..., 6)
        Torque by the push of the rod [m]; zero at a dead centre.
    unit_load_forces : (..., 6)
        Largest force of each leg under a unit load on the platform: any force F and moment M
        with F^2 + (M / l)^2 = 1, l the characteristic length.
    determinant : (...)
        det(J), the determinant of J_inv [m^3].
    determinant_rate : (...)
        d(det(J))/dt [m^3/s].
    condition_number : (...)
        Ratio of the largest to the smallest singular value of J_inv, at least 1; the right
        three columns of J_inv are divided by the characteristic length first.
    time_to_crossing : (...)
        Time after which det(J) is zero at its present rate [s]; inf: never.
    rows : (..., width)
        All numbers of each sample in a row, laid out as ``mechanics.rows`` says; the other
        attributes are views of them.

    """

    def __init__(self, rows: Array) -> None:
        self.rows = rows

    lengths: Array = _column(LENGTHS, 'Lengths [m], (..., 6).')
    rates: Array = _column(RATES, 'Time derivatives of the lengths [m/s], (..., 6).')
    forces: Array = _column(FORCES, 'Forces of the actuators [N], (..., 6).')
    joint_forces: Array = _column(JOINT_FORCES, 'Forces of rods and joints [N], (..., 6).')
    unit_load_forces: Array = _column(
        UNIT_LOAD_FORCES, 'Largest forces under a unit load, (..., 6).')
    angles: Array = _column(ANGLES, 'Angles of cranks [rad], (..., 6).')
    speeds: Array = _column(SPEEDS, 'Speeds of cranks [rad/s], (..., 6).')
    torques: Array = _column(TORQUES, 'Torques of the drives of cranks [N m], (..., 6).')
    levers: Array = _column(LEVERS, 'Levers of cranks [m], (..., 6).')
    determinant: Array = _column(DETERMINANT, 'det(J) [m^3], (...).')
    determinant_rate: Array = _column(DETERMINANT_RATE, 'd(det(J))/dt [m^3/s], (...).')
    condition_number: Array = _column(CONDITION, 'Condition number of J_inv, (...).')

    @property
    def time_to_crossing(self) -> Array:
        """Return the time after which det(J) is zero (...) [s]."""
        time: Array = time_to_crossing(self.determinant, self.determinant_rate)[()]
        return time

    def __eq__(self, other: object) -> bool:
        """Return whether shape and all numbers are equal."""
        return type(other) is type(self) and np.array_equal(self.rows, other.rows)

    # The arrays are mutable.
    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict[str, Array]:
        """
        Return the numbers as columns, each (N,), as ``pandas.DataFrame`` takes them.

        Leading shapes are flattened; SI units. The columns of the legs end in _1 to _6.
        """
        rows = self.rows.reshape(-1, self.rows.shape[-1])
        drives = {'angle': self.angles, 'speed': self.speeds, 'torque': self.torques,
                  'lever': self.levers} if self.angles.size else {}
        legs = columns({**drives, 'length': self.lengths, 'rate': self.rates, 'force': self.forces,
                        'joint_force': self.joint_forces,
                        'unit_load_force': self.unit_load_forces})
        return {**legs, 'determinant': rows[:, DETERMINANT],
                'determinant_rate': rows[:, DETERMINANT_RATE],
                'condition_number': rows[:, CONDITION],
                'time_to_crossing': np.reshape(self.time_to_crossing, -1)}

    def to_dataframe(self) -> DataFrame:
        """
        Return the numbers as a ``pandas.DataFrame``, with the columns of ``to_dict``.

        Raises
        ------
        ModuleNotFoundError
            Pandas is not installed.

        """
        return data_frame(self.to_dict())

    def plot(self, times: ArrayLike | None = None, joints: Sequence[str] = LEGS) -> Figure:
        """
        Return a plotly figure of lengths, rates and forces; of cranks angles, speeds and torques.

        Parameters
        ----------
        times : (N,), optional
            Times of the samples [s]; by default the axis shows sample numbers.
        joints : six str, optional
            Names of the legs.

        Raises
        ------
        MotionError
            There is one sample alone, or times do not fit.

        """
        from stewart_dynamics.reporting.result_figures import figure_of_legs
        curves = {'angle [rad]': self.angles, 'speed [rad/s]': self.speeds,
                  'torque [N m]': self.torques} if self.angles.shape[-1] else {
            'length [m]': self.lengths, 'rate [m/s]': self.rates, 'force [N]': self.forces}
        return figure_of_legs(curves, times, joints)

    def __repr__(self) -> str:
        """Return the numbers of a single sample, or the shape."""
        if self.rows.ndim == 1:
            return (f'<InverseDynamics: lengths {listed(self.lengths)} m, rates '
                    f'{listed(self.rates)} m/s, forces {listed(self.forces)} N, condition number '
                    f'{self.condition_number:.6g}>')
        return (f'<InverseDynamics of shape {self.rows.shape[:-1]}: lengths, rates, forces, '
                'unit_load_forces, determinant, determinant_rate, condition_number, '
                'time_to_crossing>')
