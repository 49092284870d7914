# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""stewart_export and its C source: the bits of the library, compilers, golden vectors, files."""

from __future__ import annotations

import csv
import ctypes
import math
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import Any

from cases import few
from checked_results import state_record
from crank_machines import random_machine, random_state
from crank_platforms import base_of, motion_of, parameters_of
import numpy as np
from programs import call, run_program
import pytest
from referees import (
    Array, random_base_motion, random_motion, random_parameters, random_wrench, rng,
    symmetric_parameters)
from snapshot import Snapshot
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.core.binding import CONSTANTS, function, places, record
from stewart_dynamics.errors import MotionError, ParameterError, StewartError
from stewart_dynamics.export import main
from stewart_dynamics.export.c_project import (
    c_project, check_name, digest, source, SOURCES)
from stewart_dynamics.export.golden_vectors import whole_columns
from stewart_dynamics.legs import TELESCOPIC
from stewart_dynamics.mechanics import batch
from stewart_dynamics.mechanics.drives.motors import Drives, MECHANICAL
from stewart_dynamics.mechanics.frames.motion import ORTHOGONALITY
from stewart_dynamics.mechanics.frames.rotation import (
    from_euler, from_quaternion, quaternion_length)
from stewart_dynamics.mechanics.hexapod_structure import limited_structure
from stewart_dynamics.mechanics.kinematics import forward_kinematics
from stewart_dynamics.mechanics.limits import LIMITS, TOLERANCE
from stewart_dynamics.mechanics.rows import (
    BASE, CONDITION, DETERMINANT, FORCES, JOINT_FORCES, LENGTHS, MOTION, RESULT,
    UNIT_LOAD_FORCES, WRENCH)
from stewart_dynamics.mechanics.singularity_warning import HYSTERESIS, UNSOLVABLE_CONDITION
from stewart_dynamics.parameters.structure import LEG_FIELDS
from stewart_dynamics.parameters.tolerances import QUATERNION_TOLERANCE
from stewart_dynamics.setpoints.step import Batch, FIRST, Step
from test_drives import driven

PROGRAM = 'stewart_export'

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / 'stewart_dynamics' / 'core'
PLATFORM_FILE = ROOT / 'config' / 'platform.yaml'
CRANK_FILE = ROOT / 'config' / 'crank_platform.yaml'
# cc is mostly another name of one of the others.
COMPILERS = list({Path(found).resolve(): name for name in ('cc', 'clang', 'gcc')
                  if (found := shutil.which(name))}.values())
WARNINGS = ['-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wdouble-promotion', '-Wshadow',
            '-Werror']


def knows_cpp(compiler: str) -> bool:
    """Return whether a compiler compiles C++, for which gcc needs the package g++."""
    return subprocess.run([compiler, '-xc++', '-fsyntax-only', '-'], input=b'#include <cmath>',
                          stderr=subprocess.DEVNULL, check=False).returncode == 0


needs_compiler = pytest.mark.skipif(not COMPILERS, reason='needs a C compiler')

SAMPLES, MOTIONS = 20_000, 5  # of each hexapod
HAS_WRENCH, HAS_BASE = 1, 2
OK, OUT_OF_RANGE, SINGULAR, SUPPRESSED, NO_POSE, NO_MOTORS, UNREACHABLE = 0, 5, 6, 7, 8, 9, 11

# The structures of the C source.
HEXAPOD, STATE = record('stewart_platform'), record('stewart_state')
RESULTS = np.dtype([('moving', 'f8', 12), ('forces', 'f8', 6), ('scalars', 'f8', 3),
                    ('unit_load_forces', 'f8', 6), ('joint_forces', 'f8', 6),
                    ('cranks', 'f8', 24)])
OUTPUT, MOTORS = record('stewart_output'), record('stewart_motors')


