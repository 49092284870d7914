# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The console scripts of the nodes: their answers before ROS is loaded."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import pytest
from referees import ROOT

from stewart_dynamics.errors import ParameterError
from stewart_dynamics.parameters.table import Parameters
from stewart_dynamics.reference_motion.parameters import ReferenceMotionParameters
from stewart_dynamics.ros.console_scripts import check_arguments, usage
from stewart_dynamics.simulator.parameters import SimulatorParameters

PROGRAMS = {'dynamics': Parameters, 'simulator': SimulatorParameters,
            'trajectory': ReferenceMotionParameters}
PLATFORM = ROOT / 'config' / 'platform.yaml'
HEAVY = ('numba', 'scipy', 'rclpy', 'rosbags')

# Without ROS: none of its modules can be imported. The last line lists the loaded modules.
RUN = f"""\
import sys
if sys.argv.pop(1) == 'without ROS':
    for name in ('rclpy', 'rcl_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'std_msgs'):
        sys.modules[name] = None
from stewart_dynamics.ros import console_scripts
code = getattr(console_scripts, sys.argv.pop(1))()
print([name for name in {HEAVY} if sys.modules.get(name)])
sys.exit(code)
"""


def run(program: str, *arguments: str, ros: str = 'with ROS') -> tuple[int, str, str]:
    """Return exit code, stdout and stderr of a program."""
    done = subprocess.run([sys.executable, '-c', RUN, ros, program, *arguments], check=False,
                          capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize('program', PROGRAMS)
def test_help_is_answered_without_ros_and_without_a_compiler(program: str) -> None:
    kind = PROGRAMS[program]
    assert run(program, '--help', ros='without ROS') == (0, f'{usage(kind)}\n[]\n', '')
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


@pytest.mark.parametrize('program', PROGRAMS)
def test_a_program_that_lacks_ros_reports_it_in_one_line(program: str) -> None:
    code, out, error = run(program, ros='without ROS')
    assert code == 1
    assert 'rclpy' not in out
    assert error.startswith(f'{PROGRAMS[program].node}: needs ROS 2: ')
    assert error.count('\n') == 1


@pytest.mark.parametrize('program', PROGRAMS)
def test_a_bad_file_is_rejected_before_libraries_are_loaded(program: str, tmp_path: Path) -> None:
    file = tmp_path / 'bad.yaml'
    file.write_text('/**: {ros__parameters: {rat: 1.0}}\n')
    code, out, error = run(program, '--ros-args', '--params-file', str(file))
    assert (code, out) == (1, '[]\n')
    assert error.startswith(f'{PROGRAMS[program].node}: {file}: rat: unknown parameter')
    assert error.count('\n') == 1


def test_a_file_is_checked_without_a_compiler() -> None:
    done = subprocess.run([sys.executable, '-c', f"""\
import sys
from stewart_dynamics import Parameters
print(len(Parameters.from_yaml({str(ROOT / 'config' / 'platform.yaml')!r})))
print([name for name in {HEAVY} if name in sys.modules])
"""], check=True, capture_output=True, text=True, timeout=60)
    assert done.stdout == f'{len(Parameters.table)}\n[]\n'


@pytest.mark.parametrize('arguments, text', [
    (['-p', 'platform.mass=200.0'], 'command line: -p platform.mass=200.0: must be NAME:=VALUE'),
    (['--params-file', str(PLATFORM), '-p'], 'command line: -p : must be NAME:=VALUE')])
def test_what_ros_would_reject_in_its_own_words_is_named(arguments: list[str], text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        check_arguments(['--ros-args', *arguments], Parameters)
    assert str(caught.value) == text


def test_a_file_without_the_lines_of_ros_is_named(tmp_path: Path) -> None:
    file = tmp_path / 'bare.yaml'
    file.write_text('platform:\n  mass: 1.0\n')
    with pytest.raises(ParameterError) as caught:
        check_arguments(['--ros-args', '--params-file', str(file)], Parameters)
    assert str(caught.value) == (f"{file}: holds platform, but no parameters under '/**:' or "
                                 "'stewart_dynamics:', 'ros__parameters:'")
