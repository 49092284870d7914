# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The Arduino library of stewart_export: compiled for this computer, with the sketch's input."""

from __future__ import annotations

import io
from pathlib import Path
import shutil
import subprocess
from typing import Any
import zipfile

import numpy as np
from programs import call, run_program
import pytest
from referees import Array, rng
from snapshot import Snapshot
from stewart_dynamics import Motion, ParameterError, Parameters, Pose, StewartPlatform
from stewart_dynamics.export import main
from stewart_dynamics.export.arduino import arduino_library
from stewart_dynamics.mechanics.frames.rotation import from_euler
from test_export import CRANK_FILE, PLATFORM_FILE, SERVOS

HERE = Path(__file__).parent
PROGRAM = 'stewart_export'

PINS = [13, 12, 14, 27, 26, 25]
RIG = Parameters.from_yaml(CRANK_FILE).replaced(SERVOS)

pytestmark = pytest.mark.skipif(
    not shutil.which('gcc') or not shutil.which('g++'), reason='needs gcc and g++')


@pytest.fixture(scope='module')
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the sketch as a program of this computer."""
    folder = tmp_path_factory.mktemp('sketch')
    zipfile.ZipFile(io.BytesIO(arduino_library(RIG, 'rig'))).extractall(folder)
    library = folder / 'rig'
    assert sorted(str(path.relative_to(library)) for path in library.rglob('*.*')) == [
        'examples/rig_servos/rig_servos.ino', 'library.properties', 'src/rig.c', 'src/rig.h',
        'src/stewart_dynamics.c', 'src/stewart_dynamics.h']
    objects = []
    for source in (library / 'src').glob('*.c'):
        objects.append(source.with_suffix('.o'))
        subprocess.run(['gcc', '-std=gnu17', '-O2', '-ffp-contract=off', '-c', source, '-o',
                        objects[-1]], check=True)
    subprocess.run(
        ['g++', '-std=gnu++17', '-O2', '-Wall', '-Wextra', '-Wconversion', '-Wshadow', '-Werror',
         f'-I{HERE / "arduino"}', f'-I{library / "src"}', '-include', 'Arduino.h', '-x', 'c++',
         library / 'examples' / 'rig_servos' / 'rig_servos.ino', HERE / 'arduino' / 'main.cpp',
         '-x', 'none', *objects, '-o', folder / 'sketch'], check=True)
    return folder / 'sketch'


def moved(sketch: Path, *lines: str) -> tuple[Array, list[str]]:
    """Return pulses (N, 6) [us] that the sketch commands, and what it answers."""
    done = run_program(sketch, text='\n'.join([*lines, '']))
    words = [line.split() for line in done.out.splitlines()]
    pulses = [[int(each[1]), int(each[2])] for each in words if each[0] == 'pulse']
    rows = np.array(pulses).reshape(-1, 6, 2)
    assert (rows[:, :, 0] == PINS).all()
    attached = [list(map(int, each[1:])) for each in words if each[0] == 'servo']
    assert [each[0] for each in attached] == PINS[:len(attached)]
    for leg, (_, least, most) in enumerate(attached):
        assert least == round(1e6 * SERVOS['servo.pulse_min'][leg])
        assert most == round(1e6 * SERVOS['servo.pulse_max'][leg])
    return rows[:, :, 1], [' '.join(each) for each in words if each[0] not in ('servo', 'pulse')]


def pulses_of(displacement: Any) -> Array:
    """Return the pulses [us] of a displacement from home by the library."""
    platform = StewartPlatform(RIG)
    home = platform.home_pose()
    pose = Pose(home.position + displacement[:3], from_euler(displacement[3:]) @ home.rotation)
    return 1e6 * platform.servo_pulses(platform.inverse_kinematics(pose))


def test_the_sketch_moves_from_rest_to_rest_with_the_pulses_of_the_library(sketch: Path) -> None:
    random = rng(3)
    for _ in range(5):
        to = random.uniform(-1.0, 1.0, 6) * [0.03, 0.03, 0.03, 0.05, 0.05, 0.05]
        rows, answers = moved(sketch, ' '.join(map(repr, [*to.tolist(), 0.5])))
        assert answers[0] == 'at home'
        word, torque, _ = answers[1].split()
        assert word == 'ok' and len(answers) == 2
        np.testing.assert_allclose(rows[0], pulses_of(np.zeros(6)), rtol=0.0, atol=0.5001)
        np.testing.assert_allclose(rows[-1], pulses_of(to), rtol=0.0, atol=0.5001)
        assert 20 <= len(rows) <= 30
        assert np.abs(np.diff(rows, axis=0)).max() < 0.2 * np.abs(rows[-1] - rows[0]).max() + 2.0
        platform = StewartPlatform(RIG)
        home = platform.home_pose()
        at_rest = platform.inverse_dynamics(Motion(
            home.position + to[:3], from_euler(to[3:]) @ home.rotation))
        assert float(torque) >= np.abs(at_rest.torques).max() - 1e-4


@pytest.mark.parametrize(('line', 'answer'), [
    ('0 0 1.5 0 0 0 1', 'rejected 11'),  # out of reach
    ('0 0 0 0 0 0', 'rejected: not seven numbers'), ('0 0 nan 0 0 0 1',
                                                     'rejected: not seven numbers'),
    (f'0 0 0.{"1" * 300} 0 0 0 1', 'rejected: not seven numbers'),
    ('home', 'rejected: not seven numbers'), ('', 'rejected: not seven numbers'),
    ('0 0 0 0 0 0 0', 'rejected: duration')])
def test_lines_that_are_rejected_leave_the_servos_where_they_are(
        sketch: Path, line: str, answer: str) -> None:
    rows, answers = moved(sketch, line)
    assert answers == ['at home', answer]
    assert len(rows) == 1


def test_a_pose_outside_limits_or_servos_is_not_begun(sketch: Path) -> None:
    """Angles of limits.angle_max are 1.047 rad; the fourth servo ends at 0.9 rad."""
    random, seen = rng(4), set()
    for _ in range(80):
        to = random.uniform(-1.0, 1.0, 6) * [0.15, 0.15, 0.1, 0.2, 0.2, 0.4]
        rows, said = moved(sketch, ' '.join(map(repr, [*to.tolist(), 0.1])))
        seen.add(said[1] if said[1] == 'rejected 13' else said[1].split()[0])
        assert said[1].startswith('ok') == (len(rows) > 1)
    assert seen >= {'ok', 'limits', 'rejected 13'}
    rows, said = moved(sketch, '0 0 0.02 0 0 0 1', '0 0 0 0 0 0 1')
    assert said[1] == 'rejected: in motion' and said[2].startswith('ok ')
    np.testing.assert_allclose(rows[-1], pulses_of(np.array([0, 0, 0.02, 0, 0, 0])), atol=0.5001)


def test_files_need_the_points_of_the_servos(tmp_path: Path, snapshot: Snapshot) -> None:
    for path in CRANK_FILE, PLATFORM_FILE:
        with snapshot.raises(ParameterError):
            arduino_library(Parameters.from_yaml(path), 'rig')
    RIG.to_yaml(tmp_path / 'rig.yaml')
    out = call(main, '--params', tmp_path / 'rig.yaml', '--output', tmp_path / 'out', '--name',
               'rig', '--arduino').out
    assert out.split()[-1] == str(tmp_path / 'out' / 'rig_arduino.zip')
    assert (tmp_path / 'out' / 'rig_arduino.zip').read_bytes() == arduino_library(
        Parameters.from_yaml(tmp_path / 'rig.yaml'), 'rig')
    call(main, '--params', PLATFORM_FILE, '--output', tmp_path / 'none', '--arduino', code=2)
    assert not (tmp_path / 'none').exists()
