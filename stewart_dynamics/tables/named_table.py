# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The one reader of tables: numbers by quantity, in SI, without the samples that were lost.

All programs read CSV files through it, so that all take the same names, units, separators and
exports of trackers. A row in which a cell of a column that is read is empty is a lost sample: it
is left out, and counted in a notice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
import shlex
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import BagError, shown_name
from stewart_dynamics.mechanics.frames.rotation import (
    from_rotation_vector, quaternion_product, to_quaternion)
from stewart_dynamics.parameters.tolerances import (
    is_unit, QUATERNION_TOLERANCE, unit_rule as quaternion_rule)
from stewart_dynamics.program import AXES
from stewart_dynamics.tables.cells import Cells, find_table, Row, text_of
from stewart_dynamics.tables.column_names import (
    ANGLES, ANGULAR_VELOCITY, Heading, MATRIX, Names, Quantity, QUATERNION, ROTATION_VECTOR,
    ROTATIONS, si_factor, split, TIME, U_V_W, unit_rule)
from stewart_dynamics.tables.reading import Reading
from stewart_dynamics.tables.source_axes import axes_matrix, turned
from stewart_dynamics.tables.tracker_exports import Export, find_export

_LARGEST = 1 << 28  # of a file [bytes]
# Columns that are not read are listed up to this number.
_LISTED = 8
# Seconds between rows from which on a time without a unit may be in ms, and the fewest rows.
_SLOW, _SEVERAL = 1.0, 10
# Parts of names that a rotation, or a rotation rate, may have.
_OF_ROTATION = ('roll', 'pitch', 'yaw', 'rot', 'quat', 'angle', 'euler', 'heading', 'orient',
                'alpha', 'beta', 'gamma')
_OF_TURNING = ('gyr', 'rate', 'omega', 'angular', 'roll', 'pitch', 'yaw', 'spin')


class Rotations(NamedTuple):
    """The rotations of a table."""

    quaternions: Array  # (N, 4), the axes of the file
    angles: Array | None = None
    """(N, 3) numbers of angles whose unit is not given."""
    order: str = ''
    """The order of the angles, one of EULER."""


class _Place(NamedTuple):
    place: int
    factor: float
    has_unit: bool


