# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A hexapod computed without this package: forces of a motion, and motion under control.

The equations are those of virtual power, body by body: each leg part has its own acceleration,
which the joint of the platform determines. Nothing is taken from ``stewart_dynamics.mechanics``
besides the values of the parameter file. ``test_estimate_cases`` compares both.
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]


class Hexapod(NamedTuple):
    """The numbers of a hexapod, as compiled functions take them."""

    base: Array  # (6, 3)
    platform: Array  # (6, 3)
    legs: Array  # (6, 6): mass, center of mass, inertia of cylinder and of piston
    actuators: Array  # (6, 4): reflected mass, viscous, Coulomb friction, Coulomb velocity
    mass: float
    center: Array
    inertia: Array  # (3, 3)
    gravity: Array

    @classmethod
    def of(cls, p: Parameters) -> Hexapod:
        """Return the numbers of a parameter file."""
        xx, xy, xz, yy, yz, zz = p['platform.inertia']
        return cls(
            p['geometry.base_joints'].reshape(6, 3), p['geometry.platform_joints'].reshape(6, 3),
            np.stack([p[f'legs.{part}.{name}'] for part in ('cylinder', 'piston')
                      for name in ('mass', 'center_of_mass', 'inertia')], axis=1),
            np.stack([p[f'actuator.{name}'] for name in (
                'reflected_mass', 'viscous_friction', 'coulomb_friction', 'coulomb_velocity')],
                axis=1),
            p['platform.mass'], p['platform.center_of_mass'],
            np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), p['gravity'])


@njit(cache=True)
def _cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                     a[0] * b[1] - a[1] * b[0]])


@njit(cache=True)
def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


@njit(cache=True)
def _terms(h: Hexapod, x: Array, r: Array, v: Array, w: Array):  # type: ignore[no-untyped-def]
    """
    Return M and c, J and e, lengths and rates.

    The wrench of all bodies is M a + c, the acceleration of the legs J a + e, with a the
    acceleration of the platform.
    """
    mass, rest, jacobian = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    bias, lengths, rates = np.zeros(6), np.zeros(6), np.zeros(6)
    center, turned = r @ h.center, r @ h.inertia @ r.T
    arm = _skew(center)
    mass[:3, :3] = h.mass * np.eye(3)
    mass[:3, 3:] = -h.mass * arm
    mass[3:, :3] = h.mass * arm
    mass[3:, 3:] = turned - h.mass * arm @ arm
    force = h.mass * (_cross(w, _cross(w, center)) - h.gravity)
    rest[:3] = force
    rest[3:] = _cross(center, force) + _cross(w, turned @ w)
    for i in range(6):
        m1, s1, i1, m2, s2, i2 = h.legs[i]
        a = r @ h.platform[i]
        leg = x + a - h.base[i]
        length = np.sqrt(leg @ leg)
        s = leg / length
        moved = v + _cross(w, a)
        rate = s @ moved
        turn = (moved - rate * s) / length  # of the direction s
        square = turn @ turn
        # The joint's acceleration q turns the direction by (q - s (s . q)) / length and this.
        still = -square * s - 2.0 * rate / length * turn
        part = 1.0 - s2 / length  # of the joint's acceleration across the leg, at the piston
        around = m1 * s1 * s1 + i1 + i2
        across = around / length ** 2 + m2 * part ** 2
        drift = _cross(w, _cross(w, a))  # acceleration of a joint of a platform that only turns
        load = (across * drift + (around * still - m1 * s1 * h.gravity) / length
                - m2 * part * (s2 * still + h.gravity))
        along = m2 * (s @ drift - s2 * (s @ still) - s @ h.gravity)
        load += (along - s @ load) * s
        jacobian[i, :3], jacobian[i, 3:] = s, _cross(a, s)
        arm = _skew(a)
        for n in range(3):
            mass[n, n] += across
        mass[:3, 3:] -= across * arm
        mass[3:, :3] += across * arm
        mass[3:, 3:] -= across * arm @ arm
        mass += (m2 - across) * np.outer(jacobian[i], jacobian[i])
        rest[:3] += load
        rest[3:] += _cross(a, load)
        bias[i] = s @ drift + length * square
        lengths[i], rates[i] = length, rate
    return mass, rest, jacobian, bias, lengths, rates


@njit(cache=True)
def _friction(h: Hexapod, rates: Array) -> Array:
    slip = np.minimum(np.maximum(rates / h.actuators[:, 3], -1.0), 1.0)
    return h.actuators[:, 1] * rates + h.actuators[:, 2] * slip


