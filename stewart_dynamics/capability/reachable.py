# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Boxes of ranges: whether all of a box is reachable, and by which factor it can grow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability import box_condition
from stewart_dynamics.capability.box_cells import CELL, DEPTH, EXCESS, FOUND, LEG, POINT, UPPER
from stewart_dynamics.capability.box_clearance import clearance_in_box, PAIRS
from stewart_dynamics.capability.box_condition import condition_in_box
from stewart_dynamics.capability.box_legs import legs_in_box
from stewart_dynamics.capability.clearance_bounds import CORNER, rows_of
from stewart_dynamics.capability.travel import CLEARANCE_MIN, ENDS
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.dynamics.hexapod_constants import characteristic_length_of
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_rotation_vector
from stewart_dynamics.mechanics.limits import SINGULARITY, TOLERANCE
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Largest numbers of cells: for each limit of each leg, for the clearance of each pair of legs, and
# for the condition number.
_MOST_OF_LEGS, _MOST_OF_CLEARANCE, _MOST_OF_CONDITION = 20_000, 100_000, 100_000
# The largest excess of a clearance is found to this part.
_COARSE = 0.1
# Factors of a box are found to this part.
_EXACT = 1e-9
# For a box that ends at a clearance or a singularity the factor is found to these parts: each
# proof takes longer.
_EXACT_OF_CLEARANCE = 0.01
_EXACT_OF_CONDITION = 1e-3
# Smaller bounds that are not zero have no finite factor [m, rad].
SMALLEST = 1e-300
# Boxes of translations are proven up to this multiple of the hexapod's size.
_LARGEST = 1e6


class Worst(NamedTuple):
    """The pose of a box that exceeds a limit most, or that is nearest to one."""

    pose: Pose
    leg: int
    """Index of the leg, of two legs that are too near the first; -1 at a singularity."""
    limit: str
    """Name of the limit without ``limits.``, or ``singularity``."""
    excess: float
    """
    Past the limit [m, rad, or condition number]; negative where the limit is kept.

    Infinite where det(J) has changed its sign: a singularity is between this pose and the others.
    """


class Reachable(NamedTuple):
    """Whether all poses of a box are within the limits."""

    certain: bool
    """
    All poses of the box are proven to be within the limits.

    Where it is false and the excess of ``worst`` is above zero, the box is proven not to be
    reachable, and ``worst`` is a pose that exceeds a limit; otherwise nothing is proven.
    """
    worst: Worst
    """
    The worst pose by excess relative to the limit.

    Where ``certain`` is false and the excess is not above zero, the proof did not end within a
    bounded number of steps.
    """


class _Proof(NamedTuple):
    worst: Worst
    certain: bool
    part: float
    """Excess relative to the limit."""


