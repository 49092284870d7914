# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The two pools of test processes in ``conftest.py``."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

import pytest

# Ends its process in the first run of the second test, when two others end theirs.
CRASHING = """\
import os
from pathlib import Path
import pytest
BEGUN = Path(__file__).with_suffix('.begun')


@pytest.mark.parametrize('number', range(3))
def test_one(number):
    if number == 1 and not BEGUN.exists():
        BEGUN.touch()
        while len([*BEGUN.parent.glob('*.begun')]) < 3:
            pass
        os._exit(9)
"""
PASSING = 'def test_one():\n    pass\n'
# The first ones of three processes, of which one begins at the end; the others.
MODULES = [CRASHING, CRASHING, *[PASSING] * 7, CRASHING]


@pytest.mark.slow
def test_processes_that_crash_at_once_fail_their_tests_alone(tmp_path: Path) -> None:
    for number, text in enumerate(MODULES):
        (tmp_path / f'test_{number}.py').write_text(text)
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-p', 'conftest', '-p', 'no:cacheprovider', '-c',
         os.devnull, '--rootdir', tmp_path, '-n', '3', '--dist', 'loadfile',
         '--no-loadscope-reorder', tmp_path], capture_output=True, text=True, timeout=300,
        cwd=tmp_path, env={**os.environ, 'PYTHONPATH': str(Path(__file__).parent)})
    assert 'INTERNALERROR' not in done.stdout
    summary = done.stdout.splitlines()[-1]
    # xdist runs each test that crashed again, in another process: it passes there.
    assert '3 failed, 16 passed' in summary
