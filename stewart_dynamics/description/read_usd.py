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
_LIMITS = 'physics:lowerLimit', 'physics:upperLimit'
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
        given = float(_value(scenes[0], 'physics:gravityMagnitude'))
        along = np.array(_value(scenes[0], 'physics:gravityDirection'), float)
        if given >= 0.0 and math.isfinite(given):
            size = given * self._length
        if along.any():
            direction = along / np.linalg.norm(along)
        return size * direction

    def _add_body(self, prim: Any) -> None:
        placement, name = self._placement(prim), self._named(prim)
        made = MechanismBody(name, placement, shapes=self._shapes(prim))
        mass = float(_value(prim, 'physics:mass') or 0.0)
        if mass > 0.0:
            made.mass = mass * self._mass
            center = np.array(_value(prim, 'physics:centerOfMass', [-math.inf] * 3), float)
            if center.min() > _NOT_STORED:
                made.center = placement.inside(self._point(prim, center))
            made.inertia = self._inertia(prim)
            if not made.inertia.any():
                made.note = (f'{name}: no inertia: engines compute it from its shapes: 0 kg m^2 '
                             'here')
        else:
            made.note = f'{name}: no mass: engines compute it from its shapes: not read'
        if _value(prim, 'physxRigidBody:disableGravity'):
            made.weightless = 'gravity switched off'
        for key in ('physxRigidBody:linearDamping', 'physxRigidBody:angularDamping'):
            if damping := _value(prim, key):
                made.left_out.append(f'{key} {damping:.4g}')
        self.mechanism.parts[name] = made

    def _inertia(self, prim: Any) -> Array:
        moments = np.array(_value(prim, 'physics:diagonalInertia', [0.0] * 3), float)
        axes = _value(prim, 'physics:principalAxes')
        turn = _rotation(axes) if axes and any((axes.real, *axes.imaginary)) else np.eye(3)
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
        at = np.array(_value(joint.GetPrim(), f'physics:localPos{side}'), float)
        turn = _rotation(_value(joint.GetPrim(), f'physics:localRot{side}'))
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
                low, high = (_value(prim, key) for key in _LIMITS)
                axis = _AXES[str(_value(prim, 'physics:axis'))]
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
        low, high = (_value(prim, f'limit:{axis}:physics:{side}') for side in ('low', 'high'))
        return bool(low <= high)

    def _add_drive(self, prim: Any, made: Joint, axis: str, unit: float) -> None:
        """Add the limits and the drive of a joint; unit: of its positions [m, rad]."""
        made.lower, made.upper = (
            float(end) * unit if end is not None and math.isfinite(end) else None
            for end in (_value(prim, key) for key in _LIMITS))
        position = _value(prim, POSITION)
        if position is not None:
            made.position = float(position)
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
            stiffness, damping, force = (float(_value(prim, f'drive:{name}:physics:{key}'))
                                         for key in ('stiffness', 'damping', 'maxForce'))
            if force < 1e30:
                made.force_max = force * effort
            if stiffness or _value(prim, f'drive:{name}:physics:type') != 'force':
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
            value, element = (_value(root, attribute_name(each, name))
                              for each in (VALUE, ELEMENT))
            if value is not None:
                self.mechanism.carried[name] = CarriedParameter(str(value), str(element or ''))


def _value(prim: Any, key: str, default: Any = None) -> Any:
    """Return the value of an attribute, or the default of its schema; ``default`` without both."""
    attribute = prim.GetAttribute(key)
    return attribute.Get() if attribute else default


def _rotation(quaternion: Any) -> Array:
    x, y, z, w = np.array([*quaternion.imaginary, quaternion.real], float) / quaternion.GetLength()
    return np.reshape(from_quaternion(x, y, z, w), (3, 3))
