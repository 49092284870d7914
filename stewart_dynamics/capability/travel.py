# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Travel of the platform along a line or about an axis until the first limit.

A travel is cut into pieces. On each the margins of all limits are enclosed (``intervals``): what
is proven to be free is left out, the rest is cut again. Pieces shrink to a root quadratically,
like Newton's method, and no root is jumped over: a limit that is left and entered again ends the
travel. A piece shorter than 1e-7 of the hexapod's size (far away: 1e-8 of the way) is not proven:
the margin at its end decides. Only a part in which a length or angle exceeds its limit by no more
than 1e-10 may be passed. Lengths of a travel that only moves or only turns have a closed form.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.capability.clearance import Clearance
from stewart_dynamics.capability.intervals import Enclosure
from stewart_dynamics.capability.quantities import (
    Angles, Conditioning, Lengths, Moved, Quantity, ROUNDING, Starts)
from stewart_dynamics.mechanics import limits

CLEARANCE_MIN, SINGULARITY, NOTHING = 4, 5, 6
"""Codes of the limit that ends a travel, behind those of lengths and angles."""
LIMITED = (*limits.OF_POSES, limits.SINGULARITY, '', *(
    name for name in limits.LIMITS if limits.LIMITS[name].depends == limits.POSE
    and name not in limits.OF_POSES))
"""Limits of all ends of travels by their codes."""
ENDS = tuple(map(limits.short_name, LIMITED))
"""Names of all ends of travels by their codes."""

LENGTH_MAX = 1
# Pieces of a travel at first, and largest number of pieces of a block of travels.
_PIECES, _MOST = 4, 2_000_000
# A travel without a known end is searched up to this multiple of the size, then of that, ...
_WINDOW = 8.0
_PARTS, _HALVES = np.linspace(0.0, 1.0, _PIECES + 1), np.array([0.0, 0.5, 1.0])
_FIRST_PARTS, _LATER_PARTS = np.array([0.0, 0.06, 0.125, 0.4, 1.0]), np.array(
    [0.0, 0.07, 0.2, 0.5, 1.0])
_TOWARD = np.append(1.0 - 0.25 ** np.arange(13), 1.0)
_NARROW, _FAR, _FINE, _ULPS = 1e-7, 1e-8, 1e-7, 4e-16
_MOST_ROUNDS = 60
# Some margins stay zero along a travel: rounding errors are below this.
_EXACT = 1e-14
_FARTHEST = 1e15  # travels to infinity have no limit up to this multiple of the hexapod's size
# Travels that are computed at once.
_BLOCK = 1024


class Ends(NamedTuple):
    """Ends of travels (N,): multiple of the direction, code of the limit, and leg or -1."""

    values: Array  # infinite if nothing limits, nan where it is not decided
    codes: Integers
    legs: Integers


class PoseMargins(NamedTuple):
    """The quantities of a hexapod that have limits; None where nothing is limited."""

    lengths: Lengths | None
    angles: Angles | None
    condition: Conditioning
    clearance: Clearance | None
    size: float  # of the hexapod [m]
    circles: tuple[Quantity, ...] = ()  # of drives whose anchors move on circles

    @property
    def given(self) -> list[Quantity]:
        """Return the quantities, those that are proven in a short time first."""
        return [*self.circles, *(
            each for each in (self.lengths, self.angles, self.clearance, self.condition)
            if each is not None)]


class _Travels:
    """
    Travels (N,) from poses in directions (N, 6).

    units (N,), least: see ``travels``, and the smallest value of others, in their units.
    """

    def __init__(self, starts: Starts, directions: Array, units: Array | None,
                 least: float) -> None:
        self.starts, self.directions, self._units, self._least = starts, directions, units, least
        self.velocities, turns = directions[:, :3], directions[:, 3:]
        self.rates = np.sqrt((turns * turns).sum(axis=1))
        self.speeds = np.sqrt((self.velocities ** 2).sum(axis=1)) + self.rates * np.sqrt(
            (starts.arms ** 2).sum(axis=2)).max(axis=1)

    def take(self, which: Flags) -> _Travels:
        """Return some of the travels."""
        return _Travels(self.starts.take(which), self.directions[which],
                        None if self._units is None else self._units[which], self._least)

    def needed(self, ends: Array) -> Array:
        """Return how far travels with ends (N,) have to be searched."""
        if self._units is None:
            return ends
        least: Array = np.fmin.reduce(ends / self._units, initial=self._least) * self._units
        return least

    def over(self, which: Integers, low: Array, high: Array) -> Moved:
        """Return the legs over pieces of some of the travels."""
        directions = self.directions[which]
        return Moved(self.starts.take(which), (0.5 * (low + high))[:, None] * directions,
                     (0.5 * (high - low))[None, :, None] * directions)

    def at(self, which: Integers, t: Array) -> Moved:
        """Return the legs at points of some of the travels."""
        return Moved(self.starts.take(which), t[:, None] * self.directions[which],
                     np.zeros((0, len(t), 6)))


