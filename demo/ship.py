# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Keep a platform still in the world on the deck of a ship, and print the errors.

``make demo-ship`` runs it: simulator on a moving base, examples/motion_compensation.py, node and
examples/leg_controller.py, each in its own process, over ROS 2 topics; four times: without the
node's forces as feed-forward, and with those of a fixed base, of the base's motion and of an IMU
on the base. The simulator owns time and waits for each command, as in demo/loop.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import sys
import time
from typing import Any, NamedTuple

from closed_loop import (
    BANDWIDTH, demonstration, Errors, Failure, leg_mass, PLOTS, Progress, Recorder, ROOT,
    save, simulate, SIMULATOR, UNITS)
import matplotlib
import numpy as np
from numpy.typing import NDArray
import rclpy
from stewart_dynamics import BaseMotion, Motion, Pose, StewartPlatform
from stewart_dynamics.executables import executable
from stewart_dynamics.parameters.yaml_file import read_yaml
from stewart_dynamics.simulator.moving_base import GeneratedBaseMotion
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from stewart_dynamics.whole_file import write_json

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

sys.path.insert(0, str(ROOT / 'examples'))
from motion_compensation import seen_from  # noqa: E402, I100, I202

Array = NDArray[np.float64]

RATE = 500.0  # of states, setpoints and commands [Hz]
# Started in this order; the last one, which publishes the first setpoint, when the others are
# connected.
PROGRAMS: dict[str, list[str | Path]] = {
    'stewart_simulator': [executable('stewart_simulator')],
    'stewart_dynamics': [executable('stewart_dynamics'), '--ros-args', *(
        part for topic, of_simulator in (
            ('base/pose', 'base/pose'), ('base/twist', 'base/twist'),
            ('base/accel', 'base/accel'), ('base/imu', 'imu'))
        for part in ('-r', f'~/{topic}:={SIMULATOR}/{of_simulator}'))],
    'leg_controller': [sys.executable, ROOT / 'examples' / 'leg_controller.py'],
    'motion_compensation': [sys.executable, ROOT / 'examples' / 'motion_compensation.py']}

# base.source of the node by the name of the run; without one, no feed-forward.
RUNS = {'PD only': None, 'PD + forces, fixed base': 'fixed', 'PD + forces, IMU': 'imu',
        'PD + forces, base motion': 'motion'}
COLORS = ('#d55e00', '#e69f00', '#009e73', '#0072b2')
AXIS_COLORS = ('#0072b2', '#009e73', '#d55e00')


class Run(NamedTuple):
    """One of the runs and its errors."""

    name: str
    errors: Errors


class ShipRecorder(Recorder):
    """Records the measured states; it is also ready for the motion only when the node knows it."""

    def __init__(self, source: str | None) -> None:
        super().__init__()
        self._moves = source not in (None, 'fixed')

    def ready(self) -> bool:
        """Return whether all are connected, and the node has a sample of the base's motion."""
        return super().ready() and (
            not self._moves or int(self.diagnostics.get('samples', 0)) > 0)


class Ship:
    """
    Hexapod, ship, motion and gains, common to all runs.

    Parameters
    ----------
    hexapod, ship : Path
        Parameter files of the hexapod and of the base motion.
    seconds : float
        Duration [s].

    """

    def __init__(self, hexapod: Path, ship: Path, seconds: float) -> None:
        simulator = ROOT / 'config' / 'simulator.yaml'
        files = hexapod, simulator, ship
        self._files = {'stewart_simulator': files, 'stewart_dynamics': [hexapod]}
        own = {'use_sim_time': True, 'rate': RATE}
        given = {name: value for file in files for name, value in read_yaml(
            file, 'stewart_simulator').items()}
        parameters = SimulatorParameters({**given, 'rate': RATE})
        platform = StewartPlatform(parameters)
        pose = parameters.initial_pose
        self.target = Pose.from_euler(pose[:3], pose[3:])
        self.times = np.arange(round(seconds * RATE) + 1) * round(1e9 / RATE)
        self.base = GeneratedBaseMotion(parameters).at(self.times * 1e-9)
        self.motion = joined([seen_from(each, self.target) for each in self.base])
        result = platform.inverse_dynamics(
            self.motion, base=BaseMotion.from_motion(self.base, parameters.gravity))
        self.lengths = result.lengths - parameters.geometry.zero_length
        self._check(parameters, result)
        mass = leg_mass(platform, self.motion[0])
        omega = 2.0 * np.pi * BANDWIDTH
        self._given: dict[str, dict[str, Any]] = {
            'stewart_simulator': own,
            'stewart_dynamics': {},
            'leg_controller': {'use_sim_time': True, 'proportional_gain': mass * omega ** 2,
                               'derivative_gain': 2.0 * mass * omega},
            'motion_compensation': {'use_sim_time': True, 'position': pose[:3].tolist(),
                                    'angles': pose[3:].tolist(),
                                    'base_frame': parameters.base_frame}}

    def _check(self, parameters: SimulatorParameters, result: Any) -> None:
        """Raise Failure where the hexapod cannot keep its platform still."""
        limits = parameters.limits
        for name, limit, values, sign in (
                ('length_min', limits.length_min, result.lengths, -1.0),
                ('length_max', limits.length_max, result.lengths, 1.0),
                ('velocity_max', limits.velocity_max, np.abs(result.rates), 1.0)):
            if limit is not None and np.any(sign * values > sign * limit):
                raise Failure(f'the legs would exceed limits.{name}: a smaller sea, or less time')

    def run(self, name: str, progress: Callable[[int], object]) -> Run:
        """Run the programs, report the simulated time [ns], and return the errors."""
        source = RUNS[name]
        given = {of: {'ros__parameters': dict(values)} for of, values in self._given.items()}
        given['leg_controller']['ros__parameters']['feed_forward'] = source is not None
        given['stewart_dynamics']['ros__parameters']['base.source'] = source or 'fixed'
        recorder = ShipRecorder(source)
        simulate(PROGRAMS, self._files, given, recorder, int(self.times[-1]), progress)
        return Run(name, recorder.errors(self.times, self.lengths, self.motion))


