# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The limits that a pose alone may exceed.

Lengths, joint angles, clearance, singularities; and forces and torques that hold it at rest.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.mechanics.drives.motor_limits import exceeds, MotorLimits
from stewart_dynamics.mechanics.drives.motors import Drives
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.kinematics.joint_angles import angles_to_check
from stewart_dynamics.mechanics.kinematics.leg_clearance import clearance_to_check
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, Exceedance, LIMITS, Limits, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.parameters.table import Parameters


class PoseLimits:
    """
    The limits of the poses of a hexapod.

    limits: all limits of the legs.
    angles, clearance: of joints and legs; None without limits of them.
    drives, motors: motors at rows of motion, None without any, and their limits.
    stop_condition: condition number from which on a pose is singular.
    hexapod: its structure, with the axes that its limits need.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.limits = Limits(parameters)
        self._parameters, self._kind = parameters, parameters.leg_kind
        self.angles = angles_to_check(parameters, self.limits.of_joints)
        self.clearance = clearance_to_check(parameters)
        self.stop_condition = stop_condition_of(parameters)
        self.drives = Drives(parameters) if parameters.drives else None
        self.motors = MotorLimits(parameters)
        self.hexapod = limited_structure(parameters)

    def values(self, motions: Array, results: Array) -> dict[str, Array]:
        """Return the (N, 6) values of all limits at rows of motion and their results."""
        return {**self.drives_and_joints(motions, results), **self.clearances(motions)}

    @property
    def of_drives(self) -> tuple[str, ...]:
        """Return the names of the limits of drives and levers that are given."""
        kind = self._kind
        return tuple(name for name in (kind.lever_limit, *kind.position_limits)
                     if name in self.limits.bounds)

    def drives_and_joints(self, motions: Array, results: Array) -> dict[str, Array]:
        """Return the values (N, 6) of all limits but that of the clearance, which takes long."""
        kind, positions = self._kind, results[:, self._kind.position.columns]
        found = {name: kind.lever_ratios(self._parameters, results) if name == kind.lever_limit
                 else positions for name in self.of_drives}
        if self.angles is not None:
            angles = self.angles(motions)
            found.update((name, angles[:, ANGLES[name]]) for name in self.limits.of_joints)
        return found

    def clearances(self, motions: Array) -> dict[str, Array]:
        """Return the values (N, 6) of the limit of the clearance at rows of motion."""
        return {} if self.clearance is None else {CLEARANCE_MIN: self.clearance(motions)}

    def exceeded(self, values: dict[str, Array], number: int) -> Flags:
        """Return where (N,) some of the values of limits exceed theirs."""
        found = np.zeros(number, dtype=bool)
        for name, of_legs in values.items():
            found |= self.limits.exceeds(name, of_legs).any(axis=1)
        return found

    def loads(self, motions: Array, results: Array) -> dict[str, tuple[Array, Array]]:
        """
        Return values and bounds (N, 6) of the limits of forces and torques.

        At rest torques are breakaway torques: the leg must be able to move off either way.
        """
        shape = len(results), 6
        found = {name: (results[:, LIMITS[name].columns],
                        np.broadcast_to(self.limits.bounds[name], shape))
                 for name in self.limits.of_loads}
        if self.drives is not None:
            of_motors = self.motors.excesses(self.drives(motions, results), np.zeros(shape))
            found.update((name, of_motors[name]) for name in (TORQUE_MAX, TORQUE_SPEED))
        return found

    def overloaded(self, motions: Array, results: Array) -> Flags:
        """Return where (N,) forces or torques exceed a limit."""
        found = np.zeros(len(motions), dtype=bool)
        for values, bounds in self.loads(motions, results).values():
            found |= exceeds(values, bounds).any(axis=1)
        return found

    def first_exceeded(self, motion: Array, result: Array) -> Exceedance | None:
        """Return the first limit that a pose at rest exceeds, of its row of motion and result."""
        motions, results = motion[None], result[None]
        values = self.drives_and_joints(motions, results)
        found = self.limits.exceeded({name: each[0].tolist() for name, each in values.items()})
        for name, (loads, bounds) in self.loads(motions, results).items():
            leg = int(np.argmax(np.abs(loads[0]) - bounds[0]))
            if exceeds(loads[0, leg], bounds[0, leg]):
                found += Exceedance(name, leg, float(loads[0, leg]), float(bounds[0, leg])),
        if not found and self.clearance is not None:
            clearances, nearest = self.clearance.nearest(motions)
            found = self.limits.exceeded(
                {CLEARANCE_MIN: clearances[0].tolist()}, nearest[0].tolist())
        return found[0] if found else None

    def regular(self, results: Array, side: Array | float) -> Flags:
        """Return which results (N, RESULT) are not singular, with the sign of det(J) of a side."""
        with np.errstate(all='ignore'):
            found: Flags = (results[:, CONDITION] < self.stop_condition) & (
                results[:, DETERMINANT] * side > 0.0)
        return found
