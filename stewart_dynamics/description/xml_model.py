# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Frames, links and joints in XML, by the rules that URDF and SDFormat have in common.

Each frame is relative to another. A value is an attribute in URDF and an element in SDFormat; the
limits and dynamics of a joint are elements of the joint, or of its axes.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, TypeVar
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.legs.mechanism import (
    BALL, CarriedParameter, DescriptionError, FIXED, HERE, HINGE, Joint, MechanismBody, OTHER,
    Placement, SLIDE, UNIVERSAL)
from stewart_dynamics.mechanics.frames.rotation import from_euler, from_quaternion
from stewart_dynamics.parameters.table import INERTIA, inertia_matrix

_KINDS = {'fixed': FIXED, 'revolute': HINGE, 'continuous': HINGE, 'prismatic': SLIDE,
          'universal': UNIVERSAL, 'revolute2': UNIVERSAL, 'ball': BALL, 'spherical': BALL}
_LIMITS = {'lower': 'lower', 'upper': 'upper', 'velocity': 'velocity_max', 'effort': 'force_max'}
# Unlimited: SDFormat's default is 1e16 or, from version 1.10 on, inf.
_UNLIMITED, _INFINITE = 1e15, ('inf', '+inf', '-inf')
_QUATERNION = 'quat_xyzw'  # in URDF since 1.1, in SDFormat since 1.9
_Default = TypeVar('_Default', bound=float | None)


class Defaults(NamedTuple):
    """Values of missing elements."""

    axis: str  # of a joint, in its frame
    xyz: str | None  # of an element axis
    mass: float | None  # of a link [kg]
    moment: float  # of a link about each axis [kg m^2]
    least: float  # smaller limits of rates and forces are unlimited


