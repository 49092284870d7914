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

"""The base that the simulated hexapod stands on, period by period."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import ACCELERATION, BASE, GRAVITY, POSITION, TWIST
from stewart_dynamics.setpoints.base import BaseInput
from stewart_dynamics.setpoints.inputs import LARGEST
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.simulator.base_motion import GeneratedBaseMotion
from stewart_dynamics.simulator.parameters import SimulatorParameters

# Periods that are computed at once: one alone takes as long as some of them.
_AT_ONCE = 16


class BasePeriod(NamedTuple):
    """How the base moves in a period."""

    rows: Array
    """At its begin, middle and end, (3, BASE), see ``mechanics.rows``."""
    pose: tuple[float, ...] = ()
    """Of the base frame in the world at its end, position and quaternion x y z w; if known."""
    twist: tuple[float, ...] = ()
    """World axes [m/s, rad/s]."""
    acceleration: tuple[float, ...] = ()
    """World axes [m/s^2, rad/s^2]."""


class GeneratedBase:
    """
    A base that moves as the simulator generates it.

    Parameters
    ----------
    parameters : SimulatorParameters
        ``base_motion.source`` is sine or sea.

    """

    def __init__(self, parameters: SimulatorParameters) -> None:
        self._motion = GeneratedBaseMotion(parameters)
        self._gravity: Array = parameters['gravity']
        self._rate: float = parameters['rate']
        self._first = -1
        self._periods: list[BasePeriod] = []
        self._rest = self._computed(np.zeros(3))[0]

    def period(self, index: int, end: int) -> BasePeriod:
        """
        Return a period.

        Parameters
        ----------
        index : int
            Number of the period since the motion began; the first is 1, 0 is at rest.
        end : int
            The stamp of its end [ns], not used.

        """
        if index < 1:
            return self._rest
        first = (index - 1) // _AT_ONCE * _AT_ONCE
        if first != self._first:
            times = 0.5 / self._rate * np.arange(
                2.0 * first, 2.0 * (first + _AT_ONCE) + 1.0, dtype=np.float64)
            self._periods, self._first = self._computed(times), first
        return self._periods[index - 1 - first]

    def _computed(self, times: Array) -> list[BasePeriod]:
        """Return the periods of an odd number of times (N,): begin, middle, end and so on."""
        motion = self._motion.at(times)
        rows = BaseMotion.from_motion(motion, self._gravity).rows
        of_periods = np.lib.stride_tricks.sliding_window_view(rows, (3, BASE))[::2, 0]
        poses = np.concatenate(
            [motion.rows[..., POSITION], to_quaternion(motion.rotation)], axis=1)
        return [BasePeriod(*each) for each in zip(
            of_periods, *(map(tuple, numbers[2::2].tolist()) for numbers in (
                poses, motion.rows[..., TWIST], motion.rows[..., ACCELERATION])), strict=True)]


class BaseOfTopics:
    """
    A base that moves as ``~/base/pose``, ``~/base/twist`` and ``~/base/accel`` say.

    Before the first sample it is at rest and level; where samples stop for longer than
    ``base.timeout``, at rest and tilted as it was: a base that kept its last acceleration would
    load the hexapod forever.

    Parameters
    ----------
    parameters : SimulatorParameters
        Frame of the world, gravity and ``base.timeout``.
    rejections : Rejections
        Counts rejections.
    noticed : callable
        Called with texts for the log.

    """

    def __init__(self, parameters: SimulatorParameters, rejections: Rejections,
                 noticed: Callable[[str], object]) -> None:
        self.input = BaseInput(parameters.replaced(
            {'base.source': 'motion'}, 'base_motion.source'), rejections, noticed)
        """Takes the messages."""
        self._noticed = noticed
        self._timeout: float = parameters['base.timeout']
        self._half = 0.5e9 / parameters['rate']
        self._known = False
        self._last: Array = np.zeros((3, BASE))
        self._last[:, GRAVITY] = parameters['gravity']

    def period(self, index: int, end: int) -> BasePeriod:
        """
        Return a period.

        Parameters
        ----------
        index : int
            Number of the period, not used.
        end : int
            The stamp of its end [ns].

        """
        rows: Array = np.array(
            [self.input.at(round(end - halves * self._half)) for halves in (2, 1, 0)])
        known = bool(np.max(np.abs(rows)) < LARGEST)  # not where it is nan
        if known:
            self._last = rows
        else:
            # a row at rest with the gravity of the last one
            rest = np.zeros((3, BASE))
            rest[:, GRAVITY] = self._last[-1, GRAVITY]
            rows = self._last = rest
        if known != self._known:
            self._known = known
            self._noticed('the base follows its topics' if known else (
                f'no base motion for {self._timeout:g} s: the base is at rest, tilted as it was'))
        return BasePeriod(rows)
