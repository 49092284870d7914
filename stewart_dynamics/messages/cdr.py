# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The common parts of all messages as bytes: byte order, stamps, texts and sequences.

ROS 2 sends messages as XCDR1 ("plain CDR"): four bytes that give the byte order, then the
fields, each aligned to its own size (OMG DDS-XTypes 1.3, 7.4.3). Messages of setpoints, base,
wrench and legs are read in C, core/messages.c: it takes a hundredth of the time of rclpy's typed
messages and needs no ROS; node and replay read and write the same bytes.
"""

from __future__ import annotations

from struct import error as StructError
from struct import Struct
from typing import NamedTuple

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.core.binding import CODES

LITTLE_ENDIAN = b'\x00\x01\x00\x00'

_TIME = Struct('<iI')
# By the second byte of a message: 0 is big-endian, 1 little-endian.
ORDERS = {0: '>', 1: '<'}
TIME_AND_LENGTH = {0: Struct('>iII'), 1: Struct('<iII')}
COUNT = {0: Struct('>I'), 1: Struct('<I')}
SEVEN = {0: Struct('>7d'), 1: Struct('<7d')}

# Errors of reading fields at wrong places: handled by the reader of the whole message.
READ_ERRORS = IndexError, KeyError, StructError


# Names, dimensions or numbers in a message of six legs: reading millions of them would delay all
# messages after it.
MOST_ENTRIES = CODES['MOST_ENTRIES']

# Why a message of any type is rejected.
MALFORMED = 'malformed'
NOT_FINITE = 'not finite'


_FAULTS = {CODES[f'FAULT_{name}']: words for name, words in {
    'NANOSECONDS': 'stamp of {number} ns: must be under 1000000000',
    'TEXT': 'a string does not end in a zero byte',
    'SEQUENCE': 'a sequence of {number} in {size} bytes',
    'ENTRIES': f'a sequence of {{number}}: must be at most {MOST_ENTRIES}',
    'NAMES': '{number} joint_names: must be at most 1',
    'POINTS': '{number} points: a setpoint has one',
    'TRANSFORMS': '{number} transforms: a setpoint has one',
    'VELOCITIES': '{number} velocities: a setpoint has one',
    'ACCELERATIONS': '{number} accelerations: a setpoint has one',
    'SHORTER': '{size} bytes: must be at least {number}'}.items()}


class MalformedError(ValueError):
    """Bytes that are not a message of the expected type."""


def fault_of(data: bytes | memoryview, fault: int, number: int) -> MalformedError:
    """Return the error of bytes in which core/messages.c has found a fault, with its number."""
    words = _FAULTS.get(fault)
    return unreadable(data) if words is None else MalformedError(
        words.format(number=number, size=len(data)))


class Stamped(NamedTuple):
    """A message with a header: its stamp, its frame and its numbers."""

    stamp: int  # [ns]
    frame: bytes
    values: tuple[float, ...]


def aligned8(offset: int) -> int:
    """Return the next offset at which a double may stand; the first stands at 4."""
    return (offset + 3 & ~7) + 4


def check_encapsulation(data: bytes | memoryview) -> None:
    """Raise MalformedError where a message is not plain CDR."""
    if data[0] != 0 or data[1] not in ORDERS:
        raise MalformedError(f'encapsulation {data[:2].hex()} is not plain CDR')


def unreadable(data: bytes | memoryview) -> MalformedError:
    """Return the error of bytes that are not plain CDR, or that end before the message does."""
    try:
        check_encapsulation(data)
    except MalformedError as exc:
        return exc
    except IndexError:
        pass
    return MalformedError(f'{len(data)} bytes: they end before the message does')


def nanoseconds(data: bytes, sec: int, nanosec: int) -> int:
    """Return the stamp [ns] of a message whose header has these numbers."""
    check_encapsulation(data)
    if nanosec >= SECOND:
        raise MalformedError(f'stamp of {nanosec} ns: must be under 1000000000')
    return int(sec) * SECOND + int(nanosec)


def stamp_of(data: bytes) -> int | None:
    """Return the stamp of a message that has a header [ns]; None if it cannot be read."""
    try:
        sec, nanosec, _ = TIME_AND_LENGTH[data[1]].unpack_from(data, 4)
        return nanoseconds(data, sec, nanosec)
    except (*READ_ERRORS, MalformedError):
        return None


def text(data: bytes, start: int, size: int) -> bytes:
    """Return a string without its zero byte; the size counts that byte."""
    if size == 0:
        return b''
    if start + size > len(data) or data[start + size - 1] != 0:
        raise MalformedError('a string does not end in a zero byte')
    return data[start:start + size - 1]


def sequence(data: bytes, at: int, count: Struct) -> tuple[int, int]:
    """
    Return a sequence's length, and where its first entry begins.

    at: where the field before it ends.
    count: one of COUNT.
    """
    begin = at + 3 & ~3
    number = count.unpack_from(data, begin)[0]
    if number > len(data):
        raise MalformedError(f'a sequence of {number} in {len(data)} bytes')
    return number, begin + 4


def short_sequence(data: bytes, at: int, count: Struct) -> tuple[int, int]:
    """Do the same as ``sequence``, for one of at most MOST_ENTRIES."""
    number, begin = sequence(data, at, count)
    if number > MOST_ENTRIES:
        raise MalformedError(f'a sequence of {number}: must be at most {MOST_ENTRIES}')
    return number, begin


def header(stamp: int, frame: str = '') -> bytearray:
    """Return a header, without the four bytes before it."""
    body = bytearray(_TIME.pack(*divmod(stamp, SECOND)))
    put_text(body, frame)
    return body


def put_count(body: bytearray, number: int) -> None:
    """Append the length of a sequence or string."""
    body += bytes(-len(body) % 4) + COUNT[1].pack(number)


def put_text(body: bytearray, written: str) -> None:
    """Append a string."""
    encoded = written.encode() + b'\x00'
    put_count(body, len(encoded))
    body += encoded
