# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Planned trajectories against limits of the motors, at points and between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from referees import random_parameters, rng
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.mechanics.drives.heat import temperature_rises
from stewart_dynamics.mechanics.limits import (
    SPEED_MAX, TEMPERATURE_RISE_MAX, TORQUE_MAX, TORQUE_SPEED)
from stewart_dynamics.planned.interpolation import Interpolation
from stewart_dynamics.planned.planned_trajectory import check_planned_trajectory
from test_drives import driven
from test_planned_trajectory import random_trajectory
from trajectories import Array, FREE


def dense(times: Array, motion: Motion, samples: int = 10_000) -> tuple[Array, Motion]:
    """Return times and motion at about 10,000 samples between the points."""
    between = Interpolation(np.diff(times), motion.rows)
    part = np.linspace(0.0, 1.0, samples // (len(times) - 1) + 1)
    rows = np.concatenate([
        between.at(np.full(len(part), n), part) for n in range(len(times) - 1)])
    at = np.concatenate([times[n] + part * (times[n + 1] - times[n])
                         for n in range(len(times) - 1)])
    return at, Motion.of_rows(rows)


def rejected_for(p: Parameters, times: Array, motion: Motion) -> str:
    """Return the limit for which a trajectory is rejected; empty if it is accepted."""
    return check_planned_trajectory(StewartPlatform(p), times, motion).limit


@pytest.mark.parametrize('seed', range(4))
def test_no_torque_or_speed_is_missed_by_a_hundredth(seed: int) -> None:
    """The referee are 10,000 samples; half of the screws turn with their legs."""
    random = rng(seed)
    p = driven(random_parameters(random), random, **{
        'drive.screw_rotation': 'universal' if seed % 2 else 'guided',
        'singularity.stop_condition': 1e11, 'singularity.warn_condition': 1e11})
    for _ in range(3):
        times, motion = random_trajectory(p, random)
        motors = StewartPlatform(p).motors(dense(times, motion)[1])
        torques, speeds = np.abs(motors.breakaway_torques), np.abs(motors.speeds)
        for limit, largest in ((TORQUE_MAX, torques.max()), (SPEED_MAX, speeds.max())):
            assert rejected_for(p.replaced({limit: 0.99 * largest}), times, motion) == limit
            assert not rejected_for(p.replaced({limit: 1.01 * largest}), times, motion)
        # The curve falls to a half at the largest speed; scaled, the trajectory just exceeds it.
        most = torques.max()
        curve = np.array([0.1 * speeds.max(), most, 1.1 * speeds.max(), 0.5 * most])
        available = np.interp(speeds, curve[::2], curve[1::2])
        for factor, limit in ((0.99, TORQUE_SPEED), (1.01, '')):
            scaled = curve.copy()
            scaled[1::2] *= factor * (torques / available).max()
            assert rejected_for(p.replaced({TORQUE_SPEED: scaled}), times, motion) == limit


def test_a_winding_that_becomes_too_warm_between_two_points() -> None:
    random = rng()
    p = driven(FREE, random, **{
        'geometry.zero_length': 0.95, 'drive.thermal_resistance': 2.0,
        'drive.thermal_time_constant': 0.4})
    times, motion = np.array([0.0, 0.5]), Motion.from_euler(
        [[0.0, 0.0, 1.0], [0.05, 0.1, 1.2]], [[0.0, 0.0, 0.0], [0.1, 0.1, 0.0]])
    at, between = dense(times, motion)
    rises = temperature_rises(p, at, StewartPlatform(p).motors(between).copper_heat)
    for factor in (0.98, 1.02):
        limited = p.replaced({TEMPERATURE_RISE_MAX: factor * rises.max()})
        result = check_planned_trajectory(StewartPlatform(limited), times, motion)
        assert result.limit == (TEMPERATURE_RISE_MAX if factor < 1.0 else '')
        if factor < 1.0:
            over = at[rises.max(axis=1) > factor * rises.max()]
            assert over[0] - 0.04 < result.time <= over[-1]
            assert ': temperature rise ' in result.message


def test_a_torque_at_the_reversal_of_a_leg_is_found() -> None:
    # Straight down and up again: the losses change their direction between two samples.
    random = rng(1)
    p = driven(FREE, random, **{'drive.efficiency': 0.5, 'actuator.coulomb_velocity': 1e-4})
    up, down = [0.0, 0.0, 1.1], [0.0, 0.0, 1.099]
    times = np.array([0.0, 0.1, 0.2])
    motion = Motion([up, down, up], [np.eye(3)] * 3,
                    linear_velocity=[[0.0, 0.0, -0.02], [0.0] * 3, [0.0, 0.0, 0.02]])
    motors = StewartPlatform(p).motors(dense(times, motion)[1])
    largest = np.abs(motors.breakaway_torques).max()
    assert rejected_for(p.replaced({TORQUE_MAX: 0.99 * largest}), times, motion) == TORQUE_MAX
    assert not rejected_for(p.replaced({TORQUE_MAX: 1.01 * largest}), times, motion)
    assert math.isfinite(largest)
