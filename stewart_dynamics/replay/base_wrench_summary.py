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

"""The part of the summary about the base wrench: what foundation, deck or truss must carry."""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.reporting.block_statistics import Extreme, Integral

# Of the columns: force and moment, then their components.
_NAMES = ('force', 'moment', 'force_x', 'force_y', 'force_z', 'moment_x', 'moment_y', 'moment_z')
_UNITS = ('n', 'n_m', 'n', 'n', 'n', 'n_m', 'n_m', 'n_m')

Numbers = dict[str, float | None]


class BaseWrenchSummary:
    """Peaks, RMS and means of the base wrench, block by block."""

    def __init__(self) -> None:
        self._peaks = Extreme(len(_NAMES), np.abs)
        self._squares_and_sizes = Integral(2 * len(_NAMES))

    def add(self, seconds: Array, steps: Array, wrenches: Array) -> None:
        """
        Add a block of samples.

        Parameters
        ----------
        seconds : (N,)
            Time since the first setpoint of the bag [s].
        steps : (N,)
            From each one's predecessor to it [s].
        wrenches : (N, 6)
            Force [N] and moment [N m]; nan: not known.

        """
        squares = np.empty((len(seconds), len(_NAMES)))
        with np.errstate(over='ignore'):
            np.square(wrenches, out=squares[:, 2:])
            squares[:, 0] = squares[:, 2] + squares[:, 3] + squares[:, 4]
            squares[:, 1] = squares[:, 5] + squares[:, 6] + squares[:, 7]
        values = np.concatenate((np.sqrt(squares[:, :2]), wrenches), axis=1)
        self._peaks.add(seconds, values)
        self._squares_and_sizes.add(steps, np.concatenate((squares, values), axis=1))

    def values(self) -> dict[str, Numbers]:
        """Return the part of summary.json."""
        squares, means = self._squares_and_sizes.mean.reshape(2, len(_NAMES)).tolist()
        numbers = zip(np.sqrt(squares).tolist(), means, self._peaks.values.tolist(),
                      self._peaks.at.tolist(), strict=True)
        return {name: {f'{key}_{unit}' if key != 'peak_at' else 'peak_at_s':
                       value if math.isfinite(value) else None
                       for key, value in zip(('rms', 'mean', 'peak', 'peak_at'), each,
                                             strict=True)}
                for name, unit, each in zip(_NAMES, _UNITS, numbers, strict=True)}
