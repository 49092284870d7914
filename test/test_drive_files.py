# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Files for amplifiers: units, signs and scales, in a mock of a CiA 402 drive.

The mock turns raw objects into what a motor and its screw do; nothing of the package does so.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
import shutil
import subprocess
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
import pytest
from referees import random_motion, rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.export import main
from stewart_dynamics.export.drive_files import drive_files
import yaml

Array = NDArray[np.float64]

LEAD, GEAR, RATED, COUNTS = 0.005, 3.0, 2.39, 1048576.0
DIRECTIONS = [1.0, -1.0, 1.0, 1.0, -1.0, -1.0]
# Without a rotor and losses leg forces and motor torques have one ratio.
DRIVEN = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced({
    'actuator.screw_lead': LEAD, 'actuator.reflected_mass': 0.0,
    'actuator.viscous_friction': 0.0, 'actuator.coulomb_friction': 0.0,
    'drive.gear_ratio': GEAR, 'drive.rated_torque': RATED, 'drive.counts_per_turn': COUNTS,
    'drive.direction': DIRECTIONS, 'drive.torque_max': 8.2})
PLATFORM = StewartPlatform(DRIVEN)


class Mock(NamedTuple):
    """A drive that is commanded through the channels of ethercat_driver_ros2, and its leg."""

    channels: dict[int, dict[str, Any]]
    direction: float  # in which its motor extends the leg

    @classmethod
    def of(cls, text: str, direction: float) -> Mock:
        slave = yaml.safe_load(text)
        return cls({channel['index']: channel for kind in ('rpdo', 'tpdo')
                    for pdo in slave[kind] for channel in pdo['channels']}, direction)

    def raw(self, index: int, command: float) -> int:
        """Return the number on the bus: a cast of C after the factor."""
        channel = self.channels[index]
        value = int(channel['factor'] * command + channel.get('offset', 0.0))
        bits = int(channel['type'].removeprefix('int'))
        assert abs(value) < 2 ** (bits - 1)
        return value

    def state(self, index: int, raw: int) -> float:
        """Return the state interface of a number on the bus."""
        return float(self.channels[index]['factor'] * raw)

    def leg(self, position: int, torque: int) -> tuple[float, float]:
        """Return by how much the leg is extended, and the force of its ideal screw."""
        turns = self.direction * position / COUNTS / GEAR
        newton_metres = self.direction * torque / 1000.0 * RATED * GEAR
        return turns * LEAD, newton_metres * 2.0 * math.pi / LEAD


@pytest.fixture(scope='module')
def files() -> dict[str, str]:
    """Return the files of the hexapod."""
    return {name: str(text) for name, text in drive_files(DRIVEN, 'hexapod').items()}


def test_a_mock_drive_does_what_the_node_commands(files: dict[str, str]) -> None:
    motion = random_motion(DRIVEN, rng(1), 20)
    result = PLATFORM.inverse_dynamics(motion)
    positions = result.lengths - DRIVEN['geometry.zero_length']
    per_mille = 2.0 * math.pi / LEAD * GEAR * RATED / 1000.0  # force of one [N]
    for leg, direction in enumerate(DIRECTIONS):
        mock = Mock.of(files[f'hexapod_ethercat_{leg + 1}.yaml'], direction)
        assert [mock.channels[each]['command_interface'] for each in (0x607a, 0x60b1, 0x60b2)] == [
            'position', 'velocity', 'effort']
        for position, rate, force in zip(
                positions[:, leg], result.rates[:, leg], result.forces[:, leg], strict=True):
            counts, offset = mock.raw(0x607a, position), mock.raw(0x60b2, force)
            extended, pushed = mock.leg(counts, offset)
            assert extended == pytest.approx(position, abs=1.01 * LEAD / GEAR / COUNTS)
            assert pushed == pytest.approx(force, abs=per_mille)
            assert mock.raw(0x60b1, rate) == pytest.approx(
                direction * rate / LEAD * GEAR * COUNTS, abs=1.0)
            # And back, as state.
            assert mock.state(0x6064, counts) == pytest.approx(extended, abs=1e-12)
            assert mock.state(0x6077, offset) == pytest.approx(pushed, rel=1e-12)


def test_six_mock_drives_carry_the_weight(files: dict[str, str]) -> None:
    """The torque offsets at rest alone hold the platform: its weight, to the last per mille."""
    home = Motion.from_pose(PLATFORM.home_pose())
    forces = PLATFORM.inverse_dynamics(home).forces
    held = np.array([Mock.of(files[f'hexapod_ethercat_{leg + 1}.yaml'], direction).leg(
        0, Mock.of(files[f'hexapod_ethercat_{leg + 1}.yaml'], direction).raw(0x60b2, force))[1]
        for leg, (direction, force) in enumerate(zip(DIRECTIONS, forces, strict=True))])
    accelerated = PLATFORM.forward_dynamics(home, held)
    assert np.abs(accelerated.linear_acceleration).max() < 0.2
    fallen = PLATFORM.forward_dynamics(home, -held)
    assert fallen.linear_acceleration[2] < -15.0


