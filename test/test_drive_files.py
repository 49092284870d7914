# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Files for amplifiers: units, signs and scales, in a mock of a CiA 402 drive.

The mock turns raw objects into what a motor and its screw do; nothing of the package does so. The
EtherCAT plugin is a model of ethercat_driver_ros2 1.2.0, written after its source.
"""

from __future__ import annotations

from collections.abc import Mapping
import ctypes
import math
from pathlib import Path
import re
import shutil
import subprocess
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from programs import call
import pytest
from referees import random_motion, rng, ROOT
from snapshot import Snapshot
from stewart_dynamics import Motion, Parameters, Pose, StewartPlatform
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
# An encoder whose increments are so small that 32 bits are 0.64 m of the leg, or 0.64 m/s.
FINE = {'drive.gear_ratio': 1.0, 'drive.counts_per_turn': 2.0 ** 24, 'geometry.zero_length': 1.0,
        'limits.length_min': 1.0, 'limits.length_max': 1.5}


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


class Drive:
    """A drive of CiA 402 on the bus: its states, the mode that it displays, its position."""

    def __init__(self, position: int, displayed_after: int) -> None:
        self.objects = {0x6040: 0, 0x607a: 0, 0x60b1: 0, 0x60b2: 0,
                        0x6041: 0, 0x6064: position, 0x606c: 0, 0x6077: 0, 0x6061: 0}
        self._displayed_after = displayed_after  # cycles
        self._cycles = 0

    @property
    def enabled(self) -> bool:
        """Return whether it follows 607Ah."""
        return self.objects[0x6041] == 0x27

    def cycle(self) -> None:
        """Take the control word, and go on to the next state."""
        self._cycles += 1
        control, status = self.objects[0x6040], self.objects[0x6041]
        following = {(0x00, None): 0x40, (0x40, 0x06): 0x21, (0x21, 0x07): 0x23,
                     (0x23, 0x0f): 0x27}
        self.objects[0x6041] = following.get(
            (status, None), following.get((status, control), status))
        if self._cycles >= self._displayed_after:
            self.objects[0x6061] = 8


class Plugin:
    """EcCiA402Drive: it goes through all channels, outputs first, twice in a cycle."""

    STATES: Mapping[int, int] = {0x40: 0x06, 0x21: 0x07, 0x23: 0x0f}  # control word for each

    def __init__(self, text: str) -> None:
        slave = yaml.safe_load(text)
        self._outputs, self._inputs = (
            [channel for pdo in slave[kind] for channel in pdo['channels']]
            for kind in ('rpdo', 'tpdo'))
        self._default = {each['index']: float(each.get('default', math.nan))
                         for each in self._outputs}
        self._mode, self._status, self._position = 0, 0, math.nan
        self.states: dict[str, float] = {}

    def go_through(self, commands: Mapping[str, float], bus: dict[int, int]) -> None:
        """Write commands or defaults into the outputs; read the inputs."""
        for channel in self._outputs:
            index, factor = channel['index'], channel.get('factor', 1.0)
            overridden = False
            if index == 0x6040:
                self._default[index] = self.STATES.get(self._status, bus[index])
            if index == 0x607a:
                if self._mode != 0:
                    self._default[index] = factor * self._position
                overridden = self._mode != 8
            command = commands.get(channel.get('command_interface', ''), math.nan)
            value = self._default[index] if overridden or math.isnan(command) else (
                factor * command)
            if not math.isnan(value):
                bus[index] = int(value)  # a cast of C
        for channel in self._inputs:
            value = channel.get('factor', 1.0) * bus[channel['index']]
            if 'state_interface' in channel:
                self.states[channel['state_interface']] = value
            if channel['index'] == 0x6061:
                self._mode = int(value)
            elif channel['index'] == 0x6064:
                self._position = value
            elif channel['index'] == 0x6041:
                self._status = int(value)


def cycle(plugin: Plugin, drive: Drive, position: float) -> None:
    """Run one period of the controller manager: read, write, and the drive's own."""
    commands = {'position': position, 'velocity': math.nan, 'effort': math.nan}
    plugin.go_through(commands, drive.objects)
    plugin.go_through(commands, drive.objects)
    drive.cycle()


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


