# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The limits of the legs, their joints and clearance: which there are, when one is exceeded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import CODES
from stewart_dynamics.mechanics.rows import (
    BASE_JOINT_ANGLES, FORCES, JOINT_FORCES, LENGTHS, PLATFORM_JOINT_ANGLES, RATES)
from stewart_dynamics.parameters.table import OUTLINES, Parameters

# A quantity depends on the pose alone; is linear in the twist; is affine in the acceleration and
# in loads on the platform; or is one of the motors.
POSE, TWIST, LOAD, MOTOR = 'pose', 'twist', 'load', 'motor'
NO_COLUMNS = slice(0)  # of quantities that are not in a row of results
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


class Limit(NamedTuple):
    """
    A limit of each leg: the magnitude of a quantity is at most, or a minimum at least, its bound.

    Step, diagnostics, planned trajectories, capability, summary, plots and datasheet go through
    LIMITS: one more limit is a parameter in the table, an entry here, and its bit in C.
    """

    name: str  # of the parameter
    phrase: str  # its name in a datasheet
    quantity: Quantity
    depends: str  # POSE, TWIST, LOAD or MOTOR
    columns: slice = NO_COLUMNS  # of the values in a row of results
    minimum: bool = False
    clips: bool = False  # published values are clipped to it; others follow limits.action
    title: str = ''  # of the plot of a quantity in a row of results
    note: str = ''
    usual: bool = False  # the quantity is shown where the limit is not given, too

    @property
    def bit(self) -> int:
        """Return its bit of ``stewart_output.exceeded``; KeyError for a limit of the motors."""
        return CODES[f'STEWART_{short_name(self.name).upper()}']


LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX, JOINT_FORCE_MAX = (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max',
    'limits.joint_force_max')
BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX = OF_JOINTS = (
    'limits.base_joint_angle_max', 'limits.platform_joint_angle_max')
CLEARANCE_MIN = 'limits.leg_clearance_min'
TORQUE_MAX, TORQUE_SPEED, SPEED_MAX, TEMPERATURE_RISE_MAX = OF_MOTORS = (
    'drive.torque_max', 'drive.torque_speed', 'drive.speed_max', 'drive.temperature_rise_max')
JUMP = 'jump'

_LENGTH, _TORQUE = Quantity('length', 'm'), Quantity('motor torque', 'N m')
_LENGTHS: dict[str, Any] = {
    'columns': LENGTHS, 'title': 'Leg lengths', 'note': 'between the joint centers', 'usual': True}
LIMITS: Mapping[str, Limit] = {each.name: each for each in (
    Limit(LENGTH_MIN, 'shortest leg', _LENGTH, POSE, minimum=True, **_LENGTHS),
    Limit(LENGTH_MAX, 'longest leg', _LENGTH, POSE, **_LENGTHS),
    Limit(VELOCITY_MAX, 'speed of a leg', Quantity('rate', 'm/s'), TWIST, RATES,
          title='Leg rates', note='+ extends', usual=True),
    Limit(FORCE_MAX, 'force of a leg', Quantity('force', 'N'), LOAD, FORCES, clips=True,
          title='Leg forces', note='demanded by the motion, + pushes', usual=True),
    Limit(JOINT_FORCE_MAX, 'force in a joint', Quantity('joint force', 'N'), LOAD, JOINT_FORCES,
          title='Forces in the joints',
          note='along the legs, without friction and reflected mass of the actuators, + pushes'),
    Limit(BASE_ANGLE_MAX, 'joint angle at the base', Quantity('base joint angle', 'rad'), POSE),
    Limit(PLATFORM_ANGLE_MAX, 'joint angle at the platform',
          Quantity('platform joint angle', 'rad'), POSE),
    Limit(CLEARANCE_MIN, 'clearance between legs', Quantity('clearance', 'm'), POSE,
          minimum=True),
    Limit(TORQUE_MAX, 'torque of a motor', _TORQUE, MOTOR, clips=True),
    Limit(TORQUE_SPEED, 'torque of a motor at its speed', _TORQUE, MOTOR, clips=True),
    Limit(SPEED_MAX, 'speed of a motor', Quantity('motor speed', 'rad/s'), MOTOR),
    Limit(TEMPERATURE_RISE_MAX, 'temperature of a winding', Quantity('temperature rise', 'K'),
          MOTOR),
    # Without a parameter of its own: too far from the last setpoint for limits.velocity_max.
    Limit(JUMP, 'jump', Quantity('mean rate from the last setpoint', 'm/s'), TWIST))}
