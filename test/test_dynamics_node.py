# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node as it is used: in a process of its own, over real topics and services."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
import json
import math
from pathlib import Path
import signal
import sys
import time
from typing import Any

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from lifecycle_msgs.msg import Transition
import numpy as np
from programs import call, run_program
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from running import (
    assert_only_log_lines, bits, DEADLINE, DynamicsNode, ERROR, HOME, LATCHED,
    log_lines, MOVING, nanoseconds, NODE, NodeProcess, NOT_JOINED, OK, OUTPUTS, participants, Peer,
    PLATFORM, raw, rejected, ROOT, Sample, says, SEPARATE, STALE, wrench_message)
from std_msgs.msg import Bool

from stewart_dynamics import Pose, StewartPlatform
from stewart_dynamics.executables import executable
from stewart_dynamics.replay import main as replay

Start = Fresh = Callable[..., DynamicsNode]

# All legs lie in the plane of the base: they cannot carry a load.
FLAT = Sample((0.0, 0.0, 0.0))
# Turned by 88 degrees; at 90 the hexapod is singular.
TURNED = Sample((0.0, 0.0, 0.9), (0.0, 0.0, math.sin(0.768), math.cos(0.768)))
LATER = 10_000_000_000  # the legs can be anywhere then [ns]
LEAPING = Sample(accel=(0.0, 0.0, 100.0, 0.0, 0.0, 0.0))


# Modules for a service, a subscriber or an error alone, and those of other programs.
UNUSED = (
    'argparse', 'difflib', 'jinja2', 'mcap', 'msgspec', 'orjson', 'plotly', 'rosbags', 'scipy',
    'statistics', 'xml', 'stewart_dynamics.capability', 'stewart_dynamics.identification',
    'stewart_dynamics.description.read_urdf', 'stewart_dynamics.replay',
    'stewart_dynamics.reporting')


def test_what_the_node_does_not_use_is_not_in_its_memory() -> None:
    done = run_program(
        sys.executable, '-c', 'import sys, rclpy.lifecycle; before = {*sys.modules}\n'
        'import stewart_dynamics.node.dynamics_node; print(*{*sys.modules} - before)')
    imported = done.out.split()
    assert 'stewart_dynamics.setpoints.step' in imported
    assert not {*UNUSED} & {*imported}


# Setpoints from a bag

def _replayed(bag: str, folder: Path) -> list[tuple[int, str, bytes]]:
    """Return the output of the replay of a bag: time of recording, topic, message."""
    call(replay, ROOT / 'bags' / bag, '--params', PLATFORM, '--output', folder, '--no-report')
    return _recorded(folder / bag / 'bag')


def _recorded(bag: Path) -> list[tuple[int, str, bytes]]:
    with AnyReader([bag]) as reader:
        return [(at, connection.topic.removeprefix(f'{NODE}/'), bytes(data))
                for connection, at, data in reader.messages()]


def _by_topic(replayed: list[tuple[int, str, bytes]]) -> dict[str, list[bytes]]:
    """Return messages as received: Fast DDS pads them to four bytes."""
    return {topic: [data + bytes(-len(data) % 4) for _, of, data in replayed if of == topic]
            for topic in OUTPUTS}


def test_node_and_replay_give_the_same_bits(node: DynamicsNode, tmp_path: Path) -> None:
    expected = _replayed('flawed', tmp_path)
    completed = {at for at, topic, _ in expected if topic == 'leg_states'}
    answers = 0
    for at, topic, data in _recorded(ROOT / 'bags/flawed'):
        node.publish(topic, data)
        if at in completed:
            # Messages on their way on several topics could arrive in another order.
            answers += 1
            node.until(lambda: len(node.raw['leg_states']) >= answers,  # noqa: B023
                       'the setpoint is answered')
    messages = _by_topic(expected)
    node.until(lambda: all(len(node.raw[topic]) >= len(messages[topic]) for topic in OUTPUTS),
               'all messages have come')
    assert node.raw == messages
    summary = json.loads((tmp_path / 'flawed/summary.json').read_text(encoding='utf-8'))
    counts = {f'rejected, {each["topic"]}: {each["reason"]}': str(each['count'])
              for each in summary['rejected']}
    assert counts

    def counted() -> bool:
        values = node.values('setpoints')
        return (values.get('setpoints answered') == str(answers)
                and {key: n for key, n in values.items() if key in counts} == counts)

    node.until(counted, 'the node rejects what the replay rejects')


