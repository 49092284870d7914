# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Run a controller in the loop with a simulated hexapod, and print the tracking errors.

``make demo-loop`` runs it: reference motion, node, simulator and examples/leg_controller.py, each
in its own process, over ROS 2 topics; four times: without and with the node's forces as
feed-forward, with the payload of the parameters and with more. The simulator owns time and waits
for each command, so that no figure depends on the load of the computer.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import json
import math
import os
from pathlib import Path
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
import matplotlib
import numpy as np
from numpy.typing import NDArray
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.errors import StewartError
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.reference_motion import motion_at, sample_times
from stewart_dynamics.mechanics.reference_motion_parameters import ReferenceMotionParameters
from stewart_dynamics.mechanics.rotation import from_quaternion
from stewart_dynamics.messages.setpoint import pose
from stewart_dynamics.parameters import Parameters
from tqdm import tqdm
import yaml

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100, I202

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
NODE, SIMULATOR = '/stewart_dynamics', '/stewart_simulator'
QOS = QoSProfile(depth=1000)
BEGIN = 1_000_000_000  # of simulated time [ns]
RATE = 1000.0  # of setpoints, states and commands [Hz]
HEAVIER = 1.3
# Longer than any wait on an idle computer, including the compilation of two programs [s].
PATIENCE = 60.0
LOOK = 0.1  # interval between checks of programs and progress [s]

# Started in this order; the last one, which starts the motion, when the others are connected.
PROGRAMS: dict[str, list[str | Path]] = {
    'stewart_simulator': [executable('stewart_simulator')],
    'stewart_dynamics': [executable('stewart_dynamics')],
    'leg_controller': [sys.executable, ROOT / 'examples' / 'leg_controller.py'],
    'stewart_trajectory': [executable('stewart_trajectory')]}

UNITS = {**{f'leg {n}': 'um' for n in range(1, 7)}, 'all legs': 'um', 'position': 'um',
         'rotation': 'urad'}


class Failure(Exception):
    """Ends the demo; its text is one line."""


class Errors(NamedTuple):
    """Measured minus desired state at the same times, N samples."""

    seconds: Array
    """Since the start of the motion (N,)."""
    legs: Array
    """Of the lengths (N, 6) [um]."""
    position: Array
    """Distance of the platform's origin (N,) [um]."""
    rotation: Array
    """Angle (N,) [urad]."""

    def figures(self, of: Callable[[Array], Any]) -> dict[str, float]:
        """Return one figure of each series of errors."""
        series = [*self.legs.T, self.legs, self.position, self.rotation]
        return {name: float(of(each)) for name, each in zip(UNITS, series, strict=True)}


class Run(NamedTuple):
    """One of the four runs and its errors."""

    feed_forward: bool
    payload: float
    """Mass of the simulated platform, relative to the node's parameters."""
    errors: Errors

    @property
    def rms(self) -> dict[str, float]:
        """Root of the mean square of each series of errors."""
        return self.errors.figures(lambda each: np.sqrt(np.mean(np.square(each))))

    @property
    def peak(self) -> dict[str, float]:
        """Largest of each."""
        return self.errors.figures(lambda each: np.abs(each).max())


