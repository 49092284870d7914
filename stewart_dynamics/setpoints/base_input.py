# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motion of the base, from its topics: the row that is valid at a setpoint's stamp.

Base samples arrive at their own rate. Between the stamps of two received samples the row is
interpolated linearly, number by number. After the stamp of the last received sample it is
extrapolated along the line through the last two samples, by at most the time between them. The
motion of the base is unknown if the newest sample that is not newer than the setpoint is missing
or older than ``base.timeout``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Integers, SECOND, Stamps
from stewart_dynamics.core.binding import function, record
from stewart_dynamics.mechanics.frames.base_motion import row_of_motion, row_of_pose
from stewart_dynamics.mechanics.rows import BASE, GRAVITY, NO_BASE
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import BY_IMU, MOVING, Parameters
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.consistency import Consistency, inconsistencies, Mistake
from stewart_dynamics.setpoints.inconsistency import QUANTITIES, RATES
from stewart_dynamics.setpoints.input_messages import BASE_ACCEL, BASE_SOURCES, BASE_TWIST
from stewart_dynamics.setpoints.measured_gravity import MeasuredGravity
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.setpoints.sample_joining import Joined, SampleJoining

# Maximum number of samples kept, for setpoints that had to wait.
_KEPT = 1000

_Row = tuple[float, ...]

_NOTHING = Joined(
    np.empty(0, dtype=np.int64), np.empty((0, 0)), np.empty(0, dtype=np.int64), {}, {})


