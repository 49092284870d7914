# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A program for the security tests: source, receiver or intruder, depending on its environment.

``python participant.py MARK`` sends setpoints, unless MARK is 0, and listens to what the node
sends and hears. The last three digits of its stamps are MARK. Five times per second it prints a
line of JSON: the number of setpoints sent, the messages received from others by topic and mark,
the nodes discovered, and the last diagnostics of the setpoints.

It imports few modules, because the tests start many of these programs.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
import json
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, Point, Pose, PoseStamped, TwistStamped
import rclpy
from rclpy.qos import QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header

NODE = '/stewart_dynamics'
SETPOINTS: dict[str, Any] = {
    'setpoint/pose': PoseStamped, 'setpoint/twist': TwistStamped, 'setpoint/accel': AccelStamped}
ANSWERS: dict[str, Any] = {
    'leg_states': JointState, 'leg_forces': Float64MultiArray, 'jacobian_determinant': Float64}
HOME = {'setpoint/pose': {'pose': Pose(position=Point(z=1.1))}}

_SECONDS = 0.05  # between two setpoints
_SETPOINTS_A_LINE = 4


class Participant:
    """Publishes and receives messages, and counts the received ones."""

    def __init__(self, mark: int) -> None:
        self.mark = mark
        self.node = rclpy.create_node(f'participant_{mark}')
        self.heard: Counter[str] = Counter()
        self.diagnostics: dict[str, str] = {}
        qos = QoSProfile(depth=1000)
        for topic, kind in {**SETPOINTS, **ANSWERS}.items():
            self.node.create_subscription(
                kind, f'{NODE}/{topic}', partial(self._on_message, topic), qos)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, qos)
        self.writers = {topic: self.node.create_publisher(kind, f'{NODE}/{topic}', qos)
                        for topic, kind in SETPOINTS.items() if mark}

    def _on_message(self, topic: str, message: Any) -> None:
        mark = message.header.stamp.nanosec % 1000 if hasattr(message, 'header') else 0
        if topic in ANSWERS or mark != self.mark:  # it hears its own setpoints as well
            self.heard[f'{topic} {mark}'] += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.heard['diagnostics 0'] += 1
        self.diagnostics = {
            pair.key: pair.value for status in message.status
            if status.name.endswith(': setpoints') for pair in status.values}

    def send(self) -> None:
        """Publish a setpoint: rest at home."""
        stamp = Time(nanoseconds=time.time_ns() // 1000 * 1000 + self.mark).to_msg()
        for topic, writer in self.writers.items():
            writer.publish(SETPOINTS[topic](
                header=Header(stamp=stamp, frame_id='base'), **HOME.get(topic, {})))

    def run(self) -> None:
        """Run until the program is terminated."""
        sent = 0
        while True:
            due = time.monotonic() + _SECONDS
            self.send()
            sent += 1
            while (left := due - time.monotonic()) > 0:
                rclpy.spin_once(self.node, timeout_sec=left)
            if sent % _SETPOINTS_A_LINE == 0:
                print(json.dumps({
                    'sent': sent, 'heard': self.heard, 'diagnostics': self.diagnostics,
                    'nodes': sorted(set(self.node.get_node_names()))}), flush=True)


if __name__ == '__main__':
    rclpy.init()
    Participant(int(sys.argv[1])).run()
