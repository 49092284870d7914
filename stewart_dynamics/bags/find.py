# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Bags in folders, the files of a bag, and the folders of their results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import re
import shlex

from stewart_dynamics.errors import BagError, ParameterError
from stewart_dynamics.parameters.yaml_file import read_document

# Suffixes of the files of a bag, also of files compressed as a whole.
STORAGES = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd', '.bag')
METADATA = 'metadata.yaml'
# In a folder of results of a replay: the file by which it is known, and the output bag.
RESULT, OUTPUT_BAG = 'summary.json', 'bag'
_LARGEST_METADATA = 1_000_000
FLEET_TABLE, FLEET_PAGE = 'fleet.csv', 'index.html'

# rosbag2 numbers the files of a recording: <name of the bag>_0.mcap, ...
_NUMBERED = re.compile(r'(?P<name>.*)_(?P<number>\d+)(?P<suffix>\.\w+(?:\.zstd)?)')


def is_bag_file(path: Path) -> bool:
    """Return whether a file is a bag, or one of a bag, by its name."""
    return path.name.endswith(STORAGES)


def find_bags(path: Path, leave_out: Path | None = None) -> list[Path]:
    """
    Return the bags at a path: itself, or all below it.

    A file is a bag, and so is a folder with a metadata.yaml. A folder without one, left by a
    killed recorder, is a bag if it contains the files of one recording, no other bag and no
    bags below it; otherwise each of its files is a bag. Symbolic links, hidden names and
    results of replays are skipped.

    path: a path that is not a folder is returned as it is, even if it does not exist.
    leave_out: a folder that is not searched: the folder of the results.

    Raises BagError if there is no bag.
    """
    if not path.is_dir():
        return [path]
    bags = sorted(_below(path, leave_out.resolve() if leave_out else None))
    if not bags:
        raise BagError(f'{path}: contains no bag: no {METADATA} and no files '
                       f'{" or ".join("*" + suffix for suffix in STORAGES)}, nor do the folders '
                       'below it (links and hidden folders are not followed)')
    return bags


def _below(folder: Path, leave_out: Path | None) -> Iterator[Path]:
    try:
        with os.scandir(folder) as entries:
            seen = [entry for entry in entries
                    if not entry.name.startswith('.') and not entry.is_symlink()]
    except PermissionError:
        yield folder  # the reader reports why it cannot be read
        return
    folders = [folder / entry.name for entry in seen if entry.is_dir()]
    files = [folder / entry.name for entry in seen if entry.is_file()]
    if folder / METADATA in files:
        yield folder
        return
    storages = [file for file in files if is_bag_file(file)]
    below = [bag for each in folders if each.resolve() != leave_out and not _holds_results(each)
             for bag in _below(each, leave_out)]
    yield from [folder] if storages and not below and _one_recording(storages) else storages
    yield from below


def _one_recording(files: Sequence[Path]) -> bool:
    names = {found.group('name', 'suffix') if (found := _NUMBERED.fullmatch(file.name))
             else file.name
             for file in files}
    return len(names) == 1


def _holds_results(folder: Path) -> bool:
    try:
        return (folder / RESULT).is_file() and (folder / OUTPUT_BAG / METADATA).is_file()
    except PermissionError:
        return False


