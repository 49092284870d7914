# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""XML as the writers need it: numbers that read back equal, elements, indented text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from stewart_dynamics import __version__
from stewart_dynamics.description.hexapod import RigidBody
from stewart_dynamics.description.mechanism import OF_SLIDE
from stewart_dynamics.parameters.circles import CIRCLE_NAMES
from stewart_dynamics.parameters.table import INERTIA, Parameters

CARRIED = 'stewart_dynamics'
"""Name of the block, or prefix of the elements, of parameters without an own element."""
LEG_BODIES = ('legs.cylinder.mass', 'legs.cylinder.inertia', 'legs.piston.mass',
              'legs.piston.inertia')
_GROUPS = ('actuator.', 'drive.', 'geometry.', 'legs.', 'limits.')
# Parameters of these groups that formats have elements for.
_IN_ELEMENTS = frozenset((
    *OF_SLIDE, *LEG_BODIES, 'legs.cylinder.center_of_mass', 'legs.piston.center_of_mass',
    *CIRCLE_NAMES, 'geometry.base_joints', 'geometry.platform_joints', 'geometry.zero_length',
    'actuator.reflected_mass', 'actuator.viscous_friction', 'actuator.coulomb_friction'))
NOT_CHECKED = 'none'  # value there of a limit that is not checked


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


def carried(parameters: Parameters, names: Iterable[str]) -> Mapping[str, str]:
    """
    Return parameters as text, for a block of parameters that a format has no elements for.

    These are the given ones that no format has elements for, those named, and limits that are not
    set.
    """
    names = [*names, *(name for name in OF_SLIDE if parameters[name] is None),
             *(name for name in parameters.given
               if name.startswith(_GROUPS) and name not in _IN_ELEMENTS)]
    return {name: _text(parameters[name]) for name in names}


def _text(value: Any) -> str:
    if value is None:
        return NOT_CHECKED
    return value if isinstance(value, str) else numbers(value)
