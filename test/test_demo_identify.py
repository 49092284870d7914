# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The demo of the identification: its bag, its tables, and its errors in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re
import sys
from types import ModuleType

import numpy as np
import pytest
from running import log_lines, PLATFORM, Program, ROOT
from stewart_dynamics import Motion, Parameters, StewartPlatform
from stewart_dynamics.identification.identification_options import IdentificationOptions
from stewart_dynamics.identification.identification_results import document
from stewart_dynamics.identification.identify import Identification
from stewart_dynamics.messages.joint_state import JointStateWriter
from stewart_dynamics.reference_motion.motion_functions import motion_at
from stewart_dynamics.reference_motion.motion_parameters import ReferenceMotionParameters

DEMO = 'identify'


def states_of(parameters: Parameters, motion: Motion, stamps: np.ndarray) -> list[bytes]:
    """Return what the simulator would publish, without noise."""
    result = StewartPlatform(parameters).inverse_dynamics(motion)
    return [each.tobytes() for each in JointStateWriter(parameters['joints']).layout(True).write(
        stamps, result.lengths - parameters['geometry.zero_length'], result.rates, result.forces)]


@pytest.mark.slow
def test_the_demo_identifies_the_true_parameters(demo: ModuleType, tmp_path: Path) -> None:
    given = Parameters.from_yaml(PLATFORM)
    true = given.replaced(demo.TRUE)
    settings = ReferenceMotionParameters.from_yaml(ROOT / 'config' / 'trajectory_fourier.yaml')
    times = np.arange(0.0, 20.0, 0.002)
    stamps = demo.BEGIN + np.rint(times * 1e9).astype(np.int64)
    states = states_of(true, motion_at(settings, times), stamps)
    # While it waits for the first command, the simulator repeats its state.
    assert demo.write_bag(tmp_path / 'bag', [states[0]] * 5 + states) == len(states) - 1
    work = Identification(given, IdentificationOptions())
    work.read(tmp_path / 'bag', lambda many: None)
    found = work.result()
    numbers = demo.values(document(found, IdentificationOptions()), true)
    work.close()
    by_name = {each.name: each for each in numbers}
    assert len(by_name) == 12
    assert by_name['platform.mass'].before == 150.0
    nearly = {'kg': 0.05, 'm': 1e-4, 'kg m^2': 0.05, 'N s/m': 2.0, 'N': 1.0}
    for each in numbers:  # the data without noise do not show the gain of the efforts
        assert abs(each.after - each.true) < max(nearly[each.unit], 0.05 * each.half_width), each
    lines = demo.table(numbers, []).splitlines()
    assert lines[1].split() == ['platform.mass', 'kg', '150', *lines[1].split()[3:6], '190']


@pytest.mark.parametrize('option', ['--params', '--motion', '--recorded'])
def test_a_run_with_bad_options_is_rejected_in_one_line(
        rejects: Callable[..., None], option: str) -> None:
    rejects(option, '0.5' if option == '--recorded' else 'nowhere.yaml')


# The demo of the README: the real node on a recorded motion, and the table of its answers

@pytest.mark.slow
def test_the_demo_prints_what_the_node_has_answered(domain: int, tmp_path: Path) -> None:
    program = Program([sys.executable, ROOT / 'demo' / 'demo.py'], domain, tmp_path)
    try:
        assert program.wait() == 0, program.stderr
    finally:
        program.kill()
    table = program.stdout
    assert 'Traceback' not in program.stderr
    assert log_lines(program.stderr, 'ERROR')  # of the force limits and of the crossing
    (answered, equal), = re.findall(
        r'^the node has answered (\d+) of 1001 setpoints, (\d+) of them', table, re.MULTILINE)
    # Explained before it is seen, with the figures of the table.
    first, second = table.splitlines()[:2]
    assert first.startswith('This motion crosses a singularity, ')
    assert '2.5 MN on legs of 6 kN' in first
    assert '0.9 s before' in second
    assert '0.92 s before the crossing' in table
    assert int(answered) > 900  # the first may come before the node listens
    assert equal == answered
    assert [line.split()[0] for line in table.splitlines() if line.startswith('leg_')] == [
        f'leg_{n}' for n in range(1, 7)]
    # demanded forces, not the published ones, which never exceed the limit
    assert 'limits.force_max, 6000 N, exceeded by leg_5 and 5 other legs: -2.45' in table
    assert 'within all limits' not in table
    assert 'det(J) crossed zero at t = 8.4' in table
    assert 'stewart_replay' in table.splitlines()[-1]
