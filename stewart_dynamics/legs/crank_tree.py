# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Cranks and rods in trees of joints and in files of other tools.

A crank has the axes e, n, u: along it, in the direction of positive angles, and the axis of the
motor. The rod hangs on its end by a universal joint; its z is along the rod.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from math import cos, sin
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.legs.leg_reading import (
    center_of, left_out, limits_of, platform_joint, say_gap, say_outside, slender_body, SMALL,
    TURNS)
from stewart_dynamics.legs.mechanism import (
    Chain, HINGE, joined, LegJoint, MechanismBody, Placement, SLIDE, UNIVERSAL)
from stewart_dynamics.legs.tree import (
    BALL, BARREL, LegBranch, LegLink, ROD, rod_shape, VisualShape)

if TYPE_CHECKING:
    from stewart_dynamics.legs.kind import LegKind
    from stewart_dynamics.parameters.table import Parameters

CRANK, ROD_PART = PARTS = 'crank', 'rod'
_TURN = 2.0 * math.pi
_WIDEST = -_TURN, _TURN  # angles of a crank without limits [rad]
_LEAST_FREEDOM = 4  # axes of the joints at the ends of a rod
_TO_X = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # turns z to x
_AT_CRANK, _AT_PLATFORM = 'end of its crank', 'platform'


class CrankLegs(NamedTuple):
    """The numbers of six legs by which their angles follow from a pose; units are vectors."""

    center: Array  # (6, 3) [m]
    zero: Array  # unit vectors: z, n0, u (6, 3)
    normal: Array
    axis: Array
    crank: Array  # lengths (6,) [m]
    rod: Array
    branch: Array
    middle: Array  # of the range of angles (6,) [rad]
    joints: Array  # of the platform, its frame (6, 3) [m]


def crank_legs(p: Parameters) -> CrankLegs:
    """Return these numbers of a hexapod."""
    u, z = (each / np.linalg.norm(each, axis=-1, keepdims=True) for each in (
        p['geometry.crank_axes'], p['geometry.crank_directions']))
    legs: Any = p.structure['legs']
    return CrankLegs(p.geometry.base_joints, z, np.cross(u, z), u, p['legs.crank.length'],
                     p['legs.rod.length'], legs['branch'], legs['home_position'],
                     p.geometry.platform_joints)


def crank_angles(legs: CrankLegs, position: Array, rotation: Array) -> tuple[Array, Array]:
    """
    Return angles (..., 6) and rods in the axes of the cranks (..., 6, 3) in poses.

    Where a rod does not reach, the crank points to the platform joint, or away from it.
    """
    line = (position[..., None, :] + legs.joints @ rotation.swapaxes(-1, -2) - legs.center)
    x, y, w = (np.sum(line * axis, axis=-1) for axis in (legs.zero, legs.normal, legs.axis))
    square = x * x + y * y
    g = (square + w * w + legs.crank ** 2 - legs.rod ** 2) / (2.0 * legs.crank)
    h = legs.branch * np.sqrt(np.maximum(square - g * g, 0.0))
    q = np.arctan2(y * g - x * h, x * g + y * h)
    q = q + _TURN * np.rint((legs.middle - q) / _TURN)
    cosine, sine = np.cos(q), np.sin(q)
    rods = np.stack([x * cosine + y * sine - legs.crank, y * cosine - x * sine, w], axis=-1)
    return q, rods


def _axes(legs: CrankLegs, n: int, angle: float) -> Array:
    """Return e, n, u of a crank as columns (3, 3), base axes."""
    e = legs.zero[n] * cos(angle) + legs.normal[n] * sin(angle)
    return np.column_stack([e, np.cross(legs.axis[n], e), legs.axis[n]])


def mounts_on_cranks(legs: CrankLegs, home: tuple[Array, Array], mounts: Array) -> Array:
    """
    Return rotations (6, 3, 3) from the axes of the mounts to those of the cranks.

    The mounts' z are turned to the rods at home.
    """
    q, rods = crank_angles(legs, *home)
    found = []
    for n, rod in enumerate(rods):
        z = rod / np.linalg.norm(rod)
        x, y = (_axes(legs, n, float(q[n])).T @ mounts[n])[:, :2].T
        x, y = (x, y) if abs(x @ z) < abs(y @ z) else (y, -x)
        x = x - (x @ z) * z
        x /= np.linalg.norm(x)
        found.append(np.column_stack([x, np.cross(z, x), z]))
    return np.array(found)


