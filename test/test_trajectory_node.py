# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The publisher of motions: in a process of its own, over real topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, ExitStack
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
from stewart_dynamics.reference_motion.motion_functions import motion_at, sample_times
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.reference_motion.trajectory_node import TrajectoryNode

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


COMBINED = 'output: combined'
TOPIC = ('setpoint/combined',)
SECOND = 1_000_000_000
PERIOD = 5_000_000  # at 200 Hz
ENDS = 'motion.hold_at_end:=false'


class Trajectory:
    """The publisher, in this process or in its own, and a peer that keeps its messages."""

    def __init__(self, domain: int, folder: Path, inside: bool, text: str, *overrides: str,
                 ) -> None:
        file = folder / 'trajectory.yaml'
        file.write_text(text, encoding='utf-8')
        self.parameters = ReferenceMotionParameters.from_yaml(file)
        self.topics = TOPIC if COMBINED in text else SEPARATE
        self.peer = Peer(domain)
        self.raw = {topic: self.peer.listen(f'/stewart_dynamics/{topic}', kind)
                    for topic, kind in INPUTS.items()}
        self._clock = self.peer.writer('/clock', Clock)
        arguments = ['--ros-args', '--params-file', file,
                     *(part for override in overrides for part in ('-p', override))]
        done = Future()
        self.program: Any = Inside(
            partial(TrajectoryNode, done), arguments, domain, done) if inside else (
                Program([executable('stewart_trajectory'), *arguments], domain, folder / 'run'))

    def until(self, number: int) -> None:
        """Wait until a number of messages has come on each topic."""
        self.peer.until(lambda: all(len(self.raw[topic]) >= number for topic in self.topics),
                        f'{number} come')

    def at(self, now: int, number: int) -> None:
        """Set the clock [ns] and wait until a number of messages has come on each topic."""
        def answered() -> bool:
            # Time is best effort: a message of it may be lost, all others come.
            self._clock.publish(Clock(clock=Time(nanoseconds=now).to_msg()))
            return all(len(self.raw[topic]) >= number for topic in self.topics)

        self.peer.until(answered, f'{number} messages have come by {now} ns')

    def rows(self) -> tuple[list[int], NDArray[np.float64]]:
        """Return stamps (N,) [ns] and rows of pose, twist and acceleration (N, 19)."""
        rows, stamps = [], []
        for first, *rest in zip(*([deserialize_message(data, INPUTS[topic])
                                   for data in self.raw[topic]] for topic in self.topics),
                                strict=True):
            assert first.header.frame_id == 'base'
            stamps.append(nanoseconds(first.header.stamp))
            if rest:
                assert all(each.header == first.header for each in rest)
                position, quaternion = first.pose.position, first.pose.orientation
                twist, accel = rest[0].twist, rest[1].accel
            else:
                point, = first.points
                (transform,), (twist,), (accel,) = (
                    point.transforms, point.velocities, point.accelerations)
                position, quaternion = transform.translation, transform.rotation
            rows.append([
                position.x, position.y, position.z, quaternion.x, quaternion.y, quaternion.z,
                quaternion.w, *(number for v in (twist.linear, twist.angular, accel.linear,
                                                 accel.angular) for number in (v.x, v.y, v.z))])
        return stamps, np.array(rows)

    def expected(self, times: Any) -> NDArray[np.float64]:
        """Return the rows at times [ns]."""
        motion = motion_at(self.parameters, np.asarray(times) * 1e-9)
        return np.column_stack([
            motion.position, to_quaternion(motion.rotation), motion.rows[:, 12:]])

    def check(self, times: Any) -> tuple[list[int], NDArray[np.float64]]:
        """Check that the rows are those at times [ns]; return stamps and rows."""
        stamps, rows = self.rows()
        np.testing.assert_allclose(rows, self.expected(times), rtol=0.0, atol=1e-15)
        return stamps, rows

    def close(self) -> None:
        """Leave ROS, and end the program if it still runs."""
        self.program.kill()
        self.peer.close()


Start = Callable[..., Trajectory]


