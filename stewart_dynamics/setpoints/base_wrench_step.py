# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The base wrench of setpoints: force and moment that the hexapod exerts on its base.

It is not part of the step: the node computes it only while there is a subscriber.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.step import Batch

# Topic, relative to the node's name.
BASE_WRENCH = 'base_wrench'


class BaseWrench:
    """
    The base wrench of setpoints, for a hexapod with given parameters.

    Force [N] and moment [N m] on the base at its origin, base axes; see
    ``mechanics.dynamics.base_wrench``.

    parameters: constant for all calls; create another object for other parameters.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._platform = StewartPlatform(parameters)

    def __call__(self, setpoints: Batch) -> Array:
        """Return base wrenches (N, 6); rows of nan: base's motion unknown, or numbers overflow."""
        wrenches = self._platform.base_wrenches(
            setpoints.motions, setpoints.wrenches, setpoints.bases)
        finite = np.isfinite(wrenches)
        if not finite.all():
            wrenches[~finite.all(axis=1)] = np.nan
        return wrenches
