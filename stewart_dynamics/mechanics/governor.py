# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The governor: a motion that follows a demand as far as the limits of the hexapod let it.

A reference governor (E. G. Gilbert, I. Kolmanovsky, Automatica 38, 2002, 2063-2073). At each step
the next state lies between two: ``stop``, the next state of a stop that is known to be within all
limits, and ``demand``, that of the motion which returns to the demand. Both continue the present
state, and so does each state between them:

    next = stop + share (demand - stop)
    stop      v'' + 2 k v' + k^2 v = 0              of the velocity; the acceleration is continuous
    demand    w(t) + e, (d/dt + r)^3 e = 0          e: the deviation from the demand w

The share is the largest one found with which the next state, and the stop from it, are within all
limits: one share of all six coordinates first, then each of them alone. A share of zero goes on
with the stop that was checked before: there is always a next state. A share falls as it must, and
grows in a quarter of a second; where the deviation has vanished, the motion is the demand itself.

Lengths, angles, clearance and condition number are within their limits at each pose of a stop:
from one pose that is checked to the next one, no point moves farther than the room of both (the
conservative advancement of collision detection: B. Mirtich, Impulse-based Dynamic Simulation,
Berkeley, 1996). Rates, forces and torques are checked at 16 samples of it; between these they
exceed the bounds by less than the margins with which they are checked.

