# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The messages as bytes, validated against the serialization of rclpy and of rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import math
import struct
import tracemalloc
from typing import Any

from geometry_msgs.msg import Transform, Twist
from hypothesis import example, given
from hypothesis import strategies as st
from messages import STORE
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from running import Sample, wrench_message
from sensor_msgs.msg import JointState
from snapshot import Snapshot
from std_msgs.msg import Bool, Float64, Float64MultiArray, MultiArrayDimension
from stewart_dynamics.messages.cdr import MALFORMED, MalformedError
from stewart_dynamics.messages.joint_state import JointStateReader, JointStateWriter
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import layout_of, read_message, StampedWriter
from stewart_dynamics.messages.standard import (
    boolean, clock, float64, float64_array, float64_values)
from stewart_dynamics.parameters.tolerances import STAMPS_END
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

PROGRAM = 'stewart_dynamics'

SECOND = 1_000_000_000
LENGTHS = {
    'geometry_msgs/msg/PoseStamped': 7, 'geometry_msgs/msg/TwistStamped': 6,
    'geometry_msgs/msg/AccelStamped': 6, 'geometry_msgs/msg/WrenchStamped': 6,
    'trajectory_msgs/msg/MultiDOFJointTrajectory': 19}
READERS = {kind: partial(read_message, kind) for kind in LENGTHS}
combined = READERS['trajectory_msgs/msg/MultiDOFJointTrajectory']
KINDS = pytest.mark.parametrize('kind', READERS)
ENDIAN = pytest.mark.parametrize('little_endian', [True, False], ids=['little', 'big'])

# A string of CDR can hold anything but a zero.
texts = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=40)
stamps = st.integers(-2 ** 31 * SECOND, 2 ** 31 * SECOND - 1)
sixes = st.tuples(*[st.floats()] * 6)


def message(kind: str, stamp: int, frame: str, values: Sequence[float],
            names: Sequence[str] = ('platform',)) -> Any:
    """Return a real ROS message with these numbers."""
    name, numbers = kind.rpartition('/')[2], tuple(values)
    if name == 'WrenchStamped':
        of: Any = wrench_message(numbers)
    elif name == 'PoseStamped':
        of = Sample(numbers[:3], numbers[3:]).messages(0)['setpoint/pose']
    elif name == 'MultiDOFJointTrajectory':
        of = Sample(numbers[:3], numbers[3:7], numbers[7:13], numbers[13:]).combined(0)
        of.joint_names = list(names)
        of.points[0].time_from_start.sec = 7
    else:
        of = Sample(twist=numbers, accel=numbers).messages(0)[f'setpoint/{name[:5].lower()}']
    of.header.stamp.sec, of.header.stamp.nanosec = divmod(stamp, SECOND)
    of.header.frame_id = frame
    return of


def in_order(data: bytes, kind: str, little_endian: bool) -> bytes:
    """Return the message in either byte order, as rosbags writes it."""
    return bytes(STORE.serialize_cdr(
        STORE.deserialize_cdr(data, kind), kind, little_endian=little_endian))


def same(a: Sequence[float], b: Sequence[float]) -> bool:
    """Return whether these are the same numbers to the bit; any nan is like any other."""
    return len(a) == len(b) and all(
        x == y and math.copysign(1.0, x) == math.copysign(1.0, y) or x != x and y != y
        for x, y in zip(a, b, strict=True))


def valid(kind: str, little_endian: bool = True, frame: str = 'base') -> bytes:
    """Return a message that can be read, without padding behind it."""
    values = [0.5 + n for n in range(LENGTHS[kind])]
    return in_order(
        serialize_message(message(kind, 3 * SECOND + 4, frame, values)), kind, little_endian)


# Reading

@KINDS
@given(st.data())
def test_what_rclpy_writes_is_read(kind: str, data: st.DataObject) -> None:
    stamp, frame = data.draw(stamps), data.draw(texts)
    values = data.draw(st.tuples(*[st.floats()] * LENGTHS[kind]))
    names = data.draw(st.lists(texts, max_size=1))
    written = serialize_message(message(kind, stamp, frame, values, names))
    for order in (written, in_order(written, kind, True), in_order(written, kind, False)):
        read = READERS[kind](order)
        assert read.stamp == stamp
        assert read.frame == frame.encode()
        assert same(read.values, values)


