# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Stiffness of the platform on its legs, and its natural modes.

Legs of stiffness k_i hold a small displacement ``dX = [dx; dtheta]`` (base axes) with the wrench
``K dX``, ``K = J_inv^T diag(k) J_inv`` (Merlet, Parallel Robots, 2nd ed., 2006, 9.2). Where screws
turn with their legs, the springs are those of the drives at held motors: J_q in place of J_inv
(``turning_screws``). Forces f of the legs turn with them, by
``ds = (1 - s s^T) / L (dx + dtheta x a)``, and so do the arms a, by ``dtheta x a``:
``geometric_stiffness`` is minus the derivative of their wrench. Stiffnesses of drives that
turn, [N m/rad], are those at J_q likewise. Undamped small vibrations obey
``M dX'' + K dX = 0``: modes are the solutions of ``K phi = omega^2 M phi``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import MotionError
from stewart_dynamics.legs.lines import Lines
from stewart_dynamics.mechanics.arguments import as_array
from stewart_dynamics.mechanics.dynamics.lagrange import drive_jacobian_rate
from stewart_dynamics.parameters.table import DRIVE_INERTIAS, Parameters


def held_motors(parameters: Parameters) -> dict[str, Any]:
    """Return changes of parameters with which vibrations do not turn rotors and screws."""
    return {parameters.leg_kind.fields['reflected_mass']: 0.0, **dict.fromkeys(DRIVE_INERTIAS)}


class NaturalModes(NamedTuple):
    """
    Natural modes of the platform on its legs, from the slowest to the fastest.

    Attributes
    ----------
    frequencies : (..., 6)
        [Hz]
    shapes : (..., 6, 6)
        Column n is mode n: displacement and small rotation [dx; dtheta] of the platform's
        origin, base axes [m, rad], normalized to ``shapes^T M shapes = 1``.

    """

    frequencies: Array
    shapes: Array

    def __repr__(self) -> str:
        """Return the frequencies of one pose, else the shape."""
        if self.frequencies.ndim > 1:
            return f'<NaturalModes of shape {self.frequencies.shape[:-1]}>'
        listed = ', '.join(f'{each:.4g}' for each in self.frequencies)
        return f'<NaturalModes: {listed} Hz>'


def leg_stiffnesses(value: ArrayLike, unit: str = 'N/m') -> Array:
    """Return stiffnesses (..., 6); MotionError where one is not positive."""
    is_number = np.isscalar(value) or getattr(value, 'shape', None) == ()
    legs = as_array('leg_stiffness', value, () if is_number else (6,))
    legs = np.full(6, legs) if is_number else legs
    if not (legs > 0.0).all():
        raise MotionError(f'leg_stiffness: {legs.min():g} {unit}: must be more than 0')
    return legs


def platform_stiffness(drive_jacobian: Array, leg_stiffness: Array) -> Array:
    """Return K (..., 6, 6) [N/m, N, N m/rad] of J_q (..., 6, 6) and legs (..., 6) [N/m]."""
    stiffness: Array = np.swapaxes(drive_jacobian, -1, -2) @ (
        leg_stiffness[..., None] * drive_jacobian)
    return stiffness


def geometric_stiffness(legs: Lines, forces: Array, rotation: Array, screws: Array) -> Array:
    """
    Return the part (..., 6, 6) of K that is due to the forces of the legs.

    It is symmetric if the moment of all forces (..., 6) [N] about the platform's origin is zero.
    screws (6, SCREW): constants of the screws, see ``turning_screws``.
    """
    slopes = np.stack([drive_jacobian_rate(legs, rotation, each[:3], each[3:], screws)
                       for each in np.eye(6)], axis=-1)
    stiffness: Array = -np.einsum('...n,...nij->...ij', forces, slopes)
    return stiffness


def natural_modes(mass: Array, drive_jacobian: Array, leg_stiffness: Array) -> NaturalModes:
    """
    Return the modes of M (..., 6, 6), J_q (..., 6, 6) and stiffnesses of the legs (..., 6).

    With ``M = L L^T``, ``omega^2`` are the eigenvalues of ``L^-1 K L^-T = A A^T``, where
    ``A = L^-1 J_q^T diag(sqrt(k))``: its singular values are omega, never negative, and keep
    their digits near a singularity (Golub and Van Loan, Matrix Computations, 4th ed., 8.7).

    Raises
    ------
    MotionError
        M is not positive definite.

    """
    try:
        factor = np.linalg.cholesky(mass)
        a = np.linalg.solve(factor, np.swapaxes(drive_jacobian, -1, -2)
                            * np.sqrt(leg_stiffness)[..., None, :])
        left, omega, _ = np.linalg.svd(a)
        shapes = np.linalg.solve(np.swapaxes(factor, -1, -2), left)
    except np.linalg.LinAlgError as exc:
        raise MotionError('natural modes: the mass matrix is not positive definite') from exc
    return NaturalModes(omega[..., ::-1] / (2.0 * np.pi), shapes[..., ::-1])


def modes_of(mass: Array, stiffness: Array) -> NaturalModes:
    """
    Return the modes of M and a symmetric K (..., 6, 6).

    The frequency is 0 where K is not positive: the platform does not come back.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(inverse @ stiffness @ np.swapaxes(inverse, -1, -2))
    return NaturalModes(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi),
                        np.swapaxes(inverse, -1, -2) @ vectors)
