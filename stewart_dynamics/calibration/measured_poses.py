# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured legs and poses from a CSV file whose first line names the columns."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.bags.csv_table import read_table
from stewart_dynamics.errors import shown_name, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.parameters.tolerances import is_unit, unit_rule

# Minimum number of poses: one for each of the 7 unknowns of a leg, and one for the noise.
FEWEST = 8
POSITION = ('x', 'y', 'z')
QUATERNION = ('qx', 'qy', 'qz', 'qw')
ANGLES = ('alpha', 'beta', 'gamma')
# Largest size of a file [bytes], and number of its poses.
_LARGEST, _MOST = 64 << 20, 20_000


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
    table = read_table(path, {*joints, *POSITION, *QUATERNION, *ANGLES}.__contains__, _LARGEST)
    header = table.header
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
    if len(table.rows) > _MOST:
        raise StewartError(f'{path}: {len(table.rows)} poses: at most {_MOST}')
    names = tuple(f'row {line}' for line in table.lines)
    values = table.numbers([header.index(name) for name in wanted])
    unit = 1e-3 if millimeters else 1.0
    lengths, positions, turns = unit * values[:, :6], unit * values[:, 6:9], values[:, 9:]
    if rotation == ANGLES:
        return MeasuredPoses(lengths, Pose.from_euler(positions, turns, degrees=degrees), names,
                             turns)
    sizes = np.linalg.norm(turns, axis=1)
    for n in np.flatnonzero(~is_unit(sizes))[:1]:
        raise StewartError(f'{path}: {names[n]}: quaternion: {unit_rule(sizes[n])}')
    return MeasuredPoses(lengths, Pose.from_quaternion(positions, turns), names)


def poses_csv(joints: tuple[str, ...], lengths: Array, poses: Pose) -> str:
    """Return poses and leg positions as text that ``read_poses`` reads."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow([*joints, *POSITION, *QUATERNION])
    table.writerows(np.concatenate([lengths, poses.position, poses.quaternion], axis=1).tolist())
    return text.getvalue()
