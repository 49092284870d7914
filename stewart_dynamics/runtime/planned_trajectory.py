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
Planned motions: a trajectory of the platform in, the legs' trajectory out, or why not.

A motion is refused as a whole where it breaks a limit or meets a singularity, at its points or
between them, in what the platform is meant to do there (``interpolation``) and in what the legs
do that a joint_trajectory_controller moves: it joins positions and velocities of a leg by
polynomials of third degree in time, efforts by straight lines.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, Integers, Six
from stewart_dynamics.mechanics import forward_kinematics
from stewart_dynamics.mechanics.interpolation import Cubics, Interpolation
from stewart_dynamics.mechanics.jit import COMPILED
from stewart_dynamics.mechanics.limits import Exceedance, LIMITS
from stewart_dynamics.mechanics.rotation import from_quaternion
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, MOTION, RATES, UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.trajectory import LegTrajectory, PlatformTrajectory
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.rejections import (
    frame_details, length_details, MALFORMED, NOT_FINITE, NOT_UNIT, OUT_OF_RANGE, WRONG_FRAME)
from stewart_dynamics.runtime.samples import unit_quaternions

INPUT, INPUT_TYPE = 'platform_trajectory', 'trajectory_msgs/msg/MultiDOFJointTrajectory'
OUTPUT, OUTPUT_TYPE = 'leg_trajectory', 'trajectory_msgs/msg/JointTrajectory'

MOST_POINTS = 100_000
# Points and samples between them that a motion may need.
MOST_SAMPLES = 1_000_000
# So many ways between points or samples at most are worked on between two yields: about a
# millisecond's work. Uncompiled, one takes a millisecond.
PIECE = 256 if COMPILED else 1

# Between two samples a point of the platform that is the characteristic length from its origin
# goes no farther than this part of that length, and its acceleration is no farther from a
# straight line than this [m/s^2], a hundredth of gravity.
_WAY = 0.01
_BEND = 0.1
# So much beyond a limit of length is none [m]: a machine that stands on its stop, its pose in
# doubles or in a message of fewer digits, may go away from it.
_LENGTH_TOLERANCE = 1e-9
# |det(J)| that falls between two samples below this part of what it is there is looked at more
# closely, in so many parts, down to this part of the way between two points.
_DIP = 0.9
_PARTS = 16
_CLOSEST = 1e-6

TIMES = 'time_from_start does not rise'
TOO_FAR = 'too far between points'
LIMIT = 'a limit is broken'
SINGULAR = 'a singularity is met'
TOO_MANY = 'more than can wait'


class Outcome(NamedTuple):
    """What has become of a trajectory."""

    message: str
    """In words, for people."""
    reason: str = ''
    """Why it was refused, a constant of this module or of ``setpoints``; empty: it was not."""
    answer: bytes = b''
    """A trajectory_msgs/JointTrajectory; empty where refused."""
    warning: bool = False
    """It comes within warn_condition."""
    values: tuple[tuple[str, str], ...] = ()
    """Keys with their units, and values."""


# Behind which points of a block samples are (M,), and how much of the way is done there (M,).
_Samples = tuple[Integers, Array]


class _Refused(Exception):

    def __init__(self, reason: str, words: str, values: tuple[tuple[str, str], ...] = ()) -> None:
        super().__init__(reason, words, values)
        self.outcome = Outcome(f'refused: {words}', reason, values=values)


def compile_ahead(parameters: Parameters) -> None:
    """Compile what the work on a trajectory calls: setpoints shall not wait for the first one."""
    platform, rows = StewartPlatform(parameters), np.zeros((1, MOTION))
    platform.solve(rows)
    forward_kinematics.twists(platform.machine, np.zeros((1, 6)), rows)
    codes, steps = np.empty(1, dtype=np.int64), np.empty(1, dtype=np.int64)
    forward_kinematics.poses(
        platform.machine, np.zeros((1, 6)), rows, codes, steps, np.empty(1))


def refused(reason: str, details: str) -> Outcome:
    """Return the outcome of a trajectory that is not worked on."""
    return _Refused(reason, f'{reason}: {details}').outcome


def answer(parameters: Parameters, wrench: Six, data: bytes) -> Iterator[Outcome | None]:
    """
    Yield None after each piece of the work, and at the end what has become of it.

    Parameters
    ----------
    parameters : Parameters
        They hold for all of it.
    wrench : (6,)
        Load on the platform at its origin, base axes [N, N m].
    data : bytes
        A trajectory_msgs/MultiDOFJointTrajectory as it came.

    """
    try:
        work = _Work(parameters, wrench, data)
        yield from work.read()
        yield from work.solve()
        yield work.outcome()
    except MalformedError as exc:
        yield refused(MALFORMED, str(exc))
    except _Refused as exc:
        yield exc.outcome


