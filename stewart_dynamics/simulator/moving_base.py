# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The base that the simulated hexapod stands on, period by period: generated, or from topics.

A generated motion is a sum of harmonics on each axis. One harmonic is a sine; the sea is the sum
over waves of a Bretschneider spectrum,

    S(omega) = 5/16 H^2 omega_p^4 / omega^5 exp(-5/4 (omega_p / omega)^4)

with the significant wave height H and the peak omega_p (Fossen, Handbook of Marine Craft
Hydrodynamics and Motion Control, 2011, chapter 8), and the ship follows each wave with a constant
response on each axis. Waves shorter than 0.4 peak periods, 3 % of the energy, are left out: a ship
hardly follows them. Pose, twist and acceleration are exact derivatives of each other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.rows import ACCELERATION, BASE, GRAVITY, POSITION, TWIST
from stewart_dynamics.reference_motion.quintic import quintic
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import LARGEST
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

_WAVES = 60
_LOWEST, _HIGHEST = 0.5, 2.5  # frequencies of waves, relative to the peak
_SHORTEST_RAMP = 1e-9  # shorter than any time step: none [s]


class Harmonics(NamedTuple):
    """``x_i(t) = sum_k amplitudes_ki sin(frequencies_ki t + phases_ki)``, of six axes."""

    amplitudes: Array  # (K, 6) [m, rad]
    frequencies: Array  # (K, 6) [rad/s]
    phases: Array  # (K, 6) [rad]

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Return x, its first and its second derivative (..., 6) at times (...) [s]."""
        angles = self.frequencies * times[..., None, None] + self.phases
        sines, cosines = self.amplitudes * np.sin(angles), self.amplitudes * np.cos(angles)
        return (np.sum(sines, axis=-2), np.sum(self.frequencies * cosines, axis=-2),
                -np.sum(self.frequencies ** 2 * sines, axis=-2))


class GeneratedBaseMotion:
    """A base that moves about its center, from rest on."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        self.harmonics = (_sea if parameters.base_motion.source == 'sea' else _sine)(parameters)
        self._center = parameters.base_motion.center
        self._arm = parameters.base_motion.lever_arm
        self._ramp = max(parameters.base_motion.ramp, _SHORTEST_RAMP)

    def at(self, times: ArrayLike) -> Motion:
        """Return the motion of the base frame in the world at times (...) [s] from its begin."""
        seconds = np.asarray(times, dtype=float)
        x, dx, ddx = self.harmonics.at(np.maximum(seconds, 0.0))
        grown, rate, acceleration = (each[..., None] for each in self._grown(seconds))
        x, dx, ddx = (grown * x, rate * x + grown * dx,
                      acceleration * x + 2.0 * rate * dx + grown * ddx)
        pose = self._center + x
        moved = Motion.from_euler(pose[..., :3], pose[..., 3:], dx[..., :3], dx[..., 3:],
                                  ddx[..., :3], ddx[..., 3:])
        arm = moved.rotation @ self._arm
        w, w_rate = moved.angular_velocity, moved.angular_acceleration
        turning = np.cross(w, arm)
        return Motion(moved.position + arm, moved.rotation, moved.linear_velocity + turning, w,
                      moved.linear_acceleration + np.cross(w_rate, arm) + np.cross(w, turning),
                      w_rate)

    def _grown(self, seconds: Array) -> tuple[Array, Array, Array]:
        """Return the factor of the motion and its time derivatives; zero before the begin."""
        factor, rate, acceleration = quintic(np.clip(seconds / self._ramp, 0.0, 1.0))
        return factor, rate / self._ramp, acceleration / self._ramp ** 2


def _sine(parameters: SimulatorParameters) -> Harmonics:
    return Harmonics(parameters.base_motion.amplitude[None],
                     2.0 * np.pi * parameters.base_motion.frequency[None],
                     parameters.base_motion.phase[None])


def _sea(parameters: SimulatorParameters) -> Harmonics:
    """
    Return the response of the ship to waves of random phase.

    Each wave has the energy of a band of the spectrum and a random frequency in it, so that the
    motion does not repeat.
    """
    random = np.random.default_rng(np.float64(parameters.base_motion.sea.seed).view(np.uint64))
    edges = np.linspace(_LOWEST, _HIGHEST, _WAVES + 1)
    # the integral of the spectrum from zero to each edge [m^2]
    energy = parameters.base_motion.sea.wave_height ** 2 / 16.0 * np.exp(-1.25 * edges ** -4.0)
    heights = np.sqrt(2.0 * np.diff(energy))
    relative = random.uniform(edges[:-1], edges[1:])
    phases = random.uniform(0.0, 2.0 * np.pi, _WAVES)
    peak = 2.0 * np.pi / parameters.base_motion.sea.peak_period
    return Harmonics(heights[:, None] * parameters.base_motion.sea.response,
                     np.repeat(peak * relative[:, None], 6, axis=1),
                     phases[:, None] + parameters.base_motion.phase)


# Periods that are computed at once: one alone takes as long as some of them.
_AT_ONCE = 16


class BasePeriod(NamedTuple):
    """How the base moves in a period."""

    rows: Array  # at its begin, middle and end, (3, BASE), see ``mechanics.rows``
    pose: tuple[float, ...] = ()
    """Of the base frame in the world at its end, position and quaternion x y z w; if known."""
    twist: tuple[float, ...] = ()  # world axes [m/s, rad/s]
    acceleration: tuple[float, ...] = ()  # world axes [m/s^2, rad/s^2]


class GeneratedBase:
    """A base that moves as the simulator generates it: ``base_motion.source`` is sine or sea."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        self._motion = GeneratedBaseMotion(parameters)
        self._gravity = parameters.gravity
        self._rate = parameters.rate
        self._first = -1
        self._periods: list[BasePeriod] = []
        self._rest = self._computed(np.zeros(3))[0]

    def period(self, index: int, end: int) -> BasePeriod:
        """Return the period of a number since the motion began: the first is 1, 0 is at rest."""
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
    """

    def __init__(self, parameters: SimulatorParameters, rejections: Rejections,
                 noticed: Callable[[str], object]) -> None:
        self.input = BaseInput(parameters.replaced(
            {'base.source': 'motion'}, 'base_motion.source'), rejections, noticed)
        """Takes the messages."""
        self._noticed = noticed
        self._timeout = parameters.base.timeout
        self._half = 0.5e9 / parameters.rate
        self._known = False
        self._last: Array = np.zeros((3, BASE))
        self._last[:, GRAVITY] = parameters.gravity

    def period(self, index: int, end: int) -> BasePeriod:
        """Return the period that ends at a stamp [ns]."""
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
