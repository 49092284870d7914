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

"""The node: setpoints in, leg lengths, forces and the warning of a singularity out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import suppress
from functools import partial
import gc
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.logging import get_logger
from rclpy.parameter import Parameter as RosParameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, qos_policy_name_from_kind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.mechanics import jit as compiled
from stewart_dynamics.mechanics.plausibility import doubts
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.messages.diagnostics import diagnostics
from stewart_dynamics.nodes.markers import Markers
from stewart_dynamics.nodes.rclpy_workarounds import until_shutdown
from stewart_dynamics.nodes.run import declare_parameters, run
from stewart_dynamics.parameter_files import is_of_ros
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.runtime import planned_trajectory as planned
from stewart_dynamics.runtime.diagnostics import Diagnostics, OK, Status, WARN
from stewart_dynamics.runtime.external_wrench import EXTERNAL_WRENCH, ExternalWrench, Measurement
from stewart_dynamics.runtime.external_wrench_diagnostics import WrenchDiagnostics
from stewart_dynamics.runtime.input_topics import INPUT_TYPES, SOURCES, WRENCH
from stewart_dynamics.runtime.measured_legs import MEASURED_LEGS, MeasuredLegs
from stewart_dynamics.runtime.output_messages import OUTPUT_TYPES, OutputMessages
from stewart_dynamics.runtime.planned_trajectory_diagnostics import PlannedDiagnostics
from stewart_dynamics.runtime.rejections import DROPPED, NOT_EXCLUSIVE, OUT_OF_RANGE, Rejection
from stewart_dynamics.runtime.repeated_events import Series
from stewart_dynamics.runtime.setpoints import Setpoints
from stewart_dynamics.runtime.step import Output, Setpoint, Step

_TYPES: dict[str, Any] = {
    'geometry_msgs/msg/PoseStamped': PoseStamped,
    'geometry_msgs/msg/TwistStamped': TwistStamped,
    'geometry_msgs/msg/AccelStamped': AccelStamped,
    'geometry_msgs/msg/WrenchStamped': WrenchStamped,
    'trajectory_msgs/msg/MultiDOFJointTrajectory': MultiDOFJointTrajectory,
    'sensor_msgs/msg/JointState': JointState,
    'std_msgs/msg/Float64MultiArray': Float64MultiArray,
    'std_msgs/msg/Float64': Float64,
    'std_msgs/msg/Bool': Bool,
}

# So many messages of a topic may wait in the middleware, so many joined setpoints here.
# When more setpoints wait the node has fallen behind: only the newest is answered.
_QUEUE = 1000
_BACKLOG = 100
# So many trajectories may wait in the middleware, so many be in work or wait here.
_PLANS = 5
# Between two pieces of the work on them; a node that computed all the time would be made to wait
# by an operating system that others ask for time as well, and its setpoints with it [s].
_PLAN_PAUSE = 0.001

# What controllers read; in the diagnostics stands how many do.
_READ = ('leg_states', 'leg_forces')

_WATCH_SECONDS = 0.05
_REPORT_SECONDS = 1.0


class DynamicsNode(LifecycleNode):
    """
    Answers each joined setpoint with leg lengths, rates and forces.

    Raises ParameterError where the parameters break a rule: nothing starts then.
    """

    def __init__(self) -> None:
        # Undeclared parameters are allowed so that they come to our own check, which refuses
        # them with a better text.
        super().__init__('stewart_dynamics', automatically_declare_parameters_from_overrides=True,
                         allow_undeclared_parameters=True)
        self._settings = declare_parameters(self, Parameters)
        self._active = False
        self._configured = False
        self._close_io: list[Callable[[], Any]] = []
        self._series = Series()
        # Trajectories in work, and when they came; the timer runs while there are some.
        self._plans: deque[tuple[Iterator[planned.Outcome | None], float]] = deque()
        self._plan_timer = self.create_timer(
            _PLAN_PAUSE, until_shutdown(self, self._plan),
            clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._plan_timer.cancel()
        self.add_on_set_parameters_callback(self._on_set_parameters)
        # A steady clock: ROS time may stand still or jump.
        self.create_timer(_WATCH_SECONDS, until_shutdown(self, self._on_watch),
                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._answer_impossible_transitions()
        self._set_parameters_together()
        if compiled.HINT:
            self.get_logger().warning(compiled.HINT)
        if self._settings['autostart']:
            if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                raise StewartError(f'cannot be configured: {self._fault}')
            self.trigger_activate()
        else:
            self.get_logger().info('unconfigured: autostart is false')

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Compile the dynamics and open the topics."""
        try:
            self._configure()
        except Exception as exc:
            # rclpy turns an exception in a transition into ERROR without a word.
            self._fault = ' '.join(f'{type(exc).__name__}: {exc}'.split())
            self.get_logger().error(f'cannot be configured: {self._fault}')
            self._close()
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to answer, as if nothing had come before."""
        now = time.monotonic()
        self._setpoints = Setpoints(self._settings, self._on_rejection, self._on_notice)
        self._measured_legs = MeasuredLegs(
            self._settings, self._external_wrench, self._on_rejection, self._on_notice)
        self._wrench_diagnostics = WrenchDiagnostics(self._settings)
        self._planned_diagnostics = PlannedDiagnostics()
        self._diagnostics = Diagnostics(self._settings, self._setpoints.topics, now, [
            self._planned_diagnostics, self._wrench_diagnostics])
        self._waiting: deque[tuple[Setpoint, float]] = deque()  # and when they came
        self._last: Output | None = None
        self._target: tuple[float, ...] | None = None  # the motion of the last one answered
        self._undrawn: tuple[Setpoint, Output] | None = None
        self._draw_at = now if self._settings['visualization_rate'] else math.inf
        self._restarting = False  # the last one was a restart and could not be answered
        self._reported = self._answered_at = now
        self._busy = False
        self._logged: dict[str, int] = {}
        self._active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no more."""
        self._active = False
        self._give_up_plans()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the topics."""
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer no more and close the topics."""
        self._active = False
        self._give_up_plans()
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """Say what is left to say, and end."""
        # Its own logger would complain that /rosout is gone where a signal has ended ROS.
        logger = get_logger(f'{self.get_name()}.last')
        for line in self._series.over(math.inf):
            logger.warning(line)
        super().destroy_node()

    def _configure(self) -> None:
        self._step = Step(self._settings)
        self._messages = OutputMessages(self._settings)
        self._external_wrench = ExternalWrench(self._settings)
        begun = time.monotonic()
        # The first call compiles; it shall not wait for the first setpoint.
        self._step(Setpoint(0, (0.0,) * MOTION), None)
        planned.compile_ahead(self._settings)
        with suppress(StewartError):  # no legs have such lengths
            self._external_wrench(
                Measurement(0, NO_WRENCH, NO_WRENCH, NO_WRENCH), None, NO_WRENCH, None)
        self.get_logger().info(f'dynamics ready after {time.monotonic() - begun:.1f} s')
        for doubt in doubts(self._settings):
            self.get_logger().warning(doubt)
        self._publishers_of: dict[str, Publisher] = {}
        for topic, name in OUTPUT_TYPES.items():
            qos = QoSProfile(depth=10)
            if topic == 'singularity_warning':
                qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self._publishers_of[topic] = self._publisher(_TYPES[name], f'~/{topic}', qos)
        self._wrench_publisher = self._publisher(
            WrenchStamped, f'~/{EXTERNAL_WRENCH}', QoSProfile(depth=10))
        self._plan_publisher = self._publisher(
            JointTrajectory, f'~/{planned.OUTPUT}', QoSProfile(depth=_PLANS))
        self._diagnostics_publisher = self._publisher(
            DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        if self._settings['visualization_rate']:
            self._markers = Markers(self._settings)
            self._markers_publisher = self._publisher(
                MarkerArray, '~/markers', QoSProfile(depth=1))
        topics = SOURCES[self._settings['setpoint.source']]
        self._exclusive = self._settings['setpoint.exclusive']
        self._answer_task = until_shutdown(self, self._answer)
        self._inputs = {
            topic: self._subscribe(_TYPES[INPUT_TYPES[topic]], topic,
                                   partial(self._on_setpoint, topic)) for topic in topics}
        self._subscribe(WrenchStamped, WRENCH, self._on_wrench)
        self._subscribe(JointState, MEASURED_LEGS, self._on_measured_legs)
        self._subscribe(MultiDOFJointTrajectory, planned.INPUT, self._on_trajectory, _PLANS)
        self._topic_names = {topic: subscription.topic_name
                             for topic, subscription in self._inputs.items()}
        self._configured = True
        # What is there now stays: the collector would look at all of it again and again, for
        # 50 ms and more, while a setpoint waits.
        gc.unfreeze()  # what an earlier configuration has left
        gc.collect()
        gc.freeze()

    def _publisher(self, kind: Any, topic: str, qos: QoSProfile) -> Publisher:
        publisher = self.create_publisher(kind, topic, qos)
        self._close_io.append(partial(self.destroy_publisher, publisher))
        return publisher

    def _subscribe(self, kind: Any, topic: str, callback: Any, depth: int = _QUEUE) -> Any:
        subscription = self.create_subscription(
            kind, f'~/{topic}', until_shutdown(self, callback), QoSProfile(depth=depth), raw=True,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=partial(self._on_incompatible_qos, topic)))
        self._close_io.append(partial(self.destroy_subscription, subscription))
        return subscription

    def _on_incompatible_qos(self, topic: str, event: Any) -> None:
        self.get_logger().error(
            f'{topic}: a publisher offers an incompatible quality of service, policy '
            f'{qos_policy_name_from_kind(event.last_policy_kind)}: it is not heard')

    def _close(self) -> None:
        self._configured = False
        while self._close_io:
            self._close_io.pop()()

    def _answer_impossible_transitions(self) -> None:
        """
        Answer a request for a transition that the present state does not have.

        rclpy 7.1 raises it out of spin instead, and the asker waits for ever.
        """
        service = self._service_change_state
        change_state = service.callback

        def answer(request: Any, response: Any) -> Any:
            try:
                return change_state(request, response)
            except RCLError as exc:
                text = f'transition refused: {exc}'
                if (line := self._series.add(text, text, time.monotonic())) is not None:
                    self.get_logger().error(line)
                response.success = False
                return response

        service.callback = answer

    def _set_parameters_together(self) -> None:
        """
        Take all parameters of one request or none.

        rclpy sets one after the other, and keeps the first when it refuses the second.
        """
        def set_together(request: Any, response: Any) -> Any:
            try:
                result = self.set_parameters_atomically(
                    [RosParameter.from_parameter_msg(message) for message in request.parameters])
            except (RuntimeError, TypeError, ValueError) as exc:  # a type that does not exist
                result = SetParametersResult(successful=False, reason=str(exc))
            response.results = [result] * len(request.parameters)
            return response

        for service in self.services:
            if service.srv_name.endswith('/set_parameters'):
                service.callback = set_together

    # -- setpoints ------------------------------------------------------------------------

    def _on_setpoint(self, topic: str, data: bytes) -> None:
        if not self._active:
            return
        now = time.monotonic()
        self._diagnostics.heard(topic, now)
        if self._exclusive:
            writers = self.count_publishers(self._topic_names[topic])
            self._diagnostics.writers[topic] = writers
            if writers > 1:
                self._setpoints.reject(topic, NOT_EXCLUSIVE, f'{writers} writers')
                return
        setpoint = self._setpoints.take(topic, data, self._ros_time)
        if setpoint is None:
            return
        self._waiting.append((setpoint, now))
        if not self._busy:
            self._answer()

    def _ros_time(self) -> int:
        now: int = self.get_clock().now().nanoseconds
        return now

    def _on_wrench(self, data: bytes) -> None:
        if self._active:
            self._setpoints.take_wrench(data)

    def _on_measured_legs(self, data: bytes) -> None:
        if not self._active:
            return
        now = time.monotonic()
        self._wrench_diagnostics.heard(now)
        estimate = self._measured_legs.take(data, self._setpoints.wrench, self._target)
        if estimate is None:
            return
        if estimate.wrench is not None:
            self._wrench_publisher.publish(self._messages.of_estimate(estimate))
        if self._wrench_diagnostics.estimated(estimate, self._target, now):
            self._report()

    def _answer(self) -> None:
        """
        Answer what waits: all of it, or the newest where the node has fallen behind.

        And do so again behind the messages that have come meanwhile: until nothing has waited
        there, setpoints are gathered and not answered one by one, however late.
        """
        if not self._active:
            return
        self._busy = True
        if isinstance(self.executor, SingleThreadedExecutor):
            self._take_what_has_come()
        if not self._waiting:
            self._busy = False
            return
        if len(self._waiting) > _BACKLOG:
            self._pass_over()
        while self._waiting:
            setpoint, came = self._waiting.popleft()
            if self._restarting:
                setpoint = setpoint._replace(restart=True)
            before = None if self._last is None else self._last.singularity
            output = self._step(setpoint, before)
            if output is None:
                self._restarting = setpoint.restart
                self._setpoints.reject(
                    'setpoint', OUT_OF_RANGE, f'stamp {setpoint.stamp} ns')
                continue
            self._restarting = False
            for topic, message in self._messages.of_output(output):
                self._publishers_of[topic].publish(message)
            self._last, self._target = output, setpoint.motion
            self._undrawn = setpoint, output
            self._answered_at = time.monotonic()
            if (self._diagnostics.answered(output, came, self._answered_at)
                    or self._answered_at - self._reported >= _REPORT_SECONDS):
                self._report()
        self._draw(self._answered_at)
        executor: Any = self.executor
        executor.create_task(self._answer_task)

    def _draw(self, now: float) -> None:
        """Publish the markers of the last answer if they are due and somebody looks."""
        if self._undrawn is None or now < self._draw_at:
            return
        setpoint, output = self._undrawn
        # Who looks only later gets no picture of what was long ago.
        self._undrawn = None
        self._draw_at = now + 1.0 / self._settings['visualization_rate']
        if self._markers_publisher.get_subscription_count():
            self._markers_publisher.publish(self._markers.write(setpoint.motion, output))

    def _pass_over(self) -> None:
        """Let nothing wait but the newest setpoint, and count the others."""
        newest, came = self._waiting.pop()
        for passed, _ in self._waiting:
            self._setpoints.reject('setpoint', DROPPED, f'stamp {passed.stamp} ns')
        restart = newest.restart or any(passed.restart for passed, _ in self._waiting)
        self._waiting.clear()
        self._waiting.append((newest._replace(restart=restart), came))

    def _take_what_has_come(self) -> None:
        """
        Take the setpoint messages that wait in the middleware.

        The events executor has taken them when it comes to a task; the single-threaded one runs
        a task first, and would answer one setpoint after the other, however late.
        """
        came = True
        for _ in range(_QUEUE):
            if not came:
                return
            came = False
            for topic, subscription in self._inputs.items():
                with subscription.handle:
                    taken = subscription.handle.take_message(subscription.msg_type, True)
                if taken is not None:
                    came = True
                    self._on_setpoint(topic, taken[0])

    # -- planned motions ------------------------------------------------------------------

    def _on_trajectory(self, data: bytes) -> None:
        if not self._active:
            return
        now = time.monotonic()
        if len(self._plans) == _PLANS:
            self._tell(planned.refused(planned.TOO_MANY, f'{_PLANS} are in work or wait'), now)
            return
        # Parameters and load are those of now, whatever changes meanwhile.
        self._plans.append(
            (planned.answer(self._settings, self._setpoints.wrench, data), now))
        self._plan_timer.reset()

    def _plan(self) -> None:
        """Do a piece of the work on the trajectory whose turn it is."""
        self._plan_timer.cancel()
        if not self._plans:  # given up
            return
        work, came = self._plans[0]
        outcome = next(work)
        if outcome is not None:
            self._plans.popleft()
            if outcome.answer:
                self._plan_publisher.publish(outcome.answer)
            self._tell(outcome, came)
        if self._plans:
            self._plan_timer.reset()

    def _tell(self, outcome: planned.Outcome, came: float) -> None:
        """Say what has become of a trajectory."""
        now = time.monotonic()
        status = self._planned_diagnostics.done(outcome, now - came)
        if outcome.reason:
            self._logged[status.name] = status.level  # it is said here, each refusal
            line = self._series.add(outcome.reason, f'trajectory {outcome.message}', now)
            if line is not None:
                self.get_logger().error(line)
        self._report()

    def _give_up_plans(self) -> None:
        if self._plans:
            self.get_logger().warning(
                f'trajectories given up, the node is deactivated: {len(self._plans)}')
            self._plans.clear()

    # -- words ----------------------------------------------------------------------------

    def _on_rejection(self, rejection: Rejection, details: str) -> None:
        of = self._wrench_diagnostics if rejection.topic == MEASURED_LEGS else self._diagnostics
        of.refused(rejection, details, time.monotonic())
        self._say(rejection, rejection.words(details))

    def _on_notice(self, text: str) -> None:
        # Two writers whose clocks differ restart with every setpoint.
        self._say(text[:20], text)

    def _say(self, kind: Hashable, text: str) -> None:
        if (line := self._series.add(kind, text, time.monotonic())) is not None:
            self.get_logger().warning(line)

    def _on_watch(self) -> None:
        now = time.monotonic()
        for line in self._series.over(now):
            self.get_logger().warning(line)
        if not self._active:
            return
        self._draw(now)  # the last answer before a silence
        # While setpoints are answered it is done behind an answer, when time is left for it.
        due = (now - self._answered_at >= _WATCH_SECONDS
               and now - self._reported >= _REPORT_SECONDS - 0.5 * _WATCH_SECONDS)
        if due or self._diagnostics.level_changed(now):
            self._report()

    def _report(self) -> None:
        now = time.monotonic()
        self._reported = now
        full_name = self.get_fully_qualified_name()
        self._diagnostics.writers = {topic: self.count_publishers(name)
                                     for topic, name in self._topic_names.items()}
        self._diagnostics.readers = {
            topic: self._publishers_of[topic].get_subscription_count() for topic in _READ}
        self._diagnostics.namesakes = full_name, self.get_node_names_and_namespaces().count(
            (self.get_name(), self.get_namespace()))
        name = full_name.lstrip('/')
        statuses = self._diagnostics.report(now)
        self._log_changes(statuses[1:])
        self._diagnostics_publisher.publish(diagnostics(
            self._ros_time(), [(each.level, (f'{name}: {each.name}', each.message, name),
                                each.values) for each in statuses]))

    def _log_changes(self, statuses: Iterable[Status]) -> None:
        for status in statuses:
            if status.level != self._logged.get(status.name, OK):
                self._logged[status.name] = status.level
                text = f'{status.name}: {status.message}'
                # each level its own call: rclpy takes a call's level for constant
                if status.level == OK:
                    self.get_logger().info(text)
                elif status.level == WARN:
                    self.get_logger().warning(text)
                else:
                    self.get_logger().error(text)

    # -- parameters -----------------------------------------------------------------------

    def _on_set_parameters(self, changes: list[RosParameter]) -> SetParametersResult:
        """Take all of these, between two setpoints, or none."""
        ours = {change.name: change.value for change in changes if not is_of_ros(change.name)}
        try:
            for name, value in ours.items():
                if value is None:
                    raise ParameterError(f'{name}: cannot be unset')
            if self._configured:
                fixed = [name for name in ours if name in Parameters.table
                         and not Parameters.table[name].while_active]
                if fixed:
                    raise ParameterError(
                        f'{", ".join(fixed)}: only changed while the node is unconfigured: its '
                        'topics and its machine are made of it; deactivate and clean up first')
            parameters = self._settings.replaced(ours, exact_types=True)
            step, external_wrench = Step(parameters), ExternalWrench(parameters)
        except ParameterError as exc:
            return SetParametersResult(
                successful=False, reason=str(exc).removeprefix('parameters: '))
        self._tell_changes(parameters)
        self._settings = parameters
        if self._configured:
            self._step, self._external_wrench = step, external_wrench
        if self._active:
            self._diagnostics.parameters = parameters
            self._measured_legs.step = external_wrench
        return SetParametersResult(successful=True)

    def _tell_changes(self, parameters: Parameters) -> None:
        """Log what becomes another value, and what can hardly be meant by it."""
        changes = [f'{name}: {self._settings.given.get(name)} -> {value}'
                   for name, value in parameters.given.items()
                   if value != self._settings.given.get(name)]
        if changes:
            self.get_logger().info('; '.join(changes))
        before = doubts(self._settings, geometry=False)
        for doubt in doubts(parameters, geometry=False):
            if doubt not in before:
                self.get_logger().warning(doubt)


def main() -> int:
    """Run the node; exit code 0, or 1 where its parameters break a rule."""
    return run(DynamicsNode, Parameters)
