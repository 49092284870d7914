# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Intervals in which the motors stay within their torques while something grows from zero."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.force_intervals import quadratic_exit
from stewart_dynamics.mechanics.drives.motor_limits import largest_torques
from stewart_dynamics.mechanics.drives.motors import (
    ACCELERATIONS, Drives, MOTORS, Motors, SPEEDS)
from stewart_dynamics.mechanics.limits import (
    short_name, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.rows import MOTION
from stewart_dynamics.parameters.table import Parameters, six_of

# Ratio of a torque to none that is available: finite, for searches.
_FAR_BEYOND = 1e9


class MovingMotors(NamedTuple):
    """Quantities of the motors that follow from a motion alone (..., 6)."""

    speeds: Array  # [rad/s]
    own: Array  # torques that turn rotors and screws [N m]
    inertial: Array  # parts of the leg forces that do not pass the screws [N]


class MotorBounds:
    """
    The limits of the motors of a hexapod; those that are not given do not limit.

    A torque is ``own + factor load / k`` with the load of the screw. The factor is one of two:
    where the leg moves, that of the motor that drives or is driven; near standstill both count, as
    in ``drives.motors``.

    limited, limits_speeds: there is a limit of torques, of speeds.
    ratio (6,): turns of the motors for each metre of their drives [rad/m].
    inertia (6,): at the motors' shafts [kg m^2].
    fastest (6,): ``drive.speed_max``, or infinity [rad/s].
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = p = parameters
        self._drives = Drives(p)
        legs = p.structure['legs']
        self.ratio, self._mass = legs['motor_ratio'], legs['reflected_mass']
        self._factors = 1.0 + legs['driving_loss'], 1.0 + legs['driven_loss']
        self.inertia = self._mass / self.ratio ** 2
        self._strongest, self.fastest = (
            six_of(each, math.inf) for each in (p.drive.torque_max, p.drive.speed_max))
        self.limits_speeds = bool(np.isfinite(self.fastest).any())
        self._curve = p.drive.torque_speed
        self.limited = p.drive.torque_max is not None or self._curve is not None
        self._knees = np.empty((6, 0))  # speeds at which the largest torque has kinks
        if self._curve is not None:
            speeds, torques = self._curve.T
            with np.errstate(divide='ignore', invalid='ignore'):
                share = (self._strongest[:, None] - torques[:-1]) / np.diff(torques)
                crossings = np.where((share > 0.0) & (share < 1.0),
                                     speeds[:-1] + share * np.diff(speeds), math.inf)
            self._knees = np.concatenate(
                [np.broadcast_to(speeds, (6, len(speeds))), crossings], axis=1)

    def moving(self, motions: Array, results: Array) -> MovingMotors:
        """Return the motors for rows (..., MOTION) and (..., RESULT)."""
        shape = results.shape[:-1]
        rows = np.broadcast_to(motions, (*shape, MOTION)).reshape(-1, MOTION)
        motors = self._drives(rows, results.reshape(-1, results.shape[-1])).reshape(*shape, MOTORS)
        accelerations = motors[..., ACCELERATIONS]
        return MovingMotors(motors[..., SPEEDS], self.inertia * accelerations,
                            self._mass / self.ratio * accelerations)

    def ratios(self, motions: Array, results: Array) -> list[Array]:
        """Return speeds and torques relative to their limits, two of (N, 6)."""
        motors = Motors.of_rows(self._drives(motions, results))
        with np.errstate(divide='ignore'):
            torques = np.abs(motors.breakaway_torques) / motors.available_torques
        return [np.abs(motors.speeds) / self.fastest, np.minimum(torques, _FAR_BEYOND)]

    def torque_limit(self, motions: Array, results: Array) -> Array:
        """Return the names of the limits of torque (N, 6)."""
        return self._names(Motors.of_rows(self._drives(motions, results)).available_torques)

    def _names(self, largest: Array) -> Array:
        return np.where(
            largest < self._strongest, short_name(TORQUE_SPEED), short_name(TORQUE_MAX))

    @property
    def forces_at_rest(self) -> Array:
        """Return the largest leg forces at rest (6,) [N], by the breakaway torque."""
        forces: Array = self._largest(np.zeros(6)) * self.ratio / np.max(
            np.abs(self._factors), axis=0)
        return forces if self.limited else np.full(6, math.inf)

    @property
    def continuous_forces(self) -> Array | None:
        """Return leg forces (6,) [N] that can be held without end, without losses as published."""
        continuous = self._parameters.drive.torque_continuous
        return None if continuous is None else np.asarray(continuous * self.ratio)

    def exits(self, load: tuple[Array, ...], own: tuple[Array, ...], speeds: Array,
              direction: Array, begin: Array, end: Array, growing: bool = False,
              ) -> tuple[Array, Array]:
        """
        Return the first t in [begin, end] from which a torque exceeds the largest at its speed.

        load, own (three of (..., 6)): coefficients of 1, t and t^2: loads of the screws [N],
            torques of the rotors [N m].
        speeds (..., 6): [rad/s], where they grow at t = 1.
        direction (..., 6): signs of the rates of the drives; 0 near standstill.
        begin, end (..., 6) or (): ends of the interval of each leg.
        growing: speeds grow with t.
        Returns exits, limits (..., 6): ``begin`` where a torque is exceeded there, infinity where
            it is not exceeded up to ``end``; names of the limits without ``drive.``.
        """
        constant, linear, square = load
        speeds = np.abs(speeds)
        with np.errstate(all='ignore'):
            edges = [np.broadcast_to(begin, speeds.shape), np.broadcast_to(end, speeds.shape)]
            if growing:
                edges += list(np.moveaxis(self._knees / speeds[..., None], -1, 0))
            root = np.sqrt(linear * linear - 4.0 * square * constant)
            far = -0.5 * (linear + np.copysign(root, linear))
            edges += [far / square, constant / far]  # where the load changes its sign
            pieces = np.sort(np.clip(np.nan_to_num(np.stack(np.broadcast_arrays(*edges)),
                                                   nan=math.inf, posinf=math.inf), begin, end),
                             axis=0)
            first = np.full(pieces.shape[1:], math.inf)
            for low, high in zip(pieces[:-1], pieces[1:], strict=True):
                open_ended = np.isinf(high)
                middle = np.where(open_ended, 2.0 * low + 1.0, 0.5 * (low + high))
                here = self._largest(speeds * middle if growing else speeds)
                slope: Array = np.zeros(speeds.shape)
                if growing:
                    rise = self._largest(speeds * high) - self._largest(speeds * low)
                    flat = open_ended | (here == 0.0) | ~(high > low)
                    slope = np.where(flat, 0.0, rise / (high - low))
                driving = (constant + middle * (linear + middle * square)) * direction > 0.0
                for factor, active in zip(self._factors, (driving, ~driving), strict=True):
                    scale = factor / self.ratio
                    torques = tuple(a + scale * b for a, b in zip(own, load, strict=True))
                    found = quadratic_exit(
                        torques, here - slope * middle, low, high, slope)
                    used = (active | (direction == 0.0)) & (high > low)
                    first = np.minimum(first, np.where(used, found, math.inf))
            at = speeds * np.where(np.isfinite(first), first, 0.0) if growing else speeds
        return first, self._names(self._largest(at))

    def _largest(self, speeds: Array) -> Array:
        """Return the largest torques at speeds (..., 6)."""
        return largest_torques(self._parameters, speeds)
