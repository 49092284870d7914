# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A motion that grows: the first factor at which a rate, force, speed or torque exceeds its limit.

The factors are sampled in equal steps. Between the first one at which a limit is exceeded and the
one before it, the root is found by bisection.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.capability.motions import Deviations, LARGEST
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.limits import FORCE_MAX, short_name, SPEED_MAX, VELOCITY_MAX
from stewart_dynamics.mechanics.rows import BASE, FORCES, RATES, WRENCH
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

STEPS = 64
"""
Steps in which factors are sampled: up to the end of the path; if it has none, up to 1, and from
then on up to twice the factor.
"""
_BLOCK = 256  # samples that are computed at once


class _State(NamedTuple):
    """Samples at factors (N, ...)."""

    rows: Array  # rows of motion
    results: Array  # rows of ``inverse_dynamics``
    ratios: Array  # to the limits (N, 6 M)


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

    def first_exit(self, most: float) -> tuple[float, int, int] | None:
        """
        Return the first factor up to ``most`` at which a ratio leaves [-1, 1].

        With its sample and column, or None.

        Raises MotionError: the ratios are not known from a factor on.
        """
        found, last = None, min(most, LARGEST)
        # With the samples that limit first, the others have a shorter way.
        early = np.argsort(-self._largest_ratios(min(last, 1.0)))
        for first in range(0, self._count, _BLOCK):
            low = 0.0
            while low < last:
                high = last if most < LARGEST else min(max(2.0 * low, 1.0), last)
                better = self._within(early[first:first + _BLOCK], low, high)
                if better is not None:
                    found, last = better, better[0]
                low = high
        return found

    def _largest_ratios(self, factor: float) -> Array:
        """Return the largest magnitude of each sample's ratios (N,); infinite where unknown."""
        found = np.empty(self._count)
        for first in range(0, self._count, _BLOCK):
            which = np.arange(first, min(first + _BLOCK, self._count))
            found[which] = self._largest(np.full(len(which), factor), which)
        return found

    def _largest(self, factors: Array, which: Integers) -> Array:
        ratios: Array = np.abs(self.state(factors, which).ratios).max(axis=1)
        ratios[np.isnan(ratios)] = np.inf
        return ratios

    def _within(self, which: Integers, low: float, high: float,
                ) -> tuple[float, int, int] | None:
        """Return the first exit of samples between two factors."""
        factors = np.linspace(low, high, STEPS + 1)
        exceeded = self._largest(np.repeat(factors, len(which)), np.tile(
            which, STEPS + 1)).reshape(STEPS + 1, -1) > 1.0
        first = np.where(exceeded.any(axis=0), exceeded.argmax(axis=0), STEPS + 1)
        earliest = int(first.min())
        if earliest > STEPS:
            return None
        which = which[first == earliest]
        lows: Array = np.full(len(which), factors[max(earliest - 1, 0)])
        highs: Array = np.full(len(which), factors[earliest])
        while True:
            near = lows <= highs.min()
            which, lows, highs = which[near], lows[near], highs[near]
            middles = 0.5 * (lows + highs)
            if not ((lows < middles) & (middles < highs)).any():
                break
            outside = self._largest(middles, which) > 1.0
            lows, highs = np.where(outside, lows, middles), np.where(outside, middles, highs)
        at = highs.argmin()
        ratios = np.abs(self.state(highs[at:at + 1], which[at:at + 1]).ratios)[0]
        if np.isnan(ratios).any():
            raise MotionError(
                f'motion: sample {which[at]}: not known whether a limit is exceeded at '
                f'{highs[at]:.9g} times its amplitude: too near to a singularity')
        return float(lows[at]), int(which[at]), int(ratios.argmax())

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
        ratios = [results[:, RATES if name == VELOCITY_MAX else FORCES] / bound
                  for name, bound in self._limits.items()]
        if self._motors is not None:
            ratios += self._motors.ratios(rows, results)
        return _State(rows, results, np.concatenate(ratios, axis=1))
