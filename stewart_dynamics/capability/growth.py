# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A motion that grows: the first factor at which a rate, force, speed or torque exceeds its limit.

Between two factors these quantities are bounded by their values at both and by ``GrowthBounds``.
Coulomb friction is a function of the rate, whose bounds give its bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.capability.growth_bounds import GrowthBounds
from stewart_dynamics.capability.motions import Deviations, LARGEST
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.limits import FORCE_MAX, short_name, SPEED_MAX, VELOCITY_MAX
from stewart_dynamics.mechanics.rows import BASE, FORCES, RATES, UNIT_LOAD_FORCES, WRENCH
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# A limit that is exceeded by no more than this part of it may be passed.
_SHALLOW = 1e-10
# Ratio to a limit from which it counts as reached where nothing is proven any more.
_REACHED = 1.0 - 1e-9
MOST_INTERVALS = 1_000_000
"""Largest number of intervals in which a block of samples is proven to exceed no limit."""
# Samples of a block: their arrays stay in the processor's cache.
_BLOCK = 1024


class _State(NamedTuple):
    """Samples at factors (N, ...)."""

    rows: Array  # rows of motion
    results: Array  # rows of ``inverse_dynamics``
    ratios: Array  # to the limits (N, 6 M)
    smooth: Array
    """
    Quantities without Coulomb friction (N, Q, 6).

    Rates and forces; with motors speeds, loads of the screws, torques with both their factors.
    """


