# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Calibration: geometry recovered, intervals that hold, numbers that are not identifiable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cases import few
import numpy as np
from numpy.testing import assert_allclose
import pytest
from referees import PLATFORM
from snapshot import Snapshot
from stewart_dynamics import (
    calibrate, Motion, MotionError, ParameterError, Parameters, Pose, StewartError,
    StewartPlatform)
from stewart_dynamics.calibration.equations import (
    Equations, Frames, GEOMETRY, inverse, product, values_of, with_geometry)
from stewart_dynamics.calibration.frames import find_frames
from stewart_dynamics.calibration.geometry_fit import fit, Unknowns
from stewart_dynamics.calibration.measured_poses import Millimeters
from stewart_dynamics.calibration.noise import covariances, Noise
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics.drives.turning_screws import screw_constants, universal_axes
from stewart_dynamics.mechanics.frames.rotation import from_euler

PROGRAM = 'stewart_calibrate'

# M. J. Nategh, M. M. Agheli, "A total solution to kinematic calibration of hexapod machine tools
# with a minimum number of measurement configurations and superior accuracies", Int. J. Machine
# Tools and Manufacture 49(15), 2009, doi:10.1016/j.ijmachtools.2009.08.009, tables 1 and 2 [mm]:
# platform joint, base joint, zero length of each leg.
NOMINAL = np.array([
    [92.1597, 84.4488, 0, 305.4001, 111.1565, 0, 604.8652],
    [27.055, 122.037, 0, -56.4357, 320.0625, 0, 604.8652],
    [-119.2146, 37.5882, 0, -248.9644, 208.9060, 0, 604.8652],
    [-119.2146, -37.5882, 0, -248.9644, -208.9060, 0, 604.8652],
    [27.055, -122.037, 0, -56.4357, -320.0625, 0, 604.8652],
    [92.1597, -84.4488, 0, 305.4001, -111.1565, 0, 604.8652]])
REAL = np.array([
    [96.6610, 81.7602, 1.0684, 305.2599, 115.0695, 2.6210, 604.4299],
    [22.2476, 125.2511, -0.5530, -55.2814, 322.9819, 4.2181, 607.2473],
    [-122.4519, 36.6453, 4.3547, -244.7954, 208.0087, 3.9365, 600.4441],
    [-120.6859, -34.4565, -4.9014, -252.5755, -211.8783, -3.0128, 605.9031],
    [24.7769, -125.0489, -4.8473, -53.9678, -320.6115, 4.3181, 604.5251],
    [91.3462, -80.9866, 0.2515, 302.4266, -109.4351, 3.3812, 600.0616]])

EXACT = Noise(0.0, 0.0, 0.0)
HEXAPOD = StewartPlatform.from_yaml(PLATFORM)
LEGS = TELESCOPIC.calibrated_legs(HEXAPOD.parameters)
FRAMES = Frames(Pose([1.0, 2.0, 0.3], from_euler([0.3, 0.2, 2.0])),
                Pose([0.1, 0.2, 0.3], from_euler([0.5, -0.2, 1.0])))


def published(table: np.ndarray) -> np.ndarray:
    """Return the values of a table [m]."""
    return np.concatenate([1e-3 * table[:, 3:6].ravel(), 1e-3 * table[:, :3].ravel(),
                           1e-3 * table[:, 6], np.zeros(12)])


def random_poses(rng: np.random.Generator, count: int, travel: float = 0.15,
                 tilt: tuple[float, float, float] = (0.3, 0.3, 0.3)) -> Pose:
    home = HEXAPOD.home_pose()
    return Pose(home.position + rng.uniform(-travel, travel, (count, 3)),
                from_euler(rng.uniform(-1.0, 1.0, (count, 3)) * tilt))


def true_values(rng: np.random.Generator, deviation: float = 1e-3) -> np.ndarray:
    values = values_of(LEGS)
    values[GEOMETRY] += rng.normal(0.0, deviation, LEGS.count)
    return values


def measured(rng: np.random.Generator, values: np.ndarray, poses: Pose,
             noise: Noise = EXACT) -> tuple[np.ndarray, Pose]:
    """Return leg positions at true poses, and the poses with noise."""
    lengths = Equations(LEGS, np.zeros((len(poses), 6)), poses).at(values).residuals
    turns = from_euler(rng.normal(0.0, noise.rotation, (len(poses), 3)))
    return lengths + rng.normal(0.0, noise.drive, lengths.shape), Pose(
        poses.position + rng.normal(0.0, noise.position, (len(poses), 3)), turns @ poses.rotation)


