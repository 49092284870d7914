# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Forward dynamics: how the platform accelerates under given leg forces.

``X'' = M^-1 (J_inv^T (f - friction) + wrench - C X' - G)``, the wrench less the load of a moving
base, with the functions of the inverse dynamics for the load without acceleration, and with M as
a sum over the legs, ``M = M_p + sum (e_i J_i^T J_i + (m2 + m_r - e_i) j_i j_i^T)`` with
J_i = [1, -skew(a_i)], j_i the leg's row of J_inv and e_i its effective mass across the leg. Where
screws turn with their legs, f, friction and m_r have the rows of J_q (``turning_screws``). M is
positive definite for every hexapod, so Cholesky solves it without a pivot (Golub and Van Loan,
Matrix Computations, 4th ed., 4.2).
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function


def solve(hexapod: Records, motions: Array, forces: Array, wrenches: Array, bases: Array) -> None:
    """
    Write the accelerations of motions under leg forces.

    hexapod (): its structure, see ``hexapod_structure``.
    motions (N, MOTION): rows of motion, SI units, base axes; their accelerations are written.
    forces (N, 6): forces of the actuators [N], + pushes; their friction is subtracted.
    wrenches (N, WRENCH) or (1, WRENCH): force [N] and moment [N m] on the platform at its origin,
        base axes; one row for all.
    bases (N, BASE) or (1, BASE): rows of the base's motion, one row for all; nan adds no load.
    """
    function('forward_dynamics_many')(hexapod, len(motions), motions, forces, len(wrenches),
                                      wrenches, len(bases), bases)
