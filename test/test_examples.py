# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The examples, as they stand, over real topics; the controller is tested in test_loop.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
import gc
from pathlib import Path
import re
import runpy
import signal
import sys

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
import numpy as np
import pytest
import rclpy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.highlevel import AnyReader
from running import (
    assert_only_log_lines, DynamicsNode, executable, HOME as RESTING, nanoseconds,
    own_domain, Peer, PLATFORM, Program, ROOT)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from stewart_dynamics import approach, Capability, Motion, Pose, StewartPlatform
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.setpoint import read_message, StampedNumbers, StampedWriter
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from trajectory_msgs.msg import JointTrajectory

EXAMPLES = ROOT / 'examples'
sys.path.insert(0, str(EXAMPLES))
from leg_controller import gains  # noqa: E402, I100, I202
from stream_setpoints import height, RATE, setpoint  # noqa: E402, I100, I202

HOME = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0]
THERE = [0.1, -0.05, 1.2, 0.0, 0.1, 0.3]

Run = Callable[..., Program]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """Return a function that starts an example; it ends with the test."""
    programs: list[Program] = []

    def begin(name: str, domain: int, *arguments: object) -> Program:
        programs.append(Program([sys.executable, EXAMPLES / name, *map(str, arguments)], domain,
                                tmp_path / f'example_{len(programs)}'))
        return programs[-1]

    yield begin
    for program in programs:
        program.kill()


