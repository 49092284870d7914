# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The node to compare with: it takes and publishes the same messages and computes nothing.

``typed`` is the usual way: rclpy's own messages, made once and used again. ``serialized`` is the
least possible from Python: bytes in, bytes out.
"""

from __future__ import annotations

from array import array
import sys
from typing import Any

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

QOS = QoSProfile(depth=1000)
TOPICS: dict[str, dict[str, Any]] = {
    'separate': {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped},
    'combined': {'combined': MultiDOFJointTrajectory}}
WAITING = 100  # samples of a topic, before the oldest is dropped


class PassThrough(Node):
    """
    Joins setpoints by their stamp and publishes four messages for each.

    Parameters
    ----------
    name : str
        Name of the node.
    source : str
        ``separate`` or ``combined``.
    serialized : bool
        Take and publish bytes.

    """

    def __init__(self, name: str, source: str, serialized: bool) -> None:
        super().__init__(name)
        self._waiting: dict[Any, int] = {}
        self._state = JointState(
            name=[f'leg_{n}' for n in range(1, 7)], position=array('d', [0.0] * 6),
            velocity=array('d', [0.0] * 6), effort=array('d', [0.0] * 6))
        self._six = Float64MultiArray(data=array('d', [0.0] * 6))
        self._one = Float64()
        self._state_bytes = bytearray(serialize_message(self._state))
        self._six_bytes = bytes(serialize_message(self._six))
        self._one_bytes = bytes(serialize_message(self._one))
        self._states, self._lengths, self._forces, self._determinant = (
            self.create_publisher(kind, f'~/{topic}', 10) for kind, topic in (
                (JointState, 'leg_states'), (Float64MultiArray, 'leg_lengths'),
                (Float64MultiArray, 'leg_forces'), (Float64, 'jacobian_determinant')))
        topics = TOPICS[source]
        self._topics = len(topics)
        for topic, kind in topics.items():
            self.create_subscription(
                kind, f'~/setpoint/{topic}', self._on_bytes if serialized else self._on_message,
                QOS, raw=serialized)

    def _complete(self, stamp: Any) -> bool:
        """Return whether this was the last of a setpoint's messages."""
        came = self._waiting.pop(stamp, 0) + 1
        if came == self._topics:
            return True
        self._waiting[stamp] = came
        if len(self._waiting) > WAITING:
            del self._waiting[next(iter(self._waiting))]
        return False

    def _on_message(self, message: Any) -> None:
        stamp = message.header.stamp
        if not self._complete((stamp.sec, stamp.nanosec)):
            return
        self._state.header.stamp = stamp
        self._states.publish(self._state)
        self._lengths.publish(self._six)
        self._forces.publish(self._six)
        self._determinant.publish(self._one)

    def _on_bytes(self, data: bytes) -> None:
        if not self._complete(data[4:12]):
            return
        self._state_bytes[4:12] = data[4:12]
        self._states.publish(bytes(self._state_bytes))
        self._lengths.publish(self._six_bytes)
        self._forces.publish(self._six_bytes)
        self._determinant.publish(self._one_bytes)


def spin(node: Node) -> None:
    """Spin until a signal."""
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_until_future_complete(Future(), 10.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()


def main() -> None:
    """Run it until a signal: name, source, typed or serialized."""
    name, source, how = sys.argv[1:4]
    rclpy.init(args=[])
    spin(PassThrough(name, source, how == 'serialized'))
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
