# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The step from a setpoint to leg lengths, forces and the singularity warning, in node and replay.

It uses neither messages nor bags and keeps no state: the state after some setpoints is an argument
for the next. A single setpoint is a batch of one; results are bit-identical, whatever the batches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Flags, NO_WRENCH, Records, Stamps
from stewart_dynamics.core.binding import function, places, record
from stewart_dynamics.mechanics.batch import in_parts
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, Exceedance, JUMP, limit_bounds, LIMITS, limits_of, NO_COLUMNS,
    OF_MOTORS, TORQUE_SPEED)
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, JOINT_FORCES, MOTION, NO_BASE, RESULT,
    UNIT_LOAD_FORCES)
from stewart_dynamics.mechanics.singularity_warning import (
    CAUSE, Singularity, TIME, UNSOLVABLE_CONDITION)
from stewart_dynamics.parameters.table import Parameters

# Parts of the rows of setpoints, and of their outputs.
_SETPOINT, _OUTPUT = places('setpoint'), places('stewart_output')
_MOTION, _LOAD, _BASE, _BASE_KNOWN, _RESTART, _STAMPED = (_SETPOINT[name] for name in (
    'motion', 'wrench', 'base', 'base_known', 'restart', 'stamped'))
SETPOINT = 1 + _STAMPED
(POSITIONS, LEVER_TIMES, _MEAN_RATES, _BASE_JOINT_ANGLES, _PLATFORM_JOINT_ANGLES, _CLEARANCES,
 MOTORS, RISES) = (_OUTPUT[name] for name in (
     'positions', 'lever_times', 'mean_rates', 'base_joint_angles', 'platform_joint_angles',
     'clearances', 'motors', 'rises'))
MOTOR_ANGLES, MOTOR_SPEEDS, MOTOR_COMMANDS = (
    _OUTPUT[f'motors.{name}'] for name in ('angles', 'speeds', 'commands'))
ANSWERED, _RESTARTED, CHANGED, EXCEEDING, _JUMPED, FINITE_MOTORS = (_OUTPUT[name] for name in (
    'answered', 'restart', 'changed', 'exceeding', 'jumped', 'finite_motors'))
WARNING_STATE = slice(_OUTPUT['warning'], 1 + _OUTPUT['crossings'])
_JOINT_ANGLES = slice(_BASE_JOINT_ANGLES.start, _PLATFORM_JOINT_ANGLES.stop)
_OUTPUT_RECORD = record('stewart_output')
OUTPUT = _OUTPUT_RECORD.itemsize // 8
"""Numbers in a row of outputs; the last ones are integers, which no slice here has."""

