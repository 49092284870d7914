# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Record the bags in this folder: the setpoints that stewart_trajectory publishes.

``python bags/record.py`` records all of them again, ``python bags/record.py clear`` one. The
flawed bag is recorded through a relay that damages some of the messages.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
import random
import struct
import subprocess
import tempfile
import time
from typing import Any

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics.executables import executable
from stewart_dynamics.reference_motion.motion_functions import sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

HERE = Path(__file__).resolve().parent
NODE = 'stewart_dynamics'
TYPES = {'setpoint/pose': PoseStamped, 'setpoint/twist': TwistStamped,
         'setpoint/accel': AccelStamped}
QOS = QoSProfile(depth=1000)

# Name of the bag, the motion, and whether messages are damaged.
BAGS = {'singular': ('trajectory_singular.yaml', False), 'clear': ('trajectory_clear.yaml', False),
        'flawed': ('trajectory_clear.yaml', True)}


class Recorder(Node):
    """Writes each setpoint message, with the time when it was received."""

    def __init__(self, folder: Path) -> None:
        super().__init__('recorder')
        self.messages = 0
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        types = get_typestore(Stores.ROS2_JAZZY)
        for topic, kind in TYPES.items():
            connection = self._writer.add_connection(
                f'/{NODE}/{topic}', f'geometry_msgs/msg/{kind.__name__}', typestore=types)
            self.create_subscription(
                kind, f'/{NODE}/{topic}', self._writes(connection), QOS, raw=True)

    def _writes(self, connection: Any) -> Callable[[bytes], None]:
        def write(data: bytes) -> None:
            self.messages += 1
            self._writer.write(connection, time.time_ns(), data)
        return write

    def close(self) -> None:
        """Complete the bag."""
        self._writer.close()


class DamagingRelay(Node):
    """
    Publishes the messages of /undamaged/..., some of them damaged, the same in each run.

    One in a hundred each: dropped, published twice, published after the next one, and with its
    first number replaced by NaN.
    """

    def __init__(self) -> None:
        super().__init__('damaging_relay')
        self._random = random.Random(2018)
        self._held: dict[str, bytes] = {}
        for topic, kind in TYPES.items():
            publisher = self.create_publisher(kind, f'/{NODE}/{topic}', QOS)
            self.create_subscription(
                kind, f'/undamaged/{topic}', self._relay_of(topic, publisher), QOS, raw=True)

    def _relay_of(self, topic: str, publisher: Any) -> Callable[[bytes], None]:
        def relay(data: bytes) -> None:
            held = self._held.pop(topic, None)
            fault = self._random.randrange(100)
            if fault == 0:
                pass
            elif fault == 1:
                publisher.publish(data)
                publisher.publish(data)
            elif fault == 2:
                self._held[topic] = data
            elif fault == 3:
                # the doubles are at the end: 7 of a pose, 6 of the others
                first = len(data) - 8 * (7 if topic == 'setpoint/pose' else 6)
                publisher.publish(data[:first] + struct.pack('<d', float('nan'))
                                  + data[first + 8:])
            else:
                publisher.publish(data)
            if held is not None:
                publisher.publish(held)
        return relay


def record(name: str) -> None:
    """Record one bag, and replace the existing one when the new one is complete."""
    final = HERE / name
    with tempfile.TemporaryDirectory(dir=HERE, prefix='.') as hidden:
        partial = Path(hidden) / name
        messages = record_into(partial, name)
        if final.exists():
            final.rename(Path(hidden) / 'replaced')
        partial.rename(final)
    print(f'{final.relative_to(HERE.parent)}: {messages} messages, '
          f'{(final / f"{name}.mcap").stat().st_size} bytes')


def record_into(folder: Path, name: str) -> int:
    """Record one bag into a new folder, and return the number of its messages."""
    config, damaged = BAGS[name]
    recorder = Recorder(folder)
    nodes: list[Any] = [recorder, *([DamagingRelay()] if damaged else [])]
    executor = rclpy.executors.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    command = [executable('stewart_trajectory'), '--ros-args',
               '--params-file', HERE.parent / 'config' / config, '-p', 'start_timeout:=60.0',
               '-p', 'motion.hold_at_end:=false']
    if damaged:
        command += ['-p', 'target:=undamaged']
    with subprocess.Popen(command) as trajectory:
        quiet_since = time.monotonic()
        while trajectory.poll() is None or time.monotonic() - quiet_since < 1.0:
            before = recorder.messages
            executor.spin_once(timeout_sec=0.1)
            if recorder.messages != before or trajectory.poll() is None:
                quiet_since = time.monotonic()
    if trajectory.returncode:
        raise SystemExit(f'stewart_trajectory ended with exit code {trajectory.returncode}')
    expected = 3 * len(sample_times(ReferenceMotionParameters.from_yaml(
        HERE.parent / 'config' / config)))
    if not damaged and recorder.messages != expected:
        raise SystemExit(f'{name}: {recorder.messages} of {expected} messages received: record '
                         'again')
    recorder.close()
    for node in nodes:
        executor.remove_node(node)
        node.destroy_node()
    executor.shutdown()
    return recorder.messages


def main() -> None:
    """Record the bags named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('names', nargs='*', metavar='NAME',
                        help=f'one of {", ".join(BAGS)} (default: all)')
    names = parser.parse_args().names or list(BAGS)
    if unknown := [name for name in names if name not in BAGS]:
        parser.error(f'unknown bag {unknown[0]}')
    rclpy.init()
    try:
        for name in names:
            record(name)
    except (KeyboardInterrupt, ExternalShutdownException):
        raise SystemExit('record.py: interrupted') from None
    finally:
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
