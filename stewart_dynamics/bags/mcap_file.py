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

from collections.abc import Iterator, Mapping, Sequence
from heapq import heappop, heappush
from io import BytesIO
from pathlib import Path
from typing import Any
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader
import numpy as np

from stewart_dynamics.arrays import Flags, Integers
from stewart_dynamics.bags.blocks import (
    compact, cost, described, IN_A_BLOCK, LARGEST_CHUNK, LATEST, merged, split)
from stewart_dynamics.bags.mcap_scan import (
    HEAD, IGNORED, MESSAGE_HEAD, NUMBERS, Scan, scanned, UNDECLARED)
from stewart_dynamics.errors import BagError, one_line, shown
from stewart_dynamics.messages.layout import at_any_byte
from stewart_dynamics.messages.recorded import Messages
import zstandard

MAGIC = b'\x89MCAP0\r\n'

_FOOTER = HEAD + 20 + len(MAGIC)
_DATA_END = bytes([Opcode.DATA_END, 4, 0, 0, 0, 0, 0, 0, 0])
_LARGEST_INDEX = 1 << 28
# Bytes read at once to follow records: the head of each chunk, and messages outside of chunks.
_WINDOW, _RUN = 1 << 16, 1 << 20
# Maximum cost of messages that are held back to sort chunks that overlap in time [bytes].
_MOST_WAITING = 1 << 27
_NO_TOPIC = np.full(NUMBERS, IGNORED)
_ANY_TOPIC = np.zeros(NUMBERS, np.int64)


def _records(*opcodes: int) -> Flags:
    return np.isin(np.arange(256), opcodes)


