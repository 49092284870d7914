# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Motions in CSV files: columns, units, angles, axes, accelerations alone, and bad files."""

from __future__ import annotations

from collections.abc import Callable
import csv
import html
import io
from itertools import count
import json
from pathlib import Path
import shlex
from typing import Any

import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from referees import rng, ROOT
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import BagError, Motion, Parameters, read_setpoints, StewartPlatform
from stewart_dynamics.bags.baseline import integrated
from stewart_dynamics.datasheet.datasheet_command_line import main as capability
from stewart_dynamics.program import EULER
from stewart_dynamics.replay import main as replay
from stewart_dynamics.tables.column_names import MOTION as QUANTITIES, QUATERNION, si_factor

PROGRAM = 'stewart_replay'

Array = NDArray[np.float64]

PARAMS = ROOT / 'config' / 'platform.yaml'
PLATFORM = StewartPlatform.from_yaml(PARAMS)
TIMES = np.arange(0.0, 2.0, 0.01)


def smooth(amplitude: float = 0.05) -> Motion:
    """Return a motion of all six coordinates at TIMES."""
    w = 2.0 * np.pi * np.array([0.5, 0.7, 0.4, 0.6, 0.8, 0.3])
    phase = w * TIMES[:, None] + np.arange(6)
    x, v, a = (amplitude * each for each in (
        np.sin(phase), w * np.cos(phase), -w ** 2 * np.sin(phase)))
    x[:, 2] += 1.1
    return Motion.from_euler(x[:, :3], x[:, 3:], v[:, :3], v[:, 3:], a[:, :3], a[:, 3:])


MOTION = smooth()


def columns(motion: Motion) -> dict[str, Array]:
    """Return a motion as columns in SI, its rotation as angles of Rz Ry Rx."""
    # a copy: SciPy 1.10 takes no arrays that are read-only
    angles = Rotation.from_matrix(motion.rotation.copy()).as_euler('xyz')
    found = {'t': TIMES}
    for names, values in (
            ('x y z', motion.position), ('roll pitch yaw', angles),
            ('vx vy vz', motion.linear_velocity), ('wx wy wz', motion.angular_velocity),
            ('ax ay az', motion.linear_acceleration),
            ('alx aly alz', motion.angular_acceleration)):
        found |= {name: values[:, n] for n, name in enumerate(names.split())}
    return found


def write(path: Path, table: dict[str, Array], separator: str = ',', mark: str = '.') -> Path:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=separator, lineterminator='\n')
    writer.writerow(table)
    writer.writerows([[repr(float(each)).replace('.', mark) for each in row]
                      for row in zip(*table.values(), strict=True)])
    path.write_text(text.getvalue())
    return path


def close(found: Any, wanted: Motion) -> None:
    np.testing.assert_allclose(found.motion.rows, wanted.rows, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.times, TIMES, rtol=0.0, atol=1e-9)


def test_columns_with_units_are_read_in_si(tmp_path: Path) -> None:
    given = columns(MOTION)
    scaled = {
        't': ('t [ms]', 1e3), 'x': ('x [mm]', 1e3), 'y': ('y [cm]', 1e2),
        'z': ('z [in]', 1.0 / 0.0254), 'roll': ('roll [deg]', np.degrees(1.0)),
        'pitch': ('pitch[mrad]', 1e3), 'yaw': ('yaw [°]', np.degrees(1.0)),
        'vx': ('vx [mm/s]', 1e3), 'vy': ('VY [m/s]', 1.0), 'wx': ('wx [deg/s]', np.degrees(1.0)),
        'ax': ('ax [g]', 1.0 / 9.80665), 'ay': ('ay [gal]', 100.0), 'az': ('az [mm/s^2]', 1e3),
        'alx': ('alx [deg/s²]', np.degrees(1.0)), 'aly': ('aly [rad/s**2]', 1.0)}
    table = {scaled.get(name, (name, 1.0))[0]: values * scaled.get(name, (name, 1.0))[1]
             for name, values in given.items()}
    table['comment'] = np.zeros(len(TIMES))
    close(read_setpoints(write(tmp_path / 'a.csv', table)), MOTION)
    close(read_setpoints(write(tmp_path / 'b.csv', table, ';', ',')), MOTION)


