# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""
Bodies, joints and loops in the files of other tools, as all readers and writers name them.

A mechanism is in world axes. Everything is placed as the file has it, at the positions of the
joints that the file has.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
import math
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import StewartError

WORLD = 'world'
FIXED, HINGE, UNIVERSAL, BALL, SLIDE, OTHER = (
    'fixed', 'hinge', 'universal', 'ball', 'slide', 'other')


class CarriedParameter(NamedTuple):
    """
    A parameter that stewart_describe has added to a format, as text.

    It holds where the elements of the file are as they were written, ``element``: another value
    of theirs is an edit, and is taken.
    """

    value: str
    element: str = ''
    """The value that a reader of the elements alone finds, of limits that of the joint; empty
    where the format has no element for it."""


class DescriptionError(StewartError):
    """A file that cannot be read, or in which there is no hexapod."""


class Placement(NamedTuple):
    """Where a frame is: its axes to those of the world, and its origin."""

    rotation: Array
    position: Array

    def of(self, inner: Placement) -> Placement:
        """Return where a frame is that is placed in this one."""
        return Placement(self.rotation @ inner.rotation,
                         self.position + self.rotation @ inner.position)

    def point(self, at: Array) -> Array:
        """Return a point of this frame in the world."""
        placed: Array = self.position + self.rotation @ at
        return placed

    def inside(self, at: Array) -> Array:
        """Return a point of the world in this frame."""
        seen: Array = self.rotation.T @ (at - self.position)
        return seen


HERE = Placement(np.eye(3), np.zeros(3))


@dataclass
class MechanismBody:
    """A body; mass is None where the file gives none."""

    name: str
    placement: Placement
    mass: float | None = None
    center: Array = field(default_factory=lambda: np.zeros(3))  # in the frame of the body [m]
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """About the center of mass, axes of the body [kg m^2]."""
    note: str = ''  # assumption of the reader about it
    shapes: int = 0  # visual and collision elements
    weightless: str = ''  # what takes its weight away in the file
    left_out: list[str] = field(default_factory=list)
    """What acts on it while it moves and has no parameter."""


@dataclass
class Joint:
    """A joint between two bodies; where loops are open, it has a point on each of them."""

    name: str
    kind: str
    parent: str
    child: str
    anchor: Array  # in the world; on the parent's side [m]
    axes: list[Array] = field(default_factory=list)  # unit vectors, in world axes
    child_anchor: Array | None = None
    """The same point on the child's side, where it is given on its own [m]."""
    position: float = 0.0  # of a slide or hinge at the placements of the file [m, rad]
    lower: float | None = None
    upper: float | None = None
    velocity_max: float | None = None
    force_max: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    springs: list[str] = field(default_factory=list)
    """What acts on it at rest as well and has no parameter."""
    left_out: list[str] = field(default_factory=list)
    """What else acts on it or limits it and has no parameter."""
    actuators: list[str] = field(default_factory=list)  # names
    remarks: list[str] = field(default_factory=list)  # assumptions of the reader about it
    without: set[str] = field(default_factory=set)
    """Fields above that the file has, but not as a parameter can have them."""

    @property
    def travel(self) -> tuple[float | None, float | None]:
        """Return its limits from where it is at the placements of the file, None if unlimited."""
        low, high = (None if end is None else end - self.position
                     for end in (self.lower, self.upper))
        return low, high

    def bound(self, field: str, key: str, lower: float, upper: float) -> None:
        """Take a range of forces or rates as their largest value, if it is the smallest."""
        known: float | None = getattr(self, field)
        most = self.symmetric(field, key, lower, upper)
        setattr(self, field, known if most == math.inf else min(
            most, math.inf if known is None else known))

    def symmetric(self, field: str, key: str, lower: float, upper: float) -> float:
        """Return the bound of a range that holds both ways; infinity if it is one-sided."""
        if not lower < 0.0 < upper:
            self.remarks.append(f'{key} {lower:.6g} {upper:.6g} is one-sided: left out')
            self.without.add(field)
            return math.inf
        if -lower != upper:
            self.remarks.append(f'{key} {lower:.6g} {upper:.6g}: the smaller of both is taken for '
                                'both directions')
        return min(-lower, upper)

    def spring(self, stiffness: float, reference: float, more: str = '') -> None:
        """Add a spring that acts on the joint; reference: its position without force."""
        slides = self.kind == SLIDE
        rate, unit = ('N/m', 'm') if slides else ('N m/rad', 'rad')
        pushes = ''
        if slides and not more:
            force = stiffness * (reference - self.position) + 0.0
            pushes = f', {force:.4g} N at the positions of the file'
        self.springs.append(f'stiffness {stiffness:.6g} {rate} about {reference:.6g} {unit}'
                            f'{more}{pushes}')


