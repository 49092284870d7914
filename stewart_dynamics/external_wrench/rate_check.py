# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The possible error in measured velocities: they are not the derivatives of the measured positions.

Poses and twists follow from them, and are compared as those of setpoints are (``Consistency``).
The legs and the reason are then found in the last measurements.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND
from stewart_dynamics.external_wrench.estimate import Estimate, Measurement
from stewart_dynamics.mechanics.drives.measured_efforts import RATE
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.possible_errors.hypothesis import PossibleError
from stewart_dynamics.possible_errors.transforms import best_order
from stewart_dynamics.setpoints.consistency import Consistency
from stewart_dynamics.setpoints.inconsistency_causes import reason_of, Sums, VELOCITY

# Measurements in which legs and reason are found, and the length of windows in them [s].
_RECENT, _WINDOW = 2000, 0.05
# A leg is wrong, and a reason explains it, from this part of the motion (squared).
_WRONG, _EXPLAINED = 0.02, 0.05


class RateCheck:
    """The check of a stream of measurements."""

    def __init__(self, parameters: Parameters) -> None:
        self._joints, self._unit = parameters.joints, parameters.leg_kind.rate.unit
        self._consistency = Consistency(parameters.singularity.characteristic_length, None)
        self._recent: deque[Measurement] = deque(maxlen=_RECENT)
        self.possible_error: PossibleError | None = None
        """The possible error; None without one."""

    def add(self, measurement: Measurement, estimate: Estimate) -> None:
        """Add a measurement, and the estimate from it; one without a wrench is a restart."""
        restart = estimate.wrench is None
        if restart:
            self._recent.clear()
        self._recent.append(measurement)
        self._consistency.noted.append((estimate.stamp, estimate.motion, restart))
        self._consistency.check_samples()
        found = self._consistency.present
        if not found:
            self.possible_error = None
        elif self.possible_error is None:
            reasons = [each.reason for each in found.values()]
            late = next((each for each in reasons if each.endswith(('late?', 'early?'))), '')
            self.possible_error = PossibleError(RATE, _words(
                list(self._recent), self._joints, late, self._unit))


def _words(recent: Sequence[Measurement], joints: Sequence[str], late: str, unit: str,
           ) -> str:
    """Return the legs whose velocities are wrong, by how much, and the reason."""
    times = np.array([each.stamp for each in recent]) * NANOSECOND
    positions, rates = (
        np.array(each) for each in zip(*(each[1:3] for each in recent), strict=True))
    steps = np.diff(times)
    integrals = np.vstack([np.zeros((1, 6)), np.cumsum(
        0.5 * steps[:, None] * (rates[1:] + rates[:-1]), axis=0)])
    ends = slice(None, None, max(1, round(_WINDOW / float(np.median(steps)))))
    seconds, expected, given = (np.diff(each[ends], axis=0) for each in (
        times[:, None], positions, integrals))
    off, moved, all_given = (np.sum(each ** 2, axis=0) for each in (
        given - expected, expected, given))
    wrong: Flags = off > _WRONG * np.maximum(moved, all_given)
    if not wrong.any():
        wrong[:] = True
    of = '' if wrong.all() else ', '.join(
        name for name, is_wrong in zip(joints, wrong, strict=True) if is_wrong) + ': '
    by_rates, by_positions = (
        float(np.sqrt(each[wrong].mean() / np.sum(seconds ** 2))) for each in (all_given, moved))
    sums = Sums(0)
    sums.periods, sums.step = 1, float(np.mean(steps))
    sums.squares = np.array([each[wrong].sum() for each in (moved, all_given, off)])
    sums.product = float(np.sum((expected * given)[:, wrong]))
    reason = reason_of(VELOCITY, sums, None)
    if not reason and (order := _order(expected, given)):
        reason = f'in another order, {", ".join(joints[n] for n in order)}?'
    reason = reason or late
    return (f'velocity is not the derivative of position: {of}{by_rates:.3g} {unit} RMS, by the '
            f'positions {by_positions:.3g} {unit}' + (f': {reason}' if reason else ''))


def _order(expected: Array, given: Array) -> Sequence[int]:
    """Return the legs of which the velocities are, if they are in another order."""
    order, left = best_order(np.sum((given[:, :, None] - expected[:, None, :]) ** 2, axis=0))
    explained = left < _EXPLAINED * np.sum(expected ** 2)
    return order if explained and order != [*range(6)] else []
