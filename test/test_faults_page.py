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

"""docs/faults.md: each row has a test, each test of faults a row, and the quoted words exist."""

from __future__ import annotations

import ast
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULES = ('test_faults', 'test_dynamics_node', 'test_simulator_node',
           'test_external_wrench_node', 'test_base_node', 'test_payload_node')


def rows() -> list[list[str]]:
    """Return the cells of the page's tables with a column of tests."""
    page = (ROOT / 'docs' / 'faults.md').read_text(encoding='utf-8')
    found: list[list[str]] = []
    within = False
    for line in page.splitlines():
        if not line.startswith('| '):
            within = False
        elif line.startswith('| fault |'):
            within = True
        elif within and not line.startswith('| --- |'):
            found.append([cell.strip() for cell in line.strip('|').split(' | ')])
    return found


def of_module(name: str) -> tuple[dict[str, ast.FunctionDef], list[ast.stmt]]:
    """Return a module's tests, and its constants."""
    body = ast.parse(Path(__file__).with_name(f'{name}.py').read_text(encoding='utf-8')).body
    return ({item.name: item for item in body
             if isinstance(item, ast.FunctionDef) and item.name.startswith('test_')},
            [item for item in body if isinstance(item, ast.Assign)])


TESTS = {name: of_module(name) for name in MODULES}


def test_every_fault_has_a_test_and_every_test_of_faults_a_row() -> None:
    assert len(rows()) > 50
    named: set[str] = set()
    for row in rows():
        assert len(row) == 5, row
        assert all(row), row
        tests = re.findall(r'`(\w+)`', row[4])
        assert tests, row
        named.update(tests)
    every = [test for tests, _ in TESTS.values() for test in tests]
    assert len(set(every)) == len(every)
    assert named <= set(every)
    assert set(TESTS['test_faults'][0]) <= named


@pytest.mark.parametrize('row', rows(), ids=lambda row: row[0])
def test_the_test_requires_the_words_on_the_page(row: list[str]) -> None:
    texts = []
    for test in re.findall(r'`(\w+)`', row[4]):
        tests, constants = next(module for module in TESTS.values() if test in module[0])
        for part in (tests[test], *constants):
            texts += [each.value for each in ast.walk(part)
                      if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    for words in re.findall('`([^`]+)`', row[2]):
        for part in filter(None, map(str.strip, words.split('...'))):
            assert any(part in text for text in texts), part