@pytest.mark.parametrize('order', EULER)
def test_angles_of_any_order_are_those_of_scipy(order: str, tmp_path: Path) -> None:
    angles = rng(1).uniform(-0.5, 0.5, (len(TIMES), 3))
    table = {'t': TIMES, 'x': TIMES, 'y': TIMES, 'z': TIMES}
    table |= {name: angles[:, n] for n, name in enumerate(('roll', 'pitch', 'yaw'))}
    path = write(tmp_path / 'a.csv', table)
    # scipy takes the angles in the order of the rotations.
    wanted = Rotation.from_euler(order, angles[:, ['xyz'.index(each) for each in order.lower()]])
    np.testing.assert_allclose(
        read_setpoints(path, euler=order).motion.rotation, wanted.as_matrix(), atol=1e-12)


def test_u_v_w_turn_along_and_roll_pitch_yaw_do_not(tmp_path: Path) -> None:
    angles = np.array([[0.1, 0.2, 0.3]]).repeat(len(TIMES), axis=0)
    for names, order in ((('u', 'v', 'w'), 'XYZ'), (('roll', 'pitch', 'yaw'), 'xyz')):
        table = {'t': TIMES, 'x': TIMES, 'y': TIMES, 'z': TIMES}
        table |= {name: angles[:, n] for n, name in enumerate(names)}
        found = read_setpoints(write(tmp_path / 'a.csv', table))
        np.testing.assert_allclose(
            found.motion.rotation[0], Rotation.from_euler(order, angles[0]).as_matrix(),
            atol=1e-12)


@pytest.mark.parametrize('axes', ['x,-y,z', 'z,-x,y', 'x,-y,-z', '-y,x,z'])
def test_axes_of_other_sources_left_handed_or_not(axes: str, tmp_path: Path) -> None:
    matrix = np.zeros((3, 3))
    for row, name in enumerate(axes.split(',')):
        matrix[row, 'xyz'.index(name[-1])] = -1.0 if name[0] == '-' else 1.0
    axial = np.linalg.det(matrix) * matrix
    # The motion in the axes of the source.
    source = Motion(MOTION.position @ matrix, matrix.T @ MOTION.rotation @ matrix,
                    MOTION.linear_velocity @ matrix, MOTION.angular_velocity @ axial,
                    MOTION.linear_acceleration @ matrix, MOTION.angular_acceleration @ axial)
    close(read_setpoints(write(tmp_path / 'a.csv', columns(source)), axes=axes), MOTION)


def test_replay_and_capability_read_the_same_file(tmp_path: Path) -> None:
    path = write(tmp_path / 'motion.csv', columns(MOTION))
    call(replay, path, '--params', PARAMS, '--output', tmp_path / 'r', '--no-report', '--strict')
    summary = json.loads((tmp_path / 'r' / 'motion' / 'summary.json').read_text())
    assert summary['setpoints']['answered'] == len(TIMES)
    assert not summary['mistakes'] and not summary['rejected'] and not summary['notices']
    forces = PLATFORM.inverse_dynamics(MOTION).forces
    assert summary['legs']['leg_1']['force_peak_n'] == pytest.approx(
        forces[np.abs(forces[:, 0]).argmax(), 0])
    out = call(capability, '--params', PARAMS, '--motion', path, '--output', tmp_path / 'c',
               '--strict').out
    assert 'possible' in out


def test_a_file_needs_no_other_source_of_setpoints(tmp_path: Path) -> None:
    path = write(tmp_path / 'motion.csv', columns(MOTION))
    params = tmp_path / 'combined.yaml'
    Parameters.from_yaml(PARAMS).replaced({'setpoint.source': 'combined'}).to_yaml(params)
    call(replay, path, '--params', params, '--output', tmp_path / 'r', '--no-report')
    close(read_setpoints(path, Parameters.from_yaml(params)), MOTION)


def test_poses_alone_need_to_be_differentiated(tmp_path: Path) -> None:
    table = columns(MOTION)
    path = write(tmp_path / 'poses.csv', {
        name: table[name] for name in ('t', 'x', 'y', 'z', 'roll', 'pitch', 'yaw')})
    plain = ['--params', str(PARAMS), '--output', str(tmp_path / 'r'), '--no-report']
    assert '--differentiate computes twist' in call(replay, path, *plain, code=2).err
    call(replay, path, *plain, '--differentiate')
    found = read_setpoints(path, cutoff=10.0)
    inner = slice(30, -30)
    np.testing.assert_allclose(found.motion.linear_acceleration[inner],
                               MOTION.linear_acceleration[inner], atol=0.01)
    assert not read_setpoints(path).motion.rows[:, 12:].any()