def compile_c(folder: Path, *arguments: str | Path, compiler: str | None = None) -> Path:
    """Compile and link; return the program or library."""
    made = folder / 'made'
    done = subprocess.run(
        [compiler or COMPILERS[0], '-ffp-contract=off', *map(str, arguments), '-o', made, '-lm'],
        capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return made


@pytest.fixture(scope='module')
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """Return the C source, called over arrays by test/export_calls.c."""
    if not COMPILERS:
        pytest.skip('needs a C compiler')
    made = compile_c(
        tmp_path_factory.mktemp('library'), '-std=c99', '-O2', '-shared', '-fPIC', f'-I{FOLDER}',
        ROOT / 'test' / 'export_calls.c', FOLDER / 'stewart_dynamics.c')
    loaded = ctypes.CDLL(str(made))
    sizes = (ctypes.c_size_t * 7).in_dll(loaded, 'sizes')
    assert list(sizes) == [HEXAPOD.itemsize, 8 * MOTION, 8 * BASE, RESULTS.itemsize,
                           STATE.itemsize, OUTPUT.itemsize, MOTORS.itemsize]
    return loaded


def compute(function: Any, count: int, *arguments: Any) -> None:
    """Call a C function with a count, and with arrays, numbers."""
    function(ctypes.c_size_t(count), *(
        ctypes.c_size_t(each) if isinstance(each, int) else ctypes.c_void_p(each.ctypes.data)
        for each in arguments))


def structure(parameters: Parameters) -> Any:
    """Return a hexapod () as the C source takes it."""
    return limited_structure(parameters)


def random_hexapods(random: np.random.Generator) -> Any:
    """
    Return hexapods (SAMPLES / MOTIONS,) with any numbers.

    Three tenths have the joints of the example, whose symmetry makes pivots equal.
    """
    many = SAMPLES // MOTIONS
    hexapods = np.zeros(many, HEXAPOD)
    for name in ('gravity', 'mass', 'center_of_mass', 'inertia'):
        hexapods[name] = random.normal(0.0, 5.0, hexapods[name].shape)
    legs = hexapods['legs']
    for name in legs.dtype.names:
        legs[name] = random.normal(0.3, 10.0 ** random.uniform(-2, 1), legs[name].shape)
    legs['coulomb_velocity'] = 10.0 ** random.uniform(-4.0, 0.0, (many, 6))
    legs['base_joint'] = random.normal(0.0, 1.0, (many, 6, 3))
    legs['platform_joint'] = random.normal(0.0, 0.6, (many, 6, 3))
    example = Parameters.from_yaml(PLATFORM_FILE)
    for name in ('base_joint', 'platform_joint'):
        legs[name][random.random(many) < 0.3] = example[LEG_FIELDS[name]]
    # Half of them have screws that turn with their legs.
    legs['screw_lead'] = random.uniform(0.005, 0.1, (many, 6))
    legs['gear_ratio'] = random.uniform(0.5, 4.0, (many, 6))
    legs['twist_ratio'] = legs['gear_ratio'] * random.choice([-1.0, 1.0], (many, 6))
    legs['twist_ratio'][random.random(many) < 0.5] = 0.0
    legs['crank_length'] = 0.0
    for name in ('base_universal_axis', 'platform_universal_axis'):
        legs[name] /= np.linalg.norm(legs[name], axis=-1, keepdims=True)
    hexapods['characteristic_length'] = random.uniform(0.1, 3.0, many)
    legs['motor_inertia'] = legs['screw_inertia'] = 0.0
    for n in range(many):
        function('stewart_complete')(hexapods[n:n + 1])
    return hexapods


@pytest.fixture(scope='module')
def samples(library: ctypes.CDLL) -> dict[str, Any]:
    """Return random hexapods, each in MOTIONS random motions, and the results in C."""
    random = rng()
    motions = np.zeros((SAMPLES, MOTION))
    motions[:, :3] = random.normal([0.0, 0.0, 1.2], 0.4, (SAMPLES, 3))
    motions[:, 3:12] = from_euler(random.normal(0.0, 0.5, (SAMPLES, 3))).reshape(SAMPLES, 9)
    motions[:, 12:] = random.normal(0.0, 2.0, (SAMPLES, 12))
    at_home = random.random(SAMPLES) < 0.1  # symmetric, at rest: with many zeros
    motions[at_home] = [0.0, 0.0, 1.1, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 12]
    hexapods = random_hexapods(random)
    made = {'hexapods': np.repeat(hexapods, MOTIONS), 'motions': motions,
            'wrenches': random.normal(0.0, 500.0, (SAMPLES, WRENCH)),
            'bases': random.normal(0.0, 3.0, (SAMPLES, BASE)),
            'given': random.integers(0, 4, SAMPLES, dtype=np.int32),
            'results': np.zeros(SAMPLES, RESULTS), 'codes': np.zeros(SAMPLES, np.int32)}
    compute(library.inverse_dynamics, SAMPLES, made['hexapods'], 1, made['motions'],
            made['wrenches'], made['bases'], made['given'], made['results'], made['codes'])
    return made


def test_inverse_dynamics_have_the_bits_of_the_library(samples: dict[str, Any]) -> None:
    given = samples['given'][:, None]
    wrenches = np.where(given & HAS_WRENCH, samples['wrenches'], 0.0)
    bases = np.where(given & HAS_BASE, samples['bases'], np.nan)
    expected = np.vstack([
        batch.solve(samples['hexapods'][n:n + 1], *(
            rows[n:n + MOTIONS] for rows in (samples['motions'], wrenches, bases)))
        for n in range(0, SAMPLES, MOTIONS)])
    check_results(samples['results'], expected, samples['codes'])
    assert np.bincount(samples['codes']).tolist() == [SAMPLES]


def check_results(found: Any, expected: Array, codes: Any) -> None:
    """Check that results have the same numbers as rows (N, RESULT), 0 ulp apart."""
    forces, of_joints = (np.where((codes == SINGULAR)[:, None], 0.0, expected[:, which])
                         for which in (FORCES, JOINT_FORCES))
    for name, columns in (('moving', expected[:, :FORCES.start]), ('forces', forces),
                          ('joint_forces', of_joints),
                          ('scalars', expected[:, DETERMINANT:UNIT_LOAD_FORCES.start]),
                          ('unit_load_forces', expected[:, UNIT_LOAD_FORCES])):
        np.testing.assert_array_equal(found[name], columns, err_msg=name)
    assert np.array_equal(codes == SINGULAR, expected[:, CONDITION] >= 1e12)


@pytest.mark.parametrize('seed', few(range(8), 2))
def test_cranks_have_the_bits_of_the_library(library: ctypes.CDLL, seed: int) -> None:
    random = rng(seed)
    machine, count = random_machine(random), 40
    platform = StewartPlatform(parameters_of(machine))
    states = [random_state(machine, random, True) for _ in range(count)]
    motions = np.stack([motion_of(state).rows for state in states])
    wrenches = np.stack([state.wrench for state in states])
    bases = np.stack([base.rows for state in states if (base := base_of(state)) is not None])
    given = random.integers(0, 4, count, dtype=np.int32)
    results, codes = np.zeros(count, RESULTS), np.zeros(count, np.int32)
    motions[0, 2] += 100.0  # out of reach
    hexapods = np.repeat(platform.structure, count)
    compute(library.inverse_dynamics, count, hexapods, 1, motions, wrenches, bases, given, results,
            codes)
    expected = platform.solve(
        motions, np.where(given[:, None] & HAS_WRENCH, wrenches, 0.0),
        np.where(given[:, None] & HAS_BASE, bases, np.nan))
    assert codes.tolist() == [UNREACHABLE, *[OK] * (count - 1)]
    assert results.view(float).reshape(count, -1)[1:].tobytes() == expected[1:].tobytes()


def test_forward_kinematics_have_the_bits_of_the_library(
        library: ctypes.CDLL, samples: dict[str, Any]) -> None:
    random = rng(1)
    guesses = samples['motions'].copy()
    guesses[:, :3] += random.normal(0.0, 0.12, (SAMPLES, 3))
    turns = from_euler(random.normal(0.0, 0.25, (SAMPLES, 3)))
    guesses[:, 3:12] = (turns @ guesses[:, 3:12].reshape(-1, 3, 3)).reshape(SAMPLES, 9)
    lengths = np.ascontiguousarray(samples['results']['moving'][:, LENGTHS])
    poses, codes = np.ascontiguousarray(guesses[:, :12]), np.zeros(SAMPLES, np.int32)
    compute(library.forward_kinematics, SAMPLES, samples['hexapods'], lengths, poses, codes)

    steps, residuals, outcomes = np.empty(1, int), np.empty(1), np.empty(SAMPLES, int)
    for n in range(SAMPLES):
        one = slice(n, n + 1)
        forward_kinematics.poses(
            samples['hexapods'][one], lengths[one], guesses[one], outcomes[one], steps, residuals)
    np.testing.assert_array_equal(poses, guesses[:, :12])
    assert outcomes.tolist() == codes.tolist()
    assert set(codes.tolist()) >= {OK, NO_POSE}


HEATED = {'drive.torque_constant': 0.5, 'drive.resistance': 0.5, 'drive.thermal_resistance': 2.0,
          'drive.thermal_time_constant': 1.0, 'drive.temperature_rise_max': 20.0}


def limited(random: np.random.Generator) -> Parameters:
    """Return a random hexapod that can become singular, some with limits, drives or actions."""
    p = symmetric_parameters() if random.random() < 0.5 else random_parameters(random)
    given: dict[str, Any] = {}
    if random.random() < 0.6:
        given |= {
            'limits.length_min': 0.7 * random.uniform(0.5, 1.2),
            'limits.length_max': random.uniform(1.2, 2.0, 6),
            'limits.velocity_max': random.uniform(0.3, 3.0, 6),
            'limits.force_max': random.uniform(300.0, 3000.0, 6),
            'limits.joint_force_max': random.uniform(300.0, 3000.0, 6)}
    if random.random() < 0.4:
        axes = random.normal([0.0, 0.0, 2.0], 0.3, (12, 3))
        given |= {
            'geometry.base_joint_axes': axes[:6].ravel(),
            'geometry.platform_joint_axes': axes[6:].ravel(),
            'limits.base_joint_angle_max': random.uniform(0.4, 1.5, 6),
            'limits.platform_joint_angle_max': random.uniform(0.4, 1.5, 6),
            'legs.cylinder.radius': 0.08, 'legs.cylinder.length': 0.5, 'legs.piston.radius': 0.05,
            'limits.leg_clearance_min': random.uniform(0.0, 0.2)}
        if random.random() < 0.5:
            given |= {
                'geometry.base_outline': [-0.9, -0.9, 0.0, 0.9, -0.9, 0.0, 0.0, 0.9, 0.0],
                'geometry.platform_outline': [-0.5, -0.4, 0.0, 0.5, -0.4, 0.0, 0.0, 0.6, 0.0]}
    given |= {
        'singularity.action': str(random.choice(['warn', 'suppress_forces'])),
        'limits.action': str(random.choice(['warn', 'suppress_forces'])),
        'singularity.stop_condition': 40.0, 'setpoint.sync_tolerance': random.uniform(0.0, 0.01)}
    p = p.replaced(given)
    if random.random() < 0.5:
        p = driven(p, random, **{
            'drive.screw_rotation': str(random.choice(['guided', 'universal'])),
            'drive.screw_hand': str(random.choice(['left', 'right'])),
            'drive.torque_max': random.uniform(1.0, 20.0, 6),
            'drive.torque_speed': [0.0, 20.0, 200.0, 10.0, 1000.0, 1.0],
            'drive.speed_max': random.uniform(100.0, 1000.0, 6), **HEATED})
    return p


def test_steps_are_those_of_the_node(library: ctypes.CDLL) -> None:
    """Warning with hysteresis, limits, jumps, clipped and suppressed forces, and motors."""
    random, seen = rng(2), set()
    for _ in range(40):
        p, count = limited(random), 150
        times = np.linspace(0.0, 1.0, count)[:, None]
        motion = random_motion(p, random, 2)
        # Turned about z by more than 90 degrees, through the singularity of symmetric hexapods.
        angles = random.uniform([-0.2, -0.2, -1.0], [0.2, 0.2, 2.5], 3) * times
        rates = random.normal(0.0, 1.0, 3) * (random.random(3) < 0.7)
        motions = Motion.from_euler(
            motion.position[:1] + times * (motion.position[1:] - motion.position[:1]), angles,
            np.broadcast_to(motion.linear_velocity[0], (count, 3)), rates + 0.0 * times).rows
        wrenches = random_wrench(p, random, count)
        bases = np.ascontiguousarray(random_base_motion(p, random, count).rows)
        given = random.integers(0, 4, count, dtype=np.int32)
        # Backward in time, too: then no jump is checked.
        stamps = np.cumsum(random.choice([10_000_000, 2_000_000, -5_000_000], count))
        states, outputs = np.zeros(count, STATE), np.zeros(count, OUTPUT)
        motors, codes = np.zeros(count, MOTORS), np.zeros((2, count), np.int32)
        compute(library.steps, count, structure(p), motions, wrenches, bases, given, stamps,
                states, outputs, codes[0], motors, codes[1])

        step, state, drives = Step(p), FIRST, Drives(p)
        results = np.zeros((count, RESULT))
        for n in range(count):
            setpoint = Batch.from_parts(
                stamps[n], motions[n], wrenches[n] if given[n] & HAS_WRENCH else 0.0,
                bases=bases[n] if given[n] & HAS_BASE else None)
            output = step(setpoint, state)
            assert output.answered[0]
            state = output.state
            results[n] = output.results[0]
            if np.isnan(results[n, FORCES]).all():
                results[n, FORCES] = results[n, JOINT_FORCES] = 0.0
            code = (SINGULAR if output.conditions[0] >= UNSOLVABLE_CONDITION
                    else OK if output.with_efforts[0] else SUPPRESSED)
            warned, exceedances = output.singularity(), step.exceedances(output)
            exceeded = [0] * 6
            for each in exceedances:
                exceeded[each.leg] |= LIMITS[each.limit].bit
            assert codes[0, n] == code
            assert outputs['exceeded'][n].tolist() == exceeded
            assert all(np.array_equal(states[n][name], state_record(state)[name], equal_nan=True)
                       for name in STATE.names)
            expected = output.records.copy()
            if code != OK:
                expected['forces'] = expected['motors']['commands'] = 0.0
            if code == SINGULAR:
                expected['result']['forces'] = expected['result']['joint_forces'] = 0.0
            assert np.array_equal(outputs[n:n + 1].view(float), expected.view(float),
                                  equal_nan=True)
            seen |= {('code', code), ('warning', int(warned.cause)), *(
                ('limit', each.limit) for each in exceedances)}
        if p['actuator.screw_lead'] is None:
            assert (codes[1] == NO_MOTORS).all()
        else:
            np.testing.assert_array_equal(
                motors.view(float).reshape(count, -1)[:, MECHANICAL],
                drives(motions, results)[:, MECHANICAL])
    assert seen >= {*(('code', code) for code in (OK, SUPPRESSED)), *(
        ('warning', cause) for cause in range(4)), *(
        ('limit', limit) for limit in LIMITS if not limit.startswith(p.leg_kind.foreign))}, seen


def test_rotations_of_quaternions_are_those_of_the_node(library: ctypes.CDLL) -> None:
    quaternions = rng().normal(size=(1000, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    quaternions *= rng(1).uniform(0.99901, 1.00099, (1000, 1))
    found, codes = np.empty((1000, 9)), np.empty(1000, np.int32)
    compute(library.rotations, 1000, quaternions, found, codes)
    length = quaternion_length(*quaternions.T)
    assert not codes.any()
    np.testing.assert_array_equal(found, np.stack(from_quaternion(*quaternions.T / length), 1))


@pytest.fixture(scope='module')
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files of the example hexapod."""
    folder = tmp_path_factory.mktemp('exported')
    call(main, '--params', PLATFORM_FILE, '--output', folder)
    return folder


@pytest.fixture(scope='module')
def exported_cranks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the files of the example with cranks, which have motors."""
    folder = tmp_path_factory.mktemp('exported_cranks')
    p = Parameters.from_yaml(CRANK_FILE).replaced({
        'drive.gear_ratio': 40.0, 'drive.motor_inertia': 1e-4, 'actuator.reflected_inertia': None,
        'drive.efficiency': 0.8, 'servo.angle_at_min': -1.2, 'servo.angle_at_max': 1.2})
    for name, text in c_project(p, 'rig').items():
        (folder / name).write_text(text)
    return folder


@needs_compiler
@pytest.mark.parametrize('language', [
    pytest.param(['-std=c99'], id='C'),
    pytest.param(['-xc++', '-std=c++17'], id='C++', marks=pytest.mark.slow)])
@pytest.mark.parametrize('compiler', COMPILERS)
def test_golden_vectors_are_met_and_nothing_warns(
        exported: Path, exported_cranks: Path, tmp_path: Path, compiler: str,
        language: list[str]) -> None:
    if '-xc++' in language and not knows_cpp(compiler):
        pytest.skip(f'{compiler} compiles no C++')
    for folder, text in (exported, 'hexapod: 40'), (exported_cranks, 'rig: 20'):
        # Also of cranks the bits: this is the library that computed them.
        made = compile_c(tmp_path, *language, '-O2', '-DTOLERANCE=0.0', *WARNINGS,
                         *folder.glob('*.c'), '-x', 'none', compiler=compiler)
        done = run_program(made)
        assert done.out == f'{text} golden vectors, 0 differences\n'


@needs_compiler
@pytest.mark.parametrize(('field', 'quantity'), [
    ('actuator.reflected_inertia', 'demanded_torque'), ('legs.rod.length', 'lever'),
    ('geometry.crank_directions', 'angle')])
def test_golden_vectors_of_other_cranks_differ(
        exported_cranks: Path, tmp_path: Path, field: str, quantity: str) -> None:
    """Angles, levers and torques are compared, not only forces."""
    shutil.copytree(exported_cranks, tmp_path / 'changed')
    source = tmp_path / 'changed' / 'rig.c'
    line = next(line for line in source.read_text().splitlines() if f'/* {field}: ' in line)
    last = re.findall(r'-?0x[0-9a-fp.+-]+', line)[-2 if 'directions' in field else -1]
    other = line.replace(last, (1.001 * float.fromhex(last)).hex())
    source.write_text(source.read_text().replace(line, other, 1))
    made = compile_c(tmp_path, '-std=c99', *source.parent.glob('*.c'))
    done = run_program(made, code=1)
    assert f': {quantity}[0] is ' in done.out


def test_golden_vectors_of_cranks_are_read_as_they_were_computed(exported_cranks: Path) -> None:
    with (exported_cranks / 'golden.csv').open() as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    names = list(rows[0])
    p = Parameters.from_yaml(CRANK_FILE).replaced({
        'drive.gear_ratio': 40.0, 'drive.motor_inertia': 1e-4, 'actuator.reflected_inertia': None,
        'drive.efficiency': 0.8})
    platform = StewartPlatform(p)
    for row in rows:
        numbers = [row[name] for name in names]
        base = None if not row['has_base'] else np.array(numbers[32:44])
        result = platform.solve(np.array([numbers[2:26]]), np.array([numbers[26:32]]),
                                None if base is None else base[None])[0]
        for name in ('angle', 'speed', 'demanded_torque', 'lever'):
            field = {'angle': 'angles', 'speed': 'speeds', 'demanded_torque': 'torques',
                     'lever': 'levers'}[name]
            assert [row[f'{name}_{leg}'] for leg in range(1, 7)] == (
                result[places('stewart_result')[field]].tolist())
        most = p['limits.torque_max']
        assert [row[f'torque_{leg}'] for leg in range(1, 7)] == np.clip(
            result[places('stewart_result')['torques']], -most, most).tolist()
        assert row['motor_angle_1'] == 40.0 * row['angle_1']
    assert {row['has_base'] for row in rows} == {0.0, 1.0}
    assert any(row['exceeded_1'] for row in rows) and not rows[0]['exceeded_1']
    assert {row['found_code'] for row in rows} == {OK}


@pytest.mark.skipif('gcc' not in COMPILERS, reason='needs gcc')
@pytest.mark.parametrize(('file', 'positions', 'efforts'), [
    (PLATFORM_FILE, 6e-7, 2e-5), (CRANK_FILE, 4e-6, 1e-4)], ids=['lengths', 'angles'])
def test_floats_in_place_of_doubles(
        tmp_path: Path, file: Path, positions: float, efforts: float) -> None:
    """As on processors whose doubles have 32 bits: errors of positions, efforts by the largest."""
    p, count = Parameters.from_yaml(file), 5000
    kind, platform, random = p.leg_kind, StewartPlatform(p), rng(8)
    for name, text in c_project(p, 'rig').items():
        if name != 'test_golden.c':
            single = re.sub(r'\bdouble\b', 'float', text).replace('<math.h>', '<tgmath.h>')
            (tmp_path / name).write_text(single)
    (tmp_path / 'calls.c').write_text(
        '#include "rig.h"\n#include <stddef.h>\n'
        'int inverse(const stewart_motion * motion, stewart_result * result) {\n'
        '  return stewart_inverse_dynamics(&rig, motion, NULL, NULL, result);\n}\n')
    made = compile_c(tmp_path, '-std=c99', '-O2', '-fsingle-precision-constant', '-shared',
                     '-fPIC', *tmp_path.glob('*.c'), compiler='gcc')
    inverse = ctypes.CDLL(str(made)).inverse
    home = platform.home_pose()
    motions = np.zeros((count, MOTION))
    motions[:, :3] = home.position + random.uniform(-0.08, 0.08, (count, 3))
    motions[:, 3:12] = (from_euler(random.uniform(-0.15, 0.15, (count, 3)))
                        @ home.rotation).reshape(count, 9)
    motions[:, 12:] = random.normal(0.0, 1.0, (count, 12))
    with np.errstate(all='ignore'):
        expected = platform.solve(motions)
    low, high = (p[name] for name in kind.position_limits)
    at = expected[:, kind.position.columns]
    usual = ((at > low) & (at < high)).all(axis=1)
    if kind.width == RESULT:
        levers = expected[:, places('stewart_result')['levers']] / p['legs.crank.length']
        usual &= (np.abs(levers) > p['limits.lever_min']).all(axis=1)
    found = np.zeros((count, RESULT), np.float32)
    codes = [inverse(*(ctypes.c_void_p(row.ctypes.data) for row in rows))
             for rows in zip(motions.astype(np.float32), found, strict=True)]
    assert usual.sum() > 0.5 * count
    assert not np.array(codes)[usual].any()
    errors = np.abs(found[:, :kind.width] - expected)[usual]
    largest = np.abs(expected[usual][:, kind.effort.columns]).max(axis=1)
    of_efforts = errors[:, kind.effort.columns].max(axis=1) / largest
    assert 0.1 * positions < errors[:, kind.position.columns].max() < positions
    assert 0.1 * efforts < of_efforts.max() < efforts


# Servos

SERVOS: dict[str, Any] = {
    'servo.pulse_min': [0.0005, 0.0006, 0.0005, 0.0009, 0.001, 0.0005],
    'servo.pulse_max': [0.0025, 0.0024, 0.0025, 0.0021, 0.002, 0.0025],
    'servo.angle_at_min': [-1.1, 1.2, -1.3, 0.9, -0.8, 1.1],
    'servo.angle_at_max': [1.3, -1.1, 1.2, -1.1, 0.9, -1.2]}


def servo_rig(**changes: Any) -> StewartPlatform:
    return StewartPlatform(Parameters.from_yaml(CRANK_FILE).replaced({**SERVOS, **changes}))


def test_servo_pulses_are_on_the_line_through_two_points_and_never_outside() -> None:
    rig, random = servo_rig(), rng(5)
    low, high = (np.array(SERVOS[f'servo.pulse_{end}']) for end in ('min', 'max'))
    first, last = (np.array(SERVOS[f'servo.angle_at_{end}']) for end in ('min', 'max'))
    part = random.uniform(0.0, 1.0, (500, 2, 6))
    found = rig.servo_pulses(first + part * (last - first))
    np.testing.assert_allclose(found, low + part * (high - low), rtol=0.0, atol=1e-17)
    for ends, pulses in (first, low), (last, high):
        np.testing.assert_allclose(rig.servo_pulses(ends), pulses, rtol=0.0, atol=1e-18)
        past = ends + 1e-12 * np.sign(ends)  # rounding: at the end, never outside
        assert rig.servo_pulses(past).tolist() == pulses.tolist()
    home = rig.inverse_kinematics(rig.home_pose())
    np.testing.assert_allclose(
        rig.servo_pulses(home), low + (high - low) * (0.0 - first) / (last - first), rtol=1e-12)


def test_servos_out_of_range_or_not_measured_get_no_pulses(snapshot: Snapshot) -> None:
    rig = servo_rig()
    with snapshot.raises(MotionError):
        rig.servo_pulses([[0.0] * 6, [0.0, 0.0, 0.0, 0.91, 0.0, 0.0]])
    with snapshot.raises(MotionError):
        rig.servo_pulses([0.0, 0.0, 0.0, 0.0, -0.81, math.nan])
    for path in CRANK_FILE, PLATFORM_FILE:
        with snapshot.raises(ParameterError):
            StewartPlatform(Parameters.from_yaml(path)).servo_pulses([0.0] * 6)
    fill, pulses = function('stewart_servo_pulses'), np.full(6, -1.0)
    hexapod = rig.structure
    for angles, code in (([0.0] * 5 + [1.11], 13), ([0.0] * 5 + [math.nan], 2)):
        assert fill(hexapod, np.array(angles), pulses) == code
        assert pulses.tolist() == [-1.0] * 6


@pytest.mark.parametrize('changes', [
    {'servo.angle_at_min': None}, {'servo.angle_at_min': 1.0, 'servo.angle_at_max': 1.0},
    {'servo.pulse_min': 0.0015, 'servo.pulse_max': [0.002, 0.002, 0.0015, 0.002, 0.002, 0.002]},
    {'servo.pulse_max': 2500.0}, {'servo.pulse_max': 2.5}, {'servo.angle_at_max': 60.0},
    {'servo.angle_at_min': -60.0}])
def test_points_of_servos_that_cannot_be(changes: dict[str, Any], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        servo_rig(**changes)


def test_servos_belong_to_drives_that_turn(snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        Parameters.from_yaml(PLATFORM_FILE).replaced(SERVOS)


@needs_compiler
def test_golden_vectors_are_not_met_by_another_hexapod(exported: Path, tmp_path: Path) -> None:
    shutil.copytree(exported, tmp_path / 'changed')
    source = tmp_path / 'changed' / 'hexapod.c'
    text = source.read_text()
    mass = float.hex(150.0)
    assert text.count(f'  {mass},  /* platform.mass: 150 kg */') == 1
    source.write_text(text.replace(mass, float.hex(math.nextafter(150.0, 200.0))))
    made = compile_c(tmp_path, '-std=c99', *source.parent.glob('*.c'))
    done = run_program(made, code=1)
    assert 'vector 0: demanded_force[0] is ' in done.out


@needs_compiler
@pytest.mark.slow
def test_golden_vectors_and_bad_inputs_are_clean_under_sanitizers(
        exported: Path, exported_cranks: Path, tmp_path: Path) -> None:
    options: list[str | Path] = [
        '-std=c99', '-g', '-fsanitize=address,undefined', '-fno-sanitize-recover=all',
        f'-I{exported}', exported / 'hexapod.c', exported / 'stewart_dynamics.c']
    probe = subprocess.run(
        [COMPILERS[0], '-fsanitize=address,undefined', '-xc', '-', '-o', tmp_path / 'probe'],
        input='int main(void) {return 0;}', text=True, capture_output=True)
    if probe.returncode:
        pytest.skip('the compiler has no sanitizers')
    of_cranks = [*options[:4], *exported_cranks.glob('*.c')]
    for given in ([*options, exported / 'test_golden.c'], of_cranks,
                  [*options, ROOT / 'test' / 'export_bad_inputs.c']):
        done = subprocess.run([compile_c(tmp_path, *given)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@needs_compiler
def test_32_bit_targets_compile(exported: Path, tmp_path: Path) -> None:
    """The syntax alone is checked: a library for 32 bits is not needed."""
    includes = subprocess.run([COMPILERS[0], '-print-multiarch'], capture_output=True,
                              text=True).stdout.strip()
    (tmp_path / 'gnu').mkdir()
    (tmp_path / 'gnu' / 'stubs-32.h').touch()  # of glibc for 32 bits
    options = ['-m32', '-fsyntax-only', f'-I{tmp_path}', '-isystem', f'/usr/include/{includes}']
    probe = subprocess.run([COMPILERS[0], *options, '-xc', '-'], input='#include <math.h>',
                           text=True, capture_output=True)
    if probe.returncode:
        pytest.skip('the compiler has no 32-bit target')
    assert not run_program(
        COMPILERS[0], *options, '-std=c99', *WARNINGS, *exported.glob('*.c')).err


@pytest.mark.skipif('gcc' not in COMPILERS, reason='needs gcc')
@pytest.mark.parametrize('level', few(['-O0', '-O2', '-O3'], 1))
def test_stack_is_bounded_and_nothing_recurses(tmp_path: Path, level: str) -> None:
    """The deepest chain of calls, by gcc's call graph; it needs no globals and no allocation."""
    made = tmp_path / 'source.o'
    done = subprocess.run(
        ['gcc', '-std=c99', level, '-fcallgraph-info=su', '-c', FOLDER / 'stewart_dynamics.c',
         '-o', made], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f'gcc: {done.stderr.strip()}')
    graph = made.with_suffix('.ci').read_text()
    stack = {name: int(size) for name, size in re.findall(
        r'node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \((?:static|dynamic,bounded)\)',
        graph)}
    assert 'stewart_step' in ' '.join(stack) and 'dynamic)' not in graph
    calls = re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', graph)

    def deepest(name: str, above: tuple[str, ...]) -> int:
        assert name not in above, 'recursion'
        return stack.get(name, 0) + 8 + max(
            (deepest(to, (*above, name)) for source, to in calls if source == name), default=0)

    assert max(deepest(name, ()) for name in stack) < 9216
    needed = {to for _, to in calls} - set(stack)
    assert needed <= {
        'sqrt', 'atan2', 'copysign', 'cos', 'expm1', 'fabs', 'hypot', 'memcpy', 'memset', 'rint',
        'sin', 'sincos', '__indirect_call'}
    symbols = subprocess.run(['nm', made], capture_output=True, text=True).stdout
    assert not re.findall(r' [BbCDdGgSs] ', symbols), symbols


@pytest.mark.skipif(not shutil.which('cppcheck'), reason='needs cppcheck')
def test_cppcheck_finds_nothing(exported: Path) -> None:
    assert not run_program(
        'cppcheck', '--quiet', '--std=c99', '--inconclusive', '--error-exitcode=1',
        '--enable=warning,style,performance,portability', *exported.glob('*.c')).err


def test_the_source_is_short_and_needs_math_alone() -> None:
    texts = [source(name) for name in SOURCES]
    assert sum(text.count('\n') for text in texts) < 2600  # of two kinds of legs
    assert all(len(line) < 100 for text in texts for line in text.splitlines())
    assert set(re.findall('#include <(.*)>', ''.join(texts))) == {'math.h', 'stddef.h', 'stdint.h'}


def test_tolerances_are_those_of_the_library() -> None:
    source = (FOLDER / 'stewart_dynamics.c').read_text()
    found = {name: float(value) for name, value in re.findall(
        r'^#define ([A-Z_]+) ([0-9.e-]+)\b', source, re.MULTILINE)}
    assert found.items() >= {
        'UNSOLVABLE_CONDITION': UNSOLVABLE_CONDITION,
        'ORTHOGONALITY': ORTHOGONALITY, 'QUATERNION_TOLERANCE': QUATERNION_TOLERANCE,
        'LIMIT_TOLERANCE': TOLERANCE, 'HYSTERESIS': HYSTERESIS,
        'JITTER': CONSTANTS['JITTER']}.items()


@needs_compiler
@pytest.mark.slow
def test_cmake_builds_tests_and_installs(exported: Path, tmp_path: Path) -> None:
    cmake = shutil.which('cmake', path=os.pathsep.join(
        [str(Path(sys.executable).parent), os.environ['PATH']]))
    if cmake is None:
        pytest.skip('needs cmake')
    if not any(map(shutil.which, ('c++', 'g++', 'clang++'))):
        pytest.skip('needs a C++ compiler')

    run_program(cmake, '-S', exported, '-B', tmp_path / 'build',
                f'-DCMAKE_INSTALL_PREFIX={tmp_path / "installed"}')
    run_program(cmake, '--build', tmp_path / 'build')
    run_program(Path(cmake).with_name('ctest'), '--test-dir', tmp_path / 'build')
    run_program(cmake, '--install', tmp_path / 'build')

    user = tmp_path / 'user'
    user.mkdir()
    (user / 'main.cpp').write_text(
        '#include <hexapod.h>\nint main() {return hexapod.mass == 150.0 ? 0 : 1;}\n')
    (user / 'CMakeLists.txt').write_text(
        'cmake_minimum_required(VERSION 3.15)\nproject(user CXX)\nfind_package(hexapod REQUIRED)\n'
        'add_executable(user main.cpp)\ntarget_link_libraries(user hexapod::hexapod)\n')
    run_program(cmake, '-S', user, '-B', user, f'-DCMAKE_PREFIX_PATH={tmp_path / "installed"}')
    run_program(cmake, '--build', user)
    run_program(user / 'user')


def test_golden_csv_is_read_as_it_was_computed(exported: Path) -> None:
    """Inputs read from it give the library the results in it."""
    with (exported / 'golden.csv').open() as file:
        texts = list(csv.DictReader(file))
    assert all(row[name].isdecimal() for row in texts for name in whole_columns(TELESCOPIC))
    rows = [{name: float(text) for name, text in row.items()} for row in texts]
    names = list(rows[0])
    step, state = Step(Parameters.from_yaml(PLATFORM_FILE)), FIRST
    for row in rows:
        numbers = [row[name] for name in names]
        output = step(Batch.from_parts(int(row['stamp']), numbers[2:26], numbers[26:32],
                                       bases=numbers[32:44] if row['has_base'] else None), state)
        assert output.with_efforts.tolist() == [True]
        state = output.state
        assert [row[f'force_{leg}'] for leg in range(1, 7)] == output.efforts[0].tolist()
        assert row['determinant'] == output.determinants[0]
    assert {row['has_base'] for row in rows} == {0.0, 1.0}
    assert any(row['exceeded_1'] for row in rows) and not rows[0]['exceeded_1']


# Files and command line

def test_files_are_the_same_in_every_run(exported: Path, tmp_path: Path) -> None:
    printed = call(main, '--params', PLATFORM_FILE, '--output', tmp_path / 'new')
    names = ['stewart_dynamics.h', 'stewart_dynamics.c', 'hexapod.h', 'hexapod.c', 'golden.csv',
             'test_golden.c', 'CMakeLists.txt']
    assert printed.out.split() == [str(tmp_path / 'new' / name) for name in names]
    assert printed.err == ''
    for name in names:
        assert (tmp_path / 'new' / name).read_bytes() == (exported / name).read_bytes()
    for name in SOURCES:
        assert (exported / name).read_text() == source(name)
    text = (exported / 'hexapod.c').read_text()
    assert digest(Parameters.from_yaml(PLATFORM_FILE)) in text
    assert '  {0x0.0p+0, 0x0.0p+0, -0x1.39d013a92a305p+3},  /* gravity: 0, 0, -9.80665' in text


def test_existing_files_are_kept_unless_replacement_is_requested(
        tmp_path: Path, snapshot: Snapshot) -> None:
    (tmp_path / 'rig.c').write_text('mine')
    given = '--params', PLATFORM_FILE, '--output', tmp_path, '--name', 'rig'
    snapshot(call(main, *given, code=2).err)
    assert [path.name for path in tmp_path.iterdir()] == ['rig.c']
    call(main, *given, '--force')
    assert 'const stewart_platform rig = {' in (tmp_path / 'rig.c').read_text()


@pytest.mark.parametrize('name', [
    '', '2nd', 'a b', '_reserved', 'int', 'class', 'sqrt', 'stewart_dynamics', 'Stewart_Export',
    'test_golden', 'all', 'NULL', 'linux', 'größe', '../hexapod', 'a' * 64])
def test_names_that_c_cannot_have(name: str, tmp_path: Path) -> None:
    error = call(main, '--params', PLATFORM_FILE, '--output', tmp_path, '--name', name, code=2).err
    assert error.count('\n') == 1 and name[:30] in error
    assert 'must be a C identifier' in error or 'a word of C, C++ or CMake' in error
    assert not list(tmp_path.iterdir())


def test_bad_parameters_are_one_line(tmp_path: Path) -> None:
    for path in tmp_path / 'missing.yaml', ROOT / 'README.md', ROOT / 'config' / 'stacked.yaml':
        error = call(main, '--params', path, '--output', tmp_path / 'out', code=2).err
        assert error.count('\n') == 1 and str(path) in error
    assert not (tmp_path / 'out').exists()
    call(main, '--params', ROOT / 'config' / 'stacked.yaml', '--node', 'upper_hexapod', '--output',
         tmp_path / 'out')


def test_a_possible_error_is_printed_before_the_error_that_follows_from_it(
        tmp_path: Path, snapshot: Snapshot) -> None:
    path = tmp_path / 'mm.yaml'
    Parameters.from_yaml(PLATFORM_FILE).replaced({
        'limits.length_min': 950.0, 'limits.length_max': 1650.0,
        'limits.base_joint_angle_max': 0.6}).to_yaml(path)
    error = call(main, '--params', path, '--output', tmp_path / 'out', code=2).err
    *warnings, error = error.splitlines()
    snapshot(warnings[0])
    snapshot(error)


def test_an_output_that_is_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    error = call(main, '--params', PLATFORM_FILE, '--output', tmp_path / 'file', code=2).err
    assert error.count('\n') == 1


@needs_compiler
def test_names_of_legs_stay_in_their_comments(tmp_path: Path) -> None:
    p = Parameters.from_yaml(PLATFORM_FILE).replaced({
        'joints': ('*/ #error', '/* a', 'b\\', '*//*/', 'Bein ü', '??/')})
    for name, text in c_project(p, 'rig').items():
        (tmp_path / name).write_text(text)
    compile_c(tmp_path, '-std=c99', *WARNINGS, *tmp_path.glob('*.c'))


def test_the_digest_is_that_of_the_numbers() -> None:
    p = Parameters.from_yaml(PLATFORM_FILE)
    assert digest(p) == digest(p.replaced({'base_frame': 'floor', 'visualization_rate': 5.0}))
    heavier = p.replaced({'platform.mass': math.nextafter(150.0, 200.0)})
    assert digest(p) != digest(heavier)


def test_hexapods_without_a_home_pose_are_exported_unless_axes_need_one(
        snapshot: Snapshot) -> None:
    p = random_parameters(rng())
    assert 'golden.csv' in c_project(p, 'rig')
    with snapshot.raises(StewartError):
        c_project(p.replaced({'limits.base_joint_angle_max': 0.5}), 'rig')
    assert check_name('rig_2') == 'rig_2'
