# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node over real topics, and the replay, with cranks in place of telescopic legs."""

from __future__ import annotations

from collections.abc import Callable
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from programs import call
import pytest

pytest.importorskip('rclpy')

from estimate_cases import CASES, rich  # noqa: E402, I100
from messages import write_bag  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from referees import rng  # noqa: E402
from running import (  # noqa: E402
    bits, DynamicsNode, ERROR, header, INPUTS, NODE, OK, Planner, ROOT, Sample, WARN)
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Float64MultiArray  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from stewart_dynamics import Capability, StewartPlatform  # noqa: E402
from stewart_dynamics.arrays import NO_WRENCH  # noqa: E402
from stewart_dynamics.external_wrench.estimate import ExternalWrench  # noqa: E402
from stewart_dynamics.external_wrench.measured_legs import (  # noqa: E402
    LegHistory, MeasuredLegs)
from stewart_dynamics.external_wrench.payload import identify  # noqa: E402
from stewart_dynamics.mechanics.batch import missing_distances  # noqa: E402
from stewart_dynamics.mechanics.frames.rotation import from_quaternion  # noqa: E402
from stewart_dynamics.messages.joint_state import JointStateWriter  # noqa: E402
from stewart_dynamics.replay.replay_command_line import main as replay  # noqa: E402
from test_replay import recorded  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

CRANKS = ROOT / 'config' / 'crank_platform.yaml'
PLATFORM = StewartPlatform.from_yaml(CRANKS)
JOINTS: tuple[str, ...] = PLATFORM.parameters.joints
HEIGHT = float(PLATFORM.home_pose().position[2])
HOME = Sample((0.0, 0.0, HEIGHT))
TOO_HIGH = Sample((0.0, 0.0, HEIGHT + 0.5))
LATER = 10_000_000_000  # the cranks can be anywhere then [ns]

Start = Callable[..., DynamicsNode]


@pytest.fixture
def node(start: Start) -> DynamicsNode:
    """Return an active node of the rig with cranks."""
    each = start(file=CRANKS)
    each.until_active()
    return each


def swaying(n: int) -> Sample:
    """Return a setpoint of a motion about home."""
    t, w = 0.01 * n, 2.0 * math.pi
    angle = 0.1 * math.sin(w * t)
    return Sample(
        (0.02 * math.sin(w * t), 0.0, HEIGHT + 0.03 * math.cos(w * t)),
        (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)),
        (0.02 * w * math.cos(w * t), 0.0, -0.03 * w * math.sin(w * t),
         0.1 * w * math.cos(w * t), 0.0, 0.0),
        (-0.02 * w * w * math.sin(w * t), 0.0, -0.03 * w * w * math.cos(w * t),
         -0.1 * w * w * math.sin(w * t), 0.0, 0.0))


def missing(sample: Sample) -> Any:
    """Return by how much each leg misses its platform joint [m]."""
    return missing_distances(PLATFORM.structure, sample.motion().rows)


def reach() -> float:
    """Return the height up to which all cranks reach."""
    low, high = HEIGHT, HEIGHT + 0.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        reached = not missing(Sample((0.0, 0.0, middle))).any()
        low, high = (middle, high) if reached else (low, middle)
    return low


