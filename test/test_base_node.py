# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The node on a base that moves, over real topics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any

from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped, WrenchStamped
import messages
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from running import DynamicsNode, nanoseconds, NODE, Sample
from sensor_msgs.msg import Imu, JointState
from stewart_dynamics import BaseMotion, StewartPlatform
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.input_messages import (
    BASE_ACCEL, BASE_IMU, BASE_POSE, BASE_SOURCES, BASE_TWIST)
from stewart_dynamics.setpoints.rejections import (
    MALFORMED, NOT_FINITE, NOT_MEASURED, NOT_UNIT, Rejections, WRONG_FRAME)
from test_base_input import BAD, sample

Start = Callable[..., DynamicsNode]

OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))
MS = 1_000_000
KINDS: dict[str, Any] = {
    BASE_POSE: PoseStamped, BASE_TWIST: TwistStamped, BASE_ACCEL: AccelStamped, BASE_IMU: Imu}
MOVING = Sample((0.1, -0.05, 1.15), (0.0, 0.0, 0.06, 0.9981983770774224),
                (0.2, 0.1, -0.3, 0.4, -0.5, 0.6), (1.0, -2.0, 0.5, 2.0, 1.0, -3.0))


class OnBase:
    """A node whose base moves, and the same messages taken here."""

    def __init__(self, begin: Start, source: str, timeout: float = 0.1, *others: str) -> None:
        self.node = begin(f'base.source:={source}', f'base.timeout:={timeout}', *others)
        self.topics = BASE_SOURCES[source]
        self._writers = {topic: self.node.peer.writer(f'{NODE}/{topic}', KINDS[topic])
                         for topic in self.topics}
        self.wrenches = self.node.peer.listen(f'{NODE}/base_wrench', WrenchStamped)
        parameters = self.node.platform.parameters.replaced({
            'base.source': source, 'base.timeout': timeout})
        self.base = BaseInput(parameters, Rejections(lambda *why: None), lambda text: None)
        self.samples = 0
        self.node.until_active()
        self.node.until(lambda: all(
            writer.get_subscription_count() for writer in self._writers.values()),
            'the node hears the base')

    def publish(self, given: Sequence[tuple[str, bytes]]) -> None:
        """Publish messages, and take them here as well."""
        for topic, data in given:
            self._writers[topic].publish(data)
            self.samples += self.base.join_message(topic, data, lambda: 0)

    def send(self, stamp: int, mark: float = 0.0) -> None:
        """Publish a sample of the base, and wait until the node has it."""
        self.publish(sample(self.topics, stamp, mark))
        self.until_sampled()

    def until_sampled(self) -> None:
        """Wait until the node has all samples so far."""
        self.node.until(lambda: self.node.values('base').get('samples') == str(self.samples),
                        'the base is sampled')

    def until_status(self, level: bytes, text: str) -> None:
        """Wait until the diagnostics of the base have a level and a text."""
        self.node.until_status('base', level, text)

    def until_counted(self, key: str) -> None:
        """Wait until the diagnostics of the base have a key."""
        self.node.until(lambda: key in self.node.values('base'), f'{key} is counted')

    def answer(self, stamp: int) -> JointState:
        """Check that a moving setpoint is answered with the library's bits."""
        self.node.send(MOVING, stamp)
        state = self.node.state_of(stamp)
        row = self.base.at(stamp)
        assert row is not None
        known = not math.isnan(row[0])
        result = self.node.platform.inverse_dynamics(
            MOVING.motion(), base=BaseMotion.of_rows(np.array(row)) if known else None)
        if known:
            self.node.check(state, result)
        else:
            assert not len(state.effort)
            assert list(state.position) == (
                result.lengths - self.node.platform.parameters['geometry.zero_length']).tolist()
        return state


@pytest.mark.parametrize('source', ['pose', 'motion', 'imu'])
def test_answers_are_the_bits_of_the_library(fresh: Start, source: str) -> None:
    on = OnBase(fresh, source, 0.25)
    stamp = on.node.stamp()
    on.send(stamp, 0.1)
    on.answer(stamp)
    on.send(stamp + 5 * MS, 0.3)
    for after in (6, 8, 10, 20, 200):
        on.answer(stamp + after * MS)
    on.answer(stamp + 300 * MS)  # 295 ms after the last sample
    on.until_status(ERROR, 'no forces')
    on.send(stamp + 301 * MS, 0.5)
    on.answer(stamp + 302 * MS)


def test_the_base_wrench_has_the_bits_of_the_library(fresh: Start) -> None:
    on = OnBase(fresh, 'motion')
    stamp = on.node.stamp()
    on.send(stamp)

    def published() -> bool:
        at = on.node.stamp()
        on.publish(sample(on.topics, at, 0.2))
        on.node.send(MOVING, at)
        on.node.peer.spin()
        return bool(on.wrenches)

    on.node.until(published, 'the base wrench comes')
    message = deserialize_message(on.wrenches[-1], WrenchStamped)
    row = on.base.at(nanoseconds(message.header.stamp))
    assert row is not None
    found = [message.wrench.force.x, message.wrench.force.y, message.wrench.force.z,
             message.wrench.torque.x, message.wrench.torque.y, message.wrench.torque.z]
    assert message.header.frame_id == 'base'
    # Which of two samples the node had by then is not known.
    truths = [on.node.platform.base_wrench(
        MOVING.motion(), base=BaseMotion.of_rows(np.array(each))).tolist()
        for each in (row, on.base.last[1] if on.base.last else row)]
    assert found in truths


