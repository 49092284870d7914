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

"""Writing of sensor_msgs/Imu."""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.messages.setpoint import StampedWriter

_NUMBERS = 37
# By convention of the message: the orientation is not measured.
_NOT_MEASURED = (0.0, 0.0, 0.0, 1.0, -1.0, *(0.0,) * 8)


class ImuWriter:
    """
    Writes sensor_msgs/Imu of an IMU that does not measure its orientation.

    Parameters
    ----------
    frame : str
        Frame of the IMU.
    angular_velocity, specific_force : float
        Standard deviations of the readings [rad/s, m/s^2]; the covariances are made of them.

    """

    def __init__(self, frame: str, angular_velocity: float, specific_force: float) -> None:
        self._writer = StampedWriter(frame, _NUMBERS)
        self._covariances = [_diagonal(angular_velocity ** 2), _diagonal(specific_force ** 2)]

    def write(self, stamp: int, angular_velocity: Sequence[float],
              specific_force: Sequence[float]) -> bytes:
        """Return the message of readings in IMU axes at a time [ns]."""
        of_gyro, of_accelerometer = self._covariances
        return self._writer.write(stamp, (
            *_NOT_MEASURED, *angular_velocity, *of_gyro, *specific_force, *of_accelerometer))


def _diagonal(variance: float) -> tuple[float, ...]:
    return variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance
