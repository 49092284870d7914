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
from numpy.typing import NDArray

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, MOTION, NO_BASE, POSE, RESULT, WRENCH)

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
        def solve(motion: Array, wrench: Array, base: Array, result: Array) -> Callable[[], Any]:
            return function('solve_one').bound(hexapod, motion, wrench, base, result)

        def accelerate(motion: Array, forces: Array, wrench: Array, base: Array,
                       ) -> Callable[[], Any]:
            return function('forward_dynamics_many').bound(
                hexapod, 1, motion, forces, 1, wrench, 1, base)

        def base_wrench(motion: Array, wrench: Array, base: Array, result: Array,
                        ) -> Callable[[], Any]:
            return function('base_wrenches_many').bound(
                hexapod, 1, motion, 1, wrench, 1, base, result)

        def pose(lengths: Array, motion: Array, code: Any, steps: Any, residual: Array,
                 ) -> Callable[[], Any]:
            return function('forward_kinematics_many').bound(
                hexapod, 1, lengths, motion, code, steps, residual)

        motion, six, base = np.zeros(MOTION), np.empty(6), np.array(NO_BASE)
        self.inverse_dynamics = _Dynamics(
            solve, motion=motion, wrench=six, base=base, result=np.empty(RESULT)).call
        self.forward_dynamics = _Dynamics(
            accelerate, motion=motion, forces=six, wrench=six, base=base).call
        self.base_wrench = _Dynamics(
            base_wrench, motion=motion, wrench=six, base=base, result=six).call
        self.forward_kinematics = _ForwardKinematics(
            pose, lengths=six, motion=motion, code=np.empty(1, np.int64),
            steps=np.empty(1, np.int64), residual=np.empty(1)).call


class _Memories:
    """The memory of calls of a function: as much as there are calls at the same time."""

    def __init__(self, bound: Callable[..., Callable[[], Any]], **arrays: NDArray[Any]) -> None:
        self._bound, self._arrays = bound, arrays
        self._free: list[tuple[Any, ...]] = []  # its pop and append are atomic

    def _new(self) -> tuple[Any, ...]:
        """Return the function bound to new arrays, the arrays, and a memoryview of each."""
        arrays = {name: array.copy() for name, array in self._arrays.items()}
        return (self._bound(*arrays.values()), arrays,
                {name: array.data for name, array in arrays.items()})


class _Dynamics(_Memories):
    """A call of a function of motion, forces, wrench and base."""

    def _new(self) -> tuple[Any, ...]:
        solve, arrays, views = super()._new()
        motion = arrays['motion']
        result = arrays.get('result', motion)
        return (solve, views['motion'], views.get('forces'), views['wrench'], views['base'],
                result, motion[ACCELERATION] if result is motion else result)

    def call(self, motion: Motion, forces: Any, wrench: Any, base: BaseMotion | None,
             ) -> Array | None:
        """Return the row of the result; ``forces`` (6,) are those of the forward dynamics."""
        if type(motion) is not Motion or (base is not None and type(base) is not BaseMotion):
            return None
        try:
            memory = self._free.pop()
        except IndexError:
            memory = self._new()
        solve, of_motion, of_forces, of_wrench, of_base, result, checked = memory
        try:
            of_motion[:] = motion.rows
            if of_forces is not None:
                of_forces[:] = forces
            of_wrench[:] = _NO_WRENCH if wrench is None else wrench
            if base is not None:
                of_base[:] = base.rows
                if of_base[0] != of_base[0]:
                    return None  # nan would be a still base
            sound = solve()
            if sound is None:
                sound = math.isfinite(sum(checked.tolist()))
            return result.copy() if sound else None
        except _NO_FLOATS:
            return None
        finally:
            if base is not None:
                of_base[0] = math.nan  # the next one is still
            self._free.append(memory)


class _ForwardKinematics(_Memories):
    """The call of the forward kinematics."""

    def call(self, lengths: Any, guess: Pose | Motion) -> Array | None:
        """Return the row of the pose (12,) of leg lengths (6,), from a guess."""
        if type(guess) is not Pose and type(guess) is not Motion:
            return None
        try:
            memory = self._free.pop()
        except IndexError:
            memory = self._new()
        solve, arrays, views = memory
        try:
            views['lengths'][:] = lengths
            views['motion'][:_POSE] = guess.rows[..., :_POSE]
            solve()
            return (arrays['motion'][:_POSE].copy()
                    if views['code'][0] == forward_kinematics.FOUND else None)
        except _NO_FLOATS:
            return None
        finally:
            self._free.append(memory)
