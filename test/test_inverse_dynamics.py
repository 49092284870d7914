# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""Inverse dynamics against Pinocchio, other formulas, and itself in batches."""

from __future__ import annotations

from collections.abc import Iterator
import copy
import os
from pathlib import Path
import pickle
import subprocess
import sys
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
import pytest
from referees import (
    derivative, each_relative, energies, friction, moved,
    PinocchioReferee, QUARTER_TURN, random_base_motion, random_motion, random_parameters,
    random_wrench, relative, rng, rotation_about, smooth_motion, symmetric_parameters)
from snapshot import Snapshot

import stewart_dynamics
from stewart_dynamics import (
    Motion, MotionError, Parameters, Pose, SingularityError, StewartError, StewartPlatform)
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.rows import (
    ACCELERATION, CONDITION, DETERMINANT, FORCES, MOTION, TWIST)

Array = NDArray[np.float64]

PACKAGE = Path(stewart_dynamics.__file__).parent
HEXAPODS = 12
LANES = 8  # the most samples that are computed side by side
STATES = 15


def hexapods(random: Generator) -> Iterator[tuple[StewartPlatform, Motion]]:
    """Draw hexapods, each with a batch of motions."""
    for _ in range(HEXAPODS):
        parameters = random_parameters(random)
        yield StewartPlatform(parameters), random_motion(parameters, random, STATES)


def scaled_jacobian(platform: StewartPlatform, motion: Motion) -> Array:
    """Return J_inv with its right half divided by the characteristic length."""
    size = platform.parameters['singularity.characteristic_length']
    j: Array = platform.inverse_jacobian(motion) / [1, 1, 1, size, size, size]
    return j


def turned(angles: Any, turn_rate: float = 0.0, height: float = 1.0) -> Motion:
    """Return the platform above the base, turned about z, a batch."""
    poses = [rotation_about([0.0, 0.0, 1.0], angle) for angle in np.atleast_1d(angles)]
    return Motion([0.0, 0.0, height], poses, None, [0.0, 0.0, turn_rate])


def samples_of_all_kinds(many: int) -> tuple[StewartPlatform, Array]:
    """Return a symmetric hexapod and motions: ordinary, symmetric, near and on a singularity."""
    random = rng()
    platform = StewartPlatform(symmetric_parameters())
    rows = random_motion(platform.parameters, random, many).rows.copy()
    turns = [0.0, 0.3, np.pi / 2 - 0.1, np.pi / 2 - 1e-4, np.pi / 2 - 1e-9]
    special = turned(turns, 0.7).rows
    exact = Motion([[0.0, 0.0, 1.0]], QUARTER_TURN, None, [0.0, 0.0, 0.7]).rows
    rows[::9] = np.resize(np.vstack([special, exact]), rows[::9].shape)
    return platform, rows


def run(code: str, path: Path = PACKAGE.parent, **environment: str) -> str:
    """Run Python code against the package under a path, and return its output."""
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=path, capture_output=True, text=True, check=False,
        env={**os.environ, **environment, 'PYTHONPATH': str(path)})
    assert done.returncode == 0, done.stderr
    return done.stdout


# Physics

def test_forces_are_those_of_pinocchio() -> None:
    pytest.importorskip('pinocchio')
    random = rng()
    for _ in range(HEXAPODS):
        parameters = random_parameters(random)
        platform = StewartPlatform(parameters)
        referee = PinocchioReferee(parameters, random)
        motion = random_motion(parameters, random, STATES)
        wrenches = random_wrench(parameters, random, STATES)
        forces = platform.inverse_dynamics(motion, wrenches).forces
        for n in range(STATES):
            truth = referee.forces(motion[n], wrenches[n])
            assert relative(forces[n], truth) < 1e-12


def test_forces_near_a_singularity_are_those_of_pinocchio() -> None:
    pytest.importorskip('pinocchio')
    platform = StewartPlatform(symmetric_parameters())
    referee = PinocchioReferee(platform.parameters, rng())
    for short_of in (0.3, 1e-2, 1e-4, 1e-6):
        motion = turned(np.pi / 2 - short_of, 0.5)
        result = platform.inverse_dynamics(motion)
        truth = referee.forces(motion[0], np.zeros(6))
        assert relative(result.forces[0], truth) < 1e-14 * result.condition_number[0] + 1e-12


