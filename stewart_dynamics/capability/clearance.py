# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The clearance of legs and plates over cells of poses.

A body is the convex hull of corners: two of a cylinder or piston, any number of a plate. Whatever
vector n is chosen, two bodies are at least ``min n . (p - q) / |n|`` apart, over the corners p of
one and q of the other. In the middle of a cell the shortest vector between them is the best n. It
may change over the cell, ``n + sum_k x_k n_k``: where several corners are equally near, as those
of two legs that cross, the n_k are chosen by least squares so that they stay so. Besides this n,
one that stays and one that turns with the platform are tried: corners of one part, base or
platform, keep their distances exactly.

The axis of a cylinder longer than its leg ends at the platform joint. Over a cell the hull of the
base joint and of either end contains it.
"""

from __future__ import annotations

from collections.abc import Iterator
import copy
from itertools import combinations, product

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.capability.intervals import dot, Enclosure, joined, unit, where
from stewart_dynamics.capability.quantities import Moved, Quantity, ROUNDING

# Corners of a leg: base joint, end of the cylinder (twice: no longer than the leg, and as it is),
# and platform joint. The plates of base and platform follow those of six legs.
_BASE_JOINT, _CYLINDER, _CYLINDER_END, _PLATFORM_JOINT, _OF_LEG = range(5)
# Corners whose direction from the nearest one is this near to a right angle with n count as near,
# and the part of the least squares that keeps the n_k small where legs are almost parallel.
_NEAR, _RIDGE = 0.05, 1e-3


class Clearance(Quantity):
    """
    The clearance of the legs from each other and from the plates; margins relative to the size.

    shapes (6, 3): radius and length of the cylinder, radius of the piston [m].
    limit, size: smallest clearance, size of the hexapod [m].
    base, platform: numbers of corners of the plates.

    legs (M,): leg of each margin, of two legs the first.
    """

    tolerance, fine, coarse, exact = ROUNDING, 1e-3, 1.04, 0.1

    def __init__(self, shapes: Array, limit: float, size: float, base: int, platform: int) -> None:
        self._cylinders, self._limit, self._size = shapes[:, 1], limit, size
        thick, thin = shapes[:, 0], shapes[:, 2]
        cylinder, piston = (_BASE_JOINT, _CYLINDER), (_BASE_JOINT, _PLATFORM_JOINT)
        legs = _OF_LEG * np.arange(6)
        bodies = [[(legs[n] + np.array(each), radius[n]) for each, radius in (
            (cylinder, thick), (piston, thin))] for n in range(6)]
        of_legs = [(i, p, q, first + second) for i, j in combinations(range(6), 2)
                   for (p, first), (q, second) in product(bodies[i], bodies[j])]
        plates = np.split(6 * _OF_LEG + np.arange(base + platform), [base])
        of_base = [(n, legs[n] + np.array([_CYLINDER_END, _PLATFORM_JOINT]), plates[0], thin[n])
                   for n in range(6) if base]
        of_platform = [(n, *bodies[n][0][:1], plates[1], thick[n]) for n in range(6) if platform]
        # of each kind of pair: corners of both bodies (K, 2), (K, Q), and sums of radii (K,)
        self._kinds: list[tuple[Integers, Integers, Array]] = []
        legs_of = []
        for pairs in (of_legs, of_base, of_platform):
            if pairs:
                leg, p, q, radii = zip(*pairs, strict=True)
                self._kinds.append((np.array(p), np.array(q), np.array(radii)))
                legs_of.append(np.repeat(leg, 2 * len(q[0])))
        self.legs = np.concatenate(legs_of)
        self.codes = np.full(len(self.legs), 4)

    def only(self, open_: Flags) -> Clearance:
        """Return the clearance of the pairs that have open margins (M,)."""
        kinds, legs, first = [], [self.legs[:0]], 0
        for p, q, radii in self._kinds:
            margins = slice(first, first + 2 * q.size)
            which = open_[margins].reshape(len(p), -1).any(axis=1)
            if which.any():
                kinds.append((p[which], q[which], radii[which]))
                legs.append(self.legs[margins].reshape(len(p), -1)[which].ravel())
            first = margins.stop
        found = copy.copy(self)
        found._kinds, found.legs = kinds, np.concatenate(legs)
        found.codes = self.codes[:len(found.legs)]
        return found

    def margins(self, moved: Moved) -> Enclosure:
        """Return (N, M) margins: those of a pair's corners all are positive where it is clear."""
        frames = list(self._corners(moved))
        return joined([self._of_pairs(frames, moved, *kind) for kind in self._kinds])

    def excesses(self, margins: Array) -> Array:
        """Return by how much the clearance is too small, relative to the size."""
        return -margins

    def _corners(self, moved: Moved) -> Iterator[Enclosure]:
        """Yield the corners of all bodies (N, K, 3), and as they are seen from the platform."""
        starts = moved.starts
        for joints, ends, plates in (
                (moved.fixed(-starts.centers), moved.joints,
                 (moved.fixed(starts.base), moved.shift + moved.turned(starts.platform))),
                (moved.turned_back(moved.fixed(-starts.centers) - moved.shift),
                 moved.fixed(starts.arms),
                 (moved.turned_back(moved.fixed(starts.base) - moved.shift),
                  moved.fixed(starts.platform)))):
            cylinders = joints + unit(ends - joints) * self._cylinders[:, None]
            inside = (moved.lengths.center <= self._cylinders)[..., None]
            legs = joined([each[:, :, None] for each in (
                joints, where(inside, ends, cylinders), cylinders, ends)], axis=-2)
            yield joined([legs.reshape(-1, 6 * _OF_LEG, 3), *plates], axis=-2)

    def _of_pairs(self, frames: list[Enclosure], moved: Moved, first: Integers, second: Integers,
                  radii: Array) -> Enclosure:
        """Return margins of pairs of bodies (N, K * 2 * Q), relative to the size."""
        corners, needed = frames[0], radii + self._limit
        vectors = _shortest(corners.center[:, first], corners.center[:, second])
        distances = _length(vectors)
        reach = _length(corners.spread + corners.rest)
        coarse = distances - needed - reach[:, first].max(axis=2) - reach[:, second].max(axis=2)
        center = np.repeat(coarse[..., None], 2 * second.shape[1], axis=2)
        slopes, rest = np.zeros((len(corners.slopes), *center.shape)), np.zeros(center.shape)
        rows, pairs = np.nonzero(~(coarse > 0.0))
        center[rows, pairs] = -needed[pairs, None]  # that of bodies that overlap
        apart = distances[rows, pairs] > 0.0
        rows, pairs = rows[apart], pairs[apart]
        if len(rows):
            n = vectors[rows, pairs] / distances[rows, pairs][:, None]
            best = self._along(corners, n, rows, first[pairs], second[pairs], needed[pairs], True)
            lowest = best.low.min(axis=1)
            for frame, normal in zip(frames, (n, moved.normals_back(n, rows)), strict=True):
                again = np.flatnonzero(~(lowest > 0.0))
                if not len(again) or not len(corners.slopes):
                    break
                which = pairs[again]
                other = self._along(frame, normal[again], rows[again], first[which],
                                    second[which], needed[which], False)
                better = ~(other.low.min(axis=1) <= lowest[again])
                best = best.replaced(again[better], other[better])
                lowest[again[better]] = other.low.min(axis=1)[better]
            center[rows, pairs], slopes[:, rows, pairs], rest[rows, pairs] = (
                best.center, best.slopes, best.rest)
        whole = Enclosure(center, slopes, rest) * (1.0 / self._size)
        return whole.reshape(len(center), -1)

    @staticmethod
    def _along(corners: Enclosure, n: Array, rows: Integers, first: Integers, second: Integers,
               needed: Array, follows: bool) -> Enclosure:
        """Return margins of the corners of pairs (I, 2 * Q) along unit vectors (I, 3)."""
        p, q = corners[rows[:, None], first], corners[rows[:, None], second]
        rates = _rates(n, p, q) if follows else np.zeros((len(p.slopes), *n.shape))
        swept = np.abs(rates).sum(axis=0)
        longer = np.sqrt(1.0 + (swept * swept).sum(axis=1)) - 1.0
        normals = Enclosure(n, rates, np.zeros(n.shape))[:, None, None]
        apart = dot(p[:, :, None] - q[:, None], normals) - needed[:, None, None]
        return Enclosure(apart.center, apart.slopes, apart.rest + (
            needed * longer)[:, None, None]).reshape(len(n), -1)


