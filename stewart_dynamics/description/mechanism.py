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
A mechanism as the readers of all formats return it: bodies, joints and loops, in world axes.

Everything is placed as the file has it, at the positions of the joints that the file has.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import StewartError

WORLD = 'world'
FIXED, HINGE, UNIVERSAL, BALL, SLIDE, OTHER = (
    'fixed', 'hinge', 'universal', 'ball', 'slide', 'other')


class DescriptionError(StewartError):
    """A file that cannot be read, or in which there is no hexapod."""


class Placement(NamedTuple):
    """Where a frame is: its axes to those of the world, and its origin."""

    rotation: Array
    position: Array

    def of(self, inner: Placement) -> Placement:
        """Return where a frame is that is placed in this one."""
        return Placement(self.rotation @ inner.rotation,
                         self.position + self.rotation @ inner.position)

    def point(self, at: Array) -> Array:
        """Return a point of this frame in the world."""
        placed: Array = self.position + self.rotation @ at
        return placed

    def inside(self, at: Array) -> Array:
        """Return a point of the world in this frame."""
        seen: Array = self.rotation.T @ (at - self.position)
        return seen


HERE = Placement(np.eye(3), np.zeros(3))


@dataclass
class MechanismBody:
    """A body; mass is None where the file gives none."""

    name: str
    placement: Placement
    mass: float | None = None
    center: Array = field(default_factory=lambda: np.zeros(3))  # in the frame of the body [m]
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """About the center of mass, axes of the body [kg m^2]."""
    note: str = ''  # assumption of the reader about it


@dataclass
class Joint:
    """A joint between two bodies; where loops are open, it has a point on each of them."""

    name: str
    kind: str
    parent: str
    child: str
    anchor: Array  # in the world; on the parent's side [m]
    axes: list[Array] = field(default_factory=list)  # unit vectors, in world axes
    child_anchor: Array | None = None
    """The same point on the child's side, where it is given on its own [m]."""
    position: float = 0.0  # position of a slide at the placements of the file [m]
    lower: float | None = None
    upper: float | None = None
    velocity_max: float | None = None
    force_max: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0


@dataclass
class Mechanism:
    """A mechanism with its gravity, and parameters that stewart_describe has added."""

    source: str
    name: str
    parts: dict[str, MechanismBody]
    joints: list[Joint]
    gravity: Array | None = None  # world axes [m/s^2]
    carried: dict[str, str] = field(default_factory=dict)
    """Parameters that stewart_describe has added to the format, as text."""
    order: tuple[str, ...] = ()  # names of slides in the order of their actuators
    remarks: list[str] = field(default_factory=list)  # assumptions of the reader, one line each
