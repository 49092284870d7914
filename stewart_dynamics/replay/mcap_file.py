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
One MCAP file, whole, cut short or damaged: what of it can be trusted, in the order of time.

A file is a chain of records, each with its length before it (https://mcap.dev/spec). Most
messages are in chunks that carry a checksum of their content. Readers made for whole files find
chunks by the index at the end, and read nothing of a file without it; here the chain is walked
from the beginning, and the index only tells where to go on when the chain is broken.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
import struct
from struct import Struct
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema
import numpy as np
from numpy.typing import NDArray
import zstandard

from stewart_dynamics.compiled import entry_point
from stewart_dynamics.errors import BagError

Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

MAGIC = b'\x89MCAP0\r\n'

_HEAD = Struct('<BQ')  # of every record: what it is, and its length
_CHUNK_HEAD = Struct('<QQQII')  # times of first and last message, size, checksum, a length
_FOOTER = _HEAD.size + 20 + len(MAGIC)
_INDEX = 'the index at the end of the file'
_KNOWN = {int(code) for code in Opcode}
# Messages outside of chunks are read so many bytes at once.
_RUN = 1 << 20
# No chunk that a recorder writes is as large; one that says so is damaged.
_LARGEST = 1 << 32
_LATEST = np.iinfo(np.int64).max

# Columns of what scan finds.
_CHANNEL, _TIME, _START, _SIZE, _FOUND = range(5)


class Block(NamedTuple):
    """Messages in the order of time, M of them, and the bytes that they are in."""

    channels: Integers
    """(M,)"""
    times: Integers
    """When each was recorded (M,) [ns]."""
    starts: Integers
    """Where each begins in the bytes (M,)."""
    sizes: Integers
    """How long each is (M,)."""
    data: Bytes


class _Piece(NamedTuple):
    """A chunk, or messages outside of chunks that stand one behind the other."""

    start_time: int
    offset: int
    length: int
    is_chunk: bool


@entry_point
def scan(data: Bytes, only_messages: bool, found: Integers) -> tuple[int, int]:
    """
    Find the messages in a chain of records.

    Parameters
    ----------
    data : (M,)
        The chain's bytes.
    only_messages : bool
        End at the first record that is something else.
    found : (K, 4)
        Written: channel, time, where it begins, size; of schemas and channels minus the opcode
        in place of the channel. Of what is beyond K only the number is counted.

    Returns how many there are, and how many bytes the whole records have.

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
        at += 9 + length
    return count, at


class McapFile:
    """
    What can be trusted in an MCAP file.

    Raises BagError for what is none, OSError where it cannot be read.

    Attributes
    ----------
    topics : dict
        The type of each topic; that of one whose messages are not CDR tells so.
    missing : list of str
        What could not be read, in words.
    unchecked : bool
        Messages were read that no checksum covers.

    """

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = False
        self._file = path.open('rb')
        try:
            self._size = self._file.seek(0, 2)
            if self._at(0, len(MAGIC)) != MAGIC:
                raise BagError(f'{path}: not a bag that can be read: does not begin as an MCAP '
                               'file does')
            self._schemas: dict[int, str] = {}
            self._channels: dict[int, tuple[str, str]] = {}
            self._pieces: list[_Piece] = []
            self._walk(self._index())
            self._pieces.sort()
            if not self._channels or _INDEX in self.missing:
                # They stand in the chunks, and there is no index that repeats them.
                for piece in self._pieces:
                    self._content(piece, say=False)
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic."""
        return dict(self._channels.values())

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[Block, dict[int, str], int]]:
        """
        Yield these topics' messages in the order of time, as they were recorded where it is one.

        Yields blocks, the topic of each channel, and the bytes of the file that were read.
        """
        kept: Block | None = None
        for n, piece in enumerate(self._pieces):
            block = self._content(piece)
            if block is not None:
                wanted = [channel for channel, (topic, _) in self._channels.items()
                          if topic in topics]
                block = _chosen(block, np.isin(block.channels, wanted))
                kept = block if kept is None else _joined(kept, block)
            ready = None
            if kept is not None:
                # What later pieces have is no earlier than their first message.
                until = self._pieces[n + 1].start_time if n + 1 < len(self._pieces) else _LATEST
                ready, kept = _split(kept, until)
            yield (ready or _EMPTY, {c: topic for c, (topic, _) in self._channels.items()},
                   piece.length)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _at(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _index(self) -> list[int]:
        """Return where chunks begin by the index at the file's end; nothing if it is damaged."""
        try:
            tail = self._at(max(self._size - _FOOTER, 0), _FOOTER)
            if len(tail) < _FOOTER or not tail.endswith(MAGIC) or tail[0] != Opcode.FOOTER:
                raise ValueError
            footer = Footer.read(_stream(tail[_HEAD.size:]))
            if not footer.summary_start:
                return []
            summary = self._at(footer.summary_start,
                               self._size - footer.summary_start - len(MAGIC))
            if footer.summary_crc and zlib.crc32(summary[:-4]) != footer.summary_crc:
                raise ValueError
            chunks = []
            for opcode, content in _records(summary):
                if opcode == Opcode.CHUNK_INDEX:
                    chunks.append(ChunkIndex.read(_stream(content)).chunk_start_offset)
                else:
                    self._declare(opcode, content)
        except Exception:  # whatever stands there in place of an index
            self.missing.append(_INDEX)
            return []
        return sorted(chunks)

    def _walk(self, index: list[int]) -> None:
        """Follow the chain of records and note where messages are."""
        at = len(MAGIC)
        while True:
            head = self._at(at, _HEAD.size)
            if len(head) < _HEAD.size:
                self.missing = [f'what came after byte {self._size}: the file is cut off']
                break
            opcode, length = _HEAD.unpack(head)
            end = at + _HEAD.size + length
            if opcode == Opcode.DATA_END:
                self._check_loose(at, self._at(at + _HEAD.size, 4))
                break
            next_chunk = next((offset for offset in index if offset > at), self._size)
            fault = ''
            if opcode not in _KNOWN or opcode in (Opcode.FOOTER, 0):
                fault = 'no record begins there'
            elif end > self._size:
                fault = 'the file is cut off within a record'
            elif opcode == Opcode.CHUNK:
                fault = self._note_chunk(at, length)
            elif opcode == Opcode.MESSAGE:
                if at in index:
                    fault = 'a chunk should begin there'
                else:
                    end = self._note_run(at, min(next_chunk, max(end, at + _RUN), self._size))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                fault = self._declare(opcode, self._at(at + _HEAD.size, length))
            if not fault and end > next_chunk:
                fault = 'a record reaches beyond the beginning of the next chunk'
                self._pieces = [piece for piece in self._pieces if piece.offset < at]
            if fault:
                until = f'byte {next_chunk}' if next_chunk < self._size else 'the end'
                self.missing.append(f'byte {at} to {until}: {fault}')
                if next_chunk == self._size:
                    return
                end = next_chunk
            at = end
        noted = {piece.offset for piece in self._pieces if piece.is_chunk}
        for offset in index:
            if offset not in noted and not any(
                    said.startswith(f'byte {offset} ') for said in self.missing):
                self.missing.append(f'byte {offset} on: there should be a chunk')

    def _note_chunk(self, at: int, length: int) -> str:
        """Note a chunk, or return what is wrong with it."""
        head = self._at(at + _HEAD.size, _CHUNK_HEAD.size)
        if len(head) < _CHUNK_HEAD.size or length < _CHUNK_HEAD.size:
            return 'a chunk without a head'
        start_time, _, _, _, name = _CHUNK_HEAD.unpack(head)
        size = self._at(at + _HEAD.size + _CHUNK_HEAD.size + name, 8) if name < 99 else b''
        if len(size) < 8 or _CHUNK_HEAD.size + name + 8 + int.from_bytes(size, 'little') != length:
            return 'lengths in a chunk that do not fit each other'
        self._pieces.append(_Piece(start_time, at, length, is_chunk=True))
        return ''

    def _note_run(self, at: int, until: int) -> int:
        """Note messages that stand outside of chunks, and return where they end."""
        found, consumed, _ = _scanned(self._at(at, until - at), only_messages=True)
        if not len(found):
            return at + _HEAD.size + int(_HEAD.unpack(self._at(at, _HEAD.size))[1])
        self._pieces.append(_Piece(int(found[:, _TIME].min()), at, consumed, is_chunk=False))
        return at + consumed

    def _check_loose(self, end: int, checksum: bytes) -> None:
        """Check what is outside of chunks by the checksum of the file, where it has one."""
        if all(piece.is_chunk for piece in self._pieces):
            return
        expected, found = int.from_bytes(checksum, 'little'), 0
        if not expected:
            self.unchecked = True
            return
        for offset in range(0, end, _RUN):
            found = zlib.crc32(self._at(offset, min(_RUN, end - offset)), found)
        if found != expected:
            self._pieces = [piece for piece in self._pieces if piece.is_chunk]
            self.missing.append('the messages outside of chunks: the checksum of the file is '
                                'wrong')

    def _declare(self, opcode: int, content: bytes) -> str:
        """Note a schema or a channel; return what is wrong with it."""
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(_stream(content))
                self._schemas[schema.id] = schema.name
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(_stream(content))
                name = self._schemas.get(channel.schema_id, 'without a type')
                if channel.message_encoding != 'cdr':
                    name += f' encoded as {channel.message_encoding}'
                self._channels[channel.id] = channel.topic, name
        except Exception:  # bytes that are none: whatever their reader makes of them
            return 'a damaged record of a topic or type'
        return ''

    def _content(self, piece: _Piece, say: bool = True) -> Block | None:
        """Return what a piece holds, in the order of time; None, and say so, if damaged."""
        try:
            raw = self._at(piece.offset, _HEAD.size + piece.length)
            data = self._opened(raw[_HEAD.size:]) if piece.is_chunk else raw[:piece.length]
            found, consumed, array = _scanned(data, only_messages=not piece.is_chunk)
            if consumed != len(data):
                raise ValueError('its records do not fit each other')
            for row in found[found[:, _CHANNEL] < 0].tolist():
                fault = self._declare(-row[_CHANNEL], data[row[_START]:row[_START] + row[_SIZE]])
                if fault:
                    raise ValueError(fault)
            found = found[found[:, _CHANNEL] >= 0]
            if not np.isin(found[:, _CHANNEL], list(self._channels)).all():
                raise ValueError('messages of a topic that is not declared')
            times = found[:, _TIME]
            if piece.is_chunk and len(times) and times.min() < min(piece.start_time, _LATEST):
                raise ValueError('it begins earlier than it says')
        except Exception as exc:  # damaged bytes: whatever the decompressors make of them
            if say:
                what = ' '.join(f'{exc}'.split()) or type(exc).__name__
                self.missing.append(f'the chunk at byte {piece.offset}: {what}')
            return None
        if np.any(times[1:] < times[:-1]):
            found = found[np.argsort(times, kind='stable')]
        return Block(found[:, _CHANNEL], found[:, _TIME], found[:, _START], found[:, _SIZE],
                     array)

    def _opened(self, content: bytes) -> bytes:
        """Return what is in a chunk; ValueError where its checksum is wrong."""
        _, _, size, checksum, length = _CHUNK_HEAD.unpack_from(content)
        at = _CHUNK_HEAD.size + length
        compression = content[_CHUNK_HEAD.size:at].decode()
        packed = content[at + 8:]
        if size > _LARGEST:
            raise ValueError(f'a size of {size} bytes')
        if compression == 'zstd':
            data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        elif compression == 'lz4':
            data = lz4.frame.decompress(packed)
        elif compression:
            raise ValueError(f'compressed as {compression!r}, must be zstd or lz4')
        else:
            data = packed
        if len(data) != size:
            raise ValueError(f'{len(data)} bytes, must be {size}')
        if checksum and zlib.crc32(data) != checksum:
            raise ValueError('its checksum is wrong')
        self.unchecked = self.unchecked or not checksum
        return bytes(data)


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of records; struct.error where they end too soon."""
    at = 0
    while at < len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        if opcode == Opcode.FOOTER:
            return
        at += _HEAD.size + length
        if at > len(data):
            raise struct.error
        yield opcode, data[at - length:at]


def _scanned(data: bytes, only_messages: bool) -> tuple[Integers, int, Bytes]:
    array = np.frombuffer(bytearray(data), np.uint8)  # numba compiles anew for read-only ones
    count, _ = scan(array, only_messages, np.empty((0, _FOUND), np.int64))
    found = np.empty((count, _FOUND), np.int64)
    _, consumed = scan(array, only_messages, found)
    return found, consumed, array


_NONE = np.empty(0, np.int64)
_EMPTY = Block(_NONE, _NONE, _NONE, _NONE, np.empty(0, np.uint8))


def _chosen(block: Block, which: Any) -> Block:
    return Block(block.channels[which], block.times[which], block.starts[which],
                 block.sizes[which], block.data)


def compact(block: Block) -> Block:
    """Return a block whose bytes are its messages and nothing else."""
    ends = np.cumsum(block.sizes)
    begins = ends - block.sizes
    at = np.arange(ends[-1] if len(ends) else 0) + np.repeat(block.starts - begins, block.sizes)
    return block._replace(starts=begins, data=block.data[at])


def _joined(one: Block, two: Block) -> Block:
    """Return two blocks as one, in the order of time."""
    one = compact(one)
    both = Block(
        np.concatenate([one.channels, two.channels]), np.concatenate([one.times, two.times]),
        np.concatenate([one.starts, two.starts + len(one.data)]),
        np.concatenate([one.sizes, two.sizes]), np.concatenate([one.data, two.data]))
    if len(one.times) and len(two.times) and two.times[0] < one.times[-1]:
        order = np.argsort(both.times, kind='stable')
        both = _chosen(both, order)
    return both


def _split(block: Block, time: int) -> tuple[Block, Block | None]:
    """Return what is not later than a time, and what is."""
    at = int(np.searchsorted(block.times, min(time, _LATEST), side='right'))
    if at == len(block.times):
        return block, None
    return _chosen(block, slice(at)), _chosen(block, slice(at, None))
