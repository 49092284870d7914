# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration of hexapods with cranks, from poses that the package has not computed.

Errors and coverage of 200 seeds a stage: benchmarks/calibration_cranks.py.
"""

from __future__ import annotations

from collections.abc import Callable
import json
import math
from pathlib import Path

from crank_machines import random_machine
from crank_platforms import parameters_of
from measured_cranks import ANGLE_NOISE, Built, POSITION_NOISE
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from programs import call
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import (
    calibrate, Calibration, Motion, ParameterError, Parameters, Pose, StewartError,
    StewartPlatform)
from stewart_dynamics.arrays import Array
from stewart_dynamics.calibration import main
from stewart_dynamics.calibration.assembly_errors import assembly_errors
from stewart_dynamics.calibration.equations import (
    Equations, FRAMES, Frames, GEOMETRY, held_by_groups, inverse, values_of, with_geometry)
from stewart_dynamics.calibration.geometry_fit import fit, Unknowns
from stewart_dynamics.calibration.measured_poses import poses_csv, read_poses
from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.calibration.pose_design import design_poses
from stewart_dynamics.calibration.recorded_poses import read_bag
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.mechanics.frames.rotation import from_euler
from test_calibrate_command import write_bag

PROGRAM = 'stewart_calibrate'
FILE = ROOT / 'config' / 'crank_platform.yaml'
RIG = Parameters.from_yaml(FILE)
LEGS = RIG.leg_kind.calibrated_legs(RIG)
ALL = 'zero', 'lengths', 'axes', 'joints'
NOISE = Noise(ANGLE_NOISE, POSITION_NOISE * 0.184, POSITION_NOISE * 0.46)
DEVICE = Frames(Pose([1.0, 2.0, 0.3], from_euler([0.3, 0.2, 2.0])),
                Pose([0.1, 0.2, 0.3], from_euler([0.5, -0.2, 1.0])))


def seeded(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def machine(seed: int) -> Parameters:
    """Return the rig, or a random hexapod whose home is that of its reference."""
    return RIG if seed == 0 else parameters_of(random_machine(seeded(seed)))


def poses_near(parameters: Parameters, rng: np.random.Generator, count: int) -> tuple[
        Array, Pose]:
    """Return angles and poses of a machine, near the pose that its angles have at their middle."""
    built = Built(parameters)
    low, high = parameters.limits.angle_min, parameters.limits.angle_max
    assert low is not None and high is not None
    if parameters is not RIG:
        home = random_home(parameters)
        built.platform.home_pose = lambda: home  # type: ignore[method-assign]
    return built.commands(rng, count)


def random_home(parameters: Parameters) -> Pose:
    """Return the home pose of a random machine."""
    for seed in range(1, 5):
        reference = random_machine(seeded(seed))
        if np.array_equal(reference.center, parameters.geometry.base_joints):
            return Pose(reference.home, np.eye(3))
    raise AssertionError('not a machine of these tests')


@pytest.mark.parametrize('seed', range(4))
def test_derivatives_are_those_of_finite_differences(seed: int) -> None:
    p, rng = machine(seed), seeded(seed)
    legs = p.leg_kind.calibrated_legs(p)
    angles, poses = poses_near(p, rng, 5)
    values = values_of(legs)
    meters = np.array([*(unit == 'm' for unit in legs.units_of()), *[False] * FRAMES])
    size = float(np.mean(p['legs.crank.length']))
    values += rng.normal(0.0, 0.05, len(values)) * np.where(meters, size, 1.0)
    equations = Equations(legs, angles + rng.normal(0.0, 0.05, (5, 6)), poses)
    lin = equations.at(values)
    assert_allclose(lin.derivatives, np.stack([
        (equations.at(values + step).residuals - equations.at(values - step).residuals) / 2e-6
        for step in 1e-6 * np.eye(len(values))], axis=-1), atol=3e-9)
    ahead, behind = (equations._replace(positions=equations.positions + step).at(
        values).residuals for step in (1e-6, -1e-6))
    assert_allclose(lin.drives, (ahead - behind) / 2e-6, atol=3e-9)


@pytest.mark.parametrize('seed', range(4))
def test_all_numbers_are_identifiable(seed: int) -> None:
    """Singular values of 11 numbers of a leg, by its crank: from 15 to 0.04 with 60 poses."""
    p = machine(seed)
    legs = p.leg_kind.calibrated_legs(p)
    lin = Equations(legs, *poses_near(p, seeded(10), 60)).at(values_of(legs))
    size = float(np.mean(p['legs.crank.length']))
    scales = np.array([size if unit == 'm' else 1.0 for unit in legs.units_of()])
    rows = lin.derivatives[..., GEOMETRY] * scales / size
    for leg in range(6):
        found = np.linalg.svd(rows[:, leg, legs.columns(leg)], compute_uv=False)
        assert 12.0 < found[0] < 18.0 and 0.03 < found[-1] < 0.2
    assert np.linalg.matrix_rank(rows.reshape(360, 66)) == 66


def test_all_numbers_are_found_without_noise() -> None:
    built = Built(RIG).deviate(seeded(1), ALL)
    found = calibrate(built.platform, *built.measure(seeded(2), 40, 0.0))
    assert set(found.states) == {'identified'} and not found.lack_of_fit
    assert np.abs(found.start - built.values()).max() > 0.04
    assert_allclose(found.values, built.values(), atol=1e-9)
    assert found.validation is not None
    assert found.validation.before.rms[0] > 5e-3 > 1e-9 > found.validation.after.largest[0]
    # The parameters say the same as the numbers: their forward kinematics is that of the poses.
    angles, poses = built.measure(seeded(3), 5, 0.0)
    assert_allclose(StewartPlatform(found.parameters).forward_kinematics(angles, poses).rows,
                    poses.rows, atol=1e-7)


@pytest.mark.parametrize(('stage', 'zero', 'length'), [
    (('zero',), 0.09, 0.0), pytest.param(('zero', 'lengths'), 0.5, 0.004, marks=pytest.mark.slow),
    pytest.param(ALL, 1.2, 0.006, marks=pytest.mark.slow)])
def test_errors_and_intervals_of_a_stage(
        stage: tuple[str, ...], zero: float, length: float) -> None:
    """0.2 degrees and 0.3 % of a crank; errors [deg], and of L1 by a crank, not to be exceeded."""
    held = held_by_groups(LEGS, stage)
    unknowns = Unknowns.of(
        LEGS, values_of(LEGS), RIG.singularity.characteristic_length, held, False)
    inside, off = [], []
    for seed in range(12):
        built = Built(RIG).deviate(seeded(seed), stage)
        found = fit(Equations(LEGS, *built.measure(seeded(100 + seed), 60)), unknowns)
        errors = np.sqrt(np.diag(found.covariance) + (
            found.identifiability.shares * unknowns.scales) ** 2)[GEOMETRY]
        off.append(found.values[GEOMETRY] - built.values())
        inside.append((np.abs(off[-1]) < TWO_SIDED * errors)[~held])
    assert 0.90 < np.mean(inside) < 0.985
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.degrees(rms[LEGS.zero]).max() < zero
    assert rms[LEGS.parts['legs.crank.length']].max() <= length * 0.184
    assert not rms[held].any()


def tooth(angles: dict[int, float], spread: float = 0.25) -> Built:
    """Return the rig with zeros off by half a degree or so, and some cranks by more [deg]."""
    built = Built(RIG).deviate(seeded(5), ('zero',))
    built.turns *= spread
    for leg, angle in angles.items():
        built.turns[leg] += math.radians(angle)
    return built


@pytest.mark.parametrize(('angle', 'teeth', 'way'), [
    (14.4, 25, 'far'), (-15.0, 24, 'far back'), (360 / 23, 23, 'far'), (-360 / 21, 21, 'far back'),
    (28.8, 25, 'far')])
def test_a_crank_on_another_tooth_is_named(angle: float, teeth: int, way: str) -> None:
    built = tooth({1: angle}, 0.0)
    found = calibrate(built.platform, *built.measure(seeded(6), 60), unknowns=['zero'])
    (error,) = found.assembly
    number = 'one tooth' if abs(angle) < 20.0 else 'two teeth'
    assert error.text.startswith(
        f'the crank of leg_2 sits {number} ({abs(angle):.4g} deg of {teeth}) too {way}: its zero '
        'is ')
    assert 'times as likely by that as by an error like those of the others' in error.text
    assert_allclose(found.values, built.values(), atol=math.radians(0.25))


def test_teeth_that_the_zeros_of_the_others_cannot_tell_apart_are_named_together() -> None:
    built = tooth({1: 14.4})
    measured = built.measure(seeded(6), 60)
    (error,) = calibrate(built.platform, *measured, unknowns=['zero']).assembly
    assert '(14.4 deg of 25 or 15 deg of 24' in error.text
    built = tooth({2: 15.0, 4: -14.4}, 0.0)
    found = calibrate(built.platform, *built.measure(seeded(6), 60), unknowns=['zero'])
    assert [each.text.split(' too far')[0] for each in found.assembly] == [
        'the crank of leg_3 sits one tooth (15 deg of 24)',
        'the crank of leg_5 sits one tooth (14.4 deg of 25)']
    # Zeros that scatter as horns do, by up to half a tooth, are no other tooth of one of them.
    for seed in range(20):
        values = LEGS.values()
        values[LEGS.zero] = seeded(seed).uniform(-7.2, 7.2, 6) * math.pi / 180.0
        assert not assembly_errors(
            LEGS, values, np.full(66, 0.001), np.zeros(66, dtype=bool))


def test_a_step_is_so_much_likelier_by_the_density_of_students_distribution() -> None:
    from scipy.stats import t

    zeros = np.radians([0.4, 14.9, -0.3, 0.5, -0.6, 0.2])
    values = LEGS.values()
    values[LEGS.zero] += zeros
    (found,) = assembly_errors(LEGS, values, np.zeros(66), np.zeros(66, dtype=bool))
    scale = 1.4826 * math.radians(0.4)
    ratio = np.exp(np.subtract(*t.logpdf(
        (zeros[1] - np.radians([15.0, 0.0])) / scale, 3.0)))
    assert f'{ratio:.0e} times as likely'.replace('e+0', 'e') in found.text


def with_signs(*legs: int) -> Callable[[Array, Pose], tuple[Array, Pose]]:
    signs = np.where(np.isin(np.arange(6), legs), -1.0, 1.0)
    return lambda angles, poses: (signs * angles, poses)


@pytest.mark.parametrize(('change', 'words'), [
    (with_signs(1), 'leg_2 turns the other way: angles of the opposite sign (misfit '),
    (with_signs(1, 3, 5), 'leg_2, leg_4 and leg_6 turn the other way: angles of the opposite'),
    (with_signs(*range(6)), 'angles of the legs have the opposite sign'),
    (lambda q, poses: (q[:, [0, 4, 2, 3, 1, 5]], poses), 'leg_2 and leg_5 are swapped'),
    (lambda q, poses: (q[:, [1, 2, 3, 4, 5, 0]], poses), 'the legs are in another order: leg_6'),
    (lambda q, poses: (q[:, [0, 4, 2, 3, 1, 5]] * [1, -1, 1, 1, 1, 1], poses),
     'leg_2 and leg_5 are swapped, and leg_5 turns the other way'),
    (lambda q, poses: (np.degrees(q), poses), 'angles of the legs are in degrees, not in rad: '
     '--degrees reads them so'),
    (lambda q, poses: (1.1 * q, poses), 'angles of the legs are 1.1 times as large as they are '
     'by the device: travel of the servo by its pulses, gear or encoder'),
    (lambda q, poses: (q, Pose(1e3 * poses.position, poses.rotation)),
     'positions are in mm, not in m: --mm-positions reads them so'),
    (lambda q, poses: (q, inverse(poses)), 'the inverse is needed'),
    (lambda q, poses: (q, Equations(LEGS, q, poses).as_measured(poses, DEVICE)),
     'of other frames: --frames unknown')])
def test_possible_errors_are_named(
        change: Callable[[Array, Pose], tuple[Array, Pose]], words: str) -> None:
    built = tooth({3: 14.4})  # a crank on another tooth does not hide another error
    with pytest.raises(StewartError) as caught:
        calibrate(built.platform, *change(*built.measure(seeded(6), 60)), unknowns=['zero'])
    assert words in str(caught.value) and 'nothing is calibrated' in str(caught.value)
    assert 'more than 1e9 times as likely' in str(caught.value)


def test_a_crank_that_is_half_a_turn_off_is_to_be_mounted_again() -> None:
    built = tooth({2: 180.0})
    with pytest.raises(StewartError, match=r'leg_3 sits half a turn \(180 deg\) too far'):
        calibrate(built.platform, *built.measure(seeded(6), 60), unknowns=['zero'])


def test_torques_that_turn_the_servos_are_named() -> None:
    built = tooth({})
    angles, poses = built.measure(seeded(6), 60)
    torques = built.platform.inverse_dynamics(Motion.from_pose(poses)).torques
    found = calibrate(built.platform, angles + 2e-4 * torques, poses, unknowns=['zero'])
    assert found.lack_of_fit[0].text == (
        'residuals follow the static torques of the motors, from deflection: all legs')
    assert not calibrate(built.platform, angles, poses, unknowns=['zero']).lack_of_fit


def test_one_pose_gives_the_zeros() -> None:
    """A jig, or all horns level: with the file's geometry exact, and within noise otherwise."""
    built = tooth({1: 14.4})
    angles, poses = built.measure(seeded(6), 1, 0.0)
    found = calibrate(built.platform, angles, poses, unknowns=['zero'])
    assert_allclose(found.values, built.values(), atol=1e-9)
    assert np.isinf(found.errors[LEGS.zero]).all() and not found.errors[:36].any()
    assert found.assembly[0].text.startswith('the crank of leg_2 sits one tooth')
    inside = []
    for seed in range(30):
        measured = built.measure(seeded(seed), 1)
        found = calibrate(built.platform, *measured, unknowns=['zero'], noise=NOISE)
        inside.append(np.abs(found.values - built.values())[LEGS.zero] < (
            TWO_SIDED * found.errors[LEGS.zero]))
    assert 0.88 < np.mean(inside) < 0.99
    two = calibrate(built.platform, *built.measure(seeded(6), 3), unknowns=['zero'])
    assert np.isfinite(two.errors).all()


