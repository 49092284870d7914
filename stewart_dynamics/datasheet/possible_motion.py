# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Changes with which a motion that is not possible would be: slower, smaller, elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.motions import Deviations, faster
from stewart_dynamics.datasheet.datasheet_record import PossibleChange
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.kinematics.home_pose import home_of
from stewart_dynamics.mechanics.rows import POSITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import FIXED
from stewart_dynamics.replay.recorded_motion import RecordedMotion

SPEED, AMPLITUDE, HEIGHT = 'speed', 'amplitude', 'height'
# Heights that are tried on either side, up to the height at home, and samples that are looked at
# for each change; all samples are checked at the value that is named.
_HEIGHTS, _SAMPLES = 40, 400
# Attempts at the next smaller value where the rounded one is not possible.
_ATTEMPTS = 5
# Cosine of the angle between gravity and the axis of the hexapod from which a platform is higher.
_UPRIGHT = 0.9

Check = Callable[[RecordedMotion], bool]
_Scale = Callable[[Array], Callable[[float], Array]]
"""From rows of motion to a function that returns them with a part of their size or speed."""


def possible_changes(platform: StewartPlatform, recorded: RecordedMotion, check: Check,
                     ) -> list[PossibleChange]:
    """
    Return changes of one number each with which a motion is possible, by the check itself.

    check: returns whether a motion is possible.
    """
    few = _thinned(recorded)
    found = []
    for change, scale in ((AMPLITUDE, _smaller(recorded.motion)),
                          (SPEED, lambda rows: partial(faster, rows))):
        if scale is None:
            continue
        percent = _largest_percent(scale, recorded, few, check)
        if percent:
            found.append(PossibleChange(
                change, percent / 100.0, f'at {percent} % of its {change}'))
    height = _nearest_height(platform, recorded, few, check)
    if height is not None:
        found.append(PossibleChange(
            HEIGHT, height, f'from {_length(abs(height))} {_direction(platform, height)}'))
    return found


def in_words(changes: list[PossibleChange]) -> str:
    """Return the changes in words; empty without one."""
    *first, last = [each.words for each in changes] or ['']
    return last and f'possible {", ".join(first)}{", or " if first else ""}{last}'


def _smaller(motion: Motion) -> _Scale | None:
    """
    Return the scale that makes rows of motion smaller about the first pose of a motion.

    None: the motion turns by half a turn or more from there, where rotation vectors jump.
    """
    start = Motion(motion.position[0], motion.rotation[0])
    turns = Deviations(start, motion.rows).changes[:, 0, 3:]
    if (np.linalg.norm(np.diff(turns, axis=0), axis=1) > np.pi).any():
        return None
    return lambda rows: Deviations(start, rows).at


def _largest_percent(scale: _Scale, recorded: RecordedMotion, few: RecordedMotion,
                     check: Check) -> int:
    """Return the largest percentage of a motion that is possible; 0 without one."""
    def checked(of: RecordedMotion) -> Callable[[int], bool]:
        scaled = scale(of.motion.rows)
        return lambda percent: check(of._replace(motion=Motion.of_rows(scaled(percent / 100.0))))

    of_few, of_all = checked(few), checked(recorded)
    low, high = 0, 100
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if of_few(middle) else (low, middle)
    return next((percent for percent in range(low, max(low - _ATTEMPTS, 0), -1)
                 if of_all(percent)), 0)


def _away(platform: StewartPlatform) -> tuple[Array, float]:
    """Return the unit vector from the base to the platform, and the height of the platform [m]."""
    home = home_of(platform.parameters)
    return home.shape.axes[2] * home.side, abs(float(home.heights[0]))


def _nearest_height(platform: StewartPlatform, recorded: RecordedMotion, few: RecordedMotion,
                    check: Check) -> float | None:
    """Return the smallest shift along the axis of the hexapod that makes a motion possible [m]."""
    away, height = _away(platform)

    def moved(by: float, of: RecordedMotion) -> bool:
        rows = of.motion.rows.copy()
        rows[:, POSITION] += by * away
        return check(of._replace(motion=Motion.of_rows(rows)))

    for by in _heights(height):
        if moved(by, few):
            step = height / _HEIGHTS
            low, high = abs(by) - step, abs(by)
            for _ in range(8):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if moved(math.copysign(middle, by), few) else (
                    middle, high)
            digit = 10.0 ** (math.floor(math.log10(high)) - 1)
            for n in range(math.ceil(high / digit), math.ceil(high / digit) + _ATTEMPTS):
                shift = math.copysign(float(f'{n * digit:.2g}'), by)
                if moved(shift, recorded):
                    return shift
    return None


def _heights(height: float) -> Iterator[float]:
    """Yield shifts, the smallest first."""
    for n in range(1, _HEIGHTS + 1):
        yield from (n * height / _HEIGHTS, -n * height / _HEIGHTS)


def _thinned(recorded: RecordedMotion) -> RecordedMotion:
    """Return a recording with at most _SAMPLES samples."""
    which = slice(None, None, max(1, len(recorded.seconds) // _SAMPLES))
    base = recorded.base
    return recorded._replace(
        seconds=recorded.seconds[which], motion=Motion.of_rows(recorded.motion.rows[which]),
        wrench=recorded.wrench[which],
        base=None if base is None else BaseMotion.of_rows(base.rows[which]))


def _direction(platform: StewartPlatform, by: float) -> str:
    """Return where a shift goes: higher, lower, or as seen from the base."""
    p, (away, _) = platform.parameters, _away(platform)
    size = float(np.linalg.norm(p.gravity))
    up = -float(p.gravity @ away) / size if size and p.base.source == FIXED else 0.0
    if abs(up) < _UPRIGHT:
        return 'farther from the base' if by > 0.0 else 'nearer to the base'
    return 'higher' if by * up > 0.0 else 'lower'


def _length(metres: float) -> str:
    return f'{100.0 * metres:g} cm' if metres >= 0.1 else f'{1000.0 * metres:g} mm'
