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
Play the paper's bag into the real node in real time, and print the loads on the legs.

``make demo`` runs it. The bag's messages are published on ROS 2 topics as recorded, by another
process than the node.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import signal
import subprocess
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from stewart_dynamics.executables import executable
from stewart_dynamics.mechanics.rows import (
    DETERMINANT, FORCES, JOINT_ANGLES, LENGTHS, MOTION, RATES, RESULT)
from stewart_dynamics.mechanics.singularity_warning import CAUSE, STATE
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.summary import Answered, Summary
from stewart_dynamics.replay.summary_text import summary_lines
from stewart_dynamics.setpoints.step import Batch, Outputs
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
NODE = '/stewart_dynamics'
TYPES = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}
QOS = QoSProfile(depth=1000)


class Demo(Node):
    """Publishes a bag's setpoints when they are due, and keeps the node's answers."""

    def __init__(self, bag: Path) -> None:
        super().__init__('demo')
        self.states: list[JointState] = []
        self.determinants: list[float] = []
        self.warnings: list[tuple[int, bool]] = []
        self.diagnostics: dict[str, Any] = {}
        with AnyReader([bag]) as reader:
            self.messages = [(at, connection.topic, data)
                             for connection, at, data in reader.messages()]
        self.outputs = {f'{NODE}/setpoint/{name}': self.create_publisher(
            kind, f'{NODE}/setpoint/{name}', QOS) for name, kind in TYPES.items()}
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(JointState, f'{NODE}/leg_states', self.states.append, QOS)
        self.create_subscription(Float64, f'{NODE}/jacobian_determinant',
                                 lambda message: self.determinants.append(message.data), QOS)
        self.create_subscription(
            Bool, f'{NODE}/singularity_warning', self._on_warning, latched)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)

    def connected(self) -> bool:
        """Return whether all topics are connected in both directions."""
        return (all(p.get_subscription_count() for p in self.outputs.values())
                and all(self.count_publishers(f'{NODE}/{topic}') for topic in (
                    'leg_states', 'jacobian_determinant', 'singularity_warning'))
                # published once a second while the node is active
                and bool(self.diagnostics))

    def _on_warning(self, message: Bool) -> None:
        # The warning is published right after the state of the same setpoint.
        stamp = self.states[-1].header.stamp if self.states else None
        self.warnings.append((_nanoseconds(stamp) if stamp else 0, message.data))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id == NODE.strip('/'):
                self.diagnostics[status.name] = status


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _wait(executor: Any, what: str, seconds: float, done: Any, process: Any) -> None:
    end = time.monotonic() + seconds
    while not done():
        if process.poll() is not None:
            raise SystemExit(f'demo: the node ended with exit code {process.returncode}')
        if time.monotonic() > end:
            raise SystemExit(f'demo: {what} after {seconds:g} s')
        executor.spin_once(timeout_sec=0.05)


def play(demo: Demo, executor: Any, process: Any) -> None:
    """Publish the bag's messages at the intervals of their recording."""
    first = demo.messages[0][0]
    begun = time.monotonic_ns()
    last = (demo.messages[-1][0] - first) * 1e-9
    with tqdm(total=round(last, 1), unit='s', desc='playing', ncols=79, mininterval=0.5,
              bar_format='{desc} {bar} {n:.1f} of {total:.1f} s{postfix}') as progress:
        for recorded, topic, data in demo.messages:
            due = begun + recorded - first
            while (left := due - time.monotonic_ns()) > 0:
                executor.spin_once(timeout_sec=min(left * 1e-9, 0.05))
            demo.outputs[topic].publish(data)
            progress.set_postfix_str(f'{len(demo.states)} answers', refresh=False)
            progress.update((time.monotonic_ns() - begun) * 1e-9 - progress.n)
    expected = len(demo.messages) // len(demo.outputs)
    _wait(executor, f'only {len(demo.states)} of {expected} setpoints were answered', 10.0,
          lambda: len(demo.states) >= expected and len(demo.determinants) >= expected, process)


def report(demo: Demo, parameters: Parameters) -> str:
    """Return the table of the node's answers."""
    many = len(demo.states)
    stamps = np.array([_nanoseconds(state.header.stamp) for state in demo.states])
    forces = np.array([state.effort or [np.nan] * 6 for state in demo.states])
    results = np.full((many, RESULT), np.nan)  # nan: not published
    results[:, LENGTHS] = parameters['geometry.zero_length'] + [
        list(state.position) for state in demo.states]
    results[:, RATES] = [list(s.velocity) for s in demo.states]
    results[:, FORCES] = forces
    results[:, DETERMINANT] = demo.determinants[:many]
    states = np.full((many, STATE), np.nan)
    changes = np.searchsorted([stamp for stamp, _ in demo.warnings], stamps, side='right')
    states[:, CAUSE] = [changed > 0 and demo.warnings[changed - 1][1] for changed in changes]
    every, none = np.ones(many, dtype=bool), np.zeros(many, dtype=bool)
    summary = Summary(parameters)
    summary.add(Answered(
        (stamps - stamps[0]) * 1e-9,
        Batch(stamps, np.full((many, MOTION), np.nan), np.zeros((1, 6)), none,
              stamps),
        Outputs(every, stamps, results, forces, states, none, none,
                none, np.full((many, JOINT_ANGLES), np.nan), np.empty((many, 0)),
                np.empty((many, 0))),
        np.full((many, 6), np.nan)))
    return '\n'.join(summary_lines(summary.values()))


def main() -> None:
    """Run the node, play the bag, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--bag', type=Path, default=ROOT / 'bags' / 'singular')
    parser.add_argument('--params', type=Path, default=ROOT / 'config' / 'platform.yaml')
    options = parser.parse_args()
    # Isolated from other ROS programs on this computer and its network.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    parameters = Parameters.from_yaml(options.params)
    command = [executable('stewart_dynamics'), '--ros-args',
               '--params-file', options.params]
    replay = ' '.join(map(os.path.relpath, (
        executable('stewart_replay'), options.bag))) + (
        f' --params {os.path.relpath(options.params)}')
    rclpy.init()
    with subprocess.Popen(command) as process:
        try:
            demo = Demo(options.bag)
            executor = SingleThreadedExecutor()
            executor.add_node(demo)
            print(f'starting {NODE} with {options.params.name}; the first start compiles, which '
                  'takes seconds', flush=True)
            _wait(executor, 'the node is not active', 60.0, demo.connected, process)
            play(demo, executor, process)
            print()
            print(report(demo, parameters))
            print(f'\nreport of this bag, with plots and the hexapod in motion:\n  {replay}')
        except (KeyboardInterrupt, ExternalShutdownException):
            raise SystemExit(130) from None
        finally:
            process.send_signal(signal.SIGINT)
    executor.shutdown()
    rclpy.try_shutdown()
    if process.returncode:
        raise SystemExit(f'demo: the node ended with exit code {process.returncode}')


if __name__ == '__main__':
    main()
