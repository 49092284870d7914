# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages to publish or write for outputs of the step, external wrenches and base wrenches."""

from __future__ import annotations

from collections.abc import Iterator
from operator import sub

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Six, Stamps
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.messages.standard import (
    boolean, FLOAT64, float64, FLOAT64_ARRAY, float64_array)
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.motor_row import ANGLES, SOUND, SPEEDS, TORQUES
from stewart_dynamics.setpoints.step import Output, Outputs

LEG_STATES, LEG_LENGTHS, LEG_FORCES = 'leg_states', 'leg_lengths', 'leg_forces'
DETERMINANT, WARNING = 'jacobian_determinant', 'singularity_warning'
MOTOR_STATES, MOTOR_TORQUES = 'motor_states', 'motor_torques'
# Topics relative to the node's name, in the order in which they are published for a setpoint.
OUTPUT_TYPES = {
    LEG_STATES: type_names.JOINT_STATE,
    LEG_LENGTHS: type_names.FLOAT64_MULTI_ARRAY,
    LEG_FORCES: type_names.FLOAT64_MULTI_ARRAY,
    DETERMINANT: type_names.FLOAT64,
    WARNING: type_names.BOOL,
    BASE_WRENCH: type_names.WRENCH_STAMPED,
}
# With drive.*.
MOTOR_TYPES = {
    MOTOR_STATES: type_names.JOINT_STATE,
    MOTOR_TORQUES: type_names.FLOAT64_MULTI_ARRAY,
}
# A topic, the indices of the outputs that have a message on it, and the messages.
Written = tuple[str, Stamps, NDArray[np.void]]


class OutputMessages:
    """
    Writes the output messages.

    types: topics that the hexapod has, and their types.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._zero_lengths = parameters.geometry.zero_length.tolist()
        leg_states = JointStateWriter(parameters.joints)
        self._with_effort, self._without_effort = (
            leg_states.layout(effort) for effort in (True, False))
        self._motors = motor_states_writer(parameters)
        self.types = OUTPUT_TYPES | (MOTOR_TYPES if self._motors else {})
        self._wrench = StampedWriter(parameters.base_frame, 6)

    def of_output(self, output: Output) -> Iterator[tuple[str, bytes]]:
        """Yield topics (keys of ``types``) and messages for an output; see of_wrench."""
        positions = map(sub, output.lengths, self._zero_lengths)
        if output.forces is None:
            yield LEG_STATES, self._without_effort.write_one(
                output.stamp, positions, output.rates)
        else:
            yield LEG_STATES, self._with_effort.write_one(
                output.stamp, positions, output.rates, output.forces)
        yield LEG_LENGTHS, float64_array(output.lengths)
        if output.forces is not None:
            yield LEG_FORCES, float64_array(output.forces)
        yield DETERMINANT, float64(output.determinant)
        if output.warning_changed:
            yield WARNING, boolean(output.singularity.warning)
        motors = output.motors
        if motors and self._motors is not None:
            torques = None if output.forces is None else motors[TORQUES]
            yield MOTOR_STATES, self._motors.write(
                output.stamp, motors[ANGLES], motors[SPEEDS], torques)
            if torques is not None:
                yield MOTOR_TORQUES, float64_array(torques)

    def of_outputs(self, outputs: Outputs) -> list[Written]:
        """
        Return the same messages as ``of_output`` for a batch of outputs.

        Returns (topic, which, messages): in the order in which they are published for one output:
            indices (K,) of the outputs that have this message, and the messages (K,), all of one
            length. A topic may occur twice, for messages with and without forces.
        """
        positions = outputs.lengths - self._zero_lengths
        solved = np.isfinite(outputs.forces[:, 0])
        having, lacking = np.flatnonzero(solved), np.flatnonzero(~solved)
        stamps, rates, forces = outputs.stamps, outputs.rates, outputs.forces
        messages = [
            (LEG_STATES, having, self._with_effort.write(
                stamps[having], positions[having], rates[having], forces[having])),
            (LEG_STATES, lacking, self._without_effort.write(
                stamps[lacking], positions[lacking], rates[lacking])),
            (LEG_LENGTHS, np.arange(len(stamps)), FLOAT64_ARRAY.write(
                None, outputs.lengths)),
            (LEG_FORCES, having, FLOAT64_ARRAY.write(None, forces[having])),
            (DETERMINANT, np.arange(len(stamps)), FLOAT64.write(
                None, outputs.determinants[:, None])),
        ]
        changed = np.flatnonzero(outputs.changed)
        warnings = [boolean(on) for on in outputs.warnings[changed].tolist()]
        messages.append((WARNING, changed, np.frombuffer(
            b''.join(warnings), dtype=f'V{len(boolean(True))}')))
        if self._motors is not None:
            messages += self._of_motors(self._motors, outputs)
        return messages

    def _of_motors(self, writer: JointStateWriter, outputs: Outputs) -> Iterator[Written]:
        rows = outputs.motors
        having = np.isfinite(rows[:, TORQUES.start])
        for effort, which in ((True, having), (False, ~having)):
            at = np.flatnonzero(which & (rows[:, SOUND] > 0.0))
            parts = [ANGLES, SPEEDS, TORQUES][:3 if effort else 2]
            yield MOTOR_STATES, at, writer.layout(effort).write(
                outputs.stamps[at], *(rows[at, part] for part in parts))
            if effort:
                yield MOTOR_TORQUES, at, FLOAT64_ARRAY.write(None, rows[at, TORQUES])

    def of_wrench(self, stamp: int, wrench: Six) -> bytes:
        """Return the geometry_msgs/WrenchStamped of a wrench in base axes."""
        return self._wrench.write(stamp, wrench)

    def of_base_wrenches(self, stamps: Stamps, base_wrenches: Array) -> Written:
        """Return messages for stamps (N,) [ns] and wrenches (N, 6); none for rows of nan."""
        known = np.flatnonzero(~np.isnan(base_wrenches[:, 0]))
        return BASE_WRENCH, known, self._wrench.layout.write(
            stamps[known], base_wrenches[known])


def motor_states_writer(parameters: Parameters) -> JointStateWriter | None:
    """Return the writer of the states of the motors; None without ``drive.*``."""
    names = [f'{joint}_motor' for joint in parameters.joints]
    return JointStateWriter(names) if parameters.drives else None