"""All limits by name."""
OF_LEGS = tuple(name for name, each in LIMITS.items() if name.startswith('limits.'))
OF_POSES = tuple(name for name in OF_LEGS if LIMITS[name].depends == POSE)
OF_RESULTS = tuple(name for name in OF_LEGS if LIMITS[name].columns != NO_COLUMNS)
OF_LOADS = tuple(name for name in OF_RESULTS if LIMITS[name].depends == LOAD)
USUAL = tuple(name for name in OF_RESULTS if LIMITS[name].usual)
OF_RATES = tuple(name for name in OF_RESULTS if LIMITS[name].depends == TWIST)
TORQUE_CONTINUOUS = 'drive.torque_continuous'
"""The torque that a motor can hold without end: may be exceeded for a short time."""
SINGULARITY = 'singularity'  # among short names: inside stop_condition, or beyond det(J) = 0
ANGLES = {BASE_ANGLE_MAX: BASE_JOINT_ANGLES, PLATFORM_ANGLE_MAX: PLATFORM_JOINT_ANGLES}
"""Where in a row of joint angles the values of a limit are."""


def short_name(limit: str) -> str:
    """Return the name of a limit without its section: length_max."""
    return limit.rpartition('.')[2]


def result_values(results: Any) -> dict[str, Any]:
    """Return the values of OF_RESULTS in one row of results (RESULT,), or many (N, RESULT)."""
    return {name: results[..., LIMITS[name].columns] for name in OF_RESULTS}


class Exceedance(NamedTuple):
    """A limit that a leg exceeds."""

    limit: str  # one of LIMITS
    leg: int
    value: float
    bound: float
    other: int = -1
    """Of a clearance, the leg or plate that is nearest, see ``leg_clearance``; else -1."""

    @property
    def excess(self) -> float:
        """Return by how much the limit is exceeded."""
        return (self.bound - self.value if LIMITS[self.limit].minimum
                else abs(self.value) - self.bound)

    def words(self, joints: Sequence[str]) -> str:
        """Return which leg exceeds the limit, and by how much."""
        (quantity, unit), how = LIMITS[self.limit].quantity, (
            'below' if LIMITS[self.limit].minimum else 'above')
        limit = VELOCITY_MAX if self.limit == JUMP else self.limit
        if self.other >= 0:
            quantity += f' to {(*joints, *OUTLINES)[self.other]},'
        return (f'{joints[self.leg]}: {quantity} {self.value:.6g} {unit} is {self.excess:.6g} '
                f'{unit} {how} {limit}')


class Limits:
    """
    The limits of the legs of a hexapod; those that are not given are never exceeded.

    bounds: values (6,) of each limit that is given [m, m/s, N, rad].
    thresholds: values (6,) above (or below) which each of OF_LEGS is exceeded; infinite if not
        given.
    of_joints: names in OF_JOINTS that are given.
    of_loads: names in OF_LOADS that are given.
    force_max (6,): forces to which leg forces are clipped [N]; infinite if not given.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.bounds: dict[str, Array] = {
            name: np.broadcast_to(parameters[name], 6)
            for name in OF_LEGS if parameters[name] is not None}
        self.thresholds = {name: _threshold(LIMITS[name], self.bounds.get(name))
                           for name in OF_LEGS}
        self.of_joints = tuple(name for name in OF_JOINTS if name in self.bounds)
        self.of_loads = tuple(name for name in OF_LOADS if name in self.bounds)
        self.force_max: Array = self.bounds.get(FORCE_MAX, np.full(6, math.inf))
        self._of_samples = {name: (bound.tolist(), self.thresholds[name].tolist())
                            for name, bound in self.bounds.items()}
        if VELOCITY_MAX in self.bounds:
            self._of_samples[JUMP] = self._of_samples[VELOCITY_MAX]

    def exceeds(self, limit: str, values: Array) -> Flags:
        """Return where values (..., 6) of its quantity exceed a limit; nan never does."""
        exceeding: Flags = _exceeds(limit, values, self.thresholds[limit])
        return exceeding

    def exceeded(self, values: Mapping[str, Sequence[float]],
                 nearest: Sequence[int] = ()) -> tuple[Exceedance, ...]:
        """
        Return the limits that one sample exceeds.

        values: of each limit to check, the six of its quantity.
        nearest: of CLEARANCE_MIN, the nearest leg or plate of each leg, see ``leg_clearance``.
        """
        found: list[Exceedance] = []
        for limit, of_legs in values.items():
            if limit not in self._of_samples:
                continue
            bounds, thresholds = self._of_samples[limit]
            for leg, value in enumerate(of_legs):
                if _exceeds(limit, value, thresholds[leg]):
                    other = nearest[leg] if limit == CLEARANCE_MIN else -1
                    found.append(Exceedance(limit, leg, float(value), bounds[leg], other))
        return tuple(found)


def _threshold(limit: Limit, bound: Array | None) -> Array:
    """Return the values (6,) above (or below) which a limit is exceeded."""
    sign = -1.0 if limit.minimum else 1.0
    threshold: Array = (
        np.full(6, sign * math.inf) if bound is None else bound * (1.0 + sign * TOLERANCE))
    return threshold


def _exceeds(limit: str, value: Any, threshold: Any) -> Any:
    """Return whether a value, or where an array, is past the threshold of a limit."""
    return value < threshold if LIMITS[limit].minimum else abs(value) > threshold
