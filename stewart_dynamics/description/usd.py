# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as USD with UsdPhysics: rigid bodies, joints, drives; for Isaac Sim and other tools.

The world's axes are base axes, in which gravity is given. A solver of articulations (reduced
coordinates) needs a tree: the platform hangs on the first leg, and the ball joints of the other
five have ``excludeFromArticulation``, so that they close the loops. Solvers of maximal coordinates
ignore the flag. ``body0`` of each joint is the parent in the tree. Positions of the legs' joints
are counted from the home pose.

Angles are in degrees, and the damping of a drive that turns is by rates in degrees per second.

Coulomb friction, reflected mass and the limit of the rate have no attribute in UsdPhysics, but in
the schemas of Newton and PhysX. ``physxJoint:jointFriction``, a number without unit, is not
written. Attributes are single-precision: attributes ``stewart_dynamics:...`` of the model have the
parameters in full.
"""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import (
    Color, Hexapod, LegDescription, massless, RigidBody, shapes)
from stewart_dynamics.description.mjcf import SOLIMP, SOLREF_LOOP
from stewart_dynamics.description.xml_text import CARRIED, carried, solid_elements
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.mechanism import Placement, SLIDE, UNIVERSAL
from stewart_dynamics.legs.tree import VisualShape
from stewart_dynamics.mechanics.frames.rotation import to_quaternion

if TYPE_CHECKING:
    from pxr import Usd

_FREE = 179.0  # degrees; PhysX takes less than half a turn
_LOCKED = 1.0, -1.0  # a lower limit above the upper one locks an axis
LINEAR, ANGULAR = 'linear', 'angular'  # drives


def armature(axis: str) -> tuple[str, ...]:
    """Return attributes of a joint with its armature, of Newton and PhysX."""
    return 'newton:armature', f'physxJointAxis:{axis}:armature', 'physxJoint:armature'


def coulomb_friction(axis: str) -> tuple[str, ...]:
    """Return attributes of a joint with its Coulomb friction."""
    return ('newton:friction', f'physxJointAxis:{axis}:staticFrictionEffort',
            f'physxJointAxis:{axis}:dynamicFrictionEffort')


def rate_limit(axis: str) -> tuple[str, ...]:
    """Return attributes of a joint with the limit of its rate."""
    return ('newton:velocityLimit', f'physxJointAxis:{axis}:maxJointVelocity',
            'physxJoint:maxJointVelocity')


# MuJoCo's defaults; its schema needs all five numbers.
_MIDPOINT_POWER = 0.5, 2.0
_EQUALITY = 'MjcEqualityConnectAPI'
_SCHEMAS = 'NewtonJointAPI', 'PhysxJointAPI'  # and PhysxJointAxisAPI of the axis
# Attributes of the model with a parameter, and with the value that its own attributes have.
VALUE, ELEMENT = f'{CARRIED}:value', f'{CARRIED}:element'
POSITION = f'{CARRIED}:position'
"""Attribute of a joint with its position at the poses of the file, where parameters count it."""
_EXACT = (
    'gravity', 'geometry.base_joints', 'geometry.platform_joints', 'platform.mass',
    'platform.center_of_mass', 'platform.inertia')


def usd(hexapod: Hexapod, name: str) -> str:
    """
    Return a hexapod at home as the text of a .usda file.

    Raises StewartError: usd-core is not installed.
    """
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
    except ImportError as exc:
        raise StewartError(
            "--usd: needs usd-core: pip install 'stewart_dynamics[usd]'") from exc
    stage = Usd.Stage.CreateInMemory()
    stage.SetMetadata('comment', f'Written by stewart_describe {__version__}.')
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, f'/{_prim(name)}')
    stage.SetDefaultPrim(root.GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(root.GetPrim())
    scene = UsdPhysics.Scene.Define(stage, '/physicsScene')
    gravity = hexapod.parameters.gravity
    size = float(np.linalg.norm(gravity))
    scene.CreateGravityMagnitudeAttr(size)
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(gravity / size if size else (0.0, 0.0, -1.0))))
    writer = _Writer(stage, str(root.GetPath()), hexapod.colors)
    looks = shapes(hexapod, uris=False)
    writer.body(massless(hexapod.base_body), np.zeros(3), np.eye(3), looks[hexapod.base])
    writer.joint('Fixed', f'{hexapod.base_body}_to_world', None, hexapod.base_body, np.zeros(3),
                 np.eye(3), np.zeros(3))
    writer.body(hexapod.platform_body, hexapod.position, hexapod.rotation,
                looks[hexapod.platform])
    for n, leg in enumerate(hexapod.legs):
        _leg(writer, hexapod, leg, looks, excluded=n > 0)
    zero = [hexapod.kind.zero] if hexapod.kind.zero else []
    for name, parameter in carried(hexapod.parameters, _elements(hexapod), zero):
        for prefix, value in ((VALUE, parameter.value), (ELEMENT, parameter.element)):
            if value:
                root.GetPrim().CreateAttribute(
                    attribute_name(prefix, name), Sdf.ValueTypeNames.String).Set(value)
    text: str = stage.GetRootLayer().ExportToString()
    return text


def attribute_name(prefix: str, name: str) -> str:
    """Return the name of an attribute for a parameter."""
    return f'{prefix}:{name.replace(".", ":")}'


def _elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the values of the attributes of the formats, before they are single-precision."""
    p = hexapod.parameters
    kind = hexapod.kind
    found: dict[str, Any] = {
        name: kind.expanded(p, name) for name in (*_EXACT, *kind.elements)} | solid_elements(
            hexapod)
    frames = {'base_frame': hexapod.base_body, 'platform_frame': hexapod.platform}
    found |= {name: _prim(frame) for name, frame in frames.items() if _prim(frame) != p[name]}
    # Readers add the position of a joint that is written, and count from home where it is not.
    homes = np.array([leg.branch.home if kind.zero else 0.0 for leg in hexapod.legs])
    found |= {name: None if p[name] is None else p[name] - (
        homes if name in kind.position_limits else 0.0) for name in kind.drive_limits}
    return found


