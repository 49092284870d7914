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

"""The arguments of a platform's calls: checked, broadcast, and as rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array, Integers
from stewart_dynamics.errors import MotionError, SingularityError
from stewart_dynamics.mechanics.arguments import (
    as_array, check_finite, common_shape, optional_array, wrong_type)
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.rows import CONDITION, MOTION, NO_BASE, POSE, POSITION, WRENCH
from stewart_dynamics.mechanics.singularity_warning import UNSOLVABLE_CONDITION


def check_kind(value: object, *kinds: type[Pose] | type[Motion], name: str = '') -> None:
    """Raise MotionError if an argument is not of one of these types."""
    if isinstance(value, kinds):
        return
    name = name or ('pose' if Pose in kinds else 'motion')
    hint = '; Motion.from_pose makes one at rest' if isinstance(value, Pose) else ''
    raise wrong_type(name, value, ' or '.join(f'a {kind.__name__}' for kind in kinds) + hint)


def loaded(motion: Motion, wrench: ArrayLike | None, base: BaseMotion | None,
           ) -> tuple[Array, Array, Array, tuple[int, ...]]:
    """Return rows of motion, of wrenches and of the base (one if for all), and the shape."""
    check_kind(motion, Motion)
    if isinstance(wrench, BaseMotion):
        raise wrong_type('wrench', wrench, "six numbers; a base's motion is the argument base")
    load = optional_array('wrench', wrench, (WRENCH,))
    bases = base_rows(base)
    shape = common_shape(motion=motion.shape, wrench=load.shape[:-1], base=bases.shape[:-1])
    rows = (copies(motion.rows, shape) if shape != motion.shape
            else motion.rows.reshape(-1, MOTION))
    load, bases = (array.reshape(1, -1) if array.ndim == 1 else copies(array, shape)
                   for array in (load, bases))
    return rows, load, bases, shape


def base_rows(base: BaseMotion | None) -> Array:
    """Return the rows (..., BASE) of the base's motion; a row of nan for None."""
    if base is None:
        return np.array(NO_BASE)
    if not isinstance(base, BaseMotion):
        raise wrong_type('base', base, 'a BaseMotion')
    # A row of nan would stand for a still base.
    return check_finite('base', base.rows, len(base.shape))


def motion_rows(pose: Pose | Motion, shape: tuple[int, ...] | None = None) -> Array:
    """Return rows of motion (N, MOTION) at rest in a pose that is broadcast to a leading shape."""
    check_kind(pose, Pose, Motion)
    rows = np.zeros((*(pose.shape if shape is None else shape), MOTION))
    rows[..., POSE] = pose.rows[..., POSE]
    return rows.reshape(-1, MOTION)


def leg_stiffnesses(value: ArrayLike) -> Array:
    """Return stiffnesses (..., 6) [N/m]; MotionError where one is not positive."""
    is_number = np.isscalar(value) or getattr(value, 'shape', None) == ()
    legs = as_array('leg_stiffness', value, () if is_number else (6,))
    legs = np.full(6, legs) if is_number else legs
    if not (legs > 0.0).all():
        raise MotionError(f'leg_stiffness: {legs.min():g} N/m: must be more than 0')
    return legs


def copies(array: Array, shape: tuple[int, ...]) -> Array:
    """Return a copy as rows (N, ...) of an array that is broadcast to a leading shape."""
    last = array.shape[-1]
    if array.shape[:-1] != shape:
        array = np.broadcast_to(array, (*shape, last))
    return np.array(array, order='C').reshape(-1, last)


def place(at: int, shape: tuple[int, ...]) -> str:
    """Return the index of a sample in the leading shape, as text."""
    if len(shape) < 2:
        return str(at)
    return str(list(map(int, np.unravel_index(at, shape))))


def find_unsolvable(
        rows: Array, results: Array, shape: tuple[int, ...], singular: str) -> Integers:
    """Return the samples where J_inv cannot be solved; SingularityError if that is to raise."""
    if singular not in ('raise', 'nan'):
        raise wrong_type('singular', singular, "'raise' or 'nan'")
    condition = results[:, CONDITION]
    unsolvable: Integers = (condition >= UNSOLVABLE_CONDITION).nonzero()[0]
    if singular == 'raise' and len(unsolvable):
        at = int(unsolvable[0])
        raise SingularityError(
            f'sample {place(at, shape)}: J_inv cannot be solved: its condition number is '
            f'{condition[at]:.3g}, must be less than {UNSOLVABLE_CONDITION:g}; position '
            f'{rows[at, POSITION].tolist()} m')
    return unsolvable