def test_answers_have_the_bits_of_the_library_and_of_the_replay(
        node: DynamicsNode, tmp_path: Path) -> None:
    samples = [swaying(n) for n in range(200)]
    sent = []
    for n, sample in enumerate(samples):
        if n % 20 == 5:
            stamp = node.send(TOO_HIGH)
            sent.append((TOO_HIGH, stamp))
            node.rejects('setpoint', 'out of reach')
        stamp = node.send(sample)
        sent.append((sample, stamp))
        if n % 50 == 49:  # no more wait than can be answered
            node.state_of(stamp)
    states = [node.state_of(stamp) for sample, stamp in sent if sample is not TOO_HIGH]
    for sample, state in zip(samples, states, strict=True):
        node.check(state, node.result_of(sample))
    angles, torques, determinants = (
        [message.data for message in node.received(topic)]
        for topic in ('leg_angles', 'leg_torques', 'jacobian_determinant'))
    results = [node.result_of(sample) for sample in samples]
    assert [bits(each) for each in angles] == [bits(each.angles) for each in results]
    assert [bits(each) for each in torques] == [bits(each.torques) for each in results]
    assert bits(determinants) == bits([each.determinant for each in results])
    node.until_counted()

    bag = write_bag(tmp_path / 'bag', [
        (f'{NODE}/{topic}', stamp, serialize_message(message)) for sample, stamp in sent
        for topic, message in sample.messages(stamp).items()])
    call(replay, bag, '--params', CRANKS, '--output', tmp_path / 'results')
    folder = tmp_path / 'results' / 'bag'
    replayed: dict[str, list[bytes]] = {topic: [] for topic in node.raw}
    for topic, _, data in recorded(folder / 'bag' / 'bag.mcap'):
        if topic in replayed:
            replayed[topic].append(data + bytes(-len(data) % 4))
    assert node.raw == replayed
    summary = json.loads((folder / 'summary.json').read_text())
    assert [(each['topic'], each['reason'], each['count']) for each in summary['rejected']] == [
        ('setpoint', 'out of reach', 10)]


def test_there_are_topics_of_angles_and_torques_alone(node: DynamicsNode) -> None:
    def writers(topic: str) -> int:
        return node.peer.node.count_publishers(f'{NODE}/{topic}')

    node.until(lambda: writers('leg_torques') == 1 == writers('leg_angles'), 'they are known')
    assert writers('leg_forces') == 0 == writers('leg_lengths')


def test_a_setpoint_out_of_reach_is_rejected_by_the_name_of_the_leg(node: DynamicsNode) -> None:
    node.answer(HOME)
    node.until(lambda: node.warning is False, 'all messages have come')
    answered = {topic: len(messages) for topic, messages in node.raw.items()}
    pose = Sample((0.0, 0.0, reach() + 0.0042), HOME.quaternion)
    distances = missing(pose)
    leg = int(np.argmax(distances))
    words = f'{JOINTS[leg]} cannot reach: {1e3 * distances[leg]:.3g} mm missing'
    stamp = node.send(pose)
    node.until_said(f'setpoint rejected: out of reach: stamp {stamp} ns: {words}')
    node.until_status('setpoints', WARN, words)
    node.rejects('setpoint', 'out of reach')
    node.until_counted()
    assert {topic: len(messages) for topic, messages in node.raw.items()} == answered
    node.answer(HOME)
    node.at_work(HOME)


def test_a_dead_centre_is_a_limit_and_no_singularity(node: DynamicsNode) -> None:
    near = Sample((0.0, 0.0, reach() - 1e-5))
    node.answer(HOME)
    result = node.result_of(near)
    ratios = np.abs(result.levers) / PLATFORM.parameters['legs.crank.length']
    assert (ratios < 0.1).any()
    node.answer(near, stamp=node.stamp(LATER))
    leg = int(np.argmin(ratios))
    node.until_reported('limits', ERROR, (
        f'near a dead centre: {JOINTS[leg]}: lever {ratios[leg]:.6g} is '
        f'{0.1 - ratios[leg]:.6g} below limits.lever_min'))
    assert node.status('singularity').level == OK
    assert node.warning is False

    assert node.set_parameters(limits__action='suppress_forces').successful
    stamp = node.send(near)
    assert not len(node.state_of(stamp).effort)
    node.until_reported('limits', ERROR, 'torques suppressed')
    node.answer(HOME, stamp=node.stamp(LATER))


def test_a_dead_centre_is_predicted(start: Start) -> None:
    node = start('limits.angle_min:=[-1.5]', 'limits.angle_max:=[1.5]', file=CRANKS)
    node.until_active()
    node.answer(HOME)
    node.until_status('limits', OK, 'all held')
    assert node.values('limits')['time to dead centre (s)'] == 'none'
    height, speed = reach() - 0.02, 0.1
    rising = Sample((0.0, 0.0, height), twist=(0.0, 0.0, speed, 0.0, 0.0, 0.0))
    node.answer(rising, stamp=node.stamp(LATER))
    said = node.until_status('limits', WARN, 'dead centre predicted: lever of ')
    assert 'falls to limits.lever_min in ' in said
    assert 'singularity.warn_time is 0.5 s' in said
    # The time at which the lever is there, by the motion itself.
    low, high = 0.0, 0.2
    for _ in range(50):
        middle = 0.5 * (low + high)
        levers = PLATFORM.inverse_dynamics(
            Sample((0.0, 0.0, height + speed * middle)).motion()).levers
        far = np.abs(levers).min() > 0.1 * PLATFORM.parameters['legs.crank.length'][0]
        low, high = (middle, high) if far else (low, middle)
    predicted = float(said.partition(' in ')[2].partition(' s,')[0])
    assert predicted == pytest.approx(low, rel=0.1)
    assert 'dead centre' not in node.status('singularity').message
    node.until_said('dead centre predicted')
    node.answer(HOME, stamp=node.stamp(LATER))
    node.until_status('limits', OK, 'all held')


