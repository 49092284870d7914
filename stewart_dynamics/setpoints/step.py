# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The step from a setpoint to leg lengths, forces and the singularity warning, in node and replay.

It uses neither messages nor bags and keeps no state. Results are bit-identical for single
setpoints and for batches.
"""

from __future__ import annotations

import math
from typing import Any, cast, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, NO_WRENCH, Six, Stamps, STAMPS_END
from stewart_dynamics.core.binding import function, Sample
from stewart_dynamics.mechanics.drives.motor_limits import MotorLimits
from stewart_dynamics.mechanics.limits import ANGLES, CLEARANCE_MIN, Exceedance, result_values
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, JOINT_FORCES, LENGTHS, NO_BASE, RATES,
    UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import (
    CAUSE, Singularity, STATE, TIME, UNSOLVABLE_CONDITION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.motor_row import (
    EXCEEDING, MOTOR_ROW, OF_DRIVES, RISES, SOUND, WINDINGS)


# Tolerance of the stamps of setpoints [s]: a leg may move at its rate limit for this additional
# time before a setpoint counts as a jump.
JITTER = 1e-3


class Setpoint(NamedTuple):
    """Pose, twist and acceleration at one time."""

    stamp: int  # [ns]
    motion: tuple[float, ...]  # a row of motion, laid out as for ``inverse_dynamics``
    wrench: Six = NO_WRENCH  # load on the platform at its origin, base axes [N, N m]
    restart: bool = False  # time has jumped back: earlier setpoints no longer apply
    base: tuple[float, ...] | None = None
    """Row of the base's motion, nan if unknown; None if the base is fixed."""
    stamped: bool = True
    """Whether the stamp comes from the messages; otherwise it is the time of arrival."""

    @property
    def base_known(self) -> bool:
        """Return whether the base is fixed or its motion is known."""
        return self.base is None or self.base[0] == self.base[0]


class State(NamedTuple):
    """State after earlier setpoints; before the first setpoint it is State()."""

    singularity: Singularity | None = None
    stamp: int = 0  # stamp of the last setpoint that was not a jump [ns]
    lengths: Six | None = None  # leg lengths of that setpoint [m]; None before the first one
    windings: tuple[float, ...] | None = None
    """Of the motors after that setpoint, see ``motor_row``; None without thermal data."""


class Output(NamedTuple):
    """Result of the step for one setpoint."""

    stamp: int
    result: tuple[float, ...]
    """Row of results (RESULT,); forces are nan where they cannot be computed."""
    forces: Six | None
    """As published [N], clipped to limits.force_max; None if suppressed or not computed."""
    singularity: Singularity
    warning_changed: bool
    exceedances: tuple[Exceedance, ...]
    joint_angles: tuple[float, ...] = ()
    """Row of joint angles [rad], nan for those without a limit; empty without any limit."""
    clearances: tuple[float, ...] = ()
    """Distance of the surface of each leg to the nearest other leg [m]; empty without limit."""
    motors: tuple[float, ...] = ()
    """Begin of a row of motors, see ``motor_row``; empty without ``drive.*``."""
    state: State = State()  # for the next setpoint

    @property
    def lengths(self) -> Six:
        """Lengths of the legs [m]."""
        return cast(Six, self.result[LENGTHS])

    @property
    def rates(self) -> Six:
        """Rates of the legs [m/s]."""
        return cast(Six, self.result[RATES])

    @property
    def demanded_forces(self) -> Six | None:
        """Unclipped [N]; None if J_inv cannot be solved or the base's motion is unknown."""
        return _known(self.result[FORCES])

    @property
    def joint_forces(self) -> Six | None:
        """Forces of rods and joints [N], under the demanded forces; None without these."""
        return _known(self.result[JOINT_FORCES])

    @property
    def unit_load_forces(self) -> Six:
        """Largest force of each leg under a unit load on the platform."""
        return cast(Six, self.result[UNIT_LOAD_FORCES])

    @property
    def determinant(self) -> float:
        """det(J_inv) [m^3]."""
        return self.result[DETERMINANT]

    @property
    def determinant_rate(self) -> float:
        """Its time derivative [m^3/s]."""
        return self.result[DETERMINANT_RATE]

    @property
    def condition(self) -> float:
        """Condition number of J_inv."""
        return self.result[CONDITION]

    @property
    def solvable(self) -> bool:
        """Whether J_inv can be solved."""
        return self.condition < UNSOLVABLE_CONDITION