def test_a_platform_that_stays_level_needs_no_rotation(tmp_path: Path) -> None:
    table = columns(MOTION)
    path = write(tmp_path / 'level.csv', {name: table[name] for name in (
        't', 'x', 'y', 'z', 'vx', 'vy', 'vz', 'ax', 'ay', 'az')})
    found = read_setpoints(path).motion
    np.testing.assert_array_equal(found.rotation, np.tile(np.eye(3), (len(TIMES), 1, 1)))
    np.testing.assert_allclose(found.linear_velocity, MOTION.linear_velocity)
    assert not found.angular_velocity.any()


# -- accelerations alone --------------------------------------------------------------------------

def quake(offset: float = 0.0, drift: float = 0.0) -> tuple[Array, Array, Array]:
    """Return times, positions and accelerations with the errors of an accelerometer."""
    t = np.arange(0.0, 20.0, 0.005)
    w, u = 2.0 * np.pi * np.array([1.5, 2.3, 3.1]), (t[:, None] - 8.0) / 3.0
    envelope = np.exp(-u ** 2)
    x = 0.01 * envelope * np.sin(w * t[:, None])
    rate, change = -2.0 * u / 3.0 * envelope, (4.0 * u ** 2 - 2.0) / 9.0 * envelope
    a = 0.01 * (change * np.sin(w * t[:, None]) + 2.0 * rate * w * np.cos(w * t[:, None])
                - envelope * w ** 2 * np.sin(w * t[:, None]))
    return t, x, a + offset + drift * t[:, None]


def test_the_record_of_an_earthquake_is_integrated_with_its_base_line_corrected(
        tmp_path: Path, snapshot: Snapshot) -> None:
    t, x, a = quake(offset=0.02, drift=0.001)
    path = write(tmp_path / 'quake.csv', {
        't': t, 'ax [g]': a[:, 0] / 9.80665, 'az': a[:, 2], 'ay [cm/s^2]': 100.0 * a[:, 1]})
    motion = read_setpoints(path, PLATFORM).motion
    home = PLATFORM.home_pose().position
    # A line is fitted to the motion as well; without one it would end 5 m away.
    np.testing.assert_allclose(motion.position - home, x, atol=5e-4)
    for end in (0, -1):
        np.testing.assert_allclose(motion.position[end], home, atol=1e-9)
        np.testing.assert_allclose(motion.linear_velocity[end], 0.0, atol=1e-9)
    call(replay, path, '--params', PARAMS, '--output', tmp_path / 'r', '--no-report', '--strict')
    summary = json.loads((tmp_path / 'r' / 'quake' / 'summary.json').read_text())
    assert not summary['mistakes']
    notice, = summary['notices']
    assert 'after the base line, a polynomial of second degree' in notice
    with snapshot.raises(BagError):
        read_setpoints(path)


def test_position_velocity_and_acceleration_belong_together() -> None:
    t, _, a = quake(offset=0.1)
    found = integrated(t, a)
    steps = np.diff(t)[:, None]
    first, second = found.accelerations[:-1], found.accelerations[1:]
    np.testing.assert_allclose(
        np.diff(found.velocities, axis=0), steps * (first + second) / 2.0, atol=1e-12)
    np.testing.assert_allclose(
        np.diff(found.positions, axis=0),
        steps * found.velocities[:-1] + steps ** 2 * (2.0 * first + second) / 6.0, atol=1e-12)
    # No other line of second degree, that ends at rest in the same place, has a smaller velocity.
    for change in np.random.default_rng(1).normal(size=(20, 3)):
        u = t / t[-1]
        v = change[0] * u + change[1] * u ** 2 / 2.0 + change[2] * u ** 3 / 3.0
        x = np.cumsum(v) * 0.005
        basis = np.stack([u * (1.0 - u), u ** 2 * (1.0 - u)], axis=1)
        v = basis[:, 0] - basis[:, 1] * (basis[:, 0].sum() / basis[:, 1].sum())
        assert abs(x).max() > 0.0
        assert np.sum((found.velocities + 1e-3 * v[:, None]) ** 2) >= np.sum(
            found.velocities ** 2)


