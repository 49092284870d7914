# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: print /diagnostics readably, where there is no rqt_runtime_monitor. Copy what you need.

Each status is printed when its level or its message changes, but for the numbers in it: many are
ages. With --values it is printed with all numbers, once in a second.
"""

import argparse
import re
import signal
import sys

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from stewart_dynamics.messages.received import shown_text

LEVELS = {DiagnosticStatus.OK: 'OK', DiagnosticStatus.WARN: 'WARN',
          DiagnosticStatus.ERROR: 'ERROR', DiagnosticStatus.STALE: 'STALE'}
MOST_STATUSES = 1000


class Monitor(Node):
    """Prints what changes."""

    def __init__(self, values: bool) -> None:
        super().__init__('diagnostics_monitor')
        self.values, self.last = values, {}
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name, text = shown_text(status.name), shown_text(status.message)
            state = status.level, re.sub(r'[\d.]+', '', text)
            if self.values or self.last.get(name) != state:
                print(f'{LEVELS.get(status.level, "?"):5}  {name}: {text}')
            self.last.pop(name, None)
            self.last[name] = state
            if len(self.last) > MOST_STATUSES:  # the one that is silent for longest
                del self.last[next(iter(self.last))]
            if self.values:
                for pair in status.values:
                    print(f'         {shown_text(pair.key)}: {shown_text(pair.value)}')
        sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--values', action='store_true', help='print all values, too')
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        # Python's KeyboardInterrupt is lost where it comes within a callback of a C library.
        signal.signal(number, lambda number, frame: signals.append(number))
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'show_diagnostics: {exc}')
    monitor = Monitor(parser.parse_args(remove_ros_args(sys.argv)[1:]).values)
    try:
        while not signals:
            rclpy.spin_once(monitor, timeout_sec=0.1)
    finally:
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, signal.SIG_IGN)  # a second Ctrl-C
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
