# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Planned trajectories as messages: platform trajectory in, leg trajectory or a rejection out.

A trajectory_msgs/MultiDOFJointTrajectory is read, checked and answered in pieces, so that
setpoints are answered between them.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Flags, NANOSECOND, SECOND, Six, Stamps
from stewart_dynamics.errors import MotionError
from stewart_dynamics.mechanics.frames.base_motion import row_of_motion
from stewart_dynamics.mechanics.frames.rotation import from_quaternion, quaternion_length
from stewart_dynamics.mechanics.rows import (
    ANGULAR_ACCELERATION, ANGULAR_VELOCITY, BASE, consecutive, LINEAR_ACCELERATION, MOTION,
    POSE, POSITION, ROTATION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.messages import type_names
from stewart_dynamics.messages.cdr import MalformedError
from stewart_dynamics.messages.trajectory_layouts import LegTrajectory, PlatformTrajectory
from stewart_dynamics.parameters.table import CHECK, IGNORE, Parameters
from stewart_dynamics.parameters.tolerances import is_unit, START_TOLERANCE, unit_rule
from stewart_dynamics.planned.approach import approach_in_pieces, MOST_POINTS
from stewart_dynamics.planned.planned_trajectory import (
    check_in_pieces, first_not_increasing, NOT_INCREASING, PIECE, PlannedTrajectory)
from stewart_dynamics.setpoints.rejections import (
    BASE_NOT_KNOWN, frame_details, MALFORMED, NOT_FINITE, NOT_UNIT, WRONG_FRAME)

INPUT, INPUT_TYPE = 'platform_trajectory', type_names.MULTI_DOF_JOINT_TRAJECTORY
OUTPUT, OUTPUT_TYPE = 'leg_trajectory', type_names.JOINT_TRAJECTORY

# Numbers of points read and written between two yields: some tenths of a millisecond of work.
_READ = 2 * PIECE
_WRITTEN = 8 * PIECE

QUEUE_FULL = 'queue full'
NOT_MEASURED = 'measured legs not known'
STARTS_ELSEWHERE = 'does not start where the legs are'
NO_APPROACH = 'no approach to the first point'

_POSITION, _QUATERNION, _TWIST_AND_ACCELERATION = consecutive(3, 4, 12)


class PlannedOutcome(NamedTuple):
    """The outcome of the check of a trajectory."""

    message: str  # in words: accepted or rejected, and why
    reason: str = ''  # why it is rejected, a constant; empty where it is accepted
    answer: bytes = b''  # a trajectory_msgs/JointTrajectory; empty where rejected
    warning: bool = False  # accepted, but the condition number reaches singularity.warn_condition
    values: tuple[tuple[str, str], ...] = ()  # keys with their units, and values


class _NotCheckableError(Exception):

    def __init__(self, reason: str, details: str) -> None:
        super().__init__(reason, details)
        self.outcome = rejected(reason, details)


def rejected(reason: str, details: str) -> PlannedOutcome:
    """Return the outcome of a trajectory that cannot be checked."""
    return PlannedOutcome(f'rejected: {reason}: {details}', reason)


def answer(parameters: Parameters, wrench: Six, data: bytes, base: Array | None = None,
           measured: Sequence[float] | None = None) -> Iterator[PlannedOutcome | None]:
    """
    Yield None after each piece of the work, and the outcome at the end.

    parameters: they hold for all of the work.
    wrench (6,): external wrench at the platform's origin, base axes [N, N m].
    data: a trajectory_msgs/MultiDOFJointTrajectory as received. Its second joint, if it has one,
        is the base, which moves in the world as its points say.
    base (BASE,): a row of the base's motion for a trajectory without the base. A row of nan: not
        known; at rest by default.
    measured (MOTION,): a row of motion of the platform as measured, for ``trajectory.approach``.
    """
    platform = StewartPlatform(parameters)
    try:
        message = _checked_header(data, parameters.base_frame)
        times, rows, given = yield from _read(message, parameters)
        if given is None and base is not None and np.isnan(base).any():
            raise _NotCheckableError(
                BASE_NOT_KNOWN, 'give it with the points, or publish the topics of the base')
        bases = base if given is None else given
        if parameters.trajectory.approach != IGNORE:
            times, rows, bases = yield from _from_measured(
                platform, times, rows, np.array(wrench), bases, measured)
    except MalformedError as exc:
        yield rejected(MALFORMED, str(exc))
        return
    except _NotCheckableError as exc:
        yield exc.outcome
        return
    result = None
    for result in check_in_pieces(platform, times, rows, np.array(wrench), bases):
        if result is None:
            yield None
    assert result is not None  # the last one
    written = b''
    if result.accepted:
        written = yield from _written(parameters, message.stamp, times, result)
    yield PlannedOutcome(result.message, result.reason, written, result.warning,
                         _values(parameters, result))


def _checked_header(data: bytes, base_frame: str) -> PlatformTrajectory:
    message = PlatformTrajectory(data)
    if message.frame not in (b'', base_frame.encode()):
        raise _NotCheckableError(WRONG_FRAME, frame_details(message.frame, base_frame.encode()))
    if not 1 <= message.size <= MOST_POINTS:
        raise MalformedError(f'{message.size} points: must be 1 to {MOST_POINTS}')
    if message.joints == 2 and (message.names[1] != base_frame.encode()
                                or message.names[0] == message.names[1]):
        names = [name[:60].decode(errors='replace') for name in message.names]
        raise MalformedError(
            f'joint_names: {names}: the first joint is the platform, the second the base, '
            f'{base_frame!r}')
    return message


def _read(message: PlatformTrajectory, parameters: Parameters,
          ) -> Generator[None, None, tuple[Stamps, Array, Array | None]]:
    """
    Return times (N,) [ns], rows of motion (N, MOTION), and of the base (N, BASE) if given.

    Bad points are rejected.
    """
    times, rows = np.empty(message.size, dtype=np.int64), np.empty((message.size, MOTION))
    bases = np.empty((message.size, BASE)) if message.joints == 2 else None
    gravity = parameters.gravity.tolist()
    for first in range(0, message.size, _READ):
        end = min(first + _READ, message.size)
        points = message.points(first, end)
        if (late := points['nanosec'] >= SECOND).any():
            n = int(np.argmax(late))
            raise MalformedError(
                f'points[{first + n}]: time_from_start of {points["nanosec"][n]} ns: must be '
                'under 1000000000')
        times[first:end] = points['sec'].astype(np.int64) * SECOND + points['nanosec']
        stuck = first_not_increasing(times[first:end], times[first - 1] if first else -1)
        if stuck is not None:
            n = first + stuck
            rule = f'after {times[n - 1] * NANOSECOND:.9g} s' if n else 'must be at least 0'
            raise _NotCheckableError(
                NOT_INCREASING, f'points[{n}]: {times[n] * NANOSECOND:.9g} s, {rule}')
        rows[first:end] = _rows(first, _numbers(points, 0))
        if bases is not None:
            r: Any = _rows(first, _numbers(points, 1)).T
            bases[first:end] = np.stack(np.broadcast_arrays(*row_of_motion(
                r[ROTATION], r[LINEAR_ACCELERATION], r[ANGULAR_VELOCITY],
                r[ANGULAR_ACCELERATION], gravity)), axis=-1)
        yield
    return times, rows, bases


def _from_measured(platform: StewartPlatform, times: Stamps, rows: Array, wrench: Array,
                   bases: Array | None, measured: Sequence[float] | None,
                   ) -> Generator[None, None, tuple[Stamps, Array, Array | None]]:
    """
    Return times, rows and bases that start where the measured legs are.

    A trajectory that starts elsewhere is rejected, or gets an approach before it.
    """
    p = platform.parameters
    if measured is None:
        raise _NotCheckableError(NOT_MEASURED, 'trajectory.approach needs ~/measured_legs')
    start = np.zeros(MOTION)
    start[POSE] = measured[POSE]
    quantity = p.leg_kind.position
    positions = platform.solve(np.stack([start, rows[0]]))[:, quantity.columns]
    away = np.abs(positions[1] - positions[0])
    tolerances = START_TOLERANCE * p.singularity.characteristic_length / p.leg_kind.reach(p)
    if np.isnan(away).any() or (away <= tolerances).all():
        return times, rows, bases  # the check rejects a point that a leg does not reach
    leg = int(np.argmax(away / tolerances))
    if p.trajectory.approach == CHECK:
        raise _NotCheckableError(
            STARTS_ELSEWHERE, f'{p.joints[leg]} is {away[leg]:.4g} {quantity.unit} from its first '
            f'{quantity.name}, more than {tolerances[leg]:.4g} {quantity.unit}')
    first = bases if bases is None or bases.ndim == 1 else bases[0]
    found = None
    try:
        for found in approach_in_pieces(platform, start, rows[0], wrench, first):
            if found is None:
                yield
    except MotionError as exc:
        raise _NotCheckableError(NO_APPROACH, str(exc)) from exc
    assert found is not None  # the last one
    before = np.rint(found.times[:-1] * SECOND).astype(np.int64)
    times = np.concatenate([before, times - times[0] + round(found.times[-1] * SECOND)])
    if bases is not None and bases.ndim == 2:
        bases = np.concatenate([np.repeat(bases[:1], len(before), axis=0), bases])
    return times, np.concatenate([found.motion.rows[:-1], rows]), bases


def _numbers(points: NDArray[np.void], joint: int) -> Array:
    """Return pose, twist and acceleration of a joint at points (N, 19)."""
    return np.column_stack([points[part][:, joint] for part in ('pose', 'twist', 'accel')])


def _rows(first: int, numbers: Array) -> Array:
    """Return rows of motion (N, MOTION) of points (N, 19) from an index on; reject bad ones."""
    if not (finite := np.isfinite(numbers).all(axis=1)).all():
        n = int(np.argmin(finite))
        raise _NotCheckableError(NOT_FINITE, f'points[{first + n}]: {tuple(numbers[n].tolist())}')
    quaternions, lengths, unit = _unit_quaternions(numbers[:, _QUATERNION])
    if not unit.all():
        n = int(np.argmin(unit))
        raise _NotCheckableError(
            NOT_UNIT, f'points[{first + n}]: {unit_rule(float(lengths[n]))}')
    rows = np.empty((len(numbers), MOTION))
    rows[:, POSITION] = numbers[:, _POSITION]
    rows[:, ROTATION] = np.column_stack(from_quaternion(*quaternions))
    rows[:, ROTATION.stop:] = numbers[:, _TWIST_AND_ACCELERATION]
    return rows


def _unit_quaternions(quaternions: Array) -> tuple[Array, Array, Flags]:
    """
    Normalize quaternions; return lengths and which quaternions are valid as well.

    quaternions (N, 4): finite numbers x y z w.
    Returns quaternions (4, N): normalized quaternions, one row for each of x y z w.
    Returns lengths (N,): lengths before normalization.
    Returns unit (N,): which lengths are 1 within the tolerance.
    """
    # Element by element, as messages of setpoints are read, so that results are bit-identical.
    x, y, z, w = quaternions.T
    with np.errstate(over='ignore', divide='ignore', invalid='ignore'):
        lengths = quaternion_length(x, y, z, w)
        return (np.stack([x / lengths, y / lengths, z / lengths, w / lengths]), lengths,
                is_unit(lengths))


def _written(parameters: Parameters, stamp: int, times: Stamps, result: PlannedTrajectory,
             ) -> Generator[None, None, bytes]:
    """Return the trajectory_msgs/JointTrajectory of an accepted trajectory."""
    kind = parameters.leg_kind
    answer = LegTrajectory(
        stamp, parameters.joints, result.points, parameters.trajectory.effort)
    for first in range(0, result.points, _WRITTEN):
        some = slice(first, min(first + _WRITTEN, result.points))
        positions, rates, efforts = (getattr(result, each.field)[some] for each in (
            kind.position, kind.rate, kind.effort))
        answer.put(first, times[some], positions - parameters.geometry.zero_length, rates, efforts)
        yield
    return answer.message()


def _values(parameters: Parameters, result: PlannedTrajectory) -> tuple[tuple[str, str], ...]:
    """Return the keys and values for diagnostics."""
    values = [('points', str(result.points)), ('duration (s)', f'{result.duration:.9g}')]
    joints, kind = parameters.joints, parameters.leg_kind
    effort = kind.effort.name
    leg: int | None = getattr(result, f'{effort}_leg')
    if result.accepted and leg is not None:
        values += [('worst condition number', f'{result.condition_number:.6g}'),
                   ('its time (s)', f'{result.condition_time:.3f}'),
                   (f'largest {effort} ({kind.effort.unit})', f'{getattr(result, effort):.6g}'),
                   ('its leg', joints[leg])]
        if parameters[kind.effort_limit] is not None:
            values.append((f'largest {effort}, of {kind.effort_limit}', f'{result.load:.4g}'))
        if result.lever_leg is not None:
            values += [('smallest lever, of its largest', f'{result.lever:.4g}'),
                       ('leg of the smallest lever', joints[result.lever_leg])]
    elif not np.isnan(result.time):
        values.append(('rejected at (s)', f'{result.time:.6g}'))
        if result.leg is not None:
            values.append(('leg', joints[result.leg]))
    return tuple(values)
