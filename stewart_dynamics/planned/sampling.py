# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The number of samples between two points of a planned trajectory.

Enough that neither the largest force nor a length or rate past a limit is missed by more than
1 %. Between two samples, a quantity q(u), u from 0 to 1 between the points, deviates from the
straight line by at most |q''| / (8 n^2) if the interval has n parts. Positions, rates and efforts
of the drives are bounded so from those at the points and from the derivatives of the platform's
motion, with the inertia of the platform and its legs, the reflected masses and the friction of the
actuators. An interval whose bounds stay below the limits and below the largest effort that is
already known needs no samples. For telescopic legs these are lengths, rates and forces.

Where levers change, samples are so close that none does by more than a part of itself.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.legs.kind import IntervalBounds
from stewart_dynamics.mechanics.batch import lever_squares
from stewart_dynamics.mechanics.drives.motor_limits import force_limits, rate_limits
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.limits import LIMITS, Limits
from stewart_dynamics.mechanics.rows import BASE_ANGULAR_VELOCITY, CONDITION, UNIT_LOAD_FORCES
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.planned.interpolation import Bounds, Interpolation

# Relative, of the largest effort and of its limit.
TOLERANCE = 0.005
# Between two samples, a point of the platform at the characteristic length from its origin moves
# by at most this part of that length.
_STEP = 0.01
# Between two samples a lever changes by at most about this part of itself.
_OF_LEVER = 0.15
# Bounds of levers come nearer than this part to the smaller lever at both ends of a part of an
# interval; the number of parts of a part that does not, and how often it is divided.
_NEAR, _DIVIDED, _DEPTH = 0.5, 8, 5
_MOST_DIVIDED = 4096  # parts that are looked at together; more than intervals need in practice
_BELOW = 0.09  # square of a lever that is far from a dead centre
# At nearly one pose, forces are polynomials of at most 8th degree of time between two points: by
# Markov's inequality this number of parts finds their largest value to 1 %.
_ENOUGH = 64
# Smallest force that matters at high speeds, as a part of the force that the motors hold at rest.
_LEAST = 0.05
# Smallest number of parts of an interval that needs samples: cubics join lengths and rates at the
# samples, and their error is then below 1e-3.
_FEWEST = 16


