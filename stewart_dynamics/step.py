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

It knows neither ROS nor bags, holds no state, and gives the same bits for the same input.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics import cdr
from stewart_dynamics import inverse_dynamics as runtime
from stewart_dynamics.parameters import Parameters
from stewart_dynamics.platform import StewartPlatform
from stewart_dynamics.singularity import Singularity, UNSOLVABLE_CONDITION

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
        self._suppress = parameters['singularity.action'] == 'suppress_forces'
        self._limits = {name: parameters[name].tolist() for name in (
            'limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')
            if parameters[name] is not None}
        self._zero_lengths = parameters['geometry.zero_length'].tolist()
        self._joint_state = cdr.JointState(parameters['joints'])

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
        result = self._platform.solve(
            np.array((setpoint.motion,)), np.array((setpoint.wrench,)))[0].tolist()
        if not cdr.finite(result) or not cdr.is_stamp(setpoint.stamp):
            return None
        lengths: Six = tuple(result[0:6])
        rates: Six = tuple(result[6:12])
        determinant = result[runtime.DETERMINANT]
        determinant_rate = result[runtime.DETERMINANT_RATE]
        condition = result[runtime.CONDITION]
        past = before or Singularity()
        if setpoint.restart:
            past = Singularity(crossings=past.crossings)
        singularity = past.after(self.parameters, determinant, determinant_rate, condition)
        demanded: Six | None = None
        forces: Six | None = None
        if condition < UNSOLVABLE_CONDITION:
            demanded = tuple(result[12:18])
            if not (self._suppress and singularity.stopped):
                forces = self._clipped(demanded)
        return Output(
            setpoint.stamp, lengths, rates, demanded, forces, tuple(result[18:24]),
            determinant, determinant_rate, condition, singularity,
            before is None or singularity.warning != before.warning,
            self._excesses(lengths, rates, demanded))

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

    def _clipped(self, forces: Six) -> Six:
        bounds = self._limits.get('limits.force_max')
        if bounds is None:
            return forces
        return tuple(
            min(max(force, -bound), bound) for force, bound in zip(forces, bounds, strict=True))

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