def _length(vectors: Array) -> Array:
    """Return lengths of vectors (..., 3)."""
    lengths: Array = np.sqrt(np.einsum('...i,...i->...', vectors, vectors))
    return lengths


def _between(p: Array, p_end: Array, q: Array, q_end: Array) -> Array:
    """Return the shortest vectors from segments q to segments p (..., 3), see leg_clearance."""
    s, t, gap = p_end - p, q_end - q, p - q
    ss, tt, st = (np.einsum('...i,...i->...', *each) for each in ((s, s), (t, t), (s, t)))
    gs, gt = (np.einsum('...i,...i->...', gap, each) for each in (s, t))
    ss, tt = (np.where(each > 0.0, each, 1.0) for each in (ss, tt))
    normal = ss * tt - st * st
    u = np.where(normal > 1e-14 * ss * tt, (st * gt - gs * tt) / normal, 0.0)
    v = np.clip((np.clip(u, 0.0, 1.0) * st + gt) / tt, 0.0, 1.0)
    u = np.clip((v * st - gs) / ss, 0.0, 1.0)
    vectors: Array = gap + u[..., None] * s - v[..., None] * t
    return vectors


def _shortest(p: Array, q: Array) -> Array:
    """Return the shortest vectors from bodies q (..., Q, 3) to segments p (..., 2, 3)."""
    if q.shape[-2] == 2:
        return _between(p[..., 0, :], p[..., 1, :], q[..., 0, :], q[..., 1, :])
    to_edges = _between(p[..., :1, :], p[..., 1:, :], q, np.roll(q, -1, axis=-2))
    spokes = q[..., 1:, :] - q[..., :1, :]
    normal = np.cross(spokes[..., :-1, :], spokes[..., 1:, :]).sum(axis=-2, keepdims=True)
    # one of these separates the bodies most: the nearest edge's, or the plate's own
    units = np.concatenate([to_edges, normal, -normal], axis=-2)
    units = units / _length(units)[..., None]
    apart = (units @ np.swapaxes(p, -1, -2)).min(axis=-1) - (
        units @ np.swapaxes(q, -1, -2)).max(axis=-1)
    apart = np.where(apart > 0.0, apart, 0.0)  # and not nan
    best = apart.argmax(axis=-1)[..., None]
    vectors: Array = np.take_along_axis(apart, best, axis=-1) * np.take_along_axis(
        units, best[..., None], axis=-2)[..., 0, :]
    return vectors


