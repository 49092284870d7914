# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The simulator: in a process of its own, over real topics, in real time and step by step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, ExitStack
from itertools import count
import math
from pathlib import Path
import signal
import time
from typing import Any

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from referees import rng
from rosgraph_msgs.msg import Clock
from running import (
    assert_only_log_lines, bits, executable, Inside, log_lines, nanoseconds, participants, Peer,
    PLATFORM, Program, ROOT, wrench_message)
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import BaseMotion, Motion, Pose, StewartPlatform
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.parameters.yaml_file import read_yaml
from stewart_dynamics.simulator.moving_base import GeneratedBase, GeneratedBaseMotion
from stewart_dynamics.simulator.plant import Plant
from stewart_dynamics.simulator.simulator_node import SimulatorNode
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters
from stewart_dynamics.simulator.state_messages import (
    BASE_TYPES, BaseMessages, IMU, IMU_TYPE, OUTPUT_TYPES, StateMessages)
from trajectories import FREE

SIMULATOR = '/stewart_simulator'
FILE = ROOT / 'config' / 'simulator.yaml'
CRANKS = ROOT / 'config' / 'crank_platform.yaml'
CRANKS_HOME = [0.0, 0.0, 0.65, 0.0, 0.0, 0.0]
STEPPED = 'use_sim_time:=true'
FIRST = 1_000_000_000  # where simulated time begins [ns]
PERIOD = 2_000_000  # [ns]
TYPES: dict[str, Any] = {
    'leg_states': JointState, 'pose': PoseStamped, 'twist': TwistStamped, 'accel': AccelStamped}
GIVEN = {**read_yaml(PLATFORM, 'stewart_simulator'), **read_yaml(FILE, 'stewart_simulator')}
NO_LOAD = (0.0,) * 6
SPECIAL = (math.nan, math.inf, -math.inf)


class Simulator:
    """
    The simulator, and a peer that commands it and keeps its states.

    It has the parameter files of config/ by default, and is ``inside`` this process or in its own.
    """

    def __init__(self, domain: int, folder: Path, *overrides: str, files: Sequence[Path] = (),
                 inside: bool = False) -> None:
        self.peer = Peer(domain)
        self.until = self.peer.until
        self.raw = {topic: self.peer.listen(f'{SIMULATOR}/{topic}', kind)
                    for topic, kind in TYPES.items()}
        self.raw['clock'] = self.peer.listen('/clock', Clock)
        self._commands = self.peer.writer(f'{SIMULATOR}/commands', Float64MultiArray)
        self._wrench = self.peer.writer(f'{SIMULATOR}/wrench', WrenchStamped)
        arguments = ['--ros-args', *(
            part for path in files or (PLATFORM, FILE) for part in ('--params-file', path)), *(
            part for override in ('command_timeout:=1.0e+6', *overrides)
            for part in ('-p', override))]
        self._stepped = STEPPED in overrides
        self.program: Any = Inside(SimulatorNode, arguments, domain) if inside else (
            Program([executable('stewart_simulator'), *arguments], domain, folder))
        self.peer.watched = self.program

    def until_there(self) -> None:
        """Wait until both directions are connected."""
        self.until(lambda: all(self.raw[topic] for topic in TYPES)
                   and (self.raw['clock'] or not self._stepped)
                   and self._commands.get_subscription_count()
                   and self._wrench.get_subscription_count(), 'the simulator is there')

    def until_said(self, level: str, text: str) -> str:
        """Return the first line of its log that has a text in it, once it is logged."""
        self.until(lambda: self.said(level, text), f'it says {text!r}')
        return self.said(level, text)[0]

    def said(self, level: str, text: str) -> list[str]:
        """Return the lines of its log of a level that have a text in them."""
        return [line for line in log_lines(self.program.stderr, level) if text in line]

    def command(self, message: Any) -> None:
        """Publish six forces, or any message, or bytes."""
        if not isinstance(message, bytes | Float64MultiArray):
            message = Float64MultiArray(data=[float(number) for number in message])
        self._commands.publish(message)

    def load(self, wrench: Sequence[float], frame: str = 'base') -> None:
        """Publish a load on the platform."""
        self._wrench.publish(wrench_message(wrench, frame))

    def states(self, topic: str = 'leg_states') -> list[Any]:
        """Return the messages of a topic so far."""
        return [deserialize_message(data, TYPES[topic]) for data in self.raw[topic]]

    def last(self, topic: str = 'leg_states') -> Any:
        """Return the last message of a topic."""
        return deserialize_message(self.raw[topic][-1], TYPES[topic])

    def stamps(self, topic: str = 'leg_states') -> list[int]:
        """Return the stamps of a topic's messages so far [ns]."""
        return [stamp_of(data) for data in self.raw[topic]]

    def step(self, message: Any) -> int:
        """Command one period and return its stamp, once all of it has come."""
        before = stamp_of(self.raw['clock'][-1])
        self.command(message)
        self.until(lambda: all(stamp_of(of[-1]) > before for of in self.raw.values()),
                   'time is moved')
        return stamp_of(self.raw['clock'][-1])

    def at_work(self) -> None:
        """Check that it still publishes, and only finite numbers."""
        if not self._stepped:
            many = len(self.raw['accel'])
            self.until(lambda: len(self.raw['accel']) > many + 10, 'it goes on')
        for topic in TYPES:
            for message in self.states(topic):
                assert np.all(np.isfinite(numbers_of(message))), message

    def stop(self, number: int = signal.SIGINT) -> None:
        """Stop it with a signal and check how it ends."""
        assert self.program.stop(number) == 0, self.program.stderr
        assert_only_log_lines(self.program.stderr)
        assert self.program.stdout == ''

    def close(self) -> None:
        """Leave ROS, and stop the program if it still runs."""
        try:
            if isinstance(self.program, Program) and not self.program.ended:
                self.stop()
        finally:
            self.program.kill()
            self.peer.close()


