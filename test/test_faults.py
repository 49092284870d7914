# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Every fault in docs/faults.md, on the real node: over topics, by signals, in its files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
import math
from pathlib import Path
import signal
import sys
from typing import Any

from lifecycle_msgs.msg import Transition
import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from running import (
    bits, DynamicsNode, ERROR, FEEDER, Feeder, HOME, log_lines, MOVING, nanoseconds, NODE,
    NOT_JOINED, OK, OUTPUTS, Peer, Planner, Program, raw, ROOT, Sample, says, SEPARATE, STALE,
    STEP, WARN, wrench_message)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from stewart_dynamics import StewartPlatform
from stewart_dynamics.ros.security import PROFILES

Start = Callable[..., DynamicsNode]


# In every case the node is at work when the fault has ended, and all that it has published was
# asked for: these fixtures check it behind every test, `close` how the node ends.

@pytest.fixture
def node(node: DynamicsNode) -> Iterator[DynamicsNode]:
    """Return the module's node, newly configured and active."""
    yield node
    node.at_work()


@pytest.fixture
def renew(fresh: Start) -> Iterator[Start]:
    """Return a function that gives the module's node with other parameters, active."""
    yield from _started(fresh)


@pytest.fixture
def begin(start: Start) -> Iterator[Start]:
    """Return a function that starts an active node in a process of its own."""
    yield from _started(start)


def _started(start: Start) -> Iterator[Start]:
    begun: list[DynamicsNode] = []

    def started(*overrides: str, **options: Any) -> DynamicsNode:
        begun.append(start(*overrides, **options))
        begun[-1].until_active()
        return begun[-1]

    yield started
    for each in begun:
        each.at_work()


# Stamps

def test_a_setpoint_sent_twice_is_answered_once(node: DynamicsNode) -> None:
    before = len(node.received('leg_states'))
    stamps = [node.stamp() for _ in range(5)]
    for stamp in stamps:
        for topic, message in MOVING.messages(stamp).items():
            node.publish(topic, message)
            node.publish(topic, message)
            node.rejects(topic, 'same stamp twice')
    node.state_of(stamps[-1])
    # The last once more when it is answered, those before it are older than the last.
    for stamp in stamps:
        node.send(MOVING, stamp)
    for topic in SEPARATE:
        node.rejects(topic, 'older than the last used', len(stamps) - 1)
        node.rejects(topic, 'same stamp twice')
    node.until_counted()
    answered = [nanoseconds(state.header.stamp) for state in node.received('leg_states')]
    assert answered[before:] == stamps


def test_after_a_stamp_of_the_far_future_normal_ones_are_followed(node: DynamicsNode) -> None:
    node.answer(MOVING)
    node.answer(MOVING, stamp=2**31 * 10**9 - 1)  # the last that a header can hold
    for _ in range(3):
        node.answer(MOVING)
    node.until_said('followed as a restart')
    # A jump too short for a restart: setpoints are rejected until they are newer than the last.
    node.answer(MOVING, stamp=node.stamp(0) + 5 * STEP)
    for _ in range(4):
        node.send()
        for topic in SEPARATE:
            node.rejects(topic, 'older than the last used')
    node.stamp()
    node.answer(MOVING)


def test_a_stamp_of_the_far_future_on_one_topic_delays_nothing(node: DynamicsNode) -> None:
    topic = 'setpoint/twist'
    far = node.stamp(0) + 4 * 10**17  # 12 years
    node.publish(topic, MOVING.messages(far)[topic])
    for _ in range(3):
        node.answer(MOVING)
    # It waits for the others until time jumps back.
    node.stamp(1 - 10**9)  # to stamps that no other test has had
    node.answer(MOVING)
    node.rejects(topic, NOT_JOINED)
    node.asked[far] = 0