@pytest.fixture
def start(domain: int, tmp_path: Path) -> Iterator[Start]:
    """
    Return a function that makes a publisher with a parameter file's text, which ends with this.

    It is ``inside`` this process or in one of its own.
    """
    with ExitStack() as stack:
        def begin(text: str, *overrides: str, inside: bool = True) -> Trajectory:
            return stack.enter_context(closing(
                Trajectory(domain, tmp_path, inside, text, *overrides)))

        yield begin


@pytest.mark.parametrize('output, kind', [('separate', 'quintic'), ('combined', 'fourier')])
def test_the_motion_is_published_and_then_it_ends(
        start: Start, output: str, kind: str) -> None:
    trajectory = start(MOTION.format(kind=kind, more=f'output: {output}'), ENDS)
    times = sample_times(trajectory.parameters)
    assert len(times) == 301
    trajectory.until(len(times))
    assert trajectory.program.wait() == 0
    assert {topic for topic, of in trajectory.raw.items() if of} == set(trajectory.topics)
    stamps, _ = trajectory.check(times)
    assert [stamp - stamps[0] for stamp in stamps] == times.tolist()
    lines = log_lines(trajectory.program.stderr)
    assert len(lines) == 2
    assert f'{kind} motion at 200 Hz to stewart_dynamics, 301 setpoints' in lines[0]
    assert '301 setpoints published' in lines[1]
    assert_only_log_lines(trajectory.program.stderr)


def test_the_final_pose_is_held_until_a_signal(start: Start) -> None:
    trajectory = start(MOTION.format(kind='sine', more=COMBINED), 'use_sim_time:=true')
    trajectory.at(SECOND, 1)
    trajectory.at(SECOND + 300 * PERIOD, 301)
    trajectory.at(SECOND + 301 * PERIOD, 302)
    # While it holds, only the last one of several that are due is published.
    trajectory.at(1000 * SECOND, 303)
    trajectory.program.kill()
    stamps, rows = trajectory.rows()
    assert stamps[-3:] == [SECOND + 300 * PERIOD, SECOND + 301 * PERIOD, 1000 * SECOND]
    final = trajectory.expected(np.array([300 * PERIOD]))[0]
    np.testing.assert_allclose(rows[300], final, rtol=0.0, atol=1e-15)
    for row in rows[301:]:
        np.testing.assert_allclose(row[:7], final[:7], rtol=0.0, atol=1e-15)
        assert not row[7:].any()
    assert '301 setpoints published; holds the final pose until stopped' in (
        trajectory.program.stderr)


def test_a_looped_motion_goes_back_and_forth_until_a_signal(start: Start) -> None:
    trajectory = start(MOTION.format(kind='quintic', more='loop: true'), inside=False)
    trajectory.until(650)  # twice 1.5 s at 200 Hz, and some
    assert trajectory.program.stop(signal.SIGTERM) == 0
    assert_only_log_lines(trajectory.program.stderr)
    assert trajectory.program.stdout == ''
    assert 'until stopped' in trajectory.program.stderr
    # Messages in transit when it ended may lack a topic.
    whole = min(len(trajectory.raw[topic]) for topic in SEPARATE)
    for topic in SEPARATE:
        del trajectory.raw[topic][whole:]
    times = np.arange(whole) * PERIOD
    stamps, rows = trajectory.check(times)
    assert [stamp - stamps[0] for stamp in stamps] == times.tolist()
    assert rows[600, 0] == pytest.approx(0.0, abs=1e-15)
    assert rows[300, 0] == pytest.approx(0.2, abs=1e-15)


def test_the_motion_begins_without_subscribers_after_start_timeout(start: Start) -> None:
    # They are on another node's topics: these have no subscribers.
    trajectory = start(MOTION.format(kind='hold', more='start_timeout: 0.1'),
                       'target:=nobody', 'motion.duration:=0.1', ENDS)
    assert trajectory.program.wait() == 0
    assert 'hold motion at 200 Hz to nobody, 21 setpoints' in trajectory.program.stderr
    assert '21 setpoints published' in trajectory.program.stderr


