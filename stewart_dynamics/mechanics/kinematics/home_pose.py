# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The home pose of a hexapod, from its geometry and its limits.

Home has parallel axes and the center of the platform joints above that of the base joints along
the normal of their plane, at the height where the mean leg is halfway between the limits of its
length, or has the zero length where there are no limits. Where no level pose with parallel axes
has all legs within their limits, the platform is turned about the normal by the smallest angle
that brings them there.

A pose and its mirror image at the plane of the base joints have nearly the same lengths. The side
is that of ``geometry.platform_side``: ``positive`` is the side to which the base axis most nearly
parallel to the normal, usually z, points, ``negative`` the other one. By default, ``auto``, it is
``positive`` unless all legs can be within their limits on the other side alone.

The computation is ``core/home.c``, which the ros2_control controller calls, too.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function, record
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.rows import POSE, POSITION, ROTATION
from stewart_dynamics.parameters.table import AUTO, NEGATIVE, Parameters, POSITIVE

# Largest length, in larger radii: legs have 1 to 10, legs given in mm 1000 times that.
_LENGTH_RATIO = 100.0

# Heights that are tried if the parameters do not give one, in larger radii.
HEIGHTS = (0.3, 0.6, 1.0, 1.7, 3.0)
_SIDES = {POSITIVE: 1, NEGATIVE: -1, AUTO: 0}


class Shape(NamedTuple):
    """A hexapod's joints in axes of which the third is the normal of the base joints' plane."""

    base: Array  # from their center (6, 3) [m]
    platform: Array  # from their center (6, 3) [m], while the axes of both frames are parallel
    axes: Array  # those axes in the base frame (3, 3), row by row
    base_radius: float
    platform_radius: float

    @property
    def radius(self) -> float:
        """Return the larger one [m]."""
        return max(self.base_radius, self.platform_radius)


class Home(NamedTuple):
    """The level poses within the limits of length, and which of them may be home."""

    shape: Shape
    reachable: bool  # all legs are within their limits at some turn and height
    yaw: float  # the turn about the normal nearest to 0 at which they are; else 0 [rad]
    longest: float  # the longest leg to be expected [m]
    side: float  # 1 where the platform is where the normal points, else -1
    certain: bool  # the parameters give the side; otherwise it is assumed
    heights: Array  # along the normal from the base joints' center, the most likely first (N,) [m]
    length: float | None  # of the mean leg [m]; None if the parameters do not give it
    positions: Array  # of the platform at the heights (N, 3) [m]
    rotations: Array  # the same (N, 3, 3)
    base_directions: Array  # of the legs at the first of them, base axes (6, 3)
    platform_directions: Array  # platform axes
    mounts: Array  # axes of the legs' mounts to base axes (6, 3, 3), see ``leg_joints``

    @property
    def turns(self) -> Array:
        """Return the rotation at each of the heights (N, 3, 3), in the shape's axes."""
        return turns_about(2, np.full(len(self.heights), self.yaw))

    @property
    def text(self) -> str:
        """Return the pose in words."""
        turned = f'turned by {math.degrees(self.yaw):.0f} degrees' if self.yaw else (
            'the axes parallel')
        return (f'{turned}, at any height' if self.length is None
                else f'{turned}, a mean leg of {self.length:.3g} m')


def home_pose(parameters: Parameters) -> Pose:
    """
    Return the home pose.

    Raises ParameterError: neither both limits of length nor a zero length that level legs can have
        give its height.
    """
    home = home_of(parameters)
    if not home.reachable:
        raise ParameterError(
            f'{parameters.source}: home pose: no level pose has all legs between '
            'limits.length_min and limits.length_max on the '
            f'{POSITIVE if home.side > 0.0 else NEGATIVE} side of the base')
    if home.length is None:
        rule = parameters.leg_kind.home_rule(parameters, home_legs(parameters)['base'])
        raise ParameterError(f'{parameters.source}: {rule}')
    return Pose(home.positions[0], home.rotations[0])


