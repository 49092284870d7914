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

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.carried import CARRIED, carried
from stewart_dynamics.description.hexapod import Hexapod, LegDescription
from stewart_dynamics.description.xml_text import add, numbers, text_of, XmlWriter
from stewart_dynamics.legs.mechanism import BALL, FIXED, Joint, OTHER, UNIVERSAL
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
    writer = _SdfWriter(hexapod.colors)
    writer.add_pose(model, np.zeros(3), upright(p.gravity))
    add(model, 'self_collide', 'false')
    tree = hexapod.tree(from_home=True)
    for body, joint, at, _, looks, leg in tree:
        link = writer.add_link(model, body.name, '' if joint.kind == FIXED else joint.parent,
                               *at[::-1])
        if body.mass:
            writer.add_inertial(link, body)
        writer.add_shapes(link, looks)
        if joint.kind == OTHER:
            continue
        made = writer.add_joint(model, joint.name, joint.kind, joint.parent, body.name)
        if joint.kind == UNIVERSAL:
            for tag, along in (('axis', [1, 0, 0]), ('axis2', [0, 1, 0])):
                writer.add_values(made, tag, xyz=along)
        elif leg:
            _complete_drive(writer, made, joint, not hexapod.kind.zero)
    for leg in hexapod.legs:
        _add_tip(writer, model, hexapod, leg)
    gravity = upright(p.gravity).T @ STANDARD_GRAVITY
    for each, parameter in carried(hexapod, tree, {'gravity': gravity}, [hexapod.kind.zero]):
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


def _complete_drive(writer: _SdfWriter, drive: ET.Element, joint: Joint, positions: bool) -> None:
    add(drive, 'drake:rotor_inertia', joint.armature)
    add(drive, 'drake:gear_ratio', 1.0)
    if positions:
        add(drive, f'{CARRIED}:position', joint.position)
    axis, (lower, upper) = writer.add_values(drive, 'axis', xyz=[0, 0, 1]), joint.travel
    writer.add_values(axis, 'limit', lower=lower, upper=upper, effort=joint.force_max,
                      velocity=joint.velocity_max)
    writer.add_values(axis, 'dynamics', damping=joint.damping, friction=joint.friction)


def _add_tip(writer: _SdfWriter, model: ET.Element, hexapod: Hexapod, leg: LegDescription,
             ) -> None:
    """Write a ball joint, the tip that it leads to, and the plugin that fixes the tip."""
    tip = writer.add_link(model, leg.tip, hexapod.platform, leg.platform_joint)
    writer.add_inertial(tip, hexapod.frame_body(leg.tip))
    writer.add_joint(model, leg.ball, BALL, leg.last, leg.tip)
    fixes = add(model, 'plugin', filename='gz-sim-detachable-joint-system',
                name='gz::sim::systems::DetachableJoint')
    add(fixes, 'parent_link', hexapod.platform)
    add(fixes, 'child_model', '__model__')
    add(fixes, 'child_link', leg.tip)
    writer.add_values(model, 'drake:ball_constraint', **{
        f'drake:ball_constraint_{key}': value for key, value in (
            ('body_A', leg.last), ('body_B', hexapod.platform),
            ('p_AP', leg.branch.end), ('p_BQ', leg.platform_joint))})


class _SdfWriter(XmlWriter):
    """Values are elements."""

    file = 'uri'
    names = True

    def add_value(self, parent: ET.Element, tag: str, value: Any, key: str = '') -> None:
        """Add an element with a text."""
        add(parent, tag, value)

    def add_values(self, parent: ET.Element, tag: str, **values: Any) -> ET.Element:
        """Add an element with elements."""
        made = add(parent, tag)
        for key, value in values.items():
            if value is not None:
                add(made, key, value)
        return made

    def add_pose(self, parent: ET.Element, position: Array, rotation: Array | None = None,
                 relative_to: str = '') -> None:
        """Add a pose, in the frame of the parent or another one."""
        angles = np.zeros(3) if rotation is None else to_euler(rotation)
        add(parent, 'pose', numbers(position, angles), relative_to=relative_to or None)

    def add_material(self, visual: ET.Element, color: str) -> None:
        """Add a color by its numbers."""
        self.add_values(visual, 'material', ambient=self.colors[color], diffuse=self.colors[color])

    def add_link(self, model: ET.Element, name: str, relative_to: str, position: Array,
                 rotation: Array | None = None) -> ET.Element:
        """Add a link at a pose."""
        link = add(model, 'link', name=name)
        self.add_pose(link, position, rotation, relative_to)
        return link
