# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The report of motion cueing: recordings, figures, tuned gains and exit codes."""

from __future__ import annotations

from itertools import count
import json
from pathlib import Path
import sys
from typing import Any

from messages import SECOND, write_bag
import numpy as np
from programs import call
import pytest
from referees import PLATFORM, ROOT
from snapshot import Snapshot
from stewart_dynamics import MotionCueing, Parameters
from stewart_dynamics.cueing.motion_cueing import AXES, OMCT_FREQUENCIES
from stewart_dynamics.cueing.recorded_vehicle import read_vehicle
from stewart_dynamics.cueing.report import measured_response
from stewart_dynamics.cueing.report_command_line import main
from stewart_dynamics.datasheet import main as capability
from stewart_dynamics.errors import StewartError
from stewart_dynamics.messages.setpoint import ImuWriter

sys.path.insert(0, str(ROOT / 'examples'))
from town_drive import drive, GRAVITY, write_csv  # noqa: E402, I100, I202


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """Return the drive through town as a CSV file."""
    write_csv(tmp_path / 'town.csv')
    return tmp_path / 'town.csv'


def bag_of_imu(folder: Path, stamped: bool = True) -> Path:
    """Write the drive as a bag; one message is not finite."""
    times, forces, rates = drive()
    writer = ImuWriter('driver', 0.0, 0.0)
    forces[7] = np.nan
    return write_bag(folder, (
        ('/car/imu', stamp, writer.write(stamp * stamped, rate, force))
        for stamp, rate, force in zip(
            (10 * SECOND + np.rint(1e9 * times).astype(np.int64)).tolist(), rates.tolist(),
            forces.tolist(), strict=True)))


def result_of(folder: Path) -> dict[str, Any]:
    """Return the content of cueing.json."""
    found: dict[str, Any] = json.loads((folder / 'cueing.json').read_text(encoding='utf-8'))
    return found


def test_report_of_a_drive(town: Path, tmp_path: Path) -> None:
    """Figures are those of the library; the motion is taken by stewart_capability."""
    folder = tmp_path / 'out'
    call(main, town, '--params', PLATFORM, '--output', folder)
    found = result_of(folder)
    times, forces, rates = drive()
    motion = MotionCueing(PLATFORM).run(times, forces, rates)
    home = MotionCueing(PLATFORM).governor.home.position
    assert found['travel_m']['x'][1] == pytest.approx((motion.position - home)[:, 0].max())
    assert found['held_back_s'] == {} and found['demand_given'] == 1.0
    assert 0.2 < max(found['largest_use'].values()) < 1.0
    assert found['felt_of_wanted']['surge']['correlation'] > 0.4
    page = (folder / 'report.html').read_text(encoding='utf-8')
    assert page.count('<svg') == 13 and 'nan' not in page.lower().replace('nance', '')
    call(capability, '--params', PLATFORM, '--motion', folder / 'motion', '--output',
         tmp_path / 'datasheet')
    datasheet = json.loads((tmp_path / 'datasheet' / 'datasheet.json').read_bytes())
    assert datasheet['motion']['possible'] and datasheet['motion']['samples'] == len(times)


@pytest.mark.slow
def test_tuned_gains_use_the_machine(town: Path, tmp_path: Path) -> None:
    """90 % of a limit, and no more; each gain has its reason; the file has them."""
    folder = tmp_path / 'out'
    call(main, town, '--params', PLATFORM, '--output', folder, '--tune', '--no-report')
    found = result_of(folder)
    assert 0.88 < max(found['largest_use'].values()) <= 0.9 + 1e-6
    assert len(found['tuned']) == 8
    assert all(0.0 <= each['value'] <= 1.0 and each['reason'] for each in found['tuned'])
    limited = [each for each in found['tuned'] if each['value'] < 1.0]
    assert limited and all('90% of length at' in each['reason'] for each in limited)
    tuned = Parameters.from_yaml(folder / 'cueing.yaml')
    assert [tuned[each['name']][each['place']] for each in found['tuned']] == [
        each['value'] for each in found['tuned']]
    assert not (folder / 'report.html').exists()


def test_measured_response_with_cross_terms() -> None:
    """Within 0.1 % and 0.1 degrees of the equations, and nothing else."""
    cueing = MotionCueing(PLATFORM)
    measured, analytic = measured_response(cueing), cueing.response(OMCT_FREQUENCIES)
    cross = cueing.cross_response(OMCT_FREQUENCIES)
    for n, axis in enumerate(AXES):
        for k, other in enumerate(AXES):
            wanted = analytic[axis] if axis == other else cross.get((axis, other))
            if wanted is None:
                assert np.abs(measured[:, n, k]).max() < 5e-3
                continue
            ratio = measured[:, n, k] / wanted
            assert np.abs(np.abs(ratio) - 1.0).max() < 1e-3
            assert np.abs(np.degrees(np.angle(ratio))).max() < 0.1


@pytest.mark.parametrize('stamped', [True, False])
def test_bag_gives_the_same(tmp_path: Path, stamped: bool) -> None:
    """By stamps, or by times of reception; the message that is not finite is counted."""
    vehicle = read_vehicle(bag_of_imu(tmp_path / 'bag', stamped), None)
    times, forces, rates = (np.delete(each, 7, axis=0) for each in drive())
    np.testing.assert_allclose(vehicle.times, times, atol=1e-9)
    assert np.array_equal(vehicle.forces, forces) and np.array_equal(vehicle.rates, rates)
    assert vehicle.notices == ('vehicle: 1 rejected: not finite',)


