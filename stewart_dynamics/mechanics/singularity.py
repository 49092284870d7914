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

from collections.abc import Iterable
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.jit import inlined
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


WARNING_CAUSES = tuple(Cause)
_CODES = {cause: code for code, cause in enumerate(WARNING_CAUSES)}


# A state as numbers: the cause's place in WARNING_CAUSES, whether it is inside
# stop_condition, the last det(J) that was not zero, time to crossing, changes of sign so far.
CAUSE, STOPPED, LAST, TIME, CROSSINGS, STATE = range(6)

_NONE, _CONDITION, _FORETOLD, _CROSSED = range(4)


@inlined
def advance(state: Array, thresholds: Array, determinant: float, determinant_rate: float,
            condition: float) -> None:
    """
    Bring a state on by one more sample.

    Parameters
    ----------
    state : (STATE,)
        Written.
    thresholds : (3,)
        warn_condition, stop_condition, warn_time.
    determinant, determinant_rate, condition : float
        Of the sample.

    """
    leaving = LEAVING if state[CAUSE] > 0.0 else 1.0
    time = -determinant / determinant_rate if determinant_rate != 0.0 else np.inf
    if not time >= 0.0:
        time = np.inf
    cause = _NONE
    if determinant * state[LAST] < 0.0:
        cause = _CROSSED
        state[CROSSINGS] += 1.0
    elif condition >= thresholds[0] * leaving:
        cause = _CONDITION
    elif time < thresholds[2] / leaving:
        cause = _FORETOLD
    stop = thresholds[1] * (LEAVING if state[STOPPED] > 0.0 else 1.0)
    state[CAUSE], state[STOPPED], state[TIME] = cause, condition >= stop, time
    if determinant != 0.0:
        state[LAST] = determinant


class Singularity(NamedTuple):
    """The state of the warning after a sample; the first sample follows Singularity()."""

    cause: Cause = Cause.NONE
    stopped: bool = False
    """Inside stop_condition."""
    determinant: float = 0.0
    """The last that was not zero."""
    time_to_crossing: float = np.inf
    crossings: int = 0
    """Changes of sign of det(J) so far."""

    @property
    def warning(self) -> bool:
        """Whether the warning is on."""
        return self.cause is not Cause.NONE

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Singularity:
        """Return the state that is in STATE numbers."""
        cause, stopped, determinant, time, crossings = numbers
        return cls(WARNING_CAUSES[int(cause)], stopped > 0.0, determinant, time, int(crossings))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The state in STATE numbers."""
        return (_CODES[self.cause], self.stopped, self.determinant, self.time_to_crossing,
                self.crossings)

    def after(self, parameters: Parameters, determinant: float, determinant_rate: float,
              condition: float) -> Singularity:
        """Return the state after one more sample."""
        state = np.array(self.numbers)
        advance(state, thresholds(parameters), determinant, determinant_rate, condition)
        return Singularity.of(state.tolist())


def thresholds(parameters: Parameters) -> Array:
    """Return warn_condition, stop_condition and warn_time (3,)."""
    return np.array([parameters['singularity.warn_condition'],
                     parameters['singularity.stop_condition'],
                     parameters['singularity.warn_time']])
