# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Run a controller in the loop with a simulated hexapod, and print the tracking errors.

``make demo-loop`` runs it: reference motion, node, simulator and examples/leg_controller.py, each
in its own process, over ROS 2 topics; four times: without and with the node's forces, or
torques of cranks (``LEGS=crank``), as feed-forward, with the payload of the parameters and with
more. The simulator owns time and waits for each command, so that no figure depends on the load of
the computer.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import math
from pathlib import Path
import sys
import time
from typing import Any, NamedTuple

from closed_loop import (
    BANDWIDTH, demonstration, Errors, Failure, leg_mass, live_view, PLOTS, Progress, Recorder,
    ROOT, save, simulate, units)
import matplotlib
import numpy as np
from numpy.typing import NDArray
import rclpy
from stewart_dynamics import StewartPlatform
from stewart_dynamics.executables import executable
from stewart_dynamics.legs import KINDS, LegKind, TELESCOPIC
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.whole_file import write_json

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

Array = NDArray[np.float64]

RATE = 1000.0  # of setpoints, states and commands [Hz]
HEAVIER = 1.3
# Hexapod and motion by the kind of legs.
FILES = {'telescopic': ('platform.yaml', 'trajectory_loop.yaml'),
         'crank': ('crank_platform.yaml', 'trajectory_cranks.yaml')}

# Started in this order; the last one, which starts the motion, when the others are connected.
PROGRAMS: dict[str, list[str | Path]] = {
    'stewart_simulator': [executable('stewart_simulator')],
    'stewart_dynamics': [executable('stewart_dynamics')],
    'leg_controller': [sys.executable, ROOT / 'examples' / 'leg_controller.py'],
    'stewart_trajectory': [executable('stewart_trajectory')]}


class Run(NamedTuple):
    """One of the four runs and its errors."""

    feed_forward: bool
    payload: float
    """Mass of the simulated platform, relative to the node's parameters."""
    errors: Errors


class Loop:
    """
    Hexapod, motion and gains, common to all runs.

    Parameters
    ----------
    hexapod, motion : Path
        Parameter files of the node and of the reference motion.
    seconds : float
        Duration of the motion [s].
    bandwidth : float
        Natural frequency [Hz] of a leg under PD control, with a damping ratio of 1, and with the
        mass that it moves at the start while the other five are held.

    Raises
    ------
    Failure
        The motion does not begin at rest, or the bandwidth is not positive.

    """

    def __init__(self, hexapod: Path, motion: Path, seconds: float, bandwidth: float) -> None:
        parameters = Parameters.from_yaml(hexapod)
        trajectory = {'output': 'combined', 'rate': RATE, 'loop': False,
                      'motion.hold_at_end': False, 'motion.duration': seconds,
                      'base_frame': parameters.base_frame}
        settings = ReferenceMotionParameters.from_yaml(motion).replaced(trajectory, str(motion))
        platform = StewartPlatform(parameters)
        self.times = sample_times(settings)
        self._motion = motion_at(settings, self.times * 1e-9)
        self._lengths = (platform.inverse_kinematics(self._motion)
                         - parameters.geometry.zero_length)
        if not 0.0 < bandwidth < math.inf:
            raise Failure(f'bandwidth: {bandwidth} Hz: must be more than 0')
        start = motion_at(settings, 0.0)
        if np.abs([start.linear_velocity, start.angular_velocity]).max() > 1e-9:
            raise Failure(f'{motion}: must begin at rest, as the simulator does')
        self.kind, self.bandwidth = parameters.leg_kind, bandwidth
        self.leg_mass = leg_mass(platform, start)
        omega = 2.0 * math.pi * bandwidth
        self.gains = {'proportional_gain': self.leg_mass * omega ** 2,
                      'derivative_gain': 2.0 * self.leg_mass * omega}
        self._payload = parameters.platform.mass, parameters.platform.inertia
        self._files = {
            'stewart_simulator': [hexapod, ROOT / 'config' / 'simulator.yaml'],
            'stewart_dynamics': [hexapod], 'stewart_trajectory': [motion]}
        self._given: dict[str, dict[str, Any]] = {
            'stewart_simulator': {'use_sim_time': True, 'rate': RATE, 'initial_pose': [
                *start.position.tolist(), *_angles(start.rotation)]},
            'stewart_dynamics': {'setpoint.source': 'combined'},
            'leg_controller': {'use_sim_time': True, **self.gains},
            'stewart_trajectory': {'use_sim_time': True, **trajectory}}

    def run(self, feed_forward: bool, payload: float, progress: Callable[[int], object],
            simulator: Sequence[str | Path] = (),
            gains: Mapping[str, float] | None = None) -> Run:
        """
        Run the four programs, report the simulated time [ns], and return the errors.

        A command ``simulator`` takes the place of stewart_simulator, with its topics; gains take
        the place of those of the bandwidth.
        """
        mass, inertia = self._payload
        simulated = {
            'platform.mass': payload * mass, 'platform.inertia': (payload * inertia).tolist()}
        return Run(feed_forward, payload, self.errors(
            feed_forward, simulated, progress, Recorder(), simulator=simulator, gains=gains))

    def errors(self, feed_forward: bool, simulated: Mapping[str, Any],
               progress: Callable[[int], object], recorder: Recorder,
               hexapod: Path | None = None, simulator: Sequence[str | Path] = (),
               gains: Mapping[str, float] | None = None) -> Errors:
        """
        Run the four programs and return the errors.

        Parameters
        ----------
        feed_forward : bool
            Whether the controller adds the node's forces.
        simulated : mapping
            Parameters of the simulator that are not those of the hexapod's file.
        progress : callable
            Called with the simulated time [ns].
        recorder : Recorder
            Records, and is destroyed.
        hexapod : Path, optional
            Another parameter file for the node.
        simulator : sequence of str, optional
            A command to be run instead of stewart_simulator, with the same topics.
        gains : mapping, optional
            ``proportional_gain`` and ``derivative_gain`` in place of those of the bandwidth.

        """
        given = {name: {'ros__parameters': dict(values)} for name, values in self._given.items()}
        given['leg_controller']['ros__parameters'].update(
            {**(gains or {}), 'feed_forward': feed_forward})
        given['stewart_simulator']['ros__parameters'].update(simulated)
        files = self._files | ({'stewart_dynamics': [hexapod]} if hexapod else {})
        programs = {**PROGRAMS, 'stewart_simulator': simulator} if simulator else PROGRAMS
        simulate(programs, files, given, recorder, int(self.times[-1]), progress)
        return recorder.errors(self.times, self._lengths, self._motion)


