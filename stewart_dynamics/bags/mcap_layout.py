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
Where the messages are in an MCAP file, by its index or by following its records one by one.

An index with a correct checksum is used. Otherwise the records are followed from the beginning to
the first damaged one; nothing after it is read. Records outside of chunks have no checksum, so the
length of each must agree with the lengths of its fields.
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

from stewart_dynamics.bags.mcap_scan import scanned, TIME

MAGIC = b'\x89MCAP0\r\n'
HEAD = 9  # of every record: opcode, and its length
# No recorder writes larger chunks; larger ones are not decompressed.
LARGEST_CHUNK = 1 << 27
INCONSISTENT = 'inconsistent lengths in a record'

_MESSAGE_HEAD = 22
_FOOTER = HEAD + 20 + len(MAGIC)
_DATA_END = HEAD + 4
_LARGEST_INDEX = 1 << 28
# Bytes read at once if there are no chunks.
_RUN = 1 << 20
_INDEX = 'the index at the end of the file'
# In place of something that two records declare differently.
_CONTRADICTORY: Any = None


class _Channel(NamedTuple):
    schema: int
    topic: str
    encoding: str


class Piece(NamedTuple):
    """A chunk, or successive messages outside of chunks."""

    start_time: int
    offset: int
    length: int
    is_chunk: bool


class McapLayout:
    """
    Position and type of the messages.

    Parameters
    ----------
    file : binary file
        An MCAP file.

    Attributes
    ----------
    size : int
        Of the file.
    missing : list of str
        What could not be read.
    schemas, channels : dict
        By their numbers; None where two records differ.
    pieces : list of Piece
        In the order of their first messages.
    messages : int or None
        Their number, if there is a valid index; None: the records were followed, and channels
        may be declared only in chunks.
    has_loose : bool
        There are messages outside of chunks without a checksum.

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
        # End of the data section, if there is a footer.
        self._data_end: int | None = None
        if not self._read_index():
            self._follow_records()
        self.pieces.sort()

    def read_at(self, offset: int, size: int) -> bytes:
        """Return bytes of the file."""
        self._file.seek(offset)
        return self._file.read(size)

    # The index

    def _read_index(self) -> bool:
        """Read the index at the end of the file; return whether it is valid and complete."""
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
        except Exception:  # any bytes can be there
            self.missing.append(_INDEX)
            self._data_end = None
            self._forget()
            return False

    def _took(self, summary: bytes, sure: bool) -> bool:
        """Use an index; discard it and return False if the records must be followed."""
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

    # The records

    def _follow_records(self) -> None:
        """Follow the records to the end of the data, and note where messages are."""
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
        """Note a chunk or a declaration; return what is wrong with the record."""
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
            # The others are not used, but their lengths must be consistent.
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
            return INCONSISTENT
        return '' if whole == length else INCONSISTENT

    def declared(self, opcode: int, content: bytes) -> str:
        """Note a schema or channel; return what is wrong with its record."""
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
        declared: Any = name
        if isinstance(record, Channel):
            table = self.channels
            declared = _Channel(record.schema_id, record.topic, record.message_encoding)
        if table.setdefault(record.id, declared) != declared:
            table[record.id] = _CONTRADICTORY
            self.note(f'{name}: declared differently by two records')

    def _note_run(self, at: int, until: int) -> int:
        """Note messages outside of chunks, and return where they end."""
        found, consumed, _ = scanned(self.read_at(at, until - at), only_messages=True)
        self.pieces.append(Piece(int(found[:, TIME].min()), at, consumed, is_chunk=False))
        return at + consumed

    def _check_loose(self, data_end: int) -> None:
        """
        Drop messages outside of chunks unless they are valid.

        They are covered by the checksum of the data section, if there is one. In a file
        without it and without chunks they are read, with a notice. A message between chunks is
        most likely another record, damaged.
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

    def note(self, what: str) -> None:
        """Note once what could not be read."""
        if what not in self.missing:
            self.missing.append(what)


def _skip_fields(stream: ReadDataStream, number: int) -> int:
    """Skip fields that begin with their length; return the number of bytes read in all."""
    for _ in range(number):
        length = stream.read4()
        if len(stream.read(min(length, _RUN))) < length:
            raise struct.error
    return stream.count
