# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""The search for possible errors: order, conditions, words of the leg, the likeliest ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from stewart_dynamics.arrays import Array
from stewart_dynamics.possible_errors.hypothesis import (
    find_errors, First, Hypothesis, likeliest, lines_of, Six, Table, When)


class File(NamedTuple):
    """A subject."""

    six: Six
    force: Array
    leg: list[str]
    unit: str = 'N'


def of(force: float | list[float] | None) -> File:
    """Return a subject with forces of the legs."""
    six = Six({'limits.force_max': force})
    return File(six, six['limits.force_max'], [f'leg_{n}' for n in range(1, 7)])


LARGE = Hypothesis[File]('force', lambda f: f.force - 10.0, '{force:.3g} {unit} at {leg}: in mN?')
ANY = Hypothesis[File]('any', lambda f: f.force > 0.0, '{six[limits.force_max]:g}')


@pytest.mark.parametrize(('table', 'force', 'lines'), [
    (LARGE, [1.0, 20.0, 30.0, 2.0, np.nan, 10.0], ['force: 30 N at leg_3: in mN?']),
    (LARGE, 10.0, []), (LARGE, None, []), (LARGE, np.inf, ['force: inf N at leg_1: in mN?']),
    ((LARGE, ANY), 11.0, ['force: 11 N at leg_1: in mN?', 'any: 11']),
    (First(LARGE, ANY), 11.0, ['force: 11 N at leg_1: in mN?']),
    (First(LARGE, ANY), 9.0, ['any: 9']),
    (First(When(lambda f: f.unit == 'kN', LARGE), (ANY, ANY)), 11.0, ['any: 11', 'any: 11']),
    ((lambda f: find_errors(ANY, f), ()), 1.0, ['any: 1'])])
def test_errors_are_found_in_the_order_of_their_table(
        table: Table[File], force: float | list[float] | None, lines: list[str]) -> None:
    assert [*lines_of(find_errors(table, of(force)))] == lines


def test_hypotheses_that_explain_data_alike_are_the_likeliest() -> None:
    tried = [(0.5, 'sign'), (0.02, 'unit'), (0.03, 'order'), (np.nan, 'frame'), (np.inf, 'side')]
    assert likeliest(tried, 0.1) == [(0.02, 'unit')]
    assert likeliest(tried, 0.1, alike=2.0) == [(0.02, 'unit'), (0.03, 'order')]
    assert likeliest(tried, 0.1, exact=0.6) == tried[:3]
    assert likeliest(tried, 0.01) == likeliest([], 1.0) == []
    evidence = [(-2e3, 'play'), (-1e3, 'drift'), (-1999.0, 'pose'), (0.0, 'scale')]
    assert likeliest(evidence, -7.0, 3.0, logarithms=True) == [evidence[0], evidence[2]]
    assert likeliest(evidence[3:], -7.0, 3.0, logarithms=True) == []