def test_a_bag_that_loops_is_followed(node: DynamicsNode) -> None:
    with AnyReader([ROOT / 'bags/clear']) as reader:
        played = [(connection.topic.removeprefix(f'{NODE}/'), bytes(data))
                  for connection, _, data in reader.messages()][:90]
    before = len(node.raw['leg_states'])
    for n in range(1, 4):
        for topic, data in played:
            node.publish(topic, data)
        # Messages on their way on several topics could arrive in another order.
        node.until(lambda n=n: len(node.raw['leg_states']) == before + n * len(played) // 3,
                   'the bag is answered')
    states = node.raw['leg_states'][before:]
    assert states[:30] == states[30:60] == states[60:]
    assert len(set(states)) == 30
    node.until_said('followed as a restart')


def test_simulated_time_stands_still_and_jumps(begin: Start) -> None:
    node = begin('use_sim_time:=true')
    clock = node.peer.writer('/clock', Clock)

    def answer_at(time: int) -> None:
        """Send setpoints without a stamp until one is answered with this time."""
        def is_time() -> bool:
            answered = len(node.raw['leg_states'])
            node.send(MOVING, 0)
            node.until(lambda: len(node.raw['leg_states']) > answered, 'it is answered')
            state = node.received('leg_states')[-1]
            node.check(state, node.result_of(MOVING))
            return nanoseconds(state.header.stamp) == time

        node.until(is_time, f'it is {time} ns')

    # Without a clock it is zero, and goes on being so.
    answer_at(0)
    node.until_status('setpoints', STALE, 'silent for ')
    for now in (100, 1000, 50, 10**6):
        message = Clock()
        message.clock.sec = now
        clock.publish(message)
        for _ in range(3):  # it stands still
            answer_at(now * 10**9)
    # Diagnostics do not need the clock: they report that a topic is silent.
    node.until_status('setpoints', STALE, 'silent for ')
    node.answer(MOVING)

    def said() -> bool:
        message.clock.sec = -5
        clock.publish(message)  # best effort: the node may have missed the first
        return '/clock: -5 s: not followed' in node.program.stderr

    node.until(said, 'a negative time is rejected')
    node.answer(MOVING)


def test_a_clock_that_jumps_back_by_little_is_followed(begin: Start) -> None:
    """As of a simulation that is started again at once; its setpoint may come before /clock."""
    node = begin('use_sim_time:=true')
    clock = node.peer.writer('/clock', Clock)
    node.until(lambda: clock.get_subscription_count() > 0, 'it hears the clock')

    def until(time: int, condition: Callable[[], Any], what: str) -> None:
        def met() -> bool:
            clock.publish(Clock(clock=Time(nanoseconds=time).to_msg()))
            node.peer.spin(0.1)
            return bool(condition())

        node.until(met, what)

    def is_answered(stamp: int) -> bool:
        return any(nanoseconds(state.header.stamp) == stamp
                   for state in node.received('leg_states'))

    late, early = 1_050_000_000, 1_000_000_000
    node.send(MOVING, late)
    until(late, lambda: is_answered(late) and node.time == late, 'it is answered at its time')
    node.send(MOVING, early)
    for topic in SEPARATE:
        node.rejects(topic, 'older than the last used')
    node.until_counted()
    until(early, lambda: is_answered(early), 'it is answered once the clock has jumped')


def test_in_simulated_time_a_late_subscriber_gets_the_last_answer(begin: Start) -> None:
    """The clock may wait for it; a force is given again to none that had it."""
    node = begin('use_sim_time:=true')
    stamp = nanoseconds(node.answer(MOVING).header.stamp)
    late = Peer(node.domain, 'late')
    try:
        states = late.listen('/stewart_dynamics/leg_states', JointState)
        forces = late.listen('/stewart_dynamics/leg_forces', Float64MultiArray)
        late.until(lambda: states, 'the last answer comes')
        assert nanoseconds(deserialize_message(states[0], JointState).header.stamp) == stamp
        node.until(lambda: len(node.raw['leg_states']) == 2, 'others get it again')
        late.until(lambda: late.node.count_subscribers('/stewart_dynamics/leg_forces') == 2,
                   'both are there')
        assert not forces
        node.raw['leg_states'].pop()
    finally:
        late.close()


