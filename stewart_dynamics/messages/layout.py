# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages that differ in nothing but their stamps and numbers, written many at once: in C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stewart_dynamics.arrays import Array, Bytes, Flags, Stamps
from stewart_dynamics.core.binding import function, record
from stewart_dynamics.parameters.tolerances import STAMPS_END


class Layout:
    """
    Messages that differ in nothing but their stamps and numbers.

    message: one of them, little-endian.
    numbers (offset, count): where doubles stand in it, in the order of their offsets.
    stamps: offsets of its stamps; by default that of a header.
    """

    def __init__(self, message: bytes, numbers: Sequence[tuple[int, int]],
                 stamps: Sequence[int] = (4,)) -> None:
        self.size = len(message)
        self.message, self.numbers, self.stamps = message, numbers, stamps
        ends = np.cumsum([count for _, count in numbers]).tolist()
        self._rows = MessageRows([Written('', self, [
            slice(end - count, end) for (_, count), end in zip(numbers, ends, strict=True)])],
            ends[-1])

    def write(self, stamps: ArrayLike, *numbers: ArrayLike) -> NDArray[np.void]:
        """
        Return messages (N,), each an entry of ``size`` bytes.

        stamps (N,) [ns]; numbers (N, ...) of each part.
        """
        at = np.asarray(stamps, dtype=np.int64)
        for stamp in (at[0], at[-1]) if self.stamps and len(at) else ():
            if not -STAMPS_END <= stamp < STAMPS_END:
                raise ValueError(f'stamp {stamp} ns: seconds have 32 bits')
        return self._rows.write(at, np.concatenate(numbers, axis=1, dtype=float))[0][2]


class Written(NamedTuple):
    """Messages of a topic that are written from a row of numbers, for rows that have it."""

    topic: str
    layout: Layout
    columns: Sequence[slice]  # of the row, for each part of the layout
    known: int = -1  # the message is for rows where this column is not nan,
    unknown: int = -1  # this one is nan,
    positive: int = -1  # this one is above zero; -1: any row


class MessageRows:
    """
    Messages of some topics, side by side, with a stamp and numbers of one row.

    kinds: the kinds of messages, in the order in which they are published.
    width: numbers in a row.
    servos: the structure of a hexapod with servos, whose pulse widths follow the row.
    """

    def __init__(self, kinds: Sequence[Written], width: int, servos: Any = None) -> None:
        stamps, parts, message = [], [], b''
        self.parts = []
        """Topic of each kind, and where its message begins and ends."""
        for kind in kinds:
            begin = len(message)
            stamps += [begin + at for at in kind.layout.stamps]
            parts += [(begin + at, column.start, count) for (at, count), column in zip(
                kind.layout.numbers, kind.columns, strict=True)]
            message += kind.layout.message
            self.parts.append((kind.topic, begin, len(message)))
        self.size = len(message)
        self.arguments = (
            servos, len(message), np.frombuffer(message, np.uint8),
            len(stamps), np.array(stamps, np.int64),
            len(parts), np.array(parts, record('message_part')), len(kinds),
            np.array([kind[3:] for kind in kinds], record('message_condition')))
        """Arguments of ``put_answers`` in core/library.h."""
        self._write = function('write_messages').bound(*self.arguments, width)

    def write(self, stamps: Stamps, rows: Array) -> list[tuple[str, Flags, NDArray[np.void]]]:
        """
        Return the topics that have a message, which rows have it (N,), and the messages (N,).

        stamps (N,) [ns], rows (N, width).
        """
        messages = np.empty((len(rows), self.size), np.uint8)
        having = np.empty((len(rows), len(self.parts)), bool)
        self._write(len(rows), stamps, np.ascontiguousarray(rows), messages, having)
        entries = messages.view(np.dtype([
            (f'{n}', f'V{end - begin}') for n, (_, begin, end) in enumerate(self.parts)]))[:, 0]
        return [(topic, having[:, n], entries[f'{n}'])
                for n, (topic, _, _) in enumerate(self.parts) if having[:, n].any()]


def at_any_byte(data: Bytes, size: int) -> NDArray[np.void]:
    """
    Return the entries of a size that begin at each of the bytes; they share its memory.

    They have no fields: numpy copies entries that have some field by field, far more slowly.
    """
    entries = max(data.size - size + 1, 0)
    return np.ndarray((entries,), f'V{size}', data.data, strides=(1,))
