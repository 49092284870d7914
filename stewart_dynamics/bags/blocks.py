# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Blocks of recorded messages: merging, splitting, and bringing to a good length."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np
from stewart_dynamics.errors import one_line
from stewart_dynamics.messages.recorded import Messages
import zstandard

LATEST = int(np.iinfo(np.int64).max)
# No recorder writes larger chunks; larger ones are not decompressed.
LARGEST_CHUNK = 1 << 27
# Larger than any setpoint or leg state; larger messages are not decompressed.
LARGEST_MESSAGE = 1 << 16
# Larger rows of a table are not read.
LARGEST_ROW = 1 << 20
# Messages in a block: enough that the overhead of a numpy call is small, few enough that they fit
# into the processor's cache.
_FEWEST, IN_A_BLOCK = 4096, 16384
# Bytes from which a block may have fewer messages.
MOST_BYTES = 1 << 23
# Blocks of fewer bytes are not compacted.
_FEW_BYTES = 4096
_ZSTD = b'\x28\xb5\x2f\xfd'


class Source(Protocol):
    """
    A file of a recording.

    missing: descriptions of the parts that could not be read so far.
    unchecked: messages lacked the checksum that the format offers.
    topics: the type of each topic, and its encoding if that is not CDR.
    """

    missing: list[str]
    unchecked: bool

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic."""

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """
        Yield messages in the order of time, and the number of bytes read for them.

        keys: from topics in the file to the names under which their messages are given.
        """

    def close(self) -> None:
        """Close the file."""


def described(channels: Iterable[tuple[str, str, str]]) -> dict[str, str]:
    """Return the types of each topic, of channels given by topic, type and encoding."""
    kinds: dict[str, set[str]] = {}
    for topic, kind, encoding in channels:
        kinds.setdefault(topic, set()).add(
            kind if encoding == 'cdr' else f'{kind} encoded as {encoding or "nothing"}')
    return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}


def cost(block: Messages) -> int:
    """Return the memory that a block needs, with its index arrays [bytes]."""
    return len(block.data) + 32 * len(block.times) + 1000


def _joined(blocks: Sequence[Messages]) -> Messages:
    """Return the concatenation of blocks."""
    if len(blocks) == 1:
        return blocks[0]
    before = np.cumsum([0, *(len(block.data) for block in blocks[:-1])])
    of_topic, times, data, _, sizes = (np.concatenate(parts) for parts in zip(
        *(block[1:] for block in blocks), strict=True))
    starts = np.concatenate([block.starts + n for block, n in zip(blocks, before, strict=True)])
    return Messages(blocks[0].topics, of_topic, times, data, starts, sizes)


def merged(blocks: Sequence[Messages]) -> Messages:
    """Return blocks merged in the order of time; at equal times earlier blocks come first."""
    block = _joined([compact(each) for each in blocks] if len(blocks) > 1 else blocks)
    if np.any(block.times[1:] < block.times[:-1]):
        block = block.chosen(np.argsort(block.times, kind='stable'))
    return block


def split(block: Messages, time: int) -> tuple[Messages, Messages]:
    """Return the messages before a time, and the others."""
    at = len(block.times) if time > LATEST else int(np.searchsorted(block.times, time))
    return block.chosen(slice(at)), compact(block.chosen(slice(at, None)))


def compact(block: Messages) -> Messages:
    """Return a block without the bytes that belong to no message of it, if these are many."""
    if len(block.data) < _FEW_BYTES or 2 * (total := int(block.sizes.sum())) >= len(block.data):
        return block
    starts = np.cumsum(block.sizes) - block.sizes
    at = np.arange(total) + np.repeat(block.starts - starts, block.sizes)
    return block._replace(starts=starts, data=block.data[at])


class RowsFile:
    """A file of a format without checksums, read message by message, see Source."""

    def __init__(self) -> None:
        self.missing: list[str] = []
        self.unchecked = False

    def rows(self, keys: Mapping[str, str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time [ns] and bytes of each message of these topics, in order of time."""
        raise NotImplementedError

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source; an error ends them, and is noted."""
        names = tuple(dict.fromkeys(keys.values()))
        numbers = {topic: names.index(key) for topic, key in keys.items()}
        rows, count, more = self.rows(keys), 0, True
        while more:
            of_topic, times, messages, size = list[int](), list[int](), list[bytes](), 0
            more = False
            try:
                for topic, time, data in rows:
                    of_topic.append(numbers[topic])
                    times.append(time)
                    messages.append(data)
                    size += len(data)
                    if len(times) == _FEWEST or size >= MOST_BYTES:
                        more = True
                        break
            except Exception as exc:  # damaged bytes: the readers raise any exception
                self.missing.append(
                    f'everything after {count + len(times)} messages: {one_line(exc)}')
            count += len(times)
            yield Messages.from_bytes(names, of_topic, times, messages), size


def of_good_length(blocks: Iterator[tuple[Messages, int]]) -> Iterator[tuple[Messages, int]]:
    """Join short blocks, split long ones, and decompress compressed messages."""
    short: list[Messages] = []
    count = size = read = 0
    for whole, its_read in blocks:
        read += its_read
        for block in _decompressed(whole) if len(whole.times) else ():
            short.append(compact(block))
            count += len(block.times)
            size += cost(short[-1])
            if count >= _FEWEST or size >= MOST_BYTES:
                yield from _cut(_joined(short), read)
                short, count, size, read = [], 0, 0, 0
    if short:
        yield from _cut(_joined(short), read)


def _cut(block: Messages, read: int) -> Iterator[tuple[Messages, int]]:
    edges = range(0, len(block.times), IN_A_BLOCK)
    for first in edges:
        yield block.chosen(slice(first, first + IN_A_BLOCK)), read // len(edges)


def _decompressed(block: Messages) -> Iterator[Messages]:
    """
    Yield messages after decompression, if rosbag2 has compressed each of them.

    They are given in parts of limited size; a message that would be too large stays compressed,
    and is rejected as malformed.
    """
    # CDR never begins with this byte.
    if not np.any(block.data[block.starts[block.sizes > 0]] == _ZSTD[0]):
        yield block
        return
    messages: list[bytes] = []
    first = size = 0
    for n, (start, length) in enumerate(zip(
            block.starts.tolist(), block.sizes.tolist(), strict=True), start=1):
        message = block.data[start:start + length].tobytes()
        if message.startswith(_ZSTD):
            try:
                if zstandard.frame_content_size(message) <= LARGEST_MESSAGE:
                    message = zstandard.ZstdDecompressor().decompress(
                        message, max_output_size=LARGEST_MESSAGE)
            except zstandard.ZstdError:
                pass
        messages.append(message)
        size += len(message)
        if size >= MOST_BYTES or n == len(block.times):
            yield Messages.from_bytes(block.topics, block.of_topic[first:n].tolist(),
                                      block.times[first:n].tolist(), messages)
            messages, first, size = [], n, 0