@pytest.mark.parametrize('displayed_after', [0, 1, 2, 3])
@pytest.mark.parametrize('leg', [0, 1])
def test_an_enabled_drive_holds_its_position_until_a_command_comes(
        files: dict[str, str], leg: int, displayed_after: int) -> None:
    """607Ah is 6064h to the increment, and the command from the first one on."""
    counts = int(DIRECTIONS[leg] * 0.2 / LEAD * GEAR * COUNTS)
    plugin, drive = Plugin(files[f'hexapod_ethercat_{leg + 1}.yaml']), Drive(
        counts, displayed_after)
    for _ in range(10):
        cycle(plugin, drive, math.nan)
        if drive.enabled:
            assert drive.objects[0x607a] == counts
    assert drive.enabled
    assert plugin.states['position'] == pytest.approx(0.2, abs=1e-8)
    cycle(plugin, drive, plugin.states['position'])  # as controllers begin
    assert drive.objects[0x607a] == counts
    for position in (0.201, 0.3, -0.05):
        cycle(plugin, drive, position)
        assert drive.objects[0x607a] == pytest.approx(
            DIRECTIONS[leg] * position / LEAD * GEAR * COUNTS, abs=1.0)
    cycle(plugin, drive, math.nan)  # a controller that ends
    assert drive.objects[0x607a] == counts


def test_without_the_displayed_mode_the_plugin_never_sends_a_position(
        files: dict[str, str]) -> None:
    """The channel of 6061h is why the test above passes."""
    slave = yaml.safe_load(files['hexapod_ethercat_1.yaml'])
    channels = slave['tpdo'][0]['channels']
    channels[:] = [each for each in channels if each['index'] != 0x6061]
    plugin, drive = Plugin(yaml.safe_dump(slave)), Drive(125829120, 0)
    for position in [math.nan] * 10 + [0.3] * 10:
        cycle(plugin, drive, position)
    assert drive.enabled
    assert drive.objects[0x607a] == 0


def test_a_position_that_is_read_is_written_back_to_the_increment() -> None:
    """Factors of any lead, gear and encoder: a held position does not creep towards zero."""
    random = np.random.default_rng(3)
    for _ in range(50):
        changed = DRIVEN.replaced({
            'actuator.screw_lead': random.uniform(0.002, 0.02), 'drive.torque_max': None,
            'drive.gear_ratio': random.uniform(1.0, 5.0), 'limits.force_max': None,
            'drive.counts_per_turn': float(random.integers(1000, 2 ** 20))})
        channels = Mock.of(str(drive_files(changed, 'h')['h_ethercat_2.yaml']), -1.0).channels
        counts = random.integers(-2 ** 31 + 1, 2 ** 31, 1000)
        metres = channels[0x6064]['factor'] * counts
        assert np.all(np.trunc(channels[0x607a]['factor'] * metres) == counts)


@pytest.mark.parametrize(('compiler', 'standard', 'suffix'), [
    ('gcc', 'c99', 'c'), ('g++', 'c++17', 'cpp'), ('clang', 'c99', 'c')])
def test_the_header_has_the_same_units(
        files: dict[str, str], tmp_path: Path, compiler: str, standard: str, suffix: str) -> None:
    if not shutil.which(compiler):
        pytest.skip(f'needs {compiler}')
    (tmp_path / 'hexapod_drives.h').write_text(files['hexapod_drives.h'])
    names = {'turns': 'double', 'counts': 'int32_t', 'torque': 'double', 'per_mille': 'int16_t',
             'per_mille_of_force': 'int16_t', 'odrive_torque': 'int16_t',
             'odrive_velocity': 'int16_t'}
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
        assert call('odrive_velocity', leg, 0.05) == 30000.0 * direction  # 30 turns/s
        assert call('odrive_velocity', leg, 0.1) in (direction * 32767.0, -32768.0)
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
    {'drive.rated_torque': 0.01},
    {'drive.rated_torque': 0.01, 'drive.torque_max': None},
    {**FINE, 'limits.length_max': 1.7}, {**FINE, 'geometry.zero_length': 0.0},
    {**FINE, 'geometry.zero_length': 1.7},
    {**FINE, 'drive.counts_per_turn': 2.0 ** 26},
    {**FINE, 'limits.velocity_max': [0.1, 0.1, 0.1, 0.7, 0.1, 0.1]},
    {**FINE, 'drive.speed_max': 900.0}])
