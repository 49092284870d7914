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

"""
The messages of the hot path as bytes: setpoints in, outputs out.

ROS 2 sends messages as XCDR1 ("plain CDR"): four bytes that tell the byte order, then the
fields, each aligned to its own size (OMG DDS-XTypes 1.3, 7.4.3). Reading and writing these
few layouts here costs a tenth of what rclpy's typed messages cost, needs no ROS, and is what
node and replay have in common: the same bytes in, the same bytes out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import math
from operator import itemgetter
from struct import error as StructError
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Bytes, Integers

LITTLE_ENDIAN = b'\x00\x01\x00\x00'
# A builtin_interfaces/Time holds stamps below it [ns].
STAMPS_END = 2 ** 31 * 1_000_000_000

_TIME_AND_LENGTH = {0: Struct('>iII'), 1: Struct('<iII')}
_SIX = {0: Struct('>6d'), 1: Struct('<6d')}
_SEVEN = {0: Struct('>7d'), 1: Struct('<7d')}
_COUNT = {0: Struct('>I'), 1: Struct('<I')}
_DURATION = {0: Struct('>iI'), 1: Struct('<iI')}


class MalformedError(ValueError):
    """Bytes that are no message of the type they are taken for."""


class Stamped(NamedTuple):
    """A message with a header: its stamp, its frame and its numbers."""

    stamp: int
    """[ns]"""
    frame: bytes
    values: tuple[float, ...]


def _aligned8(offset: int) -> int:
    """Return the next offset at which a double may stand; the first stands at 4."""
    return (offset + 3 & ~7) + 4


def _stamped(data: bytes, numbers: dict[int, Struct]) -> Stamped:
    try:
        order = data[1]
        sec, nanosec, size = _TIME_AND_LENGTH[order].unpack_from(data, 4)
        end = 16 + size
        values = numbers[order].unpack_from(data, _aligned8(end))
    except (IndexError, KeyError, StructError) as exc:
        raise MalformedError(f'{len(data)} bytes: {exc}') from exc
    return Stamped(_nanoseconds(data, sec, nanosec), _text(data, 16, size), values)


def _nanoseconds(data: bytes, sec: int, nanosec: int) -> int:
    if data[0] != 0:
        raise MalformedError(f'encapsulation {data[:2].hex()} is not plain CDR')
    if nanosec >= 1_000_000_000:
        raise MalformedError(f'stamp of {nanosec} ns: must be under 1000000000')
    return int(sec) * 1_000_000_000 + int(nanosec)


def _text(data: bytes, start: int, size: int) -> bytes:
    if size == 0:
        return b''
    if start + size > len(data) or data[start + size - 1] != 0:
        raise MalformedError('a string does not end in a zero byte')
    return data[start:start + size - 1]


def pose(data: bytes) -> Stamped:
    """Read a geometry_msgs/PoseStamped: x y z and the quaternion's x y z w."""
    return _stamped(data, _SEVEN)


def twist(data: bytes) -> Stamped:
    """Read a geometry_msgs/TwistStamped or AccelStamped: linear and angular x y z."""
    return _stamped(data, _SIX)


def wrench(data: bytes) -> Stamped:
    """Read a geometry_msgs/WrenchStamped: force and torque x y z."""
    return _stamped(data, _SIX)


def combined(data: bytes) -> Stamped:
    """
    Read a trajectory_msgs/MultiDOFJointTrajectory of one point and one joint.

    The 19 values are position, quaternion x y z w, twist and acceleration.
    """
    try:
        order = data[1]
        sec, nanosec, size = _TIME_AND_LENGTH[order].unpack_from(data, 4)
        values: tuple[float, ...] = ()
        for at, layout in zip(_combined_numbers(data), (_SEVEN, _SIX, _SIX), strict=True):
            values += layout[order].unpack_from(data, at)
        # time_from_start: not used, but it must be there
        _DURATION[order].unpack_from(data, at + layout[order].size)
    except (IndexError, KeyError, StructError) as exc:
        raise MalformedError(f'{len(data)} bytes: {exc}') from exc
    return Stamped(_nanoseconds(data, sec, nanosec), _text(data, 16, size), values)


