# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The transforms of the links of a hexapod's URDF at positions of its joints, as in ``/tf``."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.read_urdf import UrdfModel
from stewart_dynamics.legs.mechanism import FIXED, HERE, HINGE, Placement
from stewart_dynamics.mechanics.frames.rotation import quaternion_product, to_quaternion


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
