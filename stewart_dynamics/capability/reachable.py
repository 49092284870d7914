# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Boxes of ranges: whether all of a box is reachable, and by which factor it can grow."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.quantities import Moved, Quantity, Starts
from stewart_dynamics.capability.travel import (
    ENDS, Ends, LIMITED, NOTHING, PoseMargins, SINGULARITY as SINGULAR)
from stewart_dynamics.capability.workspace import smallest
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.frames.rotation import from_rotation_vector
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance
from stewart_dynamics.mechanics.limits import (
    CLEARANCE_MIN, LIMITS, Limits, OF_JOINTS, SINGULARITY, TOLERANCE)
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Largest number of boxes that are tried for a factor, and number of cells of a round whose worst
# corners are tried.
_MOST_TRIALS, _LIKELY = 50, 16
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
    Past the limit, in its unit, or condition number; negative where the limit is kept.

    Infinite where det(J) has changed its sign: a singularity is between this pose and the others;
    and where a leg does not reach the platform.
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


class Factor(NamedTuple):
    """How far a box can be scaled."""

    value: float  # proven to be reachable
    upper: float  # not reachable
    limit: str  # empty where nothing limits
    leg: int


class _Found(NamedTuple):
    """Result of a search over a box."""

    point: Array  # worst point [d; r] (6,)
    code: int  # of the limit, and leg
    leg: int
    part: float  # excess there, relative to the limit
    certain: bool  # no point exceeds a limit


