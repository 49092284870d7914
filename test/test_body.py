# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Platform and payload are one rigid body, for every program: to 1e-12, or bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    random_base_motion, random_direction, random_motion, random_parameters, relative, rng,
    rotation_about)
from snapshot import Snapshot

from stewart_dynamics import Capability, Motion, Parameters, Pose, StewartPlatform
from stewart_dynamics.description.formats import read_hexapod
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.sdf import sdf
from stewart_dynamics.description.urdf import urdf
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export.c_project import platform_source
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.dynamics import lagrange
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    linear_parameters, parameter_values, with_point_mass)
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors
from stewart_dynamics.parameters.body import Body
from stewart_dynamics.parameters.table import inertia_matrix, payload_values

Array = NDArray[np.float64]

EXACT = 1e-12
DRIVER = Body(82.0, np.array([0.1, -0.2, 0.6]), np.array([9.0, 0.1, 0.2, 8.0, -0.3, 3.0]))
FILE = Parameters.from_yaml(Path(__file__).parents[1] / 'config' / 'platform.yaml')
WITH_DRIVER = FILE.with_payload(DRIVER)


def of_points(masses: Array, points: Array) -> Body:
    """Return the body of point masses (N,) at points (N, 3), by definition."""
    center = masses @ points / masses.sum()
    arms = points - center
    inertia = np.einsum('n,nij->ij', masses, np.einsum(
        'ni,ni,jk->njk', arms, arms, np.eye(3)) - np.einsum('nj,nk->njk', arms, arms))
    return Body(float(masses.sum()), center, inertia[np.triu_indices(3)])


def assert_same(found: Body, expected: Body) -> None:
    for of_found, of_expected in zip(found, expected, strict=True):
        assert relative(np.array(of_found), np.array(of_expected)) < EXACT


@pytest.mark.parametrize('seed', range(10))
def test_two_bodies_are_the_one_of_all_their_points(seed: int) -> None:
    random = rng(seed)
    masses, points = random.uniform(0.1, 90.0, 9), random.uniform(-2.0, 2.0, (9, 3))
    first, second = of_points(masses[:4], points[:4]), of_points(masses[4:], points[4:])
    whole = of_points(masses, points)
    assert_same(first.with_body(second), whole)
    assert_same(second.with_body(first), whole)
    assert_same(whole.without(second), first)


def test_numbers_that_overflow_and_no_mass_left_are_rejected(snapshot: Snapshot) -> None:
    far = DRIVER._replace(center=np.array([1e200, 0.0, 0.0]))
    for call in (lambda: DRIVER.with_body(far), lambda: DRIVER.without(DRIVER)):
        with snapshot.raises(ParameterError):
            call()
    with snapshot.raises(ParameterError):
        FILE.replaced(payload_values(far), 'file')


@pytest.mark.parametrize('seed', range(5))
def test_platform_and_payload_are_the_combined_rigid_body(seed: int) -> None:
    """The combined parameters come from point masses, not from the function under test."""
    random = rng(seed)
    p = random_parameters(random, actuators=True)
    masses, points = random.uniform(1.0, 60.0, 8), random.uniform(-0.5, 0.5, (8, 3))
    empty, payload = of_points(masses[:4], points[:4]), of_points(masses[4:], points[4:])
    names = 'platform.mass', 'platform.center_of_mass', 'platform.inertia'
    given = p.replaced(dict(zip(names, empty, strict=True))).with_payload(payload)
    combined = p.replaced(dict(zip(names, of_points(masses, points), strict=True)))
    assert relative(np.array(linear_parameters(given)), linear_parameters(combined)) < EXACT
    one, two = StewartPlatform(given), StewartPlatform(combined)
    motion, base = random_motion(p, random, 20), random_base_motion(p, random, 20)
    wrench = random.uniform(-100.0, 100.0, (20, 6))
    forces = one.inverse_dynamics(motion, wrench, base).forces
    assert relative(forces, two.inverse_dynamics(motion, wrench, base).forces) < EXACT
    assert relative(one.base_wrench(motion, wrench, base),
                    two.base_wrench(motion, wrench, base)) < EXACT
    for name in ('mass_matrix', 'gravity_vector', 'coriolis_matrix'):
        assert relative(getattr(one, name)(motion), getattr(two, name)(motion)) < EXACT
    assert relative(one.forward_dynamics(motion, forces, wrench, base).rows,
                    two.forward_dynamics(motion, forces, wrench, base).rows) < 1e-9
    theta = linear_parameters(given)
    assert relative(one.regressor(motion, base).matrix @ theta,
                    one.inverse_dynamics(motion, None, base).forces) < 1e-10
    assert relative(
        lagrange.mass_matrix(given, motion.position, motion.rotation),
        lagrange.mass_matrix(combined, motion.position, motion.rotation)) < EXACT


def test_a_motion_at_rest_on_its_payload_carries_its_weight() -> None:
    """All legs together hold the weight of platform, payload and the legs' upper parts."""
    home = Motion.from_pose(StewartPlatform(FILE).home_pose())
    more = (StewartPlatform(WITH_DRIVER).base_wrench(home)
            - StewartPlatform(FILE).base_wrench(home))
    force = DRIVER.mass * FILE['gravity']
    at = home.position + home.rotation @ DRIVER.center
    assert relative(more, np.concatenate([force, np.cross(at, force)])) < EXACT


def bits_of(parameters: Parameters) -> bytes:
    """Return the bits of the structure of a hexapod; numbers that are not set are nan."""
    return StewartPlatform(parameters).structure.tobytes()


