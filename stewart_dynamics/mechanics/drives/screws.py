# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Screws that turn with their legs: the twist of a leg, and the coordinate of its drive.

Where the piston turns against the cylinder by psi (``leg_twist``), a right-handed thread of lead p
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
"""

from __future__ import annotations

import math

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.compilation.functions import inlined
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.kinematics.leg_joints import home_directions, mounts
from stewart_dynamics.mechanics.rows import PITCH, SCREW
from stewart_dynamics.mechanics.vectors import add, cross, dot, scale, subtract, Vector3, Vector6
from stewart_dynamics.parameters.table import Parameters, RIGHT, UNIVERSAL

# Sine of the angle between a leg and the fixed axis of its universal joint.
_ALONG_A_LEG = 0.1


@inlined
def leg_twist(u: Vector3, w: Vector3, w_rate: Vector3, w_acc: Vector3, s: Vector3,
              s_rate: Vector3, s_acc: Vector3) -> tuple[float, float, float]:
    """
    Return the twist of a leg between its universal joints [rad], its rate and its acceleration.

    Each universal joint turns about an axis u that is fixed to the base, or w = R w_P that is
    fixed to the platform, and about an axis across the leg and across the first: the latter axes,
    along ``u x s`` and ``w x s``, are fixed to the cylinder and to the piston. The angle from one
    to the other about s, right-handed, is the turn of the piston against the cylinder:

        twist = atan2(y, x)    y = s . (u x w)    x = u . w - (u . s)(w . s)

    y and x are sine and cosine times ``|u x s| |w x s|``; where x is positive, the twist is the
    arcsine of the product of the unit vectors along s x (u x s) and w x s. All in base axes.
    """
    u_s, u_s_rate, u_s_acc = dot(u, s), dot(u, s_rate), dot(u, s_acc)
    w_s, w_s_rate = dot(w, s), dot(w_rate, s) + dot(w, s_rate)
    w_s_acc = dot(w_acc, s) + 2.0 * dot(w_rate, s_rate) + dot(w, s_acc)
    normal, normal_rate, normal_acc = cross(u, w), cross(u, w_rate), cross(u, w_acc)
    y = dot(s, normal)
    y_rate = dot(s_rate, normal) + dot(s, normal_rate)
    y_acc = dot(s_acc, normal) + 2.0 * dot(s_rate, normal_rate) + dot(s, normal_acc)
    x = dot(u, w) - u_s * w_s
    x_rate = dot(u, w_rate) - u_s_rate * w_s - u_s * w_s_rate
    x_acc = dot(u, w_acc) - u_s_acc * w_s - 2.0 * u_s_rate * w_s_rate - u_s * w_s_acc
    square = x * x + y * y
    inverse = 1.0 / square if square > 0.0 else math.nan
    rate = (x * y_rate - y * x_rate) * inverse
    return math.atan2(y, x), rate, (
        x * y_acc - y * x_acc - 2.0 * (x * x_rate + y * y_rate) * rate) * inverse


@inlined
def turned(w: Vector3, omega: Vector3, alpha: Vector3) -> tuple[Vector3, Vector3]:
    """Return first and second derivative of a vector that turns with the platform."""
    rate = cross(omega, w)
    return rate, add(cross(alpha, w), cross(omega, rate))


@inlined
def turning_row(pitch: float, u: Vector3, w: Vector3, a: Vector3, inverse_length: float,
                s: Vector3) -> Vector6:
    """Return the row of J_q of a leg with a = R p, 1 / L and direction s; nan along an axis."""
    u_s, w_s = dot(u, s), dot(w, s)
    of_u, of_w = 1.0 - u_s * u_s, 1.0 - w_s * w_s
    of_u = pitch / of_u if of_u > 0.0 else math.nan
    of_w = pitch / of_w if of_w > 0.0 else math.nan
    h = add(s, scale(inverse_length, subtract(
        scale(u_s * of_u, cross(s, u)), scale(w_s * of_w, cross(s, w)))))
    moment = add(cross(a, h), scale(of_w, subtract(s, scale(w_s, w))))
    return h[0], h[1], h[2], moment[0], moment[1], moment[2]


def motor_turns(p: Parameters) -> Array:
    """Return the turns of the motors for a turn of their legs (6,); 0 with guided screws."""
    turns: Array = np.zeros(6)
    if p['drive.screw_rotation'] == UNIVERSAL:
        turns = p['drive.gear_ratio'] * (-1.0 if p['drive.screw_hand'] == RIGHT else 1.0)
    return turns


def screw_constants(p: Parameters) -> Array:
    """Return the constants (6, SCREW) of the screws; zero where they are guided."""
    screws = np.zeros((6, SCREW))
    if p['drive.screw_rotation'] == UNIVERSAL:
        screws[:, PITCH] = motor_turns(p) * p['actuator.screw_lead'] / (
            2.0 * math.pi * p['drive.gear_ratio'])
        screws[:, 1:] = universal_axes(p)
    return screws


def universal_axes(p: Parameters) -> Array:
    """Return the unit vectors (6, 6) of the axes fixed to base, base axes, and to platform."""
    rotation = homes(p)[1][0]
    base = p['drive.base_universal_axes']
    base = mounts(p)[:, :, 0] if base is None else base
    platform = p['drive.platform_universal_axes']
    platform = base @ rotation if platform is None else platform
    base, platform = (axes / np.linalg.norm(axes, axis=1, keepdims=True)
                      for axes in (base, platform))
    s, w = home_directions(p).base, platform @ rotation.T
    for end, axes in (('base', base), ('platform', w)):
        sine = np.linalg.norm(np.cross(axes, s), axis=1)
        if np.any(sine < _ALONG_A_LEG):
            raise ParameterError(
                f'{p.source}: drive.{end}_universal_axes: {p["joints"][int(np.argmin(sine))]}: '
                'along the leg at the home pose: must be across it')
    # The axis of a joint has no sense: of its two directions the one with the smaller twist.
    cosine = np.sum(base * w, axis=1) - np.sum(base * s, axis=1) * np.sum(w * s, axis=1)
    return np.column_stack([base, np.where(cosine < 0.0, -1.0, 1.0)[:, None] * platform])
