# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motions that grow or are played faster, and the motion between their samples."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, cast, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY,
    POSITION, ROTATION, TWIST)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.planned.interpolation import (
    Interpolation, motion_of, rates_of_vector, rotation_vector)
from stewart_dynamics.planned.planned_trajectory import MOST_SAMPLES
from stewart_dynamics.planned.sampling import Sampling

LARGEST = 2.0 ** 20  # a factor that nothing limits grows by doubling up to this one
# Rounds in which the sample that limits is found between two, and samples of a round.
_ZOOMS, _NEAR = 6, 33
# Largest number of samples between those of a motion, and of those that are computed at once.
_MOST_OF_ALL, _BLOCK = 50_000_000, 100_000

Answer = TypeVar('Answer')


class Deviations:
    """
    The deviations of a motion's samples from a pose.

    center: one sample, at rest.
    rows (N, MOTION): rows of motion.

    changes (N, 3, 6): displacement and rotation vector, their rates and accelerations.
    """

    def __init__(self, center: Motion, rows: Array) -> None:
        self._position = center.position
        self._quaternion = to_quaternion(center.rotation[None])
        quaternions = to_quaternion(rows[:, ROTATION].reshape(-1, 3, 3))
        turn = rotation_vector(np.broadcast_to(self._quaternion, quaternions.shape), quaternions)
        turn_rate, turn_acceleration = rates_of_vector(
            turn, rows[:, ANGULAR_VELOCITY], rows[:, ANGULAR_ACCELERATION])
        self.changes = np.stack([
            np.concatenate(each, axis=1) for each in (
                (rows[:, POSITION] - self._position, turn),
                (rows[:, LINEAR_VELOCITY], turn_rate),
                (rows[:, LINEAR_ACCELERATION], turn_acceleration))], axis=1)

    def at(self, factors: Array | float, which: Any = slice(None)) -> Array:
        """Return rows of motion (N, MOTION) with deviations larger by factors () or (N,)."""
        value, rate, acceleration = np.moveaxis(
            np.asarray(factors)[..., None, None] * self.changes[which], 1, 0)
        rows = motion_of(np.broadcast_to(self._quaternion, (len(value), 4)), value, rate,
                         acceleration)
        rows[:, POSITION] += self._position
        return rows


def faster(rows: Array, factor: float) -> Array:
    """Return rows of motion that is played faster by a factor."""
    rows = rows.copy()
    rows[..., TWIST] *= factor
    rows[..., ACCELERATION] *= factor ** 2
    return rows


def _check_constant(wrench: ArrayLike | None, base: BaseMotion | None) -> None:
    """Raise MotionError for a wrench or base that is not constant."""
    for name, shape in (('wrench', np.shape(wrench)[:-1] if wrench is not None else ()),
                        ('base', base.shape if isinstance(base, BaseMotion) else ())):
        if shape:
            raise MotionError(f'{name}: shape {shape}: must be a single one for a motion with '
                              'times')


def timed(times: ArrayLike, motion: Any, ask: Callable[[Motion, float], Answer],
          at_limit: Callable[[float], tuple[StewartPlatform, Array, float]],
          wrench: ArrayLike | None = None, base: BaseMotion | None = None) -> Answer:
    """
    Return the answer to a question about a motion, between its samples, too.

    Where the motion at the limit of its samples may exceed a limit between them, it has the
    samples of a planned trajectory.

    times (N,): times of the samples [s], strictly increasing.
    ask: takes samples and a factor that need not be exceeded; returns an Extent.
    at_limit: takes the value of an answer; returns the hexapod, rows of the motion (N, MOTION),
        and how much faster it is played.
    wrench, base: external wrench and motion of the base, constant.
    """
    check_kind(motion, Motion)
    _check_constant(wrench, base)
    seconds = as_array('times', times, motion.shape or (1,))
    if len(motion.shape) != 1 or len(motion) < 2 or seconds.shape != motion.shape:
        raise MotionError(f'times: shape {seconds.shape}, motion: shape {motion.shape}: must both '
                          'be (N,), of at least two samples')
    durations = np.diff(seconds)
    if not (durations > 0.0).all():
        raise MotionError(f'times[{int(np.argmin(durations > 0.0)) + 1}]: must be strictly '
                          'increasing')
    between = Interpolation(durations, motion.rows)

    def rows_at(where: Array) -> Array:
        which = np.minimum(where.astype(np.int64), len(durations) - 1)
        return between.at(which, where - which)

    found: Any = ask(motion, math.inf)
    value = float(found.value)
    if value == 0.0:
        return cast('Answer', found._replace(time=float(seconds[found.sample])))
    platform, rows, speed = at_limit(value if value < LARGEST else 1.0)
    results = platform.inverse_dynamics(
        Motion.of_rows(rows), wrench, base, singular='nan').rows
    with np.errstate(all='ignore'):  # numbers that overflow need too many samples
        parts = Sampling(platform.parameters, 0.0).parts(
            durations / speed, Interpolation(durations / speed, rows), rows, results,
            platform.drive_rates(rows, results[:, platform.parameters.leg_kind.rate.columns]),
            None if base is None else base.rows[None], math.inf)
    near = parts <= MOST_SAMPLES  # not where they are nan
    if not near.all():
        n = int(np.argmin(near))
        raise MotionError(f'motion: samples {n} and {n + 1} too far apart: more than '
                          f'{MOST_SAMPLES} are needed between them')
    if parts.sum() > _MOST_OF_ALL:
        raise MotionError(f'motion: {parts.sum():.0f} samples are needed between its own, at most '
                          f'{_MOST_OF_ALL} are possible: ask for parts of the motion')
    counts = parts.astype(np.int64)
    first = np.cumsum(counts) - counts
    where = np.append(
        np.repeat(np.arange(len(counts)), counts)
        + (np.arange(counts.sum()) - np.repeat(first, counts)) / np.repeat(parts, counts),
        float(len(counts)))
    width, best, at = 1.0, found, float(found.sample or 0)
    for turn in range(_ZOOMS + 1):
        new = where[where % 1.0 != 0.0]
        for begin in range(0, len(new), _BLOCK):
            block = new[begin:begin + _BLOCK]
            answer: Any = ask(Motion.of_rows(rows_at(block)), best.value)
            if answer.sample is not None and answer.value <= best.value:
                best, at = answer, float(block[answer.sample])
        if best.sample is None:
            return cast('Answer', best)
        if turn == 0:
            n = int(np.searchsorted(where, at))
            width = float(max(np.diff(where[max(n - 1, 0):n + 2]).max(), 1e-9))
        else:
            width *= 2.0 / (_NEAR - 1)
        where = np.unique(np.clip(at + width * np.linspace(-1.0, 1.0, _NEAR), 0.0,
                                  len(durations)))
    sample = min(int(at), len(durations))
    last = min(sample, len(durations) - 1)
    return cast('Answer', best._replace(
        sample=sample, time=float(seconds[last] + (at - last) * durations[last])))
