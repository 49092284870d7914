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
Motion between points: the platform's by pose, twist and acceleration, a leg's by length and rate.

Position and rotation vector are polynomials of fifth degree in time (quintic Hermite). With
R = exp(skew(r)) R_0 the twist and acceleration of a rotation vector r are

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

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.mechanics.rotation import from_quaternion
from stewart_dynamics.mechanics.rows import MOTION

# a, b and their derivatives (da/dt = a' (r . r'), likewise b) in powers of -|r|^2, for angles up
# to one, where the closed forms lose digits.
_POWERS = np.arange(9)
_SERIES = [np.array([sign * factor(n) / factorial(2 * n + k) for n in _POWERS.tolist()])
           for sign, k, factor in (
    (1, 2, lambda n: 1), (1, 3, lambda n: 1),
    (-1, 4, lambda n: 2 * (n + 1)), (-1, 5, lambda n: 2 * (n + 1)))]


class Interpolation:
    """
    The motion between N + 1 points one after the other.

    Parameters
    ----------
    durations : (N,)
        From each point to the next [s], more than 0.
    motions : (N + 1, MOTION)
        The points.
    quaternions : (N + 1, 4)
        Unit quaternions x y z w of their rotations. Between two points the platform turns the
        short way.

    """

    def __init__(self, durations: Array, motions: Array, quaternions: Array) -> None:
        self._durations, self._motions, self._quaternions = durations, motions, quaternions
        h = durations[:, None]
        turn = _rotation_vector(quaternions[:-1], quaternions[1:])
        # At its beginning the rotation vector is zero: J = 1, and J' r' = r' x r' / 2 = 0.
        start = [np.concatenate([motions[:-1, 0:3], np.zeros_like(turn)], axis=1),
                 motions[:-1, 12:18], motions[:-1, 18:24]]
        turn_rate, turn_acceleration = _rates_of_vector(
            turn, motions[1:, 15:18], motions[1:, 21:24])
        end = [np.concatenate([motions[1:, 0:3], turn], axis=1),
               np.concatenate([motions[1:, 12:15], turn_rate], axis=1),
               np.concatenate([motions[1:, 18:21], turn_acceleration], axis=1)]
        # Control points of Bezier's form (N, 6, 6): of position and rotation vector.
        self._control = np.stack([
            start[0], start[0] + h / 5.0 * start[1],
            start[0] + 2.0 * h / 5.0 * start[1] + h * h / 20.0 * start[2],
            end[0] - 2.0 * h / 5.0 * end[1] + h * h / 20.0 * end[2],
            end[0] - h / 5.0 * end[1], end[0]], axis=1)

    def reach(self, arm: float) -> Array:
        """Return how far, at most, a point of the platform at this distance [m] goes (N,) [m]."""
        way: Array = _length(np.diff(self._control, axis=1), arm).sum(axis=1)
        return way

    def bend(self, arm: float) -> Array:
        """
        Return how far, at most, the acceleration of such a point is from a straight line.

        (N,) [m/s^2]: from what its values at the two points, joined by a line, would have it;
        without the terms of the angular velocity.
        """
        h = self._durations[:, None, None]
        acceleration = 20.0 * np.diff(self._control, n=2, axis=1) / (h * h)
        line = acceleration[:, :1] + (acceleration[:, 3:] - acceleration[:, :1]) * _THIRDS
        bend: Array = _length(acceleration[:, 1:3] - line, arm).max(axis=1)
        return bend

    def at(self, which: Integers, part: NDArray[np.floating[Any]]) -> Array:
        """
        Return rows of motion (M, MOTION).

        Parameters
        ----------
        which : (M,)
            Behind which of the first N points.
        part : (M,)
            How much of the way to the next one is done, 0 to 1; at 0 and 1 the points themselves.

        """
        h = self._durations[which][:, None]
        control = self._control[which]
        value, rate, acceleration = (
            np.einsum('mk,mkc->mc', _bernstein(degree, part), np.diff(
                control, n=5 - degree, axis=1)) for degree in (5, 4, 3))
        rate *= 5.0 / h
        acceleration *= 20.0 / (h * h)
        turn, turn_rate = value[:, 3:], rate[:, 3:]
        a, b, a_rate, b_rate = _coefficients(turn, turn_rate)
        once = _cross(turn, turn_rate)
        twice = _cross(turn, once)
        omega = turn_rate + a * once + b * twice
        alpha = (_jacobian(turn, a, b, acceleration[:, 3:])
                 + a_rate * once + b_rate * twice + b * _cross(turn_rate, once))
        rows = np.empty((len(part), MOTION))
        rows[:, 0:3] = value[:, :3]
        rows[:, 3:12] = np.stack(
            from_quaternion(*_turned(self._quaternions[which], turn).T), axis=1)
        rows[:, 12:15], rows[:, 15:18] = rate[:, :3], omega
        rows[:, 18:21], rows[:, 21:24] = acceleration[:, :3], alpha
        for end in (0, 1):
            there = part == end
            rows[there] = self._motions[which[there] + end]
        return rows


