# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Exports of optical trackers: layouts of Motive, QTM and Vicon, written here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from referees import ROOT
from scipy.spatial.transform import Rotation
from snapshot import Snapshot

from stewart_dynamics import BagError, Motion, read_setpoints
from stewart_dynamics.program import AXES
from stewart_dynamics.replay import main as replay

PROGRAM = 'stewart_replay'
Array = NDArray[np.float64]

PARAMS = ROOT / 'config' / 'platform.yaml'
RATE = 100.0
TIMES = np.arange(200) / RATE
LOST = slice(40, 45)
# Base axes, z up, in those of Motive, y up: base (x, y, z) = Motive (x, -z, y).
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def motion() -> Motion:
    """Return a motion of all six coordinates, z up."""
    w = 2.0 * np.pi * np.array([0.5, 0.7, 0.4, 0.6, 0.8, 0.3])
    x = 0.1 * np.sin(w * TIMES[:, None] + np.arange(6))
    x[:, 2] += 1.1
    return Motion.from_euler(x[:, :3], x[:, 3:])


MOTION = motion()


def lines(*columns: Array, separator: str = ',', lost: str | None = '') -> list[list[str]]:
    """Return the cells of each frame; those of lost frames are ``lost``."""
    rows = [[f'{value:.9f}' for value in row] for row in np.column_stack(columns).tolist()]
    if lost is not None:
        rows[LOST] = [[lost] * len(row) for row in rows[LOST]]
    return rows


def motive(path: Path, names: tuple[str, ...] = ('Platform',), euler: str = 'Quaternion',
           unit: str = 'Millimeters') -> Path:
    """Write a CSV file as Motive 2 and 3 export: rigid bodies and one of their markers."""
    scale = {'Millimeters': 1e3, 'Meters': 1.0}[unit]
    turns = Rotation.from_matrix(Y_UP.T @ MOTION.rotation @ Y_UP)
    angles = turns.as_quat() if euler == 'Quaternion' else np.degrees(turns.as_euler(euler))[
        :, [euler.index(each) for each in 'XYZ']]
    kinds = ['Rotation'] * angles.shape[1] + ['Position'] * 3 + ['Mean Marker Error']
    axes = [*'XYZW'[:angles.shape[1]], *'XYZ', '']
    cells = lines(angles, scale * MOTION.position @ Y_UP, 1e-4 * np.ones((len(TIMES), 1)))
    width = len(kinds)
    marker = [f'{names[0]}:Marker1'] * 3
    text = [
        'Format Version,1.23,Take Name,take,Take Notes,,Capture Frame Rate,100.000000,'
        'Export Frame Rate,100.000000,Capture Start Time,2026-11-01 10.00.00.000 AM,'
        'Total Frames in Take,200,Total Exported Frames,200,'
        f'Rotation Type,{euler},Length Units,{unit},Coordinate Space,Global', '',
        ',Type,' + ','.join(['Rigid Body'] * width * len(names) + ['Rigid Body Marker'] * 3),
        ',Name,' + ','.join([name for name in names for _ in kinds] + marker),
        ',ID,' + ','.join(['"9E20"'] * (width * len(names) + 3)),
        ',,' + ','.join(kinds * len(names) + ['Position'] * 3),
        'Frame,Time (Seconds),' + ','.join(axes * len(names) + list('XYZ'))]
    text += [','.join([str(n), f'{TIMES[n]:.6f}', *row * len(names), '1', '2', '3'])
             for n, row in enumerate(cells)]
    path.write_text('\r\n'.join(text) + '\r\n')
    return path


def qtm(path: Path, names: tuple[str, ...] = ('Platform',), timed: bool = True,
        matrix: bool = True, mark: str = '.') -> Path:
    """Write a TSV file as QTM exports 6D data; bodies that are not tracked are zero."""
    turns = Rotation.from_matrix(MOTION.rotation.copy())
    columns = ['X', 'Y', 'Z', 'Roll', 'Pitch', 'Yaw', 'Residual', *(
        f'Rot[{n}]' for n in range(9) if matrix)]
    parts = [1e3 * MOTION.position, np.degrees(turns.as_euler('XYZ')), np.ones((len(TIMES), 1))]
    if matrix:
        parts.append(np.swapaxes(MOTION.rotation, 1, 2).reshape(-1, 9))
    cells = lines(*parts, lost='0.00000')
    heads = [f'{name} {each}' if n == 0 else each for name in names
             for n, each in enumerate(columns)]
    text = ['NO_OF_FRAMES\t200', 'NO_OF_CAMERAS\t4', f'NO_OF_BODIES\t{len(names)}',
            'FREQUENCY\t100', 'NO_OF_ANALOG\t0', 'ANALOG_FREQUENCY\t0', 'DESCRIPTION\t--',
            'TIME_STAMP\t2026-11-01, 10:00:00\t22107.99179716', 'DATA_INCLUDED\t6D',
            '\t'.join(['BODY_NAMES', *names]),
            '\t'.join([*(['Frame', 'Time'] if timed else []), *heads]) + '\t']
    text += ['\t'.join([*([str(n + 1), f'{TIMES[n]:.5f}'] if timed else []), *row * len(names)])
             .replace('.', mark) + '\t' for n, row in enumerate(cells)]
    path.write_text('\r\n'.join(text) + '\r\n')
    return path


