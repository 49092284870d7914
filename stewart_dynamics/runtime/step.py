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
The one step from a setpoint to what is published for it; node and replay both take it.

It knows neither ROS nor bags, remembers nothing, and gives the same bits for the same input,
whether setpoints come one at a time or by the thousand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
from operator import sub
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, NO_WRENCH, Six, Stamps
from stewart_dynamics.mechanics import kernel
from stewart_dynamics.mechanics.hexapod_constants import CONSTANTS
from stewart_dynamics.mechanics.jit import entry_point, inlined
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, MOTION, RATES, RESULT,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.singularity import (
    advance, CAUSE, forget, Singularity, STATE, STOPPED, THRESHOLDS, thresholds, TIME,
    UNSOLVABLE_CONDITION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages import cdr
from stewart_dynamics.parameters import Parameters

_QUANTITIES = {'limits.length_min': ('length', 'm'), 'limits.length_max': ('length', 'm'),
               'limits.velocity_max': ('rate', 'm/s'), 'limits.force_max': ('force', 'N')}

# Under the node's name, in the order in which they are published.
OUTPUT_TYPES = {
    'leg_states': 'sensor_msgs/msg/JointState',
    'leg_lengths': 'std_msgs/msg/Float64MultiArray',
    'leg_forces': 'std_msgs/msg/Float64MultiArray',
    'jacobian_determinant': 'std_msgs/msg/Float64',
    'singularity_warning': 'std_msgs/msg/Bool',
}


class Setpoint(NamedTuple):
    """Pose, twist and acceleration at one time."""

    stamp: int
    """[ns]"""
    motion: tuple[float, ...]
    """A row of motion, laid out as ``inverse_dynamics`` says."""
    wrench: Six = NO_WRENCH
    """Load on the platform at its origin, base axes [N, N m]."""
    restart: bool = False
    """Time has jumped back before it: what came before says nothing of it."""


class Excess(NamedTuple):
    """A limit that a leg breaks."""

    limit: str
    leg: int
    value: float
    bound: float

    def words(self, joints: Sequence[str]) -> str:
        """Return what is beyond the limit, and by how much."""
        quantity, unit = _QUANTITIES[self.limit]
        beyond = abs(abs(self.value) - self.bound)
        return (f'{joints[self.leg]}: {quantity} {self.value:.6g} {unit} is {beyond:.6g} {unit} '
                f'beyond {self.limit}')


class Output(NamedTuple):
    """What one setpoint gives."""

    stamp: int
    lengths: Six
    rates: Six
    demanded_forces: Six | None
    """As the dynamics have them; none where J_inv cannot be solved."""
    forces: Six | None
    """As published: clipped to limits.force_max; none where suppressed or not solved."""
    unit_load_forces: Six
    determinant: float
    determinant_rate: float
    condition: float
    singularity: Singularity
    warning_changed: bool
    excesses: tuple[Excess, ...]


class Batch(NamedTuple):
    """Setpoints one after the other, N of them."""

    stamps: Stamps
    """(N,) [ns]"""
    motions: Array
    """Rows of motion (N, 24), laid out as ``inverse_dynamics`` says."""
    wrenches: Array
    """(N, 6) [N, N m], or one row for all."""
    restarts: Flags
    """(N,): time has jumped back before it."""
    times: Stamps
    """When the message that completed each came (N,) [ns]."""

    def chosen(self, which: Any) -> Batch:
        """Return some of them: a slice, or an index or a mask (N,)."""
        return Batch._make(part[which] for part in self)


class Outputs(NamedTuple):
    """What a batch gives: of those setpoints that could be answered, N of them."""

    answered: Flags
    """Which setpoints of the batch these are; of the others numbers overflow."""
    stamps: Stamps
    """(N,) [ns]"""
    results: Array
    """Rows of results (N, 27), laid out as ``inverse_dynamics`` says; no forces are nan."""
    forces: Array
    """As published (N, 6): clipped to limits.force_max; nan where suppressed or not solved."""
    states: Array
    """Rows of Singularity (N, STATE)."""
    changed: Flags
    """(N,): the singularity warning is another than before."""
    exceeding: Flags
    """(N,): a limit is broken."""

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
        """As the dynamics have them (N, 6) [N]; nan where J_inv cannot be solved."""
        return self.results[:, FORCES]

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
        """(N,) [s]; inf where det(J) does not go toward zero."""
        return self.states[:, TIME]

    @property
    def warnings(self) -> Flags:
        """(N,): the singularity warning is on."""
        return self.states[:, CAUSE] > 0.0

    @property
    def stopped(self) -> Flags:
        """(N,): inside stop_condition."""
        return self.states[:, STOPPED] > 0.0

    def singularity(self, n: int = -1) -> Singularity:
        """Return the state after one of them."""
        return Singularity.of(self.states[n].tolist())


# The numbers of the settings: thresholds, whether to suppress, and four limits of six legs.
_SUPPRESS = THRESHOLDS
_LIMITS = _SUPPRESS + 1
LIMITS = ('limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')
_SETTINGS = _LIMITS + 6 * len(LIMITS)


# One setpoint in numbers: machine, settings, motion, wrench, state before, restart, whether the
# stamp is one; then, written, state after, result, forces, whether it is answered and exceeds.
_ONE_SETTINGS = CONSTANTS
_ONE_MOTION = _ONE_SETTINGS + _SETTINGS
_ONE_WRENCH = _ONE_MOTION + MOTION
_ONE_STATE = _ONE_WRENCH + WRENCH
_ONE_RESTART = _ONE_STATE + STATE
_ONE_STAMP = _ONE_RESTART + 1
_ONE_RESULT = _ONE_STAMP + 1
_ONE_FORCES = _ONE_RESULT + RESULT
_ONE_AFTER = _ONE_FORCES + 6
_ONE_ANSWERED = _ONE_AFTER + STATE
_ONE_EXCEEDING = _ONE_ANSWERED + 1
_ONE = _ONE_EXCEEDING + 1
_GIVEN = Struct(f'{_ONE_RESULT - _ONE_MOTION}d')
_GIVES = Struct(f'{_ONE - _ONE_RESULT}d')


@inlined
def _watch(settings: Array, is_stamp: bool, state: Array, restart: bool, result: Array,
           forces: Array) -> tuple[bool, bool]:
    """Write what becomes of a result, see Outputs; return whether it is answered and exceeds."""
    finite = is_stamp
    for k in range(RESULT):
        finite = finite and math.isfinite(result[k])
    if not finite:
        return False, False
    if restart:
        forget(state)
    condition = result[CONDITION]
    advance(state, settings, result[DETERMINANT], result[DETERMINANT_RATE],
            condition)
    solved = condition < UNSOLVABLE_CONDITION
    published = solved and not (state[STOPPED] > 0.0 and settings[_SUPPRESS] > 0.0)
    exceeding = False
    for leg in range(6):
        length, rate = result[LENGTHS.start + leg], result[RATES.start + leg]
        force = result[FORCES.start + leg]
        most = settings[_LIMITS + 18 + leg]
        if not solved:
            result[FORCES.start + leg] = np.nan
        forces[leg] = min(max(force, -most), most) if published else np.nan
        if (length < settings[_LIMITS + leg] or length > settings[_LIMITS + 6 + leg]
                or abs(rate) > settings[_LIMITS + 12 + leg] or (solved and abs(force) > most)):
            exceeding = True
    return True, exceeding


@entry_point
def _watch_many(settings: Array, stamps: Stamps, restarts: Flags, before: Array, results: Array,
                forces: Array, states: Array, answered: Flags, exceeding: Flags) -> None:
    """Go through results in their order and write what becomes of them, see Outputs."""
    state = before.copy()
    restart = False
    for n in range(len(results)):
        # One that cannot be answered hands it on.
        restart = restart or restarts[n]
        is_stamp = -cdr.STAMPS_END <= stamps[n] < cdr.STAMPS_END
        answered[n], exceeding[n] = _watch(
            settings, is_stamp, state, restart, results[n], forces[n])
        restart = restart and not answered[n]
        states[n] = state


@entry_point
def _one(numbers: Array) -> None:
    """Do with one setpoint what solve and watch do with many; an array costs time to pass."""
    state = numbers[_ONE_AFTER:_ONE_AFTER + STATE]
    state[:] = numbers[_ONE_STATE:_ONE_STATE + STATE]
    results = numbers[_ONE_RESULT:_ONE_RESULT + RESULT].reshape(1, RESULT)
    kernel.solve(
        numbers[:CONSTANTS],
        numbers[_ONE_MOTION:_ONE_MOTION + MOTION].reshape(1, MOTION),
        numbers[_ONE_WRENCH:_ONE_WRENCH + WRENCH].reshape(1, WRENCH), results)
    numbers[_ONE_ANSWERED], numbers[_ONE_EXCEEDING] = _watch(
        numbers[_ONE_SETTINGS:_ONE_SETTINGS + _SETTINGS], numbers[_ONE_STAMP] > 0.0, state,
        numbers[_ONE_RESTART] > 0.0, results[0], numbers[_ONE_FORCES:_ONE_FORCES + 6])


_FIRST = Singularity()


class Step:
    """
    The step, for a machine with given parameters.

    Parameters
    ----------
    parameters : Parameters
        They hold for every call; another set of them makes another step. One thread at a time
        may call it: a call for one setpoint works in memory that is the step's own.

    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._numbers = np.zeros(_ONE)
        self._memory = self._numbers.data  # the same as bytes
        self._numbers[:_ONE_SETTINGS] = self._platform.constants
        self._settings = self._numbers[_ONE_SETTINGS:_ONE_MOTION]
        self._settings[:_SUPPRESS] = thresholds(parameters)
        self._settings[_SUPPRESS] = parameters['singularity.action'] == 'suppress_forces'
        self._limits = {name: parameters[name].tolist() for name in LIMITS
                        if parameters[name] is not None}
        for n, name in enumerate(LIMITS):
            never = -math.inf if name == 'limits.length_min' else math.inf
            self._settings[_LIMITS + 6 * n:_LIMITS + 6 * n + 6] = self._limits.get(name, never)
        self._zero_lengths = parameters['geometry.zero_length'].tolist()
        self._joint_state = cdr.JointState(parameters['joints'])
        self._with_effort, self._without_effort = (
            self._joint_state.layout(effort) for effort in (True, False))

    def __call__(self, setpoint: Setpoint, before: Singularity | None) -> Output | None:
        """
        Return the output, or None where numbers overflow, the stamp's own among them.

        Parameters
        ----------
        setpoint : Setpoint
            A finite one, its rotation a rotation.
        before : Singularity, optional
            The output's before this one; none for the first.

        """
        stamp = setpoint.stamp
        _GIVEN.pack_into(
            self._memory, 8 * _ONE_MOTION, *setpoint.motion, *setpoint.wrench,
            *(before or _FIRST).numbers, setpoint.restart,
            -cdr.STAMPS_END <= stamp < cdr.STAMPS_END)
        _one(self._numbers)
        result = _GIVES.unpack_from(self._memory, 8 * _ONE_RESULT)
        if not result[_ONE_ANSWERED - _ONE_RESULT]:
            return None
        lengths, rates, demanded = result[0:6], result[6:12], result[12:18]
        forces = result[_ONE_FORCES - _ONE_RESULT:_ONE_AFTER - _ONE_RESULT]
        singularity = Singularity.of(result[_ONE_AFTER - _ONE_RESULT:_ONE_ANSWERED - _ONE_RESULT])
        solved = demanded[0] == demanded[0]
        return Output(
            stamp, lengths, rates, demanded if solved else None,
            forces if forces[0] == forces[0] else None, result[18:24],
            result[DETERMINANT], result[DETERMINANT_RATE],
            result[CONDITION], singularity,
            before is None or singularity.warning != before.warning,
            self._excesses(lengths, rates, demanded if solved else None)
            if result[_ONE_EXCEEDING - _ONE_RESULT] else ())

    def many(self, setpoints: Batch, before: Singularity | None) -> Outputs:
        """Return what setpoints give one after the other; see the call for one."""
        results = self._platform.solve(setpoints.motions, setpoints.wrenches)
        many = len(results)
        state = np.array((before or _FIRST).numbers)
        forces, states = np.empty((many, 6)), np.empty((many, STATE))
        answered, exceeding = np.empty(many, dtype=bool), np.empty(many, dtype=bool)
        _watch_many(self._settings, setpoints.stamps, setpoints.restarts, state, results, forces,
                    states, answered, exceeding)
        stamps = setpoints.stamps
        if not answered.all():
            stamps, results, forces = stamps[answered], results[answered], forces[answered]
            states, exceeding = states[answered], exceeding[answered]
        warnings = states[:, CAUSE] > 0.0
        changed = np.empty(len(states), dtype=bool)
        changed[:1] = before is None or warnings[:1] != before.warning
        changed[1:] = warnings[1:] != warnings[:-1]
        return Outputs(answered, stamps, results, forces, states, changed, exceeding)

    def messages(self, output: Output) -> Iterator[tuple[str, bytes]]:
        """Yield topics (keys of OUTPUT_TYPES) and messages to publish for an output."""
        yield 'leg_states', self._joint_state.write(
            output.stamp, map(sub, output.lengths, self._zero_lengths), output.rates,
            output.forces)
        yield 'leg_lengths', cdr.float64_array(output.lengths)
        if output.forces is not None:
            yield 'leg_forces', cdr.float64_array(output.forces)
        yield 'jacobian_determinant', cdr.float64(output.determinant)
        if output.warning_changed:
            yield 'singularity_warning', cdr.boolean(output.singularity.warning)

    def messages_of(self, outputs: Outputs) -> list[tuple[str, Stamps, NDArray[np.void]]]:
        """
        Return the same messages as ``messages``, of many outputs.

        Returns
        -------
        list of (topic, which, messages)
            In the order in which they are published for one output; ``which`` (K,) outputs have
            such a message, and the messages (K,) as entries of their length. A topic may come
            twice, for its messages with and without forces.

        """
        positions = outputs.lengths - self._zero_lengths
        solved = np.isfinite(outputs.forces[:, 0])
        having, lacking = np.flatnonzero(solved), np.flatnonzero(~solved)
        stamps, rates, forces = outputs.stamps, outputs.rates, outputs.forces
        messages = [
            ('leg_states', having, self._with_effort.write(
                stamps[having], positions[having], rates[having], forces[having])),
            ('leg_states', lacking, self._without_effort.write(
                stamps[lacking], positions[lacking], rates[lacking])),
            ('leg_lengths', np.arange(len(stamps)), cdr.FLOAT64_ARRAY.write(
                None, outputs.lengths)),
            ('leg_forces', having, cdr.FLOAT64_ARRAY.write(None, forces[having])),
            ('jacobian_determinant', np.arange(len(stamps)), cdr.FLOAT64.write(
                None, outputs.determinants[:, None])),
        ]
        changed = np.flatnonzero(outputs.changed)
        warnings = [cdr.boolean(on) for on in outputs.warnings[changed].tolist()]
        messages.append(('singularity_warning', changed, np.frombuffer(
            b''.join(warnings), dtype=f'V{len(cdr.boolean(True))}')))
        return messages

    def _excesses(
            self, lengths: Six, rates: Six, forces: Six | None) -> tuple[Excess, ...]:
        """Return every limit broken."""
        found = []
        for limit, bounds in self._limits.items():
            values = (rates if limit == 'limits.velocity_max'
                      else forces if limit == 'limits.force_max' else lengths)
            if values is None:
                continue
            for leg, (value, bound) in enumerate(zip(values, bounds, strict=True)):
                if (value < bound if limit == 'limits.length_min' else abs(value) > bound):
                    found.append(Excess(limit, leg, value, bound))
        return tuple(found)