class Cubics(NamedTuple):
    """Polynomials of third degree of a part, 0 to 1, in Hermite's form; each array (N, ...)."""

    start: Array
    end: Array
    start_rate: Array
    end_rate: Array

    @classmethod
    def between(cls, values: Array, rates: Array, durations: Array) -> Cubics:
        """Return those that join values and rates (N + 1, ...)."""
        return cls(values[:-1], values[1:], rates[:-1] * durations, rates[1:] * durations)

    def chosen(self, which: Any) -> Cubics:
        """Return some of them: an index, or an array of such."""
        return Cubics._make(each[which] for each in self)

    def hull(self) -> tuple[Array, Array]:
        """Return bounds: the least and the largest of the control points of Bezier's form."""
        inner = self.start + self.start_rate / 3.0, self.end - self.end_rate / 3.0
        low: Array = np.minimum(np.minimum(self.start, self.end), np.minimum(*inner))
        high: Array = np.maximum(np.maximum(self.start, self.end), np.maximum(*inner))
        return low, high

    def middle_rate(self) -> Array:
        """Return the control point between the rates at both ends, with them a bound of all."""
        return 3.0 * (self.end - self.start) - self.start_rate - self.end_rate

    def at(self, part: Array) -> Array:
        """Return the values at a part."""
        _, second, third = self._powers()
        return self.start + part * (self.start_rate + part * (second + part * third))

    def rate_at(self, part: Array) -> Array:
        """Return the derivatives at a part."""
        _, second, third = self._powers()
        return self.start_rate + part * (2.0 * second + part * 3.0 * third)

    def extremes(self) -> tuple[Array, Array]:
        """Return where they are least or largest within; nan where they are not."""
        first, second, third = self._powers()
        with np.errstate(all='ignore'):
            # the roots of first + 2 second u + 3 third u^2, without a difference of like numbers
            root = np.sqrt(second * second - 3.0 * third * first)
            s = -(second + np.copysign(root, second))
            return _inside(s / (3.0 * third)), _inside(first / s)

    def fastest(self) -> Array:
        """Return where the derivatives are least or largest within; nan where they are not."""
        _, second, third = self._powers()
        with np.errstate(all='ignore'):
            return _inside(-second / (3.0 * third))

    def zero(self) -> float:
        """Return where one of them that changes its sign is zero."""
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            if float(self.at(np.array(middle))) > 0.0:
                low = middle
            else:
                high = middle
        return low

    def _powers(self) -> tuple[Array, Array, Array]:
        way = self.end - self.start
        return (self.start_rate, 3.0 * way - 2.0 * self.start_rate - self.end_rate,
                self.start_rate + self.end_rate - 2.0 * way)


def _inside(part: Array) -> Array:
    inside: Array = np.where((part > 0.0) & (part < 1.0), part, np.nan)
    return inside


_THIRDS = np.array([[1.0 / 3.0], [2.0 / 3.0]])
_BINOMIAL = {degree: np.array([comb(degree, n) for n in range(degree + 1)], dtype=float)
             for degree in (3, 4, 5)}


