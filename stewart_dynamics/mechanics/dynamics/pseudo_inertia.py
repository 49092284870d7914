# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The ten inertial parameters of a body as its pseudo-inertia, and in numbers that are always a body.

``J = [[S, h], [h^T, m]]`` with h the first moment and ``S = tr(I) / 2 - I``, I about the origin
(Wensing, Kim, Slotine, "Linear matrix inequalities for physically consistent inertial parameter
identification", IEEE RA-L 3(1), 2018, doi:10.1109/LRA.2017.2729659): a distribution of mass with
these parameters exists if J is positive definite, which means m > 0, moments of inertia > 0, and
none of them larger than the sum of the other two.

The log-Cholesky parameters (a, d1, d2, d3, s12, s23, s13, t1, t2, t3) give every such J, and
nothing else: ``J = U U^T``, ``U = e^a [[e^d1, s12, s13, t1], [0, e^d2, s23, t2],
[0, 0, e^d3, t3], [0, 0, 0, 1]]`` (Rucker, Wensing, "Smooth parameterization of rigid-body
inertia", IEEE RA-L 7(2), 2022, doi:10.1109/LRA.2022.3144515, eq. 8). The mass is e^2a.
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import ParameterError

# Where each log-Cholesky parameter stands in U, in their order; the first multiplies all of U.
_ROWS = np.array([0, 1, 2, 0, 1, 0, 0, 1, 2])
_COLUMNS = np.array([0, 1, 2, 1, 2, 2, 3, 3, 3])
_DIAGONAL = 3  # of these nine the first are exponents
_THICKNESS = 1e-3  # of a thickened body: its least second moment of mass, by the largest


def pseudo_inertia(ten: Array) -> Array:
    """
    Return the pseudo-inertia (4, 4) of a body.

    ten (10,): mass [kg], first moment [kg m], ixx ixy ixz iyy iyz izz about the origin [kg m^2].
    """
    mass, hx, hy, hz, xx, xy, xz, yy, yz, zz = ten
    half = 0.5 * (xx + yy + zz)
    return np.array([[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy],
                     [-xz, -yz, half - zz, hz], [hx, hy, hz, mass]])


def inertial_parameters(pseudo: Array) -> Array:
    """Return the ten inertial parameters of a pseudo-inertia, or of a change of one, (4, 4)."""
    s = pseudo[:3, :3]
    inertia = np.trace(s) * np.eye(3) - s
    ten: Array = np.concatenate([pseudo[3:, 3], pseudo[:3, 3], inertia[np.triu_indices(3)]])
    return ten


def is_consistent(ten: Array) -> bool:
    """Return whether a body can have these inertial parameters: J is positive definite."""
    return smallest_eigenvalue(ten) > 0.0


def smallest_eigenvalue(ten: Array) -> float:
    """Return the smallest eigenvalue of the dimensionless pseudo-inertia, by the largest."""
    pseudo = pseudo_inertia(ten)
    mass, moment = abs(pseudo[3, 3]), np.abs(np.diag(pseudo)[:3]).max()
    if not mass > 0.0 or not moment > 0.0:
        return -1.0
    size = 1.0 / np.sqrt([moment, moment, moment, mass])
    values = np.linalg.eigvalsh(size[:, None] * pseudo * size)
    return float(values[0] / np.abs(values).max())


def thickened(ten: Array) -> Array:
    """Return the parameters (10,) of a plate or a rod that is made a little thick."""
    pseudo = pseudo_inertia(ten)
    added = _THICKNESS * float(np.diag(pseudo)[:3].max())
    return inertial_parameters(pseudo + np.diag([added, added, added, 0.0]))


def log_cholesky(ten: Array) -> Array:
    """
    Return the log-Cholesky parameters (10,) of a body's inertial parameters (10,).

    Raises ParameterError: no body can have these inertial parameters.
    """
    pseudo = pseudo_inertia(ten)
    try:
        # U is upper triangular: the Cholesky factor of J read from its end.
        u = np.linalg.cholesky(pseudo[::-1, ::-1])[::-1, ::-1]
    except np.linalg.LinAlgError as exc:
        raise ParameterError(
            f'inertial parameters {ten.tolist()}: no body has these: the pseudo-inertia is not '
            'positive definite') from exc
    whole = u[3, 3]
    entries = u[_ROWS, _COLUMNS] / whole
    entries[:_DIAGONAL] = np.log(entries[:_DIAGONAL])
    return np.concatenate([[math.log(whole)], entries])


def from_log_cholesky(eta: Array) -> Array:
    """Return the inertial parameters (10,) of any log-Cholesky parameters (10,)."""
    u = _factor(eta)
    return inertial_parameters(u @ u.T)


def log_cholesky_derivative(eta: Array) -> Array:
    """Return the derivative (10, 10) of the inertial parameters by log-Cholesky parameters."""
    u = _factor(eta)
    whole = math.exp(eta[0])
    columns = [inertial_parameters(2.0 * u @ u.T)]
    for n, (row, column) in enumerate(zip(_ROWS, _COLUMNS, strict=True)):
        change: Array = np.zeros((4, 4))
        change[row, column] = u[row, column] if n < _DIAGONAL else whole
        half = change @ u.T
        columns.append(inertial_parameters(half + half.T))
    return np.column_stack(columns)


def _factor(eta: Array) -> Array:
    u = np.eye(4)
    u[_ROWS, _COLUMNS] = eta[1:]
    u[range(3), range(3)] = np.exp(eta[1:1 + _DIAGONAL])
    factor: Array = math.exp(eta[0]) * u
    return factor
