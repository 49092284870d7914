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
The hexapod as a model: the positions of all joints of its URDF, and the platform's transform.

For RViz and Foxglove, on ``~/joint_states`` and ``/tf``; from setpoints or from measured legs.
"""

from __future__ import annotations

from collections.abc import Sequence

from stewart_dynamics.mechanics.frames.rotation import quaternion_of
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.messages.model import PositionsWriter, TransformWriter
from stewart_dynamics.parameters.table import Parameters

JOINT_STATES = 'joint_states'
"""Under the node's name."""
TF = '/tf'


class ModelMessages:
    """
    Writes the messages.

    Raises
    ------
    ParameterError
        Two joints of the URDF would have the same name.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._joints = TreeJoints(parameters)
        self._positions = PositionsWriter(self._joints.names)
        self._transform = TransformWriter(parameters['base_frame'], parameters['platform_frame'])

    def joint_states(self, stamp: int, pose: Sequence[float]) -> bytes:
        """
        Return the sensor_msgs/JointState of all joints at a pose.

        Parameters
        ----------
        stamp : int
            [ns]
        pose : sequence of float
            A row of motion, or its first 12 numbers.

        """
        return self._positions.write(stamp, self._joints.of_sample(pose))

    def transform(self, stamp: int, pose: Sequence[float]) -> bytes:
        """Return the tf2_msgs/TFMessage from ``base_frame`` to ``platform_frame`` at a pose."""
        return self._transform.write(stamp, (*pose[POSITION], *quaternion_of(pose[ROTATION])))
