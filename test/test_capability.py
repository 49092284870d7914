# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability: every answer is applied in the dynamics, or compared with dense sampling."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from referees import (
    random_direction, random_motion, random_parameters, rng, rotation_about, size_of)
from snapshot import Snapshot
from stewart_dynamics import (
    Capability, Motion, MotionError, ParameterError, Parameters, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array

CONFIG = Path(__file__).resolve().parent.parent / 'config'
PLATFORM = StewartPlatform.from_yaml(CONFIG / 'platform.yaml')


def limited(random: np.random.Generator, **more: Any) -> tuple[StewartPlatform, Pose]:
    """Return a random hexapod with limits around a random pose that keeps them."""
    parameters = random_parameters(random)
    motion = random_motion(parameters, random, 1)
    pose = Pose(motion.position[0], motion.rotation[0])
    platform = StewartPlatform(parameters)
    lengths = platform.inverse_kinematics(pose)
    forces = platform.inverse_dynamics(Motion.from_pose(pose)).forces
    return StewartPlatform(parameters.replaced({
        'limits.length_min': lengths * random.uniform(0.7, 0.99, 6),
        'limits.length_max': lengths * random.uniform(1.01, 1.3, 6),
        'limits.velocity_max': random.uniform(0.1, 2.0, 6),
        'limits.force_max': np.abs(forces).max() * random.uniform(1.01, 5.0, 6),
        'singularity.stop_condition': 1e6, 'singularity.warn_condition': 1e5} | more)), pose


def moved(pose: Pose, direction: Array, pivot: Array, by: Array) -> Pose:
    """Return the poses of a travel, by matrix exponentials of their own."""
    rate = float(np.linalg.norm(direction[3:]))
    turns = rotation_about(direction[3:] / (rate or 1.0), rate * by)
    center = pose.position + pose.rotation @ pivot
    rotations = turns @ pose.rotation
    return Pose(center + by[:, None] * direction[:3] - rotations @ pivot, rotations)


def random_travel(random: np.random.Generator, size: float) -> tuple[Array, Array]:
    """Return a translation, a rotation, or both, and a pivot."""
    direction = np.concatenate([random_direction(random), random_direction(random) / size])
    kind = random.integers(3)
    if kind < 2:
        direction[3 * kind:3 * kind + 3] = 0.0
    return direction, size * random.uniform(-0.5, 0.5, 3)


@pytest.mark.parametrize('away', [0.0, 1e-17, 1e-9])
def test_an_axis_through_a_platform_joint_does_not_end_the_travel(away: float) -> None:
    capability = Capability(StewartPlatform(PLATFORM.parameters.replaced({
        'limits.base_joint_angle_max': 1.2, 'limits.platform_joint_angle_max': 1.2})))
    home = PLATFORM.home_pose()
    for joint in PLATFORM.parameters['geometry.platform_joints']:
        axis = np.append(np.zeros(3), joint / np.linalg.norm(joint))
        near = axis + [0.0, 0.0, 0.0, 0.0, 0.0, 1e-6]
        found, nearby = (capability.travel(home, each, [away, 0.0, 0.0]) for each in (axis, near))
        assert found.value > 0.3
        assert found.value == pytest.approx(nearby.value, rel=1e-4)
        assert found.limit == nearby.limit


def test_the_joints_of_a_stuck_leg_limit_though_its_actuator_does_not() -> None:
    parameters = PLATFORM.parameters.replaced({
        'limits.force_max': 700.0, 'limits.joint_force_max': 1500.0})
    platform, home = StewartPlatform(parameters), PLATFORM.home_pose()
    found = Capability(platform).stuck_leg(home, 0)
    assert found.load is not None
    largest = np.zeros(6)
    for wrench, values in zip(found.wrenches, found.load.value, strict=True):
        for value, sign in zip(values, (1.0, -1.0), strict=True):
            largest = np.maximum(largest, np.abs(platform.inverse_dynamics(
                Motion.from_pose(home), -sign * value * wrench).joint_forces))
    assert 700.0 < largest[0] <= 1500.0 * (1.0 + 1e-9)
    assert (largest[1:] <= 700.0 * (1.0 + 1e-9)).all()


@pytest.mark.parametrize('seed', range(24))
def test_a_travel_ends_at_the_first_limit(seed: int) -> None:
    random = rng(seed)
    platform, pose = limited(random, **{
        'limits.base_joint_angle_max': 0.6, 'limits.platform_joint_angle_max': 0.7,
        'geometry.base_joint_axes': np.tile([0.0, 0.0, 1.0], 6),
        'geometry.platform_joint_axes': np.tile([0.0, 0.0, 1.0], 6)} if seed % 2 else {})
    p = platform.parameters
    if seed % 2:  # the axes are the legs' directions at a pose nearby
        legs = pose.position + platform.parameters['geometry.platform_joints'] @ (
            pose.rotation.T) - p['geometry.base_joints']
        axes = legs / np.linalg.norm(legs, axis=1)[:, None] + 0.1 * random.normal(size=(6, 3))
        platform = StewartPlatform(p.replaced({
            'geometry.base_joint_axes': axes.ravel(),
            'geometry.platform_joint_axes': (axes @ pose.rotation).ravel()}))
        p = platform.parameters
    direction, pivot = random_travel(random, size_of(p))
    found = Capability(platform).travel(pose, direction, pivot)

    def margins(by: Array) -> Array:
        poses = moved(pose, direction, pivot, by)
        lengths = platform.inverse_kinematics(poses)
        parts = [lengths - p['limits.length_min'], p['limits.length_max'] - lengths]
        if seed % 2:
            base, top = platform.joint_angles(poses)
            parts += [p['limits.base_joint_angle_max'] - base,
                      p['limits.platform_joint_angle_max'] - top]
        condition = platform.inverse_dynamics(
            Motion.from_pose(poses), singular='nan').condition_number
        return np.column_stack([*parts, 1.0 - condition / p['singularity.stop_condition']])

    dense = np.linspace(0.0, found.value, 5001)
    assert margins(dense).min() >= -1e-12 * size_of(p)
    at_end, behind = margins(np.array([found.value, found.value + 1e-7 * size_of(p)]))
    names = np.repeat(['length_min', 'length_max', *(
        ['base_joint_angle_max', 'platform_joint_angle_max'] if seed % 2 else [])], 6)
    least = int(at_end.argmin())
    assert abs(at_end[least]) < 1e-12 * max(size_of(p), 1.0)
    assert behind[least] < 0.0
    assert found.limit == (*names, 'singularity')[least]
    assert found.leg == (least % 6 if least < len(names) else -1)


@pytest.mark.parametrize('part', [0.5, 0.99, 1.0 - 1e-9])
def test_a_limit_that_is_left_and_entered_again_is_not_passed(part: float) -> None:
    """Leg 1 is too short for a part of the way, and longer at both ends of it."""
    p = PLATFORM.parameters
    home = PLATFORM.home_pose()
    across = home.position + p['geometry.platform_joints'][0] - p['geometry.base_joints'][0]
    distance = math.hypot(across[1], across[2])  # where the leg is in the plane of y and z
    shortest = distance * math.sqrt(1.0 + 0.01 * (1.0 - part))
    lengths = np.zeros(6)
    lengths[0] = shortest
    platform = StewartPlatform(p.replaced({
        'limits.length_min': np.maximum(lengths, 1e-3), 'limits.length_max': 10.0}))
    begin = Pose(home.position - [across[0] + 0.4, 0.0, 0.0], home.rotation)
    found = Capability(platform).travel(begin, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert (found.limit, found.leg) == ('length_min', 0)
    assert found.value == pytest.approx(0.4 - math.sqrt(shortest ** 2 - distance ** 2), abs=1e-7)


def test_a_travel_ends_at_the_stop_condition_and_before_a_singularity() -> None:
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'limits.length_min': None, 'limits.length_max': None,
        'limits.base_joint_angle_max': None, 'limits.platform_joint_angle_max': None}))
    home = platform.home_pose()
    sides = np.concatenate([np.eye(6), -np.eye(6)])
    for stop in (20.0, 1e3, 1e6):
        narrower = StewartPlatform(platform.parameters.replaced({
            'singularity.stop_condition': stop, 'singularity.warn_condition': stop}))
        found = Capability(narrower).travel(home, sides)
        assert set(found.limit) == {'singularity'}
        for n, direction in enumerate(sides):
            by = np.append(np.linspace(0.0, found.value[n], 501),
                           found.value[n] * (1.0 + 1e-8))
            solved = platform.inverse_dynamics(Motion.from_pose(
                moved(home, direction, np.zeros(3), by)), singular='nan')
            assert solved.condition_number[:-1].max() <= stop * (1.0 + 1e-6)
            assert solved.condition_number[-2] == pytest.approx(stop, rel=1e-6)
            assert np.all(np.sign(solved.determinant[:-1]) == np.sign(solved.determinant[0]))


