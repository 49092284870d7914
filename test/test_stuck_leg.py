# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A stuck leg: its motions have no rate of it, its loads bring another leg to its limit."""

from __future__ import annotations

from pathlib import Path

from legs_of_all_kinds import KINDS, random_hexapod
import numpy as np
import pytest
from referees import random_motion, relative, rng
from scipy.optimize import linprog
from snapshot import Snapshot

from stewart_dynamics import Capability, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.errors import MotionError

FILE = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
PLATFORM = StewartPlatform(FILE)
CAPABILITY = Capability(PLATFORM)
POSES = random_motion(FILE.replaced({}), rng(1), 4).pose


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('leg', range(6))
def test_five_motions_remain_and_are_all_without_a_rate_of_the_leg(kind: str, leg: int) -> None:
    p, motions = random_hexapod(kind, 1, 4)
    platform, poses = StewartPlatform(p), motions.pose
    found = Capability(platform).stuck_leg(poses, leg)
    rates = np.einsum('nij,nmj->nmi', platform.drive_jacobian(poses), found.motions)
    assert np.abs(rates[..., leg]).max() < 1e-12 * np.abs(rates).max()
    # Orthonormal with the lost one where rotations count by the characteristic length.
    whole = np.concatenate([found.motions, found.lost[:, None]], axis=1)
    whole *= np.repeat([1.0, p.singularity.characteristic_length], 3)
    assert np.abs(whole @ np.swapaxes(whole, 1, 2) - np.eye(6)).max() < 1e-12
    # Along its wrench each motion has the power of its length, across the others none.
    power = found.motions @ np.swapaxes(found.wrenches, 1, 2)
    assert np.abs(power - np.eye(5)).max() < 1e-12
    others = np.linalg.norm(np.delete(rates, leg, axis=-1), axis=-1)
    assert np.all(np.diff(others, axis=1) > -1e-12)


@pytest.mark.parametrize('leg', range(6))
def test_rates_and_forces_of_the_others_reach_their_limits(leg: int) -> None:
    found = CAPABILITY.stuck_leg(POSES, leg)
    assert found.velocity is not None and found.load is not None and found.payload is not None
    rates = np.einsum('nij,nmj->nmi', PLATFORM.inverse_jacobian(POSES),
                      found.velocity.value[..., None] * found.motions)
    assert np.abs(rates).max(axis=-1) == pytest.approx(np.full((4, 5), 0.5), rel=1e-12)
    others = np.delete(np.arange(6), leg)
    still = Motion.from_pose(POSES)
    for n in range(5):
        for side, sign in enumerate((1.0, -1.0)):
            value = found.load.value[:, n, side, None]
            forces = PLATFORM.inverse_dynamics(
                still, -sign * value * found.wrenches[:, n]).forces[:, others]
            assert np.abs(forces).max(axis=-1) == pytest.approx(np.full(4, 6000.0), rel=1e-12)
    # More than the hexapod whose leg has to hold as well.
    whole = CAPABILITY.wrench(
        Pose(POSES.position[:, None], POSES.rotation[:, None]), found.wrenches)
    assert np.all(found.load.value[..., 0] >= whole.value * (1.0 - 1e-12))
    assert not np.any(found.load.leg == leg) and not np.any(found.payload.leg == leg)


def test_the_payload_is_that_of_a_linear_program() -> None:
    """An independent method: the largest m with |f0 + m df| within the limits of five legs."""
    center = np.array([0.1, -0.2, 0.3])
    pose = PLATFORM.home_pose()
    still = Motion.from_pose(pose)
    empty = PLATFORM.inverse_dynamics(still).forces
    loaded = StewartPlatform(FILE.replaced({
        'payload.mass': 1.0, 'payload.center_of_mass': center})).inverse_dynamics(still).forces
    for leg in range(6):
        others = np.delete(np.arange(6), leg)
        change = (loaded - empty)[others]
        solved = linprog([-1.0], np.concatenate([change, -change])[:, None], np.concatenate([
            6000.0 - empty[others], 6000.0 + empty[others]]))
        found = CAPABILITY.stuck_leg(pose, leg, center)
        assert found.payload is not None
        assert relative(np.array([found.payload.value]), solved.x) < 1e-9


def test_what_has_no_limit_is_not_answered_and_a_wrong_leg_rejected(snapshot: Snapshot) -> None:
    free = Capability(StewartPlatform(FILE.replaced({
        'limits.force_max': None, 'limits.velocity_max': None})))
    found = free.stuck_leg(PLATFORM.home_pose(), 2)
    assert (found.velocity, found.load, found.payload) == (None, None, None)
    assert found.motions.shape == (5, 6) and found.lost.shape == (6,)
    for leg in (6, -1, 1.0):
        with snapshot.raises(MotionError):
            CAPABILITY.stuck_leg(PLATFORM.home_pose(), leg)  # type: ignore[arg-type]
