# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: PD control of the legs with the node's forces as feed-forward. Copy what you need.

It is not a part of the package, which computes forces and controls nothing. For each leg

    force = k_p (q_d - q) + k_d (v_d - v) + effort_d

with measured length q and rate v, and q_d, v_d, effort_d as published by stewart_dynamics. When
these stop, it holds the last q_d at rest, with the forces that carry the weight there.

Its parameters are those of ROS: --ros-args -p params_file:=FILE, proportional_gain [N/m],
derivative_gain [N s/m], timeout [s], feed_forward. Gains that are not given follow from
params_file: 8 Hz and a damping ratio of 1 with the mass that a leg moves at home while the other
five are held.
"""

import argparse
import math
import signal
import sys
import time

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import Motion, StewartError, StewartPlatform


FREQUENCY, DAMPING_RATIO = 8.0, 1.0  # [Hz], 1
# By the same rule, with the 160 kg of config/platform.yaml 1.1 m above its base.
EXAMPLE_GAINS = 4.0e5, 1.6e4


def gains(platform: StewartPlatform) -> tuple[float, float]:
    """Return proportional [N/m] and derivative gain [N s/m] for the largest mass of a leg."""
    home = platform.home_pose()
    to_twist = np.linalg.inv(platform.inverse_jacobian(home))
    # The mass that a leg moves while the other five are held.
    mass = np.diag(to_twist.T @ platform.mass_matrix(home) @ to_twist).max()
    omega = 2.0 * math.pi * FREQUENCY
    return float(mass * omega ** 2), float(2.0 * DAMPING_RATIO * mass * omega)


class LegController(Node):
    """
    Answers each measured state of the legs with six forces.

    In real time the controller follows the latest desired state that has forces; when none comes
    for the timeout, it holds the last one. With use_sim_time the simulation waits for each
    command: the controller waits for the desired state of the same stamp, and answers each stamp
    once.
    """

    def __init__(self) -> None:
        super().__init__('leg_controller')
        self.timeout = self.positive('timeout', 0.05, 'oldest desired state to follow [s]')
        self.feed_forward = self.constant('feed_forward', True, 'add the desired effort')
        self.stepped = self.get_parameter('use_sim_time').value
        self.platform = self.platform_of(self.constant(
            'params_file', '', 'of the hexapod, for the forces at rest'))
        k_p, k_d = gains(self.platform) if self.platform else EXAMPLE_GAINS
        self.k_p = self.positive('proportional_gain', k_p, 'force per length [N/m]')
        self.k_d = self.positive('derivative_gain', k_d, 'force per rate [N s/m]')
        self.measured = self.desired = self.answered = self.held = None
        self.commands = self.create_publisher(
            Float64MultiArray, 'stewart_simulator/commands', 1)
        self.create_subscription(
            JointState, 'stewart_simulator/leg_states', self.on_measured, 1)
        self.create_subscription(
            JointState, 'stewart_dynamics/leg_states', self.on_desired, 1)

    def constant(self, name: str, default: object, text: str) -> object:
        """Declare a read-only parameter and return its value."""
        return self.declare_parameter(
            name, default, ParameterDescriptor(description=text, read_only=True)).value

    def positive(self, name: str, default: float, text: str) -> float:
        """Declare a read-only parameter that is finite and not negative; return its value."""
        value = self.constant(name, default, text)
        if not 0.0 <= value < math.inf:
            raise ValueError(f'{name}: {value}: must be finite and at least 0')
        return value

    def platform_of(self, file: str) -> StewartPlatform | None:
        """Return the hexapod of a parameter file, its code compiled; stepped, it needs none."""
        if not file:
            if not self.stepped:
                raise ValueError('params_file: missing: it has the forces at rest, which hold the '
                                 'hexapod when desired states stop')
            return None
        platform = StewartPlatform.from_yaml(file)
        self.zero_length = platform.parameters.geometry.zero_length
        self.guess = platform.home_pose()
        lengths = platform.inverse_kinematics(self.guess)
        platform.inverse_dynamics(
            Motion.from_pose(platform.forward_kinematics(lengths, self.guess)))
        return platform

    def on_measured(self, state: JointState) -> None:
        self.measured = state
        self.command()

    def on_desired(self, state: JointState) -> None:
        if self.feed_forward and len(state.effort) != len(state.name):
            return self.no_command('no desired effort: forces suppressed or not computable')
        if self.held:
            self.get_logger().warning('desired states are back: they are followed')
        self.desired, self.desired_at, self.held = state, time.monotonic(), None
        if self.stepped:
            self.command()

    def at_rest(self, desired: JointState) -> JointState:
        """Return a desired state at rest in the position of another one."""
        effort = desired.effort
        try:
            if self.platform:
                pose = self.platform.forward_kinematics(
                    np.add(desired.position, self.zero_length), self.guess)
                effort = self.platform.inverse_dynamics(Motion.from_pose(pose)).forces
        except StewartError as exc:
            self.get_logger().error(f'the last forces are held: {exc}')
        return JointState(name=desired.name, position=desired.position,
                          velocity=[0.0] * len(desired.name), effort=effort)

    def command(self) -> None:
        """Publish the forces for the measured and the desired state, if both are there."""
        measured, desired = self.measured, self.desired
        if measured is None or desired is None:
            return
        if self.stepped:
            stamp = measured.header.stamp
            if (desired.header.stamp != stamp or self.answered == stamp
                    or not self.commands.get_subscription_count()):
                return
            self.answered = stamp
        elif time.monotonic() - self.desired_at > self.timeout:
            if self.held is None:
                self.get_logger().error(
                    f'no desired state for {self.timeout} s: the last position is held')
                self.held = self.at_rest(desired)
            desired = self.held
        if measured.name != desired.name:
            return self.no_command(f'{measured.name} measured, {desired.name} desired')
        force = (self.k_p * np.subtract(desired.position, measured.position)
                 + self.k_d * np.subtract(desired.velocity, measured.velocity))
        if self.feed_forward:
            force += desired.effort
        if not np.isfinite(force).all():
            return self.no_command(f'the forces are {force}')
        self.commands.publish(Float64MultiArray(data=force.tolist()))

    def no_command(self, why: str) -> None:
        self.get_logger().error(f'no command: {why}', throttle_duration_sec=1.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: signals.append(number))
    # The handlers of rclpy would shut ROS down in the middle of a callback.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'leg_controller: {exc}')
    parser.parse_args(remove_ros_args(sys.argv)[1:])
    executor = EventsExecutor()
    try:
        executor.add_node(LegController())
        while not signals:
            executor.spin_once(timeout_sec=0.1)
    except (InvalidParameterTypeException, StewartError, ValueError) as exc:
        sys.exit(f'leg_controller: {exc}')
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
