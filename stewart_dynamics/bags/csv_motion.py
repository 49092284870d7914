# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motions in CSV files with named columns, read as recorded setpoints.

Names of the columns, with the unit in brackets where it is not SI (``x [mm]``): ``t``; ``x y z``;
``qx qy qz qw``, or ``roll pitch yaw`` or ``u v w``; ``vx vy vz``; ``wx wy wz``; ``ax ay az``;
``alx aly alz``. Other columns are ignored. A file that has only accelerations, as the record of an
earthquake, is integrated from the home pose, see ``baseline``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
import re
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps, STAMPS_END
from stewart_dynamics.bags.baseline import gap_of, integrated
from stewart_dynamics.bags.csv_table import read_table, Table
from stewart_dynamics.bags.reading import Reading
from stewart_dynamics.bags.source_axes import axes_matrix, turned
from stewart_dynamics.errors import BagError, shown_name, StewartError
from stewart_dynamics.mechanics.frames.rotation import quaternion_product
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.parameters.tolerances import is_unit, unit_rule
from stewart_dynamics.program import NODE

# Largest size of a file [bytes].
_LARGEST = 1 << 28
# Rows whose messages are made at once.
_AT_ONCE = 8192

_LENGTHS = {'m': 1.0, 'mm': 1e-3, 'cm': 1e-2, 'km': 1e3, 'um': 1e-6, 'µm': 1e-6, 'μm': 1e-6,
            'in': 0.0254, 'ft': 0.3048}
_ANGLES = {'rad': 1.0, 'mrad': 1e-3, 'urad': 1e-6, 'µrad': 1e-6, 'μrad': 1e-6,
           'deg': np.pi / 180.0, '°': np.pi / 180.0, 'arcmin': np.pi / 10800.0,
           'arcsec': np.pi / 648000.0}
_TIMES = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'μs': 1e-6, 'ns': 1e-9, 'min': 60.0}
# Different spellings of m/s^2 become one.
_PLAIN = str.maketrans({' ': '', '^': '', '*': '', '²': '2'})
_ACCELERATIONS = {'g': 9.80665, 'mg': 9.80665e-3, 'gal': 1e-2}


class Group(NamedTuple):
    """Columns that belong together."""

    columns: tuple[str, ...]
    units: Mapping[str, float]  # in SI
    order: int = 0  # of the derivative by time


TIME = Group(('t',), _TIMES)
POSITION = Group(('x', 'y', 'z'), _LENGTHS)
QUATERNION = Group(('qx', 'qy', 'qz', 'qw'), {})
ROLL = Group(('roll', 'pitch', 'yaw'), _ANGLES)
U = Group(('u', 'v', 'w'), _ANGLES)
VELOCITY = Group(('vx', 'vy', 'vz'), _LENGTHS, 1)
ANGULAR_VELOCITY = Group(('wx', 'wy', 'wz'), _ANGLES, 1)
ACCELERATION = Group(('ax', 'ay', 'az'), _LENGTHS, 2)
ANGULAR_ACCELERATION = Group(('alx', 'aly', 'alz'), _ANGLES, 2)
_GROUPS = (TIME, POSITION, QUATERNION, ROLL, U, VELOCITY, ANGULAR_VELOCITY, ACCELERATION,
           ANGULAR_ACCELERATION)
_GROUP_OF = {name: group for group in _GROUPS for name in group.columns}
_HEADER = re.compile(r'(?P<name>[^\[\]]*?)\s*(\[\s*(?P<unit>[^\[\]]*?)\s*\])?')


def split(cell: str) -> tuple[str, str]:
    """Return name and unit of a column; an empty unit if it is not given."""
    found = _HEADER.fullmatch(cell.strip())
    if found is None:
        return cell, ''
    return found['name'].lower(), found['unit'] or ''


def _is_known(cell: str) -> bool:
    return split(cell)[0] in _GROUP_OF


def factor(group: Group, unit: str) -> float | None:
    """Return a unit in SI; None if the group does not have it."""
    if not unit:
        return 1.0
    if group.order == 0:
        return group.units.get(unit) or group.units.get(unit.lower())
    if group.order == 2 and group.units is _LENGTHS and unit.lower() in _ACCELERATIONS:
        return _ACCELERATIONS[unit.lower()]
    plain = unit.translate(_PLAIN).replace('/s/s', '/s2')
    plain = plain.replace('s-1', '/s').replace('s-2', '/s2').replace('//', '/')
    ending = {1: '/s', 2: '/s2'}[group.order]
    if not plain.endswith(ending):
        return None
    return group.units.get(plain.removesuffix(ending))


