# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: get the leg trajectory of a planned trajectory from stewart_dynamics. Copy what you need.

The trajectory leads from pose to pose, at rest at both ends; without --from it starts where the
measured legs are. It is published as a whole on stewart_dynamics/platform_trajectory; the answer
on stewart_dynamics/leg_trajectory is what a joint_trajectory_controller takes. A rejected one has
no answer: /diagnostics states the reason.
Where the node's topics are remapped, remap those of this program, too:
--ros-args -r stewart_dynamics/leg_trajectory:=/leg_trajectory_controller/joint_trajectory
-r stewart_dynamics/measured_legs:=/joint_states
Exit code: 0 accepted, 1 not.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
import signal
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState
from stewart_dynamics import Capability, Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames.rotation import to_euler, to_quaternion
from stewart_dynamics.messages.received import (
    checked_joints, checked_numbers, ReceivedError, shown_text)
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from trajectory_msgs.msg import (
    JointTrajectory, MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint)

CONFIG = Path(__file__).resolve().parents[1] / 'config'


def vector(three: np.ndarray) -> Vector3:
    x, y, z = three.tolist()
    return Vector3(x=x, y=y, z=z)


def trajectory(start: list, end: list, duration: float) -> MultiDOFJointTrajectory:
    """Return a motion from pose to pose, X Y Z alpha beta gamma [m, rad], of a duration [s]."""
    parameters = ReferenceMotionParameters({
        'motion.type': 'quintic', 'motion.initial': start, 'motion.final': end,
        'motion.duration': duration, 'rate': 100.0})
    times = sample_times(parameters)  # [ns], a point every 10 ms
    return message_of(times, motion_at(parameters, times * 1e-9))


def from_file(path: Path) -> MultiDOFJointTrajectory:
    """Return the motion of a file of stewart_calibrate --design."""
    try:
        rows = np.loadtxt(path, delimiter=',', skiprows=1, ndmin=2)
        parts = [rows[:, n:n + 3] for n in range(8, 20, 3)]
        motion = Motion.from_quaternion(rows[:, 1:4], rows[:, 4:8], *parts)
    except (OSError, ValueError) as exc:
        sys.exit(f'{path}: cannot be read: {exc}')
    return message_of(np.rint(rows[:, 0] * 1e9).astype(np.int64), motion)


def message_of(times: np.ndarray, motion: Motion) -> MultiDOFJointTrajectory:
    """Return a motion as a message; times in ns."""
    message = MultiDOFJointTrajectory(joint_names=['platform'])
    message.header.frame_id = 'base'
    # A stamp of zero: the controller starts at once.
    for n, (x, y, z, w) in enumerate(to_quaternion(motion.rotation).tolist()):
        message.points.append(MultiDOFJointTrajectoryPoint(
            transforms=[Transform(translation=vector(motion.position[n]),
                                  rotation=Quaternion(x=x, y=y, z=z, w=w))],
            # Twist of the platform's origin, in base axes.
            velocities=[Twist(linear=vector(motion.linear_velocity[n]),
                              angular=vector(motion.angular_velocity[n]))],
            accelerations=[Twist(linear=vector(motion.linear_acceleration[n]),
                                 angular=vector(motion.angular_acceleration[n]))],
            time_from_start=Time(nanoseconds=int(times[n])).to_msg()))
    return message


class Planner(Node):
    """Publishes trajectories and keeps the answers."""

    def __init__(self) -> None:
        super().__init__('planner')
        self.answers, self.connected, self.rejected, self.reason = [], False, 0, ''
        self.motions = self.create_publisher(
            MultiDOFJointTrajectory, 'stewart_dynamics/platform_trajectory', 1)
        self.answer = self.create_subscription(
            JointTrajectory, 'stewart_dynamics/leg_trajectory', self.on_answer, 1)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)
        self.legs: dict[str, float] = {}
        self.measured = self.create_subscription(
            JointState, 'stewart_dynamics/measured_legs', self.on_legs, qos_profile_sensor_data)

    def on_legs(self, message: JointState) -> None:
        try:
            found = checked_joints(message)['position']
        except ReceivedError as exc:
            self.get_logger().warning(
                f'measured legs dropped: {exc}', throttle_duration_sec=5.0)
            return
        self.legs = dict(zip(message.name, found, strict=True))

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.connected |= status.name.startswith('stewart_dynamics: ')
            if status.name == 'stewart_dynamics: planned trajectory':
                count = {pair.key: pair.value for pair in status.values}.get('rejected', '')
                if count.isdecimal():
                    self.rejected, self.reason = int(count), shown_text(status.message)

    def on_answer(self, message: JointTrajectory) -> None:
        try:
            legs = len(message.joint_names)
            for n, point in enumerate(message.points):
                checked_numbers(f'points[{n}]', point.positions, legs)
                checked_numbers(f'points[{n}]: effort', point.effort, len(point.effort))
            if not message.points:
                raise ReceivedError('no points')
        except ReceivedError as exc:
            self.get_logger().warning(f'answer dropped: {exc}')
            return
        self.answers.append(message)

    def missing(self) -> str:
        """List missing connections: the node answers only once."""
        ends = {f'subscriber on {self.motions.topic_name}': self.motions.get_subscription_count(),
                # which follows remaps
                f'publisher on {self.answer.topic_name}':
                    self.count_publishers(self.answer.topic_name),
                'diagnostics of stewart_dynamics': self.connected}
        return ', '.join(f'no {end}' for end, there in ends.items() if not there)

    def until(self, done: Callable[[], bool], timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not done() and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.1)
        return done()