FIRST: Array = np.zeros(record('stewart_state').itemsize // 8)
"""
The state before the first setpoint: the bits of the structure ``stewart_state`` in C, which are
copied far faster than a record.
"""
FIRST.flags.writeable = False


class Batch(NamedTuple):
    """Sequence of N setpoints, or a single one."""

    stamps: Stamps  # (N,) [ns]
    rows: Array  # (N, SETPOINT), the structure ``setpoint`` in C; its parts are properties
    times: Stamps  # when the message that completed each was recorded (N,) [ns]
    moving: bool  # whether the base moves; False: it is fixed

    @classmethod
    def from_parts(cls, stamps: ArrayLike, motions: ArrayLike, wrenches: ArrayLike = NO_WRENCH,
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
            return cls.from_parts([], np.empty((0, MOTION)))
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


class Computed(NamedTuple):
    """Where an output has numbers of the drives, and which others are computed, not nan."""

    positions: slice
    rates: slice
    efforts: slice  # demanded
    commands: slice
    joint_angles: bool
    clearances: bool
    motors: bool
    limits: tuple[str, ...]  # whose quantities are always known

    @classmethod
    def of(cls, parameters: Parameters, joint_angles: bool = False, clearances: bool = False,
           motors: bool = False) -> Computed:
        """Return it for the kind of legs of a hexapod."""
        kind = parameters.leg_kind
        return cls(kind.position.columns, kind.rate.columns, kind.effort.columns, kind.published,
                   joint_angles, clearances, motors, limits_of(parameters).known)


class Outputs(NamedTuple):
    """Results of the step for the N setpoints of a batch that could be answered."""

    answered: Flags  # mask of the batch: setpoints that could be answered; the others overflow
    stamps: Stamps  # (N,) [ns]
    rows: Array
    """
    (N, OUTPUT), the structure ``stewart_output`` in C; its parts are properties. It begins with
    the row of results of ``inverse_dynamics``.
    """
    computed: Computed
    state: Array  # for the next setpoint, see ``FIRST``

    @property
    def results(self) -> Array:
        """Rows (N, RESULT) of results; forces that are not known are nan."""
        return self.rows[:, :RESULT]

    @property
    def drive_positions(self) -> Array:
        """(N, 6): lengths of telescopic legs [m], ...: of ``LegKind.position``."""
        return self.rows[:, self.computed.positions]

    @property
    def rates(self) -> Array:
        """(N, 6): of ``LegKind.rate``."""
        return self.rows[:, self.computed.rates]

    @property
    def demanded_efforts(self) -> Array:
        """
        Unclipped efforts of the drives (N, 6), of ``LegKind.effort``.

        They are nan where J_inv cannot be solved or the base is unknown.
        """
        return self.rows[:, self.computed.efforts]

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
    def efforts(self) -> Array:
        """As published (N, 6): clipped to their limit; nan where suppressed or unknown."""
        return self.rows[:, self.computed.commands]

    @property
    def with_efforts(self) -> Flags:
        """(N,): efforts are published."""
        return ~np.isnan(self.rows[:, self.computed.commands.start])

    @property
    def lever_times(self) -> Array:
        """Until the lever of each drive falls to its limit (N, 6) [s]; inf: never."""
        return self.rows[:, LEVER_TIMES]

    @property
    def joint_angles(self) -> Array:
        """(N, 12) [rad], nan without a limit of theirs; (N, 0) without any."""
        return self.rows[:, _JOINT_ANGLES if self.computed.joint_angles else NO_COLUMNS]

    @property
    def clearances(self) -> Array:
        """Distance of each leg to the nearest leg or plate (N, 6) [m]; (N, 0): no limit."""
        return self.rows[:, _CLEARANCES if self.computed.clearances else NO_COLUMNS]

    @property
    def motors(self) -> Array:
        """Rows of ``mechanics.drives.motors`` (N, MOTORS), commands as published; or (N, 0)."""
        return self.rows[:, MOTORS if self.computed.motors else NO_COLUMNS]

    @property
    def rises(self) -> Array:
        """Temperature rises of the windings (N, 6) [K]; (N, 0) without motors."""
        return self.rows[:, RISES if self.computed.motors else NO_COLUMNS]

    @property
    def records(self) -> Records:
        """Return the rows as structures ``stewart_output`` (N,)."""
        return self.rows.view(_OUTPUT_RECORD)[:, 0]

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
        """Return the (N, 6) values of the limits, those that are computed."""
        motors = self.computed.motors and self.rows[:, FINITE_MOTORS].all()
        found = {*self.computed.limits, *(ANGLES if self.computed.joint_angles else ()),
                 *([CLEARANCE_MIN] if self.computed.clearances else ()),
                 *(OF_MOTORS if motors else ())}
        return {name: self.rows[:, limit.columns] for name, limit in LIMITS.items()
                if name in found}


class Step:
    """
    The step for a hexapod with given parameters.

    parameters: constant for all calls; create another step for other parameters.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.hexapod = hexapod = limited_structure(parameters)
        """The structure ``stewart_platform`` in C."""
        self._bounds = limit_bounds(parameters)
        self._computed = Computed.of(
            parameters, *(bool(hexapod[f'with_{each}']) for each in (
                'joint_angles', 'clearance', 'motors')))
        self._step = function('step_setpoints').bound(hexapod)

    def __call__(self, setpoints: Batch, before: Array = FIRST) -> Outputs:
        """
        Return the outputs of setpoints in order.

        setpoints: finite, with valid rotation matrices.
        before: state of the previous outputs.
        """
        number = len(setpoints.stamps)
        rows, state = np.empty((number, OUTPUT)), before.copy()
        in_parts(self._solve, (), setpoints.rows, rows)
        self._step(1, number, setpoints.stamps, setpoints.rows, state, rows)
        return self.outputs_of(setpoints.stamps, rows, state)

    def outputs_of(self, stamps: Stamps, rows: Array, state: Array) -> Outputs:
        """Return the outputs of setpoints from all of their rows (N, OUTPUT)."""
        answered = rows[:, ANSWERED] > 0.0
        if not answered.all():
            stamps, rows = stamps[answered], rows[answered]
        return Outputs(answered, stamps, rows, self._computed, state)

    def _solve(self, setpoints: Array, outputs: Array) -> None:
        function('solve_setpoints')(self.hexapod, len(setpoints), setpoints, outputs)

    def exceedances(self, outputs: Outputs, n: int = 0) -> tuple[Exceedance, ...]:
        """Return the limits that the motion or the motors of a setpoint exceed."""
        row, found = outputs.rows[n], outputs.records[n]
        exceeded = [int(bits) for bits in found['exceeded']]
        return tuple(
            Exceedance(name, leg, float(row[limit.columns][leg]), self._bound(name, row, leg),
                       int(found['nearest'][leg]) if name == CLEARANCE_MIN else -1,
                       self.parameters.leg_kind.rate_limit)
            for name, limit in LIMITS.items() for leg, bits in enumerate(exceeded)
            if bits & limit.bit)

    def _bound(self, limit: str, row: Array, leg: int) -> float:
        if limit == TORQUE_SPEED:
            return float(row[_OUTPUT['motors.available_torques']][leg])
        rate_limit = self.parameters.leg_kind.rate_limit
        return float(self._bounds[rate_limit if limit == JUMP else limit][leg])
