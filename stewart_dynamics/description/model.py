# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The hexapod as a model for RViz and Foxglove: positions of the joints of its URDF, and transforms.

Positions and the platform's transform, from setpoints or from measured legs, go to
``~/joint_states`` and ``/tf``. The transforms between all links are what robot_state_publisher
publishes: Foxglove, and RViz's RobotModel, move a URDF by them and not by positions of joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stewart_dynamics.mechanics.frames.rotation import quaternion_of
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import joint_state_layout
from stewart_dynamics.messages.standard import transforms
from stewart_dynamics.parameters.table import Parameters

JOINT_STATES = 'joint_states'  # under the node's name
TF = '/tf'
MODEL_TYPES = {JOINT_STATES: type_names.JOINT_STATE, TF: type_names.TF_MESSAGE}


class ModelMessages:
    """Writes the messages; ParameterError if two joints of the URDF have the same name."""

    def __init__(self, parameters: Parameters) -> None:
        self._joints = TreeJoints(parameters)
        self._positions = joint_state_layout(self._joints.names, ['position'])
        self._transform = transforms([(parameters.base_frame, parameters.platform_frame)])

    def joint_states(self, stamp: int, pose: Sequence[float]) -> bytes:
        """Return the sensor_msgs/JointState of all joints at a pose, as in a row of motion."""
        row = np.array(pose[:ROTATION.stop])
        return self._positions.write([stamp], self._joints.positions(
            row[None, POSITION], row[ROTATION].reshape(1, 3, 3))).tobytes()

    def transform(self, stamp: int, pose: Sequence[float]) -> bytes:
        """Return the tf2_msgs/TFMessage from ``base_frame`` to ``platform_frame`` at a pose."""
        return self._transform.write(
            [stamp], [(*pose[POSITION], *quaternion_of(pose[ROTATION]))]).tobytes()
