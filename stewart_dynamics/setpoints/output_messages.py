# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages to publish or write for outputs of the step, external wrenches and base wrenches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, Stamps
from stewart_dynamics.mechanics import rows
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.layout import SideBySide
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.messages.standard import BOOLEAN, FLOAT64, FLOAT64_ARRAY
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.motor_row import ANGLES, MOTOR_ROW, SOUND, SPEEDS, TORQUES
from stewart_dynamics.setpoints.step import (
    OUTPUT, Outputs, POSITIONS, PUBLISHED_FORCES, WARNING_STATE)

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
Written = tuple[str, Flags, NDArray[np.void]]
"""A topic, which of N outputs have a message on it, and the messages (N,), all of one size."""


class OutputMessages:
    """
    Writes the output messages; not thread-safe, as the step.

    types: topics that the hexapod has, and their types.
    """

    def __init__(self, parameters: Parameters) -> None:
        leg_states = JointStateWriter(parameters.joints)
        self._of_rows = SideBySide([
            (leg_states.layout(True), [POSITIONS, rows.RATES, PUBLISHED_FORCES]),
            (leg_states.layout(False), [POSITIONS, rows.RATES]),
            (FLOAT64_ARRAY, [rows.LENGTHS]), (FLOAT64_ARRAY, [PUBLISHED_FORCES]),
            (FLOAT64, [slice(rows.DETERMINANT, rows.CONDITION)]), (BOOLEAN, [WARNING_STATE]),
        ], OUTPUT)
        motor_states = motor_states_writer(parameters)
        self._of_motors = None if motor_states is None else SideBySide([
            (motor_states.layout(True), [ANGLES, SPEEDS, TORQUES]),
            (motor_states.layout(False), [ANGLES, SPEEDS]), (FLOAT64_ARRAY, [TORQUES]),
        ], MOTOR_ROW)
        self.types = OUTPUT_TYPES | (MOTOR_TYPES if self._of_motors else {})
        self._wrench = StampedWriter(parameters.base_frame, 6)

    def of(self, outputs: Outputs) -> Iterator[Written]:
        """Yield the messages for outputs, in the order in which they are published for one."""
        messages, known = self._of_rows.write(outputs.stamps, outputs.rows), outputs.with_forces
        yield LEG_STATES, known, next(messages)
        yield LEG_STATES, ~known, next(messages)
        every = known | True
        yield LEG_LENGTHS, every, next(messages)
        yield LEG_FORCES, known, next(messages)
        yield DETERMINANT, every, next(messages)
        yield WARNING, outputs.changed, next(messages)
        if self._of_motors is not None:
            motors = outputs.motors
            messages = self._of_motors.write(outputs.stamps, motors)
            sound, driven = motors[:, SOUND] > 0.0, ~np.isnan(motors[:, TORQUES.start])
            yield MOTOR_STATES, sound & driven, next(messages)
            yield MOTOR_STATES, sound & ~driven, next(messages)
            yield MOTOR_TORQUES, sound & driven, next(messages)

    def of_wrench(self, stamp: int, wrench: Sequence[float]) -> bytes:
        """Return the geometry_msgs/WrenchStamped of a wrench in base axes."""
        return self._wrench.write(stamp, wrench)

    def of_base_wrenches(self, stamps: Stamps, base_wrenches: Array) -> Written:
        """Return messages for stamps (N,) [ns] and wrenches (N, 6); none for rows of nan."""
        messages = self._wrench.layout.write(stamps, base_wrenches)
        return BASE_WRENCH, ~np.isnan(base_wrenches[:, 0]), messages


def motor_states_writer(parameters: Parameters) -> JointStateWriter | None:
    """Return the writer of the states of the motors; None without ``drive.*``."""
    names = [f'{joint}_motor' for joint in parameters.joints]
    return JointStateWriter(names) if parameters.drives else None
