# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Functions to read legs of any kind from files of other tools."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.legs.mechanism import (
    BALL, Chain, HERE, HINGE, joined, Joint, LegJoint, MechanismBody, UNIVERSAL)

if TYPE_CHECKING:
    from stewart_dynamics.legs.kind import LegKind

# Smaller parts of the length of a leg, or smaller angles [rad], are rounding errors.
SMALL = 1e-6
_OPEN = 1e-5  # of the length of a leg: files have numbers of six digits
_OFF_AXIS = 1e-3
_UNEQUAL = 0.01
_THICK = 0.05
TURNS = {HINGE: 1, UNIVERSAL: 2, BALL: 3}
"""Number of axes about which joints turn."""


def left_out(chain: Chain) -> Iterator[str]:
    """Yield remarks about forces on the joints of a moving leg, and about their limits."""
    yield from chain.driven.joint.remarks
    for n, step in enumerate(chain.steps):
        for what in [*step.joint.left_out, *([] if n == chain.drive else passive(step.joint))]:
            yield f'{what}{chain.where(n)} is left out'


def passive(joint: Joint) -> Iterator[str]:
    """Yield the friction and inertia of a joint that has no actuator in this model."""
    yield from (f'actuator {name!r}' for name in joint.actuators)
    for name in ('damping', 'friction', 'armature'):
        if getattr(joint, name):
            yield f'{name} {getattr(joint, name):.6g}'


def center_of(steps: Sequence[LegJoint], where: str, said: list[str], far: bool = False,
              ) -> Array:
    """
    Return the point about which joints turn [m].

    where: of the joints, in words. far: take the point on the side of the platform.
    """
    points = [step.far if far else step.near for step in steps]
    full = [point for point, step in zip(points, steps, strict=True)
            if step.joint.kind in (BALL, UNIVERSAL)]
    if full:
        apart = max(float(np.linalg.norm(point - full[0])) for point in full)
        if apart > 0.0:
            said.append(f'its joints at the {where} are {apart:.3g} m apart: the first is taken')
        return full[0]
    lines = [(point, step.joint.axes[0]) for point, step in zip(points, steps, strict=True)
             if step.joint.kind == HINGE]
    if len(lines) < 2:
        said.append(f'its joint at the {where} turns about one axis: taken as one that turns '
                    'about all')
        return points[0]
    if all(np.array_equal(point, lines[0][0]) for point, _ in lines):
        return lines[0][0]
    across = [np.eye(3) - np.outer(axis, axis) for _, axis in lines]
    matrix = np.sum(across, axis=0)
    if np.linalg.cond(matrix) > 1.0 / SMALL:
        said.append(f'the axes of its joints at the {where} are parallel: their middle is taken')
        return np.asarray(np.mean([point for point, _ in lines], axis=0))
    center = np.linalg.solve(matrix, np.sum(
        [a @ point for a, (point, _) in zip(across, lines, strict=True)], axis=0))
    missed = max(float(np.linalg.norm(a @ (center - point)))
                 for a, (point, _) in zip(across, lines, strict=True))
    if missed > SMALL:
        said.append(f'the axes of its joints at the {where} miss each other by '
                    f'{2.0 * missed:.3g} m: their middle is taken')
    return center


def platform_joint(steps: Sequence[LegJoint], end: Array) -> Array:
    """Return the point of the platform where a leg ends."""
    return end if len(steps) > 1 or steps[-1].joint.child_anchor is None else steps[-1].far


def say_gap(chain: Chain, gap: float, length: float, said: list[str]) -> None:
    """Say that the loop of a leg is open, but in files of stewart_describe."""
    closed = gap <= _OPEN * max(length, np.finfo(float).tiny)
    if not closed and not chain.steps[-1].joint.name.startswith(chain.driven.joint.name):
        said.append(f'its end is {gap:.3g} m from its joint on the platform at the positions of '
                    'the file: the loop is open')


def say_outside(joint: Joint, tolerance: float, unit: str, said: list[str]) -> None:
    """Say that the position of a drive in the file is outside its limits."""
    low, high = (-math.inf if joint.lower is None else joint.lower,
                 math.inf if joint.upper is None else joint.upper)
    if not low - tolerance <= joint.position <= high + tolerance:
        said.append(f'its position in the file, {joint.position:.4g} {unit}, is outside its '
                    f'limits, {low:.4g} to {high:.4g} {unit}')


def limits_of(kind: LegKind, joint: Joint, zero: float, sign: float, least: float,
              said: list[str]) -> dict[str, float | None]:
    """
    Return the limits of a leg.

    zero, sign: the position of the drive is zero + sign * that of its joint.
    least: smallest position that a parameter can have.
    """
    ends = [None if q is None else zero + sign * q for q in (joint.lower, joint.upper)]
    if sign < 0.0:
        ends.reverse()
    tiny = float(np.finfo(float).tiny)
    found: dict[str, float | None] = {}
    for name, value, smallest in zip(
            kind.drive_limits, (*ends, joint.velocity_max, joint.force_max),
            (least, least or tiny, tiny, tiny), strict=True):
        if value is not None and value < smallest:
            said.append(f'{name}: {value:.3g}: cannot be: left out')
            value = None
        found[name] = value
    if joint.lower is not None and joint.lower == joint.upper:
        said.append(f'{", ".join(kind.position_limits)}: lower and upper are both '
                    f'{joint.lower:.4g}: no travel: left out')
        found |= dict.fromkeys(kind.position_limits)
    return found


def slender_body(part: str, bodies: list[MechanismBody], start: Array, way: Array, length: float,
                 said: list[str]) -> dict[str, Any]:
    """Return mass, center and transverse inertia of a leg's bodies along its line."""
    body = joined(bodies, HERE)
    name = f'legs.{part}'
    if not any(each.mass for each in bodies):
        said.append(f'no mass of its {part}: {name}.mass is 0.0')
    arm = body.center - start
    center = float(arm @ way) if body.mass else 0.0
    off = float(np.linalg.norm(arm - center * way)) if body.mass else 0.0
    if off > _OFF_AXIS * max(length, abs(center)):
        said.append(f'the center of mass of its {part} is {off:.3g} m off the line between the '
                    'joints: taken on the line')
    axial = float(way @ body.inertia @ way)
    across = np.eye(3) - np.outer(way, way)
    moments = np.linalg.eigvalsh(across @ body.inertia @ across)[1:]
    transverse = 0.5 * (float(np.trace(body.inertia)) - axial)
    if transverse > 0.0 and moments[1] - moments[0] > _UNEQUAL * moments[1]:
        said.append(f'the two transverse moments of inertia of its {part} differ: their mean is '
                    'taken')
    if axial > _THICK * transverse:
        said.append(f'inertia of its {part} about its axis, {axial:.3g} kg m^2, is left out')
    return {f'{name}.mass': body.mass, f'{name}.center_of_mass': center,
            f'{name}.inertia': max(transverse, 0.0)}
