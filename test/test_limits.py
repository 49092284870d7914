# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""A limit is a row of the table of parameters and a line of the table in C."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROW = """    power_max: Array | None = _limit(
        'maximum electrical power of a motor', 'W', 'motor power', 'power of a motor')
"""
LINE = '  LARGEST(524288, POWER_MAX, power_max, MOTOR, motors.power)'
PROGRAM = """
import numpy as np
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.export.c_project import c_project
from stewart_dynamics.planned.planned_trajectory import check_planned_trajectory
from stewart_dynamics.setpoints.step import Batch, Step

p = Parameters.from_yaml('config/platform.yaml').replaced({
    'actuator.screw_lead': 0.01, 'drive.torque_constant': 0.5, 'drive.resistance': 2.0,
    'drive.power_max': 150.0, 'limits.action': 'suppress_forces'})
platform = StewartPlatform(p)
home = platform.home_pose()
motion = Motion(home.position, home.rotation, linear_velocity=[0.0, 0.0, 0.5],
                linear_acceleration=[0.0, 0.0, 4.0])
power, step = platform.motors(motion).power, Step(p)
outputs = step(Batch.from_parts(0, motion.rows))
found = [each for each in step.exceedances(outputs) if each.limit == 'drive.power_max']
assert [each.leg for each in found] == np.flatnonzero(power > 150.0).tolist() != []
assert np.isnan(outputs.efforts).all()
assert not step(Batch.from_parts(0, Motion.from_pose(home).rows)).exceeding[0]
assert 'drive.power_max: 150 W' in c_project(p, 'rig')['rig.c']
print(found[0].words(p.joints))
print(Parameters.table['drive.power_max'].text)
"""


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, ('cc', 'gcc'))), reason='needs a C compiler')
def test_a_limit_is_a_row_of_the_table_and_a_line_of_c(tmp_path: Path) -> None:
    """A limit of the power of the motors: step, node, planned trajectories and source have it."""
    for name in ('stewart_dynamics', 'config'):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns(
            '__pycache__', '*.so'))
    for name in ('setup.py', 'setup.cfg', 'pyproject.toml', 'README.md'):
        shutil.copy(ROOT / name, tmp_path)
    header = tmp_path / 'stewart_dynamics' / 'core' / 'stewart_dynamics.h'
    text = header.read_text()
    last = '  LARGEST(4096, TEMPERATURE_RISE_MAX, temperature_rise_max, MOTOR, rises)'
    assert text.count(last) == 1
    header.write_text(text.replace(last, f'{last} \\\n{LINE}'))
    table = tmp_path / 'stewart_dynamics' / 'parameters' / 'table.py'
    text, before = table.read_text(), '    rated_torque: Array | None'
    assert text.count(before) == 1
    table.write_text(text.replace(before, ROW + before))
    subprocess.run([sys.executable, 'setup.py', '--quiet', 'build_ext', '--inplace'],
                   cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run([sys.executable, '-c', PROGRAM], cwd=tmp_path, capture_output=True,
                          text=True)
    assert done.returncode == 0, done.stderr
    words, meaning = done.stdout.splitlines()
    assert words.startswith('leg_1: motor power ') and words.endswith(' W above drive.power_max')
    assert meaning == 'maximum electrical power of a motor; unlimited if not set'
