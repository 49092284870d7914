# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Joining by stamp: every rule for bad input, and that each message is answered or counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import permutations
import math
import re
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
import messages
from messages import HOME, NOW, REST, UPRIGHT
import numpy as np
import pytest
from referees import rng, symmetric_parameters
from scipy.spatial.transform import Rotation

from stewart_dynamics.setpoints.input_messages import (
    ACCEL, COMBINED, POSE, TWIST, WRENCH)
from stewart_dynamics.setpoints.input_stream import WAITING
from stewart_dynamics.setpoints.rejections import (
    DROPPED, MALFORMED, NOT_FINITE, NOT_JOINED, NOT_UNIT, Rejection, TOO_OLD, TWICE,
    WRONG_FRAME)
from stewart_dynamics.setpoints.step import Batch

PARAMETERS = symmetric_parameters().replaced({'setpoint.timeout': 0.1})
TOPICS = (POSE, TWIST, ACCEL)
INPUTS = (*TOPICS, COMBINED, WRENCH)
ORDERS = list(permutations(TOPICS))
WRITERS: dict[str, Callable[..., bytes]] = {
    POSE: messages.pose, TWIST: messages.twist, ACCEL: messages.accel,
    COMBINED: messages.combined, WRENCH: messages.wrench}

MS = 1_000_000
SECOND = 1000 * MS
NAN, INF = math.nan, math.inf


def good(topic: str, stamp: int, mark: float = 0.0) -> bytes:
    """Return a good message of a topic, the mark in its first number."""
    values = HOME if topic in (POSE, COMBINED) else REST
    return WRITERS[topic](stamp, (mark, *values[1:]))


class Feed(messages.Feed):
    """Setpoints with given parameters; the number of messages on each topic is kept, too."""

    def __init__(self, **given: object) -> None:
        super().__init__(
            PARAMETERS.replaced({f'setpoint.{name}': value for name, value in given.items()}))
        self.given: Counter[str] = Counter()

    def __call__(self, topic: str, data: bytes, now: int = NOW) -> Batch | None:
        """Take one message."""
        self.given[topic] += 1
        return super().__call__(topic, data, now)

    def sample(self, topic: str, stamp: int, mark: float = 0.0) -> Batch | None:
        """Take a good message of a topic, the mark in its first number."""
        return self(topic, good(topic, stamp, mark))

    def whole(self, stamp: int, mark: float = 0.0) -> Batch | None:
        """Take good messages of all topics; the last one must be what completes it."""
        answers = [self.sample(topic, stamp, mark) for topic in self.setpoints.topics]
        assert answers[:-1] == [None] * (len(answers) - 1)
        return answers[-1]

    def used(self, samples: Sequence[tuple[str, float]]) -> list[float]:
        """Take samples without stamps, topics and marks; return the mark of each setpoint."""
        found = []
        for topic, mark in samples:
            if (setpoint := self.sample(topic, 0, mark)) is not None:
                motion = setpoint.motions[0].tolist()
                assert setpoint.stamps[0] == NOW
                assert motion[0] == motion[12] == motion[18]
                found.append(motion[0])
        return found


def check_same(setpoint: Batch | None, expected: Batch) -> None:
    """Check that two setpoints are equal, except for their times of recording."""
    assert setpoint is not None
    assert np.array_equal(setpoint.stamps, expected.stamps)
    assert np.array_equal(setpoint.rows, expected.rows, equal_nan=True)
    assert setpoint.moving == expected.moving


# Joining

