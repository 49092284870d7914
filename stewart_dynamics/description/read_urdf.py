# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
URDF as a mechanism.

Elements ``constraint``, ``joint`` in a block ``gazebo``, the block of stewart_describe, a file
beside it (``loops``), or names of frames (onshape-to-robot) close its loops.

MuJoCo's reader of URDF reads no loops (docs/description.md).
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import re
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.description.carried import CARRIED
from stewart_dynamics.description.loops import loops_beside
from stewart_dynamics.description.read_sdf import SDFORMAT
from stewart_dynamics.description.xml_model import (
    carried_of, Defaults, kind_of, switch, XmlModel)
from stewart_dynamics.legs.mechanism import HERE, Joint, Mechanism

_CLOSING = re.compile('(closing_.+_)1')
_ORIGIN = np.zeros(3)


def read_urdf(root: ET.Element, source: Path) -> Mechanism:
    """Return the mechanism of a URDF; DescriptionError where it is not one."""
    reader = UrdfModel(root, source)
    mechanism = Mechanism(
        str(source), root.get('name', source.stem),
        {link.get('name', ''): reader.body(link) for link in root.findall('link')},
        [reader.placed_joint(joint) for joint in reader.joints])
    reader.add_of_gazebo(mechanism)
    reader.add_of_ros2_control(mechanism)
    mechanism.carried = carried_of(root.findall(f'{CARRIED}/parameter'))
    closing = [*reader.written_loops()] or [*reader.loops_beside()]
    if not closing:
        closing = [*reader.named_loops()]
        mechanism.remarks += [f'{joint.name}: frames with names of onshape-to-robot: taken as a '
                              'ball joint' for joint in closing]
    mechanism.joints += {joint.name: joint for joint in closing}.values()
    return mechanism


class UrdfModel(XmlModel):
    """A tree of links: each is placed by the joint that carries it."""

    def __init__(self, root: ET.Element, source: Path) -> None:
        self._root = root
        self._names = [link.get('name', '') for link in root.findall('link')]
        super().__init__(source, self._names, Defaults(
            axis='1 0 0', xyz=None, mass=None, moment=0.0, least=-math.inf), {})
        self.joints = [joint for joint in root.findall('joint') if joint.find('child') is not None]
        for joint in self.joints:
            self.add_frame(self.end(joint, 'child'), self.end(joint, 'parent'), self.pose(joint))
        self._placements |= dict.fromkeys(self._names - self._frames.keys(), HERE)

    def placed_joint(self, joint: ET.Element) -> Joint:
        """Return a joint, whose frame is that of its child."""
        return self.joint(joint, self.place(self.end(joint, 'child')))

    def written_loops(self) -> Iterator[Joint]:
        """Yield the joints that close the loops in the file."""
        for joint in self._root.findall('gazebo/joint'):
            # SDFormat: its pose is in the frame of its child.
            at = self.place(self.end(joint, 'child')).of(self.pose(joint))
            yield self.joint(joint, at, defaults=SDFORMAT)
        for constraint in self._root.findall('constraint'):
            yield self._constraint(constraint)
        for loop in self._root.findall(f'{CARRIED}/loop'):
            tip, ball = (self.link(loop.get(key, ''), 'loop') for key in ('tip', 'platform'))
            yield self.loop(ball, (tip, _ORIGIN), (ball, _ORIGIN))

    def loops_beside(self) -> Iterator[Joint]:
        """Yield the joints that close the loops in a file beside the URDF, if it has one."""
        # A joint has a frame of its name at its child.
        frames = {joint.get('name', ''): self.end(joint, 'child') for joint in self.joints}
        frames |= {link: link for link in self._names}
        for loop in loops_beside(self.source, frames):
            yield self.loop(f'{loop.first} to {loop.second}', (frames[loop.first], _ORIGIN),
                            (frames[loop.second], _ORIGIN), loop.kind)

    def named_loops(self) -> Iterator[Joint]:
        """Yield the loops of onshape-to-robot: frames closing_NAME_1 and closing_NAME_2."""
        for first in self._names:
            named = _CLOSING.fullmatch(first)
            second = f'{named[1]}2' if named else ''
            if second in self._links:
                yield self.loop(f'{first} to {second}', (first, _ORIGIN), (second, _ORIGIN))

    def _constraint(self, element: ET.Element) -> Joint:
        """Return an element ``constraint`` of ros/urdfdom_headers, with a frame on each link."""
        name, axes, ends = element.get('name', ''), [], []
        for side in ('parent', 'child'):
            link, own = self.end(element, side), self.pose(element, f'{side}_origin')
            axis = element.find(f'{side}_axis')
            if axis is not None:
                axes.append(self.place(link).of(own).rotation @ self.unit(
                    axis.get('xyz'), f'{side}_axis of constraint {name!r}'))
            ends.append((link, own.position))
        made = self.loop(name, ends[0], ends[1], kind_of(element))
        made.axes = axes
        return made

    def add_of_gazebo(self, mechanism: Mechanism) -> None:
        """Name what blocks ``gazebo`` of links and joints add to their forces."""
        joints = {joint.name: joint for joint in mechanism.joints}
        for block in self._root.findall('gazebo'):
            name = block.get('reference', '')
            stiffness, reference, decay = (self.number(block, name, 0.0, key) for key in (
                'springStiffness', 'springReference', 'dampingFactor'))
            if name in joints and stiffness:
                joints[name].spring(stiffness, reference)
            if name in mechanism.parts:
                part = mechanism.parts[name]
                if (switch(block.findtext('gravity')) is False
                        or switch(block.findtext('turnGravityOff'))):
                    part.weightless = 'gravity switched off'
                if decay:
                    part.left_out.append(f'dampingFactor {decay:.4g}')

    def add_of_ros2_control(self, mechanism: Mechanism) -> None:
        """Take smaller bounds of efforts and rates from blocks ``ros2_control``."""
        joints = {joint.name: joint for joint in mechanism.joints}
        for each in self._root.findall('ros2_control/joint'):
            joint = joints.get(each.get('name', ''))
            for interface in each.findall('command_interface'):
                name = interface.get('name', '')
                field = {'effort': 'force_max', 'velocity': 'velocity_max'}.get(name)
                ends = {param.get('name'): param.text for param in interface.findall('param')}
                if joint is None or field is None or not ends.get('min') or not ends.get('max'):
                    continue
                lower, upper = (float(self.numbers(
                    ends[key], 1, f'{joint.name}: {key} of {name}')[0]) for key in ('min', 'max'))
                joint.bound(field, f'{name} of ros2_control', lower, upper)
