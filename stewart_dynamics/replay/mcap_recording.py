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

A file is a chain of records (https://mcap.dev/spec), read here through the package ``mcap``. Most
messages are in chunks that carry a checksum of their content; the index at the end, which has a
checksum too, says where they are. Where there is no sound index the chain is followed from the
beginning to where it breaks: nothing behind that is read. No checksum covers the records
outside of chunks, so each must have the length that the lengths in it add up to.

mcap's own decompression does not bound what a chunk may become, and its reader makes an object
of every message; here a chunk is decompressed to no more than it declares, and the messages in it
are found by a compiled scan.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator, Mapping
from io import BytesIO
import math
from pathlib import Path
import struct
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader
import numpy as np
import zstandard

from stewart_dynamics.arrays import Bytes, Integers
from stewart_dynamics.errors import BagError, one_line
from stewart_dynamics.mechanics.jit import entry_point
from stewart_dynamics.replay.message_blocks import Block, lean, merged, split

MAGIC = b'\x89MCAP0\r\n'

_HEAD = 9  # of every record: opcode, and its length
_MESSAGE_HEAD = 22
_FOOTER = _HEAD + 20 + len(MAGIC)
_DATA_END = _HEAD + 4
# No recorder writes larger chunks; nor is more decompressed.
LARGEST_CHUNK = 1 << 27
_LARGEST_INDEX = 1 << 28
# What waits for its turn, in bytes and as a multiple of the file: more than chunks can hold that
# overlap in time, unless they are made to fill the memory.
_MOST_WAITING, _TIMES_THE_FILE = 1 << 30, 4
# So many bytes are read at once where there are no chunks.
_RUN = 1 << 20
_INDEX = 'the index at the end of the file'
_UNFIT = 'lengths in a record that do not fit each other'
# In place of what two records say differently.
_CONTRADICTORY: Any = None

# Columns of what scan finds.
_CHANNEL, _TIME, _START, _SIZE, _FOUND = range(5)


class _Channel(NamedTuple):
    schema: int
    topic: str
    encoding: str


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
        in place of the channel. Of what exceeds K only the number is counted.

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


class McapRecording:
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
            # Where the data end, and how many messages there are, where the index tells.
            self._data_end: int | None = None
            self._messages: int | None = None
            if not self._read_index():
                self._follow_chain()
            self._pieces.sort()
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic; that of one whose messages are not CDR says so."""
        kinds: dict[str, set[str]] = {}
        for channel in filter(None, self._channels.values()):
            kind = self._schemas.get(channel.schema) or 'message without a type'
            if channel.encoding != 'cdr':
                kind += f' encoded as {channel.encoding or "nothing"}'
            kinds.setdefault(channel.topic, set()).add(kind)
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def blocks(self, topics: Mapping[str, int]) -> Iterator[tuple[Block, int]]:
        """Yield these topics' messages as Source says; of one time as they are in the file."""
        numbers = np.full(1 << 16, -1, dtype=np.int64)
        for number, channel in self._channels.items():
            if channel:
                numbers[number] = topics.get(channel.topic, -1)
        waiting: list[tuple[int, Block]] = []  # in the order of the file
        reached, count = -1, 0
        for n, piece in enumerate(self._pieces):
            block = self._content(piece)
            if block is not None:
                count += len(block.times)
                block = block._replace(channels=numbers[block.channels])
                block = block.chosen(block.channels >= 0)
                if len(block.times) and block.times[0] < reached:
                    self.missing.append(f'the chunk at byte {piece.offset}: part of it was '
                                        'recorded earlier than it says')
                    block = block.chosen(block.times >= reached)
                if len(block.times):
                    insort(waiting, (piece.offset, lean(block)), key=lambda each: each[0])
            # What later pieces have is no earlier than their first message.
            until = self._pieces[n + 1].start_time if n + 1 < len(self._pieces) else math.inf
            if sum(len(block.data) for _, block in waiting) > max(
                    _MOST_WAITING, _TIMES_THE_FILE * self._size):
                until = math.inf
            ready, still = [], []
            for offset, block in waiting:
                if block.times[0] < until:
                    before, block = split(block, until)
                    ready.append(before)
                if len(block.times):
                    still.append((offset, block))
            waiting = still
            now = merged(ready)
            if len(now.times):
                reached = int(now.times[-1])
            yield now, piece.length
        if not self.missing and self._messages not in (None, count):
            self.missing.append(f'{self._messages} messages are in the index, {count} in chunks')

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _at(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    # The index

    def _read_index(self) -> bool:
        """Read the index at the file's end; return whether it is sound and tells of all."""
        try:
            footer_at = self._size - _FOOTER
            tail = self._at(max(footer_at, 0), _FOOTER)
            footer = next(StreamReader(BytesIO(tail), skip_magic=True).records)
            if not isinstance(footer, Footer) or not tail.endswith(MAGIC):
                raise ValueError
            start = footer.summary_start
            self._data_end = (start or footer_at) - _DATA_END
            if not start:
                return False
            if not 0 <= footer_at - start <= _LARGEST_INDEX:
                raise ValueError
            summary = self._at(start, self._size - start)
            if footer.summary_crc and zlib.crc32(
                    summary[:-len(MAGIC) - 4]) != footer.summary_crc:
                raise ValueError
            return self._took(summary, sure=bool(footer.summary_crc))
        except Exception:  # whatever stands there in place of an index
            self.missing.append(_INDEX)
            self._data_end = None
            self._forget()
            return False

    def _took(self, summary: bytes, sure: bool) -> bool:
        """Take an index in; forget it and return False where the chain must be followed."""
        statistics: Statistics | None = None
        for record in StreamReader(BytesIO(summary), skip_magic=True).records:
            if isinstance(record, Schema | Channel):
                self._declare(record)
            elif isinstance(record, ChunkIndex):
                self._pieces.append(_Piece(record.message_start_time, record.chunk_start_offset,
                                           record.chunk_length - _HEAD, is_chunk=True))
            elif isinstance(record, Statistics):
                statistics = record
        if sure and statistics is not None and (
                statistics.chunk_count == len(self._pieces)
                and (self._pieces or not statistics.message_count)
                and statistics.channel_count == len(self._channels)):
            self._messages = statistics.message_count
            return True
        self._forget()
        return False

    def _forget(self) -> None:
        self._schemas.clear()
        self._channels.clear()
        self._pieces.clear()

    # The chain

    def _follow_chain(self) -> None:
        """Follow the chain of records to the end of the data, and note where messages are."""
        at = len(MAGIC)
        while True:
            head = self._at(at, _HEAD).ljust(_HEAD, b'\0')
            opcode, length = head[0], int.from_bytes(head[1:], 'little')
            end = at + _HEAD + length
            fault = ''
            if end > self._size:
                fault = 'the file is cut off, or a length in it is wrong'
            elif opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD:
                end = self._note_run(at, max(end, min(at + _RUN, self._size)))
            elif opcode == Opcode.DATA_END and length == 4 and self._data_end in (None, at):
                break
            else:
                fault = self._fault(at, opcode, length)
            if fault:
                self.missing.append(f'byte {at} to the end: {fault}')
                at = 0
                break
            at = end
        if not all(piece.is_chunk for piece in self._pieces):
            self._check_loose(at)
        for piece in self._pieces:  # topics may be declared in them alone
            if piece.is_chunk:
                self._content(piece, say=False)

    def _fault(self, at: int, opcode: int, length: int) -> str:
        """Note a chunk, or what a record declares; return what is wrong with it."""
        self._file.seek(at + _HEAD)
        stream = ReadDataStream(self._file)
        try:
            if opcode == Opcode.CHUNK:
                start_time = stream.read8()
                stream.read(20)
                _skip_fields(stream, 1)
                whole = stream.count + 8 + stream.read8()
                if whole == length:
                    self._pieces.append(_Piece(start_time, at, length, is_chunk=True))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and length <= LARGEST_CHUNK:
                return self._declared(opcode, stream.read(length))
            # Nothing of the others is used, but their lengths tell that they are what they say.
            elif opcode == Opcode.MESSAGE_INDEX:
                stream.read2()
                whole = stream.count + 4 + stream.read4()
            elif opcode == Opcode.ATTACHMENT:
                stream.read(16)
                _skip_fields(stream, 2)
                whole = stream.count + 12 + stream.read8()
            elif opcode == Opcode.METADATA or (opcode == Opcode.HEADER and at == len(MAGIC)):
                whole = _skip_fields(stream, 2)
            else:
                return 'no record begins there'
        except (McapError, struct.error):
            return _UNFIT
        return '' if whole == length else _UNFIT

    def _declared(self, opcode: int, content: bytes) -> str:
        """Note what a record of a schema or channel says; return what is wrong with it."""
        stream = ReadDataStream(BytesIO(content))
        try:
            record = (Schema if opcode == Opcode.SCHEMA else Channel).read(stream)
        except (McapError, struct.error, UnicodeDecodeError):
            return 'a damaged record of a topic or type'
        if stream.count != len(content):
            return 'a damaged record of a topic or type'
        self._declare(record)
        return ''

    def _declare(self, record: Schema | Channel) -> None:
        """Note a schema or a channel; of two that differ neither is used."""
        table: dict[int, Any] = self._schemas
        name = record.name if isinstance(record, Schema) else record.topic
        said: Any = name
        if isinstance(record, Channel):
            table = self._channels
            said = _Channel(record.schema_id, record.topic, record.message_encoding)
        if table.setdefault(record.id, said) != said:
            table[record.id] = _CONTRADICTORY
            self._say(f'{name}: declared differently by two records')

    def _note_run(self, at: int, until: int) -> int:
        """Note messages that stand outside of chunks, and return where they end."""
        found, consumed, _ = _scanned(self._at(at, until - at), only_messages=True)
        self._pieces.append(_Piece(int(found[:, _TIME].min()), at, consumed, is_chunk=False))
        return at + consumed

    def _check_loose(self, data_end: int) -> None:
        """
        Drop what is outside of chunks unless it can be trusted.

        A checksum of the whole file covers it, where there is one. Where there is none nor
        are there chunks, it is the user who must know. A message among chunks is mostly another
        record, damaged.
        """
        chunks = [piece for piece in self._pieces if piece.is_chunk]
        expected = data_end and DataEnd.read(ReadDataStream(BytesIO(
            self._at(data_end + _HEAD, 4)))).data_section_crc
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

    def _say(self, what: str) -> None:
        if what not in self.missing:
            self.missing.append(what)

    # Chunks

    def _content(self, piece: _Piece, say: bool = True) -> Block | None:
        """Return what a piece holds, in the order of time; None, and say so, if damaged."""
        try:
            if piece.length > LARGEST_CHUNK:
                raise ValueError(f'{piece.length} bytes, at most {LARGEST_CHUNK} are read')
            data = (self._unpacked(piece) if piece.is_chunk
                    else self._at(piece.offset, piece.length))
            found, consumed, array = _scanned(data, only_messages=not piece.is_chunk)
            if consumed != len(data):
                raise ValueError('its records do not fit each other')
            for opcode, _, start, size in found[found[:, _CHANNEL] < 0].tolist():
                fault = self._declared(-opcode, bytes(data[start:start + size]))
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

    def _unpacked(self, piece: _Piece) -> bytes:
        """Return what is in a chunk; ValueError where its checksum or a size is wrong."""
        head = self._at(piece.offset, _HEAD)
        if head != bytes([Opcode.CHUNK]) + piece.length.to_bytes(8, 'little'):
            raise ValueError('there is none')
        stream = ReadDataStream(BytesIO(self._file.read(piece.length)))
        chunk = Chunk.read(stream)
        size, data = chunk.uncompressed_size, bytes(chunk.data)
        if stream.count != piece.length:
            raise ValueError(_UNFIT)
        if size > LARGEST_CHUNK:
            raise ValueError(f'{size} bytes, at most {LARGEST_CHUNK} are read')
        if chunk.compression == 'zstd':
            # What is declared in the chunk is all that may be allocated.
            if zstandard.frame_content_size(data) not in (-1, size):
                raise ValueError('its sizes do not fit each other')
            data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        elif chunk.compression == 'lz4':
            data = bytes(lz4.frame.LZ4FrameDecompressor().decompress(
                data, max_length=size + 1))
        elif chunk.compression:
            raise ValueError(f'compressed as {chunk.compression!r}, must be zstd or lz4')
        if len(data) != size:
            raise ValueError(f'{len(data)} bytes, must be {size}')
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise ValueError('its checksum is wrong')
        self.unchecked = self.unchecked or not (chunk.uncompressed_crc or size == 0)
        return data


def _skip_fields(stream: ReadDataStream, number: int) -> int:
    """Read over fields that have their length before them; return how much was read in all."""
    for _ in range(number):
        length = stream.read4()
        if len(stream.read(min(length, _RUN))) < length:
            raise struct.error
    return stream.count


def _scanned(data: bytes, only_messages: bool) -> tuple[Integers, int, Bytes]:
    array = np.frombuffer(bytearray(data), np.uint8)  # numba compiles anew for read-only ones
    count, _ = scan(array, only_messages, np.empty((0, _FOUND), np.int64))
    found = np.empty((count, _FOUND), np.int64)
    _, consumed = scan(array, only_messages, found)
    return found, consumed, array