class Batch(NamedTuple):
    """Sequence of N setpoints."""

    stamps: Stamps  # (N,) [ns]
    motions: Array  # rows of motion (N, 24), laid out as for ``inverse_dynamics``
    wrenches: Array  # (N, 6) [N, N m], or one row for all
    restarts: Flags  # (N,): time has jumped back before the setpoint
    times: Stamps  # time of arrival of the message that completed each (N,) [ns]
    bases: Array | None = None
    """Rows of the base's motion (N, 12), nan where unknown; None if the base is fixed."""
    stamped: Flags | None = None
    """(N,): the stamp comes from the messages, not from the time of arrival. None: all do."""

    @property
    def base_known(self) -> Flags:
        """(N,): the base is fixed or its motion is known."""
        if self.bases is None:
            return np.ones(len(self.stamps), dtype=bool)
        return ~np.isnan(self.bases[:, 0])

    def chosen(self, which: Any) -> Batch:
        """Return selected setpoints: by a slice, an index or a mask (N,)."""
        return Batch._make(None if part is None else part[which] for part in self)


def restarts_of(restarts: Flags, kept: Flags, waiting: bool = False) -> tuple[Flags, bool]:
    """
    Return the restarts of those setpoints (N,) that are kept, and whether one waits for the next.

    A restart that is left out passes to the next setpoint that is kept; one was already waiting
    or not. ``check_many`` in C does so setpoint by setpoint.
    """
    of_kept = np.cumsum(restarts)[kept] + waiting
    still = np.count_nonzero(restarts) + waiting > of_kept.max(initial=0)
    return np.diff(of_kept, prepend=0) > 0, bool(still)


class Outputs(NamedTuple):
    """Results of the step for the N setpoints of a batch that could be answered."""

    answered: Flags  # mask of the batch: setpoints that could be answered; the others overflow
    stamps: Stamps  # (N,) [ns]
    results: Array
    """Rows of results (N, 27), laid out as for ``inverse_dynamics``; missing forces are nan."""
    forces: Array
    """As published (N, 6): clipped to limits.force_max; nan where suppressed or not solved."""
    states: Array  # rows of Singularity (N, STATE)
    changed: Flags  # (N,): the singularity warning has changed
    exceeding: Flags  # (N,): a limit is exceeded
    jumped: Flags  # (N,): the legs cannot follow from the last setpoint that was not a jump
    joint_angles: Array  # rows of joint angles (N, 12) [rad], or (N, 0), as in Output
    clearances: Array  # (N, 6) [m], or (N, 0), as in Output
    motors: Array  # rows of motors (N, MOTOR_ROW), or (N, 0); see ``motor_row``
    state: State = State()  # for the next setpoint

    @property
    def lengths(self) -> Array:
        """(N, 6) [m]."""
        return self.results[:, LENGTHS]

    @property
    def rates(self) -> Array:
        """(N, 6) [m/s]."""
        return self.results[:, RATES]

    @property
    def demanded_forces(self) -> Array:
        """Unclipped forces (N, 6) [N]; nan where they cannot be computed, as in Output."""
        return self.results[:, FORCES]

    @property
    def joint_forces(self) -> Array:
        """(N, 6) [N]; nan where forces cannot be computed."""
        return self.results[:, JOINT_FORCES]

    @property
    def unit_load_forces(self) -> Array:
        """(N, 6)."""
        return self.results[:, UNIT_LOAD_FORCES]

    @property
    def determinants(self) -> Array:
        """(N,) [m^3]."""
        return self.results[:, DETERMINANT]

    @property
    def determinant_rates(self) -> Array:
        """(N,) [m^3/s]."""
        return self.results[:, DETERMINANT_RATE]

    @property
    def conditions(self) -> Array:
        """(N,)."""
        return self.results[:, CONDITION]

    @property
    def times_to_crossing(self) -> Array:
        """(N,) [s]; inf where det(J) does not approach zero."""
        return self.states[:, TIME]

    @property
    def warnings(self) -> Flags:
        """(N,): the singularity warning is on."""
        return self.states[:, CAUSE] > 0.0


def _known(forces: tuple[float, ...]) -> Six | None:
    return None if math.isnan(forces[0]) else cast(Six, forces)


_FIRST = Singularity()
_NO_LENGTHS = (math.nan,) * 6  # no setpoint is a jump from these
_COLD = (0.0,) * WINDINGS
_UNCHECKED: tuple[tuple[float, ...], ...] = ((), (), ())  # joints, clearance, nearest


