# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
The summary of a motion: loads on the legs, limits, and distance from singularities.

Samples are added block by block and are not kept. Apart from rounding, the result does not depend
on how they are split into blocks. ``bag_summary`` defines each number.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.dynamics.force_breakdown import sources_of
from stewart_dynamics.mechanics.limits import Exceedance, LIMITS, Limits, limits_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.bag_summary import (
    BagSummary, BaseWrench, Force, LegLoads, LOADS_OF_WRENCH, Moment, Setpoints, Singularity,
    SourceOfEffort)
from stewart_dynamics.replay.motor_loads import LoadsOfMotors
from stewart_dynamics.reporting.block_statistics import (
    Crossings, Exceeded, Extreme, finite, FIRST, Integral, longest_step, Warnings, with_nan)
from stewart_dynamics.setpoints.step import Batch, Outputs

_AT_REST = ('gravity', 'wrench', 'base motion')


class Answered(NamedTuple):
    """A block of N answered setpoints, for summary, report, output bag and table."""

    seconds: Array
    """(N,) since the first setpoint of the bag [s]; it does not advance where stamps jump back."""
    setpoints: Batch
    outputs: Outputs
    base_wrenches: Array  # wrench of the hexapod on its base (N, 6) [N, N m]; nan: not known
    powers: Array  # mechanical powers of the drives (N, 6) [W]
    breakdown: Array | None = None
    """The demanded efforts by source (N, 7, 6): sample, source, leg."""


def powers_of(platform: StewartPlatform, setpoints: Batch, outputs: Outputs) -> Array:
    """Return the mechanical powers of the drives (N, 6) [W]."""
    with np.errstate(over='ignore', invalid='ignore'):
        powers: Array = outputs.demanded_efforts * platform.drive_rates(
            setpoints.motions, outputs.rates)
    return powers