def test_forces_are_those_of_the_lagrange_matrices() -> None:
    random = rng()
    for platform, motion in hexapods(random):
        p = platform.parameters
        # in some samples the legs are as slow as where Coulomb friction is linear
        slowed = np.where(np.arange(STATES) % 3 == 0, 1e-4, 1.0)[:, None]
        motion = Motion(motion.position, motion.rotation, slowed * motion.linear_velocity,
                        slowed * motion.angular_velocity, motion.linear_acceleration,
                        motion.angular_acceleration)
        wrench = random_wrench(p, random, STATES)
        result = platform.inverse_dynamics(motion, wrench)
        twist, acceleration = motion.rows[:, TWIST], motion.rows[:, ACCELERATION]
        j_inv = platform.inverse_jacobian(motion)
        for christoffel in (False, True):
            c = platform.coriolis_matrix(motion, christoffel)
            load = (np.einsum('nij,nj->ni', platform.mass_matrix(motion), acceleration)
                    + np.einsum('nij,nj->ni', c, twist)
                    + platform.gravity_vector(motion) - wrench)
            truth = np.linalg.solve(np.swapaxes(j_inv, -1, -2), load[..., None])[..., 0]
            truth = truth + friction(p, result.rates)
            assert each_relative(result.forces, truth) < 1e-12


def test_lengths_are_the_distances_of_the_joints_and_rates_their_derivatives() -> None:
    random = rng()
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion = random_motion(p, random, STATES)
    result = platform.inverse_dynamics(motion)
    ends = motion.position[:, None] + np.einsum(
        'nij,kj->nki', motion.rotation, p['geometry.platform_joints'])
    lengths = np.linalg.norm(ends - p['geometry.base_joints'], axis=-1)
    assert relative(result.lengths, lengths) < 1e-14
    assert np.array_equal(result.lengths, platform.inverse_kinematics(motion))

    def lengths_after(h: float) -> Array:
        return platform.inverse_kinematics(moved(motion, h))

    assert each_relative(result.rates, derivative(lengths_after, 1e-3)) < 1e-9


def test_power_of_the_legs_and_the_wrench_is_the_change_of_energy_and_the_friction() -> None:
    random = rng()
    step = 1e-3
    times = np.linspace(0.0, 2.0, 25)
    for _ in range(4):
        p = random_parameters(random)
        platform = StewartPlatform(p)
        course = smooth_motion(p, random)
        motion = course(times)
        wrench = random_wrench(p, random, len(times))
        result = platform.inverse_dynamics(motion, wrench)
        twist = motion.rows[:, TWIST]
        supplied = np.sum(result.forces * result.rates, axis=-1) + np.sum(wrench * twist, axis=-1)
        lost = np.sum(friction(p, result.rates) * result.rates, axis=-1)

        def energy(h: float, course: Any = course, p: Parameters = p) -> Array:
            return np.sum(energies(p, course(times + h)), axis=0)

        assert relative(supplied - lost, derivative(energy, step)) < 1e-7


# Near singularities

def test_determinant_and_its_rate_are_those_of_j_inv() -> None:
    random = rng()
    for platform, motion in hexapods(random):
        result = platform.inverse_dynamics(motion)
        det = np.linalg.det(platform.inverse_jacobian(motion))
        assert relative(result.determinant, det) < 1e-13

        def det_after(h: float, platform: StewartPlatform = platform,
                      motion: Motion = motion) -> Array:
            return np.linalg.det(platform.inverse_jacobian(moved(motion, h)))

        assert relative(result.determinant_rate, derivative(det_after, 1e-3)) < 1e-8


def test_determinant_rate_is_exact_near_a_singularity() -> None:
    platform = StewartPlatform(symmetric_parameters())

    def det(angle: float) -> Array:
        motion = turned(np.pi / 2 + angle)
        return np.linalg.det(platform.inverse_jacobian(motion))

    truth = derivative(det, 1e-3)[0]
    for short_of in (1e-6, 1e-9, 1e-12):
        row = platform.solve(turned(np.pi / 2 - short_of, 1.0).rows)[0]
        assert row[DETERMINANT + 1] == pytest.approx(truth, rel=1e-5)
    exact = Motion([[0.0, 0.0, 1.0]], QUARTER_TURN, None, [0.0, 0.0, 1.0])
    assert platform.solve(exact.rows)[0, DETERMINANT + 1] == pytest.approx(truth, rel=1e-9)


