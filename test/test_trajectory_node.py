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

"""The publisher of motions: in a process of its own, over real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, ExitStack
from functools import partial
from pathlib import Path
import signal
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from running import (
    assert_only_log_lines, executable, INPUTS, Inside, log_lines, nanoseconds, Peer, Program,
    SEPARATE)

from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.reference_motion.motion import motion_at, sample_times
from stewart_dynamics.reference_motion.node import TrajectoryNode
from stewart_dynamics.reference_motion.parameters import ReferenceMotionParameters

MOTION = """\
stewart_trajectory:
  ros__parameters:
    rate: 200.0
    {more}
    motion:
      type: {kind}
      duration: 1.5  # [s]
      initial: [0.0, 0.0, 1.1, 0.0, 0.0, 0.0]
      final: [0.2, -0.15, 1.15, 0.2, -0.15, 0.8]
      amplitude: [0.1, 0.1, 0.08, 0.12, 0.12, 0.25]
      fourier:
        frequency: 0.8
        sine: [0.1, 0.1, 0.08, 0.12, 0.12, 0.25, 0.0, 0.02, 0.02, 0.05, 0.0, 0.1]
        fade: 0.7
"""


class Trajectory:
    """The publisher, in this process or in its own, and a peer that keeps its messages."""

    def __init__(self, domain: int, folder: Path, file: Path, *overrides: str,
                 inside: bool = False) -> None:
        self.peer = Peer(domain)
        self._raw = {topic: self.peer.listen(f'/stewart_dynamics/{topic}', kind)
                     for topic, kind in INPUTS.items()}
        self._clock = self.peer.writer('/clock', Clock)
        arguments = ['--ros-args', '--params-file', file,
                     *(part for override in overrides for part in ('-p', override))]
        done = Future()
        self.program: Any = Inside(
            partial(TrajectoryNode, done), arguments, domain, done) if inside else (
                Program([executable('stewart_trajectory'), *arguments], domain, folder))

    def received(self, topic: str) -> list[Any]:
        """Return the messages on a topic so far."""
        return [deserialize_message(data, INPUTS[topic]) for data in self._raw[topic]]

    def until(self, numbers: dict[str, int]) -> None:
        """Wait until these numbers of messages have come on these topics."""
        self.peer.until(lambda: all(len(self._raw[topic]) >= number
                                    for topic, number in numbers.items()), f'{numbers} come')

    def at(self, now: int, number: int, topics: Sequence[str] = SEPARATE) -> None:
        """Set the clock [ns] and wait until a number of messages has come on each topic."""
        def answered() -> bool:
            # Time is best effort: a message of it may be lost, all others come.
            self._clock.publish(Clock(clock=Time(nanoseconds=now).to_msg()))
            return all(len(self._raw[topic]) >= number for topic in topics)

        self.peer.until(answered, f'{number} messages have come by {now} ns')

    def close(self) -> None:
        """Leave ROS, and end the program if it still runs."""
        self.program.kill()
        self.peer.close()


Start = Callable[..., Trajectory]

SECOND = 1_000_000_000
PERIOD = 5_000_000  # at 200 Hz
ENDS = 'motion.hold_at_end:=false'


@pytest.fixture
def start(domain: int, tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts it in a process of its own, with a parameter file's text."""
    with started(partial(Trajectory, domain), tmp_path) as begin:
        yield begin


@pytest.fixture
def begin(domain: int, tmp_path: Path) -> Iterator[Start]:
    """Return a function that makes it in this process, with a parameter file's text."""
    make = partial(Trajectory, domain, inside=True)
    with started(make, tmp_path) as begin:
        yield begin


@contextmanager
def started(make: Callable[..., Trajectory], folder: Path) -> Iterator[Start]:
    """Give a function that makes a publisher, which ends with this."""
    with ExitStack() as stack:
        def begin(text: str, *overrides: str) -> Trajectory:
            file = folder / 'trajectory.yaml'
            file.write_text(text, encoding='utf-8')
            return stack.enter_context(closing(make(folder / 'run', file, *overrides)))

        yield begin


def _separate(trajectory: Trajectory) -> tuple[list[int], NDArray[np.float64]]:
    """Return stamps (N,) and rows of pose, twist and acceleration (N, 19) of three topics."""
    rows, stamps = [], []
    for pose, twist, accel in zip(*map(trajectory.received, SEPARATE), strict=True):
        assert pose.header == twist.header == accel.header
        assert pose.header.frame_id == 'base'
        stamps.append(nanoseconds(pose.header.stamp))
        rows.append(_row(pose.pose.position, pose.pose.orientation, twist.twist, accel.accel))
    return stamps, np.array(rows)


