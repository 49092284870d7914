# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The cells of a text file: separators, comments, the row of the names, decimal marks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import csv
import io
import math
from pathlib import Path
import re
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import BagError, shown, shown_name
from stewart_dynamics.program import plain_digits
from stewart_dynamics.whole_file import read_text

# Squares of larger numbers, and their squares, would overflow.
_END = 1e30
_SEPARATORS = (',', ';', '\t', ' ')
# Lines in which the names of the columns are looked for.
_TOP = 100
# Between words of a line without other separators; a unit in brackets belongs to its name.
_SPACES = re.compile(r'\s+(?![\[(])')


class Row(NamedTuple):
    """A row of cells."""

    line: int  # of the file, from 1
    cells: list[str]


class Cells(NamedTuple):
    """The cells of a file as text: the row that names the columns, and those below it."""

    path: Path
    header: Row
    rows: list[Row]
    separator: str

    def numbers(self, places: Sequence[int]) -> Array:
        """
        Return the (N, K) numbers in some columns; nan where a cell is empty.

        Beside other separators than commas they may have decimal commas, then all of them.

        Raises BagError with the file, row, column, value and rule of a cell that is no number;
        if a row has not as many cells as the first.
        """
        width = len(self.header.cells)
        for line, row in self.rows:
            if len(row) < width or any(map(str.strip, row[width:])):
                raise BagError(
                    f'{self.path}: row {line}: has {len(row)} cells, row {self.header.line} has '
                    f'{width}' + (': decimal commas need semicolons between the columns'
                                  if self.separator == ',' and len(row) > width else ''))
        columns = [[row[place] for _, row in self.rows] for place in places]
        mark = _decimal_mark(self.separator, columns)
        values = np.empty((len(self.rows), len(places)))
        for n, column in enumerate(columns):
            whole = _column(column, mark)
            if whole is None:
                name = shown_name(self.header.cells[places[n]])
                whole = [_number(cell, f'{self.path}: row {line}: {name}', mark)
                         for (line, _), cell in zip(self.rows, column, strict=True)]
            values[:, n] = whole
        return values


def text_of(path: Path, largest: int) -> str:
    """Return the text of a file; BagError if it cannot be read. largest: of a file [bytes]."""
    return read_text(path, largest, BagError).lstrip('\ufeff')


def split_rows(path: Path, text: str, separator: str) -> list[Row]:
    """Return the rows of a text without empty ones; BagError if they break the rules of CSV."""
    try:
        return [Row(line, cells) for line, cells in _split(text, separator)
                if any(map(str.strip, cells))]
    except csv.Error as exc:
        raise BagError(f'{path}: not a CSV file: {exc}') from exc


def find_table(path: Path, text: str, known: Callable[[str], bool]) -> Cells:
    """
    Return the table of a text.

    The row that names the columns is the first that names two columns, or the first row;
    what stands above it is not read. Lines that begin with # are comments; the last one
    above the numbers may be that row. Separators are commas, semicolons, tabs or spaces.

    known: whether a column of this name is read. The separator is the one by which the row of the
        names has the most of them: other columns' names can contain the other separators.

    Raises BagError if the file is empty or breaks the rules of CSV.
    """
    separator = max(_SEPARATORS, key=lambda each: max(
        (_count(row.cells, known) for row in _top_rows(text, each)), default=0))
    rows = split_rows(path, text, separator)
    header: Row | None = None
    while rows and _is_comment(rows[0]):
        comment = rows.pop(0)
        header = comment._replace(cells=[comment.cells[0].lstrip().removeprefix('#'),
                                         *comment.cells[1:]])
        if not header.cells[0].strip() and separator == ' ':
            del header.cells[0]
    if header is None or not (rows and _is_numeric(rows[0]) and _count(header.cells, known)):
        at = next((n for n, row in enumerate(rows[:_TOP]) if _count(row.cells, known) > 1), 0)
        header, rows = (rows[at], rows[at + 1:]) if rows else (None, [])
    if header is None:
        raise BagError(f'{path}: is empty: row 1 must name the columns')
    cells = [cell.strip() for cell in header.cells]
    while cells and not cells[-1]:
        del cells[-1]
    return Cells(path, header._replace(cells=cells), rows, separator)


def _split(text: str, separator: str) -> Sequence[tuple[int, list[str]]]:
    """Return number and cells of each line of a text, whose lines can end in any way."""
    stream = io.StringIO(text, newline=None)
    if separator == ' ':
        return [(n, line.split() if line.lstrip().startswith(('(', '[')) else
                 _SPACES.split(line.strip())) for n, line in enumerate(stream, 1)]
    reader = csv.reader(stream, delimiter=separator, strict=True)
    return [(reader.line_num, cells) for cells in reader]


def _top_rows(text: str, separator: str) -> list[Row]:
    """Return the first rows of a text; those until one that breaks the rules of CSV."""
    found: list[Row] = []
    for line, _ in zip(io.StringIO(text, newline=None), range(_TOP), strict=False):
        try:
            found += [Row(0, cells) for _, cells in _split(line.lstrip('#'), separator)]
        except csv.Error:
            break
    return found


def _count(cells: Sequence[str], known: Callable[[str], bool]) -> int:
    return len({cell.strip() for cell in cells if cell.strip() and known(cell.strip())})


def _is_comment(row: Row) -> bool:
    return row.cells[0].lstrip().startswith('#')


def _is_numeric(row: Row) -> bool:
    return all(is_number(cell) for cell in row.cells if cell.strip())


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal point or a decimal comma."""
    try:
        float(cell.replace(',', '.'))
    except ValueError:
        return False
    return True


def _decimal_mark(separator: str, columns: Sequence[Sequence[str]]) -> str:
    """Return the decimal mark: a comma beside other separators, if no cell has a point."""
    cells = [cell for column in columns for cell in column] if separator != ',' else []
    commas = any(',' in cell for cell in cells)
    return ',' if commas and not any('.' in cell for cell in cells) else '.'


def _column(cells: list[str], mark: str) -> list[float] | None:
    """Return the numbers of a column, nan for empty cells; None if a cell may be no number."""
    joined = ''.join(cells)
    if '_' in joined or not joined.isascii():
        return None
    empty = {n for n, cell in enumerate(cells) if not cell or cell.isspace()}
    try:
        values = [math.nan if n in empty else
                  float(cell if mark == '.' else cell.replace(mark, '.'))
                  for n, cell in enumerate(cells)]
    except ValueError:
        return None
    return values if sum(abs(value) < _END for value in values) + len(empty) == len(
        values) else None


def _number(cell: str, where: str, mark: str) -> float:
    if not cell.strip():
        return math.nan
    try:
        value = float(plain_digits(cell.strip().replace(mark, '.')))
    except ValueError:
        value = math.nan
    if not abs(value) < _END:
        raise BagError(f'{where}: {shown(cell)}: must be a finite number below {_END:g}, with '
                       f'a decimal {"comma" if mark == "," else "point"} and digits 0 to 9')
    return value
