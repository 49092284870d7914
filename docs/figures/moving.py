# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/figures/moving.svg: the recorded motion through a singularity, and its leg forces.

``make docs`` runs it. The poses are those of bags/singular, the forces those of the node; the
hexapod is drawn as on a datasheet. An animation of CSS shows one frame after the other: browsers
and GitHub run it without a script. Where it does not run, the frame at the warning is shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from draw import Recorded, ROOT
import numpy as np
from stewart_dynamics import Pose
from stewart_dynamics.arrays import Array
from stewart_dynamics.datasheet.hexapod_drawing import Drawing
from stewart_dynamics.reporting.vector_picture import Chart, Picture

FILE = Path(__file__).with_name('moving.svg')
RATE = 12  # frames in a second
PAUSE = 1.5  # with the last frame [s]
SIZE = 780, 300  # width, height [px]
FRAME = 360.0, 34.0, 410.0, 226.0  # of the chart: left, top, width, height [px]
MOST = 3.0  # forces are shown up to this multiple of limits.force_max
STYLE = """\
text { font: 12px system-ui, sans-serif; fill: var(--ink); }
.tick, .axis { font-size: 11px; fill: var(--soft); }
.grid { stroke: var(--grid); } .zero { stroke: var(--zero); }
.limit { stroke: var(--soft); stroke-dasharray: 5 4; }
.singular { stroke: var(--singular); } text.singular { stroke: none; fill: var(--singular); }
.warned { fill: var(--warning); fill-opacity: 0.22; }
.curve { fill: none; stroke: var(--leg); stroke-width: 1.6; }
.now { stroke: var(--ink); } .dot { fill: var(--leg); stroke: var(--paper); }
.plate { stroke: var(--edge); stroke-width: 1.4; }
.base { fill: var(--base); } .moving { fill: var(--platform-wash); fill-opacity: 0.91; }
.cylinder { stroke: var(--leg); } .piston { stroke: var(--piston); }
.joint { fill: var(--paper); stroke: var(--edge); stroke-width: 1.2; }
"""


class Forces:
    """The chart of the demanded forces over time."""

    def __init__(self, recorded: Recorded) -> None:
        self._recorded, self._limit = recorded, recorded.parameters.limits.force_max[0] / 1e3
        self._time, most = recorded.seconds, MOST * self._limit
        forces = recorded.outputs.demanded_efforts / 1e3
        self._forces = np.where(np.abs(forces) < most, forces, np.nan)
        self.picture = Picture(*SIZE, 'The hexapod moves through a singularity, and its leg '
                               'forces over time, which grow without bound there')
        self._chart = Chart(self.picture, FRAME, (0.0, self._time[-1]), (-most, most))

    def draw(self) -> None:
        """Draw all that does not move."""
        picture, at = self.picture, self._chart.at
        _, top, _, height = FRAME
        end, (_, crossing) = self._time[-1], self._recorded.crossing
        warned = self._time[self._recorded.outputs.warnings]
        begin, zero = (float(at([time, 0.0])[0]) for time in (warned[0], crossing))
        picture.add('rect', x=begin, y=top, width=float(at([warned[-1], 0.0])[0]) - begin,
                    height=height, css='warned')
        self._chart.draw_axes('time [s]', 'leg forces [kN], + pushes')
        for limit in (-self._limit, self._limit):
            picture.line(at([0.0, limit]), at([end, limit]), css='limit')
        picture.text(at([0.1, self._limit]) - [0.0, 5.0], 'limits.force_max', css='tick')
        picture.text([begin - 5.0, top + 14.0], 'singularity warning', 'end', css='tick')
        picture.line([zero, top], [zero, top + height], css='singular')
        picture.text([zero, top - 6.0], 'det(J) = 0', 'middle', css='singular')
        for leg, forces in enumerate(self._forces.T):
            picture.path(at(np.stack([self._time, forces], axis=1)), css=f'curve leg{leg}')

    def at(self, sample: int) -> str:
        """Return the line and dots at a sample as an element."""
        picture = Picture(*SIZE, 'now')
        time = self._time[sample]
        x, _ = self._chart.at([time, 0.0])
        picture.line([x, FRAME[1]], [x, FRAME[1] + FRAME[3]], css='now')
        for leg, force in enumerate(self._forces[sample]):
            if np.isfinite(force):
                picture.circle(self._chart.at([time, force]), 4.0, css=f'dot leg{leg}')
        return picture.svg()


def hexapods(recorded: Recorded, samples: Array) -> Iterator[str]:
    """Yield the hexapod at some samples as elements, all to one scale."""
    poses = [Pose(row[:3], row[3:12].reshape(3, 3)) for row in recorded.motions[samples]]
    for pose in poses:
        yield Drawing(recorded.parameters, pose, tuple(poses)).oblique().svg()


def draw() -> str:
    """Return the picture."""
    recorded = Recorded.of(ROOT / 'bags' / 'singular')
    time, forces = recorded.seconds, Forces(recorded)
    forces.draw()
    samples = np.searchsorted(time, np.arange(0.0, time[-1], 1.0 / RATE))
    seconds = len(samples) / RATE + PAUSE
    shown = 100.0 / (RATE * seconds)  # a frame's part of a turn [%]
    style = STYLE
    for name, share in (('frame', shown), ('last', shown + 100.0 * PAUSE / seconds)):
        style += (f'.{name} {{ visibility: hidden; animation: {name} {seconds:g}s step-end '
                  f'infinite; }}\n@keyframes {name} {{ 0% {{ visibility: visible; }} '
                  f'{share:.3f}% {{ visibility: hidden; }} }}\n')
    at_warning = int(np.argmax(recorded.outputs.warnings[samples]))
    # Delays are negative: each frame is somewhere in its turn when the picture is loaded.
    frames = [f'<g class="{"last" if n + 1 == len(samples) else "frame"}" style="animation-delay: '
              f'{n / RATE - seconds:.3f}s{"; visibility: visible" if n == at_warning else ""}">'
              f'<g transform="translate(0 14) scale(1.14)">{hexapod}</g>{forces.at(sample)}</g>'
              for n, (sample, hexapod) in enumerate(zip(
                  samples, hexapods(recorded, samples), strict=True))]
    return forces.picture.document(style, *frames)


def main() -> None:
    """Draw the picture."""
    FILE.write_text(draw(), encoding='utf-8')
    print(FILE.relative_to(ROOT))


if __name__ == '__main__':
    main()
