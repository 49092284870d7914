# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as the writers of all formats need it: names, frames, bodies and shapes.

The axes of a leg's cylinder and piston are those of its mount at home: z along the leg. The origin
of the cylinder is the base joint, that of the piston the platform joint. Shapes are plates,
cylinders and balls, or meshes from files; their sizes follow from the geometry, as those of the
node's markers do, and have no influence on masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.mechanism import WORLD
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.telescopic import BARREL, BARREL_LENGTH, ROD
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.home_pose import homes, level_axes
from stewart_dynamics.mechanics.kinematics.leg_joints import joint_names, mounts, PLATFORM_JOINTS
from stewart_dynamics.parameters.table import inertia_matrix, mean_radius, Parameters

# A body that a tool simulates needs mass and inertia about each axis. What a parameter file gives
# as zero is replaced by these: the forces of a hexapod change by about 5e-4 of the largest.
_LEAST_MASS = 1e-4  # of the platform's
_LEAST_GYRATION = 0.1  # of the leg at home
AXIAL_INERTIA = 1e-6
"""Inertia of a leg's part about its own axis, in terms of the transverse one, where a format
requires one: in the model it is zero."""

# Mass of a link that is only a frame, in terms of the platform, where it needs one; its radius of
# gyration [m].
_FRAME_MASS, _FRAME_GYRATION = 1e-8, 0.1

PASSIVE_RATE = 1000.0
"""Limit of passive joints in formats that require a limit of every joint [m/s, rad/s]."""
_UNLIMITED_LENGTH = 10.0  # longest leg without a limit, in terms of its length at home
UNLIMITED = 1e9  # force or rate of a leg without a limit, where a format requires one [N, m/s]


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
    bearing: str  # name of the body fixed to the base that has the axes of the mount, in MJCF
    universal: tuple[str, str]  # names of these joints
    ball: str  # name of the joint at the platform, and of the frame on the platform where it is
    tip: str  # name of the end of the leg there
    base_joint: Array  # base frame (3,) [m]
    platform_joint: Array  # platform frame (3,) [m]
    mount: Array  # axes of the mount to base axes (3, 3)
    zero_length: float
    home_length: float  # [m]
    cylinder: RigidBody
    piston: RigidBody
    reflected_mass: float
    viscous_friction: float
    coulomb_friction: float
    limits: LegLimits


class LegLimits(NamedTuple):
    """The limits of a leg; None where it is unlimited."""

    length_min: float | None
    length_max: float | None
    velocity_max: float | None
    force_max: float | None

    def lengths(self, home_length: float) -> tuple[float, float]:
        """Return the shortest and longest length [m], wide bounds where a leg is unlimited."""
        return (0.0 if self.length_min is None else self.length_min,
                _UNLIMITED_LENGTH * home_length if self.length_max is None else self.length_max)


class Hexapod:
    """
    A hexapod at its home pose, where formats of closed loops begin, with the names of all bodies.

    Raises ParameterError if two joints or bodies would have the same name.
    """

    def __init__(self, parameters: Parameters) -> None:
        # Platform and payload are one body in all formats.
        self.parameters = parameters = parameters.merged()
        self.joints = joint_names(parameters)
        positions, rotations = homes(parameters)
        self.position, self.rotation = positions[0], rotations[0]
        self.base, self.platform = parameters.base_frame, parameters.platform_frame
        self.base_body = f'{WORLD}_base' if self.base == WORLD else self.base
        """The name of the base where a format has a world of its own, whose name is taken."""
        self.platform_body = RigidBody(
            self.platform, parameters.platform.mass, parameters.platform.center_of_mass,
            inertia_matrix(parameters.platform.inertia))
        directions = mounts(parameters)
        self.legs = tuple(self._leg(n, directions[n]) for n in range(6))
        self._check_names()

    def _check_names(self) -> None:
        """Raise ParameterError where a name is taken; some formats have one list for all."""
        names = [WORLD, self.base_body, self.platform, *self.joints]
        for leg in self.legs:
            names += [leg.cross, leg.bearing, leg.cylinder.name, leg.piston.name, leg.ball,
                      leg.tip]
        twice = [name for n, name in enumerate(names) if name in names[:n]]
        if twice:
            raise ParameterError(
                f'base_frame: {shown(self.base)}, platform_frame: {shown(self.platform)}, joints: '
                f'{shown(list(self.parameters.joints))}: the name {shown(twice[0])} would be '
                'there twice')

    def _leg(self, n: int, mount: Array) -> LegDescription:
        p = self.parameters
        first, second, name = self.joints[len(PLATFORM_JOINTS) + 3 * n:][:3]
        base, platform = p.geometry.base_joints[n], p.geometry.platform_joints[n]
        length = float(np.linalg.norm(self.position + self.rotation @ platform - base))
        return LegDescription(
            name, f'{name}_cross', f'{name}_mount', (first, second),
            f'{name}_platform_joint', f'{name}_tip', base, platform, mount,
            float(p.geometry.zero_length[n]), length,
            self._part(n, 'cylinder', 1.0), self._part(n, 'piston', -1.0),
            float(p.actuator.reflected_mass[n]), float(p.actuator.viscous_friction[n]),
            float(p.actuator.coulomb_friction[n]),
            LegLimits(*(None if p[f'limits.{each}'] is None else float(p[f'limits.{each}'][n])
                        for each in LegLimits._fields)))

    def _part(self, n: int, part: str, sign: float) -> RigidBody:
        of_part = self.parameters.legs.parts[part]
        across = float(of_part.inertia[n])
        center = sign * float(of_part.center_of_mass[n])
        return RigidBody(f'{self.parameters.joints[n]}_{part}', float(of_part.mass[n]),
                         np.array([0.0, 0.0, center + 0.0]), np.diag([across, across, 0.0]))

    def solid(self, body: RigidBody, leg: LegDescription) -> RigidBody:
        """Return a leg's body with mass and inertia about all axes, as tools need it."""
        mass = body.mass or _LEAST_MASS * self.platform_body.mass
        across = float(body.inertia[0, 0]) or mass * (_LEAST_GYRATION * leg.home_length) ** 2
        return body._replace(mass=mass, inertia=np.diag([
            across, across, AXIAL_INERTIA * across]))

    def frame_body(self, name: str) -> RigidBody:
        """Return a body of a mass that has no influence, where a frame needs one."""
        mass = _FRAME_MASS * self.platform_body.mass
        return RigidBody(name, mass, np.zeros(3), mass * _FRAME_GYRATION ** 2 * np.eye(3))