@pytest.mark.parametrize('apart', [0, MS])
@pytest.mark.parametrize('order', ORDERS)
def test_topics_are_joined_in_any_order_within_the_tolerance(
        order: Sequence[str], apart: int) -> None:
    half = math.sqrt(0.5)
    data = {POSE: messages.pose(SECOND, (0.1, 0.2, 1.3), (0.0, 0.0, half, half)),
            TWIST: messages.twist(SECOND + 2 * apart, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
            ACCEL: messages.accel(SECOND + apart, (7.0, 8.0, 9.0, 10.0, 11.0, 12.0))}
    feed = Feed(sync_tolerance=2e-9 * apart)
    assert feed(order[0], data[order[0]]) is None
    assert feed(order[1], data[order[1]]) is None
    setpoint = feed(order[2], data[order[2]])
    assert setpoint is not None
    assert setpoint.stamps[0] == SECOND
    motion, = setpoint.motions
    assert motion[:3].tolist() == [0.1, 0.2, 1.3]
    assert np.allclose(motion[3:12], [0, -1, 0, 1, 0, 0, 0, 0, 1], rtol=0, atol=1e-15)
    assert motion[12:].tolist() == list(range(1, 13))
    assert not feed.counts
    assert not feed.notices


@pytest.mark.parametrize('apart', [-2 * MS, -1, 0, 1, 2 * MS])
def test_the_last_used_stamp_is_that_of_the_setpoint(apart: int) -> None:
    feed = Feed(sync_tolerance=0.002)
    feed.sample(POSE, SECOND)
    feed.sample(TWIST, SECOND)
    assert feed.sample(ACCEL, SECOND + apart)
    assert feed.sample(POSE, SECOND) is None
    assert feed.sample(POSE, SECOND - 1) is None
    assert feed.counts == {(POSE, TWICE): 1, (POSE, TOO_OLD): 1}
    assert feed.sample(POSE, SECOND + 1) is None
    assert feed.counts == {(POSE, TWICE): 1, (POSE, TOO_OLD): 1}


@pytest.mark.parametrize('late', [TWIST, ACCEL])
def test_stamps_that_exceed_the_tolerance_are_not_joined(late: str) -> None:
    feed = Feed(sync_tolerance=0.002)
    for topic in TOPICS:
        if topic != late:
            assert feed.sample(topic, SECOND) is None
    assert feed.sample(late, SECOND + 2 * MS + 1) is None


def test_the_nearest_sample_within_the_tolerance_is_joined() -> None:
    feed = Feed(sync_tolerance=0.005)
    for stamp, mark in ((SECOND - 2 * MS, 1.0), (SECOND + MS, 2.0), (SECOND + 3 * MS, 3.0)):
        feed.sample(TWIST, stamp, mark)
        feed.sample(ACCEL, stamp, mark)
    setpoint = feed.sample(POSE, SECOND)
    assert setpoint is not None
    assert setpoint.motions[0, [12, 18]].tolist() == [2.0, 2.0]


def test_a_combined_message_is_a_setpoint() -> None:
    feed = Feed(source='combined')
    assert feed.setpoints.topics == (COMBINED,)
    setpoint = feed(COMBINED, messages.combined(
        SECOND, (0.1, 0.2, 1.3), UPRIGHT, (1, 2, 3, 4, 5, 6), (7, 8, 9, 10, 11, 12)))
    check_same(setpoint, Batch.from_parts(
        SECOND, (0.1, 0.2, 1.3, 1, 0, 0, 0, 1, 0, 0, 0, 1, *range(1, 13))))


def test_a_pose_alone_stands_still() -> None:
    feed = Feed(source='pose')
    assert feed.setpoints.topics == (POSE,)
    check_same(feed.sample(POSE, SECOND, 0.25), Batch.from_parts(
        SECOND, (0.25, 0.0, 1.1, 1, 0, 0, 0, 1, 0, 0, 0, 1) + (0.0,) * 12))


@pytest.mark.parametrize('source', ['combined', 'pose'])
def test_a_single_topic_needs_no_stamp_and_each_stamp_is_used_once(source: str) -> None:
    feed = Feed(source=source)
    topic, = feed.setpoints.topics
    for _ in range(3):
        setpoint = feed.sample(topic, 0)
        assert setpoint is not None
        assert setpoint.stamps[0] == NOW
    assert len(feed.notices) == 1
    assert feed.sample(topic, SECOND)
    assert feed.sample(topic, SECOND) is None
    assert feed.counts == {(topic, TWICE): 1}


# Rejecting

NUMBERS: dict[str, Callable[[list[float]], bytes]] = {
    POSE: lambda of: messages.pose(SECOND, of[:3], of[3:7]),
    TWIST: lambda of: messages.twist(SECOND, of[:6]),
    ACCEL: lambda of: messages.accel(SECOND, of[:6]),
    COMBINED: lambda of: messages.combined(SECOND, of[:3], of[3:7], of[7:13], of[13:]),
    WRENCH: lambda of: messages.wrench(SECOND, of[:6])}


def _spoilt() -> list[tuple[str, bytes, str, str]]:
    found = []
    for topic, number in ((POSE, 7), (TWIST, 6), (ACCEL, 6), (COMBINED, 19), (WRENCH, 6)):
        for at in range(number):
            values = [*HOME, *UPRIGHT, *REST, *REST]
            values[at] = (NAN, INF, -INF)[at % 3]
            found.append((topic, NUMBERS[topic](values), NOT_FINITE, 'nan|inf'))
        found += [(topic, WRITERS[topic](SECOND, frame=frame), WRONG_FRAME, f"'{frame}'.*'base'")
                  for frame in ('map', '/base', 'Base')]
        whole = good(topic, SECOND)
        found += [(topic, whole[:-1], MALFORMED, f'{len(whole) - 1} bytes'),
                  (topic, b'', MALFORMED, '0 bytes')]
    for topic in (POSE, COMBINED):
        for length in (1 - 1.1e-3, 1 + 1.1e-3, 0.0, 2.0, 1e150):
            quaternion = (0.0, 0.0, 0.6 * length, 0.8 * length)
            found.append((topic, WRITERS[topic](SECOND, HOME, quaternion), NOT_UNIT,
                          re.escape(f'{length:.6g}')))
    return found


@pytest.mark.parametrize(('topic', 'data', 'reason', 'words'), _spoilt())
def test_a_bad_message_is_rejected_and_the_good_one_used(
        topic: str, data: bytes, reason: str, words: str) -> None:
    feed = Feed(source='combined' if topic == COMBINED else 'separate')
    feed(WRENCH, messages.wrench(0, (1, 2, 3, 4, 5, 6)))
    for other in feed.setpoints.topics:
        if other != topic:
            feed.sample(other, SECOND)
    assert feed(topic, data) is None
    assert feed.setpoints.wrench == (1, 2, 3, 4, 5, 6)
    assert feed.counts == {(topic, reason): 1}
    assert re.search(words, feed.said[0][1])
    assert topic == WRENCH or feed.sample(topic, SECOND)


@pytest.mark.parametrize('frame', ['', 'base'])
@pytest.mark.parametrize('topic', [*TOPICS, COMBINED, WRENCH])
def test_the_base_frame_and_an_empty_one_are_accepted(topic: str, frame: str) -> None:
    feed = Feed(source='combined' if topic == COMBINED else 'separate')
    feed(topic, WRITERS[topic](SECOND, frame=frame))
    assert not feed.counts


def test_another_base_frame_is_the_only_one() -> None:
    feed = messages.Feed(
        PARAMETERS.replaced({'base_frame': 'sol élevé', 'setpoint.source': 'pose'}))
    assert feed(POSE, messages.pose(SECOND, frame='base')) is None
    assert feed.counts == {(POSE, WRONG_FRAME): 1}
    assert feed(POSE, messages.pose(SECOND, frame='sol élevé'))


@pytest.mark.parametrize(('reason', 'said'), [
    (NOT_FINITE, 'setpoint/pose rejected: not finite: nan'),
    (NOT_JOINED, 'setpoint/pose dropped: not all topics had its stamp: nan'),
    (DROPPED, 'setpoint/pose dropped: more came at once than can be answered: nan')])
def test_a_dropped_sample_is_not_reported_as_rejected(reason: str, said: str) -> None:
    assert Rejection(POSE, reason).words('nan') == said


@pytest.mark.parametrize('topic', TOPICS)
@pytest.mark.parametrize('ago', [1, 10 * MS, 100 * MS - 1, 100 * MS])
def test_samples_older_than_the_last_used_are_rejected(topic: str, ago: int) -> None:
    feed = Feed()
    assert feed.whole(SECOND)
    assert feed.sample(topic, SECOND - ago) is None
    assert feed.counts == {(topic, TOO_OLD): 1}
    assert f'{ago / 1e9:g} s' in feed.said[0][1]
    assert not feed.notices
    assert feed.whole(SECOND + 10 * MS)


def test_the_first_sample_of_a_repeated_stamp_is_used() -> None:
    feed = Feed()
    feed.sample(POSE, SECOND, 1.0)
    assert feed.sample(POSE, SECOND, 2.0) is None
    assert feed.counts == {(POSE, TWICE): 1}
    feed.sample(TWIST, SECOND)
    setpoint = feed.sample(ACCEL, SECOND)
    assert setpoint is not None
    assert setpoint.motions[0, 0] == 1.0
    for topic in TOPICS:
        assert feed.sample(topic, SECOND, 3.0) is None
    assert feed.counts == {(POSE, TWICE): 2, (TWIST, TWICE): 1, (ACCEL, TWICE): 1}
    assert feed.whole(SECOND + MS)


def test_samples_without_their_partners_are_dropped() -> None:
    feed = Feed()
    feed.sample(POSE, SECOND)
    feed.sample(TWIST, SECOND)
    assert feed.whole(SECOND + 10 * MS)
    assert feed.counts == {(POSE, NOT_JOINED): 1, (TWIST, NOT_JOINED): 1}
    assert feed.sample(ACCEL, SECOND) is None
    assert feed.counts[ACCEL, TOO_OLD] == 1


# Jumping back

def test_a_jump_back_that_exceeds_the_timeout_is_followed_and_logged_once_each_time() -> None:
    feed = Feed()
    for lap in range(3):
        for n in range(12):  # a bag that loops: 110 ms back each time
            assert feed.whole(10 * SECOND + n * 10 * MS)
            assert len(feed.notices) == lap
    assert 'jumped back by 0.11 s: followed as a restart' in feed.notices[0]
    assert not feed.counts


def test_a_setpoint_after_a_jump_back_is_a_restart() -> None:
    feed = Feed()
    stamps = (SECOND, SECOND - 100 * MS - 1, 2 * SECOND, SECOND, SECOND + MS)
    setpoints = [feed.whole(stamp) for stamp in stamps]
    assert [setpoint.restarts[0] for setpoint in setpoints if setpoint] == [
        False, True, False, True, False]
    assert len(feed.notices) == 2
    assert not feed.counts


@pytest.mark.parametrize('topic', TOPICS)
def test_a_stray_old_sample_of_one_topic_resets_nothing(topic: str) -> None:
    feed = Feed()
    assert feed.whole(10 * SECOND)
    assert feed.sample(topic, SECOND) is None
    assert feed.whole(10 * SECOND + 10 * MS)
    assert not feed.notices
    assert feed.counts == {(topic, NOT_JOINED): 1}
    # and older samples are still rejected
    assert feed.sample(POSE, 10 * SECOND + 5 * MS) is None
    assert feed.counts[POSE, TOO_OLD] == 1


def test_a_restart_drops_samples_waiting_from_before_it() -> None:
    feed = Feed()
    assert feed.whole(10 * SECOND)
    feed.sample(POSE, 10 * SECOND + 10 * MS)
    assert feed.whole(SECOND)
    assert feed.counts == {(POSE, NOT_JOINED): 1}
    assert feed.whole(SECOND + 10 * MS)


# Without stamps

def without_stamps(marks: Sequence[float], topics: Sequence[str] = TOPICS,
                   ) -> list[tuple[str, float]]:
    """Return topics and marks, all topics of a mark before the next."""
    return [(topic, mark) for mark in marks for topic in topics]


@pytest.mark.parametrize('order', ORDERS)
def test_samples_without_stamps_are_joined_in_order_of_arrival(order: Sequence[str]) -> None:
    feed = Feed()
    assert feed.used(without_stamps((1.0, 2.0, 3.0), order)) == [1.0, 2.0, 3.0]
    assert not feed.counts
    assert len(feed.notices) == 1
    assert 'zero' in feed.notices[0]


@pytest.mark.parametrize('order', ORDERS)
def test_a_topic_that_arrives_earlier_is_not_joined_late(order: Sequence[str]) -> None:
    feed = Feed()
    assert feed.used([*without_stamps((1.0, 2.0, 3.0), order[:2]), (order[2], 3.0)]) == [3.0]
    assert feed.counts == {(topic, NOT_JOINED): 2 for topic in order[:2]}
    assert feed.used([(order[0], 4.0)]) == []
    feed.setpoints.drop_waiting('the bag ends')
    assert feed.counts[order[0], NOT_JOINED] == 3


@pytest.mark.parametrize('instead', [[], [math.nan]], ids=['lost', 'rejected'])
@pytest.mark.parametrize('spoilt', TOPICS)
def test_a_lost_or_rejected_sample_without_a_stamp_costs_its_setpoint_and_no_other(
        spoilt: str, instead: list[float]) -> None:
    sequence = without_stamps([float(n) for n in range(1, 9)])
    at = sequence.index((spoilt, 4.0))
    sequence[at:at + 1] = [(spoilt, mark) for mark in instead]
    assert Feed().used(sequence) == [1.0, 2.0, 3.0, 5.0, 6.0, 7.0, 8.0]


def test_samples_without_stamps_that_come_in_bunches_are_lost_but_never_mixed() -> None:
    feed = Feed()
    bunches = [(topic, mark) for topic in TOPICS for mark in (2.0, 3.0, 4.0)]
    assert feed.used([*without_stamps([1.0]), *bunches, *without_stamps((5.0, 6.0, 7.0))]) == [
        1.0, 5.0, 6.0, 7.0]
    assert feed.counts == {(topic, NOT_JOINED): 3 for topic in TOPICS}


def test_zero_stamps_after_others_are_joined_in_order_of_arrival() -> None:
    """A stamp of zero is no time, whatever came before; and stamps are followed again."""
    feed = Feed()
    for before, after in ((NOW + SECOND, NOW + SECOND), (20 * MS, 30 * MS)):
        assert feed.whole(before) is not None
        for mark in (1.0, 2.0, 3.0):
            assert feed.used(without_stamps([mark])) == [mark]
        assert feed.whole(after) is not None
    assert not feed.counts
    zero, *restarts = feed.notices
    assert 'header stamps are zero' in zero
    assert len(restarts) == 3  # to the clock, to the past, and from the clock to it
    assert all(re.match('stamps jumped back by .*: followed as a restart', each)
               for each in restarts)


def test_a_zero_stamp_on_one_topic_delays_nothing() -> None:
    feed = Feed()
    assert feed.sample(POSE, 0) is None
    assert feed.whole(20 * MS) is not None
    assert feed.counts == {(POSE, NOT_JOINED): 1}
    assert feed.sample(POSE, 0) is None
    assert feed.whole(30 * MS) is not None
    assert feed.counts == {(POSE, NOT_JOINED): 2}
    assert not feed.notices[1:]


def test_stamps_of_a_setpoint_lie_within_the_tolerance_of_each_other() -> None:
    feed = Feed(sync_tolerance=0.004)
    for n in range(1, 20):
        for topic, shift in ((POSE, 0), (TWIST, 3), (ACCEL, -3)):
            assert feed.sample(topic, (10 * n + shift) * MS) is None


def test_a_sample_used_within_the_tolerance_is_not_used_again() -> None:
    feed = Feed(sync_tolerance=0.005)
    assert feed.sample(POSE, 1000 * MS) is None
    assert feed.sample(ACCEL, 1000 * MS) is None
    assert feed.sample(TWIST, 1004 * MS) is not None
    assert feed.sample(TWIST, 1004 * MS) is None
    assert feed.counts == {(TWIST, TWICE): 1}
    assert feed.sample(POSE, 1008 * MS) is None
    assert feed.sample(ACCEL, 1008 * MS) is None
    assert feed.sample(TWIST, 1003 * MS) is None
    assert feed.counts == {(TWIST, TWICE): 1, (TWIST, TOO_OLD): 1}
    assert feed.sample(TWIST, 1012 * MS) is not None


# Bounds

@pytest.mark.parametrize('silent', TOPICS)
def test_the_number_of_waiting_samples_is_bounded(silent: str) -> None:
    feed = Feed()
    many = WAITING + 50
    for n in range(1, many + 1):
        for topic in TOPICS:
            if topic != silent:
                feed.sample(topic, n * MS, float(n))
    assert feed.counts == {(topic, NOT_JOINED): 50 for topic in TOPICS if topic != silent}
    # the oldest are dropped, the newest are still there
    answers = [feed.sample(silent, n * MS) for n in range(1, many + 1)]
    used = [answer.motions[0, 0 if silent != POSE else 12] for answer in answers if answer]
    assert used == [float(n) for n in range(51, many + 1)]


# Quaternions

@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 1e-3),
       st.floats(1 - 0.999e-3, 1 + 0.999e-3))
