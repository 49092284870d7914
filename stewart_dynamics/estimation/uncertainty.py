# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How well a parameter file knows the parameters in which forces are linear: ``uncertainty.*``."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    FIRST_MOMENT, INERTIA, linear_parameters, MASS, Places)
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import Parameters


def root_of_covariance(p: Parameters, body: Body, others: Array) -> Array:
    """
    Return R (n, n): the n linear parameters are the file's plus R z.

    z are independent and of deviation 1. The platform's ten are its mass, the coordinates of its
    center of mass, and its inertia about that. The numbers of all legs are uncertain together and
    each by itself.

    body: the platform, or platform and payload, whichever is uncertain as the platform is.
    others (n,): deviations of friction and offsets, which ``uncertainty.*`` does not contain;
        of a parameter of the legs it counts where that has the deviation 0.
    """
    deviations = others.copy()
    deviations[MASS] = p.uncertainty.platform_mass * body.mass
    deviations[FIRST_MOMENT] = p.uncertainty.center_of_mass
    deviations[INERTIA] = p.uncertainty.inertia * np.mean(body.inertia[[0, 3, 5]])
    covariance = _of_legs(p)
    known = np.diag(covariance) > 0.0
    covariance += np.diag(np.where(known, 0.0, deviations ** 2))
    sizes = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, sizes, out=np.zeros(len(sizes)), where=sizes > 0.0)
    values, vectors = np.linalg.eigh(scale[:, None] * covariance * scale)
    root: Array = sizes[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return root


def _of_legs(p: Parameters) -> Array:
    """Return the covariance (n, n) of masses and moments of legs and rotors."""
    theta, places = linear_parameters(p), Places.of(p.leg_kind)
    count, reflected = places.whole, places.reflected_mass
    covariance = np.zeros((count, count))
    rotors = (p.uncertainty.reflected_mass * theta[reflected]) ** 2
    covariance[reflected, reflected] = np.diag(rotors)
    relative = p.uncertainty.leg_mass
    masses = np.arange(count)[places.masses].reshape(-1, 6)
    for change in p.leg_kind.relative_changes(p):
        of_all, of_each = np.zeros((count, 1)), np.zeros((count, 6))
        for at, of_legs in zip(masses, change, strict=True):
            of_all[at, 0] = of_each[at, np.arange(6)] = relative * of_legs
        covariance += of_all @ of_all.T + of_each @ of_each.T
    return covariance
