# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Messages that differ in nothing but their stamp and numbers, read and written many at once.

Nearly all messages of a topic have one layout: one message is read field by field, and the
others by comparing their bytes with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Bytes, Flags, Integers, SECOND, Stamps
from stewart_dynamics.core.binding import function, record
from stewart_dynamics.messages.cdr import ORDERS


class Layout:
    """
    Messages that differ in nothing but their stamp and numbers.

    message: one of them.
    numbers (offset, count): where doubles stand in it, in the order of their offsets.
    stamps: offsets of its stamps; by default that of a header, which reading requires.
    gaps: bytes that may be anything: those that only align what follows.
    """

    def __init__(
            self, message: bytes, numbers: Sequence[tuple[int, int]], stamps: Sequence[int] = (4,),
            gaps: Sequence[slice] = (),
    ) -> None:
        self.size = len(message)
        self.message, self.numbers, self.stamps = message, numbers, stamps
        self._row = np.frombuffer(message, f'V{self.size}')
        order = ORDERS[message[1]]
        numbers = [(at, count) for at, count in numbers if count]
        free = np.zeros(self.size, dtype=bool)
        for part in (*(slice(at, at + 8) for at in stamps),
                     *(slice(at, at + 8 * count) for at, count in numbers), *gaps):
            free[part] = True
        self.fixed: Bytes = np.where(free, 0, 255).astype(np.uint8)
        """255 for bytes that are the same in all messages, 0 for others."""
        # Runs of such bytes.
        edges = np.flatnonzero(np.diff(free, prepend=True, append=True)).tolist()
        runs = list(zip(edges[::2], edges[1::2], strict=True))
        self._stamps = [f'stamp at {at}' for at in stamps]
        self._parts = [f'numbers at {at}' for at, _ in numbers]
        self._fixed = {f'fixed at {begin}': np.void(message[begin:end]) for begin, end in runs}
        stamp = [('sec', f'{order}i4'), ('nanosec', f'{order}u4')]
        self._dtype = np.dtype({
            'names': [*self._stamps, *self._parts, *self._fixed],
            'formats': [*(stamp for _ in stamps),
                        *((f'{order}f8', (count,)) for _, count in numbers),
                        *(f'V{end - begin}' for begin, end in runs)],
            'offsets': [*stamps, *(at for at, _ in numbers), *(begin for begin, _ in runs)],
            'itemsize': self.size})
        self._prepare_one(order, sorted([
            *((begin, f'{end - begin}s') for begin, end in runs), *((at, 'iI') for at in stamps),
            *((at, f'{count}d') for at, count in numbers)]))

    def _prepare_one(self, order: str, fields: Sequence[tuple[int, str]]) -> None:
        """Prepare reading and writing of a single message by a Struct of its fields."""
        layout, end = order, 0
        # By the kind of the fields: where their values are among all.
        places: dict[str, list[slice]] = {'s': [], 'I': [], 'd': []}
        for at, field in fields:
            layout += f'{at - Struct(layout).size}x{field}'
            begin, end = end, len(Struct(layout).unpack(bytes(Struct(layout).size)))
            places[field[-1]].append(slice(begin, end))
        self._struct = Struct(f'{layout}{self.size - Struct(layout).size}x')
        self._template = [*self._struct.unpack(self.message)]
        self._stamp_places, self._number_places = places['I'], places['d']
        values = [n for place in places['d'] for n in range(place.start, place.stop)]
        self._values = values_at(values)
        self._constant = itemgetter(*(place.start for place in places['s']))
        self._expected = self._constant(self._template)

    def read_one(self, data: bytes) -> tuple[int, tuple[float, ...]] | None:
        """Return stamp [ns] and numbers of a message with a stamp; None if of another layout."""
        if len(data) != self.size:
            return None
        fields = self._struct.unpack(data)
        if fields[2] >= SECOND or self._constant(fields) != self._expected:
            return None
        return fields[1] * SECOND + fields[2], self._values(fields)

    def read(self, data: Bytes, starts: Integers) -> tuple[Flags, Stamps, Array]:
        """
        Return which messages have this layout (N,), their stamps (N,) [ns] and numbers (N, ...).

        Stamps and numbers of the others mean nothing.

        data (M,): bytes that have all the messages in them.
        starts (N,): where each begins; each is of ``size``.
        """
        rows = at_any_byte(data, self.size)[starts].view(self._dtype)
        stamp, = (rows[name] for name in self._stamps)
        stamps: Stamps = stamp['sec'].astype(np.int64) * SECOND + stamp['nanosec']
        alike: Flags = stamp['nanosec'] < SECOND
        for name, fixed in self._fixed.items():
            alike &= rows[name] == fixed
        if not self._parts:
            return alike, stamps, np.empty((len(rows), 0))
        numbers = np.concatenate([rows[name] for name in self._parts], axis=1)
        return alike, stamps, numbers.astype(float, copy=False)

    def write_one(self, stamp: int, *numbers: Iterable[float]) -> bytes:
        """Return a message of a stamp [ns] and the numbers of each part."""
        fields = self._template.copy()
        for place in self._stamp_places:
            fields[place] = divmod(stamp, SECOND)
        for place, values in zip(self._number_places, numbers, strict=True):
            fields[place] = values
        return self._struct.pack(*fields)

    def write(self, stamps: Integers | None, *numbers: Array) -> NDArray[np.void]:
        """Return messages (N,), each an entry of ``size`` bytes; each part's numbers (N, ...)."""
        messages = self._row.repeat(len(numbers[0]))
        rows = messages.view(self._dtype)
        if stamps is not None:
            seconds, nanoseconds = np.divmod(stamps, SECOND)
            for name in self._stamps:
                rows[name]['sec'], rows[name]['nanosec'] = seconds, nanoseconds
        for name, values in zip(self._parts, numbers, strict=True):
            rows[name] = values
        return messages


