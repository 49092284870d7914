# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Measured leg positions at measured poses: residuals, and derivatives by geometry and frames.

A leg's length at a pose is ``|A M c(p) - b|``: its platform joint p, moved from the platform frame
to the frame of the target that the device measures (c), by the measured pose (M) to the device's
frame, and by the device's pose in the base frame (A), less its base joint b. The residual is that
length less the zero length and the measured position. A and c are identities where the device
measures the platform frame in the base frame.

Positions of drives whose screws turn with their legs are ``L + pitch psi`` less the zero length,
with the twist psi of the leg (``turning_screws``): pitch psi is added to the length.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, cross
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.legs.lines import Lines
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import euler_rate_matrix, from_euler
from stewart_dynamics.mechanics.rows import PITCH, SCREW
from stewart_dynamics.parameters.table import Parameters

# Unknowns: base joints leg by leg, platform joints, zero lengths; device in base, platform in
# target: position and angles each.
BASE, PLATFORM, ZERO = slice(0, 18), slice(18, 36), slice(36, 42)
DEVICE, TARGET = slice(42, 48), slice(48, 54)
GEOMETRY, ALL = 42, 54

BASE_JOINTS, PLATFORM_JOINTS, ZERO_LENGTH = (
    'geometry.base_joints', 'geometry.platform_joints', 'geometry.zero_length')


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
    derivatives: Array  # (N, 6, ALL)
    position: Array  # (N, 6, 3): derivatives of the lengths by an error of the measured position
    rotation: Array  # (N, 6, 3): the same by a small turn of the measured pose


class Equations(NamedTuple):
    """
    N measured poses.

    lengths (N, 6): positions of the legs, which are zero at their zero length [m].
    pose: poses (N,) of the target in the device's frame.
    frames: frames that the unknown frames are relative to.
    screws (6, SCREW): pitch, 0 where positions are those of legs, and axes of universal joints.
    """

    lengths: Array
    pose: Pose
    frames: Frames = SAME
    screws: Array = GUIDED

    def part(self, which: Any) -> Equations:
        """Return some of the poses."""
        return self._replace(lengths=self.lengths[which], pose=self.pose[which])

    def at(self, values: Array) -> Linearization:
        """Return residuals and derivatives at values (ALL,) of the unknowns."""
        base, platform = values[BASE].reshape(6, 3), values[PLATFORM].reshape(6, 3)
        frames = self.frames_at(values)
        turn, turned = frames.device.rotation, frames.target.rotation
        in_target = platform @ turned.T
        in_device = self.pose.rotation @ np.swapaxes(in_target + frames.target.position, 0, 1)
        arms = np.swapaxes(in_device, 1, 2)  # from the target's origin, device axes
        of_device = (arms + self.pose.position[:, None]) @ turn.T
        legs = of_device + frames.device.position - base
        sizes = np.linalg.norm(legs, axis=-1)
        s = legs / sizes[..., None]
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
        found = np.zeros((*sizes.shape, ALL))
        for leg in range(6):
            found[:, leg, 3 * leg:3 * leg + 3] = -s[:, leg]
            at = PLATFORM.start + 3 * leg
            found[:, leg, at:at + 3] = s_target[:, leg] @ turned
            found[:, leg, ZERO.start + leg] = -1.0
        found[..., DEVICE] = np.concatenate([
            s, (cross(of_device, s) + moment) @ euler_rate_matrix(values[DEVICE][3:])], axis=-1)
        found[..., TARGET] = np.concatenate([
            s_target, (cross(in_target, s_target) + moment @ to_target
                       ) @ euler_rate_matrix(values[TARGET][3:])], axis=-1)
        return Linearization(sizes - values[ZERO] - self.lengths, found, s,
                             cross(arms @ turn.T, s) + moment)

    def turns(self, values: Array) -> Array:
        """Return the twists of the legs (N, 6) [rad], zero if their axes are not known."""
        pose = self.in_base(self.frames_at(values))
        legs = pose.position[:, None] - values[BASE].reshape(6, 3) + (
            pose.rotation[:, None] @ values[PLATFORM].reshape(6, 3, 1))[..., 0]
        return lagrange.leg_twists(
            legs / np.linalg.norm(legs, axis=-1, keepdims=True), pose.rotation, self.screws)

    def of_legs(self, values: Array) -> Equations:
        """Return the same with positions of the legs where these are of drives."""
        return self._replace(
            lengths=self.lengths - self.screws[:, PITCH] * self.turns(values),
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


def values_of(parameters: Parameters, frames: Frames = SAME) -> Array:
    """Return the values (ALL,) of a parameter file, with positions of frames, angles zero."""
    return np.concatenate([
        parameters.geometry.base_joints.ravel(), parameters.geometry.platform_joints.ravel(),
        np.broadcast_to(parameters.geometry.zero_length, 6),
        *(np.concatenate([each.position, np.zeros(3)]) for each in frames)])


def with_geometry(parameters: Parameters, values: Array) -> Parameters:
    """Return parameters with the geometry of values."""
    return parameters.replaced({
        BASE_JOINTS: values[BASE].tolist(), PLATFORM_JOINTS: values[PLATFORM].tolist(),
        ZERO_LENGTH: values[ZERO].tolist()})


def names_of(parameters: Parameters) -> tuple[str, ...]:
    """Return the names of the geometry's 42 numbers."""
    joints = parameters.joints
    return (*(f'{name}.{joint}.{axis}' for name in (BASE_JOINTS, PLATFORM_JOINTS)
              for joint in joints for axis in 'xyz'),
            *(f'{ZERO_LENGTH}.{joint}' for joint in joints))


def chosen(parameters: Parameters, wanted: str) -> list[int]:
    """
    Return which of the 42 numbers a name means: a number, a joint's, or a whole parameter's.

    ``geometry.`` may be left out. ParameterError if the name means none of them.
    """
    name = wanted.removeprefix('geometry.')
    places = [n for n, each in enumerate(names_of(parameters))
              if f'{each}.'.startswith(f'geometry.{name}.')]
    if not name or not places:
        raise ParameterError(
            f'{wanted}: not a part of the geometry; it has base_joints, platform_joints and '
            'zero_length, with a leg (base_joints.leg_1) and an axis (base_joints.leg_1.z)')
    return places
