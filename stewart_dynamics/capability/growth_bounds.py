# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Bounds of rates, forces and torques between two factors of a motion that grows.

Without Coulomb friction each of these quantities is an analytic function g of the factor k by
which displacement, rates and accelerations from a center grow. The equations of motion, evaluated
with discs in place of numbers (``Disc``), bound its change on a disc of complex factors about k0.
Between two factors h apart the disc of radius h / 2 bounds g. For small h it is better to bound
the distance from the chord, ``h^2 max|g''| / 8``: where g changes by at most D on a disc of radius
h / 2 + rho, ``|g''| <= 2 D / rho^2`` between the factors (Cauchy's estimate).

On the disc of radius r about k0, with displacement k d and rotation vector k phi:

- a vector a that turns with the platform changes by at most
  ``(exp(r |phi|) - 1) |phi x a| / |phi|``, and a leg's l by at most ``r max|d + phi x a|``;
- d omega / dk = R phi', and d alpha / dk = R phi'' + omega x (R phi'), with R = exp(skew(k phi));
- J is J_inv, or J_q where screws turn with their legs (``drives.screws``):
  ``J = (1 + z M + Q J0^-1) J0`` with M = J' J0^-1 at k0, and rows q_i of Q. The forces f under
  a wrench W solve J^T f = W. Where W changes by w, f_i changes by at most
  ``|A_i| |w| + (r |M_i| + |A_i| |q|) |f|`` with the columns A_i of J0^-1, M_i of M; and
  ``|f| <= (|f(k0)| + |A| |w|) / (1 - kappa)``, ``kappa = r |M| + |A| |q| < 1`` (Frobenius norms).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE_ACCELERATION, BASE_ANGULAR_ACCELERATION,
    BASE_ANGULAR_VELOCITY, BASE_AXIS, GRAVITY, LINEAR_ACCELERATION, LINEAR_VELOCITY, PITCH,
    PLATFORM_AXIS, POSITION, ROTATION)
from stewart_dynamics.parameters.table import inertia_matrix, Parameters


def size(values: Array) -> Array:
    """Return magnitudes (N, M) of numbers (N, M) or vectors (3, N, M)."""
    if values.ndim < 3:
        return np.abs(values)
    x, y, z = values
    length: Array = np.sqrt(x * x + y * y + z * z)
    return length


