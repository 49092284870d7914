# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The friction of the actuators: viscous, and Coulomb friction that is linear near standstill.

``f = viscous rate + coulomb sat(rate / coulomb_velocity)``, sat limited to -1 .. 1: the force is
a function of the rate alone, without a jump at standstill.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function


def friction(rates: Array, viscous: Array, coulomb: Array, coulomb_velocity: Array) -> Array:
    """
    Return the forces (N, 6) that overcome the friction [N].

    rates (N, 6): [m/s]
    viscous, coulomb, coulomb_velocity (6,): coefficients [N s/m], forces [N] and rates below which
        the latter are linear [m/s].
    """
    forces = np.empty((len(rates), 6))
    function('friction_many')(viscous, coulomb, coulomb_velocity, len(rates), rates, forces)
    return forces
