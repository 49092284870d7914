# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The workspace around the rated pose: sections at its rotation, and tilt in all directions."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.workspace import Section
from stewart_dynamics.datasheet.datasheet_record import FrequencySection
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.mechanics.frames.motion import Pose

_AZIMUTHS = 360
# Cells of a section, in both directions, for which a natural frequency is given.
_CELLS = 32
PLANES = {'xz': (0, 2), 'yz': (1, 2), 'xy': (0, 1)}  # sections, and the axes in them


class Boundary(NamedTuple):
    """Tilt toward all azimuths, and the limits that end it."""

    directions: Array  # (N, 6), base axes
    begin: Array  # (6,) translation from the pose, at which the platform tilts
    values: Array  # travel along each direction (N,) [rad]; infinite if nothing limits
    limits: list[str]
    legs: list[int]

    @property
    def points(self) -> Array:
        """Return the ends of the travels (N, 6), from the pose."""
        ends: Array = self.begin + self.values[:, None] * self.directions
        return ends


def tilt(hexapod: RatedHexapod, height: float) -> Boundary:
    """
    Return the tilt toward all azimuths at a height above the pose.

    Row n is a lean toward the azimuth ``2 pi n / N`` from x to y, base axes.
    """
    around = np.linspace(0.0, 2.0 * np.pi, _AZIMUTHS, endpoint=False)
    directions = np.zeros((_AZIMUTHS, 6))
    directions[:, 3], directions[:, 4] = -np.sin(around), np.cos(around)
    begin = np.array([0.0, 0.0, height, 0.0, 0.0, 0.0])
    found = hexapod.travel(hexapod.moved_by(begin), directions)
    return Boundary(directions, begin, found.value, found.limit.tolist(), found.leg.tolist())


def rotations_over_height(hexapod: RatedHexapod, low: float, high: float, count: int = 41,
                          ) -> tuple[Array, dict[str, Array]]:
    """
    Return heights (N,) from the pose [m], and how far the platform can turn there (N,) [rad].

    ``tilt`` is the smallest of all azimuths.
    """
    around = np.linspace(0.0, 2.0 * np.pi, _AZIMUTHS // 5, endpoint=False)
    directions = np.zeros((len(around) + 2, 6))
    directions[:-2, 3], directions[:-2, 4] = -np.sin(around), np.cos(around)
    directions[-2:, 5] = 1.0, -1.0
    heights: Array = np.linspace(low, high, count, dtype=float)
    up = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    poses = Pose(hexapod.pose.position + heights[:, None] * up[:3], hexapod.pose.rotation)
    values = hexapod.travel(poses[:, None], directions).value
    return heights, {'tilt, every direction': values[:, :-2].min(axis=1),
                     'θZ': values[:, -2:].min(axis=1)}


class Frequencies(NamedTuple):
    """Lowest natural frequencies over a section, at the middles of equal cells."""

    first: Array  # displacements from the pose along the first axis of the section (N,) [m]
    second: Array  # the same along the second axis (M,) [m]
    values: Array  # (N, M) [Hz]; nan outside the section, 0 where the pose is not stable

    def listed(self) -> FrequencySection:
        """Return the numbers for ``datasheet.json``; None outside the section."""
        return FrequencySection(
            self.first.tolist(), self.second.tolist(),
            [[None if math.isnan(each) else each for each in row]
             for row in self.values.tolist()])


def frequencies(hexapod: RatedHexapod, section: Section, axes: tuple[int, int],
                leg_stiffness: float) -> Frequencies:
    """Return the lowest natural frequency over a section, with legs of a stiffness [N/m]."""
    loops = [(each - hexapod.origin.position)[:, axes] for each in section.loops]
    points = np.concatenate([*loops, np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    middles = (np.arange(_CELLS) + 0.5)[:, None] / _CELLS * (high - low) + low
    at = np.stack(np.meshgrid(*middles.T, indexing='ij'), axis=-1).reshape(-1, 2)
    inside = np.zeros(len(at), dtype=bool)
    for loop in loops:  # a line to the right crosses them an odd number of times
        (x, y), (next_x, next_y) = loop[:-1].T, loop[1:].T
        above = (y > at[:, 1:]) != (next_y > at[:, 1:])
        with np.errstate(all='ignore'):
            crossing = x + (at[:, 1:] - y) / (next_y - y) * (next_x - x)
        inside ^= (above & (crossing > at[:, :1])).sum(axis=1) % 2 == 1
    positions = np.tile(hexapod.pose.position, (int(inside.sum()), 1))
    positions[:, axes] += at[inside]
    values: Array = np.full(len(at), math.nan)
    if inside.any():
        poses = Pose(positions, np.broadcast_to(hexapod.pose.rotation, (len(positions), 3, 3)))
        values[inside] = hexapod.frequencies(poses, leg_stiffness)[:, 0]
    return Frequencies(middles[:, 0], middles[:, 1], values.reshape(_CELLS, _CELLS))


def table(sections: Mapping[str, Section], tilts: Mapping[str, Boundary],
          hexapod: RatedHexapod) -> str:
    """Return the boundaries of sections and tilts as CSV, displacements from the pose."""
    lines = ['section,x,y,z,rx,ry,rz,limit,leg']
    names = [*hexapod.joints, '']  # -1: no leg

    def add(section: str, numbers: Array, limit: str, leg: int) -> None:
        text = ','.join(f'{value:.9g}' for value in numbers)
        lines.append(f'{section},{text},{limit},{names[leg]}')

    for name, section in sections.items():
        for part in section.boundary:
            for point in part.points - hexapod.origin.position:
                add(name, np.append(point, np.zeros(3)), part.limit, part.leg)
    for each in tilts.values():
        for point, limit, leg in zip(each.points, each.limits, each.legs, strict=True):
            if np.isfinite(point).all():
                add('tilt', point, limit, leg)
    return '\n'.join(lines) + '\n'
