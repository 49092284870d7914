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
One MCAP file, whole, cut short or damaged: its valid messages in the order of time.

An index with a correct checksum is used. Otherwise the records are followed from the beginning to
the first damaged one; nothing after it is read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader
import numpy as np

from stewart_dynamics.arrays import Integers
from stewart_dynamics.bags.blocks import (
    compact, cost, described, IN_A_BLOCK, LARGEST_CHUNK, LATEST, merged, split)
from stewart_dynamics.bags.mcap_scan import HEAD, IGNORED, NUMBERS, Scan, scanned, UNDECLARED
from stewart_dynamics.errors import BagError, one_line, shown
from stewart_dynamics.messages.recorded import Messages
import zstandard

MAGIC = b'\x89MCAP0\r\n'

_FOOTER = HEAD + 20 + len(MAGIC)
_DATA_END = bytes([Opcode.DATA_END, 4, 0, 0, 0, 0, 0, 0, 0])
_EMPTY_CHUNK = 64  # bytes; a chunk with a message is longer
_LARGEST_INDEX = 1 << 28
_WINDOW = 1 << 20
_MOST_WAITING = 1 << 27
_NO_TOPIC = np.full(NUMBERS, IGNORED)
_ANY_TOPIC = np.zeros(NUMBERS, np.int64)
_CONTRADICTORY = 'a damaged or contradictory record of a topic or type'
_DECLARATIONS: dict[int, Any] = {-Opcode.SCHEMA: Schema, -Opcode.CHANNEL: Channel}
_IN_CHUNK = np.isin(np.arange(256), [Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE])
_IN_DATA = _IN_CHUNK | np.isin(np.arange(256), [
    Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA])


class _Piece(NamedTuple):
    """A chunk, or records outside of chunks."""

    time: int
    """Time before which it contains no message [ns]."""
    start: int
    length: int
    is_chunk: bool


