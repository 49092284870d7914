# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Functions for later inputs are compiled on connection, while setpoints are answered."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
from typing import Any

import pytest
from running import DynamicsNode, MOVING, NODE, Planner
from std_srvs.srv import Trigger
from stewart_dynamics.compilation.functions import Preparation
from stewart_dynamics.compilation.machine_code import COMPILED, folder_to_write
from stewart_dynamics.compile_all import compile_all
from stewart_dynamics.external_wrench import estimate, payload
from stewart_dynamics.external_wrench.measured_legs import NOT_COMPILED
from stewart_dynamics.planned import trajectory
from stewart_dynamics.setpoints import base_wrench, step
from test_external_wrench_node import Felt
from test_planned_trajectory_node import check, MOTION

# Modules that the test lets the node compile: for planned trajectories and external wrenches.
LATER = ('stewart_dynamics.mechanics.dynamics.friction',
         'stewart_dynamics.external_wrench.estimate')


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return a folder with all machine code but that of LATER."""
    compile_all()  # in a workspace this may be the first test that needs it
    folder = tmp_path / 'kept'
    folder.mkdir()
    for file in folder_to_write().glob('*.code'):
        if not file.name.startswith(LATER):
            shutil.copy(file, folder)
    return folder


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')
def test_later_functions_are_compiled_while_setpoints_are_answered(
        start: Callable[..., DynamicsNode], kept: Path) -> None:
    node = start(STEWART_DYNAMICS_CACHE_DIR=str(kept))
    node.until_active()
    node.answer(MOVING)
    assert 'compiling' not in node.program.stderr
    client = node.peer.node.create_client(Trigger, f'{NODE}/identify_payload')
    node.until(client.service_is_ready, 'the service is there')
    future = client.call_async(Trigger.Request())
    node.until(future.done, 'the service answers')
    assert not future.result().success
    assert 'is being compiled' in future.result().message
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


@pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')
def test_all_that_the_node_may_need_is_compiled_in_advance() -> None:
    compile_all()
    for functions in (trajectory.FUNCTIONS, estimate.FUNCTIONS, payload.FUNCTIONS,
                      base_wrench.FUNCTIONS, step.FUNCTIONS):
        assert Preparation(*functions).ready
