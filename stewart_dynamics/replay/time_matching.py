# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Matching of samples of two sources by their stamps, in bounded memory.

When time jumps back by more than a gap, as in a bag that loops, another pass begins; rows are
matched with rows of the pass of the same number. A single stamp that is late or in the future
begins no pass.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers, Stamps


def interpolated(stamps: Stamps, at: Stamps, values: Array, gap: int) -> Array:
    """Return values interpolated at stamps; nan between samples farther apart than the gap."""
    result = np.full((len(stamps), values.shape[1]), np.nan)
    if not len(at):
        return result
    after = np.minimum(np.searchsorted(at, stamps), len(at) - 1)
    # a sample with the same stamp needs no other
    before = np.where(at[after] == stamps, after, np.maximum(after - 1, 0))
    between = (at[before] <= stamps) & (stamps <= at[after]) & (at[after] - at[before] <= gap)
    before, after = before[between], after[between]
    part = (stamps[between] - at[before]) / np.maximum(at[after] - at[before], 1)
    result[between] = values[before] + part[:, None] * (values[after] - values[before])
    return result


class Rows(NamedTuple):
    """Rows with their stamps and the numbers of their passes."""

    stamps: Stamps
    passes: Integers
    rows: Array

    def part(self, which: slice | Stamps | Flags) -> Rows:
        """Return some of the rows; a copy unless given by a slice."""
        return Rows(self.stamps[which], self.passes[which], self.rows[which])


class Waiting:
    """
    Rows that wait to be matched, in the order of pass and stamp.

    The last row is held back until the next one shows whether its stamp is in order.
    """

    def __init__(self, gap: int, most: int) -> None:
        self.taken = 0
        self.out_of_order = 0
        self.pass_number = -1
        self.newest = 0
        self._gap, self._most = gap, most
        self._unsure: tuple[Stamps, Array] | None = None
        none = np.empty(0, dtype=np.int64)
        self.rows = Rows(none, none, np.empty((0, 0)))

    def add(self, stamps: Stamps, rows: Array) -> None:
        """Add rows (N, K) with their stamps (N,) [ns]."""
        if not len(stamps):
            return
        self.taken += len(stamps)
        if self._unsure is not None:
            stamps = np.concatenate([self._unsure[0], stamps])
            rows = np.concatenate([self._unsure[1], rows])
        self._unsure = stamps[-1:].copy(), rows[-1:].copy()
        self._line_up(stamps, rows[:-1])

    def confirm(self) -> None:
        """Add the row that was held back: there are no more."""
        if self._unsure is not None:
            # a last row that jumps back is out of order
            stamps = np.append(self._unsure[0], np.iinfo(np.int64).max)
            rows, self._unsure = self._unsure[1], None
            self._line_up(stamps, rows)

    def _line_up(self, stamps: Stamps, rows: Array) -> None:
        """Assign a pass to each row except the last; drop rows out of order."""
        if self.pass_number < 0 and len(rows):
            self.pass_number, self.newest = 0, int(stamps[0]) - 1
        steps = np.diff(stamps)
        if len(rows) and stamps[0] > self.newest and steps.min() > 0:
            passes: Stamps = np.full(len(rows), self.pass_number)
            self.newest = int(stamps[-2])
        else:
            passes = np.array(self._passes(stamps.tolist()), dtype=np.int64)
            self.out_of_order += int(np.count_nonzero(passes < 0))
        new = Rows(stamps[:-1], passes, rows).part(passes >= 0)
        if len(self.rows.stamps):
            new = Rows._make(map(np.concatenate, zip(self.rows, new, strict=True)))
        self.rows = new.part(slice(max(len(new.stamps) - self._most, 0), None))

    def _passes(self, stamps: list[int]) -> list[int]:
        """Return the pass of each stamp except the last, -1 if out of order."""
        passes = []
        for stamp, after in zip(stamps[:-1], stamps[1:], strict=True):
            ahead = stamp > self.newest
            far = abs(stamp - self.newest) > self._gap
            # a stamp is in the future if the next is smaller but still after those before it;
            # it is late if the next continues from those before it
            alone = (self.newest < after < stamp - self._gap if ahead else after > self.newest)
            if not far and not ahead or far and alone:
                passes.append(-1)
                continue
            self.pass_number += not ahead
            self.newest = stamp
            passes.append(self.pass_number)
        return passes

    def take_before(self, pass_number: int, stamp: int) -> Rows:
        """Return and remove the rows of earlier passes, and of this one up to the stamp."""
        count = self._before(pass_number, stamp)
        taken, self.rows = self.rows.part(slice(count)), self.rows.part(slice(count, None))
        return taken

    def forget_before(self, pass_number: int, stamp: int) -> None:
        """Remove the rows before this time except the last one."""
        last = self._before(pass_number, stamp) - 1
        self.rows = self.rows.part(slice(max(last, 0), None))

    def oldest(self) -> tuple[int, int]:
        """Return the pass and stamp of the oldest row, or of the newest ever added."""
        if not len(self.rows.stamps):
            return self.pass_number, self.newest
        return int(self.rows.passes[0]), int(self.rows.stamps[0])

    def _before(self, pass_number: int, stamp: int) -> int:
        """Return the number of rows of earlier passes, and of this one up to the stamp."""
        stamps, passes, _ = self.rows
        return int(np.count_nonzero(
            (passes < pass_number) | ((passes == pass_number) & (stamps <= stamp))))
