# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Ratings of a hexapod for its datasheet: at a pose, and the worst over a set of poses."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Capability, Extent
from stewart_dynamics.capability.force_intervals import largest_multiple
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose


# Azimuths of a center of mass beside the pivot, of which the worst counts.
_AZIMUTHS = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)


class Payloads:
    """
    Largest point masses that can be added to a platform at rest, by forces and torques.

    capability, poses (N,): with limits of forces.
    continuous: that are held without end, by ``drive.torque_continuous``.
    """

    def __init__(self, capability: Capability, poses: Pose, continuous: bool = False) -> None:
        self._gravity = np.asarray(capability.platform.parameters.gravity)
        # of a gravity of 1 along each axis: loads of the hexapod, (N, 3, RESULT), and of a mass of
        # 1 kg, itself and its first moment, (N, 3, 4, RESULT)
        along = np.eye(3)
        own = capability.load_rows(
            Motion.from_pose(poses[:, None]), base=BaseMotion(along))
        arms = np.concatenate([np.zeros((len(poses), 1, 3)),
                               np.swapaxes(poses.rotation, 1, 2)], axis=1)[:, None]
        weights = np.zeros((len(poses), 3, 4, 6))
        weights[..., 0, :3] = along
        weights[..., 3:] = np.cross(arms, along[:, None])
        added = capability.load_rows(
            Motion.from_pose(poses[:, None, None]), weights, BaseMotion(np.zeros(3)))
        self._loads = [
            (np.swapaxes(own[..., columns], 1, 2), np.moveaxis(added[..., columns], -1, 1), most)
            for columns, most in capability.holding_loads(continuous)]

    def level(self, offset: float = 0.0, height: float = 0.0) -> float:
        """
        Return the smallest payload [kg] over poses and azimuths, in the given gravity.

        offset, height: position of its center of mass beside the platform's origin and above it
            [m].
        """
        masses = self._masses(offset, height)
        return min(float(largest_multiple(
            (own @ self._gravity)[..., None, :],
            np.einsum('nikc,mc,k->nmi', added, masses, self._gravity), most).min())
            for own, added, most in self._loads)

    def any_orientation(self, offset: float = 0.0, height: float = 0.0) -> float:
        """Return the same for all directions of gravity: a base that hangs, or on a wall."""
        # |own + m added| |g| <= most for each leg: a quadratic in m
        least = math.inf
        for of_hexapod, of_mass, most in self._loads:
            own = of_hexapod[:, None]
            added = np.einsum('nikc,mc->nmik', of_mass, self._masses(offset, height))
            bound = most / np.linalg.norm(self._gravity)
            a, b = (added * added).sum(axis=-1), (own * added).sum(axis=-1)
            c = (own * own).sum(axis=-1) - bound * bound
            with np.errstate(divide='ignore', invalid='ignore'):
                found = np.where(c > 0.0, 0.0, -c / (b + np.sqrt(np.maximum(b * b - a * c, 0.0))))
            least = min(least, float(np.where(np.isnan(found), np.inf, found).min()))
        return least

    def _masses(self, offset: float, height: float) -> Array:
        """Return mass and first moment (M, 4) of 1 kg, for each azimuth."""
        around = _AZIMUTHS if offset else _AZIMUTHS[:1]
        return np.stack([np.ones_like(around), offset * np.cos(around), offset * np.sin(around),
                         np.full_like(around, height)], axis=-1)


AXES = ('x', 'y', 'z', 'rx', 'ry', 'rz')
KEYS = tuple(f'{axis}{sign}' for axis in AXES for sign in '+-')
DIRECTIONS = np.repeat(np.eye(6), 2, axis=0) * np.tile([1.0, -1.0], 6)[:, None]
"""(12, 6): translation and rotation of KEYS, base axes."""


def answer(value: Any, limit: Any, leg: Any, joints: Sequence[str]) -> dict[str, Any]:
    """Return an extent for JSON: null where nothing limits, legs by their names."""
    limited = math.isfinite(value)
    return {'value': value if limited else None, 'limit': limit if limited else None,
            'leg': joints[leg] if limited and leg >= 0 else None}


def answers(found: Extent, joints: Sequence[str], keys: Sequence[str] = KEYS) -> dict[str, Any]:
    """Return the extents (N,) of some directions for JSON."""
    return {key: answer(value, limit, leg, joints) for key, value, limit, leg in zip(
        keys, found.value, found.limit, found.leg, strict=True)}


def travel(hexapod: RatedHexapod) -> dict[str, Any]:
    """Return the travel along and about each axis alone, both ways [m, rad]."""
    return answers(hexapod.travel(hexapod.pose, DIRECTIONS), hexapod.joints)


def at_pose(hexapod: RatedHexapod) -> dict[str, Any]:
    """Return velocity, acceleration, force, moment and payload at the pose."""
    return _loads(hexapod, hexapod.pose)


def stuck_leg(hexapod: RatedHexapod, leg: int) -> dict[str, Any]:
    """Return the motions that remain at the pose with a stuck leg, their speeds and loads."""
    found, joints = hexapod.loads.stuck_leg(hexapod.pose, leg), hexapod.joints
    rows: list[dict[str, Any]] = []
    for n in range(len(found.motions)):
        rows.append({'motion': found.motions[n].tolist(), 'wrench': found.wrenches[n].tolist(),
                     'velocity': _one(found.velocity, n, joints)})
        rows[n] |= {f'load{sign}': _one(found.load, (n, side), joints)
                    for side, sign in enumerate('+-')}
    return {'leg': joints[leg], 'lost': found.lost.tolist(), 'motions': rows,
            'payload': _one(found.payload, (), joints)}