def test_residuals_are_those_of_inverse_kinematics() -> None:
    rng = np.random.default_rng(0)
    poses, values = random_poses(rng, 20), true_values(rng)
    real = StewartPlatform(with_geometry(LEGS, values))
    positions = real.inverse_kinematics(poses) - real.parameters['geometry.zero_length']
    assert_allclose(Equations(LEGS, positions, poses).at(values).residuals, 0.0, atol=1e-15)
    # The same poses, as a device in another frame measures another part of the platform.
    seen = Equations(LEGS, positions, poses, FRAMES).as_measured(poses, FRAMES)
    values[42:] = [*FRAMES.device.position, 0, 0, 0, *FRAMES.target.position, 0, 0, 0]
    there = Equations(LEGS, positions, seen, FRAMES)
    assert_allclose(there.at(values).residuals, 0.0, atol=2e-15)
    assert_allclose(there.in_base(FRAMES).rows, poses.rows, atol=1e-14)


def test_derivatives_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(1)
    values = true_values(rng)
    values[LEGS.count:] = rng.normal(0.0, 0.3, 12)
    equations = Equations(LEGS, rng.normal(0.0, 1.0, (5, 6)), random_poses(rng, 5), FRAMES)
    steps = 1e-6 * np.eye(len(values))
    differences = np.stack([
        (equations.at(values + step).residuals - equations.at(values - step).residuals) / 2e-6
        for step in steps], axis=-1)
    lin = equations.at(values)
    assert_allclose(lin.derivatives, differences, atol=2e-9)
    # An error of the measured pose changes the lengths as position and rotation say.
    shift, turn = 1e-7 * rng.normal(size=(2, 3))
    device = product(FRAMES.device, Pose(np.zeros(3), np.eye(3)))
    moved = product(inverse(device), Pose(shift, np.eye(3)))
    frames = equations.frames_at(values)
    axes = frames.device.rotation.T
    other = equations._replace(pose=Pose(
        equations.pose.position + axes @ shift,
        from_euler(axes @ turn) @ equations.pose.rotation))
    assert_allclose(other.at(values).residuals - lin.residuals,
                    lin.position @ shift + lin.rotation @ turn, atol=1e-12)
    assert moved.shape == ()


@pytest.mark.parametrize('frames', ['known', 'unknown'])
def test_the_published_geometry_is_recovered(frames: str) -> None:
    """Without noise to 1e-9 mm, from the published nominal geometry."""
    p = Parameters.from_yaml(PLATFORM).replaced({
        'limits.length_min': None, 'limits.length_max': None})
    nominal = StewartPlatform(with_geometry(TELESCOPIC.calibrated_legs(p), published(NOMINAL)))
    true = published(REAL)
    rng = np.random.default_rng(2)
    poses = Pose(np.array([0.0, 0.0, 0.7]) + rng.uniform(-0.15, 0.15, (40, 3)),
                 from_euler(rng.uniform(-0.3, 0.3, (40, 3))))
    lengths, seen = measured(rng, true, poses)
    assert np.abs(true - published(NOMINAL)).max() > 4e-3
    if frames == 'known':
        found = calibrate(nominal, lengths, seen)
        assert set(found.states) == {'identified'}
        assert np.abs(found.values - true[GEOMETRY]).max() < 1e-12
        assert found.validation is not None
        assert found.validation.before.rms[0] > 1e-3
        assert found.validation.after.largest[0] < 1e-12
        return
    # Three joints at the true values define the base frame, and three the platform frame.
    joints = ('leg_1', 'leg_3', 'leg_5')
    fixed = [f'{part}.{joint}' for part in ('base_joints', 'platform_joints') for joint in joints]
    known = published(NOMINAL)
    for leg in (0, 2, 4):
        for part in (0, 18):
            which = slice(part + 3 * leg, part + 3 * leg + 3)
            known[which] = true[which]
    partly = StewartPlatform(with_geometry(TELESCOPIC.calibrated_legs(p), known))
    seen = Equations(LEGS, lengths, seen).as_measured(seen, FRAMES)
    found = calibrate(partly, lengths, seen, frames='unknown', fixed=fixed)
    assert np.abs(found.values - true[GEOMETRY]).max() < 1e-12
    assert found.frames is not None
    for each, wanted in zip(found.frames, FRAMES, strict=True):
        assert_allclose(each.rows, wanted.rows, atol=1e-11)