def travels(margins: PoseMargins, starts: Starts, directions: Array,
            units: Array | None = None) -> Ends:
    """
    Return the (N,) ends of travels in directions (N, 6), not zero.

    units (N,): only the smallest value, each in its unit, is needed. It is exact, others may be
        too large: travels are not searched behind it.
    """
    ends = Ends(np.full(len(directions), math.inf), np.full(len(directions), NOTHING),
                np.full(len(directions), -1))
    least = math.inf
    for first in range(0, len(directions), _BLOCK):
        block = slice(first, first + _BLOCK)
        own = None if units is None else units[block]
        values = ends.values[block]
        with np.errstate(all='ignore'):
            _shorten(Ends(values, ends.codes[block], ends.legs[block]), margins,
                     _Travels(starts.take(block), directions[block], own, least))
        if own is not None:
            least = float(np.fmin.reduce(values / own, initial=least))
    return ends


def _shorten(ends: Ends, margins: PoseMargins, block: _Travels) -> None:
    """Write the ends of a block of travels."""
    still = ~block.velocities.any(axis=1)
    # a platform that only turns is back at its pose after one turn
    ends.values[still] = 2.0 * math.pi / block.rates[still]
    closed = still | (block.rates == 0.0)
    ways = margins.size / block.speeds
    if closed.any() and margins.lengths is not None:
        _keep(ends, np.flatnonzero(closed), *_ends_of_lengths(
            margins.lengths, block.take(closed)))
    for quantity, which in (*((each, ways > 0.0) for each in margins.circles),
                            (margins.lengths, ~closed), (margins.angles, ways > 0.0),
                            (margins.condition, ways > 0.0), (margins.clearance, ways > 0.0)):
        if quantity is not None and which.any():
            last = np.minimum(ends.values, block.needed(np.where(
                ends.codes == NOTHING, math.inf, ends.values)))
            _keep(ends, np.flatnonzero(which), *_exits(
                quantity, block.take(which), last[which], ways[which]))
    ends.values[ends.codes == NOTHING] = math.inf


def _keep(ends: Ends, which: Integers, exits: Array, codes: Integers, legs: Integers) -> None:
    """Shorten some travels to exits that come first, or are not decided (nan)."""
    first = ~(exits >= ends.values[which])
    for each, new in zip(ends, (exits, codes, legs), strict=True):
        each[which[first]] = new[first]


