# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Run the controller of ``make demo-loop`` with MuJoCo in place of the simulator, and compare both.

``make demo-mujoco`` runs it: reference motion, node and examples/leg_controller.py over ROS 2
topics, with stewart_simulator and with MuJoCo (mujoco_plant.py), each without and with the node's
forces as feed-forward. The forces come from this package, the motion from a physics engine that
does not know its equations.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

from closed_loop import BANDWIDTH, demonstration, Progress, ROOT
from loop import Loop, Run, summary, table
import rclpy
from stewart_dynamics.whole_file import write_json

PHYSICS: dict[str, list[str | Path]] = {
    'stewart_simulator': [], 'MuJoCo': [sys.executable, ROOT / 'demo' / 'mujoco_plant.py']}


def main() -> None:
    """Run the loop with both, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=10.0, help='duration of the motion [s]')
    parser.add_argument('--bandwidth', type=float, default=BANDWIDTH,
                        help='natural frequency of a leg under PD control [Hz]')
    parser.add_argument('--output', type=Path, default=ROOT / 'looped',
                        help='folder for mujoco.json')
    options = parser.parse_args()
    runs: list[Run] = []
    with demonstration('demo-mujoco'):
        loop = Loop(ROOT / 'config' / 'platform.yaml', ROOT / 'config' / 'trajectory_loop.yaml',
                    options.seconds, options.bandwidth)
        options.output.mkdir(parents=True, exist_ok=True)
        rclpy.init()
        begun = time.monotonic()
        with Progress(4 * options.seconds) as progress:
            for name, command in PHYSICS.items():
                for feed_forward in (False, True):
                    progress.stage(f'{name}, {"PD + forces" if feed_forward else "PD only"}',
                                   options.seconds)
                    runs.append(loop.run(feed_forward, 1.0, progress.reached, command))
        print(f'\n{table(runs, [*PHYSICS])}\n')
        write_json(options.output / 'mujoco.json', summary(loop, runs) | {'physics': [*PHYSICS]})
        print(f'{time.monotonic() - begun:.0f} s; {options.output}: mujoco.json')


if __name__ == '__main__':
    main()
