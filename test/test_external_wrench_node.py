# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The external wrench of the node in a process of its own, over real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import math
from typing import Any

from geometry_msgs.msg import InertiaStamped, WrenchStamped
from lifecycle_msgs.msg import Transition
from messages import joint_state
import numpy as np
import pytest
from rclpy.parameter import Parameter as RosParameter
from rclpy.serialization import deserialize_message
from referees import rng
from running import DynamicsNode, LATCHED, log_lines, nanoseconds, NODE
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.external_wrench.estimate import Estimate, ExternalWrench, Measurement
from stewart_dynamics.external_wrench.measured_legs import LegHistory, MeasuredLegs
from stewart_dynamics.external_wrench.payload import (
    carried_payload, identify, numbers_of, PayloadOutcome)
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.setpoints.output_messages import OutputMessages
from test_external_wrench import (
    BEGIN, HEXAPOD, HOME as AT_HOME, JOINTS, LOAD, measured, message_of, MILLISECOND, resting, six,
    swing, times, ZERO_LENGTHS)
from test_payload import excited, LOADED

Start = Callable[..., DynamicsNode]

OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))
STATUS = 'external wrench'
LEGS = 'measured_legs'


class Felt:
    """A node, and a hexapod whose legs are measured."""

    def __init__(self, node: DynamicsNode) -> None:
        self.node = node
        self.connect()
        self.raw = node.peer.listen(f'{NODE}/external_wrench', WrenchStamped)
        self.stamp = BEGIN

    def connect(self) -> None:
        """Begin to publish measured legs."""
        self._writer = self.node.peer.writer(f'{NODE}/{LEGS}', JointState)

    def until_heard(self) -> None:
        """Wait until the node answers and receives measured legs."""
        self.node.until_active()
        self.until_connected()

    def until_connected(self) -> None:
        """Wait until the node receives measured legs."""
        self.node.until(self._writer.get_subscription_count, 'the node hears measured legs')

    def disconnect(self) -> None:
        """Publish no more."""
        self.node.peer.node.destroy_publisher(self._writer)

    def publish(self, message: Any) -> None:
        """Publish a message, or bytes in the place of one."""
        self._writer.publish(message)

    def rest(self, load: tuple[float, ...] = LOAD, step: int = MILLISECOND) -> int:
        """Publish the hexapod at rest under a load, and return the stamp."""
        self.stamp += step
        self.publish(message_of(resting(HEXAPOD, AT_HOME, load, [self.stamp])[0]))
        return self.stamp

    def received(self) -> list[WrenchStamped]:
        """Return the external wrenches so far."""
        return [deserialize_message(data, WrenchStamped) for data in self.raw]

    def stamps(self) -> list[int]:
        """Return the stamps of them [ns]."""
        return [nanoseconds(each.header.stamp) for each in self.received()]

    def until_answered(self, stamp: int) -> None:
        """Wait until the measurement with a stamp has its wrench."""
        self.node.until(lambda: stamp in self.stamps(), 'the wrench comes')

    def until_status(self, level: bytes, text: str, load: tuple[float, ...] = LOAD) -> None:
        """Let the hexapod rest on until diagnostics have a level and a text in it."""
        def reported() -> bool:
            self.rest(load)
            status = self.node.status(STATUS)
            return bool(status.level == level) and text in status.message

        self.node.until(reported, f'diagnostics have {level!r} and {text!r}')


@pytest.fixture
def begin(fresh: Start) -> Callable[..., Felt]:
    def of(*overrides: str) -> Felt:
        felt = Felt(fresh(*overrides))
        felt.until_heard()
        return felt

    return of


@pytest.fixture
def felt(begin: Callable[..., Felt]) -> Iterator[Felt]:
    """Return a node that has published a wrench; it must be at work afterwards."""
    each = begin('external_wrench.cutoff:=1000.0')
    each.rest()
    each.until_answered(each.rest())
    yield each
    assert np.all(np.isfinite(values(each.received())))
    each.node.state_of(each.node.send())


def values(messages: list[WrenchStamped]) -> Any:
    """Return forces and moments of messages (N, 6)."""
    return np.array([[each.wrench.force.x, each.wrench.force.y, each.wrench.force.z,
                      each.wrench.torque.x, each.wrench.torque.y, each.wrench.torque.z]
                     for each in messages]).reshape(-1, 6)