@KINDS
@ENDIAN
def test_every_length_of_frame_id_and_joint_name_is_read(kind: str, little_endian: bool) -> None:
    values = [1.5 + n for n in range(LENGTHS[kind])]
    for length in range(17):
        for frame, names in (('é' * length, ['platform']), ('base', ['é' * length]),
                             ('a' * length, [])):
            data = serialize_message(message(kind, 5, frame, values, names))
            read = READERS[kind](in_order(data, kind, little_endian))
            assert read[:3] == (5, frame.encode(), tuple(values))
            assert READERS[kind](data)[:3] == read[:3]


def test_a_pose_written_by_hand_is_read_in_both_orders() -> None:
    # the layout of DDS-XTypes 1.3, 7.4.3, with nothing but struct
    numbers = (1.0, 2.0, 3.0, 0.5, 0.5, -0.5, 0.5)
    for order, sign in ((0, '>'), (1, '<')):
        data = (bytes([0, order, 0, 0]) + struct.pack(f'{sign}iII5s', -2, 250, 5, b'base\0')
                + b'\xaa' * 7 + struct.pack(f'{sign}7d', *numbers))
        assert read_message('geometry_msgs/msg/PoseStamped', data)[:3] == (
            -2 * SECOND + 250, b'base', numbers)


@KINDS
def test_a_malformed_head_is_rejected(kind: str, snapshot: Snapshot) -> None:
    good = valid(kind)
    assert good[20] == 0  # behind 'base'
    heads = [bytes.fromhex(head) + good[2:] for head in (
        '0002', '0003', '0006', '0007', '000a', '0100', '0101', 'ffff')]
    stamps = [good[:8] + nanosec.to_bytes(4, 'little') + good[12:]
              for nanosec in (SECOND, 2 ** 32 - 1)]
    for data in heads:
        with pytest.raises(MalformedError, match=f'encapsulation {data[:2].hex()} is not plain'):
            READERS[kind](data)
    for data in (*stamps, good[:20] + b'e' + good[21:]):
        with snapshot.raises(MalformedError):
            READERS[kind](data)


@KINDS
@pytest.mark.parametrize('little_endian, frame', [(True, ''), (True, 'base'), (False, 'world')])
def test_a_message_cut_off_anywhere_is_rejected(
        kind: str, little_endian: bool, frame: str) -> None:
    data = valid(kind, little_endian, frame)
    READERS[kind](data)
    for length in range(len(data)):
        with pytest.raises(MalformedError) as error:
            READERS[kind](data[:length])
        assert 'unpack' not in str(error.value) and 'index' not in str(error.value)


@pytest.mark.parametrize(('points', 'parts'), [
    (0, (1, 1, 1)), (2, (1, 1, 1)), (1, (0, 1, 1)), (1, (1, 0, 1)), (1, (1, 1, 0)),
    (1, (2, 1, 1)), (1, (1, 2, 1)), (1, (1, 1, 2)), (1, (1, 0, 0))])
def test_a_combined_setpoint_has_one_of_each(
        points: int, parts: tuple[int, int, int], snapshot: Snapshot) -> None:
    point = MultiDOFJointTrajectoryPoint(
        transforms=[Transform()] * parts[0], velocities=[Twist()] * parts[1],
        accelerations=[Twist()] * parts[2])
    data = serialize_message(MultiDOFJointTrajectory(points=[point] * points))
    with snapshot.raises(MalformedError):
        combined(data)


def test_a_combined_setpoint_has_at_most_one_name(snapshot: Snapshot) -> None:
    kind = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
    data = serialize_message(message(kind, 5, 'base', [0.0] * 19, ['platform', 'other']))
    with snapshot.raises(MalformedError):
        combined(data)


def _survives(data: bytes) -> None:
    """Read bytes as every kind: numbers, or MalformedError, and nothing else."""
    for kind, reader in READERS.items():
        try:
            read = reader(data)
        except MalformedError:
            continue
        assert len(read.values) == LENGTHS[kind]
        assert isinstance(read.stamp, int)
        assert -STAMPS_END <= read.stamp < STAMPS_END
        assert isinstance(read.frame, bytes)


@given(st.binary(max_size=300))
@example(b'')
@example(b'\0')
@example(b'\0\1\0\0' + b'\xff' * 300)
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    _survives(data)
    _survives(b'\0\1\0\0' + data)
    _survives(b'\0\0\0\0' + data)


@KINDS
@given(st.data())
def test_no_corrupted_message_raises_anything_else(kind: str, data: st.DataObject) -> None:
    spoiled = bytearray(valid(kind, data.draw(st.booleans())))
    for at in data.draw(st.lists(st.integers(0, len(spoiled) - 1), min_size=1, max_size=6)):
        spoiled[at] = data.draw(st.integers(0, 255))
    _survives(bytes(spoiled))


