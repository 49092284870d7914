# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
From messages on ``~/measured_legs`` to the external wrench; rejections are reported.

A message that is rejected is as one that never came: the estimate goes on with the next one, over
the time between the two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from struct import Struct

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, SECOND, Six, Stamps
from stewart_dynamics.errors import MotionError, PoseError, SingularityError, StewartError
from stewart_dynamics.external_wrench.effort_check import EffortCheck
from stewart_dynamics.external_wrench.estimate import (
    Estimate, ExternalWrench, Measurement, Target)
from stewart_dynamics.external_wrench.rate_check import RateCheck
from stewart_dynamics.mechanics.drives.measured_efforts import (
    force_per_effort, has_losses, STAMPS, without_losses)
from stewart_dynamics.mechanics.rows import BASE, consecutive, MOTION, NO_BASE, TWIST, WRENCH
from stewart_dynamics.messages.joint_state import JointStateReader
from stewart_dynamics.messages.recorded import Messages
from stewart_dynamics.messages.stamp_order import NO_STAMP
from stewart_dynamics.parameters.table import MOTOR_CURRENTS, MOTOR_TORQUES, Parameters
from stewart_dynamics.possible_errors.hypothesis import PossibleError
from stewart_dynamics.setpoints.arrival_stamps import ArrivalStamps
from stewart_dynamics.setpoints.base_input import BaseInput
from stewart_dynamics.setpoints.rejections import (
    BASE_NOT_KNOWN, check_stamp, OUT_OF_RANGE, Rejection, stamp_words)

# A row: the stamp [ns, an integer], pose and twist as in a row of motion, the forces that acted
# since the measurement before [N], the known load, the motion of the base.
_STAMP, MOVED, ACTED, LOADED, OF_BASE = consecutive(1, TWIST.stop, 6, WRENCH, BASE)
TURNED = slice(MOVED.start + TWIST.start, MOVED.start + TWIST.stop)  # the twist
_ROW = Struct(f'q{OF_BASE.stop - 1}d')

# Rate above which the memory holds a shorter time [Hz].
HIGHEST_RATE = 2000.0


class LegHistory:
    """A ring of measurements of some seconds at HIGHEST_RATE; the oldest are overwritten."""

    def __init__(self, seconds: float) -> None:
        self.capacity = round(seconds * HIGHEST_RATE)
        self.count = 0  # how many have been added; measurement n is in row n modulo the capacity
        self._rows = np.zeros((self.capacity, OF_BASE.stop))
        self._memory = self._rows.data.cast('B')

    def add_measurement(self, forces: Six, estimate: Estimate, known: Six) -> None:
        """Add a measurement with the forces since the one before and the load on ``~/wrench``."""
        _ROW.pack_into(
            self._memory, self.count % self.capacity * _ROW.size, estimate.stamp,
            *estimate.motion[:TWIST.stop], *forces, *known, *estimate.base)
        self.count += 1

    def clear(self) -> None:
        """Forget all of them."""
        self.count = 0

    @property
    def first(self) -> int:
        """Return the oldest measurement that is still there."""
        return max(0, self.count - self.capacity)

    def stamps(self, begin: int, end: int) -> Stamps:
        """Return the stamps of measurements from one to another [ns]."""
        column = stamps_of(self._rows)
        low, high = begin % self.capacity, (end - 1) % self.capacity + 1
        if end <= begin:
            return column[:0]
        return column[low:high].copy() if low < high else np.concatenate([
            column[low:], column[:high]])

    def rows(self, begin: int, end: int) -> Array:
        """Return a copy of the rows of measurements from one to another."""
        rows: Array = self._rows[np.arange(begin, end) % self.capacity]
        return rows


def stamps_of(rows: Array) -> Stamps:
    """Return the stamps of rows [ns]."""
    stamps: Stamps = rows.view(np.int64)[:, _STAMP.start]
    return stamps


def motions_of(rows: Array) -> Array:
    """Return rows of motion (N, MOTION) of rows, without accelerations."""
    motions = np.zeros((len(rows), MOTION))
    motions[:, :TWIST.stop] = rows[:, MOVED]
    return motions


# Under the node's name.
MEASURED_LEGS = 'measured_legs'

# Why a message is rejected, beside the reasons of ``joint_state`` and ``rejections``.
UNSTAMPED = 'without a stamp'
NOT_CONVERGED = 'forward kinematics did not converge'
SINGULAR = 'singular pose'

_OF_ERROR = {PoseError: NOT_CONVERGED, SingularityError: SINGULAR, MotionError: OUT_OF_RANGE}


