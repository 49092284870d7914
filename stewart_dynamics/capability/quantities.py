# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The quantities of a pose that have limits, over cells of poses: each is stated once.

A cell is a point ``[d; r]`` and edges: the pivot is translated by d, and the platform turned by
the rotation vector r, base axes. A travel has one edge, a box six. A platform joint at ``a`` from
the pivot goes to ``d + exp(r) a``. Since

    D^2 exp(X)[E, F] = int int exp(..) E exp(..) F exp(..) + the same with E and F exchanged

over a triangle of area 1/2, and exponentials of skew matrices are orthogonal, the second
derivative of ``exp(r) a`` in directions e and f is at most ``|a| |e| |f|``, for all r.

Margins are positive where a limit is kept. The origin is the pivot at the start, axes are the
base's, and vectors are rows (..., 3).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.capability.intervals import (
    cross, dot, Enclosure, joined, length, unit)
from stewart_dynamics.legs.lines import AnchorCircles
from stewart_dynamics.mechanics.frames.rotation import from_rotation_vector
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.parameters.table import Parameters

ROUNDING = 1e-12
"""A value within this of its limit, relative to the limit or the hexapod's size, is on it."""
_EPS = 1e-15  # above rounding errors of a few operations
_LEAST_SLOPE = 1e-3  # of the margin of a range that is nearly a turn
_SKEW = np.zeros((3, 3, 3))  # v @ (spin @ _SKEW) is spin x v
_SKEW[[0, 1, 2], [1, 2, 0], [2, 0, 1]], _SKEW[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0


class Starts(NamedTuple):
    """Poses from which cells are measured, one for each row."""

    centers: Array  # pivot from the base joints (N, 6, 3)
    arms: Array  # platform joints from the pivot (N, 6, 3)
    levers: Array  # platform joints from its origin, per characteristic length (N, 6, 3)
    axes: Array  # axes of the platform joints (N, 6, 3)
    base: Array  # corners of the base's plate from the pivot (N, M, 3)
    platform: Array  # corners of the platform's plate from the pivot (N, M, 3)
    sides: Array  # det(J) (N,)
    circles: AnchorCircles | None = None  # of the hexapod, whose anchors move

    def take(self, which: Integers | Flags | slice) -> Starts:
        """Return some of the rows."""
        return Starts(self.centers[which], self.arms[which], self.levers[which], self.axes[which],
                      self.base[which], self.platform[which], self.sides[which], self.circles)


def starts_at(parameters: Parameters, axes: Array, plates: Sequence[Array], rows: Array,
              pivots: Array) -> Starts:
    """
    Return the poses of rows of motion (N, MOTION), with pivots (N, 3) in platform axes.

    axes (12, 3): of the joints, see ``joint_angles``.
    plates: corners of the plates of base and platform (M, 3).
    """
    turn = np.swapaxes(rows[:, ROTATION].reshape(-1, 3, 3), 1, 2)
    joints, pivots = parameters.geometry.platform_joints, pivots[:, None]
    centers = rows[:, None, POSITION] + pivots @ turn
    to_centers, arms = centers - parameters.geometry.base_joints, (joints - pivots) @ turn
    circles = parameters.leg_kind.anchor_circles(parameters)
    levers = joints @ turn / parameters.singularity.characteristic_length
    with np.errstate(all='ignore'):
        lines = to_centers + arms if circles is None else parameters.leg_kind.lines(
            parameters, rows[:, POSITION], rows[:, ROTATION].reshape(-1, 3, 3)).directions
        sides = np.linalg.det(np.concatenate([lines, np.cross(levers, lines)], axis=2))
    return Starts(to_centers, arms, levers, axes[6:] @ turn, plates[0] - centers,
                  (plates[1] - pivots) @ turn, sides, circles)


class Moved:
    """
    The legs over cells.

    starts: N rows, or one for all cells.
    points, edges (N, 6), (D, N, 6): cells.

    shift, joints, lines: translation (N, 1, 3), platform joints and legs (N, 6, 3).
    """

    def __init__(self, starts: Starts, points: Array, edges: Array) -> None:
        self.starts = starts
        turns, edges_of_turn = points[:, 3:], edges[..., 3:]
        self._rotation = np.swapaxes(from_rotation_vector(turns), 1, 2)
        angle = np.sqrt((turns * turns).sum(axis=1))[:, None]
        square = angle * angle
        with np.errstate(all='ignore'):
            once, twice = 0.5 * np.sinc(angle * (0.5 / math.pi)) ** 2, np.where(
                angle > 0.1, (angle - np.sin(angle)) / (angle * square),
                (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0))) / 6.0)
        swept = (turns @ _SKEW.reshape(3, 9)).reshape(-1, 3, 3)
        across = np.einsum('dni,nij->dnj', edges_of_turn, swept)
        spins = edges_of_turn + once * across + twice * np.einsum('dni,nij->dnj', across, swept)
        self._spins = (spins @ _SKEW.reshape(3, 9)).reshape(*spins.shape, 3)
        reach = np.abs(edges_of_turn).sum(axis=0) ** 2
        total = reach.sum(axis=1)[:, None]
        # about one axis nothing moves along it
        self._bend = _EPS + 0.5 * np.sqrt(total * (
            total - reach if len(edges) == 1 else total + 0.0 * reach))[:, None]
        shift = points[:, None, :3]
        self.shift = Enclosure(shift, edges[:, :, None, :3], _EPS * np.abs(shift))
        self._arms, self._centers = self.turned(starts.arms), self.shift + starts.centers
        self.joints, self.lines = self.shift + self._arms, self._centers + self._arms

    @cached_property
    def squares(self) -> Enclosure:
        """Return the squares of the lengths of the legs (N, 6)."""
        found: Enclosure = (self._centers.square() + 2.0 * self._centers * self._arms).sum() + (
            self.starts.arms * self.starts.arms).sum(axis=2)
        return found

    @cached_property
    def lengths(self) -> Enclosure:
        """Return the lengths of the legs (N, 6)."""
        return self.squares.sqrt()

    @cached_property
    def inverse_lengths(self) -> Enclosure:
        """Return the inverses of the lengths (N, 6)."""
        return self.lengths.inverse()

    @cached_property
    def lever_squares(self) -> Enclosure:
        """Return the squares of h (N, 6) [m^2], length / radius of the lever on a circle."""
        circles = self.circles
        radii, lengths = circles.radii, circles.lengths
        self._across = joined([dot(self.lines, each)[..., None] for each in (
            circles.along, circles.across)])
        self._reach = self._across.square().sum()
        self._part = (self.squares + (radii * radii - lengths * lengths)) * (0.5 / radii)
        return self._reach - self._part.square()

    @cached_property
    def turned_circles(self) -> Enclosure:
        """
        Return cosines and sines of the positions of drives on circles (N, 6, 2).

        With x, y across the axis, ``x cos q + y sin q = g``, and h. Of points that a line does
        not reach those of the dead centre; unknown near it.
        """
        h = _not_negative(self.lever_squares).sqrt() * self.circles.signs
        x, y, g = self._across[..., 0], self._across[..., 1], self._part
        inverse = self._reach.inverse()
        return joined([each[..., None] for each in (
            (x * g + y * h) * inverse, (y * g - x * h) * inverse)])

    @property
    def circles(self) -> AnchorCircles:
        """Return the circles of the anchors, which move."""
        assert self.starts.circles is not None
        return self.starts.circles

    @cached_property
    def directions(self) -> Enclosure:
        """Return unit vectors (N, 6, 3) along which legs push the platform joints."""
        if self.starts.circles is None:
            return unit(self.lines)
        turned, circles = self.turned_circles, self.circles
        along = turned[..., :1] * circles.along + turned[..., 1:] * circles.across
        return (self.lines - along * circles.radii[:, None]) * (1.0 / circles.lengths[:, None])

    @cached_property
    def matrices(self) -> Enclosure:
        """Return the scaled J_inv (N, 6, 6)."""
        directions = self.directions
        return joined([directions, cross(self.turned(self.starts.levers), directions)])

    def turned(self, vectors: Array) -> Enclosure:
        """Return vectors (N, M, 3) that turn with the platform."""
        center = vectors @ self._rotation
        return Enclosure(center, center @ self._spins, np.broadcast_to(
            self._bend * length(vectors), center.shape))

    def fixed(self, vectors: Array) -> Enclosure:
        """Return vectors (N, M, 3) that do not move."""
        whole = np.broadcast_to(vectors, (len(self._rotation), *vectors.shape[1:]))
        return Enclosure(whole, np.zeros((len(self._spins), *whole.shape)), _EPS * np.abs(whole))

    def turned_back(self, vectors: Enclosure) -> Enclosure:
        """Return vectors (N, M, 3) as seen from the platform, in its axes at the start."""
        units = self.turned(np.eye(3)[None])
        return (vectors[:, :, None] * units[:, None]).sum()

    def normals_back(self, normals: Array, rows: Integers) -> Array:
        """Return unit vectors (I, 3) of some rows as seen from the platform."""
        seen: Array = np.einsum('nij,nj->ni', self._rotation[rows], normals)
        return seen


