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
- A leg, from its base joint: revolute about the mount's x and then about y, which together are the
  universal joint, then prismatic along z, the parameter ``joints``. The mount's z points along the
  leg at home, where both angles are zero; its x lies in the plane of the base joints and is
  at right angles to the leg. The position of the prismatic joint is the length less
  ``geometry.zero_length``.

Two directions are singular: for the platform a pitch of 90 degrees, for a leg the x of its mount,
90 degrees from home in the plane of the base joints. There one of two angles can be chosen freely;
near there the first one turns fast, and it jumps by up to 180 degrees from one side to the other.
The second angle is computed with the first as it is, so that the loops are closed everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.mechanics.frames.rotation import euler_of, to_euler
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.parameters.table import Parameters

PLATFORM_JOINTS = ('x', 'y', 'z', 'yaw', 'pitch', 'roll')
"""What follows platform_frame in the names of the virtual joints, from base to platform."""
UNIVERSAL_JOINTS = ('universal_x', 'universal_y')
"""What follows the name of a leg in the names of the joints of its universal joint."""
JOINTS = 24


class HomeDirections(NamedTuple):
    """The directions of the legs at home, from base joint to platform joint."""

    base: Array  # base axes (6, 3)
    platform: Array  # platform axes (6, 3)


class TreeJoints:
    """
    The joints of a hexapod as a tree: their names, and their positions at a pose.

    names: names of all joints (24,): first the platform's joints, from base to platform, then for
        each leg two of the universal joint and one of the prismatic joint.
    mounts (6, 3, 3): rotation from the axes of each leg's mount to base axes.
    Raises ParameterError: two joints would have the same name.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.names = joint_names(parameters)
        self.mounts = mounts(parameters)
        self._base = parameters.geometry.base_joints
        self._platform = parameters.geometry.platform_joints
        self._zero_length = parameters.geometry.zero_length
        self._legs = [
            (*base, *platform, *mount, zero) for base, platform, mount, zero in zip(
                self._base.tolist(), self._platform.tolist(),
                self.mounts.reshape(6, 9).tolist(), self._zero_length.tolist(), strict=True)]

    def positions(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """
        Return the position of each joint, in the order of ``names``, (..., 24) [m, rad].

        position (..., 3): origin of the platform frame in the base frame [m].
        rotation (..., 3, 3): platform axes to base axes.
        """
        at, r = np.asarray(position, dtype=float), np.asarray(rotation, dtype=float)
        legs = at[..., None, :] + self._platform @ r.swapaxes(-1, -2) - self._base
        # Copied: the bits of numpy 1.26's arctan2 of views change with where these are in memory.
        x, y, z = np.moveaxis(np.einsum('iba,...ib->...ia', self.mounts, legs), -1, 0).copy()
        across = np.hypot(y, z)
        of_legs = np.stack([np.arctan2(-y, z), np.arctan2(x, across),
                            np.hypot(x, across) - self._zero_length], axis=-1)
        shape = of_legs.shape[:-2]
        return np.concatenate([
            np.broadcast_to(at, (*shape, 3)), np.broadcast_to(to_euler(r)[..., ::-1], (*shape, 3)),
            of_legs.reshape(*shape, 18)], axis=-1)

    def of_sample(self, pose: Sequence[float]) -> list[float]:
        """
        Return the same at one pose (24,) [m, rad], much faster.

        pose: position and rotation, row by row (12,); further numbers, as of a motion, are
            ignored.
        """
        x, y, z, r00, r01, r02, r10, r11, r12, r20, r21, r22 = pose[:12]
        found = [x, y, z, *reversed(euler_of(pose[3:12]))]
        for (bx, by, bz, px, py, pz, m00, m01, m02, m10, m11, m12, m20, m21, m22,
             zero) in self._legs:
            lx = x - bx + r00 * px + r01 * py + r02 * pz
            ly = y - by + r10 * px + r11 * py + r12 * pz
            lz = z - bz + r20 * px + r21 * py + r22 * pz
            along_x = m00 * lx + m10 * ly + m20 * lz
            along_y = m01 * lx + m11 * ly + m21 * lz
            along_z = m02 * lx + m12 * ly + m22 * lz
            across = hypot(along_y, along_z)
            found += (atan2(-along_y, along_z), atan2(along_x, across),
                      hypot(along_x, across) - zero)
        return found


def joint_names(parameters: Parameters) -> tuple[str, ...]:
    """Return the names of all joints (24,); ParameterError if two are the same."""
    platform = parameters.platform_frame
    names = [f'{platform}_{each}' for each in PLATFORM_JOINTS]
    for leg in parameters.joints:
        names += [*(f'{leg}_{each}' for each in UNIVERSAL_JOINTS), leg]
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
