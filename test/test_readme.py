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

"""The README: its tables are those of the code, its example runs, its links and files exist."""

from __future__ import annotations

import importlib
from pathlib import Path
import re
from types import ModuleType
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import stewart_dynamics
from stewart_dynamics.parameters.table import PARAMETERS
from stewart_dynamics.simulator import messages as simulator_messages

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob('*.md'), *ROOT.glob('*/README.md'), *ROOT.glob('docs/*.md')])
TEXTS = {page.relative_to(ROOT).as_posix(): page.read_text(encoding='utf-8') for page in PAGES}
README = TEXTS['README.md']


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the script that writes the generated tables."""
    monkeypatch.syspath_prepend(str(ROOT / 'docs' / 'figures'))
    return importlib.import_module('tables')


def test_generated_tables_are_current(tables: ModuleType) -> None:
    pages = tables.pages()
    assert {path.relative_to(ROOT).as_posix() for path in pages} == {
        'README.md', 'docs/faults.md', 'docs/identify_from_bags.md', 'docs/node.md',
        'docs/parameters.md', 'docs/simulator.md', 'security/policy.xml'}
    for path, own in pages.items():
        text = path.read_text(encoding='utf-8')
        assert tables.generated(text, own) == text, 'run: python docs/figures/tables.py'


def test_every_parameter_is_on_the_page_of_parameters() -> None:
    for name in PARAMETERS:
        assert f'| `{name}` |' in TEXTS['docs/parameters.md']


def test_a_table_without_its_comments_is_an_error(tables: ModuleType) -> None:
    for text in ('', '<!-- loop -->\n', '<!-- end of loop -->'):
        with pytest.raises(SystemExit, match='comment missing'):
            tables.generated(text, {'loop': 'table'})
    with pytest.raises(SystemExit, match='no table has row'):
        tables.measured('no such row', 'ns')


def test_the_simulator_s_topics_are_those_of_the_code() -> None:
    for topic, kind in {
            **simulator_messages.INPUT_TYPES, **simulator_messages.OUTPUT_TYPES,
            **simulator_messages.BASE_TYPES,
            simulator_messages.IMU: simulator_messages.IMU_TYPE}.items():
        assert f'| `~/{topic}` | {kind.replace("/msg", "")} |' in TEXTS['docs/simulator.md']


def test_the_example_of_the_readme_runs(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, = re.findall(r'```python\n(.*?)```', README, flags=re.DOTALL)
    monkeypatch.chdir(ROOT)
    exec(compile(code, 'README.md', 'exec'), {})
    mistakes, lengths, *forces, error = capsys.readouterr().out.strip().split('\n')
    assert mistakes == '()'
    assert len(lengths.strip('[] ').split()) == 6
    *six, condition = ' '.join(forces).replace('[', '').replace(']', '').split()
    assert len(six) == 6
    assert 1.0 < float(condition) < 20.0
    assert float(error) < 1e-12


def test_the_examples_of_the_library_run(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r'```python\n(.*?)```', TEXTS['docs/library.md'], flags=re.DOTALL)
    assert len(blocks) == 6
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(''.join(blocks), 'library.md', 'exec'), names)
    printed = capsys.readouterr().out.split('\n')
    assert len(printed[0].strip('[] ').split()) == 6
    assert 1.0 < float(printed[1]) < 20.0
    assert float(printed[2]) < 1e-12
    assert float(printed[3].strip('[] ').split()[2]) == pytest.approx(1.1, abs=1e-3)
    assert float(printed[4].strip('[] ').split()[2]) == pytest.approx(-0.1 * np.pi, abs=1e-3)
    assert '(6, 6)' in printed
    assert [line.split()[1] for line in printed[-3:-1]] == ['length_max', 'force_max']
    assert [np.shape(names[name]) for name in ('mass', 'gravity', 'coriolis')] == [
        (6, 6), (6,), (1000, 6, 6)]


def links(page: str) -> list[tuple[str, str]]:
    """Return the files and the anchors that a page links to in this repository."""
    text = re.sub(r'```.*?```', '', TEXTS[page], flags=re.DOTALL)
    return [(file, anchor) for file, anchor in re.findall(r'\]\(([^)#]*)(?:#([^)]+))?\)', text)
            if '://' not in file]


def included(page: Path) -> Path:
    """Return the page whose text a page of the site consists of."""
    found = re.match(r'```\{include\} (\S+)', page.read_text(encoding='utf-8'))
    return page.parent / found.group(1) if found else page


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    text = re.sub(r'^(?:```.*?^```|    .*?$)', '', page.read_text(encoding='utf-8'),
                  flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r'^#+ (.*)$', text, flags=re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading).lower().replace(' ', '-') for heading in headings}


@pytest.mark.parametrize('page', TEXTS)
def test_links_lead_to_files_and_headings(page: str) -> None:
    for file, anchor in links(page):
        target = (ROOT / page).parent / file if file else ROOT / page
        assert target.exists(), file
        # GitHub includes nothing.
        assert target.is_dir() or target.suffix != '.md' or included(target) == target, file
        if anchor:
            assert anchor in anchors(target), f'{file}#{anchor}'


def test_links_to_nothing_would_be_found(tmp_path: Path) -> None:
    page = tmp_path / 'page.md'
    page.write_text('# Two words, *one* `code`\n\n    # no heading\n', encoding='utf-8')
    assert anchors(page) == {'two-words-one-code'}
    assert len(links('README.md')) > 20


def test_the_readme_leads_to_every_page() -> None:
    linked = {((ROOT / 'README.md').parent / file).resolve() for file, _ in links('README.md')}
    pages = {included(page).resolve() for page in ROOT.glob('docs/*.md') if page.stem != 'index'}
    assert pages <= linked


def test_the_readme_is_short() -> None:
    assert README.count('\n') <= 220


def test_libraries_to_install_by_pip_or_rosdep_are_those_of_the_package() -> None:
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    needed = set(re.findall(
        r"^    '(\w+)", setup.partition('install_requires = [')[2].partition(']\n')[0], re.M))
    command, = re.findall(r'^    pip install (\w.+ rosbags .+)$', README, re.M)
    by_pip = set(re.findall(r"(?:^| )'?(\w+)", command))
    packages = (ROOT / 'package.xml').read_text(encoding='utf-8').replace('python3-yaml', 'pyyaml')
    assert by_pip <= needed
    assert all(name in by_pip or f'>{name}<' in packages or f'>python3-{name}<' in packages
               or name == 'llvmlite' for name in needed)  # numba brings llvmlite


@pytest.mark.parametrize('page', [
    'README.md', 'docs/from_cad_to_controller.md', 'docs/simulator.md',
    'docs/planned_trajectories.md', 'docs/replay.md', 'docs/development.md', 'docs/node.md'])
def test_files_in_commands_exist(page: str) -> None:
    folders = '|'.join([*(path.name for path in ROOT.iterdir() if path.is_dir()
                          and not path.name.startswith('.') and path.name != 'test'),
                        *(path.name for path in (ROOT / 'stewart_dynamics').iterdir()
                          if (path / '__init__.py').is_file())])
    named = re.findall(rf'(?<![\w./-])(?:{folders})/[\w./]*\w', TEXTS[page])
    assert named
    for path in named:
        made = path.startswith(('docs/_build', 'docs/<', 'install/', 'env/', 'build/'))
        assert made or (ROOT / path).exists() or (ROOT / 'stewart_dynamics' / path).exists(), path


@pytest.mark.parametrize('page', TEXTS)
def test_no_figure_is_left_to_be_filled_in(page: str) -> None:
    assert not re.search(r'@[A-Z]+@|TODO|FIXME|XXX', TEXTS[page])


def test_version_is_the_same_everywhere() -> None:
    version = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')
    assert version
    assert version == stewart_dynamics.__version__  # which setup.py reads