def test_limits_of_angle_speed_torque_and_rod_are_named_and_torques_clipped(start: Start) -> None:
    node = start(*(f'limits.{name}:=[{value}]' for name, value in {
        'angle_max': 0.05, 'speed_max': 0.5, 'torque_max': 50.0,
        'rod_force_max': 300.0}.items()), file=CRANKS)
    node.platform = StewartPlatform(node.platform.parameters.replaced({
        'limits.angle_max': 0.05, 'limits.speed_max': 0.5, 'limits.torque_max': 50.0,
        'limits.rod_force_max': 300.0}))
    node.until_active()
    fast = Sample((0.0, 0.0, HEIGHT + 0.02), twist=(0.0, 0.0, 0.3, 0.0, 0.0, 0.0))
    state = node.answer(fast)
    result = node.result_of(fast)
    assert np.abs(result.torques).max() > 50.0
    assert np.abs(state.effort).max() == 50.0
    message = node.until_status('limits', ERROR, 'above limits.torque_max, clipped')
    for name, quantity in (('angle_max', 'angle'), ('speed_max', 'speed'),
                           ('rod_force_max', 'rod force')):
        assert any(f'{quantity} ' in part and f'above limits.{name}' in part
                   for part in message.split('; ')), (name, message)
    values = node.values('limits')
    torques = np.abs(result.torques)
    assert values['largest torque demanded since activation (N m)'] == (
        f'{result.torques[torques.argmax()]:.6g}')
    assert values['leg of the largest torque demanded'] == JOINTS[int(torques.argmax())]


def test_a_jump_is_one_by_the_largest_speed(node: DynamicsNode) -> None:
    node.answer(HOME)
    node.answer(Sample((0.0, 0.0, HEIGHT + 0.1)))
    node.until_reported('limits', ERROR, 'above limits.speed_max')
    assert node.values('limits')['jumps'] == '1'


def test_motors_behind_gears_have_states_and_torques(start: Start, tmp_path: Path) -> None:
    file = tmp_path / 'rig.yaml'
    file.write_text(CRANKS.read_text() + '    drive: {gear_ratio: 30.0, efficiency: 0.8, '
                                         'torque_max: 4.0}\n')
    node = start(file=file)
    states = node.peer.listen(f'{NODE}/motor_states', JointState)
    torques = node.peer.listen(f'{NODE}/motor_torques', Float64MultiArray)
    node.until_active()
    platform = StewartPlatform.from_yaml(file)
    for n, sample in enumerate((HOME, swaying(3)), start=1):
        node.answer(sample)
        node.until(lambda n=n: min(len(torques), len(states)) >= n, 'they come')  # type: ignore
        motors = platform.motors(sample.motion())
        state = deserialize_message(states[-1], JointState)
        clipped = np.clip(motors.torques, -4.0, 4.0)
        assert bits(state.position) == bits(motors.angles)
        assert bits(state.velocity) == bits(motors.speeds)
        assert bits(state.effort) == bits(clipped)
        assert bits(deserialize_message(torques[-1], Float64MultiArray).data) == bits(clipped)
        result = platform.inverse_dynamics(sample.motion())
        assert np.array_equal(motors.speeds, 30.0 * result.speeds)


