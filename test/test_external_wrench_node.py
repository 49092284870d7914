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

"""The external wrench of the node in a process of its own, over real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import math
from pathlib import Path
from typing import Any

from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.msg import Transition
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from referees import rng
from running import DynamicsNode, executable, HOME, log_lines, nanoseconds, NODE, wrench_message
from sensor_msgs.msg import JointState
from stewart_dynamics import StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.external_wrench.estimate import ExternalWrench, Measurement
from stewart_dynamics.external_wrench.measured_legs import MeasuredLegs
from stewart_dynamics.setpoints.output_messages import OutputMessages
from test_external_wrench import BEGIN
from test_external_wrench import HEXAPOD, LOAD, measured, MILLISECOND, resting, six, swing, times
from test_external_wrench import HOME as AT_HOME
from test_measured_legs import joint_state, JOINTS, message_of, ZERO_LENGTHS
from test_simulator_node import Simulator, STEPPED

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
    """Return a node for this alone; it must be at work afterwards."""
    each = begin('external_wrench.cutoff:=1000.0')
    yield each
    assert np.all(np.isfinite(values(each.received())))
    each.node.state_of(each.node.send())


def values(messages: list[WrenchStamped]) -> Any:
    """Return forces and moments of messages (N, 6)."""
    return np.array([[each.wrench.force.x, each.wrench.force.y, each.wrench.force.z,
                      each.wrench.torque.x, each.wrench.torque.y, each.wrench.torque.z]
                     for each in messages]).reshape(-1, 6)


def test_what_is_published_has_the_librarys_bits(begin: Callable[..., Felt]) -> None:
    """Messages of a hexapod in motion, measured with noise at irregular times."""
    felt = begin()
    random = rng(11)
    stamps = times(random, 300)
    motion = swing(np.subtract(stamps, BEGIN) * 1e-9)
    data = [message_of(Measurement(each.stamp, six(each.lengths + 1e-5 * random.normal(size=6)),
                                   six(each.rates + 1e-4 * random.normal(size=6)),
                                   six(each.forces + 5.0 * random.normal(size=6))))
            for each in measured(HEXAPOD, motion, LOAD, stamps)]
    rejected: list[object] = []
    messages = OutputMessages(HEXAPOD)
    legs = MeasuredLegs(HEXAPOD, ExternalWrench(HEXAPOD), lambda *said: rejected.append(said),
                        rejected.append)
    expected = []
    for each in data:
        estimate = legs.take(each, NO_WRENCH, None)
        assert estimate is not None
        if estimate.wrench is not None:
            expected.append(messages.of_wrench(estimate.stamp, estimate.wrench))
        felt.publish(each)
    assert not rejected
    felt.node.until(lambda: len(felt.raw) >= len(expected), 'all wrenches have come')
    assert felt.raw == expected
    assert felt.received()[0].header.frame_id == 'base'
    assert len(expected) == len(stamps) - 1
    felt.node.until(lambda: felt.node.values(STATUS).get('wrenches') == '299', 'it is reported')
    # No setpoint has come: there is no distance to one.
    assert not any('setpoint' in key for key in felt.node.values(STATUS))


def test_a_load_that_is_known_is_not_external(felt: Felt) -> None:
    felt.until_status(OK, 'no overload')
    felt.node.publish('wrench', wrench_message(LOAD))

    def gone() -> bool:
        stamp = felt.rest()
        felt.until_answered(stamp)
        return bool(np.max(np.abs(values(felt.received()[-1:]))) < 1e-6)

    felt.node.until(gone, 'the load is known')


def test_diagnostics_say_how_far_it_is_from_the_setpoint(felt: Felt) -> None:
    felt.node.answer(HOME._replace(position=(0.0, 0.03, 1.14)))
    felt.until_status(OK, 'no overload')
    felt.node.until(lambda: felt.node.values(STATUS).get(
        'distance from the last setpoint (m)') == '0.05', 'the distance is reported')


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
    last = felt.rest()
    felt.until_answered(last := felt.rest())
    felt.disconnect()
    felt.node.until_status(STATUS, STALE, 'no wrench: measured_legs silent for ')
    felt.connect()
    felt.until_connected()
    names = ['gripper', *reversed(JOINTS)]
    stamps = [last + n * MILLISECOND for n in range(1, 50)]
    for at in resting(HEXAPOD, AT_HOME, LOAD, stamps):
        felt.publish(joint_state(at.stamp, names, *(
            [math.nan, *reversed(np.asarray(numbers).tolist())]
            for numbers in (at.lengths - ZERO_LENGTHS, at.rates, at.forces))))
    felt.until_answered(stamps[-1])
    assert np.max(np.abs(values(felt.received()[-1:]) - LOAD)) < 1e-6


# Faults, as docs/faults.md has them

SPOILT = {
    'lacks one of the joints': {'names': [*JOINTS[:5], 'elbow']},
    'without effort': {'effort': []},
    'not as many numbers as names': {'velocity': [0.0] * 5},
    'not finite': {'position': [math.nan] + [0.3] * 5},
    'forward kinematics did not converge': {'position': [9.0] + [0.3] * 5},
    'out of range: numbers overflow': {'velocity': [1e308] * 6}}


def test_invalid_measured_legs_are_rejected(felt: Felt) -> None:
    felt.rest()
    felt.until_answered(felt.rest())
    for number, (reason, fields) in enumerate(SPOILT.items()):
        at = resting(HEXAPOD, AT_HOME, LOAD, [felt.stamp + MILLISECOND])[0]
        felt.publish(joint_state(at.stamp, **{
            'names': JOINTS, 'position': at.lengths - ZERO_LENGTHS, 'velocity': at.rates,
            'effort': at.forces, **fields}))
        felt.until_answered(felt.rest(step=2 * MILLISECOND))
        assert len(felt.raw) == number + 2
        felt.node.until(
            lambda key=f'rejected, {LEGS}: {reason}': felt.node.values(STATUS).get(key) == '1',
            f'{reason} is counted')

    def told() -> bool:
        felt.publish(message_of(resting(HEXAPOD, AT_HOME, LOAD, [felt.stamp])[0])[:60])
        felt.rest()
        status = felt.node.status(STATUS)
        return bool(status.level == WARN) and 'measured_legs: malformed' in status.message

    felt.node.until(told, 'diagnostics say what is rejected')
    assert any('measured_legs rejected: lacks one of the joints: leg_6; there are ' in line
               for line in log_lines(felt.node.program.stderr, 'WARN'))
    felt.until_status(OK, 'no overload')


def test_measured_legs_without_a_stamp_or_late_are_rejected(felt: Felt) -> None:
    felt.rest()
    felt.until_answered(felt.rest())
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
    felt.rest()
    felt.until_answered(felt.rest())
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


def test_measured_legs_are_forgotten_at_a_deactivation(felt: Felt) -> None:
    felt.rest()
    felt.until_answered(felt.rest())
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        assert felt.node.change(transition)
    many = len(felt.raw)
    first = felt.rest()
    felt.until_answered(felt.rest())
    assert len(felt.raw) == many + 1
    assert first not in felt.stamps()


# In the loop with the simulator

@pytest.mark.slow
def test_a_wrench_on_the_simulator_in_motion_is_found_within_5_percent(
        start: Start, tmp_path: Path) -> None:
    """Step by step: this is the controller, PD and feed-forward; and it lets go again."""
    rule = '~/measured_legs:=/stewart_simulator/leg_states'
    node = start(command=[executable('stewart_dynamics'), '--ros-args', '-r', rule])
    found = node.peer.listen(f'{NODE}/external_wrench', WrenchStamped)
    simulator = Simulator(node.domain, tmp_path / 'simulator', STEPPED)
    try:
        simulator.until_there()
        node.until_active()
        node.until(lambda: node.peer.node.count_subscribers('/stewart_simulator/leg_states') == 2,
                   'the node hears the simulator')
        loads = {}
        for load, steps in ((NO_WRENCH, 100), (LOAD, 200), (NO_WRENCH, 200)):
            simulator.load(load)
            for _ in range(steps):
                loads[_step(simulator)] = load
        node.until(lambda: len(found) >= len(loads), 'all wrenches have come')
    finally:
        simulator.program.stop()
        simulator.peer.close()
    messages = [deserialize_message(data, WrenchStamped) for data in found]
    assert [nanoseconds(each.header.stamp) for each in messages] == list(loads)
    off = values(messages) - list(loads.values())
    settled = np.r_[50:100, 200:300, 400:500]  # 0.2 s after the load has changed
    assert np.max(np.linalg.norm(off[settled, :3], axis=1)) < 0.05 * np.linalg.norm(LOAD[:3])
    assert np.max(np.linalg.norm(off[settled, 3:], axis=1)) < 0.05 * np.linalg.norm(LOAD[3:])


def _step(simulator: Simulator) -> int:
    """Command the forces of the present moment and return the next one's stamp."""
    state = simulator.last()
    stamp = nanoseconds(state.header.stamp)
    wanted = StewartPlatform(HEXAPOD).inverse_dynamics(swing((stamp - 10 ** 9) * 1e-9))
    return simulator.step(
        wanted.forces + 61.0 * 900.0 * (wanted.lengths - ZERO_LENGTHS - state.position)
        + 61.0 * 42.0 * (wanted.rates - state.velocity))
