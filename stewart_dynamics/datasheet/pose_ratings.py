# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Ratings of a hexapod for its datasheet: at a pose, and the worst over a set of poses."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

from msgspec import UNSET, UnsetType
from msgspec.structs import asdict
import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Capability, Extent
from stewart_dynamics.capability.force_intervals import largest_multiple
from stewart_dynamics.datasheet.datasheet_record import (
    Directions, Drives, Force, HeldForce, HeldMoment, HeldPayload, Moment, OfAxes, RatedPayload,
    Rating, Ratings, RemainingMotion, Stiffness, StuckLeg, Worst, WorstLever)
from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod
from stewart_dynamics.mechanics.frames.base_motion import BaseMotion
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.records import of_kind


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
KEYS, _ALL = Directions.keys(), Directions.__struct_fields__
DIRECTIONS = np.repeat(np.eye(6), 2, axis=0) * np.tile([1.0, -1.0], 6)[:, None]
"""(12, 6): translation and rotation of KEYS, base axes."""


def rate_extent(value: Any, limit: Any, leg: Any, joints: Sequence[str]) -> Rating:
    """Return the rating of an extent: null where nothing limits, legs by their names."""
    limited = math.isfinite(value)
    return Rating(limit if limited else None, joints[leg] if limited and leg >= 0 else None,
                  value if limited else None)


def travel(hexapod: RatedHexapod) -> Directions:
    """Return the travel along and about each axis alone, both ways [m, rad]."""
    found = hexapod.travel(hexapod.pose, DIRECTIONS)
    return Directions(**_named(found, hexapod.joints, _ALL))


def stuck_leg(hexapod: RatedHexapod, leg: int) -> StuckLeg:
    """Return the motions that remain at the pose with a stuck leg, their speeds and loads."""
    found, joints = hexapod.loads.stuck_leg(hexapod.pose, leg), hexapod.joints
    return StuckLeg(
        joints[leg], found.lost.tolist(), [
            RemainingMotion(
                found.motions[n].tolist(), found.wrenches[n].tolist(),
                _one(found.velocity, n, joints),
                *(_one(found.load, (n, side), joints) for side in range(2)))
            for n in range(len(found.motions))],
        _one(found.payload, (), joints))


def _one(extent: Extent | None, at: Any, joints: Sequence[str]) -> Rating | None:
    """Return one of several extents."""
    if extent is None:
        return None
    value, limit, leg = (np.asarray(each)[at] for each in extent[:3])
    return rate_extent(float(value), str(limit), int(leg), joints)


def rate_poses(hexapod: RatedHexapod, poses: Pose) -> Ratings:
    """Return the smallest of each rating over poses (N,)."""
    c, joints, found = hexapod.loads, hexapod.joints, Ratings()
    at = poses[:, None]
    if c.limits_rates:
        found.velocity = Directions(**_smallest(c.velocity(at, DIRECTIONS), joints, _ALL))
    if c.limits_forces:
        found.acceleration = Directions(
            **_smallest(c.acceleration(at, DIRECTIONS), joints, _ALL))
        force, moment, payload = _held(hexapod, poses, False)
        held = _held(hexapod, poses, True) if c.limits_held else 3 * (UNSET,)
        found.force = Force(**asdict(force), continuous=held[0])
        found.moment = Moment(**asdict(moment), continuous=held[1])
        found.payload = RatedPayload(**asdict(payload), continuous=held[2])
    return found


