# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
URDF as a mechanism.

Elements ``constraint``, ``joint`` in a block ``gazebo``, the block of stewart_describe, a file
beside it (``loops``), or names of frames (onshape-to-robot) close its loops.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
import re
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.description.loops import loops_beside
from stewart_dynamics.description.xml_text import CARRIED
from stewart_dynamics.legs.mechanism import (
    BALL, CarriedParameter, DescriptionError, FIXED, HERE, HINGE, Joint, Mechanism, MechanismBody,
    OTHER, Placement, SLIDE, UNIVERSAL)
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.parameters.table import INERTIA, inertia_matrix

_CLOSING = re.compile('(closing_.+_)1')
_LIMITS = 'lower', 'upper', 'velocity', 'effort'
_TRUE, _FALSE = ('1', 'true'), ('0', 'false')
_KINDS = {'fixed': FIXED, 'revolute': HINGE, 'continuous': HINGE, 'prismatic': SLIDE,
          'universal': UNIVERSAL, 'ball': BALL, 'spherical': BALL, 'revolute2': UNIVERSAL}


def read_urdf(root: ET.Element, source: Path) -> Mechanism:
    """Return the mechanism of a URDF; DescriptionError where it is not one."""
    links = {link.get('name', ''): link for link in root.findall('link')}
    found = [joint for joint in root.findall('joint') if joint.find('child') is not None]
    of_child = {end_of(joint, 'child', source): joint for joint in found}
    for child, joint in of_child.items():
        for end in (child, end_of(joint, 'parent', source)):
            if end not in links:
                raise DescriptionError(
                    f'{source}: joint {joint.get("name")!r}: no link {end!r}')
    placements: dict[str, Placement] = {}
    for name in links:
        _place(name, of_child, placements, source)
    mechanism = Mechanism(
        str(source), root.get('name', source.stem),
        {name: _part(name, link, placements[name], source) for name, link in links.items()},
        [_joint(joint, placements, source) for joint in found])
    closing = [_closing(joint, placements, source) for joint in root.findall('gazebo/joint')]
    closing += [_constraint(each, placements, source) for each in root.findall('constraint')]
    _add_of_gazebo(root, mechanism, source)
    _add_of_ros2_control(root, mechanism, source)
    block = root.find(CARRIED)
    if block is not None:
        mechanism.carried = {each.get('name', ''): carried_of(each)
                             for each in block.findall('parameter')}
        for loop in block.findall('loop'):
            tip, ball = loop.get('tip', ''), loop.get('platform', '')
            if not {tip, ball} <= set(links):
                raise DescriptionError(f'{source}: loop: no link {tip!r} or {ball!r}')
            closing.append(Joint(ball, BALL, tip, ball, placements[tip].position,
                                 child_anchor=placements[ball].position))
    if not closing:
        closing = [*_beside(source, found, placements)]
    if not closing:
        closing = [*_named(placements)]
        mechanism.remarks += [f'{joint.name}: frames with names of onshape-to-robot: taken as a '
                              'ball joint' for joint in closing]
    mechanism.joints += {joint.name: joint for joint in closing}.values()
    return mechanism


def _beside(source: Path, joints: Iterable[ET.Element], placements: dict[str, Placement],
            ) -> Iterator[Joint]:
    """Yield the joints that close the loops in a file beside the URDF, if it has one."""
    # A joint has a frame of its name at its child.
    frames = {joint.get('name', ''): end_of(joint, 'child', source) for joint in joints}
    frames |= {link: link for link in placements}
    for loop in loops_beside(source, frames):
        first, second = frames[loop.first], frames[loop.second]
        yield Joint(f'{loop.first} to {loop.second}', loop.kind, first, second,
                    placements[first].position, child_anchor=placements[second].position)


def _named(placements: Mapping[str, Placement]) -> Iterator[Joint]:
    """Yield the loops of onshape-to-robot: pairs of frames closing_NAME_1 and closing_NAME_2."""
    for first in placements:
        named = _CLOSING.fullmatch(first)
        second = f'{named[1]}2' if named else ''
        if second in placements:
            yield Joint(f'{first} to {second}', BALL, first, second, placements[first].position,
                        child_anchor=placements[second].position)