class Growth:
    """
    Ratios of a motion's samples to limits, (N, 6 M): six legs for each of ``names``.

    limits: limits that are set, by name.
    wrench (6,) or (N, 6): external wrench.
    base () or (N,): motion of the base.
    """

    def __init__(self, platform: StewartPlatform, limits: Mapping[str, Array],
                 motors: MotorBounds | None, deviations: Deviations,
                 wrench: ArrayLike | None = None, base: BaseMotion | None = None) -> None:
        self._platform, self._motors, self._deviations = platform, motors, deviations
        self._limits = {name: limits[name] for name in (VELOCITY_MAX, FORCE_MAX) if name in limits}
        self.names = [short_name(name) for name in self._limits] + (
            [] if motors is None else [short_name(SPEED_MAX), 'torque'])
        self._count = len(deviations.changes)
        p = platform.parameters
        self._wrench = np.broadcast_to(
            np.asarray(0.0 if wrench is None else wrench, dtype=float), (self._count, WRENCH))
        self._base = np.broadcast_to(
            (BaseMotion(p['gravity']) if base is None else base).rows, (self._count, BASE))
        self._bounds = GrowthBounds(p, motors, platform.screws)

    def first_exit(self, most: float) -> tuple[float, int, int] | None:
        """
        Return the first factor up to ``most`` at which a ratio leaves [-1, 1].

        With its sample and column, or None.

        Raises MotionError: the intervals in which that is proven are too many or too narrow.
        """
        found, last = None, min(most, LARGEST)
        # With the samples that limit first, the others need few intervals.
        early = np.argsort(-self._largest_ratios(min(last, 1.0)))
        for first in range(0, self._count, _BLOCK):
            which = early[first:first + _BLOCK]
            low = 0.0
            while low < last:
                high = last if most < LARGEST else min(max(2.0 * low, 1.0), last)
                better = self._within(which, low, high)
                if better is not None:
                    found, last = better, better[0]
                low = high
            if last == 0.0:
                break
        return found

    def _largest_ratios(self, factor: float) -> Array:
        """Return the largest magnitude of each sample's ratios (N,); infinite where unknown."""
        found = np.empty(self._count)
        for first in range(0, self._count, _BLOCK):
            which = np.arange(first, min(first + _BLOCK, self._count))
            found[which] = np.abs(self.state(np.full(len(which), factor), which).ratios).max(
                axis=1)
        return np.nan_to_num(found, nan=np.inf)

    def _within(self, which: Integers, low: float, high: float,
                ) -> tuple[float, int, int] | None:
        """Return the first exit of samples between two factors."""
        lows: Array = np.full(len(which), low)
        highs: Array = np.full(len(which), high)
        begins, ends = self.state(lows, which), self.state(highs, which)
        if _exceed(begins).any():
            return low, *_largest(begins.ratios, which)
        begin, end = begins.smooth, ends.smooth
        exceeded = _exceed(ends)
        first, used = math.inf, 0  # no later than this
        while len(which):
            first = min(first, highs[exceeded].min(initial=math.inf))
            middles = 0.5 * (lows + highs)
            state = self.state(middles, which)
            open_: Flags = exceeded | ~self._proven(state, begin, end, highs - lows, which)
            open_ &= lows < first
            used += len(which)
            if not open_.any():
                return None
            lows, middles, highs = lows[open_], middles[open_], highs[open_]
            which, exceeded = which[open_], exceeded[open_]
            begin, middle, end = begin[open_], state.smooth[open_], end[open_]
            at = int(lows.argmin())
            if not lows[at] < middles[at] < highs[at]:
                ratios = self.state(highs[at:at + 1], which[at:at + 1]).ratios
                if not (exceeded[at] or np.abs(ratios).max() >= _REACHED):
                    raise MotionError(
                        f'motion: sample {which[at]}: not known whether a limit is exceeded at '
                        f'{highs[at]:.9g} times its amplitude: too near to a singularity')
                return float(lows[at]), *_largest(ratios, which[at:at + 1])
            if used > MOST_INTERVALS:
                raise MotionError(
                    f'motion: sample {which[at]}: not known whether a limit is exceeded beyond '
                    f'{lows[at]:.9g} times its amplitude after {MOST_INTERVALS} intervals')
            wide = (lows < middles) & (middles < highs)
            at_middle = _exceed(state)[open_]
            lows, highs = np.concatenate([lows, middles[wide]]), np.concatenate(
                [np.where(wide, middles, highs), highs[wide]])
            which = np.concatenate([which, which[wide]])
            exceeded = np.concatenate([np.where(wide, at_middle, exceeded), exceeded[wide]])
            begin, end = np.concatenate([begin, middle[wide]]), np.concatenate(
                [np.where(wide[:, None, None], middle, end), end[wide]])
        return None

    def limit(self, factor: float, sample: int, column: int) -> str:
        """Return the name of the limit of a column of the ratios."""
        name = self.names[column // 6]
        if name == 'torque' and self._motors is not None:
            state = self.state(np.array([factor]), np.array([sample]))
            name = str(self._motors.torque_limit(state.rows, state.results)[0, column % 6])
        return name

    def state(self, factors: Array, which: Integers) -> _State:
        """Return samples at factors, both (N,)."""
        rows = self._deviations.at(factors, which)
        results = self._platform.inverse_dynamics(
            Motion.of_rows(rows), self._wrench[which], BaseMotion.of_rows(self._base[which]),
            singular='nan').rows
        p = self._platform.parameters
        rates, forces = results[:, RATES], results[:, FORCES]
        ratios = [results[:, RATES if name == VELOCITY_MAX else FORCES] / bound
                  for name, bound in self._limits.items()]
        smooth = [rates, forces - p['actuator.coulomb_friction'] * np.clip(
            self._platform.drive_rates(rows, rates) / p['actuator.coulomb_velocity'],
            -1.0, 1.0)]
        if self._motors is not None:
            ratios += self._motors.ratios(rows, results)
            motors = self._motors.moving(rows, results)
            load = smooth[1] - motors.inertial
            smooth += [motors.speeds, load, *(
                motors.own + scale * load for scale in self._motors.scales)]
        return _State(rows, results, np.concatenate(ratios, axis=1), np.stack(smooth, axis=1))

    def _proven(self, middle: _State, begin: Array, end: Array, widths: Array, which: Integers,
                ) -> Flags:
        """Return for which samples no limit is exceeded between two factors (N,)."""
        bounds = self.bounds(middle, begin, end, widths, which, False)
        proven: Flags = np.asarray((bounds <= 1.0).all(axis=1))
        left = ~proven
        bounds = self.bounds(_State(*(each[left] for each in middle)), begin[left], end[left],
                             widths[left], which[left], True)
        proven[left] = (bounds <= 1.0 + _SHALLOW).all(axis=1)
        return proven

    def bounds(self, middle: _State, begin: Array, end: Array, widths: Array, which: Integers,
               chord: bool) -> Array:
        """
        Return bounds of the ratios' magnitudes (N, 6 M) between two factors.

        begin, end (N, Q, 6): smooth quantities at both ends.
        widths, which (N,): widths of the intervals, and samples.
        chord: bounds follow from the chord between the ends instead of from the middle.
        """
        p = self._platform.parameters
        off = self._bounds(
            middle.rows, middle.smooth[:, 1], middle.results[:, UNIT_LOAD_FORCES],
            self._deviations.changes[which], self._base[which], widths, chord)
        if chord:  # a parabola whose middle is as far from the chord has this extreme
            bow, rise = 4.0 * off, np.abs(end - begin)
            with np.errstate(all='ignore'):
                off = np.where(rise < bow, 0.25 * (bow - rise) * (1.0 - rise / bow), 0.0)
            low, high = np.minimum(begin, end) - off, np.maximum(begin, end) + off
        else:
            low, high = middle.smooth - off, middle.smooth + off
        low, high = (np.moveaxis(each, 1, 0) for each in (low, high))
        rates = low[0], high[0]  # of the drives
        if self._motors is not None and self._platform.screws.any():
            rates = low[2] / self._motors.ratio, high[2] / self._motors.ratio
        friction = tuple(p['actuator.coulomb_friction'] * np.clip(
            each / p['actuator.coulomb_velocity'], -1.0, 1.0) for each in rates)
        found = [np.maximum(-low[0], high[0]) / bound if name == VELOCITY_MAX else
                 np.maximum(-low[1] - friction[0], high[1] + friction[1]) / bound
                 for name, bound in self._limits.items()]
        if self._motors is not None:
            found += self._motors.between(
                low, high, rates, friction, p['actuator.coulomb_velocity'])
        return np.concatenate(found, axis=1)


def _exceed(state: _State) -> Flags:
    """Return which samples exceed a limit (N,)."""
    exceeded: Flags = np.asarray((np.abs(state.ratios) > 1.0).any(axis=1))
    return exceeded


def _largest(ratios: Array, which: Integers) -> tuple[int, int]:
    sample, column = divmod(int(np.nan_to_num(np.abs(ratios)).argmax()), ratios.shape[1])
    return int(which[sample]), column
