# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The library's calls: their arguments and results; any argument gives numbers or an error."""

from __future__ import annotations

import inspect
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest
from referees import (
    QUARTER_TURN, random_base_motion, random_motion, random_parameters, random_wrench, relative,
    rng, ROOT, rotation_about, symmetric_parameters)

from snapshot import Snapshot
from stewart_dynamics import (
    BaseMotion, check_planned_trajectory, ForceBreakdown, InverseDynamics, Motion, MotionError,
    ParameterError, Parameters, Pose, SingularityError, StewartError, StewartPlatform)
from stewart_dynamics.mechanics.dynamics.force_breakdown import SOURCES
from stewart_dynamics.mechanics.dynamics.regressor import Regressor
from stewart_dynamics.mechanics.parameter_errors import find_parameter_errors

Array = NDArray[np.float64]

EXAMPLE = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
ON_EXAMPLE = StewartPlatform(EXAMPLE)


@pytest.fixture(scope='module')
def platform() -> StewartPlatform:
    """Return a random hexapod."""
    return StewartPlatform(random_parameters(rng()))


def passing_a_singularity() -> Motion:
    """Return samples of the symmetric hexapod, (2, 3), of which [1, 1] is singular."""
    turns = np.array([rotation_about([0.0, 0.0, 1.0], angle) for angle in
                      np.linspace(0.0, 1.0, 6)]).reshape(2, 3, 3, 3)
    turns[1, 1] = QUARTER_TURN
    return Motion([0.0, 0.0, 1.0], turns, [0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0])


# Pose or Motion

def test_a_motion_is_accepted_in_place_of_a_pose(platform: StewartPlatform) -> None:
    motion = random_motion(platform.parameters, rng(), 5)
    pose = Pose(motion.position, motion.rotation)
    for call in (platform.inverse_kinematics, platform.inverse_jacobian, platform.mass_matrix,
                 platform.gravity_vector, lambda at: platform.twist(at, np.ones(6)),
                 lambda at: platform.stiffness(at, 1e6),
                 lambda at: platform.natural_modes(at, 1e6).shapes):
        assert np.array_equal(call(pose), call(motion))
    lengths = platform.inverse_kinematics(pose)
    assert (platform.forward_kinematics(lengths, motion)
            == platform.forward_kinematics(lengths, pose))


@pytest.mark.parametrize('given', [
    None, {'position': 1}, [[0.0, 0.0, 1.0], np.eye(3)], np.zeros(24), 'pose', 1.0, 1 + 2j,
    Motion, (np.zeros(3), np.eye(3))], ids=str)
def test_other_types_are_rejected(
        platform: StewartPlatform, given: Any, snapshot: Snapshot) -> None:
    for call in (platform.inverse_kinematics, platform.inverse_jacobian, platform.mass_matrix,
                 platform.gravity_vector, platform.inverse_dynamics, platform.force_breakdown,
                 platform.coriolis_matrix, platform.inverse_jacobian_rate,
                 lambda at: platform.twist(at, np.ones(6)),
                 lambda at: platform.forward_dynamics(at, np.ones(6)),
                 # None is home.
                 lambda at: platform.forward_kinematics(np.ones(6), '' if at is None else at),
                 lambda at: platform.stiffness(at, 1e6),
                 lambda at: platform.natural_modes(at, 1e6)):
        with snapshot.raises(MotionError):
            call(given)
    with snapshot.raises(StewartError):
        StewartPlatform(given)