class EffortsOfMotors:
    """Takes measured torques or currents of motors as efforts of the drives."""

    def __init__(self, parameters: Parameters) -> None:
        efforts = parameters.external_wrench.efforts
        self._parameters = parameters
        self._factors = force_per_effort(
            parameters, efforts == MOTOR_TORQUES, efforts == MOTOR_CURRENTS)
        self._losses = self._factors is not None and has_losses(parameters)
        self._longest_gap = parameters.setpoint.timeout * SECOND
        self._before: Measurement | None = None

    def to_drives(self, measurement: Measurement) -> Measurement:
        """Return a measurement with efforts of the drives."""
        if self._factors is None:
            return measurement
        efforts = self._factors * measurement.efforts
        if self._losses:
            before, self._before = self._before, measurement
            rates: Array = np.array([measurement.rates])
            accelerations: Array = np.zeros((1, 6))
            # Torque that accelerates the rotor passes no gear.
            if before and 0 < (passed := measurement.stamp - before.stamp) <= self._longest_gap:
                accelerations = (rates - before.rates) / (passed * NANOSECOND)
            efforts = without_losses(efforts[None], rates, accelerations, self._parameters)[0]
        a, b, c, d, e, f = efforts.tolist()
        return measurement._replace(efforts=(a, b, c, d, e, f))


class MeasuredLegs:
    """
    Follows the measured legs.

    ``rejected`` is called with each rejection and its details, ``noticed`` with texts for the log;
    ``history`` gets the measurements that are used.
    """

    def __init__(
            self, parameters: Parameters, step: ExternalWrench,
            rejected: Callable[[Rejection, str], None],
            noticed: Callable[[str], object], history: LegHistory | None = None) -> None:
        self._step, self._of_motors = step, EffortsOfMotors(parameters)
        self._efforts, self._rates = EffortCheck(parameters), RateCheck(parameters)
        self._stamps = ArrivalStamps()
        self._reader = JointStateReader(
            parameters.joints, gap=round(parameters.setpoint.timeout * SECOND))
        self._zero_lengths = tuple(parameters.geometry.zero_length.tolist())
        self._timeout = round(parameters.setpoint.timeout * SECOND)
        self._rejected = rejected
        self._noticed = noticed
        self._history = history
        self._last: Estimate | None = None

    @property
    def motion(self) -> tuple[float, ...] | None:
        """Row of motion of the last message that was used."""
        return self._last.motion if self._last else None

    @property
    def possible_error(self) -> PossibleError | None:
        """Possible error in stamps, velocities or efforts: the former may look like the latter."""
        if self._stamps.present is not None:
            return PossibleError(STAMPS, self._stamps.present[0])
        return self._rates.possible_error or self._efforts.possible_error

    def use_parameters(self, parameters: Parameters, step: ExternalWrench) -> None:
        """Use changed parameters from now on."""
        self._step, self._of_motors = step, EffortsOfMotors(parameters)
        if self._efforts.possible_error is not None:
            self._efforts = EffortCheck(parameters)  # they may have been the error

    def use_message(self, data: bytes, known: Six, target: Target | None,
                    base: BaseInput | None = None) -> Estimate | None:
        """
        Return the estimate from a sensor_msgs/JointState (CDR), or None where it is rejected.

        A part of the legs gives the last estimate that it completes, None if it completes no
        measurement.

        ``known`` and ``target`` are those of ``ExternalWrench``; by default the base is still.
        """
        found = None
        for measurement in self._measurements(data):
            if check_stamp(measurement.stamp, self._last and self._last.stamp, self._timeout,
                           self._reject, self._notice_restart):
                found = self._estimated(
                    self._of_motors.to_drives(measurement), known, target, base) or found
        return found

    def _estimated(self, measurement: Measurement, known: Six, target: Target | None,
                   base: BaseInput | None) -> Estimate | None:
        """Return the estimate from a measurement, or reject it."""
        row = (base.at(measurement.stamp) if base else None) or NO_BASE
        if base and base.topics and row[0] != row[0]:
            self._reject(BASE_NOT_KNOWN, stamp_words(measurement.stamp))
            return None
        try:
            last = self._step(measurement, self._last, known, target, row)
        except StewartError as exc:
            self._reject(_OF_ERROR[type(exc)], str(exc))
            return None
        self._efforts.add(last.stamp, measurement.efforts, last.differences)
        self._rates.add(measurement, last)
        self._stamps.add_readings([last.stamp], [measurement.positions])
        error = self.possible_error
        self._last = last if error is None else last._replace(possible_error=error)
        if self._history is not None:
            self._history.add_measurement(measurement.efforts, self._last, known)
        return self._last

    def _reject(self, reason: str, details: str) -> None:
        self._rejected(Rejection(MEASURED_LEGS, reason), details)

    def _measurements(self, data: bytes) -> Iterator[Measurement]:
        """Yield the measurements that a message completes, or reject it."""
        states = self._reader.read_states(Messages.single(MEASURED_LEGS, data))
        if states.rejected and not len(states.stamps):
            self._reject(*states.last)
        z = self._zero_lengths
        for stamp, p in zip(states.stamps.tolist(), map(tuple, states.values.tolist()),
                            strict=True):
            if stamp == NO_STAMP:
                self._reject(UNSTAMPED, 'accelerations need the time between two messages')
                continue
            yield Measurement(
                stamp,
                (p[0] + z[0], p[1] + z[1], p[2] + z[2], p[3] + z[3], p[4] + z[4], p[5] + z[5]),
                p[6:12], p[12:18])

    def _notice_restart(self, text: str) -> None:
        self._noticed(f'{MEASURED_LEGS}: {text}')
