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

"""The result of the inverse dynamics."""

from __future__ import annotations

from typing import NamedTuple

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, RATES, UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import time_to_crossing


class InverseDynamics(NamedTuple):
    """
    Lengths, rates and forces of the legs in a motion; (...) is the motion's leading shape.

    Attributes
    ----------
    lengths : (..., 6)
        [m]
    rates : (..., 6)
        Time derivatives of the lengths [m/s], + extends.
    forces : (..., 6)
        Of the actuators [N], + pushes.
    unit_load_forces : (..., 6)
        Largest force of each leg under a unit load on the platform: any force F and moment M
        with F^2 + (M / l)^2 = 1, l the characteristic length.
    determinant : (...)
        det(J) := det(J_inv) [m^3].
    determinant_rate : (...)
        d(det(J))/dt [m^3/s].
    condition_number : (...)
        Ratio of the largest to the smallest singular value of J_inv, at least 1; the right
        three columns of J_inv are divided by the characteristic length first.
    time_to_crossing : (...)
        Time after which det(J) is zero at its present rate [s]; inf: never.

    """

    lengths: Array
    rates: Array
    forces: Array
    unit_load_forces: Array
    determinant: Array
    determinant_rate: Array
    condition_number: Array

    @property
    def time_to_crossing(self) -> Array:
        """Time after which det(J) is zero at its present rate, (...) [s]; inf: never."""
        return time_to_crossing(self.determinant, self.determinant_rate)

    @classmethod
    def of_rows(cls, results: Array) -> InverseDynamics:
        """Return the fields of rows of results (..., RESULT)."""
        return cls(
            results[..., LENGTHS], results[..., RATES], results[..., FORCES],
            results[..., UNIT_LOAD_FORCES],
            # [()] makes a number of an array without a shape
            results[..., DETERMINANT][()], results[..., DETERMINANT_RATE][()],
            results[..., CONDITION][()])

    def __repr__(self) -> str:
        """Return the shape, not the arrays."""
        return f'<InverseDynamics of shape {self.lengths.shape[:-1]}: {", ".join(self._fields)}>'
