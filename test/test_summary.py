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

"""The summary of a motion: peaks, crossings, spans of the warning, and its table."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from stewart_dynamics.summary import Summary

LEGS = ['front left', 'b', 'c', 'd', 'e', 'f']
SECOND = 1_000_000_000
NONE = (math.nan,) * 6


def summary_of(determinants: list[float], stamps: list[float] | None = None,
               **given: object) -> Summary:
    """Return the summary of samples of det(J), a second apart, or at these times."""
    times = range(len(determinants)) if stamps is None else stamps
    arguments = {
        'lengths': np.ones((len(determinants), 6)), 'forces': np.ones((len(determinants), 6)),
        'warnings': [], **given}
    return Summary.of(
        LEGS, [round((1000 + t) * SECOND) for t in times], determinants=determinants,
        **arguments)


def test_a_small_example() -> None:
    summary = Summary.of(
        LEGS, [10 * SECOND, 11 * SECOND, 12 * SECOND, 14 * SECOND],
        [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.5, 1.0, 3.0, 4.0, 5.0, 6.0],
         [0.5, 3.0, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]],
        [[10.0, -20.0, 5.0, 0.0, 1.0, 2.0], [-30.0, 15.0, 5.0, 0.0, 1.0, 2.0],
         [20.0, 25.0, 5.0, 0.0, 1.0, 3.0], [0.0, 0.0, 5.0, 0.0, 1.0, 2.0]],
        [3.0, 1.0, -1.0, -2.0],
        [(10 * SECOND, False), (11 * SECOND, True), (14 * SECOND, False)])
    assert summary.samples == 4
    assert summary.duration == 4.0
    assert [(p.leg, p.force, p.force_time) for p in summary.peaks[:3]] == [
        ('front left', -30.0, 1.0), ('b', 25.0, 2.0), ('c', 5.0, 0.0)]
    assert [(p.shortest, p.longest) for p in summary.peaks[:3]] == [
        (0.5, 1.5), (1.0, 3.0), (3.0, 3.0)]
    assert not any(p.clipped for p in summary.peaks)
    assert (summary.nearest, summary.nearest_time) == (1.0, 1.0)
    assert summary.crossings == (1.5,)
    assert summary.warnings == ((1.0, 4.0),)
    assert summary.table().splitlines() == [
        '4 setpoints in 4.00 s',
        '',
        'leg              peak force       at     length from        to',
        '                          N        s               m         m',
        'front left            -30.0     1.00          0.5000    1.5000',
        'b                      25.0     2.00          1.0000    3.0000',
        'c                       5.0     0.00          3.0000    3.0000',
        'd                       0.0     0.00          4.0000    4.0000',
        'e                       1.0     0.00          5.0000    5.0000',
        'f                       3.0     2.00          6.0000    6.0000',
        '',
        'det(J) crossed zero at t = 1.500 s: forces grow without bound there',
        'det(J) nearest zero: 1 m^3 at t = 1.00 s',
        'singularity warning from t = 1.00 s to 4.00 s: 0.50 s before the crossing']


def test_a_single_sample_is_enough() -> None:
    summary = summary_of([0.5])
    assert (summary.samples, summary.duration, summary.crossings) == (1, 0.0, ())
    table = summary.table()
    assert '1 setpoints in 0.00 s' in table
    assert 'det(J) did not cross zero' in table
    assert 'no singularity warning' in table


# Crossings

@pytest.mark.parametrize(('determinants', 'crossings'), [
    ([3.0, 1.0], ()), ([3.0, -1.0], (0.75,)), ([-1.0, 3.0], (0.25,)),
    ([1.0, -1.0, 1.0], (0.5, 1.5)), ([1.0, 0.0, -1.0], (1.0,)), ([1.0, 0.0, 1.0], ()),
    ([0.0, 0.0, 1.0], ()), ([-1.0, 0.0], ()), ([2.0, 0.0, 0.0, -1.0, 1.0], (1.0, 3.5)),
    ([0.0, -1.0, 0.0, 2.0], (2.0,)), ([1e-300, -1e-300], (0.5,)), ([0.0], ())])
def test_crossings_are_interpolated(
        determinants: list[float], crossings: tuple[float, ...]) -> None:
    assert summary_of(determinants).crossings == pytest.approx(crossings)


def test_crossings_stand_where_the_stamps_are() -> None:
    summary = summary_of([1.0, 3.0, -1.0], [0.0, 0.1, 0.3])
    assert summary.crossings == pytest.approx([0.25])


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(st.integers(-3, 3).map(float), min_size=1, max_size=30))
def test_there_are_as_many_crossings_as_changes_of_sign(determinants: list[float]) -> None:
    signs = [number > 0 for number in determinants if number]
    changes = sum(a != b for a, b in zip(signs, signs[1:], strict=False))
    summary = summary_of(determinants)
    assert len(summary.crossings) == changes
    assert list(summary.crossings) == sorted(summary.crossings)
    assert abs(summary.nearest) == min(map(abs, determinants))


def test_a_bag_that_loops_lasts_what_went_forward_and_crosses_nothing_in_its_jump() -> None:
    summary = summary_of([1.0, 1.0, -1.0, 1.0, 1.0, -1.0], [0.0, 1.0, 2.0, 0.0, 1.0, 2.0])
    assert summary.duration == 4.0
    assert summary.crossings == (1.5, 1.5)


# Forces

def test_legs_without_forces_say_so() -> None:
    forces = np.ones((3, 6))
    forces[:, 2] = math.nan
    forces[1] = NONE
    summary = summary_of([1.0, 1.0, 1.0], forces=forces)
    assert math.isnan(summary.peaks[2].force)
    assert summary.peaks[0].force == 1.0
    line = summary.table().splitlines()[6]
    assert line.startswith('c ')
    assert 'none' in line
    assert 'nan' not in summary.table()


def test_a_peak_at_its_limit_is_marked_as_clipped() -> None:
    forces = [[100.0, -100.0, 99.9, 0.0, 0.0, math.nan]] * 2
    summary = summary_of([1.0, 1.0], forces=forces, force_max=[100.0] * 6)
    assert [p.clipped for p in summary.peaks] == [True, True, False, False, False, False]
    lines = summary.table().splitlines()
    assert [('*' in line) for line in lines[4:10]] == [True, True, False, False, False, False]
    assert lines[10].startswith('* clipped to limits.force_max')
    unlimited = summary_of([1.0, 1.0], forces=forces)
    assert not any(p.clipped for p in unlimited.peaks)
    assert '*' not in unlimited.table()


# Warnings

def _warnings(*changes: tuple[float, bool]) -> list[tuple[int, bool]]:
    return [(round((1000 + time) * SECOND), on) for time, on in changes]


@pytest.mark.parametrize(('changes', 'spans'), [
    ([], ()), ([(0.0, False)], ()), ([(0.0, True)], ((0.0, math.inf),)),
    ([(0.0, False), (1.0, True), (2.0, False)], ((1.0, 2.0),)),
    ([(0.0, True), (1.0, False), (2.0, True), (3.0, False)], ((0.0, 1.0), (2.0, 3.0))),
    ([(0.0, False), (1.0, True), (2.0, False), (3.5, True)], ((1.0, 2.0), (3.5, math.inf)))])
def test_spans_of_the_warning(
        changes: list[tuple[float, bool]], spans: tuple[tuple[float, float], ...]) -> None:
    assert summary_of([1.0] * 5, warnings=_warnings(*changes)).warnings == spans


def test_the_table_says_how_long_before_a_crossing_the_warning_came() -> None:
    table = summary_of([2.0, 1.0, -1.0, -2.0, -3.0], warnings=_warnings(
        (0.0, False), (1.0, True), (2.0, False), (3.0, True))).table()
    assert 'warning from t = 1.00 s to 2.00 s: 0.50 s before the crossing' in table
    assert 'warning from t = 3.00 s to the end\n' in table + '\n'
    assert 'no singularity warning' not in table
