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
Normal-equation sums of all extracts.

They are the Gram matrix of ``[Y | known | f, f', f'', f''']`` for each bag and leg. A residual
with a delay d of the efforts, ``r = f(t + d) - known - Y theta`` as a Taylor series, is a linear
combination of these columns; so are its derivatives by theta and by d.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.identification.extraction import Extract, Extracts, ORDERS


class Sums(NamedTuple):
    """Gram matrices (B, 6, q, q) of the columns of B bags, and their numbers of efforts (B, 6)."""

    grams: Array
    counts: Integers

    @classmethod
    def of(cls, columns: Array, which: Flags) -> Sums:
        """Return the sums of one bag from columns (N, 6, q) and the efforts (N, 6) to use."""
        grams = np.empty((1, 6, *2 * columns.shape[-1:]))
        for leg in range(6):
            used = columns[which[:, leg], leg]
            grams[0, leg] = used.T @ used
        return cls(grams, np.count_nonzero(which, axis=0)[None])

    @classmethod
    def stacked(cls, of_bags: Sequence[Sums]) -> Sums:
        """Return the sums of several bags together."""
        return cls(*(np.concatenate(each) for each in zip(*of_bags, strict=True)))

    def plus(self, other: Sums) -> Sums:
        """Return the sums of both."""
        return Sums(self.grams + other.grams, self.counts + other.counts)

    def squares(self, theta: Array, delays: Array) -> Array:
        """Return the sums of squared residuals (B, 6) for linear parameters and delays (B,)."""
        found: Array = np.empty(self.counts.shape)
        for bag, delay in enumerate(delays):
            c = residual_of(theta, delay)
            found[bag] = np.einsum('i,lij,j->l', c, self.grams[bag], c)
        return np.maximum(found, 0.0)

    def effort_squares(self) -> Array:
        """Return the sums of squared efforts (B, 6)."""
        squares: Array = self.grams[:, :, -ORDERS, -ORDERS]
        return squares


def sums_of(extracts: Extracts,
            chosen: Callable[[Extract], Flags] = lambda extract: extract.used) -> Sums:
    """Return the sums of the efforts (N, 6) that are chosen of each extract."""
    of_bags: dict[int, Sums] = {}
    for extract in extracts:
        found = Sums.of(extract.columns, chosen(extract))
        bag = extract.bag
        of_bags[bag] = of_bags[bag].plus(found) if bag in of_bags else found
    return Sums.stacked(list(of_bags.values()))


def shifted_by(delay: float) -> Array:
    """Return the coefficients (ORDERS,) of an effort that is not delayed, by its derivatives."""
    return np.array([delay ** order / math.factorial(order) for order in range(ORDERS)])


def residual_of(theta: Array, delay: float) -> Array:
    """Return the coefficients (q,) of a residual by columns."""
    return np.concatenate([-theta, [-1.0], shifted_by(delay)])


def delayed_by(theta: Array, delay: float) -> Array:
    """Return the coefficients (q,) of the derivative of a residual by the delay."""
    return np.concatenate([np.zeros(len(theta) + 2), shifted_by(delay)[:-1]])
