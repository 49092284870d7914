# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""JointState messages: written as rclpy writes them, and read alike one by one and at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st
from messages import STORE
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from stewart_dynamics.messages.joint_state import FIELDS, JointStateReader, JointStateWriter
from stewart_dynamics.messages.recorded import Messages
from test_cdr import same, SECOND, sixes, stamps, texts
from test_recorded_efforts import joined, joint_state, JOINTS

# Writing


def significant(data: bytes, names: Sequence[str], numbers: int) -> list[bytes]:
    """Return the fields of a JointState's bytes, without the padding between them."""
    at = 4
    fields = [data[:4]]

    def take(size: int, align: int) -> None:
        nonlocal at
        at += -(at - 4) % align
        fields.append(data[at:at + size])
        assert len(fields[-1]) == size
        at += size

    take(4, 4)
    take(4, 4)
    for text in (b'', None, *(name.encode() for name in names)):
        take(4, 4)
        if text is not None:
            take(len(text) + 1, 1)
    for number in (6, 6, numbers):
        take(4, 4)
        for _ in range(number):
            take(8, 8)
    assert len(data) - at < 8
    return fields


@given(stamps, st.lists(texts, min_size=6, max_size=6), sixes, sixes, st.none() | sixes)
def test_a_joint_state_is_what_rclpy_and_rosbags_write(
        stamp: int, names: list[str], position: tuple[float, ...], velocity: tuple[float, ...],
        effort: tuple[float, ...] | None) -> None:
    data = JointStateWriter(names).write(stamp, position, velocity, effort)

    by_rclpy = deserialize_message(data, JointState)
    by_rosbags = STORE.deserialize_cdr(data, 'sensor_msgs/msg/JointState')
    for read in (by_rclpy, by_rosbags):
        assert (read.header.stamp.sec, read.header.stamp.nanosec) == divmod(stamp, SECOND)
        assert read.header.frame_id == ''
        assert list(read.name) == names
        assert same(read.position, position)
        assert same(read.velocity, velocity)
        assert same(read.effort, effort or ())

    # rosbags writes zeros into the gaps, as we do; rclpy leaves in them, and behind an empty
    # effort, what the memory held before
    if all(value == value for value in (*position, *velocity, *(effort or ()))):
        again = bytes(STORE.serialize_cdr(by_rosbags, 'sensor_msgs/msg/JointState'))
        assert again[:len(data)] == data
        assert not any(again[len(data):])
        ros = serialize_message(by_rclpy)
        numbers = 0 if effort is None else 6
        assert significant(ros, names, numbers) == significant(data, names, numbers)


def test_names_of_every_length_are_written() -> None:
    numbers = (1.5, -2.5, 3.5, -4.5, 5.5, -6.5)
    for letter in ('a', 'é', '漢'):
        for length in range(33):
            names = [letter * (length + n) for n in range(6)]
            for effort in (numbers, None):
                data = JointStateWriter(names).write(7, numbers, numbers, effort)
                read = deserialize_message(data, JointState)
                assert list(read.name) == names
                assert tuple(read.position) == tuple(read.velocity) == numbers
                assert tuple(read.effort) == (effort or ())


# Reading

def one_by_one(reader: JointStateReader, messages: Sequence[bytes],
               ) -> tuple[list[int], list[tuple[float, ...]], dict[str, int]]:
    """Return stamps and values of messages, and how many were rejected, by reason."""
    found, values, rejected = [], [], Counter[str]()
    for data in messages:
        read = reader.read_states(Messages.single('legs', data))
        assert len(read.stamps) + sum(read.rejected.values()) == 1
        assert {read.last[0]} == set(read.rejected) or read.last == ('', '')
        found += read.stamps.tolist()
        values += [*map(tuple, read.values.tolist())]
        rejected.update(read.rejected)
    return found, values, dict(rejected)


@given(st.data(), st.lists(st.sampled_from(FIELDS), min_size=1, max_size=3, unique=True))
def test_many_are_what_they_are_one_by_one(data: st.DataObject, fields: list[str]) -> None:
    """Messages of any layouts, some of them corrupted; readers have read others before."""
    messages = []
    for _ in range(data.draw(st.integers(0, 12))):
        names = data.draw(st.permutations(data.draw(st.sampled_from(
            [JOINTS, [*JOINTS, 'gripper'], JOINTS[:5], ['gripper']]))))
        counts = [data.draw(st.sampled_from([len(names)] * 4 + [0, 5])) for _ in range(3)]
        effort = data.draw(st.lists(st.floats(), min_size=counts[2], max_size=counts[2]))
        message = joint_state(data.draw(stamps), names, effort, data.draw(st.sampled_from(
            ['', 'base'])), *counts[:2], data.draw(st.booleans()))
        if data.draw(st.integers(0, 4)) == 0:
            spoiled = bytearray(message)
            spoiled[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
            message = bytes(spoiled[:data.draw(st.integers(0, len(message)))])
        messages += [message] * data.draw(st.integers(1, 3))
    one, many = JointStateReader(JOINTS, fields), JointStateReader(JOINTS, fields)
    for cut in (0, len(messages) // 2):
        found, values, rejected = one_by_one(one, messages[cut:])
        read = many.read_states(joined(messages[cut:]))
        assert read.stamps.tolist() == found
        assert list(map(tuple, read.values.tolist())) == values
        assert read.values.shape == (len(found), 6 * len(fields))
        assert read.rejected == rejected


@pytest.mark.parametrize('fields', [['effort'], ['effort', 'position'], list(FIELDS)])
def test_values_are_field_by_field_in_the_order_of_the_joints(fields: list[str]) -> None:
    names = [*reversed(JOINTS), 'gripper']
    given = {'position': np.arange(7.0), 'velocity': np.arange(7.0),
             'effort': 100.0 + np.arange(7)}
    data = joint_state(7, names, given['effort'].tolist(), positions=7, velocities=7)
    expected = tuple(number for field in fields for number in given[field][5::-1].tolist())
    for _ in range(2):
        read = JointStateReader(JOINTS, fields).read_states(joined([data]))
        assert (read.stamps.tolist(), read.values.tolist()) == ([7], [[*expected]])


def test_only_fields_that_are_wanted_must_be_there() -> None:
    data = joint_state(7, JOINTS, range(6), positions=6)
    read = JointStateReader(JOINTS, ['position', 'effort']).read_states(joined([data]))
    assert read.stamps.tolist() == [7]
    assert JointStateReader(JOINTS).read_states(joined([data])).last == (
        'without velocity', '6 names')
