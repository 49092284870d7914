# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The bodies of a leg as a branch of a tree, for drawings and for the formats of other tools."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.legs.mechanism import HINGE, Placement, SLIDE

UNIVERSAL_JOINTS = ('universal_x', 'universal_y')
"""What follows the name of a leg in the names of the joints of its universal joint."""
# Radii and thickness in terms of the mean distance of the platform joints from their center.
BARREL, ROD, BALL, PLATE = 0.05, 0.0275, 0.07, 0.05


class VisualShape(NamedTuple):
    """A cylinder along z, a ball, or a mesh; placed in the axes of its body."""

    kind: str  # cylinder, sphere or mesh
    color: str  # of its body: base, platform, joint, or a part of a leg
    position: Array  # of its center, or of the mesh's origin (3,) [m]
    rotation: Array  # its axes to those of the body (3, 3)
    radius: float = 0.0
    length: float = 0.0
    file: str = ''
    scale: float = 1.0

    @property
    def collides(self) -> bool:
        """Return whether others collide with it: not with the balls of joints."""
        return self.kind != 'sphere'


class LegLink(NamedTuple):
    """
    A body of a leg, and the joint by which the base or the body before it carries it.

    A slide is along z, a hinge about z, and the two axes of a universal joint are x and then y,
    all in axes of the body. Slides and hinges are moved by the motor; the angles of universal
    joints are zero at home.
    """

    part: str  # in the names of parameters and of bodies
    joint: str  # SLIDE, HINGE or UNIVERSAL
    at_home: Placement  # in the body before it
    at_zero: Placement  # where the position of the joint is zero
    mass: float
    center: Array  # of mass (3,) [m]
    inertia: Array  # about the center of mass (3, 3) [kg m^2]
    slender: bool  # whether it has no inertia about z
    size: float  # [m]
    shapes: tuple[VisualShape, ...]


class LegBranch(NamedTuple):
    """The bodies of a leg, from the base on, and the position of its drive."""

    links: tuple[LegLink, LegLink]
    end: Array  # where the joint at the platform is, in axes of the last body (3,) [m]
    home: float  # position of the drive at home, as parameters have it [m, rad]
    zero: float  # position of the drive where the position of its joint is zero
    widest: tuple[float, float]  # positions of a drive without limits
    reach: float  # longest distance of the platform joint from the base joint [m]


def joint_names(leg: str, joints: tuple[str, str]) -> list[str]:
    """Return the names of the joints of a leg, of a universal joint both."""
    names = []
    for joint in joints:
        names += [leg] if joint in (HINGE, SLIDE) else [f'{leg}_{each}' for each in
                                                        UNIVERSAL_JOINTS]
    return names


def rod_shape(color: str, radius: float, length: float, sign: float = 1.0) -> VisualShape:
    """Return a cylinder that begins at the origin, along z or against it."""
    return VisualShape('cylinder', color, np.array([0.0, 0.0, 0.5 * sign * length]), np.eye(3),
                       radius, length)
