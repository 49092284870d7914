# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Messages to publish or write for outputs of the step, external wrenches and base wrenches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, Stamps
from stewart_dynamics.legs.kind import LegKind
from stewart_dynamics.mechanics import rows
from stewart_dynamics.mechanics.drives.servos import with_servos
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.layout import MessageRows, Written
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.messages.standard import BOOLEAN, FLOAT64, FLOAT64_ARRAY
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints.base_wrench_step import BASE_WRENCH
from stewart_dynamics.setpoints.step import (
    CHANGED, FINITE_MOTORS, MOTOR_ANGLES, MOTOR_COMMANDS, MOTOR_SPEEDS, OUTPUT, Outputs, POSITIONS,
    WARNING_STATE)

LEG_STATES, DETERMINANT, WARNING = (
    'leg_states', 'jacobian_determinant', 'singularity_warning')
MOTOR_STATES, MOTOR_TORQUES = 'motor_states', 'motor_torques'
SERVO_PULSES = 'servo_pulses'


class LegTopics(NamedTuple):
    """Topics that are named by the quantities of a kind of legs."""

    positions: str  # leg_lengths
    efforts: str  # those to command: leg_forces

    @classmethod
    def of(cls, kind: LegKind) -> LegTopics:
        """Return the topics of a kind."""
        return cls(f'leg_{kind.position.field}', f'leg_{kind.effort.field}')


def output_types(kind: LegKind) -> dict[str, str]:
    """
    Return the topics that hexapods with a kind of legs have, and their types.

    Topics are relative to the node's name, in the order in which they are published for a
    setpoint.
    """
    return {
        LEG_STATES: type_names.JOINT_STATE,
        **dict.fromkeys(LegTopics.of(kind), type_names.FLOAT64_MULTI_ARRAY),
        DETERMINANT: type_names.FLOAT64,
        WARNING: type_names.BOOL,
        BASE_WRENCH: type_names.WRENCH_STAMPED,
    }


# With drive.*.
MOTOR_TYPES = {
    MOTOR_STATES: type_names.JOINT_STATE,
    MOTOR_TORQUES: type_names.FLOAT64_MULTI_ARRAY,
}
# With servo.*.
SERVO_TYPES = {SERVO_PULSES: type_names.FLOAT64_MULTI_ARRAY}


class OutputMessages:
    """
    Writes the output messages.

    types: topics that the hexapod has, and their types.
    """

    def __init__(self, parameters: Parameters) -> None:
        kind = parameters.leg_kind
        states, topics = JointStateWriter(parameters.joints), LegTopics.of(kind)
        effort, moving = kind.published.start, [POSITIONS, kind.rate.columns]
        kinds = [
            Written(LEG_STATES, states.layout(True), [*moving, kind.published], known=effort),
            Written(LEG_STATES, states.layout(False), moving, unknown=effort),
            Written(topics.positions, FLOAT64_ARRAY, [kind.position.columns]),
            Written(topics.efforts, FLOAT64_ARRAY, [kind.published], known=effort),
            Written(DETERMINANT, FLOAT64, [slice(rows.DETERMINANT, rows.CONDITION)]),
            Written(WARNING, BOOLEAN, [WARNING_STATE], positive=CHANGED)]
        self.types = output_types(kind)
        if (motors := motor_states_writer(parameters)) is not None:
            torque, turning = MOTOR_COMMANDS.start, [MOTOR_ANGLES, MOTOR_SPEEDS]
            kinds += [
                Written(MOTOR_STATES, motors.layout(True), [*turning, MOTOR_COMMANDS],
                        known=torque, positive=FINITE_MOTORS),
                Written(MOTOR_STATES, motors.layout(False), turning, unknown=torque,
                        positive=FINITE_MOTORS),
                Written(MOTOR_TORQUES, FLOAT64_ARRAY, [MOTOR_COMMANDS], known=torque,
                        positive=FINITE_MOTORS)]
            self.types |= MOTOR_TYPES
        servos = None
        if with_servos(parameters):  # an angle outside the points of its servo has no pulse
            servos = parameters.structure
            kinds.append(Written(SERVO_PULSES, FLOAT64_ARRAY, [slice(OUTPUT, OUTPUT + 6)],
                                 known=OUTPUT))
            self.types |= SERVO_TYPES
        self.rows = MessageRows(kinds, OUTPUT, servos)
        self._wrench = StampedWriter(parameters.base_frame, 6)

    def write_outputs(self, outputs: Outputs) -> list[tuple[str, Flags, NDArray[np.void]]]:
        """
        Return the messages for outputs, in the order in which they are published for one.

        Returns topics, which outputs have a message (N,), and the messages (N,), of one length.
        """
        return self.rows.write(outputs.stamps, outputs.rows)

    def write_wrench(self, stamp: int, wrench: Sequence[float]) -> bytes:
        """Return the geometry_msgs/WrenchStamped of a wrench in base axes."""
        return self._wrench.write(stamp, wrench)

    def write_base_wrenches(self, stamps: Stamps, base_wrenches: Array) -> tuple[
            str, Flags, NDArray[np.void]]:
        """Return messages for stamps (N,) [ns] and wrenches (N, 6); none for rows of nan."""
        messages = self._wrench.layout.write(stamps, base_wrenches)
        return BASE_WRENCH, ~np.isnan(base_wrenches[:, 0]), messages


def motor_states_writer(parameters: Parameters) -> JointStateWriter | None:
    """Return the writer of the states of the motors; None without ``drive.*``."""
    names = [f'{joint}_motor' for joint in parameters.joints]
    return JointStateWriter(names) if parameters.drives else None
