# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The limits of the legs, their joints and clearance: which there are, when one is exceeded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, Six
from stewart_dynamics.mechanics.rows import BASE_JOINT_ANGLES, PLATFORM_JOINT_ANGLES
from stewart_dynamics.parameters.table import OUTLINES, Parameters

LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX = OF_RESULTS = (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')
BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX = OF_JOINTS = (
    'limits.base_joint_angle_max', 'limits.platform_joint_angle_max')
CLEARANCE_MIN = 'limits.leg_clearance_min'
TORQUE_MAX, TORQUE_SPEED, SPEED_MAX, TEMPERATURE_RISE_MAX = OF_MOTORS = (
    'drive.torque_max', 'drive.torque_speed', 'drive.speed_max', 'drive.temperature_rise_max')
LIMITS = (*OF_RESULTS, *OF_JOINTS, CLEARANCE_MIN)
MINIMA = LENGTH_MIN, CLEARANCE_MIN
# Not a limit with a parameter of its own: a setpoint too far from the last one for VELOCITY_MAX.
JUMP = 'jump'

# Relative tolerance of limit checks, above rounding errors.
TOLERANCE = 1e-9


class Quantity(NamedTuple):
    """A quantity that a limit bounds."""

    name: str
    unit: str

    @property
    def key(self) -> str:
        """Return its key in summary.json, and that of its plot in a report."""
        return self.name.replace(' ', '_')


_LENGTH, _TORQUE = Quantity('length', 'm'), Quantity('motor torque', 'N m')
QUANTITIES = {
    LENGTH_MIN: _LENGTH, LENGTH_MAX: _LENGTH, VELOCITY_MAX: Quantity('rate', 'm/s'),
    FORCE_MAX: Quantity('force', 'N'), BASE_ANGLE_MAX: Quantity('base joint angle', 'rad'),
    PLATFORM_ANGLE_MAX: Quantity('platform joint angle', 'rad'),
    CLEARANCE_MIN: Quantity('clearance', 'm'), TORQUE_MAX: _TORQUE, TORQUE_SPEED: _TORQUE,
    SPEED_MAX: Quantity('motor speed', 'rad/s'),
    TEMPERATURE_RISE_MAX: Quantity('temperature rise', 'K'),
    JUMP: Quantity('mean rate from the last setpoint', 'm/s')}
TORQUE_CONTINUOUS = 'drive.torque_continuous'
"""The torque that a motor can hold without end: may be exceeded for a short time."""
SINGULARITY = 'singularity'  # among short names: inside stop_condition, or beyond det(J) = 0
CLIPPED = FORCE_MAX, TORQUE_MAX, TORQUE_SPEED
"""Limits to which published values are clipped; the others follow limits.action."""

ANGLES = {BASE_ANGLE_MAX: BASE_JOINT_ANGLES, PLATFORM_ANGLE_MAX: PLATFORM_JOINT_ANGLES}
"""Where in a row of joint angles the values of a limit are."""


def short_name(limit: str) -> str:
    """Return the name of a limit without its section: length_max."""
    return limit.rpartition('.')[2]


def result_values(lengths: Any, rates: Any, forces: Any) -> dict[str, Any]:
    """Return the values of OF_RESULTS, of one sample (6,) or of many (N, 6)."""
    return {LENGTH_MIN: lengths, LENGTH_MAX: lengths, VELOCITY_MAX: rates, FORCE_MAX: forces}


def angle_values(angles: Sequence[float]) -> dict[str, Sequence[float]]:
    """Return the values of OF_JOINTS of one sample's joint angles (JOINT_ANGLES,)."""
    return {limit: angles[where] for limit, where in ANGLES.items()}


class Exceedance(NamedTuple):
    """A limit that a leg exceeds."""

    limit: str  # one of LIMITS or OF_MOTORS, or JUMP
    leg: int
    value: float
    bound: float
    other: int = -1
    """Of a clearance, the leg or plate that is nearest, see ``leg_clearance``; else -1."""

    @property
    def excess(self) -> float:
        """Return by how much the limit is exceeded."""
        return (self.bound - self.value if self.limit in MINIMA
                else abs(self.value) - self.bound)

    def words(self, joints: Sequence[str]) -> str:
        """Return which leg exceeds the limit, and by how much."""
        quantity, unit = QUANTITIES[self.limit]
        how = 'below' if self.limit in MINIMA else 'above'
        limit = VELOCITY_MAX if self.limit == JUMP else self.limit
        if self.other >= 0:
            quantity += f' to {(*joints, *OUTLINES)[self.other]},'
        return (f'{joints[self.leg]}: {quantity} {self.value:.6g} {unit} is {self.excess:.6g} '
                f'{unit} {how} {limit}')


class Limits:
    """
    The limits of the legs of a hexapod; those that are not given are never exceeded.

    bounds: values (6,) of each limit that is given [m, m/s, N, rad].
    thresholds (7, 6): values above (or below) which each of LIMITS is exceeded; infinite if not
        given.
    of_joints: names in OF_JOINTS that are given.
    force_max (6,): forces to which leg forces are clipped [N]; infinite if not given.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.bounds: dict[str, Array] = {
            name: np.broadcast_to(parameters[name], 6)
            for name in LIMITS if parameters[name] is not None}
        self.thresholds = np.array([
            np.full(6, -math.inf if name in MINIMA else math.inf)
            if name not in self.bounds else self.bounds[name] * (
                1.0 - TOLERANCE if name in MINIMA else 1.0 + TOLERANCE) for name in LIMITS])
        self.of_joints = tuple(name for name in OF_JOINTS if name in self.bounds)
        self.force_max: Array = self.bounds.get(FORCE_MAX, np.full(6, math.inf))
        self._of_samples = {name: (self.bounds[name].tolist(), self.thresholds[n].tolist())
                            for n, name in enumerate(LIMITS) if name in self.bounds}

    def threshold(self, limit: str) -> Array:
        """Return the values (6,) above (or below) which a limit is exceeded."""
        threshold: Array = self.thresholds[LIMITS.index(limit)]
        return threshold

    def exceeds(self, limit: str, values: Array) -> Flags:
        """Return where values (..., 6) of its quantity exceed a limit; nan never does."""
        exceeding: Flags = _exceeds(limit, values, self.threshold(limit))
        return exceeding

    def exceeded(self, values: Mapping[str, Sequence[float] | None],
                 nearest: Sequence[int] = ()) -> tuple[Exceedance, ...]:
        """
        Return the limits that one sample exceeds.

        values: of each limit to check, the six of its quantity; None exceeds none.
        nearest: of CLEARANCE_MIN, the nearest leg or plate of each leg, see ``leg_clearance``.
        """
        found: list[Exceedance] = []
        for limit, of_legs in values.items():
            if of_legs is None or limit not in self._of_samples:
                continue
            bounds, thresholds = self._of_samples[limit]
            for leg, value in enumerate(of_legs):
                if _exceeds(limit, value, thresholds[leg]):
                    other = nearest[leg] if limit == CLEARANCE_MIN else -1
                    found.append(Exceedance(limit, leg, value, bounds[leg], other))
        return tuple(found)

    def jumps(self, lengths: Six, followed: Six, elapsed: float) -> tuple[Exceedance, ...]:
        """Return the legs that cannot move from one length to another within a time [s]."""
        bounds, thresholds = self._of_samples[VELOCITY_MAX]
        return tuple(
            Exceedance(JUMP, leg, (new - old) / elapsed, bounds[leg])
            for leg, (new, old) in enumerate(zip(lengths, followed, strict=True))
            if abs(new - old) > thresholds[leg] * elapsed)


def _exceeds(limit: str, value: Any, threshold: Any) -> Any:
    """Return whether a value, or where an array, is past the threshold of a limit."""
    return value < threshold if limit in MINIMA else abs(value) > threshold
