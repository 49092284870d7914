# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Periods that are due by a steady clock."""

from __future__ import annotations

from stewart_dynamics.arrays import SECOND
from stewart_dynamics.ros.due_periods import DuePeriods


def test_stamps_do_not_add_up_rounding_errors() -> None:
    periods = DuePeriods(300.0, print, stamp=SECOND)
    assert [periods.stamp_of(n) for n in (0, 1, 2, 3, 300_000)] == [
        SECOND, SECOND + 3_333_333, SECOND + 6_666_667, SECOND + 10_000_000, 1001 * SECOND]


def test_nothing_is_due_before_the_begin_and_all_that_has_passed_after_it() -> None:
    said: list[str] = []
    periods = DuePeriods(10.0, said.append)
    assert not periods.begun
    assert not periods.due(0)
    periods.begin(5 * SECOND)
    assert periods.begun
    assert periods.stamp_of(10) == 6 * SECOND
    assert periods.due(0)[0] == 0
    assert not periods.due(1_000_000)  # a day later
    assert not said


def test_time_that_is_more_than_a_tenth_of_a_second_late_is_skipped() -> None:
    said: list[str] = []
    periods = DuePeriods(10.0, said.append)
    periods.begin(0)
    before = periods.stamp_of(-1000)  # due 100 s ago
    assert list(periods.due(-1000)) == [-1000]
    (text,) = said
    assert text.startswith('fell behind by 100.')
    assert text.endswith(' s: that time is skipped')
    # stamps go on with the clock
    assert 100 * SECOND <= periods.stamp_of(-1000) - before < 200 * SECOND
    assert not periods.due(-900)
