# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The axes from which the angles of the joints are measured.

The axis of a base joint is fixed to the base, that of a platform joint to the platform. Without
given axes they are the legs' directions at the home pose: all angles are zero there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.kinematics.leg_joints import home_directions, HomeDirections
from stewart_dynamics.parameters.table import Parameters

BASE_AXES, PLATFORM_AXES = AXES = 'geometry.base_joint_axes', 'geometry.platform_joint_axes'


def joint_axes(p: Parameters, needed: Sequence[str] = AXES) -> list[Array]:
    """
    Return the directions of base joints, base axes, and platform joints, platform axes.

    needed: names in AXES; the others are nan. (6, 3) each, of any length.

    Raises ParameterError: axes that are needed are not given, and there is no home pose.
    """
    with np.errstate(all='ignore'):
        directions = _at_home(p, [name for name in needed if p[name] is None])
        return [np.full((6, 3), np.nan) if name not in needed
                else at_home if p[name] is None else p[name]
                for name, at_home in zip(AXES, directions, strict=True)]


def _at_home(p: Parameters, missing: Sequence[str]) -> HomeDirections:
    if missing:
        try:
            home_pose(p)
        except ParameterError as exc:
            raise ParameterError(f'{exc}; needed without {missing[0]}') from exc
    return home_directions(p)