def _constraint(element: ET.Element, placements: dict[str, Placement], source: Path) -> Joint:
    """Return an element ``constraint`` of ros/urdfdom_headers, with a frame on each link."""
    name, ends, points, axes = element.get('name', ''), [], [], []
    for side in ('parent', 'child'):
        end, origin, axis = (end_of(element, side, source), element.find(f'{side}_origin'),
                             element.find(f'{side}_axis'))
        if end not in placements:
            raise DescriptionError(f'{source}: constraint {name!r}: no link {end!r}')
        what = f'{side}_origin of constraint {name!r}'
        at = HERE if origin is None else Placement(
            from_euler(numbers_of(origin.get('rpy'), 3, source, what)),
            numbers_of(origin.get('xyz'), 3, source, what))
        at = placements[end].of(at)
        ends.append(end)
        points.append(at.position)
        if axis is not None:
            axes.append(at.rotation @ unit(numbers_of(axis.get('xyz'), 3, source, what), source,
                                           f'{side}_axis of constraint {name!r}'))
    return Joint(name, _KINDS.get(element.get('type', ''), OTHER), ends[0], ends[1], points[0],
                 axes, points[1])


def carried_of(element: ET.Element) -> CarriedParameter:
    """Return a parameter of the block of stewart_describe."""
    return CarriedParameter(element.get('value', ''), element.get('element', ''))


def numbers_of(text: str | None, count: int, source: Path, what: str) -> Array:
    """Parse ``count`` finite numbers; return zeros if the text is missing."""
    if text is None:
        return np.zeros(count)
    try:
        values = np.array([float(each) for each in text.split()])
    except ValueError as exc:
        raise DescriptionError(f'{source}: {what}: {text!r}: must be numbers') from exc
    if len(values) != count or not np.isfinite(values).all():
        raise DescriptionError(f'{source}: {what}: {text!r}: must be {count} finite numbers')
    return values


