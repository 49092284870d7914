# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The ros2_control controller: its feed-forward without ROS, its parameters, its files."""

from __future__ import annotations

from collections.abc import Sequence
import importlib.util
import json
import math
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree as ET

from crank_machines import random_machine, random_state
from crank_platforms import motion_of, parameters_of
from governed import limited_hexapod
import numpy as np
from programs import run_program
import pytest
from referees import Array, random_motion, random_wrench, rng
from stewart_dynamics import Parameters, StewartPlatform
from stewart_dynamics.core.binding import record
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.urdf import MOCK, Ros2Control, urdf
from stewart_dynamics.legs import CRANK, TELESCOPIC
from stewart_dynamics.mechanics.limits import LIMITS
from stewart_dynamics.parameters.table import UNIVERSAL
from stewart_dynamics.setpoints.step import Batch, Step
from test_circles import CIRCLES
from test_export import limited
import yaml

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / 'ros2_control' / 'stewart_dynamics_controller'
C_SOURCE = ROOT / 'stewart_dynamics' / 'core'
NAME = 'stewart_dynamics_controller'
OUTPUT_FIELDS = record('stewart_output').names or ()
OF_ALL = {limit.bit for limit in LIMITS.values()
          if not limit.name.startswith(TELESCOPIC.foreign)}


@pytest.mark.parametrize(('c', 'cpp'), [('gcc', 'g++'), ('clang', 'clang++')])
def test_feed_forward(c: str, cpp: str, tmp_path: Path) -> None:
    """The feed-forward compiles without a warning, and passes its test, with sanitizers by gcc."""
    if not shutil.which(c) or not shutil.which(cpp):
        pytest.skip(f'needs {c} and {cpp}')
    checked = ['-O1', '-fsanitize=address,undefined', '-fno-sanitize-recover=all'
               ] if c == 'gcc' else ['-O0']
    program = tmp_path / 'feed_forward_test'
    subprocess.run([c, '-std=c99', *checked, '-c', C_SOURCE / 'control.c',
                    '-o', tmp_path / 'c.o'], check=True)
    subprocess.run([
        cpp, '-std=c++17', '-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Werror',
        *checked, f'-I{C_SOURCE}', f'-I{PACKAGE / "include"}', tmp_path / 'c.o',
        PACKAGE / 'src' / 'feed_forward.cpp', PACKAGE / 'test' / 'feed_forward_test.cpp',
        '-o', program], check=True)
    done = run_program(program)
    assert done.out == 'all checks passed\n'


def test_parameters_are_those_of_the_node() -> None:
    """The declaration of the parameters is the one that make docs writes."""
    path = ROOT / 'docs' / 'figures' / 'tables.py'
    spec = importlib.util.spec_from_file_location('tables', path)
    assert spec is not None
    assert spec.loader is not None
    tables: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    assert tables.CONTROLLER_PARAMETERS.read_text() == tables.controller_parameters()
    source = (PACKAGE / 'src' / 'hexapod.cpp').read_text()
    for name in {*tables.LEG_FIELDS.values(), *tables.LISTS.values()} - {*LIMITS}:
        assert f'"{name}"' in source, name  # read, and named in errors


CPP_TYPES = {'double': 'double', 'string': 'std::string', 'bool': 'bool', 'int': 'std::int64_t'}
READERS = r"""
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iomanip>
#include <istream>
#include <string>
#include <vector>

namespace stewart_dynamics_controller
{
inline void read(std::istream & text, std::string & value) {text >> std::quoted(value);}
inline void read(std::istream & text, bool & value)
{
  std::string word;
  text >> word;
  value = word == "true";
}
inline void read(std::istream & text, double & value)
{
  std::string word;
  text >> word;
  value = std::strtod(word.c_str(), nullptr);
}
template<typename List>
void read_all(std::istream & text, List & values)
{
  for (auto & each : values) {
    read(text, each);
  }
}
template<typename T, std::size_t N>
void read(std::istream & text, std::array<T, N> & values) {read_all(text, values);}
template<typename T>
void read(std::istream & text, std::vector<T> & values)
{
  std::size_t count;
  text >> count;
  values.resize(count);
  read_all(text, values);
}
"""


