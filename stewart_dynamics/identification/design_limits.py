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

"""Use of the hexapod's limits by a motion that is being designed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.joint_angles import angles_to_check
from stewart_dynamics.mechanics.kinematics.leg_clearance import clearance_to_check
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, FORCE_MAX, LENGTH_MAX, LENGTH_MIN, MINIMA, OF_JOINTS, OF_RESULTS,
    VELOCITY_MAX)
from stewart_dynamics.mechanics.rows import (
    CONDITION, FORCES, LENGTHS, MOTION, POSE, POSITION, RATES, ROTATION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters

# Margins, as fractions of the stroke (at each end), rates, forces, and of joint angles and
# clearance: the masses are not known yet, and a controller overshoots.
_STROKE, _RATE, _FORCE, _ANGLE = 0.02, 0.1, 0.2, 0.1
# Largest condition number, relative to singularity.warn_condition.
_CONDITION = 0.5
_WARN_CONDITION = 'singularity.warn_condition'


class DesignLimits:
    """
    The limits of a hexapod with their margins, and the center of the motion.

    ``amplitude`` is the largest displacement of the origin [m]; rotations are limited to it
    divided by the characteristic length. If it is given, limits may be missing. ``center`` is
    X Y Z alpha beta gamma [m, rad], home by default. Raises ParameterError if a limit is missing,
    or the center is not within the limits.
    """

    def __init__(self, platform: StewartPlatform, amplitude: float | None = None,
                 center: Sequence[float] | None = None) -> None:
        p = platform.parameters
        missing = [name for name in OF_RESULTS if p[name] is None]
        if missing and amplitude is None:
            raise ParameterError(
                f'{", ".join(missing)}: missing: a motion is designed within the limits of the '
                'parameter file, or with --amplitude')
        self._platform, self._amplitude = platform, amplitude
        self._size = p['singularity.characteristic_length']
        if center is None:
            digits = 6 - round(math.log10(self._size))
            center = [*platform.home_pose().position.round(digits).tolist(), 0.0, 0.0, 0.0]
        self.center: Array = np.array(center, dtype=float)
        """X Y Z alpha beta gamma."""
        self._rotation = from_euler(self.center[3:]).ravel()
        self._bounds = _bounds(p)
        self._of_joints = tuple(name for name in OF_JOINTS if name in self._bounds)
        self._angles, self._clearance = angles_to_check(p, self._of_joints), clearance_to_check(p)
        row = np.zeros((1, 1, MOTION))
        row[..., POSE] = *self.center[:3], *self._rotation
        self._there = {name: values[0, 0] for name, values in self._values(row)}
        for name, there in self._there.items():
            bound = self._bounds[name]
            if np.any(there <= bound if name in MINIMA else there >= bound):
                raise ParameterError(f'{name}: at the center of the motion the hexapod exceeds '
                                     'it, or is within its margin')

    def excess(self, rows: Array) -> Array:
        """
        Return the fraction of the free range that motions (M, N, MOTION) use; 1 is all of it.

        The value is large beyond a singularity, or if numbers overflow.
        """
        parts = np.array(list(self._parts(rows).values()))
        worst: Array = np.where(np.isfinite(parts), parts, 10.0).max(axis=0)
        return np.minimum(worst, 10.0)

    def use(self, motion: Motion) -> dict[str, float]:
        """Return the fraction of each limit, less its margin, that a motion (N,) uses."""
        return {name: float(part[0]) for name, part in self._parts(motion.rows[None]).items()
                if part[0] > 0.0}

    def _parts(self, rows: Array) -> dict[str, Array]:
        """Return the fraction (M,) of the range from the center to each bound that is used."""
        parts = {
            name: (values - self._there[name]) / (self._bounds[name] - self._there[name])
            for name, values in self._values(rows)}
        if self._amplitude is not None:
            moved = np.linalg.norm(rows[..., POSITION] - self.center[:3], axis=-1)
            turned = self._size * np.linalg.norm(
                rows[..., ROTATION] - self._rotation, axis=-1) / np.sqrt(2.0)
            parts['--amplitude'] = np.maximum(moved, turned)[..., None] / self._amplitude
        return {name: part.max(axis=(1, 2)) for name, part in parts.items()}

    def _values(self, rows: Array) -> Iterator[tuple[str, Array]]:
        """Yield the values (M, N, ...) that each limit bounds, for motions (M, N, MOTION)."""
        flat, shape = rows.reshape(-1, MOTION), rows.shape[:2]
        results = self._platform.solve(flat).reshape(*shape, -1)
        yield LENGTH_MIN, results[..., LENGTHS]
        yield LENGTH_MAX, results[..., LENGTHS]
        yield VELOCITY_MAX, np.abs(results[..., RATES])
        yield FORCE_MAX, np.abs(results[..., FORCES])
        yield _WARN_CONDITION, results[..., CONDITION, None]
        if self._angles:
            angles = self._angles(flat).reshape(*shape, -1)
            for name in self._of_joints:
                yield name, angles[..., ANGLES[name]]
        if self._clearance:
            yield CLEARANCE_MIN, self._clearance(flat).min(axis=-1).reshape(*shape, 1)


def _bounds(p: Parameters) -> dict[str, Any]:
    """Return the limits less their margins; infinite if not given."""
    low, high, rate, force = (
        np.full(6, -np.inf if name == LENGTH_MIN else np.inf) if p[name] is None else p[name]
        for name in OF_RESULTS)
    stroke = np.where(np.isfinite(high - low), high - low, 0.0)
    return {
        LENGTH_MIN: low + _STROKE * stroke, LENGTH_MAX: high - _STROKE * stroke,
        VELOCITY_MAX: (1.0 - _RATE) * rate, FORCE_MAX: (1.0 - _FORCE) * force,
        _WARN_CONDITION: _CONDITION * p[_WARN_CONDITION],
        **{name: (1.0 - _ANGLE) * p[name] for name in OF_JOINTS if p[name] is not None},
        CLEARANCE_MIN: (1.0 + _ANGLE) * (p[CLEARANCE_MIN] or 0.0)}
