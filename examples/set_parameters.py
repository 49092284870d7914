# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: set parameters of a running node, all or none of them at once. Copy what you need.

ros2 param set and ros2 param load set one after the other, and are not there without a ROS
installation. Exit code: 0 set, 1 not.

    set_parameters.py payload.mass=82.0 payload.center_of_mass='[0.1, 0.0, 0.6]'
    set_parameters.py --node /stewart_cueing --file cueing/cueing.yaml
"""

import argparse
from pathlib import Path
import signal
import sys

from rcl_interfaces.msg import Parameter
import rclpy
from rclpy.parameter import get_parameter_value, parameter_dict_from_yaml_file
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from stewart_dynamics.messages.received import shown_text
import yaml


def assignment(text: str) -> Parameter:
    """Return the parameter of NAME=VALUE."""
    name, equals, value = text.partition('=')
    if not name or not equals:
        raise argparse.ArgumentTypeError(f'{text!r}: must be NAME=VALUE')
    try:
        return Parameter(name=name, value=get_parameter_value(value))
    except (AssertionError, TypeError, ValueError, yaml.YAMLError):
        raise argparse.ArgumentTypeError(f'{text!r}: has a value that is not YAML') from None


def of_file(path: Path) -> list[Parameter]:
    """Return the parameters of a file, for one node or for all (/**)."""
    try:
        return list(parameter_dict_from_yaml_file(str(path), use_wildcard=True).values())
    except (AttributeError, OSError, RuntimeError, TypeError, ValueError, yaml.YAMLError) as exc:
        sys.exit(f'set_parameters: {path}: {" ".join(str(exc).split())}')


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('parameters', nargs='*', type=assignment, metavar='NAME=VALUE')
    parser.add_argument('--file', type=Path, help='parameter file, as of ros2 param load')
    parser.add_argument('--node', default='/stewart_dynamics', help='default: %(default)s')
    parser.add_argument('--timeout', type=float, default=60.0,
                        help='for the node to appear, and to answer [s]')
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'set_parameters: {exc}')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    parameters = [*(of_file(options.file) if options.file else []),
                  *options.parameters]
    try:
        client = AsyncParameterClient(rclpy.create_node('parameter_setter'), options.node)
        if not client.wait_for_services(options.timeout):
            sys.exit(f'no node {options.node} within {options.timeout:g} s')
        answer = client.set_parameters_atomically(parameters)
        rclpy.spin_until_future_complete(client.node, answer, timeout_sec=options.timeout)
        if not answer.done():
            sys.exit(f'no answer within {options.timeout:g} s')
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()
    result = answer.result().result
    if not result.successful:
        sys.exit(f'set_parameters: {shown_text(result.reason)}')
    print(f'{len(parameters)} parameters of {options.node} set')


if __name__ == '__main__':
    main()
