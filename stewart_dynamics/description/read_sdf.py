# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""SDFormat as a mechanism: poses relative to each other, axes by the rules of each version."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.read_urdf import (
    body_of, carried_of, numbers_of, shapes_of, unit)
from stewart_dynamics.description.sdf import DRAKE, POSITION
from stewart_dynamics.description.xml_text import CARRIED
from stewart_dynamics.legs.mechanism import (
    BALL, DescriptionError, FIXED, HERE, HINGE, Joint, Mechanism, MechanismBody, OTHER, Placement,
    SLIDE, UNIVERSAL, WORLD)
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.parameters.table import INERTIA

_DRAKE = f'{{{DRAKE}}}'
_KINDS = {'fixed': FIXED, 'revolute': HINGE, 'continuous': HINGE, 'prismatic': SLIDE,
          'universal': UNIVERSAL, 'revolute2': UNIVERSAL, 'ball': BALL}
_MODEL = '__model__'
# The end of the name of Gazebo's system, which was another in Ignition.
_DETACHABLE = '::systems::DetachableJoint'
# Before this version axes are in the frame of the model, not of the joint.
_JOINT_AXES = (1, 5)
_UNLIMITED = 1e15  # SDFormat's own value is 1e16
_OFF = ('0', 'false')
# In the names of systems that exert forces on links.
_FORCES = 'buoyancy', 'hydrodynamics', 'liftdrag', 'spring', 'wind', 'thruster', 'applylinkwrench'
_DEFAULT_MASS = 1.0  # [kg], of a link without one


def read_sdf(root: ET.Element, source: Path) -> Mechanism:
    """Return the mechanism of the model with most prismatic joints."""
    models = [*root.iter('model')]
    if not models:
        raise DescriptionError(f'{source}: no model')
    model = max(models, key=lambda each: sum(
        joint.get('type') == 'prismatic' for joint in each.findall('joint')))
    reader = _Model(model, _version(root), source)
    joints = [made for joint in model.findall('joint') for made in [reader.joint(joint)] if made]
    fixed = [made for plugin in model.findall('plugin') for made in [reader.fixed(plugin)]
             if made]
    # Both close the same loops in files of stewart_describe.
    joints += fixed or [reader.constraint(each)
                        for each in model.findall(f'{_DRAKE}ball_constraint')]
    mechanism = Mechanism(
        str(source), model.get('name', source.stem),
        {link.get('name', ''): reader.part(link) for link in model.findall('link')}, joints)
    if model.find('include') is not None or model.find('model') is not None:
        mechanism.remarks.append('nested and included models are not read')
    for plugin in [*root.iter('plugin')]:
        named = f'{plugin.get("name", "")} {plugin.get("filename", "")}'
        if any(each in named.lower().replace('_', '').replace('-', '') for each in _FORCES):
            mechanism.remarks.append(f'plugin {plugin.get("name", "")!r} is left out')
    gravity = root.find('world/gravity')
    if gravity is not None:
        mechanism.gravity = numbers_of(gravity.text, 3, source, 'gravity')
    for each in model:
        if each.tag.endswith('}parameter') or each.tag == f'{CARRIED}:parameter':
            mechanism.carried[each.get('name', '')] = carried_of(each)
    return mechanism


def _version(root: ET.Element) -> tuple[int, ...]:
    try:
        return tuple(int(each) for each in (root.get('version') or '1.9').split('.'))
    except ValueError:
        return 1, 9


