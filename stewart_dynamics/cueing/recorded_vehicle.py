# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The recorded motion of a vehicle: from a bag with sensor_msgs/Imu, or from a CSV file."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND
from stewart_dynamics.bags.feed import read_all, Subscription
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.errors import BagError, StewartError
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.setpoints.input_messages import SampleReader, VEHICLE
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.tables.column_names import ACCELERATION, ANGULAR_VELOCITY, TIME
from stewart_dynamics.tables.named_table import NamedTable
from stewart_dynamics.tables.reading import is_table, Reading
from stewart_dynamics.tables.source_axes import axes_matrix, turned

# A motion between samples farther apart is not known, and takes long to compute [s, Hz].
_LONGEST_GAP, _LEAST_RATE = 10.0, 1.0


class RecordedVehicle(NamedTuple):
    """The motion of a vehicle at N times."""

    times: Array  # (N,), from 0 [s]
    forces: Array  # (N, 3) [m/s^2]
    rates: Array  # (N, 3) [rad/s]
    notices: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()  # parts of a bag that could not be read


def read_vehicle(path: Path, topic: str | None, reading: Reading | None = None,
                 ) -> RecordedVehicle:
    """
    Return the motion of a vehicle that was recorded.

    A table has columns t, ax, ay, az and, if the vehicle turns, wx, wy, wz, see ``NamedTable``.

    reading: axes and names of columns.

    Raises StewartError for a file that cannot be read, or whose times are not strictly
    increasing, or too far apart.
    """
    reading = reading or Reading()
    found = _read_table(path, reading) if is_table(path) else _read_bag(path, topic, reading)
    if len(found.times) < 2:
        raise StewartError(f'{path}: {len(found.times)} samples: must be at least 2')
    gaps = np.diff(found.times)
    if (longest := float(gaps.max())) > _LONGEST_GAP:
        raise StewartError(
            f'{path}: {longest:.4g} s without a sample, '
            f'{found.times[np.argmax(gaps > _LONGEST_GAP)] - found.times[0]:.9g} s after '
            f'the first one: must be at most {_LONGEST_GAP:g} s: record each drive by itself')
    rate = len(gaps) / float(gaps.sum())
    if rate < _LEAST_RATE:
        raise StewartError(f'{path}: {rate:.2g} samples a second: must be at least '
                           f'{_LEAST_RATE:g}, better 60')
    return found._replace(times=found.times - found.times[0])


def _read_bag(path: Path, given: str | None, reading: Reading) -> RecordedVehicle:
    said: list[str] = []
    rejections = Rejections(
        lambda rejection, details: said.append(rejection.words(details)))
    reader = SampleReader(VEHICLE, None, rejections)
    stamps: list[int] = []
    values: list[list[float]] = []
    with closing(Recording(path)) as recording:
        topic = recording.find_topic(
            type_names.IMU, given, f'/stewart_cueing/{VEHICLE}', '--vehicle')

        def add(messages: Messages) -> None:
            samples = reader.read_samples(messages)
            received = messages.times[samples.places]
            for stamp, time, row in zip(samples.stamps.tolist(), received.tolist(),
                                        samples.values.tolist(), strict=True):
                at = stamp or time
                if stamps and at <= stamps[-1]:
                    rejections.reject(VEHICLE, 'not strictly increasing', f'stamp {at} ns')
                    continue
                stamps.append(at)
                values.append(row)

        read_all(recording, [Subscription({topic: VEHICLE}, add)])
        missing = tuple(recording.missing)
    if not stamps:
        raise BagError(f'{path}: {topic}: no valid message' + (
            f': {said[0]}' if said else ''))
    # Angular velocity first, as in the message.
    array = turned(np.array(values), axes_matrix(reading.axes_of_bag), 'av')
    notices = tuple(f'{each.counted(count).words("")}' for each, count in
                    rejections.counts.items())
    return RecordedVehicle((np.array(stamps) - stamps[0]) * NANOSECOND, array[:, 3:],
                           array[:, :3], notices, missing)


def _read_table(path: Path, reading: Reading) -> RecordedVehicle:
    table = NamedTable(path, (TIME, ACCELERATION, ANGULAR_VELOCITY), reading)
    turning = table.has(ANGULAR_VELOCITY)
    values = table.in_base_axes(np.hstack([
        table.values(ACCELERATION), table.values(ANGULAR_VELOCITY, complete=turning)]), 'va')
    return RecordedVehicle(
        table.times(), values[:, :3], values[:, 3:], tuple(table.notices))
