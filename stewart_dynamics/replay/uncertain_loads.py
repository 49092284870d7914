# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Loads of a motion on the hexapods that a parameter file admits: ``stewart_replay --uncertainty``.

Each of N hexapods, drawn by ``uncertainty.*``, follows the whole motion. For each leg the peaks of
their efforts have a band, and so has the effort at each setpoint; each limit of loads has the
number of hexapods that exceed it anywhere. Setpoints without efforts are left out.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import CODES, LIMIT_ROWS
from stewart_dynamics.gpu.hexapods import Hexapods
from stewart_dynamics.mechanics.limits import (
    limit_bounds, LIMITS, Limits, OF_MOTORS, TEMPERATURE_RISE_MAX, TORQUE_SPEED)
from stewart_dynamics.parameters.structure import limit_name
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.bag_summary import UncertainLeg, UncertainLimit, Uncertainty
from stewart_dynamics.replay.summary import Answered
from stewart_dynamics.reporting.block_statistics import finite

SEED = 0
BAND = 2.5, 50.0, 97.5
"""Percentiles of a band and of its middle: 95 % of the hexapods are within."""
_NUMBERS = 2 ** 22  # of results at once


class UncertainLoads:
    """Peaks and limits of ``count`` hexapods, block by block."""

    def __init__(self, parameters: Parameters, count: int) -> None:
        self._parameters, self._count = parameters, count
        self._hexapods = Hexapods(parameters, count, uncertainty=SEED)
        self._limits = Limits(parameters)
        self._peaks = np.zeros((count, 6))
        self._known = False
        self._exceeding = {
            name: np.zeros(count, dtype=bool) for name in (*self._limits.of_loads, *(
                name for name in OF_MOTORS if parameters.drives
                and name != TEMPERATURE_RISE_MAX
                and (name in limit_bounds(parameters) or name in parameters.given)))}
        self._bits = {limit_name(row): row.bit for row in LIMIT_ROWS} | {
            TORQUE_SPEED: CODES['STEWART_TORQUE_SPEED']}

    def add(self, block: Answered) -> Array:
        """Add setpoints; return the lower and the upper efforts of the band (N, 12)."""
        setpoints, samples = block.setpoints, len(block.seconds)
        bands = np.full((samples, 12), np.nan)
        solved = np.flatnonzero(np.isfinite(block.outputs.demanded_efforts).all(axis=1))
        size = max(1, _NUMBERS // (64 * self._count))
        for begin in range(0, len(solved), size):
            of = solved[begin:begin + size]
            bands[of] = self._add(*(
                None if rows is None else np.broadcast_to(rows, (samples, rows.shape[-1]))[of]
                for rows in (setpoints.motions, setpoints.wrenches, setpoints.bases)))
        return bands

    def _add(self, *rows: Array | None) -> Array:
        """Add motions (N, 24), wrenches (N, 6) and bases (N, 12); return bands (N, 12)."""
        hexapods, kind = self._hexapods, self._parameters.leg_kind
        given = [None if each is None else hexapods.xp.asarray(each[:, None].copy())
                 for each in rows]
        found = hexapods.to_host(hexapods.inverse_dynamics(
            *given, condition=False, singular='nan').rows)
        efforts = found[..., kind.effort.columns]
        with np.errstate(invalid='ignore'):
            self._peaks = np.fmax(self._peaks, np.abs(efforts).max(axis=0))
            for name in self._limits.of_loads:
                self._exceeding[name] |= self._limits.exceeds(
                    name, found[..., LIMITS[name].columns]).any(axis=(0, 2))
        of_motors = [name for name in self._exceeding if name in OF_MOTORS]
        if of_motors:
            bits = hexapods.to_host(hexapods.limits(*given))
            for name in of_motors:
                self._exceeding[name] |= ((bits > 0) & (bits & self._bits[name] != 0)).any(
                    axis=(0, 2))
        self._known = True
        low, _, high = np.nanpercentile(efforts, BAND, axis=1)
        return np.concatenate([low, high], axis=1)

    def values(self) -> Uncertainty:
        """Return percentiles of the peaks, and the shares of the hexapods that exceed limits."""
        parameters = self._parameters
        bound = self._limits.bounds.get(parameters.leg_kind.effort_limit)
        legs = {}
        for leg, name in enumerate(parameters.joints):
            low, middle, high = (finite(each) if self._known else None
                                 for each in np.percentile(self._peaks[:, leg], BAND))
            legs[name] = of_kind(UncertainLeg, parameters.leg_kind)(
                effort_peak_low=low, effort_peak_median=middle, effort_peak_high=high,
                effort_margin_low=None if bound is None or high is None else finite(
                    bound[leg] - high))
        return of_kind(Uncertainty, parameters.leg_kind)(
            hexapods=self._count, legs=legs,
            limits=[UncertainLimit(name, int(each.sum()), float(each.mean()))
                    for name, each in self._exceeding.items()])
