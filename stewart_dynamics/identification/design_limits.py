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

from collections.abc import Sequence
import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.frames.motion import Motion
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.mechanics.kinematics.joint_angles import angles_to_check
from stewart_dynamics.mechanics.kinematics.leg_clearance import clearance_to_check
from stewart_dynamics.mechanics.limits import (
    ANGLES, CLEARANCE_MIN, FORCE_MAX, LENGTH_MAX, LENGTH_MIN, OF_JOINTS, OF_RESULTS, VELOCITY_MAX)
from stewart_dynamics.mechanics.rows import (
    CONDITION, FORCES, LENGTHS, MOTION, POSE, POSITION, RATES, ROTATION)
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Margins, as fractions of the stroke (at each end), rates, forces, and of joint angles and
# clearance: the masses are not known yet, and a controller overshoots.
_STROKE, _RATE, _FORCE, _ANGLE = 0.02, 0.1, 0.2, 0.1
# Largest condition number, relative to singularity.warn_condition.
_CONDITION = 0.5


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
        low, high, rate, force = (
            np.full(6, -np.inf if name == LENGTH_MIN else np.inf) if p[name] is None else p[name]
            for name in (LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX))
        stroke = np.where(np.isfinite(high - low), high - low, 0.0)
        self._low, self._high = low + _STROKE * stroke, high - _STROKE * stroke
        self._rate, self._force = (1.0 - _RATE) * rate, (1.0 - _FORCE) * force
        self._condition = _CONDITION * p['singularity.warn_condition']
        row = np.zeros((1, MOTION))
        self._rotation = from_euler(self.center[3:]).ravel()
        row[0, POSE] = *self.center[:3], *self._rotation
        there = platform.solve(row)[0]
        self._lengths, self._weights = there[LENGTHS], np.abs(there[FORCES])
        self._condition_there = float(there[CONDITION])
        bounds = {name: (1.0 - _ANGLE) * p[name] for name in OF_JOINTS if p[name] is not None}
        self._angles = angles_to_check(p, tuple(bounds))
        angles = self._angles(row)[0] if self._angles else np.zeros(0)
        self._joints = {name: (angles[ANGLES[name]], bound) for name, bound in bounds.items()}
        self._clearance = clearance_to_check(p)
        self._clearance_min = (1.0 + _ANGLE) * (p[CLEARANCE_MIN] or 0.0)
        self._clearance_there = self._clearance(row).min() if self._clearance else np.inf
        for name, wrong in (
                (LENGTH_MIN, self._lengths <= self._low),
                (LENGTH_MAX, self._lengths >= self._high),
                (FORCE_MAX, self._weights >= self._force),
                ('singularity.warn_condition', self._condition_there >= self._condition),
                (CLEARANCE_MIN, self._clearance_there <= self._clearance_min),
                *((name, at >= bound) for name, (at, bound) in self._joints.items())):
            if np.any(wrong):
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
        many, samples = rows.shape[:2]
        results = self._platform.solve(rows.reshape(-1, MOTION)).reshape(many, samples, -1)
        lengths, rates = results[..., LENGTHS], np.abs(results[..., RATES])
        forces = np.abs(results[..., FORCES])
        parts = {
            LENGTH_MIN: (self._lengths - lengths) / (self._lengths - self._low),
            LENGTH_MAX: (lengths - self._lengths) / (self._high - self._lengths),
            VELOCITY_MAX: rates / self._rate,
            FORCE_MAX: (forces - self._weights) / (self._force - self._weights),
            'singularity.warn_condition': (results[..., CONDITION, None] - self._condition_there)
            / (self._condition - self._condition_there)}
        if self._angles:
            angles = self._angles(rows.reshape(-1, MOTION)).reshape(many, samples, -1)
            for name, (at, bound) in self._joints.items():
                parts[name] = (angles[..., ANGLES[name]] - at) / (bound - at)
        if self._clearance:
            clearances = self._clearance(rows.reshape(-1, MOTION)).reshape(many, samples, 6)
            parts[CLEARANCE_MIN] = (self._clearance_there - clearances) / (
                self._clearance_there - self._clearance_min)
        if self._amplitude is not None:
            moved = np.linalg.norm(rows[..., POSITION] - self.center[:3], axis=-1)
            turned = self._size * np.linalg.norm(
                rows[..., ROTATION] - self._rotation, axis=-1) / np.sqrt(2.0)
            parts['--amplitude'] = np.maximum(moved, turned)[..., None] / self._amplitude
        return {name: part.max(axis=(1, 2)) for name, part in parts.items()}
