# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0


"""The curves of a bag: every extreme, in the order of time, for any split into blocks."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.typing import NDArray
import pytest

from stewart_dynamics.reporting.curves import BUCKETS, Curves, Frames

Array = NDArray[np.float64]

TIMEOUT = 0.1

VALUES = st.one_of(
    st.floats(-1e9, 1e9), st.sampled_from([math.nan, math.inf, 0.0, -1.0, 1.0]))


@st.composite
def samples(draw: st.DrawFn, most: int = 120) -> tuple[Array, Array, list[int]]:
    """Return times (N,), values (C, N) of up to three channels, and where to split."""
    number = draw(st.integers(1, most))
    steps = draw(st.lists(st.sampled_from([0.0, 0.01, 0.02, 5.0]), min_size=number,
                          max_size=number))
    channels = draw(st.integers(1, 3))
    values = draw(st.lists(st.lists(VALUES, min_size=number, max_size=number),
                           min_size=channels, max_size=channels))
    edges = draw(st.lists(st.integers(0, number), max_size=6))
    return np.cumsum(steps), np.array(values), sorted(edges)


def gathered(times: Array, values: Array, edges: list[int], buckets: int) -> Curves:
    """Return the curves of samples that come in blocks."""
    curves = Curves(TIMEOUT, buckets)
    for first, end in zip([0, *edges], [*edges, len(times)], strict=True):
        curves.add(times[first:end], values[:, first:end])
    return curves


def same(a: Array, b: Array) -> bool:
    return np.array_equal(a, b, equal_nan=True)


@given(samples(), st.sampled_from([2, 4, 8, 64]))
@pytest.mark.slow
def test_every_extreme_of_every_bucket_is_drawn_at_its_time(
        given_samples: tuple[Array, Array, list[int]], buckets: int) -> None:
    times, values, edges = given_samples
    curves = gathered(times, values, edges, buckets)
    size = curves.samples_in_bucket
    assert len(times) <= buckets * size
    for channel, truth in enumerate(values):
        at, drawn = curves.drawn(channel)
        assert np.all(np.diff(at) >= 0.0)
        assert np.isfinite(drawn).sum() <= np.isfinite(truth).sum()
        points = set(zip(at.tolist(), drawn.tolist(), strict=True))
        there = set(zip(times.tolist(), truth.tolist(), strict=True))
        assert all(point in there for point in points if not math.isnan(point[1]))
        for first in range(0, len(times), size):
            bucket = truth[first:first + size]
            known = np.flatnonzero(np.isfinite(bucket))
            for extreme in (np.argmin, np.argmax) if len(known) else ():
                best = first + known[extreme(bucket[known])]
                assert (times[best], truth[best]) in points


@given(samples(), st.sampled_from([2, 8]))
def test_blocks_change_nothing(
        given_samples: tuple[Array, Array, list[int]], buckets: int) -> None:
    times, values, edges = given_samples
    whole, split = (gathered(times, values, each, buckets) for each in ([], edges))
    for channel in range(len(values)):
        for a, b in zip(whole.drawn(channel), split.drawn(channel), strict=True):
            assert same(a, b)


@given(samples(), st.sampled_from([2, 8, 64]))
def test_no_line_is_drawn_across_what_is_missing(
        given_samples: tuple[Array, Array, list[int]], buckets: int) -> None:
    times, values, edges = given_samples
    curves = gathered(times, values, edges, buckets)
    breaks = curves.breaks()
    for channel in range(len(values)):
        at, drawn = curves.drawn(channel)
        joined = ~np.isnan(drawn[:-1]) & ~np.isnan(drawn[1:])
        for begun, ended in breaks:
            assert not np.any(joined & (at[:-1] <= begun) & (at[1:] >= ended))
        if curves.samples_in_bucket == 1:
            lost = ~np.isfinite(values[channel])
            assert int(np.isnan(drawn).sum()) == int(lost.sum()) + len(breaks)


def test_up_to_two_samples_a_bucket_all_are_drawn() -> None:
    rng = np.random.default_rng(1)
    times, values = np.arange(2 * BUCKETS) * 0.01, rng.standard_normal((1, 2 * BUCKETS))
    at, drawn = gathered(times, values, [700], BUCKETS).drawn(0)
    assert same(at, times)
    assert same(drawn, values[0])


def test_the_number_of_points_is_bounded_and_a_spike_of_one_sample_stays() -> None:
    curves = Curves(TIMEOUT)
    for block in range(200):
        values = np.sin(0.001 * np.arange(5000.0))[None]
        if block == 137:
            values[0, 1234] = -99.0
        curves.add((5000 * block + np.arange(5000)) * 1e-3, values)
    at, drawn = curves.drawn(0)
    assert curves.samples == 1_000_000
    assert BUCKETS / 2 <= 1_000_000 / curves.samples_in_bucket <= BUCKETS
    assert len(at) <= 2 * BUCKETS + 2
    assert drawn.min() == -99.0
    assert at[drawn.argmin()] == pytest.approx((5000 * 137 + 1234) * 1e-3, abs=1e-9)
    assert (at[0], at[-1]) == (0.0, pytest.approx(999.999))


def test_a_gap_is_distinguished_from_slow_samples() -> None:
    slow = np.arange(50) * 1.0
    with_gap = np.concatenate([slow, 80.0 + slow])
    values = np.zeros((1, 100))
    assert not len(gathered(slow, values[:, :50], [], BUCKETS).breaks())
    assert gathered(with_gap, values, [30], BUCKETS).breaks().tolist() == [[49.0, 80.0]]


def test_without_samples_nothing_is_drawn() -> None:
    curves = Curves(TIMEOUT)
    curves.add(np.empty(0), np.empty((2, 0)))
    assert [len(each) for each in curves.drawn(1)] == [0, 0]
    assert not len(curves.breaks())
    assert not len(Frames(3).chosen()[0])


@given(samples(), st.integers(2, 40))
def test_frames_are_true_samples_and_do_not_depend_on_blocks(
        given_samples: tuple[Array, Array, list[int]], most: int) -> None:
    times, values, edges = given_samples
    chosen = []
    for split in ([], edges):
        frames = Frames(len(values), most)
        for first, end in zip([0, *split], [*split, len(times)], strict=True):
            frames.add(times[first:end], values[:, first:end].T)
        chosen.append(frames.chosen())
    (at, numbers), (at_split, numbers_split) = chosen
    assert same(at, at_split)
    assert same(numbers, numbers_split)
    assert 1 <= len(at) <= most + 1
    assert (at[0], at[-1]) == (times[0], times[-1])
    assert np.all(np.diff(at) > 0.0)
    for time, row in zip(at, numbers, strict=True):
        assert any(same(row, values[:, n]) for n in np.flatnonzero(times == time))
    if len(np.unique(times)) <= most:
        assert same(at, np.unique(times))


def test_frames_of_a_long_bag_are_spread_evenly() -> None:
    frames = Frames(1)
    for block in range(100):
        times = (10_000 * block + np.arange(10_000)) * 1e-3
        frames.add(times, times[:, None])
    at, numbers = frames.chosen()
    assert 500 <= len(at) <= 1025
    assert same(at, numbers[:, 0])
    assert np.ptp(np.diff(at)[:-1]) <= 1.1e-3
