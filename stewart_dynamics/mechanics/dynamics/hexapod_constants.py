# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The constants of a hexapod as one array, for the functions that numba compiles."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.mechanics.vectors import read3, Vector3
from stewart_dynamics.parameters.table import Parameters

# The characteristic length, then base joint and platform joint of each leg.
_FIRST_LEG, _LEG = 1, 6


def hexapod_constants(p: Parameters) -> Array:
    """Return the constants of a hexapod, SI units."""
    joints = np.column_stack([p['geometry.base_joints'], p['geometry.platform_joints']])
    return np.concatenate([[p['singularity.characteristic_length']], joints.ravel()])


@inlined
def characteristic_length_of(constants: Array) -> float:
    """Return the length by which moments are divided [m]."""
    length: float = constants[0]
    return length


@inlined
def joints_of(constants: Array, leg: int) -> tuple[Vector3, Vector3]:
    """Return a leg's base joint, base frame, and platform joint, platform frame [m]."""
    o = _FIRST_LEG + leg * _LEG
    return read3(constants, o), read3(constants, o + 3)
