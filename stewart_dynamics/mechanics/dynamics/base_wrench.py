# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The base wrench: the load of the hexapod on its base, at the base's origin.

By Newton's and Euler's laws for all its parts together: the external wrench less the rate of
their momentum, weight included. Forces between the parts are in neither; so no leg force, no
friction and no inverse of J_inv is needed, and it is right in singular poses too.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function


def base_wrenches(hexapod: Records, motions: Array, wrenches: Array, bases: Array,
                  results: Array) -> None:
    """
    Write the base wrench of each motion.

    hexapod (): its structure, see ``hexapod_structure``; its gravity is not used.
    motions (N, MOTION): rows of motion, SI units, base axes.
    wrenches (N, WRENCH) or (1, WRENCH): external wrenches on the platform at its origin, base
        axes; one row for all.
    bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all. A row of nan gives
        nan.
    results (N, WRENCH): written: force [N] and moment [N m] on the base at its origin, base axes.
    """
    function('base_wrenches_many')(hexapod, len(motions), motions, len(wrenches), wrenches,
                                   len(bases), bases, results)