def test_units_in_brackets(tmp_path: Path) -> None:
    path = tmp_path / 'motion.csv'
    path.write_text('name,wz [deg/s],wx [deg/s],wy [deg/s],az [g],ay [g],ax [g],t [ms]\n'
                    'a,0,0,0,1,0,0,1000\nb,90,0,0,1,0.5,0,1010\n', encoding='utf-8')
    vehicle = read_vehicle(path, None)
    np.testing.assert_allclose(vehicle.times, [0.0, 0.01])
    np.testing.assert_allclose(vehicle.forces[1], [0.0, 0.5 * GRAVITY, GRAVITY])
    np.testing.assert_allclose(vehicle.rates[1], [0.0, 0.0, np.pi / 2.0])


def test_units_are_those_of_other_recordings(tmp_path: Path) -> None:
    """In the spellings that a CSV file of setpoints has, too."""
    path = tmp_path / 'motion.csv'
    path.write_text('T [us],AX [ft/s^2],ay [mm/s2],az [m s^-2],wx [mrad/s],wy [°/s],wz\n'
                    '0,0,0,9.8,0,0,0\n10000,1,1000,9.8,1000,180,1\n', encoding='utf-8')
    vehicle = read_vehicle(path, None)
    np.testing.assert_allclose(vehicle.times, [0.0, 0.01])
    np.testing.assert_allclose(vehicle.forces[1], [0.3048, 1.0, 9.8])
    np.testing.assert_allclose(vehicle.rates[1], [1.0, np.pi, 1.0])


@pytest.mark.parametrize('text', [
    '',
    't,ax,ay\n0,1,2\n',
    't,ax [furlong/s^2],ay,az\n0,1,2,3\n',
    't,ax,ay,az,ax\n0,1,2,3,4\n',
    't,ax,ay,az\n0,1,2,3\n',
    't,ax,ay,az\n0,1,2,3\n0,1,2,3\n',
    't,ax,ay,az\n0,1,2,3\n1,1,x,3\n',
    't,ax,ay,az\n0,1,2,3\n1,1,2\n',
    't,ax,ay,az\n0,1,2,inf\n1,1,2,3\n'], ids=count())
def test_bad_file_is_named(tmp_path: Path, text: str, snapshot: Snapshot) -> None:
    """Exit code 2, one line, and nothing is written."""
    path = tmp_path / 'motion.csv'
    path.write_text(text, encoding='utf-8')
    with snapshot.raises(StewartError):
        read_vehicle(path, None)
    said = call(main, path, '--params', PLATFORM, '--output', tmp_path / 'out', code=2).err
    assert said.count('\n') == 1
    assert not (tmp_path / 'out').exists()


def test_strict_ends_with_1_where_limits_hold_back(tmp_path: Path) -> None:
    """And a possible error in the recording is a warning."""
    times, forces, rates = drive()
    path = tmp_path / 'wild.csv'
    forces[500:600, 0] += 40.0
    np.savetxt(path, np.column_stack([times, forces / GRAVITY]), delimiter=',', comments='',
               header='t,ax [g],ay [g],az [g]')
    arguments = [str(path), '--params', str(PLATFORM), '--output', str(tmp_path / 'out'),
                 '--no-report']
    call(main, *arguments, '--strict', code=1)
    assert result_of(tmp_path / 'out')['held_back_s']
    call(main, *arguments, code=2)  # results exist
    np.savetxt(path, np.column_stack([times, forces / GRAVITY]), delimiter=',', comments='',
               header='t,ax,ay,az')
    assert 'in g, must be in m/s^2' in call(main, *arguments, '--force').err


@pytest.mark.parametrize('wrong', [True, False])
def test_gains_are_not_proposed_from_a_recording_with_a_possible_error(
        tmp_path: Path, wrong: bool) -> None:
    """A vehicle in motion from the first sample on, without gravity."""
    times = np.arange(0.0, 30.0, 1.0 / 60.0)
    rows = np.column_stack([
        times, 2.0 * np.sin(0.8 * times), 3.0 * np.sin(0.5 * times),
        GRAVITY * (not wrong) + 0.5 * np.sin(3.0 * times)])
    np.savetxt(tmp_path / 'drive.csv', rows, delimiter=',', header='t,ax,ay,az', comments='')
    err = call(main, tmp_path / 'drive.csv', '--params', PLATFORM, '--tune', '--strict',
               '--no-report', '--output', tmp_path / 'out', code=int(wrong)).err
    found = result_of(tmp_path / 'out')
    assert bool(found['tuned']) != wrong
    assert ('without gravity' in found['likely_mistake']) == wrong
    assert ('no gains are proposed' in err) == wrong


@pytest.mark.parametrize('times, text', [
    ([0.0, 0.1, 500.1, 500.2], '500 s without a sample, 0.1 s after the first one'),
    (5.0 * np.arange(10), '0.2 samples a second: must be at least 1')])
def test_recordings_with_long_gaps_are_rejected(
        tmp_path: Path, times: Any, text: str) -> None:
    rows = np.column_stack([times, np.zeros((len(times), 2)), np.full(len(times), GRAVITY)])
    np.savetxt(tmp_path / 'gaps.csv', rows, delimiter=',', header='t,ax,ay,az', comments='')
    with pytest.raises(StewartError, match=text):
        read_vehicle(tmp_path / 'gaps.csv', None)