class Summary:
    """
    The summary of a motion of a hexapod with given parameters.

    parameters: names of the legs, limits, and ``setpoint.timeout``.
    quasi_static: only poses are known: values that depend on velocities are None, not zero.
    """

    def __init__(self, parameters: Parameters, quasi_static: bool = False) -> None:
        self._quasi_static = quasi_static
        self._legs = parameters.joints
        self._timeout = parameters.setpoint.timeout
        self._kind, self._names = parameters.leg_kind, limits_of(parameters)
        self._limits = Limits(parameters)
        self._exceeded = {
            name: Exceeded(LIMITS[name].measure) for name in self._limits.bounds
            if not (quasi_static and name in self._names.rates)}
        self._held: list[Answered] = []
        self._gap: float | None = None
        self._stamps: tuple[int, int] | None = None
        self._answered = self._restarts = self._gaps = self._unsolved = self._suppressed = 0
        self._without_force = self._base_unknown = 0
        self._base_unknown_at: float | None = None
        self._jumps = 0
        self._jumped_at: float | None = None
        self._seconds = self._gap_seconds = 0.0
        # of the quantity of each limit, the value nearest to it or farthest beyond it
        self._peaks = {name: Extreme(6, LIMITS[name].measure) for name in self._names.legs}
        self._published, self._power = Extreme(6, np.abs), Extreme(6, np.abs)
        # squares of the efforts; driving power; braking power
        self._means = Integral(18)
        self._nearest = Extreme(1, lambda det: -np.abs(det))
        self._condition = Extreme(1, np.positive)
        self._time_to_crossing = Extreme(1, np.negative)
        self._unit_load_force = Extreme(6, np.positive)
        self._crossings = Crossings()
        self._warnings = Warnings()
        self._base_wrench = _BaseWrench()
        self._motors = LoadsOfMotors(parameters, quasi_static) if parameters.drives else None
        self._sources = sources_of(parameters)
        # one source at a time: numpy is far slower along many columns at once
        self._source_peaks = [Extreme(6, np.abs) for _ in self._sources]
        self._source_squares = Integral(6 * len(self._sources))
        self._has_breakdown = False

    def add_block(self, block: Answered) -> None:
        """Add a block of samples."""
        if not len(block.seconds):
            return
        if self._gap is not None:
            self._add(block)
            return
        self._held.append(block)
        if sum(len(block.seconds) for block in self._held) >= FIRST:
            self._release()

    def _release(self) -> None:
        """Add the samples held back until the usual step is known."""
        if not self._held:
            return
        steps = np.diff(np.concatenate([block.seconds for block in self._held])[:FIRST])
        self._gap = longest_step(steps, self._timeout)
        held, self._held = self._held, []
        for block in held:
            self._add(block)

    def _add(self, block: Answered) -> None:
        seconds, setpoints, outputs, base_wrenches, power, breakdown = block
        steps = self._steps(seconds, setpoints)
        demanded = outputs.demanded_efforts
        without = with_nan(demanded)
        unknown = ~setpoints.base_known
        unsolved = without & ~(unknown & outputs.solvable)
        if unknown.any():
            self._base_unknown += int(unknown.sum())
            if self._base_unknown_at is None:
                self._base_unknown_at = float(seconds[unknown.argmax()])
        if outputs.jumped.any():
            self._jumps += int(outputs.jumped.sum())
            if self._jumped_at is None:
                self._jumped_at = float(seconds[outputs.jumped.argmax()])
        self._without_force += int(without.sum())
        self._unsolved += int(unsolved.sum())
        self._suppressed += int((with_nan(outputs.efforts) & ~without).sum())
        self._base_wrench.add(seconds, steps, base_wrenches)
        with np.errstate(over='ignore', invalid='ignore'):
            self._means.add(steps, np.concatenate(
                (demanded ** 2, np.maximum(power, 0.0), np.maximum(-power, 0.0)), axis=1))
        self._published.add(seconds, outputs.efforts)
        self._power.add(seconds, power)
        values = outputs.values()
        for name, peak in self._peaks.items():
            if name in values:
                peak.add(seconds, values[name])
        for name, exceeded in self._exceeded.items():
            exceeded.add(seconds, self._limits.exceeds(name, values[name]), values[name],
                         self._limits.bounds[name])
        if self._motors is not None:
            self._motors.add(seconds, steps, outputs.motors, outputs.rises)
        self._nearest.add(seconds, outputs.determinants[:, None])
        self._condition.add(seconds, outputs.conditions[:, None])
        self._time_to_crossing.add(seconds, outputs.times_to_crossing[:, None])
        self._unit_load_force.add(seconds, outputs.unit_load_forces)
        self._restarts += int(outputs.restarts.sum())
        self._crossings.add(seconds, outputs.determinants, outputs.restarts)
        self._warnings.add(seconds, steps, outputs.warnings)
        if breakdown is not None:
            self._has_breakdown = True
            for n, peaks in enumerate(self._source_peaks):
                peaks.add(seconds, breakdown[:, n])
            with np.errstate(over='ignore', invalid='ignore'):
                self._source_squares.add(steps, breakdown[:, :len(self._sources)].reshape(
                    len(seconds), -1) ** 2)

    def _steps(self, seconds: Array, setpoints: Batch) -> Array:
        """Return the time from each setpoint's predecessor to it, zero in a gap [s]."""
        assert self._gap is not None
        steps: Array = np.diff(seconds, prepend=self._seconds if self._stamps else seconds[0])
        gaps = steps > self._gap
        self._gaps += int(gaps.sum())
        self._gap_seconds += float(steps[gaps].sum())
        steps[gaps] = 0.0
        self._seconds = float(seconds[-1])
        self._answered += len(seconds)
        first = self._stamps[0] if self._stamps else int(setpoints.stamps[0])
        self._stamps = first, int(setpoints.stamps[-1])
        return steps

    def values(self) -> BagSummary:
        """Return the summary, with finite numbers; what depends on the bag has its default."""
        self._release()
        limits = [each for name, exceeded in self._exceeded.items()
                  for each in exceeded.of_legs(name, self._legs)]
        not_checked = [name for name in self._limits.bounds if name not in self._exceeded
                       or name in self._names.loads and self._without_force]
        motors = None
        if self._motors is not None:
            limits += self._motors.exceeded(self._legs)
            not_checked += self._motors.not_checked(self._without_force > 0)
            motors = self._motors.values(self._legs, self._restarts + 1)
        first, last = self._stamps or (None, None)
        return of_kind(BagSummary, self._kind)(
            quasi_static=self._quasi_static,
            setpoints=Setpoints(
                answered=self._answered, first_stamp_ns=first, last_stamp_ns=last,
                duration_s=self._seconds, gaps=self._gaps, gaps_s=self._gap_seconds,
                restarts=self._restarts, base_unknown=self._base_unknown,
                base_unknown_first_at_s=self._base_unknown_at, jumps=self._jumps,
                jumps_first_at_s=self._jumped_at),
            legs={name: self._leg(n) for n, name in enumerate(self._legs)}, motors=motors,
            limits=limits, limits_not_checked=not_checked, singularity=self._singularity(),
            force_breakdown=self._force_breakdown(), base_wrench=self._base_wrench.values(),
            limit_met=bool(limits or not_checked or self._jumps or self._warnings.count))

    def _leg(self, leg: int) -> LegLoads:
        squares, driving, braking = self._means.mean.reshape(3, 6)[:, leg]
        _, energy_driving, energy_braking = self._means.values.reshape(3, 6)[:, leg]
        solved = self._without_force < self._answered
        peaks, kind = self._peaks, self._kind
        lowest, highest = kind.position_limits
        margins = {name: None if bound is None else finite(
            0.0 - Exceedance(name, leg, peaks[name].values[leg], bound[leg]).excess)
            for name in peaks for bound in [self._limits.bounds.get(name)]}
        (rate, rate_at), (effort, effort_at), (power, power_at) = (
            each.of_column(leg) for each in (
                peaks[kind.rate_limit], peaks[kind.effort_limit], self._power))
        moving: dict[str, Any] = {
            'rate_peak': rate, 'rate_peak_at': rate_at, 'rate_margin': margins[kind.rate_limit],
            'power_peak_w': power, 'power_peak_at_s': power_at,
            'power_mean_w': finite(driving - braking),
            'energy_driving_j': finite(energy_driving) if solved else None,
            'energy_braking_j': finite(energy_braking) if solved else None}
        if self._quasi_static:
            moving = dict.fromkeys(moving)
        others: dict[str, Any] = {}
        for name, peak in peaks.items():
            if name not in self._names.usual:
                keys = LegLoads.keys_of_limit(name)
                others |= dict(zip(keys, (*peak.of_column(leg), margins[name]), strict=True))
        return of_kind(LegLoads, kind)(
            position_min=finite(peaks[lowest].values[leg]),
            position_max=finite(peaks[highest].values[leg]),
            position_margin=min((each for each in (margins[lowest], margins[highest])
                                 if each is not None), default=None),
            effort_peak=effort, effort_peak_at=effort_at, effort_rms=finite(math.sqrt(squares)),
            effort_published_peak=finite(self._published.values[leg]),
            effort_margin=margins[kind.effort_limit], **moving, **others)

    def _singularity(self) -> Singularity:
        # the leg with the largest force under a unit load
        most = np.where(np.isnan(self._unit_load_force.values), -np.inf,
                        self._unit_load_force.values)
        leg = int(most.argmax())
        nearest, condition = self._nearest.of_column(), self._condition.of_column()
        crossing = (None, None) if self._quasi_static else self._time_to_crossing.of_column()
        return Singularity(
            determinant_nearest_m3=nearest[0], determinant_nearest_at_s=nearest[1],
            crossings=self._crossings.count, crossings_at_s=list(self._crossings.first),
            condition_max=condition[0], condition_max_at_s=condition[1],
            unsolved=self._unsolved, suppressed=self._suppressed,
            time_to_crossing_min_s=crossing[0], time_to_crossing_min_at_s=crossing[1],
            unit_load_force_max=finite(most[leg]),
            unit_load_force_leg=self._legs[leg] if most[leg] > -np.inf else None,
            warnings=self._warnings.count,
            warnings_from_to_s=list(self._warnings.first),
            warning_s=self._warnings.seconds)

    def _force_breakdown(self) -> dict[str, dict[str, SourceOfEffort]] | None:
        if not self._has_breakdown:
            return None
        rms = np.sqrt(self._source_squares.mean).reshape(-1, 6)
        part = of_kind(SourceOfEffort, self._kind)
        return {name: {
            source: part(peak=None, rms=None) if self._quasi_static and source not in _AT_REST
            else part(peak=finite(self._source_peaks[n].values[leg]), rms=finite(rms[n, leg]))
            for n, source in enumerate(self._sources)} for leg, name in enumerate(self._legs)}


