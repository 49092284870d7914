# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
A hexapod as URDF: a tree whose loops are open at the platform joints.

Its joints, their order and their positions at a pose are those of
``mechanics.kinematics.leg_joints``. The frame ``<leg>_platform_joint`` on the platform is where
the origin of ``<leg>_piston`` is while the loops are closed. Parameters that URDF has no element
for stand in a block ``stewart_dynamics``, which other
readers ignore.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import (
    Hexapod, LegDescription, massless, PASSIVE_RATE, RigidBody, shapes, solids, UNLIMITED)
from stewart_dynamics.description.xml_text import (
    add, CARRIED, carried, center_elements, inertia_texts, numbers, position_elements,
    solid_elements, text_of)
from stewart_dynamics.legs.mechanism import Placement, SLIDE, UNIVERSAL
from stewart_dynamics.legs.tree import VisualShape
from stewart_dynamics.mechanics.frames.rotation import to_euler
from stewart_dynamics.mechanics.kinematics.leg_joints import PLATFORM_JOINTS
from stewart_dynamics.parameters.table import STANDARD_GRAVITY

_AXES = {'x': (1.0, 0.0, 0.0), 'y': (0.0, 1.0, 0.0), 'z': (0.0, 0.0, 1.0)}
# Axes of the platform's virtual joints, and the largest angles of their closed form.
_VIRTUAL = {'yaw': ('z', math.pi), 'pitch': ('y', math.pi / 2), 'roll': ('x', math.pi)}
_COMMENT = ('The loops of a hexapod are open here; its joints close them where they have the '
            'positions of one pose, as the topic joint_states gives them.')

MOCK, TOPIC, JOINT_COMMAND = 'mock', 'topic', 'joint_command'
HARDWARE = {
    MOCK: 'mock_components/GenericSystem',
    TOPIC: 'joint_state_topic_hardware_interface/JointStateTopicSystem',
    JOINT_COMMAND: 'joint_command_topic_hardware_interface/JointCommandTopicSystem'}


class Ros2Control(NamedTuple):
    """The block ros2_control."""

    interfaces: Sequence[str]  # command interfaces of each leg: effort, velocity, position
    hardware: str  # a key of HARDWARE, or the name of a plugin


def urdf(hexapod: Hexapod, name: str, control: Ros2Control | None = None,
         constraints: bool = False, solid: bool = False) -> str:
    """
    Return a hexapod as URDF; the robot has this name, or another one where a link has it.

    control: adds a block ros2_control for the six legs.
    constraints: adds elements ``constraint``, of pull request 108 of ros/urdfdom_headers, that
        close its loops.
    solid: all links that move have a mass, and inertia about all axes.
    """
    root = ET.Element('robot')
    for color, rgba in hexapod.colors.items():
        add(add(root, 'material', name=color), 'color', rgba=numbers(rgba))
    looks = shapes(hexapod)
    _link(root, massless(hexapod.base), looks[hexapod.base])
    frame = hexapod.frame_body if solid else massless
    _platform(root, hexapod, frame, looks[hexapod.platform])
    for leg in hexapod.legs:
        _leg(root, hexapod, leg, frame, solid, looks)
    links = {link.get('name') for link in root.iter('link')}
    # Readers take the name of the robot as a frame, which would be that link's.
    root.set('name', f'{name}_hexapod' if name in links else name)
    p = hexapod.parameters
    block = add(root, CARRIED)
    kind = hexapod.kind
    elements = {'gravity': STANDARD_GRAVITY, **position_elements(hexapod), **{
        each: [UNLIMITED] * 6 for each in (kind.rate_limit, kind.effort_limit)
        if p[each] is None}}
    elements |= solid_elements(hexapod) if solid else center_elements(hexapod)
    for each, parameter in carried(p, elements, (kind.fields['reflected_mass'],)):
        add(block, 'parameter', name=each, **parameter._asdict())
    for leg in hexapod.legs:
        if constraints:
            _constraint(root, hexapod, leg)
        else:
            add(block, 'loop', tip=leg.end_frame, platform=leg.ball)
    if control is not None:
        _ros2_control(root, hexapod, name, control)
    return text_of(root, _COMMENT)


def _platform(root: ET.Element, hexapod: Hexapod, frame: Callable[[str], RigidBody],
              looks: Sequence[VisualShape]) -> None:
    """
    Write the chain of virtual joints, the platform and the frames of its joints.

    frame: makes the body of a link that is only a frame.
    """
    parent = hexapod.base
    reach = sum(np.linalg.norm(joints, axis=1).max() for joints in (
        hexapod.parameters.geometry.base_joints,
        hexapod.parameters.geometry.platform_joints))
    reach += max(leg.branch.reach for leg in hexapod.legs)
    for each, name in zip(PLATFORM_JOINTS, hexapod.joints, strict=False):
        axis, bound = _VIRTUAL.get(each, (each, reach))
        child = hexapod.platform if each == PLATFORM_JOINTS[-1] else f'{name}_link'
        if child == hexapod.platform:
            _link(root, hexapod.platform_body, looks)
        else:
            _link(root, frame(child))
        joint = _joint(root, name, 'revolute' if each in _VIRTUAL else 'prismatic', parent, child)
        add(joint, 'axis', xyz=numbers(_AXES[axis]))
        _limit(joint, (-bound, bound), PASSIVE_RATE, 0.0)
        parent = child
    for leg in hexapod.legs:
        _link(root, massless(leg.ball))
        _joint(root, f'{leg.ball}_fixed', 'fixed', hexapod.platform, leg.ball,
               leg.platform_joint)


