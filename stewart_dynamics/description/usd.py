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

from collections.abc import Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.description.carried import CARRIED, carried, tree_values
from stewart_dynamics.description.hexapod import Color, Hexapod, LegDescription, TreeBody
from stewart_dynamics.description.mjcf import SOLIMP, SOLREF_LOOP
from stewart_dynamics.errors import StewartError
from stewart_dynamics.legs.mechanism import (
    BALL, FIXED, HINGE, Joint, MechanismBody, OTHER, Placement, SLIDE, UNIVERSAL, WORLD)
from stewart_dynamics.legs.tree import VisualShape
from stewart_dynamics.mechanics.frames.rotation import to_quaternion

if TYPE_CHECKING:
    from pxr import Usd

_FREE = 179.0  # degrees; PhysX takes less than half a turn
_LOCKED = 1.0, -1.0  # a lower limit above the upper one locks an axis
LINEAR, ANGULAR = 'linear', 'angular'  # drives
# The kinds of joints of UsdPhysics; one without a kind has six axes.
_JOINTS = {FIXED: 'Fixed', UNIVERSAL: '', SLIDE: 'Prismatic', HINGE: 'Revolute', BALL: 'Spherical'}
_ORIGIN = np.zeros(3)


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
    tree = hexapod.tree(uris=False, from_home=True)
    base, *of_legs, platform = tree
    for part in (base, platform, *of_legs):
        writer.add_body(part)
        made = part.joint
        if made.kind == OTHER:
            continue
        joint = writer.add_joint(made.kind, made.name, made.parent, made.child, part.at_home)
        if made.kind == UNIVERSAL:
            for axis in ('transX', 'transY', 'transZ', 'rotZ'):
                writer.add_limit(joint, axis, *_LOCKED)
            # Free in UsdPhysics, but locked in Newton without limits.
            for axis in ('rotX', 'rotY'):
                writer.add_limit(joint, axis, -_FREE, _FREE)
        elif part.leg:
            writer.add_drive(joint, made, not hexapod.kind.zero)
        if part.leg and made.child == part.leg.last:
            writer.close_loop(part.leg, part.body, platform.body, part.leg is not hexapod.legs[0])
    for each, parameter in carried(
            hexapod, tree, _elements(hexapod, tree), [hexapod.kind.zero]):
        for prefix, value in ((VALUE, parameter.value), (ELEMENT, parameter.element)):
            if value:
                root.GetPrim().CreateAttribute(
                    attribute_name(prefix, each), Sdf.ValueTypeNames.String).Set(value)
    text: str = stage.GetRootLayer().ExportToString()
    return text


def attribute_name(prefix: str, name: str) -> str:
    """Return the name of an attribute for a parameter."""
    return f'{prefix}:{name.replace(".", ":")}'


def _elements(hexapod: Hexapod, tree: Sequence[TreeBody]) -> dict[str, Any]:
    """Return the values of the attributes of the formats, before they are single-precision."""
    p, kind = hexapod.parameters, hexapod.kind
    frames = {'base_frame': _prim(hexapod.base_body), 'platform_frame': _prim(hexapod.platform)}
    return {name: kind.expanded(p, name) for name in (*_EXACT, *kind.elements)} | {
        name: value for name, value in (dict(tree_values(hexapod, tree)) | frames).items()
        if name not in frames or value != p[name]}


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

    def add_body(self, part: TreeBody) -> None:
        """Add a rigid body; one without mass is the base, fixed to the world."""
        body, path = part.body, self._path(part.body.name)
        xform = self._geom.Xform.Define(self._stage, path)
        self._place(xform, body.placement.position, body.placement.rotation)
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
        for n, shape in enumerate(part.shapes):
            self._shape(f'{path}/shape_{n}', shape)

    def add_joint(self, kind: str, name: str, first: str, second: str, at: Placement,
                  in_second: Array = _ORIGIN) -> Any:
        """
        Add a joint of a kind of ``mechanism``; its axes are the second body's.

        at: its place in the first body, or in the world. in_second: where it is in the second.
        """
        define = getattr(self._physics, f'{_JOINTS[kind]}Joint').Define
        joint = define(self._stage, f'{self._root}/joints/{_prim(name)}')
        if first != WORLD:
            joint.CreateBody0Rel().SetTargets([self._path(first)])
        joint.CreateBody1Rel().SetTargets([self._path(second)])
        joint.CreateLocalPos0Attr(self._gf.Vec3f(*at.position.tolist()))
        joint.CreateLocalRot0Attr(self._quaternion(at.rotation, self._gf.Quatf))
        joint.CreateLocalPos1Attr(self._gf.Vec3f(*in_second.tolist()))
        joint.CreateLocalRot1Attr(self._gf.Quatf(1.0))
        return joint

    def add_limit(self, joint: Any, axis: str, low: float, high: float) -> None:
        """Limit an axis of a joint."""
        limit = self._physics.LimitAPI.Apply(joint.GetPrim(), axis)
        limit.CreateLowAttr(low)
        limit.CreateHighAttr(high)

    def add_drive(self, joint: Any, made: Joint, positions: bool) -> None:
        """
        Add limits and actuator of a leg: an effort, its limit, friction and reflected mass.

        positions: write the position of the joint.
        """
        from pxr import Sdf

        axis, unit = (LINEAR, 1.0) if made.kind == SLIDE else (ANGULAR, math.degrees(1.0))
        joint.CreateAxisAttr('Z')
        for create, value in zip((joint.CreateLowerLimitAttr, joint.CreateUpperLimitAttr),
                                 made.travel, strict=True):
            if value is not None:
                create(value * unit)
        drive = self._physics.DriveAPI.Apply(joint.GetPrim(), axis)
        drive.CreateTypeAttr('force')
        drive.CreateStiffnessAttr(0.0)
        drive.CreateDampingAttr(made.damping / unit)
        if made.force_max is not None:
            drive.CreateMaxForceAttr(made.force_max)
        for schema in (*_SCHEMAS, f'PhysxJointAxisAPI:{axis}'):
            joint.GetPrim().AddAppliedSchema(schema)
        rate = None if made.velocity_max is None else made.velocity_max * unit
        for keys, value in ((armature(axis), made.armature),
                            (coulomb_friction(axis), made.friction),
                            (rate_limit(axis), rate)):
            for key in keys:
                if value is not None:
                    joint.GetPrim().CreateAttribute(
                        key, Sdf.ValueTypeNames.Float, custom=False).Set(value)
        if positions:
            joint.GetPrim().CreateAttribute(POSITION, Sdf.ValueTypeNames.Double).Set(
                made.position)

    def close_loop(self, leg: LegDescription, last: MechanismBody, platform: MechanismBody,
                   excluded: bool) -> None:
        """
        Add the joint of a leg at the platform.

        excluded: it closes a loop, as stiff in MuJoCo and Newton as in the MJCF.
        """
        from pxr import Sdf

        turn = last.placement.rotation.T @ platform.placement.rotation
        ball = self.add_joint(BALL, leg.ball, last.name, platform.name,
                              Placement(turn, leg.branch.end), leg.platform_joint)
        ball.CreateExcludeFromArticulationAttr(excluded)
        if not excluded:
            return
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
