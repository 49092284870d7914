# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Force breakdown by source: gravity, inertia, velocity, friction, external wrench, base motion.

The leg forces are linear in them: ``J_inv^T f = M X'' + C X' + G - wrench``, and friction adds
to f along the leg. So each part is the inverse dynamics of a motion and a
hexapod reduced to its source.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.drives.turning_screws import screw_constants
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.dynamics.lagrange import drive_rates
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, CONDITION, GRAVITY, MOTION, TWIST)
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION
from stewart_dynamics.parameters.table import FIXED, Parameters


class ForceBreakdown(NamedTuple):
    """
    Leg forces by source, (..., 6) [N] each; they sum to the forces of the inverse dynamics.

    Attributes
    ----------
    gravity : (..., 6)
        Holds platform and legs at rest.
    platform_inertia : (..., 6)
        Accelerates the platform.
    leg_inertia : (..., 6)
        Accelerates the legs and their actuators.
    velocity : (..., 6)
        Centrifugal and Coriolis terms.
    friction : (..., 6)
        Overcomes the friction of the actuators.
    wrench : (..., 6)
        Balances the external wrench.
    base_motion : (..., 6)
        Accelerates platform and legs along with a moving base; zero on a still one.

    """

    gravity: Array
    platform_inertia: Array
    leg_inertia: Array
    velocity: Array
    friction: Array
    wrench: Array
    base_motion: Array

    @property
    def total(self) -> Array:
        """Return the sum of all (..., 6) [N]."""
        total: Array = sum(self[1:], self[0])
        return total

    def __repr__(self) -> str:
        """Return the shape, not the arrays."""
        return f'<ForceBreakdown of shape {self.gravity.shape[:-1]}: {", ".join(self._fields)}>'


# Their names in texts, in the order of ForceBreakdown.
SOURCES = ('gravity', 'platform inertia', 'leg inertia', 'velocity terms', 'friction', 'wrench',
           'base motion')

_NO_GRAVITY = {'gravity': [0.0, 0.0, 0.0]}
_NO_FRICTION = {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}

# Samples computed at once: they fit into the processor's cache.
_TOGETHER = 1024


def sources_of(parameters: Parameters) -> tuple[str, ...]:
    """Return SOURCES, without the base's motion, the last, where ``base.source`` is fixed."""
    return SOURCES[:-1] if parameters.base.source == FIXED else SOURCES


class ForceBreakdownRows:
    """The force breakdown of rows of motion, as one array."""

    def __init__(self, parameters: Parameters) -> None:
        self._friction = Friction.of(parameters)
        self._parameters, self._screws = parameters, screw_constants(parameters)
        self._whole = hexapod_structure(parameters)
        self._weightless = hexapod_structure(
            parameters.replaced({**_NO_GRAVITY, **_NO_FRICTION}))
        # The reflected inertia of the drives is part of the inertia of the legs.
        self._platform_only = hexapod_structure(parameters.replaced(
            {**_NO_GRAVITY, **_NO_FRICTION, **parameters.leg_kind.massless}))
        self._efforts = parameters.leg_kind.effort.columns
        self._rates = parameters.leg_kind.rate.columns

    def __call__(self, motions: Array, wrenches: Array, bases: Array | None = None) -> Array:
        """
        Return the forces (N, 7, 6) [N]: sample, source in the order of SOURCES, leg.

        They sum to the demanded forces. nan where J_inv cannot be solved, or the base's motion is
        not known.

        motions (N, MOTION): rows of motion.
        wrenches (N, WRENCH) or (1, WRENCH): external wrenches at the platform's origin, base axes
            [N, N m]; one row for all.
        bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all; nan: not known.
            By default the base is still.
        """
        forces = np.empty((len(motions), len(SOURCES), 6))
        loads = wrenches if wrenches.any() else None
        for first in range(0, len(motions), _TOGETHER):
            part = slice(first, first + _TOGETHER)
            load, base = (each if each is None or len(each) == 1 else each[part]
                          for each in (loads, bases))
            self._split(motions[part], load, base, forces[part])
        return forces

    def _split(self, motions: Array, wrenches: Array | None, bases: Array | None, forces: Array,
               ) -> None:
        by = ForceBreakdown(*(forces[:, n] for n in range(len(SOURCES))))
        rows = motions.copy()
        rows[:, TWIST.start:MOTION] = 0.0  # at rest
        gravity = bases
        if bases is not None:
            gravity, bases = bases.copy(), bases.copy()
            gravity[:, GRAVITY.stop:] *= 0.0  # nan stays nan
            bases[:, GRAVITY] *= 0.0
        results = batch.solve(self._whole, rows, None, gravity)
        by.gravity[:] = results[:, self._efforts]
        unknown = ~(results[:, CONDITION] < UNSOLVABLE_CONDITION)
        if bases is not None:
            unknown = unknown | np.isnan(bases[:, -1])
        solve = partial(batch.solve, condition=False)
        by.wrench[:] = 0.0 if wrenches is None else solve(
            self._weightless, rows, wrenches)[:, self._efforts]

        rows[:, ACCELERATION] = motions[:, ACCELERATION]
        by.platform_inertia[:] = solve(self._platform_only, rows)[:, self._efforts]
        by.leg_inertia[:] = (solve(self._weightless, rows)[:, self._efforts]
                             - by.platform_inertia)

        rows[:, ACCELERATION] = 0.0
        rows[:, TWIST] = motions[:, TWIST]
        results = solve(self._weightless, rows)
        by.velocity[:] = results[:, self._efforts]
        # By the friction law: as a difference it would lose its digits near a singularity.
        rates = results[:, self._rates].copy() if not self._screws.any() else drive_rates(
            self._parameters, rows, self._screws)
        by.friction[:] = self._friction.forces(rates)
        by.base_motion[:] = 0.0 if bases is None else (
            solve(self._weightless, rows, None, bases)[:, self._efforts] - by.velocity)
        forces[unknown] = np.nan
