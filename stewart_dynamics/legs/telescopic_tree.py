# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Telescopic legs in trees of joints and in files of other tools: two bodies with a slide."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import shown
from stewart_dynamics.legs.leg_reading import (
    center_of, left_out, limits_of, platform_joint, say_gap, say_outside, slender_body, SMALL,
    TURNS)
from stewart_dynamics.legs.mechanism import (
    Chain, DescriptionError, LegJoint, MechanismBody, Placement, SLIDE, UNIVERSAL)
from stewart_dynamics.legs.tree import BARREL, LegBranch, LegLink, ROD, rod_shape, VisualShape

if TYPE_CHECKING:
    from stewart_dynamics.legs.kind import LegKind
    from stewart_dynamics.parameters.table import Parameters

CYLINDER, PISTON = PARTS = 'cylinder', 'piston'
# Parts of the shortest leg length, or of the length at home if there is no limit.
BARREL_LENGTH, _ROD_LENGTH, _OF_HOME = 0.9, 0.95, 0.7
_UNLIMITED = 10.0  # longest leg without a limit, in terms of its length at home
_INCLINED = 1e-3
_ACROSS = math.radians(45.0)


def branches(p: Parameters, position: Array, rotation: Array, mounts: Array, size: float,
             ) -> list[LegBranch]:
    """Return cylinders with the axes of the mounts, from whose universal joints pistons slide."""
    found = []
    for n, mount in enumerate(mounts):
        base = p.geometry.base_joints[n]
        length = float(np.linalg.norm(
            position + rotation @ p.geometry.platform_joints[n] - base))
        zero, longest = float(p.geometry.zero_length[n]), p.limits.length_max
        shortest = (None if p.limits.length_min is None else float(p.limits.length_min[n])) or (
            _OF_HOME * length)
        at = Placement(mount, base)
        widest = 0.0, _UNLIMITED * length
        found.append(LegBranch((
            _link(p, n, CYLINDER, UNIVERSAL, (at, at), 1.0, length,
                  rod_shape(CYLINDER, BARREL * size, BARREL_LENGTH * shortest)),
            _link(p, n, PISTON, SLIDE, tuple(Placement(np.eye(3), np.array([0.0, 0.0, each]))
                                             for each in (length, zero)), -1.0, length,
                  rod_shape(PISTON, ROD * size, _ROD_LENGTH * shortest, -1.0))),
            np.zeros(3), length, zero, widest,
            widest[1] if longest is None else float(longest[n])))
    return found


def _link(p: Parameters, n: int, part: str, joint: str, at: Sequence[Placement], sign: float,
          length: float, shape: VisualShape) -> LegLink:
    of_part = p.legs.parts[part]
    across = float(of_part.inertia[n])
    center = sign * float(of_part.center_of_mass[n])
    return LegLink(part, joint, at[0], at[1], float(of_part.mass[n]),
                   np.array([0.0, 0.0, center + 0.0]), np.diag([across, across, 0.0]), True,
                   length, (shape,))


def tree_positions(p: Parameters, mounts: Array, position: Array, rotation: Array) -> Array:
    """Return two angles of each universal joint, and lengths from zero (..., 6, 3)."""
    legs = (position[..., None, :] + p.geometry.platform_joints @ rotation.swapaxes(-1, -2)
            - p.geometry.base_joints)
    # Copied: the bits of numpy 1.26's arctan2 of views change with where these are in memory.
    x, y, z = np.moveaxis(np.einsum('iba,...ib->...ia', mounts, legs), -1, 0).copy()
    across = np.hypot(y, z)
    return np.stack([np.arctan2(-y, z), np.arctan2(x, across),
                     np.hypot(x, across) - p.geometry.zero_length], axis=-1)


def drive_of(steps: Sequence[LegJoint]) -> int | None:
    """Return which joint of a leg slides; None if not one of them does."""
    slides = [n for n, step in enumerate(steps) if step.joint.kind == SLIDE]
    return slides[0] if len(slides) == 1 else None


def read_leg(kind: LegKind, chain: Chain, base: MechanismBody, platform: MechanismBody,
             said: list[str]) -> dict[str, Any]:
    """Return the parameters of one leg."""
    at, frame = chain.drive, base.placement
    slide = chain.driven.joint
    lower, upper = chain.steps[:at], chain.steps[at + 1:]
    if not lower or not upper:
        end = platform if lower else base
        raise DescriptionError(f'{slide.name}: no joint between it and {shown(end.name)}: a leg '
                               'of this model turns at both of its ends')
    root = center_of(lower, 'base', said, far=True)
    tip = center_of(upper, 'platform', said)
    _say_other_joints(lower, upper, said)
    on_platform = platform_joint(upper, tip)
    gap = float(np.linalg.norm(tip - on_platform))
    length = float(np.linalg.norm(tip - root))
    axis = slide.axes[0]
    out = chain.driven.from_parent
    along = axis if axis @ (tip - root) >= 0.0 and (out or length > 0.0) else -axis
    if length > 0.0:
        line = (tip - root) / length
        angle = math.acos(min(1.0, float(abs(line @ axis))))
        if angle > _ACROSS:
            raise DescriptionError(
                f'{slide.name}: the axis of this prismatic joint is inclined to the line between '
                f'the joints of its leg by {math.degrees(angle):.3g} degrees: must be along it')
        if angle > _INCLINED:
            said.append('the axis of its prismatic joint is inclined to the line between the '
                        f'joints by {math.degrees(angle):.3g} degrees: taken along the line')
        along = line if angle > SMALL else along
    say_gap(chain, gap, length, said)
    grows = float(np.sign(chain.driven.axis @ along))
    if grows < 0.0:
        said.append('its prismatic joint is positive while it retracts: the sign is turned')
    zero = length - grows * slide.position
    say_outside(slide, SMALL * length, 'm', said)
    leg: dict[str, Any] = {
        'joints': slide.name, 'direction': frame.rotation.T @ along,
        'geometry.base_joints': frame.inside(root),
        'geometry.platform_joints': platform.placement.inside(on_platform),
        'geometry.zero_length': max(zero, 0.0),
        'actuator.reflected_mass': slide.armature, 'actuator.viscous_friction': slide.damping,
        'actuator.coulomb_friction': slide.friction,
        **limits_of(kind, slide, zero, grows, 0.0, said)}
    said += left_out(chain)
    for part, bodies, start, way in ((CYLINDER, chain.lower, root, along),
                                     (PISTON, chain.upper, tip, -along)):
        leg |= slender_body(part, bodies, start, way, length, said)
    return leg


def _say_other_joints(lower: Sequence[LegJoint], upper: Sequence[LegJoint], said: list[str],
                      ) -> None:
    """Say that a leg has not one universal joint and one ball joint."""
    at_base, at_platform = (sum(TURNS.get(step.joint.kind, 0) for step in steps)
                            for steps in (lower, upper))
    if at_base >= 3 and at_platform >= 3:
        said.append('ball joints at both ends, no universal joint: it may turn about its own axis '
                    'in the file: taken as one that does not')
    elif at_base == at_platform == 2:
        said.append('universal joints at both ends: it cannot turn freely about its own axis: '
                    'taken as one with a ball joint')