def choose_branch(parameters: Parameters) -> None:
    """
    Set the assembly of the legs that the parameters leave open.

    Raises ParameterError: there is no home pose, or it does not decide it.
    """
    def at_home() -> tuple[Array, Array]:
        home = home_pose(parameters)
        return home.position, home.rotation

    parameters.choose_branch(at_home)


def determinant_at_home(parameters: Parameters) -> float:
    """Return det(J) at home [m^3]; nan if the parameters give no home pose."""
    try:
        home = home_pose(parameters)
    except ParameterError:
        return math.nan
    legs = lagrange.unchecked_legs(parameters, home.position, home.rotation)
    return float(lagrange.determinant(legs))


def other_side(determinant: float, at_home: float) -> str:
    """Return the possible error if a motion begins with another sign of det(J), or nothing."""
    if not determinant * at_home < 0.0:
        return ''
    return (f'det(J) is {determinant:+.3g} m^3, at home {at_home:+.3g} m^3: the motion begins '
            'beyond a singularity; possible error: an axis of the other sign, or '
            'geometry.platform_side')


def homes(parameters: Parameters) -> tuple[Array, Array]:
    """
    Return possible home poses, the most likely first.

    Positions (N, 3) [m] and rotations (N, 3, 3). Half of them are on the other side of the base;
    if the parameters do not give the height, there are several on each.
    """
    home = home_of(parameters)
    return home.positions, home.rotations


def shape_of(p: Parameters) -> Shape:
    found = found_home(p)
    return Shape(found['base'], found['platform'], found['axes'].reshape(3, 3),
                 float(found['base_radius']), float(found['platform_radius']))


def level_axes(around: Array) -> Array:
    """Return two axes in the plane of points, and its normal, (3, 3)."""
    axes = np.empty((3, 3))
    function('level_axes')(len(around), np.ascontiguousarray(around), axes)
    return axes


def is_too_long(p: Parameters, name: str, shape: Shape) -> bool:
    return p[name] is not None and bool(np.max(p[name]) > _LENGTH_RATIO * shape.radius)


def home_of(p: Parameters) -> Home:
    """Return the level poses within the limits of length, and the possible heights at home."""
    found, shape = found_home(p), shape_of(p)
    longest = math.hypot(HEIGHTS[-1] * shape.radius, float(found['across']))
    if p.limits.length_max is not None and not is_too_long(p, 'limits.length_max', shape):
        longest = float(p.limits.length_max.max())
    count = int(found['count'])
    poses = found['poses'][:count].view(np.float64).reshape(-1, POSE.stop)
    return Home(
        shape, bool(found['reachable']), float(found['yaw']), longest, float(found['side']),
        bool(found['certain']), found['heights'][:count],
        float(found['length']) if found['known'] else None, poses[:, POSITION].copy(),
        poses[:, ROTATION].reshape(-1, 3, 3).copy(), found['base_directions'],
        found['platform_directions'], found['mounts'].reshape(6, 3, 3))


def found_home(p: Parameters) -> Any:
    """Return the structure ``home_poses`` () of a hexapod."""
    found = np.zeros((), record('home_poses'))
    function('find_home')(home_legs(p), _SIDES[p.geometry.platform_side], found)
    return found


def home_legs(p: Parameters) -> Any:
    """Return the structure ``home_legs`` (): the lines by which the home pose is found."""
    legs = np.zeros((), record('home_legs'))
    function('put_home_legs')(p.structure, legs)
    return legs


def poses_of(p: Parameters, shape: Shape, heights: Array, rotations: Array,
             ) -> tuple[Array, Array]:
    """Return positions (N, 3) and rotations (N, 3, 3) at these heights and turns of the shape."""
    middle = p.geometry.platform_joints.mean(axis=0)
    rotations = shape.axes.T @ rotations @ shape.axes
    positions = (home_legs(p)['base'].mean(axis=0) - rotations @ middle
                 + heights[:, None] * shape.axes[2])
    return positions, rotations


def turns_about(axis: int, angles: Array) -> Array:
    """Return rotations about one of the axes, (N, 3, 3)."""
    euler = np.zeros((len(angles), 3))
    euler[:, axis] = angles
    return from_euler(euler)