def test_in_simulated_time_a_setpoint_that_came_while_inactive_is_answered(begin: Start) -> None:
    node = begin('use_sim_time:=true')
    clock = node.peer.writer('/clock', Clock)
    assert node.change(Transition.TRANSITION_DEACTIVATE)
    stamp = 2_000_000_000
    node.send(MOVING, stamp)
    while not node.received('leg_states'):
        clock.publish(Clock(clock=Time(nanoseconds=stamp).to_msg()))
        node.peer.spin(0.1)
        if node.state == 'active':
            assert node.change(Transition.TRANSITION_DEACTIVATE)
        assert node.change(Transition.TRANSITION_ACTIVATE)
    node.check(node.received('leg_states')[-1], node.result_of(MOVING))


# Topics that are late or too many

def test_a_late_topic_is_waited_for(node: DynamicsNode) -> None:
    late = 'setpoint/pose'
    before = len(node.raw['leg_states'])
    stamps = [node.stamp() for _ in range(50)]
    for stamp in stamps:
        for topic, message in MOVING.messages(stamp).items():
            if topic != late:
                node.publish(topic, message)
    for stamp in stamps:
        assert len(node.raw['leg_states']) == before
        node.publish(late, MOVING.messages(stamp)[late])
        node.check(node.state_of(stamp), node.result_of(MOVING))
        before += 1
    # Too late: a later setpoint has been answered.
    stamp = node.stamp()
    for topic, message in MOVING.messages(stamp).items():
        if topic != late:
            node.publish(topic, message)
            node.rejects(topic, NOT_JOINED)
    node.answer()
    node.publish(late, MOVING.messages(stamp)[late])
    node.rejects(late, 'older than the last used')
    node.asked[stamp] = 0


def test_the_first_and_the_last_of_a_series_of_rejections_are_logged(start: Start) -> None:
    node = start()
    node.until_active()
    for _ in range(50):
        node.publish('wrench', raw(wrench_message((1.0,) * 6))[:20])
        node.rejects('wrench', 'malformed')
    node.until_counted()

    def said() -> list[str]:
        return [line for line in log_lines(node.program.stderr, 'WARN')
                if 'wrench rejected: malformed' in line]

    assert len(said()) == 1
    node.at_work()
    node.stop()  # otherwise it is logged when no more come
    assert said()[-1] == node.program.stderr.splitlines()[-1]
    assert said()[-1].endswith('(the last of 50)')


# Publishers

BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_best_effort_publishers_are_received_with_qos_overrides(begin: Start) -> None:
    node = begin(*(f'qos_overrides.{NODE}/{topic}.subscription.reliability:=best_effort'
                   for topic in SEPARATE))
    # Reliable ones are received as well.
    node.answer(MOVING)
    best_effort = {topic: node.peer.writer(f'{NODE}/{topic}', type(message), BEST_EFFORT)
                   for topic, message in MOVING.messages(0).items()}
    node.until(lambda: all(node.values('setpoints')[f'{topic}: writers'] == '2'
                           for topic in SEPARATE), 'the node hears them')
    reliable, node.writers = node.writers, {**node.writers, **best_effort}
    node.answer(MOVING)
    node.writers = reliable
    for writer in best_effort.values():
        node.peer.node.destroy_publisher(writer)
    assert not log_lines(node.program.stderr, 'ERROR')


def test_an_incompatible_quality_of_service_is_named(node: DynamicsNode) -> None:
    before = len(log_lines(node.program.stderr, 'ERROR'))
    deaf = node.peer.writer(f'{NODE}/setpoint/twist', type(MOVING.messages(0)['setpoint/twist']),
                            BEST_EFFORT)
    node.until(lambda: len(log_lines(node.program.stderr, 'ERROR')) > before, 'it is told')
    said = log_lines(node.program.stderr, 'ERROR')[before]
    assert 'setpoint/twist: a publisher offers an incompatible quality of service' in said
    assert 'RELIABILITY' in said
    assert 'its messages are not received' in said
    node.answer(MOVING)
    node.peer.node.destroy_publisher(deaf)