def stamp_of(data: bytes) -> int:
    """Return the stamp of a message's bytes, or of a clock's [ns]."""
    return int.from_bytes(data[4:8], 'little') * 1_000_000_000 + int.from_bytes(
        data[8:12], 'little')


def numbers_of(message: Any) -> list[float]:
    """Return the numbers of a message."""
    if isinstance(message, JointState):
        return [*message.position, *message.velocity, *message.effort]
    if isinstance(message, PoseStamped):
        p, q = message.pose.position, message.pose.orientation
        return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    of = message.twist if isinstance(message, TwistStamped) else message.accel
    return [getattr(vector, axis) for vector in (of.linear, of.angular) for axis in 'xyz']


Start = Callable[..., Simulator]


@pytest.fixture
def start(domain: int, tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts a simulator in a process of its own, one after the other."""
    with ExitStack() as stack:
        def started(*overrides: str) -> Simulator:
            stack.pop_all().close()
            return stack.enter_context(closing(
                Simulator(domain, tmp_path / str(next(numbers)), *overrides)))

        numbers = count()
        yield started


@pytest.fixture
def begin(domain: int, tmp_path: Path) -> Iterator[Start]:
    """Return a function that makes a simulator in this process; in the end it must be at work."""
    with ExitStack() as stack:
        def started(*overrides: str, **options: Any) -> Simulator:
            simulator = stack.enter_context(closing(
                Simulator(domain, tmp_path, *overrides, inside=True, **options)))
            simulator.until_there()
            stack.callback(simulator.at_work)
            return simulator

        yield started


def holding() -> list[float]:
    """Return the forces that hold the hexapod in its initial pose."""
    home = Motion(GIVEN['initial_pose'][:3], np.eye(3))
    forces: list[float] = StewartPlatform(SimulatorParameters(GIVEN)).inverse_dynamics(
        home).forces.tolist()
    return forces


# Step by step

NOISY = ('noise.length:=1.0e-5', 'noise.rate:=1.0e-3', 'noise.force:=2.0')


def test_step_by_step_the_same_commands_give_the_same_bits(start: Start) -> None:
    """Two processes, and the library in this one, at any speed."""
    random = rng()
    commands = np.array(holding()) + random.uniform(-300.0, 300.0, (40, 6))
    seen = []
    for _ in range(2):
        simulator = start(STEPPED, *NOISY)
        simulator.until_there()
        for n, command in enumerate(commands):
            if n == 20:
                simulator.load((100.0, 0.0, -50.0, 0.0, 10.0, 0.0))
                # Wrenches and commands come in any order: a rejected one shows that they came.
                simulator.load((1.0,) * 6, frame='elsewhere')
                simulator.until_said('WARN', 'wrench rejected: wrong frame_id')
            simulator.step(command)
        seen.append({topic: simulator.raw[topic][-len(commands):] for topic in TYPES})
        assert simulator.stamps()[-len(commands):] == [
            FIRST + PERIOD * (n + 1) for n in range(len(commands))]
    assert seen[0] == seen[1]
    plant = Plant(SimulatorParameters({
        **GIVEN, 'noise.length': 1e-5, 'noise.rate': 1e-3, 'noise.force': 2.0}))
    plant.measured()  # of the messages that it publishes until the first command
    messages = StateMessages(plant.parameters)
    for n, command in enumerate(commands.tolist()):
        plant.advance(tuple(command), (100.0, 0.0, -50.0, 0.0, 10.0, 0.0) if n >= 20 else NO_LOAD)
        for topic, data in messages.write(FIRST + PERIOD * (n + 1), plant.measured()):
            assert seen[0][topic][n] == data


def test_each_command_is_one_period_and_nothing_else_advances_time(begin: Start) -> None:
    simulator = begin(STEPPED)
    # Until the first command it repeats its state.
    simulator.until(lambda: len(simulator.raw['clock']) >= 3, 'it says so again')
    assert set(simulator.stamps('clock')) == set(simulator.stamps()) == {FIRST}
    assert len(set(simulator.raw['leg_states'])) == 1
    first = simulator.states()[0]
    assert not np.any([*first.velocity, *first.effort])
    # Many at once are as many periods, in their order.
    for n in range(200):
        simulator.command([500.0 + n] * 6)
    end = FIRST + 200 * PERIOD
    simulator.until(lambda: all(stamp_of(of[-1]) >= end for of in simulator.raw.values()),
                    'all are answered')
    assert [state.effort[0] for state in simulator.states()
            if nanoseconds(state.header.stamp) > FIRST] == [500.0 + n for n in range(200)]
    for topic in (*TYPES, 'clock'):
        stamps = simulator.stamps(topic)
        assert stamps == sorted(stamps)
        if topic == 'clock':
            stamps = sorted(set(stamps))
        assert [each for each in stamps if each > FIRST] == list(
            range(FIRST + PERIOD, end + 1, PERIOD))
    # Subscribers of the clock are best effort: it is repeated until answered, nothing else.
    many = len(simulator.raw['clock'])
    simulator.until(lambda: len(simulator.raw['clock']) > many + 2, 'it says so again')
    assert simulator.stamps('clock')[-1] == simulator.stamps()[-1] == end
    assert simulator.stamps()[-2] == end - PERIOD
    simulator.load((1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    assert simulator.step([500.0] * 6) == end + PERIOD


def test_torques_of_shafts_move_a_hexapod_with_cranks(begin: Start) -> None:
    """Its topics have angles, rates and torques; to the bit those of the plant in this process."""
    home = CRANKS_HOME
    simulator = begin(STEPPED, f'initial_pose:={home}', 'noise.angle:=1.0e-4',
                      files=(CRANKS, FILE))
    parameters = SimulatorParameters({
        **read_yaml(CRANKS, 'stewart_simulator'), **read_yaml(FILE, 'stewart_simulator'),
        'initial_pose': home, 'noise.angle': 1e-4})
    plant, messages = Plant(parameters), StateMessages(parameters)
    for _ in range(len(set(simulator.raw['leg_states']))):
        plant.measured()
    commands = 50.0 + rng().uniform(-30.0, 30.0, (20, 6))
    commands[-1] = 1000.0  # saturates
    for command in commands.tolist():
        stamp = simulator.step(command)
        plant.advance(tuple(command), NO_LOAD)
        for topic, data in messages.write(stamp, plant.measured()):
            assert simulator.raw[topic][-1] == data
    assert list(simulator.last().effort) == [250.0] * 6
    angles = StewartPlatform(parameters).inverse_kinematics(Pose(home[:3], np.eye(3)))
    assert np.abs(np.subtract(simulator.states()[0].position, angles)).max() < 1e-3
    simulator.until_said('WARN', 'commands: leg_1: 1000 N m exceeds limits.torque_max, clipped to '
                         '250 N m')


# In real time

def test_in_real_time_the_brakes_hold_it_until_the_first_command(begin: Start) -> None:
    simulator = begin('rate:=250.0')
    simulator.until(lambda: len(simulator.raw['accel']) > 100, 'it goes on')
    assert simulator.raw['clock'] == []
    home = StewartPlatform(SimulatorParameters(GIVEN)).inverse_kinematics(
        Pose([0.0, 0.0, 1.1], np.eye(3))) - 0.95
    for state in simulator.states():
        assert np.allclose(state.position, home, rtol=0.0, atol=1e-15)
        assert not np.any([*state.velocity, *state.effort])
    # The last command holds until the next, as of effort controllers.
    up = (np.array(holding()) + 100.0).tolist()
    simulator.command(up)
    simulator.until(lambda: simulator.last('pose').pose.position.z > 1.12, 'it rises')
    last = simulator.stamps()[-1]
    simulator.until(lambda: all(simulator.stamps(topic)[-1] >= last for topic in TYPES),
                    'the last ones have come')
    # Each topic is joined at a moment of its own, and all have the same stamps from then on.
    first = max(simulator.stamps(topic)[0] for topic in TYPES)
    stamps, *others = [[stamp for stamp in simulator.stamps(topic) if first <= stamp <= last]
                       for topic in TYPES]
    assert all(other == stamps for other in others)
    assert min(np.diff(stamps)) == 4_000_000
    # A busy computer may hold it up; nothing else may be logged.
    behind = simulator.said('WARN', 'fell behind by')
    assert simulator.said('WARN', '') == behind
    if not behind:
        assert max(np.diff(stamps)) == 4_000_000
    assert abs(stamps[0] - time.time_ns()) < 1_000_000_000_000
    assert bits(simulator.last().effort) == bits(up)


def test_when_commands_stop_the_brakes_engage_until_the_next(begin: Start) -> None:
    simulator = begin('rate:=250.0', 'command_timeout:=0.1')
    up = (np.array(holding()) + 100.0).tolist()
    for _ in range(2):
        simulator.command(up)
        before = simulator.last('pose').pose.position.z
        simulator.until(lambda before=before: simulator.last('pose').pose.position.z > before,
                        'it rises')
        simulator.until(lambda: not any([*simulator.last().velocity, *simulator.last().effort]),
                        'it is at rest')
        # the pose of that time comes on a topic of its own
        rest = nanoseconds(simulator.last().header.stamp)
        simulator.until(lambda rest=rest: nanoseconds(simulator.last('pose').header.stamp) >= rest,
                        'its pose has come')
        height = simulator.last('pose').pose.position.z
        many = len(simulator.raw['twist'])
        simulator.until(lambda many=many: len(simulator.raw['accel']) > many + 50, 'it goes on')
        assert simulator.last('pose').pose.position.z == height
        assert not np.any(numbers_of(simulator.last('twist')))
        assert not np.any(numbers_of(simulator.last('accel')))
    assert len(simulator.said('WARN', 'no command for 0.1 s: brakes engaged')) == 2
    assert len(simulator.said('INFO', 'a command came: brakes released')) == 1


# Faults: see docs/faults.md

def test_bad_commands_are_rejected_and_the_last_holds(begin: Start) -> None:
    simulator = begin(STEPPED)
    good = holding()
    simulator.step(good)
    for special in SPECIAL:
        simulator.command([*good[:5], special])
    for many in (0, 5, 7):
        simulator.command([1.0] * many)
    simulator.command(b'\0\1\0\0\0')
    for reason in ('not finite: (', 'not six numbers: 0 numbers', 'malformed: '):
        simulator.until_said('WARN', f'commands rejected: {reason}')
    # Time stood; the next is one period.
    assert simulator.step(good) == FIRST + 2 * PERIOD
    assert {tuple(state.effort) for state in simulator.states()} == {NO_LOAD, tuple(good)}


def test_bad_wrenches_are_rejected_and_the_last_holds(begin: Start) -> None:
    simulator = begin(STEPPED)
    simulator.load((0.0, 0.0, 500.0, 0.0, 0.0, 0.0))
    for special in SPECIAL:
        simulator.load([0.0] * 5 + [special])
    simulator.load((1e6, 0.0, 0.0, 0.0, 0.0, 0.0), frame='world')
    simulator.until_said('WARN', 'wrench rejected: wrong frame_id')
    simulator.until_said('WARN', 'wrench rejected: not finite')
    simulator.step(holding())
    assert np.allclose(numbers_of(simulator.last('accel'))[:2], 0.0, atol=1e-1)
    assert simulator.last('accel').accel.linear.z > 0.5


def test_forces_above_their_limit_saturate(begin: Start) -> None:
    simulator = begin(STEPPED)
    simulator.step([1000.0, -7000.0, 6000.0, 6001.0, 0.0, 1e300])
    assert simulator.last().effort.tolist() == [
        1000.0, -6000.0, 6000.0, 6000.0, 0.0, 6000.0]
    line = simulator.until_said('WARN', 'exceeds limits.force_max, clipped to')
    assert 'commands: leg_6: 1e+300 N exceeds limits.force_max, clipped to 6000 N' in line


def test_the_hexapod_rests_if_a_step_cannot_be_computed(begin: Start, tmp_path: Path) -> None:
    FREE.to_yaml(tmp_path / 'unlimited.yaml')
    simulator = begin(STEPPED, files=(tmp_path / 'unlimited.yaml', FILE))
    assert simulator.step([1e300] * 6) == FIRST + PERIOD
    simulator.until_said('ERROR', 'motion cannot be computed')
    for n in (2, 3):
        assert simulator.step(holding()) == FIRST + n * PERIOD
    last = simulator.last()
    assert not np.any([*last.velocity, *last.effort])
    assert simulator.said('ERROR', '') == simulator.said('ERROR', 'held at rest permanently')


def test_a_motion_past_the_dead_centre_is_refused(begin: Start) -> None:
    """A load of 10 MN; one of 1 MN is held by the end stops."""
    simulator = begin(STEPPED, f'initial_pose:={CRANKS_HOME}', files=(CRANKS, FILE))
    simulator.load((0.0, 0.0, 1e7, 0.0, 0.0, 0.0))
    # Wrenches and commands come in any order: a rejected one shows that the first has come.
    simulator.load((1.0,) * 6, frame='elsewhere')
    simulator.until_said('WARN', 'wrench rejected: wrong frame_id')
    for _ in range(50):
        simulator.step(NO_LOAD)
    assert 'as at a dead centre; smallest lever: leg_' in simulator.until_said(
        'ERROR', 'held at rest permanently')
    assert not np.any([*simulator.last().velocity, *simulator.last().effort])
    assert np.abs(simulator.last().position).max() < math.pi / 2
    position = simulator.last().position
    simulator.step([100.0] * 6)
    assert simulator.last().position == position


TOO_STIFF = 'actuator.coulomb_friction:=4000.0', 'actuator.reflected_mass:=0.0'


def test_a_simulator_that_was_stopped_takes_what_is_due_and_skips_the_rest(
        start: Start) -> None:
    simulator = start('rate:=50.0')  # a busy computer keeps up with it
    simulator.until_there()
    simulator.program.process.send_signal(signal.SIGSTOP)
    end = time.monotonic() + 1.0
    simulator.until(lambda: time.monotonic() > end, 'a second goes by')
    simulator.program.process.send_signal(signal.SIGCONT)
    simulator.until_said('WARN', 'fell behind by')
    simulator.until(lambda: np.any(np.diff(simulator.stamps()) > 500_000_000),
                    'a gap of a second')
    many = len(simulator.raw['leg_states'])
    simulator.until(lambda: len(simulator.raw['leg_states']) > many + 100, 'it goes on')
    assert np.all(np.diff(simulator.stamps()) >= 20_000_000)


@pytest.mark.slow
def test_a_signal_ends_it(start: Start) -> None:
    for number, overrides in (
            (signal.SIGINT, ()), (signal.SIGTERM, (STEPPED,)), (signal.SIGINT, TOO_STIFF)):
        simulator = start(*overrides)
        simulator.until_there()
        simulator.command(holding())
        if overrides == TOO_STIFF:
            simulator.until_said('WARN', 'fell behind by')
        simulator.stop(number)


# The rules are in test_plant.py and test_parameters.py.
def test_unsupported_parameters_are_reported_in_one_line(domain: int, start: Start) -> None:
    program = start('initial_pose:=[0.0, 0.0, 1.6, 0.0, 0.0, 0.0]').program
    assert program.wait() == 1, program.stderr
    assert participants(domain) == 1, 'it did not leave; the one is in this process'
    line, = (line for line in program.stderr.splitlines() if not line.startswith('[WARN]'))
    assert line.startswith('stewart_simulator: ')
    assert 'leg_1: length 1.6' in line


def test_an_initial_pose_out_of_reach_is_reported_in_one_line(domain: int, tmp_path: Path) -> None:
    with closing(Simulator(domain, tmp_path, 'initial_pose:=[0.0, 0.0, 0.9, 0.0, 0.0, 0.0]',
                           files=(CRANKS, FILE))) as simulator:
        assert simulator.program.wait() == 1, simulator.program.stderr
        assert simulator.program.stderr.splitlines()[-1].endswith(
            'leg_1 cannot reach: 2.93 mm missing')


def test_topics_and_messages_have_the_same_types() -> None:
    for types, named in ((TYPES, OUTPUT_TYPES), (OF_BASE, {**BASE_TYPES, IMU: IMU_TYPE})):
        assert {topic: f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'
                for topic, kind in types.items()} == named


# A base that moves

OF_BASE = {'base/pose': PoseStamped, 'base/twist': TwistStamped, 'base/accel': AccelStamped,
           'imu': Imu}
SEA = {'base_motion.source': 'sea', 'base_motion.ramp': 0.02,
       'base_motion.sea.response': [0.3, 0.4, 0.8, 0.03, 0.02, 0.01],
       'base_motion.lever_arm': [10.0, 0.0, 5.0], 'imu.noise.specific_force': 0.01}


def given_as(parameters: dict[str, Any]) -> list[str]:
    """Return parameters as on the command line."""
    return [f'{name}:={value}' for name, value in parameters.items()]


def listen_to_base(simulator: Simulator) -> dict[str, list[bytes]]:
    """Return lists that get the messages of the base."""
    return {topic: simulator.peer.listen(f'{SIMULATOR}/{topic}', kind)
            for topic, kind in OF_BASE.items()}


def test_on_a_generated_sea_it_moves_and_measures_as_the_library(begin: Start) -> None:
    simulator = begin(STEPPED, *given_as(SEA))
    of_base = listen_to_base(simulator)
    simulator.until(lambda: all(of_base.values()), 'the base is there')
    for messages in of_base.values():
        assert {stamp_of(data) for data in messages} == {FIRST}
    commands = np.array(holding()) + rng().uniform(-300.0, 300.0, (40, 6))
    for command in commands:
        simulator.step(command)
    simulator.until(lambda: all(stamp_of(of_base[topic][-1]) == FIRST + 40 * PERIOD
                                for topic in of_base), 'all have come')
    parameters = SimulatorParameters({**GIVEN, **SEA})
    plant, base = Plant(parameters), GeneratedBase(parameters)
    base_messages, messages = BaseMessages(parameters), StateMessages(parameters)
    list(base_messages.write(FIRST, 0, base.period(0, 0)))
    # The newest message of each stamp: the first is repeated until the first command.
    seen = {topic: {stamp_of(data): data for data in raw}
            for topic, raw in {**simulator.raw, **of_base}.items()}
    written: Counter[str] = Counter()
    for n, command in enumerate(commands.tolist(), start=1):
        period, stamp = base.period(n, 0), FIRST + n * PERIOD
        plant.advance(tuple(command), NO_LOAD, period.rows)
        for topic, data in (*base_messages.write(stamp, n, period),
                            *messages.write(stamp, plant.measured())):
            assert seen[topic][stamp] == data, topic
            written[topic] += 1
    # 500 periods and 250 readings in a second
    assert written == {**dict.fromkeys((*TYPES, 'base/pose', 'base/twist', 'base/accel'), 40),
                       'imu': 20}
    twist = deserialize_message(of_base['base/twist'][-1], TwistStamped)
    assert np.abs(numbers_of(twist)).max() > 1e-2


def test_in_real_time_the_base_moves_from_the_first_command_on(begin: Start) -> None:
    simulator = begin(*given_as({
        'base_motion.source': 'sine', 'base_motion.ramp': 0.2, 'base_motion.frequency': 1.0,
        'base_motion.amplitude': [0.0, 0.0, 0.2, 0.1, 0.0, 0.0], 'imu.rate': 100.0}))
    of_base = listen_to_base(simulator)
    simulator.until(lambda: all(of_base.values()) and len(of_base['imu']) > 20,
                    'the base and the IMU are there')
    for data in of_base['imu']:
        force = deserialize_message(data, Imu).linear_acceleration
        assert (force.x, force.y, force.z) == (0.0, 0.0, 9.80665)
    assert not np.any([numbers_of(deserialize_message(data, TwistStamped))
                       for data in of_base['base/twist']])
    simulator.command(holding())
    simulator.until(lambda: deserialize_message(
        of_base['base/pose'][-1], PoseStamped).pose.position.z > 0.1, 'it heaves')
    message = deserialize_message(of_base['base/pose'][-1], PoseStamped)
    assert message.header.frame_id == 'world'
    imu = deserialize_message(of_base['imu'][-1], Imu)
    assert imu.header.frame_id == 'imu'
    assert imu.orientation_covariance[0] == -1.0
    # A busy computer may hold it up.
    if not simulator.said('WARN', 'fell behind by'):
        assert set(np.diff([stamp_of(data) for data in of_base['imu']])) == {10_000_000}


class Base:
    """Publishes the motion of the base, as a whole or in part."""

    def __init__(self, simulator: Simulator) -> None:
        self._writers = {topic: simulator.peer.writer(f'{SIMULATOR}/{topic}', kind)
                         for topic, kind in OF_BASE.items() if topic != 'imu'}
        simulator.until(lambda: all(each.get_subscription_count()
                                    for each in self._writers.values()), 'it listens')
        self._simulator = simulator
        self._bad = 0

    def publish(self, stamp: int, motion: Motion, frame: str = 'world') -> None:
        """Publish a motion of the base frame in the world at a time [ns]."""
        for writer, numbers in zip(self._writers.values(), (
                [*motion.position, *motion.quaternion], motion.rows[12:18], motion.rows[18:]),
                strict=True):
            writer.publish(StampedWriter(frame, len(numbers)).write(stamp, numbers))

    def until_heard(self) -> None:
        """Wait until all has been heard, which a rejected message on each topic shows."""
        self._bad += 1
        for topic, writer in self._writers.items():
            for _ in range(2):
                writer.publish(f'bad {self._bad:03d} {topic}'.encode())
        for topic in self._writers:
            self._simulator.until_said('WARN', f'{topic} rejected: malformed')


def test_on_a_base_of_topics_it_moves_as_the_library(begin: Start) -> None:
    given = {'base_motion.source': 'topics', 'base.timeout': 0.05, 'imu.rate': 500.0}
    simulator = begin(STEPPED, *given_as(given))
    imus = simulator.peer.listen(f'{SIMULATOR}/imu', Imu)
    base = Base(simulator)
    parameters = SimulatorParameters({**GIVEN, **given})
    at = GeneratedBaseMotion(SimulatorParameters({**GIVEN, **SEA})).at
    many = 20
    for n in range(-1, many + 1):
        base.publish(FIRST + n * PERIOD, at(0.5 + n * PERIOD * 1e-9))
    base.until_heard()
    simulator.until(lambda: imus, 'the IMU is there')
    plant, messages = Plant(parameters), StateMessages(parameters)
    for n in range(1, many + 1):
        stamp = simulator.step(holding())
        ends = BaseMotion.from_motion(
            at(0.5 + (n - np.array([1.0, 0.0])) * PERIOD * 1e-9), parameters['gravity']).rows
        plant.advance(tuple(holding()), NO_LOAD, np.array([ends[0], 0.5 * (ends[0] + ends[1]),
                                                           ends[1]]))
        state = dict(messages.write(stamp, plant.measured()))
        np.testing.assert_allclose(
            numbers_of(simulator.last('accel')),
            numbers_of(deserialize_message(state['accel'], AccelStamped)), rtol=1e-9, atol=1e-9)
        simulator.until(lambda stamp=stamp: stamp_of(imus[-1]) == stamp, 'the IMU, too')
        spin = deserialize_message(imus[-1], Imu).angular_velocity
        np.testing.assert_allclose([spin.x, spin.y, spin.z], ends[1, 6:9], atol=1e-12)
    assert simulator.said('WARN', 'the base follows its topics')
    # Samples stop: 25 periods later it is at rest.
    for _ in range(27):
        simulator.step(holding())
    simulator.until_said('WARN', 'no base motion for 0.05 s: the base is at rest')
    simulator.until(lambda: stamp_of(imus[-1]) == stamp_of(simulator.raw['clock'][-1]), 'the IMU')
    assert deserialize_message(imus[-1], Imu).angular_velocity.x == 0.0


def test_bad_motions_of_the_base_are_rejected(begin: Start) -> None:
    simulator = begin(STEPPED, 'base_motion.source:=topics')
    base = Base(simulator)
    still = Motion([0.0, 0.0, 0.0], np.eye(3))
    base.publish(FIRST, still, frame='base')
    for topic in ('base/pose', 'base/twist', 'base/accel'):
        simulator.until_said('WARN', f"{topic} rejected: wrong frame_id: 'base'")
    base.publish(FIRST, Motion([0.0, 0.0, 0.0], np.eye(3), [0.0, 0.0, 0.0], [1e200, 0.0, 0.0]))
    base.until_heard()
    # A motion that overflows is not followed.
    simulator.step(holding())
    assert np.isfinite(numbers_of(simulator.last('accel'))).all()
    assert not simulator.said('ERROR', '')