def test_condition_number_and_unit_load_forces_are_those_of_numpy() -> None:
    random = rng()
    for platform, motion in hexapods(random):
        result = platform.inverse_dynamics(motion)
        j = scaled_jacobian(platform, motion)
        assert np.allclose(result.condition_number, np.linalg.cond(j), rtol=1e-12, atol=0.0)
        rows = np.linalg.norm(np.linalg.inv(np.swapaxes(j, -1, -2)), axis=-1)
        assert np.allclose(result.unit_load_forces, rows, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize('height', [0.3, 0.5, 1.0, 1.5, 4.0])
def test_condition_number_in_symmetric_poses_with_double_singular_values(
        height: float) -> None:
    platform = StewartPlatform(symmetric_parameters())
    motion = turned(np.linspace(-1.4, 1.4, 57), height=height)
    j = scaled_jacobian(platform, motion)
    values = np.linalg.svd(j, compute_uv=False)
    assert np.all(np.min(-np.diff(values), axis=-1) < 1e-12)  # double ones there are
    condition = platform.inverse_dynamics(motion).condition_number
    assert np.allclose(condition, np.linalg.cond(j), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize('decade', range(1, 12))
def test_condition_number_and_determinant_near_a_singularity(decade: int) -> None:
    platform = StewartPlatform(symmetric_parameters())
    motion = turned(np.pi / 2 - np.array([-1.0, 1.0]) * 10.0 ** -decade)
    result = platform.solve(motion.rows)
    j = scaled_jacobian(platform, motion)
    condition = np.linalg.cond(j)
    allowed = 1e-15 * condition + 1e-13
    assert np.all(np.abs(result[:, CONDITION] / condition - 1.0) < allowed)
    det = np.linalg.det(platform.inverse_jacobian(motion))
    assert np.all(np.abs(result[:, DETERMINANT] / det - 1.0) < allowed)


def test_forces_stay_finite_through_a_singularity_and_grow_as_one_over_the_distance() -> None:
    platform = StewartPlatform(symmetric_parameters())
    exact = Motion([[0.0, 0.0, 1.0]], QUARTER_TURN, None, [0.0, 0.0, 1.0],
                   [0.3, 0.2, 0.1]).rows
    near = turned(np.pi / 2 + np.linspace(-0.5, 0.5, 1001), 1.0).rows
    rows = np.vstack([near, exact])
    results = platform.solve(rows)
    assert np.all(np.isfinite(results))
    assert np.all(np.sign(results[:500, DETERMINANT]) == -np.sign(results[501:1001, DETERMINANT]))
    sizes = [np.abs(platform.solve(turned(np.pi / 2 - d, 1.0).rows)[0, FORCES]).max()
             * d for d in (1e-3, 1e-4)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.01)


@pytest.mark.parametrize('legs', ['parallel', 'in one plane', 'one joint', 'one of no length'])
def test_results_are_finite_where_several_singular_values_are_zero(
        legs: str, snapshot: Snapshot) -> None:
    p = symmetric_parameters()
    base, top = p['geometry.base_joints'].copy(), p['geometry.platform_joints'].copy()
    if legs == 'parallel':
        base = top
    elif legs == 'in one plane':
        base = top = top * [1.0, 0.0, 0.0]
    elif legs == 'one joint':
        base = np.tile([1.0, 0.0, 0.0], (6, 1))
    else:
        base[0] = top[0] + [0.0, 0.0, 1.0]
    platform = StewartPlatform(p.replaced({
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': top.ravel(),
        'singularity.characteristic_length': 0.6}))
    motion = Motion([0.0, 0.0, 1.0], np.eye(3), [0.1, 0.2, 0.3], [0.1, 0.2, 0.3])
    assert np.all(np.isfinite(platform.solve(motion.rows.reshape(1, MOTION))))
    with snapshot.raises(SingularityError):
        platform.inverse_dynamics(motion)


def test_determinant_rate_where_a_pivot_is_exactly_zero() -> None:
    p = symmetric_parameters()
    base, moving = p['geometry.base_joints'].copy(), p['geometry.platform_joints'].copy()
    # legs 1 and 2 on one vertical line
    base[:2] = [[0.5, 0.0, 0.0], [0.5, 0.0, -1.0]]
    moving[:2] = [[0.5, 0.0, 0.0], [0.5, 0.0, 0.5]]
    platform = StewartPlatform(p.replaced({
        'geometry.base_joints': base.ravel(), 'geometry.platform_joints': moving.ravel()}))
    omega = np.array([0.1, 0.2, 0.3])
    speed = float(np.linalg.norm(omega))

    def determinant(time: float) -> float:
        motion = Motion(np.array([0.0, 0.0, 1.0]) + time * np.array([0.3, 0.2, 0.1]),
                        rotation_about(omega / speed, speed * time))
        return float(np.linalg.det(platform.inverse_jacobian(motion)))

    motion = Motion([0.0, 0.0, 1.0], np.eye(3), [0.3, 0.2, 0.1], omega)
    found = platform.solve(motion.rows[None])[0]
    assert abs(found[DETERMINANT]) < 1e-30
    truth = derivative(determinant, 1e-3)
    assert found[DETERMINANT + 1] == pytest.approx(truth, rel=1e-8)


def test_arrays_of_any_layout_use_the_same_compiled_code() -> None:
    platform = StewartPlatform(symmetric_parameters())
    rows = samples_of_all_kinds(40)[1]
    motion = Motion([[0.0, 0.0, 1.0]] * 5, np.eye(3))
    one_by_one = platform.inverse_dynamics(motion, np.tile(np.arange(6.0), (5, 1)))
    for_all = platform.inverse_dynamics(motion, np.arange(6.0))
    assert np.array_equal(one_by_one.forces, for_all.forces)
    assert np.array_equal(platform.solve(rows[::2]), platform.solve(rows)[::2])
    assert np.array_equal(platform.solve(np.asfortranarray(rows)), platform.solve(rows))


# Batches

def test_a_sample_of_a_batch_of_any_size_is_the_sample_alone_bit_for_bit() -> None:
    platform, rows = samples_of_all_kinds(3 * LANES + 5)
    wrenches = random_wrench(platform.parameters, rng(), len(rows))
    alone = np.vstack([platform.solve(row[None], wrench[None])
                       for row, wrench in zip(rows, wrenches, strict=True)])
    for many in range(len(rows) + 1):
        assert np.array_equal(platform.solve(rows[:many], wrenches[:many]), alone[:many])
        first = len(rows) - many
        assert np.array_equal(platform.solve(rows[first:], wrenches[first:]), alone[first:])


@pytest.mark.parametrize('one_wrench', [True, False])
def test_a_large_batch_on_many_threads_is_its_samples_bit_for_bit(
        one_wrench: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    # more threads than there may be processors, and parts that end amid a tile
    monkeypatch.setattr(batch, '_CPUS', 5)
    monkeypatch.setattr(batch, '_SAMPLES_FOR_A_THREAD', 1000)
    platform, rows = samples_of_all_kinds(5 * 1000 + 77)
    wrenches = random_wrench(platform.parameters, rng(), 1 if one_wrench else len(rows))
    together = platform.solve(rows, wrenches)
    alone = np.vstack([platform.solve(rows[n:n + 1], wrenches if one_wrench
                                      else wrenches[n:n + 1]) for n in range(len(rows))])
    assert np.array_equal(together, alone)


@pytest.mark.parametrize('position', [[1e200, 0.0, 1.0], None], ids=['far', 'no length'])
def test_a_leg_without_a_length_is_rejected(position: Any, snapshot: Snapshot) -> None:
    p = symmetric_parameters()
    platform = StewartPlatform(p)
    if position is None:
        position = p['geometry.base_joints'][1] - p['geometry.platform_joints'][1]
    for function in (platform.inverse_jacobian, platform.mass_matrix, platform.gravity_vector):
        with snapshot.raises(MotionError):
            function(Pose(position, np.eye(3)))
    with snapshot.raises(MotionError):
        platform.coriolis_matrix(Motion(position, np.eye(3), np.ones(3), np.ones(3)))


def test_a_pose_whose_numbers_overflow_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        StewartPlatform(symmetric_parameters()).inverse_kinematics(
            Pose([1e200, 0.0, 1.0], np.eye(3)))


def test_a_platform_can_be_copied_and_sent_to_another_process() -> None:
    platform = StewartPlatform(random_parameters(rng()))
    motion = random_motion(platform.parameters, rng(), 3)
    truth = platform.inverse_dynamics(motion).forces
    for other in (copy.deepcopy(platform), pickle.loads(pickle.dumps(platform))):
        assert np.array_equal(other.inverse_dynamics(motion).forces, truth)
        assert other.parameters == platform.parameters
        assert hash(other.parameters) == hash(platform.parameters)
        assert not other.parameters['geometry.base_joints'].flags.writeable
    assert platform.parameters != platform.parameters.replaced({'platform.mass': 1.5})


# Arbitrary input

finite = st.floats(allow_nan=False, allow_infinity=False)
ordinary = st.floats(-2.0, 2.0)
positive = st.floats(min_value=0.0, allow_infinity=False)
SYMMETRIC = {name: symmetric_parameters()[name].ravel().tolist()
             for name in ('geometry.base_joints', 'geometry.platform_joints')}


def numbers(many: int) -> Any:
    """Return a strategy for lists of ordinary numbers, of any, and of both."""
    return st.one_of(*(st.lists(each, min_size=many, max_size=many)
                       for each in (ordinary, finite, st.one_of(ordinary, finite))))


def _random_hexapods(amount: Any) -> Any:
    """Return a strategy for hexapods whose masses and inertias are such amounts."""
    moments = st.lists(amount, min_size=3, max_size=3)
    return st.fixed_dictionaries({
        name: st.one_of(st.just(usual), numbers(len(usual)))
        for name, usual in SYMMETRIC.items()
    } | {
        'platform.mass': amount,
        'platform.inertia': moments.map(lambda i: [i[0], 0.0, 0.0, i[1], 0.0, i[2]]),
    }, optional=dict.fromkeys((
        'legs.cylinder.mass', 'legs.cylinder.center_of_mass', 'legs.cylinder.inertia',
        'legs.piston.mass', 'legs.piston.center_of_mass', 'legs.piston.inertia',
        'actuator.reflected_mass', 'actuator.viscous_friction', 'actuator.coulomb_friction',
        'singularity.characteristic_length'), amount) | {
            'gravity': numbers(3), 'platform.center_of_mass': numbers(3)})


@given(st.one_of(_random_hexapods(st.floats(0.01, 100.0)), _random_hexapods(positive)))
@np.errstate(all='ignore')
def test_any_hexapod_gives_finite_results_or_an_error_of_the_package(values: Any) -> None:
    try:
        result = StewartPlatform(Parameters(values)).inverse_dynamics(Motion(
            [0.1, 0.2, 1.0], np.eye(3), [0.1, 0.2, 0.3], [0.3, 0.2, 0.1], [1.0, 2.0, 3.0],
            [3.0, 2.0, 1.0]))
    except StewartError:
        return
    assert np.all(np.isfinite(result.rows))
    assert result.condition_number >= 1.0


def test_joints_carry_what_actuators_without_mass_and_friction_give() -> None:
    """The force along the leg is the same, whatever the actuator adds at its own side."""
    for n in range(20):
        parameters = random_parameters(rng(n))
        motion = random_motion(parameters, rng(n + 1), 10)
        base = random_base_motion(parameters, rng(n + 2), 10)
        wrench = random_wrench(parameters, rng(n + 3), 10)
        without = StewartPlatform(parameters.replaced(dict.fromkeys((
            'actuator.reflected_mass', 'actuator.viscous_friction', 'actuator.coulomb_friction'),
            0.0)))
        result = StewartPlatform(parameters).inverse_dynamics(motion, wrench, base)
        ideal = without.inverse_dynamics(motion, wrench, base)
        assert np.abs(result.forces - result.joint_forces).max() > 1.0
        assert np.array_equal(result.joint_forces, ideal.forces)
        assert np.array_equal(ideal.joint_forces, ideal.forces)
