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

"""Publishers and subscriptions of the node, while it is configured; see ``topic_table``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, qos_policy_name_from_kind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from stewart_dynamics.description.joint_states import JOINT_STATES, TF
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.node.topic_table import MARKERS, PUBLISHED, SUBSCRIBED, Topic
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.topics import BASE_SOURCES, SOURCES

_INPUTS = {topic.name: topic for topic in SUBSCRIBED}


class Topics:
    """
    Publishers and subscriptions of the node; created by ``make``.

    Parameters
    ----------
    node : LifecycleNode
        The node that owns them.

    Attributes
    ----------
    publishers : dict of str to Publisher
        Publishers by topic, without the node's name.
    setpoints, base : dict of str to Subscription
        Raw subscriptions to the setpoint topics and to the topics of the base.

    """

    def __init__(self, node: LifecycleNode) -> None:
        self.publishers: dict[str, Publisher] = {}
        self.setpoints: dict[str, Any] = {}
        self.base: dict[str, Any] = {}
        self._node = node
        self._destroy: list[Callable[[], Any]] = []
        self._names: dict[str, str] = {}

    def make(self, parameters: Parameters, on_setpoint: Callable[[str, bytes], None],
             on_base: Callable[[str, bytes], None],
             others: Mapping[str, Callable[[bytes], None]]) -> None:
        """
        Create all publishers and subscriptions.

        Parameters
        ----------
        parameters : Parameters
            Select the setpoint topics, the topics of the base, and whether markers, joint states
            and transforms are published.
        on_setpoint, on_base : callable
            Called with topic and bytes of a message on a setpoint topic, or on one of the base.
        others : mapping of topic to callable
            Called with the bytes of a message on each of the other topics.

        Raises
        ------
        ParameterError
            ``publish_tf`` needs a package that is not installed.

        """
        there = {MARKERS: parameters['visualization_rate'] > 0.0, TF: parameters['publish_tf']}
        there[JOINT_STATES] = there[MARKERS]
        for topic in PUBLISHED:
            if there.get(topic.name, True):
                self._publish(topic)
        # The executor takes messages in the order of the subscriptions: a setpoint needs the
        # earlier messages of the base.
        self.base, self.setpoints = ({
            name: self._subscribe(_INPUTS[name], partial(take, name)) for name in names}
            for names, take in ((BASE_SOURCES[parameters['base.source']], on_base),
                                (SOURCES[parameters['setpoint.source']], on_setpoint)))
        inputs = {**self.base, **self.setpoints, **{
            name: self._subscribe(_INPUTS[name], callback) for name, callback in others.items()}}
        self._names = {name: subscription.topic_name for name, subscription in inputs.items()}

    def writers(self) -> dict[str, int]:
        """Return the number of publishers on each topic of setpoints and base."""
        return {topic: self.writers_of(topic) for topic in (*self.setpoints, *self.base)}

    def writers_of(self, topic: str) -> int:
        """Return the number of publishers on an input topic."""
        return int(self._node.count_publishers(self._names[topic]))

    def destroy(self) -> None:
        """Destroy all publishers and subscriptions."""
        self.publishers, self.setpoints, self.base, self._names = {}, {}, {}, {}
        while self._destroy:
            self._destroy.pop()()

    def _publish(self, topic: Topic) -> None:
        durability = (DurabilityPolicy.TRANSIENT_LOCAL if topic.latched
                      else DurabilityPolicy.VOLATILE)
        publisher = self._node.create_publisher(
            _message_class(topic.kind), topic.ros_name,
            QoSProfile(depth=topic.depth, durability=durability))
        self._destroy.append(partial(self._node.destroy_publisher, publisher))
        self.publishers[topic.name] = publisher

    def _subscribe(self, topic: Topic, callback: Callable[[bytes], None]) -> Any:
        subscription = self._node.create_subscription(
            _message_class(topic.kind), topic.ros_name, callback, QoSProfile(depth=topic.depth),
            raw=True, qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=partial(self._on_incompatible_qos, topic.name)))
        self._destroy.append(partial(self._node.destroy_subscription, subscription))
        return subscription

    def _on_incompatible_qos(self, topic: str, event: Any) -> None:
        self._node.get_logger().error(
            f'{topic}: a publisher offers an incompatible quality of service, policy '
            f'{qos_policy_name_from_kind(event.last_policy_kind)}: its messages are not received')


def _message_class(name: str) -> Any:
    """Return the class of a message type; ROS's wheels on PyPI do not contain tf2_msgs."""
    package, _, message = name.split('/')
    try:
        return getattr(import_module(f'{package}.msg'), message)
    except ImportError as exc:
        parameter = next(topic.parameter for topic in PUBLISHED if topic.kind == name)
        raise ParameterError(
            f'{parameter}: needs the ROS package {package}, which is not installed (it is part '
            'of ROS, but not of its wheels on PyPI)') from exc
