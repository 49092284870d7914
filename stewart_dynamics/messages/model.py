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
Messages that show the hexapod as a model: joint positions alone, and transforms.

sensor_msgs/JointState without velocity and effort, as robot_state_publisher reads it, and
tf2_msgs/TFMessage.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, SECOND, Stamps
from stewart_dynamics.messages.cdr import aligned8, header, LITTLE_ENDIAN, put_count, put_text
from stewart_dynamics.messages.layout import Layout


class _Writer:
    """
    Writes messages that differ in nothing but one stamp and some doubles in a row.

    Parameters
    ----------
    head : bytes
        Bytes before the doubles, with the encapsulation.
    stamp : int
        Where the stamp is in it.
    number : int
        Number of doubles.
    tail : bytes
        Bytes behind them.

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
            self._before, *divmod(stamp, SECOND), self._between, *numbers, self._tail)


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


def positions_layout(names: Sequence[str]) -> Layout:
    """Return the layout of the same messages, to write many at once."""
    message = PositionsWriter(names).write(0, [0.0] * len(names))
    return Layout(message, [(len(message) - 8 - 8 * len(names), len(names))])


class TransformWriter(_Writer):
    """Writes tf2_msgs/TFMessage of one transform: x y z and the quaternion's x y z w."""

    def __init__(self, frame: str, child: str) -> None:
        message, ((stamp, numbers),) = _transforms([(frame, child)])
        super().__init__(message[:numbers], stamp, 7)


class TransformsWriter:
    """
    Writes many tf2_msgs/TFMessage at once, each with the transforms between the same frames.

    Parameters
    ----------
    frames : sequence of (frame, child)
        Stamps of the transforms (K,).

    """

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        message, places = _transforms(frames)
        self._message = np.frombuffer(message, dtype=np.uint8)
        fields: dict[str, tuple[Any, int]] = {}
        for n, (stamp, numbers) in enumerate(places):
            fields |= {f'sec {n}': ('<i4', stamp), f'nanosec {n}': ('<u4', stamp + 4),
                       f'numbers {n}': (('<f8', (7,)), numbers)}
        self._dtype = np.dtype({
            'names': list(fields), 'formats': [kind for kind, _ in fields.values()],
            'offsets': [at for _, at in fields.values()], 'itemsize': len(message)})
        self._count = len(places)

    def write(self, stamps: Stamps, transforms: Array) -> NDArray[np.void]:
        """
        Return the messages (N,), each an entry of their length.

        Parameters
        ----------
        stamps : (N,)
            The stamp of all transforms of a message [ns].
        transforms : (N, K, 7)
            x y z [m] and the quaternion's x y z w.

        """
        rows = np.empty(len(stamps), dtype=self._dtype)
        rows.view(np.uint8).reshape(len(stamps), -1)[:] = self._message
        seconds, nanoseconds = np.divmod(stamps, SECOND)
        for n in range(self._count):
            rows[f'sec {n}'], rows[f'nanosec {n}'] = seconds, nanoseconds
            rows[f'numbers {n}'] = transforms[:, n]
        return rows.view(f'V{len(self._message)}')


def _transforms(frames: Sequence[tuple[str, str]]) -> tuple[bytes, list[tuple[int, int]]]:
    """Return a TFMessage with all numbers zero, and where each stamp and its numbers begin."""
    body = bytearray()
    put_count(body, len(frames))
    places = []
    for frame, child in frames:
        stamp = len(body)
        body += bytes(8)
        put_text(body, frame)
        put_text(body, child)
        body += bytes(-len(body) % 8)
        places.append((len(LITTLE_ENDIAN) + stamp, len(LITTLE_ENDIAN) + len(body)))
        body += bytes(7 * 8)
    return LITTLE_ENDIAN + bytes(body), places
