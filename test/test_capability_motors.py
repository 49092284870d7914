# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability with limits of the motors: each answer is where ``platform.motors`` reaches one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import Array, random_direction, random_motion, rng, symmetric_parameters
from snapshot import Snapshot

from stewart_dynamics import (
    Capability, Motion, MotionError, ParameterError, Parameters, StewartPlatform)
from stewart_dynamics.capability.motions import Deviations, faster
from stewart_dynamics.mechanics.rows import ACCELERATION, TWIST


def driven(seed: int, **changes: Any) -> StewartPlatform:
    """Return a random hexapod whose motors have limits, and no limits.* but lengths."""
    random = rng(seed)
    p = symmetric_parameters().replaced({
        'geometry.zero_length': 1.1,
        'actuator.coulomb_velocity': 0.01, 'actuator.reflected_mass': None,
        'actuator.coulomb_friction': random.choice([0.0, 30.0]),
        'actuator.screw_lead': random.uniform(0.005, 0.02, 6),
        'drive.gear_ratio': random.uniform(1.0, 3.0, 6),
        'drive.motor_inertia': random.uniform(1e-5, 1e-4, 6),
        'drive.efficiency': random.uniform(0.6, 0.95, 6),
        'drive.screw_rotation': ['guided', 'universal'][seed % 2]})
    platform = StewartPlatform(p)
    still = platform.motors(Motion.from_pose(platform.home_pose()))
    most = 3.0 * float(np.abs(still.breakaway_torques).max())
    last = 300.0
    curve = [20.0, 1.2 * most, 0.5 * last, 0.9 * most, last, 0.3 * most]
    return StewartPlatform(p.replaced({
        'drive.torque_max': most * random.uniform(0.8, 1.4, 6), 'drive.torque_speed': curve,
        'drive.speed_max': 0.95 * last, **changes}))


def torques(platform: StewartPlatform, motion: Motion, wrench: Any = None) -> Array:
    """Return the parts of the available torques that motors need (..., 6)."""
    motors = platform.motors(motion, wrench)
    with np.errstate(divide='ignore'):
        found: Array = np.abs(motors.breakaway_torques) / motors.available_torques
    return found


def use(platform: StewartPlatform, motion: Motion, wrench: Any = None) -> Array:
    """Return the larger of the parts of speed_max and of the available torque, (..., 6)."""
    return np.maximum(torques(platform, motion, wrench), np.abs(
        platform.motors(motion, wrench).speeds) / platform.parameters['drive.speed_max'])


def check(found: Any, ratio: Any) -> None:
    """Check that an answer is where the motor that is named reaches its limit, not before."""
    assert found.limit in ('torque_max', 'torque_speed', 'speed_max')
    at = ratio(found.value).reshape(-1, 6)
    assert at.max() == pytest.approx(1.0, abs=1e-9)
    assert at[found.sample or 0, found.leg] == at.max()
    assert ratio(found.value * (1.0 + 1e-6)).max() > 1.0
    for part in np.linspace(0.0, 1.0, 201):
        assert ratio(part * found.value).max() <= 1.0 + 1e-9


def slowed(platform: StewartPlatform, random: np.random.Generator, count: int) -> Motion:
    """Return motions that the motors can follow about as they are."""
    rows = random_motion(platform.parameters, random, count).rows.copy()
    rows[:, TWIST] *= 0.1
    rows[:, ACCELERATION] *= 0.01
    return Motion.of_rows(rows)


@pytest.mark.parametrize('seed', range(24))
def test_a_motion_can_be_played_faster_until_a_motor_is_at_its_limit(seed: int) -> None:
    platform, random = driven(seed), rng(seed)
    motion = slowed(platform, random, 6)
    found = Capability(platform).speed_factor(motion)
    if found.value > 0.0:
        check(found, lambda k: use(platform, Motion.of_rows(faster(motion.rows, k))))
    else:
        assert use(platform, Motion.of_rows(faster(motion.rows, 0.0))).max() > 1.0 - 1e-9


def scaled(motion: Motion, part: slice, change: Array) -> Any:
    """Return a function from a multiple to the motion with this multiple of a change."""
    def at(multiple: float) -> Motion:
        rows = motion.rows.copy()
        rows[..., part] += multiple * change
        return Motion.of_rows(rows)

    return at


@pytest.mark.parametrize('seed', range(12))
def test_loads_accelerations_and_rates_end_at_the_limit_of_a_motor(seed: int) -> None:
    platform, random = driven(seed), rng(seed)
    c = Capability(platform)
    moving = slowed(platform, random, 1)[0]
    still = Motion.from_pose(platform.home_pose())
    direction = np.concatenate([random_direction(random), 0.3 * random_direction(random)])
    found = c.wrench(still, direction)
    check(found, lambda k: torques(platform, still, -k * direction))
    if seed % 4 < 2:
        # the force in every direction is that of the worst one
        force = np.concatenate([random_direction(random), np.zeros(3)])
        assert c.wrench(still, force).value >= c.force(still) * (1.0 - 1e-12)
    for motion in (None, moving):
        begin = still if motion is None else Motion.of_rows(np.concatenate([
            moving.rows[:TWIST.stop], np.zeros(6)]))
        found = c.acceleration(begin, direction, motion)
        if found.value > 0.0:
            turning = scaled(begin, ACCELERATION, direction)
            check(found, lambda k, at=turning: torques(platform, at(k)))
        else:
            assert torques(platform, begin).max() > 1.0
    found = c.velocity(still, direction)
    assert found.limit == 'speed_max'
    fast = platform.motors(scaled(still, TWIST, found.value * direction)(1.0))
    speeds = np.abs(fast.speeds) / platform.parameters['drive.speed_max']
    assert speeds.max() == pytest.approx(1.0, abs=1e-9) and speeds.argmax() == found.leg


