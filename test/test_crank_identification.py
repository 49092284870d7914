# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Identification of hexapods with cranks: from bags, of bodies by Newton and Euler, errors."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
import json
from pathlib import Path
import re
from typing import Any

from cases import few
from crank_machines import random_machine
from crank_newton_euler import CrankHexapod, inverse_dynamics, machine_of, State
from crank_platforms import parameters_of, six
from estimate_cases import (
    CASES, CRANKS, drawn, identified as judged, moving_cranks, Outcome, payload,
    recorded as recorded_of, rich, SENSORS, Sines, Truth)
from legs_of_all_kinds import random_hexapod
import numpy as np
from programs import call
import pytest
from recorded import Noise, Recorded, write_bag
from referees import Array, relative, rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, StewartPlatform
from stewart_dynamics.identification.identification_options import (
    DesignOptions, IdentificationOptions)
from stewart_dynamics.identification.identification_results import document
from stewart_dynamics.identification.identify import Identification, Identified
from stewart_dynamics.identification.identify_command_line import main
from stewart_dynamics.identification.motion_design import DesignLimits
from stewart_dynamics.identification.unknowns import leg_values, Unknowns
from stewart_dynamics.identification.windows import Window
from stewart_dynamics.legs import CRANK
from stewart_dynamics.mechanics.dynamics.linear_parameters import (
    linear_parameters, parameter_values, Places, PLATFORM)
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

PROGRAM = 'stewart_identify'
FILE = ROOT / 'config' / 'crank_platform.yaml'
ALL = 'platform', 'friction', 'reflected_inertia', 'crank'
RATE, SECONDS = 100.0, 20.0
# Masses of legs and rotors are rough guesses.
GUESSED = {'uncertainty.leg_mass': 0.2, 'uncertainty.reflected_mass': 0.4}
GIVEN = CRANKS.replaced(GUESSED)
TRUE = Truth(GIVEN.replaced({
    'platform.mass': 185.0, 'platform.center_of_mass': [0.07, 0.01, 0.38],
    'platform.inertia': [24.0, 0.5, -0.8, 28.0, 0.4, 21.0],
    'actuator.reflected_inertia': [0.42, 0.39, 0.45, 0.40, 0.43, 0.41],
    'legs.crank.mass': 3.0, 'actuator.viscous_friction': 4.5,
    'actuator.coulomb_friction': [4.0, 5.0, 7.0, 8.0, 9.0, 3.0]}))
DRIVES = {'drive.gear_ratio': 95.0, 'drive.torque_constant': 0.12}


def moved(seed: int = 3, sensors: Noise = SENSORS) -> Recorded:
    """Return a recording of the true hexapod in a motion of all coordinates."""
    return recorded_of(TRUE, 'rich', seed, sensors, SECONDS, RATE)


@pytest.fixture(scope='module')
def recording() -> Recorded:
    """Return that recording."""
    return moved()


def window_of(given: Recorded) -> Window:
    return Window(0, 1.0 / RATE, given.positions, given.rates, given.efforts,
                  np.zeros(given.efforts.shape, dtype=bool))


def found_in(given: Recorded, p: Parameters, *kinds: str) -> Identified:
    """Return the identification from a recording."""
    options = IdentificationOptions(kinds=kinds, hold_out=0.0)
    with closing(Identification(p, options)) as work:
        work.add(Path('a bag'), [window_of(given)])
        return work.result()


@pytest.fixture
def run(recording: Recorded, tmp_path: Path) -> Callable[..., Any]:
    """Return a function that identifies from a bag: code, identification.json, output, errors."""
    def identify(*options: str, p: Parameters = GIVEN,
                 change: Callable[[Recorded], Recorded] = lambda given: given,
                 ) -> tuple[object, Any, str, str]:
        write_bag(tmp_path / 'bag', change(recording), p.joints)
        p.to_yaml(tmp_path / 'rig.yaml')
        code, out, err = call(main, tmp_path / 'bag', '--params', tmp_path / 'rig.yaml',
                              '--output', tmp_path / 'found', *options, code=None)
        path = tmp_path / 'found' / 'identification.json'
        return code, json.loads(path.read_text()) if path.exists() else None, out, err

    return identify


