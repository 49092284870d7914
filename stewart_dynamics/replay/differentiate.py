# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Twist and acceleration of recorded poses, from the splines of ``smoothing_spline``."""

from __future__ import annotations

from collections import Counter
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, SECOND, Stamps
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, POSE, POSITION,
    ROTATION)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.replay.smoothing_spline import banded_solver, FEWEST, smoothing_spline
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.input_messages import LARGEST
from stewart_dynamics.setpoints.step import Batch

# Poses in a window.
WINDOW = 4096

TOO_FAR = f'position beyond {LARGEST:g} m'
TOO_FAST = 'turns faster than the cut-off frequency can follow'

# Poses closer in time than this begin another segment: the system is singular there [ns].
_NEAREST = 100

# Range in which poses affect the spline, in multiples of 1 / cut-off and, for sparse poses, in
# poses: the effect in an interpolating spline decays by a factor of 0.27 per pose.
_REACH = 5.0
_REACH_IN_POSES = 32
# The condition of the system grows with its fourth power: the relative error is 4e-6 here.
_MOST_POSES_IN_A_CUTOFF = 2000
# The proposed cut-off frequency bridges steps that are longer by this factor.
_JITTER = 1.25
# Smoothing makes a quaternion shorter than one.
_SHORTEST_QUATERNION = 0.5


class Deviation(NamedTuple):
    """
    Deviation of the smoothed poses from the recorded ones: noise, and motion above the cut-off.

    Poses within 1 / cutoff of the ends of their segment are left out.
    """

    position_rms: float  # [m]
    position_max: float
    angle_rms: float  # [rad]
    angle_max: float


def differentiator(parameters: Parameters, options: Options) -> Differentiator | None:
    """Return what computes the motion of poses by a cut-off frequency; None without one."""
    # A period of the cut-off frequency is the longest step that splines can bridge.
    return None if options.cutoff is None else Differentiator(
        options.cutoff, max(parameters.setpoint.timeout, 1.0 / options.cutoff))


