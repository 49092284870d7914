# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The hexapod of a datasheet: with its payload, its platform frame at the pivot, at a pose."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.capability import Capability, Extent
from stewart_dynamics.capability.reachable import Reachable
from stewart_dynamics.capability.workspace import Section
from stewart_dynamics.errors import ParameterError, PoseError, SingularityError
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.dynamics.linear_parameters import with_point_mass
from stewart_dynamics.mechanics.frames.motion import motion_rows, Pose
from stewart_dynamics.mechanics.frames.rotation import from_rotation_vector, to_quaternion
from stewart_dynamics.mechanics.limits import limits_of
from stewart_dynamics.mechanics.pose_limits import PoseLimits
from stewart_dynamics.mechanics.rows import CONDITION
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.mechanics.stiffness import held_motors
from stewart_dynamics.parameters.table import LEG_SHAPE, Parameters, PLATFORM_OUTLINE
from stewart_dynamics.planned.interpolation import rotation_vector


# Displacements below it are rounding errors [m, rad].
_ROUNDING = 1e-12


class Payload(NamedTuple):
    """A point mass on the platform."""

    mass: float  # [kg]
    center_of_mass: Array  # (3,) platform frame [m]


class RatedHexapod:
    """
    A hexapod at the pose for which it is rated.

    Poses are those of the pivot: travels are of it, rotations about it, and forces act on it. The
    singularity of a pose is judged at the origin of the platform frame, as in the node.

    pose: pose of the platform frame; by default home.
    pivot (3,): pivot, platform frame [m]; by default its origin.
    payload: mass that is added to the platform.

    given: parameters with the payload.
    platform: with the payload, and the origin of the platform frame at the pivot.
    loads: capability of that platform, for rates and loads.
    origin, pose: pose of the platform frame as given, and of the pivot.

    Raises StewartError: no limit is given, or the pose is outside the limits or singular.
    """

    def __init__(self, parameters: Parameters, pose: Pose | None = None,
                 pivot: Array | None = None, payload: Payload | None = None) -> None:
        known = limits_of(parameters).legs
        if all(parameters[name] is None for name in known):
            raise ParameterError(f'parameters: {", ".join(known)}: none of them is set: without '
                                 'a limit there is no datasheet')
        self.pivot = np.zeros(3) if pivot is None else np.asarray(pivot, dtype=float)
        self.given = parameters if payload is None else with_point_mass(
            parameters, payload.mass, payload.center_of_mass)
        whole = StewartPlatform(self.given)
        self.origin = whole.home_pose() if pose is None else pose
        self._limits = Capability(whole)
        self.platform = StewartPlatform(_moved(self.given, self.pivot))
        self.loads = Capability(self.platform)
        self.pose = Pose(self.origin.position + self.origin.rotation @ self.pivot,
                         self.origin.rotation)
        self._check(whole, self.origin)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the legs."""
        names: tuple[str, ...] = self.given['joints']
        return names

    @property
    def has_sections(self) -> bool:
        """Return whether sections of the workspace end on all sides."""
        p = self.given
        return p.limits.length_max is not None or p.leg_kind.anchor_circles(p) is not None

    def travel(self, poses: Pose, directions: Array) -> Extent:
        """Return ``Capability.travel`` from poses of the pivot."""
        origins = Pose(poses.position - poses.rotation @ self.pivot, poses.rotation)
        return self._limits.travel(origins, directions, self.pivot)

    def reachable(self, ranges: Array) -> Reachable:
        """Return ``Capability.reachable`` of ranges (6, 2) from the pose."""
        return self._limits.reachable(ranges, self.origin, self.pivot)

    def reachable_factor(self, ranges: Array) -> Extent:
        """Return ``Capability.reachable_factor`` of ranges (6, 2) from the pose."""
        return self._limits.reachable_factor(ranges, self.origin, self.pivot)

    def section(self, normal: str) -> Section:
        """Return ``Capability.section`` through the pose."""
        return self._limits.section(self.origin, normal)

    @cached_property
    def _held(self) -> Capability:
        return Capability(StewartPlatform(self.platform.parameters.replaced(
            held_motors(self.given))))

    def frequencies(self, poses: Pose, leg_stiffness: float) -> Array:
        """
        Return (..., 6) natural frequencies [Hz] at poses of the pivot, with held motors.

        A leg's stiffness is between its motor and the platform, so rotors stand still.
        """
        return self._held.modes(poses, leg_stiffness).frequencies

    def moved_by(self, direction: Array, by: float = 1.0) -> Pose:
        """Return the pose after a translation and a rotation vector (6,), base axes."""
        rotation = from_rotation_vector(by * direction[3:]) @ self.pose.rotation
        return Pose(self.pose.position + by * direction[:3], rotation)

    def clearance(self) -> float | None:
        """Return the clearance between the legs at the pose [m]; None without their radii."""
        if any(self.given[name] is None for name in LEG_SHAPE):
            return None
        return float(self._limits.clearance(self.origin))

    def displacement(self, pose: Pose) -> Array:
        """Return translation and rotation vector (6,), base axes, to a pose of the pivot."""
        turn = rotation_vector(*(to_quaternion(each.rotation[None]) for each in (self.pose, pose)))
        moved = np.append(pose.position - self.pose.position, turn)
        moved[np.abs(moved) < _ROUNDING] = 0.0
        return moved

    def _check(self, whole: StewartPlatform, pose: Pose) -> None:
        """Raise where a limit is exceeded at the pose already."""
        known, motions = PoseLimits(self.given), motion_rows(pose)
        results = whole.solve(motions)
        batch.find_unreachable(whole.structure, self.joints, motions, results, ())
        condition, stop = float(results[0, CONDITION]), known.stop_condition
        if not condition < stop:
            raise SingularityError(
                f'pose: singular: the condition number of J_inv is {condition:.6g}, '
                f'must be less than singularity.stop_condition, {stop:g}')
        exceeded = known.first_exceeded(motions[0], results[0])
        if exceeded is not None:
            raise PoseError(f'pose: {exceeded.words(self.joints)}')


def _moved(p: Parameters, pivot: Array) -> Parameters:
    """Return the parameters with the platform frame at the pivot."""
    if not pivot.any():
        return p
    outline = p.geometry.platform_outline
    return p.replaced({
        'geometry.platform_joints': p.geometry.platform_joints - pivot,
        PLATFORM_OUTLINE: None if outline is None else outline - pivot,
        'platform.center_of_mass': p.platform.center_of_mass - pivot,
        'payload.center_of_mass': p.payload.center_of_mass - pivot,
        'singularity.characteristic_length': p.singularity.characteristic_length})