class _Trouble(NamedTuple):
    """Where a motion must not go."""

    time: float
    leg: int
    reason: str
    words: str


class _Work:
    """The work on one trajectory."""

    def __init__(self, parameters: Parameters, wrench: Six, data: bytes) -> None:
        self._message = PlatformTrajectory(data)
        frame, base_frame = self._message.frame, parameters['base_frame'].encode()
        if frame not in (b'', base_frame):
            raise _Refused(WRONG_FRAME, f'{WRONG_FRAME}: {frame_details(frame, base_frame)}')
        many = self._message.size
        if not 1 <= many <= MOST_POINTS:
            raise MalformedError(f'{many} points: must be 1 to {MOST_POINTS}')
        self._parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._wrench = np.array([wrench])
        self._answer = LegTrajectory(
            self._message.stamp, parameters['joints'], many, parameters['trajectory.effort'])
        self._checks = _Checks(parameters)
        self._legs_checks = _Checks(parameters)
        self._times = np.empty(many, dtype=np.int64)  # [ns]
        self._motions = np.empty((many, MOTION))
        self._quaternions = np.empty((many, 4))
        self._samples = 0

    def read(self) -> Iterator[None]:
        """Read the points, and refuse those that are none."""
        for first in range(0, len(self._times), PIECE):
            end = min(first + PIECE, len(self._times))
            points = self._message.points(first, end)
            self._read_times(first, end, points)
            numbers = np.column_stack([points['pose'], points['twist'], points['accel']])
            if not (finite := np.isfinite(numbers).all(axis=1)).all():
                n = int(np.argmin(finite))
                raise _Refused(NOT_FINITE, f'{NOT_FINITE}: points[{first + n}]: '
                               f'{tuple(numbers[n].tolist())}')
            quaternions, lengths, unit = unit_quaternions(numbers[:, 3:7])
            if not unit.all():
                n = int(np.argmin(unit))
                raise _Refused(NOT_UNIT, f'{NOT_UNIT}: points[{first + n}]: '
                               f'{length_details(float(lengths[n]))}')
            self._quaternions[first:end] = quaternions.T
            self._motions[first:end] = np.column_stack([
                numbers[:, :3], *from_quaternion(*quaternions), numbers[:, 7:]])
            yield

    def _read_times(self, first: int, end: int, points: NDArray[np.void]) -> None:
        if (late := points['nanosec'] >= 1_000_000_000).any():
            n = int(np.argmax(late))
            raise MalformedError(
                f'points[{first + n}]: time_from_start of {points["nanosec"][n]} ns: must be '
                'under 1000000000')
        times = self._times[first:end]
        times[:] = points['sec'] * np.int64(1_000_000_000) + points['nanosec']
        before = self._times[first - 1] if first else -1
        if (stuck := np.diff(times, prepend=before) <= 0).any():
            n = int(np.argmax(stuck))
            raise _Refused(TIMES, f'{TIMES}: points[{first + n}]: {times[n] * 1e-9:.9g} s, ' + (
                f'after {self._times[first + n - 1] * 1e-9:.9g} s' if first + n else
                'must be at least 0'))

    def solve(self) -> Iterator[None]:
        """Compute what the legs do, and refuse what they must not."""
        last = len(self._times) - 1
        for first in range(0, max(last, 1), PIECE):
            end = min(first + PIECE, last)
            yield from self._solve_block(first, end)
            if troubles := self._checks.troubles or self._legs_checks.troubles:
                # Of one time the singularity first: limits are broken because of it.
                raise self._in_trouble(min(troubles, key=lambda each: (
                    each.time, each.reason != SINGULAR, each)))

    def _solve_block(self, first: int, end: int) -> Iterator[None]:
        """Do so from one point to another, both among them."""
        block = slice(first, end + 1)
        motions, times = self._motions[block], _seconds(self._times[block])
        results = self._platform.solve(motions, self._wrench)
        lengths = results[:, LENGTHS]
        self._answer.put(
            first, self._message.points(first, end + 1),
            lengths - self._parameters['geometry.zero_length'],
            results[:, RATES],
            results[:, FORCES])
        durations = _seconds(np.diff(self._times[block]))
        with np.errstate(all='ignore'):
            between = Interpolation(durations, motions, self._quaternions[block])
            many = self._samples_between(first, between)
        legs = Cubics.between(lengths, results[:, RATES],
                              durations[:, None])
        near = many == 1.0
        dips = self._checks.take(times, durations, results, np.ones_like(near), near)
        self._count(_PARTS * len(dips))
        closer: deque[_Samples] = deque((np.full(_PARTS + 1, n), _IN_PARTS) for n in dips)
        coarse = _samples(many)
        while run := closer.popleft() if closer else next(coarse, None):
            yield
            which, part = run
            with np.errstate(all='ignore'):
                rows = between.at(which, part)
            joined = which[1:] == which[:-1]
            way = np.diff(part)
            at, after = times[which] + part * durations[which], way * durations[which[1:]]
            self._take_legs_way(at, after, legs.chosen(which), part, durations[which], rows)
            for n in self._checks.take(
                    at, after, self._platform.solve(rows, self._wrench), joined, joined):
                if way[n] > _CLOSEST:
                    self._count(_PARTS)
                    closer.append((np.full(_PARTS + 1, which[n]), part[n] + way[n] * _IN_PARTS))
        yield

    def _take_legs_way(self, times: Array, after: Array, legs: Cubics, part: Array,
                       durations: Array, rows: Array) -> None:
        """
        Check that the platform keeps clear of singularities where the legs' cubics lead it.

        Parameters
        ----------
        times, after : (M,), (M - 1,)
            When samples are, and from each to the next [s].
        legs, part, durations : Cubics of (M, 6), (M,), (M,)
            Of the way between points that each is on, how much is done, how long it takes [s].
        rows : (M, MOTION)
            Where the platform is meant to be.

        """
        poses, many = rows.copy(), len(rows)
        codes, steps = np.empty(many, dtype=np.int64), np.empty(many, dtype=np.int64)
        machine = self._platform.machine
        forward_kinematics.poses(
            machine, legs.at(part[:, None]), poses, codes, steps, np.empty(many))
        lost = np.flatnonzero(codes != forward_kinematics.FOUND)
        found = int(lost[0]) if len(lost) else many
        if found < many:
            self._legs_checks.lose(float(times[found]))
        if found:
            poses = poses[:found]
            forward_kinematics.twists(
                machine, legs.rate_at(part[:, None])[:found] / durations[:found, None], poses)
            self._legs_checks.take_singularities(
                times[:found], after[:found - 1], self._platform.solve(poses),
                after[:found - 1] > 0.0)

    def _samples_between(self, first: int, between: Interpolation) -> Array:
        """Return in how many parts the way from each point to the next is looked at."""
        arm = self._parameters['singularity.characteristic_length']
        many: Array = np.ceil(np.maximum(
            between.reach(arm) / (_WAY * arm), np.sqrt(between.bend(arm) / _BEND)))
        many = np.maximum(many, 1.0, dtype=float)
        if not (bounded := many <= MOST_SAMPLES).all():
            n = first + int(np.argmin(bounded))
            raise _Refused(TOO_FAR, f'{TOO_FAR}: points[{n}] and the next: more than '
                           f'{MOST_SAMPLES} samples are needed to check what lies between')
        self._count(int(many.sum()))
        return many

    def _count(self, samples: int) -> None:
        self._samples += samples
        if self._samples > MOST_SAMPLES:
            raise _Refused(TOO_FAR, f'{TOO_FAR}: more than {MOST_SAMPLES} samples are needed to '
                           'check what lies between')

    def outcome(self) -> Outcome:
        """Return the outcome of a trajectory that is not refused."""
        checks, joints = self._checks, self._parameters['joints']
        message = f'answered: {self._what()}'
        warn = self._parameters['singularity.warn_condition']
        warning = checks.condition >= warn
        if warning:
            message += (f', condition number {checks.condition:.4g} at '
                        f'{checks.condition_time:.3f} s is not below '
                        f'singularity.warn_condition, {warn:g}')
        values = [*self._values(),
                  ('worst condition number', f'{checks.condition:.6g}'),
                  ('its time (s)', f'{checks.condition_time:.3f}'),
                  ('largest force (N)', f'{checks.force:.6g}'),
                  ('its leg', joints[checks.force_leg])]
        if self._parameters['limits.force_max'] is not None:
            values.append(('largest force, of limits.force_max', f'{checks.load:.4g}'))
        return Outcome(message, answer=self._answer.message(), warning=warning,
                       values=tuple(values))

    def _in_trouble(self, trouble: _Trouble) -> _Refused:
        return _Refused(
            trouble.reason, f'at {trouble.time:.3f} s{trouble.words}',
            (*self._values(), ('refused at (s)', f'{trouble.time:.6g}'),
             *[('leg', self._parameters['joints'][trouble.leg])][:trouble.leg + 1]))

    def _what(self) -> str:
        points = len(self._times)
        return f'{points} point{"s" * (points > 1)} over {self._duration:.6g} s'

    def _values(self) -> tuple[tuple[str, str], ...]:
        return (('points', str(len(self._times))), ('duration (s)', f'{self._duration:.9g}'))

    @property
    def _duration(self) -> float:
        """From the first point to the last [s]."""
        return float(self._times[-1] - self._times[0]) * 1e-9


