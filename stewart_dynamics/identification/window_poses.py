# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Poses and motion of the platform over a window, from positions of the drives and derivatives."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from stewart_dynamics.arrays import Array
from stewart_dynamics.errors import PoseError, SingularityError
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.mechanics.frames.motion import Motion, Pose
from stewart_dynamics.mechanics.kinematics.home_pose import homes
from stewart_dynamics.mechanics.rows import ACCELERATION, MOTION, POSE, TWIST
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform

# Stride of the poses that are computed in sequence; they are the guesses of the others.
_STRIDE = 32
# Rotations about z that are tried, platform axes parallel to base axes first [rad].
_TURNS = (0.0, 0.3, -0.3, 0.6, -0.6)


def pose_near(platform: StewartPlatform, measured: Array) -> Pose:
    """
    Return the pose of positions (6,), starting from home and level poses on both sides.

    Raises the errors of ``forward_kinematics`` if it converges from none of them.
    """
    p, kind = platform.parameters, platform.parameters.leg_kind
    positions, rotations = homes(p)  # both sides of the base, the more likely one first
    guesses = [Pose(*each) for each in zip(positions, rotations, strict=True)]
    anchors, lengths = kind.anchors(p, measured), kind.line_lengths(p, measured)
    across = p.geometry.platform_joints - (
        p.geometry.base_joints if anchors is None else anchors)
    level = float(np.mean(lengths ** 2 - np.sum(across[:, :2] ** 2, axis=1)))
    height = np.sqrt(max(level, (0.1 * float(lengths.mean())) ** 2))
    side = 1.0 if positions[0, 2] >= 0.0 else -1.0
    guesses += [Pose.from_euler([0.0, 0.0, up * height - across[:, 2].mean()], [0.0, 0.0, turn])
                for up in (side, -side) for turn in _TURNS]
    for guess in guesses[:-1]:
        with suppress(PoseError, SingularityError):
            return platform.forward_kinematics(measured, guess)
    return platform.forward_kinematics(measured, guesses[-1])


def first_pose(platform: StewartPlatform, window: Window) -> Pose:
    """Return the pose at the begin of a window; raises the errors of ``pose_near``."""
    return pose_near(
        platform, window.positions[0] + platform.parameters.geometry.zero_length)


def poses(platform: StewartPlatform, positions: Array, guess: Pose, stride: int = _STRIDE,
          ) -> Pose:
    """
    Return the poses of positions of the drives (N, 6) that change little between samples.

    ``guess`` is near the first one; only every ``stride``-th is found from the one before. Raises
    the errors of ``forward_kinematics``.
    """
    anchors = []
    for each in positions[::stride]:
        guess = platform.forward_kinematics(each, guess)
        anchors.append(guess.rows)
    nearest = np.minimum((np.arange(len(positions)) + stride // 2) // stride, len(anchors) - 1)
    return platform.forward_kinematics(positions, Pose.of_rows(np.array(anchors)[nearest]))


def motions(platform: StewartPlatform, poses: Pose, rates: Array, accelerations: Array) -> Array:
    """
    Return rows of motion (N, MOTION) for poses, rates and accelerations of positions (N, 6).

    ``J X' = q'`` and ``J X'' = q'' - J' X'`` with J = ``position_jacobian``, q lengths or angles.
    """
    rows = np.zeros((len(poses.rows), MOTION))
    rows[:, POSE] = poses.rows[:, POSE]
    jacobian = platform.position_jacobian(poses)
    rows[:, TWIST] = np.linalg.solve(jacobian, rates[..., None])[..., 0]
    drift = platform.position_jacobian_rate(Motion.of_rows(rows)) @ rows[:, TWIST, None]
    rows[:, ACCELERATION] = np.linalg.solve(
        jacobian, accelerations[..., None] - drift)[..., 0]
    return rows