def _not_negative(numbers: Enclosure) -> Enclosure:
    """Return the same numbers with centers that are not negative."""
    low = np.minimum(numbers.center, 0.0)
    return Enclosure(numbers.center - low, numbers.slopes, numbers.rest - low)


class Quantity(ABC):
    """
    A quantity that has limits; its margins are positive where they are kept.

    legs, codes (M,): leg, -1 for none, and code of the limit of each margin, see ``travel.ENDS``.
    tolerance: a travel may pass a part where a margin is negative by no more than this.
    fine: a box is tried that is smaller by this part than one that is not reachable.
    coarse: where a proof does not end the factor of a box is found to this ratio.
    exact: the largest excess in a box is found to this part of a limit; near zero always, and if
        infinite only its sign.
    most: largest number of cells of a box.
    """

    legs: Integers
    codes: Integers
    tolerance, fine, coarse, exact, most = 1e-10, 1e-9, 1.01, 1e-7, 100_000

    @abstractmethod
    def margins(self, moved: Moved) -> Enclosure:
        """Return (N, M) margins over cells."""

    def values(self, moved: Moved) -> Array:
        """Return numbers (N, M) of the signs of the margins at points, with simple roots."""
        return self.margins(moved).center

    def only(self, open_: Flags) -> Quantity:
        """Return the quantity with less margins, at least those that are open (M,)."""
        del open_
        return self

    @abstractmethod
    def excesses(self, margins: Array) -> Array:
        """Return by how much limits are exceeded, relative, at margins (N, M)."""

    def excesses_at(self, moved: Moved) -> Array:
        """Return by how much limits are exceeded, relative, at points."""
        return self.excesses(self.values(moved))

    def weights(self, moved: Moved, slopes: Array) -> Array:
        """Return by how much the edges of cells count (D, N); slopes (D, N): of one margin."""
        found: Array = np.abs(slopes) + 0.1 * (
            length(moved.joints.slopes)[..., 0] / moved.lengths.center).max(axis=2)
        return found


