# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Commands that programs advise run as they are printed."""

from __future__ import annotations

from collections.abc import Callable
import html
from pathlib import Path
import re
import shlex

from messages import leg_states, NOW, setpoints, write_bag
import numpy as np
from programs import call
import pytest
from referees import ROOT
from stewart_dynamics import Motion, StewartPlatform
from stewart_dynamics.calibration.calibrate_command_line import main as calibrate
from stewart_dynamics.datasheet.datasheet_command_line import main as capability
from stewart_dynamics.identification.identify_command_line import main as identify
from stewart_dynamics.identification.lack_of_fit import NEXT
from stewart_dynamics.replay.replay_command_line import main as replay

PROGRAMS: dict[str, Callable[[list[str]], int]] = {
    'stewart_calibrate': calibrate, 'stewart_capability': capability,
    'stewart_identify': identify}
FILE = ROOT / 'config' / 'platform.yaml'
LEGS = '/stewart_dynamics/measured_legs'


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of 12 s with setpoints and measured legs, in a folder with a space."""
    platform = StewartPlatform.from_yaml(FILE)
    p, home = platform.parameters, platform.home_pose()
    times = 0.01 * np.arange(1200)
    sizes, w = np.array([0.06, 0.05, 0.04, 0.05, 0.06, 0.08]), np.array([
        3.1, 3.7, 4.3, 2.9, 3.3, 4.7])
    waves = [sizes * w ** n * np.sin(w * times[:, None] + n * np.pi / 2.0) for n in range(3)]
    waves[0][:, :3] += home.position
    motion = Motion.from_euler(*(part for wave in waves for part in (wave[:, :3], wave[:, 3:])))
    result = platform.inverse_dynamics(motion)
    stamps = NOW + np.rint(1e9 * times).astype(np.int64)
    recorded = [*setpoints(stamps, motion), *leg_states(
        stamps, p.joints, result.lengths - p.geometry.zero_length, result.rates,
        1.02 * result.forces + 20.0 * np.sign(result.rates))]
    return write_bag(tmp_path_factory.mktemp('a folder') / 'bag', recorded,
                     measured_legs='sensor_msgs/msg/JointState')


def run(command: str, folder: Path) -> int:
    """Run a printed command; its results go to a folder."""
    program, *arguments = shlex.split(command)
    return PROGRAMS[program]([*arguments, '--output', str(folder)])


def test_commands_of_a_replay_run_as_printed(bag: Path, tmp_path: Path) -> None:
    out = call(replay, bag, '--params', FILE, '--measured', LEGS, '--output',
               tmp_path / 'replayed').out
    command, = re.findall('^  (stewart_identify .*)$', out, re.MULTILINE)
    assert shlex.split(command)[1] == str(bag)
    assert run(command, tmp_path / 'identified') == 0
    assert (tmp_path / 'identified' / 'identified.yaml').exists()
    page = html.unescape((tmp_path / 'replayed' / bag.name / 'report.html').read_text())
    command, = {*re.findall('(stewart_capability --motion [^<]*)<', page)}
    assert run(command, tmp_path / 'rated') == 0


@pytest.mark.parametrize('cause', [cause for cause, words in NEXT.items() if 'stewart_' in words])
def test_commands_that_a_lack_of_fit_advises_run_as_printed(cause: str, tmp_path: Path) -> None:
    _, command = re.split(': (?=stewart_)', NEXT[cause].format(file=shlex.quote(str(FILE))))
    options = ['--generations', '2'] if 'identify' in command else []
    assert run(shlex.join([*shlex.split(command), *options]), tmp_path / 'out') == 0
    assert any((tmp_path / 'out').iterdir())