def taken(messages: list[bytes], parameters: Parameters = HEXAPOD,
          history: LegHistory | None = None) -> list[Estimate]:
    """Return what the library estimates from messages; it rejects none."""
    def failed(*said: object) -> None:
        pytest.fail(f'{said}')

    legs = MeasuredLegs(parameters, ExternalWrench(parameters), failed, failed, history)
    found = [legs.use_message(each, NO_WRENCH, None) for each in messages]
    return [each for each in found if each is not None]


def test_published_wrenches_have_the_librarys_bits(begin: Callable[..., Felt]) -> None:
    """Messages of a hexapod in motion, measured with noise at irregular times."""
    felt = begin()
    random = rng(11)
    stamps = times(random, 300)
    motion = swing(np.subtract(stamps, BEGIN) * 1e-9)
    data = [message_of(Measurement(each.stamp, six(each.positions + 1e-5 * random.normal(size=6)),
                                   six(each.rates + 1e-4 * random.normal(size=6)),
                                   six(each.efforts + 5.0 * random.normal(size=6))))
            for each in measured(HEXAPOD, motion, LOAD, stamps)]
    expected = [OutputMessages(HEXAPOD).write_wrench(each.stamp, each.wrench)
                for each in taken(data) if each.wrench is not None]
    for message in data:
        felt.publish(message)
    felt.node.until(lambda: len(felt.raw) >= len(expected), 'all wrenches have come')
    assert felt.raw == expected
    assert felt.received()[0].header.frame_id == 'base'
    assert len(expected) == len(stamps) - 1
    felt.node.until(lambda: felt.node.values(STATUS).get('wrenches') == '299', 'it is reported')
    # No setpoint has come: there is no distance to one.
    assert not any('setpoint' in key for key in felt.node.values(STATUS))


def test_thresholds_are_checked_and_can_be_changed_while_it_is_active(felt: Felt) -> None:
    felt.until_status(OK, 'no overload')
    assert felt.node.set_parameters(external_wrench__force_max=300.0).successful
    felt.until_status(ERROR, f'force {math.hypot(*LOAD[:3]):.6g} N is ')
    assert 'N above external_wrench.force_max' in felt.node.status(STATUS).message
    assert felt.node.set_parameters(
        external_wrench__force_max=400.0, external_wrench__moment_max=100.0).successful
    felt.until_status(ERROR, ' N m above external_wrench.moment_max')
    felt.until_status(OK, 'no overload', NO_WRENCH)
    answer = felt.node.set_parameters(external_wrench__cutoff=0.0)
    assert answer.reason == 'external_wrench.cutoff: 0.0 Hz: must be more than 0'
    said = felt.node.program.stderr
    assert any('external wrench: force ' in line for line in log_lines(said, 'ERROR'))
    assert any('external wrench: no overload' in line for line in log_lines(said, 'INFO'))


def test_names_in_another_order_after_the_hexapod_is_connected_again(felt: Felt) -> None:
    felt.disconnect()
    felt.node.until_status(STATUS, STALE, 'no wrench: measured_legs silent for ')
    felt.connect()
    felt.until_connected()
    names = ['gripper', *reversed(JOINTS)]
    stamps = [felt.stamp + n * MILLISECOND for n in range(1, 50)]
    for at in resting(HEXAPOD, AT_HOME, LOAD, stamps):
        felt.publish(joint_state(at.stamp, names, *(
            [math.nan, *reversed(np.asarray(numbers).tolist())]
            for numbers in (at.positions - ZERO_LENGTHS, at.rates, at.efforts))))
    felt.until_answered(stamps[-1])
    assert np.max(np.abs(values(felt.received()[-1:]) - LOAD)) < 1e-6


# Faults, as docs/faults.md has them

def test_measured_legs_without_a_stamp_or_late_are_rejected(felt: Felt) -> None:
    many = len(felt.raw)
    for step, reason in ((-felt.stamp, 'without a stamp'), (0, 'same stamp twice'),
                         (-MILLISECOND, 'older than the last used')):
        stamp = felt.stamp
        felt.rest(step=step)
        felt.stamp = stamp
        felt.node.until(
            lambda key=f'rejected, {LEGS}: {reason}': felt.node.values(STATUS).get(key) == '1',
            f'{reason} is counted')
    assert len(felt.raw) == many
    felt.rest(step=-50 * 10 ** 9)  # of that one there is no acceleration
    felt.until_answered(felt.rest())
    assert len(felt.raw) == many + 1
    assert any('measured_legs: stamps jumped back by 50 s: followed as a restart' in line
               for line in log_lines(felt.node.program.stderr, 'WARN'))


