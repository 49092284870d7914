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

"""
Projection of fitted values onto physically consistent ones, in the metric of the information.

Mass and friction are not negative, and the platform's pseudo-inertia is positive definite
(``mechanics.dynamics.pseudo_inertia``). If least squares violate this, the platform's ten
parameters are fitted again in log-Cholesky parameters, which always describe a physical body.
"""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.dynamics.pseudo_inertia import (
    from_log_cholesky, log_cholesky, log_cholesky_derivative, smallest_eigenvalue)

# Relative distance to the bound below which a body is a point or a rod within rounding.
SMALLEST = 1e-6
_STEPS = 200


def consistent(unknowns: Unknowns, values: Array, information: Array,
               ) -> tuple[Array, tuple[str, ...]]:
    """Return values (k,) within all bounds, and the names of those that violated one."""
    # Unidentifiable parameters are held with a standard error of their scale.
    matrix = information + np.diag(unknowns.scales ** -2.0)
    beyond: list[str] = []
    free: Flags = np.ones(len(values), dtype=bool)
    found = values
    for _ in range(len(values)):
        negative = [n for n in unknowns.not_negative() if found[n] < 0.0 and free[n]]
        if not negative:
            break
        beyond += [unknowns.names[n] for n in negative]
        free[negative] = False
        found = _held(matrix, values, free)
    many = unknowns.many_of_platform
    if many and smallest_eigenvalue(unknowns.inertial(found)) < SMALLEST:
        beyond += unknowns.names[:many]
        found = _as_body(unknowns, found, matrix)
    return found, tuple(beyond)


def _held(matrix: Array, values: Array, free: Flags) -> Array:
    """Return the values with some at zero and the others at their conditional optimum."""
    at_zero = np.where(free, values, 0.0)
    change = at_zero - values
    shift = np.linalg.solve(matrix[np.ix_(free, free)], matrix[np.ix_(free, ~free)]
                            @ change[~free])
    at_zero[free] = values[free] - shift
    return at_zero


def _as_body(unknowns: Unknowns, values: Array, matrix: Array) -> Array:
    """Return the nearest values with a physical platform, in the metric of information."""
    units = unknowns.inertial_scales

    def candidate(eta: Array) -> Array:
        return unknowns.with_inertial(values, units * from_log_cholesky(eta))

    many = unknowns.many_of_platform
    scales = unknowns.scales[:many]
    metric = matrix[:many, :many]
    eta = log_cholesky(unknowns.inertial(unknowns.start) / units)
    found = candidate(eta)
    damping = 1e-3
    for _ in range(_STEPS):
        off = (found - values)[:many]
        scaled = unknowns.derivative(found)[:10, :many] * scales / units[:, None]
        derivative = scales[:, None] * np.linalg.pinv(scaled) @ log_cholesky_derivative(eta)
        normal = derivative.T @ metric @ derivative
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12),
                               -derivative.T @ metric @ off)
        eta_next = eta + np.clip(step, -1.0, 1.0)
        following = candidate(eta_next)
        nearer = (following - values)[:many]
        cost, next_cost = off @ metric @ off, nearer @ metric @ nearer
        if next_cost > cost:
            damping *= 10.0
            if damping > 1e12:
                break
            continue
        eta, found, damping = eta_next, following, damping / 3.0
        if cost - next_cost < 1e-12 * cost or smallest_eigenvalue(
                unknowns.inertial(found)) < SMALLEST:
            break
    return found