def test_a_travel_that_begins_on_a_limit_and_along_it_is_zero_where_it_is_exceeded() -> None:
    base = np.array([[1.0, 0.0, 0.0], [-0.5, 0.75, 0.0], [-0.5, -0.75, 0.0],
                     [2.0, 0.0, 1.0], [0.0, 3.0, 1.0], [-2.0, -1.0, 1.0]])
    joints = np.concatenate([base[:3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]])
    p = PLATFORM.parameters.replaced({
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': joints.ravel(),
        'limits.length_min': 0.5, 'limits.length_max': (1.0, 1.0, 1.0, 1.2, 2.2, 2.2),
        'singularity.stop_condition': 1000.0})
    start = Pose([0.0, 0.0, 1.0], np.eye(3))  # three vertical legs at their longest
    for sides in ([1.0, 0.0], [0.0, -1.0], [0.6, 0.8]):
        for turn in ([0.0, 0.0], [0.0, 0.5]):
            direction = [*sides, 0.0, 0.0, *turn]
            assert Capability(StewartPlatform(p)).travel(start, direction)[:2] == (
                pytest.approx(0.0, abs=1e-7), 'length_max')
    shortest = p.replaced({'limits.length_min': (1.0, 1.0, 1.0, 0.5, 0.5, 0.5),
                           'limits.length_max': 9.0})
    found = Capability(StewartPlatform(shortest)).travel(start, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert found[:3] == (pytest.approx(0.5), 'length_min', 3)


@pytest.mark.parametrize('gap', [0.0, 1e-9, 1e-6])
def test_a_leg_that_stays_close_to_its_limits_does_not_end_the_travel(gap: float) -> None:
    p = PLATFORM.parameters
    home = PLATFORM.home_pose()
    pivot = p['geometry.base_joints'][0] - home.position  # length and base angle of leg 0 stay
    line = home.position + p['geometry.platform_joints'][0] - p['geometry.base_joints'][0]
    length = float(np.linalg.norm(line))
    tilt = math.acos(line[2] / length)
    for turn in np.eye(3):
        free = Capability(StewartPlatform(p.replaced({
            'limits.length_max': 9.0, 'limits.length_min': 0.01}))).travel(
                home, [0.0, 0.0, 0.0, *turn], pivot)
        close = p.replaced({
            'limits.length_max': (length * (1.0 + gap), *[9.0] * 5),
            'limits.length_min': (length * (1.0 - (gap or 1e-9)), *[0.01] * 5)}
            | ({'geometry.base_joint_axes': np.tile([0.0, 0.0, 1.0], 6),
                'limits.base_joint_angle_max': (tilt + gap, *[3.0] * 5)} if turn[2] else {}))
        assert Capability(StewartPlatform(close)).travel(
            home, [0.0, 0.0, 0.0, *turn], pivot) == free


def gimbals(radius: float, spacing: float, first: float) -> Array:
    """Return joints (6, 3) in three pairs on a circle, the pairs 120 degrees apart."""
    half = math.asin(0.5 * spacing / radius)
    angles = [first + 2.0 * math.pi / 3.0 * pair + side * half
              for pair in range(3) for side in (-1.0, 1.0)]
    return np.array([[radius * math.cos(angle), radius * math.sin(angle), 0.0]
                     for angle in angles])


def test_travels_of_a_published_hexapod_are_those_given_for_it() -> None:
    """SIMONA Research Simulator of TU Delft: geometry of its software, rounded travels."""
    upper, lower = gimbals(1.6, 0.2, math.pi / 3.0), gimbals(1.65, 0.6, 0.0)
    nearest = [int(np.linalg.norm(lower - joint, axis=1).argmin()) for joint in upper]
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'geometry.base_joints': lower[nearest].ravel(),
        'geometry.platform_joints': upper.ravel(),
        'limits.length_min': 2.131, 'limits.length_max': 3.281}))
    found = Capability(platform).travel(
        Pose([0.0, 0.0, 2.39], np.eye(3)), np.concatenate([np.eye(6), -np.eye(6)])).value
    moved, turned = found.reshape(2, 2, 3)[:, 0], np.degrees(found.reshape(2, 2, 3)[:, 1])
    assert moved == pytest.approx(
        np.array([[0.981, 1.031, 0.636], [1.259, 1.031, 0.678]]), abs=7e-4)
    assert turned == pytest.approx(np.array([[25.9, 24.3, 41.6], [25.9, 23.7, 41.6]]), abs=0.05)


