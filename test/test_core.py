# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The library in C: its structures and calls, and several samples side by side."""

from __future__ import annotations

import ctypes
from importlib.util import find_spec
import math
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from referees import (
    QUARTER_TURN, random_base_motion, random_motion, random_parameters, random_wrench, rng, ROOT,
    symmetric_parameters)
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.core import binding
from stewart_dynamics.core.binding import CODES, Function, function, places, record, RULES
from stewart_dynamics.mechanics.rows import BASE, MOTION, POSE, POSITION, RESULT, TWIST
from stewart_dynamics.parameters.structure import broken_rule

CORE = ROOT / 'stewart_dynamics' / 'core'
COMPILER = next(filter(None, map(shutil.which, ('cc', 'gcc', 'clang'))), None)
KINDS = ('baseline', 'avx2', 'avx512')[:function('processor_kind')() + 1]
SIZES = 1, 2, 3, 7, 8, 9, 33


CRANKS = Parameters.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
SERVOS = CRANKS.replaced({'servo.angle_at_min': -0.5, 'servo.angle_at_max': 0.5})


def hexapods() -> list[Parameters]:
    """
    Return a random hexapod, one with turning screws, a symmetric one, and two with cranks.

    The first with cranks has both branches and centers of mass off all lines, on tilted gravity.
    """
    random, of_cranks = random_parameters(rng(1)), rng(2)
    return [random, random.replaced({
        'actuator.screw_lead': 0.02, 'drive.gear_ratio': 1.5,
        'drive.screw_rotation': 'universal'}), symmetric_parameters(), CRANKS.replaced({
            'gravity': random.gravity, 'geometry.crank_branch': ['positive', 'negative'] * 3,
            'limits.angle_min': -4.0, 'limits.angle_max': 4.0,
            'legs.crank.center_of_mass': of_cranks.uniform(-0.1, 0.1, 18),
            'legs.crank.inertia': [0.02, 1e-3, 2e-3, 0.03, -1e-3, 0.04] * 6,
            'legs.rod.mass': of_cranks.uniform(0.5, 3.0, 6),
            'legs.rod.center_of_mass': of_cranks.uniform(0.2, 0.5, 6),
            'actuator.reflected_inertia': of_cranks.uniform(0.0, 0.5, 6)}), CRANKS]


class LaneRows(ctypes.Structure):
    """``lane_rows`` of lanes.h."""

    _fields_ = [('first', ctypes.c_void_p), ('stride', ctypes.c_int64)]


def samples(parameters: Parameters, count: int) -> tuple[Any, Any, Any]:
    """Return motions, wrenches and bases: ordinary, singular, overflowing, at rest, still."""
    random = rng(count)
    motions = random_motion(parameters, random, count).rows.copy()
    if parameters.leg_kind.marker:  # near home, beside poses that the legs do not reach
        motions[:, POSITION] *= 0.1
        motions[:, POSITION] += 0.95 * StewartPlatform(parameters).home_pose().position
    motions[1::5, :POSE.stop] = [0.0, 0.0, 1.0, *QUARTER_TURN.ravel()]
    motions[2::7, TWIST] *= 1e200
    motions[3::5, TWIST.start:] = 0.0
    bases = random_base_motion(parameters, random, count).rows.copy()
    bases[::3] = np.nan
    return motions, random_wrench(parameters, random, count), bases


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('hexapod', range(5))
def test_samples_side_by_side_have_the_bits_of_each_alone(kind: str, hexapod: int) -> None:
    parameters = hexapods()[hexapod]
    structure, width = StewartPlatform(parameters).structure, parameters.leg_kind.width
    of = places('one_motion')
    many = ctypes.CDLL(str(CORE / 'library.so'))[f'solve_lanes_{kind}']
    for count in SIZES:
        motions, wrenches, bases = samples(parameters, count)
        for loads, moving in ((wrenches, bases), (wrenches[:1], bases[-1:])):
            alone, found = np.empty((count, RESULT)), np.empty((count, width))
            sample = np.zeros(1, record('one_motion'))
            for n in range(count):
                sample['wrench'], row = loads[n % len(loads)], sample.view(float)
                row[of['motion']], row[of['base']] = motions[n], moving[n % len(moving)]
                function('solve_one')(structure, sample)
                alone[n] = row[of['result']]
            many(ctypes.c_void_p(structure.ctypes.data), ctypes.c_int64(count),
                 *(LaneRows(each.ctypes.data, 0 if len(each) == 1 else each.shape[1])
                   for each in (motions, loads, moving)),
                 1, ctypes.c_void_p(found.ctypes.data), ctypes.c_int64(width),
                 ctypes.c_int64(width))
            assert np.array_equal(found, alone[:, :width], equal_nan=True)
            # All but samples that overflow, and those that a rod does not reach.
            reached = np.isfinite(found).all(axis=1)
            assert count < 33 or 12 <= np.count_nonzero(reached) < count


