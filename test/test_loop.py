# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The loop: trajectory, node, example controller and simulator, four processes on real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
import os
from pathlib import Path
import pty
import re
import signal
import subprocess
import sys
import time
from types import ModuleType
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import pytest
import rclpy
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from running import (
    assert_only_log_lines, executable, nanoseconds, own_domain, Peer, PLATFORM, Program, ROOT)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.arrays import NO_WRENCH
from stewart_dynamics.legs import CRANK
from stewart_dynamics.mechanics.limits import Limits, result_values
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.yaml_file import read_yaml
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.simulator.plant import Plant
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

DEMO = 'loop'

SECONDS = 0.5
MOTION = ROOT / 'config' / 'trajectory_loop.yaml'
CRANKS = ROOT / 'config' / 'crank_platform.yaml'
CONTROLLER = ROOT / 'examples' / 'leg_controller.py'


@pytest.fixture(scope='module')
def run(ros_environment: None, demo: ModuleType) -> Iterator[Callable[..., Any]]:
    """Return a function that runs the loop in a domain of its own, once for each number."""
    loops = {kind: demo.Loop(*(ROOT / 'config' / file for file in files), SECONDS, 8.0)
             for kind, files in demo.FILES.items()}
    with pytest.MonkeyPatch.context() as patch, own_domain() as domain:
        patch.setenv('ROS_DOMAIN_ID', str(domain))
        rclpy.init()
        yield cache(lambda feed_forward, payload, number=0, kind='telescopic': loops[kind].run(
            feed_forward, payload, lambda many: None))
        rclpy.try_shutdown()


@pytest.mark.parametrize('payload, times', [(1.0, 10.0), (1.3, 2.0)], ids=['right', 'heavier'])
@pytest.mark.slow
def test_feed_forward_cuts_the_tracking_error(
        run: Callable[..., Any], payload: float, times: float) -> None:
    alone, forward = run(False, 1.0), run(True, payload)
    assert len(alone.errors.seconds) == len(forward.errors.seconds) == 501
    for name, error in forward.errors.rms.items():
        assert 0.0 < times * error < alone.errors.rms[name], name
    # PD alone carries the weight by its error: it lacks the node's force, with more payload more.
    assert 100.0 < alone.errors.rms['all legs'] < 10e3  # [um]


@pytest.mark.slow
def test_torques_of_the_node_cut_the_tracking_error_of_cranks(
        demo: ModuleType, run: Callable[..., Any]) -> None:
    """By more than a factor of 100; with 30 % more payload than the node knows, of 3."""
    alone, forward, heavier = (run(feed, payload, kind='crank') for feed, payload in (
        (False, 1.0), (True, 1.0), (True, 1.3)))
    assert len(forward.errors.seconds) == 501
    for name, error in forward.errors.rms.items():
        assert 0.0 < 100.0 * error < alone.errors.rms[name], name
        assert 3.0 * heavier.errors.rms[name] < alone.errors.rms[name], name
    assert 1e3 < alone.errors.rms['all legs'] < 10e3  # [urad]
    table = demo.table([alone, forward], ['as in the parameters'], CRANK)
    assert 'PD + torques' in table
    assert re.search('leg 1 +urad', table)


def test_the_motion_of_the_demo_keeps_the_limits_of_the_rig(demo: ModuleType) -> None:
    """With the heavier payload, too: angles, speeds, torques, rod forces, levers."""
    hexapod, motion = (ROOT / 'config' / name for name in demo.FILES['crank'])
    settings = ReferenceMotionParameters.from_yaml(motion)
    given = Parameters.from_yaml(hexapod)
    platform = StewartPlatform(given.replaced({
        'platform.mass': demo.HEAVIER * given.platform.mass,
        'platform.inertia': demo.HEAVIER * given.platform.inertia}))
    times = np.arange(0.0, 10.0, 2e-3)
    result = platform.inverse_dynamics(motion_at(settings, times))
    limits = Limits(platform.parameters)
    values = {**result_values(given, result.rows), 'limits.lever_min': np.abs(
        result.levers) / given['legs.crank.length']}
    assert set(values) >= {'limits.angle_min', 'limits.angle_max', 'limits.speed_max',
                           'limits.torque_max', 'limits.rod_force_max'}
    for name, each in values.items():
        assert not limits.exceeds(name, each).any(), name
    assert np.abs(result.speeds).max() > 0.45 * given.limits.speed_max.max()  # not for nothing
    home = platform.home_pose()
    ends = motion_at(settings, np.array([0.0, 10.0]))
    assert np.allclose(ends.position, home.position, rtol=0.0, atol=1e-6)
    assert np.abs(ends.linear_velocity).max() < 1e-9


