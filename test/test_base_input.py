# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The base's motion from its topics: which sample a setpoint gets, and all that may be wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import messages
from messages import NOW
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from referees import rng, rotation_about, symmetric_parameters
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from stewart_dynamics import BaseMotion, Motion, Pose
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.setpoint import read_message
from stewart_dynamics.setpoints.input_messages import (
    BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_SOURCES, BASE_TWIST, LARGEST, POSE, WRENCH)
from stewart_dynamics.setpoints.rejections import (
    MALFORMED, NOT_FINITE, NOT_JOINED, NOT_MEASURED, NOT_UNIT, OUT_OF_RANGE, TOO_OLD, TWICE,
    WRONG_FRAME)

MS = 1_000_000
SECOND = 1000 * MS
SOURCES = ('pose', 'motion', 'imu')
PARAMETERS = symmetric_parameters().replaced({
    'setpoint.source': 'pose', 'base.timeout': 0.1, 'gravity': [0.3, -0.2, -9.7],
    'base.imu.position': [0.4, -0.3, 0.2], 'base.imu.orientation': [0.5, 0.5, 0.5, 0.5]})
TURN = rotation_about([0.0, 0.0, 1.0], 0.3) @ rotation_about([1.0, 0.0, 0.0], 0.2)
QUATERNION = Rotation.from_matrix(TURN).as_quat()


class Feed(messages.Feed):
    """Setpoints on a base."""

    def __init__(self, source: str, **given: object) -> None:
        super().__init__(PARAMETERS.replaced({'base.source': source, **{
            name.replace('__', '.'): value for name, value in given.items()}}))

    def sample(self, stamp: int, mark: float = 0.0) -> None:
        """Take good messages of all topics of the base, a mark in their numbers."""
        for topic, data in sample(self.setpoints.base.topics, stamp, mark):
            self(topic, data)

    def row(self, stamp: int) -> Any:
        """Return the row of the base at a setpoint; None if the base is fixed."""
        setpoint = self(POSE, messages.pose(stamp))
        assert setpoint is not None
        return None if setpoint.bases is None else setpoint.bases[0].tolist()


def sample(topics: Sequence[str], stamp: int, mark: float = 0.0) -> list[tuple[str, bytes]]:
    """Return good messages of the base's topics at a stamp."""
    of: dict[str, Callable[[], bytes]] = {
        BASE_POSE: lambda: messages.pose(stamp, (9.0, mark, 9.0), QUATERNION, 'world'),
        BASE_TWIST: lambda: messages.twist(stamp, (9.0, 9.0, 9.0, mark, 0.2, 0.3), 'world'),
        BASE_ACCEL: lambda: messages.accel(stamp, (mark, 1.0, 2.0, 3.0, 4.0, mark), 'world'),
        BASE_IMU: lambda: messages.imu(stamp, (mark, 0.2, 0.3), (mark, 1.0, 9.0))}
    return [(topic, of[topic]()) for topic in topics]


def known(row: Any) -> bool:
    """Return whether the base's motion is known."""
    return not any(map(math.isnan, row))


# The numbers

def test_a_fixed_base_has_no_topics_and_no_row() -> None:
    feed = Feed('fixed')
    assert feed.setpoints.base.topics == ()
    assert feed.row(SECOND) is None


def test_a_pose_and_a_motion_give_the_bits_of_the_library() -> None:
    gravity, turn = PARAMETERS['gravity'], Pose.from_quaternion(np.zeros(3), QUATERNION)
    motion = Motion.from_quaternion(
        np.zeros(3), QUATERNION, [9.0] * 3, [0.5, 0.2, 0.3], [0.5, 1.0, 2.0], [3.0, 4.0, 0.5])
    for source, truth in (('pose', BaseMotion.from_pose(turn, gravity)),
                          ('motion', BaseMotion.from_motion(motion, gravity))):
        feed = Feed(source)
        feed.sample(SECOND, 0.5)
        assert feed.row(SECOND) == truth.rows.tolist()