@example((1.0, 0.0, 0.0, 0.0), 1.0)
@example((0.5, -0.5, 0.5, -0.5), 1.0009)
def test_a_quaternion_is_brought_to_unit_length(
        direction: tuple[float, ...], length: float) -> None:
    factor = length / math.hypot(*direction)
    quaternion = [factor * number for number in direction]
    setpoint = Feed(source='pose')(POSE, messages.pose(SECOND, HOME, quaternion))
    assert setpoint is not None
    rotation = setpoint.motions[0, 3:12].reshape(3, 3)
    # some roundings of the numbers in it, none of the length
    assert np.max(np.abs(rotation @ rotation.T - np.eye(3))) < 2e-15
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=3e-15)
    assert np.allclose(rotation, Rotation.from_quat(direction).as_matrix(), rtol=0, atol=3e-15)
    check_same(Feed(source='pose')(POSE, messages.pose(SECOND, HOME, [-x for x in quaternion])),
               setpoint)


# Any input at all

def _garbage(data: bytes) -> bytes:
    random = rng(int.from_bytes(data[4:12], 'little'))
    spoiled = bytearray(data)
    for at in random.integers(0, len(data), 4):
        spoiled[at] = random.integers(0, 256)
    return bytes(spoiled[:random.integers(0, len(data) + 1)])


