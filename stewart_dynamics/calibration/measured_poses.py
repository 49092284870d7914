# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Measured legs and poses from a table, one pose in each row."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.tables.column_names import (
    ANGLES, leg_positions, POSITION, QUATERNION, ROTATION_VECTOR, ROTATIONS, TIME, U_V_W)
from stewart_dynamics.tables.named_table import NamedTable
from stewart_dynamics.tables.reading import Reading

# Minimum number of poses: one for each of the 7 unknowns of a leg, and one for the noise.
FEWEST = 8
_MOST = 20_000  # poses of a file
_MILLIMETER, _DEGREE = 1e-3, np.pi / 180.0


class MeasuredPoses(NamedTuple):
    """N measured poses."""

    lengths: Array  # (N, 6) positions of the legs [m]
    poses: Pose
    names: tuple[str, ...]  # of each pose, such as ``row 2``
    angles: Array | None = None
    """(N, 3) angles as they were read, if the poses were given by angles without a unit."""
    topics: tuple[str, str] | None = None  # of the legs and of the poses, if they are from a bag
    notices: tuple[str, ...] = ()


class Millimeters(NamedTuple):
    """The numbers that are in mm, not in m, where no heading gives their unit."""

    positions: bool = False
    legs: bool = False

    @property
    def option(self) -> str:
        """Return the option of the program; empty if all are in m."""
        return {(True, True): '--mm', (True, False): '--mm-positions',
                (False, True): '--mm-legs'}.get(self, '')

    @property
    def units(self) -> tuple[float, float]:
        """Return the units of positions and of leg positions [m]."""
        return (_MILLIMETER if self.positions else 1.0, _MILLIMETER if self.legs else 1.0)


METERS = Millimeters()


def read_poses(path: Path, joints: tuple[str, ...], millimeters: Millimeters = METERS,
               degrees: bool = False, reading: Reading | None = None) -> MeasuredPoses:
    """
    Return the poses of a file with the columns of ``joints``, x, y, z and a rotation.

    Units are those of the headings; without them m and rad, or ``millimeters`` and ``degrees``.

    Raises BagError if the file cannot be read, lacks a column, or has a value that is not a
    number.
    """
    legs, (of_positions, of_legs) = leg_positions(joints), millimeters.units
    radian = _DEGREE if degrees else 1.0
    table = NamedTable(path, (legs, TIME, POSITION, *ROTATIONS), reading, {
        joints: of_legs, POSITION.columns: of_positions, **dict.fromkeys(
            (ANGLES.columns, U_V_W.columns, ROTATION_VECTOR.columns), radian)})
    lengths, positions, rotations = (
        table.values(legs), table.values(POSITION), table.rotations())
    if len(lengths) > _MOST:
        raise StewartError(f'{path}: {len(lengths)} poses: at most {_MOST}')
    if rotations is None:
        raise StewartError(f'{path}: row {table.header_line}: has no column qx, qy, qz, qw (or '
                           f'roll, pitch, yaw); it has {table.headings}')
    pose = table.in_base_axes(np.hstack([positions, rotations.quaternions]), 'vq')
    plain = rotations.order == 'xyz' and table.plain_axes and rotations.angles is not None
    return MeasuredPoses(
        lengths, Pose.from_quaternion(pose[:, :3], pose[:, 3:]),
        tuple(f'row {line}' for line in table.lines),
        rotations.angles / radian if plain and rotations.angles is not None else None,
        notices=tuple(table.notices))


def poses_csv(joints: tuple[str, ...], lengths: Array, poses: Pose) -> str:
    """Return poses and leg positions as text that ``read_poses`` reads."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow([*joints, *POSITION.columns, *QUATERNION.columns])
    table.writerows(np.concatenate([lengths, poses.position, poses.quaternion], axis=1).tolist())
    return text.getvalue()