def cross(a: Array, b: Array) -> Array:
    """Return a x b of vectors (3, N, M)."""
    return np.stack(np.broadcast_arrays(
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


class Disc:
    """
    Complex numbers or vectors within a distance from a real center: circular arithmetic.

    Sums and products of discs contain the sums and products of all their numbers. Of vectors,
    numbers are multiplied as ``sum a_k b_k``, without conjugation, so that the results are
    analytic; ``|a . b|`` and ``|a x b|`` are at most ``|a| |b|`` all the same.

    center (N, M) or (3, N, M): numbers, or vectors.
    radius (N, M): distance; 0 by default.
    """

    def __init__(self, center: Array, radius: Array | float = 0.0) -> None:
        self.center, self.radius, self._size = center, np.asarray(radius), size(center)

    @property
    def largest(self) -> Array:
        """Return the largest magnitude."""
        largest: Array = self._size + self.radius
        return largest

    def __add__(self, other: Disc | Array) -> Disc:
        """Return the sum."""
        other = _disc(other)
        return Disc(self.center + other.center, self.radius + other.radius)

    def __sub__(self, other: Disc | Array) -> Disc:
        """Return the difference."""
        other = _disc(other)
        return Disc(self.center - other.center, self.radius + other.radius)

    def __mul__(self, other: Disc | Array | float) -> Disc:
        """Return the product of two numbers, or of a number and a vector."""
        other = _disc(other)
        return self._product(self.center * other.center, other)

    def dot(self, other: Disc) -> Disc:
        """Return the scalar product of two vectors."""
        return self._product((self.center * other.center).sum(axis=0), other)

    def cross(self, other: Disc | Array) -> Disc:
        """Return the vector product."""
        other = _disc(other)
        return self._product(cross(self.center, other.center), other)

    def _product(self, center: Array, other: Disc) -> Disc:
        return Disc(center, self._size * other.radius + self.radius * (other._size + other.radius))

    def inverse(self) -> Disc:
        """Return 1 / number; of infinite or undefined radius where the disc contains zero."""
        left = self._size - self.radius
        return Disc(1.0 / self.center, np.where(
            left > 0.0, self.radius / (self._size * left), np.inf))

    def length(self) -> tuple[Disc, Disc]:
        """Return the root L of ``v . v`` of vectors, and 1 / L; not finite where it may be 0."""
        # v . v is within 2 L r + r^2 of L^2; the roots differ most on the side of zero
        shortest = np.sqrt(self._size ** 2 - self.radius * (2.0 * self._size + self.radius))
        return (Disc(self._size, self._size - shortest),
                Disc(1.0 / self._size, 1.0 / shortest - 1.0 / self._size))

    def total(self) -> Disc:
        """Return the sum over the last axis, kept."""
        return Disc(self.center.sum(axis=-1, keepdims=True),
                    self.radius.sum(axis=-1, keepdims=True))


def _disc(value: Disc | Array | float) -> Disc:
    return value if isinstance(value, Disc) else Disc(np.asarray(value))


# Discs reach to this part of the radius at which kappa is 1 to first order; from a thousand widths
# of the interval on, a larger one would make no difference.
_PART, _WIDEST = 0.2, 1e3


class GrowthBounds:
    """
    Bounds for a hexapod, of Q quantities: two, six with motors.

    Rates and forces of the legs; speeds of the motors, loads of the screws, and torques with both
    factors of ``MotorBounds``.
    """

    def __init__(self, parameters: Parameters, motors: MotorBounds | None, screws: Array) -> None:
        self._p, self._motors, self._screws = parameters, motors, screws
        self._inertia = inertia_matrix(parameters['platform.inertia'])

    def __call__(self, rows: Array, forces: Array, per_load: Array, changes: Array, base: Array,
                 widths: Array, chord: bool) -> Array:
        """
        Return bounds of the distance from the values in the middle of intervals (N, Q, 6).

        Infinite where unknown.

        rows (N, MOTION): rows of motion in the middle of the intervals.
        forces, per_load (N, 6): leg forces there, without Coulomb friction, and those under a unit
            load.
        changes (N, 3, 6): displacement, rate and acceleration for k = 1.
        base (N, BASE): motion of the base.
        widths (N,): widths of the intervals.
        chord: bounds are those of the distance from the chord instead.
        """
        at = lagrange.unchecked_legs(
            self._p, rows[:, POSITION], rotation := rows[:, ROTATION].reshape(-1, 3, 3))
        with np.errstate(all='ignore'):
            relative = lagrange.drive_jacobian_rate(
                at, rotation, changes[:, 0, :3], changes[:, 0, 3:], self._screws
                ) @ np.linalg.inv(lagrange.drive_jacobian(at, rotation, self._screws))
            if not chord:
                return self._radii(rows, at, relative, forces, per_load, changes, base,
                                   0.5 * widths[:, None])
            rho = _PART * np.minimum(1.0 / np.linalg.norm(relative, axis=(1, 2)) - 0.5 * widths,
                                     _WIDEST * widths)
            radii = self._radii(rows, at, relative, forces, per_load, changes, base,
                                (0.5 * widths + rho)[:, None])
            bows = 0.25 * ((widths / rho) ** 2)[:, None, None] * radii
            return np.where(rho[:, None, None] > 0.0, bows, np.inf)

    def _radii(self, rows: Array, at: lagrange.Legs, relative: Array, forces: Array,
               per_load: Array, changes: Array, base: Array, r: Array) -> Array:
        """Return the largest change of the quantities on discs of radius r (N, 1)."""
        p, size_of_hexapod = self._p, self._p['singularity.characteristic_length']
        (_, shift_rate, shift_acc), (phi, phi_rate, phi_acc) = (
            np.moveaxis(np.linalg.norm(changes[:, :, part], axis=2), 1, 0)[..., None]
            for part in (slice(0, 3), slice(3, 6)))
        shift, turn = (Disc(_vectors(changes[:, 0, part])) for part in (
            slice(0, 3), slice(3, 6)))
        growth = np.exp(r * phi)
        position = Disc(_vectors(rows[:, POSITION]), r * shift.largest)
        velocity = Disc(_vectors(rows[:, LINEAR_VELOCITY]), r * shift_rate)
        acceleration = Disc(_vectors(rows[:, LINEAR_ACCELERATION]), r * shift_acc)
        omega = Disc(_vectors(rows[:, ANGULAR_VELOCITY]), r * growth * phi_rate)
        alpha = Disc(_vectors(rows[:, ANGULAR_ACCELERATION]),
                     r * growth * (phi_acc + omega.largest * phi_rate))
        gravity, origin, spin, spin_rate = (Disc(_vectors(base[:, part])) for part in (
            GRAVITY, BASE_ACCELERATION, BASE_ANGULAR_VELOCITY, BASE_ANGULAR_ACCELERATION))
        rotation = rows[:, ROTATION].reshape(-1, 3, 3)

        def turning(vectors: Array) -> tuple[Disc, Disc, Disc]:
            """Return vectors that turn with the platform, and their derivatives."""
            vector = Disc(vectors, np.where(phi > 0.0, (growth - 1.0) / phi, 0.0) * size(
                cross(turn.center, vectors)))
            rate = omega.cross(vector)
            return vector, rate, alpha.cross(vector) + omega.cross(rate)

        def carried(vector: Disc, rate: Disc, acc: Disc) -> Disc:
            """Return the second derivative of a vector whose derivatives are on the base."""
            return acc + spin_rate.cross(vector) + spin.cross(spin.cross(vector) + rate * 2.0)

        def momentum(vectors: Disc) -> Disc:
            """Return the platform's inertia times vectors."""
            inertia = rotation @ self._inertia @ np.swapaxes(rotation, 1, 2)
            return Disc(np.einsum('nij,jnk->ink', inertia, vectors.center), np.linalg.norm(
                self._inertia, 2) * (growth ** 2 * vectors.largest - size(vectors.center)))

        # direction and length of the legs, and their derivatives
        arm, arm_rate, arm_acc = turning(np.moveaxis(at.arms, 2, 0))
        joint = Disc(p['geometry.base_joints'].T[:, None])
        x_rate, x_acc = velocity + arm_rate, acceleration + arm_acc
        line_change = shift + turn.cross(arm)  # by k
        line = Disc((position + arm - joint).center, r * line_change.largest)
        length, inverse = line.length()
        s = line * inverse
        s_change = (line_change - s * s.dot(line_change)) * inverse
        s = Disc(s.center, np.fmin(s.radius, r * s_change.largest))
        rate = s.dot(x_rate)
        s_rate = (x_rate - s * rate) * inverse
        acc = s.dot(x_acc) + length * s_rate.dot(s_rate)
        s_acc = (x_acc - s * acc - s_rate * rate * 2.0) * inverse

        # forces on them at the platform joints, by the accelerations of cylinder and piston
        still = joint * 0.0
        felt = origin - gravity + carried(joint, still, still)
        turned = carried(s, s_rate, s_acc)
        of_cylinder = felt + turned * p['legs.cylinder.center_of_mass']
        distance = length - p['legs.piston.center_of_mass']
        of_piston = felt + carried(s * distance, s * rate + s_rate * distance,
                                   s * acc + s_rate * rate * 2.0 + s_acc * distance)
        moment = s.cross(
            of_cylinder * (p['legs.cylinder.mass'] * p['legs.cylinder.center_of_mass'])
            + of_piston * distance * p['legs.piston.mass']
            + turned * (p['legs.cylinder.inertia'] + p['legs.piston.inertia']))
        on_leg = s * s.dot(of_piston) * p['legs.piston.mass'] + moment.cross(s) * inverse

        # wrench on platform and legs
        center, center_rate, center_acc = turning(_vectors(
            rotation @ p['platform.center_of_mass']))
        on_platform = (origin - gravity + carried(
            position + center, velocity + center_rate, acceleration + center_acc)
            ) * p['platform.mass']
        torque = center.cross(on_platform) + (omega + spin).cross(momentum(omega + spin)) + (
            momentum(alpha + spin_rate + spin.cross(omega)))
        wrench = np.hypot((on_platform + on_leg.total()).radius,
                          (torque + arm.cross(on_leg).total()).radius / size_of_hexapod)

        # rates, forces, speeds and torques
        viscous, mass = p['actuator.viscous_friction'], p['actuator.reflected_mass']
        row_change = s_change, turn.cross(arm).cross(s) + arm.cross(s_change)
        leg_rate = rate
        if self._screws.any():
            twist_rate, twist_acc = self._twist(rotation, turning, s, s_rate, s_acc)
            pitch = self._screws[:, PITCH]
            rate, acc = rate + twist_rate * pitch, acc + twist_acc * pitch
            row_change = self._turning_row(rotation, turning, turn, arm, s, s_change, inverse,
                                           line_change)
        q = r * np.hypot(row_change[0].radius, row_change[1].radius / size_of_hexapod)
        columns = r * np.linalg.norm(relative, axis=1)
        kappa = _norm(columns) + _norm(per_load) * _norm(q)
        at_middle = _norm(forces - viscous * rate.center - mass * acc.center)
        strongest = (at_middle + _norm(per_load) * wrench) / (1.0 - kappa)
        load = viscous * rate.radius + per_load * wrench + (
            columns + per_load * _norm(q)) * strongest
        found = [leg_rate.radius, load + mass * acc.radius]
        if self._motors is not None:
            ratio = self._motors.ratio
            own = self._motors.inertia * (ratio * acc.radius)
            found += [ratio * rate.radius, load,
                      *(own + np.abs(scale) * load for scale in self._motors.scales)]
        radii = np.stack(found, axis=1)
        return np.where((kappa < 1.0)[:, None] & np.isfinite(radii), radii, np.inf)

    def _twist(self, rotation: Array, turning: Callable[[Array], tuple[Disc, Disc, Disc]],
               s: Disc, s_rate: Disc, s_acc: Disc) -> tuple[Disc, Disc]:
        """Return rate and acceleration of the twist of ``leg_twist``."""
        u = Disc(self._screws[:, BASE_AXIS].T[:, None])
        w, w_rate, w_acc = turning(np.einsum(
            'nij,kj->ink', rotation, self._screws[:, PLATFORM_AXIS]))
        normal, normal_rate, normal_acc = u.cross(w), u.cross(w_rate), u.cross(w_acc)
        y = s.dot(normal)
        y_rate = s_rate.dot(normal) + s.dot(normal_rate)
        y_acc = s_acc.dot(normal) + s_rate.dot(normal_rate) * 2.0 + s.dot(normal_acc)
        u_s, u_s_rate, u_s_acc = u.dot(s), u.dot(s_rate), u.dot(s_acc)
        w_s, w_s_rate = w.dot(s), w_rate.dot(s) + w.dot(s_rate)
        w_s_acc = w_acc.dot(s) + w_rate.dot(s_rate) * 2.0 + w.dot(s_acc)
        x = u.dot(w) - u_s * w_s
        x_rate = u.dot(w_rate) - u_s_rate * w_s - u_s * w_s_rate
        x_acc = u.dot(w_acc) - u_s_acc * w_s - u_s_rate * w_s_rate * 2.0 - u_s * w_s_acc
        inverse = (x * x + y * y).inverse()
        rate = (x * y_rate - y * x_rate) * inverse
        acc = (x * y_acc - y * x_acc - (x * x_rate + y * y_rate) * rate * 2.0) * inverse
        return rate, acc

    def _turning_row(self, rotation: Array, turning: Callable[[Array], tuple[Disc, Disc, Disc]],
                     turn: Disc, arm: Disc, s: Disc, s_change: Disc, inverse: Disc,
                     line_change: Disc) -> tuple[Disc, Disc]:
        """Return the derivative by k of a row of J_q, in halves, as in ``drive_jacobian_rate``."""
        pitch = self._screws[:, PITCH]
        u = Disc(self._screws[:, BASE_AXIS].T[:, None])
        w, _, _ = turning(np.einsum('nij,kj->ink', rotation, self._screws[:, PLATFORM_AXIS]))
        arm_change, w_change = turn.cross(arm), turn.cross(w)
        one = Disc(np.ones(()))

        def factors(c: Disc, c_change: Disc) -> tuple[Disc, Disc, Disc]:
            """Return 1 / (1 - c^2), c / (1 - c^2) and its derivative."""
            across = (one - c * c).inverse()
            return across, c * across, c_change * (one + c * c) * across * across

        u_s, w_s, w_s_change = u.dot(s), w.dot(s), w_change.dot(s) + w.dot(s_change)
        _, of_u, of_u_change = factors(u_s, u.dot(s_change))
        across, of_w, of_w_change = factors(w_s, w_s_change)
        inner = s.cross(u) * of_u - s.cross(w) * of_w
        inner_change = (
            s.cross(u) * of_u_change + s_change.cross(u) * of_u - s.cross(w) * of_w_change
            - (s_change.cross(w) + s.cross(w_change)) * of_w)
        h = s + inner * inverse * pitch
        h_change = s_change + (
            inner_change - inner * (s.dot(line_change) * inverse)) * inverse * pitch
        d = (s - w * w_s) * across
        d_change = (s_change - w * w_s_change - w_change * w_s
                    + d * (w_s * w_s_change * 2.0)) * across
        return h_change, arm_change.cross(h) + arm.cross(h_change) + d_change * pitch


def _norm(values: Array) -> Array:
    """Return the norm (N, 1) of six numbers."""
    norm: Array = np.linalg.norm(values, axis=1, keepdims=True)
    return norm


def _vectors(rows: Array) -> Array:
    """Return vectors (N, 3) as (3, N, 1)."""
    return rows.T[..., None]
