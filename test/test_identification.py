# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Identification from bags, forces by another engine: values, intervals, identifiability."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import re
import shutil
from typing import Any, TYPE_CHECKING

from cases import few
import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from recorded import about, at_rest, fourier, MotionAt, Noise, Recorded, recorded, write_bag
from referees import rng, ROOT, rotation_about

from snapshot import Snapshot
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.identification.identify_command_line import main
from stewart_dynamics.identification.unknowns import Unknowns
from stewart_dynamics.mechanics.drives.motors import motor_ratio

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PROGRAM = 'stewart_identify'
Array = NDArray[np.float64]

FILE = ROOT / 'config' / 'platform.yaml'
GIVEN = Parameters.from_yaml(FILE)
TRUE = GIVEN.replaced({
    'platform.mass': 180.0, 'platform.center_of_mass': [0.03, -0.02, 0.15],
    'platform.inertia': [14.0, 0.5, -0.3, 16.0, 0.4, 24.0],
    'actuator.viscous_friction': 400.0, 'actuator.coulomb_friction': 50.0})
# The true hexapod on a base that is not level.
TILTED = TRUE.replaced({'gravity': rotation_about(
    np.array([np.cos(0.7), np.sin(0.7), 0.0]), np.radians(1.5)) @ GIVEN['gravity']})
VALUES = {Unknowns(TRUE).names[n]: Unknowns(TRUE).start[n] for n in Unknowns(TRUE).asked}
RATE = 100.0
SECONDS = 20.0
# Noise at 100 samples per second, each the mean of ten at 1 kHz.
NOISE = Noise(length=3e-6, rate=3e-4, effort=1.6, coloured=2.0, delay=3e-3)
Change = Callable[[Recorded], Recorded]


@pytest.fixture(scope='module')
def motions() -> dict[str, Recorded]:
    """Return recordings of the true hexapod."""
    given: dict[str, tuple[Parameters, MotionAt, float]] = {
        'fourier': (TRUE, fourier(3), SECONDS), 'rest': (TRUE, at_rest, 6.0),
        'diagonal': (TRUE, about([1.0, 1.0, 0.0]), 10.0),
        'tilted': (TILTED, fourier(3), SECONDS), 'tilted at rest': (TILTED, at_rest, 6.0)}
    return {name: recorded(p, motion, seconds, RATE, 1, NOISE)
            for name, (p, motion, seconds) in given.items()}


@pytest.fixture
def identified(motions: dict[str, Recorded], tmp_path: Path) -> Callable[..., Any]:
    """Return a function that identifies from a recording; it returns code, document, output."""
    def run(name: str, *options: str, change: Change = lambda given: given,
            params: Path = FILE) -> tuple[object, Any, str, str]:
        bag = tmp_path / 'a bag'
        if not bag.exists():
            write_bag(bag, change(motions[name]), GIVEN['joints'])
        code, out, err = call(main, bag, '--params', params, '--output', tmp_path / 'found',
                              *options, code=None)
        path = tmp_path / 'found' / 'identification.json'
        return code, json.loads(path.read_text()) if path.exists() else None, out, err

    return run


def values_of(result: Any, key: str = 'value') -> dict[str, Any]:
    """Return an entry of each parameter by parameter name."""
    return {each['name']: each[key] for each in result['parameters']}


