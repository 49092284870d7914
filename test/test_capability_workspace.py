# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Sections, tilt and smallest values of the workspace, against single poses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import rng, rotation_about, size_of
from stewart_dynamics import (
    Capability, Motion, MotionError, ParameterError, Parameters, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array, Flags
from test_capability_boxes import case, excesses, outside, PLATFORM, poses_in


def inside(loops: tuple[Array, ...], points: Array, i: int, j: int) -> tuple[Flags, Array]:
    """Return which points (N, 3) loops enclose an odd number of times, and their distances."""
    found, distance = np.zeros(len(points), dtype=bool), np.full(len(points), np.inf)
    for loop in loops:
        for a, b in zip(loop[:-1, [i, j]], loop[1:, [i, j]], strict=True):
            p = points[:, [i, j]]
            spans = (a[1] > p[:, 1]) != (b[1] > p[:, 1])
            with np.errstate(all='ignore'):
                x = a[0] + (p[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            found ^= spans & (p[:, 0] < x)
            along = np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0.0, 1.0)
            distance = np.minimum(distance, np.linalg.norm(
                p - a - along[:, None] * (b - a), axis=1))
    return found, distance


def stop_of(platform: StewartPlatform) -> float:
    return float(platform.parameters['singularity.stop_condition'])


@pytest.mark.parametrize('seed', [None, 0, 1, 4, 5, 8, 9])
@pytest.mark.parametrize('normal', ['z', 'y'])
def test_a_section_encloses_the_positions_within_the_limits(seed: int | None, normal: str) -> None:
    platform, pose = (PLATFORM, PLATFORM.home_pose()) if seed is None else case(seed)[:2]
    if seed is not None and seed % 8 == 0:  # a part ends at a singularity
        stop = 1.5 * platform.inverse_dynamics(Motion.from_pose(pose)).condition_number
        platform = StewartPlatform(platform.parameters.replaced({
            'singularity.stop_condition': stop, 'singularity.warn_condition': stop}))
    size, n = size_of(platform.parameters), 'xyz'.index(normal)
    i, j = (k for k in range(3) if k != n)
    found = Capability(platform).section(pose, normal)
    side = platform.inverse_dynamics(Motion.from_pose(pose)).determinant
    points = pose.position + rng().uniform(-1.0, 1.0, (3000, 3)) * size
    points[:, n] = pose.position[n]
    good = ~outside(platform, excesses(platform, Pose(points, pose.rotation), side))
    enclosed, distance = inside(found.loops, points, i, j)
    clear = distance > (0.02 if seed is not None and seed % 8 == 0 else 2e-3) * size
    np.testing.assert_array_equal(enclosed[clear], good[clear])
    assert good[clear].any()
    for part in found.boundary:
        on = excesses(platform, Pose(part.points, pose.rotation), side)
        for name, excess in on.items():  # limits have a tolerance
            singular = name == 'singularity'
            assert excess.max() < (1e-3 * stop_of(platform) if singular else 1e-8 * size)
        if part.limit != 'singularity':
            assert np.abs(on[part.limit][:, part.leg]).max() < 1e-9 * size


@pytest.mark.parametrize('offset', [0.0, 1e-6, -0.05, 0.01, 0.1])
def test_parts_of_a_section_meet_where_a_joint_angle_cuts_a_corner(offset: float) -> None:
    base, joints = (np.array([[x, y, z], [x, -y, z]]) for x, y, z in (
        (0.72, 0.10, 0.05), (0.25, 0.30, -0.08)))
    turns = [rotation_about(np.array([0.0, 0.0, 1.0]), n * 2.0 * np.pi / 3.0) for n in range(3)]
    base, joints = (np.concatenate([each @ turn.T for turn in turns]) for each in (base, joints))
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': joints.ravel(),
        'geometry.base_joint_axes': np.tile([0.0, 0.0, 1.0], 6),
        'geometry.platform_joint_axes': np.tile([0.0, 0.0, 1.0], 6),
        'limits.length_min': 0.65, 'limits.length_max': 1.0,
        'limits.base_joint_angle_max': 0.9, 'limits.platform_joint_angle_max': 0.95}))
    found = Capability(platform).section(Pose([offset, 0.0, 0.777876], np.eye(3)), 'x').boundary
    assert any(part.limit == 'base_joint_angle_max' for part in found)
    ends = np.concatenate([part.points[[0, -1]] for part in found])
    apart = np.linalg.norm(ends[:, None] - ends, axis=2) + np.diag(np.full(len(ends), np.inf))
    assert apart.min(axis=1).max() < 1e-5  # an arc of a tie may be shorter


def test_the_total_tilt_is_the_smallest_about_all_axes() -> None:
    capability = Capability(PLATFORM)
    found = capability.tilt()
    directions = np.zeros((5000, 6))
    angles = rng().uniform(0.0, 2.0 * np.pi, 5000)
    directions[:, 3], directions[:, 4] = np.cos(angles), np.sin(angles)
    values = capability.travel(PLATFORM.home_pose(), directions).value
    assert found.total.value <= values.min()
    assert found.total.value == pytest.approx(values.min(), rel=1e-4)
    assert found.extents.value.shape == found.azimuths.shape == (360,)


def test_no_random_pose_of_a_box_has_less_than_the_smallest_value() -> None:
    capability, home = Capability(PLATFORM), PLATFORM.home_pose()
    box = np.ones((6, 2)) * [-0.1, 0.1]

    def softest(poses: Pose) -> Array:
        return np.linalg.eigvalsh(PLATFORM.stiffness(poses, 1e7)[..., :3, :3])[..., 0]

    poses = poses_in(box, home, np.zeros(3), rng())
    for quantity in (capability.force, capability.moment, softest):
        found = capability.smallest(quantity, box)
        # the corners of the box are among both, with other rounding errors
        assert found.value <= np.min(quantity(poses)) * (1.0 + 1e-12)
        assert found.value == pytest.approx(float(quantity(found.pose)), rel=1e-12)


@pytest.mark.parametrize('ask, error, text', [
    (lambda c: c.section(normal='w'), MotionError, "must be 'x', 'y' or 'z'"),
    (lambda c: c.section(Pose(np.zeros((2, 3)), np.eye(3))), MotionError, 'must be a single one'),
    *((lambda c, name=name, more=more: getattr(c, name)('x', *more), MotionError,
       "pose: 'x': must be a Pose or a Motion") for name, more in (
           ('travel', (np.ones(6),)), ('wrench', (np.ones(6),)), ('force', ()),
           ('stiffness', (1e6,)))),
    (lambda c: c.tilt(azimuths=2), MotionError, 'azimuths: 2: must be an integer of at least 3'),
    (lambda c: c.tilt(azimuths='x'), MotionError, 'azimuths: .*x.*: must be an integer'),
    (lambda c: Capability(StewartPlatform(Parameters({
        name: value for name, value in PLATFORM.parameters.given.items()
        if not name.startswith('limits.')}))).section(
            PLATFORM.home_pose()), ParameterError, 'limits.length_max: not set')])
def test_a_question_without_sense_is_rejected(ask: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        ask(Capability(PLATFORM))