def test_measured_angles_and_torques_show_the_external_wrench(node: DynamicsNode) -> None:
    answers = node.peer.listen(f'{NODE}/external_wrench', INPUTS['wrench'])
    writer = node.peer.writer(f'{NODE}/measured_legs', JointState)
    node.until(lambda: writer.get_subscription_count() == 1, 'the node hears measurements')
    node.answer(HOME)
    load = np.array([30.0, -20.0, -150.0, 5.0, -4.0, 3.0])
    held = PLATFORM.inverse_dynamics(HOME.motion(), load)
    begin = node.stamp()
    for n in range(400):
        stamp = begin + 2_000_000 * n
        writer.publish(JointState(
            header=header(stamp), name=[*JOINTS], position=held.angles.tolist(),
            velocity=[0.0] * 6, effort=held.torques.tolist()))
        node.until(lambda n=n: len(answers) >= n, 'each is answered')  # type: ignore[misc]
    found = deserialize_message(answers[-1], INPUTS['wrench']).wrench
    wrench = [found.force.x, found.force.y, found.force.z,
              found.torque.x, found.torque.y, found.torque.z]
    assert np.abs(np.array(wrench) - load).max() < 1e-6 * np.abs(load).max()
    node.until(lambda: 'largest measured - model torque of a leg (N m)' in node.values(
        'external wrench'), 'the difference is reported in its unit')

    # Angles of no assembly are rejected by name; the next measurement is used.
    for angles in ([3.0, -3.0] * 3, held.angles.tolist()):
        stamp += 2_000_000
        writer.publish(JointState(
            header=header(stamp), name=[*JOINTS], position=angles, velocity=[0.0] * 6,
            effort=held.torques.tolist()))
    node.until_said('measured_legs rejected: ')
    assert 'angles [3, -3, 3, -3, 3, -3] rad' in node.program.stderr
    node.until(lambda: len(answers) >= 400, 'the next one is used')


def test_markers_show_cranks_and_rods(node: DynamicsNode) -> None:
    messages = node.peer.listen(f'{NODE}/markers', MarkerArray)
    node.until(lambda: node.peer.node.count_publishers(f'{NODE}/markers') == 1, 'it is there')
    sample = swaying(20)
    node.until(lambda: (node.answer(sample), messages)[1], 'markers come')
    drawn = {(each.ns, each.id): each for each in deserialize_message(
        messages[-1], MarkerArray).markers}
    motion = sample.motion()
    geometry = PLATFORM.parameters.geometry
    joints = motion.position + geometry.platform_joints @ motion.rotation.T
    for n in range(6):
        crank, rod = drawn['cranks', n], drawn['rods', n]
        begin, middle = ends_of(crank)
        other, end = ends_of(rod)
        near = {'atol': 1e-9}
        # A cylinder has no direction: its ends may be exchanged.
        if np.linalg.norm(middle - geometry.base_joints[n]) < 1e-6:
            begin, middle = middle, begin
        if np.linalg.norm(end - middle) < 1e-6:
            other, end = end, other
        np.testing.assert_allclose(begin, geometry.base_joints[n], **near)
        np.testing.assert_allclose(other, middle, **near)
        np.testing.assert_allclose(end, joints[n], **near)
        assert crank.scale.z == pytest.approx(PLATFORM.parameters['legs.crank.length'][n])
        assert rod.scale.z == pytest.approx(PLATFORM.parameters['legs.rod.length'][n])
    text = drawn['singularity', 0].text
    assert 'vermillion: drives the angle up, blue: drives it down, saturated at 250 N m' in text


def ends_of(cylinder: Any) -> list[Any]:
    """Return both ends of a marker."""
    at, q, half = cylinder.pose.position, cylinder.pose.orientation, 0.5 * cylinder.scale.z
    rotation = np.reshape(from_quaternion(q.x, q.y, q.z, q.w), (3, 3))
    return [np.array([at.x, at.y, at.z]) + side * half * rotation[:, 2] for side in (-1.0, 1.0)]


def test_travel_is_published(node: DynamicsNode) -> None:
    messages = node.peer.listen(f'{NODE}/travel', Float64MultiArray)

    def published() -> bool:
        node.state_of(node.send(HOME))
        return bool(messages)

    node.until(published, 'the travel is published')
    message = deserialize_message(messages[-1], Float64MultiArray)
    expected = [Capability(PLATFORM).travel(PLATFORM.home_pose(), sign * np.eye(6)).value
                for sign in (-1.0, 1.0)]
    assert np.array(message.data).reshape(6, 2).T == pytest.approx(np.array(expected))


