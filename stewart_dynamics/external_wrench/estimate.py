# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The external wrench: the load on the platform that measured lengths, rates and forces show.

The hexapod obeys ``M X'' + C X' + G = J_inv^T f + w + w_ext`` with the measured leg forces f, the
known load w on ``~/wrench`` and the external wrench w_ext. The inverse dynamics
give the forces f_model of the same motion without it, so

    w_ext = J_inv^T (f_model - f)

(J_q in place of J_inv where screws turn with their legs: ``drives.screws``), with the sign of
``~/wrench``: the load that the surroundings put on the platform at its origin,
base axes. It includes all forces that the model lacks: a wrong payload or friction, a brake, an
end stop. ``external_wrenches`` is this equation for recorded samples, as the replay uses it.

Online, pose and twist come from lengths and rates (``forward_kinematics``); the acceleration is
the difference of two twists by the time between them, its mean over that time. The forces are
those that acted in that time, as a controller holds them; all other terms are the mean of their
values at both ends (the trapezoidal rule, an error of second order). The difference quotient is
noisy and passes through a low-pass filter of the first order, ``r' = 2 pi cutoff (w_ext - r)``,
solved exactly for any time dt between two samples, over which w_ext is constant; r begins at
zero. This is the generalized momentum observer of De Luca et al. (Collision detection and safe
reaction with the DLR-III lightweight manipulator arm, IROS 2006, doi:10.1109/IROS.2006.282053)
with the gain K = 2 pi cutoff. The observer integrates r' = K (p' - u - r), p the momentum, to
r = K (p - integral(u + r)); here the same equation is solved step by step. Noise is therefore no
worse: white noise of deviation s in a twist gives at most M K s, however short dt is, while the
difference quotient alone gives sqrt(2) M s / dt.

Six lengths alone do not show that the platform has passed a singularity: the forward kinematics
stay on the side of the last pose. The setpoint shows it. Where det(J) has another sign at the
setpoint than at the last pose, the pose is searched from the setpoint; if the platform is there
(the pose found is at most half as far from the setpoint as from the one on the old side), the
estimate starts again there, as after a gap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
import math
from struct import Struct
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, NO_WRENCH, SECOND, Six
from stewart_dynamics.compilation.functions import entry_point, inlined
from stewart_dynamics.errors import MotionError, PoseError, SingularityError
from stewart_dynamics.mechanics.drives.measured_efforts import EffortMistake
from stewart_dynamics.mechanics.dynamics import inverse_dynamics
from stewart_dynamics.mechanics.dynamics.bodies import drive_row
from stewart_dynamics.mechanics.dynamics.hexapod_constants import CONSTANTS
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.rows import (
    BASE, consecutive, FORCES, MOTION, NO_BASE, PARTS_OF_WRENCH, POSITION, RESULT,
    ROTATION, WRENCH)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters

# Under the node's name.
EXTERNAL_WRENCH = 'external_wrench'
WRENCH_LIMITS = {f'{EXTERNAL_WRENCH}.{part}_max': part for part in PARTS_OF_WRENCH}

# The outcome of a measurement, besides the codes of forward_kinematics.
_OUT_OF_RANGE = 3

# One measurement as numbers, since an array costs time to pass: inputs, then results.
_MOTION_AFTER, _AFTER, _DIFFERENCES, _STEPS, _RESIDUAL, _ACROSS, _CODE = consecutive(
    MOTION, WRENCH, 6, 1, 1, 1, 1)
# The motion given is the previous one, or the guess.
(_PLATFORM, _LENGTHS, _RATES, _FORCES, _KNOWN, _BEFORE, _GAIN, _INTERVAL, _MOTION, _BASE_BEFORE,
 _BASE, _TARGET, _WRITTEN, _RESULT, _TILE) = consecutive(
    CONSTANTS, 6, 6, 6, WRENCH, WRENCH, 1, 1, MOTION, BASE, BASE, 1, _CODE.stop, RESULT,
    inverse_dynamics.TILE)