def line_at_the_end(name: str, domain: int, *arguments: str) -> str:
    """Return the line with which an example ends in this process, exit code 1."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_DOMAIN_ID', str(domain))
        patch.setattr(sys, 'argv', [name, *arguments])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(EXAMPLES / name), run_name='__main__')
    code = ended.value.code
    # The traceback holds the example's node, which the next test in this domain would find.
    del ended
    gc.collect()
    # A text as exit code is printed as a line, with exit code 1.
    assert isinstance(code, str)
    line, = code.splitlines()
    return line


@pytest.mark.slow
def test_a_planned_motion_is_answered_or_its_rejection_is_printed(
        start: Callable[..., DynamicsNode], run: Run) -> None:
    # Its answers go to the topic of a joint_trajectory_controller.
    topic = '/controller/joint_trajectory'
    node = start(command=[executable('stewart_dynamics'), '--ros-args', '-r',
                          f'~/leg_trajectory:={topic}'])
    node.until_active()
    answers = node.peer.listen(topic, JointTrajectory)

    def planned(*arguments: object) -> Program:
        return run('plan_motion.py', node.domain, '--timeout', '60.0', *arguments, '--ros-args',
                   '-r', f'stewart_dynamics/leg_trajectory:={topic}')

    settings = ReferenceMotionParameters({
        'motion.type': 'quintic', 'motion.initial': HOME, 'motion.final': THERE,
        'motion.duration': 2.0, 'rate': 100.0})
    expected = node.platform.inverse_dynamics(motion_at(settings, sample_times(settings) * 1e-9))
    given = ['--from', *HOME]

    def is_rejected() -> bool:
        program = planned(*given, '--to', *THERE, '--duration', '0.3')
        assert program.wait() == 1
        assert program.stdout == ''
        return re.fullmatch(r'rejected: at 0\.\d+ s leg_\d: rate .* above limits\.velocity_max\n',
                            program.stderr) is not None

    # Before and after one that is accepted: neither is taken for the other's answer.
    assert is_rejected()
    program = planned(*given, '--to', *THERE, '--duration', '2.0')
    assert program.wait() == 0, program.stderr
    assert program.stdout == ('accepted: 201 points over 2 s, largest effort '
                              f'{np.abs(expected.forces).max():.0f} N\n')
    node.until(lambda: answers, 'the answer is heard here, too')
    assert is_rejected()
    assert len(answers) == 1
    monitor = run('show_diagnostics.py', node.domain)
    node.until(lambda: 'setpoints: no setpoint: ' in monitor.stdout, 'a status is printed')
    assert re.search(r'^STALE  stewart_dynamics: setpoints: no setpoint: setpoint/pose never came',
                     monitor.stdout, re.MULTILINE)
    assert monitor.stop() == 0
    # Others may have been found by then.
    assert re.fullmatch(
        '(no subscriber .+, )?no publisher on /stewart_dynamics/leg_trajectory'
        r'(, no diagnostics .+)? within 1 s; are topics remapped\? See --help',
        line_at_the_end('plan_motion.py', node.domain, '--timeout', '1.0', *map(str, given)))
    assert 'motion.duration: -1.0 s: must be more than 0' in line_at_the_end(
        'plan_motion.py', node.domain, '--duration', '-1.0', *map(str, given))


@pytest.mark.slow
def test_a_planned_motion_starts_from_the_measured_legs(
        node: DynamicsNode, run: Run) -> None:
    """As under ros2_control with mock hardware, which begins at the home pose."""
    answers = node.peer.listen('/stewart_dynamics/leg_trajectory', JointTrajectory)
    legs = node.peer.writer('/joint_states', JointState)
    p = node.platform.parameters
    positions = node.platform.inverse_kinematics(node.platform.home_pose()) - p[
        'geometry.zero_length']
    measured = serialize_message(JointState(
        name=['wheel', *reversed(p['joints'])], position=[7.0, *reversed(positions.tolist())]))
    program = run('plan_motion.py', node.domain, '--timeout', '60.0', '--ros-args',
                  '-r', 'stewart_dynamics/measured_legs:=/joint_states')
    node.until(lambda: legs.publish(measured) or program.ended and answers, 'it is answered')
    assert program.wait() == 0, program.stderr
    first = deserialize_message(answers[0], JointTrajectory).points[0]
    # The controller follows only from within 20 mm.
    np.testing.assert_allclose(first.positions, positions, atol=1e-9)
    assert line_at_the_end('plan_motion.py', node.domain, '--timeout', '1.0') == (
        'no measured legs leg_1, leg_2, leg_3, leg_4, leg_5, leg_6 on '
        '/stewart_dynamics/measured_legs within 1 s; give --from, or remap the topic')


def test_a_stream_begins_with_an_approach_from_the_measured_legs(
        node: DynamicsNode, run: Run) -> None:
    platform = node.platform
    lengths = platform.inverse_kinematics(Pose.from_euler(THERE[:3], THERE[3:]))
    zero = platform.parameters['geometry.zero_length']
    legs = node.peer.writer('/joint_states', JointState)
    measured = serialize_message(JointState(
        name=platform.parameters['joints'], position=(lengths - zero).tolist()))
    stream = partial(setpoint, platform.home_pose(), height(platform))
    before = approach(platform, platform.forward_kinematics(lengths), stream(0.0), rate=RATE)
    expected = [platform.inverse_dynamics(motion) for motion in (
        before.motion, *(stream(n / RATE) for n in range(1, 200)))]
    rows = np.vstack([np.column_stack([
        np.atleast_2d(each.lengths) - zero, np.atleast_2d(each.rates),
        np.atleast_2d(each.forces)]) for each in expected])
    assert np.abs(rows[0, :6] + zero - lengths).max() < 1e-9
    program = run('stream_setpoints.py', node.domain, '--timeout', '60.0', '--ros-args', '-r',
                  'stewart_dynamics/measured_legs:=/joint_states')
    answers: list[tuple[int, int]] = []

    def streamed() -> bool:
        """Find each answer among those expected, and return whether the stream has begun."""
        if not program.stdout:
            legs.publish(measured)
        states = node.received('leg_states')
        if states and not node.fed:
            stamp = nanoseconds(states[0].header.stamp)
            node.fed.append(range(stamp, stamp + 10**12, 10_000_000))
        for state in states[len(answers):]:
            away = np.abs(rows - [*state.position, *state.velocity, *state.effort]).max(axis=1)
            assert away.min() < 1e-6
            answers.append((nanoseconds(state.header.stamp), int(np.argmin(away))))
        return bool(answers) and answers[-1][1] > len(before.times) + 20

    node.until(lambda: program.ended or streamed(), 'the stream has begun')
    assert program.stop() == 0, program.stderr
    assert program.stdout == f'approach over {before.times[-1]:g} s\n'
    stamps, indices = np.array(answers).T
    assert indices[0] == 0
    # Where the motion has begun, stamps are the times of the motion.
    moving = indices > 0
    assert len(set((stamps - 10_000_000 * indices)[moving])) == 1


def test_topics_of_a_node_are_recorded_and_its_service_is_called(
        node: DynamicsNode, run: Run, tmp_path: Path) -> None:
    known = '/stewart_dynamics/leg_states'
    answered = node.peer.listen(known, JointState)
    program = run('record_bag.py', node.domain, '--output', tmp_path / 'bag')
    node.until(lambda: 'bag_recorder' in [
        each.node_name for each in node.peer.node.get_subscriptions_info_by_topic(known)],
        'it is recorded')
    for _ in range(30):
        node.answer()
    called = run('call_service.py', node.domain)
    assert called.wait() == 1
    assert called.stdout == 'no measured legs\n'
    assert program.stop() == 0, program.stderr
    assert re.search(rf'^ +\d+ {known}$', program.stdout, re.MULTILINE), program.stdout
    with AnyReader([tmp_path / 'bag']) as reader:
        recorded: dict[str, list[bytes]] = {each.topic: [] for each in reader.connections}
        for connection, _, data in reader.messages():
            recorded[connection.topic].append(bytes(data))
    assert recorded['/stewart_dynamics/singularity_warning']  # latched
    assert len(set(recorded[known]) & set(answered)) > 20
    again = run('record_bag.py', node.domain, '--output', tmp_path / 'bag')
    assert again.wait() == 1
    assert len(again.stderr.splitlines()) == 1


@pytest.mark.slow
def test_parameters_are_set_all_or_none(
        start: Callable[..., DynamicsNode], run: Run, tmp_path: Path) -> None:
    node = start()
    node.until_active()
    set_ = partial(run, 'set_parameters.py', node.domain)
    file = tmp_path / 'payload.yaml'
    file.write_text('/**: {ros__parameters: {payload: {mass: 20.0, '
                    'center_of_mass: [0.0, 0.0, 0.3]}}}\n', encoding='utf-8')
    node.answer()
    program = set_('--file', file, 'payload.mass=82.0')  # the later one counts
    assert program.wait() == 0, program.stderr
    assert program.stdout == '3 parameters of /stewart_dynamics set\n'
    laden = StewartPlatform(node.platform.parameters.replaced({
        'payload.mass': 82.0, 'payload.center_of_mass': [0.0, 0.0, 0.3]}))
    node.answer(platform=laden)
    program = set_('payload.mass=1.0', 'payload.inertia=[-1.0, 0.0, 0.0, 1.0, 0.0, 1.0]')
    assert program.wait() == 1
    assert program.stderr.startswith('set_parameters: payload.inertia: ')
    assert len(program.stderr.splitlines()) == 1
    node.answer(platform=laden)


@pytest.mark.parametrize('name', [
    'call_service.py', 'plan_motion.py', 'push_platform.py', 'set_parameters.py',
    'stream_setpoints.py'])
def test_without_a_node_it_ends_with_one_line(domain: int, name: str) -> None:
    assert 'within 0.5 s' in line_at_the_end(name, domain, '--timeout', '0.5')


@pytest.mark.parametrize('name', sorted(
    path.name for path in EXAMPLES.glob('*.py') if 'import rclpy' in path.read_text()))
def test_bad_ros_arguments_end_it_with_one_line(domain: int, name: str) -> None:
    line = line_at_the_end(name, domain, '--ros-args', '-r', 'no rule')
    assert line.startswith(f'{name.removesuffix(".py")}: ')
    assert 'remap rule' in line


@pytest.mark.parametrize('name', sorted(path.name for path in EXAMPLES.glob('*.py')))
def test_help_and_unknown_arguments_start_nothing(
        domain: int, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for argument, code in (('--help', 0), ('--no-such-option', 2)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv('ROS_DOMAIN_ID', str(domain))
            patch.setattr(sys, 'argv', [name, argument])
            with pytest.raises(SystemExit, match=f'^{code}$'):
                runpy.run_path(str(EXAMPLES / name), run_name='__main__')
        rclpy.try_shutdown()
        said = capsys.readouterr()
        assert f'usage: {name}' in said.out + said.err


def test_without_a_position_the_base_is_not_compensated(domain: int) -> None:
    assert line_at_the_end('motion_compensation.py', domain) == (
        'motion_compensation: position or params_file: one must be given')


def test_nothing_recorded_is_no_success(domain: int, tmp_path: Path) -> None:
    assert line_at_the_end(
        'record_bag.py', domain, '--duration', '0.1', '--output', str(tmp_path / 'bag')) == (
        'record_bag: no message was received on a topic of stewart_dynamics or stewart_simulator')
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize('arguments', [(), ('--ros-args', '-r', '__ns:=/cell')])
def test_nodes_in_a_namespace_are_recorded(
        domain: int, run: Run, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    peer = Peer(domain)
    topic = '/cell/stewart_dynamics/leg_states'
    writer = peer.writer(topic, JointState)
    folder = tmp_path / 'recorded'
    program = run('record_bag.py', domain, '--output', folder / 'bag', *arguments)
    peer.watched = program
    try:
        peer.until(lambda: writer.get_subscription_count() == 1, 'it is recorded')
        writer.publish(serialize_message(JointState(name=['leg_1'])))
        peer.spin(0.5)
        assert not (folder / 'bag').exists()  # until it is complete
    finally:
        peer.watched = None
        code = program.stop()
        peer.close()
    assert code == 0, program.stderr
    assert re.search(rf'^ +1 {topic}$', program.stdout, re.MULTILINE), program.stdout
    assert [path.name for path in folder.iterdir()] == ['bag']


def test_a_second_interrupt_does_not_disturb_the_end(domain: int, run: Run) -> None:
    peer = Peer(domain)
    program = run('leg_controller.py', domain, '--ros-args', '-p', f'params_file:={PLATFORM}')
    try:
        peer.until(lambda: program.ended or peer.node.count_subscribers(
            '/stewart_dynamics/leg_states'), 'it has started')
        program.process.send_signal(signal.SIGINT)
        assert program.stop() == 0, program.stderr
    finally:
        peer.close()
    assert 'Traceback' not in program.stderr


def test_gains_and_heights_are_those_of_the_hexapod() -> None:
    for name in ('platform', 'telescope'):
        platform = StewartPlatform.from_yaml(ROOT / 'config' / f'{name}.yaml')
        home = platform.home_pose()
        most = height(platform)
        assert 0.0 < most <= 0.06
        lengths = platform.inverse_kinematics(home)
        p = platform.parameters
        top = platform.inverse_kinematics(setpoint(home, most, 2.5))
        assert np.all(top <= p['limits.length_max'])
        assert np.all(lengths >= p['limits.length_min'])
        k_p, k_d = gains(platform)
        omega = 2.0 * np.pi * 8.0
        assert k_d == pytest.approx(2.0 * k_p / omega)
        masses = []  # the force for an acceleration of one leg, the others held
        for leg in range(6):
            acceleration = np.zeros(6)
            acceleration[leg] = 1.0
            twist_rate = np.linalg.solve(platform.inverse_jacobian(home), acceleration)
            moved = Motion(home.position, home.rotation, linear_acceleration=twist_rate[:3],
                           angular_acceleration=twist_rate[3:])
            force = platform.inverse_dynamics(moved).forces - platform.inverse_dynamics(
                Motion.from_pose(home)).forces
            masses.append(force[leg])
        assert k_p == pytest.approx(max(masses) * omega ** 2)


@pytest.mark.slow
def test_a_push_is_found_in_the_loop(ros_environment: None, tmp_path: Path, run: Run) -> None:
    """In the simulator's own time, so that it depends on no load of the computer."""
    simulated = ['-p', 'use_sim_time:=true']
    with own_domain() as domain:
        peer = Peer(domain)
        programs = [Program([*command, '--ros-args', *arguments], domain, tmp_path / str(n))
                    for n, (command, arguments) in enumerate((
                        ([executable('stewart_simulator')],
                         ['--params-file', PLATFORM, '--params-file',
                          ROOT / 'config' / 'simulator.yaml', *simulated]),
                        ([executable('stewart_dynamics')],
                         ['--params-file', PLATFORM,
                          '-r', '~/measured_legs:=/stewart_simulator/leg_states']),
                        ([sys.executable, EXAMPLES / 'leg_controller.py'], simulated)))]
        try:
            found = peer.listen('/stewart_dynamics/external_wrench', WrenchStamped)
            known = ('/stewart_dynamics/leg_states', '/stewart_simulator/commands',
                     '/stewart_simulator/leg_states', '/stewart_dynamics/measured_legs')
            peer.until(lambda: peer.node.count_subscribers(known[0]) == 1
                       and peer.node.count_subscribers(known[1]) == 1
                       and peer.node.count_subscribers(known[2]) == 2, 'all are there')
            programs.append(Program(
                [executable('stewart_trajectory'), '--ros-args', '--params-file',
                 ROOT / 'config' / 'trajectory_loop.yaml', *simulated, '-p',
                 'start_timeout:=1000.0'], domain, tmp_path / 'trajectory'))
            peer.until(lambda: len(found) > 100, 'the loop runs')
            program = run('push_platform.py', domain, '--timeout', '60.0', '--force', 200.0,
                          -100.0, 50.0, '--moment', 10.0, 0.0, -40.0)
            assert program.wait() == 0, program.stderr
        finally:
            for each in programs:
                each.kill()
            peer.close()
    rows = [[float(number) for number in re.findall(r'-?\d+\.\d+', line)]
            for line in program.stdout.splitlines()]
    assert [line.split(':')[0] for line in program.stdout.splitlines()] == [
        'before', 'pushed', 'after']
    # A second of a filter of 10 Hz leaves nothing of the step; the motion at 500 Hz leaves less
    # than this.
    for row, load in zip(rows, ([0.0] * 6, [200.0, -100.0, 50.0, 10.0, 0.0, -40.0], [0.0] * 6),
                         strict=True):
        assert row == pytest.approx(load, abs=1.0)


