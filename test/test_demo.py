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

"""The demo of the README: the real node on a recorded motion, and the table of its answers."""

from __future__ import annotations

from pathlib import Path
import re
import sys

import pytest
from running import log_lines, Program, ROOT


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
    answered, = re.findall(r'^(\d+) setpoints in', table, re.MULTILINE)
    assert int(answered) > 900  # the first may come before the node listens
    assert [line.split()[0] for line in table.splitlines() if line.startswith('leg_')] == [
        f'leg_{n}' for n in range(1, 7)]
    assert 'det(J) crossed zero at t = 8.4' in table
    assert 'stewart_replay' in table.splitlines()[-1]
