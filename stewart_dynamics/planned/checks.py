# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The checks of a planned trajectory: limits and singularities, at samples and between them.

Between two samples, positions and rates of the drives, squares of levers, det(J) and
sin^2(angle / 2) of the joints are cubics in time through their values and derivatives at both. The
clearance of the legs falls by no more than the platform joints, and corners of its plate, move.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Integers
from stewart_dynamics.mechanics.batch import (
    find_unreachable, lever_squares, missing_distances, unreached)
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.drives.motor_limits import exceeds
from stewart_dynamics.mechanics.drives.motors import (
    ACCELERATIONS as ACCELERATIONS_OF_MOTORS, ANGLES as ANGLES_OF_MOTORS, AVAILABLE_TORQUES,
    motor_ratio, Motors, SPEEDS)
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.kinematics.pose_errors import find_pose_error
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, Exceedance, LIMITS, result_values, SPEED_MAX, TEMPERATURE_RISE_MAX)
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, UNIT_LOAD_FORCES)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.planned.interpolation import Cubics
from stewart_dynamics.planned.sampling import TOLERANCE
from stewart_dynamics.setpoints.rejections import OUT_OF_RANGE

# Where |det(J)| falls below this part of its values at two samples, the samples between them are
# made closer.
DIP = 0.9
# Between two samples the clearance of the legs may be below its limit by less than this part
# of the characteristic length.
_CLEARANCE = 1e-4

LIMIT = 'a limit is exceeded'
SINGULAR = 'a singularity is met'
UNREACHABLE = 'out of reach'
JUMPS = 'a drive leaves its turn'


class Violation(NamedTuple):
    """Reason and time of a rejection."""

    time: float  # [s]
    reason: str
    words: str
    leg: int | None = None
    limit: str = ''

    @property
    def order(self) -> tuple[float, bool, str]:
        """Return the sort key: at equal times, singularities first, since they cause others."""
        return self.time, self.reason != SINGULAR, self.words


class Samples(NamedTuple):
    """M samples of a trajectory in the order of time."""

    times: Array  # (M,) [s]
    durations: Array  # time from each sample to the next (M - 1,) [s]
    motions: Array  # rows of motion (M, MOTION)
    results: Array  # rows of results (M, RESULT)
    joined: Flags  # whether the next sample follows this one in the trajectory (M - 1,)
    near: Flags
    """Whether it is near enough for motion and forces between both to follow from theirs."""
    ways: Array  # bound of how far a platform joint, or corner of its plate, moves to the next [m]

    def until(self, n: int) -> Samples:
        """Return the samples before the n-th, n more than 0."""
        return Samples(self.times[:n], self.durations[:n - 1], self.motions[:n],
                       self.results[:n], self.joined[:n - 1], self.near[:n - 1],
                       self.ways[:n - 1])