def test_an_imu_gives_the_bits_of_the_library() -> None:
    feed = Feed('imu')
    mounting = Pose.from_quaternion(
        PARAMETERS['base.imu.position'], PARAMETERS['base.imu.orientation'])
    feed.sample(SECOND, 0.5)
    truth = BaseMotion.from_imu([0.5, 1.0, 9.0], [0.5, 0.2, 0.3], np.zeros(3),
                                mounting.position, mounting.rotation)
    assert feed.row(SECOND) == truth.rows.tolist()
    feed.sample(SECOND + 5 * MS, 0.7)
    gain = -math.expm1(-2.0 * math.pi * PARAMETERS['base.imu.cutoff'] * 0.005)
    truth = BaseMotion.from_imu([0.7, 1.0, 9.0], [0.7, 0.2, 0.3],
                                [gain * ((0.7 - 0.5) / 0.005), 0.0, 0.0],
                                mounting.position, mounting.rotation)
    assert np.allclose(feed.row(SECOND + 5 * MS), truth.rows, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize('little_endian', [True, False])
def test_messages_of_rclpy_are_read(little_endian: bool) -> None:
    message = Imu()
    message.header.frame_id = 'imu_link'
    message.header.stamp.sec = 1
    message.angular_velocity.x, message.linear_acceleration.z = 0.25, 9.5
    message.orientation_covariance[0] = -1.0
    message.linear_acceleration_covariance[4] = 7.0
    data = bytes(serialize_message(message))
    stamp, frame, values, _ = read_message(messages.IMU, data)
    assert (stamp, frame, len(values)) == (SECOND, b'imu_link', 37)
    assert (values[13], values[27], values[4], values[32]) == (0.25, 9.5, -1.0, 7.0)
    other = messages.imu(
        SECOND, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 'a', little_endian=little_endian)
    read = read_message(messages.IMU, other)
    assert (read.stamp, read.frame) == (SECOND, b'a')
    assert (read.values[13:16], read.values[25:28]) == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    for size in range(len(other)):
        with pytest.raises(MalformedError):
            read_message(messages.IMU, other[:size])


# Which sample

def oracle(samples: Sequence[tuple[int, Any]], stamp: int, timeout: int = SECOND // 10) -> Any:
    """Return the row at a stamp, as docs/moving_base.md says it."""
    usable = [n for n, (at, _) in enumerate(samples)
              if at <= stamp or (n and at - stamp <= at - samples[n - 1][0])]
    if not usable or stamp - samples[usable[-1]][0] > timeout:
        return np.full(12, np.nan)
    n = usable[-1]
    at, row = samples[n]
    if not n:
        return row
    before, row_before = samples[n - 1]
    if at > stamp and stamp - before > timeout:
        return np.full(12, np.nan)
    part = min((stamp - at) / (at - before), 1.0)
    return np.asarray(row) + (np.asarray(row) - row_before) * part


@given(st.lists(st.integers(1, 60) | st.integers(90, 400), min_size=0, max_size=8),
       st.lists(st.integers(-50, 900), min_size=1, max_size=6))
def test_the_newest_usable_base_sample_is_used(
        steps: Sequence[int], stamps: Sequence[int]) -> None:
    feed, samples, at = Feed('motion', setpoint__timeout=1e-9), [], SECOND
    for n, step in enumerate(steps):
        at += step * MS
        feed.sample(at, 0.1 * n * n)
        last = feed.setpoints.base.last
        assert last is not None
        samples.append(last)
    for n, stamp in enumerate(stamps):
        truth = oracle(samples, SECOND + stamp * MS)
        row = feed.setpoints.base.at(SECOND + stamp * MS)
        assert np.allclose(row, truth, rtol=1e-12, atol=1e-12, equal_nan=True), n


@pytest.mark.parametrize('source', SOURCES)
def test_between_two_samples_and_one_period_behind_them_rows_follow_a_line(source: str) -> None:
    feed = Feed(source)
    feed.sample(SECOND, 0.1)
    first = feed.row(SECOND + MS)
    feed.sample(SECOND + 10 * MS, 0.3)
    last = feed.setpoints.base.last
    assert last is not None
    for after, part in ((2, -0.8), (10, 0.0), (15, 0.5), (20, 1.0), (40, 1.0), (110, 1.0)):
        truth = np.array(last[1]) + (np.array(last[1]) - first) * part
        assert np.allclose(feed.row(SECOND + after * MS), truth, rtol=1e-12, atol=1e-12)
    assert not known(feed.row(SECOND + 111 * MS))  # 101 ms old
    assert not known(feed.setpoints.base.at(SECOND - 1))


def test_samples_that_setpoints_have_waited_for_are_kept() -> None:
    feed = Feed('motion')
    for n in range(2000):
        feed.sample(SECOND + n * MS, n)
    for n in (1000, 1500, 1999):
        assert feed.row(SECOND + n * MS)[5] == pytest.approx(feed.setpoints.base.at(
            SECOND + n * MS)[5])
        assert known(feed.setpoints.base.at(SECOND + n * MS))
    assert not known(feed.setpoints.base.at(SECOND + 999 * MS))


# Invalid messages

BAD: Sequence[tuple[str, Callable[[int], bytes], str]] = (
    (BASE_POSE, lambda t: messages.pose(t, (math.nan, 0.0, 0.0), frame='world'), NOT_FINITE),
    (BASE_POSE, lambda t: messages.pose(t, quaternion=(0.0, 0.0, 0.0, 1.01), frame='world'),
     NOT_UNIT),
    (BASE_POSE, lambda t: messages.pose(t, frame='base'), WRONG_FRAME),
    (BASE_TWIST, lambda t: messages.twist(t, (math.inf,) * 6, 'world'), NOT_FINITE),
    (BASE_TWIST, lambda t: messages.twist(t, frame='base'), WRONG_FRAME),
    (BASE_ACCEL, lambda t: messages.accel(t, frame='world')[:-1], MALFORMED),
    (BASE_IMU, lambda t: messages.imu(t, (math.nan, 0.0, 0.0)), NOT_FINITE),
    (BASE_IMU, lambda t: messages.imu(t, force=(math.inf, 0.0, 0.0)), NOT_FINITE),
    (BASE_IMU, lambda t: messages.imu(t, frame='other'), WRONG_FRAME),
    (BASE_IMU, lambda t: messages.imu(t, covariances=(0.0, -1.0, 0.0)), NOT_MEASURED),
    (BASE_IMU, lambda t: messages.imu(t, covariances=(0.0, 0.0, -1.0)), NOT_MEASURED),
    (BASE_TWIST, lambda t: messages.twist(t, (1e10,) * 6, 'world'), OUT_OF_RANGE),
    (BASE_IMU, lambda t: b'', MALFORMED))


@pytest.mark.parametrize(('topic', 'bad', 'reason'), BAD)
def test_invalid_samples_are_rejected_and_the_last_one_holds(
        topic: str, bad: Callable[[int], bytes], reason: str) -> None:
    feed = Feed('imu' if topic == BASE_IMU else 'motion')
    feed.sample(SECOND)
    before = feed.row(SECOND)
    feed(topic, bad(SECOND + MS))
    assert feed.counts == {(topic, reason): 1}
    assert feed.row(SECOND + 2 * MS) == before
    feed.sample(SECOND + 3 * MS)
    assert known(feed.row(SECOND + 3 * MS))


def test_the_largest_number_is_used() -> None:
    feed = Feed('motion')
    feed.sample(SECOND, LARGEST)
    assert known(feed.row(SECOND)) and not feed.counts


@pytest.mark.parametrize(('given', 'reasons'), [
    ([{'frame': 'camera', 'covariances': (0.0, -1.0, 0.0)}, {'frame': 'imu'}], [NOT_MEASURED]),
    ([{'frame': frame} for frame in ('', 'imu', '', 'imu', 'other')], [WRONG_FRAME]),
    ([{'orientation': (math.nan,) * 4}], [])], ids=['rejected', 'no frame', 'no orientation'])
def test_the_first_frame_of_a_message_that_is_used_is_the_imus(
        given: Sequence[dict[str, Any]], reasons: Sequence[str]) -> None:
    feed = Feed('imu')
    for n, fields in enumerate(given):
        feed(BASE_IMU, messages.imu(SECOND + n * MS, **fields))
    assert known(feed.row(SECOND + len(given) * MS))
    assert feed.counts == {(BASE_IMU, reason): 1 for reason in reasons}
    if WRONG_FRAME in reasons:
        assert feed.said[0][1] == "'other', must be 'imu' or empty"


def test_samples_joined_within_a_tolerance_survive_a_restart() -> None:
    feed = Feed('motion', setpoint__sync_tolerance=0.02, base__timeout=0.01)
    start = 1000 * SECOND
    feed.sample(start)
    for topic, data in ((BASE_TWIST, messages.twist(start + MS, frame='world')),
                        (BASE_TWIST, messages.twist(start + 2 * MS, frame='world')),
                        (BASE_ACCEL, messages.accel(start + 2 * MS, frame='world')),
                        (BASE_POSE, messages.pose(start - 11 * MS, frame='world'))):
        feed(topic, data)
    assert feed.notices == ['base: stamps jumped back by 0.011 s: followed as a restart']
    assert known(feed.setpoints.base.at(start - 11 * MS))


@pytest.mark.parametrize('timeout', [0.1, 1000.0])
def test_a_base_that_restarts_with_setpoints_is_followed(timeout: float) -> None:
    feed = Feed('pose', base__timeout=timeout)
    for n in range(60):
        feed.sample(SECOND * (n + 1))
    feed.row(60 * SECOND)
    assert not known(feed.row(SECOND // 2))
    assert not known(feed.row(SECOND))  # that of the time before the restart
    feed.sample(SECOND)
    assert known(feed.row(SECOND + MS))
    assert not feed.counts


def test_stamps_twice_or_back_are_rejected_and_a_jump_is_a_restart() -> None:
    for source in SOURCES:
        feed = Feed(source)
        first = feed.setpoints.base.topics[0]
        for stamp in (SECOND, SECOND + 10 * MS):
            feed.sample(stamp)
        feed.sample(SECOND + 10 * MS)
        feed.sample(SECOND + 5 * MS)
        assert feed.counts[first, TWICE] == 1
        assert feed.counts[first, TOO_OLD] == 1
        feed.sample(SECOND // 2, 0.5)
        assert feed.notices == ['base: stamps jumped back by 0.51 s: followed as a restart']
        assert known(feed.row(SECOND // 2))
        assert not known(feed.setpoints.base.at(SECOND + 10 * MS))


def test_samples_without_stamps_have_the_clock() -> None:
    feed = Feed('motion')
    for n in range(3):
        for topic, data in sample(BASE_SOURCES['motion'], 0):
            feed(topic, data, NOW + n * MS)
    assert len(feed.notices) == 1
    assert feed.notices[0].startswith('base: base/pose: header stamps are zero')
    assert feed.setpoints.base.last is not None
    assert feed.setpoints.base.last[0] == NOW + 2 * MS
    for topic, data in sample(BASE_SOURCES['motion'], 0):  # the clock goes back
        feed(topic, data, NOW - SECOND)
    assert known(feed.setpoints.base.at(NOW - SECOND))


def test_a_topic_that_is_missing_leaves_nothing_and_is_counted() -> None:
    feed = Feed('motion')
    for n in range(3):
        feed(BASE_POSE, sample((BASE_POSE,), SECOND + n * MS)[0][1])
    assert feed.row(SECOND)[0] != feed.row(SECOND + MS)[0]  # nan
    feed.setpoints.drop_waiting('the bag ends')
    assert feed.counts[BASE_POSE, NOT_JOINED] == 3


# Many at once

TOPICS = (POSE, WRENCH, BASE_POSE, BASE_TWIST, BASE_ACCEL, BASE_IMU)
FATES = ['good'] * 20 + ['lost', 'late', 'nan', 'twice', 'zero', 'back', 'frame', 'huge', 'ahead']


def recorded(source: str, fates: Sequence[str], period: int) -> list[tuple[str, bytes]]:
    """Return setpoints every millisecond, and base samples, each with a fate of its own."""
    random = rng()
    found: list[tuple[str, bytes]] = []
    stamp = SECOND
    for n, fate in enumerate(fates):
        stamp += 4 * MS
        if fate == 'back':
            stamp -= 500 * MS
        if fate == 'ahead':
            stamp += 300 * MS
        of_base = sample(BASE_SOURCES[source], stamp, random.normal())
        if fate == 'lost':
            of_base = of_base[1:]
        elif fate == 'nan':
            of_base[0] = of_base[0][0], of_base[0][1][:-8] + b'\xff' * 8
        elif fate == 'huge':
            of_base = sample(BASE_SOURCES[source], stamp, 1e308)
        elif fate == 'twice':
            of_base = of_base * 2
        elif fate == 'zero':
            of_base = sample(BASE_SOURCES[source], 0, random.normal())
        elif fate == 'frame':
            of_base = [(topic, data.replace(b'world', b'earth').replace(b'imu', b'abc'))
                       for topic, data in of_base]
        setpoints = [(POSE, messages.pose(stamp + k * MS, random.normal(size=3)))
                     for k in range(4)]
        if n % period == 0:
            at = len(setpoints) if fate == 'late' else int(random.integers(4))
            setpoints[at:at] = of_base
        found += setpoints
    return found


@given(st.sampled_from(SOURCES), st.lists(st.sampled_from(FATES), max_size=60),
       st.integers(1, 40), st.lists(st.integers(0, 300), max_size=4))
def test_many_are_what_they_are_one_by_one(
        source: str, fates: Sequence[str], period: int, cuts: Sequence[int]) -> None:
    messages.check_many(
        Feed(source), Feed(source), recorded(source, fates, period), TOPICS, cuts)


# The IMU's angular acceleration: what docs/moving_base.md states

def filtered(spins: Any, rate: float, cutoff: float) -> Any:
    """Return the angular accelerations about x that an IMU's angular velocities give."""
    feed = Feed('imu', base__imu__cutoff=cutoff, base__imu__orientation=[0.0, 0.0, 0.0, 1.0])
    found = []
    for n, spin in enumerate(spins):
        feed(BASE_IMU, messages.imu(SECOND + round(n * SECOND / rate), (spin, 0.0, 0.0)))
        last = feed.setpoints.base.last
        assert last is not None
        found.append(last[1][9])
    return np.array(found)


@pytest.mark.parametrize(('rate', 'cutoff'), [(200.0, 20.0), (100.0, 20.0), (1000.0, 5.0)])
def test_delay_and_noise_of_the_angular_acceleration_are_as_stated(
        rate: float, cutoff: float) -> None:
    dt = 1.0 / rate
    gain = -math.expm1(-2.0 * math.pi * cutoff * dt)
    times = np.arange(2000) * dt
    found = filtered(0.5 * 3.0 * times ** 2, rate, cutoff)  # its derivative is 3 t
    delay = times[-1] - found[-1] / 3.0
    assert delay == pytest.approx(dt * (1.0 / gain - 0.5), rel=1e-6)
    found = filtered(1e-3 * rng().normal(size=20_000), rate, cutoff)[200:]
    assert np.std(found) == pytest.approx(
        1e-3 * gain / dt * math.sqrt(2.0 / (2.0 - gain)), rel=0.05)
