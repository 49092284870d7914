# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
One MCAP file, whole, cut short or damaged: its valid messages in the order of time.

Chunks are found by the index if its checksum is correct. Otherwise the records are followed from
the beginning to the first damaged one; nothing after it is read. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from io import BytesIO
from pathlib import Path
from typing import NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader
import numpy as np

from stewart_dynamics.arrays import Bytes, Integers
from stewart_dynamics.bags.blocks import (
    compact, cost, described, IN_A_BLOCK, LARGEST_CHUNK, LATEST, merged, split)
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import BagError, one_line, shown
from stewart_dynamics.messages.recorded import Messages
import zstandard

MAGIC = b'\x89MCAP0\r\n'

# Opcode and length in front of each record.
HEAD = 9
# Possible channel numbers; the entry of those whose messages are skipped.
NUMBERS, IGNORED = 1 << 16, -1
# Bit n: records with the opcode n may occur in a chunk; between the first record and the last one.
_IN_CHUNK = 1 << Opcode.SCHEMA | 1 << Opcode.CHANNEL | 1 << Opcode.MESSAGE
_IN_DATA = (_IN_CHUNK | 1 << Opcode.HEADER | 1 << Opcode.CHUNK | 1 << Opcode.MESSAGE_INDEX
            | 1 << Opcode.ATTACHMENT | 1 << Opcode.METADATA)
_FOOTER = HEAD + 20 + len(MAGIC)
_DATA_END = bytes([Opcode.DATA_END, 4, 0, 0, 0, 0, 0, 0, 0])
_LARGEST_INDEX = 1 << 28
_WINDOW = 1 << 20
_MOST_WAITING = 1 << 27
_ANY_TOPIC = np.zeros(NUMBERS, np.int64)


class Scan(NamedTuple):
    """Records found in a sequence of bytes, without the messages that are skipped."""

    kinds: Integers
    """(K,): the number of the topic of a message; minus the opcode of another record."""
    values: Integers
    """(K,): the time of a message [ns]; the first two bytes of another: number of a channel."""
    starts: Integers  # (K,): start of the data of a message, or of the content of another record
    sizes: Integers  # (K,): length of the data or content [bytes]
    data: Bytes
    end: int  # end of the last record


def scanned(data: bytes, numbers: Integers, valid: int, limit: int) -> Scan:
    """
    Return the messages of some channels in these bytes, and all records that are not messages.

    The scan ends where the fields that it reads are not in the data, where the lengths in a
    message or a message index are inconsistent, or at an opcode that is not valid.

    numbers (65536,): number of the topic of each channel, or IGNORED.
    valid: bits of the valid opcodes.
    limit: the end that no record may exceed.
    """
    array = np.frombuffer(data, np.uint8)
    room = 8192  # for most chunks this is enough, and they are scanned once
    while True:
        found, totals = np.empty((4, room), np.int64), np.array([valid, limit])
        function('scan_records')(len(array), array, numbers, room, found, totals)
        count, end = totals.tolist()
        if count <= room:
            kinds, values, starts, sizes = found[:, :count]
            return Scan(kinds, values, starts, sizes, array, end)
        room = count


class _Piece(NamedTuple):
    """A chunk, or records outside of chunks."""

    time: int  # time before which it contains no message [ns]
    start: int
    length: int
    is_chunk: bool