def test_a_second_node_of_the_same_name_is_reported(node: DynamicsNode) -> None:
    second = Peer(node.domain, 'stewart_dynamics')
    try:
        node.until_status('setpoints', ERROR, f'2 nodes are named {NODE}')
        node.answer(MOVING)
    finally:
        second.close()
    node.until(lambda: node.status('setpoints').level != ERROR, 'it is alone')


# How long a silent participant counts as alive for others; 20 s by default.
# Others remove a killed process after 2 s.
LEASE = """\
  <discovery_config>
    <leaseDuration><sec>2</sec></leaseDuration>
    <leaseAnnouncement><sec>0</sec><nanosec>500000000</nanosec></leaseAnnouncement>
  </discovery_config>
"""
BRIEF = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="brief" is_default_profile="true"><rtps><builtin>
{LEASE}  </builtin></rtps></participant>
</profiles>
"""


def _brief(folder: Path) -> dict[str, str]:
    """Return the environment of a process that others soon remove when it is killed."""
    profile = folder / 'brief.xml'
    profile.write_text(BRIEF, encoding='utf-8')
    return {PROFILES: str(profile)}


def _by_udp(folder: Path, lease: str = '') -> dict[str, str]:
    """
    Return the environment of a process without shared memory.

    With it, one that is stopped or killed may hold the lock of its queue, for which others wait.
    """
    one_host = (ROOT / 'security' / 'one_host.xml').read_text(encoding='utf-8')
    assert one_host.count('<builtin>') == 1
    profile = folder / 'udp.xml'
    profile.write_text(one_host.replace('<builtin>', f'<builtin>{lease}'), encoding='utf-8')
    return {PROFILES: str(profile),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT'}


def test_a_publisher_that_is_killed_and_started_again_is_received(
        node: DynamicsNode, tmp_path: Path) -> None:
    killed = Feeder(node, tmp_path / 'killed', 100, **_brief(tmp_path))
    killed.begin()
    _until_answered(node, killed)
    killed.kill()
    # Whether the node has already removed the first or not.
    again = Feeder(node, tmp_path / 'again', 100)
    again.begin(heard=False)
    _until_answered(node, again)
    node.until_status('setpoints', ERROR, 'setpoint/pose has 2 writers')
    again.end()
    _until_one_writer(node)
    _expect_what_was_cut_off(node)


def _until_answered(node: DynamicsNode, feeder: Feeder) -> None:
    node.until(lambda: any(nanoseconds(state.header.stamp) in feeder.stamps
                           for state in node.received('leg_states')), 'it is answered')


def _until_one_writer(node: DynamicsNode) -> None:
    node.until(lambda: all(node.values('setpoints')[f'{topic}: writers'] == '1'
                           for topic in node.topics), 'there is one writer')


def _expect_what_was_cut_off(node: DynamicsNode) -> None:
    """Expect any number of rejections of setpoints that came while the node was not ready."""
    stamp = node.send()
    node.state_of(stamp)
    # Once these are counted, all earlier rejections are counted, too.
    for topic, message in HOME.messages(stamp).items():
        node.writers[topic].publish(message)
        node.rejects(topic, 'same stamp twice')
    node.until(lambda: all(node.counted()[key] == number for key, number in node.expected.items()
                           if key.endswith('same stamp twice')), 'it is counted')
    counted = node.counted()
    strange = {key: number for key, number in (counted - node.expected).items()
               if ': dropped: ' not in key}
    assert not strange
    node.expected = counted


def test_with_exclusive_setpoints_a_killed_publisher_counts_until_it_is_removed(
        renew: Start, tmp_path: Path) -> None:
    node = renew('setpoint.exclusive:=true')
    node.answer(MOVING)
    second = Feeder(node, tmp_path, 100, 1, **_brief(tmp_path))
    node.until_status('setpoints', ERROR, 'setpoint/pose has 2 writers')
    node.send(MOVING)
    for topic in SEPARATE:
        node.rejects(topic, 'more than one writer')
    node.until_counted()
    second.kill()
    _until_one_writer(node)


# The node itself

@pytest.mark.slow
def test_a_killed_node_answers_again_after_a_restart(start: Start, tmp_path: Path) -> None:
    killed = start(**_by_udp(tmp_path))
    killed.until_active()
    feeder = Feeder(killed, tmp_path, 100)
    feeder.begin()
    _until_answered(killed, feeder)
    with closing(killed.start_again()) as node:
        node.stamp(feeder.stamps.stop - node.stamp(0))
        node.fed.append(feeder.stamps)
        feeder.node = node
        node.until_active(writers=2)
        node.until(lambda: node.raw['leg_states'], 'it answers what flows on')
        assert 'dynamics ready after' in node.program.stderr
        assert 'compiling' not in node.program.stderr
        feeder.end()
        _expect_what_was_cut_off(node)
        node.at_work()


@pytest.mark.slow
def test_lifecycles_under_load_leave_nothing_behind(
        begin: Start, tmp_path: Path) -> None:
    node = begin()
    feeder = Feeder(node, tmp_path, 200)
    feeder.begin()

    def cycle() -> None:
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP,
                           Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            assert node.change(transition)
        assert node.state == 'active'

    def held() -> tuple[dict[str, int], dict[str, int]]:
        before = len(node.raw['leg_states'])
        node.until(lambda: len(node.raw['leg_states']) > before + 100, 'it answers again')
        publishers = {topic: node.peer.node.count_publishers(f'{NODE}/{topic}')
                      for topic in OUTPUTS}
        return node.program.held(), publishers

    for _ in range(10):
        cycle()
    after, publishers = held()
    cycles, grown = 10, list[int]()
    # A leak grows in each round; memory that is allocated once grows in only one of them.
    while not grown or (grown[-1] >= 400 and len(grown) < 3):
        before = after
        for _ in range(20):
            cycle()
        cycles += 20
        after, publishers_after = held()
        assert publishers_after == publishers == dict.fromkeys(OUTPUTS, 1)
        for what in ('descriptors', 'threads'):
            assert after[what] == before[what]
        grown.append(after['memory'] - before['memory'])
    feeder.end()
    assert node.program.stderr.count('dynamics ready after') == 1 + cycles
    # A leaked publisher takes 30 kB; without leaks the middleware takes 3 to 7 kB per cycle.
    assert grown[-1] < 400, grown
    _expect_what_was_cut_off(node)


def test_an_unconfigured_node_is_shut_down(start: Start) -> None:
    node = start('autostart:=false')
    node.until_said('unconfigured: autostart is false')
    shutdown = Transition.TRANSITION_UNCONFIGURED_SHUTDOWN
    assert node.change(shutdown)
    assert node.state == 'finalized'
    # There is no way back, and it is logged.
    for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE, shutdown):
        assert not node.change(transition)
    assert says('transition rejected: ', node.program.stderr)
    node.until(lambda: not any(writer.get_subscription_count()
                               for writer in node.writers.values()), 'it has no topics')


def _send(node: DynamicsNode, many: int) -> None:
    for _ in range(many):
        node.send()


def _until_all_answered(node: DynamicsNode, number: int) -> None:
    node.until(lambda: len(node.raw['leg_states']) == number, 'all are answered')


def test_calls_do_not_cost_a_setpoint(node: DynamicsNode) -> None:
    before = len(node.raw['leg_states'])
    mass = float(node.platform.parameters['platform.mass'])
    names = list(node.platform.parameters)
    for turn in range(1, 16):
        _send(node, 30)  # on their way while the node is called
        assert node.set_parameters(platform__mass=mass + turn % 2).successful
        assert len(node.call('describe_parameters', DescribeParameters.Request(
            names=names)).descriptors) == len(names)
        assert node.state == 'active'
        assert not node.set_parameters(platform__mass=0.0).successful
        _until_all_answered(node, before + 30 * turn)
    assert not node.change(Transition.TRANSITION_ACTIVATE)
    assert says('transition rejected: ', node.program.stderr)
    assert node.set_parameters(platform__mass=mass).successful
    # Each with one mass or the other, and never with a part of each.
    either = {bits(node.result_of(HOME, platform=StewartPlatform(
        node.platform.parameters.replaced({'platform.mass': each}))).forces)
        for each in (mass, mass + 1.0)}
    assert {bits(state.effort) for state in node.received('leg_states')[before:]} == either


def test_a_stopped_subscriber_costs_no_setpoint(node: DynamicsNode, tmp_path: Path) -> None:
    """A viewer that hangs reads neither forces nor markers; the node does not wait for it."""
    viewer = Program([sys.executable, FEEDER], node.domain, tmp_path / 'viewer',
                     **_by_udp(tmp_path))
    markers = f'{NODE}/markers'
    node.until(lambda: node.peer.node.count_subscribers(markers) == 1, 'the viewer is there')
    node.answer()
    viewer.process.send_signal(signal.SIGSTOP)
    try:
        before = len(node.raw['leg_states'])
        for turn in range(1, 26):
            _send(node, 30)
            _until_all_answered(node, before + 30 * turn)
    finally:
        viewer.process.send_signal(signal.SIGCONT)
        viewer.stop()
    node.until(lambda: node.peer.node.count_subscribers(markers) == 0, 'it is gone')


# Singularities

def _turned(degrees: float, rate: float = 0.0) -> Sample:
    """Return a pose turned about the vertical; at 90 degrees the hexapod is singular."""
    half = math.radians(degrees) / 2.0
    return Sample((0.0, 0.0, 1.1), (0.0, 0.0, math.sin(half), math.cos(half)),
                  (0.0,) * 5 + (rate,))


def test_a_singularity_between_two_samples_is_reported(node: DynamicsNode) -> None:
    node.answer()
    node.until(lambda: node.warning is False, 'no warning is on')
    crossings = int(node.values('singularity').get('crossings', '0'))
    said = sum('det(J) crossed' in line for line in log_lines(node.program.stderr, 'ERROR'))
    # 4 degrees in 10 ms.
    there = [_turned(degrees, math.radians(400.0)) for degrees in (84.0, 88.0, 92.0, 96.0)]
    clear = [node.result_of(sample) for sample in there]
    assert clear[1].determinant * clear[2].determinant < 0.0
    for sample in there:
        state = node.answer(sample)
        assert np.abs(state.effort).max() <= 6000.0
        node.until(lambda: node.warning, 'it warns')
    # One sample crossed, the next ones are only near: it is reported for a second nevertheless.
    before, after = (abs(float(result.determinant)) for result in clear[1:3])
    node.until_reported('singularity', ERROR, 'det(J) crossed zero '
                        f'{0.01 * after / (before + after):.3g} s before stamp ')
    node.until_status('singularity', WARN, 'singularity.warn_condition, 20')
    # Back with one leap, from where nothing is near into where nothing is.
    for degrees in (130.0, 130.0, 50.0):
        node.answer(_turned(degrees))
    node.until_status('singularity', ERROR, 'det(J) crossed zero ')
    node.answer(_turned(50.0))
    node.until(lambda: node.warning is False, 'the warning ends')
    node.until_status('singularity', OK, 'clear')
    assert node.values('singularity')['crossings'] == str(crossings + 2)
    assert sum('singularity: det(J) crossed zero ' in line for line in log_lines(
        node.program.stderr, 'ERROR')) == said + 2


def test_a_hexapod_that_is_singular_at_home_starts_and_gives_no_forces(
        start: Start, tmp_path: Path) -> None:
    # Similar hexagons: whatever the pose, the legs cannot hold a turn about the vertical.
    angles = np.radians([0.0, 60.0, 120.0, 180.0, 240.0, 300.0])
    hexagon = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])
    file = tmp_path / 'hexagons.yaml'
    file.write_text('/**:\n  ros__parameters:\n' + ''.join(
        f'    {name}: {value}\n' for name, value in (
            ('geometry.base_joints', hexagon.ravel().tolist()),
            ('geometry.platform_joints', (0.6 * hexagon).ravel().tolist()),
            ('platform.mass', 150.0), ('platform.inertia', [13.0, 0.0, 0.0, 14.0, 0.0, 22.0]))),
        encoding='utf-8')
    node = start(file=file)
    node.until_active()
    for sample in (HOME, MOVING):
        state = node.state_of(node.send(sample))
        assert len(state.effort) == 0
        assert bits(state.position) == bits(node.platform.inverse_kinematics(
            sample.motion()))
    assert node.raw['leg_forces'] == []
    node.until(lambda: node.warning, 'it warns')
    node.until_status('singularity', ERROR, 'J_inv cannot be solved: no forces')
    node.check_answers()
    assert any('singular' in line for line in log_lines(node.program.stderr, 'WARN'))


# Planned trajectories

TURNED = HOME._replace(quaternion=(0.0, 0.0, math.sin(1.0), math.cos(1.0)))
UNFIT = {
    'rejected: at ': ([HOME, HOME._replace(position=(0.0, 0.0, 4.0))], {}),
    'det(J) crosses zero': ([HOME, TURNED], {}),
    "wrong frame_id: 'world', must be 'base' or empty": ([HOME, HOME], {'frame': 'world'}),
}


def test_an_invalid_trajectory_is_rejected_as_a_whole(renew: Start) -> None:
    node = renew('singularity.stop_condition:=1.0e+9', 'limits.force_max:=1.0e+9',
                 'limits.velocity_max:=100.0', 'limits.length_max:=3.0')
    planner = Planner(node)
    for number, (text, (samples, how)) in enumerate(UNFIT.items(), start=1):
        planner.send(samples, **{'step': 10**9, **how})
        planner.until_rejected(text, number)
        node.answer(MOVING)
    planner.send_bytes(raw(HOME.combined(1))[:-20])
    planner.until_rejected('rejected: malformed: ', len(UNFIT) + 1)
    assert any('planned trajectory rejected: ' in line
               for line in log_lines(node.program.stderr, 'ERROR'))
    assert not planner.raw
    planner.send([HOME, HOME])
    planner.until_answered(1)
    node.until_status('planned trajectory', OK, 'accepted: 2 points')


@pytest.mark.slow
def test_trajectories_for_which_the_queue_is_full_are_rejected(renew: Start) -> None:
    node = renew()
    planner = Planner(node)
    planner.fill()
    node.until_reported(
        'planned trajectory', ERROR, 'rejected: queue full: 5 are in work or wait')
    node.until_status('planned trajectory', OK, 'accepted: 20000 points')
    node.until(lambda: int(node.values('planned trajectory')['rejected: queue full']) > 0,
               'they are counted')


@pytest.mark.slow
def test_a_trajectory_in_work_is_dropped_when_the_node_ends(renew: Start) -> None:
    node = renew()
    planner = Planner(node)

    def dropped() -> bool:
        # Samples between the points take seconds; the request may come before the trajectory.
        planner.send_long(5_000, step=1000, swing=0.1)
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
            assert node.change(transition)
        return ('planned trajectories dropped, because the node is deactivated: '
                in node.program.stderr)

    node.until(dropped, 'a trajectory in work is dropped')
    node.until_active()

    outcomes = -1

    def answered() -> bool:
        """Send one more when the last is rejected: messages still under way may fill the queue."""
        nonlocal outcomes
        values = node.values('planned trajectory')
        number = sum(int(values.get(key, 0)) for key in ('accepted', 'rejected'))
        if number != outcomes:
            planner.send([HOME, HOME])
            outcomes = number
        return 'accepted: 2 points' in node.status('planned trajectory').message

    node.until(answered, 'the next trajectory is answered')
