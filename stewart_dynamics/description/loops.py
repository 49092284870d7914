# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The loop closures of a URDF, which it cannot have itself, in a YAML file beside it.

The keys are those of Gepetto's example-parallel-robots: pairs of frames that coincide, and the
type of each, ``3d`` for a ball joint or ``6d`` for a fixed one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from stewart_dynamics import __version__
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.errors import ParameterError, shown
from stewart_dynamics.legs.mechanism import BALL, DescriptionError, FIXED
from stewart_dynamics.parameters.yaml_file import read_document

_HEAD = """\
# Loops of {name}.urdf, written by stewart_describe {version}: in each pair of frames both origins
# are one point (3d), a ball joint. The keys are those of Gepetto's example-parallel-robots.
"""
_OF_GEPETTO = 'robot.yaml'
_KINDS = {'3d': BALL, '6d': FIXED}


class Loop(NamedTuple):
    """A pair of frames that coincide where the loops are closed."""

    first: str
    second: str
    kind: str


def loops_name(name: str) -> str:
    """Return the name of the file of loops of a URDF of this name."""
    return f'{name}_loops.yaml'


def loops_yaml(hexapod: Hexapod, name: str) -> str:
    """Return the text of the file for a URDF of this name."""
    pairs = ''.join(f'- [{leg.ball}, {leg.end_frame}]\n' for leg in hexapod.legs)
    motors = ', '.join(leg.name for leg in hexapod.legs)
    return (_HEAD.format(name=name, version=__version__) + f'closed_loop:\n{pairs}'
            f'type: [{", ".join(["3d"] * len(hexapod.legs))}]\nname_mot: [{motors}]\n')


def loops_beside(urdf: Path, frames: Collection[str]) -> Iterator[Loop]:
    """
    Yield the loops of a URDF from NAME_loops.yaml, or robot.yaml, in its folder; none without one.

    frames: the names of the URDF's frames.
    Raises DescriptionError: the file is not one of loops, or it names another frame.
    """
    for path in (urdf.with_name(loops_name(urdf.stem)), urdf.with_name(_OF_GEPETTO)):
        if path.is_file():
            break
    else:
        return
    try:
        document = read_document(path)
    except ParameterError as exc:
        raise DescriptionError(str(exc)) from exc
    pairs, kinds = document.get('closed_loop'), document.get('type')
    if not isinstance(pairs, list) or not isinstance(kinds, list) or len(pairs) != len(kinds):
        raise DescriptionError(f'{path}: closed_loop, type: must be two lists of one length')
    for pair, kind in zip(pairs, kinds, strict=True):
        if not isinstance(pair, list) or len(pair) != 2 or str(kind).lower() not in _KINDS:
            raise DescriptionError(f'{path}: {shown(pair)} of type {shown(kind)}: must be two '
                                   'frames, 3d or 6d')
        for name in pair:
            if name not in frames:
                raise DescriptionError(
                    f'{path}: closed_loop: {shown(name)}: no link or joint of {urdf.name}')
        yield Loop(pair[0], pair[1], _KINDS[str(kind).lower()])
