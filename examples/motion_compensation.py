# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: keep the platform still in the world while its base moves. Copy what you need.

It subscribes to the motion of the base frame in the world, all in world axes: the three topics
stewart_simulator/base/pose, twist and accel, of one stamp. A ship has them from its motion
reference unit: an IMU alone has no position, its integral drifts. It publishes the setpoints of
stewart_dynamics, the exact inverse with its derivatives: the platform as the moving base sees it.

Setpoints go on from wherever the base is: start it while the platform is near its target. When
the motion of the base stops for the timeout, setpoints stop, and begin again with a restart only:
by then the base may be elsewhere, and the first setpoint would be a step.

Its parameters are those of ROS: --ros-args -p position:=[X,Y,Z] (of the platform in the world, m)
or -p params_file:=FILE (of the hexapod: its home position), angles (alpha, beta, gamma [rad]),
timeout [s], base_frame.
"""

import argparse
import signal
import sys
import time

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, Vector3
import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from stewart_dynamics import Motion, Pose, StewartError, StewartPlatform
from stewart_dynamics.ros.transports import leave_shared_memory

TYPES = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}


def seen_from(base: Motion, platform: Pose) -> Motion:
    """
    Return the motion, in base axes, of a platform at rest in the world.

    Parameters
    ----------
    base : Motion
        Motion of the base frame in the world, world axes.
    platform : Pose
        Pose of the platform frame in the world.

    """
    to_base = base.rotation.T
    w, dw = base.angular_velocity, base.angular_acceleration
    r, v, a = platform.position - base.position, -base.linear_velocity, -base.linear_acceleration
    return Motion(
        to_base @ r, to_base @ platform.rotation,
        to_base @ (v - np.cross(w, r)), -to_base @ w,
        to_base @ (a - np.cross(dw, r) - 2.0 * np.cross(w, v) + np.cross(w, np.cross(w, r))),
        -to_base @ dw)


class MotionCompensation(Node):
    """Answers each motion of the base with a setpoint of the same stamp."""

    def __init__(self) -> None:
        super().__init__('motion_compensation')
        file = self.constant('params_file', '', 'of the hexapod: its home position is the default')
        home = (StewartPlatform.from_yaml(file).home_pose().position.tolist() if file
                else Parameter.Type.DOUBLE_ARRAY)
        position = self.constant('position', home, 'of the platform in the world [m]')
        if position is None:
            raise StewartError('position or params_file: one must be given')
        angles = self.constant('angles', [0.0, 0.0, 0.0],
                               'alpha, beta, gamma of the platform in the world [rad]')
        self.target = Pose.from_euler(position, angles)
        self.timeout = self.constant('timeout', 0.1, 'without base motion, setpoints stop [s]')
        self.frame = self.constant('base_frame', 'base', 'of the setpoints')
        self.stepped = self.get_parameter('use_sim_time').value  # time waits for each command
        self.came, self.heard_at, self.stopped = {}, None, False
        self.outputs = {}
        for name, kind in TYPES.items():
            self.outputs[name] = self.create_publisher(
                kind, f'stewart_dynamics/setpoint/{name}', 10)
            self.create_subscription(
                kind, f'stewart_simulator/base/{name}',
                lambda message, name=name: self.on_base(name, message), 10)

    def constant(self, name: str, default: object, text: str) -> object:
        """Declare a read-only parameter and return its value."""
        return self.declare_parameter(
            name, default, ParameterDescriptor(description=text, read_only=True)).value

    def on_base(self, name: str, message: object) -> None:
        """Keep a message; publish once there is one of each topic with the same stamp."""
        self.came[name] = message
        stamps = [each.header.stamp for each in self.came.values()]
        if len(stamps) < len(TYPES) or any(stamp != stamps[0] for stamp in stamps):
            return
        pose, twist, accel = (self.came[name] for name in TYPES)
        self.came = {}
        self.check()
        self.heard_at = time.monotonic()
        if self.stopped:
            return self.get_logger().warning(
                'base motion is back, but setpoints have stopped: restart this node',
                throttle_duration_sec=1.0)
        self.publish(pose, twist.twist, accel.accel)

    def publish(self, at: PoseStamped, twist: object, accel: object) -> None:
        p, q = at.pose.position, at.pose.orientation
        try:
            setpoint = seen_from(Motion.from_quaternion(
                [p.x, p.y, p.z], [q.x, q.y, q.z, q.w], numbers(twist.linear),
                numbers(twist.angular), numbers(accel.linear), numbers(accel.angular)),
                self.target)
        except StewartError as exc:  # not finite, or no rotation
            self.get_logger().error(f'no setpoint: {exc}', throttle_duration_sec=1.0)
            return
        pose, twist, accel = (kind() for kind in TYPES.values())
        for message in (pose, twist, accel):
            message.header.stamp, message.header.frame_id = at.header.stamp, self.frame
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = setpoint.position.tolist()
        q.x, q.y, q.z, q.w = setpoint.quaternion.tolist()
        twist.twist.linear = vector(setpoint.linear_velocity)
        twist.twist.angular = vector(setpoint.angular_velocity)
        accel.accel.linear = vector(setpoint.linear_acceleration)
        accel.accel.angular = vector(setpoint.angular_acceleration)
        for name, message in zip(TYPES, (pose, twist, accel), strict=True):
            self.outputs[name].publish(message)

    def check(self) -> None:
        """Stop setpoints when the motion of the base has stopped, and say so."""
        if (self.stepped or self.stopped or self.heard_at is None
                or time.monotonic() - self.heard_at < self.timeout):
            return
        self.stopped = True
        self.get_logger().error(
            f'no base motion for {self.timeout} s: setpoints stop, until a restart')


def numbers(three: Vector3) -> list:
    return [three.x, three.y, three.z]


def vector(three: np.ndarray) -> Vector3:
    x, y, z = three.tolist()
    return Vector3(x=x, y=y, z=z)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: signals.append(number))
    # The handlers of rclpy would shut ROS down in the middle of a callback.
    # A process that joins could make publish() wait for a third of a second.
    leave_shared_memory()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'motion_compensation: {exc}')
    parser.parse_args(remove_ros_args(sys.argv)[1:])
    executor = EventsExecutor()
    try:
        node = MotionCompensation()
        executor.add_node(node)
        while not signals:
            executor.spin_once(timeout_sec=0.02)
            node.check()
    except (InvalidParameterTypeException, StewartError) as exc:
        sys.exit(f'motion_compensation: {exc}')
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
