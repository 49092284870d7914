# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
The limits of a hexapod checked without this package: which samples of a motion exceed which.

Lengths, angles, clearances, condition numbers and motors are computed here with numpy; forces are
those of ``independent_hexapod``, cranks are those of ``independent_cranks``. Only Parameters and
Motion, which carry the numbers, are the package's. Screws are guided, and a base is at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

from independent_cranks import Cranks, cranks
from independent_hexapod import moving
import numpy as np
from numpy.typing import NDArray

from stewart_dynamics import Motion, Parameters

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TOLERANCE = 1e-9  # above rounding errors


class _Legs(NamedTuple):
    """Legs of a motion: from base joint to platform joint, arms of the latter, (N, 6, 3) [m]."""

    begins: Array
    ends: Array
    arms: Array

    @property
    def lengths(self) -> Array:
        found: Array = np.linalg.norm(self._along, axis=-1)
        return found

    @property
    def directions(self) -> Array:
        found: Array = self._along / self.lengths[..., None]
        return found

    @property
    def _along(self) -> Array:
        return self.ends - self.begins


class _Drives(NamedTuple):
    """Rates and efforts of the drives (N, 6), inertia of each, turns of its motor by its own."""

    rates: Array
    accelerations: Array
    efforts: Array
    inertia: Array
    ratio: Array


def _of_cranks(p: Parameters, motion: Motion) -> Cranks | None:
    return None if p['legs.crank.length'] is None else cranks(p, motion)


def _legs(p: Parameters, motion: Motion, of_cranks: Cranks | None = None) -> _Legs:
    """Return the lines of force, of telescopic legs from their base joints, else the rods."""
    arms = np.einsum('nij,kj->nki', motion.rotation, p['geometry.platform_joints'])
    found = of_cranks or _of_cranks(p, motion)
    begins = (np.broadcast_to(p['geometry.base_joints'], arms.shape) if found is None
              else found.ends)
    return _Legs(begins, motion.position[:, None] + arms, arms)


def segment_distance(a: Array, a_end: Array, b: Array, b_end: Array) -> Array:
    """
    Return the distances (...) of segments (..., 3).

    The square is a convex quadratic of the places on both; its minimum is inside, on one of four
    edges, or at one of four corners: the smallest of all nine.
    """
    u, v, w = a_end - a, b_end - b, a - b
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    with np.errstate(all='ignore'):
        square = uu * vv - uv ** 2
        inner = (uv * vw - vv * uw) / square, (uu * vw - uv * uw) / square
        places = [inner, (0.0 * uu, vw / vv), (0.0 * uu + 1.0, (vw + uv) / vv),
                  (-uw / uu, 0.0 * uu), ((uv - uw) / uu, 0.0 * uu + 1.0)]
        places += [(0.0 * uu + s, 0.0 * uu + t) for s in (0.0, 1.0) for t in (0.0, 1.0)]
        found: Array = np.full(uu.shape, np.inf)
        for s, t in places:
            inside = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
            gap = w + s[..., None] * u - t[..., None] * v
            found = np.where(inside, np.minimum(found, np.sqrt((gap * gap).sum(-1))), found)
    return found


def plate_distance(plate: Array, a: Array, a_end: Array) -> Array:
    """Return the distances (...) of segments (..., 3) from a convex plate (M, 3)."""
    found: Array = np.full(a.shape[:-1], np.inf)
    for k in range(len(plate)):
        edge = np.broadcast_to(plate[k], a.shape), np.broadcast_to(plate[k - 1], a.shape)
        found = np.minimum(found, segment_distance(a, a_end, *edge))
    center = plate.mean(axis=0)
    # The normal that fits all corners best, and coordinates in the plate.
    x, y, z = np.linalg.svd(plate - center)[2]
    corners = (plate - center) @ np.array([x, y]).T
    sides = np.roll(corners, -1, axis=0) - corners
    after = np.roll(sides, -1, axis=0)
    turn = np.sign((sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]).sum())

    def above(points: Array) -> Flags:
        flat = np.stack([(points - center) @ x, (points - center) @ y], axis=-1)
        inside = np.ones(flat.shape[:-1], dtype=bool)
        for corner, side in zip(corners, sides, strict=True):
            inside &= turn * (side[0] * (flat[..., 1] - corner[1])
                              - side[1] * (flat[..., 0] - corner[0])) >= 0.0
        return inside

    begin, end = (a - center) @ z, (a_end - center) @ z
    for heights, points in ((begin, a), (end, a_end)):
        found = np.where(above(points), np.minimum(found, np.abs(heights)), found)
    with np.errstate(all='ignore'):
        part = np.where(begin == end, 0.0, begin / (begin - end))
    through = a + part[..., None] * (a_end - a)
    return np.where((begin * end <= 0.0) & above(through), 0.0, found)


