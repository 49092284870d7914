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
What could make a setpoint wait in the node now and then, and what is done about it.

Each is measured in a process of its own, in the way that it was or could be, and as it is.
"""

from __future__ import annotations

from collections.abc import Callable
import gc
import statistics
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import rclpy
from rclpy.serialization import serialize_message

from stewart_dynamics.messages.diagnostics import diagnostics as written
from stewart_dynamics.nodes.dynamics_node import DynamicsNode
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime.diagnostics import Diagnostics
from stewart_dynamics.runtime.input_topics import SOURCES
from stewart_dynamics.runtime.repeated_events import Series
from stewart_dynamics.runtime.step import Setpoint, Step

REPEATED = 21
REFUSAL = 'setpoint/pose refused: not finite'
HOME = (0.0, 0.0, 1.1, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) + (0.0,) * 12


def milliseconds(call: Callable[[], object], repeated: int = REPEATED) -> float:
    """Return the processor time of a call, the median of some."""
    times = []
    for _ in range(repeated):
        begin = time.thread_time_ns()
        call()
        times.append(time.thread_time_ns() - begin)
    return statistics.median(times) * 1e-6


def main() -> None:
    """Print what it is, how long without and how long with what is done about it [ms]."""
    path = sys.argv[1]
    sys.argv[1:] = ['--ros-args', '--params-file', path]
    rclpy.init()
    node = DynamicsNode()  # freezes what is there
    frozen = milliseconds(gc.collect)
    gc.unfreeze()
    rows = [('a full garbage collection', milliseconds(gc.collect), frozen)]

    parameters = Parameters.from_yaml(path)
    output = Step(parameters)(Setpoint(1, HOME), None)
    assert output is not None
    diagnostics = Diagnostics(parameters, SOURCES['separate'], 0.0)
    diagnostics.answered(output, 0.0, 1e-4)
    statuses = [(each.level, (each.name, each.message, 'node'), each.values)
                for each in diagnostics.report(1.0)]

    def typed() -> bytes:
        return bytes(serialize_message(DiagnosticArray(status=[
            DiagnosticStatus(
                level=bytes([level]), name=name, message=message, hardware_id=hardware,
                values=[KeyValue(key=key, value=value) for key, value in values])
            for level, (name, message, hardware), values in statuses])))

    def ours() -> bytes:
        return written(0, statuses)

    rows.append(('the first diagnostics as a message, rclpy loads what it needs',
                 milliseconds(typed, 1), milliseconds(ours, 1)))
    rows.append(('diagnostics as a message', milliseconds(typed), milliseconds(ours)))
    logger, series = node.get_logger(), Series()
    series.add('refused', REFUSAL, 0.0)
    rows.append(('a refusal in the log, while they come by the thousand',
                 milliseconds(lambda: logger.warning(REFUSAL)),
                 milliseconds(lambda: series.add('refused', REFUSAL, 1.0))))
    for what, without, done in rows:
        print(f'{what}\t{without:.3f}\t{done:.3f}')
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
