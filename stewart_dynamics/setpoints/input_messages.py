# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Converts messages of an input topic to checked samples.

A sample is a stamp and the message's numbers, with the quaternion of a pose replaced by the
rotation matrix. Node and replay apply the same checks and get bit-identical samples.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Integers, NO_WRENCH, Six, Stamps
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.mechanics.frames.rotation import quaternion_length
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.setpoint import MESSAGE_TYPES, read_message
from stewart_dynamics.parameters import table
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.parameters.tolerances import unit_rule
from stewart_dynamics.setpoints.rejections import (
    frame_details, MALFORMED, NOT_FINITE, NOT_MEASURED, NOT_UNIT, OUT_OF_RANGE, Rejections,
    WRONG_FRAME)

# Topics, relative to the node's name.
POSE = 'setpoint/pose'
TWIST = 'setpoint/twist'
ACCEL = 'setpoint/accel'
COMBINED = 'setpoint/combined'
BASE_POSE = 'base/pose'
BASE_TWIST = 'base/twist'
BASE_ACCEL = 'base/accel'
BASE_IMU = 'base/imu'
WRENCH = 'wrench'
VEHICLE = 'vehicle'

INPUT_TYPES = {
    POSE: type_names.POSE_STAMPED,
    TWIST: type_names.TWIST_STAMPED,
    ACCEL: type_names.ACCEL_STAMPED,
    COMBINED: type_names.MULTI_DOF_JOINT_TRAJECTORY,
    BASE_POSE: type_names.POSE_STAMPED,
    BASE_TWIST: type_names.TWIST_STAMPED,
    BASE_ACCEL: type_names.ACCEL_STAMPED,
    BASE_IMU: type_names.IMU,
    WRENCH: type_names.WRENCH_STAMPED,
    VEHICLE: type_names.IMU,
}

# Topics that are joined, for each value of setpoint.source.
SOURCES = {
    table.SEPARATE: (POSE, TWIST, ACCEL), table.COMBINED: (COMBINED,), table.POSES_ALONE: (POSE,)}
# Topics that are joined, for each value of base.source.
BASE_SOURCES = {
    table.FIXED: (), table.AT_REST: (BASE_POSE,),
    table.MOVING: (BASE_POSE, BASE_TWIST, BASE_ACCEL), table.BY_IMU: (BASE_IMU,)}

_IMUS = BASE_IMU, VEHICLE
_BOUNDED = BASE_POSE, BASE_TWIST, BASE_ACCEL, *_IMUS
# Numbers of a sample, by the type of the messages.
_WIDTHS = {type_names.POSE_STAMPED: 12, type_names.MULTI_DOF_JOINT_TRAJECTORY: 24}

# Indices of an IMU's angular velocity, specific force, and the first entries of their
# covariances, which are -1 if a quantity is not measured. Its orientation is not used.
_OF_IMU = (13, 14, 15, 25, 26, 27)
_COVARIANCES = {16: 'angular_velocity_covariance', 28: 'linear_acceleration_covariance'}
# Bound on numbers of the base's motion [SI units]: larger ones would disturb filters for long.
LARGEST = 1e9


class TopicSamples(NamedTuple):
    """Valid messages of a topic, N of them."""

    stamps: Stamps  # (N,) [ns]
    values: Array  # (N, width)
    places: Integers  # (N,): index of each message


class SampleReader:
    """
    Reads the messages of one topic, and rejects those that are not valid.

    topic: one of ``INPUT_TYPES``.
    frame: required frame_id; an empty one is accepted. None: the first non-empty one is required.
    memory (1,): of the structure ``input_topic``; by default it has one of its own.
    width: numbers of a sample.
    """

    def __init__(self, topic: str, frame: str | None, rejections: Rejections,
                 memory: Any = None) -> None:
        self.topic, self._kind = topic, INPUT_TYPES[topic]
        self.width = _WIDTHS.get(self._kind, 6)
        self._rejections = rejections
        self._memory = np.zeros(1, record('input_topic')) if memory is None else memory
        required = b'' if frame is None else frame.encode()
        self._memory['type'] = MESSAGE_TYPES[self._kind]
        self._memory['largest'] = LARGEST if topic in _BOUNDED else sys.float_info.max
        self._memory['frame_size'] = -1 if frame is None else len(required)
        shown = required[:CODES['FRAME_ROOM']]
        self._memory['frame'][0, :len(shown)] = np.frombuffer(shown, np.uint8)

    def read_samples(self, messages: Messages) -> TopicSamples:
        """Return the samples of messages that are valid; reject the others."""
        count = len(messages.times)
        stamps, values = np.empty(count, np.int64), np.empty((count, self.width))
        events = np.empty(count, np.int64)
        function('read_samples')(self._memory, self.width, count, *messages.places_in_data(),
                                 stamps, values, events)
        for n in np.flatnonzero(events).tolist():
            self.reject_message(int(events[n]), messages.bytes_of(n))
        places = np.flatnonzero(events == CODES['EVENT_NONE'])
        return TopicSamples(stamps[places], values[places], places)

    def reject_message(self, event: int, data: bytes) -> None:
        """Reject a message for the reason that C has found, with details."""
        try:
            message = read_message(self._kind, data)
        except MalformedError as exc:
            self._rejections.reject(self.topic, MALFORMED, str(exc))
            return
        values = message.values
        lacking = [name for at, name in _COVARIANCES.items()
                   if self.topic in _IMUS and values[at] == -1.0]
        if self.topic in _IMUS:
            values = tuple([values[at] for at in _OF_IMU])
        if event == CODES['EVENT_WRONG_FRAME']:
            required = self._memory['frame'][0, :self._memory['frame_size'][0]].tobytes()
            reason, details = WRONG_FRAME, frame_details(message.frame, required)
        elif event == CODES['EVENT_NOT_MEASURED']:
            reason, details = NOT_MEASURED, f'{lacking[0]}[0] is -1'
        elif event == CODES['EVENT_NOT_FINITE']:
            reason, details = NOT_FINITE, str(values)
        elif event == CODES['EVENT_OUT_OF_RANGE']:
            reason, details = OUT_OF_RANGE, f'{values}: must be at most {LARGEST:g}'
        else:
            reason, details = NOT_UNIT, unit_rule(quaternion_length(*values[3:7]))
        self._rejections.reject(self.topic, reason, details)


class WrenchInput:
    """Follows the ``~/wrench`` of the simulator."""

    def __init__(self, parameters: Parameters, rejections: Rejections) -> None:
        self.wrench: Six = NO_WRENCH
        """Force and moment at the platform's origin, base axes [N, N m]."""
        self._reader = SampleReader(WRENCH, parameters.base_frame, rejections)

    def use_message(self, data: bytes) -> None:
        """Use the wrench of this geometry_msgs/WrenchStamped from now on, if it is valid."""
        for row in self._reader.read_samples(Messages.single(WRENCH, data)).values.tolist():
            fx, fy, fz, tx, ty, tz = row
            self.wrench = fx, fy, fz, tx, ty, tz