def declared() -> dict[str, Any]:
    """Return names and declarations of the controller's parameters."""
    document = yaml.safe_load((PACKAGE / 'src' / f'{NAME}_parameters.yaml').read_text())[NAME]
    found: dict[str, Any] = {}

    def visit(section: dict[str, Any], above: str) -> None:
        for key, value in section.items():
            if isinstance(value.get('type'), str):
                found[above + key] = value
            else:
                visit(value, f'{above}{key}.')

    visit(document, '')
    return found


def parameters_header() -> str:
    """Return the structure that generate_parameter_library declares, and a reader of text."""
    def structure(names: dict[str, Any]) -> str:
        text = ''
        for section in dict.fromkeys(name.split('.')[0] for name in names):
            inner = {name.partition('.')[2]: kind for name, kind in names.items()
                     if name.split('.')[0] == section}
            if '' in inner:
                kind = inner['']
                cpp = CPP_TYPES[kind.removesuffix('_array')]
                text += (f'std::vector<{cpp}>' if kind.endswith('_array') else cpp) + (
                    f' {section}{{}};\n')
            else:
                text += f'struct {{\n{structure(inner)}}} {section};\n'
        return text

    names = {name: each['type'] for name, each in declared().items()}
    reading = '\n'.join(f'read(text, p.{name});' for name in names)
    return ('#include <array>\n' + READERS + f'struct Params\n{{\n{structure(names)}}};\n'
            f'inline void read(std::istream & text, Params & p)\n{{\n{reading}\n}}\n}}\n')


def as_text(parameters: Parameters, changes: dict[str, Any] | None = None) -> str:
    """Return the parameters of the node as the program reads those of the controller."""
    words: list[str] = []
    for name, declaration in declared().items():
        default = declaration.get('default_value')
        known = name in parameters.given or default is None  # else: what follows from others
        value = parameters[name] if known else default
        value = (changes or {}).get(name, default if value is None else value)
        kind = declaration['type'].removesuffix('_array')
        values = list(np.ravel(value))
        if kind != declaration['type']:
            words.append(str(len(values)))
        words += [float(each).hex() if kind == 'double' else json.dumps(
            bool(each) if kind == 'bool' else str(each)) for each in values]
    return '\n'.join(words) + '\n'


CHECKED = '-O1', '-fsanitize=address,undefined', '-fno-sanitize-recover=all'


def compiled(folder: Path, source: str, options: Sequence[str] = CHECKED) -> Path:
    """Return the program of a source in C++ with the hexapod of the controller's parameters."""
    if not shutil.which('gcc') or not shutil.which('g++'):
        pytest.skip('needs gcc and g++')
    (folder / NAME).mkdir()
    (folder / NAME / f'{NAME}_parameters.hpp').write_text(parameters_header())
    subprocess.run(['gcc', '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror', *options,
                    '-c', C_SOURCE / 'control.c', '-o', folder / 'c.o'], check=True)
    subprocess.run(
        ['g++', '-std=c++17', '-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow',
         '-Werror', *options, f'-I{folder}', f'-I{C_SOURCE}', f'-I{PACKAGE / "include"}',
         folder / 'c.o', PACKAGE / 'src' / 'hexapod.cpp', PACKAGE / 'src' / 'feed_forward.cpp',
         ROOT / 'test' / source, '-o', folder / 'program'], check=True)
    return folder / 'program'


@pytest.fixture(scope='module')
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program that steps the hexapod of the controller's parameters."""
    return compiled(tmp_path_factory.mktemp('hexapod'), 'hexapod_steps.cpp')


COUNT = 20  # steps


