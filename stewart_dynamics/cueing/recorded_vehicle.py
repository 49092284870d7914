# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The recorded motion of a vehicle: from a bag with sensor_msgs/Imu, or from a CSV file."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND
from stewart_dynamics.bags.csv_motion import (
    ACCELERATION, ANGULAR_VELOCITY, columns_of, split, TIME)
from stewart_dynamics.bags.csv_table import read_table
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, shown_name, StewartError
from stewart_dynamics.messages import type_names
from stewart_dynamics.setpoints.input_messages import SampleReader, VEHICLE
from stewart_dynamics.setpoints.rejections import Rejections

_GROUPS = TIME, ACCELERATION, ANGULAR_VELOCITY
_COLUMNS = tuple(name for group in _GROUPS for name in group.columns)
_LARGEST = 1 << 30  # [bytes]


class RecordedVehicle(NamedTuple):
    """The motion of a vehicle at N times."""

    times: Array  # (N,), from 0 [s]
    forces: Array  # (N, 3) [m/s^2]
    rates: Array  # (N, 3) [rad/s]
    notices: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()  # parts of a bag that could not be read


def read_vehicle(path: Path, topic: str | None) -> RecordedVehicle:
    """
    Return the motion of a vehicle that was recorded.

    A CSV file has columns t [s], ax, ay, az [m/s^2] and, if the vehicle turns, wx, wy, wz
    [rad/s]; other units are in brackets behind the names, as in ``csv_motion``. StewartError for
    a file that cannot be read, or whose times are not strictly increasing.
    """
    found = _read_csv(path) if path.suffix.lower() == '.csv' else _read_bag(path, topic)
    if len(found.times) < 2:
        raise StewartError(f'{path}: {len(found.times)} samples: must be at least 2')
    return found._replace(times=found.times - found.times[0])


def _read_bag(path: Path, given: str | None) -> RecordedVehicle:
    said: list[str] = []
    rejections = Rejections(
        lambda rejection, details: said.append(rejection.words(details)))
    reader = SampleReader(VEHICLE, None, rejections)
    stamps: list[int] = []
    values: list[tuple[float, ...]] = []
    with closing(Recording(path)) as recording:
        topic = recording.find_topic(
            type_names.IMU, given, f'/stewart_cueing/{VEHICLE}', '--vehicle')
        for messages, _ in recording.messages({topic: VEHICLE}):
            for _, received, data in messages.each():
                sample = reader.read(data)
                if sample is None:
                    continue
                stamp = sample[0] or received
                if stamps and stamp <= stamps[-1]:
                    rejections.reject(VEHICLE, 'not strictly increasing', f'stamp {stamp} ns')
                    continue
                stamps.append(stamp)
                values.append(sample[1])
        missing = tuple(recording.missing)
    if not stamps:
        raise BagError(f'{path}: {topic}: no valid message' + (
            f': {said[0]}' if said else ''))
    array = np.array(values)
    notices = tuple(f'{each.counted(count).words("")}' for each, count in
                    rejections.counts.items())
    return RecordedVehicle((np.array(stamps) - stamps[0]) * NANOSECOND, array[:, 3:],
                           array[:, :3], notices, missing)


def _read_csv(path: Path) -> RecordedVehicle:
    table = read_table(path, lambda cell: split(cell)[0] in _COLUMNS, _LARGEST)
    columns = columns_of(path, table.header, _GROUPS)
    turning = any(name in columns for name in ANGULAR_VELOCITY.columns)
    names = _COLUMNS if turning else _COLUMNS[:4]
    for name in names:
        if name not in columns:
            raise StewartError(
                f'{path}: row 1: no column {name}: {shown_name(", ".join(table.header))}')
    places, scales = zip(*(columns[name] for name in names), strict=True)
    # a cell that is missing is named, as an empty one
    rows = [row + [''] * (len(table.header) - len(row)) for row in table.rows]
    values = np.zeros((len(rows), 7))
    values[:, :len(scales)] = table._replace(rows=rows).numbers(places) * scales
    times = values[:, 0]
    if (stuck := np.diff(times) <= 0.0).any():
        n = int(np.argmax(stuck))
        raise StewartError(f'{path}: row {table.lines[n + 1]}: t: {times[n + 1]:.9g} s: must be '
                           f'after {times[n]:.9g} s')
    return RecordedVehicle(times, values[:, 1:4], values[:, 4:])
