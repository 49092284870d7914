# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Capability with limits of the motors: each answer is where ``platform.motors`` reaches one."""

from __future__ import annotations

from typing import Any

import numpy as np
from referees import rng, symmetric_parameters
from snapshot import Snapshot

from stewart_dynamics import (
    Capability, Motion, MotionError, ParameterError, Parameters, StewartPlatform)


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


def test_what_is_held_without_end_is_less_than_the_peak(snapshot: Snapshot) -> None:
    peak = driven(0)
    continuous = 0.5 * peak.parameters['drive.torque_max']
    platform = StewartPlatform(peak.parameters.replaced({'drive.torque_continuous': continuous}))
    c, pose, center = Capability(platform), platform.home_pose(), np.array([0.1, 0.0, 0.2])
    assert c.payload(pose, center, continuous=True).value < c.payload(
        pose, center).value == Capability(peak).payload(pose, center).value
    for ask in (c.force, c.moment):
        assert ask(pose, continuous=True) < ask(pose)
    with snapshot.raises(ParameterError):
        Capability(peak).payload(pose, center, continuous=True)
    with snapshot.raises(MotionError):
        c.payload(Motion.from_pose(pose), center, continuous=True)
