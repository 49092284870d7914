# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod as the C library takes it: the structure ``stewart_platform`` of parameters.

``parameters.structure`` has all but the axes of joints, some of which follow from the home pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.drives.turning_screws import motor_turns, screw_constants
from stewart_dynamics.mechanics.kinematics.home_pose import choose_branch
from stewart_dynamics.mechanics.kinematics.joint_axes import AXES, joint_axes
from stewart_dynamics.mechanics.limits import OF_JOINTS
from stewart_dynamics.mechanics.rows import BASE_AXIS, PLATFORM_AXIS
from stewart_dynamics.parameters.table import Parameters, UNIVERSAL


def hexapod_structure(parameters: Parameters, screws: Array | None = None,
                      axes: Sequence[str] = ()) -> Records:
    """
    Return the structure () of a hexapod, with the axes of its screws.

    screws (6, SCREW): those of ``screw_constants``, by default of the parameters.
    axes: which of AXES it has; without them, joint angles are not computed.

    Raises ParameterError: axes that are needed are not given, and there is no home pose.
    """
    choose_branch(parameters)
    hexapod: Any = parameters.structure.copy()
    legs = hexapod['legs']
    if parameters.drive.screw_rotation == UNIVERSAL:
        screws = screw_constants(parameters) if screws is None else screws
        legs['twist_ratio'] = motor_turns(parameters)
        legs['base_universal_axis'] = screws[:, BASE_AXIS]
        legs['platform_universal_axis'] = screws[:, PLATFORM_AXIS]
    if axes:
        legs['base_joint_axis'], legs['platform_joint_axis'] = joint_axes(parameters, axes)
    function('stewart_complete')(hexapod)
    hexapod['with_joint_angles'] = bool(axes)
    return hexapod  # type: ignore[no-any-return]


def limited_structure(parameters: Parameters) -> Records:
    """Return the structure () with the axes that the limits of joint angles need."""
    return hexapod_structure(parameters, axes=[
        each for each, limit in zip(AXES, OF_JOINTS, strict=True)
        if parameters[limit] is not None])
