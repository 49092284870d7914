# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Planned trajectories: motion of the platform in, lengths, rates and forces of the legs out.

With cranks these are angles, speeds and torques.

A trajectory is rejected as a whole if it exceeds a limit or meets a singularity, at its points or
between them. Both the planned motion of the platform (``interpolation``) and the motion of the
legs under a joint_trajectory_controller are checked: the controller joins positions and velocities
of a leg by cubics in time, efforts by straight lines.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers, NANOSECOND, SECOND, Stamps
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array, optional_array, wrong_type
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.kinematics import (
    forward_kinematics, leg_clearance)
from stewart_dynamics.mechanics.rows import (
    ANGULAR_VELOCITY, consecutive, LINEAR_VELOCITY, WRENCH)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.planned.checks import Checks, Samples, Violation
from stewart_dynamics.planned.interpolation import Cubics, Interpolation
from stewart_dynamics.planned.sampling import Sampling


def _no_legs() -> Array:
    return np.empty((0, 6))


@dataclass(frozen=True, eq=False)
class PlannedTrajectory:
    """
    The result of the check of a planned trajectory.

    Legs of another kind have other quantities: those of telescopic legs are empty or nan for
    cranks, and vice versa.
    """

    accepted: bool
    message: str
    """In words: 'accepted: 201 points over 2 s' or 'rejected: at 0.055 s leg_3: rate ...'."""
    points: int
    duration: float
    """From the first point to the last [s]."""
    reason: str = ''
    """Reason of the rejection, a constant of ``planned_trajectory`` or ``planned.checks``."""
    time: float = math.nan
    """Time of the first violation [s]."""
    leg: int | None = None
    """Leg of the violation, 0 to 5; None if it is not of a leg."""
    limit: str = ''
    """The limit that is exceeded, 'limits.velocity_max'; empty if no limit is exceeded."""
    lengths: Array = field(default_factory=_no_legs, repr=False)
    """At the points (N, 6) [m]; (0, 6) where rejected."""
    rates: Array = field(default_factory=_no_legs, repr=False)
    """At the points (N, 6) [m/s], + extends; (0, 6) where rejected."""
    forces: Array = field(default_factory=_no_legs, repr=False)
    """Actuator forces at the points (N, 6) [N], + pushes; (0, 6) where rejected."""
    angles: Array = field(default_factory=_no_legs, repr=False)
    """Of cranks, at the points (N, 6) [rad]; (0, 6) where rejected."""
    speeds: Array = field(default_factory=_no_legs, repr=False)
    """Of cranks, at the points (N, 6) [rad/s]; (0, 6) where rejected."""
    torques: Array = field(default_factory=_no_legs, repr=False)
    """Of cranks, at the points (N, 6) [N m], + drives the angle up; (0, 6) where rejected."""
    warning: bool = False
    """Accepted, but the condition number reaches singularity.warn_condition."""
    condition_number: float = math.nan
    """The largest, at points and between them; nan where rejected."""
    condition_time: float = math.nan
    """Time of the largest condition number [s]."""
    force: float = math.nan
    """The largest absolute force, at points and between them [N]; nan where rejected."""
    force_leg: int | None = None
    """Leg of the largest force, 0 to 5."""
    load: float = math.nan
    """The largest absolute force, or torque, as a part of its limit; 0 without that limit."""
    torque: float = math.nan
    """The largest absolute torque of a crank, at points and between them [N m]."""
    torque_leg: int | None = None
    """Leg of the largest torque, 0 to 5."""
    lever: float = math.nan
    """
    The smallest lever of a crank by the length of the crank, at points and between them: how near
    the trajectory comes to a dead centre.
    """
    lever_time: float = math.nan
    """Time of the smallest lever [s]."""
    lever_leg: int | None = None
    """Leg of the smallest lever, 0 to 5."""


# Points and samples between them that a trajectory may need.
MOST_SAMPLES = 1_000_000
# Maximum number of intervals between points or samples that are processed between two yields:
# about half a millisecond of work.
PIECE = 256
# Where nothing waits meanwhile, larger pieces take less time in all.
_LARGE_PIECE = 16 * PIECE
# Upper end of the range of time_from_start [s].
_TIMES_END = 2 ** 31