def test_without_the_condition_number_the_rest_has_the_same_bits() -> None:
    for parameters in hexapods():
        platform = StewartPlatform(parameters)
        motions, wrenches, bases = samples(parameters, 33)
        whole = platform.solve(motions, wrenches, bases)
        rest = platform.solve(motions, wrenches, bases, condition=False)
        at = places('stewart_result')['condition_number']
        assert not rest[:, at].any()
        rest[:, at] = whole[:, at]
        assert np.array_equal(rest, whole, equal_nan=True)


@pytest.mark.skipif(COMPILER is None, reason='needs a C compiler')
def test_structures_are_laid_out_as_the_compiler_lays_them_out(tmp_path: Path) -> None:
    text = ''.join((CORE / name).read_text() for name in (
        'stewart_dynamics.h', 'control.h', 'library.h'))
    names = re.findall(r'^\}? ?.*\} (\w+);$|^  (\w+);$', text, re.MULTILINE)
    listed = [a or b for a, b in names if re.search(rf'\b{a or b};', text)]
    assert {'stewart_platform', 'stewart_output', 'one_plant', 'setpoint'} <= set(listed)
    lines, expected = [], []
    for name in listed:
        fields: Any = record(name).fields
        lines.append(f'printf("%zu\\n", sizeof({name}));')
        expected.append(record(name).itemsize)
        for field, (_, offset) in fields.items():
            lines.append(f'printf("%zu\\n", offsetof({name}, {field}));')
            expected.append(offset)
    source = tmp_path / 'sizes.c'
    source.write_text('#include "library.h"\n#include <stddef.h>\n#include <stdio.h>\n'
                      f'int main(void) {{{"".join(lines)} return 0;}}\n')
    program = tmp_path / 'sizes'
    subprocess.run([str(COMPILER), f'-I{CORE}', source, '-o', program], check=True)
    printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    assert [int(each) for each in printed.split()] == expected
    assert (8 * MOTION, 8 * BASE, 8 * RESULT) == tuple(
        record(f'stewart_{name}').itemsize for name in ('motion', 'base', 'result'))


def test_codes_are_those_of_the_header() -> None:
    assert (CODES['STEWART_OK'], CODES['STEWART_NO_MOTORS']) == (0, 9)
    assert (CODES['STEWART_CROSSED'], CODES['STEWART_JUMP']) == (3, 128)


@pytest.mark.parametrize('motions', [
    np.zeros((2, MOTION), dtype=np.float32), np.zeros((MOTION, 2)).T, np.zeros(48, dtype='>f8'),
    np.zeros((2, MOTION), dtype=np.int64)])
def test_an_array_of_another_type_or_layout_is_rejected(motions: Any) -> None:
    platform = StewartPlatform(symmetric_parameters())
    with pytest.raises(TypeError, match='must be of stewart_motion, in C order'):
        function('twists_many')(platform.structure, 2, np.zeros((2, 6)), motions)


def test_a_function_that_no_header_declares_is_an_error() -> None:
    with pytest.raises(KeyError, match='no_such_function'):
        function('no_such_function')


def test_a_library_that_is_not_built_is_one_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(binding, '_FOLDER', tmp_path)
    binding._library.cache_clear()
    try:
        with pytest.raises(ImportError, match=r'library\.so: .*not built for this system: ins'):
            Function('processor_kind')()
    finally:
        binding._library.cache_clear()


@pytest.mark.skipif(find_spec('ziglang') is not None, reason='there is always a compiler')
def test_without_a_compiler_the_build_says_in_one_line_what_to_install(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, 'setup.py', '-q', 'build_ext', '--build-lib', tmp_path / 'lib',
         '--build-temp', tmp_path / 'temp'], cwd=ROOT, capture_output=True, text=True,
        env={**{name: text for name, text in os.environ.items() if name != 'CC'},
             'PATH': str(tmp_path)})
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        'stewart_dynamics: found no C compiler: install one (Debian and Ubuntu: apt install gcc ')


