# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


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

from stewart_dynamics.bags.blocks import described, LARGEST_CHUNK, RowsFile


class Ros1File(RowsFile):
    """
    The messages of a bag of ROS 1, converted to those of ROS 2.

    Raises any exception of rosbags if it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
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
        store = get_typestore(Stores.ROS1_NOETIC)
        return described(
            (of.topic, str(of.msgtype) + (
                ' of another definition' if of.msgtype in store.types
                and store.generate_msgdef(of.msgtype)[1] != of.digest else ''), 'cdr')
            for of in self._reader.connections)

    def rows(self, keys: Mapping[str, str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time [ns] and bytes of each message of these topics, in order of time."""
        wanted = [of for of in self._reader.connections if of.topic in keys]
        for of, time, data in self._reader.messages(wanted) if wanted else ():
            try:
                message = bytes(self._store.ros1_to_cdr(data, of.msgtype))
            except SerdeError:
                message = b''  # rejected as malformed
            yield of.topic, time, message

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
