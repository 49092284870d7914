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


"""A compiled scan for the messages in a sequence of MCAP records."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Bytes, Integers
from stewart_dynamics.compilation.functions import entry_point

# Columns of the result; of schemas and channels the first is minus the opcode.
CHANNEL, TIME, START, SIZE, _FOUND = range(5)


@entry_point('u1[::1]', 'b1', 'i8[:,::1]', 'i8[::1]')
def scan(data: Bytes, only_messages: bool, found: Integers, totals: Integers) -> None:
    """
    Find the messages in a sequence of records.

    Parameters
    ----------
    data : (M,)
        The bytes of the records.
    only_messages : bool
        End at the first record that is not a message.
    found : (K, 4)
        Output: channel, time, start, size; of schemas and channels minus the opcode in place
        of the channel. Messages beyond K rows are only counted.
    totals : (2,)
        Output: the number of messages, and the number of bytes of the whole records.

    """
    count, at = 0, 0
    while at + 9 <= len(data):
        length = np.int64(0)
        for k in range(8):
            length |= np.int64(data[at + 1 + k]) << np.int64(8 * k)
        opcode = data[at]
        if length < 0 or length > len(data) - at - 9 or (opcode == 5 and length < 22):
            break
        if only_messages and opcode != 5:
            break
        if 3 <= opcode <= 5:
            if count < len(found):
                begin = at + 9
                if opcode == 5:
                    time = np.int64(0)
                    for k in range(8):
                        time |= np.int64(data[begin + 6 + k]) << np.int64(8 * k)
                    found[count, 0] = np.int64(data[begin]) + 256 * np.int64(data[begin + 1])
                    found[count, 1] = time if time >= 0 else np.int64(9223372036854775807)
                    found[count, 2] = begin + 22
                    found[count, 3] = length - 22
                else:
                    found[count, 0] = -np.int64(opcode)
                    found[count, 1] = 0
                    found[count, 2] = begin
                    found[count, 3] = length
            count += 1
        at += 9 + int(length)
    totals[0], totals[1] = count, at


def scanned(data: bytes, only_messages: bool) -> tuple[Integers, int, Bytes]:
    """Return the messages (K, 4), the number of bytes of whole records, and all bytes."""
    array, totals = np.frombuffer(data, np.uint8), np.empty(2, np.int64)
    scan(array, only_messages, np.empty((0, _FOUND), np.int64), totals)
    found = np.empty((totals[0], _FOUND), np.int64)
    scan(array, only_messages, found, totals)
    return found, int(totals[1]), array
