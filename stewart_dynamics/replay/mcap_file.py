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
from the beginning. No checksum covers the records that the chain is made of, so each must be
what it says in every length that it has; where one is not, the next chunk is looked for. The
index, which has a checksum, only tells which chunks there must be.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Iterator, Sequence
from io import BytesIO
import math
from pathlib import Path
import re
import struct
from struct import Struct
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, Footer, Statistics
import numpy as np
import zstandard

from stewart_dynamics.arrays import Bytes, Integers
from stewart_dynamics.errors import BagError, one_line
from stewart_dynamics.mechanics.jit import entry_point

MAGIC = b'\x89MCAP0\r\n'

_HEAD = Struct('<BQ')  # of every record: what it is, and its length
_CHUNK_HEAD = Struct('<QQQII')  # times of first and last message, size, checksum, a length
_LENGTH = Struct('<I')
_LONG = Struct('<Q')
_IDS = Struct('<HH')
_MESSAGE_HEAD = 22
_FOOTER = _HEAD.size + 20 + len(MAGIC)
# What begins a chunk, by all that is not left to chance: it is looked for in damaged files.
_CHUNK_BEGINS = re.compile(
    rb'\x06.{5}\0\0\0.{28}(?:\0{4}|\x03\0\0\0lz4|\x04\0\0\0zstd)', re.DOTALL)
# Enough of a record to see what it is.
_BEGIN = 64
_SUMMARY = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
            Opcode.METADATA_INDEX, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET}
_INDEX = 'the index at the end of the file'
# So many bytes are read at once where there are no chunks.
_RUN = 1 << 20
# No chunk and no index that a recorder writes is as large; one that says so is damaged.
_LARGEST = 1 << 30
_LATEST = np.iinfo(np.int64).max
_UNFIT = 'lengths in a record that do not fit each other'

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


class _Channel(NamedTuple):
    schema: int
    topic: str
    encoding: str


# In place of what two records say differently.
_CONTRADICTORY: Any = None


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
        at += 9 + int(length)
    return count, at


