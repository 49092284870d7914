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

"""How much of its limits a hexapod uses in a motion that is being designed."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.limits import FORCE_MAX, LENGTH_MAX, LENGTH_MIN, VELOCITY_MAX
from stewart_dynamics.mechanics.rows import CONDITION, FORCES, LENGTHS, MOTION, POSITION, RATES
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Parts that stay free: of the stroke at each end, of the rates, of the forces. The masses are not
# known yet, and a controller overshoots.
_STROKE, _RATE, _FORCE = 0.02, 0.1, 0.2
# The condition number at most, by singularity.warn_condition.
_CONDITION = 0.5

_NAMES = (LENGTH_MIN, LENGTH_MAX, VELOCITY_MAX, FORCE_MAX)


class DesignLimits:
    """
    The limits of a hexapod with their margins, and home, which is the center of the motion.

    Parameters
    ----------
    platform : StewartPlatform
        The hexapod.
    amplitude : float, optional
        Displacement of the origin from home at most [m], of turns by the characteristic length;
        with it limits may be missing.

    Raises
    ------
    ParameterError
        A limit is missing, or home is not within the limits.

    """

    def __init__(self, platform: StewartPlatform, amplitude: float | None) -> None:
        p = platform.parameters
        missing = [name for name in _NAMES if p[name] is None]
        if missing and amplitude is None:
            raise ParameterError(
                f'{", ".join(missing)}: missing: a motion is designed within the limits of the '
                'parameter file, or with --amplitude')
        self._platform, self._amplitude = platform, amplitude
        home = platform.home_pose()
        self._home = home
        self.center: Array = np.concatenate([home.position, np.zeros(3)])
        """X Y Z alpha beta gamma."""
        self._size = p['singularity.characteristic_length']
        low, high = p[LENGTH_MIN], p[LENGTH_MAX]
        stroke = 0.0 if low is None or high is None else high - low
        self._low = np.full(6, -np.inf) if low is None else low + _STROKE * stroke
        self._high = np.full(6, np.inf) if high is None else high - _STROKE * stroke
        self._rate = np.full(6, np.inf) if p[VELOCITY_MAX] is None else (
            (1.0 - _RATE) * p[VELOCITY_MAX])
        self._force = np.full(6, np.inf) if p[FORCE_MAX] is None else (
            (1.0 - _FORCE) * p[FORCE_MAX])
        self._condition = _CONDITION * p['singularity.warn_condition']
        row = np.zeros((1, MOTION))
        row[0, :3], row[0, 3:12] = home.position, home.rotation.ravel()
        at_home = platform.solve(row)[0]
        self._lengths, self._weights = at_home[LENGTHS], np.abs(at_home[FORCES])
        self._condition_home = float(at_home[CONDITION])
        for name, wrong in (
                (LENGTH_MIN, self._lengths <= self._low), (LENGTH_MAX, self._lengths >= self._high),
                (FORCE_MAX, self._weights >= self._force),
                ('singularity.warn_condition', self._condition_home >= self._condition)):
            if np.any(wrong):
                raise ParameterError(f'{name}: the hexapod is beyond it, or within its margin, '
                                     'at home already: no motion about home')

    def excess(self, rows: Array) -> Array:
        """
        Return how much of what is free the motions use, of rows (M, N, MOTION): 1 is all of it.

        Beyond a singularity, or where numbers overflow, it is a large number.
        """
        parts = np.array(list(self._parts(rows).values()))
        worst: Array = np.where(np.isfinite(parts), parts, 10.0).max(axis=0)
        return np.minimum(worst, 10.0)

    def use(self, motion: object) -> dict[str, float]:
        """Return the part of each limit, with its margin, that a motion (N,) uses."""
        rows = getattr(motion, 'rows')
        return {name: float(part[0]) for name, part in self._parts(rows[None]).items()
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
            'singularity.warn_condition': (results[..., CONDITION, None] - self._condition_home)
            / (self._condition - self._condition_home)}
        if self._amplitude is not None:
            moved = np.linalg.norm(rows[..., POSITION] - self._home.position, axis=-1)
            turned = self._size * np.linalg.norm(
                rows[..., 3:12] - self._home.rotation.ravel(), axis=-1) / np.sqrt(2.0)
            parts['--amplitude'] = np.maximum(moved, turned)[..., None] / self._amplitude
        return {name: part.max(axis=(1, 2)) for name, part in parts.items()}
