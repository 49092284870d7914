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

"""The result of the check of a planned trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field
import math

import numpy as np

from stewart_dynamics.arrays import Array


def _no_legs() -> Array:
    return np.empty((0, 6))


@dataclass(frozen=True, eq=False)
class PlannedTrajectory:
    """The result of the check of a planned trajectory."""

    accepted: bool
    message: str
    """In words: 'accepted: 201 points over 2 s' or 'rejected: at 0.055 s leg_3: rate ...'."""
    points: int
    duration: float
    """From the first point to the last [s]."""
    reason: str = ''
    """Reason of the rejection, a constant of ``planned.trajectory`` or ``planned.checks``."""
    time: float = math.nan
    """Time of the first violation [s]."""
    leg: int | None = None
    """Leg of the violation, 0 to 5; None if it is not of a leg."""
    limit: str = ''
    """The limit that is exceeded, 'limits.velocity_max'; empty if no limit is exceeded."""
    lengths: Array = field(default_factory=_no_legs, repr=False)
    """At the points (N, 6) [m]; (0, 6) where rejected."""
    rates: Array = field(default_factory=_no_legs, repr=False)
    """At the points (N, 6) [m/s], + extends; (0, 6) where rejected."""
    forces: Array = field(default_factory=_no_legs, repr=False)
    """Actuator forces at the points (N, 6) [N], + pushes; (0, 6) where rejected."""
    warning: bool = False
    """Accepted, but the condition number reaches singularity.warn_condition."""
    condition_number: float = math.nan
    """The largest, at points and between them; nan where rejected."""
    condition_time: float = math.nan
    """Time of the largest condition number [s]."""
    force: float = math.nan
    """The largest absolute force, at points and between them [N]; nan where rejected."""
    force_leg: int | None = None
    """Leg of the largest force, 0 to 5."""
    load: float = math.nan
    """The largest absolute force as a part of limits.force_max; 0 without that limit."""
