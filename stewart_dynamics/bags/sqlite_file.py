# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Bags in sqlite3, as rosbag2 records them; the format has no checksums."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
import sqlite3

from stewart_dynamics.bags.blocks import described, LARGEST_ROW, RowsFile
from stewart_dynamics.errors import BagError, one_line, shown

# Instructions of sqlite's virtual machine at most, for all of a file and for each byte: ten
# times as many as the rows of a recording need.
_INSTRUCTIONS, _FOR_A_BYTE, _AT_ONCE = 100_000_000, 100, 1_000_000
_TABLES = {'topics': ('id', 'name', 'type', 'serialization_format'),
           'messages': ('topic_id', 'timestamp', 'data')}


class SqliteFile(RowsFile):
    """
    The messages of a file in sqlite3.

    Raises BagError if it has no such tables, sqlite3.Error if it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        # Read the file as it is on disk: journals are neither applied nor created.
        self._database = sqlite3.connect(f'{path.absolute().as_uri()}?immutable=1', uri=True,
                                         check_same_thread=False)
        self._steps = (_INSTRUCTIONS + _FOR_A_BYTE * path.stat().st_size) // _AT_ONCE
        self._database.set_progress_handler(self._step, _AT_ONCE)
        # Names may be any bytes.
        self._database.text_factory = lambda text: text.decode('utf-8', 'backslashreplace')
        try:
            for table, columns in _TABLES.items():
                self._check(table, columns)
            self._topics = self._read_topics()
        except BaseException:
            self._database.close()
            raise

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic, and its encoding if that is not CDR."""
        return described(self._topics.values())

    def rows(self, keys: Mapping[str, str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time [ns] and bytes of each message of these topics, in order of time."""
        wanted = {number: name for number, (name, _, _) in self._topics.items() if name in keys}
        unsound = 0
        for number, time, data in self._database.execute(
                "SELECT topic_id, timestamp, CASE WHEN typeof(data) = 'blob' AND "
                f'length(data) <= {LARGEST_ROW} THEN data END FROM messages WHERE topic_id IN '
                f'({", ".join(map(str, wanted))}) ORDER BY timestamp'):
            if isinstance(time, int) and time >= 0 and data is not None:
                yield wanted[number], time, data
            else:
                unsound += 1
        if unsound:
            self.missing.append(f'{unsound} rows that are not messages')
        if not self.missing:
            self._check_pages()

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _step(self) -> bool:
        """Return whether to interrupt: only files made for it take as many steps."""
        self._steps -= 1
        return self._steps < 0

    def _check(self, table: str, columns: tuple[str, ...]) -> None:
        """Raise BagError unless this is a table on disk; views and formulas may never end."""
        # An ordinary column is not hidden, and an ordinary table has a page.
        found = {name for _, name, _, _, _, _, hidden in self._database.execute(
            f'PRAGMA table_xinfo({table})') if not hidden}
        kinds = [kind if page else 'view' for kind, page in self._database.execute(
            'SELECT type, rootpage FROM sqlite_master WHERE lower(name) = ?', [table])]
        if kinds != ['table'] or not found.issuperset(columns):
            raise BagError(f'has no table {table} with the columns {", ".join(columns)}')

    def _read_topics(self) -> dict[int, tuple[str, str, str]]:
        """Return name, type and encoding of each topic, by its number."""
        topics = {}
        for number, *texts in self._database.execute(
                f'SELECT {", ".join(_TABLES["topics"])} FROM topics'):
            name, kind, encoding = texts
            if not isinstance(number, int) or not all(isinstance(text, str) for text in texts):
                self.missing.append(f'topic {shown(name)}: number, name, type or encoding is not '
                                    'valid')
            else:
                topics[number] = name, kind, encoding
        return topics

    def _check_pages(self) -> None:
        """Note damage that sqlite3 does not report while reading."""
        try:
            self._database.execute('PRAGMA ignore_check_constraints = ON')
            (found,), = self._database.execute('PRAGMA quick_check(1)')
        except sqlite3.Error as exc:
            found = exc
        if found != 'ok':
            self.missing.append(f'damaged, what is missing is unknown: {one_line(found)}')