def assert_steps(program: Path, p: Parameters, motions: Array, wrenches: Array, stamps: Any = None,
                 ) -> Any:
    """Compare all numbers of steps with the node's; return the records."""
    if stamps is None:
        stamps = np.cumsum(np.full(len(motions), 300_000_000))
    rows = [f'{stamp}\n' + '\n'.join(map(float.hex, (*motion, *wrench)))
            for stamp, motion, wrench in zip(
                stamps.tolist(), motions.tolist(), wrenches.tolist(), strict=True)]
    text = '\n'.join([as_text(p) + str(len(rows)), *rows])
    done = subprocess.run([program], input=text.encode(), capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b'')
    found = np.frombuffer(done.stdout, record('stewart_output'))
    outputs = Step(p)(Batch.from_parts(stamps, motions, wrenches))
    expected = outputs.records.copy()
    # Without forces: those of C are zero, those of Python nan.
    unknown = ~outputs.with_efforts
    expected['forces'][unknown] = expected['motors']['commands'][unknown] = 0.0
    assert outputs.solvable.all()
    for name in OUTPUT_FIELDS:
        assert found[name].tobytes() == expected[name].tobytes(), name
    return found


def assert_random_steps(program: Path, p: Parameters, random: np.random.Generator) -> Any:
    """Compare steps in random motions."""
    return assert_steps(
        program, p, random_motion(p, random, COUNT).rows, random_wrench(p, random, COUNT),
        np.cumsum(random.choice([10_000_000, 300_000_000], COUNT)))


def test_steps_have_the_bits_of_the_node(program: Path) -> None:
    """Forces, torques of motors, heat, limits: all numbers of each step, whatever is given."""
    random = rng(55)
    seen: set[int | str] = set()
    for _ in range(40):
        # The controller has all numbers of a setpoint in one cycle: no tolerance of stamps.
        p = limited(random).replaced({'setpoint.sync_tolerance': 0.0})
        if random.random() < 0.5:
            p = p.replaced({'payload.mass': 40.0, 'payload.center_of_mass': [0.1, -0.1, 0.3],
                            'payload.inertia': [2.0, 0.1, 0.2, 3.0, -0.1, 4.0]})
        if p.drive.screw_rotation == UNIVERSAL and random.random() < 0.5:
            axes = random.normal([2.0, 0.5, 0.0], 0.3, (2, 6, 3))
            p = p.replaced(dict(zip(
                ('drive.base_universal_axes', 'drive.platform_universal_axes'),
                axes.reshape(2, 18), strict=True)))
        found = assert_random_steps(program, p, random)
        seen |= {bits for bits in OF_ALL if (found['exceeded'] & bits).any()}
        if np.isfinite(found['motors']['commands']).all():
            seen.add('motors')
    assert seen == {*OF_ALL, 'motors'}


def test_circles_and_axes_of_the_home_pose_have_the_bits_of_the_node(program: Path) -> None:
    """Joints on circles, and joint axes along the legs at home, on both sides of the base."""
    random, exceeded, sides = rng(56), 0, set()
    for n in range(30):
        p = limited_hexapod(random, 'all')[0]
        side = str(random.choice(['auto', 'positive', 'negative']))
        p = p.replaced({'geometry.platform_side': side, **(  # n odd: points in no plane
            {} if n % 2 else {**CIRCLES, 'geometry.base_height': random.normal()})})
        found = assert_random_steps(program, p, random)
        exceeded |= int(np.bitwise_or.reduce(found['exceeded'], axis=None))
        sides.add(side)
        assert np.isfinite(found['base_joint_angles']).all()
    assert len(sides) == 3
    for name in ('limits.base_joint_angle_max', 'limits.platform_joint_angle_max'):
        assert exceeded & LIMITS[name].bit