class BaseInput:
    """Follows the topics of the base."""

    def __init__(self, parameters: Parameters, rejections: Rejections,
                 noticed: Callable[[str], object]) -> None:
        source = parameters.base.source
        self.topics = BASE_SOURCES[source]  # topics of the base; empty if the base is fixed
        self.joining = SampleJoining(
            self.topics, None if source == BY_IMU else parameters.world_frame,
            parameters.setpoint.sync_tolerance, parameters.base.timeout, rejections,
            lambda text: noticed(f'base: {text}'))
        """Joins the samples of the topics."""
        self._timeout = round(parameters.base.timeout * SECOND)
        self._restart = round(parameters.setpoint.timeout * SECOND)
        gravity: Any = tuple(parameters.gravity.tolist())

        def of_pose(stamp: int, values: Any) -> _Row:
            return row_of_pose(values[3:12], gravity)

        def of_motion(stamp: int, values: Any) -> _Row:
            return row_of_motion(
                values[3:12], values[18:21], values[15:18], values[21:24], gravity)

        self._row_of: Callable[[int, _Row], _Row] = (
            _OfImu(parameters) if source == BY_IMU else
            of_motion if source == MOVING else of_pose)
        self._samples: deque[tuple[int, _Row]] = deque(maxlen=_KEPT)
        self._gravity = MeasuredGravity(parameters) if self.topics else None
        self._stamps = ArrivalStamps()
        self.consistency = Consistency(
            parameters.singularity.characteristic_length,
            (parameters.world_frame, parameters.base_frame)) if source == MOVING else None
        """The check of the samples' twists and accelerations; None without samples."""

    @property
    def last(self) -> tuple[int, _Row] | None:
        """Return stamp [ns] and row (BASE,) of the last sample."""
        return self._samples[-1] if self._samples else None

    def mistakes(self, ever: bool) -> list[Mistake]:
        """Return the likely mistakes in the motion of the base, as ``Setpoints.mistakes`` does."""
        found = inconsistencies(self.consistency, ever, dict.fromkeys(
            QUANTITIES, BASE_TWIST) | dict.fromkeys(RATES, BASE_ACCEL))
        if self._gravity is not None:
            of_gravity = self._gravity.found.values() if ever else [self._gravity.present]
            found += [Mistake(self.topics[0], *each) for each in of_gravity if each]
        found += self._stamps.mistakes(ever, self.topics[:1])
        return found

    def at_rest(self, known: bool) -> Array | None:
        """Return the row (BASE,) at rest, last gravity, nan if unknown; None if base is fixed."""
        if not self.topics:
            return None
        row = np.zeros(BASE)
        row[GRAVITY] = self._samples[-1][1][GRAVITY] if self._samples and known else np.nan
        return row

    def take(self, topic: str, data: bytes, now: Callable[[], int]) -> bool:
        """Use a message, see ``Setpoints.take``; return whether it completes a sample."""
        sample = self.joining.take(topic, data, now)
        if sample is None:
            return False
        if sample.restart or (self._samples and sample.stamp <= self._samples[-1][0]):
            self._samples.clear()
        self._note(sample.stamp, self._row_of(sample.stamp, sample.values), sample.values)
        if self.consistency is not None:
            self.consistency.noted.append((sample.stamp, sample.values, sample.restart))
        return True

    def _note(self, stamp: int, row: _Row, values: _Row) -> None:
        self._samples.append((stamp, row))
        self._stamps.add(stamp, values)
        if self._gravity is not None:
            self._gravity.add(stamp, row)

    def at(self, stamp: int) -> _Row | None:
        """Return the row (BASE,) at a stamp [ns], nan if unknown; None if the base is fixed."""
        if not self.topics:
            return None
        samples = self._samples
        n = len(samples) - 1
        while n > 0 and samples[n - 1][0] > stamp:
            n -= 1
        if n < 0:
            return NO_BASE
        at, row = samples[n]
        if stamp - at > self._timeout:
            return NO_BASE
        if n == 0:
            return row if at <= stamp else NO_BASE
        before, row_before = samples[n - 1]
        if at > stamp and stamp - before > self._timeout:
            return NO_BASE
        part = min(float(stamp - at) / float(at - before), 1.0)
        return tuple([now + (now - then) * part
                      for now, then in zip(row, row_before, strict=True)])

    def restarted(self, stamp: int) -> None:
        """Discard samples later than the stamp [ns] of a setpoint that is a restart."""
        if self._samples and self._samples[-1][0] > stamp + self._restart:
            self.restart('before setpoints restarted')

    def restart(self, why: str) -> None:
        """Follow samples of any time from now on, and none before."""
        self._samples.clear()
        self.joining.restart(why)

    def join_many(self, messages: Messages, places: Mapping[str, Integers]) -> Joined | None:
        """Join messages, see ``SampleJoining.join_many``."""
        return self.joining.join_many(messages, places) if self.topics else _NOTHING

    def accept(self, joined: Joined, places: Mapping[str, Integers], stamps: Stamps,
               completed: Integers) -> Array | None:
        """
        Continue after the samples that ``join_many`` has joined.

        places (K,): as for ``join_many``.
        stamps, completed (N,): stamps of setpoints [ns], and the index of the message that
            completed each.
        Returns the rows at the setpoints (N, BASE), see ``at``; None if the base is fixed.
        """
        if not self.topics:
            return None
        self.joining.accept(joined, places)
        old = len(self._samples)
        motions = [tuple(values) for values in joined.motions.tolist()]
        new = [(stamp, self._row_of(stamp, values)) for stamp, values in zip(
            joined.stamps.tolist(), motions, strict=True)]
        kept = [*self._samples, *new]
        for each, motion in zip(new, motions, strict=True):
            self._note(*each, motion)
        if self.consistency is not None and new:
            self.consistency.add(
                joined.stamps, joined.motions, np.zeros(len(new), dtype=bool))
        rows = np.full((len(stamps), BASE), np.nan)
        if not kept:
            return rows
        at, values = np.array([stamp for stamp, _ in kept]), np.array([row for _, row in kept])
        # Number of samples received, newest usable sample, oldest sample kept.
        come = old + np.searchsorted(joined.places, completed)
        newest = np.minimum(come - 1, np.searchsorted(at, stamps, side='right'))
        oldest = np.maximum(come - _KEPT, 0)
        newest = np.maximum(newest, oldest)
        known = (come > 0) & (stamps - at[newest] <= self._timeout) & (
            (newest > oldest) | (at[newest] <= stamps))
        before = np.maximum(newest - 1, oldest)
        known &= (at[newest] <= stamps) | (stamps - at[before] <= self._timeout)
        sample, before = newest[known], before[known]
        step = (at[sample] - at[before]).astype(float)
        part = np.minimum(np.divide(
            (stamps[known] - at[sample]).astype(float), step, out=np.zeros(len(step)),
            where=step > 0.0), 1.0)
        now, then = values[sample], values[before]
        rows[known] = np.where(step[:, None] > 0.0, now + (now - then) * part[:, None], now)
        return rows


class _OfImu:
    """Converts readings of an IMU to rows; the filter is in ``core/imu.c``."""

    def __init__(self, parameters: Parameters) -> None:
        given = parameters.base.imu
        imu: Any = np.zeros((), record('imu_mounting'))
        imu['position'], imu['rate'] = given.position, 2.0 * math.pi * given.cutoff
        imu['timeout'] = round(parameters.base.timeout * SECOND)
        function('stewart_rotation')(given.orientation, imu['rotation'])
        self._base: Array = np.empty(BASE)
        self._filter: Any = np.zeros((), record('imu_filter'))
        self._read = function('read_imu').bound(imu)

    def __call__(self, stamp: int, values: Any) -> _Row:
        self._read(stamp, np.array(values[:6]), self._filter, self._base)
        return tuple(self._base.tolist())
