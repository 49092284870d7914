# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node: takes setpoints, publishes leg lengths, forces and the singularity warning."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
import math
import time
from typing import Any, NamedTuple

from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import Trigger

from stewart_dynamics.description.model import JOINT_STATES, ModelMessages, TF
from stewart_dynamics.external_wrench import payload
from stewart_dynamics.external_wrench.estimate import (
    EXTERNAL_WRENCH, ExternalWrench, Target)
from stewart_dynamics.external_wrench.measured_legs import (
    LegHistory, MEASURED_LEGS, MeasuredLegs)
from stewart_dynamics.mechanics.drives.measured_efforts import leaves_wrench
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages.cdr import stamp_of
from stewart_dynamics.node.diagnostics.levels import LogLine, WARN
from stewart_dynamics.node.diagnostics.periodic_report import DynamicsDiagnostics, TICK
from stewart_dynamics.node.markers import Markers
from stewart_dynamics.node.publishers_at_rate import (
    DiagnosticsPublisher, PublisherAtRate, TravelPublisher)
from stewart_dynamics.node.tasks import (
    APPLY_PAYLOAD, inertia_message, LENGTH, PAUSE, PayloadService, TaskQueue)
from stewart_dynamics.node.topics import MARKERS, NodeTopics, PAYLOAD, TRAVEL
from stewart_dynamics.parameters.table import AS_MEASURED, Parameters, payload_values
from stewart_dynamics.planned import trajectory_messages as planned
from stewart_dynamics.ros.late_subscribers import is_simulated
from stewart_dynamics.ros.managed_node import ManagedNode
from stewart_dynamics.ros.rclpy_workarounds import OneShotTimer
from stewart_dynamics.ros.run import run
from stewart_dynamics.ros.signal_flag import SIGNALS
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH, BaseWrench
from stewart_dynamics.setpoints.input_messages import WRENCH
from stewart_dynamics.setpoints.joining import Setpoints
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.rejections import (
    DROPPED, NOT_EXCLUSIVE, Rejection, stamp_words)
from stewart_dynamics.setpoints.step import Batch, EXCEEDING, Outputs, Step
from stewart_dynamics.setpoints.unanswered import unanswered


# If more setpoints wait, the node has fallen behind, and only the newest is answered.
BACKLOG = 100

# A message that arrives later than this after the last one was handled [s] has not waited, because
# the executor needs less time between two messages. The task that gathers waiting messages, which
# takes a tenth of the processor time, is then not needed.
_REST = 0.0003


class _Models(NamedTuple):
    """Models that share one set of parameters."""

    step: Step
    messages: OutputMessages
    external_wrench: ExternalWrench
    base_wrench: BaseWrench

    @classmethod
    def of(cls, parameters: Parameters) -> _Models:
        return cls(Step(parameters), OutputMessages(parameters), ExternalWrench(parameters),
                   BaseWrench(parameters))