# Records of each part of a file; others are damage.
_IN_CHUNK = _records(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_IN_DATA = _IN_CHUNK | _records(Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX,
                                Opcode.ATTACHMENT, Opcode.METADATA)
_IN_SUMMARY = _records(
    Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET)


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
        # Chunks and runs of messages outside of chunks: start time, offset, length, is a run;
        # (P, 4), sorted by time.
        self._pieces: Integers = np.empty((0, 4), np.int64)
        self._file = path.open('rb')
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError('does not begin like an MCAP file')
            self._size = self._file.seek(0, 2)
            if not self._read_index():
                for known in (self._types, self._channels, self._declared):
                    known.clear()
                self._follow_records()
            self._pieces = self._pieces[np.lexsort(self._pieces.T[1::-1])]
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
        starts = [*self._pieces[:, 0].tolist(), LATEST + 1]
        reached, held, read = -1, 0, 0
        self._undeclared = 0
        for n, piece in enumerate(self._pieces.tolist()):
            until = starts[n + 1]  # later pieces contain nothing earlier
            read += piece[2]
            for first, part in self._parts(piece, names, numbers, reached):
                held += cost(part)
                heappush(waiting, (int(part.times[0]), (piece[1], first), part))
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

    def _parts(self, piece: Sequence[int], names: tuple[str, ...], numbers: Integers,
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
            self.missing.append(f'the chunk at byte {piece[1]}: part of it is earlier than its '
                                'declared start')
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

    # The index

    def _read_index(self) -> bool:
        """Read the index at the end of the file; return whether it is valid and complete."""
        try:
            footer_at = self._size - _FOOTER
            tail = self._read_at(max(footer_at, 0), _FOOTER)
            footer = next(StreamReader(BytesIO(tail), skip_magic=True).records)
            if not isinstance(footer, Footer) or not tail.endswith(MAGIC):
                raise ValueError
            start = footer.summary_start
            if not start:
                return False
            if not 0 <= footer_at - start <= _LARGEST_INDEX:
                raise ValueError
            summary = self._read_at(start, self._size - start)
            if footer.summary_crc and zlib.crc32(
                    summary[:-len(MAGIC) - 4]) != footer.summary_crc:
                raise ValueError
            found = scanned(summary[:-_FOOTER], _NO_TOPIC, _IN_SUMMARY)
            if found.end != len(found.data):
                raise ValueError
            return bool(footer.summary_crc) and self._use(found, start)
        except Exception:  # any bytes can be there
            self.missing.append('the index at the end of the file')
            return False

    def _use(self, summary: Scan, start: int) -> bool:
        """Take topics and chunks from an index; return False if it does not list all chunks."""
        self._declare_all(summary)
        statistics = [Statistics.read(ReadDataStream(BytesIO(summary.content(n))))
                      for n in np.flatnonzero(summary.kinds == -Opcode.STATISTICS)[:1]]
        # Start time, end time, offset, and length with the head of the record.
        which = np.flatnonzero(summary.kinds == -Opcode.CHUNK_INDEX)
        entries = np.minimum(at_any_byte(summary.data, 32)[summary.starts[which]].view(
            '<u8').reshape(-1, 4), np.uint64(LATEST)).astype(np.int64)
        # No chunk is listed twice: the time of reading grows with the size of the file.
        begins, sizes = entries[np.argsort(entries[:, 2]), 2:].T
        if not statistics or statistics[0].chunk_count != len(entries) or (
                statistics[0].message_count and not len(entries)) or (
                np.maximum(begins, sizes) > start).any() or (
                begins + sizes > [*begins[1:], start][:len(begins)]).any():
            return False
        self._pieces = np.column_stack(
            [entries[:, 0], entries[:, 2], entries[:, 3] - HEAD, np.zeros(len(entries), np.int64)])
        return True

    # The records

    def _follow_records(self) -> None:
        """Follow the records to the end of the data, and note where messages are."""
        at, run, fault, checksum = len(MAGIC), False, '', 0
        chunks, runs = [self._pieces], [self._pieces]
        while not fault:
            found = scanned(self._read_at(at, _RUN if run else _WINDOW), _ANY_TOPIC, _IN_DATA)
            heads = found.starts - HEAD - np.where(found.kinds == 0, MESSAGE_HEAD, 0)
            ends = [*heads[1:].tolist(), found.end]
            # Only the last record can extend beyond the file.
            count = len(heads) - (at + found.end > self._size)
            for n in np.flatnonzero(_is_declaration(found.kinds[:count])).tolist():
                try:
                    self._declare(found.kinds[n], self._read_at(
                        at + int(found.starts[n]), min(int(found.sizes[n]), LARGEST_CHUNK)))
                except Exception:  # any bytes can be there
                    count, fault = n, 'a damaged or contradictory record of a topic or type'
                    break
            kinds, sizes = found.kinds[:count], found.sizes[:count]
            which = np.flatnonzero(kinds == -Opcode.CHUNK)
            # Size of the content; empty chunks are skipped.
            unpacked = at_any_byte(found.data, 24)[found.starts[which]].view('<u8')[2::3]
            which = which[unpacked > 0]
            chunks.append(np.column_stack(
                [found.times[which], heads[which] + at, sizes[which], np.zeros_like(which)]))
            loose = np.flatnonzero(kinds == 0)
            run = len(loose) > 0
            if run:
                first, last = heads[loose[0]], ends[loose[-1]]
                runs.append(np.array([[found.times[loose].min(), first + at, last - first, 1]]))
            if not count:
                break
            at += ends[count - 1]
        if not fault:
            end = self._read_at(at, HEAD + 4)
            checksum = int.from_bytes(end[HEAD:], 'little')
            if not end.startswith(_DATA_END):
                fault = 'the file is cut off, or no record begins there'
        if fault:
            self.missing.append(f'byte {at} to the end: {fault}')
        self._pieces = np.concatenate(chunks)
        if len(runs) > 1 and self._are_sound(at, 0 if fault else checksum):
            self._pieces = np.concatenate([self._pieces, *runs])
        for piece in self._pieces.tolist():
            if not piece[3]:
                self._content(piece, _NO_TOPIC, note=False)  # topics declared in chunks

    def _are_sound(self, data_end: int, checksum: int) -> bool:
        """
        Return whether messages outside of chunks can be used.

        They are covered by the checksum of the data section, if there is one. In a file
        without it and without chunks they are read, with a notice. A message between chunks is
        most likely another record, damaged.
        """
        fault = ''
        if checksum:
            found = 0
            for offset in range(0, data_end, _RUN):
                found = zlib.crc32(self._read_at(offset, min(_RUN, data_end - offset)), found)
            fault = 'the checksum of the file is wrong' if found != checksum else ''
        elif len(self._pieces):
            fault = 'no checksum covers them'
        else:
            self.unchecked = True
        if fault:
            self.missing.append(f'messages outside of chunks: {fault}')
        return not fault

    def _declare_all(self, found: Scan) -> None:
        for n in np.flatnonzero(_is_declaration(found.kinds)).tolist():
            self._declare(found.kinds[n], found.content(n))

    def _declare(self, kind: int, content: bytes) -> None:
        """
        Note a schema or a channel.

        Raises any exception if it is damaged, or differs from an earlier one of its number.
        """
        if (known := hash((kind, content))) in self._declared:
            return
        stream = ReadDataStream(BytesIO(content))
        own: Any
        first: Any
        if kind == -Opcode.SCHEMA:
            schema = Schema.read(stream)
            own, first = schema.name, self._types.setdefault(schema.id, schema.name)
        else:
            channel = Channel.read(stream)
            own, first = map(_used, (channel, self._channels.setdefault(channel.id, channel)))
        if stream.count != len(content) or own != first or len(self._declared) >= 4 * NUMBERS:
            raise ValueError('a damaged or contradictory record of a topic or type')
        self._declared.add(known)

    # Chunks

    def _content(self, piece: Sequence[int], numbers: Integers, note: bool = True) -> Scan | None:
        """Return the records of a piece; None, and a note, if it is damaged."""
        _, offset, length, is_run = piece
        try:
            if length > LARGEST_CHUNK:
                raise ValueError(f'{length} bytes, at most {LARGEST_CHUNK} are read')
            data = self._read_at(offset, length) if is_run else self._unpacked(offset, length)
            found = scanned(data, numbers, _IN_CHUNK)
            if found.end != len(data):
                raise ValueError('its records are inconsistent')
            if not is_run:
                self._declare_all(found)
        except Exception as exc:  # damaged bytes: the decompressors raise any exception
            if note:
                self._note(f'the chunk at byte {offset}: {one_line(exc)}')
            return None
        return found

    def _unpacked(self, offset: int, length: int) -> bytes:
        """
        Return the records in a chunk.

        The package ``mcap`` does not limit the size of a chunk; here one is decompressed at most
        to its declared size. Raises ValueError if a size, the compression or the checksum is
        wrong; the decompressors raise other exceptions for damaged bytes.
        """
        head = bytes([Opcode.CHUNK]) + length.to_bytes(8, 'little')
        if self._read_at(offset, HEAD) != head:
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


def _is_declaration(kinds: Integers) -> Flags:
    declares: Flags = (kinds == -Opcode.SCHEMA) | (kinds == -Opcode.CHANNEL)
    return declares
