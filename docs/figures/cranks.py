# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/figures/cranks.svg: the hexapod of config/crank_platform.yaml, and the signs of a crank.

``make docs`` runs it. The hexapod is drawn as on a datasheet.
"""

from __future__ import annotations

from pathlib import Path

from moving import STYLE
import numpy as np
from stewart_dynamics import StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.datasheet.hexapod_drawing import Drawing, OBLIQUE
from stewart_dynamics.reporting.vector_picture import Chart, Picture

FILE = Path(__file__).with_name('cranks.svg')
SIZE = 860, 400  # width, height [px]
FRAME = 470.0, 20.0, 340.0, 360.0  # of the signs: left, top, width, height [px]
SCALE = 340.0 / 3.2  # of the signs [px]
OF_STYLE = STYLE + """\
.halo { paint-order: stroke; stroke: var(--paper); stroke-width: 3px; }
.number { font-size: 12.5px; font-weight: 700; fill: var(--leg); }
.turn { stroke: var(--leg); stroke-width: 1.6; } .turn.tip { fill: var(--leg); stroke: none; }
.crank { stroke: var(--leg0); stroke-width: 6; } .rod { stroke: var(--leg1); stroke-width: 3; }
.thin { stroke: var(--soft); stroke-dasharray: 2 3; }
.zero-angle { stroke: var(--faint); stroke-dasharray: 6 4; }
.arrow { stroke: var(--soft); fill: var(--soft); }
.force { stroke: var(--ink); stroke-width: 2; fill: var(--ink); }
.angle { stroke: var(--bad); fill: none; stroke-width: 1.4; }
.angle.tip, text.angle { fill: var(--bad); stroke: none; }
.axis-of-motor { stroke: var(--ink); fill: none; } .point { fill: var(--ink); }
"""


class Signs:
    """One crank in the plane of its end, the axis of its motor toward the reader."""

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        _, _, width, height = FRAME
        self._at = Chart(picture, FRAME, (-0.7, -0.7 + width / SCALE),
                         (-0.6, -0.6 + height / SCALE)).at

    def draw(self) -> None:
        """Draw crank, rod, lever, directions and their names."""
        p, at, center = self._picture, self._at, np.zeros(2)
        turn = np.linspace(0.0, np.deg2rad(35.0), 40)
        around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        end, joint = around[-1], np.array([1.35, 2.6])
        normal, rod = np.array([-end[1], end[0]]), joint - end
        along = rod / np.linalg.norm(rod)
        foot = end - along * (end @ along)
        for css, begin, tip in (('zero-angle', center, [1.75, 0.0]), ('crank', center, end),
                                ('rod', end, joint), ('thin', center, foot), ('thin', end, foot)):
            p.line(at(begin), at(tip), css=css)
        p.path(at(0.55 * around[:-5]), css='angle')
        self._tip(0.55 * around[-5], 0.55 * end, 'angle tip')
        for css, begin, tip in (('arrow', end, end + 0.75 * normal), ('arrow', end, 1.55 * end),
                                ('force', end + 0.45 * rod, end + 0.62 * rod)):
            p.line(at(begin), at(tip), css=css)
            self._tip(begin, tip, css)
        p.circle(at(center), 10.0, css='axis-of-motor')
        for point in (center, end, joint):
            p.circle(at(point), 3.0, css='point')
        for where, text in (
                ([-0.62, -0.42], 'c, axis u toward you'), ([1.38, -0.2], 'z: q = 0'),
                (end + [0.10, -0.17], 'A'), (joint + [0.1, 0.0], 'B, platform joint'),
                (1.63 * end, 'e'), (end + 0.86 * normal, 'n'), (0.5 * end + [-0.16, 0.13], 'L₁'),
                (end + 0.3 * rod + [0.1, 0.0], 'L₂'), (end + 0.56 * rod + [-0.2, 0.06], 'd'),
                (foot + [0.06, -0.14], 'lever k'),
                ([-0.7, 2.6], 'k = L₁ d · n > 0: branch positive,'),
                ([-0.7, 2.45], 'a positive torque pushes B away')):
            p.text(at(where), text)
        p.text(at([0.62, 0.16]), 'q > 0', css='angle')

    def _tip(self, begin: Array, end: Array, css: str) -> None:
        """Draw the tip of an arrow."""
        a, b = self._at([begin, end])
        along = (b - a) / np.linalg.norm(b - a)
        across = np.array([-along[1], along[0]])
        self._picture.path([b, b - 9.0 * along + 3.5 * across, b - 9.0 * along - 3.5 * across],
                           closed=True, css=css)


def draw() -> str:
    """Return the picture."""
    platform = StewartPlatform.from_yaml(FILE.parents[2] / 'config' / 'crank_platform.yaml')
    picture = Picture(*SIZE, 'A hexapod with cranks, and the signs of one of them')
    Signs(picture).draw()
    origin = np.array([46.0, 374.0])
    for name, tip in zip('xyz', 28.0 * OBLIQUE.of(np.eye(3)) * [1.0, -1.0], strict=True):
        picture.line(origin, origin + tip, css='arrow')
        picture.text(origin + 1.35 * tip + [0.0, 4.0], name, 'middle', css='tick')
    hexapod = Drawing(platform.parameters, platform.home_pose()).oblique().svg()
    return picture.document(
        OF_STYLE, f'<g transform="translate(0 10) scale(1.5)">{hexapod}</g>')


def main() -> None:
    """Draw the picture."""
    FILE.write_text(draw(), encoding='utf-8')
    print(FILE.relative_to(FILE.parents[2]))


if __name__ == '__main__':
    main()
