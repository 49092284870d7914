# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The recorded motion of a vehicle: from a bag with sensor_msgs/Imu, or from a CSV file."""

from __future__ import annotations

from contextlib import closing
import csv
import io
import math
from pathlib import Path
import re
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND
from stewart_dynamics.bags.recording import Recording
from stewart_dynamics.cueing.motion_cueing import GRAVITY
from stewart_dynamics.errors import BagError, shown, shown_name, StewartError
from stewart_dynamics.messages import type_names
from stewart_dynamics.program import plain_digits
from stewart_dynamics.setpoints.inputs import SampleReader, VEHICLE
from stewart_dynamics.setpoints.rejections import Rejections
from stewart_dynamics.whole_file import read_text

FORCES, RATES = ('ax', 'ay', 'az'), ('wx', 'wy', 'wz')
_UNITS = {
    't': {'s': 1.0, 'ms': 1e-3},
    'a': {'m/s^2': 1.0, 'm/s2': 1.0, 'g': GRAVITY},
    'w': {'rad/s': 1.0, 'deg/s': math.radians(1.0)}}
_COLUMN = re.compile(r'\s*(\w+)\s*(?:\[([^\[\]]*)\])?\s*')
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
    [rad/s]; other units are in brackets behind the names: g, deg/s, ms. StewartError for a file
    that cannot be read, or whose times are not strictly increasing.
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
    text = read_text(path, _LARGEST, StewartError).lstrip('\ufeff')
    try:
        lines = csv.reader(io.StringIO(text, newline=None), strict=True)
        rows = [(lines.line_num, row) for row in lines if any(map(str.strip, row))]
    except csv.Error as exc:
        raise StewartError(f'{path}: not a CSV file: {exc}') from exc
    if not rows:
        raise StewartError(f'{path}: is empty: row 1 must name the columns')
    columns = [_COLUMN.fullmatch(cell) for cell in rows[0][1]]
    names = [column[1] if column else '' for column in columns]
    turning = any(name in names for name in RATES)
    places, scales = [], []
    for name in ('t', *FORCES, *(RATES if turning else ())):
        if names.count(name) != 1:
            raise StewartError(
                f'{path}: row 1: {"more than one" if name in names else "no"} column {name}: '
                f'{shown_name(", ".join(rows[0][1]))}')
        place = names.index(name)
        column = columns[place]
        unit, units = column[2] if column else None, _UNITS[name[0]]
        if unit is not None and unit not in units:
            raise StewartError(f'{path}: column {name}: unit {shown(unit)}: must be one of '
                               f'{", ".join(units)}')
        places.append(place)
        scales.append(1.0 if unit is None else units[unit])
    values = np.zeros((len(rows) - 1, 7))
    for n, (line, row) in enumerate(rows[1:]):
        for k, place in enumerate(places):
            values[n, k] = _number(row, place, f'{path}: row {line}: {names[place]}')
    values[:, :len(scales)] *= scales
    times = values[:, 0]
    if (stuck := np.diff(times) <= 0.0).any():
        n = int(np.argmax(stuck))
        raise StewartError(f'{path}: row {rows[n + 2][0]}: t: {times[n + 1]:.9g} s: must be '
                           f'after {times[n]:.9g} s')
    return RecordedVehicle(times, values[:, 1:4], values[:, 4:])


def _number(row: list[str], place: int, where: str) -> float:
    cell = row[place] if place < len(row) else ''
    try:
        value = float(plain_digits(cell.strip()))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise StewartError(f'{where}: {shown(cell)}: must be a finite number')
    return value
