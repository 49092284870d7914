# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Measured leg forces against the computed ones: friction, payload, or something that touched it.

Measured efforts are interpolated linearly in time onto the setpoints' stamps, only between two
samples no farther apart than ``setpoint.timeout``, and compared with the forces that the dynamics
demand: residual = measured - computed.

With the model ``M X'' + C X' + G = J_inv^T f + w`` of ``lagrange``, the machine itself obeys the
same with the forces measured and one more load: ``... = J_inv^T f_measured + w + w_touch``. The
difference of the two is

    residual wrench := J_inv^T (f_measured - f_computed) = -w_touch

on the platform at its origin, base axes: what the legs gave beyond the model. The load that
touched the platform is its negative. (A platform that is heavier than its parameters say makes
legs push more: a residual wrench upward, a touching load downward.)

``Comparison.values()`` is what summary.json has under ``measured``; RMS and means are over the
setpoints compared, times ``_at_s`` are seconds since the first setpoint, a peak is the largest in
size and keeps its sign, null is what cannot be told:

setpoints_compared
    How many.
setpoints_not_compared
    ``without_measurement``: no measured samples around them; ``without_force``: J_inv cannot be
    solved.
samples, samples_out_of_order, samples_jumped_back
    Measured samples taken; those left out since their stamp was not after the last one's; how
    often their time jumped back by more than the timeout.
gap_limit_s
    Measured samples farther apart are not interpolated between.
legs
    By name: ``residual_rms_n``, ``residual_mean_n``, ``residual_peak_n``, ``residual_peak_at_s``;
    ``measured_rms_n``, ``computed_rms_n``; ``correlation`` of measured and computed. And the
    friction that fits the residual best by least squares, to be added to the parameters:
    ``coulomb_friction_n``, ``viscous_friction_n_s_m``, beside ``offset_n``; ``friction_share`` is
    the part of the residual's variance that all this explains, 0 to 1. Null where that is less
    than 0.5, or one would be negative: it is no friction then.
wrench
    The residual wrench: ``force_x`` .. ``moment_z``, each ``rms_n``, ``mean_n``, ``peak_n``,
    ``peak_at_s`` (of moments ``rms_n_m`` ...).
mass
    ``unmodelled_kg``, the mass at the platform's origin whose weight and inertia fit the residual
    force best, null where it explains less than half; ``share``, the part of the residual force's
    mean square that it explains.
touches
    Intervals in which a component of the residual wrench is farther from its median than
    ``threshold``: 6 robust standard deviations (1.4826 times the median distance from the
    median), at least 0.001 of the leg forces' RMS. What lasts for more than half of the bag is
    the median: a payload that is not in the parameters, and no touch.
    ``count``, and of the strongest 100, in order of time: ``from_s``, ``to_s``; ``axis``, the
    component farthest beyond its threshold; ``force_n`` and ``moment_n_m``, what touched the
    platform, at the most, beyond its median: the NEGATIVE of the residual wrench. ``resolution_s``
    is how far off in time they may be.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers, Stamps
from stewart_dynamics.mechanics.friction import COULOMB_RATE
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.step import Batch, Outputs

# What waits for the other side at most, setpoints and measured samples.
_SETPOINTS_WAITING = 2 ** 15
_SAMPLES_WAITING = 2 ** 18

# A fit that explains a smaller part than this is not told.
_CONVINCING = 0.5

AXES = ('force_x', 'force_y', 'force_z', 'moment_x', 'moment_y', 'moment_z')
_UNITS = ('n',) * 3 + ('n_m',) * 3

# Columns of what is kept of a setpoint.
_SECONDS, _POSITION, _ROTATION, _ACCELERATION, _RATES, _FORCES = (
    0, slice(1, 4), slice(4, 13), slice(13, 16), slice(16, 22), slice(22, 28))


class Compared(NamedTuple):
    """Setpoints that were newly compared, K of them."""

    seconds: Array
    """(K,)"""
    measured: Array
    """(K, 6) [N]"""
    computed: Array
    """(K, 6) [N]"""
    wrench: Array
    """Residual wrench (K, 6) [N, N m]: the negative of the load that touched the platform."""