def test_a_thousand_setpoints_are_answered_with_the_librarys_bits(
        node: DynamicsNode, tmp_path: Path) -> None:
    replayed = _by_topic(_replayed('singular', tmp_path))
    played = _recorded(ROOT / 'bags/singular')
    for n, (_, topic, data) in enumerate(played):
        node.publish(topic, data)
        # Some are on their way at a time, so that setpoints wait while others are answered.
        node.until(lambda n=n: len(node.raw['leg_states']) >= n // 3 - 50, 'they are answered')
    sent = len(played) // 3
    assert sent >= 1000
    node.until(lambda: all(len(node.raw[topic]) >= len(replayed[topic]) for topic in OUTPUTS),
               'all setpoints are answered')

    # None is lost, and the replay writes what the node publishes, to the last bit.
    assert len(node.raw['leg_states']) == sent
    assert node.raw == replayed

    samples, stamps = _bag_samples(played)
    motions = [sample.motion() for sample in samples]
    assert [nanoseconds(state.header.stamp) for state in node.received('leg_states')] == stamps
    for motion, state, lengths, forces, determinant in zip(
            motions, *(node.received(topic) for topic in (
                'leg_states', 'leg_lengths', 'leg_forces', 'jacobian_determinant')),
            strict=True):
        result = node.platform.inverse_dynamics(motion)
        node.check(state, result)
        assert bits(lengths.data) == bits(result.lengths)
        assert bits(forces.data) == bits(state.effort)
        assert bits(determinant.data) == bits(result.determinant)

    # It crosses a singularity: the warning comes and stays. A late subscriber gets it as well.
    assert [message.data for message in node.received('singularity_warning')] == [False, True]
    assert _latched(node.domain) == node.raw['singularity_warning'][-1:]
    node.until(lambda: node.values('setpoints').get('setpoints answered') == str(sent),
               'diagnostics count the answers')
    assert node.values('singularity')['crossings'] == '1'
    node.until_counted()


def _latched(domain: int) -> list[bytes]:
    """
    Return the warning that a late subscriber receives.

    Fast DDS has once, in a run of all tests, left a subscriber without it for a minute: another
    one is made then.
    """
    heard: list[bytes] = []
    for attempt in range(4):
        late = Peer(domain, f'late_{attempt}')
        try:
            heard = late.listen(f'{NODE}/singularity_warning', Bool, LATCHED)
            end = time.monotonic() + DEADLINE / 4.0
            while not heard and time.monotonic() < end:
                late.spin()
        finally:
            late.close()
        if heard:
            break
    return heard


def _bag_samples(played: list[tuple[int, str, bytes]]) -> tuple[list[Sample], list[int]]:
    """Return a bag's setpoints as another library reads them, and their stamps."""
    store = get_typestore(Stores.ROS2_JAZZY)
    poses, twists, accels = (
        [store.deserialize_cdr(data, kind) for _, topic, data in played if topic == wanted]
        for wanted, kind in zip(SEPARATE, (
            'geometry_msgs/msg/PoseStamped', 'geometry_msgs/msg/TwistStamped',
            'geometry_msgs/msg/AccelStamped'), strict=True))
    samples, stamps = [], []
    for p, t, a in zip(poses, twists, accels, strict=True):
        stamps.append(nanoseconds(p.header.stamp))
        assert p.header.stamp == t.header.stamp == a.header.stamp
        q = p.pose.orientation
        samples.append(Sample(
            _numbers(p.pose.position), (q.x, q.y, q.z, q.w),
            _numbers(t.twist.linear) + _numbers(t.twist.angular),
            _numbers(a.accel.linear) + _numbers(a.accel.angular)))
    return samples, stamps


def _numbers(three: Any) -> tuple[float, ...]:
    return three.x, three.y, three.z


# Bad input: every row of the table in the README

def _spoiled(topic: str, sample: Sample, frame: str = 'base') -> Callable[[int], tuple[str, Any]]:
    return lambda stamp: (topic, sample.messages(stamp, frame)[topic])


# One for each place that rejects: all rules are in test_setpoint_joining.py and test_cdr.py.
SPOILED = {
    'not finite': _spoiled('setpoint/accel', HOME._replace(accel=(0.0, math.inf) + (0.0,) * 4)),
    'quaternion not of unit length': _spoiled(
        'setpoint/pose', HOME._replace(quaternion=(0.0, 0.0, 0.0, 1.0011))),
    'wrong frame_id': _spoiled('setpoint/twist', HOME, 'base2'),
    'malformed': lambda stamp: (
        'setpoint/pose', raw(HOME.messages(stamp)['setpoint/pose'])[:60]),
}


def test_a_bad_sample_is_rejected_counted_and_nothing_is_published(node: DynamicsNode) -> None:
    for reason, spoil in SPOILED.items():
        stamp = node.stamp()
        bad_topic, bad = spoil(stamp)
        for topic, message in HOME.messages(stamp).items():
            node.publish(topic, bad if topic == bad_topic else message)
            node.rejects(topic, *(reason,) if topic == bad_topic else (NOT_JOINED,))
        # The next one is answered, and only that one.
        node.answer(MOVING)
        assert f'{bad_topic} rejected: {reason}' in node.program.stderr
    node.until_counted()


def test_a_setpoint_whose_numbers_overflow_is_rejected(node: DynamicsNode) -> None:
    node.send(HOME._replace(position=(0.0, 0.0, 1e300)))
    node.rejects('setpoint', 'out of range: numbers overflow')
    node.answer(MOVING)
    node.until_counted()


def test_zero_stamps_are_joined_in_order_of_arrival(fresh: Fresh) -> None:
    node = fresh('setpoint.timeout:=1000.0')  # however slow this computer is
    node.until_active()
    samples = [TURNED, HOME, MOVING]
    begun = time.time_ns()
    for number, sample in enumerate(samples, 1):
        for topic, message in sample.messages(0).items():
            node.publish(topic, message)
        node.until(lambda number=number: len(node.raw['leg_states']) == number,
                   'it is answered')
    states = node.received('leg_states')
    stamps = [nanoseconds(state.header.stamp) for state in states]
    assert stamps == sorted(stamps)
    assert begun <= stamps[0] <= stamps[-1] <= time.time_ns()
    for state, sample in zip(states, samples, strict=True):
        node.check(state, node.result_of(sample))
    # With a stamp they are joined by it as ever.
    node.answer(MOVING, stamp=time.time_ns())
    node.until_counted()
    assert node.program.stderr.count('header stamps are zero') == 1


def test_zero_stamps_after_a_stamped_motion_are_answered(fresh: Fresh) -> None:
    """As ``ros2 topic pub`` sends them after a motion has ended; and another motion follows."""
    node = fresh()
    node.until_active()
    node.answer(MOVING, stamp=time.time_ns())
    for _ in range(5):
        begun, answered = time.time_ns(), len(node.raw['leg_states'])
        node.send(TURNED, 0)
        node.until(lambda answered=answered: len(node.raw['leg_states']) > answered,
                   'it is answered')
        state = node.received('leg_states')[-1]
        assert begun <= nanoseconds(state.header.stamp) <= time.time_ns()
        node.check(state, node.result_of(TURNED))
    node.answer(MOVING, stamp=time.time_ns())
    node.until_counted()


def test_without_setpoints_diagnostics_are_stale_and_nothing_is_repeated(
        node: DynamicsNode) -> None:
    node.answer(MOVING)
    node.until(lambda: node.warning is False, 'all of the answer has come')
    answered = {topic: len(node.raw[topic]) for topic in OUTPUTS}
    for topic in SEPARATE:
        node.until_status('setpoints', STALE, f'{topic} silent for ')
    # Two more reports, a second apart.
    for _ in range(2):
        age = node.values('setpoints')['age of the last (s)']
        node.until(lambda age=age: node.values('setpoints')['age of the last (s)'] != age,
                   'one more report')
    assert {topic: len(node.raw[topic]) for topic in OUTPUTS} == answered


def test_an_unsolvable_jacobian_gives_lengths_and_a_warning_but_no_forces(
        node: DynamicsNode) -> None:
    node.answer()
    node.until(lambda: node.warning is False, 'no warning is on')
    forces, warnings = len(node.raw['leg_forces']), len(node.raw['singularity_warning'])
    state = node.state_of(node.send(FLAT))
    assert len(state.effort) == 0
    zero = node.platform.parameters['geometry.zero_length']
    assert bits(state.position) == bits(
        node.platform.inverse_kinematics(Pose(FLAT.position, np.eye(3))) - zero)
    assert node.received('leg_lengths')[-1].data.tolist() == (state.position + zero).tolist()
    assert abs(node.received('jacobian_determinant')[-1].data) < 1e-30
    node.until(lambda: len(node.raw['singularity_warning']) > warnings, 'it warns')
    assert node.warning
    node.until_status('singularity', ERROR, 'J_inv cannot be solved: no forces')
    node.until_status('limits', ERROR, 'below limits.length_min')
    # Out of it again the forces are back; the warning ends a sample after det(J) has changed.
    node.answer(MOVING)
    node.answer(MOVING)
    node.until(lambda: len(node.raw['singularity_warning']) == warnings + 2, 'the warning ends')
    assert node.warning is False
    assert len(node.raw['leg_forces']) == forces + 2
    node.until_counted()


def test_forces_above_their_limit_are_clipped_and_reported(node: DynamicsNode) -> None:
    result = node.result_of(LEAPING)
    assert result.forces.max() > 6000.0
    state = node.answer(LEAPING)
    assert max(state.effort) == 6000.0
    message = node.until_status('limits', ERROR, 'above limits.force_max, clipped')
    worst = int(np.argmax(result.forces))
    assert (f'leg_{worst + 1}: force {result.forces[worst]:.6g} N is '
            f'{result.forces[worst] - 6000.0:.6g} N above limits.force_max, clipped') in message
    key = f'leg_{worst + 1}: force demanded (N)'
    assert node.values('limits')[key] == f'{result.forces[worst]:.6g}'
    node.answer(MOVING, stamp=node.stamp(LATER))
    node.until_status('limits', OK, '')


def test_joint_angles_and_clearance_outside_limits_are_reported(shared: NodeProcess) -> None:
    tilted = HOME._replace(quaternion=(math.sin(0.2), 0.0, 0.0, math.cos(0.2)))
    limits = {'limits.base_joint_angle_max': 0.1, 'limits.platform_joint_angle_max': 0.3}
    legs = {'limits.leg_clearance_min': 0.2, 'legs.cylinder.radius': 0.05,
            'legs.cylinder.length': 0.8, 'legs.piston.radius': 0.03}
    with closing(DynamicsNode(
            shared, *(f'{k}:={v}' for k, v in (limits | legs).items()))) as node:
        node.until_active()
        angles = node.platform.joint_angles(
            Pose.from_quaternion(tilted.position, tilted.quaternion))
        node.answer(tilted)
        message = node.until_status('limits', ERROR, '')
        for each, joint, above, bound in zip(
                angles, ('base', 'platform'), (
                    'above limits.base_joint_angle_max', 'above limits.platform_joint_angle_max'),
                limits.values(), strict=True):
            assert (each > bound).any()
            worst = int(np.argmax(each))
            assert (f'leg_{worst + 1}: {joint} joint angle {each[worst]:.6g} rad is '
                    f'{each[worst] - bound:.6g} rad {above}') in message
            for leg, angle in enumerate(each):
                assert node.values('limits')[
                    f'leg_{leg + 1}: {joint} joint angle (rad)'] == f'{angle:.6g}'
        assert 'm below limits.leg_clearance_min' in message
        assert float(node.values('limits')['leg_1: clearance (m)']) < 0.2


# Other writers and readers

def test_readers_of_the_answers_are_counted(node: DynamicsNode) -> None:
    readers = {f'leg_{of}: readers': '1' for of in ('states', 'forces')}
    node.until(lambda: readers.items() <= node.values('setpoints').items(), 'this one is known')
    second = node.peer.node.create_subscription(
        OUTPUTS['leg_forces'], f'{NODE}/leg_forces', lambda message: None, 10)
    node.until(lambda: node.values('setpoints').get('leg_forces: readers') == '2', 'another is')
    node.peer.node.destroy_subscription(second)
    node.until(lambda: readers.items() <= node.values('setpoints').items(), 'it has gone')


# More setpoints than can be answered

def test_in_a_burst_the_newest_is_answered_and_dropped_ones_are_counted(start: Start) -> None:
    node = start()
    node.until_active()
    key = 'rejected, setpoint: dropped: more came at once than can be answered'
    sent = passed = 0
    while not passed:
        stamps = [node.stamp() for _ in range(500)]
        burst = [(topic, raw(message)) for stamp in stamps
                 for topic, message in MOVING.messages(stamp).items()]
        node.program.process.send_signal(signal.SIGSTOP)  # they wait for it
        for topic, data in burst:
            node.publish(topic, data)
        node.program.process.send_signal(signal.SIGCONT)
        sent += len(stamps)
        node.check(node.state_of(stamps[-1]), node.result_of(MOVING))
        passed = _passed_over(node, key, sent)
    node.until(lambda: len(node.raw['leg_states']) == sent - passed, 'the answers have come')
    answered = [nanoseconds(each.header.stamp) for each in node.received('leg_states')]
    assert answered == sorted(set(answered))
    node.expected[key] = passed
    node.answer()
    node.until_counted()


def _passed_over(node: DynamicsNode, key: str, sent: int) -> int:
    """Return how many setpoints the node has dropped, once it has counted all sent."""
    def counted(key: str) -> int:
        return int(node.values('setpoints').get(key, '0'))

    node.until(lambda: counted('setpoints answered') + counted(key) == sent,
               'every setpoint is answered or counted')
    return counted(key)


# Other sources of setpoints

def test_setpoints_in_one_message(fresh: Fresh) -> None:
    node = fresh('setpoint.source:=combined')
    node.until_active()
    assert node.topics == ['setpoint/combined']
    for sample in (HOME, MOVING, TURNED):
        node.answer(sample)
    two = MOVING.combined(node.stamp())
    two.points.append(two.points[0])
    for bad, reason in (
            (two, 'malformed'), (MOVING.combined(node.stamp(), 'map'), 'wrong frame_id')):
        node.publish('setpoint/combined', bad)
        node.rejects('setpoint/combined', reason)
    node.answer(MOVING)
    node.until_counted()
    assert '2 points: a setpoint has one' in node.program.stderr


def test_setpoints_of_poses_alone_are_quasi_static(fresh: Fresh) -> None:
    node = fresh('setpoint.source:=pose')
    node.until_active()
    assert node.topics == ['setpoint/pose']
    at_rest = MOVING._replace(twist=(0.0,) * 6, accel=(0.0,) * 6)
    state = node.answer(at_rest)
    assert list(state.velocity) == [0.0] * 6
    # One after another, far apart: no speed is made of them.
    node.answer(HOME)
    # Messages on the other topics are not received.
    stamp = node.stamp()
    for topic, message in MOVING.messages(stamp).items():
        node.publish(topic, message)
    node.check(node.state_of(stamp), node.result_of(at_rest))
    node.until_counted()


# The load that the surroundings put on the platform

def test_a_wrench_holds_for_the_setpoints_to_come(node: DynamicsNode) -> None:
    node.answer(MOVING)
    loads = ((100.0, -50.0, -800.0, 20.0, 10.0, -5.0), (0.0, 0.0, 300.0, 0.0, 0.0, 0.0))
    for load in loads:
        node.publish('wrench', wrench_message(load))
        _until_load(node, load)
        for sample in (MOVING, HOME):
            node.answer(sample, load)
    for bad, reason in ((wrench_message((0.0,) * 5 + (math.inf,)), 'not finite'),
                        (wrench_message((9.0,) * 6, 'platform'), 'wrong frame_id'),
                        (raw(wrench_message((9.0,) * 6))[:50], 'malformed')):
        node.publish('wrench', bad)
        node.rejects('wrench', reason)
    node.until_counted()
    # The last sound one still holds; one in a frame without a name is sound.
    node.answer(MOVING, loads[-1])
    node.publish('wrench', wrench_message((0.0,) * 6, ''))
    _until_load(node, (0.0,) * 6)
    node.answer(MOVING)
    node.until_counted()


def _until_load(node: DynamicsNode, load: tuple[float, ...]) -> None:
    """Send setpoints until one is answered with a load: nothing else shows that it is held."""
    expected = bits(node.result_of(HOME, load).forces)
    node.until(lambda: bits(node.state_of(node.send()).effort) == expected, 'the load is held')


# Forces inside stop_condition

def test_forces_are_suppressed_inside_stop_condition(fresh: Fresh) -> None:
    node = fresh('singularity.action:=suppress_forces', 'singularity.stop_condition:=50.0')
    node.until_active()
    node.answer(HOME)
    inside = Sample((0.0, 0.0, 0.9), (0.0, 0.0, math.sin(0.765), math.cos(0.765)))
    # Hysteresis: between 0.8 of the limit and it, forces come before and stay away after.
    between = Sample((0.0, 0.0, 0.9), (0.0, 0.0, math.sin(0.7515), math.cos(0.7515)))
    assert node.result_of(inside).condition_number > 50.0
    assert 40.0 < node.result_of(between).condition_number < 50.0
    node.answer(between)
    forces = len(node.raw['leg_forces'])
    for sample in (inside, between):
        state = node.state_of(node.send(sample))
        assert len(state.effort) == 0
        assert bits(state.velocity) == bits(node.result_of(sample).rates)
    node.until_status('singularity', ERROR, 'inside stop_condition: forces suppressed')
    node.answer(HOME)
    assert len(node.raw['leg_forces']) == forces + 1
    node.until_counted()


# Parameters at run time

def test_a_payload_is_picked_up_while_active(node: DynamicsNode) -> None:
    node.answer(MOVING)
    payload = {'platform.mass': 210.0, 'platform.center_of_mass': [0.05, 0.02, 0.3],
               'platform.inertia': [25.0, 0.5, -0.6, 27.0, 0.4, 31.0]}
    result = node.set_atomically([
        RosParameter(name, value=value) for name, value in payload.items()])
    assert result.successful, result.reason
    laden = StewartPlatform(node.platform.parameters.replaced(payload))
    state = node.answer(MOVING, platform=laden)
    assert bits(state.effort) != bits(node.result_of(MOVING).forces)

    # Through the other service as well it is all of a request or nothing.
    def ask(**changes: Any) -> list[bool]:
        answer = node.call('set_parameters', SetParameters.Request(parameters=[
            RosParameter(f'platform.{name}', value=value).to_parameter_msg()
            for name, value in changes.items()]))
        return [each.successful for each in answer.results]

    assert ask(mass=99.0, inertia=[1.0, 9.0, 0.0, 1.0, 0.0, 1.0]) == [False, False]
    node.answer(MOVING, platform=laden)
    assert ask(mass=150.0) == [True]
    lighter = StewartPlatform(laden.parameters.replaced({'platform.mass': 150.0}))
    node.answer(MOVING, platform=lighter)
    # A driver gets in, and out again by the mass alone.
    driver = {'payload.mass': 82.0, 'payload.center_of_mass': [0.1, -0.2, 0.6],
              'payload.inertia': [9.0, 0.1, 0.2, 8.0, -0.3, 3.0]}
    assert node.set_atomically([
        RosParameter(name, value=value) for name, value in driver.items()]).successful
    with_driver = StewartPlatform(lighter.parameters.replaced(driver))
    state = node.answer(MOVING, platform=with_driver)
    assert bits(state.effort) == bits(StewartPlatform(
        with_driver.parameters.merged()).inverse_dynamics(MOVING.motion()).forces)
    bad = {'payload.mass': 10.0, 'payload.inertia': [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]}
    assert not node.set_atomically([
        RosParameter(name, value=value) for name, value in bad.items()]).successful
    node.answer(MOVING, platform=with_driver)
    assert node.set_atomically([RosParameter('payload.mass', value=0.0)]).successful
    node.answer(MOVING, platform=lighter)
    # Each change is logged, and possible errors.
    assert 'platform.mass: 210.0 -> 150.0' in node.program.stderr
    assert ask(mass=150000.0) == [True]
    node.until(lambda: 'cannot carry the platform' in node.program.stderr, 'it is doubted')


# Rules of values are in test_parameters.py; these are of changes.
BAD_CHANGES: list[tuple[dict[str, Any], str]] = [
    ({'platform.mass': 150}, 'platform.mass: 150: is an integer, must be a double: write 150.0'),
    ({'singularity.stop_condition': 19.0}, 'must be at least singularity.warn_condition, 20.0'),
    ({'legs.piston.mass': 7.0, 'gravity': [0.0, 0.0, 9.8]},
     'legs.piston.mass, gravity: only changed while the node is unconfigured'),
    ({'platform.mas': 1.0}, 'platform.mas: unknown parameter; do you mean platform.mass?'),
    ({'platform.center_of_mass': None}, 'platform.center_of_mass: cannot be unset'),
    # Changes are atomic: the mass alone would be accepted.
    ({'platform.mass': 99.0, 'singularity.warn_time': -1.0},
     'singularity.warn_time: -1.0 s: must be at least 0'),
]


def test_a_bad_change_is_rejected_with_its_reason(node: DynamicsNode) -> None:
    for changes, reason in BAD_CHANGES:
        result = node.set_atomically([
            RosParameter(name, value=value) for name, value in changes.items()])
        assert not result.successful, reason
        assert reason in result.reason
    node.answer(MOVING)


# Lifecycle

def _activate(node: DynamicsNode) -> None:
    assert node.change(Transition.TRANSITION_ACTIVATE)
    assert node.state == 'active'
    node.until_active()


def test_the_whole_lifecycle(start: Start) -> None:
    node = start('autostart:=false')
    node.until_said('unconfigured: autostart is false')
    assert node.state == 'unconfigured'
    # A transition that a state does not have is answered, and the node continues.
    for impossible in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE,
                       Transition.TRANSITION_CLEANUP, 99):
        assert not node.change(impossible)
    assert node.state == 'unconfigured'
    # Geometry may change now.
    assert node.set_parameters(geometry__zero_length=1.0).successful
    assert not node.set_parameters(geometry__zero_length=1).successful
    moved = StewartPlatform(node.platform.parameters.replaced({'geometry.zero_length': 1.0}))

    assert node.change(Transition.TRANSITION_CONFIGURE)
    assert node.state == 'inactive'
    change = node.set_parameters(geometry__zero_length=0.9)
    assert 'only changed while the node is unconfigured' in change.reason
    assert not node.change(Transition.TRANSITION_CONFIGURE)
    _send_to_all(node)
    _activate(node)
    node.answer(MOVING, platform=moved)

    assert node.change(Transition.TRANSITION_DEACTIVATE)
    assert node.state == 'inactive'
    # Neither answered now nor kept for later.
    _send_to_all(node)
    _activate(node)
    node.answer(MOVING, platform=moved)
    assert [each.data for each in node.received('singularity_warning')][:1] == [False]

    assert node.change(Transition.TRANSITION_DEACTIVATE)
    assert node.change(Transition.TRANSITION_CLEANUP)
    assert node.state == 'unconfigured'
    node.until(lambda: not any(writer.get_subscription_count()
                               for writer in node.writers.values()), 'its topics are closed')
    assert node.set_parameters(geometry__zero_length=0.95).successful
    assert node.change(Transition.TRANSITION_CONFIGURE)
    _activate(node)
    node.answer(MOVING)

    assert node.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert node.state == 'finalized'
    _send_to_all(node)
    assert not node.change(Transition.TRANSITION_CONFIGURE)
    assert len(node.raw['leg_states']) == 3
    said = log_lines(node.program.stderr, 'ERROR')
    assert said
    assert all(says('transition rejected: ', line) for line in said)
    node.until_counted()
    node.stop()


