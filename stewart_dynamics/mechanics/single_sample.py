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
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function, places, record
from stewart_dynamics.mechanics.batch import WIDTHS
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

    ``inverse_dynamics``, ``forward_dynamics`` and ``base_wrench`` take a motion, the forces of the
    legs (6,) or None, a wrench (6,) or None, and the base's motion or None. They return a row of
    results (RESULT,), the row of the motion (MOTION,) and a wrench (6,). ``forward_kinematics``
    takes leg lengths (6,) and a guess, and returns the row of the pose (12,).
    """

    def __init__(self, hexapod: Records) -> None:
        self.inverse_dynamics = _dynamics(hexapod, 'solve_one', 'result')
        self.forward_dynamics = _dynamics(hexapod, 'forward_dynamics_one', 'motion')
        self.base_wrench = _dynamics(hexapod, 'base_wrench_one', 'base_wrench')
        self.forward_kinematics = _forward_kinematics(hexapod)


# The calls are closures: names of an enclosing function are found faster than attributes.

def _dynamics(hexapod: Records, name: str, result: str) -> Callable[
        [Motion, Any, Any, BaseMotion | None], Array | None]:
    """Return the call of a function of motion, forces, wrench and base."""
    where, pushed = places('one_motion'), result == 'motion'
    of_result = where[result]
    if result == 'result':
        of_result = slice(of_result.start, of_result.start + WIDTHS[int(hexapod['leg_kind'])])
    # As much memory as there are calls at the same time, on a base at rest and on one that moves.
    at_rest: list[tuple[Any, ...]] = []
    moving: list[tuple[Any, ...]] = []

    def new() -> tuple[Any, ...]:
        solve, numbers = _bound(hexapod, name, 'one_motion')
        numbers[where['base']] = NO_BASE
        return (solve, *(numbers[where[field]].data for field in (
            'motion', 'forces', 'wrench', 'base')), numbers[of_result])

    def call(motion: Motion, forces: Any, wrench: Any, base: BaseMotion | None) -> Array | None:
        if type(motion) is not Motion or (base is not None and type(base) is not BaseMotion):
            return None
        free = at_rest if base is None else moving
        try:
            memory = free.pop()  # atomic, as append
        except IndexError:
            memory = new()
        solve, of_motion, of_forces, of_wrench, of_base, found = memory
        try:
            of_motion[:] = motion.rows
            if pushed:
                of_forces[:] = forces
            if wrench is not None:
                of_wrench[:] = wrench
            if base is not None:
                of_base[:] = base.rows
                gravity = of_base[0]
                if gravity != gravity:
                    return None  # nan would be a base at rest
            return found.copy() if solve() else None
        except _NO_FLOATS:
            return None
        finally:
            if wrench is not None:
                of_wrench[:] = _NO_WRENCH  # the next call may have no wrench
            free.append(memory)

    return call


def _forward_kinematics(hexapod: Records) -> Callable[[Any, Pose | Motion], Array | None]:
    """Return the call of the forward kinematics."""
    where = places('one_pose')
    free: list[tuple[Any, ...]] = []

    def call(lengths: Any, guess: Pose | Motion) -> Array | None:
        if type(guess) is not Pose and type(guess) is not Motion:
            return None
        try:
            memory = free.pop()
        except IndexError:
            solve, numbers = _bound(hexapod, 'forward_kinematics_one', 'one_pose')
            pose = numbers[where['pose']]
            memory = solve, numbers[where['lengths']].data, pose.data, pose
        solve, of_lengths, of_pose, pose = memory
        try:
            of_lengths[:] = lengths
            of_pose[:] = guess.rows[..., :_POSE]
            return pose.copy() if solve() == forward_kinematics.FOUND else None
        except _NO_FLOATS:
            return None
        finally:
            free.append(memory)

    return call


def _bound(hexapod: Records, name: str, sample: str) -> tuple[Callable[[], Any], Array]:
    """Return a function of a hexapod, bound to new memory, and the memory as numbers."""
    numbers = np.zeros(record(sample).itemsize // 8)
    return function(name).bound(hexapod, numbers), numbers
