# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Sections of the workspace at a fixed rotation.

At a fixed rotation a platform joint moves with the platform, so the end of leg i is at ``x - e_i``
from its base joint with a constant ``e_i``: a limit of its length is a sphere around ``e_i``, a
limit of an angle at one of its joints a cone with the tip ``e_i``. A plane cuts them in circles
and conics. The boundary of the section are the parts of these curves where all other limits are
kept: holes stay holes. Where circles cross is known in closed form, so no arc is missed; where an
arc crosses another limit is found by bisection. An arc of a conic, however short, begins and ends
where an arc found before ends on it. Boundaries at singularities and at the clearance of the legs
are found on a grid; where drives move the anchors of legs on circles, all boundaries are.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.lines import AnchorCircles
from stewart_dynamics.mechanics.batch import drive_positions
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.limits import (
    BASE_ANGLE_MAX, CLEARANCE_MIN, LENGTH_MAX, LENGTH_MIN, Limits, OF_JOINTS, short_name,
    SINGULARITY)
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import DETERMINANT, MOTION, POSITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Points of a curve at least, and steps of a bisection.
_POINTS, _STEPS = 360, 50
# Random poses and starts of the search in a box, and its last step relative to the ranges.
_TRIALS, _STARTS, _FINEST = 1000, 8, 1e-6
# Circles that differ by less, relative to their radius, are one.
_SAME = 1e-9
# Points whose angle at a joint differs by less from its bound are on the cone; above the
# tolerance of limits.
_ON = 1e-7
# Lines of the grid on which boundaries at singularities are found.
_GRID = 129

_Curve = Callable[[Array], Array]


class Boundary(NamedTuple):
    """A part of the boundary of a section, which one limit of one leg forms."""

    limit: str  # name of the limit without ``limits.``, or ``singularity``
    leg: int  # index of the leg; -1 at a singularity
    points: Array
    """Positions of the platform's origin (M, 3) in order, base frame [m]; of a closed curve the
    first one again at the end."""


class Section(NamedTuple):
    """Reachable positions of the platform's origin in a plane, at a fixed rotation."""

    boundary: tuple[Boundary, ...]
    """Parts of the boundary, in no order; empty where nothing is reachable."""
    loops: tuple[Array, ...]
    """
    The same joined to closed curves (M, 3).

    A position is reachable where a line from it crosses them an odd number of times.
    """


def section(platform: StewartPlatform, axes: Array, start: Motion, normal: int) -> Section:
    """
    Return the section through a pose, at its rotation, in a plane.

    platform: with ``limits.length_max``.
    axes (12, 3): as in ``travel.travels``.
    start: det(J) has the same sign in all of the section.
    normal: index of the base axis that is normal to the plane.
    """
    plane = _Plane(platform, start, normal)
    if plane.circles is not None:
        found = [*plane.edges_of_circles(plane.circles)]
        return Section(tuple(found), tuple(_joined([each.points for each in found])))
    curves = list(_curves(platform, axes, start, normal))
    circles = [each for name, leg, curve, crossings in curves if not callable(crossings)
               for each in plane.parts(name, leg, curve, crossings)]
    found, count = circles, -1
    while len(found) != count:
        count = len(found)
        ends = np.array([each.points[n] for each in found for n in (0, -1)]).reshape(-1, 3)
        found = circles + [
            each for name, leg, curve, crossings in curves if callable(crossings)
            for each in plane.parts(name, leg, curve, crossings(ends))]
    found += [*_chained(plane.singular()), *_chained(plane.too_near())]
    return Section(tuple(found), tuple(_joined([each.points for each in found])))