class DynamicsNode(ManagedNode[Parameters]):
    """
    Answers each joined setpoint with leg lengths, rates and forces.

    Raises ParameterError if the parameters break a rule: then nothing starts.
    """

    def __init__(self) -> None:
        super().__init__(Parameters)
        self._topics = NodeTopics(self)
        self._base_wrench_read = False  # it has a subscriber
        self._kept: dict[str, bytes] = {}  # last setpoint messages, with use_sim_time
        self._simulated = is_simulated(self)
        if self._simulated:
            self._jumps = self.get_clock().create_jump_callback(
                JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                              on_clock_change=False), post_callback=self._on_clock_back)
        self._planned: TaskQueue[planned.PlannedOutcome] = TaskQueue(
            partial(OneShotTimer, self, PAUSE), self._on_outcome)
        self._payload = PayloadService(self, self._identify_payload, self._on_payload)
        self._identified: payload.Payload | None = None  # the last one
        self.create_service(Trigger, f'~/{APPLY_PAYLOAD}', self._on_apply_payload)
        # A steady clock: ROS time may stand still or jump.
        self.create_timer(TICK, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.start()

    # -- lifecycle --------------------------------------------------------------------------

    def begin_work(self) -> None:
        """Begin to answer; earlier messages are not used."""
        parameters, models = self._settings, self._models
        self._identified = None
        self._setpoints = Setpoints(parameters, self._on_rejection, self._on_notice)
        self._setpoints.answer_setpoints(models.step, models.messages, self._publish_answer)
        self._history = LegHistory(parameters.payload.window)
        self._measured_legs = MeasuredLegs(
            parameters, models.external_wrench, self._on_rejection, self._on_notice,
            self._history)
        self._diagnostics = DynamicsDiagnostics(
            parameters, self._setpoints.topics, self._setpoints.base.topics, time.monotonic())
        self._heard = self._diagnostics.setpoints.heard
        self._waiting: list[tuple[Batch, float]] = []  # single setpoints, and times of arrival
        self._gathering = False  # a task answers them after the messages received
        self._last: tuple[Batch, Outputs] | None = None  # the last answered setpoint
        self._answered: dict[str, bytes] = {}  # its messages, with use_sim_time
        publishers, rate = self._topics.publishers, parameters.visualization_rate
        self._markers = PublisherAtRate(publishers.get(MARKERS), rate, Markers(parameters).write)
        self._joint_states = PublisherAtRate(
            publishers.get(JOINT_STATES), rate, self._model_messages.joint_states)
        self._transforms_read = False  # they have a subscriber
        self._travel = TravelPublisher(parameters, publishers[TRAVEL])
        self._model_measured = parameters.joint_states.source == AS_MEASURED
        self._handled, self._rested = -math.inf, False

    def open_topics(self) -> None:
        """Make the models and open the topics."""
        begun = time.monotonic()
        self._models = SIGNALS.interruptible(partial(_Models.of, self._settings))
        self.get_logger().info(f'dynamics ready after {time.monotonic() - begun:.1f} s')
        self._model_messages = ModelMessages(self._settings)
        self._topics.make(self._settings, self._on_setpoint, self._on_base, {
            WRENCH: self._on_wrench, MEASURED_LEGS: self._on_measured_legs,
            planned.INPUT: self._on_trajectory}, self._publish_again)
        self._kept.clear()
        self._diagnostics_publisher = DiagnosticsPublisher(
            self, self._topics, self._log, self._settings)
        self._exclusive = self._settings.setpoint.exclusive

    def close_topics(self) -> None:
        self._topics.destroy()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work; a simulation may wait for the answer to a setpoint that came before."""
        done = super().on_activate(state)
        self._take_kept()
        return done

    # -- a simulation whose clock waits for answers -----------------------------------------

    def _on_clock_back(self, jump: Any) -> None:
        """Follow /clock where it jumps back, also by less than ``setpoint.timeout``."""
        if self._active:
            self._setpoints.restart('/clock has jumped back')
            self._take_kept()

    def _take_kept(self) -> None:
        """Take the last messages again that are not of a time to come."""
        now = self._ros_time()
        for topic, data in list(self._kept.items()):
            if (stamp_of(data) or 0) <= now:
                self._on_setpoint(topic, data)

    def _publish_again(self, topic: str) -> None:
        """Publish the last answer on a topic again, if there was one on it."""
        if self._active and topic in self._answered:
            self._topics.publishers[topic].publish(self._answered[topic])

    # -- setpoints: from the topic to the published answer ----------------------------------

    def _on_setpoint(self, topic: str, data: bytes) -> None:
        if self._simulated:
            self._kept[topic] = data
        if not self._active:
            return
        came = time.monotonic()
        self._heard[topic] = came
        self._rested = self._rested or came - self._handled > _REST
        if not self._exclusive or self._is_only_writer(topic):
            self._setpoints.hold_answers(self._gathering)
            setpoint = self._setpoints.join_message(topic, data, self._ros_time)
            if len(setpoint.stamps):
                if self._gathering:
                    self._waiting.append((setpoint, came))
                else:
                    self._note_answer(setpoint, came)
                    self._end_answers()
        self._handled = time.monotonic()

    def _answer_waiting(self) -> None:
        """
        Answer the waiting setpoints in order; only the newest if more than BACKLOG wait.

        After setpoints have waited, the next ones are gathered first: a node that has fallen
        behind must not answer every late setpoint.
        """
        self._gathering = False
        if not self._active or not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        for setpoint, came in waiting if len(waiting) <= BACKLOG else [self._newest(waiting)]:
            self._setpoints.answer_setpoint(setpoint)
            self._note_answer(setpoint, came)
        self._end_answers()

    def _end_answers(self) -> None:
        """Publish topics with a rate; gather the next setpoints if these have waited."""
        self._publish_due(time.monotonic())
        rested, self._rested = self._rested, False
        if not rested:
            self._gathering = True
            executor: Any = self.executor
            executor.create_task(self._answer_waiting)

    def _newest(self, waiting: list[tuple[Batch, float]]) -> tuple[Batch, float]:
        """Drop and count all setpoints but the newest, which is a restart if one of them is."""
        *dropped, (newest, came) = waiting
        for setpoint, _ in dropped:
            self._setpoints.reject('setpoint', DROPPED, stamp_words(int(setpoint.stamps[0])))
        restart = any(setpoint.restarts[0] for setpoint, _ in waiting)
        return newest.replaced(restarts=restart), came

    def _publish_answer(self, answered: dict[str, bytes]) -> None:
        """Publish the messages of an answer by topic."""
        publishers = self._topics.publishers
        for topic, message in answered.items():
            publishers[topic].publish(message)
        if self._simulated:
            self._answered = answered

    def _note_answer(self, setpoint: Batch, came: float) -> None:
        """Note the answer to a single setpoint, or why it cannot be answered."""
        outputs = self._setpoints.last_outputs()
        if not len(outputs.stamps):
            for reason in unanswered(self._models.step.parameters, setpoint, outputs):
                self._setpoints.reject('setpoint', *reason)
            return
        if self._base_wrench_read:
            topic, known, messages = self._models.messages.write_base_wrenches(
                outputs.stamps, self._models.base_wrench(setpoint))
            if known[0]:
                self._topics.publishers[topic].publish(messages.tobytes())
        self._note(setpoint, outputs, came)

    def _note(self, setpoint: Batch, outputs: Outputs, came: float) -> None:
        """Pass the answer to other publishers and diagnostics."""
        self._last = setpoint, outputs
        motion = setpoint.motions[0]
        exceedances = (
            self._models.step.exceedances(outputs) if outputs.rows[0, EXCEEDING] else ())
        self._markers.note(setpoint, outputs, exceedances)
        self._travel.note(motion)
        if not self._model_measured:
            self._moved(setpoint.stamps[0], motion)
        now = time.monotonic()
        if setpoint.moving and not setpoint.base_known[0]:
            self._diagnostics.base.unknown(now)
        if not self._diagnostics.answers.number:
            self._diagnostics.begins(motion.tolist(), outputs.determinants[0])
        if self._diagnostics.answered(setpoint, outputs, exceedances, came, now):
            self._report()
        self._setpoints.check_samples()

    def _target(self) -> Target | None:
        if self._last is None:
            return None
        setpoint, outputs = self._last
        return Target(setpoint.motions[0].tolist(), float(outputs.determinants[0]))

    def _moved(self, stamp: int, pose: Any) -> None:
        """Publish the transform of a pose, a row of motion; note it for the joint states."""
        self._joint_states.note(stamp, pose)
        if self._transforms_read:
            self._topics.publishers[TF].publish(self._model_messages.transform(stamp, pose))

    def _publish_due(self, now: float) -> None:
        self._markers.publish_due(now)
        self._joint_states.publish_due(now)
        self._travel.publish_due(now)

    def _is_only_writer(self, topic: str) -> bool:
        """Return whether a topic has only one writer; reject a message on it otherwise."""
        writers = self._topics.writers_of(topic)
        self._diagnostics.setpoints.found_writers(topic, writers)
        if writers > 1:
            self._setpoints.reject(topic, NOT_EXCLUSIVE, f'{writers} writers')
        return writers <= 1

    def _ros_time(self) -> int:
        now: int = self.get_clock().now().nanoseconds
        return now

    # -- base, wrench, measured legs, planned trajectories ----------------------------------

    def _on_base(self, topic: str, data: bytes) -> None:
        if self._active:
            now = time.monotonic()
            self._diagnostics.base.heard[topic] = now
            if self._exclusive and not self._is_only_writer(topic):
                return
            if self._setpoints.base.join_message(topic, data, self._ros_time):
                self._diagnostics.base.sampled(self._setpoints.base, now)

    def _on_wrench(self, data: bytes) -> None:
        if self._active:
            self._setpoints.join_message(WRENCH, data, self._ros_time)

    def _on_measured_legs(self, data: bytes) -> None:
        if not self._active:
            return
        now = time.monotonic()
        diagnostics = self._diagnostics.external_wrench
        diagnostics.heard(now)
        target = self._target()
        estimate = self._measured_legs.use_message(
            data, self._setpoints.wrench, target, self._setpoints.base)
        if estimate is None:
            return
        if self._model_measured:
            self._moved(estimate.stamp, estimate.motion)
            self._joint_states.publish_due(now)
        if estimate.published is not None:
            self._topics.publishers[EXTERNAL_WRENCH].publish(
                self._models.messages.write_wrench(estimate.stamp, estimate.published))
        diagnostics.estimated(estimate, target and target.motion, now)
        if self._diagnostics.level_changed(now):
            self._report()

    def _identify_payload(
            self) -> Iterator[payload.PayloadOutcome | None] | payload.PayloadOutcome:
        if not self._active:
            return payload.PayloadOutcome('the node is not active')
        if silence := self._diagnostics.external_wrench.silence(time.monotonic()):
            return payload.PayloadOutcome(silence)
        error = self._measured_legs.possible_error
        if error and not leaves_wrench(error):
            return payload.PayloadOutcome(f'possible error: {error.text}')
        # Parameters are those of now, whatever changes meanwhile.
        return payload.identify(self._history, StewartPlatform(self._settings))

    def _on_payload(self, outcome: payload.PayloadOutcome, seconds: float) -> None:
        if not self._active:
            return
        if outcome.payload:
            self._identified = outcome.payload
            self._topics.publishers[PAYLOAD].publish(
                inertia_message(outcome.payload, self._settings.platform_frame))
        self._diagnostics.payload.done(outcome, seconds)
        self._report()

    def _on_apply_payload(
            self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Take the payload that was identified last as ``payload.*``."""
        found = self._identified and payload.carried_payload(
            self._identified._replace(given=self._settings.platform.body))
        if found is None:
            response.message = 'no payload is identified: call ~/identify_payload first'
        elif isinstance(found, str):
            response.message = found
        else:
            result = self.set_parameters_atomically([
                RosParameter(name, value=value if isinstance(value, float) else value.tolist())
                for name, value in payload_values(found).items()])
            response.success = result.successful
            response.message = result.reason or f'payload: {payload.body_words(found)}'
        return response

    def _on_trajectory(self, data: bytes) -> None:
        if not self._active:
            return
        now = time.monotonic()
        if self._planned.full:
            self._on_outcome(
                planned.rejected(planned.QUEUE_FULL, f'{LENGTH} are in work or wait'), now)
            return
        # Parameters, load and gravity are those of now, whatever changes meanwhile.
        base = self._setpoints.base.at_rest(known=not self._diagnostics.base.stale(now))
        measured = (
            self._measured_legs.motion if now - self._diagnostics.external_wrench.used_at
            <= self._settings.setpoint.timeout else None)
        self._planned.add(planned.answer(
            self._settings, self._setpoints.wrench, data, base, measured), now)

    def _on_outcome(self, outcome: planned.PlannedOutcome, came: float) -> None:
        if outcome.answer:
            self._topics.publishers[planned.OUTPUT].publish(outcome.answer)
        self._diagnostics.planned_trajectory.done(outcome, time.monotonic() - came)
        self._report()

    def end_work(self) -> None:
        """Drop the work in progress."""
        self._payload.drop('the node is deactivated')
        if number := self._planned.drop():
            self.get_logger().warning(
                f'planned trajectories dropped, because the node is deactivated: {number}')

    # -- diagnostics and log ----------------------------------------------------------------

    def _on_rejection(self, rejection: Rejection, details: str) -> None:
        self._diagnostics.rejected(rejection, details, time.monotonic())
        self._log.write([LogLine(WARN, rejection.words(details), rejection)])

    def _on_notice(self, text: str) -> None:
        # Two writers whose clocks differ restart with every setpoint.
        self._log.write([LogLine(WARN, text, text[:20])])

    def _on_tick(self) -> None:
        now = time.monotonic()
        self._log.write_last(now)
        if not self._active:
            return
        publishers = self._topics.publishers
        self._base_wrench_read = publishers[BASE_WRENCH].get_subscription_count() > 0
        self._publish_due(now)  # the last answer before a silence
        self._transforms_read = (
            TF in publishers and publishers[TF].get_subscription_count() > 0)
        if notice := self._travel.look():
            self._log.write([LogLine(WARN, notice)])
        self._diagnostics.note_errors(self._setpoints.possible_errors(), now)
        if self._diagnostics.due_at_tick(now):
            self._report()

    def _report(self) -> None:
        self._diagnostics_publisher.publish(self._diagnostics)

    # -- parameters -------------------------------------------------------------------------

    def use_parameters(self, parameters: Parameters) -> None:
        """Use changed parameters from the next setpoint on."""
        self._models = models = _Models.of(parameters)
        if self._active:
            self._setpoints.answer_setpoints(models.step, models.messages, self._publish_answer)
            self._measured_legs.use_parameters(parameters, models.external_wrench)
            self._diagnostics.answers.parameters = parameters
            self._markers.write = Markers(parameters).write  # a payload moves the centre of mass
            self._travel.use(parameters)


def main() -> int:
    """Run the node; exit code 0, or 1 where its parameters break a rule."""
    return run(DynamicsNode, Parameters)