class _Model:
    """The frames of a model."""

    def __init__(self, model: ET.Element, version: tuple[int, ...], source: Path) -> None:
        self._version, self._source = version, source
        self._elements = {each.get('name', ''): each for tag in ('link', 'joint', 'frame')
                          for each in model.findall(tag)}
        self._links = {link.get('name', '') for link in model.findall('link')}
        self._placements: dict[str, Placement] = {}
        self._model = HERE
        self._model = self._own(model)

    def place(self, name: str) -> Placement:
        """Return where a link, joint or frame is."""
        waiting: dict[str, None] = {}  # frames, each relative to the next
        while name not in ('', _MODEL, WORLD) and name not in self._placements:
            if name not in self._elements or name in waiting:
                raise DescriptionError(f'{self._source}: no frame {name!r}, or relative to itself')
            waiting[name] = None
            name = self._relative_to(self._elements[name])
        at = HERE if name == WORLD else self._placements.get(name, self._model)
        for name in reversed(waiting):
            at = self._placements[name] = at.of(self._own(self._elements[name]))
        return at

    def _relative_to(self, element: ET.Element) -> str:
        """Return the frame in which the pose of an element is given."""
        pose = element.find('pose')
        given = '' if pose is None else pose.get('relative_to') or pose.get('frame')
        if given:
            return given
        if element.tag == 'joint':
            return self._text(element, 'child')
        return element.get('attached_to', '') if element.tag == 'frame' else ''

    def part(self, link: ET.Element) -> MechanismBody:
        """Return a link as a body."""
        name, inertial = link.get('name', ''), link.find('inertial')
        made = self._body(name, inertial, shapes_of(link))
        if link.findtext('gravity', '').strip() in _OFF:
            made.weightless = 'gravity switched off'
        if link.find('velocity_decay') is not None:
            made.left_out.append('velocity_decay')
        if inertial is not None and inertial.find('fluid_added_mass') is not None:
            made.left_out.append('fluid_added_mass')
        return made

    def _body(self, name: str, inertial: ET.Element | None, shapes: int) -> MechanismBody:
        if inertial is None:
            return MechanismBody(
                name, self.place(name), _DEFAULT_MASS, inertia=np.eye(3), shapes=shapes,
                note=f'{name}: no mass: {_DEFAULT_MASS:g} kg, as SDFormat has it')
        six = np.array([self._number(
            inertial, f'inertia/{key}', name, 1.0 if key in ('ixx', 'iyy', 'izz') else 0.0)
            for key in INERTIA])
        mass = self._number(inertial, 'mass', name, _DEFAULT_MASS)
        return body_of(name, self.place(name), mass, six, self._own(inertial), shapes)

    def _number(self, element: ET.Element, path: str, name: str, default: float) -> float:
        """Return a number; its default where it is missing or empty, as libsdformat does."""
        text = (element.findtext(path) or '').strip()
        return float(numbers_of(text, 1, self._source, f'{name}: {path}')[0]) if text else default

    def joint(self, joint: ET.Element) -> Joint | None:
        """Return a joint."""
        name = joint.get('name', '')
        parent, child = self._text(joint, 'parent'), self._text(joint, 'child')
        for end in (parent, child):
            if end not in self._links | {WORLD}:
                raise DescriptionError(f'{self._source}: joint {name!r}: no link {end!r}')
        made = Joint(name, _KINDS.get(joint.get('type', ''), OTHER), parent, child,
                     self.place(name).position)
        position = joint.findtext(POSITION)
        if position is not None:
            made.position = float(numbers_of(position, 1, self._source, f'{name}: position')[0])
        gear = self._number(joint, f'{_DRAKE}gear_ratio', name, 1.0)
        made.armature = gear ** 2 * self._number(joint, f'{_DRAKE}rotor_inertia', name, 0.0)
        made.axes = [self._axis(joint, axis) for axis in (
            joint.find('axis'), joint.find('axis2')) if axis is not None]
        for tag in ('axis', 'axis2'):
            axis = joint.find(tag)
            if axis is not None:
                self._add_axis(axis, made)
        return made

    def _add_axis(self, axis: ET.Element, made: Joint) -> None:
        """Add limits and dynamics of an axis; a joint with two has the larger dynamics."""
        damping, friction, stiffness, reference = (
            self._number(axis, f'dynamics/{key}', made.name, 0.0)
            for key in ('damping', 'friction', 'spring_stiffness', 'spring_reference'))
        made.damping, made.friction = max(made.damping, damping), max(made.friction, friction)
        if stiffness:
            made.spring(stiffness, reference)
        mimic = axis.find('mimic')
        if mimic is not None:
            made.left_out.append(f'mimic of {mimic.get("joint", "")!r}')
        if made.kind not in (SLIDE, HINGE):
            return
        for field, key in (('lower', 'lower'), ('upper', 'upper'), ('velocity_max', 'velocity'),
                           ('force_max', 'effort')):
            value = self._number(axis, f'limit/{key}', made.name, math.inf)
            if abs(value) < _UNLIMITED and not (value < 0.0 and field.endswith('_max')):
                at = 0.0 if field.endswith('_max') else made.position  # where it counts from
                setattr(made, field, value + at)

    def fixed(self, plugin: ET.Element) -> Joint | None:
        """Return the joint by which Gazebo fixes a link of the model to another; None if none."""
        if (not plugin.get('name', '').endswith(_DETACHABLE)
                or plugin.findtext('child_model', '').strip() != _MODEL):
            return None
        parent, child = (plugin.findtext(f'{end}_link', '').strip() for end in ('parent', 'child'))
        for end in (parent, child):
            if end not in self._links:
                raise DescriptionError(f'{self._source}: DetachableJoint: no link {end!r}')
        return Joint(f'{child} to {parent}', FIXED, parent, child, self.place(child).position)

    def constraint(self, element: ET.Element) -> Joint:
        """Return the ball joint of a constraint of Drake."""
        ends, points = [], []
        for body, point in (('body_A', 'p_AP'), ('body_B', 'p_BQ')):
            key = f'{_DRAKE}ball_constraint_'
            link = (element.findtext(f'{key}{body}') or '').strip()
            if link not in self._links:
                raise DescriptionError(f'{self._source}: drake:ball_constraint: no link {link!r}')
            at = numbers_of(element.findtext(f'{key}{point}'), 3, self._source, point)
            ends.append(link)
            points.append(self.place(link).point(at))
        return Joint(f'{ends[0]} to {ends[1]}', BALL, ends[0], ends[1], points[0],
                     child_anchor=points[1])

    def _axis(self, joint: ET.Element, axis: ET.Element) -> Array:
        name, xyz = joint.get('name', ''), axis.find('xyz')
        along = numbers_of('0 0 1' if xyz is None else xyz.text, 3, self._source,
                           f'axis of joint {name!r}')
        frame = name
        if self._version < _JOINT_AXES or axis.findtext(
                'use_parent_model_frame', '').strip() in ('1', 'true'):
            frame = _MODEL
        elif xyz is not None:
            frame = xyz.get('expressed_in') or name
        return self.place(frame).rotation @ unit(along, self._source, f'axis of joint {name!r}')

    def _own(self, element: ET.Element) -> Placement:
        pose = element.find('pose')
        what = f'pose of {element.tag} {element.get("name", "")!r}'
        if pose is None or not (pose.text or '').strip():
            return HERE
        angles = np.pi / 180.0 if pose.get('degrees') in ('1', 'true') else 1.0
        values = numbers_of(pose.text, 6, self._source, what)
        return Placement(from_euler(angles * values[3:]), values[:3])

    def _text(self, element: ET.Element, tag: str) -> str:
        text = (element.findtext(tag) or '').strip()
        if not text:
            raise DescriptionError(
                f'{self._source}: joint {element.get("name", "")!r}: no {tag}')
        return text
