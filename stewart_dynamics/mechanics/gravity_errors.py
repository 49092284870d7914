# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Possible errors in a gravity vector in base axes, given as a parameter or measured."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.kinematics.home_pose import Home

# Kinds of possible errors.
NONE, IN_G, IN_MM, AWAY = 'none', 'in g', 'in mm/s^2', 'away'

_LARGEST = 100.0  # [m/s^2]; Jupiter has 25
_SMALLEST = 0.2  # [m/s^2]; the moon has 1.6, the largest asteroid 0.28
_ROUND_1 = 0.05  # an accelerometer measures 1 g with a smaller error
# Share of gravity that pulls the platform away from the base.
_HANGING = 0.5


def find_gravity_error(gravity: Array, home: Home | None = None) -> str:
    """
    Return the kind of the possible error, empty without one.

    gravity (3,): base axes [m/s^2].
    home: for the side of the platform; None: the direction is not checked.
    """
    size = float(np.linalg.norm(gravity))
    if size > _LARGEST:
        return IN_MM
    if size < _SMALLEST:
        return NONE
    if abs(size - 1.0) <= _ROUND_1:
        return IN_G
    if home is None or home.certain:
        return ''
    away = home.shape.axes[2] * home.side  # from the base to the platform
    return AWAY if gravity @ away > _HANGING * size else ''