class _Plane:
    """A plane of positions at the rotation of a pose."""

    def __init__(self, platform: StewartPlatform, start: Motion, normal: int) -> None:
        self._platform, self._row, self._normal = platform, start.rows, normal
        self._limits = PoseLimits(platform.parameters)
        # all lengths are within this range
        p = platform.parameters
        tips = p.geometry.base_joints - p.geometry.platform_joints @ start.rotation.T
        self.circles = circles = p.leg_kind.anchor_circles(p)
        longest = (self._limits.limits.bounds[LENGTH_MAX] if circles is None
                   else circles.radii + circles.lengths)[:, None]
        self._low, self._high = (tips - longest).max(axis=0), (tips + longest).min(axis=0)
        self._side = float(platform.solve(start.rows[None])[0, DETERMINANT])

    def regular(self, points: Array) -> Flags:
        """Return at which positions (N, 3) the condition number and the sign of det(J) hold."""
        return self._limits.regular(self._platform.solve(self._rows(points)), self._side)

    def clear(self, points: Array) -> Flags:
        """Return at which positions (N, 3) no two legs are too near."""
        clearances = self._limits.clearances(self._rows(points))
        return ~self._limits.exceeded(clearances, len(points))

    def within(self, points: Array) -> Flags:
        """Return at which positions (N, 3) lengths and angles of the joints keep their limits."""
        kept: Flags = np.asarray(np.isfinite(points).all(axis=1))
        rows = self._rows(points[kept])
        values = self._limits.drives_and_joints(rows, self._platform.solve(rows))
        kept[kept] = ~self._limits.exceeded(values, len(rows))
        return kept

    def parts(self, name: str, leg: int, curve: _Curve, crossings: Array,
              ) -> Iterator[Boundary]:
        """Yield the parts of a closed curve of an angle that keep all limits."""
        edges = np.unique(np.concatenate([
            np.linspace(0.0, 2.0 * math.pi, _POINTS, endpoint=False),
            np.mod(crossings, 2.0 * math.pi)]))
        # between two edges at most one circle begins or ends
        at = 0.5 * (edges + np.append(edges[1:], edges[0] + 2.0 * math.pi))

        def good(angles: Array) -> Flags:
            points = curve(angles)
            kept = self.within(points)
            kept[kept] = self.clear(points[kept])
            kept[kept] = self.regular(points[kept])
            return kept

        kept = good(at)
        if kept.all():
            yield Boundary(name, leg, curve(np.append(at, at[0])))
        if kept.all() or not kept.any():
            return
        first = int(np.argmin(kept))
        at = np.concatenate([at[first:], at[:first + 1] + 2.0 * math.pi])
        kept = np.concatenate([kept[first:], kept[:first + 1]])
        changes = np.flatnonzero(kept[1:] != kept[:-1])
        low, high = at[changes], at[changes + 1]
        for _ in range(_STEPS):
            middle = 0.5 * (low + high)
            same = good(middle) == kept[changes]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        ends = np.where(kept[changes], low, high)
        for n in range(0, len(changes), 2):
            between = at[changes[n] + 1:changes[n + 1] + 1]
            yield Boundary(name, leg, curve(np.concatenate([
                ends[n:n + 1], between, ends[n + 1:n + 2]])))

    def singular(self) -> Iterator[Boundary]:
        """Yield the boundary at singularities, in the range that the other limits leave."""
        for piece in self._edges(self.regular):
            if self.within(piece).all() and self.clear(piece).all():
                yield Boundary(SINGULARITY, -1, piece)

    def too_near(self) -> Iterator[Boundary]:
        """Yield the boundary at which legs are too near, in the range that other limits leave."""
        clearance = self._limits.clearance
        if clearance is None:
            return
        for piece in self._edges(self.clear):
            if self.within(piece).all() and self.regular(piece).all():
                leg = int(clearance(self._rows(piece[:1]))[0].argmin())
                yield Boundary(short_name(CLEARANCE_MIN), leg, piece)

    def edges_of_circles(self, circles: AnchorCircles) -> Iterator[Boundary]:
        """Yield the whole boundary where drives move anchors on circles, on a grid."""
        def kept(points: Array) -> Flags:
            good = self.within(points)
            good[good] = self.regular(points[good])
            return good

        pieces = np.array(list(self._edges(kept))).reshape(-1, 2, 3)
        if not len(pieces):
            return
        excesses = self._excesses(circles, pieces[:, 0])
        names = list(excesses)
        nearest = np.abs(np.stack(list(excesses.values()), axis=1)).reshape(len(pieces), -1)
        which = nearest.argmin(axis=1)
        on = nearest[np.arange(len(pieces)), which] < _ON
        for column in np.unique(np.where(on, which, -1)).tolist():
            name, leg = (SINGULARITY, -1) if column < 0 else (
                short_name(names[column // 6]), column % 6)
            yield from _chained(Boundary(name, leg, piece) for piece in pieces[
                (which == column) & on if column >= 0 else ~on])

    def _excesses(self, circles: AnchorCircles, points: Array) -> dict[str, Array]:
        """Return by how much limits of drives and joints are exceeded at positions (N, 6)."""
        rows = self._rows(points)
        bounds = self._limits.limits.bounds
        found = {name: each - bounds[name] for name, each in self._limits.drives_and_joints(
            rows, self._platform.solve(rows)).items()}
        kind = self._platform.parameters.leg_kind
        positions = drive_positions(self._platform.structure, rows)
        offsets = np.remainder(positions - circles.middles + math.pi, 2.0 * math.pi) - math.pi
        ends = zip(circles.limits, (offsets, -offsets), strict=True)
        return {name: each for name, each in found.items() if name not in kind.position_limits} | {
            name: each - circles.halves for name, each in ends if name in found}

    def _edges(self, kept: Callable[[Array], Flags]) -> Iterator[Array]:
        """Yield pieces (2, 3) of the boundary of a condition, between lines of a grid."""
        i, j = (n for n in range(3) if n != self._normal)
        low, high = self._low, self._high
        if (low >= high)[[i, j]].any():
            return
        rows = np.array([self._row[POSITION]])
        x, y = (np.linspace(low[n], high[n], _GRID) for n in (i, j))
        grid = np.tile(rows, (_GRID * _GRID, 1))
        grid[:, i], grid[:, j] = (each.ravel() for each in np.meshgrid(x, y, indexing='ij'))
        regular = kept(grid)
        if regular.all():
            return
        index = np.arange(_GRID * _GRID).reshape(_GRID, _GRID)
        regular = regular.reshape(_GRID, _GRID)
        edges = np.concatenate([
            np.stack([index[:-1][regular[1:] != regular[:-1]],
                      index[1:][regular[1:] != regular[:-1]]], axis=1),
            np.stack([index[:, :-1][regular[:, 1:] != regular[:, :-1]],
                      index[:, 1:][regular[:, 1:] != regular[:, :-1]]], axis=1)])
        start, end = grid[edges[:, 0]], grid[edges[:, 1]]
        begins = regular.ravel()[edges[:, 0]]
        for _ in range(_STEPS):
            middle = 0.5 * (start + end)
            same = (kept(middle) == begins)[:, None]
            start, end = np.where(same, middle, start), np.where(same, end, middle)
        on = dict(zip(map(tuple, edges.tolist()), start, strict=True))
        corners = index[:-1, :-1].ravel()[:, None] + np.array([0, _GRID, _GRID + 1, 1])
        for a, b, c, d in corners.tolist():
            crossed = [on[edge] for edge in ((a, b), (b, c), (d, c), (a, d)) if edge in on]
            for n in range(0, len(crossed) - 1, 2):
                yield np.array(crossed[n:n + 2])

    def _rows(self, points: Array) -> Array:
        rows = np.zeros((len(points), MOTION))
        rows[:] = self._row
        rows[:, POSITION] = points
        return rows


def _curves(platform: StewartPlatform, axes: Array, start: Motion, normal: int,
            ) -> Iterator[tuple[str, int, _Curve, Array | _Curve]]:
    """
    Yield the curve of each limit of each leg in a plane, and where others cross it.

    For a circle the angles at which circles cross it; for a conic a function that returns the
    angles of those of some points that are on it.
    """
    p = platform.parameters
    bounds = Limits(p).bounds
    rotation, height = start.rotation, start.position[normal]
    tips = p.geometry.base_joints - p.geometry.platform_joints @ rotation.T
    i, j = (n for n in range(3) if n != normal)
    above = height - tips[:, normal]
    circles: list[tuple[str, int, float]] = []
    for name in (LENGTH_MIN, LENGTH_MAX):
        for leg, square in enumerate(bounds.get(name, np.zeros(6)) ** 2 - above ** 2):
            radius = math.sqrt(max(square, 0.0))
            # two legs that mirror each other have one circle
            if radius > 0.0 and not any(
                    math.hypot(*(tips[other] - tips[leg])[[i, j]]) + abs(its - radius)
                    < _SAME * radius for _, other, its in circles):
                circles.append((name, leg, radius))
    for name, leg, radius in circles:
        center = tips[leg]
        crossings: list[float] = []
        for _, other, its in circles:
            across = tips[other] - center
            distance = math.hypot(across[i], across[j])
            if distance > 0.0:
                cosine = (distance ** 2 + radius ** 2 - its ** 2) / (2.0 * distance * radius)
                if abs(cosine) <= 1.0:
                    toward = math.atan2(across[j], across[i])
                    crossings += [toward - math.acos(cosine), toward + math.acos(cosine)]

        def circle(angles: Array, center: Array = center, radius: float = radius) -> Array:
            points = np.tile(center, (len(angles), 1))
            points[:, i] += radius * np.cos(angles)
            points[:, j] += radius * np.sin(angles)
            points[:, normal] = height
            return points

        yield short_name(name), leg, circle, np.array(crossings)
    for name in OF_JOINTS:
        for leg, bound in enumerate(bounds.get(name, ())):
            axis = axes[leg] if name == BASE_ANGLE_MAX else rotation @ axes[6 + leg]
            across = np.eye(3)[np.argmin(np.abs(axis))]
            first = np.cross(axis, across) / np.linalg.norm(np.cross(axis, across))
            frame = np.stack([first, np.cross(axis, first), axis])
            tip, up = tips[leg], above[leg]

            def conic(angles: Array, tip: Array = tip, up: float = up, frame: Array = frame,
                      bound: float = bound) -> Array:
                lines = np.stack([math.sin(bound) * np.cos(angles),
                                  math.sin(bound) * np.sin(angles),
                                  np.full(len(angles), math.cos(bound))], axis=1) @ frame
                with np.errstate(all='ignore'):
                    by = up / lines[:, normal]
                    points: Array = tip + np.where(by > 0.0, by, math.nan)[:, None] * lines
                points[:, normal] = np.where(by > 0.0, height, math.nan)
                return points

            def angles_on(points: Array, tip: Array = tip, frame: Array = frame,
                          bound: float = bound) -> Array:
                lines = (points - tip) @ frame.T
                off = np.arctan2(np.hypot(lines[:, 0], lines[:, 1]), lines[:, 2]) - bound
                at: Array = np.arctan2(lines[:, 1], lines[:, 0])[np.abs(off) < _ON]
                return at

            yield short_name(name), leg, conic, angles_on


def _chained(pieces: Iterable[Boundary]) -> Iterator[Boundary]:
    """Yield boundaries of pieces (2, 3) of one leg that share their ends."""
    waiting = dict(enumerate(pieces))
    at: dict[tuple[Any, ...], list[int]] = {}
    for n, (_, leg, points) in waiting.items():
        for end in points.tolist():
            at.setdefault((leg, *end), []).append(n)
    while waiting:
        name, leg, points = waiting.pop(next(iter(waiting)))
        line = deque(points.tolist())
        for end, add in ((-1, line.append), (0, line.appendleft)):
            while following := [n for n in at[(leg, *line[end])] if n in waiting]:
                first, second = waiting.pop(following[0]).points.tolist()
                add(second if first == line[end] else first)
        yield Boundary(name, leg, np.array(line))


def _joined(pieces: list[Array]) -> Iterator[Array]:
    """Yield closed curves of pieces, each of whose ends is joined to the nearest other one."""
    waiting = [each for each in pieces if len(each)]
    while waiting:
        loop = waiting.pop(0)
        while waiting:
            ends = np.array([(each[0], each[-1]) for each in waiting])
            distances = np.linalg.norm(ends - loop[-1], axis=2)
            at, side = divmod(int(distances.argmin()), 2)
            if np.linalg.norm(loop[0] - loop[-1]) <= distances[at, side]:
                break
            following = waiting.pop(at)
            loop = np.concatenate([loop, following[::-1] if side else following])
        yield np.concatenate([loop, loop[:1]])


class InBox(NamedTuple):
    """The smallest value of a quantity that was found in a box, and its pose."""

    value: float
    pose: Any


def smallest(quantity: Callable[[Any], Array], poses: Callable[[Array], Any], ranges: Array,
             ) -> InBox:
    """
    Return the smallest value of a quantity that a search finds in a box (6, 2).

    Its corners, random poses, and from the smallest of them a search along the coordinates with
    smaller and smaller steps.
    """
    random = np.random.default_rng(0)
    low, high = ranges.T
    bits = (np.arange(64)[:, None] >> np.arange(6)) & 1
    corners = np.where(bits == 1, high, low)
    inside = random.uniform(low, high, (_TRIALS, 6))
    on_sides = np.where(random.random((_TRIALS, 6)) < 0.3, inside,
                        corners[random.integers(64, size=_TRIALS)])
    points = np.concatenate([corners, inside, on_sides])
    values = quantity(poses(points))
    best = np.argsort(values)[:_STARTS]
    points, values, step = points[best], values[best], 0.25
    moves = np.concatenate([np.eye(6), -np.eye(6)])
    while step > _FINEST:
        trials = np.clip(points[:, None] + step * (high - low) * moves, low, high)
        found = quantity(poses(trials.reshape(-1, 6))).reshape(len(points), -1)
        at = found.argmin(axis=1)
        better = found.min(axis=1) < values
        points = np.where(better[:, None], trials[np.arange(len(points)), at], points)
        values = np.where(better, found.min(axis=1), values)
        if not better.any():
            step *= 0.5
    at = int(values.argmin())
    return InBox(float(values[at]), poses(points[at:at + 1])[0])
