# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The limits of the legs, their joints and clearance: which there are, when one is exceeded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import math
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.core.binding import CODES, CONSTANTS, LIMIT_ROWS, places
from stewart_dynamics.legs import KINDS
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics.rows import (
    BASE_JOINT_ANGLES, PLATFORM_JOINT_ANGLES, RESULT)
from stewart_dynamics.parameters.structure import LEG_FIELDS
from stewart_dynamics.parameters.table import OUTLINES, PARAMETERS, Parameters

# A quantity depends on the pose alone; is linear in the twist; is affine in the acceleration and
# in loads on the platform; or is one of the motors.
POSE, TWIST, LOAD, MOTOR = 'pose', 'twist', 'load', 'motor'
MINIMUM, MAXIMUM, LARGEST = 'MINIMUM', 'MAXIMUM', 'LARGEST'  # senses, as in STEWART_LIMITS
_MEASURES: dict[str, Any] = {MINIMUM: np.negative, MAXIMUM: np.positive, LARGEST: np.abs}
NO_COLUMNS = slice(0)  # of quantities that are not in a row of results
# Relative tolerance of limit checks, above rounding errors.
TOLERANCE = CONSTANTS['LIMIT_TOLERANCE']


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
    A limit of each leg: a quantity is at least, or at most, its bound, or its magnitude is.

    Step, diagnostics, planned trajectories, capability, summary, plots and datasheet go through
    LIMITS: one more limit is a row in the table of parameters and a line of STEWART_LIMITS in C.
    """

    name: str  # of the parameter
    bit: int  # of ``stewart_output.exceeded``
    phrase: str  # its name in a datasheet
    quantity: Quantity
    depends: str  # POSE, TWIST, LOAD or MOTOR
    columns: slice  # of the values in a row of outputs, which begins with a row of results
    sense: str = LARGEST
    title: str = ''  # of the plot of a quantity in a row of results
    note: str = ''
    usual: bool = False  # the quantity is shown where the limit is not given, too

    @property
    def minimum(self) -> bool:
        """Return whether the quantity must be at least the bound."""
        return self.sense == MINIMUM

    @property
    def measure(self) -> Callable[[Array], Array]:
        """Return a function of values that is the greater, the nearer they are to the limit."""
        measure: Callable[[Array], Array] = _MEASURES[self.sense]
        return measure

    @property
    def clips(self) -> bool:
        """Return whether published values are clipped to it; others follow limits.action."""
        return bool(self.bit & CODES['STEWART_CLIPPED'])


LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX, JOINT_FORCE_MAX = (
    'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max',
    'limits.joint_force_max')
BASE_ANGLE_MAX, PLATFORM_ANGLE_MAX = OF_JOINTS = (
    'limits.base_joint_angle_max', 'limits.platform_joint_angle_max')
CLEARANCE_MIN = 'limits.leg_clearance_min'
LEVER_MIN = 'limits.lever_min'
TORQUE_MAX, TORQUE_SPEED, SPEED_MAX, TEMPERATURE_RISE_MAX = (
    'drive.torque_max', 'drive.torque_speed', 'drive.speed_max', 'drive.temperature_rise_max')
JUMP = 'jump'

# Depends, quantity and sense of limits without a line of STEWART_LIMITS.
_OTHERS = {CLEARANCE_MIN: (POSE, 'clearances', MINIMUM),
           TORQUE_SPEED: (MOTOR, 'motors.breakaway_torques', LARGEST)}
_ROWS = {LEG_FIELDS[row.field]: (row.depends.lower(), row.quantity, row.kind)
         for row in LIMIT_ROWS} | _OTHERS
_PLACES = places('stewart_output')


def _of_parameters() -> Iterator[Limit]:
    """Yield the limits that are parameters."""
    for name, parameter in PARAMETERS.items():
        if (words := parameter.limit) is not None:
            depends, quantity, sense = _ROWS[name]
            yield Limit(
                name, CODES[f'STEWART_{short_name(name).upper()}'], words.phrase,
                Quantity(words.quantity, words.unit or parameter.unit), depends,
                _PLACES[quantity], sense, words.title, words.note, words.usual)


_FIELDS = {LEG_FIELDS[row.field]: row.field for row in LIMIT_ROWS}


def short_name(limit: str) -> str:
    """Return the name of a limit without its section, as in C: length_max."""
    return _FIELDS.get(limit, limit.rpartition('.')[2])


LIMITS: Mapping[str, Limit] = {each.name: each for each in (
    *sorted(_of_parameters(), key=lambda each: each.depends == MOTOR),
    # Without a parameter of its own: too far from the last setpoint for limits.velocity_max.
    Limit(JUMP, CODES['STEWART_JUMP'], 'jump', Quantity('mean rate from the last setpoint', 'm/s'),
          TWIST, _PLACES['mean_rates']))}
"""All limits by name."""


class LimitNames(NamedTuple):
    """The limits of a kind of legs, grouped by the cause of their quantities: pose, rate, load."""

    legs: tuple[str, ...]  # without those of motors
    poses: tuple[str, ...]
    results: tuple[str, ...]  # whose quantities are in a row of results
    known: tuple[str, ...]  # whose quantities are always in a row of outputs
    rates: tuple[str, ...]
    loads: tuple[str, ...]
    usual: tuple[str, ...]  # whose quantities are shown where they are not given, too


def _names_of(kind: LegKind) -> LimitNames:
    legs = tuple(name for name in LIMITS
                 if name.startswith('limits.') and not name.startswith(kind.foreign))
    results = tuple(name for name in legs if LIMITS[name].columns.stop <= RESULT)
    return LimitNames(
        legs, tuple(name for name in legs if LIMITS[name].depends == POSE), results,
        (*results, *(name for name in legs if name == LEVER_MIN)),
        tuple(name for name in results if LIMITS[name].depends == TWIST),
        tuple(name for name in results if LIMITS[name].depends == LOAD),
        tuple(name for name in results if LIMITS[name].usual))


_BY_KIND = {kind.name: _names_of(kind) for kind in KINDS}


def limits_of(parameters: Parameters) -> LimitNames:
    """Return the names of the limits that the kind of legs of a hexapod can have."""
    return limits_of_kind(parameters.leg_kind)


def limits_of_kind(kind: LegKind) -> LimitNames:
    """Return the names of the limits that a kind of legs can have."""
    return _BY_KIND[kind.name]


# For programs that know telescopic legs alone.
OF_LEGS, OF_POSES, OF_RESULTS, _, OF_RATES, OF_LOADS, USUAL = _BY_KIND['telescopic']
OF_MOTORS = tuple(name for name, each in LIMITS.items() if each.depends == MOTOR)
TORQUE_CONTINUOUS = 'drive.torque_continuous'
"""The torque that a motor can hold without end: may be exceeded for a short time."""
SINGULARITY = 'singularity'  # among short names: inside stop_condition, or beyond det(J) = 0
ANGLES = {BASE_ANGLE_MAX: BASE_JOINT_ANGLES, PLATFORM_ANGLE_MAX: PLATFORM_JOINT_ANGLES}
"""Where in a row of joint angles the values of a limit are."""


def result_values(parameters: Parameters, results: Any) -> dict[str, Any]:
    """Return the values of limits in one row of results (width,), or many (N, width)."""
    return {name: results[..., LIMITS[name].columns] for name in limits_of(parameters).results}


class Exceedance(NamedTuple):
    """A limit that a leg exceeds."""

    limit: str  # one of LIMITS
    leg: int
    value: float
    bound: float
    other: int = -1
    """Of a clearance, the leg or plate that is nearest, see ``leg_clearance``; else -1."""
    rate_limit: str = VELOCITY_MAX  # of JUMP: the limit of the drives' rates

    @property
    def excess(self) -> float:
        """Return by how much the limit is exceeded."""
        sense = LIMITS[self.limit].sense
        return (self.bound - self.value if sense == MINIMUM
                else (abs(self.value) if sense == LARGEST else self.value) - self.bound)

    def words(self, joints: Sequence[str]) -> str:
        """Return which leg exceeds the limit, and by how much."""
        (quantity, unit), how = LIMITS[self.limit].quantity, (
            'below' if LIMITS[self.limit].minimum else 'above')
        limit = self.limit
        if limit == JUMP:
            limit, unit = self.rate_limit, PARAMETERS[self.rate_limit].unit
        if self.other >= 0:
            quantity += f' to {(*joints, *OUTLINES)[self.other]},'
        unit = f' {unit}' if unit else ''
        return (f'{joints[self.leg]}: {quantity} {self.value:.6g}{unit} is {self.excess:.6g}'
                f'{unit} {how} {limit}')


def limit_bounds(parameters: Parameters) -> dict[str, Array]:
    """Return the values (6,) of the limits that are given, but for the torque-speed curve."""
    return {name: np.broadcast_to(parameters[name], 6) for name in LIMITS
            if name not in (JUMP, TORQUE_SPEED) and parameters[name] is not None}


class Limits:
    """
    The limits of the legs of a hexapod; those that are not given are never exceeded.

    bounds: values (6,) of each limit that is given [m, m/s, N, rad].
    thresholds: values (6,) above (or below) which each limit of the legs is exceeded; infinite if
        not given.
    of_joints: names in OF_JOINTS that are given.
    of_loads: names in OF_LOADS that are given.
    force_max (6,): efforts to which those of the drives are clipped; infinite if not given.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.bounds = {name: bound for name, bound in limit_bounds(parameters).items()
                       if name in limits_of(parameters).legs}
        self.thresholds = {name: _threshold(LIMITS[name], self.bounds.get(name))
                           for name in limits_of(parameters).legs}
        self.of_joints = tuple(name for name in OF_JOINTS if name in self.bounds)
        self.of_loads = tuple(name for name in limits_of(parameters).loads if name in self.bounds)
        self.force_max: Array = self.bounds.get(
            parameters.leg_kind.effort_limit, np.full(6, math.inf))
        self._of_samples = {name: (bound.tolist(), self.thresholds[name].tolist())
                            for name, bound in self.bounds.items()}
        rate_max = parameters.leg_kind.rate_limit
        if rate_max in self.bounds:
            self._of_samples[JUMP] = self._of_samples[rate_max]

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
        np.full(6, sign * math.inf) if bound is None
        else bound * (1.0 + sign * np.copysign(TOLERANCE, bound)))
    return threshold


def _exceeds(limit: str, value: Any, threshold: Any) -> Any:
    """Return whether a value, or where an array, is past the threshold of a limit."""
    sense = LIMITS[limit].sense
    return (value < threshold if sense == MINIMUM
            else (abs(value) if sense == LARGEST else value) > threshold)
