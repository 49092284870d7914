# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: record topics into a bag, where there is no ros2 bag record. Copy what you need.

Without TOPIC it records joint_states and all topics of stewart_dynamics and stewart_simulator, in
any namespace, those that appear later, too; with --ros-args -r __ns:=/cell only those in /cell. It
ends with Ctrl-C, or after --duration; the bag is an MCAP for stewart_replay and stewart_identify,
and gets its name when it is complete. Only types of ROS itself can be recorded. Exit code: 0
recorded, 1 not, as without any message.
"""

import argparse
from functools import partial
import importlib
from pathlib import Path
import signal
import sys
import tempfile
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
NODES = ('/stewart_dynamics/', '/stewart_simulator/')
DEPTH = 1000  # messages that wait while the disk is slow


def message_class(kind: str) -> type | None:
    """Return the class of a type of ROS itself; None for others, and where it is not installed."""
    if kind not in TYPES.types:
        return None
    package, _, name = kind.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (AttributeError, ImportError):
        return None


class Recorder(Node):
    """Writes messages as they arrive, with the time of their arrival."""

    def __init__(self, topics: list[str], writer: Writer) -> None:
        super().__init__('bag_recorder')
        self.wanted, self.writer, self.counts = topics, writer, {}
        self.create_timer(0.5, self.look)
        self.look()

    def look(self) -> None:
        """Subscribe to topics that have appeared."""
        for topic, types in self.get_topic_names_and_types():
            is_wanted = topic in self.wanted if self.wanted else (
                topic.startswith(self.get_namespace()) and (
                    topic.endswith('/joint_states') or any(node in topic for node in NODES)))
            if is_wanted and topic not in self.counts and self.count_publishers(topic):
                self.counts[topic] = 0
                kind = message_class(types[0]) if len(types) == 1 else None
                if kind:
                    self.record(topic, types[0], kind)
                else:
                    print(f'{topic}: not recorded: {" and ".join(types)}', file=sys.stderr)

    def record(self, topic: str, name: str, kind: type) -> None:
        connection = self.writer.add_connection(topic, name, typestore=TYPES)
        # The strictest profile that all publishers match: latched messages are recorded as well.
        offered = [each.qos_profile for each in self.get_publishers_info_by_topic(topic)]
        qos = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if all(
                each.reliability == ReliabilityPolicy.RELIABLE for each in offered)
            else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if all(
                each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offered)
            else DurabilityPolicy.VOLATILE)
        self.create_subscription(
            kind, topic, partial(self.write, topic, connection), qos, raw=True)

    def write(self, topic: str, connection: object, data: bytes) -> None:
        self.writer.write(connection, self.get_clock().now().nanoseconds, data)
        self.counts[topic] += 1


def record(bag: Path, topics: list[str], duration: float, signals: list[int]) -> dict[str, int]:
    """Record until a signal or the end of the time; return the number of messages by topic."""
    if bag.exists() or bag.is_symlink():
        raise WriterError(f'{bag}: exists already')
    bag.parent.mkdir(parents=True, exist_ok=True)
    # The bag is moved to its name when it is complete; until then, it is in a hidden folder.
    with tempfile.TemporaryDirectory(dir=bag.parent, prefix='.record_bag.') as hidden:
        partial = Path(hidden) / bag.name
        with Writer(partial, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            recorder = Recorder(topics, writer)
            executor = SingleThreadedExecutor()
            executor.add_node(recorder)
            end = time.monotonic() + duration
            while not signals and time.monotonic() < end:
                executor.spin_once(timeout_sec=0.1)
        if any(recorder.counts.values()):
            try:
                partial.rename(bag)
            except OSError as exc:
                raise WriterError(f'{bag}: cannot be written: {exc.strerror}') from exc
    return recorder.counts


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('topics', nargs='*', metavar='TOPIC', help='with its namespace')
    parser.add_argument('--output', type=Path, default=Path('bag'), metavar='FOLDER',
                        help='the new folder of the bag (default: %(default)s)')
    parser.add_argument('--duration', type=float, default=float('inf'), help='[s]')
    signals: list[int] = []
    ending = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
        ending.append(signal.SIGHUP)
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'record_bag: {exc}')
    for each in ending:
        signal.signal(each, lambda number, _: signals.append(number))
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        counts = record(options.output, options.topics, options.duration, signals)
    except (OSError, WriterError) as exc:
        sys.exit(f'record_bag: {exc}')
    finally:
        for each in ending:
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()
    if not any(counts.values()):
        sys.exit('record_bag: no message was received on ' + (
            ', '.join(options.topics) or 'a topic of stewart_dynamics or stewart_simulator'))
    for topic, count in sorted(counts.items()):
        print(f'{count:8} {topic}')
    for topic in sorted(set(options.topics) - set(counts)):
        print(f'       0 {topic}: no publisher')


if __name__ == '__main__':
    main()