@dataclass
class Mechanism:
    """A mechanism with its gravity, and parameters that stewart_describe has added."""

    source: str
    name: str
    parts: dict[str, MechanismBody]
    joints: list[Joint]
    gravity: Array | None = None  # world axes [m/s^2]
    carried: dict[str, CarriedParameter] = field(default_factory=dict)
    """Parameters that stewart_describe has added to the format, by their names."""
    resolution: float = 1e-9  # numbers of the file that differ by a smaller part are equal
    order: tuple[str, ...] = ()  # names of joints in the order of their actuators
    remarks: list[str] = field(default_factory=list)  # assumptions of the reader, one line each
    warnings: list[str] = field(default_factory=list)
    """What acts at rest and has no parameter, one line each."""


class LegJoint(NamedTuple):
    """A joint of a leg, on the way from the base to the platform."""

    joint: Joint
    from_parent: bool  # whether its parent is the body on the side of the base

    @property
    def near(self) -> Array:
        """Return its point on the side of the base [m]."""
        return self._point(self.from_parent)

    @property
    def far(self) -> Array:
        """Return its point on the side of the platform [m]."""
        return self._point(not self.from_parent)

    @property
    def axis(self) -> Array:
        """Return its axis, along or about which the side of the platform moves."""
        return self.joint.axes[0] if self.from_parent else -self.joint.axes[0]

    def _point(self, on_parent: bool) -> Array:
        on_child = self.joint.child_anchor
        return self.joint.anchor if on_parent or on_child is None else on_child


class Chain(NamedTuple):
    """A leg as found."""

    steps: list[LegJoint]
    drive: int  # which step its motor moves
    lower: list[MechanismBody]  # its bodies from the base on
    upper: list[MechanismBody]  # those up to the platform
    places: list[str]  # where the joints are, in words; empty for the drive

    def where(self, n: int) -> str:
        """Return which joint of a leg it is, in words; nothing for the joint of its drive."""
        return f' of its joints at the {self.places[n]}' if self.places[n] else ''

    @property
    def driven(self) -> LegJoint:
        """Return the joint that its motor moves."""
        return self.steps[self.drive]


class JoinedBody(NamedTuple):
    """Several bodies as one, in the axes of a frame."""

    mass: float
    center: Array
    inertia: Array


def joined(parts: Iterable[MechanismBody], frame: Placement) -> JoinedBody:
    """Return several bodies as one, in a frame."""
    heavy = [part for part in parts if part.mass]
    if not heavy:
        return JoinedBody(0.0, np.zeros(3), np.zeros((3, 3)))
    if len(heavy) == 1 and heavy[0].placement is frame:
        return JoinedBody(heavy[0].mass or 0.0, heavy[0].center, heavy[0].inertia)
    masses = np.array([part.mass for part in heavy])
    centers = np.array([frame.inside(part.placement.point(part.center)) for part in heavy])
    center = masses @ centers / masses.sum()
    inertia = np.zeros((3, 3))
    for part, mass, at in zip(heavy, masses, centers, strict=True):
        turn, arm = frame.rotation.T @ part.placement.rotation, at - center
        inertia += turn @ part.inertia @ turn.T + mass * (arm @ arm * np.eye(3)
                                                          - np.outer(arm, arm))
    return JoinedBody(float(masses.sum()), center, inertia)