@pytest.mark.parametrize(('compiler', 'standard', 'suffix'), [
    ('gcc', 'c99', 'c'), ('g++', 'c++17', 'cpp'), ('clang', 'c99', 'c')])
def test_the_header_has_the_same_units(
        files: dict[str, str], tmp_path: Path, compiler: str, standard: str, suffix: str) -> None:
    if not shutil.which(compiler):
        pytest.skip(f'needs {compiler}')
    (tmp_path / 'hexapod_drives.h').write_text(files['hexapod_drives.h'])
    names = {'turns': 'double', 'counts': 'int32_t', 'torque': 'double', 'per_mille': 'int16_t',
             'per_mille_of_force': 'int16_t', 'odrive_torque': 'int16_t'}
    calls = '\n'.join(
        f'{kind} call_{name}(int leg, double value); {kind} call_{name}(int leg, double value)'
        f' {{return hexapod_{name}(leg, value);}}' for name, kind in names.items())
    back = ('double call_force(int leg, int raw); double call_force(int leg, int raw) '
            '{return hexapod_force(leg, (int16_t)raw);}\n'
            'double call_position(int leg, int raw); double call_position(int leg, int raw) '
            '{return hexapod_position(leg, raw);}\n')
    begin, end = ('extern "C" {', '}') if suffix == 'cpp' else ('', '')
    program = tmp_path / f'calls.{suffix}'
    program.write_text(f'#include "hexapod_drives.h"\n{begin}\n{calls}\n{back}{end}\n')
    subprocess.run([compiler, f'-std={standard}', '-Wall', '-Wextra', '-Wpedantic', '-Werror',
                    '-Wconversion', '-shared', '-fPIC', program, '-o', tmp_path / 'calls.so'],
                   check=True)
    library = ctypes.CDLL(str(tmp_path / 'calls.so'))

    def call(name: str, leg: int, value: Any) -> float:
        function = library[f'call_{name}']
        function.argtypes = [ctypes.c_int, ctypes.c_int if name in ('force', 'position')
                             else ctypes.c_double]
        function.restype = {'int16_t': ctypes.c_int16, 'int32_t': ctypes.c_int32}.get(
            names.get(name, 'double'), ctypes.c_double)
        return float(function(leg, value))

    ratio = 2.0 * math.pi * GEAR / LEAD
    for leg, direction in enumerate(DIRECTIONS):
        assert call('turns', leg, 0.1) == pytest.approx(direction * 60.0, rel=1e-14)
        assert call('counts', leg, 0.1) == round(direction * 60.0 * COUNTS)
        assert call('torque', leg, 1.5) == 1.5 * direction
        assert call('per_mille', leg, RATED) == 1000.0 * direction
        assert call('odrive_torque', leg, 1.5) == 1500.0 * direction
        mock = Mock.of(files[f'hexapod_ethercat_{leg + 1}.yaml'], direction)
        for force in (-3000.0, -0.4, 0.0, 777.0, 6000.0):
            raw = call('per_mille_of_force', leg, force)
            assert abs(raw - mock.raw(0x60b2, force)) <= 1.0  # rounded here, cast there
            assert call('force', leg, int(raw)) == pytest.approx(
                force, abs=0.5 * ratio * RATED / 1000.0 + 1e-9)
        assert call('position', leg, int(call('counts', leg, 0.25))) == pytest.approx(
            0.25, abs=1e-8)
        # No NaN on a bus, no value that turns over at the end of its bits.
        for bad in (math.nan, math.inf, -math.inf, 1e300):
            for name, kind in names.items():
                found = call(name, leg, bad)
                if bad != bad:
                    assert found == 0.0
                elif kind != 'double':
                    most = 2.0 ** (15 if kind == 'int16_t' else 31)
                    assert found in (most - 1.0, -most)
                    assert (found > 0.0) == (direction * bad > 0.0)


@pytest.mark.parametrize('changes', [
    {'drive.rated_torque': None},
    {'drive.screw_rotation': 'universal'},
    {'drive.rated_torque': 0.01, 'drive.torque_max': None}])
def test_units_that_are_not_known_or_do_not_fit_are_rejected(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        drive_files(DRIVEN.replaced(changes), 'hexapod')


def test_a_direction_is_one_or_minus_one(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        DRIVEN.replaced({'drive.direction': 0.5})


def test_stewart_export_writes_them_on_request(tmp_path: Path) -> None:
    DRIVEN.to_yaml(tmp_path / 'hexapod.yaml')
    given = ['--params', str(tmp_path / 'hexapod.yaml'), '--output', str(tmp_path / 'c')]
    assert main([*given, '--drives']) == 0
    page = (tmp_path / 'c' / 'hexapod_drives.md').read_text()
    assert '| leg_2 | -1 | 600 | ' in page
    assert f'| {1e3 / (2.0 * math.pi * GEAR / LEAD):.6g} |' in page
    assert (tmp_path / 'c' / 'hexapod_ethercat_6.yaml').exists()
    assert main([*given[:-1], str(tmp_path / 'd')]) == 0
    assert not list((tmp_path / 'd').glob('*drives*'))