class NamedTable:
    """
    A table by the names of its columns.

    quantities: those that are read, where the file has them.
    reading: axes, order of angles, names of columns.
    units: of a quantity without a unit in the file [SI]; others are in SI.

    Raises BagError, with file, row, column, value and rule, if the file breaks one.

    notices: for the user.
    """

    def __init__(self, path: Path, quantities: Iterable[Quantity], reading: Reading | None = None,
                 units: Mapping[tuple[str, ...], float] | None = None) -> None:
        self.path, self.notices = path, list[str]()
        self._reading, self._units = reading or Reading(), units or {}
        self._names = Names(quantities)
        self._export: Export | None = None
        self._table = self._cells()
        self._header = self._table.header
        self._places = self._found(self._table)
        if self._export is not None:
            self._note_axes(self._export)

    def _cells(self) -> Cells:
        """Return the cells, with units in the row of the names."""
        chosen = set(self._reading.columns.values())
        text = text_of(self.path, _LARGEST)
        self._export = find_export(self.path, text, self._reading.child)
        if self._export is not None:
            return self._export.cells
        cells = find_table(self.path, text, lambda cell: bool(
            self._names.heading(cell) or cell in chosen or split(cell)[0] in chosen))
        names, first = cells.header.cells, cells.rows[:1]
        if first and len(first[0].cells) >= len(names) and any(
                map(str.strip, first[0].cells)) and all(map(
                    self._names.has_unit, first[0].cells)) and not any(
                        map(str.isdigit, first[0].cells)):
            units = [cell.strip().strip('[]()-').strip() for cell in first[0].cells]
            names = [f'{name} [{unit}]' if unit and not split(name)[1] else name
                     for name, unit in zip(names, units, strict=False)]
            cells = cells._replace(header=cells.header._replace(cells=names), rows=cells.rows[1:])
        return cells

    def _found(self, cells: Cells) -> dict[str, _Place]:
        """Return the place and unit of each column."""
        headings: dict[str, list[tuple[int, Heading]]] = {}
        taken = self._chosen(cells)
        for place, cell in enumerate(cells.header.cells):
            heading = taken.get(place) or (self._names.heading(cell) if cell else None)
            if heading is not None and (place in taken
                                        or heading.name not in self._reading.columns):
                headings.setdefault(heading.name, []).append((place, heading))
        found: dict[str, _Place] = {}
        for name, candidates in headings.items():
            best = min(heading.rank for _, heading in candidates)
            places = [(place, heading) for place, heading in candidates if heading.rank == best]
            if len(places) > 1:
                raise BagError(f'{self._where}: column {name}: is there twice: --columns '
                               f'{name}=HEADING selects one')
            place, heading = places[0]
            quantity = self._names.quantity[name]
            factor = si_factor(quantity, heading.unit)
            if factor is None:
                raise BagError(f'{self._where}: column {name}: unit {shown_name(heading.unit)}: '
                               f'{unit_rule(quantity)}')
            if not heading.unit:
                factor = self._units.get(quantity.columns, 1.0)
            found[name] = _Place(place, factor, bool(heading.unit))
        used = {each.place for each in found.values()}
        others = [cell for place, cell in enumerate(cells.header.cells)
                  if cell and place not in used]
        if 'x' in found:
            self._check_unread(found, others, 'the rotation', ROTATIONS, _OF_ROTATION)
        elif 'ax' in found and 'x' not in self._names.quantity:
            self._check_unread(found, others, 'the angular velocity', (ANGULAR_VELOCITY,),
                               _OF_TURNING)
        if others:
            more = f' and {len(others) - _LISTED} more' if len(others) > _LISTED else ''
            self.notices.append('columns that are not read: '
                                f'{", ".join(map(shown_name, others[:_LISTED]))}{more}')
        return found

    @property
    def _where(self) -> str:
        return f'{self.path}: row {self._header.line}'

    def _chosen(self, cells: Cells) -> dict[int, Heading]:
        """Return the columns that the options name, by their places."""
        found: dict[int, Heading] = {}
        for name, wanted in self._reading.columns.items():
            if name not in self._names.quantity:
                raise BagError(f'--columns: {shown_name(name)}: must be one of '
                               f'{", ".join(self._names.quantity)}')
            short, unit = split(wanted)
            places = [n for n, cell in enumerate(cells.header.cells) if cell == wanted] or [
                n for n, cell in enumerate(cells.header.cells)
                if cell and short in (cell, split(cell)[0])]
            if len(places) != 1 or places[0] in found:
                why = ('is there several times' if len(places) > 1 else
                       'is selected twice' if places else
                       f'is not there; row {cells.header.line} has '
                       f'{shown_name(", ".join(filter(None, cells.header.cells)))}')
                raise BagError(f'{self.path}: --columns: {name}={shown_name(wanted)}: {why}')
            heading = self._names.heading(cells.header.cells[places[0]])
            own = unit or split(cells.header.cells[places[0]])[1] or (
                heading.unit if heading else '')
            found[places[0]] = Heading(name, own, 0)
        return found

    def _check_unread(self, found: Mapping[str, _Place], others: list[str], kind: str,
                      quantities: Iterable[Quantity], parts: tuple[str, ...]) -> None:
        """Raise BagError if no column of quantities is read, but others may be theirs."""
        wanted = [name for quantity in quantities for name in quantity.columns
                  if name in self._names.quantity]
        likely = [cell for cell in others if any(part in cell.lower() for part in parts)]
        if wanted and likely and not set(wanted) & set(found):
            name = 'roll' if 'roll' in wanted else wanted[0]
            raise BagError(
                f'{self._where}: has no columns of {kind} that are known, but '
                f'{", ".join(map(shown_name, likely[:_LISTED]))}: --columns selects them, as in '
                f'--columns {shlex.quote(f"{name}={shown_name(likely[0])}")}')

    @cached_property
    def _numbers(self) -> tuple[dict[str, Array], list[Row]]:
        """Return the numbers of each column in SI and the rows, without lost samples."""
        rows, places = self._table.rows, [each.place for each in self._places.values()]
        values = self._table.numbers(places) * np.array([
            each.factor for each in self._places.values()])
        lost = np.isnan(values)
        if 't' in self._places:
            n = list(self._places).index('t')
            for row in np.flatnonzero(lost[:, n])[:1]:
                raise BagError(f'{self.path}: row {rows[row].line}: t: empty: must be a '
                               'number')
        kept = ~lost.any(axis=1)
        if not kept.all():
            self.notices.append(f'{np.count_nonzero(~kept)} of {len(kept)} rows are left out: '
                                'lost samples, with empty cells')
        return (dict(zip(self._places, values[kept].T, strict=True)),
                [rows[n] for n in np.flatnonzero(kept)])

    @property
    def lines(self) -> list[int]:
        """Return the line of the file of each row (N,)."""
        return [row.line for row in self._numbers[1]]

    def _note_axes(self, export: Export) -> None:
        """Add a notice about axes and angles of the file of a tracker."""
        texts = []
        if export.axes and self._reading.axes is None:
            texts.append(f'y is up: x, y, z of the base frame are {export.axes} of the file; '
                         'others by --axes')
        if self.has(ROTATION_VECTOR):
            texts.append('RX, RY, RZ are read as a rotation vector; with --euler as angles')
        if self.has(ANGLES):
            texts.append(f'angles in the order {self._reading.euler or export.euler}; another '
                         'one by --euler')
        self.notices.append(': '.join([f'file of {export.tracker}', '; '.join(texts)])
                            if texts else f'file of {export.tracker}')

    def has(self, quantity: Quantity) -> bool:
        """Return whether the file has a column of a quantity."""
        return any(name in self._places for name in quantity.columns)

    def values(self, quantity: Quantity, complete: bool = True) -> Array:
        """Return the numbers (N, n) of a quantity in SI; missing columns are zero, or an error."""
        there = [name for name in quantity.columns if name in self._places]
        missing = [name for name in quantity.columns if name not in self._places]
        if missing and complete:
            if there:
                raise BagError(f'{self._where}: has column {", ".join(there)} but not '
                               f'{", ".join(missing)}; it has {shown_name(self.headings)}')
            raise BagError(f'{self._where}: has no column {", ".join(missing)}; it has '
                           f'{shown_name(self.headings)}')
        numbers, rows = self._numbers
        found = np.zeros((len(rows), len(quantity.columns)))
        for name in there:
            found[:, quantity.columns.index(name)] = numbers[name]
        return found

    @property
    def header_line(self) -> int:
        """Return the line of the file that names the columns."""
        return self._header.line

    @property
    def headings(self) -> str:
        """Return the names of the columns in the file."""
        return ', '.join(filter(None, self._header.cells))

    def times(self) -> Array:
        """Return the (N,) times [s], strictly increasing."""
        times = self.values(TIME)[:, 0]
        for n in np.flatnonzero(np.diff(times) <= 0.0)[:1] + 1:
            raise self.error(int(n), 't', 'must be more than that of the row before')
        if len(times) < 2:
            raise BagError(f'{self.path}: {len(times)} rows of numbers: must be at least 2')
        step = float(np.median(np.diff(times)))
        if step >= _SLOW and len(times) >= _SEVERAL and not self._places['t'].has_unit:
            self.notices.append(f'rows are {step:g} s apart, as t has no unit: in ms? '
                                f'{self._with_unit(("t",), "ms")} reads milliseconds')
        return times

    def error(self, row: int, name: str, rule: str) -> BagError:
        """Return the error that a number breaks a rule."""
        line, cells = self._numbers[1][row]
        return BagError(f'{self.path}: row {line}: {name}: '
                        f'{shown_name(cells[self._places[name].place].strip())}: {rule}')

    def rotations(self) -> Rotations | None:
        """Return the rotations in the axes of the file; None if it has no columns of them."""
        given = [quantity for quantity in ROTATIONS if self.has(quantity)]
        if len(given) > 1:
            raise BagError(f'{self._where}: has columns {given[0].columns[0]} and '
                           f'{given[1].columns[0]}: the rotation must be given once')
        if not given:
            return None
        quantity, values = given[0], self.values(given[0])
        if quantity is QUATERNION:
            lengths = np.linalg.norm(values, axis=1)
            for n in np.flatnonzero(~is_unit(lengths))[:1]:
                raise BagError(f'{self.path}: row {self.lines[n]}: qx, qy, qz, qw: '
                               f'{quaternion_rule(lengths[n])}')
            return Rotations(values)
        if quantity is MATRIX:
            return Rotations(self._of_matrices(values.reshape(-1, 3, 3)))
        order = self._reading.euler or (self._export.euler if self._export else None) or (
            'XYZ' if quantity is U_V_W else 'xyz')
        unknown = not any(self._places[name].has_unit for name in quantity.columns)
        if quantity is ROTATION_VECTOR and self._reading.euler is None:
            return Rotations(to_quaternion(from_rotation_vector(values)))
        return Rotations(from_angles(values, order), values if unknown else None, order)

    @property
    def degrees(self) -> str:
        """Return the option by which the angles of the file are read in degrees."""
        return self._with_unit([name for quantity in (ANGLES, U_V_W) if self.has(quantity)
                                for name in quantity.columns], 'deg')

    def _with_unit(self, names: Iterable[str], unit: str) -> str:
        headings = {name: split(self._header.cells[self._places[name].place])[0]
                    for name in names}
        return '--columns ' + shlex.quote(','.join(
            f'{name}={heading} [{unit}]' for name, heading in headings.items()))

    def _of_matrices(self, matrices: Array) -> Array:
        left, sizes, right = np.linalg.svd(matrices)
        off = np.abs(sizes - 1.0).max(axis=1) + (np.linalg.det(matrices) < 0.0)
        for n in np.flatnonzero(off > QUATERNION_TOLERANCE)[:1]:
            raise BagError(f'{self.path}: row {self.lines[n]}: r11 .. r33: no rotation matrix')
        return to_quaternion(left @ right)

    @property
    def plain_axes(self) -> bool:
        """Return whether the axes of the file are those of the base frame."""
        return self._axes == AXES

    @property
    def _axes(self) -> str:
        return self._reading.axes or (self._export.axes if self._export else None) or AXES

    def in_base_axes(self, values: Array, kinds: str) -> Array:
        """Return numbers of the file's axes in those of the base frame, see ``turned``."""
        return turned(values, axes_matrix(self._axes), kinds)


def from_angles(angles: Array, order: str) -> Array:
    """
    Return the quaternions (N, 4) of angles about x, y and z (N, 3).

    order: one of EULER: of the rotations; capital letters about axes that turn along.
    """
    result = np.tile([0.0, 0.0, 0.0, 1.0], (len(angles), 1))
    for letter in order:
        axis = 'xyz'.index(letter.lower())
        one = np.zeros((len(angles), 4))
        one[:, axis], one[:, 3] = np.sin(0.5 * angles[:, axis]), np.cos(0.5 * angles[:, axis])
        result = quaternion_product(*((result, one) if order.isupper() else (one, result)))
    return result