def test_measured_legs_that_stop_or_are_too_far_apart_are_reported(felt: Felt) -> None:
    felt.node.until_status(STATUS, STALE, 'no wrench: measured_legs silent for ')
    many = len(felt.raw)

    def told() -> bool:
        felt.rest(step=200 * MILLISECOND)
        status = felt.node.status(STATUS)
        return bool(status.level == STALE) and (
            'measurements are farther apart than setpoint.timeout' in status.message)

    felt.node.until(told, 'diagnostics say why there is no wrench')
    assert len(felt.raw) == many
    felt.until_status(OK, 'no overload')


def test_efforts_of_the_opposite_sign_are_named_and_give_no_wrench(
        begin: Callable[..., Felt]) -> None:
    felt = begin()

    def rest(factor: float) -> None:
        felt.stamp += MILLISECOND
        at = resting(HEXAPOD, AT_HOME, NO_WRENCH, [felt.stamp])[0]
        felt.publish(message_of(at._replace(efforts=six(factor * np.array(at.efforts)))))

    def reported() -> bool:
        rest(-1.0)
        status = felt.node.status(STATUS)
        return bool(status.level == WARN) and (
            'measured_legs: possible error: the efforts have the opposite sign' in status.message)

    felt.node.until(reported, 'diagnostics name the sign')
    assert not felt.raw
    assert any('the efforts have the opposite sign' in line
               for line in log_lines(felt.node.program.stderr, 'WARN'))

    def published() -> bool:
        rest(1.0)
        return bool(felt.raw)

    felt.node.until(published, 'right efforts give a wrench')


def test_measured_legs_are_forgotten_at_a_deactivation(felt: Felt) -> None:
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        assert felt.node.change(transition)
    many = len(felt.raw)
    first = felt.rest()
    felt.until_answered(felt.rest())
    assert len(felt.raw) == many + 1
    assert first not in felt.stamps()


# The service that identifies the payload, of the node in a process of its own

PAYLOAD = 'payload'
# No test depends on the time between measurements and a request [s].
TIMEOUT = 60.0
TIMES = [2.0 + n / 100.0 for n in range(600)]


class Carried(Felt):
    """A node, and a hexapod with a payload whose legs are measured."""

    def __init__(self, node: DynamicsNode) -> None:
        super().__init__(node)
        self.payloads = node.peer.listen(f'{NODE}/payload', InertiaStamped, LATCHED)
        self._client = node.peer.node.create_client(Trigger, f'{NODE}/identify_payload')
        self.messages = [message_of(each) for each in measured(
            LOADED, excited(TIMES), NO_WRENCH, [BEGIN + round(time * 1e9) for time in TIMES])]
        self.until_heard()
        node.until(self._client.service_is_ready, 'the service is there')

    def move(self) -> None:
        """Publish the measurements of the motion, and wait until they are used."""
        for message in self.messages:
            self.publish(message)
        self.node.until(lambda: self.node.values(STATUS).get('wrenches') == str(
            len(self.messages) - 1), 'all measurements are used')

    def begin(self) -> Any:
        """Send a request, and return its future."""
        return self._client.call_async(Trigger.Request())

    def identify(self) -> Trigger.Response:
        """Return the answer to a request."""
        future = self.begin()
        self.node.until(future.done, 'the service answers')
        return future.result()


@pytest.fixture
def carried(fresh: Start) -> Iterator[Carried]:
    """Return a node and a hexapod for this alone; the node must be at work afterwards."""
    each = Carried(fresh(f'setpoint.timeout:={TIMEOUT}'))
    yield each
    each.node.state_of(each.node.send())


def expected(messages: list[bytes]) -> PayloadOutcome:
    """Return what the library gives for these messages."""
    parameters, history = HEXAPOD.replaced({'setpoint.timeout': TIMEOUT}), LegHistory(10.0)
    taken(messages, parameters, history)
    *_, outcome = identify(history, StewartPlatform(parameters))
    assert outcome is not None
    return outcome