class Boxes:
    """
    Boxes of ranges around a pose.

    Parameters
    ----------
    platform : StewartPlatform
        The hexapod.
    axes, bounds, shapes, plates : (12, 3), (5, 6), (6, 3), two of (M, 3)
        As in ``travel.travels``.
    row, pivot : (MOTION,), (3,)
        Pose from which boxes are measured, and center of rotation in the platform frame [m].

    """

    def __init__(self, platform: StewartPlatform, axes: Array, bounds: Array, shapes: Array,
                 plates: Sequence[Array], row: Array, pivot: Array) -> None:
        self._platform, self._axes = platform, axes
        self._bounds, self._shapes, self._plates = bounds[:CLEARANCE_MIN], shapes, plates
        self._nearest = float(bounds[CLEARANCE_MIN, 0])
        self._row, self._pivot = row, pivot
        self._stop = stop_condition_of(platform.parameters)
        self._legs = np.empty((6, LEG))
        self._cells = np.empty((DEPTH + 2, CELL))
        self._work = np.empty((7, box_condition.WORK))
        self._corners = np.empty((rows_of(plates, 6), CORNER))

    def reachable(self, ranges: Array) -> Reachable:
        """Return whether a box (6, 2) is within the limits."""
        box = _box(ranges)
        worst, certain, part = self._worst_of_legs(box)
        if not certain:
            return Reachable(False, worst)
        if self._nearest > -math.inf:
            near, certain, part_of_clearance = self._worst_clearance(box)
            if not certain:
                return Reachable(False, near)
            if part_of_clearance > part:
                worst, part = near, part_of_clearance
        singular, certain, part_of_condition = self._worst_condition(box)
        return Reachable(
            certain, singular if not certain or part_of_condition > part else worst)

    def factor(self, ranges: Array) -> tuple[float, Worst | None]:
        """
        Return the largest factor by which a box can be scaled, and the worst pose above it.

        None where nothing limits up to a turn.
        """
        size = characteristic_length_of(self._platform.constants)
        sizes = np.abs(ranges).max(axis=1) / np.array([size, size, size, 1.0, 1.0, 1.0])
        unit = float(sizes.max())
        ranges = ranges / unit
        # rotation vectors of more than a turn add nothing
        turned = float(sizes[3:].max()) / unit
        most = 2.0 * math.pi / turned if turned > 2.0 * math.pi / _LARGEST else math.inf
        factor, worst = _largest(
            lambda factor: self._worst_of_legs(_box(factor * ranges)), most, _EXACT)
        if factor > 0.0 and self._nearest > -math.inf:
            factor, worst = _largest(
                lambda factor: self._worst_clearance(_box(factor * ranges), math.inf), factor,
                _EXACT_OF_CLEARANCE, worst)
        if factor > 0.0:
            factor, worst = _largest(
                lambda factor: self._worst_condition(_box(factor * ranges)), factor,
                _EXACT_OF_CONDITION, worst)
        return factor / unit, worst

    def _worst_of_legs(self, box: Array) -> _Proof:
        """Return the worst pose of lengths and joint angles, and whether limits are kept."""
        found = np.zeros((24, FOUND))
        legs_in_box(
            self._platform.constants, self._axes, self._bounds, self._row, self._pivot, box,
            _MOST_OF_LEGS, self._legs, self._cells, found)
        limited = np.isfinite(found[:, EXCESS])
        sizes = np.where(limited, self._bounds.ravel(), 1.0)
        parts = np.where(limited, found[:, EXCESS] / sizes, -math.inf)
        at = int(parts.argmax())
        certain = bool(np.all(found[:, UPPER] <= TOLERANCE * sizes))
        return _Proof(Worst(self.poses(found[at, POINT]), at % 6, ENDS[at // 6],
                            float(found[at, EXCESS])), certain, float(parts[at]))

    def _worst_clearance(self, box: Array, coarse: float = _COARSE) -> _Proof:
        """Return the worst pose by clearance of the legs, and whether the limit is kept."""
        found = np.empty((len(PAIRS), FOUND))
        clearance_in_box(
            self._platform.constants, self._axes, self._shapes, *self._plates, self._nearest,
            self._row, self._pivot, box, _MOST_OF_CLEARANCE, coarse, self._legs, self._cells,
            self._corners, found)
        at = int(found[:, EXCESS].argmax())
        excess = float(found[at, EXCESS])
        certain = bool(np.all(found[:, UPPER] <= TOLERANCE * self._nearest))
        size = self._platform.parameters['singularity.characteristic_length']
        return _Proof(Worst(self.poses(found[at, POINT]), PAIRS[at][0],
                            ENDS[CLEARANCE_MIN], excess), certain, excess / size)

    def _worst_condition(self, box: Array) -> _Proof:
        """Return the worst pose by condition number, and whether it stays below its limit."""
        found, count = np.empty(FOUND), np.empty(1, dtype=np.int64)
        condition_in_box(
            self._platform.constants, self._axes, self._row, self._pivot, box, self._stop,
            _MOST_OF_CONDITION, self._legs, self._cells, self._work, found, count)
        excess = float(found[EXCESS])
        return _Proof(Worst(self.poses(found[POINT]), -1, SINGULARITY, excess),
                      bool(found[UPPER] == 0.0), excess / self._stop)

    def poses(self, points: Array) -> Pose:
        """Return the poses of translations and rotation vectors (..., 6)."""
        start = Pose.of_rows(self._row[POSE].copy())
        rotation = from_rotation_vector(points[..., 3:]) @ start.rotation
        return Pose(start.position + start.rotation @ self._pivot + points[..., :3]
                    - rotation @ self._pivot, rotation)


def checked_ranges(value: ArrayLike) -> Array:
    """Return a box (6, 2); MotionError where it is no box, or has no size."""
    ranges = as_array('box', value, (6, 2))
    if ranges.ndim != 2:
        raise MotionError(f'box: shape {ranges.shape}: must be (6, 2)')
    for name, (low, high) in zip(('x', 'y', 'z', 'rx', 'ry', 'rz'), ranges.tolist(), strict=True):
        if low > high:
            raise MotionError(f'box: {name}: {low:g} to {high:g}: must not decrease')
        if any(0.0 < abs(bound) < SMALLEST for bound in (low, high)):
            raise MotionError(f'box: {name}: {low:g} to {high:g}: bounds must be 0, or at least '
                              f'{SMALLEST:g} from it')
    if float(np.abs(ranges[3:]).max()) > 2.0 * math.pi:
        raise MotionError('box: rotations: must be within a turn, 2 pi rad')
    if not np.ptp(ranges, axis=1).any():
        raise MotionError('box: all six ranges are of zero size')
    return ranges


def _box(ranges: Array) -> Array:
    """Return middle and half widths (12,) of ranges (6, 2)."""
    return np.concatenate([ranges.mean(axis=1), 0.5 * np.ptp(ranges, axis=1)])


def _largest(prove: Callable[[float], _Proof], most: float, exact: float,
             worst: Worst | None = None) -> tuple[float, Worst | None]:
    """Return the largest factor, up to ``most``, that is proven, and the worst pose above it."""
    begin = prove(0.0)
    if not begin.certain:
        return 0.0, begin.worst
    bound = min(most, _LARGEST)
    low, high, trial = 0.0, math.inf, min(bound, 1.0) if worst is None else bound
    while high - low > exact * high or high == math.inf:
        proof = prove(trial)
        if proof.certain:
            low = trial
            if trial >= bound:
                return most, worst
        else:
            high, worst = trial, proof.worst
        trial = min(2.0 * trial, bound) if high == math.inf else 0.5 * (low + high)
    return low, worst
