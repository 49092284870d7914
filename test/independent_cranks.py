# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Hexapods with cranks computed without this package, many samples at once.

Newton's and Euler's laws, body by body: the moments about the end of a crank give the force across
each rod, the platform the forces along them, the rods the forces on the cranks, and these the
torques of the shafts. Only Parameters and Motion, which carry the numbers, are the package's; the
base is at rest. ``test_independent_limits`` compares this with the 13 bodies and 78 unknowns of
``crank_newton_euler``, and with this package.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]


class Cranks(NamedTuple):
    """Legs of a motion (N, 6), nan where a rod does not reach."""

    ends: Array  # of the cranks (N, 6, 3) [m]
    angles: Array  # [rad]
    ratios: Array  # of the levers by the lengths of the cranks, negative on the wrong branch
    speeds: Array  # [rad/s]
    accelerations: Array  # [rad/s^2]
    torques: Array  # at the shafts [N m]
    rod_forces: Array  # along the rods, the larger one of both ends [N]


class CrankBodies(NamedTuple):
    """Cranks and rods of a parameter file."""

    centers: Array  # of the cranks, from their axes in [e n u] (6, 3) [m]
    inertias: Array  # of the cranks, about their centers in [e n u] (6, 3, 3) [kg m^2]
    rod_centers: Array  # from the ends of the cranks (6,) [m]
    rod_inertias: Array  # (6,) [kg m^2]

    @classmethod
    def of(cls, p: Parameters) -> CrankBodies:
        """Return the bodies of a file; a rod is uniform where the file says no more."""
        rod, mass = _six(p['legs.rod.length']), _six(p['legs.rod.mass'])
        center, inertia = p['legs.rod.center_of_mass'], p['legs.rod.inertia']
        return cls(_vectors(p['legs.crank.center_of_mass'], 0, 3),
                   _tensors(_vectors(p['legs.crank.inertia'], 5, 6)),
                   0.5 * rod if center is None else _six(center),
                   mass * rod ** 2 / 12.0 if inertia is None else _six(inertia))


def _six(value: Any) -> Array:
    found: Array = np.broadcast_to(value, 6).astype(float)
    return found


def _vectors(value: Any, alone: int, count: int) -> Array:
    """Return rows (6, count) of one number of each, or of all legs alike."""
    given, found = np.asarray(value, dtype=float), np.zeros((6, count))
    if given.size in (count, 6 * count) and given.shape != (6,):
        found[:] = given.reshape(-1, count)
    else:
        found[:, alone] = given
    return found


