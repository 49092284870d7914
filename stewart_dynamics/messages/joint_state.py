# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Reading and writing of sensor_msgs/JointState.

A message may have other joints besides the six of the hexapod, in any order; joints are found
by name. One with half of the six or fewer is a part of a sample, see ``joint_parts``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import repeat
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Bytes, Stamps
from stewart_dynamics.errors import BagError
from stewart_dynamics.messages.cdr import (
    aligned8, COUNT, finite, header, LITTLE_ENDIAN, MALFORMED, MalformedError, nanoseconds,
    NOT_FINITE, put_count, put_text, READ_ERRORS, sequence, short_sequence, text, TIME_AND_LENGTH,
    unreadable)
from stewart_dynamics.messages.joint_parts import GAP, Joined, JointParts, Sample
from stewart_dynamics.messages.layout import Layout, values_at

FIELDS = ('position', 'velocity', 'effort')

# Why a message is rejected, beside being malformed or not finite, or 'without effort'.
MISSING_JOINTS = 'lacks one of the joints'
# Upper bound of positions [m] and efforts [N]; larger ones would overflow when squared.
NUMBERS_END = 1e100
UNEVEN = 'not as many numbers as names'

# Maximum number of names in the details of a rejection, and of characters of each.
_SHOWN = 60

# Layouts that are remembered, the newest ones.
_MOST_LAYOUTS = 8
# Messages that are read at once.
_AT_ONCE = 4096


class JointStateError(ValueError):
    """A message that cannot be used: the reason, and the details of this message."""

    def __init__(self, reason: str, details: str) -> None:
        super().__init__(reason, details)
        self.reason, self.details = reason, details


class JointStates(NamedTuple):
    """The contents of many messages, K of which can be used."""

    stamps: Stamps  # (K,) [ns]
    values: Array  # (K, 6 * fields): the six joints of one field, then of the next
    rejected: dict[str, int]  # how many of the others were rejected, by reason


class _Fields(NamedTuple):
    """Stamp and names of a sensor_msgs/JointState, and where its numbers stand in its bytes."""

    stamp: int  # [ns]
    names: list[str]
    numbers: tuple[tuple[int, int], ...]  # of position, velocity and effort: offset and count
    gaps: tuple[slice, ...]
    """Bytes that only align what follows, and those behind the message: they may be anything."""


def _fields(data: bytes) -> _Fields:
    """Read all of a sensor_msgs/JointState but its numbers; its frame_id may be any."""
    gaps: list[slice] = []
    names, numbers = [], []
    try:
        count = COUNT[data[1]]
        sec, nanosec, size = TIME_AND_LENGTH[data[1]].unpack_from(data, 4)
        stamp = nanoseconds(data, sec, nanosec)
        text(data, 16, size)
        number, at = short_sequence(data, 16 + size, count, gaps)
        for _ in range(number):
            size, at = sequence(data, at, count, gaps)
            names.append(text(data, at, size).decode(errors='replace'))
            at += size
        for _ in range(3):
            number, end = short_sequence(data, at, count, gaps)
            # An empty sequence has nothing to align.
            at = aligned8(end) if number else end
            gaps.append(slice(end, at))
            numbers.append((at, number))
            at += 8 * number
    except READ_ERRORS as exc:
        raise unreadable(data) from exc
    if at > len(data):
        raise MalformedError(f'{len(data)} bytes: must be at least {at}')
    return _Fields(stamp, names, tuple(numbers), (*gaps, slice(at, len(data))))


class _Known(NamedTuple):
    """A layout: which of its numbers are wanted, or why such messages are rejected."""

    layout: Layout
    columns: list[int]
    chosen: Callable[[tuple[float, ...]], tuple[Any, ...]]
    """Returns the columns of one message's numbers."""
    reason: str
    details: str
    part: list[int]
    """Places of its joints, if it has at most half of them."""