# Number of parts into which closer samples divide an interval, and the smallest part
# relative to the interval between two points.
_PARTS = 16
# The legs' cubics move a platform joint between two samples by no more than this factor times the
# larger of its speeds there.
_SPEED = 2.0
_CLOSEST = 1e-6

NOT_INCREASING = 'time_from_start is not strictly increasing'
TOO_FAR = 'points too far apart'

_DRIVES = consecutive(6, 6, 6)  # positions, rates and efforts
# Index of the point before each sample in a block (M,), and fraction of the interval (M,).
_Places = tuple[Integers, Array]


def check_planned_trajectory(platform: StewartPlatform, times: ArrayLike, motion: Motion,
                             wrench: ArrayLike | None = None, base: BaseMotion | None = None,
                             ) -> PlannedTrajectory:
    """
    Check a planned trajectory against limits and singularities, and compute leg motion and forces.

    The node does the same for ``~/platform_trajectory``. At the points lengths, rates and forces
    are those of ``inverse_dynamics``, to the last bit. Between two points the platform is taken to
    move by quintic polynomials of position and rotation vector through pose, twist and
    acceleration of both; and the legs by cubics through their lengths and rates, as
    joint_trajectory_controller moves them, or by those of angles and speeds. Both are checked.

    Parameters
    ----------
    platform : StewartPlatform
        Its parameters have the limits and the thresholds of the condition number.
    times : (N,)
        Times of the points [s], from 0 and strictly increasing; rounded to nanoseconds.
    motion : Motion of shape (N,)
        Pose, twist and acceleration of the platform at the points.
    wrench : (6,), optional
        Force [N] and moment [N m] that act on the platform at its origin, constant, base axes;
        None by default.
    base : BaseMotion of shape () or (N,), optional
        Motion of the base: constant, or at the points with linear interpolation between them;
        at rest by default.

    Returns
    -------
    PlannedTrajectory
        Lengths, rates and forces of the legs, or angles, speeds and torques of cranks; or the
        reason of the rejection.

    Raises
    ------
    MotionError
        Shapes do not fit, numbers are not finite or times not strictly increasing.

    """
    if not isinstance(platform, StewartPlatform):
        raise wrong_type('platform', platform, 'a StewartPlatform')
    if not isinstance(motion, Motion):
        raise wrong_type('motion', motion, 'a Motion')
    if len(motion.shape) != 1 or not motion.shape[0]:
        raise MotionError(f'motion: shape {motion.shape}: must be (N,), of N points')
    seconds = as_array('times', times, motion.shape)
    if seconds.shape != motion.shape:
        raise MotionError(f'times: shape {seconds.shape}: must be {motion.shape}')
    outside = (seconds < 0.0) | (seconds >= _TIMES_END)
    if outside.any():
        n = int(np.argmax(outside))
        raise MotionError(f'times[{n}]: {seconds[n]} s: must be 0 to {_TIMES_END} s')
    stamps = np.rint(seconds * SECOND).astype(np.int64)
    if (stuck := first_not_increasing(stamps)) is not None:
        raise MotionError(f'times[{stuck}]: {seconds[stuck]} s after {seconds[stuck - 1]} s: must '
                          'be strictly increasing, by at least a nanosecond')
    load = optional_array('wrench', wrench, (WRENCH,))
    if load.shape != (WRENCH,):
        raise MotionError(f'wrench: shape {load.shape}: must be ({WRENCH},)')
    if base is not None:
        if not isinstance(base, BaseMotion):
            raise wrong_type('base', base, 'a BaseMotion')
        if base.shape not in ((), motion.shape):
            raise MotionError(f'base: shape {base.shape}: must be () or {motion.shape}')
    *_, result = check_in_pieces(platform, stamps, motion.rows, load,
                                 None if base is None else base.rows, _LARGE_PIECE)
    assert result is not None  # the last one
    return result


def check_in_pieces(platform: StewartPlatform, times: Stamps, rows: Array, wrench: Array,
                    bases: Array | None = None, piece: int = PIECE,
                    ) -> Iterator[PlannedTrajectory | None]:
    """
    Yield None after each piece of the work, and the result at the end.

    Parameters
    ----------
    platform : StewartPlatform
        Its parameters hold for all of the work.
    times : (N,)
        [ns], strictly increasing.
    rows : (N, MOTION)
        Rows of motion, finite, their rotations checked.
    wrench : (6,)
        External wrench at the platform's origin, base axes [N, N m].
    bases : (BASE,) or (N, BASE), optional
        Rows of the base's motion; at rest by default.
    piece : int
        Maximum number of intervals that are processed between two yields.

    """
    work = _Work(platform, times, rows, wrench, bases, piece)
    try:
        yield from work.check()
    except _ViolationError as exc:
        yield work.rejected(exc.violation)
    else:
        yield work.accepted()


