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
The calls of the library for one sample, as fast as a control loop or an MPC needs them.

A call takes little more time than the arithmetic: arguments are copied to memory whose address
the machine code knows already. A call returns None if an argument must be converted or is wrong,
or if the result is not sound; the call for batches then converts the argument or raises the error.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import EntryPoint
from stewart_dynamics.mechanics.dynamics import base_wrench, forward_dynamics, inverse_dynamics
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, BASE, MOTION, NO_BASE, POSE, RESULT, WRENCH)

_NO_WRENCH = np.zeros(WRENCH)
_NO_BASE = np.array(NO_BASE)
_POSE = POSE.stop

# A memoryview of each array, the arrays, and the function bound to them.
_Memory = tuple[tuple[Any, ...], tuple[NDArray[Any], ...], Callable[[], object]]

# Errors of a memoryview if an argument is not an array of floats of its shape.
_NO_FLOATS = (TypeError, ValueError)


class SingleSample:
    """The calls for one sample of a hexapod, from any number of threads."""

    def __init__(self, constants: Array) -> None:
        self._inverse_dynamics = _Memories(
            inverse_dynamics.solve, constants, np.empty((1, MOTION)), np.empty((1, WRENCH)),
            _NO_BASE[None], np.empty((1, RESULT)), np.empty(1, dtype=bool),
            np.empty(inverse_dynamics.TILE))
        self._forward_dynamics = _Memories(
            forward_dynamics.solve, constants, np.empty((1, MOTION)), np.empty((1, 6)),
            np.empty((1, WRENCH)), _NO_BASE[None], np.empty(forward_dynamics.WORK))
        self._base_wrench = _Memories(
            base_wrench.base_wrenches, constants, np.empty((1, MOTION)), np.empty((1, WRENCH)),
            np.empty((1, BASE)), np.empty((1, WRENCH)))
        self._forward_kinematics = _Memories(
            forward_kinematics.poses, constants, np.empty((1, 6)), np.zeros((1, MOTION)),
            np.empty(1, np.int64), np.empty(1, np.int64), np.empty(1))

    def inverse_dynamics(self, motion: Motion, wrench: Any, base: Any) -> Array | None:
        """Return the row of results (RESULT,) of a motion (MOTION,) under a wrench (6,)."""
        if type(motion) is not Motion:
            return None
        memory = self._inverse_dynamics.take()
        (of_motion, of_wrench, of_base, _, sound, _), arrays, solve = memory
        try:
            of_motion[:] = motion.rows
            of_wrench[:] = _NO_WRENCH if wrench is None else wrench
            if base is not None:
                _put_base(of_base, base)
        except _NO_FLOATS:
            self._inverse_dynamics.free(memory)
            return None
        solve()
        if base is not None:
            of_base[0] = math.nan  # the next one is still
        result = arrays[3][0].copy() if sound[0] else None
        self._inverse_dynamics.free(memory)
        return result

    def base_wrench(self, motion: Motion, wrench: Any, base: Any) -> Array | None:
        """Return the wrench (6,) on the base, whose motion (BASE,) must be given."""
        if type(motion) is not Motion or type(base) is not BaseMotion:
            return None
        memory = self._base_wrench.take()
        (of_motion, of_wrench, of_base, _), arrays, solve = memory
        try:
            of_motion[:] = motion.rows
            of_wrench[:] = _NO_WRENCH if wrench is None else wrench
            of_base[:] = base.rows
        except _NO_FLOATS:
            self._base_wrench.free(memory)
            return None
        solve()
        result = arrays[3][0].copy()
        self._base_wrench.free(memory)
        return result if math.isfinite(sum(result.tolist())) else None

    def forward_dynamics(self, motion: Motion, forces: Any, wrench: Any, base: Any,
                         ) -> Array | None:
        """Return the row of the motion (MOTION,) that follows from leg forces (6,)."""
        if type(motion) is not Motion:
            return None
        memory = self._forward_dynamics.take()
        (of_motion, of_forces, of_wrench, of_base, _), arrays, solve = memory
        try:
            of_motion[:] = motion.rows
            of_forces[:] = forces
            of_wrench[:] = _NO_WRENCH if wrench is None else wrench
            if base is not None:
                _put_base(of_base, base)
        except _NO_FLOATS:
            self._forward_dynamics.free(memory)
            return None
        solve()
        if base is not None:
            of_base[0] = math.nan  # the next one is still
        result = arrays[0][0].copy()
        self._forward_dynamics.free(memory)
        return result if math.isfinite(sum(result[ACCELERATION].tolist())) else None

    def forward_kinematics(self, lengths: Any, guess: Pose | Motion) -> Array | None:
        """Return the row of the pose (12,) of leg lengths (6,), from a guess."""
        if type(guess) is not Pose and type(guess) is not Motion:
            return None
        memory = self._forward_kinematics.take()
        (of_lengths, of_motion, code, _, _), arrays, solve = memory
        try:
            of_lengths[:] = lengths
            of_motion[:_POSE] = guess.rows[..., :_POSE]
        except _NO_FLOATS:
            self._forward_kinematics.free(memory)
            return None
        solve()
        result = arrays[1][0, :_POSE].copy() if code[0] == forward_kinematics.FOUND else None
        self._forward_kinematics.free(memory)
        return result


def _put_base(of_base: Any, base: Any) -> None:
    """Write the row of one base motion; TypeError for anything else, and for one of nan."""
    if type(base) is BaseMotion:
        of_base[:] = base.rows
        if of_base[0] == of_base[0]:
            return
    raise TypeError


class _Memories:
    """
    The memory of calls of a function: as much as there are calls at the same time.

    constants (CONSTANTS,): constants of the hexapod.
    """

    def __init__(self, function: EntryPoint, constants: Array, *arrays: NDArray[Any]) -> None:
        self._function, self._constants, self._arrays = function, constants, arrays
        self._free: list[_Memory] = []

    def take(self) -> _Memory:
        """Return memory that no other thread uses."""
        try:
            return self._free.pop()  # atomic
        except IndexError:
            arrays = tuple(array.copy() for array in self._arrays)
            return (tuple(array.reshape(-1).data for array in arrays), arrays,
                    self._function.bound(self._constants, *arrays))

    def free(self, memory: _Memory) -> None:
        """Take it back."""
        self._free.append(memory)