def test_units_of_angles_of_one_pose_are_named() -> None:
    """One pose has as many residuals as zeros: any unit leaves none of them."""
    angles, poses = tooth({1: 14.4}).measure(seeded(6), 1, 0.0)
    platform = StewartPlatform(RIG)
    for wrong, words in (
            (np.degrees(angles), 'angles of the legs are in degrees, not in rad: --degrees reads '
             'them so (zeros are then '),
            (1500.0 + 300.0 * angles, 'turns: likely degrees, pulses or increments')):
        with pytest.raises(StewartError) as caught:
            calibrate(platform, wrong, poses, unknowns=['zero'])
        assert words in str(caught.value)


def test_equal_poses_and_angles_of_any_scale_have_no_other_unit() -> None:
    built = tooth({1: 14.4})
    angles, poses = built.measure(seeded(6), 1, 0.0)
    ten = np.zeros(10, dtype=int)
    found = calibrate(built.platform, angles[ten], poses[ten], unknowns=['zero'])
    assert_allclose(found.values, built.values(), atol=1e-9)
    angles, poses = built.measure(seeded(6), 60)
    with pytest.raises(StewartError) as caught:
        calibrate(built.platform, 1500.0 + 640.0 * angles, poses, unknowns=['zero'])
    assert '; or ' not in str(caught.value)