def test_a_bag_shows_rotors_cranks_and_friction(run: Callable[..., Any], tmp_path: Path) -> None:
    code, result, out, err = run('--identify', ','.join(ALL))
    assert (code, err) == (0, '')
    assert result['lack_of_fit'] is None
    truth, files = TRUE.values(), Truth(GIVEN).values()
    misses = {}
    for each in (*result['parameters'], *result['base_parameters']):
        misses[each['name']] = abs(each['value'] - truth[each['name']]) / each['standard_error']
    assert max(misses.values()) < 4.0, max(misses, key=lambda name: misses[name])
    by_name = {each['name']: each for each in (*result['parameters'], *result['base_parameters'])}
    for name in ('legs.crank.shaft_inertia', 'legs.crank.shaft_moment.e',
                 'actuator.reflected_inertia', 'actuator.coulomb_friction', 'platform.mass'):
        for leg in () if name.startswith('platform') else GIVEN.joints:
            each = by_name[f'{name}.{leg}']
            assert each['state'] == 'identified', each
            assert each['file'] == pytest.approx(files[each['name']], rel=1e-12)
    # The rotors, which are wrong by a third, are known to a few per cent.
    inertia = by_name['legs.crank.shaft_inertia.leg_1']
    low, high = inertia['interval']
    assert low < truth[inertia['name']] < high and not low < inertia['file'] < high
    assert high - low < 0.1 * inertia['value']

    bag, = result['bags']
    assert bag['delay_s'] == pytest.approx(3e-3, abs=3e-4)
    assert bag['noise_of_angles_rad'] == pytest.approx(
        SENSORS.length / CASES['crank'].reach, rel=0.1)
    assert 'noise_of_speeds_rad_s' in bag and 'noise_of_lengths_m' not in bag
    held = result['validation']
    assert held['after_rms_n_m'] < 0.05 * held['before_rms_n_m']
    assert re.search(r'residual RMS [\d.]+ N m by the file, [\d.]+ N m by the identified', out)
    assert 'base parameters of the legs' in out and 'legs.crank.shaft_moment.e.leg_6 ' in out

    # The file is one of this hexapod, for all programs, and gives its torques.
    written = tmp_path / 'found' / 'identified.yaml'
    found = Parameters.from_yaml(written)
    assert StewartPlatform(found).check() == ()
    changed = {name for name in GIVEN if not np.array_equal(found[name], GIVEN[name])}
    assert changed == {
        'platform.mass', 'platform.center_of_mass', 'platform.inertia', 'legs.crank.inertia',
        'legs.crank.center_of_mass', 'actuator.reflected_inertia', 'actuator.viscous_friction',
        'actuator.coulomb_friction'}
    motion = CASES['crank'].placed(rich(rng(99)))(np.arange(0.0, 10.0, 0.05))
    torques, by_file, by_found = (
        moving_cranks(p, motion).forces for p in (TRUE.parameters, GIVEN, found))
    assert relative(by_file, torques) > 0.05
    assert relative(by_found, torques) < 0.01
    # A comment above: behind the values it would be too long.
    above, _ = written.read_text().split('      reflected_inertia:')
    comment = ' '.join(line.strip('# ') for line in above.splitlines()[-3:])
    assert 'kg m^2; identified ' in comment and ', 95 %: +-0.0' in comment
    page = (tmp_path / 'found' / 'report.html').read_text()
    assert '<h2>Leg torques</h2>' in page and 'Base parameters of the legs' in page
    assert '"unit":"N m"' in page and '[N]' not in page.partition('<script')[0]


def on_rig() -> tuple[CrankHexapod, Sines]:
    """Return the published rig with all centers of mass off the lines, and a motion of it."""
    file = json.loads(Path(__file__).with_name('data').joinpath('simulator_rig.json').read_text())
    rig = machine_of(file['parameters'], file['angle_range'])
    rig = replace(rig, cc=rig.cc + [0.004, 0.012, -0.01], visc=np.full(6, 2.0),
                  coul=np.full(6, 4.0), slow=np.full(6, 0.02))
    return rig, CASES['crank'].placed(rich(rng(5)))._replace(center=np.r_[rig.home, 0.0, 0.0, 0.0])


