# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Hypotheses about masses and inertias of bodies, which hold for bodies of any part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.possible_errors.hypothesis import Hypothesis, Table

# Radius of gyration of a part of a leg by its length: 0.3 to 1; with kg mm^2 or g mm^2 it is over
# 1000 times as large, with a mass in g 1/32.
_LARGEST_GYRATION, _SMALLEST_GYRATION = 3.0, 0.01
# Violation of the triangle inequality by principal moments rounded to two or three digits.
_ROUNDING = 0.02


class Part(NamedTuple):
    """A part of each leg (6,), or of some legs; without mass or inertia it is not checked."""

    name: str  # of its parameters
    mass: Array  # [kg]
    inertia: Array  # [kg m^2]
    length: Array  # [m]

    @property
    def gyration(self) -> Array:
        """Return the radii of gyration [m]."""
        found: Array = np.sqrt(self.inertia / self.mass)
        return np.where((found > 0.0) & np.isfinite(found), found, np.nan)


PART_ERRORS: Table[Part] = (
    Hypothesis[Part]('{name}.inertia', lambda s: s.gyration / s.length - _LARGEST_GYRATION, (
        '{inertia:.3g} kg m^2, a radius of gyration of {gyration:.3g} m, but a length of '
        '{length:.3g} m: in g mm^2 or kg mm^2?')),
    Hypothesis[Part]('{name}.mass', lambda s: _SMALLEST_GYRATION - s.gyration / s.length, (
        '{mass:.6g} kg, with {name}.inertia a radius of gyration of {gyration:.3g} m, but a '
        'length of {length:.3g} m: in g?')))


class Moments(NamedTuple):
    """Principal moments of bodies (n, 3), in ascending order [kg m^2]; nan: not checked."""

    name: str  # of the parameter
    moments: Array
    order: str = 'ixx ixy ixz iyy iyz izz'

    @property
    def listed(self) -> list[str]:
        """Return the moments of each body in words."""
        return [', '.join(f'{each:.3g}' for each in body) for body in self.moments]


IMPOSSIBLE_INERTIA: Table[Moments] = Hypothesis(
    '{name}', lambda s: s.moments[:, 2] > (1.0 + _ROUNDING) * s.moments[:, :2].sum(axis=1), (
        'principal moments [{listed}] kg m^2: no body has one larger than the sum of the other '
        'two: is the order {order}?'))