def test_units_that_are_not_known_or_do_not_fit_are_rejected(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        drive_files(DRIVEN.replaced(changes), 'hexapod')


def test_the_ends_of_32_bits_are_within_them() -> None:
    """The stroke that just fits is taken; what an error advises is."""
    fitting = (2.0 ** 31 - 1.0) / 2.0 ** 24 * LEAD
    taken = {**FINE, 'limits.length_max': 1.0 + fitting, 'limits.velocity_max': fitting}
    assert drive_files(DRIVEN.replaced(taken), 'h')
    for more in ({'limits.length_max': 1.0 + 1.0000001 * fitting},
                 {'limits.velocity_max': 1.0000001 * fitting},
                 {'drive.speed_max': 900.0}, {'drive.rated_torque': 0.01}):
        changed = DRIVEN.replaced({**taken, **more})
        with pytest.raises(ParameterError) as caught:
            drive_files(changed, 'h')
        name, value = re.findall(
            r'(drive\.[a-z_]+)[^:]*? (?:of at most|to at least) ([0-9.]+)', str(caught.value))[0]
        assert drive_files(changed.replaced({name: float(value)}), 'h')
    centred = re.findall(r'middle of the stroke, ([0-9.]+) m', _error(
        DRIVEN.replaced({**FINE, 'limits.length_max': 1.7})))
    assert drive_files(DRIVEN.replaced({
        **FINE, 'limits.length_max': 1.7, 'geometry.zero_length': float(centred[0])}), 'h')


def _error(parameters: Parameters) -> str:
    with pytest.raises(ParameterError) as caught:
        drive_files(parameters, 'h')
    return str(caught.value)


def test_a_direction_is_one_or_minus_one(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        DRIVEN.replaced({'drive.direction': 0.5})


def test_stewart_export_writes_them_on_request(tmp_path: Path) -> None:
    DRIVEN.to_yaml(tmp_path / 'hexapod.yaml')
    given = ['--params', str(tmp_path / 'hexapod.yaml'), '--output', str(tmp_path / 'c')]
    call(main, *given, '--drives')
    page = (tmp_path / 'c' / 'hexapod_drives.md').read_text()
    assert '| leg_2 | -1 | 600 | -6.291456e+08 | 3.413 |' in page
    assert f'| {1e3 / (2.0 * math.pi * GEAR / LEAD):.6g} |' in page
    assert (tmp_path / 'c' / 'hexapod_ethercat_6.yaml').exists()
    call(main, *given[:-1], tmp_path / 'd')
    assert not list((tmp_path / 'd').glob('*drives*'))


# Cranks on gear motors, and on servos on a bus

RIG = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml').replaced({
    'actuator.reflected_inertia': 0.0, 'actuator.viscous_friction': 0.0,
    'actuator.coulomb_friction': 0.0, 'drive.direction': DIRECTIONS})
WORM = 50.0  # turns of the motor for one of the crank
GEARED = RIG.replaced({
    'drive.gear_ratio': WORM, 'drive.rated_torque': RATED, 'drive.counts_per_turn': 8192.0})
# A Dynamixel XM430-W350 as its e-Manual has it: 4096 increments a turn, the middle at 2048, units
# of 2.69 mA and 0.229 rpm, 4.1 N m at 2.3 A. A belt makes 1.5 turns of it for one of the crank.
BELT, CONSTANT = 1.5, 4.1 / 2.3
BUS = {'drive.gear_ratio': BELT, 'drive.counts_per_turn': 4096.0, 'drive.counts_at_zero': 2048.0,
       'drive.current_unit': 0.00269, 'drive.torque_constant': CONSTANT,
       'drive.speed_unit': 0.229 * 2.0 * math.pi / 60.0}
SMALL = RIG.replaced({
    **BUS, 'limits.torque_max': 5.0, 'platform.mass': 4.0, 'legs.crank.mass': 0.0,
    'legs.rod.mass': 0.0, 'platform.inertia': [0.1, 0.0, 0.0, 0.1, 0.0, 0.1]})


class Servo(NamedTuple):
    """A servo on a bus that turns a crank by a belt; a program sees bytes of its registers."""

    direction: float  # in which it drives the angle of the crank up
    zero: int = 2048

    def crank(self, register: bytes) -> float:
        """Return the angle of the crank for four bytes of Goal Position, at 0.087890625 deg."""
        count = int.from_bytes(register, 'little', signed=True)
        return self.direction * math.radians((count - self.zero) * 0.087890625) / BELT

    def torque(self, register: bytes) -> float:
        """Return the torque of the crank for two bytes of Goal Current."""
        milliamperes = 2.69 * int.from_bytes(register, 'little', signed=True)
        return self.direction * milliamperes / 1000.0 * CONSTANT * BELT