FAULTS: dict[str, Callable[[bytes], bytes]] = {
    'none': lambda data: data,
    'nan': lambda data: data[:-8] + np.array(NAN).tobytes(),
    'quaternion': lambda data: data[:-8] + np.array(1.5).tobytes(),  # of a pose
    'frame': lambda data: data.replace(b'base', b'besa'),
    'cut': lambda data: data[:-5],
    'garbage': _garbage,
    'another type': lambda data: messages.combined(SECOND)}
STAMPS: dict[str, Callable[[bytes], bytes]] = {
    'zero': lambda data: data[:4] + bytes(8) + data[12:],
    'back': lambda data: data[:4] + bytes(7) + b'\1' + data[12:]}


samples = st.lists(st.tuples(
    st.sampled_from(TOPICS),
    # steps of 10 ms around zero, many of them twice; a few jumps that exceed the timeout
    st.integers(-3, 25).map(lambda n: n * 10 * MS) | st.integers(-500, 500).map(
        lambda n: n * 7 * MS),
    st.sampled_from(['none'] * 12 + list(FAULTS))), max_size=80)


def _drained(feed: Feed, answers: list[Batch]) -> None:
    """Use or drop what waits."""
    far = 2 ** 31 * SECOND - 1
    final = [answer for topic in TOPICS if (answer := feed.sample(topic, far))]
    assert len(final) == 1
    answers += final