def test_steps_of_cranks_have_the_bits_of_the_node(program: Path) -> None:
    """Angles, speeds, torques, levers, limits, motors; full tensors, tilted axes, branches."""
    seen: set[int | str] = set()
    of_cranks = {limit.bit for limit in LIMITS.values() if limit.name.startswith(CRANK.own)}
    for seed in range(30):
        random = rng(seed)
        machine = random_machine(random)
        drives = {'drive.gear_ratio': random.uniform(5.0, 50.0, 6), 'drive.efficiency': 0.8,
                  'actuator.reflected_inertia': None, 'drive.motor_inertia': 1e-4,
                  'drive.torque_max': random.uniform(0.01, 100.0, 6)} if seed % 2 else {}
        p = parameters_of(machine, **{
            'setpoint.sync_tolerance': 0.0, 'limits.speed_max': random.uniform(1.0, 20.0, 6),
            'limits.torque_max': 10.0 ** random.uniform(0.0, 4.0, 6),
            'limits.rod_force_max': 10.0 ** random.uniform(1.0, 5.0, 6),
            'limits.lever_min': random.uniform(0.0, 0.5, 6),
            'limits.angle_min': machine.middle - random.uniform(0.2, 3.0, 6),
            'limits.angle_max': machine.middle + random.uniform(0.2, 3.0, 6)})
        p = p.replaced(drives)
        states = [random_state(machine, random, False) for _ in range(COUNT)]
        found = assert_steps(
            program, p, np.stack([motion_of(state).rows for state in states]),
            np.stack([state.wrench for state in states]))
        seen |= {bits for bits in of_cranks if (found['exceeded'] & bits).any()}
        if np.isfinite(found['motors']['commands']).all():
            seen.add('motors')
    assert seen == {*of_cranks, 'motors'}


def test_headings_and_branches_of_home_have_the_bits_of_the_node(program: Path) -> None:
    """The example, mirrored, hanging and turned: axes and branches follow from headings."""
    example, random, branches = Parameters.from_yaml(
        ROOT / 'config' / 'crank_platform.yaml'), rng(9), set()
    for n in range(8):
        p = example.replaced({
            'setpoint.sync_tolerance': 0.0,
            'geometry.crank_angles': example.geometry.crank_angles + (math.pi if n % 2 else 0.0),
            'geometry.platform_side': 'negative' if n >= 4 else 'auto',
            'legs.rod.length': random.uniform(0.7, 0.75), 'singularity.action': 'warn'})
        home = StewartPlatform(p).home_pose()
        motions = np.zeros((5, 24))
        motions[:, :3] = home.position + random.uniform(-0.02, 0.02, (5, 3))
        motions[:, 3:12] = home.rotation.ravel()
        motions[:, 12:] = random.normal(0.0, 0.5, (5, 12))
        found = assert_steps(program, p, motions, random.normal(0.0, 100.0, (5, 6)))
        branches.add(tuple(np.sign(found['result']['levers'][0])))
    assert len(branches) > 1


