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
Where the messages are in an MCAP file, by its index or by following the chain of its records.

A sound index is trusted: it has a checksum. Else the chain is followed from the beginning to where
it breaks; nothing behind that is read. No checksum covers the records of the chain that are
outside of chunks, so each must have the length that the lengths in it add up to.
"""

from __future__ import annotations

from io import BytesIO
import struct
from typing import Any, BinaryIO, NamedTuple
import zlib

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, DataEnd, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader

from stewart_dynamics.replay.mcap_scan import scanned, TIME

MAGIC = b'\x89MCAP0\r\n'
HEAD = 9  # of every record: opcode, and its length
# No recorder writes larger chunks; nor is more decompressed.
LARGEST_CHUNK = 1 << 27
UNFIT = 'lengths in a record that do not fit each other'

_MESSAGE_HEAD = 22
_FOOTER = HEAD + 20 + len(MAGIC)
_DATA_END = HEAD + 4
_LARGEST_INDEX = 1 << 28
# So many bytes are read at once where there are no chunks.
_RUN = 1 << 20
_INDEX = 'the index at the end of the file'
# In place of what two records say differently.
_CONTRADICTORY: Any = None


class _Channel(NamedTuple):
    schema: int
    topic: str
    encoding: str


class Piece(NamedTuple):
    """A chunk, or messages outside of chunks that stand one behind the other."""

    start_time: int
    offset: int
    length: int
    is_chunk: bool


class McapLayout:
    """
    Where the messages are, and what they are.

    Parameters
    ----------
    file : binary file
        An MCAP file.

    Attributes
    ----------
    size : int
        Of the file.
    missing : list of str
        What could not be read, in words.
    schemas, channels : dict
        By their numbers; None where two records differ.
    pieces : list of Piece
        In the order of their first messages.
    messages : int or None
        How many there are, if a sound index says so; else the chain was followed, and channels
        may be declared in chunks alone.
    has_loose : bool
        There are messages outside of chunks that no checksum covers.

    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.size = file.seek(0, 2)
        self.missing: list[str] = []
        self.schemas: dict[int, str] = {}
        self.channels: dict[int, _Channel] = {}
        self.pieces: list[Piece] = []
        self.messages: int | None = None
        self.has_loose = False
        # Where the data end, where a footer tells.
        self._data_end: int | None = None
        if not self._read_index():
            self._follow_chain()
        self.pieces.sort()

    def read_at(self, offset: int, size: int) -> bytes:
        """Return bytes of the file."""
        self._file.seek(offset)
        return self._file.read(size)

    # The index

    def _read_index(self) -> bool:
        """Read the index at the file's end; return whether it is sound and tells of all."""
        try:
            footer_at = self.size - _FOOTER
            tail = self.read_at(max(footer_at, 0), _FOOTER)
            footer = next(StreamReader(BytesIO(tail), skip_magic=True).records)
            if not isinstance(footer, Footer) or not tail.endswith(MAGIC):
                raise ValueError
            start = footer.summary_start
            self._data_end = (start or footer_at) - _DATA_END
            if not start:
                return False
            if not 0 <= footer_at - start <= _LARGEST_INDEX:
                raise ValueError
            summary = self.read_at(start, self.size - start)
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
                self.pieces.append(Piece(record.message_start_time, record.chunk_start_offset,
                                         record.chunk_length - HEAD, is_chunk=True))
            elif isinstance(record, Statistics):
                statistics = record
        if sure and statistics is not None and (
                statistics.chunk_count == len(self.pieces)
                and (self.pieces or not statistics.message_count)
                and statistics.channel_count == len(self.channels)):
            self.messages = statistics.message_count
            return True
        self._forget()
        return False

    def _forget(self) -> None:
        self.schemas.clear()
        self.channels.clear()
        self.pieces.clear()

    # The chain

    def _follow_chain(self) -> None:
        """Follow the chain of records to the end of the data, and note where messages are."""
        at = len(MAGIC)
        while True:
            head = self.read_at(at, HEAD).ljust(HEAD, b'\0')
            opcode, length = head[0], int.from_bytes(head[1:], 'little')
            end = at + HEAD + length
            fault = ''
            if end > self.size:
                fault = 'the file is cut off, or a length in it is wrong'
            elif opcode == Opcode.MESSAGE and length >= _MESSAGE_HEAD:
                end = self._note_run(at, max(end, min(at + _RUN, self.size)))
            elif opcode == Opcode.DATA_END and length == 4 and self._data_end in (None, at):
                break
            else:
                fault = self._fault(at, opcode, length)
            if fault:
                self.missing.append(f'byte {at} to the end: {fault}')
                at = 0
                break
            at = end
        if not all(piece.is_chunk for piece in self.pieces):
            self._check_loose(at)

    def _fault(self, at: int, opcode: int, length: int) -> str:
        """Note a chunk, or what a record declares; return what is wrong with it."""
        self._file.seek(at + HEAD)
        stream = ReadDataStream(self._file)
        try:
            if opcode == Opcode.CHUNK:
                start_time = stream.read8()
                stream.read(20)
                _skip_fields(stream, 1)
                whole = stream.count + 8 + stream.read8()
                if whole == length:
                    self.pieces.append(Piece(start_time, at, length, is_chunk=True))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and length <= LARGEST_CHUNK:
                return self.declared(opcode, stream.read(length))
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
            return UNFIT
        return '' if whole == length else UNFIT

    def declared(self, opcode: int, content: bytes) -> str:
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
        table: dict[int, Any] = self.schemas
        name = record.name if isinstance(record, Schema) else record.topic
        said: Any = name
        if isinstance(record, Channel):
            table = self.channels
            said = _Channel(record.schema_id, record.topic, record.message_encoding)
        if table.setdefault(record.id, said) != said:
            table[record.id] = _CONTRADICTORY
            self.say(f'{name}: declared differently by two records')

    def _note_run(self, at: int, until: int) -> int:
        """Note messages that stand outside of chunks, and return where they end."""
        found, consumed, _ = scanned(self.read_at(at, until - at), only_messages=True)
        self.pieces.append(Piece(int(found[:, TIME].min()), at, consumed, is_chunk=False))
        return at + consumed

    def _check_loose(self, data_end: int) -> None:
        """
        Drop what is outside of chunks unless it can be trusted.

        A checksum of the whole file covers it, where there is one. Where there is none nor
        are there chunks, it is the user who must know. A message among chunks is mostly another
        record, damaged.
        """
        chunks = [piece for piece in self.pieces if piece.is_chunk]
        expected = data_end and DataEnd.read(ReadDataStream(BytesIO(
            self.read_at(data_end + HEAD, 4)))).data_section_crc
        fault = ''
        if expected:
            found = 0
            for offset in range(0, data_end, _RUN):
                found = zlib.crc32(self.read_at(offset, min(_RUN, data_end - offset)), found)
            fault = 'the checksum of the file is wrong' if found != expected else ''
        elif chunks:
            fault = 'no checksum covers them'
        else:
            self.has_loose = True
        if fault:
            self.pieces = chunks
            self.missing.append(f'messages outside of chunks: {fault}')

    def say(self, what: str) -> None:
        """Note once what could not be read."""
        if what not in self.missing:
            self.missing.append(what)


def _skip_fields(stream: ReadDataStream, number: int) -> int:
    """Read over fields that have their length before them; return how much was read in all."""
    for _ in range(number):
        length = stream.read4()
        if len(stream.read(min(length, _RUN))) < length:
            raise struct.error
    return stream.count
