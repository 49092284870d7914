# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Enclosures of the limited quantities over cells, compared with poses of the cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import rng, size_of
from scipy.spatial.transform import Rotation
from stewart_dynamics import Capability, Motion, Pose, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.intervals import Enclosure
from stewart_dynamics.capability.quantities import Moved, starts_at
from stewart_dynamics.mechanics.kinematics.leg_clearance import LegClearance
from test_leg_clearance import near

OPERATIONS = {
    'sum': lambda a, b: a + b, 'difference': lambda a, b: a - b, 'product': lambda a, b: a * b,
    'scaled': lambda a, b: 1.0 - 3.0 * a, 'square': lambda a, b: a.square(),
    'root': lambda a, b: a.sqrt(), 'inverse': lambda a, b: b.inverse()}
EXACT = OPERATIONS | {'square': lambda a, b: a * a, 'root': lambda a, b: np.sqrt(a),
                      'inverse': lambda a, b: 1.0 / b}


@pytest.mark.parametrize('name', OPERATIONS)
def test_an_operation_contains_the_results_of_all_numbers(name: str) -> None:
    random = rng()
    a, b = (Enclosure(random.uniform(1.0, 2.0, 500), random.uniform(-0.2, 0.2, (3, 500)),
                      random.uniform(0.0, 0.3, 500)) for _ in range(2))
    found: Any = OPERATIONS[name](a, b)
    for _ in range(200):
        x = random.uniform(-1.0, 1.0, 3) if random.random() < 0.5 else random.choice([-1, 1], 3)
        numbers = [each.center + x @ each.slopes + random.choice([-1, 1]) * each.rest
                   for each in (a, b)]
        off = EXACT[name](*numbers) - (found.center + x @ found.slopes)
        assert (np.abs(off) <= found.rest + 1e-15).all()


def margins_of(platform: StewartPlatform, poses: Pose) -> dict[str, Array]:
    """Return margins at poses, by the library."""
    p = platform.parameters
    lengths = platform.inverse_kinematics(poses)
    found = {'Lengths': 1.0 - (lengths / p['limits.length_max']) ** 2}
    found['Angles'] = np.cos(platform.joint_angles(poses)[0]) - np.cos(
        p['limits.base_joint_angle_max'])
    solved = platform.inverse_dynamics(Motion.from_pose(poses), singular='nan')
    found['Conditioning'] = 1.0 - (
        solved.condition_number / p['singularity.stop_condition'])[:, None]
    found['Clearance'] = (LegClearance(p)(Motion.from_pose(poses).rows).min(axis=1)
                          - p['limits.leg_clearance_min'])[:, None] / p[
                              'singularity.characteristic_length']
    return found


@pytest.mark.parametrize('seed', range(12))
def test_margins_over_a_cell_are_no_larger_than_those_of_its_poses(seed: int) -> None:
    platform, pose, random = near(seed)
    lines = pose.position + platform.parameters['geometry.platform_joints'] @ (
        pose.rotation.T) - platform.parameters['geometry.base_joints']
    platform = StewartPlatform(platform.parameters.replaced({
        'geometry.base_joint_axes': lines / np.linalg.norm(lines, axis=1)[:, None],
        'geometry.platform_joint_axes': np.tile([0.0, 0.0, 1.0], 6),
        'limits.base_joint_angle_max': 0.5, 'singularity.stop_condition': 30.0,
        'singularity.warn_condition': 30.0}))
    capability, size = Capability(platform), size_of(platform.parameters)
    pivot = size * random.uniform(-0.3, 0.3, 3)
    starts = starts_at(platform.parameters, capability._axes, capability._plates,
                       pose.rows[None], pivot[None])
    known = 0
    for width in 10.0 ** random.uniform(-4.0, -1.0, 20):
        count = random.choice([1, 6])
        points = random.uniform(-0.1, 0.1, (1, 6)) * [*[size] * 3, 1.0, 1.0, 1.0]
        edges = np.zeros((count, 1, 6))
        if count == 1:  # a travel turns about one axis
            edges[0] = width * points
        else:
            edges[np.arange(6), 0, np.arange(6)] = width * np.array([*[size] * 3, 1.0, 1.0, 1.0])
        x = random.choice([-1.0, 1.0], (50, count)) * random.choice([1.0, 0.5], (50, 1))
        at = points + x @ edges[:, 0]
        rotations = Rotation.from_rotvec(at[:, 3:]).as_matrix() @ pose.rotation
        exact = margins_of(platform, Pose(
            pose.position + pose.rotation @ pivot + at[:, :3] - rotations @ pivot, rotations))
        for quantity in capability._margins.given:
            with np.errstate(all='ignore'):
                found = quantity.margins(Moved(starts, points, edges))
            bounds = found.center[0] + x @ found.slopes[:, 0] - found.rest[0]
            if not np.isfinite(bounds).all():
                continue
            name = type(quantity).__name__
            bounds = bounds if name in ('Lengths', 'Angles') else bounds.min(axis=1)[:, None]
            assert (bounds <= exact[name] + 1e-12).all(), name
            known += 1
    assert known > 40
