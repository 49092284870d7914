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

"""Samples of any leading shape as rows: indexing and comparison of poses and motions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.arguments import common_shape

Self = TypeVar('Self', bound='Samples')


class Samples:
    """
    Samples of any leading shape.

    Attributes
    ----------
    rows : (..., n)
        All numbers of each sample in a row, SI units, base axes.
    shape : tuple of int
        The leading shape; () for one sample.

    """

    rows: Array
    shape: tuple[int, ...]

    @classmethod
    def of_rows(cls: type[Self], rows: Array) -> Self:
        """Return the samples of rows (..., n), which are neither checked nor copied."""
        samples = cls.__new__(cls)
        samples.rows, samples.shape = rows, rows.shape[:-1]
        return samples

    def _part(self, which: slice) -> Array:
        view = self.rows[..., which]
        view.setflags(write=False)
        return view

    def __len__(self) -> int:
        """Return the number of samples along the first axis; TypeError for a single sample."""
        if not self.shape:
            raise TypeError(f'one {type(self).__name__} has no length')
        return self.shape[0]

    def __getitem__(self: Self, index: Any) -> Self:
        """Return some of the samples: an index, a slice or a mask, as of an array."""
        where = index if isinstance(index, tuple) else (index,)
        try:
            return self.of_rows(self.rows[(*where, slice(None))] if any(
                each is Ellipsis for each in where) else self.rows[(*where, ..., slice(None))])
        except IndexError as exc:
            raise IndexError(f'{type(self).__name__} of shape {self.shape}: {exc}') from exc

    def __eq__(self, other: object) -> bool:
        """Return whether shape and all numbers are equal."""
        return type(other) is type(self) and np.array_equal(self.rows, other.rows)

    # The arrays are mutable.
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Return the shape, or the numbers of a single sample."""
        name = type(self).__name__
        return (f'<{name} of shape {self.shape}>' if self.shape
                else f'<{name}: {self._in_words()}>')

    def _in_words(self) -> str:
        """Return the numbers of a single sample, as text."""
        raise NotImplementedError


def rows_of(size: int, parts: Mapping[str, tuple[slice, Array]]) -> Array:
    """
    Return the rows (..., size) of samples; MotionError names parts whose shapes do not fit.

    Parameters
    ----------
    size : int
        Length of a row; numbers outside of all parts are zero.
    parts : mapping of argument to (slice, (..., n))
        Slice of the argument's numbers in a row, and the numbers.

    """
    shape = common_shape(**{name: part.shape[:-1] for name, (_, part) in parts.items()})
    rows = np.zeros((*shape, size))
    for where, part in parts.values():
        rows[..., where] = part
    return rows


def listed(numbers: Array) -> str:
    """Return a vector as text."""
    return '[' + ', '.join(f'{number + 0.0:.6g}' for number in numbers) + ']'
