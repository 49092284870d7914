# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""Spectra: another library's, of any blocks, of uneven times, with gaps, and in bounded memory."""

from __future__ import annotations

import tracemalloc
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from referees import rng
from stewart_dynamics.arrays import Array
from stewart_dynamics.reporting.spectrum import (
    Density, drawn, ENOUGH, INTERVALS, LONGEST, SHORTEST, Spectrum)

signal = pytest.importorskip('scipy.signal')


def density_of(seconds: Array, values: Array, blocks: Any = (), timeout: float = 0.1) -> Density:
    found = spectrum_of(seconds, values, blocks, timeout).density()
    assert found is not None
    return found


def spectrum_of(seconds: Array, values: Array, blocks: Any = (), timeout: float = 0.1,
                ) -> Spectrum:
    """Return the spectrum of samples that are given in blocks, which end at these samples."""
    spectrum = Spectrum(len(values), timeout)
    edges = [0, *blocks, len(seconds)]
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        spectrum.add(seconds[begin:end], values[:, begin:end])
    return spectrum


def noise(many: int, channels: int = 2) -> Array:
    """Return white noise beside a weight that is far larger."""
    return rng().normal(size=(channels, many)) + 2000.0


@pytest.mark.parametrize(('many', 'rate'), [
    *((many, rate) for many in (64, 100, 1001, 5000) for rate in (1000.0, 100.0, 3.0)),
    (81_919, 1000.0), (81_920, 3.0), (200_000, 100.0)])
def test_it_is_that_of_scipy(many: int, rate: float) -> None:
    values = noise(many)
    found = density_of(np.arange(many) / rate, values)
    length = 2 * len(found.frequencies)
    assert SHORTEST <= length <= LONGEST
    assert length & (length - 1) == 0
    frequencies, powers = signal.welch(values, rate, nperseg=length)
    assert found.frequencies == pytest.approx(frequencies[1:], rel=1e-12)
    assert found.frequencies[-1] == pytest.approx(rate / 2.0)
    assert found.amplitudes == pytest.approx(np.sqrt(powers[:, 1:]), rel=1e-9)
    assert found.segments == (many - length) // (length // 2) + 1
    assert found.seconds == pytest.approx(length / rate)
    assert found.uneven == 0.0
    # the longest segments of which there are enough
    assert found.segments >= ENOUGH or length == SHORTEST
    assert length == LONGEST or many < (ENOUGH + 1) * length


def test_the_power_of_a_sine_is_under_its_peak() -> None:
    seconds = np.arange(20_000) * 1e-3
    found = density_of(seconds, 3.0 * np.sin(2.0 * np.pi * 12.3 * seconds)[None] - 500.0)
    near = np.abs(found.frequencies - 12.3) < 2.0
    power = np.sum(found.amplitudes[0, near] ** 2) * found.frequencies[0]
    assert power == pytest.approx(3.0 ** 2 / 2.0, rel=1e-3)
    # the mean of a segment is not that of whole periods: the lowest lines
    far = ~near & (found.frequencies > 1.0)
    assert found.amplitudes[0, far].max() < 1e-3 * found.amplitudes.max()


@given(st.data(), st.integers(1, 3000), st.booleans(), st.booleans())
def test_blocks_change_nothing(data: st.DataObject, many: int, uneven: bool, spoiled: bool,
                               ) -> None:
    random = rng(many)
    steps = np.full(many, 0.01)
    if uneven:
        steps *= random.uniform(0.5, 1.5, many)
        steps[random.random(many) < 0.01] = 3.0
        steps[random.random(many) < 0.01] = 0.0
    values = noise(many)
    if spoiled:
        values[1, random.random(many) < 0.003] = np.nan
    seconds = np.cumsum(steps)
    blocks = sorted(data.draw(st.lists(st.integers(0, many), max_size=8)))
    one, other = (spectrum_of(seconds, values, each).density() for each in ((), blocks))
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        assert one.segments == other.segments
        assert one.uneven == other.uneven
        assert one.amplitudes == pytest.approx(other.amplitudes, rel=1e-6)


def test_blocks_change_nothing_in_a_long_bag_with_gaps() -> None:
    steps = np.full(150_000, 1e-3)
    steps[[30_000, 31_000, 70_000, 81_000]] = 5.0
    seconds, values = np.cumsum(steps), noise(150_000)
    one = density_of(seconds, values)
    for size in (777, 40_000):
        other = density_of(seconds, values, range(size, 150_000, size))
        assert other.segments == one.segments
        assert other.amplitudes == pytest.approx(one.amplitudes, rel=1e-9)


