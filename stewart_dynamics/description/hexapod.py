# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as the writers of all formats need it: names, frames, bodies and shapes.

All writers walk one tree, ``Hexapod.tree``: base, two bodies of each leg, platform, as
``LegBranch`` has them. Shapes are plates, cylinders and balls, or meshes from files; their sizes
follow from the geometry, as those of the node's markers do, and have no influence on masses.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.mechanism import (
    FIXED, HERE, Joint, MechanismBody, OTHER, Placement, UNIVERSAL, WORLD)
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


def massless(name: str) -> MechanismBody:
    """Return a body that is only a frame."""
    return MechanismBody(name, HERE, 0.0)


class LegDescription(NamedTuple):
    """A leg: its names, the points of its joints, and its branch of the tree."""

    name: str
    cross: str  # name of the massless body between the joints of the universal joint
    bearing: str  # name of the body that has the axes of the mount, in MJCF
    universal: tuple[str, str]  # names of these joints
    bodies: tuple[str, str]
    ball: str  # name of the joint at the platform, and of the frame on the platform where it is
    tip: str  # name of the end of the leg there
    base_joint: Array  # base frame (3,) [m]
    platform_joint: Array  # platform frame (3,) [m]
    branch: LegBranch

    @property
    def last(self) -> str:
        """Return the name of the body at the platform."""
        return self.bodies[-1]

    @property
    def end_frame(self) -> str:
        """Return the name of the frame on it whose origin is the joint at the platform."""
        return self.tip if self.branch.end.any() else self.last


