# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The notebooks, executed again: they print the numbers that are stored in them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

import pytest

pytest.importorskip('ipykernel')
nbformat = pytest.importorskip('nbformat')
client = pytest.importorskip('nbclient')

NOTEBOOKS = sorted(Path(__file__).resolve().parents[1].glob('examples/notebooks/*.ipynb'))
NUMBER = re.compile(r'[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|\bnan\b')
LARGEST = 200_000  # of a file, with its pictures [bytes]


def printed(notebook: Any) -> Iterator[tuple[str, int]]:
    """Yield what each cell with code prints, and its number of pictures."""
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            shown = [each for each in cell.outputs if each.output_type != 'stream']
            assert all('image/png' in each.data for each in shown), cell.source
            yield ''.join(each.text for each in cell.outputs if each.output_type == 'stream'), len(
                shown)


def last_digit(number: str) -> float:
    """Return the unit of the last digit that is printed."""
    mantissa, _, exponent = number.partition('e')
    return float(10.0 ** (int(exponent or 0) - len(mantissa.partition('.')[2])))


def assert_prints_the_same(stored: str, again: str) -> None:
    """Compare the words, without the widths of columns, and each number to its last digit."""
    words, others = (re.sub(r'\s+', ' ', NUMBER.sub('#', text)) for text in (stored, again))
    assert words == others
    for before, after in zip(NUMBER.findall(stored), NUMBER.findall(again), strict=True):
        assert float(after) == pytest.approx(float(before), rel=0.0, abs=1.01 * last_digit(before))


@pytest.mark.slow
@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_is_stored_in_it(path: Path) -> None:
    stored = nbformat.read(path, as_version=4)
    nbformat.validate(stored)
    assert path.stat().st_size < LARGEST
    assert len(stored.cells) < 20
    again = nbformat.read(path, as_version=4)
    client.NotebookClient(again, timeout=120,
                          resources={'metadata': {'path': path.parent}}).execute()
    pairs = list(zip(printed(stored), printed(again), strict=True))
    assert sum(pictures for (_, pictures), _ in pairs) in (1, 2)
    for (before, pictures), (after, pictures_again) in pairs:
        assert_prints_the_same(before, after)
        assert pictures == pictures_again


@pytest.mark.parametrize('again', [
    'force 1135 N, speed 0.470 m/s', 'force 1133 N, speed 0.472 m/s', 'force 1133 N',
    'force 1133 N, speed 0.470 mm/s', 'force nan N, speed 0.470 m/s'])
def test_another_output_is_noticed(again: str) -> None:
    stored = 'force 1133 N, speed 0.470 m/s'
    assert_prints_the_same(stored, 'force  1134 N, speed 0.469 m/s')
    with pytest.raises(AssertionError):
        assert_prints_the_same(stored, again)