def test_unknown_frames_are_defined_by_the_joints_of_the_file() -> None:
    rng = np.random.default_rng(3)
    values, poses = true_values(rng), random_poses(rng, 40)
    lengths, seen = measured(rng, values, poses)
    seen = Equations(LEGS, lengths, seen).as_measured(seen, FRAMES)
    start = find_frames(HEXAPOD.parameters, Equations(LEGS, lengths, seen))
    assert_allclose(start.device.position, FRAMES.device.position, atol=0.02)
    found = calibrate(HEXAPOD, lengths, seen, frames='unknown')
    assert set(found.states) == {'identified'}
    moved = (found.values - found.start)[:36].reshape(2, 6, 3)
    assert_allclose(moved.mean(axis=1), 0.0, atol=1e-12)
    assert found.frames is not None
    # Whatever the frames, distances between joints are those of the hexapod.
    for part in (slice(0, 18), slice(18, 36)):
        joints, true = (each[part].reshape(6, 3) for each in (found.values, values))
        assert_allclose(np.linalg.norm(joints[:, None] - joints, axis=-1),
                        np.linalg.norm(true[:, None] - true, axis=-1), atol=1e-11)
    assert_allclose(product(found.frames.target, inverse(found.frames.target)).rows,
                    Pose(np.zeros(3), np.eye(3)).rows, atol=1e-13)


def test_unknown_frames_of_an_exact_file_are_found_exactly() -> None:
    rng = np.random.default_rng(4)
    poses = random_poses(rng, 30)
    lengths, seen = measured(rng, values_of(LEGS), poses)
    seen = Equations(LEGS, lengths, seen).as_measured(seen, FRAMES)
    for each, wanted in zip(find_frames(
            HEXAPOD.parameters, Equations(LEGS, lengths, seen)), FRAMES, strict=True):
        assert_allclose(each.rows, wanted.rows, atol=1e-12)


@pytest.mark.parametrize(('tilt', 'rank'), [
    ((0.0, 0.0, 0.0), 4),
    ((0.0, 0.0, 0.5), 6),
    ((0.3, 0.3, 0.0), 7)])
@pytest.mark.parametrize('noise', [EXACT, Noise(2e-6, 1e-5, 1e-5)])
def test_the_kind_of_motion_gives_what_is_identifiable(
        tilt: tuple[float, float, float], rank: int, noise: Noise, snapshot: Snapshot) -> None:
    rng = np.random.default_rng(5)
    values = true_values(rng)
    lengths, seen = measured(rng, values, random_poses(rng, 60, tilt=tilt), noise)
    found = calibrate(HEXAPOD, lengths, seen)
    assert found.identifiability.rank == 6 * rank
    snapshot(found.not_identified)
    assert (found.not_identified is None) == (rank == 7)
    # Poses of this kind are predicted as well as if all numbers were known.
    assert found.validation is not None
    assert found.validation.after.rms[0] < 1e-2 * found.validation.before.rms[0]
    # The identified numbers are right, the others keep the file's values along the unknown.
    of_state = np.array(found.states) == 'identified'
    assert np.abs(found.values - values[GEOMETRY])[of_state].max(initial=0.0) < (
        1e-12 if not noise.position else 1.5e-3)


@pytest.mark.parametrize(('count', 'noise'), [
    (40, Noise(2e-6, 1e-5, 1e-5)), (20, Noise(1e-5, 1e-5, 1e-5))])
def test_intervals_hold_the_truth(count: int, noise: Noise) -> None:
    """Seeds enough for 95 % +- 3 %; benchmarks/calibration.py has 2,000."""
    unknowns = Unknowns.of(
        LEGS, values_of(LEGS), 0.6, np.zeros(LEGS.count, dtype=bool), False)
    inside, variances = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        values = true_values(rng)
        lengths, seen = measured(rng, values, random_poses(rng, count), noise)
        found = fit(Equations(LEGS, lengths, seen), unknowns)
        errors = np.sqrt(np.diag(found.covariance) + (
            found.identifiability.shares * unknowns.scales) ** 2)[GEOMETRY]
        inside.append(np.abs(found.values - values)[GEOMETRY] < 1.96 * errors)
        variances.append(np.square(found.noise))
    assert 0.92 < np.mean(inside) < 0.98
    assert_allclose(np.mean(variances, axis=0)[1:], np.square(noise)[1:], rtol=0.25)


