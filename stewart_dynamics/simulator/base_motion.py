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
The motion of a base as the simulator generates it: a sum of harmonics on each axis.

One harmonic on each axis is a sine; the sea is the sum over waves of a Bretschneider spectrum,

    S(omega) = 5/16 H^2 omega_p^4 / omega^5 exp(-5/4 (omega_p / omega)^4)

with the significant wave height H and the peak omega_p (Fossen, Handbook of Marine Craft
Hydrodynamics and Motion Control, 2011, chapter 8), and the ship follows each wave with a constant
response on each axis. Waves shorter than 0.4 peak periods, 3 % of the energy, are left out: a ship
hardly follows them. Pose, twist and acceleration are exact derivatives of each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.reference_motion.motion import quintic
from stewart_dynamics.simulator.parameters import SimulatorParameters

_WAVES = 60
_LOWEST, _HIGHEST = 0.5, 2.5  # frequencies of waves, relative to the peak
_SHORTEST_RAMP = 1e-9  # shorter than any time step: none [s]


class Harmonics(NamedTuple):
    """``x_i(t) = sum_k amplitudes_ki sin(frequencies_ki t + phases_ki)``, of six axes."""

    amplitudes: Array
    """(K, 6) [m, rad]"""
    frequencies: Array
    """(K, 6) [rad/s]"""
    phases: Array
    """(K, 6) [rad]"""

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Return x, its first and its second derivative (..., 6) at times (...) [s]."""
        angles = self.frequencies * times[..., None, None] + self.phases
        sines, cosines = self.amplitudes * np.sin(angles), self.amplitudes * np.cos(angles)
        return (np.sum(sines, axis=-2), np.sum(self.frequencies * cosines, axis=-2),
                -np.sum(self.frequencies ** 2 * sines, axis=-2))


class GeneratedBaseMotion:
    """
    A base that moves about its center, from rest on.

    Parameters
    ----------
    parameters : SimulatorParameters
        ``base_motion.source`` is sine or sea.

    """

    def __init__(self, parameters: SimulatorParameters) -> None:
        self.harmonics = (_sea if parameters['base_motion.source'] == 'sea' else _sine)(parameters)
        self._center: Array = parameters['base_motion.center']
        self._arm: Array = parameters['base_motion.lever_arm']
        self._ramp = max(parameters['base_motion.ramp'], _SHORTEST_RAMP)

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
    return Harmonics(parameters['base_motion.amplitude'][None],
                     2.0 * np.pi * parameters['base_motion.frequency'][None],
                     parameters['base_motion.phase'][None])


def _sea(parameters: SimulatorParameters) -> Harmonics:
    """
    Return the response of the ship to waves of random phase.

    Each wave has the energy of a band of the spectrum and a random frequency in it, so that the
    motion does not repeat.
    """
    random = np.random.default_rng(np.float64(parameters['base_motion.sea.seed']).view(np.uint64))
    edges = np.linspace(_LOWEST, _HIGHEST, _WAVES + 1)
    # the integral of the spectrum from zero to each edge [m^2]
    energy = parameters['base_motion.sea.wave_height'] ** 2 / 16.0 * np.exp(-1.25 * edges ** -4.0)
    heights = np.sqrt(2.0 * np.diff(energy))
    relative = random.uniform(edges[:-1], edges[1:])
    phases = random.uniform(0.0, 2.0 * np.pi, _WAVES)
    peak = 2.0 * np.pi / parameters['base_motion.sea.peak_period']
    return Harmonics(heights[:, None] * parameters['base_motion.sea.response'],
                     np.repeat(peak * relative[:, None], 6, axis=1),
                     phases[:, None] + parameters['base_motion.phase'])
