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


"""Bags of ROS 1, read by rosbags; the format has no checksums."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import lz4.frame
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import decompressors
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores

from stewart_dynamics.bags.blocks import LARGEST_CHUNK, rows_in_blocks
from stewart_dynamics.errors import one_line
from stewart_dynamics.messages.recorded import Messages


class Ros1File:
    """
    The messages of a bag of ROS 1, converted to those of ROS 2.

    Raises any exception of rosbags if it cannot be opened.

    Attributes
    ----------
    missing : list of str
        Descriptions of the parts that could not be read.
    unchecked : bool
        Messages without a checksum were read; always True.

    """

    def __init__(self, path: Path) -> None:
        self.missing: list[str] = []
        self.unchecked = True
        self._reader = Reader(path)
        self._reader.open()
        # rosbags does not limit the size of decompressed chunks.
        self._reader.chunks = {
            place: chunk._replace(decompressor=_bounded(chunk.decompressor))
            for place, chunk in self._reader.chunks.items()}
        self._store = get_typestore(Stores.ROS2_JAZZY)

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and whether its definition differs."""
        kinds: dict[str, set[str]] = {}
        store = get_typestore(Stores.ROS1_NOETIC)
        for of in self._reader.connections:
            kind = str(of.msgtype)
            if kind in store.types and store.generate_msgdef(kind)[1] != of.digest:
                kind += ' of another definition'
            kinds.setdefault(of.topic, set()).add(kind)
        return {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source; an error ends them, and is noted."""
        wanted = [of for of in self._reader.connections if of.topic in keys]
        count = 0

        def rows() -> Iterator[tuple[str, int, bytes]]:
            nonlocal count
            for of, time, data in self._reader.messages(wanted) if wanted else ():
                count += 1
                try:
                    message = bytes(self._store.ros1_to_cdr(data, of.msgtype))
                except SerdeError:
                    message = b''  # rejected as malformed
                yield of.topic, time, message

        try:
            yield from rows_in_blocks(rows(), keys)
        except Exception as exc:  # damaged bytes: rosbags raises any exception
            self.missing.append(f'everything after {count} messages: {one_line(exc)}')

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


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
