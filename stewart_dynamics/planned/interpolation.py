# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The motion between points: of the platform, and of legs that a controller moves.

A joint_trajectory_controller moves a leg by cubics through its lengths and rates at the points.
Position and rotation vector of the platform are polynomials of fifth degree in time (quintic
Hermite interpolation) through pose, twist and acceleration. With R = exp(skew(r)) R_0 the angular
velocity and acceleration of a rotation vector r are

    omega = J r'            alpha = J r'' + J' r'

with the left Jacobian J = 1 + a skew(r) + b skew(r)^2 of SO(3), a = (1 - cos |r|) / |r|^2 and
b = (|r| - sin |r|) / |r|^3 (J. Sola, J. Deray, D. Atchuthan, A micro Lie theory for state
estimation in robotics, 2018, arXiv:1812.01537, equation 145).
"""

from __future__ import annotations

from math import comb, factorial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, cross, Integers
from stewart_dynamics.mechanics.frames.rotation import from_quaternion, to_quaternion
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, ANGULAR_ACCELERATION, ANGULAR_VELOCITY, LINEAR_ACCELERATION, LINEAR_VELOCITY,
    MOTION, POSITION, ROTATION, TWIST)

# a, b and their derivatives (da/dt = a' (r . r'), likewise b) in powers of -|r|^2, for angles up
# to one, where the closed forms lose digits.
_TERMS = 9
_SERIES = np.array([
    [sign * many(n) / factorial(2 * n + k) for sign, k, many in (
        (1, 2, lambda n: 1), (1, 3, lambda n: 1),
        (-1, 4, lambda n: 2 * (n + 1)), (-1, 5, lambda n: 2 * (n + 1)))]
    for n in range(_TERMS)])


class Bounds(NamedTuple):
    """
    Bounds of the motion of a point in each of N intervals, each (N,).

    A deviation is from the straight line, in time, between the values at both ends. Rotations
    enter by the derivatives of the rotation vector.
    """

    path: Array  # length of the path [m]
    speed: Array  # [m/s]
    acceleration: Array  # [m/s^2]
    jerk: Array  # [m/s^3]
    position_deviation: Array  # [m]
    velocity_deviation: Array  # [m/s]
    acceleration_deviation: Array  # [m/s^2]


class Interpolation:
    """
    The motion between N + 1 points in order.

    durations (N,): from each point to the next [s], more than 0.
    motions (N + 1, MOTION): the points. Between two of them the platform takes the shorter
        rotation.
    """

    def __init__(self, durations: Array, motions: Array) -> None:
        self._durations, self._motions = durations, motions
        self._quaternions = to_quaternion(motions[:, ROTATION].reshape(-1, 3, 3))
        h = durations[:, None]
        begin, end = motions[:-1], motions[1:]
        turn = rotation_vector(self._quaternions[:-1], self._quaternions[1:])
        # At the beginning the rotation vector is zero: J = 1, and J' r' = r' x r' / 2 = 0.
        value = np.concatenate([begin[:, POSITION], np.zeros_like(turn)], axis=1)
        rate, acceleration = begin[:, TWIST], begin[:, ACCELERATION]
        turn_rate, turn_acceleration = rates_of_vector(
            turn, end[:, ANGULAR_VELOCITY], end[:, ANGULAR_ACCELERATION])
        end_value = np.concatenate([end[:, POSITION], turn], axis=1)
        end_rate = np.concatenate([end[:, LINEAR_VELOCITY], turn_rate], axis=1)
        end_acceleration = np.concatenate(
            [end[:, LINEAR_ACCELERATION], turn_acceleration], axis=1)
        # Bezier control points (N, 6, 6): of position and rotation vector.
        self._control = np.stack([
            value, value + h / 5.0 * rate,
            value + 2.0 * h / 5.0 * rate + h * h / 20.0 * acceleration,
            end_value - 2.0 * h / 5.0 * end_rate + h * h / 20.0 * end_acceleration,
            end_value - h / 5.0 * end_rate, end_value], axis=1)

    def bounds(self, arm: float) -> Bounds:
        """
        Return bounds of the motion of a point of the platform in each interval.

        arm: distance of the point from the platform's origin [m].
        """
        h = self._durations
        differences, steps = self._control, []
        for _ in range(4):
            differences = differences[:, 1:] - differences[:, :-1]
            steps.append(_length(differences, arm))
        first, second, third, fourth = (each.max(axis=1) for each in steps)
        # Derivatives of order n are 5! / (5 - n)! h^-n times the n-th differences.
        return Bounds(
            steps[0].sum(axis=1), 5.0 * first / h, 20.0 * second / h ** 2,
            60.0 * third / h ** 3, 20.0 / 8.0 * second, 60.0 / 8.0 * third / h,
            120.0 / 8.0 * fourth / h ** 2)

    def at(self, which: Integers, fraction: NDArray[np.floating[Any]]) -> Array:
        """
        Return rows of motion (M, MOTION).

        which (M,): index of the point before each row, one of the first N.
        fraction (M,): fraction of the time to the next point, 0 to 1; 0 and 1 are the points
            themselves.
        """
        h = self._durations[which][:, None]
        control = self._control[which]
        value, rate, acceleration = (
            np.einsum('mk,mkc->mc', _bernstein(degree, fraction), np.diff(
                control, n=5 - degree, axis=1)) for degree in (5, 4, 3))
        rate *= 5.0 / h
        acceleration *= 20.0 / (h * h)
        rows = motion_of(self._quaternions[which], value, rate, acceleration)
        for end in (0, 1):
            there = fraction == end
            rows[there] = self._motions[which[there] + end]
        return rows


def motion_of(quaternions: Array, value: Array, rate: Array, acceleration: Array) -> Array:
    """
    Return rows of motion (N, MOTION) of positions and rotation vectors (N, 6).

    Rates and accelerations are their derivatives in time; the rotation vectors, base axes, turn
    rotations given as quaternions (N, 4) or (1, 4).
    """
    turn, turn_rate = value[:, 3:], rate[:, 3:]
    a, b, per_a, per_b = _coefficients(turn)
    along = (turn * turn_rate).sum(axis=1, keepdims=True)
    once = cross(turn, turn_rate)
    twice = cross(turn, once)
    rows = np.empty((len(value), MOTION))
    rows[:, POSITION] = value[:, :3]
    rows[:, ROTATION] = np.stack(from_quaternion(*_turned(quaternions, turn).T), axis=1)
    rows[:, LINEAR_VELOCITY] = rate[:, :3]
    rows[:, ANGULAR_VELOCITY] = turn_rate + a * once + b * twice
    rows[:, LINEAR_ACCELERATION] = acceleration[:, :3]
    rows[:, ANGULAR_ACCELERATION] = (
        _jacobian(turn, a, b, acceleration[:, 3:])
        + per_a * along * once + per_b * along * twice + b * cross(turn_rate, once))
    return rows


_BINOMIAL = {degree: np.array([comb(degree, n) for n in range(degree + 1)], dtype=float)
             for degree in (3, 4, 5)}


def _bernstein(degree: int, fraction: NDArray[np.floating[Any]]) -> Array:
    """Return the Bernstein polynomials (M, degree + 1)."""
    power = np.arange(degree + 1)
    basis: Array = (_BINOMIAL[degree] * fraction[:, None] ** power
                    * (1.0 - fraction[:, None]) ** power[::-1])
    return basis


def _length(steps: Array, arm: float) -> Array:
    """Return a bound of how far a point at a distance moves by position and rotation (..., 6)."""
    # Four times as fast as sum().
    x, y, z, rx, ry, rz = np.moveaxis(steps * steps, -1, 0)
    length: Array = np.sqrt(x + y + z) + arm * np.sqrt(rx + ry + rz)
    return length


def _coefficients(turn: Array) -> tuple[Array, Array, Array, Array]:
    """Return a, b, a', b' of rotation vectors (N, 3), each (N, 1): see the module."""
    square = (turn * turn).sum(axis=1, keepdims=True)
    # Arguments of the unused branch are clipped to where it is finite.
    powers = np.ones((len(turn), _TERMS))
    powers[:, 1:] = -np.minimum(square, 1.0)
    # Ten times as fast as **.
    values = np.cumprod(powers, axis=1) @ _SERIES
    if float(square.max(initial=0.0)) > 1.0:
        far = np.maximum(square, 1.0)
        angle = np.sqrt(far)
        a = (1.0 - np.cos(angle)) / far
        b = (1.0 - np.sin(angle) / angle) / far
        closed = a, b, (np.sin(angle) / angle - 2.0 * a) / far, (a - 3.0 * b) / far
        values = np.where(square <= 1.0, values, np.concatenate(closed, axis=1))
    return values[:, 0:1], values[:, 1:2], values[:, 2:3], values[:, 3:4]


def _jacobian(turn: Array, a: Array, b: Array, vector: Array) -> Array:
    """Return J vector."""
    once = cross(turn, vector)
    return vector + a * once + b * cross(turn, once)


def rates_of_vector(turn: Array, omega: Array, alpha: Array) -> tuple[Array, Array]:
    """Return r' and r'' of rotation vectors (N, 3) of angles up to pi, given omega and alpha."""
    a, b, per_a, per_b = _coefficients(turn)
    half = np.full_like(a, -0.5)
    c = -per_a / (2.0 * a)  # J^-1 = 1 - skew(r) / 2 + c skew(r)^2
    rate = _jacobian(turn, half, c, omega)
    along = (turn * rate).sum(axis=1, keepdims=True)
    once = cross(turn, rate)
    left = alpha - (per_a * along * once + per_b * along * cross(turn, once)
                    + b * cross(rate, once))
    return rate, _jacobian(turn, half, c, left)


