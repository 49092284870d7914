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
What the legs feel: the load that touches the platform, from measured lengths, rates and forces.

The machine obeys ``M X'' + C X' + G = J_inv^T f + w + w_touch`` with the leg forces f that were
measured, the load w that ``~/wrench`` says, which is known and not external, and what touches the
platform besides. The inverse path gives the forces f_model of the same motion without a touch, so

    w_touch = J_inv^T (f_model - f)

with the sign of ``~/wrench``: the load that the surroundings put on the platform at its origin,
base axes, the negative of the residual wrench in ``replay.measured``. All that the model does not
have is in it: a wrong payload or friction, a brake, an end stop.

Pose and twist come from lengths and rates (``forward_kinematics``); the acceleration is the
difference of two twists by the time between them, its mean over that time. The forces are those
that acted in that time, as a controller holds them, and all else is the mean of what it is at both
ends (the trapezoidal rule, an error of second order). The difference quotient is rough, and passes
through a low-pass filter of the first order, ``r' = 2 pi cutoff (w_touch - r)``, solved exactly
for any time dt between two samples, over which w_touch is constant; it begins at zero. That is the
generalized momentum observer of De Luca et al. (Collision detection and safe reaction with the
DLR-III lightweight manipulator arm, IROS 2006, doi:10.1109/IROS.2006.282053) with the gain K =
2 pi cutoff: of r' = K (p' - u - r), p the momentum, it takes the integral, r = K (p -
integral(u + r)), and here the same equation is solved step by step. So noise is no worse than
there: white noise of deviation s in a twist comes out as M K s at most, however short dt is, while
the difference quotient alone has sqrt(2) M s / dt.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
import math
from struct import Struct
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NO_WRENCH, Six
from stewart_dynamics.errors import MotionError, PoseError, SingularityError
from stewart_dynamics.mechanics import forward_kinematics, kernel
from stewart_dynamics.mechanics.hexapod_constants import CONSTANTS
from stewart_dynamics.mechanics.home_pose import homes
from stewart_dynamics.mechanics.jit import entry_point, inlined
from stewart_dynamics.mechanics.rows import FORCES, MOTION, RESULT, WRENCH
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.mechanics.vectors import cross
from stewart_dynamics.messages import cdr
from stewart_dynamics.parameters import Parameters

# Under the node's name.
EXTERNAL_WRENCH = 'external_wrench'

# What became of a measurement, beside what forward_kinematics says of its pose.
_OUT_OF_RANGE = 3

# One measurement in numbers: machine, lengths, rates, forces, known load, filter before, gain of
# the filter, time since the last one (0: there is none), motion of the last one or guess; then,
# written, motion (behind the last one: two rows for solve), filter after, measured - model forces,
# steps and residual of the pose, code.
_LENGTHS = CONSTANTS
_RATES = _LENGTHS + 6
_FORCES = _RATES + 6
_KNOWN = _FORCES + 6
_BEFORE = _KNOWN + WRENCH
_GAIN = _BEFORE + 6
_INTERVAL = _GAIN + 1
_MOTION = _INTERVAL + 1
_RESULT = _MOTION + MOTION
_MOTION_AFTER = _RESULT
_AFTER = _MOTION_AFTER + MOTION
_DIFFERENCES = _AFTER + 6
_STEPS = _DIFFERENCES + 6
_RESIDUAL = _STEPS + 1
_CODE = _RESIDUAL + 1
_NUMBERS = _CODE + 1
_GIVEN = Struct(f'{_RESULT - _LENGTHS}d')
_GIVES = Struct(f'{_NUMBERS - _RESULT}d')


class Measurement(NamedTuple):
    """What was measured of the six legs at one time."""

    stamp: int
    """[ns]"""
    lengths: Six
    """[m]"""
    rates: Six
    """[m/s]"""
    forces: Six
    """Of the actuators since the last measurement [N], + pushes."""


class Overload(NamedTuple):
    """A threshold that the external wrench is beyond."""

    limit: str
    value: float
    bound: float