def _leg(writer: _Writer, hexapod: Hexapod, leg: LegDescription,
         looks: dict[str, tuple[VisualShape, ...]], excluded: bool) -> None:
    at = Placement(np.eye(3), np.zeros(3))
    for link, body in leg.links:
        at = at.of(link.at_home)
        writer.body(hexapod.solid(link, body), at.position, at.rotation, looks[body.name])
    for link, body in leg.links:
        parent = leg.carrier(link, hexapod.base_body)
        if link.joint == UNIVERSAL:
            universal = writer.joint('', f'{leg.name}_universal', parent, body.name,
                                     link.at_home.position, link.at_home.rotation, np.zeros(3))
            for axis in ('transX', 'transY', 'transZ', 'rotZ'):
                writer.limit(universal, axis, *_LOCKED)
            # Free in UsdPhysics, but locked in Newton without limits.
            for axis in ('rotX', 'rotY'):
                writer.limit(universal, axis, -_FREE, _FREE)
        else:
            slides = link.joint == SLIDE
            drive = writer.joint('Prismatic' if slides else 'Revolute', leg.name, parent,
                                 body.name, link.at_home.position, link.at_home.rotation,
                                 np.zeros(3))
            writer.drive(drive, leg, LINEAR if slides else ANGULAR, not hexapod.kind.zero)
    ball = writer.joint('Spherical', leg.ball, leg.last.name, hexapod.platform, leg.branch.end,
                        at.rotation.T @ hexapod.rotation, leg.platform_joint)
    ball.CreateExcludeFromArticulationAttr(excluded)
    if excluded:
        writer.stiff(ball)


def _prim(name: str) -> str:
    """Return a name as USD allows it."""
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))


