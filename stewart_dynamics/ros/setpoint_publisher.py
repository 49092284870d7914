# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Publishes setpoints as the node stewart_dynamics takes them: on three topics, or combined."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from geometry_msgs.msg import (
    Accel, AccelStamped, Point, Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped,
    Vector3)
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header
from stewart_dynamics.parameters.table import COMBINED
from stewart_dynamics.ros.late_subscribers import for_late_subscribers
from stewart_dynamics.setpoints import input_messages as inputs
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

SetpointRow = Sequence[list[float]]
"""Position, quaternion x y z w, linear and angular velocity, and their derivatives."""


class SetpointPublisher:
    """
    Publishes setpoints to a node.

    target: name of the node. output: separate or combined. frame: of the setpoints.
    publishers: those of its topics.
    """

    def __init__(self, node: Node, target: str, output: str, frame: str) -> None:
        self._frame = frame
        self._combined = output == COMBINED
        self._last: tuple[Any, ...] = ()
        kinds = {inputs.COMBINED: MultiDOFJointTrajectory} if self._combined else {
            inputs.POSE: PoseStamped, inputs.TWIST: TwistStamped, inputs.ACCEL: AccelStamped}
        self.publishers = [
            node.create_publisher(
                kind, f'{target}/{topic}', QoSProfile(depth=1000),
                event_callbacks=for_late_subscribers(node, partial(self._publish_again, n)))
            for n, (topic, kind) in enumerate(kinds.items())]

    def publish(self, row: SetpointRow, stamp: Any) -> None:
        """Publish a setpoint with a stamp, a builtin_interfaces/Time."""
        header = Header(stamp=stamp, frame_id=self._frame)
        self._last = (_combined if self._combined else _separate)(header, row)
        for publisher, message in zip(self.publishers, self._last, strict=True):
            publisher.publish(message)

    def _publish_again(self, n: int) -> None:
        if self._last:
            self.publishers[n].publish(self._last[n])


def _separate(header: Header, row: SetpointRow) -> tuple[Any, ...]:
    position, quaternion, *rates = row
    linear, angular, linear_rate, angular_rate = map(_vector, rates)
    return (
        PoseStamped(header=header, pose=Pose(
            position=_xyz(Point, position), orientation=_quaternion(quaternion))),
        TwistStamped(header=header, twist=Twist(linear=linear, angular=angular)),
        AccelStamped(header=header, accel=Accel(linear=linear_rate, angular=angular_rate)))


def _combined(header: Header, row: SetpointRow) -> tuple[Any, ...]:
    position, quaternion, *rates = row
    linear, angular, linear_rate, angular_rate = map(_vector, rates)
    return (MultiDOFJointTrajectory(
        header=header, joint_names=['platform'],
        points=[MultiDOFJointTrajectoryPoint(
            transforms=[Transform(
                translation=_vector(position), rotation=_quaternion(quaternion))],
            velocities=[Twist(linear=linear, angular=angular)],
            accelerations=[Twist(linear=linear_rate, angular=angular_rate)])]),)


def _xyz(kind: Any, three: list[float]) -> Any:
    return kind(x=three[0], y=three[1], z=three[2])


def _vector(three: list[float]) -> Any:
    return _xyz(Vector3, three)


def _quaternion(four: list[float]) -> Any:
    return Quaternion(x=four[0], y=four[1], z=four[2], w=four[3])