class Lengths(Quantity):
    """
    Lengths of the legs; margins (N, M) ``l^2 / min^2 - 1`` and ``1 - l^2 / max^2``.

    bounds (2, 6): shortest and longest lengths [m]; 0 and infinity do not limit.
    """

    def __init__(self, bounds: Array) -> None:
        self.bounds = bounds
        self.codes, self.legs = np.nonzero([bounds[0] > 0.0, bounds[1] < math.inf])
        self._signs: Array = np.where(self.codes > 0, -1.0, 1.0)
        self._scales: Array = self._signs / bounds[self.codes, self.legs] ** 2

    def margins(self, moved: Moved) -> Enclosure:
        """Return margins over cells."""
        squares: Enclosure = moved.squares[:, self.legs]
        return squares * self._scales - self._signs

    def excesses(self, margins: Array) -> Array:
        """Return by how much limits are exceeded, relative, at margins (N, M)."""
        ratios = np.sqrt(np.maximum(1.0 + self._signs * margins, 0.0))
        return np.asarray(self._signs * (1.0 - ratios))


class Angles(Quantity):
    """
    Angles of the joints; margins (N, M) ``cos angle - cos max`` of those that have a limit.

    bounds (2, 6): largest angles at base and platform [rad].
    axes (6, 3): of the base joints.
    """

    def __init__(self, bounds: Array, axes: Array) -> None:
        self._axes, self._limited = axes, np.flatnonzero(bounds.ravel() < math.pi)
        self._bounds = bounds.ravel()[self._limited]
        self._cosines = np.cos(self._bounds)
        self.legs, self.codes = self._limited % 6, 2 + self._limited // 6

    def margins(self, moved: Moved) -> Enclosure:
        """Return margins over cells."""
        both = self._axes, moved.turned(moved.starts.axes)
        if moved.starts.circles is None:
            cosines = [dot(moved.lines, axes) * moved.inverse_lengths for axes in both]
        else:
            cosines = [dot(moved.directions, axes) for axes in both]
        return joined(cosines)[:, self._limited] - self._cosines

    def excesses(self, margins: Array) -> Array:
        """Return by how much limits are exceeded, relative, at margins (N, 12)."""
        found: Array = np.arccos(np.clip(
            margins + self._cosines, -1.0, 1.0)) / self._bounds - 1.0
        return found


