# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The step from a setpoint to leg lengths, forces and the singularity warning, in node and replay.

It uses neither messages nor bags and keeps no state: the state after some setpoints is an argument
for the next. A single setpoint is a batch of one; results are bit-identical, whatever the batches.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags, NO_WRENCH, Stamps
from stewart_dynamics.core.binding import function, places
from stewart_dynamics.mechanics.batch import in_parts
from stewart_dynamics.mechanics.drives.motor_limits import MotorLimits
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, Exceedance, JUMP, result_values)
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, JOINT_ANGLES, JOINT_FORCES, LENGTHS, MOTION,
    NO_BASE, RATES, RESULT, UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import (
    CAUSE, Singularity, TIME, UNSOLVABLE_CONDITION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.motor_row import (
    EXCEEDING as MOTORS_EXCEEDING, MOTOR_ROW, OF_DRIVES, RISES)

# Tolerance of the stamps of setpoints [s]: a leg may move at its rate limit for this additional
# time before a setpoint counts as a jump.
JITTER = 1e-3

# Parts of the rows of setpoints, of their outputs, and of the state of the step.
_SETPOINT, _OUTPUT, _STATE = (
    places(name) for name in ('setpoint', 'setpoint_output', 'step_state'))
_MOTION, _LOAD, _BASE, _BASE_KNOWN, _RESTART, _STAMPED = (_SETPOINT[name] for name in (
    'motion', 'wrench', 'base', 'base_known', 'restart', 'stamped'))
SETPOINT = 1 + _STAMPED
POSITIONS, PUBLISHED_FORCES, WARNING_STATE, _MEAN_RATES = (
    _OUTPUT[name] for name in ('positions', 'forces', 'warning', 'mean_rates'))
_ANSWERED, _RESTARTED, CHANGED, EXCEEDING, _JUMPED = (
    _OUTPUT[name] for name in ('answered', 'restart', 'changed', 'exceeding', 'jumped'))
OUTPUT = 1 + _JUMPED

FIRST: Array = np.zeros(1 + _STATE['restarting'])
"""The state before the first setpoint."""
FIRST[_STATE['warning.time_to_crossing']] = math.inf
FIRST[_STATE['lengths']] = math.nan
FIRST.flags.writeable = False
# The mask of a single answered setpoint: making it took as long as the computation.
_THE_ONE: Flags = np.ones(1, dtype=bool)
_THE_ONE.flags.writeable = False


class Batch(NamedTuple):
    """Sequence of N setpoints, or a single one."""

    stamps: Stamps  # (N,) [ns]
    rows: Array  # (N, SETPOINT), the structure ``setpoint`` in C; its parts are properties
    times: Stamps  # when the message that completed each was recorded (N,) [ns]
    moving: bool  # whether the base moves; False: it is fixed

    @classmethod
    def of(cls, stamps: ArrayLike, motions: ArrayLike, wrenches: ArrayLike = NO_WRENCH,
           restarts: ArrayLike = False, times: ArrayLike | None = None,
           bases: ArrayLike | None = None, stamped: ArrayLike = True) -> Batch:
        """
        Return N setpoints, or a single one; a value that is the same for all may be given once.

        stamps (N,), times (N,), by default the stamps: see the fields.
        motions (N, MOTION), wrenches (N, 6) [N, N m], bases (N, BASE): rows as for
            ``inverse_dynamics``; bases are nan where unknown, None if the base is fixed.
        restarts (N,): time has jumped back before the setpoint.
        stamped (N,): the stamp comes from the messages, not from the time of arrival.
        """
        at = np.atleast_1d(np.asarray(stamps, dtype=np.int64))
        rows = np.empty((len(at), SETPOINT))
        rows[:, _MOTION], rows[:, _LOAD] = motions, wrenches
        rows[:, _RESTART], rows[:, _STAMPED] = restarts, stamped
        rows[:, _BASE] = NO_BASE if bases is None else bases
        rows[:, _BASE_KNOWN] = bases is None or ~np.isnan(rows[:, _BASE.start])
        return cls(at, rows, at if times is None else np.atleast_1d(np.asarray(times)),
                   bases is not None)

    @classmethod
    def joined(cls, batches: Sequence[Batch]) -> Batch:
        """Return batches as one."""
        if len(batches) == 1:
            return batches[0]
        if not batches:
            return cls.of([], np.empty((0, MOTION)))
        stamps, rows, times, moving = zip(*batches, strict=True)
        return cls(np.concatenate(stamps), np.concatenate(rows), np.concatenate(times), moving[0])

    @property
    def motions(self) -> Array:
        """Rows of motion (N, MOTION), laid out as for ``inverse_dynamics``."""
        return self.rows[:, _MOTION]

    @property
    def wrenches(self) -> Array:
        """Load on the platform at its origin (N, 6), base axes [N, N m]."""
        return self.rows[:, _LOAD]

    @property
    def bases(self) -> Array | None:
        """Rows of the base's motion (N, BASE), nan where unknown; None if the base is fixed."""
        return self.rows[:, _BASE] if self.moving else None

    @property
    def base_known(self) -> Flags:
        """(N,): the base is fixed or its motion is known."""
        return self.rows[:, _BASE_KNOWN] > 0.0

    @property
    def restarts(self) -> Flags:
        """(N,): time has jumped back before the setpoint."""
        return self.rows[:, _RESTART] > 0.0

    @property
    def stamped(self) -> Flags:
        """(N,): the stamp comes from the messages, not from the time of arrival."""
        return self.rows[:, _STAMPED] > 0.0

    def chosen(self, which: Any) -> Batch:
        """Return selected setpoints: by a slice, indices or a mask (N,)."""
        return self._replace(stamps=self.stamps[which], rows=self.rows[which],
                             times=self.times[which])

    def replaced(
            self, motions: ArrayLike | None = None, restarts: ArrayLike | None = None) -> Batch:
        """Return the same setpoints with other motions (N, MOTION), or restarts (N,)."""
        rows = self.rows.copy()
        if motions is not None:
            rows[:, _MOTION] = motions
        if restarts is not None:
            rows[:, _RESTART] = restarts
        return self._replace(rows=rows)


class Outputs(NamedTuple):
    """Results of the step for the N setpoints of a batch that could be answered."""

    answered: Flags  # mask of the batch: setpoints that could be answered; the others overflow
    stamps: Stamps  # (N,) [ns]
    rows: Array
    """
    (N, OUTPUT), the structure ``setpoint_output`` in C; its parts are properties. It begins with
    the row of results of ``inverse_dynamics``.
    """
    joint_angles: Array  # (N, 12) [rad], nan without a limit of theirs; (N, 0) without any
    clearances: Array
    """Distance of the surface of each leg to the nearest other (N, 6) [m]; (N, 0): no limit."""
    motors: Array  # rows of motors (N, MOTOR_ROW), or (N, 0); see ``motor_row``
    state: Array  # for the next setpoint, see ``FIRST``

    @property
    def results(self) -> Array:
        """Rows (N, RESULT) of results; forces that are not known are nan."""
        return self.rows[:, :RESULT]

    @property
    def lengths(self) -> Array:
        """(N, 6) [m]."""
        return self.rows[:, LENGTHS]

    @property
    def rates(self) -> Array:
        """(N, 6) [m/s]."""
        return self.rows[:, RATES]

    @property
    def demanded_forces(self) -> Array:
        """Unclipped forces (N, 6) [N]; nan where J_inv cannot be solved or the base is unknown."""
        return self.rows[:, FORCES]

    @property
    def joint_forces(self) -> Array:
        """(N, 6) [N]; nan where forces cannot be computed."""
        return self.rows[:, JOINT_FORCES]

    @property
    def unit_load_forces(self) -> Array:
        """(N, 6)."""
        return self.rows[:, UNIT_LOAD_FORCES]

    @property
    def determinants(self) -> Array:
        """(N,) [m^3]."""
        return self.rows[:, DETERMINANT]

    @property
    def determinant_rates(self) -> Array:
        """(N,) [m^3/s]."""
        return self.rows[:, DETERMINANT_RATE]

    @property
    def conditions(self) -> Array:
        """(N,)."""
        return self.rows[:, CONDITION]

    @property
    def solvable(self) -> Flags:
        """(N,): J_inv can be solved."""
        return self.conditions < UNSOLVABLE_CONDITION

    @property
    def forces(self) -> Array:
        """As published (N, 6): clipped to limits.force_max; nan where suppressed or unknown."""
        return self.rows[:, PUBLISHED_FORCES]

    @property
    def with_forces(self) -> Flags:
        """(N,): forces are published."""
        return ~np.isnan(self.rows[:, PUBLISHED_FORCES.start])

    @property
    def states(self) -> Array:
        """States of the singularity warning (N, STATE), rows of Singularity."""
        return self.rows[:, WARNING_STATE]

    @property
    def changed(self) -> Flags:
        """(N,): the singularity warning has changed, or is the first."""
        return self.rows[:, CHANGED] > 0.0

    @property
    def restarts(self) -> Flags:
        """(N,): time has jumped back before it, or before one that could not be answered."""
        return self.rows[:, _RESTARTED] > 0.0

    @property
    def exceeding(self) -> Flags:
        """(N,): a limit is exceeded."""
        return self.rows[:, EXCEEDING] > 0.0

    @property
    def jumped(self) -> Flags:
        """(N,): the legs cannot follow from the last setpoint that was not a jump."""
        return self.rows[:, _JUMPED] > 0.0

    @property
    def times_to_crossing(self) -> Array:
        """(N,) [s]; inf where det(J) does not approach zero."""
        return self.states[:, TIME]

    @property
    def warnings(self) -> Flags:
        """(N,): the singularity warning is on."""
        return self.states[:, CAUSE] > 0.0

    def singularity(self, n: int = 0) -> Singularity:
        """Return the state of the warning after a setpoint."""
        return Singularity.of(self.states[n].tolist())

    def values(self) -> dict[str, Array]:
        """Return the (N, 6) values of the limits of the legs, those that are computed."""
        found = result_values(self.rows)
        if self.joint_angles.shape[1]:
            found |= {name: self.joint_angles[:, where] for name, where in ANGLES.items()}
        if self.clearances.shape[1]:
            found[CLEARANCE_MIN] = self.clearances
        return found


class Step:
    """
    The step for a hexapod with given parameters.

    parameters: constant for all calls; create another step for other parameters. Not thread-safe:
        calls for a batch of one share memory.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._of_poses = of_poses = PoseLimits(parameters)
        self._limits, self._motors = of_poses.limits, MotorLimits(parameters)
        of_angles, of_clearance = of_poses.angles, of_poses.clearance
        self._widths = (0 if of_angles is None else JOINT_ANGLES, 0 if of_clearance is None else 6,
                        MOTOR_ROW if parameters.drives else 0)
        # The last two: by how much the time between two setpoints may exceed that between their
        # stamps, or between their times of arrival [s].
        constants = (
            self._platform.structure, *of_poses.arguments, parameters.geometry.zero_length,
            JITTER + parameters.setpoint.sync_tolerance, JITTER + parameters.setpoint.timeout)
        self._check = function('check_setpoints').bound(*constants)
        # A single setpoint is copied to memory that stays: half the time of a call with any.
        self._memory: tuple[Any, ...] = (
            np.zeros(1, np.int64), np.zeros((1, SETPOINT)),
            *(np.empty((1, width)) for width in self._widths[:2]), FIRST.copy(),
            np.empty((1, OUTPUT)), np.empty((1, self._widths[2])))
        self._check_one = function('check_setpoints').bound(*constants, 0, 1, *self._memory)

    def __call__(self, setpoints: Batch, before: Array = FIRST) -> Outputs:
        """
        Return the outputs of setpoints in order.

        setpoints: finite, with valid rotation matrices.
        before: state of the previous outputs.
        """
        stamps, given, number = setpoints.stamps, setpoints.rows, len(setpoints.stamps)
        if number == 1:
            at, of_one, *found = self._memory
            at[:], of_one[:], found[2][:] = stamps, given, before
            n_answered = self._check_one()
            angles, clearances, state, rows, motors = [
                each.copy() if each.size else each for each in found]
        else:
            rows, state = np.empty((number, OUTPUT)), before.copy()
            angles, clearances, motors = (np.empty((number, width)) for width in self._widths)
            in_parts(self._solve, (), given, rows)
            if self._of_poses.angles is not None:
                angles = self._of_poses.angles(setpoints.motions)
            if self._of_poses.clearance is not None:
                clearances = self._of_poses.clearance(setpoints.motions)
            n_answered = self._check(
                1, number, stamps, given, angles, clearances, state, rows, motors)
        if n_answered == number == 1:
            answered = _THE_ONE
        else:
            answered = rows[:, _ANSWERED] > 0.0
        if n_answered < number:
            stamps = stamps[answered]
            rows, angles, clearances, motors = (
                each[answered] for each in (rows, angles, clearances, motors))
        return Outputs(answered, stamps, rows, angles, clearances, motors, state)

    def _solve(self, setpoints: Array, outputs: Array) -> None:
        function('solve_setpoints')(self._platform.structure, len(setpoints), setpoints, outputs)

    def exceedances(self, motions: Array, outputs: Outputs, n: int = 0) -> tuple[Exceedance, ...]:
        """Return the limits that a setpoint exceeds; motions (N, MOTION): those of the outputs."""
        values = {name: each[n].tolist() for name, each in outputs.values().items()}
        if outputs.jumped[n]:
            values[JUMP] = outputs.rows[n, _MEAN_RATES].tolist()
        nearest: list[int] = []
        if self._of_poses.clearance is not None:
            nearest = self._of_poses.clearance.nearest(motions[n:n + 1])[1][0].tolist()
        found = self._limits.exceeded(values, nearest)
        motors = outputs.motors[n]
        if len(motors) and motors[MOTORS_EXCEEDING]:
            found += self._motors.exceeded(motors[OF_DRIVES], motors[RISES])
        return found