Color = tuple[float, float, float, float]

COLORS: dict[str, Color] = {
    'base': (0.3, 0.32, 0.35, 1.0), 'platform': (0.62, 0.7, 0.76, 1.0),
    'cylinder': (0.45, 0.48, 0.52, 1.0), 'piston': (0.9, 0.9, 0.9, 1.0),
    'joint': (0.12, 0.12, 0.12, 1.0)}

# Radii and thickness in terms of the mean distance of the platform joints from their center.
BALL, PLATE = 0.07, 0.05
# Parts of the shortest leg length, or of the length at home if there is no limit.
_ROD_LENGTH, _OF_HOME = 0.95, 0.7


class VisualShape(NamedTuple):
    """A cylinder along z, a ball, or a mesh; placed in the axes of its body."""

    kind: str  # cylinder, sphere or mesh
    color: str  # a key of COLORS
    position: Array  # of its center, or of the mesh's origin (3,) [m]
    rotation: Array  # its axes to those of the body (3, 3)
    radius: float = 0.0
    length: float = 0.0
    file: str = ''
    scale: float = 1.0


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
        found[leg.cylinder.name] = _mesh(hexapod, 'cylinder', uris) or (
            _rod('cylinder', BARREL * size, BARREL_LENGTH * _shortest(leg), 1.0),)
        found[leg.piston.name] = _mesh(hexapod, 'piston', uris) or (
            _rod('piston', ROD * size, _ROD_LENGTH * _shortest(leg), -1.0),)
    return found


def solids(looks: Sequence[VisualShape]) -> list[VisualShape]:
    """Return which shapes of a body others collide with: not the balls of its joints."""
    return [shape for shape in looks if shape.kind != 'sphere']


def _shortest(leg: LegDescription) -> float:
    return leg.limits.length_min or _OF_HOME * leg.home_length


def _rod(kind: str, radius: float, length: float, sign: float) -> VisualShape:
    return VisualShape('cylinder', kind, np.array([0.0, 0.0, 0.5 * sign * length]), np.eye(3),
                       radius, length)


def _plate(kind: str, joints: Array, thickness: float) -> VisualShape:
    center = joints.mean(axis=0)
    axes = level_axes(joints - center)
    radius = float(np.linalg.norm((joints - center) @ axes[:2].T, axis=1).max())
    return VisualShape('cylinder', kind, center, axes.T, max(radius, thickness), thickness)


def _mesh(hexapod: Hexapod, kind: str, uris: bool) -> tuple[VisualShape, ...]:
    p = hexapod.parameters
    file: str = p[f'meshes.{kind}']
    if not file or (not uris and '://' in file):
        return ()
    offset: Array = p[f'meshes.{kind}_offset']
    return (VisualShape('mesh', kind, offset[:3], from_euler(offset[3:]), file=file,
                        scale=p.meshes.scale),)
