# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""How stamps follow each other."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st
import pytest

from stewart_dynamics.messages.stamp_order import Order, order_of
from stewart_dynamics.setpoints.rejections import check_stamp, TOO_OLD, TWICE

# Seconds of a header are int32.
STAMPS = st.integers(-2 ** 31 * 10 ** 9, 2 ** 31 * 10 ** 9)


@given(STAMPS, STAMPS, st.integers(0, 10 ** 12))
@example(-2 ** 31 * 10 ** 9, 2 ** 31 * 10 ** 9, 0)
def test_the_order_is_that_of_its_words(stamp: int, last: int, timeout: int) -> None:
    assert order_of(stamp, None, timeout) is Order.FRESH
    expected = (Order.FRESH if stamp > last else Order.TWICE if stamp == last
                else Order.TOO_OLD if last - stamp <= timeout else Order.RESTART)
    assert order_of(stamp, last, timeout) is expected
    assert order_of(stamp, stamp, timeout) is Order.TWICE
    assert order_of(last - timeout, last, timeout) is (
        Order.TOO_OLD if timeout else Order.TWICE)
    assert order_of(last - timeout - 1, last, timeout) is Order.RESTART


@pytest.mark.parametrize(('stamp', 'last', 'used', 'said'), [
    (5, None, True, []), (6, 5, True, []), (5, 5, False, [(TWICE, 'stamp 5 ns')]),
    (10 ** 9, 2 * 10 ** 9, False, [
        (TOO_OLD, 'stamp 1000000000 ns is 1 s older than the last used')]),
    (10 ** 9, 3 * 10 ** 9, True, ['stamps jumped back by 2 s: followed as a restart'])])
def test_a_stamp_is_used_or_rejected_and_a_restart_is_noticed(
        stamp: int, last: int | None, used: bool, said: list[object]) -> None:
    found: list[object] = []
    assert check_stamp(stamp, last, 10 ** 9, lambda *why: found.append(why), found.append) is used
    assert found == said
