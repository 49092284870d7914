# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The friction of the actuators: viscous, and Coulomb friction that is linear near standstill.

``f = viscous rate + coulomb sat(rate / coulomb_velocity)``, sat limited to -1 .. 1: the force is
a function of the rate alone, without a jump at standstill.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import entry_point, inlined


@inlined
def with_friction(force: float, rate: float, viscous: float, coulomb: float,
                  coulomb_velocity: float) -> float:
    """Return a force [N] plus the force that overcomes the friction at a rate [m/s]."""
    slip = rate / coulomb_velocity
    return (force + viscous * rate
            + coulomb * (-1.0 if slip < -1.0 else 1.0 if slip > 1.0 else slip))


@entry_point('f8[:,::1]', 'f8[::1]', 'f8[::1]', 'f8[::1]', 'f8[:,::1]')
def friction(rates: Array, viscous: Array, coulomb: Array, coulomb_velocity: Array,
             forces: Array) -> None:
    """
    Write the forces that overcome the friction.

    rates (N, 6): [m/s]
    viscous, coulomb, coulomb_velocity (6,): coefficients [N s/m], forces [N] and rates below which
        the latter are linear [m/s].
    forces (N, 6): written [N].
    """
    for n in range(len(rates)):
        for leg in range(6):
            forces[n, leg] = with_friction(
                0.0, rates[n, leg], viscous[leg], coulomb[leg], coulomb_velocity[leg])
