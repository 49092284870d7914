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

"""What is needed later is compiled when it is connected, and setpoints are answered meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
from typing import Any

import pytest
from running import DynamicsNode, Planner
from stewart_dynamics.compilation.machine_code import COMPILED, folder_to_write
from stewart_dynamics.compile_all import compile_all
from stewart_dynamics.external_wrench.measured_legs import NOT_COMPILED
from test_dynamics_node import MOVING
from test_external_wrench_node import Felt
from test_planned_trajectory_node import check, MOTION

# What the test lets the node compile: the first of a planned trajectory, and the external wrench.
LATER = ('stewart_dynamics.mechanics.kinematics.forward_kinematics.twists',
         'stewart_dynamics.external_wrench.estimate._one')


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')
def test_what_is_needed_later_is_compiled_while_setpoints_are_answered(
        start: Callable[..., DynamicsNode], tmp_path: Path) -> None:
    compile_all()  # in a workspace this may be the first test that needs it
    kept = tmp_path / 'kept'
    kept.mkdir()
    for file in folder_to_write().glob('*.code'):
        if not file.name.startswith(LATER):
            shutil.copy(file, kept)
    node = start(STEWART_DYNAMICS_CACHE_DIR=str(kept))
    node.until_active()
    node.answer(MOVING)
    assert 'compiling' not in node.program.stderr
    planner, felt = Planner(node), Felt(node)
    felt.until_connected()
    planner.send(MOTION, step=500_000_000)

    def rejected() -> bool:
        felt.rest()
        node.answer(MOVING)
        return f'measured_legs rejected: {NOT_COMPILED}: ' in node.program.stderr

    node.until(rejected, 'measured legs are rejected')
    assert not felt.raw
    check(planner.until_answered(1), MOTION, node.platform)

    def felt_now() -> Any:
        felt.rest()
        node.answer(MOVING)
        return felt.raw

    node.until(felt_now, 'the external wrench comes')
    for name in LATER:
        assert f'compiling {name} ' in node.program.stderr
        assert list(kept.glob(f'{name}.*.code'))
    node.until_counted()