def test_a_record_with_a_gap_is_not_integrated(tmp_path: Path, snapshot: Snapshot) -> None:
    t, x, a = quake()
    for lost, known in (((6.0, 6.001), True), ((6.0, 11.0), False), ((6.0, 6.3), False)):
        kept = (t < lost[0] - 1e-6) | (t > lost[1] + 1e-6)
        path = write(tmp_path / 'quake.csv', {
            't': t[kept], 'ax': a[kept, 0], 'ay': a[kept, 1], 'az': a[kept, 2]})
        if known:  # a sample that is lost does not move the platform elsewhere
            motion = read_setpoints(path, PLATFORM).motion
            np.testing.assert_allclose(
                motion.position - PLATFORM.home_pose().position, x[kept], atol=5e-4)
            continue
        with snapshot.raises(BagError):
            read_setpoints(path, PLATFORM)


# -- advice ---------------------------------------------------------------------------------------

def test_the_command_of_a_report_runs_as_printed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = {f'{name} "it\'s"': values for name, values in ship(5.0).items()}
    path = write(tmp_path / "the ship's motion <1>.csv", table)
    params = tmp_path / 'my $HOME.yaml'
    params.write_text(PARAMS.read_text())
    columns = ','.join(f'{name}={name} "it\'s"' + (' [deg]' if name in (
        'roll', 'pitch', 'yaw') else '') for name in ship(5.0))
    call(replay, path, '--params', params, '--columns', columns, '--output', tmp_path / 'r',
         '--differentiate', '--cutoff', '8', '--strict')
    page = (tmp_path / 'r' / path.stem / 'report.html').read_text()
    command = html.unescape(page.partition('<code>stewart_capability ')[2].partition('</code>')[0])
    monkeypatch.chdir(tmp_path)
    assert 'motion possible' in call(capability, *shlex.split(command)).out


# -- angles in degrees ----------------------------------------------------------------------------

def ship(amplitude: float, names: str = 'roll pitch yaw', unit: float = 1.0) -> dict[str, Array]:
    """Return poses whose angles have an amplitude, as numbers."""
    t = np.arange(0.0, 10.0, 0.02)
    table = {'t': t, 'x': 0.0 * t, 'y': 0.0 * t, 'z': 1.18 + 0.1 * np.sin(0.8 * t)}
    return table | {name: unit * size * amplitude * np.sin(rate * t) for name, size, rate in zip(
        names.split(), (1.0, 0.6, 0.2), (0.7, 0.6, 0.5), strict=True)}


def mistakes_of(path: Path, tmp_path: Path, *options: str) -> list[str]:
    """Return the possible errors that a replay names in a motion."""
    replay([str(path), '--params', str(PARAMS), *options, '--output', str(tmp_path / 'r'),
            '--no-report', '--force', '--differentiate'])
    return [f'{each["topic"]}: {each["text"]}' for each in json.loads(
        (tmp_path / 'r' / path.stem / 'summary.json').read_text())['mistakes']]


def rated(path: Path, tmp_path: Path) -> dict[str, Any]:
    """Return what a datasheet says about a motion."""
    capability(['--params', str(PARAMS), '--motion', str(path), '--output', str(tmp_path / 'c'),
                '--differentiate', '10'])
    found: dict[str, Any] = json.loads((tmp_path / 'c' / 'datasheet.json').read_text())['motion']
    return found


@pytest.mark.parametrize('amplitude', [1.5, 5.0, 30.0])
@pytest.mark.parametrize(('names', 'axes'), [
    ('roll pitch yaw', 'x,y,z'), ('u v w', 'x,y,z'), ('Alpha Beta Gamma', 'x,-y,-z')])
def test_angles_in_degrees_are_named_and_the_advice_reads_them(
        amplitude: float, names: str, axes: str, tmp_path: Path, snapshot: Snapshot) -> None:
    table = ship(amplitude, names)
    if axes != 'x,y,z':
        table['z'] = -table['z']
    path = write(tmp_path / 'ship.csv', table)
    text, *others = mistakes_of(path, tmp_path, '--axes', axes)
    assert 'possible error: angles in degrees' in text and not others
    snapshot(text)
    option, value = shlex.split(text[text.index('--columns'):text.index(' reads degrees')])
    assert not mistakes_of(path, tmp_path, '--axes', axes, option, value)


@pytest.mark.parametrize('amplitude', [0.02, 0.2, 0.45, 0.8])
def test_angles_in_radians_are_no_possible_error(amplitude: float, tmp_path: Path) -> None:
    """Even if they exceed the limits: this hexapod reaches 0.6 rad."""
    assert not mistakes_of(write(tmp_path / 'ship.csv', ship(amplitude)), tmp_path)


