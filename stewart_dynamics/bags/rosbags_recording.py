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


"""Bags in sqlite3 and bags of ROS 1, read by rosbags."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path
import sqlite3
from typing import Any

import lz4.frame
from rosbags.interfaces import ConnectionExtRosbag2
import rosbags.rosbag1
from rosbags.rosbag1.reader import decompressors
import rosbags.rosbag2
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics.bags.blocks import LARGEST_CHUNK
from stewart_dynamics.errors import one_line
from stewart_dynamics.messages.recorded import Messages

# Messages in a block.
_AT_ONCE = 4096


class RosbagsRecording:
    """
    A file that rosbags reads, message by message; neither format has checksums.

    Parameters
    ----------
    path : Path
        Its suffix tells the format: .db3, else a bag of ROS 1.

    Raises any exception of rosbags if it cannot be opened.

    Attributes
    ----------
    missing : list of str
        What could not be read.
    unchecked : bool
        Messages without a checksum were read: always.

    """

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = True
        self._path = path
        self._to_cdr: Callable[[bytes, str], bytes] | None = None
        self._reader: Any
        if path.suffix == '.db3':
            self._reader = rosbags.rosbag2.Reader(path)
            self._reader.open()
        else:
            self._reader = rosbags.rosbag1.Reader(path)
            self._reader.open()
            # rosbags does not limit what it decompresses.
            self._reader.chunks = {
                place: chunk._replace(decompressor=_bounded(chunk.decompressor))
                for place, chunk in self._reader.chunks.items()}
            store = get_typestore(Stores.ROS2_JAZZY)
            self._to_cdr = lambda data, kind: bytes(store.ros1_to_cdr(data, kind))
        self._kinds = {of.id: self._kind_of(of) for of in self._reader.connections}

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        kinds: dict[str, set[str]] = {}
        for of in self._reader.connections:
            kinds.setdefault(of.topic, set()).add(self._kinds[of.id])
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source; an error ends them, and is noted."""
        names = tuple(dict.fromkeys(keys.values()))
        topics = {topic: names.index(key) for topic, key in keys.items()}
        wanted = [of for of in self._reader.connections if of.topic in topics]
        rows = self._reader.messages(connections=wanted) if wanted else iter(())
        count = unsound = 0
        at_end = False
        while not at_end:
            times: list[int] = []
            channels: list[int] = []
            messages: list[bytes] = []
            try:
                at_end = True
                for of, time, data in islice(rows, _AT_ONCE):
                    at_end = False
                    count += 1
                    if not isinstance(time, int) or not isinstance(data, bytes):
                        unsound += 1
                        continue
                    channels.append(topics[of.topic])
                    times.append(time)
                    messages.append(self._as_cdr(data, of.msgtype))
            except Exception as exc:  # damaged bytes: rosbags raises any exception
                self.missing.append(f'everything after {count} messages: {one_line(exc)}')
                at_end = True
            block = Messages.of(names, channels, times, messages)
            yield block, int(block.sizes.sum())
        if unsound:
            self.missing.append(f'{unsound} rows that are not messages')
        if not self.missing and self._to_cdr is None:
            self._check_sqlite()

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def _kind_of(self, connection: Any) -> str:
        """Return the type of a connection's messages, with what is unusual about it."""
        kind = str(connection.msgtype)
        if self._to_cdr is None:
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            encoding = connection.ext.serialization_format
            return kind if encoding == 'cdr' else f'{kind} encoded as {encoding}'
        store = get_typestore(Stores.ROS1_NOETIC)
        if kind in store.types and store.generate_msgdef(kind)[1] != connection.digest:
            return f'{kind} of another definition'
        return kind

    def _as_cdr(self, data: bytes, kind: str) -> bytes:
        if self._to_cdr is None:
            return data
        try:
            return self._to_cdr(data, kind)
        except SerdeError:
            return b''  # rejected as malformed

    def _check_sqlite(self) -> None:
        """Note damage that sqlite3 does not report while reading."""
        database = sqlite3.connect(f'{self._path.absolute().as_uri()}?immutable=1', uri=True)
        try:
            (found,), = database.execute('PRAGMA quick_check(1)')
        except sqlite3.Error as exc:
            found = exc
        finally:
            database.close()
        if found != 'ok':
            self.missing.append(f'damaged, what is missing is unknown: {one_line(found)}')


def _bounded(decompress: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """Return a function that decompresses a chunk to no more than LARGEST_CHUNK."""
    make: dict[Any, Callable[[], Any]] = {
        decompressors['bz2']: BZ2Decompressor,
        decompressors['lz4']: lz4.frame.LZ4FrameDecompressor}
    if decompress not in make:
        return decompress

    def bounded(data: bytes) -> bytes:
        found: bytes = make[decompress]().decompress(data, max_length=LARGEST_CHUNK + 1)
        if len(found) > LARGEST_CHUNK:
            raise ValueError(f'a chunk of more than {LARGEST_CHUNK} bytes')
        return found

    return bounded
