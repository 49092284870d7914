# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Forward kinematics: the pose of six leg lengths, and the twist of six leg rates.

Up to forty poses have the same six lengths (Dietmaier, The Stewart-Gough platform of general
geometry can have 40 real postures, Advances in Robot Kinematics, 1998), so a guess selects
one: the last pose, or the one commanded. Newton's method on ``L(X) = L`` with the exact J_inv
starts there and never steps to where det(J) has the other sign: another assembly is on the other
side of a singularity. Where it does not converge, near singularities, the lengths are led from
those of the guess to those given in parts, along a straight line of their squares (homotopy).
Squares are linear in the position; along a line of the lengths themselves the pose more often
meets a singularity. The search, its steps and their bounds: ``newton`` and ``find_pose`` in
core/stewart_dynamics.c.
"""

from __future__ import annotations

from stewart_dynamics.arrays import Array, Integers, Records
from stewart_dynamics.core.binding import CODES, CONSTANTS, function

# The lengths of a pose that is found differ by at most this from those given [m].
RESIDUAL = CONSTANTS['RESIDUAL']

# The outcome of a search.
FOUND, NO_POSE, SINGULAR = (
    CODES[f'STEWART_{name}'] for name in ('OK', 'NO_POSE', 'SINGULAR'))


def poses(hexapod: Records, lengths: Array, motions: Array, codes: Integers, steps: Integers,
          residuals: Array) -> None:
    """
    Find the poses of lengths.

    hexapod (): its structure, see ``hexapod_structure``.
    lengths (N, 6): [m]
    motions (N, MOTION): rows of motion; their first twelve numbers are the guess, and the pose
        where it is found.
    codes, steps, residuals (N,): written: FOUND, NO_POSE or SINGULAR; the steps taken; the largest
        difference in length [m].
    """
    function('forward_kinematics_many')(
        hexapod, len(motions), lengths, motions, codes, steps, residuals)


def twists(hexapod: Records, rates: Array, motions: Array) -> None:
    """Write into motions (N, MOTION) the twists of leg rates (N, 6) [m/s]."""
    function('twists_many')(hexapod, len(motions), rates, motions)


def failure(steps: float, residual: float) -> str:
    """Return why a search has the outcome NO_POSE, by its steps and residual [m]."""
    if residual <= RESIDUAL:
        return 'the pose is beyond a dead centre of a leg'
    return f'did not converge: residual {residual:.3g} m after {steps:.0f} iterations'