class _Writer:
    """Writes bodies and joints below a root prim."""

    def __init__(self, stage: Usd.Stage, root: str, colors: dict[str, Color]) -> None:
        from pxr import Gf, UsdGeom, UsdPhysics

        self._stage, self._root, self._colors = stage, root, colors
        self._gf, self._geom, self._physics = Gf, UsdGeom, UsdPhysics

    def body(self, body: RigidBody, position: Array, rotation: Array,
             looks: tuple[VisualShape, ...]) -> None:
        """Add a rigid body; one without mass is the base, fixed to the world."""
        xform = self._geom.Xform.Define(self._stage, self._path(body.name))
        self._place(xform, position, rotation)
        prim = xform.GetPrim()
        self._physics.RigidBodyAPI.Apply(prim)
        mass = self._physics.MassAPI.Apply(prim)
        moments, axes = np.linalg.eigh(body.inertia)
        axes = axes * np.sign(np.linalg.det(axes))
        mass.CreateMassAttr(body.mass or 1.0)
        mass.CreateCenterOfMassAttr(self._gf.Vec3f(*body.center.tolist()))
        mass.CreateDiagonalInertiaAttr(self._gf.Vec3f(*(
            moments if body.mass else np.ones(3)).tolist()))
        mass.CreatePrincipalAxesAttr(self._quaternion(axes, self._gf.Quatf))
        for n, shape in enumerate(looks):
            self._shape(f'{self._path(body.name)}/shape_{n}', shape)

    def joint(self, kind: str, name: str, first: str | None, second: str, position: Array,
              rotation: Array, in_second: Array) -> Any:
        """
        Add a joint of a kind of UsdPhysics, of six axes if empty; its axes are the second's.

        position, rotation: of the joint in the first body, or in the world.
        """
        define = getattr(self._physics, f'{kind}Joint').Define
        joint = define(self._stage, f'{self._root}/joints/{_prim(name)}')
        if first is not None:
            joint.CreateBody0Rel().SetTargets([self._path(first)])
        joint.CreateBody1Rel().SetTargets([self._path(second)])
        joint.CreateLocalPos0Attr(self._gf.Vec3f(*position.tolist()))
        joint.CreateLocalRot0Attr(self._quaternion(rotation, self._gf.Quatf))
        joint.CreateLocalPos1Attr(self._gf.Vec3f(*in_second.tolist()))
        joint.CreateLocalRot1Attr(self._gf.Quatf(1.0))
        return joint

    def limit(self, joint: Any, axis: str, low: float, high: float) -> None:
        """Limit an axis of a joint."""
        limit = self._physics.LimitAPI.Apply(joint.GetPrim(), axis)
        limit.CreateLowAttr(low)
        limit.CreateHighAttr(high)

    def drive(self, joint: Any, leg: LegDescription, axis: str, positions: bool) -> None:
        """
        Add limits and actuator of a leg: an effort, its limit, friction and reflected mass.

        axis: LINEAR or ANGULAR. positions: write the position of the joint.
        """
        from pxr import Sdf

        unit = math.degrees(1.0) if axis == ANGULAR else 1.0
        joint.CreateAxisAttr('Z')
        for create, value in ((joint.CreateLowerLimitAttr, leg.limits.lowest),
                              (joint.CreateUpperLimitAttr, leg.limits.highest)):
            if value is not None:
                create((value - leg.branch.home) * unit)
        drive = self._physics.DriveAPI.Apply(joint.GetPrim(), axis)
        drive.CreateTypeAttr('force')
        drive.CreateStiffnessAttr(0.0)
        drive.CreateDampingAttr(leg.viscous_friction / unit)
        if leg.limits.effort is not None:
            drive.CreateMaxForceAttr(leg.limits.effort)
        for schema in (*_SCHEMAS, f'PhysxJointAxisAPI:{axis}'):
            joint.GetPrim().AddAppliedSchema(schema)
        rate = None if leg.limits.rate is None else leg.limits.rate * unit
        for keys, value in ((armature(axis), leg.reflected),
                            (coulomb_friction(axis), leg.coulomb_friction),
                            (rate_limit(axis), rate)):
            for key in keys:
                if value is not None:
                    joint.GetPrim().CreateAttribute(
                        key, Sdf.ValueTypeNames.Float, custom=False).Set(value)
        if positions:
            joint.GetPrim().CreateAttribute(POSITION, Sdf.ValueTypeNames.Double).Set(
                leg.branch.home)

    def stiff(self, ball: Any) -> None:
        """Make a joint that closes a loop as stiff in MuJoCo and Newton as it is in the MJCF."""
        from pxr import Sdf

        ball.GetPrim().AddAppliedSchema(_EQUALITY)
        for key, values in (('mjc:solref', SOLREF_LOOP),
                            ('mjc:solimp', (*SOLIMP, *_MIDPOINT_POWER))):
            ball.GetPrim().CreateAttribute(
                key, Sdf.ValueTypeNames.DoubleArray, custom=False).Set([*values])

    def _path(self, name: str) -> str:
        return f'{self._root}/{_prim(name)}'

    def _place(self, xform: Any, position: Array, rotation: Array) -> None:
        xform.AddTranslateOp(self._geom.XformOp.PrecisionDouble).Set(
            self._gf.Vec3d(*position.tolist()))
        xform.AddOrientOp(self._geom.XformOp.PrecisionDouble).Set(
            self._quaternion(rotation, self._gf.Quatd))

    def _shape(self, path: str, shape: VisualShape) -> None:
        if shape.kind == 'mesh':
            return  # files of meshes are no USD
        kind = self._geom.Sphere if shape.kind == 'sphere' else self._geom.Cylinder
        drawn = kind.Define(self._stage, path)
        self._place(drawn, shape.position, shape.rotation)
        drawn.CreateRadiusAttr(shape.radius)
        if shape.kind == 'cylinder':
            drawn.CreateHeightAttr(shape.length)
            drawn.CreateAxisAttr('Z')
        drawn.CreateDisplayColorAttr([self._gf.Vec3f(*self._colors[shape.color][:3])])

    def _quaternion(self, rotation: Array, kind: Any) -> Any:
        x, y, z, w = to_quaternion(rotation)
        return kind(float(w), float(x), float(y), float(z))
