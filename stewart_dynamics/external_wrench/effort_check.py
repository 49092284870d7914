# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The possible error in sign and unit of live measured efforts.

The judgement is that of ``EffortSums``, as in the replay, on means over blocks: the noise of
accelerations by differences cancels within a block. Sign and unit are wrong from the first
message on, or not at all. Once some blocks agree with the model the efforts are right; whatever
differs later is an external load, such as a payload or a contact.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import SECOND, Six
from stewart_dynamics.mechanics.drives.measured_efforts import EffortSums
from stewart_dynamics.parameters.table import OF_DRIVES, Parameters
from stewart_dynamics.possible_errors.hypothesis import PossibleError

# Length of a block [ns]; the first ones are shorter, of 1, 2, 4, ... measurements.
_BLOCK = SECOND // 10
# Blocks in which measured and computed forces are alike, from which on the efforts are right.
_RIGHT = 5
_ZEROS = (0.0,) * 6


class EffortCheck:
    """The check of a stream of measurements, from the first one on."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        of_motors = parameters.external_wrench.efforts != OF_DRIVES
        self._sums = EffortSums(parameters, of_motors)
        self._right = 0
        self._begin()
        self._shortest = 1
        self.possible_error: PossibleError | None = None
        """The possible error; None without one."""

    def _begin(self) -> None:
        self._count, self._since = 0, 0
        self._forces: Six = _ZEROS
        self._differences: Six = _ZEROS

    def add(self, stamp: int, forces: Six, differences: Six | None) -> None:
        """
        Add a measurement at a stamp [ns]: forces, and measured - model forces [N].

        A measurement without differences, the first one or one after a gap, begins a block.
        """
        if self._right >= _RIGHT:
            return
        if differences is None:
            self._begin()
            return
        self._count += 1
        self._since = self._since or stamp
        self._forces = _sum(self._forces, forces)
        self._differences = _sum(self._differences, differences)
        if self._count >= self._shortest or stamp - self._since >= _BLOCK:
            self._judge()

    def _judge(self) -> None:
        """Judge by the blocks so far; the present one ends."""
        self._shortest *= 2
        measured, differences = np.array(
            [self._forces, self._differences])[..., None] / self._count
        block = EffortSums(
            self._parameters, self._parameters.external_wrench.efforts != OF_DRIVES)
        for sums in (block, self._sums):
            sums.add(measured, measured - differences, weight=self._count)
        self._right += block.alike
        self.possible_error = None if self._right >= _RIGHT else self._sums.find_error()
        self._begin()


def _sum(one: Six, other: Six) -> Six:
    a, b = one, other
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
