# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Reading and writing of sensor_msgs/JointState.

A message may have other joints besides the six of the hexapod, in any order; joints are found
by name. One with half of the six or fewer is a part of a sample, see ``joint_parts``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers, Stamps
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.errors import BagError
from stewart_dynamics.messages.cdr import (
    COUNT, fault_of, header, LITTLE_ENDIAN, MALFORMED, NOT_FINITE, put_count, put_text, sequence,
    text)
from stewart_dynamics.messages.joint_parts import GAP, JointParts
from stewart_dynamics.messages.layout import Layout
from stewart_dynamics.messages.recorded import Messages

FIELDS = ('position', 'velocity', 'effort')

# Why a message is rejected, beside being malformed or not finite, or 'without effort'.
MISSING_JOINTS = 'lacks one of the joints'
# Upper bound of positions [m] and efforts [N]; larger ones would overflow when squared.
NUMBERS_END = 1e100
UNEVEN = 'not as many numbers as names'

# Maximum number of names in the details of a rejection, and of characters of each.
_SHOWN = 60

_VALID, _NOT_FINITE, _MALFORMED, _MISSING, _LACKING, _UNEVEN = (
    CODES[f'JOINTS_{name}'] for name in (
        'VALID', 'NOT_FINITE', 'MALFORMED', 'MISSING', 'LACKING', 'UNEVEN'))
_REASONS = {_NOT_FINITE: NOT_FINITE, _MALFORMED: MALFORMED, _MISSING: MISSING_JOINTS,
            _UNEVEN: UNEVEN}


class JointStates(NamedTuple):
    """The contents of messages; K samples can be used."""

    stamps: Stamps  # (K,) [ns]
    values: Array  # (K, 6 * fields): the six joints of one field, then of the next
    places: Integers  # (K,): index of the message that completes each
    rejected: dict[str, int]  # how many messages were rejected, by reason
    last: tuple[str, str]  # reason and details of the last one that was rejected


