# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A program that publishes setpoints, and one that hears what the node answers.

The tests start and kill it, often; so it imports no more than it needs.
"""

from __future__ import annotations

from contextlib import suppress
import signal
from struct import pack
import sys
import time

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

NODE = '/stewart_dynamics'
TYPES = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped,
         'combined': MultiDOFJointTrajectory}
QOS = QoSProfile(depth=2000)


def feed(rate: float, first: int, step: int, many: int, messages: dict[str, bytes]) -> None:
    """
    Publish the same messages over and over, with other stamps, and end when all have come.

    Parameters
    ----------
    rate : float
        In a second.
    first, step : int
        The first stamp, and how far each is from the one before [ns].
    many : int
        How often.
    messages : dict of topic and bytes
        Under the node's name.

    """
    node = rclpy.create_node('feeder')
    parts = [(node.create_publisher(TYPES[topic.rpartition('/')[2]], f'{NODE}/{topic}', QOS),
              message) for topic, message in messages.items()]
    signal.sigwait({signal.SIGUSR1})
    while not all(publisher.get_subscription_count() for publisher, _ in parts):
        time.sleep(0.01)  # the node knows us, but not yet we the node
    begun = time.monotonic()
    for n in range(many):
        time.sleep(max(0.0, begun + n / rate - time.monotonic()))
        stamp = pack('<iI', *divmod(first + n * step, 1_000_000_000))
        for publisher, message in parts:
            publisher.publish(message[:4] + stamp + message[12:])
    for publisher, _ in parts:
        publisher.wait_for_all_acked(Duration(seconds=60))


def hear() -> None:
    """Subscribe to the outputs of the node, as controller and RViz do, until interrupted."""
    node = rclpy.create_node('controller')
    for topic, kind in (('leg_states', JointState), ('leg_forces', Float64MultiArray),
                        ('markers', MarkerArray)):
        node.create_subscription(kind, f'{NODE}/{topic}', lambda message: None, QOS)
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=1.0)


if __name__ == '__main__':
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    rclpy.init()
    with suppress(RCLError):  # interrupted while it publishes
        if sys.argv[1:]:
            feed(float(sys.argv[1]), *map(int, sys.argv[2:5]), {
                topic: bytes.fromhex(message) for topic, message in zip(
                    sys.argv[5::2], sys.argv[6::2], strict=True)})
        else:
            hear()
    rclpy.try_shutdown()