class McapFile:
    """
    The valid messages of an MCAP file.

    Raises BagError if it is not an MCAP file, OSError if it cannot be read.

    Attributes
    ----------
    missing : list of str
        Descriptions of the parts that could not be read.
    unchecked : bool
        Messages without a checksum were read.

    """

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = False
        self._types: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}
        self._declared: set[int] = set()
        self._undeclared = 0
        self._file = path.open('rb')
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError('does not begin like an MCAP file')
            self._size = self._file.seek(0, 2)
            pieces = self._indexed()
            if pieces is None:
                for known in (self._types, self._channels, self._declared):
                    known.clear()
                pieces = self._followed()
            self._pieces = sorted(pieces)
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        return described(
            (channel.topic, self._types.get(channel.schema_id) or 'message without a type',
             channel.message_encoding) for channel in self._channels.values())

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source; those of one time in file order."""
        names = tuple(dict.fromkeys(keys.values()))
        numbers = np.full(NUMBERS, UNDECLARED)
        for number, channel in self._channels.items():
            numbers[number] = (names.index(keys[channel.topic]) if channel.topic in keys
                               else IGNORED)
        # First time, position in the file, messages.
        waiting: list[tuple[int, tuple[int, int], Messages]] = []
        starts = [*(piece.time for piece in self._pieces), LATEST + 1]
        reached, held, read = -1, 0, 0
        self._undeclared = 0
        for n, piece in enumerate(self._pieces):
            until = starts[n + 1]  # later pieces contain nothing earlier
            read += piece.length
            for first, part in self._parts(piece, names, numbers, reached):
                held += cost(part)
                heappush(waiting, (int(part.times[0]), (piece.start, first), part))
            if held > _MOST_WAITING and until <= LATEST:
                self._note(f'chunks overlap in time by more than {_MOST_WAITING >> 20} MB of '
                           'messages: those too late to be sorted are not read')
                until = LATEST + 1
            ready = []
            while waiting and waiting[0][0] < until:
                _, position, part = heappop(waiting)
                held -= cost(part)
                before, part = split(part, until)
                reached = max(reached, int(before.times[-1]))
                ready.append((position, before))
                if len(part.times):
                    held += cost(part)
                    heappush(waiting, (int(part.times[0]), position, part))
            if ready:
                ready.sort(key=lambda each: each[0])
                yield merged([part for _, part in ready]), read
                read = 0
        if self._undeclared:
            self._note('messages on a channel that no valid record declares')

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _parts(self, piece: _Piece, names: tuple[str, ...], numbers: Integers,
               reached: int) -> list[tuple[int, Messages]]:
        """Return the messages of a piece in the order of time, in parts of limited number."""
        found = self._content(piece, numbers)
        if found is None:
            return []
        self._undeclared += found.undeclared
        block = Messages(names, found.kinds, found.times, found.data, found.starts, found.sizes)
        if np.any(block.of_topic < 0):
            block = block.chosen(block.of_topic >= 0)
        if np.any(block.times[1:] < block.times[:-1]):
            block = block.chosen(np.argsort(block.times, kind='stable'))
        if len(block.times) and block.times[0] < reached:
            self.missing.append(f'the chunk at byte {piece.start - HEAD}: part of it is earlier '
                                'than its declared start')
            block = block.chosen(block.times >= reached)
        return [(first, compact(block.chosen(slice(first, first + IN_A_BLOCK))))
                for first in range(0, len(block.times), IN_A_BLOCK)]

    def _read_at(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _note(self, what: str) -> None:
        """Add a part that could not be read to ``missing``, once."""
        if what not in self.missing:
            self.missing.append(what)

    def _indexed(self) -> list[_Piece] | None:
        """Return the chunks by the index at the end of the file; None if it cannot be used."""
        try:
            tail = self._read_at(max(self._size - _FOOTER, 0), _FOOTER)
            footer = next(StreamReader(BytesIO(tail), skip_magic=True).records)
            if not isinstance(footer, Footer) or not tail.endswith(MAGIC):
                raise ValueError
            start = footer.summary_start
            if not start or not footer.summary_crc:
                return None
            if not _FOOTER <= self._size - start <= _LARGEST_INDEX:
                raise ValueError
            summary = self._read_at(start, self._size - start)
            if zlib.crc32(summary[:-len(MAGIC) - 4]) != footer.summary_crc:
                raise ValueError
            chunks: list[_Piece] = []
            statistics = None
            for record in StreamReader(BytesIO(summary), skip_magic=True).records:
                if isinstance(record, ChunkIndex):
                    chunks.append(_Piece(
                        min(record.message_start_time, LATEST), record.chunk_start_offset + HEAD,
                        record.chunk_length - HEAD, True))
                elif isinstance(record, Statistics):
                    statistics = record
                elif isinstance(record, Schema | Channel):
                    self._declare(record)
        except Exception:  # any bytes can be there
            self.missing.append('the index at the end of the file')
            return None
        # No chunk is listed twice: the time of reading grows with the size of the file.
        chunks.sort(key=lambda each: each.start)
        ends = [each.start - HEAD for each in chunks[1:]] + [start] * bool(chunks)
        if statistics is None or statistics.chunk_count != len(chunks) or (
                statistics.message_count and not chunks) or any(
                each.start + each.length > end for each, end in zip(chunks, ends, strict=True)):
            return None
        return chunks

    def _followed(self) -> list[_Piece]:
        """Follow the records to the end of the data; return where messages are."""
        chunks, runs, at = list[_Piece](), list[_Piece](), len(MAGIC)
        while True:
            found = scanned(self._read_at(at, _WINDOW), _ANY_TOPIC, _IN_DATA)
            ends = at + found.starts + found.sizes
            count = int(np.sum(ends <= self._size))  # only the last can extend beyond the file
            if not count:
                break
            loose = np.flatnonzero(found.kinds[:count] == 0)
            if len(loose):
                runs.append(_Piece(int(found.times[loose].min()), at, int(ends[loose[-1]]) - at,
                                   False))
            for n in np.flatnonzero(found.kinds[:count]):
                kind, start, size = int(found.kinds[n]), int(found.starts[n]), int(found.sizes[n])
                if kind == -Opcode.CHUNK and size > _EMPTY_CHUNK:
                    chunks.append(_Piece(int(found.times[n]), at + start, size, True))
                elif kind in _DECLARATIONS:
                    try:
                        self._read_declaration(
                            kind, self._read_at(at + start, min(size, LARGEST_CHUNK)))
                    except Exception as exc:  # any bytes can be there
                        self._note(one_line(exc))
            at = int(ends[count - 1])
        end = self._read_at(at, HEAD + 4)
        if end[:HEAD] != _DATA_END:
            self.missing.append(f'byte {at} to the end: the file is cut off, or no record begins '
                                'there')
        for piece in chunks:
            self._content(piece, _NO_TOPIC, note=False)  # topics declared in chunks
        if chunks and runs:  # a damaged record can look like a message
            self._note('messages outside of chunks: no checksum covers them')
        elif runs and end[:HEAD] == _DATA_END and any(end[HEAD:]):
            checksum = 0
            for offset in range(0, at, _WINDOW):
                checksum = zlib.crc32(self._read_at(offset, min(_WINDOW, at - offset)), checksum)
            if checksum != int.from_bytes(end[HEAD:], 'little'):
                self._note('messages outside of chunks: the checksum of the file is wrong')
                return []
        else:
            self.unchecked = bool(runs)
        return chunks or runs

    def _read_declarations(self, found: Scan) -> None:
        for n in np.flatnonzero(np.isin(found.kinds, list(_DECLARATIONS))):
            start = found.starts[n]
            self._read_declaration(
                int(found.kinds[n]), found.data[start:start + found.sizes[n]].tobytes())

    def _read_declaration(self, kind: int, content: bytes) -> None:
        """Note a schema or a channel, see ``_declare``; repetitions are not read again."""
        if (known := hash((kind, content))) not in self._declared:
            stream = ReadDataStream(BytesIO(content))
            record = _DECLARATIONS[kind].read(stream)
            if stream.count != len(content) or len(self._declared) >= 4 * NUMBERS:
                raise ValueError(_CONTRADICTORY)
            self._declare(record)
            self._declared.add(known)

    def _declare(self, record: Schema | Channel) -> None:
        """Note a schema or a channel; ValueError if it differs from an earlier one of its id."""
        if isinstance(record, Schema):
            same = self._types.setdefault(record.id, record.name) == record.name
        else:
            same = _used(self._channels.setdefault(record.id, record)) == _used(record)
        if not same:
            raise ValueError(_CONTRADICTORY)

    def _content(self, piece: _Piece, numbers: Integers, note: bool = True) -> Scan | None:
        """Return the records of a piece; None, and a note, if it is damaged."""
        try:
            if piece.length > LARGEST_CHUNK:
                raise ValueError(f'{piece.length} bytes, at most {LARGEST_CHUNK} are read')
            data = (self._unpacked if piece.is_chunk else self._read_at)(piece.start, piece.length)
            found = scanned(data, numbers, _IN_CHUNK if piece.is_chunk else _IN_DATA)
            if found.end != len(data):
                raise ValueError('its records are inconsistent')
            if piece.is_chunk:
                self._read_declarations(found)
        except Exception as exc:  # damaged bytes: the decompressors raise any exception
            if note:
                self._note(f'the chunk at byte {piece.start - HEAD}: {one_line(exc)}')
            return None
        return found

    def _unpacked(self, offset: int, length: int) -> bytes:
        """
        Return the records in a chunk.

        The package ``mcap`` does not limit the size of a chunk; here one is decompressed at most
        to its declared size. Raises ValueError if a size, the compression or the checksum is
        wrong; the decompressors raise other exceptions for damaged bytes.
        """
        if self._read_at(offset - HEAD, HEAD) != (
                bytes([Opcode.CHUNK]) + length.to_bytes(8, 'little')):
            raise ValueError('no chunk begins there')
        stream = ReadDataStream(BytesIO(self._file.read(length)))
        chunk = Chunk.read(stream)
        size, data = chunk.uncompressed_size, chunk.data
        if stream.count != length:
            raise ValueError('its lengths are inconsistent')
        if size > LARGEST_CHUNK:
            raise ValueError(f'{size} bytes, at most {LARGEST_CHUNK} are read')
        if chunk.compression == 'zstd':
            # No more than the declared size is allocated.
            if zstandard.frame_content_size(data) not in (-1, size):
                raise ValueError('its sizes are inconsistent')
            data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        elif chunk.compression == 'lz4':
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        elif chunk.compression:
            raise ValueError(f'compressed as {shown(chunk.compression)}, must be zstd or lz4')
        if len(data) != size:
            raise ValueError(f'{len(data)} bytes, must be {size}')
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise ValueError('its checksum is wrong')
        self.unchecked = self.unchecked or not (chunk.uncompressed_crc or size == 0)
        return bytes(data)


def _used(channel: Channel) -> tuple[int, str, str]:
    return channel.schema_id, channel.topic, channel.message_encoding