class JointStateReader:
    """
    Reads the numbers of six joints from sensor_msgs/JointState messages: in C, core/messages.c.

    joints: names of the joints in the order wanted.
    fields: which of FIELDS are wanted; the others may be empty.
    gap: longest time between the parts of a sample [ns].
    """

    def __init__(self, joints: Sequence[str], fields: Sequence[str] = FIELDS,
                 gap: int = GAP) -> None:
        self._found = self._lacking = False  # whether a message had all joints, or lacked one
        # The names in the first message that lacked one, or in all parts.
        self._others: list[str] = []
        self._joints, self._fields = list(joints), list(fields)
        self._parts = JointParts(self._joints, len(fields), gap)
        self._seen: set[int] = set()  # which joints parts have had, as bits
        names = [joint.encode() for joint in joints]
        in_message = [field for field in FIELDS if field in fields]
        self._order = [in_message.index(field) for field in fields]
        self._width = len(joints) * len(fields)
        self._read = function('read_joint_states').bound(
            len(joints), np.frombuffer(b''.join(names), np.uint8),
            np.cumsum([len(name) for name in names], dtype=np.int64),
            np.array([field in fields for field in FIELDS]), self._width)

    def read_states(self, messages: Messages) -> JointStates:
        """
        Return the samples that messages complete.

        A message with all joints is one; a part completes some samples, or none yet, and is
        rejected if another one has not come.
        """
        count = len(messages.times)
        heads: Any = np.zeros(count, record('joint_state'))
        values: Array = np.empty((count, len(self._fields), len(self._joints)))
        self._read(count, *messages.places_in_data(), heads, values)
        values = values[:, self._order]
        states, whole = heads['state'], heads['n_joints'] == len(self._joints)
        usable = states <= _NOT_FINITE
        self._found = self._found or bool((usable & whole | (states >= _LACKING)).any())
        rejected, last = dict[str, int](), ('', '')
        for n in np.flatnonzero(states != _VALID).tolist():
            reason = self._reason_of(heads[n])
            if rejected.setdefault(reason, 0) == 0 or count == 1:
                last = reason, self._details_of(messages, n, heads[n], values[n])
            rejected[reason] += 1
        used: list[int] = np.flatnonzero((states == _VALID) & whole).tolist()
        found = JointStates(heads['stamp'][used], values[used].reshape(-1, self._width),
                            np.array(used, np.int64), rejected, last)
        parts = np.flatnonzero(usable & ~whole)
        return self._join_parts(messages, heads, values, parts, found) if parts.size else found

    def _join_parts(self, messages: Messages, heads: Any, values: Array, parts: Integers,
                    found: JointStates) -> JointStates:
        """Return the samples that parts complete, and those that were found in whole messages."""
        self._lacking, last, rejected = True, found.last, found.rejected
        stamps, rows, places = (each.tolist() for each in found[:3])
        for n in parts.tolist():
            there = int(heads['there'][n])
            if there not in self._seen:
                self._seen.add(there)
                self._others += [name for name in _names_of(messages, n, heads[n])
                                 if name not in self._others]
            if heads['state'][n] != _VALID:
                continue
            joints = [joint for joint in range(len(self._joints)) if there >> joint & 1]
            samples, lacking = self._parts.join_part(
                int(heads['stamp'][n]), joints, values[n][:, joints].ravel().tolist())
            self._found = self._found or bool(samples)
            for words in lacking:
                rejected[MISSING_JOINTS] = rejected.get(MISSING_JOINTS, 0) + 1
                last = MISSING_JOINTS, words
            places += [n] * len(samples)
            stamps += [stamp for stamp, _ in samples]
            rows += [row for _, row in samples]
        order = np.argsort(places, kind='stable')
        return JointStates(
            np.array(stamps, np.int64)[order],
            np.array(rows, float).reshape(-1, self._width)[order],
            np.array(places, np.int64)[order], rejected, last)

    def _reason_of(self, head: Any) -> str:
        empty = [field for n, field in enumerate(FIELDS) if head['lacking'] >> n & 1]
        return _REASONS.get(int(head['state'])) or f'without {" and ".join(empty)}'

    def _details_of(self, messages: Messages, n: int, head: Any, values: Array) -> str:
        """Return the details of a message that is rejected."""
        state = head['state']
        names, *counts = head['counts'].tolist()
        if state == _MALFORMED:
            return str(fault_of(messages.view_of(n), int(head['fault']), int(head['number'])))
        if state == _NOT_FINITE:
            there = [joint for joint in range(len(self._joints)) if head['there'] >> joint & 1]
            return str(tuple(values[:, there].ravel().tolist()))
        if state == _MISSING:
            found = _names_of(messages, n, head)
            self._lacking, self._others = True, self._others or found
            missing = ', '.join(joint for joint in self._joints if joint not in found)
            shown = ', '.join(name[:_SHOWN] for name in found[:_SHOWN]) or 'none'
            return f'{missing}; there are {shown}'
        uneven = [f'{counts[n]} of {field}' for n, field in enumerate(FIELDS)
                  if head['uneven'] >> n & 1]
        return ', '.join([f'{names} names', *(uneven if state == _UNEVEN else ())])

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


def _names_of(messages: Messages, n: int, head: Any) -> list[str]:
    """Return the names in a message that is not malformed."""
    data, at, names = messages.bytes_of(n), int(head['names_at']), list[str]()
    for _ in range(head['counts'][0]):
        size, at = sequence(data, at, COUNT[data[1]])
        names.append(text(data, at, size).decode(errors='replace'))
        at += size
    return names


class JointStateWriter:
    """Writes sensor_msgs/JointState of joints with these names; frame_id is empty."""

    def __init__(self, names: Sequence[str]) -> None:
        self._whole, self._without_effort = (
            joint_state_layout(names, fields) for fields in (FIELDS, FIELDS[:2]))

    def write(self, stamp: int, position: Iterable[float], velocity: Sequence[float],
              effort: Sequence[float] | None) -> bytes:
        """Return the message, without effort if not given."""
        numbers = [each for each in (position, velocity, effort) if each is not None]
        return self.layout(effort is not None).write(
            [stamp], *([[*each]] for each in numbers)).tobytes()

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
