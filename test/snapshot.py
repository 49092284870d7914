# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Sentences that programs print, one file for each program: test/snapshots/<program>.txt.

Tests assert what kind of message comes, and compare its words with the file by the fixture
``snapshot``; modules without a ``PROGRAM`` test the library.
``python -m pytest --update-snapshots`` writes the files; read the difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import re

import pytest

FOLDER = Path(__file__).with_name('snapshots')


def read(program: str) -> dict[str, list[str]]:
    """Return the sentences of a program by the test that compares them."""
    file = FOLDER / f'{program}.txt'
    text = file.read_text(encoding='utf-8') if file.exists() else ''
    blocks = [block.strip().split('\n- ') for block in text.split('\n\n') if block.strip()]
    return {test: texts for test, *texts in blocks}


class Snapshot:
    """The sentences of one test, in the order in which it compares them."""

    def __init__(self, program: str, test: str, temporary: Path, update: bool) -> None:
        self._program, self._test, self._update = program, test, update
        self._known, self._said = read(program).get(test, []), list[str]()
        self._names = {
            re.escape(str(temporary)) + r'/[^/\s:,]+': '<tmp>',
            re.escape(str(FOLDER.parents[1])): '<root>',
            r'\Ausage: [^\0]*\n(?=\w+: error: )': ''}  # of argparse, as wide as the terminal

    def __call__(self, text: object) -> None:
        """Compare the next sentences of the test, but none twice; paths are shortened."""
        shown = str(text)
        for pattern, name in self._names.items():
            shown = re.sub(pattern, name, shown)
        shown = '\n  '.join(line.rstrip() for line in shown.splitlines() if line.strip())
        if shown not in self._said:
            self._said.append(shown)
        if not self._update:
            assert self._said == self._known[:len(self._said)]

    @contextmanager
    def raises(self, kind: type[Exception] | tuple[type[Exception], ...],
               ) -> Iterator[pytest.ExceptionInfo[Exception]]:
        """Check that an error of this kind is raised, and compare its sentence."""
        with pytest.raises(kind) as caught:
            yield caught
        self(caught.value)

    def close(self) -> None:
        """Check that no sentence is missing; or write them all."""
        if self._update and self._said != self._known:
            tests = {**read(self._program), self._test: self._said}
            (FOLDER / f'{self._program}.txt').write_text('\n\n'.join(
                '\n- '.join((test, *tests[test])) for test in sorted(tests)) + '\n',
                encoding='utf-8')
        elif not self._update:
            assert self._said == self._known