def _angles(r: Array) -> list[float]:
    """Return alpha, beta, gamma [rad] of R = Rz(gamma) Ry(beta) Rx(alpha)."""
    return [math.atan2(r[2, 1], r[2, 2]), -math.asin(r[2, 0]), math.atan2(r[1, 0], r[0, 0])]


def payload_name(payload: float) -> str:
    """Return the name of the simulated payload."""
    more = 100.0 * (payload - 1.0)
    return f'payload {more:+.0f} %' if more else 'as in the parameters'


def table(runs: Sequence[Run], titles: Sequence[str], kind: LegKind = TELESCOPIC) -> str:
    """Return the table of all runs: without and with feed-forward, each pair with its title."""
    pairs = list(zip(runs[::2], runs[1::2], strict=True))
    lines = ['tracking error        ' + ''.join(f'{title:^39}' for title in titles),
             'RMS (peak)            '
             + f'{"PD only":>16}{forward_name(kind):>16}{"":7}' * len(pairs)]
    for name, unit in units(kind).items():
        line = f'{name:12}{unit:>5}     '
        for pd, forward in pairs:
            line += ''.join(f' {each.errors.rms[name]:8.1f} {_peak(each.errors.peak[name]):>6}'
                            for each in (pd, forward))
            line += f' {pd.errors.rms[name] / forward.errors.rms[name]:5.0f}x'
        lines.append(line)
    return '\n'.join(lines)


def forward_name(kind: LegKind) -> str:
    """Return the name of a run with feed-forward."""
    return f'PD + {kind.effort.field}'


def conclusion(runs: Sequence[Run], kind: LegKind) -> str:
    """Return in a sentence by how much the platform departs from its motion in each run."""
    alone, forward, heavier_alone, heavier = (
        f'{run.errors.peak["position"] / 1e3:.2g} mm' for run in runs)
    return (f'With the {kind.effort.field} of the node the platform stays within {forward} of its '
            f'motion, without them within {alone};\nwith {100.0 * (runs[-1].payload - 1.0):.0f} % '
            f'more payload than the node knows, within {heavier} and {heavier_alone}.')


