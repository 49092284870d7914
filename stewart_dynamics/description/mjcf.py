# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
A hexapod as MJCF, the format of MuJoCo: its loops closed by ``connect``, a motor for each leg.

Coordinates at the start are those of the home pose. A slide joint has the name and position of its
leg; ``ctrl`` is the force of each leg in the order of ``joints`` [N]. The world's axes are base
axes, in which gravity is given: a base that is tilted has a tilted gravity.

Constraints are soft in MuJoCo: at a platform joint they act as springs, and leave gaps of
micrometres in motion. Coulomb friction is such a constraint, too.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    add(root, 'option', timestep=numbers(_TIMESTEP), gravity=numbers(p.gravity),
        integrator='implicitfast', solver='Newton', tolerance=numbers(_TOLERANCE))
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
        add(custom, 'text', name=f'{CARRIED}.{each}', data=parameter.value)
        if parameter.element:
            add(custom, 'text', name=f'{ELEMENT}.{each}', data=parameter.element)
    effort = hexapod.kind.effort
    return text_of(root, _COMMENT.format(
        effort=effort.name, unit=effort.unit, does=effort.positive.removeprefix('+ ')))


def scene(hexapod: Hexapod, name: str) -> str:
    """Return a scene around the MJCF of a hexapod, with light and a floor under the base."""
    root = ET.Element('mujoco', {'model': f'{name}_scene'})
    add(root, 'include', file=f'{name}.xml')
    size = mean_radius(hexapod.parameters.geometry.base_joints)
    add(root, 'statistic', center=numbers(0.5 * hexapod.position), extent=numbers(3.0 * size))
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
    add(world, 'light', pos=numbers(above), dir=numbers(-up), type='directional')
    lowest = min(float(each @ up) for each in (
        *hexapod.parameters.geometry.base_joints, hexapod.position - 2.0 * size * np.abs(up)))
    add(world, 'geom', name='floor', type='plane', size='0 0 0.05', material='floor',
        pos=numbers((lowest - PLATE * size) * up), zaxis=numbers(up))
    return text_of(root, 'A scene around the hexapod.')


def _home(hexapod: Hexapod, tree: Sequence[TreeBody]) -> list[Array]:
    """Return the positions of all joints at home, in MuJoCo's order."""
    legs = [np.zeros(2) if part.joint.kind == UNIVERSAL else np.array([part.joint.position])
            for part in tree if part.leg]
    x, y, z, w = to_quaternion(hexapod.rotation)
    return [*legs, hexapod.position, np.array([w, x, y, z])]


def _body(carrier: ET.Element, hexapod: Hexapod, part: TreeBody) -> ET.Element:
    leg, name, kind, place = part.leg, part.body.name, part.joint.kind, part.at_home
    at = {} if leg else {'childclass': _CLASS}
    if kind != FIXED:
        at['pos'] = numbers(place.position)
    if kind not in (FIXED, SLIDE):
        at['quat'] = _quaternion(place.rotation)
    if leg and part.joint.parent == hexapod.base_body:
        add(carrier, 'site', name=f'{leg.name}_base_joint', pos=numbers(leg.base_joint))
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
        tip = add(body, 'site', name=leg.tip)
        if leg.branch.end.any():
            tip.set('pos', numbers(leg.branch.end))
    if kind == OTHER:
        for each in hexapod.legs:
            add(body, 'site', name=each.ball, pos=numbers(each.platform_joint))
    return body


def _drive(body: ET.Element, joint: Joint) -> None:
    drive = add(body, 'joint', name=joint.name, type=joint.kind, axis='0 0 1',
                ref=numbers(joint.position), armature=numbers(joint.armature),
                damping=numbers(joint.damping), frictionloss=numbers(joint.friction),
                solreffriction=numbers(_SOLREF), solimpfriction=numbers(SOLIMP),
                solreflimit=numbers(_SOLREF))
    if joint.lower is not None:
        drive.set('range', numbers(joint.lower, joint.upper))


def _loops(root: ET.Element, hexapod: Hexapod) -> None:
    equality = add(root, 'equality')
    tendons = add(root, 'tendon')
    for leg in hexapod.legs:
        # By bodies, as all readers know it, not by sites; on the platform the point is where it is
        # in the pose of the file.
        add(equality, 'connect', name=leg.ball, body1=leg.last, body2=hexapod.platform,
            anchor=numbers(leg.branch.end), solref=numbers(SOLREF_LOOP), solimp=numbers(SOLIMP))
        if leg.drive.joint != SLIDE:
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
            motor = add(actuators, 'motor', name=part.joint.name, joint=part.joint.name)
            if part.joint.force_max is not None:
                motor.set('ctrlrange', numbers(-part.joint.force_max, part.joint.force_max))
    kind = hexapod.kind
    for quantity, tag in ((kind.position, 'pos'), (kind.rate, 'vel')):
        for leg in hexapod.legs:
            sensed = 'tendon' if leg.drive.joint == SLIDE else 'joint'
            add(sensors, f'{sensed}{tag}', name=f'{leg.name}_{quantity.name}',
                **{sensed: leg.name})
    for leg in hexapod.legs:
        add(sensors, 'actuatorfrc', name=f'{leg.name}_{kind.effort.name}', actuator=leg.name)


def _assets(root: ET.Element, hexapod: Hexapod, tree: Sequence[TreeBody]) -> None:
    assets = add(root, 'asset')
    for color, rgba in hexapod.colors.items():
        add(assets, 'material', name=color, rgba=numbers(rgba))
    files = {shape.color: shape for part in tree for shape in part.shapes if shape.file}
    for kind, shape in files.items():
        add(assets, 'mesh', name=kind, file=shape.file, scale=numbers([shape.scale] * 3))


def _geoms(body: ET.Element, looks: Sequence[VisualShape]) -> None:
    for shape in looks:
        for kind in (_VISUAL,) if shape.kind == 'sphere' else (_VISUAL, _COLLISION):
            geom = add(body, 'geom', class_=kind, type=shape.kind, pos=numbers(shape.position),
                       quat=_quaternion(shape.rotation))
            if kind == _VISUAL:
                geom.set('material', shape.color)
            if shape.kind == 'mesh':
                geom.set('mesh', shape.color)
            elif shape.kind == 'sphere':
                geom.set('size', numbers(shape.radius))
            else:
                geom.set('size', numbers(shape.radius, 0.5 * shape.length))


def _inertial(parent: ET.Element, body: MechanismBody) -> None:
    i = body.inertia
    add(parent, 'inertial', pos=numbers(body.center), mass=numbers(body.mass),
        fullinertia=numbers(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))


def _quaternion(rotation: Array) -> str:
    x, y, z, w = to_quaternion(rotation)
    return numbers(w, x, y, z)