def vicon(path: Path, names: tuple[str, ...] = ('Platform',), quaternions: bool = False,
          kind: str = 'Objects') -> Path:
    """Write a CSV file as Tracker (Objects) and Nexus (Segments) export."""
    turns = Rotation.from_matrix(MOTION.rotation.copy())
    degrees = kind == 'Segments'
    parts = turns.as_quat() if quaternions else turns.as_rotvec()
    angle = '' if quaternions else 'deg' if degrees else 'rad'
    cells = lines(np.degrees(parts) if degrees and not quaternions else parts,
                  1e3 * MOTION.position)
    heads = ['RX', 'RY', 'RZ', *(['RW'] if quaternions else []), 'TX', 'TY', 'TZ']
    units = [*([angle] * parts.shape[1]), 'mm', 'mm', 'mm']
    label = {'Objects': f'Global Angle {"(Quaternion) " if quaternions else ""}', 'Segments': ''}
    labels = [cell for name in names
              for cell in [f'{label[kind]}{name}:{name}', *[''] * (len(heads) - 1)]]
    text = [kind, '100', ',,' + ','.join(labels),
            'Frame,Sub Frame,' + ','.join(heads * len(names)),
            ',,' + ','.join(units * len(names))]
    # Frames without any object are short.
    text += [','.join([str(n + 1), '0', *(row * len(names) if any(row) else [])])
             for n, row in enumerate(cells)]
    text += ['', 'Trajectories', '100', ',,Platform:M1,,', 'Frame,Sub Frame,X,Y,Z', ',,mm,mm,mm',
             '1,0,1,2,3']
    path.write_text('\n'.join(text) + '\n')
    return path


Writer = Callable[..., Path]
WRITERS = pytest.mark.parametrize(('write', 'name', 'options'), [
    (motive, 'a.csv', {}), (motive, 'a.csv', {'unit': 'Meters'}),
    *((motive, 'a.csv', {'euler': order}) for order in ('XYZ', 'ZYX', 'YXZ')),
    (qtm, 'a.tsv', {}), (qtm, 'a.tsv', {'timed': False}), (qtm, 'a.tsv', {'matrix': False}),
    (qtm, 'a.txt', {'mark': ','}), (vicon, 'a.csv', {}), (vicon, 'a.csv', {'quaternions': True}),
    (vicon, 'a.csv', {'kind': 'Segments'})])


@WRITERS
def test_poses_are_read_in_si_with_z_up_and_without_lost_frames(
        write: Writer, name: str, options: dict[str, object], tmp_path: Path) -> None:
    found = read_setpoints(write(tmp_path / name, **options))
    kept = np.delete(np.arange(len(TIMES)), LOST)
    np.testing.assert_allclose(found.motion.position, MOTION.position[kept], atol=1e-8)
    np.testing.assert_allclose(found.motion.rotation, MOTION.rotation[kept], atol=1e-7)
    np.testing.assert_allclose(found.times, TIMES[kept] - TIMES[kept][0], atol=1e-6)


@pytest.mark.parametrize(('write', 'name'), [
    (motive, 'a.csv'), (qtm, 'a.tsv'), (vicon, 'a.csv')])
def test_one_of_several_bodies_is_selected(
        write: Writer, name: str, tmp_path: Path, snapshot: Snapshot) -> None:
    path = write(tmp_path / name, names=('Base', 'Platform'))
    assert len(read_setpoints(path, child='Platform').times) == len(TIMES) - 5
    for child in (None, 'Other'):
        with snapshot.raises(BagError):
            read_setpoints(path, child=child)


def test_other_axes_than_those_of_the_tracker(tmp_path: Path) -> None:
    found = read_setpoints(motive(tmp_path / 'a.csv'), axes=AXES)
    kept = np.delete(np.arange(len(TIMES)), LOST)
    np.testing.assert_allclose(found.motion.position, (MOTION.position @ Y_UP)[kept], atol=1e-8)


@WRITERS
def test_a_replay_tells_what_is_read(
        write: Writer, name: str, options: dict[str, object], tmp_path: Path,
        snapshot: Snapshot) -> None:
    out = call(replay, write(tmp_path / name, **options), '--params', PARAMS, '--output',
               tmp_path / 'r', '--no-report', '--differentiate').out
    for line in out.splitlines():
        if 'file of ' in line or 'lost' in line:
            snapshot(line)


@pytest.mark.parametrize('change', [
    lambda text: text.replace('Rigid Body,', 'Marker,'),
    lambda text: text.replace('Frame,Time', 'Image,Time'),
    lambda text: text.replace('Millimeters', 'Furlongs'),
    lambda text: text.partition('\nFrame')[0]])
def test_a_file_of_motive_without_what_is_needed(
        change: Callable[[str], str], tmp_path: Path, snapshot: Snapshot) -> None:
    path = motive(tmp_path / 'a.csv')
    path.write_text(change(path.read_text()))
    with snapshot.raises(BagError):
        read_setpoints(path)


@pytest.mark.parametrize('change', [
    lambda text: text.replace('Platform X', 'Platform'),
    lambda text: text.replace('FREQUENCY\t100', 'FREQUENCY\t0').replace('Time\t', 'Clock\t'),
    lambda text: text.replace('\t1.000000000\t', '\tx\t').replace('0.0', 'y')])
def test_a_file_of_qtm_without_what_is_needed(
        change: Callable[[str], str], tmp_path: Path, snapshot: Snapshot) -> None:
    path = qtm(tmp_path / 'a.tsv')
    path.write_text(change(path.read_text()))
    with snapshot.raises(BagError):
        read_setpoints(path)


@pytest.mark.parametrize('change', [
    lambda text: text[text.index('Trajectories'):],
    lambda text: text.replace('\n100\n', '\n?\n', 1),
    lambda text: text.replace('TX,', 'PX,'),
    lambda text: text.replace('mm', 'furlong', 1)])
def test_a_file_of_vicon_without_what_is_needed(
        change: Callable[[str], str], tmp_path: Path, snapshot: Snapshot) -> None:
    path = vicon(tmp_path / 'a.csv')
    path.write_text(change(path.read_text()))
    with snapshot.raises(BagError):
        read_setpoints(path)
