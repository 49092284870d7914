# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
A hexapod as MJCF, the format of MuJoCo: its loops closed by ``connect``, a motor for each leg.

Coordinates at the start are those of the home pose. A slide joint has the name and position of its
leg; ``ctrl`` is the force of each leg in the order of ``joints`` [N]. The world's axes are base
axes, in which gravity is given: a base that is tilted has a tilted gravity.

Constraints are soft in MuJoCo: at a platform joint they act as springs, and leave gaps of
micrometers in motion. Coulomb friction is such a constraint, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.carried import CARRIED, carried, ELEMENT
from stewart_dynamics.description.hexapod import Hexapod, TreeBody
from stewart_dynamics.description.xml_text import add, numbers, text_of
from stewart_dynamics.legs.mechanism import (
    FIXED, Joint, MechanismBody, OTHER, SLIDE, UNIVERSAL, WORLD)
from stewart_dynamics.legs.tree import PLATE, VisualShape
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.parameters.table import mean_radius

_TIMESTEP = 0.0005  # [s]
# Constraints: time constant [s] and damping ratio; impedance, 1 for a rigid one, at no gap and
# at one of the third number [m].
_SOLREF = (2.0 * _TIMESTEP, 1.0)
# Loops: the accelerations that close a gap are the gap by the square of the time constant.
# With that of above the rounding errors of single precision, 0.1 um, would give 0.1 m/s^2.
SOLREF_LOOP = (0.01, 1.0)
SOLIMP = (0.9999, 0.9999, 0.001)
_TOLERANCE = 1e-12
_CLASS, _VISUAL, _COLLISION = 'hexapod', 'visual', 'collision'  # defaults
_COMMENT = ('It starts at the home pose. ctrl: the {effort}s of the legs in {unit}, '
            'a positive one {does}.')


def mjcf(hexapod: Hexapod, name: str) -> str:
    """Return a hexapod as MJCF; ``name`` is that of the model."""
    root = ET.Element('mujoco', {'model': name})
    p = hexapod.parameters
    add(root, 'compiler', angle='radian', autolimits='true')
    add(root, 'option', timestep=_TIMESTEP, gravity=p.gravity,
        integrator='implicitfast', solver='Newton', tolerance=_TOLERANCE)
    # Other bodies collide with the hexapod, but its parts do not collide with each other.
    hexapods = add(add(root, 'default'), 'default', class_=_CLASS)
    # Groups as in MuJoCo Menagerie.
    add(add(hexapods, 'default', class_=_VISUAL), 'geom', group='2', contype='0', conaffinity='0',
        mass='0')
    add(add(hexapods, 'default', class_=_COLLISION), 'geom', group='3', contype='1',
        conaffinity='0', mass='0')
    add(add(root, 'visual'), 'headlight', ambient='0.4 0.4 0.4', diffuse='0.5 0.5 0.5')
    tree = hexapod.tree(uris=False, paired=True)  # MuJoCo knows paths alone
    _assets(root, hexapod, tree)
    bodies = {WORLD: add(root, 'worldbody')}
    for part in tree:
        # The loops close at the platform, which is free until then.
        carrier = WORLD if part.joint.kind == OTHER else part.joint.parent
        bodies[part.body.name] = _body(bodies[carrier], hexapod, part)
    _loops(root, hexapod)
    _actuators(root, hexapod, tree)
    add(add(root, 'keyframe'), 'key', name='home', qpos=numbers(*_home(hexapod, tree)))
    custom = add(root, 'custom')
    for each, parameter in carried(hexapod, tree, {}, (hexapod.kind.rate_limit,)):
        for prefix, value in ((CARRIED, parameter.value), (ELEMENT, parameter.element)):
            if value:
                add(custom, 'text', name=f'{prefix}.{each}', data=value)
    effort = hexapod.kind.effort
    return text_of(root, _COMMENT.format(
        effort=effort.name, unit=effort.unit, does=effort.positive.removeprefix('+ ')))


def scene(hexapod: Hexapod, name: str) -> str:
    """Return a scene around the MJCF of a hexapod, with light and a floor under the base."""
    root = ET.Element('mujoco', {'model': f'{name}_scene'})
    add(root, 'include', file=f'{name}.xml')
    size = mean_radius(hexapod.parameters.geometry.base_joints)
    add(root, 'statistic', center=0.5 * hexapod.position, extent=3.0 * size)
    assets = add(root, 'asset')
    add(assets, 'texture', type='skybox', builtin='gradient', rgb1='0.3 0.5 0.7', rgb2='0 0 0',
        width='512', height='3072')
    add(assets, 'texture', type='2d', name='floor', builtin='checker', rgb1='0.2 0.3 0.4',
        rgb2='0.1 0.2 0.3', width='300', height='300')
    add(assets, 'material', name='floor', texture='floor', texrepeat='5 5', reflectance='0.2')
    world = add(root, 'worldbody')
    gravity = hexapod.parameters.gravity
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    above = hexapod.position + 4.0 * size * up
    add(world, 'light', pos=above, dir=-up, type='directional')
    lowest = min(float(each @ up) for each in (
        *hexapod.parameters.geometry.base_joints, hexapod.position - 2.0 * size * np.abs(up)))
    add(world, 'geom', name='floor', type='plane', size='0 0 0.05', material='floor',
        pos=(lowest - PLATE * size) * up, zaxis=up)
    return text_of(root, 'A scene around the hexapod.')


