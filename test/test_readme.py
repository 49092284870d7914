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

"""The README: its tables are those of the code, its example runs, its links lead somewhere."""

from __future__ import annotations

import importlib
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from stewart_dynamics.parameters import PARAMETERS
from stewart_dynamics.runtime import input_topics, output_messages, plant
from stewart_dynamics.runtime import planned_trajectory as planned

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / 'README.md').read_text(encoding='utf-8')
PAGES = sorted([*ROOT.glob('*.md'), *ROOT.glob('*/README.md'), *ROOT.glob('docs/*.md')])


def test_tables_of_parameters_are_those_of_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / 'docs'))
    generate = importlib.import_module('generate')
    assert generate.readme(README) == README, 'run: make docs'
    for name in PARAMETERS:
        assert README.count(f'| `{name}` |') >= 1


def test_topics_are_those_of_the_code() -> None:
    for topic, kind in (*input_topics.INPUT_TYPES.items(), *output_messages.OUTPUT_TYPES.items(),
                        ('markers', 'visualization_msgs/msg/MarkerArray'),
                        (planned.INPUT, planned.INPUT_TYPE), (planned.OUTPUT, planned.OUTPUT_TYPE),
                        *plant.INPUT_TYPES.items(), *plant.OUTPUT_TYPES.items()):
        assert f'| `~/{topic}` | {kind.replace("/msg", "")} |' in README


def test_the_examples_run(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r'```python\n(.*?)```', README, flags=re.DOTALL)
    assert len(blocks) == 2
    monkeypatch.chdir(ROOT)
    exec(compile(''.join(blocks), 'README.md', 'exec'), {})
    printed = capsys.readouterr().out.split('\n')
    assert len(printed[0].strip('[] ').split()) == 6
    assert 1.0 < float(printed[1]) < 20.0
    assert float(printed[2]) < 1e-12
    assert float(printed[3].strip('[] ').split()[2]) == pytest.approx(1.1, abs=1e-3)
    assert float(printed[4].strip('[] ').split()[2]) == pytest.approx(-0.1 * np.pi, abs=1e-3)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    links = re.findall(r'\]\(([^)#]+)', page.read_text(encoding='utf-8'))
    for link in links:
        if '://' not in link:
            assert (page.parent / link).exists(), f'{page.name}: {link}'


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    text = re.sub(r'^(?:```.*?^```|    .*?$)', '', page.read_text(encoding='utf-8'),
                  flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r'^#+ (.*)$', text, flags=re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading).lower().replace(' ', '-') for heading in headings}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_headings(page: Path) -> None:
    for link, anchor in re.findall(r'\]\(([^)#:]*)#([^)]+)\)', page.read_text(encoding='utf-8')):
        assert anchor in anchors(page.parent / link if link else page), f'{link}#{anchor}'


@pytest.mark.parametrize('page', [ROOT / 'README.md', ROOT / 'docs/from_cad_to_controller.md'],
                         ids=lambda page: page.name)
def test_files_in_commands_are_there(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    named = re.findall(r'(?<![\w./-])(?:bags|config|demo|docs|examples)/[\w./]+', text)
    assert named
    for path in named:
        assert (ROOT / path.rstrip('.')).exists(), path


def test_no_figure_is_left_to_be_filled_in() -> None:
    for page in PAGES:
        assert not re.search(r'@[A-Z]+@|TODO|FIXME|XXX', page.read_text(encoding='utf-8')), page


def test_version_is_the_same_everywhere() -> None:
    version = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')
    assert version
    assert f"version='{version}'" in (ROOT / 'setup.py').read_text(encoding='utf-8')