class Sampling:
    """
    The number of samples that the trajectories of a hexapod need.

    tolerance: part of the largest effort and of a limit by which an effort may be missed.
    """

    def __init__(self, parameters: Parameters, tolerance: float = TOLERANCE) -> None:
        self._tolerance = tolerance
        self._arm = arm = parameters.singularity.characteristic_length
        self._limits = Limits(parameters)
        self._friction = Friction.of(parameters)
        self._parameters, self._kind = parameters, parameters.leg_kind
        # Rates above which a drive or its motor may exceed a limit.
        self._fastest = self._limits.thresholds[self._kind.rate_limit]
        if parameters.drives:
            self._fastest = np.minimum(self._fastest, rate_limits(parameters))
        # Largest speed of a platform joint at a speed |v| + arm |w| of the platform.
        radii = np.linalg.norm(parameters.geometry.platform_joints, axis=1)
        self._lever = np.maximum(1.0, radii / arm)
        # Largest wrench |F| + |N| / arm at an acceleration |a| + arm |alpha| of the platform.
        offset = float(np.linalg.norm(parameters.carried.center)) / arm
        xx, _, _, yy, _, zz = parameters.carried.inertia
        self._platform_mass = (parameters.carried.mass * (1.0 + offset) ** 2
                               + float(xx + yy + zz) / arm ** 2)

    def parts(self, durations: Array, between: Interpolation, motions: Array, results: Array,
              drive_rates: Array, bases: Array | None, largest: float) -> Array:
        """
        Return the number of parts in which each of N intervals is sampled (N,).

        durations, between (N,), Interpolation: durations of the intervals [s], motion in them.
        motions, results (N + 1, MOTION), (N + 1, RESULT): rows of motion, and results, at the
            points.
        drive_rates (N + 1, 6): rates of the drives at the points [m/s] or [rad/s].
        bases (N + 1, BASE) or (1, BASE): rows of the base's motion at the points; the base is at
            rest by default.
        largest: absolute effort that is known to occur in the trajectory [N] or [N m].
        """
        bounds = between.bounds(self._arm)
        squares = self._squares_of_levers(durations, bounds, between, motions)
        legs = self._kind.bound_intervals(
            self._parameters, results, np.abs(squares), self._lever)
        # Accelerations of the joints and along the legs due to speed.
        inverse_radius = 1.0 / self._arm + legs.bends
        steps = np.maximum(bounds.path / (_STEP * self._arm),
                           bounds.path * legs.turning / _OF_LEVER)
        forces = self._force_parts(
            durations, bounds, legs, inverse_radius, results, drive_rates, bases, largest)
        cubics = self._may_exceed_limits(
            durations, bounds, legs, inverse_radius, results, squares)
        parts: Array = np.maximum(np.maximum(np.ceil(steps), forces),
                                  np.where(cubics, float(_FEWEST), 1.0))
        return parts

    def _squares_of_levers(self, durations: Array, bounds: Bounds, between: Interpolation,
                           motions: Array) -> Array:
        """
        Return lower bounds (N, 6) of the squares of levers, by their largest ones.

        Minus _BELOW where a lever certainly is below its limit: no fine samples are needed then.
        """
        kind, p, found = self._kind, self._parameters, np.ones((len(durations), 6))
        if not kind.lever_limit:
            return found
        limit = self._limits.thresholds[kind.lever_limit] ** 2
        which, begin = np.arange(len(durations)), np.zeros(len(durations))
        rows, ends, ways = motions[:-1], motions[1:], bounds.path
        for depth in range(_DEPTH + 1):
            width = _DIVIDED ** -float(depth)
            if depth:
                rows, ends = between.at(which, begin), between.at(which, begin + width)
                ways = bounds.speed[which] * durations[which] * width
            least = kind.least_levers(p, rows, ends, ways[:, None] * self._lever)
            smaller = np.minimum(*(lever_squares(p.structure, each)[0] for each in (rows, ends)))
            low = smaller < limit
            divided = (least < _NEAR ** 2 * smaller).any(axis=1) & (depth < _DEPTH)
            np.minimum.at(found, which[~divided], np.maximum(least[~divided], 0.0))
            np.minimum.at(found, which, np.where(low, -_BELOW, 1.0))
            divided &= (found[which] >= 0.0).all(axis=1)
            if not divided.any():
                break
            if _DIVIDED * np.count_nonzero(divided) > max(_MOST_DIVIDED, 2 * len(durations)):
                np.minimum.at(found, which[divided], np.maximum(least[divided], 0.0))
                break
            parts = np.arange(_DIVIDED) * width / _DIVIDED
            which, begin = np.repeat(which[divided], _DIVIDED), (
                begin[divided, None] + parts).ravel()
        return found

    def _may_exceed_limits(self, durations: Array, bounds: Bounds, legs: IntervalBounds,
                           inverse_radius: Array, results: Array, squares: Array) -> Flags:
        """Return in which intervals a position, a rate or a lever may exceed its limit (N,)."""
        kind, square = self._kind, durations ** 2 / 8.0
        way = bounds.position_deviation + square * bounds.speed ** 2 * inverse_radius
        least, most = (self._limits.thresholds[name] for name in kind.position_limits)
        positions = results[:, kind.position.columns]
        deviation = legs.gains * (self._lever * way[:, None])
        exceeding: Flags = (
            (_smaller(positions) - deviation < least)
            | (_larger(positions) + deviation > most)
            | (_larger(np.abs(results[:, kind.rate.columns])) + self._rate_deviation(
                durations, bounds, legs, inverse_radius) > self._fastest)).any(axis=1)
        if kind.lever_limit:
            exceeding |= (squares < self._limits.thresholds[kind.lever_limit] ** 2).any(axis=1)
        return exceeding

    def _rate_deviation(self, durations: Array, bounds: Bounds, legs: IntervalBounds,
                        inverse_radius: Array) -> Array:
        """Return how far rates of the drives may be from the straight line (N, 6)."""
        speed = bounds.speed * inverse_radius
        turning = 3.0 * speed * bounds.acceleration + speed ** 2 * bounds.speed
        deviation: Array = legs.gains * (self._lever * (
            bounds.velocity_deviation + durations ** 2 / 8.0 * turning)[:, None])
        return deviation

    def _force_parts(self, durations: Array, bounds: Bounds, legs: IntervalBounds,
                     inverse_radius: Array, results: Array, rates: Array, bases: Array | None,
                     largest: float) -> Array:
        """Return the number of parts that the efforts need (N,)."""
        effort_max = self._kind.effort_limit
        magnitudes = np.abs(results[:, self._kind.effort.columns])
        rate_deviation = self._rate_deviation(durations, bounds, legs, inverse_radius)
        acceleration = self._acceleration_deviation(
            durations, bounds, legs, inverse_radius, results, bases)[:, None]
        gains = self._gains(legs, results)
        deviation = self._friction.viscous * rate_deviation + gains[effort_max] * acceleration
        # Coulomb friction changes where a rate is, or may come, near zero.
        changes = (_smaller(np.abs(rates)) - rate_deviation < self._friction.coulomb_velocity) | (
            rates[:-1] * rates[1:] < 0.0)
        friction = np.where(changes, self._friction.largest_change, 0.0)
        strongest = self._limits.force_max
        if self._parameters.drives:
            # Losses in the screw change there as well. A curve may end at zero.
            friction = friction + np.where(changes, _larger(magnitudes), 0.0) * (
                2.0 / self._parameters.drive.efficiency - 2.0)
            of_motors = force_limits(self._parameters, _larger(np.abs(rates)) + rate_deviation)
            still = force_limits(self._parameters, np.zeros(6))
            strongest = np.minimum(strongest, np.maximum(of_motors, _LEAST * still))
        allowed = self._tolerance * np.minimum(largest, strongest)
        parts = _parts(magnitudes, deviation, friction, np.minimum(largest, strongest), allowed)
        for name in self._limits.of_loads:
            if name != effort_max:
                bound = self._limits.bounds[name]
                parts = np.maximum(parts, _parts(
                    np.abs(results[:, LIMITS[name].columns]), gains[name] * acceleration, 0.0,
                    bound, self._tolerance * bound))
        return parts

    def _gains(self, legs: IntervalBounds, results: Array) -> dict[str, Array]:
        """
        Return bounds of loads (N, 6) for an acceleration |a| + arm |alpha| of the platform of 1.

        For all masses that move with it, by the name of the limit of each load.
        """
        mass = self._platform_mass + (legs.masses * self._lever ** 2).sum(axis=1)
        joints: Array = _larger(results[:, UNIT_LOAD_FORCES]) * mass[:, None]
        return {self._kind.effort_limit: legs.pushes * joints + legs.efforts * self._lever,
                self._kind.joint_force_limit: joints + legs.ends * self._lever}

    def _acceleration_deviation(self, durations: Array, bounds: Bounds, legs: IntervalBounds,
                                inverse_radius: Array, results: Array, bases: Array | None,
                                ) -> Array:
        """Return how far accelerations of masses may be from the straight line (N,) [m/s^2]."""
        # Beside the acceleration's own: speeds that change the directions, a pose that changes
        # what a changing acceleration asks for, and a base that turns.
        h, speed = durations, bounds.speed
        condition = _larger(results[:, CONDITION])
        changing = bounds.jerk * h
        acceleration = bounds.acceleration_deviation + 0.25 * (
            inverse_radius * ((bounds.acceleration * h) ** 2
                              + 8.0 * speed * bounds.velocity_deviation)
            + np.minimum(condition * bounds.path / self._arm + legs.turning * bounds.path, 1.0)
            * changing)
        if bases is not None:
            turning = np.sqrt((bases[:, BASE_ANGULAR_VELOCITY] ** 2).sum(axis=1))
            turning = np.nan_to_num(_larger(turning) if len(turning) > 1 else turning)
            acceleration += 2.0 * turning * bounds.velocity_deviation
        return acceleration


def _parts(magnitudes: Array, deviation: Array, jumps: Array | float, known: Array,
           allowed: Array) -> Array:
    """
    Return the number of parts in which a load needs each interval (N,).

    magnitudes (N + 1, 6): at the points. deviation (N, 6): from the straight line between them.
    jumps: by which it may change at once. known (6,): larger values matter, by more than allowed.
    """
    relevant = _larger(magnitudes) + deviation + jumps > known + allowed
    needed = relevant & (deviation + jumps > allowed)
    ratio = np.where(deviation == 0.0, 0.0, deviation / allowed)
    enough = np.ceil(np.sqrt(ratio)).clip(_FEWEST, _ENOUGH)
    parts: Array = np.where(needed, enough, 1.0).max(axis=1)
    return parts


def _smaller(values: Array) -> Array:
    """Return the smaller of the values at both ends of each interval."""
    return np.minimum(values[:-1], values[1:])


def _larger(values: Array) -> Array:
    """Return the larger of the values at both ends of each interval."""
    return np.maximum(values[:-1], values[1:])