def _peak(value: float) -> str:
    """Return a peak in parentheses; a small one with a decimal, as the RMS before it."""
    return f'({value:.{0 if value >= 100.0 else 1}f})'


def draw(path: Path, runs: Sequence[Run], kind: LegKind) -> None:
    """Draw the errors of the legs over time, without and with feed-forward."""
    pyplot.rcParams.update(PLOTS)
    figure, panels = pyplot.subplots(1, 2, figsize=(11, 4), sharey=True, layout='constrained')
    for axes, pair in zip(panels, zip(runs[::2], runs[1::2], strict=True), strict=True):
        for run, color in zip(pair, ('#d55e00', '#0072b2'), strict=True):
            errors = np.sqrt(np.mean(np.square(run.errors.legs), axis=1))
            axes.plot(run.errors.seconds, errors, color=color, linewidth=1.2,
                      label=f'PD and the {kind.effort.field} of the node' if run.feed_forward
                      else 'PD only')
        axes.set(title=payload_name(pair[0].payload), xlabel='time  [s]', yscale='log',
                 xlim=(0.0, run.errors.seconds[-1]))
    panels[0].set_ylabel(
        f'error of the leg {kind.position.field}, RMS of six  [µ{kind.position.unit}]')
    panels[0].legend(frameon=False)
    save(figure, path)


def summary(loop: Loop, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the figures of all runs."""
    return {'setpoints': len(loop.times), 'rate [Hz]': RATE, 'bandwidth [Hz]': loop.bandwidth,
            f'leg mass [{loop.kind.inertia_unit}]': loop.leg_mass, **loop.gains,
            'units': units(loop.kind),
            'runs': [{'feed_forward': run.feed_forward, 'payload': run.payload,
                      'rms': run.errors.rms, 'peak': run.errors.peak} for run in runs]}


def main() -> None:
    """Run the loop four times, print the table, draw the plot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--legs', choices=[kind.name for kind in KINDS], default=TELESCOPIC.name,
                        help='legs of the hexapod where no files are given')
    parser.add_argument('--params', type=Path, help='parameter file of the hexapod')
    parser.add_argument('--motion', type=Path,
                        help='parameter file of the motion, which must begin at rest')
    parser.add_argument('--seconds', type=float, default=10.0, help='duration of the motion [s]')
    parser.add_argument('--bandwidth', type=float, default=BANDWIDTH,
                        help='natural frequency of a leg under PD control [Hz]')
    parser.add_argument('--output', type=Path, default=ROOT / 'looped',
                        help='folder for loop.json and loop.png')
    options = parser.parse_args()
    runs: list[Run] = []
    hexapod, motion = (ROOT / 'config' / name for name in FILES[options.legs])
    with demonstration('demo-loop'):
        loop = Loop(options.params or hexapod, options.motion or motion, options.seconds,
                    options.bandwidth)
        kind, unit = loop.kind, f'{loop.kind.effort.unit}/{loop.kind.position.unit}'
        options.output.mkdir(parents=True, exist_ok=True)
        rclpy.init()
        print(f'each leg: {loop.bandwidth:g} Hz, damping ratio 1, with the {loop.leg_mass:.3g} '
              f'{kind.inertia_unit} that it moves alone: {loop.gains["proportional_gain"]:.3g} '
              f'{unit}, {loop.gains["derivative_gain"]:.3g} {kind.friction_units[0]}', flush=True)
        begun = time.monotonic()
        with live_view(), Progress(4 * options.seconds) as progress:
            for payload in (1.0, HEAVIER):
                for feed_forward in (False, True):
                    name = forward_name(kind) if feed_forward else 'PD only'
                    progress.stage(f'{name}, {payload_name(payload)}', options.seconds)
                    runs.append(loop.run(feed_forward, payload, progress.reached))
        print(f'\n{table(runs, [payload_name(run.payload) for run in runs[::2]], kind)}\n')
        draw(options.output / 'loop.png', runs, kind)
        write_json(options.output / 'loop.json', summary(loop, runs))
        print(f'{time.monotonic() - begun:.0f} s; {options.output}: loop.png, loop.json')
        print(conclusion(runs, kind))


if __name__ == '__main__':
    main()