def _ends_of_lengths(lengths: Lengths, block: _Travels) -> tuple[Array, Integers, Integers]:
    """
    Return the first t at which a leg leaves a bound of its length, infinite if none does.

    Closed: the square of the length is a parabola along a line, and a harmonic about an axis,
    which is a parabola of ``tan(rate t / 2)``. Returns code and leg as well.
    """
    starts, rates = block.starts, block.rates[:, None, None]
    lines = starts.centers + starts.arms
    axes = block.directions[:, None, 3:] / np.where(rates > 0.0, rates, 1.0)
    along = (starts.arms * axes).sum(axis=2, keepdims=True) * axes
    across = np.cross(axes, starts.arms)
    size = np.sqrt((lines * lines).sum(axis=2))
    velocities, squares = block.velocities[:, None], (block.velocities ** 2).sum(axis=1)[:, None]
    rates = rates[..., 0]
    found = []
    for sign, bound in ((1.0, lengths.bounds[1]), (-1.0, lengths.bounds[0])):
        exact = ROUNDING * bound * bound
        room = sign * (bound - size) * (bound + size)  # room - 2 b u + c u^2
        value = np.maximum(room, 0.0)
        a = 2.0 * sign * ((starts.centers + along) * (starts.arms - along)).sum(axis=2)
        b = sign * np.where(rates > 0.0, 2.0 * (lines * across).sum(axis=2), (
            lines * velocities).sum(axis=2))
        c = np.where(rates > 0.0, value + 2.0 * a, -sign * squares)
        amplitude = np.hypot(a, b)
        deepest = np.where(rates > 0.0, np.where(a <= 0.0, amplitude - a, b * b / (amplitude + a)),
                           np.where(c > 0.0, np.where(b > 0.0, b * b / c, 0.0), math.inf))
        root = np.sqrt(np.maximum(b * b - value * c, 0.0))
        above = np.where(b >= 0.0, value, root - b)
        below = np.where(b >= 0.0, b + root, -c)
        t = np.where(rates > 0.0, 2.0 * np.arctan2(above, below) / rates, above / below)
        t = np.where(above > 0.0, t, 0.0)
        t = np.where(value - deepest >= -exact, math.inf, t)
        found.append(np.where(room < -exact, 0.0, np.where(np.isfinite(bound), t, math.inf)))
    exits = np.concatenate(found, axis=1)
    best = exits.argmin(axis=1)
    return exits[np.arange(len(best)), best], LENGTH_MAX - best // 6, best % 6


def _exits(quantity: Quantity, block: _Travels, ends: Array, ways: Array,
           ) -> tuple[Array, Integers, Integers]:
    """
    Return the first t up to ``ends`` at which a margin is negative, its code, and its leg.

    Infinite where no margin is, nan where that is not decided.

    ways (N,): parts of the travels in which legs move by the size of the hexapod.
    """
    exits, finite = np.full(len(ends), math.inf), np.isfinite(ends)
    bottoms, tops = np.zeros(len(ends)), np.where(finite, ends, _WINDOW * ways)
    which = np.flatnonzero(ends > 0.0)
    while len(which):
        parts = np.where(finite[which, None], _PARTS, np.where(
            bottoms[which, None] > 0.0, _LATER_PARTS, _FIRST_PARTS))
        cuts = bottoms[which, None] + (tops - bottoms)[which, None] * parts
        _search(quantity, block, exits, _NARROW * ways, np.repeat(which, _PIECES),
                cuts[:, :-1].ravel(), cuts[:, 1:].ravel())
        needed = block.needed(exits)
        which = which[(exits[which] == math.inf) & ~finite[which]
                      & (tops[which] < np.minimum(_FARTHEST * ways[which], needed[which]))]
        bottoms[which], tops[which] = tops[which], np.minimum(
            _WINDOW * tops[which], needed[which])
    columns: Integers = np.zeros(len(exits), dtype=np.int64)
    if len(ended := np.flatnonzero(exits < math.inf)):
        columns[ended] = quantity.values(block.at(ended, exits[ended])).argmin(axis=1)
    return exits, quantity.codes[columns], quantity.legs[columns]