class Estimate(NamedTuple):
    """What a measurement tells of platform and surroundings."""

    stamp: int
    motion: tuple[float, ...]
    """A row of motion: pose, twist, and the acceleration since the last measurement."""
    wrench: Six | None
    """The load that touches the platform, filtered; none of the first measurement [N, N m]."""
    differences: Six | None
    """Measured - model, not filtered (6) [N]; none of the first measurement."""
    overloads: tuple[Overload, ...] = ()

    @property
    def force(self) -> float:
        """Of the wrench [N]."""
        return math.hypot(*self.wrench[:3]) if self.wrench else 0.0

    @property
    def moment(self) -> float:
        """Of the wrench [N m]."""
        return math.hypot(*self.wrench[3:]) if self.wrench else 0.0


@inlined
def _add_end(numbers: Array, machine: Array, motion: Array, result: Array) -> None:
    """Add what one end of the interval has of the wrench and of the differences: half of each."""
    position = motion[0], motion[1], motion[2]
    rotation = (motion[3], motion[4], motion[5], motion[6], motion[7], motion[8], motion[9],
                motion[10], motion[11])
    for leg in range(6):
        a, _length, _inverse_length, s = kernel.leg_line(machine, leg, position, rotation)
        m = cross(a, s)
        half = 0.5 * (numbers[_FORCES + leg] - result[FORCES.start + leg])
        numbers[_DIFFERENCES + leg] += half
        for n in range(3):
            numbers[_AFTER + n] -= half * s[n]
            numbers[_AFTER + 3 + n] -= half * m[n]


@entry_point
def _one(numbers: Array) -> None:
    """Write what one measurement gives; an array costs time to pass."""
    machine = numbers[:CONSTANTS]
    motion = numbers[_MOTION_AFTER:_MOTION_AFTER + MOTION]
    motion[:] = numbers[_MOTION:_MOTION + MOTION]
    code, numbers[_STEPS], numbers[_RESIDUAL] = forward_kinematics.pose(
        machine, numbers[_LENGTHS:_LENGTHS + 6], motion)
    numbers[_CODE] = code
    if code != forward_kinematics.FOUND:
        return
    forward_kinematics.twist(machine, numbers[_RATES:_RATES + 6], motion)
    dt = numbers[_INTERVAL]
    for n in range(6):
        motion[18 + n] = (motion[12 + n] - numbers[_MOTION + 12 + n]) / dt if dt > 0.0 else 0.0
        numbers[_MOTION + 18 + n] = motion[18 + n]
        numbers[_AFTER + n] = 0.0
        numbers[_DIFFERENCES + n] = 0.0
    if dt > 0.0:
        motions = numbers[_MOTION:_MOTION_AFTER + MOTION].reshape(2, MOTION)
        results = np.empty((2, RESULT))
        kernel.solve(machine, motions, numbers[_KNOWN:_KNOWN + WRENCH].reshape(
            1, WRENCH), results)
        for end in range(2):
            _add_end(numbers, machine, motions[end], results[end])
        for n in range(6):
            before = numbers[_BEFORE + n]
            numbers[_AFTER + n] = before + numbers[_GAIN] * (numbers[_AFTER + n] - before)
    for n in range(_RESULT, _STEPS):
        if not math.isfinite(numbers[n]):
            numbers[_CODE] = _OUT_OF_RANGE


