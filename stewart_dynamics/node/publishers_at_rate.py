# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of topics that are not published with each answer: at a limited rate or period."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
import math
import sys
import time
from typing import Any, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.limits import limits_of
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.node.diagnostics.levels import OK, Status
from stewart_dynamics.node.diagnostics.periodic_report import DynamicsDiagnostics
from stewart_dynamics.node.topics import DIAGNOSTICS, NodeTopics, TRAVEL_RATE
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.ros.repeated_log import RepeatedLog
from stewart_dynamics.setpoints.output_messages import LEG_STATES, LegTopics

if TYPE_CHECKING:
    from stewart_dynamics.capability.capability import Capability

# Directions in the order of the message: each of x y z rx ry rz to minus, then to plus.
_DIRECTIONS = np.stack([-np.eye(6), np.eye(6)], axis=1).reshape(12, 6)
# Values where nothing limits, since no output is infinite: the largest number [m]; one turn [rad].
_UNLIMITED = np.repeat([sys.float_info.max, 2.0 * math.pi], 6)
_SWITCH = 2e-4  # after which another thread of Python may go on [s]
_LAYOUT = MultiArrayLayout(dim=[
    MultiArrayDimension(label='x y z rx ry rz', size=6, stride=12),
    MultiArrayDimension(label='minus plus', size=2, stride=2)])
NO_LIMIT = '~/travel: none of {} is set: it ends at singularity.stop_condition alone'


class PublisherAtRate:
    """
    Publishes the last data noted, at most at a given rate, while there are subscribers.

    publisher: None if nothing is to be published.
    rate: maximum rate [Hz].
    write: makes the message; called with the data.
    """

    def __init__(self, publisher: Any, rate: float, write: Callable[..., Any]) -> None:
        self.write = write  # may be replaced at any time
        self._publisher = publisher
        self._period = 1.0 / rate if rate else 0.0
        self._due = 0.0
        self._unpublished: tuple[Any, ...] | None = None

    def note(self, *data: Any) -> None:
        """Note the data of the next message."""
        self._unpublished = data

    def publish_due(self, now: float) -> None:
        """Publish the last data noted if publication is due and there is a subscriber."""
        if self._unpublished is None or self._publisher is None or now < self._due:
            return
        last = self._unpublished
        # A later subscriber must not get data of an old setpoint.
        self._unpublished = None
        self._due = now + self._period
        if self._publisher.get_subscription_count():
            self._publisher.publish(self.write(*last))


class TravelPublisher(PublisherAtRate):
    """
    Publishes ``~/travel``: how far the platform can go from the pose of the last setpoint.

    parameters: geometry and limits; ``use`` replaces them.
    """

    def __init__(self, parameters: Parameters, publisher: Any) -> None:
        super().__init__(publisher, TRAVEL_RATE, self._message)
        # It takes as long as some setpoints; the thread of these has the processor again soon.
        self._thread = ThreadPoolExecutor(1)
        sys.setswitchinterval(_SWITCH)
        self._read = self._said = False
        self.use(parameters)

    def use(self, parameters: Parameters) -> None:
        """Use other parameters from now on."""
        self._parameters = parameters
        self._values: Future[Array] | None = None
        self._capability: Future[Capability] | None = None

    def look(self) -> str:
        """Check whether there is a subscriber; return a notice where no limit is set, once."""
        self._read = self._publisher.get_subscription_count() > 0
        if not self._read:
            return ''
        limits = limits_of(self._parameters).poses
        unlimited = all(self._parameters[name] is None for name in limits)
        said, self._said = self._said, True
        return NO_LIMIT.format(', '.join(limits)) if unlimited and not said else ''

    def note(self, *data: Any) -> None:
        """Note a row of motion."""
        if self._read:
            super().note(*data)

    def publish_due(self, now: float) -> None:
        """Publish a travel that is computed; begin with that of the last motion if it is due."""
        if self._values is not None and self._values.done():
            values, self._values = self._values.result(), None
            if self._publisher.get_subscription_count():
                self._publisher.publish(self.write(values))
        if self._values is None and self._unpublished is not None and now >= self._due:
            (motion,), self._unpublished = self._unpublished, None
            self._due = now + self._period
            if self._capability is None:
                self._capability = self._thread.submit(_capability_of, self._parameters)
            self._values = self._thread.submit(_travel, self._capability, motion)

    @staticmethod
    def _message(values: Array) -> Float64MultiArray:
        return Float64MultiArray(layout=_LAYOUT, data=values.tolist())


def _capability_of(parameters: Parameters) -> Capability:
    """Return the capability; its module is not in the memory of a node without subscribers."""
    from stewart_dynamics.capability.capability import Capability

    return Capability(StewartPlatform(parameters))


def _travel(capability: Future[Capability], motion: Sequence[float]) -> Array:
    """Return the travel (12,) in all directions from a row of motion."""
    try:
        values = capability.result().travel(Motion.of_rows(np.array(motion)), _DIRECTIONS).value
    except MotionError:  # not decided within the largest number of steps
        values = np.zeros(12)
    return np.where(np.isposinf(values), _UNLIMITED, values)


class DiagnosticsPublisher:
    """Publishes and logs reports."""

    def __init__(self, node: Node, topics: NodeTopics, log: RepeatedLog,
                 parameters: Parameters) -> None:
        self._node = node
        # The topics for controllers; diagnostics give the number of their subscribers.
        self._read = LEG_STATES, LegTopics.of(parameters.leg_kind).efforts
        self._topics = topics
        self._log = log
        # The first one takes milliseconds: rclpy loads the type support.
        serialize_message(diagnostic_array(node, [Status('', OK, '', [('', '')])]))

    def publish(self, diagnostics: DynamicsDiagnostics) -> None:
        """Count publishers and subscribers; publish and log a report."""
        node, publishers = self._node, self._topics.publishers
        namesakes = node.get_node_names_and_namespaces().count(
            (node.get_name(), node.get_namespace()))
        diagnostics.setpoints.found(
            self._topics.writers(),
            {topic: publishers[topic].get_subscription_count() for topic in self._read},
            f'{namesakes} nodes are named {node.get_fully_qualified_name()}'
            if namesakes > 1 else '')
        statuses, lines = diagnostics.report(time.monotonic())
        self._log.write(lines)
        publishers[DIAGNOSTICS].publish(diagnostic_array(node, statuses))


def diagnostic_array(node: Node, statuses: list[Status]) -> DiagnosticArray:
    """Return the message of a node's statuses."""
    name = node.get_fully_qualified_name().lstrip('/')
    return DiagnosticArray(
        header=Header(stamp=node.get_clock().now().to_msg()),
        status=[DiagnosticStatus(
            level=bytes([status.level]), name=f'{name}: {status.name}',
            message=status.message, hardware_id=name,
            values=[KeyValue(key=key, value=value) for key, value in status.values])
            for status in statuses])