def ask(planner: Planner, motion: MultiDOFJointTrajectory, timeout: float) -> JointTrajectory:
    """Return the answer to a trajectory; without an answer, exit with one line."""
    if not planner.until(lambda: not planner.missing(), timeout):
        sys.exit(f'{planner.missing()} within {timeout:g} s; are topics remapped? See --help')
    before = planner.rejected
    planner.motions.publish(motion)
    if not planner.until(lambda: planner.answers or planner.rejected > before, timeout):
        sys.exit(f'no answer within {timeout:g} s')
    if not planner.answers:
        sys.exit(planner.reason)
    return planner.answers[0]


def present_pose(planner: Planner, params: Path, timeout: float) -> list:
    """Return X Y Z alpha beta gamma of the measured legs; exit with one line without them."""
    platform = StewartPlatform.from_yaml(params)
    names = platform.parameters.joints
    if not planner.until(lambda: set(names) <= set(planner.legs), timeout):
        sys.exit(f'no measured legs {", ".join(names)} on {planner.measured.topic_name} within '
                 f'{timeout:g} s; give --from, or remap the topic')
    lengths = platform.parameters.geometry.zero_length + [planner.legs[name] for name in names]
    pose = platform.forward_kinematics(lengths, platform.home_pose())
    return [*pose.position.tolist(), *to_euler(pose.rotation).tolist()]


def above_home(params: Path) -> list:
    """Return X Y Z alpha beta gamma of a pose that is reached from the home pose."""
    platform = StewartPlatform.from_yaml(params)
    home = platform.home_pose()
    free = float(Capability(platform).travel(home, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).value)
    x, y, z = home.position.tolist()
    return [x, y, z + min(0.06, 0.25 * free), *to_euler(home.rotation).tolist()]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    pose = {'nargs': 6, 'type': float, 'metavar': ('X', 'Y', 'Z', 'ALPHA', 'BETA', 'GAMMA')}
    parser.add_argument('--from', dest='start', help='[m, rad]; default: the pose of the measured '
                        'legs, on stewart_dynamics/measured_legs', **pose)
    parser.add_argument('--params', type=Path, default=CONFIG / 'platform.yaml', metavar='FILE',
                        help="the node's parameters, for the pose of the measured legs, home and "
                        'the unit of efforts')
    parser.add_argument('--to', help='[m, rad]; default: 60 mm above the home pose, or a quarter '
                        'of the way that is free there', **pose)
    parser.add_argument('--file', type=Path, metavar='CSV',
                        help='trajectory.csv of stewart_calibrate --design, instead of two poses')
    parser.add_argument('--duration', type=float, default=2.0, help='[s]')
    parser.add_argument('--timeout', type=float, default=10.0,
                        help='for the node to appear, and to answer [s]')
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'plan_motion: {exc}')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        planner = Planner()
        if options.file:
            motion = from_file(options.file)
        else:
            start = options.start or present_pose(planner, options.params, options.timeout)
            end = options.to or above_home(options.params)
            motion = trajectory(start, end, options.duration)
        answer = ask(planner, motion, options.timeout)
    except KeyboardInterrupt:
        sys.exit(130)
    except StewartError as exc:
        sys.exit(str(exc))
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()
    last = answer.points[-1].time_from_start
    line = f'accepted: {len(answer.points)} points over {last.sec + 1e-9 * last.nanosec:g} s'
    if all(len(point.effort) for point in answer.points):  # the node's trajectory.effort
        unit = Parameters.from_yaml(options.params).leg_kind.effort.unit
        line += f', largest effort {max(np.abs(p.effort).max() for p in answer.points):.0f} {unit}'
    print(line)


if __name__ == '__main__':
    main()
