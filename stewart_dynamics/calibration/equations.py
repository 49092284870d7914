# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Measured positions of drives at measured poses: residuals, derivatives by geometry and frames.

The platform joint of a leg is at ``A M c(p)``: p, moved from the platform frame to the frame of
the target that the device measures (c), by the measured pose (M) to the device's frame, and by the
device's pose in the base frame (A). A and c are identities where the device measures the platform
frame in the base frame. The residual is the length of the line of the leg to there, less the
length that it has by the position of its drive (``legs.calibrated``): of a telescopic leg from the
base joint, less zero length and position.

Positions of drives whose screws turn with their legs are ``L + pitch psi`` less the zero length,
with the twist psi of the leg (``turning_screws``): pitch psi is added to the length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, cross, Flags
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.calibrated import ALL_GROUPS, CalibratedLegs, listed_groups
from stewart_dynamics.legs.lines import Lines
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import euler_rate_matrix, from_euler
from stewart_dynamics.mechanics.rows import PITCH, SCREW
from stewart_dynamics.parameters.table import Parameters

# Unknowns: base joints leg by leg, platform joints, numbers of the kind of legs; device in base,
# platform in target: position and angles each.
BASE, PLATFORM = slice(0, 18), slice(18, 36)
DEVICE, TARGET = slice(-12, -6), slice(-6, None)
GEOMETRY, FRAMES = slice(0, -12), 12


class Frames(NamedTuple):
    """Poses of the device in the base frame and of the platform frame in the target's frame."""

    device: Pose
    target: Pose


SAME = Frames(*2 * [Pose(np.zeros(3), np.eye(3))])
"""The device measures the platform frame in the base frame."""


# Positions of the legs themselves, with axes of universal joints that are not known.
GUIDED = np.zeros((6, SCREW))
_WITHOUT_PITCH = np.arange(SCREW) != PITCH


class Linearization(NamedTuple):
    """N poses with the geometry of some values."""

    residuals: Array  # (N, 6) [m]
    derivatives: Array  # (N, 6, n), n: geometry and frames
    drives: Array  # (N, 6): by the measured positions of the drives
    position: Array  # (N, 6, 3): by an error of the measured position
    rotation: Array  # (N, 6, 3): the same by a small turn of the measured pose

    @property
    def lever(self) -> float:
        """Return the change of a residual by that of a drive, the median of all."""
        return float(np.median(np.abs(self.drives)))


class Equations(NamedTuple):
    """
    N measured poses.

    legs: of the file.
    positions (N, 6): of the drives; of telescopic legs zero at their zero length [m].
    pose: poses (N,) of the target in the device's frame.
    frames: frames that the unknown frames are relative to.
    screws (6, SCREW): pitch, 0 where positions are those of legs, and axes of universal joints.
    """

    legs: CalibratedLegs
    positions: Array
    pose: Pose
    frames: Frames = SAME
    screws: Array = GUIDED

    def part(self, which: Any) -> Equations:
        """Return some of the poses."""
        return self._replace(positions=self.positions[which], pose=self.pose[which])

    def at(self, values: Array) -> Linearization:
        """Return residuals and derivatives at values (n,) of the unknowns."""
        base, platform = values[BASE].reshape(6, 3), values[PLATFORM].reshape(6, 3)
        frames = self.frames_at(values)
        turn, turned = frames.device.rotation, frames.target.rotation
        in_target = platform @ turned.T
        in_device = self.pose.rotation @ np.swapaxes(in_target + frames.target.position, 0, 1)
        arms = np.swapaxes(in_device, 1, 2)  # from the target's origin, device axes
        of_device = (arms + self.pose.position[:, None]) @ turn.T
        at = self.legs.lines(values, of_device + frames.device.position - base, self.positions)
        sizes, s = at.lengths, at.directions
        to_target = turn @ self.pose.rotation
        moment = np.zeros_like(s)  # by a turn of the platform, beside that of s
        if self.screws[:, PITCH].any():
            rotation = to_target @ turned
            arms_of_platform = platform @ np.swapaxes(rotation, 1, 2)
            of_drives = lagrange.drive_jacobian(
                Lines(sizes, s, arms_of_platform), rotation, self.screws)
            sizes = sizes + self.screws[:, PITCH] * self.turns(values)
            s = of_drives[..., :3]
            moment = of_drives[..., 3:] - cross(arms_of_platform, s)
        s_target = s @ to_target
        found = np.zeros((*sizes.shape, len(values)))
        for leg in range(6):
            columns = self.legs.columns(leg)
            found[:, leg, columns[:3]] = -s[:, leg]
            found[:, leg, columns[3:6]] = s_target[:, leg] @ turned
            found[:, leg, columns[6:]] = at.own[:, leg]
        found[..., DEVICE] = np.concatenate([
            s, (cross(of_device, s) + moment) @ euler_rate_matrix(values[DEVICE][3:])], axis=-1)
        found[..., TARGET] = np.concatenate([
            s_target, (cross(in_target, s_target) + moment @ to_target
                       ) @ euler_rate_matrix(values[TARGET][3:])], axis=-1)
        return Linearization(self.legs.misses(sizes, values, self.positions), found, at.drives, s,
                             cross(arms @ turn.T, s) + moment)

    def vectors(self, values: Array) -> Array:
        """Return the lines from base joints to platform joints (N, 6, 3) [m]."""
        pose = self.in_base(self.frames_at(values))
        return np.asarray(pose.position[:, None] - values[BASE].reshape(6, 3) + (
            pose.rotation[:, None] @ values[PLATFORM].reshape(6, 3, 1))[..., 0])

    def turns(self, values: Array) -> Array:
        """Return the twists of the legs (N, 6) [rad], zero if their axes are not known."""
        legs = self.vectors(values)
        return lagrange.leg_twists(
            legs / np.linalg.norm(legs, axis=-1, keepdims=True),
            self.in_base(self.frames_at(values)).rotation, self.screws)

    def of_legs(self, values: Array) -> Equations:
        """Return the same with positions of the legs where these are of drives."""
        return self._replace(
            positions=self.positions - self.screws[:, PITCH] * self.turns(values),
            screws=self.screws * _WITHOUT_PITCH)

    def frames_at(self, values: Array) -> Frames:
        """Return the frames of values of the unknowns."""
        return Frames(*(Pose(values[part][:3], from_euler(values[part][3:]) @ known.rotation)
                        for part, known in zip((DEVICE, TARGET), self.frames, strict=True)))

    def in_base(self, frames: Frames) -> Pose:
        """Return the measured poses of the platform frame in the base frame."""
        return product(product(frames.device, self.pose), frames.target)

    def as_measured(self, platform: Pose, frames: Frames) -> Pose:
        """Return poses of the platform frame in the base frame as the device would measure."""
        return product(product(inverse(frames.device), platform), inverse(frames.target))