class JointStateReader:
    """
    Reads the numbers of six joints from sensor_msgs/JointState messages.

    Nearly all messages of a topic have one layout: the same names, the same counts. One is read
    field by field, and those whose bytes are the same but for stamp and numbers are read by it,
    one after the other or many at once.

    joints: names of the joints in the order wanted.
    fields: which of FIELDS are wanted; the others may be empty.
    gap: longest time between the parts of a sample [ns].
    """

    def __init__(self, joints: Sequence[str], fields: Sequence[str] = FIELDS,
                 gap: int = GAP) -> None:
        self._found = self._lacking = False  # whether a message had all joints, or lacked one
        # The names in the first message that lacked one, or in all parts.
        self._others: list[str] = []
        self._joints = list(joints)
        self._parts = JointParts(self._joints, len(fields), gap)
        self._fields = list(fields)
        self._known: list[_Known] = []

    def read(self, data: bytes) -> list[Sample]:
        """
        Return stamp [ns] and values, laid out as in JointStates, of the samples that are complete.

        A message with all joints is one; a part completes some samples, or none yet.

        Raises MalformedError: the bytes are no JointState.
        Raises JointStateError: it lacks joints or fields, or a number is not finite; or a part
            completes no sample, because another one has not come.
        """
        for known in self._known:
            read = known.layout.read_one(data)
            if read is not None:
                break
        else:
            known = self._learn(data)
            read = known.layout.read_one(data)
            assert read is not None
        if known.reason:
            raise JointStateError(known.reason, known.details)
        values = known.chosen(read[1])
        if not finite(values):
            raise JointStateError(NOT_FINITE, str(values))
        if not known.part:
            return [(read[0], values)]
        samples, lacking = self._joined(read[0], known, values)
        if lacking and not samples:
            raise JointStateError(MISSING_JOINTS, lacking[-1])
        return samples

    def _joined(self, stamp: int, known: _Known, values: Sequence[float]) -> Joined:
        """Join a part."""
        joined = self._parts.add(stamp, known.part, values)
        self._found = self._found or bool(joined.samples)
        return joined

    def read_many(self, data: bytes | Bytes, starts: ArrayLike, sizes: ArrayLike) -> JointStates:
        """
        Return the results of ``read`` for many messages, and the number of rejections.

        data: it holds all messages.
        starts, sizes (M,): where each begins, and its length in bytes.
        """
        whole = np.frombuffer(data, dtype=np.uint8)
        begins, lengths = np.asarray(starts, dtype=np.int64), np.asarray(sizes, dtype=np.int64)
        stamps, values = np.zeros(len(begins), dtype=np.int64), np.zeros(
            (len(begins), len(self._fields) * len(self._joints)))
        used, rejected = np.zeros(len(begins), dtype=bool), Counter[str]()
        parts: list[tuple[int, int, _Known, Sequence[float]]] = []

        def take(known: _Known, which: Stamps) -> Stamps:
            """Read those of the messages that have the layout, and return which have not."""
            of_size = lengths[which] == known.layout.size
            others, same = [which[~of_size]], which[of_size]
            for first in range(0, len(same), _AT_ONCE):
                part = same[first:first + _AT_ONCE]
                alike, part_stamps, numbers = known.layout.read(whole, begins[part])
                if not alike.all():
                    others.append(part[~alike])
                    part, part_stamps, numbers = part[alike], part_stamps[alike], numbers[alike]
                if known.reason:
                    rejected[known.reason] += len(part)
                    continue
                chosen = numbers[:, known.columns]
                sound = np.isfinite(chosen).all(axis=1)
                rejected[NOT_FINITE] += int(np.count_nonzero(~sound))
                if known.part:
                    parts.extend(zip(part[sound].tolist(), part_stamps[sound].tolist(),
                                     repeat(known), chosen[sound].tolist(), strict=False))
                    continue
                stamps[part], values[part], used[part] = part_stamps, chosen, sound
            return np.sort(np.concatenate(others))

        left: Stamps = np.arange(len(begins))
        for known in tuple(self._known):
            left = take(known, left)
        while len(left):
            first = int(left[0])
            begin, length = int(begins[first]), int(lengths[first])
            try:
                known = self._learn(whole[begin:begin + length].tobytes())
            except MalformedError:
                rejected[MALFORMED] += 1
                left = left[1:]
                continue
            left = take(known, left)
        if not parts:
            return JointStates(stamps[used], values[used], dict(+rejected))
        at, more = np.flatnonzero(used).tolist(), list[Sample]()
        for place, stamp, known, numbers in sorted(parts, key=itemgetter(0)):
            samples, lacking = self._joined(stamp, known, numbers)
            rejected[MISSING_JOINTS] += len(lacking)
            at += [place] * len(samples)
            more += samples
        order = np.argsort(at, kind='stable')
        return JointStates(
            np.concatenate([stamps[used], np.array([each for each, _ in more], dtype=np.int64)])[
                order],
            np.concatenate([values[used], np.array([each for _, each in more]).reshape(
                -1, values.shape[1])])[order], dict(+rejected))

    def reads_all(self, data: bytes) -> bool:
        """Return whether a message has all fields of the joints, or of a part of them."""
        try:
            self.read(data)
        except (MalformedError, JointStateError):
            return False
        return True

    def check(self, where: str) -> None:
        """Raise BagError if messages lacked a joint, and none had all joints."""
        if self._lacking and not self._found:
            missing = [joint for joint in self._joints if joint not in self._others]
            if not missing:
                raise BagError(f'{where}: each message has some of the joints, and their stamps '
                               'are never close enough to be joined')
            raise BagError(
                f'{where}: no message contains {", ".join(missing)}; they contain '
                f'{", ".join(self._others) or "nothing"}: they must be those of the parameter '
                'joints')

    def _learn(self, data: bytes) -> _Known:
        """Read a message field by field and remember its layout."""
        fields = _fields(data)
        known = self._judge(data, fields)
        if known.part:
            self._lacking = True
            self._others += [name for name in fields.names if name not in self._others]
        elif known.reason != MISSING_JOINTS:
            self._found = True
        else:
            self._lacking = True
            self._others = self._others or fields.names
        self._known = [known, *self._known[:_MOST_LAYOUTS - 1]]
        return known

    def _judge(self, data: bytes, fields: _Fields) -> _Known:
        """Return the layout of this message, for messages alike."""
        names, n_names = fields.names, len(fields.names)
        wanted = {field: fields.numbers[n] for n, field in enumerate(FIELDS)
                  if field in self._fields}
        reason = details = ''
        there = [joint for joint in self._joints if joint in names]
        missing = [joint for joint in self._joints if joint not in names]
        if missing and not 0 < len(there) <= len(missing):
            reason = MISSING_JOINTS
            shown = ', '.join(name[:_SHOWN] for name in names[:_SHOWN]) or 'none'
            details = f'{", ".join(missing)}; there are {shown}'
        elif empty := [field for field, (_, count) in wanted.items() if not count]:
            reason = f'without {" and ".join(empty)}'
            details = f'{n_names} names'
        elif uneven := [f'{count} of {field}' for field, (_, count) in wanted.items()
                        if count != n_names]:
            reason = UNEVEN
            details = f'{n_names} names, {", ".join(uneven)}'
        numbers = [] if reason else list(wanted.values())
        # Other fields may have any value.
        free = [slice(at, at + 8 * count) for at, count in fields.numbers]
        columns = [] if reason else [
            list(wanted).index(field) * n_names + names.index(joint)
            for field in self._fields for joint in there]
        part = [self._joints.index(joint) for joint in there] if missing and not reason else []
        return _Known(Layout(data, numbers, gaps=[*fields.gaps, *free]), columns,
                      values_at(columns), reason, details, part)


