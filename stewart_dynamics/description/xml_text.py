# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""XML as the writers need it: numbers that read back equal, elements, indented text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.description.hexapod import Hexapod, RigidBody
from stewart_dynamics.legs.mechanism import CarriedParameter
from stewart_dynamics.parameters.circles import CIRCLE_NAMES
from stewart_dynamics.parameters.table import INERTIA, Parameters

CARRIED = 'stewart_dynamics'
"""Name of the block, or prefix of the elements, of parameters without an own element."""
ELEMENT = f'{CARRIED}.element'  # prefix in MJCF, which has texts with names alone
# Parameters of all kinds that formats have elements for.
_IN_ELEMENTS = frozenset((*CIRCLE_NAMES, 'geometry.base_joints', 'geometry.platform_joints'))
_GROUPS = ('actuator.', 'drive.', 'geometry.', 'legs.', 'limits.')
NOT_SET = 'none'  # value there of a limit that is not set, or of an element that is missing


def numbers(*values: Any) -> str:
    """Return numbers and arrays as text that reads back equal."""
    return ' '.join(repr(float(each) + 0.0) for value in values for each in np.ravel(value))


def inertia_texts(body: RigidBody) -> dict[str, str]:
    """Return the inertia of a body as text by its names."""
    values = body.inertia[np.triu_indices(3)]
    return {name: numbers(value) for name, value in zip(INERTIA, values, strict=True)}


def add(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    """Add an element; a trailing underscore of an attribute's name is dropped."""
    child = ET.SubElement(parent, tag, {
        name.rstrip('_'): value for name, value in attributes.items()})
    child.text = text
    return child


def text_of(root: ET.Element, comment: str) -> str:
    """Return a document with a comment before its root."""
    ET.indent(root, '  ')
    about = f'Written by stewart_describe {__version__}. {comment}'.replace('--', '- -')
    return (f'<?xml version="1.0"?>\n<!-- {about} -->\n'
            f'{ET.tostring(root, encoding="unicode")}\n')


def carried(parameters: Parameters, elements: Mapping[str, Any], without: Iterable[str] = (),
            ) -> Iterator[tuple[str, CarriedParameter]]:
    """
    Yield the parameters that a reader of a format's elements alone would not find.

    elements: those whose elements have another value, with that value; None: no element.
    without: names of parameters that the format has no elements for. The given ones that no format
    has elements for are added to them.
    """
    kind = parameters.leg_kind
    in_elements = {*_IN_ELEMENTS, *kind.elements, *kind.shortened, kind.zero, *kind.drive_limits}
    for name, element in elements.items():
        yield name, CarriedParameter(_text(kind.expanded(parameters, name)), _text(element))
    for name in (*without, *(name for name in parameters.given
                             if name.startswith(_GROUPS) and name not in in_elements)):
        yield name, CarriedParameter(_text(kind.expanded(parameters, name)))


def base_element(hexapod: Hexapod) -> dict[str, Any]:
    """Return the name of the base where its own is taken by the world of a format."""
    return {} if hexapod.base_body == hexapod.base else {'base_frame': hexapod.base_body}


def solid_elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the masses and inertias that ``Hexapod.solid`` has for legs with zeros."""
    found: dict[str, Any] = {}
    for n, part in enumerate(hexapod.kind.parts):
        links = [[*leg.links][n] for leg in hexapod.legs]
        bodies = [hexapod.solid(*each) for each in links]
        found[f'legs.{part}.mass'] = [body.mass for body in bodies]
        found[f'legs.{part}.inertia'] = [
            body.inertia[0, 0] if link.slender else body.inertia[np.triu_indices(3)]
            for (link, _), body in zip(links, bodies, strict=True)]
    return {name: values for name, values in found.items()
            if not np.array_equal(values, hexapod.kind.expanded(hexapod.parameters, name))}


def center_elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the centers of mass of legs of which some have no mass, and so no center."""
    found: dict[str, Any] = {}
    for part in hexapod.kind.parts:
        name, mass = f'legs.{part}.center_of_mass', hexapod.parameters[f'legs.{part}.mass']
        centers = hexapod.kind.expanded(hexapod.parameters, name)
        if not mass.all():
            found[name] = np.where((mass > 0.0).reshape(6, *[1] * (centers.ndim - 1)), centers,
                                   0.0)
    return found


def position_elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the bounds of joints that stand for limits of the drives that are not set (6,)."""
    bounds = np.array([leg.bounds() for leg in hexapod.legs])
    bounds -= np.array([leg.branch.zero for leg in hexapod.legs])[:, None]
    return {name: bounds[:, side] for side, name in enumerate(hexapod.kind.position_limits)
            if hexapod.parameters[name] is None}


def _text(value: Any) -> str:
    if value is None:
        return NOT_SET
    if isinstance(value, tuple) and isinstance(value[0], str):
        return ' '.join(value)
    return value if isinstance(value, str) else numbers(value)
