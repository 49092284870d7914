# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""stewart_calibrate: its input, its files, its page, and its messages about bad input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
from pathlib import Path

import messages
from messages import leg_states, MS, SECOND
import numpy as np
from programs import call
import pytest
import recorded
from recorded import Recorded
from referees import PLATFORM
from snapshot import Snapshot
from stewart_dynamics import (
    check_planned_trajectory, Motion, ParameterError, Parameters, Pose, read_setpoints,
    StewartError, StewartPlatform)
from stewart_dynamics.calibration import main
from stewart_dynamics.calibration.calibrate import calibrate
from stewart_dynamics.calibration.calibration_report import _arrow_scale, _view
from stewart_dynamics.calibration.equations import (
    BASE, Equations, PLATFORM as PLATFORM_JOINTS, values_of)
from stewart_dynamics.calibration.geometry_fit import fit, Unknowns
from stewart_dynamics.calibration.measured_poses import METERS, Millimeters, poses_csv, read_poses
from stewart_dynamics.calibration.noise import Noise
from stewart_dynamics.calibration.one_run import CalibrationOptions, run
from stewart_dynamics.calibration.pose_design import design_poses, NOISE
from stewart_dynamics.calibration.recorded_poses import read_bag
from stewart_dynamics.calibration.tracked_poses import read_tracked
from stewart_dynamics.errors import BagError
from stewart_dynamics.mechanics.frames.rotation import from_euler
from stewart_dynamics.messages.setpoint import StampedWriter
from stewart_dynamics.reporting.estimates import estimate, rounded, table_lines
from stewart_dynamics.tables.reading import Reading
from test_calibration import HEXAPOD, LEGS, measured, random_poses, true_values, UNIVERSAL

PROGRAM = 'stewart_calibrate'

NODE = '/stewart_dynamics'
WITHOUT_CHECKSUMS = 'bag.mcap: has no checksums: damaged bytes cannot be detected'
JOINTS = HEXAPOD.parameters['joints']


