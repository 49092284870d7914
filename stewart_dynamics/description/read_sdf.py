# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""SDFormat as a mechanism: poses relative to each other, axes by the rules of each version."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.description.carried import CARRIED
from stewart_dynamics.description.sdf import DRAKE, POSITION
from stewart_dynamics.description.xml_model import carried_of, Defaults, switch, XmlModel
from stewart_dynamics.legs.mechanism import (
    DescriptionError, FIXED, HERE, Joint, Mechanism, MechanismBody, Placement, WORLD)

SDFORMAT = Defaults(axis='0 0 1', xyz='0 0 1', mass=1.0, moment=1.0, least=0.0)
_DRAKE = f'{{{DRAKE}}}'
_MODEL = '__model__'
# The end of the name of Gazebo's system, which was another in Ignition.
_DETACHABLE = '::systems::DetachableJoint'
# Before this version axes are in the frame of the model, not of the joint.
_JOINT_AXES = (1, 5)
# In the names of systems that exert forces on links.
_FORCES = 'buoyancy', 'hydrodynamics', 'liftdrag', 'spring', 'wind', 'thruster', 'applylinkwrench'


def read_sdf(root: ET.Element, source: Path) -> Mechanism:
    """Return the mechanism of the model with most prismatic joints, or most joints at all."""
    model = max(root.iter('model'), default=None, key=lambda each: (
        sum(joint.get('type') == 'prismatic' for joint in each.findall('joint')),
        len(each.findall('joint'))))
    if model is None:
        included = ', '.join(each.findtext('uri', '').strip() for each in root.iter('include'))
        raise DescriptionError(f'{source}: no model' + (
            f', but included ones, {included}: read the file of the model' if included else ''))
    reader = _SdfModel(model, _version(root), source)
    joints = [reader.placed_joint(joint) for joint in model.findall('joint')]
    fixed = [reader.fixed(plugin) for plugin in model.findall('plugin')
             if plugin.get('name', '').endswith(_DETACHABLE)
             and plugin.findtext('child_model', '').strip() == _MODEL]
    # Both close the same loops in files of stewart_describe.
    joints += fixed or [reader.constraint(each)
                        for each in model.findall(f'{_DRAKE}ball_constraint')]
    mechanism = Mechanism(
        str(source), model.get('name', source.stem),
        {link.get('name', ''): reader.body(link) for link in model.findall('link')}, joints)
    if model.find('include') is not None or model.find('model') is not None:
        mechanism.remarks.append('nested and included models are not read')
    for plugin in root.iter('plugin'):
        named = f'{plugin.get("name", "")} {plugin.get("filename", "")}'
        if any(each in named.lower().replace('_', '').replace('-', '') for each in _FORCES):
            mechanism.remarks.append(f'plugin {plugin.get("name", "")!r} is left out')
    gravity = root.find('world/gravity')
    if gravity is not None:
        mechanism.gravity = reader.numbers(gravity.text, 3, 'gravity')
    mechanism.carried = carried_of(
        each for each in model
        if each.tag.endswith('}parameter') or each.tag == f'{CARRIED}:parameter')
    return mechanism


def _version(root: ET.Element) -> tuple[int, ...]:
    try:
        return tuple(int(each) for each in (root.get('version') or '1.9').split('.'))
    except ValueError:
        return 1, 9


class _SdfModel(XmlModel):
    """A model with named frames."""

    def __init__(self, model: ET.Element, version: tuple[int, ...], source: Path) -> None:
        links = [link.get('name', '') for link in model.findall('link')]
        super().__init__(source, [*links, WORLD], SDFORMAT, {WORLD: HERE})
        self._placements |= dict.fromkeys(('', _MODEL), self.pose(model))
        self._axes_in_model = version < _JOINT_AXES
        # Since 1.8 joints may end at frames, of links, other frames, joints or the model.
        self._attached = {each.get('name', ''): each.get('attached_to') or _MODEL
                          for each in model.findall('frame')}
        self._attached |= {each.get('name', ''): each.findtext('child', '').strip()
                           for each in model.findall('joint')}
        self._attached[_MODEL] = model.get('canonical_link') or next(iter(links), '')
        for each in model:
            if each.tag in ('link', 'joint', 'frame'):
                pose = each.find('pose')
                given = '' if pose is None else pose.get('relative_to', pose.get('frame', ''))
                if not given and each.tag == 'joint':
                    given = self.end(each, 'child')
                self.add_frame(each.get('name', ''), given or each.get('attached_to', ''),
                               self.pose(each))

    def body(self, link: ET.Element) -> MechanismBody:
        """Return a link as a body, with the forces on it that have no parameter."""
        made, inertial = super().body(link), link.find('inertial')
        if inertial is not None and switch(inertial.get('auto')):
            made.mass = self.number(inertial, made.name, None, 'mass')
            made.inertia = np.zeros((3, 3))
            made.note = f'{made.name}: inertial auto: engines compute ' + (
                'mass and inertia from its shapes: not read' if made.mass is None
                else 'its inertia from its shapes: 0 kg m^2 here')
        if switch(link.findtext('gravity')) is False:
            made.weightless = 'gravity switched off'
        if link.find('velocity_decay') is not None:
            made.left_out.append('velocity_decay')
        if inertial is not None and inertial.find('fluid_added_mass') is not None:
            made.left_out.append('fluid_added_mass')
        return made

    def placed_joint(self, joint: ET.Element) -> Joint:
        """Return a joint at its frame, with the inertia of its rotor."""
        name = joint.get('name', '')
        made = self.joint(joint, self.place(name), self.number(joint, name, 0.0, POSITION))
        gear = self.number(joint, name, 1.0, f'{_DRAKE}gear_ratio')
        made.armature = gear * gear * self.number(joint, name, 0.0, f'{_DRAKE}rotor_inertia')
        return made

    def axis_frame(self, axis: ET.Element, at: Placement) -> Placement:
        """Return the frame of an axis, by the rule of the version."""
        xyz = axis.find('xyz')
        if self._axes_in_model or switch(axis.findtext('use_parent_model_frame')):
            return self.place(_MODEL)
        frame = None if xyz is None else xyz.get('expressed_in')
        return self.place(frame) if frame else at

    def fixed(self, plugin: ET.Element) -> Joint:
        """Return the joint by which Gazebo fixes a link of the model to another."""
        parent, child = (self.link(plugin.findtext(f'{end}_link', '').strip(), 'DetachableJoint')
                         for end in ('parent', 'child'))
        return Joint(f'{child} to {parent}', FIXED, parent, child, self.place(child).position)

    def constraint(self, element: ET.Element) -> Joint:
        """Return the ball joint of a constraint of Drake."""
        key = f'{_DRAKE}ball_constraint'
        first, second = (
            (self.link(element.findtext(f'{key}_{body}', '').strip(), 'drake:ball_constraint'),
             self.numbers(element.findtext(f'{key}_{point}'), 3, point))
            for body, point in (('body_A', 'p_AP'), ('body_B', 'p_BQ')))
        return self.loop(f'{first[0]} to {second[0]}', first, second)