def _home(hexapod: Hexapod, tree: Sequence[TreeBody]) -> list[Array]:
    """Return the positions of all joints at home, in MuJoCo's order."""
    legs = [np.zeros(2) if part.joint.kind == UNIVERSAL else np.array([part.joint.position])
            for part in tree if part.leg]
    return [*legs, hexapod.position, _quaternion(hexapod.rotation)]


def _body(carrier: ET.Element, hexapod: Hexapod, part: TreeBody) -> ET.Element:
    leg, name, kind, place = part.leg, part.body.name, part.joint.kind, part.at_home
    at: dict[str, Any] = {} if leg else {'childclass': _CLASS}
    if kind != FIXED:
        at['pos'] = place.position
    if kind not in (FIXED, SLIDE):
        at['quat'] = _quaternion(place.rotation)
    if leg and part.joint.parent == hexapod.base_body:
        add(carrier, 'site', name=f'{leg.name}_base_joint', pos=leg.base_joint)
    if leg and kind == UNIVERSAL:
        # A body of its own has the turn of the mount: Drake takes the first of two joints of a
        # body in axes of the body's parent.
        body = add(add(carrier, 'body', name=leg.bearing, **at), 'body', name=name)
        for joint, axis in zip(leg.universal, ('1 0 0', '0 1 0'), strict=True):
            add(body, 'joint', name=joint, type='hinge', axis=axis)
    else:
        body = add(carrier, 'body', name=name, **at)
        if leg:
            _drive(body, part.joint)
        elif kind == OTHER:
            add(body, 'freejoint', name=name)
    if part.body.mass:
        _inertial(body, part.body)
    _geoms(body, part.shapes)
    if leg and name == leg.last:
        add(body, 'site', name=leg.tip, pos=leg.branch.end if leg.branch.end.any() else None)
    if kind == OTHER:
        for each in hexapod.legs:
            add(body, 'site', name=each.ball, pos=each.platform_joint)
    return body


def _drive(body: ET.Element, joint: Joint) -> None:
    add(body, 'joint', name=joint.name, type=joint.kind, axis='0 0 1', ref=joint.position,
        armature=joint.armature, damping=joint.damping, frictionloss=joint.friction,
        solreffriction=_SOLREF, solimpfriction=SOLIMP, solreflimit=_SOLREF,
        range=None if joint.lower is None else (joint.lower, joint.upper))


def _loops(root: ET.Element, hexapod: Hexapod) -> None:
    equality = add(root, 'equality')
    tendons = add(root, 'tendon')
    for leg in hexapod.legs:
        # By bodies, as all readers know it, not by sites; on the platform the point is where it is
        # in the pose of the file.
        add(equality, 'connect', name=leg.ball, body1=leg.last, body2=hexapod.platform,
            anchor=leg.branch.end, solref=SOLREF_LOOP, solimp=SOLIMP)
        if hexapod.kind.drive_joint != SLIDE:
            continue
        # It has no stiffness: it measures the length from joint to joint.
        length = add(tendons, 'spatial', name=leg.name, rgba='0 0 0 0')
        add(length, 'site', site=f'{leg.name}_base_joint')
        add(length, 'site', site=leg.ball)


def _actuators(root: ET.Element, hexapod: Hexapod, tree: Sequence[TreeBody]) -> None:
    actuators = add(root, 'actuator')
    sensors = add(root, 'sensor')
    for part in tree:
        if part.leg and part.joint.kind != UNIVERSAL:
            name, most = part.joint.name, part.joint.force_max
            add(actuators, 'motor', name=name, joint=name,
                ctrlrange=None if most is None else (-most, most))
    kind = hexapod.kind
    for quantity, tag in ((kind.position, 'pos'), (kind.rate, 'vel')):
        for leg in hexapod.legs:
            sensed = 'tendon' if hexapod.kind.drive_joint == SLIDE else 'joint'
            add(sensors, f'{sensed}{tag}', name=f'{leg.name}_{quantity.name}',
                **{sensed: leg.name})
    for leg in hexapod.legs:
        add(sensors, 'actuatorfrc', name=f'{leg.name}_{kind.effort.name}', actuator=leg.name)


def _assets(root: ET.Element, hexapod: Hexapod, tree: Sequence[TreeBody]) -> None:
    assets = add(root, 'asset')
    for color, rgba in hexapod.colors.items():
        add(assets, 'material', name=color, rgba=rgba)
    files = {shape.color: shape for part in tree for shape in part.shapes if shape.file}
    for kind, shape in files.items():
        add(assets, 'mesh', name=kind, file=shape.file, scale=[shape.scale] * 3)


def _geoms(body: ET.Element, looks: Sequence[VisualShape]) -> None:
    for shape in looks:
        for kind in (_VISUAL, _COLLISION) if shape.collides else (_VISUAL,):
            add(body, 'geom', class_=kind, type=shape.kind, pos=shape.position,
                quat=_quaternion(shape.rotation),
                material=shape.color if kind == _VISUAL else None,
                mesh=shape.color if shape.file else None, size={
                    'sphere': shape.radius,
                    'cylinder': (shape.radius, 0.5 * shape.length)}.get(shape.kind))


def _inertial(parent: ET.Element, body: MechanismBody) -> None:
    i = body.inertia
    add(parent, 'inertial', pos=body.center, mass=body.mass,
        fullinertia=(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))


def _quaternion(rotation: Array) -> Array:
    """Return w x y z of a rotation."""
    return np.roll(to_quaternion(rotation), 1)