class Recorder(Node):
    """Records the measured states."""

    def __init__(self) -> None:
        super().__init__('recorder')
        self.diagnostics: dict[str, str] = {}
        self.states = self._kept(JointState, f'{SIMULATOR}/leg_states')
        self.poses = self._kept(PoseStamped, f'{SIMULATOR}/pose')
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)

    def _kept(self, kind: Any, topic: str) -> list[bytes]:
        messages: list[bytes] = []
        self.create_subscription(kind, topic, messages.append, QOS, raw=True)
        return messages

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics.update({pair.key: pair.value for pair in status.values})

    def ready(self) -> bool:
        """
        Return whether the simulator is received and the controller is subscribed to the node.

        The node answers each setpoint once, so the controller must be connected before the first.
        Everything else is repeated, or waited for, until it is received.
        """
        return (int(self.diagnostics.get('leg_states: readers', 0)) > 0
                and bool(self.states) and bool(self.poses))

    @property
    def time(self) -> int:
        """Return the simulated time since its start [ns]."""
        last = min((_stamp(each[-1]) for each in (self.states, self.poses) if each), default=0)
        return max(last - BEGIN, 0)

    def errors(self, times: NDArray[np.int64], lengths: Array, desired: Motion) -> Errors:
        """Return the errors from a motion (N,) and its leg positions (N, 6) at its times."""
        states = {_stamp(data): np.array(deserialize_message(data, JointState).position)
                  for data in self.states}
        poses = {stamp: numbers for stamp, _, numbers in map(pose, self.poses)}
        stamps = (BEGIN + times).tolist()
        missing = sum(stamp not in states or stamp not in poses for stamp in stamps)
        if missing:
            raise Failure(f'{missing} of {len(stamps)} states are missing')
        true = np.array([poses[stamp] for stamp in stamps])
        rotation = np.moveaxis(np.reshape(from_quaternion(*true[:, 3:].T), (3, 3, -1)), -1, 0)
        turned = desired.rotation.swapaxes(1, 2) @ rotation
        # By the sine: the cosine does not resolve angles below 1e-8.
        sine = 0.5 * np.linalg.norm(turned[:, [2, 0, 1], [1, 2, 0]]
                                    - turned[:, [1, 2, 0], [2, 0, 1]], axis=1)
        return Errors(
            times * 1e-9, 1e6 * (np.array([states[stamp] for stamp in stamps]) - lengths),
            1e6 * np.linalg.norm(true[:, :3] - desired.position, axis=1),
            1e6 * np.arcsin(np.minimum(sine, 1.0)))


def _stamp(message: bytes) -> int:
    """Return the stamp of any message with a header, from this computer [ns]."""
    sec, nanosec = struct.unpack_from('<iI', message, 4)
    return int(sec) * 1_000_000_000 + int(nanosec)


class Program:
    """One of the four programs, in its own process."""

    def __init__(self, name: str, command: Sequence[str | Path], folder: Path) -> None:
        self.name = name
        self._output = folder / f'{name}.txt'
        with self._output.open('wb') as output:
            self._process = subprocess.Popen(
                command, stdout=output, stderr=output, stdin=subprocess.DEVNULL)

    @property
    def last_line(self) -> str:
        """Return the last line that it has printed."""
        return (self._output.read_text(errors='replace').splitlines() or ['no output'])[-1]

    def check(self) -> None:
        """Raise Failure if it has ended, unless the reference motion is complete."""
        code = self._process.poll()
        if code or (code == 0 and self.name != 'stewart_trajectory'):
            raise Failure(f'{self.name} ended with exit code {code}: {self.last_line}')

    def stop(self) -> None:
        """Terminate it, if it still runs."""
        self._process.terminate()

    def wait(self) -> None:
        """Wait until it has ended."""
        try:
            self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def simulate(commands: Mapping[str, Sequence[str | Path]], files: Mapping[str, Sequence[Path]],
             given: Mapping[str, Any], recorder: Recorder, end: int,
             progress: Callable[[int], object]) -> None:
    """
    Run programs until the simulated time has come to its end, and record the measured states.

    Parameters
    ----------
    commands : mapping of str to sequence
        Of each program, by its name; the last one is started when the others are connected.
    files : mapping of str to sequence of Path
        Their parameter files.
    given : mapping
        Further parameters, as in a file.
    recorder : Recorder
        Is destroyed.
    end : int
        [ns] since the start.
    progress : callable
        Called with the simulated time [ns].

    """
    executor = EventsExecutor()
    executor.add_node(recorder)
    programs: list[Program] = []

    def until(done: Callable[[], bool]) -> None:
        reached, since, looked = 0, time.monotonic(), 0.0
        while not done():
            executor.spin_once(timeout_sec=LOOK)
            now = time.monotonic()
            if now - looked < LOOK:
                continue
            looked = now
            for program in programs:
                program.check()
            if reached != (reached := recorder.time):
                since = now
                progress(reached)
            if now - since > PATIENCE:
                raise Failure(f'no progress at {reached * 1e-9:.3f} s; ' + '; '.join(
                    f'{each.name}: {each.last_line}' for each in programs))

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'given.yaml'
        file.write_text(yaml.safe_dump(given), encoding='utf-8')
        try:
            for n, (name, command) in enumerate(commands.items(), start=1):
                if n == len(commands):
                    until(recorder.ready)
                arguments = [part for path in (*files.get(name, ()), file)
                             for part in ('--params-file', path)]
                programs.append(Program(name, [
                    *command, *([] if '--ros-args' in command else ['--ros-args']), *arguments],
                    Path(folder)))
            until(lambda: recorder.time >= end)
        finally:
            for program in programs:
                program.stop()
            for program in programs:
                program.wait()
            executor.shutdown()
            recorder.destroy_node()
    progress(end)