def _combined(trajectory: Trajectory) -> tuple[list[int], NDArray[np.float64]]:
    """Return stamps (N,) and rows of pose, twist and acceleration (N, 19) of the one topic."""
    rows, stamps = [], []
    for message in trajectory.received('setpoint/combined'):
        assert message.header.frame_id == 'base'
        stamps.append(nanoseconds(message.header.stamp))
        point, = message.points
        (transform,), (twist,), (accel,) = (
            point.transforms, point.velocities, point.accelerations)
        rows.append(_row(transform.translation, transform.rotation, twist, accel))
    return stamps, np.array(rows)


def _row(position: Any, quaternion: Any, twist: Any, accel: Any) -> list[float]:
    vectors = (twist.linear, twist.angular, accel.linear, accel.angular)
    return [position.x, position.y, position.z, quaternion.x, quaternion.y, quaternion.z,
            quaternion.w, *(number for v in vectors for number in (v.x, v.y, v.z))]


def _expected(parameters: ReferenceMotionParameters, times: Any) -> NDArray[np.float64]:
    motion = motion_at(parameters, np.asarray(times) * 1e-9)
    return np.concatenate([
        motion.position, to_quaternion(motion.rotation), motion.linear_velocity,
        motion.angular_velocity, motion.linear_acceleration, motion.angular_acceleration], axis=1)


@pytest.mark.parametrize('output, kind', [('separate', 'quintic'), ('combined', 'fourier')])
def test_the_motion_is_published_and_then_it_ends(
        begin: Start, tmp_path: Path, output: str, kind: str) -> None:
    trajectory = begin(MOTION.format(kind=kind, more=f'output: {output}'), ENDS)
    parameters = ReferenceMotionParameters.from_yaml(tmp_path / 'trajectory.yaml')
    times = sample_times(parameters)
    assert len(times) == 301
    topics = ('setpoint/combined',) if output == 'combined' else SEPARATE
    trajectory.until(dict.fromkeys(topics, len(times)))
    assert trajectory.program.wait() == 0
    assert {topic for topic in INPUTS if trajectory.received(topic)} == set(topics)
    stamps, rows = _combined(trajectory) if output == 'combined' else _separate(trajectory)
    assert [stamp - stamps[0] for stamp in stamps] == times.tolist()
    np.testing.assert_allclose(rows, _expected(parameters, times), rtol=0.0, atol=1e-15)
    lines = log_lines(trajectory.program.stderr)
    assert len(lines) == 2
    assert f'{kind} motion at 200 Hz to stewart_dynamics, 301 setpoints' in lines[0]
    assert '301 setpoints published' in lines[1]
    assert_only_log_lines(trajectory.program.stderr)


def test_the_final_pose_is_held_until_a_signal(begin: Start, tmp_path: Path) -> None:
    trajectory = begin(MOTION.format(kind='sine', more='output: combined'), 'use_sim_time:=true')
    parameters = ReferenceMotionParameters.from_yaml(tmp_path / 'trajectory.yaml')
    topics = ('setpoint/combined',)
    trajectory.at(SECOND, 1, topics)
    trajectory.at(SECOND + 300 * PERIOD, 301, topics)
    trajectory.at(SECOND + 301 * PERIOD, 302, topics)
    # While it holds, only the last one of several that are due is published.
    trajectory.at(1000 * SECOND, 303, topics)
    trajectory.program.kill()
    stamps, rows = _combined(trajectory)
    assert stamps[-3:] == [SECOND + 300 * PERIOD, SECOND + 301 * PERIOD, 1000 * SECOND]
    final = _expected(parameters, np.array([300 * PERIOD]))[0]
    np.testing.assert_allclose(rows[300], final, rtol=0.0, atol=1e-15)
    for row in rows[301:]:
        np.testing.assert_allclose(row[:7], final[:7], rtol=0.0, atol=1e-15)
        assert not row[7:].any()
    assert '301 setpoints published; holds the final pose until stopped' in (
        trajectory.program.stderr)


def test_a_looped_motion_goes_back_and_forth_until_a_signal(start: Start, tmp_path: Path) -> None:
    trajectory = start(MOTION.format(kind='quintic', more='loop: true'))
    trajectory.until(dict.fromkeys(SEPARATE, 650))  # twice 1.5 s at 200 Hz, and some
    assert trajectory.program.stop(signal.SIGTERM) == 0
    assert_only_log_lines(trajectory.program.stderr)
    assert trajectory.program.stdout == ''
    assert 'until stopped' in trajectory.program.stderr
    parameters = ReferenceMotionParameters.from_yaml(tmp_path / 'trajectory.yaml')
    # Messages in transit when it ended may lack a topic.
    whole = min(len(trajectory.received(topic)) for topic in SEPARATE)
    for topic in SEPARATE:
        del trajectory._raw[topic][whole:]
    stamps, rows = _separate(trajectory)
    times = np.arange(whole) * 5_000_000
    assert [stamp - stamps[0] for stamp in stamps] == times.tolist()
    np.testing.assert_allclose(rows, _expected(parameters, times), rtol=0.0, atol=1e-15)
    assert rows[600, 0] == pytest.approx(0.0, abs=1e-15)
    assert rows[300, 0] == pytest.approx(0.2, abs=1e-15)