def test_a_travel_from_outside_the_limits_is_zero() -> None:
    home = PLATFORM.home_pose()
    outside = Pose(home.position + [0.0, 0.0, 5.0], home.rotation)
    found = Capability(PLATFORM).travel(outside, [0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    assert (found.value, found.limit) == (0.0, 'length_max')


def test_answers_have_the_leading_shapes_of_poses_and_directions() -> None:
    capability = Capability(PLATFORM)
    home = PLATFORM.home_pose()
    poses = Pose(home.position + np.zeros((4, 1, 3)), np.broadcast_to(home.rotation, (4, 1, 3, 3)))
    for found in (capability.travel(poses, np.eye(6)), capability.wrench(poses, np.eye(6)),
                  capability.velocity(poses, np.eye(6)),
                  capability.acceleration(poses, np.eye(6))):
        assert np.shape(found.value) == np.shape(found.limit) == np.shape(found.leg) == (4, 6)
    assert np.shape(capability.force(poses)) == (4, 1)
    one = capability.travel(home, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert (type(one.value), type(one.limit), type(one.leg)) == (float, str, int)


def test_no_poses_have_no_answers_and_a_motion_without_samples_is_rejected(
        snapshot: Snapshot) -> None:
    driven = StewartPlatform(PLATFORM.parameters.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01,
        'drive.motor_inertia': 1e-4, 'drive.torque_max': 5.0, 'drive.speed_max': 300.0}))
    nothing = np.zeros((0, 3))
    poses, motion = Pose(nothing, np.eye(3)), Motion(nothing, np.eye(3))
    direction = np.eye(6)[2]
    for capability in (Capability(PLATFORM), Capability(driven)):
        for found in (capability.travel(poses, direction), capability.wrench(poses, direction),
                      capability.velocity(poses, direction),
                      capability.acceleration(poses, direction),
                      capability.payload(poses, np.zeros(3)),
                      capability.wrench(PLATFORM.home_pose(), np.zeros((0, 6)))):
            assert np.shape(found.value) == np.shape(found.limit) == np.shape(found.leg) == (0,)
        for whole in (lambda c: c.speed_factor(motion), lambda c: c.amplitude_factor(motion),
                      lambda c: c.payload(motion, np.zeros(3)),
                      lambda c: c.speed_factor(Motion.from_pose(c.platform.home_pose()),
                                               np.zeros((0, 6)))):
            with snapshot.raises(MotionError):
                whole(capability)


def test_a_path_ends_at_its_first_sample_that_exceeds_a_limit() -> None:
    home = PLATFORM.home_pose()
    heights = np.linspace(0.0, 1.0, 5)[:, None] * [0.0, 0.0, 1.0]
    turned = np.array([rotation_about([0.0, 0.0, 1.0], angle) @ home.rotation
                       for angle in (0.0, 0.0, 0.0, 0.0, math.pi / 2.0)])

    def end(rotations: Array, **changes: Any) -> Any:
        platform = StewartPlatform(PLATFORM.parameters.replaced(
            {f'limits.{name}': value for name, value in changes.items()}))
        found = Capability(platform).speed_factor(Motion(home.position + heights, rotations))
        return found[0], found.limit, found.sample

    longest, level = PLATFORM.inverse_kinematics(home).max(), np.broadcast_to(np.eye(3), (5, 3, 3))
    assert end(turned, length_max=longest + 5.0) == (0.0, 'singularity', 4)
    assert end(turned, length_max=longest + 0.1) == (0.0, 'length_max', 1)
    # a limit of the angles that is exceeded at home already
    axes = {'platform_joint_angle_max': 1e-3}
    assert end(level, length_max=longest + 0.1, **axes)[1:] == ('platform_joint_angle_max', 0)
    assert end(level, length_max=0.99 * longest, **axes)[1:] == ('length_max', 0)


def test_a_singular_pose_has_no_travel_whatever_the_threshold() -> None:
    home = PLATFORM.home_pose()
    platform = StewartPlatform(PLATFORM.parameters.replaced({
        'limits.length_min': None, 'limits.length_max': None,
        'singularity.stop_condition': 1e300}))
    singular = Pose(home.position, rotation_about([0.0, 0.0, 1.0], math.pi / 2.0))
    found = Capability(platform).travel(singular, np.eye(6))
    assert not found.value.any()
    assert set(found.limit) == {'singularity'}


@pytest.mark.parametrize('ask', [
    lambda c, home: c.wrench(home, np.eye(6)[0]),
    lambda c, home: c.force(home),
    lambda c, home: c.velocity(home, np.eye(6)[0]),
    lambda c, home: c.payload(home, [0.0, 0.0, 0.0]),
    lambda c, home: c.speed_factor(Motion.from_pose(home))])
def test_a_question_without_a_limit_is_rejected(ask: Any, snapshot: Snapshot) -> None:
    unlimited = StewartPlatform(Parameters({
        name: value for name, value in PLATFORM.parameters.given.items()
        if not name.startswith('limits.')}))
    with snapshot.raises(ParameterError):
        ask(Capability(unlimited), PLATFORM.home_pose())


@pytest.mark.parametrize('size', [1e-300, 1e-170, 3.0, 1e160, 1e300])
def test_answers_are_multiples_of_directions_of_any_size(size: float) -> None:
    capability = Capability(PLATFORM)
    home = PLATFORM.home_pose()
    direction = np.array([0.3, -0.2, 0.5, 0.1, 0.7, -0.4])
    for ask in (capability.travel, capability.wrench, capability.velocity,
                capability.acceleration):
        one, many = ask(home, direction), ask(home, size * direction)
        assert many.value * size == pytest.approx(one.value, rel=1e-12)
        assert many[1:3] == one[1:3]


def test_a_payload_out_of_range_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        Capability(PLATFORM).payload(PLATFORM.home_pose(), [1e308, 0.0, 0.0])


def test_a_direction_of_zeros_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        Capability(PLATFORM).travel(PLATFORM.home_pose(), np.zeros(6))


# Stiffness

def test_stiffness_of_a_cubic_hexapod_is_the_closed_form() -> None:
    a, k = 0.5, 1e6
    cube = a * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    near = [c for c in cube if np.isclose(c.sum(), a)]
    far = [c for c in cube if np.isclose(c.sum(), 2.0 * a)]
    pairs = [(b, p) for b in near for p in far if np.isclose(np.linalg.norm(p - b), a)]
    axes = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [1.0, 1.0, 1.0]])
    axes /= np.linalg.norm(axes, axis=1)[:, None]  # the diagonal is z
    base, top = ((np.array(each) - 0.5 * a) @ axes.T for each in zip(*pairs, strict=True))
    platform = StewartPlatform(Parameters({
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': top.ravel(),
        'platform.mass': 1e-9, 'platform.inertia': [1e-9, 0.0, 0.0, 1e-9, 0.0, 1e-9]}))
    center = Pose(np.zeros(3), np.eye(3))
    expected = k * np.array([2.0, 2.0, 2.0, a * a / 2.0, a * a / 2.0, 2.0 * a * a])
    np.testing.assert_allclose(
        Capability(platform).stiffness(center, k), np.diag(expected), rtol=0.0, atol=1e-6)


