# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The console scripts of the nodes: their answers before ROS is loaded."""

from __future__ import annotations

import os
from pathlib import Path
import sys

import numpy as np
from programs import run_program
import pytest
from referees import ROOT
from snapshot import Snapshot
from stewart_dynamics import StewartError, StewartPlatform
from stewart_dynamics.errors import ParameterError
from stewart_dynamics.executables import executable
from stewart_dynamics.legs import example, example_names, KINDS
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.program import SOFTWARE
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters
from stewart_dynamics.ros.console_scripts import check_arguments, usage
from stewart_dynamics.ros.launch_arguments import check_files, check_launch_arguments
from stewart_dynamics.simulator.simulator_parameters import SimulatorParameters

PROGRAM = 'stewart_dynamics'

PROGRAMS = {'dynamics': Parameters, 'simulator': SimulatorParameters,
            'trajectory': ReferenceMotionParameters}
PLATFORM = ROOT / 'config' / 'platform.yaml'
HEAVY = ('scipy', 'rclpy', 'rosbags')

# Without ROS: none of its modules can be imported. The last line has the exit codes and the loaded
# modules.
RUN = f"""\
import sys
ros, *calls = sys.argv[1:]
if ros == 'without ROS':
    for name in ('rclpy', 'rcl_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'std_msgs'):
        sys.modules[name] = None
from stewart_dynamics.ros import console_scripts
codes = []
for call in calls:
    sys.argv = call.split()
    codes.append(getattr(console_scripts, sys.argv[0])())
print(codes, [name for name in {HEAVY} if sys.modules.get(name)])
"""


def run(arguments: str = '', ros: str = 'with ROS') -> tuple[str, list[str]]:
    """Return what all programs print with these arguments, one after the other in a process."""
    done = run_program(
        sys.executable, '-c', RUN, ros, *(f'{program} {arguments}' for program in PROGRAMS))
    return done.out, done.err.splitlines()


def test_help_and_version_are_answered_without_ros_and_without_a_compiler() -> None:
    assert run('--help', 'without ROS') == (
        ''.join(f'{usage(kind)}\n' for kind in PROGRAMS.values()) + '[0, 0, 0] []\n', [])
    assert run('--version', 'without ROS') == (f'{SOFTWARE}\n' * 3 + '[0, 0, 0] []\n', [])


@pytest.mark.parametrize('name', example_names())
def test_an_example_is_a_parameter_file_to_begin_with(name: str, tmp_path: Path) -> None:
    """It is printed without ROS, read as ROS does, and has no possible error."""
    done = run_program(sys.executable, '-c', RUN, 'without ROS', f'dynamics --example {name}')
    text, _, last = done.out.rstrip().rpartition('\n')
    assert (f'{text}\n', last, done.err) == (example(name), '[0] []', '')
    assert all(len(line) <= 99 for line in text.splitlines())
    file = tmp_path / 'rig.yaml'
    file.write_text(f'{text}\n')
    parameters = Parameters.from_yaml(file)
    platform = StewartPlatform(parameters)
    assert platform.check() == ()
    assert parameters.leg_kind.name.startswith(name.rstrip('s'))
    home = platform.home_pose()
    assert home.position[2] > 0.0 and np.abs(home.position[:2]).max() < 1e-6


def test_each_kind_of_legs_has_an_example() -> None:
    assert len(example_names()) == len(KINDS)


def test_an_example_that_is_not_there_is_reported_in_one_line(snapshot: Snapshot) -> None:
    for arguments in ('dynamics --example', 'dynamics --example delta'):
        done = run_program(sys.executable, '-c', RUN, 'without ROS', arguments)
        assert done.out == '[1] []\n'
        line, = done.err.splitlines()
        snapshot(line)


@pytest.mark.parametrize('program', PROGRAMS)
def test_help_has_each_parameter(program: str) -> None:
    kind = PROGRAMS[program]
    for name, parameter in kind.table.items():
        if name in kind.unused:
            continue
        line, = (line for line in usage(kind).splitlines() if line.startswith(f'  {name} ('))
        assert line.endswith(f': {parameter.text}')
        assert ('required' in line.partition('):')[0]) == parameter.required


def test_help_shows_defaults() -> None:
    text = usage(Parameters)
    for line in ('  gravity (double[3], m/s^2, default 0.0, 0.0, -9.80665): ',
                 '  autostart (bool, default true): ', '  platform.mass (double, kg, required): ',
                 '  limits.force_max (double[1 or 6], N): ',
                 '  legs.piston.mass (double[1 or 6], kg, default 0.0): '):
        assert line in text


def test_help_lists_what_the_simulator_uses() -> None:
    head, _, rest = usage(SimulatorParameters).partition('\n\naccepted, ')
    for name in ('setpoint.timeout', 'singularity.action', 'visualization_rate', 'autostart'):
        assert f'  {name} (' not in head
        assert name in rest
    assert '  limits.force_max (' in head
    assert 'accepted, ' not in usage(Parameters) + usage(ReferenceMotionParameters)