@njit(cache=True)
def _inverse(h: Hexapod, x: Array, r: Array, v: Array, w: Array, a: Array) -> Array:
    legs = np.empty((len(x), 3, 6))
    for n in range(len(x)):
        mass, rest, jacobian, bias, lengths, rates = _terms(h, x[n], r[n], v[n], w[n])
        legs[n, 0], legs[n, 1] = lengths, rates
        legs[n, 2] = (np.linalg.solve(jacobian.T.copy(), mass @ a[n] + rest)
                      + h.actuators[:, 0] * (jacobian @ a[n] + bias) + _friction(h, rates))
    return legs


@njit(cache=True)
def _acceleration(h: Hexapod, x: Array, r: Array, v: Array, w: Array, force: Array) -> Array:
    mass, rest, jacobian, bias, _, rates = _terms(h, x, r, v, w)
    whole = mass + jacobian.T @ (h.actuators[:, :1] * jacobian)
    return np.linalg.solve(whole, jacobian.T @ (
        force - h.actuators[:, 0] * bias - _friction(h, rates)) - rest)


@njit(cache=True)
def _controlled(h: Hexapod, x: Array, r: Array, lengths: Array, rates: Array, force: Array,
                gains: Array, period: float, parts: int) -> Array:
    """Follow lengths and rates (N, 6) by a controller of each leg; by the midpoint method."""
    state, legs = np.zeros(18), np.empty((len(lengths), 3, 6))
    state[:3], state[3:12] = x, r.copy().reshape(9)
    step = period / parts
    slope = np.zeros(18)
    for n in range(len(lengths)):
        turned = state[3:12].copy().reshape(3, 3)
        _, _, _, _, length, rate = _terms(h, state[:3], turned, state[12:15], state[15:])
        legs[n, 0], legs[n, 1] = length, rate
        pushed = (force + gains[0] * (lengths[n] - legs[n, 0])
                  + gains[1] * (rates[n] - legs[n, 1]))
        legs[n, 2] = pushed
        for _ in range(parts):
            for part in (0.0, 0.5 * step):
                at = state + part * slope
                turned = at[3:12].copy().reshape(3, 3)
                slope[:3] = at[12:15]
                slope[3:12] = (_skew(at[15:]) @ turned).copy().reshape(9)
                slope[12:] = _acceleration(h, at[:3], turned, at[12:15], at[15:], pushed)
            state = state + step * slope
            turned = state[3:12].copy().reshape(3, 3)  # and orthogonal again
            state[3:12] = (0.5 * turned @ (3.0 * np.eye(3) - turned.T @ turned)).reshape(9)
    return legs


class Legs(NamedTuple):
    """Lengths [m], rates [m/s] and forces [N] of the legs at some times, (N, 6) each."""

    lengths: Array
    rates: Array
    forces: Array


def moving(p: Parameters, motion: Motion) -> Legs:
    """Return the legs of a hexapod in a motion (N,)."""
    x, r, twist, acceleration = (np.ascontiguousarray(each) for each in (
        motion.position, motion.rotation, motion.rows[:, 12:18], motion.rows[:, 18:24]))
    legs = _inverse(Hexapod.of(p), x, r, np.ascontiguousarray(twist[:, :3]),
                    np.ascontiguousarray(twist[:, 3:]), acceleration)
    return Legs(*np.moveaxis(legs, 1, 0))


class Controlled:
    """
    A hexapod whose legs follow a motion, from its first pose at rest.

    Proportional and derivative control of each leg at 1 kHz; the forces are held in between.
    """

    PERIOD = 1e-3  # [s]
    PARTS = 2  # steps of the integration in a period
    GAINS = np.array([2e5, 5e3])  # [N/m], [N s/m]

    def __init__(self, p: Parameters, motion: Motion) -> None:
        target = moving(p, motion)
        still = Motion(motion.position[:1], motion.rotation[:1])
        legs = _controlled(
            Hexapod.of(p), motion.position[0].copy(), np.ascontiguousarray(motion.rotation[0]),
            target.lengths, target.rates, moving(p, still).forces[0], self.GAINS, self.PERIOD,
            self.PARTS)
        lengths, rates, self._forces = np.moveaxis(legs, 1, 0)
        times = self.PERIOD * np.arange(len(legs))
        self._middles = times + 0.5 * self.PERIOD
        self._lengths = CubicHermiteSpline(times, lengths, rates)

    def __call__(self, times: Array) -> Legs:
        """Return the legs at times [s], with the mean force of a period around each."""
        forces = [np.interp(times, self._middles, each) for each in self._forces.T]
        return Legs(self._lengths(times), self._lengths(times, 1), np.stack(forces, axis=-1))
