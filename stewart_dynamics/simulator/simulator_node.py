# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node: plant and base in real time, or one period for each command."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
import math
import time
from typing import Any, ClassVar

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics.arrays import SECOND, Six
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.standard import clock, float64_values
from stewart_dynamics.ros.declared_parameters import declare_parameters, MADE_WITH
from stewart_dynamics.ros.due_periods import DuePeriods
from stewart_dynamics.ros.late_subscribers import for_late_subscribers, is_simulated
from stewart_dynamics.ros.managed_node import keep_present_objects
from stewart_dynamics.ros.repeated_log import RepeatedLog, WARNING
from stewart_dynamics.ros.run import run
from stewart_dynamics.ros.signal_flag import SIGNALS
from stewart_dynamics.setpoints.input_messages import WrenchInput
from stewart_dynamics.setpoints.output_messages import LEG_STATES, MOTOR_STATES
from stewart_dynamics.setpoints.rejections import MALFORMED, NOT_FINITE, Rejection, Rejections
from stewart_dynamics.simulator.moving_base import BaseOfTopics, BasePeriod, GeneratedBase
from stewart_dynamics.simulator.plant import Plant, PlantState
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters, TORQUE
from stewart_dynamics.simulator.state_messages import (
    BASE_TYPES, BaseMessages, IMU, IMU_TYPE, INPUT_TYPES, OUTPUT_TYPES, StateMessages)

_TYPES: dict[str, Any] = {
    type_names.POSE_STAMPED: PoseStamped,
    type_names.TWIST_STAMPED: TwistStamped,
    type_names.ACCEL_STAMPED: AccelStamped,
    type_names.WRENCH_STAMPED: WrenchStamped,
    type_names.IMU: Imu,
    type_names.JOINT_STATE: JointState,
    type_names.FLOAT64_MULTI_ARRAY: Float64MultiArray,
}

_QUEUE = 1000
# Simulated time begins here [ns]: zero is no stamp.
_BEGIN = SECOND
_ANNOUNCE_SECONDS = 0.1
_PATIENCE = 20  # announcements without a command after which it is said that time stands still
_WATCH_SECONDS = 1.0

NOT_SIX = 'not six numbers'