def _points(data: bytes, gaps: list[slice]) -> tuple[int, int]:
    """Return how many points a MultiDOFJointTrajectory of one joint has, where they begin."""
    count = _COUNT[data[1]]
    size = count.unpack_from(data, 12)[0]
    names, at = _sequence(data, 16 + size, count, gaps)
    if names > 1:
        raise MalformedError(f'{names} joint_names: a setpoint has one')
    for _ in range(names):
        length, at = _sequence(data, at, count, gaps)
        at += length
    return _sequence(data, at, count, gaps)


def _combined_numbers(data: bytes, gaps: list[slice] | None = None) -> list[int]:
    """Return where transform, velocity and acceleration begin; note what only aligns."""
    gaps = [] if gaps is None else gaps
    count = _COUNT[data[1]]
    points, at = _points(data, gaps)
    if points != 1:
        raise MalformedError(f'{points} points: a setpoint has one')
    found = []
    for name, layout in (('transforms', _SEVEN), ('velocities', _SIX), ('accelerations', _SIX)):
        number, at = _sequence(data, at, count, gaps)
        if number != 1:
            raise MalformedError(f'{number} {name}: a setpoint has one')
        found.append(_aligned8(at))
        gaps.append(slice(at, found[-1]))
        at = found[-1] + layout[data[1]].size
    return found


def _sequence(data: bytes, at: int, count: Struct, gaps: list[slice]) -> tuple[int, int]:
    """Return a sequence's length, and where its first entry begins."""
    begin = at + 3 & ~3
    gaps.append(slice(at, begin))
    number = count.unpack_from(data, begin)[0]
    if number > len(data):
        raise MalformedError(f'a sequence of {number} in {len(data)} bytes')
    return number, begin + 4


def float64_values(data: bytes) -> tuple[float, ...]:
    """Read a std_msgs/Float64MultiArray: its numbers, whatever layout it claims."""
    try:
        order = data[1]
        count = _COUNT[order]
        dimensions, at = _sequence(data, 4, count, [])
        for _ in range(dimensions):
            size, at = _sequence(data, at, count, [])
            at = (at + size + 3 & ~3) + 8
        # data_offset comes before the numbers
        number, at = _sequence(data, (at + 3 & ~3) + 4, count, [])
        values: tuple[float, ...] = Struct(f'{"<" if order else ">"}{number}d').unpack_from(
            data, _aligned8(at) if number else at)
    except (IndexError, KeyError, StructError) as exc:
        raise MalformedError(f'{len(data)} bytes: {exc}') from exc
    if data[0] != 0:
        raise MalformedError(f'encapsulation {data[:2].hex()} is not plain CDR')
    return values


class JointStateFields(NamedTuple):
    """Stamp and names of a sensor_msgs/JointState, and where its numbers stand in its bytes."""

    stamp: int
    """[ns]"""
    names: list[str]
    numbers: tuple[tuple[int, int], ...]
    """Of position, velocity and effort: offset and count."""
    gaps: tuple[slice, ...]
    """Bytes that only align what follows, and those behind the message: they may be anything."""


def joint_state_fields(data: bytes) -> JointStateFields:
    """Read all of a sensor_msgs/JointState but its numbers; its frame_id may be any."""
    gaps: list[slice] = []
    names, numbers = [], []
    try:
        count = _COUNT[data[1]]
        sec, nanosec, size = _TIME_AND_LENGTH[data[1]].unpack_from(data, 4)
        stamp = _nanoseconds(data, sec, nanosec)
        _text(data, 16, size)
        number, at = _sequence(data, 16 + size, count, gaps)
        for _ in range(number):
            size, at = _sequence(data, at, count, gaps)
            names.append(_text(data, at, size).decode(errors='replace'))
            at += size
        for _ in range(3):
            number, end = _sequence(data, at, count, gaps)
            # An empty sequence has nothing to align.
            at = _aligned8(end) if number else end
            gaps.append(slice(end, at))
            numbers.append((at, number))
            at += 8 * number
    except (IndexError, KeyError, StructError) as exc:
        raise MalformedError(f'{len(data)} bytes: {exc}') from exc
    if at > len(data):
        raise MalformedError(f'{len(data)} bytes: must be at least {at}')
    return JointStateFields(stamp, names, tuple(numbers), (*gaps, slice(at, len(data))))


