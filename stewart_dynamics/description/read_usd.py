# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
USD with UsdPhysics as a mechanism, by usd-core: references, layers and units are its.

Its numbers are single-precision. Friction and reflected inertia are read from the attributes of
Newton and PhysX.
"""

from __future__ import annotations

import math
from pathlib import Path
import tempfile
from types import ModuleType
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.bounded_process import load_in_process, read_with
from stewart_dynamics.description.usd import (
    ANGULAR, armature, attribute_name, coulomb_friction, ELEMENT, LINEAR, POSITION, rate_limit,
    VALUE)
from stewart_dynamics.legs.mechanism import (
    BALL, CarriedParameter, DescriptionError, FIXED, HINGE, Joint, Mechanism, MechanismBody, OTHER,
    Placement, SLIDE, UNIVERSAL, WORLD)
from stewart_dynamics.mechanics.frames.rotation import from_quaternion
from stewart_dynamics.parameters.table import PARAMETERS, STANDARD_GRAVITY

SUFFIXES = '.usd', '.usda', '.usdc', '.usdz'
_SINGLE = 1e-6  # relative resolution of its numbers
_TOGETHER = 1e-5  # frames of a joint that are nearer to each other are one [m]
_AXES = {'X': 0, 'Y': 1, 'Z': 2}
_NOT_STORED = -1e30  # vectors that are not given have -inf
# Kinds of joints by the number of axes about which they turn, none of which is limited to nothing.
_BY_TURNS = FIXED, HINGE, UNIVERSAL, BALL


def read_usd(source: Path) -> Mechanism:
    """Return the mechanism of a USD; DescriptionError where usd-core rejects it."""
    if not source.is_file():
        raise DescriptionError(f'{source}: cannot be read: not a regular file')
    return read_with('usd-core', 'pxr.UsdPhysics', 'usd', source, 'USD', _mechanism)


def _mechanism(physics: ModuleType, source: Path) -> Mechanism:
    from pxr import Usd

    with tempfile.TemporaryDirectory() as folder:
        flat = Path(folder) / 'flat.usdc'
        load_in_process('usd-core', 'from pxr import Usd',
                        'Usd.Stage.Open(source).Flatten().Export(target)', source, flat)
        return _Scene(Usd.Stage.Open(str(flat)), physics, source).mechanism


class _Scene:
    """Bodies and joints of a stage, in m and kg."""

    def __init__(self, stage: Any, physics: Any, source: Path) -> None:
        from pxr import Usd, UsdGeom

        self._geom, self._physics, self._source = UsdGeom, physics, source
        self._length = float(UsdGeom.GetStageMetersPerUnit(stage))
        self._mass = float(physics.GetStageKilogramsPerUnit(stage))
        self._cache = UsdGeom.XformCache(Usd.TimeCode.Default())
        self._names: dict[str, str] = {}  # of bodies, by their paths
        self.mechanism = Mechanism(str(source), source.stem, {}, [], resolution=_SINGLE)
        prims = [*Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())]
        for prim in prims:
            if prim.HasAPI(physics.RigidBodyAPI):
                self._add_body(prim)
        for prim in prims:
            if prim.IsA(physics.Joint):
                self._add_joint(prim)
        up = np.eye(3)[1 if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y else 2]
        scenes = [prim for prim in prims if prim.IsA(physics.Scene)]
        self.mechanism.gravity = self._gravity(scenes, up)
        if stage.GetDefaultPrim():
            self._add_carried(stage.GetDefaultPrim())

    def _gravity(self, scenes: list[Any], up: Array) -> Array:
        """Return gravity in world axes, the default of UsdPhysics without a scene."""
        size, direction = -STANDARD_GRAVITY[2], -up
        if not scenes:
            self.mechanism.remarks.append(
                f'gravity: no physics scene in the file: {size} m/s^2 against its up axis')
            return size * direction
        scene = self._physics.Scene(scenes[0])
        given = float(scene.GetGravityMagnitudeAttr().Get())
        along = np.array(scene.GetGravityDirectionAttr().Get(), float)
        if given >= 0.0 and math.isfinite(given):
            size = given * self._length
        if along.any():
            direction = along / np.linalg.norm(along)
        return size * direction

    def _add_body(self, prim: Any) -> None:
        mass_api = self._physics.MassAPI(prim)
        placement = self._placement(prim)
        name = self._named(prim)
        made = MechanismBody(name, placement, shapes=self._shapes(prim))
        mass = float(mass_api.GetMassAttr().Get() or 0.0)
        if mass > 0.0:
            made.mass = mass * self._mass
            center = np.array(mass_api.GetCenterOfMassAttr().Get(), float)
            if center.min() > _NOT_STORED:
                made.center = placement.inside(self._point(prim, center))
            made.inertia = self._inertia(mass_api)
            if not made.inertia.any():
                made.note = (f'{name}: no inertia: engines compute it from its shapes: 0 kg m^2 '
                             'here')
        else:
            made.note = f'{name}: no mass: engines compute it from its shapes: not read'
        disabled = prim.GetAttribute('physxRigidBody:disableGravity')
        if disabled and disabled.Get():
            made.weightless = 'gravity switched off'
        for key in ('physxRigidBody:linearDamping', 'physxRigidBody:angularDamping'):
            damping = prim.GetAttribute(key)
            if damping and damping.Get():
                made.left_out.append(f'{key} {damping.Get():.4g}')
        self.mechanism.parts[name] = made

    def _inertia(self, mass: Any) -> Array:
        moments = np.array(mass.GetDiagonalInertiaAttr().Get(), float)
        axes = mass.GetPrincipalAxesAttr().Get()
        turn = np.eye(3) if not any((axes.real, *axes.imaginary)) else _rotation(axes)
        inertia: Array = turn @ np.diag(moments) @ turn.T * self._mass * self._length ** 2
        return inertia

    def _shapes(self, prim: Any) -> int:
        from pxr import Usd

        return sum(each.IsA(self._geom.Gprim) for each in Usd.PrimRange(
            prim, Usd.TraverseInstanceProxies()))

    def _matrix(self, prim: Any) -> Array:
        """Return the transform of a prim to the world, for rows [m]."""
        return np.array(self._cache.GetLocalToWorldTransform(prim))

    def _placement(self, prim: Any) -> Placement:
        matrix = self._matrix(prim)
        left, _, right = np.linalg.svd(matrix[:3, :3].T)  # without scale
        return Placement(left @ right, matrix[3, :3] * self._length)

    def _point(self, prim: Any, at: Array) -> Array:
        """Return a point of a prim in the world; its scale acts on it."""
        matrix = self._matrix(prim)
        point: Array = (at @ matrix[:3, :3] + matrix[3, :3]) * self._length
        return point

    def _named(self, prim: Any) -> str:
        """Return the name of a body: that of its prim, or its path where it is taken."""
        path = str(prim.GetPath())
        if path not in self._names:
            taken = {WORLD, *self._names.values()}
            self._names[path] = prim.GetName() if prim.GetName() not in taken else path
        return self._names[path]

    def _end(self, joint: Any, side: int) -> tuple[str, Placement]:
        """Return the body at a side of a joint and the joint's frame there."""
        targets = getattr(joint, f'GetBody{side}Rel')().GetTargets()
        at = np.array(getattr(joint, f'GetLocalPos{side}Attr')().Get(), float)
        turn = _rotation(getattr(joint, f'GetLocalRot{side}Attr')().Get())
        if not targets:
            return WORLD, Placement(turn, at * self._length)
        prim = joint.GetPrim().GetStage().GetPrimAtPath(targets[0])
        if not prim:
            raise DescriptionError(
                f'{self._source}: joint {joint.GetPrim().GetName()!r}: no prim {targets[0]}')
        frame = Placement(self._placement(prim).rotation @ turn, self._point(prim, at))
        body = prim
        while body and not body.IsPseudoRoot():
            if body.HasAPI(self._physics.RigidBodyAPI):
                return self._named(body), frame
            body = body.GetParent()
        # A prim without a rigid body is fixed to the world.
        name = self._named(prim)
        if name not in self.mechanism.parts:
            self.mechanism.parts[name] = MechanismBody(
                name, self._placement(prim), shapes=self._shapes(prim))
            self.mechanism.joints.append(
                Joint(f'{name} fixed', FIXED, WORLD, name, self._placement(prim).position))
        return name, frame

    def _add_joint(self, prim: Any) -> None:
        joint, name = self._physics.Joint(prim), prim.GetName()
        if not joint.GetJointEnabledAttr().Get():
            self.mechanism.remarks.append(f'{name}: a joint that is not enabled is left out')
            return
        (parent, first), (child, second) = self._end(joint, 0), self._end(joint, 1)
        kind, axes = self._kind(prim)
        made = Joint(name, kind, parent, child, first.position,
                     [first.rotation[:, axis] for axis in axes])
        if kind == SLIDE:
            made.anchor = second.position
            made.position = float(made.axes[0] @ (second.position - first.position))
            self._add_drive(prim, made, LINEAR, self._length)
        elif kind == HINGE:
            self._add_drive(prim, made, ANGULAR, math.radians(1.0))
        if kind != SLIDE and (np.linalg.norm(second.position - first.position) > _TOGETHER or (
                joint.GetExcludeFromArticulationAttr().Get())):
            made.child_anchor = second.position
        axis, arm = (LINEAR, 1.0) if kind == SLIDE else (ANGULAR, self._length)
        made.armature = self._number(prim, armature(axis), self._mass * arm ** 2)
        made.friction = self._number(
            prim, coulomb_friction(axis), self._mass * self._length * arm)
        self.mechanism.joints.append(made)

    def _kind(self, prim: Any) -> tuple[str, list[int]]:
        """Return the kind of a joint and the axes of its frame that are its own."""
        physics = self._physics
        for schema, kind in ((physics.FixedJoint, FIXED), (physics.SphericalJoint, BALL),
                             (physics.DistanceJoint, OTHER)):
            if prim.IsA(schema):
                return kind, []
        for schema, kind in ((physics.RevoluteJoint, HINGE), (physics.PrismaticJoint, SLIDE)):
            if prim.IsA(schema):
                typed = schema(prim)
                low, high = typed.GetLowerLimitAttr().Get(), typed.GetUpperLimitAttr().Get()
                axis = _AXES[str(typed.GetAxisAttr().Get())]
                return (FIXED, []) if low > high else (kind, [axis])
        free = {axis: self._is_free(prim, axis) for axis in (
            'transX', 'transY', 'transZ', 'rotX', 'rotY', 'rotZ')}
        slides = [n for n, axis in enumerate('XYZ') if free[f'trans{axis}']]
        turns = [n for n, axis in enumerate('XYZ') if free[f'rot{axis}']]
        if not slides:
            return _BY_TURNS[len(turns)], turns
        return (SLIDE, slides) if len(slides) == 1 and not turns else (OTHER, [])

    def _is_free(self, prim: Any, axis: str) -> bool:
        """Return whether an axis of a joint of six is not locked by its limits."""
        if not prim.HasAPI(self._physics.LimitAPI, axis):
            return True
        limit = self._physics.LimitAPI(prim, axis)
        return bool(limit.GetLowAttr().Get() <= limit.GetHighAttr().Get())

    def _add_drive(self, prim: Any, made: Joint, axis: str, unit: float) -> None:
        """Add the limits and the drive of a joint; unit: of its positions [m, rad]."""
        for schema in (self._physics.PrismaticJoint, self._physics.RevoluteJoint):
            if prim.IsA(schema):
                joint = schema(prim)
                ends = joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get()
                made.lower, made.upper = (
                    float(end) * unit if math.isfinite(end) else None for end in ends)
        position = prim.GetAttribute(POSITION)
        if position and position.HasAuthoredValue():
            made.position = float(position.Get())
            made.lower, made.upper = (None if end is None else end + made.position
                                      for end in (made.lower, made.upper))
        rate = self._number(prim, rate_limit(axis), unit, math.inf)
        made.velocity_max = rate if 0.0 < rate < 1e30 else None
        names = (LINEAR, 'transX', 'transY', 'transZ') if axis == LINEAR else (
            ANGULAR, 'rotX', 'rotY', 'rotZ')
        effort = self._mass * self._length * (self._length if axis == ANGULAR else 1.0)
        for name in names:
            if not prim.HasAPI(self._physics.DriveAPI, name):
                continue
            drive = self._physics.DriveAPI(prim, name)
            stiffness, damping, force = (float(each().Get()) for each in (
                drive.GetStiffnessAttr, drive.GetDampingAttr, drive.GetMaxForceAttr))
            if force < 1e30:
                made.force_max = force * effort
            if stiffness or drive.GetTypeAttr().Get() != self._physics.Tokens.force:
                made.left_out.append(f'a drive to a position, stiffness {stiffness:.6g}')
            else:
                made.damping = damping * effort / unit

    def _number(self, prim: Any, keys: tuple[str, ...], unit: float, default: float = 0.0,
                ) -> float:
        """Return the first of several attributes that is given."""
        for key in keys:
            attribute = prim.GetAttribute(key)
            if attribute and attribute.HasAuthoredValue():
                return float(attribute.Get()) * unit
        return default

    def _add_carried(self, root: Any) -> None:
        for name in PARAMETERS:
            value = root.GetAttribute(attribute_name(VALUE, name))
            element = root.GetAttribute(attribute_name(ELEMENT, name))
            if value and value.HasAuthoredValue():
                self.mechanism.carried[name] = CarriedParameter(
                    str(value.Get()), str(element.Get()) if element else '')


def _rotation(quaternion: Any) -> Array:
    x, y, z, w = np.array([*quaternion.imaginary, quaternion.real], float) / quaternion.GetLength()
    return np.reshape(from_quaternion(x, y, z, w), (3, 3))
