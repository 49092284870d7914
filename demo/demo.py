# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Play the paper's bag into the real node in real time, and print the loads on the legs.

``make demo`` runs it. The bag's messages are published on ROS 2 topics as recorded, by another
process than the node. The table is that of a replay, which knows the demanded forces, too; the
node's answers are compared with those of the replay.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
import os
from pathlib import Path
import signal
import subprocess
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from stewart_dynamics.bags.find import OUTPUT_BAG
from stewart_dynamics.executables import executable
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.replay.one_bag import replay
from stewart_dynamics.replay.replay_options import Options
from stewart_dynamics.replay.summary_text import summary_lines
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
BAG, PARAMETERS = ROOT / 'bags' / 'singular', ROOT / 'config' / 'platform.yaml'
EXPLANATION = """\
This motion crosses a singularity, where forces grow without bound: 2.5 MN on legs of 6 kN below.
The node warns 0.9 s before the crossing, and clips the forces that it publishes."""
NODE = '/stewart_dynamics'
LEG_STATES = f'{NODE}/leg_states'
TYPES = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}
QOS = QoSProfile(depth=1000)


class Demo(Node):
    """Publishes a bag's setpoints when they are due, and keeps the node's answers."""

    def __init__(self, bag: Path) -> None:
        super().__init__('demo')
        self.states: list[JointState] = []
        self.diagnostics: dict[str, Any] = {}
        with AnyReader([bag]) as reader:
            self.messages = [(at, connection.topic, data)
                             for connection, at, data in reader.messages()]
        self.outputs = {f'{NODE}/setpoint/{name}': self.create_publisher(
            kind, f'{NODE}/setpoint/{name}', QOS) for name, kind in TYPES.items()}
        self.create_subscription(JointState, LEG_STATES, self.states.append, QOS)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)

    def connected(self) -> bool:
        """Return whether all topics are connected in both directions."""
        return (all(p.get_subscription_count() for p in self.outputs.values())
                and self.count_publishers(LEG_STATES) > 0
                # published once a second while the node is active
                and bool(self.diagnostics))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.hardware_id == NODE.strip('/'):
                self.diagnostics[status.name] = status


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
          lambda: len(demo.states) >= expected, process)


def report(demo: Demo, bag: Path, parameters: Parameters) -> str:
    """Return the summary of the bag's replay, and how far the node's answers are the same."""
    with tempfile.TemporaryDirectory() as folder:
        replayed = replay(bag, parameters, Path(folder) / 'replayed', Options(report=False))
        with AnyReader([replayed.folder / OUTPUT_BAG]) as reader:
            of_replay = _forces(
                reader.deserialize(data, connection.msgtype)
                for connection, _, data in reader.messages()
                if connection.topic == LEG_STATES)
    of_node = _forces(demo.states)
    equal = sum(of_replay.get(stamp) == forces for stamp, forces in of_node.items())
    return '\n'.join([
        f'the node has answered {len(of_node)} of {len(of_replay)} setpoints, {equal} of them '
        'with the forces that a replay publishes, to the last digit; the replay:', '',
        *summary_lines(replayed.summary)])


def _forces(states: Iterable[Any]) -> dict[tuple[int, int], list[float]]:
    """Return the published forces of leg states by their stamp; empty where suppressed."""
    return {(state.header.stamp.sec, state.header.stamp.nanosec): list(state.effort)
            for state in states}


def main() -> None:
    """Run the node, play the bag, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--bag', type=Path, default=BAG)
    parser.add_argument('--params', type=Path, default=PARAMETERS)
    options = parser.parse_args()
    # Isolated from other ROS programs on this computer and its network.
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(os.getpid() % 100 + 1))
    parameters = Parameters.from_yaml(options.params)
    command = [executable('stewart_dynamics'), '--ros-args',
               '--params-file', options.params]
    shown = ' '.join(map(os.path.relpath, (
        executable('stewart_replay'), options.bag))) + (
        f' --params {os.path.relpath(options.params)}')
    rclpy.init()
    with subprocess.Popen(command) as process:
        try:
            demo = Demo(options.bag)
            executor = SingleThreadedExecutor()
            executor.add_node(demo)
            if (options.bag, options.params) == (BAG, PARAMETERS):
                print(EXPLANATION)
            print(f'starting {NODE} with {options.params.name}', flush=True)
            _wait(executor, 'the node is not active', 60.0, demo.connected, process)
            play(demo, executor, process)
            print()
            print(report(demo, options.bag, parameters))
            print(f'\nreport of this bag, with plots and the hexapod in motion:\n  {shown}')
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
