# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Forces on a base that moves: against Pinocchio, the Lagrange reference, and identities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from referees import (
    each_relative, PinocchioReferee,
    random_base_motion, random_direction, random_motion, random_parameters, random_wrench,
    relative, rng, rotation_about, size_of, STANDARD_GRAVITY)
from snapshot import Snapshot

from stewart_dynamics import BaseMotion, Motion, MotionError, Pose, StewartPlatform
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES

MACHINES = 8
LANES = 8  # the most samples that are computed side by side
STATES = 10

Case = tuple[StewartPlatform, Motion, Any, BaseMotion]


def case(seed: int, many: int = STATES) -> Case:
    """Return a machine in motions under wrenches on a base that moves."""
    random = rng(seed)
    p = random_parameters(random)
    return (StewartPlatform(p), random_motion(p, random, many), random_wrench(p, random, many),
            random_base_motion(p, random, many))


@pytest.mark.parametrize('seed', range(MACHINES))
def test_forces_and_base_wrench_are_those_of_pinocchio(seed: int) -> None:
    platform, motion, wrench, base = case(seed)
    referee = PinocchioReferee(platform.parameters, rng(seed))
    truth = [referee.forces_and_base_wrench(motion[n], wrench[n], base[n]) for n in range(STATES)]
    forces = platform.inverse_dynamics(motion, wrench, base).forces
    assert each_relative(forces, [each for each, _ in truth]) < 1e-12
    found = platform.base_wrench(motion, wrench, base)
    assert each_relative(found, [each for _, each in truth]) < 1e-12


def test_a_base_at_rest_gives_the_same_bits() -> None:
    platform, motion, wrench, _ = case(2, 2 * LANES + 5)
    gravity = platform.parameters['gravity']
    still = BaseMotion(gravity)
    for base in (still, BaseMotion(np.tile(gravity, (len(motion), 1)))):
        assert platform.inverse_dynamics(motion, wrench, base) == platform.inverse_dynamics(
            motion, wrench)
        assert np.array_equal(platform.base_wrench(motion, wrench, base),
                              platform.base_wrench(motion, wrench))
    assert platform.inverse_dynamics(motion[0], base=still) == platform.inverse_dynamics(motion[0])
    forces = np.ones(6)
    assert platform.forward_dynamics(motion, forces, base=still) == platform.forward_dynamics(
        motion, forces)


def test_rows_of_nan_among_others_add_nothing() -> None:
    platform, motion, wrench, base = case(4, 3 * LANES)
    rows = base.rows.copy()
    rows[::3] = np.nan
    rows[LANES:2 * LANES] = np.nan
    still = np.isnan(rows[:, 0])
    found = platform.solve(motion.rows, wrench, rows)
    assert np.array_equal(found[still], platform.solve(motion.rows, wrench)[still])
    assert np.array_equal(found[~still], platform.solve(motion.rows, wrench, base.rows)[~still])


def test_the_sources_sum_to_the_force() -> None:
    platform, motion, wrench, base = case(8)
    by = platform.force_breakdown(motion, wrench, base)
    assert relative(by.total, platform.inverse_dynamics(motion, wrench, base).forces) < 1e-12
    assert np.abs(by.base_motion).max() > 1.0
    assert SOURCES[-1] == 'base motion'
    # Gravity is not part of the motion of the base; independent sources are unchanged.
    tilted = platform.force_breakdown(motion, wrench, BaseMotion(base.gravity))
    assert np.array_equal(tilted.gravity, by.gravity)
    assert np.abs(tilted.base_motion).max() < 1e-12 * np.abs(by.gravity).max()
    still = platform.force_breakdown(motion, wrench)
    assert not still.base_motion.any()
    for name in ('platform_inertia', 'leg_inertia', 'velocity', 'friction', 'wrench'):
        assert np.array_equal(getattr(still, name), getattr(by, name))


def test_the_coriolis_matrix_on_a_turning_base_keeps_its_identities() -> None:
    platform, motion, _, base = case(9)
    twist = motion.rows[:, 12:18, None]
    for christoffel in (False, True):
        still = platform.coriolis_matrix(motion, christoffel)
        added = platform.coriolis_matrix(motion, christoffel, base) - still
        assert relative(added, -np.swapaxes(added, -1, -2)) < 1e-12
        assert np.abs(np.swapaxes(twist, -1, -2) @ added @ twist).max() < 1e-9 * np.abs(
            added @ twist).max()
    assert np.array_equal(platform.mass_matrix(motion), platform.mass_matrix(motion.pose))


def test_the_base_wrench_needs_no_leg_force() -> None:
    """In a singular pose, and whatever the friction is."""
    p = random_parameters(rng(11))
    without = p.replaced({'actuator.reflected_mass': 0.0, 'actuator.viscous_friction': 0.0,
                          'actuator.coulomb_friction': 0.0})
    motion = random_motion(p, rng(), 3)
    assert np.array_equal(StewartPlatform(p).base_wrench(motion),
                          StewartPlatform(without).base_wrench(motion))


def test_an_external_wrench_goes_through_to_the_base() -> None:
    platform, motion, wrench, base = case(12)
    gained = platform.base_wrench(motion, wrench, base) - platform.base_wrench(motion, None, base)
    truth = wrench.copy()
    truth[:, 3:] += np.cross(motion.position, wrench[:, :3])
    assert relative(gained, truth) < 1e-11


# BaseMotion