_COLUMNS = 8  # magnitudes of force and moment, and the components


class _BaseWrench:
    """Peaks, RMS and means of the base wrench, block by block."""

    def __init__(self) -> None:
        self._peaks = Extreme(_COLUMNS, np.abs)
        self._squares_and_sizes = Integral(2 * _COLUMNS)

    def add(self, seconds: Array, steps: Array, wrenches: Array) -> None:
        """Add times (N,), the time to each from the one before [s], and wrenches (N, 6)."""
        squares = np.empty((len(seconds), _COLUMNS))
        with np.errstate(over='ignore'):
            np.square(wrenches, out=squares[:, 2:])
            squares[:, 0] = squares[:, 2] + squares[:, 3] + squares[:, 4]
            squares[:, 1] = squares[:, 5] + squares[:, 6] + squares[:, 7]
        values = np.concatenate((np.sqrt(squares[:, :2]), wrenches), axis=1)
        self._peaks.add(seconds, values)
        self._squares_and_sizes.add(steps, np.concatenate((squares, values), axis=1))

    def values(self) -> BaseWrench:
        """Return the loads of the base."""
        squares, means = self._squares_and_sizes.mean.reshape(2, _COLUMNS)
        columns = zip(np.sqrt(squares), means, self._peaks.values, self._peaks.at, strict=True)
        loads = (tuple(map(finite, each)) for each in columns)
        kinds: tuple[Callable[..., Any], ...] = (Force, Moment, *LOADS_OF_WRENCH)
        return BaseWrench(*(kind(*each) for kind, each in zip(kinds, loads, strict=True)))
