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
The transforms between the links of a URDF, from the positions of its joints.

They are what robot_state_publisher publishes: Foxglove, and RViz's RobotModel, move a URDF by them
and not by positions of joints.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.rotation import from_euler, quaternion_product, to_quaternion


class LinkTransforms:
    """
    The transforms of the joints of a URDF.

    Parameters
    ----------
    urdf : str
        Of revolute, prismatic and fixed joints, as ``urdf`` writes it.

    Attributes
    ----------
    joints : tuple of str
        The joints that move (K,).
    moving, fixed : list of (parent, child)
        The links of the joints that move (K,), and of those that do not (M,).
    at_fixed : (M, 7)
        The transforms of the latter: x y z [m] and the quaternion's x y z w.

    """

    def __init__(self, urdf: str) -> None:
        joints = ET.fromstring(urdf).findall('joint')
        fixed = [each for each in joints if each.get('type') == 'fixed']
        moving = [each for each in joints if each.get('type') != 'fixed']
        self.joints = tuple(each.attrib['name'] for each in moving)
        self.moving, self.fixed = [*map(_links, moving)], [*map(_links, fixed)]
        self.at_fixed = _origins(fixed)
        self._origins = _origins(moving)
        self._revolute = np.array([each.get('type') == 'revolute' for each in moving])
        axes = np.array([_three(each, 'axis', 'xyz', '1 0 0') for each in moving])
        angles = np.array([_three(each, 'origin', 'rpy') for each in moving])
        self._directions = np.einsum('kab,kb->ka', from_euler(angles), axes)
        # The quaternion after half a turn about the axis.
        self._turned = quaternion_product(
            self._origins[:, 3:], np.column_stack([axes, np.zeros(len(axes))]))

    def at(self, positions: Array) -> Array:
        """
        Return the transforms of the joints that move (N, K, 7): x y z [m] and x y z w.

        Parameters
        ----------
        positions : (N, K)
            Of ``joints`` [m, rad].

        """
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


def _links(joint: ET.Element) -> tuple[str, str]:
    parent, child = joint.find('parent'), joint.find('child')
    assert parent is not None and child is not None
    return parent.attrib['link'], child.attrib['link']


def _three(joint: ET.Element, name: str, attribute: str, default: str = '0 0 0') -> list[float]:
    found = joint.find(name)
    text = default if found is None else found.get(attribute, default)
    return [float(number) for number in text.split()]


def _origins(joints: list[ET.Element]) -> Array:
    angles = np.array([_three(each, 'origin', 'rpy') for each in joints])
    places = np.array([_three(each, 'origin', 'xyz') for each in joints])
    return np.concatenate([places, to_quaternion(from_euler(angles))], axis=-1)