def test_a_signal_ends_it_while_it_waits_for_subscribers(start: Start) -> None:
    trajectory = start(MOTION.format(kind='paper', more='start_timeout: 1000.0'),
                       'target:=nobody', inside=False)
    trajectory.peer.until(lambda: log_lines(trajectory.program.stderr), 'it has started')
    assert trajectory.program.stop() == 0
    assert_only_log_lines(trajectory.program.stderr)


def test_in_simulated_time_what_is_due_comes_with_the_clock(start: Start) -> None:
    trajectory = start(MOTION.format(kind='sine', more=COMBINED), 'use_sim_time:=true',
                       'motion.duration:=0.1', ENDS)
    # It begins where the clock stands, by itself, and waits for it at each sample.
    trajectory.at(SECOND, 1)
    trajectory.at(SECOND + PERIOD - 1, 1)
    for n in range(1, 11):
        trajectory.at(SECOND + n * PERIOD, n + 1)
        assert len(trajectory.raw[TOPIC[0]]) == n + 1
    # The samples that have become due meanwhile come at once, and then it is done.
    trajectory.at(2 * SECOND, 21)
    assert trajectory.program.wait() == 0
    times = sample_times(trajectory.parameters)[:21]
    assert trajectory.check(times)[0] == (SECOND + times).tolist()
    assert_only_log_lines(trajectory.program.stderr)


def test_the_motion_restarts_with_the_clock(start: Start) -> None:
    trajectory = start(MOTION.format(kind='sine', more='loop: true'), 'use_sim_time:=true')
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
    times = np.array([0, 1, 2, 3, 4, 0, 1, 0, 1]) * PERIOD
    assert trajectory.check(times)[0] == (np.repeat([7, 1], [5, 4]) * SECOND + times).tolist()
    warnings = log_lines(trajectory.program.stderr, 'WARN')
    assert len(warnings) == 2
    assert all('it restarts' in warning for warning in warnings)


def test_in_simulated_time_a_late_subscriber_gets_the_last_setpoint(
        start: Start, domain: int) -> None:
    trajectory = start(MOTION.format(kind='sine', more=COMBINED), 'use_sim_time:=true')
    trajectory.at(SECOND, 1)
    trajectory.at(SECOND + PERIOD, 2)
    late = Peer(domain, 'late')
    try:
        heard = late.listen(f'/stewart_dynamics/{TOPIC[0]}', INPUTS[TOPIC[0]])
        late.until(lambda: heard, 'the last one comes')
        assert heard[0] == trajectory.raw[TOPIC[0]][1]
    finally:
        late.close()
    trajectory.program.kill()


def test_in_simulated_time_the_motion_waits_for_subscribers(start: Start) -> None:
    trajectory = start(MOTION.format(kind='hold', more='start_timeout: 0.1'),
                       'use_sim_time:=true', 'target:=nobody')
    words = 'waiting for a subscriber of /nobody/setpoint/pose, /nobody/setpoint/twist'

    def said() -> bool:
        trajectory._clock.publish(Clock(clock=Time(nanoseconds=SECOND).to_msg()))
        return words in trajectory.program.stderr

    trajectory.peer.until(said, 'it says so')
    assert 'begun' not in trajectory.program.stderr
    heard = trajectory.peer.listen('/nobody/setpoint/pose', INPUTS['setpoint/pose'])
    for topic in ('twist', 'accel'):
        trajectory.peer.listen(f'/nobody/setpoint/{topic}', INPUTS[f'setpoint/{topic}'])
    trajectory.peer.until(lambda: heard, 'it begins')
    trajectory.program.kill()


def test_the_motion_waits_for_the_clock(start: Start) -> None:
    trajectory = start(MOTION.format(kind='hold', more='start_timeout: 0.1'),
                       'use_sim_time:=true')
    trajectory.peer.until(lambda: 'waiting for /clock' in trajectory.program.stderr, 'it waits')
    assert not trajectory.raw['setpoint/pose']
    trajectory.at(SECOND, 1)
    trajectory.program.kill()
    assert len(log_lines(trajectory.program.stderr, 'WARN')) == 1
