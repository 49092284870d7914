# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Poses of measured legs, and the frames of a device that measures other frames than the hexapod's.

The frames are found in two steps from the poses that the file's geometry gives for the measured
legs: rotations by a singular value decomposition, positions by linear least squares (Shah,
"Solving the robot-world/hand-eye calibration problem using the Kronecker product", J. Mechanisms
and Robotics 5(3), 2013, doi:10.1115/1.4024473). Least squares with the geometry begin there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.calibration.equations import Equations, Frames
from stewart_dynamics.errors import PoseError, SingularityError, StewartError
from stewart_dynamics.mechanics.frames.motion import Pose
from stewart_dynamics.mechanics.frames.rotation import to_quaternion
from stewart_dynamics.mechanics.stewart_platform import StewartPlatform
from stewart_dynamics.parameters.table import Parameters

# Minimum number of poses whose legs have a pose by the file's geometry.
_FEWEST = 4
# Largest singular value of the mean rotation of poses that determine the frames.
_ONE_AXIS = 1.0 - 1e-6


class PoseErrors(NamedTuple):
    """Differences of N poses: computed from leg positions, and measured."""

    position: Array  # (N,) [m]; nan where no pose has the leg positions
    rotation: Array  # (N,) [rad]

    @property
    def known(self) -> bool:
        """Return whether a pose has the leg positions, in one case at least."""
        return bool(np.isfinite(self.position).any())

    @property
    def rms(self) -> tuple[float, float]:
        """Return both as root mean squares."""
        return tuple(float(np.sqrt(np.nanmean(each ** 2))) for each in self)  # type: ignore

    @property
    def largest(self) -> tuple[float, float]:
        """Return the largest of both."""
        return float(np.nanmax(self.position)), float(np.nanmax(self.rotation))


def pose_errors(parameters: Parameters, equations: Equations, frames: Frames) -> PoseErrors:
    """Return how far forward kinematics of the measured legs is from the measured poses."""
    found, solved = poses_of(parameters, equations.positions, equations.in_base(frames))
    computed, measured = equations.as_measured(found, frames), equations.pose
    turn = np.swapaxes(measured.rotation, 1, 2) @ computed.rotation
    angles = 2.0 * np.arcsin(np.minimum(np.linalg.norm(to_quaternion(turn)[:, :3], axis=1), 1.0))
    distances = np.linalg.norm(computed.position - measured.position, axis=1)
    return PoseErrors(*(np.where(solved, each, np.nan) for each in (distances, angles)))


def poses_of(parameters: Parameters, positions: Array, guess: Pose) -> tuple[Pose, Flags]:
    """Return the poses (N,) of measured positions (N, 6), and where one exists; else the guess."""
    platform = StewartPlatform(parameters)
    given = parameters.leg_kind.calibrated_legs(parameters).drive_positions(positions)
    rows = np.array(np.broadcast_to(guess.rows, (len(given), guess.rows.shape[-1])))
    try:
        return platform.forward_kinematics(given, guess), np.ones(len(given), dtype=bool)
    except (PoseError, SingularityError):
        pass
    solved = np.zeros(len(given), dtype=bool)
    for n, each in enumerate(given):
        try:
            rows[n] = platform.forward_kinematics(each, Pose.of_rows(rows[n])).rows
            solved[n] = True
        except (PoseError, SingularityError):
            continue
    return Pose.of_rows(rows), solved


def find_frames(parameters: Parameters, equations: Equations) -> Frames:
    """
    Return the device's frame in the base frame, and the platform frame in the target's.

    StewartError if they are not determined, or if most of the measured legs have no pose.
    """
    if np.linalg.svd(equations.pose.rotation.mean(axis=0), compute_uv=False)[0] > _ONE_AXIS:
        raise StewartError('poses must be turned about two axes or more, or the frames of the '
                           'device are not determined')
    found, solved = poses_of(
        parameters, equations.positions, StewartPlatform(parameters).home_pose())
    if np.count_nonzero(solved) < _FEWEST:
        raise StewartError(
            'the measured leg positions belong to no pose of this hexapod in '
            f'{np.sum(~solved)} of {len(solved)} cases: the frames of the device are not found')
    found, measured = found[solved], equations.pose[solved]
    # A M c = T: R_A R_M = R_T R_c^T, linear in the numbers of R_A and R_c.
    pairs = np.einsum('nab,ncd->acbd', measured.rotation, found.rotation).reshape(9, 9)
    left, _, right = np.linalg.svd(pairs)
    of_device, of_target = left[:, 0].reshape(3, 3), right[0].reshape(3, 3)
    turns = []
    for each in (of_device.T, of_target):
        u, _, v = np.linalg.svd(each * np.sign(np.linalg.det(each)))
        turns.append(u @ v)
    device, target = turns
    rotated = device @ measured.rotation
    rows = np.concatenate([rotated, np.broadcast_to(np.eye(3), rotated.shape)], axis=2)
    wanted = found.position - measured.position @ device.T
    positions, *_ = np.linalg.lstsq(rows.reshape(-1, 6), wanted.ravel(), rcond=None)
    return Frames(Pose(positions[3:], device), Pose(positions[:3], target))
