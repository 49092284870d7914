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


"""A compiled scan of MCAP records, see https://mcap.dev/spec."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Bytes, Flags, Integers
from stewart_dynamics.compilation.functions import compiled, entry_point

# Opcode and length in front of each record.
HEAD = 9
NUMBERS = 1 << 16
"""Possible channel numbers."""
IGNORED = -1
"""Entry of the table of channels: messages are skipped."""


class Scan(NamedTuple):
    """Records found in a sequence of bytes, without the messages that are skipped."""

    kinds: Integers
    """(K,): the number of the topic of a message; minus the opcode of another record."""
    values: Integers
    """(K,): the time of a message [ns]; the first two bytes of another: number of a channel."""
    starts: Integers
    """(K,): start of the data of a message, or of the content of another record."""
    sizes: Integers
    """(K,): length of the data or content [bytes]."""
    data: Bytes
    end: int
    """End of the last record."""


@compiled
def _integer(data: Bytes, at: int, size: int) -> np.int64:
    """Return the little-endian integer at a place; 0 if it is not in the data."""
    value = np.int64(0)
    if at + size <= len(data):
        for k in range(size):
            value |= np.int64(data[at + k]) << np.int64(8 * k)
    return value


@entry_point('u1[::1]', 'i8[::1]', 'b1[::1]', 'i8[:,::1]', 'i8[::1]')
def scan(data: Bytes, numbers: Integers, valid: Flags, found: Integers,
         totals: Integers) -> None:
    """
    List the messages of some channels, and all records that are not messages.

    Parameters
    ----------
    data : (M,)
        The bytes of the records. The scan ends where the fields that it reads are not in them,
        or where the lengths in a message or a message index are inconsistent.
    numbers : (65536,)
        Number of the topic of each channel, or IGNORED.
    valid : (256,)
        Whether records with an opcode may occur; the scan ends at others.
    found : (4, K)
        Output: see Scan. Records beyond K are only counted.
    totals : (2,)
        In: the second is the end that no record may exceed. Output: K and end, see Scan.

    """
    count = at = 0
    while at + 9 <= len(data):
        opcode, begin, length = np.int64(data[at]), at + 9, _integer(data, at + 1, 8)
        # Fields up to this offset are read.
        needed = 22 if opcode == 5 else 6 if opcode == 7 else 2 if opcode in (3, 4) else 0
        if not valid[opcode] or length < needed or length > totals[1] - begin or (
                begin + needed > len(data)):
            break
        if opcode == 7 and _integer(data, begin + 2, 4) != length - 6:
            break
        kind, value, skipped = -opcode, _integer(data, begin, 2), 0
        if opcode == 5:
            kind, value, skipped = numbers[value], _integer(data, begin + 6, 8), 22
        if opcode != 5 or kind >= 0:
            if count < found.shape[1]:
                found[0, count] = kind
                found[1, count] = value if value >= 0 else np.int64(9223372036854775807)
                found[2, count] = begin + skipped
                found[3, count] = length - skipped
            count += 1
        at = int(begin + length)
    totals[0], totals[1] = count, at


def scanned(data: bytes, numbers: Integers, valid: Flags, limit: int) -> Scan:
    """Return the records in these bytes that end before a limit, see ``scan``."""
    array = np.frombuffer(data, np.uint8)
    room = 8192  # for most chunks this is enough, and they are scanned once
    while True:
        found, totals = np.empty((4, room), np.int64), np.array([0, limit])
        scan(array, numbers, valid, found, totals)
        count, end = totals.tolist()
        if count <= room:
            kinds, values, starts, sizes = found[:, :count]
            return Scan(kinds, values, starts, sizes, array, end)
        room = count
