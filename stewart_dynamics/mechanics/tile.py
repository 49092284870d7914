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
Tiles: samples side by side, so that one vector instruction computes several.

A tile holds numbers of up to LANES samples, number by number: entry n of lane k is at
n * LANES + k, so that the compiler puts neighbouring samples into one register.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.vectors import Matrix3, Vector3

LANES = 32


@inlined
def put6(
        tile: Array, at: int, a: float, b: float, c: float, d: float, e: float, f: float,
) -> None:
    """Write six numbers of a lane from a place on."""
    tile[at] = a
    tile[at + LANES] = b
    tile[at + 2 * LANES] = c
    tile[at + 3 * LANES] = d
    tile[at + 4 * LANES] = e
    tile[at + 5 * LANES] = f


@inlined
def vector3(tile: Array, at: int) -> Vector3:
    """Return three numbers of a lane from a place on."""
    return tile[at], tile[at + LANES], tile[at + 2 * LANES]


@inlined
def matrix3(tile: Array, at: int) -> Matrix3:
    """Return nine numbers of a lane from a place on."""
    return (tile[at], tile[at + LANES], tile[at + 2 * LANES], tile[at + 3 * LANES],
            tile[at + 4 * LANES], tile[at + 5 * LANES], tile[at + 6 * LANES],
            tile[at + 7 * LANES], tile[at + 8 * LANES])
