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
    print(answer.result().message)
    sys.exit(not answer.result().success)


if __name__ == '__main__':
    main()
