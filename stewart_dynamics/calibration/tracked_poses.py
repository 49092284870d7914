# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Poses that a device measured into a file of its own, joined with the legs of another one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration.measured_poses import (
    drive_columns, drive_unit, MeasuredPoses, Millimeters)
from stewart_dynamics.calibration.rests import find_rests, mean_pose, SETTLING, SHORTEST
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.tables.column_names import POSITION, ROTATIONS, TIME
from stewart_dynamics.tables.named_table import NamedTable
from stewart_dynamics.tables.reading import Reading

# A device sees the platform at rest while no coordinate changes by more than this part of the
# characteristic length.
_STILL = 2e-3


def read_tracked(path: Path, tracked: Path, parameters: Parameters, millimeters: Millimeters,
                 reading: Reading, degrees: bool = False) -> MeasuredPoses:
    """
    Return the legs of a table, one pose in each row, with the poses of the file of a device.

    The file has one row for each pose, or all of the time: then the means while the platform was
    at rest are the poses, in the order of the rows. A first rest more is at home, where designed
    poses begin.

    path: of the legs. tracked: of the poses. reading: of the poses; names of legs are of the legs.
    degrees: angles of drives without a unit are in degrees.

    Raises StewartError: a file cannot be read, or the numbers of rests and rows differ.
    """
    legs, of_positions = drive_columns(parameters), millimeters.units[0]
    own = {name: text for name, text in reading.columns.items() if name in parameters.joints}
    table = NamedTable(path, (legs,), Reading(columns=own), {
        legs.columns: drive_unit(parameters, millimeters, degrees)})
    positions = table.values(legs)
    poses = NamedTable(tracked, (TIME, POSITION, *ROTATIONS), reading._replace(columns={
        name: text for name, text in reading.columns.items() if name not in own}), {
            POSITION.columns: of_positions})
    rotations = poses.rotations()
    if rotations is None:
        raise BagError(f'{tracked}: row {poses.header_line}: has no columns of the rotation; it '
                       f'has {poses.headings}')
    rows = poses.in_base_axes(np.hstack([poses.values(POSITION), rotations.quaternions]), 'vq')
    names = [f'row {line}' for line in table.lines]
    if len(rows) != len(positions):
        times = poses.times()
        size = parameters.singularity.characteristic_length
        rests = list(_parts(times, rows, _STILL * size))
        extra = len(rests) - len(positions)
        if extra not in (0, 1):
            raise StewartError(
                f'{tracked}: the platform is at rest {len(rests)} times for {SHORTEST:g} s or '
                f'more, {path} has {len(positions)} rows: they must be equal, or one rest more, '
                'at home before the first pose')
        rows = np.array([mean_pose(rows[rest]) for rest in rests[extra:]])
        names = [f'{name}, t = {times[rest.start]:.1f} s'
                 for name, rest in zip(names, rests[extra:], strict=True)]
    return MeasuredPoses(
        positions, Pose.from_quaternion(rows[:, :3], rows[:, 3:]), tuple(names),
        topics=(str(path), str(tracked)), notices=tuple(poses.notices))


def _parts(times: Array, rows: Array, tolerance: float) -> Iterator[slice]:
    """Yield the samples of each time at rest, without the margins in which it settles."""
    size = tolerance / _STILL
    signs = np.sign(np.sum(rows[:, 3:] * rows[:1, 3:], axis=1))[:, None]
    values = np.hstack([rows[:, :3], size * (signs * rows[:, 3:])])
    for first, last in find_rests(times, values, tolerance):
        margin = SETTLING * (times[last] - times[first])
        begin, end = np.searchsorted(times, [times[first] + margin, times[last] - margin])
        yield slice(int(begin), max(int(end), int(begin) + 1))