A stream may demand anything. Where rates and accelerations are not those of its poses, they are
taken from differences; where the hexapod cannot follow these, the demand has jumped, and the
motion returns to it. Setpoints more than 10 ms apart are joined by a motion of fifth order. The
computation is ``core/governor.c``.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.legs import require_kind
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.arguments import as_array, wrong_type
from stewart_dynamics.mechanics.drives.motor_limits import largest_speeds
from stewart_dynamics.mechanics.drives.motors import motor_ratio
from stewart_dynamics.mechanics.dynamics.friction import Friction
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion, Pose
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.limits import (
    BASE_ANGLE_MAX, LIMITS, LOAD, OF_JOINTS, OF_LEGS, PLATFORM_ANGLE_MAX, POSE, short_name,
    SINGULARITY, SPEED_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import DETERMINANT, MOTION, ROTATION
from stewart_dynamics.mechanics.singularity_warning import stop_condition_of
from stewart_dynamics.parameters.table import Parameters, six_of

KEPT: Mapping[int, str] = {
    **{LIMITS[name].bit.bit_length() - 1: name
       for name in (*OF_LEGS, TORQUE_MAX, TORQUE_SPEED, SPEED_MAX)},
    CODES['GOVERNED_SINGULARITY']: SINGULARITY}
"""The limits that a governor keeps, by their places in ``governor_state.held``."""

# Margins: of lengths a part of the stroke; of forces, torques and the condition number, which
# change fastest between two samples, and of the other limits, parts of themselves.
_OF_STROKE, _OF_LOADS, _OF_OTHERS = 0.005, 0.03, 0.02
# Margin of the clearance of the legs, and of lengths without a stroke, by the characteristic
# length.
_OF_SIZE = 0.003
_ANGLE_MARGINS = {BASE_ANGLE_MAX: 'base_angle_margin', PLATFORM_ANGLE_MAX: 'platform_angle_margin'}
# A stop from velocity_max needs this part of the stroke, where its rate is between two bounds
# [1/s]; the third is the rate without these limits.
_STOP_IN, _SLOWEST_STOP, _FASTEST_STOP, _USUAL_STOP = 0.15, 5.0, 50.0, 10.0
_LONGEST_GAP = 1000.0  # between two samples [s]: it takes half a second to compute
_RETURN_RATE = 2.0  # with which the deviation from the demand vanishes [1/s]


class Governor:
    """
    The limits of a hexapod as the functions in C take them.

    arguments: their first ones: hexapod, limits.
    limits (): the structure ``governor_limits``.
    head (3,): point of the platform whose displacement is governed, platform frame [m].

    Raises ParameterError: there is no home pose, or at home a limit is exceeded.
    """

    def __init__(self, parameters: Parameters, head: Array) -> None:
        require_kind(parameters, 'motion cueing')
        home = home_pose(parameters)
        within = _within(parameters)
        row = Motion.from_pose(home).rows
        result = batch.solve(within, row[None])[0]
        limits: Any = np.zeros((), record('governor_limits'))
        limits['home'] = np.ascontiguousarray(row[:ROTATION.stop]).view(record('stewart_pose'))[0]
        limits['head'] = head
        limits['stop_rate'], limits['return_rate'] = _stop_rate(parameters), _RETURN_RATE
        limits['condition_max'] = (1.0 - _OF_LOADS) * stop_condition_of(parameters)
        limits['stop_condition'] = stop_condition_of(parameters)
        limits['side'] = math.copysign(1.0, result[DETERMINANT])
        self._pose_limits = PoseLimits(parameters)
        joints, clearance = parameters.geometry.platform_joints, self._pose_limits.clearance
        corners = joints if clearance is None else np.concatenate([joints, clearance.platform])
        limits['arms'] = np.linalg.norm(joints - head, axis=1)
        limits['radii'] = np.linalg.norm(joints, axis=1)
        limits['reach'] = np.linalg.norm(corners - head, axis=1).max()
        for name, margins in _margins(parameters).items():
            limits[name] = margins
        if parameters.drives:
            # Friction changes its sign where a leg reverses between two samples.
            limits['friction_torque'] = Friction.of(parameters).largest_change / motor_ratio(
                parameters) * np.maximum(1.0 / parameters.drive.efficiency, 1.0)
        self.limits: Records = limits
        self.home = home
        self.arguments = within, limits
        self._at_home = row, result

    def coordinates(self, motion: Motion) -> Records:
        """Return motions (N,) of the platform as the structure ``coordinates``."""
        home = self.home.rotation
        with np.errstate(all='ignore'):  # of enormous numbers: not followed
            return self._coordinates(motion, home)

    def _coordinates(self, motion: Motion, home: Array) -> Records:
        rotation = home.T @ motion.rotation
        velocity, acceleration, omega, alpha = (vectors @ home for vectors in (
            motion.linear_velocity, motion.linear_acceleration, motion.angular_velocity,
            motion.angular_acceleration))
        angles = rotations.to_euler(rotation)
        rates = rotations.euler_rates(angles, omega)
        carried = (rotations.euler_rate_matrix_rate(angles, rates) @ rates[..., None])[..., 0]
        head = self.limits['head']
        arm = rotation @ head
        turning = np.cross(omega, arm)
        found: Any = np.zeros(len(motion), record('coordinates'))
        found['value'] = np.column_stack([
            (motion.position - self.home.position) @ home + arm - head, angles])
        found['rate'] = np.column_stack([velocity + turning, rates])
        found['acceleration'] = np.column_stack([
            acceleration + np.cross(alpha, arm) + np.cross(omega, turning),
            rotations.euler_rates(angles, alpha - carried)])
        return found  # type: ignore[no-any-return]

    def limit_of(self, state: Records) -> str | None:
        """Return a limit that a state (1,), or the stop from it, exceeds, with its margin."""
        limit = function('governed_limit')(*self.arguments, state)
        return None if limit == 0 else KEPT[limit - 1]

    def check_home(self, parameters: Parameters) -> None:
        """Raise ParameterError where a limit is exceeded at home, at rest."""
        found = self._pose_limits.first_exceeded(*self._at_home)
        limit = self.limit_of(np.zeros(1, record('coordinates')))
        if found is None and limit is None:
            return
        words = (f'{limit} is nearer than the margin of the governor' if found is None
                 else found.words(parameters.joints))
        raise ParameterError(f'{parameters.source}: cueing.govern: at home {words}')


class GovernedStream:
    """
    A stream of motions that follows a demand as far as the limits let it, from rest at home.

    Parameters
    ----------
    parameters : Parameters
        Its limits are kept.
    start : Pose or Motion of one sample, optional
        Where the platform is at rest at the first sample; by default home.

    Raises
    ------
    ParameterError
        There is no home pose, or at home a limit is exceeded.

    """

    def __init__(self, parameters: Parameters, start: Pose | Motion | None = None) -> None:
        if not isinstance(parameters, Parameters):
            raise wrong_type('parameters', parameters, 'Parameters')
        self._governor = Governor(parameters, np.zeros(3))
        self._governor.check_home(parameters)
        self._stream: Any = np.zeros((), record('governed_stream'))
        self._stream['time'] = np.nan
        if start is not None:
            check_kind(start, Pose, Motion)
            if start.shape not in ((), (1,)):
                raise MotionError(f'start: shape {start.shape}: must be one sample')
            at_rest = Motion.from_pose(start[None] if not start.shape else start)
            now = self._governor.coordinates(at_rest)
            if (limit := self._governor.limit_of(now)) is not None:
                raise MotionError(f'start: {limit} is exceeded there, or nearer than the margin '
                                  'of the governor')
            self._stream['governor']['now'] = now[0]

    def advance(self, times: ArrayLike, demand: Motion) -> Motion:
        """
        Return the governed motion (N,) at times (N,) [s], which must increase from call to call.

        demand: (N,), finite, with the twist and acceleration that belong to its poses. Samples may
            be lost, and it may jump: the motion then goes there within the limits.
        """
        check_kind(demand, Motion)
        array = np.ascontiguousarray(as_array('times', times, demand.shape), dtype=float)
        before = np.concatenate([[self._stream['time']], array[:-1]])
        if (stuck := array <= before).any():
            n = int(np.argmax(stuck))
            raise MotionError(f'times[{n}]: {array[n]:.9g} s: must be after {before[n]:.9g} s')
        check_gaps(array, before)
        rows = np.empty((len(array), MOTION))
        function('govern_many')(*self._governor.arguments, len(array), array,
                                self._governor.coordinates(demand), self._stream, rows)
        return Motion.of_rows(rows)

    @property
    def held(self) -> dict[str, float]:
        """Return the time by which each limit has held the demand back [s], all axes together."""
        return held_times(self._stream['governor'])


def held_times(state: Records) -> dict[str, float]:
    """Return the time by which each limit has held the demand back [s], of a governor_state."""
    held = state['held'].tolist()
    return {limit: held[place] for place, limit in KEPT.items()}


def check_gaps(times: Array, before: Array) -> None:
    """Raise MotionError where a time (N,) is too long after the one before [s]."""
    if (long := times - before > _LONGEST_GAP).any():
        n = int(np.argmax(long))
        raise MotionError(f'times[{n}]: {times[n]:.9g} s, {times[n] - before[n]:.6g} s after the '
                          f'one before: must be at most {_LONGEST_GAP:g} s')


def _within(parameters: Parameters) -> Records:
    """Return the structure of a hexapod whose limits have the margins of a governor."""
    found: Any = limited_structure(parameters)
    legs, margins = found['legs'], _margins(parameters)
    for name in OF_LEGS:
        limit = LIMITS[name]
        if limit.depends != POSE:
            legs[short_name(name)] *= 1.0 - (_OF_LOADS if limit.depends == LOAD else _OF_OTHERS)
    # Friction changes its sign where a leg reverses between two samples.
    legs['force_max'] -= Friction.of(parameters).largest_change
    legs['length_min'] += margins['length_margin']
    legs['length_max'] -= margins['length_margin']
    for name in OF_JOINTS:
        legs[short_name(name)] -= margins[_ANGLE_MARGINS[name]]
    found['leg_clearance_min'] += margins['clearance_margin']
    legs['torque_max'] *= 1.0 - _OF_LOADS
    if (curve := parameters.drive.torque_speed) is not None:
        lowest = _lowest_nearby(curve)
        found['n_torque_speed'] = len(lowest)
        found['torque_speed'][:len(lowest)] = lowest * [1.0, 1.0 - _OF_LOADS]
    legs['speed_max'] = (1.0 - _OF_OTHERS) * largest_speeds(parameters)
    legs['loss_velocity'] = math.inf  # breakaway torques at any rate, as if each leg could reverse
    return found  # type: ignore[no-any-return]


def _margins(parameters: Parameters) -> dict[str, Array]:
    """Return the margins of the limits of poses, by their fields of ``governor_limits``."""
    size, stroke = parameters.singularity.characteristic_length, _stroke(parameters)
    return {
        'length_margin': np.where(stroke > 0.0, _OF_STROKE * stroke, _OF_SIZE * size),
        'clearance_margin': np.array(_OF_SIZE * size),
        **{field: _OF_OTHERS * six_of(parameters[limit], 0.0)
           for limit, field in _ANGLE_MARGINS.items()}}


def _lowest_nearby(curve: Array) -> Array:
    """Return the lowest torques (M, 2) of a torque-speed curve (N, 2), margins of speed around."""
    near = 1.0 - _OF_OTHERS, 1.0 / (1.0 - _OF_OTHERS)
    speeds = np.unique(np.concatenate([curve[:, 0], *(curve[:, 0] * part for part in near)]))
    speeds = speeds[speeds <= near[0] * curve[-1, 0]]

    def lowest(speed: float) -> float:
        low, high = (speed * part for part in near)
        inner = curve[(curve[:, 0] > low) & (curve[:, 0] < high), 1]
        return float(min(*np.interp([low, high], *curve.T), *inner))

    return np.ascontiguousarray(np.column_stack([speeds, [lowest(each) for each in speeds]]))


def _stroke(parameters: Parameters) -> Array:
    """Return the strokes of the legs (6,) [m]; zero without both limits of length."""
    low, high = parameters.limits.length_min, parameters.limits.length_max
    return np.zeros(6) if low is None or high is None else np.broadcast_to(high - low, 6)


def _stop_rate(parameters: Parameters) -> float:
    """Return the rate of a stop [1/s]."""
    stroke, fastest = _stroke(parameters), parameters.limits.velocity_max
    if fastest is None or not stroke.all():
        return _USUAL_STOP
    rate = 2.0 * float(np.max(fastest / stroke)) / _STOP_IN
    return min(max(rate, _SLOWEST_STOP), _FASTEST_STOP)
