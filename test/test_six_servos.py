# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The page from six servos to a moving platform: its program and commands run, as printed."""

from __future__ import annotations

from contextlib import redirect_stdout
import io
import math
from pathlib import Path
import re
import shlex
from typing import Any, NamedTuple

import numpy as np
from programs import run_program
import pytest
from referees import ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.legs import example

PAGE = (ROOT / 'docs' / 'six_servos.md').read_text(encoding='utf-8')
COMMANDS = re.findall(r'^    (stewart_.*)$', PAGE, flags=re.MULTILINE)
PARTS = re.findall(r'```python\n(.*?)```\n```text\n(.*?)```', PAGE, flags=re.DOTALL)
# Rounding decides which of two legs that are mirror images is named.
_LEG = re.compile(r'leg[_ ]\d')
# Parameters of the program that are not those of the file to the last digit.
_ROUNDED = 1e-3


class Walk(NamedTuple):
    """The folder, names and output of a reader at the end of the page."""

    folder: Path
    names: dict[str, Any]  # of the program
    printed: list[str]  # by its parts
    said: dict[str, str]  # by the commands


@pytest.fixture(scope='module')
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """Run commands and program in the order of the page, in an empty folder."""
    folder = tmp_path_factory.mktemp('six_servos')
    names: dict[str, Any] = {}
    printed: list[str] = []
    said: dict[str, str] = {}
    steps = re.finditer(r'^    (stewart_[^\n]*)$|```python\n(.*?)```', PAGE, flags=re.M | re.S)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for step in steps:
            if step[1] is not None:
                said[step[1]] = run(step[1], folder)
                continue
            with redirect_stdout(io.StringIO()) as out:
                exec(compile(step[2], 'six_servos.md', 'exec'), names)
            printed.append(out.getvalue())
    return Walk(folder, names, printed, said)


def run(command: str, folder: Path) -> str:
    """Run a command of the page, with its redirection; return its output."""
    line, _, file = command.partition(' > ')
    program, *arguments = shlex.split(line)
    done = run_program(program, *arguments, folder=folder)
    assert 'warning' not in done.err
    if file:
        (folder / file).write_text(done.out, encoding='utf-8')
    return done.out


def test_all_of_the_page_is_run() -> None:
    assert len(PARTS) == PAGE.count('```python') == 8
    assert [each.split()[0] for each in COMMANDS] == [
        'stewart_dynamics', 'stewart_capability', 'stewart_export']


def test_the_program_prints_what_the_page_shows(walk: Walk) -> None:
    for (_, expected), found in zip(PARTS, walk.printed, strict=True):
        assert _LEG.sub('leg', found) == _LEG.sub('leg', expected)


def test_the_commands_print_what_the_page_shows(walk: Walk) -> None:
    shown = re.findall(r'```text\n(rig: .*?)```', PAGE, flags=re.DOTALL)
    assert [_LEG.sub('leg', each) for each in shown] == [
        _LEG.sub('leg', walk.said['stewart_capability --params rig.yaml'])]
    assert (walk.folder / 'datasheet' / 'datasheet.html').exists()
    assert (walk.folder / 'rig' / 'rig_arduino.zip').exists()


def test_the_example_is_the_rig_that_the_program_converts(walk: Walk, tmp_path: Path) -> None:
    """The file with numbers in SI units, and the one from mm, degrees and kg cm, are one."""
    file = tmp_path / 'rig.yaml'
    file.write_text(example('cranks'), encoding='utf-8')
    given, made = (Parameters.from_yaml(each) for each in (file, walk.folder / 'rig.yaml'))
    for name in (*given.given, 'geometry.base_joints', 'geometry.platform_joints',
                 'geometry.crank_directions'):
        if not name.endswith(('_angles', '_branch')):
            difference = np.abs(np.asarray(given[name]) - np.asarray(made[name])).max()
            assert difference <= _ROUNDED * np.abs(made[name]).max() + 1e-6, name
    speed = walk.names['platform'].parameters.limits.speed_max
    assert speed == pytest.approx(np.full(6, math.radians(60.0) / 0.17 / 2.0), rel=1e-12)


def test_horns_that_point_away_from_each_other_are_nearly_singular_here(walk: Walk) -> None:
    names = walk.names
    conditions = []
    for headings in (names['headings'], names['base'] + names['away']):
        other = StewartPlatform(names['platform'].parameters.replaced(
            {'geometry.crank_angles': np.remainder(headings + np.pi, 2.0 * np.pi) - np.pi}))
        conditions.append(other.inverse_dynamics(
            Motion.from_pose(other.home_pose())).condition_number)
        assert (len(other.check()) == 1) == (conditions[-1] > 100.0)
    here, there = re.findall(r'`: ([0-9.]+) here, 20 is .*? it is ([0-9]+): the', PAGE.replace(
        '\n', ' '))[0]
    assert (f'{conditions[0]:.1f}', f'{conditions[1]:.0f}') == (here, there)


def test_the_faster_move_that_the_page_advises_is_possible(walk: Walk) -> None:
    names = walk.names

    def share(seconds: float) -> float:
        up, motion = names['up'], names['motion']
        slower = Motion(
            motion.position, motion.rotation, np.outer(names['ds'], up) / seconds,
            motion.angular_velocity, np.outer(names['dds'], up) / seconds ** 2,
            motion.angular_acceleration)
        result = names['platform'].inverse_dynamics(slower)
        free = math.radians(60.0) / names['time_of_60']
        return float((np.abs(result.torques) / names['stall']
                      + np.abs(result.speeds) / free).max())

    assert share(0.25) > 1.0 > share(0.3)


def test_pulses_of_the_table_turn_the_rods_to_their_platform_joints(walk: Walk) -> None:
    """By the horns as a protractor sees them: 45 degrees for 500 us, the second of a pair down."""
    platform: StewartPlatform = walk.names['platform']
    rows = walk.printed[2].splitlines()
    moves = [{}, {'x': 10}, {'y': 10}, {'z': 10}, {'z': -10}, {'roll': 5}, {'pitch': 5},
             {'yaw': 10}]
    base = np.deg2rad(np.repeat([0.0, 120.0, 240.0], 2) + np.tile([-28.0, 28.0], 3))
    senses = np.tile([1.0, -1.0], 3)
    for move, row in zip(moves, rows, strict=True):
        pulses = np.array(row[14:].split(), dtype=float)
        up = np.deg2rad(45.0 * (pulses - 1500.0) / 500.0 * senses)
        along = np.stack([-senses * np.sin(base), senses * np.cos(base), 0.0 * base], axis=1)
        balls = 0.08 * np.stack([np.cos(base), np.sin(base), 0.0 * base], axis=1) + 0.025 * (
            np.cos(up)[:, None] * along + np.sin(up)[:, None] * [0.0, 0.0, 1.0])
        pose = walk.names['at'](**move)
        joints = pose.position + platform.parameters.geometry.platform_joints @ pose.rotation.T
        # Half a microsecond turns a ball by 0.02 mm.
        assert np.linalg.norm(joints - balls, axis=1) == pytest.approx(0.13, abs=3e-5)