def joined(motions: Sequence[Motion]) -> Motion:
    """Return single motions as a batch."""
    return Motion.of_rows(np.array([motion.rows for motion in motions]))


def table(runs: Sequence[Run]) -> str:
    """Return the table of all runs."""
    without = next(run for run in runs if RUNS[run.name] == 'fixed')
    lines = ['error, RMS (peak)           ' + ''.join(f'{name:>17}' for name in (
        'legs [um]', 'position [um]', 'rotation [urad]'))]
    for run in runs:
        line = f'{run.name:28}'
        for name in ('all legs', 'position', 'rotation'):
            line += f'{run.errors.rms[name]:10.2f} {f"({run.errors.peak[name]:.0f})":>6}'
        if RUNS[run.name] not in (None, 'fixed'):
            gain = without.errors.rms['position'] / run.errors.rms['position']
            line += f'   1/{gain:.0f} of a fixed base'
        lines.append(line)
    return '\n'.join(lines)


def draw(path: Path, ship: Ship, runs: Sequence[Run]) -> None:
    """Draw the motion of the deck above the errors of the platform's position in the world."""
    pyplot.rcParams.update(PLOTS)
    figure, (above, below) = pyplot.subplots(
        2, 1, figsize=(9, 6), sharex=True, height_ratios=(2, 3), layout='constrained')
    seconds = ship.times * 1e-9
    moved = 1e3 * (ship.base.position - ship.base.position[0])
    r = ship.base.rotation
    roll, pitch = np.arctan2(r[:, 2, 1], r[:, 2, 2]), -np.arcsin(r[:, 2, 0])
    for name, series, color in zip(('surge', 'sway', 'heave'), moved.T, AXIS_COLORS, strict=True):
        above.plot(seconds, series, color=color, linewidth=1.2, label=name)
    turned = above.twinx()
    for name, series, color in zip(('roll', 'pitch'), np.degrees([roll, pitch]), AXIS_COLORS,
                                   strict=False):
        turned.plot(seconds, series, color=color, linewidth=1.0, linestyle='--', label=name)
    # Both zeros at one height.
    for axes in (above, turned):
        most = 1.1 * max(np.abs(line.get_ydata()).max() for line in axes.get_lines())
        axes.set_ylim(-most, most)
    turned.set_ylabel('roll, pitch  [°]')
    turned.spines['right'].set_visible(True)
    turned.grid(False)
    above.set_ylabel('motion of the deck  [mm]')
    lines = [*above.get_lines(), *turned.get_lines()]
    above.legend(lines, [str(line.get_label()) for line in lines], frameon=False, ncols=5,
                 loc='lower center', bbox_to_anchor=(0.5, 1.0))
    for run, color in zip(runs, COLORS, strict=True):
        below.plot(seconds, run.errors.position, color=color, linewidth=1.2, label=run.name)
    below.set(xlabel='time  [s]', yscale='log', xlim=(0.0, seconds[-1]), ylim=(1e-2, 3e3),
              ylabel='error of the platform in the world  [µm]')
    below.legend(frameon=False, ncols=4, loc='lower center', bbox_to_anchor=(0.5, 1.0))
    save(figure, path)


def summary(ship: Ship, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the figures of all runs."""
    return {'setpoints': len(ship.times), 'rate [Hz]': RATE, 'bandwidth [Hz]': BANDWIDTH,
            'units': UNITS, 'runs': [{
                'name': run.name, 'base.source': RUNS[run.name], 'rms': run.errors.rms,
                'peak': run.errors.peak} for run in runs]}


def main() -> None:
    """Run all, print the table, draw the plot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml',
                        help='parameter file of the hexapod')
    parser.add_argument('--ship', type=Path, default=ROOT / 'config' / 'ship.yaml',
                        help='parameter file of the base motion, source sine or sea')
    parser.add_argument('--seconds', type=float, default=20.0, help='duration [s]')
    parser.add_argument('--output', type=Path, default=ROOT / 'shipped',
                        help='folder for ship.json and ship.png')
    options = parser.parse_args()
    runs: list[Run] = []
    with demonstration('demo-ship'):
        ship = Ship(options.params, options.ship, options.seconds)
        options.output.mkdir(parents=True, exist_ok=True)
        rclpy.init()
        begun = time.monotonic()
        with Progress(len(RUNS) * options.seconds) as progress:
            for name in RUNS:
                progress.stage(name, options.seconds)
                runs.append(ship.run(name, progress.reached))
        print(f'\n{table(runs)}\n')
        draw(options.output / 'ship.png', ship, runs)
        write_json(options.output / 'ship.json', summary(ship, runs))
        print(f'{time.monotonic() - begun:.0f} s; {options.output}: ship.png, ship.json')


if __name__ == '__main__':
    main()