_FLOAT64 = Struct('<4sd')
_CLOCK = Struct('<4siI')
_BOOL = Struct('<4s?')
# an empty layout's two numbers, the number of entries, and what aligns them
_FLOAT64_ARRAY = Struct('<4sIII4x6d')
_ZEROS = (0.0,) * 6


def float64(value: float) -> bytes:
    """Write a std_msgs/Float64."""
    return _FLOAT64.pack(LITTLE_ENDIAN, value)


def boolean(value: bool) -> bytes:
    """Write a std_msgs/Bool."""
    return _BOOL.pack(LITTLE_ENDIAN, value)


def clock(stamp: int) -> bytes:
    """Write a rosgraph_msgs/Clock of a time [ns]."""
    return _CLOCK.pack(LITTLE_ENDIAN, *divmod(stamp, 1_000_000_000))


def float64_array(values: Sequence[float]) -> bytes:
    """Write six numbers as a std_msgs/Float64MultiArray without a layout."""
    return _FLOAT64_ARRAY.pack(LITTLE_ENDIAN, 0, 0, 6, *values)


def diagnostics(
        stamp: int,
        statuses: Sequence[tuple[int, tuple[str, str, str], Sequence[tuple[str, str]]]],
) -> bytes:
    """
    Write a diagnostic_msgs/DiagnosticArray; frame_id is empty.

    Parameters
    ----------
    stamp : int
        [ns]
    statuses : sequence of (level, (name, message, hardware_id), keys and values)
        In their order.

    """
    body = bytearray(_TIME_AND_LENGTH[1].pack(*divmod(stamp, 1_000_000_000), 1) + b'\x00')
    _put_count(body, len(statuses))
    for level, texts, values in statuses:
        body.append(level)
        for text in texts:
            _put_text(body, text)
        _put_count(body, len(values))
        for key, value in values:
            _put_text(body, key)
            _put_text(body, value)
    return LITTLE_ENDIAN + bytes(body)


def _put_count(body: bytearray, number: int) -> None:
    body += bytes(-len(body) % 4) + _COUNT[1].pack(number)


def _put_text(body: bytearray, text: str) -> None:
    encoded = text.encode() + b'\x00'
    _put_count(body, len(encoded))
    body += encoded


class Numbers:
    """Writes PoseStamped (7 numbers), TwistStamped or AccelStamped (6) of geometry_msgs."""

    def __init__(self, frame: str, number: int) -> None:
        self._frame = frame.encode() + b'\x00'
        size = len(self._frame)
        self._whole = Struct(f'<4siII{size}s{_aligned8(16 + size) - 16 - size}x{number}d')

    def write(self, stamp: int, values: Sequence[float]) -> bytes:
        """Return the message."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        return self._whole.pack(
            LITTLE_ENDIAN, sec, nanosec, len(self._frame), self._frame, *values)


class JointState:
    """
    Writes sensor_msgs/JointState of six joints with these names; frame_id is empty.

    All but stamp and numbers is the same in every message and made once.
    """

    def __init__(self, names: Sequence[str]) -> None:
        head = '<4siII1s'  # encapsulation, stamp, the empty frame_id and its zero byte
        constant: list[object] = [1, b'\x00']
        size = 13
        for text in [None, *names]:
            head += f'{-size % 4}x'
            size += -size % 4
            if text is None:
                head, size = head + 'I', size + 4
                constant.append(6)
            else:
                encoded = text.encode() + b'\x00'
                head, size = head + f'I{len(encoded)}s', size + 4 + len(encoded)
                constant += [len(encoded), encoded]
        first = f'{-size % 4}xI'
        size += -size % 4 + 4
        doubles = f'{-size % 8}x6d'
        at = 4 + size + -size % 8
        # Each later count stands where doubles end, so that four bytes align what follows.
        self._numbers = [(at, 6), (at + 56, 6), (at + 112, 6)]
        self._whole = Struct(f'{head}{first}{doubles}I4x6dI4x6d')
        self._without_effort = Struct(f'{head}{first}{doubles}I4x6dI')
        self._constant = tuple(constant)

    def write(self, stamp: int, position: Iterable[float], velocity: Sequence[float],
              effort: Sequence[float] | None) -> bytes:
        """Return the message; its effort is empty where there is none."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        if effort is None:
            return self._without_effort.pack(
                LITTLE_ENDIAN, sec, nanosec, *self._constant, 6, *position, 6, *velocity, 0)
        return self._whole.pack(LITTLE_ENDIAN, sec, nanosec, *self._constant, 6, *position,
                                6, *velocity, 6, *effort)

    def layout(self, effort: bool) -> Layout:
        """Return the layout of the messages with or without effort."""
        numbers = self._numbers if effort else self._numbers[:2]
        return Layout(self.write(0, _ZEROS, _ZEROS, _ZEROS if effort else None), numbers)