@pytest.mark.parametrize('given', [None, {}, EXAMPLE, 'config/platform.yaml'])
def test_other_types_in_place_of_a_platform_are_rejected(given: Any, snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        check_planned_trajectory(given, [0.0, 1.0], Motion([[0.0, 0.0, 1.1]] * 2, np.eye(3)))


def test_the_error_about_a_pose_in_place_of_a_motion_says_how_to_make_one(
        platform: StewartPlatform, snapshot: Snapshot) -> None:
    pose = Pose([0.0, 0.0, 1.0], np.eye(3))
    for call in (platform.inverse_dynamics, platform.inverse_jacobian_rate, platform.motors):
        with snapshot.raises(MotionError):
            call(pose)


# Singular samples

def test_a_singular_sample_is_named_or_marked(snapshot: Snapshot) -> None:
    platform = StewartPlatform(symmetric_parameters())
    motion = passing_a_singularity()
    for call in (platform.inverse_dynamics, platform.force_breakdown):
        with snapshot.raises(SingularityError):
            call(motion)
        with snapshot.raises(SingularityError):
            call(motion[1])
        with snapshot.raises(MotionError):
            call(motion, singular='skip')
    bad = np.zeros((2, 3), dtype=bool)
    bad[1, 1] = True
    result = platform.inverse_dynamics(motion, singular='nan')
    assert np.array_equal(np.isnan(result.forces), np.repeat(bad[..., None], 6, axis=-1))
    for name in ('lengths', 'rates', 'unit_load_forces', 'determinant', 'determinant_rate',
                 'condition_number'):
        assert np.isfinite(getattr(result, name)).all()
    by = platform.force_breakdown(motion, singular='nan')
    good = platform.inverse_dynamics(motion[~bad])
    assert np.array_equal(result.forces[~bad], good.forces)
    for part in by:
        assert np.array_equal(np.isnan(part), np.isnan(result.forces))


# Force breakdown

def test_the_force_breakdown_names_its_sources_and_sums_to_the_forces(
        platform: StewartPlatform, snapshot: Snapshot) -> None:
    motion = Motion.of_rows(random_motion(platform.parameters, rng(), 12).rows.reshape(3, 4, -1))
    wrench = random_wrench(platform.parameters, rng(), 4)
    by = platform.force_breakdown(motion, wrench)
    assert isinstance(by, ForceBreakdown)
    assert [name.split('_')[0] for name in by._fields] == [name.split()[0] for name in SOURCES]
    assert by.total.shape == by.gravity.shape == (3, 4, 6)
    forces = platform.inverse_dynamics(motion, wrench).forces
    assert relative(by.total, forces) < 1e-12
    rest = Motion.from_pose(motion)
    assert np.array_equal(by.gravity, platform.inverse_dynamics(rest).forces)
    one = platform.force_breakdown(motion[1, 2], wrench[2])
    assert np.array_equal(one.wrench, by.wrench[1, 2])
    assert one.total.shape == (6,)
    snapshot(repr(by))


# Stiffness and natural modes

def test_stiffness_is_the_derivative_of_the_wrench_of_elastic_legs(
        platform: StewartPlatform) -> None:
    random = rng()
    pose = random_motion(platform.parameters, random, 1)[0].pose
    legs = random.uniform(1e6, 1e8, 6)
    found = platform.stiffness(pose, legs)
    assert np.allclose(found, found.T, rtol=1e-13, atol=0.0)
    lengths, j_inv = platform.inverse_kinematics(pose), platform.inverse_jacobian(pose)
    for direction in np.eye(6):
        def wrench(step: float, direction: Array = direction) -> Array:
            angle = float(np.linalg.norm(direction[3:]))
            turn = rotation_about(direction[3:], step) if angle else np.eye(3)
            moved = Pose(pose.position + step * direction[:3], turn @ pose.rotation)
            force: Array = j_inv.T @ (legs * (platform.inverse_kinematics(moved) - lengths))
            return force

        assert relative((wrench(1e-5) - wrench(-1e-5)) / 2e-5, found @ direction) < 1e-7
    assert np.array_equal(platform.stiffness(pose, 2e7), platform.stiffness(pose, [2e7] * 6))
    assert np.array_equal(platform.stiffness(pose, 2e7), platform.stiffness(pose, np.array(2e7)))


def test_natural_modes_solve_the_eigenvalue_problem(platform: StewartPlatform) -> None:
    motion = Motion.of_rows(random_motion(platform.parameters, rng(), 12).rows.reshape(3, 4, -1))
    legs = rng().uniform(1e6, 1e8, (4, 6))
    modes = platform.natural_modes(motion, legs)
    assert modes.frequencies.shape == (3, 4, 6)
    assert np.all(np.diff(modes.frequencies) >= 0.0)
    mass, stiffness = platform.mass_matrix(motion), platform.stiffness(motion, legs)
    shapes = modes.shapes
    squares = (2.0 * np.pi * modes.frequencies) ** 2
    back = np.swapaxes(shapes, -1, -2)
    assert np.allclose(back @ mass @ shapes, np.eye(6), rtol=0.0, atol=1e-12)
    # by the size of K in these coordinates: the largest square
    off = np.abs(back @ stiffness @ shapes - squares[..., None] * np.eye(6))
    assert np.max(off / squares[..., 5:, None]) < 1e-12
    assert np.array_equal(platform.natural_modes(motion[1, 2], legs[2]).frequencies,
                          modes.frequencies[1, 2])


def test_natural_modes_of_a_platform_on_vertical_legs_are_the_closed_form() -> None:
    """On vertical legs over a symmetric platform, heave is sqrt(sum k / m) / (2 pi)."""
    ring = 0.6 * np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(6) * np.pi / 3.0])
    platform = StewartPlatform(Parameters({
        'geometry.base_joints': ring.ravel(), 'geometry.platform_joints': ring.ravel(),
        'platform.mass': 50.0, 'platform.inertia': [4.0, 0.0, 0.0, 4.0, 0.0, 6.0]}))
    modes = platform.natural_modes(Pose([0.0, 0.0, 1.0], np.eye(3)), 1e6)
    heave = np.sqrt(6e6 / 50.0) / (2.0 * np.pi)
    pitch = np.sqrt(1e6 * 3.0 * 0.6 ** 2 / 4.0) / (2.0 * np.pi)
    # J_inv has rank three: nothing holds the platform across the legs
    assert np.allclose(modes.frequencies, [0.0, 0.0, 0.0, *sorted([heave, pitch, pitch])],
                       rtol=1e-12, atol=1e-9)
    assert repr(modes).startswith('<NaturalModes: ')
    assert repr(modes).endswith(' Hz>')