def by_newton_euler(machine: CrankHexapod, motion: Motion) -> tuple[Array, Array, Array]:
    """Return angles, rates and torques (N, 6) of 13 free bodies in a motion (N,)."""
    answers = [inverse_dynamics(machine, State(
        row[:3], row[3:12].reshape(3, 3), row[12:15], row[15:18], row[18:21], row[21:24],
        np.zeros(6))) for row in motion.rows]
    angles, rates, torques = (np.array([getattr(each, name) for each in answers])
                              for name in ('angles', 'rates', 'torques'))
    return angles, rates, torques


@pytest.mark.slow
def test_identified_numbers_give_the_torques_of_free_bodies() -> None:
    """The motion is not the recorded one; the file has other cranks, rotors and rods."""
    machine, path = on_rig()
    angles, rates, torques = by_newton_euler(machine, path(np.arange(1200) / RATE))
    p = parameters_of(replace(machine, mc=1.3 * machine.mc, mr=0.9 * machine.mr,
                              J=0.7 * machine.J, m=0.8 * machine.m, cc=rig_line(machine)), **{
        'uncertainty.leg_mass': 0.3, 'uncertainty.reflected_mass': 0.5, 'limits.angle_min': -1.0,
        'limits.angle_max': 1.0})
    found = found_in(Recorded(np.arange(1200) / RATE, angles, rates, torques), p, *ALL, 'rod')
    assert not found.likely
    _, _, fresh = by_newton_euler(machine, other := path(np.arange(12.3, 16.0, 0.1)))
    by_file, by_found = (StewartPlatform(each).inverse_dynamics(other).torques
                         for each in (p, found.parameters))
    assert relative(by_file, fresh) > 0.05
    assert relative(by_found, fresh) < 2e-3


def rig_line(machine: CrankHexapod) -> Array:
    """Return centers of mass on the lines of the cranks."""
    on_line: Array = machine.cc * [1.0, 0.0, 0.0]
    return on_line


@pytest.mark.slow
def test_four_sums_of_the_masses_of_a_leg_act_on_a_base_at_rest() -> None:
    p, motion = random_hexapod('crank', 4, 400)
    platform, places = StewartPlatform(p), Places.of(CRANK)
    matrix = platform.regressors(motion.rows).reshape(-1, places.whole)
    of_masses = matrix[:, places.masses].reshape(len(matrix), -1, 6)
    acts = [each.acts for each in CRANK.masses]
    assert np.abs(of_masses[:, np.logical_not(acts)]).max() < 1e-14 * np.abs(of_masses).max()
    inertial = np.hstack([matrix[:, PLATFORM], of_masses[:, acts].reshape(len(matrix), -1),
                          matrix[:, places.reflected_mass]])
    values = np.linalg.svd(inertial / np.linalg.norm(inertial, axis=0), compute_uv=False)
    assert np.count_nonzero(values > 1e-10 * values[0]) == 10 + 4 * 6

    # Rotors, cranks and rods with the same sums, and the rods' ends moved to the platform.
    random, torques = rng(4), platform.inverse_dynamics(motion).torques
    theta, size = linear_parameters(p), p['legs.crank.length']
    masses = theta[places.masses].reshape(-1, 6)
    end, turning, carried = random.uniform(-0.3, 0.3, (3, 6)) * masses[[9, 8, 11]]
    masses[9] += end
    masses[0] -= end * size
    masses[8] += turning - end * size ** 2
    theta[places.reflected_mass] -= turning
    masses[11] += carried
    points = p['geometry.platform_joints']
    theta[0] -= carried.sum()
    theta[1:4] -= carried @ points
    square = np.sum(points ** 2, axis=1)[:, None, None] * np.eye(3) - np.einsum(
        'ij,ik->ijk', points, points)
    theta[4:10] -= np.tensordot(carried, square, 1)[np.triu_indices(3)]
    theta[places.masses] = masses.ravel()
    again = platform.regressors(motion.rows) @ theta
    assert relative(again, torques) < 1e-12
    # Without those of the rods' ends these are ``base_parameters``.
    names = [each.name for each in CRANK.masses] + ['actuator.reflected_inertia']
    for each in CRANK.base_parameters(p):
        before, after = (sum(each.terms.get(name, 0.0) * row for name, row in zip(
            names, [*of[places.masses].reshape(-1, 6), of[places.reflected_mass]], strict=True))
            for of in (linear_parameters(p), theta))
        np.testing.assert_allclose(after, before, atol=1e-12 * np.abs(before).max() + 1e-300)