def clearances(p: Parameters, motion: Motion) -> Array:
    """Return the smallest distance (N,) of a leg from another one or from a plate [m]."""
    legs = _legs(p, motion)
    radius, length, thin = (
        np.broadcast_to(p[f'legs.{name}'], 6) for name in (
            'cylinder.radius', 'cylinder.length', 'piston.radius'))
    ends = {True: legs.begins + legs.directions * np.minimum(length, legs.lengths)[..., None],
            False: legs.ends}
    radii = {True: radius, False: thin}
    found: Array = np.full(len(motion), np.inf)
    for i, j in combinations(range(6), 2):
        for thick in ends:
            for other in ends:
                distance = segment_distance(
                    legs.begins[:, i], ends[thick][:, i], legs.begins[:, j], ends[other][:, j])
                found = np.minimum(found, distance - radii[thick][i] - radii[other][j])
    base, moving_plate = p['geometry.base_outline'], p['geometry.platform_outline']
    for i in range(6):
        if base is not None:
            begin = legs.begins[:, i] + legs.directions[:, i] * length[i]
            found = np.minimum(found, plate_distance(base, begin, legs.ends[:, i]) - thin[i])
        if moving_plate is not None:
            a, a_end = (np.einsum('nji,nj->ni', motion.rotation, each - motion.position)
                        for each in (legs.begins[:, i], ends[True][:, i]))
            found = np.minimum(found, plate_distance(moving_plate, a, a_end) - radius[i])
    return found


def joint_angles(p: Parameters, motion: Motion, axes: Array, of_cranks: Cranks | None = None,
                 ) -> tuple[Array, Array]:
    """Return angles (N, 6) of the joints of base and platform by axes (2, 6, 3) [rad]."""
    legs = _legs(p, motion, of_cranks).directions
    turned = np.einsum('nij,kj->nki', motion.rotation, axes[1])
    return (np.arccos(np.clip((legs * axes[0]).sum(-1), -1.0, 1.0)),
            np.arccos(np.clip((legs * turned).sum(-1), -1.0, 1.0)))


def conditions(p: Parameters, motion: Motion, of_cranks: Cranks | None = None,
               ) -> tuple[Array, Array]:
    """Return condition numbers (N,) and determinants (N,) of J_inv; nan where a rod is short."""
    legs = _legs(p, motion, of_cranks)
    moments = np.cross(legs.arms, legs.directions) / p['singularity.characteristic_length']
    rows = np.concatenate([legs.directions, moments], axis=-1)
    known = np.isfinite(rows).all(axis=(1, 2))
    values = np.linalg.svd(np.where(known[:, None, None], rows, 0.0), compute_uv=False)
    with np.errstate(divide='ignore', invalid='ignore'):
        return values[:, 0] / values[:, -1], np.linalg.det(rows)


