# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: call a service, where there is no ros2 service call. Copy what you need.

The services of the node that take no arguments, as /stewart_dynamics/identify_payload, are of type
std_srvs/srv/Trigger. Exit code: 0 success, 1 not.
"""

import argparse
import signal
import sys

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_srvs.srv import Trigger
from stewart_dynamics.messages.received import shown_text


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('service', nargs='?', default='/stewart_dynamics/identify_payload',
                        metavar='SERVICE', help='default: %(default)s')
    parser.add_argument('--timeout', type=float, default=60.0,
                        help='for the node to appear, and to answer [s]')
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'call_service: {exc}')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    try:
        node = rclpy.create_node('service_caller')
        client = node.create_client(Trigger, options.service)
        if not client.wait_for_service(options.timeout):
            sys.exit(f'no service {options.service} within {options.timeout:g} s')
        answer = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, answer, timeout_sec=options.timeout)
        if not answer.done():
            sys.exit(f'no answer within {options.timeout:g} s')
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()
    print(shown_text(answer.result().message))
    sys.exit(not answer.result().success)


if __name__ == '__main__':
    main()
