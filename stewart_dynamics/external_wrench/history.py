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

"""The measured motion and forces of the last seconds, as rows in one block of memory."""

from __future__ import annotations

from struct import Struct

import numpy as np

from stewart_dynamics.arrays import Array, Six, Stamps
from stewart_dynamics.external_wrench.estimate import Estimate
from stewart_dynamics.mechanics.rows import BASE, consecutive, MOTION, TWIST, WRENCH

# A row: the stamp [ns, an integer], pose and twist as in a row of motion, the forces that acted
# since the measurement before [N], the known load, the motion of the base.
_STAMP, MOVED, ACTED, LOADED, OF_BASE = consecutive(1, TWIST.stop, 6, WRENCH, BASE)
TURNED = slice(MOVED.start + TWIST.start, MOVED.start + TWIST.stop)  # the twist
_ROW = Struct(f'q{OF_BASE.stop - 1}d')

# Rate above which the memory holds a shorter time [Hz].
HIGHEST_RATE = 2000.0


class LegHistory:
    """
    A ring of measurements; the oldest make room for the newest.

    Parameters
    ----------
    seconds : float
        Time that it holds at HIGHEST_RATE.

    """

    def __init__(self, seconds: float) -> None:
        self.capacity = round(seconds * HIGHEST_RATE)
        self.count = 0
        """How many have been added; measurement n is in row n modulo the capacity."""
        self._rows = np.zeros((self.capacity, OF_BASE.stop))
        self._memory = self._rows.data.cast('B')

    def add(self, forces: Six, estimate: Estimate, known: Six) -> None:
        """
        Add a measurement.

        Parameters
        ----------
        forces : six numbers
            Forces of the actuators since the last measurement [N].
        estimate : Estimate
            Its stamp, pose and twist; the motion of the base.
        known : six numbers
            The load on ``~/wrench`` [N, N m].

        """
        _ROW.pack_into(
            self._memory, self.count % self.capacity * _ROW.size, estimate.stamp,
            *estimate.motion[:TWIST.stop], *forces, *known, *estimate.base)
        self.count += 1

    def clear(self) -> None:
        """Forget all of them."""
        self.count = 0

    @property
    def first(self) -> int:
        """Return the oldest measurement that is still there."""
        return max(0, self.count - self.capacity)

    def stamps(self, begin: int, end: int) -> Stamps:
        """Return the stamps of measurements from one to another [ns]."""
        column: Stamps = self._rows.view(np.int64)[:, _STAMP.start]
        low, high = begin % self.capacity, (end - 1) % self.capacity + 1
        if end <= begin:
            return column[:0]
        return column[low:high].copy() if low < high else np.concatenate([
            column[low:], column[:high]])

    def rows(self, begin: int, end: int) -> Array:
        """Return a copy of the rows of measurements from one to another."""
        rows: Array = self._rows[np.arange(begin, end) % self.capacity]
        return rows


def motions_of(rows: Array) -> Array:
    """Return rows of motion (N, MOTION) of rows, without accelerations."""
    motions = np.zeros((len(rows), MOTION))
    motions[:, :TWIST.stop] = rows[:, MOVED]
    return motions
