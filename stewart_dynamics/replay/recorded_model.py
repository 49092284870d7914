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
The messages of the output bag that show the hexapod as a model.

The URDF, and the transforms of all its links, as robot_state_publisher publishes them: Foxglove
and RViz need nothing else. The joint positions are those that the node publishes, but for
rounding: many are computed at once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Stamps
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.model import JOINT_STATES, LinkTransforms, TF
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.mechanics.kinematics.leg_joints import TreeJoints
from stewart_dynamics.mechanics.rows import POSITION, ROTATION
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import joint_state_layout
from stewart_dynamics.messages.standard import string, transforms
from stewart_dynamics.parameters.table import Parameters

TF_STATIC = '/tf_static'
ROBOT_DESCRIPTION = '/robot_description'

MODEL_TYPES = {
    JOINT_STATES: type_names.JOINT_STATE,
    TF: type_names.TF_MESSAGE,
    TF_STATIC: type_names.TF_MESSAGE,
    ROBOT_DESCRIPTION: type_names.STRING,
}
Written = tuple[str, NDArray[np.void]]


class RecordedModel:
    """
    Writes the messages of a hexapod, which has a name in the URDF.

    Raises ParameterError if two joints or links of the URDF would have the same name.
    """

    def __init__(self, parameters: Parameters, name: str) -> None:
        self._urdf = urdf(Hexapod(parameters), name)
        self._joints = TreeJoints(parameters)
        self._links = LinkTransforms(self._urdf)
        self._positions = joint_state_layout(self._joints.names, ['position'])
        self._moving = transforms(self._links.moving)
        self._fixed = transforms(self._links.fixed)

    def of_beginning(self, stamp: int) -> Iterator[Written]:
        """Yield topics and messages (1,) of the constant parts, at a stamp [ns]."""
        yield TF_STATIC, self._fixed.write(
            np.array([stamp]), *self._links.at_fixed[:, None])
        text = string(self._urdf)
        yield ROBOT_DESCRIPTION, np.frombuffer(text, dtype=f'V{len(text)}')

    def of_rows(self, stamps: Stamps, poses: Array) -> Iterator[Written]:
        """Yield topics and messages (N,) of stamps (N,) [ns] and rows of motion (N, MOTION)."""
        if not len(stamps):
            return
        positions = self._joints.positions(
            poses[:, POSITION], poses[:, ROTATION].reshape(-1, 3, 3))
        yield JOINT_STATES, self._positions.write(stamps, positions)
        yield TF, self._moving.write(
            stamps, *np.moveaxis(self._links.at(positions), 1, 0))
