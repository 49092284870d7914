# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The friction of the actuators: viscous, and Coulomb friction that is linear near standstill.

``f = viscous rate + coulomb slip(rate)``, slip(rate) = rate / coulomb_velocity limited to -1 .. 1:
the force is a function of the rate alone, without a jump at standstill. Losses of screws are
friction in proportion to the load, and have the same slip (``drives.motors``).

The law is computed in C, with the inverse dynamics; here is all that follows from it, and the
shapes that identification fits beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import function
from stewart_dynamics.parameters.table import Parameters

_LEAST = 1e-9  # deviation of the noise of rates, by the rate at which the law ends
# Means of max(x + n, 0) over a normal n of deviation 1, by x.
_AT = np.linspace(-8.0, 8.0, 3201)
_MEANS = np.array([0.5 * x * math.erfc(-x / math.sqrt(2.0)) for x in _AT.tolist()]) + np.exp(
    -0.5 * _AT ** 2) / math.sqrt(2.0 * math.pi)


class CoulombPiece(NamedTuple):
    """Coulomb friction of a motion that is played k times as fast, for k from begin to end."""

    constant: Array  # [N]
    linear: Array  # by k [N]
    direction: Array  # signs of the rates where friction is constant, 0 near standstill
    begin: Array
    end: Array


class Friction(NamedTuple):
    """
    Friction of six actuators.

    viscous, coulomb, coulomb_velocity (6,): coefficients [N s/m], forces [N], and rates below
        which the latter are linear [m/s].
    """

    viscous: Array
    coulomb: Array
    coulomb_velocity: Array

    @classmethod
    def of(cls, p: Parameters) -> Friction:
        """Return the friction of a hexapod."""
        return cls(p.actuator.viscous_friction, p.actuator.coulomb_friction,
                   p.actuator.coulomb_velocity)

    @property
    def without_viscous(self) -> Friction:
        """Return the Coulomb friction alone."""
        return self._replace(viscous=np.zeros(6))

    def forces(self, rates: Array) -> Array:
        """Return the (N, 6) forces that overcome the friction [N] at rates (N, 6) [m/s]."""
        rates, forces = np.ascontiguousarray(rates), np.empty((len(rates), 6))
        function('friction_many')(*map(np.ascontiguousarray, self), len(rates), rates, forces)
        return forces

    @property
    def largest_change(self) -> Array:
        """Return the change (6,) [N] of the Coulomb friction where a leg reverses."""
        change: Array = 2.0 * self.coulomb
        return change

    def slope(self, coulomb: Array) -> Array:
        """Return the damping (6,) [N s/m] near standstill of Coulomb friction (6,) [N]."""
        damping: Array = coulomb / self.coulomb_velocity
        return damping

    def is_linear(self, rates: Array) -> Flags:
        """Return where rates (..., 6) [m/s] are so low that Coulomb friction is linear."""
        linear: Flags = np.abs(rates) < self.coulomb_velocity
        return linear

    def coulomb_by_speed(self, rates: Array) -> Iterator[CoulombPiece]:
        """Yield the pieces of the Coulomb friction at k times these rates (..., 6) [m/s]."""
        with np.errstate(divide='ignore'):
            knee = self.coulomb_velocity / np.abs(rates)
        sign, none = np.sign(rates), np.zeros(())
        yield CoulombPiece(none, self.coulomb * rates / self.coulomb_velocity, 0.0 * sign, none,
                           knee)
        yield CoulombPiece(self.coulomb * sign, none, sign, knee, np.full((), math.inf))


def slip_in_noise(rates: Array, coulomb_velocity: Array, deviation: ArrayLike) -> Array:
    """
    Return the slip (N, 6) at measured rates [m/s].

    It is the mean over the true rates, with a standard deviation of the noise [m/s]: noise then
    does not make the friction that fits too small (regression calibration: Carroll et al.,
    "Measurement Error in Nonlinear Models", 2006, doi:10.1201/9781420010138, chapter 4).
    """
    noise = np.maximum(deviation, _LEAST * np.asarray(coulomb_velocity))

    def integral(at: Array) -> Array:
        """Return the mean of max(at + noise, 0)."""
        part = at / noise
        mean: Array = noise * np.where(part < _AT[-1], np.interp(part, _AT, _MEANS), part)
        return mean

    slip: Array = (integral(rates + coulomb_velocity) - integral(rates - coulomb_velocity)
                   ) / coulomb_velocity - 1.0
    return slip


def stribeck(slip: Array, rates: Array, speed: float) -> Array:
    """Return the shape of Stribeck friction: it falls to 1/e at a speed [m/s]."""
    shape: Array = slip * np.exp(-(rates / speed) ** 2)
    return shape
