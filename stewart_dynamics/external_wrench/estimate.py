# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The external wrench: the load on the platform that measured lengths, rates and forces show.

The hexapod obeys ``M X'' + C X' + G = J_inv^T f + w + w_ext`` with the measured leg forces f, the
known load w on ``~/wrench`` and the external wrench w_ext. The inverse dynamics
give the forces f_model of the same motion without it, so

    w_ext = J_inv^T (f_model - f)

(J_q in place of J_inv where screws turn with their legs: ``turning_screws``), with the sign of
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

from collections.abc import Iterator, Sequence
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, NANOSECOND, NO_WRENCH, SECOND, Six
from stewart_dynamics.core.binding import CODES, function, Sample
from stewart_dynamics.errors import MotionError, PoseError, SingularityError
from stewart_dynamics.legs.kind import Named
from stewart_dynamics.mechanics.drives.measured_efforts import leaves_wrench
from stewart_dynamics.mechanics.hexapod_structure import hexapod_structure
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.rows import (
    NO_BASE, PARTS_OF_WRENCH, POSE, POSITION, ROTATION, WRENCH)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.possible_errors.hypothesis import PossibleError

# Under the node's name.
EXTERNAL_WRENCH = 'external_wrench'
WRENCH_LIMITS = {f'{EXTERNAL_WRENCH}.{part}_max': part for part in PARTS_OF_WRENCH}


class Measurement(NamedTuple):
    """Measurement of the six legs at one time."""

    stamp: int  # [ns]
    positions: Six  # of the drives: lengths [m], ...
    rates: Six
    efforts: Six  # of the actuators since the last measurement


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
    """Measured - model efforts, not filtered (6); none of the first measurement."""
    base: tuple[float, ...] = NO_BASE  # a row of the base's motion; of nan: it is still
    overloads: tuple[Overload, ...] = ()
    possible_error: PossibleError | None = None  # possible error in the measurements

    @property
    def published(self) -> Six | None:
        """Return the wrench; None without one, or where it likely is that of an error."""
        return self.wrench if leaves_wrench(self.possible_error) else None

    @property
    def force(self) -> float:
        """Force of the wrench [N]."""
        return math.hypot(*self.wrench[:3]) if self.wrench else 0.0

    @property
    def moment(self) -> float:
        """Moment of the wrench [N m]."""
        return math.hypot(*self.wrench[3:]) if self.wrench else 0.0


class _Result(NamedTuple):
    """Fields of the structure of a measurement that the library writes."""

    motion_after: tuple[float, ...]
    after: Six  # external wrench [N, N m]
    differences: Six  # of efforts
    steps: float  # of the forward kinematics
    residual: float  # [m]
    across: float  # the last setpoint is on the other side of a singularity
    code: float


def external_wrenches(platform: StewartPlatform, motions: Array, model_forces: Array,
                      measured_forces: Array) -> Array:
    """
    Return the external wrench (N, 6) [N, N m] of many samples, each alone: nothing is filtered.

    The forces are those of the inverse dynamics and of the actuators (N, 6) [N], + pushes. Of the
    rows of motion (N, 12) or (N, MOTION) only the poses are used.
    """
    wrenches = np.empty((len(motions), WRENCH))
    function('external_wrenches_many')(platform.structure, len(motions), *map(
        np.ascontiguousarray, (motions[:, POSE], model_forces, measured_forces)), wrenches)
    return wrenches


class ExternalWrench:
    """
    The step from a measurement to the external wrench, for a hexapod with given parameters.

    One thread at a time may call it: a call works in memory that is its own.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._sample = Sample('one_measurement', 'target', *_Result._fields)
        self._bound = function('estimate_one').bound(
            hexapod_structure(parameters), self._sample.numbers)
        self._size = parameters.singularity.characteristic_length
        self._longest_gap = round(parameters.setpoint.timeout * SECOND)
        self._rate = 2.0 * math.pi * parameters.external_wrench.cutoff
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
        given = (*measurement.positions, *measurement.rates, *measurement.efforts, *known)
        interval = 0 if before is None else measurement.stamp - before.stamp
        if before is not None and 0 < interval <= self._longest_gap:
            seconds = interval * NANOSECOND
            result = self._solve(given, before.wrench or NO_WRENCH, seconds, before.motion,
                                 before.base, base, target)
            if target is not None and result.across == 1.0:
                other = self._solve(given, NO_WRENCH, 0.0, target.motion, base, base)
                if other.code == forward_kinematics.FOUND and (
                        result.code != forward_kinematics.FOUND
                        or 2.0 * self._distance(other.motion_after, target.motion)
                        < self._distance(other.motion_after, result.motion_after)):
                    result, interval = other, 0
        else:
            for guess in self._guesses(before, target):
                result = self._solve(given, NO_WRENCH, 0.0, guess, base, base)
                if result.code == forward_kinematics.FOUND:
                    break
        if result.code != forward_kinematics.FOUND:
            raise _error(measurement, result, self._parameters.leg_kind.position)
        motion = result.motion_after
        if not 0 < interval <= self._longest_gap:
            return Estimate(measurement.stamp, motion, None, None, base)
        estimate = Estimate(measurement.stamp, motion, result.after, result.differences, base)
        overloads = tuple(self._overloads(estimate))
        return estimate._replace(overloads=overloads) if overloads else estimate

    def _solve(self, given: tuple[float, ...], before: Six, interval: float,
               motion: Sequence[float], base_before: tuple[float, ...],
               base: tuple[float, ...], target: Target | None = None,
               ) -> _Result:
        gain = -math.expm1(-self._rate * interval)
        self._sample.write(
            *given, *before, gain, interval, *motion, *base_before, *base,
            math.nan if target is None else target.determinant)
        self._bound()
        return _Result._make(self._sample.read())

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
    def _homes(self) -> list[list[float]]:
        # Computing the home poses takes milliseconds; they are seldom needed.
        return [[*position.tolist(), *rotation.ravel().tolist(), *NO_WRENCH, *NO_WRENCH]
                for position, rotation in zip(*homes(self._parameters), strict=True)]

    def _overloads(self, estimate: Estimate) -> Iterator[Overload]:
        for limit, part, bound in self._bounds:
            value = getattr(estimate, part)
            if value > bound:
                yield Overload(limit, value, bound)


def _error(measurement: Measurement, result: _Result, position: Named,
           ) -> PoseError | SingularityError | MotionError:
    code, numbers = result.code, ', '.join(f'{x:.6g}' for x in measurement.positions)
    given = f'{position.field} [{numbers}] {position.unit}'
    if code == CODES['STEWART_OUT_OF_RANGE']:
        return MotionError(f'stamp {measurement.stamp} ns')
    if code == forward_kinematics.SINGULAR:
        return SingularityError(given)
    return PoseError(f'{given}: {forward_kinematics.failure(result.steps, result.residual)}')