class Comparison:
    """
    Gathers how measured forces differ from the computed ones, in bounded memory.

    Setpoints and measured samples may come in any turn. A setpoint waits for a measured sample
    with a later stamp; the longest waiting are given up as not compared when 32768 wait. Where
    time jumps back by more than ``setpoint.timeout``, a bag that loops, another pass begins, and
    a pass of the setpoints is compared with the measured samples of the pass of the same number.
    A single stamp out of line, too late or in the future, begins no pass and is left out.

    Parameters
    ----------
    parameters : Parameters
        The machine's.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        gap = parameters['setpoint.timeout']
        self._gap = round(gap * 1e9)
        self._setpoints = _Waiting(self._gap, _SETPOINTS_WAITING)
        self._samples = _Waiting(self._gap, _SAMPLES_WAITING)
        self._without_force = 0
        self._legs = _Statistics(6)
        self._measured_squares = np.zeros(6)
        self._computed = np.zeros((3, 6))  # sums of it, its squares, its products with measured
        self._fit = np.zeros((6, 3, 3))
        self._fitted = np.zeros((6, 3))
        self._wrench = _Statistics(6)
        self._mass = np.zeros(3)  # sums of d.d, d.F and F.F, d = acceleration - gravity
        self._bins = _Bins()

    def add_setpoints(self, seconds: Array, setpoints: Batch, outputs: Outputs) -> Compared:
        """
        Take setpoints and what the step gave for them; return what could be compared.

        Parameters
        ----------
        seconds : (N,)
            Since the first setpoint, never decreasing [s].
        setpoints : Batch
            N of them.
        outputs : Outputs
            Of all of them.

        """
        motions = setpoints.motions
        self._setpoints.add(setpoints.stamps, np.column_stack([
            seconds, motions[:, :12], motions[:, 18:21], outputs.rates, outputs.demanded_forces]))
        return self._compared()

    def add_measured(self, stamps: Stamps, efforts: Array) -> Compared:
        """
        Take measured forces; return what could be compared.

        Parameters
        ----------
        stamps : (M,)
            [ns]
        efforts : (M, 6)
            In the order of the parameter ``joints``, finite [N].

        """
        self._samples.add(stamps, efforts)
        return self._compared()

    def finish(self) -> Compared:
        """Return what was left to compare; no more are to come."""
        self._setpoints.confirm()
        self._samples.confirm()
        return self._compared()

    def _compared(self) -> Compared:
        setpoints = self._setpoints.take_before(self._samples.pass_number, self._samples.newest)
        rows = setpoints.rows
        if not len(rows):
            six = np.empty((0, 6))
            return Compared(np.empty(0), six, six, six)
        samples = self._samples.joined()
        measured = np.full((len(rows), 6), np.nan)
        for number in np.unique(setpoints.passes):
            mine, same = setpoints.passes == number, samples.passes == number
            measured[mine] = _interpolated(
                setpoints.stamps[mine], samples.stamps[same], samples.rows[same], self._gap)
        self._samples.forget_before(*self._setpoints.oldest())
        there = np.isfinite(measured[:, 0])
        known = there & np.isfinite(rows[:, _FORCES]).all(axis=1)
        self._without_force += int(np.count_nonzero(there & ~known))
        if not known.all():
            rows, measured = rows[known], measured[known]
        computed = rows[:, _FORCES]
        compared = Compared(rows[:, _SECONDS], measured, computed, _wrench(
            self._parameters, rows[:, _POSITION], rows[:, _ROTATION].reshape(-1, 3, 3),
            measured - computed))
        if len(rows):
            self._gather(compared, rows)
        return compared

    def _gather(self, compared: Compared, rows: Array) -> None:
        seconds, wrench = compared.seconds, compared.wrench
        self._bins.add(seconds, wrench)
        # legs and axes first: sums along what lies side by side are many times as fast
        measured, computed, rates, loads, accelerations = map(np.ascontiguousarray, (
            compared.measured.T, compared.computed.T, rows[:, _RATES].T, wrench.T,
            rows[:, _ACCELERATION].T))
        residual = measured - computed
        self._legs.add(seconds, residual)
        self._wrench.add(seconds, loads)
        self._measured_squares += np.sum(measured ** 2, axis=1)
        self._computed += [np.sum(computed, axis=1), np.sum(computed ** 2, axis=1),
                           np.sum(computed * measured, axis=1)]
        # as the dynamics have friction: offset, Coulomb's, viscous
        terms = np.ones_like(rates), np.clip(rates / COULOMB_RATE, -1.0, 1.0), rates
        for row, one in enumerate(terms):
            self._fitted[:, row] += np.sum(one * residual, axis=1)
            for column, other in enumerate(terms):
                self._fit[:, row, column] += np.sum(one * other, axis=1)
        drive, force = accelerations - self._parameters['gravity'][:, None], loads[:3]
        # not vdot: threads of BLAS that wait for a busy processor cost far more than the sums
        self._mass += [np.sum(drive ** 2), np.sum(drive * force), np.sum(force ** 2)]

    def values(self) -> dict[str, Any]:
        """Return what the module says, for summary.json."""
        joints = self._parameters['joints']
        return {
            'setpoints_compared': self._legs.count,
            'setpoints_not_compared': {
                'without_measurement': (
                    self._setpoints.taken - self._legs.count - self._without_force),
                'without_force': self._without_force},
            'samples': self._samples.taken,
            'samples_out_of_order': self._samples.out_of_order,
            'samples_jumped_back': max(self._samples.pass_number, 0),
            'gap_limit_s': self._gap * 1e-9,
            'legs': {joint: self._leg(leg) for leg, joint in enumerate(joints)},
            'wrench': {axis: self._wrench.named(number, '', unit)
                       for number, (axis, unit) in enumerate(zip(AXES, _UNITS, strict=True))},
            'mass': self._unmodelled_mass(),
            'touches': self._touches(),
        }

    def _leg(self, leg: int) -> dict[str, float | None]:
        number = self._legs.count
        named = self._legs.named(leg, 'residual_', 'n')
        measured_squares = float(self._measured_squares[leg])
        total, squares, products = self._computed[:, leg].tolist()
        measured_total = total + float(self._legs.sums[leg])
        rms = [np.sqrt(each / number) if number else None for each in (measured_squares, squares)]
        spread = ((squares * number - total ** 2)
                  * (measured_squares * number - measured_total ** 2))
        # forces that do not change, but for rounding, do not correlate
        constant = not spread > 1e-20 * squares * measured_squares * number ** 2
        correlation = None if constant else float(np.clip(
            (products * number - total * measured_total) / np.sqrt(spread), -1.0, 1.0))
        return {**named, 'measured_rms_n': rms[0], 'computed_rms_n': rms[1],
                'correlation': correlation, **self._friction(leg)}

    def _friction(self, leg: int) -> dict[str, float | None]:
        """Return the friction that fits the residual; none where the leg hardly moved."""
        names = 'offset_n', 'coulomb_friction_n', 'viscous_friction_n_s_m', 'friction_share'
        fit, fitted = self._fit[leg], self._fitted[leg]
        scale = np.sqrt(np.diagonal(fit))
        if not scale.all() or np.linalg.cond(fit / np.outer(scale, scale)) > 1e8:
            return dict.fromkeys(names)
        best = np.linalg.solve(fit / np.outer(scale, scale), fitted / scale) / scale
        mean_part = fitted[0] ** 2 / fit[0, 0]
        variance = float(self._legs.squares[leg] - mean_part)
        if variance <= 1e-12 * float(self._legs.squares[leg]):
            return dict.fromkeys(names)
        share = float(np.clip((best @ fitted - mean_part) / variance, 0.0, 1.0))
        number = self._legs.count
        noise = 0.05 * np.sqrt(variance / number)
        if share < _CONVINCING or min(best[1], best[2] * np.sqrt(fit[2, 2] / number)) < -noise:
            # Something else is at work, and these numbers are no parameters.
            return {**dict.fromkeys(names), 'friction_share': share}
        return dict(zip(names, [*best.tolist(), share], strict=True))

    def _unmodelled_mass(self) -> dict[str, float | None]:
        drives, products, forces = self._mass.tolist()
        share = products ** 2 / (drives * forces) if drives and forces else None
        return {'unmodelled_kg': (products / drives if share and share >= _CONVINCING else None),
                'share': share}

    def _touches(self) -> dict[str, Any]:
        number = max(self._legs.count, 1)
        force = float(np.sqrt(np.mean(self._computed[1] + self._measured_squares) / number))
        length = self._parameters['singularity.characteristic_length']
        smallest = 1e-3 * force * np.array([1.0, 1.0, 1.0, length, length, length])
        middle, deviation = self._bins.middle()
        threshold = np.maximum(6.0 * deviation, smallest)
        found = self._bins.beyond(middle, threshold, self._gap * 1e-9)
        strongest = sorted(sorted(found, key=lambda each: -each.excess)[:100])
        return {
            'count': len(found),
            'threshold': {f'{axis}_{unit}': float(each) for axis, unit, each in zip(
                AXES, _UNITS, threshold, strict=True)},
            'resolution_s': self._bins.width,
            'strongest': [
                {'from_s': each.begin, 'to_s': each.end, 'axis': AXES[each.axis],
                 'force_n': list(each.load[:3]), 'moment_n_m': list(each.load[3:])}
                for each in strongest]}


def _wrench(parameters: Parameters, position: Array, rotation: Array, forces: Array) -> Array:
    """Return J_inv^T forces (N, 6), without J_inv: sums of s_i f_i and of a_i x s_i f_i."""
    # axis, leg, sample; no matrix product, whose rounding depends on how many samples there are
    x_axis, y_axis, z_axis = np.moveaxis(rotation, 0, -1).swapaxes(0, 1)[:, :, None, :]
    px, py, pz = parameters['geometry.platform_joints'].T[:, :, None]
    arms = x_axis * px + y_axis * py + z_axis * pz
    legs = arms + position.T[:, None, :] - parameters['geometry.base_joints'].T[:, :, None]
    pushes = legs * (forces.T / np.sqrt(np.sum(legs ** 2, axis=0)))
    (ax, ay, az), (x, y, z) = arms, pushes
    parts = x, y, z, ay * z - az * y, az * x - ax * z, ax * y - ay * x
    return np.stack([np.sum(part, axis=0) for part in parts], axis=1)


def _interpolated(stamps: Stamps, at: Stamps, values: Array, gap: int) -> Array:
    """Return values at stamps between two that are no farther apart than the gap, else nan."""
    result = np.full((len(stamps), values.shape[1]), np.nan)
    if not len(at):
        return result
    after = np.minimum(np.searchsorted(at, stamps), len(at) - 1)
    # one with the very stamp needs no other
    before = np.where(at[after] == stamps, after, np.maximum(after - 1, 0))
    between = (at[before] <= stamps) & (stamps <= at[after]) & (at[after] - at[before] <= gap)
    before, after = before[between], after[between]
    part = (stamps[between] - at[before]) / np.maximum(at[after] - at[before], 1)
    result[between] = values[before] + part[:, None] * (values[after] - values[before])
    return result


class _Rows(NamedTuple):
    stamps: Stamps
    passes: Integers
    rows: Array

    def part(self, which: slice | Stamps | Flags) -> _Rows:
        """Return some of them; a copy where they are not given by a slice."""
        return _Rows(self.stamps[which], self.passes[which], self.rows[which])


class _Waiting:
    """
    Rows with stamps that wait for those of the other side, in order of pass and stamp.

    The last row waits outside until the next one shows that its stamp is in line.
    """

    def __init__(self, gap: int, most: int) -> None:
        self.taken = 0
        self.out_of_order = 0
        self.pass_number = -1
        self.newest = 0
        self._gap, self._most = gap, most
        self._unsure: tuple[Stamps, Array] | None = None
        self._chunks: list[_Rows] = []
        self._waiting = 0

    def add(self, stamps: Stamps, rows: Array) -> None:
        if not len(stamps):
            return
        self.taken += len(stamps)
        if self._unsure is not None:
            stamps = np.concatenate([self._unsure[0], stamps])
            rows = np.concatenate([self._unsure[1], rows])
        self._unsure = stamps[-1:].copy(), rows[-1:].copy()
        self._line_up(stamps, rows[:-1])

    def confirm(self) -> None:
        """Take the last row for what it is: no other comes."""
        if self._unsure is not None:
            # one that jumps back and has no other behind it is out of line
            stamps = np.append(self._unsure[0], np.iinfo(np.int64).max)
            rows, self._unsure = self._unsure[1], None
            self._line_up(stamps, rows)

    def _line_up(self, stamps: Stamps, rows: Array) -> None:
        """Give all rows but the last a pass; leave out what is out of order."""
        if self.pass_number < 0 and len(rows):
            self.pass_number, self.newest = 0, int(stamps[0]) - 1
        steps = np.diff(stamps)
        if len(rows) and stamps[0] > self.newest and steps.min() > 0:
            passes: Stamps = np.full(len(rows), self.pass_number)
            self.newest = int(stamps[-2])
        else:
            passes = np.array(self._passes(stamps.tolist()), dtype=np.int64)
            self.out_of_order += int(np.count_nonzero(passes < 0))
        in_line = passes >= 0
        if in_line.any():
            chunk = _Rows(stamps[:-1], passes, rows).part(in_line)
            self._chunks.append(chunk)
            self._waiting += len(chunk.stamps)
        excess = self._waiting - self._most
        if excess > 0:
            self._chunks = [self.joined().part(np.arange(excess, self._waiting))]
            self._waiting = self._most

    def _passes(self, stamps: list[int]) -> list[int]:
        """Return the passes of all but the last stamp, -1 of those out of order."""
        passes = []
        for stamp, after in zip(stamps[:-1], stamps[1:], strict=True):
            ahead = stamp > self.newest
            far = abs(stamp - self.newest) > self._gap
            # one that the next goes back behind, though not behind what was before, is in the
            # future; one before what the next goes on from is late
            alone = (self.newest < after < stamp - self._gap if ahead else after > self.newest)
            if not far and not ahead or far and alone:
                passes.append(-1)
                continue
            self.pass_number += not ahead
            self.newest = stamp
            passes.append(self.pass_number)
        return passes

    def take_before(self, pass_number: int, stamp: int) -> _Rows:
        """Return and forget the rows of earlier passes, and of this one up to the stamp."""
        ready: list[_Rows] = []
        while self._chunks:
            chunk = self._chunks[0]
            count = int(np.count_nonzero((chunk.passes < pass_number) | (
                (chunk.passes == pass_number) & (chunk.stamps <= stamp))))
            if count:
                ready.append(chunk.part(slice(0, count)))
                self._waiting -= count
            if count < len(chunk.stamps):
                self._chunks[0] = chunk.part(slice(count, None))
                break
            self._chunks.pop(0)
        return _rows(ready)

    def joined(self) -> _Rows:
        """Return the rows that wait."""
        rows = _rows(self._chunks)
        self._chunks = [rows] if len(rows.stamps) else []
        return rows

    def oldest(self) -> tuple[int, int]:
        """Return pass and stamp before which no row will be."""
        if not self._chunks:
            return self.pass_number, self.newest
        return int(self._chunks[0].passes[0]), int(self._chunks[0].stamps[0])

    def forget_before(self, pass_number: int, stamp: int) -> None:
        """Forget the rows before this time but the last one of them."""
        rows = self.joined()
        before = int(np.count_nonzero((rows.passes < pass_number) | (
            (rows.passes == pass_number) & (rows.stamps <= stamp))))
        if before > 1:
            self._chunks = [rows.part(np.arange(before - 1, len(rows.stamps)))]
            self._waiting = len(rows.stamps) - before + 1


def _rows(chunks: list[_Rows]) -> _Rows:
    if not chunks:
        none = np.empty(0, dtype=np.int64)
        return _Rows(none, none, np.empty((0, 0)))
    return chunks[0] if len(chunks) == 1 else _Rows(
        *map(np.concatenate, zip(*chunks, strict=True)))


class _Statistics:
    """Sums, squares and peaks of quantities."""

    def __init__(self, quantities: int) -> None:
        self.count = 0
        self.sums = np.zeros(quantities)
        self.squares = np.zeros(quantities)
        self._peaks = np.zeros(quantities)
        self._peaks_at = np.zeros(quantities)

    def add(self, seconds: Array, values: Array) -> None:
        """Take values (quantities, N) at times (N,)."""
        first = not self.count
        self.count += len(seconds)
        self.sums += np.sum(values, axis=1)
        self.squares += np.sum(values ** 2, axis=1)
        at = np.argmax(np.abs(values), axis=1)
        peaks = values[np.arange(len(values)), at]
        larger = (np.abs(peaks) > np.abs(self._peaks)) | first
        self._peaks[larger] = peaks[larger]
        self._peaks_at[larger] = seconds[at][larger]

    def named(self, number: int, prefix: str, unit: str) -> dict[str, float | None]:
        """Return RMS, mean and peak under names with units; null where there was nothing."""
        names = [f'{prefix}rms_{unit}', f'{prefix}mean_{unit}', f'{prefix}peak_{unit}',
                 f'{prefix}peak_at_s']
        if not self.count:
            return dict.fromkeys(names)
        return dict(zip(names, [
            float(np.sqrt(self.squares[number] / self.count)),
            float(self.sums[number] / self.count),
            float(self._peaks[number]), float(self._peaks_at[number])], strict=True))


class _Touch(NamedTuple):
    begin: float
    end: float
    axis: int
    excess: float
    """By how many thresholds it is beyond the median."""
    load: tuple[float, ...]


class _Bins:
    """
    Extremes and one value of six columns in bins of time, as many as memory is for.

    Bins twice as wide take the place of two when time goes on beyond the last.
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
        return median, 1.4826 * np.median(np.abs(one - median), axis=0)

    def beyond(self, median: Array, threshold: Array, gap: float) -> list[_Touch]:
        """Return where values are beyond the threshold, interrupted for no longer than the gap."""
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
        touches = []
        for part in np.split(np.arange(len(hit)), apart):
            inside = hit[part]
            most = np.argmax(np.abs(far[inside]), axis=0)
            peaks = far[inside][most, np.arange(6)]
            times = excess[inside].max(axis=0)
            axis = int(np.argmax(times))
            touches.append(_Touch(
                float(begins[part[0]]), float(ends[part[-1]]), axis, float(times[axis]),
                tuple((-peaks).tolist())))
        return touches
