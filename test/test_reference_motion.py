# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motions: their derivatives against finite differences, their ends, the files in config."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from snapshot import Snapshot

from stewart_dynamics import Motion, MotionError, ParameterError, StewartPlatform
from stewart_dynamics.mechanics.frames import rotation as rotations
from stewart_dynamics.reference_motion.motion_functions import (
    first_pose, motion_at, sample_time, sample_times)
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.reference_motion.multisine import multisine
from stewart_dynamics.setpoints.step import Batch, Step

PROGRAM = 'stewart_trajectory'

CONFIG = Path(__file__).resolve().parents[1] / 'config'
FILES = sorted(CONFIG.glob('trajectory_*.yaml'))
OF_CRANKS = 'trajectory_cranks'  # test_loop.py holds it against the limits of its hexapod

INITIAL = [0.1, -0.2, 1.1, 0.3, -0.2, 0.4]
FINAL = [-0.2, 0.1, 0.9, -0.5, 0.6, 1.7]
BETWEEN = {
    'motion.initial': INITIAL, 'motion.final': FINAL, 'motion.duration': 3.0}
MOTIONS = {
    'paper': {'motion.type': 'paper', **BETWEEN},
    'quintic': {'motion.type': 'quintic', **BETWEEN},
    'paper back and forth': {'motion.type': 'paper', 'loop': True, **BETWEEN},
    'quintic back and forth': {'motion.type': 'quintic', 'loop': True, **BETWEEN},
    'sine': {
        'motion.type': 'sine', 'motion.initial': INITIAL, 'motion.duration': 3.0,
        'motion.amplitude': [0.1, 0.2, 0.05, 0.3, 0.2, 0.5],
        'motion.frequency': [0.5, 0.3, 1.0, 0.7, 0.4, 0.6],
        'motion.phase': [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]},
    'fourier': {
        'motion.type': 'fourier', 'motion.initial': INITIAL, 'motion.duration': 3.0,
        'motion.fourier.frequency': 0.5, 'motion.fourier.fade': 1.2,
        'motion.fourier.cosine': [
            0.01, 0.02, 0.01, 0.02, -0.03, 0.05, 0.0, -0.01, 0.01, 0.0, 0.02, 0.03],
        'motion.fourier.sine': [
            0.02, 0.0, 0.01, 0.05, 0.03, -0.08, 0.01, 0.01, 0.0, -0.03, 0.0, 0.05]},
    'response': {
        'motion.type': 'response', 'motion.initial': INITIAL, 'motion.response.period': 2.0,
        'motion.response.periods': 2.0, 'motion.response.highest_frequency': 2.0,
        'motion.amplitude': [1e-3, 0.0, 2e-3, 0.0, 2e-3, 1e-3]},
    'hold': {'motion.type': 'hold', 'motion.initial': INITIAL, 'motion.duration': 3.0},
}
POINT_TO_POINT = ('paper', 'quintic')


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_a_simulator_can_begin_where_a_motion_does(path: Path) -> None:
    parameters = ReferenceMotionParameters.from_yaml(path)
    pose, begin = first_pose(parameters), motion_at(parameters, 0.0)
    assert pose.shape == (6,)
    assert np.array_equal(pose[:3], begin.position)
    assert np.abs(rotations.from_euler(pose[3:]) - begin.rotation).max() < 1e-15
    if path.stem == OF_CRANKS:
        rig = StewartPlatform.from_yaml(CONFIG / 'crank_platform.yaml')
        assert np.abs(pose[:3] - rig.home_pose().position).max() < 1e-6
        assert np.abs(pose[3:]).max() < 1e-12


@pytest.fixture(scope='module')
def platform() -> StewartPlatform:
    return StewartPlatform.from_yaml(CONFIG / 'platform.yaml')


def parameters(name: str, **changes: object) -> ReferenceMotionParameters:
    return ReferenceMotionParameters({**MOTIONS[name], **changes})