SERVOS: dict[str, Any] = {  # mirrored cranks turn the other way; the fourth ends first
    'pulse_min': [0.0005, 0.0006, 0.0005, 0.0009, 0.001, 0.0005],
    'pulse_max': [0.0025, 0.0024, 0.0025, 0.0021, 0.002, 0.0025],
    'angle_at_min': [-1.1, 1.2, -1.3, 0.3, -0.8, 1.1],
    'angle_at_max': [1.3, -1.1, 1.2, -1.1, 0.9, -1.2]}


def test_servos_get_pulses_within_their_points_and_none_elsewhere(
        start: Start, tmp_path: Path) -> None:
    file = tmp_path / 'rig.yaml'
    file.write_text(CRANKS.read_text() + f'    servo: {json.dumps(SERVOS)}\n')
    platform = StewartPlatform.from_yaml(file)
    node = start(file=file)
    pulses = node.peer.listen(f'{NODE}/servo_pulses', Float64MultiArray)
    node.until_active()
    node.until(lambda: node.peer.node.count_publishers(f'{NODE}/servo_pulses') == 1, 'it is there')
    samples = [swaying(n) for n in range(0, 100, 5)]
    sent = [(sample, node.send(sample)) for sample in samples]
    for _, stamp in sent:
        node.state_of(stamp)
    expected = platform.servo_pulses(
        [node.result_of(sample, platform=platform).angles for sample in samples])
    node.until(lambda: len(pulses) == len(samples), 'all come')
    found = [deserialize_message(each, Float64MultiArray).data for each in pulses]
    assert [bits(each) for each in found] == [bits(each) for each in expected]
    low, high = (np.array(SERVOS[f'pulse_{end}']) for end in ('min', 'max'))
    assert (np.array(found) >= low).all() and (np.array(found) <= high).all()

    # Within the limits of angles, outside the points of one servo: angles, and no pulses.
    outside = Sample((0.0, 0.0, HEIGHT + 0.06))
    angle = platform.inverse_kinematics(outside.motion())[3]
    assert SERVOS['angle_at_min'][3] < angle < platform.parameters['limits.angle_max'][3]
    sent.append((outside, node.send(outside, stamp=node.stamp(LATER))))
    node.state_of(sent[-1][1])
    words = (f'no servo_pulses: {JOINTS[3]}: angle {angle:.6g} rad: must be between '
             'servo.angle_at_min and servo.angle_at_max, -1.1 and 0.3')
    node.until_status('limits', ERROR, words)
    node.until_said(words)
    assert node.values('limits')['setpoints outside the points of servos'] == '1'
    sent.append((TOO_HIGH, node.send(TOO_HIGH)))
    node.rejects('setpoint', 'out of reach')
    sent.append((HOME, node.send(HOME, stamp=node.stamp(LATER))))
    node.state_of(sent[-1][1])
    node.until(lambda: len(pulses) == len(samples) + 1, 'the next one')
    node.until_status('limits', OK, 'all held')

    bag = write_bag(tmp_path / 'bag', [
        (f'{NODE}/{topic}', stamp, serialize_message(message)) for sample, stamp in sent
        for topic, message in sample.messages(stamp).items()])
    call(replay, bag, '--params', file, '--output', tmp_path / 'results')
    assert [bits(deserialize_message(data, Float64MultiArray).data) for topic, _, data in recorded(
        tmp_path / 'results' / 'bag' / 'bag' / 'bag.mcap') if topic == 'servo_pulses'] == [
            bits(deserialize_message(each, Float64MultiArray).data) for each in pulses]
    summary = json.loads((tmp_path / 'results' / 'bag' / 'summary.json').read_text())
    notice, = (each for each in summary['notices'] if each.startswith('servo_pulses: '))
    assert notice.startswith('servo_pulses: none for 1 of the setpoints, first at t = ')
    assert words.removeprefix('no servo_pulses: ') in notice
    assert summary['limit_met']