@pytest.mark.parametrize('seed', range(4))
def test_the_first_estimate_is_the_file(seed: int) -> None:
    p = parameters_of(random_machine(rng(seed), float(seed)))
    u = Unknowns(p, ('platform', 'friction', 'crank', 'rod', 'reflected_inertia'))
    assert u.parameters(u.start) == p


def test_what_does_not_act_follows_the_other_moments() -> None:
    """A body with them exists: heavier, if its center of mass is far from the axis."""
    u = Unknowns(GIVEN, ('crank',))
    first = u.names.index('legs.crank.first_moment.e.leg_3')
    values = u.start.copy()
    values[first] *= 2.5
    found = u.parameters(values)
    masses, centers = found['legs.crank.mass'], found['legs.crank.center_of_mass']
    assert np.flatnonzero(masses > GIVEN['legs.crank.mass']).tolist() == [2]
    np.testing.assert_allclose(masses * centers[:, 0], values[first - 2:first + 4], rtol=1e-12)
    again = Unknowns(found, ('crank',))
    np.testing.assert_allclose(again.start, values, rtol=1e-9, atol=1e-12)


def test_no_body_has_these_moments(snapshot: Snapshot) -> None:
    p, places = GIVEN, Places.of(CRANK)
    for row, value in ((8, -0.01), (9, -1.0), (10, 2.0)):
        theta = linear_parameters(p)
        theta[places.masses].reshape(-1, 6)[row, 4] = value
        with snapshot.raises(ParameterError):
            parameter_values(theta, p)


@pytest.mark.parametrize('option', few(['--motor-torque', '--motor-current'], 1))
def test_torques_and_currents_of_motors_show_the_same(
        run: Callable[..., Any], option: str) -> None:
    p = GIVEN.replaced(DRIVES)
    per_torque = 1.0 / 95.0 / (0.12 if option == '--motor-current' else 1.0)
    code, result, _, err = run(
        option, '--no-report', '--identify', ','.join(ALL), p=p,
        change=lambda given: given._replace(efforts=per_torque * given.efforts))
    assert (code, err) == (0, '')
    mass, *_ = result['parameters']
    low, high = mass['interval']
    assert low < 185.0 < high and high - low < 0.1 * 185.0


@pytest.mark.slow
def test_a_plate_is_identified() -> None:
    """The inertia of a disc without thickness is on the bound of possible inertias."""
    disc = {'platform.inertia': [24.0, 0.0, 0.0, 24.0, 0.0, 48.0]}
    truth = Truth(GIVEN.replaced({**disc, 'platform.mass': 185.0}))
    for seed in (1, 2):
        found = found_in(recorded_of(truth, 'rich', seed, SENSORS, SECONDS, RATE),
                         GIVEN.replaced(disc), 'mass', 'inertia')
        assert found.parameters['platform.mass'] == pytest.approx(185.0, rel=0.05)


def test_currents_need_the_torque_constant(run: Callable[..., Any], snapshot: Snapshot) -> None:
    code, _, _, err = run('--motor-current')
    assert code == 2
    snapshot(err)


def swapped(given: Recorded) -> Recorded:
    assert given.rates is not None
    order = [0, 2, 1, 3, 4, 5]
    return given._replace(positions=given.positions[:, order], rates=given.rates[:, order],
                          efforts=given.efforts[:, order])