def _leg(root: ET.Element, hexapod: Hexapod, leg: LegDescription,
         frame: Callable[[str], RigidBody], solid: bool,
         looks: dict[str, tuple[VisualShape, ...]]) -> None:
    for link, body in leg.links:
        if link.joint == UNIVERSAL:
            _link(root, frame(leg.cross))
        _link(root, hexapod.solid(link, body) if solid else body, looks[body.name])
    for link, body in leg.links:
        parent = leg.carrier(link, hexapod.base)
        if link.joint == UNIVERSAL:
            _universal(root, leg, parent, body.name, link.at_zero)
        else:
            _drive(root, leg, parent, body.name, link.at_zero)
    if leg.branch.end.any():
        _link(root, massless(leg.tip))
        _joint(root, f'{leg.tip}_fixed', 'fixed', leg.last.name, leg.tip, leg.branch.end)


def _universal(root: ET.Element, leg: LegDescription, parent: str, child: str, at: Placement,
               ) -> None:
    first = _joint(root, leg.universal[0], 'revolute', parent, leg.cross, at.position,
                   at.rotation)
    add(first, 'axis', xyz=numbers(_AXES['x']))
    _limit(first, (-math.pi, math.pi), PASSIVE_RATE, 0.0)
    second = _joint(root, leg.universal[1], 'revolute', leg.cross, child)
    add(second, 'axis', xyz=numbers(_AXES['y']))
    _limit(second, (-math.pi / 2, math.pi / 2), PASSIVE_RATE, 0.0)


def _drive(root: ET.Element, leg: LegDescription, parent: str, child: str, at: Placement) -> None:
    kind = 'prismatic' if leg.drive.joint == SLIDE else 'revolute'
    drive = _joint(root, leg.name, kind, parent, child, at.position, at.rotation)
    add(drive, 'axis', xyz=numbers(_AXES['z']))
    lowest, highest = leg.bounds()
    _limit(drive, (lowest - leg.branch.zero, highest - leg.branch.zero),
           leg.limits.rate or UNLIMITED, leg.limits.effort or UNLIMITED)
    add(drive, 'dynamics', damping=numbers(leg.viscous_friction),
        friction=numbers(leg.coulomb_friction))


def _constraint(root: ET.Element, hexapod: Hexapod, leg: LegDescription) -> None:
    closing = add(root, 'constraint', name=leg.ball, type='spherical')
    for side, link, at in (('parent', leg.last.name, leg.branch.end),
                           ('child', hexapod.platform, leg.platform_joint)):
        add(closing, side, link=link)
        add(closing, f'{side}_origin', xyz=numbers(at), rpy=numbers(np.zeros(3)))


def _link(root: ET.Element, body: RigidBody, looks: Sequence[VisualShape] = ()) -> None:
    link = add(root, 'link', name=body.name)
    # Zeros are written: some readers take 1 kg where there is no such element.
    inertial = add(link, 'inertial')
    add(inertial, 'origin', xyz=numbers(body.center))
    add(inertial, 'mass', value=numbers(body.mass))
    add(inertial, 'inertia', **inertia_texts(body))
    for kind, some in (('visual', looks), ('collision', solids(looks))):
        for shape in some:
            one = add(link, kind)
            _origin(one, shape.position, shape.rotation)
            _geometry(one, shape)
            if kind == 'visual':
                add(one, 'material', name=shape.color)


def _geometry(parent: ET.Element, shape: VisualShape) -> None:
    geometry = add(parent, 'geometry')
    if shape.kind == 'mesh':
        add(geometry, 'mesh', filename=shape.file, scale=numbers([shape.scale] * 3))
    elif shape.kind == 'sphere':
        add(geometry, 'sphere', radius=numbers(shape.radius))
    else:
        add(geometry, 'cylinder', radius=numbers(shape.radius), length=numbers(shape.length))


def _joint(root: ET.Element, name: str, kind: str, parent: str, child: str,
           position: Array | None = None, rotation: Array | None = None) -> ET.Element:
    joint = add(root, 'joint', name=name, type=kind)
    if position is not None:
        _origin(joint, position, np.eye(3) if rotation is None else rotation)
    add(joint, 'parent', link=parent)
    add(joint, 'child', link=child)
    return joint


def _origin(parent: ET.Element, position: Array, rotation: Array) -> None:
    add(parent, 'origin', xyz=numbers(position), rpy=numbers(to_euler(rotation)))


def _limit(joint: ET.Element, bounds: tuple[float, float], rate: float, force: float) -> None:
    add(joint, 'limit', lower=numbers(bounds[0]), upper=numbers(bounds[1]),
        velocity=numbers(rate), effort=numbers(force))


def _ros2_control(root: ET.Element, hexapod: Hexapod, name: str, control: Ros2Control) -> None:
    system = add(root, 'ros2_control', name=name, type='system')
    hardware = add(system, 'hardware')
    add(hardware, 'plugin', HARDWARE.get(control.hardware, control.hardware))
    if control.hardware in (TOPIC, JOINT_COMMAND):
        add(hardware, 'param', '/hexapod/joint_commands', name='joint_commands_topic')
        add(hardware, 'param', '/hexapod/joint_states', name='joint_states_topic')
        # Otherwise commands near the state are dropped: all of them at rest, and efforts alone.
        add(hardware, 'param', '-1', name='trigger_joint_command_threshold')
    if control.hardware == MOCK and {'position', 'velocity'} & set(control.interfaces) == {
            'velocity'}:
        # Otherwise the position would stay where it is.
        add(hardware, 'param', 'true', name='calculate_dynamics')
    for leg in hexapod.legs:
        joint = add(system, 'joint', name=leg.name)
        for interface in control.interfaces:
            add(joint, 'command_interface', name=interface)
        for interface in ('position', 'velocity', 'effort'):
            state = add(joint, 'state_interface', name=interface)
            if interface == 'position':
                add(state, 'param', numbers(leg.at_home),
                    name='initial_value')
