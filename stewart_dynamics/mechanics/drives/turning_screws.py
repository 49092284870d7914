# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Screws that turn with their legs: the twist of a leg, and the coordinate of its drive.

Where the piston turns against the cylinder by psi, a right-handed thread of lead p
extends the leg by p / (2 pi) for each radian. A motor turns with its drive's coordinate, the
length that its leg would have without this:

    q = L + pitch psi        pitch = -p / (2 pi), right-handed; + p / (2 pi), left-handed
    q' = J_q [v; w]          row of a leg  [h, a x h + pitch d],  h = s + pitch c

    psi' = c . x' + d . w
    c = ((u . s) / |u x s|^2 s x u - (w_j . s) / |w_j x s|^2 s x w_j) / L
    d = (s - (w_j . s) w_j) / |w_j x s|^2

with x' the velocity of the platform joint, u and w_j the unit vectors of the axes of the universal
joints, fixed to base and platform. The force f of a drive does the work f q', so by virtual work
``J_q^T f = wrench``: beside f along s a leg transmits the moment of its screw. Reflected mass and
friction belong to the drive: m_r q'', and friction at the rate q'. Guided screws have pitch 0:
q is L, and J_q is J_inv.

Each universal joint turns about an axis u that is fixed to the base, or w = R w_P that is
fixed to the platform, and about an axis across the leg and across the first: the latter axes,
along ``u x s`` and ``w x s``, are fixed to the cylinder and to the piston. The angle from one
to the other about s, right-handed, is the turn of the piston against the cylinder:

    twist = atan2(y, x)    y = s . (u x w)    x = u . w - (u . s)(w . s)

y and x are sine and cosine times ``|u x s| |w x s|``; where x is positive, the twist is the
arcsine of the product of the unit vectors along s x (u x s) and w x s. All in base axes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.core.binding import function
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.home_pose import found_home
from stewart_dynamics.mechanics.rows import PITCH, SCREW
from stewart_dynamics.parameters.table import Parameters, RIGHT, six_of, UNIVERSAL


def motor_turns(p: Parameters) -> Array:
    """Return the turns of the motors for a turn of their legs (6,); 0 with guided screws."""
    turns: Array = np.zeros(6)
    if p.drive.screw_rotation == UNIVERSAL:
        turns = p.drive.gear_ratio * (-1.0 if p.drive.screw_hand == RIGHT else 1.0)
    return turns


def screw_constants(p: Parameters) -> Array:
    """Return the constants (6, SCREW) of the screws; zero where they are guided."""
    screws = np.zeros((6, SCREW))
    if p.drive.screw_rotation == UNIVERSAL:
        screws[:, PITCH] = motor_turns(p) * six_of(p.actuator.screw_lead, math.nan) / (
            2.0 * math.pi * p.drive.gear_ratio)
        screws[:, 1:] = universal_axes(p)
    return screws


def universal_axes(p: Parameters) -> Array:
    """Return the unit vectors (6, 6) of the axes fixed to base, base axes, and to platform."""
    hexapod: Any = p.structure.copy()
    for end in ('base', 'platform'):
        given = p[f'drive.{end}_universal_axes']
        hexapod['legs'][f'{end}_universal_axis'] = np.nan if given is None else given
    along = function('put_universal_axes')(found_home(p), hexapod)
    if along:
        end = 'base' if along <= 6 else 'platform'
        raise ParameterError(
            f'{p.source}: drive.{end}_universal_axes: {p.joints[(along - 1) % 6]}: '
            'along the leg at the home pose: must be across it')
    return np.concatenate([hexapod['legs'][f'{end}_universal_axis']
                           for end in ('base', 'platform')], axis=1)
