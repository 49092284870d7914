# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The vector pictures of README and pages: what `make docs` draws, within what GitHub shows."""

from __future__ import annotations

import importlib
import re
from types import ModuleType
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest
from referees import ROOT

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SVG = '{http://www.w3.org/2000/svg}'


@pytest.fixture(scope='module', params=['badges', 'cranks', 'moving'])
def figure(request: pytest.FixtureRequest) -> ModuleType:
    """Return a script that draws a picture."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / 'docs' / 'figures'))
        return importlib.import_module(request.param)


def test_the_picture_is_the_one_that_is_drawn_now(figure: ModuleType) -> None:
    assert figure.FILE.read_text(encoding='utf-8') == figure.draw(), 'run: make docs'
    # Readers of the README load it each time, and GitHub runs no script in it.
    assert figure.FILE.stat().st_size < 1e6
    root = ElementTree.parse(figure.FILE).getroot()
    assert root.tag == f'{SVG}svg'
    assert not root.findall(f'.//{SVG}script')
    assert 'http' not in figure.FILE.read_text().replace(SVG.strip('{}'), '')


def test_badges_say_what_setup_py_says() -> None:
    label = ElementTree.parse(ROOT / 'docs' / 'figures' / 'badges.svg').getroot().get('aria-label')
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    first, end = re.findall(r"python_requires='>=3\.(\d+),<3\.(\d+)'", text)[0]
    assert f'Python 3.{first} - 3.{int(end) - 1}' in str(label)
    assert "'ros-jazzy-common-interfaces" in text
    assert "'ros-kilted-common-interfaces" in text
    assert 'ROS 2 jazzy | kilted' in str(label)
    assert "license='Apache-2.0'" in text
    assert 'license Apache-2.0' in str(label)


@pytest.mark.slow
def test_one_frame_is_seen_at_any_time(browser: Browser) -> None:
    with browser.new_page(viewport={'width': 800, 'height': 320}) as page:
        page.goto((ROOT / 'docs' / 'figures' / 'moving.svg').as_uri())
        frames = page.locator('.frame, .last')
        assert frames.count() == 120
        seen = page.evaluate("""times => times.map(time => {
            for (const each of document.getAnimations()) { each.pause(); each.currentTime = time; }
            return [...document.querySelectorAll('.frame, .last')].flatMap((each, n) =>
                getComputedStyle(each).visibility === 'visible' ? [n] : []); })""",
                             [10.0, 93.0, 5010.0, 9990.0, 11000.0, 11490.0, 11510.0])
    assert seen == [[0], [1], [60], [119], [119], [119], [0]]
