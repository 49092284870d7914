# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
What a leg's force is for: gravity, inertia, velocity, friction or the load on the platform.

The force is linear in them: ``J_inv^T f = M X'' + C X' + G - wrench``, and friction adds to it
along the leg. So the runtime path gives each part alone, from a motion and a machine that
have only what causes it.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics import kernel
from stewart_dynamics.mechanics.rows import ACCELERATION, CONDITION, FORCES, RATES, TWIST
from stewart_dynamics.mechanics.singularity import UNSOLVABLE_CONDITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters import Parameters

CAUSES = ('gravity', 'platform inertia', 'leg inertia', 'velocity terms', 'friction', 'wrench')

_NO_GRAVITY = {'gravity': [0.0, 0.0, 0.0]}
_NO_FRICTION = {'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}
# The inertia of the legs has the actuators' in it: they turn as a leg changes its length.
_NO_LEGS = {'legs.cylinder.mass': 0.0, 'legs.cylinder.inertia': 0.0, 'legs.piston.mass': 0.0,
            'legs.piston.inertia': 0.0, 'actuator.reflected_mass': 0.0}

# Samples that are split together: few enough for the processor's cache.
_TOGETHER = 1024


class ForceCauses:
    """
    The split of leg forces by what causes them, for a machine with given parameters.

    Parameters
    ----------
    parameters : Parameters
        The machine's.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._viscous = parameters['actuator.viscous_friction']
        self._coulomb = parameters['actuator.coulomb_friction']
        self._machine = StewartPlatform(parameters)
        self._weightless = StewartPlatform(parameters.replaced({**_NO_GRAVITY, **_NO_FRICTION}))
        self._platform_only = StewartPlatform(
            parameters.replaced({**_NO_GRAVITY, **_NO_FRICTION, **_NO_LEGS}))

    def __call__(self, motions: Array, wrenches: Array) -> Array:
        """
        Return the forces (N, 6, 6) [N]: sample, cause in the order of CAUSES, leg.

        They sum to the demanded forces. nan where J_inv cannot be solved.

        Parameters
        ----------
        motions : (N, 24)
            Rows of motion, laid out as ``inverse_dynamics`` says.
        wrenches : (N, 6) or (1, 6)
            Loads on the platform at its origin, base axes [N, N m]; one row for all.

        """
        forces = np.empty((len(motions), len(CAUSES), 6))
        loaded = bool(wrenches.any())
        for first in range(0, len(motions), _TOGETHER):
            part = slice(first, first + _TOGETHER)
            load = wrenches if len(wrenches) == 1 else wrenches[part]
            self._split(motions[part], load if loaded else None, forces[part])
        return forces

    def _split(self, motions: Array, wrenches: Array | None, forces: Array) -> None:
        gravity, platform_inertia, leg_inertia, velocity_terms, friction, wrench = (
            forces[:, n] for n in range(len(CAUSES)))
        rows = motions.copy()
        rows[:, 12:] = 0.0  # at rest
        results = self._machine.solve(rows)
        gravity[:] = results[:, FORCES]
        unsolvable = ~(results[:, CONDITION] < UNSOLVABLE_CONDITION)
        wrench[:] = 0.0 if wrenches is None else self._weightless.solve(rows, wrenches)[:, FORCES]

        rows[:, ACCELERATION] = motions[:, ACCELERATION]
        platform_inertia[:] = self._platform_only.solve(rows)[:, FORCES]
        leg_inertia[:] = self._weightless.solve(rows)[:, FORCES] - platform_inertia

        rows[:, ACCELERATION] = 0.0
        rows[:, TWIST] = motions[:, TWIST]
        results = self._weightless.solve(rows)
        velocity_terms[:] = results[:, FORCES]
        # The law itself: what it adds would drown in the other forces near a singularity.
        rates = results[:, RATES]
        friction[:] = self._viscous * rates + self._coulomb * np.clip(
            rates / kernel.COULOMB_RATE, -1.0, 1.0)
        forces[unsolvable] = np.nan