def test_the_estimated_noise_has_the_largest_restricted_likelihood() -> None:
    """By the dense likelihood of all residuals, less the directions of the 42 unknowns."""
    rng = np.random.default_rng(12)
    lengths, seen = measured(rng, true_values(rng), random_poses(rng, 20),
                             Noise(1e-5, 1e-5, 1e-5))
    found = fit(Equations(LEGS, lengths, seen), Unknowns.of(
        LEGS, values_of(LEGS), 0.6, np.zeros(LEGS.count, dtype=bool), False))
    x = found.lin.derivatives[..., GEOMETRY].reshape(120, LEGS.count)
    r = found.lin.residuals.ravel()

    def likelihood(noise: np.ndarray) -> float:
        inverse = np.zeros((120, 120))
        for n, each in enumerate(covariances(Noise(*noise), 0.6, found.lin)):
            inverse[6 * n:6 * n + 6, 6 * n:6 * n + 6] = np.linalg.inv(each)
        information = x.T @ inverse @ x
        projected = inverse - inverse @ x @ np.linalg.solve(information, x.T @ inverse)
        return float(np.linalg.slogdet(inverse)[1] - np.linalg.slogdet(information)[1]
                     - r @ projected @ r)

    best = likelihood(np.array(found.noise))
    for which in range(3):
        for factor in (0.9, 1.1):
            other = np.array(found.noise)
            other[which] *= factor
            assert likelihood(other) < best


def test_outliers_are_named_and_do_not_matter() -> None:
    rng = np.random.default_rng(6)
    values = true_values(rng)
    lengths, seen = measured(rng, values, random_poses(rng, 60), Noise(2e-6, 1e-5, 1e-5))
    clean = calibrate(HEXAPOD, lengths, seen)
    assert not clean.outliers and not clean.lack_of_fit
    lengths[7, 2] += 3e-4
    position = seen.position.copy()
    position[3] += 0.02
    found = calibrate(HEXAPOD, lengths, Pose(position, seen.rotation))
    assert [each.pose for each in found.outliers] == [3, 7]
    assert len(found.outliers[0].legs) > 3 and found.outliers[1].legs == (2,)
    assert_allclose(found.values, clean.values, atol=2e-4)


@pytest.mark.parametrize('seed', range(8))
def test_outliers_do_not_hide_one_another(seed: int) -> None:
    """A least-squares fit to all poses gives way to them, and misses some."""
    rng = np.random.default_rng(100 + seed)
    values = true_values(rng)
    lengths, seen = measured(rng, values, random_poses(rng, 60), Noise(2e-6, 1e-5, 1e-5))
    outlying = np.sort(rng.permutation(60)[:9])
    away = rng.normal(size=(9, 3))
    position = seen.position.copy()
    position[outlying] += 3e-4 * away / np.linalg.norm(away, axis=1)[:, None]
    found = calibrate(HEXAPOD, lengths, Pose(position, seen.rotation))
    assert [each.pose for each in found.outliers] == outlying.tolist()


def scaled(poses: Pose, factor: float) -> Pose:
    return Pose(factor * poses.position, poses.rotation)


def turned(poses: Pose, angles: np.ndarray) -> Pose:
    return Pose(poses.position, from_euler(angles))


def shifted(values: np.ndarray, size: float) -> np.ndarray:
    return values + np.random.default_rng(1).normal(0.0, size, (40, 3)) * (
        np.arange(40) % 2)[:, None]


