# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
An example: PD control of the legs, with the node's forces as feed-forward. Copy what you need.

It is no part of the package, which computes forces and controls nothing. For each leg

    force = k_p (q_d - q) + k_d (v_d - v) + effort_d

with length q and rate v as measured, and q_d, v_d, effort_d as stewart_dynamics publishes them.
"""

import math
import sys
import time

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray


class LegController(Node):
    """
    Answers each measured state of the legs with six forces.

    In real time the latest desired state is the one to reach, unless it is older than the
    timeout. With use_sim_time the simulation waits for each command: the desired state of the
    very same stamp is awaited, and each stamp is answered once.
    """

    def __init__(self) -> None:
        super().__init__('leg_controller')
        # 8 Hz and a damping ratio of 1 on the 160 kg that a leg of config/platform.yaml moves
        # at home while the other five hold still.
        self.k_p = self.positive('proportional_gain', 4.0e5, 'force per length [N/m]')
        self.k_d = self.positive('derivative_gain', 1.6e4, 'force per rate [N s/m]')
        self.timeout = self.positive('timeout', 0.05, 'oldest desired state to follow [s]')
        self.feed_forward = self.constant('feed_forward', True, 'add the desired effort')
        self.stepped = self.get_parameter('use_sim_time').value
        self.measured = self.desired = self.answered = None
        self.commands = self.create_publisher(
            Float64MultiArray, 'stewart_simulator/commands', 1)
        self.create_subscription(
            JointState, 'stewart_simulator/leg_states', self.on_measured, 1)
        self.create_subscription(
            JointState, 'stewart_dynamics/leg_states', self.on_desired, 1)

    def constant(self, name: str, default: object, text: str) -> object:
        """Return the value of a parameter that does not change while the controller runs."""
        return self.declare_parameter(
            name, default, ParameterDescriptor(description=text, read_only=True)).value

    def positive(self, name: str, default: float, text: str) -> float:
        """Return the value of one that is a positive number."""
        value = self.constant(name, default, text)
        if not 0.0 <= value < math.inf:
            raise ValueError(f'{name}: {value}: must be finite and at least 0')
        return value

    def on_measured(self, state: JointState) -> None:
        self.measured = state
        self.command()

    def on_desired(self, state: JointState) -> None:
        self.desired, self.desired_at = state, time.monotonic()
        if self.stepped:
            self.command()

    def command(self) -> None:
        """Publish the forces for what is measured and desired now, if there are any."""
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
            return self.refuse(f'no desired state for {self.timeout} s')
        if measured.name != desired.name:
            return self.refuse(f'{measured.name} measured, {desired.name} desired')
        force = (self.k_p * np.subtract(desired.position, measured.position)
                 + self.k_d * np.subtract(desired.velocity, measured.velocity))
        if self.feed_forward:
            if len(desired.effort) != len(force):
                return self.refuse('no desired effort: the forces are suppressed or unsolvable')
            force += desired.effort
        if not np.isfinite(force).all():
            return self.refuse(f'the forces are {force}')
        self.commands.publish(Float64MultiArray(data=force.tolist()))

    def refuse(self, why: str) -> None:
        self.get_logger().error(f'no command: {why}', throttle_duration_sec=1.0)


def main() -> None:
    rclpy.init()
    executor = EventsExecutor()
    try:
        executor.add_node(LegController())
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # SIGINT or SIGTERM
    except (InvalidParameterTypeException, ValueError) as exc:
        sys.exit(f'leg_controller: {exc}')
    except Exception:
        if rclpy.ok():  # else a signal has ended ROS in the middle of something
            raise
    finally:
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
