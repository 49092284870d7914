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
from stewart_dynamics.description.mechanism import CarriedParameter, OF_SLIDE
from stewart_dynamics.mechanics.limits import LENGTH_MAX, LENGTH_MIN
from stewart_dynamics.parameters.circles import CIRCLE_NAMES
from stewart_dynamics.parameters.table import INERTIA, Parameters

CARRIED = 'stewart_dynamics'
"""Name of the block, or prefix of the elements, of parameters without an own element."""
ELEMENT = f'{CARRIED}.element'  # prefix in MJCF, which has texts with names alone
_GROUPS = ('actuator.', 'drive.', 'geometry.', 'legs.', 'limits.')
# Parameters of these groups that formats have elements for.
_IN_ELEMENTS = frozenset((
    *OF_SLIDE, *(f'legs.{part}.{each}' for part in ('cylinder', 'piston')
                 for each in ('mass', 'center_of_mass', 'inertia')),
    *CIRCLE_NAMES, 'geometry.base_joints', 'geometry.platform_joints', 'geometry.zero_length',
    'actuator.reflected_mass', 'actuator.viscous_friction', 'actuator.coulomb_friction'))
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
    for name, element in elements.items():
        yield name, CarriedParameter(_text(parameters[name]), _text(element))
    for name in (*without, *(name for name in parameters.given
                             if name.startswith(_GROUPS) and name not in _IN_ELEMENTS)):
        yield name, CarriedParameter(_text(parameters[name]))


def base_element(hexapod: Hexapod) -> dict[str, Any]:
    """Return the name of the base where its own is taken by the world of a format."""
    return {} if hexapod.base_body == hexapod.base else {'base_frame': hexapod.base_body}


def solid_elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the masses and inertias that ``Hexapod.solid`` has for legs with zeros (6,)."""
    found = {}
    for part in ('cylinder', 'piston'):
        bodies = [hexapod.solid(getattr(leg, part), leg) for leg in hexapod.legs]
        found[f'legs.{part}.mass'] = [body.mass for body in bodies]
        found[f'legs.{part}.inertia'] = [body.inertia[0, 0] for body in bodies]
    return {name: values for name, values in found.items()
            if not hexapod.parameters[name].all()}


def length_elements(hexapod: Hexapod) -> dict[str, Any]:
    """Return the bounds of joints that stand for limits of length that are not set (6,) [m]."""
    bounds = np.array([leg.limits.lengths(leg.home_length) for leg in hexapod.legs])
    bounds -= hexapod.parameters.geometry.zero_length[:, None]
    return {name: bounds[:, side] for side, name in enumerate((LENGTH_MIN, LENGTH_MAX))
            if hexapod.parameters[name] is None}


def _text(value: Any) -> str:
    if value is None:
        return NOT_SET
    return value if isinstance(value, str) else numbers(value)
