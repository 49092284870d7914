# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A rigid body on the platform: the empty platform, a payload, or both as one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.errors import ParameterError


class BodyError(ParameterError):
    """The inertia of a part is not that of a rigid body."""


class Body(NamedTuple):
    """Mass, center of mass and inertia, as a parameter file has them."""

    mass: float  # [kg]
    center: Array  # platform frame (3,) [m]
    inertia: Array  # ixx ixy ixz iyy iyz izz about the center of mass, platform axes (6,) [kg m^2]

    def with_body(self, added: Body) -> Body:
        """Return both as one rigid body; ParameterError if numbers overflow."""
        return self._with(added.mass, added.center, added.inertia)

    def without(self, part: Body) -> Body:
        """Return the rest without a part; ParameterError if no mass is left."""
        return self._with(-part.mass, part.center, -part.inertia)

    def _with(self, mass: float, center: Array, inertia: Array) -> Body:
        whole = np.zeros((), record('stewart_platform'))
        whole['mass'], whole['center_of_mass'], whole['inertia'] = self
        code = function('stewart_add_payload')(
            whole, mass, np.ascontiguousarray(center), np.ascontiguousarray(inertia))
        if code == CODES['STEWART_BROKEN_RULE']:
            raise BodyError('must be positive semidefinite')
        if code != CODES['STEWART_OK']:
            raise ParameterError('no mass is left, or the numbers overflow')
        return Body(float(whole['mass']), whole['center_of_mass'].copy(), whole['inertia'].copy())