class Layout:
    """
    Messages that differ in nothing but their stamp and numbers.

    Parameters
    ----------
    message : bytes
        One of them, little-endian.
    numbers : sequence of (offset, count)
        Where doubles stand in it.
    stamped : bool
        It has a header.
    gaps : sequence of slice
        Bytes that only align what follows: they may be anything.

    """

    def __init__(
            self, message: bytes, numbers: Sequence[tuple[int, int]], stamped: bool = True,
            gaps: Sequence[slice] = (),
    ) -> None:
        self.size = len(message)
        self._message = message
        free = np.zeros(self.size, dtype=bool)
        fields: dict[str, tuple[Any, int]] = {}
        if stamped:
            free[4:12] = True
            fields = {'sec': ('<i4', 4), 'nanosec': ('<u4', 8)}
        self._parts = []
        for at, count in numbers:
            free[at:at + 8 * count] = True
            fields[f'numbers at {at}'] = (('<f8', (count,)), at)
            self._parts.append(f'numbers at {at}')
        for gap in gaps:
            free[gap] = True
        # What all have in common, in runs of bytes: what it is called, and what it is.
        edges = np.flatnonzero(np.diff(free, prepend=True, append=True)).tolist()
        self._fixed = {}
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            fields[f'fixed at {begin}'] = (f'V{end - begin}', begin)
            self._fixed[f'fixed at {begin}'] = np.void(message[begin:end])
        self.dtype = np.dtype({
            'names': list(fields), 'formats': [kind for kind, _ in fields.values()],
            'offsets': [at for _, at in fields.values()], 'itemsize': self.size})

        # The same for a single message: what has a place in it, in order.
        places = sorted([
            *((begin, f'{end - begin}s') for begin, end in zip(
                edges[::2], edges[1::2], strict=True)),
            *((at, f'{count}d') for at, count in numbers), *([(4, 'iI')] if stamped else [])])
        layout, constant, values, many = '<', list[int](), list[int](), 0
        for at, place in places:
            layout += f'{at - Struct(layout).size}x{place}'
            if place[-1] == 's':
                constant.append(many)
            elif place[-1] == 'd':
                values += range(many, many + int(place[:-1]))
            many = len(Struct(layout).unpack(bytes(Struct(layout).size)))
        self._struct = Struct(f'{layout}{self.size - Struct(layout).size}x')
        self._values, self._constant = itemgetter(*values), itemgetter(*constant)
        self._expected = self._constant(self._struct.unpack(message))

    @classmethod
    def of(cls, topic_reader: Callable[[bytes], Stamped], message: bytes) -> Layout | None:
        """Return the layout of a message that its reader has read; none if big-endian."""
        if message[:2] != LITTLE_ENDIAN[:2]:
            return None
        if topic_reader is combined:
            gaps: list[slice] = []
            numbers = zip(_combined_numbers(message, gaps), (7, 6, 6), strict=True)
            return cls(message, list(numbers), gaps=gaps)
        end = 16 + _COUNT[1].unpack_from(message, 12)[0]
        at = _aligned8(end)
        return cls(message, [(at, 7 if topic_reader is pose else 6)], gaps=[slice(end, at)])

    def read_one(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return stamp [ns] and numbers of a message with a stamp; None if of another layout."""
        if len(data) != self.size:
            return None
        fields = self._struct.unpack(data)
        if fields[2] >= 1_000_000_000 or self._constant(fields) != self._expected:
            return None
        return fields[1] * 1_000_000_000 + fields[2], self._values(fields)

    def read(
            self, data: Bytes, starts: Integers,
    ) -> tuple[Integers, Array] | None:
        """
        Return stamps (N,) [ns] and numbers (N, ...) of messages; None if one has another layout.

        Parameters
        ----------
        data : (M,)
            Bytes that have all the messages in them.
        starts : (N,)
            Where each begins; each is of ``size``.

        """
        rows = at_any_byte(data, self.size)[starts].view(self.dtype)
        stamps = rows['sec'] * np.int64(1_000_000_000) + rows['nanosec']
        alike = bool((rows['nanosec'] < 1_000_000_000).all()) and all(
            bool((rows[name] == fixed).all()) for name, fixed in self._fixed.items())
        if not alike:
            return None
        return stamps, np.concatenate([rows[name] for name in self._parts], axis=1)

    def write(self, stamps: Integers | None, *numbers: Array,
              ) -> NDArray[np.void]:
        """Return messages (N,), each an entry of ``size`` bytes."""
        rows = np.empty(len(numbers[0]), dtype=self.dtype)
        rows.view(np.uint8).reshape(-1, self.size)[:] = np.frombuffer(self._message, np.uint8)
        if stamps is not None:
            rows['sec'], rows['nanosec'] = np.divmod(stamps, 1_000_000_000)
        for name, values in zip(self._parts, numbers, strict=True):
            rows[name] = values
        return rows.view(f'V{self.size}')


FLOAT64_ARRAY = Layout(float64_array(_ZEROS), [(20, 6)], stamped=False)
FLOAT64 = Layout(float64(0.0), [(4, 1)], stamped=False)


def at_any_byte(data: Bytes, size: int) -> NDArray[np.void]:
    """
    Return the entries of a size that begin at each of the bytes; they share its memory.

    They have no fields: numpy copies entries that have some field by field, far more slowly.
    """
    many = max(data.size - size + 1, 0)
    return np.ndarray((many,), f'V{size}', data.data, strides=(1,))


def finite(values: Sequence[float]) -> bool:
    """Return whether all numbers are finite."""
    # A sum is not finite where one of its terms is not; it may also overflow.
    return math.isfinite(sum(values)) or all(map(math.isfinite, values))


# A point of a MultiDOFJointTrajectory of one joint, and one of a JointTrajectory of six without
# accelerations. All begin at a multiple of eight bytes but the first, which may begin four bytes
# behind one: then only its first count stands there, all else where it would in the others.
_PARTS = ('transforms', 'velocities', 'accelerations')
_PLATFORM_POINT = {order: np.dtype({
    'names': [*_PARTS, 'pose', 'twist', 'accel', 'sec', 'nanosec'],
    'formats': [f'{sign}{kind}' for kind in (
        'u4', 'u4', 'u4', '7f8', '6f8', '6f8', 'i4', 'u4')],
    'offsets': [0, 64, 120, 8, 72, 128, 176, 180], 'itemsize': 184})
    for order, sign in ((0, '>'), (1, '<'))}
_LEG_POINT = {effort: np.dtype({
    'names': ['positions', 'velocities', 'accelerations', 'efforts', 'position', 'velocity',
              'effort', 'sec', 'nanosec'],
    'formats': ['<u4', '<u4', '<u4', '<u4', '<6f8', '<6f8', f'<{6 * effort}f8', '<i4', '<u4'],
    'offsets': [0, 56, 112, 116, 8, 64, 120, end, end + 4], 'itemsize': end + 8})
    for effort, end in ((True, 168), (False, 120))}


class PlatformTrajectory:
    """
    Reads a trajectory_msgs/MultiDOFJointTrajectory of one joint and any number of points.

    Parameters
    ----------
    data : bytes
        The message.

    Raises MalformedError where it has no header, or more than one joint.

    """

    def __init__(self, data: bytes) -> None:
        try:
            order = data[1]
            sec, nanosec, size = _TIME_AND_LENGTH[order].unpack_from(data, 4)
            self.size, self._first = _points(data, [])
        except (IndexError, KeyError, StructError) as exc:
            raise MalformedError(f'{len(data)} bytes: {exc}') from exc
        self.stamp = _nanoseconds(data, sec, nanosec)
        self.frame = _text(data, 16, size)
        self._data = data
        self._begin = (self._first - 4 & ~7) + 4
        kind = _PLATFORM_POINT[order]
        whole = max(0, (len(data) - self._begin) // kind.itemsize)
        self._records: NDArray[np.void] = np.frombuffer(
            data, kind, min(whole, self.size), self._begin) if whole else np.empty(0, kind)

    def points(self, first: int, end: int) -> NDArray[np.void]:
        """
        Return points by their index: fields pose (7), twist (6), accel (6), sec and nanosec.

        Those before them must have been read. Raises MalformedError where one has not one
        transform, velocity and acceleration: what follows it cannot be found.
        """
        records = self._records[first:end]
        other = np.logical_or.reduce([records[part] != 1 for part in _PARTS])
        other[:first == 0] = True  # its first count may stand elsewhere
        for n in np.flatnonzero(other).tolist():
            self._check_counts(first + n)
        if end > len(self._records):
            self._check_counts(len(self._records))
            raise MalformedError(
                f'{len(self._data)} bytes: points[{len(self._records)}] is cut short')
        return records

    def _check_counts(self, n: int) -> None:
        kind = _PLATFORM_POINT[self._data[1]]
        begin = self._begin + n * kind.itemsize
        for part, at in zip(_PARTS, (begin if n else self._first, begin + 64, begin + 120),
                            strict=True):
            if at + 4 <= len(self._data):
                number, = _COUNT[self._data[1]].unpack_from(self._data, at)
                if number != 1:
                    raise MalformedError(f'points[{n}]: {number} {part}: each point has one')


class LegTrajectory:
    """
    Writes a trajectory_msgs/JointTrajectory of six joints without accelerations.

    Parameters
    ----------
    stamp : int
        [ns]
    names : sequence of str
        Of the joints; frame_id is empty.
    size : int
        How many points it has.
    effort : bool
        Points have effort.

    """

    def __init__(self, stamp: int, names: Sequence[str], size: int, effort: bool) -> None:
        head = bytearray(_TIME_AND_LENGTH[1].pack(*divmod(stamp, 1_000_000_000), 1) + b'\x00')
        _put_count(head, len(names))
        for name in names:
            _put_text(head, name)
        _put_count(head, size)
        self._effort = effort
        self._records = np.zeros(size, _LEG_POINT[effort])
        self._head = LITTLE_ENDIAN + head
        self._shared = len(head) % 8  # bytes of the head where the first record begins
        for name in ('positions', 'velocities', 'efforts')[:2 + effort]:
            self._records[name] = 6
        if self._shared:
            self._records[:1].view('<u4')[:2] = size, 6

    def put(self, first: int, points: NDArray[np.void], positions: Array,
            velocities: Array, efforts: Array) -> None:
        """Write points from an index on; their time_from_start is that of the other points."""
        records = self._records[first:first + len(points)]
        records['position'], records['velocity'] = positions, velocities
        if self._effort:
            records['effort'] = efforts
        records['sec'], records['nanosec'] = points['sec'], points['nanosec']

    def message(self) -> bytes:
        """Return the message."""
        head = self._head[:len(self._head) - self._shared]
        return b''.join([head, self._records.view(np.uint8).data])
