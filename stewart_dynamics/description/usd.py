# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as USD with UsdPhysics: rigid bodies, joints, drives; for Isaac Sim and other tools.

The world's axes are base axes, in which gravity is given. A solver of articulations (reduced
coordinates) needs a tree: the platform hangs on the first leg, and the ball joints of the other
five have ``excludeFromArticulation``, so that they close the loops. Solvers of maximal coordinates
ignore the flag. ``body0`` of each joint is the parent in the tree. Positions of the legs' joints
are counted from the home pose.

Coulomb friction, reflected mass and the limit of the rate have no attribute in UsdPhysics, but in
the schemas of Newton and PhysX. ``physxJoint:jointFriction``, a number without unit, is not
written. Attributes are single-precision: attributes ``stewart_dynamics:...`` of the model have the
parameters in full.
"""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import (
    COLORS, Hexapod, LegDescription, massless, RigidBody, shapes, VisualShape)
from stewart_dynamics.description.mechanism import OF_SLIDE
from stewart_dynamics.description.mjcf import SOLIMP, SOLREF_LOOP
from stewart_dynamics.description.xml_text import CARRIED, carried, solid_elements
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.limits import LENGTH_MAX, LENGTH_MIN

if TYPE_CHECKING:
    from pxr import Usd

_FREE = 179.0  # degrees; PhysX takes less than half a turn
_LOCKED = 1.0, -1.0  # a lower limit above the upper one locks an axis
# Attributes of a leg's joint, those of Newton and of PhysX, and the schemas that they belong to.
ARMATURE = 'newton:armature', 'physxJointAxis:linear:armature', 'physxJoint:armature'
COULOMB_FRICTION = ('newton:friction', 'physxJointAxis:linear:staticFrictionEffort',
                    'physxJointAxis:linear:dynamicFrictionEffort')
RATE_LIMIT = ('newton:velocityLimit', 'physxJointAxis:linear:maxJointVelocity',
              'physxJoint:maxJointVelocity')
# MuJoCo's defaults; its schema needs all five numbers.
_MIDPOINT_POWER = 0.5, 2.0
_EQUALITY = 'MjcEqualityConnectAPI'
_SCHEMAS = 'NewtonJointAPI', 'PhysxJointAPI', 'PhysxJointAxisAPI:linear'
# Attributes of the model with a parameter, and with the value that its own attributes have.
VALUE, ELEMENT = f'{CARRIED}:value', f'{CARRIED}:element'
_EXACT = (
    'gravity', 'geometry.base_joints', 'geometry.platform_joints', 'platform.mass',
    'platform.center_of_mass', 'platform.inertia', 'actuator.reflected_mass',
    'actuator.viscous_friction', 'actuator.coulomb_friction',
    *(f'legs.{part}.{each}' for part in ('cylinder', 'piston')
      for each in ('mass', 'center_of_mass', 'inertia')))
_NOT_IN_USD = ('geometry.zero_length',)


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
    writer = _Writer(stage, str(root.GetPath()))
    looks = shapes(hexapod, uris=False)
    writer.body(massless(hexapod.base_body), np.zeros(3), np.eye(3), looks[hexapod.base])
    writer.joint('Fixed', f'{hexapod.base_body}_to_world', None, hexapod.base_body, np.zeros(3),
                 np.eye(3), np.zeros(3))
    writer.body(hexapod.platform_body, hexapod.position, hexapod.rotation,
                looks[hexapod.platform])
    for n, leg in enumerate(hexapod.legs):
        _leg(writer, hexapod, leg, looks, excluded=n > 0)
    for name, parameter in carried(hexapod.parameters, _elements(hexapod), _NOT_IN_USD):
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
    found: dict[str, Any] = {name: p[name] for name in _EXACT} | solid_elements(hexapod)
    frames = {'base_frame': hexapod.base_body, 'platform_frame': hexapod.platform}
    found |= {name: _prim(frame) for name, frame in frames.items() if _prim(frame) != p[name]}
    homes = np.array([leg.home_length for leg in hexapod.legs])
    found |= {name: None if p[name] is None else p[name] - (
        homes if name in (LENGTH_MIN, LENGTH_MAX) else 0.0) for name in OF_SLIDE}
    return found


def _leg(writer: _Writer, hexapod: Hexapod, leg: LegDescription,
         looks: dict[str, tuple[VisualShape, ...]], excluded: bool) -> None:
    tip = leg.base_joint + leg.home_length * leg.mount[:, 2]
    writer.body(hexapod.solid(leg.cylinder, leg), leg.base_joint, leg.mount,
                looks[leg.cylinder.name])
    writer.body(hexapod.solid(leg.piston, leg), tip, leg.mount, looks[leg.piston.name])
    universal = writer.joint('', f'{leg.name}_universal', hexapod.base_body, leg.cylinder.name,
                             leg.base_joint, leg.mount, np.zeros(3))
    for axis in ('transX', 'transY', 'transZ', 'rotZ'):
        writer.limit(universal, axis, *_LOCKED)
    for axis in ('rotX', 'rotY'):  # free in UsdPhysics, but locked in Newton without limits
        writer.limit(universal, axis, -_FREE, _FREE)
    slide = writer.joint('Prismatic', leg.name, leg.cylinder.name, leg.piston.name,
                         np.array([0.0, 0.0, leg.home_length]), np.eye(3), np.zeros(3))
    slide.CreateAxisAttr('Z')
    if leg.limits.length_min is not None:
        slide.CreateLowerLimitAttr(leg.limits.length_min - leg.home_length)
    if leg.limits.length_max is not None:
        slide.CreateUpperLimitAttr(leg.limits.length_max - leg.home_length)
    writer.actuator(slide, leg)
    ball = writer.joint('Spherical', leg.ball, leg.piston.name, hexapod.platform, np.zeros(3),
                        leg.mount.T @ hexapod.rotation, leg.platform_joint)
    ball.CreateExcludeFromArticulationAttr(excluded)
    if excluded:
        writer.stiff(ball)


def _prim(name: str) -> str:
    """Return a name as USD allows it."""
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))


class _Writer:
    """Writes bodies and joints below a root prim."""

    def __init__(self, stage: Usd.Stage, root: str) -> None:
        from pxr import Gf, UsdGeom, UsdPhysics

        self._stage, self._root = stage, root
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

    def actuator(self, slide: Any, leg: LegDescription) -> None:
        """Add the actuator of a leg: a force, its limit, friction and reflected mass."""
        from pxr import Sdf

        drive = self._physics.DriveAPI.Apply(slide.GetPrim(), 'linear')
        drive.CreateTypeAttr('force')
        drive.CreateStiffnessAttr(0.0)
        drive.CreateDampingAttr(leg.viscous_friction)
        if leg.limits.force_max is not None:
            drive.CreateMaxForceAttr(leg.limits.force_max)
        for schema in _SCHEMAS:
            slide.GetPrim().AddAppliedSchema(schema)
        for keys, value in ((ARMATURE, leg.reflected_mass),
                            (COULOMB_FRICTION, leg.coulomb_friction),
                            (RATE_LIMIT, leg.limits.velocity_max)):
            for key in keys:
                if value is not None:
                    slide.GetPrim().CreateAttribute(
                        key, Sdf.ValueTypeNames.Float, custom=False).Set(value)

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
        drawn.CreateDisplayColorAttr([self._gf.Vec3f(*COLORS[shape.color][:3])])

    def _quaternion(self, rotation: Array, kind: Any) -> Any:
        x, y, z, w = to_quaternion(rotation)
        return kind(float(w), float(x), float(y), float(z))