class Boxes:
    """
    Boxes of ranges around a pose.

    Branch and bound: the margins of all limits are enclosed over cells of a box (``intervals``),
    and cells in which a limit is not proven to be kept are divided.

    Parameters
    ----------
    platform : StewartPlatform
        The hexapod.
    margins : PoseMargins
        Quantities that have limits.
    starts : Starts
        The pose from which boxes are measured, and its pivot.
    travel : callable
        Takes directions (N, 6), returns the ends of travels from the pose.
    row, pivot : (MOTION,), (3,)
        The pose as a row of motion, and center of rotation in the platform frame [m].

    """

    def __init__(self, platform: StewartPlatform, margins: PoseMargins, starts: Starts,
                 travel: Callable[[Array], Ends], row: Array, pivot: Array) -> None:
        self._platform, self._margins, self._starts = platform, margins, starts
        self._travel, self._row, self._pivot = travel, row, pivot
        self._bounds = Limits(platform.parameters).bounds
        self._size = margins.size

    def reachable(self, ranges: Array) -> Reachable:
        """Return whether a box (6, 2) is within the limits."""
        found: list[_Found] = []
        for quantity in self._margins.given:
            of_one = self._worst(quantity, ranges)
            if not of_one.certain and of_one.part <= TOLERANCE:  # not decided
                of_one = max(of_one, self._searched(quantity, ranges), key=lambda each: each.part)
            if not of_one.certain:
                return Reachable(False, self._worst_pose(of_one))
            found.append(of_one)
        return Reachable(True, self._worst_pose(max(found, key=lambda each: each.part)))

    def factor(self, ranges: Array) -> Factor:
        """
        Return the largest factor by which a box can be scaled.

        The travel along a ray of the box is a factor that is not reachable. Below the shortest
        one the box is proven, or a pose that exceeds a limit gives a shorter ray.
        """
        sizes = np.abs(ranges).max(axis=1) / np.array([*[self._size] * 3, 1.0, 1.0, 1.0])
        unit = float(sizes.max())
        ranges = ranges / unit
        # rotation vectors of more than a turn add nothing
        turned = float(sizes[3:].max()) / unit
        most = 2.0 * math.pi / turned if turned > 2.0 * math.pi / _LARGEST else math.inf
        rays = np.stack(np.meshgrid(*np.column_stack([ranges, np.zeros(6)])), axis=-1)
        rays = rays.reshape(-1, 6)
        upper, code, leg = self._shortest(rays[rays.any(axis=1)])
        limit, trial = (code, leg), min(upper, most, _LARGEST)
        if not upper < most:
            limit = NOTHING, -1
        for quantity in self._margins.given:
            if limit[0] in quantity.codes:
                trial = min(trial, upper * (1.0 - quantity.fine))
            proven, open_ = 0.0, math.inf
            for _ in range(_MOST_TRIALS):
                if not proven < trial:
                    break
                found = self._searched(quantity, trial * ranges)
                if found.part <= TOLERANCE:
                    found = self._worst(quantity, trial * ranges, first=True)
                if found.certain:
                    proven = trial
                    if open_ == math.inf or open_ <= quantity.coarse * proven:
                        break
                    trial = 0.5 * (proven + open_)
                elif found.part > 0.0:
                    ray = self._shortest(found.point[None] / trial)
                    upper, limit = min(trial, ray[0]), ray[1:]
                    trial = upper * (1.0 - quantity.fine)
                else:  # not decided
                    limit = found.code, found.leg
                    open_ = trial
                    trial = 0.5 * (proven + open_) if proven > 0.0 else 0.75 * open_
            trial = proven
        if limit[0] == NOTHING:
            return Factor(most / unit, math.inf, '', -1)
        return Factor(trial / unit, max(upper, trial) / unit, ENDS[limit[0]], limit[1])

    def _shortest(self, directions: Array) -> tuple[float, int, int]:
        """Return the shortest travel, its code and its leg."""
        ends = self._travel(directions)
        at = int(ends.values.argmin())
        return float(ends.values[at]), int(ends.codes[at]), int(ends.legs[at])

    def _searched(self, quantity: Quantity, ranges: Array) -> _Found:
        """Return the worst point that a local search finds, where a proof takes long."""
        if quantity.exact <= 1e-6:
            return _Found(ranges[:, 0], NOTHING, -1, -math.inf, False)
        found = smallest(lambda points: -quantity.excesses_at(self._at(points)).max(axis=1),
                         lambda points: points, ranges)
        column = int(quantity.excesses_at(self._at(found.pose[None])).argmax())
        return _Found(found.pose, int(quantity.codes[column]), int(quantity.legs[column]),
                      -found.value, False)

    def _at(self, points: Array) -> Moved:
        """Return the legs at points (N, 6)."""
        return Moved(self._starts, points, np.zeros((0, len(points), 6)))

    def _worst(self, quantity: Quantity, ranges: Array, first: bool = False) -> _Found:
        """
        Search for the largest excess over a box.

        first: the search ends with the first point that exceeds a limit.
        """
        axes = np.flatnonzero(np.ptp(ranges, axis=1) > 0.0)
        points, halves = ranges.mean(axis=1)[None], 0.5 * np.ptp(ranges, axis=1)[None, axes]
        worst, used, certain = _Found(
            points[0], NOTHING, -1, -math.inf, False), 0, True
        with np.errstate(all='ignore'):
            while len(points):
                used += len(points)
                edges = np.zeros((len(axes), len(points), 6))
                edges[np.arange(len(axes)), :, axes] = halves.T
                moved = Moved(self._starts, points, edges)
                margins = quantity.margins(moved)
                bounds = quantity.excesses(margins.low)
                bounds[np.isnan(bounds)] = math.inf
                columns = bounds.argmax(axis=1)
                rows = np.arange(len(points))
                slopes = margins.slopes[:, rows, columns].T
                uppers = bounds[rows, columns]
                likely = np.argsort(-uppers)[:_LIKELY]
                tried = points[likely]
                tried[:, axes] -= np.copysign(halves[likely], slopes[likely])
                tried = np.concatenate([points[likely], tried])
                parts = quantity.excesses_at(self._at(tried))
                at, column = np.unravel_index(int(parts.argmax()), parts.shape)
                if parts[at, column] > worst.part:
                    worst = _Found(tried[at], int(quantity.codes[column]), int(
                        quantity.legs[column]), float(parts[at, column]), False)
                if worst.part > TOLERANCE and first:
                    return worst
                enough = 0.5 * TOLERANCE if first else _enough(worst.part, quantity.exact)
                left = uppers > enough
                if used > quantity.most:
                    certain = not (uppers > TOLERANCE).any()
                    break
                weights = quantity.weights(moved, margins.slopes[:, rows, columns]).T[left]
                points, halves = points[left], halves[left]
                quantity = quantity.only(np.asarray((bounds > enough).any(axis=0)))
                for _ in range(3 if len(points) < 64 else 1):
                    if len(points):
                        points, halves, weights = _halved(points, halves, weights, axes)
        return worst._replace(certain=certain and worst.part <= TOLERANCE)

    def _worst_pose(self, found: _Found) -> Worst:
        """Return the pose of a search, with its excess in units of the limit."""
        code, leg = found.code, found.leg
        pose = self.poses(found.point)
        if code == SINGULAR:
            solved = self._platform.inverse_dynamics(Motion.from_pose(pose), singular='nan')
            excess = float(solved.condition_number) - self._margins.condition.stop
            if not solved.determinant * self._starts.sides[0] > 0.0:
                excess = math.inf
            return Worst(pose, -1, SINGULARITY, excess)
        name, p = LIMITED[code], self._platform.parameters
        if name == CLEARANCE_MIN:
            values = LegClearance(p)(Motion.from_pose(pose).rows[None])[0]
        elif name in OF_JOINTS:
            values = self._platform.joint_angles(pose)[OF_JOINTS.index(name)]
        elif name == p.leg_kind.lever_limit:
            solved = self._platform.solve(Motion.from_pose(pose).rows[None])[0]
            values = p.leg_kind.lever_ratios(p, solved)
            if not np.isfinite(solved).all():
                return Worst(pose, leg, ENDS[code], math.inf)
        else:
            values = self._platform.inverse_kinematics(pose)
        excess = float(values[leg] - self._bounds[name][leg])
        return Worst(pose, leg, ENDS[code], -excess if LIMITS[name].minimum else excess)

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


def _enough(best: float, exact: float) -> float:
    """Return the relative excess that cells need not exceed: nothing depends on more digits."""
    least = 0.5 * TOLERANCE
    return least if -exact <= best <= least else best + exact


def _halved(points: Array, halves: Array, weights: Array, axes: Integers,
            ) -> tuple[Array, Array, Array]:
    """Return cells divided along the axes of their largest weights."""
    rows, at = np.arange(len(points)), weights.argmax(axis=1)
    halves, weights = halves.copy(), weights.copy()
    halves[rows, at] *= 0.5
    weights[rows, at] *= 0.5
    step = np.zeros(points.shape)
    step[rows, axes[at]] = halves[rows, at]
    return (np.concatenate([points - step, points + step]), np.tile(halves, (2, 1)),
            np.tile(weights, (2, 1)))