@pytest.mark.parametrize('seed', range(6))
def test_a_payload_ends_at_the_torque_of_a_motor(seed: int) -> None:
    platform, random = driven(seed), rng(seed)
    motion, center = slowed(platform, random, 3), random.uniform(-0.2, 0.2, 3)
    found = Capability(platform).payload(motion, center)

    def loaded(mass: float) -> Array:
        # a point mass: its weight and inertia as an external wrench
        arm = motion.rotation @ center
        alpha, omega = motion.angular_acceleration, motion.angular_velocity
        acceleration = (motion.linear_acceleration + np.cross(alpha, arm)
                        + np.cross(omega, np.cross(omega, arm)))
        force = mass * (platform.parameters['gravity'] - acceleration)
        return torques(platform, motion, np.concatenate([force, np.cross(arm, force)], axis=-1))

    if found.value > 0.0:
        check(found, loaded)
    else:
        assert loaded(0.0).max() > 1.0


@pytest.mark.parametrize('seed', range(4))
def test_a_motion_can_be_larger_until_a_motor_is_at_its_limit(seed: int) -> None:
    platform = driven(seed)
    home = Motion.from_pose(platform.home_pose())
    times: Array = np.linspace(0.0, 2.0, 41)
    s, c = np.sin(3.0 * times)[:, None], np.cos(3.0 * times)[:, None]
    axis = np.array([0.01, 0.02, 0.015])
    motion = Motion(home.position + s * axis, np.tile(home.rotation, (41, 1, 1)), 3.0 * c * axis,
                    np.zeros((41, 3)), -9.0 * s * axis)
    found = Capability(platform).amplitude_factor(motion, home)
    grown = Deviations(home, motion.rows)
    if found.limit in ('torque_max', 'torque_speed', 'speed_max'):
        check(found, lambda k: use(platform, Motion.of_rows(grown.at(k))))
    else:
        assert found.limit == 'singularity'


def test_the_tighter_of_two_limits_is_named() -> None:
    platform = driven(0, **{'drive.torque_max': 1e3})
    pose, along = platform.home_pose(), [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]
    motors = Capability(platform).wrench(pose, along)
    assert motors.limit == 'torque_speed'  # at rest: the first torque of the curve
    force = float(np.abs(platform.inverse_dynamics(Motion.from_pose(pose)).forces).max())
    for most, limit in ((1.01 * force, 'force_max'), (1e9, 'torque_speed')):
        found = Capability(StewartPlatform(platform.parameters.replaced(
            {'limits.force_max': most}))).wrench(pose, along)
        assert found.limit == limit and found.value <= motors.value
    strong = Capability(driven(0, **{'drive.torque_speed': None})).wrench(pose, along)
    assert strong.limit == 'torque_max'


def test_drives_without_limits_do_not_limit(snapshot: Snapshot) -> None:
    p: Parameters = driven(0).parameters.replaced({
        'drive.torque_max': None, 'drive.torque_speed': None, 'drive.speed_max': None})
    c = Capability(StewartPlatform(p))
    for ask in (c.wrench, c.velocity, c.acceleration):
        with snapshot.raises(ParameterError):
            ask(c.platform.home_pose(), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    with snapshot.raises(ParameterError):
        c.force(c.platform.home_pose())


@pytest.mark.parametrize('seed', range(4))
def test_what_is_held_without_end_ends_at_the_continuous_torque(
        seed: int, snapshot: Snapshot) -> None:
    peak = driven(seed)
    continuous = 0.5 * peak.parameters['drive.torque_max']
    platform = StewartPlatform(peak.parameters.replaced({'drive.torque_continuous': continuous}))
    c, pose, center = Capability(platform), platform.home_pose(), np.array([0.1, 0.0, 0.2])
    found = c.payload(pose, center, continuous=True)
    weight = found.value * platform.parameters['gravity']
    held = platform.motors(Motion.from_pose(pose), np.concatenate([
        weight, np.cross(pose.rotation @ center, weight)]))
    assert found.limit == 'torque_continuous'
    # the torque that is published and heats the winding: at rest without losses
    assert (np.abs(held.torques) / continuous)[found.leg] == pytest.approx(1.0, abs=1e-9)
    assert (np.abs(held.torques) / continuous).max() == pytest.approx(1.0, abs=1e-9)
    assert found.value < c.payload(pose, center).value == Capability(peak).payload(
        pose, center).value
    for ask in (c.force, c.moment):
        assert ask(pose, continuous=True) < ask(pose)
    with snapshot.raises(ParameterError):
        Capability(peak).payload(pose, center, continuous=True)
    with snapshot.raises(MotionError):
        c.payload(Motion.from_pose(pose), center, continuous=True)
