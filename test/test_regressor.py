# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The regressor: times the linear parameters it is the inverse dynamics, for any hexapod."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    derivative, PinocchioReferee, QUARTER_TURN,
    random_base_motion, random_motion, random_parameters, rng, rotation_about,
    symmetric_parameters)
from snapshot import Snapshot

from stewart_dynamics import (
    BaseMotion, Motion, MotionError, ParameterError, Parameters, SingularityError, StewartPlatform)
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    linear_parameters, mass_places, names_of, parameter_values, Places, PLATFORM, units_of)

Array = NDArray[np.float64]

MANY = 20
_, REFLECTED_MASS, VISCOUS_FRICTION, COULOMB_FRICTION, OFFSET = Places.of(TELESCOPIC)
CYLINDER_MASS, CYLINDER_FIRST, CYLINDER_SECOND, PISTON_MASS, PISTON_SECOND = (
    mass_places(TELESCOPIC, f'legs.{name}') for name in (
        'cylinder.mass', 'cylinder.first_moment', 'cylinder.second_moment', 'piston.mass',
        'piston.second_moment'))


@pytest.mark.parametrize('moving', [False, True])
def test_pinocchio_has_the_same_forces(moving: bool) -> None:
    random = rng(7)
    p = random_parameters(random)
    motion = random_motion(p, random, MANY)
    base = random_base_motion(p, random, MANY) if moving else None
    forces = StewartPlatform(p).regressor(motion, base).matrix @ linear_parameters(p)
    referee = PinocchioReferee(p, random)
    for n in range(MANY):
        truth = referee.forces(motion[n], np.zeros(6), None if base is None else base[n])
        assert np.abs(forces[n] - truth).max() < 1e-10 * np.abs(truth).max()


def test_each_column_is_the_force_of_one_unit_of_its_parameter() -> None:
    # By finite differences of the inverse dynamics in the parameters of the file.
    random = rng(3)
    p = random_parameters(random)
    motion = random_motion(p, random, MANY)
    matrix = StewartPlatform(p).regressor(motion).matrix
    start = linear_parameters(p)
    for n in (0, 2, 5, 9, *(kind.start + 4 for kind in (
            CYLINDER_FIRST, CYLINDER_SECOND, PISTON_MASS, PISTON_SECOND, REFLECTED_MASS,
            VISCOUS_FRICTION, COULOMB_FRICTION))):
        def forces(step: float, n: int = n) -> Array:
            theta = start.copy()
            theta[n] += step
            changed = p.replaced(parameter_values(theta, p))
            return StewartPlatform(changed).inverse_dynamics(motion).forces

        column = derivative(forces, 1e-3 * abs(start[n]))
        np.testing.assert_allclose(matrix[..., n], column, rtol=1e-8,
                                   atol=1e-8 * np.abs(column).max())
    np.testing.assert_array_equal(matrix[..., OFFSET], np.broadcast_to(np.eye(6), (MANY, 6, 6)))


@pytest.mark.parametrize('moving', [False, True])
def test_tilt_columns_are_the_derivatives_by_turns_of_gravity(moving: bool) -> None:
    random = rng(11)
    p = random_parameters(random)
    motion = random_motion(p, random, MANY)
    base = random_base_motion(p, random, MANY) if moving else BaseMotion(p['gravity'])
    platform = StewartPlatform(p)
    tilted = platform.regressor(motion, base if moving else None, tilt=True)
    assert tilted.names[-2:] == ('gravity.tilt_x', 'gravity.tilt_y')
    np.testing.assert_array_equal(
        tilted.matrix[..., :-2], platform.regressor(motion, base if moving else None).matrix)
    for n, axis in enumerate(np.eye(3)[:2]):
        def forces(angle: float, axis: Array = axis) -> Array:
            turned = BaseMotion(
                base.gravity @ rotation_about(axis, angle).T, base.linear_acceleration,
                base.angular_velocity, base.angular_acceleration)
            return platform.inverse_dynamics(motion, base=turned).forces

        column = derivative(forces, 1e-3)
        np.testing.assert_allclose(tilted.matrix[..., -2 + n], column, rtol=1e-7,
                                   atol=1e-8 * np.abs(column).max())