@pytest.mark.parametrize('kind', ['gap', 'restart', 'nan'])
def test_no_segment_extends_across_a_break(kind: str) -> None:
    """A break between two noises of one level, far apart from each other."""
    many = 4000
    values = noise(many, 1)
    values[:, many // 2:] += 1e6
    steps = np.full(many, 1e-3)
    if kind == 'nan':
        values[:, many // 2] = np.nan
    else:
        steps[many // 2] = 0.0 if kind == 'restart' else 5.0
    found = density_of(np.cumsum(steps), values)
    # white noise of deviation 1
    assert np.mean(found.amplitudes ** 2) == pytest.approx(2.0 * 1e-3, rel=0.1)
    assert found.amplitudes.max() < 0.5


def test_stamps_in_whole_nanoseconds_are_even() -> None:
    stamps = np.round(np.arange(3000) / 333.0 * 1e9).astype(np.int64)
    values = noise(3000)
    found = density_of((stamps - stamps[0]) * 1e-9, values)
    assert found.uneven == 0.0
    _, powers = signal.welch(values, 333.0, nperseg=2 * len(found.frequencies))
    assert found.amplitudes == pytest.approx(np.sqrt(powers[:, 1:]), rel=1e-6)


def test_between_uneven_times_and_for_missing_samples_values_are_interpolated() -> None:
    random = rng()
    whole = np.arange(4000) * 1e-2
    seconds = np.delete(whole + random.uniform(-2e-3, 2e-3, 4000), random.integers(0, 4000, 50))
    seconds.sort()

    def wave(time: Array) -> Array:
        wave: Array = np.array([np.sin(2.0 * np.pi * 1.3 * time)])
        return wave

    found, even = density_of(seconds, wave(seconds)), density_of(whole, wave(whole))
    assert found.uneven > 0.5
    at = int(np.argmax(even.amplitudes[0]))
    assert int(np.argmax(found.amplitudes[0])) == at
    assert found.amplitudes[0, at] == pytest.approx(even.amplitudes[0, at], rel=0.02)
    # the error of interpolation is far below
    assert found.amplitudes[0, found.frequencies > 5.0].max() < 0.01 * even.amplitudes[0, at]


@pytest.mark.parametrize('many', [0, 1, 2, 63])
def test_too_few_samples_have_no_spectrum(many: int) -> None:
    assert spectrum_of(np.arange(many) * 0.01, noise(many)).density() is None


def test_samples_at_one_time_have_no_spectrum() -> None:
    assert spectrum_of(np.zeros(2000), noise(2000)).density() is None


def test_it_can_be_read_before_the_end() -> None:
    seconds, values = np.arange(2000) * 0.01, noise(2000)
    spectrum = spectrum_of(seconds[:1500], values[:, :1500])
    first, again = spectrum.density(), spectrum.density()
    assert first is not None
    assert again is not None
    assert np.array_equal(first.amplitudes, again.amplitudes)
    spectrum.add(seconds[1500:], values[:, 1500:])
    whole = spectrum.density()
    assert whole is not None
    assert np.array_equal(whole.amplitudes, density_of(seconds, values).amplitudes)


@pytest.mark.parametrize('gap', [None, 500])
def test_it_keeps_a_limited_number_of_samples(gap: int | None) -> None:
    """Neither samples nor spectra of a million samples take 20 MB; the samples have 56."""
    spectrum = Spectrum(6, 0.1)
    values = noise(100_000, 6)
    steps = np.full(100_000, 1e-3)
    if gap is not None:
        steps[::gap] = 1.0
    seconds = np.cumsum(steps)
    tracemalloc.start()
    try:
        for _ in range(10):
            seconds = seconds - seconds[0] + seconds[-1] + 1e-3
            spectrum.add(seconds, values)
        assert tracemalloc.get_traced_memory()[0] < 2_000_000
        tracemalloc.reset_peak()
        assert spectrum.density() is not None
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()


def test_a_line_has_the_lowest_and_the_highest_of_each_interval() -> None:
    frequencies = np.arange(1.0, 16_385.0)
    amplitudes = rng().random(16_384)
    amplitudes[12_345] = 9.0
    found, values = drawn(frequencies, amplitudes)
    assert len(found) <= 2 * INTERVALS
    assert np.all(np.diff(found) > 0.0)
    assert np.array_equal(values, amplitudes[np.searchsorted(frequencies, found)])
    assert (found[0], found[-1]) == (1.0, 16_384.0) or values.max() == 9.0
    assert values[found == 12_346.0].tolist() == [9.0]
    # where lines are farther apart than intervals, each is drawn
    assert np.array_equal(found[:20], frequencies[:20])
    few = drawn(frequencies[:30], amplitudes[:30])
    assert np.array_equal(few, (frequencies[:30], amplitudes[:30]))
