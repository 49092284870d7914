# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""One sample alone gives the bits of the batch, errors as the batch, and from many threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from referees import (
    random_motion, random_parameters, random_wrench, rng, ROOT)
from snapshot import Snapshot

from stewart_dynamics import BaseMotion, Motion, MotionError, Pose, StewartPlatform
from stewart_dynamics.mechanics.single_sample import SingleSample

MANY = 40


@pytest.fixture(scope='module')
def platform() -> StewartPlatform:
    """Return a hexapod."""
    return StewartPlatform(random_parameters(rng()))


@pytest.fixture(scope='module')
def motion(platform: StewartPlatform) -> Motion:
    """Return motions in its workspace."""
    return random_motion(platform.parameters, rng(), MANY)


@pytest.fixture(scope='module')
def wrench(platform: StewartPlatform) -> Any:
    """Return a wrench for each."""
    return random_wrench(platform.parameters, rng(), MANY)


def test_one_sample_is_the_batch_bit_for_bit(
        platform: StewartPlatform, motion: Motion, wrench: Any) -> None:
    single = SingleSample(platform.structure)
    batch = platform.inverse_dynamics(motion, wrench)
    back = platform.forward_dynamics(motion, batch.forces, wrench)
    lengths = batch.lengths.copy()
    guess = Pose(motion.position + 1e-3, motion.rotation)
    poses = platform.forward_kinematics(lengths, guess)
    for n in range(MANY):
        assert np.array_equal(
            single.inverse_dynamics(motion[n], None, wrench[n], None), batch.rows[n])
        assert np.array_equal(
            single.forward_dynamics(
                motion[n], batch.forces[n], wrench[n], None), back.rows[n])
        assert np.array_equal(single.forward_kinematics(lengths[n], guess[n]), poses.rows[n])
        # and the call of the library is this one
        assert np.array_equal(platform.inverse_dynamics(motion[n], wrench[n]).rows, batch.rows[n])
        assert platform.forward_dynamics(motion[n], batch.forces[n], wrench[n]) == back[n]
        assert platform.forward_kinematics(lengths[n], guess[n]) == poses[n]
        for at in (motion[n], motion[n].pose):
            assert np.array_equal(platform.inverse_kinematics(at), batch.lengths[n])
    no_load = platform.inverse_dynamics(motion)
    for n in range(MANY):  # no load is left from the calls above
        assert np.array_equal(platform.inverse_dynamics(motion[n]).rows, no_load.rows[n])
    at = Motion.from_pose(guess[0])
    assert platform.forward_kinematics(lengths[0], at) == poses[0]


def test_results_do_not_share_memory(platform: StewartPlatform, motion: Motion) -> None:
    first = platform.inverse_dynamics(motion[0])
    kept = first.rows.copy()
    other = platform.inverse_dynamics(motion[1])
    assert np.array_equal(first.rows, kept)
    other.forces[:] = 0.0
    assert np.array_equal(platform.inverse_dynamics(motion[0]).rows, kept)


def test_the_home_pose_may_be_changed_by_who_gets_it() -> None:
    platform = StewartPlatform.from_yaml(ROOT / 'config' / 'platform.yaml')
    first = platform.home_pose()
    truth = first.rows.copy()
    first.rows[:] = 0.0
    assert np.array_equal(platform.home_pose().rows, truth)


def test_arguments_of_other_types_are_converted(
        platform: StewartPlatform, motion: Motion, wrench: Any) -> None:
    load = np.round(wrench[0])
    truth = platform.inverse_dynamics(motion[0], load)
    twice = np.repeat(load, 2)
    for same in (load.tolist(), tuple(load), load.astype(int), load.astype(np.float32),
                 load.astype('>f8'), twice[::2]):
        assert np.array_equal(platform.inverse_dynamics(motion[0], same).rows, truth.rows)
    one_of_many = platform.inverse_dynamics(motion[0], load[None])
    assert one_of_many.lengths.shape == (1, 6)
    assert np.array_equal(one_of_many.rows[0], truth.rows)
    strided = Motion.of_rows(np.repeat(motion.rows[:1], 2, axis=1)[:, ::2])[0]
    assert np.array_equal(platform.inverse_dynamics(strided, load).rows, truth.rows)


@pytest.mark.parametrize('call', [
    lambda p, m: p.inverse_dynamics(m, [0.0, 0.0, np.nan, 0.0, 0.0, 0.0]),
    lambda p, m: p.inverse_dynamics(m, np.full(6, np.inf)),
    lambda p, m: p.inverse_dynamics(m, np.full(6, 1e308)),
    lambda p, m: p.inverse_dynamics(m, np.zeros(5)),
    lambda p, m: p.inverse_dynamics(m, np.zeros(6, dtype=complex)),
    lambda p, m: p.inverse_dynamics(m, singular='skip'),
    lambda p, m: p.inverse_dynamics(m.pose),
    lambda p, m: p.inverse_dynamics(None),
    lambda p, m: p.inverse_dynamics(m, base=BaseMotion.of_rows(np.full(12, np.nan))),
    lambda p, m: p.forward_dynamics(m, np.full(6, np.nan)),
    lambda p, m: p.forward_dynamics(m, None),
    lambda p, m: p.forward_dynamics(m, np.zeros(6), np.full(6, -np.inf)),
    lambda p, m: p.forward_kinematics(np.full(6, np.nan), m),
    lambda p, m: p.forward_kinematics(np.zeros(6), m.position),
])
def test_wrong_arguments_are_rejected_and_the_next_call_is_right(
        platform: StewartPlatform, motion: Motion, call: Callable[..., Any]) -> None:
    truth = platform.inverse_dynamics(motion[0])
    with pytest.raises(MotionError):
        call(platform, motion[0])
    assert np.array_equal(platform.inverse_dynamics(motion[0]).rows, truth.rows)


def test_many_threads_share_a_platform(platform: StewartPlatform, motion: Motion) -> None:
    truth = platform.inverse_dynamics(motion).rows

    def work(seed: int) -> bool:
        order = np.random.default_rng(seed).integers(0, MANY, 2000)
        return all(np.array_equal(platform.inverse_dynamics(motion[n]).rows, truth[n])
                   for n in order)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(4)))


def test_samples_of_arrays_and_of_lists_are_the_same(motion: Motion) -> None:
    for n in range(MANY):
        arrays = [getattr(motion[n], name).copy() for name in (
            'position', 'rotation', 'linear_velocity', 'angular_velocity',
            'linear_acceleration', 'angular_acceleration')]
        of_arrays = Motion(*arrays)
        assert of_arrays == Motion(*(array.tolist() for array in arrays)) == motion[n]
        assert Motion(*arrays[:2]) == Motion(*(array.tolist() for array in arrays[:2]))
        assert Pose(*arrays[:2]) == Pose(*(array.tolist() for array in arrays[:2]))
        assert of_arrays.shape == Pose(*arrays[:2]).shape == ()


@pytest.mark.parametrize('off', [0.85e-6, 0.95e-6, 1.05e-6])
def test_a_rotation_is_accepted_up_to_the_same_tolerance_by_both_ways(
        off: float, snapshot: Snapshot) -> None:
    rotation = np.eye(3)
    rotation[0, 1] = off
    if off < 1e-6:
        assert Pose(np.zeros(3), rotation) == Pose([0.0] * 3, rotation.tolist())
    else:
        for at in (np.zeros(3), [0.0] * 3):
            with snapshot.raises(MotionError):
                Pose(at, rotation)
