# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Identities of the dynamics that hold for each kind of legs, on bases that move."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from crank_machines import random_machine, random_state
from crank_platforms import base_of, motion_of, parameters_of
import numpy as np
import pytest
from referees import (
    Array, friction, random_base_motion, random_direction, random_motion, random_parameters,
    random_wrench, relative, rng, rotation_about)
from stewart_dynamics import BaseMotion, Motion, Pose, StewartPlatform
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    linear_parameters, parameter_values)
from test_drives import driven

COUNT = 21  # more than twice the samples that are computed side by side
# Kinds of hexapods, and the largest relative difference of two ways to an effort.
KINDS = {'telescopic': 1e-13, 'turning screws': 1e-12, 'crank': 1e-10}
EVERY = pytest.mark.parametrize('kind', KINDS)
SEEDS = pytest.mark.parametrize('seed', range(8))


class Case(NamedTuple):
    """A hexapod in motions under wrenches on a base that moves."""

    platform: StewartPlatform
    motion: Motion
    wrench: Array
    base: BaseMotion

    def efforts(self, platform: StewartPlatform | None = None, base: bool = True,
                wrench: bool = True) -> Array:
        """Return the efforts of the drives, of this or of another platform."""
        used = platform or self.platform
        result = used.inverse_dynamics(
            self.motion, self.wrench if wrench else None, self.base if base else None)
        found: Array = getattr(result, used.parameters.leg_kind.effort.field)
        return found


@cache
def case(kind: str, seed: int) -> Case:
    """Return a random hexapod of a kind in random motions."""
    random = rng(seed)
    if kind == 'crank':
        machine = random_machine(random, (0.0, 1.0, 20.0, None)[seed % 4])
        states = [random_state(machine, random) for _ in range(COUNT)]
        rows, bases = (np.stack([of(state).rows for state in states])
                       for of in (motion_of, base_of))
        return Case(StewartPlatform(parameters_of(machine)), Motion.of_rows(rows),
                    np.stack([state.wrench for state in states]), BaseMotion.of_rows(bases))
    p = random_parameters(random)
    if kind == 'turning screws':
        p = driven(p, random, **{'drive.screw_rotation': 'universal',
                                 'drive.screw_hand': ['right', 'left'][seed % 2]})
    return Case(StewartPlatform(p), random_motion(p, random, COUNT),
                random_wrench(p, random, COUNT), random_base_motion(p, random, COUNT))


@EVERY
@SEEDS
def test_efforts_are_those_of_the_readable_equations(kind: str, seed: int) -> None:
    platform, motion, wrench, base = given = case(kind, seed)
    twist, acceleration = motion.rows[:, 12:18, None], motion.rows[:, 18:24, None]
    load = (platform.mass_matrix(motion) @ acceleration
            + platform.coriolis_matrix(motion, base=base) @ twist
            + platform.gravity_vector(motion, base)[..., None] - wrench[..., None])
    jacobian = platform.drive_jacobian(motion)
    truth = np.linalg.solve(np.swapaxes(jacobian, -1, -2), load)[..., 0] + friction(
        platform.parameters, (jacobian @ twist)[..., 0])
    assert relative(given.efforts(), truth) < KINDS[kind]


@EVERY
@SEEDS
def test_forward_dynamics_of_inverse_dynamics_is_the_motion(kind: str, seed: int) -> None:
    platform, motion, wrench, base = given = case(kind, seed)
    found = platform.forward_dynamics(motion, given.efforts(), wrench, base)
    assert relative(found.rows, motion.rows) < (1e-9 if kind == 'crank' else 1e-11)


@EVERY
@SEEDS
def test_regressor_and_breakdown_sum_to_the_efforts(kind: str, seed: int) -> None:
    platform, motion, wrench, base = given = case(kind, seed)
    p, tolerance = platform.parameters, max(KINDS[kind], 1e-12)
    regressor, theta = platform.regressor(motion, base), linear_parameters(p)
    assert regressor.matrix.shape == (COUNT, 6, len(regressor.names)) == (COUNT, 6, len(theta))
    free = given.efforts(wrench=False)
    off = np.abs(regressor.matrix @ theta - free).max(axis=1) / np.abs(free).max(axis=1)
    assert off.max() < tolerance
    parts = platform.force_breakdown(motion, wrench, base)
    assert relative(parts.total, given.efforts()) < tolerance
    rates = platform.drive_jacobian(motion) @ motion.rows[:, 12:18, None]
    assert relative(parts.friction, friction(p, rates[..., 0])) < tolerance
    resting = given._replace(motion=Motion.from_pose(motion.pose), base=BaseMotion(base.gravity))
    assert relative(parts.gravity, resting.efforts(wrench=False)) < tolerance


@EVERY
@SEEDS
def test_one_sample_has_the_bits_of_many(kind: str, seed: int) -> None:
    platform, motion, wrench, base = given = case(kind, seed)
    efforts = given.efforts()
    for load, moved in ((wrench, base), (None, None)):
        many = (platform.inverse_dynamics(motion, load, moved).rows,
                platform.forward_dynamics(motion, efforts, load, moved).rows,
                platform.base_wrench(motion, load, moved))
        for n in range(COUNT):
            one = (motion[n], None if load is None else load[n],
                   None if moved is None else moved[n])
            alone = (platform.inverse_dynamics(*one).rows,
                     platform.forward_dynamics(one[0], efforts[n], *one[1:]).rows,
                     platform.base_wrench(*one))
            assert [each.tobytes() for each in alone] == [each[n].tobytes() for each in many]


@EVERY
@SEEDS
def test_turning_the_base_is_turning_gravity(kind: str, seed: int) -> None:
    platform, motion, wrench, _ = given = case(kind, seed)
    turn = rotation_about(random_direction(rng()), 0.7)
    gravity = platform.parameters['gravity']
    base = BaseMotion.from_pose(Pose(np.zeros(3), turn), gravity)
    turned = StewartPlatform(platform.parameters.replaced({'gravity': turn.T @ gravity}))
    assert relative(given._replace(base=base).efforts(),
                    given.efforts(turned, base=False)) < KINDS[kind]
    assert relative(platform.base_wrench(motion, wrench, base),
                    turned.base_wrench(motion, wrench)) < KINDS[kind]


@EVERY
@SEEDS
def test_a_falling_hexapod_at_rest_needs_no_efforts(kind: str, seed: int) -> None:
    given = case(kind, seed)
    given = given._replace(motion=Motion.from_pose(given.motion.pose))
    gravity = given.platform.parameters['gravity']
    falling = given._replace(base=BaseMotion(gravity, gravity)).efforts(wrench=False)
    weight = np.abs(given.efforts(base=False, wrench=False)).max()
    assert np.abs(falling).max() < 1e-12 * weight


@EVERY
@SEEDS
def test_parameters_come_back_from_their_linear_form(kind: str, seed: int) -> None:
    p = case(kind, seed).platform.parameters
    relative_tolerance, absolute = (1e-7, 1e-9) if kind == 'crank' else (1e-9, 0.0)
    for name, value in parameter_values(linear_parameters(p), p).items():
        truth = p.leg_kind.expanded(p, name)
        np.testing.assert_allclose(value, truth, rtol=relative_tolerance, err_msg=name,
                                   atol=1e-12 + absolute * np.abs(truth).max())
