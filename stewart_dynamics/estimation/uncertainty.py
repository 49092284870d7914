# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How well a parameter file knows the parameters in which forces are linear: ``uncertainty.*``."""

from __future__ import annotations

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    CYLINDER_FIRST, CYLINDER_SECOND, FIRST_MOMENT, INERTIA, LINEAR, linear_parameters, MASS,
    PISTON_FIRST, PISTON_MASS, PISTON_SECOND, REFLECTED_MASS)
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import Parameters

_PARTS = {'cylinder': (None, CYLINDER_FIRST, CYLINDER_SECOND),
          'piston': (PISTON_MASS, PISTON_FIRST, PISTON_SECOND)}


def root_of_covariance(p: Parameters, body: Body, others: Array) -> Array:
    """
    Return R (LINEAR, LINEAR): the linear parameters are the file's plus R z.

    z are independent and of deviation 1. The platform's ten are its mass, the coordinates of its
    center of mass, and its inertia about that. The numbers of all legs are uncertain together and
    each by itself.

    body: the platform, or platform and payload, whichever is uncertain as the platform is.
    others (LINEAR,): deviations of friction and offsets, which ``uncertainty.*`` does not contain;
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
    scale = np.divide(1.0, sizes, out=np.zeros(LINEAR), where=sizes > 0.0)
    values, vectors = np.linalg.eigh(scale[:, None] * covariance * scale)
    root: Array = sizes[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return root


def _of_legs(p: Parameters) -> Array:
    """Return the covariance (LINEAR, LINEAR) of masses and moments of legs and rotors."""
    theta, covariance = linear_parameters(p), np.zeros((LINEAR, LINEAR))
    rotors = (p.uncertainty.reflected_mass * theta[REFLECTED_MASS]) ** 2
    covariance[REFLECTED_MASS, REFLECTED_MASS] = np.diag(rotors)
    legs, relative = np.arange(6), p.uncertainty.leg_mass
    for name, (of_mass, first, second) in _PARTS.items():
        part, none = p.legs.parts[name], np.zeros(6)
        turning = theta[second] - part.inertia  # m S^2
        # by a relative change of mass, center of mass and inertia
        changes = [(first, (theta[first], theta[first], none)),
                   (second, (turning, 2.0 * turning, part.inertia)),
                   *([] if of_mass is None else [(of_mass, (part.mass, none, none))])]
        for n in range(3):
            of_all, of_each = np.zeros((LINEAR, 1)), np.zeros((LINEAR, 6))
            for where, of in changes:
                at = np.arange(LINEAR)[where]
                of_all[at, 0] = of_each[at, legs] = relative * of[n]
            covariance += of_all @ of_all.T + of_each @ of_each.T
    return covariance
