# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Designed motions: within the limits, reproducible, with smaller intervals than sine sweeps."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

from independent_hexapod import moving
import numpy as np
from programs import call
import pytest
from referees import rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import ParameterError, Parameters, StewartPlatform
from stewart_dynamics.estimation.confidence_level import TWO_SIDED
from stewart_dynamics.identification.identification_options import (
    DesignOptions, IdentificationOptions)
from stewart_dynamics.identification.identify import Identification
from stewart_dynamics.identification.identify_command_line import main
from stewart_dynamics.identification.motion_design import (
    Design, design, fine_times, noise_of, predicted_half_widths)
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from sweeps import sweep

PROGRAM = 'stewart_identify'

PLATFORM = ROOT / 'config' / 'platform.yaml'
HEXAPOD = Parameters.from_yaml(PLATFORM)
SMALL = DesignOptions(harmonics=3, duration=12.0, generations=20, kinds=('platform',))
# All but platform and friction is known: intervals are those of noise alone.
WELL_KNOWN = HEXAPOD.replaced({f'uncertainty.{name}': 0.0 for name in (
    'leg_mass', 'reflected_mass', 'effort_gain', 'tilt')})
LIMITS = ('limits.length_min', 'limits.length_max', 'limits.velocity_max', 'limits.force_max')


@pytest.fixture(scope='module')
def small() -> Design:
    """Return a motion designed with few generations."""
    return design(HEXAPOD, SMALL)


def at_1_khz(trajectory: ReferenceMotionParameters) -> Any:
    """Return the motion at times of 1 kHz."""
    return motion_at(trajectory, np.arange(0.0, trajectory['motion.duration'] + 5e-4, 1e-3))


def test_it_is_within_the_limits_less_their_margins(small: Design) -> None:
    platform = StewartPlatform(HEXAPOD)
    result = platform.inverse_dynamics(at_1_khz(small.trajectory))
    p = HEXAPOD
    stroke = p['limits.length_max'] - p['limits.length_min']
    assert np.all(result.lengths > p['limits.length_min'] + 0.01 * stroke)
    assert np.all(result.lengths < p['limits.length_max'] - 0.01 * stroke)
    assert np.all(np.abs(result.rates) < 0.901 * p['limits.velocity_max'])
    assert np.all(np.abs(result.forces) < 0.801 * p['limits.force_max'])
    assert np.all(result.condition_number < 0.501 * p['singularity.warn_condition'])
    # The motion uses the limits fully.
    assert 0.99 < max(small.use.values()) <= 1.0
    assert np.abs(result.rates).max() > 0.89 * p['limits.velocity_max'].max()


def test_it_begins_and_ends_at_rest_at_home(small: Design) -> None:
    ends = motion_at(small.trajectory, [0.0, 12.0])
    assert np.all(ends.rows[:, 12:] == 0.0)
    home = StewartPlatform(HEXAPOD).home_pose()
    np.testing.assert_allclose(ends.position, [home.position] * 2, rtol=0.0, atol=1e-6)


def test_equal_seeds_give_equal_motions(small: Design) -> None:
    again = design(HEXAPOD, SMALL)
    assert again.trajectory == small.trajectory
    assert again.half_widths.tolist() == small.half_widths.tolist()
    other = design(HEXAPOD, SMALL._replace(seed=1, generations=2))
    assert other.trajectory != small.trajectory


def test_generations_make_the_intervals_smaller() -> None:
    first, more = (design(WELL_KNOWN, SMALL._replace(generations=each)) for each in (1, 20))
    scales = more.unknowns.deviations[more.unknowns.asked]
    assert np.sum((more.half_widths / scales) ** 2) < 0.8 * np.sum(
        (first.half_widths / scales) ** 2)