@pytest.mark.parametrize(('change', 'words'), [
    (lambda q, seen, _: {'poses': scaled(seen, 1e3)},
     'positions are in mm, not in m: --mm-positions reads them so'),
    (lambda q, *_: {'lengths': 1e3 * q},
     'leg positions are in mm, not in m: --mm-legs reads them so'),
    (lambda q, seen, _: {'lengths': 1e3 * q, 'poses': scaled(seen, 1e3)},
     'positions and leg positions are in mm, not in m: --mm reads them so'),
    (lambda q, *_: {'lengths': q[:, [0, 4, 2, 3, 1, 5]]}, 'leg_2 and leg_5 are swapped'),
    (lambda q, *_: {'lengths': q[:, [1, 2, 3, 4, 5, 0]]},
     'the legs are in another order: leg_6, leg_1'),
    (lambda q, seen, angles: {
        'poses': turned(seen, np.degrees(angles)), 'angles': np.degrees(angles)},
     'the angles are in degrees, not in radians: --degrees'),
    (lambda q, seen, angles: {
        'lengths': 1e3 * q, 'poses': turned(scaled(seen, 1e3), np.degrees(angles)),
        'angles': np.degrees(angles)},
     'positions and leg positions are in mm, not in m: --mm reads them so; the angles are in '
     'degrees, not in radians: --degrees'),
    (lambda q, seen, angles: {
        'lengths': 1e-3 * q, 'poses': turned(scaled(seen, 1e-3), np.radians(angles)),
        'angles': angles, 'degrees': True, 'millimeters': Millimeters(True, True)},
     'positions and leg positions are in m, not in mm: without --mm they are read so; the angles '
     'are in radians, not in degrees: without --degrees'),
    (lambda q, seen, _: {'poses': Pose(shifted(seen.position, 0.05), seen.rotation)},
     '20 of 40 poses do not fit the geometry that fits all others'),
    (lambda q, seen, _: {'poses': inverse(seen)}, 'the inverse is needed'),
    (lambda q, seen, _: {'poses': Pose(seen.position, np.swapaxes(seen.rotation, 1, 2))},
     'the rotations are those of the base'),
    (lambda q, *_: {'lengths': -q}, 'leg positions have the opposite sign'),
    (lambda q, seen, _: {'poses': Pose.from_quaternion(
        seen.position, np.roll(seen.quaternion, 1, axis=1))}, 'quaternions have w first'),
    (lambda q, *_: {'lengths': q + 0.95},
     'the leg positions are whole lengths between the joints'),
    (lambda q, *_: {'lengths': q - 0.2776}, 'are the leg positions relative to home'),
    (lambda q, *_: {'lengths': q - 0.2776 * np.eye(6)[2]},
     'geometry.zero_length of leg_3 would become 1.2'),
    (lambda q, seen, _: {'poses': Equations(LEGS, q, seen).as_measured(seen, FRAMES)},
     'of other frames: --frames unknown'),
    (lambda q, seen, _: {'poses': Pose(
        np.random.default_rng(1).permutation(seen.position), seen.rotation)},
     'lengths and poses must be of the same instants')])
def test_possible_errors_are_named(change: Callable[..., dict[str, Any]], words: str) -> None:
    rng = np.random.default_rng(7)
    poses, angles = random_poses(rng, 40), rng.uniform(-0.3, 0.3, (40, 3))
    lengths, seen = measured(
        rng, true_values(rng), turned(poses, angles), Noise(2e-6, 1e-5, 1e-5))
    with pytest.raises(StewartError) as caught:
        calibrate(HEXAPOD, **{
            'lengths': lengths, 'poses': seen, **change(lengths, seen, angles)})
    assert words in str(caught.value) and 'nothing is calibrated' in str(caught.value)


@pytest.mark.parametrize('noise', [0.0, 1e-4])
def test_a_mirrored_frame_and_another_order_are_both_named_where_both_explain_the_poses(
        noise: float) -> None:
    """Mirrored in y this hexapod is the same, with its legs in the reverse order."""
    rng, mirror = np.random.default_rng(7), np.array([1.0, -1.0, 1.0])
    poses = random_poses(rng, 40)
    lengths = HEXAPOD.inverse_kinematics(poses) - HEXAPOD.parameters['geometry.zero_length']
    seen = Pose(mirror * poses.position + rng.normal(0.0, noise, (40, 3)),
                mirror[:, None] * poses.rotation * mirror)
    both = ('the poses are of a mirrored (left-handed) frame: y has the opposite sign; or the '
            'legs are in another order: leg_6, leg_5, leg_4, leg_3, leg_2, leg_1 ')
    for given in ((lengths, seen), (lengths[:, ::-1], poses)):
        with pytest.raises(StewartError) as caught:
            calibrate(HEXAPOD, *given)
        assert str(caught.value).startswith(both)


def test_exact_poses_of_the_drawing_have_no_lack_of_fit() -> None:
    rng = np.random.default_rng(8)
    poses = random_poses(rng, 40)
    lengths = HEXAPOD.inverse_kinematics(poses) - HEXAPOD.parameters['geometry.zero_length']
    assert calibrate(HEXAPOD, lengths, poses).lack_of_fit == ()


def test_all_poses_are_used_where_none_is_held_out_and_some_noise_is_needed(
        snapshot: Snapshot) -> None:
    rng = np.random.default_rng(9)
    lengths, seen = measured(rng, true_values(rng), random_poses(rng, 30), Noise(1e-5, 1e-5, 1e-5))
    assert calibrate(HEXAPOD, lengths, seen, hold_out=0.0).validation is None
    assert calibrate(HEXAPOD, lengths, seen).validation is not None
    with snapshot.raises(StewartError):
        calibrate(HEXAPOD, lengths, seen, noise=(0.0, 0.0, 0.0))