def _bernstein(degree: int, part: NDArray[np.floating[Any]]) -> Array:
    """Return Bernstein's polynomials (M, degree + 1)."""
    power = np.arange(degree + 1)
    basis: Array = (_BINOMIAL[degree] * part[:, None] ** power
                    * (1.0 - part[:, None]) ** power[::-1])
    return basis


def _length(ways: Array, arm: float) -> Array:
    """Return how far a point at a distance goes by ways (..., 6) of position and turn."""
    length: Array = np.sqrt((ways[..., :3] ** 2).sum(axis=-1)) + arm * np.sqrt(
        (ways[..., 3:] ** 2).sum(axis=-1))
    return length


def _cross(a: Array, b: Array) -> Array:
    """Return a x b of rows (N, 3); numpy's own takes ten times as long."""
    c = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        c[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return c


def _coefficients(turn: Array, rate: Array | None = None) -> tuple[Array, Array, Array, Array]:
    """Return a, b of rotation vectors (N, 3) and their rates, each (N, 1); see above."""
    square = (turn * turn).sum(axis=1, keepdims=True)
    along = 1.0 if rate is None else (turn * rate).sum(axis=1, keepdims=True)
    # where it is not used the argument is any that gives numbers
    near = np.minimum(square, 1.0)
    powers = (-near) ** _POWERS
    series = [powers @ each[:, None] for each in _SERIES]
    if float(square.max(initial=0.0)) > 1.0:
        far = np.maximum(square, 1.0)
        angle = np.sqrt(far)
        a = (1.0 - np.cos(angle)) / far
        b = (1.0 - np.sin(angle) / angle) / far
        closed = a, b, (np.sin(angle) / angle - 2.0 * a) / far, (a - 3.0 * b) / far
        series = [np.where(square <= 1.0, *both) for both in zip(series, closed, strict=True)]
    a, b, a_rate, b_rate = series
    return a, b, a_rate * along, b_rate * along


def _jacobian(turn: Array, a: Array, b: Array, vector: Array) -> Array:
    """Return J vector."""
    once = _cross(turn, vector)
    return vector + a * once + b * _cross(turn, once)


def _rates_of_vector(turn: Array, omega: Array, alpha: Array) -> tuple[Array, Array]:
    """Return r' and r'' of rotation vectors (N, 3) that turn with this; angles at most pi."""
    a, _, per_angle, _ = _coefficients(turn)
    c = -per_angle / (2.0 * a)  # J^-1 = 1 - skew(r) / 2 + c skew(r)^2
    rate = _jacobian(turn, np.full_like(a, -0.5), c, omega)
    _, b, a_rate, b_rate = _coefficients(turn, rate)
    once = _cross(turn, rate)
    left = alpha - (a_rate * once + b_rate * _cross(turn, once) + b * _cross(rate, once))
    return rate, _jacobian(turn, np.full_like(a, -0.5), c, left)


def _rotation_vector(start: Array, end: Array) -> Array:
    """Return axis times angle (N, 3) [rad] from one orientation to the other, the short way."""
    vector = (end[:, :3] * start[:, 3:] - start[:, :3] * end[:, 3:]
              - _cross(end[:, :3], start[:, :3]))
    cosine = (end * start).sum(axis=1, keepdims=True)
    sine = np.sqrt((vector * vector).sum(axis=1, keepdims=True))
    angle = 2.0 * np.arctan2(sine, np.abs(cosine))
    scale = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
    return np.where(cosine < 0.0, -scale, scale) * vector


def _turned(quaternions: Array, turn: Array) -> Array:
    """Return quaternions (N, 4) turned by rotation vectors (N, 3), base axes."""
    angle = np.sqrt((turn * turn).sum(axis=1, keepdims=True))
    vector = 0.5 * np.sinc(angle / (2.0 * np.pi)) * turn
    cosine = np.cos(0.5 * angle)
    x, w = quaternions[:, :3], quaternions[:, 3:]
    return np.concatenate([cosine * x + w * vector + _cross(vector, x),
                           cosine * w - (vector * x).sum(axis=1, keepdims=True)], axis=1)