class Step:
    """
    The step for a hexapod with given parameters.

    parameters: constant for all calls; create another step for other parameters. Not thread-safe:
        calls for one setpoint share a buffer.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._of_poses = of_poses = PoseLimits(parameters)
        self._limits, self._motors = of_poses.limits, MotorLimits(parameters)
        self._with_motors = bool(parameters.drives)
        self._warms = parameters.drive.thermal_resistance is not None
        # Margin by which the time between two setpoints may exceed that between their stamps [s].
        self._slack = JITTER + parameters.setpoint.sync_tolerance
        self._slack_of_arrival = JITTER + parameters.setpoint.timeout
        self._sample = sample = Sample(
            'one_setpoint', 'base_known', 'answered', 'exceeding', 'jumped', 'result', 'forces',
            'after', *(('joint_angles', 'clearances', 'nearest')
                       if of_poses.angles or of_poses.clearance or self._with_motors else ()),
            *(('windings', 'motors') if self._with_motors else ()))
        self._arguments = self._platform.structure, *of_poses.arguments
        self._solve = function('step_one').bound(*self._arguments, sample.numbers)

    def __call__(self, setpoint: Setpoint, before: State | None) -> Output | None:
        """
        Return the output, or None if the stamp or other numbers overflow.

        setpoint: finite, with a valid rotation matrix.
        before: state of the previous output; None for the first setpoint.
        """
        before = before or State()
        stamp, since, elapsed = setpoint.stamp, 0.0, math.inf
        if stamp > before.stamp and not setpoint.restart:
            since = (stamp - before.stamp) * NANOSECOND
            elapsed = since + (self._slack if setpoint.stamped else self._slack_of_arrival)
        self._sample.write(
            *setpoint.motion, *setpoint.wrench, *(setpoint.base or NO_BASE),
            *(before.singularity or _FIRST), *(before.lengths or _NO_LENGTHS), since, elapsed,
            *(before.windings or _COLD), setpoint.restart, -STAMPS_END <= stamp < STAMPS_END,
            setpoint.base_known)
        self._solve()
        answered, exceeding, jumped, result, commanded, after, *checked = self._sample.read()
        if not answered:
            return None
        angles, clearances, nearest, *of_motors = checked or _UNCHECKED
        windings, motors = of_motors or (None, ())
        if motors and not motors[SOUND]:
            motors = ()
        lengths = result[LENGTHS]
        angles = angles if self._of_poses.angles else ()
        clearances = clearances if self._of_poses.clearance else ()
        exceedances: tuple[Exceedance, ...] = ()
        if exceeding:
            exceedances = self._limits.exceeded(result_values(self._sample['result']))
            if jumped and before.lengths:
                exceedances += self._limits.jumps(lengths, before.lengths, elapsed)
            exceedances += self._limits.exceeded(
                {name: angles[where] for name, where in ANGLES.items()}
                | {CLEARANCE_MIN: clearances}, tuple(map(int, nearest)))
            if motors and motors[EXCEEDING]:
                row = np.array(motors)
                exceedances += self._motors.exceeded(row[OF_DRIVES], row[RISES])
        singularity = Singularity.of(after)
        if not self._warms:
            windings = None
        return Output(
            stamp, result, _known(commanded), singularity,
            before.singularity is None or singularity.warning != before.singularity.warning,
            exceedances, angles, clearances, motors,
            before._replace(singularity=singularity) if jumped
            else State(singularity, stamp, lengths, windings))

    def many(self, setpoints: Batch, before: State | None) -> Outputs:
        """Return the outputs of a sequence of setpoints, as calls for one setpoint would."""
        before, motions = before or State(), setpoints.motions
        results = self._platform.solve(motions, setpoints.wrenches, setpoints.bases)
        number = len(results)
        none: Array = np.empty((number, 0))
        angles = none if self._of_poses.angles is None else self._of_poses.angles(motions)
        clearances = none if self._of_poses.clearance is None else (
            self._of_poses.clearance(motions))
        motors = np.empty((number, MOTOR_ROW if self._with_motors else 0))
        state = np.array(before.singularity or _FIRST)
        windings = np.array(before.windings or _COLD)
        followed_at = np.array([before.stamp])
        followed = np.array(before.lengths or _NO_LENGTHS)
        forces, states = np.empty((number, 6)), np.empty((number, STATE))
        answered, exceeding, jumped = (np.empty(number, dtype=bool) for _ in range(3))
        slack = np.full(number, self._slack)
        if setpoints.stamped is not None:
            slack[~setpoints.stamped] = self._slack_of_arrival
        function('check_many')(
            *self._arguments, number, setpoints.stamps, setpoints.base_known, setpoints.restarts,
            slack, np.ascontiguousarray(motions), angles, clearances, state, followed_at, followed,
            windings, results, forces, states, motors, answered, exceeding, jumped)
        stamps = setpoints.stamps
        if not answered.all():
            stamps, results, forces, states, exceeding, jumped, angles, clearances, motors = (
                each[answered] for each in (stamps, results, forces, states, exceeding, jumped,
                                            angles, clearances, motors))
        singularity = before.singularity
        warnings = states[:, CAUSE] > 0.0
        changed = np.empty(len(states), dtype=bool)
        changed[:1] = singularity is None or warnings[:1] != singularity.warning
        changed[1:] = warnings[1:] != warnings[:-1]
        if len(states):
            singularity = Singularity.of(states[-1].tolist())
        a, b, c, d, e, f = followed.tolist()
        warm = tuple(windings.tolist()) if self._warms and len(states) else before.windings
        return Outputs(
            answered, stamps, results, forces, states, changed, exceeding, jumped, angles,
            clearances, motors, State(
                singularity, int(followed_at[0]),
                None if math.isnan(a) else (a, b, c, d, e, f), warm))
