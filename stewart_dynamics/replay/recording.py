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


"""A recorded bag: its topics, and the messages of some of them, many at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
import shutil
import tempfile
from typing import Any, NamedTuple

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
import zstandard

from stewart_dynamics.errors import BagError, ParameterError
from stewart_dynamics.parameters import read_document
from stewart_dynamics.replay.mcap_file import Block, compact, MAGIC, McapFile
from stewart_dynamics.setpoints import Messages

# So many messages are handed over at once, where there are as many: enough that numpy's own cost
# for each call is small, few enough that they stay in the processor's cache.
_FEWEST, _MOST = 4096, 16384

_SQLITE = b'SQLite format 3\0'
_ROS_1 = b'#ROSBAG V'
_SUFFIXES = ('.mcap', '.db3')


class _Files(NamedTuple):
    paths: list[Path]
    by_rosbags: bool
    """Compressed message by message: only rosbags reads that."""


class Recording:
    """
    A bag of ROS 2: a folder, or one of its files.

    Raises BagError where nothing of it can be read, in one line that says why.

    Attributes
    ----------
    topics : dict
        The type of each topic in it.
    missing : list of str
        What could not be read so far, in words.
    notices : list of str
        What a user should know of how it was read.
    size : int
        Bytes that there are to read.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.missing: list[str] = []
        self.notices: list[str] = []
        files = self._files()
        self.size = sum(file.stat().st_size for file in files.paths)
        self._unpacked: list[Any] = []
        self._sources: list[tuple[Path, McapFile | AnyReader]] = []
        faults = []
        try:
            for file in files.paths:
                try:
                    self._sources.append((file, self._opened(file, files.by_rosbags)))
                except BagError as exc:
                    faults.append(f'{exc}')
            if not self._sources:
                raise BagError('; '.join(faults))
        except BaseException:
            self.close()
            raise
        self.missing += faults
        self.topics: dict[str, str] = {}
        for _, source in self._sources:
            self.topics.update(
                source.topics if isinstance(source, McapFile)
                else {c.topic: c.msgtype for c in source.connections})

    def messages(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """
        Yield the messages of some topics, and how many bytes of the bag were read for them.

        Parameters
        ----------
        keys : mapping
            Of topics in the bag, under which name each is to be given.

        """
        names = tuple(dict.fromkeys(keys.values()))
        number = {topic: names.index(key) for topic, key in keys.items()}
        for file, source in self._sources:
            blocks = (_of_mcap(source, number) if isinstance(source, McapFile)
                      else self._of_rosbags(file, source, number))
            for block, size in _of_good_length(blocks):
                yield Messages(names, block.channels, block.times, block.data, block.starts,
                               block.sizes), size
            if isinstance(source, McapFile):
                self.missing += [f'{file.name}: {what}' for what in source.missing]
                source.missing.clear()
                if source.unchecked:
                    self.notices.append(f'{file.name}: has no checksums: damaged bytes in it '
                                        'would not be noticed')

    def close(self) -> None:
        """Close the files."""
        for _, source in self._sources:
            source.close()
        for folder in self._unpacked:
            folder.cleanup()

    def _files(self) -> _Files:
        """Return the bag's files in their order."""
        path = self.path
        if not path.exists():
            raise BagError(f'{path}: not a bag that can be read: no such file or folder')
        if not path.is_dir():
            return _Files([path], False)
        found = sorted(file for file in path.iterdir()
                       if file.suffix in _SUFFIXES and file.is_file())
        try:
            document = read_document(path / 'metadata.yaml')['rosbag2_bagfile_information']
            by_rosbags = document.get('compression_mode', '').lower() == 'message'
            listed = [path / name for name in document['relative_file_paths']]
        except (ParameterError, KeyError, TypeError, AttributeError) as exc:
            if not found:
                why = f'{exc}' if isinstance(exc, ParameterError) else (
                    f'{path / "metadata.yaml"}: lists no files')
                raise BagError(f'{path}: not a bag that can be read: {why}') from exc
            self.notices.append('its metadata.yaml is missing or damaged: read by its files')
            return _Files(found, False)
        # Older recorders put the folder's own name before that of the file.
        listed = [file if file.exists() else path / file.name for file in listed]
        outside = [file for file in listed if file.resolve().parent != path.resolve()]
        if outside:
            raise BagError(f'{path}: not a bag that can be read: metadata.yaml lists '
                           f'{outside[0]}, which is not in the folder')
        self.missing += [f'{file.name}: no such file' for file in listed if not file.exists()]
        there = [file for file in listed if file.exists()]
        if not there:
            raise BagError(f'{path}: not a bag that can be read: {", ".join(self.missing)}')
        return _Files(there, by_rosbags)

    def _opened(self, file: Path, by_rosbags: bool) -> McapFile | AnyReader:
        try:
            if file.suffix == '.zstd':
                file = self._unpack(file)
            with file.open('rb') as stream:
                head = stream.read(len(_SQLITE))
            if head.startswith(_ROS_1):
                raise BagError(f'{file}: a bag of ROS 1, must be one of ROS 2')
            if head.startswith(MAGIC) and not by_rosbags:
                return McapFile(file)
            if head != _SQLITE and not by_rosbags:
                raise BagError(f'{file}: not a bag that can be read: neither MCAP nor sqlite3')
            reader = AnyReader([self.path if by_rosbags else file],
                               default_typestore=get_typestore(Stores.ROS2_JAZZY))
            reader.open()
        except BagError:
            raise
        except Exception as exc:  # rosbags lets bare errors through for a damaged file
            raise BagError(f'{file}: not a bag that can be read: {_one_line(exc)}') from exc
        if not by_rosbags:
            self.notices.append(f'{file.name}: sqlite3 has no checksums: damaged bytes in it '
                                'would not be noticed')
        return reader

    def _unpack(self, file: Path) -> Path:
        folder = tempfile.TemporaryDirectory()
        self._unpacked.append(folder)
        unpacked = Path(folder.name) / file.stem
        with file.open('rb') as packed, unpacked.open('wb') as stream:
            try:
                shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed), stream)
            except zstandard.ZstdError as exc:
                self.missing.append(f'{file.name}: {_one_line(exc)}')
        return unpacked

    def _of_rosbags(self, file: Path, reader: AnyReader, number: Mapping[str, int],
                    ) -> Iterator[tuple[Block, int]]:
        """Yield the messages that rosbags finds; a fault ends them, and is noted."""
        connections = [c for c in reader.connections if c.topic in number]
        messages = reader.messages(connections=connections) if connections else iter(())
        share = file.stat().st_size / max(sum(c.msgcount for c in connections), 1)
        at_end = False
        while not at_end:
            rows = []
            try:
                while len(rows) < _FEWEST:
                    connection, time, data = next(messages)
                    rows.append((number[connection.topic], time, bytes(data)))
            except StopIteration:
                at_end = True
            except Exception as exc:
                self.missing.append(f'{file.name}: the rest after {len(rows)} more messages: '
                                    f'{_one_line(exc)}')
                at_end = True
            sizes = np.array([len(data) for _, _, data in rows], dtype=np.int64)
            yield Block(
                np.array([n for n, _, _ in rows], dtype=np.int64),
                np.array([time for _, time, _ in rows], dtype=np.int64),
                np.cumsum(sizes) - sizes, sizes,
                np.frombuffer(b''.join(data for _, _, data in rows), dtype=np.uint8),
            ), int(share * len(rows))