class Levers(Quantity):
    """
    Levers of drives on circles; margins (N, 6) ``h^2 / length^2 - least^2``.

    They are polynomials of the position of the platform joint: a leg reaches it, and its lever is
    large enough, where they are positive.

    code: of the limit.
    """

    legs: Integers = np.arange(6)

    def __init__(self, circles: AnchorCircles, code: int) -> None:
        self._scales = 1.0 / circles.lengths ** 2
        self._least = circles.least
        self.codes = np.full(6, code)

    def margins(self, moved: Moved) -> Enclosure:
        """Return margins over cells."""
        return moved.lever_squares * self._scales - self._least ** 2

    def excesses(self, margins: Array) -> Array:
        """Return by how much the levers are too small (N, 6), by the largest lever."""
        squares = margins + self._least ** 2
        found: Array = self._least - np.copysign(np.sqrt(np.abs(squares)), squares)
        return found


class Turns(Quantity):
    """
    Positions of drives on circles; margins (N, M) ``cos(q - middle) - cos half``, scaled.

    The cosine has one value on all of the circle, also where the position begins again.

    codes: of the limits past which positions are above and below.
    """

    def __init__(self, circles: AnchorCircles, codes: Sequence[int]) -> None:
        self._limited = limited = np.flatnonzero(np.isfinite(circles.halves))
        self._halves = halves = circles.halves[limited]
        middles = circles.middles[limited]
        self._middles = np.stack([np.cos(middles), np.sin(middles)], axis=-1)
        # no position is within a range that is empty
        self._cosines = np.where(halves < 0.0, 2.0, np.cos(halves))
        self._scales = 1.0 / np.maximum(np.sin(halves), _LEAST_SLOPE)
        self.legs = np.concatenate([limited, limited])
        self.codes = np.repeat(codes, len(limited))

    def margins(self, moved: Moved) -> Enclosure:
        """Return margins over cells, one for each leg."""
        cosines = dot(moved.turned_circles[:, self._limited], self._middles)
        found: Enclosure = (cosines - self._cosines) * self._scales
        return found

    def values(self, moved: Moved) -> Array:
        """Return how far positions are below the upper limit (N, M), and above the lower one."""
        return -self.excesses_at(moved)

    def excesses(self, margins: Array) -> Array:
        """Return by how much positions are out of their ranges (N, M), at margins."""
        found: Array = np.arccos(np.clip(
            margins / self._scales + self._cosines, -1.0, 1.0)) - self._halves
        return found

    def excesses_at(self, moved: Moved) -> Array:
        """Return by how much positions are above and below their ranges (N, 2 M), at points."""
        x, y = np.moveaxis(moved.turned_circles.center[:, self._limited], -1, 0)
        cosine, sine = self._middles.T
        offsets = np.arctan2(y * cosine - x * sine, x * cosine + y * sine)
        return np.concatenate([offsets - self._halves, -offsets - self._halves], axis=1)