class Differentiator:
    """
    Computes twist and acceleration of poses, batch by batch, in bounded memory.

    The poses themselves are unchanged, bit for bit: leg lengths, det(J) and limits are those of
    the recording, and a cut-off that is too low cannot hide an exceeded limit. Twist and
    acceleration are those of the smoothed pose at the same time, derived exactly and without
    phase shift; ``deviation`` is the difference between the two poses.

    A jump back in time or a gap ends a segment; no spline continues across it. The results do
    not depend, bit for bit, on how the poses are split into batches.

    cutoff: frequency whose amplitude is reduced to 1/sqrt(2) [Hz].
    gap: longest time between two poses of a segment [s].
    window: poses in a window.

    Raises StewartError if the cut-off is not a positive number, or scipy is not installed.
    """

    def __init__(self, cutoff: float, gap: float, window: int = WINDOW) -> None:
        if not (math.isfinite(cutoff) and cutoff > 0.0):
            raise StewartError(f'cut-off frequency: {cutoff} Hz: must be a positive number')
        banded_solver()
        self.cutoff = cutoff
        self.left_out: Counter[str] = Counter()
        """Number of setpoints left out, without twist and acceleration, by reason."""
        self.near_ends = 0  # setpoints within 1 / cutoff of an end of their segment
        self._gap = round(gap * SECOND)
        self._step = 0.0  # median time between the first poses [ns]
        self._reach = round(_REACH / cutoff * SECOND)
        self._window = window
        self._pending: list[Batch] = []
        self._held = 0
        self._due = window
        # of the segment of the first pending setpoint: how many were returned
        # already and stay for the next window's sake, and its first stamp
        self._given = 0
        self._begun = 0  # [ns]
        self.stamps = ArrivalStamps()
        """The check of the stamps: uneven ones become accelerations."""
        # of a setpoint that was left out, by its spline and before it
        self._restart = self._restart_before = False
        self._gathered = 0
        self._squares = np.zeros(2)
        self._largest = np.zeros(2)

    @property
    def deviation(self) -> Deviation:
        """Deviation of the smoothed poses from the recorded ones so far."""
        position, angle = np.sqrt(self._squares / max(self._gathered, 1)).tolist()
        return Deviation(position, float(self._largest[0]), angle, float(self._largest[1]))

    def add_setpoints(self, batch: Batch) -> Batch:
        """
        Add setpoints that have only poses; return those that are done, with their motion.

        batch: stamps increase, except at jumps back in time. Positions beyond LARGEST are left
            out: they would disturb the splines of all poses around them.
        """
        near = np.all(np.abs(batch.motions[:, POSITION]) <= LARGEST, axis=1)
        self.stamps.add_readings(batch.stamps, batch.motions[:, POSE])
        if self._restart_before or not near.all():
            restarts, self._restart_before = _restarts_of(
                batch.restarts, near, self._restart_before)
            self.left_out[TOO_FAR] += int(np.count_nonzero(~near))
            batch = batch.chosen(near).replaced(restarts=restarts)
        self._pending.append(batch)
        self._held += len(batch.stamps)
        # not at every batch: joining the pending ones takes time
        return self._done() if self._held >= self._due else Batch.joined([])

    def finish(self) -> Batch:
        """Return the remaining setpoints, with their motion, after the last batch."""
        done = self._done(ended=True)
        self._pending, self._held = [], 0
        return done

    @property
    def too_few(self) -> str:
        """Return the reason for leaving out poses of a segment that is too short."""
        text = (f'fewer than {FEWEST} poses without a gap, a time of more than '
                f'{self._gap * NANOSECOND:.3g} s between two poses: no acceleration can be '
                'computed')
        if self._step <= self._gap:
            return text
        cutoff = _rounded_down(SECOND / (_JITTER * self._step))
        return (f'{text}; poses are {self._step * NANOSECOND:.3g} s apart: --cutoff {cutoff:g} '
                'makes the gap longer, for a motion that is slower than that')

    def notices(self) -> list[str]:
        """Return notices to the user about the results."""
        off = self.deviation
        lines = [
            f'twist and acceleration are those of smoothing splines through the poses, cut-off '
            f'frequency {self.cutoff:g} Hz; the splines deviate from the poses by '
            f'{off.position_rms * 1e3:.3g} mm and {math.degrees(off.angle_rms):.3g} degrees '
            f'RMS, {off.position_max * 1e3:.3g} mm and {math.degrees(off.angle_max):.3g} '
            'degrees at most']
        if self.near_ends:
            lines.append(
                f'{self.near_ends} setpoints are within {1.0 / self.cutoff:.3g} s of the first '
                'or last pose or of a gap: their accelerations are too small')
        return lines

    def _done(self, ended: bool = False) -> Batch:
        """Process every window for which all poses are there."""
        held = Batch.joined(self._pending)
        stamps = held.stamps
        steps = np.diff(stamps)
        if not self._step and len(steps):
            self._step = float(np.median(steps[:max(self._window - 1, 1)]))
        begins = [0, *(np.flatnonzero(
            held.restarts[1:] | (steps < _NEAREST) | (steps > self._gap)) + 1).tolist()]
        ends = [*begins[1:], len(stamps)]
        done: list[Batch] = []
        for begin, end in zip(begins, ends, strict=True):
            segment = held.chosen(slice(begin, end))
            closed = ended or end < len(stamps)
            done += self._windows(segment, closed)
            if closed:
                self._given = 0
            else:
                self._keep(segment)
        return Batch.joined(done)

    def _windows(self, segment: Batch, closed: bool) -> list[Batch]:
        """Process a segment as far as possible; a closed one to its end."""
        stamps = segment.stamps
        if closed and not self._given and len(stamps) < FEWEST:
            if len(stamps):
                self.left_out[self.too_few] += len(stamps)
                self._restart = self._restart or bool(segment.restarts.any())
            return []
        if not self._given:
            self._begun = int(stamps[0])
        self._check_rate((stamps[:self._window] - stamps[0]) * NANOSECOND)
        done = []
        while self._given < len(stamps):
            end = min(self._given + self._window, len(stamps))
            after = self._end_of_reach(stamps, end - 1)
            if not closed and (end < self._given + self._window or after > len(stamps)):
                break
            part = slice(self._begin_of_reach(stamps, self._given), min(after, len(stamps)))
            # the step rejects numbers that overflow
            with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
                done.append(self._differentiate(segment, part, slice(self._given, end)))
            self._given = end
        return done

    def _keep(self, segment: Batch) -> None:
        """Keep the poses that the next window of an open segment needs."""
        begin = self._begin_of_reach(segment.stamps, self._given)
        self._pending = [segment.chosen(slice(begin, None))]
        self._given -= begin
        self._held = len(segment.stamps) - begin
        self._due = self._held + self._window // 2

    def _begin_of_reach(self, stamps: Stamps, at: int) -> int:
        """Return the first pose that affects this one."""
        before = int(np.searchsorted(stamps, int(stamps[at]) - self._reach))
        return max(0, min(before - 1, at - _REACH_IN_POSES))

    def _end_of_reach(self, stamps: Stamps, at: int) -> int:
        """Return the end of the poses that affect this one; may exceed those that are there."""
        after = int(np.searchsorted(stamps, int(stamps[at]) + self._reach, side='right'))
        return max(after + 1, at + _REACH_IN_POSES)

    def _differentiate(self, segment: Batch, part: slice, core: slice) -> Batch:
        """Return the setpoints of a core with the motion of the spline through a larger part."""
        stamps, motions = segment.stamps[part], segment.motions[part]
        times = (stamps - stamps[0]) * NANOSECOND
        self._check_rate(times)
        quaternions = rotations.to_quaternion(motions[:, ROTATION].reshape(-1, 3, 3))
        flips = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0
        quaternions[1:][np.logical_xor.accumulate(flips)] *= -1.0
        spline = smoothing_spline(
            times, np.concatenate([motions[:, POSITION], quaternions], axis=1), self.cutoff)
        inner = slice(core.start - part.start, core.stop - part.start)
        values, rates, accelerations = (each[inner] for each in spline)

        turn, turn_rate, turn_acceleration = (each[:, 3:] for each in (
            values, rates, accelerations))
        square = np.sum(turn ** 2, axis=-1, keepdims=True)
        followed = ~(square[:, 0] < _SHORTEST_QUATERNION ** 2)
        # of u = |u| q: the vector part of u' u^-1 is that of q' q^-1, half the angular velocity;
        # that of u' times the conjugate of u' is zero
        omega = 2.0 * _vector_of_quotient(turn_rate, turn) / square
        alpha = (2.0 * _vector_of_quotient(turn_acceleration, turn) / square
                 - 2.0 * np.sum(turn * turn_rate, axis=-1, keepdims=True) / square * omega)
        given = segment.chosen(core)
        out = np.empty_like(given.motions)
        out[:, POSE] = given.motions[:, POSE]
        out[:, LINEAR_VELOCITY], out[:, LINEAR_ACCELERATION] = rates[:, :3], accelerations[:, :3]
        out[:, ANGULAR_VELOCITY], out[:, ANGULAR_ACCELERATION] = omega, alpha

        time = SECOND / self.cutoff
        near = (given.stamps - self._begun < time) | (segment.stamps[-1] - given.stamps < time)
        self.near_ends += int(np.count_nonzero(followed & near))
        known = followed & ~near & np.isfinite(out).all(axis=1)
        self._gather(values[known, :3] - out[known, POSITION], turn[known],
                     quaternions[inner][known])
        return self._followed(given, out, followed)

    def _check_rate(self, times: Array) -> None:
        if len(times) < _MOST_POSES_IN_A_CUTOFF:
            return
        rate = 1.0 / float(np.median(np.diff(times)))
        if rate > self.cutoff * _MOST_POSES_IN_A_CUTOFF:
            raise StewartError(
                f'cut-off frequency: {self.cutoff:g} Hz: must be at least '
                f'{rate / _MOST_POSES_IN_A_CUTOFF:.3g} Hz where poses come at {rate:.6g} Hz, '
                f'a {_MOST_POSES_IN_A_CUTOFF}th of it')

    def _gather(self, off: Array, turn: Array, recorded: Array) -> None:
        """Add deviations of positions, and of quaternions of any length, from recorded ones."""
        angle = 2.0 * np.arctan2(np.linalg.norm(_vector_of_quotient(turn, recorded), axis=-1),
                                 np.sum(turn * recorded, axis=-1))
        distances = np.stack([np.linalg.norm(off, axis=-1), angle])
        self._gathered += len(off)
        self._squares += np.sum(distances ** 2, axis=1)
        self._largest = np.maximum(self._largest, np.max(distances, axis=1, initial=0.0))

    def _followed(self, given: Batch, motions: Array, followed: Flags) -> Batch:
        """Leave out setpoints that the spline could not follow; keep a restart among them."""
        self.left_out.update({TOO_FAST: n} if (n := int(np.count_nonzero(~followed))) else {})
        restarts, self._restart = _restarts_of(given.restarts, followed, self._restart)
        if n:
            given, motions = given.chosen(followed), motions[followed]
        return given.replaced(motions, restarts)


def _restarts_of(restarts: Flags, kept: Flags, waiting: bool = False) -> tuple[Flags, bool]:
    """
    Return the restarts of those setpoints (N,) that are kept, and whether one waits for the next.

    A restart that is left out passes to the next setpoint that is kept; one was already waiting
    or not. The step does so for those that it cannot answer.
    """
    of_kept = np.cumsum(restarts)[kept] + waiting
    still = np.count_nonzero(restarts) + waiting > of_kept.max(initial=0)
    return np.diff(of_kept, prepend=0) > 0, bool(still)


def _rounded_down(value: float) -> float:
    """Return a positive number rounded down to two significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / unit) * unit


def _vector_of_quotient(a: Array, b: Array) -> Array:
    """Return the vector part of a times the conjugate of b, of quaternions x y z w (N, 4)."""
    return (b[:, 3:] * a[:, :3] - a[:, 3:] * b[:, :3] - np.cross(a[:, :3], b[:, :3]))