LEG_3 = np.eye(6)[2]


@pytest.mark.parametrize(('change', 'words'), [
    (lambda q, _: {'lengths': q + LEG_3 * np.random.default_rng(1).choice([1e-4, -1e-4], (60, 1))},
     'play, a loose joint or encoder: leg_3 (residuals of'),
    (lambda q, seen: {
        'lengths': q + HEXAPOD.inverse_dynamics(Motion.from_pose(seen)).forces / 4e6},
     'residuals follow the static forces of the legs, from deflection: all legs'),
    (lambda q, _: {'lengths': q + LEG_3 * np.linspace(0.0, 1e-4, 60)[:, None]},
     'residuals drift from the first pose to the last: leg_3'),
    (lambda q, _: {'lengths': q * (1.0 + 0.002 * LEG_3)},
     'positions off by scale, from the lead of the screw or the encoder: leg_3 (+0.2'),
    (lambda q, _: {'lengths': 1.01 * q, 'accept_mistakes': True},
     'positions off by scale, from the lead of the screw or the encoder: all legs alike (+0.99%)'),
    (lambda _, seen: {'poses': scaled(seen, 1.01), 'accept_mistakes': True},
     'positions of the device off by scale, from its calibration or its target: all legs alike '
     '(+0.99%)'),
    (lambda *_: {'fixed': ['zero_length']}, 'the fixed values are not those of the hexapod: '),
    (lambda *_: {'noise': Noise(1e-6, 5e-6, 5e-6)}, 'times the noise that was given')])
def test_a_lack_of_fit_is_named(change: Callable[..., dict[str, Any]], words: str) -> None:
    rng = np.random.default_rng(8)
    lengths, seen = measured(rng, true_values(rng), random_poses(rng, 60), Noise(2e-6, 1e-5, 1e-5))
    found = calibrate(HEXAPOD, **{'lengths': lengths, 'poses': seen, **change(lengths, seen)})
    assert words in found.lack_of_fit[0].text


@pytest.mark.parametrize('frames', few(['unknown', 'known'], 1))
@pytest.mark.parametrize('scale', [1.05, 0.99])
@pytest.mark.parametrize('of_device', [True, False])
def test_the_scale_of_the_device_is_not_blamed_on_the_legs(
        of_device: bool, scale: float, frames: str) -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        lengths, seen = measured(rng, true_values(rng), random_poses(rng, 40),
                                 Noise(2e-6, 1e-5, 1e-5))
        if frames == 'unknown':
            seen = Equations(LEGS, lengths, seen).as_measured(seen, FRAMES)
        if of_device:
            seen = Pose(scale * seen.position, seen.rotation)
        else:
            lengths = scale * lengths
        found = calibrate(HEXAPOD, lengths, seen, frames=frames, accept_mistakes=True)
        named = {each.what for each in (*found.likely, *found.lack_of_fit)}
        assert named - {'identifiable', 'worse', 'misfit'} == {'device' if of_device else 'scale'}
    # A difference that errors of the joints can explain as well is not attributed to either.
    found = calibrate(HEXAPOD, (1.0 if of_device else 1.0005) * lengths / (
        1.0 if of_device else scale), Pose(seen.position * (
            1.0005 / scale if of_device else 1.0), seen.rotation), frames=frames)
    assert found.lack_of_fit[0].what == 'scale_or_device'


def with_play(rng: np.random.Generator, count: int, play: float, side: str) -> tuple[
        np.ndarray, Pose, np.ndarray]:
    """Return lengths, poses and true values; leg 3 is off by +-play, on a side by the pose."""
    values, poses = true_values(rng), random_poses(rng, count)
    lengths, seen = measured(rng, values, poses, Noise(1e-5, 1e-5, 1e-5))
    given = {'force': HEXAPOD.inverse_dynamics(Motion.from_pose(poses)).forces[:, 2],
             'x': poses.position[:, 0], 'tilt': poses.rotation[:, 2, 1],
             'approach': np.diff(lengths[:, 2], prepend=lengths[0, 2] - 1.0),
             'nothing': rng.normal(size=count)}[side]
    lengths[:, 2] += np.where(given > (
        0.0 if side == 'approach' else np.median(given)), play, -play)
    return lengths, seen, values


