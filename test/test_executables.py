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

"""Where executables are looked for: beside Python, and in workspaces that are sourced."""

from __future__ import annotations

import os
from pathlib import Path
import sys

import pytest

from stewart_dynamics import StewartError
from stewart_dynamics.executables import executable

NAME = 'stewart_replay'


@pytest.fixture
def workspaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Return the executables of two workspaces; both are sourced, and a third without any."""
    paths = [tmp_path / prefix / 'lib' / 'stewart_dynamics' / NAME for prefix in ('one', 'two')]
    for path in paths:
        path.parent.mkdir(parents=True)
        path.touch()
    prefixes = ['', str(tmp_path / 'none'), *(str(path.parents[2]) for path in paths)]
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(prefixes))
    monkeypatch.setattr(sys, 'executable', str(tmp_path / 'bin' / 'python'))
    return paths


def beside(workspaces: list[Path]) -> Path:
    """Return a new executable beside Python."""
    path = Path(sys.executable).with_name(NAME)
    path.parent.mkdir()
    path.touch()
    return path


def test_in_a_workspace_it_is_that_of_the_first_prefix(workspaces: list[Path]) -> None:
    assert executable(NAME) == workspaces[0]
    workspaces[0].unlink()
    assert executable(NAME) == workspaces[1]


def test_a_workspace_comes_before_the_system(
        workspaces: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    system = beside(workspaces)
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix)
    assert executable(NAME) == workspaces[0]
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    assert executable(NAME) == system


def test_a_virtual_environment_comes_before_workspaces(
        workspaces: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    environment = beside(workspaces)
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix + '/other')
    assert executable(NAME) == environment


def test_a_missing_one_is_an_error_with_the_folders(workspaces: list[Path]) -> None:
    with pytest.raises(StewartError, match='^stewart_nothing: not found in ') as error:
        executable('stewart_nothing')
    for path in workspaces:
        assert str(path.parent) in str(error.value)