def test_parameters_that_no_motion_identifies() -> None:
    random = rng(4)
    p = random_parameters(random)
    matrix = StewartPlatform(p).regressor(random_motion(p, random, MANY)).matrix
    assert not matrix[..., CYLINDER_MASS].any()
    np.testing.assert_array_equal(matrix[..., CYLINDER_SECOND], matrix[..., PISTON_SECOND])


def test_each_column_has_a_name_and_a_unit() -> None:
    p = random_parameters(rng(5))
    whole = StewartPlatform(p).regressor(random_motion(p, rng(5), 12))
    assert whole.matrix.shape == (12, 6, 70)
    assert len(whole.names) == len(set(whole.names)) == len(units_of(p)) == 70
    units = dict(zip(whole.names, units_of(p), strict=True))
    assert [units[f'{name}.{p["joints"][2]}'] for name in (
        'legs.cylinder.mass', 'legs.piston.first_moment', 'legs.piston.second_moment',
        'actuator.reflected_mass', 'actuator.viscous_friction', 'actuator.coulomb_friction',
        'effort_offset')] == ['kg', 'kg m', 'kg m^2', 'kg', 'N s/m', 'N', 'N']
    assert repr(whole).startswith('<Regressor of shape (12, 6, 70): platform.mass, ')


def test_large_batches_are_divided_without_a_change() -> None:
    random = rng(6)
    p = random_parameters(random)
    platform = StewartPlatform(p)
    motion = random_motion(p, random, 9001)
    whole = platform.regressors(motion.rows)
    np.testing.assert_array_equal(whole[::997], platform.regressors(motion.rows[::997]))


def test_names_of_the_legs_are_the_file_s() -> None:
    p = symmetric_parameters().replaced({'joints': ['a', 'b', 'c', 'd', 'e', 'f']})
    names = names_of(p)
    assert names[PLATFORM][:2] == ('platform.mass', 'platform.first_moment.x')
    assert names[VISCOUS_FRICTION][1] == 'actuator.viscous_friction.b'
    assert names[OFFSET][5] == 'effort_offset.f'


def test_singular_and_wrong_motions_are_rejected(snapshot: Snapshot) -> None:
    platform = StewartPlatform(symmetric_parameters())
    with snapshot.raises(SingularityError):
        platform.regressor(Motion([[0.0, 0.0, 1.0]], [QUARTER_TURN]))
    with pytest.raises(MotionError):
        platform.regressor(Motion([0.0, 0.0, 1.0], np.eye(3), [1e200, 0.0, 0.0]))
    with snapshot.raises(MotionError):
        platform.regressor(3)  # type: ignore[arg-type]


def test_inconsistent_inertia_is_rejected(snapshot: Snapshot) -> None:
    p = random_parameters(rng(9))
    theta = linear_parameters(p)

    def changed(at: int, value: float) -> Array:
        other = theta.copy()
        other[at] = value
        return other

    for at, value in ((0, 0.0), (PISTON_MASS.start + 2, -1.0), (CYLINDER_MASS.start, 0.0),
                      (PISTON_SECOND.start + 5, 1e-6)):
        with snapshot.raises(ParameterError):
            parameter_values(changed(at, value), p)


def test_parts_without_mass_keep_their_center_of_mass() -> None:
    p = Parameters({**symmetric_parameters().given, 'legs.piston.mass': 0.0,
                    'legs.piston.inertia': 0.0})
    values = parameter_values(linear_parameters(p), p)
    np.testing.assert_array_equal(values['legs.piston.center_of_mass'],
                                  p['legs.piston.center_of_mass'])
    assert not values['legs.piston.inertia'].any()