class SimulatorNode(Node):
    """
    Moves the hexapod under the commanded efforts or torques, and publishes its state.

    Brakes hold it until the first command, and when none comes for ``command_timeout``. A base
    whose motion is generated is at rest until the first command, and then goes on.

    In real time it takes the periods that are due by a steady clock, several where it is late;
    periods that are later than 0.1 s are skipped. With ``use_sim_time`` each command is one
    period, and nothing else advances time.

    Raises ParameterError where the parameters break a rule.
    """

    plant: ClassVar[Callable[[SimulatorParameters], Any]] = Plant

    def __init__(self) -> None:
        super().__init__(SimulatorParameters.node, **MADE_WITH)
        self._settings = declare_parameters(self, SimulatorParameters)
        self._stepped = is_simulated(self)
        self._log = RepeatedLog(self.get_logger())
        for error in find_parameter_errors(self._settings):
            self.get_logger().warning(error)
        begun = time.monotonic()
        self._plant = SIGNALS.interruptible(partial(type(self).plant, self._settings))
        self._state_messages = StateMessages(self._settings)
        self._rejections = Rejections(self._on_rejection)
        self._wrench_input = WrenchInput(self._settings, self._rejections)
        source = self._settings.base_motion.source
        self._base: GeneratedBase | BaseOfTopics | None = (
            None if source == 'fixed' else GeneratedBase(self._settings) if source != 'topics'
            else BaseOfTopics(self._settings, self._rejections, self.get_logger().warning))
        self._base_messages = BaseMessages(self._settings)
        self._base_now: BasePeriod | None = None
        self._commands: Six | None = None
        self._torques = self._settings.commands == TORQUE
        self._index = 0
        self._braked = False
        self._commanded = 0  # the index at the last command
        self._begun = 0  # the index at the first one
        timeout = self._settings.command_timeout
        self._patience = math.inf if timeout is None else timeout * self._settings.rate
        rate: float = self._settings.rate
        self._periods = DuePeriods(rate, partial(self._say, 'late'), _BEGIN)
        qos = QoSProfile(depth=_QUEUE)
        self._messages: list[tuple[str, bytes]] = []
        self._outputs = {
            topic: self.create_publisher(
                _TYPES[kind], f'~/{topic}', qos,
                event_callbacks=for_late_subscribers(self, partial(self._publish_again, topic)))
            for topic, kind in self._output_types().items()}
        inputs: dict[str, Callable[[bytes], None]] = {
            'commands': self._on_commands, 'wrench': self._wrench_input.use_message}
        if isinstance(self._base, BaseOfTopics):
            inputs.update({topic: partial(self._on_base, self._base, topic)
                           for topic in BASE_TYPES})
        self._inputs = {topic: self.create_subscription(
            _TYPES[{**INPUT_TYPES, **BASE_TYPES}[topic]], f'~/{topic}', take, qos, raw=True)
            for topic, take in inputs.items()}
        self.get_logger().info(
            f'dynamics ready after {time.monotonic() - begun:.1f} s; ' + (
                'one period for each command' if self._stepped else 'in real time')
            + f', {rate:g} periods per second of {self._plant.steps} steps each')
        if self._stepped:
            self._clock_output = self.create_publisher(Clock, '/clock', qos)
            self._move_base()
            self._messages = self._messages_now()
            self._announcing = self._timer(_ANNOUNCE_SECONDS, self._announce)
            self._announced = 0  # since the last command
        else:
            self._timer(1.0 / rate, self._on_time)
        self._timer(_WATCH_SECONDS, self._on_watch)
        keep_present_objects()

    def _output_types(self) -> dict[str, str]:
        types = OUTPUT_TYPES | (
            {MOTOR_STATES: type_names.JOINT_STATE} if self._settings.drives else {})
        if self._base is None:
            return types
        generated = {} if isinstance(self._base, BaseOfTopics) else BASE_TYPES
        return {**types, **generated, IMU: IMU_TYPE}

    def _timer(self, seconds: float, callback: Any) -> Any:
        # ROS time stands still until it is advanced here, or jumps.
        steady = RosClock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(seconds, callback, clock=steady)

    def _on_commands(self, data: bytes) -> None:
        try:
            values = float64_values(data)
        except MalformedError as exc:
            self._rejections.reject('commands', MALFORMED, str(exc))
            return
        if len(values) != 6:
            self._rejections.reject('commands', NOT_SIX, f'{len(values)} numbers')
            return
        if not all(map(math.isfinite, values)):
            self._rejections.reject('commands', NOT_FINITE, str(values))
            return
        first, second, third, fourth, fifth, sixth = values
        if self._commands is None:
            self._begun = self._index
        if self._braked:
            self.get_logger().info('a command came: brakes released')
            self._braked = False
        self._commands = first, second, third, fourth, fifth, sixth
        self._commanded = self._index
        if self._stepped:
            self._announcing.reset()
            self._announced = 0
            self._advance()

    def _on_base(self, base: BaseOfTopics, topic: str, data: bytes) -> None:
        base.input.join_message(topic, data, lambda: self._periods.stamp_of(self._index))

    def _on_time(self) -> None:
        """Take the periods that are due."""
        if not self._periods.begun:
            self._periods.begin(self.get_clock().now().nanoseconds)
        for _ in self._periods.due(self._index + 1):
            self._advance()

    def _advance(self) -> None:
        """Take one period, with the brakes on until there is a command, and when they stop."""
        self._index += 1
        self._move_base()
        if self._commands is not None and self._index - self._commanded > self._patience:
            self._brake()
        if self._commands is not None and not self._plant.fault and not self._braked:
            state = self._plant.advance(self._commands, self._wrench_input.wrench,
                                        self._base_now and self._base_now.rows)
            if self._plant.fault:
                self.get_logger().error(self._plant.fault)
            elif self._applied(state) != self._commands:
                self._log_saturated(self._commands, self._applied(state))
        self._messages = self._messages_now()
        self._publish()

    def _applied(self, state: PlantState) -> tuple[float, ...]:
        return state.motors.torques if self._torques and state.motors else state.efforts

    def _brake(self) -> None:
        if not self._braked:
            self._braked = True
            self._plant.brake()
            self.get_logger().warning(
                f'no command for {self._settings.command_timeout:g} s: brakes engaged')

    def _move_base(self) -> None:
        """Move the base, if it moves, on to the end of the present period."""
        if self._base is not None:
            moved = 0 if self._commands is None else self._index - self._begun
            self._base_now = self._base.period(moved, self._periods.stamp_of(self._index))

    def _messages_now(self) -> list[tuple[str, bytes]]:
        stamp = self._periods.stamp_of(self._index)
        # The base first: who answers a state with a command has its motion, too.
        return [*(() if self._base_now is None else self._base_messages.write(
            stamp, self._index, self._base_now)),
            *self._state_messages.write(stamp, self._plant.measured())]

    def _announce(self) -> None:
        """Publish again the messages that are not answered: all until the first command."""
        if self._commands is None:
            self._publish()
        else:
            self._publish_clock()  # its subscribers are best effort and may have lost it
        self._announced += 1
        if self._announced >= _PATIENCE:
            topics = self._inputs['commands'].topic_name, self._outputs[LEG_STATES].topic_name
            self._say('standing', f'time stands still at {self._index / self._settings.rate:.3f} s'
                      f' since the start: no command for {_PATIENCE * _ANNOUNCE_SECONDS:g} s; '
                      f'{topics[0]} has {self.count_publishers(topics[0])} publishers, '
                      f'{topics[1]} {self.count_subscribers(topics[1])} subscribers')

    def _publish(self) -> None:
        for topic, message in self._messages:
            self._outputs[topic].publish(message)
        if self._stepped:
            self._publish_clock()

    def _publish_again(self, topic: str) -> None:
        for each, message in self._messages:
            if each == topic:
                self._outputs[topic].publish(message)

    def _publish_clock(self) -> None:
        self._clock_output.publish(clock(self._periods.stamp_of(self._index)))

    # -- logging --------------------------------------------------------------------------

    def _log_saturated(self, commands: Six, applied: tuple[float, ...]) -> None:
        joint, command, value = max(
            zip(self._settings.joints, commands, applied, strict=True),
            key=lambda leg: abs(leg[1] - leg[2]))
        kind = self._settings.leg_kind
        unit, limit = (('N m', 'drive.torque_max or drive.torque_speed') if self._torques
                       else (kind.effort.unit, kind.effort_limit))
        self._say('saturated', f'commands: {joint}: {command:.6g} {unit} exceeds {limit}, '
                  f'clipped to {value:.6g} {unit}')

    def _on_rejection(self, rejection: Rejection, details: str) -> None:
        self._say(rejection, rejection.words(details))

    def _say(self, kind: Hashable, text: str) -> None:
        self._log.write([(WARNING, text, kind)])

    def _on_watch(self) -> None:
        self._log.write_last(time.monotonic())


def main() -> int:
    """Run the node; exit code 0, or 1 where its parameters break a rule."""
    return run(SimulatorNode, SimulatorParameters)