class Conditioning(Quantity):
    """
    The condition number of the scaled J_inv; one margin ``1 - condition / stop``.

    With the singular value decomposition ``U S V^T`` of the matrix in the middle of a cell, the
    largest singular value of a matrix near it is that of four blocks: the first element, the rest
    of its row and column, and the others. Likewise of the inverse,
    ``(1 + F)^-1 = 1 - F + F^2 (1 + F)^-1`` with ``F = S^-1 U^T E V``.
    """

    tolerance, fine, coarse, exact, most = 0.0, 1e-3, 1.15, math.inf, 80_000
    legs, codes = np.array([-1]), np.array([5])

    def __init__(self, stop: float) -> None:
        self.stop = stop

    def weights(self, moved: Moved, slopes: Array) -> Array:
        """Return by how much the edges of cells change the matrix (D, N)."""
        found = _norm(_inverses(moved.matrices.center) @ moved.matrices.slopes)
        if moved.starts.circles is None:
            return found
        # near a dead centre slopes are not known
        return np.where(np.isfinite(found), found, super().weights(moved, np.zeros(found.shape)))

    def values(self, moved: Moved) -> Array:
        """
        Return ``stop / condition - 1`` at points (N, 1).

        The condition number counts as negative where det(J) has changed its sign.
        """
        singular = np.linalg.svd(moved.matrices.center, compute_uv=False)
        room = singular[:, 5] / singular[:, 0] * self.stop
        kept = np.linalg.det(moved.matrices.center) * moved.starts.sides >= 0.0
        return (np.where(kept, room, -room) - 1.0)[:, None]

    def excesses(self, margins: Array) -> Array:
        """Return ``condition / stop - 1`` at margins."""
        return -margins

    def excesses_at(self, moved: Moved) -> Array:
        """Return ``condition / stop - 1`` at points; infinite past a singularity."""
        room = self.values(moved) + 1.0
        return np.asarray(np.where(room > 0.0, 1.0 / room - 1.0, math.inf))

    def margins(self, moved: Moved) -> Enclosure:
        """Return the margin of the quantity (N, 1)."""
        matrices = moved.matrices
        with np.errstate(all='ignore'):
            inverse = _inverses(matrices.center)
            change = np.abs(inverse @ matrices.slopes).sum(axis=0) + np.abs(
                inverse) @ matrices.rest
            left = 1.0 - _norm(change)
            bounds = _norm(np.abs(matrices.center) + matrices.spread + matrices.rest) * _norm(
                inverse) / left
            center = np.where(left > 0.0, 1.0 - bounds / self.stop, np.nan)
            slopes, rest = np.zeros((len(matrices.slopes), len(center))), np.zeros(len(center))
            finer = ~(center > 0.0)
            if finer.any():
                exact, bounds = _condition(matrices[finer])
                exact = 1.0 - exact * (1.0 / self.stop)
                kept = bounds < self.stop
                center[finer] = np.where(kept, 1.0 - bounds / self.stop, exact.center)
                slopes[:, finer], rest[finer] = np.where(kept, 0.0, exact.slopes), np.where(
                    kept, 0.0, exact.rest)
        return Enclosure(center, slopes, rest)[:, None]


def _norm(matrices: Array) -> Array:
    """Return Frobenius norms of matrices (..., N, M)."""
    norms: Array = np.sqrt(np.einsum('...ij,...ij->...', matrices, matrices))
    return norms


def _inverses(matrices: Array) -> Array:
    """Return inverses, or nan for all where one is exactly singular."""
    try:
        return np.asarray(np.linalg.inv(matrices), dtype=float)
    except np.linalg.LinAlgError:
        return np.full_like(matrices, np.nan)


def _condition(matrices: Enclosure) -> tuple[Enclosure, Array]:
    """
    Return the condition numbers of matrices (N, 6, 6), and bounds of them that large cells need.

    Not finite where one may be singular.
    """
    u, singular, vt = np.linalg.svd(matrices.center)
    ut, v = np.swapaxes(u, 1, 2), np.swapaxes(vt, 1, 2)
    slopes, rest = ut @ matrices.slopes @ v, np.abs(ut) @ matrices.rest @ np.abs(v)
    sizes = np.abs(slopes).sum(axis=0) + rest
    rows, columns = 1.0 / singular[:, :, None], 1.0 / singular[:, None, :]
    left = 1.0 - np.maximum(_norm(rows * sizes), _norm(sizes * columns))
    both = rows * columns
    bend = (1.0 - left) * _norm(both * sizes) / np.where(left > 0.0, left, np.nan)
    back = (..., slice(None, None, -1), slice(None, None, -1))  # the largest comes first
    inverse = _largest(1.0 / singular[:, ::-1], (-both * slopes)[back], (both * rest)[back])
    bounds = (singular[:, 0] + _norm(sizes)) / singular[:, 5] / np.where(left > 0.0, left, np.nan)
    return _largest(singular, slopes, rest) * Enclosure(
        inverse.center, inverse.slopes, inverse.rest + bend), bounds


def _largest(values: Array, slopes: Array, rest: Array) -> Enclosure:
    """Return the largest singular value of matrices near diagonal ones (N, 6)."""
    sizes = np.abs(slopes).sum(axis=0) + rest
    first, second = values[:, 0] - sizes[:, 0, 0], values[:, 1] + _norm(sizes[:, 1:, 1:])
    row, column = _norm(sizes[:, :1, 1:]), _norm(sizes[:, 1:, :1])
    squares = first ** 2 + second ** 2 + row ** 2 + column ** 2
    determinant = first * second - row * column
    largest = np.sqrt(0.5 * (squares + np.sqrt(squares ** 2 - 4.0 * determinant ** 2)))
    more = np.where(first > 0.0, largest - first, np.nan)
    return Enclosure(values[:, 0], slopes[:, :, 0, 0], rest[:, 0, 0] + more)