def compiled(folder: Path, header: str, functions: Mapping[str, str]) -> ctypes.CDLL:
    """Return a library with functions of the header of rig; name: type of the argument, result."""
    if not shutil.which('gcc'):
        pytest.skip('needs gcc')
    (folder / 'rig_drives.h').write_text(header)
    lines = ['#include "rig_drives.h"']
    for name, types in functions.items():
        argument, result = types.split()
        lines.append(f'{result} call_{name}(int leg, {argument} value);\n{result} call_{name}(int '
                     f'leg, {argument} value) {{return rig_{name}(leg, value);}}')
    (folder / 'calls.c').write_text('\n'.join(lines) + '\n')
    subprocess.run(['gcc', '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-Wconversion',
                    '-shared', '-fPIC', folder / 'calls.c', '-o', folder / 'calls.so'], check=True)
    library = ctypes.CDLL(str(folder / 'calls.so'))
    of_c = {'double': ctypes.c_double, 'int16_t': ctypes.c_int16, 'int32_t': ctypes.c_int32}
    for name, types in functions.items():
        argument, result = types.split()
        function = getattr(library, f'call_{name}')  # kept, unlike library[...]
        function.argtypes, function.restype = [ctypes.c_int, of_c[argument]], of_c[result]
    return library


def test_a_mock_gear_motor_turns_its_crank(tmp_path: Path) -> None:
    """Angle, speed, torque by CiA 402, moteus and ODrive, with gear and sign."""
    platform, texts = StewartPlatform(GEARED), drive_files(GEARED, 'rig')
    call = compiled(tmp_path, str(texts['rig_drives.h']), {
        'turns': 'double double', 'torque': 'double double', 'odrive_torque': 'double int16_t',
        'odrive_velocity': 'double int16_t', 'counts': 'double int32_t',
        'per_mille': 'double int16_t', 'per_mille_of_leg_torque': 'double int16_t',
        'leg_torque': 'int16_t double', 'position': 'int32_t double'})
    home = platform.home_pose()
    motion = Motion(home.position + [0.02, -0.03, 0.04], home.rotation, [0.2, -0.1, 0.3],
                    [0.3, 0.1, -0.2], [0.5, 1.0, -2.0], [1.0, 0.0, 0.5])
    result = platform.inverse_dynamics(motion)
    motors = platform.motors(motion)
    for leg, direction in enumerate(DIRECTIONS):
        angle, speed, torque = (float(each[leg]) for each in (
            result.angles, result.speeds, result.torques))
        # An axle that turns once for 50 turns of its motor.
        turns = call.call_turns(leg, angle)
        assert direction * turns / WORM * 2.0 * math.pi == pytest.approx(angle, rel=1e-14)
        assert call.call_turns(leg, speed) * 2.0 * math.pi == pytest.approx(
            direction * motors.speeds[leg], rel=1e-12)
        given = float(motors.torques[leg])
        assert direction * call.call_torque(leg, given) * WORM == pytest.approx(torque, rel=1e-12)
        assert direction * call.call_odrive_torque(leg, given) / 1000.0 * WORM == pytest.approx(
            torque, abs=0.5e-3 * WORM)
        assert direction * call.call_odrive_velocity(leg, speed) / 1000.0 / WORM == pytest.approx(
            speed / (2.0 * math.pi), abs=1e-3 / WORM)
        counts = call.call_counts(leg, angle)
        assert direction * counts / 8192.0 / WORM * 2.0 * math.pi == pytest.approx(
            angle, abs=2.0 * math.pi / 8192.0 / WORM)
        assert call.call_position(leg, counts) == pytest.approx(angle, abs=1e-5)
        for raw in (call.call_per_mille(leg, given), call.call_per_mille_of_leg_torque(
                leg, torque)):
            assert direction * raw / 1000.0 * RATED * WORM == pytest.approx(
                torque, abs=0.51e-3 * RATED * WORM)
            assert call.call_leg_torque(leg, raw) == pytest.approx(
                torque, abs=0.51e-3 * RATED * WORM)
        mock = Mock.of(str(texts[f'rig_ethercat_{leg + 1}.yaml']), direction)
        assert abs(mock.raw(0x607a, angle) - counts) <= 1
        assert abs(mock.raw(0x60b2, torque) - call.call_per_mille(leg, given)) <= 1