def _send_to_all(node: DynamicsNode) -> None:
    """Send a setpoint on the three topics, whatever the node subscribes to."""
    for topic, message in HOME.messages(node.stamp()).items():
        node.publish(topic, message)


# How it ends

# Idle nodes are ended by SIGINT behind all tests that have a process of their own.
@pytest.mark.parametrize('number, flowing', [(signal.SIGTERM, False), (signal.SIGINT, True)],
                         ids=['SIGTERM', 'SIGINT while setpoints flow'])
def test_a_signal_ends_it_with_exit_code_0(
        start: Start, number: signal.Signals, flowing: bool) -> None:
    node = start()
    node.until_active()
    node.answer()
    line, = log_lines(node.program.stderr)
    assert '[INFO]' in line and 'dynamics ready after' in line
    if flowing:
        for _ in range(20):
            node.send(MOVING)
        node.program.process.send_signal(number)
        while not node.program.ended:
            node.send(MOVING)
            node.peer.spin(0.0)
    node.stop(number)
    assert participants(node.domain) == 1, 'it did not leave; the one is in this process'


# An error in parameters is reported in one line: all rules are in test_parameters.py

def test_a_rejected_parameter_is_reported_in_one_line(domain: int, tmp_path: Path) -> None:
    line = rejected(domain, tmp_path, '--params-file', PLATFORM, '-p', 'platform.mass:=150')
    assert line.startswith(
        'stewart_dynamics: command line: platform.mass: 150: is an integer')