def test_motion_compensation_keeps_the_platform_still_until_the_base_motion_stops(
        domain: int, run: Run) -> None:
    peer = Peer(domain)
    kinds = {'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}
    writers = {name: peer.writer(f'/stewart_simulator/base/{name}', kind)
               for name, kind in kinds.items()}
    heard = {name: peer.listen(f'/stewart_dynamics/setpoint/{name}', kind)
             for name, kind in kinds.items()}
    types = {'pose': type_names.POSE_STAMPED, 'twist': type_names.TWIST_STAMPED,
             'accel': type_names.ACCEL_STAMPED}
    # A loaded computer may be late: the timeout is long.
    program = run('motion_compensation.py', domain, '--ros-args', '-p', 'timeout:=5.0',
                  '-p', 'position:=[0.1, 0.0, 1.2]', '-p', 'angles:=[0.0, 0.1, 0.2]')
    peer.watched = program

    def publish(n: int, base: Motion, names: tuple[str, ...] = tuple(kinds)) -> None:
        numbers = {'pose': [*base.position, *base.quaternion], 'twist': base.rows[12:18],
                   'accel': base.rows[18:]}
        for name in names:
            writers[name].publish(StampedWriter('world', len(numbers[name])).write(
                n * 10_000_000, numbers[name]))

    try:
        def connected() -> bool:
            publish(0, Motion([0.0, 0.0, 0.0], np.eye(3)))
            return all(heard.values())

        def answers(name: str) -> list[StampedNumbers]:
            read = [read_message(types[name], data) for data in heard[name]]
            return [each for each in read if each.stamp > 0]

        peer.until(connected, 'it is there, and hears and is heard')
        base = Motion.from_euler([0.2, 0.1, -0.1], [0.1, -0.2, 0.3], [0.5, 0.4, 0.3],
                                 [0.1, 0.2, 0.3], [1.0, -1.0, 0.5], [0.3, -0.2, 0.1])
        # An accel that never comes leaves a motion without setpoint.
        publish(1, base, ('pose', 'twist'))
        publish(2, base)
        publish(3, Motion([0.0, 0.0, 0.0], np.eye(3)))
        peer.until(lambda: all(len(answers(name)) == 2 for name in kinds), 'it answers')
        for name in kinds:
            assert [each.stamp for each in answers(name)] == [20_000_000, 30_000_000]
            assert answers(name)[0].frame == b'base'
        position = np.array(answers('pose')[0].values[:3])
        world = base.position + base.rotation @ position
        np.testing.assert_allclose(world, [0.1, 0.0, 1.2], atol=1e-14)
        # The velocity of the platform in the world is zero.
        velocity, spin = np.reshape(answers('twist')[0].values, (2, 3))
        np.testing.assert_allclose(
            base.rotation @ velocity + base.linear_velocity
            + np.cross(base.angular_velocity, base.rotation @ position), 0.0, atol=1e-14)
        np.testing.assert_allclose(base.rotation @ spin, -base.angular_velocity, atol=1e-14)
        level = answers('pose')[1].values[3:]
        np.testing.assert_allclose(
            Motion.from_quaternion([0.0] * 3, level).rotation, from_euler([0.0, 0.1, 0.2]),
            atol=1e-14)
        writers['accel'].publish(StampedWriter('world', 6).write(40_000_000, [np.nan] * 6))
        publish(4, base, ('pose', 'twist'))
        peer.until(lambda: 'no setpoint: ' in program.stderr, 'it rejects what is not finite')
        peer.until(lambda: 'no base motion for 5.0 s: setpoints stop' in program.stderr,
                   'it stops')
        for n in range(5, 8):
            publish(n, base)
        peer.until(lambda: 'setpoints have stopped' in program.stderr, 'it stays stopped')
        assert [len(answers(name)) for name in kinds] == [2, 2, 2]
        assert program.stop() == 0
        assert_only_log_lines(program.stderr)
    finally:
        peer.close()


@pytest.mark.slow
def test_travel_is_published_and_shown(node: DynamicsNode, run: Run) -> None:
    messages = node.peer.listen('/stewart_dynamics/travel', Float64MultiArray)
    panel = run('show_travel.py', node.domain)

    def shown() -> bool:
        node.answer()
        return bool(messages) and panel.stdout.count('\n') >= 6

    node.until(shown, 'the travel is shown')
    message = deserialize_message(messages[-1], Float64MultiArray)
    assert [(each.label, each.size, each.stride) for each in message.layout.dim] == [
        ('x y z rx ry rz', 6, 12), ('minus plus', 2, 2)]
    pose = Pose.from_quaternion(RESTING.position, RESTING.quaternion)
    assert np.array(message.data).reshape(6, 2).T == pytest.approx(np.array([
        Capability(node.platform).travel(pose, sign * np.eye(6)).value for sign in (-1.0, 1.0)]))
    rows = panel.stdout.splitlines()[:6]
    assert [row.split()[0] for row in rows] == ['x', 'y', 'z', 'rx', 'ry', 'rz']
    assert f'{1e3 * message.data[5]:.1f} mm' in rows[2]
    assert panel.stop() == 0