def test_the_capability_names_the_possible_errors_of_the_replay(tmp_path: Path) -> None:
    path = write(tmp_path / 'ship.csv', ship(5.0))
    found = rated(path, tmp_path)
    assert found['mistakes'] == mistakes_of(path, tmp_path)
    assert 'angles in degrees' in found['mistakes'][0]


def test_angles_with_a_unit_are_taken_as_they_are(tmp_path: Path) -> None:
    table = {name + (' [rad]' if name in ('roll', 'pitch', 'yaw') else ''): values
             for name, values in ship(5.0).items()}
    assert not any('degrees' in text for text in mistakes_of(
        write(tmp_path / 'ship.csv', table), tmp_path))


def test_the_capability_says_what_is_not_read(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / 'level.csv', {
        't': TIMES, 'x': 0.0 * TIMES, 'y': 0.0 * TIMES, 'z': 1.1 + 0.01 * TIMES, 'wind': TIMES})
    mistakes_of(path, tmp_path)
    notices = rated(path, tmp_path)['notices']
    assert notices == ['columns that are not read: wind',
                       'no columns of the rotation: the platform stays level']
    for program in capsys.readouterr().out.split('payload at')[:2]:
        assert all(notice in program for notice in notices)


# -- bad files ------------------------------------------------------------------------------------

HEAD = 't,x,y,z,qx,qy,qz,qw'
ROW = '{},0,0,1.1,0,0,0,1'


def rows(*more: str) -> str:
    return '\n'.join([HEAD, *(ROW.format(n) for n in (1, 2)), *more]) + '\n'


@pytest.mark.parametrize('text', [
    '',
    HEAD,
    rows().replace('t,', 'tick,'),
    rows().replace(',y,', ',why,'),
    rows().replace('qw', 'q4'),
    rows().replace('x,y', 'x [furlong],y', 1),
    rows().replace('qx', 'qx [deg]'),
    rows().replace('t,', 't [m],'),
    rows().replace('qw', 'x'),
    rows('3,0,0,abc,0,0,0,1'),
    rows('3,0,nan,1,0,0,0,1'),
    rows('3,0,0,1_0,0,0,0,1'),
    rows('3,0,0,1.1,0,0,0'),
    rows('3,0,0,1.1,0,0,0,2'),
    rows('2,0,0,1.1,0,0,0,1'),
    rows('1e10,0,0,1.1,0,0,0,1'),
    't,ax\n1,0\n2,x\n',
    't,vx,vy,vz\n1,0,0,0\n2,0,0,0\n',
    't,ax,alx\n1,0,1\n2,0,1\n',
    rows().replace('qw\n', 'qw,roll\n').replace('1\n', '1,0\n'),
    't,x,y,z,roll,pitch,yaw,vx,vy,vz\n' + '1,0,0,1,0,0,0,0,0,0\n' * 2,
], ids=count())
def test_a_bad_file_is_named_with_row_column_value_and_rule(
        text: str, tmp_path: Path, snapshot: Snapshot) -> None:
    path = tmp_path / 'bad.csv'
    path.write_text(text)
    error = call(replay, path, '--params', PARAMS, '--output', tmp_path / 'r', code=2).err
    snapshot(error)
    assert error.count('\n') == 1 and not (tmp_path / 'r' / 'bad').exists()


@pytest.mark.parametrize('change', [
    lambda text: '\ufeff' + text, lambda text: text.replace('\n', '\r\n'),
    lambda text: '# from the tracker, 2026\n' + text, lambda text: text.replace(',', '\t'),
    lambda text: text.replace(',', ' , '), lambda text: text + '\n\n'])
def test_files_as_programs_write_them(change: Callable[[str], str], tmp_path: Path) -> None:
    path = tmp_path / 'a.csv'
    path.write_text(change(rows('3,0,0,1.2,0,0,0,1')))
    found = read_setpoints(path)
    assert found.motion.position[:, 2].tolist() == [1.1, 1.1, 1.2]
    assert found.times.tolist() == [0.0, 1.0, 2.0]


def test_every_unit_is_known_in_all_its_spellings() -> None:
    for group in QUANTITIES:
        assert si_factor(group, '') == 1.0
        for unit, si in group.units.items():
            for ending in {0: ('',), 1: ('/s', ' / s'), 2: (
                    '/s^2', '/s2', '/s²', '/s/s', '/s**2')}[group.order]:
                assert si_factor(group, unit + ending) == si
    assert si_factor(QUATERNION, 'm') is None
