# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The base wrench of setpoints: force and moment that the hexapod exerts on its base.

It is not part of the step: the node computes it only while there is a subscriber. The result is
bit-identical for single setpoints and for batches.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, NO_WRENCH, Six
from stewart_dynamics.core.binding import function, Sample
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.step import Batch, Setpoint

# Topic, relative to the node's name.
BASE_WRENCH = 'base_wrench'


class BaseWrench:
    """
    The base wrench of setpoints, for a hexapod with given parameters.

    Force [N] and moment [N m] on the base at its origin, base axes; see
    ``mechanics.dynamics.base_wrench``.

    parameters: constant for all calls; create another object for other parameters. Not
        thread-safe: calls for one setpoint share a buffer.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._platform = StewartPlatform(parameters)
        self._still = tuple(BaseMotion(parameters.gravity).rows.tolist())
        self._sample = Sample('one_motion', 'base', 'base_wrench')
        self._solve = function('base_wrench_one').bound(
            self._platform.structure, self._sample.numbers)

    def __call__(self, setpoint: Setpoint) -> Six | None:
        """Return the base wrench; None if the base's motion is unknown or numbers overflow."""
        base = setpoint.base
        self._sample.write(*setpoint.motion, *NO_WRENCH, *setpoint.wrench,
                           *(self._still if base is None else base))
        if not self._solve():
            return None
        wrench: Six = self._sample.read()
        return wrench

    def many(self, setpoints: Batch) -> Array:
        """Return base wrenches (N, 6); rows of nan where a call for one setpoint gives None."""
        wrenches = self._platform.base_wrenches(
            setpoints.motions, setpoints.wrenches, setpoints.bases)
        finite = np.isfinite(wrenches)
        if not finite.all():
            wrenches[~finite.all(axis=1)] = np.nan
        return wrenches
