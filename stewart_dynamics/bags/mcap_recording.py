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

Files are read by the package ``mcap`` (https://mcap.dev/spec). Its reader creates an object per
message; here the messages in a chunk are found by a compiled scan.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator, Mapping
import math
from pathlib import Path

from mcap.opcode import Opcode
import numpy as np

from stewart_dynamics.bags.blocks import Block, lean, merged, split
from stewart_dynamics.bags.mcap_chunk import decompressed
from stewart_dynamics.bags.mcap_layout import HEAD, LARGEST_CHUNK, MAGIC, McapLayout, Piece
from stewart_dynamics.bags.mcap_scan import CHANNEL, scanned, SIZE, START, TIME
from stewart_dynamics.errors import BagError, one_line

# The most that is held back to sort chunks that overlap in time, in bytes and as a multiple of
# the file: more is needed only by files made to fill the memory.
_MOST_WAITING, _TIMES_THE_FILE = 1 << 30, 4


class McapRecording:
    """
    The valid messages of an MCAP file.

    Raises BagError if it is not an MCAP file, OSError if it cannot be read.

    Attributes
    ----------
    missing : list of str
        What could not be read.
    unchecked : bool
        Messages without a checksum were read.

    """

    def __init__(self, path: Path) -> None:
        self._file = path.open('rb')
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError(f'{path}: not a bag that can be read: does not begin like an MCAP '
                               'file')
            self._layout = McapLayout(self._file)
            self.missing = self._layout.missing
            self.unchecked = self._layout.has_loose
            if self._layout.messages is None:
                for piece in self._layout.pieces:
                    if piece.is_chunk:
                        self._content(piece, note=False)
        except BaseException:
            self._file.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        kinds: dict[str, set[str]] = {}
        for channel in filter(None, self._layout.channels.values()):
            kind = self._layout.schemas.get(channel.schema) or 'message without a type'
            if channel.encoding != 'cdr':
                kind += f' encoded as {channel.encoding or "nothing"}'
            kinds.setdefault(channel.topic, set()).add(kind)
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def blocks(self, topics: Mapping[str, int]) -> Iterator[tuple[Block, int]]:
        """Yield the messages of these topics, see Source; those of one time in file order."""
        numbers = np.full(1 << 16, -1, dtype=np.int64)
        for number, channel in self._layout.channels.items():
            if channel:
                numbers[number] = topics.get(channel.topic, -1)
        waiting: list[tuple[int, Block]] = []  # in the order of the file
        reached, count = -1, 0
        pieces = self._layout.pieces
        for n, piece in enumerate(pieces):
            block = self._content(piece)
            if block is not None:
                count += len(block.times)
                block = block._replace(channels=numbers[block.channels])
                block = block.chosen(block.channels >= 0)
                if len(block.times) and block.times[0] < reached:
                    self.missing.append(f'the chunk at byte {piece.offset}: part of it is '
                                        'earlier than its declared start')
                    block = block.chosen(block.times >= reached)
                if len(block.times):
                    insort(waiting, (piece.offset, lean(block)), key=lambda each: each[0])
            # Later pieces contain nothing earlier than their first message.
            until = pieces[n + 1].start_time if n + 1 < len(pieces) else math.inf
            if sum(len(block.data) for _, block in waiting) > max(
                    _MOST_WAITING, _TIMES_THE_FILE * self._layout.size):
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
        expected = self._layout.messages
        if not self.missing and expected not in (None, count):
            self.missing.append(f'{expected} messages are in the index, {count} in chunks')

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _content(self, piece: Piece, note: bool = True) -> Block | None:
        """Return the messages of a piece in the order of time; None, and a note, if damaged."""
        try:
            if piece.length > LARGEST_CHUNK:
                raise ValueError(f'{piece.length} bytes, at most {LARGEST_CHUNK} are read')
            data = (self._unpacked(piece) if piece.is_chunk
                    else self._layout.read_at(piece.offset, piece.length))
            found, consumed, array = scanned(data, only_messages=not piece.is_chunk)
            if consumed != len(data):
                raise ValueError('its records are inconsistent')
            for opcode, _, start, size in found[found[:, CHANNEL] < 0].tolist():
                fault = self._layout.declared(-opcode, bytes(data[start:start + size]))
                if fault:
                    raise ValueError(fault)
        except Exception as exc:  # damaged bytes: the decompressors raise any exception
            if note:
                self.missing.append(f'the chunk at byte {piece.offset}: {one_line(exc)}')
            return None
        found = found[found[:, CHANNEL] >= 0]
        if note and not np.isin(found[:, CHANNEL], list(self._layout.channels)).all():
            self._layout.note('messages on a channel that no valid record declares')
        times = found[:, TIME]
        if np.any(times[1:] < times[:-1]):
            found = found[np.argsort(times, kind='stable')]
        return Block(found[:, CHANNEL], found[:, TIME], found[:, START], found[:, SIZE],
                     array)

    def _unpacked(self, piece: Piece) -> bytes:
        """Return the content of a chunk; ValueError if its checksum or a size is wrong."""
        head = self._layout.read_at(piece.offset, HEAD)
        if head != bytes([Opcode.CHUNK]) + piece.length.to_bytes(8, 'little'):
            raise ValueError('no chunk begins there')
        content, checked = decompressed(self._file.read(piece.length))
        self.unchecked = self.unchecked or not checked
        return content