def test_an_imu_anywhere_on_the_base_gives_its_motion() -> None:
    random = rng(13)
    p = random_parameters(random)
    platform, size = StewartPlatform(p), size_of(p)
    motion, base = random_motion(p, random, STATES), random_base_motion(p, random, STATES)
    arm, mounting = random.normal(size=3) * size, rotation_about(random_direction(random), 2.0)
    at_imu = (base.linear_acceleration + np.cross(base.angular_acceleration, arm)
              + np.cross(base.angular_velocity, np.cross(base.angular_velocity, arm)))
    found = BaseMotion.from_imu(
        (at_imu - base.gravity) @ mounting, base.angular_velocity @ mounting,
        base.angular_acceleration @ mounting, arm, mounting)
    assert relative(found.gravity, base.gravity - base.linear_acceleration) < 1e-12
    assert relative(platform.inverse_dynamics(motion, base=found).forces,
                    platform.inverse_dynamics(motion, base=base).forces) < 1e-12
    assert relative(platform.base_wrench(motion, base=found),
                    platform.base_wrench(motion, base=base)) < 1e-12


def test_a_motion_in_the_world_is_turned_into_base_axes() -> None:
    turn = rotation_about(random_direction(rng()), 1.0)
    world = Motion(np.ones(3), turn, [9.0, 9.0, 9.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0],
                   [7.0, 8.0, 9.0])
    base = BaseMotion.from_motion(world)
    assert np.allclose(base.gravity, turn.T @ [0.0, 0.0, -STANDARD_GRAVITY], rtol=1e-14)
    assert np.allclose(base.angular_velocity, turn.T @ [1.0, 2.0, 3.0], rtol=1e-14)
    assert np.allclose(base.linear_acceleration, turn.T @ [4.0, 5.0, 6.0], rtol=1e-14)
    assert np.allclose(base.angular_acceleration, turn.T @ [7.0, 8.0, 9.0], rtol=1e-14)
    assert np.array_equal(BaseMotion.from_pose(world).gravity, base.gravity)
    assert not BaseMotion.from_pose(world).rows[3:].any()


def test_base_motions_are_a_sequence_of_samples() -> None:
    base = case(14, 6)[3]
    assert len(base) == 6
    assert base[2:4].shape == (2,)
    assert f'{base}' == '<BaseMotion of shape (6,)>'
    assert f'{BaseMotion([0.0, 0.0, -9.8])}' == (
        '<BaseMotion: gravity [0, 0, -9.8] m/s^2, acceleration [0, 0, 0] m/s^2, turning '
        '[0, 0, 0] rad/s, [0, 0, 0] rad/s^2>')


@pytest.mark.parametrize('make', [
    lambda: BaseMotion([0.0, 0.0]),
    lambda: BaseMotion([0.0, 0.0, np.nan]),
    lambda: BaseMotion(np.zeros((2, 3)), np.zeros((3, 3))),
    lambda: BaseMotion.from_motion(Motion(np.zeros((4, 3)), np.eye(3)), np.zeros((3, 3))),
    lambda: BaseMotion.from_pose(np.eye(3)),  # type: ignore
    lambda: BaseMotion.from_motion(Pose(np.zeros(3), np.eye(3))),
    lambda: BaseMotion.from_imu(np.zeros(3), np.zeros((2, 3)), np.zeros((4, 3))),
    lambda: BaseMotion.from_imu(np.zeros(3), np.zeros(3), rotation=np.zeros((3, 3)))])
def test_wrong_arguments_are_rejected(make: Any, snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        make()


def test_numbers_that_overflow_are_no_still_base() -> None:
    platform, motion, _, _ = case(18, 1)
    for make in (lambda: BaseMotion.from_imu([0.0, 0.0, 9.8], [1e200] * 3, None, [0.0, 1.0, -1.0]),
                 lambda: BaseMotion.from_pose(
                     Pose(np.zeros(3), rotation_about([0.6, 0.0, 0.8], 0.7)), [1.7e308] * 3)):
        with pytest.raises(MotionError) as error:
            make()
        assert 'base motion: out of range: numbers overflow' in str(error.value)
    spoilt = BaseMotion([0.0, 0.0, -9.8])
    spoilt.rows[0] = np.nan
    for some in (motion, motion[0]):
        for call in (lambda m: platform.inverse_dynamics(m, base=spoilt),
                     lambda m: platform.forward_dynamics(m, np.zeros(6), base=spoilt)):
            with pytest.raises(MotionError):
                call(some)


@pytest.mark.parametrize('call', ['inverse_dynamics', 'base_wrench', 'force_breakdown'])
def test_a_base_of_another_type_or_shape_is_rejected(call: str, snapshot: Snapshot) -> None:
    platform, motion, wrench, base = case(15, 3)
    for wrong, text in ((np.zeros(12), 'must be a BaseMotion'), (base[:2], 'base (2,)')):
        for some in (motion, motion[0]):
            if some.shape or text.startswith('must'):
                with pytest.raises(MotionError) as error:
                    getattr(platform, call)(some, None, wrong)
                assert text in str(error.value)
    with snapshot.raises(MotionError):
        getattr(platform, call)(motion[0], base[0])
    with pytest.raises(MotionError) as error:
        getattr(platform, call)(motion, None, BaseMotion([0.0, 0.0, 0.0], [1e308] * 3,
                                                         [1e200, 0.0, 0.0]))
    assert 'overflow' in str(error.value)
