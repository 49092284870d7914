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
from stewart_dynamics.errors import ParameterError, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.tables.column_names import (
    ANGLES, leg_angles, leg_positions, POSITION, Quantity, QUATERNION, ROTATION_VECTOR, ROTATIONS,
    TIME, U_V_W)
from stewart_dynamics.tables.named_table import NamedTable
from stewart_dynamics.tables.reading import Reading

_MOST = 20_000  # poses of a file
_METER, _MILLIMETER = 'm', 1e-3
# Standard errors are 5 % too small with this share of copies.
_COPIES = 0.1
DEGREE = np.pi / 180.0


class MeasuredPoses(NamedTuple):
    """N measured poses."""

    positions: Array  # (N, 6), of the drives [m] or [rad]
    poses: Pose
    names: tuple[str, ...]  # of each pose, such as ``row 2``
    angles: Array | None = None
    """(N, 3) angles as they were read, if the poses were given by angles without a unit."""
    topics: tuple[str, str] | None = None  # of the legs and of the poses, if they are from a bag
    notices: tuple[str, ...] = ()

    @property
    def notices_of_repeats(self) -> list[str]:
        """Return the notice that many measurements repeat an earlier one, if they do."""
        rows = np.hstack([self.positions, self.poses.position, self.poses.quaternion])
        repeated = len(rows) - len(np.unique(rows, axis=0))
        if repeated <= _COPIES * len(rows):
            return []
        return [f'{repeated} of {len(rows)} measurements repeat an earlier one, number for '
                'number: as copies, or within the resolution of the device, they are not '
                'independent, and standard errors come out too small']


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


def read_poses(path: Path, parameters: Parameters, millimeters: Millimeters = METERS,
               degrees: bool = False, reading: Reading | None = None) -> MeasuredPoses:
    """
    Return the poses of a file with columns of the names of joints, x, y, z and a rotation.

    Units are those of the headings; without them m and rad, or ``millimeters`` and ``degrees``.

    Raises BagError if the file cannot be read, lacks a column, or has a value that is not a
    number.
    """
    legs, of_positions = drive_columns(parameters), millimeters.units[0]
    radian = DEGREE if degrees else 1.0
    table = NamedTable(path, (legs, TIME, POSITION, *ROTATIONS), reading, {
        legs.columns: drive_unit(parameters, millimeters, degrees),
        POSITION.columns: of_positions, **dict.fromkeys(
            (ANGLES.columns, U_V_W.columns, ROTATION_VECTOR.columns), radian)})
    drives, positions, rotations = (
        table.values(legs), table.values(POSITION), table.rotations())
    if len(drives) > _MOST:
        raise StewartError(f'{path}: {len(drives)} poses: at most {_MOST}')
    if rotations is None:
        raise StewartError(f'{path}: row {table.header_line}: has no column qx, qy, qz, qw (or '
                           f'roll, pitch, yaw); it has {table.headings}')
    pose = table.in_base_axes(np.hstack([positions, rotations.quaternions]), 'vq')
    plain = rotations.order == 'xyz' and table.plain_axes and rotations.angles is not None
    return MeasuredPoses(
        drives, Pose.from_quaternion(pose[:, :3], pose[:, 3:]),
        tuple(f'row {line}' for line in table.lines),
        rotations.angles / radian if plain and rotations.angles is not None else None,
        notices=tuple(table.notices))


def drive_columns(parameters: Parameters) -> Quantity:
    """Return the columns of the positions of the drives, with their units."""
    turn = parameters.leg_kind.position.unit != _METER
    return leg_angles(parameters.joints) if turn else leg_positions(parameters.joints)


def drive_unit(parameters: Parameters, millimeters: Millimeters, degrees: bool) -> float:
    """
    Return the unit of positions of drives whose headings lack it, [m] or [rad].

    ParameterError if lengths of legs were asked for, where drives turn.
    """
    if parameters.leg_kind.position.unit == _METER:
        return millimeters.units[1]
    if millimeters.legs and not millimeters.positions:
        raise ParameterError(f'{millimeters.option}: {parameters.source}: positions of the legs '
                             'are angles: --degrees reads them in degrees')
    return DEGREE if degrees else 1.0


def poses_csv(joints: tuple[str, ...], positions: Array, poses: Pose) -> str:
    """Return poses and positions of drives as text that ``read_poses`` reads."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow([*joints, *POSITION.columns, *QUATERNION.columns])
    table.writerows(np.concatenate([positions, poses.position, poses.quaternion], axis=1).tolist())
    return text.getvalue()
