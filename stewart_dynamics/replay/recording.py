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

from collections.abc import Collection, Iterator, Mapping
from itertools import islice
from pathlib import Path
import re
import shutil
import sqlite3
import tempfile
from typing import Any

import numpy as np
import zstandard

from stewart_dynamics.errors import BagError, one_line, ParameterError
from stewart_dynamics.parameters_yaml import read_document
from stewart_dynamics.replay.bags import STORAGES
from stewart_dynamics.replay.mcap_file import Block, compact, joined, MAGIC, McapFile
from stewart_dynamics.runtime.setpoints import Messages

# So many messages are handed over at once, where there are as many: enough that numpy's own cost
# for each call is small, few enough that they stay in the processor's cache.
_FEWEST, _MOST = 4096, 16384

_SQLITE = b'SQLite format 3\0'
_ROS_1 = b'#ROSBAG V'
_ZSTD = b'\x28\xb5\x2f\xfd'
# No setpoint is as large.
_LARGEST_MESSAGE = 1 << 24


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

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.missing: list[str] = []
        self.notices: list[str] = []
        self._unpacked: list[Any] = []
        self._sources: list[tuple[Path, McapFile | _SqliteFile]] = []
        faults = []
        try:
            files = self._files()
            for file in files:
                try:
                    self._sources.append((file, self._opened(file)))
                except BagError as exc:
                    faults.append(f'{exc}')
            if not self._sources:
                raise BagError('; '.join(faults))
        except BaseException as exc:
            self.close()
            # A name that no file can have, links in a circle, a folder that cannot be listed.
            if isinstance(exc, (OSError, RuntimeError, ValueError)):
                raise BagError(f'{path}: not a bag that can be read: {one_line(exc)}') from exc
            raise
        self.missing += faults
        kinds: dict[str, set[str]] = {}
        for _, source in self._sources:
            for topic, kind in source.topics.items():
                kinds.setdefault(topic, set()).add(kind)
        self.topics = {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

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
            for block, size in _of_good_length(_numbered(source, number)):
                yield Messages(names, block.channels, block.times, block.data, block.starts,
                               block.sizes), size
            self.missing += [f'{file.name}: {what}' for what in source.missing]
            source.missing.clear()
            if source.unchecked:
                self.notices.append(f'{file.name}: has no checksums: damaged bytes in it '
                                    'would not be noticed')

    @property
    def damage(self) -> list[str]:
        """What is known by now to be unreadable, in words."""
        return self.missing + [f'{file.name}: {what}' for file, source in self._sources
                               for what in source.missing]

    def close(self) -> None:
        """Close the files."""
        for _, source in self._sources:
            source.close()
        for folder in self._unpacked:
            folder.cleanup()

    def _files(self) -> list[Path]:
        """Return the bag's files in their order."""
        path = self.path
        if not path.is_dir():
            if not path.is_file():
                raise BagError(f'{path}: not a bag that can be read: no such file or folder')
            return [path]
        found = sorted((file for file in path.iterdir() if file.name.endswith(STORAGES)
                        and self._is_inside(file)), key=_by_number)
        try:
            document = read_document(path / 'metadata.yaml', 1_000_000)
            names = document['rosbag2_bagfile_information']['relative_file_paths']
            listed = [path / name for name in names]
        except (ParameterError, KeyError, TypeError) as exc:
            listed = []
            why = f'{exc}' if isinstance(exc, ParameterError) else (
                f'{path / "metadata.yaml"}: lists no files')
        else:
            why = f'{path / "metadata.yaml"}: lists no file that there is'
        # Older recorders put the folder's own name before that of the file.
        listed = list(dict.fromkeys(
            file if file.exists() else path / file.name for file in listed))
        outside = [file for file in listed if file.exists() and not self._is_inside(file)]
        if outside:
            raise BagError(f'{path}: not a bag that can be read: metadata.yaml lists '
                           f'{outside[0]}, which is not a file in the folder')
        there = [file for file in listed if file.exists()]
        if there:
            self.missing += [f'{file.name}: no such file' for file in listed if file not in there]
            return there
        if not found:
            raise BagError(f'{path}: not a bag that can be read: {why}')
        self.notices.append('its metadata.yaml is missing or damaged: read by its files')
        return found

    def _is_inside(self, file: Path) -> bool:
        """Return whether this is a file in the bag's folder, and no link to one elsewhere."""
        return file.is_file() and file.resolve().parent == self.path.resolve()

    def _opened(self, file: Path) -> McapFile | _SqliteFile:
        try:
            unpacked = self._unpack(file) if file.suffix == '.zstd' else file
            with unpacked.open('rb') as stream:
                head = stream.read(len(_SQLITE))
            if head.startswith(_ROS_1):
                raise BagError(f'{file}: a bag of ROS 1, must be one of ROS 2')
            if head.startswith(MAGIC):
                return McapFile(unpacked)
            if head != _SQLITE:
                raise BagError(f'{file}: not a bag that can be read: neither MCAP nor sqlite3')
            source = _SqliteFile(unpacked)
        except BagError:
            raise
        except (OSError, sqlite3.Error) as exc:
            raise BagError(f'{file}: not a bag that can be read: {one_line(exc)}') from exc
        # Where the recorder was killed, it holds what is not in the file, or what is undone.
        for suffix in ('-wal', '-journal'):
            journal = file.with_name(f'{file.name}{suffix}')
            if journal.is_file() and journal.stat().st_size:
                self.missing.append(f'{journal.name}: the recording was not closed; what only '
                                    'stands there is not read')
        return source

    def _unpack(self, file: Path) -> Path:
        folder = tempfile.TemporaryDirectory()
        self._unpacked.append(folder)
        unpacked = Path(folder.name) / file.stem
        with file.open('rb') as packed, unpacked.open('wb') as stream:
            try:
                shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(
                    packed, read_across_frames=True), stream)
            except zstandard.ZstdError as exc:
                self.missing.append(f'{file.name}: {one_line(exc)}')
        return unpacked


