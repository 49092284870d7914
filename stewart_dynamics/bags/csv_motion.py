# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Motions in tables, read as recorded setpoints.

The columns are those of ``tables.column_names``. A file that has only accelerations, as the record
of an earthquake, is integrated from the home pose, see ``baseline``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Stamps
from stewart_dynamics.bags.baseline import gap_of, integrated
from stewart_dynamics.errors import BagError, shown_name
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.kinematics.pose_errors import Angles, PoseByAngles
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.parameters.tolerances import STAMPS_END
from stewart_dynamics.program import NODE
from stewart_dynamics.tables.column_names import (
    ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, MOTION, POSITION, ROTATIONS, VELOCITY)
from stewart_dynamics.tables.named_table import from_angles, NamedTable, Rotations
from stewart_dynamics.tables.reading import Reading

# Rows whose messages are made at once.
_AT_ONCE = 8192
# Poses that are checked for angles in degrees.
_TURNS = 20


class CsvMotion:
    """
    The setpoints of a table, as a source of recorded messages.

    path: of the file.
    reading: names of columns, order of angles and axes of the file.
    home: returns the position [m] from which accelerations alone are integrated.

    Raises BagError, with file, row, column, value and rule, if the file breaks one.

    begin: time that the file gives its first sample [s].
    unknown_angles: poses of the file by angles without a unit; empty if the unit is known.
    """

    def __init__(self, path: Path, reading: Reading, home: Callable[[], Array] | None) -> None:
        self.missing: list[str] = []
        self.unchecked = False
        self.unknown_angles: tuple[PoseByAngles, ...] = ()
        self._path = path
        self._table = NamedTable(path, MOTION, reading)
        self.notices = self._table.notices
        self.stamps = self._stamps(self._table)
        self._values = self._read(self._table, home)

    @property
    def poses(self) -> Array:
        """Return position and rotation of each pose (N, 12)."""
        found = Pose.from_quaternion(*np.split(self._values['pose'], [3], axis=1))
        return np.hstack([found.position, found.rotation.reshape(-1, 9)])

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

    def _stamps(self, table: NamedTable) -> Stamps:
        times = table.times()
        self.begin = float(times[0])
        if times[0] <= 0.0:  # a stamp of zero means: not known
            times = times - times[0] + 1.0
        if times.max() * SECOND >= STAMPS_END:
            raise table.error(int(times.argmax()), 't',
                              f'must be below {STAMPS_END * NANOSECOND:.10g} s')
        stamps: Stamps = np.rint(times * SECOND).astype(np.int64)
        for n in np.flatnonzero(np.diff(stamps) <= 0)[:1] + 1:
            raise table.error(int(n), 't', 'must be more than that of the row before')
        return stamps

    def _read(self, table: NamedTable, home: Callable[[], Array] | None) -> dict[str, Array]:
        """Return the numbers of each topic, in SI and the base's axes."""
        if not table.has(POSITION):
            if table.has(ACCELERATION) and not any(
                    table.has(each) for each in (*ROTATIONS, VELOCITY, ANGULAR_VELOCITY)):
                return self._integrated(table, home)
            raise BagError(f'{self._path}: row {table.header_line}: has no columns x, y, z; it '
                           f'has {shown_name(table.headings)}')
        position, rotations = table.values(POSITION), table.rotations()
        if rotations is None:
            self.notices.append('no columns of the rotation: the platform stays level')
        found = {'pose': np.hstack([position, _level(len(position)) if rotations is None
                                    else rotations.quaternions])}
        for name, linear, angular in (('twist', VELOCITY, ANGULAR_VELOCITY),
                                      ('accel', ACCELERATION, ANGULAR_ACCELERATION)):
            if table.has(linear) or table.has(angular):
                found[name] = np.hstack([table.values(linear), table.values(
                    angular, complete=rotations is not None)])
        if rotations is not None and rotations.angles is not None:
            self.unknown_angles = tuple(_largest_turns(table, position, rotations))
        return _in_base_axes(table, found)

    def _integrated(self, table: NamedTable, home: Callable[[], Array] | None) -> dict[str, Array]:
        accelerations = np.hstack([table.values(ACCELERATION, complete=False),
                                   table.values(ANGULAR_ACCELERATION, complete=False)])
        if accelerations[:, 3:].any():
            raise BagError(f'{self._path}: row {table.header_line}: has columns alx, aly, alz and '
                           'no rotation: angular accelerations alone are not integrated')
        if home is None:
            raise BagError(f'{self._path}: has only accelerations: they are integrated from the '
                           'home pose, which needs the parameters of the hexapod')
        times = (self.stamps - self.stamps[0]) * NANOSECOND
        motion = integrated(times, accelerations[:, :3])
        gap = gap_of(times, motion.accelerations, motion.velocities)
        if gap is not None:
            usual = float(np.median(np.diff(times)))
            raise table.error(gap, 't', (
                f'{times[gap] - times[gap - 1]:.4g} s after the row before, usual are {usual:.4g} '
                's: accelerations alone are not integrated over a gap, all later positions would '
                'be wrong: cut the record there'))
        still = np.zeros_like(motion.positions)
        self.notices.append(motion.words())
        found = _in_base_axes(table, {
            'pose': np.hstack([motion.positions, _level(len(still))]),
            'twist': np.hstack([motion.velocities, still]),
            'accel': np.hstack([motion.accelerations, still])})
        found['pose'][:, :3] += home()
        return found


def _largest_turns(table: NamedTable, position: Array, rotations: Rotations,
                   ) -> Iterator[PoseByAngles]:
    """Yield some poses by angles, of those whose largest angle is above half of the largest."""
    assert rotations.angles is not None
    largest = np.abs(rotations.angles).max(axis=1)
    which = np.flatnonzero(largest >= 0.5 * largest.max())
    for n in np.unique([largest.argmax(), *which[
            np.linspace(0, len(which) - 1, _TURNS).astype(int)]]):
        poses = table.in_base_axes(np.array([
            [*position[n], *quaternion] for quaternion in from_angles(
                rotations.angles[n] * np.array([[1.0], [0.5], [np.pi / 180.0]]),
                rotations.order)]), 'vq')
        turned = Pose.from_quaternion(poses[:, :3], poses[:, 3:]).rotation
        yield PoseByAngles(
            np.append(poses[0, :3], turned[0]),
            Angles(float(largest[n]), turned[1], turned[2]), table.degrees)


def _level(count: int) -> Array:
    return np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def _in_base_axes(table: NamedTable, found: dict[str, Array]) -> dict[str, Array]:
    return {name: table.in_base_axes(values, 'vq' if name == 'pose' else 'va')
            for name, values in found.items()}