def test_zeros_by_which_no_pose_has_the_angles_are_calibrated() -> None:
    built = Built(RIG).deviate(seeded(5), ('zero', 'lengths'))
    angles, poses = built.measure(seeded(6), 60)
    found = calibrate(built.platform, angles + np.pi, poses, unknowns=['zero', 'lengths'])
    assert found.validation is not None and not found.validation.before.known
    assert found.validation.after.rms[0] < 2e-3
    assert found.after.max() < 2e-3


def test_too_few_poses_and_wrong_names_are_rejected(snapshot: Snapshot) -> None:
    built = Built(RIG)
    angles, poses = built.measure(seeded(6), 12)
    with snapshot.raises(StewartError):
        calibrate(built.platform, angles[:11], poses[:11])
    with snapshot.raises(StewartError):
        calibrate(built.platform, angles[:3], poses[:3], unknowns=['zero', 'lengths'])
    with snapshot.raises(ParameterError):
        calibrate(built.platform, angles, poses, unknowns=['teeth'])
    with snapshot.raises(ParameterError):
        calibrate(built.platform, angles, poses, fixed=['zero_length'])
    with snapshot.raises(ParameterError):
        calibrate(built.platform, angles, poses, drive_positions=True)


@pytest.mark.parametrize('stage', [('zero',), ('zero', 'lengths'), ALL])
def test_frames_of_a_device_are_found(stage: tuple[str, ...]) -> None:
    built = tooth({1: 14.4}, 0.0) if stage == ('zero',) else Built(RIG).deviate(
        seeded(5), stage)
    angles, poses = built.measure(seeded(6), 60, 0.0)
    seen = Equations(LEGS, angles, poses).as_measured(poses, DEVICE)
    found = calibrate(built.platform, angles, seen, frames='unknown', unknowns=stage)
    assert set(found.states) - {'fixed'} == {'identified'} and found.frames is not None
    assert found.after.max() < 1e-9
    if 'joints' not in stage:  # those of the file define the frames
        assert_allclose(found.values, built.values(), atol=1e-8)
        for each, wanted in zip(found.frames, DEVICE, strict=True):
            assert_allclose(each.rows, wanted.rows, atol=1e-8)


