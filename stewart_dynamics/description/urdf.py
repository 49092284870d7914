# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
A hexapod as URDF: a tree whose loops are open at the platform joints.

Its joints, their order and their positions at a pose are those of
``mechanics.kinematics.leg_joints``. The frame ``<leg>_platform_joint`` on the platform is where
the origin of ``<leg>_piston`` is while the loops are closed. Parameters that URDF has no element
for stand in a block ``stewart_dynamics``, which other readers ignore.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.carried import CARRIED, carried
from stewart_dynamics.description.hexapod import (
    Hexapod, LegDescription, massless, PASSIVE_RATE, TreeBody, UNLIMITED)
from stewart_dynamics.description.xml_text import add, text_of, XmlWriter
from stewart_dynamics.legs.mechanism import (
    FIXED, HINGE, MechanismBody, Placement, SLIDE, UNIVERSAL)
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
        add(add(root, 'material', name=color), 'color', rgba=rgba)
    tree = hexapod.tree(hexapod.base, solid, unlimited=UNLIMITED)
    base, *of_legs, platform = tree
    writer = _UrdfWriter(hexapod, root, hexapod.frame_body if solid else massless)
    writer.add_link(base.body, base.shapes)
    writer.add_platform(platform)
    for leg in hexapod.legs:
        writer.add_leg(leg, [part for part in of_legs if part.leg is leg])
    links = {link.get('name') for link in root.iter('link')}
    # Readers take the name of the robot as a frame, which would be that link's.
    root.set('name', f'{name}_hexapod' if name in links else name)
    block = add(root, CARRIED)
    without = hexapod.kind.fields['reflected_mass'],
    for each, parameter in carried(hexapod, tree, {'gravity': STANDARD_GRAVITY}, without):
        add(block, 'parameter', name=each, **parameter._asdict())
    for leg in hexapod.legs:
        if constraints:
            _constraint(root, hexapod, leg)
        else:
            add(block, 'loop', tip=leg.end_frame, platform=leg.ball)
    if control is not None:
        _ros2_control(root, hexapod, name, control)
    return text_of(root, _COMMENT)


def _constraint(root: ET.Element, hexapod: Hexapod, leg: LegDescription) -> None:
    closing = add(root, 'constraint', name=leg.ball, type='spherical')
    for side, link, at in (('parent', leg.last, leg.branch.end),
                           ('child', hexapod.platform, leg.platform_joint)):
        add(closing, side, link=link)
        add(closing, f'{side}_origin', xyz=at, rpy=np.zeros(3))


class _UrdfWriter(XmlWriter):
    """
    Values are attributes, and each joint has a limit and an axis.

    frame: makes the body of a link that is only a frame.
    """

    file = 'filename'
    names = False

    def __init__(self, hexapod: Hexapod, root: ET.Element, frame: Callable[[str], MechanismBody],
                 ) -> None:
        super().__init__(hexapod.colors)
        self._hexapod, self._root, self._frame = hexapod, root, frame

    def add_value(self, parent: ET.Element, tag: str, value: Any, key: str = 'value') -> None:
        """Add an element with an attribute."""
        add(parent, tag, **{key: value})

    def add_values(self, parent: ET.Element, tag: str, **values: Any) -> ET.Element:
        """Add an element with attributes."""
        return add(parent, tag, **values)

    def add_pose(self, parent: ET.Element, position: Array, rotation: Array | None = None) -> None:
        """Add an origin."""
        angles = None if rotation is None else to_euler(rotation)
        add(parent, 'origin', xyz=position, rpy=angles)

    def add_material(self, visual: ET.Element, color: str) -> None:
        """Add a color by its name."""
        add(visual, 'material', name=color)

    def add_link(self, body: MechanismBody, looks: Sequence[VisualShape] = ()) -> None:
        """Add a link; zeros are written: some readers take 1 kg where there is no such element."""
        link = add(self._root, 'link', name=body.name)
        self.add_inertial(link, body)
        self.add_shapes(link, looks)

    def add_fixed(self, name: str, parent: str, position: Array) -> None:
        """Add a frame on a link."""
        self.add_link(massless(name))
        self.add_joint(self._root, f'{name}_fixed', FIXED, parent, name, position, np.eye(3))

    def add_moving(self, name: str, kind: str, parent: str, child: str, axis: str,
                   bounds: tuple[float | None, float | None], at: Placement | None = None,
                   rate: float | None = PASSIVE_RATE, effort: float | None = 0.0,
                   ) -> ET.Element:
        """Add a joint about or along an axis, x, y or z; one without actuator by default."""
        joint = self.add_joint(self._root, name, kind, parent, child,
                               *((at.position, at.rotation) if at else ()))
        add(joint, 'axis', xyz=_AXES[axis])
        add(joint, 'limit', lower=bounds[0], upper=bounds[1], velocity=rate, effort=effort)
        return joint

    def add_platform(self, platform: TreeBody) -> None:
        """Add the chain of virtual joints, the platform and the frames of its joints."""
        hexapod, parent = self._hexapod, platform.joint.parent
        geometry = hexapod.parameters.geometry
        reach = sum(np.linalg.norm(joints, axis=1).max() for joints in (
            geometry.base_joints, geometry.platform_joints))
        reach += max(leg.branch.reach for leg in hexapod.legs)
        for each, name in zip(PLATFORM_JOINTS, hexapod.joints, strict=False):
            axis, bound = _VIRTUAL.get(each, (each, reach))
            child = f'{name}_link'
            if each == PLATFORM_JOINTS[-1]:
                child = hexapod.platform
                self.add_link(platform.body, platform.shapes)
            else:
                self.add_link(self._frame(child))
            self.add_moving(name, HINGE if each in _VIRTUAL else SLIDE, parent, child, axis,
                            (-bound, bound))
            parent = child
        for leg in hexapod.legs:
            self.add_fixed(leg.ball, hexapod.platform, leg.platform_joint)

    def add_leg(self, leg: LegDescription, parts: Sequence[TreeBody]) -> None:
        """Add the bodies of a leg, its joints, and the frame at its end."""
        for part in parts:
            if part.joint.kind == UNIVERSAL:
                self.add_link(self._frame(leg.cross))
            self.add_link(part.body, part.shapes)
        for part in parts:
            name, made = part.body.name, part.joint
            if made.kind == UNIVERSAL:
                for joint, parent, child, axis, bound, at in (
                        (leg.universal[0], made.parent, leg.cross, 'x', math.pi, part.at_zero),
                        (leg.universal[1], leg.cross, name, 'y', math.pi / 2, None)):
                    self.add_moving(joint, HINGE, parent, child, axis, (-bound, bound), at)
            else:
                drive = self.add_moving(
                    leg.name, made.kind, made.parent, name, 'z', (made.lower, made.upper),
                    part.at_zero, made.velocity_max, made.force_max)
                add(drive, 'dynamics', damping=made.damping, friction=made.friction)
        if leg.branch.end.any():
            self.add_fixed(leg.tip, leg.last, leg.branch.end)


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
                add(state, 'param', leg.branch.home - leg.branch.zero, name='initial_value')
