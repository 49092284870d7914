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
Messages that show the hexapod as a model: joint positions alone, and one transform.

sensor_msgs/JointState without velocity and effort, as robot_state_publisher reads it, and
tf2_msgs/TFMessage.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from stewart_dynamics.messages.cdr import aligned8, header, LITTLE_ENDIAN, put_count, put_text

_SECOND = 1_000_000_000


class _Writer:
    """
    Writes messages that differ in nothing but one stamp and some doubles in a row.

    Parameters
    ----------
    head : bytes
        What comes before the doubles, with the encapsulation.
    stamp : int
        Where the stamp is in it.
    number : int
        Of doubles.
    tail : bytes
        What comes behind them.

    """

    def __init__(self, head: bytes, stamp: int, number: int, tail: bytes = b'') -> None:
        begin = aligned8(len(head))
        self._before, self._tail = head[:stamp], tail
        self._between = head[stamp + 8:].ljust(begin - stamp - 8, b'\0')
        self._whole = Struct(
            f'<{stamp}siI{len(self._between)}s{number}d{len(tail)}s')

    def write(self, stamp: int, numbers: Sequence[float]) -> bytes:
        """Return the message of a stamp [ns]."""
        return self._whole.pack(
            self._before, *divmod(stamp, _SECOND), self._between, *numbers, self._tail)


class PositionsWriter(_Writer):
    """Writes sensor_msgs/JointState of positions alone; frame_id is empty."""

    def __init__(self, names: Sequence[str]) -> None:
        body = header(0)
        put_count(body, len(names))
        for name in names:
            put_text(body, name)
        put_count(body, len(names))
        # Neither velocity nor effort.
        super().__init__(LITTLE_ENDIAN + body, len(LITTLE_ENDIAN), len(names), bytes(8))


class TransformWriter(_Writer):
    """Writes tf2_msgs/TFMessage of one transform: x y z and the quaternion's x y z w."""

    def __init__(self, frame: str, child: str) -> None:
        body = bytearray()
        put_count(body, 1)
        stamp = len(LITTLE_ENDIAN) + len(body)
        body += bytes(8)
        put_text(body, frame)
        put_text(body, child)
        super().__init__(LITTLE_ENDIAN + body, stamp, 7)
