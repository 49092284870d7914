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

"""Fixtures of the tests that run the executables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from running import DynamicsNode

# The module running needs ROS; the tests of the library do not, so it is imported where used.


@pytest.fixture(scope='session')
def ros_environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep ROS on this machine and its logs out of the home folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        patch.setenv('ROS_LOG_DIR', str(tmp_path_factory.mktemp('log')))
        for name in ('ROS_DOMAIN_ID', 'ROS_STATIC_PEERS', 'ROS_LOCALHOST_ONLY',
                     'NUMBA_DISABLE_JIT', 'RCUTILS_CONSOLE_OUTPUT_FORMAT',
                     'RCUTILS_COLORIZED_OUTPUT'):
            patch.delenv(name, raising=False)
        yield


@pytest.fixture
def domain(ros_environment: None) -> Iterator[int]:
    """Return a ROS domain that only this test has."""
    from running import own_domain
    with own_domain() as number:
        yield number


@pytest.fixture
def start(ros_environment: None, tmp_path: Path) -> Iterator[Callable[..., DynamicsNode]]:
    """Return a function that starts a node; it stops with the test."""
    from running import DynamicsNode
    started: list[DynamicsNode] = []

    def begin(*overrides: str, **options: Any) -> DynamicsNode:
        started.append(DynamicsNode(tmp_path / f'node_{len(started)}', *overrides, **options))
        return started[-1]

    yield begin
    for each in started:
        each.close()


@pytest.fixture(scope='module')
def node(ros_environment: None, tmp_path_factory: pytest.TempPathFactory,
         ) -> Iterator[DynamicsNode]:
    """Return a node with the parameters of config/platform.yaml, one for a whole module."""
    from running import DynamicsNode
    each = DynamicsNode(tmp_path_factory.mktemp('node'))
    try:
        each.until_active()
        yield each
    finally:
        each.close()
