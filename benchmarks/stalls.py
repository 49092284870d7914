# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Events that could make a setpoint wait in the node, with and without the measure against each.

Each is measured in a process of its own.
"""

from __future__ import annotations

from collections.abc import Callable
import gc
import statistics
import sys
import time

import rclpy

from stewart_dynamics.node.dynamics_node import DynamicsNode
from stewart_dynamics.ros.repeated_log import RepeatedLog, WARNING

REPEATED = 21
REJECTION = 'setpoint/pose rejected: not finite'


def milliseconds(call: Callable[[], object], repeated: int = REPEATED) -> float:
    """Return the processor time of a call, the median of some."""
    times = []
    for _ in range(repeated):
        begin = time.thread_time_ns()
        call()
        times.append(time.thread_time_ns() - begin)
    return statistics.median(times) * 1e-6


def main() -> None:
    """Print each event and its duration without and with the measure against it [ms]."""
    sys.argv[1:] = ['--ros-args', '--params-file', sys.argv[1]]
    rclpy.init()
    node = DynamicsNode()  # freezes the objects that exist
    frozen = milliseconds(gc.collect)
    gc.unfreeze()
    rows = [('a full garbage collection', milliseconds(gc.collect), frozen)]

    logger = node.get_logger()
    log = RepeatedLog(logger)
    log.write([(WARNING, REJECTION, 'rejected')])
    rows.append(('a rejection in the log, while they come by the thousand',
                 milliseconds(lambda: logger.warning(REJECTION)),
                 milliseconds(lambda: log.write([(WARNING, REJECTION, 'rejected')]))))
    for what, without, done in rows:
        print(f'{what}\t{without:.3f}\t{done:.3f}')
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