def test_its_intervals_are_three_times_narrower_than_those_of_sine_sweeps() -> None:
    """
    Compare inertia and all platform parameters; the mass is identifiable in any motion.

    Where legs and load cells are hardly known, their uncertainty is most of all intervals.
    """
    platform, options = StewartPlatform(WELL_KNOWN), DesignOptions(
        kinds=('platform',), generations=60, harmonics=6)
    designed = design(WELL_KNOWN, options)
    scales = designed.unknowns.deviations[designed.unknowns.asked]
    for together in (False, True):
        swept = predicted_half_widths(platform, designed.unknowns, sweep(
            platform, options, together), options.duration, options)
        of_both = [np.sqrt(np.mean((each / scales) ** 2))
                   for each in (swept, designed.half_widths)]
        assert of_both[0] > 3.0 * of_both[1]
        ratios = (swept / designed.half_widths)[4:]
        assert np.sqrt(np.mean(ratios ** 2)) > 3.0


@pytest.mark.parametrize('hexapod', [
    HEXAPOD, HEXAPOD.replaced({'uncertainty.effort_gain': 0.3}),
    HEXAPOD.replaced({'uncertainty.leg_mass': 0.2, 'uncertainty.tilt': 0.02}), WELL_KNOWN],
    ids=['default', 'gain', 'legs and tilt', 'noise alone'])
def test_the_predicted_intervals_are_those_that_an_identification_states(
        small: Design, hexapod: Parameters) -> None:
    rate = SMALL.rate
    times = np.arange(round(12.0 * rate)) / rate
    legs = moving(hexapod, motion_at(small.trajectory, times))
    efforts = legs.forces + noise_of(SMALL, hexapod) * rng(1).normal(size=legs.forces.shape)
    with closing(Identification(hexapod, IdentificationOptions(hold_out=0.0))) as work:
        work.add(Path('a bag'), [Window(
            0, 1.0 / rate, legs.lengths - hexapod['geometry.zero_length'], legs.rates, efforts,
            np.zeros(efforts.shape, dtype=bool))])
        found = work.result()
        stated = TWO_SIDED * found.fit.deviations[found.unknowns.asked]
    predicted = predicted_half_widths(
        StewartPlatform(hexapod), found.unknowns,
        motion_at(small.trajectory, fine_times(SMALL)), 12.0, SMALL)
    # The spectrum of the noise is estimated from one recording of 12 s.
    assert predicted / stated == pytest.approx(1.0, abs=0.2)
    assert np.mean(predicted / stated) == pytest.approx(1.0, abs=0.05)


def test_no_motion_identifies_the_mass_better_than_the_gain_is_known() -> None:
    mass = HEXAPOD['platform.mass']
    designed = design(HEXAPOD, SMALL._replace(generations=1))
    # its weight, and that of the legs, which are known to 5 %, are the forces divided by the gain
    assert 0.85 < designed.half_widths[0] / (
        TWO_SIDED * HEXAPOD['uncertainty.effort_gain'] * mass) < 1.6


def test_missing_limits_are_named_and_an_amplitude_takes_their_place(snapshot: Snapshot) -> None:
    without = HEXAPOD.replaced(dict.fromkeys(LIMITS[1:]))
    with snapshot.raises(ParameterError):
        design(without, SMALL)
    designed = design(without, SMALL._replace(
        amplitude=0.02, generations=2, center=(0.0, 0.0, 1.1, 0.0, 0.0, 0.1)))
    motion = at_1_khz(designed.trajectory)
    moved = np.linalg.norm(motion.position - motion.position[0], axis=1)
    assert moved.max() <= 0.02
    relative = motion.rotation[0].T @ motion.rotation
    turned = np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    assert designed.trajectory['motion.initial'].tolist() == [0.0, 0.0, 1.1, 0.0, 0.0, 0.1]
    assert turned.max() <= 1.001 * 0.02 / without['singularity.characteristic_length']
    assert max(moved.max(), turned.max() * 0.6) > 0.019


