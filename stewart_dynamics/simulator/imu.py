# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The IMU of the simulated base: what an IMU fixed to a moving base reads."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.frames.base_motion import carried
from stewart_dynamics.mechanics.frames.motion import matrix_of_quaternion
from stewart_dynamics.mechanics.rows import (
    BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION, BASE_ANGULAR_VELOCITY, GRAVITY)
from stewart_dynamics.mechanics.vectors import add, subtract, Vector3
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters


class SimulatedImu:
    """An IMU mounted as ``base.imu`` says, with bias and noise."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        self._position = _vector(parameters.base.imu.position)
        self._to_imu = matrix_of_quaternion(parameters.base.imu.orientation).T
        self._bias = np.concatenate([parameters.imu.bias.angular_velocity,
                                     parameters.imu.bias.specific_force])
        self._deviations = np.repeat([parameters.imu.noise.angular_velocity,
                                      parameters.imu.noise.specific_force], 3)
        seed = int(np.float64(parameters.noise.seed).view(np.uint64))
        # Not the numbers of the noise of the legs, which has the same seed.
        self._noise = np.random.default_rng([seed, 1])

    def read(self, row: Array) -> list[float]:
        """
        Return angular velocity [rad/s] and specific force [m/s^2] in a motion of the base (BASE,).

        They are in IMU axes; the noise is new in each call.
        """
        spin, spin_rate = (_vector(row[part]) for part in (
            BASE_ANGULAR_VELOCITY, BASE_ANGULAR_ACCELERATION))
        force = add(subtract(_vector(row[BASE_ACCELERATION]), _vector(row[GRAVITY])),
                    carried(spin, spin_rate, self._position))
        true = np.concatenate([self._to_imu @ spin, self._to_imu @ force])
        readings: list[float] = (
            true + self._bias + self._deviations * self._noise.standard_normal(6)).tolist()
        return readings


def _vector(three: Array) -> Vector3:
    x, y, z = three.tolist()
    return x, y, z
