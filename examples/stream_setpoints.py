# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: stream setpoints, from where the hexapod is. Copy what you need; put in your own stream.

Before the stream, an approach: a motion from rest in the pose of the measured legs,
stewart_dynamics/measured_legs, to the first setpoint, checked for limits and singularities. The
hexapod must be at rest. The pose of the measured legs is repeated until stewart_dynamics answers;
then the motion begins. It ends with Ctrl-C: what the hexapod does then is up to its controller.
Where the topic of the measured legs is another, remap it:
--ros-args -r stewart_dynamics/measured_legs:=/joint_states
Exit code: 0 ended with Ctrl-C, 1 not started.
"""

import argparse
from collections.abc import Callable
from functools import partial
import math
from pathlib import Path
import signal
import sys
import time

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, Vector3
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState
from stewart_dynamics import approach, Capability, Motion, Pose, StewartError, StewartPlatform
from stewart_dynamics.messages.received import checked_joints, ReceivedError
from stewart_dynamics.ros.transports import leave_shared_memory

CONFIG = Path(__file__).resolve().parents[1] / 'config'
RATE = 100.0  # setpoints per second


def height(platform: StewartPlatform) -> float:
    """Return how far the stream goes up: 60 mm, at most a quarter of the way that is free [m]."""
    up = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    return min(0.06, 0.25 * float(Capability(platform).travel(platform.home_pose(), up).value))


def setpoint(home: Pose, most: float, seconds: float) -> Motion:
    """Return the setpoint at a time of the stream: here up from home and back, at 0.2 Hz."""
    w, up = 2.0 * math.pi * 0.2, np.array([0.0, 0.0, 0.5 * most])
    return Motion(
        position=home.position + up * (1.0 - math.cos(w * seconds)), rotation=home.rotation,
        linear_velocity=up * w * math.sin(w * seconds),
        linear_acceleration=up * w * w * math.cos(w * seconds))


class Stream(Node):
    """Reads the measured legs and publishes setpoints."""

    def __init__(self, platform: StewartPlatform) -> None:
        super().__init__('stream')
        self.platform, self.answered, self.sent = platform, False, 0
        self.setpoint = partial(setpoint, platform.home_pose(), height(platform))
        self.legs: dict[str, float] = {}
        self.measured = self.create_subscription(
            JointState, 'stewart_dynamics/measured_legs', self.on_legs, qos_profile_sensor_data)
        self.create_subscription(
            JointState, 'stewart_dynamics/leg_states', self.on_answer, qos_profile_sensor_data)
        self.outputs = [self.create_publisher(kind, f'stewart_dynamics/setpoint/{name}', 10)
                        for name, kind in (('pose', PoseStamped), ('twist', TwistStamped),
                                           ('accel', AccelStamped))]

    def on_legs(self, message: JointState) -> None:
        try:
            found = checked_joints(message)['position']
        except ReceivedError as exc:
            self.get_logger().warning(
                f'measured legs dropped: {exc}', throttle_duration_sec=5.0)
            return
        self.legs = dict(zip(message.name, found, strict=True))

    def on_answer(self, message: JointState) -> None:
        self.answered |= len(message.effort) > 0  # forces flow

    def until(self, done: Callable[[], bool], timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not done() and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.1)
        return done()

    def present_pose(self, timeout: float) -> Pose:
        """Return the pose of the measured legs; exit with one line without them."""
        names = self.platform.parameters.joints
        if not self.until(lambda: set(names) <= set(self.legs), timeout):
            sys.exit(f'no measured legs {", ".join(names)} on {self.measured.topic_name} within '
                     f'{timeout:g} s; is the topic remapped? See --help')
        positions = [self.legs[name] for name in names]
        return self.platform.forward_kinematics(
            self.platform.parameters.geometry.zero_length + positions)

    def begin(self, timeout: float) -> None:
        """Publish the approach and then the stream; exit with one line without an answer."""
        # Give a wrench or a base here if the node has one: forces have a limit.
        _, self.before = approach(
            self.platform, self.present_pose(timeout), self.setpoint(0.0), rate=RATE)
        self.index, self.first_stamp = 0, self.get_clock().now().nanoseconds
        self.create_timer(1.0 / RATE, self.publish_next)
        if not self.until(lambda: self.answered, timeout):
            sys.exit(f'no answer with forces within {timeout:g} s: see /diagnostics')
        print(f'approach over {(len(self.before) - 1) / RATE:g} s', flush=True)

    def publish_next(self) -> None:
        if self.index < len(self.before):
            motion = self.before[self.index]
        else:
            motion = self.setpoint((self.index - len(self.before) + 1) / RATE)
        pose, twist, accel = messages = PoseStamped(), TwistStamped(), AccelStamped()
        # Stamps follow the motion, not the clock: a late timer causes no jump in the setpoints.
        stamp = Time(nanoseconds=self.first_stamp + round(self.sent * 1e9 / RATE)).to_msg()
        for message in messages:
            message.header.stamp = stamp
            message.header.frame_id = self.platform.parameters.base_frame
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = motion.position.tolist()
        q.x, q.y, q.z, q.w = motion.quaternion.tolist()
        twist.twist.linear = vector(motion.linear_velocity)
        twist.twist.angular = vector(motion.angular_velocity)
        accel.accel.linear = vector(motion.linear_acceleration)
        accel.accel.angular = vector(motion.angular_acceleration)
        for output, message in zip(self.outputs, messages, strict=True):
            output.publish(message)
        self.sent += 1
        self.index += self.answered


def vector(three: np.ndarray) -> Vector3:
    x, y, z = three.tolist()
    return Vector3(x=x, y=y, z=z)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--params', type=Path, default=CONFIG / 'platform.yaml', metavar='FILE',
                        help="the node's parameters")
    parser.add_argument('--timeout', type=float, default=10.0,
                        help='for measured legs, and for the first answer of the node [s]')
    # The handlers of rclpy would shut ROS down in the middle of a call.
    # A process that joins could make publish() wait for a third of a second.
    leave_shared_memory()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'stream_setpoints: {exc}')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        stream = Stream(StewartPlatform.from_yaml(options.params))
        stream.begin(options.timeout)
        signals: list[int] = []
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, lambda number, frame: signals.append(number))
        while not signals:
            rclpy.spin_once(stream, timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    except StewartError as exc:  # parameters, measured legs or approach
        sys.exit(str(exc))
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
