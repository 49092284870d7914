# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""A recorded bag: its topics, and the messages of some of them in blocks."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from pathlib import Path
import tempfile

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.blocks import of_good_length, Source
from stewart_dynamics.bags.csv_motion import CsvMotion
from stewart_dynamics.bags.find import files_of
from stewart_dynamics.bags.mcap_file import MAGIC, McapFile
from stewart_dynamics.bags.other_messages import Converter, POSE_TYPES
from stewart_dynamics.bags.sqlite_file import SqliteFile
from stewart_dynamics.errors import BagError, one_line, shown_name
from stewart_dynamics.mechanics.kinematics.pose_errors import PoseByAngles
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.parameters.table import PARAMETERS
from stewart_dynamics.tables.reading import is_table, Reading
import zstandard

_SQLITE = b'SQLite format 3\0'
_ROS_1 = b'#ROSBAG V'
# Longer names of topics or types are not valid in ROS.
_LONGEST_NAME = 255
# The largest size of a decompressed file, relative to the compressed one, and in bytes.
_TIMES, _AT_LEAST = 1000, 1 << 26
_PART = 1 << 20
# Messages that are read of a file of any size. Of larger ones no more are read than they have
# bytes: no recording is compressed as well, but files made to occupy the reader for hours are.
_MESSAGES = 100_000
# Maximum number of listed texts of a kind.
LISTED = 20


