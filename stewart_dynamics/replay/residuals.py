# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Residuals: measured minus computed leg forces.

Measured efforts are interpolated linearly in time onto the setpoints' stamps, between samples at
most ``setpoint.timeout`` apart, and compared with the demanded forces: residual = measured -
computed. The external wrench that accounts for it is

    w_ext = J_inv^T (f_computed - f_measured)

with the sign of ``~/wrench``: the external load on the platform at its origin, base axes (see
``external_wrench.estimate``). A platform heavier than in its parameters gives a force downward.

``Comparison.values()`` is the part ``measured`` of summary.json.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from msgspec.structs import replace
import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps
from stewart_dynamics.external_wrench.estimate import external_wrenches
from stewart_dynamics.mechanics.drives.measured_efforts import (
    EffortSums, has_losses, leaves_wrench, without_losses)
from stewart_dynamics.mechanics.drives.motors import motor_ratio, Motors
from stewart_dynamics.mechanics.least_squares import BY_MEDIAN
from stewart_dynamics.mechanics.rows import POSE
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.joint_state import JointStateReader, MISSING_JOINTS, NUMBERS_END
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.records import of_kind
from stewart_dynamics.replay.bag_summary import (
    Contact, Contacts, EffortsMistake, ExternalWrench, LOADS_OF_WRENCH, Measured, MeasuredLeg,
    NotCompared)
from stewart_dynamics.replay.summary_text import measured_headline
from stewart_dynamics.replay.time_matching import interpolated, Waiting
from stewart_dynamics.reporting.block_statistics import Extreme
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.rejections import OUT_OF_RANGE
from stewart_dynamics.setpoints.step import Batch, Outputs


# Messages without all joints from which on it is an error.
_PATIENCE = 1000


