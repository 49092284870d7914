# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw the pictures of docs/ into docs/figures/; the README's: badges.py, moving.py.

``make docs`` runs it. The paper's motion is drawn from bags/singular through the joining and the
step of node and replay; loop and ship are what demo/loop.py and demo/ship.py measure, which also
write loop.json and ship.json; the report is that of stewart_replay in a browser.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from playwright.sync_api import sync_playwright

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.colors import AXIS_COLORS, LEG_COLORS
from stewart_dynamics.datasheet import main as datasheet
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.one_bag import replay
from stewart_dynamics.replay.replay_options import NODE
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.step import Batch, Outputs, Step

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')


class Recorded(NamedTuple):
    """The paper's motion as recorded, and the node's answers."""

    parameters: Parameters
    seconds: Array
    motions: Array
    outputs: Outputs

    @classmethod
    def of(cls, bag: Path) -> Recorded:
        """Process a bag by the joining and the step of node and replay."""
        parameters = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
        setpoints = Setpoints(parameters, lambda rejection, details: None, print)
        with closing(Recording(bag)) as recording:
            parts = [setpoints.join_messages(messages) for messages, _ in recording.messages(
                {f'{NODE}/{topic}': topic for topic in setpoints.topics})]
        batch = Batch.joined(parts)
        outputs = Step(parameters)(batch)
        return cls(parameters, (batch.stamps - batch.stamps[0]) * 1e-9, batch.motions, outputs)

    @property
    def crossing(self) -> tuple[int, float]:
        """Return the last sample before det(J) is zero, and the time of the zero [s]."""
        det, time = self.outputs.determinants, self.seconds
        at = int(np.flatnonzero(np.sign(det[:-1]) != np.sign(det[1:]))[0])
        return at, float(time[at] + det[at] / (det[at] - det[at + 1]) * (time[at + 1] - time[at]))


def draw_determinant(axes: Any, recorded: Recorded) -> None:
    """Draw det(J), its crossing and the warning."""
    time, det = recorded.seconds, recorded.outputs.determinants
    _, crossing = recorded.crossing
    axes.plot(time, det, color='black')
    axes.axhline(0.0, color='firebrick', linewidth=0.8)
    axes.plot(crossing, 0.0, 'o', color='firebrick', markersize=5)
    axes.annotate(f'crosses zero\nat t = {crossing:.2f} s', (crossing, 0.0),
                  xytext=(6, 42), textcoords='offset points', ha='center', color='firebrick',
                  arrowprops={'arrowstyle': '-', 'color': 'firebrick', 'linewidth': 0.8})
    axes.set_ylabel('det(J)  [m³]')
    warned = time[recorded.outputs.warnings]
    axes.annotate('singularity\nwarning', (warned[0], det.max()), xytext=(4, 0), va='top',
                  textcoords='offset points', color='darkgoldenrod')
    axes.axvspan(warned[0], warned[-1], color='gold', alpha=0.25, linewidth=0)


def draw_forces(axes: Any, recorded: Recorded) -> None:
    """Draw the demanded forces, the axis cut at three times the limit, and the warning."""
    time = recorded.seconds
    at, crossing = recorded.crossing
    limit = recorded.parameters.limits.force_max[0] / 1e3
    forces = recorded.outputs.demanded_efforts / 1e3
    for leg, force, color in zip(recorded.parameters.joints, forces.T, LEG_COLORS, strict=True):
        # No line between the two branches.
        axes.plot(np.insert(time, at + 1, crossing), np.insert(force, at + 1, np.nan),
                  label=leg.replace('_', ' '), linewidth=1.4, color=color)
    axes.set_ylim(-3.0 * limit, 3.0 * limit)
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, color='0.35', linestyle='--', linewidth=1.0)
    axes.annotate('limits.force_max', (0.05, limit), xytext=(0, 4),
                  textcoords='offset points', color='0.35')
    axes.set_ylabel('leg force  [kN], + pushes')
    axes.legend(ncols=3, loc='lower left', frameon=False)
    warned = time[recorded.outputs.warnings]
    axes.axvspan(warned[0], warned[-1], color='gold', alpha=0.25, linewidth=0)


def draw_platform(axes: Any, recorded: Recorded) -> None:
    """Draw the platform in its initial and its final pose."""
    p = recorded.parameters
    base = p.geometry.base_joints
    axes.plot(*np.vstack([base, base[:1]]).T, color='0.35')
    for n, (name, style) in enumerate((('initial', '-'), ('final', '--'))):
        row = recorded.motions[-n]
        joints = row[:3] + p.geometry.platform_joints @ row[3:12].reshape(3, 3).T
        axes.plot(*np.vstack([joints, joints[:1]]).T, color='black', linestyle=style, label=name)
        for leg, color in enumerate(LEG_COLORS):
            axes.plot(*np.stack([base[leg], joints[leg]]).T, color=color, linestyle=style,
                      linewidth=1.2)
    axes.set_box_aspect((1.0, 1.0, 0.8))
    axes.set(xlabel='x  [m]', ylabel='y  [m]', zlabel='z  [m]')
    axes.view_init(elev=22, azim=-62)
    axes.legend(loc='upper left', frameon=False)


