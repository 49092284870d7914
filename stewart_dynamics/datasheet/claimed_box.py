# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A claimed set of ranges, all of them at once, from a YAML file."""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.reachable import SMALLEST
from stewart_dynamics.datasheet.pose_ratings import AXES
from stewart_dynamics.errors import ParameterError, shown, shown_name
from stewart_dynamics.mechanics.kinematics.home_pose import shape_of
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.yaml_file import LARGEST, read_value
from stewart_dynamics.whole_file import read_text

# Rule of the largest length, for errors.
LARGEST_RULE = '100 times the size of the hexapod: lengths are in m'


def read_box(path: Path, parameters: Parameters) -> Array:
    """
    Return the ranges (6, 2) of a file: translation [m] and rotation vector [rad] from the pose.

    Each of ``x``, ``y``, ``z``, ``rx``, ``ry``, ``rz`` has a lower and an upper bound, or one
    number for both signs; axes that are not named do not move.

    Raises ParameterError: in one line: the file cannot be read, names another axis, all ranges are
        zero, or one is beyond a turn or 100 times the size of the hexapod: then its unit is
        another one.
    """
    document = read_value(read_text(path, LARGEST, ParameterError), str(path))
    if not isinstance(document, dict) or not document:
        raise ParameterError(f"{path}: must have a range, such as 'x: 0.1'")
    largest = largest_length(parameters)
    ranges = np.zeros((6, 2))
    for name, value in document.items():
        if name not in AXES:
            raise ParameterError(f'{path}: {shown_name(name)}: must be one of {", ".join(AXES)}')
        most, rule = ((2.0 * math.pi, 'a turn: angles are in radians') if name.startswith('r')
                      else (largest, LARGEST_RULE))
        bounds = _range(f'{path}: {name}', value)
        if max(map(abs, bounds)) > most:
            raise ParameterError(
                f'{path}: {name}: {shown(value)}: must be within {most:.4g}, {rule}')
        if any(0.0 < abs(each) < SMALLEST for each in bounds):
            raise ParameterError(
                f'{path}: {name}: {shown(value)}: must be 0, or at least {SMALLEST:g} from it')
        ranges[AXES.index(name)] = bounds
    if not np.ptp(ranges, axis=1).any():
        raise ParameterError(f'{path}: all ranges are of size zero: there is nothing to check')
    return ranges


def doubtful_ranges(ranges: Array, parameters: Parameters) -> Iterator[str]:
    """Yield possible errors in the unit of ranges (6, 2), which no hexapod reaches."""
    longest = parameters.limits.length_max
    far, than = ((10.0 * shape_of(parameters).radius, 'ten times the radius of the joints')
                 if longest is None else (float(np.max(longest)), 'the longest leg'))
    for axis, most in zip(AXES, np.abs(ranges).max(axis=1).tolist(), strict=True):
        if axis.startswith('r') and most > 0.5 * math.pi:
            yield f'--box: {axis}: {most:g} rad is more than a quarter of a turn: in degrees?'
        elif not axis.startswith('r') and most > far:
            yield f'--box: {axis}: {most:g} m is more than {than}, {far:.4g} m: in mm?'


def largest_length(parameters: Parameters) -> float:
    """Return the largest length that an option or file may give [m]."""
    return 100.0 * float(np.max([np.ptp(parameters[name], axis=0) for name in (
        'geometry.base_joints', 'geometry.platform_joints')]))


def _range(where: str, value: Any) -> tuple[float, float]:
    bounds = value if isinstance(value, list) else [value]
    if not 1 <= len(bounds) <= 2 or not all(
            isinstance(each, (int, float)) and not isinstance(each, bool)
            and math.isfinite(each) for each in bounds):
        raise ParameterError(f'{where}: {shown(value)}: must be one number, or two: [low, high]')
    if len(bounds) == 1:
        bounds = [-abs(bounds[0]), abs(bounds[0])]
    if bounds[0] > bounds[1]:
        raise ParameterError(f'{where}: {shown(value)}: the lower bound must come first')
    return float(bounds[0]), float(bounds[1])


def in_words(ranges: Array) -> dict[str, list[float | None]]:
    """Return the ranges by axis, for JSON: null where nothing limits."""
    return {axis: [value if math.isfinite(value) else None for value in each]
            for axis, each in zip(AXES, ranges.tolist(), strict=True)}
