# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Batches: arguments as rows, results and leg lengths; all processors share large ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
import math
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics.arrays import Array, Integers, Records
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import ReachError, SingularityError
from stewart_dynamics.legs import KINDS
from stewart_dynamics.mechanics.arguments import (
    common_shape, copies, optional_array, place, wrong_type)
from stewart_dynamics.mechanics.frames.base_motion import base_rows, BaseMotion
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion
from stewart_dynamics.mechanics.rows import (
    CONDITION, MOTION, NO_BASE, POSE, POSITION, WRENCH)
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION

# Samples for one thread at least: a millisecond of work, far more than the start of a thread.
_SAMPLES_FOR_A_THREAD = 4096
_PARTS_OF_A_THREAD = 8
_CPUS = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1

WIDTHS = {kind.number: kind.width for kind in KINDS}
"""Numbers in a row of results by the kind of legs."""
_NO_WRENCH = np.zeros((1, WRENCH))
_NO_BASE: Array = np.array([NO_BASE])


def loaded(motion: Motion, wrench: ArrayLike | None, base: BaseMotion | None,
           ) -> tuple[Array, Array, Array, tuple[int, ...]]:
    """Return rows of motion, of wrenches and of the base (one if for all), and the shape."""
    check_kind(motion, Motion)
    if isinstance(wrench, BaseMotion):
        raise wrong_type('wrench', wrench, "six numbers; a base's motion is the argument base")
    load = optional_array('wrench', wrench, (WRENCH,))
    bases = base_rows(base)
    shape = common_shape(motion=motion.shape, wrench=load.shape[:-1], base=bases.shape[:-1])
    rows = (copies(motion.rows, shape) if shape != motion.shape
            else motion.rows.reshape(-1, MOTION))
    load, bases = (array.reshape(1, -1) if array.ndim == 1 else copies(array, shape)
                   for array in (load, bases))
    return rows, load, bases, shape


def solve(hexapod: Records, motions: Array, wrenches: Array | None = None,
          bases: Array | None = None, condition: bool = True, results: Array | None = None,
          ) -> Array:
    """
    Return the rows of results (N, RESULT) of rows of motion (N, MOTION), unchecked.

    hexapod (): its structure, see ``hexapod_structure``.
    motions (N, MOTION): rows of motion, see ``rows`` for the layout.
    wrenches (N, WRENCH) or (1, WRENCH): external wrenches at the platform's origin, base axes [N,
        N m]; one row for all.
    bases (N, BASE) or (1, BASE): rows of the base's motion, one row for all; without them it is
        still.
    condition: whether the condition number, half of the work, is computed; else it is zero.
    results (N, RESULT): where they are written; by default a new array.
    """
    motions = compact(motions)
    wrenches = _NO_WRENCH if wrenches is None else compact(wrenches)
    bases = _NO_BASE if bases is None else compact(bases)
    if results is None:
        results = np.empty((len(motions), WIDTHS[hexapod['leg_kind'].item()]))
    in_parts(_solve, (hexapod, condition), motions, wrenches, bases, results)
    return results


def _solve(hexapod: Records, condition: bool, motions: Array, wrenches: Array, bases: Array,
           results: Array) -> None:
    function('solve_many')(hexapod, len(motions), motions, len(wrenches), wrenches, len(bases),
                           bases, condition, results.shape[1], results)


def find_unsolvable(
        rows: Array, results: Array, shape: tuple[int, ...], singular: str) -> Integers:
    """Return the samples where J_inv cannot be solved; SingularityError if that is to raise."""
    if singular not in ('raise', 'nan'):
        raise wrong_type('singular', singular, "'raise' or 'nan'")
    condition = results[:, CONDITION]
    unsolvable: Integers = (condition >= UNSOLVABLE_CONDITION).nonzero()[0]
    if singular == 'raise' and len(unsolvable):
        at = int(unsolvable[0])
        raise SingularityError(
            f'sample {place(at, shape)}: J_inv cannot be solved: its condition number is '
            f'{condition[at]:.3g}, must be less than {UNSOLVABLE_CONDITION:g}; position '
            f'{rows[at, POSITION].tolist()} m')
    return unsolvable


def drive_positions(hexapod: Records, poses: Array) -> Array:
    """Return the drives' positions (..., 6) in poses (..., POSE) or more, unchecked."""
    shape = poses.shape[:-1]
    positions = np.empty((*shape, 6))
    function('positions_many')(hexapod, math.prod(shape), compact(poses[..., POSE]), positions)
    return positions


def missing_distances(hexapod: Records, poses: Array) -> Array:
    """Return by how much legs miss the platform joints (..., 6) [m] of poses (..., POSE)."""
    shape = poses.shape[:-1]
    distances = np.empty((*shape, 6))
    function('missing_many')(hexapod, math.prod(shape), compact(poses[..., POSE]), distances)
    return distances


def lever_squares(hexapod: Records, motions: Array) -> tuple[Array, Array]:
    """
    Return squares of the levers by their largest values, and rates [1/s], both (N, 6).

    motions (N, MOTION). Unlike the levers they are smooth at dead centres; negative where a leg
    does not reach.
    """
    values, rates = (np.empty((len(motions), 6)) for _ in range(2))
    function('lever_squares_many')(hexapod, len(motions), compact(motions), values, rates)
    return values, rates


def find_unreachable(hexapod: Records, joints: Sequence[str], rows: Array, results: Array,
                     shape: tuple[int, ...], singular: str = 'raise') -> Integers:
    """
    Return the samples that a leg does not reach; ReachError if that is to raise.

    rows (N, POSE) or more; results (N, ...): not finite in such samples.
    """
    finite: Any = np.isfinite(results).all(axis=-1)
    bad: Integers = np.flatnonzero(~finite)
    if not len(bad):
        return bad
    missing = missing_distances(hexapod, rows[bad])
    unreachable: Integers = bad[(missing > 0.0).any(axis=-1)]
    if singular == 'raise' and len(unreachable):
        at = int(unreachable[0])
        where = f'sample {place(at, shape)}: ' if shape else ''
        distances = missing_distances(hexapod, rows[at])
        raise ReachError(f'{where}{unreached(joints, distances)}; position '
                         f'{rows[at, POSITION].tolist()} m')
    return unreachable


def unreached(joints: Sequence[str], distances: Array) -> str:
    """Return which leg misses its platform joint most, by distances (6,) [m]."""
    leg = int(np.argmax(distances))
    missing = float(distances[leg])
    shown = f'{1e3 * missing:.3g} mm' if missing < 1.0 - 1e-3 else f'{missing:.3g} m'
    return f'{joints[leg]} cannot reach: {shown} missing'


def in_parts(compute: Callable[..., object], constants: tuple[Any, ...], *arrays: NDArray[Any],
             least: int = _SAMPLES_FOR_A_THREAD) -> None:
    """
    Call a function with constants and rows of arrays; large batches in parts on all processors.

    The first array has as many rows as there are samples. One with a single row is for all parts.
    least: samples for one thread at least.
    """
    samples = len(arrays[0])
    threads = min(_CPUS, samples // least)
    if threads < 2:
        compute(*constants, *arrays)
        return

    def part(begin: int, end: int) -> None:
        compute(*constants, *(
            array if len(array) == 1 else array[begin:end] for array in arrays))

    # More parts than threads: if one thread is slow, the others take more parts.
    edges = np.linspace(0, samples, _PARTS_OF_A_THREAD * threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))


def compact(array: Array) -> Array:
    """Return the array, or a copy of float64 in C order, as functions in C take it."""
    return np.ascontiguousarray(array, dtype=float)