def first_not_increasing(times: Stamps, before: int = -1) -> int | None:
    """Return the index of the first time [ns] that is not after the one before it."""
    stuck = np.diff(times, prepend=before) <= 0
    return int(np.argmax(stuck)) if stuck.any() else None


class _ViolationError(Exception):

    def __init__(self, violation: Violation) -> None:
        super().__init__(violation)
        self.violation = violation


class _Block(NamedTuple):
    """N consecutive points of a trajectory that are checked together, and the motion between."""

    first: int
    """Index of the first of them."""
    points: Samples
    between: Interpolation
    legs: Cubics
    """Motion of the legs under a controller in each interval (N - 1, 6)."""
    speeds: Array
    """
    Bound of the speed of a platform joint, or corner of its plate, in each interval (N - 1,)
    [m/s]; zero if the clearance is not checked.
    """

    def times(self, which: Integers, fraction: Array) -> Array:
        """Return the times of samples [s]."""
        times: Array = self.points.times[which] + fraction * self.points.durations[which]
        return times


class _Work:
    """The work on one trajectory; see ``check_in_pieces``."""

    def __init__(self, platform: StewartPlatform, times: Stamps, rows: Array, wrench: Array,
                 bases: Array | None, piece: int) -> None:
        self._platform, self._times, self._motions = platform, times, rows
        self._parameters = platform.parameters
        kind = platform.parameters.leg_kind
        self._drives = kind.position, kind.rate, kind.effort
        self._wrench = wrench[None]
        self._bases = bases
        self._piece = piece
        self._legs = np.empty((len(times), 18))
        self._checks = Checks(self._parameters)
        self._legs_checks = Checks(self._parameters)
        self._sampling = Sampling(self._parameters)
        self._samples = 0
        clearance = leg_clearance.clearance_to_check(self._parameters)
        self._reach = clearance.reach if clearance else None
        self._warms = self._parameters.drive.temperature_rise_max is not None

    def check(self) -> Iterator[None]:
        """Compute motion and forces of the legs; raise _ViolationError at a violation."""
        last = len(self._times) - 1
        for first in range(0, max(last, 1), self._piece):
            yield from self._check_block(first, min(first + self._piece, last))
            if violations := self._checks.violations or self._legs_checks.violations:
                raise _ViolationError(min(violations, key=lambda each: each.order))

    def _check_block(self, first: int, end: int) -> Iterator[None]:
        """Check from one point to another, both included."""
        block, parts = self._block(first, end)
        dips = self._checks.check(block.points)
        if self._warms:
            yield from self._check_windings(block)
        self._count(_PARTS * len(dips))
        closer: deque[_Places] = deque((np.full(_PARTS + 1, n), _IN_PARTS) for n in dips)
        coarse = _samples(parts, self._piece)
        while places := closer.popleft() if closer else next(coarse, None):
            yield
            which, fraction = places
            step = np.diff(fraction)
            for n in self._check_samples(block, which, fraction):
                if step[n] > _CLOSEST:
                    self._count(_PARTS)
                    closer.append(
                        (np.full(_PARTS + 1, which[n]), fraction[n] + step[n] * _IN_PARTS))
        yield

    def _block(self, first: int, end: int) -> tuple[_Block, Array]:
        """Return the points, and the number of parts in which each interval is sampled."""
        block = slice(first, end + 1)
        motions, durations = self._motions[block], _seconds(np.diff(self._times[block]))
        results = self._solve(motions, np.arange(first, end + 1), 0.0)
        for here, of_drives in zip(_DRIVES, self._drives, strict=True):
            self._legs[block, here] = results[:, of_drives.columns]
        with np.errstate(all='ignore'):
            between = Interpolation(durations, motions)
            parts = self._parts_between(first, durations, between, results)
            speeds = (np.zeros_like(durations) if self._reach is None
                      else between.bounds(self._reach).speed)
        points = Samples(_seconds(self._times[block]), durations, motions, results,
                         np.ones(len(durations), dtype=bool), parts == 1.0, speeds * durations)
        positions, rates = (results[:, each.columns] for each in self._drives[:2])
        legs = Cubics.between(positions, rates, durations[:, None])
        return _Block(first, points, between, legs, speeds), parts

    def _check_samples(self, block: _Block, which: Integers, fraction: Array) -> list[int]:
        """Check samples between points; return after which closer ones are needed."""
        with np.errstate(all='ignore'):
            motions = block.between.at(which, fraction)
        joined = which[1:] == which[:-1]
        durations = np.diff(fraction) * block.points.durations[which[1:]]
        samples = Samples(
            block.times(which, fraction), durations, motions,
            self._solve(motions, block.first + which, fraction), joined, joined,
            block.speeds[which[1:]] * durations)
        return sorted({*self._checks.check(samples), *self._check_legs_path(
            block, which, fraction, samples)})

    def _check_windings(self, block: _Block) -> Iterator[None]:
        """Check the temperatures of windings, with a fixed number of samples in each interval."""
        intervals = len(block.speeds)
        together = max(1, self._piece // _PARTS)
        for n in range(0, intervals, together):
            which = np.repeat(np.arange(n, min(n + together, intervals)), _PARTS)
            fraction = np.tile(_IN_PARTS[:-1], len(which) // _PARTS)
            which, fraction = np.append(which, which[-1]), np.append(fraction, 1.0)
            with np.errstate(all='ignore'):
                motions = block.between.at(which, fraction)
            self._checks.check_windings(block.times(which, fraction), motions, self._solve(
                motions, block.first + which, fraction))
            yield

    def _solve(self, rows: Array, which: Integers, fraction: Array | float) -> Array:
        """Return the results of rows of motion, so far between the points ``which`` and next."""
        bases = self._bases
        if bases is not None:
            if bases.ndim == 1:
                bases = bases[None]
            elif np.ndim(fraction):
                bases = bases[which] + np.reshape(fraction, (-1, 1)) * (
                    bases[which + 1] - bases[which])
            else:
                bases = bases[which]
        return self._platform.solve(rows, self._wrench, bases)

    def _check_legs_path(self, block: _Block, which: Integers, fraction: Array,
                         samples: Samples) -> list[int]:
        """
        Check singularities and joints along the platform motion due to the legs' cubics.

        Return the indices of samples after which the clearance needs closer samples.
        """
        legs, durations = block.legs.selected(which), block.points.durations[which, None]
        # a leg has no cubic from or to a point that it does not reach
        known = np.isfinite(legs.start).all(axis=1) & np.isfinite(legs.end).all(axis=1)
        count = len(which) if known.all() else int(np.argmin(known))
        if not count:
            return []
        if count < len(which):
            samples, which, fraction = samples.until(count), which[:count], fraction[:count]
            legs, durations = legs.selected(slice(count)), durations[:count]
        poses = samples.motions.copy()
        codes, steps = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
        hexapod = self._platform.structure
        forward_kinematics.poses(
            hexapod, legs.at(fraction[:, None]), poses, codes, steps, np.empty(count))
        lost = np.flatnonzero(codes != forward_kinematics.FOUND)
        if len(lost):
            count = int(lost[0])
            self._legs_checks.no_pose(float(samples.times[count]))
        if not count:
            return []
        poses = poses[:count]
        forward_kinematics.twists(
            hexapod, legs.rate_at(fraction[:, None])[:count] / durations[:count], poses)
        found = samples.until(count)
        ways = np.zeros(count - 1)
        if self._reach is not None:
            with np.errstate(all='ignore'):
                speeds = (np.linalg.norm(poses[:, LINEAR_VELOCITY], axis=1)
                          + self._reach * np.linalg.norm(poses[:, ANGULAR_VELOCITY], axis=1))
                ways = _SPEED * np.maximum(speeds[:-1], speeds[1:]) * found.durations
        joined = found.durations > 0.0
        return self._legs_checks.check_path(found._replace(
            motions=poses, results=self._platform.solve(poses), joined=joined, near=joined,
            ways=ways))

    def _parts_between(self, first: int, durations: Array, between: Interpolation,
                       results: Array) -> Array:
        """Return the number of parts in which each interval of points is sampled."""
        bases = self._bases
        if bases is not None:
            bases = bases[None] if bases.ndim == 1 else bases[first:first + len(results)]
        _, rates, efforts = (results[:, each.columns] for each in self._drives)
        largest = float(np.fmax.reduce(
            np.abs(efforts), axis=None, initial=self._checks.force))
        motions = self._motions[first:first + len(results)]
        drive_rates = self._platform.drive_rates(motions, rates)
        parts = self._sampling.parts(
            durations, between, motions, results, drive_rates, bases, largest)
        if not (bounded := parts <= MOST_SAMPLES).all():
            n = first + int(np.argmin(bounded))
            raise self._too_far(f'{TOO_FAR}: points[{n}] and the next: more', n)
        self._count(int(parts.sum()))
        return parts

    def _count(self, samples: int) -> None:
        self._samples += samples
        if self._samples > MOST_SAMPLES:
            raise self._too_far(f'{TOO_FAR}: more', None)

    def _too_far(self, words: str, point: int | None) -> _ViolationError:
        time = math.nan if point is None else float(self._times[point]) * NANOSECOND
        return _ViolationError(Violation(
            time, TOO_FAR, f'{words} than {MOST_SAMPLES} samples are needed to check what lies '
            'between'))

    def accepted(self) -> PlannedTrajectory:
        """Return the result of a trajectory without violations."""
        checks, points = self._checks, len(self._times)
        message = f'accepted: {points} point{"s" * (points > 1)} over {self._duration:.6g} s'
        warn = self._parameters.singularity.warn_condition
        if warning := checks.condition_number >= warn:
            message += (f', condition number {checks.condition_number:.4g} at '
                        f'{checks.condition_time:.3f} s is not below '
                        f'singularity.warn_condition, {warn:g}')
        found: dict[str, Any] = {
            of_drives.field: self._legs[:, here]
            for here, of_drives in zip(_DRIVES, self._drives, strict=True)}
        effort = self._parameters.leg_kind.effort.name
        found |= {effort: checks.force, f'{effort}_leg': checks.force_leg}
        if math.isfinite(checks.lever):
            joint = self._parameters.joints[checks.lever_leg]
            message += (f', smallest lever {checks.lever:.4g} of its largest: {joint} at '
                        f'{checks.lever_time:.3f} s')
            found |= {'lever': checks.lever, 'lever_time': checks.lever_time,
                      'lever_leg': checks.lever_leg}
        return PlannedTrajectory(
            True, message, points, self._duration, warning=warning,
            condition_number=checks.condition_number, condition_time=checks.condition_time,
            load=checks.load, **found)

    def rejected(self, violation: Violation) -> PlannedTrajectory:
        """Return the result of a trajectory with a violation."""
        when = '' if violation.reason == TOO_FAR else f'at {violation.time:.3f} s'
        checks = self._checks
        # a leg meets the limit of its lever, or another one, before it cannot reach
        more = (f'; at {checks.missing_time:.3f} s {checks.missing_words}'
                if checks.missing_words and checks.missing_time != violation.time else '')
        if checks.possible_error:
            more += f'; {checks.possible_error}'
        return PlannedTrajectory(
            False, f'rejected: {when}{violation.words}{more}', len(self._times), self._duration,
            violation.reason, violation.time, violation.leg, violation.limit)

    @property
    def _duration(self) -> float:
        """From the first point to the last [s]."""
        return float(self._times[-1] - self._times[0]) * NANOSECOND


def _seconds(nanoseconds: Stamps) -> Array:
    return np.multiply(nanoseconds, NANOSECOND, dtype=float)


def _samples(parts: Array, piece: int) -> Iterator[_Places]:
    """
    Yield pieces of the samples that divide each interval of points (N,) into equal parts.

    An interval of more than one part includes both of its points; others have no samples.
    """
    which = np.flatnonzero(parts > 1.0)
    ends = np.cumsum(parts[which] + 1.0)
    begins = ends - parts[which] - 1.0
    samples = int(ends[-1]) if len(which) else 0
    # The last of a piece is the first of the next one: something lies between two samples.
    for first in range(0, samples - 1, piece):
        index = np.arange(first, min(first + piece + 1, samples), dtype=float)
        of = np.searchsorted(ends, index, side='right')
        yield which[of], (index - begins[of]) / parts[which[of]]


_IN_PARTS: Array = np.linspace(0.0, 1.0, _PARTS + 1, dtype=np.float64)
