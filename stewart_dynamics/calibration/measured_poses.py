# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured legs and poses from a CSV file whose first line names the columns."""

from __future__ import annotations

from collections.abc import Sequence
import csv
import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import shown, shown_name, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.parameters.tolerances import is_unit, unit_rule
from stewart_dynamics.program import plain_digits
from stewart_dynamics.whole_file import read_text

# Minimum number of poses: one for each of the 7 unknowns of a leg, and one for the noise.
FEWEST = 8
POSITION = ('x', 'y', 'z')
QUATERNION = ('qx', 'qy', 'qz', 'qw')
ANGLES = ('alpha', 'beta', 'gamma')
# Largest size of a file [bytes], and number of its poses.
_LARGEST, _MOST = 64 << 20, 20_000
# Squares of larger numbers, and their squares, would overflow.
_END = 1e30
_SEPARATORS = (',', ';', '\t')


class MeasuredPoses(NamedTuple):
    """N measured poses."""

    lengths: Array  # (N, 6) positions of the legs [m]
    poses: Pose
    names: tuple[str, ...]  # of each pose, such as ``row 2``
    angles: Array | None = None
    """(N, 3) angles as they were read, if the poses were given by angles."""
    topics: tuple[str, str] | None = None  # of the legs and of the poses, if they are from a bag
    notices: tuple[str, ...] = ()


def read_poses(path: Path, joints: tuple[str, ...], millimeters: bool = False,
               degrees: bool = False) -> MeasuredPoses:
    """
    Return the poses of a file with the columns of ``joints``, x, y, z and the rotation.

    Row 1 has the names of the columns, separated by commas, semicolons or tabs; others than the
    names of the legs, ``joints``, and those of the pose are ignored. Beside semicolons and tabs
    numbers may have decimal commas, then all of them. The rotation is a quaternion,
    qx, qy, qz, qw, or the angles alpha, beta, gamma of Rz(gamma) Ry(beta) Rx(alpha). Units are m
    and rad, or ``millimeters`` and ``degrees``. StewartError if the file cannot be read, lacks a
    column, or has a value that is not a number.
    """
    text = read_text(path, _LARGEST, StewartError).lstrip('\ufeff')
    # The separator is the one by which the first row names the most columns: headers of ignored
    # columns can contain the others.
    separator = max(_SEPARATORS, key=lambda each: len(
        {*joints, *POSITION, *QUATERNION, *ANGLES} & set(_first_row(text, each))))
    try:
        reader = csv.reader(_lines(text), delimiter=separator, strict=True)
        numbered = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as exc:
        raise StewartError(f'{path}: not a CSV file: {exc}') from exc
    if not numbered:
        raise StewartError(f'{path}: is empty: row 1 must name the columns')
    (_, first_row), *numbered = numbered
    header = [cell.strip() for cell in first_row]
    rotation = max((QUATERNION, ANGLES), key=lambda names: bool(set(names) & set(header)))
    wanted = (*joints, *POSITION, *rotation)
    missing = [name for name in wanted if name not in header]
    if missing:
        other = f' (or {", ".join(ANGLES)})' if missing[-4:] == list(QUATERNION) else ''
        raise StewartError(f'{path}: has no column {shown_name(", ".join(missing))}{other}; row 1 '
                           f'has {shown_name(", ".join(header))}')
    double = [name for name in wanted if header.count(name) > 1]
    if double:
        raise StewartError(f'{path}: column {double[0]}: is there {header.count(double[0])} times')
    if len(numbered) > _MOST:
        raise StewartError(f'{path}: {len(numbered)} poses: at most {_MOST}')
    places = [header.index(name) for name in wanted]
    names = tuple(f'row {line}' for line, _ in numbered)
    values = np.empty((len(names), len(wanted)))
    mark = _decimal_mark(separator, [row[place] for _, row in numbered for place in places
                                     if place < len(row)])
    for n, (_, row) in enumerate(numbered):
        if len(row) != len(header):
            raise StewartError(f'{path}: {names[n]}: has {len(row)} cells, row 1 has '
                               f'{len(header)}' + (
                                   ': decimal commas need semicolons between the columns'
                                   if separator == ',' and len(row) > len(header) else ''))
        for column, place in enumerate(places):
            values[n, column] = _number(
                row[place], f'{path}: {names[n]}: {shown_name(header[place])}', mark)
    unit = 1e-3 if millimeters else 1.0
    lengths, positions, turns = unit * values[:, :6], unit * values[:, 6:9], values[:, 9:]
    if rotation == ANGLES:
        return MeasuredPoses(lengths, Pose.from_euler(positions, turns, degrees=degrees), names,
                             turns)
    sizes = np.linalg.norm(turns, axis=1)
    for n in np.flatnonzero(~is_unit(sizes))[:1]:
        raise StewartError(f'{path}: {names[n]}: quaternion: {unit_rule(sizes[n])}')
    return MeasuredPoses(lengths, Pose.from_quaternion(positions, turns), names)


def _lines(text: str) -> io.StringIO:
    """Return the lines of a text, which can end in any way."""
    return io.StringIO(text, newline=None)


def _first_row(text: str, separator: str) -> list[str]:
    try:
        rows = csv.reader(_lines(text), delimiter=separator, strict=True)
        return next(([cell.strip() for cell in row] for row in rows
                     if any(map(str.strip, row))), [])
    except csv.Error:
        return []


def _decimal_mark(separator: str, cells: Sequence[str]) -> str:
    """Return the decimal mark: a comma beside other separators, if no cell has a point."""
    commas = separator != ',' and any(',' in cell for cell in cells)
    return ',' if commas and not any('.' in cell for cell in cells) else '.'


def _number(cell: str, where: str, mark: str) -> float:
    try:
        value = float(plain_digits(cell.strip().replace(mark, '.')))
    except ValueError:
        value = math.nan
    if not abs(value) < _END:
        raise StewartError(f'{where}: {shown(cell)}: must be a finite number below {_END:g}, with '
                           f'a decimal {"comma" if mark == "," else "point"} and digits 0 to 9')
    return value


def poses_csv(joints: tuple[str, ...], lengths: Array, poses: Pose) -> str:
    """Return poses and leg positions as text that ``read_poses`` reads."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow([*joints, *POSITION, *QUATERNION])
    table.writerows(np.concatenate([lengths, poses.position, poses.quaternion], axis=1).tolist())
    return text.getvalue()