def test_the_true_hexapod_is_found_within_its_intervals(
        identified: Callable[..., Any], tmp_path: Path) -> None:
    code, result, out, err = identified('fourier')
    assert (code, err) == (0, '')
    assert 'platform.mass ' in out
    assert set(values_of(result, 'state').values()) == {'identified'}
    values, errors, off = values_of(result), values_of(result, 'standard_error'), []
    assert list(values) == list(VALUES)
    for name, true in VALUES.items():
        value = values[name]
        off.append((value - true) / errors[name])
        kind = name.rpartition('.')[0]
        allowed = {'platform': 0.002 * 180.0, 'platform.center_of_mass': 1e-3,
                   'platform.inertia': 0.02 * 24.0, 'actuator.viscous_friction': 12.0,
                   'actuator.coulomb_friction': 1.5}[kind]
        assert value == pytest.approx(true, abs=allowed), name
    assert np.max(np.abs(off)) < 4.0
    (bag,) = result['bags']
    assert bag['delay_s'] == pytest.approx(3e-3, abs=2e-4)
    assert bag['noise_of_lengths_m'] == pytest.approx(3e-6, rel=0.1)
    held = result['validation']
    assert held['after_rms_n'] < 0.05 * held['before_rms_n']

    written = tmp_path / 'found' / 'identified.yaml'
    found = Parameters.from_yaml(written)
    assert found['platform.mass'] == pytest.approx(
        values_of(result, 'written')['platform.mass'], abs=0.01 * errors['platform.mass'])
    for name in GIVEN:
        if name not in ('platform.mass', 'platform.center_of_mass', 'platform.inertia',
                        'actuator.viscous_friction', 'actuator.coulomb_friction'):
            assert np.array_equal(found[name], GIVEN[name]), name
    assert f'identified {result["date"][:10]}, 95 %: +-' in written.read_text()
    assert StewartPlatform.from_yaml(written).check() == ()
    report = (tmp_path / 'found' / 'report.html').read_text()
    assert '22 of 22 parameters identified' in report


def test_the_report_draws_the_leg_with_the_largest_residual(
        identified: Callable[..., Any], tmp_path: Path, browser: Browser) -> None:
    _, result, _, _ = identified('fourier')
    page, errors = browser.new_page(), list[str]()
    page.on('pageerror', lambda error: errors.append(str(error)))
    page.goto((tmp_path / 'found' / 'report.html').as_uri())
    page.wait_for_selector('#rates .scatterlayer .trace')
    legs = result['residuals']['legs']
    worst = max(legs, key=lambda leg: legs[leg]['after_rms_n'])
    assert page.locator('#legs [aria-pressed=true]').inner_text() == worst
    assert page.locator('#rates .scatterlayer .trace').count() == 2
    residuals = page.evaluate("document.getElementById('rates').data[1].y")
    assert np.sqrt(np.nanmean(np.square(residuals))) == pytest.approx(
        legs[worst]['after_rms_n'], rel=0.2)
    assert not errors
    page.close()


@pytest.mark.slow
def test_brakes_at_the_start_do_not_widen_the_intervals(identified: Callable[..., Any],
                                                        tmp_path: Path) -> None:
    def with_brakes(given: Recorded) -> Recorded:
        assert given.rates is not None
        count = round(3.0 * RATE)
        noise = rng(7).normal(size=(2, count, 6))
        return Recorded(
            np.concatenate([given.times[:count], given.times + 4.0]),
            np.concatenate([given.positions[0] + NOISE.length * noise[0], given.positions]),
            np.concatenate([NOISE.rate * noise[1], given.rates]),
            np.concatenate([np.tile(3 * [900.0, -900.0], (count, 1)), given.efforts]))

    def widths(result: Any) -> Array:
        return np.array([np.diff(each) for each in values_of(result, 'interval').values()])

    _, alone, _, _ = identified('fourier', '--no-report')
    shutil.rmtree(tmp_path / 'a bag')
    code, result, _, err = identified('fourier', '--no-report', '--force', change=with_brakes)
    assert (code, err) == (0, '')
    ratios = widths(result) / widths(alone)
    assert 1.0 / 1.5 < ratios.min() <= ratios.max() < 1.5
    assert result['lack_of_fit'] is None


