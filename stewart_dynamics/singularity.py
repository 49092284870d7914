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

"""
How near a singularity a motion is, and the warning of it.

Near det(J) = 0 leg forces grow as 1 / det. A crossing may fall between two samples, so a
change of sign counts as one; and since d(det)/dt is known, it is foretold.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics.parameters import Parameters

# From here on a solution of J_inv^T f = wrench keeps fewer than four of its sixteen digits:
# forces are neither computed nor published.
UNSOLVABLE_CONDITION = 1e12

# A warning or stop ends below this part of the condition at which it began, a foretold
# crossing beyond the time divided by it.
LEAVING = 0.8


def time_to_crossing(determinant: ArrayLike, determinant_rate: ArrayLike) -> NDArray[Any]:
    """Return after how long det(J) is zero if it goes on at its rate [s]; inf where never."""
    det, rate = np.asarray(determinant, dtype=float), np.asarray(determinant_rate, dtype=float)
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        time = -det / rate
    return np.where(time >= 0.0, time, np.inf)


class Cause(Enum):
    """Why the warning is on."""

    NONE = 'none'
    CONDITION = 'condition number above warn_condition'
    FORETOLD = 'crossing of det(J) = 0 foretold within warn_time'
    CROSSED = 'det(J) changed its sign since the last sample'


class Singularity(NamedTuple):
    """The state of the warning after a sample; the first sample follows Singularity()."""

    warning: bool = False
    stopped: bool = False
    """Inside stop_condition."""
    cause: Cause = Cause.NONE
    determinant: float = 0.0
    time_to_crossing: float = np.inf
    crossings: int = 0
    """Changes of sign of det(J) so far."""

    def after(self, parameters: Parameters, determinant: float, determinant_rate: float,
              condition: float) -> Singularity:
        """Return the state after one more sample."""
        crossed = determinant * self.determinant < 0.0
        time = -determinant / determinant_rate if determinant_rate else np.inf
        time = time if time >= 0.0 else np.inf
        warn_at = parameters['singularity.warn_condition'] * (LEAVING if self.warning else 1.0)
        stop_at = parameters['singularity.stop_condition'] * (LEAVING if self.stopped else 1.0)
        warn_time = parameters['singularity.warn_time'] / (LEAVING if self.warning else 1.0)
        cause = (Cause.CROSSED if crossed
                 else Cause.CONDITION if condition >= warn_at
                 else Cause.FORETOLD if time < warn_time
                 else Cause.NONE)
        return Singularity(
            cause is not Cause.NONE, condition >= stop_at, cause,
            determinant or self.determinant, time, self.crossings + crossed)