def test_a_motion_is_found_again_from_its_legs() -> None:
    parameters = random_parameters(rng(7))
    structure = StewartPlatform(parameters).structure
    given = random_motion(parameters, rng(8), 50)
    arms = parameters['geometry.platform_joints'] @ given.rotation.swapaxes(-1, -2)
    legs = given.position[:, None] + arms - parameters['geometry.base_joints']
    lengths = np.linalg.norm(legs, axis=-1)
    spin, turning = given.angular_velocity[:, None], given.angular_acceleration[:, None]
    speeds = given.linear_velocity[:, None] + np.cross(spin, arms)
    changes = given.linear_acceleration[:, None] + np.cross(turning, arms) + np.cross(
        spin, np.cross(spin, arms))
    rates = np.sum(legs * speeds, axis=-1) / lengths  # of L^2 = l . l
    accelerations = (np.sum(speeds ** 2 + legs * changes, axis=-1) - rates ** 2) / lengths
    call = function('stewart_motion_of_legs')
    for row, *of_legs in zip(given.rows, rates, accelerations, strict=True):
        motion = row.copy()
        motion[POSE.stop:] = np.nan
        assert call(structure, *of_legs, motion) == CODES['STEWART_OK']
        assert motion == pytest.approx(row, rel=1e-9, abs=1e-9)
    for spoilt, code in ((np.inf, 'STEWART_NOT_FINITE'), (1e308, 'STEWART_OUT_OF_RANGE')):
        assert call(structure, np.full(6, spoilt), np.zeros(6), motion) == CODES[code]
    motion[:POSE.stop] = [0.0, 0.0, 0.0, *np.eye(3).ravel()]
    motion[3] = 2.0
    assert call(structure, rates[0], rates[0], motion) == CODES['STEWART_NOT_A_ROTATION']
    flat = StewartPlatform(symmetric_parameters()).structure
    motion[:POSE.stop] = [0.0, 0.0, 1.0, *QUARTER_TURN.ravel()]
    kept = motion.copy()
    assert call(flat, rates[0], rates[0], motion) == CODES['STEWART_SINGULAR']
    assert np.array_equal(motion, kept)


def broken(name: str) -> Any:
    """
    Return the complete structure of a hexapod that breaks a rule.

    One with drives and plates; the rules that cranks have are broken by one with cranks.
    """
    hexapod: Any = (SERVOS if name in OF_CRANKS else HEXAPOD).structure.copy()
    legs = hexapod['legs']
    if name == 'TEMPERATURE_RISE':
        legs['thermal_time_constant'] = NOT
    field, value = BREAKING[name]
    if isinstance(value, tuple):
        leg, value = value
        legs[field][leg] = value
    else:
        hexapod[field] = value
    return hexapod


HEXAPOD = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml').replaced({
    'actuator.screw_lead': 0.01, 'drive.torque_speed': [0.0, 9.0, 300.0, 1.0],
    'drive.torque_constant': 0.5, 'drive.resistance': 1.0, 'drive.thermal_resistance': 1.0,
    'drive.thermal_time_constant': 9.0, 'drive.temperature_rise_max': 50.0,
    'legs.cylinder.radius': 0.05, 'legs.cylinder.length': 0.6, 'legs.piston.radius': 0.03,
    'limits.leg_clearance_min': 0.01,
    'geometry.base_outline': [-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0],
    'geometry.platform_outline': [-0.6, -0.6, 0.0, 0.6, -0.6, 0.0, 0.0, 0.6, 0.0]})
NOT = math.nan
SQUARE = HEXAPOD.structure['base_outline']


def corner(n: int, *xyz: float) -> Any:
    """Return the corners of the base with another one."""
    corners = SQUARE.copy()
    corners[n] = xyz
    return corners