@given(samples, st.sampled_from([0.0, 0.005, 0.02]))
def test_every_message_is_answered_or_counted(
        sequence: list[tuple[str, int, str]], tolerance: float) -> None:
    feed = Feed(sync_tolerance=tolerance)
    answers: list[Batch] = []
    for topic, stamp, fault in sequence:
        if (answer := feed(topic, FAULTS[fault](good(topic, stamp)))) is not None:
            answers.append(answer)
        waiting = {t: feed.given[t] - len(answers) - sum(
            n for (of, _), n in feed.counts.items() if of == t) for t in TOPICS}
        assert min(waiting.values()) >= 0
    for answer in answers:
        assert answer.motions.shape == (1, 24)
        assert np.all(np.isfinite(answer.motions))
    stamps = [stamp for answer in answers if (stamp := int(answer.stamps[0])) != NOW]
    back = [(a, b) for a, b in zip(stamps, stamps[1:], strict=False) if b <= a]
    assert all(a - b > 100 * MS for a, b in back)
    assert sum('restart' in notice for notice in feed.notices) == len(back)
    assert sum('zero' in notice for notice in feed.notices) <= 1
    _drained(feed, answers)
    for topic in TOPICS:
        rejected = sum(n for (of, _), n in feed.counts.items() if of == topic)
        assert feed.given[topic] == len(answers) + rejected