def branches(p: Parameters, bodies: tuple[Array, Array], position: Array, rotation: Array,
             mounts: Array, size: float) -> list[LegBranch]:
    """
    Return cranks on their motors, with rods.

    bodies: centers of mass and inertias of the cranks (6, 3), (6, 6).
    """
    legs = crank_legs(p)
    q = crank_angles(legs, position, rotation)[0]
    on_cranks = mounts_on_cranks(legs, (position, rotation), mounts)
    masses, rod_centers, rod_inertias = (
        p['legs.rod.mass'], *(rod_value(p, name) for name in ('center_of_mass', 'inertia')))
    found = []
    for n in range(6):
        length, rod, angle = float(legs.crank[n]), float(legs.rod[n]), float(q[n])
        at = Placement(on_cranks[n], np.array([length, 0.0, 0.0]))
        across = float(rod_inertias[n])
        found.append(LegBranch((
            LegLink(CRANK, HINGE, Placement(_axes(legs, n, angle), legs.center[n]),
                    Placement(_axes(legs, n, 0.0), legs.center[n]),
                    float(p['legs.crank.mass'][n]), bodies[0][n],
                    bodies[1][n][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]], False, length,
                    _crank_shapes(length, size)),
            LegLink(ROD_PART, UNIVERSAL, at, at, float(masses[n]),
                    np.array([0.0, 0.0, float(rod_centers[n])]), np.diag([across, across, 0.0]),
                    True, rod, (rod_shape(ROD_PART, ROD * size, rod),
                                VisualShape('sphere', 'joint', np.zeros(3), np.eye(3),
                                            BALL * size)))),
            np.array([0.0, 0.0, rod]), angle, 0.0, _WIDEST, length + rod))
    return found


def _crank_shapes(length: float, size: float) -> tuple[VisualShape, ...]:
    """Return the hub of a crank, along the axis of its motor, and its arm."""
    radius = min(BARREL * size, 0.4 * length)
    return (VisualShape('cylinder', CRANK, np.zeros(3), np.eye(3), radius, 2.0 * radius),
            VisualShape('cylinder', CRANK, np.array([0.5 * length, 0.0, 0.0]), _TO_X,
                        0.6 * radius, length))


def rod_value(p: Parameters, name: str) -> Array:
    """Return center of mass or inertia of the rods (6,), by default those of uniform rods."""
    value: Array | None = p[f'legs.rod.{name}']
    if value is not None:
        return value
    length = p['legs.rod.length']
    default: Array = (0.5 * length if name == 'center_of_mass'
                      else p['legs.rod.mass'] * length ** 2 / 12.0)
    return default


def tree_positions(legs: CrankLegs, on_cranks: Array, position: Array, rotation: Array) -> Array:
    """
    Return the angle of each crank, and two of each universal joint (..., 6, 3) [rad].

    on_cranks: see ``mounts_on_cranks``.
    """
    q, rods = crank_angles(legs, position, rotation)
    x, y, z = np.moveaxis(np.einsum('iba,...ib->...ia', on_cranks, rods), -1, 0).copy()
    return np.stack([q, np.arctan2(-y, z), np.arctan2(x, np.hypot(y, z))], axis=-1)


def _rod_at(steps: Sequence[LegJoint]) -> int:
    """Return which of the joints is the first at the end of the longest body, but the first."""
    gaps = [float(np.linalg.norm(after.near - before.far))
            for before, after in zip(steps[1:], steps[2:], strict=False)]
    return int(np.argmax(gaps)) + 2


def drive_of(steps: Sequence[LegJoint]) -> int | None:
    """Return 0 if the first joint turns a body at whose other end a rod begins, else None."""
    kinds = [step.joint.kind for step in steps]
    if len(steps) < 3 or kinds[0] != HINGE or SLIDE in kinds or sum(
            TURNS.get(kind, 0) for kind in kinds[1:]) < _LEAST_FREEDOM:
        return None
    arm = steps[1].near - steps[0].far
    across = float(np.linalg.norm(np.cross(steps[0].axis, arm)))
    rod = steps[_rod_at(steps)].near - steps[1].far
    return 0 if across > SMALL * float(np.linalg.norm(rod)) > 0.0 else None


def places(steps: Sequence[LegJoint]) -> list[str]:
    """Return where each joint is, in words; the first is the drive."""
    at = _rod_at(steps)
    return ['', *[_AT_CRANK] * (at - 1), *[_AT_PLATFORM] * (len(steps) - at)]