def rotation_vector(start: Array, end: Array) -> Array:
    """Return axis times angle (N, 3) [rad] of the shorter rotation between two."""
    vector = (end[:, :3] * start[:, 3:] - start[:, :3] * end[:, 3:]
              - cross(end[:, :3], start[:, :3]))
    cosine = (end * start).sum(axis=1, keepdims=True)
    sine = np.sqrt((vector * vector).sum(axis=1, keepdims=True))
    angle = 2.0 * np.arctan2(sine, np.abs(cosine))
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
    return np.where(cosine < 0.0, -scale, scale) * vector


def _turned(quaternions: Array, turn: Array) -> Array:
    """Return quaternions (N, 4) rotated by rotation vectors (N, 3), base axes."""
    angle = np.sqrt((turn * turn).sum(axis=1, keepdims=True))
    vector = 0.5 * np.sinc(angle / (2.0 * np.pi)) * turn
    cosine = np.cos(0.5 * angle)
    x, w = quaternions[:, :3], quaternions[:, 3:]
    return np.concatenate([cosine * x + w * vector + cross(vector, x),
                           cosine * w - (vector * x).sum(axis=1, keepdims=True)], axis=1)


class Cubics(NamedTuple):
    """
    Cubic polynomials of the fraction of an interval, 0 to 1; each array (N, ...).

    Rates are derivatives with respect to the fraction.
    """

    start: Array
    end: Array
    start_rate: Array
    end_rate: Array

    @classmethod
    def between(cls, values: Array, rates: Array, durations: Array) -> Cubics:
        """Return the cubics that join values and rates (N + 1, ...) of points in order."""
        return cls(values[:-1], values[1:], rates[:-1] * durations, rates[1:] * durations)

    def selected(self, which: Any) -> Cubics:
        """Return some of them: an index, or an array of indices."""
        return Cubics._make(each[which] for each in self)

    def bounds(self) -> tuple[Array, Array]:
        """Return bounds of the values: the least and the greatest of the Bezier control points."""
        inner = self.start + self.start_rate / 3.0, self.end - self.end_rate / 3.0
        low: Array = np.minimum(np.minimum(self.start, self.end), np.minimum(*inner))
        high: Array = np.maximum(np.maximum(self.start, self.end), np.maximum(*inner))
        return low, high

    def middle_rate(self) -> Array:
        """Return the middle control point of the rate; with both ends it bounds the rate."""
        return 3.0 * (self.end - self.start) - self.start_rate - self.end_rate

    def at(self, fraction: Array) -> Array:
        """Return the values at a fraction."""
        _, second, third = self._powers()
        return self.start + fraction * (self.start_rate + fraction * (second + fraction * third))

    def rate_at(self, fraction: Array) -> Array:
        """Return the rates at a fraction."""
        _, second, third = self._powers()
        return self.start_rate + fraction * (2.0 * second + fraction * 3.0 * third)

    def extrema(self) -> tuple[Array, Array]:
        """Return the fractions of minimum and maximum; nan where it is not inside (0, 1)."""
        first, second, third = self._powers()
        with np.errstate(all='ignore'):
            # The roots of first + 2 second u + 3 third u^2, without cancellation.
            root = np.sqrt(second * second - 3.0 * third * first)
            s = -(second + np.copysign(root, second))
            return _inside(s / (3.0 * third)), _inside(first / s)

    def rate_extremum(self) -> Array:
        """Return the fraction of the least or greatest rate; nan where not inside (0, 1)."""
        _, second, third = self._powers()
        with np.errstate(all='ignore'):
            return _inside(-second / (3.0 * third))

    def root(self) -> float:
        """Return the fraction at which a single cubic that ends below zero crosses zero."""
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            if float(self.at(np.array(middle))) > 0.0:
                low = middle
            else:
                high = middle
        return low

    def _powers(self) -> tuple[Array, Array, Array]:
        """Return the coefficients of the first, second and third power."""
        with np.errstate(invalid='ignore'):  # infinite ends: no extremum is inside
            difference = self.end - self.start
        return (self.start_rate, 3.0 * difference - 2.0 * self.start_rate - self.end_rate,
                self.start_rate + self.end_rate - 2.0 * difference)


def _inside(fraction: Array) -> Array:
    inside: Array = np.where((fraction > 0.0) & (fraction < 1.0), fraction, np.nan)
    return inside
