# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: show how far the hexapod can go from where it is, in the terminal. Copy what you need.

A bar for each axis: the pose is at its middle, and a full half is --range m, or --angle degrees.
"""

import argparse
import math
import signal
import sys

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Float64MultiArray
from stewart_dynamics.messages.received import checked_numbers, ReceivedError

HALF = 25
AXES = 'x', 'y', 'z', 'rx', 'ry', 'rz'


class Panel(Node):
    """Draws each message over the last one."""

    def __init__(self, meters: float, degrees: float) -> None:
        super().__init__('travel_panel')
        self.full, self.rows = [meters] * 3 + [math.radians(degrees)] * 3, 0
        self.create_subscription(
            Float64MultiArray, 'stewart_dynamics/travel', self.on_travel, 1)

    def on_travel(self, message: Float64MultiArray) -> None:
        try:
            # The largest finite number: no limit on the way.
            values = checked_numbers('travel', message.data, 12, sys.float_info.max)
        except ReceivedError as exc:
            self.get_logger().warning(f'dropped: {exc}', throttle_duration_sec=5.0)
            return
        if self.rows and sys.stdout.isatty():
            print(f'\x1b[{self.rows}A', end='')
        for n, (axis, full) in enumerate(zip(AXES, self.full, strict=True)):
            least, most = values[2 * n:2 * n + 2]
            left, right = (round(HALF * min(max(each / full, 0.0), 1.0))
                           for each in (least, most))
            scale, unit = (1e3, 'mm') if n < 3 else (180.0 / math.pi, 'deg')
            print(f'{axis:>2} {-least * scale:9.1f} {"#" * left:>{HALF}}|{"#" * right:<{HALF}} '
                  f'{most * scale:9.1f} {unit}')
        self.rows = len(AXES)
        sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--range', type=float, default=0.5, help='m, a full half of a bar')
    parser.add_argument('--angle', type=float, default=60.0, help='degrees, likewise')
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        # Python's KeyboardInterrupt is lost where it comes within a callback of a C library.
        signal.signal(number, lambda number, frame: signals.append(number))
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'show_travel: {exc}')
    given = parser.parse_args(remove_ros_args(sys.argv)[1:])
    panel = Panel(given.range, given.angle)
    try:
        while not signals:
            rclpy.spin_once(panel, timeout_sec=0.1)
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