def _seconds(nanoseconds: Integers) -> Array:
    return np.multiply(nanoseconds, 1e-9, dtype=float)


def _samples(many: Array) -> Iterator[_Samples]:
    """
    Yield pieces of the samples that part the way from each point to the next (N,) in so many.

    Both points are among them, where there is more than one part: behind which point, and how
    much of the way is done.
    """
    which = np.flatnonzero(many > 1.0)
    ends = np.cumsum(many[which] + 1.0)
    begins = ends - many[which] - 1.0
    samples = int(ends[-1]) if len(which) else 0
    # The last of a piece is the first of the next one: something lies between two samples.
    for first in range(0, samples - 1, PIECE):
        index = np.arange(first, min(first + PIECE + 1, samples), dtype=float)
        of = np.searchsorted(ends, index, side='right')
        yield which[of], (index - begins[of]) / many[which[of]]


_IN_PARTS: Array = np.linspace(0.0, 1.0, _PARTS + 1, dtype=np.float64)


class _Checks:
    """Finds where samples of a motion, in the order of time, break a limit or are singular."""

    def __init__(self, parameters: Parameters) -> None:
        self.troubles: list[_Trouble] = []
        self.condition, self.condition_time = 0.0, 0.0
        self.force, self.force_leg, self.load = -1.0, 0, 0.0
        self._joints = parameters['joints']
        self._shortest, self._longest, self._fastest, self._strongest = (
            np.full(6, -math.inf if name == 'limits.length_min' else math.inf)
            if parameters[name] is None else parameters[name] for name in LIMITS)
        self._low, self._high = (
            self._shortest - _LENGTH_TOLERANCE, self._longest + _LENGTH_TOLERANCE)
        self._stop = min(parameters['singularity.stop_condition'], UNSOLVABLE_CONDITION)

    def take(self, times: Array, durations: Array, results: Array, joined: Flags,
             near: Flags) -> list[int]:
        """
        Note what is wrong with samples and between them.

        Parameters
        ----------
        times : (M,)
            [s]
        durations : (M - 1,)
            From each to the next [s].
        results : (M, RESULT)
            As ``inverse_dynamics`` has them.
        joined : (M - 1,)
            The next one follows it in the motion.
        near : (M - 1,)
            So near to the next that det(J) between them follows from theirs.

        Returns behind which samples det(J) has to be looked at more closely.

        """
        finite = np.isfinite(results).all(axis=1)
        if not finite.all():
            n = int(np.argmin(finite))
            self.troubles.append(_Trouble(float(times[n]), -1, OUT_OF_RANGE, f': {OUT_OF_RANGE}'))
            if n == 0:
                return []
            times, results = times[:n], results[:n]
            durations, joined, near = durations[:n - 1], joined[:n - 1], near[:n - 1]
        self._take_forces(results)
        self._take_limits(times, results)
        self._take_cubics(times, durations, results, joined)
        return self.take_singularities(times, durations, results, near)

    def lose(self, time: float) -> None:
        """Note that no pose has the lengths of the legs, clear of singularities."""
        self.troubles.append(_Trouble(
            time, -1, SINGULAR, ": the legs' way leads to no pose on this side of a singularity"))

    def take_singularities(self, times: Array, durations: Array, results: Array,
                           near: Flags) -> list[int]:
        """Do what ``take`` does, for singularities alone."""
        self._take_conditions(times, results)
        return self._take_determinants(times, durations, results, near)

    def _take_conditions(self, times: Array, results: Array) -> None:
        condition = results[:, CONDITION]
        n = int(np.argmax(condition))
        if condition[n] > self.condition:
            self.condition, self.condition_time = float(condition[n]), float(times[n])
        if condition[n] >= self._stop:
            n = int(np.argmax(condition >= self._stop))
            self._singular(times[n], results[n], f'condition number {condition[n]:.4g} reaches '
                           f'singularity.stop_condition, {self._stop:g}')

    def _take_forces(self, results: Array) -> None:
        """Note the largest."""
        forces = np.abs(results[:, FORCES])
        largest = float(forces.max())
        if largest > self.force:
            self.force, self.force_leg = largest, int(np.argmax(forces)) % 6
        self.load = max(self.load, float((forces / self._strongest).max()))

    def _take_limits(self, times: Array, results: Array) -> None:
        """Check the samples themselves."""
        lengths, rates, forces = (results[:, at] for at in (
            LENGTHS, RATES, FORCES))
        for limit, values, bounds, broken in (
                ('limits.length_min', lengths, self._shortest, lengths < self._low),
                ('limits.length_max', lengths, self._longest, lengths > self._high),
                ('limits.velocity_max', rates, self._fastest, np.abs(rates) > self._fastest),
                ('limits.force_max', forces, self._strongest, np.abs(forces) > self._strongest)):
            self._take_broken(limit, values, bounds, broken, np.broadcast_to(
                times[:, None], broken.shape))

    def _take_cubics(self, times: Array, durations: Array, results: Array,
                     joined: Flags) -> None:
        """Check polynomials of third degree that have the samples' lengths and rates."""
        lengths, rates = (results[:, at] for at in (LENGTHS, RATES))
        cubics = Cubics.between(lengths, rates, durations[:, None])
        # Most are within their control points, and those within the limits.
        low, high = cubics.hull()
        with np.errstate(all='ignore'):  # samples that are not joined may be of the same time
            middle = np.abs(cubics.middle_rate() / durations[:, None])
        suspect = np.flatnonzero(joined & ((low < self._low) | (high > self._high)
                                           | (middle > self._fastest)).any(axis=1))
        if not len(suspect):
            return
        begin, duration = times[suspect, None], durations[suspect, None]
        cubics = cubics.chosen(suspect)
        for part in cubics.extremes():
            values = cubics.at(part)
            for limit, bounds, broken in (
                    ('limits.length_min', self._shortest, values < self._low),
                    ('limits.length_max', self._longest, values > self._high)):
                self._take_broken(limit, values, bounds, broken, begin + part * duration)
        part = cubics.fastest()
        values = cubics.rate_at(part) / duration
        self._take_broken('limits.velocity_max', values, self._fastest,
                          np.abs(values) > self._fastest, begin + part * duration)

    def _take_determinants(self, times: Array, durations: Array, results: Array,
                           near: Flags) -> list[int]:
        """Check whether det(J) passes zero between samples; return where that is not clear."""
        determinants = results[:, DETERMINANT]
        condition = results[:, CONDITION]
        cubics = Cubics.between(determinants, results[:, DETERMINANT_RATE], durations)
        cubics = Cubics._make(each * np.sign(determinants[:-1]) for each in cubics)
        if (crossed := near & (cubics.end < 0.0)).any():
            n = int(np.argmax(crossed))
            self._singular(times[n] + cubics.chosen(n).zero() * durations[n], results[n],
                           'det(J) passes zero')
        smaller = np.minimum(cubics.start, cubics.end)
        dips = np.flatnonzero(near & (cubics.end > 0.0) & (cubics.hull()[0] < smaller))
        cubics, smaller = cubics.chosen(dips), smaller[dips]
        lowest = np.fmin.reduce([smaller, *map(cubics.at, cubics.extremes())])
        foretold = np.maximum(condition[dips], condition[dips + 1]) * smaller
        found: list[int] = dips[(lowest < _DIP * smaller) | (
            (lowest < smaller) & (foretold >= self._stop * lowest))].tolist()
        return found

    def _take_broken(self, limit: str, values: Array, bounds: Array, broken: Flags,
                     times: Array) -> None:
        """Note the first of the places (M, 6) where a limit is broken."""
        if not broken.any():
            return
        n, leg = np.unravel_index(np.argmin(np.where(broken, times, np.inf)), broken.shape)
        excess = Exceedance(limit, int(leg), float(values[n, leg]), float(bounds[leg]))
        self.troubles.append(_Trouble(
            float(times[n, leg]), excess.leg, LIMIT, f' {excess.words(self._joints)}'))

    def _singular(self, time: float, result: Array, words: str) -> None:
        leg = int(np.argmax(result[UNIT_LOAD_FORCES]))
        self.troubles.append(_Trouble(
            float(time), leg, SINGULAR, f': {words}, worst for {self._joints[leg]}'))
