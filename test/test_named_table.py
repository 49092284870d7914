# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The one reader of tables: names, units, separators, lost samples; the same in all programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from programs import call
import pytest
from referees import ROOT
from snapshot import Snapshot

from stewart_dynamics import BagError, read_setpoints, StewartPlatform
from stewart_dynamics.calibration.calibrate_command_line import main as calibrate
from stewart_dynamics.calibration.measured_poses import read_poses
from stewart_dynamics.cueing.recorded_vehicle import read_vehicle
from stewart_dynamics.cueing.report_command_line import main as report
from stewart_dynamics.datasheet.datasheet_command_line import main as capability
from stewart_dynamics.replay import main as replay
from stewart_dynamics.tables.column_names import (
    ACCELERATION, ANGLES, ANGULAR_VELOCITY, MOTION, POSITION, QUATERNION, si_factor, TIME,
    VELOCITY)
from stewart_dynamics.tables.named_table import NamedTable
from stewart_dynamics.tables.reading import Reading

PROGRAM = 'stewart_replay'
PARAMS = ROOT / 'config' / 'platform.yaml'
HEXAPOD = StewartPlatform.from_yaml(PARAMS).parameters
JOINTS = HEXAPOD.joints


def read(path: Path, text: str, **options: object) -> NamedTable:
    path.write_text(text)
    return NamedTable(path, MOTION, Reading(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize(('heading', 'factor'), [
    ('roll [deg]', np.radians(1.0)), ('Roll (deg)', np.radians(1.0)),
    ('ROLL (Degrees)', np.radians(1.0)), ('roll / deg', np.radians(1.0)),
    ('roll_deg', np.radians(1.0)), ('alpha [°]', np.radians(1.0)), ('Alpha', 1.0),
    ('roll [mrad]', 1e-3), ('roll [DEG]', np.radians(1.0))])
def test_an_angle_has_its_unit_however_it_is_written(
        heading: str, factor: float, tmp_path: Path) -> None:
    table = read(tmp_path / 'a.csv', f't,x,y,z,{heading},pitch,yaw\n0,0,0,1,2,0,0\n')
    assert table.values(ANGLES)[0, 0] == pytest.approx(2.0 * factor)
    assert not table.notices


@pytest.mark.parametrize(('quantity', 'unit', 'factor'), [
    (POSITION, 'Millimeters', 1e-3), (POSITION, 'inches', 0.0254), (POSITION, 'M', 1.0),
    (TIME, 'Seconds', 1.0), (TIME, 'msec', 1e-3), (VELOCITY, 'mm/sec', 1e-3),
    (VELOCITY, 'm_s', 1.0), (ANGULAR_VELOCITY, 'dps', np.radians(1.0)),
    (ANGULAR_VELOCITY, 'Deg/s', np.radians(1.0)), (ANGULAR_VELOCITY, 'rpm', np.pi / 30.0),
    (ACCELERATION, 'm·s⁻²', 1.0), (ACCELERATION, 'm.s-2', 1.0), (ACCELERATION, 'G', 9.80665),
    (ACCELERATION, 'mm_s2', 1e-3),
    # A capital M is a million, not a thousandth.
    (POSITION, 'Mm', None), (POSITION, 'MM', None), (ANGLES, 'Mrad', None), (TIME, 'Ms', None),
    (ACCELERATION, 'Mg', None), (VELOCITY, 'Mm/s', None), (POSITION, 'deg', None)])
def test_units(quantity: object, unit: str, factor: float | None) -> None:
    assert si_factor(quantity, unit) == factor  # type: ignore[arg-type]


@pytest.mark.parametrize('names', [
    'time,x,y,z', 'Time (Seconds),X,Y,Z', 'timestamps,tx,ty,tz', 'timestamp,pos_x,pos_y,pos_z',
    'time_s,position_x_m,position_y_m,position_z_m', '%time,Position.X,Position.Y,Position.Z',
    't,surge,sway,heave'])
def test_other_names(names: str, tmp_path: Path) -> None:
    table = read(tmp_path / 'a.csv', f'{names}\n1,2,3,4\n2,2,3,4\n')
    assert table.times().tolist() == [1.0, 2.0]
    assert table.values(POSITION).tolist() == [[2.0, 3.0, 4.0]] * 2


def test_the_name_itself_comes_before_other_names(tmp_path: Path) -> None:
    table = read(tmp_path / 'a.csv', 'stamp_ns,time_s,x,y,z,pos_x\n9,1,2,3,4,5\n')
    assert table.values(TIME)[0, 0] == 1.0 and table.values(POSITION)[0, 0] == 2.0
    assert table.notices == ['columns that are not read: stamp_ns, pos_x']


@pytest.mark.parametrize(('name', 'text'), [
    ('a.csv', 't,x,y,z\n0,1,2,3\n1,1,2,3\n'), ('a.tsv', 't\tx\ty\tz\n0\t1\t2\t3\n1\t1\t2\t3\n'),
    ('a.txt', 't x y z\n0 1 2 3\n1 1 2 3\n'), ('a.TXT', '# t tx ty tz\n0 1 2 3\n1 1 2 3\n'),
    ('a.csv', 't;x;y;z\n0;1;2,0;3\n1;1;2,0;3\n'),
    ('a.txt', '  t   x  y [m] z\n 0 1 2 3\n 1 1 2 3'),
    ('a.csv', 't,x,y,z\n(s),(mm),(m),(m)\n0,1000,2,3\n1,1000,2,3\n'),
    ('a.txt', 'Time PtfmSurge\nsome text of a program\n\nt x y z\n(s) (m) (m) (m)\n'
     '0 1 2 3\n1 1 2 3\n'),
    ('a.csv', '\ufeff# by a logger\r\nt,x,y,z,\r\n0,1,2,3,\r\n1,1,2,3,\r\n')])
def test_separators_comments_and_a_row_of_units(name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text)
    found = read_setpoints(path)
    assert found.motion.position.tolist() == [[1.0, 2.0, 3.0]] * 2
    assert found.times.tolist() == [0.0, 1.0]


def test_columns_by_their_headings(tmp_path: Path) -> None:
    text = ('Zeit,PtfmSurge,b,c,PtfmRoll,"angle, about y (deg)",d\n'
            '0,1,2,3,30,0,0\n1,1,2,3,30,0,0\n')
    chosen = {'t': 'Zeit', 'x': 'PtfmSurge [mm]', 'y': 'b', 'z': 'c', 'roll': 'PtfmRoll [deg]',
              'pitch': 'angle, about y', 'yaw': 'd'}
    table = read(tmp_path / 'a.csv', text, columns=chosen)
    assert table.times().tolist() == [0.0, 1.0]
    assert table.values(POSITION)[0].tolist() == [1e-3, 2.0, 3.0]
    assert table.values(ANGLES)[0].tolist() == [pytest.approx(np.pi / 6.0), 0.0, 0.0]
    option = ','.join(f'{name}={heading}' for name, heading in chosen.items())
    assert replay([str(tmp_path / 'a.csv'), '--columns', option, '--params', str(PARAMS),
                   '--output', str(tmp_path / 'r'), '--no-report', '--differentiate']) in (0, 3)


def test_a_selected_column_is_read_in_place_of_one_of_that_name(tmp_path: Path) -> None:
    table = read(tmp_path / 'a.csv', 't,x,y,z,other\n0,1,2,3,9\n', columns={'x': 'other'})
    assert table.values(POSITION)[0].tolist() == [9.0, 2.0, 3.0]


@pytest.mark.parametrize('columns', [
    {'X': 'x'}, {'x': 'here'}, {'x': 'twice'}, {'x': 'y', 'y': 'y'}, {'x': 'x [Mm]'}])
def test_columns_that_are_not_there(
        columns: dict[str, str], tmp_path: Path, snapshot: Snapshot) -> None:
    with snapshot.raises(BagError):
        read(tmp_path / 'a.csv', 't,x,y,z,twice,twice\n0,1,2,3,4,5\n', columns=columns)


@pytest.mark.parametrize('option', ['x', 'x=', '=x', 'x=a,x=b', ''])
def test_an_option_that_names_no_columns(option: str, tmp_path: Path) -> None:
    error = call(replay, 'a.csv', '--params', PARAMS, '--columns', option, code=2).err
    assert 'must be a name, = and a heading' in error


def test_a_row_with_an_empty_cell_is_a_lost_sample(tmp_path: Path) -> None:
    path = tmp_path / 'a.csv'
    path.write_text('t,x,y,z,qx,qy,qz,qw,note\n0,0,0,1,0,0,0,1,a\n1,,,,,,,,\n'
                    '2,0,0,1,0,0,0,1,\n3,0,0,,0,0,0,1,b\n4,0,0,1,0,0,0,1,c\n')
    found = read_setpoints(path)
    assert found.times.tolist() == [0.0, 2.0, 4.0]
    table = NamedTable(path, MOTION)
    assert table.lines == [2, 4, 6]
    assert table.notices[-1] == '2 of 5 rows are left out: lost samples, with empty cells'
    path.write_text('t,ax,ay,az\n0,0,0,9.8\n0.1,,0,9.8\n0.2,0,0,9.8\n')
    vehicle = read_vehicle(path, None)
    assert vehicle.times.tolist() == [0.0, 0.2] and 'lost samples' in vehicle.notices[0]
    rows = [','.join(['0.1'] * 6 + ['0', '0', '1', '0', '0', '0', '1' if n != 3 else ''])
            for n in range(6)]
    names = ','.join((*JOINTS, *POSITION.columns, *QUATERNION.columns))
    path.write_text('\n'.join([names, *rows]))
    poses = read_poses(path, HEXAPOD)
    assert poses.names == ('row 2', 'row 3', 'row 4', 'row 6', 'row 7')


def test_a_time_must_not_be_empty(tmp_path: Path, snapshot: Snapshot) -> None:
    with snapshot.raises(BagError):
        read(tmp_path / 'a.csv', 't,x,y,z\n0,1,2,3\n,1,2,3\n').times()


@pytest.mark.parametrize('names', ['PtfmRoll,PtfmPitch,PtfmYaw', 'Rot X,Rot Y,Rot Z',
                                   'quat0,quat1,quat2'])
def test_columns_that_may_be_a_rotation_are_not_ignored(
        names: str, tmp_path: Path, snapshot: Snapshot) -> None:
    with snapshot.raises(BagError):
        read(tmp_path / 'a.csv', f't,x,y,z,{names}\n0,1,2,3,0,0,0\n')


@pytest.mark.parametrize('names', ['gyrX,gyrY,gyrZ', 'RollRate,PitchRate,YawRate'])
def test_rates_of_a_vehicle_are_not_ignored(
        names: str, tmp_path: Path, snapshot: Snapshot) -> None:
    path = tmp_path / 'a.csv'
    path.write_text(f't,ax,ay,az,{names}\n0,0,0,9.8,1,2,3\n1,0,0,9.8,1,2,3\n')
    with snapshot.raises(BagError):
        read_vehicle(path, None)


def test_times_in_ms_without_a_unit_are_noticed(tmp_path: Path, snapshot: Snapshot) -> None:
    text = 'Time,x,y,z\n' + ''.join(f'{10 * n},0,0,1\n' for n in range(20))
    table = read(tmp_path / 'a.csv', text)
    assert table.times()[1] == 10.0
    snapshot(table.notices[0])
    table = read(tmp_path / 'a.csv', text, columns={'t': 'Time [ms]'})
    assert table.times()[1] == 0.01 and not table.notices


def test_all_programs_take_the_same_options() -> None:
    for program in (replay, capability, calibrate, report):
        text = call(program, '--help').out
        assert all(option in text for option in ('--columns', '--axes', '--euler', '--child'))


def test_the_vehicle_of_another_source_is_read_in_the_axes_of_the_head(tmp_path: Path) -> None:
    path = tmp_path / 'vehicle.txt'  # x forward, y right, z down
    path.write_text('Time (Seconds);acc_x (g);acc_y (g);acc_z (g);gyro_x (dps);gyro_y (dps);'
                    'gyro_z (dps)\n0;0,1;0,2;-1,0;1;2;3\n0,5;0,1;0,2;-1,0;1;2;3\n')
    found = read_vehicle(path, None, Reading(axes='x,-y,-z'))
    np.testing.assert_allclose(found.forces[0], 9.80665 * np.array([0.1, -0.2, 1.0]))
    np.testing.assert_allclose(found.rates[0], np.radians([1.0, -2.0, -3.0]))
