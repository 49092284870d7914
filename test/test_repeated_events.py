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

"""The log lines of repeated events."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from stewart_dynamics.ros.repeated_log import SECONDS, Series


def test_the_first_is_logged_at_once_and_the_last_when_the_series_ends() -> None:
    series = Series()
    assert series.add('a', 'one', 0.0) == 'one'
    assert series.add('a', 'two', 1.0) is None
    assert series.add('a', 'three', 2.0) is None
    assert series.over(2.0 + 0.99 * SECONDS) == []
    assert series.over(2.0 + SECONDS) == ['three (the last of 3)']
    assert series.over(100.0) == []
    assert series.add('a', 'anew', 101.0) == 'anew'


def test_a_single_one_is_logged_once() -> None:
    series = Series()
    assert series.add('a', 'one', 0.0) == 'one'
    assert series.over(100.0) == []


def test_of_many_one_in_five_seconds_is_logged_with_the_number_of_others() -> None:
    series = Series()
    lines = [(n, line) for n in range(101)
             if (line := series.add('a', f'number {n}', 0.1 * n)) is not None]
    assert lines == [(0, 'number 0'), (50, 'number 50 (and 49 before it)'),
                     (100, 'number 100 (and 49 before it)')]
    # the last one has been logged
    assert series.over(100.0) == []


def test_kinds_do_not_hide_each_other() -> None:
    series = Series()
    assert series.add('a', 'one', 0.0) == 'one'
    assert series.add('b', 'two', 0.0) == 'two'
    assert series.add('a', 'three', 1.0) is None
    assert series.over(SECONDS) == []
    assert series.over(1.0 + SECONDS) == ['three (the last of 2)']


def test_two_in_a_series_that_are_far_apart_are_both_logged() -> None:
    series = Series()
    assert series.add('a', 'one', 0.0) == 'one'
    assert series.add('a', 'two', SECONDS) == 'two'


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(st.tuples(st.sampled_from('ab'), st.floats(0.0, 4.0)), min_size=1))
def test_first_and_last_are_logged_and_none_is_lost(events: list[tuple[str, float]]) -> None:
    series, now = Series(), 0.0
    said: list[str] = []
    for n, (kind, pause) in enumerate(events):
        now += pause
        said += series.over(now)
        line = series.add(kind, f'{kind} {n}.', now)
        said += [line] if line is not None else []
    said += series.over(now + 2.0 * SECONDS)
    for kind in {kind for kind, _ in events}:
        own = [n for n, (of, _) in enumerate(events) if of == kind]
        lines = [line for line in said if line.startswith(kind)]
        assert lines[0] == f'{kind} {own[0]}.'
        assert lines[-1].startswith(f'{kind} {own[-1]}.')
