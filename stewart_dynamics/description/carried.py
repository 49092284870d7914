# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Parameters that the elements of a format do not hold, or hold with other values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from stewart_dynamics.description.hexapod import Hexapod, TreeBody
from stewart_dynamics.description.xml_text import numbers
from stewart_dynamics.legs.mechanism import CarriedParameter, HINGE, SLIDE
from stewart_dynamics.parameters.circles import CIRCLE_NAMES

CARRIED = 'stewart_dynamics'
"""Name of the block, or prefix of the elements, of parameters without an own element."""
ELEMENT = f'{CARRIED}.element'  # prefix in MJCF, which has texts with names alone
# Parameters of all kinds that formats have elements for.
_IN_ELEMENTS = frozenset((*CIRCLE_NAMES, 'geometry.base_joints', 'geometry.platform_joints'))
_GROUPS = ('actuator.', 'drive.', 'geometry.', 'legs.', 'limits.')
NOT_SET = 'none'  # value there of a limit that is not set, or of an element that is missing


def carried(hexapod: Hexapod, tree: Sequence[TreeBody], elements: Mapping[str, Any],
            without: Collection[str] = ()) -> Iterator[tuple[str, CarriedParameter]]:
    """
    Yield the parameters that a reader of a format's elements alone would not find.

    tree: as the format has it. elements: values of other elements that are not the parameter's.
    without: names of parameters that the format has no elements for; empty names, of parameters
    that a kind of legs lacks, are ignored. The given ones that no format has elements for are
    added to them.
    """
    p, kind = hexapod.parameters, hexapod.kind
    without = [name for name in without if name]
    in_elements = {*_IN_ELEMENTS, *kind.elements, *kind.shortened, kind.zero, *kind.drive_limits}
    changed = {name: value for name, value in tree_values(hexapod, tree) if name not in without
               and (p[name] is None if name in kind.drive_limits
                    else not np.array_equal(value, kind.expanded(p, name)))}
    for name, element in (changed | dict(elements)).items():
        yield name, CarriedParameter(_text(kind.expanded(p, name)), _text(element))
    for name in (*without, *(name for name in p.given
                             if name.startswith(_GROUPS) and name not in in_elements)):
        yield name, CarriedParameter(_text(kind.expanded(p, name)))


def tree_values(hexapod: Hexapod, tree: Sequence[TreeBody]) -> Iterator[tuple[str, Any]]:
    """Yield the parameters that a tree may have with other values, and its values."""
    p, kind = hexapod.parameters, hexapod.kind
    yield 'base_frame', tree[0].body.name
    for n, part in enumerate(kind.parts):
        name, bodies = f'legs.{part}', [each.body for each in tree[1:-1][n::2]]
        masses = np.array([body.mass for body in bodies])
        yield f'{name}.mass', masses
        # The center of a body without mass is not read.
        centers = kind.expanded(p, f'{name}.center_of_mass')
        yield f'{name}.center_of_mass', np.where(
            masses.reshape(6, *[1] * (centers.ndim - 1)) > 0.0, centers, 0.0)
        slender = hexapod.legs[0].branch.links[n].slender
        yield f'{name}.inertia', [body.inertia[0, 0] if slender else
                                  body.inertia[np.triu_indices(3)] for body in bodies]
    drives = [each.joint for each in tree if each.joint.kind in (HINGE, SLIDE)]
    for name, field in kind.drive_limits.items():
        limits = [getattr(drive, field) for drive in drives]
        yield name, None if None in limits else limits


def _text(value: Any) -> str:
    if value is None:
        return NOT_SET
    if isinstance(value, tuple) and isinstance(value[0], str):
        return ' '.join(value)
    return value if isinstance(value, str) else numbers(value)
