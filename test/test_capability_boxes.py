# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Boxes of ranges: each answer against random poses of the box, most of them on its faces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cases import few
import numpy as np
import pytest
from referees import rng, size_of
from scipy.spatial.transform import Rotation
from snapshot import Snapshot
from stewart_dynamics import Capability, Motion, MotionError, Pose, StewartPlatform
from stewart_dynamics.arrays import Array, Flags
from stewart_dynamics.mechanics.limits import Limits, OF_JOINTS
from test_capability import limited

CONFIG = Path(__file__).resolve().parent.parent / 'config'
PLATFORM = StewartPlatform.from_yaml(CONFIG / 'platform.yaml')
AXES = np.tile([0.0, 0.0, 1.0], 6)
KINDS = 'lengths', 'joints', 'condition', 'lines'
SAMPLES = 10_000
HARD = 2, 6, 14  # their condition numbers take up to 20 s to be proven


def some_ranges(random: np.random.Generator) -> Array:
    """Return ranges (6, 2) about zero."""
    return np.stack([-random.uniform(0.1, 1.0, 6), random.uniform(0.1, 1.0, 6)], axis=1)


def case(seed: int) -> tuple[StewartPlatform, Pose, Array, Array]:
    """Return a random hexapod with limits of a kind, a pose, a box of ranges and a pivot."""
    random, kind = rng(seed), KINDS[seed % len(KINDS)]
    platform, pose = limited(random)
    p = platform.parameters
    if kind == 'joints':
        legs = (pose.position + p['geometry.platform_joints'] @ pose.rotation.T
                - p['geometry.base_joints'])
        axes = legs / np.linalg.norm(legs, axis=1)[:, None] + 0.05 * random.normal(size=(6, 3))
        platform = StewartPlatform(p.replaced({
            'limits.base_joint_angle_max': random.uniform(0.2, 0.4),
            'limits.platform_joint_angle_max': random.uniform(0.2, 0.4),
            'geometry.base_joint_axes': axes.ravel(),
            'geometry.platform_joint_axes': (axes @ pose.rotation).ravel()}))
    elif kind == 'condition':
        stop = random.uniform(1.2, 3.0) * platform.inverse_dynamics(
            Motion.from_pose(pose)).condition_number
        platform = StewartPlatform(p.replaced({
            'singularity.stop_condition': stop, 'singularity.warn_condition': stop,
            'limits.length_min': None, 'limits.length_max': None}))
    size = size_of(p)
    box = some_ranges(random)
    box[:3] *= size
    if kind == 'lines':
        box[random.permutation(6)[:4]] = 0.0
    return platform, pose, box, size * random.uniform(-0.5, 0.5, 3)


def poses_in(box: Array, pose: Pose, pivot: Array, random: np.random.Generator) -> Pose:
    """Return random poses of a box, two of three on its faces, edges and corners."""
    inside = random.uniform(box[:, 0], box[:, 1], (SAMPLES, 6))
    sides = np.where(random.random((SAMPLES, 6)) < 0.5, box[:, 0], box[:, 1])
    at_side = random.random((SAMPLES, 6)) < random.choice([0.0, 0.5, 1.0], (SAMPLES, 1))
    points = np.where(at_side, sides, inside)
    rotation = Rotation.from_rotvec(points[:, 3:]).as_matrix() @ pose.rotation
    return Pose(pose.position + pose.rotation @ pivot + points[:, :3] - rotation @ pivot, rotation)


def excesses(platform: StewartPlatform, poses: Pose, side: float) -> dict[str, Array]:
    """Return by how much poses exceed each limit, a column for each leg."""
    p = platform.parameters
    solved = platform.inverse_dynamics(Motion.from_pose(poses), singular='nan')
    stop = p['singularity.stop_condition']
    found = {'singularity': np.where(solved.determinant * side > 0.0,
                                     solved.condition_number - stop, np.inf)[:, None]}
    if p['limits.length_max'] is not None:
        found['length_max'] = solved.lengths - p['limits.length_max']
    if p['limits.length_min'] is not None:
        found['length_min'] = p['limits.length_min'] - solved.lengths
    if p['limits.base_joint_angle_max'] is not None:
        for name, angles in zip(OF_JOINTS, platform.joint_angles(poses), strict=True):
            found[name.removeprefix('limits.')] = angles - p[name]
    return found


