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

"""Publishes the node's report as diagnostic_msgs/DiagnosticArray, and logs changes."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from stewart_dynamics.node.diagnostics.dynamics import DynamicsDiagnostics
from stewart_dynamics.node.diagnostics.periodic_report import OK, Status
from stewart_dynamics.node.topics import DIAGNOSTICS, NodeTopics
from stewart_dynamics.ros.repeated_log import RepeatedLog

# The topics for controllers; diagnostics give the number of their subscribers.
_READ = ('leg_states', 'leg_forces')


class DiagnosticsPublisher:
    """Publishes reports."""

    def __init__(self, node: Node, topics: NodeTopics, log: RepeatedLog) -> None:
        self._node = node
        self._topics = topics
        self._log = log
        # The first one takes milliseconds: rclpy loads the type support.
        serialize_message(self._message([Status('', OK, '', (('', ''),))]))

    def publish(self, diagnostics: DynamicsDiagnostics) -> None:
        """Count publishers and subscribers; publish and log a report."""
        node = self._node
        diagnostics.setpoints.found(
            self._topics.writers(),
            {topic: self._topics.publishers[topic].get_subscription_count() for topic in _READ},
            node.get_fully_qualified_name(), node.get_node_names_and_namespaces().count(
                (node.get_name(), node.get_namespace())))
        statuses, lines = diagnostics.report.make(time.monotonic())
        self._log.write(lines)
        self._topics.publishers[DIAGNOSTICS].publish(self._message(statuses))

    def _message(self, statuses: list[Status]) -> DiagnosticArray:
        name = self._node.get_fully_qualified_name().lstrip('/')
        return DiagnosticArray(
            header=Header(stamp=self._node.get_clock().now().to_msg()),
            status=[DiagnosticStatus(
                level=bytes([status.level]), name=f'{name}: {status.name}',
                message=status.message, hardware_id=name,
                values=[KeyValue(key=key, value=value) for key, value in status.values])
                for status in statuses])