def read_leg(kind: LegKind, chain: Chain, base: MechanismBody, platform: MechanismBody,
             said: list[str]) -> dict[str, Any]:
    """Return the parameters of one leg; all of them follow from points of single bodies."""
    frame, motor = base.placement, chain.driven.joint
    at = _rod_at(chain.steps)
    lower, upper = chain.steps[1:at], chain.steps[at:]
    end = center_of(lower, _AT_CRANK, said)
    start = center_of(lower, _AT_CRANK, [], far=True)
    tip = center_of(upper, _AT_PLATFORM, said)
    on_platform = platform_joint(upper, tip)
    if [sum(TURNS.get(step.joint.kind, 0) for step in steps) for steps in (lower, upper)] == [
            2, 2]:
        said.append('universal joints at both ends of its rod: it cannot turn freely about its '
                    'own axis: taken as one with a ball joint')
    u = chain.driven.axis
    root = motor.anchor + ((end - motor.anchor) @ u) * u
    length, rod = float(np.linalg.norm(end - root)), float(np.linalg.norm(tip - start))
    e, d = (end - root) / length, (tip - start) / rod
    n = np.cross(u, e)
    say_gap(chain, float(np.linalg.norm(tip - on_platform)), length + rod, said)
    say_outside(motor, SMALL, 'rad', said)
    zero = e * cos(motor.position) - n * sin(motor.position)
    crank = joined(chain.lower, Placement(np.column_stack([e, n, u]), root))
    if not crank.mass:
        said.append('no mass of its crank: legs.crank.mass is 0.0')
    leg: dict[str, Any] = {
        'joints': motor.name, 'direction': frame.rotation.T @ d,
        'geometry.base_joints': frame.inside(root),
        'geometry.platform_joints': platform.placement.inside(on_platform),
        'geometry.crank_axes': frame.rotation.T @ u,
        'geometry.crank_directions': frame.rotation.T @ zero,
        'geometry.crank_branch': 'negative' if d @ n < 0.0 else 'positive',
        'legs.crank.length': length, 'legs.rod.length': rod,
        'legs.crank.mass': crank.mass, 'legs.crank.center_of_mass': crank.center,
        'legs.crank.inertia': crank.inertia[np.triu_indices(3)],
        'actuator.reflected_inertia': motor.armature, 'actuator.viscous_friction': motor.damping,
        'actuator.coulomb_friction': motor.friction,
        **limits_of(kind, motor, 0.0, 1.0, -math.inf, said)}
    said += left_out(chain)
    leg |= slender_body(ROD_PART, chain.upper, start, d, rod, said)
    return leg


def _collapsed(rows: Array, size: float, alone: int, resolution: float) -> Array:
    """Return rows (6, n) as one where all are equal, and as one number if the rest is zero."""
    small = resolution * max(size, float(np.abs(rows).max()))
    if np.abs(rows - rows[0]).max() > small:
        return rows.ravel()
    others = np.delete(rows[0], alone)
    return rows[0, alone:alone + 1] if np.abs(others).max() <= small else rows[0]


def tidy(values: dict[str, Any], resolution: float) -> None:
    """Bring the values of six legs into the shortest form that a parameter file can have."""
    axes, zeros = (np.reshape(values[name], (6, 3)) for name in (
        'geometry.crank_axes', 'geometry.crank_directions'))
    headings = np.arctan2(zeros[:, 1], zeros[:, 0])
    cosine, sine, level = np.cos(headings), np.sin(headings), np.zeros(6)
    if max(np.abs(axes - np.stack([sine, -cosine, level], axis=-1)).max(),
           np.abs(zeros - np.stack([cosine, sine, level], axis=-1)).max()) <= resolution:
        del values['geometry.crank_axes'], values['geometry.crank_directions']
        values['geometry.crank_angles'] = headings
    if 'legs.crank.mass' not in values:
        return
    length = float(np.max(values['legs.crank.length']))
    values['legs.crank.center_of_mass'] = _collapsed(
        np.reshape(values['legs.crank.center_of_mass'], (6, 3)), length, 0, resolution)
    values['legs.crank.inertia'] = _collapsed(
        np.reshape(values['legs.crank.inertia'], (6, 6)), 0.0, 5, resolution)
    mass, rod = (np.asarray(values[f'legs.rod.{name}']) for name in ('mass', 'length'))
    for name, default in (('center_of_mass', 0.5 * rod), ('inertia', mass * rod ** 2 / 12.0)):
        if np.allclose(np.where(mass > 0.0, values[f'legs.rod.{name}'], default), default,
                       rtol=resolution, atol=0.0):
            del values[f'legs.rod.{name}']
