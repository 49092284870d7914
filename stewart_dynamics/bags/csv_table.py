# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Tables of numbers in CSV files whose first row names the columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import csv
import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import shown, shown_name, StewartError
from stewart_dynamics.program import plain_digits
from stewart_dynamics.whole_file import read_text

# Squares of larger numbers, and their squares, would overflow.
_END = 1e30
_SEPARATORS = (',', ';', '\t')


class Table(NamedTuple):
    """The cells of a CSV file as text."""

    path: Path
    header: list[str]
    lines: list[int]  # the line of the file of each row
    rows: list[list[str]]
    separator: str

    def numbers(self, places: Sequence[int]) -> Array:
        """
        Return the numbers (N, K) in some columns.

        Beside semicolons and tabs they may have decimal commas, then all of them.

        Raises StewartError with the file, row, column, value and rule of a cell that is no number;
        if a row has not as many cells as the first.
        """
        for line, row in zip(self.lines, self.rows, strict=True):
            if len(row) != len(self.header):
                raise StewartError(
                    f'{self.path}: row {line}: has {len(row)} cells, row 1 has {len(self.header)}'
                    + (': decimal commas need semicolons between the columns'
                       if self.separator == ',' and len(row) > len(self.header) else ''))
        columns = [[row[place] for row in self.rows] for place in places]
        mark = _decimal_mark(self.separator, columns)
        values = np.empty((len(self.rows), len(places)))
        for n, column in enumerate(columns):
            whole = _column(column, mark)
            if whole is None:
                name = shown_name(self.header[places[n]])
                whole = [_number(cell, f'{self.path}: row {line}: {name}', mark)
                         for line, cell in zip(self.lines, column, strict=True)]
            values[:, n] = whole
        return values


def read_table(path: Path, known: Callable[[str], bool], largest: int) -> Table:
    """
    Return the table of a file.

    Row 1 has the names of the columns, separated by commas, semicolons or tabs. Empty lines and,
    before the first row, lines that begin with # are left out.

    known: whether a column of this name is read. The separator is the one by which the first row
        has the most of them: other columns' names can contain the other separators.
    largest: largest size [bytes].

    Raises StewartError if the file cannot be read or is empty.
    """
    text = read_text(path, largest, StewartError).lstrip('\ufeff')
    separator = max(_SEPARATORS, key=lambda each: len(
        {name for name in _first_row(text, each) if known(name)}))
    try:
        reader = csv.reader(_lines(text), delimiter=separator, strict=True)
        numbered = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as exc:
        raise StewartError(f'{path}: not a CSV file: {exc}') from exc
    while numbered and _is_comment(numbered[0][1]):
        del numbered[0]
    if not numbered:
        raise StewartError(f'{path}: is empty: row 1 must name the columns')
    (_, first_row), *numbered = numbered
    header = [cell.strip() for cell in first_row]
    return Table(path, header, [line for line, _ in numbered], [row for _, row in numbered],
                 separator)


def _is_comment(row: list[str]) -> bool:
    return row[0].lstrip().startswith('#')


def _lines(text: str) -> io.StringIO:
    """Return the lines of a text, which can end in any way."""
    return io.StringIO(text, newline=None)


def _first_row(text: str, separator: str) -> list[str]:
    try:
        rows = csv.reader(_lines(text), delimiter=separator, strict=True)
        return next(([cell.strip() for cell in row] for row in rows
                     if any(map(str.strip, row)) and not _is_comment(row)), [])
    except csv.Error:
        return []


def _decimal_mark(separator: str, columns: Sequence[Sequence[str]]) -> str:
    """Return the decimal mark: a comma beside other separators, if no cell has a point."""
    cells = [cell for column in columns for cell in column] if separator != ',' else []
    commas = any(',' in cell for cell in cells)
    return ',' if commas and not any('.' in cell for cell in cells) else '.'


def _column(cells: list[str], mark: str) -> list[float] | None:
    """Return the numbers of a column; None if a cell may be none."""
    joined = ''.join(cells)
    if '_' in joined or not joined.isascii():
        return None
    try:
        values = [float(cell if mark == '.' else cell.replace(mark, '.')) for cell in cells]
    except ValueError:
        return None
    return values if all(abs(value) < _END for value in values) else None


def _number(cell: str, where: str, mark: str) -> float:
    try:
        value = float(plain_digits(cell.strip().replace(mark, '.')))
    except ValueError:
        value = math.nan
    if not abs(value) < _END:
        raise StewartError(f'{where}: {shown(cell)}: must be a finite number below {_END:g}, with '
                           f'a decimal {"comma" if mark == "," else "point"} and digits 0 to 9')
    return value