def _tensors(numbers: Array) -> Array:
    """Return matrices of xx xy xz yy yz zz."""
    return numbers[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def _dot(a: Array, b: Array) -> Array:
    found: Array = (a * b).sum(-1)
    return found


def middles(p: Parameters) -> Array:
    """Return the middles of the ranges of the angles (6,), 0 without both limits [rad]."""
    low, high = p['limits.angle_min'], p['limits.angle_max']
    return np.zeros(6) if low is None or high is None else 0.5 * (_six(low) + _six(high))


def cranks(p: Parameters, motion: Motion) -> Cranks:
    """Return the legs of a motion (N,)."""
    with np.errstate(all='ignore'):
        return _cranks(p, motion)


def _cranks(p: Parameters, motion: Motion) -> Cranks:
    size, rod = _six(p['legs.crank.length']), _six(p['legs.rod.length'])
    center = p['geometry.base_joints']
    u, z = (np.asarray(p[f'geometry.crank_{name}'], dtype=float).reshape(6, 3)
            for name in ('axes', 'directions'))
    u = u / np.linalg.norm(u, axis=1)[:, None]
    z = z - _dot(z, u)[:, None] * u
    z = z / np.linalg.norm(z, axis=1)[:, None]
    n0 = np.cross(u, z)
    rotation, w, alpha = motion.rotation, motion.angular_velocity, motion.angular_acceleration
    w_legs, alpha_legs = w[:, None], alpha[:, None]
    branches = np.array([-1.0 if each == 'negative' else 1.0 for each in np.broadcast_to(
        p['geometry.crank_branch'], 6)])

    def turned(arm: Array) -> tuple[Array, Array]:
        rate = np.cross(w_legs, arm)
        return rate, np.cross(alpha_legs, arm) + np.cross(w_legs, rate)

    arm = np.einsum('nij,kj->nki', rotation, p['geometry.platform_joints'])
    joint = motion.position[:, None] + arm
    arm_rate, arm_acceleration = turned(arm)
    velocity = motion.linear_velocity[:, None] + arm_rate
    acceleration = motion.linear_acceleration[:, None] + arm_acceleration

    # |B - A(q)| = L2: a cosine of the angle from that to the platform joint.
    line = joint - center
    x, y = _dot(line, z), _dot(line, n0)
    cosine = (_dot(line, line) + size ** 2 - rod ** 2) / (2.0 * size * np.hypot(x, y))
    q = np.arctan2(y, x) - branches * np.arccos(cosine)
    q = q + 2.0 * np.pi * np.round((middles(p) - q) / (2.0 * np.pi))
    e = z * np.cos(q)[..., None] + n0 * np.sin(q)[..., None]
    n = n0 * np.cos(q)[..., None] - z * np.sin(q)[..., None]
    end = center + size[:, None] * e
    d = (joint - end) / rod[:, None]
    ratio = _dot(d, n)

    # Derivatives of the same.
    speed = _dot(d, velocity) / (size * ratio)
    end_velocity = (size * speed)[..., None] * n
    gap = velocity - end_velocity
    drive = (_dot(d, acceleration) + size * speed ** 2 * _dot(d, e) + _dot(gap, gap) / rod) / (
        size * ratio)
    end_acceleration = (size * drive)[..., None] * n - (size * speed ** 2)[..., None] * e
    turn = (acceleration - end_acceleration) / rod[:, None]  # d''

    # The rod: its moments about the end of the crank give the force across it on the platform.
    gravity = np.asarray(p.gravity, dtype=float)
    mass, bodies = _six(p['legs.rod.mass']), CrankBodies.of(p)
    at, inertia = bodies.rod_centers, bodies.rod_inertias
    felt = mass[:, None] * (end_acceleration + at[:, None] * turn - gravity)
    moment = np.cross(at[:, None] * d, felt) + inertia[:, None] * np.cross(d, turn)
    across = -np.cross(moment / rod[:, None], d)

    # The platform.
    com = np.einsum('nij,j->ni', rotation, p['platform.center_of_mass'])
    com_acceleration = (motion.linear_acceleration + np.cross(alpha, com)
                        + np.cross(w, np.cross(w, com)))
    tensor = rotation @ _tensors(np.asarray(p['platform.inertia'], dtype=float)) @ np.swapaxes(
        rotation, -1, -2)
    force = p['platform.mass'] * (com_acceleration - gravity)
    spin = np.einsum('nij,nj->ni', tensor, w)
    couple = (np.einsum('nij,nj->ni', tensor, alpha) + np.cross(w, spin) + np.cross(com, force))
    rows = np.concatenate([d, np.cross(arm, d)], axis=-1)
    needed = np.concatenate([
        force - across.sum(1), couple - np.cross(arm, across).sum(1)], axis=-1)
    bad = ~np.isfinite(rows).all(axis=(1, 2)) | ~np.isfinite(needed).all(axis=1)
    rows[bad] = np.eye(6)
    push = np.linalg.solve(np.swapaxes(rows, -1, -2), needed[..., None])[..., 0]
    push[bad] = np.nan
    on_platform = push[..., None] * d + across
    on_rod = on_platform + felt  # by the crank

    # The crank, about the axis of its motor.
    axes = np.stack([e, n, np.broadcast_to(u, e.shape)], axis=-1)
    arm_c = np.einsum('nkij,kj->nki', axes, bodies.centers)
    omega = speed[..., None] * u
    of_arm = np.cross(drive[..., None] * u, arm_c) + np.cross(omega, np.cross(omega, arm_c))
    crank_mass = _six(p['legs.crank.mass'])
    crank_force = crank_mass[:, None] * (of_arm - gravity)
    shaft = (bodies.inertias[:, 2, 2] * drive + _dot(u, np.cross(arm_c, crank_force))
             + _dot(u, np.cross(size[:, None] * e, on_rod)))
    slow = _six(p['actuator.coulomb_velocity'])
    torque = (shaft + _six(p['actuator.reflected_inertia']) * drive
              + _six(p['actuator.viscous_friction']) * speed
              + _six(p['actuator.coulomb_friction']) * np.clip(speed / slow, -1.0, 1.0))
    ends = np.abs(_dot(d, on_platform)), np.abs(_dot(d, on_rod))
    return Cranks(end, q, ratio * branches, speed, drive, torque, np.maximum(*ends))
