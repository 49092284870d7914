# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A motion that grows until its first limit, compared with dense sampling."""

from __future__ import annotations

import numpy as np
import pytest
from referees import random_motion, random_parameters, rng, size_of
from scipy.spatial.transform import Rotation

from stewart_dynamics import Capability, Motion, Pose, StewartPlatform
from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.motions import Deviations
from stewart_dynamics.mechanics.rows import CONDITION
from test_capability import limited

COUNT = 20_000


def growing(seed: int) -> tuple[StewartPlatform, Motion, Deviations]:
    """Return a random hexapod without limits, a pose, and a sample far from it."""
    random = rng(seed)
    platform = StewartPlatform(random_parameters(random))
    home = Motion.from_pose(Pose(size_of(platform.parameters) * np.array([0.0, 0.0, 1.0]),
                                 np.eye(3)))
    return platform, home, Deviations(home, random_motion(platform.parameters, random, 1).rows)


def dense(deviations: Deviations, factors: Array) -> Motion:
    """Return the first sample at many factors."""
    return Motion.of_rows(deviations.at(factors, np.zeros(len(factors), dtype=np.int64)))


@pytest.mark.parametrize('limit', ['velocity_max', 'force_max'])
def test_a_limit_that_is_exceeded_for_more_than_a_step_is_found(limit: str) -> None:
    """A limit below the first maximum of a leg: exceeded for more than two steps around it."""
    cases = 0
    for seed in range(8):
        platform, home, deviations = growing(seed)
        end = min(Capability(platform).travel(home, deviations.changes[0, 0]).value, 3.0)
        factors: Array = np.linspace(0.0, end, COUNT)
        solved = platform.inverse_dynamics(dense(deviations, factors), singular='nan')
        values = np.abs(solved.rates if limit == 'velocity_max' else solved.forces)
        for leg in range(6):
            bound = np.full(6, 1e9)
            bound[leg] = values[0, leg] + 0.5 * (values[:, leg].max() - values[0, leg])
            outside = values[:, leg] > bound[leg]
            if not outside.any() or not outside[outside.argmax():][:COUNT // 20].all():
                continue
            found = Capability(StewartPlatform(platform.parameters.replaced(
                {f'limits.{limit}': bound}))).amplitude_factor(
                    dense(deviations, np.ones(1)), home)
            at = int(outside.argmax())
            assert factors[max(at - 1, 0)] <= found.value <= factors[at]
            assert (found.limit, found.leg) == (limit, leg)
            exact = platform.inverse_dynamics(dense(deviations, np.array([found.value])))
            reached = exact.rates if limit == 'velocity_max' else exact.forces
            assert abs(reached[0, leg]) == pytest.approx(bound[leg], rel=1e-9)
            cases += 1
    assert cases > 10


@pytest.mark.parametrize('factor', [1e-9, 1.0, 3e5])
def test_a_motion_without_displacement_grows_with_its_rates(factor: float) -> None:
    """Rates grow in proportion, forces with the square of the rates: both roots are known."""
    given, home, _ = growing(0)
    platform = StewartPlatform(given.parameters.replaced({
        'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0}))
    twist = np.array([0.3, -0.2, 0.1, 0.4, 0.1, -0.2])
    moving = Motion(home.position[None], home.rotation[None], twist[None, :3], twist[None, 3:])
    solved, still = platform.inverse_dynamics(moving), platform.inverse_dynamics(home)
    rates, change = solved.rates[0], solved.forces[0] - still.forces
    leg = int((change * np.sign(still.forces)).argmax())
    for name, bound in (('velocity_max', factor * np.abs(rates).max()), (
            'force_max', np.where(np.arange(6) == leg, abs(
                still.forces[leg] + factor ** 2 * change[leg]), 1e300))):
        if name == 'force_max' and factor < 1.0:
            continue  # lost in the weight
        limited = StewartPlatform(platform.parameters.replaced({f'limits.{name}': bound}))
        found = Capability(limited).amplitude_factor(moving, home)
        assert found.value == pytest.approx(factor, rel=1e-9)
        assert found.limit == name


def test_poses_grow_until_the_first_of_their_travels_ends() -> None:
    """Displacements of sizes from 1e-6 on, some without translation or rotation."""
    for seed in range(12):
        random = rng(seed)
        platform, pose = limited(random, **{'limits.velocity_max': None, 'limits.force_max': None})
        changes = random.uniform(-1.0, 1.0, (40, 6)) * 10.0 ** random.uniform(-6.0, 0.0, (40, 1))
        changes[::3, 3:], changes[1::3, :3] = 0.0, 0.0
        moved = Motion.from_pose(Pose(
            pose.position + changes[:, :3],
            Rotation.from_rotvec(changes[:, 3:]).as_matrix() @ pose.rotation))
        found = Capability(platform).amplitude_factor(moved, pose)
        travels = Capability(platform).travel(pose, changes)
        assert found.value == pytest.approx(travels.value.min(), rel=1e-9)
        assert found.sample == travels.value.argmin()
        assert (found.limit, found.leg) == (
            travels.limit[found.sample], travels.leg[found.sample])


def test_a_motion_into_a_singularity_ends_where_it_cannot_be_solved() -> None:
    """Forces below their limit up to det(J) = 0."""
    platform, home, _ = growing(1)
    unlimited = StewartPlatform(platform.parameters.replaced({
        'singularity.stop_condition': 1e300, 'limits.force_max': 1e300}))
    turned = Motion.from_pose(Pose(home.position, np.array(
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ home.rotation))
    found = Capability(unlimited).amplitude_factor(turned[None], home)
    assert found.limit == 'singularity'
    reached = unlimited.solve(Deviations(home, turned[None].rows).at(found.value))
    assert 1e11 < reached[0, CONDITION] < 1e12