def test_mock_servos_on_a_bus_carry_the_platform(tmp_path: Path) -> None:
    """Their horns turn the cranks to the pose, their currents alone hold the platform there."""
    platform, texts = StewartPlatform(SMALL), drive_files(SMALL, 'rig')
    assert sorted(texts) == ['rig_drives.h', 'rig_drives.md']
    header = str(texts['rig_drives.h'])
    assert 'rated_torque' not in header and 'per_mille' not in header
    call = compiled(tmp_path, header, {
        'goal_position': 'double int32_t', 'present_position': 'int32_t double',
        'present_velocity': 'int32_t double', 'goal_current': 'double int16_t',
        'present_torque': 'int16_t double', 'turns': 'double double'})
    home = platform.home_pose()
    pose = Pose(home.position + [0.01, -0.02, 0.03], home.rotation)
    motion = Motion.from_pose(pose)
    result, motors = platform.inverse_dynamics(motion), platform.motors(motion)
    angles, torques = np.empty(6), np.empty(6)
    for leg, direction in enumerate(DIRECTIONS):
        servo = Servo(direction)
        count = call.call_goal_position(leg, result.angles[leg])
        register = count.to_bytes(4, 'little', signed=True)
        angles[leg] = servo.crank(register)
        assert call.call_present_position(leg, count) == pytest.approx(angles[leg], abs=1e-14)
        current = call.call_goal_current(leg, motors.torques[leg])
        register = current.to_bytes(2, 'little', signed=True)
        torques[leg] = servo.torque(register)
        assert call.call_present_torque(leg, current) * BELT == pytest.approx(
            torques[leg], rel=1e-12)
        # 100 counts of velocity are 22.9 rpm of the horn.
        assert call.call_present_velocity(leg, 100) == pytest.approx(
            direction * 22.9 * 2.0 * math.pi / 60.0 / BELT, rel=1e-12)
        assert call.call_goal_position(leg, 0.0) == 2048
        for bad in (math.nan, math.inf, -math.inf):
            assert call.call_goal_current(leg, bad) in (0, 32767, -32768)
    assert np.abs(angles - result.angles).max() < math.radians(0.0879) / 2.0 / BELT + 1e-12
    assert np.abs(torques - result.torques).max() < 0.51 * 0.00269 * CONSTANT * BELT
    accelerated = platform.forward_dynamics(motion, torques)
    assert np.abs(accelerated.linear_acceleration).max() < 0.1
    assert platform.forward_dynamics(motion, -torques).linear_acceleration[2] < -9.9


def test_the_page_says_where_the_servos_are_at_the_limits() -> None:
    page = str(drive_files(SMALL, 'rig')['rig_drives.md'])
    low, high = (2048.0 + 4096.0 * BELT * side * (math.pi / 3.0) / (2.0 * math.pi)
                 for side in (-1.0, 1.0))
    assert (low, high) == (1024.0, 3072.0)
    assert '1024 to 3072, 3072 to 1024, 1024 to 3072' in page
    assert 'EtherCAT' not in page and '607Ah, increments' not in page
    assert f'| {1.0 / (0.00269 * CONSTANT):.6g} |' in page and f'| {1.0 / BELT:.6g} |' in page
    both = drive_files(SMALL.replaced({'drive.rated_torque': 1.0}), 'rig')
    assert len(both) == 8 and 'EtherCAT' in str(both['rig_drives.md'])
    geared = str(drive_files(GEARED, 'rig')['rig_drives.md'])
    assert 'Dynamixel' not in geared and f'| {1.0 / WORM:.6g} |' in geared


@pytest.mark.parametrize('changes', [
    {'drive.counts_per_turn': None}, {'drive.torque_constant': None},
    {'drive.current_unit': 2.69e-9}, {'drive.counts_at_zero': None, 'drive.current_unit': None},
    {'drive.counts_per_turn': 1e11}])
def test_servos_on_a_bus_that_are_not_known_are_rejected(
        changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        drive_files(SMALL.replaced(changes), 'rig')