def files_of(bag: Path, missing: list[str], notices: list[str]) -> list[Path]:
    """
    Return the files of a bag in their order.

    bag: a file, or a folder with the metadata of rosbag2 or without.
    missing, notices: listed files that do not exist, and notices to the user, are appended.

    Raises BagError if there is no file, or if a listed file is outside of the folder.
    """
    if not bag.is_dir():
        if not bag.is_file():
            raise BagError(f'{bag}: not a bag that can be read: no such file or folder')
        return [bag]
    found = sorted((file for file in bag.iterdir() if is_bag_file(file)
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
        names = _counted_from_zero(listed, found)
        for file in found:
            if not (file in there or file.name.startswith('.') or _is_packed_twin(file, there)):
                numbered = _NUMBERED.fullmatch(file.name)
                (missing if numbered and numbered['name'] in names else notices).append(
                    f'{file.name} is in the folder but not in metadata.yaml: it is not read '
                    f'(ros2 bag reindex {shlex.quote(str(bag))} lists it)')
        return there
    if not found:
        raise BagError(f'{bag}: not a bag that can be read: {why}')
    if not all(file.suffix == '.bag' for file in found):  # ROS 1 writes none
        notices.append('metadata.yaml is missing or damaged: the files in the folder are read')
    return found


def _counted_from_zero(listed: Sequence[Path], found: Sequence[Path]) -> set[str]:
    """
    Return the names of listed recordings whose files are numbered as rosbag2 does, from 0.

    Other files that end with numbers, as those of years, are recordings of their own.
    """
    numbered = [(file, match) for file in dict.fromkeys((*listed, *found))
                if (match := _NUMBERED.fullmatch(file.name))]
    begun = {match['name'] for _, match in numbered if match['number'] == '0'}
    return begun & {match['name'] for file, match in numbered if file in listed}


def _is_packed_twin(file: Path, others: Sequence[Path]) -> bool:
    """Return whether this is one of the others compressed, or decompressed by its reader."""
    return any(file.name.removesuffix('.zstd') == other.name.removesuffix('.zstd')
               for other in others)


def _is_inside(file: Path, folder: Path) -> bool:
    """Return whether this is a file in a folder, and not a link to another folder."""
    return file.is_file() and file.resolve().parent == folder.resolve()


def _by_number(file: Path) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them: rosbag2 numbers its files."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', file.name)]


def folders_of_results(paths: Sequence[Path], output: Path) -> list[tuple[Path, Path]]:
    """
    Return the bags at some paths, each with the folder of its results.

    The results of a bag given by its path are in ``output`` under its name; those of bags found
    in a folder are at the same relative path in ``output``. Suffixes of files are removed,
    unless two files in one folder would then have the same name.

    Raises BagError if a folder contains no bags, or if results would share a folder or be nested.

    """
    pairs: list[tuple[Path, Path]] = []
    for path in paths:
        try:
            bags = find_bags(path, output)
        except BagError:
            if len(paths) == 1:
                raise
            bags = [path]  # reported together with the others
        if bags == [path]:
            whole = Path(os.path.abspath(path))  # '.' has no name
            pairs.append((path, output / (whole.name if path.is_dir() else whole.stem)))
        else:
            pairs += zip(bags, (output / name for name in _names(path, bags)), strict=True)
    _check_apart(pairs, output)
    return pairs


def _names(folder: Path, bags: Sequence[Path]) -> list[Path]:
    whole = [bag.relative_to(folder) for bag in bags]
    short = [name if bag.is_dir() else name.with_suffix('')
             for name, bag in zip(whole, bags, strict=True)]
    number = Counter(short)
    parents = {parent for brief in short for parent in brief.parents}
    return [name if number[brief] > 1 or brief in parents else brief
            for name, brief in zip(whole, short, strict=True)]


def _check_apart(pairs: Sequence[tuple[Path, Path]], output: Path) -> None:
    taken: dict[Path, Path] = {}
    for bag, folder in pairs:
        if folder in taken:
            raise BagError(f'{taken[folder]}, {bag}: the results of both would be {folder}: '
                           'replay one of them into another --output')
        if folder in (output / FLEET_TABLE, output / FLEET_PAGE):
            raise BagError(f'{bag}: its results would be {folder}, where the table of all bags '
                           'is written: replay it into another --output')
        taken[folder] = bag
    for bag, folder in pairs:
        for parent in folder.parents:
            if parent in taken:
                raise BagError(f'{taken[parent]}, {bag}: the results of one, {folder}, would be '
                               f'inside those of the other, {parent}: replay one of them into '
                               'another --output')


def bytes_of(bag: Path) -> int:
    """Return the size of a bag [bytes], at least 1, so that each bag counts."""
    try:
        files = [file for file in bag.iterdir() if file.is_file()] if bag.is_dir() else [bag]
        return sum(file.stat().st_size for file in files) or 1
    except OSError:  # reported when the bag is replayed
        return 1