SERVO = {'servo.angle_at_min': [-1.5, 1.4, -1.45, 1.5, -1.4, 1.5],
         'servo.angle_at_max': [1.5, -1.4, 1.5, -1.5, 1.45, -1.4]}


@pytest.mark.parametrize('servo', [False, True])
@pytest.mark.parametrize('stage', [('zero',), ALL])
def test_the_file_moves_the_hexapod_to_the_wanted_poses(
        servo: bool, stage: tuple[str, ...], tmp_path: Path) -> None:
    """By angles, or by the pulses of its servos, whose measured points have the zeros then."""
    p = RIG.replaced(SERVO) if servo else RIG
    built = Built(p).deviate(seeded(5), stage)
    found = calibrate(built.platform, *built.measure(seeded(6), 40, 0.0), unknowns=stage)
    found.parameters.to_yaml(tmp_path / 'calibrated.yaml')
    calibrated = StewartPlatform.from_yaml(tmp_path / 'calibrated.yaml')
    _, wanted = built.commands(seeded(9), 6, 0.4, 0.2)

    def off(platform: StewartPlatform) -> float:
        angles = platform.inverse_kinematics(wanted)
        if servo:  # pulses of the file, and the angles that the recording has for them
            pulses = platform.servo_pulses(angles)
            low, high = (p[name] for name in SERVO)
            angles = low + (pulses - 0.0005) / 0.002 * (high - low)
        reached = [built.pose(each, wanted[n]) for n, each in enumerate(angles)]
        return max(float(np.linalg.norm(each.position - wanted.position[n]))
                   for n, each in enumerate(reached))

    assert off(built.platform) > 5e-3
    assert off(calibrated) < 1e-7
    if servo:
        turned = calibrated.parameters['servo.angle_at_min'] - p['servo.angle_at_min']
        assert_allclose(turned, built.turns, atol=1e-8)
    if servo and stage == ('zero',):
        assert_array_equal(calibrated.parameters['geometry.crank_angles'],
                           RIG['geometry.crank_angles'])
        assert not calibrated.check()
    assert calibrated.parameters['geometry.crank_branch'] == ('positive',) * 6


