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

"""The service that identifies the payload, of the node in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from geometry_msgs.msg import InertiaStamped
from lifecycle_msgs.msg import Transition
import pytest
from rclpy.serialization import deserialize_message
from running import DynamicsNode, LATCHED, nanoseconds, NODE
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from stewart_dynamics import StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.external_wrench.estimate import ExternalWrench
from stewart_dynamics.external_wrench.measured_legs import LegHistory, MeasuredLegs
from stewart_dynamics.external_wrench.payload import identify, numbers_of, PayloadOutcome
from test_external_wrench import BEGIN, measured, resting, six
from test_external_wrench import HOME as AT_HOME
from test_measured_legs import message_of
from test_payload import excited, HEXAPOD, LOADED

Start = Callable[..., DynamicsNode]

OK, WARN = b'\0', b'\1'
STATUS = 'payload'
# No test depends on the time between measurements and a request [s].
TIMEOUT = 60.0
TIMES = [2.0 + n / 100.0 for n in range(600)]


class Carried:
    """A node, and a hexapod with a payload whose legs are measured."""

    def __init__(self, node: DynamicsNode) -> None:
        self.node = node
        self.raw = node.peer.listen(f'{NODE}/payload', InertiaStamped, LATCHED)
        self._writer = node.peer.writer(f'{NODE}/measured_legs', JointState)
        self._client = node.peer.node.create_client(Trigger, f'{NODE}/identify_payload')
        stamps = [BEGIN + round(time * 1e9) for time in TIMES]
        self.messages = [message_of(each) for each in measured(
            LOADED, excited(TIMES), NO_WRENCH, stamps)]
        node.until_active()
        node.until(self._writer.get_subscription_count, 'the node hears measured legs')
        node.until(self._client.service_is_ready, 'the service is there')

    def move(self, messages: Sequence[bytes] = ()) -> None:
        """Publish measurements, by default those of the motion, and wait until they are used."""
        messages = messages or self.messages
        for message in messages:
            self._writer.publish(message)
        self.node.until(lambda: self.node.values('external wrench').get('wrenches') == str(
            len(messages) - 1), 'all measurements are used')

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
    legs = MeasuredLegs(parameters, ExternalWrench(parameters), lambda *_: None,
                        lambda _: None, history)
    for each in messages:
        assert legs.take(each, NO_WRENCH, None) is not None
    *_, outcome = identify(history, StewartPlatform(parameters))
    assert outcome is not None
    return outcome


def test_the_answer_has_the_librarys_numbers_and_sets_no_parameter(carried: Carried) -> None:
    outcome = expected(carried.messages)
    assert outcome.payload is not None
    assert abs(outcome.payload.fitted.body.mass - 172.0) < 0.2
    carried.move()
    answer = carried.identify()
    assert answer.success
    assert answer.message == outcome.message
    node = carried.node
    node.until(lambda: carried.raw, 'the payload is published')
    message = deserialize_message(carried.raw[-1], InertiaStamped)
    assert message.header.frame_id == 'platform'
    assert nanoseconds(message.header.stamp) == outcome.payload.stamp
    inertia = message.inertia
    assert [inertia.m, inertia.com.x, inertia.com.y, inertia.com.z, inertia.ixx, inertia.ixy,
            inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz] == numbers_of(
                outcome.payload.fitted.body)
    node.until_status(STATUS, OK, 'identified from 6.0 s')
    values = node.values(STATUS)
    assert float(values['mass (kg)']) == pytest.approx(172.0, abs=0.2)
    assert float(values['mass, half of the 95 % interval (kg)']) < 0.5
    # The forces are still those of the file.
    node.answer()
    # It is latched: who comes later has it, too.
    assert len(carried.raw) == 1
    late = node.peer.listen(f'{NODE}/payload', InertiaStamped, LATCHED)
    node.until(lambda: late == carried.raw, 'the payload comes to a late subscriber')


def test_setpoints_are_answered_meanwhile_and_all_requests_are(carried: Carried) -> None:
    carried.move()
    futures = [carried.begin() for _ in range(3)]
    for _ in range(20):
        carried.node.answer()
    carried.node.until(lambda: all(each.done() for each in futures), 'all are answered')
    assert len({each.result().message for each in futures}) == 1
    assert all(each.result().success for each in futures)


def test_the_reason_is_reported_if_nothing_is_identifiable(carried: Carried) -> None:
    node = carried.node
    answer = carried.identify()
    assert not answer.success
    assert answer.message == 'no measured legs'
    node.until_status(STATUS, WARN, 'not identified: no measured legs')
    carried.move(carried.messages[:150])
    answer = carried.identify()
    assert not answer.success
    assert answer.message.startswith('too short: 1.5 s of measured legs, 2.0 s without gaps')
    assert not carried.raw


def test_measured_legs_that_are_silent_are_not_used(fresh: Start) -> None:
    carried = Carried(fresh('setpoint.timeout:=0.5'))
    carried.move()
    carried.node.until(lambda: carried.identify().message.startswith('measured_legs silent for '),
                       'they are silent')
    assert not carried.identify().success


def test_numbers_not_identifiable_at_rest_keep_their_values(carried: Carried) -> None:
    stamps = [BEGIN + round(time * 1e9) for time in TIMES]
    carried.move([message_of(each) for each in resting(LOADED, AT_HOME, NO_WRENCH, stamps)])
    answer = carried.identify()
    assert answer.success
    unknown, _, given = answer.message.partition('; not identified, as in the parameters: ')[
        2].partition('; ')
    assert unknown == ('center of mass z, inertia ixx, inertia ixy, inertia ixz, inertia iyy, '
                       'inertia iyz, inertia izz')
    assert ', 0.12], inertia: [13.0, 0.3, -0.4, 14.0, 0.2, 22.0]' in given
    carried.node.until_status(STATUS, OK, 'identified')
    values = carried.node.values(STATUS)
    assert values['inertia izz, half of the 95 % interval (kg m^2)'] == 'not identified'


def test_forces_of_another_sign_are_named(carried: Carried) -> None:
    opposite = [each._replace(forces=six([-force for force in each.forces])) for each in measured(
        LOADED, excited(TIMES), NO_WRENCH, [BEGIN + round(time * 1e9) for time in TIMES])]
    carried.move([message_of(each) for each in opposite])
    answer = carried.identify()
    assert not answer.success
    assert 'the measured forces are -1.' in answer.message
    assert ' times those of the model: likely they have another sign' in answer.message
    assert answer.message.startswith('the measured forces are ')


def test_it_is_answered_when_the_node_is_deactivated(carried: Carried) -> None:
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