class JointStateWriter:
    """Writes sensor_msgs/JointState of joints with these names; frame_id is empty."""

    def __init__(self, names: Sequence[str]) -> None:
        self._whole, self._without_effort = (
            joint_state_layout(names, fields) for fields in (FIELDS, FIELDS[:2]))

    def write(self, stamp: int, position: Iterable[float], velocity: Sequence[float],
              effort: Sequence[float] | None) -> bytes:
        """Return the message, without effort if not given."""
        if effort is None:
            return self._without_effort.write_one(stamp, position, velocity)
        return self._whole.write_one(stamp, position, velocity, effort)

    def layout(self, effort: bool) -> Layout:
        """Return the layout of the messages with or without effort."""
        return self._whole if effort else self._without_effort


def joint_state_layout(names: Sequence[str], fields: Sequence[str]) -> Layout:
    """Return the layout of messages with these of FIELDS; the others are empty."""
    body = bytearray(LITTLE_ENDIAN) + header(0)
    put_count(body, len(names))
    for name in names:
        put_text(body, name)
    numbers = []
    for field in FIELDS:
        count = len(names) if field in fields else 0
        put_count(body, count)
        if count:
            body += bytes((4 - len(body)) % 8)
            numbers.append((len(body), count))
            body += bytes(8 * count)
    return Layout(bytes(body), numbers)
