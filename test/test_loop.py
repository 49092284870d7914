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

"""The loop: trajectory, node, example controller and simulator, four processes on real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
import importlib
import os
from pathlib import Path
import re
import signal
import sys
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.serialization import deserialize_message
from running import assert_only_log_lines, executable, own_domain, Peer, PLATFORM, Program, ROOT
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from stewart_dynamics import Motion, StewartPlatform

SECONDS = 0.5
MOTION = ROOT / 'config' / 'trajectory_loop.yaml'
CONTROLLER = ROOT / 'examples' / 'leg_controller.py'


@pytest.fixture(scope='module')
def demo() -> ModuleType:
    """Return the demo as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / 'demo'))
        return importlib.import_module('loop')


@pytest.fixture(scope='module')
def run(ros_environment: None, demo: ModuleType) -> Iterator[Callable[..., Any]]:
    """Return a function that runs the loop in a domain of its own, once for each number."""
    loop = demo.Loop(PLATFORM, MOTION, SECONDS, 8.0)
    with pytest.MonkeyPatch.context() as patch, own_domain() as domain:
        patch.setenv('ROS_DOMAIN_ID', str(domain))
        rclpy.init()
        yield cache(lambda feed_forward, payload, number=0: loop.run(
            feed_forward, payload, lambda many: None))
        rclpy.try_shutdown()


@pytest.mark.parametrize('payload, times', [(1.0, 10.0), (1.3, 2.0)], ids=['right', 'heavier'])
@pytest.mark.slow
def test_feed_forward_cuts_the_tracking_error(
        run: Callable[..., Any], payload: float, times: float) -> None:
    alone, forward = run(False, payload), run(True, payload)
    assert len(alone.errors.seconds) == len(forward.errors.seconds) == 501
    for name, error in forward.errors.rms.items():
        assert 0.0 < times * error < alone.errors.rms[name], name
    # PD alone carries the weight by its error: what is missing is the node's force.
    assert 100.0 < alone.errors.rms['all legs'] < 10e3  # [um]


@pytest.mark.slow
def test_the_same_run_gives_the_same_bits(run: Callable[..., Any]) -> None:
    first, second = run(True, 1.3), run(True, 1.3, number=1)
    for one, other in zip(first.errors, second.errors, strict=True):
        assert one.tobytes() == other.tobytes()


def test_a_program_that_does_not_start_ends_the_demo_with_its_output(
        run: Callable[..., Any], demo: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(demo.PROGRAMS, 'leg_controller', [
        sys.executable, '-c', 'raise SystemExit("no legs here")'])
    with pytest.raises(demo.Failure, match='leg_controller ended with exit code 1: no legs here'):
        run(True, 1.0, number=1)


@pytest.mark.slow
def test_a_program_that_ends_early_ends_the_demo(domain: int, tmp_path: Path) -> None:
    program = Program([sys.executable, ROOT / 'demo' / 'loop.py', '--seconds', '1000.0',
                       '--output', tmp_path / 'looped'], domain, tmp_path / 'demo')
    peer = Peer(domain)
    peer.watched = program
    try:
        states = peer.listen('/stewart_dynamics/leg_states', JointState)
        peer.until(lambda: len(states) > 100, 'the loop runs')
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


def _children(pid: int) -> list[int]:
    """Return the processes that one has started."""
    return [int(child) for child in
            Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]


@pytest.mark.parametrize('option, value, said', [
    ('--params', 'nowhere.yaml', 'nowhere.yaml'),
    ('--motion', ROOT / 'config' / 'trajectory_sine.yaml', 'must begin at rest'),
    ('--seconds', '-1.0', 'motion.duration: -1.0'),
    ('--bandwidth', '0.0', 'bandwidth')])
def test_what_cannot_be_run_is_reported_in_one_line(
        demo: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str,
        value: str | Path, said: str) -> None:
    for name in ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_DOMAIN_ID'):
        monkeypatch.setenv(name, '1')  # main sets what is missing
    monkeypatch.setattr(sys, 'argv', ['loop.py', '--output', str(tmp_path), option, str(value)])
    with pytest.raises(SystemExit) as ended:
        demo.main()
    # A text as exit code is printed as a line, with exit code 1.
    line = ended.value.code
    assert isinstance(line, str)
    assert line.startswith('demo-loop: ')
    assert '\n' not in line
    assert said in line


@pytest.mark.slow
def test_in_real_time_the_legs_follow_and_are_held_when_setpoints_stop(
        domain: int, tmp_path: Path) -> None:
    simulator = ROOT / 'config' / 'simulator.yaml'
    peer = Peer(domain)
    measured, desired, commands = (peer.listen(topic, kind) for topic, kind in (
        ('/stewart_simulator/leg_states', JointState),
        ('/stewart_dynamics/leg_states', JointState),
        ('/stewart_simulator/commands', Float64MultiArray)))
    programs = [Program([*command, '--ros-args', *arguments], domain, tmp_path / str(n))
                for n, (command, arguments) in enumerate((
                    ([executable('stewart_simulator')],
                     ['--params-file', PLATFORM, '--params-file', simulator]),
                    ([executable('stewart_dynamics')], ['--params-file', PLATFORM]),
                    # A loaded computer may be late.
                    ([sys.executable, CONTROLLER],
                     ['-p', 'timeout:=1.0', '-p', f'params_file:={PLATFORM}']),
                    ([executable('stewart_trajectory')],
                     ['--params-file', MOTION, '-p', 'start_timeout:=1000.0'])))]
    try:
        peer.until(lambda: min(map(len, (measured, desired, commands))) > 300, 'the loop runs')
        first, last = (np.array(deserialize_message(data, JointState).position)
                       for data in (measured[0], measured[-1]))
        wanted = [np.array(deserialize_message(data, JointState).position) for data in desired]
        # It has gone a way, and is near where it was to be at some time.
        assert np.abs(last - first).max() > 5e-3
        assert min(np.abs(last - each).max() for each in wanted) < 5e-3
        assert programs[-1].stop() == 0, programs[-1].stderr
        peer.until(lambda: 'the last position is held' in programs[2].stderr, 'it holds')
        held = np.array(deserialize_message(desired[-1], JointState).position)

        def errors() -> Any:
            state = deserialize_message(measured[-1], JointState)
            return np.abs([state.position - held, state.velocity]).max(axis=1)

        # Friction may stop it at a distance of friction / gain.
        peer.until(lambda: (errors() < [5e-4, 1e-3]).all(), 'it comes to rest there')
        many = len(commands)
        peer.until(lambda: len(commands) > many + 500, 'commands go on')
        assert (errors() < [5e-4, 1e-3]).all()
        # The forces at rest, to what friction keeps of the position's error.
        platform = StewartPlatform.from_yaml(PLATFORM)
        pose = platform.forward_kinematics(held + 0.95, platform.home_pose())
        forces = deserialize_message(commands[-1], Float64MultiArray).data
        assert forces == pytest.approx(
            platform.inverse_dynamics(Motion.from_pose(pose)).forces, abs=200.0)
        for data in commands:
            assert np.isfinite(deserialize_message(data, Float64MultiArray).data).all()
        for program in reversed(programs[:-1]):
            assert program.stop() == 0, program.stderr
            assert_only_log_lines(program.stderr)
    finally:
        for program in programs:
            program.kill()
        peer.close()
