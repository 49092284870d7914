# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as the writers of all formats need it: names, frames, bodies and shapes.

A leg has two bodies, whose joints and axes ``LegBranch`` has. Shapes are plates,
cylinders and balls, or meshes from files; their sizes follow from the geometry, as those of the
node's markers do, and have no influence on masses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.mechanism import UNIVERSAL, WORLD
from stewart_dynamics.legs.tree import (
    BALL, LegBranch, LegLink, PLATE, UNIVERSAL_JOINTS, VisualShape)
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.home_pose import choose_branch, homes, level_axes
from stewart_dynamics.mechanics.kinematics.leg_joints import joint_names, mounts
from stewart_dynamics.parameters.table import inertia_matrix, mean_radius, Parameters

# A body that a tool simulates needs mass and inertia about each axis. What a parameter file gives
# as zero is replaced by these: the forces of a hexapod change by about 5e-4 of the largest.
_LEAST_MASS = 1e-4  # of the platform's
_LEAST_GYRATION = 0.1  # of the leg at home
_HALF = 0.6  # of the inertia about z, about other axes: a body has more than half of it
AXIAL_INERTIA = 1e-6
"""Inertia of a leg's part about its own axis, in terms of the transverse one, where a format
requires one: in the model it is zero."""

# Mass of a link that is only a frame, in terms of the platform, where it needs one; its radius of
# gyration [m].
_FRAME_MASS, _FRAME_GYRATION = 1e-8, 0.1

PASSIVE_RATE = 1000.0
"""Limit of passive joints in formats that require a limit of every joint [m/s, rad/s]."""
UNLIMITED = 1e9  # effort or rate of a leg without a limit, where a format requires one


class RigidBody(NamedTuple):
    """A rigid body."""

    name: str
    mass: float  # [kg]
    center: Array  # center of mass, axes of the body (3,) [m]
    inertia: Array  # about the center of mass, axes of the body (3, 3) [kg m^2]


def massless(name: str) -> RigidBody:
    """Return a body that is only a frame."""
    return RigidBody(name, 0.0, np.zeros(3), np.zeros((3, 3)))


class LegDescription(NamedTuple):
    """A leg: its names, its joints, its two bodies, and the properties of its actuator."""

    name: str
    cross: str  # name of the massless body between the joints of the universal joint
    bearing: str  # name of the body that has the axes of the mount, in MJCF
    universal: tuple[str, str]  # names of these joints
    ball: str  # name of the joint at the platform, and of the frame on the platform where it is
    tip: str  # name of the end of the leg there
    base_joint: Array  # base frame (3,) [m]
    platform_joint: Array  # platform frame (3,) [m]
    branch: LegBranch
    bodies: tuple[RigidBody, RigidBody]  # of its links
    reflected: float  # mass or inertia
    viscous_friction: float
    coulomb_friction: float
    limits: DriveLimits

    @property
    def links(self) -> Iterator[tuple[LegLink, RigidBody]]:
        """Return its links with their bodies, from the base on."""
        return zip(self.branch.links, self.bodies, strict=True)

    @property
    def drive(self) -> LegLink:
        """Return the link that the drive moves."""
        return next(link for link in self.branch.links if link.joint != UNIVERSAL)

    @property
    def last(self) -> RigidBody:
        """Return the body at the platform."""
        return self.bodies[-1]

    @property
    def end_frame(self) -> str:
        """Return the name of the frame on it whose origin is the joint at the platform."""
        return self.tip if self.branch.end.any() else self.last.name

    @property
    def at_home(self) -> float:
        """Return the position of the joint of the drive at home [m, rad]."""
        return self.branch.home - self.branch.zero

    def carrier(self, link: LegLink, base: str) -> str:
        """Return the name of the body before a link; ``base`` is that of the base."""
        return base if link is self.branch.links[0] else self.bodies[0].name

    def bounds(self) -> tuple[float, float]:
        """Return the limits of its position, wide bounds where it is unlimited [m, rad]."""
        widest, limits = self.branch.widest, self.limits
        return (widest[0] if limits.lowest is None else limits.lowest,
                widest[1] if limits.highest is None else limits.highest)


class DriveLimits(NamedTuple):
    """The limits of a drive; None where it is unlimited."""

    lowest: float | None
    highest: float | None
    rate: float | None
    effort: float | None


