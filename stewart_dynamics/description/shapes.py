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
The shapes of a hexapod: plates, cylinders and balls, or meshes from files.

Sizes follow from the geometry, as those of the node's markers do. They have no influence on
masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import Hexapod, Leg
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.home_pose import level_axes

Color = tuple[float, float, float, float]

COLORS: dict[str, Color] = {
    'base': (0.3, 0.32, 0.35, 1.0), 'platform': (0.62, 0.7, 0.76, 1.0),
    'cylinder': (0.45, 0.48, 0.52, 1.0), 'piston': (0.9, 0.9, 0.9, 1.0),
    'joint': (0.12, 0.12, 0.12, 1.0)}

# Radii and thickness in terms of the mean distance of the platform joints from their center.
_BARREL, _ROD, _BALL, _PLATE = 0.05, 0.0275, 0.07, 0.05
# Parts of the shortest leg length, or of the length at home if there is no limit.
_BARREL_LENGTH, _ROD_LENGTH, _OF_HOME = 0.9, 0.95, 0.7


class Shape(NamedTuple):
    """A cylinder along z, a ball, or a mesh; placed in the axes of its body."""

    kind: str
    """cylinder, sphere or mesh."""
    color: str
    """A key of COLORS."""
    position: Array
    """Of its center, or of the mesh's origin (3,) [m]."""
    rotation: Array
    """Its axes to those of the body (3, 3)."""
    radius: float = 0.0
    length: float = 0.0
    file: str = ''
    scale: float = 1.0


def shapes(hexapod: Hexapod, uris: bool = True) -> dict[str, tuple[Shape, ...]]:
    """Return the shapes of each body, by its name; without ``uris`` only meshes that are paths."""
    p = hexapod.parameters
    base, platform = p['geometry.base_joints'], p['geometry.platform_joints']
    size = float(np.mean(np.linalg.norm(platform - platform.mean(axis=0), axis=1)))
    found = {}
    for name, kind, joints in ((hexapod.base, 'base', base),
                               (hexapod.platform, 'platform', platform)):
        found[name] = _mesh(hexapod, kind, uris) or (_plate(kind, joints, _PLATE * size), *(
            Shape('sphere', 'joint', joint, np.eye(3), _BALL * size) for joint in joints))
    for leg in hexapod.legs:
        found[leg.cylinder.name] = _mesh(hexapod, 'cylinder', uris) or (
            _rod('cylinder', _BARREL * size, _BARREL_LENGTH * _shortest(leg), 1.0),)
        found[leg.piston.name] = _mesh(hexapod, 'piston', uris) or (
            _rod('piston', _ROD * size, _ROD_LENGTH * _shortest(leg), -1.0),)
    return found


def solids(looks: Sequence[Shape]) -> list[Shape]:
    """Return which shapes of a body others collide with: not the balls of its joints."""
    return [shape for shape in looks if shape.kind != 'sphere']


def _shortest(leg: Leg) -> float:
    return leg.limits.length_min or _OF_HOME * leg.home_length


def _rod(kind: str, radius: float, length: float, sign: float) -> Shape:
    return Shape('cylinder', kind, np.array([0.0, 0.0, 0.5 * sign * length]), np.eye(3), radius,
                 length)


def _plate(kind: str, joints: Array, thickness: float) -> Shape:
    center = joints.mean(axis=0)
    axes = level_axes(joints - center)
    radius = float(np.linalg.norm((joints - center) @ axes[:2].T, axis=1).max())
    return Shape('cylinder', kind, center, axes.T, max(radius, thickness), thickness)


def _mesh(hexapod: Hexapod, kind: str, uris: bool) -> tuple[Shape, ...]:
    p = hexapod.parameters
    file = p[f'meshes.{kind}']
    if not file or (not uris and '://' in file):
        return ()
    offset = p[f'meshes.{kind}_offset']
    return (Shape('mesh', kind, offset[:3], from_euler(offset[3:]), file=file,
                  scale=p['meshes.scale']),)