@pytest.mark.parametrize('given', [
    0.0, [1e6] * 5 + [-1.0],
    [1e6] * 5, np.inf,
    'stiff', None,
    np.full((4, 6), 1e6)])
def test_an_invalid_stiffness_is_rejected(
        platform: StewartPlatform, given: Any, snapshot: Snapshot) -> None:
    poses = random_motion(platform.parameters, rng(), 3).pose
    for call in (platform.stiffness, platform.natural_modes):
        with snapshot.raises(MotionError):
            call(poses, given)


# Home, possible errors, representation

def test_home_has_the_mean_leg_halfway_between_its_limits() -> None:
    home = ON_EXAMPLE.home_pose()
    assert home.shape == ()
    assert home.position[2] > 0.9
    assert np.allclose(home.rotation, np.eye(3), rtol=0.0, atol=1e-12)
    middle = 0.5 * (EXAMPLE['limits.length_min'] + EXAMPLE['limits.length_max'])
    assert np.mean(ON_EXAMPLE.inverse_kinematics(home)) == pytest.approx(np.mean(middle), abs=1e-9)
    lower = StewartPlatform(EXAMPLE.replaced({
        'limits.length_min': (), 'limits.length_max': (), 'geometry.zero_length': 1.2}))
    assert np.mean(lower.inverse_kinematics(lower.home_pose())) == pytest.approx(1.2, abs=1e-9)


@pytest.mark.parametrize('changes', [
    {'limits.length_min': (), 'limits.length_max': (), 'geometry.zero_length': 0.0},
    {'limits.length_min': 0.01, 'limits.length_max': 0.02}])
