# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
A plugin of pytest for ``mutation``: few examples of each property, and quick tests first.

Where the file of durations exists, tests that are not in it are left out; else it is written.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
import os
from pathlib import Path
import signal
from typing import Any

from hypothesis import settings
import pytest

# Tests that take longer are left out [s].
_LONGEST = 10.0

_durations = Path(os.environ['MUTATION_DURATIONS'])
_known: dict[str, float] = {}
_is_known = _durations.exists()
if _is_known:
    _known = json.loads(_durations.read_text(encoding='utf-8'))

_original = settings.__init__


def _few(self: Any, *arguments: Any, **given: Any) -> None:
    if 'max_examples' in given:
        given['max_examples'] = min(given['max_examples'], 20)
    _original(self, *arguments, **given)


settings.__init__ = _few
settings.register_profile('few', max_examples=20)
settings.load_profile('few')


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort and choose the tests."""
    if _is_known:
        items[:] = sorted((item for item in items if item.nodeid in _known),
                          key=lambda item: _known[item.nodeid])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """End a test that takes too long."""
    if not _is_known:
        signal.signal(signal.SIGALRM, _too_long)
        signal.setitimer(signal.ITIMER_REAL, _LONGEST)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _too_long(*_: Any) -> None:
    raise TimeoutError(f'more than {_LONGEST} s')


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note how long a test that passes takes."""
    if report.when == 'call' and report.passed:
        _known[report.nodeid] = report.duration


def pytest_sessionfinish() -> None:
    """Write the durations."""
    if not _is_known:
        _durations.write_text(json.dumps(_known), encoding='utf-8')