# A field and a value for each rule; of a leg, its number and the value.
BREAKING: dict[str, tuple[str, Any]] = {
    'FINITE': ('gravity', [0.0, 0.0, NOT]), 'MASS': ('mass', 0.0),
    'INERTIA': ('inertia', [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]),
    'ONE_POINT': ('platform_joint', (slice(None), [0.5, 0.0, 0.0])),
    'CHARACTERISTIC_LENGTH': ('characteristic_length', -1.0),
    'WARN_CONDITION': ('warn_condition', 0.5), 'STOP_CONDITION': ('stop_condition', 2.0),
    'WARN_TIME': ('warn_time', -1.0), 'LEG_MASS': ('piston_mass', (3, -1.0)),
    'ACTUATOR': ('viscous_friction', (0, NOT)), 'COULOMB_VELOCITY': ('coulomb_velocity', (5, 0.0)),
    'LIMIT': ('force_max', (1, 0.0)), 'LENGTHS': ('length_min', (2, 9.0)),
    'SHAPE': ('cylinder_length', (4, NOT)), 'RADII': ('piston_radius', (0, 0.06)),
    'BASE_AXIS': ('base_joint_axis', (1, 0.0)),
    'PLATFORM_AXIS': ('platform_joint_axis', (2, 0.0)),
    'BASE_UNIVERSAL': ('base_universal_axis', (3, 0.0)),
    'PLATFORM_UNIVERSAL': ('platform_universal_axis', (4, 0.0)),
    'SCREW_LEAD': ('screw_lead', (5, 0.0)), 'EFFICIENCY': ('efficiency', (0, 1.5)),
    'RESISTANCE': ('torque_constant', (1, NOT)), 'THERMAL_RESISTANCE': ('resistance', (2, NOT)),
    'THERMAL_TIME_CONSTANT': ('thermal_resistance', (3, NOT)),
    'TEMPERATURE_RISE': ('thermal_resistance', (0, NOT)),
    'TORQUE_SPEED': ('torque_speed', -1.0), 'CORNERS': ('n_base_outline', 2),
    'CORNERS_ON_A_LINE': ('base_outline', 1.0),
    'CORNERS_IN_A_PLANE': ('base_outline', corner(2, 1.0, 1.0, 0.1)),
    'CONVEX': ('base_outline', corner(2, -0.5, -0.5, 0.0)), 'POINTS': ('n_torque_speed', 1000)}
OF_CRANKS: dict[str, tuple[str, Any]] = {
    'KIND': ('crank_length', (1, 0.0)), 'ROD_LENGTH': ('rod_length', (0, 0.0)),
    'CRANK_AXIS': ('crank_axis', (2, 0.0)),
    'CRANK_DIRECTION': ('crank_direction', (
        3, [0.0, 0.0, 1.0] - 2e-3 * CRANKS.structure['legs']['crank_axis'][3])),
    'BRANCH': ('branch', (4, 0.0)), 'CRANK_INERTIA': (
        'crank_inertia', (5, [1.0, 0.0, 0.0, 1.0, 0.0, -1e-6])),
    'ANGLES': ('angle_min', (0, 2.0)), 'LEVER': ('lever_min', (1, 1.0)),
    'SERVO_POINTS': ('servo_angle_at_min', (2, NOT)),
    'SERVO_ANGLES': ('servo_angle_at_min', (3, 0.5)),
    'SERVO_PULSES': ('servo_pulse_min', (4, 3e-3))}
BREAKING |= OF_CRANKS


@pytest.mark.parametrize('name', BREAKING)
def test_a_broken_rule_is_named_with_its_leg(name: str) -> None:
    assert broken_rule(HEXAPOD.structure) is None is broken_rule(SERVOS.structure)
    found = broken_rule(broken(name))
    assert found is not None
    rule, where = found
    assert rule.name == name
    leg = BREAKING[name][1][0] if isinstance(BREAKING[name][1], tuple) else None
    assert where == (leg if isinstance(leg, int) else 0 if name in (
        'CORNERS', 'CORNERS_ON_A_LINE', 'CORNERS_IN_A_PLANE', 'CONVEX') else -1)


@pytest.mark.parametrize(('field', 'value', 'rule'), [
    ('crank_length', NOT, 'KIND'), ('crank_length', math.inf, 'FINITE'),
    ('rod_length', NOT, 'FINITE'), ('crank_center_of_mass', NOT, 'FINITE'),
    ('crank_mass', -1.0, 'LEG_MASS'),
    ('rod_mass', NOT, 'LEG_MASS'), ('rod_inertia', -1e-3, 'LEG_MASS'),
    ('crank_inertia', [-1e-3, 0.0, 0.0, 0.0, 0.0, 0.0], 'CRANK_INERTIA'),
    ('crank_direction', 0.0, 'CRANK_DIRECTION'), ('lever_min', -0.1, 'LIMIT'),
    ('angle_max', NOT, 'LIMIT'), ('crank_torque_max', 0.0, 'LIMIT')])
def test_a_crank_keeps_the_rules_of_all_legs(field: str, value: Any, rule: str) -> None:
    hexapod: Any = CRANKS.structure.copy()
    hexapod['legs'][field][4] = value
    found = broken_rule(hexapod)
    assert found is not None
    assert (found[0].name, found[1]) == (rule, 4)


def test_each_rule_is_tried() -> None:
    assert {rule.name for rule in RULES.values()} == {*BREAKING}