def unit(axis: Array, source: Path, what: str) -> Array:
    """Return a vector of length 1."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise DescriptionError(f'{source}: {what}: the axis is zero')
    return axis / length


def _place(name: str, of_child: dict[str, ET.Element], placements: dict[str, Placement],
           source: Path) -> None:
    """Place a link and all links that carry it."""
    chain: dict[str, None] = {}
    while name not in placements and name in of_child:
        if name in chain:
            raise DescriptionError(f'{source}: link {name!r} carries itself')
        chain[name] = None
        name = end_of(of_child[name], 'parent', source)
    at = placements.setdefault(name, HERE)
    for each in reversed(chain):
        at = at.of(origin_of(of_child[each], source))
        placements[each] = at


def end_of(joint: ET.Element, side: str, source: Path) -> str:
    """Return the link at a side of a joint, parent or child."""
    end = joint.find(side)
    name = None if end is None else end.get('link') or (end.text or '').strip()
    if not name:
        raise DescriptionError(f'{source}: joint {joint.get("name")!r}: no {side}')
    return name


def origin_of(element: ET.Element, source: Path) -> Placement:
    """Return the placement of a joint in its parent, or of an element of a link in that link."""
    origin = element.find('origin')
    if origin is None:
        return HERE
    what = f'origin of {element.tag} {element.get("name", "")!r}'
    return Placement(from_euler(numbers_of(origin.get('rpy'), 3, source, what)),
                     numbers_of(origin.get('xyz'), 3, source, what))


def axis_of(joint: ET.Element, source: Path) -> Array:
    """Return the axis (3,) of a joint in its own frame, as it is written."""
    axis = joint.find('axis')
    return numbers_of('1 0 0' if axis is None else axis.get('xyz'), 3, source,
                      f'axis of joint {joint.get("name", "")!r}')


def _part(name: str, link: ET.Element, placement: Placement, source: Path) -> MechanismBody:
    inertial, shapes = link.find('inertial'), shapes_of(link)
    if inertial is None:
        return MechanismBody(name, placement, shapes=shapes)
    what = f'inertial of link {name!r}'
    origin = origin_of(inertial, source)
    given, of_mass = inertial.find('inertia'), inertial.find('mass')
    six = np.zeros(6) if given is None else numbers_of(
        ' '.join(given.get(key, '0') for key in INERTIA), 6, source, what)
    mass = None if of_mass is None else float(
        numbers_of(of_mass.get('value'), 1, source, what)[0])
    return body_of(name, placement, mass, six, origin, shapes)


def shapes_of(link: ET.Element) -> int:
    """Return the number of visual and collision elements of a link."""
    return len(link.findall('visual')) + len(link.findall('collision'))


def body_of(name: str, placement: Placement, mass: float | None, six: Array, own: Placement,
            shapes: int) -> MechanismBody:
    """Return a body from the inertia ixx ixy ixz iyy iyz izz in the frame of its inertial."""
    tensor, r = inertia_matrix(six), own.rotation
    if not np.array_equal(r, np.eye(3)):
        tensor = r @ tensor @ r.T
    return MechanismBody(name, placement, mass, own.position, tensor, shapes=shapes)


def _joint(joint: ET.Element, placements: dict[str, Placement], source: Path) -> Joint:
    name = joint.get('name', '')
    child = end_of(joint, 'child', source)
    kind = _KINDS.get(joint.get('type', ''), OTHER)
    at = placements[child]
    made = Joint(name, kind, end_of(joint, 'parent', source), child, at.position)
    if kind in (HINGE, SLIDE):
        along = axis_of(joint, source)
        made.axes = [at.rotation @ unit(along, source, f'axis of joint {name!r}')]
    limit, dynamics = joint.find('limit'), joint.find('dynamics')
    if limit is not None:
        made.lower, made.upper, made.velocity_max, made.force_max = (
            _optional(limit, key, source) for key in _LIMITS)
        made.left_out += [f'{key} {value} of its limit' for key, value in limit.attrib.items()
                          if key not in _LIMITS]
    if dynamics is not None:
        made.damping = _optional(dynamics, 'damping', source) or 0.0
        made.friction = _optional(dynamics, 'friction', source) or 0.0
        stiffness = _optional(dynamics, 'spring_stiffness', source)
        if stiffness:
            made.spring(stiffness, _optional(dynamics, 'spring_reference', source) or 0.0)
    if joint.find('safety_controller') is not None:
        made.left_out.append('safety_controller')
    mimic = joint.find('mimic')
    if mimic is not None:
        made.left_out.append(f'mimic of {mimic.get("joint", "")!r}')
    return made


def _add_of_gazebo(root: ET.Element, mechanism: Mechanism, source: Path) -> None:
    """Name what blocks ``gazebo`` of links and joints add to their forces."""
    joints = {joint.name: joint for joint in mechanism.joints}
    for block in root.findall('gazebo'):
        name = block.get('reference', '')
        stiffness, reference, decay = (
            float(numbers_of(block.findtext(key), 1, source, f'{name}: {key}')[0])
            for key in ('springStiffness', 'springReference', 'dampingFactor'))
        if name in joints and stiffness:
            joints[name].spring(stiffness, reference)
        if name in mechanism.parts:
            part = mechanism.parts[name]
            if (block.findtext('gravity', '').strip() in _FALSE
                    or block.findtext('turnGravityOff', '').strip() in _TRUE):
                part.weightless = 'gravity switched off'
            if decay:
                part.left_out.append(f'dampingFactor {decay:.4g}')


def _add_of_ros2_control(root: ET.Element, mechanism: Mechanism, source: Path) -> None:
    """Take smaller bounds of efforts and rates from blocks ``ros2_control``."""
    joints = {joint.name: joint for joint in mechanism.joints}
    for each in root.findall('ros2_control/joint'):
        joint = joints.get(each.get('name', ''))
        for interface in each.findall('command_interface'):
            field = {'effort': 'force_max', 'velocity': 'velocity_max'}.get(
                interface.get('name', ''))
            ends = {param.get('name'): param.text for param in interface.findall('param')}
            if joint is None or field is None or not ends.get('min') or not ends.get('max'):
                continue
            lower, upper = (float(numbers_of(
                ends[key], 1, source, f'{joint.name}: {key} of {interface.get("name")}')[0])
                for key in ('min', 'max'))
            joint.bound(field, f'{interface.get("name")} of ros2_control', lower, upper)


def _optional(element: ET.Element, key: str, source: Path) -> float | None:
    text = element.get(key)
    if text is None:
        return None
    return float(numbers_of(text, 1, source, f'{key} of {element.tag}')[0])


def _closing(joint: ET.Element, placements: dict[str, Placement], source: Path) -> Joint:
    """Return a joint in SDFormat within URDF: its pose is in the frame of its child."""
    name, parent, child = (joint.get('name', ''), end_of(joint, 'parent', source),
                           end_of(joint, 'child', source))
    for end in (parent, child):
        if end not in placements:
            raise DescriptionError(f'{source}: joint {name!r}: no link {end!r}')
    pose = numbers_of(joint.findtext('pose'), 6, source, f'pose of joint {name!r}')
    at = placements[child].of(Placement(from_euler(pose[3:]), pose[:3]))
    kind = _KINDS.get(joint.get('type', ''), OTHER)
    axes = [at.rotation @ numbers_of(each.findtext('xyz'), 3, source, f'axis of {name!r}')
            for each in (joint.find('axis'), joint.find('axis2')) if each is not None]
    if kind == HINGE and not axes:
        axes = [at.rotation[:, 2]]
    return Joint(name, kind, parent, child, at.position, axes)