def test_the_table_has_a_space_between_large_numbers(demo: ModuleType) -> None:
    seconds, legs, one = np.zeros(2), np.ones((2, 6)), np.ones(2)
    large, small = (demo.Errors(seconds, size * legs, size * one, size * one)
                    for size in (12345.6, 0.4))
    pair = [demo.Run(False, 1.0, large), demo.Run(True, 1.0, small)]
    line, = [each for each in demo.table(2 * pair, ['a', 'b']).splitlines()
             if each.startswith('all legs')]
    assert line.split()[3:] == 2 * ['12345.6', '(12346)', '0.4', '(0.4)', '30864x']


def test_the_demo_ends_with_how_far_the_platform_departs(demo: ModuleType) -> None:
    seconds, legs, one = np.zeros(2), np.zeros((2, 6)), np.array([0.5, 1.0])
    runs = [demo.Run(feed, payload, demo.Errors(seconds, legs, size * one, one))
            for payload, feed, size in ((1.0, False, 2433.1), (1.0, True, 2.217),
                                        (1.3, False, 3000.3), (1.3, True, 560.3))]
    assert demo.conclusion(runs, CRANK) == (
        'With the torques of the node the platform stays within 0.0022 mm of its motion, without '
        'them within 2.4 mm;\nwith 30 % more payload than the node knows, within 0.56 mm and '
        '3 mm.')


OPENED = """\
import sys
sys.path.append('demo')
import closed_loop
closed_loop.open_browser('http://127.0.0.1:1/')
print('done')
"""


@pytest.mark.parametrize('screen, terminal', [
    (True, True), (True, False), (False, True)], ids=['both', 'no terminal', 'no screen'])
def test_a_page_is_opened_for_who_has_a_screen_and_a_terminal(
        screen: bool, terminal: bool, tmp_path: Path) -> None:
    """The browser gives its address away when the demo has ended: that does not wait for it."""
    browser, pipe = tmp_path / 'browser', tmp_path / 'pipe'
    browser.write_text(f'#!/bin/sh\nprintf %s "$1" > {pipe}\n')
    browser.chmod(0o755)
    os.mkfifo(pipe)
    environment = {name: value for name, value in os.environ.items() if 'DISPLAY' not in name}
    environment |= {'BROWSER': f'{browser} %s'} | ({'DISPLAY': ':0'} if screen else {})
    controller, output = pty.openpty()
    subprocess.run([sys.executable, '-c', OPENED], cwd=ROOT, check=True, timeout=300,
                   env=environment, stdin=subprocess.DEVNULL,
                   stdout=output if terminal else subprocess.DEVNULL)
    if screen and terminal:
        assert pipe.read_text() == 'http://127.0.0.1:1/'
    else:
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        assert os.read(reader, 1) == b''
        os.close(reader)
    os.close(controller)
    os.close(output)


def test_the_same_run_gives_the_same_bits(run: Callable[..., Any]) -> None:
    first, second = run(True, 1.3), run(True, 1.3, number=1)
    for one, other in zip(first.errors, second.errors, strict=True):
        assert one.tobytes() == other.tobytes()


