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

Lengths, angles, levers, clearance and condition number are within their limits at each pose of a
stop: from one pose that is checked to the next one, no point moves farther than the room of both
(the conservative advancement of collision detection: B. Mirtich, Impulse-based Dynamic Simulation,
Berkeley, 1996). Rates, forces and torques are checked at 16 samples of it, and at more of them
where levers may change faster; between these they exceed the bounds by less than the margins with
which they are checked. Bounds by the kind of legs, and why each state has a stop:
docs/motion_cueing.md.

A stream may demand anything. Where rates and accelerations are not those of its poses, they are
taken from differences; where the hexapod cannot follow these, the demand has jumped, and the
motion returns to it. Setpoints more than 10 ms apart are joined by a motion of fifth order. The
computation, with the margins of the limits, is ``core/governor.c``; the ros2_control controller
calls it, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import CODES, function, record
from stewart_dynamics.errors import MotionError, ParameterError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.arguments import as_array, wrong_type
from stewart_dynamics.mechanics.frames.motion import check_kind, Motion, Pose
from stewart_dynamics.mechanics.kinematics.home_pose import home_pose
from stewart_dynamics.mechanics.limits import (
    LIMITS, limits_of, SINGULARITY, SPEED_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import MOTION, POSE
from stewart_dynamics.parameters.table import Parameters

_LONGEST_GAP = 1000.0  # between two samples [s]: it takes half a second to compute


def kept_limits(parameters: Parameters) -> Mapping[int, str]:
    """Return the limits that a governor keeps, by their places in ``governor_state.held``."""
    names = *limits_of(parameters).legs, TORQUE_MAX, TORQUE_SPEED, SPEED_MAX
    return {**{LIMITS[name].bit.bit_length() - 1: name for name in names},
            CODES['GOVERNED_SINGULARITY']: SINGULARITY}


class Governor:
    """
    The limits of a hexapod as the functions in C take them.

    kept: the limits that it keeps, see ``kept_limits``.
    arguments: their first ones: hexapod, limits.
    limits (): the structure ``governor_limits``.
    head (3,): point of the platform whose displacement is governed, platform frame [m].

    Raises ParameterError: there is no home pose, or at home a limit is exceeded.
    """

    def __init__(self, parameters: Parameters, head: Array) -> None:
        home = home_pose(parameters)
        self.kept = kept_limits(parameters)
        within, limits = (np.zeros((), record(name)) for name in (
            'stewart_platform', 'governor_limits'))
        self._pose_limits = PoseLimits(parameters)
        row = Motion.from_pose(home).rows
        function('put_governor')(
            self._pose_limits.hexapod, np.ascontiguousarray(row[POSE]),
            np.ascontiguousarray(head, dtype=float), within, limits)
        self.limits: Records = limits
        self.home = home
        self.arguments = within, limits
        self._at_home = row, batch.solve(within, row[None])[0]

    def coordinates(self, motion: Motion) -> Records:
        """Return motions (N,) of the platform as the structure ``coordinates``."""
        found: Any = np.zeros(len(motion), record('coordinates'))
        function('coordinates_of')(
            self.limits, len(motion), np.ascontiguousarray(motion.rows), found)
        return found  # type: ignore[no-any-return]

    def limit_of(self, state: Records) -> str | None:
        """Return a limit that a state (1,), or the stop from it, exceeds, with its margin."""
        limit = function('governed_limit')(*self.arguments, state)
        return None if limit == 0 else self.kept[limit - 1]

    def held_times(self, state: Records) -> dict[str, float]:
        """Return the time by which each limit of a state has held the demand back [s]."""
        held = state['held'].tolist()
        return {limit: held[place] for place, limit in self.kept.items()}

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
    def stop_rate(self) -> float:
        """Return k of its stops, v'' + 2 k v' + k^2 v = 0 [1/s]."""
        return float(self._governor.limits['stop_rate'])

    @property
    def held(self) -> dict[str, float]:
        """Return the time by which each limit has held the demand back [s], all axes together."""
        return self._governor.held_times(self._stream['governor'])


def check_gaps(times: Array, before: Array) -> None:
    """Raise MotionError where a time (N,) is too long after the one before [s]."""
    if (long := times - before > _LONGEST_GAP).any():
        n = int(np.argmax(long))
        raise MotionError(f'times[{n}]: {times[n]:.9g} s, {times[n] - before[n]:.6g} s after the '
                          f'one before: must be at most {_LONGEST_GAP:g} s')