_GIVEN = Struct(f'{_WRITTEN.start - _LENGTHS.start}d')
_GIVES = Struct(f'{_CODE.stop}d')


class Measurement(NamedTuple):
    """Measurement of the six legs at one time."""

    stamp: int  # [ns]
    lengths: Six  # [m]
    rates: Six  # [m/s]
    forces: Six  # of the actuators since the last measurement [N], + pushes


class Target(NamedTuple):
    """The last setpoint, where the platform should be."""

    motion: Sequence[float]  # a row of motion
    determinant: float  # det(J) there [m^3]


class Overload(NamedTuple):
    """A threshold that the external wrench exceeds."""

    limit: str  # one of WRENCH_LIMITS
    value: float
    bound: float


class Estimate(NamedTuple):
    """The platform's motion and the external wrench at a measurement."""

    stamp: int
    motion: tuple[float, ...]
    """A row of motion: pose, twist, and the acceleration since the last measurement."""
    wrench: Six | None  # the external wrench, filtered; None for the first measurement [N, N m]
    differences: Six | None
    """Measured - model, not filtered (6) [N]; none of the first measurement."""
    base: tuple[float, ...] = NO_BASE  # a row of the base's motion; of nan: it is still
    overloads: tuple[Overload, ...] = ()
    mistake: EffortMistake | None = None  # likely mistake in the efforts

    @property
    def published(self) -> Six | None:
        """Return the wrench; None without one, or where the efforts are likely no forces."""
        return self.wrench if self.mistake is None or self.mistake.leaves_wrench else None

    @property
    def force(self) -> float:
        """Force of the wrench [N]."""
        return math.hypot(*self.wrench[:3]) if self.wrench else 0.0

    @property
    def moment(self) -> float:
        """Moment of the wrench [N m]."""
        return math.hypot(*self.wrench[3:]) if self.wrench else 0.0


@inlined
def _add_external_wrench(constants: Array, motion: Array, model_forces: Array,
                         measured_forces: Array, weight: float, wrench: Array) -> None:
    """Add w_ext = J_inv^T (f_model - f_measured), times a weight, row by row."""
    position = motion[0], motion[1], motion[2]
    rotation = (motion[3], motion[4], motion[5], motion[6], motion[7], motion[8], motion[9],
                motion[10], motion[11])
    for leg in range(6):
        r0, r1, r2, r3, r4, r5 = drive_row(constants, leg, position, rotation)
        force = weight * (model_forces[leg] - measured_forces[leg])
        wrench[0] += force * r0
        wrench[1] += force * r1
        wrench[2] += force * r2
        wrench[3] += force * r3
        wrench[4] += force * r4
        wrench[5] += force * r5


@entry_point('f8[::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]', 'f8[:,::1]')
def _many(constants: Array, motions: Array, model_forces: Array, measured_forces: Array,
          wrenches: Array) -> None:
    for n in range(len(motions)):
        wrenches[n] = 0.0
        _add_external_wrench(
            constants, motions[n], model_forces[n], measured_forces[n], 1.0, wrenches[n])


def external_wrenches(platform: StewartPlatform, motions: Array, model_forces: Array,
                      measured_forces: Array) -> Array:
    """
    Return the external wrench (N, 6) [N, N m] of many samples, each alone: nothing is filtered.

    The forces are those of the inverse dynamics and of the actuators (N, 6) [N], + pushes. Of the
    rows of motion (N, 12) or (N, MOTION) only the poses are used.
    """
    wrenches = np.empty((len(motions), WRENCH))
    motions, model_forces, measured_forces = map(
        np.ascontiguousarray, (motions, model_forces, measured_forces))
    _many(platform.constants, motions, model_forces, measured_forces, wrenches)
    return wrenches


