# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The loop closures of a URDF, which it cannot have itself, as a ``robot.yaml`` beside it."""

from __future__ import annotations

from stewart_dynamics import __version__
from stewart_dynamics.description.hexapod import Hexapod

_HEAD = """\
# Loops of {name}.urdf, written by stewart_describe {version}: in each pair of frames both origins
# are one point (3d), a ball joint. The keys are those of Gepetto's example-parallel-robots.
"""


def loops_yaml(hexapod: Hexapod, name: str) -> str:
    """Return the text of the file for a URDF of this name."""
    pairs = ''.join(f'- [{leg.ball}, {leg.piston.name}]\n' for leg in hexapod.legs)
    motors = ', '.join(leg.name for leg in hexapod.legs)
    return (_HEAD.format(name=name, version=__version__) + f'closed_loop:\n{pairs}'
            f'type: [{", ".join(["3d"] * len(hexapod.legs))}]\nname_mot: [{motors}]\n')