def test_forces_of_the_legs_and_the_weight_change_the_modes_little() -> None:
    capability, home = Capability(PLATFORM), PLATFORM.home_pose()
    stiff, soft = capability.modes(home, 1e8), capability.modes(home, 1e5)
    np.testing.assert_allclose(
        stiff.frequencies, PLATFORM.natural_modes(home, 1e8).frequencies, rtol=1e-3)
    assert not np.allclose(soft.frequencies, PLATFORM.natural_modes(home, 1e5).frequencies,
                           rtol=1e-4)


def test_modes_that_do_not_come_back_have_no_frequency() -> None:
    """In one batch with a stable pose, whose modes are those of the pose alone."""
    capability, home = Capability(PLATFORM), PLATFORM.home_pose()
    both = Pose(np.stack([home.position] * 2), np.stack([home.rotation] * 2))
    frequencies = capability.modes(both, np.array([[10.0] * 6, [1e8] * 6])).frequencies
    assert frequencies[0, 0] == 0.0 <= frequencies[0].min()
    np.testing.assert_allclose(frequencies[1], capability.modes(home, 1e8).frequencies)


def test_clearance_needs_the_shape_of_the_legs(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        Capability(PLATFORM).clearance(PLATFORM.home_pose())
    shaped = StewartPlatform(PLATFORM.parameters.replaced({
        'legs.cylinder.radius': 0.05, 'legs.cylinder.length': 0.8, 'legs.piston.radius': 0.03}))
    assert 0.0 < Capability(shaped).clearance(PLATFORM.home_pose()) < 0.3