class TreeBody(NamedTuple):
    """A body at home, placed in base axes, and the joint that carries it on the one before it."""

    body: MechanismBody
    joint: Joint  # FIXED: the base in the world; OTHER: the platform, which the legs carry
    at_home: Placement  # in the body before it
    at_zero: Placement  # where the position of the joint is zero
    shapes: tuple[VisualShape, ...]
    leg: LegDescription | None = None


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
        self.platform_body = MechanismBody(
            self.platform, Placement(self.rotation, self.position), parameters.platform.mass,
            parameters.platform.center_of_mass, inertia_matrix(parameters.platform.inertia))
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
            names += [leg.cross, leg.bearing, *leg.bodies, leg.ball, leg.tip]
        twice = [name for n, name in enumerate(names) if name in names[:n]]
        if twice:
            raise ParameterError(
                f'base_frame: {shown(self.base)}, platform_frame: {shown(self.platform)}, joints: '
                f'{shown(list(self.parameters.joints))}: the name {shown(twice[0])} would be '
                'there twice')

    def _leg(self, n: int, branch: LegBranch) -> LegDescription:
        p = self.parameters
        name = p.joints[n]
        first, second = (f'{name}_{each}' for each in UNIVERSAL_JOINTS)
        lower, upper = (f'{name}_{link.part}' for link in branch.links)
        return LegDescription(
            name, f'{name}_cross', f'{name}_mount', (first, second), (lower, upper),
            f'{name}_platform_joint', f'{name}_tip', p.geometry.base_joints[n],
            p.geometry.platform_joints[n], branch)

    def tree(self, base: str = '', solid: bool = True, uris: bool = True, from_home: bool = False,
             paired: bool = False, unlimited: float | None = None) -> list[TreeBody]:
        """
        Return base, bodies of each leg from the base on, and platform, as a format has them.

        base: the base's name, by default ``base_body``.
        solid: whether bodies of legs get mass and inertia about all axes, as simulators require.
        uris: whether meshes may be URIs, such as package://, and not only paths.
        from_home: whether the format counts the positions of drives from home. Kinds of legs whose
            zero is not a parameter are then counted from the zero of their parameters.
        paired: whether a joint with one limit of position gets the other one as well.
        unlimited: rate [m/s, rad/s] and effort [N, N m] of a drive without these limits, where
            the format requires them.
        """
        base = base or self.base_body
        p, size = self.parameters.geometry, mean_radius(self.parameters.geometry.platform_joints)
        at_base, at_platform = (
            self._mesh(part, uris) or _plate(part, joints, size) for part, joints in (
                ('base', p.base_joints), ('platform', p.platform_joints)))
        found = [TreeBody(massless(base), Joint(f'{base}_to_world', FIXED, WORLD, base,
                                                HERE.position), HERE, HERE, at_base)]
        for n, leg in enumerate(self.legs):
            at, parent = HERE, base
            for link, name in zip(leg.branch.links, leg.bodies, strict=True):
                at = at.of(link.at_home)
                joint = Joint(leg.name, link.joint, parent, name, at.position,
                              [at.rotation[:, 2]])
                if link.joint == UNIVERSAL:
                    joint.name, joint.axes = f'{leg.name}_universal', [*at.rotation.T[:2]]
                else:
                    self._add_drive(joint, n, from_home, paired, unlimited)
                body = MechanismBody(name, at, link.mass, link.center, link.inertia)
                found.append(TreeBody(
                    self.solid(link, body) if solid else body, joint, link.at_home, link.at_zero,
                    self._mesh(link.part, uris) or link.shapes, leg))
                parent = name
        platform = self.platform_body
        return [*found, TreeBody(
            platform, Joint(self.platform, OTHER, base, self.platform, self.position),
            platform.placement, HERE, at_platform)]

    def _add_drive(self, joint: Joint, n: int, from_home: bool, paired: bool,
                   unlimited: float | None) -> None:
        """Add position at home, limits and actuator to the joint of a drive; see ``tree``."""
        p, branch, kind = self.parameters, self.legs[n].branch, self.kind
        origin = branch.zero
        if from_home:
            origin = branch.home if kind.zero else 0.0
        limits = [None if p[each] is None else float(p[each][n]) for each in kind.drive_limits]
        ends, (rate, effort) = limits[:2], limits[2:]
        if unlimited is not None or paired and ends != [None, None]:
            ends = [wide if end is None else end
                    for end, wide in zip(ends, branch.widest, strict=True)]
        joint.position = branch.home - origin
        joint.lower, joint.upper = (None if end is None else end - origin for end in ends)
        joint.velocity_max, joint.force_max = rate or unlimited, effort or unlimited
        joint.damping = float(p.actuator.viscous_friction[n])
        joint.friction = float(p.actuator.coulomb_friction[n])
        joint.armature = float(p[kind.fields['reflected_mass']][n])

    def _mesh(self, part: str, uris: bool) -> tuple[VisualShape, ...]:
        p = self.parameters
        file: str = p[f'meshes.{part}'] if f'meshes.{part}' in p else ''
        if not file or (not uris and '://' in file):
            return ()
        offset: Array = p[f'meshes.{part}_offset']
        return (VisualShape('mesh', part, offset[:3], from_euler(offset[3:]), file=file,
                            scale=p.meshes.scale),)

    def solid(self, link: LegLink, body: MechanismBody) -> MechanismBody:
        """Return a leg's body with mass and inertia about all axes, as tools need it."""
        mass = body.mass or _LEAST_MASS * (self.platform_body.mass or 0.0)
        moments = np.linalg.eigvalsh(body.inertia)
        if not link.slender and moments[0] > 0.0 and moments[:2].sum() >= moments[2]:
            return replace(body, mass=mass)
        across = float(body.inertia[0, 0] if link.slender else body.inertia[2, 2]) or (
            mass * (_LEAST_GYRATION * link.size) ** 2)
        return replace(body, mass=mass, inertia=across * np.diag(
            [1.0, 1.0, AXIAL_INERTIA] if link.slender else [_HALF, _HALF, 1.0]))

    def frame_body(self, name: str) -> MechanismBody:
        """Return a body of a mass that has no influence, where a frame needs one."""
        mass = _FRAME_MASS * (self.platform_body.mass or 0.0)
        return MechanismBody(name, HERE, mass, inertia=mass * _FRAME_GYRATION ** 2 * np.eye(3))


Color = tuple[float, float, float, float]

COLORS: dict[str, Color] = {
    'base': (0.3, 0.32, 0.35, 1.0), 'platform': (0.62, 0.7, 0.76, 1.0),
    'lower': (0.45, 0.48, 0.52, 1.0), 'upper': (0.9, 0.9, 0.9, 1.0),
    'joint': (0.12, 0.12, 0.12, 1.0)}


def _plate(part: str, joints: Array, size: float) -> tuple[VisualShape, ...]:
    """Return a plate under joints, and a ball at each; size: see ``LegKind.branches``."""
    center = joints.mean(axis=0)
    axes = level_axes(joints - center)
    radius, thickness = np.linalg.norm((joints - center) @ axes[:2].T, axis=1).max(), PLATE * size
    return (VisualShape('cylinder', part, center, axes.T, max(float(radius), thickness),
                        thickness),
            *(VisualShape('sphere', 'joint', joint, np.eye(3), BALL * size) for joint in joints))