def test_angles_of_joints_are_limits_as_well() -> None:
    narrow = HEXAPOD.replaced({'limits.base_joint_angle_max': 0.05,
                               'limits.platform_joint_angle_max': 0.1})
    designed = design(narrow, SMALL._replace(generations=2))
    base, platform = StewartPlatform(narrow).joint_angles(at_1_khz(designed.trajectory))
    assert base.max() <= 0.0451 and platform.max() <= 0.0901
    assert base.max() > 0.04 or platform.max() > 0.08


def test_a_center_beyond_a_limit_is_named(snapshot: Snapshot) -> None:
    weak = HEXAPOD.replaced({'limits.force_max': 300.0})
    with snapshot.raises(ParameterError):
        design(weak, SMALL)
    with snapshot.raises(ParameterError):
        design(HEXAPOD, SMALL._replace(center=(0.0, 0.0, 2.0, 0.0, 0.0, 0.0)))


def test_a_center_in_degrees_or_millimetres_is_a_possible_error(
        tmp_path: Path, snapshot: Snapshot) -> None:
    snapshot(call(main, *QUICK, '--output', tmp_path / 'out', '--center', 0, 0, 990, 5, 0, 0,
                  code=2).err)


QUICK = ('--design', '--params', PLATFORM, '--generations', 3, '--harmonics', 2, '--duration', 8,
         '--identify', 'platform,friction')


def test_the_file_is_for_stewart_trajectory(tmp_path: Path) -> None:
    folder = tmp_path / 'designed'
    _, out, err = call(main, *QUICK, '--output', folder)
    assert err.startswith('stewart_identify: designing a motion of 8 s in 3 generations')
    trajectory = ReferenceMotionParameters.from_yaml(folder / 'trajectory.yaml')
    assert (trajectory['motion.type'], trajectory['motion.duration']) == ('fourier', 8.0)
    lines = out.splitlines()
    assert lines[0] == ('predicted 95 % intervals: 8 s, white noise of 5 N in efforts at 500 Hz')
    assert lines[1].split()[:2] == ['platform.mass', '+-']
    assert lines[12].split()[0] == 'actuator.coulomb_friction'
    assert lines[-1].startswith('motion: stewart_trajectory --ros-args --params-file ')
    assert str(folder / 'trajectory.yaml') in lines[-1]
    head = (folder / 'trajectory.yaml').read_text(encoding='utf-8')
    assert head.startswith('# Designed to identify platform, friction, seed 0.')
    # Existing files are not replaced without --force.
    _, out, err = call(main, *QUICK, '--output', folder, code=2)
    assert str(folder) in err and not out
    call(main, *QUICK, '--output', folder, '--force')


def test_a_motion_may_be_designed_for_the_tilt_as_well(tmp_path: Path) -> None:
    out = call(main, *QUICK[:-1], 'platform,friction,tilt', '--output', tmp_path / 'designed').out
    half_widths = {words[0]: (float(words[2]), words[3]) for words in (
        line.split() for line in out.splitlines()[1:15])}
    for axis in 'xy':
        half, unit = half_widths[f'gravity.tilt_{axis}']
        assert unit == 'rad' and 1e-6 < half < 0.5 * TWO_SIDED * HEXAPOD['uncertainty.tilt']


@pytest.mark.parametrize('arguments', [
    (*QUICK, '--highest-frequency', 20), (*QUICK[:-1], 'cylinder,piston'),
    ('--design', '--params', 'missing.yaml')])
def test_a_failed_design_is_reported_in_one_line(
        tmp_path: Path, arguments: Any, snapshot: Snapshot) -> None:
    _, out, err = call(main, *arguments, '--output', tmp_path / 'designed', code=2)
    assert out == ''
    *progress, line = err.splitlines()
    assert all(each.startswith('stewart_identify: design') for each in progress)
    snapshot(line)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('arguments', [
    ('--params', 'x', '--design', 'a_bag'), ('--params', 'x'),
    ('--params', 'x', '--design', '--duration', '0'),
    ('--params', 'x', '--design', '--harmonics', '2.5')])
def test_arguments_that_do_not_fit_are_named(arguments: Any, snapshot: Snapshot) -> None:
    snapshot(call(main, *arguments, code=2).err)