# Changes of the parameters of a file that break a rule, and its words.
RULES: dict[str, list[tuple[dict[str, Any], str]]] = {'crank_platform': [
    ({'legs.rod.length': []}, 'legs.rod.length: not set: needed by legs.crank.length'),
    ({'geometry.crank_angles': []}, 'geometry.crank_angles: not set: needed by '
     'legs.crank.length; or give geometry.crank_axes and geometry.crank_directions'),
    ({'geometry.crank_axes': [1.0, 0.0, 0.0] * 6}, 'geometry.crank_axes, '
     'geometry.crank_directions: given as well as geometry.crank_angles: leave out one of them'),
    ({'legs.crank.length': [0.2, 0.2]}, 'legs.crank.length: must have 1 or 6 entries, has 2'),
    ({'legs.rod.length': [0.1]}, "home pose: no level pose has all rods at the cranks' middle "
     'angles: needed by geometry.crank_branch: auto'),
    ({'limits.angle_min': [-4.0], 'limits.angle_max': [4.0]}, 'geometry.crank_branch: auto: both '
     'are possible: give the branch, or limits of the angle: leg 1'),
    ({'geometry.crank_branch': ['positive', 'auto']},
     'geometry.crank_branch: must have 1 or 6 entries'),
    ({'limits.length_max': [1.0]},
     'limits.length_max: must not be given with legs.crank.length'),
    ({'limits.lever_min': [1.0]}, 'limits.lever_min: must be less than 1: leg or plate 1'),
    ({'geometry.crank_angles': [], 'geometry.crank_axes': [1.0, 0.0, 0.0] * 6,
      'geometry.crank_directions': [1.0, 1.0, 0.0] * 6, 'geometry.crank_branch': ['positive']},
     'geometry.crank_directions: must be perpendicular to geometry.crank_axes, to 0.001 rad: leg '
     'or plate 1')], 'platform': [
    ({'limits.length_min': [1.0, 2.0]}, 'limits.length_min: must have 1 or 6 entries, has 2'),
    ({'legs.piston.mass': [math.inf]}, 'legs.piston.mass: must be finite'),
    ({'drive.efficiency': [1.0, 1.0, 1.5, 1.0, 1.0, 1.0], 'actuator.screw_lead': [0.01]},
     'drive.efficiency: must be more than 0 and at most 1: leg or plate 3'),
    ({'drive.torque_max': [3.0]},
     'actuator.screw_lead: not set: needed by drive.*: leg or plate 1'),
    ({'drive.torque_speed': [1.0, 2.0, 3.0], 'actuator.screw_lead': [0.01]},
     'drive.torque_speed: must have 2 numbers for each of at most 96 points, has 3'),
    ({'drive.screw_rotation': 'universal', 'actuator.screw_lead': [0.01],
      'drive.platform_universal_axes': [
          1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -0.4, 0.9, *[1.0, 0.0, 0.0] * 3]},
     'drive.platform_universal_axes: along the leg at the home pose: must be across it: leg 3'),
    ({'geometry.base_outline': [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 'legs.piston.radius': [0.02]},
     'geometry.base_outline, geometry.platform_outline: must have three corners or more: leg or '
     'plate 1'),
    ({'limits.base_joint_angle_max': [0.5], 'limits.length_max': [],
      'geometry.zero_length': [9e9]},
     'home pose: limits.length_min and limits.length_max, or geometry.zero_length, must give a '
     'length that the legs can have in a level pose: needed without geometry.base_joint_axes'),
    ({'limits.base_joint_angle_max': [0.5], 'limits.length_max': [0.71]},
     'home pose: no level pose has all legs between limits.length_min and limits.length_max: '
     'needed without geometry.base_joint_axes'),
    ({'geometry.base_joints': []},
     'geometry.base_joints: must be set, as points or by their circle'),
    ({'geometry.base_radius': 0.9},
     'geometry.base_joints: given as well as geometry.base_radius, _angles or _height: leave out '
     'the points or the circle'),
    ({'geometry.base_joints': [], 'geometry.base_radius': 0.9},
     'geometry.base_angles: not set: needed by geometry.base_radius'),
    ({'geometry.platform_joints': [], 'geometry.platform_angles': [1.0] * 6},
     'geometry.platform_radius: not set: needed by geometry.platform_angles'),
    ({'geometry.base_joints': [], 'geometry.base_radius': 0.9, 'geometry.base_angles': [90.0] * 6},
     'geometry.base_angles: must be within -2 pi and 2 pi: in degrees?'),
    ({'command_interfaces': ['torque']}, 'actuator.screw_lead: not set: needed by torque, '
     'torque_per_mille and motor_velocity in command_interfaces'),
    ({'command_interfaces': ['torque_per_mille'], 'actuator.screw_lead': [0.01]},
     'drive.rated_torque: not set: needed by torque_per_mille in command_interfaces'),
    ({'legs.crank.length': [0.2]},
     'legs.cylinder.mass: must not be given with legs.crank.length'),
    ({'limits.angle_max': [0.5]},
     'limits.angle_max: needs legs.crank.length, which is not set'),
    ({'payload.mass': 3.0, 'payload.inertia': [-1.0, 0.0, 0.0, 1.0, 0.0, 1.0]},
     'payload: must be finite, its inertia positive semidefinite')]}


@pytest.mark.parametrize(('file', 'changes', 'message'), [
    (file, *rule) for file, rules in RULES.items() for rule in rules])
def test_rules_in_one_line(
        program: Path, file: str, changes: dict[str, Any], message: str) -> None:
    """A rule that is broken is named with its parameter, and the leg; nothing is computed."""
    p = Parameters.from_yaml(ROOT / 'config' / f'{file}.yaml')
    bare: dict[str, Any] = {'drive.torque_max': [], 'actuator.screw_lead': []}
    done = run_program(
        program, code=1, text=as_text(p, (bare if file == 'platform' else {}) | changes) + '0')
    assert (done.out, done.err) == ('', f'{message}\n')


LEGS, LIVE = 'leg_feed_forward.yaml', 'platform_feed_forward.yaml'


@pytest.mark.parametrize('file', [LEGS, LIVE])
def test_example_is_the_hexapod_of_the_node(file: str) -> None:
    """The example has the values of config/platform.yaml, and interfaces that fit together."""
    document = yaml.safe_load((PACKAGE / 'config' / file).read_text())
    given = {key: value for key, value in document[NAME]['ros__parameters'].items()
             if key not in ('reference', 'command_interfaces', 'initial_pose')}
    example = Parameters(dict(_flat(given)))
    expected = Parameters.from_yaml(ROOT / 'config' / 'platform.yaml')
    for name, value in _flat(given):
        assert np.all(example[name] == expected[name]), (name, value)
    own = document[NAME]['ros__parameters']
    commands = own['command_interfaces']
    if own['reference'] == 'legs':  # of the controller before it
        leader = document['leg_trajectory_controller']['ros__parameters']
        assert leader['command_joints'] == [f'{NAME}/{joint}' for joint in expected['joints']]
        assert commands == ['position', 'effort']
    else:
        assert list(document) == ['controller_manager', NAME]
        assert commands == ['position', 'velocity', 'effort']
    described = ET.fromstring(urdf(Hexapod(expected), 'hexapod', Ros2Control(commands, MOCK)))
    assert [(joint.get('name'), each.get('name'))
            for joint in described.findall('ros2_control/joint')
            for each in joint.findall('command_interface')] == [
                (joint, each) for joint in own['joints'] for each in commands]
    types = document['controller_manager']['ros__parameters']
    plugin = ET.parse(PACKAGE / f'{NAME}.xml').getroot()[0]
    assert types[NAME]['type'] == plugin.get('name')
    exported = re.findall(r'PLUGINLIB_EXPORT_CLASS\(\s*(\S+),\s*(\S+)\)',
                          (PACKAGE / 'src' / f'{NAME}.cpp').read_text())
    assert exported == [(plugin.get('type'), plugin.get('base_class_type'))]


def test_colcon_finds_both_packages_as_documented() -> None:
    """``--base-paths . ros2_control`` is needed, and enough; versions are equal."""
    def found(*folders: str) -> list[str]:
        done = run_program(sys.executable, '-m', 'colcon', '--log-base', '/dev/null', 'list',
                           '--names-only', '--base-paths', *folders, folder=ROOT)
        return done.out.split()

    pytest.importorskip('colcon_core')
    assert found('.') == ['stewart_dynamics']
    assert sorted(found('.', 'ros2_control')) == ['stewart_dynamics', NAME]
    assert 'colcon build --base-paths . ros2_control' in (PACKAGE / 'README.md').read_text()
    assert len({ET.parse(folder / 'package.xml').findtext('version')
                for folder in (ROOT, PACKAGE)}) == 1


def _flat(document: dict[str, Any], above: str = '') -> list[tuple[str, Any]]:
    """Return dotted names and values."""
    found: list[tuple[str, Any]] = []
    for key, value in document.items():
        name = f'{above}{key}'
        found += _flat(value, f'{name}.') if isinstance(value, dict) else [(name, value)]
    return found