# Any input

_numbers_of_any_kind = st.floats(allow_nan=True, allow_infinity=True)
_six = st.tuples(*[_numbers_of_any_kind] * 6)
_samples = st.builds(
    Sample, position=st.tuples(*[_numbers_of_any_kind] * 3), quaternion=st.one_of(
        st.just((0.0, 0.0, 0.0, 1.0)), st.tuples(*[_numbers_of_any_kind] * 4)),
    twist=_six, accel=_six)
_inputs = st.sampled_from([*SEPARATE, 'wrench'])


@st.composite
def _messages(draw: st.DrawFn) -> list[tuple[str, Any]]:
    """Return messages on the node's topics, valid, corrupted or random bytes."""
    if draw(st.booleans()):
        # A CDR header, some of them known to readers of such messages, and any bytes after it.
        return [(draw(_inputs), draw(st.sampled_from([b'\0\1\0\0', b'\0\0\0\0', b'\1\7\0\0']))
                 + draw(st.binary(max_size=200)))]
    stamp = draw(st.integers(-2**31 * 10**9, 2**31 * 10**9 - 1))
    frame = draw(st.sampled_from(['base', '', 'world', '\N{SNOWMAN}']))
    sample = draw(_samples)
    messages = {**sample.messages(0, frame), 'wrench': wrench_message(sample.twist, frame)}
    sent = []
    for topic in draw(st.lists(_inputs, min_size=1, max_size=6)):
        data = raw(messages[topic])
        sec, nanosec = divmod(stamp, 10**9)
        data = data[:4] + sec.to_bytes(4, 'little', signed=True) + draw(st.sampled_from([
            nanosec, 10**9, 2**32 - 1])).to_bytes(4, 'little') + data[12:]
        sent.append((topic, data[:draw(st.sampled_from([len(data), len(data) - 8, 12]))]))
    return sent


@settings(database=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.lists(_messages(), min_size=1, max_size=6))
def test_for_any_input_only_finite_numbers_are_published_and_a_setpoint_is_answered(
        node: DynamicsNode, sent: list[list[tuple[str, Any]]]) -> None:
    for topic, message in (each for messages in sent for each in messages):
        node.publish(topic, message)
    # A load that is held may be so large that every setpoint's numbers overflow.
    node.publish('wrench', wrench_message((0.0,) * 6))
    state = node.state_of(node.send(MOVING))
    assert bits(state.position) == bits(
        node.result_of(MOVING).lengths - node.platform.parameters['geometry.zero_length'])
    node.check_finite()
    assert_only_log_lines(node.program.stderr)


def test_a_stray_argument_is_rejected() -> None:
    ended = run_program(executable('stewart_dynamics'), 'foo', code=1)
    assert ended.err == 'stewart_dynamics: foo: unknown argument; see --help\n'
