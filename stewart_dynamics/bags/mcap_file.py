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
import struct
from typing import Any
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Schema, Statistics
from mcap.stream_reader import StreamReader
import numpy as np

from stewart_dynamics.arrays import Integers
from stewart_dynamics.bags.blocks import (
    compact, cost, IN_A_BLOCK, LARGEST_CHUNK, LATEST, merged, split)
from stewart_dynamics.bags.mcap_scan import (
    HEAD, IGNORED, MESSAGE_HEAD, NUMBERS, Scan, scanned, UNDECLARED)
from stewart_dynamics.errors import BagError, one_line, shown
from stewart_dynamics.messages.layout import at_any_byte
from stewart_dynamics.messages.recorded import Messages
import zstandard

MAGIC = b'\x89MCAP0\r\n'

_FOOTER = HEAD + 20 + len(MAGIC)
_LARGEST_INDEX = 1 << 28
# Bytes read at once to follow records: the head of each chunk, and messages outside of chunks.
_WINDOW, _RUN = 1 << 16, 1 << 20
# Maximum cost of messages that are held back to sort chunks that overlap in time [bytes].
_MOST_WAITING = 1 << 27
_NO_TOPIC = np.full(NUMBERS, IGNORED)
_ANY_TOPIC = np.zeros(NUMBERS, np.int64)
# Records that may be in front of the end of the data; the others are damage.
_FOLLOWED = np.isin(np.arange(256), [
    Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK,
    Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA])