def values_at(places: Sequence[int]) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Return a function that returns the values at some places, fast where these are many."""
    if len(places) > 1:
        return itemgetter(*places)
    return lambda values: tuple(values[place] for place in places)


class Written(NamedTuple):
    """Messages of a topic that are written from a row of numbers, for rows that have it."""

    topic: str
    layout: Layout
    columns: Sequence[slice]  # of the row, for each part of the layout
    known: int = -1  # the message is for rows where this column is not nan,
    unknown: int = -1  # this one is nan,
    positive: int = -1  # this one is above zero; -1: any row


class SideBySide:
    """
    Messages of some topics, side by side, with a stamp and numbers of one row.

    kinds: the kinds of messages, in the order in which they are published.
    width: numbers in a row.
    """

    def __init__(self, kinds: Sequence[Written], width: int) -> None:
        stamps, parts, message = [], [], b''
        for kind in kinds:
            stamps += [len(message) + at for at in kind.layout.stamps]
            parts += [(len(message) + at, column.start, count) for (at, count), column in zip(
                kind.layout.numbers, kind.columns, strict=True)]
            message += kind.layout.message
        self._topics = [kind.topic for kind in kinds]
        self._entries = np.dtype([
            (str(n), f'V{kind.layout.size}') for n, kind in enumerate(kinds)])
        constants = (
            len(message), np.frombuffer(message, np.uint8),
            len(stamps), np.array(stamps, np.int64),
            len(parts), np.array(parts, record('message_part')), len(kinds),
            np.array([kind[3:] for kind in kinds], record('message_condition')), width)
        self._write = function('write_messages').bound(*constants)
        self._constants = constants

    def _memory(self, number: int) -> tuple[
            Sequence[NDArray[Any]], Integers, list[tuple[str, Flags, NDArray[np.void]]]]:
        """Return what the function in C writes: all, the numbers of messages, each topic."""
        kinds = len(self._topics)
        messages, having, numbers = (
            np.empty((number, self._entries.itemsize), np.uint8),
            np.empty((number, kinds), bool), np.empty(kinds, np.int64))
        entries = messages.view(self._entries)[:, 0]
        return (messages, having, numbers), numbers, [
            (topic, having[:, n], entries[str(n)]) for n, topic in enumerate(self._topics)]

    def write(self, stamps: Stamps, rows: Array) -> list[tuple[str, Flags, NDArray[np.void]]]:
        """
        Return the topics that have a message, which rows have it (N,), and the messages (N,).

        stamps (N,) [ns], rows (N, width).
        """
        memory, numbers, found = self._memory(len(stamps))
        self._write(len(stamps), stamps, np.ascontiguousarray(rows), *memory)
        return [each for number, each in zip(numbers.tolist(), found, strict=True) if number]

    def bound(self, stamp: Stamps, row: Array) -> Callable[[], dict[str, bytes]]:
        """
        Return a function that returns the messages of the numbers that an array has when called.

        It takes a third of the time of ``write``. Not thread-safe.

        stamp (1,) [ns], row (1, width): arrays that stay.
        """
        memory, numbers, _ = self._memory(1)
        write = function('write_messages').bound(*self._constants, 1, stamp, row, *memory)
        whole, having = memory[0].data, numbers.data
        ends = np.cumsum([0, *(kind.itemsize for kind, *_ in (
            self._entries.fields or {}).values())]).tolist()
        parts = list(zip(self._topics, ends[:-1], ends[1:], strict=True))

        def written() -> dict[str, bytes]:
            write()
            data = whole.tobytes()
            return {topic: data[begin:end] for has, (topic, begin, end) in zip(
                having, parts, strict=True) if has}

        return written


def at_any_byte(data: Bytes, size: int) -> NDArray[np.void]:
    """
    Return the entries of a size that begin at each of the bytes; they share its memory.

    They have no fields: numpy copies entries that have some field by field, far more slowly.
    """
    entries = max(data.size - size + 1, 0)
    return np.ndarray((entries,), f'V{size}', data.data, strides=(1,))