@entry_point('f8[::1]')
def _one(numbers: Array) -> None:
    """Write the results of one measurement."""
    constants, written = numbers[_PLATFORM], numbers[_WRITTEN]
    before, motion, wrench, differences = (
        numbers[_MOTION], written[_MOTION_AFTER], written[_AFTER], written[_DIFFERENCES])
    for n in range(MOTION):
        motion[n] = before[n]
    # Whether the setpoint is on the other side of a singularity; nan: no setpoint.
    sides = forward_kinematics.determinant(constants, before) * numbers[_TARGET.start]
    written[_ACROSS.start] = 1.0 if sides < 0.0 else 0.0
    code, written[_STEPS.start], written[_RESIDUAL.start] = forward_kinematics.pose(
        constants, numbers[_LENGTHS], motion)
    written[_CODE.start] = code
    if code != forward_kinematics.FOUND:
        return
    forward_kinematics.twist(constants, numbers[_RATES], motion)
    dt = numbers[_INTERVAL.start]
    for n in range(6):
        motion[18 + n] = (motion[12 + n] - before[12 + n]) / dt if dt > 0.0 else 0.0
        before[18 + n] = motion[18 + n]
        wrench[n] = 0.0
        differences[n] = 0.0
    if dt > 0.0:
        forces, result = numbers[_FORCES], numbers[_RESULT]
        for end in range(2):  # the mean of both ends
            at = motion if end else before
            base = numbers[_BASE] if end else numbers[_BASE_BEFORE]
            inverse_dynamics.solve_one(
                constants, at, numbers[_KNOWN], base, result, numbers[_TILE])
            model_forces = result[FORCES]
            _add_external_wrench(constants, at, model_forces, forces, 0.5, wrench)
            for n in range(6):
                differences[n] += 0.5 * (forces[n] - model_forces[n])
        for n in range(6):
            filtered = numbers[_BEFORE.start + n]
            wrench[n] = filtered + numbers[_GAIN.start] * (wrench[n] - filtered)
    for n in range(_STEPS.start):
        if not math.isfinite(written[n]):
            written[_CODE.start] = _OUT_OF_RANGE


# The machine code that a measurement needs.
FUNCTIONS = (_one,)


