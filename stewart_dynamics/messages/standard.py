# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages of std_msgs, rosgraph_msgs/Clock and tf2_msgs/TFMessage."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.messages.cdr import (
    aligned8, check_encapsulation, COUNT, LITTLE_ENDIAN, ORDERS, put_count, put_text, READ_ERRORS,
    sequence, short_sequence, unreadable)
from stewart_dynamics.messages.layout import Layout

_FLOAT64 = Struct('<4sd')
_CLOCK = Struct('<4siI')
_BOOL = Struct('<4s?')
# an empty layout's two numbers, the number of entries, and padding
_FLOAT64_ARRAY = Struct('<4sIII4x6d')


def float64(value: float) -> bytes:
    """Write a std_msgs/Float64."""
    return _FLOAT64.pack(LITTLE_ENDIAN, value)


def boolean(value: bool) -> bytes:
    """Write a std_msgs/Bool."""
    return _BOOL.pack(LITTLE_ENDIAN, value)


def string(written: str) -> bytes:
    """Write a std_msgs/String."""
    body = bytearray(LITTLE_ENDIAN)
    put_text(body, written)
    return bytes(body)


def clock(stamp: int) -> bytes:
    """Write a rosgraph_msgs/Clock of a time [ns]."""
    return _CLOCK.pack(LITTLE_ENDIAN, *divmod(stamp, SECOND))


def float64_array(values: Sequence[float]) -> bytes:
    """Write six numbers as a std_msgs/Float64MultiArray without a layout."""
    return _FLOAT64_ARRAY.pack(LITTLE_ENDIAN, 0, 0, 6, *values)


def float64_values(data: bytes) -> tuple[float, ...]:
    """Read a std_msgs/Float64MultiArray: its numbers, whatever layout it claims."""
    try:
        order = data[1]
        count = COUNT[order]
        dimensions, at = short_sequence(data, 4, count)
        for _ in range(dimensions):
            size, at = sequence(data, at, count)
            at = (at + size + 3 & ~3) + 8
        # data_offset comes before the numbers
        number, at = short_sequence(data, (at + 3 & ~3) + 4, count)
        values: tuple[float, ...] = Struct(f'{ORDERS[order]}{number}d').unpack_from(
            data, aligned8(at) if number else at)
    except READ_ERRORS as exc:
        raise unreadable(data) from exc
    check_encapsulation(data)
    return values


# To write many of them at once.
FLOAT64_ARRAY = Layout(float64_array((0.0,) * 6), [(20, 6)], stamps=())
FLOAT64 = Layout(float64(0.0), [(4, 1)], stamps=())
BOOLEAN = Layout(boolean(False), [(4, 0)], stamps=())  # whether a number is above zero


def transforms(frames: Sequence[tuple[str, str]]) -> Layout:
    """
    Return the layout of a TFMessage of the transforms between frames.

    Its parts are the transforms: x y z [m] and the quaternion's x y z w.

    frames (frame, child): the frames of each transform.
    """
    body = bytearray(LITTLE_ENDIAN)
    put_count(body, len(frames))
    stamps, numbers = [], []
    for frame, child in frames:
        stamps.append(len(body))
        body += bytes(8)
        put_text(body, frame)
        put_text(body, child)
        body += bytes((4 - len(body)) % 8)
        numbers.append((len(body), 7))
        body += bytes(7 * 8)
    return Layout(bytes(body), numbers, stamps)
