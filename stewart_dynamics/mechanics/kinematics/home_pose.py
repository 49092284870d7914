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
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.parameters.table import AUTO, NEGATIVE, Parameters, POSITIVE, six_of

# Largest length, in larger radii: legs have 1 to 10, legs given in mm 1000 times that.
_LENGTH_RATIO = 100.0

# Heights that are tried if the parameters do not give one, in larger radii.
HEIGHTS = (0.3, 0.6, 1.0, 1.7, 3.0)
_YAWS = np.deg2rad(np.arange(0.0, 360.0, 10.0))


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

    @property
    def turns(self) -> Array:
        """Return the rotation at each of the heights (N, 3, 3), in the shape's axes."""
        return turns_about(2, np.full(len(self.heights), self.yaw))

    def poses(self, parameters: Parameters) -> tuple[Array, Array]:
        """Return positions (N, 3) [m] and rotations (N, 3, 3) at the heights."""
        with np.errstate(all='ignore'):
            return poses_of(parameters, self.shape, self.heights, self.turns)

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
        raise ParameterError(f'{parameters.source}: {parameters.leg_kind.home_rule(parameters)}')
    positions, rotations = home.poses(parameters)
    return Pose(positions[0], rotations[0])


def determinant_at_home(parameters: Parameters) -> float:
    """Return det(J) at home [m^3]; nan if the parameters give no home pose."""
    try:
        home = home_pose(parameters)
    except ParameterError:
        return math.nan
    legs = lagrange.unchecked_legs(parameters, home.position, home.rotation)
    return float(lagrange.determinant(legs))


def other_side(determinant: float, at_home: float) -> str:
    """Return the likely mistake if a motion begins with another sign of det(J), or nothing."""
    if not determinant * at_home < 0.0:
        return ''
    return (f'det(J) is {determinant:+.3g} m^3, at home {at_home:+.3g} m^3: the motion begins '
            'beyond a singularity; likely mistake: an axis of the other sign, or '
            'geometry.platform_side')


def homes(parameters: Parameters) -> tuple[Array, Array]:
    """
    Return possible home poses, the most likely first.

    Positions (N, 3) [m] and rotations (N, 3, 3). Half of them are on the other side of the base;
    if the parameters do not give the height, there are several on each.
    """
    return home_of(parameters).poses(parameters)


def shape_of(p: Parameters) -> Shape:
    base, platform = p.leg_kind.home_legs(p).anchors, p.geometry.platform_joints
    around, carried = base - base.mean(axis=0), platform - platform.mean(axis=0)
    axes = level_axes(around)
    return Shape(around @ axes.T, carried @ axes.T, axes, mean_norm(around),
                 mean_norm(carried))


def level_axes(around: Array) -> Array:
    """Return two axes in the plane of points, and its normal, (3, 3)."""
    moments = around.T @ around
    if not np.isfinite(moments).all():
        return np.eye(3)
    # The normal of a plane is the direction in which its points spread least.
    normal = np.linalg.eigh(moments)[1][:, 0]
    nearest = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[nearest])
    first = np.cross(np.eye(3)[(nearest + 2) % 3], normal)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])


def mean_norm(vectors: Array) -> float:
    return float(np.mean(np.linalg.norm(vectors, axis=-1)))


def is_too_long(p: Parameters, name: str, shape: Shape) -> bool:
    return p[name] is not None and bool(np.max(p[name]) > _LENGTH_RATIO * shape.radius)


def home_of(p: Parameters) -> Home:
    """Return the level poses within the limits of length, and the possible heights at home."""
    with np.errstate(all='ignore'):
        lines, shape = p.leg_kind.home_legs(p), shape_of(p)
        offsets = (turns_about(2, _YAWS) @ shape.platform.T).swapaxes(-1, -2) - shape.base
        above, below = (_reached(p, offsets, side) for side in (1.0, -1.0))
        given = p.geometry.platform_side
        certain = given != AUTO or bool(above.any() != below.any())
        side = -1.0 if given == NEGATIVE or given == AUTO and certain and below.any() else 1.0
        reached = above if side > 0.0 else below
        angles = np.abs((_YAWS + np.pi) % (2.0 * np.pi) - np.pi)
        yaw = float(_YAWS[np.argmin(np.where(reached, angles, np.inf))]) if reached.any() else 0.0
        across = float(np.linalg.norm(offsets[..., :2], axis=-1).max())
        longest = math.hypot(HEIGHTS[-1] * shape.radius, across)
        high, length = lines.longest, lines.length
        if high is not None and not is_too_long(p, 'limits.length_max', shape):
            longest = float(high.max())
        legs = shape.platform @ turns_about(2, np.array([yaw]))[0].T - shape.base  # at no height
        known = mean_norm(legs) < length < _LENGTH_RATIO * shape.radius
        heights = [each * _height(shape, each, legs, length) for each in (side, -side)] if (
            known) else [each * height * shape.radius
                         for each in (side, -side) for height in HEIGHTS]
    return Home(shape, bool(reached.any()), yaw, longest, side, certain, np.array(heights),
                length if known else None)


def _reached(p: Parameters, offsets: Array, side: float) -> Flags:
    """
    Return at which turns all legs are within their limits at some height, on one side.

    offsets (turns, 6, 3): the legs while the center of the platform is at that of the base [m].
    """
    lines = p.leg_kind.home_legs(p)
    low, high = six_of(lines.shortest, 0.0), six_of(lines.longest, np.inf)
    across, along = np.linalg.norm(offsets[..., :2], axis=-1), side * offsets[..., 2]
    # The height of a leg is that of the platform plus the platform joint's own.
    least = np.sqrt(np.maximum(low ** 2 - across ** 2, 0.0)) - along
    most = np.where(high >= across, np.sqrt(np.abs(high ** 2 - across ** 2)), -np.inf) - along
    reached: Flags = least.max(axis=-1) <= most.min(axis=-1)
    return reached


def _height(shape: Shape, side: float, legs: Array, length: float) -> float:
    """Return the distance from the base at which the mean leg has a length, on one side."""
    across, along = (legs[:, :2] ** 2).sum(axis=1).tolist(), legs[:, 2].tolist()
    low, high = 0.0, length + shape.base_radius + shape.platform_radius
    for _ in range(60):
        middle = 0.5 * (low + high)
        total = 0.0
        for square, height in zip(across, along, strict=True):
            raised = height + side * middle
            total += math.sqrt(square + raised * raised)
        if total / len(along) < length:
            low = middle
        else:
            high = middle
    return high


def poses_of(p: Parameters, shape: Shape, heights: Array, rotations: Array,
             ) -> tuple[Array, Array]:
    """Return positions (N, 3) and rotations (N, 3, 3) at these heights and turns of the shape."""
    middle = p.geometry.platform_joints.mean(axis=0)
    rotations = shape.axes.T @ rotations @ shape.axes
    positions = (p.leg_kind.home_legs(p).anchors.mean(axis=0) - rotations @ middle
                 + heights[:, None] * shape.axes[2])
    return positions, rotations


def turns_about(axis: int, angles: Array) -> Array:
    """Return rotations about one of the axes, (N, 3, 3)."""
    euler = np.zeros((len(angles), 3))
    euler[:, axis] = angles
    return from_euler(euler)
