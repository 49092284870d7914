# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Draw docs/figures/cranks.png: the hexapod of config/crank_platform.yaml, and the signs of a crank.

``make docs`` runs it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from stewart_dynamics import Pose, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.colors import LEG_COLORS
from stewart_dynamics.legs.crank import crank_ends

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

HERE = Path(__file__).resolve().parent
GRAY, DARK, RED = '0.6', '0.15', '#c0392b'


def ends_of(platform: StewartPlatform, pose: Pose) -> tuple[Array, Array, Array]:
    """Return motors, ends of the cranks and platform joints (6, 3) in a pose [m]."""
    p = platform.parameters
    joints = pose.position + p.geometry.platform_joints @ pose.rotation.T
    ends = crank_ends(p, platform.inverse_kinematics(pose))
    return p.geometry.base_joints, ends, joints


def draw_hexapod(axes: Any, platform: StewartPlatform, pose: Pose) -> None:
    """Draw motors, cranks and rods, numbered, with arrows of positive angles."""
    motors, ends, joints = ends_of(platform, pose)
    for plate, color in ((motors, GRAY), (joints, DARK)):
        order = np.argsort(np.arctan2(*(plate - plate.mean(axis=0)).T[:2]))
        around = plate[[*order, order[0]]]
        axes.plot(*around.T, color=color, linewidth=1.2)
    for leg in range(6):
        color = LEG_COLORS[leg]
        axes.plot(*np.array([motors[leg], ends[leg]]).T, color=color, linewidth=4.0)
        axes.plot(*np.array([ends[leg], joints[leg]]).T, color=color, linewidth=1.5)
        axes.scatter(*motors[leg], color=color, s=25)
        axes.text(*(1.22 * motors[leg] - [0.0, 0.0, 0.03]), str(leg + 1), color=color,
                  ha='center', va='center', fontweight='bold')
        axes.quiver(*ends[leg], 0.0, 0.0, 0.13, color=color, linewidth=1.4,
                    arrow_length_ratio=0.4)
    for n, name in enumerate('xyz'):
        axes.quiver(0.0, 0.0, 0.0, *(0.2 * np.eye(3)[n]), color='0.4', linewidth=1.0)
        axes.text(*(0.24 * np.eye(3)[n]), name, color='0.4')
    axes.set_box_aspect((1.0, 1.0, 0.75))
    axes.set(xlim=(-0.42, 0.42), ylim=(-0.42, 0.42), zlim=(-0.02, 0.61))
    axes.view_init(elev=24.0, azim=-77.0)
    axes.set_axis_off()


def arrow(axes: Any, begin: Array, end: Array, **style: Any) -> None:
    axes.annotate('', xy=end, xytext=begin, arrowprops={
        'arrowstyle': '-|>', 'shrinkA': 0.0, 'shrinkB': 0.0, **style})


def draw_signs(axes: Any) -> None:
    """Draw one crank in the plane of its end, the axis of its motor toward the reader."""
    angle = np.deg2rad(35.0)
    end = np.array([np.cos(angle), np.sin(angle)])
    normal = np.array([-end[1], end[0]])
    joint = np.array([1.35, 2.6])
    along = (joint - end) / np.linalg.norm(joint - end)
    foot = end + along * ((np.zeros(2) - end) @ along)
    axes.plot([0.0, 1.75], [0.0, 0.0], color=GRAY, linewidth=1.0, linestyle='--')
    turn = np.linspace(0.0, angle, 40)
    axes.plot(0.55 * np.cos(turn), 0.55 * np.sin(turn), color=RED)
    arrow(axes, 0.55 * np.array([np.cos(angle - 0.12), np.sin(angle - 0.12)]),
          0.55 * end, color=RED)
    axes.text(0.62, 0.16, 'q > 0', color=RED)
    axes.plot([0.0, end[0]], [0.0, end[1]], color=LEG_COLORS[0], linewidth=5.0)
    axes.plot([end[0], joint[0]], [end[1], joint[1]], color=LEG_COLORS[1], linewidth=2.5)
    axes.plot([0.0, foot[0]], [0.0, foot[1]], color=DARK, linewidth=1.0, linestyle=':')
    axes.plot([end[0], foot[0]], [end[1], foot[1]], color=GRAY, linewidth=1.0, linestyle=':')
    arrow(axes, end, end + 0.75 * normal, color='0.4')
    arrow(axes, end, end + 0.55 * end, color='0.4')
    arrow(axes, end + 0.45 * (joint - end), end + 0.62 * (joint - end), color=DARK, linewidth=2.0)
    axes.add_patch(pyplot.Circle((0.0, 0.0), 0.09, fill=False, color=DARK))
    for point, color in (((0.0, 0.0), DARK), (end, DARK), (joint, DARK)):
        axes.scatter(*point, color=color, s=18, zorder=3)
    for at, text in (
            ((-0.62, -0.42), 'c, axis u toward you'), ((1.38, -0.2), 'z: q = 0'),
            (end + [0.10, -0.17], 'A'), (joint + [0.1, 0.02], 'B, platform joint'),
            (end + 0.63 * end, 'e'), (end + 0.86 * normal, 'n'),
            (0.5 * end + [-0.16, 0.13], '$L_1$'),
            (end + 0.3 * (joint - end) + [0.1, 0.0], '$L_2$'),
            (end + 0.56 * (joint - end) + [-0.2, 0.06], 'd'),
            (foot + [0.06, -0.14], 'lever $k$')):
        axes.text(*at, text)
    axes.text(-0.55, 2.75, 'k = $L_1$ d . n > 0: branch positive,\n'
              'a positive torque pushes B away', va='top')
    axes.set(xlim=(-0.7, 2.35), ylim=(-0.6, 2.85), aspect='equal')
    axes.set_axis_off()


def main() -> None:
    """Draw the picture."""
    platform = StewartPlatform.from_yaml(HERE.parents[1] / 'config' / 'crank_platform.yaml')
    figure = pyplot.figure(figsize=(10.0, 4.6), layout='constrained')
    draw_hexapod(figure.add_subplot(1, 2, 1, projection='3d'), platform, platform.home_pose())
    draw_signs(figure.add_subplot(1, 2, 2))
    figure.savefig(HERE / 'cranks.png', dpi=100, metadata={'Software': None})
    print('docs/figures/cranks.png')


if __name__ == '__main__':
    main()
