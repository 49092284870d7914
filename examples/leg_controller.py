# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: PD control of the legs with the node's forces as feed-forward. Copy what you need.

It is not a part of the package, which computes forces and controls nothing. For each leg

    force = k_p (q_d - q) + k_d (v_d - v) + effort_d

with measured length q and rate v, and q_d, v_d, effort_d as published by stewart_dynamics. When
these stop, it holds the last q_d at rest, with the forces that carry the weight there. After that,
after any other gap, and at the start, the hexapod is elsewhere: it goes from the measured lengths
to the desired ones within RETURN_SPEED. Forces are at most limits.force_max of params_file. Of
cranks q is the angle and the force is the torque of the shaft, at most limits.torque_max.

With use_sim_time the simulation waits for each command, so that there are no gaps.

Its parameters are those of ROS: --ros-args -p params_file:=FILE, proportional_gain [N/m, N m/rad],
derivative_gain [N s/m, N m s/rad], timeout [s], feed_forward. Gains that are not given follow from
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
from stewart_dynamics.messages.received import checked_joints, ReceivedError
from stewart_dynamics.ros.transports import leave_shared_memory


FREQUENCY, DAMPING_RATIO = 8.0, 1.0  # [Hz], 1
# By the same rule, with the 160 kg of config/platform.yaml 1.1 m above its base.
EXAMPLE_GAINS = 4.0e5, 1.6e4
RETURN_SPEED, RETURN_TIME = 0.1, 0.5  # to what is desired: at most [m/s, rad/s], at least [s]
PATIENCE = 2.0  # with use_sim_time: a longer wait is logged, and then every 5 s [s]
REPEATS = 20  # of a state that was answered: the simulator has lost the answer, or is a new one


def gains(platform: StewartPlatform) -> tuple[float, float]:
    """Return proportional [N/m] and derivative gain [N s/m] for the largest mass of a leg."""
    home = platform.home_pose()
    to_twist = np.linalg.inv(platform.drive_jacobian(home))
    # The mass that a leg moves while the other five are held.
    mass = np.diag(to_twist.T @ platform.mass_matrix(home) @ to_twist).max()
    omega = 2.0 * math.pi * FREQUENCY
    return float(mass * omega ** 2), float(2.0 * DAMPING_RATIO * mass * omega)


