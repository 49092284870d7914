# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The recordings that judge estimates: their hexapod against this package, their motions."""

from __future__ import annotations

from estimate_cases import AXES, CRANKS, drawn, legs_of, MOTIONS, SLOW, stopping
from independent_hexapod import Controlled, moving
import numpy as np
import pytest
from referees import relative, rng

from stewart_dynamics import Motion, StewartPlatform

TIMES = np.arange(0.0, 20.0, 0.1)


@pytest.mark.parametrize('seed', range(3))
def test_forces_lengths_and_rates_are_those_of_this_package(seed: int) -> None:
    p, motion = drawn(seed).parameters, MOTIONS['rich'](rng(seed))(TIMES)
    legs, result = moving(p, motion), StewartPlatform(p).inverse_dynamics(motion)
    for found, expected in zip(legs, (result.lengths, result.rates, result.forces), strict=True):
        assert relative(found, expected) < 1e-12


@pytest.mark.parametrize('seed', range(2))
def test_drawn_cranks_reach_all_poses(seed: int) -> None:
    truth = drawn(seed, CRANKS)
    legs = legs_of(truth, 'rich', seed)(TIMES)
    limits = truth.parameters.limits
    assert np.all((limits.angle_min < legs.lengths) & (legs.lengths < limits.angle_max))
    assert 0.3 < np.abs(legs.lengths).max()


def test_a_hexapod_in_closed_loop_obeys_its_forward_dynamics() -> None:
    p = drawn(1).parameters
    times = Controlled.PERIOD * np.arange(2000)
    target = MOTIONS['yaw'](rng(1))(times)
    loop = Controlled(p, target)
    legs = loop(times)
    platform = StewartPlatform(p)
    poses = platform.forward_kinematics(legs.lengths, target)
    twists = platform.twist(poses, legs.rates)
    accelerations = platform.forward_dynamics(Motion(
        poses.position, poses.rotation, twists[:, :3], twists[:, 3:]),
        loop(times + 0.5 * Controlled.PERIOD).forces).rows[:, 18:]
    # Friction changes within a period while a leg reverses.
    steady = np.all(np.abs(legs.rates) > 0.01, axis=1)[:-1]
    change = np.diff(twists, axis=0)[steady]
    assert steady.sum() > 500
    assert relative(change, Controlled.PERIOD * accelerations[:-1][steady]) < 0.05


@pytest.mark.parametrize('name', MOTIONS)
def test_twists_and_accelerations_are_derivatives(name: str) -> None:
    path, step = MOTIONS[name](rng(4)), 1e-5
    before, motion, after = (path(TIMES[1:] + n * step) for n in (-1, 0, 1))
    np.testing.assert_allclose(
        (after.position - before.position) / (2.0 * step), motion.linear_velocity, atol=1e-8)
    np.testing.assert_allclose(
        (after.rows[:, 12:18] - before.rows[:, 12:18]) / (2.0 * step), motion.rows[:, 18:],
        atol=1e-6)


def test_motions_are_what_their_names_say() -> None:
    p = drawn(2).parameters
    for axis in AXES:
        moved = np.ptp(MOTIONS[axis](rng(5))(TIMES).rows[:, 12:18], axis=0) > 1e-9
        assert np.flatnonzero(moved).tolist() == [AXES.index(axis)]
    assert np.abs(moving(p, MOTIONS['slow'](rng(5))(TIMES)).rates).max() < 1.01 * SLOW
    assert not np.any(MOTIONS['gentle, then rest'](rng(5))(TIMES[TIMES > 10.0]).rows[:, 12:18])


@pytest.mark.parametrize('begin', [0.0, 5.0])
def test_a_stopped_time_stands_and_goes_on(begin: float) -> None:
    times, rates, _ = stopping(begin, begin + 3.0)(TIMES)
    held = (TIMES >= begin) & (TIMES <= begin + 3.0)
    assert np.ptp(times[held]) < 1e-12 and not rates[held].any()
    assert rates[0] == 0.0 and rates[-1] == 1.0 and np.all(np.diff(times) >= -1e-12)