def test_without_a_mass_it_is_the_file_bit_for_bit() -> None:
    no_mass = FILE.replaced({'payload.center_of_mass': [0.1, 0.2, 0.3],
                             'payload.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]})
    assert bits_of(no_mass) == bits_of(FILE)
    assert np.array_equal(linear_parameters(no_mass), linear_parameters(FILE))
    assert Unknowns(no_mass).theta(Unknowns(no_mass).start).tolist() == Unknowns(FILE).theta(
        Unknowns(FILE).start).tolist()
    assert find_parameter_errors(no_mass) == find_parameter_errors(FILE)


def test_merged_parameters_are_the_same_hexapod_bit_for_bit() -> None:
    merged = WITH_DRIVER.merged()
    assert merged['payload.mass'] == 0.0 and merged['platform.mass'] == 150.0 + 82.0
    assert bits_of(merged) == bits_of(WITH_DRIVER)
    assert platform_source(merged, 'hexapod') == platform_source(WITH_DRIVER, 'hexapod')


def test_capability_counts_the_payload() -> None:
    one, two = (Capability(StewartPlatform(each)) for each in (WITH_DRIVER, WITH_DRIVER.merged()))
    pose = one.platform.home_pose()
    for name in ('payload', 'wrench', 'acceleration'):
        direction = DRIVER.center if name == 'payload' else np.eye(6)
        assert relative(getattr(one, name)(pose, direction).value,
                        getattr(two, name)(pose, direction).value) < EXACT
    # A mass that is there already takes its part of the payload.
    empty = Capability(StewartPlatform(FILE)).payload(pose, DRIVER.center).value
    there = Capability(StewartPlatform(with_point_mass(FILE, 50.0, DRIVER.center)))
    assert there.payload(pose, DRIVER.center).value == pytest.approx(empty - 50.0, rel=1e-9)


def test_point_masses_add_up_in_the_payload() -> None:
    p = with_point_mass(with_point_mass(FILE, 30.0, [0.1, 0.0, 0.2]), 20.0, [-0.1, 0.3, 0.2])
    assert p.platform.body.mass == FILE['platform.mass']
    assert_same(p.payload.body, of_points(
        np.array([30.0, 20.0]), np.array([[0.1, 0.0, 0.2], [-0.1, 0.3, 0.2]])))


def test_linear_parameters_come_back_as_the_empty_platform() -> None:
    values = parameter_values(linear_parameters(WITH_DRIVER), WITH_DRIVER)
    for name in ('platform.mass', 'platform.center_of_mass', 'platform.inertia'):
        assert relative(np.array(values[name]), np.array(FILE[name])) < EXACT


def test_identification_estimates_the_empty_platform() -> None:
    unknowns = Unknowns(WITH_DRIVER)
    assert unknowns.start[0] == FILE['platform.mass']
    assert relative(unknowns.linear(unknowns.start), linear_parameters(WITH_DRIVER)) < EXACT
    found = unknowns.parameters(unknowns.start)
    assert found['payload.mass'] == DRIVER.mass
    assert relative(linear_parameters(found), linear_parameters(WITH_DRIVER)) < EXACT


@pytest.mark.parametrize('kind', ['urdf', 'sdf'])
def test_a_description_has_both_as_one_body(tmp_path: Path, kind: str) -> None:
    text = {'urdf': urdf, 'sdf': sdf}[kind](Hexapod(WITH_DRIVER), 'hexapod')
    file = tmp_path / f'hexapod.{kind}'
    file.write_text(text, encoding='utf-8')
    found = read_hexapod(file).parameters
    assert found['payload.mass'] == 0.0
    assert_same(found.carried, WITH_DRIVER.carried)


@pytest.mark.parametrize('changes, expected', [
    ({'payload.mass': 82000.0}, 'payload.mass: 8.2e+04 kg: six legs with limits.force_max'),
    ({'payload.center_of_mass': [0.0, 0.0, 600.0]}, 'payload.center_of_mass: [0, 0, 600] m is '),
    ({'payload.inertia': [9e6, 0.0, 0.0, 9e6, 0.0, 9e6]}, 'payload.inertia: 9e+06 kg m^2 at most'),
    ({'payload.inertia': [1.0, 0.0, 0.0, 1.0, 0.0, 9.0]},
     'payload.inertia: principal moments [1, 1, 9] kg m^2: no body has one larger')])
def test_possible_errors_in_a_payload(changes: dict[str, object], expected: str) -> None:
    assert find_parameter_errors(WITH_DRIVER) == find_parameter_errors(FILE)
    more = {*find_parameter_errors(WITH_DRIVER.replaced(changes))} - {
        *find_parameter_errors(FILE)}
    assert [each for each in more if each.startswith(expected)], more


def test_a_payload_that_is_no_body_is_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        FILE.replaced({'payload.inertia': [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]})
    with snapshot.raises(ParameterError):
        FILE.replaced({'payload.mass': -1.0})
    # A rod has a moment of zero, which rounding may make negative.
    rod = np.diag([2.0, 2.0, 0.0])
    turn = rotation_about(random_direction(rng(1)), 0.7)
    turned = (turn @ rod @ turn.T)[np.triu_indices(3)]
    assert np.linalg.eigvalsh(inertia_matrix(turned))[0] < 1e-15
    FILE.replaced({'payload.mass': 1.0, 'payload.inertia': turned})


def test_the_pivot_of_a_datasheet_moves_the_payload() -> None:
    from stewart_dynamics.datasheet.rated_hexapod import RatedHexapod

    pivot = np.array([0.1, 0.2, 0.3])
    rated = RatedHexapod(WITH_DRIVER, pivot=pivot)
    pose = Pose(rated.pose.position, rated.pose.rotation)
    assert relative(
        rated.platform.inverse_dynamics(Motion.from_pose(pose)).forces,
        StewartPlatform(WITH_DRIVER).inverse_dynamics(
            Motion.from_pose(rated.origin)).forces) < 1e-10