def draw_figures(path: Path, recorded: Recorded) -> None:
    """Draw the paper's figures 12 to 18."""
    figure = pyplot.figure(figsize=(11, 17), layout='constrained')
    motions, outputs = recorded.motions, recorded.outputs
    panels = [
        ('12: position', 'position  [m]', motions[:, 0:3], ('X', 'Y', 'Z')),
        ('12: orientation', 'angle  [deg]', np.degrees(euler(motions[:, 3:12])),
         ('alpha', 'beta', 'gamma')),
        ('13: velocity', 'v  [m/s]', motions[:, 12:15], ('x', 'y', 'z')),
        ('13: angular velocity', 'ω  [deg/s]', np.degrees(motions[:, 15:18]), ('x', 'y', 'z')),
        ('14: acceleration', 'a  [m/s²]', motions[:, 18:21], ('x', 'y', 'z')),
        ('14: angular acceleration', 'dω/dt  [deg/s²]', np.degrees(motions[:, 21:24]),
         ('x', 'y', 'z')),
        ('15: leg lengths', 'length  [m]', outputs.drive_positions,
         [leg.replace('_', ' ') for leg in recorded.parameters.joints])]
    for n, (title, label, values, names) in enumerate(panels, start=1):
        axes = figure.add_subplot(5, 2, n)
        for name, column, color in zip(
                names, values.T, LEG_COLORS if len(names) == 6 else AXIS_COLORS, strict=True):
            axes.plot(recorded.seconds, column, label=name, color=color)
        axes.set(title=f'Figure {title}', ylabel=label)
        axes.legend(ncols=3, frameon=False)
    axes = figure.add_subplot(5, 2, 8, projection='3d')
    axes.set_title('Figure 16: initial and final platform')
    draw_platform(axes, recorded)
    for n, (title, draw) in enumerate((('17: det(J)', draw_determinant),
                                       ('18: leg forces', draw_forces)), start=9):
        axes = figure.add_subplot(5, 2, n)
        axes.set(title=f'Figure {title}', xlabel='time  [s]')
        draw(axes, recorded)
    for axes in figure.axes:
        if axes.name != '3d':
            axes.set_xlim(recorded.seconds[0], recorded.seconds[-1])
    save(figure, path)


def draw_report(path: Path) -> None:
    """Take a picture of the report of the recorded motion, where there is a browser."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print(f'no browser ({", ".join(BROWSERS)}): {path.name} is left as it is')
        return
    parameters = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        replay(Path('bags/singular'), parameters, Path(folder) / 'singular')
        page = playwright.chromium.launch(executable_path=browser, args=[
            '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
        ]).new_page(viewport={'width': 1300, 'height': 900})
        page.goto((Path(folder) / 'singular' / 'report.html').as_uri())
        page.locator('#slider').fill('7.6')
        page.locator('#motion').scroll_into_view_if_needed()
        page.locator('#motion h2').evaluate('heading => heading.scrollIntoView()')
        page.locator('#motion canvas').first.wait_for()
        page.wait_for_timeout(3000)  # software rendering is slow
        page.screenshot(path=path)


def draw_datasheet(path: Path) -> None:
    """Take a picture of the upper part of a datasheet, where there is a browser."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print(f'no browser ({", ".join(BROWSERS)}): {path.name} is left as it is')
        return
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        datasheet(['--params', str(ROOT / 'config' / 'platform.yaml'), '--output', f'{folder}/of'])
        page = playwright.chromium.launch(executable_path=browser, args=[
            '--no-sandbox']).new_page(viewport={'width': 1300, 'height': 665})
        page.goto((Path(folder) / 'of' / 'datasheet.html').as_uri())
        page.screenshot(path=path)


def euler(rotations: Array) -> Array:
    """Return alpha, beta, gamma (N, 3) [rad] of R = Rz(gamma) Ry(beta) Rx(alpha), rows of nine."""
    r = rotations.reshape(-1, 3, 3)
    return np.stack([np.arctan2(r[:, 2, 1], r[:, 2, 2]), -np.arcsin(r[:, 2, 0]),
                     np.arctan2(r[:, 1, 0], r[:, 0, 0])], axis=1)


def save(figure: Any, path: Path) -> None:
    """Write a picture without date and version: the same numbers give the same bytes."""
    figure.savefig(path, dpi=110, metadata={'Software': None})


def main() -> None:
    """Draw all pictures."""
    recorded = Recorded.of(ROOT / 'bags' / 'singular')
    pyplot.rcParams.update({'font.size': 10, 'axes.grid': True, 'grid.color': '0.88',
                            'axes.spines.top': False, 'axes.spines.right': False})
    draw_figures(HERE / 'paper.png', recorded)
    draw_report(HERE / 'report.png')
    draw_datasheet(HERE / 'datasheet.png')
    for demo in ('loop', 'ship'):
        subprocess.run(
            [sys.executable, ROOT / 'demo' / f'{demo}.py', '--output', HERE], check=True)


if __name__ == '__main__':
    main()
