# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The calls of the library for one sample, as fast as a control loop or an MPC needs them.

A call takes little more time than the arithmetic: arguments are copied to memory whose address
the machine code knows already. A call returns None if an argument must be converted or is wrong,
or if the result is not sound; the call for batches then converts the argument or raises the error.
"""

from __future__ import annotations

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

    def __init__(self, constants: Array) -> None:
        motion, six, base = np.zeros((1, MOTION)), np.empty((1, 6)), np.array([NO_BASE])
        self.inverse_dynamics = _Dynamics(
            inverse_dynamics.solve, constants, motion=motion, wrench=six, base=base,
            result=np.empty((1, RESULT)), sound=np.empty(1, dtype=bool),
            work=np.empty(inverse_dynamics.TILE)).call
        self.forward_dynamics = _Dynamics(
            forward_dynamics.solve, constants, motion=motion, forces=six, wrench=six, base=base,
            work=np.empty(forward_dynamics.WORK)).call
        self.base_wrench = _Dynamics(base_wrench.base_wrenches, constants, motion=motion,
                                     wrench=six, base=base, result=six).call
        self.forward_kinematics = _ForwardKinematics(
            forward_kinematics.poses, constants, lengths=six, motion=motion,
            code=np.empty(1, np.int64), steps=np.empty(1, np.int64), residual=np.empty(1)).call


class _Memories:
    """The memory of calls of a function: as much as there are calls at the same time."""

    def __init__(self, function: EntryPoint, constants: Array, **arrays: NDArray[Any]) -> None:
        self._function, self._constants, self._arrays = function, constants, arrays
        self._free: list[tuple[Any, ...]] = []  # its pop and append are atomic

    def _new(self) -> tuple[Any, ...]:
        """Return the function bound to new arrays, the arrays, and a memoryview of each."""
        arrays = {name: array.copy() for name, array in self._arrays.items()}
        return (self._function.bound(self._constants, *arrays.values()), arrays,
                {name: array.reshape(-1).data for name, array in arrays.items()})


class _Dynamics(_Memories):
    """A call of a function of motion, forces, wrench and base."""

    def _new(self) -> tuple[Any, ...]:
        solve, arrays, views = super()._new()
        motion = arrays['motion'][0]
        result = arrays['result'][0] if 'result' in arrays else motion
        return (solve, views['motion'], views.get('forces'), views['wrench'], views['base'],
                result, motion[ACCELERATION] if result is motion else result, views.get('sound'))

    def call(self, motion: Motion, forces: Any, wrench: Any, base: BaseMotion | None,
             ) -> Array | None:
        """Return the row of the result; ``forces`` (6,) are those of the forward dynamics."""
        if type(motion) is not Motion or (base is not None and type(base) is not BaseMotion):
            return None
        try:
            memory = self._free.pop()
        except IndexError:
            memory = self._new()
        solve, of_motion, of_forces, of_wrench, of_base, result, checked, sound = memory
        try:
            of_motion[:] = motion.rows
            if of_forces is not None:
                of_forces[:] = forces
            of_wrench[:] = _NO_WRENCH if wrench is None else wrench
            if base is not None:
                of_base[:] = base.rows
                if of_base[0] != of_base[0]:
                    return None  # nan would be a still base
            solve()
            is_sound = math.isfinite(sum(checked.tolist())) if sound is None else sound[0]
            return result.copy() if is_sound else None
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
            return (arrays['motion'][0, :_POSE].copy()
                    if views['code'][0] == forward_kinematics.FOUND else None)
        except _NO_FLOATS:
            return None
        finally:
            self._free.append(memory)