@pytest.fixture(scope='module')
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of 40 poses with noise, of which row 5 is an outlier."""
    rng = np.random.default_rng(0)
    lengths, seen = measured(rng, true_values(rng), random_poses(rng, 40), Noise(2e-6, 1e-5, 1e-5))
    lengths[3] += 0.01
    path = tmp_path_factory.mktemp('poses') / 'poses.csv'
    path.write_text(poses_csv(JOINTS, lengths, seen))
    return path


def test_files_and_page(table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    output = tmp_path / 'out'
    arguments = [str(table), '--params', str(PLATFORM), '--output', str(output)]
    shown = call(main, *arguments, '--strict').out
    assert 'row 5: left out, all legs off by up to 1' in shown
    result = json.loads((output / 'calibration.json').read_text())
    true = true_values(np.random.default_rng(0))
    names = [each['name'] for each in result['parameters']]
    assert names[:4] == [*(f'geometry.base_joints.leg_1.{axis}' for axis in 'xyz'),
                         'geometry.base_joints.leg_2.x']
    assert names[18] == 'geometry.platform_joints.leg_1.x'
    assert names[36:] == [f'geometry.zero_length.leg_{n}' for n in range(1, 7)]
    inside = [each['interval'][0] < value < each['interval'][1]
              for each, value in zip(result['parameters'], true, strict=False)]
    assert sum(inside) > 36
    assert result['validation']['after']['position_rms_m'] < 3e-5 < 1e-3 < (
        result['validation']['before']['position_rms_m'])
    calibrated = Parameters.from_yaml(output / 'calibrated.yaml')
    assert calibrated['platform.mass'] == HEXAPOD.parameters['platform.mass']
    values = np.concatenate([
        calibrated[f'geometry.{name}'].ravel()
        for name in ('base_joints', 'platform_joints', 'zero_length')])
    assert np.abs(values - [each['value'] for each in result['parameters']]).max() < 1e-7
    page = (output / 'report.html').read_text()
    assert page.count('<svg') == 3 and 'row 5: left out' in page and 'nan' not in page
    # Results are replaced on request alone.
    snapshot(call(main, *arguments, code=2).err)
    call(main, *arguments, '--force', '--fixed', 'zero_length')
    assert (output / 'report.html').read_text().count('<td class="none">fixed</td>') == 6


@pytest.mark.parametrize('copies', [0, 1, 20])
def test_measurements_that_repeat_earlier_ones_are_named(
        copies: int, table: Path, tmp_path: Path) -> None:
    head, *rows = table.read_text().splitlines()
    path = tmp_path / 'poses.csv'
    path.write_text('\n'.join([head, *rows, *rows[:copies]]))
    done = call(main, path, '--params', PLATFORM, '--output', tmp_path / 'out')
    named = f'{copies} of {len(rows) + copies} measurements repeat an earlier one, number for'
    assert (named in done.out) is (copies > 1)


def tracked(path: Path, poses: Pose, home: bool, noise: float = 1e-6) -> Path:
    """Write the file of a tracker that sees each pose for a second, with moves between them."""
    rng = np.random.default_rng(3)
    stops = [*([np.eye(4)] if home else []), *(np.block([
        [rotation, position[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
        for rotation, position in zip(poses.rotation, poses.position, strict=True))]
    quaternions = Pose([each[:3, 3] for each in stops],
                       [each[:3, :3] for each in stops]).quaternion
    rows = [np.append(stops[0][:3, 3], quaternions[0])]
    for stop, quaternion in zip(stops, quaternions, strict=True):
        there = np.append(stop[:3, 3], quaternion)
        move = np.linspace(0.0, 1.0, 50)[1:, None]
        rows += [*(rows[-1] * (1.0 - move) + there * move), *([there] * 100)]
    seen = np.array(rows)
    seen[:, :3] = 1e3 * (seen[:, :3] + noise * rng.normal(size=(len(seen), 3)))
    seen[:, 3:] /= np.linalg.norm(seen[:, 3:], axis=1, keepdims=True)
    lines = ['Time (Seconds),x (mm),y (mm),z (mm),qx,qy,qz,qw', *(
        f'{0.01 * n:.2f},' + (','.join(map(repr, row)) if n % 97 else ',' * 6)
        for n, row in enumerate(seen.tolist()))]
    path.write_text('\n'.join(lines))
    return path


@pytest.mark.parametrize('home', [False, True])
def test_poses_come_from_the_file_of_a_tracker(
        home: bool, table: Path, tmp_path: Path) -> None:
    given = read_poses(table, HEXAPOD.parameters)
    path = tracked(tmp_path / 'tracker.csv', given.poses, home)
    legs = tmp_path / 'legs.tsv'
    legs.write_text('\n'.join(['\t'.join(f'{name}_mm' for name in JOINTS), *(
        '\t'.join(map(repr, row)) for row in (1e3 * given.positions).tolist())]))
    found = read_tracked(legs, path, HEXAPOD.parameters, METERS, Reading())
    np.testing.assert_allclose(found.poses.position, given.poses.position, atol=1e-6)
    np.testing.assert_allclose(found.poses.rotation, given.poses.rotation, atol=1e-9)
    np.testing.assert_allclose(found.positions, given.positions, atol=1e-15)
    output = tmp_path / 'out'
    arguments = [str(legs), '--pose', str(path), '--params', str(PLATFORM)]
    assert 'row 5, t = ' in call(main, *arguments, '--output', output).out  # the outlier
    result = json.loads((output / 'calibration.json').read_text())
    assert result['poses']['pose'] == str(path)
    assert result['validation']['after']['position_rms_m'] < 3e-5


def test_rests_and_rows_must_be_as_many(table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    given = read_poses(table, HEXAPOD.parameters)
    path = tracked(tmp_path / 'tracker.csv', given.poses[:-1], False)
    snapshot(call(main, table, '--pose', path, '--params', PLATFORM, code=2).err)


def test_units_and_angles(table: Path, tmp_path: Path) -> None:
    given = read_poses(table, HEXAPOD.parameters)
    angles = np.random.default_rng(1).uniform(-0.3, 0.3, (40, 3))
    path = tmp_path / 'angles.csv'
    lines = ['', ';'.join(['note', *reversed(JOINTS), 'z', 'y', 'x', 'gamma', 'alpha', 'beta'])]
    for lengths, position, turn in zip(1e3 * given.positions, 1e3 * given.poses.position,
                                       np.degrees(angles), strict=True):
        lines.append(';'.join(['a b', *map(repr, map(float, (
            *lengths[::-1], *position[::-1], turn[2], turn[0], turn[1])))]))
    path.write_text('\ufeff' + '\r\n'.join(lines) + '\r\n\r\n')
    found = read_poses(path, HEXAPOD.parameters, millimeters=Millimeters(True, True), degrees=True)
    np.testing.assert_allclose(found.positions, given.positions, atol=1e-15)
    np.testing.assert_allclose(found.poses.position, given.poses.position, atol=1e-15)
    np.testing.assert_allclose(found.poses.rotation, from_euler(angles), atol=1e-15)
    assert found.names[:2] == ('row 3', 'row 4')  # as an editor counts them
    # Lines can end in any way.
    path.write_bytes(path.read_bytes().replace(b'\r\n', b'\r'))
    np.testing.assert_array_equal(
        read_poses(path, HEXAPOD.parameters, Millimeters(True, True), True).positions,
        found.positions)


@pytest.mark.parametrize('separator', [';', '\t'])
def test_decimal_commas_are_read_beside_semicolons_and_tabs(
        separator: str, table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    given = read_poses(table, HEXAPOD.parameters)
    path = tmp_path / 'commas.csv'
    text = table.read_text().replace(',', separator).replace('.', ',')
    path.write_text('\ufeff' + text)
    found = read_poses(path, HEXAPOD.parameters)
    np.testing.assert_array_equal(found.positions, given.positions)
    np.testing.assert_array_equal(found.poses.rows, given.poses.rows)
    # one number with a point: then the comma may be that of thousands
    first, second, *others = text.splitlines()
    cells = second.split(separator)
    cells[3] = cells[3].replace(',', '.')
    path.write_text('\n'.join([first, separator.join(cells), *others]))
    with snapshot.raises(StewartError):
        read_poses(path, HEXAPOD.parameters)


@pytest.mark.parametrize('ignored', ['a;b', 'a\tb', '"a,b"', 'x;y;z'])
def test_a_separator_in_the_header_of_an_ignored_column_separates_nothing(
        ignored: str, table: Path, tmp_path: Path) -> None:
    first, *rows = table.read_text().splitlines()
    path = tmp_path / 'ignored.csv'
    path.write_text('\n'.join([f'{first},{ignored}', *(f'{row},0' for row in rows)]))
    np.testing.assert_array_equal(
        read_poses(path, HEXAPOD.parameters).positions,
        read_poses(table, HEXAPOD.parameters).positions)


@pytest.mark.parametrize('cell', [
    '1_0', '\u0661', '\uff11', '1\u20090', '1 0', '0x1', 'inf', '1e', '.', '\u22121', '"0,5"',
    '1e999'])
def test_what_is_no_plain_number_is_rejected(
        cell: str, table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    first, row, *rows = table.read_text().splitlines()
    path = tmp_path / 'odd.csv'
    path.write_text('\n'.join([first, cell + row[row.index(','):], *rows]))
    with snapshot.raises(StewartError):
        read_poses(path, HEXAPOD.parameters)


@pytest.mark.parametrize('axis', range(3))
def test_poses_of_a_mirrored_frame_are_named(axis: int, table: Path, snapshot: Snapshot) -> None:
    given, platform = read_poses(table, HEXAPOD.parameters), StewartPlatform.from_yaml(PLATFORM)
    mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
    poses = Pose(mirror * given.poses.position, mirror[:, None] * given.poses.rotation * mirror)
    with snapshot.raises(StewartError):
        calibrate(platform, given.positions, poses)


def test_a_hexapod_below_its_base_is_calibrated_if_its_file_says_so(
        table: Path, snapshot: Snapshot) -> None:
    given, p = read_poses(table, HEXAPOD.parameters), Parameters.from_yaml(PLATFORM)
    turn = np.diag([1.0, -1.0, -1.0])
    hanging = StewartPlatform(p.replaced({
        'geometry.platform_side': 'negative',
        'geometry.base_joints': (p['geometry.base_joints'] @ turn).ravel().tolist(),
        'geometry.platform_joints': (p['geometry.platform_joints'] @ turn).ravel().tolist()}))
    poses = Pose(given.poses.position @ turn, turn @ given.poses.rotation @ turn)
    assert not calibrate(hanging, given.positions, poses).likely
    with snapshot.raises(StewartError):
        calibrate(StewartPlatform(hanging.parameters.replaced({
            'geometry.platform_side': 'positive'})), given.positions, poses)


def edited(change: Callable[[list[str]], list[str]], table: Path, tmp_path: Path) -> Path:
    path = tmp_path / 'edited.csv'
    path.write_text('\n'.join(change(table.read_text().splitlines())) + '\n')
    return path


@pytest.mark.parametrize('change', [
    lambda rows: [],
    lambda rows: rows[:1],
    lambda rows: [rows[0].replace('leg_2', 'leg2'), *rows[1:]],
    lambda rows: [rows[0].replace('qw', 'q4'), *rows[1:]],
    lambda rows: [row.partition('q')[0] for row in rows],
    lambda rows: [','.join(f'column_{n}' for n in range(999)), *rows[1:]],
    lambda rows: [*rows[:3], rows[3].replace(',', '\r', 1), *rows[4:]],
    lambda rows: [rows[0].replace('leg_2', 'leg_1'), *rows[1:]],
    lambda rows: [f'{rows[0]},x', *(f'{row},1' for row in rows[1:])],
    lambda rows: [*rows[:3], rows[3] + ',1', *rows[4:]],
    lambda rows: [*rows[:3], 'nan' + rows[3][rows[3].index(','):], *rows[4:]],
    lambda rows: [*rows[:3], '0,5' + rows[3][rows[3].index(','):], *rows[4:]],
    lambda rows: [*rows[:3], 'long' + rows[3][rows[3].index(','):], *rows[4:]],
    lambda rows: [*rows[:3], rows[3].rpartition(',')[0] + ',3.0', *rows[4:]]])
def test_bad_files_are_rejected_in_one_line(
        change: Callable[[list[str]], list[str]], table: Path, tmp_path: Path,
        snapshot: Snapshot) -> None:
    path = edited(change, table, tmp_path)
    output = tmp_path / 'out'
    error = call(main, path, '--params', PLATFORM, '--output', output, code=2).err
    snapshot(error)
    assert error.count('\n') == 1 and not output.exists()


def test_other_bad_input(table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    (tmp_path / 'binary').write_bytes(b'\xff\x00' * 99)
    for path in (tmp_path / 'missing.csv', tmp_path, tmp_path / 'binary', Path('/dev/zero')):
        error = call(main, path, '--params', PLATFORM, code=2).err
        assert 'cannot be read' in error and error.count('\n') == 1
    for option in (['--fixed', ','], ['--noise', '1', '2'], ['--hold-out', '0.9'],
                   ['--frames', 'other'], []):
        call(main, *([str(table)] if option else []), '--params', PLATFORM, *option, code=2)
    snapshot(call(main, table, '--params', PLATFORM, '--fixed', 'leg_7', code=2).err)
    snapshot(call(main, table, '--params', PLATFORM, '--mm', code=2).err)


@pytest.mark.parametrize('in_mm', [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize('given', [[], ['--mm'], ['--mm-positions'], ['--mm-legs']])
def test_the_advice_on_units_leads_to_a_result(
        in_mm: tuple[bool, bool], given: list[str], table: Path, tmp_path: Path) -> None:
    """A tracker in mm with legs in m, and all others: the named option is the right one."""
    measured = read_poses(table, HEXAPOD.parameters)
    positions, lengths = (1e3 * each if mm else each for each, mm in zip(
        (measured.poses.position, measured.positions), in_mm, strict=True))
    path = tmp_path / 'poses.csv'
    path.write_text(poses_csv(JOINTS, lengths, Pose(positions, measured.poses.rotation)))
    arguments = [str(path), '--params', str(PLATFORM), '--output', str(tmp_path / 'out'),
                 '--no-report']
    right = {(False, False): [], (True, True): ['--mm'], (True, False): ['--mm-positions'],
             (False, True): ['--mm-legs']}[in_mm]
    error = call(main, *arguments, *given, code=0 if given == right else 2).err
    if given != right:
        advice = error.split(': ')[-1]
        assert advice.startswith(f'without {given[0]} ' if not right else right[0] + (
            ' in place of ' if given else ' reads them so')), error
        call(main, *arguments, *right)
    assert json.loads((tmp_path / 'out' / 'calibration.json').read_text())['options'][
        'millimeters'] == {'positions': in_mm[0], 'legs': in_mm[1]}


def test_a_bag_in_mm_is_read_so(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    values, poses = true_values(rng), random_poses(rng, 12)
    lengths, seen = measured(rng, values, poses)
    folder = write_bag(tmp_path / 'bag', rng, lengths, Pose(
        1e3 * seen.position, seen.rotation), '/joint_states')
    arguments = [str(folder), '--params', str(PLATFORM), '--output', str(tmp_path / 'out'),
                 '--no-report']
    call(main, *arguments, code=2)
    call(main, *arguments, '--mm-positions')


def test_positions_of_drives_are_an_option(
        table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    file = tmp_path / 'universal.yaml'
    HEXAPOD.parameters.replaced(UNIVERSAL).to_yaml(file)
    arguments = [str(table), '--drive-positions', '--output', str(tmp_path / 'out')]
    snapshot(call(main, *arguments, '--params', PLATFORM, code=2).err)
    out = call(main, *arguments, '--params', file, '--strict', code=1).out
    assert 'LACK OF FIT: positions follow the turns of the legs' in out
    result = json.loads((tmp_path / 'out' / 'calibration.json').read_text())
    assert result['options']['drive_positions'] and result['lack_of_fit']['cause'] == 'turns'
    assert all(each['interval'] is None for each in result['parameters'])


def test_frames_of_a_device_are_on_the_page_and_in_the_files(
        table: Path, tmp_path: Path) -> None:
    given = read_poses(table, HEXAPOD.parameters)
    camera = Pose([1.5, -0.4, 0.7], from_euler([0.3, -0.2, 1.0]))
    target = Pose([0.05, 0.02, 0.1], from_euler([0.1, 0.2, -0.3]))
    seen = camera.rotation @ given.poses.rotation
    file, out = tmp_path / 'camera.csv', tmp_path / 'out'
    file.write_text(poses_csv(JOINTS, given.positions, Pose(
        given.poses.position @ camera.rotation.T + camera.position + seen @ target.position,
        seen @ target.rotation)))
    shown = call(main, file, '--frames', 'unknown', '--params', PLATFORM, '--output', out).out
    frames = json.loads((out / 'calibration.json').read_text())['frames']
    place = -camera.rotation.T @ camera.position
    for key, expected in (('device_in_base', place), ('target_in_platform', target.position)):
        # the joints that define both frames are about a millimeter off
        assert np.linalg.norm(np.array(frames[key]['position_m']) - expected) < 3e-3
    page = (out / 'report.html').read_text()
    number = f'{frames["device_in_base"]["position_m"][0]:.6g}'
    assert all('Device in the base frame' in each and number in each for each in (page, shown))


def test_degrees_read_as_radians_are_named(
        table: Path, tmp_path: Path, snapshot: Snapshot) -> None:
    rng = np.random.default_rng(2)
    angles = rng.uniform(-0.3, 0.3, (40, 3))
    home = random_poses(rng, 40)
    lengths, seen = measured(rng, true_values(rng), Pose(home.position, from_euler(angles)))
    path = tmp_path / 'degrees.csv'
    rows = np.concatenate([lengths, seen.position, np.degrees(angles)], axis=1)
    path.write_text('\n'.join([','.join([*JOINTS, 'x', 'y', 'z', 'alpha', 'beta', 'gamma']), *(
        ','.join(map(repr, row)) for row in rows.tolist())]))
    with snapshot.raises(StewartError):
        run(read_poses(path, HEXAPOD.parameters), str(path), HEXAPOD.parameters, tmp_path / 'out',
            CalibrationOptions())
    call(main, path, '--params', PLATFORM, '--degrees', '--output', tmp_path / 'out')


@pytest.mark.parametrize(('value', 'error', 'text'), [
    (0.5, 3e-4, '0.5000'), (0.879076396422, 1e-13, '0.879076396'), (-4e-10, 1e-13, '-4.0000e-10'),
    (1.23456789e-6, 1e-21, '1.234567890e-06')])
def test_tables_have_no_more_digits_than_mean_something(
        value: float, error: float, text: str) -> None:
    assert rounded(value, error) == text


def write_bag(folder: Path, rng: np.random.Generator, lengths: np.ndarray, seen: Pose,
              *leg_topics: str, joints: Sequence[str] = JOINTS) -> Path:
    """Write a bag of a platform that stops in each pose; legs at 100 Hz, a tracker at 20 Hz."""
    n, tick = np.divmod(np.arange(100 * len(lengths)), 100)
    # A second for each pose, of which 0.3 s lead to the next one.
    stamps = SECOND + 10 * MS * np.arange(len(n))
    part = np.maximum(0.0, (tick - 70) / 30.0)[:, None]
    following = np.minimum(n + 1, len(lengths) - 1)
    noise = 1e-6 * rng.normal(size=(len(n), 6))
    rows = lengths[n] + part * (lengths[following] - lengths[n]) + noise
    positions = seen.position[n] + part * (seen.position[following] - seen.position[n])
    turns = np.where(tick % 2, 1.0, -1.0)[:, None] * seen.quaternion[n]  # the same rotation
    poser = StampedWriter('tracker', 7)
    of = [each for topic in leg_topics
          for each in leg_states(stamps, joints, rows, None, None, topic)]
    of += [('/tracker', stamp, poser.write(stamp, row)) for stamp, row in zip(
        stamps[::5].tolist(), np.hstack([positions, turns])[::5].tolist(), strict=True)]
    return messages.write_bag(folder, of, tracker=messages.POSE, **dict.fromkeys(
        (topic.rpartition('/')[2] for topic in leg_topics), messages.JOINT_STATE))


def test_poses_of_a_bag_at_rest(tmp_path: Path, snapshot: Snapshot) -> None:
    rng = np.random.default_rng(3)
    values, poses = true_values(rng), random_poses(rng, 30)
    folder = write_bag(tmp_path / 'bag', rng, *measured(rng, values, poses), '/joint_states')
    output = tmp_path / 'out'
    call(main, folder, '--params', PLATFORM, '--output', output)
    result = json.loads((output / 'calibration.json').read_text())
    assert result['poses'] == {
        'source': str(folder), 'legs': '/joint_states', 'pose': '/tracker', 'read': 30,
        'used': 30, 'notices': [WITHOUT_CHECKSUMS]}
    found = np.array([each['value'] for each in result['parameters']])
    assert np.abs(found - values[:42]).max() < 1e-4
    snapshot(call(main, folder, '--params', PLATFORM, '--pose', '/other', code=2).err)


@pytest.mark.parametrize(('names', 'measured_legs'), [
    (['~/leg_states'], False), (['~/leg_states', '~/joint_states', '~/motor_states'], False),
    (['~/leg_states', '/robot/legs'], True), (['~/leg_states', '~/measured_legs'], True)])
def test_legs_are_the_commanded_ones_only_where_none_are_measured(
        names: list[str], measured_legs: bool, tmp_path: Path) -> None:
    topics = [name.replace('~', NODE) for name in names]
    rng = np.random.default_rng(4)
    seen = measured(rng, true_values(rng), random_poses(rng, 2))
    found, missing = read_bag(write_bag(tmp_path / 'bag', rng, *seen, *topics),
                              HEXAPOD.parameters, NODE, None, None)
    assert missing == []
    assert found.topics == (topics[-1] if measured_legs else topics[0], '/tracker')
    assert found.notices == (WITHOUT_CHECKSUMS, *([] if measured_legs else [
        f'{NODE}/leg_states: the commanded positions of the legs, not measured ones']))


def test_bags_without_legs_or_poses_are_rejected(tmp_path: Path, snapshot: Snapshot) -> None:
    rng = np.random.default_rng(4)
    seen = measured(rng, true_values(rng), random_poses(rng, 2))
    others = write_bag(tmp_path / 'others', rng, *seen, '/legs', joints=['a', *JOINTS[1:]])
    with snapshot.raises(BagError):
        read_bag(others, HEXAPOD.parameters, NODE, None, None)
    poser = write_bag(tmp_path / 'joints', rng, *seen, f'{NODE}/joint_states')
    with snapshot.raises(BagError):
        read_bag(poser, HEXAPOD.parameters, NODE, None, None)
    legs = recorded.write_bag(
        tmp_path / 'legs', Recorded(np.zeros(1), np.zeros((1, 6)), None, np.zeros((1, 6))), JOINTS)
    with snapshot.raises(BagError):
        read_bag(legs, HEXAPOD.parameters, NODE, None, None)


@pytest.mark.parametrize('significant', [False, True])
def test_arrows_have_one_scale_and_none_show_noise(significant: bool) -> None:
    rng = np.random.default_rng(6)
    true = values_of(LEGS)
    true[0] += 1e-3 * significant  # a base joint
    found = calibrate(HEXAPOD, *measured(rng, true, random_poses(rng, 40), NOISE))
    times = _arrow_scale(found)
    assert (times > 0.0) == significant
    for part in (BASE, PLATFORM_JOINTS):
        view = _view(found, part, 'Joints', times)
        assert ('times as long' in view) == significant
        assert view.count('class="edge') == 6 * significant
        moved = (found.values - found.start)[part].reshape(6, 3)[:, :2]
        assert times * np.linalg.norm(moved, axis=1).max() < 0.5


def test_tables_name_their_column_and_have_no_negative_zero() -> None:
    row = estimate('platform.mass', 'kg', 5.0, 5.0 - 1e-4, 'identified', 0.1, 0.0, False, True)
    assert table_lines([row], 'calibrated')[0].split()[:3] == ['parameter', 'file', 'calibrated']
    assert str(row.change) == '0.0'


def test_a_design_identifies_better_than_random_poses(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, snapshot: Snapshot) -> None:
    found = design_poses(HEXAPOD, 24, seed=1)
    assert (found.half_widths < found.random_half_widths).all()
    # The prediction is that of a fit to such poses.
    rng = np.random.default_rng(5)
    seen = measured(rng, values_of(LEGS), found.poses, NOISE)
    fitted = fit(Equations(LEGS, *seen), Unknowns.of(
        LEGS, values_of(LEGS), HEXAPOD.parameters['singularity.characteristic_length'],
        np.zeros(42, dtype=bool), False), NOISE)
    errors = 1.959964 * np.sqrt(np.diag(fitted.covariance))[:42]
    np.testing.assert_allclose(errors, found.half_widths, rtol=0.01)
    monkeypatch.chdir(tmp_path)
    out = call(main, '--design', '8', '--params', PLATFORM, '--output', 'calibrated', '--rest',
               '1').out
    assert 'designed  random poses' in out
    poses = read_poses(tmp_path / 'calibrated' / 'poses.csv', HEXAPOD.parameters)
    limits = HEXAPOD.parameters
    lengths = HEXAPOD.inverse_kinematics(poses.poses)
    assert (lengths > limits['limits.length_min']).all()
    assert (lengths < limits['limits.length_max']).all()
    np.testing.assert_allclose(lengths - 0.95, poses.positions, atol=1e-12)
    table = np.loadtxt(tmp_path / 'calibrated' / 'trajectory.csv', delimiter=',', skiprows=1)
    motion = Motion(table[:, 1:4], Pose.from_quaternion(table[:, 1:4], table[:, 4:8]).rotation,
                    *(table[:, n:n + 3] for n in range(8, 20, 3)))
    np.testing.assert_allclose(
        read_setpoints(tmp_path / 'calibrated' / 'trajectory.csv').motion.rows, motion.rows,
        atol=1e-12)
    result = check_planned_trajectory(HEXAPOD, table[:, 0], motion)
    assert result.accepted, result.message
    for position in poses.poses.position:
        still = np.abs(table[:, 1:4] - position).max(axis=1) < 1e-9
        assert np.ptp(table[still, 0]) > 0.99
    snapshot(call(main, '--design', '7', '--params', PLATFORM, code=2).err)
    with snapshot.raises(ParameterError):
        design_poses(StewartPlatform(HEXAPOD.parameters.replaced(
            {'limits.length_min': None, 'limits.length_max': None})), 10)