class XmlModel:
    """
    The frames of a model.

    source: in errors. links: names that joints may have. defaults: those of the format.
    placements: frames that are relative to no other, by their names.
    """

    def __init__(self, source: Path, links: Iterable[str], defaults: Defaults,
                 placements: dict[str, Placement]) -> None:
        self.source, self._defaults = source, defaults
        self._placements = placements
        self._links = {link: link for link in links}  # and of frames, once they are looked up
        self._attached: dict[str, str] = {}  # frames, and what each is attached to
        self._frames: dict[str, tuple[str, Placement]] = {}

    def error(self, why: str) -> DescriptionError:
        """Return the error about the file."""
        return DescriptionError(f'{self.source}: {why}')

    def add_frame(self, name: str, relative_to: str, pose: Placement) -> None:
        """Add a frame that has a pose in another, which may be added later."""
        self._frames[name] = relative_to, pose

    def place(self, name: str) -> Placement:
        """Return where a frame is."""
        waiting: dict[str, None] = {}  # frames, each relative to the next
        while name not in self._placements:
            if name not in self._frames:
                raise self.error(f'no frame {name!r}')
            if name in waiting:
                raise self.error(f'frame {name!r} is relative to itself')
            waiting[name] = None
            name = self._frames[name][0]
        at = self._placements[name]
        for name in reversed(waiting):
            at = self._placements[name] = at.of(self._frames[name][1])
        return at

    def numbers(self, text: str | None, count: int, what: str) -> Array:
        """Parse ``count`` finite numbers; return zeros if the text is missing."""
        if text is None:
            return np.zeros(count)
        try:
            values = np.array([float(each) for each in text.split()])
        except ValueError as exc:
            raise self.error(f'{what}: {text!r}: must be numbers') from exc
        if len(values) != count or not np.isfinite(values).all():
            raise self.error(f'{what}: {text!r}: must be {count} finite numbers')
        return values

    def number(self, element: ET.Element, name: str, default: _Default, *path: str,
               ) -> float | _Default:
        """Return the number at a path below an element; ``name`` is that of its link or joint."""
        text = _text(element, *path)
        return default if text is None else float(
            self.numbers(text, 1, f'{name}: {"/".join(path)}')[0])

    def unit(self, text: str | None, what: str) -> Array:
        """Parse an axis (3,), as a vector of length 1."""
        axis = self.numbers(text, 3, what)
        length = float(np.linalg.norm(axis))
        if length == 0.0:
            raise self.error(f'{what}: the axis is zero')
        return axis / length

    def pose(self, element: ET.Element, origin: str = 'origin') -> Placement:
        """Return the pose in an element: the attributes of its origin, or the text of its pose."""
        given = element.find(origin)
        what = f'{element.tag} {element.get("name", "")!r}'
        if given is not None:
            what, turn = f'{origin} of {what}', given.get(_QUATERNION)
            if turn is not None and given.get('rpy') is not None:
                raise self.error(f'{what}: must have rpy or {_QUATERNION}, not both')
            return self._placement(self.numbers(given.get('xyz'), 3, what), self.numbers(
                given.get('rpy') if turn is None else turn, 3 if turn is None else 4, what), what)
        given = element.find('pose')
        if given is None or not (given.text or '').strip():
            return HERE
        what, quaternion = f'pose of {what}', given.get('rotation_format') == _QUATERNION
        values = self.numbers(given.text, 7 if quaternion else 6, what)
        in_degrees = not quaternion and switch(given.get('degrees')) is True
        return self._placement(
            values[:3], values[3:] * (np.pi / 180.0 if in_degrees else 1.0), what)

    def _placement(self, at: Array, turn: Array, what: str) -> Placement:
        """Return a placement turned by three angles [rad], or by a quaternion x y z w."""
        if len(turn) == 3:
            return Placement(from_euler(turn), at)
        largest = float(np.abs(turn).max())
        if largest == 0.0:
            raise self.error(f'{what}: the quaternion is zero')
        turn = turn / largest  # squares of its numbers are then in range
        return Placement(np.reshape(
            from_quaternion(*turn / np.linalg.norm(turn)), (3, 3)), at)

    def link(self, name: str, what: str) -> str:
        """
        Return the name of a link, given by its name or that of a frame that is attached to it.

        what: begins the error that the model has no such link.
        """
        waiting: dict[str, None] = {}  # frames, each attached to the next
        end = name
        while end not in self._links:
            if end in waiting or end not in self._attached:
                nested = ' here: nested and included models are not read' if '::' in name else ''
                raise self.error(f'{what}: no link {name!r}{nested}')
            waiting[end] = None
            end = self._attached[end]
        self._links |= dict.fromkeys(waiting, self._links[end])
        return self._links[end]

    def end(self, joint: ET.Element, side: str) -> str:
        """Return the name of the link, or frame, at a side of a joint, parent or child."""
        end, what = joint.find(side), f'{joint.tag} {joint.get("name", "")!r}'
        name = None if end is None else end.get('link') or (end.text or '').strip()
        if not name:
            raise self.error(f'{what}: no {side}')
        self.link(name, what)
        return name

    def body(self, link: ET.Element) -> MechanismBody:
        """Return a link as a body."""
        name, inertial = link.get('name', ''), link.find('inertial')
        mass, moment = self._defaults.mass, self._defaults.moment
        made = MechanismBody(name, self.place(name), mass, inertia=moment * np.eye(3),
                             shapes=len(link.findall('visual')) + len(link.findall('collision')))
        if inertial is not None:
            own, made.mass = self.pose(inertial), self.number(inertial, name, mass, 'mass')
            tensor = inertia_matrix(np.array([self.number(
                inertial, name, moment if key[1] == key[2] else 0.0, 'inertia', key)
                for key in INERTIA]))
            turned = not np.array_equal(own.rotation, np.eye(3))
            made.center = own.position
            made.inertia = own.rotation @ tensor @ own.rotation.T if turned else tensor
        elif mass is not None:
            made.note = f'{name}: no mass: {mass:g} kg, as SDFormat has it'
        return made

    def joint(self, joint: ET.Element, at: Placement, position: float = 0.0,
              defaults: Defaults | None = None) -> Joint:
        """
        Return a joint.

        at: where its frame is. position: of the joint there; its limits are counted from it.
        defaults: those of its elements, where they are not those of the model.
        """
        defaults = defaults or self._defaults
        name, kind = joint.get('name', ''), kind_of(joint)
        parent, child = (self.link(self.end(joint, side), name) for side in ('parent', 'child'))
        made = Joint(name, kind, parent, child, at.position, position=position)
        axes = [each for each in (joint.find('axis'), joint.find('axis2')) if each is not None]
        if kind in (HINGE, SLIDE, UNIVERSAL):
            made.axes = [self.axis_frame(axis, at).rotation @ self.unit(
                defaults.axis if axis is joint else _text(axis, 'xyz') or defaults.xyz,
                f'axis of joint {name!r}')
                for axis in axes or [joint] * (kind != UNIVERSAL)]
        for holder in (joint, *axes):
            self._add_dynamics(holder, made)
            self._add_limits(holder, made, defaults.least)
        return made

    def axis_frame(self, axis: ET.Element, at: Placement) -> Placement:
        """Return the frame of an axis of a joint; ``at`` is the frame of the joint."""
        return at

    def _add_dynamics(self, holder: ET.Element, made: Joint) -> None:
        """Add forces on a joint; one with two axes has the larger friction."""
        damping, friction, stiffness, reference = (
            self.number(holder, made.name, 0.0, 'dynamics', key)
            for key in ('damping', 'friction', 'spring_stiffness', 'spring_reference'))
        made.damping = max(made.damping, damping, key=abs)
        made.friction = max(made.friction, friction, key=abs)
        if stiffness:
            made.spring(stiffness, reference)

    def _add_limits(self, holder: ET.Element, made: Joint, least: float) -> None:
        for key, field in _LIMITS.items() if made.kind in (HINGE, SLIDE) else ():
            text = _text(holder, 'limit', key)
            if text is None or text.strip().lower() in _INFINITE:
                continue
            value = float(self.numbers(text, 1, f'{made.name}: limit/{key}')[0])
            of_position = not field.endswith('_max')
            if abs(value) < _UNLIMITED and (of_position or value >= least):
                setattr(made, field, value + (made.position if of_position else 0.0))
        limit, mimic = holder.find('limit'), holder.find('mimic')
        if limit is not None:
            made.left_out += [f'{key} {value} of its limit' for key, value in limit.attrib.items()
                              if key not in _LIMITS]
        if holder.find('safety_controller') is not None:
            made.left_out.append('safety_controller')
        if mimic is not None:
            made.left_out.append(f'mimic of {mimic.get("joint", "")!r}')

    def loop(self, name: str, first: tuple[str, Array], second: tuple[str, Array],
             kind: str = BALL) -> Joint:
        """Return the joint that closes a loop between points of two links."""
        (parent, at_parent), (child, at_child) = first, second
        return Joint(name, kind, parent, child, self.place(parent).point(at_parent),
                     child_anchor=self.place(child).point(at_child))


def kind_of(joint: ET.Element) -> str:
    """Return the kind of a joint."""
    return _KINDS.get(joint.get('type', ''), OTHER)


def switch(text: str | None) -> bool | None:
    """Return whether a value is true or false, in any case as libsdformat reads it."""
    return {'1': True, 'true': True, '0': False, 'false': False}.get((text or '').strip().lower())


def carried_of(elements: Iterable[ET.Element]) -> dict[str, CarriedParameter]:
    """Return the parameters that stewart_describe has added."""
    return {each.get('name', ''): CarriedParameter(each.get('value', ''), each.get('element', ''))
            for each in elements}


def _text(element: ET.Element, *path: str) -> str | None:
    """Return an attribute, or the text of an element; None where it is missing or empty."""
    holder = element.find('/'.join(path[:-1])) if path[1:] else element
    if holder is None or path[-1] in holder.attrib:
        return None if holder is None else holder.get(path[-1])
    child = holder.find(path[-1])
    if child is None:
        return None
    return child.get('value', (child.text or '').strip() or None)