def test_at_rest_only_the_weight_is_identifiable(identified: Callable[..., Any],
                                                 tmp_path: Path) -> None:
    code, result, out, _ = identified('rest', '--no-report', '--strict')
    assert code == 1  # not all requested parameters are identifiable
    states = values_of(result, 'state')
    told = {name for name, state in states.items() if state == 'identified'}
    assert told == {'platform.mass', 'platform.center_of_mass.x', 'platform.center_of_mass.y'}
    assert set(states.values()) == {'identified', 'not_identifiable'}
    assert values_of(result)['platform.mass'] == pytest.approx(180.0, rel=0.002)
    assert values_of(result)['platform.center_of_mass.x'] == pytest.approx(0.03, abs=1e-3)
    assert result['bags'][0]['delay_s'] is None
    found = Parameters.from_yaml(tmp_path / 'found' / 'identified.yaml')
    assert found['platform.center_of_mass'][2] == GIVEN['platform.center_of_mass'][2]
    for name in ('platform.inertia', 'actuator.viscous_friction', 'actuator.coulomb_friction'):
        np.testing.assert_array_equal(found[name], GIVEN[name])
    assert 'platform.inertia: xx xy xz yy yz zz' in out
    assert not (tmp_path / 'found' / 'report.html').exists()


def test_rotation_about_one_axis_identifies_the_inertia_about_it(
        identified: Callable[..., Any], tmp_path: Path) -> None:
    # I n for n = (1, 1, 0) is identifiable: each of its components is a sum of two elements of I.
    _, result, out, _ = identified('diagonal')
    page = (tmp_path / 'found' / 'report.html').read_text()
    assert page.count('>not identifiable</td>') == 6
    states = values_of(result, 'state')
    assert {name for name, state in states.items() if state == 'not_identifiable'} == {
        f'platform.inertia.{axes}' for axes in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')}
    # Which of the sums are given, or differences of them, is a matter of chance.
    sums = result['combinations']
    names = sorted(states)
    given = np.array([[dict(zip(each['parameters'], each['coefficients'], strict=True)).get(
        name, 0.0) for name in names] for each in sums])
    assert len(sums) == 3
    for pair in (('xx', 'xy'), ('xz', 'yz'), ('yy', 'xy')):
        wanted = np.array([float(name.rpartition('.')[2] in pair) for name in names])
        parts = np.linalg.lstsq(given.T, wanted, rcond=None)[0]
        np.testing.assert_allclose(parts @ given, wanted, atol=0.01)
        value, error = (np.array([each[name] for each in sums]) for name in (
            'value', 'standard_error'))
        assert abs(parts @ value - wanted @ [VALUES.get(name, 0.0) for name in names]) < (
            4.0 * np.abs(parts) @ error)
    assert all(each['words'] in out for each in sums)


WITH_TILT = ('--identify', 'platform,friction,tilt')
# A base that may be tilted, all else known well: errors are those of the data.
WELL_KNOWN = {f'uncertainty.{name}': 1e-4 for name in (
    'leg_mass', 'effort_gain', 'reflected_mass', 'tilt')}
UNSURE = WELL_KNOWN | {'uncertainty.tilt': 0.1}


@pytest.fixture
def unsure(tmp_path: Path) -> Path:
    """Return the file of a hexapod on a base that may be tilted."""
    path = tmp_path / 'unsure.yaml'
    GIVEN.replaced(UNSURE).to_yaml(path)
    return path


def _turned(result: Any) -> Array:
    """Return the identified gravity, which has the file's magnitude."""
    gravity: Array = np.array(result['identified']['gravity'])
    assert np.linalg.norm(gravity) == pytest.approx(np.linalg.norm(GIVEN['gravity']), rel=1e-12)
    return gravity


def _degrees_between(one: Array, other: Array) -> float:
    return float(np.degrees(np.linalg.norm(np.cross(one, other)) / (
        np.linalg.norm(one) * np.linalg.norm(other))))


def test_the_tilt_of_a_base_is_found_within_its_interval(
        identified: Callable[..., Any], tmp_path: Path, unsure: Path) -> None:
    code, result, out, err = identified(
        'tilted', *WITH_TILT, '--no-report', '--strict', params=unsure)
    assert (code, err) == (0, '')
    assert _degrees_between(_turned(result), TILTED['gravity']) < 0.02
    assert _degrees_between(GIVEN['gravity'], TILTED['gravity']) > 1.4  # unlike the file's gravity
    true = VALUES | {
        'gravity.tilt_x': np.radians(1.5) * np.cos(0.7),
        'gravity.tilt_y': np.radians(1.5) * np.sin(0.7)}
    values, errors = values_of(result), values_of(result, 'standard_error')
    assert set(values) == set(true)
    for axis in 'xy':
        low, high = values_of(result, 'interval')[f'gravity.tilt_{axis}']
        assert low < true[f'gravity.tilt_{axis}'] < high
        assert high - low < np.radians(0.03)
    off = [(values[name] - value) / errors[name] for name, value in true.items()]
    assert np.max(np.abs(off)) < 4.0
    assert values['platform.mass'] == pytest.approx(180.0, rel=0.002)
    for axis, center in zip('xyz', TRUE['platform.center_of_mass'], strict=True):
        assert values[f'platform.center_of_mass.{axis}'] == pytest.approx(center, abs=1e-3)
    assert result['residuals']['after_rms_n'] < 0.01 * result['residuals']['measured_rms_n']

    assert 'gravity.tilt_y ' in out
    written = tmp_path / 'found' / 'identified.yaml'
    assert _degrees_between(
        StewartPlatform.from_yaml(written).parameters['gravity'], TILTED['gravity']) < 0.02
    # A comment above: behind the value it would be too long.
    above, _ = written.read_text().split('    gravity:')
    line = ' '.join(each.strip('# ') for each in above.splitlines()[-3:])
    assert f'm/s^2; identified {result["date"][:10]}, 95 %: turned about x by 0.0200' in line
    assert ' rad, turned about y by 0.016' in line


def test_a_base_that_is_more_tilted_than_the_file_says_is_noticed(
        identified: Callable[..., Any]) -> None:
    code, result, out, _ = identified('tilted', '--no-report', '--strict')
    assert code == 1
    assert result['lack_of_fit']['cause'] == 'tilt'
    assert 'likely a base tilted by 1.5' in ' '.join(out.split())
    for axis, true in zip('xyz', TRUE['platform.center_of_mass'], strict=True):
        low, high = values_of(result, 'interval')[f'platform.center_of_mass.{axis}']
        assert low < true < high


def test_at_rest_the_tilt_is_identifiable_unless_efforts_have_offsets(
        identified: Callable[..., Any], unsure: Path) -> None:
    # Six forces at rest determine the weight's three components and its moment.
    _, result, _, _ = identified('tilted at rest', *WITH_TILT, '--no-report', params=unsure)
    assert _degrees_between(_turned(result), TILTED['gravity']) < 0.02
    states = values_of(result, 'state')
    assert states['platform.center_of_mass.z'] == 'not_identifiable'
    moments = [np.cross(p['platform.center_of_mass'], p['gravity'])
               for p in (Parameters(result['identified']), TILTED)]
    np.testing.assert_allclose(*moments, atol=5e-3)
    # Offsets make tilt, weight and center of mass identifiable only in combination with them.
    _, result, out, _ = identified(
        'tilted at rest', '--identify', 'platform,offset,tilt', '--no-report', '--force',
        params=unsure)
    states = values_of(result, 'state')
    assert {states[name] for name in (
        'platform.mass', 'platform.center_of_mass.x', 'platform.center_of_mass.y',
        'gravity.tilt_x', 'gravity.tilt_y')} == {'not_identifiable'}
    for axis in 'xy':
        assert any(f'gravity.tilt_{axis}' in each['parameters'] and each['words'] in out
                   for each in result['combinations'])


def _swapped(given: Recorded) -> Recorded:
    assert given.rates is not None
    return Recorded(given.times, *(each[:, [0, 2, 1, 3, 4, 5]] for each in (
        given.positions, given.rates, given.efforts)))


@pytest.mark.parametrize(('change', 'named', 'options'), [
    (lambda given: given._replace(efforts=-given.efforts), r'opposite sign: \+ must push', ()),
    pytest.param(lambda given: given._replace(efforts=1e-3 * given.efforts),
                 'likely kN in place of N', WITH_TILT, marks=pytest.mark.slow),
    pytest.param(lambda given: given._replace(efforts=given.efforts * 0.02 / (2.0 * np.pi)),
                 'likely torques of the motors', (), marks=pytest.mark.slow),
    pytest.param(_swapped, 'positions and efforts of leg_2 and leg_3 look swapped', WITH_TILT,
                 marks=pytest.mark.slow),
    pytest.param(
        lambda given: given._replace(positions=given.positions - 0.02),
        r'geometry.zero_length looks wrong: another geometry.zero_length, (\+1[89]\S* ){6}mm', (),
        marks=pytest.mark.slow),
    (lambda given: given._replace(positions=1e3 * given.positions),
     'lengths belong to no pose of this hexapod', ()),
], ids=['sign', 'kN', 'torque', 'swapped', 'zero length', 'mm'])
def test_possible_errors_are_named_and_nothing_is_written(
        identified: Callable[..., Any], tmp_path: Path, change: Change, named: str,
        options: tuple[str, ...]) -> None:
    code, result, out, err = identified(
        'tilted' if options else 'fourier', '--no-report', *options, change=change)
    assert (code, result, out) == (2, None, '')
    assert re.search(named, err)
    assert err.startswith('stewart_identify: ')
    assert err.count('\n') == 1
    assert not (tmp_path / 'found').exists()


CONSTANT = np.array([0.3, 0.35, 0.4, 0.45, 0.5, 0.55])


@pytest.mark.parametrize(('option', 'per_newton', 'given', 'needed'), [
    pytest.param('--motor-torque', 0.01 / (2.0 * np.pi), {}, {'actuator.screw_lead': 0.01},
                 marks=pytest.mark.slow),
    ('--motor-current', 0.01 / (2.0 * np.pi * 3.0) / CONSTANT,
     {'actuator.screw_lead': 0.01, 'drive.gear_ratio': 3.0}, {'drive.torque_constant': CONSTANT})])
def test_efforts_of_motors_need_the_drive(
        identified: Callable[..., Any], tmp_path: Path, option: str, per_newton: Any,
        given: dict[str, Any], needed: dict[str, Any]) -> None:
    params = tmp_path / 'driven.yaml'
    GIVEN.replaced(given | needed).to_yaml(params)
    code, result, _, _ = identified(
        'fourier', '--no-report', option, params=params,
        change=lambda given: given._replace(efforts=given.efforts * per_newton))
    assert code == 0
    assert values_of(result)['platform.mass'] == pytest.approx(180.0, rel=0.002)
    assert result['options'][option[2:].replace('-', '_')] is True
    GIVEN.replaced(given).to_yaml(params)
    code, _, _, err = identified('fourier', '--force', option, params=params)
    assert code == 2
    assert f'{[*needed][0]}: has no value: {option} needs it' in err
    if not given:
        GIVEN.replaced({'actuator.screw_lead': 0.04}).to_yaml(params)
        code, _, _, err = identified('fourier', '--force', option, params=params)
        assert code == 2
        assert 'likely actuator.screw_lead, 0.04 m, is wrong: about 0.0' in err


def test_a_table_is_rejected_with_the_way_to_a_bag(tmp_path: Path) -> None:
    table = tmp_path / 'legs.csv'
    table.write_text('t,leg_1,effort_1\n0,0,0\n')
    err = call(main, table, '--params', FILE, '--output', tmp_path / 'found', code=2).err
    assert 'legs.csv: a table: measured legs are read from bags' in err
    assert 'docs/identify_from_bags.md' in err


@pytest.mark.slow
def test_forces_given_as_torques_of_motors_are_named(
        identified: Callable[..., Any], tmp_path: Path, snapshot: Snapshot) -> None:
    """A few hundred times too large, they all are beyond limits.force_max, where it is given."""
    driven = {'actuator.screw_lead': 0.01}
    for limits in ({'limits.force_max': 6000.0}, {'limits.force_max': None}):
        GIVEN.replaced(driven | limits).to_yaml(tmp_path / 'driven.yaml')
        code, _, _, err = identified('fourier', '--no-report', '--motor-torque',
                                     params=tmp_path / 'driven.yaml')
        assert code == 2
        assert 'possible error: the efforts are ' in err or limits['limits.force_max'] is None
        snapshot(err)


@pytest.mark.slow
def test_losses_of_drives_are_no_mass_and_no_friction(
        identified: Callable[..., Any], tmp_path: Path) -> None:
    p = GIVEN.replaced({
        'actuator.reflected_mass': None, 'actuator.screw_lead': 0.01,
        'drive.motor_inertia': 7.6e-5, 'drive.efficiency': 0.8, **WELL_KNOWN})
    p.to_yaml(tmp_path / 'driven.yaml')
    per_newton = 1.0 / motor_ratio(p)

    def torques(given: Recorded) -> Recorded:
        assert given.rates is not None
        of_rotors = p['actuator.reflected_mass'] * np.gradient(given.rates, given.times, axis=0)
        loads = given.efforts - of_rotors
        slip = np.minimum(np.abs(given.rates) / p['actuator.coulomb_velocity'], 1.0)
        full = np.where(loads * given.rates > 0.0, 1.0 / 0.8, 2.0 - 1.0 / 0.8)
        return given._replace(efforts=per_newton * (
            loads * (1.0 + (full - 1.0) * slip) + of_rotors))

    code, result, _, _ = identified(
        'fourier', '--no-report', '--motor-torque', params=tmp_path / 'driven.yaml',
        change=torques)
    assert code == 0
    assert values_of(result)['platform.mass'] == pytest.approx(180.0, rel=0.003)


@pytest.mark.parametrize('frequency', few([0.2, 0.5, 1.0], 1))
@pytest.mark.parametrize('factor', [1.0, -1.0])
def test_opposite_efforts_in_heave_are_not_taken_for_a_delay(
        identified: Callable[..., Any], frequency: float, factor: float,
        snapshot: Snapshot) -> None:
    """Half a period of delay fits the moving part of efforts with the opposite sign."""
    w = 2.0 * np.pi * frequency

    def heave(given: Recorded) -> Recorded:
        wave = 0.05 * np.sin(w * given.times[:, None])
        motion = Motion(
            np.array([0.0, 0.0, 1.15]) + wave * [0.0, 0.0, 1.0],
            np.broadcast_to(np.eye(3), (len(wave), 3, 3)),
            linear_velocity=0.05 * w * np.cos(w * given.times[:, None]) * [0.0, 0.0, 1.0],
            linear_acceleration=-w * w * wave * [0.0, 0.0, 1.0])
        found = StewartPlatform(GIVEN).inverse_dynamics(motion)
        return given._replace(
            positions=found.lengths - GIVEN['geometry.zero_length'], rates=found.rates,
            efforts=factor * found.forces)

    code, result, _, err = identified('fourier', '--no-report', change=heave)
    if factor < 0.0:
        assert (code, result) == (2, None)
        snapshot(err)
    else:
        assert code == 0
        assert abs(result['bags'][0]['delay_s']) < 1e-4


def test_possible_errors_may_be_accepted(
        identified: Callable[..., Any], snapshot: Snapshot) -> None:
    code, result, _, err = identified(
        'rest', '--no-report', '--accept-mistakes',
        change=lambda given: given._replace(efforts=1e-3 * given.efforts))
    assert code == 0
    snapshot(err)
    assert result['likely_mistakes'][0]['what'] == 'unit'
    assert result['identified']['platform.mass'] > 0.0
