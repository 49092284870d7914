# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motions from rest to rest, and the approach from the present pose to the first point of a motion.

Both are quintic polynomials of position and rotation vector (``interpolation``): a straight line
and a rotation about one axis where both ends are at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, SECOND
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import optional_array, wrong_type
from stewart_dynamics.mechanics.frames.base_motion import base_rows, BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.limits import limits_of, OF_MOTORS
from stewart_dynamics.mechanics.rows import MOTION, POSE, WRENCH
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.planned.interpolation import Interpolation
from stewart_dynamics.planned.planned_trajectory import check_in_pieces

# Points of a motion per second.
RATE = 100.0
MOST_POINTS = 100_000
# Share of the limit of rates that an approach uses; without that limit, characteristic lengths
# per second by which drives move platform joints at the best.
_SPEED = 0.5
_SPEED_WITHOUT_LIMIT = 0.1
# Factor that lengthens a duration which exceeds limits of rate, force or motors; most trials.
_SLOWER, _MOST_TRIALS = 1.5, 12


class TimedMotion(NamedTuple):
    """A motion with its times."""

    times: Array
    """(N,) [s], from 0."""
    motion: Motion
    """Of shape (N,)."""


def rest_to_rest(start: Pose | Motion, end: Pose | Motion, duration: float, rate: float = RATE,
                 ) -> TimedMotion:
    """
    Return a motion between two poses, at rest and without acceleration at both ends.

    The position moves along a straight line and the rotation about one axis by the smaller angle,
    both as 10 u^3 - 15 u^4 + 6 u^5 with u = t / duration.

    Parameters
    ----------
    start, end : Pose or Motion of one sample
        Twists and accelerations are ignored.
    duration : float
        [s]
    rate : float
        Points per second; the last one is at the duration.

    Raises
    ------
    MotionError
        The poses are not single ones, or duration and rate not positive or for too many points.

    """
    return _quintic(_row('start', start, POSE.stop), _row('end', end, POSE.stop), duration, rate)


def approach(platform: StewartPlatform, start: Pose | Motion, end: Pose | Motion,
             wrench: ArrayLike | None = None, base: BaseMotion | None = None,
             rate: float = RATE) -> TimedMotion:
    """
    Return a motion within all limits from rest in a pose to the first point of a motion.

    It takes half of ``limits.velocity_max``, or ``limits.speed_max`` of cranks, and longer where
    forces, torques or motors would exceed their limits. Its points are 1 / rate apart, as a stream
    of setpoints needs them.

    Parameters
    ----------
    platform : StewartPlatform
        Its parameters have the limits.
    start : Pose or Motion of one sample
        Present pose of the platform, at rest.
    end : Pose or Motion of one sample
        First point of the motion, with twist and acceleration of a Motion.
    wrench, base
        As in ``check_planned_trajectory``, constant.
    rate : float
        Points per second.

    Raises
    ------
    MotionError
        The motion exceeds a limit or meets a singularity at any speed.

    """
    if not isinstance(platform, StewartPlatform):
        raise wrong_type('platform', platform, 'a StewartPlatform')
    load = optional_array('wrench', wrench, (WRENCH,))
    bases = base_rows(base)
    for name, array in (('wrench', load), ('base', bases)):
        if array.ndim != 1:
            raise MotionError(f'{name}: shape {array.shape[:-1]}: must be a single one')
    *_, found = approach_in_pieces(platform, _row('start', start, POSE.stop),
                                   _row('end', end, MOTION), load, bases, rate)
    assert found is not None  # the last one
    return found


def approach_in_pieces(platform: StewartPlatform, start: Array, end: Array, wrench: Array,
                       base: Array | None = None, rate: float = RATE,
                       ) -> Iterator[TimedMotion | None]:
    """
    Yield None after each piece of the work, and the result of ``approach`` at the end.

    Start and end are rows of motion (MOTION,), the wrench (WRENCH,), the base (BASE,).
    """
    duration, message = _first_duration(platform, start, end), ''
    known = limits_of(platform.parameters)
    for _ in range(_MOST_TRIALS):
        duration = math.ceil(duration * rate - 1e-9) / rate
        found = _quintic(start, end, duration, rate)
        result = None
        for result in check_in_pieces(platform, np.rint(found.times * SECOND).astype(np.int64),
                                      found.motion.rows, wrench, base):
            if result is None:
                yield None
        assert result is not None  # the last one
        if result.accepted:
            yield found
            return
        message = f'approach over {duration:.3g} s: {result.message}'
        if result.limit not in (*known.rates, *known.loads, *OF_MOTORS):
            break
        duration *= _SLOWER
    raise MotionError(message)


def _first_duration(platform: StewartPlatform, begin: Array, finish: Array) -> float:
    """Return the time that the rates of the drives need."""
    p = platform.parameters
    kind = p.leg_kind
    at_rest = finish.copy()
    at_rest[POSE.stop:] = 0.0
    part = np.linspace(0.0, 1.0, 65)
    between = Interpolation(np.ones(1), np.stack([begin, at_rest]))
    rates = np.abs(platform.solve(between.at(np.zeros(65, dtype=np.int64), part))[
        :, kind.rate.columns])
    rates[~np.isfinite(rates)] = 0.0  # the check rejects poses that a leg does not reach
    limit = p[kind.rate_limit]
    fastest = (_SPEED_WITHOUT_LIMIT * p.singularity.characteristic_length / kind.reach(p)
               if limit is None else _SPEED * limit)
    return max(float(np.nan_to_num((rates / fastest).max())), 2.0 / RATE)


def _quintic(begin: Array, finish: Array, duration: float, rate: float) -> TimedMotion:
    for name, value in (('duration', duration), ('rate', rate)):
        if not (math.isfinite(value) and value > 0.0):
            raise MotionError(f'{name}: {value}: must be more than 0')
    intervals = max(math.ceil(duration * rate - 1e-9), 1)
    if intervals >= MOST_POINTS:
        raise MotionError(
            f'duration: {duration:g} s at {rate:g} Hz: at most {MOST_POINTS} points')
    part: Array = np.linspace(0.0, 1.0, intervals + 1, dtype=np.float64)
    rows = Interpolation(np.array([duration]), np.stack([begin, finish])).at(
        np.zeros(intervals + 1, dtype=np.int64), part)
    times: Array = duration * part
    return TimedMotion(times, Motion.of_rows(rows))


def _row(name: str, sample: Pose | Motion, numbers: int) -> Array:
    """Return the row (MOTION,) of a sample, with its first numbers."""
    if not isinstance(sample, Pose | Motion):
        raise wrong_type(name, sample, 'a Pose or a Motion')
    if sample.shape:
        raise MotionError(f'{name}: shape {sample.shape}: must be a single sample')
    row = np.zeros(MOTION)
    given = sample.rows[:numbers]
    row[:len(given)] = given
    return row
