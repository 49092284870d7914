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

"""A Gough-Stewart platform: what the library's user calls."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError, PoseError, SingularityError
from stewart_dynamics.mechanics import forward_dynamics, forward_kinematics, kernel, lagrange
from stewart_dynamics.mechanics.jit import COMPILED
from stewart_dynamics.mechanics.motion import as_array, common_shape, Motion
from stewart_dynamics.mechanics.rows import (
    CONDITION, DETERMINANT, DETERMINANT_RATE, FORCES, LENGTHS, MOTION, RATES, RESULT,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.singularity import time_to_crossing, UNSOLVABLE_CONDITION
from stewart_dynamics.parameters import Parameters

# A thread gets no fewer samples than this: a millisecond's work, far more than starting it costs.
_SAMPLES_FOR_A_THREAD = 4096
_PARTS_OF_A_THREAD = 8
_CPUS = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1


class InverseDynamics(NamedTuple):
    """What the six legs do in a motion; (...) is the motion's leading shape."""

    lengths: Array
    """Lengths (..., 6) [m]."""
    rates: Array
    """Their time derivatives (..., 6) [m/s], + extends."""
    forces: Array
    """Forces of the actuators (..., 6) [N], + pushes."""
    unit_load_forces: Array
    """
    Largest force of each leg under a unit load on the platform (..., 6).

    The load is any force F and moment M with F^2 + (M / l)^2 = 1, l the characteristic length.
    """
    determinant: Array
    """det(J) := det(J_inv), (...) [m^3]."""
    determinant_rate: Array
    """d(det(J))/dt, (...) [m^3/s]."""
    condition_number: Array
    """
    Ratio of the largest to the smallest singular value of J_inv, (...), at least 1.

    The right three columns of J_inv are divided by the characteristic length first.
    """

    @property
    def time_to_crossing(self) -> Array:
        """Time after which det(J) is zero if it goes on as it does, (...) [s]; inf: never."""
        return time_to_crossing(self.determinant, self.determinant_rate)


class Pose(NamedTuple):
    """Where the platform is; (...) is the leading shape."""

    position: Array
    """Origin of the platform frame in the base frame, (..., 3) [m]."""
    rotation: Array
    """Platform axes to base axes, (..., 3, 3)."""


