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
Cubic polynomials between points: how a joint_trajectory_controller moves a leg between them.

A cubic has given values and rates at both ends (cubic Hermite interpolation).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array


class Cubics(NamedTuple):
    """
    Cubic polynomials of the fraction of an interval, 0 to 1; each array (N, ...).

    Rates are derivatives with respect to the fraction.
    """

    start: Array
    end: Array
    start_rate: Array
    end_rate: Array

    @classmethod
    def between(cls, values: Array, rates: Array, durations: Array) -> Cubics:
        """Return the cubics that join values and rates (N + 1, ...) of points in order."""
        return cls(values[:-1], values[1:], rates[:-1] * durations, rates[1:] * durations)

    def selected(self, which: Any) -> Cubics:
        """Return some of them: an index, or an array of indices."""
        return Cubics._make(each[which] for each in self)

    def bounds(self) -> tuple[Array, Array]:
        """Return bounds of the values: the least and the greatest of the Bezier control points."""
        inner = self.start + self.start_rate / 3.0, self.end - self.end_rate / 3.0
        low: Array = np.minimum(np.minimum(self.start, self.end), np.minimum(*inner))
        high: Array = np.maximum(np.maximum(self.start, self.end), np.maximum(*inner))
        return low, high

    def middle_rate(self) -> Array:
        """Return the middle control point of the rate; with both ends it bounds the rate."""
        return 3.0 * (self.end - self.start) - self.start_rate - self.end_rate

    def at(self, fraction: Array) -> Array:
        """Return the values at a fraction."""
        _, second, third = self._powers()
        return self.start + fraction * (self.start_rate + fraction * (second + fraction * third))

    def rate_at(self, fraction: Array) -> Array:
        """Return the rates at a fraction."""
        _, second, third = self._powers()
        return self.start_rate + fraction * (2.0 * second + fraction * 3.0 * third)

    def extrema(self) -> tuple[Array, Array]:
        """Return the fractions of minimum and maximum; nan where it is not inside (0, 1)."""
        first, second, third = self._powers()
        with np.errstate(all='ignore'):
            # The roots of first + 2 second u + 3 third u^2, without cancellation.
            root = np.sqrt(second * second - 3.0 * third * first)
            s = -(second + np.copysign(root, second))
            return _inside(s / (3.0 * third)), _inside(first / s)

    def rate_extremum(self) -> Array:
        """Return the fraction of the least or greatest rate; nan where not inside (0, 1)."""
        _, second, third = self._powers()
        with np.errstate(all='ignore'):
            return _inside(-second / (3.0 * third))

    def root(self) -> float:
        """Return the fraction at which a single cubic that ends below zero crosses zero."""
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            if float(self.at(np.array(middle))) > 0.0:
                low = middle
            else:
                high = middle
        return low

    def _powers(self) -> tuple[Array, Array, Array]:
        """Return the coefficients of the first, second and third power."""
        difference = self.end - self.start
        return (self.start_rate, 3.0 * difference - 2.0 * self.start_rate - self.end_rate,
                self.start_rate + self.end_rate - 2.0 * difference)


def _inside(fraction: Array) -> Array:
    inside: Array = np.where((fraction > 0.0) & (fraction < 1.0), fraction, np.nan)
    return inside
