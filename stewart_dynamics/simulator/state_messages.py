# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The messages of the simulator, for states of the plant and of its base."""

from __future__ import annotations

from collections.abc import Iterator
from operator import sub

from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.messages.setpoint import ImuWriter, StampedWriter
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.setpoints import input_messages as inputs
from stewart_dynamics.setpoints.output_messages import (
    LEG_STATES, MOTOR_STATES, motor_states_writer)
from stewart_dynamics.simulator.imu import SimulatedImu
from stewart_dynamics.simulator.moving_base import BasePeriod
from stewart_dynamics.simulator.plant import PlantState
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

# Under the node's name; those that it publishes in their order.
INPUT_TYPES = {
    'commands': type_names.FLOAT64_MULTI_ARRAY,
    'wrench': type_names.WRENCH_STAMPED,
}
OUTPUT_TYPES = {
    LEG_STATES: type_names.JOINT_STATE,
    'pose': type_names.POSE_STAMPED,
    'twist': type_names.TWIST_STAMPED,
    'accel': type_names.ACCEL_STAMPED,
}
# Topics of the base: published if its motion is generated, subscribed if it comes by topics.
BASE_TYPES = {topic: inputs.INPUT_TYPES[topic] for topic in inputs.BASE_SOURCES['motion']}
IMU = 'imu'
IMU_TYPE = inputs.INPUT_TYPES[inputs.BASE_IMU]


class StateMessages:
    """Writes the messages of states."""

    def __init__(self, parameters: Parameters) -> None:
        self._zero_lengths = parameters.geometry.zero_length.tolist()
        self._joint_state = JointStateWriter(parameters.joints)
        self._motors = motor_states_writer(parameters)
        frame = parameters.base_frame
        self._pose, self._six = StampedWriter(frame, 7), StampedWriter(frame, 6)

    def write(self, stamp: int, state: PlantState) -> Iterator[tuple[str, bytes]]:
        """Yield topics and messages of a state at a time [ns]."""
        yield LEG_STATES, self._joint_state.write(
            stamp, map(sub, state.positions, self._zero_lengths), state.rates, state.efforts)
        if state.motors and self._motors is not None:
            yield MOTOR_STATES, self._motors.write(stamp, *state.motors)
        yield 'pose', self._pose.write(stamp, state.pose)
        yield 'twist', self._six.write(stamp, state.twist)
        yield 'accel', self._six.write(stamp, state.acceleration)


class BaseMessages:
    """Writes the messages of a base that moves."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        frame = parameters.world_frame
        self._pose, self._six = StampedWriter(frame, 7), StampedWriter(frame, 6)
        self._imu = SimulatedImu(parameters)
        self._imu_writer = ImuWriter(IMU, parameters.imu.noise.angular_velocity,
                                     parameters.imu.noise.specific_force)
        self._imu_periods = round(parameters.rate / parameters.imu.rate)

    def write(self, stamp: int, index: int, period: BasePeriod) -> Iterator[tuple[str, bytes]]:
        """Yield topics and messages for the end of a period: its time [ns] and its number."""
        # The IMU first: a program that answers the motion of the base with a setpoint may be
        # faster than messages published later, and the node would lack the reading of that time.
        if index % self._imu_periods == 0:
            readings = self._imu.read(period.rows[-1])
            yield IMU, self._imu_writer.write(stamp, readings[:3], readings[3:])
        if period.pose:
            yield inputs.BASE_POSE, self._pose.write(stamp, period.pose)
            yield inputs.BASE_TWIST, self._six.write(stamp, period.twist)
            yield inputs.BASE_ACCEL, self._six.write(stamp, period.acceleration)