@pytest.mark.parametrize(('side', 'words'), [
    ('force', 'the side changes with its static force'), ('x', 'the side changes with'),
    ('tilt', 'the side changes with'), ('approach', 'the side changes with its move to the pose'),
    ('nothing', 'not explained: leg_3, ')])
def test_play_on_a_side_by_the_pose_is_noticed_with_few_poses(side: str, words: str) -> None:
    """20 poses, +-50 um, noise of 10 um: most of such play looks like another geometry."""
    texts = []
    for seed in range(6):
        lengths, seen, values = with_play(np.random.default_rng(seed), 20, 5e-5, side)
        found = calibrate(HEXAPOD, lengths, seen, hold_out=0.0)
        texts += [found.lack_of_fit[0].text] if found.lack_of_fit else []
        assert not found.outliers
    assert len(texts) >= 4
    assert all('leg_3' in each for each in texts)
    assert sum(words in each for each in texts) >= 3


@pytest.mark.parametrize('side', ['force', 'x', 'approach'])
def test_large_play_is_no_outlier_and_no_lack_of_motion(side: str) -> None:
    lengths, seen, _ = with_play(np.random.default_rng(1), 20, 1e-3, side)
    found = calibrate(HEXAPOD, lengths, seen, accept_mistakes=True)
    assert not found.outliers
    assert found.lack_of_fit[0].text.startswith('play, a loose joint or encoder: leg_3 (+-')
    for each in found.likely:
        assert each.what in ('identifiable', 'worse') and found.lack_of_fit[0].text in each.text
    # Less than half of the poses are on the other side: the others are exact by comparison.
    lengths, seen = measured(np.random.default_rng(2), true_values(np.random.default_rng(2)),
                             random_poses(np.random.default_rng(3), 40), Noise(2e-6, 2e-6, 2e-6))
    lengths[::3, 2] += 1e-3
    found = calibrate(HEXAPOD, lengths, seen)
    assert not found.outliers and found.lack_of_fit[0].what == 'play'


@pytest.mark.slow
def test_noise_of_any_kind_is_no_lack_of_fit() -> None:
    """Normal, heavy tails, a uniform distribution; single poses, and each measured three times."""
    for seed in range(24):
        rng = np.random.default_rng(seed)
        values = true_values(rng)
        poses = random_poses(rng, (20, 40)[seed % 2])
        if seed % 6 > 3:
            poses = poses[np.repeat(np.arange(20), 3)]
        lengths, seen = measured(rng, values, poses)
        one, two = (1e-5 * (rng.normal(size=shape), rng.laplace(size=shape) / np.sqrt(2.0),
                            rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), shape))[seed % 3]
                    for shape in (lengths.shape, seen.position.shape))
        found = calibrate(HEXAPOD, lengths + one, Pose(seen.position + two, seen.rotation),
                          hold_out=0.0)
        assert not found.lack_of_fit


AXES = universal_axes(HEXAPOD.parameters)
UNIVERSAL = {'actuator.screw_lead': 0.01, 'drive.screw_rotation': 'universal',
             'drive.base_universal_axes': AXES[:, :3].ravel().tolist(),
             'drive.platform_universal_axes': AXES[:, 3:].ravel().tolist()}


def turned_positions(rng: np.random.Generator, poses: Pose, values: np.ndarray) -> np.ndarray:
    """Return the positions of drives by the angles of their motors."""
    real = StewartPlatform(with_geometry(
        TELESCOPIC.calibrated_legs(HEXAPOD.parameters.replaced(UNIVERSAL)), values))
    angles = real.motors(Motion.from_pose(poses)).angles
    return angles * 0.01 / (2.0 * np.pi)


def test_derivatives_of_drive_positions_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(1)
    p = HEXAPOD.parameters.replaced(UNIVERSAL)
    values = true_values(rng)
    values[LEGS.count:] = rng.normal(0.0, 0.1, 12)
    equations = Equations(LEGS, rng.normal(0.0, 1.0, (5, 6)), random_poses(rng, 5), FRAMES,
                          screw_constants(p))
    steps = 1e-6 * np.eye(len(values))
    lin = equations.at(values)
    assert_allclose(lin.derivatives, np.stack([
        (equations.at(values + step).residuals - equations.at(values - step).residuals) / 2e-6
        for step in steps], axis=-1), atol=2e-9)
    turn = 1e-7 * rng.normal(size=3)
    device = equations.frames_at(values).device.rotation
    other = equations._replace(pose=Pose(
        equations.pose.position, from_euler(device.T @ turn) @ equations.pose.rotation))
    assert_allclose(other.at(values).residuals - lin.residuals, lin.rotation @ turn, atol=1e-12)