def product(first: Pose, second: Pose) -> Pose:
    """Return the pose of the second's frame, which is given in the first's frame."""
    return Pose(first.position + (first.rotation @ second.position[..., None])[..., 0],
                first.rotation @ second.rotation)


def inverse(pose: Pose) -> Pose:
    """Return the pose of the reference frame in the pose's frame."""
    back = np.swapaxes(pose.rotation, -1, -2)
    return Pose(-(back @ pose.position[..., None])[..., 0], back)


def values_of(legs: CalibratedLegs, frames: Frames = SAME) -> Array:
    """Return the values (n,) of a parameter file, with positions of frames, angles zero."""
    return np.concatenate([legs.values(), *(
        np.concatenate([each.position, np.zeros(3)]) for each in frames)])


def with_geometry(legs: CalibratedLegs, values: Array, held: Flags | None = None,
                  written: bool = False) -> Parameters:
    """
    Return the parameters of the file with the geometry of values, frames included or not.

    held, written: as ``CalibratedLegs.changes`` takes them; by default all numbers are changed,
    and measured positions keep their meaning.
    """
    which = np.zeros(legs.count, dtype=bool) if held is None else held
    return legs.parameters.replaced(legs.changes(values, which, written))


def chosen(legs: CalibratedLegs, wanted: str) -> list[int]:
    """
    Return which numbers of the geometry a name means: a number, a leg's, or a whole parameter's.

    ``geometry.`` and ``legs.`` may be left out. ParameterError if the name means none of them.
    """
    places = [n for n, each in enumerate(legs.names()) if any(
        f'{each}.'.startswith(f'{group}{wanted}.') for group in ('', 'geometry.', 'legs.'))]
    if not wanted or not places:
        parts = [each.name.removeprefix('geometry.') for each in legs.calibrated]
        raise ParameterError(
            f'{wanted}: not a part of the geometry; it has {", ".join(parts[:-1])} and '
            f'{parts[-1]}, with a leg (base_joints.leg_1) and an axis (base_joints.leg_1.z)')
    return places


def held_by_groups(legs: CalibratedLegs, groups: Sequence[str]) -> Flags:
    """
    Return which numbers of the geometry (n,) are in none of the groups of unknowns.

    ParameterError if the legs have no such group.
    """
    for name in groups:
        if name not in (*legs.groups, ALL_GROUPS):
            raise ParameterError(f'unknowns: {name}: must be one of {listed_groups(legs)}')
    held: Flags = np.ones(legs.count, dtype=bool)
    for each in legs.calibrated:
        if {each.group, ALL_GROUPS} & set(groups):
            held[legs.parts[each.name]] = False
    return held