@pytest.mark.slow
def test_a_program_that_ends_early_ends_the_demo(domain: int, tmp_path: Path) -> None:
    program = Program([sys.executable, ROOT / 'demo' / 'loop.py', '--seconds', '100.0',
                       '--output', tmp_path / 'looped'], domain, tmp_path / 'demo')
    peer = Peer(domain)
    peer.watched = program
    try:
        # Not the states of stewart_dynamics: the demo counts their readers to find the controller.
        states = peer.listen('/stewart_simulator/leg_states', JointState)
        peer.until(lambda: states and nanoseconds(deserialize_message(
            states[-1], JointState).header.stamp) > 1_100_000_000, 'the loop runs')
        address, = re.findall(r'^the hexapod in motion: (\S+) ', program.stdout, re.MULTILINE)
        with urlopen(address) as page:
            assert b'<title>Hexapod live</title>' in page.read()
        simulator, = (pid for pid in _children(program.process.pid)
                      if b'stewart_simulator' in Path(f'/proc/{pid}/cmdline').read_bytes())
        os.kill(simulator, signal.SIGKILL)
        assert program.wait() == 1
    finally:
        peer.close()
        if not program.ended:
            program.stop()
    said = program.stderr.splitlines()[-1]
    assert re.match('demo-loop: stewart_simulator ended with exit code -9: .*dynamics ready', said)
    assert not list((tmp_path / 'looped').iterdir())
    with pytest.raises(URLError):  # the view has ended with the demo
        urlopen(address)


def _children(pid: int) -> list[int]:
    """Return the processes that one has started."""
    return [int(child) for child in
            Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]


@pytest.mark.parametrize('option, value', [
    ('--params', 'nowhere.yaml'),
    ('--motion', ROOT / 'config' / 'trajectory_sine.yaml'),
    ('--seconds', '-1.0'),
    ('--bandwidth', '0.0')])
def test_a_run_with_bad_options_is_rejected_in_one_line(
        rejects: Callable[..., None], option: str, value: str | Path) -> None:
    rejects(option, value)


def controlled(peer: Peer, folder: Path, timeout: float, platform: Path = PLATFORM,
               ) -> tuple[Program, list[bytes], Publisher, Publisher]:
    """Start the controller; return its commands, and publishers of measured and desired legs."""
    peer.watched = Program(
        [sys.executable, CONTROLLER, '--ros-args', '-p', f'timeout:={timeout}', '-p',
         f'params_file:={platform}', *(() if platform != PLATFORM else (
             '-p', 'proportional_gain:=4e5', '-p', 'derivative_gain:=1.6e4'))],
        peer.domain, folder)
    return (peer.watched, peer.listen('/stewart_simulator/commands', Float64MultiArray),
            peer.writer('/stewart_simulator/leg_states', JointState),
            peer.writer('/stewart_dynamics/leg_states', JointState))


@pytest.mark.slow
def test_in_real_time_the_legs_follow_and_are_held_when_setpoints_stop(
        peer: Peer, tmp_path: Path) -> None:
    """The plant waits for each command, so that the result is that of a fast computer."""
    plant = Plant(SimulatorParameters({
        **read_yaml(PLATFORM, 'stewart_simulator'),
        **read_yaml(ROOT / 'config' / 'simulator.yaml', 'stewart_simulator')}))
    joints, zero = plant.parameters['joints'], plant.parameters['geometry.zero_length']
    start = np.array(plant.state.positions) - zero
    moving = JointState(name=joints, position=start + 5e-3, velocity=[0.01] * 6,
                        effort=np.arange(6.0))
    # The forces at rest carry the weight.
    platform = StewartPlatform.from_yaml(PLATFORM)
    pose = platform.forward_kinematics(start + 5e-3 + zero, platform.home_pose())
    weight = platform.inverse_dynamics(Motion.from_pose(pose)).forces
    held = JointState(name=joints, position=moving.position, velocity=[0.0] * 6, effort=weight)
    program, commands, measured, desired = controlled(peer, tmp_path, 1.0)

    def commanded(target: JointState) -> Any:
        """Return the command to the present state once it is the one for a desired state."""
        state = plant.state
        expected = (4e5 * (np.subtract(target.position, state.positions) + zero)
                    + 1.6e4 * np.subtract(target.velocity, state.rates) + target.effort)

        def came() -> bool:
            if target is moving:
                desired.publish(moving)
            measured.publish(JointState(name=joints, position=np.subtract(state.positions, zero),
                                        velocity=state.rates))
            count = len(commands)
            peer.spin()
            return len(commands) > count and np.allclose(
                deserialize_message(commands[-1], Float64MultiArray).data, expected,
                rtol=1e-12, atol=1e-6)

        peer.until(came, 'the command comes')
        return tuple(expected.tolist())

    try:
        for _ in range(3):
            plant.advance(commanded(moving), NO_WRENCH)
        for _ in range(120):  # 0.24 s
            command = commanded(held)
            plant.advance(command, NO_WRENCH)
        assert 'the last position is held' in program.stderr
        # Friction may stop it at a distance of friction / gain.
        assert np.abs(plant.state.positions - zero - moving.position).max() < 5e-4
        assert np.abs(plant.state.rates).max() < 1e-3
        assert command == pytest.approx(weight, abs=200.0)
        commanded(moving)
        assert 'desired states are back' in program.stderr
        assert program.stop() == 0, program.stderr
        assert_only_log_lines(program.stderr)
    finally:
        program.kill()