@given(samples, st.sampled_from([0, 5, 20]))
def test_only_stamps_within_the_tolerance_are_joined(
        sequence: list[tuple[str, int, str]], tolerance: int) -> None:
    feed = Feed(sync_tolerance=tolerance * 1e-3)
    for topic, stamp, _ in sequence:
        answer = feed.sample(topic, stamp, float(stamp))
        if answer is not None:
            stamp, marks = int(answer.stamps[0]), answer.motions[0, [0, 12, 18]].tolist()
            assert stamp in (NOW, *marks)
            assert max(marks) - min(marks) <= 2 * tolerance * MS
            assert stamp != NOW or marks == [0.0, 0.0, 0.0]


# Many at once

def check_many(given: Sequence[tuple[str, bytes]], cuts: Sequence[int], **options: object) -> int:
    """Check that messages give the same together and one by one; return their number."""
    return messages.check_many(Feed(**options), Feed(**options), given, INPUTS, cuts)


def stream(number: int, step: int = MS) -> list[tuple[str, bytes]]:
    """Return a stream of turning, moving setpoints, wrenches between them."""
    random = rng()
    found = []
    for n in range(1, number + 1):
        quaternion = random.normal(size=4)
        quaternion *= (1.0 + random.uniform(-9e-4, 9e-4)) / np.linalg.norm(quaternion)
        found += [(POSE, messages.pose(n * step, random.normal(size=3), quaternion)),
                  (TWIST, messages.twist(n * step, random.normal(size=6))),
                  (ACCEL, messages.accel(n * step, random.normal(size=6)))]
        if n % 7 == 0:
            found.append((WRENCH, messages.wrench(n * step, random.normal(size=6))))
    return found