def test_designed_poses_are_within_the_limits_and_identify_better() -> None:
    for stage in (('zero', 'lengths'), ('all',)):
        found = design_poses(StewartPlatform(RIG), 24, NOISE, 1, stage)
        free = found.half_widths > 0.0
        assert np.count_nonzero(free) == (18 if stage != ('all',) else 66)
        assert (found.half_widths < found.random_half_widths)[free].mean() > 0.95
        low, high = RIG.limits.angle_min, RIG.limits.angle_max
        assert low is not None and high is not None
        assert (found.positions > low).all() and (found.positions < high).all()
        result = StewartPlatform(RIG).inverse_dynamics(Motion.from_pose(found.poses))
        assert (np.abs(result.levers) > 0.1 * RIG['legs.crank.length']).all()
        assert_allclose(result.angles, found.positions, atol=1e-12)
        # The prediction is that of a fit to such poses.
        unknowns = Unknowns.of(LEGS, values_of(LEGS), RIG.singularity.characteristic_length,
                               held_by_groups(LEGS, stage), False)
        fitted = fit(Equations(LEGS, found.positions, found.poses), unknowns, NOISE)
        errors = TWO_SIDED * np.sqrt(np.diag(fitted.covariance))[GEOMETRY]
        assert_allclose(errors[free], found.half_widths[free], rtol=1e-3)