class Loop:
    """
    What all runs have in common: hexapod, motion and gains.

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
                      'base_frame': parameters['base_frame']}
        settings = ReferenceMotionParameters.from_yaml(motion).replaced(trajectory, str(motion))
        platform = StewartPlatform(parameters)
        self.times = sample_times(settings)
        self._motion = motion_at(settings, self.times * 1e-9)
        self._lengths = (platform.inverse_kinematics(self._motion)
                         - parameters['geometry.zero_length'])
        if not 0.0 < bandwidth < math.inf:
            raise Failure(f'bandwidth: {bandwidth} Hz: must be more than 0')
        start = motion_at(settings, 0.0)
        if np.abs([start.linear_velocity, start.angular_velocity]).max() > 1e-9:
            raise Failure(f'{motion}: must begin at rest, as the simulator does')
        self.bandwidth, self.leg_mass = bandwidth, leg_mass(platform, start)
        omega = 2.0 * math.pi * bandwidth
        self.gains = {'proportional_gain': self.leg_mass * omega ** 2,
                      'derivative_gain': 2.0 * self.leg_mass * omega}
        self._payload = parameters['platform.mass'], parameters['platform.inertia']
        self._files = {
            'stewart_simulator': [hexapod, ROOT / 'config' / 'simulator.yaml'],
            'stewart_dynamics': [hexapod], 'stewart_trajectory': [motion]}
        self._given: dict[str, dict[str, Any]] = {
            'stewart_simulator': {'use_sim_time': True, 'rate': RATE, 'initial_pose': [
                *start.position.tolist(), *_angles(start.rotation)]},
            'stewart_dynamics': {'setpoint.source': 'combined'},
            'leg_controller': {'use_sim_time': True, **self.gains},
            'stewart_trajectory': {'use_sim_time': True, **trajectory}}

    def run(self, feed_forward: bool, payload: float, progress: Callable[[int], object]) -> Run:
        """Run the four programs, report the simulated time [ns], and return the errors."""
        mass, inertia = self._payload
        given = {name: {'ros__parameters': dict(values)} for name, values in self._given.items()}
        given['leg_controller']['ros__parameters']['feed_forward'] = feed_forward
        given['stewart_simulator']['ros__parameters'].update({
            'platform.mass': payload * mass, 'platform.inertia': (payload * inertia).tolist()})
        recorder = Recorder()
        simulate(PROGRAMS, self._files, given, recorder, int(self.times[-1]), progress)
        return Run(feed_forward, payload, recorder.errors(
            self.times, self._lengths, self._motion))


def leg_mass(platform: StewartPlatform, motion: Motion) -> float:
    """Return the mass that one leg moves alone [kg], the mean of the six."""
    to_legs = np.linalg.inv(platform.inverse_jacobian(motion))
    masses = to_legs.T @ platform.mass_matrix(motion) @ to_legs
    return float(np.mean(np.diag(masses)))


def _angles(r: Array) -> list[float]:
    """Return alpha, beta, gamma [rad] of R = Rz(gamma) Ry(beta) Rx(alpha)."""
    return [math.atan2(r[2, 1], r[2, 2]), -math.asin(r[2, 0]), math.atan2(r[1, 0], r[0, 0])]


def payload_name(payload: float) -> str:
    """Return the name of the simulated payload."""
    more = 100.0 * (payload - 1.0)
    return f'payload {more:+.0f} %' if more else 'as in the parameters'


def table(runs: Sequence[Run]) -> str:
    """Return the table of all runs: without and with feed-forward, side by side."""
    pairs = list(zip(runs[::2], runs[1::2], strict=True))
    lines = ['tracking error        '
             + ''.join(f'{payload_name(pd.payload):^36}' for pd, _ in pairs),
             'RMS (peak)            ' + f'{"PD only":>15}{"PD + forces":>15}{"":6}' * len(pairs)]
    for name, unit in UNITS.items():
        line = f'{name:12}{unit:>5}     '
        for pd, forward in pairs:
            line += ''.join(f'{each.rms[name]:8.1f} {f"({each.peak[name]:.0f})":>6}'
                            for each in (pd, forward))
            line += f'{pd.rms[name] / forward.rms[name]:5.0f}x'
        lines.append(line)
    return '\n'.join(lines)


def draw(path: Path, runs: Sequence[Run]) -> None:
    """Draw the errors of the legs over time, without and with feed-forward."""
    pyplot.rcParams.update({'font.size': 10, 'axes.grid': True, 'grid.color': '0.88',
                            'axes.spines.top': False, 'axes.spines.right': False})
    figure, panels = pyplot.subplots(1, 2, figsize=(11, 4), sharey=True, layout='constrained')
    for axes, pair in zip(panels, zip(runs[::2], runs[1::2], strict=True), strict=True):
        for run, color in zip(pair, ('#d55e00', '#0072b2'), strict=True):
            errors = np.sqrt(np.mean(np.square(run.errors.legs), axis=1))
            axes.plot(run.errors.seconds, errors, color=color, linewidth=1.2,
                      label='PD and the forces of the node' if run.feed_forward else 'PD only')
        axes.set(title=payload_name(pair[0].payload), xlabel='time  [s]', yscale='log',
                 xlim=(0.0, run.errors.seconds[-1]))
    panels[0].set_ylabel('error of the leg lengths, RMS of six  [µm]')
    panels[0].legend(frameon=False)
    figure.savefig(path, dpi=110, metadata={'Software': None})


def summary(loop: Loop, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the figures of all runs."""
    return {'setpoints': len(loop.times), 'rate [Hz]': RATE, 'bandwidth [Hz]': loop.bandwidth,
            'leg mass [kg]': loop.leg_mass, **loop.gains, 'units': UNITS,
            'runs': [{'feed_forward': run.feed_forward, 'payload': run.payload, 'rms': run.rms,
                      'peak': run.peak} for run in runs]}


