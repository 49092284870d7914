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


"""The limits of the legs: which there are, and when one is exceeded."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Six
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.rows import consecutive, FORCES, LENGTHS, RATES
from stewart_dynamics.parameters import Parameters

LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX = LIMITS = (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')

# A value exceeds a limit only by more than this part of it: rounding errors are below.
TOLERANCE = 1e-9

# Thresholds in a row, in the order of LIMITS.
_SHORTEST, _LONGEST, _FASTEST, _STRONGEST = consecutive(6, 6, 6, 6)

_QUANTITIES = {LENGTH_MIN: ('length', 'm'), LENGTH_MAX: ('length', 'm'),
               VELOCITY_MAX: ('rate', 'm/s'), FORCE_MAX: ('force', 'N')}


class Exceedance(NamedTuple):
    """A limit that a leg exceeds."""

    limit: str
    """One of LIMITS."""
    leg: int
    value: float
    bound: float

    def words(self, joints: Sequence[str]) -> str:
        """Return which leg exceeds the limit, and by how much."""
        quantity, unit = _QUANTITIES[self.limit]
        excess = abs(abs(self.value) - self.bound)
        how = 'below' if self.limit == LENGTH_MIN else 'above'
        return (f'{joints[self.leg]}: {quantity} {self.value:.6g} {unit} is {excess:.6g} {unit} '
                f'{how} {self.limit}')


class Limits:
    """
    The limits of the legs of a hexapod.

    Parameters
    ----------
    parameters : Parameters
        Those that are not given are never exceeded.

    Attributes
    ----------
    bounds : dict of str to (6,)
        Of each limit that is given [m, m/s, N].
    thresholds : (4, 6)
        Of each of LIMITS, above (or below) which it is exceeded; infinite where it is not given.
    force_max : (6,)
        To which forces are clipped [N]; infinite where it is not given.

    """

    def __init__(self, parameters: Parameters) -> None:
        self.bounds = {name: parameters[name] for name in LIMITS if parameters[name] is not None}
        self.thresholds = np.array([
            np.full(6, -math.inf if name == LENGTH_MIN else math.inf)
            if name not in self.bounds else self.bounds[name] * (
                1.0 - TOLERANCE if name == LENGTH_MIN else 1.0 + TOLERANCE) for name in LIMITS])
        self.force_max: Array = self.bounds.get(FORCE_MAX, np.full(6, math.inf))
        self._of_samples = [
            (name, self.bounds[name].tolist(), self.thresholds[n].tolist())
            for n, name in enumerate(LIMITS) if name in self.bounds]

    def exceeds(self, limit: str, values: Array) -> Flags:
        """Return where values (..., 6) of its quantity exceed a limit; nan never does."""
        exceeding: Flags = _exceeds(limit, values, self.thresholds[LIMITS.index(limit)])
        return exceeding

    def exceeded(self, lengths: Six, rates: Six, forces: Six | None) -> tuple[Exceedance, ...]:
        """Return all limits that one sample exceeds; unknown forces (None) exceed none."""
        found = []
        for limit, bounds, thresholds in self._of_samples:
            values = (rates if limit == VELOCITY_MAX else forces if limit == FORCE_MAX
                      else lengths)
            if values is None:
                continue
            for leg, value in enumerate(values):
                if _exceeds(limit, value, thresholds[leg]):
                    found.append(Exceedance(limit, leg, value, bounds[leg]))
        return tuple(found)


def _exceeds(limit: str, value: Any, threshold: Any) -> Any:
    """Return whether a value, or where an array, is past the threshold of a limit."""
    return value < threshold if limit == LENGTH_MIN else abs(value) > threshold


@inlined
def any_exceeded(thresholds: Array, result: Array) -> bool:
    """Return whether a row of a result exceeds one of the thresholds (24,); nan never does."""
    exceeded = False
    for leg in range(6):
        if (result[LENGTHS.start + leg] < thresholds[_SHORTEST.start + leg]
                or result[LENGTHS.start + leg] > thresholds[_LONGEST.start + leg]
                or abs(result[RATES.start + leg]) > thresholds[_FASTEST.start + leg]
                or abs(result[FORCES.start + leg]) > thresholds[_STRONGEST.start + leg]):
            exceeded = True
    return exceeded
