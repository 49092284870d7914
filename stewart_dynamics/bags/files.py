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


"""The files of a bag, their order, and their decompression."""

from __future__ import annotations

from pathlib import Path
import re

from stewart_dynamics.errors import BagError, one_line, ParameterError
from stewart_dynamics.parameters.yaml_file import read_document
import zstandard

# Suffixes of the files of a bag, also of files compressed as a whole.
STORAGES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd', '.bag')
METADATA = 'metadata.yaml'

# The largest size of a decompressed file, relative to the compressed one, and in bytes.
_TIMES, _AT_LEAST = 1000, 1 << 26
_PART = 1 << 20
_LARGEST_METADATA = 1_000_000


def files_of(bag: Path, missing: list[str], notices: list[str]) -> list[Path]:
    """
    Return the files of a bag in their order.

    Parameters
    ----------
    bag : Path
        A file, or a folder with the metadata of rosbag2 or without.
    missing, notices : list of str
        Listed files that do not exist, and notices to the user, are appended.

    Raises BagError if there is no file, or if a listed file is outside of the folder.

    """
    if not bag.is_dir():
        if not bag.is_file():
            raise BagError(f'{bag}: not a bag that can be read: no such file or folder')
        return [bag]
    found = sorted((file for file in bag.iterdir() if file.name.endswith(STORAGES)
                    and _is_inside(file, bag)), key=_by_number)
    # rosbags' own reader of this file opens and decompresses all listed files, or none.
    try:
        document = read_document(bag / METADATA, _LARGEST_METADATA)
        names = document['rosbag2_bagfile_information']['relative_file_paths']
        listed = [bag / name for name in names]
    except (ParameterError, KeyError, TypeError) as exc:
        listed = []
        why = f'{exc}' if isinstance(exc, ParameterError) else (
            f'{bag / METADATA}: lists no files')
    else:
        why = f'{bag / METADATA}: lists no existing file'
    # Older recorders put the folder's name before that of the file.
    listed = list(dict.fromkeys(file if file.exists() else bag / file.name for file in listed))
    outside = [file for file in listed if file.exists() and not _is_inside(file, bag)]
    if outside:
        raise BagError(f'{bag}: not a bag that can be read: metadata.yaml lists '
                       f'{outside[0]}, which is not a file in the folder')
    there = [file for file in listed if file.exists()]
    if there:
        missing += [f'{file.name}: no such file' for file in listed if file not in there]
        return there
    if not found:
        raise BagError(f'{bag}: not a bag that can be read: {why}')
    if not all(file.suffix == '.bag' for file in found):  # ROS 1 writes none
        notices.append('metadata.yaml is missing or damaged: the files in the folder are read')
    return found


def unpack(file: Path, unpacked: Path) -> str:
    """Decompress a file by zstd; return what is wrong, or an empty text."""
    room = max(_AT_LEAST, _TIMES * file.stat().st_size)
    with file.open('rb') as packed, unpacked.open('wb') as stream:
        try:
            reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
            while part := reader.read(_PART):
                if len(part) > room:
                    return (f'unpacks to more than {_TIMES} times its size: the rest is not '
                            'read')
                room -= len(part)
                stream.write(part)
        except zstandard.ZstdError as exc:
            return one_line(exc)
    return ''


def _is_inside(file: Path, folder: Path) -> bool:
    """Return whether this is a file in a folder, and not a link to another folder."""
    return file.is_file() and file.resolve().parent == folder.resolve()


def _by_number(file: Path) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them: rosbag2 numbers its files."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', file.name)]