class Checks:
    """
    Finds violations in samples of a trajectory that come in the order of time.

    violations: violations found so far, in no order.
    possible_error: that in the first pose in which a drive is outside its range, or which a leg
        does not reach; empty without one; None without such a pose.
    condition_number, condition_time: largest condition number so far, and its time [s].
    force, force_leg: largest absolute effort of a drive so far [N] or [N m], and its leg.
    load: the largest absolute effort so far as a part of its limit.
    lever, lever_time, lever_leg: smallest lever by its largest value so far, its time [s] and leg;
        infinite for legs whose levers do not change.
    missing, missing_time, missing_words: largest distance by which a leg does not reach so far
        [m], its time [s], and the leg in words.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.violations: list[Violation] = []
        self.condition_number, self.condition_time = 0.0, 0.0
        self.force, self.force_leg, self.load = -1.0, 0, 0.0
        self.lever, self.lever_time, self.lever_leg = math.inf, 0.0, 0
        self.missing, self.missing_time, self.missing_words = 0.0, 0.0, ''
        self._strongest = np.zeros(6)
        self._joints = parameters.joints
        poses = PoseLimits(parameters)
        self._limits, self._stop = poses.limits, poses.stop_condition
        self._angles, self._clearance = poses.angles, poses.clearance
        self._drives, self._motor_limits = poses.drives, poses.motors
        self._clearance_tolerance = _CLEARANCE * parameters.singularity.characteristic_length
        self._friction = Friction.of(parameters)
        self._parameters, self._kind = parameters, parameters.leg_kind
        self._efforts = self._kind.effort.columns
        self._rises = np.zeros(6)
        self.possible_error: str | None = None

    def check(self, samples: Samples) -> list[int]:
        """Check samples and between them; return after which of them closer ones are needed."""
        self._check_joints(samples)
        unclear = {*self._check_motors(samples), *self._check_clearance(samples),
                   *self._check_levers(samples)}
        finite = np.isfinite(samples.results).all(axis=1)
        if not finite.all():
            n = int(np.argmin(finite))
            self._note_no_result(samples, n)
            if n == 0:
                return sorted(unclear)
            samples = samples.until(n)
        results = samples.results
        self._keep_largest_force(results[:, self._efforts])
        for limit, values in result_values(self._parameters, results).items():
            self._check_limit(limit, values, _of_legs(samples.times))
        self._name_pose_error(samples)
        self._check_cubics(samples)
        return sorted({
            *unclear, *self._check_singularities(samples), *self._reversals(samples)})

    def _name_pose_error(self, samples: Samples) -> None:
        """Name the possible error in the pose with which drives first are outside their ranges."""
        found = [each for each in self.violations if each.limit in self._kind.position_limits]
        if found and self.possible_error is None:
            at = int(np.argmax(samples.times >= found[0].time))
            self.possible_error = find_pose_error(
                self._parameters, samples.motions[at], first=False)

    def _note_no_result(self, samples: Samples, n: int) -> None:
        """Note that a sample has no results: a leg does not reach, or numbers overflow."""
        unreachable = find_unreachable(
            self._parameters.structure, self._joints, samples.motions, samples.results,
            samples.times.shape, 'nan')
        time = float(samples.times[n])
        if n not in unreachable:
            self.violations.append(Violation(time, OUT_OF_RANGE, f': {OUT_OF_RANGE}'))
            return
        missing = missing_distances(self._parameters.structure, samples.motions[unreachable])
        worst = int(np.argmax(missing.max(axis=1)))
        if missing[worst].max() > self.missing:
            self.missing = float(missing[worst].max())
            self.missing_time = float(samples.times[unreachable[worst]])
            self.missing_words = unreached(self._joints, missing[worst])
        if self.possible_error is None:
            self.possible_error = find_pose_error(
                self._parameters, samples.motions[n], first=False)
        self.violations.append(Violation(
            time, UNREACHABLE, f' {unreached(self._joints, missing[0])}',
            int(np.argmax(missing[0]))))

    def check_path(self, samples: Samples) -> list[int]:
        """Check poses as ``check`` does: singularities, joints, levers, clearance of the legs."""
        self._check_singularities(samples)
        self._check_joints(samples)
        return sorted({*self._check_levers(samples), *self._check_clearance(samples)})

    def _check_levers(self, samples: Samples) -> list[int]:
        """Check levers at and between samples; return after which closer ones are needed."""
        limit = self._kind.lever_limit
        if not limit:
            return []
        times, durations = samples.times, samples.durations
        with np.errstate(all='ignore'):  # numbers that overflow are found by ``check``
            squares, rates = lever_squares(self._parameters.structure, samples.motions)
            values = np.sqrt(np.maximum(squares, 0.0))
            # a sample that a leg does not reach is one without results
            self._check_limit(limit, np.where(squares < 0.0, np.nan, values), _of_legs(times))
            self._keep_smallest_lever(values, _of_legs(times))
            cubics = Cubics.between(squares, rates, durations[:, None])
            low, _ = cubics.bounds()
            threshold = self._limits.thresholds[limit]
            suspect = np.flatnonzero(samples.near & (
                (low < threshold ** 2) | (low < self.lever ** 2)).any(axis=1))
            begin, duration = times[suspect, None], durations[suspect, None]
            cubics, unclear = cubics.selected(suspect), np.zeros(len(suspect), dtype=bool)
            for fraction in cubics.extrema():
                squares, at = cubics.at(fraction), begin + fraction * duration
                values = np.sqrt(np.maximum(squares, 0.0))
                self._check_limit(limit, values, at)
                self._keep_smallest_lever(values, at)
                self._note_lost(squares, threshold, at)
                unclear |= (squares < 0.0).any(axis=1)
        found: list[int] = suspect[unclear].tolist()
        return found

    def _keep_smallest_lever(self, values: Array, times: Array) -> None:
        if np.isfinite(values).any():
            n, leg = map(int, np.unravel_index(np.nanargmin(values), values.shape))
            if values[n, leg] < self.lever:
                self.lever, self.lever_time = float(values[n, leg]), float(times[n, leg])
                self.lever_leg = leg

    def _note_lost(self, squares: Array, threshold: Array, times: Array) -> None:
        """Note legs that do not reach between samples, where their levers have no limit."""
        lost = (squares < 0.0) & ~(threshold > 0.0)
        if lost.any():
            n, leg = map(int, np.unravel_index(
                np.argmin(np.where(lost, times, np.inf)), lost.shape))
            self.violations.append(Violation(
                float(times[n, leg]), UNREACHABLE, f' {self._joints[leg]} cannot reach', leg))

    def _check_joints(self, samples: Samples) -> None:
        """Check the angles of the joints at samples, and between those that are near."""
        if self._angles is None:
            return
        times, durations = samples.times, samples.durations
        with np.errstate(all='ignore'):  # numbers that overflow are found by ``check``
            values, rates = self._angles.haversines(samples.motions)
            cubics = Cubics.between(values, rates, durations[:, None])
            _, high = cubics.bounds()
        for limit in self._limits.of_joints:
            where = ANGLES[limit]
            self._check_limit(limit, _angle(values[:, where]), _of_legs(times))
            suspect = np.flatnonzero(
                samples.near & self._limits.exceeds(limit, _angle(high[:, where])).any(axis=1))
            begin, duration = times[suspect, None], durations[suspect, None]
            between = Cubics._make(each[suspect, where] for each in cubics)
            for fraction in between.extrema():
                self._check_limit(
                    limit, _angle(between.at(fraction)), begin + fraction * duration)

    def _check_motors(self, samples: Samples) -> list[int]:
        """
        Check torques and speeds of the motors at samples, and speeds between those near.

        Return where closer samples are needed: where a leg reverses, the losses in its screw do.
        """
        if self._drives is None:
            return []
        times, durations, results = samples.times, samples.durations, samples.results
        with np.errstate(all='ignore'):  # numbers that overflow are found by ``check``
            rows = self._drives(samples.motions, results)
            for limit, (values, bounds) in self._motor_limits.excesses(
                    rows, np.full((len(rows), 6), np.nan)).items():
                self._note(limit, exceeds(values, bounds), values, bounds, _of_legs(times))
            cubics = Cubics.between(rows[:, ANGLES_OF_MOTORS], rows[:, SPEEDS], durations[:, None])
            most = self._motor_limits.bounds[SPEED_MAX]
            suspect = np.flatnonzero(samples.near & exceeds(
                cubics.middle_rate() / durations[:, None], most).any(axis=1))
            fraction = (between := cubics.selected(suspect)).rate_extremum()
            begin, duration = times[suspect, None], durations[suspect, None]
            speeds = between.rate_at(fraction) / duration
            self._note(SPEED_MAX, exceeds(speeds, most), speeds, np.broadcast_to(
                most, speeds.shape), begin + fraction * duration)
            return self._losses_reverse(samples, rows)

    def _losses_reverse(self, samples: Samples, rows: Array) -> list[int]:
        """Return after which samples a drive reverses while its motor may be at its limit."""
        p, ratio = self._parameters, motor_ratio(self._parameters)
        rates = rows[:, SPEEDS] / ratio
        inertial = p[self._kind.fields['reflected_mass']] / ratio * rows[
            :, ACCELERATIONS_OF_MOTORS]
        highest = (np.abs(inertial) + (np.abs(samples.results[:, self._efforts] - inertial)
                                       + self._friction.largest_change)
                   / p.drive.efficiency) / ratio
        may = exceeds(np.maximum(highest[:-1], highest[1:]), np.minimum(
            rows[:-1, AVAILABLE_TORQUES], rows[1:, AVAILABLE_TORQUES]))
        reverses = (rates[:-1] * rates[1:] < 0.0) & (np.maximum(
            np.abs(rates[:-1]), np.abs(rates[1:])) > self._friction.coulomb_velocity)
        unclear: list[int] = np.flatnonzero(
            samples.near & (may & reverses).any(axis=1)).tolist()
        return unclear

    def check_windings(self, times: Array, motions: Array, results: Array) -> None:
        """Check the temperatures of windings at samples (M,), after those of earlier calls."""
        if self._drives is None:
            return
        with np.errstate(all='ignore'):
            heat = Motors.of_rows(self._drives(motions, results)).copper_heat
        # Between two samples the mean of both.
        held = np.concatenate([0.5 * (heat[:-1] + heat[1:]), heat[-1:]])
        rises = temperature_rises(self._parameters, times, held, self._rises)
        self._rises = rises[-1]
        bounds = np.broadcast_to(self._motor_limits.bounds[TEMPERATURE_RISE_MAX], rises.shape)
        self._note(
            TEMPERATURE_RISE_MAX, exceeds(rises, bounds), rises, bounds, _of_legs(times))

    def _check_clearance(self, samples: Samples) -> list[int]:
        """Check the clearance of the legs at samples, and between those that are near."""
        if self._clearance is None:
            return []
        with np.errstate(all='ignore'):  # numbers that overflow are found by ``check``
            clearances, others = self._clearance.nearest(samples.motions)
            # Two legs approach each other by no more than both of their joints move.
            nearest = clearances.min(axis=1)
            lowest = 0.5 * (nearest[:-1] + nearest[1:]) - samples.ways
        self._check_limit(CLEARANCE_MIN, clearances, _of_legs(samples.times), others)
        bound = float(self._limits.bounds[CLEARANCE_MIN][0])
        held = np.minimum(nearest[:-1], nearest[1:]) >= self._limits.thresholds[CLEARANCE_MIN][0]
        unclear: list[int] = np.flatnonzero(
            samples.near & held & (lowest < bound - self._clearance_tolerance)).tolist()
        return unclear

    def no_pose(self, time: float) -> None:
        """Note that no pose on this side of singularities has the lengths of the legs."""
        dead_centre = ' or dead centre' if self._kind.lever_limit else ''
        self.violations.append(Violation(
            time, SINGULAR, ": the legs' cubics lead to no pose on this side of a singularity"
            f'{dead_centre}'))

    def _keep_largest_force(self, forces: Array) -> None:
        magnitudes = np.abs(forces)
        self._strongest = np.maximum(self._strongest, magnitudes.max(axis=0))
        largest = float(magnitudes.max())
        if largest > self.force:
            self.force, self.force_leg = largest, int(np.argmax(magnitudes)) % 6
        self.load = max(self.load, float((magnitudes / self._limits.force_max).max()))

    def _exceed_known(self, forces: Array) -> Flags:
        """Return where bounds of forces (M, 6) may change the largest force, or pass a limit."""
        known = (1.0 + TOLERANCE) * np.minimum(
            self.force, np.maximum(self._strongest, self._limits.force_max))
        exceeding: Flags = (forces > known).any(axis=1)
        return exceeding

    def _reversals(self, samples: Samples) -> list[int]:
        """Return after which samples a change of Coulomb friction may add to the largest force."""
        results, durations = samples.results, samples.durations
        forces = np.abs(results[:, self._efforts])
        which = np.flatnonzero(samples.near & self._exceed_known(
            np.maximum(forces[:-1], forces[1:]) + self._friction.largest_change))
        if not len(which) or not self._friction.coulomb.any():
            return []
        here, there = results[which], results[which + 1]
        at_here, rate_here = self._of_drives(samples.motions[which], here)
        at_there, rate_there = self._of_drives(samples.motions[which + 1], there)
        middle = Cubics(
            at_here, at_there, rate_here * durations[which, None],
            rate_there * durations[which, None]).middle_rate() / durations[which, None]
        of_rates = np.stack([self._friction.without_viscous.forces(rates)
                             for rates in (rate_here, rate_there, middle)])
        others = here[:, self._efforts] - of_rates[0], there[:, self._efforts] - of_rates[1]
        highest = np.maximum(*others) + of_rates.max(axis=0)
        lowest = np.minimum(*others) + of_rates.min(axis=0)
        unclear: list[int] = which[
            self._exceed_known(np.maximum(highest, -lowest))].tolist()
        return unclear

    def _of_drives(self, motions: Array, results: Array) -> tuple[Array, Array]:
        """Return coordinates and rates of the drives (N, 6), but for a constant."""
        if self._drives is None:
            return results[:, self._kind.position.columns], results[:, self._kind.rate.columns]
        rows, ratio = self._drives(motions, results), motor_ratio(self._parameters)
        return rows[:, ANGLES_OF_MOTORS] / ratio, rows[:, SPEEDS] / ratio

    def _check_limit(self, limit: str, values: Array, times: Array,
                     others: Integers | None = None) -> None:
        """Note the first of the values (M, 6) at their times that exceeds a limit."""
        self._note(limit, self._limits.exceeds(limit, values), values, np.broadcast_to(
            self._limits.bounds.get(limit, np.nan), values.shape), times, others)

    def _note(self, limit: str, exceeding: Flags, values: Array, bounds: Array, times: Array,
              others: Integers | None = None) -> None:
        """Note the first of the values (M, 6) at their times that exceeds its bound."""
        if not exceeding.any():
            return
        n, leg = map(int, np.unravel_index(
            np.argmin(np.where(exceeding, times, np.inf)), exceeding.shape))
        exceedance = Exceedance(
            limit, leg, float(values[n, leg]), float(bounds[n, leg]),
            -1 if others is None else int(others[n, leg]))
        self.violations.append(Violation(
            float(times[n, leg]), LIMIT, f' {exceedance.words(self._joints)}', leg, limit))

    def _check_cubics(self, samples: Samples) -> None:
        """Check positions and rates of the drives between the samples."""
        times, durations, results = samples.times, samples.durations, samples.results
        kind = self._kind
        cubics = Cubics.between(results[:, kind.position.columns], results[:, kind.rate.columns],
                                durations[:, None])
        if np.isfinite(kind.period):
            cubics = self._without_jumps(samples, cubics)
        # Most are within the bounds of their control points, and those within the limits.
        low, high = cubics.bounds()
        with np.errstate(all='ignore'):  # samples that are not joined may be of the same time
            middle = np.abs(cubics.middle_rate() / durations[:, None])
        shortest, longest, fastest = (
            self._limits.thresholds[name] for name in (*kind.position_limits, kind.rate_limit))
        suspect = np.flatnonzero(samples.joined & (
            (low < shortest) | (high > longest) | (middle > fastest)).any(axis=1))
        if not len(suspect):
            return
        begin, duration = times[suspect, None], durations[suspect, None]
        cubics = cubics.selected(suspect)
        for fraction in cubics.extrema():
            positions = cubics.at(fraction)
            for limit in kind.position_limits:
                self._check_limit(limit, positions, begin + fraction * duration)
        fraction = cubics.rate_extremum()
        self._check_limit(
            kind.rate_limit, cubics.rate_at(fraction) / duration, begin + fraction * duration)

    def _without_jumps(self, samples: Samples, cubics: Cubics) -> Cubics:
        """Note positions that jump to the other end of a turn; return cubics without the jumps."""
        period = self._kind.period
        with np.errstate(invalid='ignore'):
            turns = samples.near[:, None] * np.rint((cubics.end - cubics.start) / period)
        if not turns.any():
            return cubics
        n, leg = map(int, np.argwhere(turns)[0])
        quantity = self._kind.position
        self.violations.append(Violation(
            float(samples.times[n + 1]), JUMPS,
            f' {self._joints[leg]}: {quantity.name} jumps from {cubics.start[n, leg]:.6g} to '
            f'{cubics.end[n, leg]:.6g} {quantity.unit}, half a turn from the middle of its range',
            leg))
        return cubics._replace(end=cubics.end - period * turns)

    def _check_singularities(self, samples: Samples) -> list[int]:
        """Check samples for singularities; return after which closer ones are needed."""
        self._check_conditions(samples.times, samples.results)
        return self._check_determinants(samples)

    def _check_conditions(self, times: Array, results: Array) -> None:
        condition = results[:, CONDITION]
        n = int(np.argmax(condition))
        if condition[n] > self.condition_number:
            self.condition_number, self.condition_time = float(condition[n]), float(times[n])
        if condition[n] >= self._stop:
            n = int(np.argmax(condition >= self._stop))
            self._singular(times[n], results[n], f'condition number {condition[n]:.4g} reaches '
                           f'singularity.stop_condition, {self._stop:g}')

    def _check_determinants(self, samples: Samples) -> list[int]:
        """Check whether det(J) crosses zero between samples; return where that is not clear."""
        times, durations, results = samples.times, samples.durations, samples.results
        near = samples.near
        determinants, condition = results[:, DETERMINANT], results[:, CONDITION]
        cubics = Cubics.between(determinants, results[:, DETERMINANT_RATE], durations)
        cubics = Cubics._make(each * np.sign(determinants[:-1]) for each in cubics)
        if (crossed := near & (cubics.end < 0.0)).any():
            n = int(np.argmax(crossed))
            self._singular(times[n] + cubics.selected(n).root() * durations[n], results[n],
                           'det(J) crosses zero')
        smaller = np.minimum(cubics.start, cubics.end)
        dips = np.flatnonzero(near & (cubics.end > 0.0) & (cubics.bounds()[0] < smaller))
        cubics, smaller = cubics.selected(dips), smaller[dips]
        lowest = np.fmin.reduce([smaller, *map(cubics.at, cubics.extrema())])
        # The condition number grows about as det(J) falls.
        predicted = np.maximum(condition[dips], condition[dips + 1]) * smaller
        here, there = np.abs(results[dips]), np.abs(results[dips + 1])
        loads = np.maximum(here, there) * (smaller / lowest)[:, None]
        unclear: list[int] = dips[(lowest < DIP * smaller) | ((lowest < smaller) & (
            (predicted >= self._stop * lowest) | self._exceed_known(loads[:, self._efforts])
            | self._may_exceed(loads)))].tolist()
        return unclear

    def _may_exceed(self, results: Array) -> Flags:
        """Return which rows of results (M, RESULT) exceed a limit of loads."""
        found = np.zeros(len(results), dtype=bool)
        for name in self._limits.of_loads:
            found |= self._limits.exceeds(name, results[:, LIMITS[name].columns]).any(axis=1)
        return found

    def _singular(self, time: float, result: Array, words: str) -> None:
        leg = int(np.argmax(result[UNIT_LOAD_FORCES]))
        self.violations.append(Violation(
            float(time), SINGULAR, f': {words}, worst for {self._joints[leg]}', leg))


def _of_legs(times: Array) -> Array:
    """Return times (M,) for each of the legs (M, 6)."""
    return np.broadcast_to(times[:, None], (len(times), 6))


def _angle(haversines: Array) -> Array:
    """Return angles [rad] of sin^2(angle / 2)."""
    angles: Array = 2.0 * np.arcsin(np.sqrt(np.clip(haversines, 0.0, 1.0)))
    return angles
