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

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.base_motion import BaseMotion
from stewart_dynamics.mechanics.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import ACCELERATION, BASE, POSITION, TWIST
from stewart_dynamics.runtime.generated_base_motion import GeneratedBaseMotion
from stewart_dynamics.runtime.simulator_parameters import SimulatorParameters

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

    def period(self, index: int) -> BasePeriod:
        """Return a period by its number since the motion began; the first is 1, 0 is at rest."""
        if index < 1:
            return self._rest
        first = (index - 1) // _AT_ONCE * _AT_ONCE
        if first != self._first:
            times: Array = np.arange(2 * first, 2 * (first + _AT_ONCE) + 1) * (0.5 / self._rate)
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