@pytest.mark.parametrize('cuts', [(), (1, 2, 5), tuple(range(0, 300, 7))])
def test_many_in_order_are_what_they_are_one_by_one(cuts: Sequence[int]) -> None:
    assert check_many(stream(100), cuts) == 100
    assert check_many([(topic, data) for topic, data in stream(100) if topic == POSE], cuts,
                      source='pose') == 100
    assert check_many(stream(100), cuts, sync_tolerance=1e-4) == 100
    assert check_many([(topic, good(topic, 0)) for _ in range(3) for topic in TOPICS], cuts) == 3


def test_many_of_one_topic_may_come_before_the_others() -> None:
    given = [(topic, data) for of in TOPICS for topic, data in stream(3 * WAITING // 2)
             if topic == of]
    for cuts in ((), (10, 700, 1600, 3100)):
        # of more than WAITING the oldest are dropped
        assert check_many(given, cuts) == WAITING
    assert check_many([(topic, data) for of in TOPICS for topic, data in stream(WAITING)
                       if topic == of], ()) == WAITING


def test_many_combined_are_what_they_are_one_by_one() -> None:
    random = rng()
    given = [(COMBINED, messages.combined(
        n * MS, random.normal(size=3), UPRIGHT, random.normal(size=6), random.normal(size=6),
        names=['élan' if n < 60 else 'a'])) for n in range(1, 100)]
    assert check_many(given, (20, 40, 80), source='combined') == 99


FATES = [*['none'] * 12, 'lost', 'twice', 'late', 'big-endian', *FAULTS, *STAMPS]


@given(st.lists(st.sampled_from(FATES), max_size=90), st.lists(st.integers(0, 90), max_size=6),
       st.randoms(use_true_random=False), st.booleans())
def test_many_of_any_kind_are_what_they_are_one_by_one(
        fates: list[str], cuts: list[int], random: Any, shuffled: bool) -> None:
    given = stream(30)[:len(fates)]
    if shuffled:
        # topics overtake each other, each in its own order
        queues = {topic: [data for of, data in given if of == topic] for topic, _ in given}
        order = [topic for topic, _ in given]
        random.shuffle(order)
        given = [(topic, queues[topic].pop(0)) for topic in order]
    found: list[tuple[str, bytes]] = []
    late: list[tuple[str, bytes]] = []
    for fate, (topic, data) in zip(fates, given, strict=False):
        if fate == 'late':
            late.append((topic, data))
            continue
        if fate == 'big-endian' and topic == POSE:
            data = messages.pose(20 * MS + random.randrange(20 * MS), little_endian=False)
        data = {**FAULTS, **STAMPS}.get(fate, FAULTS['none'])(data)
        found += [(topic, data)] * {'lost': 0, 'twice': 2}.get(fate, 1)
        if late and random.random() < 0.5:
            found.append(late.pop())
    check_many(found, cuts)