class Efforts:
    """Reads measured efforts from JointState messages, which may contain other joints, too."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._reader = JointStateReader(joints, ['effort'])
        self._lacked = 0

    def read_efforts(self, messages: Messages) -> tuple[Stamps, Array, dict[str, int]]:
        """
        Return stamps (K,) [ns], efforts (K, 6) [N], and the number of rejected messages by reason.

        Messages without all joints may come from another publisher, and are rejected. Raises
        BagError if a thousand were rejected and none had all joints.
        """
        stamps, efforts, _, rejected, _ = self._reader.read_states(messages)
        in_range = (np.abs(efforts) < NUMBERS_END).all(axis=1)
        if not in_range.all():
            rejected[OUT_OF_RANGE] = int(np.count_nonzero(~in_range))
            stamps, efforts = stamps[in_range], efforts[in_range]
        self._lacked += rejected.get(MISSING_JOINTS, 0)
        if self._lacked >= _PATIENCE:
            self.check()
        return stamps, efforts, rejected

    def check(self) -> None:
        """Raise BagError if messages lacked a joint, and none had all joints."""
        self._reader.check('measured joint states')


# The most setpoints and measured samples that wait to be matched.
_SETPOINTS_WAITING = 2 ** 15
_SAMPLES_WAITING = 2 ** 18

AXES = ExternalWrench.__struct_fields__

# Columns of the rows kept of setpoints.
_SECONDS, _POSE, _FORCES, _RATES, _ACCELERATIONS = (
    0, slice(1, 13), slice(13, 19), slice(19, 25), slice(25, 31))


class Compared(NamedTuple):
    """K setpoints that were compared."""

    seconds: Array  # (K,)
    measured: Array  # (K, 6) [N]
    computed: Array  # (K, 6) [N]
    wrench: Array  # external wrench (K, 6) [N, N m]


class Comparison:
    """
    Compares measured forces with the computed ones, in bounded memory.

    Setpoints and measured samples may be added in any order. A setpoint waits for a measured
    sample with a later stamp; when 32768 wait, the oldest are dropped as not compared. When
    time jumps back by more than ``setpoint.timeout``, as in a bag that loops, another pass
    begins; setpoints of a pass are compared with the measured samples of the pass of the same
    number. A single stamp that is late or in the future begins no pass and is left out.
    """

    def __init__(self, parameters: Parameters, of_motors: bool = False) -> None:
        self._parameters = parameters
        self._losses = of_motors and has_losses(parameters)
        self._ratio = motor_ratio(parameters)
        self._platform = StewartPlatform(parameters)
        gap = parameters.setpoint.timeout
        self._gap = round(gap * SECOND)
        self._setpoints = Waiting(self._gap, _SETPOINTS_WAITING)
        self._samples = Waiting(self._gap, _SAMPLES_WAITING)
        self._without_force = 0
        self.too_large = 0
        """Setpoints that are not compared: computed efforts of NUMBERS_END or more."""
        self._legs = _Statistics()
        self._sums = EffortSums(parameters, of_motors)
        self._wrench = _Statistics()
        self._bins = WrenchBins()
        self.stamps = ArrivalStamps()
        """The check of the stamps of the measured efforts."""

    def add_setpoints(self, seconds: Array, setpoints: Batch, outputs: Outputs) -> Compared:
        """Add setpoints, see Summary.add; return the compared setpoints."""
        columns = [seconds, setpoints.motions[:, POSE], outputs.demanded_efforts]
        if self._losses:
            motors = Motors.of_rows(outputs.motors)
            columns += [motors.speeds / self._ratio, motors.accelerations / self._ratio]
        self._setpoints.add(setpoints.stamps, np.column_stack(columns))
        return self._compared()

    def add_measured(self, stamps: Stamps, efforts: Array) -> Compared:
        """Add finite forces (M, 6) [N] at stamps (M,) [ns]; return the compared setpoints."""
        self.stamps.add_readings(stamps, efforts)
        self._samples.add(stamps, efforts)
        return self._compared()

    def finish(self) -> Compared:
        """Return the remaining compared setpoints, after the last call of the others."""
        self._setpoints.confirm()
        self._samples.confirm()
        return self._compared()

    def _compared(self) -> Compared:
        setpoints = self._setpoints.take_before(self._samples.pass_number, self._samples.newest)
        rows = setpoints.rows
        if not len(rows):
            six = np.empty((0, 6))
            return Compared(np.empty(0), six, six, six)
        samples = self._samples.rows
        measured: Array = np.full((len(rows), 6), np.nan)
        for number in np.unique(setpoints.passes):
            mine, same = setpoints.passes == number, samples.passes == number
            measured[mine] = interpolated(
                setpoints.stamps[mine], samples.stamps[same], samples.rows[same], self._gap)
        self._samples.forget_before(*self._setpoints.oldest())
        there = np.isfinite(measured[:, 0])
        # also without nan; squares of larger ones overflow, as those of measured efforts would
        known = there & (np.abs(rows[:, _FORCES]) < NUMBERS_END).all(axis=1)
        self._without_force += int(np.count_nonzero(there & ~known))
        self.too_large += int(np.count_nonzero(
            there & (np.abs(rows[:, _FORCES]) >= NUMBERS_END).any(axis=1)))
        if not known.all():
            rows, measured = rows[known], measured[known]
        if self._losses:
            measured = without_losses(
                measured, rows[:, _RATES], rows[:, _ACCELERATIONS], self._parameters)
        computed = rows[:, _FORCES]
        compared = Compared(rows[:, _SECONDS], measured, computed, external_wrenches(
            self._platform, rows[:, _POSE], computed, measured))
        if len(rows):
            self._gather(compared)
        return compared

    def _gather(self, compared: Compared) -> None:
        seconds, wrench = compared.seconds, compared.wrench
        self._bins.add(seconds, wrench)
        # legs and axes first: sums along contiguous memory are many times as fast
        measured, computed, loads = map(np.ascontiguousarray, (
            compared.measured.T, compared.computed.T, wrench.T))
        residual = measured - computed
        self._legs.add(seconds, residual)
        self._wrench.add(seconds, loads)
        self._sums.add(measured, computed)

    def values(self) -> Measured:
        """Return the comparison."""
        parameters, error, count = self._parameters, self._sums.find_error(), self._legs.count
        load_known = leaves_wrench(error)
        wrench = self._wrench if load_known else _Statistics()
        residual, measured = np.sum(self._legs.squares), np.sum(self._sums.measured_squares)
        found = of_kind(Measured, parameters.leg_kind)(
            headline='', setpoints_compared=count,
            setpoints_not_compared=NotCompared(
                self._setpoints.taken - count - self._without_force, self._without_force),
            samples=self._samples.taken, samples_out_of_order=self._samples.out_of_order,
            samples_jumped_back=max(self._samples.pass_number, 0),
            gap_limit_s=self._gap * NANOSECOND,
            residual_rms=float(np.sqrt(residual / (6 * count))) if count else None,
            residual_share=float(np.sqrt(residual / measured)) if measured else None,
            legs={joint: self._leg(leg) for leg, joint in enumerate(parameters.joints)},
            external_wrench_given=load_known,
            likely_mistake=error and EffortsMistake(error.what, error.text),
            external_wrench=ExternalWrench(**{
                axis: kind(*wrench.of_quantity(n))
                for n, (axis, kind) in enumerate(zip(AXES, LOADS_OF_WRENCH, strict=True))}),
            contacts=self._contacts(load_known))
        return replace(found, headline=measured_headline(found))

    def _leg(self, leg: int) -> MeasuredLeg:
        number, sums = self._legs.count, self._sums
        residual_rms, residual_mean, residual_peak, peak_at = self._legs.of_quantity(leg)
        measured_squares, squares = sums.measured_squares[leg], sums.computed_squares[leg]
        measured_total, total = sums.measured[leg], sums.computed[leg]
        products = sums.products[leg, leg]
        rms = [float(np.sqrt(each / number)) if number else None
               for each in (measured_squares, squares)]
        spread = ((squares * number - total ** 2)
                  * (measured_squares * number - measured_total ** 2))
        # the correlation of constant forces is rounding error
        constant = not 1e-20 * squares * measured_squares * number ** 2 < spread < np.inf
        correlation = None if constant else float(np.clip(
            (products * number - total * measured_total) / np.sqrt(spread), -1.0, 1.0))
        return of_kind(MeasuredLeg, self._parameters.leg_kind)(
            residual_rms=residual_rms, residual_mean=residual_mean, residual_peak=residual_peak,
            residual_peak_at_s=peak_at, measured_rms=rms[0], computed_rms=rms[1],
            correlation=correlation)

    def _contacts(self, load_known: bool) -> Contacts:
        number = max(self._legs.count, 1)
        force = float(np.sqrt(np.mean(
            self._sums.computed_squares + self._sums.measured_squares) / number))
        length = self._parameters.singularity.characteristic_length
        smallest = 1e-3 * force * np.array([1.0, 1.0, 1.0, length, length, length])
        middle, deviation = self._bins.middle()
        threshold = np.maximum(6.0 * deviation, smallest)
        found = (self._bins.contacts(middle, threshold, self._gap * NANOSECOND)
                 if load_known else [])
        strongest = sorted(sorted(found, key=lambda each: -each.excess)[:100])
        return Contacts(
            count=len(found), threshold={f'{axis}_{"n" if n < 3 else "n_m"}': float(threshold[n])
                                         for n, axis in enumerate(AXES)},
            resolution_s=self._bins.width,
            strongest=[Contact(each.begin, each.end, AXES[each.axis], list(each.load[:3]),
                               list(each.load[3:])) for each in strongest])


class _Statistics:
    """Sums, squares and peaks of six quantities."""

    def __init__(self) -> None:
        self.count = 0
        self.sums, self.squares = np.zeros(6), np.zeros(6)
        self._peaks = Extreme(6, np.abs)

    def add(self, seconds: Array, values: Array) -> None:
        """Add values (6, N) at times (N,) [s]."""
        self.count += len(seconds)
        self.sums += np.sum(values, axis=1)
        self.squares += np.sum(values ** 2, axis=1)
        self._peaks.add(seconds, values.T)

    def of_quantity(self, n: int) -> tuple[float | None, ...]:
        """Return RMS, mean, peak, and time of the peak of a quantity; None without samples."""
        if not self.count:
            return None, None, None, None
        return (float(np.sqrt(self.squares[n] / self.count)), float(self.sums[n] / self.count),
                float(self._peaks.values[n]), float(self._peaks.at[n]))


# -- contacts: intervals with an external load ----------------------------------------------------

class ContactOfBins(NamedTuple):
    """An interval in which an external load acted on the platform."""

    begin: float
    end: float
    axis: int
    excess: float  # largest distance from the median, as a multiple of the threshold
    load: tuple[float, ...]


class WrenchBins:
    """
    Extremes and one value of the six components of a wrench in a fixed number of time bins.

    When the time exceeds the last bin, pairs of bins are merged.
    """

    _NUMBER = 16384

    def __init__(self) -> None:
        self.width = 2.0 ** -10
        self._low = np.full((self._NUMBER, 6), np.inf)
        self._high = np.full((self._NUMBER, 6), -np.inf)
        self._one = np.zeros((self._NUMBER, 6))
        self._first = np.full(self._NUMBER, np.inf)
        self._last = np.full(self._NUMBER, -np.inf)

    def add(self, seconds: Array, values: Array) -> None:
        """Add wrenches (N, 6) at times (N,), never decreasing [s]."""
        while seconds[-1] >= self.width * self._NUMBER:
            self._widen()
        bins = (seconds / self.width).astype(np.int64)
        begins = np.flatnonzero(np.diff(bins, prepend=-1))
        at = bins[begins]
        self._low[at] = np.minimum(self._low[at], np.minimum.reduceat(values, begins))
        self._high[at] = np.maximum(self._high[at], np.maximum.reduceat(values, begins))
        new = ~np.isfinite(self._first[at])
        self._one[at[new]] = values[begins[new]]
        self._first[at[new]] = seconds[begins[new]]
        self._last[at] = seconds[np.append(begins[1:], len(seconds)) - 1]

    def _widen(self) -> None:
        half = self._NUMBER // 2
        filled = np.isfinite(self._first[0::2])
        self._one[:half] = np.where(filled[:, None], self._one[0::2], self._one[1::2])
        self._low[:half] = np.minimum(self._low[0::2], self._low[1::2])
        self._high[:half] = np.maximum(self._high[0::2], self._high[1::2])
        self._first[:half] = np.minimum(self._first[0::2], self._first[1::2])
        self._last[:half] = np.maximum(self._last[0::2], self._last[1::2])
        self._low[half:], self._first[half:] = np.inf, np.inf
        self._high[half:], self._last[half:] = -np.inf, -np.inf
        self.width *= 2.0

    def middle(self) -> tuple[Array, Array]:
        """Return the median, and the robust standard deviation about it."""
        one = self._one[np.isfinite(self._first)]
        if not len(one):
            return np.zeros(6), np.zeros(6)
        median = np.median(one, axis=0)
        return median, BY_MEDIAN * np.median(np.abs(one - median), axis=0)

    def contacts(self, median: Array, threshold: Array, gap: float) -> list[ContactOfBins]:
        """Return the intervals with values above the threshold; shorter gaps are bridged."""
        filled = np.flatnonzero(np.isfinite(self._first))
        low, high = self._low[filled] - median, self._high[filled] - median
        far = np.where(-low > high, low, high)
        with np.errstate(divide='ignore', invalid='ignore'):
            excess = np.abs(far) / threshold
        hit = np.flatnonzero((excess > 1.0).any(axis=1))
        if not len(hit):
            return []
        begins, ends = self._first[filled[hit]], self._last[filled[hit]]
        apart = np.flatnonzero(begins[1:] - ends[:-1] > max(gap, 2.0 * self.width)) + 1
        found = []
        for part in np.split(np.arange(len(hit)), apart):
            inside = hit[part]
            most = np.argmax(np.abs(far[inside]), axis=0)
            peaks = far[inside][most, np.arange(6)]
            times = excess[inside].max(axis=0)
            axis = int(np.argmax(times))
            found.append(ContactOfBins(
                float(begins[part[0]]), float(ends[part[-1]]), axis, float(times[axis]),
                tuple(peaks.tolist())))
        return found
