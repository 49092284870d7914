# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: apply a load to the simulated platform and print the external wrench that is estimated.

The load is published on stewart_simulator/wrench; the node, its ~/measured_legs connected to
stewart_simulator/leg_states, publishes stewart_dynamics/external_wrench. Run it while a controller
moves the hexapod: brakes that hold appear as a load, too.
"""

import argparse
import signal
import sys
import time

from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from rclpy.utilities import remove_ros_args
from stewart_dynamics.messages.received import checked_numbers, ReceivedError

SETTLE = 1_000_000_000  # duration of the load by the stamps of the answers [ns]


def vector(three: list) -> Vector3:
    x, y, z = three
    return Vector3(x=x, y=y, z=z)


class Pusher(Node):
    """Publishes loads and keeps the estimated external wrench."""

    def __init__(self) -> None:
        super().__init__('pusher')
        self.found = None
        self.loads = self.create_publisher(WrenchStamped, 'stewart_simulator/wrench', 1)
        self.create_subscription(
            WrenchStamped, 'stewart_dynamics/external_wrench', self.on_found, 1)

    def on_found(self, found: WrenchStamped) -> None:
        stamp, numbers = found.header.stamp, wrench_of(found)
        try:
            checked_numbers('external wrench', [*numbers[0], *numbers[1]], 6)
            if stamp.sec < 0:
                raise ReceivedError(f'stamp {stamp.sec} s: must be at least 0')
        except ReceivedError as exc:
            self.get_logger().warning(f'external wrench dropped: {exc}')
            return
        self.found = found

    def wait(self, timeout: float) -> WrenchStamped:
        """Return the next external wrench that the node publishes."""
        self.found, end = None, time.monotonic() + timeout
        while self.found is None or not self.loads.get_subscription_count():
            if time.monotonic() > end:
                sys.exit(f'no external wrench, or no simulator, within {timeout:g} s')
            rclpy.spin_once(self, timeout_sec=0.1)
        return self.found

    def push(self, force: list, moment: list, timeout: float) -> WrenchStamped:
        """Apply a load at the platform's origin [N, N m], base axes; return the last estimate."""
        found = self.wait(timeout)
        load = WrenchStamped(wrench=Wrench(force=vector(force), torque=vector(moment)))
        load.header.frame_id = 'base'
        self.loads.publish(load)
        until = Time.from_msg(found.header.stamp).nanoseconds + SETTLE
        while Time.from_msg(found.header.stamp).nanoseconds < until:
            found = self.wait(timeout)
        return found


def wrench_of(found: WrenchStamped) -> list:
    return [[three.x, three.y, three.z] for three in (found.wrench.force, found.wrench.torque)]


def text(found: WrenchStamped) -> str:
    force, moment = ([round(number, 1) + 0.0 for number in three] for three in wrench_of(found))
    return f'{force} N, {moment} N m'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    three = {'nargs': 3, 'type': float, 'metavar': ('X', 'Y', 'Z')}
    parser.add_argument('--force', default=[300.0, 0.0, -100.0], help='[N]', **three)
    parser.add_argument('--moment', default=[0.0, 0.0, 50.0], help='[N m]', **three)
    parser.add_argument('--timeout', type=float, default=10.0,
                        help='for the next external wrench [s]')
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'push_platform: {exc}')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    pusher = Pusher()
    try:
        print('before:', text(pusher.wait(options.timeout)))
        print('pushed:', text(pusher.push(options.force, options.moment, options.timeout)))
        print('after: ', text(pusher.push([0.0] * 3, [0.0] * 3, options.timeout)))
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
