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
One chunk of an MCAP file: decompressed, and its checksum checked.

The package ``mcap`` does not limit the size of a chunk; here one is decompressed at most to its
declared size.
"""

from __future__ import annotations

from io import BytesIO
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.records import Chunk
from stewart_dynamics.bags.mcap_layout import INCONSISTENT, LARGEST_CHUNK
import zstandard


def decompressed(record: bytes) -> tuple[bytes, bool]:
    """
    Return the records in a chunk, and whether a checksum covers them.

    Parameters
    ----------
    record : bytes
        The content of the chunk's record.

    Raises
    ------
    ValueError
        A size, the compression or the checksum is wrong; the decompressors raise other exceptions
        for damaged bytes.

    """
    stream = ReadDataStream(BytesIO(record))
    chunk = Chunk.read(stream)
    size, data = chunk.uncompressed_size, bytes(chunk.data)
    if stream.count != len(record):
        raise ValueError(INCONSISTENT)
    if size > LARGEST_CHUNK:
        raise ValueError(f'{size} bytes, at most {LARGEST_CHUNK} are read')
    if chunk.compression == 'zstd':
        # No more than the declared size is allocated.
        if zstandard.frame_content_size(data) not in (-1, size):
            raise ValueError('its sizes are inconsistent')
        data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    elif chunk.compression == 'lz4':
        data = bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    elif chunk.compression:
        raise ValueError(f'compressed as {chunk.compression!r}, must be zstd or lz4')
    if len(data) != size:
        raise ValueError(f'{len(data)} bytes, must be {size}')
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('its checksum is wrong')
    return data, bool(chunk.uncompressed_crc) or size == 0