class McapFile:
    """
    The valid messages of an MCAP file, see Source.

    Raises BagError if it is not an MCAP file, OSError if it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = False
        self._types: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._declared = 0  # bytes of both
        self._file = path.open('rb')
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError('does not begin like an MCAP file')
            self._size = self._file.seek(0, 2)
            self._pieces = sorted(self._indexed() or self._followed())
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        return described(
            (channel.topic, self._types[channel.schema_id].name if channel.schema_id in self._types
             else 'message without a type', channel.message_encoding)
            for channel in self._channels.values())

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source; those of one time in file order."""
        names = tuple(dict.fromkeys(keys.values()))
        numbers = np.full(NUMBERS, IGNORED)
        for number, channel in self._channels.items():
            if channel.topic in keys:
                numbers[number] = names.index(keys[channel.topic])
        # First time, position in the file, messages.
        waiting: list[tuple[int, tuple[int, int], Messages]] = []
        starts = [*(piece.time for piece in self._pieces), LATEST + 1]
        reached, held, read = -1, 0, 0
        for piece, until in zip(self._pieces, starts[1:], strict=True):
            # Later pieces contain nothing before ``until``.
            read += piece.length
            for first, part in self._parts(piece, names, numbers, reached):
                held += cost(part)
                heappush(waiting, (int(part.times[0]), (piece.start, first), part))
            if held > _MOST_WAITING:
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

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _parts(self, piece: _Piece, names: tuple[str, ...], numbers: Integers,
               reached: int) -> list[tuple[int, Messages]]:
        """Return the messages of a piece in the order of time, in parts of limited number."""
        found = self._content(piece, numbers)
        if found is None:
            return []
        block = Messages(names, found.kinds, found.values, found.data, found.starts, found.sizes)
        if np.any(block.of_topic < 0):
            block = block.chosen(block.of_topic >= 0)
        if np.any(block.times[1:] < block.times[:-1]):
            block = block.chosen(np.argsort(block.times, kind='stable'))
        if len(block.times) and block.times[0] < reached:
            self._note(f'chunks overlap in time by more than {_MOST_WAITING >> 20} MB of '
                       'messages: those too late to be sorted are not read')
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

    def _indexed(self) -> list[_Piece]:
        """Return the chunks by the index at the end of the file, if it is there and complete."""
        try:
            tail = self._read_at(max(self._size - _FOOTER, 0), _FOOTER)
            footer = next(StreamReader(BytesIO(tail), skip_magic=True).records)
            if not isinstance(footer, Footer) or not tail.endswith(MAGIC):
                raise ValueError
            start, size = footer.summary_start, self._size - footer.summary_start
            if not start or not footer.summary_crc:
                return []
            if not _FOOTER <= size <= _LARGEST_INDEX:
                raise ValueError
            summary = self._read_at(start, size)
            if zlib.crc32(summary[:-len(MAGIC) - 4]) != footer.summary_crc:
                raise ValueError
            records = [*StreamReader(BytesIO(summary), skip_magic=True).records]
        except Exception:  # any bytes can be there
            self._note('the index at the end of the file')
            return []
        chunks = [each for each in records if isinstance(each, ChunkIndex)]
        channels = {each.id: each for each in records if isinstance(each, Channel)}
        counts = [(each.chunk_count, each.channel_count) for each in records
                  if isinstance(each, Statistics)]
        # The time of reading grows with the size of the file, not of the index.
        if counts != [(len(chunks), len(channels))] or sum(
                each.chunk_length for each in chunks) > start:
            return []
        self._channels = channels
        self._types = {each.id: each for each in records if isinstance(each, Schema)}
        return [_Piece(min(each.message_start_time, LATEST), each.chunk_start_offset + HEAD,
                       each.chunk_length - HEAD, True) for each in chunks]

    def _followed(self) -> list[_Piece]:
        """Follow the records to the end of the data; return where messages are."""
        chunks, runs, at = list[_Piece](), list[_Piece](), len(MAGIC)
        while True:
            found = scanned(
                self._read_at(at, _WINDOW), _ANY_TOPIC, _IN_DATA, self._size - at)
            if not found.end:
                break
            self._declare(found, at)
            chunks += [_Piece(0, at + int(found.starts[n]), int(found.sizes[n]), True)
                       for n in np.flatnonzero(found.kinds == -Opcode.CHUNK)]
            times = found.values[found.kinds == 0]
            if len(times):
                runs.append(_Piece(int(times.min()), at, found.end, False))
            at += found.end
        end = self._read_at(at, HEAD + 4)
        if end[:HEAD] != _DATA_END:
            self._note(f'byte {at} to the end: the file is cut off, or no record begins there')
        if chunks:
            if runs:  # a damaged record can look like a message
                self._note('messages outside of chunks: no checksum covers them')
            return [*self._timed(chunks)]
        if runs and end[:HEAD] == _DATA_END and any(end[HEAD:]):
            checksum = 0
            for offset in range(0, at, _WINDOW):
                checksum = zlib.crc32(self._read_at(offset, min(_WINDOW, at - offset)), checksum)
            if checksum != int.from_bytes(end[HEAD:], 'little'):
                self._note('messages outside of chunks: the checksum of the file is wrong')
                return []
        else:
            self.unchecked = bool(runs)
        return runs

    def _timed(self, chunks: list[_Piece]) -> Iterator[_Piece]:
        """Yield the chunks that contain messages, and read their declarations."""
        for chunk in chunks:
            found = self._content(chunk, _ANY_TOPIC)
            if found is not None:
                self._declare(found)
                times = found.values[found.kinds == 0]
                # The time in the head of the chunk is not covered by its checksum.
                if len(times):
                    yield chunk._replace(time=int(times.min()))

    def _declare(self, found: Scan, offset: int | None = None) -> None:
        """Keep topics and types, the first of each number, of a chunk or of records there."""
        for opcode, kind, known in ((Opcode.SCHEMA, Schema, self._types),
                                    (Opcode.CHANNEL, Channel, self._channels)):
            which = np.flatnonzero(found.kinds == -opcode)
            numbers, firsts = np.unique(found.values[which], return_index=True)
            for number, n in zip(numbers.tolist(), which[firsts].tolist(), strict=True):
                if number in known:
                    continue
                start, size = int(found.starts[n]), int(found.sizes[n])
                self._declared += size
                try:
                    if self._declared > LARGEST_CHUNK:
                        raise ValueError(f'more than {LARGEST_CHUNK} bytes')
                    content = (found.data[start:start + size].tobytes() if offset is None
                               else self._read_at(offset + start, size))
                    known[number] = kind.read(ReadDataStream(BytesIO(content)))
                except Exception as exc:  # any bytes can be there
                    self._note(f'topics and types: {one_line(exc)}')

    def _content(self, piece: _Piece, numbers: Integers) -> Scan | None:
        """Return the records of a piece; None, and a note, if it is damaged."""
        try:
            if piece.length > LARGEST_CHUNK:
                raise ValueError(f'{piece.length} bytes, at most {LARGEST_CHUNK} are read')
            data = (self._unpacked if piece.is_chunk else self._read_at)(piece.start, piece.length)
            found = scanned(data, numbers, _IN_CHUNK if piece.is_chunk else _IN_DATA,
                            len(data))
            if found.end != len(data):
                raise ValueError('its records are inconsistent')
        except Exception as exc:  # damaged bytes: the decompressors raise any exception
            self._note(f'the chunk at byte {piece.start - HEAD}: {one_line(exc)}')
            return None
        return found

    def _unpacked(self, offset: int, length: int) -> bytes:
        """
        Return the records in a chunk; raises any exception if they are damaged.

        Its size is limited, which the package ``mcap`` does not do.
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