class Recording:
    """
    A bag of ROS 2, a folder or one of its files, or a bag of ROS 1, a file or a folder of files.

    A table, a file .csv, .tsv or .txt, is read as one, see ``csv_motion``, and so are poses of
    other types and in other axes, see ``other_messages``.

    reading: options for those.
    frame: frame of the platform, the child of its transforms.
    home: returns the position [m] from which accelerations alone are integrated.

    Raises BagError if nothing of it can be read, with the reason in one line.

    topics: the type of each topic in it.
    missing: descriptions of the parts that could not be read so far.
    notices: notices to the user about the reading of the bag.
    unknown_angles: poses of a table by angles without a unit; empty if the unit is known.
    """

    def __init__(self, path: Path, reading: Reading | None = None,
                 frame: str = PARAMETERS['platform_frame'].default,
                 home: Callable[[], Array] | None = None) -> None:
        self.path = path
        self._reading, self._frame, self._home = reading or Reading(), frame, home
        self.missing: list[str] = []
        self.notices: list[str] = []
        self.unknown_angles: tuple[PoseByAngles, ...] = ()
        self.table: CsvMotion | None = None  # the file, if it is a table
        self._sources: list[tuple[Path, Source]] = []
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        faults = []
        try:
            for file in files_of(path, self.missing, self.notices):
                try:
                    self._sources.append((file, self._opened(file)))
                except BagError as exc:
                    faults.append(f'{exc}')
            if not self._sources:
                raise BagError('; '.join(faults))
        except BaseException as exc:
            self.close()
            # An invalid file name, a loop of links, a folder that cannot be listed.
            if isinstance(exc, (OSError, RuntimeError, ValueError)):
                raise BagError(f'{path}: not a bag that can be read: {one_line(exc)}') from exc
            raise
        self.missing += faults
        kinds: dict[str, set[str]] = {}
        for file, source in self._sources:
            for topic, kind in source.topics.items():
                if max(len(topic), len(kind)) <= _LONGEST_NAME:
                    kinds.setdefault(topic, set()).add(kind)
                else:
                    self.missing.append(f'{file.name}: topic {shown_name(topic)} of type '
                                        f'{shown_name(kind)}: at most {_LONGEST_NAME} characters')
        self.topics = {topic: ' and '.join(sorted(of)) for topic, of in kinds.items()}

    def find_topic(self, kind: str, given: str | None, usual: str, option: str,
                   left_out: Container[str] = (), advice: str = '') -> str:
        """
        Return a topic of a type: the given one, the usual one, or the only other one.

        option: the option that gives it. left_out: topics that are something else.
        Raises BagError if there is no such topic, or several; ``advice`` follows the first text.
        """
        if given or usual in self.topics:
            return self.checked_topic(given or usual, kind)
        others = self.topics_of(kind, left_out) or self._readable_as(kind, left_out)
        if len(others) == 1:
            return others[0]
        lacking = f'no topic {usual}, and ' if usual else ''
        if others:
            parts = ('; if each has some of the legs, select them together, separated by commas'
                     if kind == type_names.JOINT_STATE else '')
            raise BagError(f'{self.path}: has {lacking}several of type {kind}: {joined(others)}: '
                           f'select one by {option}{parts}')
        none = f'{lacking}no other of type {kind}' if usual else (
            f'no topic of type {kind} for {option}')
        raise BagError(f'{self.path}: has {none}; it contains {self.contents}{advice}')

    def topics_of(self, kind: str, left_out: Container[str] = ()) -> list[str]:
        """Return the topics of a type but some."""
        return sorted(name for name, other in self.topics.items()
                      if other == kind and name not in left_out)

    def _readable_as(self, kind: str, left_out: Container[str]) -> list[str]:
        """Return the topics of other types that are read as poses; transforms with a child."""
        if kind != type_names.POSE_STAMPED:
            return []
        return sorted(
            name for other in POSE_TYPES for name in self.topics_of(other, left_out)
            if other != type_names.TF_MESSAGE or self._reading.child is not None)

    def checked_topic(self, name: str, kind: str) -> str:
        """
        Return a topic; raise BagError if the bag has no such topic, or one of another type.

        Joint states may be in several topics, separated by commas.
        """
        if kind == type_names.JOINT_STATE and len(names := topics_in(name)) > 1:
            return ','.join(self.checked_topic(each, kind) for each in names)
        if name not in self.topics:
            raise BagError(f'{self.path}: has no topic {name}; it contains {self.contents}')
        others = POSE_TYPES if kind == type_names.POSE_STAMPED else ()
        if self.topics[name] not in (kind, *others):
            raise BagError(f'{self.path}: {name}: is a {self.topics[name]}, must be a {kind}')
        return name

    @property
    def contents(self) -> str:
        """Return the topics with their types, and the parts that could not be read."""
        held = joined([f'{name} ({kind})' for name, kind in sorted(
            self.topics.items())]) or 'no topics'
        damage = listed(self.damage)
        return held + (f'; could not be read: {"; ".join(damage)}' if damage else '')

    def messages(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """
        Yield the messages of some topics, and the number of bytes read for them.

        keys: from topics in the bag, several separated by commas, to the names under which their
            messages are given.
        """
        keys = {topic: key for topics, key in keys.items() for topic in topics_in(topics)}
        convert = Converter({key: self.topics[topic] for topic, key in keys.items()
                             if topic in self.topics}, self._reading, self._frame)
        for file, source in self._sources:
            most, count = _MESSAGES + file.stat().st_size, 0
            for block, size in of_good_length(source.blocks(keys)):
                count += len(block.times)
                if count > most:
                    self.missing.append(f'{file.name}: more messages than bytes: those after '
                                        f'{count - len(block.times)} are not read')
                    break
                yield block if isinstance(source, CsvMotion) else convert(block), size
            self.missing += [f'{file.name}: {what}' for what in source.missing]
            source.missing.clear()
            if source.unchecked:
                self.notices.append(f'{file.name}: has no checksums: damaged bytes '
                                    'cannot be detected')
        if convert.children and not convert.found:
            raise BagError(f'{self.path}: no transform has the child frame {convert.child}; there '
                           f'are {joined(sorted(convert.children))}: select one by --child')

    @property
    def damage(self) -> list[str]:
        """Return descriptions of the parts that could not be read so far, of all files."""
        return self.missing + [f'{file.name}: {what}' for file, source in self._sources
                               for what in source.missing]

    def close(self) -> None:
        """Close the files."""
        for _, source in self._sources:
            source.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _opened(self, file: Path) -> Source:
        if is_table(file):
            motion = CsvMotion(file, self._reading, self._home)
            self.notices += motion.notices
            self.unknown_angles, self.table = motion.unknown_angles, motion
            return motion
        try:
            unpacked = file
            if file.suffix == '.zstd':
                unpacked = self._new_file()
                if fault := _unpack(file, unpacked):
                    self.missing.append(f'{file.name}: {fault}')
            with unpacked.open('rb') as stream:
                head = stream.read(len(_SQLITE))
            if head.startswith(MAGIC):
                return McapFile(unpacked)
            if head.startswith(_ROS_1):
                from stewart_dynamics.bags.ros1_file import Ros1File  # rosbags is slow to import
                return Ros1File(unpacked)
            if head != _SQLITE:
                raise BagError('not MCAP, not sqlite3, not a bag of ROS 1')
            # After a crash of the recorder it contains messages that are not in the file.
            for ending in ('-wal', '-journal'):
                journal = file.with_name(f'{file.name}{ending}')
                if journal.is_file() and journal.stat().st_size:
                    self.missing.append(f'{journal.name}: the recording was not closed; messages '
                                        'that are only in this file are not read')
            return SqliteFile(unpacked)
        except Exception as exc:  # damaged bytes: rosbags raises any exception
            raise BagError(f'{file}: not a bag that can be read: {one_line(exc)}') from exc

    def _new_file(self) -> Path:
        """Return a path in a temporary folder, removed by ``close``."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        return folder / f'{len(list(folder.iterdir()))}'


def topics_in(names: str) -> list[str]:
    """Return the topics in names that are separated by commas."""
    return [name.strip() for name in names.split(',')]


def listed(texts: Sequence[str]) -> list[str]:
    """Return the first texts, and the number of the others."""
    if len(texts) <= LISTED:
        return list(texts)
    return [*texts[:LISTED], f'and {len(texts) - LISTED} more']


def joined(names: Sequence[str]) -> str:
    """Return names with commas, the first of them."""
    return ', '.join(listed(names))


def _unpack(file: Path, unpacked: Path) -> str:
    """Decompress a file by zstd; return the error as text, empty on success."""
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