def _rates(n: Array, p: Enclosure, q: Enclosure) -> Array:
    """Return derivatives (D, I, 3) of vectors n (I, 3) from bodies q to bodies p (I, K, 3)."""
    e = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    e /= _length(e)[:, None]
    f = np.cross(n, e)
    sums = np.zeros((3, len(n))) + [[_RIDGE], [0.0], [_RIDGE]]
    falls = np.zeros((2, len(p.slopes), len(n)))
    for body, sign in ((p, 1.0), (q, -1.0)):
        along = np.einsum('nkj,nj->nk', body.center, sign * n)
        nearest = (np.arange(len(n)), along.argmin(axis=1))
        off = body.center - body.center[nearest][:, None]
        distance = _length(off)
        near = np.abs(along - along[nearest][:, None]) < _NEAR * distance
        weight = np.where(near, 1.0 / np.where(near, distance, 1.0), 0.0)
        off_e, off_f = (np.einsum('nkj,nj->nk', off, each) * weight for each in (e, f))
        falling = np.einsum('dnkj,nj->dnk', body.slopes - body.slopes[
            (slice(None), *nearest)][:, :, None], n) * weight
        sums += [(off_e * off_e).sum(axis=1), (off_e * off_f).sum(axis=1),
                 (off_f * off_f).sum(axis=1)]
        falls -= [(falling * off_e).sum(axis=2), (falling * off_f).sum(axis=2)]
    ee, ef, ff = sums / (sums[0] * sums[2] - sums[1] ** 2)
    along_e, along_f = falls
    rates: Array = ((ff * along_e - ef * along_f)[..., None] * e
                    + (ee * along_f - ef * along_e)[..., None] * f)
    return rates
