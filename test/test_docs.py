# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The documentation as a site: it is built without warnings, its links are valid."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser
import importlib
import importlib.util
import inspect
from pathlib import Path
import subprocess
import sys
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest

import stewart_dynamics

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT = Path(__file__).resolve().parent.parent

pytestmark = pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ('sphinx', 'myst_parser', 'furo', 'numpydoc'))),
    reason="needs pip install '.[docs]'")


class Page(HTMLParser):
    """Links, anchors and loaded resources of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding='utf-8'))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if given.get('id'):
            self.anchors.add(str(given['id']))
        if tag == 'a' and given.get('href'):
            self.links.append(str(given['href']))
        relation = given.get('rel') or ''
        if tag == 'link' and given.get('href') and relation in ('stylesheet', 'preload', 'icon'):
            self.loaded.append(str(given['href']))
        if tag in ('script', 'img', 'iframe') and given.get('src'):
            self.loaded.append(str(given['src']))


def build(source: Path, output: Path) -> subprocess.CompletedProcess[str]:
    """Build a site as `make docs-site` does."""
    return subprocess.run(
        [sys.executable, '-m', 'sphinx', '-E', '-W', '--keep-going', '-q', str(source),
         str(output)],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=300)


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Page]:
    """Return the pages of the site."""
    output = tmp_path_factory.mktemp('site')
    done = build(ROOT / 'docs', output)
    assert done.returncode == 0, done.stdout
    return {path.relative_to(output).as_posix(): Page(path) for path in output.rglob('*.html')
            if '_static' not in path.parts}


@pytest.mark.slow
def test_every_page_is_on_the_site(site: dict[str, Page]) -> None:
    pages = {path.stem for path in [*ROOT.glob('docs/*.md'), *ROOT.glob('docs/*.rst')]}
    assert {f'{page}.html' for page in pages} <= set(site)
    linked = {link.split('#')[0] for link in site['index.html'].links}
    assert {f'{page}.html' for page in pages - {'index'}} <= linked
    for page in (ROOT / 'benchmarks' / 'results').iterdir():
        assert f'results/{page.stem}.html' in site['performance.html'].links


@pytest.mark.slow
def test_links_of_the_site_lead_to_pages_and_anchors(site: dict[str, Page]) -> None:
    checked = 0
    of_path = {page.path: page for page in site.values()}
    for page in of_path.values():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = page.path
            if parts.path:
                target = (page.path.parent / unquote(parts.path)).resolve()
            assert target.is_file(), f'{page.path.name}: {link}'
            assert target.suffix != '.md', f'{page.path.name}: {link}'  # a download
            if parts.fragment and target.suffix == '.html':
                found = of_path.get(target) or Page(target)
                assert unquote(parts.fragment) in found.anchors, f'{page.path.name}: {link}'
            checked += 1
    assert checked > 500


@pytest.mark.slow
def test_the_site_needs_no_network(site: dict[str, Page]) -> None:
    for page in site.values():
        assert page.loaded
        for link in page.loaded:
            parts = urlsplit(link)
            assert not parts.scheme or parts.scheme == 'data', link
            assert not parts.netloc, link
            assert parts.scheme or (page.path.parent / unquote(parts.path)).is_file(), link


@pytest.mark.slow
def test_a_phone_shows_headings_and_tables_of_texts_whole(
        site: dict[str, Page], browser: Browser) -> None:
    page = browser.new_page(viewport={'width': 390, 'height': 844})
    for name in ('index.html', 'node.html', 'parameters.html', 'summary.html'):
        page.goto(site[name].path.as_uri())
        beyond = page.evaluate(
            "[...document.querySelectorAll('h1, h2, h3, table.texts, table.texts td')].filter("
            'each => each.getBoundingClientRect().right > 390).map(each => each.textContent)')
        assert beyond == [], name
        assert page.locator('table.texts td .label').first.is_visible()
        lines = page.evaluate(
            "document.querySelector('h1').clientHeight / parseFloat("
            "getComputedStyle(document.querySelector('h1')).lineHeight)")
        assert lines < 1.5, name
    page.set_viewport_size({'width': 1440, 'height': 900})
    assert not page.locator('table.texts td .label').first.is_visible()
    page.close()


@pytest.mark.slow
def test_the_api_reference_has_every_public_name(site: dict[str, Page]) -> None:
    anchors = site['api.html'].anchors
    assert stewart_dynamics.__all__
    for name in stewart_dynamics.__all__:
        thing = getattr(stewart_dynamics, name)
        if not (inspect.isclass(thing) or inspect.isfunction(thing)):
            continue
        assert f'stewart_dynamics.{name}' in anchors
        if inspect.isclass(thing):
            for member, value in vars(thing).items():
                if not member.startswith('_') and inspect.isfunction(value) and value.__doc__:
                    assert f'stewart_dynamics.{name}.{member}' in anchors


def callables() -> Iterator[tuple[str, object]]:
    """Yield the names and objects of the public interface that have parameters."""
    for name in stewart_dynamics.__all__:
        thing = getattr(stewart_dynamics, name)
        if not (inspect.isclass(thing) or inspect.isfunction(thing)):
            continue
        yield name, thing
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            if not member.startswith('_') and (
                    inspect.isfunction(value) or isinstance(value, classmethod)):
                yield f'{name}.{member}', getattr(thing, member)


@pytest.mark.parametrize('name, thing', list(callables()),
                         ids=lambda value: value if isinstance(value, str) else '')
def test_documented_parameters_are_those_of_the_call(name: str, thing: object) -> None:
    """Text after a section without its own heading would be shown as a parameter."""
    docscrape = importlib.import_module('numpydoc.docscrape')
    documented = docscrape.NumpyDocString(inspect.getdoc(thing) or '')['Parameters']
    names = [each.strip(' *') for entry in documented for each in entry.name.split(',')]
    if names:
        assert callable(thing)
        assert set(names) <= set(inspect.signature(thing).parameters)
