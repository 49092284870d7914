# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""XML as the writers need it: numbers that read back equal, elements, links and joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.arrays import Array
from stewart_dynamics.description.hexapod import Color
from stewart_dynamics.legs.mechanism import (
    BALL, FIXED, HINGE, MechanismBody, SLIDE, UNIVERSAL)
from stewart_dynamics.legs.tree import VisualShape
from stewart_dynamics.parameters.table import INERTIA

_KINDS = {FIXED: 'fixed', HINGE: 'revolute', SLIDE: 'prismatic', UNIVERSAL: 'universal',
          BALL: 'ball'}


def numbers(*values: Any) -> str:
    """Return numbers and arrays as text that reads back equal."""
    return ' '.join(repr(float(each) + 0.0) for value in values for each in np.ravel(value))


def add(parent: ET.Element, tag: str, text: Any = None, **attributes: Any) -> ET.Element:
    """
    Add an element with a text and attributes, which may be numbers; None: without it.

    A trailing underscore of an attribute's name is dropped.
    """
    child = ET.SubElement(parent, tag, {
        name.rstrip('_'): _text(value) for name, value in attributes.items() if value is not None})
    child.text = None if text is None else _text(text)
    return child


def _text(value: Any) -> str:
    return value if isinstance(value, str) else numbers(value)


def text_of(root: ET.Element, comment: str) -> str:
    """Return a document with a comment before its root."""
    ET.indent(root, '  ')
    about = f'Written by stewart_describe {__version__}. {comment}'.replace('--', '- -')
    return (f'<?xml version="1.0"?>\n<!-- {about} -->\n'
            f'{ET.tostring(root, encoding="unicode")}\n')


class XmlWriter(ABC):
    """
    Links, joints and shapes, by the rules that URDF and SDFormat have in common; see ``XmlModel``.

    names: whether shapes have names. file: the key of the file of a mesh.
    """

    names: bool
    file: str

    def __init__(self, colors: Mapping[str, Color]) -> None:
        self.colors = colors

    @abstractmethod
    def add_value(self, parent: ET.Element, tag: str, value: Any, key: str = 'value') -> None:
        """Add an element with one value: its text, or an attribute ``key``."""

    @abstractmethod
    def add_values(self, parent: ET.Element, tag: str, **values: Any) -> ET.Element:
        """Add an element with values, but those that are None: its elements, or attributes."""

    @abstractmethod
    def add_pose(self, parent: ET.Element, position: Array, rotation: Array | None = None) -> None:
        """Add position (3,) and rotation (3, 3) of an element, by default without a rotation."""

    @abstractmethod
    def add_material(self, visual: ET.Element, color: str) -> None:
        """Add one of ``Hexapod.colors``."""

    def add_inertial(self, link: ET.Element, body: MechanismBody) -> None:
        """Add mass, center of mass and inertia of a link."""
        inertial = add(link, 'inertial')
        self.add_pose(inertial, body.center)
        self.add_value(inertial, 'mass', body.mass)
        self.add_values(inertial, 'inertia', **dict(zip(
            INERTIA, body.inertia[np.triu_indices(3)], strict=True)))

    def add_shapes(self, link: ET.Element, looks: Sequence[VisualShape]) -> None:
        """Add the visual and the collision shapes of a link."""
        for kind, some in (
                ('visual', looks), ('collision', [each for each in looks if each.collides])):
            for n, shape in enumerate(some, 1):
                one = add(link, kind, name=f'{kind}_{n}' if self.names else None)
                self.add_pose(one, shape.position, shape.rotation)
                geometry = add(one, 'geometry')
                if shape.kind == 'mesh':
                    self.add_values(geometry, 'mesh', **{self.file: shape.file},
                                    scale=[shape.scale] * 3)
                else:
                    self.add_values(geometry, shape.kind, radius=shape.radius,
                                    length=shape.length or None)
                if kind == 'visual':
                    self.add_material(one, shape.color)

    def add_joint(self, root: ET.Element, name: str, kind: str, parent: str, child: str,
                  position: Array | None = None, rotation: Array | None = None) -> ET.Element:
        """Add a joint of a kind of ``mechanism``, with a pose if there is a position."""
        joint = add(root, 'joint', name=name, type=_KINDS[kind])
        if position is not None:
            self.add_pose(joint, position, rotation)
        for side, link in (('parent', parent), ('child', child)):
            self.add_value(joint, side, link, 'link')
        return joint
