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

It knows neither ROS nor bags, holds no state, and gives the same bits for the same input,
whether setpoints come one at a time or by the thousand.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import cdr
from stewart_dynamics import inverse_dynamics as runtime
from stewart_dynamics.compiled import entry_point, source_digest
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.platform import StewartPlatform
from stewart_dynamics.singularity import (
    advance, CAUSE, LAST, Singularity, STATE, STOPPED, thresholds, TIME, UNSOLVABLE_CONDITION)

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Flags = NDArray[np.bool_]

Six = tuple[float, float, float, float, float, float]

NO_WRENCH: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

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


_NO_TIME = np.zeros(1, dtype=np.int64)


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
        return self.results[:, runtime.LENGTHS:runtime.LENGTHS + 6]

    @property
    def rates(self) -> Array:
        """(N, 6) [m/s]."""
        return self.results[:, runtime.RATES:runtime.RATES + 6]

    @property
    def demanded_forces(self) -> Array:
        """As the dynamics have them (N, 6) [N]; nan where J_inv cannot be solved."""
        return self.results[:, runtime.FORCES:runtime.FORCES + 6]

    @property
    def unit_load_forces(self) -> Array:
        """(N, 6)."""
        return self.results[:, runtime.UNIT_LOAD_FORCES:runtime.UNIT_LOAD_FORCES + 6]

    @property
    def determinants(self) -> Array:
        """(N,) [m^3]."""
        return self.results[:, runtime.DETERMINANT]

    @property
    def determinant_rates(self) -> Array:
        """(N,) [m^3/s]."""
        return self.results[:, runtime.DETERMINANT_RATE]

    @property
    def conditions(self) -> Array:
        """(N,)."""
        return self.results[:, runtime.CONDITION]

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
        return Singularity.of(self.states[n])


# The numbers of the settings: thresholds, whether to suppress, and four limits of six legs.
_SUPPRESS = 3
_LIMITS = 4
LIMITS = ('limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')
_SETTINGS = _LIMITS + 6 * len(LIMITS)


def _entry_point(source: str) -> Callable[..., None]:
    @entry_point
    def watch(settings: Array, stamps: Stamps, restarts: Flags, before: Array, results: Array,
              forces: Array, states: Array, answered: Flags, exceeding: Flags) -> None:
        """Go through results in their order and write what becomes of them, see Outputs."""
        _ = source  # part of the key of the kept machine code: see source_digest
        state = before.copy()
        restart = False
        for n in range(len(results)):
            # One that cannot be answered hands it on.
            restart = restart or restarts[n]
            finite = -cdr.STAMPS_END <= stamps[n] < cdr.STAMPS_END
            for k in range(runtime.RESULT):
                finite = finite and math.isfinite(results[n, k])
            answered[n] = finite
            exceeding[n] = False
            if not finite:
                states[n] = state
                continue
            if restart:
                restart = False
                state[CAUSE], state[STOPPED], state[LAST] = 0.0, 0.0, 0.0
            condition = results[n, runtime.CONDITION]
            advance(state, settings, results[n, runtime.DETERMINANT],
                    results[n, runtime.DETERMINANT_RATE], condition)
            states[n] = state
            solved = condition < UNSOLVABLE_CONDITION
            published = solved and not (state[STOPPED] > 0.0 and settings[_SUPPRESS] > 0.0)
            for leg in range(6):
                length = results[n, runtime.LENGTHS + leg]
                rate = results[n, runtime.RATES + leg]
                force = results[n, runtime.FORCES + leg]
                most = settings[_LIMITS + 18 + leg]
                if not solved:
                    results[n, runtime.FORCES + leg] = np.nan
                forces[n, leg] = min(max(force, -most), most) if published else np.nan
                if (length < settings[_LIMITS + leg] or length > settings[_LIMITS + 6 + leg]
                        or abs(rate) > settings[_LIMITS + 12 + leg]
                        or (solved and abs(force) > most)):
                    exceeding[n] = True

    return watch


_watch = _entry_point(source_digest('compiled', 'cdr', 'inverse_dynamics', 'singularity', 'step'))


class Step:
    """
    The step, for a machine with given parameters.

    Parameters
    ----------
    parameters : Parameters
        They hold for every call; another set of them makes another step.

    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self._platform = StewartPlatform(parameters)
        self._settings = np.empty(_SETTINGS)
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
        outputs = self.many(Batch(
            np.array((setpoint.stamp,)), np.array((setpoint.motion,)),
            np.array((setpoint.wrench,)), np.array((setpoint.restart,)),
            _NO_TIME), before)
        return self._output(outputs) if outputs.answered[0] else None

    def many(self, setpoints: Batch, before: Singularity | None) -> Outputs:
        """Return what setpoints give one after the other; see the call for one."""
        results = self._platform.solve(setpoints.motions, setpoints.wrenches)
        many = len(results)
        state = (before or Singularity()).row
        forces, states = np.empty((many, 6)), np.empty((many, STATE))
        answered, exceeding = np.empty(many, dtype=bool), np.empty(many, dtype=bool)
        _watch(self._settings, setpoints.stamps, setpoints.restarts, state, results, forces,
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

    def messages(self, output: Output) -> list[tuple[str, bytes]]:
        """Return topics (keys of OUTPUT_TYPES) and messages to publish for an output."""
        positions = [length - zero for length, zero in
                     zip(output.lengths, self._zero_lengths, strict=True)]
        messages = [
            ('leg_states', self._joint_state.write(
                output.stamp, positions, output.rates, output.forces)),
            ('leg_lengths', cdr.float64_array(output.lengths))]
        if output.forces is not None:
            messages.append(('leg_forces', cdr.float64_array(output.forces)))
        messages.append(('jacobian_determinant', cdr.float64(output.determinant)))
        if output.warning_changed:
            messages.append(('singularity_warning', cdr.boolean(output.singularity.warning)))
        return messages

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

    def _output(self, outputs: Outputs) -> Output:
        """Return the only one of them."""
        result = outputs.results[0].tolist()
        forces = outputs.forces[0].tolist()
        lengths, rates = tuple(result[0:6]), tuple(result[6:12])
        demanded = tuple(result[12:18]) if result[12] == result[12] else None
        return Output(
            int(outputs.stamps[0]), lengths, rates, demanded,
            tuple(forces) if forces[0] == forces[0] else None, tuple(result[18:24]),
            result[runtime.DETERMINANT], result[runtime.DETERMINANT_RATE],
            result[runtime.CONDITION], outputs.singularity(), bool(outputs.changed[0]),
            self._excesses(lengths, rates, demanded) if outputs.exceeding[0] else ())

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