def return_offset(offset: np.ndarray, rate: np.ndarray, elapsed: float,
                  duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Return an offset [m] and its rate [m/s] on the way to zero: quintic polynomials."""
    u = min(elapsed / duration, 1.0)
    left = 1.0 - u
    return (left ** 3 * ((1.0 + u * (3.0 + 6.0 * u)) * offset
                         + u * (1.0 + 3.0 * u) * duration * rate),
            left ** 2 * (-30.0 * u ** 2 / duration * offset
                         + (1.0 + 5.0 * u) * (1.0 - 3.0 * u) * rate))


class LegController(Node):
    """
    Answers each measured state of the legs with six forces.

    In real time the controller follows the latest desired state that has forces; when it is older
    than the timeout, it is held. With use_sim_time the simulation waits for each command: the
    controller waits for the desired state of the same stamp, and answers each stamp once.
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
        self.followed_at, self.offset = -math.inf, 0.0  # real time; [m] from the desired lengths
        self.repeats, self.waits_since = 0, time.monotonic()  # with use_sim_time
        self.force_max = np.inf
        if self.platform:
            limit = self.platform.parameters.leg_kind.effort_limit
            if self.platform.parameters[limit] is not None:
                self.force_max = self.platform.parameters[limit]
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
        positions = platform.inverse_kinematics(self.guess)
        platform.inverse_dynamics(
            Motion.from_pose(platform.forward_kinematics(positions, self.guess)))
        return platform

    def on_measured(self, state: JointState) -> None:
        try:
            checked_joints(state, fields=('position', 'velocity'))
        except ReceivedError as exc:
            return self.no_command(f'measured: {exc}')
        self.measured = state
        if self.stepped and state.header.stamp == self.answered:
            self.repeats += 1
            if self.repeats == REPEATS:
                self.answered = None
        self.command()

    def on_desired(self, state: JointState) -> None:
        if self.feed_forward and not state.effort:
            return self.no_command('no desired effort: forces suppressed or not computable')
        try:
            checked_joints(state, fields=('position', 'velocity', 'effort')[
                :2 + self.feed_forward])
        except ReceivedError as exc:
            return self.no_command(f'desired: {exc}')
        if self.held:
            self.get_logger().warning('desired states are back: they are followed')
        self.desired, self.desired_at, self.held = state, time.monotonic(), None
        if self.stepped:
            self.command()

    def at_rest(self, desired: JointState) -> JointState:
        """Return a desired state at rest in the position that was followed last."""
        effort, position = desired.effort, np.add(desired.position, self.offset)
        try:
            if self.platform:
                pose = self.platform.forward_kinematics(
                    position + self.zero_length, self.guess)
                at_rest = self.platform.inverse_dynamics(Motion.from_pose(pose))
                effort = getattr(at_rest, self.platform.parameters.leg_kind.effort.field)
        except StewartError as exc:
            self.get_logger().error(f'the last forces are held: {exc}')
        return JointState(name=desired.name, position=position.tolist(),
                          velocity=[0.0] * len(desired.name), effort=effort)

    def command(self) -> None:
        """Publish the forces for the measured and the desired state, if both are there."""
        measured, desired, now = self.measured, self.desired, time.monotonic()
        if measured is None or desired is None:
            return
        if self.stepped:
            stamp = measured.header.stamp
            if (desired.header.stamp != stamp or self.answered == stamp
                    or not self.commands.get_subscription_count()):
                return
            self.answered, self.repeats, self.waits_since = stamp, 0, now
        elif now - self.desired_at > self.timeout:
            if self.held is None:
                self.get_logger().error(
                    f'no desired state for {self.timeout} s: the last position is held')
                self.held = self.at_rest(desired)
            desired = self.held
        if measured.name != desired.name:
            return self.no_command(f'{measured.name} measured, {desired.name} desired')
        error = np.subtract(desired.position, measured.position)
        rate_error = np.subtract(desired.velocity, measured.velocity)
        if not self.stepped and desired is not self.held:
            if now - self.followed_at > self.timeout:  # a gap: the hexapod is elsewhere
                duration = max(1.875 * np.abs(error).max() / RETURN_SPEED, RETURN_TIME)
                self.returning = now, -error, -rate_error, duration
            self.followed_at = now
            begun, *of_begin, duration = self.returning
            self.offset, rate = return_offset(*of_begin, now - begun, duration)
            error, rate_error = error + self.offset, rate_error + rate
        force = self.k_p * error + self.k_d * rate_error
        if self.feed_forward:
            force += desired.effort
        if not np.isfinite(force).all():
            return self.no_command(f'the forces are {force}')
        force = np.clip(force, -self.force_max, self.force_max)
        self.commands.publish(Float64MultiArray(data=force.tolist()))

    def check(self) -> None:
        """Answer a state whose simulator was found late, and log what a simulation waits for."""
        if not self.stepped:
            return
        self.command()
        if time.monotonic() - self.waits_since < PATIENCE:
            return
        if self.measured is None:
            why = 'no measured state'
        elif self.answered == self.measured.header.stamp:
            return  # it waits for others
        elif not self.commands.get_subscription_count():
            why = f'no subscriber of {self.commands.topic_name}'
        else:
            why = f'no desired state of {seconds(self.measured)}' + (
                f', the last one is of {seconds(self.desired)}' if self.desired else '')
        self.get_logger().warning(
            f'waiting for {PATIENCE:g} s and more: {why}', throttle_duration_sec=5.0)

    def no_command(self, why: str) -> None:
        self.get_logger().error(f'no command: {why}', throttle_duration_sec=1.0)


def seconds(state: JointState) -> str:
    """Return the stamp of a state."""
    return f'{state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec:.6f} s'


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
        sys.exit(f'leg_controller: {exc}')
    parser.parse_args(remove_ros_args(sys.argv)[1:])
    executor = EventsExecutor()
    try:
        controller = LegController()
        executor.add_node(controller)
        while not signals:
            executor.spin_once(timeout_sec=0.1)
            controller.check()
    except (InvalidParameterTypeException, StewartError, ValueError) as exc:
        sys.exit(f'leg_controller: {exc}')
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
