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

"""The topics of the dynamics node: types, queues, and what is there while it is configured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    AccelStamped, InertiaStamped, PoseStamped, TwistStamped, WrenchStamped)
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, qos_policy_name_from_kind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray
from stewart_dynamics.description.joint_states import JOINT_STATES, TF
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.external_wrench.estimate import EXTERNAL_WRENCH
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.node.planned_queue import LENGTH
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.planned import messages as planned
from stewart_dynamics.setpoints.outputs import OUTPUT_TYPES
from stewart_dynamics.setpoints.topics import BASE_SOURCES, INPUT_TYPES, SOURCES
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

# Publishers, beside those of OUTPUT_TYPES.
DIAGNOSTICS, MARKERS, LEG_TRAJECTORY, PAYLOAD = (
    'diagnostics', 'markers', planned.OUTPUT, 'payload')

# So many messages of a topic may wait in the middleware.
QUEUE = 1000
_QUEUES = {planned.INPUT: LENGTH}

_TYPES: dict[str, Any] = {
    'geometry_msgs/msg/PoseStamped': PoseStamped,
    'geometry_msgs/msg/TwistStamped': TwistStamped,
    'geometry_msgs/msg/AccelStamped': AccelStamped,
    'geometry_msgs/msg/WrenchStamped': WrenchStamped,
    'trajectory_msgs/msg/MultiDOFJointTrajectory': MultiDOFJointTrajectory,
    'sensor_msgs/msg/JointState': JointState,
    'sensor_msgs/msg/Imu': Imu,
    'std_msgs/msg/Float64MultiArray': Float64MultiArray,
    'std_msgs/msg/Float64': Float64,
    'std_msgs/msg/Bool': Bool,
}
_INPUT_TYPES = {**INPUT_TYPES, MEASURED_LEGS: 'sensor_msgs/msg/JointState',
                planned.INPUT: planned.INPUT_TYPE}


class Topics:
    """
    The publishers and subscriptions of the node; there are none before ``make``.

    Parameters
    ----------
    node : LifecycleNode
        Whose they are.

    Attributes
    ----------
    publishers : dict of str to Publisher
        By topic, without the node's name.
    setpoints, base : dict of str to Subscription
        Those of the setpoint topics and of the topics of the base; raw ones.

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
        Make all of them.

        Parameters
        ----------
        parameters : Parameters
            Which setpoint topics, which of the base, and whether there are markers, joint states
            and transforms.
        on_setpoint, on_base : callable
            Gets topic and bytes of a message on a setpoint topic, or on one of the base.
        others : mapping of topic to callable
            What gets the bytes of a message on the other topics.

        Raises
        ------
        ParameterError
            ``publish_tf`` needs a package that is not installed.

        """
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for topic, name in OUTPUT_TYPES.items():
            self._publish(topic, _TYPES[name], latched if topic == 'singularity_warning' else
                          QoSProfile(depth=10))
        self._publish(PAYLOAD, InertiaStamped, latched)
        self._publish(EXTERNAL_WRENCH, WrenchStamped, QoSProfile(depth=10))
        self._publish(LEG_TRAJECTORY, JointTrajectory, QoSProfile(depth=LENGTH))
        self._publish(DIAGNOSTICS, DiagnosticArray, QoSProfile(depth=10), '/diagnostics')
        if parameters['visualization_rate']:
            self._publish(MARKERS, MarkerArray, QoSProfile(depth=1))
            self._publish(JOINT_STATES, JointState, QoSProfile(depth=10))
        if parameters['publish_tf']:
            self._publish(TF, _transforms(), QoSProfile(depth=100), TF)
        # The executor takes messages in the order of the subscriptions: a setpoint needs those of
        # the base that have come before it.
        self.base, self.setpoints = ({
            topic: self._subscribe(_TYPES[_INPUT_TYPES[topic]], topic, partial(take, topic))
            for topic in topics} for topics, take in (
                (BASE_SOURCES[parameters['base.source']], on_base),
                (SOURCES[parameters['setpoint.source']], on_setpoint)))
        inputs = {**self.base, **self.setpoints, **{
            topic: self._subscribe(
                _TYPES[_INPUT_TYPES[topic]], topic, callback, _QUEUES.get(topic, QUEUE))
            for topic, callback in others.items()}}
        self._names = {topic: subscription.topic_name for topic, subscription in inputs.items()}

    def writers(self) -> dict[str, int]:
        """Return how many publishers each topic of setpoints and base has."""
        return {topic: self.writers_of(topic) for topic in (*self.setpoints, *self.base)}

    def writers_of(self, topic: str) -> int:
        """Return how many publishers an input topic has."""
        return int(self._node.count_publishers(self._names[topic]))

    def destroy(self) -> None:
        """Destroy all of them."""
        self.publishers, self.setpoints, self.base, self._names = {}, {}, {}, {}
        while self._destroy:
            self._destroy.pop()()

    def _publish(self, topic: str, kind: Any, qos: QoSProfile, name: str = '') -> None:
        publisher = self._node.create_publisher(kind, name or f'~/{topic}', qos)
        self._destroy.append(partial(self._node.destroy_publisher, publisher))
        self.publishers[topic] = publisher

    def _subscribe(self, kind: Any, topic: str, callback: Callable[[bytes], None],
                   depth: int = QUEUE) -> Any:
        subscription = self._node.create_subscription(
            kind, f'~/{topic}', callback, QoSProfile(depth=depth), raw=True,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=partial(self._on_incompatible_qos, topic)))
        self._destroy.append(partial(self._node.destroy_subscription, subscription))
        return subscription

    def _on_incompatible_qos(self, topic: str, event: Any) -> None:
        self._node.get_logger().error(
            f'{topic}: a publisher offers an incompatible quality of service, policy '
            f'{qos_policy_name_from_kind(event.last_policy_kind)}: its messages are not received')


def _transforms() -> Any:
    """Return tf2_msgs/TFMessage, which ROS's wheels on PyPI do not contain."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as exc:
        raise ParameterError(
            'publish_tf: true: needs the ROS package tf2_msgs, which is not installed (it is part '
            'of ROS, but not of its wheels on PyPI)') from exc
    return TFMessage
