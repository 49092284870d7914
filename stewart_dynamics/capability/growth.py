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
from stewart_dynamics.mechanics.limits import LIMITS, limits_of, short_name, SPEED_MAX
from stewart_dynamics.mechanics.rows import BASE, WRENCH
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

STEPS = 64
"""
Steps in which factors are sampled: up to the end of the path; if it has none, up to 1, and from
then on up to twice the factor.
"""
_BLOCK, _AT_ONCE = 256, 13  # samples and factors that are computed at once


class _State(NamedTuple):
    """Samples at factors (N, ...)."""

    rows: Array  # rows of motion
    results: Array  # rows of ``inverse_dynamics``
    ratios: Array  # to the limits (N, 6 M)


class Exit(NamedTuple):
    """The exit of a sample: one of its ratios leaves [-1, 1] just above a factor."""

    factor: float
    sample: int
    column: int  # of the ratios


class _Brackets(NamedTuple):
    """Samples (N,), all of whose ratios are within [-1, 1] at one factor and not at another."""

    samples: Integers
    within: Array
    outside: Array

    def earliest(self) -> _Brackets:
        """Return those whose exit may be the first one."""
        near = self.within <= self.outside.min()
        return _Brackets(self.samples[near], self.within[near], self.outside[near])


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
        known = limits_of(platform.parameters)
        self._limits = {name: limits[name] for name in (*known.rates, *known.loads)
                        if name in limits}
        self.names = [short_name(name) for name in self._limits] + (
            [] if motors is None else [short_name(SPEED_MAX), 'torque'])
        self._count = len(deviations.changes)
        p = platform.parameters
        self._wrench = np.broadcast_to(
            np.asarray(0.0 if wrench is None else wrench, dtype=float), (self._count, WRENCH))
        self._base = np.broadcast_to(
            (BaseMotion(p.gravity) if base is None else base).rows, (self._count, BASE))

    def first_exit(self, most: float) -> Exit | None:
        """
        Return the first exit of all samples up to the factor ``most``, or None.

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
                    found, last = better, better.factor
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

    def _within(self, which: Integers, low: float, high: float) -> Exit | None:
        """Return the first exit of samples between two factors."""
        brackets = self._sampled(which, np.linspace(low, high, STEPS + 1, dtype=np.float64))
        if brackets is None:
            return None
        while True:
            brackets = brackets.earliest()
            halves = self._halved(brackets)
            if halves is None:
                return self._exit(brackets)
            brackets = halves

    def _sampled(self, which: Integers, factors: Array) -> _Brackets | None:
        """Return the samples that exceed a limit at the earliest of the factors (F,), or None."""
        for first in range(0, len(factors), _AT_ONCE):
            some = factors[first:first + _AT_ONCE]
            exceeded = self._largest(np.repeat(some, len(which)), np.tile(
                which, len(some))).reshape(len(some), -1) > 1.0
            at = int(exceeded.any(axis=1).argmax())
            if exceeded[at].any():
                samples = which[exceeded[at]]
                return _Brackets(samples, np.full(len(samples), factors[max(first + at - 1, 0)]),
                                 np.full(len(samples), some[at]))
        return None

    def _halved(self, brackets: _Brackets) -> _Brackets | None:
        """Return the halves with the exits; None if no number lies between the factors."""
        samples, within, outside = brackets
        middles = 0.5 * (within + outside)
        if not ((within < middles) & (middles < outside)).any():
            return None
        exceeded = self._largest(middles, samples) > 1.0
        return _Brackets(samples, np.where(exceeded, within, middles),
                         np.where(exceeded, middles, outside))

    def _exit(self, brackets: _Brackets) -> Exit:
        """Return the first exit; its column has the largest ratio outside."""
        first = int(brackets.outside.argmin())
        only = slice(first, first + 1)
        ratios = np.abs(self.state(brackets.outside[only], brackets.samples[only]).ratios)[0]
        if np.isnan(ratios).any():
            raise MotionError(
                f'motion: sample {brackets.samples[first]}: not known whether a limit is exceeded '
                f'at {brackets.outside[first]:.9g} times its amplitude: too near to a singularity')
        return Exit(float(brackets.within[first]), int(brackets.samples[first]),
                    int(ratios.argmax()))

    def limit(self, found: Exit) -> str:
        """Return the name of the limit at an exit."""
        name = self.names[found.column // 6]
        if name == 'torque' and self._motors is not None:
            state = self.state(np.array([found.factor]), np.array([found.sample]))
            name = str(self._motors.torque_limit(
                state.rows, state.results)[0, found.column % 6])
        return name

    def state(self, factors: Array, which: Integers) -> _State:
        """Return samples at factors, both (N,)."""
        rows = self._deviations.at(factors, which)
        results = self._platform.inverse_dynamics(
            Motion.of_rows(rows), self._wrench[which], BaseMotion.of_rows(self._base[which]),
            singular='nan').rows
        ratios = [results[:, LIMITS[name].columns] / bound
                  for name, bound in self._limits.items()]
        if self._motors is not None:
            ratios += self._motors.ratios(rows, results)
        return _State(rows, results, np.concatenate(ratios, axis=1))
