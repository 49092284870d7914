# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The node's topics: their table, and publishers and subscriptions while it is configured.

The table in docs/node.md and the topics of the node in security/policy.xml are made from this one
as well (``make docs``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, qos_policy_name_from_kind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from stewart_dynamics.description.model import JOINT_STATES, MODEL_TYPES, TF
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.external_wrench.estimate import EXTERNAL_WRENCH
from stewart_dynamics.external_wrench.measured_legs import MEASURED_LEGS
from stewart_dynamics.legs import KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.drives.servos import with_servos
from stewart_dynamics.messages import type_names
from stewart_dynamics.node.tasks import LENGTH
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.planned import trajectory_messages as planned
from stewart_dynamics.ros.late_subscribers import for_late_subscribers
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.input_messages import (
    ACCEL, BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_SOURCES, BASE_TWIST, COMBINED, INPUT_TYPES, POSE,
    SOURCES, TWIST, WRENCH)
from stewart_dynamics.setpoints.input_stream import WAITING
from stewart_dynamics.setpoints.output_messages import (
    DETERMINANT, LEG_STATES, LegTopics, MOTOR_STATES, MOTOR_TORQUES, MOTOR_TYPES, output_types,
    SERVO_PULSES, SERVO_TYPES, WARNING)

DIAGNOSTICS, MARKERS, PAYLOAD, TRAVEL = '/diagnostics', 'markers', 'payload', 'travel'
TRAVEL_RATE = 10.0  # highest rate of TRAVEL [Hz]


class Topic(NamedTuple):
    """One topic."""

    name: str  # under the node's name, or whole
    kind: str
    meaning: str  # in docs/node.md
    parameter: str = ''  # parameter and value with which the topic is there; empty: always
    depth: int = 10  # messages that may wait in the middleware
    latched: bool = False  # a later subscriber gets the last message

    @property
    def ros_name(self) -> str:
        """Return the name as ROS takes it."""
        return self.name if self.name.startswith('/') else f'~/{self.name}'


def _input(name: str, meaning: str, parameter: str = '', kind: str = '',
           depth: int = WAITING) -> Topic:
    return Topic(name, kind or INPUT_TYPES[name], meaning, parameter, depth)


SUBSCRIBED = (
    _input(POSE, 'platform pose in the base frame'),
    _input(TWIST, "velocity of the platform's origin and angular velocity, base axes"),
    _input(ACCEL, 'their time derivatives, base axes'),
    _input(COMBINED, 'the same three in one message of one point', 'setpoint.source: combined'),
    _input(planned.INPUT, 'a [planned trajectory](planned_trajectories.md): points with '
           'transform, velocity and acceleration', kind=planned.INPUT_TYPE, depth=LENGTH),
    _input(WRENCH, 'load that the surroundings put on the platform, at its origin, base axes; '
           'held until the next one'),
    _input(MEASURED_LEGS, 'measured position, velocity and effort of the legs, for the [external '
           'wrench](external_wrench.md) and the [payload](payload.md); names in any order, other '
           'joints are ignored', kind=type_names.JOINT_STATE),
    _input(BASE_POSE, 'base frame in `world_frame`: see [Moving base](moving_base.md)',
           'base.source: pose or motion'),
    _input(BASE_TWIST, "velocity of the base frame's origin and angular velocity, axes of the "
           'world', 'base.source: motion'),
    _input(BASE_ACCEL, 'their time derivatives, axes of the world', 'base.source: motion'),
    _input(BASE_IMU, 'specific force and angular velocity of an IMU on the base',
           'base.source: imu'),
)


def _output(name: str, meaning: str, parameter: str = '', latched: bool = False,
            kind: LegKind = KINDS[0]) -> Topic:
    return Topic(name, (output_types(kind) | MOTOR_TYPES | SERVO_TYPES)[name], meaning, parameter,
                 latched=latched, depth=1 if latched else 10)


def _of_legs(kind: LegKind) -> Iterator[Topic]:
    """Yield the topics that are named by the quantities of a kind of legs."""
    position, effort, topics = kind.position, kind.effort, LegTopics.of(kind)
    yield _output(topics.positions, f'six {position.field}, {position.unit}', kind.marker,
                  kind=kind)
    yield _output(topics.efforts, f'six {effort.field}, {effort.unit}, {effort.positive}; remap '
                  'it to the `commands` of an effort controller', kind.marker, kind=kind)


_OTHER_STATES = ''.join(
    f'; with `{kind.marker}` {kind.position.name}, {kind.rate.name} and {kind.effort.name}, and '
    f'there is no {" or ".join(f"`~/{topic}`" for topic in LegTopics.of(KINDS[0]))}'
    for kind in KINDS[1:])

PUBLISHED = (
    _output(LEG_STATES, 'name, position (length - `geometry.zero_length`), velocity and effort '
            f'(force) of the six legs{_OTHER_STATES}'),
    *(topic for kind in KINDS for topic in _of_legs(kind)),
    _output(DETERMINANT, 'det(J), m^3'),
    _output(WARNING, 'true near and at a [singularity](theory.md#singularity); with the first '
            'setpoint and on every change, latched (transient local)', latched=True),
    _output(MOTOR_STATES, 'angle [rad], speed [rad/s] and torque [N m] of the six '
            '[motors](drives.md), named as the joints with `_motor` after it', 'drive.*'),
    _output(MOTOR_TORQUES, 'six torques, N m; remap it to the `commands` of an effort controller '
            'of the motors', 'drive.*'),
    _output(SERVO_PULSES, 'pulse widths of six [hobby servos](real_time.md#hobby-servos), s, '
            'never outside `servo.pulse_min` and `servo.pulse_max`; not published without '
            'torques, and where an angle is outside the two points of its servo', 'servo.*'),
    Topic(planned.OUTPUT, planned.OUTPUT_TYPE,
          'answer to `~/platform_trajectory`, with its stamp and times: positions, velocities '
          'and effort of the legs; nothing when it is rejected', depth=LENGTH),
    Topic(EXTERNAL_WRENCH, type_names.WRENCH_STAMPED,
          'estimated [external wrench](external_wrench.md), for each message of '
          '`~/measured_legs`, with its stamp'),
    _output(BASE_WRENCH, '[what the hexapod puts on its base]'
            "(moving_base.md#what-the-base-must-carry), at the base's origin, base axes; "
            'computed while somebody subscribes'),
    Topic(PAYLOAD, type_names.INERTIA_STAMPED,
          'platform and [payload](payload.md) as one body, when the service '
          '`~/identify_payload` (std_srvs/Trigger) has identified it; `~/apply_payload` takes it '
          'over as `payload.*`; latched (transient local)',
          depth=1, latched=True),
    Topic(TRAVEL, type_names.FLOAT64_MULTI_ARRAY, 'how far x, y, z and the rotations about them '
          'can go from the pose of the last setpoint, to minus and to plus, the others held: 6 x '
          '2, m and rad; up to the first limit of lengths, joint angles or clearance of the '
          'legs, or `singularity.stop_condition`, about the origin of the platform. It is 0 if '
          'the pose exceeds a limit already; without a limit on the way it is one turn for a '
          'rotation, the largest finite number for a translation. At most '
          f'{TRAVEL_RATE:g} Hz, computed while somebody subscribes', depth=1),
    Topic(JOINT_STATES, MODEL_TYPES[JOINT_STATES], 'positions of all joints of the URDF, for '
          '[robot_state_publisher](visualization.md#as-a-model); at most `visualization_rate`, '
          'while somebody subscribes'),
    Topic(TF, MODEL_TYPES[TF], '`base_frame` to `platform_frame`', 'publish_tf: true', depth=100),
    Topic(MARKERS, type_names.MARKER_ARRAY,
          '[visualization](visualization.md) for RViz and Foxglove; at most '
          '`visualization_rate`, while somebody subscribes', depth=1),
    Topic(DIAGNOSTICS, type_names.DIAGNOSTIC_ARRAY,
          'state of the node, one status for each part, see below'),
)

_INPUTS = {topic.name: topic for topic in SUBSCRIBED}

# Their messages have a stamp, by which a repetition is known as such.
_STAMPED = LEG_STATES, MOTOR_STATES


class NodeTopics:
    """
    Publishers and subscriptions of the node; created by ``make``.

    publishers: publishers by topic, without the node's name.
    setpoints, base: raw subscriptions to the setpoint topics and to the topics of the base.
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
             others: Mapping[str, Callable[[bytes], None]],
             publish_again: Callable[[str], None]) -> None:
        """
        Create all publishers and subscriptions.

        parameters: select the setpoint topics, the topics of the base, and whether markers, joint
            states, transforms and motors are published.
        on_setpoint, on_base: called with topic and bytes of a message on a setpoint topic, or on
            one of the base.
        others: called with the bytes of a message on each of the other topics.
        publish_again: called with a topic that a subscriber has joined late, see
            ``for_late_subscribers``.
        Raises ParameterError: ``publish_tf`` needs a package that is not installed.
        """
        there = {MARKERS: parameters.visualization_rate > 0.0, TF: parameters.publish_tf}
        there[JOINT_STATES] = there[MARKERS]
        there[MOTOR_STATES] = there[MOTOR_TORQUES] = bool(parameters.drives)
        there[SERVO_PULSES] = with_servos(parameters)
        there |= {topic: kind is parameters.leg_kind
                  for kind in KINDS for topic in LegTopics.of(kind)}
        for topic in PUBLISHED:
            if there.get(topic.name, True):
                self._publish(topic, publish_again)
        # The executor takes messages in the order of the subscriptions: a setpoint needs the
        # earlier messages of the base.
        self.base, self.setpoints = ({
            name: self._subscribe(_INPUTS[name], partial(take, name)) for name in names}
            for names, take in ((BASE_SOURCES[parameters.base.source], on_base),
                                (SOURCES[parameters.setpoint.source], on_setpoint)))
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

    def _publish(self, topic: Topic, publish_again: Callable[[str], None]) -> None:
        durability = (DurabilityPolicy.TRANSIENT_LOCAL if topic.latched
                      else DurabilityPolicy.VOLATILE)
        publisher = self._node.create_publisher(
            _message_class(topic.kind), topic.ros_name,
            QoSProfile(depth=topic.depth, durability=durability),
            event_callbacks=for_late_subscribers(
                self._node, partial(publish_again, topic.name), once=topic.name not in _STAMPED))
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
