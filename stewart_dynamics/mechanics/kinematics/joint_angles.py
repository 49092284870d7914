# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The angles of the joints at both ends of the legs, and the axes from which they are measured.

A joint's angle is the one between the leg's direction s, from base joint to platform joint, and
the joint's axis u: how far the joint is deflected, whichever way. The axis of a base joint is
fixed to the base, that of a platform joint to the platform, where the leg's direction is R^T s.
Without given axes they are the leg's direction at the home pose: all angles are zero there.

    angle = atan2(|u x s|, u . s)          0 to pi

Between samples, h = sin^2(angle / 2) = |u - s|^2 / 4 is used: it grows with the angle, has a
derivative at angle zero, too, and loses no digits there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.kinematics.joint_axes import AXES
from stewart_dynamics.mechanics.limits import OF_JOINTS
from stewart_dynamics.mechanics.rows import JOINT_ANGLES
from stewart_dynamics.parameters.table import Parameters


class JointAngles:
    """
    The angles of a hexapod's joints.

    needed: names in AXES; the other angles are nan.

    axes (12, 3): unit vectors from which the angles are measured: of the base joints in base axes,
        of the platform joints in platform axes; nan for axes that are not needed.
    Raises ParameterError: axes that are needed are not given, and there is no home pose.
    """

    def __init__(self, parameters: Parameters, needed: Sequence[str] = AXES) -> None:
        self._hexapod = hexapod_structure(parameters, axes=needed)
        legs = self._hexapod['legs']
        self.axes: Array = np.concatenate([legs['base_joint_axis'], legs['platform_joint_axis']])

    def __call__(self, motions: Array) -> Array:
        """Return the angles (N, JOINT_ANGLES) [rad] in motions (N, MOTION)."""
        angles = np.empty((len(motions), JOINT_ANGLES))
        batch.in_parts(self._write, (), batch.compact(motions), angles)
        return angles

    def _write(self, motions: Array, angles: Array) -> None:
        function('joint_angles_many')(self._hexapod, len(motions), motions, angles)

    def haversines(self, motions: Array) -> tuple[Array, Array]:
        """Return sin^2(angle / 2) and its rate [1/s], both (N, JOINT_ANGLES), in motions."""
        values, rates = (np.empty((len(motions), JOINT_ANGLES)) for _ in range(2))
        function('joint_haversines_many')(
            self._hexapod, len(motions), batch.compact(motions), values, rates)
        return values, rates


def angles_to_check(parameters: Parameters, limits: Sequence[str]) -> JointAngles | None:
    """Return the angles that the given joint limits need; None without joint limits."""
    needed = [axes for axes, limit in zip(AXES, OF_JOINTS, strict=True) if limit in limits]
    return JointAngles(parameters, needed) if needed else None