def _one(extent: Extent | None, at: Any, joints: Sequence[str]) -> dict[str, Any] | None:
    """Return one of several extents for JSON."""
    if extent is None:
        return None
    value, limit, leg = (np.asarray(each)[at] for each in extent[:3])
    return answer(float(value), str(limit), int(leg), joints)


def _loads(hexapod: RatedHexapod, poses: Pose) -> dict[str, Any]:
    """Return the smallest of each rating over poses (N,), or at one."""
    c, joints = hexapod.loads, hexapod.joints
    one = not poses.shape
    all_poses = poses[None] if one else poses
    at = all_poses[:, None]
    found: dict[str, Any] = {}
    if c.limits_rates:
        found['velocity'] = _smallest(c.velocity(at, DIRECTIONS), joints, KEYS)
    if c.limits_forces:
        found['acceleration'] = _smallest(c.acceleration(at, DIRECTIONS), joints, KEYS)
        found |= _held(hexapod, all_poses, False)
        if c.limits_held:
            for name, each in _held(hexapod, all_poses, True).items():
                found[name]['continuous'] = each
    return found


def _held(hexapod: RatedHexapod, poses: Pose, continuous: bool) -> dict[str, Any]:
    """Return the smallest force, moment and payload at rest over poses (N,)."""
    c, joints, at = hexapod.loads, hexapod.joints, poses[:, None]
    found = {name: _smallest(c.wrench(at, DIRECTIONS[part], continuous=continuous), joints,
                             KEYS[part])
             for name, part in (('force', slice(0, 6)), ('moment', slice(6, 12)))}
    found['force']['every_direction'] = _least(c.force(poses, continuous=continuous))
    found['moment']['every_direction'] = _least(c.moment(poses, continuous=continuous))
    payload = c.payload(poses, np.zeros(3), continuous=continuous)
    column = Extent(*(each[:, None] for each in payload[:3]))
    found['payload'] = _smallest(column, joints, ['mass'])['mass']
    found['payload']['any_orientation'] = (
        Payloads(c, poses, continuous).any_orientation()
        if hexapod.given['gravity'].any() else None)
    return found


def drives(hexapod: RatedHexapod, ranges: Array | None, levels: int) -> dict[str, Any] | None:
    """
    Return positions, levers and efforts of the drives at rest at the pose; None without levers.

    Levers are by their largest values. The worst lever is the smallest over a grid of a box of
    ranges (6, 2).
    """
    p = hexapod.given
    kind = p.leg_kind
    if not kind.lever_limit:
        return None
    rows = hexapod.platform.inverse_dynamics(Motion.from_pose(hexapod.pose)).rows
    found: dict[str, Any] = {
        kind.position.field: rows[kind.position.columns], kind.effort.field: rows[
            kind.effort.columns], 'lever_ratios': kind.lever_ratios(p, rows), 'worst_lever': None}
    if ranges is not None:
        poses = poses_of(hexapod, grid(ranges, levels))
        ratios = kind.lever_ratios(p, hexapod.platform.inverse_dynamics(
            Motion.from_pose(poses)).rows)
        leg = int(ratios.min(axis=0).argmin())
        found['worst_lever'] = {'value': float(ratios.min()), 'leg': hexapod.joints[leg]}
    return found


def worst(hexapod: RatedHexapod, ranges: Array, levels: int) -> dict[str, Any]:
    """Return the smallest of each rating over a grid of a box of ranges (6, 2)."""
    poses = poses_of(hexapod, grid(ranges, levels))
    return _loads(hexapod, poses) | {'poses': len(poses)}


def grid(ranges: Array, levels: int) -> Array:
    """Return the points (levels^6, 6) of a grid over a box."""
    axes = [np.linspace(low, high, levels) for low, high in ranges.tolist()]
    return np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, 6)


def poses_of(hexapod: RatedHexapod, offsets: Array) -> Pose:
    """Return the poses after translations and rotation vectors (N, 6)."""
    poses = [hexapod.moved_by(each) for each in offsets]
    return Pose(np.array([each.position for each in poses]),
                np.array([each.rotation for each in poses]))


def _least(values: Any) -> float:
    return float(np.min(values))


def _smallest(found: Extent, joints: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    """Return the smallest of extents (N, K) by key."""
    at = np.argmin(found.value, axis=0), np.arange(len(keys))
    return answers(Extent(found.value[at], found.limit[at], found.leg[at]), joints, keys)


def stiffness(hexapod: RatedHexapod, leg_stiffness: float, ranges: Array | None, levels: int,
              ) -> dict[str, Any]:
    """
    Return stiffness by axis [N/m, N m/rad] and natural frequencies [Hz], and their worst.

    The stiffness of an axis is the load along it per deflection along it, all other axes being
    free: the reciprocal of the diagonal of the compliance. Forces of the legs at rest count.
    """
    def of(poses: Pose) -> tuple[Array, Array]:
        k = hexapod.loads.stiffness(poses, leg_stiffness)
        compliance = np.diagonal(np.linalg.inv(k), axis1=-2, axis2=-1)
        return 1.0 / compliance, hexapod.frequencies(poses, leg_stiffness)

    axes, frequencies = of(hexapod.pose)
    found: dict[str, Any] = {
        'leg_stiffness': leg_stiffness, **dict(zip(AXES, axes.tolist(), strict=True)),
        'frequencies': frequencies.tolist(), 'worst': None}
    if ranges is not None:
        axes, frequencies = of(poses_of(hexapod, grid(ranges, levels)))
        found['worst'] = dict(zip(AXES, axes.min(axis=0).tolist(), strict=True)) | {
            'frequencies': frequencies.min(axis=0).tolist()}
    return found