@pytest.mark.parametrize('frames', few(['unknown', 'known'], 1))
def test_positions_of_drives_whose_screws_turn_with_their_legs(
        frames: str, snapshot: Snapshot) -> None:
    """By the motors' angles; taken for positions of the legs they are named."""
    rng = np.random.default_rng(2)
    platform = StewartPlatform(HEXAPOD.parameters.replaced(UNIVERSAL))
    values, poses = true_values(rng), random_poses(rng, 40)
    lengths, seen = measured(rng, values, poses)
    drives = turned_positions(rng, poses, values)
    assert np.abs(drives - lengths).max() > 1e-4
    if frames == 'unknown':
        seen = Equations(LEGS, lengths, seen).as_measured(seen, FRAMES)
    found = calibrate(platform, drives, seen, frames=frames, drive_positions=True)
    assert found.validation is not None
    if frames == 'known':
        assert found.lack_of_fit == () and np.abs(found.values - values[GEOMETRY]).max() < 1e-10
        assert found.validation.after.largest[0] < 1e-9
    else:  # the base frame, with the axes in it, is that of the file's joints
        assert found.after.max() < 1e-7 and found.validation.after.largest[0] < 1e-6
    for given, taken in ((drives, False), (lengths, True)):
        wrong = calibrate(platform, given + rng.normal(0.0, 1e-5, (40, 6)), seen, frames=frames,
                          drive_positions=taken)
        assert [each.what for each in wrong.lack_of_fit] == ['turns']
    # A file that does not say that the screws turn.
    assert calibrate(HEXAPOD, drives, seen, frames=frames).lack_of_fit[0].what == 'turns'
    with snapshot.raises(ParameterError):
        calibrate(HEXAPOD, drives, seen, drive_positions=True)


def test_too_little_is_rejected(snapshot: Snapshot) -> None:
    rng = np.random.default_rng(9)
    lengths, seen = measured(rng, true_values(rng), random_poses(rng, 40), Noise(2e-6, 1e-5, 1e-5))
    with snapshot.raises(StewartError):
        calibrate(HEXAPOD, lengths[:7], seen[:7])
    with snapshot.raises(MotionError):
        calibrate(HEXAPOD, lengths, seen[:7])
    with snapshot.raises(ParameterError):
        calibrate(HEXAPOD, lengths, seen, fixed=['joint_7'])
    with snapshot.raises(ParameterError):
        calibrate(HEXAPOD, lengths, seen,
                  fixed=['base_joints', 'platform_joints', 'geometry.zero_length'])
    with pytest.raises(StewartError, match='residuals of .* mm: one and the same pose'):
        same = np.zeros(40, dtype=int)
        calibrate(HEXAPOD, lengths[same] + rng.normal(0.0, 1e-6, (40, 6)), Pose(
            seen.position[same] + rng.normal(0.0, 1e-5, (40, 3)), seen.rotation[same]))
    # Noise that is larger than the errors of the geometry.
    rough = measured(rng, true_values(rng, 1e-6), random_poses(rng, 16), Noise(0.0, 1e-4, 1e-4))
    with pytest.raises(StewartError, match='the poses do not support a better geometry'):
        calibrate(HEXAPOD, *rough)
    for tilt in ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5)):
        with snapshot.raises(StewartError):
            calibrate(HEXAPOD, *measured(rng, true_values(rng), random_poses(rng, 40, tilt=tilt)),
                      frames='unknown')
    assert calibrate(HEXAPOD, lengths, seen, noise=(0.0, 1e-5, 0.0)).noise.drive == 0.0


def test_fixed_parts_keep_the_values_of_the_file() -> None:
    rng = np.random.default_rng(10)
    values = true_values(rng)
    values[36:42] = 0.95
    lengths, seen = measured(rng, values, random_poses(rng, 40), Noise(2e-6, 1e-5, 1e-5))
    free = calibrate(HEXAPOD, lengths, seen)
    found = calibrate(HEXAPOD, lengths, seen, fixed=['zero_length'])
    assert found.states[36:] == ('fixed',) * 6
    assert (found.parameters['geometry.zero_length'] == 0.95).all()
    assert (found.errors[:36] <= free.errors[:36] * 1.05).all()
    assert found.errors[2] < 0.5 * free.errors[2]