def test_poses_that_are_designed_for_zeros_are_not_worse_than_random_ones() -> None:
    """The noise of a pose, which all legs share, decides how well zeros are known."""
    rig = StewartPlatform.from_yaml(
        ROOT / 'stewart_dynamics' / 'legs' / 'examples' / 'cranks.yaml')
    design = design_poses(rig, 5, groups=('zero',))
    zeros = design.legs.zero
    assert design.half_widths[zeros].max() < 1.1 * design.random_half_widths[zeros].max()


@pytest.fixture(scope='module')
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 40 poses with noise; leg_2 sits on another tooth."""
    path = tmp_path_factory.mktemp('poses') / 'poses.csv'
    path.write_text(poses_csv(RIG.joints, *tooth({1: 14.4}).measure(seeded(6), 40)))
    return path


def test_files_page_and_text(table: Path, tmp_path: Path) -> None:
    output = tmp_path / 'out'
    arguments = [str(table), '--params', str(FILE), '--output', str(output)]
    shown = call(main, *arguments, '--unknowns', 'zero', '--strict').out
    assert shown.startswith('the crank of leg_2 sits one tooth (14.4 deg of 25')
    assert shown.count('geometry.crank_directions.leg_') == 6 and 'fixed' not in shown
    result = json.loads((output / 'calibration.json').read_text())
    assert [each['what'] for each in result['assembly']] == ['step']
    assert result['options']['unknowns'] == ['zero'] and result['unknowns'] == 6
    assert result['noise']['angle_rad'] == pytest.approx(ANGLE_NOISE, rel=0.25)
    names = {each['name']: each for each in result['parameters']}
    assert len(names) == 66
    assert names['legs.rod.length.leg_6']['state'] == 'fixed'
    zero = names['geometry.crank_directions.leg_2.about_axis']
    assert zero['unit'] == 'rad'
    assert zero['interval'][0] < tooth({1: 14.4}).turns[1] < zero['interval'][1]
    page = (output / 'report.html').read_text()
    assert page.count('<svg') == 1 and 'one tooth' in page and 'nan' not in page
    assert 'zeros [mrad]' in page and 'length of a rod by geometry' in page
    text = (output / 'calibrated.yaml').read_text()
    assert 'crank_directions: [  # calibrated' in text and '95 %: within +-' in text
    call(main, *arguments, '--force')
    page = (output / 'report.html').read_text()
    assert page.count('<svg') == 5 and 'axes of motors [mrad]' in page


def test_angles_in_degrees_are_read(table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    given = read_poses(table, RIG)
    first, *rows = poses_csv(
        RIG.joints, np.degrees(given.positions), given.poses).splitlines()
    plain, headed = tmp_path / 'plain.csv', tmp_path / 'headed.csv'
    plain.write_text('\n'.join([first, *rows]))
    headed.write_text('\n'.join([','.join(
        f'{name} [deg]' if name in RIG.joints else name for name in first.split(',')), *rows]))
    for found in (read_poses(plain, RIG, degrees=True), read_poses(headed, RIG)):
        assert_allclose(found.positions, given.positions, atol=1e-15)
    arguments = ['--params', str(FILE), '--unknowns', 'zero', '--output', str(tmp_path / 'out')]
    error = call(main, plain, *arguments, code=2).err
    assert 'are in degrees, not in rad: --degrees reads them so' in error
    snapshot(call(main, plain, *arguments, '--mm-legs', code=2).err.replace(str(ROOT), ''))
    call(main, plain, *arguments, '--degrees')


def test_one_row_is_calibrated_by_the_program(table: Path, tmp_path: Path) -> None:
    one = tmp_path / 'one.csv'
    one.write_text('\n'.join(table.read_text().splitlines()[:2]))
    arguments = [str(one), '--params', str(FILE), '--unknowns', 'zero']
    out = call(main, *arguments, '--output', tmp_path / 'a', '--strict').out
    assert 'no intervals: as many residuals as unknowns' in out
    result = json.loads((tmp_path / 'a' / 'calibration.json').read_text())
    assert result['noise'] is None
    assert all(each['interval'] is None for each in result['parameters'])
    assert 'nan' not in (tmp_path / 'a' / 'report.html').read_text()
    noise = ['--noise', *map(str, NOISE)]
    out = call(main, *arguments, *noise, '--output', tmp_path / 'b').out
    assert 'noise as given: angles 3.5 mrad' in out


def test_designed_poses_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shown = call(main, '--design', '6', '--unknowns', 'zero,lengths', '--params', FILE).out
    assert 'legs.crank.length' in shown and 'base_joints' not in shown
    found = read_poses(tmp_path / 'designed' / 'poses.csv', RIG)
    assert_allclose(StewartPlatform(RIG).inverse_kinematics(found.poses), found.positions,
                    atol=1e-12)
    rows = np.genfromtxt(tmp_path / 'designed' / 'trajectory.csv', delimiter=',', names=True)
    columns = np.stack([rows[name] for name in rows.dtype.names], axis=-1)
    at_rest = columns[(columns[:, 8:] == 0.0).all(axis=1), 1:4]
    for position in found.poses.position:
        assert np.abs(at_rest - position).max(axis=1).min() < 1e-12


def test_poses_at_rest_of_a_bag(tmp_path: Path) -> None:
    angles, poses = tooth({}).measure(seeded(6), 12)
    found, missing = read_bag(
        write_bag(tmp_path / 'bag', seeded(1), angles, poses, '/joint_states',
                  joints=RIG.joints), RIG, '/stewart_dynamics', None, None)
    assert not missing and len(found.poses) == 12
    assert_allclose(found.positions, angles, atol=1e-6)


def test_groups_of_unknowns_of_telescopic_legs_are_the_parts_that_are_not_fixed() -> None:
    from test_calibration import HEXAPOD, measured, random_poses, true_values

    rng = seeded(1)
    lengths, seen = measured(rng, true_values(rng, 1e-4), random_poses(rng, 20), Noise(
        1e-5, 1e-5, 1e-5))
    found: list[Calibration] = [
        calibrate(HEXAPOD, lengths, seen, accept_mistakes=True, **options) for options in (
            {'unknowns': ['zero']}, {'fixed': ['base_joints', 'platform_joints']})]
    assert_array_equal(found[0].values, found[1].values)
    assert found[0].states == found[1].states and not found[0].assembly
    with pytest.raises(ParameterError, match='lengths: must be one of zero, joints, all'):
        calibrate(HEXAPOD, lengths, seen, unknowns=['lengths'])


def test_parameters_of_other_numbers_have_their_kinematics() -> None:
    built = Built(RIG).deviate(seeded(7), ALL)
    angles, poses = built.measure(seeded(8), 6, 0.0)
    real = StewartPlatform(with_geometry(LEGS, built.values()))
    assert_allclose(real.inverse_kinematics(poses), angles, atol=1e-9)