class StewartPlatform:
    """
    A machine with given parameters, and the mechanics of it.

    All poses are of the platform frame in the base frame, all vectors in base axes, all units
    SI. Every call takes one sample or any leading shape of samples.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.machine = _machine_numbers(parameters)
        """Its numbers (MACHINE,) as ``inverse_dynamics`` (the module) takes them."""
        self._no_wrench = np.zeros((1, WRENCH))

    @classmethod
    def from_yaml(cls, path: str | Path) -> StewartPlatform:
        """Return the machine of a parameter file; ParameterError says what is wrong in it."""
        return cls(Parameters.from_yaml(path))

    def inverse_dynamics(
            self, motion: Motion, wrench: ArrayLike | None = None) -> InverseDynamics:
        """
        Return leg lengths, rates and forces of a motion, and how near a singularity it is.

        Parameters
        ----------
        motion : Motion
            Of any leading shape (...).
        wrench : (..., 6), optional
            Force [N] and moment [N m] that the surroundings put on the platform at its
            origin, base axes. None by default. The leading shapes of motion and wrench
            broadcast against each other.

        Raises
        ------
        MotionError
            The wrench does not fit the motion or is not finite, or numbers overflow.
        SingularityError
            J_inv cannot be solved in a sample: it names the sample.

        """
        rows, wrenches, shape = self._rows(motion, wrench)
        results = self.solve(rows, wrenches)
        _check_finite(rows, results)
        _check_solvable(rows, results)
        return self._named(results.reshape(*shape, RESULT))

    def solve(self, rows: Array, wrenches: Array | None = None) -> Array:
        """
        Return the rows of results (N, RESULT) of rows of motion (N, MOTION), unchecked.

        This is the runtime path itself, laid out as ``inverse_dynamics`` (the module) says;
        large batches use all processors.
        """
        # Another layout in memory would be compiled for anew, for seconds.
        rows = _compiled_for(rows)
        wrenches = self._no_wrench if wrenches is None else _compiled_for(wrenches)
        results = np.empty((len(rows), RESULT))
        _in_parts(len(rows), lambda part: kernel.solve(
            self.machine, rows[part], wrenches if len(wrenches) == 1 else wrenches[part],
            results[part]))
        return results

    def forward_dynamics(
            self, motion: Motion, forces: ArrayLike, wrench: ArrayLike | None = None) -> Motion:
        """
        Return a motion with the accelerations that leg forces give it.

        ``inverse_dynamics`` of what is returned gives the forces back.

        Parameters
        ----------
        motion : Motion
            Of any leading shape (...); its own accelerations are not looked at.
        forces : (..., 6)
            Of the actuators [N], + pushes. What friction takes is taken off them.
        wrench : (..., 6), optional
            Load on the platform, as in ``inverse_dynamics``.

        Raises
        ------
        MotionError
            The arguments do not fit each other, are not finite or overflow. No pose is singular
            here: J_inv is not inverted.

        """
        pushes = as_array('forces', forces, (6,))
        load = as_array('wrench', wrench, (WRENCH,))
        shape = common_shape(motion=motion.shape, forces=pushes.shape[:-1],
                             wrench=load.shape[:-1])
        rows = _copies(motion.rows, shape)
        pushes, load = _copies(pushes, shape), _copies(load, shape)
        _in_parts(len(rows), lambda part: forward_dynamics.solve(
            self.machine, rows[part], pushes[part], load[part]))
        _check_finite(rows, rows)
        return Motion.of_rows(rows.reshape(*shape, MOTION))

    def forward_kinematics(
            self, lengths: ArrayLike, guess: Motion | Pose | tuple[ArrayLike, ArrayLike]) -> Pose:
        """
        Return the pose that six leg lengths belong to, on the guess's side of singularities.

        The leading shapes of lengths and guess broadcast against each other. The lengths of the
        pose returned differ by less than 1e-12 m from those given.

        Parameters
        ----------
        lengths : (..., 6)
            [m]
        guess : Motion, Pose or (position, rotation)
            Where to begin: the last pose, or the one commanded. From 20 % of the machine's
            height and 0.2 rad away it is found from nearly everywhere (benchmarks/README.md).

        Raises
        ------
        PoseError
            The lengths belong to no pose on the guess's side of singularities.
        SingularityError
            The guess is singular, or a pose on the way from it.
        MotionError
            What is given does not fit or is not finite.

        """
        wanted = as_array('lengths', lengths, (6,))
        begin = guess if isinstance(guess, Motion) else Motion(*guess)
        shape = common_shape(lengths=wanted.shape[:-1], guess=begin.shape)
        wanted, rows = _copies(wanted, shape), _copies(begin.rows, shape)
        codes, steps = np.empty(len(rows), dtype=np.int64), np.empty(len(rows), dtype=np.int64)
        residuals = np.empty(len(rows))
        _in_parts(len(rows), lambda part: forward_kinematics.poses(
            self.machine, wanted[part], rows[part], codes[part], steps[part], residuals[part]))
        if codes.any():
            at = int(np.argmax(codes > 0))
            where = (f'sample {at}: lengths {wanted[at].tolist()} m: from the guess '
                     f'{rows[at, :3].tolist()} m')
            if codes[at] == forward_kinematics.SINGULAR:
                raise SingularityError(f'{where} the way leads to a singular pose, in '
                                       f'{steps[at]} steps: give a guess clear of it')
            raise PoseError(
                f'{where} no pose is found that has them: after {steps[at]} steps a length is '
                f'{residuals[at]:.3g} m off, must be {forward_kinematics.RESIDUAL:g}')
        return Pose(rows[:, :3].reshape(*shape, 3).copy(),
                    rows[:, 3:12].reshape(*shape, 3, 3).copy())

    def twist(self, position: ArrayLike, rotation: ArrayLike, rates: ArrayLike) -> Array:
        """
        Return the twist [v; w] (..., 6) of leg rates (..., 6) [m/s] at a pose, base axes.

        Raises SingularityError where J_inv cannot be solved, MotionError for what does not fit.
        """
        motion = Motion(position, rotation)
        given = as_array('rates', rates, (6,))
        shape = common_shape(pose=motion.shape, rates=given.shape[:-1])
        given, rows = _copies(given, shape), _copies(motion.rows, shape)
        _check_solvable(rows, self.solve(rows))
        forward_kinematics.twists(self.machine, given, rows)
        _check_finite(rows, rows)
        return rows[:, 12:18].reshape(*shape, 6).copy()

    def inverse_kinematics(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """Return the six leg lengths at a pose, (..., 6) [m]; MotionError for what is none."""
        motion = Motion(position, rotation)
        results = self.solve(motion.rows.reshape(-1, MOTION))
        lengths = results[:, LENGTHS]
        if not np.isfinite(lengths).all():
            raise MotionError('position: out of range, the leg lengths overflow')
        return lengths.reshape(*motion.shape, 6).copy()

    def jacobian(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """Return J_inv (..., 6, 6): leg rates = J_inv [v; w], J_inv^T forces = wrench."""
        return lagrange.jacobian(self._legs(Motion(position, rotation)))

    def jacobian_rate(self, motion: Motion) -> Array:
        """Return dJ_inv/dt (..., 6, 6) in a motion."""
        return lagrange.jacobian_rate(
            self._legs(motion), motion.linear_velocity, motion.angular_velocity)

    def mass_matrix(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """
        Return M (..., 6, 6) of M X'' + C X' + G = J_inv^T f + wrench, with X' = [v; w].

        Platform, both parts of each leg, and the actuators' reflected mass.
        """
        motion = Motion(position, rotation)
        return lagrange.mass_matrix(self.parameters, motion.position, motion.rotation)

    def coriolis_matrix(
            self, position: ArrayLike, rotation: ArrayLike, linear_velocity: ArrayLike,
            angular_velocity: ArrayLike, christoffel: bool = False) -> Array:
        """
        Return C (..., 6, 6); without friction.

        C X' is the same either way. The paper's C has X'^T (M' - 2 C) X' = 0; with
        ``christoffel``, M' - 2 C is skew itself, which passivity-based controllers need.
        """
        motion = Motion(position, rotation, linear_velocity, angular_velocity)
        return lagrange.coriolis_matrix(
            self.parameters, motion.position, motion.rotation, motion.linear_velocity,
            motion.angular_velocity, christoffel)

    def gravity_vector(self, position: ArrayLike, rotation: ArrayLike) -> Array:
        """Return G (..., 6) [N, N m]: the wrench that holds the machine at rest."""
        motion = Motion(position, rotation)
        return lagrange.gravity_vector(self.parameters, motion.position, motion.rotation)

    def _legs(self, motion: Motion) -> lagrange.Legs:
        return lagrange.legs(self.parameters, motion.position, motion.rotation)

    def _rows(self, motion: Motion, wrench: ArrayLike | None,
              ) -> tuple[Array, Array, tuple[int, ...]]:
        """Return rows of motion, rows of wrenches or one for all, and their leading shape."""
        if wrench is None:
            return motion.rows.reshape(-1, MOTION), self._no_wrench, motion.shape
        load = as_array('wrench', wrench, (WRENCH,))
        shape = common_shape(motion=motion.shape, wrench=load.shape[:-1])
        rows = (_copies(motion.rows, shape) if shape != motion.shape
                else motion.rows.reshape(-1, MOTION))
        return rows, _copies(load, shape), shape

    @staticmethod
    def _named(results: Array) -> InverseDynamics:
        return InverseDynamics(
            results[..., LENGTHS],
            results[..., RATES],
            results[..., FORCES],
            results[..., UNIT_LOAD_FORCES],
            # [()] makes a number of an array without a shape
            results[..., DETERMINANT][()], results[..., DETERMINANT_RATE][()],
            results[..., CONDITION][()])


def _in_parts(many: int, do: Callable[[slice], None]) -> None:
    """Do so many samples in parts, large batches on all processors."""
    threads = min(_CPUS, many // _SAMPLES_FOR_A_THREAD) if COMPILED else 1
    if threads < 2:
        do(slice(0, many))
        return
    # More parts than threads: a thread that is held up leaves more to the others.
    edges = np.linspace(0, many, _PARTS_OF_A_THREAD * threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(do, map(slice, edges[:-1], edges[1:])))


def _copies(array: Array, shape: tuple[int, ...]) -> Array:
    """Return rows (N, ...) of their own of an array that is broadcast to a leading shape."""
    last = array.shape[-1]
    if array.shape[:-1] != shape:
        array = np.broadcast_to(array, (*shape, last))
    return np.array(array, order='C').reshape(-1, last)


def _check_finite(rows: Array, results: Array) -> None:
    """Raise MotionError where the results (N, ...) of rows of motion are not finite."""
    finite = np.isfinite(results).all(axis=-1)
    if not finite.all():
        at = int(np.argmin(finite))
        raise MotionError(f'sample {at}: out of range, the numbers overflow; position '
                          f'{rows[at, :3].tolist()} m')


def _check_solvable(rows: Array, results: Array) -> None:
    """Raise SingularityError where the results of rows of motion say that J_inv is singular."""
    condition = results[:, CONDITION]
    unsolvable = condition >= UNSOLVABLE_CONDITION
    if unsolvable.any():
        at = int(np.argmax(unsolvable))
        raise SingularityError(
            f'sample {at}: J_inv cannot be solved: its condition number is '
            f'{condition[at]:.3g}, must be under {UNSOLVABLE_CONDITION:g}; position '
            f'{rows[at, :3].tolist()} m')


def _compiled_for(array: Array) -> Array:
    """Return the array, or a copy of it that the runtime path is compiled for."""
    if array.flags.carray and array.dtype.char == 'd':
        return array
    return np.require(array, float, ['C', 'W'])


def _machine_numbers(p: Parameters) -> Array:
    """Return the machine's numbers in the order of the runtime path."""
    cylinder_mass, cylinder_com = p['legs.cylinder.mass'], p['legs.cylinder.center_of_mass']
    legs = np.column_stack([
        p['geometry.base_joints'], p['geometry.platform_joints'],
        p['legs.piston.mass'], p['legs.piston.center_of_mass'],
        cylinder_mass * cylinder_com,
        cylinder_mass * cylinder_com ** 2 + p['legs.cylinder.inertia'] + p['legs.piston.inertia'],
        p['actuator.reflected_mass'], p['actuator.viscous_friction'],
        p['actuator.coulomb_friction']])
    return np.concatenate([
        p['gravity'], [p['singularity.characteristic_length'], p['platform.mass']],
        p['platform.center_of_mass'], p['platform.inertia'], legs.ravel()])
