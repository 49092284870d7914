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

"""Motions that grow or are played faster, and the motion between their samples."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, cast, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.platform_arguments import check_kind
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY,
    POSITION, ROTATION, TWIST)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.planned.interpolation import (
    Interpolation, motion_of, rates_of_vector, rotation_vector)
from stewart_dynamics.planned.sampling import Sampling
from stewart_dynamics.planned.trajectory import MOST_SAMPLES

# Steps of a factor up to the first limit of the path; of a step that may exceed a limit; of a
# bisection.
_STEPS, _CLOSER, _BISECTIONS = 64, 16, 60
# A factor without a limit of the path grows by doubling up to this one.
_LARGEST = 2.0 ** 20
# Rounds in which the sample that limits is found between two, and samples of a round.
_ZOOMS, _NEAR = 6, 33

Answer = TypeVar('Answer')


class Deviations:
    """
    The deviations of a motion's samples from a pose.

    Parameters
    ----------
    center : Motion of one sample
        At rest.
    rows : (N, MOTION)
        Rows of motion.

    """

    def __init__(self, center: Motion, rows: Array) -> None:
        self._position = center.position
        self._quaternion = to_quaternion(center.rotation[None])
        quaternions = to_quaternion(rows[:, ROTATION].reshape(-1, 3, 3))
        turn = rotation_vector(np.broadcast_to(self._quaternion, quaternions.shape), quaternions)
        turn_rate, turn_acceleration = rates_of_vector(
            turn, rows[:, ANGULAR_VELOCITY], rows[:, ANGULAR_ACCELERATION])
        self.value = np.concatenate([rows[:, POSITION] - self._position, turn], axis=1)
        self._rate = np.concatenate([rows[:, LINEAR_VELOCITY], turn_rate], axis=1)
        self._acceleration = np.concatenate(
            [rows[:, LINEAR_ACCELERATION], turn_acceleration], axis=1)

    def at(self, factor: float, which: Any = slice(None)) -> Array:
        """Return rows of motion (N, MOTION) with deviations larger by a factor."""
        rows = motion_of(np.broadcast_to(self._quaternion, (len(self.value[which]), 4)),
                         factor * self.value[which], factor * self._rate[which],
                         factor * self._acceleration[which])
        rows[:, POSITION] += self._position
        return rows


def faster(rows: Array, factor: float) -> Array:
    """Return rows of motion that is played faster by a factor."""
    rows = rows.copy()
    rows[..., TWIST] *= factor
    rows[..., ACCELERATION] *= factor ** 2
    return rows


def first_exit(ratios: Callable[[float, Any], Array], most: float,
               ) -> tuple[float, int, int] | None:
    """
    Return the first factor up to ``most`` at which a ratio leaves [-1, 1], its sample and column.

    Parameters
    ----------
    ratios : callable
        Takes a factor and samples; returns ratios of them (N, M).
    most : float
        May be infinite.

    """
    every = slice(None)
    step = most / _STEPS if most < _LARGEST else 1.0 / _STEPS
    low, here = 0.0, ratios(0.0, every)
    if (np.abs(here) > 1.0).any():
        return 0.0, *_largest(here)
    before = here
    while low < min(most, _LARGEST):
        high = min(low + step, most)
        there = ratios(high, every)
        # a parabola through three of its values has its extreme at most this far above two
        bow = np.abs(there - 2.0 * here + before)
        near = np.maximum(np.abs(here), np.abs(there)) + 0.25 * bow
        which = np.flatnonzero((near > 1.0).any(axis=1))
        if len(which):
            found = _within(ratios, low, high, which)
            if found is not None:
                return found
        before, here, low = here, there, high
        if most >= _LARGEST and low >= 64.0 * step:
            step *= 2.0
            before = here  # the last step was shorter
    return None


def _within(ratios: Callable[[float, Any], Array], low: float, high: float, which: Integers,
            ) -> tuple[float, int, int] | None:
    """Return the first exit of some samples between two factors."""
    begin = low
    for end in np.linspace(low, high, _CLOSER + 1)[1:].tolist():
        if (np.abs(ratios(end, which)) > 1.0).any():
            low, high = begin, end
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                if (np.abs(ratios(middle, which)) > 1.0).any():
                    high = middle
                else:
                    low = middle
            sample, column = _largest(ratios(high, which))
            return low, int(which[sample]), column
        begin = end
    return None


def _largest(ratios: Array) -> tuple[int, int]:
    sample, column = divmod(int(np.nan_to_num(np.abs(ratios)).argmax()), ratios.shape[1])
    return sample, column


def constant(wrench: ArrayLike | None, base: BaseMotion | None) -> None:
    """Raise MotionError for a wrench or base that is not constant."""
    for name, shape in (('wrench', np.shape(wrench)[:-1] if wrench is not None else ()),
                        ('base', base.shape if isinstance(base, BaseMotion) else ())):
        if shape:
            raise MotionError(f'{name}: shape {shape}: must be a single one for a motion with '
                              'times')


def timed(platform: StewartPlatform, times: ArrayLike, motion: Any,
          ask: Callable[[Motion, float], Answer], grown: Callable[[Array, float], Array],
          ) -> Answer:
    """
    Return the answer to a question about a motion, between its samples, too.

    Parameters
    ----------
    platform : StewartPlatform
        Its limits say which intervals need samples.
    times : (N,)
        Times of the samples [s], strictly increasing.
    motion : Motion of shape (N,)
        The samples.
    ask : callable
        Takes samples and a factor that need not be exceeded; returns an Extent.
    grown : callable
        Takes rows of motion and a factor; returns those of the motion at its limit.

    """
    check_kind(motion, Motion)
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
    # At its limit, the motion needs the samples that a planned trajectory needs.
    value = float(found.value)
    factor = value if 0.0 < value < _LARGEST else 1.0
    rows = grown(motion.rows, factor)
    scale = factor if grown is faster else 1.0
    results = platform.solve(rows)
    with np.errstate(all='ignore'):  # numbers that overflow need too many samples
        parts = np.minimum(Sampling(platform.parameters).parts(
            durations / scale, Interpolation(durations / scale, rows), results, None, 0.0),
            MOST_SAMPLES)
    if parts.sum() > MOST_SAMPLES:
        raise MotionError(f'motion: samples too far apart: more than {MOST_SAMPLES} are needed '
                          'between them')
    dense = np.flatnonzero(parts > 1.0)
    where = np.concatenate([np.arange(len(seconds), dtype=float), *(
        n + np.arange(1, int(parts[n])) / parts[n] for n in dense.tolist())])
    where.sort()
    width, best, at = 1.0, found, float(found.sample or 0)
    for turn in range(_ZOOMS + 1):
        answer: Any = ask(Motion.of_rows(rows_at(where)), best.value)
        if answer.sample is not None and answer.value <= best.value:
            best, at = answer, float(where[answer.sample])
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
