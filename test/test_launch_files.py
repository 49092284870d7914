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

"""Launch files without launch: packages are looked up and files printed before a start."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from referees import ROOT

FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
NAME = 'stewart_dynamics'


def calls(tree: ast.AST, function: str) -> Iterator[ast.Call]:
    """Yield the calls of a function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and (
                node.func.id == function):
            yield node


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.name)
def test_packages_are_looked_up_and_files_printed_before_anything_starts(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding='utf-8'))
    packages = {keyword.value.value for node in calls(tree, 'Node') for keyword in node.keywords
                if keyword.arg == 'package' and isinstance(keyword.value, ast.Constant)}
    looked_up = [ast.literal_eval(node.value) for node in tree.body
                 if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == 'PACKAGES']
    assert packages - {NAME} <= set(*looked_up)
    function, = (node for node in tree.body if isinstance(node, ast.FunctionDef)
                 and node.name in ('node', 'nodes'))
    *before, last = function.body
    assert isinstance(last, ast.Return)
    assert isinstance(last.value, ast.List)
    assert not any(True for each in before for _ in calls(each, 'Node'))
    if looked_up:
        assert any('FindPackageShare(package).perform(context)' in ast.unparse(each)
                   for each in before)
    first = last.value.elts[0]
    assert isinstance(first, ast.Call)
    assert ast.unparse(first.func) == 'LogInfo'
    assert 'file' in ast.unparse(first)