class McapFile:
    """
    What can be trusted in an MCAP file.

    Raises BagError for what is none, OSError where it cannot be read.

    Attributes
    ----------
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
            self._channels: dict[int, _Channel] = {}
            self._pieces: list[_Piece] = []
            # Of each chunk where it begins and the time of its first message.
            self._index: dict[int, int] = {}
            self._sure = False
            all_declared = self._read_index()
            self._walk()
            self._pieces.sort()
            if not all_declared:  # they are in the chunks
                for piece in self._pieces:
                    if piece.is_chunk:
                        self._content(piece, say=False)
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic; that of one whose messages are not CDR tells so."""
        kinds: dict[str, set[str]] = {}
        for channel in filter(None, self._channels.values()):
            kind = self._schemas.get(channel.schema) or 'message without a type'
            if channel.encoding != 'cdr':
                kind += f' encoded as {channel.encoding or "nothing"}'
            kinds.setdefault(channel.topic, set()).add(kind)
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[Block, dict[int, str], int]]:
        """
        Yield these topics' messages in the order of time, as they are in the file where it is one.

        Yields blocks, the topic of each channel, and the bytes of the file that were read.
        """
        topic_of = {number: channel.topic for number, channel in self._channels.items()
                    if channel and channel.topic in topics}
        wanted = list(topic_of)
        waiting: list[tuple[int, Block]] = []  # in the order of the file
        reached = -1
        for n, piece in enumerate(self._pieces):
            block = self._content(piece)
            if block is not None:
                block = _chosen(block, np.isin(block.channels, wanted))
                if len(block.times) and block.times[0] < reached:
                    self.missing.append(f'the chunk at byte {piece.offset}: part of it was '
                                        'recorded earlier than it says')
                    block = _chosen(block, block.times >= reached)
                if len(block.times):
                    insort(waiting, (piece.offset, block))
            # What later pieces have is no earlier than their first message.
            until = self._pieces[n + 1].start_time if n + 1 < len(self._pieces) else math.inf
            ready, still = [], []
            for offset, block in waiting:
                if block.times[0] < until:
                    before, block = _split(block, until)
                    ready.append(before)
                if len(block.times):
                    still.append((offset, block))
            waiting = still
            merged = _merged(ready)
            if len(merged.times):
                reached = int(merged.times[-1])
            yield merged, topic_of, piece.length

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _at(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _read_index(self) -> bool:
        """Read the index at the file's end; return whether it declares all topics."""
        topics = -1
        try:
            tail = self._at(max(self._size - _FOOTER, 0), _FOOTER)
            if len(tail) < _FOOTER or not tail.endswith(MAGIC) or tail[0] != Opcode.FOOTER:
                raise ValueError
            footer = Footer.read(_stream(tail[_HEAD.size:]))
            if not footer.summary_start:
                return False
            size = self._size - footer.summary_start - len(MAGIC)
            if not 0 <= size <= _LARGEST:
                raise ValueError
            summary = self._at(footer.summary_start, size)
            self._sure = bool(footer.summary_crc)
            if self._sure and zlib.crc32(summary[:-4]) != footer.summary_crc:
                raise ValueError
            for opcode, content in _records(summary):
                if opcode == Opcode.CHUNK_INDEX and self._sure:
                    chunk = ChunkIndex.read(_stream(content))
                    self._index[chunk.chunk_start_offset] = chunk.message_start_time
                elif opcode == Opcode.STATISTICS:
                    topics = Statistics.read(_stream(content)).channel_count
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._declare(opcode, content)
        except Exception:  # whatever stands there in place of an index
            self.missing.append(_INDEX)
            self._sure = False
            self._schemas.clear()
            self._channels.clear()
            self._index.clear()
            return False
        return topics == len(self._channels)

    def _walk(self) -> None:
        """Follow the chain of records and note where messages are."""
        at, data_end = len(MAGIC), 0
        while True:
            begin = self._at(at, _BEGIN)
            opcode, length = _HEAD.unpack(begin[:_HEAD.size].ljust(_HEAD.size, b'\0'))
            end = at + _HEAD.size + length
            if opcode == Opcode.FOOTER and at == self._size - _FOOTER:
                break
            fault = ''
            if end > self._size:
                fault = 'the file is cut off, or a length in it is wrong'
            elif opcode == Opcode.CHUNK:
                fault = self._note_chunk(at, begin)
            elif opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD:
                end = self._note_run(at, max(end, min(at + _RUN, self._size)))
            elif opcode == Opcode.DATA_END and length == 4:
                data_end = at
            elif not data_end or opcode not in _SUMMARY:
                fault = self._fault(at, opcode, length)
            if fault:
                end = self._next_chunk(at + 1)
                until = f'byte {end}' if end < self._size else 'the end'
                self.missing.append(f'byte {at} to {until}: {fault}')
                if end == self._size:
                    break
            at = end
        noted = {piece.offset for piece in self._pieces if piece.is_chunk}
        for offset in sorted(self._index.keys() - noted):
            if self._note_chunk(offset, self._at(offset, _BEGIN)):
                self.missing.append(f'byte {offset} on: there should be a chunk')
        if not all(piece.is_chunk for piece in self._pieces):
            self._check_loose(data_end)

    def _fault(self, at: int, opcode: int, length: int) -> str:
        """Note what a record declares; return what is wrong with it."""
        content = self._at(at + _HEAD.size, min(length, _RUN))  # an attachment may be long
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            return self._declare(opcode, content)
        # Nothing of the others is used, but their lengths tell that they are what they say.
        try:
            if opcode == Opcode.MESSAGE_INDEX:
                _, behind = _fields(content, 2, 1)
            elif opcode == Opcode.ATTACHMENT:
                _, behind = _fields(content, 16, 2)
                behind += 12 + _LONG.unpack_from(content, behind)[0]
            elif opcode == Opcode.METADATA or (opcode == Opcode.HEADER and at == len(MAGIC)):
                _, behind = _fields(content, 0, 2)
            else:
                return 'no record begins there'
        except struct.error:
            behind = -1
        return '' if behind == length else _UNFIT

    def _note_chunk(self, at: int, begin: bytes) -> str:
        """Note a chunk, or return what is wrong with it."""
        if not _is_chunk(begin) or at + _HEAD.size + _HEAD.unpack_from(begin)[1] > self._size:
            return _UNFIT
        start_time = self._index.get(at, _LONG.unpack_from(begin, _HEAD.size)[0])
        self._pieces.append(_Piece(start_time, at, _HEAD.unpack_from(begin)[1], is_chunk=True))
        return ''

    def _note_run(self, at: int, until: int) -> int:
        """Note messages that stand outside of chunks, and return where they end."""
        found, consumed, _ = _scanned(self._at(at, until - at), only_messages=True)
        self._pieces.append(_Piece(int(found[:, _TIME].min()), at, consumed, is_chunk=False))
        return at + consumed

    def _next_chunk(self, at: int) -> int:
        """Return where the next chunk begins, or the file's size."""
        for start in range(at, self._size, _RUN):
            data = self._at(start, _RUN + _BEGIN)
            for found in _CHUNK_BEGINS.finditer(data):
                if _is_chunk(data[found.start():found.start() + _BEGIN]):
                    return start + found.start()
        return self._size

    def _check_loose(self, data_end: int) -> None:
        """
        Drop what is outside of chunks unless it can be trusted.

        A checksum of the whole file covers it, where there is one. Where there is none nor
        are there chunks, it is the user who must know. A message among chunks is mostly another
        record, damaged.
        """
        chunks = [piece for piece in self._pieces if piece.is_chunk]
        expected = data_end and _LENGTH.unpack(self._at(data_end + _HEAD.size, 4))[0]
        fault = ''
        if expected:
            found = 0
            for offset in range(0, data_end, _RUN):
                found = zlib.crc32(self._at(offset, min(_RUN, data_end - offset)), found)
            fault = 'the checksum of the file is wrong' if found != expected else ''
        elif chunks:
            fault = 'no checksum covers them'
        else:
            self.unchecked = True
        if fault:
            self._pieces = chunks
            self.missing.append(f'messages outside of chunks: {fault}')

    def _declare(self, opcode: int, content: bytes) -> str:
        """Note a schema or a channel; return what is wrong with it."""
        table: dict[int, Any] = self._schemas if opcode == Opcode.SCHEMA else self._channels
        try:
            (name, encoding, _), behind = _fields(content, 2 if opcode == Opcode.SCHEMA else 4, 3)
            number, schema = _IDS.unpack_from(content)
            said = (name.decode() if opcode == Opcode.SCHEMA
                    else _Channel(schema, name.decode(), encoding.decode()))
        except (struct.error, UnicodeDecodeError):
            behind = -1
        if behind != len(content):
            return 'a damaged record of a topic or type'
        if table.setdefault(number, said) != said:
            self._say(f'{name.decode()}: declared differently by two records')
            if not self._sure:
                table[number] = _CONTRADICTORY
        return ''

    def _say(self, what: str) -> None:
        if what not in self.missing:
            self.missing.append(what)

    def _content(self, piece: _Piece, say: bool = True) -> Block | None:
        """Return what a piece holds, in the order of time; None, and say so, if damaged."""
        try:
            raw = memoryview(self._at(piece.offset, _HEAD.size + piece.length))
            data = self._opened(raw[_HEAD.size:]) if piece.is_chunk else raw[:piece.length]
            found, consumed, array = _scanned(data, only_messages=not piece.is_chunk)
            if consumed != len(data):
                raise ValueError('its records do not fit each other')
            for row in found[found[:, _CHANNEL] < 0].tolist():
                fault = self._declare(
                    -row[_CHANNEL], bytes(data[row[_START]:row[_START] + row[_SIZE]]))
                if fault:
                    raise ValueError(fault)
        except Exception as exc:  # damaged bytes: whatever the decompressors make of them
            if say:
                self.missing.append(f'the chunk at byte {piece.offset}: {one_line(exc)}')
            return None
        found = found[found[:, _CHANNEL] >= 0]
        if say and not np.isin(found[:, _CHANNEL], list(self._channels)).all():
            self._say('messages of a topic that no whole record declares')
        times = found[:, _TIME]
        if np.any(times[1:] < times[:-1]):
            found = found[np.argsort(times, kind='stable')]
        return Block(found[:, _CHANNEL], found[:, _TIME], found[:, _START], found[:, _SIZE],
                     array)

    def _opened(self, content: memoryview) -> bytes | memoryview:
        """Return what is in a chunk; ValueError where its checksum is wrong."""
        _, _, size, checksum, length = _CHUNK_HEAD.unpack_from(content)
        at = _CHUNK_HEAD.size + length
        compression = bytes(content[_CHUNK_HEAD.size:at]).decode()
        packed = content[at + _LONG.size:]
        data: bytes | memoryview = packed
        if size > _LARGEST:
            raise ValueError(f'a size of {size} bytes')
        if compression == 'zstd':
            # What is declared in the chunk is all that may be allocated.
            if zstandard.frame_content_size(packed) not in (-1, size):
                raise ValueError('its sizes do not fit each other')
            data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        elif compression == 'lz4':
            data = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
        elif compression:
            raise ValueError(f'compressed as {compression!r}, must be zstd or lz4')
        if len(data) != size:
            raise ValueError(f'{len(data)} bytes, must be {size}')
        if checksum and zlib.crc32(data) != checksum:
            raise ValueError('its checksum is wrong')
        self.unchecked = self.unchecked or not (checksum or size == 0)
        return data


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of records up to the footer; an error where they end too soon."""
    at = 0
    while True:
        opcode, length = _HEAD.unpack_from(data, at)
        if opcode == Opcode.FOOTER:
            return
        at += _HEAD.size + length
        yield opcode, data[at - length:at]


def _fields(content: bytes, at: int, number: int) -> tuple[list[bytes], int]:
    """Return fields that have their length before them, and where they end by it."""
    fields = []
    for _ in range(number):
        begin = at + _LENGTH.size
        at = begin + _LENGTH.unpack_from(content, at)[0]
        fields.append(content[begin:at])
    return fields, at


def _is_chunk(begin: bytes) -> bool:
    """Return whether a record that begins so is a chunk, by the lengths in it."""
    try:
        opcode, length = _HEAD.unpack_from(begin)
        behind = _CHUNK_HEAD.size + _CHUNK_HEAD.unpack_from(begin, _HEAD.size)[-1]
        size = _LONG.unpack_from(begin, _HEAD.size + behind)[0]
    except struct.error:
        return False
    return bool(opcode == Opcode.CHUNK and behind + _LONG.size + size == length)


def _scanned(data: bytes | memoryview, only_messages: bool) -> tuple[Integers, int, Bytes]:
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


def joined(blocks: Sequence[Block]) -> Block:
    """Return blocks as one, their messages one after the other."""
    if len(blocks) == 1:
        return blocks[0]
    if not blocks:
        return _EMPTY
    before = np.cumsum([0, *(len(block.data) for block in blocks[:-1])])
    channels, times, _, sizes, data = (np.concatenate(parts) for parts in zip(
        *blocks, strict=True))
    starts = np.concatenate([block.starts + n for block, n in zip(blocks, before, strict=True)])
    return Block(channels, times, starts, sizes, data)


def _merged(blocks: Sequence[Block]) -> Block:
    """Return blocks as one in the order of time; of one time the earlier blocks come first."""
    block = joined([_lean(each) for each in blocks] if len(blocks) > 1 else blocks)
    if np.any(block.times[1:] < block.times[:-1]):
        block = _chosen(block, np.argsort(block.times, kind='stable'))
    return block


def _split(block: Block, time: float) -> tuple[Block, Block]:
    """Return what is earlier than a time, and what is not."""
    at = len(block.times) if time > _LATEST else int(np.searchsorted(block.times, int(time)))
    return _chosen(block, slice(at)), _lean(_chosen(block, slice(at, None)))


def _lean(block: Block) -> Block:
    """Return a block that holds on to few bytes that are no messages of it."""
    return compact(block) if 2 * block.sizes.sum() < len(block.data) else block