def test_an_unknown_home_is_an_error(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        StewartPlatform(EXAMPLE.replaced(changes, 'a.yaml')).home_pose()


def test_check_returns_the_possible_errors(snapshot: Snapshot) -> None:
    assert ON_EXAMPLE.check() == ()
    wrong = EXAMPLE.replaced({'gravity': [0.0, 0.0, -9806.65]})
    found = StewartPlatform(wrong).check()
    assert found == find_parameter_errors(wrong)
    assert len(found) == 1
    snapshot(found[0])


def test_representations_are_short(platform: StewartPlatform, snapshot: Snapshot) -> None:
    snapshot(repr(ON_EXAMPLE))
    motion = random_motion(platform.parameters, rng(), 5000)
    for result in (motion, platform.inverse_dynamics(motion), platform.force_breakdown(motion),
                   platform.natural_modes(motion, 1e6)):
        assert len(repr(result)) < 150


# Arbitrary input

CALLS = {name: call for name, call in inspect.getmembers(StewartPlatform, inspect.isfunction)
         if not name.startswith('_') and name not in (
             'solve', 'base_wrenches', 'drive_rates', 'regressors', 'regressors_at_rest',
             'check', 'home_pose', 'servo_pulses')}
DRIVES = {'actuator.screw_lead': 0.01, 'drive.motor_inertia': 1e-5, 'drive.efficiency': 0.9,
          'drive.torque_max': 2.0, 'drive.torque_constant': 0.5, 'drive.resistance': 1.0}
DRIVEN = StewartPlatform(symmetric_parameters().replaced(
    {**DRIVES, 'geometry.zero_length': 1.1}))


def numbers_of(result: Any) -> list[Array]:
    """Return all arrays of a result."""
    if isinstance(result, InverseDynamics):
        return [getattr(result, name) for name in (
            'lengths', 'rates', 'forces', 'unit_load_forces', 'determinant', 'determinant_rate',
            'condition_number', 'time_to_crossing')]
    if isinstance(result, Regressor):
        return [result.matrix]
    return [*result] if isinstance(result, tuple) else [
        result.rows if isinstance(result, Pose | Motion) else result]


@pytest.mark.parametrize('name', CALLS)
def test_any_leading_shape_gives_the_same_samples(name: str) -> None:
    p, random = DRIVEN.parameters, rng()
    motion = random_motion(p, random, 12)
    result = DRIVEN.inverse_dynamics(motion)
    samples: dict[str, Any] = {
        'motion': motion, 'pose': motion.pose, 'guess': motion.pose, 'lengths': result.lengths,
        'rates': result.rates, 'forces': result.forces, 'wrench': random_wrench(p, random, 12),
        'base': random_base_motion(p, random, 12),
        'leg_stiffness': random.uniform(1e6, 1e8, (12, 6))}
    given = {each: samples[each] for each in inspect.signature(CALLS[name]).parameters
             if each in samples}
    # Where numpy multiplies matrices, the last digits depend on how many there are.
    off = {'natural_modes': 1e-9}.get(name, 1e-13 if name.endswith((
        'matrix', 'vector', 'jacobian', 'jacobian_rate', 'stiffness')) else 0.0)

    def call(**changes: Any) -> list[Array]:
        return numbers_of(CALLS[name](DRIVEN, **{**given, **changes}))

    def check(found: list[Array], truth: list[Array]) -> None:
        for a, b in zip(found, truth, strict=True):
            assert a.shape == b.shape
            np.testing.assert_allclose(
                a, b, rtol=0.0, atol=off and off * np.abs(b).max(initial=0.0))

    whole = call()
    check(call(**{each: value.reshape(3, 4, 6) if isinstance(value, np.ndarray)
                  else value.of_rows(value.rows.reshape(3, 4, -1))
                  for each, value in given.items()}),
          [many.reshape(3, 4, *many.shape[1:]) for many in whole])
    check(call(**{each: value[7] for each, value in given.items()}), [many[7] for many in whole])
    check(call(**{each: value[:0] for each, value in given.items()}), [many[:0] for many in whole])
    for one in given if len(given) > 1 else ():
        mixed = call(**{one: given[one][7]})
        assert {len(many) for many in mixed} == {12}
        check([many[7] for many in mixed], [many[7] for many in whole])


NUMBERS = st.one_of(st.floats(-3.0, 3.0), st.floats(), st.sampled_from(
    [0.0, 1e-300, 1e155, 1e300, -1e308, 5e-324]))
ARRAYS = st.sampled_from([(), (3,), (6,), (2, 6), (3, 6), (0, 6), (5,)]).flatmap(
    lambda shape: st.lists(NUMBERS, min_size=int(np.prod(shape)), max_size=int(np.prod(shape)))
    .map(lambda values: np.reshape(values, shape)))
ODD = st.sampled_from([None, 'text', {}, {'a': 1}, [], [[]], object(), 1 + 1j, True, [1, [2]], b'',
                       np.array(['x'] * 6), np.array([None] * 6), 10 ** 400, [10 ** 400] * 6,
                       np.datetime64('2026-01-01'), np.ma.masked, Motion, float])


def vectors(many: int) -> st.SearchStrategy[list[Array]]:
    """Return vectors of any finite numbers, of one sample, two or none."""
    finite = st.one_of(st.floats(-3.0, 3.0), st.floats(allow_nan=False, allow_infinity=False))
    return st.builds(
        lambda numbers, shape: [np.broadcast_to(part, (*shape, 3))
                                for part in np.reshape(numbers, (many, 3))],
        st.lists(finite, min_size=3 * many, max_size=3 * many),
        st.sampled_from([(), (2,), (0,), (3, 1)]))


def motions() -> st.SearchStrategy[Any]:
    """Return motions and poses."""
    def made(parts: list[Array], angles: list[float], pose: bool) -> Any:
        motion = Motion.from_pose(Pose.from_euler(parts[0], angles), *parts[1:])
        return motion.pose if pose else motion

    return st.builds(made, vectors(5), st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
                     st.booleans())


WITH_DRIVES = StewartPlatform(symmetric_parameters().replaced(DRIVES))


@pytest.mark.parametrize('name', CALLS)
@given(st.data())
def test_any_arguments_give_finite_numbers_or_one_line(name: str, data: st.DataObject) -> None:
    names = [p.name for p in inspect.signature(CALLS[name]).parameters.values()
             if p.name not in ('self', 'singular', 'christoffel', 'tilt')]
    arguments = {each: data.draw(st.one_of(
        motions() if each in ('motion', 'pose', 'guess') else
        vectors(4).map(lambda parts: BaseMotion(*parts)) if each == 'base' else ARRAYS,
        ARRAYS, ODD)) for each in names}
    with np.errstate(all='raise', under='ignore'):
        try:
            result = CALLS[name](WITH_DRIVES, **arguments)
        except StewartError as exc:
            assert '\n' not in str(exc)
            assert 10 < len(str(exc)) < 1000
            return
    assert all(np.isfinite(part).all() for part in (
        [result.rows] if isinstance(result, InverseDynamics) else numbers_of(result)))


# Results as text, as a table and as a figure

def test_one_result_shows_its_numbers(snapshot: Snapshot) -> None:
    result = ON_EXAMPLE.inverse_dynamics(Motion.from_pose(ON_EXAMPLE.home_pose()))
    text = repr(result)
    assert isinstance(result.determinant, float)
    assert f'forces [{result.forces[0]:.6g}, ' in text
    snapshot(text)


@pytest.mark.parametrize('shape', [(), (4,), (2, 3)])
def test_results_are_columns_of_a_table(shape: tuple[int, ...]) -> None:
    position = np.broadcast_to([0.0, 0.0, 1.1], (*shape, 3)) + rng().normal(0.0, 0.01, (*shape, 3))
    result = ON_EXAMPLE.inverse_dynamics(Motion(position, np.eye(3)))
    table = result.to_dict()
    size = int(np.prod(shape))
    assert {column.shape for column in table.values()} == {(size,)}
    for name in ('lengths', 'rates', 'forces', 'unit_load_forces'):
        columns = np.stack([table[f'{name[:-1]}_{leg}'] for leg in range(1, 7)], axis=-1)
        assert np.array_equal(columns.reshape(*shape, 6), getattr(result, name))
    for name in ('determinant', 'determinant_rate', 'condition_number', 'time_to_crossing'):
        assert np.array_equal(table[name].reshape(shape), getattr(result, name))


def test_results_of_cranks_are_drawn() -> None:
    platform = StewartPlatform.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
    home = platform.home_pose()
    result = platform.inverse_dynamics(Motion(home.position + 1e-3 * np.eye(3), home.rotation))
    figure = result.plot()
    assert [each.title.text for each in figure.select_yaxes()] == [
        'angle [rad]', 'speed [rad/s]', 'torque [N m]']
    lines = [*figure.select_traces({'yaxis': 'y3'})]
    assert np.array_equal(np.stack([line.y for line in lines], axis=-1), result.torques)


def test_results_are_drawn(snapshot: Snapshot) -> None:
    position = np.array([[0.0, 0.0, 1.1], [0.0, 0.0, 1.12], [0.0, 0.0, 1.15]])
    result = ON_EXAMPLE.inverse_dynamics(Motion(position, np.eye(3)))
    times = [0.0, 0.1, 0.3]
    figure = result.plot(times)
    axes = [*figure.select_yaxes()]
    snapshot('\n'.join([each.title.text for each in axes]))
    for each, values in zip(axes, (result.lengths, result.rates, result.forces), strict=True):
        lines = [*figure.select_traces({'yaxis': each.plotly_name.replace('axis', '')})]
        assert np.array_equal(lines[0].x, times)
        assert np.array_equal(np.stack([line.y for line in lines], axis=-1), values)
    assert figure.layout.xaxis.title.text == 'time [s]'
    assert result.plot().layout.xaxis.title.text == 'sample'
    with snapshot.raises(MotionError):
        result.plot([0.0, 0.1])
    with snapshot.raises(MotionError):
        ON_EXAMPLE.inverse_dynamics(Motion(position[0], np.eye(3))).plot()


def test_forward_kinematics_begins_at_home() -> None:
    pose = Pose.from_euler([0.1, -0.05, 1.25], [0.1, 0.05, -0.2])
    found = ON_EXAMPLE.forward_kinematics(ON_EXAMPLE.inverse_kinematics(pose))
    assert np.abs(found.rows - pose.rows).max() < 1e-11