@pytest.mark.parametrize(('change', 'named'), [
    pytest.param(lambda given: given._replace(efforts=-given.efforts),
                 r'opposite sign: \+ must drive the angle up', marks=pytest.mark.slow),
    (lambda given: given._replace(efforts=1e2 / 9.80665 * given.efforts),
     'likely kgf cm in place of N m'),
    (lambda given: given._replace(positions=np.degrees(given.positions)),
     r'the measured angles belong to no pose of this hexapod: they are -\d+\.?\d* to '
     r'\d+\.?\d* rad, and limits.angle_min and angle_max are -1.0472 and 1.0472 rad: likely the '
     'zero of the angles is wrong, or positions are in another unit'),
    pytest.param(swapped, 'positions and efforts of leg_2 and leg_3 look swapped',
                 marks=pytest.mark.slow),
    pytest.param(
        lambda given: given._replace(positions=given.positions - 0.03),
        'the zero of the angles looks wrong: another zero of the angles, (\\+1\\.\\d+ ){6}deg',
        marks=pytest.mark.slow),
], ids=['sign', 'kgf cm', 'degrees', 'swapped', 'zero'])
def test_possible_errors_are_named_and_nothing_is_written(
        run: Callable[..., Any], tmp_path: Path, change: Callable[[Recorded], Recorded],
        named: str) -> None:
    code, result, out, err = run('--no-report', change=change)
    assert (code, result, out) == (2, None, '')
    assert re.search(named, err), err
    assert err.startswith('stewart_identify: ') and err.count('\n') == 1
    assert not (tmp_path / 'found').exists()


@pytest.mark.slow
def test_a_horn_on_the_next_tooth_is_the_cause_of_the_lack_of_fit() -> None:
    """14.4 degrees with 25 teeth, found from torques though no pose was measured."""
    given = recorded_of(Truth(CRANKS), 'rich', 5, SENSORS, 12.0, RATE)
    turned = np.radians(14.4) * (np.arange(6) == 3)
    found = found_in(given._replace(positions=given.positions + turned), CRANKS, 'platform',
                     'friction')
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.cause == 'angle_zero'
    one, = {each.text for each in found.lack_of_fit.ranked if each.columns == 1
            and each.what == 'angle_zero' and 'leg_4' in each.text}
    degrees = re.fullmatch(r'another zero of the angles of leg_4, (-[\d.]+) deg', one)
    assert degrees is not None and float(degrees[1]) == pytest.approx(-14.4, abs=1.0)


@pytest.mark.slow
def test_rotors_far_from_the_file_are_the_cause_of_the_lack_of_fit() -> None:
    p = CRANKS.replaced({'uncertainty.reflected_mass': 0.02, 'uncertainty.effort_gain': 0.001})
    found = found_in(moved(6), p.replaced({
        f'legs.{name}': TRUE.parameters[f'legs.{name}'] for name in ('crank.mass', 'rod.mass')}),
        'platform', 'friction')
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.cause == 'reflected_mass'
    assert re.match(r'another actuator.reflected_inertia, (\+0\.\d+ ){6}kg m\^2',
                    found.lack_of_fit.text)


@pytest.mark.slow
def test_a_parameter_that_a_lack_of_fit_hides_is_no_combination_by_itself() -> None:
    """With the file's 10 % for rotors that are 40 % heavier, the widened intervals say nothing."""
    kinds = 'friction', 'reflected_inertia'
    found = found_in(moved(6), CRANKS, *kinds)
    result = document(found, IdentificationOptions(kinds=kinds))
    assert result.lack_of_fit is not None
    states = {each.name: each.state for each in result.parameters}
    assert {states[f'actuator.reflected_inertia.leg_{leg}'] for leg in range(1, 7)} == {
        'not_identifiable'}
    errors = {each.name: each.standard_error for each in result.parameters}
    for each in result.combinations:
        assert len(each.parameters) > 1
        assert each.standard_error <= sum(abs(c) * errors[name] for c, name in zip(
            each.coefficients, each.parameters, strict=True)) * (1.0 + 1e-9)


@pytest.mark.parametrize('seed', few(range(3), 1))
def test_intervals_contain_hexapods_that_are_drawn(seed: int) -> None:
    """See benchmarks/interval_coverage.py --legs crank for 200 of them."""
    found: Outcome = judged([recorded_of(drawn(seed, CRANKS), 'rich', seed, rate=RATE)],
                            drawn(seed, CRANKS), rate=RATE, hold_out=0.0, kinds=ALL)
    assert np.mean([each.holds for each in found.intervals]) > 0.8
    assert max(each.miss for each in found.intervals) < 3.0


