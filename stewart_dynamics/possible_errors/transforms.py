# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Transforms that several hypotheses try: orders of legs and axes, signs, units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import combinations, permutations, product

import numpy as np

from stewart_dynamics.arrays import Array, Integers


def swapped_pairs() -> Iterator[tuple[int, int, list[int]]]:
    """Yield each pair of legs, and the order of the six legs with the pair exchanged."""
    for a, b in combinations(range(6), 2):
        yield a, b, [{a: b, b: a}.get(leg, leg) for leg in range(6)]


@cache
def _orders() -> Integers:
    return np.array(list(permutations(range(6))))


def best_order(squares: Array) -> tuple[list[int], float]:
    """Return the order of six legs with the smallest sum of squares (6, 6), and the sum."""
    sums = squares[np.arange(6), _orders()].sum(axis=1)
    best = int(np.argmin(sums))
    return _orders()[best].tolist(), float(sums[best])


def axes_and_signs() -> Iterator[tuple[Sequence[int], Sequence[float]]]:
    """Yield other axes (3,) and signs (3,) of a vector, the fewest changes first."""
    for axes in sorted(permutations(range(3)), key=lambda each: each != (0, 1, 2)):
        for signs in sorted(product((1.0, -1.0), repeat=3), key=sum, reverse=True):
            yield axes, signs


def name_of_factor(factor: float, known: Iterable[tuple[float, str]], near: float) -> str:
    """Return the name of the first known factor within a ratio ``near``; empty without one."""
    return next((name for each, name in known if 1.0 / near < factor / each < near), '')
