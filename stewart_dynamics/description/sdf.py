# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
A hexapod as SDFormat, with closed loops, for Gazebo.

A universal joint at the base and a ball joint at the platform close each loop. The physics engines
of Gazebo take trees alone (https://github.com/gazebosim/gz-physics/issues/25), but fix two links
to each other while they run: each ball joint leads to a tip, a link of its own, which Gazebo's
system DetachableJoint fixes to the platform. Drake closes the loops by constraints, elements with
the prefix ``drake``, as the reflected masses.

SDFormat counts the positions of joints from the poses in the file, those of the home pose: the
position of a leg's joint is its length, or its angle, less that at home, and its limits are
counted from there, too.

The model is turned so that gravity, given in base axes, points along the world's -z. What SDFormat
has no place for stands in elements with the prefix ``stewart_dynamics``, which other readers
ignore.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import (
    Hexapod, LegDescription, RigidBody, shapes, solids)
from stewart_dynamics.description.xml_text import (
    add, base_element, CARRIED, carried, inertia_texts, numbers, solid_elements, text_of)
from stewart_dynamics.legs.mechanism import SLIDE, UNIVERSAL
from stewart_dynamics.legs.tree import LegLink, VisualShape
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.parameters.table import STANDARD_GRAVITY

_VERSION = '1.9'
DRAKE = 'http://drake.mit.edu'
_NAMESPACE = 'https://stewart-dynamics.example/sdf'
POSITION = f'{{{_NAMESPACE}}}position'
"""Element of a joint with its position at the poses of the file, where parameters count it."""
_COMMENT = 'Positions of joints are counted from the home pose.'


def sdf(hexapod: Hexapod, name: str) -> str:
    """Return a hexapod as SDFormat; ``name`` is that of the model."""
    root = ET.Element('sdf', {'version': _VERSION, f'xmlns:{CARRIED}': _NAMESPACE,
                              'xmlns:drake': DRAKE})
    model = add(root, 'model', name=name, canonical_link=hexapod.base_body)
    p = hexapod.parameters
    _pose(model, np.zeros(3), upright(p.gravity))
    add(model, 'self_collide', 'false')
    looks = shapes(hexapod)
    base = _link(model, hexapod.base_body, '', np.zeros(3), np.eye(3))
    _shapes(base, hexapod, looks[hexapod.base])
    _joint(model, f'{hexapod.base_body}_to_world', 'fixed', 'world', hexapod.base_body)
    for leg in hexapod.legs:
        _leg(model, hexapod, leg, looks)
    platform = _link(model, hexapod.platform, hexapod.base_body, hexapod.position,
                     hexapod.rotation)
    _inertial(platform, hexapod.platform_body)
    _shapes(platform, hexapod, looks[hexapod.platform])
    for leg in hexapod.legs:
        _tip(model, hexapod, leg)
    elements = {**base_element(hexapod), **solid_elements(hexapod),
                'gravity': upright(p.gravity).T @ STANDARD_GRAVITY,
                **{each: None for each in hexapod.kind.drive_limits if p[each] is None}}
    zero = [hexapod.kind.zero] if hexapod.kind.zero else []
    for each, parameter in carried(p, elements, zero):
        add(model, f'{CARRIED}:parameter', name=each, **parameter._asdict())
    return text_of(root, _COMMENT)


def upright(gravity: Array) -> Array:
    """Return the shortest rotation (3, 3) from base axes to axes in which gravity is along -z."""
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        return np.eye(3)
    x, y, z = -gravity / size
    if z < -1.0 + 1e-12:  # upside down
        return np.diag([1.0, -1.0, -1.0])
    # R = 1 + K + K^2 / (1 + z) with K the cross product of (x, y, z) and (0, 0, 1).
    k = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    turn: Array = np.eye(3) + k + k @ k / (1.0 + z)
    return turn


def _leg(model: ET.Element, hexapod: Hexapod, leg: LegDescription,
         looks: dict[str, tuple[VisualShape, ...]]) -> None:
    for link, body in leg.links:
        parent = leg.carrier(link, hexapod.base_body)
        made = _link(model, body.name, parent, *link.at_home[::-1])
        _inertial(made, hexapod.solid(link, body))
        _shapes(made, hexapod, looks[body.name])
        if link.joint == UNIVERSAL:
            universal = _joint(model, f'{leg.name}_universal', 'universal', parent, body.name)
            for tag, along in (('axis', [1, 0, 0]), ('axis2', [0, 1, 0])):
                add(add(universal, tag), 'xyz', numbers(along))
        else:
            _drive(model, hexapod, leg, link, parent)


def _drive(model: ET.Element, hexapod: Hexapod, leg: LegDescription, link: LegLink, parent: str,
           ) -> None:
    drive = _joint(model, leg.name, 'prismatic' if link.joint == SLIDE else 'revolute', parent,
                   f'{leg.name}_{link.part}')
    add(drive, 'drake:rotor_inertia', numbers(leg.reflected))
    add(drive, 'drake:gear_ratio', numbers(1.0))
    if not hexapod.kind.zero:
        add(drive, f'{CARRIED}:position', numbers(leg.branch.home))
    axis = add(drive, 'axis')
    add(axis, 'xyz', numbers([0, 0, 1]))
    limits, limit = leg.limits, add(axis, 'limit')
    for tag, value in (('lower', limits.lowest), ('upper', limits.highest)):
        if value is not None:
            add(limit, tag, numbers(value - leg.branch.home))
    for tag, value in (('effort', limits.effort), ('velocity', limits.rate)):
        if value is not None:
            add(limit, tag, numbers(value))
    dynamics = add(axis, 'dynamics')
    add(dynamics, 'damping', numbers(leg.viscous_friction))
    add(dynamics, 'friction', numbers(leg.coulomb_friction))


def _tip(model: ET.Element, hexapod: Hexapod, leg: LegDescription) -> None:
    """Write a ball joint, the tip that it leads to, and the plugin that fixes the tip."""
    tip = _link(model, leg.tip, hexapod.platform, leg.platform_joint, np.eye(3))
    _inertial(tip, hexapod.frame_body(leg.tip))
    _joint(model, leg.ball, 'ball', leg.last.name, leg.tip)
    fixes = add(model, 'plugin', filename='gz-sim-detachable-joint-system',
                name='gz::sim::systems::DetachableJoint')
    add(fixes, 'parent_link', hexapod.platform)
    add(fixes, 'child_model', '__model__')
    add(fixes, 'child_link', leg.tip)
    closing = add(model, 'drake:ball_constraint')
    for key, value in (('body_A', leg.last.name), ('body_B', hexapod.platform),
                       ('p_AP', numbers(leg.branch.end)), ('p_BQ', numbers(leg.platform_joint))):
        add(closing, f'drake:ball_constraint_{key}', value)


def _link(model: ET.Element, name: str, relative_to: str, position: Array, rotation: Array,
          ) -> ET.Element:
    link = add(model, 'link', name=name)
    _pose(link, position, rotation, relative_to)
    return link


def _joint(model: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    joint = add(model, 'joint', name=name, type=kind)
    add(joint, 'parent', parent)
    add(joint, 'child', child)
    return joint


def _pose(parent: ET.Element, position: Array, rotation: Array, relative_to: str = '') -> None:
    pose = add(parent, 'pose', numbers(position, to_euler(rotation)))
    if relative_to:
        pose.set('relative_to', relative_to)


def _inertial(link: ET.Element, body: RigidBody) -> None:
    inertial = add(link, 'inertial')
    _pose(inertial, body.center, np.eye(3))
    add(inertial, 'mass', numbers(body.mass))
    inertia = add(inertial, 'inertia')
    for tag, text in inertia_texts(body).items():
        add(inertia, tag, text)


def _shapes(link: ET.Element, hexapod: Hexapod, looks: Sequence[VisualShape]) -> None:
    for kind, some in (('visual', looks), ('collision', solids(looks))):
        for n, shape in enumerate(some, 1):
            one = add(link, kind, name=f'{kind}_{n}')
            _pose(one, shape.position, shape.rotation)
            _geometry(one, shape)
            if kind == 'visual':
                material = add(one, 'material')
                add(material, 'ambient', numbers(hexapod.colors[shape.color]))
                add(material, 'diffuse', numbers(hexapod.colors[shape.color]))


def _geometry(parent: ET.Element, shape: VisualShape) -> None:
    geometry = add(parent, 'geometry')
    if shape.kind == 'mesh':
        mesh = add(geometry, 'mesh')
        add(mesh, 'uri', shape.file)
        add(mesh, 'scale', numbers([shape.scale] * 3))
        return
    solid = add(geometry, shape.kind)
    add(solid, 'radius', numbers(shape.radius))
    if shape.kind == 'cylinder':
        add(solid, 'length', numbers(shape.length))
