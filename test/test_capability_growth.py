# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A motion that grows until its first limit: never past one that is exceeded only shortly."""

from __future__ import annotations

import numpy as np
import pytest
from referees import random_motion, random_parameters, rng, size_of

from stewart_dynamics import (
    BaseMotion, Capability, Motion, MotionError, Pose, StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.capability.growth import Growth
from stewart_dynamics.capability.motions import Deviations
from stewart_dynamics.capability.motor_bounds import MotorBounds
from stewart_dynamics.mechanics.limits import Limits
from stewart_dynamics.mechanics.rows import CONDITION
from test_capability_motors import driven

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
def test_a_limit_that_is_exceeded_only_shortly_is_found(limit: str) -> None:
    """A limit just below the first maximum of a leg: left and entered again within 1e-3."""
    cases = 0
    for seed in range(8):
        platform, home, deviations = growing(seed)
        end = min(Capability(platform).travel(home, deviations.changes[0, 0]).value, 3.0)
        factors: Array = np.linspace(0.0, end, COUNT)
        solved = platform.inverse_dynamics(dense(deviations, factors), singular='nan')
        values = np.abs(solved.rates if limit == 'velocity_max' else solved.forces)
        for leg in range(6):
            record = np.maximum.accumulate(values[:, leg])
            inner = values[1:-1, leg]
            peaks = 1 + np.flatnonzero((inner > values[:-2, leg]) & (inner >= values[2:, leg])
                                       & (inner >= record[1:-1]))
            if not len(peaks) or values[peaks[0]:, leg].max() <= values[peaks[0], leg]:
                continue
            bound = np.full(6, 1e9)
            bound[leg] = values[peaks[0], leg] * (1.0 - 1e-7)
            at = factors[peaks[0]]
            found = Capability(StewartPlatform(platform.parameters.replaced(
                {f'limits.{limit}': bound}))).amplitude_factor(
                    dense(deviations, np.ones(1)), home)
            outside = factors[values[:, leg] > bound[leg]]
            assert at - end / 64.0 < found.value <= outside[0]
            assert (found.limit, found.leg) == (limit, leg)
            exact = platform.inverse_dynamics(dense(deviations, np.array([found.value])))
            reached = exact.rates if limit == 'velocity_max' else exact.forces
            assert abs(reached[0, leg]) == pytest.approx(bound[leg], rel=1e-9)
            cases += 1
    assert cases > 2


@pytest.mark.parametrize('seed', range(14))
def test_bounds_hold_between_factors(seed: int) -> None:
    """Rates, forces, speeds and torques, with a load, on a base that moves."""
    random = rng(seed)
    # From 10 on turning screws have a lead that makes J_q another matrix than J_inv.
    coarse = {'actuator.screw_lead': 0.3} if seed >= 10 else {}
    platform = driven(seed, **{'limits.force_max': 1e3, 'limits.velocity_max': 0.5, **coarse})
    p = platform.parameters
    home = Motion.from_pose(platform.home_pose())
    deviations = Deviations(home, random_motion(p, random, 1).rows)
    base = BaseMotion(random.normal(size=3), *random.normal(size=(3, 3)))
    growth = Growth(platform, Limits(p).bounds, MotorBounds(p), deviations,
                    100.0 * random.normal(size=6), base)
    finite = 0
    for _ in range(20):
        low = random.uniform(0.0, 1.0)
        high = low + 10.0 ** random.uniform(-4.0, -0.7)
        which = np.zeros(201, dtype=np.int64)
        ratios = np.abs(growth.state(np.linspace(low, high, 201), which).ratios).max(axis=0)
        begin, middle, end = (growth.state(np.array([k]), which[:1]) for k in (
            low, 0.5 * (low + high), high))
        for chord in (False, True):
            bounds = growth.bounds(middle, begin.smooth, end.smooth, np.array([high - low]),
                                   which[:1], chord)[0]
            assert (ratios <= bounds * (1.0 + 1e-12)).all()
            finite += int((bounds < 10.0 * ratios).sum())
    assert finite > 50


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


def test_a_motion_into_a_singularity_ends_where_it_cannot_be_solved() -> None:
    """Forces below their limit up to det(J) = 0: beyond its range their growth is not decided."""
    platform, home, _ = growing(1)
    unlimited = StewartPlatform(platform.parameters.replaced({
        'singularity.stop_condition': 1e300, 'limits.force_max': 1e300}))
    turned = Motion.from_pose(Pose(home.position, np.array(
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ home.rotation))
    found = Capability(unlimited).amplitude_factor(turned[None], home)
    assert found.limit == 'singularity'
    reached = unlimited.solve(Deviations(home, turned[None].rows).at(found.value))
    assert 1e11 < reached[0, CONDITION] < 1e12
    growth = Growth(unlimited, Limits(unlimited.parameters).bounds, None,
                    Deviations(home, turned[None].rows), None, None)
    with pytest.raises(MotionError, match='sample 0: not known whether a limit is exceeded at .* '
                                          'times its amplitude: too near to a singularity'):
        growth.first_exit(1.0)
