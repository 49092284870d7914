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
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.read_urdf import UrdfModel
from stewart_dynamics.legs.mechanism import FIXED, HERE, HINGE, Placement
from stewart_dynamics.mechanics.frames.rotation import (
    quaternion_of, quaternion_product, to_quaternion)
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


class LinkTransforms:
    """The transforms of the joints of a URDF that ``urdf`` has written."""

    def __init__(self, urdf: str) -> None:
        model = UrdfModel(ET.fromstring(urdf), Path('robot_description'))
        placed = [(model.pose(each), model.joint(each, HERE)) for each in model.joints]
        moving, fixed = ([each for each in placed if (each[1].kind == FIXED) is is_fixed]
                         for is_fixed in (False, True))
        self.moving, self.fixed = ([(joint.parent, joint.child) for _, joint in some]
                                   for some in (moving, fixed))
        """Parent and child of the K joints that move, and of the M joints that do not."""
        self.at_fixed = _rows([place for place, _ in fixed])
        """Transforms of the latter (M, 7): x y z [m] and the quaternion's x y z w."""
        self._origins = _rows([place for place, _ in moving])
        self._revolute = np.array([joint.kind == HINGE for _, joint in moving])
        axes = np.array([joint.axes[0] for _, joint in moving])
        self._directions = np.array([
            place.rotation @ joint.axes[0] for place, joint in moving])
        # The quaternion after half a turn about the axis.
        self._turned = quaternion_product(
            self._origins[:, 3:], np.column_stack([axes, np.zeros(len(axes))]))

    def at(self, positions: Array) -> Array:
        """Return the moving transforms (N, K, 7) at positions (N, K) of the joints [m, rad]."""
        shifts = np.where(self._revolute, 0.0, positions)
        halves = np.where(self._revolute, 0.5 * positions, 0.0)
        cosines, sines = np.cos(halves), np.sin(halves)
        found = np.empty((*positions.shape, 7))
        # One number after the other: numpy is slow where the last axis is short.
        for n in range(3):
            found[..., n] = self._origins[:, n] + self._directions[:, n] * shifts
        for n in range(4):
            found[..., 3 + n] = self._origins[:, 3 + n] * cosines + self._turned[:, n] * sines
        return found


def _rows(places: list[Placement]) -> Array:
    return np.concatenate([np.array([each.position for each in places]), to_quaternion(
        np.array([each.rotation for each in places]))], axis=-1)
