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

"""Regression columns: the regressor of the linear parameters, and the known forces."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform


def regression(platform: StewartPlatform, unknowns: Unknowns, rows: Array) -> tuple[Array, Array]:
    """
    Return the regressor (N, 6, n) of ``unknowns.theta`` and the known forces (N, 6) [N].

    Parameters
    ----------
    platform : StewartPlatform
        Hexapod with the parameters of the file.
    unknowns : Unknowns
        Parameters to be identified.
    rows : (N, MOTION)
        Rows of motion.

    """
    matrix, fixed = platform.regressors(rows), unknowns.fixed
    regressor: Array = matrix[..., unknowns.linear]
    known: Array = matrix @ fixed
    if unknowns.tilt is not None:
        parts = [regressor]
        for axis in np.eye(3):
            matrix = platform.regressors_at_rest(rows, axis[None])
            parts += [matrix[..., unknowns.weighing], (matrix @ fixed)[..., None]]
        regressor = np.concatenate(parts, axis=-1)
    return regressor, known