class _Damaged(ValueError):
    """The record of a topic or type that cannot be used, by its index in a scan."""

    def __init__(self, record: int, fault: str) -> None:
        super().__init__(fault)
        self.record = record


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
        # Number of messages according to the index, and those that were found.
        self._expected: int | None = None
        self._messages = self._undeclared = 0
        # Chunks and runs of messages outside of chunks: start time, offset, length, is a run;
        # (P, 4), sorted by time.
        self._pieces: Integers = np.empty((0, 4), np.int64)
        self._file = path.open('rb')
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError('does not begin like an MCAP file')
            self._size = self._file.seek(0, 2)
            if not self._read_index():
                self._types.clear()
                self._channels.clear()
                self._declared.clear()
                self._follow_records()
            self._pieces = self._pieces[np.lexsort(self._pieces.T[1::-1])]
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        kinds: dict[str, set[str]] = {}
        for channel in self._channels.values():
            kind = self._types.get(channel.schema_id) or 'message without a type'
            if channel.message_encoding != 'cdr':
                kind += f' encoded as {channel.message_encoding or "nothing"}'
            kinds.setdefault(channel.topic, set()).add(kind)
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

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
        self._messages = self._undeclared = 0
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
        if not self.missing and self._expected not in (None, self._messages):
            self.missing.append(f'{self._expected} messages are in the index, {self._messages} '
                                'in chunks')

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _parts(self, piece: Sequence[int], names: tuple[str, ...], numbers: Integers,
               reached: int) -> list[tuple[int, Messages]]:
        """Return the messages of a piece in the order of time, in parts of limited number."""
        found = self._content(piece, numbers)
        if found is None:
            return []
        self._messages += found.messages
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
            found = scanned(summary[:-_FOOTER], _NO_TOPIC)
            if found.end != len(found.data):
                raise ValueError
            return bool(footer.summary_crc) and self._use(found, start)
        except Exception:  # any bytes can be there
            self.missing.append('the index at the end of the file')
            return False

    def _use(self, summary: Scan, start: int) -> bool:
        """Take topics and chunks from an index; return False if it is incomplete."""
        self._declare(summary)
        statistics = None
        for n in np.flatnonzero(summary.kinds == -Opcode.STATISTICS)[:1]:
            statistics = Statistics.read(ReadDataStream(BytesIO(summary.content(n))))
        # Start time, end time, offset, and length with the head of the record.
        which = np.flatnonzero(summary.kinds == -Opcode.CHUNK_INDEX)
        entries = np.minimum(at_any_byte(summary.data, 32)[summary.starts[which]].view(
            '<u8').reshape(-1, 4), np.uint64(LATEST)).astype(np.int64)
        places = entries[np.argsort(entries[:, 2]), 2:]
        if statistics is None or statistics.chunk_count != len(entries) or (
                statistics.channel_count != len(self._channels)) or (
                statistics.message_count and not len(entries)) or (
                places > start).any() or (
                places.sum(axis=1) > [*places[1:, 0], start][:len(places)]).any():
            return False
        self._pieces = np.column_stack(
            [entries[:, 0], entries[:, 2], entries[:, 3] - HEAD, np.zeros(len(entries), np.int64)])
        self._expected = statistics.message_count
        return True

    # The records

    def _follow_records(self) -> None:
        """Follow the records to the end of the data, and note where messages are."""
        at, run = len(MAGIC), False
        chunks, runs = [self._pieces], [self._pieces]
        fault, checksum = '', 0
        while not fault:
            found = scanned(self._read_at(at, _RUN if run else _WINDOW), _ANY_TOPIC)
            opcodes = np.where(found.kinds == 0, Opcode.MESSAGE, -found.kinds)
            heads = found.starts - HEAD - np.where(found.kinds == 0, MESSAGE_HEAD, 0)
            ends = found.starts + found.sizes
            is_sound = _FOLLOWED[opcodes] & (ends <= self._size - at)
            count = len(ends) if is_sound.all() else int(np.argmin(is_sound))
            try:
                self._declare(found._replace(kinds=found.kinds[:count]), at)
            except _Damaged as exc:
                count, fault = exc.record, f'{exc}'
            which = np.flatnonzero(opcodes[:count] == Opcode.CHUNK)
            # Size of the content; empty chunks are skipped.
            unpacked = at_any_byte(found.data, 24)[found.starts[which]].view('<u8')[2::3]
            which = which[unpacked > 0]
            chunks.append(np.column_stack([
                found.times[which], heads[which] + at, found.sizes[which],
                np.zeros(len(which), np.int64)]))
            loose = np.flatnonzero(opcodes[:count] == Opcode.MESSAGE)
            run = len(loose) > 0
            if run:
                first, last = heads[loose[0]], ends[loose[-1]]
                runs.append(np.array([[found.times[loose].min(), first + at, last - first, 1]]))
            if count < len(ends):
                at += int(heads[count])
                if not fault and opcodes[count] == Opcode.DATA_END and found.sizes[count] == 4:
                    checksum = DataEnd.read(ReadDataStream(BytesIO(self._read_at(
                        at + HEAD, 4)))).data_section_crc
                    break
                fault = fault or (
                    'no record begins there' if not _FOLLOWED[opcodes[count]] else
                    'the file is cut off, or a length in it is wrong')
            elif not count:
                fault = 'the file is cut off, or no record begins there'
            else:
                at += found.end
        if fault:
            self.missing.append(f'byte {at} to the end: {fault}')
        self._pieces = np.concatenate(chunks)
        if len(runs) > 1 and self._are_sound(at, checksum):
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

    def _declare(self, found: Scan, at: int = 0) -> None:
        """
        Note schemas and channels, of which the first record of a number counts.

        Parameters
        ----------
        found : Scan
            Records in which they are looked for.
        at : int
            Position of these in the file, if contents may extend beyond the bytes read.

        Raises _Damaged at a record that is damaged, or contradicts an earlier one.

        """
        for n in np.flatnonzero(found.kinds < 0).tolist():
            if -found.kinds[n] not in (Opcode.SCHEMA, Opcode.CHANNEL):
                continue
            content = found.content(n)
            if at and len(content) < found.sizes[n]:
                content = self._read_at(at + int(found.starts[n]),
                                        min(int(found.sizes[n]), LARGEST_CHUNK))
            kind = Schema if found.kinds[n] == -Opcode.SCHEMA else Channel
            known = hash((kind, content))
            if known in self._declared:
                continue
            stream = ReadDataStream(BytesIO(content))
            try:
                record = kind.read(stream)
            except (McapError, struct.error, UnicodeDecodeError):
                record = None
            if record is None or stream.count != found.sizes[n]:
                raise _Damaged(n, 'a damaged record of a topic or type')
            own: Any
            first: Any
            if isinstance(record, Schema):
                own, first = record.name, self._types.setdefault(record.id, record.name)
            else:
                own, first = _used(record), _used(self._channels.setdefault(record.id, record))
            if first != own:
                raise _Damaged(n, f'number {record.id} of two topics or types')
            self._declared.add(known)
            if len(self._declared) > 4 * NUMBERS:
                raise _Damaged(n, 'too many records of topics and types')

    # Chunks

    def _content(self, piece: Sequence[int], numbers: Integers, note: bool = True) -> Scan | None:
        """Return the records of a piece; None, and a note, if it is damaged."""
        _, offset, length, is_run = piece
        try:
            if length > LARGEST_CHUNK:
                raise ValueError(f'{length} bytes, at most {LARGEST_CHUNK} are read')
            data = self._read_at(offset, length) if is_run else self._unpacked(offset, length)
            found = scanned(data, numbers)
            if found.end != len(data):
                raise ValueError('its records are inconsistent')
            if not is_run:
                self._declare(found)
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