def columns_of(path: Path, header: Sequence[str], groups: Sequence[Group],
               ) -> dict[str, tuple[int, float]]:
    """
    Return place and unit in SI of each column of these groups, from row 1 of a file.

    Raises BagError: a column is there twice, or has a unit that is not one of its group.
    """
    group_of = {name: group for group in groups for name in group.columns}
    found: dict[str, tuple[int, float]] = {}
    for place, cell in enumerate(header):
        name, unit = split(cell)
        if name not in group_of:
            continue
        if name in found:
            raise BagError(f'{path}: row 1: column {name}: is there twice')
        si = factor(group_of[name], unit)
        if si is None:
            raise BagError(f'{path}: row 1: column {name}: unit {shown_name(unit)}: '
                           f'must be {_units(group_of[name])}')
        found[name] = place, si
    return found


class CsvMotion:
    """
    The setpoints of a CSV file, as a source of recorded messages.

    path: of the file.
    reading: order of angles and axes of the file.
    home: returns the position [m] from which accelerations alone are integrated.

    Raises BagError, with file, row, column, value and rule, if the file breaks one.
    """

    def __init__(self, path: Path, reading: Reading, home: Callable[[], Array] | None) -> None:
        self.missing: list[str] = []
        self.notices: list[str] = []
        self.unchecked = False
        self._path, self._reading = path, reading
        try:
            table = read_table(path, _is_known, _LARGEST)
            self._columns = self._found(table)
            self.stamps = self._stamps(table)
            self._values = self._read(table, home)
        except BagError:
            raise
        except StewartError as exc:
            raise BagError(f'{exc}') from exc

    @property
    def topics(self) -> dict[str, str]:
        """Return the type of each topic."""
        kinds = {'pose': type_names.POSE_STAMPED, 'twist': type_names.TWIST_STAMPED,
                 'accel': type_names.ACCEL_STAMPED}
        return {f'{NODE}/setpoint/{name}': kinds[name] for name in self._values}

    def blocks(self, keys: Mapping[str, str]) -> Iterator[tuple[Messages, int]]:
        """Yield the messages of these topics, see Source."""
        wanted = {key: values for name, values in self._values.items()
                  if (key := keys.get(f'{NODE}/setpoint/{name}'))}
        if not wanted:
            return
        layouts = [StampedWriter('', values.shape[1]).layout for values in wanted.values()]
        sizes = [layout.size for layout in layouts]
        per_row = self._path.stat().st_size // max(len(self.stamps), 1)
        for first in range(0, len(self.stamps), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            stamps = self.stamps[part]
            count = len(stamps)
            data = np.concatenate([
                layout.write(stamps, values[part]).view(np.uint8).reshape(count, -1)
                for layout, values in zip(layouts, wanted.values(), strict=True)], axis=1)
            starts = np.arange(count)[:, None] * sum(sizes) + np.cumsum([0, *sizes[:-1]])
            yield Messages(
                tuple(wanted), np.tile(np.arange(len(wanted)), count),
                np.repeat(stamps, len(wanted)), data.ravel(), starts.ravel(),
                np.tile(sizes, count)), per_row * count

    def close(self) -> None:
        """Close nothing: the file has been read."""

    def _found(self, table: Table) -> dict[str, tuple[int, float]]:
        """Return place and unit of each known column."""
        found = columns_of(self._path, table.header, _GROUPS)
        if 't' not in found:
            raise BagError(f'{self._path}: row 1: has no column t; it has '
                           f'{shown_name(", ".join(table.header))}')
        return found

    def _has(self, group: Group) -> bool:
        return any(name in self._columns for name in group.columns)

    def _group(self, table: Table, group: Group, complete: bool = True) -> Array:
        """Return the numbers (N, n) of a group in SI; missing columns are zero, or an error."""
        missing = [name for name in group.columns if name not in self._columns]
        if missing and complete:
            there = [name for name in group.columns if name in self._columns]
            raise BagError(f'{self._path}: row 1: has column {", ".join(there)} but not '
                           f'{", ".join(missing)}')
        values = np.zeros((len(table.rows), len(group.columns)))
        there = [name for name in group.columns if name in self._columns]
        numbers = table.numbers([self._columns[name][0] for name in there])
        for n, name in enumerate(there):
            values[:, group.columns.index(name)] = numbers[:, n] * self._columns[name][1]
        return values

    def _stamps(self, table: Table) -> Stamps:
        times = self._group(table, TIME)[:, 0]
        if len(times) < 2:
            raise BagError(f'{self._path}: {len(times)} rows of numbers: must be at least 2')
        if times[0] <= 0.0:  # a stamp of zero means: not known
            times = times - times[0] + 1.0
        if times.max() * SECOND >= STAMPS_END:
            n = int(times.argmax())
            raise self._at(table, n, 't', f'must be below {STAMPS_END * NANOSECOND:.10g} s')
        stamps: Stamps = np.rint(times * SECOND).astype(np.int64)
        for n in np.flatnonzero(np.diff(stamps) <= 0)[:1] + 1:
            raise self._at(table, int(n), 't', 'must be more than that of the row before')
        return stamps

    def _at(self, table: Table, row: int, name: str, rule: str) -> BagError:
        cell = table.rows[row][self._columns[name][0]].strip()
        return BagError(
            f'{self._path}: row {table.lines[row]}: {name}: {shown_name(cell)}: {rule}')

    def _read(self, table: Table, home: Callable[[], Array] | None) -> dict[str, Array]:
        """Return the numbers of each topic, in SI and the base's axes."""
        if not self._has(POSITION):
            poses = [group for group in (QUATERNION, ROLL, U, VELOCITY, ANGULAR_VELOCITY)
                     if self._has(group)]
            if self._has(ACCELERATION) and not poses:
                return self._integrated(table, home)
            raise BagError(f'{self._path}: row 1: has no columns x, y, z; it has '
                           f'{shown_name(", ".join(table.header))}')
        position, rotation = self._group(table, POSITION), self._rotation(table)
        found = {'pose': np.hstack([position, rotation])}
        turns = any(self._has(group) for group in (QUATERNION, ROLL, U))
        for name, linear, angular in (('twist', VELOCITY, ANGULAR_VELOCITY),
                                      ('accel', ACCELERATION, ANGULAR_ACCELERATION)):
            if self._has(linear) or self._has(angular):
                found[name] = np.hstack([self._group(table, linear),
                                         self._group(table, angular, complete=turns)])
        return self._in_base_axes(found)

    def _rotation(self, table: Table) -> Array:
        """Return quaternions x y z w (N, 4), in the file's axes."""
        given = [group for group in (QUATERNION, ROLL, U) if self._has(group)]
        if len(given) > 1:
            raise BagError(f'{self._path}: row 1: has columns {given[0].columns[0]} and '
                           f'{given[1].columns[0]}: the rotation must be given once')
        if not given:
            self.notices.append('no columns of the rotation: the platform stays level')
            return np.tile([0.0, 0.0, 0.0, 1.0], (len(table.rows), 1))
        values = self._group(table, given[0])
        if given[0] is QUATERNION:
            lengths = np.linalg.norm(values, axis=1)
            for n in np.flatnonzero(~is_unit(lengths))[:1]:
                raise BagError(f'{self._path}: row {table.lines[n]}: qx, qy, qz, qw: '
                               f'{unit_rule(lengths[n])}')
            return values
        order = self._reading.euler or ('XYZ' if given[0] is U else 'xyz')
        return from_angles(values, order)

    def _integrated(self, table: Table, home: Callable[[], Array] | None) -> dict[str, Array]:
        accelerations = np.hstack([self._group(table, ACCELERATION, complete=False),
                                   self._group(table, ANGULAR_ACCELERATION, complete=False)])
        if accelerations[:, 3:].any():
            raise BagError(f'{self._path}: row 1: has columns alx, aly, alz and no rotation: '
                           'angular accelerations alone are not integrated')
        if home is None:
            raise BagError(f'{self._path}: has only accelerations: they are integrated from the '
                           'home pose, which needs the parameters of the hexapod')
        times = (self.stamps - self.stamps[0]) * NANOSECOND
        motion = integrated(times, accelerations[:, :3])
        gap = gap_of(times, motion.accelerations, motion.velocities)
        if gap is not None:
            usual = float(np.median(np.diff(times)))
            raise self._at(table, gap, 't', (
                f'{times[gap] - times[gap - 1]:.4g} s after the row before, usual are {usual:.4g} '
                's: accelerations alone are not integrated over a gap, all later positions would '
                'be wrong: cut the record there'))
        still = np.zeros_like(motion.positions)
        self.notices.append(motion.words())
        level = np.tile([0.0, 0.0, 0.0, 1.0], (len(still), 1))
        found = self._in_base_axes({
            'pose': np.hstack([motion.positions, level]),
            'twist': np.hstack([motion.velocities, still]),
            'accel': np.hstack([motion.accelerations, still])})
        found['pose'][:, :3] += home()
        return found

    def _in_base_axes(self, found: dict[str, Array]) -> dict[str, Array]:
        matrix = axes_matrix(self._reading.axes)
        return {name: turned(values, matrix, 'vq' if name == 'pose' else 'va')
                for name, values in found.items()}


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


def _units(group: Group) -> str:
    if group is QUATERNION:
        return 'empty: it has none'
    names = [name for name in group.units if name.isascii()]
    ending = {0: '', 1: '/s', 2: '/s^2'}[group.order]
    others = list(_ACCELERATIONS) if group is ACCELERATION else []
    return 'one of ' + ', '.join([*(f'{name}{ending}' for name in names), *others])
