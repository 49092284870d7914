# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
All joints of a hexapod as a tree, as in its URDF, from the pose in closed form.

URDF has no closed loops, so the tree is open at the platform joints: the platform is carried by a
chain of six virtual joints, and each leg ends at the tip of its piston. The loops are closed where
the joints have the positions of one pose.

- The platform, from the base: prismatic along x, y and z, then revolute about z (yaw), y (pitch)
  and x (roll). Their positions are those of the platform frame and the angles gamma, beta and
  alpha of R = Rz(gamma) Ry(beta) Rx(alpha). Zero is the platform frame in the base frame.
- A leg, from the base: the joint of its drive, which has the name of the leg in the parameter
  ``joints``, and two revolute joints about x and then y, which together are a universal joint, in
  the order of ``LegKind.joints``. The universal joint has a mount whose z points along the line
  of force at home, where both angles are zero; its x lies in the plane of the base joints and is
  at right angles to that line. The position of a prismatic joint is the length less
  ``geometry.zero_length``, that of a revolute one the angle of the drive.

Two directions are singular: for the platform a pitch of 90 degrees, for a leg the x of its mount,
90 degrees from home. There one of two angles can be chosen freely;
near there the first one turns fast, and it jumps by up to 180 degrees from one side to the other.
The second angle is computed with the first as it is, so that the loops are closed everywhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs import tree
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.kinematics.home_pose import choose_branch, home_of, homes
from stewart_dynamics.parameters.table import Parameters

PLATFORM_JOINTS = ('x', 'y', 'z', 'yaw', 'pitch', 'roll')
"""What follows platform_frame in the names of the virtual joints, from base to platform."""
JOINTS = 24


class HomeDirections(NamedTuple):
    """The directions of the lines of force at home, from base to platform."""

    base: Array  # base axes (6, 3)
    platform: Array  # platform axes (6, 3)


class TreeJoints:
    """
    The joints of a hexapod as a tree: their names, and their positions at a pose.

    names: names of all joints (24,): first the platform's joints, from base to platform, then for
        each leg its drive and two of its universal joint, from the base.
    mounts (6, 3, 3): rotation from the axes of each leg's mount to base axes.
    Raises ParameterError: two joints would have the same name.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.names = joint_names(parameters)
        choose_branch(parameters)
        self.mounts = mounts(parameters)
        positions, rotations = homes(parameters)
        self._of_legs = parameters.leg_kind.tree_joints(
            parameters, self.mounts, (positions[0], rotations[0]))

    def positions(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """
        Return the position of each joint, in the order of ``names``, (..., 24) [m, rad].

        position (..., 3): origin of the platform frame in the base frame [m].
        rotation (..., 3, 3): platform axes to base axes.
        """
        at, r = np.asarray(position, dtype=float), np.asarray(rotation, dtype=float)
        of_legs = self._of_legs(at, r)
        shape = of_legs.shape[:-2]
        return np.concatenate([
            np.broadcast_to(at, (*shape, 3)), np.broadcast_to(to_euler(r)[..., ::-1], (*shape, 3)),
            of_legs.reshape(*shape, 18)], axis=-1)


def joint_names(parameters: Parameters) -> tuple[str, ...]:
    """Return the names of all joints (24,); ParameterError if two are the same."""
    platform = parameters.platform_frame
    names = [f'{platform}_{each}' for each in PLATFORM_JOINTS]
    for leg in parameters.joints:
        names += tree.joint_names(leg, parameters.leg_kind.joints)
    twice = [name for n, name in enumerate(names) if name in names[:n]]
    if twice:
        raise ParameterError(
            f'{parameters.source}: joints: {shown(list(parameters.joints))}, platform_frame: '
            f'{shown(platform)}: two joints of the tree would have the name {shown(twice[0])}')
    return tuple(names)


def home_directions(parameters: Parameters) -> HomeDirections:
    """Return the directions of the legs at the most likely home pose; see ``homes``."""
    home = home_of(parameters)
    return HomeDirections(home.base_directions, home.platform_directions)


def mounts(parameters: Parameters) -> Array:
    """Return the rotations (6, 3, 3) from the axes of each leg's mount to base axes."""
    return home_of(parameters).mounts