def outside(platform: StewartPlatform, found: dict[str, Array]) -> Flags:
    """Return which poses exceed a limit by more than the tolerance of limits."""
    sizes = Limits(platform.parameters).bounds
    return np.any([(excess > 1e-9 * sizes.get(f'limits.{name}', np.zeros(1))).any(axis=1)
                   for name, excess in found.items()], axis=0)


@pytest.mark.parametrize('seed', few([seed for seed in range(19) if seed not in HARD], 5))
def test_no_pose_of_a_box_is_worse_than_its_answer(seed: int) -> None:
    platform, pose, box, pivot = case(seed)
    capability, random = Capability(platform), rng(seed)
    side = platform.inverse_dynamics(Motion.from_pose(pose)).determinant
    found = capability.reachable_factor(box, pose, pivot)
    if found.value == 0.0:  # the pose itself exceeds a limit
        assert outside(platform, excesses(platform, Pose(pose.position[None], pose.rotation[None]),
                                          side)).all()
        return
    for factor in (1.0, 1.0 + 1e-6, 1.1):
        scaled = found.value * factor * box
        answer = capability.reachable(scaled, pose, pivot)
        poses = excesses(platform, poses_in(scaled, pose, pivot, random), side)
        name, leg, excess = answer.worst.limit, answer.worst.leg, answer.worst.excess
        at_worst = excesses(platform, Pose(answer.worst.pose.position[None],
                                           answer.worst.pose.rotation[None]), side)
        assert at_worst[name][0, leg] == pytest.approx(excess, rel=1e-9, abs=1e-12)
        if answer.certain:
            assert not outside(platform, poses).any()
        if name != 'singularity':
            assert poses[name][:, leg].max() <= excess + 1e-6
        if found.limit != 'singularity':
            assert answer.certain == (factor <= 1.0)
            assert answer.certain or outside(platform, at_worst).all()


def test_a_box_is_reachable_along_an_axis_as_far_as_the_travel() -> None:
    capability, home = Capability(PLATFORM), PLATFORM.home_pose()
    for direction in np.concatenate([np.eye(6), -np.eye(6)]):
        travel = capability.travel(home, direction)
        box = np.stack([np.minimum(direction, 0.0), np.maximum(direction, 0.0)], axis=1)
        found = capability.reachable_factor(box)
        assert found.value == pytest.approx(travel.value, rel=1e-7)
        assert found.limit == travel.limit  # legs of a pair reach it at once


@pytest.mark.parametrize('unit', [1e-200, 1e-7, 1e-3, 1.0])
def test_the_factor_of_a_box_follows_its_unit(unit: float) -> None:
    capability = Capability(PLATFORM)
    for direction in (np.eye(6)[3], np.array([1.0, 0.5, 0.2, 1.0, 0.0, 0.3])):
        box = np.stack([-direction, direction], axis=1)
        whole, found = (capability.reachable_factor(each) for each in (box, unit * box))
        assert found.value * unit == pytest.approx(whole.value, rel=1e-8)
        assert found.limit == whole.limit
        assert capability.reachable(found.value * unit * box).certain


@pytest.mark.parametrize('box, pose', [
    (np.zeros((6, 2)), None),
    (np.ones((6, 2)) * [1, -1], None),
    (np.ones((6, 2)) * [-9, 9], None),
    (np.ones((6, 3)), None),
    (np.ones((6, 2)) * [-1, 1], Pose(np.zeros((2, 3)), np.eye(3)))])
def test_a_box_that_is_none_is_rejected(box: Array, pose: Pose | None, snapshot: Snapshot) -> None:
    ask: Any = Capability(PLATFORM).reachable
    with snapshot.raises(MotionError):
        ask(box, pose)


def test_a_box_that_cannot_be_scaled_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        Capability(PLATFORM).reachable_factor(np.ones((6, 2)) * [0.1, 0.2])


def test_a_box_without_a_finite_factor_is_rejected(snapshot: Snapshot) -> None:
    for size in (1e-320, 1e-305):
        with snapshot.raises(MotionError):
            Capability(PLATFORM).reachable_factor([[0.0, size], *[[0.0, 0.0]] * 5])