class ExternalWrench:
    """
    The step from a measurement to the external wrench, for a hexapod with given parameters.

    One thread at a time may call it: a call works in memory that is its own.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._numbers = np.zeros(_TILE.stop)
        self._memory = self._numbers.data  # the same as bytes
        self._numbers[_PLATFORM] = StewartPlatform(parameters).constants
        self._size = parameters['singularity.characteristic_length']
        self._longest_gap = round(parameters['setpoint.timeout'] * SECOND)
        self._rate = 2.0 * math.pi * parameters['external_wrench.cutoff']
        self._bounds = [(limit, part, parameters[limit]) for limit, part in WRENCH_LIMITS.items()
                        if parameters[limit] is not None]

    def __call__(self, measurement: Measurement, before: Estimate | None, known: Six,
                 target: Target | None, base: tuple[float, ...] = NO_BASE) -> Estimate:
        """
        Return the estimate for a measurement with finite numbers.

        ``known`` is the load on ``~/wrench`` [N, N m], ``target`` the last setpoint.
        If the stamp of the last estimate is later, or older by more than
        ``setpoint.timeout``, only its pose is used, and the filter restarts. It restarts as well
        where the platform has followed the target through a singularity.

        Raises PoseError, SingularityError: the forward kinematics did not converge from the last
            pose. If there is no pose yet, or no pose within ``setpoint.timeout``, the target and
            home were tried as well.
        Raises MotionError: numbers overflow.
        """
        given = (*measurement.lengths, *measurement.rates, *measurement.forces, *known)
        interval = 0 if before is None else measurement.stamp - before.stamp
        if before is not None and 0 < interval <= self._longest_gap:
            seconds = interval * NANOSECOND
            result = self._solve(given, before.wrench or NO_WRENCH, seconds, before.motion,
                                 before.base, base, target)
            if target is not None and result[_ACROSS.start] == 1.0:
                other = self._solve(given, NO_WRENCH, 0.0, target.motion, base, base)
                if other[_CODE.start] == forward_kinematics.FOUND and (
                        result[_CODE.start] != forward_kinematics.FOUND
                        or 2.0 * self._distance(other, target.motion)
                        < self._distance(other, result)):
                    result, interval = other, 0
        else:
            for guess in self._guesses(before, target):
                result = self._solve(given, NO_WRENCH, 0.0, guess, base, base)
                if result[_CODE.start] == forward_kinematics.FOUND:
                    break
        if result[_CODE.start] != forward_kinematics.FOUND:
            raise _error(measurement, result)
        motion = result[_MOTION_AFTER]
        if not 0 < interval <= self._longest_gap:
            return Estimate(measurement.stamp, motion, None, None, base)
        fx, fy, fz, tx, ty, tz = result[_AFTER]
        d0, d1, d2, d3, d4, d5 = result[_DIFFERENCES]
        estimate = Estimate(measurement.stamp, motion, (fx, fy, fz, tx, ty, tz),
                            (d0, d1, d2, d3, d4, d5), base)
        overloads = tuple(self._overloads(estimate))
        return estimate._replace(overloads=overloads) if overloads else estimate

    def _solve(self, given: tuple[float, ...], before: Six, interval: float,
               motion: Sequence[float], base_before: tuple[float, ...],
               base: tuple[float, ...], target: Target | None = None,
               ) -> tuple[float, ...]:
        # Computed here: compiled code has an expm1 of its own.
        gain = -math.expm1(-self._rate * interval)
        _GIVEN.pack_into(
            self._memory, 8 * _LENGTHS.start, *given, *before, gain, interval, *motion,
            *base_before, *base, math.nan if target is None else target.determinant)
        self._bound()
        return _GIVES.unpack_from(self._memory, 8 * _WRITTEN.start)

    def _distance(self, one: Sequence[float], other: Sequence[float]) -> float:
        """Return how far two poses are apart [m], turns by the characteristic length."""
        turned = math.dist(one[ROTATION], other[ROTATION]) / math.sqrt(2.0)
        return math.hypot(math.dist(one[POSITION], other[POSITION]), self._size * turned)

    def _guesses(self, before: Estimate | None, target: Target | None,
                 ) -> Iterator[Sequence[float]]:
        if before is not None:
            yield before.motion
        if target is not None:
            yield target.motion
        yield from self._homes

    @cached_property
    def _bound(self) -> Callable[[], object]:
        return _one.bound(self._numbers)

    @cached_property
    def _homes(self) -> list[list[float]]:
        # Computing the home poses takes milliseconds; they are seldom needed.
        return [[*position.tolist(), *rotation.ravel().tolist(), *NO_WRENCH, *NO_WRENCH]
                for position, rotation in zip(*homes(self._parameters), strict=True)]

    def _overloads(self, estimate: Estimate) -> Iterator[Overload]:
        for limit, part, bound in self._bounds:
            value = getattr(estimate, part)
            if value > bound:
                yield Overload(limit, value, bound)


def _error(measurement: Measurement, result: tuple[float, ...],
           ) -> PoseError | SingularityError | MotionError:
    code, lengths = result[_CODE.start], ', '.join(f'{x:.6g}' for x in measurement.lengths)
    if code == _OUT_OF_RANGE:
        return MotionError(f'stamp {measurement.stamp} ns')
    if code == forward_kinematics.SINGULAR:
        return SingularityError(f'lengths [{lengths}] m')
    residual, steps = result[_RESIDUAL.start], result[_STEPS.start]
    return PoseError(f'lengths [{lengths}] m: did not converge: residual {residual:.3g} m after '
                     f'{steps:.0f} iterations')