def exceedances(p: Parameters, motion: Motion, axes: Array) -> dict[str, Flags]:
    """
    Return which samples (N,) of a motion exceed which limit, by its name.

    axes (2, 6, 3): those of the joints at base and platform.
    """
    found: dict[str, Flags] = {'finite': np.any(~np.isfinite(motion.rows), axis=1)}
    if found['finite'].any():
        return found

    def most(name: str, values: Array, bound: float | Array | None = None) -> None:
        bounds = p[name] if bound is None else bound
        if bounds is not None:
            within: Flags = np.abs(values) <= np.asarray(bounds) * (1.0 + TOLERANCE)
            found[name] = np.any(~within.reshape(len(motion), -1), axis=1)

    def least(name: str, values: Array) -> None:
        if p[name] is not None:
            short: Flags = ~(values >= p[name] - TOLERANCE * np.abs(p[name]))
            found[name] = np.any(short, axis=1)

    of_cranks = _of_cranks(p, motion)
    if of_cranks is None:
        drives = _check_telescopic(p, motion, most, least)
    else:
        # a limit of angles has a sign, and levers of the wrong branch are negative
        ends = p['limits.angle_max']
        if ends is not None:
            found['limits.angle_max'] = np.any(
                ~(of_cranks.angles <= ends + TOLERANCE * np.abs(ends)), axis=1)
        least('limits.angle_min', of_cranks.angles)
        least('limits.lever_min', of_cranks.ratios)
        most('limits.speed_max', of_cranks.speeds)
        most('limits.torque_max', of_cranks.torques)
        most('limits.rod_force_max', of_cranks.rod_forces)
        drives = _Drives(of_cranks.speeds, of_cranks.accelerations, of_cranks.torques,
                         np.broadcast_to(p['actuator.reflected_inertia'], 6),
                         np.broadcast_to(p['drive.gear_ratio'], 6))
    if p['limits.base_joint_angle_max'] is not None or (
            p['limits.platform_joint_angle_max'] is not None):
        base, platform = joint_angles(p, motion, axes, of_cranks)
        most('limits.base_joint_angle_max', base)
        most('limits.platform_joint_angle_max', platform)
    if p['limits.leg_clearance_min'] is not None:
        least = p['limits.leg_clearance_min']
        found['limits.leg_clearance_min'] = clearances(p, motion) < least - TOLERANCE * abs(least)
    condition, determinant = conditions(p, motion, of_cranks)
    found['singularity'] = ~(condition < p['singularity.stop_condition']) | ~(
        determinant * determinant[0] > 0.0)
    if drives is not None:
        rates, accelerations, efforts, mass, ratio = drives
        near = np.broadcast_to(p['actuator.coulomb_velocity'], 6)
        speeds = ratio * rates
        most('drive.speed_max', speeds)
        efficiency = np.broadcast_to(p['drive.efficiency'], 6)
        back = p['drive.back_driving_efficiency']
        back = 2.0 - 1.0 / efficiency if back is None else back
        through = (efforts - mass * accelerations) / ratio
        inertial = mass / ratio * accelerations
        # losses are linear in the rate near standstill, as friction is
        share = np.clip(np.abs(rates) / near, 0.0, 1.0)
        factor = 1.0 + share * (np.where(through * rates > 0.0, 1.0 / efficiency, back) - 1.0)
        torques = inertial + through * factor
        # A leg that nearly stands still must be able to move off either way.
        off = np.where(np.abs(inertial + through / efficiency) > np.abs(inertial + through * back),
                       inertial + through / efficiency, inertial + through * back)
        torques = np.where(np.abs(rates) < near, off, torques)
        curve = p['drive.torque_speed']
        available = np.full(torques.shape, np.inf)
        if curve is not None:
            available = np.interp(np.abs(speeds), *curve.T)
            available[np.abs(speeds) > curve[-1, 0] * (1.0 + TOLERANCE)] = 0.0
        most('drive.torque_speed', torques, available)
        most('drive.torque_max', torques)
    return found


def _check_telescopic(p: Parameters, motion: Motion, most: Callable[[str, Array], None],
                      least: Callable[[str, Array], None]) -> _Drives | None:
    """Check the limits of lengths, rates and forces; return the drives, None without screws."""
    legs = moving(p, motion)
    geometry = _legs(p, motion)
    rates = np.einsum('nki,nki->nk', geometry.directions, motion.linear_velocity[:, None]
                      + np.cross(motion.angular_velocity[:, None], geometry.arms))
    most('limits.length_max', geometry.lengths)
    most('limits.velocity_max', rates)
    least('limits.length_min', geometry.lengths)
    most('limits.force_max', legs.forces)
    mass, viscous, coulomb, near = (np.broadcast_to(p[f'actuator.{name}'], 6) for name in (
        'reflected_mass', 'viscous_friction', 'coulomb_friction', 'coulomb_velocity'))
    turning = np.cross(motion.angular_velocity[:, None], geometry.arms)
    joint_acceleration = (
        motion.linear_acceleration[:, None]
        + np.cross(motion.angular_acceleration[:, None], geometry.arms)
        + np.cross(motion.angular_velocity[:, None], turning))
    velocity = motion.linear_velocity[:, None] + turning
    accelerations = (geometry.directions * joint_acceleration).sum(-1) + (
        (velocity * velocity).sum(-1) - rates ** 2) / geometry.lengths
    friction = viscous * rates + coulomb * np.clip(rates / near, -1.0, 1.0)
    most('limits.joint_force_max', legs.forces - mass * accelerations - friction)
    if p['actuator.screw_lead'] is None:
        return None
    ratio = np.broadcast_to(2.0 * np.pi * p['drive.gear_ratio'] / p['actuator.screw_lead'], 6)
    return _Drives(rates, accelerations, legs.forces, mass, ratio)