class Hexapod:
    """
    A hexapod at its home pose, where formats of closed loops begin, with the names of all bodies.

    Raises ParameterError if two joints or bodies would have the same name.
    """

    def __init__(self, parameters: Parameters) -> None:
        # Platform and payload are one body in all formats.
        self.parameters = parameters = parameters.merged()
        self.joints = joint_names(parameters)
        choose_branch(parameters)
        positions, rotations = homes(parameters)
        self.position, self.rotation = positions[0], rotations[0]
        self.base, self.platform = parameters.base_frame, parameters.platform_frame
        self.base_body = f'{WORLD}_base' if self.base == WORLD else self.base
        """The name of the base where a format has a world of its own, whose name is taken."""
        self.platform_body = RigidBody(
            self.platform, parameters.platform.mass, parameters.platform.center_of_mass,
            inertia_matrix(parameters.platform.inertia))
        size = mean_radius(parameters.geometry.platform_joints)
        self.kind = parameters.leg_kind
        branches = self.kind.branches(
            parameters, self.position, self.rotation, mounts(parameters), size)
        self.legs = tuple(self._leg(n, branch) for n, branch in enumerate(branches))
        lower, upper = self.kind.parts
        self.colors = {'base': COLORS['base'], 'platform': COLORS['platform'],
                       lower: COLORS['lower'], upper: COLORS['upper'], 'joint': COLORS['joint']}
        """Colors of base, platform, parts of legs and joints."""
        self._check_names()

    def _check_names(self) -> None:
        """Raise ParameterError where a name is taken; some formats have one list for all."""
        names = [WORLD, self.base_body, self.platform, *self.joints]
        for leg in self.legs:
            names += [leg.cross, leg.bearing, *(body.name for body in leg.bodies), leg.ball,
                      leg.tip]
        twice = [name for n, name in enumerate(names) if name in names[:n]]
        if twice:
            raise ParameterError(
                f'base_frame: {shown(self.base)}, platform_frame: {shown(self.platform)}, joints: '
                f'{shown(list(self.parameters.joints))}: the name {shown(twice[0])} would be '
                'there twice')

    def _leg(self, n: int, branch: LegBranch) -> LegDescription:
        p = self.parameters
        name = p.joints[n]
        low, high = self.kind.position_limits
        return LegDescription(
            name, f'{name}_cross', f'{name}_mount',
            (f'{name}_{UNIVERSAL_JOINTS[0]}', f'{name}_{UNIVERSAL_JOINTS[1]}'),
            f'{name}_platform_joint', f'{name}_tip', p.geometry.base_joints[n],
            p.geometry.platform_joints[n], branch,
            (_body(name, branch.links[0]), _body(name, branch.links[1])),
            float(p[self.kind.fields['reflected_mass']][n]),
            float(p.actuator.viscous_friction[n]), float(p.actuator.coulomb_friction[n]),
            DriveLimits(*(None if p[each] is None else float(p[each][n]) for each in (
                low, high, self.kind.rate_limit, self.kind.effort_limit))))

    def solid(self, link: LegLink, body: RigidBody) -> RigidBody:
        """Return a leg's body with mass and inertia about all axes, as tools need it."""
        mass = body.mass or _LEAST_MASS * self.platform_body.mass
        moments = np.linalg.eigvalsh(body.inertia)
        if not link.slender and moments[0] > 0.0 and moments[:2].sum() >= moments[2]:
            return body._replace(mass=mass)
        across = float(body.inertia[0, 0] if link.slender else body.inertia[2, 2]) or (
            mass * (_LEAST_GYRATION * link.size) ** 2)
        return body._replace(mass=mass, inertia=across * np.diag(
            [1.0, 1.0, AXIAL_INERTIA] if link.slender else [_HALF, _HALF, 1.0]))

    def frame_body(self, name: str) -> RigidBody:
        """Return a body of a mass that has no influence, where a frame needs one."""
        mass = _FRAME_MASS * self.platform_body.mass
        return RigidBody(name, mass, np.zeros(3), mass * _FRAME_GYRATION ** 2 * np.eye(3))


def _body(leg: str, link: LegLink) -> RigidBody:
    return RigidBody(f'{leg}_{link.part}', link.mass, link.center, link.inertia)


Color = tuple[float, float, float, float]

COLORS: dict[str, Color] = {
    'base': (0.3, 0.32, 0.35, 1.0), 'platform': (0.62, 0.7, 0.76, 1.0),
    'lower': (0.45, 0.48, 0.52, 1.0), 'upper': (0.9, 0.9, 0.9, 1.0),
    'joint': (0.12, 0.12, 0.12, 1.0)}


def shapes(hexapod: Hexapod, uris: bool = True) -> dict[str, tuple[VisualShape, ...]]:
    """Return the shapes of each body, by its name; without ``uris`` only meshes that are paths."""
    p = hexapod.parameters
    base, platform = p.geometry.base_joints, p.geometry.platform_joints
    size = mean_radius(platform)
    found = {}
    for name, kind, joints in ((hexapod.base, 'base', base),
                               (hexapod.platform, 'platform', platform)):
        found[name] = _mesh(hexapod, kind, uris) or (_plate(kind, joints, PLATE * size), *(
            VisualShape('sphere', 'joint', joint, np.eye(3), BALL * size) for joint in joints))
    for leg in hexapod.legs:
        for link, body in leg.links:
            found[body.name] = _mesh(hexapod, link.part, uris) or link.shapes
    return found


def solids(looks: Sequence[VisualShape]) -> list[VisualShape]:
    """Return which shapes of a body others collide with: not the balls of its joints."""
    return [shape for shape in looks if shape.kind != 'sphere']


def _plate(kind: str, joints: Array, thickness: float) -> VisualShape:
    center = joints.mean(axis=0)
    axes = level_axes(joints - center)
    radius = float(np.linalg.norm((joints - center) @ axes[:2].T, axis=1).max())
    return VisualShape('cylinder', kind, center, axes.T, max(radius, thickness), thickness)


def _mesh(hexapod: Hexapod, kind: str, uris: bool) -> tuple[VisualShape, ...]:
    p = hexapod.parameters
    file: str = p[f'meshes.{kind}'] if f'meshes.{kind}' in p else ''
    if not file or (not uris and '://' in file):
        return ()
    offset: Array = p[f'meshes.{kind}_offset']
    return (VisualShape('mesh', kind, offset[:3], from_euler(offset[3:]), file=file,
                        scale=p.meshes.scale),)