def main() -> None:
    """Run the loop four times, print the table, draw the plot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml',
                        help='parameter file of the hexapod')
    parser.add_argument('--motion', type=Path, default=ROOT / 'config' / 'trajectory_loop.yaml',
                        help='parameter file of the motion, which must begin at rest')
    parser.add_argument('--seconds', type=float, default=10.0, help='duration of the motion [s]')
    parser.add_argument('--bandwidth', type=float, default=8.0,
                        help='natural frequency of a leg under PD control [Hz]')
    parser.add_argument('--output', type=Path, default=ROOT / 'looped',
                        help='folder for loop.json and loop.png')
    options = parser.parse_args()
    # Isolated from other ROS programs on this computer and its network.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    runs: list[Run] = []
    try:
        loop = Loop(options.params, options.motion, options.seconds, options.bandwidth)
        options.output.mkdir(parents=True, exist_ok=True)
        rclpy.init()
        print(f'each leg: {loop.bandwidth:g} Hz, damping ratio 1, with the {loop.leg_mass:.0f} kg '
              f'that it moves alone: {loop.gains["proportional_gain"]:.3g} N/m, '
              f'{loop.gains["derivative_gain"]:.3g} N s/m')
        begun = time.monotonic()
        with tqdm(total=4 * options.seconds, unit='s', ncols=79, mininterval=0.5,
                  bar_format='{desc} {bar} {n:.1f} of {total:.1f} s') as progress:
            for payload in (1.0, HEAVIER):
                for feed_forward in (False, True):
                    progress.set_description_str(
                        f'{"PD + forces" if feed_forward else "PD only"}, {payload_name(payload)}')
                    before = len(runs) * options.seconds
                    runs.append(loop.run(feed_forward, payload, lambda reached, before=before: (
                        progress.update(before + min(reached * 1e-9, options.seconds)
                                        - progress.n))))
        print(f'\n{table(runs)}\n')
        draw(options.output / 'loop.png', runs)
        (options.output / 'loop.json').write_text(
            json.dumps(summary(loop, runs), indent=1) + '\n', encoding='utf-8')
        print(f'{time.monotonic() - begun:.0f} s; {options.output}: loop.png, loop.json')
    except (Failure, StewartError, OSError) as exc:
        raise SystemExit(f'demo-loop: {exc}') from None
    except (KeyboardInterrupt, ExternalShutdownException):
        raise SystemExit(130) from None
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
