# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The live view of a node in a browser: efforts, warnings, and the topics that it reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from running import DynamicsNode, HOME, NODE, Program, ROOT, Sample
from stewart_dynamics import StewartPlatform

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip('websockets', reason='needs websockets')
pytestmark = [pytest.mark.ros, pytest.mark.slow]

TILTED = Sample((0.0, 0.1, 1.1), (0.0, 0.0998334166468282, 0.0, 0.995004165278026))


@pytest.fixture
def view(node: DynamicsNode, tmp_path: Path) -> Iterator[Program]:
    """Return the running example."""
    program = Program([sys.executable, ROOT / 'examples' / 'live_view.py', '--port', '0'],
                      node.domain, tmp_path / 'view')
    try:
        yield program
    finally:
        assert program.stop() == 0, program.stderr


def shows(node: DynamicsNode, sample: Sample, page: Page, parts: list[float]) -> bool:
    """Send a setpoint, and return whether the page has these parts of the largest forces."""
    node.answer(sample)
    found = page.locator('.leg output').all_text_contents()
    return len(found) == 6 and all(
        abs(float(text.replace('−', '-').removesuffix(' %')) - 100.0 * part) < 0.06
        for text, part in zip(found, parts, strict=True))


def test_a_browser_shows_the_forces_and_warnings_of_the_node(
        node: DynamicsNode, view: Program, browser: Browser) -> None:
    node.until(lambda: 'http' in view.stdout, 'the page is served')
    address = view.stdout.split()[-1]
    with browser.new_page(viewport={'width': 1440, 'height': 900}) as page:
        page.goto(address)
        for sample in (HOME, TILTED):
            expected = node.result_of(sample).forces / node.platform.parameters['limits.force_max']

            node.until(partial(shows, node, sample, page, expected.tolist()), 'they are shown')
        assert page.locator('#state').text_content() == 'live'
        assert page.locator('.leg span').all_text_contents() == list(
            node.platform.parameters['joints'])
        node.until(lambda: 'setpoints' in (page.locator('#statuses').text_content() or ''),
                   'diagnostics are shown')
        # Something is drawn.
        assert page.evaluate("""() => { const c = document.getElementById('picture');
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            return d.some((v, n) => n % 4 === 3 && v > 0); }""")
    # Nothing is read at the rate of the setpoints.
    readers = {topic for topic, _ in node.peer.node.get_subscriber_names_and_types_by_node(
        'live_view', '/')}
    assert readers <= {f'{NODE}/markers', '/diagnostics', '/parameter_events'}


def test_a_browser_shows_cranks_and_the_torques_of_the_node(
        start: Callable[..., DynamicsNode], browser: Browser, tmp_path: Path) -> None:
    node = start(file=ROOT / 'config' / 'crank_platform.yaml')
    node.until_active()
    rig = StewartPlatform.from_yaml(ROOT / 'config' / 'crank_platform.yaml')
    home = rig.home_pose().position
    sample = Sample((0.0, 0.02, float(home[2]) + 0.1), (0.05, 0.0, 0.0, 0.998749217771909))
    view = Program([sys.executable, ROOT / 'examples' / 'live_view.py', '--port', '0'],
                   node.domain, tmp_path / 'view')
    try:
        node.until(lambda: 'http' in view.stdout, 'the page is served')
        with browser.new_page(viewport={'width': 1440, 'height': 900}) as page:
            page.goto(view.stdout.split()[-1])
            expected = node.result_of(sample, platform=rig).torques / 250.0
            node.until(partial(shows, node, sample, page, expected.tolist()), 'they are shown')
            assert 'drives the angle up' in (page.locator('#text').text_content() or '')
            # Cranks and rods meet: each line of a picture begins where the one before ends.
            bodies = np.array(page.evaluate('last.bodies.map(legs => legs.map(each => each.slice('
                                            '0, 2)))'))  # (cranks and rods, legs, ends, 3)
    finally:
        assert view.stop() == 0, view.stderr
    gaps = np.linalg.norm(bodies[0][:, :, None] - bodies[1][:, None], axis=-1).min(axis=(1, 2))
    assert gaps.max() < 1e-6
    sizes = np.linalg.norm(np.diff(bodies, axis=2)[:, :, 0], axis=-1)
    for found, name in zip(sizes, ('crank', 'rod'), strict=True):
        assert found == pytest.approx(rig.parameters[f'legs.{name}.length'], abs=1e-6)