def _search(quantity: Quantity, block: _Travels, exits: Array, narrow: Array, of: Integers,
            low: Array, high: Array) -> None:
    """
    Write the first exit of each travel that has one in its pieces.

    of, low, high (M,): pieces of the travels, all that may have an exit.
    """
    used = 0
    while len(of):
        used += len(of)
        if used > _MOST:
            exits[of] = math.nan
            return
        open_, first, last = _unproven(quantity.margins(block.over(of, low, high)),
                                       quantity.tolerance)
        if not open_.any():
            return
        begun = of[open_ & (low == 0.0)]
        if len(begun) and used == len(open_):
            outside = quantity.values(block.at(begun, np.zeros(len(begun)))).min(
                axis=1) < -ROUNDING
            exits[begun[outside]] = 0.0
        middle, half = 0.5 * (low + high)[open_], 0.5 * (high - low)[open_]
        of, low, high = of[open_], middle + first[open_] * half, middle + last[open_] * half
        short = high - low <= np.maximum(narrow[of], _FAR * high)
        # the end of a short piece decides, and where a margin is negative the travel ends earlier
        at = np.where(short, high, 0.5 * (low + high))
        wrong = ~(quantity.values(block.at(of, at)).min(axis=1) >= -quantity.tolerance)
        sooner, begins = np.full(len(exits), math.inf), np.zeros(len(exits))
        for n in np.flatnonzero(wrong)[np.argsort(-at[wrong])]:
            sooner[of[n]], begins[of[n]] = at[n], low[n]
        if len(new := np.flatnonzero(sooner < exits)):
            exits[new] = _root(quantity, block, new, begins[new], sooner[new], narrow[new])
        ends = exits[of] - np.maximum(narrow[of], _FAR * exits[of])
        high = np.fmin(np.fmin(high, ends), block.needed(exits)[of])
        left = ~short & (low < high)
        of, low, high = of[left], low[left], high[left]
        # toward a new end pieces become shorter and shorter; Newton's method has halved others
        toward = np.isin(of, new) & (high >= ends[left])
        halved = ~toward & (high - low <= half[left])
        cuts = [np.stack([low, high], axis=1)[halved],
                low[toward, None] + (high - low)[toward, None] * _TOWARD,
                low[~toward & ~halved, None] + (high - low)[~toward & ~halved, None] * _HALVES]
        of = np.concatenate([np.repeat(each, cut.shape[1] - 1) for each, cut in zip(
            (of[halved], of[toward], of[~toward & ~halved]), cuts, strict=True)])
        low, high = (np.concatenate([cut[:, side].ravel() for cut in cuts]) for side in (
            slice(None, -1), slice(1, None)))


def _unproven(margins: Enclosure, tolerance: float) -> tuple[Flags, Array, Array]:
    """Return which pieces (N,) are not proven to be free, and the part of [-1, 1] that is not."""
    slope, least = margins.slopes[0], margins.center + tolerance - margins.rest
    open_ = ~(least > margins.spread)
    root = least / np.abs(slope)  # nothing is proven where it is not finite
    first = np.where(open_, np.where((slope < 0.0) & (root > -1.0), root, -1.0), 1.0).min(axis=1)
    last = np.where(open_, np.where((slope > 0.0) & (root > -1.0), -root, 1.0), -1.0).max(axis=1)
    return np.asarray(open_.any(axis=1)), first, last


def _root(quantity: Quantity, block: _Travels, which: Integers, low: Array, high: Array,
          narrow: Array) -> Array:
    """
    Return an end, near ``low`` to ``high``, of a part without negative margins.

    By inverse quadratic interpolation or bisection (Chandrupatla, 1997).
    """
    def worst(t: Array) -> Array:
        least: Array = quantity.values(block.at(which, t)).min(axis=1) + _EXACT
        return least

    low = np.maximum(low, 0.0)
    above, below = worst(low), worst(high)
    while (outside := (above < 0.0) & (low > 0.0)).any():
        low, high, below = (np.where(outside, np.maximum(16.0 * low - 15.0 * high, 0.0), low),
                            np.where(outside, low, high), np.where(outside, above, below))
        above = worst(low)
    a, b, c = np.stack([low, np.maximum(above, 0.0)]), np.stack([high, below]), np.stack(
        [high, below])
    part: Array = np.full(len(which), 0.5)
    for _ in range(_MOST_ROUNDS):
        t = a[0] + part * (b[0] - a[0])
        new = np.stack([t, worst(t)])
        same = (new[1] < 0.0) == (a[1] < 0.0)
        a, b, c = new, np.where(same, b, a), np.where(same, a, b)
        low = np.where(a[1] >= 0.0, a[0], b[0])
        finest = np.maximum(_FINE * narrow, _ULPS * np.maximum(a[0], b[0])) / np.abs(b[0] - a[0])
        if not (finest < 0.5).any():
            break
        xi, phi = (a - b) / (c - b)
        smooth = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
        part = np.where(smooth, a[1] / (b[1] - a[1]) * (c[1] / (b[1] - c[1])) + (
            (c[0] - a[0]) / (b[0] - a[0]) * (a[1] / (c[1] - a[1])) * (b[1] / (c[1] - b[1]))), 0.5)
        finest = np.minimum(finest, 0.5)
        part = np.clip(part, finest, 1.0 - finest)
    return low