def _of_mcap(file: McapFile, number: Mapping[str, int]) -> Iterator[tuple[Block, int]]:
    """Yield messages, the number of its topic in place of each one's channel."""
    for block, topics, size in file.blocks(number):
        of_channel = np.zeros(max(topics, default=0) + 1, dtype=np.int64)
        for channel, topic in topics.items():
            of_channel[channel] = number.get(topic, 0)
        yield block._replace(channels=of_channel[block.channels]), size


def _of_good_length(blocks: Iterator[tuple[Block, int]]) -> Iterator[tuple[Block, int]]:
    """Put short blocks together and cut long ones."""
    short: list[Block] = []
    many, read = 0, 0
    for block, size in blocks:
        read += size
        if len(block.times):
            # Else a short block holds on to the bytes of other topics.
            short.append(block if len(block.times) >= _FEWEST else compact(block))
            many += len(block.times)
        if many >= _FEWEST:
            yield from _cut(short, read)
            short, many, read = [], 0, 0
    yield from _cut(short, read)


def _cut(short: list[Block], read: int) -> Iterator[tuple[Block, int]]:
    if not short:
        return
    whole = short[0]
    if len(short) > 1:
        before = np.cumsum([0, *(len(block.data) for block in short[:-1])])
        channels, times, _, sizes, data = (np.concatenate(parts) for parts in zip(
            *short, strict=True))
        starts = np.concatenate([block.starts + n for block, n in zip(short, before, strict=True)])
        whole = Block(channels, times, starts, sizes, data)
    edges = range(0, len(whole.times), _MOST)
    for first in edges:
        part = slice(first, first + _MOST)
        yield Block(whole.channels[part], whole.times[part], whole.starts[part],
                    whole.sizes[part], whole.data), read // len(edges)




def _one_line(exc: BaseException) -> str:
    return ' '.join(f'{exc}'.split()) or type(exc).__name__