@pytest.mark.parametrize('motion', ['rich', 'heave'])
def test_a_payload_is_within_its_intervals(motion: str) -> None:
    for seed in range(3):
        truth = drawn(seed, CRANKS)
        found = payload(truth, motion, seed)
        assert found.of('platform.mass').miss < 1.5
        assert not found.causes
        if motion == 'rich':
            assert all(each.identified for each in found.judged)
            assert max(each.miss for each in found.judged) < 2.0


def test_parts_of_other_legs_are_not_identified(snapshot: Snapshot) -> None:
    telescopic = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    for p, kind in ((GIVEN, 'cylinder'), (telescopic, 'reflected_inertia')):
        with snapshot.raises(ParameterError):
            Unknowns(p, ('platform', kind))
    assert set(leg_values(CRANK)) == {
        'crank', 'rod', 'reflected_inertia', 'viscous_friction', 'coulomb_friction', 'friction',
        'offset'}


QUICK = ('--design', '--generations', '3', '--harmonics', '3', '--duration', '8')


def test_a_motion_is_designed_within_the_limits(tmp_path: Path) -> None:
    folder = tmp_path / 'designed'
    lines = call(main, *QUICK, '--params', FILE, '--output', folder, '--identify',
                 'platform,friction,reflected_inertia').out.splitlines()
    assert lines[0] == ('predicted 95 % intervals: 8 s, white noise of 0.482 N m in efforts at '
                        '500 Hz')
    half, unit = next(line.split()[2:4] for line in lines if 'reflected_inertia' in line)
    assert unit == 'kg' and 0.0 < float(half) < 0.5 * 1.96 * 0.1 * 0.3
    assert re.search(r'use of the range .* of limits\.', lines[-3])
    trajectory = ReferenceMotionParameters.from_yaml(folder / 'trajectory.yaml')
    result = StewartPlatform(CRANKS).inverse_dynamics(
        motion_at(trajectory, np.arange(0.0, 8.0, 1e-3)))
    limits = CRANKS.limits
    assert np.all(np.abs(result.angles) < 0.96 * limits.angle_max)
    assert np.all(np.abs(result.speeds) < 0.901 * limits.speed_max)
    assert np.all(np.abs(result.torques) < 0.801 * limits.torque_max)
    assert np.all(np.abs(result.joint_forces) < 0.801 * limits.rod_force_max)
    assert np.all(np.abs(result.levers) > 0.199 * CRANKS['legs.crank.length'])


def test_a_motion_out_of_reach_uses_more_than_its_range() -> None:
    platform = StewartPlatform(CRANKS)
    limits = DesignLimits(platform)
    rows = np.tile(Motion(platform.home_pose().position, np.eye(3)).rows, (2, 3, 1))
    rows[1, 1, 2] += 0.5
    excess = limits.excess(rows)
    assert excess[0] < 1e-3 and excess[1] == 10.0


def test_a_design_needs_the_limits_of_cranks(tmp_path: Path, snapshot: Snapshot) -> None:
    CRANKS.replaced({'limits.torque_max': None, 'limits.angle_min': None}).to_yaml(
        tmp_path / 'rig.yaml')
    snapshot(call(main, *QUICK, '--params', tmp_path / 'rig.yaml', '--output',
                  tmp_path / 'designed', code=2).err.splitlines()[-1])
    assert DesignOptions().noise is None


def test_six_numbers_of_a_tensor_are_those_of_the_file() -> None:
    """The tensor about the center of mass keeps what torques on a base at rest do not show."""
    tensors = [six(np.diag([0.01, 0.012, 0.0108]) + 1e-4) for _ in range(6)]
    p = GIVEN.replaced({'legs.crank.inertia': tensors,
                        'legs.crank.center_of_mass': [0.06, 0.01, -0.02] * 6})
    u = Unknowns(p, ('crank',))
    values = u.start.copy()
    values[u.asked] *= 1.02
    found = u.parameters(values)
    np.testing.assert_allclose(found['legs.crank.inertia'][:, :5], p['legs.crank.inertia'][:, :5],
                               rtol=1e-9)
    np.testing.assert_allclose(found['legs.crank.center_of_mass'][:, 2], -0.02, rtol=1e-12)
    np.testing.assert_allclose(found['legs.crank.center_of_mass'][:, 0], 1.02 * 0.06, rtol=1e-9)
