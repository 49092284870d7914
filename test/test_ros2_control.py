# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The ros2_control controller: its feed-forward without ROS, its parameters, its files."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from stewart_dynamics import Parameters
from stewart_dynamics.description.hexapod import Hexapod
from stewart_dynamics.description.urdf import MOCK, Ros2Control, urdf
from stewart_dynamics.mechanics.limits import LIMITS
import yaml

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / 'ros2_control' / 'stewart_dynamics_controller'
C_SOURCE = ROOT / 'stewart_dynamics' / 'core'
NAME = 'stewart_dynamics_controller'


@pytest.mark.parametrize(('c', 'cpp'), [('gcc', 'g++'), ('clang', 'clang++')])
def test_feed_forward(c: str, cpp: str, tmp_path: Path) -> None:
    """The feed-forward compiles without a warning, and passes its test, with sanitizers by gcc."""
    if not shutil.which(c) or not shutil.which(cpp):
        pytest.skip(f'needs {c} and {cpp}')
    checked = ['-O1', '-fsanitize=address,undefined', '-fno-sanitize-recover=all'
               ] if c == 'gcc' else ['-O0']
    program = tmp_path / 'feed_forward_test'
    subprocess.run([c, '-std=c99', *checked, '-c', C_SOURCE / 'stewart_dynamics.c',
                    '-o', tmp_path / 'c.o'], check=True)
    subprocess.run([
        cpp, '-std=c++17', '-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Werror',
        *checked, f'-I{C_SOURCE}', f'-I{PACKAGE / "include"}', tmp_path / 'c.o',
        PACKAGE / 'src' / 'feed_forward.cpp', PACKAGE / 'test' / 'feed_forward_test.cpp',
        '-o', program], check=True)
    done = subprocess.run([program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, 'all checks passed\n')


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
        done = subprocess.run(
            [sys.executable, '-m', 'colcon', '--log-base', '/dev/null', 'list', '--names-only',
             '--base-paths', *folders], cwd=ROOT, capture_output=True, text=True, check=True)
        return done.stdout.split()

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