@contextmanager
def little_memory() -> Iterator[None]:
    """Assert that the body allocates less than a megabyte."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_huge_counts_take_no_memory() -> None:
    kind = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
    data = valid(kind)
    for at in range(4, len(data) - 4, 4):
        for count in (2 ** 32 - 1, 2 ** 31, len(data), len(data) // 4):
            for layout in ('<I', '>I'):
                spoiled = data[:at] + struct.pack(layout, count) + data[at + 4:]
                with little_memory():
                    _survives(spoiled)
    # as many names as there is room for, all of them empty
    names = struct.pack('<iIIII', 0, 0, 0, 250_000, 0)
    data = b'\0\1\0\0' + names + bytes(1_000_000)
    with little_memory(), pytest.raises(MalformedError):
        combined(data)


def test_many_entries_are_rejected_before_they_are_read(snapshot: Snapshot) -> None:
    many = 13_000_000
    header = b'\0\1\0\0' + struct.pack('<iII4x', 0, 0, 1)
    entries = struct.pack('<I', many) + bytes(8 * many)
    no_name = struct.pack('<I', 0)

    def read_joints(data: bytes) -> None:
        read = JointStateReader(('leg_1',)).read_states(Messages.single('legs', data))
        assert read.last[0] == MALFORMED
        raise MalformedError(read.last[1])

    for read, data in (
            (read_joints, header + entries),
            (read_joints, header + no_name + entries),
            (read_joints, header + 3 * no_name + entries),
            (float64_values, b'\0\1\0\0' + entries),
            (float64_values, b'\0\1\0\0' + 2 * no_name + entries)):
        with little_memory(), snapshot.raises(MalformedError):
            read(data)


def test_long_names_are_cut_in_the_details_of_a_rejection() -> None:
    names = ['x' * 1_000_000, *map(str, range(100))]
    data = serialize_message(JointState(name=names))
    read = JointStateReader(('leg_1',)).read_states(Messages.single('legs', data))
    assert read.last == ('lacks one of the joints', (
        f'leg_1; there are {"x" * 60}, {", ".join(map(str, range(59)))}'))


@KINDS
@given(st.data())
def test_a_layout_writes_the_numbers_that_are_read(kind: str, data: st.DataObject) -> None:
    names = data.draw(st.lists(texts, max_size=1))
    first, second = (serialize_message(message(
        kind, data.draw(stamps), 'base', data.draw(st.tuples(*[st.floats()] * LENGTHS[kind])),
        names)) for _ in range(2))
    expected = READERS[kind](second)
    ends = np.cumsum([count for _, count in expected.parts])[:-1]
    written, = layout_of(kind, first).write(
        [expected.stamp], *np.split(np.array([expected.values]), ends, axis=1))
    read = READERS[kind](written.tobytes())
    assert read[:2] == expected[:2]
    assert same(read.values, expected.values)


@KINDS
@given(st.data())
def test_a_byte_that_differs_is_read_as_rosbags_reads_it(
        kind: str, data: st.DataObject) -> None:
    good = valid(kind, data.draw(st.booleans()))
    spoiled = bytearray(good)
    spoiled[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    try:
        read = READERS[kind](bytes(spoiled))
    except MalformedError:
        return
    try:
        again: Any = STORE.deserialize_cdr(bytes(spoiled), kind)
    except Exception as exc:  # rosbags, not ROS, rejects texts that are not UTF-8
        assert 'utf-8' in str(exc)
        return
    assert read.frame == again.header.frame_id.encode()
    assert read.stamp == again.header.stamp.sec * SECOND + again.header.stamp.nanosec
    assert same(read.values, numbers_of(again))


def numbers_of(read: Any) -> list[float]:
    """Return all doubles of a message that rosbags has read, in their order."""
    if isinstance(read, float):
        return [read]
    if isinstance(read, list):
        return [number for each in read for number in numbers_of(each)]
    return [number for name in getattr(read, '__dataclass_fields__', ())
            for number in numbers_of(getattr(read, name))]


def test_bytes_behind_a_message_are_not_used() -> None:
    for kind, reader in READERS.items():
        good = valid(kind)
        assert reader(good + b'\7' * 9) == reader(good)


@given(st.lists(st.floats(), max_size=8), st.lists(st.tuples(
    texts, *[st.integers(0, 2 ** 32 - 1)] * 2), max_size=3), st.integers(0, 2 ** 32 - 1))
def test_the_numbers_of_an_array_are_read_whatever_its_layout(
        values: list[float], dimensions: list[tuple[str, int, int]], offset: int) -> None:
    of = Float64MultiArray(data=values)
    of.layout.data_offset = offset
    of.layout.dim = [MultiArrayDimension(label=label, size=size, stride=stride)
                     for label, size, stride in dimensions]
    data = serialize_message(of)
    assert same(float64_values(data), values)
    if values:  # rosbags rejects the padding that rclpy leaves after an empty array
        for little_endian in (True, False):
            again = in_order(data, 'std_msgs/msg/Float64MultiArray', little_endian)
            assert same(float64_values(again), values)


@given(st.data())
def test_no_corrupted_array_raises_anything_else(data: st.DataObject) -> None:
    spoiled = bytearray(float64_array((1.0,) * 6))
    for at in data.draw(st.lists(st.integers(0, len(spoiled) - 1), max_size=6)):
        spoiled[at] = data.draw(st.integers(0, 255))
    for bad in (bytes(spoiled), bytes(spoiled[:data.draw(st.integers(0, len(spoiled)))]),
                data.draw(st.binary(max_size=200)), b'\0\1\0\0' + data.draw(st.binary())):
        try:
            assert all(type(number) is float for number in float64_values(bad))
        except MalformedError as exc:
            assert str(exc)
    with pytest.raises(MalformedError, match='not plain CDR'):
        float64_values(b'\1' + float64_array((1.0,) * 6)[1:])


# Writing

@given(sixes)
def test_an_array_is_what_rclpy_writes(values: tuple[float, ...]) -> None:
    data = float64_array(values)
    assert same(deserialize_message(data, Float64MultiArray).data, values)
    assert same(STORE.deserialize_cdr(data, 'std_msgs/msg/Float64MultiArray').data, values)
    if all(value == value for value in values):
        # the gap before the numbers is left as the memory was by rclpy
        ros = serialize_message(Float64MultiArray(data=values))
        assert ros[:16] + ros[20:] == data[:16] + data[20:]


@pytest.mark.parametrize('name', ['PoseStamped', 'TwistStamped', 'AccelStamped'])
@given(st.data())
def test_stamped_numbers_are_what_rosbags_writes(name: str, data: st.DataObject) -> None:
    kind = f'geometry_msgs/msg/{name}'
    stamp, frame = data.draw(stamps), data.draw(texts)
    values = data.draw(st.tuples(*[st.floats(allow_nan=False)] * LENGTHS[kind]))
    written = StampedWriter(frame, LENGTHS[kind]).write(stamp, values)
    assert READERS[kind](written)[:3] == (stamp, frame.encode(), values)
    rclpy_wrote = serialize_message(message(kind, stamp, frame, values))
    assert in_order(rclpy_wrote, kind, True) == written


@given(stamps)
def test_a_clock_is_what_rclpy_writes(stamp: int) -> None:
    data = clock(stamp)
    assert serialize_message(deserialize_message(data, Clock)) == data
    read = deserialize_message(data, Clock).clock
    assert (read.sec, read.nanosec) == divmod(stamp, SECOND)


@given(st.floats(allow_nan=False), st.booleans())
def test_a_number_and_a_truth_value_are_what_rclpy_writes(number: float, truth: bool) -> None:
    assert float64(number) == serialize_message(Float64(data=number))
    assert deserialize_message(float64(number), Float64).data == number
    data = boolean(truth)
    assert serialize_message(Bool(data=truth))[:len(data)] == data  # padded to four bytes
    assert deserialize_message(data, Bool).data is truth
    assert STORE.deserialize_cdr(data, 'std_msgs/msg/Bool').data is truth


@pytest.mark.parametrize(('stamp', 'holds'), [
    (0, True), (-2 ** 31 * SECOND, True), (-2 ** 31 * SECOND - 1, False),
    (2 ** 31 * SECOND - 1, True), (2 ** 31 * SECOND, False), (2 ** 63, False)])
def test_stamps_have_the_seconds_of_32_bits(stamp: int, holds: bool) -> None:
    assert (-STAMPS_END <= stamp < STAMPS_END) is holds
    write: Callable[..., bytes] = JointStateWriter('abcdef').write
    if holds:
        write(stamp, [0.0] * 6, [0.0] * 6, None)
    else:
        with pytest.raises((ValueError, OverflowError)):
            write(stamp, [0.0] * 6, [0.0] * 6, None)
