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

"""Extracts of all windows in a temporary file, so that memory does not grow with the bags."""

from __future__ import annotations

from collections.abc import Iterator
import tempfile
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.identification.extraction import Extract


class Block(NamedTuple):
    """Data of one window of N samples for the fit."""

    number: int
    bag: int
    times: Array
    """(N,) since the start of the bag [s]"""
    columns: Array
    """(N, 6, n + 1 + ORDERS): regressor, known force, effort and its derivatives"""
    sound: Flags
    """(N, 6)"""
    legs: Array
    slip: Array
    poses: Array
    """Legs, slip and poses as in ``Extract``."""


class Extracts:
    """Extracts in the order of addition; can be iterated over repeatedly."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()
        self._bags: list[int] = []
        self.samples = 0

    def add(self, bag: int, begin: float, extract: Extract) -> None:
        """Add the extract of a window of a bag that begins at a time [s]."""
        for array in (begin + extract.times, extract.columns, extract.sound, extract.legs,
                      extract.slip, extract.poses):
            np.save(self._file, array)
        self._bags.append(bag)
        self.samples += len(extract.times)

    def __iter__(self) -> Iterator[Block]:
        """Read the extracts from the file."""
        self._file.seek(0)
        for number, bag in enumerate(self._bags):
            yield Block(number, bag, *(np.load(self._file) for _ in range(6)))

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self._bags)

    def close(self) -> None:
        """Remove the file."""
        self._file.close()
