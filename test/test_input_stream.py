# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages of all layouts and lengths, one by one and in blocks; rules are in setpoint_joining."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import messages
from messages import MS, SECOND
import numpy as np
from referees import rng, ROOT, symmetric_parameters

from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.mechanics.frames.base_motion import row_of_motion, row_of_pose
from stewart_dynamics.setpoints.input_messages import (
    BASE_ACCEL, BASE_POSE, BASE_TWIST, COMBINED, POSE, WRENCH)
from stewart_dynamics.setpoints.output_messages import OutputMessages
from stewart_dynamics.setpoints.rejections import MALFORMED
from stewart_dynamics.setpoints.step import Batch, Step

ANSWERING = {
    name: Parameters.from_yaml(ROOT / 'config' / f'{file}.yaml').replaced(
        {'setpoint.source': 'pose', **more}) for name, file, more in (
            ('telescopic', 'platform', {}),
            ('servos', 'crank_platform', {'servo.angle_at_min': -1.0, 'servo.angle_at_max': 1.0}))}
TOPICS = (POSE, COMBINED, BASE_POSE, BASE_TWIST, BASE_ACCEL, WRENCH)


class Feed(messages.Feed):
    """Setpoints of a source on a base."""

    def __init__(self, source: str = 'pose', base: str = 'fixed') -> None:
        super().__init__(symmetric_parameters().replaced(
            {'setpoint.source': source, 'base.source': base}))


def test_layouts_that_take_turns_are_read_alike() -> None:
    given = [(POSE, messages.pose(n * MS, (0.001 * n, 0.0, 1.1), frame='base' * (n % 2)))
             for n in range(1, 300)]
    feed = Feed()
    rows = [setpoint.motions[0, 0] for topic, data in given
            if (setpoint := feed(topic, data)) is not None]
    assert rows == [0.001 * n for n in range(1, 300)]
    assert messages.check_many(Feed(), Feed(), given, TOPICS, [7, 90]) == 299


def test_messages_of_any_length_are_read() -> None:
    feed = Feed('combined')
    for n, size in enumerate((1, 5000, 3, 60_000, 70_000), 1):
        found = feed(COMBINED, messages.combined(n * MS, names=['a' * size]))
        assert found is not None
        assert found.stamps[0] == n * MS
    given = [(COMBINED, messages.combined(n * MS, names=['a' * size]))
             for n, size in enumerate((1, 5000, 3, 60_000, 70_000), 1)]
    assert messages.check_many(Feed('combined'), Feed('combined'), given, TOPICS, [2]) == 5


def test_empty_messages_are_malformed() -> None:
    feed = Feed(base='pose')
    for topic in (POSE, BASE_POSE, WRENCH) * 2:
        assert feed(topic, b'') is None
        feed(topic, messages.pose(SECOND + len(feed.said) * MS))
    assert [feed.counts[topic, MALFORMED] for topic in (POSE, BASE_POSE, WRENCH)] == [2, 2, 2]
    found = Feed()
    assert not len(found.setpoints.join_messages(
        messages.together([(POSE, b''), (WRENCH, b'')], TOPICS)).stamps)
    assert found.counts == {(POSE, MALFORMED): 1, (WRENCH, MALFORMED): 1}


def test_blocks_of_a_base_may_have_faults_or_none() -> None:
    # 2 s of a base at 100 Hz: half of it regular, half of it with a rejected message
    given = [(topic, messages.pose(n * 10 * MS)) for n in range(1, 201)
             for topic in (BASE_POSE, POSE)]
    given.insert(300, (BASE_POSE, messages.pose(5 * SECOND)[:-5]))
    assert messages.check_many(
        Feed(base='pose'), Feed(base='pose'), given, TOPICS, [200]) == 200


def test_the_motion_of_the_base_is_that_of_the_readable_equations() -> None:
    random = rng()
    feed, gravity = Feed(base='motion'), tuple(symmetric_parameters().gravity.tolist())
    for n in range(1, 20):
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        twist, accel = random.normal(size=(2, 6)).tolist()
        for topic, data in (
                (BASE_POSE, messages.pose(n * MS, (1.0, 2.0, 3.0), quaternion, 'world')),
                (BASE_TWIST, messages.twist(n * MS, twist, 'world')),
                (BASE_ACCEL, messages.accel(n * MS, accel, 'world'))):
            feed(topic, data)
        last = feed.setpoints.base.last
        assert last is not None
        pose = Feed()(POSE, messages.pose(n * MS, (1.0, 2.0, 3.0), quaternion))
        assert pose is not None
        rotation = tuple(pose.motions[0, 3:12].tolist())
        assert last == (n * MS, row_of_motion(
            rotation, tuple(accel[:3]), tuple(twist[3:]), tuple(accel[3:]), gravity))
        at_rest = Feed(base='pose')
        at_rest(BASE_POSE, messages.pose(n * MS, (1.0, 2.0, 3.0), quaternion, 'world'))
        assert at_rest.setpoints.base.last == (n * MS, row_of_pose(rotation, gravity))


def test_possible_errors_of_the_base_are_found_one_by_one_and_in_blocks() -> None:
    given = []
    for n in range(1, 400):
        t, stamp = 0.01 * n, n * 10 * MS
        given += [(BASE_POSE, messages.pose(stamp, (np.sin(t), 0.0, 0.0), frame='world')),
                  (BASE_TWIST, messages.twist(stamp, (3.0 * np.cos(t), 0, 0, 0, 0, 0), 'world')),
                  (BASE_ACCEL, messages.accel(stamp, frame='world'))]
    one, many = Feed(base='motion'), Feed(base='motion')
    assert messages.check_many(one, many, given, TOPICS, [100, 500]) == 0
    found = one.setpoints.possible_errors(ever=True)
    assert BASE_TWIST in {each.topic for each in found}
    assert many.setpoints.possible_errors(ever=True) == found


@given(st.lists(st.tuples(st.integers(-400, 40), st.floats(-0.3, 0.3), st.booleans()),
                min_size=1, max_size=30), st.sampled_from(sorted(ANSWERING)))
def test_answers_in_the_call_that_completes_setpoints_are_those_of_the_step(
        changes: list[tuple[int, float, bool]], name: str) -> None:
    """Setpoints that turn, leave the reach and restart; some are held and answered later."""
    parameters = ANSWERING[name]
    step, written = Step(parameters), OutputMessages(parameters)
    feed, batches, stamp = messages.Feed(parameters), list[Batch](), 40 * SECOND
    published: list[dict[str, bytes]] = []
    feed.setpoints.answer_setpoints(step, written, published.append)
    home = StewartPlatform(parameters).home_pose().position
    for passed, x, held in changes:
        stamp += (passed or 1) * MS
        half = 2.0 * x
        feed.setpoints.hold_answers(held)
        found = feed(POSE, messages.pose(
            stamp, home + [x, 0.0, 3.0 * (x > 0.29)], (0.0, 0.0, np.sin(half), np.cos(half))))
        if found is not None:
            batches.append(found)
            if held:
                feed.setpoints.answer_setpoint(found)
    if not batches:
        return
    outputs = step(Batch.joined(batches))
    expected: list[dict[str, bytes]] = [{} for _ in outputs.stamps]
    for topic, having, made in written.write_outputs(outputs):
        for n in np.flatnonzero(having).tolist():
            expected[n][topic] = made[n].tobytes()
    assert published == expected
    assert feed.setpoints.last_outputs().state.tobytes() == outputs.state.tobytes()
