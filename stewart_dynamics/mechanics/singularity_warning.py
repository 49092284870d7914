# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The singularity warning: thresholds, hysteresis, and prediction of crossings.

Near det(J) = 0 leg forces grow as 1 / det. A crossing may be between two samples, so a change of
sign counts as one; it is predicted from d(det)/dt.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics.core.binding import CONSTANTS
from stewart_dynamics.parameters.table import Parameters

# At this condition number a solution of J_inv^T f = wrench has fewer than four valid digits of
# sixteen: forces are neither computed nor published.
UNSOLVABLE_CONDITION = CONSTANTS['UNSOLVABLE_CONDITION']

HYSTERESIS = CONSTANTS['HYSTERESIS']
"""
A singularity warning or stop ends below this part of the condition number at which it began, or
when the predicted time to the crossing exceeds warn_time divided by it.
"""


def stop_condition_of(parameters: Parameters) -> float:
    """Return the condition number from which on a pose counts as singular."""
    return min(parameters.singularity.stop_condition, UNSOLVABLE_CONDITION)


class Cause(IntEnum):
    """Cause of the warning."""

    NONE = 0
    CONDITION = 1
    PREDICTED = 2
    CROSSED = 3

    @property
    def text(self) -> str:
        """Return the cause as text."""
        return _TEXTS[self]


_TEXTS = {
    Cause.NONE: 'none',
    Cause.CONDITION: 'condition number above warn_condition',
    Cause.PREDICTED: 'crossing of det(J) = 0 predicted within warn_time',
    Cause.CROSSED: 'det(J) changed its sign since the last sample',
}

# The state after a sample as an array: the cause, whether the condition number is inside
# stop_condition, the last det(J) that was not zero, time to crossing, changes of sign so far.
CAUSE, STOPPED, LAST, TIME, CROSSINGS, STATE = range(6)


def time_to_crossing(determinant: ArrayLike, determinant_rate: ArrayLike) -> NDArray[Any]:
    """Return the time after which det(J) is zero at its present rate [s]; inf if never."""
    det, rate = np.asarray(determinant, dtype=float), np.asarray(determinant_rate, dtype=float)
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        time = -det / rate
    return np.where(time >= 0.0, time, np.inf)


class Singularity(NamedTuple):
    """
    The state of the warning after a sample, in the order of an array (STATE,).

    The first sample follows Singularity().
    """

    cause: Cause = Cause.NONE
    stopped: bool = False  # inside stop_condition
    determinant: float = 0.0  # the last that was not zero
    time_to_crossing: float = math.inf
    crossings: int = 0  # changes of sign of det(J) so far

    @property
    def warning(self) -> bool:
        """Whether the warning is on."""
        return self.cause is not Cause.NONE

    @classmethod
    def of(cls, numbers: Iterable[float]) -> Singularity:
        """Return the state of an array (STATE,)."""
        cause, stopped, determinant, time, crossings = numbers
        return cls(_CAUSES[int(cause)], stopped > 0.0, determinant, time, int(crossings))


_CAUSES = tuple(Cause)  # far faster to look up by number than Cause(number)