def test_the_motion_begins_without_subscribers_after_start_timeout(begin: Start) -> None:
    # They are on another node's topics: these have no subscribers.
    trajectory = begin(MOTION.format(kind='hold', more='start_timeout: 0.1'),
                       'target:=nobody', 'motion.duration:=0.1', ENDS)
    assert trajectory.program.wait() == 0
    assert 'hold motion at 200 Hz to nobody, 21 setpoints' in trajectory.program.stderr
    assert '21 setpoints published' in trajectory.program.stderr


def test_a_signal_ends_it_while_it_waits_for_subscribers(start: Start) -> None:
    trajectory = start(MOTION.format(kind='paper', more='start_timeout: 1000.0'),
                       'target:=nobody')
    trajectory.peer.until(lambda: log_lines(trajectory.program.stderr), 'it has started')
    assert trajectory.program.stop() == 0
    assert_only_log_lines(trajectory.program.stderr)


def test_in_simulated_time_what_is_due_comes_with_the_clock(begin: Start, tmp_path: Path) -> None:
    trajectory = begin(MOTION.format(kind='sine', more='output: combined'), 'use_sim_time:=true',
                       'motion.duration:=0.1', ENDS)
    topics = ('setpoint/combined',)
    # It begins where the clock stands, by itself, and waits for it at each sample.
    trajectory.at(SECOND, 1, topics)
    trajectory.at(SECOND + PERIOD - 1, 1, topics)
    for n in range(1, 11):
        trajectory.at(SECOND + n * PERIOD, n + 1, topics)
        assert len(trajectory.received(*topics)) == n + 1
    # The samples that have become due meanwhile come at once, and then it is done.
    trajectory.at(2 * SECOND, 21, topics)
    assert trajectory.program.wait() == 0
    stamps, rows = _combined(trajectory)
    parameters = ReferenceMotionParameters.from_yaml(tmp_path / 'trajectory.yaml')
    times = sample_times(parameters)[:21]
    assert stamps == (SECOND + times).tolist()
    np.testing.assert_allclose(rows, _expected(parameters, times), rtol=0.0, atol=1e-15)
    assert_only_log_lines(trajectory.program.stderr)


def test_the_motion_restarts_with_the_clock(begin: Start, tmp_path: Path) -> None:
    trajectory = begin(MOTION.format(kind='sine', more='loop: true'), 'use_sim_time:=true')
    trajectory.at(7 * SECOND, 1)
    trajectory.at(7 * SECOND + 3 * PERIOD, 4)
    # No sample comes twice where the clock goes back less than to the start.
    trajectory.at(7 * SECOND + 2 * PERIOD, 4)
    trajectory.at(7 * SECOND + 4 * PERIOD, 5)
    trajectory.at(SECOND, 6)
    trajectory.at(SECOND + PERIOD, 7)
    # When a simulation restarts, so does the motion.
    trajectory.at(SECOND, 8)
    trajectory.at(SECOND + PERIOD, 9)
    trajectory.program.kill()
    stamps, rows = _separate(trajectory)
    times = np.array([0, 1, 2, 3, 4, 0, 1, 0, 1]) * PERIOD
    assert stamps == (np.repeat([7, 1], [5, 4]) * SECOND + times).tolist()
    parameters = ReferenceMotionParameters.from_yaml(tmp_path / 'trajectory.yaml')
    np.testing.assert_allclose(rows, _expected(parameters, times), rtol=0.0, atol=1e-15)
    warnings = log_lines(trajectory.program.stderr, 'WARN')
    assert len(warnings) == 2
    assert all('it restarts' in warning for warning in warnings)


def test_the_motion_waits_for_the_clock(begin: Start) -> None:
    trajectory = begin(MOTION.format(kind='hold', more='start_timeout: 0.1'),
                       'use_sim_time:=true')
    trajectory.peer.until(lambda: 'waiting for /clock' in trajectory.program.stderr, 'it waits')
    assert not trajectory.received('setpoint/pose')
    trajectory.at(SECOND, 1)
    trajectory.program.kill()
    assert len(log_lines(trajectory.program.stderr, 'WARN')) == 1