def test_pulses_are_suppressed_with_the_torques(start: Start, tmp_path: Path) -> None:
    file = tmp_path / 'rig.yaml'
    file.write_text(CRANKS.read_text().replace('angle_max: 1.0471975511965976', 'angle_max: 0.25')
                    + f'    servo: {json.dumps(SERVOS)}\n')
    node = start('limits.action:=suppress_forces', file=file)
    node.platform = StewartPlatform.from_yaml(file)
    pulses = node.peer.listen(f'{NODE}/servo_pulses', Float64MultiArray)
    node.until_active()
    node.until(lambda: node.peer.node.count_publishers(f'{NODE}/servo_pulses') == 1, 'it is there')
    home = Sample(tuple(node.platform.home_pose().position.tolist()))  # type: ignore[arg-type]
    node.state_of(node.send(home))
    node.until(lambda: len(pulses) == 1, 'they come')
    high = Sample((0.0, 0.0, HEIGHT + 0.05))
    angles = node.platform.inverse_kinematics(high.motion())
    assert (angles > 0.25).all() and (angles < 0.3).all()
    stamp = node.send(high, stamp=node.stamp(LATER))
    assert not len(node.state_of(stamp).effort)
    node.state_of(node.send(home, stamp=node.stamp(LATER)))
    node.until(lambda: len(pulses) == 2, 'the next one')
    assert pulses[0] == pulses[1]


def test_a_planned_trajectory_is_answered_or_rejected_by_the_name_of_the_leg(
        node: DynamicsNode) -> None:
    planner, samples = Planner(node), [HOME, Sample((0.02, 0.0, HEIGHT + 0.03)), HOME]
    planner.send(samples, step=1_000_000_000)
    answer = planner.until_answered(1)
    assert len(answer.points) == 3
    for point, sample in zip(answer.points, samples, strict=True):
        result = PLATFORM.inverse_dynamics(sample.motion())
        assert bits(point.positions) == bits(result.angles)
        assert bits(point.velocities) == bits(result.speeds)
        assert bits(point.effort) == bits(result.torques)
    node.until_status('planned trajectory', OK, 'accepted: 3 points over 2 s, smallest lever')
    assert 'largest torque (N m)' in node.values('planned trajectory')
    planner.send([HOME, TOO_HIGH], step=1_000_000_000)
    planner.until_rejected(' cannot reach: ', 1)


def test_the_payload_on_cranks_is_identified_by_a_service(start: Start) -> None:
    """Measured angles, speeds and torques give the answer of the library."""
    node = start('setpoint.timeout:=60.0', file=CRANKS)
    node.until_active()
    loaded = StewartPlatform(PLATFORM.parameters.replaced({
        'platform.mass': 195.0, 'platform.center_of_mass': [0.06, -0.03, 0.38]}))
    seconds = 0.01 * np.arange(400)
    path = CASES['crank'].placed(rich(rng(4)))
    moved, acting = (loaded.inverse_dynamics(path(seconds - late)) for late in (0.0, 0.005))
    joints = JointStateWriter(JOINTS)
    states = [joints.write(LATER + round(1e9 * time), *each) for time, *each in zip(
        seconds, moved.angles, moved.speeds, acting.torques, strict=True)]
    parameters, history = PLATFORM.parameters.replaced({'setpoint.timeout': 60.0}), LegHistory(10)
    follow = MeasuredLegs(parameters, ExternalWrench(parameters), print, print, history)
    assert all(follow.use_message(each, NO_WRENCH, None) for each in states)
    *_, expected = identify(history, StewartPlatform(parameters))
    assert expected is not None and expected.payload is not None
    assert expected.payload.fitted.body.mass == pytest.approx(
        195.0, abs=expected.payload.fitted.half_widths[0])

    writer = node.peer.writer(f'{NODE}/measured_legs', JointState)
    client = node.peer.node.create_client(Trigger, f'{NODE}/identify_payload')
    node.until(client.service_is_ready, 'the service is there')
    node.until(writer.get_subscription_count, 'the node hears measured legs')
    for each in states:
        writer.publish(each)
    node.until(lambda: node.values('external wrench').get('wrenches') == str(len(states) - 1),
               'all measurements are used')
    answer = client.call_async(Trigger.Request())
    node.until(answer.done, 'the service answers')
    assert answer.result().success
    assert answer.result().message == expected.message