def test_the_answer_has_the_librarys_numbers_and_sets_no_parameter(carried: Carried) -> None:
    outcome = expected(carried.messages)
    assert outcome.payload is not None
    assert abs(outcome.payload.fitted.body.mass - 172.0) < outcome.payload.fitted.half_widths[0]
    carried.move()
    answer = carried.identify()
    assert answer.success
    assert answer.message == outcome.message
    node = carried.node
    node.until(lambda: carried.payloads, 'the payload is published')
    message = deserialize_message(carried.payloads[-1], InertiaStamped)
    assert message.header.frame_id == 'platform'
    assert nanoseconds(message.header.stamp) == outcome.payload.stamp
    inertia = message.inertia
    assert [inertia.m, inertia.com.x, inertia.com.y, inertia.com.z, inertia.ixx, inertia.ixy,
            inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz] == numbers_of(
                outcome.payload.fitted.body)
    node.until_status(PAYLOAD, OK, 'identified from 6.0 s')
    values = node.values(PAYLOAD)
    half = float(values['mass, half of the 95 % interval (kg)'])
    assert half < 6.0  # mostly the gain of the efforts
    assert float(values['mass (kg)']) == pytest.approx(172.0, abs=half)
    # The forces are still those of the file.
    node.answer()
    # It is latched: who comes later has it, too.
    assert len(carried.payloads) == 1
    late = node.peer.listen(f'{NODE}/payload', InertiaStamped, LATCHED)
    node.until(lambda: late == carried.payloads, 'the payload comes to a late subscriber')


def test_the_payload_is_taken_over_by_a_service(carried: Carried) -> None:
    node = carried.node
    client = node.peer.node.create_client(Trigger, f'{NODE}/apply_payload')
    node.until(client.service_is_ready, 'the service is there')

    def apply() -> Trigger.Response:
        future = client.call_async(Trigger.Request())
        node.until(future.done, 'the service answers')
        return future.result()

    answer = apply()
    assert not answer.success
    assert answer.message == 'no payload is identified: call ~/identify_payload first'
    outcome = expected(carried.messages)
    assert outcome.payload is not None
    body = carried_payload(outcome.payload)
    assert isinstance(body, Body)
    carried.move()
    assert carried.identify().success
    answer = apply()
    assert answer.success and f'; {answer.message}' in outcome.message
    laden = StewartPlatform(node.platform.parameters.with_payload(body))
    assert laden.parameters.carried.mass == pytest.approx(outcome.payload.fitted.body.mass)
    node.answer(platform=laden)
    # Once more it is the same, not added again.
    assert apply().success
    node.answer(platform=laden)
    assert node.set_atomically([RosParameter('payload.mass', value=0.0)]).successful


def test_setpoints_are_answered_meanwhile_and_all_requests_are(carried: Carried) -> None:
    carried.move()
    futures = [carried.begin() for _ in range(3)]
    for _ in range(20):
        carried.node.answer()
    carried.node.until(lambda: all(each.done() for each in futures), 'all are answered')
    assert len({each.result().message for each in futures}) == 1
    assert all(each.result().success for each in futures)


def test_a_request_is_answered_when_the_node_is_deactivated(carried: Carried) -> None:
    node = carried.node
    carried.move()
    future = carried.begin()
    assert node.change(Transition.TRANSITION_DEACTIVATE)
    node.until(future.done, 'the service answers')
    # The work takes a hundred pieces with pauses: it may be done before.
    assert future.result().message in ('the node is deactivated', expected(
        carried.messages).message)
    assert carried.identify().message == 'the node is not active'
    assert node.change(Transition.TRANSITION_ACTIVATE)
    assert carried.identify().message == 'no measured legs'
    node.until_active()


def test_requests_behind_deactivation_and_cleanup_are_answered(carried: Carried) -> None:
    node = carried.node
    carried.move()
    for _ in range(5):  # a service of ROS keeps ten requests
        futures = [
            node.begin_change(Transition.TRANSITION_DEACTIVATE), carried.begin(),
            node.begin_change(Transition.TRANSITION_CLEANUP), carried.begin(), carried.begin(),
            node.begin_change(Transition.TRANSITION_CONFIGURE),
            node.begin_change(Transition.TRANSITION_ACTIVATE), carried.begin()]
        node.until(lambda waiting=futures: all(future.done() for future in waiting),
                   'all are answered')
    node.until_active()