class ExternalWrench:
    """
    The step from a measurement to the external wrench, for a machine with given parameters.

    Parameters
    ----------
    parameters : Parameters
        They hold for every call. One thread at a time may call it: a call works in memory that is
        its own.

    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._numbers = np.zeros(_NUMBERS)
        self._memory = self._numbers.data  # the same as bytes
        self._numbers[:CONSTANTS] = StewartPlatform(parameters).constants
        self._longest_gap = round(parameters['setpoint.timeout'] * 1e9)
        self._rate = 2.0 * math.pi * parameters['external_wrench.cutoff']
        self._most_force, self._most_moment = (
            parameters[f'{EXTERNAL_WRENCH}.{limit}'] for limit in ('force_max', 'moment_max'))
        self._message = cdr.Numbers(parameters['base_frame'], 6)

    def __call__(self, measurement: Measurement, before: Estimate | None, known: Six,
                 target: Sequence[float] | None) -> Estimate:
        """
        Return the estimate.

        Parameters
        ----------
        measurement : Measurement
            A finite one.
        before : Estimate, optional
            The last one. Where it is of a later stamp, or further back than
            ``setpoint.timeout``, only its pose is looked at, and the filter starts anew.
        known : six numbers
            The load that ``~/wrench`` says [N, N m].
        target : sequence of float, optional
            The last setpoint, as a row of motion.

        Raises
        ------
        PoseError, SingularityError
            The lengths belong to no pose near the last one. Where there is none so far, or not
            since ``setpoint.timeout``, near the target and at home neither.
        MotionError
            Numbers overflow.

        """
        given = (*measurement.lengths, *measurement.rates, *measurement.forces, *known)
        interval = 0 if before is None else measurement.stamp - before.stamp
        if before is not None and 0 < interval <= self._longest_gap:
            seconds = interval * 1e-9
            result = self._solve(given, before.wrench or NO_WRENCH, seconds, before.motion)
        else:
            for guess in self._guesses(before, target):
                result = self._solve(given, NO_WRENCH, 0.0, guess)
                if result[_CODE - _RESULT] == forward_kinematics.FOUND:
                    break
        if result[_CODE - _RESULT] != forward_kinematics.FOUND:
            raise _error(measurement, result)
        motion = result[:MOTION]
        if not 0 < interval <= self._longest_gap:
            return Estimate(measurement.stamp, motion, None, None)
        fx, fy, fz, tx, ty, tz = result[_AFTER - _RESULT:_DIFFERENCES - _RESULT]
        d0, d1, d2, d3, d4, d5 = result[_DIFFERENCES - _RESULT:_STEPS - _RESULT]
        estimate = Estimate(measurement.stamp, motion, (fx, fy, fz, tx, ty, tz),
                            (d0, d1, d2, d3, d4, d5))
        overloads = tuple(self._overloads(estimate))
        return estimate._replace(overloads=overloads) if overloads else estimate

    def message(self, estimate: Estimate) -> bytes:
        """Return the geometry_msgs/WrenchStamped of an estimate that has a wrench."""
        return self._message.write(estimate.stamp, estimate.wrench or NO_WRENCH)

    def _solve(self, given: tuple[float, ...], before: Six, interval: float,
               motion: Sequence[float]) -> tuple[float, ...]:
        # Computed here: compiled code has an expm1 of its own.
        gain = -math.expm1(-self._rate * interval)
        _GIVEN.pack_into(self._memory, 8 * _LENGTHS, *given, *before, gain, interval, *motion)
        _one(self._numbers)
        return _GIVES.unpack_from(self._memory, 8 * _RESULT)

    def _guesses(self, before: Estimate | None, target: Sequence[float] | None,
                 ) -> Iterator[Sequence[float]]:
        if before is not None:
            yield before.motion
        if target is not None:
            yield target
        yield from self._homes

    @cached_property
    def _homes(self) -> list[list[float]]:
        # Milliseconds, for what is seldom asked for.
        return [[*position.tolist(), *rotation.ravel().tolist(), *NO_WRENCH, *NO_WRENCH]
                for position, rotation in zip(*homes(self._parameters), strict=True)]

    def _overloads(self, estimate: Estimate) -> Iterator[Overload]:
        for limit, value, bound in (('force_max', estimate.force, self._most_force),
                                    ('moment_max', estimate.moment, self._most_moment)):
            if bound is not None and value > bound:
                yield Overload(f'{EXTERNAL_WRENCH}.{limit}', value, bound)


def _error(measurement: Measurement, result: tuple[float, ...],
           ) -> PoseError | SingularityError | MotionError:
    code, lengths = result[_CODE - _RESULT], ', '.join(f'{x:.6g}' for x in measurement.lengths)
    if code == _OUT_OF_RANGE:
        return MotionError(f'stamp {measurement.stamp} ns')
    if code == forward_kinematics.SINGULAR:
        return SingularityError(f'lengths [{lengths}] m')
    return PoseError(f'lengths [{lengths}] m: after {result[_STEPS - _RESULT]:.0f} steps a length '
                     f'is {result[_RESIDUAL - _RESULT]:.3g} m off')