def skew(vector: np.ndarray) -> np.ndarray:
    return -np.cross(vector[..., None, :], np.eye(3))


def pose_matches(motion: Motion, pose: list[float]) -> bool:
    return (np.allclose(motion.position, pose[:3], rtol=0.0, atol=1e-14)
            and np.allclose(motion.rotation, rotations.from_euler(pose[3:]), rtol=0.0,
                            atol=1e-14))


def at_rest(motion: Motion) -> bool:
    return bool(np.all(motion.rows[..., 12:] == 0.0))


@pytest.mark.parametrize('name', MOTIONS)
def test_derivatives_are_those_of_the_pose(name: str) -> None:
    p, step = parameters(name), 1e-5
    end = 6.0 if p['loop'] else 3.0
    times = np.random.default_rng(1).uniform(step, end - step, (20, 5))
    now = motion_at(p, times)
    before, after = motion_at(p, times - step), motion_at(p, times + step)

    def rate(quantity: str) -> np.ndarray:
        change = getattr(after, quantity) - getattr(before, quantity)
        return np.asarray(change / (2.0 * step))

    assert now.shape == (20, 5)
    for quantity, derivative in (('position', now.linear_velocity),
                                 ('rotation', skew(now.angular_velocity) @ now.rotation),
                                 ('linear_velocity', now.linear_acceleration),
                                 ('angular_velocity', now.angular_acceleration)):
        np.testing.assert_allclose(rate(quantity), derivative, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize('name', MOTIONS)
def test_one_time_gives_what_many_give(name: str) -> None:
    p, times = parameters(name), np.linspace(-1.0, 7.0, 50)
    rows = np.array([motion_at(p, t).rows for t in times])
    assert motion_at(p, 0.5).shape == ()
    np.testing.assert_allclose(motion_at(p, times).rows, rows, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(('name', 'final'), [
    ('paper', FINAL), ('quintic', FINAL), ('fourier', INITIAL), ('hold', INITIAL)])
def test_begins_and_ends_with_no_velocity_and_rests_before_and_after(
        name: str, final: list[float]) -> None:
    p = parameters(name)
    for time, pose in ((-1.0, INITIAL), (0.0, INITIAL), (3.0, final), (3.001, final)):
        motion = motion_at(p, time)
        assert pose_matches(motion, pose)
        np.testing.assert_allclose(motion.rows[12:18], 0.0, atol=1e-15)
        if name != 'paper' or time not in (0.0, 3.0):  # its acceleration has a step
            assert at_rest(motion)


def test_quintic_turns_about_one_fixed_axis_on_a_straight_line() -> None:
    motion = motion_at(parameters('quintic'), np.linspace(0.1, 2.9, 20))
    way, omega = np.subtract(FINAL, INITIAL)[:3], motion.angular_velocity
    np.testing.assert_allclose(np.cross(motion.linear_velocity, way), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.cross(omega, omega[0]), 0.0, atol=1e-15)


def test_quintic_between_equal_orientations_does_not_turn() -> None:
    motion = motion_at(parameters('quintic', **{'motion.final': [0.0, 0.0, 1.0, *INITIAL[3:]]}),
                       np.linspace(0.0, 3.0, 7))
    np.testing.assert_allclose(motion.angular_velocity, 0.0, atol=1e-15)
    np.testing.assert_allclose(motion.rotation - motion.rotation[0], 0.0, atol=1e-15)


def test_quintic_turns_by_half_a_turn() -> None:
    p = parameters('quintic', **{'motion.initial': [0.0] * 6,
                                 'motion.final': [0.0] * 5 + [np.pi]})
    motion = motion_at(p, [1.5, 3.0])
    np.testing.assert_allclose(np.abs(motion.rotation[0, 1, 0]), 1.0, atol=1e-15)
    assert pose_matches(motion_at(p, 3.0), [0.0] * 5 + [np.pi])


def test_fourier_is_its_series_between_the_fades() -> None:
    p = parameters('fourier')
    times = np.linspace(1.2, 1.8, 7)
    angle = 2.0 * np.pi * 0.5 * times[:, None]
    cosine, sine = np.reshape([p['motion.fourier.cosine'], p['motion.fourier.sine']], (2, 2, 6))
    pose = np.array(INITIAL) + sum(
        cosine[k] * np.cos((k + 1) * angle) + sine[k] * np.sin((k + 1) * angle) for k in (0, 1))
    motion = motion_at(p, times)
    np.testing.assert_allclose(motion.position, pose[:, :3], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(
        motion.rotation, rotations.from_euler(pose[:, 3:]), rtol=0.0, atol=1e-14)


def test_the_acceleration_of_fourier_has_no_step_at_the_ends() -> None:
    near = motion_at(parameters('fourier'), [1e-6, 3.0 - 1e-6]).rows[:, 12:]
    assert 0.0 < np.abs(near).max() < 1e-4


def test_fourier_looped_is_periodic_after_the_fade() -> None:
    p = parameters('fourier', loop=True, **{'motion.fourier.fade': 2.9})
    assert at_rest(motion_at(p, 0.0))
    times = np.linspace(2.9, 4.9, 31)
    rows = motion_at(p, times).rows
    np.testing.assert_allclose(motion_at(p, times + 2.0).rows, rows, atol=1e-13)
    np.testing.assert_allclose(motion_at(p, times + 2e6).rows, rows, atol=1e-8)


def test_a_fourier_series_needs_one_kind_of_coefficients() -> None:
    both, times = parameters('fourier'), np.linspace(0.0, 3.0, 9)
    parts = [motion_at(parameters('fourier', **{f'motion.fourier.{without}': None}), times)
             for without in ('cosine', 'sine')]
    np.testing.assert_allclose(
        parts[0].position + parts[1].position - INITIAL[:3], motion_at(both, times).position,
        rtol=0.0, atol=1e-15)


def test_a_series_of_three_harmonics_is_not_taken_for_joints(tmp_path: Path) -> None:
    three = np.arange(18.0) * 1e-3
    p = parameters('fourier', **{'motion.fourier.cosine': three, 'motion.fourier.sine': None})
    assert p['motion.fourier.cosine'].tolist() == three.reshape(3, 6).tolist()
    p.to_yaml(tmp_path / 'file.yaml')
    assert ReferenceMotionParameters.from_yaml(tmp_path / 'file.yaml') == p


@pytest.mark.parametrize('name', POINT_TO_POINT)
def test_loop_runs_back_the_same_way(name: str) -> None:
    p, times = parameters(name, loop=True), np.linspace(0.0, 3.0, 31)
    forth, back = motion_at(p, times), motion_at(p, 6.0 - times)
    np.testing.assert_allclose(back.rows[..., :12], forth.rows[..., :12], atol=1e-14)
    np.testing.assert_allclose(back.linear_velocity, -forth.linear_velocity, atol=1e-14)
    np.testing.assert_allclose(motion_at(p, times + 60.0).rows, forth.rows, atol=1e-13)


def test_times_that_are_not_finite_are_rejected(snapshot: Snapshot) -> None:
    with snapshot.raises(MotionError):
        motion_at(parameters('quintic'), [0.0, np.nan])


@pytest.mark.parametrize(('duration', 'rate', 'count', 'last'), [
    (10.0, 100.0, 1001, 10_000_000_000),
    (10.0, 1000.0, 10_001, 10_000_000_000),
    (0.1, 30.0, 4, 100_000_000),
    (1.0, 3.0, 4, 1_000_000_000),
    (1.05, 10.0, 12, 1_100_000_000),
    (0.001, 10.0, 2, 100_000_000),
])
def test_samples_reach_the_duration(
        duration: float, rate: float, count: int, last: int) -> None:
    times = sample_times(parameters('paper', **{'motion.duration': duration, 'rate': rate}))
    assert times.dtype == np.int64
    assert (len(times), times[0], times[-1]) == (count, 0, last)


def test_samples_are_spaced_exactly() -> None:
    times = sample_times(parameters('sine', rate=125.0))
    assert np.all(np.diff(times) == 8_000_000)
    assert sample_times(parameters('sine', rate=3.0))[:4].tolist() == [
        0, 333_333_333, 666_666_667, 1_000_000_000]
    assert sample_time(parameters('sine', rate=3.0), 3_000_001) == 1_000_000_333_333_333


@pytest.mark.parametrize(('name', 'changes'), [
    ('paper', {'motion.final': None}),
    ('paper', {'motion.initial': None}),
    ('paper', {'motion.type': 'cubic'}),
    ('paper', {'motion.duration': 0.0}),
    ('paper', {'output': 'both'}),
    ('fourier', {'motion.fourier.cosine': [0.1] * 7}),
    ('fourier', {'motion.fourier.cosine': 0.1}),
    ('fourier', {'motion.fourier.cosine': [0.1] * 18}),
    ('fourier', {'motion.fourier.cosine': None, 'motion.fourier.sine': []}),
    ('fourier', {'motion.fourier.fade': 1.6}),
    ('fourier', {'motion.fourier.fade': 0.0}),
    ('fourier', {'motion.fourier.frequency': 0.0})])
def test_a_broken_rule_is_named(name: str, changes: dict[str, object], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        parameters(name, **changes)


@pytest.mark.parametrize('path', [each for each in FILES if each.stem != OF_CRANKS],
                         ids=lambda path: path.stem)
def test_files_suit_the_hexapod(path: Path, platform: StewartPlatform) -> None:
    motion, p = ReferenceMotionParameters.from_yaml(path), platform.parameters
    times = np.arange(0.0, 60.0, 0.01) if motion['loop'] else sample_times(motion) / 1e9
    result = platform.inverse_dynamics(motion_at(motion, times))
    assert np.all(result.lengths >= p['limits.length_min'])
    assert np.all(result.lengths <= p['limits.length_max'])
    assert np.all(np.abs(result.rates) <= p['limits.velocity_max'])
    singular = path.stem == 'trajectory_singular'
    assert np.any(np.abs(result.forces) > p['limits.force_max']) == singular
    answers = Step(p)(Batch.from_parts(np.arange(len(times)), motion_at(motion, times).rows))
    assert np.any(answers.warnings) == singular
    assert singular or result.condition_number.max() < 5.0


def test_singular_path_crosses_once_between_8_and_9_s(platform: StewartPlatform) -> None:
    p = ReferenceMotionParameters.from_yaml(CONFIG / 'trajectory_singular.yaml')
    assert (p['motion.type'], p['motion.duration']) == ('paper', 10.0)
    times = sample_times(p) / 1e9
    result = platform.inverse_dynamics(motion_at(p, times))
    crossings = times[1:][np.diff(np.sign(result.determinant)) != 0]
    assert len(crossings) == 1 and 8.0 < crossings[0] < 9.0
    worst = times[np.argmax(np.abs(result.forces).max(axis=-1))]
    assert abs(worst - crossings[0]) < 0.02


RESPONSE = {
    'motion.type': 'response', 'motion.initial': [0.0, 0.0, 1.1, 0.0, 0.0, 0.0],
    'motion.response.params_file': str(CONFIG / 'platform.yaml')}


def test_the_motion_response_moves_one_axis_after_the_other_and_rests_between() -> None:
    p = ReferenceMotionParameters({
        **MOTIONS['response'], 'motion.response.period': 0.2,
        'motion.response.highest_frequency': 25.0})
    times = sample_times(p) * 1e-9
    assert times[-1] == pytest.approx(4 * (3.5 * 0.2 + 2.5))
    motion = motion_at(p, times)
    start = rotations.from_euler(INITIAL[3:])
    axes = np.hstack([motion.position - INITIAL[:3],
                      rotations.to_rotation_vector(motion.rotation @ start.T)])
    moving = np.abs(axes) > 1e-12
    assert moving.sum(axis=1).max() == 1
    assert np.flatnonzero(moving.any(axis=0)).tolist() == [0, 2, 4, 5]
    np.testing.assert_allclose(
        np.abs(axes).max(axis=0), MOTIONS['response']['motion.amplitude'], rtol=0.05, atol=1e-12)
    whole = round((3.5 * 0.2 + 2.5) * 100)
    for n, axis in enumerate((0, 2, 4, 5)):
        # After the first period it repeats.
        begin = n * whole + 20
        np.testing.assert_allclose(axes[begin:begin + 20, axis], axes[begin + 20:begin + 40, axis],
                                   atol=1e-15)
        assert not moving[(n + 1) * whole - 240:(n + 1) * whole].any()
    assert at_rest(motion[0]) and at_rest(motion[-1])
    looped = motion_at(ReferenceMotionParameters({**p.given, 'loop': True}), times + times[-1])
    np.testing.assert_allclose(looped.rows, motion.rows, atol=1e-9)


@pytest.mark.parametrize('part', [0.1, 0.5])
def test_the_motion_response_uses_a_part_of_what_the_limits_allow(
        part: float, platform: StewartPlatform) -> None:
    p = ReferenceMotionParameters({**RESPONSE, 'motion.response.part': part})
    motion = motion_at(p, sample_times(p) * 1e-9)
    result, limits = platform.inverse_dynamics(motion), platform.parameters
    rest = result.lengths[0]
    room = np.where(result.lengths > rest, limits['limits.length_max'] - rest,
                    rest - limits['limits.length_min'])
    uses = [np.abs(result.lengths - rest) / room,
            np.abs(result.rates) / limits['limits.velocity_max'],
            np.abs(result.forces - result.forces[0]) / (
                limits['limits.force_max'] - np.abs(result.forces[0]))]
    whole = len(motion) // 6
    for axis in range(6):
        of_axis = [each[axis * whole:(axis + 1) * whole].max() for each in uses]
        # Joint angles and the condition number may bound it, and the fades are a little faster.
        assert 0.5 * part < max(of_axis) < 1.1 * part, (axis, of_axis)


def test_the_motion_response_has_low_peaks() -> None:
    for highest in (10, 50, 100, 400):
        signal = multisine(highest)
        crests = [np.abs(each).max() / each.std()
                  for each in signal.at(np.arange(32 * highest) / (32 * highest))]
        # A single sine has 1.41; of random phases the product is above 20.
        assert np.prod(crests) < 13.0 and crests[0] < 1.7
        assert np.abs(signal.at(np.linspace(0.0, 1.0, 10_001))[0]).max() == pytest.approx(
            1.0, rel=2e-3)


@pytest.mark.parametrize('changes', [
    {'motion.response.params_file': ''},
    {'motion.amplitude': [0.01] * 6},
    {'motion.response.periods': 2.5},
    {'motion.response.highest_frequency': 30.0},
    {'motion.response.period': 0.1},
    {'motion.response.period': 10.005}])
def test_a_motion_response_that_breaks_a_rule_is_rejected(
        changes: dict[str, object], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        ReferenceMotionParameters({**RESPONSE, **changes})


@pytest.mark.parametrize('given', [
    {'limits.velocity_max': None, 'limits.force_max': None},
    {'limits.length_max': 1.0}])
def test_a_hexapod_whose_limits_do_not_bound_a_motion_is_named(
        given: dict[str, object], platform: StewartPlatform, tmp_path: Path,
        snapshot: Snapshot) -> None:
    path = tmp_path / 'hexapod.yaml'
    platform.parameters.replaced(given).to_yaml(path)
    p = ReferenceMotionParameters({**RESPONSE, 'motion.response.params_file': str(path)})
    with snapshot.raises(ParameterError):
        sample_times(p)
