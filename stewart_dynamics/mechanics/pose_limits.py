# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The limits that a pose alone may exceed: lengths, joint angles, clearance, singularities."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.mechanics.kinematics.joint_angles import angles_to_check
from stewart_dynamics.mechanics.kinematics.leg_clearance import clearance_to_check
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, LENGTH_MAX, LENGTH_MIN, Limits)
from stewart_dynamics.mechanics.rows import CONDITION, DETERMINANT, LENGTHS
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.parameters.table import Parameters


class PoseLimits:
    """
    The limits of the poses of a hexapod.

    limits: all limits of the legs.
    angles, clearance: of joints and legs; None without limits of them.
    stop_condition: condition number from which on a pose is singular.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.limits = Limits(parameters)
        self.angles = angles_to_check(parameters, self.limits.of_joints)
        self.clearance = clearance_to_check(parameters)
        self.stop_condition = stop_condition_of(parameters)

    def values(self, motions: Array, results: Array) -> dict[str, Array]:
        """Return the values (N, 6) of all limits at rows of motion and their results."""
        return {**self.lengths_and_angles(motions, results), **self.clearances(motions)}

    def lengths_and_angles(self, motions: Array, results: Array) -> dict[str, Array]:
        """Return the values (N, 6) of all limits but that of the clearance, which takes long."""
        lengths = results[:, LENGTHS]
        found = {name: lengths for name in (LENGTH_MIN, LENGTH_MAX) if name in self.limits.bounds}
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

    def regular(self, results: Array, side: Array | float) -> Flags:
        """Return which results (N, RESULT) are not singular, with the sign of det(J) of a side."""
        with np.errstate(all='ignore'):
            found: Flags = (results[:, CONDITION] < self.stop_condition) & (
                results[:, DETERMINANT] * side > 0.0)
        return found
