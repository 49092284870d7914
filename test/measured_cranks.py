# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Measured poses of hexapods with cranks, by a forward kinematics that the package does not have.

The pose of six angles is the root of the six loop equations ``|t + R p - A(q)| = L2``, by
scipy's least squares; the end A of a crank is that of rotation vectors, by scipy's rotations.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.arrays import Array

ANGLE_NOISE = math.radians(0.2)  # of each measured angle
POSITION_NOISE = 0.003  # of each coordinate of a measured position, by the length of a crank
# Deviations of a hexapod from its drawing: angles [rad], lengths and joints by the crank's length.
ZERO, AXIS, LENGTH, JOINT = math.radians(2.0), math.radians(1.0), 0.01, 0.01
LEVER = 0.15  # smallest lever of a pose, by the length of its crank


class Built:
    """
    A hexapod with cranks as it was built.

    platform: of the drawing. The numbers of the six legs: centers, joints (6, 3) and cranks, rods
    (6,) [m], turns about the axis of each motor (6,) and of that axis (6, 3), base axes [rad].
    """

    def __init__(self, parameters: Parameters) -> None:
        self.platform = StewartPlatform(parameters)
        p = self.platform.parameters
        self.centers = p.geometry.base_joints.copy()
        self.joints = p.geometry.platform_joints.copy()
        self.cranks = np.array(np.broadcast_to(p['legs.crank.length'], 6))
        self.rods = np.array(np.broadcast_to(p['legs.rod.length'], 6))
        self.turns, self.tilts = np.zeros(6), np.zeros((6, 3))
        self.size = float(self.cranks.mean())
        self.axes, self.zeros = (p[f'geometry.crank_{name}'] / np.linalg.norm(
            p[f'geometry.crank_{name}'], axis=1)[:, None] for name in ('axes', 'directions'))

    def deviate(self, rng: np.random.Generator, groups: tuple[str, ...]) -> Built:
        """Let the numbers of some groups differ from the drawing; return the hexapod."""
        if 'zero' in groups:
            self.turns = rng.normal(0.0, ZERO, 6)
        if 'axes' in groups:
            across = np.cross(self.axes, self.zeros)
            first, second = rng.normal(0.0, AXIS, (2, 6, 1))
            self.tilts = first * self.zeros + second * across
        if 'lengths' in groups:
            self.cranks += LENGTH * self.size * rng.normal(size=6)
            self.rods += LENGTH * self.size * rng.normal(size=6)
        if 'joints' in groups:
            self.centers += JOINT * self.size * rng.normal(size=(6, 3))
            self.joints += JOINT * self.size * rng.normal(size=(6, 3))
        return self

    def ends(self, angles: Array) -> Array:
        """Return the ends of the cranks (6, 3) at six angles."""
        turned = Rotation.from_rotvec((angles + self.turns)[:, None] * self.axes)
        along = Rotation.from_rotvec(self.tilts).apply(turned.apply(self.zeros))
        ends: Array = self.centers + self.cranks[:, None] * along
        return ends

    def pose(self, angles: Array, near: Pose) -> Pose:
        """Return the pose at six angles."""
        ends, size = self.ends(angles), self.size

        def at(step: Array) -> tuple[Array, Array]:
            return (near.position + size * step[:3],
                    Rotation.from_rotvec(step[3:]).as_matrix() @ near.rotation)

        def misses(step: Array) -> Array:
            position, rotation = at(step)
            rods = position + self.joints @ rotation.T - ends
            found: Array = (np.linalg.norm(rods, axis=1) - self.rods) / size
            return found

        found = least_squares(misses, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(found.fun).max() < 1e-12
        return Pose(*at(found.x))

    def values(self) -> Array:
        """Return the numbers in the order of a calibration."""
        across = np.cross(self.axes, self.zeros)
        tilts = np.stack([np.sum(self.tilts * each, axis=1) for each in (
            self.zeros, across)], axis=1)
        return np.concatenate([self.centers.ravel(), self.joints.ravel(), self.turns,
                               tilts.ravel(), self.cranks, self.rods])

    def commands(self, rng: np.random.Generator, count: int, travel: float = 0.7,
                 tilt: float = 0.35) -> tuple[Array, Pose]:
        """Return angles of random poses of the drawing (count, 6), and these poses."""
        home, rows = self.platform.home_pose(), []
        lever = self.platform.parameters['legs.crank.length']
        while len(rows) < count:
            step = rng.uniform(-1.0, 1.0, 6)
            pose = Pose(home.position + travel * self.size * step[:3],
                        Rotation.from_rotvec(tilt * step[3:]).as_matrix() @ home.rotation)
            result = self.platform.inverse_dynamics(Motion.from_pose(pose), singular='nan')
            if np.isfinite(result.angles).all() and (
                    np.abs(result.levers) > LEVER * lever).all():
                rows.append(pose.rows)
        poses = Pose.of_rows(np.array(rows))
        return self.platform.inverse_kinematics(poses), poses

    def measure(self, rng: np.random.Generator, count: int, noise: float = 1.0,
                **motion: float) -> tuple[Array, Pose]:
        """Return measured angles (count, 6) and poses; noise: factor of the usual noise."""
        angles, wanted = self.commands(rng, count, **motion)
        true = [self.pose(each, near) for each, near in zip(angles, wanted, strict=True)]
        reach = self.platform.parameters.singularity.characteristic_length
        turns = rng.normal(0.0, noise * POSITION_NOISE * self.size / reach, (count, 3))
        return angles + rng.normal(0.0, noise * ANGLE_NOISE, (count, 6)), Pose(
            np.array([each.position for each in true]) + rng.normal(
                0.0, noise * POSITION_NOISE * self.size, (count, 3)),
            Rotation.from_rotvec(turns).as_matrix() @ np.array([each.rotation for each in true]))