def _held(hexapod: RatedHexapod, poses: Pose, continuous: bool,
          ) -> tuple[HeldForce, HeldMoment, HeldPayload]:
    """Return the smallest force, moment and payload at rest over poses (N,)."""
    c, joints, at = hexapod.loads, hexapod.joints, poses[:, None]
    force, moment = (_smallest(c.wrench(at, DIRECTIONS[part], continuous=continuous), joints,
                               _ALL[part]) for part in (slice(0, 6), slice(6, 12)))
    found = c.payload(poses, np.zeros(3), continuous=continuous)
    payload, = _smallest(
        Extent(*(each[:, None] for each in found[:3])), joints, ('mass',)).values()
    return (
        HeldForce(**force, every_direction=_least(c.force(poses, continuous=continuous))),
        HeldMoment(**moment, every_direction=_least(c.moment(poses, continuous=continuous))),
        HeldPayload(**asdict(payload), any_orientation=Payloads(
            c, poses, continuous).any_orientation() if hexapod.given['gravity'].any() else None))


def drives(hexapod: RatedHexapod, ranges: Array | None, levels: int) -> Drives | UnsetType:
    """
    Return positions, levers and efforts of the drives at rest at the pose; unset without levers.

    Levers are by their largest values. The worst lever is the smallest over a grid of a box of
    ranges (6, 2).
    """
    p = hexapod.given
    kind, worst = p.leg_kind, None
    if not kind.lever_limit:
        return UNSET
    rows = hexapod.platform.inverse_dynamics(Motion.from_pose(hexapod.pose)).rows
    if ranges is not None:
        poses = poses_of(hexapod, grid(ranges, levels))
        ratios = kind.lever_ratios(p, hexapod.platform.inverse_dynamics(
            Motion.from_pose(poses)).rows)
        worst = WorstLever(float(ratios.min()), hexapod.joints[int(ratios.min(axis=0).argmin())])
    return of_kind(Drives, kind)(
        positions=rows[kind.position.columns].tolist(), efforts=rows[kind.effort.columns].tolist(),
        lever_ratios=kind.lever_ratios(p, rows).tolist(), worst_lever=worst)


def worst(hexapod: RatedHexapod, ranges: Array, levels: int) -> Worst:
    """Return the smallest of each rating over a grid of a box of ranges (6, 2)."""
    poses = poses_of(hexapod, grid(ranges, levels))
    return Worst(poses=len(poses), **asdict(rate_poses(hexapod, poses)))


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


def _smallest(found: Extent, joints: Sequence[str], names: Sequence[str]) -> dict[str, Rating]:
    """Return the smallest of extents (N, K) by name."""
    at = np.argmin(found.value, axis=0), np.arange(len(names))
    return _named(Extent(*(each[at] for each in found[:3])), joints, names)


def _named(found: Extent, joints: Sequence[str], names: Sequence[str]) -> dict[str, Rating]:
    """Return the ratings of extents (K,) by name."""
    return {name: rate_extent(value, limit, leg, joints) for name, value, limit, leg in zip(
        names, found.value, found.limit, found.leg, strict=True)}


def stiffness(hexapod: RatedHexapod, leg_stiffness: float, ranges: Array | None, levels: int,
              ) -> Stiffness:
    """
    Return stiffness by axis [N/m, N m/rad] and natural frequencies [Hz], and their worst.

    The stiffness of an axis is the load along it per deflection along it, all other axes being
    free: the reciprocal of the diagonal of the compliance. Forces of the legs at rest count.
    """
    def of(poses: Pose) -> tuple[Array, Array]:
        k = hexapod.loads.stiffness(poses, leg_stiffness)
        compliance = np.diagonal(np.linalg.inv(k), axis1=-2, axis2=-1)
        return 1.0 / compliance, hexapod.frequencies(poses, leg_stiffness)

    (axes, frequencies), worst = of(hexapod.pose), None
    if ranges is not None:
        least, lowest = (each.min(axis=0).tolist() for each in of(
            poses_of(hexapod, grid(ranges, levels))))
        worst = OfAxes(**dict(zip(AXES, least, strict=True)), frequencies=lowest)
    return Stiffness(
        **dict(zip(AXES, axes.tolist(), strict=True)), frequencies=frequencies.tolist(),
        leg_stiffness=leg_stiffness, worst=worst)