def test_a_program_that_lacks_ros_reports_it_in_one_line() -> None:
    out, lines = run(ros='without ROS')
    assert out.startswith('[1, 1, 1] ')
    assert 'rclpy' not in out
    for line, kind in zip(lines, PROGRAMS.values(), strict=True):
        assert line.startswith(f'{kind.node}: needs ROS 2: ')


def test_a_bad_file_is_rejected_before_libraries_are_loaded(
        tmp_path: Path, snapshot: Snapshot) -> None:
    file = tmp_path / 'bad.yaml'
    file.write_text('/**: {ros__parameters: {rat: 1.0}}\n')
    out, lines = run(f'--ros-args --params-file {file}')
    assert out == '[1, 1, 1] []\n'
    for line, kind in zip(lines, PROGRAMS.values(), strict=True):
        assert line.startswith(f'{kind.node}: {file}: ')
        snapshot(line)


@pytest.mark.parametrize('arguments', [
    ['-p', 'platform.mass=200.0'], ['--params-file', str(PLATFORM), '-p']])
def test_malformed_ros_arguments_are_named(arguments: list[str], snapshot: Snapshot) -> None:
    with snapshot.raises(ParameterError):
        check_arguments(['--ros-args', *arguments], Parameters)


def test_a_file_without_the_lines_of_ros_is_named(tmp_path: Path, snapshot: Snapshot) -> None:
    file = tmp_path / 'bare.yaml'
    file.write_text('platform:\n  mass: 1.0\n')
    with snapshot.raises(ParameterError):
        check_arguments(['--ros-args', '--params-file', str(file)], Parameters)


# Where executables are looked for: beside Python, and in workspaces that are sourced

NAME = 'stewart_replay'


@pytest.fixture
def workspaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return the executables of two workspaces; both are sourced, and a third without any."""
    paths = [tmp_path / prefix / 'lib' / 'stewart_dynamics' / NAME for prefix in ('one', 'two')]
    for path in paths:
        path.parent.mkdir(parents=True)
        path.touch()
    prefixes = ['', str(tmp_path / 'none'), *(str(path.parents[2]) for path in paths)]
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(prefixes))
    monkeypatch.setattr(sys, 'executable', str(tmp_path / 'bin' / 'python'))
    return paths


def beside(workspaces: list[Path]) -> Path:
    """Return a new executable beside Python."""
    path = Path(sys.executable).with_name(NAME)
    path.parent.mkdir()
    path.touch()
    return path


def test_in_a_workspace_it_is_that_of_the_first_prefix(workspaces: list[Path]) -> None:
    assert executable(NAME) == workspaces[0]
    workspaces[0].unlink()
    assert executable(NAME) == workspaces[1]


def test_a_workspace_comes_before_the_system(
        workspaces: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    system = beside(workspaces)
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix)
    assert executable(NAME) == workspaces[0]
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    assert executable(NAME) == system


def test_a_virtual_environment_comes_before_workspaces(
        workspaces: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    environment = beside(workspaces)
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix + '/other')
    assert executable(NAME) == environment


def test_a_missing_one_is_an_error_with_the_folders(
        workspaces: list[Path], snapshot: Snapshot) -> None:
    with snapshot.raises(StewartError) as error:
        executable('stewart_nothing')
    for path in workspaces:
        assert str(path.parent) in str(error.value)


@pytest.mark.parametrize('name', ['param_file', 'hexapod'])
def test_an_argument_that_a_launch_file_does_not_have_is_rejected(
        name: str, snapshot: Snapshot) -> None:
    known = 'params_file', 'namespace'
    line = ['ros2', 'launch', 'stewart_dynamics', 'demo.launch.py', f'{name}:=mine.yaml']
    with snapshot.raises(StewartError):
        check_launch_arguments('/share/launch/demo.launch.py', line, known)
    # included by a launch file that has this argument
    check_launch_arguments('/share/launch/stewart_dynamics.launch.py', line, known)
    check_launch_arguments('/share/launch/demo.launch.py', [*line[:-1], 'namespace:=cell'], known)


@pytest.mark.parametrize('text', [None, 'platform.mass: -3.0', 'platfrom.mass: 3.0', '[]'])
def test_a_file_that_a_launch_file_cannot_use_is_named(
        text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        snapshot: Snapshot) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path('mine.yaml').write_text(f'/**:\n  ros__parameters:\n    {text}\n')
    check_files({'urdf_file': (__file__, None), 'params_file': (str(PLATFORM), Parameters)})
    with snapshot.raises(StewartError):
        check_files({'params_file': ('mine.yaml', Parameters)})
