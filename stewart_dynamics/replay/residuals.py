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
Residuals: measured minus computed leg forces, and fits to them.

Measured efforts are interpolated linearly in time onto the setpoints' stamps, between samples at
most ``setpoint.timeout`` apart, and compared with the demanded forces: residual = measured -
computed. The external wrench that accounts for it is

    w_ext = J_inv^T (f_computed - f_measured)

with the sign of ``~/wrench``: the external load on the platform at its origin, base axes (see
``runtime.external_wrench``). A platform heavier than in its parameters gives a force downward.

``Comparison.values()`` is the part ``measured`` of summary.json, see docs/summary.md.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Stamps
from stewart_dynamics.mechanics.friction import friction
from stewart_dynamics.mechanics.rows import (
    BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, GRAVITY,
    LINEAR_ACCELERATION, LINEAR_VELOCITY, POSE, POSITION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.replay.contacts import WrenchBins
from stewart_dynamics.replay.time_matching import interpolated, Waiting
from stewart_dynamics.runtime.external_wrench import external_wrenches
from stewart_dynamics.runtime.step import Batch, Outputs

# The most setpoints and measured samples that wait to be matched.
_SETPOINTS_WAITING = 2 ** 15
_SAMPLES_WAITING = 2 ** 18

# A fit that accounts for a smaller share of the residual is not reported.
_CONVINCING = 0.5

AXES = ('force_x', 'force_y', 'force_z', 'moment_x', 'moment_y', 'moment_z')
_UNITS = ('n',) * 3 + ('n_m',) * 3

# Columns of the rows kept of setpoints.
_SECONDS, _POSE, _DRIVE, _RATES, _FORCES = (
    0, slice(1, 13), slice(13, 16), slice(16, 22), slice(22, 28))


class Compared(NamedTuple):
    """K setpoints that were compared."""

    seconds: Array
    """(K,)"""
    measured: Array
    """(K, 6) [N]"""
    computed: Array
    """(K, 6) [N]"""
    wrench: Array
    """External wrench (K, 6) [N, N m]."""


class Comparison:
    """
    Compares measured forces with the computed ones, in bounded memory.

    Setpoints and measured samples may be added in any order. A setpoint waits for a measured
    sample with a later stamp; when 32768 wait, the oldest are dropped as not compared. When
    time jumps back by more than ``setpoint.timeout``, as in a bag that loops, another pass
    begins; setpoints of a pass are compared with the measured samples of the pass of the same
    number. A single stamp that is late or in the future begins no pass and is left out.

    Parameters
    ----------
    parameters : Parameters
        Of the hexapod.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._gravity = parameters['gravity']
        gap = parameters['setpoint.timeout']
        self._gap = round(gap * 1e9)
        self._setpoints = Waiting(self._gap, _SETPOINTS_WAITING)
        self._samples = Waiting(self._gap, _SAMPLES_WAITING)
        self._without_force = 0
        self._legs = _Statistics(6)
        self._measured_squares = np.zeros(6)
        self._computed = np.zeros((3, 6))  # sums of it, its squares, its products with measured
        self._fit = np.zeros((6, 3, 3))
        self._fitted = np.zeros((6, 3))
        self._wrench = _Statistics(6)
        self._mass = np.zeros(3)  # sums of d.d, d.F and F.F, d the drive
        self._bins = WrenchBins()

    def add_setpoints(self, seconds: Array, setpoints: Batch, outputs: Outputs) -> Compared:
        """
        Add setpoints and their outputs; return the setpoints that could be compared.

        Parameters
        ----------
        seconds : (N,)
            Since the first setpoint, never decreasing [s].
        setpoints : Batch
            N setpoints.
        outputs : Outputs
            Of these setpoints.

        """
        motions = setpoints.motions
        self._setpoints.add(setpoints.stamps, np.column_stack([
            seconds, motions[:, POSE], _drive(motions, setpoints.bases, self._gravity),
            outputs.rates, outputs.demanded_forces]))
        return self._compared()

    def add_measured(self, stamps: Stamps, efforts: Array) -> Compared:
        """
        Add measured forces; return the setpoints that could be compared.

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
        """Return the remaining setpoints, after the last call of the others."""
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
            measured[mine] = interpolated(
                setpoints.stamps[mine], samples.stamps[same], samples.rows[same], self._gap)
        self._samples.forget_before(*self._setpoints.oldest())
        there = np.isfinite(measured[:, 0])
        known = there & np.isfinite(rows[:, _FORCES]).all(axis=1)
        self._without_force += int(np.count_nonzero(there & ~known))
        if not known.all():
            rows, measured = rows[known], measured[known]
        computed = rows[:, _FORCES]
        compared = Compared(rows[:, _SECONDS], measured, computed, external_wrenches(
            self._platform, rows[:, _POSE], computed, measured))
        if len(rows):
            self._gather(compared, rows)
        return compared

    def _gather(self, compared: Compared, rows: Array) -> None:
        seconds, wrench = compared.seconds, compared.wrench
        self._bins.add(seconds, wrench)
        # legs and axes first: sums along contiguous memory are many times as fast
        measured, computed, rates, loads, drive = map(np.ascontiguousarray, (
            compared.measured.T, compared.computed.T, rows[:, _RATES].T, wrench.T,
            rows[:, _DRIVE].T))
        residual = measured - computed
        self._legs.add(seconds, residual)
        self._wrench.add(seconds, loads)
        self._measured_squares += np.sum(measured ** 2, axis=1)
        self._computed += [np.sum(computed, axis=1), np.sum(computed ** 2, axis=1),
                           np.sum(computed * measured, axis=1)]
        # terms of the fit: offset, Coulomb and viscous friction with unit coefficients
        coulomb = np.empty((len(seconds), 6))
        friction(np.ascontiguousarray(rows[:, _RATES]), np.zeros(6), np.ones(6), coulomb)
        terms = np.ones_like(rates), np.ascontiguousarray(coulomb.T), rates
        for row, one in enumerate(terms):
            self._fitted[:, row] += np.sum(one * residual, axis=1)
            for column, other in enumerate(terms):
                self._fit[:, row, column] += np.sum(one * other, axis=1)
        # weight and inertia of an unmodelled mass
        force = loads[:3]
        # not vdot: BLAS threads that wait for a busy processor cost more than the sums
        self._mass += [np.sum(drive ** 2), np.sum(drive * force), np.sum(force ** 2)]

    def values(self) -> dict[str, Any]:
        """Return the part of summary.json."""
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
            'external_wrench': {axis: self._wrench.named(number, '', unit)
                                for number, (axis, unit) in enumerate(
                                    zip(AXES, _UNITS, strict=True))},
            'mass': self._unmodelled_mass(),
            'contacts': self._contacts(),
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
        # the correlation of constant forces is rounding error
        constant = not spread > 1e-20 * squares * measured_squares * number ** 2
        correlation = None if constant else float(np.clip(
            (products * number - total * measured_total) / np.sqrt(spread), -1.0, 1.0))
        return {**named, 'measured_rms_n': rms[0], 'computed_rms_n': rms[1],
                'correlation': correlation, **self._friction(leg)}

    def _friction(self, leg: int) -> dict[str, float | None]:
        """Return the friction that fits the residual; None if the leg hardly moved."""
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
            # The residual has another source: these numbers are not friction parameters.
            return {**dict.fromkeys(names), 'friction_share': share}
        return dict(zip(names, [*best.tolist(), share], strict=True))

    def _unmodelled_mass(self) -> dict[str, float | None]:
        drives, products, forces = self._mass.tolist()
        share = products ** 2 / (drives * forces) if drives and forces else None
        return {'unmodelled_kg': (products / drives if share and share >= _CONVINCING else None),
                'share': share}

    def _contacts(self) -> dict[str, Any]:
        number = max(self._legs.count, 1)
        force = float(np.sqrt(np.mean(self._computed[1] + self._measured_squares) / number))
        length = self._parameters['singularity.characteristic_length']
        smallest = 1e-3 * force * np.array([1.0, 1.0, 1.0, length, length, length])
        middle, deviation = self._bins.middle()
        threshold = np.maximum(6.0 * deviation, smallest)
        found = self._bins.contacts(middle, threshold, self._gap * 1e-9)
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


def _drive(motions: Array, bases: Array | None, gravity: Array) -> Array:
    """Return gravity less the acceleration of the platform's origin in the world (N, 3)."""
    relative: Array = motions[:, LINEAR_ACCELERATION]
    if bases is None:
        return gravity - relative
    free_fall, acceleration, spin, spin_rate = (bases[:, part] for part in (
        GRAVITY, BASE_ACCELERATION, BASE_ANGULAR_VELOCITY, BASE_ANGULAR_ACCELERATION))
    position, velocity = motions[:, POSITION], motions[:, LINEAR_VELOCITY]
    drive: Array = free_fall - acceleration - relative - 2.0 * np.cross(spin, velocity) - (
        np.cross(spin_rate, position) + np.cross(spin, np.cross(spin, position)))
    return drive


class _Statistics:
    """Sums, squares and peaks of quantities."""

    def __init__(self, quantities: int) -> None:
        self.count = 0
        self.sums = np.zeros(quantities)
        self.squares = np.zeros(quantities)
        self._peaks = np.zeros(quantities)
        self._peaks_at = np.zeros(quantities)

    def add(self, seconds: Array, values: Array) -> None:
        """Add values (quantities, N) at times (N,) [s]."""
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
        """Return RMS, mean and peak under names with units; None without samples."""
        names = [f'{prefix}rms_{unit}', f'{prefix}mean_{unit}', f'{prefix}peak_{unit}',
                 f'{prefix}peak_at_s']
        if not self.count:
            return dict.fromkeys(names)
        return dict(zip(names, [
            float(np.sqrt(self.squares[number] / self.count)),
            float(self.sums[number] / self.count),
            float(self._peaks[number]), float(self._peaks_at[number])], strict=True))