@pytest.mark.slow
def test_after_a_gap_the_controller_returns_slowly_and_within_the_limits_of_force(
        peer: Peer, tmp_path: Path) -> None:
    """The desired lengths have gone on by 150 mm: stiffness times distance is 60 kN."""
    limit = StewartPlatform.from_yaml(PLATFORM).parameters.limits.force_max[0]
    names = StewartPlatform.from_yaml(PLATFORM).parameters.joints
    program, commands, measured, desired = controlled(peer, tmp_path, 0.5)

    def state(position: float) -> JointState:
        return JointState(name=names, position=[position] * 6, velocity=[0.0] * 6,
                          effort=[300.0] * 6)

    def last() -> Any:
        return np.array(deserialize_message(commands[-1], Float64MultiArray).data)

    def until_commanded(target: float, force: float, tolerance: float) -> None:
        def came() -> bool:
            desired.publish(state(target))
            measured.publish(state(0.3))
            peer.spin(0.02)
            return bool(commands) and bool(np.all(np.abs(last() - force) <= tolerance))

        peer.until(came, f'{force:g} N at {target:g} m')

    try:
        until_commanded(0.3, 300.0, 1e-6)
        for stalled in (desired, measured):  # the node, and then the controller or the drives
            begun, running = time.monotonic(), measured if stalled is desired else desired
            while time.monotonic() - begun < 1.0:
                running.publish(state(0.3))
                peer.spin(0.02)
            commands.clear()
            # From the measured lengths, not from where the desired ones are by now ...
            until_commanded(0.45, 300.0, 200.0)
            # ... to them, with at most the largest force.
            until_commanded(0.45, limit, 1e-6)
            assert max(np.abs(deserialize_message(each, Float64MultiArray).data).max()
                       for each in commands) <= limit
            until_commanded(0.3, 300.0, 1e-6)
    finally:
        program.kill()


def test_the_controller_holds_cranks_by_their_torques_at_rest(peer: Peer, tmp_path: Path) -> None:
    """Desired states have stopped; commands are at most limits.torque_max."""
    platform = StewartPlatform.from_yaml(CRANKS)
    position = platform.inverse_kinematics(platform.home_pose()) + 0.1
    pose = platform.forward_kinematics(position, platform.home_pose())
    torques = platform.inverse_dynamics(Motion.from_pose(pose)).torques
    program, commands, measured, desired = controlled(peer, tmp_path, 0.5, CRANKS)

    def until_commanded(offset: float, expected: Any, follow: bool) -> None:
        def came() -> bool:
            if follow:
                desired.publish(JointState(
                    name=platform.parameters.joints, position=position, velocity=[0.0] * 6,
                    effort=[7.0] * 6))
            measured.publish(JointState(
                name=platform.parameters.joints, position=position - offset, velocity=[0.0] * 6))
            peer.spin(0.02)
            return bool(commands) and np.allclose(
                deserialize_message(commands[-1], Float64MultiArray).data, expected, rtol=1e-9)

        peer.until(came, f'{expected} N m')

    try:
        until_commanded(0.0, 7.0, follow=True)
        until_commanded(0.0, torques, follow=False)
        assert 'the last position is held' in program.stderr
        until_commanded(0.5, 250.0, follow=False)
        assert program.stop() == 0, program.stderr
    finally:
        program.kill()


