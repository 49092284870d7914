# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The regressor Y of the leg forces, f = Y theta, of many samples.

theta are the parameters in which leg forces are linear, see ``linear_parameters``. As in
``base_wrench``, velocities and accelerations are those in axes that do not turn, accelerations
less gravity: ``A = a_B - g + W' x r + W x (W x r) + 2 W x r' + r''`` at a point r. So a moving
base needs nothing more. Row n of (J_inv^T)^-1, or of (J_q^T)^-1 where screws turn with their legs
(``turning_screws``), in halves u (for forces) and h (for moments),
gives the force of leg n:

- platform, in platform axes, with its origin's A and its absolute w and w': the mass gives u . A,
  the first moment c ``K^T u + A x h`` with K = skew(w') + skew(w)^2, the inertia about its origin
  ``h . I w' + (h x w) . I w``.
- leg i, with s its direction, A of its base joint, and P = 1 - s s^T: the force at its platform
  joint is ``P (m S A + J s'' + 2 m c L' s') / L + m (s . A + L'' - c |s'|^2) s``; m S and J sum
  over both parts, m c and the term along the leg are the piston's, c = L - S. A force F there
  takes ``(u + h x a) . F``.
"""

from __future__ import annotations

from typing import NamedTuple

from stewart_dynamics.arrays import Array, Records
from stewart_dynamics.core.binding import function


class Regressor(NamedTuple):
    """
    How leg forces depend on the parameters in which they are linear.

    Attributes
    ----------
    matrix : (..., 6, n)
        Force of each leg [N] for one unit of each parameter.
    names : tuple of str
        Names of the n parameters; ``mechanics.dynamics.linear_parameters`` gives their values.

    """

    matrix: Array
    names: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the shape, not the array."""
        return f'<Regressor of shape {self.matrix.shape}: {", ".join(self.names)}>'


def regressors(hexapod: Records, motions: Array, bases: Array, results: Array) -> None:
    """
    Write the regressor of each motion.

    hexapod (): its structure; its masses and friction forces are not used.
    motions (N, MOTION): rows of motion, SI units, base axes.
    bases (N, BASE) or (1, BASE): rows of the base's motion; one row for all. A row of nan: base at
        rest, with the parameter's gravity.
    results (N, 6, LINEAR): written [N per unit of each parameter].
    """
    function('regressors_many')(hexapod, len(motions), motions, len(bases), bases, results)
