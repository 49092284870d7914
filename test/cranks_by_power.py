# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Torques of a hexapod with cranks in many samples of a motion, computed without this package.

Virtual power: a rod is two points with its mass, center of mass and inertia, its angle follows
from the law of cosines. ``crank_newton_euler``, which takes milliseconds a sample, has no more in
common with it than the bodies; ``test_estimate_cases`` compares both.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]


class Legs(NamedTuple):
    """Angles [rad], speeds [rad/s] and torques [N m] of the cranks at some times, (N, 6) each."""

    lengths: Array
    rates: Array
    forces: Array


class CrankBodies(NamedTuple):
    """Cranks and rods of a parameter file."""

    centers: Array  # of the cranks, from their axes in [e n u] (6, 3) [m]
    inertias: Array  # about their centers, parallel to the axes (6,) [kg m^2]
    rod_centers: Array  # from the ends of the cranks (6,) [m]
    rod_inertias: Array  # (6,) [kg m^2]

    @classmethod
    def of(cls, p: Parameters) -> CrankBodies:
        """Return those of a file; a rod is uniform where it says no more."""
        given, centers = p['legs.crank.center_of_mass'], np.zeros((6, 3))
        if given.ndim == 2:
            centers[:] = given
        else:
            centers[:, 0] = given
        inertia = p['legs.crank.inertia']
        size, mass = p['legs.rod.length'], p['legs.rod.mass']
        middle, turning = p['legs.rod.center_of_mass'], p['legs.rod.inertia']
        return cls(centers, np.broadcast_to(inertia[..., -1], 6),
                   0.5 * size if middle is None else middle,
                   mass * size ** 2 / 12.0 if turning is None else turning)


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.sum(a * b, axis=-1)
    return product


def _turned(w: Array, arms: Array) -> Array:
    """Return w x a of arms (N, 6, 3)."""
    return np.cross(w[:, None], arms)


def _axes(p: Parameters) -> tuple[Array, Array]:
    """Return the axes of the motors and the cranks at the angle 0, unit vectors (6, 3) each."""
    headings = p['geometry.crank_angles']
    if headings is None:
        axes, zeros = p['geometry.crank_axes'], p['geometry.crank_directions']
    else:
        zeros = np.stack([np.cos(headings), np.sin(headings), 0.0 * headings], axis=-1)
        axes = np.cross(zeros, [0.0, 0.0, 1.0])
    found = [each / np.linalg.norm(each, axis=-1, keepdims=True) for each in (axes, zeros)]
    return found[0], found[1]


def moving(p: Parameters, motion: Motion) -> Legs:
    """Return the cranks of a hexapod in a motion (N,); their branches are the package's."""
    structure: Any = p.structure['legs']
    u, z = _axes(p)
    across, size, rod = np.cross(u, z), p['legs.crank.length'], p['legs.rod.length']
    rows = motion.rows
    v, w, acc, alpha = (rows[:, n:n + 3] for n in (12, 15, 18, 21))
    arms = np.einsum('njk,ik->nij', motion.rotation, p['geometry.platform_joints'])
    end = motion.position[:, None] + arms
    end_rate = v[:, None] + _turned(w, arms)
    end_acc = acc[:, None] + _turned(alpha, arms) + _turned(w, _turned(w, arms))

    gap = end - p['geometry.base_joints']
    height, ahead = _dot(gap, u), np.stack([_dot(gap, z), _dot(gap, across)], axis=-1)
    distance = np.linalg.norm(ahead, axis=-1)
    cosine = (size ** 2 + distance ** 2 - (rod ** 2 - height ** 2)) / (2.0 * size * distance)
    angle = np.arctan2(ahead[..., 1], ahead[..., 0]) - structure['branch'] * np.arccos(cosine)
    angle -= 2.0 * np.pi * np.round(angle / (2.0 * np.pi))

    e = z * np.cos(angle)[..., None] + across * np.sin(angle)[..., None]
    n = np.cross(u, e)
    d = (gap - size[:, None] * e) / rod[:, None]
    lever = size * _dot(d, n)
    speed = _dot(d, end_rate) / lever
    tip_rate = (size * speed)[..., None] * n
    turn = (size * speed ** 2)[..., None] * e
    acceleration = (_dot(d, end_acc + turn)
                    + _dot(end_rate - tip_rate, end_rate - tip_rate) / rod) / lever
    tip_acc = (size * acceleration)[..., None] * n - turn

    # Velocities for a unit of each coordinate of the twist (N, 6, 6, 3), and speeds (N, 6, 6).
    unit = np.eye(6)
    of_end = unit[:, :3] + np.cross(unit[:, 3:], arms[:, :, None])
    of_speed = _dot(of_end, d[:, :, None]) / lever[..., None]
    of_tip = of_speed[..., None] * (size[:, None] * n)[:, :, None]

    gravity, bodies = p['gravity'], CrankBodies.of(p)
    center = np.einsum('njk,k->nj', motion.rotation, p['platform.center_of_mass'])
    xx, xy, xz, yy, yz, zz = p['platform.inertia']
    inertia = np.einsum('nij,jk,nlk->nil', motion.rotation, np.array(
        [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), motion.rotation)
    force = p['platform.mass'] * (
        acc + np.cross(alpha, center) + np.cross(w, np.cross(w, center)) - gravity)
    moment = (np.cross(center, force) + np.einsum('nij,nj->ni', inertia, alpha)
              + np.cross(w, np.einsum('nij,nj->ni', inertia, w)))
    power = np.concatenate([force, moment], axis=-1)

    mass, (x, y, _) = p['legs.crank.mass'], bodies.centers.T
    of_center = x[:, None] * n - y[:, None] * e  # velocity of the center by the speed
    center_acc = acceleration[..., None] * of_center - (speed ** 2)[..., None] * (
        x[:, None] * e + y[:, None] * n)
    torque = bodies.inertias * acceleration + mass * _dot(of_center, center_acc - gravity)
    power = power + np.einsum('ni,nij->nj', torque, of_speed)
    rods = p['legs.rod.mass']
    radius = np.sqrt(np.divide(
        bodies.rod_inertias, rods, out=np.zeros(6), where=rods > 0.0))
    for place in (bodies.rod_centers - radius, bodies.rod_centers + radius):
        part = (place / rod)[:, None]
        felt = (1.0 - part) * tip_acc + part * end_acc - gravity
        velocity = (1.0 - part[:, None]) * of_tip + part[:, None] * of_end
        power = power + np.einsum('i,nik,nijk->nj', 0.5 * rods, felt, velocity)

    torques = np.linalg.solve(np.swapaxes(of_speed, 1, 2), power[..., None])[..., 0]
    torques = (torques + p['actuator.reflected_inertia'] * acceleration
               + p['actuator.viscous_friction'] * speed + p['actuator.coulomb_friction']
               * np.clip(speed / p['actuator.coulomb_velocity'], -1.0, 1.0))
    return Legs(angle, speed, torques)