COMMANDS: dict[str, list[str | Path]] = {
    'simulator': [executable('stewart_simulator'), '--ros-args', '--params-file', PLATFORM,
                  '--params-file', ROOT / 'config' / 'simulator.yaml'],
    'node': [executable('stewart_dynamics'), '--ros-args', '--params-file', PLATFORM,
             '-r', '~/measured_legs:=/stewart_simulator/leg_states'],
    'controller': [sys.executable, CONTROLLER, '--ros-args', '-p', f'params_file:={PLATFORM}'],
    'trajectory': [executable('stewart_trajectory'), '--ros-args', '--params-file', MOTION,
                   '-p', 'rate:=500.0']}


class SimulatedLoop:
    """The loop of docs/simulator.md with ``use_sim_time``, and the clock as others see it."""

    def __init__(self, domain: int, folder: Path) -> None:
        self._domain, self._folder = domain, folder
        self.programs: dict[str, Program] = {}
        self.peer = Peer(domain)
        self._clocks = self.peer.listen('/clock', Clock)

    def start(self, name: str) -> None:
        """Start a program, for the first time or again."""
        self.programs[name] = Program(
            [*COMMANDS[name], '-p', 'use_sim_time:=true'], self._domain,
            self._folder / f'{name}_{len(list(self._folder.glob(name + "_*")))}')

    def until_it_runs(self) -> None:
        """Wait until the clock has advanced by 50 ms more."""
        self._clocks.clear()

        def runs() -> bool:
            times = [nanoseconds(deserialize_message(data, Clock).clock)
                     for data in (*self._clocks[:1], *self._clocks[-1:])]
            return bool(times) and times[-1] - times[0] >= 50_000_000

        self.peer.until(runs, 'the loop runs')

    def until_said(self, name: str, words: str) -> None:
        """Wait until a program has said something."""
        self.peer.until(lambda: words in self.programs[name].stderr, f'{name}: {words}')

    def close(self) -> None:
        """End all."""
        for program in self.programs.values():
            program.kill()
        self.peer.close()


@pytest.fixture
def simulated(domain: int, tmp_path: Path) -> Iterator[SimulatedLoop]:
    """Return a loop without programs."""
    loop = SimulatedLoop(domain, tmp_path)
    yield loop
    loop.close()


@pytest.mark.slow
@pytest.mark.parametrize('order', [
    ('trajectory', 'simulator', 'controller', 'node'),
    ('node', 'trajectory', 'simulator', 'controller'),
    ('controller', 'node', 'trajectory', 'simulator')], ids=lambda order: order[-1])
def test_with_simulated_time_the_loop_begins_once_its_last_program_is_there(
        simulated: SimulatedLoop, order: tuple[str, ...]) -> None:
    """Each of them waits, and those that are first to stop the clock say so."""
    for name in order[:-1]:
        simulated.start(name)
    for name, words in (
            ('simulator', 'time stands still at 0.000 s since the start: no command for 2 s'),
            ('trajectory', 'waiting for ' + (
                '/clock' if order[-1] == 'simulator' else 'a subscriber of')),
            ('controller', 'waiting for 2 s and more: no ' + (
                'measured state' if order[-1] == 'simulator' else 'desired state'))):
        if name != order[-1] and not (name == 'trajectory' and order[-1] == 'controller'):
            simulated.until_said(name, words)
    simulated.start(order[-1])
    simulated.until_it_runs()


@pytest.mark.slow
def test_with_simulated_time_the_loop_goes_on_after_any_of_its_programs_is_started_again(
        simulated: SimulatedLoop) -> None:
    for name in COMMANDS:
        simulated.start(name)
    simulated.until_it_runs()
    for name in ('controller', 'node', 'trajectory', 'simulator'):
        simulated.programs[name].kill()
        if name != 'simulator':
            simulated.until_said('simulator', 'time stands still')
            simulated.programs['simulator'].forget()
        simulated.start(name)
        simulated.until_it_runs()