def test_without_the_base_there_are_lengths_and_no_forces(fresh: Start) -> None:
    on = OnBase(fresh, 'imu')
    stamp = on.node.stamp()
    state = on.answer(stamp)
    assert not len(state.effort)
    assert not on.node.raw['leg_forces']
    on.node.until(lambda: on.node.warning is False, 'the warning is published')
    on.until_status(ERROR, 'no forces: base/imu never came')
    on.send(stamp + MS)
    on.answer(stamp + 2 * MS)
    assert len(on.node.raw['leg_forces']) == 1
    on.until_status(ERROR, 'no forces: base/imu silent for')
    on.node.until_said('base: no forces: base/imu')


def test_invalid_base_samples_are_rejected_and_counted(fresh: Start) -> None:
    for source, topics in BASE_SOURCES.items():
        # The middleware pads truncated messages.
        bad = [each for each in BAD
               if each[0] in topics and source != 'pose' and each[2] != MALFORMED]
        if not bad:
            continue
        on = OnBase(fresh, source, 100.0)
        stamp = on.node.stamp()
        on.send(stamp)
        for topic, make, reason in bad:
            on.publish([(topic, make(stamp + MS))])
            on.until_counted(f'rejected, {topic}: {reason}')
        assert on.node.status('base').level in (OK, WARN)
        on.answer(stamp + 2 * MS)
        on.send(stamp + 3 * MS)
        on.answer(stamp + 4 * MS)
        on.node.check_finite()
        assert {NOT_FINITE, WRONG_FRAME} < {reason for _, _, reason in bad}
        assert (NOT_MEASURED if source == 'imu' else NOT_UNIT) in {why for _, _, why in bad}


@pytest.mark.parametrize('rate', [50, 1000])
def test_a_stream_at_any_rate_is_followed(fresh: Start, rate: int) -> None:
    """A base that sways and rolls, setpoints at 1 kHz: all forces are near those of the truth."""
    on = OnBase(fresh, 'motion')
    begin, platform = on.node.stamp(), on.node.platform

    def of(t: float) -> tuple[Any, Any, Any]:
        w = 2.0 * math.pi * 0.4
        angle, rate_, acceleration = (0.2 * each for each in (
            math.sin(w * t), w * math.cos(w * t), -w * w * math.sin(w * t)))
        return ((0.0, 0.0, 0.0, math.sin(angle / 2.0), 0.0, 0.0, math.cos(angle / 2.0)),
                (0.0, 0.0, 0.0, rate_, 0.0, 0.0),
                (5.0 * acceleration, 0.0, 0.0, acceleration, 0.0, 0.0))

    def truth(t: float) -> Any:
        pose, twist, accel = of(t)
        base = BaseInput(platform.parameters.replaced({'base.source': 'motion'}),
                         Rejections(lambda *why: None), lambda text: None)
        for topic, data in given(t, pose, twist, accel):
            base.join_message(topic, data, lambda: 0)
        assert base.last is not None
        return platform.inverse_dynamics(
            MOVING.motion(), base=BaseMotion.of_rows(np.array(base.last[1]))).forces

    def given(t: float, pose: Any, twist: Any, accel: Any) -> list[tuple[str, bytes]]:
        at = begin + round(t * 1e9)
        return [(BASE_POSE, messages.pose(at, pose[:3], pose[3:], 'world')),
                (BASE_TWIST, messages.twist(at, twist, 'world')),
                (BASE_ACCEL, messages.accel(at, accel, 'world'))]

    every = 1000 // rate
    stamps: list[int] = []
    for n in range(300):
        if n % 20 == 0:  # more at once could be dropped
            on.node.until(lambda: len(on.node.received('leg_states')) == len(stamps),
                          'all are answered')
        if n % every == 0:
            on.publish(given(n * 1e-3, *of(n * 1e-3)))
        stamps.append(on.node.send(MOVING, begin + n * MS))
    on.node.until(lambda: len(on.node.received('leg_states')) == 300, 'all are answered')
    states = {nanoseconds(each.header.stamp): each for each in on.node.received('leg_states')}
    largest, worst, known = 0.0, 0.0, 0
    for n, stamp in enumerate(stamps):
        if not len(states[stamp].effort):
            continue
        known += 1
        forces = truth(n * 1e-3)
        largest = max(largest, np.abs(forces).max())
        worst = max(worst, np.abs(np.array(states[stamp].effort) - forces).max())
    assert known > 200
    still = StewartPlatform(platform.parameters).inverse_dynamics(MOVING.motion()).forces
    assert worst < 0.05 * np.abs(truth(0.6) - still).max() or worst < 0.02 * largest
