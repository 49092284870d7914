# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The calls of the library for one sample, as fast as a control loop or an MPC needs them.

A call takes little more time than the arithmetic: arguments are copied to memory whose address
the function in C knows already. A call returns None if an argument must be converted or is wrong,
or if the result is not sound; the call for batches then converts the argument or raises the error.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function, places, record
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.rows import NO_BASE, POSE, WRENCH

_NO_WRENCH = np.zeros(WRENCH)
_POSE = POSE.stop
# Errors of a memoryview if an argument is not an array of floats of its shape.
_NO_FLOATS = (TypeError, ValueError)


class SingleSample:
    """
    The calls for one sample of a hexapod, from any number of threads.

    ``inverse_dynamics``, ``forward_dynamics`` and ``base_wrench`` are ``_Dynamics.call`` and
    return a row of results (RESULT,), the row of the motion (MOTION,) and a wrench (6,).
    ``forward_kinematics`` returns the row of the pose (12,).
    """

    def __init__(self, hexapod: Records) -> None:
        self.inverse_dynamics = _Dynamics(hexapod, 'solve_one', 'result').call
        self.forward_dynamics = _Dynamics(hexapod, 'forward_dynamics_one', 'motion').call
        self.base_wrench = _Dynamics(hexapod, 'base_wrench_one', 'base_wrench').call
        self.forward_kinematics = _ForwardKinematics(hexapod).call


class _Memories:
    """The memory of calls of a function: as much as there are calls at the same time."""

    def __init__(self, hexapod: Records, name: str, sample: str) -> None:
        self._hexapod, self._function, self._sample = hexapod, function(name), sample
        self._places = places(sample)
        self._free: list[tuple[Any, ...]] = []  # its pop and append are atomic

    def _bound(self) -> tuple[Callable[[], Any], Array]:
        """Return the function bound to new memory, and the memory as numbers."""
        numbers = np.zeros(record(self._sample).itemsize // 8)
        return self._function.bound(self._hexapod, numbers), numbers


class _Dynamics(_Memories):
    """A call of a function of motion, forces, wrench and base."""

    def __init__(self, hexapod: Records, name: str, result: str) -> None:
        super().__init__(hexapod, name, 'one_motion')
        self._result = result

    def _new(self) -> tuple[Any, ...]:
        solve, numbers = self._bound()
        numbers[self._places['base']] = NO_BASE
        return (solve, *(numbers[self._places[name]].data for name in (
            'motion', 'forces', 'wrench', 'base')), numbers[self._places[self._result]])

    def call(self, motion: Motion, forces: Any, wrench: Any, base: BaseMotion | None,
             ) -> Array | None:
        """Return the row of the result; ``forces`` (6,) are those of the forward dynamics."""
        if type(motion) is not Motion or (base is not None and type(base) is not BaseMotion):
            return None
        try:
            memory = self._free.pop()
        except IndexError:
            memory = self._new()
        solve, of_motion, of_forces, of_wrench, of_base, result = memory
        try:
            of_motion[:] = motion.rows
            if self._result == 'motion':
                of_forces[:] = forces
            if wrench is not None:
                of_wrench[:] = wrench
            if base is not None:
                of_base[:] = base.rows
                if of_base[0] != of_base[0]:
                    return None  # nan would be a still base
            return result.copy() if solve() else None
        except _NO_FLOATS:
            return None
        finally:  # the next one has no wrench, on a base at rest
            if wrench is not None:
                of_wrench[:] = _NO_WRENCH
            if base is not None:
                of_base[0] = math.nan
            self._free.append(memory)


class _ForwardKinematics(_Memories):
    """The call of the forward kinematics."""

    def __init__(self, hexapod: Records) -> None:
        super().__init__(hexapod, 'forward_kinematics_one', 'one_pose')

    def call(self, lengths: Any, guess: Pose | Motion) -> Array | None:
        """Return the row of the pose (12,) of leg lengths (6,), from a guess."""
        if type(guess) is not Pose and type(guess) is not Motion:
            return None
        try:
            memory = self._free.pop()
        except IndexError:
            solve, numbers = self._bound()
            pose = numbers[self._places['pose']]
            memory = solve, numbers[self._places['lengths']].data, pose.data, pose
        solve, of_lengths, of_pose, pose = memory
        try:
            of_lengths[:] = lengths
            of_pose[:] = guess.rows[..., :_POSE]
            return pose.copy() if solve() == forward_kinematics.FOUND else None
        except _NO_FLOATS:
            return None
        finally:
            self._free.append(memory)
