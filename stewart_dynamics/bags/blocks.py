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


"""Recorded messages in blocks; merging, splitting and compacting of blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from stewart_dynamics.arrays import Bytes, Integers
from stewart_dynamics.compilation.functions import entry_point
import zstandard

# Messages in a block: enough that the overhead of a numpy call is small, few enough that they fit
# into the processor's cache.
_FEWEST, _MOST = 4096, 16384
# Bytes from which a block may have fewer messages.
_MOST_BYTES = 1 << 23
# Larger than any setpoint or leg state; larger messages are not decompressed.
LARGEST_MESSAGE = 1 << 20
_ZSTD = b'\x28\xb5\x2f\xfd'
_LATEST = np.iinfo(np.int64).max


class Block(NamedTuple):
    """M messages in the order of time, and the bytes that contain them."""

    channels: Integers
    """(M,)"""
    times: Integers
    """When each was recorded (M,) [ns]."""
    starts: Integers
    """Start of each in the bytes (M,)."""
    sizes: Integers
    """Length of each (M,) [bytes]."""
    data: Bytes

    def chosen(self, which: Any) -> Block:
        """Return some of the messages: a slice, or a mask or an index (M,)."""
        return Block(self.channels[which], self.times[which], self.starts[which],
                     self.sizes[which], self.data)


class Source(Protocol):
    """
    A file of a recording.

    Attributes
    ----------
    missing : list of str
        What could not be read so far.
    unchecked : bool
        Messages without a checksum were read.
    topics : dict
        The type of each topic, and its encoding if that is not CDR.

    """

    missing: list[str]
    unchecked: bool

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic."""

    def blocks(self, topics: Mapping[str, int]) -> Iterator[tuple[Block, int]]:
        """
        Yield messages in the order of time, and the number of bytes read for them.

        Parameters
        ----------
        topics : mapping
            The number of each topic to be read, which replaces the channel of its messages.

        """

    def close(self) -> None:
        """Close the file."""


_NONE = np.empty(0, np.int64)
EMPTY = Block(_NONE, _NONE, _NONE, _NONE, np.empty(0, np.uint8))


def block_of(channels: Sequence[int] | Integers, times: Sequence[int] | Integers,
             messages: Sequence[bytes]) -> Block:
    """Return a block of single messages."""
    sizes = np.array([len(message) for message in messages], dtype=np.int64)
    return Block(np.array(channels, dtype=np.int64), np.array(times, dtype=np.int64),
                 np.cumsum(sizes) - sizes, sizes,
                 np.frombuffer(bytearray(b''.join(messages)), dtype=np.uint8))


def joined(blocks: Sequence[Block]) -> Block:
    """Return the concatenation of blocks."""
    if len(blocks) == 1:
        return blocks[0]
    if not blocks:
        return EMPTY
    before = np.cumsum([0, *(len(block.data) for block in blocks[:-1])])
    channels, times, _, sizes, data = (np.concatenate(parts) for parts in zip(
        *blocks, strict=True))
    starts = np.concatenate([block.starts + n for block, n in zip(blocks, before, strict=True)])
    return Block(channels, times, starts, sizes, data)


def merged(blocks: Sequence[Block]) -> Block:
    """Return blocks merged in the order of time; at equal times earlier blocks come first."""
    block = joined([lean(each) for each in blocks] if len(blocks) > 1 else blocks)
    if np.any(block.times[1:] < block.times[:-1]):
        block = block.chosen(np.argsort(block.times, kind='stable'))
    return block


def split(block: Block, time: float) -> tuple[Block, Block]:
    """Return the messages before a time, and the others."""
    at = len(block.times) if time > _LATEST else int(np.searchsorted(block.times, int(time)))
    return block.chosen(slice(at)), lean(block.chosen(slice(at, None)))


@entry_point('u1[::1]', 'i8[::1]', 'i8[::1]', 'u1[::1]')
def _gather(data: Bytes, starts: Integers, sizes: Integers, out: Bytes) -> None:
    """Copy messages, one after the other."""
    at = 0
    for n in range(len(starts)):
        for k in range(starts[n], starts[n] + sizes[n]):
            out[at] = data[k]
            at += 1


# The machine code that blocks need.
FUNCTIONS = (_gather,)


def lean(block: Block) -> Block:
    """Return a block without the bytes that belong to no message of it, if these are many."""
    total = int(block.sizes.sum())
    if 2 * total >= len(block.data):
        return block
    data = np.empty(total, dtype=np.uint8)
    _gather(block.data, block.starts, block.sizes, data)
    return block._replace(starts=np.cumsum(block.sizes) - block.sizes, data=data)


def of_good_length(blocks: Iterator[tuple[Block, int]]) -> Iterator[tuple[Block, int]]:
    """Join short blocks, split long ones, and decompress compressed messages."""
    short: list[Block] = []
    many = size = read = 0
    for whole, its_read in blocks:
        read += its_read
        for block in _decompressed(whole):
            if len(block.times):
                short.append(lean(block))
                many += len(block.times)
                size += len(short[-1].data)
            if many >= _FEWEST or size >= _MOST_BYTES:
                yield from _cut(joined(short), read)
                short, many, size, read = [], 0, 0, 0
    yield from _cut(joined(short), read)


def _cut(block: Block, read: int) -> Iterator[tuple[Block, int]]:
    edges = range(0, len(block.times), _MOST)
    for first in edges:
        yield block.chosen(slice(first, first + _MOST)), read // len(edges)


def _decompressed(block: Block) -> Iterator[Block]:
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
        if size >= _MOST_BYTES or n == len(block.times):
            yield block_of(block.channels[first:n], block.times[first:n], messages)
            messages, first, size = [], n, 0