class _SqliteFile:
    """A bag's file in sqlite3. It has no checksums: much damage to it cannot be noticed."""

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = True
        # Else sqlite3 would write beside it.
        self._connection = sqlite3.connect(
            f'{path.absolute().as_uri()}?immutable=1', uri=True, check_same_thread=False)
        self._connection.text_factory = lambda text: text.decode(errors='replace')
        try:
            self._topics = {
                number: (str(name), f'{kind}' if encoding == 'cdr' else
                         f'{kind} encoded as {encoding}')
                for number, name, kind, encoding in self._connection.execute(
                    'SELECT id, name, type, serialization_format FROM topics')}
            self._connection.execute('SELECT topic_id, timestamp, data FROM messages LIMIT 1')
        except BaseException:
            self.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic."""
        return dict(self._topics.values())

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[Block, dict[int, str], int]]:
        """Yield these topics' messages as McapFile does; a fault ends them, and is noted."""
        numbers = [number for number, (topic, _) in self._topics.items() if topic in topics]
        channel_of = {number: n for n, number in enumerate(numbers)}
        topic_of = {n: self._topics[number][0] for n, number in enumerate(numbers)}
        count = 0
        at_end = False
        cursor = self._connection.cursor()
        while not at_end:
            rows: list[Any] = []
            try:
                if not count:
                    cursor.execute(
                        'SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN '
                        f'({",".join("?" * len(numbers))}) ORDER BY timestamp, rowid', numbers)
                for row in islice(cursor, _FEWEST):
                    rows.append(row)
                at_end = not rows
            except sqlite3.Error as exc:
                self.missing.append(f'what came after {count + len(rows)} messages: '
                                    f'{one_line(exc)}')
                at_end = True
            sound = [row for row in rows if isinstance(row[1], int) and isinstance(row[2], bytes)]
            if len(sound) < len(rows):
                self.missing.append(f'{len(rows) - len(sound)} messages that are none')
            count += len(rows)
            sizes = np.array([len(data) for _, _, data in sound], dtype=np.int64)
            yield Block(
                np.array([channel_of[number] for number, _, _ in sound], dtype=np.int64),
                np.array([time for _, time, _ in sound], dtype=np.int64),
                np.cumsum(sizes) - sizes, sizes,
                np.frombuffer(b''.join(data for _, _, data in sound), dtype=np.uint8),
            ), topic_of, int(sizes.sum())
        if not self.missing:
            self._check()

    def _check(self) -> None:
        """Note damage that sqlite3 passes over in silence when it reads."""
        try:
            (found,), = self._connection.execute('PRAGMA quick_check(1)')
        except sqlite3.Error as exc:
            found = exc
        if found != 'ok':
            self.missing.append(f'damaged, what is missing is not known: {one_line(found)}')

    def close(self) -> None:
        """Close the file."""
        self._connection.close()


def _numbered(source: McapFile | _SqliteFile, number: Mapping[str, int],
              ) -> Iterator[tuple[Block, int]]:
    """Yield messages, the number of its topic in place of each one's channel."""
    for block, topics, size in source.blocks(number):
        of_channel = np.zeros(max(topics, default=0) + 1, dtype=np.int64)
        for channel, topic in topics.items():
            of_channel[channel] = number[topic]
        yield _unpacked(block._replace(channels=of_channel[block.channels])), size


def _unpacked(block: Block) -> Block:
    """Return messages as they were before rosbag2 compressed each of them, if it did."""
    # CDR never begins so.
    if not np.any(block.data[block.starts[block.sizes > 0]] == _ZSTD[0]):
        return block
    messages = []
    for start, size in zip(block.starts.tolist(), block.sizes.tolist(), strict=True):
        message = block.data[start:start + size].tobytes()
        if message.startswith(_ZSTD):
            try:
                if zstandard.frame_content_size(message) <= _LARGEST_MESSAGE:
                    message = zstandard.ZstdDecompressor().decompress(
                        message, max_output_size=_LARGEST_MESSAGE)
            except zstandard.ZstdError:
                pass  # it is refused as no message of its type
        messages.append(message)
    sizes = np.array([len(message) for message in messages], dtype=np.int64)
    return block._replace(starts=np.cumsum(sizes) - sizes, sizes=sizes,
                          data=np.frombuffer(bytearray(b''.join(messages)), dtype=np.uint8))


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
            yield from _cut(joined(short), read)
            short, many, read = [], 0, 0
    yield from _cut(joined(short), read)


def _cut(block: Block, read: int) -> Iterator[tuple[Block, int]]:
    edges = range(0, len(block.times), _MOST)
    for first in edges:
        part = slice(first, first + _MOST)
        yield Block(block.channels[part], block.times[part], block.starts[part],
                    block.sizes[part], block.data), read // len(edges)


def _by_number(file: Path) -> list[tuple[int, str]]:
    """Return what sorts names in the order of the numbers in them: rosbag2 counts its files."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', file.name)]
